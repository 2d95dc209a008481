//! Right-hand side of the equation of motion for the solver.

use std::cell::RefCell;

use differential_equations::ode::ODE;

use crate::plant::Air;
use crate::plant::Feedback;
use tautline_core::swarm::{Rows, Swarm};
use tautline_laws::law::LawError;

/// Longest solver step \[s\]: without accelerations, the error control alone could skip an encounter of a pair.
const LONGEST_STEP_S: f64 = 0.125;

/// Motion without a command.
#[derive(Clone, Copy)]
pub(super) struct FreeMotion<'a> {
    pub(super) a22_per_s: f64,
    /// Wind, advanced to the end of the step, and that time of the solver \[s\].
    pub(super) air: Option<&'a Air>,
    pub(super) end_s: f64,
}

impl FreeMotion<'_> {
    /// Returns the time for which the wind is smooth from a time of the solver on \[s\].
    fn smooth_s(&self, time_s: f64) -> f64 {
        self.air.map_or(f64::INFINITY, |air| air.smooth_s(self.end_s - time_s))
    }

    /// Adds the acceleration by the wind at a time of the solver \[s\], axis by axis.
    fn add_wind(&self, time_s: f64, accelerations: &mut [f64]) {
        let Some(air) = self.air else { return };
        let count = accelerations.len() / 3;
        for i in 0..count {
            let push_m_s2 = air.push_m_s2(i, self.end_s - time_s);
            (0..3).for_each(|axis| accelerations[axis * count + i] += push_m_s2[axis]);
        }
    }
}

/// Right-hand side. The solver has a shared reference to it, so mutable state is in a cell.
pub(super) struct Flow<'law> {
    motion: FreeMotion<'law>,
    /// Time of the flight at the solver's time 0 \[s\].
    from_s: f64,
    scratch: RefCell<Scratch<'law>>,
}

struct Scratch<'law> {
    feedback: &'law mut dyn Feedback,
    swarm: Swarm,
    control: Rows,
    /// First error of the law since the last call of `take_failure`.
    failure: Option<LawError>,
}

impl<'law> Flow<'law> {
    pub(super) fn new(feedback: &'law mut dyn Feedback, swarm: &Swarm, motion: FreeMotion<'law>, from_s: f64) -> Self {
        let control = Rows::zeros(swarm.count());
        let scratch = Scratch { feedback, swarm: swarm.clone(), control, failure: None };
        Self { motion, from_s, scratch: RefCell::new(scratch) }
    }

    /// Returns a state as a swarm.
    pub(super) fn swarm_of(&self, state: &[f64]) -> Swarm {
        let mut swarm = self.scratch.borrow().swarm.clone();
        unpack(state, &mut swarm);
        swarm
    }

    pub(super) fn take_failure(&self) -> Option<LawError> {
        self.scratch.borrow_mut().failure.take()
    }

    /// Returns the time for which the right-hand side is smooth from a time on \[s\].
    pub(super) fn smooth_s(&self, time_s: f64) -> f64 {
        self.motion.smooth_s(time_s)
    }

    pub(super) fn longest_step_s(&self) -> f64 {
        self.scratch.borrow().feedback.longest_step_s().min(LONGEST_STEP_S)
    }

    pub(super) fn accept(&self, time_s: f64, state: &[f64]) {
        let Scratch { feedback, swarm, .. } = &mut *self.scratch.borrow_mut();
        unpack(state, swarm);
        feedback.accept(self.from_s + time_s, swarm);
    }
}

impl Flow<'_> {
    /// Returns the state after `time_s` more under the present accelerations, at the solver's time `now_s`, and the
    /// bend of the way \[m\]. `None` if the law is undefined now.
    pub(super) fn coast(&self, now_s: f64, state: &Vec<f64>, time_s: f64) -> Option<(Vec<f64>, f64)> {
        let mut rates = vec![0.0; state.len()];
        self.diff(now_s, state, &mut rates);
        if self.take_failure().is_some() {
            return None;
        }
        let half = state.len() / 2;
        let (velocities, accelerations) = rates.split_at(half);
        let mut after = state.clone();
        for (k, (v, a)) in velocities.iter().zip(accelerations).enumerate() {
            after[k] += time_s * (v + 0.5 * time_s * a);
            after[half + k] += time_s * a;
        }
        let count = half / 3;
        let square = |i: usize| (0..3).map(|axis| accelerations[axis * count + i].powi(2)).sum::<f64>();
        let most_m_s2 = (0..count).map(square).fold(0.0, f64::max).sqrt();
        Some((after, 0.125 * most_m_s2 * time_s * time_s))
    }
}

impl ODE<f64, Vec<f64>> for Flow<'_> {
    fn diff(&self, time_s: f64, state: &Vec<f64>, rates: &mut Vec<f64>) {
        let Scratch { feedback, swarm, control, failure } = &mut *self.scratch.borrow_mut();
        // Stages after the first undefined one are NaN; the first error is kept.
        if failure.is_none() {
            unpack(state, swarm);
            *failure = feedback.command(self.from_s + time_s, swarm, control).err();
        }
        if failure.is_some() {
            // An error estimate that is NaN refuses the step.
            rates.fill(f64::NAN);
            return;
        }
        let (velocities, half) = (swarm.velocities_m_s.as_slice(), state.len() / 2);
        rates[..half].copy_from_slice(velocities);
        for ((rate, v), u) in rates[half..].iter_mut().zip(velocities).zip(control.as_slice()) {
            *rate = self.motion.a22_per_s * v + u;
        }
        self.motion.add_wind(time_s, &mut rates[half..]);
    }
}

pub(super) fn packed(swarm: &Swarm) -> Vec<f64> {
    swarm.positions_m.iter().chain(swarm.velocities_m_s.iter()).copied().collect()
}

pub(super) fn unpack(state: &[f64], swarm: &mut Swarm) {
    let (positions, velocities) = state.split_at(state.len() / 2);
    swarm.positions_m.as_mut_slice().copy_from_slice(positions);
    swarm.velocities_m_s.as_mut_slice().copy_from_slice(velocities);
}
