//! The margin in words: a sentence, what one must know to read it, and a table for the terminal.

use super::plan::JITTER;
use super::result::{Margin, Probe};
use tautline_core::text::{aligned, at_least, at_most, counted, metres, significant};
use tautline_sim::preflight::{Bound, Near, PredictedMargin};

/// Digits of a share.
const SHARE_DIGITS: u8 = 2;

/// A value of the key, to its last digit: it is to be flown again.
pub(super) fn value(value: f64) -> String {
    value.to_string()
}

/// So many of so many, with the interval of their share where there are several.
pub(super) fn held(probe: &Probe) -> [String; 2] {
    let of = probe.held;
    if of.of == 1 {
        return [if of.count == 1 { "yes" } else { "no" }.to_owned(), String::new()];
    }
    let interval = format!("({} to {})", at_most(of.low, SHARE_DIGITS), at_least(of.high, SHARE_DIGITS));
    [format!("{} of {}", of.count, of.of), interval]
}

/// What is predicted, in words.
pub(super) fn prediction(margin: &PredictedMargin) -> String {
    let bound = if margin.bound == Bound::AtMost { "up to" } else { "from" };
    let state = if margin.state == Near::Free { "where nobody pushes" } else { "where the nearest are in contact" };
    margin.value.map_or_else(|| format!("any {state}"), |value| format!("{bound} {} {state}", significant(value, 4)))
}

impl Margin {
    /// Where the verdict turns, in a sentence.
    #[must_use]
    pub fn headline(&self) -> String {
        let (key, name) = (&self.key, &self.scenario.name);
        let [does, does_not] = self.question.words();
        let [low, high] = [self.range[0].min(self.range[1]), self.range[0].max(self.range[1])].map(value);
        match (self.turn, self.sides()) {
            (Some(turn), Some([holds, fails])) => {
                let below = if turn.holds_below { ["up to", "from"] } else { ["from", "up to"] };
                let runs = match self.runs {
                    1 => "the flight".to_owned(),
                    _ => format!("{} of {}", fails.held.of - fails.held.count, fails.held.of),
                };
                format!(
                    "{name} {does} with {key} {} {}; {runs} {does_not} {} {}",
                    below[0],
                    value(holds.value),
                    below[1],
                    value(fails.value)
                )
            }
            _ if self.holds_everywhere() => {
                format!("{name} {does} at every value of {key} tried, from {low} to {high}")
            }
            _ => format!("{name} {does_not} at any value of {key} tried, from {low} to {high}"),
        }
    }

    /// What one must know to read it, a sentence each.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        let interrupted = self.interrupted.then(|| "interrupted: the bracket is wider than was asked".to_owned());
        let turns = self.turn.filter(|turn| turn.turns > 1).map(|turn| {
            format!(
                "the verdict turns {} times among the values looked at first: the bracket is that of the first turn from {}, \
                 and what lies beyond it is neither safe nor lost",
                turn.turns,
                value(self.range[0])
            )
        });
        let jitter = self.jittered.then(|| {
            format!(
                "neither start nor flight has any randomness: start.seed moves each coordinate by up to {} m ({} % of delta)",
                metres(JITTER * self.delta_m),
                100.0 * JITTER
            )
        });
        [interrupted, turns, jitter].into_iter().flatten().collect()
    }

    /// What linear theory predicts, a sentence each.
    #[must_use]
    pub fn predictions(&self) -> Vec<String> {
        self.predicted.iter().map(|margin| format!("predicted by linear theory: {}", prediction(margin))).collect()
    }

    /// Every value that was tried, as a table.
    #[must_use]
    pub fn text(&self) -> String {
        let interval = if self.runs == 1 { "" } else { "95 % interval" };
        let names = [self.key.as_str(), self.question.words()[0], interval, "smallest separation [m]"];
        let mut rows = vec![names.map(str::to_owned).to_vec()];
        rows.extend(self.probes.iter().map(|probe| {
            let [held, interval] = held(probe);
            vec![value(probe.value), held, interval, probe.min_m.map_or_else(|| "-".to_owned(), metres)]
        }));
        aligned(&rows)
    }

    /// How much was flown.
    pub(super) fn effort(&self) -> String {
        let flights: u64 = self.probes.iter().map(|probe| probe.held.of).sum();
        let values = counted(self.probes.len() as u64, "value", "values");
        format!("{values} of {}, {}", self.key, counted(flights, "flight", "flights"))
    }
}
