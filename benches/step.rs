//! Time of a whole step (law, engine, audit), and of the engine's step alone with the same bodies on the same paths.
//!
//! Run with `cargo bench --bench step`. The swarm is a square lattice that contracts from 4 m to 3 m under the
//! edge-tension law on the complete graph, with delta = 2 m. Larger swarms fly under the displacement law:
//! `cargo bench --bench step -- displacement`. Compare times of one run only: `whole / bare` is the overhead of law and
//! audit.

use std::ops::ControlFlow;

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use tautline::formation::Formation;
use tautline::law::{DisplacementKeys, LawSpec};
use tautline::plant::{StepPath, rapier};
use tautline::scenario::Scenario;
use tautline::sim::{self, Simulation};
use tautline::swarm::{Rows, Swarm};

const DELTA_M: f64 = 2.0;
/// Steps of a flight. Its set-up is not measured.
const STEPS: u16 = 240;

/// Returns a lattice that contracts for `steps`.
fn lattice(count: usize, steps: u16) -> Scenario {
    let start = Swarm::at_rest(Formation::grid(count, 4.0).slots_m);
    Scenario::new("lattice", start, Formation::grid(count, 3.0), DELTA_M, f64::from(steps) / 240.0)
}

fn edge_tension(criterion: &mut Criterion) {
    for count in [5, 100, 1000] {
        steps(criterion, &format!("step/{count}"), &lattice(count, STEPS), STEPS);
    }
}

fn displacement(criterion: &mut Criterion) {
    for (count, steps) in [(1000, STEPS), (10_000, STEPS), (100_000, STEPS / 4)] {
        let mut scenario = lattice(count, steps);
        scenario.law = LawSpec::Displacement(DisplacementKeys::default());
        scenario.arrival.hold_s = 0.0;
        self::steps(criterion, &format!("step/displacement/{count}"), &scenario, steps);
    }
}

/// Returns the commands of a flight at the beginning of each step \[m/s^2\]. Bodies at rest would cost the engine less.
fn commands(scenario: &Scenario, steps: u16) -> Vec<Rows> {
    let mut simulation = Simulation::new(scenario).expect("a law and a judge");
    let step = |_| {
        let command = simulation.control().clone();
        simulation.step();
        command
    };
    (0..steps).map(step).collect()
}

fn steps(criterion: &mut Criterion, name: &str, scenario: &Scenario, steps: u16) {
    let mut group = criterion.benchmark_group(name);
    group.sample_size(10).throughput(Throughput::Elements(u64::from(steps)));
    scenario.validate().expect("the lattice can be flown");
    group.bench_function(BenchmarkId::from_parameter("bare engine"), |bencher| {
        let (commands, mut state, mut path) = (commands(scenario, steps), scenario.start.clone(), StepPath::default());
        bencher.iter_batched(
            || rapier::plant(scenario),
            |mut plant| {
                for command in &commands {
                    plant.apply(command, &mut state);
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
                || Simulation::new(scenario).expect("a law and a judge"),
                |simulation| {
                    pool.install(|| sim::continue_flight(simulation, &mut (), &mut |_| ControlFlow::Continue(())))
                        .expect("a clean flight")
                },
                BatchSize::LargeInput,
            );
        });
    }
    group.finish();
}

criterion_group!(benches, edge_tension, displacement);
criterion_main!(benches);
