//! Time of one audit step, compared with a plain sweep of all pairs.
//!
//! A square lattice with a spacing of 5 m and delta = 2 m drifts apart and back by 1 cm per step (240 Hz: 2.4 m/s).

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use tautline::audit::Auditor;
use tautline::swarm::{Rows, row};

const DELTA_M: f64 = 2.0;
const SPACING_M: f64 = 5.0;
const STEP_M: f64 = 0.01;
/// Number of steps between two turns.
const LEG: usize = 100;

/// Returns the positions of the lattice after each step of one lap. Every vehicle has its own heading.
fn positions_of_lap(n: usize) -> Vec<Rows> {
    let side = n.isqrt().max(1);
    let at = |step: usize| {
        let way = STEP_M * step.min(2 * LEG - step) as f64;
        Rows::from_fn(n, |i, axis| {
            let heading = i as f64 * 2.399_963;
            let lattice = [(i % side) as f64, (i / side) as f64, 0.0][axis] * SPACING_M;
            lattice + way * [heading.cos(), heading.sin(), 0.0][axis]
        })
    };
    (0..2 * LEG).map(at).collect()
}

fn audit_step(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("audit step");
    for n in [5, 100, 1000] {
        let lap = positions_of_lap(n);
        let mut auditor = Auditor::new(n, DELTA_M).expect("delta is in range");
        auditor.start(0.0, &lap[0]).expect("the start is finite");
        let mut step = 0;
        group.bench_function(BenchmarkId::from_parameter(n), |bencher| {
            bencher.iter(|| {
                step += 1;
                let finding = auditor.step(step as f64, &lap[step % lap.len()]).expect("the lap is finite");
                black_box(finding.closest)
            });
        });
        let outcome = auditor.finish();
        let pairs = outcome.pairs_checked as f64 / (outcome.steps + 1) as f64;
        println!("audit step/{n}: {pairs:.0} of {} pairs swept a step", n * (n - 1) / 2);
    }
    group.finish();
}

/// Lower bound for an audit of all pairs: the closed form alone, without list and second detector.
fn plain_sweep(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("plain sweep of all pairs");
    for n in [5, 100, 1000] {
        let lap = positions_of_lap(n);
        let mut step = 0;
        group.bench_function(BenchmarkId::from_parameter(n), |bencher| {
            bencher.iter(|| {
                step += 1;
                black_box(smallest_squared(&lap[(step - 1) % lap.len()], &lap[step % lap.len()]))
            });
        });
    }
    group.finish();
}

fn smallest_squared(from: &Rows, to: &Rows) -> f64 {
    let n = from.nrows();
    let mut smallest = f64::INFINITY;
    for i in 0..n {
        for j in i + 1..n {
            let start = row(from, j) - row(from, i);
            let by = row(to, j) - row(to, i) - start;
            let length_squared = by.norm_squared();
            let at = if length_squared > 0.0 { (-start.dot(&by) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
            smallest = smallest.min((start + by * at).norm_squared());
        }
    }
    smallest
}

criterion_group!(benches, audit_step, plain_sweep);
criterion_main!(benches);
