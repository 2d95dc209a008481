//! Mean accelerations over windows of one length: how much the velocity changes over a window, over its length.

use std::collections::VecDeque;

use nalgebra::Vector3;

use super::extremum::{Enclosure, Goal, largest_of};
use super::followed::Found;
use super::limit::Quantity;
use crate::polynomial::rescale;
use crate::sweep::Interval;

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
