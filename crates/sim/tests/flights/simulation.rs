//! Simulations: stepping, saving and loading, commands from outside, legs, and knowledge through the link.

use std::ops::ControlFlow;

use proptest::strategy::{Strategy as _, ValueTree as _};
use tautline_audit::Status;
use tautline_core::record::{Event, Sink, StateHash};
use tautline_core::swarm::{Rows, Swarm};
use tautline_laws::formation::{Formation, largest_edge_error_m};
use tautline_laws::graph::Graph;
use tautline_laws::law::{EdgeTensionKeys, LaplacianKeys, Law, LawError, LawSpec, PotentialKeys, VoidReason};
use tautline_laws::observation::{Observation, OtherStates, StateTables};
use tautline_laws::target::{CurrentTarget, Leg, LegTrigger, Supervisor};
use tautline_sim::continuous::{self, Tolerances};
use tautline_sim::link::{ActuationSpec, Imperfections, StateEstimates};
use tautline_sim::metrics::Metrics;
use tautline_sim::scenario::{PlantSpec, Scenario};
use tautline_sim::sim::{self, Components, Ending, Flight, SimError, Simulation};

use crate::flight::{Log, builtin, fly};

/// Passes a due sample to a hash.
fn record(simulation: &mut Simulation, hash: &mut StateHash) {
    if let Some(sample) = simulation.sample() {
        hash.observe(&sample);
    }
}

/// Flies to the end.
fn finish(simulation: &mut Simulation, hash: &mut StateHash) {
    while simulation.ending().is_none() {
        simulation.step();
        record(simulation, hash);
    }
}

/// Returns vehicles whose hulls collide, so that the engine has contacts to remember.
fn bouncing() -> Scenario {
    let mut scenario = builtin("pentagon-laplacian", &["time.duration_s=4", "time.record_hz=240", "law.delta_m=1.0"]);
    scenario.hull_radius_m.fill(0.48);
    for i in 0..scenario.count() {
        scenario.start.velocities_m_s[(i, 0)] = if i % 2 == 0 { 2.0 } else { -2.0 };
    }
    scenario
}

#[test]
fn a_simulation_loaded_at_any_of_fifty_steps_ends_with_the_same_hash() {
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    let tension = builtin("pentagon", &["time.duration_s=4", "time.record_hz=240"]);
    let ideal = builtin("pentagon", &["time.duration_s=4", "plant.kind=ideal", "time.dt_s=0.05", "time.record_hz=20"]);
    let mut double = bouncing();
    double.plant = PlantSpec::Rapier;
    for (name, scenario, loads) in
        [("tension", tension, 20), ("bouncing", bouncing(), 20), ("double", double, 5), ("ideal", ideal, 5)]
    {
        let mut whole = (Simulation::new(&scenario).expect("a simulation"), StateHash::new());
        record(&mut whole.0, &mut whole.1);
        let mut other = Simulation::new(&scenario).expect("a simulation");
        let mut at: Vec<u64> =
            (0..loads).map(|_| (1..scenario.time.steps()).new_tree(&mut runner).expect("a step").current()).collect();
        at.sort_unstable();
        let mut ends = Vec::new();
        for step in at {
            while whole.0.steps() < step {
                whole.0.step();
                record(&mut whole.0, &mut whole.1);
            }
            let (saved, mut hash) = (whole.0.save(), whole.1.clone());
            // Loads into a simulation in another state.
            (0..7).for_each(|_| other.step());
            other.load(&saved, None);
            finish(&mut other, &mut hash);
            let ended = other.clone().finish();
            ends.push((hash.finish(), ended.audit, ended.bounces));
            other.load(&saved, None);
        }
        finish(&mut whole.0, &mut whole.1);
        let flight = whole.0.finish();
        let bounces = name == "bouncing" || name == "double";
        assert_eq!(!flight.engine_contacts.is_empty(), bounces, "{name}: keep-out balls, and hulls within them, met");
        assert_eq!(!flight.bounces.is_empty(), bounces, "{name}: hulls hit");
        let expected = (whole.1.finish(), flight.audit, flight.bounces);
        assert!(ends.iter().all(|end| *end == expected), "{name}");
    }
}

#[test]
fn a_simulation_pushed_for_one_step_ends_with_another_hash() {
    let scenario = bouncing();
    let mut whole = Simulation::new(&scenario).expect("a simulation");
    let (mut hash, mut twin_hash) = (StateHash::new(), StateHash::new());
    (0..300).for_each(|_| whole.step());
    let mut twin = whole.clone();
    // One vehicle is pushed by 0.01 m/s^2 for one step.
    let mut commands = twin.control().clone();
    commands[(0, 0)] += 1e-2;
    twin.step_with(&commands).expect("finite commands");
    whole.step();
    finish(&mut whole, &mut hash);
    finish(&mut twin, &mut twin_hash);
    assert_ne!(hash.finish(), twin_hash.finish());
}

#[test]
fn stepping_equals_flying() {
    let scenario = builtin("pentagon", &["time.duration_s=3"]);
    let mut flown = StateHash::new();
    let parts = Components::of(&scenario).expect("the parts of a valid scenario");
    sim::fly(&scenario, parts, &mut flown, &mut |_step| ControlFlow::Continue(())).expect("a flight");
    let (mut simulation, mut hash) = (Simulation::new(&scenario).expect("a simulation"), StateHash::new());
    record(&mut simulation, &mut hash);
    finish(&mut simulation, &mut hash);
    assert_eq!(flown.finish(), hash.finish());
    assert_eq!(simulation.ending(), Some(&Ending::Completed));
    simulation.step();
    assert_eq!((simulation.steps(), simulation.time_s()), (720, 3.0), "an ended flight stays where it is");
}

#[test]
fn commands_from_outside_replace_those_of_the_law() {
    let scenario = builtin("pentagon", &["time.duration_s=3", "swarm.a22_per_s=0"]);
    let mut by_law = Simulation::new(&scenario).expect("a simulation");
    let mut by_hand = by_law.clone();
    // Commands from outside are held over the step, so the law's own commands then give another flight.
    let mut held = scenario.clone();
    held.time.control_hz = Some(240.0);
    let mut by_law_held = Simulation::new(&held).expect("a simulation");
    for _ in 0..100 {
        let commands = by_law_held.control().clone();
        by_law_held.step();
        by_law.step();
        by_hand.step_with(&commands).expect("finite commands");
        assert_eq!(by_hand.state(), by_law_held.state());
    }
    assert_ne!(by_hand.state(), by_law.state());
    by_hand.step();
    let mut known = Simulation::new(&Scenario { start: by_law_held.state().clone(), ..scenario.clone() }).expect("one");
    known.step();
    let off_m = (&by_hand.state().positions_m - &known.state().positions_m).amax();
    assert!(off_m < 1e-14, "the law continues from the present state: {off_m}");

    let mut still = Simulation::new(&scenario).expect("a simulation");
    still.step_with(&Rows::zeros(5)).expect("finite commands");
    assert_eq!(still.state().positions_m, scenario.start.positions_m);
    for wrong in [Rows::zeros(4), Rows::from_element(5, f64::NAN)] {
        assert!(matches!(still.step_with(&wrong), Err(SimError::Commands { expected: 5, .. })));
    }
    assert_eq!(still.steps(), 1, "a refused step is not flown");
}

/// Law with constant commands.
#[derive(Clone)]
struct Constant(Rows);

impl Law for Constant {
    fn name(&self) -> &'static str {
        "constant"
    }

    fn command(&mut self, _at: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        command.copy_from(&self.0);
        Ok(())
    }
}

#[test]
fn commands_from_outside_pass_through_shield_and_actuators() {
    let shielded = builtin("shielded-crazyflies", &["time.duration_s=5"]);
    let limited =
        builtin("pentagon", &["time={duration_s=5, control_hz=240}", "actuation={max_accel_m_s2=0.5, lag_s=0.2}"]);
    for scenario in [shielded, limited] {
        let commands = -&scenario.start.positions_m;
        let parts = || Components::with_law(&scenario, Box::new(Constant(commands.clone())));
        let mut by_law = Simulation::with(&scenario, parts()).expect("a simulation");
        let mut by_hand =
            Simulation::awaiting_commands(&scenario, Components::of(&scenario).expect("a law")).expect("one");
        let mut exact =
            Simulation::new(&Scenario { actuation: ActuationSpec::default(), shield: None, ..scenario.clone() })
                .expect("one");
        // At the end, both have commanded at the same instants of the shield.
        for _ in 0..903 {
            by_law.step();
            by_hand.step_with(&commands).expect("finite commands");
            exact.step_with(&commands).expect("finite commands");
            assert_eq!(by_hand.state(), by_law.state());
        }
        assert_ne!(by_hand.state(), exact.state(), "shield and actuators change commands");
        let (by_law, by_hand) = (by_law.finish(), by_hand.finish());
        assert_eq!(by_law.shield, by_hand.shield);
        assert_eq!(by_hand.certificate.certified_m.is_some(), scenario.shield.is_some());
    }
}

#[test]
fn commands_from_outside_are_held_between_changes_also_behind_a_lag() {
    let read = |sets: &[&str]| builtin("pentagon", &[&["actuation={lag_s=0.2}"], sets].concat());
    let continuous = read(&["time={duration_s=5}"]);
    let held = read(&["time={duration_s=5, control_hz=240}"]);
    let pushes = [1.0, -1.0, 0.5].map(|push| push * &continuous.start.positions_m);
    let start = |scenario: &Scenario| Simulation::new(scenario).expect("a simulation");
    let (mut first, mut second) = (start(&continuous), start(&held));
    for push in &pushes {
        for _ in 0..24 {
            first.step_with(push).expect("finite commands");
            second.step_with(push).expect("finite commands");
            let off_m = (&first.state().positions_m - &second.state().positions_m).amax();
            assert!(off_m < 1e-12, "a held command is no ramp: {off_m}");
        }
    }
    // A law with the same commands, before and after commands from outside.
    let by_law = |push: &Rows| Components::with_law(&continuous, Box::new(Constant(push.clone())));
    let mut mixed = Simulation::with(&continuous, by_law(&pushes[1])).expect("a simulation");
    let mut by_hand = start(&held);
    for (push, law_flies) in [(&pushes[1], true), (&pushes[0], false), (&pushes[1], true)] {
        for _ in 0..24 {
            by_hand.step_with(push).expect("finite commands");
            if law_flies {
                mixed.step();
            } else {
                mixed.step_with(push).expect("finite commands");
            }
            let off_m = (&mixed.state().positions_m - &by_hand.state().positions_m).amax();
            assert!(off_m < 1e-12, "{off_m}");
        }
    }
}

#[test]
fn a_shield_takes_commands_at_its_own_instants_only() {
    let scenario = builtin("shielded-crazyflies", &["time.duration_s=5"]);
    let mut mixed = Simulation::new(&scenario).expect("a simulation");
    let mut by_law = mixed.clone();
    let commands = -&scenario.start.positions_m;
    // The law has commanded at the start. Its command is held up to the next instant.
    mixed.step_with(&commands).expect("finite commands");
    by_law.step();
    assert_eq!(mixed.state(), by_law.state());
    for _ in 0..16 {
        (0..6).for_each(|_| mixed.step_with(&commands).expect("finite commands"));
        mixed.step();
        (0..7).for_each(|_| by_law.step());
    }
    assert_ne!(mixed.state(), by_law.state());
    let (mixed, by_law) = (mixed.finish(), by_law.finish());
    let periods = |flight: &Flight| flight.shield.as_ref().map(|shield| shield.counters.commands);
    assert_eq!(periods(&mixed), periods(&by_law), "one command each period");
}

/// Returns a flight to the pentagon and then to a larger one.
fn two_legs(begins: LegTrigger) -> Scenario {
    let mut scenario = builtin("pentagon", &["time.duration_s=120", "swarm.a22_per_s=-0.1"]);
    scenario.legs.push(Leg { begins, ..Leg::first(Formation::pentagon(4.0)) });
    scenario
}

#[test]
fn legs_begin_by_time_or_when_the_previous_leg_is_reached() {
    for (begins, expected_s) in [(LegTrigger::At(50.0), 50.0..=50.0), (LegTrigger::Reached, 20.0..=60.0)] {
        let scenario = two_legs(begins);
        let mut log = Log::default();
        let mut metrics = Metrics::new(&scenario.legs, &scenario.graph, scenario.arrival);
        let parts = Components::of(&scenario).expect("parts");
        let flight = sim::fly(&scenario, parts, &mut (&mut log, &mut metrics), &mut |_| ControlFlow::Continue(()))
            .expect("a flight");
        assert_eq!(flight.ending, Ending::Completed);
        let began: Vec<_> = log.events.iter().filter(|event| matches!(event, Event::LegBegan { .. })).collect();
        let [Event::LegBegan { leg: 1, time_s }] = began[..] else { panic!("{began:?}") };
        assert!(expected_s.contains(time_s), "{time_s}");
        let [first] = metrics.ended_legs() else { panic!("one leg has ended") };
        assert!(first.reached_at_s.is_some_and(|reached_s| reached_s < *time_s), "{first:?}");
        let last = metrics.finish();
        assert!(last.reached_at_s.is_some_and(|reached_s| reached_s > *time_s), "{last:?}");
        assert!(last.max_edge_error_m < 0.01, "the larger pentagon is the one that is held");
    }
    let scenario = two_legs(LegTrigger::At(119.0));
    let mut metrics = Metrics::new(&scenario.legs, &scenario.graph, scenario.arrival);
    sim::fly(&scenario, Components::of(&scenario).expect("parts"), &mut metrics, &mut |_| ControlFlow::Continue(()))
        .expect("a flight");
    assert_eq!(metrics.finish().reached_at_s, None, "a leg that has only begun is not reached");
}

/// Returns the largest distance from the goal over the last 20 s of 200 s, for two vehicles under the baseline in
/// continuous time. Their relative motion has the single mode g = 1 of s^2 - a22 s + g (f1 + f2 s) e^(-s tau) = 0.
fn left_after(delay_s: f64) -> f64 {
    let start = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, 0.0, 3.01, 0.0, 0.0]));
    let mut scenario = Scenario::new("late", start, Formation::line(2, 3.0), 0.5, 200.0);
    scenario.law = LawSpec::Laplacian(LaplacianKeys { f1_per_s2: 1.0, f2_per_s: Some(1.0) });
    scenario.plant = PlantSpec::Ideal;
    (scenario.time.dt_s, scenario.time.record_hz, scenario.time.max_halvings) = (0.05, 20.0, 10);
    scenario.sensing.latency_s = delay_s;
    let (_, log) = fly(&scenario);
    let late = log.samples.iter().filter(|sample| sample.time_s > 180.0);
    late.map(|sample| (sample.swarm.positions_m[(1, 0)] - sample.swarm.positions_m[(0, 0)] - 3.0).abs())
        .fold(0.0, f64::max)
}

#[test]
fn a_delayed_link_in_continuous_time_loses_stability_at_the_delay_of_the_closed_form() {
    // tau* = [atan(f2 omega/f1)]/omega with omega^2 = [1 + sqrt 5]/2 for g = f1 = f2 = 1, a22 = 0.
    let omega = (0.5 * (1.0 + 5.0_f64.sqrt())).sqrt();
    let margin_s = omega.atan() / omega;
    assert!((margin_s - 0.711).abs() < 1e-3);
    let (below, above) = (left_after(0.95 * margin_s), left_after(1.05 * margin_s));
    assert!(below < 0.002, "below the margin the error of 0.01 m decays: {below}");
    assert!(above > 0.05, "above it grows: {above}");
}

#[test]
fn a_delayed_flight_does_not_depend_on_the_steps_that_were_refused() {
    let end = |dt_s: f64| {
        let mut start = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, 0.0, 3.5, 0.2, 0.0]));
        start.velocities_m_s[(0, 1)] = 0.5;
        let mut scenario = Scenario::new("late", start, Formation::line(2, 3.0), 0.5, 4.0);
        (scenario.plant, scenario.time.dt_s, scenario.time.record_hz) = (PlantSpec::Ideal, dt_s, 1.0);
        scenario.sensing.latency_s = 0.05;
        let (flight, log) = fly(&scenario);
        let refused = log.events.iter().any(|event| matches!(event, Event::StepRefined { .. }));
        assert!(flight.certificate.void.contains(&VoidReason::SensingDelayed), "late knowledge voids the certificate");
        (flight.last.positions_m, refused)
    };
    let ((coarse, refused), (fine, _)) = (end(0.4), end(0.4 / 128.0));
    assert!(refused, "a step of 0.4 s bends");
    // The past is a cubic between solver steps of at most 6 ms.
    assert!((coarse - fine).amax() < 1e-9);
}

/// Returns a hub and two vehicles without a link that fly at each other.
fn head_on() -> Scenario {
    let mut start = Swarm::at_rest(Rows::from_row_slice(&[0.0, 30.0, 0.0, -5.0, 0.0, 0.0, 5.0, 0.0, 0.0]));
    (start.velocities_m_s[(1, 0)], start.velocities_m_s[(2, 0)]) = (20.0, -20.0);
    let slots = Rows::from_row_slice(&[0.0, 30.0, 0.0, -5.0, 0.0, 0.0, 5.0, 0.0, 0.0]);
    let mut scenario = Scenario::new("head-on", start, Formation::points(slots), 2.0, 5.0);
    (scenario.law, scenario.graph) = (LawSpec::Potential(PotentialKeys::default()), Graph::star(3));
    (scenario.plant, scenario.time.dt_s) = (PlantSpec::Rapier, 0.05);
    scenario
}

#[test]
fn a_step_is_refused_for_a_pair_without_a_link_if_the_law_senses_it() {
    let scenario = head_on();
    let (flight, log) = fly(&scenario);
    assert!(log.events.iter().any(|event| matches!(event, Event::StepRefined { .. })));
    let (closest, certified_m) = (flight.audit.closest.expect("pairs"), flight.certificate.certified_m);
    assert!(closest.separation_m > certified_m.expect("a certificate on a star"), "{closest:?} {certified_m:?}");
    // Without halving, the same steps jump the barrier.
    let mut blind = scenario;
    blind.time.max_halvings = 0;
    blind.time.dt_s = 0.1;
    assert!(fly(&blind).0.audit.closest.is_some_and(|closest| Some(closest.separation_m) < certified_m));
}

#[test]
fn a_law_that_senses_has_the_same_flight_in_both_solvers() {
    let mut scenario = head_on();
    let mut law = scenario.law().expect("a law");
    let solved = continuous::solve(&scenario, law.as_mut(), &[5.0], Tolerances::default()).expect("a solution");
    scenario.plant = PlantSpec::Ideal;
    let flown = fly(&scenario).0;
    assert!((&solved.states[0].positions_m - &flown.last.positions_m).amax() < 1e-8);
    let (solved, flown) = (solved.closest.expect("pairs"), flown.audit.closest.expect("pairs"));
    // The audit sweeps chords that bend by 1e-5 m.
    assert!((solved.separation_m - flown.separation_m).abs() < 2e-5, "{solved:?} {flown:?}");
}

#[test]
fn commands_from_outside_void_the_certificate_in_continuous_time() {
    let scenario = builtin("pentagon", &["time.duration_s=3", "plant.kind=ideal", "swarm.a22_per_s=0"]);
    let mut still = Simulation::new(&scenario).expect("a simulation");
    (0..240).for_each(|_| still.step_with(&Rows::zeros(5)).expect("finite commands"));
    assert_eq!(still.state(), &scenario.start, "no vehicle is accelerated");
    let certificate = still.finish().certificate;
    assert_eq!((certificate.certified_m, certificate.void), (None, vec![VoidReason::ExternalCommands]));
}

/// Returns two vehicles that drift at each other, 1 mm before the barrier.
fn at_the_barrier(speed_m_s: f64) -> Scenario {
    let mut start = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, 0.0, 2.001, 0.0, 0.0]));
    start.velocities_m_s[(1, 0)] = -speed_m_s;
    Scenario::new("barrier", start, Formation::line(2, 4.0), 2.0, 5.0)
}

#[test]
fn steps_with_commands_from_outside_are_not_divided_for_the_law() {
    let scenario = at_the_barrier(0.0);
    let mut by_hand = Simulation::new(&scenario).expect("a simulation");
    let mut by_law = by_hand.clone();
    for _ in 0..100 {
        by_hand.step_with(&Rows::zeros(2)).expect("finite commands");
        by_law.step();
    }
    let (by_hand, by_law) = (by_hand.finish(), by_law.finish());
    assert_eq!((by_hand.refined_steps, by_hand.audit.steps), (0, 100));
    assert!(by_law.refined_steps > 0 && by_law.audit.steps > 100, "the law requires shorter steps");
}

#[test]
fn commands_from_outside_are_audited_past_the_barrier_of_the_law() {
    let mut by_hand = Simulation::new(&at_the_barrier(0.1)).expect("a simulation");
    (0..10).for_each(|_| by_hand.step_with(&Rows::zeros(2)).expect("finite commands"));
    let flight = by_hand.finish();
    assert_eq!((flight.audit.status, flight.audit.steps, flight.overlong_steps), (Status::Violation, 10, 0));
    let mut mixed = Simulation::new(&at_the_barrier(0.0)).expect("a simulation");
    mixed.step_with(&Rows::zeros(2)).expect("finite commands");
    mixed.step();
    let flight = mixed.finish();
    assert_eq!((flight.refined_steps, flight.audit.status), (1, Status::Clear));
}

#[test]
fn a_certificate_for_one_leg_is_void_for_two_and_laws_follow_the_target() {
    for law in [LawSpec::EdgeTension(EdgeTensionKeys::default()), LawSpec::Potential(PotentialKeys::default())] {
        let slots = Formation::pentagon(4.0);
        let mut scenario = Scenario::new("nearer", Swarm::at_rest(slots.slots_m.clone()), slots, 1.0, 60.0);
        scenario.law = law;
        scenario.legs.push(Leg { begins: LegTrigger::At(2.0), ..Leg::first(Formation::pentagon(2.5)) });
        scenario.validate().expect("two legs");
        let (flight, _) = fly(&scenario);
        assert_eq!((flight.certificate.certified_m, flight.certificate.void), (None, vec![VoidReason::TargetChanges]));
        let off_m = largest_edge_error_m(&flight.last.positions_m, &scenario.legs[1].formation, &scenario.graph);
        assert!(off_m < 0.01, "{}: {off_m}", flight.law);
    }
}

#[test]
fn legs_that_cannot_be_flown_are_refused() {
    type Break = fn(&mut Scenario);
    let good = two_legs(LegTrigger::At(50.0));
    assert!(good.validate().is_ok());
    let breaks: [Break; 6] = [
        |scenario| scenario.legs.clear(),
        |scenario| scenario.legs[1].formation = Formation::line(4, 3.0),
        |scenario| scenario.legs[1].formation.slots_m[(2, 0)] = f64::NAN,
        |scenario| scenario.legs[1].formation = Formation::pentagon(1.0),
        |scenario| scenario.legs[1].formation.slots_m[(2, 2)] = 1.0,
        |scenario| scenario.legs[1].begins = LegTrigger::At(f64::NAN),
    ];
    for (number, broken) in breaks.into_iter().enumerate() {
        let mut scenario = good.clone();
        broken(&mut scenario);
        assert!(scenario.validate().is_err(), "break {number}");
    }
    let mut none = good;
    none.legs.clear();
    assert!(Simulation::new(&none).is_err());
}

/// Supervisor that begins a leg that the scenario does not have.
#[derive(Clone)]
struct Astray;

impl Supervisor for Astray {
    fn supervise(&mut self, time_s: f64, _: &Swarm, target: &mut CurrentTarget) {
        if time_s >= 1.0 && target.view().leg == 0 {
            target.begin(7, &Formation::pentagon(30.0));
        }
    }
}

#[test]
fn a_leg_that_the_scenario_does_not_have_is_never_reached() {
    let scenario = builtin("pentagon", &["time.duration_s=60"]);
    let parts = Components { supervisor: Box::new(Astray), ..Components::of(&scenario).expect("parts") };
    let mut metrics = Metrics::new(&scenario.legs, &scenario.graph, scenario.arrival);
    sim::fly(&scenario, parts, &mut metrics, &mut |_| ControlFlow::Continue(())).expect("a flight");
    assert_eq!((metrics.finish().reached_at_s, metrics.ended_legs().len()), (None, 7));
}

/// Imperfections that give each vehicle its own copy of the true state.
#[derive(Clone)]
struct Copied(Option<StateTables>);

impl Imperfections for Copied {
    fn sense<'a>(&'a mut self, _: f64, truth: &'a Swarm) -> StateEstimates<'a> {
        let count = truth.count();
        let held = StateTables {
            received: vec![truth.clone(); count],
            ages_s: vec![vec![0.0; count]; count],
            sensed: vec![truth.clone(); count],
        };
        StateEstimates { own: truth, others: OtherStates::PerVehicle(self.0.insert(held)) }
    }
}

#[test]
fn copies_of_the_true_state_give_the_same_flight() {
    let laws = [
        LawSpec::EdgeTension(EdgeTensionKeys::default()),
        LawSpec::Laplacian(LaplacianKeys::default()),
        LawSpec::Potential(PotentialKeys::default()),
    ];
    for (law, graph) in laws.into_iter().zip([Graph::complete(5), Graph::ring(5), Graph::star(5)]) {
        let mut scenario = builtin("pentagon", &["time.duration_s=2"]);
        (scenario.law, scenario.graph) = (law, graph);
        let shared = fly(&scenario).0;
        let parts = Components { link: Box::new(Copied(None)), ..Components::of(&scenario).expect("parts") };
        let held = sim::fly(&scenario, parts, &mut (), &mut |_| ControlFlow::Continue(())).expect("a flight");
        let off = (&shared.last.positions_m - &held.last.positions_m).amax();
        // Sums in another order.
        assert!(off < 1e-12, "{}: {off}", held.law);
        assert!(held.steps == 480 && (&shared.last.positions_m - &scenario.start.positions_m).amax() > 0.1);
    }
}

/// Sink that refuses every record.
struct Full;

impl Sink for Full {
    fn sample(&mut self, _: &tautline_core::record::Sample<'_>) -> Result<(), tautline_core::record::RecordError> {
        let source = std::io::Error::other("full");
        Err(tautline_core::record::RecordError::Write { path: "disk".to_owned(), source })
    }

    fn event(&mut self, _: &Event) -> Result<(), tautline_core::record::RecordError> {
        Ok(())
    }
}

#[test]
fn a_sink_that_cannot_keep_a_sample_ends_the_run_with_its_error() {
    let scenario = builtin("pentagon", &["time.duration_s=1"]);
    let parts = Components::of(&scenario).expect("the parts of a valid scenario");
    let flown = sim::fly(&scenario, parts, &mut Full, &mut |_step| ControlFlow::Continue(()));
    assert!(matches!(flown, Err(SimError::Record(_))));
}
