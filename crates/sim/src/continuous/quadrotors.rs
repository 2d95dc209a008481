//! Quadrotors in continuous time, a reference for those of the physics engine.
//!
//! Between two runs of the attitude loops, the method of order 8 solves the same forces and torques. Rotors are exact:
//! with held commands, their speeds are exponentials of time.

use std::cell::RefCell;

use differential_equations::ode::{ODE, OrdinaryNumericalMethod as _};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::{Method, RESOLUTION, Tolerances};
use crate::plant::{self, Plant, PlantError, StepPath};
use crate::vehicle::{Fleet, State};
use tautline_core::record::Channel;
use tautline_core::swarm::{Rows, Swarm, set_row};

/// Size of a vehicle's state in the solver: position, velocity, attitude, rates.
const NUMBERS: usize = 13;

/// Relative rounding of times within a step.
const ROUNDING: f64 = 1e-9;

/// Quadrotors in continuous time. Attitude loops run at their rate; commands are held.
#[derive(Clone, Debug)]
pub struct Quadrotors {
    fleet: Fleet,
}

impl Quadrotors {
    /// Creates quadrotors in the states of a fleet.
    #[must_use]
    pub fn new(mut fleet: Fleet) -> Self {
        fleet.compute_wrenches();
        Self { fleet }
    }

    /// Solves over a time \[s\] in which the wind is smooth and rotor commands are constant, beginning `before_s`
    /// before the wind's present. Returns an upper bound of the bend of a path \[m\], as [`super::Continuous::advance`]
    /// does.
    fn solve(&mut self, dt_s: f64, before_s: f64) -> Result<f64, PlantError> {
        let flow = Flow { before: &self.fleet, before_s, fleet: RefCell::new(self.fleet.clone()) };
        let Tolerances { relative, absolute } = Tolerances::default();
        let mut method = Method::dop853().rtol(relative).atol(absolute).h_max(dt_s).max_steps(usize::MAX).h0(dt_s);
        method.init(&flow, 0.0, f64::INFINITY, &packed(&self.fleet.states)).map_err(|_| PlantError::Stalled)?;
        let mut turned_m_s = vec![0.0; self.fleet.count()];
        while dt_s - method.t() > RESOLUTION * dt_s {
            let (time_s, step_s) = (method.t(), method.h().min(dt_s - method.t()));
            method.set_h(step_s);
            if step_s <= RESOLUTION * dt_s || method.step(&flow).is_err() {
                return Err(PlantError::Stalled);
            }
            if method.t() > time_s {
                for (i, turned_m_s) in turned_m_s.iter_mut().enumerate() {
                    let change = |k: usize| method.y()[NUMBERS * i + k] - method.y_prev()[NUMBERS * i + k];
                    *turned_m_s += Vector3::from([3, 4, 5].map(change)).norm();
                }
            }
        }
        flow.at(dt_s, method.y());
        let states = &flow.fleet.borrow().states;
        self.fleet.states.clone_from(states);
        Ok(0.25 * dt_s * turned_m_s.into_iter().fold(0.0, f64::max))
    }
}

impl plant::Quadrotors for Quadrotors {
    fn fleet(&self) -> &Fleet {
        &self.fleet
    }
}

impl Plant for Quadrotors {
    fn count(&self) -> usize {
        self.fleet.count()
    }

    fn advance(&mut self, dt_s: f64, predicted: &mut Swarm, path: &mut StepPath) -> Result<(), PlantError> {
        self.fleet.save_state();
        self.fleet.advance_wind(dt_s);
        let mut passed_s = 0.0;
        loop {
            let due_s = self.fleet.run_attitude();
            let left_s = dt_s - passed_s;
            let due_s = due_s.min(self.fleet.smooth_s(left_s));
            let is_last = due_s >= left_s - ROUNDING * dt_s;
            let length_s = if is_last { left_s } else { due_s };
            path.raise_bend(self.solve(length_s, left_s)?);
            self.fleet.advance_clock(length_s);
            passed_s += length_s;
            if is_last {
                break;
            }
            let mut places_m = Rows::zeros(self.count());
            for (i, state) in self.fleet.states.iter().enumerate() {
                set_row(&mut places_m, i, state.position_m);
            }
            path.add_instant(passed_s, &places_m);
        }
        self.fleet.observe(predicted);
        match predicted.first_not_finite() {
            Some(vehicle) => Err(PlantError::NotFinite { vehicle }),
            None => Ok(()),
        }
    }

    /// The state is complete: a command changes forces only as fast as rotors follow it.
    fn apply(&mut self, command: &Rows, _state: &mut Swarm) {
        self.fleet.command(command);
    }

    fn observe(&self, swarm: &mut Swarm) {
        self.fleet.observe(swarm);
    }

    fn restore(&mut self, _swarm: &Swarm) {
        self.fleet.restore_state();
    }

    fn channels(&self) -> Vec<Channel> {
        self.fleet.channels()
    }

    fn write_channels(&self, channels: &mut [Channel]) {
        self.fleet.write_channels(channels);
    }

    fn reseed(&mut self, seed: u64) {
        self.fleet.reseed(seed);
    }
}

/// Right-hand side, relative to the fleet at time 0.
struct Flow<'a> {
    before: &'a Fleet,
    /// Time from there to the wind's present \[s\].
    before_s: f64,
    /// Fleet at the time of the last evaluation. The solver has a shared reference.
    fleet: RefCell<Fleet>,
}

impl Flow<'_> {
    /// Sets the fleet to a state of the solver at a time.
    fn at(&self, time_s: f64, numbers: &[f64]) {
        let fleet = &mut *self.fleet.borrow_mut();
        let lag = fleet.dynamics.rotor_lag(time_s);
        for (i, numbers) in numbers.chunks_exact(NUMBERS).enumerate() {
            let three = |from: usize| Vector3::new(numbers[from], numbers[from + 1], numbers[from + 2]);
            fleet.states[i] = State {
                position_m: three(0),
                velocity_m_s: three(3),
                attitude: UnitQuaternion::new_normalize(Quaternion::new(
                    numbers[6], numbers[7], numbers[8], numbers[9],
                )),
                rates_rad_s: three(10),
                shares: self.before.states[i].shares,
                rotors_rpm: lag.after(self.before.states[i].rotors_rpm, self.before.commanded_rpm(i)),
            };
        }
        fleet.set_wind_time(self.before_s - time_s);
        fleet.compute_wrenches();
    }
}

impl ODE<f64, Vec<f64>> for Flow<'_> {
    fn diff(&self, time_s: f64, numbers: &Vec<f64>, rates: &mut Vec<f64>) {
        self.at(time_s, numbers);
        let fleet = self.fleet.borrow();
        for (i, rates) in rates.chunks_exact_mut(NUMBERS).enumerate() {
            let state = &fleet.states[i];
            let (acceleration_m_s2, turning_rad_s2) = fleet.dynamics.accelerations(state, fleet.wrench(i));
            // The solver's own quaternion, which is not normalized.
            let own = &numbers[NUMBERS * i + 6..];
            let attitude = Quaternion::new(own[0], own[1], own[2], own[3]);
            let turning = attitude * Quaternion::from_imag(0.5 * state.rates_rad_s);
            rates[..3].copy_from_slice(state.velocity_m_s.as_slice());
            rates[3..6].copy_from_slice(acceleration_m_s2.as_slice());
            rates[6..10].copy_from_slice(&[turning.w, turning.i, turning.j, turning.k]);
            rates[10..].copy_from_slice(turning_rad_s2.as_slice());
        }
    }
}

fn packed(states: &[State]) -> Vec<f64> {
    let mut numbers = Vec::with_capacity(NUMBERS * states.len());
    for state in states {
        let q = state.attitude.quaternion();
        numbers.extend(state.position_m.iter().chain(&state.velocity_m_s));
        numbers.extend([q.w, q.i, q.j, q.k]);
        numbers.extend(&state.rates_rad_s);
    }
    numbers
}
