//! Measures the time from a datagram that makes a violation to its alarm, with 50,000 messages a second over UDP.
//!
//! This is the traffic of 1,000 vehicles at 50 Hz. A system id of `MAVLink` has one byte: 250 vehicles send at 200 Hz.
//! Prints the median and the 99th percentile of 200 alarms. Run it with `--release` on a machine with two free cores.

use std::io;
use std::net::UdpSocket;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use mavlink_core::calculate_crc;
use tautline_watch::source::{MavlinkFrame, channel, mavlink};
use tautline_watch::{ClockScope, Monitor, Notice, Output, Plan, Settings, watch};

const VEHICLES: u32 = 250;
const MESSAGES: u32 = 4;
const ROUNDS: u32 = 2000;

/// Time of the last datagram with a violation [ns since the start], 0 without one.
struct Alarms {
    start: Instant,
    sent_ns: Arc<AtomicU64>,
    delays_ns: Arc<Mutex<Vec<u64>>>,
}

impl Output for Alarms {
    fn notice(&mut self, notice: &Notice) -> io::Result<()> {
        let is_alarm = notice.event == "violation" || notice.json["state"] == "violation";
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
    let settings = Settings { delta_m: 1.0, accel_m_s2: 1e6, clocks: ClockScope::PerVehicle, ..Settings::default() };
    let monitor = Monitor::new(settings, Plan::default())?;
    let stop = Arc::new(AtomicBool::new(false));
    let (feed, inputs) = channel(Arc::clone(&stop));
    let address = mavlink("127.0.0.1:0".parse()?, MavlinkFrame::Local, feed)?;
    let (start, sent_ns, delays_ns) = (Instant::now(), Arc::new(AtomicU64::new(0)), Arc::new(Mutex::default()));
    let (sent, delays) = (Arc::clone(&sent_ns), Arc::clone(&delays_ns));
    let sender = std::thread::spawn(move || -> io::Result<()> {
        let socket = UdpSocket::bind("127.0.0.1:0")?;
        for round in 0..ROUNDS {
            let due = start + Duration::from_millis(u64::from(20 * round));
            std::thread::sleep(due.saturating_duration_since(Instant::now()));
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
        stop.store(true, Ordering::Relaxed);
        Ok(())
    });
    watch(monitor, &inputs, &mut Alarms { start, sent_ns, delays_ns })?;
    sender.join().map_err(|_| "the sender panicked")??;
    let mut delays = delays.lock().unwrap_or_else(PoisonError::into_inner).clone();
    delays.sort_unstable();
    let at = |share: usize| delays.get(delays.len() * share / 100).map_or(f64::NAN, |&ns| ns as f64 * 1e-6);
    let text = format!("{} alarms: median {:.2} ms, 99th percentile {:.2} ms\n", delays.len(), at(50), at(99));
    io::Write::write_all(&mut io::stdout(), text.as_bytes())?;
    Ok(())
}
