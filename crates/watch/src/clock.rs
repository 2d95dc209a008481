//! Clock of a source, seen through the arrival of its stamps.
//!
//! The offset between the monitor's clock and a source's clock is unknown, and so is the delay of each message. The
//! smallest difference of arrival and stamp so far is the offset plus the smallest delay. An age counts from there, so
//! it includes every delay beyond the smallest one; `latency_s` of the settings adds the smallest one. The estimate may
//! rise by [`DRIFT`], because two quartz clocks drift apart.
//!
//! Stamps that run faster than arrival make the offset fall. Each new stamp then looks young, and its age proves
//! nothing. A fall by more than [`FALL_S`] beyond [`FALL_RATE`] of the elapsed time is a fault.

/// Largest relative rate of two clocks.
pub const DRIFT: f64 = 1e-4;
/// Distance of a stamp before the newest stamp of its vehicle from which it is a step of the clock, not a late message
/// \[s\].
pub const STEP_S: f64 = 1.0;
/// Fall of the offset from which the clock is too fast \[s\].
const FALL_S: f64 = 0.1;
/// Relative rate at which the offset may fall in addition. The bounds count this rate.
pub(crate) const FALL_RATE: f64 = 0.01;
/// Further fall from which a clock that was too fast is so again \[s\].
const FURTHER_FALL_S: f64 = 0.01;

/// Offset of a source's clock.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SourceClock {
    /// Offset with which stamps become times of the monitor: constant until a step \[s\].
    anchor_s: f64,
    /// Smallest difference of arrival and stamp, with drift \[s\].
    offset_s: f64,
    /// Offset below which the clock is too fast \[s\].
    least_s: f64,
    /// Time of the last update of the offset \[s\].
    updated_s: f64,
    /// Number of steps so far.
    epoch: u32,
}

impl SourceClock {
    /// Returns the clock of a first stamp. Times of the monitor are those of the source if `keeps_times`.
    pub(crate) fn new(t_s: f64, arrival_s: f64, keeps_times: bool) -> Self {
        let offset_s = arrival_s - t_s;
        let anchor_s = if keeps_times { 0.0 } else { offset_s };
        Self { anchor_s, offset_s, least_s: offset_s - FALL_S, updated_s: arrival_s, epoch: 0 }
    }

    pub(crate) fn epoch(&self) -> u32 {
        self.epoch
    }

    /// Converts a stamp to a time of the monitor \[s\].
    pub(crate) fn time_of(&self, t_s: f64) -> f64 {
        t_s + self.anchor_s
    }

    /// Returns the age of a stamp \[s\].
    pub(crate) fn age_s(&self, t_s: f64, now_s: f64) -> f64 {
        (now_s - t_s - self.offset_s).max(0.0)
    }

    /// Returns whether a stamp lies more than `most_s` after the present of its clock.
    pub(crate) fn is_ahead(&self, t_s: f64, arrival_s: f64, most_s: f64) -> bool {
        arrival_s - t_s < self.offset_s - most_s
    }

    /// Takes a stamp. Returns whether the clock is too fast.
    pub(crate) fn take(&mut self, t_s: f64, arrival_s: f64) -> bool {
        let passed_s = (arrival_s - self.updated_s).max(0.0);
        self.offset_s = (self.offset_s + DRIFT * passed_s).min(arrival_s - t_s);
        self.updated_s = arrival_s;
        self.least_s = (self.least_s - FALL_RATE * passed_s).max(self.offset_s - FALL_S);
        let is_fast = self.offset_s < self.least_s;
        if is_fast {
            self.least_s = self.offset_s - FURTHER_FALL_S;
        }
        is_fast
    }

    /// Moves the anchor of a clock of one vehicle to the present offset.
    pub(crate) fn settle(&mut self) {
        self.anchor_s = self.offset_s;
    }

    /// Starts anew after a step of the clock.
    pub(crate) fn step(&mut self, t_s: f64, arrival_s: f64) {
        let offset_s = arrival_s - t_s;
        let (least_s, epoch) = (offset_s - FALL_S, self.epoch.wrapping_add(1));
        *self = Self { anchor_s: offset_s, offset_s, least_s, updated_s: arrival_s, epoch };
    }
}

#[cfg(test)]
mod tests {
    use super::SourceClock;

    #[test]
    fn a_late_stamp_is_old_and_the_fastest_one_is_the_reference() {
        let mut clock = SourceClock::new(0.0, 100.3, false);
        clock.take(1.0, 101.0);
        assert!(clock.age_s(1.0, 101.0).abs() < 1e-12);
        // Sent at 2 s, 1.4 s late.
        clock.take(2.0, 103.4);
        assert!((clock.age_s(2.0, 103.4) - 1.4).abs() < 1e-3);
    }

    #[test]
    fn a_drift_of_the_clock_does_not_become_an_age() {
        let mut clock = SourceClock::new(0.0, 0.0, false);
        for k in 0..86_400 {
            let arrival_s = f64::from(k);
            let t_s = arrival_s * (1.0 - 0.5e-4);
            clock.take(t_s, arrival_s);
            assert!(clock.age_s(t_s, arrival_s) < 1e-3, "{k}");
        }
    }

    #[test]
    fn stamps_that_run_faster_than_arrival_are_too_fast() {
        let count_of = |rate: f64| {
            let mut clock = SourceClock::new(0.0, 50.0, false);
            (1..=200)
                .map(|k| f64::from(k) / 20.0)
                .filter(|passed_s| clock.take(passed_s * rate, 50.0 + passed_s))
                .count()
        };
        assert_eq!((count_of(1.0), count_of(0.5), count_of(1.005)), (0, 0, 0));
        assert!(count_of(1.05) > 20, "{}", count_of(1.05));
        assert!(count_of(3.0) > 190, "{}", count_of(3.0));
        // One shorter delay is one fault, and jitter of 0.09 s is none.
        let mut clock = SourceClock::new(0.0, 0.5, false);
        assert!(clock.take(1.0, 1.2));
        for k in 2..100 {
            let jitter_s = if k % 7 == 0 { 0.0 } else { 0.09 };
            assert!(!clock.take(f64::from(k), f64::from(k) + 0.2 + jitter_s), "{k}");
        }
    }
}
