//! Random curves whose distance touches a limit to within rounding, in the air and on the ground. The audit must end,
//! and must not contradict points on the curves.
//!
//! `TAUTLINE_FUZZ_CASES` sets the number of cases of each kind; the default is small.

use std::time::{Duration, Instant};

use nalgebra::Vector3;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use tautline_audit::Status;
use tautline_audit::recorded::{Outcome, Settings, WIDTH_M, audit};
use tautline_core::track::{Item, Piece};

use crate::recorded::names;

/// Default number of cases of each kind.
const CASES: u32 = 40;
/// Longer than a case takes on a slow and busy machine.
const MAX_DURATION: Duration = Duration::from_secs(10);
/// Number of points per common interval of two pieces.
const POINTS: u32 = 600;
/// Rounding of a point on a curve, relative to the sum of the sizes of its terms.
const ROUNDING: f64 = 1e-13;

fn cases() -> u32 {
    std::env::var("TAUTLINE_FUZZ_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(CASES)
}

/// Piece of a curve: duration \[s\] and coefficients.
type Polynomial = (f64, Vec<Vector3<f64>>);

/// Limit for two curves, and height at or below which they are on the ground.
#[derive(Clone, Copy, Debug)]
struct Limits {
    delta_m: f64,
    above_m: Option<f64>,
}

fn size() -> impl Strategy<Value = f64> {
    let odd = [0.0, -0.0, 0.5, 1.0, 1e-18, -1e-18, 1e-9, 1e-310, 1e9, -1e9, 1e30, 2.0_f64.powi(-53)];
    prop_oneof![8 => -10.0..10.0_f64, 2 => prop::sample::select(odd.to_vec())]
}

fn vector() -> impl Strategy<Value = Vector3<f64>> {
    [size(), size(), size()].prop_map(Vector3::from)
}

/// Returns the coefficients of the Bezier curve with these control points over a duration.
fn bezier(points: &[Vector3<f64>], duration_s: f64) -> Vec<Vector3<f64>> {
    let n = points.len() - 1;
    let mut differences = points.to_vec();
    let mut factor = 1.0;
    (0..=n)
        .map(|k| {
            let coefficient = differences[0] * factor;
            (0..n - k).for_each(|i| differences[i] = differences[i + 1] - differences[i]);
            factor *= (n - k) as f64 / ((k + 1) as f64 * duration_s);
            coefficient
        })
        .collect()
}

fn part() -> impl Strategy<Value = Polynomial> {
    let durations = prop_oneof![6 => 0.01..5.0_f64, 1 => prop::sample::select(vec![1.0, 1e-6, 1e6])];
    (durations, prop::collection::vec(vector(), 1..10), any::<bool>()).prop_map(|(duration_s, points, is_bezier)| {
        let coefficients = if is_bezier { bezier(&points, duration_s) } else { points };
        (duration_s, coefficients)
    })
}

fn at(coefficients: &[Vector3<f64>], t: f64) -> Vector3<f64> {
    coefficients.iter().rev().fold(Vector3::zeros(), |sum, c| sum * t + c)
}

/// Piece at its time: start \[s\], end \[s\] and coefficients.
type TimedPiece<'a> = (f64, f64, &'a [Vector3<f64>]);

/// Places pieces one after another; a piece too short to advance the time is left out.
fn timed_pieces(parts: &[Polynomial]) -> Vec<TimedPiece<'_>> {
    let mut timed_pieces: Vec<TimedPiece<'_>> = Vec::new();
    for (duration_s, coefficients) in parts {
        let from_s = timed_pieces.last().map_or(0.0, |before| before.1);
        if from_s + duration_s > from_s {
            timed_pieces.push((from_s, from_s + duration_s, coefficients));
        }
    }
    timed_pieces
}

/// Bounds of the smallest distance from points on two curves.
#[derive(Debug)]
#[expect(clippy::struct_field_names, reason = "all are lengths")]
struct Sampled {
    /// Smallest distance at a point, and a lower bound of all distances.
    closest_m: f64,
    lower_bound_m: f64,
    /// Smallest distance at points certainly above the height, and lower bound of distances at points that may be above
    /// it.
    closest_above_m: f64,
    lower_bound_above_m: f64,
    rounding_m: f64,
}

/// Samples both curves over every common interval of two pieces.
fn sampled(first: &[Polynomial], second: &[Polynomial], above_m: f64) -> Sampled {
    let (a, b) = (timed_pieces(first), timed_pieces(second));
    let sizes = |parts: &[Polynomial]| {
        let of = |(duration_s, coefficients): &Polynomial| {
            coefficients.iter().rev().fold(0.0, |sum, c| sum * duration_s + c.abs().sum())
        };
        parts.iter().map(of).fold(0.0, f64::max)
    };
    let rounding_m = ROUNDING * (sizes(first) + sizes(second)) + 2.0 * WIDTH_M;
    let mut found = Sampled {
        closest_m: f64::INFINITY,
        lower_bound_m: f64::INFINITY,
        closest_above_m: f64::INFINITY,
        lower_bound_above_m: f64::INFINITY,
        rounding_m,
    };
    for &(a_from, a_to, a) in &a {
        for &(b_from, b_to, b) in &b {
            let (from_s, to_s) = (a_from.max(b_from), a_to.min(b_to));
            // Jumps at one instant are swept from both positions before to both positions after.
            if from_s >= to_s {
                continue;
            }
            // Bound on the speed: the sum of the sizes of the terms of the velocity.
            let speed = |c: &[Vector3<f64>], length: f64| {
                c.iter().enumerate().skip(1).rev().fold(0.0, |sum, (k, c)| sum * length + c.norm() * k as f64)
            };
            let aside_m = (speed(a, a_to - a_from) + speed(b, b_to - b_from)) * (to_s - from_s) / f64::from(POINTS);
            for k in 0..=POINTS {
                let t = from_s + (to_s - from_s) * f64::from(k) / f64::from(POINTS);
                found.take([at(a, t - a_from), at(b, t - b_from)], aside_m, above_m);
            }
        }
    }
    found
}

impl Sampled {
    /// Adds a point of both curves. Distances up to the next point differ by less than `aside_m`.
    fn take(&mut self, [a, b]: [Vector3<f64>; 2], aside_m: f64, above_m: f64) {
        let distance_m = (b - a).norm();
        let (height_m, reach_m) = (a.z.max(b.z), aside_m + self.rounding_m);
        self.closest_m = self.closest_m.min(distance_m);
        self.lower_bound_m = self.lower_bound_m.min(distance_m - aside_m);
        if height_m > above_m + self.rounding_m {
            self.closest_above_m = self.closest_above_m.min(distance_m);
        }
        if height_m > above_m - reach_m {
            self.lower_bound_above_m = self.lower_bound_above_m.min(distance_m - aside_m);
        }
    }
}

fn items(first: &[Polynomial], second: &[Polynomial]) -> Vec<Item> {
    let of = |vehicle: usize, parts: &[Polynomial]| -> Vec<Item> {
        let piece = |(from_s, to_s, c): (f64, f64, &[Vector3<f64>])| {
            Item::Piece(Piece { vehicle, from_s, to_s, coefficients: c.to_vec() })
        };
        timed_pieces(parts).into_iter().map(piece).collect()
    };
    let mut items = [of(0, first), of(1, second)].concat();
    items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    items
}

/// Returns whether consecutive pieces join without a jump, so that points cover the whole motion.
fn is_continuous(parts: &[Polynomial], rounding_m: f64) -> bool {
    parts.windows(2).all(|pair| (at(&pair[0].1, pair[0].0) - pair[1].1[0]).norm() <= rounding_m)
}

/// Audits two curves and compares the verdict with points on them.
fn check_verdict(first: &[Polynomial], second: &[Polynomial], limits: Limits) -> Result<(), String> {
    let settings = Settings { above_m: limits.above_m, max_gap_s: Some(f64::MAX), ..Settings::delta(limits.delta_m) };
    let begin = Instant::now();
    let judged = audit(&names(2), &items(first, second), settings);
    if begin.elapsed() > MAX_DURATION {
        return Err(format!("it took {:?}", begin.elapsed()));
    }
    // Lengths out of range are refused.
    let Ok(outcome) = judged else { return Ok(()) };
    let found = sampled(first, second, limits.above_m.unwrap_or(f64::NEG_INFINITY));
    let is_continuous = [first, second].iter().all(|parts| is_continuous(parts, found.rounding_m));
    contradiction(&outcome, &found, limits, is_continuous)
        .map_or(Ok(()), |what| Err(format!("{what}: {found:?} {outcome:?}")))
}

fn contradiction(outcome: &Outcome, found: &Sampled, limits: Limits, is_continuous: bool) -> Option<&'static str> {
    let rounding_m = found.rounding_m;
    if outcome.status == Status::Clear && found.closest_above_m < limits.delta_m - rounding_m {
        return Some("clear, but below the limit at a point");
    }
    if outcome.status == Status::Violation && is_continuous && found.lower_bound_above_m > limits.delta_m + rounding_m {
        return Some("a violation, but above the limit at every point");
    }
    let closest = outcome.closest.first()?;
    if limits.above_m.is_none() && closest.lower_m > found.closest_m + rounding_m {
        return Some("the smallest distance is above that of a point");
    }
    if is_continuous && closest.upper_m < found.lower_bound_m - rounding_m {
        return Some("the smallest distance is below that of every point");
    }
    if outcome.violations.iter().any(|v| v.min_m >= v.limit_m || v.from_s > v.to_s) {
        return Some("an invalid violation");
    }
    None
}

/// Generates a factor of the distance, a relative offset, and an optional height.
fn limit_cases() -> impl Strategy<Value = (f64, f64, Option<f64>)> {
    let off =
        prop::sample::select(vec![0.0, 0.0, f64::EPSILON, -f64::EPSILON, 1e-12, -1e-12, 1e-9, -1e-9, 1e-3, -1e-3]);
    let height = prop_oneof![4 => Just(None), 3 => Just(Some(0.5)), 1 => size().prop_map(Some)];
    (prop_oneof![4 => Just(1.0), 1 => 0.1..3.0_f64], off, height)
}

fn check_cases(strategy: impl Strategy<Value = (Vec<Polynomial>, Vec<Polynomial>, f64, Option<f64>)>) {
    let config = Config { cases: cases(), failure_persistence: None, ..Config::default() };
    let done = TestRunner::new(config).run(&strategy, |(first, second, delta_m, above_m)| {
        // A limit in the accepted range.
        let delta_m = if (1e-60..1e60).contains(&delta_m) { delta_m } else { 1.0 };
        check_verdict(&first, &second, Limits { delta_m, above_m }).map_err(TestCaseError::fail)
    });
    if let Err(fault) = done {
        panic!("{fault}");
    }
}

#[test]
fn random_curves_match_points_on_them() {
    let parts = || prop::collection::vec(part(), 1..4);
    check_cases((parts(), parts(), limit_cases()).prop_map(|(first, second, (share, off, above_m))| {
        let closest_m = sampled(&first, &second, f64::NEG_INFINITY).closest_m;
        (first, second, closest_m * share * (1.0 + off), above_m)
    }));
}

#[test]
fn a_fall_within_the_last_digit_of_a_time_is_judged() {
    let still = |duration_s: f64| (duration_s, vec![Vector3::zeros()]);
    let (duration_s, speed) = (1.118_113_481_321_576, -8.943_636_014_638_072e29);
    let falls = (duration_s, vec![Vector3::z() * 1e30, Vector3::z() * speed]);
    let still = [still(0.639_789_898_891_851_6), still(3.522_182_792_088_384)];
    assert_eq!(check_verdict(&still, &[falls], Limits { delta_m: 1.0, above_m: None }), Ok(()));
}

#[test]
fn curves_that_touch_the_limit_match_points_on_them() {
    // Bravo flies like alpha, with an offset along x of the limit and a power of the time since the touch.
    let touch = (part(), 0.05..20.0_f64, 0.0..1.0_f64, 1..4_usize, -2.0..2.0_f64, limit_cases());
    check_cases(touch.prop_map(|((duration_s, own), limit_m, share, half, size, (_, off, above_m))| {
        let touch_s = share * duration_s;
        let mut powers = vec![1.0];
        for _ in 0..2 * half {
            let raised = (0..=powers.len()).map(|k| {
                let before = if k > 0 { powers[k - 1] } else { 0.0 };
                before - touch_s * powers.get(k).copied().unwrap_or(0.0)
            });
            powers = raised.collect();
        }
        let mut other = own.clone();
        other.resize(own.len().max(powers.len()), Vector3::zeros());
        other.iter_mut().zip(&powers).for_each(|(c, powers)| c.x += size * powers);
        other[0].x += limit_m;
        (vec![(duration_s, own)], vec![(duration_s, other)], limit_m * (1.0 + off), above_m)
    }));
}

#[test]
fn a_climb_below_rounding_ends_the_search() {
    let rise = prop::sample::select(vec![1e-18, -1e-18, 1e-30, 2.0_f64.powi(-53), 1e-12, 0.0]);
    let rises =
        (rise, prop::collection::vec(size(), 0..6), 0.1..3.0_f64, prop::sample::select(vec![0.0, 0.5, 1e-18, 1e9]));
    check_cases(rises.prop_map(|(rise, more, beside_m, above_m)| {
        let heights = [vec![above_m, rise], more].concat();
        let mut climbs: Vec<_> = heights.into_iter().map(|z| Vector3::new(0.0, 0.0, z)).collect();
        climbs.truncate(if beside_m < 1.0 { 2 } else { 8 });
        let stands = vec![Vector3::new(beside_m, 0.0, above_m)];
        (vec![(1.0, climbs)], vec![(1.0, stands)], 1.5, Some(above_m))
    }));
}

#[test]
fn a_wrong_verdict_is_detected() {
    let still = |x: f64| vec![(1.0, vec![Vector3::new(x, 0.0, 0.0)])];
    let (near, far) = (sampled(&still(0.0), &still(1.0), -1.0), sampled(&still(0.0), &still(3.0), -1.0));
    let limits = Limits { delta_m: 2.0, above_m: None };
    let judged = |x: f64| audit(&names(2), &items(&still(0.0), &still(x)), Settings::delta(2.0)).expect("judged");
    assert_eq!(contradiction(&judged(1.0), &near, limits, true), None);
    assert_eq!(contradiction(&judged(3.0), &far, limits, true), None);
    assert_eq!(contradiction(&judged(3.0), &near, limits, true), Some("clear, but below the limit at a point"));
    assert_eq!(
        contradiction(&judged(1.0), &far, limits, true),
        Some("a violation, but above the limit at every point")
    );
    let wide = Limits { delta_m: 0.5, ..limits };
    assert_eq!(contradiction(&judged(3.0), &near, wide, true), Some("the smallest distance is above that of a point"));
}
