//! Recordings with negative times, gaps, joined pieces, different clocks, and large coordinates.

use nalgebra::Vector3;
use tautline_audit::Status;
use tautline_audit::recorded::{Interpolation, RecordedError, Settings, VehicleSettings, audit};
use tautline_core::track::{Item, Piece, Sample};

use crate::recorded::{judge, names, seen};

/// Returns two vehicles side by side, sampled at 10 Hz for 20 s, that are 1 m apart in the first second and 9 m apart
/// later.
fn side_by_side(begin_s: f64) -> Vec<Item> {
    let at = |k: u32| {
        let time_s = begin_s + 0.1 * f64::from(k);
        let apart_m = if k < 10 { 1.0 } else { 9.0 };
        [seen(0, time_s, [0.0, 0.0, f64::from(k)]), seen(1, time_s, [apart_m, 0.0, f64::from(k)])]
    };
    (0..200).flat_map(at).collect()
}

#[test]
fn the_start_time_of_a_recording_does_not_matter() {
    for begin_s in [0.0, -50.0, -10.0, 1e6] {
        for offset_s in [0.0, -3.0, 3.0] {
            let set = || VehicleSettings { offset_s, ..VehicleSettings::default() };
            let vehicles = ["alpha", "bravo"].map(|name| (name.to_owned(), set())).into();
            let outcome = judge(&side_by_side(begin_s), Settings { vehicles, ..Settings::delta(2.0) });
            let [found] = outcome.violations[..] else { panic!("{begin_s} {offset_s}: {outcome:?}") };
            assert_eq!((found.from_s, found.min_m), (begin_s + offset_s, 1.0));
            assert_eq!((outcome.segments, outcome.presence.iter().flatten().count()), (400, 2));
        }
    }
}

#[test]
fn a_gap_matters_if_another_vehicle_is_present_inside_it() {
    // Alpha has a gap from 2 s to 5 s. Bravo is present up to a time, or from a time on.
    let with_bravo = |is_present: &dyn Fn(f64) -> bool| {
        let mut items = Vec::new();
        for k in 0..16 {
            let time_s = 0.5 * f64::from(k);
            if time_s <= 2.0 || time_s >= 5.0 {
                items.push(seen(0, time_s, [0.0; 3]));
            }
            if is_present(time_s) {
                items.push(seen(1, time_s, [9.0, 0.0, 0.0]));
            }
        }
        judge(&items, Settings::delta(2.0))
    };
    for (is_present, expected) in [
        (&(|t| t <= 2.0) as &dyn Fn(f64) -> bool, Status::Clear),
        (&|t| t >= 5.0, Status::Clear),
        (&|t| t <= 2.5, Status::Undecided),
        (&|t| t >= 4.5, Status::Undecided),
    ] {
        let outcome = with_bravo(is_present);
        assert_eq!(outcome.status, expected, "{:?}", outcome.gaps);
        assert_eq!(outcome.gaps.len(), usize::from(expected == Status::Undecided));
    }
}

/// Returns a piece of a curve.
fn piece(vehicle: usize, [from_s, to_s]: [f64; 2], coefficients: &[[f64; 3]]) -> Item {
    Item::Piece(Piece { vehicle, from_s, to_s, coefficients: coefficients.iter().map(|&c| Vector3::from(c)).collect() })
}

#[test]
fn joined_pieces_are_connected_by_a_straight_line() {
    // Alpha stands still on pieces with 0.2 s between them. Bravo is closest to it in the middle of that time.
    for (second_x, expected) in [(0.0, Status::Violation), (40.0, Status::Violation)] {
        let items = [
            piece(0, [0.0, 1.0], &[[0.0; 3]]),
            piece(1, [0.0, 2.2], &[[110.0, 1.0, 0.0], [-100.0, 0.0, 0.0]]),
            piece(0, [1.2, 2.2], &[[second_x, 0.0, 0.0]]),
        ];
        let joined = Settings { max_gap_s: Some(0.5), ..Settings::delta(2.0) };
        assert_eq!(judge(&items, joined).status, expected, "{second_x}");
        let apart = Settings { max_gap_s: Some(0.1), ..Settings::delta(2.0) };
        assert_eq!(judge(&items, apart).gaps.len(), 1);
    }
}

#[test]
fn a_curve_with_too_large_coordinates_is_refused() {
    let judged = |speed_m_s: f64| {
        let far = piece(0, [0.0, 1e30], &[[0.0; 3], [speed_m_s, 0.0, 0.0]]);
        audit(&names(2), &[far, piece(1, [0.0, 1.0], &[[5.0, 0.0, 0.0]])], Settings::delta(1.0))
    };
    assert!(judged(1e30).is_ok());
    assert!(matches!(judged(1e50), Err(RecordedError::Item { vehicle, .. }) if vehicle == "alpha"));
}

#[test]
fn a_straight_flight_far_from_the_origin_needs_no_acceleration() {
    for with_velocity in [false, true] {
        let at = |k: u32| {
            let time_s = 0.1 * f64::from(k);
            [0.0, 5.0].map(|aside_m| {
                let vehicle = usize::from(aside_m > 0.0);
                let position_m = Vector3::new(1e8 / 3.0 + 0.3 * time_s, 1e7 / 7.0 - 0.7 * time_s, aside_m);
                let velocity_m_s = with_velocity.then_some(Vector3::new(0.3, -0.7, 0.0));
                Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s, radius_m: None })
            })
        };
        let items: Vec<_> = (0..100).flat_map(at).collect();
        let bounded = |delta_m| Settings {
            motion: Some(Interpolation::Bounded),
            max_accel_m_s2: Some(0.0),
            ..Settings::delta(delta_m)
        };
        let outcome = judge(&items, bounded(4.9));
        assert_eq!((outcome.contradiction, outcome.status), (None, Status::Clear), "{with_velocity}");
        // A displaced sample needs an acceleration.
        let mut odd = items.clone();
        if let Item::Sample(sample) = &mut odd[100] {
            sample.position_m.x += 1e-3;
        }
        assert!(judge(&odd, bounded(4.9)).contradiction.is_some(), "{with_velocity}");
    }
}

#[test]
fn vehicles_on_two_clocks_are_refused() {
    const UNIX_S: f64 = 1.7e9;
    // Alpha and charlie use one clock, bravo at the same time another.
    let bravo = [10.0, 11.0, 12.0].map(|t| seen(1, t, [0.0, 1.0, 0.0]));
    let others =
        [0.0, 1.0, 2.0].map(|t| [seen(0, UNIX_S + t, [0.0; 3]), seen(2, UNIX_S + t, [0.0, 9.0, 0.0])]).concat();
    let items = [&bravo[..], &others].concat();
    let refused = audit(&names(3), &items, Settings::delta(2.0)).expect_err("bravo is on another clock");
    let RecordedError::TwoClocks { first, second, days } = refused else { panic!("{refused}") };
    assert_eq!((first.as_str(), second.as_str(), days), ("bravo", "alpha", 19_675));
    let only = Settings { only: Some(["alpha", "charlie"].map(str::to_owned).into()), ..Settings::delta(2.0) };
    assert_eq!(audit(&names(3), &items, only).expect("a verdict").status, Status::Clear);
    let set = VehicleSettings { offset_s: UNIX_S - 10.0, ..VehicleSettings::default() };
    let right = Settings { vehicles: [("bravo".to_owned(), set)].into(), ..Settings::delta(2.0) };
    assert_eq!(audit(&names(3), &items, right).map(|outcome| outcome.status), Ok(Status::Violation));
}

#[test]
fn a_vehicle_never_present_with_another_is_reported() {
    let later = |begin_s: f64| [seen(2, begin_s, [50.0, 0.0, 0.0]), seen(2, begin_s + 1.0, [50.0, 0.0, 0.0])];
    let judged = |begin_s: f64, only: Option<&[&str]>| {
        let mut items = [&side_by_side(0.0)[..], &later(begin_s)].concat();
        items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        let only = only.map(|names| names.iter().map(|&name| name.to_owned()).collect());
        audit(&names(3), &items, Settings { only, ..Settings::delta(0.5) }).expect("judged")
    };
    let end_s = side_by_side(0.0).last().expect("an item").time_s();
    for (begin_s, only, alone) in [
        (3600.0, None, &[2][..]),
        (3600.0, Some(&["alpha", "bravo"][..]), &[]),
        // Presence together for an instant is enough.
        (end_s, None, &[]),
        (-3600.0, None, &[2]),
    ] {
        let outcome = judged(begin_s, only);
        assert_eq!((outcome.status, &outcome.alone[..]), (Status::Clear, alone), "{begin_s} {only:?}");
    }
}
