//! Continuous time: solves p'' = a22 v + u(p, v) (equation (1)) with the law inside the right-hand side, without
//! sampling.
//!
//! [`solve`] is the reference for the physics engine. [`Continuous`] is the same solution as a plant: it advances step
//! by step and evaluates the law all the way along.
//!
//! # Method
//! Dormand and Prince's explicit Runge-Kutta method of order 8 with error control (Hairer, Norsett and Wanner, *Solving
//! Ordinary Differential Equations I*, II.5), from the crate `differential-equations`. Solver steps end at the output
//! times. A closest approach within a step is found by solving again from the beginning of the step. (The dense output
//! of the crate has an error of 2e-8 m where its steps have 1e-13 m.)
//!
//! # States outside the domain of the law
//! A trial step may evaluate the law at states where it is undefined, such as a pair within delta. Such a step is
//! refused and tried again with a shorter length. If no step is short enough, the solution ends with the law's error.

mod flow;
mod quadrotors;

pub use quadrotors::Quadrotors;

use differential_equations::methods::{DormandPrince, ExplicitRungeKutta, Ordinary};
use differential_equations::ode::OrdinaryNumericalMethod as _;
use flow::{Flow, FreeMotion, packed};
use nalgebra::Vector3;

use crate::plant::Feedback;
use crate::plant::{Air, Plant, PlantError, StepPath};
use crate::scenario::Scenario;
use tautline_core::record::Channel;
use tautline_core::swarm::{ClosestApproach, Pair, Rows, Swarm};
use tautline_laws::law::{Law, LawError};
use tautline_laws::observation::Observation;
use tautline_laws::space::CellList;

/// Law with exact knowledge of the present state.
struct Exact<'a> {
    law: &'a mut dyn Law,
    scenario: &'a Scenario,
    near: CellList,
}

impl Feedback for Exact<'_> {
    fn command(&mut self, time_s: f64, truth: &Swarm, command: &mut Rows) -> Result<(), LawError> {
        if let Some(range_m) = self.law.capabilities().sensing_range_m {
            self.near.update(&truth.positions_m, range_m);
        }
        let near = self.near.pairs();
        self.law.command(&Observation { near, ..self.scenario.observation_at(truth, time_s) }, command)
    }
}

/// First step that is tried \[s\]; the error control lengthens it up to tenfold per step, or shortens it.
const FIRST_STEP_S: f64 = 1e-3;
/// Step, or rest of an interval, relative to the output time, below which it is rounding.
const RESOLUTION: f64 = 1e-14;
/// Limit of solver steps per physics step; flights of stiff laws need hundreds.
const MOST_TRIALS: u32 = 100_000;
/// Resolution of the time of a closest approach \[s\]. The distance is stationary there: its error is (1e-7 s)^2/2
/// times its second derivative, less than 1e-12 m up to 200 m/s^2.
const CLOSEST_RESOLUTION_S: f64 = 1e-7;

/// Allowed error per solver step in each coordinate: `absolute + relative * |value|`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerances {
    /// Relative tolerance.
    pub relative: f64,
    /// Absolute tolerance, in m for positions and m/s for velocities.
    pub absolute: f64,
}

impl Default for Tolerances {
    /// Returns 1e-12 for both; with 1e-13 the reference flights change by less than 1e-11 m.
    fn default() -> Self {
        Self { relative: 1e-12, absolute: 1e-12 }
    }
}

/// Error of a solution.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum IdealError {
    /// The law is undefined from some time on.
    #[error("the solution ends at {time_s} s: {source}")]
    Law {
        /// Last time that was reached \[s\].
        time_s: f64,
        /// Error of the law.
        source: LawError,
    },
    /// No step is short enough for the tolerances, more than 100,000 steps are needed, or numbers overflow.
    #[error("the solution cannot be continued at {time_s} s: its tolerances need steps that are too short")]
    Stalled {
        /// Last time that was reached \[s\].
        time_s: f64,
    },
    /// The caller ended the solution.
    #[error("the solution was interrupted at {time_s} s")]
    Interrupted {
        /// Last time that was reached \[s\].
        time_s: f64,
    },
    /// The output times do not increase from 0, or are not finite.
    #[error("time {} is out of order: times ascend from 0 and are finite", entry + 1)]
    Times {
        /// First wrong entry, from 0.
        entry: usize,
    },
    /// A tolerance is not a positive finite number.
    #[error("tolerances must be positive finite numbers")]
    Tolerances,
}

/// Solution at the output times.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// State at each output time.
    pub states: Vec<Swarm>,
    /// Closest approach of any pair from time 0 to the last output time, also between output times. `None` for fewer
    /// than two vehicles.
    pub closest: Option<ClosestApproach>,
}

/// Solves p'' = a22 v + u(p, v) from the scenario's start at time 0 under `law`, which knows the exact present state.
/// Returns the states at `times_s` \[s\], which increase from 0.
///
/// # Accuracy
/// The error per solver step is within the tolerances, and stable motion damps it: positions and the closest approach
/// of the reference flights are accurate to 1e-11 m. The search assumes that the distance of a pair has at most one
/// minimum per solver step.
///
/// # Errors
/// [`IdealError`] if the law is undefined on the way, the times do not increase, or the tolerances cannot be met.
pub fn solve(
    scenario: &Scenario,
    law: &mut dyn Law,
    times_s: &[f64],
    tolerances: Tolerances,
) -> Result<Solution, IdealError> {
    solve_while(scenario, law, times_s, tolerances, &|| true)
}

/// Solves like [`solve`], and calls `carries_on` after every solver step. Stops if it returns false.
///
/// # Errors
/// As [`solve`], and [`IdealError::Interrupted`].
pub fn solve_while(
    scenario: &Scenario,
    law: &mut dyn Law,
    times_s: &[f64],
    tolerances: Tolerances,
    carries_on: &dyn Fn() -> bool,
) -> Result<Solution, IdealError> {
    let in_order = |&entry: &usize| {
        let before_s = if entry == 0 { 0.0 } else { times_s[entry - 1] };
        times_s[entry].is_finite() && times_s[entry] >= before_s
    };
    if let Some(entry) = (0..times_s.len()).find(|entry| !in_order(entry)) {
        return Err(IdealError::Times { entry });
    }
    let mut feedback = Exact { law, scenario, near: CellList::default() };
    let mut air = Air::of(scenario);
    let end_s = times_s.last().copied().unwrap_or_default();
    if let Some(air) = &mut air {
        air.advance(end_s);
    }
    let motion = FreeMotion { a22_per_s: scenario.velocity_coefficient_per_s(), air: air.as_ref(), end_s };
    let flow = Flow::new(&mut feedback, &scenario.start, motion, 0.0);
    let mut solver = Solver::begin(&flow, 0.0, &packed(&scenario.start), tolerances, FIRST_STEP_S)?;
    let mut closest = None;
    for (pair, approach) in pairs(solver.method.y()) {
        offer(&mut closest, pair, approach.separation_m, 0.0);
    }
    let mut states = Vec::with_capacity(times_s.len());
    for &time_s in times_s {
        solver.advance(time_s, &mut |solver| {
            if !carries_on() {
                return Err(IdealError::Interrupted { time_s: solver.method.t() });
            }
            solver.search_last_step(&mut closest)
        })?;
        states.push(solver.swarm());
    }
    Ok(Solution { states, closest })
}

/// Swarm that moves by equation (1) in continuous time.
#[derive(Clone, Debug)]
pub struct Continuous {
    swarm: Swarm,
    /// Velocity coefficient, drag of the air included.
    a22_per_s: f64,
    /// Wind, if any.
    air: Option<Air>,
    /// Held accelerations without a law, N x 3 \[m/s^2\].
    held: Rows,
    /// Last solver step of the error control.
    step_s: f64,
}

impl Continuous {
    /// Creates the swarm at the scenario's start.
    #[must_use]
    pub fn new(scenario: &Scenario) -> Self {
        let (a22_per_s, air) = (scenario.velocity_coefficient_per_s(), Air::of(scenario));
        Self {
            swarm: scenario.start.clone(),
            a22_per_s,
            air,
            held: Rows::zeros(scenario.count()),
            step_s: FIRST_STEP_S,
        }
    }

    /// Moves from `from_s` over `dt_s` seconds under `feedback` and writes the state at the end, and the bend of the
    /// way into `path`.
    ///
    /// The bend follows from the Green's function of the second derivative, which is at most T/4. A path of duration T
    /// deviates from its chord by at most T/4 times the integral of |p''|. The integral is the sum of the velocity
    /// changes over the solver steps.
    ///
    /// Under limited accelerations, vehicles may reach the barrier of a law, where it is undefined. They then keep
    /// their accelerations to the end of the step, so that the audit sees the way past the barrier; the result is the
    /// law's error.
    ///
    /// # Errors
    /// [`IdealError`]; the state is then undefined.
    pub fn solve(
        &mut self,
        (from_s, dt_s): (f64, f64),
        feedback: &mut dyn Feedback,
        end: &mut Swarm,
        path: &mut StepPath,
    ) -> Result<Option<LawError>, IdealError> {
        if let Some(air) = &mut self.air {
            air.advance(dt_s);
        }
        let motion = FreeMotion { a22_per_s: self.a22_per_s, air: self.air.as_ref(), end_s: dt_s };
        let flow = Flow::new(feedback, &self.swarm, motion, from_s);
        let mut solver = Solver::begin(&flow, 0.0, &packed(&self.swarm), Tolerances::default(), self.step_s.min(dt_s))?;
        solver.most_trials = Some(MOST_TRIALS);
        let mut velocity_changes_m_s = vec![0.0; self.swarm.count()];
        let solved = solver.advance(dt_s, &mut |solver| {
            solver.add_velocity_changes(&mut velocity_changes_m_s);
            flow.accept(solver.method.t(), solver.method.y());
            Ok(())
        });
        path.raise_bend(0.25 * dt_s * velocity_changes_m_s.into_iter().fold(0.0, f64::max));
        let undefined = match solved {
            Ok(()) => {
                self.step_s = solver.method.h();
                self.swarm = solver.swarm();
                None
            }
            Err(IdealError::Law { time_s, source }) if source.is_at_barrier() => {
                let (now_s, state) = (solver.method.t(), solver.method.y());
                let coast = flow.coast(now_s, state, dt_s - now_s);
                let (after, bend_m) = coast.ok_or(IdealError::Law { time_s, source })?;
                if now_s > 0.0 {
                    path.add_instant(now_s, &solver.swarm().positions_m);
                }
                path.raise_bend(bend_m);
                self.step_s = FIRST_STEP_S;
                self.swarm = flow.swarm_of(&after);
                Some(source)
            }
            Err(error) => return Err(error),
        };
        end.clone_from(&self.swarm);
        Ok(undefined)
    }
}

/// Constant accelerations over a step.
struct HeldCommand<'a>(&'a Rows);

impl Feedback for HeldCommand<'_> {
    fn command(&mut self, _time_s: f64, _truth: &Swarm, command: &mut Rows) -> Result<(), LawError> {
        command.copy_from(self.0);
        Ok(())
    }
}

impl From<IdealError> for PlantError {
    fn from(error: IdealError) -> Self {
        match error {
            IdealError::Law { source, .. } => Self::Law(source),
            IdealError::Stalled { .. }
            | IdealError::Interrupted { .. }
            | IdealError::Times { .. }
            | IdealError::Tolerances => Self::Stalled,
        }
    }
}

impl Plant for Continuous {
    fn count(&self) -> usize {
        self.swarm.count()
    }

    fn advance(&mut self, dt_s: f64, end: &mut Swarm, path: &mut StepPath) -> Result<(), PlantError> {
        let held = std::mem::replace(&mut self.held, Rows::zeros(0));
        let solved = self.solve((0.0, dt_s), &mut HeldCommand(&held), end, path);
        self.held = held;
        solved?;
        Ok(())
    }

    fn holds_commands(&self) -> bool {
        false
    }

    fn advance_under(
        &mut self,
        feedback: &mut dyn Feedback,
        interval: (f64, f64),
        end: &mut Swarm,
        path: &mut StepPath,
    ) -> Result<Option<LawError>, PlantError> {
        Ok(self.solve(interval, feedback, end, path)?)
    }

    /// The state is complete: velocities do not jump in continuous time.
    fn apply(&mut self, command: &Rows, _state: &mut Swarm) {
        self.held.clone_from(command);
    }

    fn observe(&self, swarm: &mut Swarm) {
        swarm.clone_from(&self.swarm);
    }

    fn restore(&mut self, swarm: &Swarm) {
        self.swarm.clone_from(swarm);
        if let Some(air) = &mut self.air {
            air.undo();
        }
    }

    fn channels(&self) -> Vec<Channel> {
        self.air.iter().map(|_| Air::channel()).collect()
    }

    fn write_channels(&self, channels: &mut [Channel]) {
        self.air.iter().zip(channels).for_each(|(air, channel)| air.write_channel(channel));
    }

    fn reseed(&mut self, seed: u64) {
        if let Some(air) = &mut self.air {
            air.reseed(seed);
        }
    }
}

/// Method of order 8 with 12 stages, 4 more unused. A state holds all positions, then all velocities, axis by axis.
type Method = ExplicitRungeKutta<Ordinary, DormandPrince, f64, Vec<f64>, 8, 12, 16>;

struct Solver<'a, 'law> {
    method: Method,
    flow: &'a Flow<'law>,
    tolerances: Tolerances,
    /// Limit of solver steps for one output time; unlimited if `None`.
    most_trials: Option<u32>,
}

impl<'a, 'law> Solver<'a, 'law> {
    fn begin(
        flow: &'a Flow<'law>,
        time_s: f64,
        state: &[f64],
        tolerances: Tolerances,
        step_s: f64,
    ) -> Result<Self, IdealError> {
        let Tolerances { relative, absolute } = tolerances;
        if ![relative, absolute].iter().all(|tolerance| *tolerance > 0.0 && tolerance.is_finite()) {
            return Err(IdealError::Tolerances);
        }
        let longest_step_s = flow.longest_step_s();
        let method = Method::dop853().rtol(relative).atol(absolute).h_max(longest_step_s).max_steps(usize::MAX);
        let mut method = method.h0(step_s.min(longest_step_s));
        // The end of the interval only gives the direction of time.
        method.init(flow, time_s, f64::INFINITY, &state.to_vec()).map_err(|_| IdealError::Stalled { time_s })?;
        match flow.take_failure() {
            Some(source) => Err(IdealError::Law { time_s, source }),
            None => Ok(Self { method, flow, tolerances, most_trials: None }),
        }
    }

    /// Solves up to `until_s`, and calls `observe` after every accepted step.
    fn advance(
        &mut self,
        until_s: f64,
        observe: &mut dyn FnMut(&Self) -> Result<(), IdealError>,
    ) -> Result<(), IdealError> {
        if self.method.y().is_empty() {
            // An empty state has no error to control.
            return Ok(());
        }
        let (most_trials, mut undefined, mut trials) = (self.most_trials, None, 0_u32);
        while until_s - self.method.t() > RESOLUTION * until_s {
            trials = trials.saturating_add(1);
            let is_spent = most_trials.is_some_and(|most| trials > most);
            let (time_s, free_step_s) = (self.method.t(), self.method.h());
            let step_s = free_step_s.min(until_s - time_s).min(self.flow.smooth_s(time_s));
            if step_s <= RESOLUTION * until_s || is_spent || (undefined.is_some() && self.moves_nothing(step_s)) {
                return Err(
                    undefined.map_or(IdealError::Stalled { time_s }, |source| IdealError::Law { time_s, source })
                );
            }
            self.method.set_h(step_s);
            let stepped = self.method.step(self.flow);
            undefined = self.flow.take_failure();
            if stepped.is_err() {
                return Err(IdealError::Stalled { time_s });
            }
            if self.method.t() == time_s {
                continue;
            }
            if undefined.is_some() {
                // The error control accepted stages at which the law is undefined.
                let before = self.method.y_prev().clone();
                *self = Self::begin(self.flow, time_s, &before, self.tolerances, step_s / 4.0)?;
                continue;
            }
            if step_s < free_step_s {
                // The step was shortened to end at the output time, not by the error control.
                self.method.set_h(self.method.h().max(free_step_s));
            }
            observe(self)?;
        }
        Ok(())
    }

    /// Returns whether no vehicle moves by more than the resolution of its coordinates in a step \[s\].
    fn moves_nothing(&self, step_s: f64) -> bool {
        let (positions_m, velocities_m_s) = self.method.y().split_at(self.method.y().len() / 2);
        let largest = |numbers: &[f64]| numbers.iter().fold(0.0, |most: f64, number| most.max(number.abs()));
        largest(velocities_m_s) * step_s <= 4.0 * f64::EPSILON * largest(positions_m)
    }

    /// Solves again from the beginning of the last step to a time within it.
    fn within_last_step(&self, time_s: f64) -> Result<Vec<f64>, IdealError> {
        let (from_s, before) = (self.method.t_prev(), self.method.y_prev());
        let mut again = Self::begin(self.flow, from_s, before, self.tolerances, time_s - from_s)?;
        again.advance(time_s, &mut |_| Ok(()))?;
        Ok(again.method.y().clone())
    }

    /// Updates the closest approach over the last step: its end, and minima of distances within it.
    fn search_last_step(&self, closest: &mut Option<ClosestApproach>) -> Result<(), IdealError> {
        let (from_s, to_s) = (self.method.t_prev(), self.method.t());
        for (pair, after) in pairs(self.method.y()) {
            offer(closest, pair, after.separation_m, to_s);
            let before = Approach::of(self.method.y_prev(), pair);
            // Skips pairs that cannot be closest even at twice their speed.
            let reach_m = 2.0 * before.speed_m_s.max(after.speed_m_s) * (to_s - from_s);
            let nearest_m = before.separation_m.min(after.separation_m) - reach_m;
            let may_be_closest = closest.is_none_or(|closest| nearest_m < closest.separation_m);
            if before.is_closing && !after.is_closing && may_be_closest {
                let (time_s, separation_m) = self.local_minimum(pair)?;
                offer(closest, pair, separation_m, time_s);
            }
        }
        Ok(())
    }

    /// Returns the time of the minimum of the distance of a pair in the last step \[s\], and the distance \[m\]. The
    /// pair must close at the beginning of the step and open at its end.
    fn local_minimum(&self, pair: Pair) -> Result<(f64, f64), IdealError> {
        let (mut low_s, mut high_s) = (self.method.t_prev(), self.method.t());
        loop {
            let middle_s = low_s + 0.5 * (high_s - low_s);
            let approach = Approach::of(&self.within_last_step(middle_s)?, pair);
            if high_s - low_s <= CLOSEST_RESOLUTION_S.max(high_s * RESOLUTION) {
                return Ok((middle_s, approach.separation_m));
            }
            if approach.is_closing {
                low_s = middle_s;
            } else {
                high_s = middle_s;
            }
        }
    }

    /// Adds the change of velocity of each vehicle in the last step \[m/s\].
    fn add_velocity_changes(&self, velocity_changes_m_s: &mut [f64]) {
        let (before, after, count) = (self.method.y_prev(), self.method.y(), velocity_changes_m_s.len());
        for (i, turned) in velocity_changes_m_s.iter_mut().enumerate() {
            let change = |axis: usize| after[(3 + axis) * count + i] - before[(3 + axis) * count + i];
            *turned += Vector3::from([0, 1, 2].map(change)).norm();
        }
    }

    fn swarm(&self) -> Swarm {
        self.flow.swarm_of(self.method.y())
    }
}

/// Relative motion of a pair.
struct Approach {
    separation_m: f64,
    speed_m_s: f64,
    is_closing: bool,
}

impl Approach {
    fn of(state: &[f64], pair: Pair) -> Self {
        let count = state.len() / 6;
        let apart = |axis: usize| state[axis * count + pair.second()] - state[axis * count + pair.first()];
        let (r, v) = (Vector3::from([0, 1, 2].map(apart)), Vector3::from([3, 4, 5].map(apart)));
        Self { separation_m: r.norm(), speed_m_s: v.norm(), is_closing: r.dot(&v) < 0.0 }
    }
}

fn pairs(state: &[f64]) -> impl Iterator<Item = (Pair, Approach)> {
    let count = state.len() / 6;
    (0..count)
        .flat_map(move |i| (i + 1..count).map(move |j| Pair::new(i, j)))
        .map(|pair| (pair, Approach::of(state, pair)))
}

fn offer(closest: &mut Option<ClosestApproach>, pair: Pair, separation_m: f64, time_s: f64) {
    if closest.is_none_or(|closest| separation_m < closest.separation_m) {
        *closest = Some(ClosestApproach { pair, separation_m, time_s });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_laws::formation::Formation;

    /// Command of 1 m/s^2 along every axis that changes its sign at this rate \[Hz\].
    struct Switching(f64);

    impl Feedback for Switching {
        fn command(&mut self, time_s: f64, _truth: &Swarm, command: &mut Rows) -> Result<(), LawError> {
            command.fill(if (time_s * self.0).rem_euclid(2.0) < 1.0 { 1.0 } else { -1.0 });
            Ok(())
        }
    }

    #[test]
    fn a_physics_step_that_needs_too_many_solver_steps_ends() {
        let start = Swarm::at_rest(Rows::from_row_slice(&[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]));
        let scenario = Scenario::new("switching", start, Formation::line(2, 3.0), 2.0, 1.0);
        let mut end = scenario.start.clone();
        let mut advance = |rate_hz: f64| {
            let mut path = StepPath::default();
            Continuous::new(&scenario).solve((0.0, 0.1), &mut Switching(rate_hz), &mut end, &mut path)
        };
        assert_eq!(advance(20.0), Ok(None));
        assert!(matches!(advance(1e6), Err(IdealError::Stalled { .. })));
    }
}
