//! Error tube of the tracker: bounds on the distance from a vehicle to its reference and on the feedback.
//!
//! # The sampled loop
//! The reference has p^'' = u^ with u^ held over each period h. The vehicle has p'' = a22 p' + r + w. Its command is
//! `u = u^ - a22 v^ + f` with the feedback f held too. The actuator carries it out, r = u, or with a lag
//! r' = (u - r) / lag from r = 0 at the start. The feedback is `-kp (p_m - p^) - kd (v_m - v^)` of a measurement that
//! is a whole number of periods old. With e = p - p^ and d = u^ - a22 v^ at the last instant, s seconds after it:
//!
//! ```text
//! e'' = a22 e' + f + q            without lag,   |q(s)| <= W + |a22| A s
//! e'' = a22 e' + r - d + q        with lag,      r' = (f + d - r) / lag,   |d| <= A
//! ```
//!
//! q contains the push w and a22 times the change of v^ since the instant. Gains are equal on all axes, so each impulse
//! response is a scalar. By the triangle inequality |e| is at most the sum of the absolute responses times the bounds
//! of their inputs. These are noise (`kp eps_p + kd eps_v` in f), push, d, and the start error (`eps_p`, `eps_v`).
//!
//! Irregular instants have another bound, which [`irregular`] derives.
//!
//! # Enclosure
//! With n cells of length c = h / n in a period, each bound holds between the grid points too:
//!
//! - A response is twice differentiable in time. On a cell its absolute value is at most the linear interpolation of
//!   the absolute values at the ends plus c^2 / 8 times a bound of its second derivative. A sum of such functions is at
//!   most the larger of its two ends plus the sum of these terms.
//! - The integral over the time of a push uses the same interpolation, times the linear bound of q, in closed form. The
//!   part of a push in its own period is convex in time.
//! - Let the power L of the loop have a norm n below 1. The norms of this and all later powers sum to at most
//!   n / (1 - n) times the sum of the norms before. This bounds the tail, and proves that the loop is stable.
//!
//! # Rounding
//! The sums are computed in doubles, with u = 2^-53. Their rounding is bounded and added. Norms are the largest row
//! sums, and hats mark computed values. Products of m terms err by at most 1.01 m u times the product of the norms.
//!
//! - **Cell.** E = exp(X) with |X| <= 0.5. X errs by 3.1 u |X| (length of a cell, rate of the lag, product). The k-th
//!   term of the series errs by 6.2 k u |X|^k / k!, and the sum of 21 terms by 20.2 u exp(0.5). In all E errs by less
//!   than 45 u.
//! - **Grid.** G of the next point is E times G of this one. The computed step errs by F with |F| <= 60 u |G^|. The
//!   error after i steps is the sum of G(i-1-j) F(j), so with g^ the largest computed norm of n points it is at most
//!   `eps_g` = 60 u n g^^2 / (1 - 60 u n g^).
//! - **Step.** The map S from instant to instant is G times the lift, of norm l. It errs by
//!   `eps_s` = (`eps_g` + 5.1 u g^) l. The map to the grid points has the same bound.
//! - **Powers.** A computed power is S times the last one plus F with |F| <= phi |last one|. Here phi is `eps_s` + 1.01
//!   o u |S^| and o is the order. As for the grid, the norms N of all true powers sum to at most N^ / (1 - phi N^). A
//!   power errs by at most phi N N^. The powers of a column x of inputs have norms that sum to at most M = N (|x^| + 2
//!   `eps_g`) / (1 - phi N). Their errors sum to at most N (`eps_g` + phi M).
//! - **Sum.** Let Q be the norm of the map from the state to the bounded quantity, and `eps_q` its error. The sum over
//!   all periods errs by Q N (`eps_g` + phi M) + `eps_q` M, times the bound of each input. The start errs by (Q phi N
//!   N^ + `eps_q` N) times its bound. All terms of the sums are positive, so adding K periods errs by less than (K +
//!   400) u of the sum.
//!
//! The numbers of this bound are rounded too: the terms above are doubled. `proofs/tube.v` proves the rows of the cell
//! and of the grid, given the error of X.

pub mod irregular;

use nalgebra::{DMatrix, DVector, Dim, Matrix, RawStorage, RowDVector, SMatrix};

pub use irregular::Intervals;
pub(crate) use irregular::{LARGEST_DRAG, integrals};

/// Smallest number of cells of a period.
const CELLS: usize = 16;
/// Largest number of cells, which limits how short a lag may be.
const MAX_CELLS: usize = 256;
/// Largest product of the norm of the continuous dynamics and the length of a cell.
const CELL_RATE: f64 = 0.5;
/// Terms of the exponential series of a cell; the remainder is below 0.5^21 / 21! = 1e-26.
const TERMS: u32 = 20;
/// Norm of a power of the loop at which the sum stops.
const CONTRACTED: f64 = 1e-13;
/// Norm of a power of the loop from which it counts as unstable.
const GROWN: f64 = 1e9;
/// Largest number of periods that are summed.
const MAX_PERIODS: usize = 50_000;
/// Bound on the error of a step of the grid, in units of rounding.
const GRID_STEP: f64 = 60.0;
/// Roundings of a sum beside those of its periods.
const OTHER_ROUNDINGS: f64 = 400.0;

/// Continuous state: error of position, error of velocity, actuator, feedback, held command of the reference.
const STATES: usize = 5;
const POSITION: usize = 0;
const VELOCITY: usize = 1;
const ACTUATOR: usize = 2;
const FEEDBACK: usize = 3;
const HELD: usize = 4;
/// Components of the continuous state that continue over an instant.
const CARRIED: usize = 3;

type Continuous = SMatrix<f64, STATES, STATES>;

/// Tracker of a reference with bounds on all that disturbs it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrackerLoop {
    /// Period h of the tracker \[s\].
    pub period_s: f64,
    /// Gain kp on position \[1/s^2\].
    pub tracker_per_s2: f64,
    /// Gain kd on velocity \[1/s\].
    pub tracker_per_s: f64,
    /// Bound `eps_p` on the error of a measured position \[m\].
    pub position_error_m: f64,
    /// Bound `eps_v` on the error of a measured velocity \[m/s\].
    pub velocity_error_m_s: f64,
    /// Bound W on the push \[m/s^2\].
    pub disturbance_m_s2: f64,
    /// Drag a22 \[1/s\]; negative slows.
    pub a22_per_s: f64,
    /// Bound A on the command \[m/s^2\].
    pub accel_m_s2: f64,
    /// Age of a measurement when it is used, in periods.
    pub measurement_delay_periods: usize,
    /// Time constant of the actuator \[s\]; 0 for none.
    pub actuator_lag_s: f64,
}

/// Bounds that hold at all times, for all noises and pushes within their bounds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tube {
    /// Bound e on the distance to the reference \[m\].
    pub error_m: f64,
    /// Bound `A_t` on the feedback \[m/s^2\].
    pub feedback_m_s2: f64,
    /// Largest distance to a reference that jumps by 1 m and 1 m/s at each instant \[m\], for the rounding of the
    /// reference.
    pub jumps: f64,
}

/// Reason why a loop has no tube.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TubeError {
    /// The sampled loop does not contract.
    Unstable,
    /// The sampled loop contracts too slowly, or not at all.
    Slow,
    /// The lag is too short a part of the period for the enclosure.
    ShortLag,
    /// The period is too long for the enclosure, whatever the lag and the drag are.
    LongPeriod,
    /// The drag is too large for the enclosure with this period.
    LargeDrag,
    /// The enclosure with irregular instants covers no lag.
    IrregularLag,
}

/// Largest product of the norm of the continuous dynamics and the period.
const PERIOD_RATE: f64 = CELL_RATE * MAX_CELLS as f64;

/// Returns the shortest lag of a period that the enclosure covers \[s\].
pub(crate) fn shortest_lag_s(period_s: f64) -> f64 {
    // The row of the actuator has three entries of 1/lag.
    3.0 * period_s / PERIOD_RATE
}

/// Returns the longest period that the enclosure covers \[s\].
pub(crate) fn longest_period_s(has_lag: bool) -> f64 {
    PERIOD_RATE / entries_of_velocity(has_lag)
}

/// Returns the largest magnitude of the drag that the enclosure covers with a period \[1/s\].
pub(crate) fn largest_drag_per_s(period_s: f64, has_lag: bool) -> f64 {
    PERIOD_RATE / period_s - entries_of_velocity(has_lag)
}

/// Returns the sum of the entries in the row of the velocity without the drag.
fn entries_of_velocity(has_lag: bool) -> f64 {
    if has_lag { 2.0 } else { 1.0 }
}

impl TrackerLoop {
    /// Returns the tube.
    ///
    /// # Errors
    /// If the loop is unstable or contracts too slowly. If the lag is below about a fortieth of the period, or the
    /// period or the drag is too large for the enclosure.
    pub fn tube(&self) -> Result<Tube, TubeError> {
        let sampled = Sampled::new(self)?;
        if !sampled.step.iter().all(|value| value.is_finite()) {
            return Err(TubeError::Unstable);
        }
        let mut tube = Tube { error_m: 0.0, feedback_m_s2: 0.0, jumps: 0.0 };
        let mut sums = Sums::own_period(&sampled);
        let mut inputs = sampled.inputs.clone();
        let mut starts = sampled.starts.clone();
        let mut power = DMatrix::identity(sampled.order(), sampled.order());
        let mut norms = 0.0;
        for period in 0..MAX_PERIODS {
            let start = Sums::of_start(&sampled, &starts);
            tube.error_m = tube.error_m.max(sums.error_m(&start));
            tube.feedback_m_s2 = tube.feedback_m_s2.max(sums.feedback + start.feedback);
            let norm = row_sum_norm(&power);
            if period > 0 && norm <= CONTRACTED {
                return sampled.with_tail(tube, norm, norms, period).ok_or(TubeError::Slow);
            }
            tube.jumps += (&sampled.positions * &starts).column_iter().map(|column| column.amax()).sum::<f64>();
            if norm > GROWN {
                return Err(TubeError::Unstable);
            }
            norms += norm;
            sums.add(&sampled, &inputs);
            inputs = &sampled.step * inputs;
            starts = &sampled.step * starts;
            power = &sampled.step * power;
        }
        Err(TubeError::Slow)
    }

    /// Returns the integrals, from an instant over some cells, of the bound of q times the hat function of each point.
    ///
    /// A hat function is 1 at its point, 0 at its neighbours and linear between. The weighted sum of the values of a
    /// function at the points is the integral of its linear interpolation times the bound of q.
    fn push_weights(&self, cells: usize, cell_s: f64) -> DVector<f64> {
        let bound = |k: usize| self.disturbance_m_s2 + self.a22_per_s.abs() * self.accel_m_s2 * cell_s * k as f64;
        let mut weights = DVector::zeros(cells + 1);
        for cell in 0..cells {
            let (from, to) = (bound(cell), bound(cell + 1));
            weights[cell] += cell_s * (from / 3.0 + to / 6.0);
            weights[cell + 1] += cell_s * (from / 6.0 + to / 3.0);
        }
        weights
    }
}

/// Loop from instant to instant, with the states of the inputs at the end of their own period.
struct Sampled {
    tracker: TrackerLoop,
    cells: usize,
    /// Length of a cell \[s\].
    cell_s: f64,
    /// Continuous dynamics over 0 to `cells` cells.
    grid: Vec<Continuous>,
    /// Bound on the second derivative of the continuous state, entry by entry.
    curvature: Continuous,
    /// Map from the state at an instant to the continuous state after it.
    lift: DMatrix<f64>,
    /// Map from the state at an instant to that at the next one.
    step: DMatrix<f64>,
    /// Map from the state at an instant to the error of position at each grid point, a row per point.
    positions: DMatrix<f64>,
    /// Map from the state at an instant to the feedback.
    feedback: RowDVector<f64>,
    /// States at the end of the period of an input: noise, held command, push at each grid point, and the unit states
    /// of the components with an error of interpolation.
    inputs: DMatrix<f64>,
    /// Unit errors of position and velocity.
    starts: DMatrix<f64>,
    /// Bounds of noise and of the held command.
    bounds: [f64; 2],
    /// Weights of the push at each grid point: integrals of the bound of q times the hat function of the point.
    weights: DVector<f64>,
    /// Bounds of the interpolation of the push in each component.
    interpolation: [f64; CARRIED],
}

impl Sampled {
    fn new(tracker: &TrackerLoop) -> Result<Self, TubeError> {
        let mut dynamics = Continuous::zeros();
        dynamics[(POSITION, VELOCITY)] = 1.0;
        dynamics[(VELOCITY, VELOCITY)] = tracker.a22_per_s;
        if tracker.actuator_lag_s > 0.0 {
            let rate = 1.0 / tracker.actuator_lag_s;
            (dynamics[(VELOCITY, ACTUATOR)], dynamics[(VELOCITY, HELD)]) = (1.0, -1.0);
            dynamics[(ACTUATOR, ACTUATOR)] = -rate;
            (dynamics[(ACTUATOR, FEEDBACK)], dynamics[(ACTUATOR, HELD)]) = (rate, rate);
        } else {
            dynamics[(VELOCITY, FEEDBACK)] = 1.0;
        }
        let magnitude = dynamics.map(f64::abs);
        let rate = magnitude.row_iter().map(|row| row.sum()).fold(0.0, f64::max);
        let cells = (rate * tracker.period_s / CELL_RATE).ceil();
        if cells > MAX_CELLS as f64 {
            let has_lag = tracker.actuator_lag_s > 0.0;
            return Err(if has_lag && tracker.actuator_lag_s < shortest_lag_s(tracker.period_s) {
                TubeError::ShortLag
            } else if tracker.period_s > longest_period_s(has_lag) {
                TubeError::LongPeriod
            } else {
                TubeError::LargeDrag
            });
        }
        // In 0..=MAX_CELLS.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let cells = (cells as usize).max(CELLS);
        let cell_s = tracker.period_s / cells as f64;
        let cell = exponential(&(dynamics * cell_s));
        let mut grid = vec![Continuous::identity()];
        for _ in 0..cells {
            grid.push(cell * grid[grid.len() - 1]);
        }
        let largest = grid.iter().fold(Continuous::zeros(), |largest, value| largest.sup(&value.map(f64::abs)));
        let curvature = magnitude * magnitude * exponential(&(magnitude * cell_s)) * largest;

        let delay = tracker.measurement_delay_periods;
        let order = CARRIED + delay;
        let gains = [tracker.tracker_per_s2, tracker.tracker_per_s];
        let mut feedback = RowDVector::zeros(order);
        if delay == 0 {
            (feedback[POSITION], feedback[VELOCITY]) = (-gains[0], -gains[1]);
        } else {
            feedback[order - 1] = -1.0;
        }
        let mut lift = DMatrix::zeros(STATES, order);
        lift.view_mut((0, 0), (CARRIED, CARRIED)).fill_with_identity();
        if tracker.actuator_lag_s <= 0.0 {
            // Without a lag the actuator has no state.
            lift[(ACTUATOR, ACTUATOR)] = 0.0;
        }
        lift.row_mut(FEEDBACK).copy_from(&feedback);
        let whole = grid[cells].fixed_rows::<CARRIED>(0).into_owned();
        let mut step = DMatrix::zeros(order, order);
        step.rows_mut(0, CARRIED).copy_from(&(whole * &lift));
        for age in 0..delay {
            match age {
                0 => (step[(CARRIED, POSITION)], step[(CARRIED, VELOCITY)]) = (gains[0], gains[1]),
                _ => step[(CARRIED + age, CARRIED + age - 1)] = 1.0,
            }
        }
        let positions = DMatrix::from_fn(cells + 1, order, |point, column| {
            grid[point].row(POSITION).iter().zip(lift.column(column).iter()).map(|(row, lift)| row * lift).sum()
        });

        let mut inputs = DMatrix::zeros(order, 2 + cells + 1 + CARRIED);
        inputs.view_mut((0, 0), (CARRIED, 1)).copy_from(&whole.column(FEEDBACK));
        inputs.view_mut((0, 1), (CARRIED, 1)).copy_from(&whole.column(HELD));
        for point in 0..=cells {
            let column = grid[cells - point].fixed_view::<CARRIED, 1>(0, VELOCITY).into_owned();
            inputs.view_mut((0, 2 + point), (CARRIED, 1)).copy_from(&column);
        }
        inputs.view_mut((0, 2 + cells + 1), (CARRIED, CARRIED)).fill_with_identity();
        let mut starts = DMatrix::zeros(order, 2);
        (starts[(POSITION, 0)], starts[(VELOCITY, 1)]) = (1.0, 1.0);

        let noise = gains[0] * tracker.position_error_m + gains[1] * tracker.velocity_error_m_s;
        let held = if tracker.actuator_lag_s > 0.0 { tracker.accel_m_s2 } else { 0.0 };
        let weights = tracker.push_weights(cells, cell_s);
        let sum = weights.sum();
        let interpolation =
            std::array::from_fn(|component| cell_s * cell_s / 8.0 * curvature[(component, VELOCITY)] * sum);
        Ok(Self {
            tracker: *tracker,
            cells,
            cell_s,
            grid,
            curvature,
            lift,
            step,
            positions,
            feedback,
            inputs,
            starts,
            bounds: [noise, held],
            weights,
            interpolation,
        })
    }

    fn order(&self) -> usize {
        self.step.nrows()
    }

    /// Returns the bound of one period's inputs in a seminorm of the state, given its values for all columns of inputs.
    fn bound(&self, values: impl Fn(usize) -> f64) -> f64 {
        let push: f64 = self.weights.iter().enumerate().map(|(point, weight)| weight * values(2 + point)).sum();
        let between = self.interpolation.iter().enumerate();
        let between: f64 = between.map(|(k, bound)| bound * values(2 + self.cells + 1 + k)).sum();
        self.bounds[0] * values(0) + self.bounds[1] * values(1) + push + between
    }

    /// Returns the bound of the second derivative of the error of position for a continuous state after an instant.
    fn bend(&self, lifted: impl Iterator<Item = f64>) -> f64 {
        let row = self.curvature.row(POSITION);
        self.cell_s * self.cell_s / 8.0 * row.iter().zip(lifted).map(|(bound, value)| bound * value.abs()).sum::<f64>()
    }

    /// Adds the bounds of all later periods and of rounding. `None` if rounding hides whether the loop contracts.
    ///
    /// The names are those of the documentation of the module.
    fn with_tail(&self, tube: Tube, norm: f64, norms: f64, periods: usize) -> Option<Tube> {
        let u = f64::EPSILON / 2.0;
        let order = self.order() as f64;
        let start = self.tracker.position_error_m + self.tracker.velocity_error_m_s;
        let largest = self.grid.iter().map(row_sum_norm).fold(0.0, f64::max);
        let grid = GRID_STEP * u * self.cells as f64 * largest;
        let eps_grid = 2.0 * grid * largest / (1.0 - grid);
        let lift = row_sum_norm(&self.lift);
        let eps_step = 2.0 * (eps_grid + 5.1 * u * largest) * lift;
        let phi = eps_step + 2.0 * order * u * row_sum_norm(&self.step);
        let computed = norms * (1.0 + 2.0 * (periods as f64 + order) * u);
        if !(grid < 0.5 && phi * computed < 0.5) {
            return None;
        }
        let powers = computed / (1.0 - phi * computed) * (1.0 + 8.0 * u);
        // Norm of the last power, which all later ones contain as a factor.
        let last = norm + phi * powers * computed;
        if last >= 0.5 {
            return None;
        }
        let inputs = self.bound(|k| self.inputs.column(k).amax());
        let weight = self.bound(|_| 1.0);
        let columns = powers * (inputs + 2.0 * eps_grid * weight) / (1.0 - phi * powers);
        let error = powers * (eps_grid * weight + phi * columns) + phi * powers * computed * start;
        let tail = powers * last * ((inputs + eps_grid * weight) / (1.0 - last) + start);
        let bounded = |sum: f64, map: f64, eps_map: f64| {
            let rounding = (map + eps_map) * error + eps_map * (columns + powers * start) + 2.0 * eps_grid * weight;
            sum * (1.0 + (periods as f64 + OTHER_ROUNDINGS) * u) + 2.0 * rounding + 2.0 * (map + eps_map) * tail
        };
        let position = row_sum_norm(&self.positions);
        let lifted = self.lift.map(f64::abs);
        let bend = self.bend((0..STATES).map(|row| lifted.row(row).sum()));
        // The curvature contains the computed grid: (c rate)^2 / 8 exp(0.5) < 0.06.
        let eps_position = eps_step + 2.0 * order * u * position + 0.06 * eps_grid * lift + 100.0 * u * bend;
        let feedback = self.feedback.iter().map(|value| value.abs()).sum::<f64>();
        Some(Tube {
            error_m: bounded(tube.error_m, position + bend, eps_position),
            feedback_m_s2: bounded(tube.feedback_m_s2, feedback, 2.0 * order * u * feedback),
            jumps: tube.jumps,
        })
    }
}

/// Sums of the bounds of all periods so far, or bounds of the start.
struct Sums {
    /// Bound of the error of position at each grid point.
    positions: DVector<f64>,
    /// Bound of what linear interpolation between the grid points misses.
    bend: f64,
    feedback: f64,
}

impl Sums {
    /// Returns the bounds of the inputs in their own period.
    fn own_period(sampled: &Sampled) -> Self {
        let noise_and_held = |continuous: &Continuous| {
            sampled.bounds[0] * continuous[(POSITION, FEEDBACK)].abs()
                + sampled.bounds[1] * continuous[(POSITION, HELD)].abs()
        };
        let push = |point: usize| {
            let weights = sampled.tracker.push_weights(point, sampled.cell_s);
            let between =
                sampled.cell_s * sampled.cell_s / 8.0 * sampled.curvature[(POSITION, VELOCITY)] * weights.sum();
            let response = |k: usize| sampled.grid[point - k][(POSITION, VELOCITY)].abs();
            weights.iter().enumerate().map(|(k, weight)| weight * response(k)).sum::<f64>() + between
        };
        let positions =
            DVector::from_fn(sampled.cells + 1, |point, _| noise_and_held(&sampled.grid[point]) + push(point));
        let held = [(FEEDBACK, sampled.bounds[0]), (HELD, sampled.bounds[1])];
        let bend = sampled
            .bend((0..STATES).map(|k| held.iter().filter(|(state, _)| *state == k).map(|(_, bound)| bound).sum()));
        Self { positions, bend, feedback: sampled.bounds[0] }
    }

    /// Returns the bounds of the start error whose unit states are the columns.
    fn of_start(sampled: &Sampled, starts: &DMatrix<f64>) -> Self {
        let errors = [sampled.tracker.position_error_m, sampled.tracker.velocity_error_m_s];
        let errors = DVector::from_column_slice(&errors);
        let lifted = (&sampled.lift * starts).map(f64::abs) * &errors;
        Self {
            positions: (&sampled.positions * starts).map(f64::abs) * &errors,
            bend: sampled.bend(lifted.iter().copied()),
            feedback: ((&sampled.feedback * starts).map(f64::abs) * &errors)[0],
        }
    }

    /// Adds the bounds of the inputs of one earlier period, whose states are the columns.
    fn add(&mut self, sampled: &Sampled, inputs: &DMatrix<f64>) {
        let positions = &sampled.positions * inputs;
        for (point, sum) in self.positions.iter_mut().enumerate() {
            *sum += sampled.bound(|k| positions[(point, k)].abs());
        }
        let lifted = &sampled.lift * inputs;
        self.bend += sampled.bound(|k| sampled.bend(lifted.column(k).iter().copied()));
        let feedback = &sampled.feedback * inputs;
        self.feedback += sampled.bound(|k| feedback[k].abs());
    }

    fn error_m(&self, start: &Self) -> f64 {
        (&self.positions + &start.positions).max() + self.bend + start.bend
    }
}

/// Returns the exponential of a matrix whose norm is at most [`CELL_RATE`].
fn exponential(matrix: &Continuous) -> Continuous {
    let (mut sum, mut term) = (Continuous::identity(), Continuous::identity());
    for k in 1..=TERMS {
        term = term * matrix / f64::from(k);
        sum += term;
    }
    sum
}

/// Returns the norm of a matrix for the largest component: its largest sum of absolute values in a row.
fn row_sum_norm<R: Dim, C: Dim, S: RawStorage<f64, R, C>>(matrix: &Matrix<f64, R, C, S>) -> f64 {
    matrix.row_iter().map(|row| row.iter().map(|value| value.abs()).sum()).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests;
