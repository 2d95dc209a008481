//! Shield of a vehicle that cannot stop: a unicycle, for example an aircraft with a least speed.
//!
//! # Model
//! The reference has a position p in a level plane, a heading with the unit vector t, and a speed v. Both rates v' = a
//! and heading' = w are held over a period h. The limits are `v_min` <= v <= V with `v_min` > 0, |a| <= A and
//! |w| <= `w_max`.
//!
//! # Reservation
//! The fallback slows down straight ahead to `v_min` and then turns at `w_max` on the loiter side, on a circle of the
//! radius r = `v_min` / `w_max`. Let n be the unit vector from the vehicle to the loiter side, and q = p + r n. With w
//! positive towards the loiter side, n' = -w t, so
//!
//! ```text
//! q' = (v - r w) t,   v - r w >= v_min - r w_max = 0
//! ```
//!
//! The point q moves forward along the heading and never backwards. While the vehicle slows down straight ahead, q runs
//! along the segment from q to the centre c of the loiter circle. While it loiters, q rests at c. The vehicle is always
//! r away from q. The vehicle therefore reserves the segment from q to c with the margin delta / 2 + e + r: the disc of
//! the loiter circle is in it. Segments and margins go into the same contracts as those of [`Shield`](crate::Shield).
//!
//! # Lemma 5
//! Let q, c, the next q and c, and the corner of the period be inside a half-space. Then q stays inside over the period
//! and over the fallback after it, and p is inside by at least the margin less r.
//!
//! *Proof.* Over a period the direction of q' turns from t to the next t in one sense, by less than a right angle, and
//! q' is never backwards. The path of q then lies in the triangle of both q and the corner, where the two tangents
//! meet. After the period, the fallback keeps q on the segment from the next q to the next c.
//!
//! This lemma takes the place of Lemma 1. Lemma 2 holds: the fallback keeps its own segment, and a plane is taken on
//! only after q and c were tested. Lemmas 3 and 4 and the theorem are unchanged, with r in the margins. The tube e is
//! an assumption here, since the tracker of a unicycle is the user's.
//!
//! Over the fallback the reference is placed from c in each period, so that rounding does not move c.

use nalgebra::Vector3;
use tautline_core::fact::FactKind;

use crate::State;
use crate::agenda::Horizon;
use crate::choice::Reach;
use crate::contract::{Broadcast, Heard, Instant, Message, Side};
use crate::contracts::Contracts;
use crate::obstacle::{KeepOut, Obstacle};
use crate::plane::{Metric, Segment};
use crate::report::{Assumption, Counters, SharedStarts};
use crate::settings::{FARTHEST_M, LEAD_PERIODS, NORMAL_M, ROUNDING_M, ShieldError, ShieldFault, UNIT_ROUNDOFF};
use crate::start::Start;

/// Largest turn in a period \[rad\].
const MAX_TURN_RAD: f64 = 1.5;
/// Sine of a turn below which a period is straight.
const STRAIGHT: f64 = 1e-9;
/// Turn rates that are tried in the place of a refused one, on each side of 0.
const RATES: i32 = 4;
/// Largest number of periods of slowing down.
const MAX_PERIODS: u32 = 1_000_000;
/// Part of a period of slowing down that is rounding.
const ROUNDING: f64 = 1e-9;
/// Relative excess of a speed that is rounding.
const SPEED_ROUNDING: f64 = 1e-12;
/// Largest way of q in a period \[m\], for the margin for rounding.
const MAX_WAY_M: f64 = 100.0;

/// Pose and speed of a unicycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Position \[m\].
    pub position_m: Vector3<f64>,
    /// Heading from the x axis to the y axis \[rad\].
    pub heading_rad: f64,
    /// Speed \[m/s\].
    pub speed_m_s: f64,
}

/// Command of a unicycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Steering {
    /// Rate of the speed \[m/s^2\].
    pub accel_m_s2: f64,
    /// Rate of the heading \[rad/s\].
    pub turn_rad_s: f64,
}

impl Pose {
    /// Unit vector ahead.
    fn ahead(&self) -> Vector3<f64> {
        let (sin, cos) = self.heading_rad.sin_cos();
        Vector3::new(cos, sin, 0.0)
    }

    /// Position and velocity.
    #[must_use]
    pub fn state(&self) -> State {
        State { position_m: self.position_m, velocity_m_s: self.ahead() * self.speed_m_s }
    }

    /// Returns the pose after `seconds` of a command.
    #[must_use]
    pub fn after(&self, command: Steering, seconds: f64) -> Self {
        let half = command.turn_rad_s * seconds / 2.0;
        let (sin, cos) = half.sin_cos();
        // (sin x) / x and (sin x - x cos x) / x^2, with their series near 0.
        let (even, odd) = if half.abs() < 1e-4 {
            (1.0 - half * half / 6.0, half / 3.0)
        } else {
            (sin / half, (sin - half * cos) / (half * half))
        };
        let middle = Self { heading_rad: self.heading_rad + half, ..*self }.ahead();
        let along = (self.speed_m_s + command.accel_m_s2 * seconds / 2.0) * seconds * even;
        let aside = command.accel_m_s2 * seconds * seconds / 2.0 * odd;
        Self {
            position_m: self.position_m + middle * along + Vector3::new(-middle.y, middle.x, 0.0) * aside,
            heading_rad: (self.heading_rad + command.turn_rad_s * seconds) % std::f64::consts::TAU,
            speed_m_s: self.speed_m_s + command.accel_m_s2 * seconds,
        }
    }

    fn is_finite(&self) -> bool {
        self.state().position_m.iter().chain(&[self.heading_rad, self.speed_m_s]).all(|value| value.is_finite())
    }
}

/// Settings of a unicycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loiter {
    /// Smallest separation of any pair that is certified \[m\]; the same for all vehicles.
    pub delta_m: f64,
    /// Period h over which a command is held \[s\].
    pub period_s: f64,
    /// Least speed `v_min` \[m/s\].
    pub min_speed_m_s: f64,
    /// Largest speed V \[m/s\].
    pub max_speed_m_s: f64,
    /// Largest rate A of the speed \[m/s^2\].
    pub accel_m_s2: f64,
    /// Largest rate `w_max` of the heading \[rad/s\].
    pub turn_rad_s: f64,
    /// Bound e on the distance to the reference \[m\], an assumption.
    pub tracking_error_m: f64,
    /// Whether the vehicle loiters to the left.
    pub is_left: bool,
}

impl Loiter {
    /// Radius of the loiter circle \[m\].
    #[must_use]
    pub fn radius_m(&self) -> f64 {
        self.min_speed_m_s / self.turn_rad_s
    }

    /// Returns the start of a vehicle, which all vehicles must know.
    ///
    /// # Errors
    /// If a setting is out of range, a number is not finite, or the speed is not within its limits. Also if the
    /// reserved segment reaches beyond 1e6 m along an axis.
    pub fn start(&self, pose: &Pose) -> Result<Start, ShieldError> {
        let fails = |place, problem: &str, value, remedy| {
            Err(ShieldError::new(ShieldFault::OutOfRange, place, problem.into(), value, remedy))
        };
        let positive = [
            ("delta_m", self.delta_m),
            ("period_s", self.period_s),
            ("min_speed_m_s", self.min_speed_m_s),
            ("max_speed_m_s", self.max_speed_m_s),
            ("accel_m_s2", self.accel_m_s2),
            ("turn_rad_s", self.turn_rad_s),
        ];
        if let Some((place, value)) = positive.into_iter().find(|(_, value)| !(value.is_finite() && *value > 0.0)) {
            return fails(place, "must be above 0", value, "give a positive number");
        }
        if !(self.tracking_error_m.is_finite() && self.tracking_error_m >= 0.0) {
            let value = self.tracking_error_m;
            return fails("tracking_error_m", "must not be negative", value, "give 0 or a positive number");
        }
        if self.turn_rad_s * self.period_s > MAX_TURN_RAD {
            return fails(
                "turn_rad_s",
                "must turn by at most 1.5 rad in a period",
                self.turn_rad_s,
                "shorten the period",
            );
        }
        if self.way_m() > MAX_WAY_M {
            let problem = format!("must move by at most {MAX_WAY_M} m in a period, for the rounding of its corner");
            return fails("max_speed_m_s", &problem, self.max_speed_m_s, "shorten the period");
        }
        if self.margin_m() > FARTHEST_M {
            let problem = format!("margins must be at most {FARTHEST_M} m, which the margin for rounding covers");
            return fails("delta_m", &problem, self.margin_m(), "use a shorter distance or a smaller circle");
        }
        if self.slowing(self.max_speed_m_s).0 > MAX_PERIODS {
            let problem = "slowing down must take at most a million periods";
            return fails("accel_m_s2", problem, self.accel_m_s2, "raise it or lower `max_speed_m_s`");
        }
        if !pose.is_finite() {
            return fails("start", "must be finite", f64::NAN, "give a position, a heading and a speed");
        }
        if !(self.min_speed_m_s..=self.max_speed_m_s).contains(&pose.speed_m_s) {
            let problem = "the speed must be from `min_speed_m_s` to `max_speed_m_s`";
            return fails("start", problem, pose.speed_m_s, "change the speed or its limits");
        }
        let start = Start {
            state: pose.state(),
            segment: self.fallback(pose).segment,
            margin_m: self.margin_m(),
            flight: 0,
            delta_m: self.delta_m,
            metric: Metric::BALL,
            reach_m: self.reach_m(self.max_speed_m_s) + self.lead_m(),
        };
        start.check()?;
        Ok(start)
    }

    /// Returns the largest way of q in a period \[m\].
    fn way_m(&self) -> f64 {
        (self.max_speed_m_s + self.min_speed_m_s) * self.period_s
    }

    /// Returns the distance beyond reach within which planes are renewed in each period \[m\].
    fn lead_m(&self) -> f64 {
        LEAD_PERIODS * self.way_m()
    }

    /// Returns the rooms of planes that need not be looked at.
    fn horizon(&self) -> Horizon {
        let near_m = self.reach_m(self.max_speed_m_s) + self.lead_m();
        Horizon::new(|periods| near_m + self.way_m() * periods as f64)
    }

    fn margin_m(&self) -> f64 {
        f64::midpoint(self.delta_m, ROUNDING_M) + self.tracking_error_m + self.radius_m()
    }

    /// Returns the distance from q within which planes limit the choice \[m\]: one period and slowing down after it.
    fn reach_m(&self, speed_m_s: f64) -> f64 {
        let fastest = speed_m_s + self.accel_m_s2 * self.period_s;
        let forward = (fastest + self.min_speed_m_s) * self.period_s;
        // The corner is at most 1 / cos of half the turn farther.
        2.0 * forward + self.slowing(fastest).1 + ROUNDING_M
    }

    /// Returns the periods and the distance of slowing down \[m\].
    fn slowing(&self, speed_m_s: f64) -> (u32, f64) {
        let above = (speed_m_s - self.min_speed_m_s).max(0.0);
        let periods = (above / (self.accel_m_s2 * self.period_s) - ROUNDING).ceil().max(0.0);
        // Above 0, and at most MAX_PERIODS after the check.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let count = periods as u32;
        (count, periods * self.period_s * (speed_m_s + self.min_speed_m_s) / 2.0)
    }

    /// Returns q.
    pub(crate) fn pivot_m(&self, pose: &Pose) -> Vector3<f64> {
        pose.position_m + self.beside_m(pose)
    }

    /// Returns q less the position.
    fn beside_m(&self, pose: &Pose) -> Vector3<f64> {
        let ahead = pose.ahead();
        let side = if self.is_left { 1.0 } else { -1.0 };
        Vector3::new(-ahead.y, ahead.x, 0.0) * (side * self.radius_m())
    }

    /// Returns the point where the tangents of the path of q at two poses meet, or the later q on a straight path.
    pub(crate) fn corner_m(&self, pose: &Pose, next: &Pose) -> Vector3<f64> {
        let (from, to) = (self.pivot_m(pose), self.pivot_m(next));
        let (ahead, after) = (pose.ahead(), next.ahead());
        let cross = |a: &Vector3<f64>, b: &Vector3<f64>| a.x * b.y - a.y * b.x;
        let sine = cross(&ahead, &after);
        if sine.abs() < STRAIGHT { to } else { from + ahead * (cross(&(to - from), &after) / sine) }
    }

    fn fallback(&self, pose: &Pose) -> Fallback {
        let (periods, distance) = self.slowing(pose.speed_m_s);
        let pivot = self.pivot_m(pose);
        Fallback { periods, segment: Segment::new(pivot, pivot + pose.ahead() * distance) }
    }

    /// Cuts a command to the limits of rates and speed.
    fn cut(&self, speed_m_s: f64, wish: Steering) -> Steering {
        let accel = wish.accel_m_s2.clamp(-self.accel_m_s2, self.accel_m_s2);
        let least = (self.min_speed_m_s - speed_m_s) / self.period_s;
        let most = (self.max_speed_m_s - speed_m_s) / self.period_s;
        Steering {
            accel_m_s2: accel.min(most).max(least),
            turn_rad_s: wish.turn_rad_s.clamp(-self.turn_rad_s, self.turn_rad_s),
        }
    }
}

/// Fallback from an instant on: periods of slowing down that are left, and the segment from q to c.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Fallback {
    periods: u32,
    segment: Segment,
}

/// Shield of one unicycle. See [`Shield`](crate::Shield) for its use; messages to and from both are the same.
#[derive(Clone, Debug)]
pub struct UnicycleShield {
    loiter: Loiter,
    side: Side,
    contracts: Contracts,
    /// Rooms of planes that need not be looked at.
    horizon: Horizon,
    keep_outs: Vec<KeepOut>,
    period: u64,
    reference: Pose,
    /// Command since the instant of the reference.
    command: Steering,
    next: Pose,
    fallback: Fallback,
    near: Reach,
    /// Largest coordinate that the margins for rounding cover \[m\].
    farthest_m: f64,
    counters: Counters,
}

impl UnicycleShield {
    /// Returns the shield of the vehicle with this number among the starts of all vehicles, at its start.
    ///
    /// # Errors
    /// If a setting or the start is invalid, or the vehicle starts too near to another one.
    pub fn new(loiter: &Loiter, index: usize, pose: &Pose, starts: &[Start]) -> Result<Self, ShieldError> {
        let own = loiter.start(pose)?;
        starts.iter().try_for_each(Start::check)?;
        let contracts = Contracts::new(index, starts.into())?;
        if own.with_flight(contracts.own().flight) != *contracts.own() {
            let problem = "the announced start differs from this pose of the vehicle counted from 0".into();
            return Err(ShieldError::new(
                ShieldFault::Mismatch,
                "start",
                problem,
                index as f64,
                "announce `Loiter::start` of this pose",
            ));
        }
        let differs = starts.iter().position(|start| start.delta_m != loiter.delta_m || start.metric != Metric::BALL);
        if let Some(vehicle) = differs {
            let problem = format!("vehicle {} has another value or an ellipsoid", vehicle + 1);
            return Err(ShieldError::new(
                ShieldFault::Mismatch,
                "delta_m",
                problem,
                loiter.delta_m,
                "give all vehicles the same",
            ));
        }
        Ok(Self {
            loiter: *loiter,
            side: Side { margin_m: loiter.margin_m(), metric: Metric::BALL },
            contracts,
            horizon: loiter.horizon(),
            keep_outs: vec![],
            period: 0,
            reference: *pose,
            command: Steering::default(),
            next: *pose,
            fallback: loiter.fallback(pose),
            near: Reach::with_capacity(2 * starts.len()),
            farthest_m: FARTHEST_M,
            counters: Counters::default(),
        })
    }

    /// Returns this shield with planes before these obstacles, see [`Shield::with_obstacles`].
    ///
    /// [`Shield::with_obstacles`]: crate::Shield::with_obstacles
    ///
    /// # Errors
    /// If a clearance is invalid, or the vehicle is too near to an obstacle.
    pub fn with_obstacles(mut self, obstacles: &[Obstacle]) -> Result<Self, ShieldError> {
        let around = self.loiter.tracking_error_m + self.loiter.radius_m();
        self.keep_outs = KeepOut::all(obstacles, self.contracts.index(), around, &self.fallback.segment)?;
        let own = self.contracts.own();
        let nearest_m = self.keep_outs.iter().map(KeepOut::least_m).fold(f64::INFINITY, f64::min);
        self.farthest_m = FARTHEST_M.min(NORMAL_M * nearest_m / (8.0 * UNIT_ROUNDOFF * own.reach_m));
        own.check_segment(self.farthest_m)?;
        Ok(self)
    }

    /// Stores a message to this vehicle until the next instant.
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

    /// Returns the command of the reference for the next period. A wish that is not finite falls back.
    pub fn filter(&mut self, wanted: Steering) -> Steering {
        self.reference = self.next;
        self.period += 1;
        let reach = self.loiter.reach_m(self.reference.speed_m_s);
        self.near.clear();
        let segment = self.fallback.segment;
        let instant = Instant {
            period: self.period,
            segment: &segment,
            side: &self.side,
            reach_m: reach,
            horizons: [self.horizon; 2],
        };
        self.counters.renewed(self.contracts.renew(&instant, &mut self.near));
        self.near.push_obstacles(self.keep_outs.iter_mut().filter_map(|keep_out| keep_out.within(&segment, reach)));
        if !(wanted.accel_m_s2.is_finite() && wanted.turn_rad_s.is_finite()) {
            self.counters.chosen(true, 1.0, 1.0);
            return self.fall_back();
        }
        let wish = self.loiter.cut(self.reference.speed_m_s, wanted);
        let loiter = self.loiter;
        // In the limits of both rates.
        let distance = |command: Steering, from: Steering| {
            let turn = (command.turn_rad_s - from.turn_rad_s) / loiter.turn_rad_s;
            turn.hypot((command.accel_m_s2 - from.accel_m_s2) / loiter.accel_m_s2).min(f64::MAX)
        };
        let change = |command: Steering| distance(command, wish);
        let rates = (-RATES..=RATES).map(|k| self.loiter.turn_rad_s * f64::from(k) / f64::from(RATES));
        let speeds = [wish.accel_m_s2, 0.0, -self.loiter.accel_m_s2];
        let others = rates.flat_map(|turn_rad_s| speeds.map(|accel_m_s2| Steering { accel_m_s2, turn_rad_s }));
        let others = others.map(|command| self.loiter.cut(self.reference.speed_m_s, command));
        let best = || {
            let accepted = others.filter_map(|command| Some((command, self.accepted(command)?)));
            accepted.min_by(|a, b| change(a.0).total_cmp(&change(b.0)))
        };
        let chosen = self.accepted(wish).map(|after| (wish, after)).or_else(best);
        if let Some((command, (next, fallback))) = chosen {
            self.counters.chosen(false, distance(command, wanted), change(command));
            (self.command, self.next, self.fallback) = (command, next, fallback);
            self.counters.reserved(self.fallback.segment.farthest_m(), self.farthest_m);
            return command;
        }
        let command = self.fall_back();
        self.counters.chosen(true, distance(command, wanted), distance(command, wish));
        command
    }

    /// Returns the command of the fallback, where an instant passes without a wish.
    pub fn loiter(&mut self) -> Steering {
        self.reference = self.next;
        self.period += 1;
        self.counters.chosen(true, 0.0, 0.0);
        self.fall_back()
    }

    /// Returns the pose and the fallback after an accepted command.
    fn accepted(&self, command: Steering) -> Option<(Pose, Fallback)> {
        let next = self.reference.after(command, self.loiter.period_s);
        let speeds =
            self.loiter.min_speed_m_s * (1.0 - SPEED_ROUNDING)..=self.loiter.max_speed_m_s * (1.0 + SPEED_ROUNDING);
        if !next.is_finite() || !speeds.contains(&next.speed_m_s) {
            return None;
        }
        let fallback = self.loiter.fallback(&next);
        let (corner, to) = (self.loiter.corner_m(&self.reference, &next), fallback.segment.position());
        (self.near.contains(&corner) && self.near.contains(&to) && self.near.contains(&fallback.segment.stop()))
            .then_some((next, fallback))
    }

    fn fall_back(&mut self) -> Steering {
        let (Loiter { period_s, min_speed_m_s, turn_rad_s, is_left, .. }, mut command) =
            (self.loiter, Steering::default());
        let centre_m = self.fallback.segment.stop();
        if self.fallback.periods > 0 {
            let left = f64::from(self.fallback.periods) * period_s;
            command.accel_m_s2 = (min_speed_m_s - self.reference.speed_m_s) / left;
        } else {
            command.turn_rad_s = if is_left { turn_rad_s } else { -turn_rad_s };
        }
        (self.command, self.next) = (command, self.reference.after(command, period_s));
        self.fallback.periods = self.fallback.periods.saturating_sub(1);
        // q is placed from the centre, which stays: rounding does not add up.
        let pivot_m = if self.fallback.periods == 0 {
            self.next.speed_m_s = min_speed_m_s;
            centre_m
        } else {
            let left_s = f64::from(self.fallback.periods) * period_s;
            centre_m - self.next.ahead() * (left_s * (self.next.speed_m_s + min_speed_m_s) / 2.0)
        };
        self.next.position_m = pivot_m - self.loiter.beside_m(&self.next);
        self.fallback.segment = Segment::new(pivot_m, centre_m);
        self.counters.reserved(self.fallback.segment.farthest_m(), self.farthest_m);
        command
    }

    /// Records a true position \[m\], `since_s` after the instant of the last command, for the report of a simulation.
    pub fn observe(&mut self, since_s: f64, truth_m: &Vector3<f64>) {
        let error_m = (truth_m - self.reference.after(self.command, since_s).position_m).norm();
        self.counters.tracked(error_m, self.loiter.tracking_error_m);
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
        let (loiter, counters, starts) = (&self.loiter, &self.counters, self.shared_starts());
        vec![
            Assumption::shared_starts(counters, starts),
            Assumption::of_one_program(FactKind::FlightNumber, starts),
            Assumption::of_one_program(FactKind::SavedContracts, starts),
            Assumption::declared(FactKind::Acceleration, loiter.accel_m_s2, "m/s^2"),
            Assumption::observed(
                FactKind::TrackingError,
                (loiter.tracking_error_m, "m"),
                counters.tracking_share,
                false,
            ),
            Assumption::declared(FactKind::Period, loiter.period_s, "s"),
            Assumption::observed(FactKind::Coordinates, (self.farthest_m, "m"), counters.coordinate_share, false),
        ]
    }

    /// Segment from q to c that the reference reserves from the next instant on.
    #[must_use]
    pub fn segment(&self) -> Segment {
        self.fallback.segment
    }

    /// Takes the messages to be sent after [`UnicycleShield::filter`]. See [`Shield::messages`].
    ///
    /// [`Shield::messages`]: crate::Shield::messages
    pub fn messages(&mut self) -> impl Iterator<Item = Message> + '_ {
        self.contracts.messages(self.period, self.fallback.segment)
    }

    /// Takes the messages to be sent, as one.
    pub fn write_broadcast(&mut self, broadcast: &mut Broadcast) {
        self.contracts.write_broadcast(self.period, self.fallback.segment, broadcast);
    }

    /// Reference at the instant of the last command.
    #[must_use]
    pub fn reference(&self) -> Pose {
        self.reference
    }

    /// Reference at the next instant.
    #[must_use]
    pub fn next_reference(&self) -> Pose {
        self.next
    }

    /// Numbers of the flight so far.
    #[must_use]
    pub fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Defect for tests: leaves the radius of the loiter circle out of the margin.
    #[cfg(test)]
    pub(crate) fn leave_out_radius(&mut self) {
        self.side.margin_m -= self.loiter.radius_m();
    }
}
