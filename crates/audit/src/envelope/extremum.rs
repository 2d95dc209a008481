//! Enclosure of the largest value of a quantity over a polynomial, and of mean accelerations over windows of one length.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, VecDeque};

use nalgebra::Vector3;

use super::limit::Quantity;
use crate::polynomial::{BernsteinBasis, rescale, value};
use crate::sweep::Interval;

/// Parts of a polynomial that are looked at.
const MOST_PARTS: usize = 2000;
/// Part of what counts as exceeding that both bounds are brought together to.
pub(super) const WIDTH: f64 = 0.25;

/// The largest value over a stretch of motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Enclosure {
    /// It is at least this,
    pub(super) lower: f64,
    /// and at most this.
    pub(super) upper: f64,
    /// Where the lower bound is reached, as a fraction of the stretch.
    pub(super) at: f64,
}

/// A value over an interval of which it is the extreme, turned so that it must not exceed its bound.
pub(super) type Found = (Interval, Enclosure);

/// What the largest value is brought to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Goal {
    /// A value that was reached before: of one that is not above it, it is only shown to be no larger.
    pub(super) known: f64,
    /// What must not be exceeded.
    pub(super) bound: f64,
    /// How near both bounds are brought to each other,
    pub(super) width: f64,
    /// and how near where the value is below what must not be exceeded, as a part of how far.
    pub(super) coarse: f64,
}

/// A part of a polynomial by what it is at most.
struct Part {
    most: f64,
    start: f64,
    length: f64,
}

/// A polynomial over the fractions from 0 to 1 by what is asked of its parts: the value at their start, at their end, and
/// what it is at most in between. The part that may be largest is halved first.
pub(super) fn largest(
    c: &[Vector3<f64>],
    goal: Goal,
    ask: impl Fn(&[Vector3<f64>], &BernsteinBasis) -> [f64; 3],
) -> Enclosure {
    let Goal { known, bound, width, coarse } = goal;
    let basis = BernsteinBasis::of_degree(c.len().saturating_sub(1));
    let rounding = 4.0 * c.len() as f64 * f64::EPSILON * c.iter().map(Vector3::norm).sum::<f64>();
    let mut found = Enclosure { lower: f64::NEG_INFINITY, upper: f64::NEG_INFINITY, at: 0.0 };
    let look = |start: f64, length: f64, found: &mut Enclosure| {
        let mut part = c.to_vec();
        rescale(&mut part, start, length);
        let [at_start, at_end, most] = ask(&part, &basis);
        for (reached, at) in [(at_start, start), (at_end, start + length)] {
            if reached > found.lower {
                (found.lower, found.at) = (reached, at);
            }
        }
        Part { most, start, length }
    };
    let (mut open, mut looked_at) = (BinaryHeap::from([look(0.0, 1.0, &mut found)]), 1);
    while let Some(Part { most, start, length }) = open.pop() {
        let is_near = most <= found.lower.max(known) + width;
        let is_below = most <= bound && most - found.lower <= coarse * (bound - most);
        if is_near || is_below || looked_at >= MOST_PARTS {
            // No other part is larger.
            found.upper = most;
            break;
        }
        let half = 0.5 * length;
        open.extend([start, start + half].map(|start| look(start, half, &mut found)));
        looked_at += 2;
    }
    Enclosure { lower: found.lower - rounding, upper: found.upper.max(found.lower) + rounding, ..found }
}

impl Ord for Part {
    fn cmp(&self, other: &Self) -> Ordering {
        self.most.total_cmp(&other.most).then(other.start.total_cmp(&self.start))
    }
}

impl PartialOrd for Part {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Part {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Part {}

/// The largest value of a quantity of a polynomial, which is a convex function of it.
pub(super) fn largest_of(quantity: Quantity, c: &[Vector3<f64>], goal: Goal) -> Enclosure {
    largest(c, goal, |part, basis| {
        let most = basis.points(part).map(|point| quantity.of(point)).fold(f64::NEG_INFINITY, f64::max);
        [quantity.of(part[0]), quantity.of(value(part, 1.0)), most]
    })
}

/// The derivative by time of a polynomial of the fraction of a stretch so long \[s\]; at least a constant.
pub(super) fn derivative(c: &[Vector3<f64>], length_s: f64) -> Vec<Vector3<f64>> {
    let rates: Vec<_> = c.iter().enumerate().skip(1).map(|(k, c)| c * (k as f64 / length_s)).collect();
    if rates.is_empty() { vec![Vector3::zeros()] } else { rates }
}

/// A velocity over a time.
#[derive(Clone, Debug)]
pub(super) struct Velocity {
    pub(super) over: Interval,
    /// Coefficients in powers of the fraction of that time \[m/s\], at least one.
    pub(super) coefficients: Vec<Vector3<f64>>,
    /// How much of it the last digits of places explain \[m/s\].
    pub(super) rounding_m_s: f64,
}

/// The velocity of a vehicle over the last window.
#[derive(Clone, Debug, Default)]
pub(super) struct MeanAcceleration {
    recent: VecDeque<Velocity>,
}

impl MeanAcceleration {
    /// Forgets everything: nothing is known of the time before what comes next.
    pub(super) fn restart(&mut self) {
        self.recent.clear();
    }

    /// Takes the velocity that follows, and tells the largest mean accelerations over windows of length `length_s` that end in its
    /// time and lie in `within`.
    pub(super) fn take(&mut self, next: Velocity, length_s: f64, within: Interval, goal: Goal) -> Vec<Found> {
        let needed_from_s = next.over.from_s - length_s;
        while self.recent.front().is_some_and(|first| first.over.to_s <= needed_from_s) {
            self.recent.pop_front();
        }
        self.recent.push_back(next);
        let Some(last) = self.recent.back() else { return Vec::new() };
        let begin_in_time = |first: &&Velocity| first.over.from_s < last.over.to_s - length_s;
        let firsts = self.recent.iter().take_while(begin_in_time);
        firsts.filter_map(|first| between(first, last, length_s, within, goal)).collect()
    }
}

/// Over windows that begin in the time of one velocity and end in that of another.
fn between(first: &Velocity, last: &Velocity, length_s: f64, within: Interval, goal: Goal) -> Option<Found> {
    let from_s = first.over.from_s.max(last.over.from_s - length_s).max(within.from_s);
    let to_s = first.over.to_s.min(last.over.to_s - length_s).min(within.to_s - length_s);
    if from_s >= to_s {
        return None;
    }
    let (start, end) = (first.part(from_s, to_s), last.part(from_s + length_s, to_s + length_s));
    let zero = Vector3::zeros();
    let change = |k: usize| (end.get(k).unwrap_or(&zero) - start.get(k).unwrap_or(&zero)) / length_s;
    let change: Vec<_> = (0..start.len().max(end.len())).map(change).collect();
    let rounding = (first.rounding_m_s + last.rounding_m_s) / length_s;
    let Enclosure { lower, upper, at } = largest_of(Quantity::Acceleration, &change, goal);
    let over = Interval { from_s, to_s: to_s + length_s };
    let middle_s = from_s + at * (to_s - from_s) + 0.5 * length_s;
    let at = ((middle_s - over.from_s) / (over.to_s - over.from_s)).clamp(0.0, 1.0);
    Some((over, Enclosure { lower: (lower - rounding).max(0.0), upper: (upper - rounding).max(0.0), at }))
}

impl Velocity {
    /// Its coefficients over a part of its time.
    fn part(&self, from_s: f64, to_s: f64) -> Vec<Vector3<f64>> {
        let length_s = self.over.to_s - self.over.from_s;
        let mut part = self.coefficients.clone();
        rescale(&mut part, (from_s - self.over.from_s) / length_s, (to_s - from_s) / length_s);
        part
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn to(width: f64) -> Goal {
        Goal { known: f64::NEG_INFINITY, bound: f64::INFINITY, width, coarse: 0.0 }
    }

    #[test]
    fn the_largest_of_a_polynomial_is_enclosed_where_it_is_reached() {
        // z = 4 u (1 - u): 1 at the middle, 0 at both ends.
        let c = [0.0, 4.0, -4.0].map(|z| Vector3::new(0.0, 0.0, z));
        let found = largest_of(Quantity::Height, &c, to(1e-12));
        assert!(found.lower <= 1.0 && 1.0 <= found.upper && found.upper - found.lower < 1e-11, "{found:?}");
        assert!((found.at - 0.5).abs() < 1e-5);
        let slope = largest_of(Quantity::Climb, &derivative(&c, 2.0), to(1e-12));
        assert!(slope.lower <= 2.0 && 2.0 <= slope.upper && slope.upper - slope.lower < 1e-11, "{slope:?}");
        assert_eq!(slope.at, 0.0);
    }

    #[test]
    fn it_is_never_below_what_fine_samples_show_nor_far_above() {
        for degree in 1..9_u32 {
            let c: Vec<_> = (0..=degree)
                .map(|k| {
                    let of = |a: u32| f64::from((k * 7919 + degree * 104_729 + a * 31) % 17) - 8.0;
                    Vector3::new(of(1), of(2), of(3))
                })
                .collect();
            let seen = (0..=20_000).map(|k| Quantity::Speed.of(value(&c, f64::from(k) / 20_000.0))).fold(0.0, f64::max);
            let found = largest_of(Quantity::Speed, &c, to(1e-9));
            assert!(seen <= found.upper && found.upper - found.lower < 2e-9, "{seen} {found:?}");
            assert!(found.lower - seen < 1e-3, "{seen} {found:?}");
        }
    }

    fn goal() -> Goal {
        Goal { known: f64::NEG_INFINITY, bound: f64::INFINITY, width: 1e-9, coarse: 0.0 }
    }

    fn along_x(from_s: f64, to_s: f64, coefficients: &[f64]) -> Velocity {
        let coefficients = coefficients.iter().map(|x| Vector3::new(*x, 0.0, 0.0)).collect();
        Velocity { over: Interval { from_s, to_s }, coefficients, rounding_m_s: 0.0 }
    }

    fn largest(velocities: &[Velocity], length_s: f64) -> Option<f64> {
        let (mut mean, all) =
            (MeanAcceleration::default(), Interval { from_s: f64::NEG_INFINITY, to_s: f64::INFINITY });
        let found = velocities.iter().flat_map(|of| mean.take(of.clone(), length_s, all, goal()));
        found.collect::<Vec<_>>().into_iter().map(|(_, found)| found.upper).reduce(f64::max)
    }

    #[test]
    fn a_jump_of_the_velocity_is_spread_over_the_window() {
        let corner = [along_x(0.0, 1.0, &[1.0]), along_x(1.0, 2.0, &[-1.0])];
        for length_s in [0.1, 0.2, 1.0] {
            let found = largest(&corner, length_s).expect("windows fit");
            assert!((found - 2.0 / length_s).abs() < 1e-9, "{length_s}: {found}");
        }
        assert_eq!(largest(&corner, 2.5), None, "no window fits");
    }

    #[test]
    fn a_steady_acceleration_is_its_own_mean_and_two_jumps_within_a_window_add_up() {
        let steady = [along_x(0.0, 1.0, &[0.0, 3.0]), along_x(1.0, 3.0, &[3.0, 6.0])];
        assert!((largest(&steady, 0.5).expect("windows fit") - 3.0).abs() < 1e-9);
        let two = [along_x(0.0, 1.0, &[0.0]), along_x(1.0, 1.05, &[1.0]), along_x(1.05, 2.0, &[2.0])];
        assert!((largest(&two, 0.1).expect("windows fit") - 20.0).abs() < 1e-9);
        assert!((largest(&two, 0.04).expect("windows fit") - 25.0).abs() < 1e-9);
    }
}
