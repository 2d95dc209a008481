//! Bounds and limits of a watch, with their defaults and checks.

use crate::clock::STEP_S;

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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum ClockScope {
    /// All stamps come from one clock, or from synchronised clocks.
    #[default]
    Common,
    /// Each vehicle has a clock of its own, such as the time since it started.
    PerVehicle,
}

/// Bounds and limits of a watch.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Safety distance delta of two centres \[m\].
    pub delta_m: f64,
    /// Bound A on the acceleration of each vehicle \[m/s^2\].
    pub accel_m_s2: f64,
    /// Bound eps on the error of each position \[m\], with the speed times the error of its stamp.
    pub position_error_m: f64,
    /// Bound e on the error of each velocity that is sent \[m/s\].
    pub velocity_error_m_s: f64,
    /// Acceleration B with which each vehicle can brake along the line between two \[m/s^2\].
    pub brake_m_s2: f64,
    /// Age beyond which a vehicle is stale \[s\].
    pub max_age_s: f64,
    /// Smallest delay between a stamp and its arrival \[s\], which the monitor cannot measure.
    pub latency_s: f64,
    /// Time ahead that is examined \[s\].
    pub horizon_s: f64,
    /// Largest deviation from the plan \[m\].
    pub tube_m: f64,
    /// Vehicles that must be heard.
    pub expected: Expected,
    /// Largest number of vehicles.
    pub max_vehicles: usize,
    /// Time base of ages.
    pub time_base: TimeBase,
    /// Clocks of the stamps.
    pub clocks: ClockScope,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            delta_m: 1.0,
            accel_m_s2: 5.0,
            position_error_m: 0.05,
            velocity_error_m_s: 0.1,
            brake_m_s2: 3.0,
            max_age_s: 1.0,
            latency_s: 0.0,
            horizon_s: 10.0,
            tube_m: 0.5,
            expected: Expected::Heard,
            max_vehicles: 2000,
            time_base: TimeBase::Arrival,
            clocks: ClockScope::Common,
        }
    }
}

/// Setting outside of its range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{option}: {problem} ({value})")]
pub struct SettingsError {
    /// Option of the command line.
    pub option: &'static str,
    /// Required range.
    pub problem: &'static str,
    /// Given value.
    pub value: String,
}

impl Settings {
    /// Returns the time by which a stamp may lie after the present of its clock \[s\]; from there it is a step.
    pub(crate) fn largest_step_s(&self) -> f64 {
        STEP_S.min(self.max_age_s / 2.0)
    }

    /// Checks the ranges of all numbers.
    ///
    /// # Errors
    /// [`SettingsError`] names the first option outside of its range.
    pub fn check(&self) -> Result<(), SettingsError> {
        let positive = "must be above 0 and at most 1e6";
        let not_negative = "must be from 0 to 1e6";
        for (option, value, least, problem) in [
            ("--delta", self.delta_m, f64::MIN_POSITIVE, positive),
            ("--accel", self.accel_m_s2, 0.0, not_negative),
            ("--position-error", self.position_error_m, 0.0, not_negative),
            ("--velocity-error", self.velocity_error_m_s, 0.0, not_negative),
            ("--brake", self.brake_m_s2, f64::MIN_POSITIVE, positive),
            ("--max-age", self.max_age_s, f64::MIN_POSITIVE, positive),
            ("--latency", self.latency_s, 0.0, not_negative),
            ("--horizon", self.horizon_s, f64::MIN_POSITIVE, positive),
            ("--tube", self.tube_m, f64::MIN_POSITIVE, positive),
        ] {
            if !(least..=1e6).contains(&value) {
                return Err(SettingsError { option, problem, value: value.to_string() });
            }
        }
        let count = match &self.expected {
            Expected::Heard => 2,
            Expected::Count(count) => *count,
            Expected::Names(names) => names.len(),
        };
        if !(2..=self.max_vehicles).contains(&count) {
            let option = if matches!(self.expected, Expected::Count(_)) { "--expect" } else { "--ids" };
            let problem = "must give 2 vehicles or more, and at most the number of --max-vehicles";
            return Err(SettingsError { option, problem, value: count.to_string() });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::{Expected, Settings};

    #[test]
    fn every_number_has_a_range() {
        assert_eq!(Settings::default().check(), Ok(()));
        let broken: [fn(&mut Settings); 10] = [
            |of| of.delta_m = 0.0,
            |of| of.accel_m_s2 = -1.0,
            |of| of.position_error_m = f64::NAN,
            |of| of.velocity_error_m_s = f64::INFINITY,
            |of| of.brake_m_s2 = 0.0,
            |of| of.max_age_s = 1e7,
            |of| of.latency_s = -0.1,
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
