//! Fits the fewest polynomials of degree 7 to the motion of a vehicle, within a tolerance.
//!
//! Pieces are fitted one after the other, each as long as the tolerance allows. The length of a piece grows until the
//! tolerance is exceeded and is then bisected. Position, velocity and acceleration are continuous at joints (C2).
//! The first three Bernstein coefficients of a piece follow from the piece before. The other five are those of
//! least squares at instants on this piece and on a second one of the same length behind it. The second piece is
//! dropped. It gives the joint a velocity and an acceleration with which the flight continues. A piece is accepted if
//! its distance from the motion is proved to be within the tolerance at every instant ([`super::motion::is_within`]).
//!
//! Joints are at whole milliseconds, which every format of drones can hold.

use nalgebra::{Cholesky, DMatrix, Dyn, MatrixXx3, Vector3};

use super::motion::{Arc, Motion, is_within};

/// Degree of a piece.
pub const DEGREE: usize = 7;
/// Number of Bernstein coefficients of a piece.
pub const POINTS: usize = DEGREE + 1;
/// Longest piece \[ms\]. Durations have 16 bits, and Skybrush Server splits segments longer than 65 s.
const LONGEST_MS: u64 = 65_000;
/// Number of instants on each of the two pieces.
const INSTANTS: usize = 48;
/// Growth of the length of a piece from one fit to the next.
const GROWTH: f64 = 1.5;
/// Relative width to which the length of a piece is bisected.
const WIDTH: f64 = 0.01;
/// Share of the tolerance that the end of a piece may use, so that the next piece can begin within the tolerance.
const JOINT_SHARE: f64 = 0.5;

/// Piece of a fitted curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// Duration \[ms\]; at least 1.
    pub duration_ms: u16,
    /// Bernstein coefficients \[m\].
    pub points: [Vector3<f64>; POINTS],
}

/// Reason why a motion cannot be fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FitError {
    /// No polynomial of 1 ms follows the motion from this instant on \[s\].
    TooFast(f64),
    /// The caller has ended the work.
    Interrupted,
}

/// Returns the pieces of a curve within `tolerance_m` of a motion that begins at 0 s.
///
/// The curve ends at the first whole millisecond at or after the end of the motion, where the vehicle rests. Each
/// duration \[ms\] satisfies `is_allowed`, which must accept 1.
///
/// # Errors
/// [`FitError`]: the motion jumps or is too fast, or `is_interrupted` returns true.
pub fn fit(
    motion: &Motion,
    tolerance_m: f64,
    is_allowed: fn(u64) -> bool,
    is_interrupted: &dyn Fn() -> bool,
) -> Result<Vec<Piece>, FitError> {
    let end_ms = end_ms(motion);
    let motion = motion.clone().resting_until(seconds(end_ms));
    let mut fitter = Fitter { motion, tolerance_m, is_allowed, end_ms, squares: Vec::new() };
    let mut pieces: Vec<Piece> = Vec::new();
    let (mut from_ms, mut guess_ms) = (0, LONGEST_MS.min(1000));
    while from_ms < end_ms {
        if is_interrupted() {
            return Err(FitError::Interrupted);
        }
        let piece = fitter.longest(from_ms, pieces.last(), guess_ms).ok_or(FitError::TooFast(seconds(from_ms)))?;
        guess_ms = u64::from(piece.duration_ms);
        from_ms += guess_ms;
        pieces.push(piece);
    }
    Ok(pieces)
}

/// Returns the first whole millisecond at or after the end of a motion; at least 1.
#[must_use]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the cast saturates")]
pub fn end_ms(motion: &Motion) -> u64 {
    let end_s = motion.span_s().map_or(0.0, |(_, to_s)| to_s);
    let near = (end_s * 1e3).round();
    let end_ms = if (near * 1e-3 - end_s).abs() <= 1e-9 * end_s.abs().max(1.0) { near } else { (end_s * 1e3).ceil() };
    (end_ms.max(1.0)) as u64
}

/// Returns the time of a millisecond \[s\].
#[must_use]
pub fn seconds(ms: u64) -> f64 {
    ms as f64 / 1e3
}

struct Fitter {
    motion: Motion,
    tolerance_m: f64,
    is_allowed: fn(u64) -> bool,
    end_ms: u64,
    /// Factored systems, by the ratio of the durations and the number of given coefficients.
    squares: Vec<LeastSquares>,
}

impl Fitter {
    /// Returns the longest piece from an instant within the tolerance.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a length of some seconds")]
    fn longest(&mut self, from_ms: u64, before: Option<&Piece>, guess_ms: u64) -> Option<Piece> {
        let most_ms = LONGEST_MS.min(self.end_ms - from_ms);
        let (mut good, mut bad_ms) = (None::<Piece>, most_ms + 1);
        let mut try_ms = guess_ms.clamp(1, most_ms);
        loop {
            // The shortest duration is allowed.
            while try_ms > 1 && !(self.is_allowed)(try_ms) {
                try_ms -= 1;
            }
            match self.accepted(from_ms, try_ms, before) {
                Some(piece) => good = Some(piece),
                None => bad_ms = try_ms,
            }
            let good_ms = good.map_or(0, |piece| u64::from(piece.duration_ms));
            // A duration that is not allowed may lead back to one that was tried.
            let is_tried = |ms: u64| ms <= good_ms || ms >= bad_ms;
            if good_ms + 1 >= bad_ms || (good_ms > 0 && ((bad_ms - good_ms) as f64) <= WIDTH * good_ms as f64) {
                return good;
            }
            try_ms = match good_ms {
                0 => (bad_ms / 2).max(1),
                good_ms if bad_ms > most_ms => ((good_ms as f64 * GROWTH).ceil() as u64).min(most_ms),
                good_ms => u64::midpoint(good_ms, bad_ms),
            };
            if (good_ms..=try_ms).rev().find(|ms| (self.is_allowed)(*ms)).is_none_or(is_tried) {
                return good;
            }
        }
    }

    /// Returns the piece of a duration, if it is within the tolerance.
    fn accepted(&mut self, from_ms: u64, duration_ms: u64, before: Option<&Piece>) -> Option<Piece> {
        let piece = self.fitted(from_ms, duration_ms, before)?;
        let (from_s, to_s) = (seconds(from_ms), seconds(from_ms + duration_ms));
        let is_last = from_ms + duration_ms == self.end_ms;
        let end_m = (piece.points[DEGREE] - self.motion.position_m(to_s)).norm();
        if !is_last && end_m > JOINT_SHARE * self.tolerance_m {
            return None;
        }
        let arc = Arc { from_s, to_s, points: piece.points.to_vec(), rounding_m: 0.0 };
        self.is_near(arc).then_some(piece)
    }

    /// Returns whether the distance of an arc from the motion is within the tolerance at every instant.
    ///
    /// On a straight arc of the motion the difference has the second derivative of the fitted arc. Its distance exceeds
    /// the larger one at both ends by at most `h^2 / 8` times that.
    fn is_near(&self, arc: Arc) -> bool {
        let accel_m_s2 = second_derivative_m_s2(&arc);
        let first = self.motion.arcs.partition_point(|other| other.to_s <= arc.from_s);
        let count = self.motion.arcs[first..].partition_point(|other| other.from_s < arc.to_s);
        let flown = &self.motion.arcs[first..first + count];
        let powers = arc.powers();
        let position_at =
            |time_s: f64| powers.iter().rev().fold(Vector3::zeros(), |sum, c| sum * (time_s - arc.from_s) + c);
        let bound_m = |other: &Arc| {
            let (from_s, to_s) = (other.from_s.max(arc.from_s), other.to_s.min(arc.to_s));
            let ends_m = [from_s, to_s].map(|time_s| (position_at(time_s) - other.position_m(time_s)).norm());
            ends_m[0].max(ends_m[1]) + (to_s - from_s).powi(2) / 8.0 * accel_m_s2
        };
        let is_open = |other: &&Arc| other.points.len() > 2 || bound_m(other) > self.tolerance_m;
        let open: Vec<Arc> = flown.iter().filter(is_open).cloned().collect();
        open.is_empty() || is_within(&Motion { arcs: vec![arc] }, &Motion { arcs: open }, self.tolerance_m)
    }

    /// Returns the piece of a duration with the least squares of deviations.
    fn fitted(&mut self, from_ms: u64, duration_ms: u64, before: Option<&Piece>) -> Option<Piece> {
        let next_ms = duration_ms.min(self.end_ms - from_ms - duration_ms);
        let (duration_s, next_s) = (seconds(duration_ms), seconds(next_ms));
        let mut points = [Vector3::zeros(); POINTS];
        let given = if let Some(before) = before {
            // C2: b'(0) and b''(0) are those of the end of the piece before.
            let ratio = duration_s / seconds(u64::from(before.duration_ms));
            let [.., third, second, last] = before.points;
            let (step, bend) = (last - second, last - second * 2.0 + third);
            points[0] = last;
            points[1] = last + step * ratio;
            points[2] = points[1] * 2.0 - last + bend * (ratio * ratio);
            3
        } else {
            points[0] = self.motion.position_m(seconds(from_ms));
            1
        };
        let ratio = next_s / duration_s;
        let known = self.squares.iter().position(|square| square.given == given && square.ratio == ratio);
        let index = if let Some(index) = known {
            index
        } else {
            // Only the ratio 1 occurs often.
            self.squares.retain(|square| square.ratio == 1.0);
            self.squares.push(LeastSquares::new(given, ratio)?);
            self.squares.len() - 1
        };
        let from_s = seconds(from_ms);
        let squares = &self.squares[index];
        let place = |row: usize, k: usize| {
            let u = instant(k);
            let time_s = if row == 0 { from_s + u * duration_s } else { from_s + duration_s + u * next_s };
            self.motion.position_m(time_s)
        };
        let solved = squares.solve(&points, place);
        for (point, row) in points[given..].iter_mut().zip(solved.row_iter()) {
            *point = row.transpose();
        }
        Some(Piece { duration_ms: u16::try_from(duration_ms).ok()?, points })
    }
}

/// Returns a bound on the second derivative of an arc of degree 7 \[m/s^2\].
fn second_derivative_m_s2(arc: &Arc) -> f64 {
    let degree = (arc.points.len() - 1) as f64;
    let bends = arc.points.windows(3).map(|triple| (triple[0] - triple[1] * 2.0 + triple[2]).norm());
    bends.fold(0.0, f64::max) * degree * (degree - 1.0) / (arc.to_s - arc.from_s).powi(2)
}

/// Returns the fraction of a piece at instant `k`: denser towards the ends, where least squares deviate most.
fn instant(k: usize) -> f64 {
    let angle = std::f64::consts::PI * (k as f64 + 0.5) / INSTANTS as f64;
    0.5 * (1.0 - libm::cos(angle))
}

/// Returns the Bernstein polynomials of degree 7 at `u`.
fn bernstein(u: f64) -> [f64; POINTS] {
    let mut basis = [0.0; POINTS];
    basis[0] = 1.0;
    for degree in 1..POINTS {
        let mut carried = 0.0;
        for value in &mut basis[..=degree] {
            let old = *value;
            *value = carried + (1.0 - u) * old;
            carried = u * old;
        }
    }
    basis
}

/// Factored normal equations of two pieces with a C2 joint.
///
/// The unknowns are the coefficients of the first piece from `given` on, and the last five of the second, if it has a
/// duration.
struct LeastSquares {
    given: usize,
    ratio: f64,
    /// Weights of all 8 coefficients of the first piece and of the unknowns of the second, by instant.
    rows: Vec<[f64; POINTS + 5]>,
    factor: Cholesky<f64, Dyn>,
}

impl LeastSquares {
    fn new(given: usize, ratio: f64) -> Option<Self> {
        let has_next = ratio > 0.0;
        let mut rows = Vec::with_capacity(2 * INSTANTS);
        for k in 0..INSTANTS {
            let mut row = [0.0; POINTS + 5];
            row[..POINTS].copy_from_slice(&bernstein(instant(k)));
            rows.push(row);
        }
        for k in (0..INSTANTS).filter(|_| has_next) {
            let next = bernstein(instant(k));
            let mut row = [0.0; POINTS + 5];
            // With r the ratio of durations: c0 = b7, c1 = b7 + r (b7 - b6),
            // c2 = b7 + 2 r (b7 - b6) + r^2 (b7 - 2 b6 + b5).
            let (r, r2) = (ratio, ratio * ratio);
            row[DEGREE] = next[0] + next[1] * (1.0 + r) + next[2] * (1.0 + 2.0 * r + r2);
            row[DEGREE - 1] = -next[1] * r - next[2] * (2.0 * r + 2.0 * r2);
            row[DEGREE - 2] = next[2] * r2;
            row[POINTS..].copy_from_slice(&next[3..]);
            rows.push(row);
        }
        let unknowns = POINTS - given + if has_next { 5 } else { 0 };
        let product = |i: usize, j: usize| rows.iter().map(|row| row[given + i] * row[given + j]).sum();
        let factor = DMatrix::from_fn(unknowns, unknowns, product).cholesky()?;
        Some(Self { given, ratio, rows, factor })
    }

    /// Returns the unknown coefficients, a row each. `place` gives the position at an instant of the first or second
    /// piece.
    fn solve(&self, points: &[Vector3<f64>; POINTS], place: impl Fn(usize, usize) -> Vector3<f64>) -> MatrixXx3<f64> {
        let mut solved = MatrixXx3::zeros(self.factor.l_dirty().nrows());
        for (index, row) in self.rows.iter().enumerate() {
            let fixed = points[..self.given].iter().zip(row).fold(Vector3::zeros(), |sum, (point, w)| sum + point * *w);
            let rest = place(index / INSTANTS, index % INSTANTS) - fixed;
            for (mut solved, weight) in solved.row_iter_mut().zip(&row[self.given..]) {
                solved += rest.transpose() * *weight;
            }
        }
        self.factor.solve_mut(&mut solved);
        solved
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::vector;

    use super::*;
    use crate::export::drones::motion::deviation;

    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "some thousand samples")]
    fn sampled(duration_s: f64, hz: f64, place: impl Fn(f64) -> Vector3<f64>) -> Motion {
        let count = (duration_s * hz).round() as usize;
        let time = |k: usize| k as f64 / hz;
        let arc = |k| Arc::straight(time(k), time(k + 1), place(time(k)), place(time(k + 1)));
        Motion { arcs: (0..count).map(arc).collect() }
    }

    fn curve(pieces: &[Piece]) -> Motion {
        let mut from_ms = 0;
        let arc = |piece: &Piece| {
            let to_ms = from_ms + u64::from(piece.duration_ms);
            let arc =
                Arc { from_s: seconds(from_ms), to_s: seconds(to_ms), points: piece.points.to_vec(), rounding_m: 0.0 };
            from_ms = to_ms;
            arc
        };
        Motion { arcs: pieces.iter().map(arc).collect() }
    }

    /// Figure of eight, 2 m wide, one turn in 8 s.
    fn eight(t: f64) -> Vector3<f64> {
        let phase = std::f64::consts::TAU * t / 8.0;
        vector![2.0 * phase.sin(), (2.0 * phase).sin(), 1.0 + 0.2 * phase.cos()]
    }

    #[test]
    fn curve_is_within_the_tolerance_and_looser_ones_need_fewer_pieces() {
        let motion = sampled(24.0, 100.0, eight);
        let mut counts = Vec::new();
        for tolerance_m in [2e-4, 0.01, 0.2] {
            let pieces = fit(&motion, tolerance_m, |_| true, &|| false).expect("fits");
            let found = deviation(&motion, &curve(&pieces)).expect("common time");
            assert!(found.bound_m <= tolerance_m * 1.02 && found.bound_m > 0.05 * tolerance_m, "{found:?}");
            counts.push(pieces.len());
        }
        assert!(counts[0] > counts[1] && counts[1] > counts[2] && counts[1] <= 7, "{counts:?}");
    }

    #[test]
    fn joints_are_continuous_to_the_second_derivative() {
        let pieces = fit(&sampled(24.0, 100.0, eight), 0.01, |_| true, &|| false).expect("fits");
        assert!(pieces.len() > 3);
        for pair in pieces.windows(2) {
            let [before, after] = [&pair[0], &pair[1]];
            let [t1, t2] = [before, after].map(|piece| f64::from(piece.duration_ms) / 1e3);
            let (b, c) = (before.points, after.points);
            assert!((b[7] - c[0]).norm() < 1e-12);
            assert!(((b[7] - b[6]) / t1 - (c[1] - c[0]) / t2).norm() < 1e-10);
            let bends = (b[7] - b[6] * 2.0 + b[5]) / (t1 * t1) - (c[2] - c[1] * 2.0 + c[0]) / (t2 * t2);
            assert!(bends.norm() < 1e-8, "{bends}");
        }
    }

    #[test]
    fn rest_is_one_piece_and_a_jump_is_refused() {
        let still = sampled(30.0, 10.0, |_| vector![1.0, 2.0, 3.0]);
        assert_eq!(fit(&still, 0.01, |_| true, &|| false).expect("fits").len(), 1);
        let jump = sampled(4.0, 10.0, |_| Vector3::zeros());
        let mut jump = jump;
        for arc in &mut jump.arcs[20..] {
            arc.points = vec![vector![5.0, 0.0, 0.0]];
        }
        let FitError::TooFast(time_s) = fit(&jump, 0.01, |_| true, &|| false).expect_err("refused") else { panic!() };
        assert!((1.9..=2.0).contains(&time_s), "{time_s}");
        assert_eq!(fit(&still, 0.01, |_| true, &|| true), Err(FitError::Interrupted));
    }

    #[test]
    fn end_is_rounded_up_to_a_millisecond() {
        let motion = |to_s| Motion { arcs: vec![Arc::straight(0.0, to_s, Vector3::zeros(), Vector3::zeros())] };
        for (to_s, expected) in [(1.0, 1000), (0.3 - 0.1 + 0.1, 300), (1.0004, 1001), (0.0, 1)] {
            assert_eq!(end_ms(&motion(to_s)), expected, "{to_s}");
        }
    }
}
