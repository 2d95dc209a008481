//! What flights showed over the values of a varied key.

use serde::Serialize;
use serde_json::Value;

use super::row::Known;
use super::tally::Intervals;
use super::vary::Variation;
use crate::statistics::Proportion;

/// Intervals that the values of a continuous key are put into.
const INTERVALS: usize = 10;
/// Most single values that are told apart.
const MOST_VALUES: usize = 40;

/// What flights showed over a varied key.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Varied {
    /// The key.
    pub key: String,
    /// Whether it is drawn uniformly in its logarithm.
    pub logarithmic: bool,
    /// Its values, or intervals of them, in increasing order.
    pub bins: Vec<Bin>,
}

/// Flights with one value of a key, or within an interval of its values.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bin {
    /// The value as it is written, or the interval.
    pub said: String,
    /// Its lower end; the value itself; none of words.
    pub low: Option<f64>,
    /// Its upper end; the value itself; none of words.
    pub high: Option<f64>,
    /// What flights of each law showed, in the order of the laws.
    pub laws: Vec<BinShares>,
}

/// What flights of a law showed within a bin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BinShares {
    /// With a violation. Flights of which it is not known count at the upper end of the interval.
    pub violated: Proportion,
    /// With the formation reached and kept.
    pub reached: Proportion,
}

/// The values of a key as they come, with what each flight showed.
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
    known: Known,
    reached: bool,
}

impl KeyColumn {
    /// Nothing yet, of a key that so many laws fly.
    #[must_use]
    pub(super) fn new(key: &str, variation: &Variation, laws: usize) -> Self {
        Self {
            key: key.to_owned(),
            laws,
            is_continuous: matches!(variation, Variation::Uniform(_) | Variation::LogUniform(_) | Variation::Normal(_)),
            is_logarithmic: matches!(variation, Variation::LogUniform(_)),
            is_seed: matches!(variation, Variation::Seed {}),
            flights: Vec::new(),
        }
    }

    /// Takes a flight.
    pub(super) fn take(&mut self, law: usize, value: &Value, known: Known, reached: bool) {
        if !self.is_seed && !matches!(known, Known::NotFlown | Known::Estimated) {
            self.flights.push(Flight { law, value: value.clone(), known, reached });
        }
    }

    /// What they showed; none of seeds, and of nothing flown.
    #[must_use]
    pub(super) fn finish(self, intervals: Intervals) -> Option<Varied> {
        if self.flights.is_empty() {
            return None;
        }
        let is_continuous = self.is_continuous || self.has_many_numbers();
        let bins = if is_continuous { self.spans(intervals) } else { self.values(intervals) };
        Some(Varied { key: self.key, logarithmic: self.is_logarithmic, bins })
    }

    /// Whether its values are numbers, and more than are told apart.
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
            let of = members.iter().filter(|flight| flight.law == law).count() as u64;
            let count = |is: &dyn Fn(&Flight) -> bool| {
                members.iter().filter(|flight| flight.law == law && is(flight)).count() as u64
            };
            let unknown = count(&|flight| flight.known == Known::Unknown);
            BinShares {
                violated: intervals.share(count(&|flight| flight.known == Known::Violated), unknown, of),
                reached: intervals.share(count(&|flight| flight.reached), 0, of),
            }
        };
        Bin { said, low, high, laws: (0..self.laws).map(shares).collect() }
    }
}
