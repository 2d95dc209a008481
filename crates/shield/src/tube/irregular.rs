//! Error tube with irregular instants: the time between two of them is only known to lie in a range.
//!
//! # The loop
//! The times T between instants are any sequence in \[`h-`, H\]. There is no lag, and measurements are of the instant.
//! With e = p - p^, d = v - v^ and the feedback f held from instant to instant:
//!
//! ```text
//! e' = d,   d' = a22 d + f + q,   |q(s)| <= W + |a22| A s   s seconds after the instant
//! f = -kp e - kd d + n,   |n| <= kp eps_p + kd eps_v
//! ```
//!
//! The reference knows T only within an error, so e and d jump at each instant, within bounds.
//!
//! # A norm that no sequence leaves
//! For a fixed sequence of times all responses are scalars, as in the regular loop. So the bounds of one axis hold for
//! vectors. Let X be a symmetric convex set of states and V(z) = max z.x over X its support function, which is a norm.
//! X contains the states at all instants if V is at least that of the start, and for every direction z
//!
//! ```text
//! V(z) >= max over T in [h-, H] of  V(Phi(T)' z) + |z.b(T)| n + integral_0^T |z.c(s)| (W + |a22| A (T - s)) ds
//!         + |z| . jumps
//! ```
//!
//! Phi(T) is the map of the loop over T, b the response to f, and c that to a push. This is induction over the
//! instants, for any sequence of times. The proof does not depend on how V was found.
//!
//! # Enclosure
//! V is stored at 256 directions of half a circle. Between two of them it is at most their combination, because
//! a norm is convex. With n cells of length c in \[0, H\], Phi(T)' z is on each cell the linear interpolation of its
//! ends plus a remainder. The remainder is at most c^2/8 times its largest second derivative, so V is at most the
//! larger one of its ends plus V of the remainder. The same holds for b, for c, and for the integral, whose slope
//! changes by at most |z.c'| W + |z.c| |a22| A in a unit of time. So the right side is at most the larger one of the
//! values at the two ends of a cell, plus the remainders.
//!
//! Let F be the right side above, and L its part that depends on V. L is sublinear. First a norm U with
//! L(U) <= U - 1 + `eps` is found by iteration, with `eps` < 1. Then V is iterated from the start until
//! F(V) <= V + `rest`, and the bound is V + `rest` / (1 - `eps`) U. It holds, since
//! F(V + g U) <= V + `rest` + g (U - 1 + `eps`) = V + g U for this g. Without such a U no sum converges, and the loop
//! is refused.
//!
//! # Rounding
//! Numbers of F are sums of fewer than 300 products. Each is at most the largest value of V or of the inputs. The
//! factors of a combination have the condition 1 / sin(pi / 256), which is below 100. A part of 1e-11 of the largest
//! value covers their rounding, and is in `rest`. The results are multiplied by 1 + 1e-9.

use super::{TrackerLoop, Tube, TubeError};

/// Number of directions of half a circle.
const NODES: usize = 256;
/// Number of cells of the longest time between instants.
const CELLS: usize = 32;
/// Largest number of iterations.
const MAX_ITERATIONS: usize = 10_000;
/// Size of the norm U from which the loop counts as one that does not contract.
const GROWN: f64 = 1e5;
/// Rest at which the iteration of the norm U stops.
const NORM_REST: f64 = 1e-2;
/// Part of a bound that the iteration may leave to its rest.
const REST: f64 = 1e-4;
/// Rounding of F relative to the largest value.
const ROUNDING: f64 = 1e-11;
/// Factor of the rounding of the results.
const RESULT: f64 = 1.0 + 1e-9;

/// Largest product of the drag and the longest time between instants, for the series of the exponential.
pub(crate) const LARGEST_DRAG: f64 = 1.0;

/// Times between instants, and what a vehicle does not know of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intervals {
    /// Shortest time between two instants \[s\].
    pub shortest_s: f64,
    /// Longest time between two instants \[s\].
    pub longest_s: f64,
    /// Largest jumps of the reference at an instant, of position \[m\] and velocity \[m/s\], because the time since the
    /// last instant is known with an error.
    pub jumps: [f64; 2],
}

/// Bounds of the inputs of the loop.
#[derive(Clone, Copy, Default)]
struct Inputs {
    /// Errors of position and velocity at the start.
    start: [f64; 2],
    /// Feedback beside that of the state \[m/s^2\].
    noise: f64,
    /// Push \[m/s^2\], and its growth after an instant \[m/s^3\].
    push: [f64; 2],
    /// Jumps of position and velocity at each instant.
    jumps: [f64; 2],
    /// Bound of the jump in each direction of unit length.
    ball: f64,
}

/// Bounds that hold for all sequences of times.
#[derive(Clone, Copy)]
struct Bounds {
    error: f64,
    feedback: f64,
}

impl TrackerLoop {
    /// Returns the tube with irregular instants. Period and age of a measurement of this loop have no effect.
    ///
    /// # Errors
    /// If the loop has a lag, does not settle for every sequence of times, or settles too slowly. Also if the drag is
    /// too large for the longest time.
    pub fn irregular_tube(&self, intervals: &Intervals) -> Result<Tube, TubeError> {
        if self.actuator_lag_s > 0.0 {
            return Err(TubeError::IrregularLag);
        }
        if self.a22_per_s.abs() * intervals.longest_s > LARGEST_DRAG {
            return Err(TubeError::LargeDrag);
        }
        let [kp, kd] = [self.tracker_per_s2, self.tracker_per_s];
        let table = Table::new(self, intervals);
        let norm = table.norm()?;
        let slope = self.a22_per_s.abs() * self.accel_m_s2;
        let inputs = Inputs {
            start: [self.position_error_m, self.velocity_error_m_s],
            noise: kp * self.position_error_m + kd * self.velocity_error_m_s,
            push: [self.disturbance_m_s2, slope],
            jumps: intervals.jumps,
            ball: 0.0,
        };
        let known = table.bounds(&inputs, &norm)?;
        let jumping = table.bounds(&Inputs { jumps: [1.0; 2], ..Inputs::default() }, &norm)?;
        let tube = Tube {
            error_m: known.error * RESULT,
            feedback_m_s2: known.feedback * RESULT,
            jumps: jumping.error * RESULT,
        };
        let is_finite = tube.error_m.is_finite() && tube.feedback_m_s2.is_finite() && tube.jumps.is_finite();
        if is_finite { Ok(tube) } else { Err(TubeError::Unstable) }
    }
}

/// Direction as a combination of two neighbouring nodes.
#[derive(Clone, Copy)]
struct Place {
    nodes: [usize; 2],
    factors: [f64; 2],
}

/// Responses of the loop in a direction over a time from an instant on.
struct Point {
    /// Direction of the state at the instant.
    place: Place,
    /// Responses to the noise, to a constant push, and to one that grows by 1 per second.
    inputs: [f64; 3],
}

/// Responses of the loop in a direction over times from an instant on.
struct Row {
    /// Responses at each grid point from the first one on.
    points: Vec<Point>,
    /// Remainders of the interpolation between grid points: of position and velocity, and of inputs.
    remainders: [f64; 2],
    input_remainders: [f64; 3],
    /// Direction.
    direction: [f64; 2],
}

/// Responses of the loop in all directions.
struct Table<'a> {
    tracker: &'a TrackerLoop,
    /// Factor between velocity and position in the length of a direction \[1/s\].
    rate_per_s: f64,
    rows: Vec<Row>,
    /// Direction of position, over all times since an instant.
    position: Row,
}

impl<'a> Table<'a> {
    fn new(tracker: &'a TrackerLoop, intervals: &Intervals) -> Self {
        let rate_per_s = tracker.tracker_per_s2.sqrt();
        let cell_s = intervals.longest_s / CELLS as f64;
        // In 0..CELLS.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let first = ((intervals.shortest_s / cell_s * (1.0 - 1e-12)).floor().max(0.0) as usize).min(CELLS - 1);
        let direction = |node: usize| {
            let [along, across] = unit(node);
            [along, across / rate_per_s]
        };
        Self {
            tracker,
            rate_per_s,
            rows: (0..NODES).map(|node| Row::new(tracker, rate_per_s, cell_s, first, direction(node))).collect(),
            position: Row::new(tracker, rate_per_s, cell_s, 0, [1.0, 0.0]),
        }
    }

    /// Returns the norm U and its rest.
    fn norm(&self) -> Result<(Vec<f64>, f64), TubeError> {
        let inputs = Inputs { ball: 1.0, ..Inputs::default() };
        let mut values = vec![0.0; NODES];
        for _ in 0..MAX_ITERATIONS {
            let next = self.next(&values, &inputs);
            let rest = rest(&values, &next);
            if largest(&next) > GROWN {
                return Err(TubeError::Unstable);
            }
            if rest <= NORM_REST {
                return Ok((values, rest));
            }
            values = next;
        }
        Err(TubeError::Slow)
    }

    /// Returns the bounds of inputs.
    fn bounds(&self, inputs: &Inputs, (norm, norm_rest): &(Vec<f64>, f64)) -> Result<Bounds, TubeError> {
        let grown = largest(norm);
        let mut values = self.starts(inputs);
        for _ in 0..MAX_ITERATIONS {
            let next = self.next(&values, inputs);
            let rest = rest(&values, &next);
            let size = largest(&next);
            if !size.is_finite() {
                return Err(TubeError::Unstable);
            }
            if rest * grown <= REST * size || size == 0.0 {
                let factor = rest / (1.0 - norm_rest);
                let values: Vec<_> = values.iter().zip(norm).map(|(value, unit)| value + factor * unit).collect();
                let error = self.largest(&self.position, &values, inputs);
                let gains = [self.tracker.tracker_per_s2, self.tracker.tracker_per_s];
                let feedback = Place::new(gains, self.rate_per_s).value(&values) + inputs.noise;
                return Ok(Bounds { error, feedback });
            }
            values = next;
        }
        Err(TubeError::Slow)
    }

    fn starts(&self, inputs: &Inputs) -> Vec<f64> {
        let start = |row: &Row| weighted(row.direction, inputs.start);
        self.rows.iter().map(start).collect()
    }

    /// Returns F.
    fn next(&self, values: &[f64], inputs: &Inputs) -> Vec<f64> {
        let next = |row: &Row| {
            let jumps = weighted(row.direction, inputs.jumps) + inputs.ball;
            weighted(row.direction, inputs.start).max(self.largest(row, values, inputs) + jumps)
        };
        self.rows.iter().map(next).collect()
    }

    /// Returns the largest value in the direction of a row over its times.
    fn largest(&self, row: &Row, values: &[f64], inputs: &Inputs) -> f64 {
        let bounds = [inputs.noise, inputs.push[0], inputs.push[1]];
        let of_inputs =
            |responses: &[f64; 3]| responses.iter().zip(bounds).map(|(one, bound)| one * bound).sum::<f64>();
        let [position, velocity] = row.remainders;
        let remainder = position * values[0] + velocity * self.rate_per_s * values[NODES / 2];
        let at_point = |point: &Point| point.place.value(values) + of_inputs(&point.inputs);
        row.points.iter().map(at_point).fold(0.0, larger) + remainder + of_inputs(&row.input_remainders)
    }
}

impl Row {
    fn new(tracker: &TrackerLoop, rate_per_s: f64, cell_s: f64, first: usize, direction: [f64; 2]) -> Self {
        let [position, velocity] = direction;
        let [kp, kd, a22] = [tracker.tracker_per_s2, tracker.tracker_per_s, tracker.a22_per_s];
        let longest_s = cell_s * CELLS as f64;
        let growth = (a22 * longest_s).exp().max(1.0) * (1.0 + 1e-12);
        let square = cell_s * cell_s / 8.0 * growth;
        let bend = square * (position.abs() + a22.abs() * velocity.abs());
        let grid = |point: usize| integrals(a22, cell_s * point as f64);
        let responses: Vec<_> = (0..=CELLS)
            .map(|point| {
                let [decay, once, _] = grid(point);
                (position * once + velocity * decay).abs()
            })
            .collect();
        let points = (first..=CELLS).map(|point| {
            let [decay, once, twice] = grid(point);
            let of_feedback = position * twice + velocity * once;
            let before = [position - kp * of_feedback, position * once + velocity * decay - kd * of_feedback];
            let [constant, growing] = pushed(&responses[..=point], a22.abs() * bend, cell_s);
            Point { place: Place::new(before, rate_per_s), inputs: [of_feedback.abs(), constant, growing] }
        });
        Self {
            points: points.collect(),
            remainders: [kp * bend, (kd + a22.abs()) * bend],
            input_remainders: [bend, bend, square * (position.abs() * longest_s + velocity.abs())],
            direction,
        }
    }
}

/// Returns the integrals over time, up to a last grid point, of absolute responses to a push of 1 and to one that grows
/// by 1 per second. Between grid points the responses exceed their linear interpolation by at most `bend`.
fn pushed(responses: &[f64], bend: f64, cell_s: f64) -> [f64; 2] {
    let points = responses.len() - 1;
    let mut sums = [0.0; 2];
    for cell in 0..points {
        let [from, to] = [responses[cell] + bend, responses[cell + 1] + bend];
        // The push at a response s before the end has grown until then.
        let [early, late] = [points - cell, points - cell - 1].map(|cells| cell_s * cells as f64);
        sums[0] += cell_s * f64::midpoint(from, to);
        sums[1] += cell_s * ((from * early + to * late) / 3.0 + (from * late + to * early) / 6.0);
    }
    sums
}

impl Place {
    /// Returns the nodes on both sides of a direction.
    fn new([position, velocity]: [f64; 2], rate_per_s: f64) -> Self {
        let vector = [position, velocity * rate_per_s];
        let angle = vector[1].atan2(vector[0]).rem_euclid(std::f64::consts::PI);
        // In 0..NODES, also for an angle that is not a number.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let node = ((angle / std::f64::consts::PI * NODES as f64).floor() as usize).min(NODES - 1);
        let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
        let (before, after) = (unit(node), unit(node + 1));
        let sine = cross(before, after);
        // The signs have no effect on a norm.
        let factors = [cross(vector, after), cross(before, vector)].map(|product| (product / sine).abs());
        Self { nodes: [node, (node + 1) % NODES], factors }
    }

    fn value(&self, values: &[f64]) -> f64 {
        self.factors[0] * values[self.nodes[0]] + self.factors[1] * values[self.nodes[1]]
    }
}

/// Returns the direction of a node, of length 1.
fn unit(node: usize) -> [f64; 2] {
    let (sin, cos) = (std::f64::consts::PI * node as f64 / NODES as f64).sin_cos();
    [cos, sin]
}

/// Returns exp(a t) and its first and second integral over time, for |a t| up to [`LARGEST_DRAG`].
pub(crate) fn integrals(a_per_s: f64, seconds: f64) -> [f64; 3] {
    // Series of (exp(x) - 1 - x) / x^2, with |x| <= 1.
    let x = a_per_s * seconds;
    let (mut sum, mut term) = (0.0, 0.5);
    for k in 3..24 {
        sum += term;
        term *= x / f64::from(k);
    }
    let once = 1.0 + x * sum;
    [1.0 + x * once, seconds * once, seconds * seconds * sum]
}

fn weighted(direction: [f64; 2], bounds: [f64; 2]) -> f64 {
    direction[0].abs() * bounds[0] + direction[1].abs() * bounds[1]
}

/// Returns the larger one of two values; infinite if one is not a number.
fn larger(one: f64, other: f64) -> f64 {
    if one.is_nan() || other.is_nan() { f64::INFINITY } else { one.max(other) }
}

fn largest(values: &[f64]) -> f64 {
    values.iter().copied().fold(0.0, larger)
}

/// Returns the largest excess of new values over old ones, and the rounding of the new ones.
fn rest(values: &[f64], next: &[f64]) -> f64 {
    let excess = values.iter().zip(next).map(|(value, next)| next - value).fold(0.0, f64::max);
    excess + ROUNDING * largest(next)
}

#[cfg(test)]
mod tests;
