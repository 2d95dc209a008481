//! Time of a second of flight of a hundred Crazyflies on one core; its inverse is the real-time factor.
//!
//! Run with `cargo bench --bench quadrotors`. The swarm is a square lattice that contracts from 0.8 m to 0.7 m under
//! the edge-tension law on the complete graph. The law runs at 100 Hz, delta is 0.4 m, and every step is audited. For
//! comparison the vehicles fly alone, without law and audit.

use std::ops::ControlFlow;

use criterion::{BatchSize, BenchmarkId, Criterion, criterion_group, criterion_main};
use tautline::formation::Formation;
use tautline::law::{EdgeTensionKeys, LawSpec};
use tautline::plant::{StepPath, rapier};
use tautline::scenario::{DEFAULT_ATTITUDE_HZ, Scenario};
use tautline::sim::{self, Components};
use tautline::swarm::{Rows, Swarm};
use tautline::vehicle::{self, Airframe, MODELS, Quadrotor};

const COUNT: usize = 100;

/// Returns a scenario of one second at a physics rate \[Hz\].
fn lattice(physics_hz: f64) -> Scenario {
    let start = Swarm::at_rest(Formation::grid(COUNT, 0.8).slots_m);
    let mut scenario = Scenario::new("lattice", start, Formation::grid(COUNT, 0.7), 0.4, 1.0);
    let model = vehicle::read(MODELS[0].0, MODELS[0].1).expect("a model");
    let quadrotor = Quadrotor { model, attitude_hz: DEFAULT_ATTITUDE_HZ, ground_effect: false, downwash: false };
    scenario.set_airframe(Airframe::Quadrotor(Box::new(quadrotor)));
    scenario.law = LawSpec::EdgeTension(EdgeTensionKeys { alpha: 1e-4 });
    scenario.time.dt_s = 1.0 / physics_hz;
    scenario.arrival.hold_s = 0.0;
    scenario.validate().expect("the lattice can be flown");
    scenario
}

fn flights(criterion: &mut Criterion) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    for physics_hz in [500.0, 1000.0] {
        let scenario = lattice(physics_hz);
        let mut group = criterion.benchmark_group(format!("quadrotors/{physics_hz} Hz"));
        group.sample_size(10);
        group.bench_function(BenchmarkId::from_parameter("whole"), |bencher| {
            bencher.iter_batched(
                || Components::of(&scenario).expect("a law"),
                |parts| pool.install(|| sim::fly(&scenario, parts, &mut (), &mut |_| ControlFlow::Continue(()))),
                BatchSize::LargeInput,
            );
        });
        group.bench_function(BenchmarkId::from_parameter("vehicles alone"), |bencher| {
            let (held, mut state, mut path) = (Rows::zeros(COUNT), scenario.start.clone(), StepPath::default());
            bencher.iter_batched(
                || rapier::plant(&scenario),
                |mut plant| {
                    for _ in 0..scenario.time.steps() {
                        plant.apply(&held, &mut state);
                        plant.advance(scenario.time.dt_s, &mut state, &mut path).expect("finite");
                    }
                },
                BatchSize::LargeInput,
            );
        });
        group.finish();
    }
}

criterion_group!(benches, flights);
criterion_main!(benches);
