//! Counts of rows up to an early stop, and shares over the values of varied keys.

use serde::Serialize;
use serde_json::Value;

use super::shard::Row;
use super::spec::Stop;
use super::vary::Variation;
use crate::Criterion;
use crate::flight::{FlightSummary, Outcome};
use crate::statistics::{CONFIDENCE, Proportion, anytime};

/// Number of runs at the first look for an early stop; each later look has twice the number.
const FIRST_LOOK: u64 = 100;

/// Method of the confidence intervals of proportions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Intervals {
    /// Clopper and Pearson, for a number of runs that was fixed beforehand.
    ClopperPearson,
    /// A confidence sequence, which holds at every stop.
    ConfidenceSequence,
    /// No interval: the runs are all points of the grids, not a sample.
    Exact,
}

impl Intervals {
    /// Returns the share of `count` in `of`. `unknown` more count only at the upper end of the interval.
    #[must_use]
    pub fn share(self, count: u64, unknown: u64, total: u64) -> Proportion {
        let proportion_of = |count: u64| match self {
            Self::ClopperPearson => Proportion::new(count, total),
            Self::ConfidenceSequence => anytime(count, total),
            Self::Exact => Proportion::exact(count, total),
        };
        let high = proportion_of(count.saturating_add(unknown).min(total)).high;
        Proportion { high, ..proportion_of(count) }
    }

    /// Returns the upper bound of the share of `count` plus `unknown` in `of`; `None` for grids and for `of` = 0.
    #[must_use]
    pub fn upper_bound(self, count: u64, unknown: u64, total: u64) -> Option<UpperBound> {
        let count = count.saturating_add(unknown).min(total);
        let (share, kind) = match self {
            _ if total == 0 => return None,
            Self::ClopperPearson => (Proportion::upper_bound(count, total), BoundKind::OneSided),
            Self::ConfidenceSequence => (anytime(count, total).high, BoundKind::ConfidenceSequence),
            Self::Exact => return None,
        };
        Some(UpperBound { share, confidence: CONFIDENCE, kind })
    }
}

/// Upper bound of a share, with the confidence [`crate::statistics::CONFIDENCE`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct UpperBound {
    /// The bound, from 0 to 1.
    pub share: f64,
    /// Probability that the bound is above the true share.
    pub confidence: f64,
    /// Kind of the bound.
    pub kind: BoundKind,
}

/// Kind of an upper bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum BoundKind {
    /// One-sided bound of Clopper and Pearson, for a number of runs that was fixed beforehand.
    OneSided,
    /// Upper end of a confidence sequence.
    ConfidenceSequence,
}

/// Counts of the flights of a law.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Flights.
    pub flown: u64,
    /// Runs that cannot be flown.
    pub not_flown: u64,
    /// Flights that are clear to the end.
    pub clear: u64,
    /// Flights with a violation.
    pub violated: u64,
    /// Flights whose separation is unknown.
    pub unknown: u64,
    /// Flights that reached the formation and kept it.
    pub reached: u64,
    /// Flights that pass.
    pub pass: u64,
    /// Flights with a separation below the certified one.
    pub certificates_broken: u64,
}

impl Counts {
    fn take(&mut self, row: &Row) {
        let Some(flight) = &row.flight else {
            self.not_flown += u64::from(row.splitting.is_none());
            return;
        };
        *match flight.outcome {
            Outcome::Clear => &mut self.clear,
            Outcome::Violated => &mut self.violated,
            Outcome::EndedEarly | Outcome::Undecided => &mut self.unknown,
        } += 1;
        self.flown += 1;
        self.reached += u64::from(flight.reached);
        self.certificates_broken += u64::from(flight.breaks_certificate);
        self.pass += u64::from(flight.pass);
    }

    /// Returns the share of flights that show a verdict.
    #[must_use]
    pub fn share(&self, question: Criterion, intervals: Intervals) -> Proportion {
        match question {
            Criterion::Clear => intervals.share(self.clear, self.unknown, self.flown),
            Criterion::Reached => intervals.share(self.reached, 0, self.flown),
            Criterion::Pass => intervals.share(self.pass, 0, self.flown),
        }
    }

    /// Returns the upper bound of the share with a violation.
    #[must_use]
    pub fn violated_below(&self, intervals: Intervals) -> Option<UpperBound> {
        intervals.upper_bound(self.violated, self.unknown, self.flown)
    }

    /// Returns the share of flights with a violation.
    #[must_use]
    pub fn violated(&self, intervals: Intervals) -> Proportion {
        intervals.share(self.violated, self.unknown, self.flown)
    }
}

/// Counts of rows in the order of runs.
#[derive(Clone, Debug)]
pub struct Tally {
    stop: Option<Stop>,
    counts: Vec<Counts>,
    runs: u64,
    next_look: u64,
    is_enough: bool,
}

impl Tally {
    /// Returns empty counts for a number of laws.
    #[must_use]
    pub fn new(laws: usize, stop: Option<Stop>) -> Self {
        Self { stop, counts: vec![Counts::default(); laws], runs: 0, next_look: FIRST_LOOK, is_enough: false }
    }

    /// Counts a row unless the rule for an early stop is satisfied. Returns whether the row counts.
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
            let is_decided = stop.decided.is_none_or(|limit| share.low > limit || share.high < limit);
            is_narrow && is_decided
        })
    }

    /// Returns whether the rule for an early stop is satisfied.
    #[must_use]
    pub fn is_enough(&self) -> bool {
        self.is_enough
    }

    /// Returns the number of runs that were counted under every law.
    #[must_use]
    pub fn runs(&self) -> u64 {
        self.runs
    }

    /// Returns the counts of each law.
    #[must_use]
    pub fn counts(&self) -> &[Counts] {
        &self.counts
    }
}

/// Number of intervals for the values of a continuous key.
const INTERVALS: usize = 10;
/// Largest number of values with bins of their own.
const MOST_VALUES: usize = 40;

/// Results over a varied key.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Varied {
    /// The key.
    pub key: String,
    /// Whether the key is drawn uniformly in its logarithm.
    pub logarithmic: bool,
    /// Bins of its values, in increasing order.
    pub bins: Vec<Bin>,
}

/// Flights with one value of a key, or within an interval of values.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bin {
    /// Label: the value as written, or the interval.
    pub said: String,
    /// Lower end of the interval, or the value; `None` for words.
    pub low: Option<f64>,
    /// Upper end of the interval, or the value; `None` for words.
    pub high: Option<f64>,
    /// Shares of each law, in the order of the laws.
    pub laws: Vec<BinShares>,
}

/// Shares of a law within a bin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BinShares {
    /// Flights with a violation. Unknown flights count at the upper end of the interval.
    pub violated: Proportion,
    /// Flights that reached the formation and kept it.
    pub reached: Proportion,
}

/// Accumulator of the values of a key, with the result of each flight.
#[derive(Debug)]
pub(super) struct KeyColumn {
    key: String,
    laws: usize,
    is_continuous: bool,
    is_logarithmic: bool,
    is_seed: bool,
    flights: Vec<Flight>,
}

#[derive(Debug)]
struct Flight {
    law: usize,
    value: Value,
    outcome: Outcome,
    reached: bool,
}

impl KeyColumn {
    /// Returns an empty accumulator for a number of laws.
    #[must_use]
    pub(super) fn new(key: &str, variation: &Variation, laws: usize) -> Self {
        Self {
            key: key.to_owned(),
            laws,
            is_continuous: matches!(variation, Variation::Uniform(_) | Variation::LogUniform(_) | Variation::Normal(_)),
            is_logarithmic: matches!(variation, Variation::LogUniform(_)),
            is_seed: matches!(variation, Variation::Seed),
            flights: Vec::new(),
        }
    }

    /// Adds a flight.
    pub(super) fn take(&mut self, law: usize, value: &Value, flight: &FlightSummary) {
        if !self.is_seed {
            let (outcome, reached) = (flight.outcome, flight.reached);
            self.flights.push(Flight { law, value: value.clone(), outcome, reached });
        }
    }

    /// Returns the results over the key; `None` for seeds, and without flights.
    #[must_use]
    pub(super) fn finish(self, intervals: Intervals) -> Option<Varied> {
        if self.flights.is_empty() {
            return None;
        }
        let is_continuous = self.is_continuous || self.has_many_numbers();
        let bins = if is_continuous { self.spans(intervals) } else { self.values(intervals) };
        Some(Varied { key: self.key, logarithmic: self.is_logarithmic, bins })
    }

    /// Returns whether the values are numbers, and too many for bins of their own.
    fn has_many_numbers(&self) -> bool {
        let mut numbers: Vec<_> = self.flights.iter().filter_map(|flight| flight.value.as_f64()).collect();
        let are_numbers = numbers.len() == self.flights.len();
        numbers.sort_by(f64::total_cmp);
        numbers.dedup();
        are_numbers && numbers.len() > MOST_VALUES
    }

    fn spans(&self, intervals: Intervals) -> Vec<Bin> {
        let numbers: Vec<_> = self.flights.iter().filter_map(|flight| flight.value.as_f64()).collect();
        let scale = |value: f64| if self.is_logarithmic { value.ln() } else { value };
        let back = |value: f64| if self.is_logarithmic { value.exp() } else { value };
        let low = numbers.iter().copied().fold(f64::INFINITY, f64::min);
        let high = numbers.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let width = (scale(high) - scale(low)) / INTERVALS as f64;
        let place = |value: f64| {
            let part = if width > 0.0 { (scale(value) - scale(low)) / width } else { 0.0 };
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "not negative, and small")]
            let place = part.floor().max(0.0) as usize;
            place.min(INTERVALS - 1)
        };
        let mut members: Vec<Vec<&Flight>> = vec![Vec::new(); INTERVALS];
        for flight in &self.flights {
            if let Some(value) = flight.value.as_f64() {
                members[place(value)].push(flight);
            }
        }
        let edge = |number: usize| match number {
            0 => low,
            INTERVALS => high,
            number => back(scale(low) + width * number as f64),
        };
        let bins = members.iter().enumerate().filter(|(_, members)| !members.is_empty());
        bins.map(|(number, members)| {
            let [low, high] = [edge(number), edge(number + 1)];
            let said = format!(
                "{} to {}",
                tautline_core::text::significant(low, 4),
                tautline_core::text::significant(high, 4)
            );
            self.bin(said, Some(low), Some(high), members, intervals)
        })
        .collect()
    }

    fn values(&self, intervals: Intervals) -> Vec<Bin> {
        let mut members: Vec<(&Value, Vec<&Flight>)> = Vec::new();
        let mut others: Vec<&Flight> = Vec::new();
        for flight in &self.flights {
            let place = members.iter().position(|(value, _)| *value == &flight.value);
            match place {
                Some(place) => members[place].1.push(flight),
                None if members.len() < MOST_VALUES => members.push((&flight.value, vec![flight])),
                None => others.push(flight),
            }
        }
        let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
        members
            .sort_by(|(a, _), (b, _)| number(a).total_cmp(&number(b)).then_with(|| a.to_string().cmp(&b.to_string())));
        let bin = |(value, flights): &(&Value, Vec<&Flight>)| {
            let said = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            self.bin(said, value.as_f64(), value.as_f64(), flights, intervals)
        };
        let rest = (!others.is_empty()).then(|| self.bin("all others".to_owned(), None, None, &others, intervals));
        members.iter().map(bin).chain(rest).collect()
    }

    fn bin(&self, said: String, low: Option<f64>, high: Option<f64>, members: &[&Flight], intervals: Intervals) -> Bin {
        let shares = |law: usize| {
            let total = members.iter().filter(|flight| flight.law == law).count() as u64;
            let count = |is_counted: &dyn Fn(&Flight) -> bool| {
                members.iter().filter(|flight| flight.law == law && is_counted(flight)).count() as u64
            };
            let unknown = count(&|flight| matches!(flight.outcome, Outcome::EndedEarly | Outcome::Undecided));
            BinShares {
                violated: intervals.share(count(&|flight| flight.outcome == Outcome::Violated), unknown, total),
                reached: intervals.share(count(&|flight| flight.reached), 0, total),
            }
        };
        Bin { said, low, high, laws: (0..self.laws).map(shares).collect() }
    }
}
