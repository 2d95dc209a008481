//! Audit of recordings: each claim with a case of the opposite verdict.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;
use proptest::prelude::*;
use tautline_audit::recorded::{
    Interpolation, ObjectPair, Outcome, RecordedError, Settings, TrackAuditor, VehicleSettings, audit,
};
use tautline_audit::{MovingObstacle, Status};
use tautline_core::obstacle::Shape;
use tautline_core::track::{Item, Piece, Sample};

use super::recorded_curves::curves;

/// Rounding of a handful of operations on numbers around ten.
pub(crate) const ROUNDING: f64 = 1e-13;

pub(crate) fn seen(vehicle: usize, time_s: f64, at: [f64; 3]) -> Item {
    Item::Sample(Sample { vehicle, time_s, position_m: at.into(), velocity_m_s: None, radius_m: None })
}

pub(crate) fn names(count: usize) -> Vec<String> {
    ["alpha", "bravo", "charlie", "delta"].iter().take(count).map(ToString::to_string).collect()
}

pub(crate) fn judge(items: &[Item], settings: Settings) -> Outcome {
    let count = items.iter().map(|item| item.vehicle() + 1).max().unwrap_or(0);
    audit(&names(count), items, settings).expect("a verdict")
}

pub(crate) fn status(items: &[Item], settings: Settings) -> Status {
    judge(items, settings).status
}

/// Returns two vehicles that pass each other within a second, `miss_m` apart in the middle and at least 10 m apart in
/// every sample.
pub(crate) fn pass(miss_m: f64) -> Vec<Item> {
    vec![
        seen(0, 0.0, [-5.0, 0.0, 0.0]),
        seen(1, 0.0, [5.0, miss_m, 0.0]),
        seen(0, 1.0, [5.0, 0.0, 0.0]),
        seen(1, 1.0, [-5.0, miss_m, 0.0]),
    ]
}

pub(crate) fn of(settings: &[(&str, VehicleSettings)]) -> BTreeMap<String, VehicleSettings> {
    settings.iter().map(|(name, settings)| ((*name).to_owned(), *settings)).collect()
}

#[test]
fn motion_between_samples_is_judged_and_equality_is_no_violation() {
    assert_eq!(status(&pass(1.0), Settings::delta(2.0)), Status::Violation);
    assert_eq!(status(&pass(3.0), Settings::delta(2.0)), Status::Clear);
    assert_eq!(status(&pass(2.0), Settings::delta(2.0)), Status::Clear);
    assert_eq!(status(&pass(2.0_f64.next_down()), Settings::delta(2.0)), Status::Violation);
    let found = judge(&pass(1.0), Settings::delta(2.0)).violations[0];
    let half_s = 3_f64.sqrt() / 20.0;
    assert!((found.from_s - (0.5 - half_s)).abs() < ROUNDING && (found.to_s - (0.5 + half_s)).abs() < ROUNDING);
    assert_eq!((found.min_m, found.min_at_s), (1.0, 0.5));
}

#[test]
fn the_first_instant_and_a_single_sample_are_judged() {
    let once = |apart_m: f64| vec![seen(0, 0.0, [0.0; 3]), seen(1, 0.0, [apart_m, 0.0, 0.0])];
    assert_eq!(status(&once(1.0), Settings::delta(2.0)), Status::Violation);
    assert_eq!(status(&once(3.0), Settings::delta(2.0)), Status::Clear);
    // A single sample in the path of another vehicle.
    let with_vehicle_at_origin = |time_s| {
        let mut items = pass(9.0);
        items.push(seen(2, time_s, [0.0; 3]));
        items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        items
    };
    assert_eq!(status(&with_vehicle_at_origin(0.5), Settings::delta(2.0)), Status::Violation);
    assert_eq!(status(&with_vehicle_at_origin(0.1), Settings::delta(2.0)), Status::Clear);
    // Too close at the first instant only.
    let mut parting = once(1.0);
    parting.extend([seen(0, 1.0, [-5.0, 0.0, 0.0]), seen(1, 1.0, [5.0, 0.0, 0.0])]);
    assert_eq!(judge(&parting, Settings::delta(2.0)).violations[0].from_s, 0.0);
}

#[test]
fn a_recording_without_a_pair_is_undecided() {
    assert_eq!(audit(&[], &[], Settings::delta(1.0)).unwrap().status, Status::Undecided);
    assert_eq!(status(&[seen(0, 0.0, [0.0; 3])], Settings::delta(1.0)), Status::Undecided, "a vehicle alone");
    // Two vehicles that are never present together; an instant together is enough.
    let after = |second_s| [seen(0, 0.0, [0.0; 3]), seen(1, second_s, [9.0, 0.0, 0.0])];
    assert_eq!(status(&after(1.0), Settings::delta(1.0)), Status::Undecided);
    assert_eq!(status(&after(0.0), Settings::delta(1.0)), Status::Clear);
    let elsewhere = Settings { from_s: Some(5.0), ..Settings::delta(1.0) };
    assert_eq!(status(&pass(3.0), elsewhere), Status::Undecided);
}

#[test]
fn a_held_vehicle_stays_and_its_jump_is_swept() {
    // Bravo stands beside the path of alpha's jump. Alpha is far from bravo in every sample.
    let items = |aside_m: f64| {
        let mut items = vec![seen(0, 0.0, [-5.0, 0.0, 0.0]), seen(0, 1.0, [5.0, 0.0, 0.0])];
        items.extend([seen(1, 0.0, [0.0, aside_m, 0.0]), seen(1, 1.0, [0.0, aside_m, 0.0])]);
        items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        items
    };
    let held = Settings { motion: Some(Interpolation::Hold), ..Settings::delta(2.0) };
    let found = judge(&items(1.0), held.clone());
    assert_eq!((found.status, found.violations[0].from_s, found.violations[0].to_s), (Status::Violation, 1.0, 1.0));
    assert_eq!(status(&items(3.0), held.clone()), Status::Clear);
    // Bravo passes the position that alpha holds; a straight flight of alpha would already be away.
    let mut crossing = vec![seen(0, 0.0, [0.0; 3]), seen(1, 0.0, [6.0, 6.0, 0.0])];
    crossing.extend([seen(1, 0.5, [6.0, 0.0, 0.0]), seen(1, 0.9, [1.0, 0.0, 0.0]), seen(0, 1.0, [0.0, 60.0, 0.0])]);
    let with_long_gaps = |motion| Settings { motion: Some(motion), max_gap_s: Some(9.0), ..Settings::delta(2.0) };
    assert_eq!(status(&crossing, with_long_gaps(Interpolation::Hold)), Status::Violation);
    assert_eq!(status(&crossing, with_long_gaps(Interpolation::Linear)), Status::Clear);
}

#[test]
fn pairs_on_the_ground_are_not_judged() {
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
    let outcome = judge(&items(1.0), above.clone());
    assert_eq!(outcome.violations[0].from_s, 0.5, "{outcome:?}");
    assert!((outcome.closest[0].lower_m - 1.0_f64.hypot(0.25)).abs() < ROUNDING);
    // Under a bound the vehicle may leave the ground earlier.
    let bounded = Settings { motion: Some(Interpolation::Bounded), max_accel_m_s2: Some(0.01), ..above };
    assert!(judge(&items(1.0), bounded).violations[0].from_s < 0.5);
}

#[test]
fn a_climb_that_begins_when_another_vehicle_ends_is_no_violation() {
    let items = |height_m: f64| {
        [
            seen(0, 0.0, [0.0, 0.0, height_m]),
            seen(1, 0.0, [0.3, 0.0, 0.0]),
            seen(0, 1.0, [0.0, 0.0, height_m]),
            seen(1, 1.0, [0.3, 0.0, 0.0]),
            seen(1, 2.0, [0.3, 0.0, 4.0]),
        ]
    };
    for (above_m, motion) in [(0.0, Interpolation::Linear), (0.0, Interpolation::Hold), (0.1, Interpolation::Linear)] {
        let settings = Settings { above_m: Some(above_m), motion: Some(motion), ..Settings::delta(1.0) };
        let outcome = judge(&items(above_m), settings.clone());
        assert_eq!(outcome.violations, [], "{above_m} {motion:?}");
        assert_eq!(status(&items(above_m + 0.01), settings), Status::Violation, "{above_m} {motion:?}");
    }
}

#[test]
fn very_short_intervals_are_judged_or_refused() {
    let items = |step_s: f64| {
        let b = |k: i32, x| seen(1, f64::from(k) * step_s, [x, 0.0, 0.0]);
        let a = |k: i32| seen(0, f64::from(k) * step_s, [0.0; 3]);
        [a(0), b(0, 5.0), a(1), b(1, 0.1), a(2), b(2, 5.0)]
    };
    assert_eq!(status(&items(1e-60), Settings::delta(1.0)), Status::Violation);
    let bounded = Settings { motion: Some(Interpolation::Bounded), max_accel_m_s2: Some(1.0), ..Settings::delta(1.0) };
    assert_ne!(status(&items(1e-60), bounded), Status::Clear);
    let refused = audit(&names(2), &items(3e-310), Settings::delta(1.0));
    assert!(matches!(refused, Err(RecordedError::TimeNotIncreasing { .. })), "{refused:?}");
}

#[test]
fn a_window_clips_exactly() {
    let inside = |from_s, until_s| Settings { from_s, until_s, ..Settings::delta(2.0) };
    // Below delta from 0.5 - sqrt(3) / 20 = 0.4134 s on.
    assert_eq!(status(&pass(1.0), inside(None, Some(0.41))), Status::Clear);
    assert_eq!(status(&pass(1.0), inside(Some(0.59), None)), Status::Clear);
    let outcome = judge(&pass(1.0), inside(Some(0.25), Some(0.45)));
    let found = outcome.violations[0];
    assert_eq!((outcome.span_s, found.to_s), (Some((0.25, 0.45)), 0.45));
    assert!((found.min_m - 1.0_f64.hypot(1.0)).abs() < ROUNDING, "10 m/s of each, 0.05 s before they meet");
}

#[test]
fn a_gap_is_undecided_unless_it_is_bridged() {
    let with_missing_sample = |missing: u32| {
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
    assert_eq!(status(&with_missing_sample(99), Settings::delta(2.0)), Status::Clear);
    let outcome = judge(&with_missing_sample(7), Settings::delta(2.0));
    assert_eq!((outcome.status, outcome.gaps.len(), outcome.gaps[0].vehicle), (Status::Undecided, 1, 1));
    assert!((outcome.gaps[0].from_s - 0.6).abs() < ROUNDING && (outcome.gaps[0].to_s - 0.8).abs() < ROUNDING);
    assert_eq!(
        status(&with_missing_sample(7), Settings { max_gap_s: Some(0.25), ..Settings::delta(2.0) }),
        Status::Clear
    );
    // A late start and an early end are no gaps.
    assert!(judge(&with_missing_sample(0), Settings::delta(2.0)).gaps.is_empty());
    assert!(judge(&with_missing_sample(19), Settings::delta(2.0)).gaps.is_empty());
    // Nor is a gap that ends before the window.
    assert_eq!(status(&with_missing_sample(7), Settings { from_s: Some(1.0), ..Settings::delta(2.0) }), Status::Clear);
    // Nor is a gap in which no other vehicle is present, unless there is an obstacle.
    let mut left = with_missing_sample(7);
    left.retain(|item| item.vehicle() == 1 || item.time_s() < 0.55);
    let outcome = judge(&left, Settings::delta(2.0));
    assert_eq!((outcome.status, outcome.gaps.len()), (Status::Clear, 0));
    let tower = obstacle_at(Shape::Ball { radius_m: 1.0 }, [90.0, 0.0, 0.0]);
    let outcome = judge(&left, Settings { obstacles: vec![tower], ..Settings::delta(2.0) });
    assert_eq!((outcome.status, outcome.gaps.len()), (Status::Undecided, 1));
    // `joined_by_s` is the length of the whole gap, also if the window cuts it.
    let cut = judge(&with_missing_sample(7), Settings { from_s: Some(0.75), ..Settings::delta(2.0) });
    assert!((cut.gaps[0].joined_by_s - 0.2).abs() < ROUNDING && cut.gaps[0].from_s == 0.75, "{:?}", cut.gaps);
    // A gap between curves.
    let mut curves = curves(5.0);
    curves.retain(|item| !(item.vehicle() == 0 && item.time_s() == 1.0));
    assert_eq!(judge(&curves, Settings::delta(0.1)).gaps.len(), 1);
}

#[test]
fn a_clock_offset_is_corrected() {
    // Both pass the same place one second apart. Their clocks differ by one second.
    let through = |vehicle: usize, late_s: f64, turned: bool| {
        (0..=20).map(move |k| {
            let t = 0.2 * f64::from(k);
            let along = 5.0 * t - 10.0;
            seen(vehicle, t + late_s, if turned { [0.0, along, 0.0] } else { [along, 0.0, 0.0] })
        })
    };
    let mut items: Vec<_> = through(0, 0.0, false).chain(through(1, 1.0, true)).collect();
    items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    let with_offset = |offset_s| Settings {
        vehicles: of(&[("bravo", VehicleSettings { offset_s, ..VehicleSettings::default() })]),
        ..Settings::delta(2.0)
    };
    assert_eq!(status(&items, Settings::delta(2.0)), Status::Clear);
    let outcome = judge(&items, with_offset(-1.0));
    assert_eq!(outcome.status, Status::Violation);
    assert!(outcome.closest[0].lower_m < 1e-12 && (outcome.closest[0].time_s - 2.0).abs() < 1e-12);
    assert_eq!(status(&items, with_offset(1.0)), Status::Clear);
}

#[test]
fn an_ellipsoid_scales_distances() {
    let stacked = |dz: f64| vec![seen(0, 0.0, [0.0; 3]), seen(1, 0.0, [0.0, 0.0, dz])];
    let beside = |dx: f64| vec![seen(0, 0.0, [0.0; 3]), seen(1, 0.0, [dx, 0.0, 0.0])];
    let downwash = Settings { ellipsoid_m: Some(Vector3::new(0.125, 0.125, 0.375)), ..Settings::default() };
    assert_eq!(status(&stacked(0.7), downwash.clone()), Status::Violation);
    assert_eq!(status(&stacked(0.75), downwash.clone()), Status::Clear);
    assert_eq!(status(&beside(0.3), downwash.clone()), Status::Clear);
    let outcome = judge(&beside(0.2), downwash.clone());
    assert_eq!(outcome.status, Status::Violation);
    assert!((outcome.closest[0].lower_m - 1.6).abs() < ROUNDING);
    assert_eq!(status(&beside(0.2), Settings { delta_m: Some(1.5), ..downwash }), Status::Clear);
}

#[test]
fn the_limit_is_the_larger_of_delta_and_the_radii() {
    let apart = |distance_m: f64| vec![seen(0, 0.0, [0.0; 3]), seen(1, 0.0, [distance_m, 0.0, 0.0])];
    let radius = |radius_m| VehicleSettings { radius_m: Some(radius_m), ..VehicleSettings::default() };
    let radii = Settings { vehicles: of(&[("alpha", radius(0.5)), ("bravo", radius(1.0))]), ..Settings::default() };
    assert_eq!(status(&apart(1.4), radii.clone()), Status::Violation);
    assert_eq!(status(&apart(1.5), radii.clone()), Status::Clear);
    let both = Settings { delta_m: Some(2.0), ..radii };
    assert_eq!(status(&apart(1.6), both), Status::Violation);
    // First the recording's own radii, then no limit.
    let mut own = apart(1.4);
    for item in &mut own {
        if let Item::Sample(sample) = item {
            sample.radius_m = Some(0.75);
        }
    }
    assert_eq!(status(&own, Settings::default()), Status::Violation);
    let none = audit(&names(2), &apart(1.4), Settings::default()).unwrap_err();
    assert_eq!(none, RecordedError::NoLimit { vehicle: "alpha".to_owned() });
    // A name that the recording does not have is the cause, and is reported with the names of the recording.
    let zulu = VehicleSettings { radius_m: Some(1.0), max_accel_m_s2: Some(1.0), ..VehicleSettings::default() };
    let by_name = Settings { vehicles: of(&[("zulu", zulu)]), ..Settings::default() };
    let bounded = Settings { motion: Some(Interpolation::Bounded), delta_m: Some(1.0), ..by_name.clone() };
    for settings in [by_name, bounded] {
        let unknown = audit(&names(2), &pass(3.0), settings).expect_err("an unknown vehicle");
        assert_eq!(unknown.to_string(), "the recording has no vehicle zulu; it has alpha, bravo");
    }
}

pub(crate) fn obstacle_at(shape: Shape, at: [f64; 3]) -> MovingObstacle {
    MovingObstacle { name: "obstacle".to_owned(), shape, clearance_m: None, path: vec![(0.0, at.into())] }
}

#[test]
fn distances_from_obstacles_are_judged() {
    let flight = [seen(0, 0.0, [-5.0, 0.0, 2.0]), seen(0, 1.0, [5.0, 0.0, 2.0])];
    // A keep-out ball of delta / 2 = 0.5 m must not enter.
    let with = |obstacle: MovingObstacle| Settings { obstacles: vec![obstacle], ..Settings::delta(1.0) };
    let ball = Shape::Ball { radius_m: 1.0 };
    let cuboid = Shape::Box { half_m: Vector3::new(1.0, 1.0, 1.0), yaw_deg: 17.0 };
    let capsule =
        Shape::Capsule { from_m: Vector3::new(0.0, -3.0, 0.0), to_m: Vector3::new(0.0, 3.0, 0.0), radius_m: 1.0 };
    for shape in [ball, cuboid, capsule] {
        // At a clearance of 0 m the vehicle may touch the obstacle but not enter it.
        for (clearance_m, z, expected) in [
            (None, 0.4, Status::Clear),
            (None, 0.5, Status::Clear),
            (None, 0.6, Status::Violation),
            (Some(0.0), 1.0, Status::Clear),
            (Some(0.0), 1.1, Status::Violation),
        ] {
            let outcome = judge(&flight, with(MovingObstacle { clearance_m, ..obstacle_at(shape, [0.0, 0.0, z]) }));
            assert_eq!((outcome.status, outcome.parry.disagreements), (expected, 0), "{shape:?} {z} {outcome:?}");
            assert!((outcome.obstacles[0].lower_m - (1.0 - z)).abs() < 1e-9, "{outcome:?}");
        }
    }
    let ground = |z| obstacle_at(Shape::HalfSpace { normal: Vector3::z() }, [0.0, 0.0, z]);
    assert_eq!(status(&flight, with(ground(1.5))), Status::Clear);
    assert_eq!(status(&flight, with(ground(1.6))), Status::Violation);
    let wider = MovingObstacle { clearance_m: Some(0.7), ..ground(1.4) };
    assert_eq!(status(&flight, with(wider)), Status::Violation);
    // A moving obstacle that crosses while the vehicle passes, or 3 s later.
    let moving = |late_s: f64| MovingObstacle {
        path: vec![(late_s, Vector3::new(0.0, -10.0, 2.0)), (late_s + 1.0, Vector3::new(0.0, 10.0, 2.0))],
        ..obstacle_at(ball, [0.0; 3])
    };
    let hit = judge(&flight, with(moving(0.0)));
    assert_eq!(hit.status, Status::Violation);
    assert!(matches!(hit.violations[0].pair, ObjectPair::Obstacle { vehicle: 0, obstacle: 0 }));
    assert_eq!(status(&flight, with(moving(3.0))), Status::Clear);
    // A curve above the ground.
    let outcome = judge(&curves(5.0), Settings { obstacles: vec![ground(-20.0)], ..Settings::delta(0.1) });
    assert_eq!((outcome.parry.disagreements, outcome.status), (0, Status::Clear));
    // Alpha begins inside one box, 0.1 m deep, and never comes near the other.
    for (at, expected) in [([0.3, 1.0, 1.5], Status::Violation), ([0.3, 1.0, 9.5], Status::Clear)] {
        let cuboid = Shape::Box { half_m: Vector3::repeat(0.1), yaw_deg: 17.0 };
        let entered = with(MovingObstacle { clearance_m: Some(0.0), ..obstacle_at(cuboid, at) });
        let outcome = judge(&curves(5.0), entered);
        assert_eq!((outcome.parry.disagreements, outcome.status), (0, expected), "{outcome:?}");
    }
}

#[test]
fn only_selected_vehicles_are_judged() {
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
fn invalid_recordings_and_settings_are_refused() {
    let refused = |items: &[Item], settings: Settings| audit(&names(2), items, settings).unwrap_err().to_string();
    let twice = [seen(0, 1.0, [0.0; 3]), seen(0, 1.0, [1.0, 0.0, 0.0])];
    assert!(refused(&twice, Settings::delta(1.0)).contains("alpha: the time 1.0 s is not later than 1.0 s"));
    assert!(
        refused(&[seen(1, 1.0, [f64::NAN, 0.0, 0.0])], Settings::delta(1.0)).contains("bravo at 1.0 s: the position")
    );
    let back = [seen(0, 1.0, [0.0; 3]), seen(1, 0.5, [0.0; 3])];
    assert!(refused(&back, Settings::delta(1.0)).contains("comes after one at 1.0 s"));
    assert!(refused(&[seen(7, 1.0, [0.0; 3])], Settings::delta(1.0)).contains("vehicle 8 (from 1) has no name"));
    let with = |motion| Settings { motion: Some(motion), ..Settings::delta(1.0) };
    assert!(refused(&pass(1.0), with(Interpolation::Polynomial)).contains("has samples and no curve"));
    assert!(refused(&curves(1.0), with(Interpolation::Linear)).contains("has a curve"));
    assert!(refused(&pass(1.0), with(Interpolation::Bounded)).contains("needs its largest acceleration"));
    for settings in [
        Settings::delta(0.0),
        Settings::delta(f64::NAN),
        Settings { max_gap_s: Some(-1.0), ..Settings::delta(1.0) },
        Settings { from_s: Some(2.0), until_s: Some(1.0), ..Settings::delta(1.0) },
        Settings { ellipsoid_m: Some(Vector3::new(1.0, 0.0, 1.0)), ..Settings::default() },
    ] {
        assert!(TrackAuditor::new(settings.clone()).is_err(), "{settings:?}");
    }
}

#[test]
fn a_recording_in_parts_has_the_same_outcome() {
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

#[test]
fn noise_is_judged_without_sweeping_all_pairs() {
    // 300 vehicles jump across a cube of 1 km between samples, each with its own sample times.
    const VEHICLES: usize = 300;
    let mut state = 1_u64;
    let mut random = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let starts: Vec<_> = (0..VEHICLES).map(|_| random()).collect();
    let mut items = Vec::new();
    for k in 0..10 {
        for (vehicle, start_s) in starts.iter().enumerate() {
            let place = [1e3 * random(), 1e3 * random(), 1e3 * random()];
            items.push(seen(vehicle, f64::from(k) + start_s, place));
        }
    }
    items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    let names: Vec<_> = (0..VEHICLES).map(|k| k.to_string()).collect();
    let outcome = audit(&names, &items, Settings::delta(1.0)).expect("a verdict");
    let pairs = (VEHICLES * (VEHICLES - 1) / 2) as u64;
    assert!(outcome.swept < pairs, "{} sweeps of {pairs} pairs in ten intervals", outcome.swept);
}

#[test]
fn obstacles_count_on_the_ground_unless_vehicles_land_on_them() {
    // Both climb through a height of 1 m at 5 s.
    let items = [(0.0, 0.0), (10.0, 2.0)].map(|(t, z)| [seen(0, t, [0.0, 0.0, z]), seen(1, t, [5.0, 0.0, z])]).concat();
    let ground = MovingObstacle {
        clearance_m: Some(0.5),
        ..obstacle_at(Shape::HalfSpace { normal: Vector3::new(0.0, 0.0, 1.0) }, [0.0; 3])
    };
    let name = ground.name.clone();
    let above = Settings { above_m: Some(1.0), obstacles: vec![ground], ..Settings::delta(1.0) };
    let hit = judge(&items, above.clone());
    assert_eq!((hit.status, hit.obstacles[0].lower_m), (Status::Violation, 0.0));
    let landing = Settings { land_on: [name].into(), ..above.clone() };
    let landed = judge(&items, landing.clone());
    assert_eq!((landed.status, landed.obstacles[0].lower_m), (Status::Clear, 1.0));
    for outcome in [hit, landed] {
        let exempt = outcome.exempt.expect("a height of the ground");
        assert!((exempt.pairs_s - 5.0).abs() < ROUNDING && (exempt.vehicles_s - 5.0).abs() < ROUNDING, "{exempt:?}");
    }
    assert_eq!(judge(&items, Settings { above_m: None, land_on: BTreeSet::new(), ..landing.clone() }).exempt, None);
    let unknown = Settings { land_on: ["pad".to_owned()].into(), ..above.clone() };
    assert!(matches!(TrackAuditor::new(unknown), Err(RecordedError::UnknownObstacle { .. })));
    let twice = Settings { obstacles: [&above.obstacles[..], &above.obstacles[..]].concat(), ..landing.clone() };
    assert!(matches!(TrackAuditor::new(twice.clone()), Err(RecordedError::AmbiguousObstacle { count: 2, .. })));
    assert!(TrackAuditor::new(Settings { land_on: BTreeSet::new(), ..twice }).is_ok());
    let no_height = Settings { above_m: None, ..landing };
    assert!(matches!(TrackAuditor::new(no_height), Err(RecordedError::NoGround { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn no_input_makes_the_audit_panic(
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
                let coefficients = vec![position_m, position_m * w];
                Item::Piece(Piece { vehicle, from_s: t, to_s: t + w.abs(), coefficients })
            } else {
                Item::Sample(Sample { vehicle, time_s: t, position_m, velocity_m_s: None, radius_m: None })
            }
        }).collect();
        if sorted {
            items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        }
        let all = Interpolation::ALL.map(Some);
        let motion = [None, all[0], all[1], all[2], all[3]][usize::from(motion)];
        let obstacles = vec![obstacle_at(Shape::Ball { radius_m: 1.0 }, [0.0; 3])];
        let settings =
            Settings { motion, above_m: above, max_accel_m_s2: Some(1.0), obstacles, ..Settings::delta(1.0) };
        let _ = audit(&names(4), &items, settings);
    }
}
