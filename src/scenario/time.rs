//! Duration and rates of a flight.

#[cfg(feature = "schema")]
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Duration and rates.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[cfg_attr(feature = "schema", derive(JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct TimeSpec {
    /// Length of the flight in s.
    pub duration_s: f64,
    /// Control and physics step in s.
    #[serde(default = "TimeSpec::default_dt_s")]
    pub dt_s: f64,
    /// Samples recorded per second of flight in Hz, at most one a step.
    #[serde(default = "TimeSpec::default_record_hz")]
    pub record_hz: f64,
    /// How often a step that takes more than half of a clearance may be halved; 0 takes every step as it is.
    #[serde(default = "TimeSpec::default_max_halvings")]
    pub max_halvings: u32,
}

impl TimeSpec {
    /// Default step \[s\].
    pub const DEFAULT_DT_S: f64 = 1.0 / 240.0;
    /// Default recording rate \[Hz\].
    pub const DEFAULT_RECORD_HZ: f64 = 60.0;
    /// Default number of halvings.
    pub const DEFAULT_MAX_HALVINGS: u32 = 10;

    /// Part of a step, or of a recording period, that is rounding: two products of the same times differ by less.
    const ROUNDING: f64 = 1e-6;

    fn default_dt_s() -> f64 {
        Self::DEFAULT_DT_S
    }

    fn default_record_hz() -> f64 {
        Self::DEFAULT_RECORD_HZ
    }

    fn default_max_halvings() -> u32 {
        Self::DEFAULT_MAX_HALVINGS
    }

    /// A flight of this length \[s\] with the default rates.
    #[must_use]
    pub fn lasting(duration_s: f64) -> Self {
        Self {
            duration_s,
            dt_s: Self::DEFAULT_DT_S,
            record_hz: Self::DEFAULT_RECORD_HZ,
            max_halvings: Self::DEFAULT_MAX_HALVINGS,
        }
    }

    /// Number of steps: the fewest that cover the duration.
    #[must_use]
    pub fn steps(&self) -> u64 {
        let steps = (self.duration_s / self.dt_s - Self::ROUNDING).ceil().max(1.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 1; validation bounds it")]
        let steps = steps as u64;
        steps
    }

    /// Whether step `k` (its end, time k dt) is recorded: the start, the first step at or after each recording
    /// period, and the last step.
    #[must_use]
    pub fn records(&self, step: u64) -> bool {
        let periods_per_step = (self.dt_s * self.record_hz).min(1.0);
        let periods = |k: u64| (k as f64 * periods_per_step + Self::ROUNDING).floor();
        step == 0 || periods(step) > periods(step - 1) || step == self.steps()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::MAX_STEPS;

    fn recorded(time: TimeSpec) -> Vec<u64> {
        (0..=time.steps()).filter(|&step| time.records(step)).collect()
    }

    #[test]
    fn the_default_rates_record_every_fourth_step() {
        let time = TimeSpec::lasting(120.0);
        assert_eq!(time.steps(), 28_800);
        assert_eq!(recorded(time), (0..=28_800).step_by(4).collect::<Vec<_>>());
    }

    #[test]
    fn a_rate_that_does_not_divide_the_steps_is_kept_on_average() {
        let time = TimeSpec { dt_s: 0.01, ..TimeSpec::lasting(1.0) };
        assert_eq!(time.steps(), 100);
        assert_eq!(recorded(time)[..7], [0, 2, 4, 5, 7, 9, 10]);
        assert_eq!(recorded(time).len(), 61);
    }

    #[test]
    fn the_last_step_is_always_recorded() {
        let time = TimeSpec { dt_s: 0.3, record_hz: 0.1, ..TimeSpec::lasting(1.0) };
        assert_eq!((time.steps(), recorded(time)), (4, vec![0, 4]));
    }

    #[test]
    fn a_rate_above_the_steps_records_every_step_and_no_more() {
        let time = TimeSpec { dt_s: 0.1, record_hz: 1e9, ..TimeSpec::lasting(1.0) };
        assert_eq!(recorded(time), (0..=10).collect::<Vec<_>>());
    }

    #[test]
    fn rounding_adds_no_step_and_drops_none() {
        for dt_s in [1.0 / 240.0, 1.0 / 60.0, 0.1, 0.001, 1.0 / 3.0] {
            for steps in [1_u32, 3, 10, 999, 1_000_000] {
                let time = TimeSpec { dt_s, ..TimeSpec::lasting(dt_s * f64::from(steps)) };
                assert_eq!(time.steps(), u64::from(steps), "dt = {dt_s}");
            }
        }
    }

    #[test]
    fn every_recording_period_has_one_sample_up_to_the_longest_flight() {
        let time = TimeSpec::lasting(MAX_STEPS * TimeSpec::DEFAULT_DT_S);
        assert_eq!(time.steps(), 1_000_000_000);
        for first in [0, 1_000_000, 999_000_000] {
            let samples = (first + 1..=first + 4000).filter(|&step| time.records(step)).count();
            assert_eq!(samples, 1000, "from step {first}");
        }
    }
}
