//! Every claim of ours and of the paper, judged by measurement.
//!
//! [`validate`] flies and computes everything anew and returns [`Claim`]s in a fixed order. Claims and trials run side by
//! side on the threads of the current rayon pool; every random start has a stream of its own and every sum is taken in
//! index order, so the answer does not depend on the number of threads.
//!
//! A statement of the paper that fails is reported as refuted, with our own measurement: what must hold then is the
//! refutation. [`Validation::pass`] asks every claim to be as expected.

mod certificate;
mod claim;
mod detectors;
mod equilibria;
mod experiments;
mod figures;
mod flights;
mod html;
mod ladder;
mod law;
mod page;
mod rates;
mod starts;
mod tension;

pub use claim::{Claim, Kind, Values};
pub use ladder::Rung;

use std::time::Instant;

use rayon::prelude::*;
use serde::Serialize;

use crate::continuous::IdealError;
use crate::figures::Figure;
use crate::law::{LawError, ParameterError, TensionError};
use crate::plant::PlantError;
use crate::scenario::ScenarioError;
use crate::sim::{Ending, SimError};

/// Version of the keys of `validate.json`: raised when one is renamed, removed or changes its meaning.
pub const SCHEMA_VERSION: u32 = 1;

/// Claims about one thing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Group {
    /// Stable name.
    pub id: &'static str,
    /// What they are about.
    pub title: &'static str,
    /// The claims.
    pub claims: Vec<Claim>,
}

/// The result of [`validate`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Validation {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// What judged.
    pub tool: Tool,
    /// Whether every claim is as expected.
    pub pass: bool,
    /// All claims.
    pub groups: Vec<Group>,
    /// Rapier against continuous time, from coarse to fine steps.
    pub ladder: Vec<Rung>,
    /// The paper's figures, and the ladder's.
    #[serde(skip)]
    pub figures: Vec<Figure>,
    /// Wall-clock time: the only part that differs from run to run.
    pub performance: Performance,
}

/// The program that judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Tool {
    /// Its name.
    pub name: &'static str,
    /// Its version.
    pub version: &'static str,
}

/// Wall-clock time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Performance {
    /// From start to end \[s\].
    pub wall_s: f64,
}

/// Why claims could not be tried. None of these can happen in a program that works.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ValidateError {
    /// A tension does not exist.
    #[error(transparent)]
    Tension(#[from] TensionError),
    /// A law cannot be made.
    #[error(transparent)]
    Parameter(#[from] ParameterError),
    /// A law has no answer.
    #[error(transparent)]
    Law(#[from] LawError),
    /// A scenario cannot be flown.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// There is no solution in continuous time.
    #[error(transparent)]
    Ideal(#[from] IdealError),
    /// A plant could not carry out a step.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// A flight failed.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// A flight ended before its time.
    #[error("the flight of {scenario} ended early, at {time_s} s: {ending:?}")]
    EndedEarly {
        /// Name of the scenario.
        scenario: String,
        /// When \[s\].
        time_s: f64,
        /// How.
        ending: Ending,
    },
}

/// Counts finished work, from any thread.
#[derive(Clone, Copy)]
pub(crate) struct Progress<'a>(&'a (dyn Fn(u64) + Sync));

impl Progress<'_> {
    fn advance(&self, units: u64) {
        (self.0)(units);
    }
}

/// A file of claims: its name, its subject, the units of work that it counts, and its judgement.
struct Part {
    id: &'static str,
    title: &'static str,
    work: u64,
    judge: fn(&Progress<'_>) -> Result<Vec<Claim>, ValidateError>,
}

const PARTS: [Part; 6] = [
    Part { id: "tension", title: "The edge tension", work: 1, judge: tension::judge },
    Part { id: "law", title: "The law at single instants", work: 1, judge: law::judge },
    Part {
        id: "certificate",
        title: "Energy and certificate",
        work: certificate::STARTS as u64 + 1,
        judge: certificate::judge,
    },
    Part { id: "figures", title: "The paper's figures", work: 6, judge: experiments::judge },
    Part {
        id: "equilibria",
        title: "Where the law comes to rest",
        work: equilibria::FLIGHTS,
        judge: equilibria::judge,
    },
    Part { id: "rates", title: "Rates near the formation", work: 5, judge: rates::judge },
];
/// The ladder in both precisions, free motion, and three flights.
const ENGINE_WORK: u64 = 2 * ladder::STEPS_HZ.len() as u64 + 1 + 3;

const ENGINE_TITLE: &str = "The engine against continuous time";

/// Units of work that [`validate`] counts in all.
#[must_use]
pub fn work() -> u64 {
    PARTS.iter().map(|part| part.work).sum::<u64>() + ENGINE_WORK
}

/// Judges every claim. `progress` is told how many further units of [`work`] are done, from any thread.
///
/// Claims that cannot be tried, because a flight of theirs fails, stand as one that fails.
#[must_use]
pub fn validate(progress: &(dyn Fn(u64) + Sync)) -> Validation {
    let (began, progress) = (Instant::now(), Progress(progress));
    let parts = || {
        let judged = PARTS.par_iter().map(|part| group(part.id, part.title, (part.judge)(&progress)));
        judged.collect::<Vec<_>>()
    };
    let engine = || -> Result<_, ValidateError> {
        Ok((ladder::climb(&progress)?, ladder::free_decay(&progress)?, detectors::flights(&progress)?))
    };
    let (mut groups, engine) = rayon::join(parts, engine);
    let engine = engine.and_then(|(ladder, free_decay, flights)| {
        let figures = figures::draw(&flights, &ladder)?;
        Ok((ladder, free_decay, flights, figures))
    });
    let (ladder, figures) = match engine {
        Ok((ladder, free_decay, flights, figures)) => {
            let mut claims = ladder::claims(&ladder);
            claims.push(free_decay);
            groups.push(Group { id: "engine", title: ENGINE_TITLE, claims });
            let claims = detectors::claims(&flights);
            groups.push(Group { id: "detectors", title: "The engine and the judges", claims });
            (ladder, figures)
        }
        Err(error) => {
            groups.push(group("engine", ENGINE_TITLE, Err(error)));
            (Vec::new(), Vec::new())
        }
    };
    Validation {
        schema_version: SCHEMA_VERSION,
        tool: Tool { name: env!("CARGO_PKG_NAME"), version: env!("CARGO_PKG_VERSION") },
        pass: groups.iter().flat_map(|group| &group.claims).all(|claim| claim.pass),
        groups,
        ladder,
        figures,
        performance: Performance { wall_s: began.elapsed().as_secs_f64() },
    }
}

fn group(id: &'static str, title: &'static str, judged: Result<Vec<Claim>, ValidateError>) -> Group {
    let claims = judged.unwrap_or_else(|error| vec![Claim::untried(&error)]);
    Group { id, title, claims }
}

impl Validation {
    /// All claims in their order.
    pub fn claims(&self) -> impl Iterator<Item = &Claim> {
        self.groups.iter().flat_map(|group| &group.claims)
    }

    /// The claim of this id.
    #[must_use]
    pub fn claim(&self, id: &str) -> Option<&Claim> {
        self.claims().find(|claim| claim.id == id)
    }

    /// `validate.json`.
    ///
    /// # Errors
    /// When the result cannot be written as JSON, which its types rule out.
    pub fn to_json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self).map(|json| json + "\n")
    }
}
