//! Audit of curves, and of motion under a bounded acceleration.

use nalgebra::Vector3;
use tautline_audit::Status;
use tautline_audit::recorded::{Approach, Interpolation, RecordedError, Settings, VehicleSettings, WIDTH_M, audit};
use tautline_core::track::{Item, Piece, Sample};

use super::recorded::{ROUNDING, judge, names, of, pass, seen, status};

/// Returns the product of two polynomials.
fn product_of(a: &[f64], b: &[f64]) -> Vec<f64> {
    let mut product = vec![0.0; a.len() + b.len() - 1];
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            product[i + j] += x * y;
        }
    }
    product
}

/// Turns a polynomial in t into one in t - shift.
fn expand_about(c: &[f64], shift: f64) -> Vec<f64> {
    let powers = |n: usize| (0..n).fold(vec![1.0], |power, _| product_of(&power, &[shift, 1.0]));
    let mut moved = vec![0.0; c.len()];
    for (k, c) in c.iter().enumerate() {
        for (j, p) in powers(k).iter().enumerate() {
            moved[j] += c * p;
        }
    }
    moved
}

/// Returns two vehicles on curves of degree 7 over 4 s whose smallest distance is `miss_m`, at 1.7 s. Bravo flies like
/// alpha, plus (t - 1.7) (1 + t^2 / 4)^3 along x and `miss_m` along y. The curves are cut into pieces at different
/// times.
pub(crate) fn curves(miss_m: f64) -> Vec<Item> {
    let own = [
        [0.3, -0.8, 0.5, 0.1, -0.06, 0.01, 0.002, -0.0004],
        [1.0, 0.4, -0.3, 0.08, 0.02, -0.008, 0.0007, 0.0001],
        [1.5, 0.1, 0.2, -0.05, 0.0, 0.003, -0.0006, 0.00003],
    ];
    let growth = [1.0, 0.0, 0.25];
    let apart = product_of(&[-1.7, 1.0], &product_of(&growth, &product_of(&growth, &growth)));
    let mut other = own;
    for (c, extra) in other[0].iter_mut().zip(&apart) {
        *c += extra;
    }
    other[1][0] += miss_m;
    let pieces = |vehicle: usize, axes: [[f64; 8]; 3], cuts: &[f64]| {
        cuts.windows(2)
            .map(|ends| {
                let [x, y, z] = axes.map(|axis| expand_about(&axis, ends[0]));
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

/// Returns the same flight as samples at `rate_hz`.
fn sampled(curves: &[Item], rate_hz: u32, with_velocity: bool) -> Vec<Item> {
    let mut items = Vec::new();
    for k in 0..=4 * rate_hz {
        let time_s = f64::from(k) / f64::from(rate_hz);
        for vehicle in 0..2 {
            let piece = curves.iter().rev().find_map(|item| match item {
                Item::Piece(piece) if piece.vehicle == vehicle && piece.from_s <= time_s => Some(piece),
                _ => None,
            });
            let piece = piece.expect("a piece at this time");
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
fn the_minimum_on_curves_is_enclosed() {
    for miss_m in [0.0, 0.25, 0.610_765, 3.0] {
        let outcome = judge(&curves(miss_m), Settings::delta(0.5));
        let closest = outcome.closest[0];
        // The pieces are expanded about other times than the original curve, which rounds.
        assert!(closest.lower_m <= miss_m + ROUNDING && miss_m <= closest.upper_m + ROUNDING, "{closest:?}");
        assert!(closest.upper_m - closest.lower_m < 2.0 * WIDTH_M, "{closest:?}");
        assert!((closest.time_s - 1.7).abs() < 1e-4, "{closest:?}");
        assert_eq!(outcome.status, if miss_m < 0.5 { Status::Violation } else { Status::Clear });
        assert_eq!(outcome.parry.disagreements, 0);
    }
    // The samples of the same curve miss the approach.
    let samples = judge(
        &sampled(&curves(0.25), 10, false),
        Settings { motion: Some(Interpolation::Hold), ..Settings::delta(0.2) },
    );
    assert_eq!(samples.status, Status::Clear);
    let near = judge(&curves(0.25), Settings::delta(0.25 - 2.0 * WIDTH_M)).status;
    let beyond = judge(&curves(0.25), Settings::delta(0.25 + 2.0 * WIDTH_M)).status;
    assert_eq!((near, beyond), (Status::Clear, Status::Violation));
}

#[test]
fn a_violation_on_curves_ends_where_delta_is_reached() {
    let outcome = judge(&curves(0.25), Settings::delta(0.5));
    let [found] = outcome.violations[..] else { panic!("{outcome:?}") };
    for time_s in [found.from_s, found.to_s] {
        let x = (time_s - 1.7) * (1.0 + time_s * time_s / 4.0).powi(3);
        assert!((x.hypot(0.25) - 0.5).abs() < 1e-7, "{found:?}");
    }
    assert!(found.from_s < 1.7 && found.to_s > 1.7);
}

fn bounded(delta_m: f64, max_accel_m_s2: f64) -> Settings {
    Settings { motion: Some(Interpolation::Bounded), max_accel_m_s2: Some(max_accel_m_s2), ..Settings::delta(delta_m) }
}

#[test]
fn bounded_motion_is_the_sweep_plus_or_minus_the_deviation() {
    let (accel, h) = (0.8, 1.0);
    let slack_m = 2.0 * accel * h * h / 8.0;
    let outcome = judge(&pass(3.0), bounded(2.0, accel));
    assert!((outcome.closest[0].lower_m - (3.0 - slack_m)).abs() < ROUNDING);
    assert!((outcome.closest[0].upper_m - (3.0 + slack_m)).abs() < ROUNDING);
    assert_eq!(status(&pass(3.0), bounded(3.0 - slack_m - 1e-9, accel)), Status::Clear);
    let outcome = judge(&pass(3.0), bounded(3.0 - slack_m + 1e-9, accel));
    assert_eq!(outcome.status, Status::Undecided);
    // A violation is certain if the interpolated motion is below the limit by more than the deviation, or at a sample.
    assert_eq!(status(&pass(3.0), bounded(3.0 + slack_m - 1e-9, accel)), Status::Undecided);
    assert_eq!(status(&pass(3.0), bounded(3.0 + slack_m + 1e-9, accel)), Status::Violation);
    let sampled = [seen(0, 0.0, [0.0; 3]), seen(1, 0.0, [1.0, 0.0, 0.0])];
    assert_eq!(status(&sampled, bounded(1.5, 1e6)), Status::Violation);
}

#[test]
fn samples_at_the_deciding_rate_give_a_verdict() {
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
        Settings { motion: Some(Interpolation::Bounded), vehicles, max_gap_s: Some(1.0), ..Settings::delta(2.9) }
    };
    // First equal rates and accelerations, then a slow vehicle and a fast one with a higher rate.
    for (rates_hz, accels) in [([1.0, 1.0], [4.0, 4.0]), ([1.0, 10.0], [8.0, 400.0])] {
        let settings = both(accels);
        let outcome = judge(&straight(rates_hz), settings.clone());
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
    let rough = judge(&sampled(&curve, 50, false), bounded(0.1, accel)).closest[0];
    let sharp = judge(&sampled(&curve, 50, true), bounded(0.1, accel)).closest[0];
    for found in [rough, sharp] {
        assert!(found.lower_m <= 0.6 && 0.6 <= found.upper_m, "{found:?}");
    }
    // Half of the deviation: A h^2 / 16 instead of A h^2 / 8, for two vehicles.
    let h = 0.02;
    assert!((0.6 - rough.lower_m - accel * h * h / 4.0).abs() < 0.01, "{rough:?}");
    assert!((0.6 - sharp.lower_m - accel * h * h / 8.0).abs() < 0.01, "{sharp:?}");
}

#[test]
fn a_contradicted_bound_is_undecided() {
    // Alpha turns back at 1 s: the velocity changes by 2 m/s within 1 s.
    let mut items = vec![seen(0, 0.0, [0.0; 3]), seen(0, 1.0, [1.0, 0.0, 0.0]), seen(0, 2.0, [0.0; 3])];
    items.extend([seen(1, 0.0, [50.0, 0.0, 0.0]), seen(1, 1.0, [50.0, 0.0, 0.0]), seen(1, 2.0, [50.0, 0.0, 0.0])]);
    items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    let outcome = judge(&items, bounded(2.0, 1.5));
    let contradiction = outcome.contradiction.expect("a contradiction");
    assert_eq!(outcome.status, Status::Undecided);
    assert_eq!((contradiction.vehicle, contradiction.assumed_m_s2), (0, 1.5));
    assert!((contradiction.needs_m_s2 - 2.0).abs() < ROUNDING);
    assert_eq!(status(&items, bounded(2.0, 2.0)), Status::Clear);
}

/// Returns a vehicle that rises by a polynomial, and one that stands beside it.
fn rising(z: &[f64], beside_m: f64) -> Vec<Item> {
    let piece = |vehicle, x: f64, z: &[f64]| {
        let coefficients = z.iter().enumerate().map(|(k, z)| Vector3::new(if k == 0 { x } else { 0.0 }, 0.0, *z));
        Item::Piece(Piece { vehicle, from_s: 0.0, to_s: 1.0, coefficients: coefficients.collect() })
    };
    vec![piece(0, 0.0, z), piece(1, beside_m, &[0.0])]
}

#[test]
fn a_climb_below_rounding_is_undecided() {
    let above = Settings { above_m: Some(0.5), ..Settings::delta(2.0) };
    assert_eq!(status(&rising(&[0.5, 1e-18], 1.0), above.clone()), Status::Undecided);
    assert_eq!(status(&rising(&[0.5, 1e-18], 3.0), above.clone()), Status::Clear);
    // A violation is certain only if one vehicle is certainly above the height.
    assert_eq!(status(&rising(&[0.5, 1e-3], 1.0), above.clone()), Status::Violation);
    assert_ne!(status(&rising(&[0.4, 1e-18], 1.0), above), Status::Violation);
}

#[test]
fn each_dip_of_a_curve_is_a_violation_with_its_own_minimum() {
    // x = 1 + 0.3 t + (t - 1)^2 (t - 3)^2 over 0 to 4 s, and a vehicle at the origin.
    let coefficients = [10.0, -23.7, 22.0, -8.0, 1.0].map(|c| Vector3::new(c, 0.0, 0.0)).to_vec();
    let still = Item::Piece(Piece { vehicle: 0, from_s: 0.0, to_s: 4.0, coefficients: vec![Vector3::zeros()] });
    let dips = Item::Piece(Piece { vehicle: 1, from_s: 0.0, to_s: 4.0, coefficients });
    let outcome = judge(&[still, dips], Settings::delta(2.0));
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
fn a_pass_on_curves_below_rounding_is_undecided() {
    // Both fall alike and pass at 5 m. From 1e16 m the rounding of the distance is up to 9 m, from 1e6 m it is
    // negligible.
    let passes = |from_m: f64| {
        let piece = |vehicle, x: [f64; 2], y: f64| {
            let coefficients =
                vec![Vector3::new(x[0], y, 0.0), Vector3::new(x[1], 0.0, 0.0), Vector3::new(0.0, 0.0, -5.0)];
            Item::Piece(Piece { vehicle, from_s: 0.0, to_s: 1.0, coefficients })
        };
        status(&[piece(0, [0.0, 0.0], 0.0), piece(1, [-from_m, 2.0 * from_m], 5.0)], Settings::delta(2.0))
    };
    assert_eq!([1e16, 1e6].map(passes), [Status::Undecided, Status::Clear]);
}

#[test]
fn a_curve_with_too_many_coefficients_is_refused() {
    let rises = |count: usize| rising(&vec![1e-3; count], 9.0);
    assert_eq!(status(&rises(64), Settings::delta(1.0)), Status::Clear);
    let refused = audit(&names(2), &rises(65), Settings::delta(1.0));
    assert!(matches!(refused, Err(RecordedError::Item { .. })), "{refused:?}");
}

#[test]
fn curves_at_a_large_distance_are_enclosed_quickly() {
    // The rounding of the distance exceeds 1e-9 m, so the bounds cannot be brought that close.
    let curve = |vehicle, k: f64, y: f64| {
        let at = [Vector3::new(0.0, y, 0.0), Vector3::new(0.0, 0.3 * k, 0.0), Vector3::new(0.0, -0.3, 0.0)];
        Item::Piece(Piece { vehicle, from_s: k, to_s: k + 1.0, coefficients: at.to_vec() })
    };
    let pieces = (0..2000).flat_map(|k| [curve(0, f64::from(k), 0.0), curve(1, f64::from(k), 1e8)]);
    let settings = Settings { max_gap_s: Some(1.0), ..Settings::delta(1.0) };
    let outcome = judge(&pieces.collect::<Vec<_>>(), settings);
    let Approach { lower_m, upper_m, .. } = outcome.closest[0];
    assert!(outcome.status == Status::Clear && upper_m - lower_m < 1e-5, "{lower_m} {upper_m}");
}
