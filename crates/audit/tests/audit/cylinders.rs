//! Separations measured by an upright cylinder: a pair is too near only if it is so horizontally and vertically.

use std::collections::BTreeSet;

use nalgebra::Vector3;
use tautline_audit::recorded::{Interpolation, ObjectPair, RecordedError, Settings, audit};
use tautline_audit::{Cylinder, Status};
use tautline_core::option::CYLINDER;

use super::recorded::{judge, seen, status};
use super::recorded_curves::curves;
use super::scenes::{instants, items, place, scene};

/// Number of random scenes.
const SCENES: u64 = 300;
/// Distance from the limit within which the reference does not tell the sides apart.
const NEAR: f64 = 1e-9;

fn cylinder(horizontal_m: f64, vertical_m: f64) -> Settings {
    Settings { cylinder: Some(Cylinder { horizontal_m, vertical_m }), ..Settings::default() }
}

/// Returns two vehicles that pass in the middle of a second, `side_m` apart horizontally and `up_m` vertically.
fn pass(side_m: f64, up_m: f64) -> Vec<tautline_core::track::Item> {
    vec![
        seen(0, 0.0, [-50.0, 0.0, 10.0]),
        seen(1, 0.0, [50.0, side_m, 10.0 + up_m]),
        seen(0, 1.0, [50.0, 0.0, 10.0]),
        seen(1, 1.0, [-50.0, side_m, 10.0 + up_m]),
    ]
}

#[test]
fn a_pair_is_too_near_only_in_both_directions_at_once() {
    // Horizontally at 0.5 m, but 3 m apart in height: clear for the cylinder, too near for a ball.
    assert_eq!(status(&pass(0.5, 3.0), cylinder(4.0, 2.0)), Status::Clear);
    assert_eq!(status(&pass(0.5, 3.0), Settings::delta(4.0)), Status::Violation);
    assert_eq!(status(&pass(3.0, 0.5), cylinder(2.0, 4.0)), Status::Clear);
    // Too near only between the samples.
    let found = judge(&pass(0.5, 1.0), cylinder(4.0, 2.0));
    assert_eq!((found.status, found.violations.len()), (Status::Violation, 1));
    let violation = found.violations[0];
    assert_eq!((violation.min_m, violation.limit_m), (0.5, 1.0));
    let half_s = (16.0_f64 - 0.25).sqrt() / 200.0;
    assert!((violation.from_s - (0.5 - half_s)).abs() < 1e-12 && (violation.to_s - (0.5 + half_s)).abs() < 1e-12);
}

#[test]
fn exactly_at_either_distance_is_clear_and_the_next_double_is_a_violation() {
    for (side_m, up_m, horizontal_m, vertical_m) in [(0.3, 0.05, 0.3, 0.1), (0.05, 0.75, 0.3, 0.75)] {
        let items = pass(side_m, up_m);
        assert_eq!(status(&items, cylinder(horizontal_m, vertical_m)), Status::Clear);
        let larger = cylinder(horizontal_m.next_up(), vertical_m.next_up());
        assert_eq!(status(&items, larger), Status::Violation, "{side_m} {up_m}");
    }
    // In height first, horizontally later, never both.
    let turns =
        [seen(0, 0.0, [0.0; 3]), seen(0, 1.0, [0.0; 3]), seen(1, 0.0, [4.0, 0.0, 0.0]), seen(1, 1.0, [0.0, 0.0, 4.0])];
    let mut turns = turns.to_vec();
    turns.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    assert_eq!(status(&turns, cylinder(2.0, 2.0)), Status::Clear);
    assert_eq!(judge(&turns, cylinder(2.0, 2.0)).closest[0].lower_m, 1.0);
    assert_eq!(status(&turns, cylinder(2.0, 2.0_f64.next_up())), Status::Violation);
}

/// Returns the smallest scaled distance along a straight motion by ternary search: it is a convex function.
fn smallest(of: Cylinder, from: Vector3<f64>, to: Vector3<f64>) -> f64 {
    let at = |u: f64| of.distance(from.lerp(&to, u));
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..200 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if at(a) <= at(b) {
            high = b;
        } else {
            low = a;
        }
    }
    at(0.5 * (low + high)).min(at(0.0)).min(at(1.0))
}

#[test]
fn random_scenes_agree_with_a_search_over_every_pair() {
    let mut violations = 0;
    for (number, of) in (0..SCENES).zip([(2.0, 1.0), (1.0, 4.0), (9.0, 0.5)].into_iter().cycle()) {
        let of = Cylinder { horizontal_m: of.0, vertical_m: of.1 };
        let tracks = scene(number);
        let largest_m = tracks.iter().flatten().map(|(_, at)| at.amax()).fold(0.0, f64::max);
        let tolerance = NEAR + 64.0 * f64::EPSILON * largest_m / of.vertical_m.min(of.horizontal_m);
        let mut expected = Vec::new();
        for i in 0..tracks.len() {
            for j in i + 1..tracks.len() {
                let times = instants(&tracks[i], &tracks[j]);
                let apart = |time_s: f64| place(&tracks[j], time_s) - place(&tracks[i], time_s);
                let ends = times.iter().zip(times.iter().skip(1).chain(times.last()));
                let least = ends.map(|(&from_s, &to_s)| smallest(of, apart(from_s), apart(to_s))).reduce(f64::min);
                expected.extend(least.map(|least| (least, (i, j))));
            }
        }
        expected.sort_by(|a, b| a.0.total_cmp(&b.0));
        let names: Vec<_> = (0..tracks.len()).map(|k| k.to_string()).collect();
        let settings = Settings { max_gap_s: Some(f64::INFINITY), cylinder: Some(of), ..Settings::default() };
        let found = audit(&names, &items(&tracks), settings).expect("a verdict");
        assert_eq!(found.parry.disagreements, 0, "scene {number}: {:?}", found.parry.first_disagreement);
        assert_eq!(found.closest.len(), expected.len().min(10), "scene {number}");
        for (approach, (least, _)) in found.closest.iter().zip(&expected) {
            assert!(
                (approach.lower_m - least).abs() <= tolerance * (1.0 + least),
                "scene {number}: {approach:?} {least}"
            );
        }
        let reported: BTreeSet<_> = found
            .violations
            .iter()
            .map(|of| match of.pair {
                ObjectPair::Vehicles(pair) => (pair.first(), pair.second()),
                ObjectPair::Obstacle { .. } => panic!("the scene has no obstacle"),
            })
            .collect();
        for &(least, pair) in expected.iter().filter(|(least, _)| (least - 1.0).abs() > tolerance) {
            assert_eq!(reported.contains(&pair), least < 1.0, "scene {number}: {pair:?} {least}");
        }
        violations += reported.len();
    }
    assert!(violations > 50, "{violations}");
}

#[test]
fn curves_and_bounded_motion_are_enclosed() {
    // The curves differ by the miss along y and a distance along x: closest at the miss.
    let found = judge(&curves(0.3), cylinder(0.6, 0.2));
    let closest = found.closest[0];
    assert!(closest.lower_m <= 0.5 && 0.5 <= closest.upper_m + 1e-12 && closest.upper_m - closest.lower_m < 1e-8);
    assert_eq!(found.status, Status::Violation);
    assert_eq!(status(&curves(0.3), cylinder(0.3 - 1e-8, 0.2)), Status::Clear);
    assert_eq!(status(&curves(0.3), cylinder(0.3 + 1e-8, 0.2)), Status::Violation);

    // Bounded motion deviates from the lines by at most A h^2 / 8 = 0.25 m.
    let bounded = |horizontal_m: f64, vertical_m: f64, accel: f64| Settings {
        motion: Some(Interpolation::Bounded),
        max_accel_m_s2: Some(accel),
        ..cylinder(horizontal_m, vertical_m)
    };
    let still = |up_m: f64| {
        vec![
            seen(0, 0.0, [0.0; 3]),
            seen(1, 0.0, [0.5, 0.0, up_m]),
            seen(0, 1.0, [0.0; 3]),
            seen(1, 1.0, [0.5, 0.0, up_m]),
        ]
    };
    assert_eq!(status(&still(2.6), bounded(2.0, 2.0, 2.0)), Status::Clear);
    assert_eq!(status(&still(2.4), bounded(2.0, 2.0, 2.0)), Status::Undecided);
    assert_eq!(status(&still(1.9), bounded(2.0, 2.0, 2.0)), Status::Violation);
}

#[test]
fn a_cylinder_excludes_other_measures_and_needs_positive_distances() {
    let refused = |settings: Settings| audit(&[], &[], settings).expect_err("refused");
    for (horizontal_m, vertical_m) in [(0.0, 1.0), (1.0, -2.0), (f64::NAN, 1.0), (1.0, f64::INFINITY)] {
        let error = refused(cylinder(horizontal_m, vertical_m));
        assert!(matches!(error, RecordedError::OutOfRange { option: CYLINDER, .. }), "{error}");
    }
    for other in [
        Settings { delta_m: Some(1.0), ..cylinder(1.0, 1.0) },
        Settings { radius_m: Some(1.0), ..cylinder(1.0, 1.0) },
        Settings { ellipsoid_m: Some(Vector3::repeat(1.0)), ..cylinder(1.0, 1.0) },
    ] {
        assert!(matches!(refused(other), RecordedError::CylinderAnd { .. }));
    }
}
