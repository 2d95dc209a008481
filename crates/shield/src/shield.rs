//! Shield of one vehicle: from a wish and a measurement to a command, by the steps of the certificate.

use std::collections::VecDeque;
use std::sync::Arc;

use nalgebra::Vector3;

use crate::agenda::Horizon;
use crate::brake::State;
use crate::choice::{Chosen, Reach};
use crate::contract::{Broadcast, Instant, Message};
use crate::contracts::Contracts;
use crate::obstacle::{KeepOut, Obstacle};
use crate::plane::Segment;
use crate::report::Counters;
use crate::settings::{Limits, ShieldError, Start};

/// Smallest change of a command that is counted \[m/s^2\].
const CHANGED_M_S2: f64 = 1e-9;

/// Number of planes within reach for which memory is reserved.
const REACHED: usize = 128;

/// Shield of one vehicle.
///
/// At each instant of the vehicle call [`Shield::filter`], send the [`Shield::messages`], and hold the command over the
/// period. Give each message to [`Shield::hear`] when it arrives, at any time. Messages may be late, lost, doubled or
/// out of order; their numbers must arrive bit for bit.
///
/// ```
/// use nalgebra::Vector3;
/// use tautline_shield::{Settings, Shield, State};
///
/// let limits = Settings::new(1.0, 0.05).limits()?;
/// let start = |x: f64| limits.start(State::at_rest(Vector3::new(x, 0.0, 0.0)));
/// let starts = [start(-2.0)?, start(2.0)?];
/// let mut shields = [Shield::new(&limits, 0, &starts)?, Shield::new(&limits, 1, &starts)?];
///
/// // The plant is exact here, so the state is the reference.
/// for _ in 0..200 {
///     let commands = [Vector3::x() * 5.0, Vector3::x() * -5.0];
///     for (shield, wanted) in shields.iter_mut().zip(commands) {
///         let state = shield.next_reference();
///         shield.filter(state, wanted);
///     }
///     let sent: Vec<_> = shields.iter_mut().flat_map(|shield| shield.messages()).collect();
///     sent.iter().for_each(|message| shields[message.to as usize].hear(message));
/// }
/// let apart = shields[1].reference().position_m - shields[0].reference().position_m;
/// assert!(apart.norm() >= 1.0);
/// # Ok::<(), tautline_shield::ShieldError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Shield {
    limits: Limits,
    /// Number of calls so far; the reference is that of the instant of the last call.
    period: u64,
    /// Reference at the instant of the last call, and its acceleration since.
    reference: State,
    acceleration: Vector3<f64>,
    /// Reference at the next instant, and the segment held from then on.
    next: State,
    segment: Segment,
    /// References at the last instants, oldest first, for measurements of that age.
    past: VecDeque<State>,
    contracts: Contracts,
    /// Rooms of planes that need not be looked at, at the largest speed.
    fastest: Horizon,
    keep_outs: Vec<KeepOut>,
    reach: Reach,
    counters: Counters,
}

impl Shield {
    /// Returns the shield of the vehicle with this number among the starts of all vehicles.
    ///
    /// # Errors
    /// If the number is not in the list, or the vehicle starts too near to another one.
    pub fn new(limits: &Limits, index: usize, starts: &[Start]) -> Result<Self, ShieldError> {
        limits.check_bodies(starts)?;
        Self::of_checked(limits, index, &starts.into())
    }

    /// Returns the shield among starts that have the same bodies.
    pub(crate) fn of_checked(limits: &Limits, index: usize, starts: &Arc<[Start]>) -> Result<Self, ShieldError> {
        let contracts = Contracts::new(index, Arc::clone(starts))?;
        // The index is in the list.
        let own = &starts[index];
        Ok(Self {
            limits: *limits,
            period: 0,
            reference: own.state,
            acceleration: Vector3::zeros(),
            next: own.state,
            segment: own.segment,
            past: VecDeque::with_capacity(limits.settings().measurement_delay_periods + 1),
            contracts,
            fastest: limits.horizon(limits.settings().max_speed_m_s),
            keep_outs: vec![],
            // Two planes per other vehicle, but few are within reach.
            reach: Reach::with_capacity((2 * starts.len()).min(REACHED)),
            counters: Counters::default(),
        })
    }

    /// Returns this shield with planes before these obstacles, in the place of earlier ones. Obstacles must not move.
    ///
    /// # Errors
    /// If a clearance is invalid, or the vehicle is too near to an obstacle to stop before it.
    pub fn with_obstacles(mut self, obstacles: &[Obstacle]) -> Result<Self, ShieldError> {
        self.keep_outs = KeepOut::all(obstacles, self.contracts.index(), self.limits.tube().error_m, &self.segment)?;
        Ok(self)
    }

    /// Stores a message to this vehicle until the next instant. Messages to other vehicles have no effect.
    #[inline]
    pub fn hear(&mut self, message: &Message) {
        self.contracts.hear(message);
    }

    /// Stores the message to this vehicle in a broadcast until the next instant.
    #[inline]
    pub fn hear_broadcast(&mut self, broadcast: &Broadcast) {
        if let Some(message) = broadcast.message(self.contracts.index()) {
            self.hear(&message);
        }
    }

    /// Returns the command for the next period \[m/s^2\]: reads messages, proposes planes, chooses the acceleration of
    /// the reference, and adds drag and feedback.
    ///
    /// `measured` is the vehicle's own state, [`measurement_delay_periods`] periods old. A measurement that is not
    /// finite leaves the feedback out and is counted. `wanted` is the command of the law. One that is not finite
    /// brakes.
    ///
    /// [`measurement_delay_periods`]: crate::Settings::measurement_delay_periods
    pub fn filter(&mut self, measured: State, wanted: Vector3<f64>) -> Vector3<f64> {
        self.advance();
        let (limits, reference) = (self.limits, self.reference);
        let reach = limits.envelope.reach_m(&reference, limits.choice);
        self.reach.clear();
        let at = Instant {
            period: self.period,
            segment: &self.segment,
            side: &limits.side(),
            reach_m: reach,
            horizons: [limits.horizon(reference.velocity_m_s.norm()), self.fastest],
        };
        let renewed = self.contracts.renew(&at, &mut self.reach);
        let (segment, is_level) = (self.segment, limits.settings().is_level);
        let planes = self.keep_outs.iter_mut().filter_map(|keep_out| keep_out.within(&segment, reach));
        let height_m = reference.position_m.z;
        self.reach.extend(planes.filter_map(|plane| if is_level { plane.in_level(height_m) } else { Some(plane) }));
        self.counters.renewed(renewed);
        let drag = reference.velocity_m_s * limits.settings().a22_per_s;
        let wanted = if is_level { Vector3::new(wanted.x, wanted.y, 0.0) } else { wanted };
        let wish = limits.envelope.cut(&reference.velocity_m_s, wanted + drag);
        let chosen = if wish.iter().all(|value| value.is_finite()) {
            let chosen = self.reach.choose(&limits.envelope, &reference, wish, limits.choice);
            let change = (chosen.acceleration - wish).norm();
            self.counters.chosen(chosen.is_brake, if change > CHANGED_M_S2 { change } else { 0.0 });
            chosen
        } else {
            let acceleration = limits.envelope.brake.command(&reference.velocity_m_s);
            self.counters.chosen(true, acceleration.norm());
            Chosen { acceleration, is_brake: true }
        };
        self.command(measured, chosen.acceleration)
    }

    /// Returns the command of the brake \[m/s^2\], where an instant passes without a wish. Messages wait.
    pub fn brake(&mut self, measured: State) -> Vector3<f64> {
        self.advance();
        let acceleration = self.limits.envelope.brake.command(&self.reference.velocity_m_s);
        self.counters.chosen(true, 0.0);
        self.command(measured, acceleration)
    }

    /// Moves the reference to this instant.
    fn advance(&mut self) {
        self.reference = self.next;
        let delay = self.limits.settings().measurement_delay_periods;
        if self.past.len() > delay {
            self.past.pop_front();
        }
        self.past.push_back(self.reference);
        self.period += 1;
    }

    /// Takes the acceleration of the reference, and returns the command with drag and feedback.
    fn command(&mut self, measured: State, acceleration: Vector3<f64>) -> Vector3<f64> {
        let settings = self.limits.settings();
        self.acceleration = acceleration;
        self.next = self.reference.after(acceleration, settings.period_s);
        self.segment = Segment::new(self.next.position_m, self.limits.envelope.brake.stop_m(&self.next));
        let then = self.past.front().filter(|_| self.past.len() > settings.measurement_delay_periods);
        let feedback = match then {
            // No measurement of that age exists yet.
            None => Vector3::zeros(),
            Some(then) if measured.is_finite() => {
                let offset = measured.position_m - then.position_m;
                let bound = self.limits.tube().error_m + settings.position_error_m;
                self.counters.measured(offset.norm(), bound);
                -offset * settings.tracker_per_s2 - (measured.velocity_m_s - then.velocity_m_s) * settings.tracker_per_s
            }
            Some(_) => {
                self.counters.missing();
                Vector3::zeros()
            }
        };
        let command = acceleration - self.reference.velocity_m_s * settings.a22_per_s + feedback;
        self.counters.commanded(command.norm(), settings.accel_m_s2);
        command
    }

    /// Takes the messages to be sent after [`Shield::filter`], by receiver. Vehicles that are far and have sent nothing
    /// get none. A message that is taken and not sent counts as lost. [`Shield::write_broadcast`] writes fewer bytes.
    pub fn messages(&mut self) -> impl Iterator<Item = Message> + '_ {
        self.contracts.messages(self.period, self.segment)
    }

    /// Takes the messages to be sent after [`Shield::filter`], as one. The memory of `broadcast` is used again.
    pub fn write_broadcast(&mut self, broadcast: &mut Broadcast) {
        self.contracts.write_broadcast(self.period, self.segment, broadcast);
    }

    /// Records a true state, `since_s` after the instant of the last command, for the report of a simulation.
    pub fn observe(&mut self, since_s: f64, truth: &State) {
        let reference = self.reference.after(self.acceleration, since_s);
        let error = (truth.position_m - reference.position_m).norm();
        self.counters.tracked(error, self.limits.tube().error_m);
    }

    /// Records a measurement and the true state that it measured, for the report of a simulation.
    pub fn observe_measurement(&mut self, measured: &State, truth: &State) {
        let settings = self.limits.settings();
        self.counters.sensed((measured.position_m - truth.position_m).norm(), settings.position_error_m);
        self.counters.sensed((measured.velocity_m_s - truth.velocity_m_s).norm(), settings.velocity_error_m_s);
    }

    /// Limits of the reference.
    #[must_use]
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Reference at the instant of the last command.
    #[must_use]
    pub fn reference(&self) -> State {
        self.reference
    }

    /// Reference at the next instant.
    #[must_use]
    pub fn next_reference(&self) -> State {
        self.next
    }

    /// Acceleration of the reference over the present period \[m/s^2\].
    #[must_use]
    pub fn reference_acceleration_m_s2(&self) -> Vector3<f64> {
        self.acceleration
    }

    /// Segment that the reference reserves from the next instant on.
    #[must_use]
    pub fn segment(&self) -> Segment {
        self.segment
    }

    /// Numbers of the flight so far.
    #[must_use]
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// For tests: see [`Contracts::pending_number`].
    #[cfg(test)]
    pub(crate) fn pending_number(&self, to: u32) -> Option<u64> {
        self.contracts.pending_number(to)
    }

    /// Defect for tests: see [`Contracts::hold_heard`].
    #[cfg(test)]
    pub(crate) fn hold_heard(&mut self, heard: &[Segment]) -> bool {
        self.contracts.hold_heard(&self.segment, &self.limits.side(), heard)
    }
}
