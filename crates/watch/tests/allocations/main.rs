//! The monitor allocates nothing once all vehicles are known, and the memory of a watch does not grow with time.
//!
//! One program without a test harness: the counter is global, and a harness has threads of its own.

use std::alloc::System;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use nalgebra::Vector3;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};
use tautline_core::track::Piece;
use tautline_recordings::read::LivePlan;
use tautline_watch::source::{Input, OwnedPose, PlanMessage, channel};
use tautline_watch::{Bound, MessageError, Monitor, Notice, Output, Plan, Pose, Problem, Settings, TimeBase, watch};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

const VEHICLES: usize = 100;

/// Takes a pose of each vehicle and judges; one pair violates and parts again, and one message is wrong.
fn round(monitor: &mut Monitor, ids: &[String], round: u32) {
    let t_s = f64::from(round) * 0.02;
    for (k, id) in ids.iter().enumerate() {
        let offset = if k == 0 { 1.5 * (1.0 + t_s.sin()) } else { 0.0 };
        let position_m = Vector3::new(3.0 * k as f64 + offset, 0.0, 0.0);
        monitor.take(&Pose { t_s, id, position_m, velocity_m_s: None, accuracy_m: None }, t_s);
    }
    monitor.take(
        &Pose { t_s: f64::NAN, id: &ids[0], position_m: Vector3::zeros(), velocity_m_s: None, accuracy_m: None },
        t_s,
    );
    monitor.assess(t_s);
    monitor.drain_events();
}

fn main() {
    rounds_allocate_nothing();
    memory_of_a_watch_does_not_grow();
}

fn rounds_allocate_nothing() {
    let mut monitor = Monitor::new(Settings::default(), Plan::default()).expect("valid settings");
    let ids: Vec<_> = (0..VEHICLES).map(|k| k.to_string()).collect();
    for k in 0..200 {
        round(&mut monitor, &ids, k);
    }
    // Two plans in conflict over all rounds.
    for drone in 0..2 {
        let piece = Piece { vehicle: 0, from_s: 0.0, to_s: 100.0, coefficients: vec![Vector3::zeros()] };
        let plan = LivePlan { drone, start_ns: 4_000_000_000, pieces: vec![piece], is_held: true };
        let message = PlanMessage { topic: String::new(), plan, arrival_s: 3.98, arrival_ns: 0 };
        monitor.take_plan(&message).expect("a plan");
    }
    monitor.drain_events();
    assert_eq!(monitor.plan_counts(), Some([2, 1]));
    let before = monitor.violations();
    let region = Region::new(ALLOCATOR);
    for k in 200..2000 {
        round(&mut monitor, &ids, k);
    }
    let change = region.change();
    assert_eq!((change.allocations, change.reallocations), (0, 0), "{change:?}");
    assert!(monitor.violations() > before, "violations began and ended in the rounds");
}

/// Counts the poses and notices of a watch.
struct Counted {
    poses: Arc<AtomicU64>,
    notices: u64,
}

impl Output for Counted {
    fn notice(&mut self, _notice: &Notice) -> io::Result<()> {
        self.notices += 1;
        Ok(())
    }

    fn pose(&mut self, _time_s: f64, _pose: &OwnedPose) -> io::Result<()> {
        self.poses.fetch_add(1, Ordering::Release);
        Ok(())
    }
}

/// Watches 20 vehicles at 50 Hz for half an hour of their stamps, or for 24 h with `TAUTLINE_LONG`. Each second a pair
/// violates and parts again, a message is wrong, and a vehicle signs off and comes back.
fn memory_of_a_watch_does_not_grow() {
    let seconds: u32 = if std::env::var_os("TAUTLINE_LONG").is_some() { 24 * 3600 } else { 1800 };
    let settings = Settings { time_base: TimeBase::Stamps, accel_m_s2: Bound::declared(1e3), ..Settings::default() };
    let monitor = Monitor::new(settings, Plan::default()).expect("valid settings");
    let (feed, inputs) = channel(Arc::new(AtomicBool::new(false)));
    let poses = Arc::new(AtomicU64::new(0));
    let taken = Arc::clone(&poses);
    let sender = std::thread::spawn(move || {
        let ids: Vec<_> = (0..20).map(|k| k.to_string()).collect();
        let wrong = MessageError { place: "line 1".to_owned(), problem: Problem::NoName };
        let (mut sent, mut held) = (0_u64, Vec::new());
        for second in 0..seconds {
            for tick in 0..50 {
                let t_s = f64::from(second) + f64::from(tick) / 50.0;
                for (k, id) in ids.iter().enumerate() {
                    let offset_m = if k == 0 && tick > 25 { 2.5 } else { 0.0 };
                    let position_m = Vector3::new(3.0 * k as f64 + offset_m, 0.0, 0.0);
                    let pose = OwnedPose {
                        t_s,
                        id: id.clone(),
                        position_m,
                        velocity_m_s: Some(Vector3::zeros()),
                        accuracy_m: None,
                    };
                    assert!(feed.send(Input::Pose(pose, t_s)));
                    sent += 1;
                }
            }
            let end_s = f64::from(second) + 0.99;
            assert!(feed.send(Input::Garbage(wrong.clone(), end_s)));
            assert!(feed.send(Input::SignOff("19".to_owned(), end_s, end_s)));
            // Nothing waits at the measurement but the last two inputs.
            if second % 60 == 59 {
                while taken.load(Ordering::Acquire) < sent {
                    std::thread::yield_now();
                }
                let stats = ALLOCATOR.stats();
                held.push(stats.bytes_allocated.wrapping_sub(stats.bytes_deallocated));
            }
        }
        (sent, held)
    });
    let mut counted = Counted { poses, notices: 0 };
    let summary = watch(monitor, &inputs, &mut counted).expect("outputs do not fail");
    let (sent, held) = sender.join().expect("sends");
    // One byte for each pose would be far more.
    let (first, last) = (held[held.len() / 10], held[held.len() - 1]);
    assert!(last <= first + 65_536, "{first} bytes, then {last} bytes after {sent} poses");
    assert!(sent / 10 > 65_536 && counted.notices > u64::from(seconds), "{} notices", counted.notices);
    assert!(summary.violations + 2 > u64::from(seconds), "{summary:?}");
}
