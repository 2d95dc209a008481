//! Bounds and limits of a watch, with their defaults and checks.

use crate::clock::STEP_S;
use tautline_core::fact::{Fact, FactKind, Source};
use tautline_core::option::{
    ACCEL, BRAKE, DELTA, EXPECT, HORIZON, IDS, LATENCY, MAX_AGE, MAX_VEHICLES, Opt, POSITION_ERROR, TUBE,
    VELOCITY_ERROR,
};
use tautline_core::track::PlanEnd;

/// Default bound on the acceleration \[m/s^2\].
///
/// A multirotor that keeps its height accelerates by g tan(tilt). Autopilots limit the tilt to 45 degrees or less by
/// default, which is g = 9.80665 m/s^2. A vehicle whose motors stop falls with g, too.
pub const DEFAULT_ACCEL_M_S2: f64 = 9.81;
/// Multiple of the reported standard deviation that bounds the error of a position.
///
/// With a normal error in each axis, fewer than one position of 200,000 lies farther away.
pub const REPORTED_DEVIATIONS: f64 = 5.0;

/// Largest time stamp that is read \[s\]: about 3,000 years. A stamp in milliseconds since 1970 is larger.
pub(crate) const LARGEST_TIME_S: f64 = 1e11;
/// Largest coordinate that is read \[m\].
pub(crate) const LARGEST_POSITION_M: f64 = 1e9;
/// Largest component of a velocity that is read \[m/s\].
pub(crate) const LARGEST_SPEED_M_S: f64 = 1e6;

/// Vehicles that must be heard before anything is clear.
#[derive(Clone, Debug, PartialEq, Eq, Default)]
pub enum Expected {
    /// The vehicles that were heard. A vehicle that never sends is not noticed.
    #[default]
    Heard,
    /// This number of vehicles.
    Count(usize),
    /// The vehicles with these names. Others are watched, too.
    Names(Vec<String>),
}

/// Time base of ages.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum TimeBase {
    /// The present is the arrival time of the monitor's clock.
    #[default]
    Arrival,
    /// The present is the largest stamp so far, as for a recording that is replayed at any speed.
    Stamps,
}

/// Clocks of the stamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClockScope {
    /// All stamps come from one clock, or from synchronised clocks.
    Common,
    /// Each vehicle has a clock of its own, such as the time since it started.
    PerVehicle,
}

/// Bound on the motion or on an error, with its source.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bound {
    /// Value.
    pub value: f64,
    /// Source: declared, or a default.
    pub source: Source,
}

impl Bound {
    /// Bound that the user gives.
    #[must_use]
    pub fn declared(value: f64) -> Self {
        Self { value, source: Source::Declared }
    }

    /// Default bound.
    #[must_use]
    pub fn default_of(value: f64) -> Self {
        Self { value, source: Source::Default }
    }

    fn fact(self, kind: FactKind, unit: &'static str) -> Fact {
        Fact::number(kind, self.source, self.value, unit)
    }
}

/// Bounds and limits of a watch.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Safety distance delta of two centres \[m\].
    pub delta_m: f64,
    /// Bound A on the acceleration of each vehicle \[m/s^2\].
    pub accel_m_s2: Bound,
    /// Bound eps on the error of each position \[m\], with the speed times the error of its stamp. Without it, the
    /// bound is [`REPORTED_DEVIATIONS`] times the accuracy that the source reports with each position.
    pub position_error_m: Option<Bound>,
    /// Bound e on the error of each velocity that is sent \[m/s\].
    pub velocity_error_m_s: Bound,
    /// Acceleration B with which each vehicle can brake along the line between two \[m/s^2\].
    pub brake_m_s2: f64,
    /// Age beyond which a vehicle is stale \[s\].
    pub max_age_s: Bound,
    /// Smallest delay between a stamp and its arrival \[s\], which the monitor cannot measure.
    pub latency_s: Bound,
    /// Time ahead that is examined \[s\].
    pub horizon_s: f64,
    /// Largest deviation from the plan \[m\].
    pub tube_m: f64,
    /// Motion after the end of a plan of a planner; `None` for the default, which holds the last point.
    pub plan_end: Option<PlanEnd>,
    /// Vehicles that must be heard.
    pub expected: Expected,
    /// Largest number of vehicles.
    pub max_vehicles: usize,
    /// Time base of ages.
    pub time_base: TimeBase,
    /// Clocks of the stamps. By default each vehicle has one if the source counts messages, whose stamps count from the
    /// start of the vehicle; otherwise all vehicles have a common one.
    pub clocks: Option<ClockScope>,
    /// Whether the source counts the messages of each vehicle, as `MAVLink` does.
    pub has_message_counts: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            delta_m: 1.0,
            accel_m_s2: Bound::default_of(DEFAULT_ACCEL_M_S2),
            position_error_m: Some(Bound::default_of(0.05)),
            velocity_error_m_s: Bound::default_of(0.1),
            brake_m_s2: 3.0,
            max_age_s: Bound::default_of(1.0),
            latency_s: Bound::default_of(0.0),
            horizon_s: 10.0,
            tube_m: 0.5,
            plan_end: None,
            expected: Expected::Heard,
            max_vehicles: 2000,
            time_base: TimeBase::Arrival,
            clocks: None,
            has_message_counts: false,
        }
    }
}

/// Setting outside of its range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{option}: {problem} ({value})")]
pub struct SettingsError {
    /// The option.
    pub option: Opt,
    /// Required range.
    pub problem: String,
    /// Given value.
    pub value: String,
}

impl Settings {
    /// Returns the clocks of the stamps. Stamps as the time base need a common one.
    #[must_use]
    pub fn clock_scope(&self) -> ClockScope {
        let by_default = if self.has_message_counts { ClockScope::PerVehicle } else { ClockScope::Common };
        match self.time_base {
            TimeBase::Arrival => self.clocks.unwrap_or(by_default),
            TimeBase::Stamps => ClockScope::Common,
        }
    }

    /// Returns whether messages show that one name carries two vehicles. The stamps of a common clock do not differ
    /// between two vehicles, and without counts nothing else does.
    pub(crate) fn shows_two_streams(&self) -> bool {
        self.has_message_counts || self.clock_scope() == ClockScope::PerVehicle
    }

    /// Returns the time by which a stamp may lie after the present of its clock \[s\]; from there it is a step.
    pub(crate) fn largest_step_s(&self) -> f64 {
        STEP_S.min(self.max_age_s.value / 2.0)
    }

    /// Returns the bound on the error of a position \[m\] with the accuracy that its source reports \[m\]; `None` if no
    /// bound is known.
    #[must_use]
    pub fn error_of_position_m(&self, accuracy_m: Option<f64>) -> Option<f64> {
        match self.position_error_m {
            Some(bound) => Some(bound.value),
            None => accuracy_m.map(|accuracy_m| REPORTED_DEVIATIONS * accuracy_m),
        }
    }

    /// Returns the bounds on which CLEAR rests. `reported_m` is the largest error of a position by the accuracy that
    /// sources report \[m\].
    #[must_use]
    pub fn facts(&self, reported_m: Option<f64>) -> Vec<Fact> {
        let position_error = match (self.position_error_m, reported_m) {
            (Some(bound), _) => Some(bound.fact(FactKind::PositionError, "m")),
            (None, reported_m) => {
                reported_m.map(|error_m| Fact::number(FactKind::PositionError, Source::Recorded, error_m, "m"))
            }
        };
        let clocks = match self.clock_scope() {
            ClockScope::Common => "common",
            ClockScope::PerVehicle => "own",
        };
        let others = [
            self.accel_m_s2.fact(FactKind::Acceleration, "m/s^2"),
            self.velocity_error_m_s.fact(FactKind::VelocityError, "m/s"),
            self.max_age_s.fact(FactKind::Age, "s"),
            self.latency_s.fact(FactKind::Latency, "s"),
            Fact::name(FactKind::Clock, self.source_of_clocks(), clocks),
            Fact::name(FactKind::LengthUnit, Source::Convention, "m"),
            Fact::name(FactKind::TimeUnit, Source::Convention, "s"),
        ];
        position_error.into_iter().chain(others).collect()
    }

    /// Returns the source of [`clock_scope`](Self::clock_scope).
    pub(crate) fn source_of_clocks(&self) -> Source {
        match self.clocks {
            Some(_) => Source::Declared,
            None if self.has_message_counts => Source::Convention,
            None => Source::Default,
        }
    }

    /// Checks the ranges of all numbers.
    ///
    /// # Errors
    /// [`SettingsError`] names the first option outside of its range.
    pub fn check(&self) -> Result<(), SettingsError> {
        let positive = "must be above 0 and at most 1e6";
        let not_negative = "must be from 0 to 1e6";
        for (option, value, least, problem) in [
            (DELTA, self.delta_m, f64::MIN_POSITIVE, positive),
            (ACCEL, self.accel_m_s2.value, 0.0, not_negative),
            (POSITION_ERROR, self.position_error_m.map_or(0.0, |bound| bound.value), 0.0, not_negative),
            (VELOCITY_ERROR, self.velocity_error_m_s.value, 0.0, not_negative),
            (BRAKE, self.brake_m_s2, f64::MIN_POSITIVE, positive),
            (MAX_AGE, self.max_age_s.value, f64::MIN_POSITIVE, positive),
            (LATENCY, self.latency_s.value, 0.0, not_negative),
            (HORIZON, self.horizon_s, f64::MIN_POSITIVE, positive),
            (TUBE, self.tube_m, f64::MIN_POSITIVE, positive),
        ] {
            if !(least..=1e6).contains(&value) {
                return Err(SettingsError { option, problem: problem.to_owned(), value: value.to_string() });
            }
        }
        let count = match &self.expected {
            Expected::Heard => 2,
            Expected::Count(count) => *count,
            Expected::Names(names) => names.len(),
        };
        if !(2..=self.max_vehicles).contains(&count) {
            let problem = format!("must give 2 vehicles or more, and at most the number of {MAX_VEHICLES}");
            let (option, value) = match self.expected {
                Expected::Heard => (MAX_VEHICLES, self.max_vehicles),
                Expected::Count(_) => (EXPECT, count),
                Expected::Names(_) => (IDS, count),
            };
            return Err(SettingsError { option, problem, value: value.to_string() });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::{Bound, Expected, Settings};

    #[test]
    fn every_number_has_a_range() {
        assert_eq!(Settings::default().check(), Ok(()));
        let broken: [fn(&mut Settings); 10] = [
            |of| of.delta_m = 0.0,
            |of| of.accel_m_s2.value = -1.0,
            |of| of.position_error_m = Some(Bound::declared(f64::NAN)),
            |of| of.velocity_error_m_s.value = f64::INFINITY,
            |of| of.brake_m_s2 = 0.0,
            |of| of.max_age_s.value = 1e7,
            |of| of.latency_s.value = -0.1,
            |of| of.horizon_s = 0.0,
            |of| of.tube_m = 0.0,
            |of| of.expected = Expected::Count(1),
        ];
        for spoil in broken {
            let mut settings = Settings::default();
            spoil(&mut settings);
            assert!(settings.check().is_err(), "{settings:?}");
        }
    }
}
