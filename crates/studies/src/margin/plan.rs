//! What is flown.

use serde::Serialize;

use super::search::Range;
use tautline_core::text::as_toml;
use tautline_sim::preflight::{PredictedMargin, Preflight};
use tautline_sim::scenario::{Override, Scenario, ScenarioError, Source, Template, takes_integers_only};
use tautline_sim::sim::SimError;

/// Where neither start nor flight has randomness, a start that is flown more than once is moved by up to this part of delta along
/// each axis.
pub(super) const JITTER: f64 = 0.05;

/// What a flight has to show.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Question {
    /// It passes: clear, and its formation reached as far as asked.
    Pass,
    /// No two vehicles come closer than delta, proved to the end of the flight.
    Clear,
    /// The formation is reached and kept to the end.
    Reached,
}

impl Question {
    /// All questions.
    pub const ALL: [Self; 3] = [Self::Pass, Self::Clear, Self::Reached];

    /// The name of the question for `--verdict`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Clear => "clear",
            Self::Reached => "reached",
        }
    }
}

/// What is asked of each value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Asked {
    /// What a flight has to show.
    pub question: Question,
    /// Flights of each value.
    pub runs: u64,
    /// Seed of the first; run k, from 0, has this plus k.
    pub seed: u64,
}

/// A key of a scenario, the values between which a verdict is looked for, and what is asked of each.
#[derive(Clone, Debug)]
pub struct Plan {
    source: Source,
    overrides: Vec<Override>,
    template: Template,
    key: String,
    range: Range,
    /// Whether the key takes whole numbers alone.
    whole: bool,
    asked: Asked,
    /// Overrides for what is drawn in each run.
    jitter: Option<String>,
    predicted: Vec<PredictedMargin>,
}

/// Why there is no such search.
#[derive(Debug, thiserror::Error)]
pub enum MarginError {
    /// Values between which nothing can be looked for.
    #[error("{0}")]
    Range(String),
    /// A value with which the scenario cannot be flown.
    #[error("with {set}: {error}")]
    Scenario {
        /// The key and the value.
        set: String,
        /// What is wrong.
        error: ScenarioError,
    },
    /// A value with which law or judge do not exist.
    #[error("with {set}: {error}")]
    Flight {
        /// The key and the value.
        set: String,
        /// What is wrong.
        error: SimError,
    },
}

impl Question {
    /// What a flight that shows it does, and one that does not.
    #[must_use]
    pub fn words(self) -> [&'static str; 2] {
        match self {
            Self::Pass => ["passes", "fails"],
            Self::Clear => ["stays clear", "does not stay clear"],
            Self::Reached => ["reaches its formation", "does not reach its formation"],
        }
    }
}

impl Plan {
    /// A search over `key`. Flown more than once, run k has the seed `seed` + k for start and noise, and where neither start nor
    /// flight has any randomness, the start gets a jitter of 5 % of delta along each axis; flown once, everything but the key is as the file says.
    ///
    /// The source must be one that can be read again: standard input is read by [`Source::resolve`] once.
    ///
    /// # Errors
    /// [`MarginError`] for a range that is none, and where the scenario cannot be flown at one of its ends.
    pub fn new(
        source: Source,
        overrides: &[Override],
        key: &str,
        range: Range,
        asked: Asked,
    ) -> Result<Self, MarginError> {
        check(range)?;
        let as_it_is = |error| MarginError::Scenario { set: "the keys as they are".to_owned(), error };
        let template = Template::read(&source, overrides).map_err(as_it_is)?;
        // A law that does not exist is told of where it is to be flown.
        let predicted = Preflight::of(template.own()).map(|preflight| preflight.margins).unwrap_or_default();
        let predicted = predicted.into_iter().filter(|margin| is_same(margin.key, key)).collect();
        let (overrides, key) = (overrides.to_vec(), key.to_owned());
        let mut plan = Self { source, overrides, template, key, range, whole: false, asked, jitter: None, predicted };
        let ends = [plan.scenario(range.from, 0)?, plan.scenario(range.to, 0)?];
        plan.whole = takes_integers_only(&plan.source, &plan.overrides, &plan.key);
        let is_random = plan.template.start_is_random() || ends.iter().any(Scenario::is_random_in_flight);
        let moves = asked.runs > 1 && !is_random;
        plan.jitter = moves.then(|| format!("start.jitter_m={:?}", JITTER * plan.own().delta_m));
        Ok(plan)
    }

    /// The scenario without any value of the key.
    #[must_use]
    pub fn own(&self) -> &Scenario {
        self.template.own()
    }

    /// The key.
    #[must_use]
    pub fn key(&self) -> &str {
        &self.key
    }

    /// Between which values.
    #[must_use]
    pub fn range(&self) -> Range {
        self.range
    }

    /// Whether whole numbers alone are looked at, because the key takes nothing else.
    #[must_use]
    pub fn is_whole(&self) -> bool {
        self.whole
    }

    /// What is asked.
    #[must_use]
    pub fn asked(&self) -> Asked {
        self.asked
    }

    /// What linear theory predicts for the key.
    #[must_use]
    pub fn predicted(&self) -> &[PredictedMargin] {
        &self.predicted
    }

    /// Whether a start without randomness is moved.
    #[must_use]
    pub fn jitters(&self) -> bool {
        self.jitter.is_some()
    }

    /// Steps of all flights, as far as a turn is found and they are flown to their end.
    #[must_use]
    pub fn steps(&self) -> u64 {
        let values = self.range.scan as u64 + u64::from(self.range.halvings);
        self.own().time.steps().saturating_mul(values.saturating_mul(self.asked.runs))
    }

    /// The overrides that fly run `run` with a value of the key.
    #[must_use]
    pub fn sets(&self, value: f64, run: u64) -> Vec<String> {
        let mut sets = vec![format!("{}={}", self.key, as_toml(value))];
        if self.asked.runs > 1 {
            let seed = self.asked.seed.saturating_add(run);
            sets.extend([format!("start.seed={seed}"), format!("noise.seed={seed}")]);
            sets.extend(self.jitter.clone());
        }
        sets
    }

    /// The flight of a run with a value of the key.
    ///
    /// # Errors
    /// [`MarginError::Scenario`] where it cannot be flown.
    pub fn scenario(&self, value: f64, run: u64) -> Result<Scenario, MarginError> {
        let set = || format!("{} = {value}", self.key);
        let sets = self.sets(value, run);
        let parsed = sets.iter().map(|set| Override::parse(set)).collect::<Result<Vec<_>, _>>();
        let read = parsed.and_then(|more| Scenario::read(&self.source, &[self.overrides.as_slice(), &more].concat()));
        read.map_err(|error| MarginError::Scenario { set: set(), error })
    }
}

/// Whether two keys are one: how often commands are given has two names.
fn is_same(key: &str, other: &str) -> bool {
    let name = |key: &str| if key == "time.control_hz" { "time.control_hz".to_owned() } else { key.to_owned() };
    name(key) == name(other)
}

/// Refuses a range between whose ends there is nothing.
fn check(range: Range) -> Result<(), MarginError> {
    let Range { from, to, logarithmic, .. } = range;
    let wrong = |why: String| Err(MarginError::Range(why));
    if !from.is_finite() || !to.is_finite() {
        return wrong(format!("a range from {from} to {to}"));
    }
    if from == to {
        return wrong(format!("both ends of the range are {from}"));
    }
    if logarithmic && (from <= 0.0 || to <= 0.0) {
        return wrong(format!("a logarithmic range from {from} to {to}"));
    }
    Ok(())
}
