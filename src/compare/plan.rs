//! What is flown, and flying it.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use super::flight::{FlightRow, fly};
use super::parallel::in_parallel;
use super::result::Comparison;
use crate::scenario::{Draw, NamedLaw, Scenario, ScenarioError, Template};
use crate::sim::SimError;

/// A start without randomness is moved by up to this part of delta along each axis.
pub(super) const JITTER: f64 = 0.05;

/// Steps between two looks at the progress.
const PROGRESS_EVERY: u64 = 64;

/// Which laws are flown, from which starts.
#[derive(Clone, Debug)]
pub struct Plan {
    template: Template,
    laws: Vec<NamedLaw>,
    runs: u64,
    seed: u64,
    jitter_m: Option<f64>,
}

/// Who looks on while flights are flown.
#[derive(Clone, Copy)]
pub struct Watch<'a> {
    /// Told of steps as they are flown.
    pub flown: &'a (dyn Fn(u64) + Sync),
    /// Set from outside: flights under way end, and no other begins.
    pub interrupted: &'a AtomicBool,
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
    /// says; a start that does not depend on it gets a jitter of 5 % of delta along each axis.
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

    fn flights(&self) -> usize {
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

    /// Flies everything on so many threads. The result is the same for any number of them but for
    /// [`Comparison::performance`].
    ///
    /// One that is interrupted is about the starts that were flown under every law, if there are any.
    ///
    /// # Errors
    /// [`CompareError`] for the first flight that does not exist.
    pub fn fly(&self, threads: usize, watch: Watch<'_>) -> Result<Comparison, CompareError> {
        let began = Instant::now();
        // All laws from one start before the next one: an interruption leaves few starts that cannot be compared.
        let flown = in_parallel(self.flights(), threads, &|flight| self.one(flight, watch));
        let mut flights = vec![Vec::new(); self.laws.len()];
        let mut flown = flown.into_iter();
        for _ in 0..self.runs {
            let rows = flown.by_ref().take(self.laws.len()).collect::<Result<Option<Vec<_>>, _>>()?;
            for (law, row) in rows.into_iter().flatten().enumerate() {
                flights[law].push(row);
            }
        }
        Ok(Comparison::new(self, flights, began.elapsed().as_secs_f64()))
    }

    /// A flight by its number; none where it was interrupted.
    fn one(&self, flight: usize, watch: Watch<'_>) -> Result<Option<FlightRow>, CompareError> {
        let stops = || watch.interrupted.load(Ordering::Relaxed);
        if stops() {
            return Ok(None);
        }
        let count = self.laws.len();
        let (seed, law) = (self.seed((flight / count) as u64), &self.laws[flight % count]);
        let scenario = self.scenario(law, seed)?;
        let mut told = 0;
        let mut carry_on = |step: u64| {
            if step.is_multiple_of(PROGRESS_EVERY) {
                (watch.flown)(step - told);
                told = step;
            }
            if stops() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let row = fly(&scenario, seed, &mut carry_on);
        (watch.flown)(scenario.time.steps() - told);
        row.map_err(|error| CompareError::Flight { law: law.name.clone(), seed, error })
    }
}
