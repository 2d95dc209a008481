//! Time of an audit of a recording, and of a plain sweep of all pairs and intervals for comparison.
//!
//! The recording is a show with samples at 10 Hz. Vehicles start on a grid with 2.5 m spacing and take off row by row.
//! They form half a cylinder that pulsates, then a wall that waves, and land. Neighbours stay neighbours.

use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::hint::black_box;
use std::time::Instant;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use nalgebra::Vector3;
use tautline::audit::recorded::{Approach, ObjectPair, Settings, audit};
use tautline::audit::{Cylinder, WellClear};
use tautline::track::{Item, Sample};

/// Limit that the show keeps.
const DELTA_M: f64 = 1.5;
/// Limit that the show violates.
const TOO_MUCH_M: f64 = 2.2;
const COLUMNS: usize = 40;
const SAMPLES: usize = 2000;
const RATE_HZ: f64 = 10.0;
/// An interval longer than this is a gap \[s\].
const LONGEST_INTERVAL_S: f64 = 1.5 / RATE_HZ;
/// Closest pairs that are listed.
const KEPT: usize = 10;

/// Returns a smooth step from 0 to 1 between two times, with zero slope at both.
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

/// Result of both: number of gaps, the ten closest pairs, and the intervals of pairs below delta.
#[derive(Debug)]
struct Answer {
    gaps: usize,
    closest: Vec<Closest>,
    below: BTreeMap<(usize, usize), Vec<(f64, f64)>>,
}

#[derive(Clone, Copy, Debug)]
struct Closest {
    pair: (usize, usize),
    distance_m: f64,
    time_s: f64,
}

fn ours(names: &[String], items: &[Item], delta_m: f64) -> Answer {
    let outcome = audit(names, items, Settings::delta(delta_m)).expect("a show can be judged");
    let pair = |who: ObjectPair| match who {
        ObjectPair::Vehicles(pair) => (pair.first(), pair.second()),
        ObjectPair::Obstacle { .. } => unreachable!("there are no obstacles"),
    };
    let mut below: BTreeMap<_, Vec<_>> = BTreeMap::new();
    for violation in &outcome.violations {
        below.entry(pair(violation.pair)).or_default().push((violation.from_s, violation.to_s));
    }
    let closest = |of: &Approach| Closest { pair: pair(of.pair), distance_m: of.lower_m, time_s: of.time_s };
    Answer { gaps: outcome.gaps.len(), closest: outcome.closest.iter().map(closest).collect(), below }
}

/// Sweeps every pair over every interval, for vehicles that are in every sample, without a second detector.
///
/// Also checks that numbers are finite and times increase, and counts gaps: an audit needs these as well.
fn straightforward(vehicles: usize, items: &[Item], delta_m: f64) -> Answer {
    let mut places: Vec<Vector3<f64>> = Vec::with_capacity(items.len());
    let mut times_s = Vec::with_capacity(items.len() / vehicles);
    let mut last_s = vec![None; vehicles];
    let mut gaps = 0;
    for item in items {
        let Item::Sample(sample) = item else { panic!("the show is sampled") };
        assert!(sample.position_m.iter().all(|x| x.is_finite()) && sample.time_s.is_finite());
        if let Some(last_s) = last_s[sample.vehicle].replace(sample.time_s) {
            assert!(sample.time_s > last_s);
            gaps += usize::from(sample.time_s - last_s > LONGEST_INTERVAL_S);
        }
        if sample.vehicle == 0 {
            times_s.push(sample.time_s);
        }
        places.push(sample.position_m);
    }
    let mut least = vec![(f64::INFINITY, 0.0); vehicles * (vehicles - 1) / 2];
    let mut below: BTreeMap<_, Vec<(f64, f64)>> = BTreeMap::new();
    let rows = places.chunks_exact(vehicles);
    for ((from, to), times_s) in rows.clone().zip(rows.skip(1)).zip(times_s.windows(2)) {
        let (from_s, length_s) = (times_s[0], times_s[1] - times_s[0]);
        let mut pair = 0;
        for i in 0..vehicles {
            for j in i + 1..vehicles {
                let start = from[j] - from[i];
                let by = to[j] - to[i] - start;
                let length = by.norm_squared();
                let at = if length > 0.0 { (-start.dot(&by) / length).clamp(0.0, 1.0) } else { 0.0 };
                let squared = (start + by * at).norm_squared();
                if squared < least[pair].0 {
                    least[pair] = (squared, from_s + length_s * at);
                }
                if squared < delta_m * delta_m {
                    // Times at which the separation on the line of the interval is delta.
                    let foot = -start.dot(&by) / length;
                    let half = ((delta_m * delta_m - (start + by * foot).norm_squared()) / length).sqrt();
                    let span = [foot - half, foot + half].map(|u| from_s + length_s * u.clamp(0.0, 1.0));
                    let spans = below.entry((i, j)).or_default();
                    match spans.last_mut() {
                        Some(last) if last.1 >= span[0] => last.1 = span[1],
                        _ => spans.push((span[0], span[1])),
                    }
                }
                pair += 1;
            }
        }
    }
    let pairs = (0..vehicles).flat_map(|i| (i + 1..vehicles).map(move |j| (i, j)));
    let closest = |(pair, (squared, time_s)): (_, (f64, f64))| Closest { pair, distance_m: squared.sqrt(), time_s };
    let mut closest: Vec<_> = pairs.zip(least).map(closest).collect();
    closest.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
    closest.truncate(KEPT);
    Answer { gaps, closest, below }
}

/// Largest difference of two distances \[m\] or times \[s\], whose rounding differs.
const ROUNDING: f64 = 1e-9;

/// Asserts that two results agree. Equally close pairs may have any order and any of their closest times.
fn agree(mine: &Answer, theirs: &Answer) {
    assert_eq!(mine.gaps, theirs.gaps);
    assert_eq!(mine.closest.len(), theirs.closest.len());
    for (a, b) in mine.closest.iter().zip(&theirs.closest) {
        assert!((a.distance_m - b.distance_m).abs() < ROUNDING, "{a:?} {b:?}");
        for of in [a, b] {
            assert!((of.distance_m - distance_m(of.pair, of.time_s)).abs() < ROUNDING, "{of:?}");
        }
    }
    assert!(mine.below.keys().eq(theirs.below.keys()));
    for (pair, mine) in &mine.below {
        let theirs = &theirs.below[pair];
        assert_eq!(mine.len(), theirs.len(), "{pair:?}");
        for (a, b) in mine.iter().zip(theirs) {
            assert!((a.0 - b.0).abs() < ROUNDING && (a.1 - b.1).abs() < ROUNDING, "{pair:?} {a:?} {b:?}");
        }
    }
}

/// Returns the separation of a pair at a time, on straight lines between samples.
fn distance_m((i, j): (usize, usize), time_s: f64) -> f64 {
    let from = (time_s * RATE_HZ).floor();
    let apart_m = |k: f64| place(j, k / RATE_HZ) - place(i, k / RATE_HZ);
    apart_m(from).lerp(&apart_m(from + 1.0), time_s * RATE_HZ - from).norm()
}

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
        let (mine, mine_s) = timed(&|| ours(&names, &items, DELTA_M));
        let (theirs, theirs_s) = timed(&|| straightforward(vehicles, &items, DELTA_M));
        agree(&mine, &theirs);
        println!(
            "{vehicles} vehicles x {SAMPLES} samples: min {:.6} m, first run {:.1} times as fast",
            mine.closest[0].distance_m,
            theirs_s / mine_s
        );
        if vehicles <= 100 {
            let too_close = ours(&names, &items, TOO_MUCH_M);
            agree(&too_close, &straightforward(vehicles, &items, TOO_MUCH_M));
            println!("{} pairs are below {TOO_MUCH_M} m", too_close.below.len());
        }
        group.bench_function(BenchmarkId::new("judge", vehicles), |bencher| {
            bencher.iter(|| black_box(ours(&names, black_box(&items), DELTA_M)));
        });
        group.bench_function(BenchmarkId::new("straightforward", vehicles), |bencher| {
            bencher.iter(|| black_box(straightforward(vehicles, black_box(&items), DELTA_M)));
        });
    }
    group.finish();
}

/// Times the other limits of pairs on the same show: cylinders, and well clear with and without a horizon.
fn limits(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("limits of pairs");
    group.sample_size(10);
    let cylinder = Cylinder { horizontal_m: DELTA_M, vertical_m: 1.0 };
    let near = WellClear { horizontal_m: DELTA_M, vertical_m: 1.0, tau_s: 0.0 };
    let limits = [
        ("delta", Settings::delta(DELTA_M)),
        ("cylinder", Settings { cylinder: Some(cylinder), ..Settings::default() }),
        ("well clear", Settings { well_clear: Some(near), ..Settings::default() }),
        ("well clear, tau 1 s", Settings { well_clear: Some(WellClear { tau_s: 1.0, ..near }), ..Settings::default() }),
    ];
    for vehicles in [5, 100, 1000] {
        let names: Vec<String> = (1..=vehicles).map(|k| k.to_string()).collect();
        let items = show(vehicles);
        for (name, settings) in &limits {
            group.bench_function(BenchmarkId::new(*name, vehicles), |bencher| {
                bencher.iter(|| black_box(audit(&names, black_box(&items), settings.clone()).expect("judged")));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, recorded, limits);
criterion_main!(benches);
