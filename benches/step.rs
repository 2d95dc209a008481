//! The whole step of the loop (law, engine, audit) against the engine's step alone with the same bodies.
//!
//! Run with `cargo bench --bench step`. The swarm is a square lattice of spacing 4 m that contracts to 3 m under the
//! edge-tension law on the complete graph, delta = 2 m. Compare times within one run only: `whole / bare` is the price of
//! control and proof.

use std::ops::ControlFlow;

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use tautline::formation::Formation;
use tautline::plant::{Path, rapier};
use tautline::scenario::{Precision, Scenario};
use tautline::sim::{self, Parts};
use tautline::swarm::{Rows, Swarm};

const DELTA_M: f64 = 2.0;
/// Steps in one measured flight: one second, so that setting up and the audit of the start weigh little.
const STEPS: u16 = 240;

fn lattice(count: usize) -> Scenario {
    let start = Swarm::at_rest(Formation::grid(count, 4.0).slots_m);
    Scenario::new("lattice", start, Formation::grid(count, 3.0), DELTA_M, f64::from(STEPS) / 240.0)
}

fn steps(criterion: &mut Criterion) {
    for count in [5, 100, 1000] {
        let mut group = criterion.benchmark_group(format!("step/{count}"));
        group.sample_size(10).throughput(Throughput::Elements(u64::from(STEPS)));
        let scenario = lattice(count);
        scenario.validate().expect("the lattice can be flown");
        group.bench_function(BenchmarkId::from_parameter("bare engine"), |bencher| {
            let (held, mut state, mut path) = (Rows::zeros(count), scenario.start.clone(), Path::default());
            bencher.iter_batched(
                || rapier::plant(&scenario, Precision::Single),
                |mut plant| {
                    for _ in 0..STEPS {
                        plant.apply(&held, &mut state);
                        plant.advance(scenario.time.dt_s, &mut state, &mut path).expect("finite");
                    }
                },
                BatchSize::LargeInput,
            );
        });
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let name = format!("whole, {threads} threads");
            group.bench_function(BenchmarkId::from_parameter(name), |bencher| {
                bencher.iter_batched(
                    || Parts::of(&scenario).expect("a law"),
                    |parts| {
                        pool.install(|| sim::fly(&scenario, parts, &mut (), &mut |_| ControlFlow::Continue(())))
                            .expect("a clean flight")
                    },
                    BatchSize::LargeInput,
                );
            });
        }
        group.finish();
    }
}

criterion_group!(benches, steps);
criterion_main!(benches);
