//! Enclosure of the largest value of a quantity over a polynomial, and of mean accelerations over windows of fixed
//! length.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, VecDeque};

use nalgebra::Vector3;

use super::limit::Quantity;
use crate::polynomial::{BernsteinBasis, rescale, value};
use crate::sweep::Interval;

/// Largest number of parts of a polynomial that are examined.
const MAX_PARTS: usize = 2000;
/// Distance to which both bounds are brought, as a fraction of the allowance of the limit.
pub(super) const WIDTH: f64 = 0.25;

/// Enclosure of the largest value over an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Enclosure {
    /// Lower bound.
    pub(super) lower: f64,
    /// Upper bound.
    pub(super) upper: f64,
    /// Fraction of the interval at which the lower bound is reached.
    pub(super) at: f64,
}

/// Interval with the enclosure of its largest value, negated for quantities that must not fall below their limit.
pub(super) type EnclosedValue = (Interval, Enclosure);

/// Precision to which the largest value is enclosed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Precision {
    /// Largest value found before. A value that is not above it is only shown to be no larger.
    pub(super) known: f64,
    /// Bound that the value must not exceed.
    pub(super) bound: f64,
    /// Distance to which both bounds are brought.
    pub(super) width: f64,
    /// Distance to which both bounds are brought if the value is below `bound`, as a fraction of its distance from it.
    pub(super) coarse: f64,
}

/// Part of a polynomial with an upper bound of its value.
struct Part {
    upper: f64,
    start: f64,
    length: f64,
}

/// Encloses the largest value over the fractions from 0 to 1. `evaluate` returns the value at the start of a part, at
/// its end, and an upper bound in between. The part with the largest upper bound is bisected first.
pub(super) fn largest(
    c: &[Vector3<f64>],
    goal: Precision,
    evaluate: impl Fn(&[Vector3<f64>], &BernsteinBasis) -> [f64; 3],
) -> Enclosure {
    let Precision { known, bound, width, coarse } = goal;
    let basis = BernsteinBasis::of_degree(c.len().saturating_sub(1));
    let rounding = 4.0 * c.len() as f64 * f64::EPSILON * c.iter().map(Vector3::norm).sum::<f64>();
    let mut found = Enclosure { lower: f64::NEG_INFINITY, upper: f64::NEG_INFINITY, at: 0.0 };
    let examine = |start: f64, length: f64, found: &mut Enclosure| {
        let mut part = c.to_vec();
        rescale(&mut part, start, length);
        let [at_start, at_end, upper] = evaluate(&part, &basis);
        for (reached, offset) in [(at_start, start), (at_end, start + length)] {
            if reached > found.lower {
                (found.lower, found.at) = (reached, offset);
            }
        }
        Part { upper, start, length }
    };
    let (mut open, mut examined) = (BinaryHeap::from([examine(0.0, 1.0, &mut found)]), 1);
    while let Some(Part { upper, start, length }) = open.pop() {
        let is_near = upper <= found.lower.max(known) + width;
        let is_below = upper <= bound && upper - found.lower <= coarse * (bound - upper);
        if is_near || is_below || examined >= MAX_PARTS {
            // No other part has a larger upper bound.
            found.upper = upper;
            break;
        }
        let half = 0.5 * length;
        open.extend([start, start + half].map(|start| examine(start, half, &mut found)));
        examined += 2;
    }
    Enclosure { lower: found.lower - rounding, upper: found.upper.max(found.lower) + rounding, ..found }
}

impl Ord for Part {
    fn cmp(&self, other: &Self) -> Ordering {
        self.upper.total_cmp(&other.upper).then(other.start.total_cmp(&self.start))
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

/// Encloses the largest value of a quantity that is a convex function of a polynomial.
pub(super) fn largest_of(quantity: Quantity, c: &[Vector3<f64>], goal: Precision) -> Enclosure {
    largest(c, goal, |part, basis| {
        let upper = basis.points(part).map(|point| quantity.of(point)).fold(f64::NEG_INFINITY, f64::max);
        [quantity.of(part[0]), quantity.of(value(part, 1.0)), upper]
    })
}

/// Returns the derivative with respect to time of a polynomial of the fraction of an interval of length `length_s`
/// \[s\]. It has at least one coefficient.
pub(super) fn derivative(c: &[Vector3<f64>], length_s: f64) -> Vec<Vector3<f64>> {
    let rates: Vec<_> = c.iter().enumerate().skip(1).map(|(k, c)| c * (k as f64 / length_s)).collect();
    if rates.is_empty() { vec![Vector3::zeros()] } else { rates }
}

/// Velocity over an interval of time.
#[derive(Clone, Debug)]
pub(super) struct Velocity {
    pub(super) over: Interval,
    /// Coefficients in powers of the fraction of the interval \[m/s\], at least one.
    pub(super) coefficients: Vec<Vector3<f64>>,
    /// Error of the velocity due to the rounding of positions \[m/s\].
    pub(super) rounding_m_s: f64,
}

/// Velocities of a vehicle over the last averaging window.
#[derive(Clone, Debug, Default)]
pub(super) struct MeanAcceleration {
    recent: VecDeque<Velocity>,
}

impl MeanAcceleration {
    /// Discards all velocities, since the motion before the next one is unknown.
    pub(super) fn restart(&mut self) {
        self.recent.clear();
    }

    /// Adds the next velocity. Returns the largest mean accelerations over windows of length `length_s` that end in its
    /// interval and lie in `within`.
    pub(super) fn take(
        &mut self,
        next: Velocity,
        length_s: f64,
        within: Interval,
        goal: Precision,
    ) -> Vec<EnclosedValue> {
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

/// Encloses the mean acceleration over windows that begin in the interval of one velocity and end in that of another.
fn between(
    first: &Velocity,
    last: &Velocity,
    length_s: f64,
    within: Interval,
    goal: Precision,
) -> Option<EnclosedValue> {
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
    let Enclosure { lower, upper, at: fraction } = largest_of(Quantity::Acceleration, &change, goal);
    let over = Interval { from_s, to_s: to_s + length_s };
    let middle_s = from_s + fraction * (to_s - from_s) + 0.5 * length_s;
    let fraction = ((middle_s - over.from_s) / (over.to_s - over.from_s)).clamp(0.0, 1.0);
    Some((over, Enclosure { lower: (lower - rounding).max(0.0), upper: (upper - rounding).max(0.0), at: fraction }))
}

impl Velocity {
    /// Returns the coefficients over a part of the interval.
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

    fn to(width: f64) -> Precision {
        Precision { known: f64::NEG_INFINITY, bound: f64::INFINITY, width, coarse: 0.0 }
    }

    #[test]
    fn the_largest_value_and_its_position_are_enclosed() {
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
    fn the_enclosure_matches_fine_sampling() {
        for degree in 1..9_u32 {
            let c: Vec<_> = (0..=degree)
                .map(|k| {
                    let coefficient = |a: u32| f64::from((k * 7919 + degree * 104_729 + a * 31) % 17) - 8.0;
                    Vector3::new(coefficient(1), coefficient(2), coefficient(3))
                })
                .collect();
            let sampled =
                (0..=20_000).map(|k| Quantity::Speed.of(value(&c, f64::from(k) / 20_000.0))).fold(0.0, f64::max);
            let found = largest_of(Quantity::Speed, &c, to(1e-9));
            assert!(sampled <= found.upper && found.upper - found.lower < 2e-9, "{sampled} {found:?}");
            assert!(found.lower - sampled < 1e-3, "{sampled} {found:?}");
        }
    }

    fn goal() -> Precision {
        Precision { known: f64::NEG_INFINITY, bound: f64::INFINITY, width: 1e-9, coarse: 0.0 }
    }

    fn along_x(from_s: f64, to_s: f64, coefficients: &[f64]) -> Velocity {
        let coefficients = coefficients.iter().map(|x| Vector3::new(*x, 0.0, 0.0)).collect();
        Velocity { over: Interval { from_s, to_s }, coefficients, rounding_m_s: 0.0 }
    }

    fn largest(velocities: &[Velocity], length_s: f64) -> Option<f64> {
        let (mut mean, all) =
            (MeanAcceleration::default(), Interval { from_s: f64::NEG_INFINITY, to_s: f64::INFINITY });
        let found = velocities.iter().flat_map(|velocity| mean.take(velocity.clone(), length_s, all, goal()));
        found.collect::<Vec<_>>().into_iter().map(|(_, found)| found.upper).reduce(f64::max)
    }

    #[test]
    fn a_velocity_jump_is_averaged_over_the_window() {
        let corner = [along_x(0.0, 1.0, &[1.0]), along_x(1.0, 2.0, &[-1.0])];
        for length_s in [0.1, 0.2, 1.0] {
            let found = largest(&corner, length_s).expect("a window fits");
            assert!((found - 2.0 / length_s).abs() < 1e-9, "{length_s}: {found}");
        }
        assert_eq!(largest(&corner, 2.5), None, "no window fits");
    }

    #[test]
    fn a_constant_acceleration_is_its_own_mean_and_jumps_within_a_window_add_up() {
        let steady = [along_x(0.0, 1.0, &[0.0, 3.0]), along_x(1.0, 3.0, &[3.0, 6.0])];
        assert!((largest(&steady, 0.5).expect("a window fits") - 3.0).abs() < 1e-9);
        let two = [along_x(0.0, 1.0, &[0.0]), along_x(1.0, 1.05, &[1.0]), along_x(1.05, 2.0, &[2.0])];
        assert!((largest(&two, 0.1).expect("a window fits") - 20.0).abs() < 1e-9);
        assert!((largest(&two, 0.04).expect("a window fits") - 25.0).abs() < 1e-9);
    }
}
