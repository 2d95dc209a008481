//! Shield of one vehicle: from a wish and a measurement to a command, by the steps of the certificate.

use std::collections::VecDeque;
use std::sync::Arc;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::agenda::Horizon;
use crate::brake::State;
use crate::choice::{Chosen, Reach};
use crate::contract::{Broadcast, Heard, Instant, Message};
use crate::contracts::Contracts;
use crate::log::ContractView;
use crate::obstacle::{KeepOut, Obstacle};
use crate::plane::Segment;
use crate::report::{Assumption, Counters, SharedStarts, TIME_ROUNDING, assumptions};
use crate::saved::{SavedShield, vector};
use crate::settings::{Limits, NORMAL_M, ShieldError, ShieldFault, UNIT_ROUNDOFF};
use crate::start::Start;
use crate::tube::integrals;

/// Number of planes within reach for which memory is reserved.
const REACHED: usize = 128;

/// Times of an instant by the clock of the vehicle, for [`Shield::filter_timed`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Time since the last instant \[s\]; without effect at the first one.
    pub elapsed_s: f64,
    /// Age of the measurement \[s\]. Without effect unless [`measurement_age_s`] is above 0.
    ///
    /// [`measurement_age_s`]: crate::Settings::measurement_age_s
    pub age_s: f64,
}

/// Command between two instants.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Leg {
    /// Command \[m/s^2\].
    #[serde(with = "vector")]
    pub(crate) command: Vector3<f64>,
    /// Time over which it was held \[s\].
    pub(crate) seconds: f64,
}

/// Shield of one vehicle.
///
/// Each vehicle makes its own [`Start`] with [`Limits::start`] and announces it to all others
/// ([`Start::to_bytes`]). Each of them creates its shield from all announced starts. Vehicles may have different
/// periods, brakes, limits and errors.
///
/// At each instant of the vehicle call [`Shield::filter`], send the [`Shield::messages`], and hold the command over the
/// period. Give each message to [`Shield::hear`] when it arrives, at any time, or its bytes to [`Shield::hear_bytes`].
/// Messages may be late, lost, doubled or out of order.
///
/// [`Shield::filter`] takes the period as the time since the last call, and measurements as new, or as old as
/// [`measurement_delay_periods`]. A vehicle with irregular instants calls [`Shield::filter_timed`].
///
/// [`measurement_delay_periods`]: crate::Settings::measurement_delay_periods
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
    /// Commands up to this instant, oldest first, for measurements with a known age, and the command since.
    legs: VecDeque<Leg>,
    held: Vector3<f64>,
    contracts: Contracts,
    /// Rooms of planes that need not be looked at, at the largest speed.
    fastest: Horizon,
    keep_outs: Vec<KeepOut>,
    reach: Reach,
    /// Largest coordinate that the margins for rounding cover \[m\].
    farthest_m: f64,
    counters: Counters,
}

impl Shield {
    /// Returns the shield of the vehicle with this number, counted from 0, among the announced starts of all vehicles.
    ///
    /// # Errors
    /// If the number is not in the list, or a start is invalid or for another delta or ellipsoid. Also if the own start
    /// is not that of these limits, or the vehicle starts too near to another one.
    pub fn new(limits: &Limits, index: usize, starts: &[Start]) -> Result<Self, ShieldError> {
        starts.iter().try_for_each(Start::check)?;
        limits.check_bodies(starts)?;
        if let Some(own) = starts.get(index)
            && limits.start(own.state)?.with_flight(own.flight) != *own
        {
            let problem = format!("the announced start of vehicle {} is not that of its own settings", index + 1);
            return Err(ShieldError::new(
                ShieldFault::Mismatch,
                "start",
                problem,
                index as f64,
                "announce `Limits::start` of these settings",
            ));
        }
        Self::of_checked(limits, index, &starts.into())
    }

    /// Returns a saved shield.
    pub(crate) fn loaded(saved: &SavedShield, limits: &Limits, starts: &Arc<[Start]>) -> Result<Self, ShieldError> {
        let contracts = Contracts::load(&saved.contracts, Arc::clone(starts))?;
        let mut shield = Self::new(limits, contracts.index().into(), starts)?;
        shield.contracts = contracts;
        shield.period = saved.period;
        (shield.reference, shield.acceleration) = (saved.reference, saved.acceleration);
        (shield.next, shield.segment) = (saved.next, saved.segment);
        shield.past.extend(&saved.past);
        shield.legs.extend(&saved.legs);
        shield.held = saved.held.into();
        shield.counters = saved.counters;
        Ok(shield)
    }

    /// Returns the state of this shield, to be continued in another process. `None` for a shield with obstacles.
    ///
    /// Of a shield and its copies only one may fly on. A vehicle that may return from a crash saves after each
    /// [`Shield::filter`], before it sends the messages and applies the command. The others rely on what it has sent.
    #[must_use]
    pub fn save(&self) -> Option<SavedShield> {
        self.keep_outs.is_empty().then(|| SavedShield {
            settings: *self.limits.settings(),
            starts: self.contracts.starts().to_vec(),
            period: self.period,
            reference: self.reference,
            acceleration: self.acceleration,
            next: self.next,
            segment: self.segment,
            past: self.past.iter().copied().collect(),
            legs: self.legs.iter().copied().collect(),
            held: if self.limits.most_legs() > 0 { self.held.into() } else { [0.0; 3] },
            contracts: self.contracts.save(),
            counters: self.counters,
        })
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
            legs: VecDeque::with_capacity(limits.most_legs()),
            held: Vector3::zeros(),
            contracts,
            fastest: limits.horizon(limits.settings().max_speed_m_s),
            keep_outs: vec![],
            // Two planes per other vehicle, but few are within reach.
            reach: Reach::with_capacity((2 * starts.len()).min(REACHED)),
            farthest_m: limits.farthest_m(),
            counters: Counters::default(),
        })
    }

    /// Returns this shield with planes before these obstacles, in the place of earlier ones. Obstacles must not move.
    ///
    /// # Errors
    /// If a clearance is invalid, or the vehicle is too near to an obstacle to stop before it. Also if the vehicle
    /// starts so far from the origin that the margin for rounding does not cover the normals of planes before it.
    pub fn with_obstacles(mut self, obstacles: &[Obstacle]) -> Result<Self, ShieldError> {
        self.keep_outs = KeepOut::all(obstacles, self.contracts.index(), self.limits.tube().error_m, &self.segment)?;
        let own = self.contracts.own();
        let nearest_m = self.keep_outs.iter().map(KeepOut::least_m).fold(f64::INFINITY, f64::min);
        self.farthest_m = self.limits.farthest_m().min(NORMAL_M * nearest_m / (8.0 * UNIT_ROUNDOFF * own.reach_m));
        own.check_segment(self.farthest_m)?;
        Ok(self)
    }

    /// Stores a message to this vehicle until the next instant. Messages to other vehicles have no effect.
    #[inline]
    pub fn hear(&mut self, message: &Message) {
        let heard = self.contracts.hear(message);
        self.counters.heard(heard, message.from);
    }

    /// Stores the message of bytes that arrived. Bytes that are not a message are dropped and counted.
    pub fn hear_bytes(&mut self, bytes: &[u8]) {
        match Message::from_bytes(bytes) {
            Ok(message) => self.hear(&message),
            Err(_) => self.counters.heard(Heard::Invalid, 0),
        }
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
        self.advance(None);
        self.choose(measured, 0.0, wanted)
    }

    /// Returns the command until the next instant \[m/s^2\], like [`Shield::filter`], with the times of this instant.
    ///
    /// The time since the last instant is any one of the range that [`period_tolerance`] and [`hang_periods`] give. A
    /// time or an age out of its range is counted. The reference then moves by the nearest time of the range.
    ///
    /// [`period_tolerance`]: crate::Settings::period_tolerance
    /// [`hang_periods`]: crate::Settings::hang_periods
    pub fn filter_timed(&mut self, measured: State, wanted: Vector3<f64>, timing: Timing) -> Vector3<f64> {
        self.advance(Some(timing));
        self.choose(measured, timing.age_s, wanted)
    }

    /// Chooses the acceleration of the reference at an instant, and returns the command.
    fn choose(&mut self, measured: State, age_s: f64, wanted: Vector3<f64>) -> Vector3<f64> {
        let (limits, reference) = (self.limits, self.reference);
        let reach = limits.envelope.reach_m(&reference, limits.choice);
        self.reach.clear();
        let instant = Instant {
            period: self.period,
            segment: &self.segment,
            side: &limits.side(),
            reach_m: reach,
            horizons: [limits.horizon(reference.velocity_m_s.norm()), self.fastest],
        };
        let renewed = self.contracts.renew(&instant, &mut self.reach);
        let (segment, is_level) = (self.segment, limits.settings().is_level);
        let planes = self.keep_outs.iter_mut().filter_map(|keep_out| keep_out.within(&segment, reach));
        let height_m = reference.position_m.z;
        self.reach
            .push_obstacles(planes.filter_map(|plane| if is_level { plane.in_level(height_m) } else { Some(plane) }));
        self.counters.renewed(renewed);
        let drag = reference.velocity_m_s * limits.settings().a22_per_s;
        let wanted = if is_level { Vector3::new(wanted.x, wanted.y, 0.0) } else { wanted };
        let own = wanted + drag;
        let wish = limits.envelope.cut(&reference.velocity_m_s, own);
        let chosen = if wish.iter().all(|value| value.is_finite()) {
            let chosen = self.reach.choose(&limits.envelope, &reference, wish, limits.choice);
            let changes = [own, wish].map(|command| (chosen.acceleration - command).norm());
            self.counters.chosen(chosen.is_brake, changes[0].min(f64::MAX), changes[1]);
            chosen
        } else {
            let acceleration = limits.envelope.brake.command(&reference.velocity_m_s);
            self.counters.chosen(true, acceleration.norm(), f64::INFINITY);
            Chosen { acceleration, is_brake: true }
        };
        self.command(measured, age_s, chosen.acceleration)
    }

    /// Returns the command of the brake \[m/s^2\], where an instant passes without a wish. Messages wait.
    pub fn brake(&mut self, measured: State) -> Vector3<f64> {
        self.advance(None);
        self.brake_now(measured, 0.0)
    }

    /// Returns the command of the brake \[m/s^2\], like [`Shield::brake`], with the times of this instant.
    pub fn brake_timed(&mut self, measured: State, timing: Timing) -> Vector3<f64> {
        self.advance(Some(timing));
        self.brake_now(measured, timing.age_s)
    }

    fn brake_now(&mut self, measured: State, age_s: f64) -> Vector3<f64> {
        let acceleration = self.limits.envelope.brake.command(&self.reference.velocity_m_s);
        self.counters.chosen(true, 0.0, 0.0);
        self.command(measured, age_s, acceleration)
    }

    /// Moves the reference to this instant, by the period or by the given time since the last instant.
    fn advance(&mut self, timing: Option<Timing>) {
        let period_s = self.limits.settings().period_s;
        let mut elapsed_s = period_s;
        if let Some(timing) = timing {
            let times_s = self.limits.times_s();
            if self.period > 0 {
                let error_s = self.limits.settings().elapsed_error_s;
                self.counters.elapsed(timing.elapsed_s, [times_s[0] - error_s, times_s[1] + error_s]);
                // A time that is not a number leaves the period.
                elapsed_s = if timing.elapsed_s.is_nan() { period_s } else { timing.elapsed_s };
                elapsed_s = elapsed_s.clamp(times_s[0], times_s[1]);
            }
            self.counters.aged(timing.age_s, self.limits.settings().measurement_age_s);
        }
        let most_legs = self.limits.most_legs();
        if self.period > 0 && most_legs > 0 {
            if self.legs.len() == most_legs {
                self.legs.pop_front();
            }
            self.legs.push_back(Leg { command: self.held, seconds: elapsed_s });
        }
        if elapsed_s != period_s {
            self.next = self.reference.after(self.acceleration, elapsed_s);
            self.segment = Segment::new(self.next.position_m, self.limits.envelope.brake.stop_m(&self.next));
        }
        self.reference = self.next;
        let delay = self.limits.settings().measurement_delay_periods;
        if self.past.len() > delay {
            self.past.pop_front();
        }
        self.past.push_back(self.reference);
        self.period += 1;
    }

    /// Returns the state at this instant that follows from a measurement of this age and the commands since. `None` if
    /// the age is more than its bound.
    ///
    /// A measurement from before the start is replaced by the announced start, whose error is that of a measurement.
    fn predicted(&self, measured: State, age_s: f64) -> Option<State> {
        let (mut first, mut left_s) = (self.legs.len(), age_s);
        while left_s > 0.0 && first > 0 {
            first -= 1;
            left_s -= self.legs[first].seconds;
        }
        let is_before_start = left_s > 0.0;
        if age_s.is_nan() || is_before_start && self.legs.len() as u64 + 1 != self.period {
            return None;
        }
        let mut state = if is_before_start { self.contracts.own().state } else { measured };
        // Time from the begin of the first leg to the measurement.
        let mut skipped_s = (-left_s).max(0.0);
        let a22 = self.limits.settings().a22_per_s;
        for leg in self.legs.range(first..) {
            let [decay, once, twice] = integrals(a22, leg.seconds - skipped_s);
            skipped_s = 0.0;
            state = State {
                position_m: state.position_m + state.velocity_m_s * once + leg.command * twice,
                velocity_m_s: state.velocity_m_s * decay + leg.command * once,
            };
        }
        Some(state)
    }

    /// Takes the acceleration of the reference, and returns the command with drag and feedback.
    fn command(&mut self, measured: State, age_s: f64, acceleration: Vector3<f64>) -> Vector3<f64> {
        let settings = self.limits.settings();
        self.acceleration = acceleration;
        self.next = self.reference.after(acceleration, settings.period_s);
        self.segment = Segment::new(self.next.position_m, self.limits.envelope.brake.stop_m(&self.next));
        self.counters.reserved(self.segment.farthest_m(), self.farthest_m);
        let [position_error_m, _] = settings.predicted_errors();
        // The compared states are those of the instant, or both of an earlier one.
        let (measured, then) = if settings.measurement_age_s > 0.0 {
            let predicted = self.predicted(measured, age_s);
            // An age beyond its bound is counted as such.
            if predicted.is_none() && age_s <= settings.measurement_age_s * TIME_ROUNDING {
                self.counters.missing();
            }
            (predicted.unwrap_or(measured), predicted.and(Some(&self.reference)))
        } else {
            (measured, self.past.front().filter(|_| self.past.len() > settings.measurement_delay_periods))
        };
        let feedback = match then {
            // No measurement of that age exists yet.
            None => Vector3::zeros(),
            Some(then) if measured.is_finite() => {
                let offset = measured.position_m - then.position_m;
                self.counters.measured(offset.norm(), self.limits.tube().error_m + position_error_m);
                -offset * settings.tracker_per_s2 - (measured.velocity_m_s - then.velocity_m_s) * settings.tracker_per_s
            }
            Some(_) => {
                self.counters.missing();
                Vector3::zeros()
            }
        };
        let command = acceleration - self.reference.velocity_m_s * settings.a22_per_s + feedback;
        self.counters.commanded(command.norm(), settings.accel_m_s2);
        self.held = command;
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
        let errors = [measured.position_m - truth.position_m, measured.velocity_m_s - truth.velocity_m_s];
        self.counters
            .sensed(errors.map(|error| error.norm()), [settings.position_error_m, settings.velocity_error_m_s]);
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

    /// Segment that the reference reserves at this instant, for a log.
    pub(crate) fn present_segment(&self) -> Segment {
        Segment::new(self.reference.position_m, self.limits.envelope.brake.stop_m(&self.reference))
    }

    /// Number of the vehicle, for a log.
    pub(crate) fn index(&self) -> usize {
        self.contracts.index().into()
    }

    /// Number of instants so far, for a log.
    pub(crate) fn period(&self) -> u64 {
        self.period
    }

    /// Announced starts of all vehicles, for a log.
    pub(crate) fn starts(&self) -> &[Start] {
        self.contracts.starts()
    }

    /// Returns the contract with another vehicle, for a log.
    pub(crate) fn contract_with(&self, other: usize) -> Option<ContractView> {
        self.contracts.view(other)
    }

    /// Numbers of the flight so far.
    #[must_use]
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Returns how many partners hold the same starts, by their messages.
    #[must_use]
    pub fn shared_starts(&self) -> SharedStarts {
        self.contracts.shared_starts()
    }

    /// Returns the assumptions of the certificate, each with its source, its largest observed share, and whether it
    /// held.
    #[must_use]
    pub fn assumptions(&self) -> Vec<Assumption> {
        assumptions(&self.limits, &self.counters, self.shared_starts())
    }

    /// For tests: see [`Contracts::pending_number`].
    #[cfg(test)]
    pub(crate) fn pending_number(&self, to: u16) -> Option<u32> {
        self.contracts.pending_number(to)
    }

    /// Defect for tests: see [`Contracts::hold_heard`].
    #[cfg(test)]
    pub(crate) fn hold_heard(&mut self, heard: &[Segment]) -> bool {
        self.contracts.hold_heard(&self.segment, &self.limits.side(), heard)
    }
}
