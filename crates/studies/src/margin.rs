//! How much of one key a verdict survives: the two values between which it turns, by bisection over seeded flights.

use std::ops::RangeInclusive;

use serde::Serialize;

use crate::base::{BaseScenario, Criterion, JITTER_KEY, Runs, check_runs, jitter_note};
use crate::batch::Batch;
use crate::flight::{FlightSample, FlightSummary};
use crate::statistics::{CONFIDENCE, Proportion};
use crate::study::{About, Block, Experiment, Section, Study};
use crate::table::{Kind, Table};
use tautline_core::failure::{Failure, in_range};
use tautline_core::option::{self, LOG, MARGIN_KEY, RUNS, SCAN, SEED, VERDICT};
use tautline_core::text::{capitalised, counted, shortest, significant};
use tautline_report::figures::{Separation, Share, margin as figure, separations, verdicts};
use tautline_report::report::page::{Badge, Tone};
use tautline_report::request::ScenarioRequest;
use tautline_sim::preflight::{Bound, ContactState, PredictedMargin, Preflight};
use tautline_sim::scenario::Scenario;

/// Sentence below the heading of the figures.
const ABOUT: &str = "The result of the flights over the values of the key, and how close vehicles came.";
/// Admitted numbers of scanned values.
const SCANS: RangeInclusive<usize> = 2..=1000;
/// Admitted numbers of halvings.
const HALVINGS: RangeInclusive<u32> = 0..=50;

/// Most values of identical flights that have a note.
const MOST_NOTES: usize = 3;

/// Assumptions of the numbers.
const ASSUMED: [&str; 3] = [
    "The verdict holds at a value of the key if every run at the value shows it. More runs therefore find a smaller \
     margin.",
    "The range is scanned at a few values first; then the first interval in which the verdict turns is halved. Values \
     are rounded by at most 1 % of the distance to the next. Two turns between neighbouring scanned values stay \
     unnoticed.",
    "Shares have the interval of Clopper and Pearson for a number of runs that was fixed before the first.",
];

/// Options of a search for a margin.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// The varied key, such as `time.control_hz`.
    pub key: String,
    /// Its values.
    pub range: Range,
    /// Verdict that every run must show.
    pub question: Criterion,
    /// Runs of each value: 1 to [`crate::MOST_RUNS`]. A single run changes only the key.
    pub runs: u64,
    /// Seed of the first run; run k, from 0, has this seed plus k for start and noise.
    pub seed: u64,
}

/// Range of values that is searched.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// First value.
    pub from: f64,
    /// Last value.
    pub to: f64,
    /// Number of evenly spaced values, both ends included, that are scanned first: 2 to 1000.
    pub scan: usize,
    /// Number of halvings of the interval in which the verdict turns: 0 to 50.
    pub halvings: u32,
    /// Whether values are spaced and halved by their ratio.
    pub logarithmic: bool,
}

/// One value of the key.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Probe {
    /// The value.
    pub value: f64,
    /// Runs that showed the verdict.
    pub held: Proportion,
    /// Smallest separation of all runs \[m\].
    pub min_m: Option<f64>,
    /// Whether the runs are one flight repeated, because nothing in them is random. The share has no interval then.
    pub repeated: bool,
    /// The runs, in the order of their seeds.
    pub flights: Vec<FlightSummary>,
}

/// Turn of the verdict between two values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct VerdictChange {
    /// The two values between which the verdict turns, the smaller value first.
    pub bracket: [f64; 2],
    /// Whether the verdict holds at the smaller value.
    pub holds_below: bool,
    /// Number of turns among the values that were scanned first.
    pub turns: u64,
}

/// Result of a search for a margin. Inapplicable values are null.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Margin {
    /// The scenario, the program and the safety distance.
    #[serde(flatten)]
    pub about: About,
    /// The varied key.
    pub key: String,
    /// First and last value of the range.
    pub range: [f64; 2],
    /// Whether values were spaced and halved by their ratio.
    pub logarithmic: bool,
    /// Verdict that every run of a value must show.
    pub question: Criterion,
    /// Runs of each value.
    pub runs: u64,
    /// Seed of the first run.
    pub seed: u64,
    /// Whether a start without randomness was moved.
    pub jittered: bool,
    /// Confidence of all intervals.
    pub confidence: f64,
    /// Turn of the verdict; `None` if the verdict is the same at every value.
    pub turn: Option<VerdictChange>,
    /// Predictions of linear theory for this key near the first formation, as in `check`; empty without a theory.
    pub predicted: Vec<PredictedMargin>,
    /// Whether an interruption left the bracket wider than requested.
    pub interrupted: bool,
    /// Every value that was tried, in increasing order.
    pub probes: Vec<Probe>,
    #[serde(skip)]
    seeds: Runs,
}

impl Options {
    /// Returns a search between two values of a key, with single flights, 5 scanned values and 6 halvings. A value
    /// holds if its flight passes.
    #[must_use]
    pub fn new(key: &str, from: f64, to: f64) -> Self {
        let range = Range { from, to, scan: 5, halvings: 6, logarithmic: false };
        Self { key: key.to_owned(), range, question: Criterion::Pass, runs: 1, seed: 0 }
    }

    /// Returns the scenario with a value of the key and the overrides of a run.
    fn scenario(&self, base: &BaseScenario, value: f64, sets: Vec<String>) -> Result<Scenario, Failure> {
        let key = format!("{}={}", self.key, shortest(value));
        let sets: Vec<_> = sets.into_iter().chain([key]).collect();
        base.with(&sets).map_err(|error| Failure::from(error).under(&self.under(value)))
    }

    /// Returns the key with its range, `KEY=FROM..TO`.
    fn key_range(&self) -> String {
        format!("{}={:?}..{:?}", self.key, self.range.from, self.range.to)
    }

    fn under(&self, value: f64) -> String {
        format!("with {} = {value}", self.key)
    }
}

impl Experiment for Options {
    type Study = Margin;

    const COMMAND: &'static str = "margin";

    fn check(&self) -> Result<(), Failure> {
        check_runs(self.runs, self.seed)?;
        in_range(SCAN, &self.range.scan, &SCANS)?;
        in_range(option::HALVINGS, &self.range.halvings, &HALVINGS)?;
        let Range { from, to, logarithmic, .. } = self.range;
        let given = format!("{} from {from:?} to {to:?}", self.key);
        let why = if !from.is_finite() || !to.is_finite() {
            format!("{given}: the range is not finite")
        } else if from == to {
            format!("{given}: both ends of the range are equal")
        } else if logarithmic && (from <= 0.0 || to <= 0.0) {
            format!("{given}: the range is not positive, as {LOG} requires")
        } else {
            return Ok(());
        };
        let help = format!("give two different finite numbers, with {LOG} both more than 0");
        Err(Failure::input("margin/range", why, help))
    }

    fn arguments(&self, _study: &Margin) -> Vec<String> {
        let Self { range, question, runs, seed, .. } = self;
        let mut arguments: Vec<_> = [
            (MARGIN_KEY, self.key_range()),
            (RUNS, runs.to_string()),
            (SEED, seed.to_string()),
            (VERDICT, question.name().to_owned()),
            (SCAN, range.scan.to_string()),
            (option::HALVINGS, range.halvings.to_string()),
        ]
        .into_iter()
        .flat_map(|(option, value)| [option.argument(), value])
        .collect();
        arguments.extend(range.logarithmic.then(|| LOG.argument()));
        arguments
    }

    fn fly(&self, base: &BaseScenario, batch: &Batch<'_>) -> Result<Option<Margin>, Failure> {
        let (own, range) = (base.own(), self.range);
        base.check_keys([self.key.as_str()])?;
        let [from, to] = [range.from, range.to].map(|end| self.scenario(base, end, Vec::new()));
        let ends = [from?, to?];
        let is_random = ends.iter().any(Scenario::is_random_in_flight);
        let runs = Runs::new(self.runs, self.seed, base, is_random || self.key == JITTER_KEY);
        runs.check_seeds(&[&self.key], base, is_random)?;
        // If the law cannot be built, the first flight returns the error.
        let predicted = Preflight::of(own).map(|preflight| preflight.margins).unwrap_or_default();
        let values = range.scan as u64 + u64::from(range.halvings);
        let steps = own.time.steps().saturating_mul(values.saturating_mul(self.runs));
        batch.monitor().begin(Self::COMMAND, Some(steps));
        let mut probes: Vec<Probe> = Vec::new();
        let found = search(range, base.takes_integers_only(&self.key), &mut |value| {
            let flown = batch.run(usize::try_from(self.runs).unwrap_or(usize::MAX), |run| {
                let scenario = self.scenario(base, value, runs.sets(run as u64))?;
                let flight = batch.fly(&scenario, runs.seed(run as u64));
                flight.map_err(|error| Failure::from(error).under(&self.under(value)))
            })?;
            let probe =
                flown.into_iter().collect::<Option<Vec<_>>>().map(|flights| Probe::new(value, self.question, flights));
            let holds = probe.as_ref().map(Probe::holds);
            probes.extend(probe);
            Ok::<_, Failure>(holds)
        })?;
        let interrupted = batch.is_interrupted();
        probes.sort_by(|a, b| a.value.total_cmp(&b.value));
        let Some(found) = found.filter(|found| !matches!(found, Bisection::Even(_)) || !interrupted) else {
            return Ok(None);
        };
        let turn = match found {
            Bisection::Even(_) => None,
            Bisection::VerdictChange { before, after, was, turns } => Some(VerdictChange {
                bracket: [before.min(after), before.max(after)],
                holds_below: was == (before < after),
                turns: turns as u64,
            }),
        };
        Ok(Some(Margin {
            about: About::new(own),
            key: self.key.clone(),
            range: [range.from, range.to],
            logarithmic: range.logarithmic,
            question: self.question,
            runs: self.runs,
            seed: self.seed,
            jittered: runs.jitter_m.is_some(),
            confidence: CONFIDENCE,
            turn,
            predicted: predicted.into_iter().filter(|margin| margin.key == self.key).collect(),
            interrupted,
            probes,
            seeds: runs,
        }))
    }
}

impl Probe {
    fn new(value: f64, question: Criterion, flights: Vec<FlightSummary>) -> Self {
        let sample = FlightSample::new(&flights);
        let (held, repeated) = (sample.share(|flight| question.holds(flight)), sample.is_repeated());
        let min_m = flights.iter().filter_map(|flight| flight.min_m).reduce(f64::min);
        Self { value, held, min_m, repeated, flights }
    }

    /// Returns whether every run showed the verdict.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.held.count == self.held.of
    }

    /// Returns the index of the first run that did not show the verdict; 0 if every run showed it.
    #[must_use]
    pub fn worst_run(&self, question: Criterion) -> u64 {
        self.flights.iter().position(|flight| !question.holds(flight)).unwrap_or_default() as u64
    }
}

impl Margin {
    /// Returns whether the verdict held at every value that was tried.
    #[must_use]
    pub fn holds_everywhere(&self) -> bool {
        self.probes.iter().all(Probe::holds)
    }

    /// Returns the values on either side of the turn; the verdict holds at the first.
    #[must_use]
    pub fn sides(&self) -> Option<[&Probe; 2]> {
        let VerdictChange { bracket, holds_below, .. } = self.turn?;
        let [low, high] = bracket.map(|value| self.probes.iter().find(|probe| probe.value == value));
        if holds_below { Some([low?, high?]) } else { Some([high?, low?]) }
    }
}

/// Returns a prediction of linear theory in words.
fn prediction(margin: &PredictedMargin) -> String {
    let bound = if margin.bound == Bound::AtMost { "up to" } else { "from" };
    let state =
        if margin.state == ContactState::Free { "without contact" } else { "with the nearest pairs in contact" };
    margin.value.map_or_else(|| format!("any {state}"), |value| format!("{bound} {} {state}", significant(value, 4)))
}

impl Study for Margin {
    fn kind(&self) -> &'static str {
        "Margin"
    }

    fn title(&self) -> String {
        format!("{}: {}", self.about.scenario.name, self.key)
    }

    fn badge(&self) -> Badge {
        let flights: u64 = self.probes.iter().map(|probe| probe.held.of).sum();
        let values = counted(self.probes.len() as u64, "value", "values");
        Badge { tone: Tone::Neutral, word: format!("{values}, {}", counted(flights, "flight", "flights")) }
    }

    fn headline(&self) -> String {
        let interrupted = if self.interrupted { "INTERRUPTED: " } else { "" };
        let (key, name) = (&self.key, format!("{interrupted}{}", self.about.scenario.name));
        let [does, does_not] = self.question.words();
        let [low, high] = [self.range[0].min(self.range[1]), self.range[0].max(self.range[1])];
        match (self.turn, self.sides()) {
            (Some(turn), Some([holds, fails])) => {
                let up = if turn.holds_below { "up to" } else { "from" };
                let runs = if self.runs == 1 {
                    "it".to_owned()
                } else {
                    let failed = fails.held.of - fails.held.count;
                    format!("in {failed} of {} it", counted(fails.held.of, "flight", "flights"))
                };
                format!("{name} {does} with {key} {up} {}; {runs} {does_not} at {}", holds.value, fails.value)
            }
            _ if self.holds_everywhere() => {
                format!("{name} {does} at every value of {key} tried, from {low} to {high}")
            }
            _ => format!("{name} {does_not} at any value of {key} tried, from {low} to {high}"),
        }
    }

    fn notes(&self) -> Vec<String> {
        let predicted =
            self.predicted.iter().map(|margin| format!("predicted by linear theory: {}", prediction(margin)));
        let interrupted = self.interrupted.then(|| "interrupted: the bracket is wider than requested".to_owned());
        let turns = self.turn.filter(|turn| turn.turns > 1).map(|turn| {
            format!(
                "the verdict turns {} times among the values scanned first: the bracket is of the first turn from {} \
                 on, and later turns were not searched",
                turn.turns, self.range[0]
            )
        });
        let jitter = self.seeds.jitter_m.map(jitter_note);
        let identical = self.probes.iter().filter_map(|probe| {
            FlightSample::new(&probe.flights).note(&format!("with {} = {}", self.key, probe.value))
        });
        let notes = [interrupted, turns, jitter, self.about.note()].into_iter().flatten();
        predicted.chain(notes).chain(identical.take(MOST_NOTES)).collect()
    }

    fn records(&self) -> Table {
        let does = capitalised(self.question.words()[0]);
        Table::of(if self.runs == 1 { "One flight each" } else { "With 95 % intervals" }, &self.probes)
            .column(&self.key, &self.key, Kind::Exact, |probe| probe.value)
            .column("runs", "", Kind::Count, |probe| probe.held.of)
            .column("held", &does, if self.runs == 1 { Kind::OneFlight } else { Kind::Share }, |probe| probe.held)
            .column("min", "Smallest separation [m]", Kind::AtLeast, |probe| probe.min_m)
            .column("repeated", "", Kind::Flag, |probe| probe.repeated)
            .build()
    }

    fn sections(&self) -> Vec<Section> {
        let lengths = self.probes.iter().filter_map(|probe| {
            let median_m = FlightSample::new(&probe.flights).quantile(|flight| flight.min_m, 0.5);
            let interval_m = median_m.low.zip(median_m.high).map(|(low, high)| [low, high]);
            let (value, flights) = (probe.value, probe.held.of);
            Some(Separation { value, flights, smallest_m: probe.min_m?, median_m: median_m.value?, interval_m })
        });
        let lengths: Vec<_> = lengths.collect();
        let (delta_m, bracket, words) = (self.about.delta_m, self.turn.map(|turn| turn.bracket), self.question.words());
        let predicted = self.predicted.iter().filter_map(|margin| Some((margin.value?, prediction(margin))));
        let predicted = predicted.collect::<Vec<_>>();
        // A share of one flight is its verdict, which the marks of the separations show.
        let figures = if self.runs == 1 && lengths.len() == self.probes.len() {
            let flights: Vec<_> = lengths.into_iter().zip(self.probes.iter().map(Probe::holds)).collect();
            vec![verdicts(&flights, &self.key, words, delta_m, bracket, &predicted, self.logarithmic)]
        } else {
            let shares = self.probes.iter().map(|probe| Share {
                value: probe.value,
                share: probe.held.share.unwrap_or(f64::NAN),
                interval: (self.runs > 1).then_some([probe.held.low, probe.held.high]),
            });
            let shares = shares.collect::<Vec<_>>();
            let chart = figure(&shares, &self.key, words[0], bracket, &predicted, self.logarithmic);
            let separation = (!lengths.is_empty())
                .then(|| separations("separation", &self.key, &lengths, delta_m, self.logarithmic));
            std::iter::once(chart).chain(separation).collect()
        };
        vec![
            Section::new("Where the verdict turns", ABOUT, [Block::Figures(figures)]),
            Section::new(
                "Every value tried",
                "A row for each value of the key, over all its flights.",
                [Block::Table(self.records())],
            ),
        ]
    }

    fn assumptions(&self) -> Vec<String> {
        ASSUMED.map(str::to_owned).to_vec()
    }

    fn is_good(&self) -> bool {
        !self.interrupted && (self.turn.is_some() || self.holds_everywhere())
    }

    fn repeats(&self, scenario: &ScenarioRequest) -> Vec<(String, String)> {
        let side = |(probe, what): (&Probe, &str)| {
            let key = format!("{}={}", self.key, shortest(probe.value));
            let sets: Vec<_> = self.seeds.sets(probe.worst_run(self.question)).into_iter().chain([key]).collect();
            (format!("A flight that {what}:"), scenario.command("run", [], &sets))
        };
        self.sides().into_iter().flat_map(|sides| sides.into_iter().zip(self.question.words())).map(side).collect()
    }
}

/// Result of a bisection.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Bisection {
    /// The answer is the same at every value that was tried.
    Even(bool),
    /// The answer turns between two values.
    VerdictChange {
        /// The last value with the answer of the first value.
        before: f64,
        /// The first value with the other answer.
        after: f64,
        /// The answer of the first value.
        was: bool,
        /// Number of turns among the values that were scanned first.
        turns: usize,
    },
}

/// Largest rounding of a value, relative to its distance from the neighbouring values.
const ROUNDING: f64 = 0.01;

/// Rounds a value to a multiple of the largest power of ten that is at most `step`. The result has few digits, so
/// texts show it exactly.
fn shortened(value: f64, step: f64) -> f64 {
    // Doubles hold powers of ten up to 10^22 exactly, so the result is the double nearest to the decimal number.
    const EXACT: f64 = 22.0;
    let exponent = step.log10().floor();
    if exponent.is_nan() || exponent.abs() > EXACT {
        return value;
    }
    let power = libm::pow(10.0, exponent.abs()).round();
    if exponent < 0.0 { (value * power).round() / power } else { (value / power).round() * power }
}

/// Calls `ask` at evenly spaced values, then halves the first interval in which the answer turns. With `integers`,
/// calls `ask` only at integers, at each at most once.
///
/// A missing answer ends the search with the result so far; the result is `None` if no turn is known and a value of the
/// scan has no answer.
fn search<E>(
    range: Range,
    integers: bool,
    ask: &mut dyn FnMut(f64) -> Result<Option<bool>, E>,
) -> Result<Option<Bisection>, E> {
    // `part` is the share between neighbouring values.
    let between = |from: f64, to: f64, share: f64, part: f64| {
        let value_at = |share: f64| {
            if range.logarithmic { from * libm::pow(to / from, share) } else { from + (to - from) * share }
        };
        let value = value_at(share);
        let gap = (value - value_at(share - part)).abs().min((value_at(share + part) - value).abs());
        if integers { value.round() } else { shortened(value, ROUNDING * gap) }
    };
    let last = range.scan.max(2) - 1;
    let value = |k: usize| match k {
        0 => range.from,
        _ if k == last => range.to,
        _ => between(range.from, range.to, k as f64 / last as f64, 1.0 / last as f64),
    };
    let mut values: Vec<_> = (0..=last).map(value).collect();
    values.dedup();
    let mut scanned: Vec<(f64, bool)> = Vec::with_capacity(values.len());
    for &value in &values {
        match ask(value)? {
            Some(answer) => scanned.push((value, answer)),
            None => break,
        }
    }
    let Some(&(_, was)) = scanned.first() else { return Ok(None) };
    let turns = || scanned.windows(2).filter(|pair| pair[0].1 != pair[1].1);
    let Some(turn) = turns().next() else {
        return Ok(Some(Bisection::Even(was)).filter(|_| scanned.len() == values.len()));
    };
    let (mut before, mut after) = (turn[0].0, turn[1].0);
    for _ in 0..range.halvings {
        let middle = between(before, after, 0.5, 0.5);
        // `before` and `after` are neighbouring numbers.
        if middle == before || middle == after {
            break;
        }
        match ask(middle)? {
            Some(answer) if answer == was => before = middle,
            Some(_) => after = middle,
            None => break,
        }
    }
    Ok(Some(Bisection::VerdictChange { before, after, was, turns: turns().count() }))
}

#[cfg(test)]
mod tests;
