//! A round of the live monitor: a pose of each of 1,000 vehicles, and a judgement of all pairs.
//!
//! At 50 Hz a round must end within 20 ms. Run with `cargo bench -p tautline-watch --bench watch`.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::Vector3;

use tautline_watch::{Monitor, Plan, Pose, Settings};

/// Number of vehicles.
const VEHICLES: usize = 1000;
/// Time between two rounds [s].
const PERIOD_S: f64 = 0.02;

fn rounds(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("watch");
    for (name, spacing_m) in [("spread", 3.0), ("dense", 1.6)] {
        let settings = Settings { delta_m: 1.0, ..Settings::default() };
        let mut monitor = Monitor::new(settings, Plan::default()).expect("valid settings");
        let ids: Vec<_> = (0..VEHICLES).map(|k| k.to_string()).collect();
        let mut round = 0_u64;
        group.bench_function(format!("{VEHICLES} vehicles, {name}"), |bencher| {
            bencher.iter(|| {
                let t_s = round as f64 * PERIOD_S;
                round += 1;
                for (k, id) in ids.iter().enumerate() {
                    // All sway together on a grid, so that no pair violates.
                    let (sway, speed) = (0.2 * t_s.sin(), 0.2 * t_s.cos());
                    let grid = Vector3::new((k % 10) as f64, (k / 10 % 10) as f64, (k / 100) as f64) * spacing_m;
                    let position_m = grid + Vector3::new(sway, sway, 0.0);
                    let velocity_m_s = Some(Vector3::new(speed, speed, 0.0));
                    monitor.take(&Pose { t_s, id, position_m, velocity_m_s, accuracy_m: None }, t_s);
                }
                let of = monitor.assess(t_s);
                monitor.drain_events();
                black_box(of)
            });
        });
    }
    group.finish();
}

criterion_group!(benches, rounds);
criterion_main!(benches);
