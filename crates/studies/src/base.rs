//! The scenario that a study changes: its text with the overrides of the call, and the seeds of its runs.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::flight::{FlightSummary, Outcome};
use crate::{MOST_RUNS, SEEDS};
use tautline_core::failure::{Failure, in_range};
use tautline_core::option::{RUNS, SEED};
use tautline_core::text::metres;
use tautline_report::request::ScenarioRequest;
use tautline_sim::scenario::{
    ErrorKind, ExternalLaw, Override, Scenario, ScenarioError, Source, Template, takes_integers_only,
};

/// Jitter of a start without randomness along each axis, as a part of delta.
pub const JITTER: f64 = 0.05;

/// Key of the jitter.
pub(crate) const JITTER_KEY: &str = "start.jitter_m";
/// Keys of the seeds of start and flight.
pub(crate) const START_SEED: &str = "start.seed";
pub(crate) const NOISE_SEED: &str = "noise.seed";

/// A scenario that a study reads many times, each time with other overrides.
#[derive(Clone, Debug)]
pub struct BaseScenario {
    source: Source,
    overrides: Vec<Override>,
    template: Template,
}

impl BaseScenario {
    /// Reads a scenario and its overrides.
    ///
    /// # Errors
    /// [`ScenarioError`] if the unchanged scenario is wrong.
    pub fn read(source: Source, overrides: Vec<Override>) -> Result<Self, ScenarioError> {
        let template = Template::read(&source, &overrides)?;
        Ok(Self { source, overrides, template })
    }

    /// Returns the scenario of a request.
    ///
    /// # Errors
    /// [`Failure`] if an override or the scenario is wrong.
    pub fn of(request: &ScenarioRequest) -> Result<Self, Failure> {
        let base = Self::read(request.source.clone(), request.parsed_overrides()?)?;
        base.with_external_law(request.external_law.clone())
    }

    /// Returns the same scenario, whose flights an external law commands.
    ///
    /// # Errors
    /// [`Failure`] `request/law-name` for the name of another law, and for a name that answers cannot show.
    pub fn with_external_law(self, law: Option<ExternalLaw>) -> Result<Self, Failure> {
        law.iter().try_for_each(|law| check_law_name(&self.template, law))?;
        Ok(Self { template: self.template.with_external_law(law), ..self })
    }

    /// Refuses keys of the scenario's own law that an external law replaces.
    ///
    /// # Errors
    /// [`Failure`] that names the key.
    pub fn check_keys<'a>(&self, keys: impl IntoIterator<Item = &'a str>) -> Result<(), Failure> {
        let Some(law) = &self.own().external_law else { return Ok(()) };
        let is_of_law = |key: &&str| (*key == "law" || key.starts_with("law.")) && *key != "law.delta_m";
        let Some(key) = keys.into_iter().find(is_of_law) else { return Ok(()) };
        let name = law.name();
        let message = format!("{key}: changes no flight, because the law `{name}` replaces that of the scenario");
        Err(Failure::input("request/replaced-law", message, "vary another key, or fly the law of the scenario"))
    }

    /// Returns the unchanged scenario.
    #[must_use]
    pub fn own(&self) -> &Scenario {
        self.template.own()
    }

    /// Returns the template for flights under other laws.
    #[must_use]
    pub fn template(&self) -> &Template {
        &self.template
    }

    /// Returns the overrides of the call, as `--set` takes them.
    pub fn sets(&self) -> impl Iterator<Item = String> + '_ {
        self.overrides.iter().map(|set| set.text().to_owned())
    }

    /// Returns the scenario with more overrides.
    ///
    /// # Errors
    /// [`ScenarioError`] if the scenario cannot be flown with these overrides.
    pub fn with(&self, sets: &[String]) -> Result<Scenario, ScenarioError> {
        let more = sets.iter().map(|set| Override::parse(set)).collect::<Result<Vec<_>, _>>()?;
        let scenario = Scenario::read(&self.source, &[self.overrides.as_slice(), &more].concat())?;
        Ok(Scenario { external_law: self.own().external_law.clone(), ..scenario })
    }

    /// Returns whether a key takes integers only.
    #[must_use]
    pub fn takes_integers_only(&self, key: &str) -> bool {
        takes_integers_only(&self.source, &self.overrides, key)
    }
}

/// Seeds of the flights of one value or point. A single flight keeps the seeds of the scenario.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Runs {
    /// Number of flights.
    #[serde(rename = "runs")]
    pub count: u64,
    /// Seed of the first flight; flight k, from 0, has this seed plus k.
    pub seed: u64,
    /// Jitter of a start without randomness \[m\].
    pub jitter_m: Option<f64>,
}

impl Runs {
    /// Returns seeds from `seed` on. Several flights get a jitter of 5 % of delta if neither start nor flight is
    /// random.
    #[must_use]
    pub fn new(count: u64, seed: u64, base: &BaseScenario, is_random: bool) -> Self {
        let moves = count > 1 && !is_random && !base.template().start_is_random();
        Self { count, seed, jitter_m: moves.then(|| JITTER * base.own().delta_m) }
    }

    /// Refuses several equal flights of one value: a key of `keys` sets the seed of all randomness.
    ///
    /// # Errors
    /// [`Failure`] with the remedy.
    pub fn check_seeds(&self, keys: &[&str], base: &BaseScenario, flight_is_random: bool) -> Result<(), Failure> {
        let start_is_random =
            base.template().start_is_random() || self.jitter_m.is_some() || keys.contains(&JITTER_KEY);
        let differ =
            (start_is_random && !keys.contains(&START_SEED)) || (flight_is_random && !keys.contains(&NOISE_SEED));
        let Some(key) = keys.iter().find(|key| [START_SEED, NOISE_SEED].contains(key)) else { return Ok(()) };
        if self.count <= 1 || differ {
            return Ok(());
        }
        let message = format!("{}: must be 1 for values of {key}", RUNS.set(self.count));
        let help = format!("leave {RUNS} out: all runs of one seed are the same flight");
        Err(Failure::input("request/equal-runs", message, help))
    }

    /// Returns the seed of a run, from 0.
    #[must_use]
    pub fn seed(&self, run: u64) -> u64 {
        self.seed.saturating_add(run)
    }

    /// Returns the overrides of a run, from 0. Overrides of varied keys come after these overrides.
    #[must_use]
    pub fn sets(&self, run: u64) -> Vec<String> {
        if self.count <= 1 {
            return Vec::new();
        }
        let seed = self.seed(run);
        let jitter = self.jitter_m.map(|jitter_m| format!("{JITTER_KEY}={jitter_m:?}"));
        [format!("start.seed={seed}"), format!("noise.seed={seed}")].into_iter().chain(jitter).collect()
    }
}

/// Refuses an external law whose name is ambiguous.
pub(crate) fn check_law_name(template: &Template, law: &ExternalLaw) -> Result<(), Failure> {
    let name = law.name();
    let problem = if template.law_names().iter().any(|known| known == name) {
        format!("law: `{name}` is the name of a built-in law")
    } else if name.is_empty() || name.contains(['+', ',']) {
        format!("law: a name must not be empty or contain `+` or `,`, got `{name}`")
    } else {
        return Ok(());
    };
    Err(Failure::input("request/law-name", problem, "give the law another name"))
}

/// Returns whether two keys are the same or one contains the other. An axis may have its name or its number.
pub(crate) fn overlap(one: &str, other: &str) -> bool {
    fn parts(key: &str) -> Vec<&str> {
        let number = |part| match part {
            "x" => "1",
            "y" => "2",
            "z" => "3",
            other => other,
        };
        key.split('.').map(number).collect()
    }
    let (one, other) = (parts(one), parts(other));
    one.starts_with(&other) || other.starts_with(&one)
}

/// Refuses numbers of runs and seeds out of range.
pub(crate) fn check_runs(runs: u64, seed: u64) -> Result<(), Failure> {
    in_range(RUNS, &runs, &(1..=MOST_RUNS))?;
    in_range(SEED, &seed, &SEEDS)
}

/// Returns why a scenario cannot be flown, with its remedy, in a line. The message of a number out of range names the
/// bound, and its help describes the key.
pub(crate) fn refusal(error: ScenarioError) -> String {
    match error.kind {
        ErrorKind::OutOfRange => error.message,
        _ => format!("{}; {}", error.message, error.help),
    }
}

/// Returns the note on the jitter of a start without randomness.
pub(crate) fn jitter_note(jitter_m: f64) -> String {
    format!(
        "the start has no randomness: start.seed moves each coordinate by up to {} m ({} % of delta)",
        metres(jitter_m),
        100.0 * JITTER
    )
}

/// Verdict that a flight must show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Criterion {
    /// The flight is proved clear to its end.
    #[default]
    Clear,
    /// The formation is reached and kept to the end.
    Reached,
    /// The flight is clear and reaches its formation, as far as the scenario requires.
    Pass,
}

impl Criterion {
    /// All questions.
    pub const ALL: [Self; 3] = [Self::Pass, Self::Clear, Self::Reached];

    /// Returns the name for `--verdict`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Clear => "clear",
            Self::Reached => "reached",
        }
    }

    /// Returns the predicates of a flight that shows the verdict and of one that does not.
    #[must_use]
    pub fn words(self) -> [&'static str; 2] {
        match self {
            Self::Pass => ["passes", "fails"],
            Self::Clear => ["stays clear", "does not stay clear"],
            Self::Reached => ["reaches its formation", "does not reach its formation"],
        }
    }

    /// Returns whether a flight shows the verdict.
    #[must_use]
    pub fn holds(self, flight: &FlightSummary) -> bool {
        match self {
            Self::Pass => flight.pass,
            Self::Clear => flight.outcome == Outcome::Clear,
            Self::Reached => flight.reached,
        }
    }
}
