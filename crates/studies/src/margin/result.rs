//! What came of it: `margin --json`.

use serde::Serialize;

use super::plan::{Plan, Question};
use super::search::Found;
use crate::compare::{FlightRow, Outcome};
use crate::statistics::{CONFIDENCE, Proportion};
use tautline_report::report::{ScenarioIdentity, Tool};
use tautline_sim::preflight::PredictedMargin;

/// Version of the keys of `margin --json`: raised when one is renamed, removed or changes its meaning.
pub const SCHEMA_VERSION: u32 = 1;

/// How a flight went.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Flown {
    /// Seed of start and noise, where there are several runs.
    pub seed: u64,
    /// Whether it passed.
    pub pass: bool,
    /// How it ended.
    pub outcome: Outcome,
    /// Whether the formation was reached and kept.
    pub reached: bool,
    /// Smallest distance of two centres \[m\].
    pub min_m: Option<f64>,
    /// SHA-256 of the resolved scenario.
    pub scenario_sha256: String,
    /// Hash over the bits of every recorded state.
    pub state_hash: String,
}

/// One value of the key.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Probe {
    /// The value.
    pub value: f64,
    /// Runs that showed what was asked.
    pub held: Proportion,
    /// Smallest distance of all its runs \[m\].
    pub min_m: Option<f64>,
    /// Its runs, in the order of their seeds.
    pub flights: Vec<Flown>,
}

/// Where the verdict turns.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Turn {
    /// The two values that it turns between, the smaller one first.
    pub bracket: [f64; 2],
    /// Whether it holds below.
    pub holds_below: bool,
    /// How often the verdict turned among the values that were looked at first; more than once is a margin that is none.
    pub turns: u64,
}

/// How much of a key a verdict survives. What does not apply is null.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Margin {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// The scenario as its file has it.
    pub scenario: ScenarioIdentity,
    /// What flew it.
    pub tool: Tool,
    /// Safety distance delta \[m\].
    pub delta_m: f64,
    /// The key that was changed.
    pub key: String,
    /// The first and the last value, as they were asked for.
    pub range: [f64; 2],
    /// Whether values were spaced and halved by their ratio.
    pub logarithmic: bool,
    /// What every run of a value had to show.
    pub question: Question,
    /// Runs of each value.
    pub runs: u64,
    /// Seed of the first.
    pub seed: u64,
    /// Whether a start without randomness was moved.
    pub jittered: bool,
    /// How often an interval holds the true value.
    pub confidence: f64,
    /// Where the verdict turns; none where it was the same at every value.
    pub turn: Option<Turn>,
    /// What linear theory predicts for this key near the first formation, as `check` says it; none where there is no theory.
    pub predicted: Vec<PredictedMargin>,
    /// Whether the search was broken off before the bracket was as narrow as asked.
    pub interrupted: bool,
    /// Every value that was tried, in increasing order.
    pub probes: Vec<Probe>,
}

impl Flown {
    pub(super) fn shows(&self, question: Question) -> bool {
        match question {
            Question::Pass => self.pass,
            Question::Clear => self.outcome == Outcome::Clear,
            Question::Reached => self.reached,
        }
    }

    pub(super) fn new(row: &FlightRow) -> Self {
        Self {
            seed: row.seed,
            pass: row.pass,
            outcome: row.outcome,
            reached: row.reached,
            min_m: row.min_m,
            scenario_sha256: row.scenario_sha256.clone(),
            state_hash: row.state_hash.clone(),
        }
    }
}

impl Probe {
    pub(super) fn new(value: f64, question: Question, flights: Vec<Flown>) -> Self {
        let held = flights.iter().filter(|flown| flown.shows(question)).count();
        let min_m = flights.iter().filter_map(|flown| flown.min_m).reduce(f64::min);
        Self { value, held: Proportion::new(held as u64, flights.len() as u64), min_m, flights }
    }

    /// Whether every run showed what was asked.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.held.count == self.held.of
    }

    /// The number of the first run, from 0, that did not show what was asked; of the first of all where all did.
    #[must_use]
    pub fn worst_run(&self, question: Question) -> u64 {
        self.flights.iter().position(|flown| !flown.shows(question)).unwrap_or_default() as u64
    }
}

impl Margin {
    /// Whether the verdict turns or holds everywhere, and the search came to its end.
    #[must_use]
    pub fn is_known(&self) -> bool {
        !self.interrupted && (self.turn.is_some() || self.holds_everywhere())
    }

    pub(super) fn new(plan: &Plan, probes: Vec<Probe>, found: &Found, interrupted: bool) -> Self {
        let (own, range, asked) = (plan.own(), plan.range(), plan.asked());
        let turn = match *found {
            Found::Even(_) => None,
            Found::Turn { before, after, was, turns } => Some(Turn {
                bracket: [before.min(after), before.max(after)],
                holds_below: was == (before < after),
                turns: turns as u64,
            }),
        };
        Self {
            schema_version: SCHEMA_VERSION,
            scenario: ScenarioIdentity { name: own.name.clone(), sha256: own.sha256_hex() },
            tool: Tool { name: tautline_core::PROGRAM.to_owned(), version: tautline_core::VERSION.to_owned() },
            delta_m: own.delta_m,
            key: plan.key().to_owned(),
            range: [range.from, range.to],
            logarithmic: range.logarithmic,
            question: asked.question,
            runs: asked.runs,
            seed: asked.seed,
            jittered: plan.jitters(),
            confidence: CONFIDENCE,
            turn,
            predicted: plan.predicted().to_vec(),
            interrupted,
            probes,
        }
    }

    /// Whether the verdict held at every value that was tried.
    #[must_use]
    pub fn holds_everywhere(&self) -> bool {
        self.probes.iter().all(Probe::holds)
    }

    /// The values on either side of the turn, the one that holds first.
    #[must_use]
    pub fn sides(&self) -> Option<[&Probe; 2]> {
        let Turn { bracket, holds_below, .. } = self.turn?;
        let at = |value: f64| self.probes.iter().find(|probe| probe.value == value);
        let [low, high] = bracket.map(at);
        if holds_below { Some([low?, high?]) } else { Some([high?, low?]) }
    }

    /// `margin --json`.
    ///
    /// # Errors
    /// None in practice: every value has a JSON form.
    pub fn to_json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self).map(|json| json + "\n")
    }
}
