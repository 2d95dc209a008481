//! The ideal plant: p'' = a22 v + u(p, v) (equation (1)) solved in continuous time, with the law inside the right-hand
//! side: nothing is sampled or held.
//!
//! [`solve`] is the oracle that every physics run is measured against; [`plant`] puts the same solution behind
//! [`Plant`] so that a scenario can be flown in it.
//!
//! # Method
//! Dormand and Prince's explicit Runge-Kutta method of order 8 with error control and its dense output of order 7
//! (Hairer, Norsett and Wanner, *Solving Ordinary Differential Equations I*, II.5 and II.6), from the crate
//! `differential-equations`. Solver steps end at the times asked for, so a state that is handed out is never
//! interpolated; the dense output serves the search for closest approaches alone.
//!
//! # At the edge of the law
//! A trial step may ask the law about states that it has no answer for, such as a pair inside delta. Such a step is
//! refused and tried again shorter. Where no step is short enough, the solution itself ends there, and the law's reason
//! is the error.

use std::cell::RefCell;

use differential_equations::interpolate::Interpolation as _;
use differential_equations::methods::{DormandPrince, ExplicitRungeKutta, Ordinary};
use differential_equations::ode::{ODE, OrdinaryNumericalMethod as _};

use super::{Plant, PlantError};
use crate::law::{Law, LawError};
use crate::scenario::Scenario;
use crate::swarm::{ClosestApproach, Pair, Rows, Swarm};

/// First step that is tried \[s\]: the error control lengthens it tenfold a step, or shortens it.
const FIRST_STEP_S: f64 = 1e-3;
/// Longest step \[s\]: no vehicle passes a barrier between two looks at it unless it is faster than 8 barriers a second.
const LONGEST_STEP_S: f64 = 0.125;
/// A step, or what is left to the time asked for, that is shorter than this part of that time is rounding.
const RESOLUTION: f64 = 1e-14;
/// Pieces of a solver step in which each pair's distance is taken to have one minimum at most.
const PIECES: usize = 4;
/// Time to which a closest approach is found \[s\]. The distance there is flat: it is off by a (1e-7 s)^2/2, below
/// rounding for every relative acceleration a up to 0.01 m/s^2 and below 1e-12 m up to 100 m/s^2.
const CLOSEST_RESOLUTION_S: f64 = 1e-7;

/// Error allowed per solver step in each coordinate: `absolute + relative * |value|`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerances {
    /// Part of the coordinate.
    pub relative: f64,
    /// In m for positions, in m/s for velocities.
    pub absolute: f64,
}

impl Default for Tolerances {
    /// 1e-12 of either kind: the reference flights change by less than 1e-10 m when it is 1e-13.
    fn default() -> Self {
        Self { relative: 1e-12, absolute: 1e-12 }
    }
}

/// Why there is no solution.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum IdealError {
    /// The law has no answer from some time on.
    #[error("the solution ends at {time_s} s: {source}")]
    Law {
        /// The last time that was reached \[s\].
        time_s: f64,
        /// Why.
        source: LawError,
    },
    /// No step is short enough for the tolerances, or the motion leaves the range of numbers.
    #[error("the solution cannot be continued at {time_s} s: no step is short enough for its tolerances")]
    Stalled {
        /// The last time that was reached \[s\].
        time_s: f64,
    },
    /// The times do not ascend from 0, or are not finite.
    #[error("time {} is out of order: times ascend from 0 and are finite", entry + 1)]
    Times {
        /// The first such entry, from 0.
        entry: usize,
    },
    /// A tolerance is not a positive finite number.
    #[error("tolerances must be positive finite numbers")]
    Tolerances,
}

/// A solution at the times asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// The state at each time.
    pub states: Vec<Swarm>,
    /// The closest that any pair came from time 0 to the last time: over the whole of it, not at the times asked for
    /// only. None for fewer than two vehicles.
    pub closest: Option<ClosestApproach>,
}

/// Solves p'' = a22 v + u(p, v) from `start` at time 0 and hands out the states at `times_s` \[s\], ascending from 0.
///
/// # Accuracy
/// The error per solver step is at most that of the tolerances; stable motion forgets it. The closest approach is found
/// on the dense output between solver steps: on the reference flights it is good to 1e-9 m.
///
/// # Errors
/// [`IdealError`]: the law has no answer on the way, the times do not ascend, or the tolerances cannot be met.
pub fn solve(
    law: &mut dyn Law,
    start: &Swarm,
    a22_per_s: f64,
    times_s: &[f64],
    tolerances: Tolerances,
) -> Result<Solution, IdealError> {
    let in_order = |&entry: &usize| {
        let before_s = if entry == 0 { 0.0 } else { times_s[entry - 1] };
        times_s[entry].is_finite() && times_s[entry] >= before_s
    };
    if let Some(entry) = (0..times_s.len()).find(|entry| !in_order(entry)) {
        return Err(IdealError::Times { entry });
    }
    let mut solver = Solver::new(law, start, a22_per_s, tolerances, FIRST_STEP_S)?;
    let mut closest = None;
    offer_all(&mut closest, solver.method.y(), 0.0);
    let mut states = Vec::with_capacity(times_s.len());
    for &time_s in times_s {
        solver.advance(time_s, &mut |method| search_step(&mut closest, method))?;
        states.push(solver.swarm());
    }
    Ok(Solution { states, closest })
}

/// A swarm that moves as equation (1) says, at the scenario's start.
#[must_use]
pub fn plant(scenario: &Scenario) -> Box<dyn Plant> {
    Box::new(Ideal { swarm: scenario.start.clone(), a22_per_s: scenario.a22_per_s, step_s: FIRST_STEP_S })
}

struct Ideal {
    swarm: Swarm,
    a22_per_s: f64,
    /// Solver step that the error control came to last.
    step_s: f64,
}

impl Plant for Ideal {
    fn step(&mut self, law: &mut dyn Law, _held: &Rows, dt_s: f64) -> Result<(), PlantError> {
        let mut solver = Solver::new(law, &self.swarm, self.a22_per_s, Tolerances::default(), self.step_s.min(dt_s))?;
        solver.advance(dt_s, &mut |_| ())?;
        self.step_s = solver.method.h();
        self.swarm = solver.swarm();
        Ok(())
    }

    fn observe(&self, swarm: &mut Swarm) {
        swarm.clone_from(&self.swarm);
    }

    fn restore(&mut self, swarm: &Swarm) {
        self.swarm.clone_from(swarm);
    }
}

impl From<IdealError> for PlantError {
    fn from(error: IdealError) -> Self {
        match error {
            IdealError::Law { source, .. } => Self::LawUndefined(source),
            IdealError::Stalled { .. } | IdealError::Times { .. } | IdealError::Tolerances => Self::Stalled,
        }
    }
}

/// Order 8, 12 stages, 16 with those of the dense output. A state is all positions, then all velocities, each an axis
/// after the other.
type Method = ExplicitRungeKutta<Ordinary, DormandPrince, f64, Vec<f64>, 8, 12, 16>;

struct Solver<'a> {
    method: Method,
    flow: Flow<'a>,
}

impl<'a> Solver<'a> {
    fn new(
        law: &'a mut dyn Law,
        start: &Swarm,
        a22_per_s: f64,
        tolerances: Tolerances,
        first_step_s: f64,
    ) -> Result<Self, IdealError> {
        let Tolerances { relative, absolute } = tolerances;
        if ![relative, absolute].iter().all(|tolerance| *tolerance > 0.0 && tolerance.is_finite()) {
            return Err(IdealError::Tolerances);
        }
        let method = Method::dop853().rtol(relative).atol(absolute).h_max(LONGEST_STEP_S).max_steps(usize::MAX);
        let scratch = Scratch { law, swarm: start.clone(), control: Rows::zeros(start.count()), failure: None };
        let mut solver = Self { method, flow: Flow { a22_per_s, scratch: RefCell::new(scratch) } };
        let state = start.positions_m.iter().chain(start.velocities_m_s.iter()).copied().collect();
        solver.begin(0.0, state, first_step_s)?;
        match solver.flow.take_failure() {
            Some(source) => Err(IdealError::Law { time_s: 0.0, source }),
            None => Ok(solver),
        }
    }

    fn begin(&mut self, time_s: f64, state: Vec<f64>, step_s: f64) -> Result<(), IdealError> {
        self.method.h0 = step_s.min(LONGEST_STEP_S);
        // The end of the interval only tells the direction of time.
        self.method
            .init(&self.flow, time_s, f64::INFINITY, &state)
            .map(drop)
            .map_err(|_| IdealError::Stalled { time_s })
    }

    /// Solves up to `until_s`, showing every accepted step to `observe`.
    fn advance(&mut self, until_s: f64, observe: &mut dyn FnMut(&mut Method)) -> Result<(), IdealError> {
        let mut undefined = None;
        while until_s - self.method.t() > RESOLUTION * until_s {
            let (time_s, free_step_s) = (self.method.t(), self.method.h());
            let step_s = free_step_s.min(until_s - time_s);
            if step_s <= RESOLUTION * until_s {
                return Err(undefined
                    .map_or(IdealError::Stalled { time_s }, |source| IdealError::Law { time_s, source }));
            }
            self.method.set_h(step_s);
            let stepped = self.method.step(&self.flow);
            undefined = self.flow.take_failure();
            if stepped.is_err() {
                return Err(IdealError::Stalled { time_s });
            }
            if self.method.t() == time_s {
                continue;
            }
            if undefined.is_some() {
                // Accepted by its error alone, on stages that the law has no answer for.
                let before = self.method.y_prev().clone();
                self.begin(time_s, before, step_s / 4.0)?;
                continue;
            }
            observe(&mut self.method);
            let next_s = self.method.h().max(free_step_s.min(LONGEST_STEP_S));
            self.method.set_h(if step_s < free_step_s { next_s } else { self.method.h() });
        }
        Ok(())
    }

    fn swarm(&self) -> Swarm {
        let mut swarm = self.flow.scratch.borrow().swarm.clone();
        unpack(self.method.y(), &mut swarm);
        swarm
    }
}

/// The right-hand side. The solver asks it through a shared reference, so what changes is in a cell.
struct Flow<'a> {
    a22_per_s: f64,
    scratch: RefCell<Scratch<'a>>,
}

struct Scratch<'a> {
    law: &'a mut dyn Law,
    swarm: Swarm,
    control: Rows,
    /// Why the law had no answer, the last time that it had none.
    failure: Option<LawError>,
}

impl Flow<'_> {
    fn take_failure(&self) -> Option<LawError> {
        self.scratch.borrow_mut().failure.take()
    }
}

impl ODE<f64, Vec<f64>> for Flow<'_> {
    fn diff(&self, _time_s: f64, state: &Vec<f64>, rates: &mut Vec<f64>) {
        let Scratch { law, swarm, control, failure } = &mut *self.scratch.borrow_mut();
        unpack(state, swarm);
        if let Err(undefined) = law.control(swarm, control) {
            *failure = Some(undefined);
            // An error estimate that is not a number refuses the step.
            rates.fill(f64::NAN);
            return;
        }
        let (velocities, half) = (swarm.velocities_m_s.as_slice(), state.len() / 2);
        rates[..half].copy_from_slice(velocities);
        for ((rate, v), u) in rates[half..].iter_mut().zip(velocities).zip(control.as_slice()) {
            *rate = self.a22_per_s * v + u;
        }
    }
}

fn unpack(state: &[f64], swarm: &mut Swarm) {
    let (positions, velocities) = state.split_at(state.len() / 2);
    swarm.positions_m.as_mut_slice().copy_from_slice(positions);
    swarm.velocities_m_s.as_mut_slice().copy_from_slice(velocities);
}

/// Looks for closer approaches in the step that was just accepted.
///
/// A pair is closest where its distance stops falling: where r . v of its relative position and velocity changes its
/// sign from minus to plus.
fn search_step(closest: &mut Option<ClosestApproach>, method: &mut Method) {
    let (from_s, to_s) = (method.t_prev(), method.t());
    let (mut before, mut before_s) = (method.y_prev().clone(), from_s);
    for piece in 1..=PIECES {
        let after_s = if piece == PIECES { to_s } else { from_s + (to_s - from_s) * (piece as f64 / PIECES as f64) };
        let after = if piece == PIECES { method.y().clone() } else { dense(method, after_s) };
        offer_all(closest, &after, after_s);
        for (pair, first) in pairs(&before) {
            let last = Approach::of(&after, pair);
            // No pair that stays away even at twice its speed is looked at closely.
            let reach_m = 2.0 * first.speed_m_s.max(last.speed_m_s) * (after_s - before_s);
            let may_be_closest = closest
                .is_none_or(|closest| first.separation_m.min(last.separation_m) - reach_m < closest.separation_m);
            if first.is_closing && !last.is_closing && may_be_closest {
                let time_s = turning_time_s(method, pair, before_s, after_s);
                offer(closest, pair, Approach::of(&dense(method, time_s), pair).separation_m, time_s);
            }
        }
        (before, before_s) = (after, after_s);
    }
}

/// When a pair that closes at `from_s` and opens at `to_s` turns, by bisection.
fn turning_time_s(method: &mut Method, pair: Pair, from_s: f64, to_s: f64) -> f64 {
    let (mut low_s, mut high_s) = (from_s, to_s);
    loop {
        let middle_s = low_s + 0.5 * (high_s - low_s);
        if high_s - low_s <= CLOSEST_RESOLUTION_S || middle_s <= low_s || middle_s >= high_s {
            return middle_s;
        }
        if Approach::of(&dense(method, middle_s), pair).is_closing {
            low_s = middle_s;
        } else {
            high_s = middle_s;
        }
    }
}

/// The dense output at a time within the last step, the state at its end for any other time.
fn dense(method: &mut Method, time_s: f64) -> Vec<f64> {
    method.interpolate(time_s).unwrap_or_else(|_| method.y().clone())
}

/// How a pair moves.
struct Approach {
    separation_m: f64,
    speed_m_s: f64,
    is_closing: bool,
}

impl Approach {
    fn of(state: &[f64], pair: Pair) -> Self {
        let count = state.len() / 6;
        let apart = |axis: usize| state[axis * count + pair.second()] - state[axis * count + pair.first()];
        let [r, v] = [[0, 1, 2].map(apart), [3, 4, 5].map(apart)];
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        Self { separation_m: dot(r, r).sqrt(), speed_m_s: dot(v, v).sqrt(), is_closing: dot(r, v) < 0.0 }
    }
}

fn pairs(state: &[f64]) -> impl Iterator<Item = (Pair, Approach)> {
    let count = state.len() / 6;
    (0..count)
        .flat_map(move |i| (i + 1..count).map(move |j| Pair::new(i, j)))
        .map(|pair| (pair, Approach::of(state, pair)))
}

fn offer_all(closest: &mut Option<ClosestApproach>, state: &[f64], time_s: f64) {
    for (pair, approach) in pairs(state) {
        offer(closest, pair, approach.separation_m, time_s);
    }
}

fn offer(closest: &mut Option<ClosestApproach>, pair: Pair, separation_m: f64, time_s: f64) {
    if closest.is_none_or(|closest| separation_m < closest.separation_m) {
        *closest = Some(ClosestApproach { pair, separation_m, time_s });
    }
}
