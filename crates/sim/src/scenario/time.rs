//! Duration and rates of a flight.

/// Duration and rates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TimeSpec {
    /// Length of the flight \[s\].
    pub duration_s: f64,
    /// Physics step \[s\]; the law is asked once a step. A step that is too long for the law is flown in parts.
    pub dt_s: f64,
    /// Samples recorded per second of flight \[Hz\], at most one a step.
    pub record_hz: f64,
    /// How often a step that is too long for the law, or takes more than half of a clearance, may be halved; 0 takes every
    /// step as it is.
    pub max_halvings: u32,
    /// Largest product of a step and the law's fastest rate at the present state; a step that is longer is flown in halves.
    pub max_rate_dt: f64,
    /// How often the law is asked \[Hz\], at most once a step, where vehicles hold each command in between as a real
    /// controller makes them do. Unless given, commands stand for continuous control.
    pub control_hz: Option<f64>,
}

impl TimeSpec {
    /// Default step \[s\].
    pub const DEFAULT_DT_S: f64 = 1.0 / 240.0;
    /// Default recording rate \[Hz\]; a scenario file of many vehicles has a lower one, which keeps its recording bounded.
    pub const DEFAULT_RECORD_HZ: f64 = 60.0;
    /// Numbers of a vehicle in a sample: position, velocity and command \[bytes\].
    pub const BYTES_PER_VEHICLE: u64 = 72;
    /// Default number of halvings.
    pub const DEFAULT_MAX_HALVINGS: u32 = 10;

    /// Default of [`TimeSpec::max_rate_dt`]: it keeps the energy of second-order integration below its start to a part in a
    /// thousand, also where vehicles bounce hard off their barriers.
    pub const DEFAULT_MAX_RATE_DT: f64 = 0.3;

    /// Part of a step, or of a recording period, that is rounding: two products of the same times differ by less.
    const ROUNDING: f64 = 1e-6;

    /// A flight of this length \[s\] with the default rates.
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

    /// Number of steps: the fewest that cover the duration.
    #[must_use]
    pub fn steps(&self) -> u64 {
        let steps = (self.duration_s / self.dt_s - Self::ROUNDING).ceil().max(1.0);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at least 1; validation bounds it")]
        let steps = steps as u64;
        steps
    }

    /// When a step ends \[s\]; the last ends with the flight, and is shorter where steps do not divide the duration.
    #[must_use]
    pub fn end_s(&self, step: u64) -> f64 {
        let end_s = step as f64 * self.dt_s;
        if end_s - self.duration_s > Self::ROUNDING * self.dt_s { self.duration_s } else { end_s }
    }

    /// Length of a step, from 1 \[s\].
    #[must_use]
    pub fn length_s(&self, step: u64) -> f64 {
        let (end_s, whole_s) = (self.end_s(step), step as f64 * self.dt_s);
        if end_s < whole_s { end_s - (step - 1) as f64 * self.dt_s } else { self.dt_s }
    }

    /// Whether step `k` (its end) is recorded: the start, the first step at or after each recording period, and the last
    /// step.
    #[must_use]
    pub fn records(&self, step: u64) -> bool {
        step == self.steps() || self.begins_period(step, self.record_hz)
    }

    /// Number of samples that are recorded, the start among them, where no step is shorter than a recording period: else one a
    /// step.
    #[must_use]
    pub fn samples(&self) -> u64 {
        let periods = (self.steps() as f64 * (self.dt_s * self.record_hz).min(1.0) + Self::ROUNDING).floor();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most the number of steps")]
        let periods = periods as u64;
        1 + periods + u64::from(!self.begins_period(self.steps(), self.record_hz))
    }

    /// Whether the law is asked at the end of step `k`: after every step, or at the first at or after each period of
    /// `control_hz`.
    #[must_use]
    pub fn commands(&self, step: u64) -> bool {
        self.control_hz.is_none_or(|control_hz| self.begins_period(step, control_hz))
    }

    fn begins_period(&self, step: u64, hz: f64) -> bool {
        let periods_per_step = (self.dt_s * hz).min(1.0);
        let periods = |k: u64| (k as f64 * periods_per_step + Self::ROUNDING).floor();
        step == 0 || periods(step) > periods(step - 1)
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
    fn a_flight_ends_when_it_shall_and_its_last_step_is_what_is_left() {
        let time = TimeSpec { dt_s: 3.0, ..TimeSpec::lasting(10.0) };
        assert_eq!((time.steps(), time.end_s(3), time.end_s(4)), (4, 9.0, 10.0));
        assert_eq!((time.length_s(3), time.length_s(4)), (3.0, 1.0));
        let even = TimeSpec::lasting(120.0);
        assert_eq!((even.end_s(even.steps()), even.length_s(even.steps())), (28_800.0 * even.dt_s, even.dt_s));
    }

    #[test]
    fn the_law_is_asked_every_step_or_once_a_period_of_its_own() {
        let time = TimeSpec { dt_s: 0.01, ..TimeSpec::lasting(1.0) };
        assert!((0..=100).all(|step| time.commands(step)));
        let held = TimeSpec { control_hz: Some(25.0), ..time };
        assert_eq!((0..=12).filter(|&step| held.commands(step)).collect::<Vec<_>>(), [0, 4, 8, 12]);
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
