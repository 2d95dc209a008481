//! Measures the time from a datagram that makes a violation to its alarm, with 1,000 vehicles.
//!
//! A system id of `MAVLink` has one byte, so 250 vehicles send at 200 Hz over UDP: 50,000 datagrams a second, as of
//! 1,000 vehicles at 50 Hz. Another thread gives the positions of 750 more at 50 Hz, so that all pairs of 1,000
//! vehicles are judged. Prints the median and the 99th percentile of 200 alarms, and the share of one core that the
//! watch and its source use, on Linux. Run it with `--release`, and with `taskset -c 0` for one core.

use std::io;
use std::net::UdpSocket;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use mavlink_core::calculate_crc;
use nalgebra::Vector3;
use tautline_watch::source::{Feed, Input, MavlinkFrame, OwnedPose, channel, mavlink};
use tautline_watch::{ClockScope, Monitor, Notice, Output, Plan, Settings, Status, watch};

const VEHICLES: u32 = 250;
const MESSAGES: u32 = 4;
const OTHERS: u32 = 750;
const ROUNDS: u32 = 2000;

/// Time of the last datagram with a violation [ns since the start], 0 without one.
struct Alarms {
    start: Instant,
    sent_ns: Arc<AtomicU64>,
    delays_ns: Arc<Mutex<Vec<u64>>>,
}

/// Times of the processor: of all threads but the calling one, and of the calling one, since their start \[s\].
fn processor_s() -> [f64; 2] {
    let read = |path: std::path::PathBuf| -> f64 {
        let text = std::fs::read_to_string(path.join("schedstat")).unwrap_or_default();
        text.split(' ').next().and_then(|word| word.parse().ok()).map_or(f64::NAN, |ns: f64| ns * 1e-9)
    };
    let tasks = std::fs::read_dir("/proc/self/task").into_iter().flatten().flatten();
    let own_s = read("/proc/thread-self".into());
    [tasks.map(|task| read(task.path())).sum::<f64>() - own_s, own_s]
}

/// Gives the positions of vehicles at rest in a plane beside those of the datagrams.
fn give_others(feed: &Feed, round: u32) {
    for k in 0..OTHERS {
        let arrival_s = feed.now_s();
        let position_m = Vector3::new(f64::from(k % 25) * 3.0, f64::from(k / 25) * 3.0 + 10.0, 2.0);
        let (t_s, id) = (f64::from(round) * 0.02, format!("other {k}"));
        let pose = OwnedPose { t_s, id, position_m, velocity_m_s: Some(Vector3::zeros()), accuracy_m: None };
        // A full channel is a finding of the watch.
        let _ = feed.offer(Input::Pose(pose, arrival_s));
    }
}

impl Output for Alarms {
    fn notice(&mut self, notice: &Notice) -> io::Result<()> {
        let is_alarm = notice.status == Status::Violation;
        let sent_ns = if is_alarm { self.sent_ns.swap(0, Ordering::Relaxed) } else { 0 };
        if sent_ns > 0 {
            let now_ns = u64::try_from(self.start.elapsed().as_nanos()).unwrap_or(u64::MAX);
            self.delays_ns.lock().unwrap_or_else(PoisonError::into_inner).push(now_ns - sent_ns);
        }
        Ok(())
    }
}

/// Returns a frame of `LOCAL_POSITION_NED`.
fn frame(system: u8, time_ms: u32, [north, east, down]: [f32; 3]) -> Vec<u8> {
    let numbers = [north, east, down, 0.0, 0.0, 0.0].into_iter().flat_map(f32::to_le_bytes);
    let payload: Vec<u8> = time_ms.to_le_bytes().into_iter().chain(numbers).collect();
    let mut bytes = vec![0xFD, 28, 0, 0, 0, system, 1, 32, 0, 0];
    bytes.extend(payload);
    bytes.extend(calculate_crc(&bytes[1..], 185).to_le_bytes());
    bytes
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let settings = Settings { delta_m: 1.0, clocks: Some(ClockScope::PerVehicle), ..Settings::default() };
    let monitor = Monitor::new(settings, Plan::default())?;
    let stop = Arc::new(AtomicBool::new(false));
    let (feed, inputs) = channel(Arc::clone(&stop));
    let address = mavlink("127.0.0.1:0".parse()?, MavlinkFrame::Local, feed.clone())?;
    let (start, sent_ns, delays_ns) = (Instant::now(), Arc::new(AtomicU64::new(0)), Arc::new(Mutex::default()));
    let (sent, delays) = (Arc::clone(&sent_ns), Arc::clone(&delays_ns));
    let sender = std::thread::spawn(move || -> io::Result<[f64; 2]> {
        let socket = UdpSocket::bind("127.0.0.1:0")?;
        for round in 0..ROUNDS {
            let due = start + Duration::from_millis(u64::from(20 * round));
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
            give_others(&feed, round);
            for k in 0..VEHICLES * MESSAGES {
                // A burst beyond the buffer of the socket would be dropped.
                if k % 50 == 0 {
                    let due = due + Duration::from_millis(u64::from(k / 50));
                    std::thread::sleep(due.saturating_duration_since(Instant::now()));
                }
                let system = u8::try_from(k % VEHICLES + 1).unwrap_or(1);
                // Four messages of each id in a round, 5 ms apart on its clock.
                let time_ms = 1000 + 20 * round + 5 * (k / VEHICLES);
                let place = f32::from(system) * 3.0;
                let violates = round % 10 == 5 && k == VEHICLES * MESSAGES / 2;
                let north = if violates { place + 2.5 } else { place };
                if violates {
                    let now_ns = u64::try_from(start.elapsed().as_nanos()).unwrap_or(u64::MAX);
                    sent.store(now_ns, Ordering::Relaxed);
                }
                socket.send_to(&frame(system, time_ms, [north, 0.0, -2.0]), address)?;
            }
        }
        std::thread::sleep(Duration::from_millis(200));
        let used_s = processor_s();
        stop.store(true, Ordering::Relaxed);
        Ok(used_s)
    });
    let summary = watch(monitor, &inputs, &mut Alarms { start, sent_ns, delays_ns })?;
    let [used_s, sender_s] = sender.join().map_err(|_| "the sender panicked")??;
    let length_s = f64::from(ROUNDS) * 0.02;
    let mut delays = delays.lock().unwrap_or_else(PoisonError::into_inner).clone();
    delays.sort_unstable();
    let at = |share: usize| delays.get(delays.len() * share / 100).map_or(f64::NAN, |&ns| ns as f64 * 1e-6);
    let text = format!(
        "{} vehicles, {} alarms: median {:.2} ms, 99th percentile {:.2} ms; one core: watch {:.0} %, sender {:.0} %\n",
        summary.vehicles,
        delays.len(),
        at(50),
        at(99),
        100.0 * used_s / length_s,
        100.0 * sender_s / length_s
    );
    io::Write::write_all(&mut io::stdout(), text.as_bytes())?;
    Ok(())
}
