//! `[time]` of the scenario file: duration and rates of a flight.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::limits::{MAX_HALVINGS, MAX_STEPS};
use super::spec::Scenario;
use tautline_laws::law::{Law, LawSpec, RateQuery};

/// Size limit of a recording whose rate is not given \[bytes of numbers\].
const RECORDING_BYTES: f64 = (1_u64 << 30) as f64;

/// Duration and rates.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TimeSpec {
    /// Duration of the flight in s.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub duration_s: f64,
    /// Time step in s, with one evaluation of the law. Steps that are too long for the law are divided. Default: 1/240,
    /// or 1/500 for quadrotors. The default is halved until `max_halvings` reaches the step that the law's links
    /// require. It stays if the law is evaluated less often, or if the flight would have more than 1e9 substeps.
    #[serde(default = "default_dt_s")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub dt_s: f64,
    /// Recorded samples per second in Hz, at most one per step. Default: 60, or less for a large swarm: the recording
    /// then holds at most 1 GiB of numbers, and arrivals are still detected.
    #[serde(default = "default_record_hz")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub record_hz: f64,
    /// Largest number of halvings of a step that is too long for the law or takes more than half of a clearance; 0
    /// never divides steps. Under `potential` the default rises up to 20, as the rate of the law at the certified
    /// distance requires.
    #[serde(default = "default_max_halvings")]
    #[schemars(range(max = 20))]
    pub max_halvings: u32,
    /// Largest product of a step and the law's fastest rate in the current state; longer steps are halved.
    #[serde(default = "default_max_rate_dt")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub max_rate_dt: f64,
    /// Rate in Hz at which the law is evaluated, at most once per step. Vehicles hold each command in between, as under
    /// a digital controller. Unless given, the law of points acts in continuous time, and quadrotors get 100 commands a
    /// second.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub control_hz: Option<f64>,
}

fn default_dt_s() -> f64 {
    TimeSpec::DEFAULT_DT_S
}

fn default_record_hz() -> f64 {
    TimeSpec::DEFAULT_RECORD_HZ
}

fn default_max_halvings() -> u32 {
    TimeSpec::DEFAULT_MAX_HALVINGS
}

fn default_max_rate_dt() -> f64 {
    TimeSpec::DEFAULT_MAX_RATE_DT
}

impl TimeSpec {
    /// Default step \[s\].
    pub const DEFAULT_DT_S: f64 = 1.0 / 240.0;
    /// Default recording rate \[Hz\]; scenario files of large swarms have a lower default.
    pub const DEFAULT_RECORD_HZ: f64 = 60.0;
    /// Size of a vehicle in a sample \[bytes\]: position, velocity and command.
    pub const BYTES_PER_VEHICLE: u64 = 72;
    /// Default number of halvings.
    pub const DEFAULT_MAX_HALVINGS: u32 = 10;

    /// Default of [`TimeSpec::max_rate_dt`]. It keeps the energy of the second-order integration below its initial
    /// value within 0.1 %, also if vehicles bounce hard off barriers.
    pub const DEFAULT_MAX_RATE_DT: f64 = 0.3;

    /// Relative rounding of a step or a recording period: two products of the same times differ by less.
    const ROUNDING: f64 = 1e-6;

    /// Returns the default rates for a duration \[s\].
    #[must_use]
    pub fn lasting(duration_s: f64) -> Self {
        Self {
            duration_s,
            dt_s: Self::DEFAULT_DT_S,
            record_hz: Self::DEFAULT_RECORD_HZ,
            max_halvings: Self::DEFAULT_MAX_HALVINGS,
            max_rate_dt: Self::DEFAULT_MAX_RATE_DT,
            control_hz: None,
        }
    }

    /// Returns the number of steps: the fewest that cover the duration.
    #[must_use]
    pub fn steps(&self) -> u64 {
        let steps = (self.duration_s / self.dt_s - Self::ROUNDING).ceil().max(1.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 1; validation bounds it")]
        let steps = steps as u64;
        steps
    }

    /// Returns the end of a step \[s\]. The last step ends with the flight, so it may be shorter.
    #[must_use]
    pub fn end_s(&self, step: u64) -> f64 {
        let end_s = step as f64 * self.dt_s;
        if end_s - self.duration_s > Self::ROUNDING * self.dt_s { self.duration_s } else { end_s }
    }

    /// Returns the length of a step \[s\]; steps are counted from 1.
    #[must_use]
    pub fn length_s(&self, step: u64) -> f64 {
        let (end_s, whole_s) = (self.end_s(step), step as f64 * self.dt_s);
        if end_s < whole_s { end_s - (step - 1) as f64 * self.dt_s } else { self.dt_s }
    }

    /// Returns whether the end of a step is recorded: the start, the first step at or after each recording period, and
    /// the last step.
    #[must_use]
    pub fn records(&self, step: u64) -> bool {
        step == self.steps() || self.begins_period(step, self.record_hz)
    }

    /// Returns the number of recorded samples with the start, if no step is shorter than a recording period; otherwise
    /// one per step.
    #[must_use]
    pub fn samples(&self) -> u64 {
        let periods = (self.steps() as f64 * (self.dt_s * self.record_hz).min(1.0) + Self::ROUNDING).floor();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most the number of steps")]
        let periods = periods as u64;
        1 + periods + u64::from(!self.begins_period(self.steps(), self.record_hz))
    }

    /// Returns whether the law is evaluated at the end of a step: at every step, or at the first at or after each
    /// period of `control_hz`.
    #[must_use]
    pub fn commands(&self, step: u64) -> bool {
        self.control_hz.is_none_or(|control_hz| self.begins_period(step, control_hz))
    }

    fn begins_period(&self, step: u64, hz: f64) -> bool {
        let periods_per_step = (self.dt_s * hz).min(1.0);
        let periods = |k: u64| (k as f64 * periods_per_step + Self::ROUNDING).floor();
        step == 0 || periods(step) > periods(step - 1)
    }

    /// Returns the largest product of a step and the law's fastest rate that keeps the energy: `max_rate_dt`, at most
    /// its default.
    #[must_use]
    pub fn stable_rate_dt(&self) -> f64 {
        self.max_rate_dt.min(Self::DEFAULT_MAX_RATE_DT)
    }

    /// Returns the length of the shortest substep \[s\].
    #[must_use]
    pub fn shortest_step_s(&self) -> f64 {
        self.dt_s * 0.5_f64.powi(i32::try_from(self.max_halvings).unwrap_or(i32::MAX))
    }
}

impl Scenario {
    /// Returns the longest step that the links of a law allow at any distances \[s\]; `None` in continuous time.
    #[must_use]
    pub fn links_step_s(&self, law: &dyn Law) -> Option<f64> {
        let rate_per_s =
            law.rates(&RateQuery::new(self.velocity_coefficient_per_s(), Some(f64::INFINITY))).fastest_per_s?;
        (self.plant.holds_commands() && rate_per_s > 0.0).then(|| self.time.stable_rate_dt() / rate_per_s)
    }

    /// Halves the default time step until `max_halvings` reaches the step that the links of the law require. Keeps the
    /// step if the law is evaluated less often, or if the flight would have too many substeps. Invalid laws and times
    /// are left to [`super::validate`].
    pub(super) fn choose_step(&mut self) {
        let Ok(law) = self.law() else { return };
        let Some(needed_s) = self.links_step_s(law.as_ref()).filter(|&needed_s| needed_s > 0.0) else { return };
        let is_asked_in_time = self.time.control_hz.is_none_or(|control_hz| control_hz * needed_s >= 1.0);
        if !is_asked_in_time {
            return;
        }
        let mut chosen = self.time;
        while chosen.shortest_step_s() > needed_s {
            chosen.dt_s *= 0.5;
        }
        if chosen.duration_s <= MAX_STEPS * chosen.shortest_step_s() {
            self.time = chosen;
        }
    }

    /// Raises `max_halvings` until the shortest substep resolves the potential field at the certified distance.
    ///
    /// The certificate assigns the whole energy of the start to one pair. Links of a large gain drive pairs close to
    /// the certified distance.
    pub(super) fn choose_halvings(&mut self) {
        let LawSpec::Potential(_) = self.law else { return };
        let Ok(law) = self.law() else { return };
        let certified_m = self.certificate(law.as_ref()).certified_m;
        let query = RateQuery::new(self.velocity_coefficient_per_s(), certified_m);
        let Some(rate_per_s) = law.rates(&query).fastest_per_s else { return };
        while self.time.max_halvings < MAX_HALVINGS
            && self.time.shortest_step_s() * rate_per_s > self.time.stable_rate_dt()
        {
            self.time.max_halvings += 1;
        }
    }
}

/// Returns the recording rate \[Hz\] that bounds the recording: an integer if at least 1; at least two samples while an
/// arrival is held.
pub(super) fn bounded_record_hz(count: usize, duration_s: f64, hold_s: f64) -> f64 {
    const SAMPLES_HELD: f64 = 2.0;
    let most_hz = RECORDING_BYTES / (TimeSpec::BYTES_PER_VEHICLE as f64 * count as f64 * duration_s);
    let bounded_hz = if most_hz >= 1.0 { most_hz.floor() } else { most_hz };
    let told_hz = if hold_s > 0.0 { SAMPLES_HELD / hold_s } else { 0.0 };
    // An invalid duration, which is refused later, may give NaN.
    if bounded_hz.max(told_hz) < TimeSpec::DEFAULT_RECORD_HZ {
        bounded_hz.max(told_hz)
    } else {
        TimeSpec::DEFAULT_RECORD_HZ
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::MAX_STEPS;

    fn recorded(time: TimeSpec) -> Vec<u64> {
        let recorded: Vec<_> = (0..=time.steps()).filter(|&step| time.records(step)).collect();
        assert_eq!(time.samples(), recorded.len() as u64);
        recorded
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
    fn a_flight_ends_at_its_duration_with_a_shorter_last_step() {
        let time = TimeSpec { dt_s: 3.0, ..TimeSpec::lasting(10.0) };
        assert_eq!((time.steps(), time.end_s(3), time.end_s(4)), (4, 9.0, 10.0));
        assert_eq!((time.length_s(3), time.length_s(4)), (3.0, 1.0));
        let even = TimeSpec::lasting(120.0);
        assert_eq!((even.end_s(even.steps()), even.length_s(even.steps())), (28_800.0 * even.dt_s, even.dt_s));
    }

    #[test]
    fn the_law_is_evaluated_every_step_or_once_a_control_period() {
        let time = TimeSpec { dt_s: 0.01, ..TimeSpec::lasting(1.0) };
        assert!((0..=100).all(|step| time.commands(step)));
        let held = TimeSpec { control_hz: Some(25.0), ..time };
        assert_eq!((0..=12).filter(|&step| held.commands(step)).collect::<Vec<_>>(), [0, 4, 8, 12]);
    }

    #[test]
    fn a_rate_above_that_of_the_steps_records_every_step() {
        let time = TimeSpec { dt_s: 0.1, record_hz: 1e9, ..TimeSpec::lasting(1.0) };
        assert_eq!(recorded(time), (0..=10).collect::<Vec<_>>());
    }

    #[test]
    fn rounding_neither_adds_nor_drops_a_step() {
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
            assert_eq!(bounded_record_hz(count, duration_s, hold_s), expected, "{count} {duration_s} {hold_s}");
        }
        for (duration_s, hold_s) in [(f64::NAN, 1.0), (-1.0, 1.0), (0.0, 0.0), (1.0, f64::NAN), (1.0, 1e-300)] {
            let hz = bounded_record_hz(100_000, duration_s, hold_s);
            assert!(hz <= TimeSpec::DEFAULT_RECORD_HZ, "{hz}");
        }
    }
}
