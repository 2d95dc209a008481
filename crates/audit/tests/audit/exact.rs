//! Verdicts on straight lines are exact about the doubles of the recording: held against fractions, to the last bit.

use nalgebra::Vector3;
use num_rational::BigRational;
use tautline_audit::Status;
use tautline_audit::recorded::{Interpolation, Outcome, Settings, audit};

use crate::recorded::{asked, seen};
use crate::scenes::{Random, Tracks, exact, exact_place, exact_squared, instants, items, scene};

/// Scenes by default, and with `TAUTLINE_LONG=1`.
const SCENES: u64 = 60;
const LONG_SCENES: u64 = 5000;

fn scenes() -> u64 {
    if std::env::var_os("TAUTLINE_LONG").is_some() { LONG_SCENES } else { SCENES }
}

fn judged(tracks: &Tracks, settings: Settings) -> Outcome {
    let names: Vec<String> = (1..=tracks.len()).map(|k| k.to_string()).collect();
    let settings = Settings { max_gap_s: Some(f64::INFINITY), ..settings };
    audit(&names, &items(tracks), settings).expect("a scene can be judged")
}

/// The exact square of the smallest distance of two vehicles in a window.
fn least_of(a: &[(f64, Vector3<f64>)], b: &[(f64, Vector3<f64>)], window_s: [f64; 2]) -> Option<BigRational> {
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

fn least(tracks: &Tracks, window_s: [f64; 2]) -> Option<BigRational> {
    let pairs = (0..tracks.len()).flat_map(|i| (i + 1..tracks.len()).map(move |j| (i, j)));
    pairs.filter_map(|(i, j)| least_of(&tracks[i], &tracks[j], window_s)).min()
}

/// Whether the smallest separation is the largest double that is not above the exact one, and the verdict turns there.
fn check(number: u64, tracks: &Tracks, settings: &Settings, window_s: [f64; 2]) -> bool {
    let outcome = judged(tracks, Settings { delta_m: Some(1e-3), ..settings.clone() });
    let (Some(squared), Some(found)) = (least(tracks, window_s), outcome.closest.first()) else {
        assert!(outcome.closest.is_empty(), "scene {number}");
        return false;
    };
    let (least_m, above_m) = (found.lower_m, found.lower_m.next_up());
    let square = |x: f64| exact(x) * exact(x);
    assert!(square(least_m) <= squared && squared < square(above_m), "scene {number}: {least_m:?}");
    if least_m > 0.0 {
        for (limit_m, status) in [(least_m, Status::Clear), (above_m, Status::Violation)] {
            let outcome = judged(tracks, Settings { delta_m: Some(limit_m), ..settings.clone() });
            assert_eq!((outcome.status, outcome.parry.disagreements), (status, 0), "scene {number}: {limit_m:?}");
            assert!(outcome.violations.iter().all(|violation| violation.min_m < limit_m), "scene {number}");
        }
    }
    true
}

#[test]
fn the_verdict_turns_at_the_smallest_separation_to_the_last_bit() {
    let judged = (0..scenes())
        .filter(|&number| check(number, &scene(number), &Settings::default(), [f64::NEG_INFINITY, f64::INFINITY]));
    assert!(judged.count() as u64 > scenes() / 2);
}

#[test]
fn a_window_that_cuts_lines_is_judged_exactly_too() {
    let judged = (0..scenes()).filter(|&number| {
        let mut random = Random(number);
        let from_s = random.between(0.0, 0.7);
        let window_s = [from_s, from_s + random.between(0.0, 1.0)];
        let settings = Settings { from_s: Some(window_s[0]), to_s: Some(window_s[1]), ..Settings::default() };
        check(number, &scene(number), &settings, window_s)
    });
    assert!(judged.count() as u64 > scenes() / 4);
}

#[test]
fn vehicles_side_by_side_are_as_near_as_at_their_nearest_sample_of_thousands() {
    // A grid that flies together: neighbours are as far apart all the time but for the rounding of their positions.
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
fn equality_is_no_violation_wherever_the_digits_lie() {
    let clear = |items: &[_], limit_m: f64| {
        assert_eq!(asked(items, Settings::delta(limit_m)).status, Status::Clear, "{limit_m:?}");
        let above = asked(items, Settings::delta(limit_m.next_up()));
        assert_eq!(above.status, Status::Violation, "{limit_m:?}");
    };
    // Along the diagonal of a box with whole sides, from a million times as far.
    let scale = 2.0_f64.powi(20);
    let (aside, along) = ([2.0, 3.0, 6.0], [3.0, -2.0, 0.0].map(|x| x * scale));
    let past = |sign: f64| [0, 1, 2].map(|axis| aside[axis] + sign * along[axis]);
    clear(&[seen(0, 0.0, [0.0; 3]), seen(1, 0.0, past(-1.0)), seen(0, 1.0, [0.0; 3]), seen(1, 1.0, past(1.0))], 7.0);
    // Seen at other times: at a third of the way of one and a half of the other they are 3, 4 and 0 m apart.
    let items = [
        seen(0, 0.0, [0.0; 3]),
        seen(1, 0.5, [3.0, 100.0, 0.0]),
        seen(0, 3.0, [9.0, 0.0, 0.0]),
        seen(1, 3.5, [3.0, 100.0, 0.0]),
    ];
    clear(&items, 100.0);
    // A jump past one that rests.
    let held = |limit_m: f64| Settings { motion: Some(Interpolation::Hold), ..Settings::delta(limit_m) };
    let jump = [
        seen(0, 0.0, [-5.0, 0.0, 0.0]),
        seen(1, 0.0, [0.0, 0.3, 0.4]),
        seen(0, 1.0, [5.0, 0.0, 0.0]),
        seen(1, 1.0, [0.0, 0.3, 0.4]),
    ];
    // The doubles next to 0.3 and 0.4: less than 0.5 apart by 1e-17, which no double of that size shows.
    let below = exact(0.3) * exact(0.3) + exact(0.4) * exact(0.4) < exact(0.25);
    let status = if below { Status::Violation } else { Status::Clear };
    assert_eq!(asked(&jump, held(0.5)).status, status);
    assert_eq!(asked(&jump, held(0.5_f64.next_up())).status, Status::Violation);
    assert_eq!(asked(&jump, held(0.5_f64.next_down())).status, Status::Clear);
}

#[test]
fn two_far_apart_in_size_are_told_apart() {
    // 1e7 m of way within a step, and a limit of a millimetre that is missed by a unit in its last place.
    for (miss_m, status) in [(1e-3, Status::Clear), (1e-3_f64.next_down(), Status::Violation)] {
        let items = [
            seen(0, 0.0, [-1e7, 0.0, 0.0]),
            seen(1, 0.0, [1e7, miss_m, 0.0]),
            seen(0, 1.0, [1e7, 0.0, 0.0]),
            seen(1, 1.0, [-1e7, miss_m, 0.0]),
        ];
        assert_eq!(asked(&items, Settings::delta(1e-3)).status, status, "{miss_m:?}");
    }
    // Positions and times of very different exponents.
    let tiny = 3e-160;
    let items = [
        seen(0, 1e-60, [0.0; 3]),
        seen(1, 1e-60, [tiny, 1.0, 0.0]),
        seen(0, 1.0, [0.0; 3]),
        seen(1, 1.0, [tiny, 1.0, 0.0]),
    ];
    let outcome = asked(&items, Settings::delta(1.0));
    assert_eq!((outcome.status, outcome.closest[0].lower_m), (Status::Clear, 1.0));
    assert_eq!(asked(&items, Settings::delta(1.0_f64.next_up())).status, Status::Violation);
}
