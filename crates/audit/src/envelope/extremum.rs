//! The largest value of something over a polynomial, enclosed.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::Vector3;

use super::limit::Quantity;
use crate::polynomial::{BernsteinBasis, rescale, value};

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
}
