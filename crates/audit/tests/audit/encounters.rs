//! Distances of a pair over time, and straight lines beside curves.

use nalgebra::Vector3;
use tautline_audit::Status;
use tautline_audit::recorded::{Interpolation, ObjectPair, Outcome, PairSample, PairSeries, Settings};
use tautline_core::obstacle::Shape;
use tautline_core::swarm::Pair;
use tautline_core::track::{Item, Piece, Sample};

use crate::recorded::{judge, obstacle_at, pass, seen};

/// Rounding of a handful of operations on numbers around ten.
const ROUNDING: f64 = 1e-12;

/// Returns the series of a pair for a recording that is pushed in parts of `part` items.
fn series_of(items: &[Item], settings: &Settings, outcome: &Outcome, pair: ObjectPair, part: usize) -> Vec<PairSample> {
    let mut series = PairSeries::new(settings, outcome, pair).expect("known");
    for part in items.chunks(part) {
        series.push(part).expect("items");
    }
    series.finish()
}

fn first_two() -> ObjectPair {
    ObjectPair::Vehicles(Pair::new(0, 1))
}

#[test]
fn a_series_has_samples_and_closest_approaches() {
    let mut items = pass(1.0);
    items.extend([seen(0, 2.0, [5.0, 0.0, 0.0]), seen(1, 2.0, [5.0, 4.0, 3.0])]);
    let settings = Settings::delta(0.5);
    let outcome = judge(&items, settings.clone());
    let far_m = 101_f64.sqrt();
    for part in [1, 2, 3, 6] {
        let found = series_of(&items, &settings, &outcome, first_two(), part);
        let mut times_and_distances: Vec<_> = found.iter().map(|sample| (sample.time_s, sample.distance_m)).collect();
        // The end of a segment and the start of the next are one instant.
        times_and_distances.dedup();
        for expected in [(0.0, far_m), (0.5, 1.0), (1.0, far_m)] {
            assert!(times_and_distances.contains(&expected), "{part}: {times_and_distances:?}");
        }
        // A line through the samples is hardly above the distance, a hyperbola, in between.
        for two in times_and_distances.windows(2).filter(|two| two[1].0 <= 1.0) {
            let middle_m = (20.0 * f64::midpoint(two[0].0, two[1].0) - 10.0).hypot(1.0);
            assert!(f64::midpoint(two[0].1, two[1].1) - middle_m < 0.4, "{part}: {two:?}");
        }
        assert_eq!(times_and_distances.last(), Some(&(2.0, 5.0)), "{part}");
        assert!(
            times_and_distances.is_sorted_by(|a, b| a.0 <= b.0) && found.iter().all(|sample| !sample.unseen_before),
            "{times_and_distances:?}"
        );
        let half = found.iter().find(|sample| sample.time_s == 0.5).expect("the closest");
        assert_eq!(half.positions_m, [Vector3::zeros(), Vector3::new(0.0, 1.0, 0.0)]);
        assert!(found.iter().all(|sample| sample.deviation_m == 0.0));
    }
    // Distances are divided by the axes of the ellipsoid, positions are not.
    let scaled = Settings { ellipsoid_m: Some(Vector3::new(0.5, 0.25, 1.0)), ..Settings::default() };
    let outcome = judge(&items, scaled.clone());
    let found = series_of(&items, &scaled, &outcome, first_two(), 6);
    let half = found.iter().find(|sample| sample.time_s == 0.5).expect("the closest");
    assert_eq!((half.distance_m, half.positions_m[1]), (4.0, Vector3::new(0.0, 1.0, 0.0)));
}

#[test]
fn a_gap_interrupts_a_series() {
    let mut items: Vec<_> = (0..12)
        .filter(|k| !(5..8).contains(k))
        .flat_map(|k| {
            let time_s = f64::from(k);
            [seen(0, time_s, [0.0; 3]), seen(1, time_s, [3.0, time_s, 0.0])]
        })
        .collect();
    items.push(seen(1, 12.0, [3.0, 12.0, 0.0]));
    let settings = Settings::delta(0.5);
    let outcome = judge(&items, settings.clone());
    assert_eq!(outcome.gaps.len(), 2);
    for part in [1, 4, 100] {
        let found = series_of(&items, &settings, &outcome, first_two(), part);
        let broken: Vec<_> = found.iter().filter(|sample| sample.unseen_before).map(|sample| sample.time_s).collect();
        assert_eq!(broken, [8.0], "{part}");
        assert_eq!(found.last().map(|sample| sample.time_s), Some(11.0), "one vehicle alone has no distance");
    }
}

#[test]
fn a_series_past_an_obstacle_has_distances_from_its_surface() {
    let obstacles = vec![obstacle_at(Shape::Ball { radius_m: 1.0 }, [0.0, -2.0, 0.0])];
    let settings = Settings { obstacles, ..Settings::delta(0.5) };
    let items = pass(3.0);
    let outcome = judge(&items, settings.clone());
    let pair = outcome.obstacles[0].pair;
    assert_eq!(pair, ObjectPair::Obstacle { vehicle: 0, obstacle: 0 });
    let found = series_of(&items, &settings, &outcome, pair, 1);
    let nearest = found.iter().min_by(|a, b| a.distance_m.total_cmp(&b.distance_m)).expect("samples");
    assert!((nearest.distance_m - 1.0).abs() < ROUNDING && (nearest.time_s - 0.5).abs() < ROUNDING, "{nearest:?}");
    assert_eq!(nearest.positions_m[0], Vector3::new(0.0, -2.0, 0.0));
}

/// Returns a piece of a curve.
fn piece(vehicle: usize, [from_s, to_s]: [f64; 2], coefficients: &[[f64; 3]]) -> Item {
    Item::Piece(Piece { vehicle, from_s, to_s, coefficients: coefficients.iter().map(|&c| c.into()).collect() })
}

#[test]
fn a_line_beside_a_curve_is_judged_over_the_common_time() {
    // Alpha flies from 1 s to 5 s at 2 m/s. Bravo flies beside it from 2 s to 4 s, closest at 3 s with 1 m.
    let items = [
        seen(0, 1.0, [2.0, 0.0, 0.0]),
        piece(1, [2.0, 4.0], &[[4.0, 2.0, 0.0], [2.0, -2.0, 0.0], [0.0, 1.0, 0.0]]),
        seen(0, 5.0, [10.0, 0.0, 0.0]),
    ];
    let with_long_gaps = |delta_m| Settings { max_gap_s: Some(9.0), ..Settings::delta(delta_m) };
    let outcome = judge(&items, with_long_gaps(0.999));
    let closest = outcome.closest[0];
    assert_eq!(outcome.status, Status::Clear, "{closest:?}");
    assert!(closest.lower_m <= 1.0 && 1.0 <= closest.upper_m + ROUNDING, "{closest:?}");
    assert!(closest.is_known() && (closest.time_s - 3.0).abs() < 1e-3, "{closest:?}");
    let below = judge(&items, with_long_gaps(1.25)).violations[0];
    assert!((below.from_s - 2.5).abs() < 1e-6 && (below.to_s - 3.5).abs() < 1e-6, "{below:?}");
    let settings = with_long_gaps(0.999);
    let found = series_of(&items, &settings, &outcome, first_two(), 3);
    assert_eq!(found.len(), 9, "points on a curve");
    for sample in found {
        let expected_m = 1.0 + (sample.time_s - 3.0).powi(2);
        assert!((sample.distance_m - expected_m).abs() < ROUNDING, "{sample:?}");
    }
}

#[test]
fn a_series_through_velocities_follows_the_cubic() {
    // x = 5 - 9 u + 12 u^2 - 5 u^3 of the fraction u of 2 s, past a vehicle at rest.
    let cubic = |u: f64| 5.0 - 9.0 * u + 12.0 * u * u - 5.0 * u * u * u;
    let sample = |vehicle, time_s, x: f64, speed: f64| {
        let (position_m, velocity_m_s) = (Vector3::new(x, 0.0, 0.0), Some(Vector3::new(speed, 0.0, 0.0)));
        Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s, radius_m: None })
    };
    let items = [
        sample(0, 2.0, 0.0, 0.0),
        sample(1, 2.0, 5.0, -4.5),
        sample(0, 4.0, 0.0, 0.0),
        sample(1, 4.0, 3.0, 0.0),
        sample(0, 8.0, 0.0, 0.0),
        sample(1, 8.0, 3.0, 0.0),
    ];
    let settings = Settings { motion: Some(Interpolation::Bounded), max_accel_m_s2: Some(6.0), ..Settings::delta(0.1) };
    let settings = Settings { max_gap_s: Some(9.0), ..settings };
    let outcome = judge(&items, settings.clone());
    assert_eq!(outcome.contradiction, None);
    let found = series_of(&items, &settings, &outcome, first_two(), 6);
    assert!(found.len() >= 18, "points on two intervals");
    for sample in &found {
        let u = 0.5 * (sample.time_s - 2.0).min(2.0);
        assert!((sample.distance_m - cubic(u)).abs() < ROUNDING, "{sample:?}");
    }
    // A h^2 / 16 for each of the two, in the middle.
    for (middle_s, expected_m) in [(3.0, 3.0), (6.0, 12.0)] {
        let middle = found.iter().find(|sample| sample.time_s == middle_s).expect("a point");
        assert!((middle.deviation_m - expected_m).abs() < ROUNDING, "{middle:?}");
    }
}

#[test]
fn identical_curves_have_no_distance() {
    let both = |coefficients: &[[f64; 3]]| [piece(0, [0.0, 1.0], coefficients), piece(1, [0.0, 1.0], coefficients)];
    for coefficients in [&[[3.0, 2.0, 1.0]][..], &[[3.0, 2.0, 1.0], [1.0, 0.0, 0.0]]] {
        let outcome = judge(&both(coefficients), Settings::delta(1.0));
        // Bounds on curves are rounded outwards.
        let found = outcome.closest[0];
        assert!(found.lower_m == 0.0 && (0.0..1e-13).contains(&found.upper_m), "{found:?}");
        assert_eq!(outcome.status, Status::Violation);
        let [found] = outcome.violations[..] else { panic!("{outcome:?}") };
        assert_eq!((found.from_s, found.to_s), (0.0, 1.0));
    }
}

#[test]
fn a_curve_that_touches_the_limit_for_an_instant_is_two_violations() {
    let items = |apart_m: f64| {
        [
            piece(0, [0.0, 2.0], &[[0.0; 3]]),
            piece(1, [0.0, 1.0], &[[apart_m - 1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]),
            piece(1, [1.0, 2.0], &[[apart_m, 0.0, 0.0], [-1.0, 0.0, 0.0]]),
        ]
    };
    for (apart_m, expected) in [(2.0, 2), (1.75, 1), (2.5, 2)] {
        let outcome = judge(&items(apart_m), Settings::delta(2.0));
        assert_eq!(outcome.violations.len(), expected, "{apart_m}: {:?}", outcome.violations);
    }
}

#[test]
fn a_jump_of_a_curve_past_a_curve_is_swept() {
    // Bravo jumps at 1 s from one side of alpha to the other.
    let items = |aside_m: f64| {
        [
            piece(0, [0.0, 2.0], &[[0.0; 3], [0.0, 0.0, 1.0], [0.0, 0.0, 0.5]]),
            piece(1, [0.0, 1.0], &[[-5.0, aside_m, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.5]]),
            piece(1, [1.0, 2.0], &[[5.0, aside_m, 1.5], [0.0, 0.0, 2.0], [0.0, 0.0, 0.5]]),
        ]
    };
    let met = judge(&items(0.5), Settings::delta(1.0));
    assert_eq!(met.status, Status::Violation);
    assert!((met.closest[0].upper_m - 0.5).abs() < 1e-8 && met.closest[0].time_s == 1.0, "{:?}", met.closest);
    assert_eq!(judge(&items(1.5), Settings::delta(1.0)).status, Status::Clear);
}
