//! The table `[time]`, and the recording rate where it says none.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::time::TimeSpec;
use super::vehicle::{QUADROTOR_CONTROL_HZ, QUADROTOR_DT_S};
use crate::vehicle::Airframe;

/// Numbers of a recording that is made without being told how often, at most \[bytes\].
const RECORDING_BYTES: f64 = (1_u64 << 30) as f64;

/// Duration and rates.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct TimeTable {
    /// Length of the flight in s.
    pub(super) duration_s: f64,
    /// Physics step in s; the law is asked once a step. A step that is too long for the law is flown in parts. Unless given
    /// 1/240, and 1/500 for quadrotors, halved until its parts can be as short as the law's links ask for, where the law is
    /// asked so often and a flight of such parts has at most 1e9.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = TimeSpec::DEFAULT_DT_S))]
    dt_s: Option<f64>,
    /// Samples recorded per second of flight in Hz, at most one a step. Unless given 60, or as much less as it takes for a
    /// large swarm's recording to hold at most 1 GiB of numbers and arrivals still to be told.
    #[serde(skip_serializing_if = "Option::is_none")]
    record_hz: Option<f64>,
    /// How often a step that is too long for the law, or takes more than half of a clearance, may be halved; 0 takes every
    /// step as it is. The default is 10. Under `potential` it rises up to 20, as the rate of the law at the certified distance requires.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("default" = TimeSpec::DEFAULT_MAX_HALVINGS))]
    max_halvings: Option<u32>,
    /// Largest product of a step and the law's fastest rate at the present state; a step that is longer is flown in halves.
    #[serde(default = "TimeTable::default_max_rate_dt", skip_serializing_if = "TimeTable::is_default_max_rate_dt")]
    #[schemars(extend("default" = TimeSpec::DEFAULT_MAX_RATE_DT, "exclusiveMinimum" = 0))]
    max_rate_dt: f64,
    /// How often the law is asked in Hz, at most once a step, where vehicles hold each command in between as a real
    /// controller makes them do. Unless given, commands of points stand for continuous control, and quadrotors are given 100 a
    /// second.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub(super) control_hz: Option<f64>,
}

impl TimeTable {
    fn default_max_rate_dt() -> f64 {
        TimeSpec::DEFAULT_MAX_RATE_DT
    }

    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
    fn is_default_max_rate_dt(max_rate_dt: &f64) -> bool {
        *max_rate_dt == TimeSpec::DEFAULT_MAX_RATE_DT
    }

    /// Whether the step is given.
    pub(super) fn gives_step(&self) -> bool {
        self.dt_s.is_some()
    }

    /// Whether the number of halvings is given.
    pub(super) fn gives_halvings(&self) -> bool {
        self.max_halvings.is_some()
    }

    /// Duration and rates of a flight of so many vehicles of this kind that are to keep what they have reached for `hold_s`
    /// seconds.
    pub(super) fn complete(self, count: usize, hold_s: f64, airframe: &Airframe) -> TimeSpec {
        let Self { duration_s, dt_s, record_hz, max_halvings, max_rate_dt, control_hz } = self;
        let record_hz = record_hz.unwrap_or_else(|| default_record_hz(count, duration_s, hold_s));
        let (default_dt_s, default_hz) = match airframe {
            Airframe::Point | Airframe::Unicycle(_) => (TimeSpec::DEFAULT_DT_S, None),
            Airframe::Quadrotor(_) => (QUADROTOR_DT_S, Some(QUADROTOR_CONTROL_HZ)),
        };
        let (dt_s, control_hz) = (dt_s.unwrap_or(default_dt_s), control_hz.or(default_hz));
        let max_halvings = max_halvings.unwrap_or(TimeSpec::DEFAULT_MAX_HALVINGS);
        TimeSpec { duration_s, dt_s, record_hz, max_halvings, max_rate_dt, control_hz }
    }
}

impl From<TimeSpec> for TimeTable {
    fn from(time: TimeSpec) -> Self {
        let TimeSpec { duration_s, dt_s, record_hz, max_halvings, max_rate_dt, control_hz } = time;
        let (dt_s, record_hz, max_halvings) = (Some(dt_s), Some(record_hz), Some(max_halvings));
        Self { duration_s, dt_s, record_hz, max_halvings, max_rate_dt, control_hz }
    }
}

/// Whole hertz where that is one or more; at least twice while an arrival is held.
fn default_record_hz(count: usize, duration_s: f64, hold_s: f64) -> f64 {
    const SAMPLES_HELD: f64 = 2.0;
    let most_hz = RECORDING_BYTES / (TimeSpec::BYTES_PER_VEHICLE as f64 * count as f64 * duration_s);
    let bounded_hz = if most_hz >= 1.0 { most_hz.floor() } else { most_hz };
    let told_hz = if hold_s > 0.0 { SAMPLES_HELD / hold_s } else { 0.0 };
    // A duration that is refused later on may be anything.
    if bounded_hz.max(told_hz) < TimeSpec::DEFAULT_RECORD_HZ {
        bounded_hz.max(told_hz)
    } else {
        TimeSpec::DEFAULT_RECORD_HZ
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_vehicles_are_recorded_less_often_and_few_at_sixty_hertz() {
        for (count, duration_s, hold_s, expected) in [
            (5, 120.0, 1.0, 60.0),
            (1000, 120.0, 1.0, 60.0),
            (10_000, 60.0, 1.0, 24.0),
            (100_000, 60.0, 1.0, 2.0),
            (100_000, 600.0, 1.0, 2.0),
            (100_000, 600.0, 0.0, 0.248_551_348_148_148_15),
            (100_000, 10.0, 0.1, 20.0),
        ] {
            assert_eq!(default_record_hz(count, duration_s, hold_s), expected, "{count} {duration_s} {hold_s}");
        }
        for (duration_s, hold_s) in [(f64::NAN, 1.0), (-1.0, 1.0), (0.0, 0.0), (1.0, f64::NAN), (1.0, 1e-300)] {
            let hz = default_record_hz(100_000, duration_s, hold_s);
            assert!(hz <= TimeSpec::DEFAULT_RECORD_HZ, "{hz}");
        }
    }

    #[test]
    fn what_is_given_is_kept() {
        let given = TimeSpec { record_hz: 240.0, ..TimeSpec::lasting(600.0) };
        assert_eq!(TimeTable::from(given).complete(100_000, 1.0, &Airframe::Point), given);
    }
}
