//! Times of a watch that count only if vehicles stay away: since sign-offs, and its end without a pair.
//!
//! A sign-off is worth nothing if the vehicle is heard again: the time in the state CLEAR since the sign-off is then
//! UNDECIDED, because the vehicle was not examined. The time in which fewer than two vehicles were present counts as
//! the end of the watch, unless a vehicle is heard again or another state follows.

use crate::event::{Assessment, State};

/// Vehicles that signed off, with the time that a return makes UNDECIDED.
#[derive(Debug, Default)]
pub(crate) struct Absences {
    /// Time in the state CLEAR up to the last judgement \[s\].
    pub(crate) clear_s: f64,
    /// Time with fewer than two present vehicles up to the last judgement \[s\].
    pub(crate) end_s: f64,
    /// Time in the state CLEAR that returns since the last judgement made UNDECIDED \[s\].
    pub(crate) unseen_s: f64,
    /// Whether a vehicle returned since the last judgement.
    pub(crate) has_return: bool,
    /// For each vehicle that signed off, the value of `clear_s` from which the time is not yet UNDECIDED \[s\].
    since_s: Vec<Option<f64>>,
    /// Vehicles that returned since the last judgement.
    returned: Vec<usize>,
}

impl Absences {
    /// Notes a sign-off at a time \[s\], with the last judgement.
    pub(crate) fn begin(&mut self, vehicle: u32, at_s: f64, last: Option<&Assessment>) {
        let vehicle = vehicle as usize;
        if self.since_s.len() <= vehicle {
            self.since_s.resize(vehicle + 1, None);
        }
        let passed_s = last.filter(|last| last.state == State::Clear).map_or(0.0, |last| at_s - last.now_s);
        let passed_s = if passed_s.is_finite() { passed_s.max(0.0) } else { 0.0 };
        self.since_s[vehicle] = Some(self.clear_s + passed_s);
    }

    /// Notes that a vehicle was heard after its sign-off.
    pub(crate) fn end(&mut self, vehicle: u32) {
        self.has_return = true;
        self.returned.push(vehicle as usize);
    }

    /// Adds the CLEAR time since the sign-offs of the vehicles that returned to `unseen_s`; at a judgement.
    pub(crate) fn settle(&mut self) {
        while let Some(vehicle) = self.returned.pop() {
            let Some(since_s) = self.since_s.get_mut(vehicle).and_then(Option::take) else { continue };
            let unseen_s = (self.clear_s - since_s).max(0.0);
            self.unseen_s += unseen_s;
            // The times since the sign-offs of the other vehicles overlap: the shorter one lies within the longer one.
            for other_s in self.since_s.iter_mut().flatten() {
                *other_s += unseen_s.min((self.clear_s - *other_s).max(0.0));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Absences;

    #[test]
    fn overlapping_absences_count_once() {
        let mut absences = Absences::default();
        // Sign-offs at 1 s, 2 s and 3 s of CLEAR; two vehicles return at 5 s and 6 s, the third one at 8 s.
        for (vehicle, clear_s) in [(0, 1.0), (1, 2.0), (2, 3.0)] {
            absences.clear_s = clear_s;
            absences.begin(vehicle, 0.0, None);
        }
        for (vehicle, clear_s, unseen_s) in [(1, 5.0, 3.0), (0, 6.0, 5.0), (2, 8.0, 7.0)] {
            absences.clear_s = clear_s;
            absences.end(vehicle);
            absences.settle();
            assert!((absences.unseen_s - unseen_s).abs() < 1e-12, "{vehicle}: {absences:?}");
        }
        // A vehicle without a sign-off adds nothing.
        absences.end(7);
        absences.settle();
        assert!((absences.unseen_s - 7.0).abs() < 1e-12, "{absences:?}");
    }
}
