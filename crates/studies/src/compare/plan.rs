//! What is flown.

use tautline_sim::scenario::{Draw, NamedLaw, Scenario, ScenarioError, Template};
use tautline_sim::sim::SimError;

/// A start without randomness is moved by up to this part of delta along each axis.
pub(super) const JITTER: f64 = 0.05;

/// Which laws are flown, from which starts.
#[derive(Clone, Debug)]
pub struct Plan {
    template: Template,
    laws: Vec<NamedLaw>,
    runs: u64,
    seed: u64,
    jitter_m: Option<f64>,
}

/// Why laws cannot be compared.
#[derive(Debug, thiserror::Error)]
pub enum CompareError {
    /// No law to fly.
    #[error("no law is named")]
    NoLaw,
    /// A law that is named twice.
    #[error("the law `{0}` is named twice")]
    Twice(String),
    /// A law that is not known.
    #[error(transparent)]
    Law(ScenarioError),
    /// A start, or a law, that cannot be flown.
    #[error("under the law {law}, start.seed = {seed}: {error}")]
    Scenario {
        /// The law's name.
        law: String,
        /// The start's seed.
        seed: u64,
        /// What is wrong.
        error: ScenarioError,
    },
    /// A law that does not exist here.
    #[error("under the law {law}, start.seed = {seed}: {error}")]
    Flight {
        /// The law's name.
        law: String,
        /// The start's seed.
        seed: u64,
        /// What is wrong.
        error: SimError,
    },
}

impl Plan {
    /// `runs` starts under each of the laws of these names. Run k, from 0, has `start.seed = seed + k`, whatever the file
    /// says, and `noise.seed` too where chance has a part in the flight; a start that does not depend on it gets a jitter of 5 % of delta along each axis.
    ///
    /// # Errors
    /// [`CompareError`] for no law, a law that is not known or named twice, and the first start that cannot be flown.
    pub fn new<S: AsRef<str>>(template: Template, names: &[S], runs: u64, seed: u64) -> Result<Self, CompareError> {
        let mut laws: Vec<NamedLaw> = Vec::new();
        for name in names.iter().map(AsRef::as_ref) {
            if laws.iter().any(|law| law.name == name) {
                return Err(CompareError::Twice(name.to_owned()));
            }
            laws.push(template.law(name).map_err(CompareError::Law)?);
        }
        let jitter_m = (!template.start_is_random()).then(|| JITTER * template.own().delta_m);
        let plan = Self { template, laws, runs, seed, jitter_m };
        let first = plan.laws.first().ok_or(CompareError::NoLaw)?;
        for law in &plan.laws {
            plan.check(law, plan.seed(0))?;
        }
        (1..plan.runs).try_for_each(|run| plan.scenario(first, plan.seed(run)).map(drop))?;
        Ok(plan)
    }

    /// The file that is flown.
    #[must_use]
    pub fn template(&self) -> &Template {
        &self.template
    }

    /// The laws, in the order in which they were named.
    #[must_use]
    pub fn laws(&self) -> &[NamedLaw] {
        &self.laws
    }

    /// Starts under each law.
    #[must_use]
    pub fn runs(&self) -> u64 {
        self.runs
    }

    /// The seed of a run, from 0.
    #[must_use]
    pub fn seed(&self, run: u64) -> u64 {
        self.seed.saturating_add(run)
    }

    /// The jitter along each axis that a start without randomness gets \[m\].
    #[must_use]
    pub fn jitter_m(&self) -> Option<f64> {
        self.jitter_m
    }

    /// Steps of all flights, as far as they are flown to their end.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.template.own().time.steps().saturating_mul(self.flights() as u64)
    }

    pub(super) fn flights(&self) -> usize {
        usize::try_from(self.runs).unwrap_or(usize::MAX).saturating_mul(self.laws.len())
    }

    /// The flight of a law from the start of this seed.
    ///
    /// # Errors
    /// [`CompareError::Scenario`] where it cannot be flown.
    pub fn scenario(&self, law: &NamedLaw, seed: u64) -> Result<Scenario, CompareError> {
        let drawn = self.template.scenario(law, Draw { seed, jitter_m: self.jitter_m });
        drawn.map_err(|error| CompareError::Scenario { law: law.name.clone(), seed, error })
    }

    fn check(&self, law: &NamedLaw, seed: u64) -> Result<(), CompareError> {
        let built = self.scenario(law, seed)?.law();
        built.map(drop).map_err(|error| CompareError::Flight { law: law.name.clone(), seed, error: error.into() })
    }
}
