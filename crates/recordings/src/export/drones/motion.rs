//! Motion of a vehicle as polynomial arcs, and a proved bound on the distance between two motions.
//!
//! An arc holds the Bernstein coefficients of a polynomial over its interval, so the arc lies in their convex hull.
//! Over a part of time in which two motions have one arc each, their difference is a polynomial too. Its length is at
//! most that of its longest coefficient, which bounds the distance at every instant of the part. Halving a part
//! tightens the bound. Rounding of each operation is added.

use std::ops::{Add, Mul};

use nalgebra::Vector3;

use crate::read::curves::powers;

/// Relative excess over the largest distance found at an instant up to which a bound is not tightened.
const RELATIVE: f64 = 0.01;
/// Excess over the largest distance found up to which a bound is not tightened \[m\].
const ABSOLUTE_M: f64 = 1e-6;
/// Largest number of halvings of a part.
const MOST_HALVINGS: u32 = 24;

/// Polynomial motion over an interval of time.
#[derive(Clone, Debug, PartialEq)]
pub struct Arc {
    /// Start \[s\].
    pub from_s: f64,
    /// End \[s\]; after the start.
    pub to_s: f64,
    /// Bernstein coefficients \[m\]: the first is the start, the last the end. At least one.
    pub points: Vec<Vector3<f64>>,
    /// Bound on the rounding of the coefficients \[m\].
    pub rounding_m: f64,
}

impl Arc {
    /// Returns the straight arc between two positions \[m\].
    #[must_use]
    pub fn straight(from_s: f64, to_s: f64, from: Vector3<f64>, to: Vector3<f64>) -> Self {
        let points = if from == to { vec![from] } else { vec![from, to] };
        Self { from_s, to_s, points, rounding_m: 0.0 }
    }

    /// Returns the arc with these coefficients \[m/s^k\] of the powers of the time since its start.
    ///
    /// `b_j = sum over k <= j of C(j, k) / C(n, k) c_k T^k`. Each factor is at most 1.
    #[must_use]
    pub fn of_powers(from_s: f64, to_s: f64, coefficients: &[Vector3<f64>]) -> Self {
        let (length_s, degree) = (to_s - from_s, coefficients.len().max(1) - 1);
        let (mut scaled, mut power) = (Vec::with_capacity(degree + 1), 1.0);
        for coefficient in coefficients {
            scaled.push(coefficient * power);
            power *= length_s;
        }
        let size: f64 = scaled.iter().map(Vector3::norm).sum();
        let mut points = vec![Vector3::zeros(); degree + 1];
        for (j, point) in points.iter_mut().enumerate() {
            let mut factor = 1.0;
            for (k, coefficient) in scaled.iter().enumerate().take(j + 1) {
                *point += coefficient * factor;
                factor *= (j - k) as f64 / (degree - k).max(1) as f64;
            }
        }
        Self { from_s, to_s, points, rounding_m: 4.0 * (degree + 2) as f64 * f64::EPSILON * size }
    }

    /// Returns the coefficients \[m/s^k\] of the powers of the time since the start.
    #[must_use]
    pub fn powers(&self) -> Vec<Vector3<f64>> {
        powers(&self.points, self.to_s - self.from_s)
    }

    /// Returns the position \[m\] at a time, which is clamped to the arc.
    #[must_use]
    pub fn position_m(&self, time_s: f64) -> Vector3<f64> {
        let u = ((time_s - self.from_s) / (self.to_s - self.from_s)).clamp(0.0, 1.0);
        match self.points[..] {
            [only] => only,
            [from, to] => from * (1.0 - u) + to * u,
            _ => split(&self.points, u).0[self.points.len() - 1],
        }
    }

    /// Returns a bound on the distance \[m\] from another arc over the same interval.
    pub(super) fn distance_m(&self, other: &Self) -> f64 {
        Part::new(self, other, self.from_s, self.to_s).bound_m()
    }

    /// Returns the Bernstein coefficients of the part in an interval within the arc.
    fn part(&self, from_s: f64, to_s: f64) -> Vec<Vector3<f64>> {
        if self.points.len() == 1 || (from_s <= self.from_s && to_s >= self.to_s) {
            return self.points.clone();
        }
        if self.points.len() == 2 {
            return vec![self.position_m(from_s), self.position_m(to_s)];
        }
        let fraction = |time_s: f64, start_s: f64| ((time_s - start_s) / (self.to_s - start_s)).clamp(0.0, 1.0);
        let rest = split(&self.points, fraction(from_s, self.from_s)).1;
        let start_s = from_s.max(self.from_s);
        if start_s < self.to_s { split(&rest, fraction(to_s, start_s)).0 } else { rest }
    }

    /// Returns a bound on the speed \[m/s\], up to rounding.
    pub(super) fn speed_m_s(&self) -> f64 {
        let step_m = self.points.windows(2).map(|pair| (pair[1] - pair[0]).norm()).fold(0.0, f64::max);
        (self.points.len() as f64 - 1.0) * step_m / (self.to_s - self.from_s)
    }

    /// Returns a bound on the rounding of [`Self::part`] and of later additions, for a motion up to a time \[s\].
    fn pad_m(&self) -> f64 {
        let count = self.points.len() as f64;
        let size = self.points.iter().map(|point| point.abs().max()).fold(0.0, f64::max);
        let speed_m_s = self.speed_m_s();
        let time_s = self.from_s.abs().max(self.to_s.abs());
        self.rounding_m + f64::EPSILON * (32.0 * (count + 2.0) * size + 4.0 * time_s * speed_m_s)
    }
}

/// Motion of a vehicle: arcs in order of time, each from the end of the arc before. Two arcs that do not meet in one
/// point are a jump.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// Arcs; at least one.
    pub arcs: Vec<Arc>,
}

impl Motion {
    /// Returns the first and the last instant \[s\].
    #[must_use]
    pub fn span_s(&self) -> Option<(f64, f64)> {
        Some((self.arcs.first()?.from_s, self.arcs.last()?.to_s))
    }

    /// Returns the position \[m\] at a time. Before the first and after the last instant the vehicle rests.
    #[must_use]
    pub fn position_m(&self, time_s: f64) -> Vector3<f64> {
        let after = self.arcs.partition_point(|arc| arc.to_s < time_s).min(self.arcs.len().saturating_sub(1));
        self.arcs.get(after).map_or_else(Vector3::zeros, |arc| arc.position_m(time_s))
    }

    /// Returns the motion within an interval \[s\], with times counted from the start of the interval.
    #[must_use]
    pub fn window(&self, from_s: f64, to_s: f64) -> Self {
        let within = self.arcs.iter().filter(|arc| arc.to_s > from_s && arc.from_s < to_s);
        let cut = |arc: &Arc| {
            let (start_s, end_s) = (arc.from_s.max(from_s), arc.to_s.min(to_s));
            // The end of the arc before keeps its double, so that arcs still meet.
            let rounding_m = arc.pad_m();
            Arc { from_s: start_s - from_s, to_s: end_s - from_s, points: arc.part(start_s, end_s), rounding_m }
        };
        Self { arcs: within.map(cut).filter(|arc| arc.to_s > arc.from_s).collect() }
    }

    /// Returns this motion with a rest at its end until `to_s`.
    #[must_use]
    pub fn resting_until(mut self, to_s: f64) -> Self {
        if let Some(last) = self.arcs.last()
            && last.to_s < to_s
        {
            let (from_s, position, rounding_m) = (last.to_s, last.points[last.points.len() - 1], last.rounding_m);
            self.arcs.push(Arc { rounding_m, ..Arc::straight(from_s, to_s, position, position) });
        }
        self
    }
}

/// Largest distance between two motions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviation {
    /// Proved bound on the distance at every instant \[m\].
    pub bound_m: f64,
    /// Largest distance that was found at an instant \[m\]; at most 1 % or 1 um and the rounding below the bound.
    pub found_m: f64,
    /// Instant of the largest distance \[s\].
    pub time_s: f64,
}

/// Returns a proved bound on the distance of two motions over their common time; `None` if they have none.
#[must_use]
pub fn deviation(first: &Motion, second: &Motion) -> Option<Deviation> {
    let mut found = Deviation { time_s: f64::NAN, found_m: -1.0, ..Deviation::default() };
    let mut open = Vec::new();
    for part in parts(first, second) {
        part.note(&mut found);
        if part.bound_m() > accepted(found.found_m) + part.pad_m {
            open.push(part);
        } else {
            found.bound_m = found.bound_m.max(part.bound_m());
        }
    }
    while let Some(part) = open.pop() {
        // Halving does not reduce the rounding.
        if part.bound_m() <= accepted(found.found_m) + part.pad_m || part.halvings >= MOST_HALVINGS {
            found.bound_m = found.bound_m.max(part.bound_m());
            continue;
        }
        for half in part.halves() {
            half.note(&mut found);
            open.push(half);
        }
    }
    found.time_s.is_finite().then_some(found)
}

/// Returns whether the distance of two motions is proved to be at most a limit \[m\] over their common time.
#[must_use]
pub fn is_within(first: &Motion, second: &Motion, limit_m: f64) -> bool {
    parts(first, second).all(|part| {
        let mut open = vec![part];
        while let Some(part) = open.pop() {
            if part.bound_m() <= limit_m {
                continue;
            }
            if part.ends_m() > limit_m || part.halvings >= MOST_HALVINGS {
                return false;
            }
            open.extend(part.halves());
        }
        true
    })
}

fn accepted(found_m: f64) -> f64 {
    found_m + (RELATIVE * found_m).max(ABSOLUTE_M)
}

/// Difference of two motions over a part of time.
struct Part {
    from_s: f64,
    to_s: f64,
    difference: Vec<Vector3<f64>>,
    pad_m: f64,
    halvings: u32,
}

impl Part {
    fn new(first: &Arc, second: &Arc, from_s: f64, to_s: f64) -> Self {
        let (mut one, mut other) = (first.part(from_s, to_s), second.part(from_s, to_s));
        let degree = one.len().max(other.len());
        raise(&mut one, degree);
        raise(&mut other, degree);
        for (point, other) in one.iter_mut().zip(&other) {
            *point -= other;
        }
        Self { from_s, to_s, difference: one, pad_m: first.pad_m() + second.pad_m(), halvings: 0 }
    }

    fn bound_m(&self) -> f64 {
        self.pad_m + self.difference.iter().map(Vector3::norm).fold(0.0, f64::max)
    }

    /// Returns the larger distance of both ends.
    fn ends_m(&self) -> f64 {
        self.difference[0].norm().max(self.difference[self.difference.len() - 1].norm())
    }

    fn note(&self, found: &mut Deviation) {
        let last = self.difference[self.difference.len() - 1];
        for (position, time_s) in [(self.difference[0], self.from_s), (last, self.to_s)] {
            if position.norm() > found.found_m {
                (found.found_m, found.time_s) = (position.norm(), time_s);
            }
        }
    }

    fn halves(&self) -> [Self; 2] {
        let middle_s = 0.5 * (self.from_s + self.to_s);
        let (before, after) = split(&self.difference, 0.5);
        let half = |from_s, to_s, difference| Self {
            from_s,
            to_s,
            difference,
            pad_m: self.pad_m * (1.0 + 1e-3),
            halvings: self.halvings + 1,
        };
        [half(self.from_s, middle_s, before), half(middle_s, self.to_s, after)]
    }
}

/// Returns the parts of the common time of two motions in which each has one arc.
fn parts<'a>(first: &'a Motion, second: &'a Motion) -> impl Iterator<Item = Part> + 'a {
    let (mut index, mut other) = (0, 0);
    std::iter::from_fn(move || {
        while let (Some(one), Some(two)) = (first.arcs.get(index), second.arcs.get(other)) {
            let (from_s, to_s) = (one.from_s.max(two.from_s), one.to_s.min(two.to_s));
            if one.to_s <= two.to_s {
                index += 1;
            } else {
                other += 1;
            }
            if from_s < to_s {
                return Some(Part::new(one, two, from_s, to_s));
            }
        }
        None
    })
}

/// Splits Bernstein coefficients at a fraction by the algorithm of de Casteljau.
fn split(points: &[Vector3<f64>], u: f64) -> (Vec<Vector3<f64>>, Vec<Vector3<f64>>) {
    let (mut before, mut after) = (Vec::with_capacity(points.len()), points.to_vec());
    for end in (0..points.len()).rev() {
        before.push(after[0]);
        for i in 0..end {
            after[i] = after[i] * (1.0 - u) + after[i + 1] * u;
        }
    }
    // The triangle leaves the coefficients of the second part in order.
    (before, after)
}

/// Raises the degree of Bernstein coefficients until there are `count`.
pub(crate) fn raise<T: Copy + Add<Output = T> + Mul<f64, Output = T>>(points: &mut Vec<T>, count: usize) {
    while points.len() < count {
        let n = points.len();
        let share = |i: usize| i as f64 / n as f64;
        let inner = (1..n).map(|i| points[i - 1] * share(i) + points[i] * (1.0 - share(i)));
        *points = std::iter::once(points[0]).chain(inner).chain([points[n - 1]]).collect();
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::vector;

    use super::*;

    fn parabola() -> Motion {
        // x = t^2 from 0 to 2 s.
        let powers = [Vector3::zeros(), Vector3::zeros(), vector![1.0, 0.0, 0.0]];
        Motion { arcs: vec![Arc::of_powers(0.0, 2.0, &powers)] }
    }

    fn chords(count: usize) -> Motion {
        let time_at = |k: usize| 2.0 * k as f64 / count as f64;
        let place = |t: f64| vector![t * t, 0.0, 0.0];
        let arc = |k| Arc::straight(time_at(k), time_at(k + 1), place(time_at(k)), place(time_at(k + 1)));
        Motion { arcs: (0..count).map(arc).collect() }
    }

    #[test]
    fn distance_of_a_parabola_from_its_chords_is_bounded_tightly() {
        for count in [1, 2, 5, 40] {
            // A chord of length h deviates by h^2 / 4 in its middle.
            let truth = (2.0 / count as f64).powi(2) / 4.0;
            let found = deviation(&parabola(), &chords(count)).expect("common time");
            assert!(found.bound_m >= truth && found.bound_m < truth * 1.02 + 2e-6, "{count}: {found:?} {truth}");
            assert!(found.found_m <= truth + 1e-15);
            assert!(is_within(&parabola(), &chords(count), truth * 1.03));
            assert!(!is_within(&parabola(), &chords(count), truth * 0.97));
        }
    }

    #[test]
    fn a_jump_counts_with_both_of_its_sides() {
        let held = Motion {
            arcs: vec![
                Arc::straight(0.0, 1.0, Vector3::zeros(), Vector3::zeros()),
                Arc::straight(1.0, 2.0, vector![1.0, 0.0, 0.0], vector![1.0, 0.0, 0.0]),
            ],
        };
        let found = deviation(&held, &chords(2)).expect("common time");
        assert!((found.bound_m - 3.0).abs() < 1e-5 && found.time_s == 2.0, "{found:?}");
        assert_eq!(deviation(&held, &Motion::default()), None);
    }

    #[test]
    fn a_window_and_the_powers_keep_the_motion() {
        let part = parabola().window(0.5, 1.5);
        assert_eq!(part.span_s(), Some((0.0, 1.0)));
        let powers = part.arcs[0].powers();
        let expected = [0.25, 1.0, 1.0];
        for (found, expected) in powers.iter().zip(expected) {
            assert!((found.x - expected).abs() < 1e-14, "{powers:?}");
        }
        assert!((part.position_m(0.5).x - 1.0).abs() < 1e-14);
        let resting = part.resting_until(3.0);
        assert_eq!(resting.position_m(2.5), resting.position_m(1.0));
        let mut rough = parabola();
        rough.arcs[0].rounding_m = 0.5;
        assert_eq!(rough.resting_until(3.0).arcs[1].rounding_m, 0.5, "the end is rounded as the arc is");
    }
}
