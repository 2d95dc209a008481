//! Rows counted in their order, up to where enough has been flown.

use super::row::{Known, Row};
use super::spec::Stop;
use crate::Question;
use crate::statistics::{CONFIDENCE, Proportion, anytime};

/// Runs after which it is first asked whether enough has been flown; then after twice as many, and so on.
const FIRST_LOOK: u64 = 100;

/// Which intervals are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Intervals {
    /// Of Clopper and Pearson, for a number of runs that was fixed beforehand.
    ClopperPearson,
    /// A confidence sequence, which holds whenever one stops.
    ConfidenceSequence,
    /// None: the runs are all the points of grids, and no sample of anything.
    Exact,
}

impl Intervals {
    /// The share of `count` of so many. What is not known of `unknown` more widens its interval: at the lower end they count as
    /// not, at the upper end as well.
    #[must_use]
    pub fn share(self, count: u64, unknown: u64, of: u64) -> Proportion {
        let at = |count: u64| match self {
            Self::ClopperPearson => Proportion::new(count, of),
            Self::ConfidenceSequence => anytime(count, of),
            Self::Exact => {
                let share = (of > 0).then(|| count as f64 / of as f64);
                Proportion { count, of, share, low: share.unwrap_or(0.0), high: share.unwrap_or(1.0), confidence: 1.0 }
            }
        };
        let high = at(count.saturating_add(unknown).min(of)).high;
        Proportion { high, ..at(count) }
    }

    /// Returns the bound that the share of `count` of `of` is below, where `unknown` more may count; none of grids and of nothing.
    #[must_use]
    pub fn upper_bound(self, count: u64, unknown: u64, of: u64) -> Option<UpperBound> {
        let count = count.saturating_add(unknown).min(of);
        let (share, kind) = match self {
            _ if of == 0 => return None,
            Self::ClopperPearson => (Proportion::upper_bound(count, of), BoundKind::OneSided),
            Self::ConfidenceSequence => (anytime(count, of).high, BoundKind::ConfidenceSequence),
            Self::Exact => return None,
        };
        Some(UpperBound { share, confidence: CONFIDENCE, kind })
    }
}

/// Bound that a share is below, with the confidence of [`crate::statistics::CONFIDENCE`].
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct UpperBound {
    /// The bound, from 0 to 1.
    pub share: f64,
    /// How often such a bound is above the true share.
    pub confidence: f64,
    /// Which bound it is.
    pub kind: BoundKind,
}

/// Which bound a share has.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum BoundKind {
    /// The one-sided bound of Clopper and Pearson, for a number of runs that was fixed beforehand.
    OneSided,
    /// The upper end of a confidence sequence.
    ConfidenceSequence,
}

/// How many flights of a law showed what.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Flown.
    pub flown: u64,
    /// Not flown.
    pub not_flown: u64,
    /// Clear to the end.
    pub clear: u64,
    /// With a violation.
    pub violated: u64,
    /// Neither is known.
    pub unknown: u64,
    /// Reached and kept.
    pub reached: u64,
    /// Passed.
    pub pass: u64,
    /// Closer than their law's certificate.
    pub certificates_broken: u64,
}

impl Counts {
    fn take(&mut self, row: &Row) {
        let counter = match row.known() {
            Known::Clear => &mut self.clear,
            Known::Violated => &mut self.violated,
            Known::Unknown => &mut self.unknown,
            Known::NotFlown => &mut self.not_flown,
            Known::Estimated => return,
        };
        *counter += 1;
        self.flown += u64::from(row.flight.is_some());
        self.reached += u64::from(row.flight.as_ref().is_some_and(|flight| flight.reached));
        self.certificates_broken += u64::from(row.flight.as_ref().is_some_and(|flight| flight.breaks_certificate));
        self.pass += u64::from(row.flight.as_ref().is_some_and(|flight| flight.pass));
    }

    /// The share that shows what is asked.
    #[must_use]
    pub fn share(&self, question: Question, intervals: Intervals) -> Proportion {
        match question {
            Question::Clear => intervals.share(self.clear, self.unknown, self.flown),
            Question::Reached => intervals.share(self.reached, 0, self.flown),
            Question::Pass => intervals.share(self.pass, 0, self.flown),
        }
    }

    /// Returns the bound that the share with a violation is below.
    #[must_use]
    pub fn violated_below(&self, intervals: Intervals) -> Option<UpperBound> {
        intervals.upper_bound(self.violated, self.unknown, self.flown)
    }

    /// The share with a violation.
    #[must_use]
    pub fn violated(&self, intervals: Intervals) -> Proportion {
        intervals.share(self.violated, self.unknown, self.flown)
    }
}

/// Rows counted in the order of their runs.
#[derive(Clone, Debug)]
pub struct Tally {
    stop: Option<Stop>,
    counts: Vec<Counts>,
    runs: u64,
    next_look: u64,
    is_enough: bool,
}

impl Tally {
    /// Nothing counted, of so many laws.
    #[must_use]
    pub fn new(laws: usize, stop: Option<Stop>) -> Self {
        Self { stop, counts: vec![Counts::default(); laws], runs: 0, next_look: FIRST_LOOK, is_enough: false }
    }

    /// Counts a row, unless enough has been flown before it; says whether it was.
    pub fn take(&mut self, row: &Row) -> bool {
        if self.is_enough {
            return false;
        }
        if let Some(counts) = self.counts.get_mut(row.law) {
            counts.take(row);
        }
        if row.law + 1 == self.counts.len() {
            self.runs += 1;
            if self.runs == self.next_look {
                self.next_look = self.next_look.saturating_mul(2);
                self.is_enough = self.stop.is_some_and(|stop| self.decides(stop));
            }
        }
        true
    }

    fn decides(&self, stop: Stop) -> bool {
        self.counts.iter().all(|counts| {
            let share = counts.share(stop.of, Intervals::ConfidenceSequence);
            let is_narrow = stop.width.is_none_or(|width| share.high - share.low <= width);
            let is_decided = stop.decided.is_none_or(|at| share.low > at || share.high < at);
            is_narrow && is_decided
        })
    }

    /// Whether enough has been flown.
    #[must_use]
    pub fn is_enough(&self) -> bool {
        self.is_enough
    }

    /// Runs that were counted under every law.
    #[must_use]
    pub fn runs(&self) -> u64 {
        self.runs
    }

    /// Counts of each law.
    #[must_use]
    pub fn counts(&self) -> &[Counts] {
        &self.counts
    }
}
