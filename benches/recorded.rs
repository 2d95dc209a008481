//! The judge of recordings against the straightforward sweep of every pair over every interval, on the same items.
//!
//! The show: vehicles stand on a grid 2.5 m apart, take off row by row, bend into half a cylinder that breathes, unroll into
//! a wall that waves, and land again, on smooth paths seen at 10 Hz. Neighbours stay neighbours, most pairs are far apart.

use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::hint::black_box;
use std::time::Instant;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use nalgebra::Vector3;
use tautline::audit::recorded::{Question, Who, judge};
use tautline::track::{Item, Sample};

const DELTA_M: f64 = 1.5;
const COLUMNS: usize = 40;
const SAMPLES: usize = 2000;
const RATE_HZ: f64 = 10.0;

/// From 0 to 1 between two times, with no speed at either.
fn smooth(time_s: f64, from_s: f64, to_s: f64) -> f64 {
    let x = ((time_s - from_s) / (to_s - from_s)).clamp(0.0, 1.0);
    x * x * x * (10.0 - 15.0 * x + 6.0 * x * x)
}

fn place(vehicle: usize, time_s: f64) -> Vector3<f64> {
    let (row, column) = ((vehicle / COLUMNS) as f64, (vehicle % COLUMNS) as f64);
    let ground = Vector3::new(column * 2.5, row * 2.5, 0.0);
    let hover = ground + Vector3::new(0.0, 0.0, 20.0 + 3.0 * row);
    let angle = column / (COLUMNS - 1) as f64 * PI;
    let radius = 38.0 + 2.0 * (0.4 * time_s).sin();
    let cylinder = Vector3::new(50.0 - radius * angle.cos(), 30.0 + radius * angle.sin(), 20.0 + 3.0 * row);
    let wave = (0.6 * time_s + 0.3 * column).sin();
    let wall = Vector3::new(column * 3.5 - 20.0, 30.0 + wave, 20.0 + 3.0 * row);
    let start_s = 5.0 + row;
    let mut at = ground.lerp(&hover, smooth(time_s, start_s, start_s + 15.0));
    at = at.lerp(&cylinder, smooth(time_s, 45.0, 65.0));
    at = at.lerp(&wall, smooth(time_s, 100.0, 120.0));
    at = at.lerp(&hover, smooth(time_s, 150.0, 165.0));
    at.lerp(&ground, smooth(time_s, 165.0 + 0.4 * (25.0 - row), 195.0))
}

fn show(vehicles: usize) -> Vec<Item> {
    (0..SAMPLES)
        .flat_map(|k| {
            let time_s = k as f64 / RATE_HZ;
            (0..vehicles).map(move |vehicle| {
                let position_m = place(vehicle, time_s);
                Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None })
            })
        })
        .collect()
}

#[derive(Debug, PartialEq)]
struct Answer {
    min_m: f64,
    violating: BTreeSet<(usize, usize)>,
}

fn ours(names: &[String], items: &[Item]) -> Answer {
    let outcome = judge(names, items, Question::delta(DELTA_M)).expect("a show can be judged");
    let violating = outcome.violations.iter().filter_map(|violation| match violation.who {
        Who::Pair(pair) => Some((pair.first(), pair.second())),
        Who::Obstacle { .. } => None,
    });
    Answer {
        min_m: outcome.closest.first().map_or(f64::INFINITY, |closest| closest.lower_m),
        violating: violating.collect(),
    }
}

/// Every pair over every interval, nothing else: no second detector, no list of the closest.
fn straightforward(vehicles: usize, items: &[Item]) -> Answer {
    let mut table: Vec<Vector3<f64>> = Vec::with_capacity(items.len());
    for item in items {
        if let Item::Sample(sample) = item {
            table.push(sample.position_m);
        }
    }
    let (mut least, mut violating) = (f64::INFINITY, BTreeSet::new());
    for (from, to) in table.chunks_exact(vehicles).zip(table.chunks_exact(vehicles).skip(1)) {
        for i in 0..vehicles {
            for j in i + 1..vehicles {
                let start = from[j] - from[i];
                let by = to[j] - to[i] - start;
                let length = by.norm_squared();
                let at = if length > 0.0 { (-start.dot(&by) / length).clamp(0.0, 1.0) } else { 0.0 };
                let squared = (start + by * at).norm_squared();
                if squared < least {
                    least = squared;
                }
                if squared < DELTA_M * DELTA_M {
                    violating.insert((i, j));
                }
            }
        }
    }
    Answer { min_m: least.sqrt(), violating }
}

/// Largest difference of the two minima: both are rounded in their own order.
const ROUNDING_M: f64 = 1e-12;

fn recorded(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("recorded show");
    group.sample_size(10);
    for vehicles in [5, 100, 1000] {
        let names: Vec<String> = (1..=vehicles).map(|k| k.to_string()).collect();
        let items = show(vehicles);
        let timed = |work: &dyn Fn() -> Answer| {
            let start = Instant::now();
            let answer = work();
            (answer, start.elapsed().as_secs_f64())
        };
        let (mine, mine_s) = timed(&|| ours(&names, &items));
        let (theirs, theirs_s) = timed(&|| straightforward(vehicles, &items));
        assert!((mine.min_m - theirs.min_m).abs() < ROUNDING_M, "{} {}", mine.min_m, theirs.min_m);
        assert_eq!(mine.violating, theirs.violating);
        println!(
            "{vehicles} vehicles x {SAMPLES} samples: min {:.6} m, {} pairs violate; first run {:.1} times as fast",
            mine.min_m,
            mine.violating.len(),
            theirs_s / mine_s
        );
        group.bench_function(BenchmarkId::new("judge", vehicles), |bencher| {
            bencher.iter(|| black_box(ours(&names, black_box(&items))));
        });
        group.bench_function(BenchmarkId::new("straightforward", vehicles), |bencher| {
            bencher.iter(|| black_box(straightforward(vehicles, black_box(&items))));
        });
    }
    group.finish();
}

criterion_group!(benches, recorded);
criterion_main!(benches);
