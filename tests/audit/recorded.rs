//! What the judge of recordings claims, each with the case in which it must say the opposite.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;
use proptest::prelude::*;
use tautline::audit::recorded::{
    Approach, Motion, ObjectPair, Outcome, RecordedError, Settings, TrackAuditor, VehicleSettings, WIDTH_M, audit,
};
use tautline::audit::{Obstacle, Shape, Status};
use tautline::track::{Item, Piece, Sample};

/// Rounding of a handful of operations on numbers around ten.
const ROUNDING: f64 = 1e-13;

pub(crate) fn seen(vehicle: usize, time_s: f64, at: [f64; 3]) -> Item {
    Item::Sample(Sample { vehicle, time_s, position_m: at.into(), velocity_m_s: None, radius_m: None })
}

pub(crate) fn names(count: usize) -> Vec<String> {
    ["alpha", "bravo", "charlie", "delta"].iter().take(count).map(ToString::to_string).collect()
}

pub(crate) fn asked(items: &[Item], settings: Settings) -> Outcome {
    let count = items.iter().map(|item| item.vehicle() + 1).max().unwrap_or(0);
    audit(&names(count), items, settings).expect("it can be judged")
}

fn status(items: &[Item], settings: Settings) -> Status {
    asked(items, settings).status
}

/// Two vehicles pass each other within a second, `miss_m` apart in the middle and far apart in every sample.
pub(crate) fn pass(miss_m: f64) -> Vec<Item> {
    vec![
        seen(0, 0.0, [-5.0, 0.0, 0.0]),
        seen(1, 0.0, [5.0, miss_m, 0.0]),
        seen(0, 1.0, [5.0, 0.0, 0.0]),
        seen(1, 1.0, [-5.0, miss_m, 0.0]),
    ]
}

fn of(settings: &[(&str, VehicleSettings)]) -> BTreeMap<String, VehicleSettings> {
    settings.iter().map(|(name, settings)| ((*name).to_owned(), *settings)).collect()
}

#[test]
fn what_happens_between_samples_is_judged_and_equality_is_no_violation() {
    assert_eq!(status(&pass(1.0), Settings::delta(2.0)), Status::Violation);
    assert_eq!(status(&pass(3.0), Settings::delta(2.0)), Status::Clear);
    assert_eq!(status(&pass(2.0), Settings::delta(2.0)), Status::Clear);
    assert_eq!(status(&pass(2.0_f64.next_down()), Settings::delta(2.0)), Status::Violation);
    let found = asked(&pass(1.0), Settings::delta(2.0)).violations[0];
    let half_s = 3_f64.sqrt() / 20.0;
    assert!((found.from_s - (0.5 - half_s)).abs() < ROUNDING && (found.to_s - (0.5 + half_s)).abs() < ROUNDING);
    assert_eq!((found.min_m, found.min_at_s), (1.0, 0.5));
}

#[test]
fn the_first_instant_and_a_single_sample_are_judged() {
    let once = |apart_m: f64| vec![seen(0, 0.0, [0.0; 3]), seen(1, 0.0, [apart_m, 0.0, 0.0])];
    assert_eq!(status(&once(1.0), Settings::delta(2.0)), Status::Violation);
    assert_eq!(status(&once(3.0), Settings::delta(2.0)), Status::Clear);
    // Seen once, in the way of one that flies.
    let in_the_way = |time_s| {
        let mut items = pass(9.0);
        items.push(seen(2, time_s, [0.0; 3]));
        items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        items
    };
    assert_eq!(status(&in_the_way(0.5), Settings::delta(2.0)), Status::Violation);
    assert_eq!(status(&in_the_way(0.1), Settings::delta(2.0)), Status::Clear);
    // Apart from then on, too close at the start alone.
    let mut parting = once(1.0);
    parting.extend([seen(0, 1.0, [-5.0, 0.0, 0.0]), seen(1, 1.0, [5.0, 0.0, 0.0])]);
    assert_eq!(asked(&parting, Settings::delta(2.0)).violations[0].from_s, 0.0);
}

#[test]
fn nothing_to_judge_is_undecided() {
    assert_eq!(audit(&[], &[], Settings::delta(1.0)).unwrap().status, Status::Undecided);
    assert_eq!(status(&[seen(0, 0.0, [0.0; 3])], Settings::delta(1.0)), Status::Undecided, "a vehicle alone");
    // Two that were never there together; an instant together is enough.
    let after = |second_s| [seen(0, 0.0, [0.0; 3]), seen(1, second_s, [9.0, 0.0, 0.0])];
    assert_eq!(status(&after(1.0), Settings::delta(1.0)), Status::Undecided);
    assert_eq!(status(&after(0.0), Settings::delta(1.0)), Status::Clear);
    let elsewhere = Settings { from_s: Some(5.0), ..Settings::delta(1.0) };
    assert_eq!(status(&pass(3.0), elsewhere), Status::Undecided);
}

#[test]
fn a_held_vehicle_is_where_it_was_and_its_jump_is_swept() {
    // Bravo stands beside the way of alpha's jump, and alpha is far from it in every sample.
    let items = |aside_m: f64| {
        let mut items = vec![seen(0, 0.0, [-5.0, 0.0, 0.0]), seen(0, 1.0, [5.0, 0.0, 0.0])];
        items.extend([seen(1, 0.0, [0.0, aside_m, 0.0]), seen(1, 1.0, [0.0, aside_m, 0.0])]);
        items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        items
    };
    let held = Settings { motion: Some(Motion::Hold), ..Settings::delta(2.0) };
    let found = asked(&items(1.0), held.clone());
    assert_eq!((found.status, found.violations[0].from_s, found.violations[0].to_s), (Status::Violation, 1.0, 1.0));
    assert_eq!(status(&items(3.0), held.clone()), Status::Clear);
    // Charlie crosses where alpha still stands, though not where a straight flight would be.
    let mut crossing = vec![seen(0, 0.0, [0.0; 3]), seen(1, 0.0, [6.0, 6.0, 0.0])];
    crossing.extend([seen(1, 0.5, [6.0, 0.0, 0.0]), seen(1, 0.9, [1.0, 0.0, 0.0]), seen(0, 1.0, [0.0, 60.0, 0.0])]);
    let patient = |motion| Settings { motion: Some(motion), max_gap_s: Some(9.0), ..Settings::delta(2.0) };
    assert_eq!(status(&crossing, patient(Motion::Hold)), Status::Violation);
    assert_eq!(status(&crossing, patient(Motion::Linear)), Status::Clear);
}

/// A product of two polynomials.
fn times(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            product[i + j] += x * y;
        }
    }
    product
}

/// A polynomial in t as one in t - shift.
fn about(c: &[f64], shift: f64) -> Vec<f64> {
    let powers = |n: usize| (0..n).fold(vec![1.0], |power, _| times(&power, &[shift, 1.0]));
    let mut moved = vec![0.0; c.len()];
    for (k, c) in c.iter().enumerate() {
        for (j, p) in powers(k).iter().enumerate() {
            moved[j] += c * p;
        }
    }
    moved
}

/// Two vehicles on curves of degree 7 over 4 s, whose distance is smallest, `miss_m`, at 1.7 s, and that known without a
/// search: bravo flies like alpha, plus (t - 1.7) (1 + t^2 / 4)^3 along x and the miss along y. Each is cut into pieces at
/// times of its own.
fn curves(miss_m: f64) -> Vec<Item> {
    let own = [
        [0.3, -0.8, 0.5, 0.1, -0.06, 0.01, 0.002, -0.0004],
        [1.0, 0.4, -0.3, 0.08, 0.02, -0.008, 0.0007, 0.0001],
        [1.5, 0.1, 0.2, -0.05, 0.0, 0.003, -0.0006, 0.00003],
    ];
    let grows = [1.0, 0.0, 0.25];
    let apart = times(&[-1.7, 1.0], &times(&grows, &times(&grows, &grows)));
    let mut other = own;
    for (c, extra) in other[0].iter_mut().zip(&apart) {
        *c += extra;
    }
    other[1][0] += miss_m;
    let pieces = |vehicle: usize, axes: [[f64; 8]; 3], cuts: &[f64]| {
        cuts.windows(2)
            .map(|ends| {
                let [x, y, z] = axes.map(|axis| about(&axis, ends[0]));
                let coefficients = (0..8).map(|k| Vector3::new(x[k], y[k], z[k])).collect();
                Item::Piece(Piece { vehicle, from_s: ends[0], to_s: ends[1], coefficients })
            })
            .collect::<Vec<_>>()
    };
    let mut items = pieces(0, own, &[0.0, 1.0, 2.5, 4.0]);
    items.extend(pieces(1, other, &[0.0, 1.625, 3.0, 4.0]));
    items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    items
}

/// The same flight as samples, so many a second.
fn sampled(curves: &[Item], rate_hz: u32, with_velocity: bool) -> Vec<Item> {
    let mut items = Vec::new();
    for k in 0..=4 * rate_hz {
        let time_s = f64::from(k) / f64::from(rate_hz);
        for vehicle in 0..2 {
            let piece = curves.iter().rev().find_map(|item| match item {
                Item::Piece(piece) if piece.vehicle == vehicle && piece.from_s <= time_s => Some(piece),
                _ => None,
            });
            let piece = piece.expect("there from the start");
            let t = time_s - piece.from_s;
            let position_m = piece.coefficients.iter().rev().fold(Vector3::zeros(), |sum, c| sum * t + c);
            let slope = piece.coefficients.iter().enumerate().skip(1).rev();
            let velocity = slope.fold(Vector3::zeros(), |sum, (k, c)| sum * t + c * k as f64);
            let velocity_m_s = with_velocity.then_some(velocity);
            items.push(Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s, radius_m: None }));
        }
    }
    items
}

#[test]
fn the_minimum_on_curves_is_enclosed_and_not_sampled() {
    for miss_m in [0.0, 0.25, 0.610_765, 3.0] {
        let outcome = asked(&curves(miss_m), Settings::delta(0.5));
        let closest = outcome.closest[0];
        // The pieces are expanded about other times than the curve was made at, which rounds.
        assert!(closest.lower_m <= miss_m + ROUNDING && miss_m <= closest.upper_m + ROUNDING, "{closest:?}");
        assert!(closest.upper_m - closest.lower_m < 2.0 * WIDTH_M, "{closest:?}");
        assert!((closest.time_s - 1.7).abs() < 1e-4, "{closest:?}");
        assert_eq!(outcome.status, if miss_m < 0.5 { Status::Violation } else { Status::Clear });
        assert_eq!(outcome.parry.disagreements, 0);
    }
    // A curve is not its samples, which look better.
    let samples =
        asked(&sampled(&curves(0.25), 10, false), Settings { motion: Some(Motion::Hold), ..Settings::delta(0.2) });
    assert_eq!(samples.status, Status::Clear);
    let near = asked(&curves(0.25), Settings::delta(0.25 - 2.0 * WIDTH_M)).status;
    let beyond = asked(&curves(0.25), Settings::delta(0.25 + 2.0 * WIDTH_M)).status;
    assert_eq!((near, beyond), (Status::Clear, Status::Violation));
}

#[test]
fn the_time_below_delta_on_curves_ends_where_delta_is_reached() {
    let outcome = asked(&curves(0.25), Settings::delta(0.5));
    let [found] = outcome.violations[..] else { panic!("{outcome:?}") };
    for time_s in [found.from_s, found.to_s] {
        let x = (time_s - 1.7) * (1.0 + time_s * time_s / 4.0).powi(3);
        assert!((x.hypot(0.25) - 0.5).abs() < 1e-7, "{found:?}");
    }
    assert!(found.from_s < 1.7 && found.to_s > 1.7);
}

fn bounded(delta_m: f64, max_accel_m_s2: f64) -> Settings {
    Settings { motion: Some(Motion::Bounded), max_accel_m_s2: Some(max_accel_m_s2), ..Settings::delta(delta_m) }
}

#[test]
fn bounded_motion_is_at_least_the_sweep_less_what_acceleration_allows() {
    let (accel, h) = (0.8, 1.0);
    let slack_m = 2.0 * accel * h * h / 8.0;
    let outcome = asked(&pass(3.0), bounded(2.0, accel));
    assert!((outcome.closest[0].lower_m - (3.0 - slack_m)).abs() < ROUNDING);
    assert!((outcome.closest[0].upper_m - (3.0 + slack_m)).abs() < ROUNDING);
    assert_eq!(status(&pass(3.0), bounded(3.0 - slack_m - 1e-9, accel)), Status::Clear);
    let outcome = asked(&pass(3.0), bounded(3.0 - slack_m + 1e-9, accel));
    assert_eq!(outcome.status, Status::Undecided);
    // Where the drawn motion is below by more than any deviation, it is a violation; at a sample, always.
    assert_eq!(status(&pass(3.0), bounded(3.0 + slack_m - 1e-9, accel)), Status::Undecided);
    assert_eq!(status(&pass(3.0), bounded(3.0 + slack_m + 1e-9, accel)), Status::Violation);
    let sampled = [seen(0, 0.0, [0.0; 3]), seen(1, 0.0, [1.0, 0.0, 0.0])];
    assert_eq!(status(&sampled, bounded(1.5, 1e6)), Status::Violation);
}

#[test]
fn the_rate_that_is_said_to_decide_does() {
    let straight = |rates_hz: [f64; 2]| {
        let mut items = Vec::new();
        for (vehicle, rate_hz) in rates_hz.into_iter().enumerate() {
            let steps = rate_hz.ceil();
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a small whole number")]
            for k in 0..=(steps as u32) {
                let u = f64::from(k) / steps;
                items.push(seen(vehicle, u, [(10.0 * u - 5.0) * [1.0, -1.0][vehicle], 3.0 * vehicle as f64, 0.0]));
            }
        }
        items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        items
    };
    let both = |accels: [f64; 2]| {
        let settings = |accel| VehicleSettings { max_accel_m_s2: Some(accel), ..VehicleSettings::default() };
        let vehicles = of(&[("alpha", settings(accels[0])), ("bravo", settings(accels[1]))]);
        Settings { motion: Some(Motion::Bounded), vehicles, max_gap_s: Some(1.0), ..Settings::delta(2.9) }
    };
    // The same rate and acceleration of both, and a slow one beside a quick one that is seen often.
    for (rates_hz, accels) in [([1.0, 1.0], [4.0, 4.0]), ([1.0, 10.0], [8.0, 400.0])] {
        let settings = both(accels);
        let outcome = asked(&straight(rates_hz), settings.clone());
        assert_eq!(outcome.status, Status::Undecided);
        let rate_hz = outcome.undecided[0].rate_hz.expect("a rate decides");
        assert!((rate_hz - ((accels[0] + accels[1]) / 8.0 / 0.1).sqrt()).abs() < 1e-9, "{rate_hz}");
        assert_eq!(status(&straight([rate_hz; 2]), settings.clone()), Status::Clear);
        assert_eq!(status(&straight([0.7 * rate_hz; 2]), settings), Status::Undecided);
    }
}

#[test]
fn velocities_sharpen_the_bound() {
    let curve = curves(0.6);
    let accel = 700.0;
    let rough = asked(&sampled(&curve, 50, false), bounded(0.1, accel)).closest[0];
    let sharp = asked(&sampled(&curve, 50, true), bounded(0.1, accel)).closest[0];
    for found in [rough, sharp] {
        assert!(found.lower_m <= 0.6 && 0.6 <= found.upper_m, "{found:?}");
    }
    // Half of the deviation: A h^2 / 16 and not A h^2 / 8, for two vehicles.
    let h = 0.02;
    assert!((0.6 - rough.lower_m - accel * h * h / 4.0).abs() < 0.01, "{rough:?}");
    assert!((0.6 - sharp.lower_m - accel * h * h / 8.0).abs() < 0.01, "{sharp:?}");
}

#[test]
fn a_bound_that_the_recording_contradicts_proves_nothing() {
    // Alpha turns back at 1 s: 2 m/s of difference within 1 s.
    let mut items = vec![seen(0, 0.0, [0.0; 3]), seen(0, 1.0, [1.0, 0.0, 0.0]), seen(0, 2.0, [0.0; 3])];
    items.extend([seen(1, 0.0, [50.0, 0.0, 0.0]), seen(1, 1.0, [50.0, 0.0, 0.0]), seen(1, 2.0, [50.0, 0.0, 0.0])]);
    items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    let outcome = asked(&items, bounded(2.0, 1.5));
    let contradiction = outcome.contradiction.expect("seen");
    assert_eq!(outcome.status, Status::Undecided);
    assert_eq!((contradiction.vehicle, contradiction.assumed_m_s2), (0, 1.5));
    assert!((contradiction.needs_m_s2 - 2.0).abs() < ROUNDING);
    assert_eq!(status(&items, bounded(2.0, 2.0)), Status::Clear);
}

#[test]
fn pairs_on_the_ground_are_left_out_until_one_of_them_leaves_it() {
    let items = |climbs_m: f64| {
        let mut items = vec![seen(0, 0.0, [0.0; 3]), seen(1, 0.0, [1.0, 0.0, 0.0])];
        items.extend([seen(0, 2.0, [0.0, 0.0, climbs_m]), seen(1, 2.0, [1.0, 0.0, 0.0])]);
        items
    };
    let above = Settings { above_m: Some(0.25), ..Settings::delta(1.5) };
    assert_eq!(status(&items(1.0), Settings::delta(1.5)), Status::Violation);
    assert_eq!(status(&items(0.2), above.clone()), Status::Undecided, "nothing was judged");
    let mut seen_from_above = items(0.2);
    seen_from_above.extend([2.0, 3.0].map(|time_s| seen(2, time_s, [0.0, 0.0, 9.0])));
    assert_eq!(status(&seen_from_above, above.clone()), Status::Clear);
    let outcome = asked(&items(1.0), above.clone());
    assert_eq!(outcome.violations[0].from_s, 0.5, "{outcome:?}");
    assert!((outcome.closest[0].lower_m - 1.0_f64.hypot(0.25)).abs() < ROUNDING);
    // On curves, and under a bound, which may leave the ground sooner.
    let bounded = Settings { motion: Some(Motion::Bounded), max_accel_m_s2: Some(0.01), ..above };
    assert!(asked(&items(1.0), bounded).violations[0].from_s < 0.5);
}

#[test]
fn one_who_begins_to_climb_at_the_instant_another_ends_was_on_the_ground_with_it() {
    let items = |height_m: f64| {
        [
            seen(0, 0.0, [0.0, 0.0, height_m]),
            seen(1, 0.0, [0.3, 0.0, 0.0]),
            seen(0, 1.0, [0.0, 0.0, height_m]),
            seen(1, 1.0, [0.3, 0.0, 0.0]),
            seen(1, 2.0, [0.3, 0.0, 4.0]),
        ]
    };
    for (above_m, motion) in [(0.0, Motion::Linear), (0.0, Motion::Hold), (0.1, Motion::Linear)] {
        let settings = Settings { above_m: Some(above_m), motion: Some(motion), ..Settings::delta(1.0) };
        let outcome = asked(&items(above_m), settings.clone());
        assert_eq!(outcome.violations, [], "{above_m} {motion:?}");
        assert_eq!(status(&items(above_m + 0.01), settings), Status::Violation, "{above_m} {motion:?}");
    }
}

#[test]
fn no_interval_is_too_short_to_be_judged() {
    let items = |step_s: f64| {
        let b = |k: i32, x| seen(1, f64::from(k) * step_s, [x, 0.0, 0.0]);
        let a = |k: i32| seen(0, f64::from(k) * step_s, [0.0; 3]);
        [a(0), b(0, 5.0), a(1), b(1, 0.1), a(2), b(2, 5.0)]
    };
    assert_eq!(status(&items(1e-60), Settings::delta(1.0)), Status::Violation);
    let bounded = Settings { motion: Some(Motion::Bounded), max_accel_m_s2: Some(1.0), ..Settings::delta(1.0) };
    assert_ne!(status(&items(1e-60), bounded), Status::Clear);
    let refused = audit(&names(2), &items(3e-310), Settings::delta(1.0));
    assert!(matches!(refused, Err(RecordedError::TimeNotIncreasing { .. })), "{refused:?}");
}

#[test]
fn a_window_clips_exactly() {
    let inside = |from_s, to_s| Settings { from_s, to_s, ..Settings::delta(2.0) };
    // Below delta from 0.5 - sqrt(3) / 20 = 0.4134 s on.
    assert_eq!(status(&pass(1.0), inside(None, Some(0.41))), Status::Clear);
    assert_eq!(status(&pass(1.0), inside(Some(0.59), None)), Status::Clear);
    let outcome = asked(&pass(1.0), inside(Some(0.25), Some(0.45)));
    let found = outcome.violations[0];
    assert_eq!((outcome.span_s, found.to_s), (Some((0.25, 0.45)), 0.45));
    assert!((found.min_m - 1.0_f64.hypot(1.0)).abs() < ROUNDING, "10 m/s of each, 0.05 s before they meet");
}

#[test]
fn a_gap_is_undecided_unless_it_is_bridged() {
    let flown = |missing: u32| {
        let mut items = Vec::new();
        for k in 0..20 {
            let time_s = 0.1 * f64::from(k);
            items.push(seen(0, time_s, [0.0, 0.0, time_s]));
            if k != missing {
                items.push(seen(1, time_s, [9.0, 0.0, time_s]));
            }
        }
        items
    };
    assert_eq!(status(&flown(99), Settings::delta(2.0)), Status::Clear);
    let outcome = asked(&flown(7), Settings::delta(2.0));
    assert_eq!((outcome.status, outcome.gaps.len(), outcome.gaps[0].vehicle), (Status::Undecided, 1, 1));
    assert!((outcome.gaps[0].from_s - 0.6).abs() < ROUNDING && (outcome.gaps[0].to_s - 0.8).abs() < ROUNDING);
    assert_eq!(status(&flown(7), Settings { max_gap_s: Some(0.25), ..Settings::delta(2.0) }), Status::Clear);
    // Late and early are no gaps.
    assert!(asked(&flown(0), Settings::delta(2.0)).gaps.is_empty());
    assert!(asked(&flown(19), Settings::delta(2.0)).gaps.is_empty());
    // Nor is one that ends before the window.
    assert_eq!(status(&flown(7), Settings { from_s: Some(1.0), ..Settings::delta(2.0) }), Status::Clear);
    // Nor is one in which nobody else is there, unless something stands in the way.
    let mut left = flown(7);
    left.retain(|item| item.vehicle() == 1 || item.time_s() < 0.55);
    let outcome = asked(&left, Settings::delta(2.0));
    assert_eq!((outcome.status, outcome.gaps.len()), (Status::Clear, 0));
    let tower = thing(Shape::Ball { radius_m: 1.0 }, [90.0, 0.0, 0.0]);
    let outcome = asked(&left, Settings { obstacles: vec![tower], ..Settings::delta(2.0) });
    assert_eq!((outcome.status, outcome.gaps.len()), (Status::Undecided, 1));
    // What would join it is told, of one that the window cuts too.
    let cut = asked(&flown(7), Settings { from_s: Some(0.75), ..Settings::delta(2.0) });
    assert!((cut.gaps[0].joined_by_s - 0.2).abs() < ROUNDING && cut.gaps[0].from_s == 0.75, "{:?}", cut.gaps);
    // A gap between curves.
    let mut curves = curves(5.0);
    curves.retain(|item| !(item.vehicle() == 0 && item.time_s() == 1.0));
    assert_eq!(asked(&curves, Settings::delta(0.1)).gaps.len(), 1);
}

#[test]
fn a_clock_that_was_off_is_set_right() {
    // Through the same place one second apart, by clocks that differ by one second.
    let through = |vehicle: usize, late_s: f64, turned: bool| {
        (0..=20).map(move |k| {
            let t = 0.2 * f64::from(k);
            let way = 5.0 * t - 10.0;
            seen(vehicle, t + late_s, if turned { [0.0, way, 0.0] } else { [way, 0.0, 0.0] })
        })
    };
    let mut items: Vec<_> = through(0, 0.0, false).chain(through(1, 1.0, true)).collect();
    items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    let set = |offset_s| Settings {
        vehicles: of(&[("bravo", VehicleSettings { offset_s, ..VehicleSettings::default() })]),
        ..Settings::delta(2.0)
    };
    assert_eq!(status(&items, Settings::delta(2.0)), Status::Clear);
    let outcome = asked(&items, set(-1.0));
    assert_eq!(outcome.status, Status::Violation);
    assert!(outcome.closest[0].lower_m < 1e-12 && (outcome.closest[0].time_s - 2.0).abs() < 1e-12);
    assert_eq!(status(&items, set(1.0)), Status::Clear);
}

#[test]
fn ellipsoids_are_judged_by_scaled_distance() {
    let stacked = |dz: f64| vec![seen(0, 0.0, [0.0; 3]), seen(1, 0.0, [0.0, 0.0, dz])];
    let beside = |dx: f64| vec![seen(0, 0.0, [0.0; 3]), seen(1, 0.0, [dx, 0.0, 0.0])];
    let downwash = Settings { ellipsoid_m: Some(Vector3::new(0.125, 0.125, 0.375)), ..Settings::default() };
    assert_eq!(status(&stacked(0.7), downwash.clone()), Status::Violation);
    assert_eq!(status(&stacked(0.75), downwash.clone()), Status::Clear);
    assert_eq!(status(&beside(0.3), downwash.clone()), Status::Clear);
    let outcome = asked(&beside(0.2), downwash.clone());
    assert_eq!(outcome.status, Status::Violation);
    assert!((outcome.closest[0].lower_m - 1.6).abs() < ROUNDING);
    assert_eq!(status(&beside(0.2), Settings { delta_m: Some(1.5), ..downwash }), Status::Clear);
}

#[test]
fn radii_and_delta_are_both_kept() {
    let apart = |distance_m: f64| vec![seen(0, 0.0, [0.0; 3]), seen(1, 0.0, [distance_m, 0.0, 0.0])];
    let radius = |radius_m| VehicleSettings { radius_m: Some(radius_m), ..VehicleSettings::default() };
    let radii = Settings { vehicles: of(&[("alpha", radius(0.5)), ("bravo", radius(1.0))]), ..Settings::default() };
    assert_eq!(status(&apart(1.4), radii.clone()), Status::Violation);
    assert_eq!(status(&apart(1.5), radii.clone()), Status::Clear);
    let both = Settings { delta_m: Some(2.0), ..radii };
    assert_eq!(status(&apart(1.6), both), Status::Violation);
    // The recording's own radii, and none at all.
    let mut own = apart(1.4);
    for item in &mut own {
        if let Item::Sample(sample) = item {
            sample.radius_m = Some(0.75);
        }
    }
    assert_eq!(status(&own, Settings::default()), Status::Violation);
    let none = audit(&names(2), &apart(1.4), Settings::default()).unwrap_err();
    assert_eq!(none, RecordedError::NoLimit { vehicle: "alpha".to_owned() });
}

pub(crate) fn thing(shape: Shape, at: [f64; 3]) -> Obstacle {
    Obstacle { name: "thing".to_owned(), shape, clearance_m: None, path: vec![(0.0, at.into())] }
}

#[test]
fn obstacles_are_kept_clear_of() {
    let flight = [seen(0, 0.0, [-5.0, 0.0, 2.0]), seen(0, 1.0, [5.0, 0.0, 2.0])];
    // A keep-out ball of delta / 2 = 0.5 m must not enter.
    let with = |obstacle: Obstacle| Settings { obstacles: vec![obstacle], ..Settings::delta(1.0) };
    let ball = Shape::Ball { radius_m: 1.0 };
    let cuboid = Shape::Box { half_m: Vector3::new(1.0, 1.0, 1.0), yaw_rad: 0.3 };
    let capsule =
        Shape::Capsule { from_m: Vector3::new(0.0, -3.0, 0.0), to_m: Vector3::new(0.0, 3.0, 0.0), radius_m: 1.0 };
    for shape in [ball, cuboid, capsule] {
        // At no clearance it may be touched and not be entered.
        for (clearance_m, z, expected) in [
            (None, 0.4, Status::Clear),
            (None, 0.5, Status::Clear),
            (None, 0.6, Status::Violation),
            (Some(0.0), 1.0, Status::Clear),
            (Some(0.0), 1.1, Status::Violation),
        ] {
            let outcome = asked(&flight, with(Obstacle { clearance_m, ..thing(shape, [0.0, 0.0, z]) }));
            assert_eq!((outcome.status, outcome.parry.disagreements), (expected, 0), "{shape:?} {z} {outcome:?}");
            assert!((outcome.obstacles[0].lower_m - (1.0 - z)).abs() < 1e-9, "{outcome:?}");
        }
    }
    let ground = |z| thing(Shape::HalfSpace { normal: Vector3::z() }, [0.0, 0.0, z]);
    assert_eq!(status(&flight, with(ground(1.5))), Status::Clear);
    assert_eq!(status(&flight, with(ground(1.6))), Status::Violation);
    let wider = Obstacle { clearance_m: Some(0.7), ..ground(1.4) };
    assert_eq!(status(&flight, with(wider)), Status::Violation);
    // One that moves: there when the vehicle passes, or long gone.
    let moving = |late_s: f64| Obstacle {
        path: vec![(late_s, Vector3::new(0.0, -10.0, 2.0)), (late_s + 1.0, Vector3::new(0.0, 10.0, 2.0))],
        ..thing(ball, [0.0; 3])
    };
    let hit = asked(&flight, with(moving(0.0)));
    assert_eq!(hit.status, Status::Violation);
    assert!(matches!(hit.violations[0].pair, ObjectPair::Obstacle { vehicle: 0, obstacle: 0 }));
    assert_eq!(status(&flight, with(moving(3.0))), Status::Clear);
    // On a curve.
    let outcome = asked(&curves(5.0), Settings { obstacles: vec![ground(-20.0)], ..Settings::delta(0.1) });
    assert_eq!((outcome.parry.disagreements, outcome.status), (0, Status::Clear));
    // Alpha begins within one box, 0.1 m deep, and never comes near the other.
    for (at, expected) in [([0.3, 1.0, 1.5], Status::Violation), ([0.3, 1.0, 9.5], Status::Clear)] {
        let cuboid = Shape::Box { half_m: Vector3::repeat(0.1), yaw_rad: 0.3 };
        let entered = with(Obstacle { clearance_m: Some(0.0), ..thing(cuboid, at) });
        let outcome = asked(&curves(5.0), entered);
        assert_eq!((outcome.parry.disagreements, outcome.status), (0, expected), "{outcome:?}");
    }
}

#[test]
fn only_those_who_are_asked_for_are_judged() {
    let mut items = pass(1.0);
    items.extend([seen(2, 0.0, [0.0, 50.0, 0.0]), seen(2, 1.0, [0.0, 50.0, 0.0])]);
    items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    let only = |names: &[&str]| Settings {
        only: Some(names.iter().map(ToString::to_string).collect::<BTreeSet<_>>()),
        ..Settings::delta(2.0)
    };
    assert_eq!(status(&items, only(&["alpha", "charlie"])), Status::Clear);
    assert_eq!(status(&items, only(&["alpha", "bravo"])), Status::Violation);
    let unknown = audit(&names(3), &items, only(&["zulu"])).unwrap_err();
    assert_eq!(unknown.to_string(), "the recording has no vehicle zulu; it has alpha, bravo, charlie");
}

#[test]
fn wrong_recordings_and_questions_are_refused_by_name() {
    let refused = |items: &[Item], settings: Settings| audit(&names(2), items, settings).unwrap_err().to_string();
    let twice = [seen(0, 1.0, [0.0; 3]), seen(0, 1.0, [1.0, 0.0, 0.0])];
    assert!(refused(&twice, Settings::delta(1.0)).contains("alpha: the time 1.0 s is not later than 1.0 s"));
    assert!(
        refused(&[seen(1, 1.0, [f64::NAN, 0.0, 0.0])], Settings::delta(1.0)).contains("bravo at 1.0 s: the position")
    );
    let back = [seen(0, 1.0, [0.0; 3]), seen(1, 0.5, [0.0; 3])];
    assert!(refused(&back, Settings::delta(1.0)).contains("comes after one at 1.0 s"));
    assert!(refused(&[seen(7, 1.0, [0.0; 3])], Settings::delta(1.0)).contains("no name for vehicle 8"));
    let with = |motion| Settings { motion: Some(motion), ..Settings::delta(1.0) };
    assert!(refused(&pass(1.0), with(Motion::Polynomial)).contains("has samples and no curve"));
    assert!(refused(&curves(1.0), with(Motion::Linear)).contains("has a curve"));
    assert!(refused(&pass(1.0), with(Motion::Bounded)).contains("needs its largest acceleration"));
    for settings in [
        Settings::delta(0.0),
        Settings::delta(f64::NAN),
        Settings { max_gap_s: Some(-1.0), ..Settings::delta(1.0) },
        Settings { from_s: Some(2.0), to_s: Some(1.0), ..Settings::delta(1.0) },
        Settings { ellipsoid_m: Some(Vector3::new(1.0, 0.0, 1.0)), ..Settings::default() },
    ] {
        assert!(TrackAuditor::new(settings.clone()).is_err(), "{settings:?}");
    }
}

#[test]
fn a_recording_in_parts_is_judged_like_the_whole() {
    let mut items = Vec::new();
    for k in 0..3000_u32 {
        let t = 0.1 * f64::from(k);
        for vehicle in 0..4_u32 {
            if (k + vehicle) % (vehicle + 1) == 0 {
                let phase = f64::from(vehicle) * 1.7 + 0.05 * t * f64::from(vehicle + 1);
                items.push(seen(vehicle as usize, t, [6.0 * phase.cos(), 6.0 * phase.sin(), 0.3 * f64::from(vehicle)]));
            }
        }
    }
    let settings = Settings { max_gap_s: Some(1.0), ..Settings::delta(2.0) };
    let whole = audit(&names(4), &items, settings.clone()).unwrap();
    let mut in_parts = TrackAuditor::new(settings).unwrap();
    for part in items.chunks(7) {
        in_parts.push(&names(4), part).unwrap();
    }
    assert_eq!(whole, in_parts.finish().unwrap());
    assert_eq!(whole.status, Status::Violation);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_input_makes_the_judge_panic(
        raw in prop::collection::vec((0_usize..4, any::<bool>(), prop::array::uniform5(prop_oneof![
            any::<f64>(), -10.0..10.0_f64, Just(0.0), Just(1e300), Just(f64::NAN)
        ])), 0..40),
        motion in 0..5_u8,
        above in prop::option::of(-5.0..5.0_f64),
        sorted in any::<bool>(),
    ) {
        let mut items: Vec<_> = raw.into_iter().map(|(vehicle, piece, [t, x, y, z, w])| {
            let position_m = Vector3::new(x, y, z);
            if piece {
                Item::Piece(Piece { vehicle, from_s: t, to_s: t + w.abs(), coefficients: vec![position_m, position_m * w] })
            } else {
                Item::Sample(Sample { vehicle, time_s: t, position_m, velocity_m_s: None, radius_m: None })
            }
        }).collect();
        if sorted {
            items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        }
        let motion = [None, Some(Motion::Linear), Some(Motion::Hold), Some(Motion::Polynomial), Some(Motion::Bounded)]
            [usize::from(motion)];
        let obstacles = vec![thing(Shape::Ball { radius_m: 1.0 }, [0.0; 3])];
        let settings =
            Settings { motion, above_m: above, max_accel_m_s2: Some(1.0), obstacles, ..Settings::delta(1.0) };
        let _ = audit(&names(4), &items, settings);
    }
}

/// A vehicle that rises by a polynomial in height, and one that stands beside it.
fn rising(z: &[f64], beside_m: f64) -> Vec<Item> {
    let piece = |vehicle, x: f64, z: &[f64]| {
        let coefficients = z.iter().enumerate().map(|(k, z)| Vector3::new(if k == 0 { x } else { 0.0 }, 0.0, *z));
        Item::Piece(Piece { vehicle, from_s: 0.0, to_s: 1.0, coefficients: coefficients.collect() })
    };
    vec![piece(0, 0.0, z), piece(1, beside_m, &[0.0])]
}

#[test]
fn a_height_that_rounding_hides_ends_as_undecided_and_not_in_a_search_without_end() {
    let above = Settings { above_m: Some(0.5), ..Settings::delta(2.0) };
    assert_eq!(status(&rising(&[0.5, 1e-18], 1.0), above.clone()), Status::Undecided);
    assert_eq!(status(&rising(&[0.5, 1e-18], 3.0), above.clone()), Status::Clear);
    // Above for certain, and on the ground for certain: of the two one must be above for a violation.
    assert_eq!(status(&rising(&[0.5, 1e-3], 1.0), above.clone()), Status::Violation);
    assert_ne!(status(&rising(&[0.4, 1e-18], 1.0), above), Status::Violation);
}

#[test]
fn a_curve_that_dips_twice_has_a_violation_for_each_with_its_own_minimum() {
    // x = 1 + 0.3 t + (t - 1)^2 (t - 3)^2 on 0..4, beside one at the origin.
    let coefficients = [10.0, -23.7, 22.0, -8.0, 1.0].map(|c| Vector3::new(c, 0.0, 0.0)).to_vec();
    let still = Item::Piece(Piece { vehicle: 0, from_s: 0.0, to_s: 4.0, coefficients: vec![Vector3::zeros()] });
    let dips = Item::Piece(Piece { vehicle: 1, from_s: 0.0, to_s: 4.0, coefficients });
    let outcome = asked(&[still, dips], Settings::delta(2.0));
    let x = |t: f64| 1.0 + 0.3 * t + ((t - 1.0) * (t - 3.0)).powi(2);
    let least = |from: f64| {
        (0..200_000).map(|k| from + 1e-5 * f64::from(k)).min_by(|a, b| x(*a).total_cmp(&x(*b))).expect("times")
    };
    assert_eq!(outcome.violations.len(), 2);
    for (violation, at_s) in outcome.violations.iter().zip([least(0.0), least(2.0)]) {
        assert!((violation.min_m - x(at_s)).abs() < 1e-6, "{violation:?}, expected {} at {at_s}", x(at_s));
        assert!((violation.min_at_s - at_s).abs() < 1e-2, "{violation:?}, expected at {at_s}");
        assert!(violation.from_s < at_s && at_s < violation.to_s && (x(violation.from_s) - 2.0).abs() < 1e-4);
    }
}

#[test]
fn a_curve_with_more_coefficients_than_can_be_judged_is_refused() {
    let rises = |count: usize| rising(&vec![1e-3; count], 9.0);
    assert_eq!(status(&rises(64), Settings::delta(1.0)), Status::Clear);
    let refused = audit(&names(2), &rises(65), Settings::delta(1.0));
    assert!(matches!(refused, Err(RecordedError::Item { .. })), "{refused:?}");
}

#[test]
fn two_that_are_far_from_the_origin_and_from_each_other_are_enclosed_without_a_search_to_its_limit() {
    // Rounding of the distance alone is above 1e-9 m, so bounds never come as near to each other.
    let curve = |vehicle, k: f64, y: f64| {
        let at = [Vector3::new(0.0, y, 0.0), Vector3::new(0.0, 0.3 * k, 0.0), Vector3::new(0.0, -0.3, 0.0)];
        Item::Piece(Piece { vehicle, from_s: k, to_s: k + 1.0, coefficients: at.to_vec() })
    };
    let pieces = (0..2000).flat_map(|k| [curve(0, f64::from(k), 0.0), curve(1, f64::from(k), 1e8)]);
    let settings = Settings { max_gap_s: Some(1.0), ..Settings::delta(1.0) };
    let outcome = asked(&pieces.collect::<Vec<_>>(), settings);
    let Approach { lower_m, upper_m, .. } = outcome.closest[0];
    assert!(outcome.status == Status::Clear && upper_m - lower_m < 1e-5, "{lower_m} {upper_m}");
}
