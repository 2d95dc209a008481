//! The ideal plant solves p'' = a22 v + u: reference flights, free motion, energy, and states outside the law's domain.

use std::ops::ControlFlow;

use nalgebra::Vector3;
use tautline_audit::{Auditor, Status};
use tautline_core::swarm::{Pair, Rows, Swarm, row, set_row};
use tautline_laws::formation::Formation;
use tautline_laws::graph::Graph;
use tautline_laws::law::{EdgeTensionKeys, EdgeTensionLaw, Law, LawContext, LawError};
use tautline_laws::observation::Observation;
use tautline_sim::continuous::{self, IdealError, Solution, Tolerances};
use tautline_sim::scenario::{Override, PlantSpec, Scenario, Source};
use tautline_sim::sim::{self, Breakdown, Components, Ending};

/// Reference values have 7 decimals.
const PRINTED_M: f64 = 1e-7;
/// Rounding of an energy of a few m^2/s^2, and the solver's error in it.
const ENERGY_ROUNDING: f64 = 1e-9;
/// Solver error of a flight of tens of seconds at 1e-12 per step, amplified if a22 > 0.
const SOLVED_M: f64 = 1e-11;

fn scenario(name: &str, sets: &[&str]) -> Scenario {
    let overrides: Vec<_> = sets.iter().map(|set| Override::parse(set).expect("a key and a value")).collect();
    Scenario::read(&Source::Builtin(name.to_owned()), &overrides).expect("a scenario")
}

fn solve(scenario: &Scenario, times_s: &[f64]) -> Solution {
    let mut law = scenario.law().expect("a law");
    continuous::solve(scenario, law.as_mut(), times_s, Tolerances::default()).expect("a solution")
}

/// Law without commands.
#[derive(Clone)]
struct Free;

impl Law for Free {
    fn name(&self) -> &'static str {
        "free"
    }

    fn command(&mut self, _at: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        command.fill(0.0);
        Ok(())
    }
}

/// Returns a flight from a start with a given a22, towards a line.
fn from(start: Swarm, a22_per_s: f64) -> Scenario {
    let formation = Formation::line(start.count(), 3.0);
    let mut scenario = Scenario::new("from", start, formation, 2.0, 5.0);
    scenario.a22_per_s = a22_per_s;
    scenario
}

/// Solves a flight under a given law.
fn solve_under(
    law: &mut dyn Law,
    start: &Swarm,
    a22_per_s: f64,
    times_s: &[f64],
    tolerances: Tolerances,
) -> Result<Solution, IdealError> {
    continuous::solve(&from(start.clone(), a22_per_s), law, times_s, tolerances)
}

#[test]
fn the_closest_pairs_are_those_of_the_reference() {
    let closest_pair = |name: &str| solve(&scenario(name, &[]), &[10.0]).closest.expect("a closest approach").pair;
    assert!([Pair::new(0, 2), Pair::new(1, 2)].contains(&closest_pair("pentagon")), "mirror images");
    assert_eq!(closest_pair("circle"), Pair::new(2, 3));
}

#[test]
fn a_wrong_sign_of_a22_does_not_match_the_reference() {
    let pentagon = scenario("pentagon", &[]);
    let mut law = pentagon.law().expect("a law");
    let solved = solve_under(law.as_mut(), &pentagon.start, -0.1, &[10.0], Tolerances::default()).expect("a solution");
    assert!((row(&solved.states[0].positions_m, 0).x - 4.318_055_1).abs() > 1e3 * PRINTED_M);
}

#[test]
fn free_motion_is_exact_for_drag_and_for_its_opposite() {
    let mut start = Swarm::at_rest(Formation::line(2, 5.0).slots_m);
    set_row(&mut start.velocities_m_s, 0, Vector3::new(0.3, -1.0, 2.0));
    let v = row(&start.velocities_m_s, 0);
    for a22 in [-1.5_f64, -0.1, 0.1] {
        let times_s = [0.0, 0.5, 0.5, 3.0, 20.0];
        let solved = solve_under(&mut Free, &start, a22, &times_s, Tolerances::default()).expect("a solution");
        assert_eq!(solved.states[0], start);
        for (state, t) in solved.states.iter().zip(times_s) {
            let scale = (a22 * t).exp().max(1.0);
            assert!((row(&state.velocities_m_s, 0) - v * (a22 * t).exp()).amax() < SOLVED_M * scale);
            assert!((row(&state.positions_m, 0) - v * ((a22 * t).exp_m1() / a22)).amax() < 10.0 * SOLVED_M * scale);
        }
    }
}

/// Returns the largest rise of the energy above its minimum so far, over a number of tenths of a second.
fn largest_rise(scenario: &Scenario, a22_per_s: f64, tenths: u32) -> f64 {
    let mut law = scenario.law().expect("a law");
    let times_s: Vec<_> = (0..=tenths).map(|k| f64::from(k) * 0.1).collect();
    let fed = Scenario { a22_per_s, ..scenario.clone() };
    let solved = continuous::solve(&fed, law.as_mut(), &times_s, Tolerances::default());
    let energies = solved
        .expect("a solution")
        .states
        .into_iter()
        .map(|state| law.energy(&scenario.observation(&state)).expect("an energy"));
    let (mut least, mut rise) = (f64::INFINITY, 0.0_f64);
    for energy in energies {
        rise = rise.max(energy - least);
        least = least.min(energy);
    }
    rise
}

#[test]
fn the_energy_rises_only_if_the_plant_adds_more_than_the_law_removes() {
    for name in ["pentagon", "circle"] {
        let scenario = scenario(name, &[]);
        let rise = largest_rise(&scenario, scenario.a22_per_s, 600);
        assert!(rise < ENERGY_ROUNDING, "{name}: {rise}");
        // The law removes (1 + a22) |v|^2 for its own a22. The flight is short because the common velocity grows from
        // rounding until it limits the resolution of distances.
        assert!(largest_rise(&scenario, scenario.a22_per_s + 1.5, 200) > 1e-3);
    }
}

#[test]
fn tighter_tolerances_change_the_reference_flights_by_less_than_the_stated_error() {
    for name in ["pentagon", "circle"] {
        let scenario = scenario(name, &[]);
        let times_s: Vec<_> = (1..=60).map(f64::from).collect();
        let [default, tight] = [1e-12, 1e-13].map(|tolerance| {
            let tolerances = Tolerances { relative: tolerance, absolute: tolerance };
            let mut law = scenario.law().expect("a law");
            continuous::solve(&scenario, law.as_mut(), &times_s, tolerances).expect("a solution")
        });
        let apart = |other: &Solution| {
            let of = |(a, b): (&Swarm, &Swarm)| (&a.positions_m - &b.positions_m).amax();
            default.states.iter().zip(&other.states).map(of).fold(0.0, f64::max)
        };
        assert!(apart(&tight) < SOLVED_M, "{name}: {}", apart(&tight));
        let separation = |solution: &Solution| solution.closest.expect("a closest approach").separation_m;
        let gap_m = (separation(&default) - separation(&tight)).abs();
        assert!(gap_m < SOLVED_M, "{name}: {gap_m}");
    }
}

#[test]
fn the_closest_approach_is_found_between_output_times() {
    // Two free vehicles pass each other at 0.3 m after 10.0123 s; the output time is 50 s later.
    let mut start = Swarm::at_rest(Rows::zeros(2));
    set_row(&mut start.positions_m, 1, Vector3::new(10.0123, 0.3, 0.0));
    set_row(&mut start.velocities_m_s, 1, Vector3::new(-1.0, 0.0, 0.0));
    let solved = solve_under(&mut Free, &start, 0.0, &[60.0], Tolerances::default()).expect("a solution");
    let closest = solved.closest.expect("a closest approach");
    assert!((closest.separation_m - 0.3).abs() < 1e-12 && (closest.time_s - 10.0123).abs() < 1e-6, "{closest:?}");
}

/// Returns two vehicles under the edge tension, 3 m apart with delta = 2 m, that approach each other.
fn thrown(closing_m_s: f64) -> (EdgeTensionLaw, Swarm) {
    let formation = Formation::line(2, 3.0);
    let graph = Graph::complete(2);
    let context = LawContext::new(&graph, &formation, 2.0, 0.0);
    let law = EdgeTensionLaw::new(&context, EdgeTensionKeys::default()).expect("a law");
    let mut start = Swarm::at_rest(formation.slots_m);
    set_row(&mut start.velocities_m_s, 1, Vector3::new(-closing_m_s, 0.0, 0.0));
    (law, start)
}

#[test]
fn a_fast_approach_keeps_its_certificate_although_trial_steps_leave_the_domain() {
    let (mut law, start) = thrown(40.0);
    let certified_m =
        law.certificate(&from(start.clone(), 0.0).observation(&start), &[]).certified_m.expect("a certificate");
    let solved = solve_under(&mut law, &start, 0.0, &[5.0], Tolerances::default()).expect("a solution");
    let closest = solved.closest.expect("a closest approach");
    assert!(certified_m < 2.01, "the approach is fast: {certified_m}");
    assert!(closest.separation_m > certified_m, "{closest:?}");
}

/// Law without braking that is undefined within 2 m.
#[derive(Clone)]
struct Wall;

impl Law for Wall {
    fn name(&self) -> &'static str {
        "wall"
    }

    fn command(&mut self, at: &Observation<'_>, command: &mut Rows) -> Result<(), LawError> {
        command.fill(0.0);
        let separation_m = tautline_core::swarm::separation(&at.own.positions_m, 0, 1);
        let hit = LawError::Collision { pair: Pair::new(0, 1), separation_m, delta_m: 2.0 };
        if separation_m > 2.0 { Ok(()) } else { Err(hit) }
    }
}

#[test]
fn a_solution_that_leaves_the_domain_of_the_law_ends_with_the_laws_error() {
    let (_, start) = thrown(1.0);
    let ended = solve_under(&mut Wall, &start, 0.0, &[0.5, 5.0], Tolerances::default());
    match ended {
        Err(IdealError::Law { time_s, source: LawError::Collision { pair, .. } }) => {
            assert!((time_s - 1.0).abs() < 1e-9, "{time_s}");
            assert_eq!(pair, Pair::new(0, 1));
        }
        other => panic!("{other:?}"),
    }
    let before = solve_under(&mut Wall, &start, 0.0, &[0.999], Tolerances::default());
    assert!(before.is_ok(), "negative control: {before:?}");
}

#[test]
fn a_start_that_the_law_refuses_is_refused() {
    let (mut law, mut start) = thrown(0.0);
    set_row(&mut start.positions_m, 1, Vector3::new(1.5, 0.0, 0.0));
    let refused = solve_under(&mut law, &start, 0.0, &[1.0], Tolerances::default());
    assert!(matches!(refused, Err(IdealError::Law { time_s: 0.0, source: LawError::Collision { .. } })), "{refused:?}");
}

#[test]
fn wrong_times_and_tolerances_are_refused_and_motion_beyond_numbers_stalls() {
    let (mut law, start) = thrown(0.0);
    let mut solve = |a22: f64, times_s: &[f64], tolerance: f64| {
        let tolerances = Tolerances { relative: tolerance, absolute: 1e-12 };
        solve_under(&mut law, &start, a22, times_s, tolerances).map(drop)
    };
    assert_eq!(solve(0.0, &[1.0, 0.5], 1e-12), Err(IdealError::Times { entry: 1 }));
    assert_eq!(solve(0.0, &[-1.0], 1e-12), Err(IdealError::Times { entry: 0 }));
    assert_eq!(solve(0.0, &[f64::NAN], 1e-12), Err(IdealError::Times { entry: 0 }));
    for tolerance in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert_eq!(solve(0.0, &[1.0], tolerance), Err(IdealError::Tolerances));
    }
    assert_eq!(solve(0.0, &[], 1e-12), Ok(()));
    let nan = solve(f64::NAN, &[1.0], 1e-12);
    assert!(matches!(nan, Err(IdealError::Stalled { .. } | IdealError::Law { .. })), "{nan:?}");
    let mut runaway = Swarm::at_rest(Rows::zeros(2));
    runaway.velocities_m_s[(0, 0)] = 1.0;
    let stalled = solve_under(&mut Free, &runaway, 100.0, &[10.0], Tolerances::default());
    assert!(matches!(stalled, Err(IdealError::Stalled { .. } | IdealError::Law { .. })), "{stalled:?}");
}

#[test]
fn an_empty_swarm_and_a_single_vehicle_have_no_closest_approach() {
    for count in [0, 1] {
        let start = Swarm::at_rest(Rows::zeros(count));
        let solved = solve_under(&mut Free, &start, 0.1, &[1.0], Tolerances::default()).expect("a solution");
        assert_eq!((solved.states.len(), solved.closest), (1, None));
    }
}

#[test]
fn the_solution_of_the_ideal_plant_does_not_depend_on_the_step() {
    let solved = solve(&scenario("pentagon", &[]), &[10.0]);
    for dt in ["0.1", "0.004166666666666667"] {
        let scenario = scenario("pentagon", &["plant.kind=ideal", "time.duration_s=10", &format!("time.dt_s={dt}")]);
        assert_eq!(scenario.plant, PlantSpec::Ideal);
        let carry_on = &mut |_| ControlFlow::Continue(());
        let parts = Components::of(&scenario).expect("a law");
        let flight = sim::fly(&scenario, parts, &mut (), carry_on).expect("a flight");
        let gap_m = (&flight.last.positions_m - &solved.states[0].positions_m).amax();
        assert!(gap_m < SOLVED_M, "dt = {dt}: {gap_m}");
        assert!(flight.engine_contacts.is_empty() && flight.ending == Ending::Completed);
    }
}

/// Flies the baseline in steps of a second, in which vehicles 4 and 5 turn round between two steps.
fn baseline_in_long_steps(max_halvings: u32) -> (sim::Flight, f64) {
    let sets = ["plant.kind=ideal", "law.delta_m=1.6", "time.dt_s=1", "time.record_hz=1", "time.duration_s=10"];
    let mut scenario = scenario("pentagon-laplacian", &sets);
    scenario.time.max_halvings = max_halvings;
    let carry_on = &mut |_| ControlFlow::Continue(());
    let flight = sim::fly(&scenario, Components::of(&scenario).expect("a law"), &mut (), carry_on).expect("a flight");
    let seconds: Vec<f64> = (0..=10_u32).map(f64::from).collect();
    let solution = solve(&scenario, &seconds);
    let mut chords = Auditor::new(scenario.count(), scenario.delta_m).expect("a judge");
    chords.start(0.0, &solution.states[0].positions_m).expect("judged");
    for (time_s, state) in seconds.iter().zip(&solution.states).skip(1) {
        chords.step(*time_s, &state.positions_m).expect("judged");
    }
    (flight, chords.finish().closest.expect("pairs").separation_m)
}

#[test]
fn a_step_with_bent_paths_is_divided_so_that_the_audit_sees_the_violation() {
    let (flight, chords_m) = baseline_in_long_steps(16);
    let closest = flight.audit.closest.expect("pairs");
    assert!((closest.separation_m - 1.532_699).abs() < 1e-5, "{closest:?}");
    assert_eq!((flight.ending, flight.audit.violations.len()), (Ending::Completed, 1));
    assert!(chords_m > 1.6, "straight lines between whole seconds hide the violation: {chords_m}");
}

#[test]
fn a_bent_step_that_cannot_be_divided_ends_the_flight_with_a_reason() {
    let (flight, _) = baseline_in_long_steps(0);
    let is_beyond = |bend_m: f64, limit_m: f64| bend_m > limit_m && (limit_m - 1e-5 * 1.6).abs() < 1e-12;
    let Ending::BrokeDown(Breakdown::Bent { step: 1, bend_m, limit_m }) = flight.ending else {
        panic!("{:?}", flight.ending);
    };
    assert!(is_beyond(bend_m, limit_m), "{bend_m} {limit_m}");
    assert_eq!(flight.steps, 0, "the refused step does not count");
    let reason = flight.ending.reason().expect("a reason");
    assert!(reason.contains("time.max_halvings") && reason.contains("1.6e-5 m are allowed"), "{reason}");
}

#[test]
fn the_ideal_plant_uses_the_given_law_and_ends_where_it_is_undefined() {
    let (_, start) = thrown(1.0);
    let mut scenario = scenario("pentagon", &["plant.kind=ideal", "time.duration_s=5"]);
    let carry_on = &mut |_| ControlFlow::Continue(());
    let free =
        sim::fly(&scenario, Components::with_law(&scenario, Box::new(Free)), &mut (), carry_on).expect("a flight");
    assert_eq!(free.last, scenario.start, "no vehicle moves without a command");

    scenario = Scenario::new("wall", start, Formation::line(2, 3.0), 0.5, 5.0);
    scenario.plant = PlantSpec::Ideal;
    let flight =
        sim::fly(&scenario, Components::with_law(&scenario, Box::new(Wall)), &mut (), carry_on).expect("a flight");
    assert!(matches!(flight.ending, Ending::LawUndefined(LawError::Collision { .. })));
    assert!((flight.duration_s - 1.0).abs() <= scenario.time.dt_s, "{}", flight.duration_s);
}

/// Flies two vehicles at each other, with a third one aside, under limited accelerations.
fn limited(speed_m_s: f64, law: &str) -> sim::Flight {
    let text = format!(
        "start = {{ positions_m = [[0, 20], [-4, 0], [4, 0]], velocities_m_s = [[0, 0], [{speed_m_s}, 0], \
         [-{speed_m_s}, 0]] }}\n\
         formation = {{ shape = \"points\", points_m = [[0, 20], [-2, 0], [2, 0]] }}\nplant.kind = \"ideal\"\n\
         time.duration_s = 3.0\n{law}"
    );
    let scenario = Scenario::read(&Source::Text { name: "limited".to_owned(), text }, &[]).expect("a scenario");
    let carry_on = &mut |_| ControlFlow::Continue(());
    sim::fly(&scenario, Components::of(&scenario).expect("a law"), &mut (), carry_on).expect("a flight")
}

#[test]
fn vehicles_that_cannot_stop_are_audited_past_the_barrier() {
    for law in [
        "law = { kind = \"potential\", delta_m = 1.0, max_accel_m_s2 = 5.0 }",
        "law = { kind = \"displacement\", delta_m = 1.0 }\nactuation.max_accel_m_s2 = 5.0",
    ] {
        let flight = limited(10.0, law);
        assert_eq!(flight.audit.status, Status::Violation, "{law}: {:?}", flight.ending);
        assert_eq!(flight.audit.violations[0].pair, Pair::new(1, 2), "{law}");
        let Ending::LawUndefined(LawError::Collision { pair, separation_m, .. }) = flight.ending else {
            panic!("{law}: {:?}", flight.ending)
        };
        assert!(pair == Pair::new(1, 2) && separation_m < 1.0 && separation_m > 0.999, "{law}: {separation_m}");
        let stopped = limited(2.0, law);
        assert_eq!((stopped.ending, stopped.audit.status), (Ending::Completed, Status::Clear), "{law}");
    }
}

#[test]
fn without_a_limit_no_vehicle_passes_the_barrier() {
    let flight = limited(10.0, "law = { kind = \"potential\", delta_m = 1.0 }");
    assert_eq!((flight.ending, flight.audit.status), (Ending::Completed, Status::Clear));
}

#[test]
fn the_same_solution_has_the_same_bits() {
    let circle = scenario("circle", &[]);
    assert_eq!(solve(&circle, &[3.0, 30.0]), solve(&circle, &[3.0, 30.0]));
}

#[test]
fn the_resolved_scenario_names_the_ideal_plant_and_reads_back() {
    let ideal = scenario("pentagon", &["plant.kind=ideal"]);
    let text = ideal.resolved().toml;
    assert!(text.contains("[plant]\nkind = \"ideal\"\n"), "{text}");
    let again = Scenario::read(&Source::Text { name: "again.toml".to_owned(), text }, &[]).expect("a scenario");
    assert_eq!(again, ideal);
    assert_ne!(again.resolved().sha256, scenario("pentagon", &[]).resolved().sha256);
}
