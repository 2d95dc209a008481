//! Findings on well clear of air traffic.

use super::report::PairFinding;
use crate::report::answer::{Answer, Enclosure, Finding, FindingList, Part};
use tautline_audit::recorded::{Outcome, WellClearLoss, WellClearOutcome};
use tautline_audit::{Status, Tally};
use tautline_core::text::{at_least, exact, fixed};

/// Findings on well clear.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct WellClearFindings {
    /// Horizontal distance: DMOD, and threshold of the horizontal miss distance \[m\].
    pub horizontal_m: f64,
    /// Vertical distance \[m\].
    pub vertical_m: f64,
    /// Modified tau \[s\]; 0 without the criterion of time.
    pub tau_s: f64,
    /// Status of well clear.
    pub status: Status,
    /// Number of losses, and how many are listed.
    pub violations_tally: Tally,
    /// Number of undecided times, and how many are listed.
    pub undecided_tally: Tally,
    /// Times at which a pair is not well clear; of a long list the closest, and the first of each pair.
    pub violations: Vec<PairFinding<WellClearLoss>>,
    /// Times at which rounding could change the result, cut in the same way.
    pub undecided: Vec<PairFinding<WellClearLoss>>,
}

impl WellClearFindings {
    pub(super) fn new(found: &WellClearOutcome, outcome: &Outcome) -> Self {
        let named = |of: &WellClearLoss| PairFinding {
            who: [outcome.name(of.pair.first()), outcome.name(of.pair.second())],
            finding: *of,
        };
        Self {
            horizontal_m: found.thresholds.horizontal_m,
            vertical_m: found.thresholds.vertical_m,
            tau_s: found.thresholds.tau_s,
            status: found.status,
            violations_tally: found.violations_tally,
            undecided_tally: found.undecided_tally,
            violations: found.violations.iter().map(named).collect(),
            undecided: found.undecided.iter().map(named).collect(),
        }
    }

    fn thresholds(&self) -> String {
        let tau = if self.tau_s > 0.0 { format!(", tau {} s", exact(self.tau_s)) } else { String::new() };
        format!("{} m, {} m high{tau}", exact(self.horizontal_m), exact(self.vertical_m))
    }

    /// Returns the answer on well clear. Values are smallest horizontal distances.
    pub(super) fn answer(&self) -> Answer {
        let finding = |PairFinding { who, finding }: &PairFinding<WellClearLoss>| Finding {
            subjects: who.to_vec(),
            from_s: Some(finding.from_s),
            to_s: Some(finding.to_s),
            at_s: None,
            value: Enclosure::new(finding.horizontal_m, finding.horizontal_m, "m"),
            limit: Some(self.horizontal_m),
            rate_hz: None,
        };
        let closest = self.violations.iter().min_by(|a, b| a.finding.horizontal_m.total_cmp(&b.finding.horizontal_m));
        Answer {
            closest: closest.map(finding).into_iter().collect(),
            violations: FindingList::new(self.violations_tally, self.violations.iter().map(finding).collect()),
            undecided: FindingList::new(self.undecided_tally, self.undecided.iter().map(finding).collect()),
            ..Answer::new(Part::WellClear, self.status)
        }
    }

    /// Returns the finding in a few words.
    #[must_use]
    pub fn brief(&self) -> String {
        self.brief_as(self.status)
    }

    /// Returns the finding in the words of a status.
    pub(super) fn brief_as(&self, status: Status) -> String {
        let thresholds = self.thresholds();
        match status {
            Status::Clear => format!("well clear ({thresholds})"),
            Status::Violation => {
                let closest =
                    self.violations.iter().min_by(|a, b| a.finding.horizontal_m.total_cmp(&b.finding.horizontal_m));
                let others = match self.violations_tally.count {
                    ..=1 => String::new(),
                    count => format!("; {count} losses in all"),
                };
                closest.map_or(String::new(), |of| format!("{} ({thresholds}){others}", of.in_words("are not")))
            }
            Status::Undecided => match self.undecided.first() {
                Some(of) => format!("{} ({thresholds})", of.in_words("may not be")),
                None => format!("well clear is unknown at times ({thresholds})"),
            },
        }
    }

    /// Returns the losses, a sentence each.
    pub(super) fn violations_in_words(&self) -> impl Iterator<Item = String> + '_ {
        self.violations.iter().map(|of| of.in_words("are not"))
    }

    /// Returns the undecided times, a sentence each.
    pub(super) fn undecided_in_words(&self) -> impl Iterator<Item = String> + '_ {
        self.undecided.iter().map(|of| of.in_words("may not be"))
    }
}

impl PairFinding<WellClearLoss> {
    fn in_words(&self, how: &str) -> String {
        let Self { who: [first, second], finding } = self;
        format!(
            "{first} and {second} {how} well clear from {} s to {} s, down to {} m horizontally and {} m vertically",
            fixed(finding.from_s, 3),
            fixed(finding.to_s, 3),
            at_least(finding.horizontal_m, 3),
            at_least(finding.vertical_m, 3)
        )
    }
}
