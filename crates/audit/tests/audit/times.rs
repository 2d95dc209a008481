//! Times before zero, and gaps that somebody else is there at the edge of alone.

use nalgebra::Vector3;
use tautline_audit::Status;
use tautline_audit::recorded::{Interpolation, RecordedError, Settings, VehicleSettings, audit};
use tautline_core::track::{Item, Piece, Sample};

use crate::recorded::{asked, names, seen};

/// Two that fly side by side from a time on, ten times a second for 20 s, and are near each other in the second after it.
fn beside(begin_s: f64) -> Vec<Item> {
    let at = |k: u32| {
        let time_s = begin_s + 0.1 * f64::from(k);
        let apart_m = if k < 10 { 1.0 } else { 9.0 };
        [seen(0, time_s, [0.0, 0.0, f64::from(k)]), seen(1, time_s, [apart_m, 0.0, f64::from(k)])]
    };
    (0..200).flat_map(at).collect()
}

#[test]
fn it_does_not_matter_when_a_recording_begins() {
    for begin_s in [0.0, -50.0, -10.0, 1e6] {
        for offset_s in [0.0, -3.0, 3.0] {
            let set = || VehicleSettings { offset_s, ..VehicleSettings::default() };
            let vehicles = ["alpha", "bravo"].map(|name| (name.to_owned(), set())).into();
            let outcome = asked(&beside(begin_s), Settings { vehicles, ..Settings::delta(2.0) });
            let [found] = outcome.violations[..] else { panic!("{begin_s} {offset_s}: {outcome:?}") };
            assert_eq!((found.from_s, found.min_m), (begin_s + offset_s, 1.0));
            assert_eq!((outcome.segments, outcome.presence.iter().flatten().count()), (400, 2));
        }
    }
}

#[test]
fn a_gap_matters_where_somebody_is_there_within_it_and_not_at_its_edge() {
    // Alpha is not seen between 2 s and 5 s, and bravo until a time, or from one on.
    let with_bravo = |there: &dyn Fn(f64) -> bool| {
        let mut items = Vec::new();
        for k in 0..16 {
            let time_s = 0.5 * f64::from(k);
            if time_s <= 2.0 || time_s >= 5.0 {
                items.push(seen(0, time_s, [0.0; 3]));
            }
            if there(time_s) {
                items.push(seen(1, time_s, [9.0, 0.0, 0.0]));
            }
        }
        asked(&items, Settings::delta(2.0))
    };
    for (there, expected) in [
        (&(|t| t <= 2.0) as &dyn Fn(f64) -> bool, Status::Clear),
        (&|t| t >= 5.0, Status::Clear),
        (&|t| t <= 2.5, Status::Undecided),
        (&|t| t >= 4.5, Status::Undecided),
    ] {
        let outcome = with_bravo(there);
        assert_eq!(outcome.status, expected, "{:?}", outcome.gaps);
        assert_eq!(outcome.gaps.len(), usize::from(expected == Status::Undecided));
    }
}

/// A piece of a curve.
fn piece(vehicle: usize, [from_s, to_s]: [f64; 2], coefficients: &[[f64; 3]]) -> Item {
    Item::Piece(Piece { vehicle, from_s, to_s, coefficients: coefficients.iter().map(|&c| Vector3::from(c)).collect() })
}

#[test]
fn between_pieces_that_are_joined_a_vehicle_is_where_they_end_and_begin() {
    // Alpha stands, on pieces with 0.2 s between them, and bravo is nearest to it in the middle of that time.
    for (second_x, expected) in [(0.0, Status::Violation), (40.0, Status::Violation)] {
        let items = [
            piece(0, [0.0, 1.0], &[[0.0; 3]]),
            piece(1, [0.0, 2.2], &[[110.0, 1.0, 0.0], [-100.0, 0.0, 0.0]]),
            piece(0, [1.2, 2.2], &[[second_x, 0.0, 0.0]]),
        ];
        let joined = Settings { max_gap_s: Some(0.5), ..Settings::delta(2.0) };
        assert_eq!(asked(&items, joined).status, expected, "{second_x}");
        let apart = Settings { max_gap_s: Some(0.1), ..Settings::delta(2.0) };
        assert_eq!(asked(&items, apart).gaps.len(), 1);
    }
}

#[test]
fn a_curve_that_leads_beyond_what_can_be_judged_is_refused() {
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
        let outcome = asked(&items, bounded(4.9));
        assert_eq!((outcome.contradiction, outcome.status), (None, Status::Clear), "{with_velocity}");
        // One who is elsewhere in one sample needs some.
        let mut odd = items.clone();
        if let Item::Sample(sample) = &mut odd[100] {
            sample.position_m.x += 1e-3;
        }
        assert!(asked(&odd, bounded(4.9)).contradiction.is_some(), "{with_velocity}");
    }
}

#[test]
fn vehicles_on_two_clocks_are_refused_and_not_called_clear() {
    const UNIX_S: f64 = 1.7e9;
    // Alpha and charlie by one clock, bravo at the same time by another.
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
fn one_that_is_never_there_with_another_is_named() {
    let later = |begin_s: f64| [seen(2, begin_s, [50.0, 0.0, 0.0]), seen(2, begin_s + 1.0, [50.0, 0.0, 0.0])];
    let judged = |begin_s: f64, only: Option<&[&str]>| {
        let mut items = [&beside(0.0)[..], &later(begin_s)].concat();
        items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
        let only = only.map(|names| names.iter().map(|&name| name.to_owned()).collect());
        audit(&names(3), &items, Settings { only, ..Settings::delta(0.5) }).expect("judged")
    };
    let end_s = beside(0.0).last().expect("an item").time_s();
    for (begin_s, only, alone) in [
        (3600.0, None, &[2][..]),
        (3600.0, Some(&["alpha", "bravo"][..]), &[]),
        // For an instant is long enough.
        (end_s, None, &[]),
        (-3600.0, None, &[2]),
    ] {
        let outcome = judged(begin_s, only);
        assert_eq!((outcome.status, &outcome.alone[..]), (Status::Clear, alone), "{begin_s} {only:?}");
    }
}
