//! Exactness of verdicts on straight lines: compared with exact fractions, to the last bit.

use nalgebra::Vector3;
use tautline_audit::Status;
use tautline_audit::recorded::{Interpolation, Outcome, Settings, audit};

use crate::fractions::{Fraction, exact};
use crate::recorded::{judge, seen};
use crate::scenes::{Random, Tracks, exact_place, exact_squared, instants, items, scene};

/// Number of scenes by default, and with `TAUTLINE_LONG=1`.
const SCENES: u64 = 60;
const LONG_SCENES: u64 = 5000;

fn scenes() -> u64 {
    if std::env::var_os("TAUTLINE_LONG").is_some() { LONG_SCENES } else { SCENES }
}

fn judge_scene(tracks: &Tracks, settings: Settings) -> Outcome {
    let names: Vec<String> = (1..=tracks.len()).map(|k| k.to_string()).collect();
    let settings = Settings { max_gap_s: Some(f64::INFINITY), ..settings };
    audit(&names, &items(tracks), settings).expect("a scene can be judged")
}

/// Returns the exact square of the smallest distance of two vehicles in a window.
fn least_of(a: &[(f64, Vector3<f64>)], b: &[(f64, Vector3<f64>)], window_s: [f64; 2]) -> Option<Fraction> {
    let times_s = instants(a, b);
    let (first_s, last_s) = (times_s.first()?.max(window_s[0]), times_s.last()?.min(window_s[1]));
    let mut times_s: Vec<f64> = times_s.into_iter().filter(|time_s| (first_s..=last_s).contains(time_s)).collect();
    if first_s > last_s {
        return None;
    }
    times_s.extend([first_s, last_s]);
    times_s.sort_by(f64::total_cmp);
    let apart = |time_s: f64| {
        let (a, b) = (exact_place(a, time_s), exact_place(b, time_s));
        [0, 1, 2].map(|axis| &b[axis] - &a[axis])
    };
    times_s.windows(2).map(|two| exact_squared(&apart(two[0]), &apart(two[1]))).min()
}

fn least(tracks: &Tracks, window_s: [f64; 2]) -> Option<Fraction> {
    let pairs = (0..tracks.len()).flat_map(|i| (i + 1..tracks.len()).map(move |j| (i, j)));
    pairs.filter_map(|(i, j)| least_of(&tracks[i], &tracks[j], window_s)).min()
}

/// Checks that the smallest separation is the exact one rounded down, and that the verdict changes there.
fn check(number: u64, tracks: &Tracks, settings: &Settings, window_s: [f64; 2]) -> bool {
    let outcome = judge_scene(tracks, Settings { delta_m: Some(1e-3), ..settings.clone() });
    let (Some(squared), Some(found)) = (least(tracks, window_s), outcome.closest.first()) else {
        assert!(outcome.closest.is_empty(), "scene {number}");
        return false;
    };
    let (least_m, above_m) = (found.lower_m, found.lower_m.next_up());
    let square = |x: f64| exact(x) * exact(x);
    assert!(square(least_m) <= squared && squared < square(above_m), "scene {number}: {least_m:?}");
    if least_m > 0.0 {
        for (limit_m, status) in [(least_m, Status::Clear), (above_m, Status::Violation)] {
            let outcome = judge_scene(tracks, Settings { delta_m: Some(limit_m), ..settings.clone() });
            assert_eq!((outcome.status, outcome.parry.disagreements), (status, 0), "scene {number}: {limit_m:?}");
            assert!(outcome.violations.iter().all(|violation| violation.min_m < limit_m), "scene {number}");
        }
    }
    true
}

#[test]
fn the_verdict_changes_at_the_exact_smallest_separation() {
    let judged = (0..scenes())
        .filter(|&number| check(number, &scene(number), &Settings::default(), [f64::NEG_INFINITY, f64::INFINITY]));
    assert!(judged.count() as u64 > scenes() / 2);
}

#[test]
fn a_window_that_cuts_lines_is_judged_exactly() {
    let judged = (0..scenes()).filter(|&number| {
        let mut random = Random(number);
        let from_s = random.between(0.0, 0.7);
        let window_s = [from_s, from_s + random.between(0.0, 1.0)];
        let settings = Settings { from_s: Some(window_s[0]), until_s: Some(window_s[1]), ..Settings::default() };
        check(number, &scene(number), &settings, window_s)
    });
    assert!(judged.count() as u64 > scenes() / 4);
}

#[test]
fn nearly_constant_separations_are_compared_exactly() {
    // A grid in common motion: the separations of neighbours differ only by the rounding of positions.
    for shift_s in [0.0, 0.017] {
        let mut random = Random(7);
        let track = |k: u32, random: &mut Random| {
            let (row, column) = (f64::from(k / 7), f64::from(k % 7));
            let later_s = shift_s * f64::from(k % 3);
            let at = |step: u32, random: &mut Random| {
                let time_s = 0.1 * f64::from(step) + later_s;
                let noise = 1e-15 * (random.below(9) as f64 - 4.0);
                (time_s, Vector3::new(2.5 * column + 0.3 * time_s + noise, 2.5 * row, 10.0 + 0.7 * time_s))
            };
            (0..60).map(|step| at(step, random)).collect()
        };
        let tracks: Tracks = (0..42).map(|k| track(k, &mut random)).collect();
        assert!(check(0, &tracks, &Settings::default(), [f64::NEG_INFINITY, f64::INFINITY]));
    }
}

#[test]
fn a_separation_equal_to_the_limit_is_no_violation() {
    let clear = |items: &[_], limit_m: f64| {
        assert_eq!(judge(items, Settings::delta(limit_m)).status, Status::Clear, "{limit_m:?}");
        let above = judge(items, Settings::delta(limit_m.next_up()));
        assert_eq!(above.status, Status::Violation, "{limit_m:?}");
    };
    // Along the diagonal of a box with integer sides, from a million times as far.
    let scale = 2.0_f64.powi(20);
    let (aside, along) = ([2.0, 3.0, 6.0], [3.0, -2.0, 0.0].map(|x| x * scale));
    let past = |sign: f64| [0, 1, 2].map(|axis| aside[axis] + sign * along[axis]);
    clear(&[seen(0, 0.0, [0.0; 3]), seen(1, 0.0, past(-1.0)), seen(0, 1.0, [0.0; 3]), seen(1, 1.0, past(1.0))], 7.0);
    // Different sample times: at 1 s the vehicles differ by 0 m along x and 100 m along y.
    let items = [
        seen(0, 0.0, [0.0; 3]),
        seen(1, 0.5, [3.0, 100.0, 0.0]),
        seen(0, 3.0, [9.0, 0.0, 0.0]),
        seen(1, 3.5, [3.0, 100.0, 0.0]),
    ];
    clear(&items, 100.0);
    // A jump past a vehicle at rest.
    let held = |limit_m: f64| Settings { motion: Some(Interpolation::Hold), ..Settings::delta(limit_m) };
    let jump = [
        seen(0, 0.0, [-5.0, 0.0, 0.0]),
        seen(1, 0.0, [0.0, 0.3, 0.4]),
        seen(0, 1.0, [5.0, 0.0, 0.0]),
        seen(1, 1.0, [0.0, 0.3, 0.4]),
    ];
    // The doubles next to 0.3 and 0.4 give a separation that differs from 0.5 by 1e-17, less than the spacing of
    // doubles.
    let below = exact(0.3) * exact(0.3) + exact(0.4) * exact(0.4) < exact(0.25);
    let status = if below { Status::Violation } else { Status::Clear };
    assert_eq!(judge(&jump, held(0.5)).status, status);
    assert_eq!(judge(&jump, held(0.5_f64.next_up())).status, Status::Violation);
    assert_eq!(judge(&jump, held(0.5_f64.next_down())).status, Status::Clear);
}

#[test]
fn numbers_of_very_different_size_are_compared_exactly() {
    // 1e7 m in one step, and a limit of one millimetre that is missed by one unit in the last place.
    for (miss_m, status) in [(1e-3, Status::Clear), (1e-3_f64.next_down(), Status::Violation)] {
        let items = [
            seen(0, 0.0, [-1e7, 0.0, 0.0]),
            seen(1, 0.0, [1e7, miss_m, 0.0]),
            seen(0, 1.0, [1e7, 0.0, 0.0]),
            seen(1, 1.0, [-1e7, miss_m, 0.0]),
        ];
        assert_eq!(judge(&items, Settings::delta(1e-3)).status, status, "{miss_m:?}");
    }
    // Positions and times of very different exponents.
    let tiny = 3e-160;
    let items = [
        seen(0, 1e-60, [0.0; 3]),
        seen(1, 1e-60, [tiny, 1.0, 0.0]),
        seen(0, 1.0, [0.0; 3]),
        seen(1, 1.0, [tiny, 1.0, 0.0]),
    ];
    let outcome = judge(&items, Settings::delta(1.0));
    assert_eq!((outcome.status, outcome.closest[0].lower_m), (Status::Clear, 1.0));
    assert_eq!(judge(&items, Settings::delta(1.0_f64.next_up())).status, Status::Violation);
}
