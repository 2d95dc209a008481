//! `[shield]`: a stage between law and actuators that certifies separations under any law ([`tautline_shield`]).
//!
//! [`ShieldSpec`] holds the keys of the table. [`Scenario::shield_limits`] derives the settings of the shield from the
//! whole scenario: its period from `time.control_hz`, its delay from `[sensing]`, its lag from `[actuation]`. In flight
//! `ShieldStage` filters the commands of the law. Contracts travel over the radio of `[network]`, between any pair that
//! is near its plane.
//!
//! # What the plant adds to the bounds
//! The proof is about motion in continuous time. Rapier moves a vehicle along the chord of each step dt, and integrates
//! drag and lag by a rule of second order. With the reference at most V fast and commands up to A, both are covered by
//!
//! ```text
//! path error   (A + W + |a22| V) dt^2/8 + (|a22| dt)^2 (V + A dt) (1 + kd)/(12 kp) + A dt^2/6 with a lag
//! push         ((|a22| dt)^2 (|a22| V + A) + A (dt/lag)^2)/6
//! ```
//!
//! The ideal plant moves on curves, which bend from the chord of a step by at most 1e-5 delta; that is its path error.
//!
//! The flight measures the distance to the reference at each step and reports it as a share of the tube.

mod identify;
mod search;
mod stage;
mod tracking;

pub use identify::{Identification, TRACKING_FACTOR};
pub(crate) use stage::ShieldStage;
pub use stage::{ShieldBreach, ShieldReport};
pub use tautline_shield::ContractLog;
pub(crate) use tracking::TrackingBasis;

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::scenario::{ErrorKind, MAX_MEMORY_BYTES, Scenario, ScenarioError, Space, entry_key, is_default};
use crate::sim::MAX_BEND;
use tautline_core::obstacle;
use tautline_core::swarm::row;
use tautline_core::text::shortest;
use tautline_laws::law::{Certificate, VoidReason};
use tautline_laws::space::signed_distance_m;
use tautline_shield::fleet::{PairRoom, closest_starts};
use tautline_shield::obstacle::ConvexBody;
use tautline_shield::{Fleet, Limits, Obstacle, Settings, ShieldError, Start, State};

/// Default rate of held commands under a shield \[Hz\].
const SHIELD_CONTROL_HZ: f64 = 20.0;
/// Number of steps in a period of 20 Hz beyond which no other rate is chosen.
const MOST_STEPS: f64 = 1e4;
/// Share of the longest stable period of the law that the default rate uses at most.
const PERIOD_SHARE: f64 = 0.5;
/// Default of the largest command and of the largest speed, without limits in other tables.
const ACCEL_M_S2: f64 = 5.0;
const SPEED_M_S: f64 = 2.0;
/// Default gains of the tracker, in 1/s^2 and 1/s.
const TRACKER: f64 = 4.0;
/// Relative difference of two rates or times that counts as rounding.
const SAME: f64 = 1e-9;
/// Expected memory of a contract with the last message of the other vehicle \[bytes\].
const BYTES_PER_CONTRACT: u128 = 256;
/// Expected memory of a message under way \[bytes\].
const BYTES_PER_MESSAGE: u128 = 64;

/// Shield: changes commands of the law only where this is needed to certify that no two vehicles come closer than
/// `law.delta_m`. Commands are held over the periods of `time.control_hz`. Its default is 20 Hz, or a multiple that the
/// law needs to be stable near its slots, up to one command a step. Messages of the shield use the latency, loss and
/// rate of `[network]`, between vehicles near their common plane.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ShieldSpec {
    /// Whether the shield is used; the table alone means true.
    #[serde(skip_serializing_if = "is_true")]
    #[schemars(extend("default" = true))]
    pub enabled: bool,
    /// Largest command in m/s^2 that each vehicle carries out; `actuation.max_accel_m_s2` unless given, or 5 without.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub accel_m_s2: Option<f64>,
    /// Deceleration of the brake in m/s^2; 0.6 times `accel_m_s2` unless given, at most what feedback and drag leave.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub brake_m_s2: Option<f64>,
    /// Largest speed in m/s of the reference that a vehicle follows; that of the law unless given, or 2 without.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_speed_m_s: Option<f64>,
    /// Bound in m on the error of the measured own position.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub position_error_m: f64,
    /// Bound in m/s on the error of the measured own velocity.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = 0.0, "minimum" = 0))]
    pub velocity_error_m_s: f64,
    /// Bound in m/s^2 on the push of wind and model errors, at least `vehicle.drag_per_s` times the fastest wind; 0
    /// unless given, that of the model for quadrotors.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub disturbance_m_s2: Option<f64>,
    /// Gain in 1/s^2 of the tracker on the distance to the reference; 4 unless given, that of the model for quadrotors.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub tracker_per_s2: Option<f64>,
    /// Gain in 1/s of the tracker on the velocity relative to the reference; 4 unless given, that of the model for
    /// quadrotors.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub tracker_per_s: Option<f64>,
    /// Assumed bound in m on the distance to the reference, in place of the computed one. Quadrotors need it, unless
    /// their model has a measured one (`[tracking]`) for the conditions of the scenario.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub tracking_error_m: Option<f64>,
    /// Gap in m that vehicles keep by choice, so that they can pass each other; 0.2 times `law.delta_m` unless given.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0))]
    pub ease_m: Option<f64>,
    /// Share of the control period by which the time between two instants of a vehicle may differ from it, up to 0.5.
    /// The flight itself has exact periods.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = 0.0, "minimum" = 0, "maximum" = 0.5))]
    pub period_tolerance: f64,
    /// Number of instants in a row, up to 20, that the computer of a vehicle may miss. The vehicle holds its last
    /// command until the next instant.
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = 0, "minimum" = 0, "maximum" = 20))]
    pub hang_periods: usize,
    /// Share of the instants after which the computer of a vehicle misses 1 to `hang_periods` instants in the flight;
    /// the number is random (`noise.seed`).
    #[serde(skip_serializing_if = "is_default")]
    #[schemars(extend("default" = 0.0, "minimum" = 0, "maximum" = 1))]
    pub hang_share: f64,
    /// Share of the removed part of a command that is added again to the right, from -1 to 1; negative for the left.
    /// Before obstacles alone, a command clearly to the other side is turned there.
    #[schemars(extend("minimum" = -1, "maximum" = 1))]
    pub turn: f64,
}

impl Default for ShieldSpec {
    fn default() -> Self {
        Self {
            enabled: true,
            accel_m_s2: None,
            brake_m_s2: None,
            max_speed_m_s: None,
            position_error_m: 0.0,
            velocity_error_m_s: 0.0,
            disturbance_m_s2: None,
            tracker_per_s2: None,
            tracker_per_s: None,
            tracking_error_m: None,
            ease_m: None,
            period_tolerance: 0.0,
            hang_periods: 0,
            hang_share: 0.0,
            turn: 1.0,
        }
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde passes a reference")]
fn is_true(value: &bool) -> bool {
    *value
}

impl Scenario {
    /// Returns the limits of the reference of each vehicle; `None` without a shield.
    ///
    /// # Errors
    /// [`ScenarioError`] if the scenario does not fit the shield's assumptions, or nothing is left for the reference.
    pub fn shield_limits(&self) -> Result<Option<Limits>, ScenarioError> {
        let Some(spec) = &self.shield_keys() else { return Ok(None) };
        let Some(control_hz) = self.time.control_hz else {
            let problem = "the shield holds commands over periods, but no rate of commands is given";
            let help = format!("set time.control_hz, such as {SHIELD_CONTROL_HZ}");
            return Err(ErrorKind::MissingKey.at(&["shield"], problem, help));
        };
        let most_m_s2 = self.actuation.max_accel_m_s2;
        let settings = self.shield_settings(spec, control_hz)?;
        let accel_m_s2 = settings.accel_m_s2;
        if most_m_s2.is_some_and(|most_m_s2| accel_m_s2 > most_m_s2) {
            let help = format!("reduce it to at most {}", most_m_s2.unwrap_or_default());
            let problem = "shield.accel_m_s2 is more than actuation.max_accel_m_s2 carries out";
            return Err(refused(&["shield.accel_m_s2", "actuation.max_accel_m_s2"], problem, accel_m_s2, &help));
        }
        settings.limits().map(Some).map_err(|error| self.of_shield(&error))
    }

    /// Sets the rate of held commands: 20 Hz, or the smallest multiple that the law needs near its slots.
    ///
    /// The period is at most half of the longest one at which the linearised law is stable, and a whole number of
    /// steps: at least one, whatever the law needs. With `sensing.rate_hz` the rate is 20 Hz.
    pub(crate) fn choose_shield_rate(&mut self) {
        self.time.control_hz = Some(SHIELD_CONTROL_HZ);
        let steps = 1.0 / (SHIELD_CONTROL_HZ * self.time.dt_s);
        let is_free = self.airframe.is_point() && self.sensing.rate_hz.is_none() && is_whole(steps);
        let Some(law) = self.law().ok().filter(|_| is_free && steps < MOST_STEPS) else { return };
        let Some(linear) = law.linear(self.formation()) else { return };
        let longest_s = PERIOD_SHARE * linear.sampling_margin_s(self.velocity_coefficient_per_s());
        if longest_s <= 0.0 {
            // No period is known to be short enough.
            return;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 1, below MOST_STEPS")]
        let steps = steps.round() as u32;
        let is_stable = |parts: &u32| 1.0 <= longest_s * SHIELD_CONTROL_HZ * f64::from(*parts);
        let parts = (1..=steps).filter(|parts| steps.is_multiple_of(*parts)).find(is_stable);
        self.time.control_hz = Some(SHIELD_CONTROL_HZ * f64::from(parts.unwrap_or(steps)));
    }

    /// Returns the settings of a table of the shield at a rate of commands \[Hz\].
    fn shield_settings(&self, spec: &ShieldSpec, control_hz: f64) -> Result<Settings, ScenarioError> {
        let dt_s = self.time.dt_s;
        let accel_m_s2 = spec.accel_m_s2.or(self.actuation.max_accel_m_s2).unwrap_or(ACCEL_M_S2);
        let max_speed_m_s = spec.max_speed_m_s.or(self.law_speed_m_s()).unwrap_or(SPEED_M_S);
        // The command compensates the drag of a quadrotor, too.
        let drag_per_s = self.airframe.quadrotor().map_or(0.0, |quadrotor| quadrotor.model.hover_drag_per_s());
        let a22_per_s = self.velocity_coefficient_per_s() - drag_per_s;
        let [tracker_per_s2, tracker_per_s] =
            [spec.tracker_per_s2, spec.tracker_per_s].map(|gain| gain.unwrap_or(TRACKER));
        let is_irregular = spec.period_tolerance > 0.0 || spec.hang_periods > 0;
        let (measurement_delay_periods, measurement_age_s) = self.measurement_age(control_hz, is_irregular)?;
        let mut settings = Settings {
            accel_m_s2,
            brake_m_s2: spec.brake_m_s2,
            max_speed_m_s,
            position_error_m: spec.position_error_m,
            velocity_error_m_s: spec.velocity_error_m_s,
            disturbance_m_s2: spec.disturbance_m_s2.unwrap_or(0.0),
            a22_per_s,
            tracker_per_s2,
            tracker_per_s,
            measurement_delay_periods,
            measurement_age_s,
            period_tolerance: spec.period_tolerance,
            hang_periods: spec.hang_periods,
            actuator_lag_s: self.actuation.lag_s,
            tracking_error_m: spec.tracking_error_m,
            ease_m: spec.ease_m,
            turn: spec.turn,
            is_level: self.space == Space::Plane,
            half_height_m: self.half_axes_m().map(|[.., half_height_m]| half_height_m),
            ..Settings::new(self.delta_m, 1.0 / control_hz)
        };
        // The audit replaces the path within a step by its chord, with an error of at most this bend.
        settings.path_error_m = MAX_BEND * self.delta_m;
        if self.has_engine() {
            let decay = (a22_per_s * dt_s).powi(2);
            let lag = if self.actuation.lag_s > 0.0 { accel_m_s2 * (dt_s / self.actuation.lag_s).powi(2) } else { 0.0 };
            let push_m_s2 = (decay * (a22_per_s.abs() * max_speed_m_s + accel_m_s2) + lag) / 6.0;
            // A lag so short that the push is infinite is refused below.
            settings.integration_error_m_s2 = push_m_s2.min(f64::MAX);
            let gains = (1.0 + tracker_per_s) / (12.0 * tracker_per_s2);
            let largest_m_s2 = accel_m_s2 + settings.disturbance_m_s2 + a22_per_s.abs() * max_speed_m_s;
            settings.path_error_m =
                largest_m_s2 * dt_s * dt_s / 8.0 + decay * (max_speed_m_s + accel_m_s2 * dt_s) * gains;
            if self.actuation.lag_s > 0.0 {
                settings.path_error_m += accel_m_s2 * dt_s * dt_s / 6.0;
            }
        }
        Ok(settings)
    }

    /// Returns the age of a measurement of the own state at an instant of command: in periods, or in s if it is no
    /// whole number of regular periods.
    fn measurement_age(&self, control_hz: f64, is_irregular: bool) -> Result<(usize, f64), ScenarioError> {
        let (rate_hz, latency_s) = (self.sensing.rate_hz, self.sensing.latency_s);
        let per_period = rate_hz.map_or(1.0, |rate_hz| rate_hz / control_hz);
        let age_s = rate_hz.map_or(latency_s, |rate_hz| (latency_s * rate_hz - SAME).ceil().max(0.0) / rate_hz);
        let periods = age_s * control_hz;
        if !is_whole(per_period) || per_period < 0.5 {
            let help = format!("set sensing.rate_hz to {control_hz} or a multiple of it");
            let problem = "the number of measurements per control period must be whole";
            return Err(refused(&["sensing.rate_hz", "time.control_hz"], problem, per_period, &help));
        }
        if is_whole(periods) && !is_irregular {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 0; more saturates")]
            return Ok((periods.round() as usize, 0.0));
        }
        // The shield predicts the motion of a point without a lag.
        if self.airframe.is_point() && self.actuation.lag_s == 0.0 || is_irregular {
            return Ok((0, age_s));
        }
        let help = format!("set sensing.rate_hz to {control_hz}, or a latency of whole periods");
        let problem = "the age of measurements must be a whole number of control periods";
        Err(refused(&["sensing.rate_hz", "sensing.latency_s", "time.control_hz"], problem, periods, &help))
    }

    /// Returns the starts of all vehicles under a shield.
    pub(crate) fn shield_starts(&self, limits: &Limits) -> Result<Vec<Start>, ScenarioError> {
        let start = |i: usize| {
            let state =
                State { position_m: row(&self.start.positions_m, i), velocity_m_s: row(&self.start.velocities_m_s, i) };
            limits.start(state).map_err(|error| self.of_shield(&error).at(&[&entry_key("start.positions_m", i)]))
        };
        (0..self.count()).map(start).collect()
    }

    /// Returns the shields of all vehicles at these starts, with planes before the obstacles.
    pub(crate) fn shield_fleet(&self, limits: &Limits, states: &[State]) -> Result<Fleet, ScenarioError> {
        let keep_out = |obstacle: &obstacle::Obstacle| Obstacle::new(Solid(obstacle.clone()), obstacle.clearance_m);
        let obstacles: Vec<_> = self.obstacles.iter().map(keep_out).collect();
        let fleet = Fleet::new(&vec![*limits; self.count()], states);
        let fleet = fleet.and_then(|fleet| fleet.with_obstacles(&obstacles));
        fleet.map_err(|error| self.of_shield(&error).at(&["start.positions_m"]))
    }

    /// Returns the pair of starts with the least room, and the pair of slots of any leg; `None` without a shield.
    #[must_use]
    pub fn shield_rooms(&self) -> Option<(PairRoom, PairRoom)> {
        let limits = self.shield_limits().ok()??;
        let starts = closest_starts(&self.shield_starts(&limits).ok()?)?;
        let slots = self.legs.iter().filter_map(|leg| {
            let slots_m = &leg.formation.slots_m;
            let slots: Vec<_> = (0..slots_m.nrows()).map(|i| limits.slot(row(slots_m, i))).collect();
            closest_starts(&slots)
        });
        Some((starts, slots.min_by(|a, b| a.room_m().total_cmp(&b.room_m()))?))
    }

    /// Returns the certificate of the shield, which holds under any law; `None` without a shield.
    pub(crate) fn shield_certificate(&self) -> Option<Certificate> {
        self.shield.as_ref()?;
        let fails = self.failures.iter().any(|failure| !failure.is_silent());
        let certified_clearance_margin_m = (!self.obstacles.is_empty()).then_some(0.0);
        let certified_m = Some(self.delta_m);
        let certificate = Certificate { certified_m, certified_clearance_margin_m, ..Certificate::default() };
        Some(certificate.void_where(fails, VoidReason::VehicleFails))
    }

    /// Checks that the scenario fits the shield.
    pub(crate) fn check_shield(&self) -> Result<(), ScenarioError> {
        let Some(spec) = &self.shield_keys() else { return Ok(()) };
        if self.airframe.unicycle().is_some() {
            let (problem, help) = ("the shield has no contract for unicycles", "use points or quadrotors");
            return Err(ErrorKind::Shield.at(&["vehicle.model", "shield"], problem, help));
        }
        if let Some(control_hz) = self.time.control_hz {
            let steps = 1.0 / (control_hz * self.time.dt_s);
            if !is_whole(steps) {
                let help = "change time.control_hz or time.dt_s";
                let problem = "a control period must be a whole number of steps";
                return Err(refused(&["time.control_hz", "time.dt_s"], problem, steps, help));
            }
        }
        if spec.hang_share > 0.0 && spec.hang_periods == 0 {
            let problem = "shield.hang_share needs shield.hang_periods above 0";
            let help = "set shield.hang_periods to the largest number of missed instants";
            return Err(refused(&["shield.hang_share", "shield.hang_periods"], problem, spec.hang_share, help));
        }
        self.check_tracking(spec)?;
        let (noise_m, bias_m) = (self.sensing.position_noise_m, self.sensing.position_bias_m);
        let noises = [
            ("shield.position_error_m", "sensing.position_noise_m", noise_m, spec.position_error_m),
            ("shield.position_error_m", "sensing.position_bias_m", bias_m, spec.position_error_m),
            (
                "shield.velocity_error_m_s",
                "sensing.velocity_noise_m_s",
                self.sensing.velocity_noise_m_s,
                spec.velocity_error_m_s,
            ),
        ];
        for (key, what, noise, bound) in noises {
            if noise > 0.0 && noise >= bound {
                let problem = format!("{key} must be more than {what}, the standard deviation of an unbounded error");
                let help = format!("raise it to {}, six deviations", 6.0 * noise);
                return Err(refused(&[key, what], &problem, bound, &help));
            }
        }
        let push_m_s2 = self.drag_per_s * self.fastest_wind_m_s();
        let disturbance_m_s2 = spec.disturbance_m_s2.unwrap_or(0.0);
        if push_m_s2 > disturbance_m_s2 * (1.0 + SAME) && self.airframe.is_point() {
            let least = shortest(push_m_s2);
            let problem =
                format!("shield.disturbance_m_s2 must be at least {least}, which is drag times the fastest wind");
            let keys = ["shield.disturbance_m_s2", "vehicle.drag_per_s"];
            return Err(refused(&keys, &problem, disturbance_m_s2, "raise it, or reduce the wind"));
        }
        self.check_shield_memory()?;
        let Some(limits) = self.shield_limits()? else { return Ok(()) };
        let starts = self.shield_starts(&limits)?;
        if let Some(worst) = closest_starts(&starts).filter(|worst| worst.room_m() < 0.0) {
            let (i, j) = worst.pair;
            let keys = [i, j].map(|i| entry_key("start.positions_m", i));
            return Err(self.of_shield(&worst.too_near()).at(&[&keys[0], &keys[1]]));
        }
        let states: Vec<_> = starts.iter().map(|start| start.state).collect();
        self.shield_fleet(&limits, &states).map(drop)
    }

    /// Returns an error of the shield at the key of the scenario.
    fn of_shield(&self, error: &ShieldError) -> ScenarioError {
        let key = match error.place {
            "delta_m" => "law.delta_m",
            "period_s" => "time.control_hz",
            // Drag of the rotors at the largest speed.
            "a22_per_s" if self.airframe.quadrotor().is_some() => "shield.max_speed_m_s",
            "a22_per_s" => "swarm.a22_per_s",
            "actuator_lag_s" => "actuation.lag_s",
            "measurement_delay_periods" | "measurement_age_s" => "sensing.latency_s",
            "period_tolerance" => "shield.period_tolerance",
            "hang_periods" => "shield.hang_periods",
            "accel_m_s2" => "shield.accel_m_s2",
            "brake_m_s2" => "shield.brake_m_s2",
            "max_speed_m_s" => "shield.max_speed_m_s",
            "tracker_per_s" => "shield.tracker_per_s",
            "tracker_per_s2" => "shield.tracker_per_s2",
            "disturbance_m_s2" => "shield.disturbance_m_s2",
            "position_error_m" => "shield.position_error_m",
            "velocity_error_m_s" => "shield.velocity_error_m_s",
            "tracking_error_m" => "shield.tracking_error_m",
            "ease_m" => "shield.ease_m",
            "turn" => "shield.turn",
            "half_height_m" => "safety.half_axes_m",
            "path_error_m" | "integration_error_m_s2" => "time.dt_s",
            _ => "shield",
        };
        let keys = if error.place == "start" { &[][..] } else { &[key] };
        refused(keys, &error.problem, error.value, error.remedy)
    }

    fn check_shield_memory(&self) -> Result<(), ScenarioError> {
        let pairs = self.count() as u128 * self.count().saturating_sub(1) as u128;
        let rate_hz = self.time.control_hz.unwrap_or_default();
        let longest_s = (self.network.latency_s + self.network.jitter_s) * f64::from(self.network.hops());
        let under_way = (longest_s * rate_hz).ceil() + 1.0;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "more than 1; too many saturate")]
        let bytes = pairs.saturating_mul(BYTES_PER_CONTRACT + BYTES_PER_MESSAGE * under_way as u128);
        if bytes <= MAX_MEMORY_BYTES {
            return Ok(());
        }
        let gib = MAX_MEMORY_BYTES >> 30;
        let problem = format!(
            "contracts of {} vehicles need {} GiB of memory, more than the limit of {gib} GiB",
            self.count(),
            bytes >> 30
        );
        let help = "use fewer vehicles or a shorter network.latency_s";
        Err(ErrorKind::Memory.at(&["shield", "network.latency_s"], problem, help))
    }
}

/// Obstacle; all shapes are convex.
#[derive(Debug)]
struct Solid(obstacle::Obstacle);

impl ConvexBody for Solid {
    fn closest_point_m(&self, point_m: &Vector3<f64>) -> Option<Vector3<f64>> {
        let (distance_m, normal) = signed_distance_m(&self.0.shape, point_m - self.0.place_m);
        (distance_m > 0.0).then(|| point_m - normal * distance_m)
    }
}

fn is_whole(number: f64) -> bool {
    number.is_finite() && (number - number.round()).abs() <= SAME * number.abs().max(1.0)
}

/// Returns an error about a value: `PROBLEM (VALUE)`.
fn refused(keys: &[&str], problem: &str, value: f64, help: &str) -> ScenarioError {
    ErrorKind::Shield.at(keys, format!("{problem} ({})", shortest(value)), help)
}
