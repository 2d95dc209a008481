//! Published plans: each against the plans that were valid at its publication.

use std::slice;

use nalgebra::Vector3;
use proptest::prelude::*;
use tautline_audit::recorded::{
    Counterpart, Interpolation, PlanAuditor, PlanSeparations, PlansOutcome, RecordedError, Settings, VehicleSettings,
};
use tautline_audit::{Cylinder, Status};
use tautline_core::track::{Item, Piece, Plan, PlanEnd, Sample};

/// Returns a plan of one piece along x, from `x_m` at 1 m/s.
fn along_x(vehicle: usize, published_s: f64, from_s: f64, to_s: f64, x_m: f64, y_m: f64) -> Plan {
    plan(vehicle, published_s, &[(from_s, to_s)], &[[x_m, y_m, 1.0], [1.0, 0.0, 0.0]])
}

/// Returns a plan whose pieces continue one polynomial of the time since its start.
fn plan(vehicle: usize, published_s: f64, spans: &[(f64, f64)], coefficients: &[[f64; 3]]) -> Plan {
    let start_s = spans[0].0;
    let coefficients: Vec<_> = coefficients.iter().copied().map(Vector3::from).collect();
    let pieces = spans.iter().map(|&(from_s, to_s)| {
        // Horner's shift of the origin to the start of the piece.
        let mut shifted = coefficients.clone();
        for lowest in 0..shifted.len() - 1 {
            for k in (lowest..shifted.len() - 1).rev() {
                let higher = shifted[k + 1];
                shifted[k] += higher * (from_s - start_s);
            }
        }
        Piece { vehicle, from_s, to_s, coefficients: shifted }
    });
    Plan { vehicle, published_s, pieces: pieces.collect() }
}

fn judged(end: PlanEnd, plans: &[Plan]) -> PlansOutcome {
    let vehicles = plans.iter().map(|plan| plan.vehicle + 1).max().unwrap_or(0);
    let names: Vec<_> = (0..vehicles).map(|vehicle| vehicle.to_string()).collect();
    let mut auditor = PlanAuditor::new(Settings::delta(0.5), end).expect("settings");
    for plan in plans {
        auditor.push(&names, plan).expect("a plan");
    }
    auditor.finish().expect("an outcome")
}

/// Later and earlier plan of a violation, as vehicle and number, and its closest instant \[s\].
type Found = ((usize, u64), (usize, u64), f64);

fn violations(outcome: &PlansOutcome) -> Vec<Found> {
    let reference = |plan: tautline_audit::recorded::PlanReference| (plan.vehicle, plan.number);
    let found = outcome.published.violations.iter();
    let other = |other: Counterpart| reference(other.plan().expect("a plan"));
    found.map(|found| (reference(found.plan), other(found.other), found.min_at_s.expect("an instant"))).collect()
}

#[test]
fn plans_that_cross_later_are_found_although_present_positions_are_far_apart() {
    // Head-on, 10 m apart at publication: they meet after 5 s.
    let towards = plan(1, 0.2, &[(0.0, 4.0), (4.0, 10.0)], &[[10.0, 0.1, 1.0], [-1.0, 0.0, 0.0]]);
    let outcome = judged(PlanEnd::Hold, &[along_x(0, 0.0, 0.0, 10.0, 0.0, 0.0), towards]);
    assert_eq!(outcome.published.status, Status::Violation);
    assert_eq!(violations(&outcome), [((1, 1), (0, 1), 5.0)]);
    let found = &outcome.published.violations[0];
    assert_eq!((found.plan.published_s, found.limit_m), (0.2, 0.5));
    assert!((found.upper_m - 0.1).abs() < 1e-9, "{found:?}");
    // Negative twin: 1 m to the side.
    let aside = plan(1, 0.2, &[(0.0, 4.0), (4.0, 10.0)], &[[10.0, 1.0, 1.0], [-1.0, 0.0, 0.0]]);
    let outcome = judged(PlanEnd::Hold, &[along_x(0, 0.0, 0.0, 10.0, 0.0, 0.0), aside]);
    assert_eq!((outcome.published.status, outcome.plans, outcome.published.comparisons), (Status::Clear, 2, 1));
    let closest = outcome.published.closest[0].approach;
    assert!((closest.lower_m - 1.0).abs() < 1e-9 && (closest.time_s - 5.0).abs() < 1e-3, "{closest:?}");
}

#[test]
fn only_plans_that_are_valid_at_the_publication_count() {
    let first = along_x(0, 0.0, 0.0, 10.0, 0.0, 0.0);
    let towards = |published_s| plan(1, published_s, &[(0.0, 10.0)], &[[10.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]);
    // From 2 s on the first vehicle turns aside.
    let turn = plan(0, 2.0, &[(2.0, 10.0)], &[[2.0, 0.0, 1.0], [0.0, 1.0, 0.0]]);
    // Published before the turn, the plan is in conflict; published after it, the plan is clear.
    assert_eq!(
        violations(&judged(PlanEnd::Hold, &[first.clone(), towards(1.0), turn.clone()])),
        [((1, 1), (0, 1), 5.0)]
    );
    assert_eq!(judged(PlanEnd::Hold, &[first.clone(), turn, towards(3.0)]).published.status, Status::Clear);
    // A later start keeps the earlier plan until then.
    let late = plan(0, 2.0, &[(6.0, 10.0)], &[[6.0, 0.0, 1.0], [0.0, 1.0, 0.0]]);
    assert_eq!(violations(&judged(PlanEnd::Hold, &[first.clone(), late, towards(3.0)])), [((1, 1), (0, 1), 5.0)]);
    // The past of a plan is not judged: the two have passed each other before the publication.
    assert_eq!(judged(PlanEnd::Hold, &[first, towards(6.0)]).published.status, Status::Clear);
}

#[test]
fn the_last_piece_counts() {
    // Parallel for three quarters; the last quarter leads onto the other plan.
    let straight = along_x(0, 0.0, 0.0, 4.0, 0.0, 0.0);
    let mut swerve = along_x(1, 0.1, 0.0, 3.0, 0.0, 1.0);
    let last = [[3.0, 1.0, 1.0], [1.0, -0.9, 0.0]].map(Vector3::from);
    swerve.pieces.push(Piece { vehicle: 1, from_s: 3.0, to_s: 4.0, coefficients: last.to_vec() });
    let outcome = judged(PlanEnd::Hold, &[straight.clone(), swerve.clone()]);
    assert_eq!(violations(&outcome), [((1, 1), (0, 1), 4.0)]);
    // Negative twin: without its last piece the plan ends 1 m aside.
    swerve.pieces.pop();
    assert_eq!(judged(PlanEnd::Unknown, &[straight, swerve]).published.status, Status::Clear);
}

#[test]
fn the_motion_after_an_end_is_held_continued_or_unknown() {
    // The first plan ends after 2 s at x = 2; the second passes that point after 8 s.
    let ends = along_x(0, 0.0, 0.0, 2.0, 0.0, 0.0);
    let passes = plan(1, 1.0, &[(1.0, 12.0)], &[[9.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]);
    let both = [ends.clone(), passes.clone()];
    assert_eq!(violations(&judged(PlanEnd::Hold, &both)), [((1, 1), (0, 1), 8.0)]);
    // Continued they meet half-way: 1 + (t - 1) = 9 - (t - 1).
    assert_eq!(violations(&judged(PlanEnd::Continue, &both)), [((1, 1), (0, 1), 5.0)]);
    assert_eq!(judged(PlanEnd::Unknown, &both).published.status, Status::Clear);
    // A plan that ended before the publication is held too: the vehicle still hovers there.
    let late = Plan { published_s: 6.0, ..passes };
    assert_eq!(violations(&judged(PlanEnd::Hold, &[ends.clone(), late.clone()])), [((1, 1), (0, 1), 8.0)]);
    // With an unknown end there is nothing to compare.
    let outcome = judged(PlanEnd::Unknown, &[ends, late]);
    assert_eq!((outcome.published.status, outcome.published.comparisons), (Status::Undecided, 0));
}

#[test]
fn a_plan_that_has_ended_at_its_publication_is_compared_there() {
    let ended = along_x(0, 5.0, 0.0, 2.0, 0.0, 0.0);
    let stands = |y_m| plan(1, 0.0, &[(0.0, 1.0)], &[[2.0, y_m, 1.0], [0.0; 3]]);
    assert_eq!(violations(&judged(PlanEnd::Hold, &[stands(0.1), ended.clone()])), [((0, 1), (1, 1), 5.0)]);
    assert_eq!(judged(PlanEnd::Hold, &[stands(1.0), ended.clone()]).published.status, Status::Clear);
    assert_eq!(judged(PlanEnd::Unknown, &[stands(0.1), ended]).published.status, Status::Undecided);
}

#[test]
fn plans_on_the_ground_are_not_compared() {
    let above = |above_m| Settings { above_m: Some(above_m), ..Settings::delta(0.5) };
    let judged = |settings: Settings| {
        let names = ["0".to_owned(), "1".to_owned()];
        let mut auditor = PlanAuditor::new(settings, PlanEnd::Hold).expect("settings");
        for vehicle in 0..2 {
            auditor.push(&names, &along_x(vehicle, 0.0, 0.0, 2.0, 0.0, 0.0)).expect("a plan");
        }
        let PlanSeparations { status, comparisons, .. } = auditor.finish().expect("an outcome").published;
        (status, comparisons)
    };
    assert_eq!(judged(above(0.5)), (Status::Violation, 1));
    assert_eq!(judged(above(1.5)), (Status::Undecided, 0));
}

#[test]
fn invalid_plans_are_refused() {
    let names = ["a".to_owned(), "b".to_owned()];
    let auditor = || PlanAuditor::new(Settings::delta(0.5), PlanEnd::Hold).expect("settings");
    let valid = along_x(0, 1.0, 1.0, 2.0, 0.0, 0.0);
    let mut earlier = auditor();
    earlier.push(&names, &valid).expect("a plan");
    let error = earlier.push(&names, &along_x(1, 0.5, 1.0, 2.0, 9.0, 0.0)).expect_err("published before");
    assert!(matches!(error, RecordedError::OutOfOrder { .. }), "{error}");
    for wrong in [
        Plan { published_s: f64::NAN, ..valid.clone() },
        Plan { vehicle: 2, ..valid.clone() },
        plan(0, 1.0, &[(1.0, 2.0)], &[[f64::NAN, 0.0, 0.0], [0.0; 3]]),
        plan(0, 1.0, &[(2.0, 1.0)], &[[0.0; 3], [0.0; 3]]),
        plan(0, 1.0, &[(1.0, 2.0), (1.5, 3.0)], &[[0.0; 3], [0.0; 3]]),
    ] {
        auditor().push(&names, &wrong).expect_err("refused");
    }
    assert!(PlanAuditor::new(Settings::delta(-1.0), PlanEnd::Hold).is_err());
    let no_limit = PlanAuditor::new(Settings { radius_m: Some(0.0), ..Settings::default() }, PlanEnd::Hold);
    no_limit.expect("settings").push(&names, &valid).expect_err("no limit");
}

/// Returns the positions of a vehicle at 10 Hz over some seconds.
fn flight(vehicle: usize, seconds: u32, position: impl Fn(f64) -> [f64; 3]) -> Vec<Item> {
    let times = (0..=10 * seconds).map(|k| f64::from(k) / 10.0);
    let sample = |time_s| {
        let position_m = Vector3::from(position(time_s));
        Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None })
    };
    times.map(sample).collect()
}

/// Judges plans of two or more vehicles beside their flights.
fn beside_flights(settings: &Settings, plans: &[Plan], flights: &[Vec<Item>]) -> Result<PlansOutcome, RecordedError> {
    let names: Vec<_> = (0..flights.len()).map(|vehicle| vehicle.to_string()).collect();
    let mut items = flights.concat();
    items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    let mut auditor = PlanAuditor::new(settings.clone(), PlanEnd::Hold)?.with_flights(settings);
    for plan in plans {
        auditor.push(&names, plan)?;
    }
    for items in items.chunks(50) {
        auditor.push_flights(&names, items)?;
    }
    auditor.finish()
}

fn flown(settings: &Settings, plans: &[Plan], flights: &[Vec<Item>]) -> PlanSeparations {
    beside_flights(settings, plans, flights).expect("an outcome").flown.expect("flights")
}

#[test]
fn a_plan_through_a_vehicle_without_plans_is_found() {
    let delta = Settings::delta(0.5);
    let ahead = along_x(0, 0.0, 0.0, 10.0, 0.0, 0.0);
    let own = flight(0, 10, |time_s| [time_s, 0.0, 1.0]);
    let hovers = |y| flight(1, 10, move |_| [5.0, y, 1.0]);
    let found = flown(&delta, slice::from_ref(&ahead), &[own.clone(), hovers(0.2)]);
    assert_eq!((found.status, found.comparisons, found.violations.len()), (Status::Violation, 1, 1));
    let violation = &found.violations[0];
    assert_eq!((violation.plan.number, violation.other), (1, Counterpart::Flight(1)));
    assert!((violation.upper_m - 0.2).abs() < 1e-9 && violation.min_at_s.is_some_and(|at_s| (at_s - 5.0).abs() < 1e-6));
    // Negative twins: the vehicle hovers 1 m aside, or the plan is replaced before it comes close.
    let found = flown(&delta, slice::from_ref(&ahead), &[own.clone(), hovers(1.0)]);
    assert_eq!(found.status, Status::Clear);
    assert!((found.closest[0].approach.lower_m - 1.0).abs() < 1e-9, "{:?}", found.closest);
    let stop = plan(0, 3.0, &[(3.0, 4.0)], &[[3.0, 0.0, 1.0], [0.0; 3]]);
    let stops = flight(0, 10, |time_s| [time_s.min(3.0), 0.0, 1.0]);
    assert_eq!(flown(&delta, &[ahead.clone(), stop], &[stops.clone(), hovers(0.2)]).status, Status::Clear);
    // A stop that is published too late: the plan is flown until then.
    let late = plan(0, 4.8, &[(3.0, 4.0)], &[[3.0, 0.0, 1.0], [0.0; 3]]);
    assert_eq!(flown(&delta, &[ahead, late], &[stops, hovers(0.2)]).status, Status::Violation);
}

#[test]
fn flights_with_gaps_are_undecided() {
    let delta = Settings::delta(0.5);
    let plans = [along_x(0, 0.0, 0.0, 10.0, 0.0, 0.0)];
    let own = flight(0, 10, |time_s| [time_s, 0.0, 1.0]);
    let whole = flight(1, 10, |_| [5.0, 2.0, 1.0]);
    assert_eq!(flown(&delta, &plans, &[own.clone(), whole.clone()]).status, Status::Clear);
    let gap: Vec<_> = whole.iter().filter(|item| !(4.0..6.0).contains(&item.time_s())).cloned().collect();
    assert_eq!(flown(&delta, &plans, &[own.clone(), gap.clone()]).status, Status::Undecided);
    // The gap does not matter for a plan that is published after it.
    let after = [along_x(0, 7.0, 7.0, 10.0, 7.0, 0.0)];
    assert_eq!(flown(&delta, &after, &[own.clone(), gap.clone()]).status, Status::Clear);
    // The judged time begins, ends, or lies within the gap.
    for (from_s, until_s) in [(5.0, 10.0), (0.0, 5.0), (4.5, 5.5)] {
        let cut = Settings { from_s: Some(from_s), until_s: Some(until_s), ..delta.clone() };
        assert_eq!(flown(&cut, &plans, &[own.clone(), gap.clone()]).status, Status::Undecided, "{from_s} {until_s}");
        assert_eq!(flown(&cut, &plans, &[own.clone(), whole.clone()]).status, Status::Clear, "{from_s} {until_s}");
    }
    // Nothing is compared with a vehicle that has left.
    let left = whole.iter().filter(|item| item.time_s() < 5.0).cloned().collect();
    let found = flown(&delta, &after, &[own, left]);
    assert_eq!((found.status, found.comparisons), (Status::Undecided, 0));
}

#[test]
fn a_bound_on_accelerations_leaves_near_plans_undecided() {
    let plans = [along_x(0, 0.0, 0.0, 10.0, 0.0, 0.0)];
    let flights = [flight(0, 10, |time_s| [time_s, 0.0, 1.0]), flight(1, 10, |_| [5.0, 0.51, 1.0])];
    let bounded =
        |accel| Settings { motion: Some(Interpolation::Bounded), max_accel_m_s2: Some(accel), ..Settings::delta(0.5) };
    // Within 0.1 s the vehicle leaves its chord by up to A h^2 / 8.
    assert_eq!(flown(&bounded(4.0), &plans, &flights).status, Status::Clear);
    assert_eq!(flown(&bounded(16.0), &plans, &flights).status, Status::Undecided);
    let nearer = [flights[0].clone(), flight(1, 10, |_| [5.0, 0.3, 1.0])];
    let found = flown(&bounded(4.0), &plans, &nearer);
    assert_eq!((found.status, found.violations[0].lower_m), (Status::Violation, f64::NEG_INFINITY));
}

#[test]
fn plans_of_exchanged_vehicles_are_refused() {
    let delta = Settings::delta(0.5);
    let plans = [along_x(0, 0.0, 0.0, 5.0, 0.0, 0.0), along_x(1, 0.1, 0.1, 5.0, 0.1, 3.0)];
    let flights = [0.05, 3.0].map(|y| move |time_s| [time_s, y, 1.0]);
    let [first, second] = flights;
    let right = [flight(0, 5, first), flight(1, 5, second)];
    let outcome = beside_flights(&delta, &plans, &right).expect("an outcome");
    let error = outcome.tracking_error.expect("flights of planned vehicles");
    assert_eq!((outcome.published.status, error.plan.vehicle), (Status::Clear, 0));
    assert!((error.distance_m - 0.05).abs() < 1e-9, "{error:?}");
    let exchanged = [flight(0, 5, second), flight(1, 5, first)];
    let error = beside_flights(&delta, &plans, &exchanged).expect_err("exchanged");
    assert_eq!(error, RecordedError::ExchangedFlights { vehicle: "0".to_owned(), other: "1".to_owned() });
    // One vehicle far from its plan is no exchange: the other is where its plan is. Nothing is clear, though.
    let astray = [flight(0, 5, |time_s| [time_s, 5.0, 1.0]), flight(1, 5, second)];
    let outcome = beside_flights(&delta, &plans, &astray).expect("an outcome");
    assert!(outcome.tracking_error.is_some_and(|error| (error.distance_m - 5.0).abs() < 1e-9));
    assert!(outcome.flown.is_some_and(|flown| flown.status == Status::Undecided));
    // Numbers that are shifted by one: the last vehicle has no plan.
    let third = flight(2, 5, |time_s| [time_s, 9.0, 1.0]);
    let shifted = [flight(0, 5, |time_s| [time_s, -9.0, 1.0]), flight(1, 5, first), flight(2, 5, second)];
    let error = beside_flights(&delta, &plans, &shifted).expect_err("shifted");
    assert!(matches!(error, RecordedError::ExchangedFlights { .. }), "{error}");
    let [first, second] = right;
    assert!(beside_flights(&delta, &plans, &[first, second, third]).is_ok());
}

#[test]
fn plans_that_are_never_flown_exchange_no_names() {
    // Each vehicle plans to fly to the other, and stays.
    let delta = Settings::delta(0.5);
    let flights = [flight(0, 10, |_| [0.0, 0.0, 1.0]), flight(1, 10, |_| [10.0, 0.0, 1.0])];
    let stands = |vehicle, published_s, from_s, x_m| plan(vehicle, published_s, &[(from_s, 12.0)], &[[x_m, 0.0, 1.0]]);
    let plans =
        [stands(0, 5.0, 8.0, 10.0), stands(1, 5.0, 8.0, 0.0), stands(0, 6.0, 7.0, 0.0), stands(1, 6.0, 7.0, 10.0)];
    assert_eq!(flown(&delta, &plans, &flights).status, Status::Clear);
    // Negative twin: flown.
    assert!(beside_flights(&delta, &plans[..2], &flights).is_err());
}

#[test]
fn jumps_are_at_their_samples() {
    let held = Settings { motion: Some(Interpolation::Hold), ..Settings::delta(0.5) };
    let plans = [along_x(0, 0.0, 0.0, 5.0, 0.0, 0.0)];
    let flights = [flight(0, 5, |time_s| [time_s, 0.0, 1.0]), flight(1, 5, |_| [0.0, 9.0, 1.0])];
    let outcome = beside_flights(&held, &plans, &flights).expect("an outcome");
    assert!(outcome.tracking_error.is_some_and(|error| error.distance_m < 1e-9), "{:?}", outcome.tracking_error);
}

#[test]
fn later_plans_within_a_cylinder_are_found() {
    // Above and beside each other by 0.9 of the cylinder: 1.27 m apart.
    let settings = Settings { cylinder: Some(Cylinder { horizontal_m: 1.0, vertical_m: 1.0 }), ..Settings::default() };
    let stands = |vehicle, from_s, y_m, z_m| plan(vehicle, from_s, &[(from_s, from_s + 5.0)], &[[0.0, y_m, z_m]]);
    let flights = |end: [f64; 2]| {
        let first = move |time_s| if time_s < 5.0 { [0.0, -0.2, 1.9] } else { [0.0, end[0], end[1]] };
        [flight(0, 10, first), flight(1, 10, |_| [0.0, 0.9, 1.9])]
    };
    let plans = [stands(0, 0.0, -0.2, 1.9), stands(0, 5.0, 0.0, 1.0)];
    assert_eq!(flown(&settings, &plans, &flights([0.0, 1.0])).status, Status::Violation);
    let mut between = plans.to_vec();
    between.insert(0, plan(1, 0.0, &[(0.0, 10.0)], &[[0.0, 0.9, 1.9]]));
    let names = ["0".to_owned(), "1".to_owned()];
    let mut auditor = PlanAuditor::new(settings.clone(), PlanEnd::Hold).expect("settings");
    for plan in &between {
        auditor.push(&names, plan).expect("a plan");
    }
    assert_eq!(auditor.finish().expect("an outcome").published.status, Status::Violation);
    // Negative twin: 1.05 of the cylinder.
    let clear = [plans[0].clone(), stands(0, 5.0, -0.15, 1.0)];
    assert_eq!(flown(&settings, &clear, &flights([-0.15, 1.0])).status, Status::Clear);
}

#[test]
fn clock_offsets_of_vehicles_with_plans_are_refused() {
    let offset = VehicleSettings { offset_s: -5.0, ..VehicleSettings::default() };
    let settings = Settings { vehicles: [("0".to_owned(), offset)].into(), ..Settings::delta(0.5) };
    let error = PlanAuditor::new(settings, PlanEnd::Hold).expect_err("an offset");
    assert_eq!(error, RecordedError::OffsetOfPlans { vehicle: "0".to_owned() });
}

/// Returns the position of a plan at an instant, held after its end.
fn position(plan: &Plan, time_s: f64) -> Vector3<f64> {
    let piece = plan.pieces.iter().rfind(|piece| piece.from_s <= time_s).expect("a piece");
    let elapsed_s = time_s.min(piece.to_s) - piece.from_s;
    piece.coefficients.iter().rev().fold(Vector3::zeros(), |sum, c| sum * elapsed_s + c)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// Compares the verdict with plans of four vehicles sampled finely, by an own model of what is valid when.
    #[test]
    fn random_plans_agree_with_fine_samples(
        drawn in prop::collection::vec(
            (0..4_usize, 0.0..0.6_f64, 0.0..1.0_f64, 0.5..3.0_f64, prop::array::uniform6(-2.0..2.0_f64), -1.0..1.0_f64),
            2..14,
        ),
    ) {
        let mut now_s = 0.0;
        let plans: Vec<_> = drawn.iter().map(|(vehicle, wait_s, late_s, lasts_s, c, bend)| {
            now_s += wait_s;
            let (from_s, middle_s) = (now_s + late_s, now_s + late_s + 0.4 * lasts_s);
            let coefficients = [[c[0], c[1], c[2]], [c[3], c[4], c[5]], [*bend, -bend, 0.5 * bend]];
            plan(*vehicle, now_s, &[(from_s, middle_s), (middle_s, from_s + lasts_s)], &coefficients)
        }).collect();
        let outcome = judged(PlanEnd::Hold, &plans);
        let mut least = f64::INFINITY;
        let mut below = Vec::new();
        for (k, plan) in plans.iter().enumerate() {
            for other in (0..4).filter(|other| *other != plan.vehicle) {
                // Published plans, without those that a later one replaced from their start on.
                let mut valid: Vec<&Plan> = Vec::new();
                for earlier in plans[..k].iter().filter(|earlier| earlier.vehicle == other) {
                    valid.retain(|valid| valid.pieces[0].from_s < earlier.pieces[0].from_s);
                    valid.push(earlier);
                }
                let starts = valid.iter().skip(1).map(|next| next.pieces[0].from_s).chain([f64::INFINITY]);
                let ends = valid.iter().zip(starts).map(|(plan, until_s)| plan.pieces[1].to_s.min(until_s));
                let ends = ends.fold(plan.pieces[1].to_s, f64::max);
                let from_s = plan.pieces[0].from_s.max(plan.published_s);
                let steps = 600;
                for step in 0..=steps {
                    let time_s = from_s + (ends - from_s).max(0.0) * f64::from(step) / f64::from(steps);
                    let Some(flown) = valid.iter().rfind(|valid| valid.pieces[0].from_s <= time_s) else { continue };
                    let distance_m = (position(plan, time_s) - position(flown, time_s)).norm();
                    least = least.min(distance_m);
                    if distance_m < 0.5 {
                        below.push((k, other, time_s));
                    }
                }
            }
        }
        // Every sample below the limit is in a violation of its two vehicles.
        let number = |k: usize| plans[..=k].iter().filter(|plan| plan.vehicle == plans[k].vehicle).count() as u64;
        for (k, other, time_s) in &below {
            let is_found = outcome.published.violations.iter().any(|found| {
                let is_of = (found.plan.vehicle, found.plan.number, found.other.vehicle());
                let spans = found.from_s - 1e-9 <= *time_s && *time_s <= found.to_s + 1e-9;
                is_of == (plans[*k].vehicle, number(*k), *other) && spans
            });
            prop_assert!(is_found, "{k} {other} {time_s} {:?}", outcome.published.violations);
        }
        prop_assert!(!below.is_empty() || outcome.published.violations.iter().all(|found| found.upper_m > 0.5 - 0.05));
        if let Some(closest) = outcome.published.closest.first() {
            prop_assert!(closest.approach.lower_m <= least + 1e-9, "{closest:?} {least}");
        }
        if outcome.published.status == Status::Clear {
            prop_assert!(least >= 0.5 - 1e-9, "{least}");
        }
    }

    /// Compares plans and flights with fine samples, by an own model of when a plan is flown.
    #[test]
    fn random_plans_beside_flights_agree_with_fine_samples(
        drawn in prop::collection::vec(
            (0..3_usize, 0.0..0.6_f64, -0.3..1.0_f64, 0.5..3.0_f64, prop::array::uniform6(-2.0..2.0_f64)),
            1..10,
        ),
        corners in prop::array::uniform3(prop::collection::vec(prop::array::uniform3(-2.0..2.0_f64), 5)),
    ) {
        let mut now_s = 0.0;
        let plans: Vec<_> = drawn.iter().map(|(vehicle, wait_s, late_s, lasts_s, c)| {
            now_s += wait_s;
            let (from_s, middle_s) = (now_s + late_s, now_s + late_s + 0.4 * lasts_s);
            let coefficients = [[c[0], c[1], c[2]], [c[3], c[4], c[5]]];
            plan(*vehicle, now_s, &[(from_s, middle_s), (middle_s, from_s + lasts_s)], &coefficients)
        }).collect();
        // The flights have a corner each second, and are straight between.
        let place = |vehicle: usize, time_s: f64| {
            let before = (0..4).rfind(|k| *k as f64 <= time_s).unwrap_or(0);
            let [from, to] = [before, before + 1].map(|k| Vector3::from(corners[vehicle][k]));
            from + (to - from) * (time_s - before as f64)
        };
        let flown = |vehicle| flight(vehicle, 4, |time_s| place(vehicle, time_s).into());
        let flights: Vec<_> = (0..3).map(flown).collect();
        let outcome = match beside_flights(&Settings::delta(0.5), &plans, &flights) {
            Err(RecordedError::ExchangedFlights { .. }) => return Ok(()),
            outcome => outcome.expect("an outcome").flown.expect("flights"),
        };
        let (mut least, mut is_compared, mut is_astray) = (f64::INFINITY, false, false);
        for (k, plan) in plans.iter().enumerate() {
            let next = plans[k + 1..].iter().filter(|next| next.vehicle == plan.vehicle);
            let until_s = next.map(|next| next.pieces[0].from_s.max(next.published_s)).fold(4.0, f64::min);
            let from_s = plan.pieces[0].from_s.max(plan.published_s);
            if from_s >= until_s {
                continue;
            }
            is_compared = true;
            is_astray |= (position(plan, from_s) - place(plan.vehicle, from_s)).norm() > 0.5;
            let number = plans[..=k].iter().filter(|earlier| earlier.vehicle == plan.vehicle).count() as u64;
            for other in (0..3).filter(|other| *other != plan.vehicle) {
                for step in 0..=400 {
                    let time_s = from_s + (until_s - from_s) * f64::from(step) / 400.0;
                    let distance_m = (position(plan, time_s) - place(other, time_s)).norm();
                    least = least.min(distance_m);
                    let is_found = outcome.violations.iter().any(|found| {
                        let is_of = (found.plan.vehicle, found.plan.number, found.other)
                            == (plan.vehicle, number, Counterpart::Flight(other));
                        is_of && found.from_s - 1e-9 <= time_s && time_s <= found.to_s + 1e-9
                    });
                    prop_assert!(is_found || distance_m > 0.5 - 1e-9, "{k} {other} {time_s} {distance_m}");
                    prop_assert!(!is_found || distance_m < 0.5 + 1e-6, "{k} {other} {time_s} {distance_m}");
                }
            }
        }
        let is_decided = is_compared && !is_astray;
        prop_assert_eq!(outcome.status, match outcome.violations[..] {
            [] if is_decided => Status::Clear,
            [] => Status::Undecided,
            _ => Status::Violation,
        });
        if let Some(closest) = outcome.closest.first() {
            prop_assert!(closest.approach.lower_m <= least + 1e-9, "{closest:?} {least}");
        }
    }
}
