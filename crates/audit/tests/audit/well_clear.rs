//! Well clear of air traffic in whole recordings.

use std::collections::BTreeSet;

use nalgebra::Vector3;
use tautline_audit::recorded::{Interpolation, Outcome, RecordedError, Settings, audit};
use tautline_audit::{Status, WellClear};
use tautline_core::option::WELL_CLEAR;
use tautline_core::track::{Item, Piece};

use super::recorded::{judge, seen};
use super::scenes::Random;

fn well_clear(of: WellClear) -> Settings {
    Settings { well_clear: Some(of), max_gap_s: Some(f64::INFINITY), ..Settings::default() }
}

/// Returns samples of vehicles on straight lines, every `step_s` up to `end_s`.
fn flights(of: &[([f64; 3], [f64; 3])], step_s: f64, end_s: f64) -> Vec<Item> {
    let mut items = Vec::new();
    let mut time_s = 0.0;
    while time_s <= end_s {
        items.extend(of.iter().enumerate().map(|(vehicle, (at, v))| {
            let at = Vector3::from(*at) + Vector3::from(*v) * time_s;
            seen(vehicle, time_s, at.into())
        }));
        time_s += step_s;
    }
    items
}

/// Head-on at 100 m/s from 20 km.
const HEAD_ON: [([f64; 3], [f64; 3]); 2] =
    [([0.0, 0.0, 100.0], [50.0, 0.0, 0.0]), ([20_000.0, 0.0, 100.0], [-50.0, 0.0, 0.0])];

fn status_of(outcome: &Outcome) -> Status {
    outcome.well_clear.as_ref().expect("well clear was asked").status
}

#[test]
fn a_loss_over_many_samples_is_one_finding() {
    let found = judge(&flights(&HEAD_ON, 1.0, 300.0), well_clear(WellClear::DO_365));
    let of = found.well_clear.as_ref().expect("well clear was asked");
    assert_eq!(
        (found.status, of.status, of.violations.len(), of.undecided.len()),
        (Status::Violation, Status::Violation, 1, 0)
    );
    // Closest after 200 s, half the chord 12.192 s.
    let lead_s = 17.5 + (17.5_f64 * 17.5 + 12.192 * 12.192).sqrt();
    let loss = of.violations[0];
    assert!((loss.from_s - (200.0 - lead_s)).abs() < 1e-6 && (loss.to_s - 212.192).abs() < 1e-6, "{loss:?}");
    assert!(loss.horizontal_m < 1e-6 && loss.vertical_m == 0.0);
    // Separations are not judged.
    assert_eq!((found.separation, found.closest.len()), (None, 0));
    // Up to 5 s before the distance is below D, the criterion of time alone is violated.
    let cut = Settings { until_s: Some(180.0), ..well_clear(WellClear::DO_365) };
    let cut = judge(&flights(&HEAD_ON, 1.0, 300.0), cut);
    let early = cut.well_clear.as_ref().expect("asked").violations[0];
    assert!(early.horizontal_m > 1.6 * WellClear::DO_365.horizontal_m, "{early:?}");
    let without = WellClear { tau_s: 0.0, ..WellClear::DO_365 };
    let cut = Settings { until_s: Some(180.0), ..well_clear(without) };
    assert_eq!(judge(&flights(&HEAD_ON, 1.0, 300.0), cut).status, Status::Clear);
}

#[test]
fn vertical_distance_keeps_well_clear_and_a_gap_is_undecided() {
    let above = |up_m: f64| {
        let mut flights = HEAD_ON;
        flights[1].0[2] += up_m;
        flights
    };
    assert_eq!(judge(&flights(&above(137.2), 1.0, 300.0), well_clear(WellClear::DO_365)).status, Status::Clear);
    assert_eq!(judge(&flights(&above(137.1), 1.0, 300.0), well_clear(WellClear::DO_365)).status, Status::Violation);
    let settings = Settings { max_gap_s: Some(5.0), ..well_clear(WellClear::DO_365) };
    let items = flights(&above(500.0), 1.0, 300.0);
    let with_gap: Vec<_> =
        items.into_iter().filter(|item| item.vehicle() == 0 || !(100.0..120.0).contains(&item.time_s())).collect();
    assert_eq!(judge(&with_gap, settings).status, Status::Undecided);
}

#[test]
fn no_pair_is_left_out_of_a_crowd() {
    let mut random = Random(3);
    let of: Vec<_> = (0..40)
        .map(|_| {
            let at = [random.between(-8e3, 8e3), random.between(-8e3, 8e3), random.between(0.0, 400.0)];
            (at, [random.between(-60.0, 60.0), random.between(-60.0, 60.0), random.between(-2.0, 2.0)])
        })
        .collect();
    let names: Vec<_> = (0..of.len()).map(|k| k.to_string()).collect();
    let items = flights(&of, 2.0, 300.0);
    let found = audit(&names, &items, well_clear(WellClear::DO_365)).expect("a verdict").well_clear.expect("asked");
    let pairs: BTreeSet<_> = found.violations.iter().map(|of| (of.pair.first(), of.pair.second())).collect();
    let mut expected = BTreeSet::new();
    for first in 0..of.len() {
        for second in first + 1..of.len() {
            let two = flights(&[of[first], of[second]], 300.0, 300.0);
            let found = judge(&two, well_clear(WellClear::DO_365));
            if status_of(&found) == Status::Violation {
                expected.insert((first, second));
            }
        }
    }
    assert!(expected.len() > 20);
    assert_eq!(pairs, expected);
}

#[test]
fn curves_are_judged_by_their_own_velocities() {
    let piece = |vehicle: usize, c: &[[f64; 3]]| {
        let coefficients = c.iter().map(|c| Vector3::from(*c)).collect();
        Item::Piece(Piece { vehicle, from_s: 0.0, to_s: 300.0, coefficients })
    };
    // The same head-on flight, and one that brakes to a stop 2,500 m before the other: tau never is below T.
    let straight = [piece(0, &[[0.0; 3]]), piece(1, &[[20_000.0, 0.0, 0.0], [-100.0, 0.0, 0.0], [0.0, 0.0, 1e-9]])];
    let found = judge(&straight, well_clear(WellClear::DO_365));
    let loss = found.well_clear.as_ref().expect("asked").violations[0];
    let lead_s = 17.5 + (17.5_f64 * 17.5 + 12.192 * 12.192).sqrt();
    assert!((loss.from_s - (200.0 - lead_s)).abs() < 1e-3 && (loss.to_s - 212.192).abs() < 1e-3, "{loss:?}");
    let brakes =
        [piece(0, &[[0.0; 3]]), piece(1, &[[20_000.0, 0.0, 0.0], [-350.0 / 3.0, 0.0, 0.0], [17.5 / 90.0, 0.0, 0.0]])];
    assert_eq!(judge(&brakes, well_clear(WellClear::DO_365)).status, Status::Clear);
    // Braking to 1,000 m is lost.
    let late =
        [piece(0, &[[0.0; 3]]), piece(1, &[[20_000.0, 0.0, 0.0], [-380.0 / 3.0, 0.0, 0.0], [19.0 / 90.0, 0.0, 0.0]])];
    assert_eq!(judge(&late, well_clear(WellClear::DO_365)).status, Status::Violation);
}

#[test]
fn thresholds_and_motions_out_of_range_are_refused() {
    let refused = |settings: Settings| audit(&[], &[], settings).expect_err("refused");
    for of in [
        WellClear { horizontal_m: 0.0, ..WellClear::F3442 },
        WellClear { vertical_m: -1.0, ..WellClear::F3442 },
        WellClear { tau_s: f64::NAN, ..WellClear::F3442 },
    ] {
        assert!(matches!(refused(well_clear(of)), RecordedError::OutOfRange { option: WELL_CLEAR, .. }));
    }
    for motion in [Interpolation::Hold, Interpolation::Bounded] {
        let settings = Settings { motion: Some(motion), ..well_clear(WellClear::F3442) };
        assert!(matches!(refused(settings), RecordedError::WellClearMotion { .. }));
    }
}
