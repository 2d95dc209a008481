//! Bound on the error of a drone that evaluates compressed segments in single precision.
//!
//! A drone computes the coefficients of the powers of time once for each segment, then evaluates them by Horner's
//! scheme. The coefficients follow from the control points `b_i` of degree `n`:
//!
//! ```text
//! c_j = n! / (n - j)!  sum over i <= j of (-1)^(i + j) b_i / (i! (j - i)!)
//! ```
//!
//! Terms of this sum cancel, so its error exceeds the rounding of a position many times. An a priori bound would be
//! wider than the tolerance of a flight 30 m from the origin. The sum has no product that a compiler could contract,
//! and IEEE 754 fixes each operation, so this module computes the same coefficients. The Bernstein coefficients of the
//! difference from the exact curve bound the error of the coefficients. Horner's scheme and the time add a relative
//! error of the sum of `|c_j| T^j`.
//!
//! The firmware of a Crazyflie starts a segment at the computed end of the segment before. Compilers may fuse the
//! operations of Horner's scheme, so both forms are computed.

use nalgebra::Vector3;

use super::motion::Arc;
use crate::segments::{Segment, Trajectory};

/// Relative rounding of single precision.
pub(super) const ROUNDING: f64 = 1.0 / 16_777_216.0;
/// Millimetres per metre.
const MM_PER_M: f32 = 1000.0;
/// Milliseconds per second.
const MS_PER_S: f32 = 1000.0;
/// Numbers of a polynomial of degree 7.
const POINTS: usize = 8;
/// Factor that covers the speed beyond the end of a segment, for at most the error of its start.
const BEYOND_END: f64 = 2.0;

/// Program that evaluates segments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Evaluator {
    /// Firmware of a Crazyflie: metres, powers of seconds.
    Crazyflie,
    /// libskybrush: millimetres, powers of the fraction of a segment.
    Skybrush,
}

impl Evaluator {
    /// Returns a bound on the relative error of Horner's scheme, with an error of the time.
    ///
    /// Horner's scheme of degree 7: 15 roundings. Time: a rounding for each power, or three if it is a fraction. The
    /// others cover the conversion to metres and sums of errors.
    fn horner(self) -> f64 {
        match self {
            Self::Crazyflie => 24.0 * ROUNDING,
            Self::Skybrush => 40.0 * ROUNDING,
        }
    }

    /// Returns a bound on the error of each segment with a duration \[m\], for a unit of length \[m\].
    pub(super) fn errors_m(self, trajectory: &Trajectory, unit_m: f64) -> Vec<f64> {
        let [plain, fused] = [false, true].map(|is_fused| Pass::new(self, trajectory, unit_m, is_fused).errors_m());
        plain.into_iter().zip(fused).map(|(one, other)| one.max(other)).collect()
    }
}

/// Evaluation of all segments in order, with or without fused operations.
struct Pass<'a> {
    evaluator: Evaluator,
    trajectory: &'a Trajectory,
    unit_m: f64,
    is_fused: bool,
    /// Start of the next segment in the unit of the evaluator.
    at: [f32; 3],
    /// End of the segments so far \[ms\].
    end_ms: u64,
    /// The same as a Crazyflie adds it \[s\].
    end_s: f32,
}

impl<'a> Pass<'a> {
    fn new(evaluator: Evaluator, trajectory: &'a Trajectory, unit_m: f64, is_fused: bool) -> Self {
        let mut pass = Self { evaluator, trajectory, unit_m, is_fused, at: [0.0; 3], end_ms: 0, end_s: 0.0 };
        pass.at = std::array::from_fn(|axis| pass.start(trajectory.start[axis]));
        pass
    }

    fn errors_m(mut self) -> Vec<f64> {
        let (trajectory, unit_m) = (self.trajectory, self.unit_m);
        let mut errors_m = Vec::with_capacity(trajectory.segments.len());
        for (segment, (duration_ms, points)) in trajectory.segments.iter().zip(trajectory.curves(unit_m)) {
            let (start_error_s, error_m) = (self.clock_error_s(), self.segment_error_m(segment, &points));
            if duration_ms > 0 {
                let clock_error_s = start_error_s.max(self.clock_error_s());
                let step_m = points.windows(2).map(|pair| (pair[1] - pair[0]).norm()).fold(0.0, f64::max);
                let speed_m_s = (points.len() - 1) as f64 * step_m / (f64::from(duration_ms) / f64::from(MS_PER_S));
                errors_m.push(error_m + BEYOND_END * speed_m_s * clock_error_s);
            }
        }
        errors_m
    }

    /// Returns a bound on the error of the next segment, without that of its start time, and moves to its end.
    fn segment_error_m(&mut self, segment: &Segment, points: &[Vector3<f64>]) -> f64 {
        let is_by_time = self.evaluator == Evaluator::Crazyflie;
        let duration_s = f64::from(segment.duration_ms) / f64::from(MS_PER_S);
        let single_s = single(duration_s);
        let (metre, length) = if is_by_time { (1.0, duration_s) } else { (f64::from(MM_PER_M), 1.0) };
        let mut scaled = [Vector3::zeros(); POINTS];
        for axis in 0..3 {
            let others = segment.points[axis].iter().map(|number| self.coordinate(*number));
            let control: Vec<f32> = std::iter::once(self.at[axis]).chain(others).collect();
            let mut coefficients = powers(&control);
            if is_by_time {
                stretch(&mut coefficients, control.len(), single_s);
            }
            let mut power = 1.0 / metre;
            for (scaled, coefficient) in scaled.iter_mut().zip(coefficients) {
                scaled[axis] = f64::from(coefficient) * power;
                power *= length;
            }
            self.at[axis] = match control[..] {
                [only] => only,
                [.., _] if is_by_time => self.horner(&coefficients, single_s),
                [.., last] => last,
                [] => 0.0,
            };
        }
        self.end_ms += u64::from(segment.duration_ms);
        self.end_s += single_s;
        let size_m: f64 = scaled.iter().map(Vector3::norm).sum();
        let computed = Arc::of_powers(0.0, 1.0, &scaled);
        let exact = Arc { from_s: 0.0, to_s: 1.0, points: points.to_vec(), rounding_m: 0.0 };
        computed.distance_m(&exact) + self.evaluator.horner() * size_m
    }

    /// Returns a coordinate of a control point.
    fn coordinate(&self, number: i16) -> f32 {
        match self.evaluator {
            Evaluator::Crazyflie => f32::from(number) / MM_PER_M,
            Evaluator::Skybrush => f32::from(number) * single(self.unit_m * f64::from(MM_PER_M)),
        }
    }

    /// Returns a coordinate of the start, which a Crazyflie divides in double precision.
    fn start(&self, number: i16) -> f32 {
        match self.evaluator {
            Evaluator::Crazyflie => single(f64::from(number) / f64::from(MM_PER_M)),
            Evaluator::Skybrush => self.coordinate(number),
        }
    }

    /// Returns the error of the end of the segments so far \[s\]. A Crazyflie adds durations, libskybrush divides
    /// milliseconds.
    fn clock_error_s(&self) -> f64 {
        let end_s = self.end_ms as f64 / f64::from(MS_PER_S);
        let computed_s = match self.evaluator {
            Evaluator::Crazyflie => self.end_s,
            Evaluator::Skybrush => single(self.end_ms as f64) / MS_PER_S,
        };
        (f64::from(computed_s) - end_s).abs()
    }

    fn horner(&self, coefficients: &[f32; POINTS], time: f32) -> f32 {
        let step = |sum: f32, coefficient: &f32| {
            if self.is_fused { sum.mul_add(time, *coefficient) } else { sum * time + coefficient }
        };
        coefficients.iter().rev().fold(0.0, step)
    }
}

/// Returns the coefficients of the powers of the fraction of a segment, in the order of operations of the drones.
fn powers(control: &[f32]) -> [f32; POINTS] {
    let mut coefficients = [0.0; POINTS];
    let factorial = |k: usize| (1..=k).product::<usize>() as f32;
    match *control {
        [] => {}
        [only] => coefficients[0] = only,
        [from, to] => (coefficients[0], coefficients[1]) = (from, to - from),
        _ => {
            let n = control.len() - 1;
            for (j, coefficient) in coefficients.iter_mut().enumerate().take(n + 1) {
                let term = |i: usize| {
                    let signed = if (i + j).is_multiple_of(2) { control[i] } else { -control[i] };
                    signed / factorial(i) / factorial(j - i)
                };
                let sum: f32 = (0..=j).fold(0.0, |sum, i| sum + term(i));
                *coefficient = sum * factorial(n) / factorial(n - j);
            }
        }
    }
    coefficients
}

/// Changes coefficients of the fraction of a segment to those of the time \[s\].
fn stretch(coefficients: &mut [f32; POINTS], points: usize, duration_s: f32) {
    if points == 2 {
        coefficients[1] /= duration_s;
    } else if points > 2 {
        let reciprocal = 1.0 / duration_s;
        let mut power = reciprocal;
        for coefficient in &mut coefficients[1..] {
            *coefficient *= power;
            power *= reciprocal;
        }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "rounds to single precision")]
fn single(x: f64) -> f32 {
    x as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Trajectory near a coordinate \[units\] with segments of all kinds.
    fn trajectory(near: i16) -> Trajectory {
        let wave = |k: i16| near + 40 * (k % 3) - 7 * k;
        let points = |count: i16| (1..=count).map(wave).collect::<Vec<_>>();
        let segment = |duration_ms, counts: [i16; 3]| Segment {
            duration_ms,
            points: [points(counts[0]), points(counts[1]), points(counts[2]), Vec::new()],
        };
        let segments = vec![
            segment(777, [7, 3, 1]),
            segment(1501, [0, 7, 7]),
            segment(13, [3, 1, 0]),
            segment(2000, [1, 0, 7]),
            segment(333, [7, 7, 7]),
        ];
        Trajectory { start: [near, near, near, 0], segments }
    }

    /// Largest distance of an evaluation in single precision from the exact curve \[m\], over its bound.
    fn worst_share(near: i16, unit_m: f64, evaluator: Evaluator, is_fused: bool) -> (f64, f64) {
        let trajectory = trajectory(near);
        let errors_m = evaluator.errors_m(&trajectory, unit_m);
        let mut pass = Pass::new(evaluator, &trajectory, unit_m, is_fused);
        let (mut worst, mut largest_m) = (0.0_f64, 0.0_f64);
        for ((segment, (duration_ms, points)), error_m) in
            trajectory.segments.iter().zip(trajectory.curves(unit_m)).zip(errors_m)
        {
            let position = pass.at;
            let single_s = single(f64::from(duration_ms) / 1000.0);
            let arc = Arc { from_s: 0.0, to_s: f64::from(duration_ms) / 1000.0, points, rounding_m: 0.0 };
            for k in 0..=1000_u16 {
                let share = f32::from(k) / 1000.0;
                let found = Vector3::from_fn(|axis, _| {
                    let others = segment.points[axis].iter().map(|number| pass.coordinate(*number));
                    let control: Vec<f32> = std::iter::once(position[axis]).chain(others).collect();
                    let mut coefficients = powers(&control);
                    if evaluator == Evaluator::Crazyflie {
                        stretch(&mut coefficients, control.len(), single_s);
                        f64::from(pass.horner(&coefficients, share * single_s))
                    } else {
                        f64::from(pass.horner(&coefficients, share)) / 1000.0
                    }
                });
                let off_m = (found - arc.position_m(f64::from(share) * arc.to_s)).norm();
                (worst, largest_m) = (worst.max(off_m / error_m), largest_m.max(off_m));
            }
            pass.segment_error_m(segment, &arc.points);
        }
        (worst, largest_m)
    }

    #[test]
    fn bounds_hold_for_both_programs_and_are_no_wider_than_needed() {
        for (near, is_fused) in [(0, false), (2000, true), (-31_000, false), (31_000, true)] {
            for (evaluator, unit_m) in
                [(Evaluator::Crazyflie, 1e-3), (Evaluator::Skybrush, 1e-3), (Evaluator::Skybrush, 0.127)]
            {
                let (worst, largest_m) = worst_share(near, unit_m, evaluator, is_fused);
                assert!(worst <= 1.0 && worst > 0.01, "{near} {evaluator:?} {unit_m}: {worst} of {largest_m} m");
            }
        }
    }

    #[test]
    fn coefficients_far_from_the_origin_have_a_large_error() {
        // Negative twin: the error exceeds the rounding of the positions, so that a bound without it is wrong.
        let (_, largest_m) = worst_share(31_000, 1e-3, Evaluator::Crazyflie, false);
        assert!(largest_m > 20.0 * 31.0 * ROUNDING, "{largest_m}");
    }

    #[test]
    fn a_segment_at_rest_has_no_error_besides_its_rounding() {
        let segments = vec![Segment { duration_ms: 60_000, ..Segment::default() }; 3];
        let trajectory = Trajectory { start: [12_345, -1, 0, 0], segments };
        for error_m in Evaluator::Crazyflie.errors_m(&trajectory, 1e-3) {
            assert!(error_m <= 26.0 * 12.4 * ROUNDING, "{error_m}");
        }
    }
}
