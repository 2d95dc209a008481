//! The monitor allocates nothing once all vehicles are known.
//!
//! One program without a test harness: the counter is global, and a harness has threads of its own.

use std::alloc::System;

use nalgebra::Vector3;
use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};
use tautline_watch::{Monitor, Plan, Pose, Settings};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

const VEHICLES: usize = 100;

/// Takes a pose of each vehicle and judges; one pair violates and parts again, and one message is wrong.
fn round(monitor: &mut Monitor, ids: &[String], round: u32) {
    let t_s = f64::from(round) * 0.02;
    for (k, id) in ids.iter().enumerate() {
        let offset = if k == 0 { 1.5 * (1.0 + t_s.sin()) } else { 0.0 };
        let position_m = Vector3::new(3.0 * k as f64 + offset, 0.0, 0.0);
        monitor.take(&Pose { t_s, id, position_m, velocity_m_s: None }, t_s);
    }
    monitor.take(&Pose { t_s: f64::NAN, id: &ids[0], position_m: Vector3::zeros(), velocity_m_s: None }, t_s);
    monitor.assess(t_s);
    monitor.drain_events();
}

fn main() {
    let mut monitor = Monitor::new(Settings::default(), Plan::default()).expect("valid settings");
    let ids: Vec<_> = (0..VEHICLES).map(|k| k.to_string()).collect();
    for k in 0..200 {
        round(&mut monitor, &ids, k);
    }
    let before = monitor.violations();
    let region = Region::new(ALLOCATOR);
    for k in 200..2000 {
        round(&mut monitor, &ids, k);
    }
    let change = region.change();
    assert_eq!((change.allocations, change.reallocations), (0, 0), "{change:?}");
    assert!(monitor.violations() > before, "violations began and ended in the rounds");
}
