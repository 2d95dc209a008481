//! Laws from the literature behave as in their sources, including their failures.

use tautline_audit::{Status, swept_separation_m};
use tautline_core::swarm::{Rows, Swarm, mean_row, row, separation};
use tautline_laws::formation::Formation;
use tautline_laws::graph::Graph;
use tautline_laws::law::{
    BvcKeys, CbfQpKeys, CbfQpVariant, FlockingKeys, LawContext, LawSpec, OrcaKeys, OrcaLaw, PotentialKeys, VoidReason,
};
use tautline_laws::observation::Observation;
use tautline_laws::space::CellList;
use tautline_report::run::run;
use tautline_sim::scenario::{PlantSpec, Scenario};
use tautline_sim::sim::{Ending, Flight};

use crate::flight::{fly, read};

/// Parameters of RVO2's Circle demo: radius 1.5 m, at most 10 neighbours within 15 m, horizon 10 s, highest speed 2
/// m/s. The preferred speed is 1 m/s, and less within 1 m of the goal. The step is 0.25 s, in which vehicles that are
/// too close separate.
const CIRCLE_DELTA_M: f64 = 3.0;
const CIRCLE_REACH_M: f64 = 15.0;
const CIRCLE_STEP_S: f64 = 0.25;

fn circle_keys() -> OrcaKeys {
    OrcaKeys {
        k_per_s: 1.0,
        speed_m_s: 1.0,
        max_speed_m_s: 2.0,
        horizon_s: 10.0,
        tracking_per_s: 1.0 / CIRCLE_STEP_S,
        neighbours_max: 10,
        range_m: Some(CIRCLE_REACH_M),
        margin_m: Some(0.0),
        ..OrcaKeys::default()
    }
}

/// Returns evenly spaced positions on a circle.
fn circle(count: usize, radius_m: f64) -> Rows {
    let at = |i: usize| libm::sincos(std::f64::consts::TAU * i as f64 / count as f64);
    Rows::from_fn(count, |i, axis| [radius_m * at(i).1, radius_m * at(i).0, 0.0][axis])
}

/// Rounds to single precision, as RVO2 does; otherwise the exact symmetry would never break.
#[expect(clippy::cast_possible_truncation, reason = "rounding is what it is for")]
fn round_to_single(rows: &mut Rows) {
    rows.iter_mut().for_each(|number| *number = f64::from(*number as f32));
}

/// Result of a crossing of the circle.
#[derive(Debug)]
struct Crossing {
    /// Smallest separation of any pair, between steps too \[m\].
    swept_m: f64,
    /// Time at which all vehicles were within a radius of their goals, or at which the crossing was given up \[s\].
    time_s: f64,
    arrived: bool,
}

/// Flies vehicles across a circle. Each vehicle adopts its chosen velocity at once and keeps it for a step.
fn cross(count: usize, radius_m: f64, longest_s: f64) -> Crossing {
    let mut swarm = Swarm::at_rest(circle(count, radius_m));
    let (links, formation) = (Graph::complete(count), Formation::points(-&swarm.positions_m));
    let context = LawContext::new(&links, &formation, CIRCLE_DELTA_M, 0.0);
    let mut law = OrcaLaw::new(&context, circle_keys()).expect("a law");
    let (mut near, mut velocities) = (CellList::default(), Rows::zeros(count));
    let is_there = |positions_m: &Rows, i: usize| {
        (row(positions_m, i) - row(&formation.slots_m, i)).norm() <= 0.5 * CIRCLE_DELTA_M
    };
    let mut crossing = Crossing { swept_m: f64::INFINITY, time_s: 0.0, arrived: false };
    while crossing.time_s < longest_s && !crossing.arrived {
        round_to_single(&mut swarm.positions_m);
        near.update(&swarm.positions_m, CIRCLE_REACH_M);
        let at = Observation { near: near.pairs(), ..Observation::exact(&swarm, &links, &formation) };
        law.velocities(&at, &mut velocities).expect("velocities");
        let next_m = &swarm.positions_m + &velocities * CIRCLE_STEP_S;
        for &(i, j) in near.pairs() {
            let apart = |rows: &Rows| row(rows, j) - row(rows, i);
            let swept_m = swept_separation_m(apart(&swarm.positions_m), apart(&next_m));
            crossing.swept_m = crossing.swept_m.min(swept_m);
        }
        assert!(next_m.column(2).iter().all(|&z| z == 0.0), "all vehicles stay in the plane");
        swarm.positions_m.copy_from(&next_m);
        swarm.velocities_m_s.copy_from(&velocities);
        crossing.time_s += CIRCLE_STEP_S;
        crossing.arrived = (0..count).all(|i| is_there(&next_m, i));
    }
    crossing
}

#[test]
fn orca_keeps_its_distance_for_ten_vehicles_but_not_for_a_hundred() {
    for count in [2, 10] {
        let few = cross(count, 20.0, 300.0);
        assert!(few.swept_m > CIRCLE_DELTA_M - 1e-5, "{few:?}");
    }
    let many = cross(100, 80.0, 80.0);
    assert!((many.swept_m - 2.764).abs() < 0.01, "in a crowd no velocity is free: {many:?}");
    if std::env::var_os("TAUTLINE_LONG").is_some() {
        let demo = cross(250, 200.0, 1500.0);
        assert!(demo.arrived && (demo.swept_m - 2.312).abs() < 0.01, "RVO2's own run comes to 2.344 m: {demo:?}");
    }
}

fn scenario(name: &str, start: Swarm, slots_m: Rows, duration_s: f64, law: LawSpec) -> Scenario {
    let mut scenario = Scenario::new(name, start, Formation::points(slots_m), 1.0, duration_s);
    (scenario.law, scenario.plant) = (law, PlantSpec::Rapier);
    scenario.validate().expect("a valid scenario");
    scenario
}

fn closest_m(flight: &Flight) -> f64 {
    flight.audit.closest.expect("pairs").separation_m
}

/// Returns the largest distance of a vehicle from its slot at the end \[m\].
fn missing_m(scenario: &Scenario, flight: &Flight) -> f64 {
    let slots_m = &scenario.formation().slots_m;
    (0..scenario.count()).map(|i| (row(&flight.last.positions_m, i) - row(slots_m, i)).norm()).fold(0.0, f64::max)
}

/// Returns a scenario of two vehicles, 10 m apart on the x axis, that swap positions. The first starts `aside_m` off
/// the axis.
fn swap(law: LawSpec, aside_m: f64) -> Scenario {
    let places_m = Rows::from_row_slice(&[-5.0, 0.0, 0.0, 5.0, 0.0, 0.0]);
    let mut start = Swarm::at_rest(places_m.clone());
    start.positions_m[(0, 1)] = aside_m;
    scenario("swap", start, -places_m, 60.0, law)
}

/// Returns a crossing of `count` vehicles on a circle of 8 m, with a small offset of one start.
fn crossing(law: LawSpec, count: usize, duration_s: f64) -> Scenario {
    let places_m = circle(count, 8.0);
    let mut start = Swarm::at_rest(places_m.clone());
    start.positions_m[(0, 0)] += 0.05;
    scenario("crossing", start, -places_m, duration_s, law)
}

/// Returns `cbf-qp` with braking barriers.
fn braking() -> LawSpec {
    LawSpec::CbfQp(CbfQpKeys { variant: CbfQpVariant::Braking, ..CbfQpKeys::default() })
}

#[test]
fn laws_that_choose_the_nearest_command_deadlock_on_a_symmetric_swap() {
    let bvc = LawSpec::Bvc(BvcKeys::default());
    for law in [LawSpec::CbfQp(CbfQpKeys::default()), braking(), LawSpec::Orca(OrcaKeys::default()), bvc] {
        let stuck = swap(law.clone(), 0.0);
        let (flight, _) = fly(&stuck);
        assert_eq!((&flight.ending, flight.audit.status), (&Ending::Completed, Status::Clear), "{law:?}");
        let is_braking = law == braking();
        let void = if is_braking { VoidReason::NoBoundComputed } else { VoidReason::CommandLimited };
        assert_eq!(flight.certificate.void, [void], "{law:?}");
        let (closest_m, missing_m) = (closest_m(&flight), missing_m(&stuck, &flight));
        assert!(closest_m > 1.0 && closest_m < 1.02 && missing_m > 5.4, "{law:?}: {closest_m} {missing_m}");
        assert!(flight.last.velocities_m_s.amax() < 1e-5, "{law:?}");
    }
    for law in [LawSpec::CbfQp(CbfQpKeys::default()), braking(), LawSpec::Orca(OrcaKeys::default())] {
        let passing = swap(law.clone(), 0.01);
        let (flight, _) = fly(&passing);
        assert_eq!(flight.audit.status, Status::Clear, "{law:?}");
        assert!(missing_m(&passing, &flight) < 1e-9, "{law:?}");
    }
}

/// Each neighbour demands half of the avoidance of its pair, and the sum may exceed the limit of a vehicle at any step.
#[test]
fn barrier_functions_violate_delta_for_twelve_vehicles() {
    for dt_s in [1.0 / 240.0, 1.0 / 960.0] {
        let mut twelve = crossing(LawSpec::CbfQp(CbfQpKeys::default()), 12, 9.0);
        twelve.time.dt_s = dt_s;
        let (flight, _) = fly(&twelve);
        assert_eq!(flight.audit.status, Status::Violation);
        assert!((closest_m(&flight) - 0.928).abs() < 0.003, "{}", closest_m(&flight));
    }
}

/// The braking variant keeps its margin of 0.01 m on the same crossing.
#[test]
fn braking_barriers_keep_delta_for_twelve_vehicles() {
    let twelve = crossing(braking(), 12, 40.0);
    let (flight, _) = fly(&twelve);
    assert_eq!(flight.audit.status, Status::Clear);
    assert!((closest_m(&flight) - 1.01).abs() < 1e-4, "{}", closest_m(&flight));
}

#[test]
fn tracked_velocities_have_no_guarantee_if_they_change_slowly() {
    let orca = |max_accel_m_s2| LawSpec::Orca(OrcaKeys { max_accel_m_s2, ..OrcaKeys::default() });
    let bvc = |max_accel_m_s2| LawSpec::Bvc(BvcKeys { max_accel_m_s2, ..BvcKeys::default() });
    for (weak, strong, at_most_m) in [(orca(0.1), orca(5.0), 1.01), (bvc(0.1), bvc(5.0), 1.5)] {
        let [weak, strong] = [weak, strong].map(|law| fly(&swap(law, 0.1)).0);
        assert!(weak.audit.status == Status::Violation && closest_m(&weak) < 0.7, "{}", closest_m(&weak));
        assert!(strong.audit.status == Status::Clear && closest_m(&strong) < at_most_m, "{}", closest_m(&strong));
    }
}

/// Flies two vehicles, 8 m apart, towards each other at `speed_m_s` each, with their slots between them.
fn meeting(law: LawSpec, speed_m_s: f64) -> Flight {
    let places_m = Rows::from_row_slice(&[-4.0, 0.0, 0.0, 4.0, 0.0, 0.0]);
    let mut start = Swarm::at_rest(places_m.clone());
    (start.velocities_m_s[(0, 0)], start.velocities_m_s[(1, 0)]) = (speed_m_s, -speed_m_s);
    fly(&scenario("meeting", start, places_m * 0.25, 10.0, law)).0
}

#[test]
fn bounded_forces_stop_limited_speeds_only() {
    let flocking = || LawSpec::Flocking(FlockingKeys::default());
    let potential = |max_accel_m_s2| LawSpec::Potential(PotentialKeys { max_accel_m_s2, ..PotentialKeys::default() });
    for (law, speed_m_s, expected) in [
        (flocking(), 4.0, Status::Clear),
        (flocking(), 6.0, Status::Violation),
        (potential(Some(5.0)), 2.0, Status::Clear),
        (potential(Some(5.0)), 10.0, Status::Violation),
    ] {
        let flight = meeting(law.clone(), speed_m_s);
        assert_eq!(flight.audit.status, expected, "{law:?} at {speed_m_s} m/s");
        assert_eq!((flight.certificate.certified_m, flight.certificate.void[0]), (None, VoidReason::CommandLimited));
    }
    let unbounded = meeting(potential(None), 10.0);
    assert_eq!(unbounded.audit.status, Status::Clear);
    assert!(unbounded.certificate.certified_m.is_some_and(|certified_m| closest_m(&unbounded) >= certified_m));
}

/// Returns the number of links of an alpha-lattice and the deviation energy of its source. It is the sum of squared
/// deviations from the spacing over links + 1, in units of the spacing.
fn lattice(positions_m: &Rows, spacing_m: f64) -> (u32, f64) {
    let count = positions_m.nrows();
    let pairs = (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j)));
    let lengths = pairs.map(|(i, j)| separation(positions_m, i, j) / spacing_m).filter(|length| *length < 1.2);
    let (links, squares) = lengths.fold((0, 0.0), |(links, sum), length| (links + 1, sum + (length - 1.0).powi(2)));
    (links, squares / f64::from(links + 1))
}

#[test]
fn flock_converges_to_a_lattice_of_its_spacing() {
    const SPACING_M: f64 = 3.0;
    let hexagon_m = circle(6, 3.5);
    let stir = |i: usize, axis: usize| if axis < 2 { 0.5 * libm::sin((3 * i + 5 * axis) as f64) } else { 0.0 };
    let place = |i: usize, axis: usize| if i < 6 { hexagon_m[(i, axis)] } else { 0.0 };
    let mut start = Swarm::at_rest(Rows::from_fn(7, |i, axis| place(i, axis) + stir(i, axis)));
    start.velocities_m_s[(0, 0)] = 0.5;
    assert!(lattice(&start.positions_m, SPACING_M).1 > 5e-3);
    let keys = FlockingKeys { spacing_m: Some(SPACING_M), ..FlockingKeys::default() };
    let slots_m = Formation::line(7, SPACING_M).slots_m;
    let flock = scenario("flock", start, slots_m, 60.0, LawSpec::Flocking(keys));
    let (flight, _) = fly(&flock);
    assert_eq!(flight.audit.status, Status::Clear);
    let (links, deviation) = lattice(&flight.last.positions_m, SPACING_M);
    assert!(links == 12 && deviation < 1e-3, "a hexagon and its centre: {links} links, deviation {deviation}");
    assert!(flight.last.disagreement_m_s() < 1e-3, "{}", flight.last.disagreement_m_s());
    assert!(missing_m(&flock, &flight) > SPACING_M, "a flock ignores slots");
}

#[test]
fn laws_stay_in_the_plane_and_within_their_limits() {
    for law in [
        LawSpec::CbfQp(CbfQpKeys::default()),
        braking(),
        LawSpec::Orca(OrcaKeys::default()),
        LawSpec::Bvc(BvcKeys::default()),
        LawSpec::Flocking(FlockingKeys::default()),
    ] {
        let (_, log) = fly(&crossing(law.clone(), 5, 15.0));
        assert!(log.samples.iter().all(|sample| sample.swarm.positions_m.column(2).amax() == 0.0), "{law:?}");
        let peak = log.samples.iter().filter_map(|sample| sample.peaks.control_m_s2).fold(0.0, f64::max);
        assert!(peak > 0.3 && peak <= 5.0 + 1e-9, "{law:?}: {peak}");
    }
}

/// Returns a scenario of four vehicles that follow a reference on a circle.
fn carried(law: &str, fed: bool) -> Scenario {
    read(&format!(
        "swarm = {{ count = 4, a22_per_s = 0.05 }}\n\
         start = {{ shape = \"line\", spacing_m = 3.0 }}\n\
         formation = {{ shape = \"circle\", radius_m = 3.0 }}\n\
         law = {{ kind = \"{law}\", delta_m = 1.0 }}\n\
         reference = {{ kind = \"circle\", radius_m = 4.0, period_s = 40.0, feed_forward = {fed} }}\n\
         time = {{ duration_s = 60.0 }}\n\
         [[leg]]\nstart_s = 30.0\nshape = \"grid\"\nspacing_m = 3.0\n"
    ))
}

/// Laws with slots reach the slots that the reference has moved, on each leg. Without feed-forward of its acceleration
/// they lag by r''/k, which exceeds the limit of arrival.
#[test]
fn slot_laws_follow_a_reference_and_lag_without_feed_forward() {
    for law in ["orca", "bvc", "cbf-qp"] {
        let report = run(&carried(law, true), &mut ()).expect("a report");
        assert!(report.verdict.pass, "{law}: {:?}", report.verdict.reasons);
        assert!(report.legs.iter().all(|leg| leg.reached_at_s.is_some()), "{law}: {:?}", report.legs);
        let late = run(&carried(law, false), &mut ()).expect("a report");
        assert!(late.answer.status == Status::Clear && !late.formation.reached, "{law}: {}", late.headline());
    }
}

/// A flock has no slots, and its centre follows the reference. Far vehicles with bounded pulls follow slowly. Without
/// feed-forward of the acceleration the flock never arrives, as in its source.
#[test]
fn flock_follows_a_reference_with_feed_forward() {
    let off = |fed: bool| {
        let mut scenario = carried("flocking", fed);
        scenario.time.duration_s = 200.0;
        let (flight, _) = fly(&scenario);
        let there = scenario.reference_at(flight.duration_s);
        let middle_m = mean_row(&scenario.legs[1].formation.slots_m) + there.position_m;
        let off_m = (mean_row(&flight.last.positions_m) - middle_m).norm();
        (off_m, (flight.last.mean_velocity_m_s() - there.velocity_m_s).norm())
    };
    let (off_m, off_m_s) = off(true);
    assert!(off_m < 0.01 && off_m_s < 0.001, "{off_m} {off_m_s}");
    let (off_m, off_m_s) = off(false);
    assert!(off_m > 0.5 && off_m_s > 0.05, "{off_m} {off_m_s}");
}
