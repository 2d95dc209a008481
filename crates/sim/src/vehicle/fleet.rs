//! [`Fleet`]: a swarm of quadrotors with its memory from step to step.

use nalgebra::{Vector3, Vector4};

use super::dynamics::{Drift, Dynamics, Ground, State, Wrench};
use super::model::Quadrotor;
use super::rotors::Downwash;
use tautline_core::record::Channel;
use tautline_core::swarm::{Rows, Swarm, row, set_row};
use tautline_laws::wind::Wind;

/// Frequency of the critically damped loop that holds the height of a swarm in the plane z = 0 \[rad/s\].
pub const HEIGHT_RAD_S: f64 = 2.0;

/// Relative rounding of a sum of steps in a period of the attitude loop.
const ROUNDING: f64 = 1e-6;

/// Swarm of quadrotors: states, commanded rotor speeds, held commands and wind.
///
/// Attitude loops run at multiples of their period, with the first state at or after each.
#[derive(Clone, Debug)]
pub struct Fleet {
    /// Equations of motion.
    pub dynamics: Dynamics,
    /// State of each vehicle.
    pub states: Vec<State>,
    /// Velocity of the air at each vehicle, without downwash \[m/s\].
    pub wind_m_s: Rows,
    /// Wind, if it is not constant.
    wind: Option<Wind>,
    commanded_rpm: Vec<Vector4<f64>>,
    /// Commanded accelerations \[m/s^2\].
    commands: Rows,
    /// Whether the height z = 0 is held for any command.
    holds_height: bool,
    attitude_hz: f64,
    clock: AttitudeClock,
    jets: Vec<Downwash>,
    wrenches: Vec<Wrench>,
    failures: Vec<RotorFailure>,
    /// State at the last [`Fleet::save_state`].
    before: SavedStep,
}

/// Rotors that lose some or all thrust for the rest of the flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotorFailure {
    /// The vehicle, from 0.
    pub vehicle: usize,
    /// The rotor, from 0; `None` stops all rotors, with their lag.
    pub rotor: Option<usize>,
    /// Time of the failure \[s\].
    pub at_s: f64,
    /// Share of its thrust that a failed rotor still gives.
    pub share: f64,
}

/// State to restore when a step is undone.
#[derive(Clone, Debug, Default)]
struct SavedStep {
    states: Vec<State>,
    commanded_rpm: Vec<Vector4<f64>>,
    wrenches: Vec<Wrench>,
    clock: AttitudeClock,
}

/// Time flown, and number of runs of the attitude loops.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct AttitudeClock {
    time_s: f64,
    samples: f64,
}

impl Fleet {
    /// Creates quadrotors trimmed for hover at the positions and velocities of a start: level, with rotors that carry
    /// the weight. With `holds_height`, the height z = 0 is held for any command.
    #[must_use]
    pub fn trimmed(quadrotor: &Quadrotor, grounds: &[Ground], start: &Swarm, holds_height: bool) -> Self {
        let (dynamics, count) = (Dynamics::new(quadrotor, grounds), start.count());
        let state = |i: usize| dynamics.trimmed(row(&start.positions_m, i), row(&start.velocities_m_s, i));
        let states: Vec<_> = (0..count).map(state).collect();
        let commanded_rpm = vec![Vector4::repeat(dynamics.hover_rpm()); count];
        let mut fleet = Self {
            before: SavedStep::default(),
            wrenches: vec![Wrench::default(); count],
            failures: Vec::new(),
            states,
            wind_m_s: Rows::zeros(count),
            wind: None,
            commanded_rpm,
            commands: Rows::zeros(count),
            holds_height,
            attitude_hz: quadrotor.attitude_hz,
            clock: AttitudeClock::default(),
            jets: Vec::with_capacity(if quadrotor.downwash { 4 * count } else { 0 }),
            dynamics,
        };
        fleet.compute_wrenches();
        fleet.save_state();
        fleet
    }

    /// Adds a wind, which must be at the same instant.
    #[must_use]
    pub fn with_wind(mut self, wind: Wind) -> Self {
        wind.write(&mut self.wind_m_s);
        self.wind = Some(wind);
        self.compute_wrenches();
        self
    }

    /// Adds failures of rotors.
    #[must_use]
    pub fn with_failures(mut self, failures: Vec<RotorFailure>) -> Self {
        self.failures = failures;
        self
    }

    /// Returns the number of vehicles N.
    #[must_use]
    pub fn count(&self) -> usize {
        self.states.len()
    }

    /// Sets the commanded accelerations \[m/s^2\], N x 3.
    pub fn command(&mut self, accelerations_m_s2: &Rows) {
        self.commands.copy_from(accelerations_m_s2);
    }

    /// Saves the state for [`Fleet::restore_state`].
    pub fn save_state(&mut self) {
        let Self { before, states, commanded_rpm, wrenches, clock, .. } = self;
        before.states.clone_from(states);
        before.commanded_rpm.clone_from(commanded_rpm);
        before.wrenches.clone_from(wrenches);
        before.clock = *clock;
    }

    /// Restores the state of the last [`Fleet::save_state`].
    pub fn restore_state(&mut self) {
        let Self { before, states, commanded_rpm, wrenches, clock, .. } = self;
        states.clone_from(&before.states);
        commanded_rpm.clone_from(&before.commanded_rpm);
        wrenches.clone_from(&before.wrenches);
        *clock = before.clock;
        if let Some(wind) = &mut self.wind {
            wind.undo();
            wind.write(&mut self.wind_m_s);
        }
    }

    /// Advances the wind to the end of a step \[s\]; [`Fleet::restore_state`] undoes it.
    pub fn advance_wind(&mut self, dt_s: f64) {
        if let Some(wind) = &mut self.wind {
            wind.advance(dt_s);
            wind.write(&mut self.wind_m_s);
        }
    }

    /// Sets the wind at the vehicles to an instant `before_s` seconds before its present.
    pub fn set_wind_time(&mut self, before_s: f64) {
        if let Some(wind) = &self.wind {
            let time_s = wind.now_s() - before_s;
            (0..self.states.len()).for_each(|i| set_row(&mut self.wind_m_s, i, wind.air_at_m_s(i, time_s)));
        }
    }

    /// Returns the time for which the wind is smooth from that instant on \[s\].
    #[must_use]
    pub fn smooth_s(&self, before_s: f64) -> f64 {
        self.wind.as_ref().map_or(f64::INFINITY, |wind| {
            let time_s = wind.now_s() - before_s;
            wind.next_slope_change_s(time_s) - time_s
        })
    }

    /// Restarts the random numbers from another seed.
    pub fn reseed(&mut self, seed: u64) {
        if let Some(wind) = &mut self.wind {
            wind.reseed(seed);
        }
    }

    /// Applies due failures of rotors and runs the attitude loops if they are due. Returns the time until the next of
    /// either \[s\].
    pub fn run_attitude(&mut self) -> f64 {
        let AttitudeClock { time_s, samples } = self.clock;
        let now_s = time_s + ROUNDING / self.attitude_hz;
        let next_s = self.apply_failures(now_s) - time_s;
        if time_s * self.attitude_hz + ROUNDING >= samples {
            self.clock.samples = (time_s * self.attitude_hz + ROUNDING).floor() + 1.0;
            for i in 0..self.count() {
                let command_m_s2 = self.acceleration_m_s2(i);
                self.commanded_rpm[i] = self.dynamics.commanded_rpm(&self.states[i], command_m_s2);
            }
        }
        for failure in self.failures.iter().filter(|failure| failure.rotor.is_none() && failure.at_s <= now_s) {
            self.commanded_rpm[failure.vehicle].fill(0.0);
        }
        next_s.min(self.clock.samples / self.attitude_hz - time_s)
    }

    /// Reduces the thrust of rotors that have failed by a time \[s\]. Returns the time of the next failure.
    fn apply_failures(&mut self, time_s: f64) -> f64 {
        let (mut next_s, mut changed) = (f64::INFINITY, false);
        for &RotorFailure { vehicle, rotor, at_s, share } in &self.failures {
            if at_s > time_s {
                next_s = next_s.min(at_s);
            } else if let Some(rotor) = rotor
                && self.states[vehicle].shares[rotor] > share
            {
                self.states[vehicle].shares[rotor] = share;
                changed = true;
            }
        }
        if changed {
            self.compute_wrenches();
        }
        next_s
    }

    /// Commands rotor speeds \[rpm\] and turns the attitude loops off.
    pub fn open_loop(&mut self, commanded_rpm: &[Vector4<f64>]) {
        self.commanded_rpm.copy_from_slice(commanded_rpm);
        self.clock.samples = f64::INFINITY;
    }

    /// Returns the acceleration for the attitude loop of a vehicle \[m/s^2\].
    fn acceleration_m_s2(&self, i: usize) -> Vector3<f64> {
        let mut command_m_s2 = row(&self.commands, i);
        if self.holds_height {
            let State { position_m, velocity_m_s, .. } = &self.states[i];
            command_m_s2.z = -HEIGHT_RAD_S * (HEIGHT_RAD_S * position_m.z + 2.0 * velocity_m_s.z);
        }
        command_m_s2
    }

    /// Advances the clock by a time \[s\].
    pub fn advance_clock(&mut self, dt_s: f64) {
        self.clock.time_s += dt_s;
    }

    /// Returns the rotor speeds \[rpm\] that the attitude loop of a vehicle commands.
    #[must_use]
    pub fn commanded_rpm(&self, vehicle: usize) -> Vector4<f64> {
        self.commanded_rpm[vehicle]
    }

    /// Computes force and torque on each vehicle, without gravity, in the present states.
    pub fn compute_wrenches(&mut self) {
        let Self { dynamics, states, wind_m_s, jets, wrenches, .. } = self;
        dynamics.jets(states.iter(), jets);
        for (i, (state, wrench)) in states.iter().zip(wrenches).enumerate() {
            *wrench = dynamics.wrench(state, row(wind_m_s, i), dynamics.downwash_m_s(i, state, jets));
        }
    }

    /// Returns force and torque on a vehicle from the last [`Fleet::compute_wrenches`].
    #[must_use]
    pub fn wrench(&self, vehicle: usize) -> &Wrench {
        &self.wrenches[vehicle]
    }

    /// Completes a step that began with these drifts, with the present forces.
    pub fn complete(&mut self, drifts: &[Drift], dt_s: f64) {
        let Self { dynamics, states, wrenches, .. } = self;
        for ((state, wrench), drift) in states.iter_mut().zip(wrenches).zip(drifts) {
            dynamics.end_step(state, drift, wrench, dt_s);
        }
    }

    /// Writes positions and velocities.
    pub fn observe(&self, swarm: &mut Swarm) {
        for (i, state) in self.states.iter().enumerate() {
            set_row(&mut swarm.positions_m, i, state.position_m);
            set_row(&mut swarm.velocities_m_s, i, state.velocity_m_s);
        }
    }

    /// Returns the channels `attitude` (quaternion from body to world), `rotors` (thrust of each rotor \[N\]), and that
    /// of the wind, if any.
    #[must_use]
    pub fn channels(&self) -> Vec<Channel> {
        let attitude = Channel::new("attitude", &["qw", "qx", "qy", "qz"]);
        let rotors = Channel::new("rotors", &["thrust_1_n", "thrust_2_n", "thrust_3_n", "thrust_4_n"]);
        [attitude, rotors].into_iter().chain(self.wind.as_ref().map(|_| Wind::channel())).collect()
    }

    /// Writes the values of the channels of [`Fleet::channels`].
    pub fn write_channels(&self, channels: &mut [Channel]) {
        let [attitude, rotors, rest @ ..] = channels else { return };
        attitude.values.clear();
        rotors.values.clear();
        for state in &self.states {
            let q = state.attitude.quaternion();
            attitude.values.extend([q.w, q.i, q.j, q.k]);
            rotors.values.extend(self.dynamics.thrusts_n(state).iter());
        }
        if let (Some(wind), [channel]) = (&self.wind, rest) {
            wind.write_channel(channel);
        }
    }
}
