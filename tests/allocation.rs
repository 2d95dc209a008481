//! The loop takes no memory per step: a flight of 1000 steps allocates as often as one of 100.
//!
//! One test, because the counter is one for the whole process.

use std::alloc::System;
use std::ops::ControlFlow;

use stats_alloc::{INSTRUMENTED_SYSTEM, Region, StatsAlloc};
use tautline::law::{Law, LawError};
use tautline::plant::{self, Plant, PlantError};
use tautline::scenario::{Override, Scenario, Source};
use tautline::sim;
use tautline::swarm::{Rows, Swarm};

#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

const FEW: u32 = 100;
const MANY: u32 = 1000;

/// Semi-implicit Euler without an engine.
struct Euler {
    state: Swarm,
    a22_per_s: f64,
}

impl Plant for Euler {
    fn step(&mut self, _law: &mut dyn Law, control: &Rows, dt_s: f64) -> Result<(), PlantError> {
        let Swarm { positions_m, velocities_m_s } = &mut self.state;
        for (v, u) in velocities_m_s.iter_mut().zip(control.iter()) {
            *v += (*u + self.a22_per_s * *v) * dt_s;
        }
        for (p, v) in positions_m.iter_mut().zip(velocities_m_s.iter()) {
            *p += v * dt_s;
        }
        Ok(())
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

/// A law that takes memory each time it is asked.
struct Wasteful(Box<dyn Law>);

impl Law for Wasteful {
    fn name(&self) -> &'static str {
        "wasteful"
    }

    fn control(&mut self, swarm: &Swarm, control: &mut Rows) -> Result<(), LawError> {
        self.0.control(&std::hint::black_box(swarm.clone()), control)
    }
}

fn builtin(name: &str, sets: &[&str]) -> Scenario {
    let overrides: Vec<_> = sets.iter().map(|set| Override::parse(set).expect(set)).collect();
    Scenario::read(&Source::Builtin(name.to_owned()), &overrides).expect("a scenario")
}

/// How often a flight of so many steps takes memory.
fn allocations(scenario: &Scenario, steps: u32, law: &mut dyn Law, plant: &mut dyn Plant) -> usize {
    let mut scenario = scenario.clone();
    scenario.time.duration_s = f64::from(steps) * scenario.time.dt_s;
    let region = Region::new(ALLOCATOR);
    let flown = sim::fly(&scenario, law, plant, &mut (), &mut |_step| ControlFlow::Continue(()));
    let change = region.change();
    assert_eq!(flown.expect("a flight").steps, u64::from(steps));
    change.allocations + change.reallocations
}

/// How much more often a long flight takes memory than a short one.
fn growth(scenario: &Scenario, law: impl Fn() -> Box<dyn Law>, plant: impl Fn() -> Box<dyn Plant>) -> usize {
    let [few, many] = [FEW, MANY].map(|steps| allocations(scenario, steps, law().as_mut(), plant().as_mut()));
    many.checked_sub(few).expect("more steps take no less memory")
}

#[test]
fn the_loop_allocates_nothing_per_step() {
    let pentagon = builtin("pentagon", &[]);
    let hundred = builtin(
        "circle",
        &[
            "swarm.count=100",
            "start={shape=\"grid\", spacing_m=4, jitter_m=0.3, seed=1}",
            "formation={shape=\"circle\", radius_m=40}",
        ],
    );
    let threads = rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("two threads");
    for (name, scenario) in [("five vehicles", &pentagon), ("a hundred vehicles, side by side", &hundred)] {
        let law = || scenario.law().expect("a law");
        let euler =
            || -> Box<dyn Plant> { Box::new(Euler { state: scenario.start.clone(), a22_per_s: scenario.a22_per_s }) };
        let grown = threads.install(|| growth(scenario, law, euler));
        assert_eq!(grown, 0, "{name}");

        let wasteful = || -> Box<dyn Law> { Box::new(Wasteful(law())) };
        let grown = threads.install(|| growth(scenario, wasteful, euler));
        assert!(grown >= (MANY - FEW) as usize, "{name}: a law that allocates is seen: {grown}");

        let engine = threads.install(|| growth(scenario, law, || plant::for_scenario(scenario)));
        println!("{name}: the engine takes memory {:.2} times a step", engine as f64 / f64::from(MANY - FEW));
    }
}
