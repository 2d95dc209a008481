//! The loop allocates no memory per step: a flight of 300 steps allocates as often as one of 20.

use std::ops::ControlFlow;

use stats_alloc::Region;
use tautline_core::swarm::{Rows, Swarm};
use tautline_laws::law::{Law, LawError};
use tautline_laws::observation::Observation;
use tautline_sim::plant::{self, Plant, PlantError, StepPath};
use tautline_sim::scenario::{Override, Scenario, Source, Template};
use tautline_sim::sim::{self, Components, States, Threads, VectorSimulation};

use crate::ALLOCATOR;

const FEW: u32 = 20;
const MANY: u32 = 300;
const ATTEMPTS: u32 = 3;

/// Semi-implicit Euler plant without an engine.
#[derive(Clone)]
struct Euler {
    state: Swarm,
    held: Rows,
    a22_per_s: f64,
}

impl Plant for Euler {
    fn count(&self) -> usize {
        self.state.count()
    }

    fn advance(&mut self, dt_s: f64, predicted: &mut Swarm, _path: &mut StepPath) -> Result<(), PlantError> {
        let Swarm { positions_m, velocities_m_s } = &mut self.state;
        for (v, u) in velocities_m_s.iter_mut().zip(self.held.iter()) {
            *v += (*u + self.a22_per_s * *v) * dt_s;
        }
        for (p, v) in positions_m.iter_mut().zip(velocities_m_s.iter()) {
            *p += v * dt_s;
        }
        self.observe(predicted);
        Ok(())
    }

    fn apply(&mut self, command: &Rows, _state: &mut Swarm) {
        self.held.copy_from(command);
    }

    fn observe(&self, swarm: &mut Swarm) {
        swarm.positions_m.copy_from(&self.state.positions_m);
        swarm.velocities_m_s.copy_from(&self.state.velocities_m_s);
    }

    fn restore(&mut self, swarm: &Swarm) {
        self.state.positions_m.copy_from(&swarm.positions_m);
        self.state.velocities_m_s.copy_from(&swarm.velocities_m_s);
    }
}

/// Law that allocates memory at each evaluation.
#[derive(Clone)]
struct Wasteful(Box<dyn Law>);

impl Law for Wasteful {
    fn name(&self) -> &'static str {
        "wasteful"
    }

    fn command(&mut self, at: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        self.0.command(&Observation { own: &std::hint::black_box(at.own.clone()), ..*at }, command)
    }
}

fn builtin(name: &str, sets: &[&str]) -> Scenario {
    let overrides: Vec<_> = sets.iter().map(|set| Override::parse(set).expect(set)).collect();
    Scenario::read(&Source::Builtin(name.to_owned()), &overrides).expect("a scenario")
}

/// Returns the number of allocations of a flight of a number of steps.
fn allocations(scenario: &Scenario, steps: u32, law: Box<dyn Law>, plant: Box<dyn Plant>) -> usize {
    let mut scenario = scenario.clone();
    scenario.time.duration_s = f64::from(steps) * scenario.time.dt_s;
    let parts = Components { plant, ..Components::with_law(&scenario, law) };
    let region = Region::new(ALLOCATOR);
    let flown = sim::fly(&scenario, parts, &mut (), &mut |_step| ControlFlow::Continue(()));
    let change = region.change();
    assert_eq!(flown.expect("a flight").steps, u64::from(steps));
    change.allocations + change.reallocations
}

/// Returns the excess allocations of a long flight over a short one, after a flight that initializes the threads.
fn growth(scenario: &Scenario, law: impl Fn() -> Box<dyn Law>, plant: impl Fn() -> Box<dyn Plant>) -> usize {
    let [_, few, many] = [FEW, FEW, MANY].map(|steps| allocations(scenario, steps, law(), plant()));
    many.saturating_sub(few)
}

pub(crate) fn the_loop_allocates_nothing_per_step() {
    let pentagon = builtin("pentagon", &[]);
    let crowd = builtin(
        "circle",
        &[
            "swarm.count=520",
            "start={shape=\"grid\", spacing_m=4, jitter_m=0.3, seed=1}",
            "formation={shape=\"circle\", radius_m=200}",
        ],
    );
    // Under a law whose energy of a state without evaluation allocates nothing.
    let imperfect = builtin(
        "pentagon-laplacian",
        &[
            "sensing={position_noise_m=0.01, rate_hz=100, latency_s=0.01}",
            "network={latency_s=0.01, jitter_s=0.01, loss=0.2, loss_burst=2, rate_hz=100, missing=\"extrapolate\"}",
            "actuation={max_accel_m_s2=2, lag_s=0.05}",
        ],
    );
    let shielded = builtin(
        "pentagon-laplacian",
        &[
            "time.control_hz=240",
            "shield.enabled=true",
            "network={latency_s=0.01, jitter_s=0.01, loss=0.2, loss_burst=2, rate_hz=240}",
        ],
    );
    let threads = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("two threads");
    for (name, scenario) in [
        ("five vehicles", &pentagon),
        ("law and audit side by side", &crowd),
        ("every imperfection", &imperfect),
        ("a shield", &shielded),
    ] {
        let law = || scenario.law().expect("a law");
        let euler = || {
            let (state, held) = (scenario.start.clone(), Rows::zeros(scenario.count()));
            Box::new(Euler { state, held, a22_per_s: scenario.a22_per_s }) as Box<dyn Plant>
        };
        // Idle threads allocate now and then; allocations of a step occur in every attempt.
        let allocates_nothing = |_| threads.install(|| growth(scenario, law, euler)) == 0;
        assert!((0..ATTEMPTS).any(allocates_nothing), "{name}: a step allocates: {}", growth(scenario, law, euler));

        let wasteful = || -> Box<dyn Law> { Box::new(Wasteful(law())) };
        let grown = threads.install(|| growth(scenario, wasteful, euler));
        assert!(grown >= (MANY - FEW) as usize, "{name}: a law that allocates is counted: {grown}");

        let engine = threads.install(|| growth(scenario, law, || plant::of(scenario)));
        println!("{name}: the engine allocates {:.2} times a step", engine as f64 / f64::from(MANY - FEW));
    }
}

/// Returns the number of allocations of a call of some steps after others in three worlds, with given commands or under
/// the law.
fn allocations_of_worlds(name: &str, sets: &[&str], (before, steps): (u64, u64), is_given: bool) -> usize {
    let overrides: Vec<_> = sets.iter().map(|set| Override::parse(set).expect(set)).collect();
    let template = Template::read(&Source::Builtin(name.to_owned()), &overrides).expect("a scenario");
    let mut worlds = VectorSimulation::new(template, &[0, 1, 2], Threads::One).expect("worlds");
    let mut states = States::of(&worlds);
    let commands = vec![1.0; states.positions_m.len()];
    let mut fly = |steps| worlds.step(is_given.then_some(&commands[..]), steps, &mut states.borrow()).expect("flown");
    fly(before);
    let region = Region::new(ALLOCATOR);
    fly(steps);
    let change = region.change();
    change.allocations + change.reallocations
}

pub(crate) fn worlds_allocate_nothing_per_step() {
    // The crowd searches near pairs by cells. It stalls after 190 steps; from then on its spread slots are supervised.
    let crowd = &["swarm.count=200"][..];
    let cases = [("pentagon", &[][..], 5, true), ("pentagon", &[], 5, false), ("thousand", crowd, 220, true)];
    for (name, sets, before, is_given) in cases {
        // Idle threads of other tests allocate now and then.
        let allocates_nothing = |_| allocations_of_worlds(name, sets, (before, 300), is_given) == 0;
        assert!((0..ATTEMPTS).any(allocates_nothing), "{name}, given commands: {is_given}");
    }
}
