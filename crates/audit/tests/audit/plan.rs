//! Flights against their plans: distances between samples, delays, tubes, and the separation that follows.

use nalgebra::{Vector3, vector};
use proptest::prelude::*;
use tautline_audit::Status;
use tautline_audit::recorded::{Interpolation, Outcome, PlanComparison, PlanFindings, Settings, TrackAuditor, audit};
use tautline_core::track::{Item, Piece, Sample};

fn sample(vehicle: usize, time_s: f64, position_m: Vector3<f64>) -> Item {
    Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None })
}

fn piece(vehicle: usize, from_s: f64, to_s: f64, coefficients: Vec<Vector3<f64>>) -> Item {
    Item::Piece(Piece { vehicle, from_s, to_s, coefficients })
}

fn names(count: usize) -> Vec<String> {
    (0..count).map(|k| format!("cf{k}")).collect()
}

/// Audits a flight that is compared with a plan.
fn audit_flight(names: &[String], items: &[Item], settings: &Settings) -> Outcome {
    let mut auditor = TrackAuditor::new(settings.clone()).expect("settings").with_plan();
    auditor.push(names, items).expect("judged");
    auditor.finish().expect("judged")
}

fn in_order(mut items: Vec<Item>) -> Vec<Item> {
    items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    items
}

fn compare(
    settings: &Settings,
    flight: &[Item],
    plan: &[Item],
    delay_s: Option<f64>,
    tube_m: Option<f64>,
) -> PlanFindings {
    let count = flight.iter().map(Item::vehicle).max().map_or(0, |most| most + 1);
    let outcome = audit_flight(&names(count), flight, settings);
    let mut comparison = PlanComparison::new(settings, &outcome);
    comparison.push_plan(&names(count), plan.to_vec());
    comparison.push_flight(flight).expect("valid items");
    comparison.finish(0.0, delay_s, tube_m).expect("compared")
}

/// Returns a straight plan at 1 m/s, and a flight on it with a bump of 0.2 m between two samples.
fn bump() -> (Vec<Item>, Vec<Item>) {
    let plan = (0..4).map(f64::from).map(|t| piece(0, t, t + 1.0, vec![vector![t, 0.0, 1.0], vector![1.0, 0.0, 0.0]]));
    let bump = |t: f64| if t == 2.0 { 0.8 } else { 0.0 };
    let flight = (0..4).map(f64::from).map(|t| {
        // y = 0.8 u (1 - u) is 0 at both ends, and 0.2 in the middle.
        piece(0, t, t + 1.0, vec![vector![t, 0.0, 1.0], vector![1.0, bump(t), 0.0], vector![0.0, -bump(t), 0.0]])
    });
    (flight.collect(), plan.collect())
}

#[test]
fn a_displacement_between_agreeing_samples_is_found() {
    let (flight, plan) = bump();
    let found = compare(&Settings::default(), &flight, &plan, Some(0.0), None);
    assert_eq!((found.status, found.has_curves, found.unknown.len()), (Status::Clear, true, 0));
    let [of] = &found.deviations[..] else { panic!("{found:?}") };
    assert!(of.lower_m <= 0.2 && 0.2 <= of.upper_m && of.upper_m - of.lower_m < 1e-8, "{of:?}");
    assert!((of.at_s - 2.5).abs() < 1e-3 && of.rms_m < 1e-12, "the samples agree: {of:?}");
    // Negative twin: the samples of the same flight hide it.
    let samples: Vec<_> = (0..5).map(f64::from).map(|t| sample(0, t, vector![t, 0.0, 1.0])).collect();
    let hidden = compare(&Settings::default(), &samples, &plan, Some(0.0), None);
    assert!(hidden.deviations[0].upper_m < 1e-12, "{hidden:?}");
}

#[test]
fn a_tube_is_kept_left_or_undecided() {
    let (flight, plan) = bump();
    let status = |tube_m| compare(&Settings::default(), &flight, &plan, Some(0.0), Some(tube_m)).status;
    assert_eq!((status(0.25), status(0.15)), (Status::Clear, Status::Violation));
    // Samples 1 s apart under 0.8 m/s^2: any path within 0.1 m of the line.
    let samples: Vec<_> = (0..5).map(f64::from).map(|t| sample(0, t, vector![t, 0.0, 1.0])).collect();
    let bounded = Settings { motion: Some(Interpolation::Bounded), max_accel_m_s2: Some(0.8), ..Settings::default() };
    let found = compare(&bounded, &samples, &plan, Some(0.0), Some(0.05));
    assert_eq!(found.status, Status::Undecided);
    let of = &found.deviations[0];
    assert!(of.upper_m >= 0.1 && of.upper_m < 0.1 + 1e-8 && of.lower_m < 1e-12, "{of:?}");
    assert_eq!(compare(&bounded, &samples, &plan, Some(0.0), Some(0.11)).status, Status::Clear);
}

/// Position on a smooth closed path.
fn path(t: f64) -> Vector3<f64> {
    let t = t.clamp(0.0, 8.0);
    let u = t / 8.0;
    vector![4.0 * u * u * (3.0 - 2.0 * u), 3.0 * u * (1.0 - u) * (1.0 - 2.0 * u), 1.0 + u]
}

/// Returns the path in cubic pieces of 8 s: its power coefficients.
fn path_plan(vehicle: usize, shift: Vector3<f64>) -> Item {
    let u = 1.0 / 8.0;
    let c = vec![
        vector![0.0, 0.0, 1.0] + shift,
        vector![0.0, 3.0, 1.0] * u,
        vector![12.0, -9.0, 0.0] * (u * u),
        vector![-8.0, 6.0, 0.0] * (u * u * u),
    ];
    piece(vehicle, 0.0, 8.0, c)
}

fn late_flight(delay_s: f64) -> Vec<Item> {
    (0..200).map(|k| f64::from(k) * 0.05).map(|t| sample(0, t, path(t - delay_s))).collect()
}

#[test]
fn a_delay_is_estimated_and_a_wrong_one_is_found() {
    for delay_s in [-0.4, 0.0, 0.3172, 1.9] {
        let flight = late_flight(delay_s);
        let plan = [path_plan(0, Vector3::zeros())];
        let found = compare(&Settings::default(), &flight, &plan, None, None);
        assert!((found.delay_s - delay_s).abs() < 2e-3, "{} {delay_s}", found.delay_s);
        assert_eq!(found.searched_s, Some((-60.0, 60.0)));
        assert!(found.deviations[0].upper_m < 1e-2, "{:?}", found.deviations[0].upper_m);
        // Negative twin: half a second off is decimetres off.
        let wrong = compare(&Settings::default(), &flight, &plan, Some(delay_s + 0.5), Some(0.1));
        assert!(wrong.deviations[0].lower_m > 0.2 && wrong.status == Status::Violation, "{wrong:?}");
        assert_eq!(wrong.searched_s, None);
    }
    let again = || compare(&Settings::default(), &late_flight(0.3), &[path_plan(0, Vector3::zeros())], None, None);
    assert_eq!(again().delay_s.to_bits(), again().delay_s.to_bits());
}

#[test]
fn times_of_one_alone_are_unknown() {
    let flight: Vec<_> = (0..=100).map(|k| f64::from(k) * 0.1).map(|t| sample(0, t, path(t))).collect();
    let plan = [path_plan(0, Vector3::zeros())];
    let found = compare(&Settings::default(), &flight, &plan, Some(0.0), Some(1.0));
    assert_eq!(found.status, Status::Undecided);
    let [of] = found.unknown[..] else { panic!("{:?}", found.unknown) };
    assert_eq!((of.from_s, of.to_s, of.is_flown), (8.0, 10.0, true));
    // Within a window that both cover, everything is known. A flown end without a plan counts, however short.
    for (to_s, status) in [(8.0, Status::Clear), (8.05, Status::Undecided)] {
        let window = Settings { until_s: Some(to_s), ..Settings::default() };
        assert_eq!(compare(&window, &flight, &plan, Some(0.0), Some(1.0)).status, status, "{to_s}");
    }
    // A planned end without samples does not count if it is shorter than an interval.
    for (last, status) in [(80, Status::Clear), (79, Status::Undecided)] {
        let window = Settings { from_s: Some(0.05), ..Settings::default() };
        let found = compare(&window, &flight[..=last], &plan, Some(0.05), Some(1.0));
        assert_eq!(found.status, status, "{last} {:?}", found.unknown);
    }
    // A gap in the flight.
    let gappy: Vec<_> = flight.iter().filter(|item| !(2.05..3.95).contains(&item.time_s())).cloned().collect();
    let window = Settings { until_s: Some(8.0), ..Settings::default() };
    let found = compare(&window, &gappy, &plan, Some(0.0), Some(1.0));
    let [of] = found.unknown[..] else { panic!("{:?}", found.unknown) };
    assert!(!of.is_flown && (of.from_s - 2.0).abs() < 1e-9 && (of.to_s - 4.0).abs() < 1e-9, "{of:?}");
    assert_eq!(found.status, Status::Undecided);
    assert!(found.deviations[0].series.iter().any(|point| point.1.is_nan()), "the line of the figure breaks");
    // A window without the plan.
    let late = Settings { from_s: Some(9.0), ..Settings::default() };
    let found = compare(&late, &flight, &plan, Some(0.0), None);
    assert_eq!((found.status, found.deviations.len()), (Status::Undecided, 0));
}

/// Samples of two vehicles 5 m apart on the closed path, later by a delay, within a time of each \[s\].
fn two_flights(delay_s: f64, spans_s: [(f64, f64); 2]) -> Vec<Item> {
    let all = (-40..=240).map(|k| f64::from(k) * 0.05);
    let of = |vehicle: usize, t: f64| sample(vehicle, t, path(t - delay_s) + vector![0.0, 5.0, 0.0] * vehicle as f64);
    let is_in = |(from_s, to_s): (f64, f64), t: f64| t > from_s - 1e-9 && t < to_s + 1e-9;
    all.flat_map(|t| (0..2).filter(move |k| is_in(spans_s[*k], t)).map(move |k| of(k, t))).collect()
}

#[test]
fn an_estimated_delay_hides_no_vehicle_that_vanishes() {
    let plan = [path_plan(0, Vector3::zeros()), path_plan(1, vector![0.0, 5.0, 0.0])];
    let judged =
        |delay_s, spans_s| compare(&Settings::default(), &two_flights(delay_s, spans_s), &plan, None, Some(0.1));
    let all = (0.0, 8.0);
    for (delay_s, spans_s, expected) in [
        // The delay alone moves the ends of the plan.
        (0.0, [all; 2], Status::Clear),
        (1.0, [all; 2], Status::Clear),
        (-1.0, [all; 2], Status::Clear),
        // Vehicles are sampled at different instants.
        (1.0, [(0.05, 7.95), all], Status::Clear),
        // One vehicle ends earlier, or starts later, while its plan goes on.
        (0.0, [(0.0, 5.0), all], Status::Undecided),
        (1.0, [(0.0, 7.5), all], Status::Undecided),
        (1.0, [(1.5, 8.0), all], Status::Undecided),
        (-1.0, [all, (0.5, 8.0)], Status::Undecided),
        // The whole flight ends earlier, or starts later, than the delay explains.
        (0.0, [(0.0, 5.0); 2], Status::Undecided),
        (1.0, [(0.0, 6.0); 2], Status::Undecided),
        (0.5, [(2.0, 8.5); 2], Status::Undecided),
    ] {
        let found = judged(delay_s, spans_s);
        assert!((found.delay_s - delay_s).abs() < 0.01, "{delay_s} {}", found.delay_s);
        assert_eq!(found.status, expected, "{delay_s} {spans_s:?} {:?} {:?}", found.common_s, found.unknown);
        assert_eq!(found.unknown.is_empty(), expected == Status::Clear);
    }
    // The unknown time is that of the vehicle within the common time.
    let found = judged(1.0, [(0.0, 7.5), all]);
    let [of] = found.unknown[..] else { panic!("{:?}", found.unknown) };
    assert!((of.vehicle, of.is_flown) == (0, false) && (of.from_s - 7.5).abs() < 1e-9 && of.to_s == 8.0, "{of:?}");
    // Without its plan, a vehicle may leave early; beyond its plan, it is unknown.
    let short = [piece(0, 0.0, 4.0, vec![vector![0.0, 0.0, 1.0], vector![1.0, 0.0, 0.0]]), plan[1].clone()];
    let straight = (0..=80).map(|k| f64::from(k) * 0.05).map(|t| sample(0, t + 1.0, vector![t, 0.0, 1.0]));
    let others = two_flights(1.0, [(9.0, 9.0), (0.0, 8.0)]).into_iter().filter(|item| item.vehicle() == 1);
    let early: Vec<_> = straight.chain(others).collect();
    for (until_s, status) in [(0.0, Status::Clear), (2.0, Status::Undecided)] {
        let stays = sample(0, 5.0 + until_s, vector![4.0, 0.0, 1.0]);
        let flight = in_order(early.iter().cloned().chain((until_s > 0.0).then_some(stays)).collect());
        let settings = Settings { max_gap_s: Some(5.0), ..Settings::default() };
        let found = compare(&settings, &flight, &short, None, Some(0.1));
        assert_eq!(found.status, status, "{until_s} {:?} {:?}", found.common_s, found.unknown);
    }
}

/// Two vehicles on parallel paths this far apart, each flown 0.2 m to the side of its plan.
fn parallel(apart: f64) -> (Vec<Item>, Vec<Item>) {
    let aside = [Vector3::zeros(), vector![0.0, apart, 0.0]];
    let plan = (0..2).map(|k| path_plan(k, aside[k])).collect();
    let off = vector![0.0, 0.2, 0.0];
    let at = |k: usize, t: f64| sample(k, t, path(t) + aside[k] + if k == 0 { off } else { -off });
    let flight = (0..=160).map(|k| f64::from(k) * 0.05).flat_map(|t| [at(0, t), at(1, t)]);
    (flight.collect(), plan)
}

#[test]
fn a_plan_certifies_only_with_the_distances_of_both_vehicles() {
    let (flight, plan) = parallel(1.41);
    let status = |delta_m: f64, tube_m: Option<f64>| {
        let settings = Settings::delta(delta_m);
        let found = compare(&settings, &flight, &plan, Some(0.0), tube_m);
        let asked = found.settings_of_plan(&settings, &names(2), found.delay_s)?;
        Some(audit(&names(2), &plan, asked).expect("judged").status)
    };
    // The flight keeps 1.01 m, the plan 1.41 m, and each vehicle is 0.2 m off, less than 1 mm more between samples.
    assert_eq!(status(1.0, None), Some(Status::Clear));
    assert_eq!(status(1.02, None), Some(Status::Violation), "1.42 m are needed");
    assert_eq!(status(1.0, Some(0.204)), Some(Status::Clear));
    assert_eq!(status(1.0, Some(0.21)), Some(Status::Violation), "1.42 m are needed");
    assert_eq!(status(1.0, Some(0.1)), None, "the vehicles left the tube");
    // Radii count as well: 0.55 + 0.55 and both distances.
    let radii = Settings { radius_m: Some(0.55), ..Settings::delta(1.0) };
    let found = compare(&radii, &flight, &plan, Some(0.0), None);
    let asked = found.settings_of_plan(&radii, &names(2), 0.0).expect("asked");
    assert_eq!(audit(&names(2), &plan, asked).expect("judged").status, Status::Violation);
    let scaled = Settings { ellipsoid_m: Some(vector![1.0, 1.0, 2.0]), ..Settings::default() };
    assert!(compare(&scaled, &flight, &plan, Some(0.0), None).settings_of_plan(&scaled, &names(2), 0.0).is_none());
}

#[test]
fn without_a_limit_only_the_plan_is_judged() {
    let (flight, _) = parallel(0.5);
    let outcome = audit_flight(&names(2), &flight, &Settings::default());
    assert_eq!((outcome.status, outcome.separation), (Status::Clear, None));
    assert!(audit(&names(2), &flight, Settings::default()).is_err(), "nothing is asked");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn distances_agree_with_dense_samples(
        numbers in prop::collection::vec(prop::array::uniform3(-2.0..2.0), 14),
        samples in prop::collection::vec(prop::array::uniform3(-2.0..2.0), 4),
        is_curve in any::<bool>(),
    ) {
        let vectors: Vec<_> = numbers.into_iter().map(Vector3::from).collect();
        let plan = [piece(0, 0.0, 1.5, vectors[..4].to_vec()), piece(0, 1.5, 3.0, vectors[4..10].to_vec())];
        let times = [0.0, 1.0, 2.0, 3.0];
        let flight: Vec<_> = if is_curve {
            vec![piece(0, 0.0, 3.0, vectors[10..].to_vec())]
        } else {
            times.into_iter().zip(&samples).map(|(t, at)| sample(0, t, (*at).into())).collect()
        };
        let found = compare(&Settings::default(), &in_order(flight.clone()), &plan, Some(0.0), None);
        let value = |c: &[Vector3<f64>], t: f64| c.iter().rev().fold(Vector3::zeros(), |sum, c| sum * t + c);
        let planned = |t: f64| if t < 1.5 { value(&vectors[..4], t) } else { value(&vectors[4..10], t - 1.5) };
        let flown = |t: f64| {
            if is_curve {
                return value(&vectors[10..], t);
            }
            let k = [1.0, 2.0].iter().filter(|start| t >= **start).count();
            Vector3::from(samples[k]).lerp(&samples[k + 1].into(), t - times[k])
        };
        let dense = (0..3000).map(|k| f64::from(k) * 1e-3).map(|t| (flown(t) - planned(t)).norm()).fold(0.0, f64::max);
        let of = &found.deviations[0];
        prop_assert!(of.upper_m >= dense, "{} {dense}", of.upper_m);
        prop_assert!(of.lower_m >= dense - 1e-9 && of.lower_m <= of.upper_m, "{of:?} {dense}");
        prop_assert!(of.upper_m - of.lower_m < 1e-7 * (1.0 + of.upper_m), "{} {}", of.upper_m, of.lower_m);
    }
}
