//! Settings of a shielded vehicle, and the limits of its reference that follow from them.
//!
//! # Rounding budget
//! Each vehicle has half of [`ROUNDING_M`], 5e-7 m, in its margin for the rounding of doubles. The unit of rounding u
//! is 2^-53, and C is the largest coordinate. The longest brake takes m periods, J is [`Tube::jumps`], and w is the
//! way of a unicycle in a period.
//!
//! | tolerance | where | length that it costs | limit | at the limit |
//! | --- | --- | --- | --- | --- |
//! | 2.5e-7 m | excess of a bound that is not reported | itself | | 2.5e-7 m |
//! | u | plane at a point: product, offset, margin | 16 u C | C <= 1e6 m | 1.8e-9 m |
//! | u | margin of the vehicle | 9 u times the margin | margin <= 1e6 m | 1e-9 m |
//! | u | brake, reference, tracker | u C (16 (m + 2) + 8 J) | [`Limits::farthest_m`] | 1.5e-7 m |
//! | 1e-12 | largest command and speed, relative | 1e-12 A / kp | A / kp <= 1e4 m | 1e-8 m |
//! | 1e-14 | squared length of a normal | 5e-15 times the margin | margin <= 1e6 m | 5e-9 m |
//! | 1e-6 | squared length of a proposed normal | 0: both divide by the same length | | 0 |
//! | 1e-14 | squared sine of parallel segments | 0: both ends are tested | | 0 |
//! | 1e-9 m | short segments, bounds of a distance that agree | 0: both ends are tested | | 0 |
//! | 1e-6 m | reach beyond which planes are left out | 0: it is added to the reach | | 0 |
//! | 1e-9 | sine of the turn of a straight unicycle | 1e-9 w / 2 | w <= 100 m | 5e-8 m |
//! | 1e-9 | periods of slowing down of a unicycle | 0: the rest point is kept | | 0 |
//! | 1e-12 | speeds of a unicycle, relative | 1e-12 w | w <= 100 m | 1e-10 m |
//! | u | normal before an obstacle at d, with the reach R | 8 u C R / d | C by this row | 8e-8 m |
//!
//! `proofs/margin.v` proves the rows of the plane, the margin and the squared length of a normal. It also proves that
//! the rows of a vehicle that can stop add up to at most 5e-7 m.
//!
//! *Brake.* In each of its periods the position errs by at most 8 u C, and the speed by at most 4 u V. The time left
//! times V is at most twice the length of the segment, so the stop point moves by at most 8 u C. It errs by 16 u C
//! itself. Only the brake adds errors up: other commands are tested at the computed numbers.
//!
//! *Reference.* The reference jumps by its rounding, at most 8 u C, in each period. The tracker follows: its distance
//! grows by [`Tube::jumps`] times that.
//!
//! Settings and starts beyond a limit are refused. A reference that flies farther than [`Limits::farthest_m`] exceeds
//! an assumption, which the report names.

use std::fmt;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::agenda::Horizon;
use crate::brake::{Brake, State};
use crate::choice::{Choice, Envelope};
use crate::contract::Side;
use crate::plane::{Metric, Segment};
use crate::report::TIME_ROUNDING;
use crate::start::Start;
use crate::tube::{
    Intervals, LARGEST_DRAG, TrackerLoop, Tube, TubeError, largest_drag_per_s, longest_period_s, shortest_lag_s,
};
use tautline_core::text::{at_least, at_most, exact, shortest};

/// Largest coordinate of a start \[m\].
pub(crate) const FARTHEST_M: f64 = 1e6;
/// Part of the safety distance that is added because of rounding \[m\]. The module documentation lists the covered
/// operations.
pub const ROUNDING_M: f64 = 1e-6;
/// Part of the margin of a vehicle for its brake and its reference \[m\].
const MOTION_M: f64 = 1.5e-7;
/// Part of the margin before an obstacle for the rounding of its normal \[m\].
pub(crate) const NORMAL_M: f64 = 8e-8;
/// Largest error of one rounded operation, relative to its result.
pub(crate) const UNIT_ROUNDOFF: f64 = f64::EPSILON / 2.0;
/// Largest quotient of the largest command and the gain on position \[m\].
const STIFF_M: f64 = 1e4;
/// Default deceleration of the brake, as a share of the largest command.
const BRAKE_SHARE: f64 = 0.6;
/// Default ease, as a share of the safety distance.
const EASE_SHARE: f64 = 0.2;
/// Distance beyond reach within which planes are renewed in each period, in periods at the largest speed. A proposal
/// and its decision take two of them.
pub(crate) const LEAD_PERIODS: f64 = 2.0;
/// Largest age of a measurement, in periods.
const MAX_DELAY: usize = 20;
/// Logarithm of the quotient of two speeds so far apart that the smaller one moves no position of a double.
const VANISHED: f64 = 50.0;
/// Largest number of instants in a row that a vehicle may miss.
const MAX_HANG: usize = 20;
/// Largest tolerance of a period.
const MAX_TOLERANCE: f64 = 0.5;

/// Settings of one vehicle. [`Settings::new`] fills in the defaults.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// Smallest separation of any pair that is certified \[m\]; the same for all vehicles.
    pub delta_m: f64,
    /// Half height of an upright ellipsoid around each vehicle \[m\], whose other half axes are `delta_m` / 2; the same
    /// for all vehicles. `None` for a ball. Ellipsoids do not overlap.
    pub half_height_m: Option<f64>,
    /// Period h over which a command is held \[s\].
    pub period_s: f64,
    /// Largest command A that the vehicle carries out \[m/s^2\].
    pub accel_m_s2: f64,
    /// Deceleration of the brake \[m/s^2\]; default 0.6 A, at most what is left for the reference.
    pub brake_m_s2: Option<f64>,
    /// Largest speed V of the reference \[m/s\].
    pub max_speed_m_s: f64,
    /// Bound on the error of the measured position \[m\].
    pub position_error_m: f64,
    /// Bound on the error of the measured velocity \[m/s\].
    pub velocity_error_m_s: f64,
    /// Bound on the push of wind or of a model error \[m/s^2\].
    pub disturbance_m_s2: f64,
    /// Drag a22 \[1/s\]; negative slows.
    pub a22_per_s: f64,
    /// Gain of the tracker on position \[1/s^2\].
    pub tracker_per_s2: f64,
    /// Gain of the tracker on velocity \[1/s\].
    pub tracker_per_s: f64,
    /// Age of a measurement when it is used, in periods.
    pub measurement_delay_periods: usize,
    /// Share r of the period by which the time between two instants may differ from it, up to 0.5. The vehicle knows
    /// this time afterwards, see [`Timing`](crate::Timing).
    #[serde(default)]
    pub period_tolerance: f64,
    /// Number k of instants in a row that the computer may miss. The actuator holds the last command until the next
    /// instant, up to (k + 1) h (1 + r).
    #[serde(default)]
    pub hang_periods: usize,
    /// Bound on the error of the known time between two instants \[s\].
    #[serde(default)]
    pub elapsed_error_s: f64,
    /// Largest age of a measurement when it is used \[s\], if the vehicle knows the age of each one, see
    /// [`Timing`](crate::Timing). The shield predicts the state at the instant with its own commands.
    #[serde(default)]
    pub measurement_age_s: f64,
    /// Time constant of the actuator \[s\], which is at zero at the start; 0 for none.
    pub actuator_lag_s: f64,
    /// Assumed bound on the distance to the reference \[m\], in the place of the computed one. For vehicles other than
    /// points, such as quadrotors.
    pub tracking_error_m: Option<f64>,
    /// Distance between the path of the plant and the path that its acceleration gives \[m\], added to the tube. A
    /// plant that moves on the chords of its steps dt needs A dt^2 / 8.
    pub path_error_m: f64,
    /// Error of a simulated plant's acceleration \[m/s^2\], added to the push.
    pub integration_error_m_s2: f64,
    /// Gap that two vehicles keep by choice \[m\]; default 0.2 of the safety distance.
    pub ease_m: Option<f64>,
    /// Share of a cut command that is turned to the right, from -1 to 1; 0 for none. Before obstacles alone, a command
    /// clearly to the other side is turned there.
    pub turn: f64,
    /// Whether vehicles stop before each other instead of giving way; `ease_m` and `turn` have no effect then.
    pub stop_only: bool,
    /// Whether all vehicles move in one level plane. The vertical part of a command is then left out, and obstacles act
    /// by their sections with the plane.
    pub is_level: bool,
}

impl Settings {
    /// Returns the defaults for a safety distance \[m\] and a period \[s\]: commands up to 5 m/s^2, speed up to 2 m/s,
    /// exact measurements and no push.
    #[must_use]
    pub fn new(delta_m: f64, period_s: f64) -> Self {
        Self {
            delta_m,
            half_height_m: None,
            period_s,
            accel_m_s2: 5.0,
            brake_m_s2: None,
            max_speed_m_s: 2.0,
            position_error_m: 0.0,
            velocity_error_m_s: 0.0,
            disturbance_m_s2: 0.0,
            a22_per_s: 0.0,
            tracker_per_s2: 4.0,
            tracker_per_s: 4.0,
            measurement_delay_periods: 0,
            period_tolerance: 0.0,
            hang_periods: 0,
            elapsed_error_s: 0.0,
            measurement_age_s: 0.0,
            actuator_lag_s: 0.0,
            tracking_error_m: None,
            path_error_m: 0.0,
            integration_error_m_s2: 0.0,
            ease_m: None,
            turn: 1.0,
            stop_only: false,
            is_level: false,
        }
    }

    /// Returns the limits of the reference.
    ///
    /// # Errors
    /// If a value is out of range, the tracker is unstable, or nothing is left for the reference or its brake.
    pub fn limits(&self) -> Result<Limits, ShieldError> {
        self.check_ranges()?;
        let tracker = self.tracker();
        let mut tube = self.loop_tube().map_err(|error| self.no_tube(error, &tracker))?;
        tube.error_m = self.tracking_error_m.unwrap_or(tube.error_m) + self.path_error_m;
        let drag = self.a22_per_s.abs() * self.max_speed_m_s;
        let reference = self.accel_m_s2 - tube.feedback_m_s2 - drag;
        if drag >= self.accel_m_s2 {
            let (accel, speed) = (shortest(self.accel_m_s2), shortest(self.max_speed_m_s));
            let problem = format!("drag takes {drag:.4} of `accel_m_s2` {accel} at `max_speed_m_s` {speed}");
            return Err(ShieldError::new(
                ShieldFault::NoReserve,
                "a22_per_s",
                problem,
                self.a22_per_s,
                "lower its magnitude or the speed",
            ));
        }
        if reference <= 0.0 {
            if let Some((place, value, remedy)) = self.culprit(|settings| {
                settings.loop_tube().is_ok_and(|tube| settings.accel_m_s2 - tube.feedback_m_s2 - drag > 0.0)
            }) {
                let problem = format!(
                    "feedback then takes up to {:.4} and drag {drag:.4} of `accel_m_s2` {}; nothing is left",
                    tube.feedback_m_s2,
                    shortest(self.accel_m_s2)
                );
                return Err(ShieldError::new(ShieldFault::NoReserve, place, problem, value, remedy));
            }
            return Err(ShieldError::new(
                ShieldFault::NoReserve,
                "accel_m_s2",
                format!("feedback takes up to {:.4} and drag {drag:.4}; nothing is left", tube.feedback_m_s2),
                self.accel_m_s2,
                "raise it, or lower the errors, `disturbance_m_s2` or the gains of the tracker",
            ));
        }
        let brake = self.brake_m_s2.unwrap_or((BRAKE_SHARE * self.accel_m_s2).min(reference));
        if brake > reference {
            return Err(ShieldError::new(
                ShieldFault::NoReserve,
                "brake_m_s2",
                format!("must be at most {reference:.4}, which is what feedback and drag leave of `accel_m_s2`"),
                brake,
                "lower it or leave it out",
            ));
        }
        let choice = if self.stop_only {
            Choice::Scale
        } else {
            Choice::GiveWay { ease_m: self.ease_m.unwrap_or(EASE_SHARE * self.delta_m), turn: self.turn }
        };
        let [shortest_s, longest_s] = self.times_s();
        let envelope = Envelope {
            accel_m_s2: reference,
            speed_m_s: self.max_speed_m_s,
            period_s: longest_s,
            brake: Brake::irregular(brake, shortest_s, longest_s),
        };
        let metric = self.half_height_m.map_or(Metric::BALL, |half| Metric::ellipsoid(self.delta_m, half));
        let stretch = metric.stretch();
        let margin_m = f64::midpoint(self.delta_m, ROUNDING_M * stretch) + tube.error_m * stretch;
        let lead_m = LEAD_PERIODS * self.max_speed_m_s * longest_s;
        let farthest_m = self.farthest_m(&envelope, &tube, margin_m)?;
        Ok(Limits { settings: *self, tube, envelope, choice, side: Side { margin_m, metric }, lead_m, farthest_m })
    }

    /// Returns the loop of the tracker.
    fn tracker(&self) -> TrackerLoop {
        let [position_error_m, velocity_error_m_s] = self.predicted_errors();
        TrackerLoop {
            period_s: self.period_s,
            tracker_per_s2: self.tracker_per_s2,
            tracker_per_s: self.tracker_per_s,
            position_error_m,
            velocity_error_m_s,
            disturbance_m_s2: self.disturbance_m_s2 + self.integration_error_m_s2,
            a22_per_s: self.a22_per_s,
            accel_m_s2: self.accel_m_s2,
            measurement_delay_periods: self.measurement_delay_periods,
            actuator_lag_s: self.actuator_lag_s,
        }
    }

    /// Returns the computed tube.
    fn loop_tube(&self) -> Result<Tube, TubeError> {
        match self.intervals() {
            None => self.tracker().tube(),
            Some(intervals) => self.tracker().irregular_tube(&intervals),
        }
    }

    /// Returns the shortest and the longest time between two instants \[s\].
    fn times_s(&self) -> [f64; 2] {
        // Exact if the instants are regular.
        let longest_s = (self.hang_periods + 1) as f64 * self.period_s * (1.0 + self.period_tolerance);
        [self.period_s * (1.0 - self.period_tolerance), longest_s]
    }

    /// Returns the times between instants if they are irregular.
    fn intervals(&self) -> Option<Intervals> {
        let is_irregular = self.period_tolerance > 0.0 || self.hang_periods > 0;
        let [shortest_s, longest_s] = self.times_s();
        let jumps = [self.max_speed_m_s, self.accel_m_s2].map(|rate| rate * self.elapsed_error_s);
        is_irregular.then_some(Intervals { shortest_s, longest_s, jumps })
    }

    /// Returns the bounds on the errors of position \[m\] and velocity \[m/s\] at an instant, of a state predicted from
    /// a measurement of the largest known age T. With G = exp(a22 T) or 1, and m instants in that time:
    ///
    /// ```text
    /// velocity   G (eps_v + W T + A eps_t m (m + 1))
    /// position   eps_p + G (eps_v T + W T^2/2 + A eps_t m (m + 1) T) + 2 path errors
    /// ```
    ///
    /// With times known within `eps_t`, the j-th last change of the command, at most 2 A, is known within j `eps_t`.
    pub(crate) fn predicted_errors(&self) -> [f64; 2] {
        let errors = [self.position_error_m, self.velocity_error_m_s];
        let age_s = self.measurement_age_s;
        if age_s == 0.0 {
            return errors;
        }
        let push = self.disturbance_m_s2 + self.integration_error_m_s2;
        let growth = (self.a22_per_s * age_s).exp().max(1.0) * (1.0 + 1e-12);
        let instants = (age_s / self.times_s()[0]).floor() + 1.0;
        let switched = self.accel_m_s2 * self.elapsed_error_s * instants * (instants + 1.0);
        let velocity = growth * (errors[1] + push * age_s + switched);
        let moved = growth * (errors[1] * age_s + push * age_s * age_s / 2.0 + switched * age_s);
        [errors[0] + moved + 2.0 * self.path_error_m, velocity]
    }

    /// Returns the setting of the instants that is the only reason why a condition fails, with its value and a remedy.
    fn culprit(&self, holds: impl Fn(Self) -> bool) -> Option<(&'static str, f64, &'static str)> {
        let candidates = [
            // Without the other settings it has no effect.
            (
                "elapsed_error_s",
                self.elapsed_error_s,
                "measure the time between instants more accurately, or lower the gains",
                Self { elapsed_error_s: 0.0, ..*self },
            ),
            (
                "hang_periods",
                self.hang_periods as f64,
                "lower it, the gains or the period",
                Self { hang_periods: 0, ..*self },
            ),
            (
                "period_tolerance",
                self.period_tolerance,
                "lower it, the gains or the period",
                Self { period_tolerance: 0.0, ..*self },
            ),
            (
                "measurement_age_s",
                self.measurement_age_s,
                "use newer measurements or lower both gains of the tracker",
                Self { measurement_age_s: 0.0, ..*self },
            ),
        ];
        let found = candidates.into_iter().find(|(_, value, _, without)| *value > 0.0 && holds(*without));
        found.map(|(place, value, remedy, _)| (place, value, remedy))
    }

    /// Returns the largest coordinate that the margin for rounding covers \[m\].
    fn farthest_m(&self, envelope: &Envelope, tube: &Tube, margin_m: f64) -> Result<f64, ShieldError> {
        let fails = |place, problem, value, remedy| {
            Err(ShieldError::new(ShieldFault::OutOfRange, place, problem, value, remedy))
        };
        if margin_m > FARTHEST_M {
            let problem = format!("margins must be at most {FARTHEST_M} m, which the margin for rounding covers");
            let place = match (self.tracking_error_m, self.half_height_m) {
                (Some(error_m), _) if error_m > FARTHEST_M / 2.0 => "tracking_error_m",
                (_, Some(_)) => "half_height_m",
                (_, None) => "delta_m",
            };
            return fails(place, problem, margin_m, "use a shorter distance, smaller errors or a rounder ellipsoid");
        }
        if self.accel_m_s2 / self.tracker_per_s2 > STIFF_M {
            let problem = format!("must be at most {STIFF_M} m times `tracker_per_s2`, for the rounding of commands");
            return fails("accel_m_s2", problem, self.accel_m_s2, "lower it or raise `tracker_per_s2`");
        }
        let [shortest_s, longest_s] = self.times_s();
        // With irregular instants the speed shrinks in each of the last periods by their smallest ratio.
        let last = if shortest_s < longest_s { (VANISHED / -(-shortest_s / longest_s).ln_1p()).ceil() } else { 0.0 };
        let periods = (self.max_speed_m_s / (envelope.brake.deceleration_m_s2() * shortest_s)).floor() + last;
        let jumps = if self.tracking_error_m.is_some() { 0.0 } else { tube.jumps };
        let roundings = 16.0 * (periods + 2.0) + 8.0 * jumps;
        let farthest_m = (MOTION_M / (UNIT_ROUNDOFF * roundings)).floor().min(FARTHEST_M);
        let longest_m = envelope.brake.distance_m(self.max_speed_m_s);
        // Negative or not a number if the sum overflows.
        if longest_m >= 0.0 && longest_m <= farthest_m {
            return Ok(farthest_m);
        }
        let problem = format!(
            "a brake over {longest_m} m in {periods} periods, with this tracker, leaves coordinates up to \
             {farthest_m} m to the margin for rounding"
        );
        let remedy = "lower the speed, brake harder, or lengthen the period";
        match self.brake_m_s2 {
            Some(brake_m_s2) => fails("brake_m_s2", problem, brake_m_s2, remedy),
            None => fails("max_speed_m_s", problem, self.max_speed_m_s, remedy),
        }
    }

    fn check_ranges(&self) -> Result<(), ShieldError> {
        let positive = [
            ("delta_m", self.delta_m),
            ("half_height_m", self.half_height_m.unwrap_or(1.0)),
            ("period_s", self.period_s),
            ("accel_m_s2", self.accel_m_s2),
            ("brake_m_s2", self.brake_m_s2.unwrap_or(1.0)),
            ("max_speed_m_s", self.max_speed_m_s),
            ("tracker_per_s2", self.tracker_per_s2),
            ("tracker_per_s", self.tracker_per_s),
        ];
        let not_negative = [
            ("position_error_m", self.position_error_m),
            ("velocity_error_m_s", self.velocity_error_m_s),
            ("disturbance_m_s2", self.disturbance_m_s2),
            ("period_tolerance", self.period_tolerance),
            ("elapsed_error_s", self.elapsed_error_s),
            ("measurement_age_s", self.measurement_age_s),
            ("actuator_lag_s", self.actuator_lag_s),
            ("tracking_error_m", self.tracking_error_m.unwrap_or(0.0)),
            ("path_error_m", self.path_error_m),
            ("integration_error_m_s2", self.integration_error_m_s2),
            ("ease_m", self.ease_m.unwrap_or(0.0)),
        ];
        let fails = |place, problem: &str, value, remedy| {
            Err(ShieldError::new(ShieldFault::OutOfRange, place, problem.into(), value, remedy))
        };
        if let Some((place, value)) = positive.into_iter().find(|(_, value)| !(value.is_finite() && *value > 0.0)) {
            return fails(place, "must be above 0", value, "give a positive number");
        }
        if let Some((place, value)) = not_negative.into_iter().find(|(_, value)| !(value.is_finite() && *value >= 0.0))
        {
            return fails(place, "must not be negative", value, "give 0 or a positive number");
        }
        if !self.a22_per_s.is_finite() {
            return fails("a22_per_s", "must be a number", self.a22_per_s, "give the drag in 1/s");
        }
        if !(-1.0..=1.0).contains(&self.turn) {
            return fails("turn", "must be from -1 to 1", self.turn, "give 1 for the right hand, 0 for none");
        }
        if self.measurement_delay_periods > MAX_DELAY {
            let value = self.measurement_delay_periods as f64;
            return fails("measurement_delay_periods", "must be at most 20 periods", value, "use a longer period");
        }
        if self.period_tolerance > MAX_TOLERANCE {
            let (problem, remedy) = ("must be at most 0.5", "use a timer with less jitter, or `hang_periods`");
            return fails("period_tolerance", problem, self.period_tolerance, remedy);
        }
        if self.hang_periods > MAX_HANG {
            let value = self.hang_periods as f64;
            return fails("hang_periods", "must be at most 20 periods", value, "use a longer period");
        }
        let is_irregular = self.intervals().is_some();
        if self.measurement_delay_periods > 0 && (is_irregular || self.measurement_age_s > 0.0) {
            let problem = "must be 0 with `period_tolerance`, `hang_periods` or `measurement_age_s`";
            let value = self.measurement_delay_periods as f64;
            return fails("measurement_delay_periods", problem, value, "give the largest age as `measurement_age_s`");
        }
        if self.measurement_age_s > 0.0 && self.actuator_lag_s > 0.0 {
            let problem = "must be 0 with an actuator lag, which the prediction leaves out";
            return fails("measurement_age_s", problem, self.measurement_age_s, "use `measurement_delay_periods`");
        }
        if self.measurement_age_s > 0.0 && self.a22_per_s.abs() * self.times_s()[1] > LARGEST_DRAG {
            let problem = "the drag times the longest time between instants must be at most 1 with `measurement_age_s`";
            return fails("a22_per_s", problem, self.a22_per_s, "lower its magnitude or shorten the period");
        }
        if self.elapsed_error_s > 0.0 && !is_irregular {
            let problem = "has an effect only with `period_tolerance` or `hang_periods`";
            return fails("elapsed_error_s", problem, self.elapsed_error_s, "give the tolerance of the period");
        }
        if self.measurement_age_s > MAX_DELAY as f64 * self.period_s {
            let problem = "must be at most 20 periods";
            return fails("measurement_age_s", problem, self.measurement_age_s, "use newer measurements");
        }
        let [shortest_s, _] = self.times_s();
        if self.elapsed_error_s > shortest_s {
            let problem = "must be at most the shortest time between two instants";
            return fails("elapsed_error_s", problem, self.elapsed_error_s, "measure this time, see `Timing`");
        }
        Ok(())
    }

    fn no_tube(&self, error: TubeError, tracker: &TrackerLoop) -> ShieldError {
        let has_lag = self.actuator_lag_s > 0.0;
        let of_period = format!("for a period of {} s", shortest(self.period_s));
        let [from_s, to_s] = self.times_s().map(|time_s| shortest((time_s * 1e9).round() / 1e9));
        let of_times = format!("{from_s} s to {to_s} s between instants");
        let gains = [self.tracker_per_s2, self.tracker_per_s].map(shortest);
        let of_gains = format!("with `tracker_per_s2` {}, `tracker_per_s` {}, {of_times}", gains[0], gains[1]);
        if error == TubeError::IrregularLag {
            let problem = "must be 0 with irregular instants: their tube covers no lag";
            let remedy = "leave out `period_tolerance` and `hang_periods`, or the lag";
            let value = self.actuator_lag_s;
            return ShieldError::new(ShieldFault::Tracker, "actuator_lag_s", problem.into(), value, remedy);
        }
        if self.intervals().is_some() && error == TubeError::LargeDrag {
            let problem = format!("its product with the longest of {of_times} must be at most {LARGEST_DRAG}");
            let remedy = "lower its magnitude, shorten the period or lower `hang_periods`";
            return ShieldError::new(ShieldFault::Tracker, "a22_per_s", problem, self.a22_per_s, remedy);
        }
        if let Some((place, value, remedy)) = self.culprit(|settings| settings.loop_tube().is_ok()) {
            let problem = format!("the tracker does not settle {of_gains}");
            return ShieldError::new(ShieldFault::Tracker, place, problem, value, remedy);
        }
        let place = match error {
            TubeError::ShortLag | TubeError::IrregularLag => "actuator_lag_s",
            TubeError::LongPeriod => "period_s",
            TubeError::LargeDrag => "a22_per_s",
            // Name the setting that leaves a tube when it is 0.
            TubeError::Unstable | TubeError::Slow => {
                let holds = |tracker: TrackerLoop| tracker.tube().is_ok();
                if has_lag && holds(TrackerLoop { actuator_lag_s: 0.0, ..*tracker }) {
                    "actuator_lag_s"
                } else if self.a22_per_s != 0.0 && holds(TrackerLoop { a22_per_s: 0.0, ..*tracker }) {
                    "a22_per_s"
                } else if error == TubeError::Unstable {
                    "tracker_per_s"
                } else {
                    "tracker_per_s2"
                }
            }
        };
        let (value, remedy) = match (error, place) {
            (TubeError::ShortLag, _) => (self.actuator_lag_s, "round it up to this lag, or down to 0"),
            (_, "actuator_lag_s") => (self.actuator_lag_s, "lower it, or both gains of the tracker"),
            (_, "period_s") => (self.period_s, "shorten the period"),
            (_, "a22_per_s") => (self.a22_per_s, "lower the magnitude, or shorten the period"),
            (TubeError::Slow, _) => {
                (self.tracker_per_s2, "raise the gain that is small beside 1/s, or lengthen the period")
            }
            (..) => (self.tracker_per_s, "lower both gains or shorten the period"),
        };
        let of_loop = format!(
            "with `tracker_per_s2` {}, `tracker_per_s` {}, period {} s, measurements {} periods old, `a22_per_s` {}, \
             lag {} s",
            shortest(self.tracker_per_s2),
            shortest(self.tracker_per_s),
            shortest(self.period_s),
            self.measurement_delay_periods,
            shortest(self.a22_per_s),
            shortest(self.actuator_lag_s)
        );
        let problem = match error {
            TubeError::Unstable | TubeError::IrregularLag => {
                format!("the tracker is unstable {of_loop}")
            }
            TubeError::Slow => format!("the tracker settles too slowly or not at all {of_loop}"),
            TubeError::ShortLag => {
                format!("must be 0 or at least {} s {of_period}", at_most(shortest_lag_s(self.period_s), 6))
            }
            TubeError::LongPeriod => {
                let (period_s, longest_s) = (shortest(self.period_s), shortest(longest_period_s(has_lag)));
                format!("a period of {period_s} s is longer than {longest_s} s")
            }
            TubeError::LargeDrag => {
                let largest_per_s = largest_drag_per_s(self.period_s, has_lag);
                format!("magnitude must be at most {} {of_period}", at_least(largest_per_s, 3))
            }
        };
        ShieldError::new(ShieldFault::Tracker, place, problem, value, remedy)
    }
}

/// Limits of the reference of a vehicle, from checked [`Settings`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    settings: Settings,
    tube: Tube,
    pub(crate) envelope: Envelope,
    pub(crate) choice: Choice,
    side: Side,
    /// Distance beyond reach within which planes are renewed in each period \[m\].
    pub(crate) lead_m: f64,
    farthest_m: f64,
}

impl Limits {
    /// Settings that these limits follow from.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Bounds on the distance to the reference and on the feedback.
    #[must_use]
    pub fn tube(&self) -> Tube {
        self.tube
    }

    /// Largest acceleration `A_n` of the reference \[m/s^2\].
    #[must_use]
    pub fn reference_m_s2(&self) -> f64 {
        self.envelope.accel_m_s2
    }

    /// Shortest and longest time between two instants \[s\]; both are the period if instants are regular.
    #[must_use]
    pub fn times_s(&self) -> [f64; 2] {
        self.settings.times_s()
    }

    /// Number of the last commands that a shield keeps to predict its state from a measurement; 0 for new measurements.
    pub(crate) fn most_legs(&self) -> usize {
        let oldest_s = self.settings.measurement_age_s * TIME_ROUNDING;
        if oldest_s == 0.0 {
            return 0;
        }
        // One more than the oldest measurement can need, because ages and times have rounding. At most 20 periods of at
        // least half of the period.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let whole = (oldest_s / self.times_s()[0]).floor() as usize;
        whole + 1
    }

    /// Brake of the reference.
    #[must_use]
    pub fn brake(&self) -> Brake {
        self.envelope.brake
    }

    /// Rule by which a command is chosen.
    #[must_use]
    pub fn choice(&self) -> Choice {
        self.choice
    }

    /// Distance that the reference keeps from the plane between a pair \[m\]: delta / 2 + e, and rounding. With
    /// ellipsoids it is in the lengths of [`Limits::metric`], and e times the factor by which a length grows there.
    #[must_use]
    pub fn margin_m(&self) -> f64 {
        self.side.margin_m
    }

    /// Lengths in which two vehicles are delta apart.
    #[must_use]
    pub fn metric(&self) -> Metric {
        self.side.metric
    }

    /// Largest coordinate of the reference and of its stop points that the margin for rounding covers \[m\]. It is 1e6
    /// m, and less with long brakes or a slow tracker.
    #[must_use]
    pub fn farthest_m(&self) -> f64 {
        self.farthest_m
    }

    pub(crate) fn side(&self) -> Side {
        self.side
    }

    /// Returns the rooms of planes that need not be looked at, at a speed of the reference \[m/s\].
    pub(crate) fn horizon(&self, speed_m_s: f64) -> Horizon {
        let Envelope { accel_m_s2, speed_m_s: largest_m_s, period_s, .. } = self.envelope;
        Horizon::new(|periods| {
            let ahead_s = periods as f64 * period_s;
            let fastest = (speed_m_s + accel_m_s2 * ahead_s).min(largest_m_s);
            self.envelope.reach_at_m(fastest, self.choice) + fastest * ahead_s + self.lead_m
        })
    }

    /// Returns an error unless all vehicles have the same safety distance and ellipsoid.
    pub(crate) fn check_bodies(&self, starts: &[Start]) -> Result<(), ShieldError> {
        let Settings { delta_m, half_height_m, .. } = self.settings;
        let differs = starts.iter().position(|start| start.delta_m != delta_m || start.metric != self.metric());
        let Some(vehicle) = differs else { return Ok(()) };
        let (place, value) = if starts[vehicle].delta_m == delta_m {
            ("half_height_m", half_height_m.unwrap_or(delta_m / 2.0))
        } else {
            ("delta_m", delta_m)
        };
        let problem = format!("vehicle {} has another value", vehicle + 1);
        Err(ShieldError::new(ShieldFault::Mismatch, place, problem, value, "give all vehicles the same"))
    }

    /// Gap that two vehicles keep by choice \[m\].
    #[must_use]
    pub fn ease_m(&self) -> f64 {
        match self.choice {
            Choice::GiveWay { ease_m, .. } => ease_m,
            Choice::Scale => 0.0,
        }
    }

    /// Returns the certificate of a fleet with these limits in words, with its assumptions. With `tracking_error_m` the
    /// tube is an assumption itself, and the words do not call the separation certified.
    #[must_use]
    pub fn certificate(&self) -> String {
        let settings = &self.settings;
        let delay = match settings.measurement_delay_periods {
            0 => String::new(),
            1 => "; measurements are a period old".to_owned(),
            periods => format!("; measurements are {periods} periods old"),
        };
        let [shortest_s, longest_s] = self.times_s();
        let held = if shortest_s < longest_s {
            // Rounding of the last digits is left out.
            let [from_s, to_s] = [shortest_s, longest_s].map(|time_s| shortest((time_s * 1e9).round() / 1e9));
            format!("; commands are held over {from_s} to {to_s} s")
        } else {
            String::new()
        };
        let elapsed = if settings.elapsed_error_s > 0.0 {
            format!("; this time is known within {} s", settings.elapsed_error_s)
        } else {
            String::new()
        };
        let age = if settings.measurement_age_s > 0.0 {
            format!("; measurements are at most {} s old, with known ages", settings.measurement_age_s)
        } else {
            String::new()
        };
        let lag = if settings.actuator_lag_s > 0.0 {
            format!("; actuators lag by {} s", settings.actuator_lag_s)
        } else {
            String::new()
        };
        let (certified, tracking, tube) = match settings.tracking_error_m {
            Some(error_m) => ("", format!("vehicles stay within {error_m} m of their references; "), "assumed tube"),
            None => ("certified ", String::new(), "tube"),
        };
        let height = settings.half_height_m.map_or_else(String::new, |half| {
            let vertical = at_least(2.0 * half, 3);
            format!(" on a level and {vertical} m in the vertical, outside the ellipsoid of these half axes")
        });
        format!(
            "{certified}never closer than {} m{height} under any law and any loss of messages. Assumed: {tracking}\
             commands up to {} m/s^2 are carried out; position errors stay below {} m and velocity errors below {} \
             m/s; pushes stay below {} m/s^2{delay}{held}{elapsed}{age}{lag} ({tube} {} m)",
            exact(settings.delta_m),
            settings.accel_m_s2,
            settings.position_error_m,
            settings.velocity_error_m_s,
            settings.disturbance_m_s2,
            at_most(self.tube.error_m, 3)
        )
    }

    /// Returns the start of a vehicle, which all vehicles must know. The true state may differ by the errors of
    /// measurement.
    ///
    /// # Errors
    /// If a number is not finite, the segment reaches beyond [`Limits::farthest_m`], or the speed is above the largest
    /// one.
    pub fn start(&self, state: State) -> Result<Start, ShieldError> {
        let segment = Segment::new(state.position_m, self.envelope.brake.stop_m(&state));
        let start = self.announced(state, segment);
        start.check()?;
        start.check_segment(self.farthest_m)?;
        let speed = state.velocity_m_s.norm();
        if speed > self.settings.max_speed_m_s {
            let problem = format!("starts faster than `max_speed_m_s` = {}", self.settings.max_speed_m_s);
            return Err(ShieldError::new(
                ShieldFault::TooFast,
                "start",
                problem,
                speed,
                "raise `max_speed_m_s` or start slower",
            ));
        }
        Ok(start)
    }

    /// Returns a slot: a start at rest, for [`closest_starts`](crate::fleet::closest_starts).
    #[must_use]
    pub fn slot(&self, position_m: Vector3<f64>) -> Start {
        let segment = Segment::new(position_m, position_m);
        self.announced(State::at_rest(position_m), segment)
    }

    fn announced(&self, state: State, segment: Segment) -> Start {
        let Side { margin_m, metric } = self.side;
        let reach_m = self.envelope.largest_reach_m(self.choice) + self.lead_m;
        Start { state, segment, margin_m, flight: 0, delta_m: self.settings.delta_m, metric, reach_m }
    }
}

/// Settings or starts that cannot be certified: `PLACE: PROBLEM (VALUE); REMEDY`.
#[derive(Clone, Debug, PartialEq)]
pub struct ShieldError {
    /// Kind of the problem.
    pub fault: ShieldFault,
    /// Name of the setting, or `start`.
    pub place: &'static str,
    /// What is wrong.
    pub problem: String,
    /// The value.
    pub value: f64,
    /// What helps.
    pub remedy: &'static str,
}

/// Kind of a [`ShieldError`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ShieldFault {
    /// A number is not finite or out of its range.
    OutOfRange,
    /// The tracker does not hold a vehicle near its reference.
    Tracker,
    /// Feedback and drag leave no acceleration to the reference or its brake.
    NoReserve,
    /// A vehicle starts faster than its largest speed.
    TooFast,
    /// A start is too near to another one or to an obstacle.
    TooNear,
    /// Vehicles differ in settings that must agree, or in their number.
    Mismatch,
    /// Saved or sent data were altered.
    Altered,
}

impl ShieldError {
    pub(crate) fn new(
        fault: ShieldFault,
        place: &'static str,
        problem: String,
        value: f64,
        remedy: &'static str,
    ) -> Self {
        Self { fault, place, problem, value, remedy }
    }
}

impl fmt::Display for ShieldError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Rounding of the last digits is left out.
        let value = if (1e-6..1e6).contains(&self.value.abs()) { (self.value * 1e9).round() / 1e9 } else { self.value };
        write!(out, "{}: {} ({}); {}", self.place, self.problem, shortest(value), self.remedy)
    }
}

impl std::error::Error for ShieldError {}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(change: impl Fn(&mut Settings)) -> String {
        let mut settings = Settings::new(1.0, 0.05);
        change(&mut settings);
        settings.limits().expect_err("refused").to_string()
    }

    #[test]
    fn limits_of_the_page() {
        let settings = Settings {
            position_error_m: 0.03,
            velocity_error_m_s: 0.05,
            disturbance_m_s2: 0.3,
            a22_per_s: -0.1,
            ..Settings::new(1.0, 0.05)
        };
        let limits = settings.limits().expect("certified");
        assert!((limits.reference_m_s2() - (5.0 - limits.tube().feedback_m_s2 - 0.2)).abs() < 1e-12);
        assert_eq!(limits.brake().deceleration_m_s2(), 3.0);
        assert!((limits.margin_m() - 0.5 - 5e-7 - limits.tube().error_m).abs() < 1e-12);
        assert_eq!(limits.ease_m(), 0.2);
        assert_eq!(
            limits.certificate(),
            "certified never closer than 1.000 m under any law and any loss of messages. Assumed: commands up to 5 \
             m/s^2 are carried out; position errors stay below 0.03 m and velocity errors below 0.05 m/s; pushes stay \
             below 0.3 m/s^2 (tube 0.159 m)"
        );
        let late = Settings { measurement_delay_periods: 2, actuator_lag_s: 0.05, ..settings };
        let late = late.limits().expect("certified").certificate();
        assert!(late.contains("0.3 m/s^2; measurements are 2 periods old; actuators lag by 0.05 s (tube"), "{late}");
        // The assumed tube takes the place of the computed one; the feedback is still that of the loop.
        let assumed = Settings { tracking_error_m: Some(0.25), path_error_m: 0.125, ..settings }.limits().expect("ok");
        assert_eq!(assumed.tube(), Tube { error_m: 0.375, ..limits.tube() });
        let words = assumed.certificate();
        assert!(words.starts_with("never closer than 1.000 m under any law"), "{words}");
        assert!(
            words.contains("Assumed: vehicles stay within 0.25 m of their references; commands up to 5"),
            "{words}"
        );
    }

    #[test]
    fn settings_beyond_the_rounding_budget_are_refused() {
        let limits = |change: fn(&mut Settings)| {
            let mut settings = Settings::new(1.0, 0.05);
            change(&mut settings);
            settings.limits()
        };
        assert_eq!(limits(|_| ()).expect("defaults").farthest_m(), 1e6);
        // A brake of 2,000 periods over 15 km.
        let fast = |settings: &mut Settings| settings.max_speed_m_s = 300.0;
        let fast = limits(fast).expect("fast").farthest_m();
        assert!((40_000.0..45_000.0).contains(&fast), "{fast}");
        let refused = |change| limits(change).expect_err("refused").to_string();
        let slow = refused(|settings| (settings.max_speed_m_s, settings.period_s) = (300.0, 0.001));
        assert!(slow.starts_with("max_speed_m_s: a brake over 15000") && slow.contains("in 100000 periods"), "{slow}");
        assert!(slow.ends_with("(300); lower the speed, brake harder, or lengthen the period"), "{slow}");
        let weak = refused(|settings| settings.brake_m_s2 = Some(1e-300));
        assert!(weak.starts_with("brake_m_s2: a brake over"), "{weak}");
        assert!(refused(|settings| settings.delta_m = 1e7).starts_with("delta_m: margins must be at most 1000000 m"));
        assert!(refused(|settings| settings.accel_m_s2 = 1e5).starts_with("accel_m_s2: must be at most 10000 m times"));
        // Starts and their stop points are within it.
        let limits = Settings { max_speed_m_s: 300.0, ..Settings::new(1.0, 0.05) }.limits().expect("fast");
        let state_at = |x: f64, speed: f64| State { position_m: Vector3::x() * x, velocity_m_s: Vector3::x() * speed };
        assert!(limits.start(state_at(25_000.0, 300.0)).is_ok() && limits.start(state_at(fast, 0.0)).is_ok());
        for start in [state_at(fast + 1.0, 0.0), state_at(fast - 10_000.0, 300.0)] {
            let error = limits.start(start).expect_err("far").to_string();
            assert!(error.contains("farther than 4") && error.ends_with("near the vehicles"), "{error}");
        }
    }

    #[test]
    fn errors_name_place_value_and_remedy() {
        assert_eq!(
            refused(|settings| settings.brake_m_s2 = Some(6.0)),
            "brake_m_s2: must be at most 5.0000, which is what feedback and drag leave of `accel_m_s2` (6); \
             lower it or leave it out"
        );
        assert_eq!(
            refused(|settings| settings.tracker_per_s = 50.0),
            "tracker_per_s: the tracker is unstable with `tracker_per_s2` 4, `tracker_per_s` 50, period 0.05 s, \
             measurements 0 periods old, `a22_per_s` 0, lag 0 s (50); lower both gains or shorten the period"
        );
        // The error names the setting that keeps the loop from settling.
        assert!(refused(|settings| settings.actuator_lag_s = 100.0).starts_with("actuator_lag_s: the tracker "));
        assert!(refused(|settings| settings.a22_per_s = 5.0).starts_with("a22_per_s: the tracker "));
        assert_eq!(
            refused(|settings| settings.actuator_lag_s = 1e-300),
            "actuator_lag_s: must be 0 or at least 0.001172 s for a period of 0.05 s (1e-300); \
             round it up to this lag, or down to 0"
        );
        assert_eq!(
            refused(|settings| settings.period_s = 1000.0),
            "period_s: a period of 1000 s is longer than 128 s (1000); shorten the period"
        );
        assert!(refused(|settings| settings.a22_per_s = -5000.0).contains("magnitude must be at most 2559.000 for a"));
        assert!(refused(|settings| settings.tracking_error_m = Some(1e7)).starts_with("tracking_error_m: margins"));
        assert!(
            refused(|settings| settings.disturbance_m_s2 = 9.0).starts_with("accel_m_s2: feedback takes up to 11.")
        );
        assert_eq!(
            refused(|settings| settings.a22_per_s = -3.0),
            "a22_per_s: drag takes 6.0000 of `accel_m_s2` 5 at `max_speed_m_s` 2 (-3); lower its magnitude or the \
             speed"
        );
        assert!(refused(|settings| settings.period_s = 0.0).starts_with("period_s: must be above 0 (0)"));
        assert!(refused(|settings| settings.delta_m = f64::NAN).starts_with("delta_m: must be above 0 (NaN)"));
        assert!(refused(|settings| settings.ease_m = Some(-0.1)).starts_with("ease_m: must not be negative (-0.1)"));
        assert!(refused(|settings| settings.turn = 2.0).starts_with("turn: must be from -1 to 1 (2)"));
        assert!(refused(|settings| settings.measurement_delay_periods = 99).contains("at most 20 periods (99)"));
        assert!(refused(|settings| settings.measurement_delay_periods = 12).starts_with("tracker_per_s: "));
        assert!(refused(|settings| settings.actuator_lag_s = 1e-5).starts_with("actuator_lag_s: "));
        assert!(refused(|settings| settings.a22_per_s = f64::INFINITY).starts_with("a22_per_s: "));
        let limits = Settings::new(1.0, 0.05).limits().expect("defaults");
        let fast = State { position_m: Vector3::zeros(), velocity_m_s: Vector3::x() * 3.0 };
        assert_eq!(
            limits.start(fast).expect_err("fast").to_string(),
            "start: starts faster than `max_speed_m_s` = 2 (3); raise `max_speed_m_s` or start slower"
        );
        assert!(limits.start(State::at_rest(Vector3::x() * f64::NAN)).is_err());
        let far = limits.start(State::at_rest(Vector3::x() * -2e6)).expect_err("far").to_string();
        assert!(
            far.starts_with("start: reserves space farther than 1000000 m from the origin along an axis (2000000)")
        );
        assert!(far.ends_with("use a local frame with its origin near the vehicles"), "{far}");
    }

    #[test]
    fn irregular_instants_and_old_measurements_change_the_limits() {
        let base = Settings {
            position_error_m: 0.03,
            velocity_error_m_s: 0.05,
            disturbance_m_s2: 0.3,
            ..Settings::new(1.0, 0.05)
        };
        let tube = |settings: Settings| settings.limits().expect("certified").tube();
        let regular = tube(base);
        let jitter = tube(Settings { period_tolerance: 0.1, ..base });
        assert!((0.155..0.1552).contains(&jitter.error_m), "{jitter:?}");
        let hangs = Settings { period_tolerance: 0.1, hang_periods: 3, ..base }.limits().expect("certified");
        assert!((0.155..0.156).contains(&hangs.tube().error_m), "{hangs:?}");
        assert!((1.18..1.21).contains(&hangs.tube().feedback_m_s2), "{hangs:?}");
        assert!((hangs.times_s()[0] - 0.045).abs() < 1e-15 && (hangs.times_s()[1] - 0.22).abs() < 1e-15);
        assert!(
            hangs.certificate().contains("0.3 m/s^2; commands are held over 0.045 to 0.22 s (tube"),
            "{}",
            hangs.certificate()
        );
        // A known age is a larger error of measurement.
        let old = Settings { measurement_age_s: 0.1, ..base };
        let errors = [0.03 + 0.05 * 0.1 + 0.3 * 0.005, 0.05 + 0.3 * 0.1];
        assert!(old.predicted_errors().into_iter().zip(errors).all(|(found, error)| (found - error).abs() < 1e-12));
        let wider = Settings { position_error_m: errors[0], velocity_error_m_s: errors[1], ..base };
        assert!((tube(old).error_m - tube(wider).error_m).abs() < 1e-9);
        assert!(old.limits().expect("certified").certificate().contains("at most 0.1 s old, with known ages"));
        // With a22 > 0 an error grows until the instant. At most three instants, 0.04 s apart, are within 0.1 s.
        let growing = Settings { a22_per_s: 0.5, period_tolerance: 0.2, elapsed_error_s: 0.01, ..old };
        let growth = 0.05_f64.exp();
        let switched = 5.0 * 0.01 * 3.0 * 4.0;
        let errors =
            [0.03 + growth * (0.05 * 0.1 + 0.3 * 0.005 + switched * 0.1), growth * (0.05 + 0.3 * 0.1 + switched)];
        assert!(growing.predicted_errors().into_iter().zip(errors).all(|(found, error)| (found - error).abs() < 1e-9));
        // An unknown period costs what the reference may jump.
        let unknown = tube(Settings { period_tolerance: 0.1, elapsed_error_s: 0.005, ..base });
        assert!(unknown.error_m > regular.error_m + 0.1, "{unknown:?}");
    }

    #[test]
    fn errors_of_irregular_instants_name_their_setting() {
        assert_eq!(
            refused(|settings| settings.hang_periods = 20),
            "hang_periods: the tracker does not settle with `tracker_per_s2` 4, `tracker_per_s` 4, 0.05 s to 1.05 s \
             between instants (20); lower it, the gains or the period"
        );
        let little = |settings: &mut Settings| {
            (settings.hang_periods, settings.position_error_m, settings.accel_m_s2) = (7, 0.2, 3.0);
        };
        let reserve = refused(little);
        assert!(reserve.starts_with("hang_periods: feedback then takes up to "), "{reserve}");
        assert!(reserve.contains("of `accel_m_s2` 3; nothing is left (7); lower it"), "{reserve}");
        let old = refused(|settings| {
            (settings.measurement_age_s, settings.disturbance_m_s2, settings.accel_m_s2) = (0.9, 1.0, 2.5);
        });
        assert!(old.starts_with("measurement_age_s: feedback then takes up to "), "{old}");
        assert!(
            refused(|settings| settings.period_tolerance = 0.6).starts_with("period_tolerance: must be at most 0.5")
        );
        assert!(refused(|settings| settings.period_tolerance = f64::NAN).starts_with("period_tolerance: must not be"));
        assert!(refused(|settings| settings.hang_periods = 21).starts_with("hang_periods: must be at most 20 periods"));
        assert!(refused(|settings| settings.measurement_age_s = 2.0).contains("at most 20 periods (2)"));
        assert!(
            refused(|settings| settings.elapsed_error_s = 0.01).contains("has an effect only with `period_tolerance`")
        );
        let irregular = |change: fn(&mut Settings)| {
            refused(|settings| {
                settings.period_tolerance = 0.1;
                change(settings);
            })
        };
        assert!(irregular(|settings| settings.actuator_lag_s = 0.05).starts_with("actuator_lag_s: must be 0 with"));
        assert!(irregular(|settings| settings.measurement_delay_periods = 1).contains("as `measurement_age_s`"));
        assert!(irregular(|settings| settings.elapsed_error_s = 0.1).contains("the shortest time"));
        assert!(irregular(|settings| settings.elapsed_error_s = 0.04).starts_with("elapsed_error_s: feedback then"));
        assert!(irregular(|settings| settings.a22_per_s = -30.0).starts_with("a22_per_s: "));
        let lag = |settings: &mut Settings| (settings.measurement_age_s, settings.actuator_lag_s) = (0.1, 0.05);
        assert!(refused(lag).starts_with("measurement_age_s: must be 0 with an actuator lag"));
        assert!(refused(|settings| (settings.measurement_age_s, settings.a22_per_s) = (0.1, -30.0)).starts_with("a22"));
        // Numbers that no flight has leave an error or limits, and no panic.
        let sizes = [1e-300, 1e-9, 1.0, 1e9, 1e300];
        for [gain, rate, size] in [[4, 0, 1], [0, 4, 4], [4, 4, 4], [2, 3, 2]] {
            let settings = Settings {
                tracker_per_s2: sizes[gain],
                tracker_per_s: sizes[rate],
                disturbance_m_s2: sizes[size],
                period_tolerance: 0.3,
                hang_periods: 2,
                measurement_age_s: 0.1,
                ..Settings::new(1.0, 0.05)
            };
            let found = settings.limits().map(|limits| limits.tube().error_m.is_finite());
            assert_ne!(found, Ok(false), "{settings:?}");
        }
    }
}
