//! Lists of findings: each finding appears once, with its own numbers.

use nalgebra::Vector3;
use tautline_audit::recorded::{Interpolation, Outcome, Settings, audit};
use tautline_core::track::{Item, Piece, Sample};

/// Rounding of a handful of operations on numbers around ten.
const ROUNDING: f64 = 1e-13;

fn seen(vehicle: usize, time_s: f64, at: [f64; 3]) -> Item {
    Item::Sample(Sample { vehicle, time_s, position_m: at.into(), velocity_m_s: None, radius_m: None })
}

fn judge(items: &[Item], settings: Settings) -> Outcome {
    let count = items.iter().map(|item| item.vehicle() + 1).max().unwrap_or(0);
    let names: Vec<String> = (1..=count).map(|number| number.to_string()).collect();
    audit(&names, items, settings).expect("a verdict")
}

/// Returns two vehicles that approach to these distances along x at every other second, and are 30 m apart in between.
fn approaches(nearest_m: &[f64]) -> Vec<Item> {
    let mut items = Vec::new();
    for k in 0..=2 * nearest_m.len() {
        let x = if k % 2 == 1 { nearest_m[k / 2] } else { 30.0 };
        items.extend([seen(0, k as f64, [0.0; 3]), seen(1, k as f64, [x, 0.0, 0.0])]);
    }
    items
}

#[test]
fn every_violation_and_undecided_time_is_listed_once() {
    let near = [0.3, 0.7, 0.4, 5.0, 0.6];
    let expected = [(1.0, 0.3), (3.0, 0.7), (5.0, 0.4), (9.0, 0.6)];
    // Two vehicles alone, then among others, so that neighbours are compared first and windows are halved.
    let mut crowd = approaches(&near);
    for item in approaches(&near) {
        crowd
            .extend((2..8).map(|k| seen(k, item.time_s(), [0.0, 90.0 * k as f64, 0.0])).take(6 * (1 - item.vehicle())));
    }
    crowd.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    for (items, count) in [(approaches(&near), 2), (crowd, 8)] {
        let outcome = judge(&items, Settings::delta(1.0));
        let found: Vec<_> = outcome.violations.iter().map(|v| (v.min_at_s, v.min_m)).collect();
        assert_eq!(found, expected);
        assert!(count > 2 || outcome.swept == 1 + 2 * near.len() as u64, "{}", outcome.swept);
    }
    let bounded = Settings { motion: Some(Interpolation::Bounded), max_accel_m_s2: Some(4.0), ..Settings::delta(1.0) };
    // Two accelerations of 4 m/s^2 over 1 s deviate by at most 1 m together.
    let outcome = judge(&approaches(&[1.3, 9.0, 1.9]), bounded);
    let found: Vec<_> = outcome.undecided.iter().map(|u| (u.from_s, u.to_s, u.lower_m.max(0.0))).collect();
    let near = |x: f64, y: f64| (x - y).abs() < ROUNDING;
    assert!(found.len() == 2 && near(found[0].2, 0.3) && near(found[1].2, 0.9), "{found:?}");
    assert_eq!([found[0], found[1]].map(|u| (u.0, u.1)), [(0.0, 2.0), (4.0, 6.0)]);
}

#[test]
fn each_dip_of_a_curve_has_its_own_smallest_distance() {
    // ((t - 1)(t - 3))^2 / 2 + 0.15 t - 0.05: minima of 0.097 m and 0.397 m.
    let x = [4.45, -11.85, 11.0, -4.0, 0.5];
    let curve = |vehicle, x: &[f64]| {
        let coefficients = x.iter().map(|x| Vector3::new(*x, 0.0, 0.0)).collect();
        Item::Piece(Piece { vehicle, from_s: 0.0, to_s: 4.0, coefficients })
    };
    let outcome = judge(&[curve(0, &[0.0]), curve(1, &x)], Settings::delta(0.5));
    let [first, second] = outcome.violations[..] else { panic!("{:?}", outcome.violations) };
    for (dip, at_s, min_m) in [(first, 0.96, 0.097), (second, 2.96, 0.397)] {
        assert!((dip.min_at_s - at_s).abs() < 0.01 && (dip.min_m - min_m).abs() < 1e-3, "{dip:?}");
        assert!(dip.from_s < dip.min_at_s && dip.min_at_s < dip.to_s, "{dip:?}");
    }
    assert_eq!(judge(&[curve(0, &[0.0]), curve(1, &x)], Settings::delta(0.3)).violations.len(), 1);
}

#[test]
fn a_vehicle_is_present_from_its_first_to_its_last_sample() {
    let items = (0..2000).flat_map(|k| {
        let time_s = 0.1 * f64::from(k);
        let second = (500..1500).contains(&k).then(|| seen(1, time_s, [9.0, 0.0, 0.0]));
        [Some(seen(0, time_s, [0.0; 3])), second].into_iter().flatten()
    });
    let outcome = judge(&items.collect::<Vec<_>>(), Settings::delta(1.0));
    let presence: Vec<_> = outcome.presence.iter().flatten().map(|interval| (interval.from_s, interval.to_s)).collect();
    assert_eq!(presence, [(0.0, 0.1 * 1999.0), (50.0, 0.1 * 1499.0)]);
}

#[test]
fn a_common_sample_is_an_upper_bound() {
    // A long interval of 2 s with a wide enclosure, then a sample at a distance of 4.5 m.
    let items = [
        seen(0, 0.0, [0.0; 3]),
        seen(1, 0.0, [5.0, 0.0, 0.0]),
        seen(0, 2.0, [0.0; 3]),
        seen(1, 2.0, [5.0, 0.0, 0.0]),
        seen(0, 2.5, [0.0; 3]),
        seen(1, 2.5, [4.5, 0.0, 0.0]),
        seen(0, 3.0, [0.0; 3]),
        seen(1, 3.0, [5.0, 0.0, 0.0]),
    ];
    let settings = Settings {
        max_gap_s: Some(5.0),
        motion: Some(Interpolation::Bounded),
        max_accel_m_s2: Some(1.0),
        ..Settings::delta(4.6)
    };
    let closest = judge(&items, settings).closest[0];
    // Bounds are rounded outwards.
    assert!(closest.lower_m <= 4.0 && 4.0 - closest.lower_m < ROUNDING, "{closest:?}");
    assert!(closest.upper_m >= 4.5 && closest.upper_m - 4.5 < ROUNDING, "{closest:?}");
}
