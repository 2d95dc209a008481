//! Random curves whose distance touches a limit to within rounding, of any size, on the ground and off it: the judge ends,
//! and never says the opposite of what places on the curves say.
//!
//! The cases are few by default; `TAUTLINE_FUZZ_CASES` sets how many there are of each kind.

use std::time::{Duration, Instant};

use nalgebra::Vector3;
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use tautline_audit::Status;
use tautline_audit::recorded::{Outcome, Settings, WIDTH_M, audit};
use tautline_core::track::{Item, Piece};

use crate::recorded::names;

/// Cases of each kind where nobody says otherwise.
const CASES: u32 = 40;
/// Longer than a case takes, on a slow and busy machine.
const PATIENCE: Duration = Duration::from_secs(10);
/// Points of a stretch that two curves share, and on a jump.
const PLACES: u32 = 600;
/// Rounding of a place on a curve, relative to the sum of the sizes of its terms.
const ROUNDING: f64 = 1e-13;

fn cases() -> u32 {
    std::env::var("TAUTLINE_FUZZ_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(CASES)
}

/// A piece of a curve: how long it lasts, and its coefficients.
type Part = (f64, Vec<Vector3<f64>>);

/// What is asked of two curves: a limit, and a height at or below which nothing is.
#[derive(Clone, Copy, Debug)]
struct Asked {
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

/// The Bezier curve of these points over a duration as coefficients of the powers of time.
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

fn part() -> impl Strategy<Value = Part> {
    let durations = prop_oneof![6 => 0.01..5.0_f64, 1 => prop::sample::select(vec![1.0, 1e-6, 1e6])];
    (durations, prop::collection::vec(vector(), 1..10), any::<bool>()).prop_map(|(duration_s, points, is_bezier)| {
        let coefficients = if is_bezier { bezier(&points, duration_s) } else { points };
        (duration_s, coefficients)
    })
}

fn at(coefficients: &[Vector3<f64>], t: f64) -> Vector3<f64> {
    coefficients.iter().rev().fold(Vector3::zeros(), |sum, c| sum * t + c)
}

/// A piece in its place: from when to when, and its coefficients.
type Placed<'a> = (f64, f64, &'a [Vector3<f64>]);

/// Pieces that follow each other; one too short to take time is left out.
fn placed(parts: &[Part]) -> Vec<Placed<'_>> {
    let mut placed: Vec<Placed<'_>> = Vec::new();
    for (duration_s, coefficients) in parts {
        let from_s = placed.last().map_or(0.0, |before| before.1);
        if from_s + duration_s > from_s {
            placed.push((from_s, from_s + duration_s, coefficients));
        }
    }
    placed
}

/// What places on two curves say of them.
#[derive(Debug)]
#[expect(clippy::struct_field_names, reason = "all are lengths")]
struct Sampled {
    /// The smallest distance at a place, and one that no distance is below.
    most_m: f64,
    least_m: f64,
    /// The same of places where one of them is above the height for certain, and of those where one may be.
    most_above_m: f64,
    least_above_m: f64,
    rounding_m: f64,
}

/// Looks at places along both: on every stretch that two pieces share, and on every jump.
fn sampled(first: &[Part], second: &[Part], above_m: f64) -> Sampled {
    let (a, b) = (placed(first), placed(second));
    let sizes = |parts: &[Part]| {
        let of = |(duration_s, coefficients): &Part| {
            coefficients.iter().rev().fold(0.0, |sum, c| sum * duration_s + c.abs().sum())
        };
        parts.iter().map(of).fold(0.0, f64::max)
    };
    let rounding_m = ROUNDING * (sizes(first) + sizes(second)) + 2.0 * WIDTH_M;
    let mut found = Sampled {
        most_m: f64::INFINITY,
        least_m: f64::INFINITY,
        most_above_m: f64::INFINITY,
        least_above_m: f64::INFINITY,
        rounding_m,
    };
    for &(a_from, a_to, a) in &a {
        for &(b_from, b_to, b) in &b {
            let (from_s, to_s) = (a_from.max(b_from), a_to.min(b_to));
            // At an instant that two jump at they are swept together, from where both were to where both are.
            if from_s >= to_s {
                continue;
            }
            // No faster than the sum of the sizes of the terms of the velocity.
            let speed = |c: &[Vector3<f64>], length: f64| {
                c.iter().enumerate().skip(1).rev().fold(0.0, |sum, (k, c)| sum * length + c.norm() * k as f64)
            };
            let aside_m = (speed(a, a_to - a_from) + speed(b, b_to - b_from)) * (to_s - from_s) / f64::from(PLACES);
            for k in 0..=PLACES {
                let t = from_s + (to_s - from_s) * f64::from(k) / f64::from(PLACES);
                found.take([at(a, t - a_from), at(b, t - b_from)], aside_m, above_m);
            }
        }
    }
    found
}

impl Sampled {
    /// Takes where both are at a place; within half of `aside_m` of it there are no others.
    fn take(&mut self, [a, b]: [Vector3<f64>; 2], aside_m: f64, above_m: f64) {
        let distance_m = (b - a).norm();
        let (height_m, reach_m) = (a.z.max(b.z), aside_m + self.rounding_m);
        self.most_m = self.most_m.min(distance_m);
        self.least_m = self.least_m.min(distance_m - aside_m);
        if height_m > above_m + self.rounding_m {
            self.most_above_m = self.most_above_m.min(distance_m);
        }
        if height_m > above_m - reach_m {
            self.least_above_m = self.least_above_m.min(distance_m - aside_m);
        }
    }
}

fn items(first: &[Part], second: &[Part]) -> Vec<Item> {
    let of = |vehicle: usize, parts: &[Part]| -> Vec<Item> {
        let piece = |(from_s, to_s, c): (f64, f64, &[Vector3<f64>])| {
            Item::Piece(Piece { vehicle, from_s, to_s, coefficients: c.to_vec() })
        };
        placed(parts).into_iter().map(piece).collect()
    };
    let mut items = [of(0, first), of(1, second)].concat();
    items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    items
}

/// Whether pieces join without a jump, so that places between them tell everything.
fn is_continuous(parts: &[Part], rounding_m: f64) -> bool {
    parts.windows(2).all(|pair| (at(&pair[0].1, pair[0].0) - pair[1].1[0]).norm() <= rounding_m)
}

/// Judges two curves and compares the verdict with what places on them say.
fn agree(first: &[Part], second: &[Part], asked: Asked) -> Result<(), String> {
    let settings = Settings { above_m: asked.above_m, max_gap_s: Some(f64::MAX), ..Settings::delta(asked.delta_m) };
    let begin = Instant::now();
    let judged = audit(&names(2), &items(first, second), settings);
    if begin.elapsed() > PATIENCE {
        return Err(format!("it took {:?}", begin.elapsed()));
    }
    // Beyond the range of lengths it is refused.
    let Ok(outcome) = judged else { return Ok(()) };
    let found = sampled(first, second, asked.above_m.unwrap_or(f64::NEG_INFINITY));
    let is_continuous = [first, second].iter().all(|parts| is_continuous(parts, found.rounding_m));
    contradiction(&outcome, &found, asked, is_continuous)
        .map_or(Ok(()), |what| Err(format!("{what}: {found:?} {outcome:?}")))
}

fn contradiction(outcome: &Outcome, found: &Sampled, asked: Asked, is_continuous: bool) -> Option<&'static str> {
    let rounding_m = found.rounding_m;
    if outcome.status == Status::Clear && found.most_above_m < asked.delta_m - rounding_m {
        return Some("clear, and too close at a place");
    }
    if outcome.status == Status::Violation && is_continuous && found.least_above_m > asked.delta_m + rounding_m {
        return Some("a violation, and far apart at every place");
    }
    let closest = outcome.closest.first()?;
    if asked.above_m.is_none() && closest.lower_m > found.most_m + rounding_m {
        return Some("never as close as at a place");
    }
    if is_continuous && closest.upper_m < found.least_m - rounding_m {
        return Some("closer than at any place");
    }
    if outcome.violations.iter().any(|v| v.min_m >= v.limit_m || v.from_s > v.to_s) {
        return Some("a violation that is none");
    }
    None
}

/// What is asked: a share of a distance, off by a few units in its last place or by a bit more, perhaps above a height.
fn asked() -> impl Strategy<Value = (f64, f64, Option<f64>)> {
    let off =
        prop::sample::select(vec![0.0, 0.0, f64::EPSILON, -f64::EPSILON, 1e-12, -1e-12, 1e-9, -1e-9, 1e-3, -1e-3]);
    let height = prop_oneof![4 => Just(None), 3 => Just(Some(0.5)), 1 => size().prop_map(Some)];
    (prop_oneof![4 => Just(1.0), 1 => 0.1..3.0_f64], off, height)
}

fn each(strategy: impl Strategy<Value = (Vec<Part>, Vec<Part>, f64, Option<f64>)>) {
    let config = Config { cases: cases(), failure_persistence: None, ..Config::default() };
    let done = TestRunner::new(config).run(&strategy, |(first, second, delta_m, above_m)| {
        // A limit that can be judged.
        let delta_m = if (1e-60..1e60).contains(&delta_m) { delta_m } else { 1.0 };
        agree(&first, &second, Asked { delta_m, above_m }).map_err(TestCaseError::fail)
    });
    if let Err(fault) = done {
        panic!("{fault}");
    }
}

#[test]
fn any_two_curves_are_judged_as_places_on_them_say() {
    let parts = || prop::collection::vec(part(), 1..4);
    each((parts(), parts(), asked()).prop_map(|(first, second, (share, off, above_m))| {
        let most_m = sampled(&first, &second, f64::NEG_INFINITY).most_m;
        (first, second, most_m * share * (1.0 + off), above_m)
    }));
}

#[test]
fn one_that_comes_near_in_the_last_place_of_a_time_is_near_from_then_on_and_not_until_before() {
    let still = |duration_s: f64| (duration_s, vec![Vector3::zeros()]);
    let (duration_s, speed) = (1.118_113_481_321_576, -8.943_636_014_638_072e29);
    let falls = (duration_s, vec![Vector3::z() * 1e30, Vector3::z() * speed]);
    let still = [still(0.639_789_898_891_851_6), still(3.522_182_792_088_384)];
    assert_eq!(agree(&still, &[falls], Asked { delta_m: 1.0, above_m: None }), Ok(()));
}

#[test]
fn two_whose_distance_touches_the_limit_are_judged_as_places_on_them_say() {
    // Bravo flies like alpha, aside by the limit and a power of the time from when they touch.
    let touch = (part(), 0.05..20.0_f64, 0.0..1.0_f64, 1..4_usize, -2.0..2.0_f64, asked());
    each(touch.prop_map(|((duration_s, own), limit_m, share, half, size, (_, off, above_m))| {
        let touch_s = share * duration_s;
        let mut grows = vec![1.0];
        for _ in 0..2 * half {
            let raised = (0..=grows.len()).map(|k| {
                let before = if k > 0 { grows[k - 1] } else { 0.0 };
                before - touch_s * grows.get(k).copied().unwrap_or(0.0)
            });
            grows = raised.collect();
        }
        let mut other = own.clone();
        other.resize(own.len().max(grows.len()), Vector3::zeros());
        other.iter_mut().zip(&grows).for_each(|(c, grows)| c.x += size * grows);
        other[0].x += limit_m;
        (vec![(duration_s, own)], vec![(duration_s, other)], limit_m * (1.0 + off), above_m)
    }));
}

#[test]
fn one_who_leaves_the_ground_by_less_than_rounding_ends_the_search() {
    let rise = prop::sample::select(vec![1e-18, -1e-18, 1e-30, 2.0_f64.powi(-53), 1e-12, 0.0]);
    let rises =
        (rise, prop::collection::vec(size(), 0..6), 0.1..3.0_f64, prop::sample::select(vec![0.0, 0.5, 1e-18, 1e9]));
    each(rises.prop_map(|(rise, more, beside_m, above_m)| {
        let heights = [vec![above_m, rise], more].concat();
        let mut climbs: Vec<_> = heights.into_iter().map(|z| Vector3::new(0.0, 0.0, z)).collect();
        climbs.truncate(if beside_m < 1.0 { 2 } else { 8 });
        let stands = vec![Vector3::new(beside_m, 0.0, above_m)];
        (vec![(1.0, climbs)], vec![(1.0, stands)], 1.5, Some(above_m))
    }));
}

#[test]
fn places_say_it_where_a_verdict_is_wrong() {
    let still = |x: f64| vec![(1.0, vec![Vector3::new(x, 0.0, 0.0)])];
    let (near, far) = (sampled(&still(0.0), &still(1.0), -1.0), sampled(&still(0.0), &still(3.0), -1.0));
    let asked = Asked { delta_m: 2.0, above_m: None };
    let judged = |x: f64| audit(&names(2), &items(&still(0.0), &still(x)), Settings::delta(2.0)).expect("judged");
    assert_eq!(contradiction(&judged(1.0), &near, asked, true), None);
    assert_eq!(contradiction(&judged(3.0), &far, asked, true), None);
    assert_eq!(contradiction(&judged(3.0), &near, asked, true), Some("clear, and too close at a place"));
    assert_eq!(contradiction(&judged(1.0), &far, asked, true), Some("a violation, and far apart at every place"));
    let wide = Asked { delta_m: 0.5, ..asked };
    assert_eq!(contradiction(&judged(3.0), &near, wide, true), Some("never as close as at a place"));
}
