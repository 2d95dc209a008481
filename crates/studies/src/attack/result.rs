//! What came of it: `attack --json`.

use serde::Serialize;

use super::bounds::Bound;
use super::method::Method;
use super::plan::Plan;
use crate::compare::{FlightRow, Outcome};
use tautline_report::report::{ScenarioIdentity, Tool};

/// Version of the keys of `attack --json`: raised when one is renamed, removed or changes its meaning.
pub const SCHEMA_VERSION: u32 = 2;

/// How a flight went.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Flown {
    /// How it ended.
    pub outcome: Outcome,
    /// Whether `tautline run` would say pass.
    pub pass: bool,
    /// Why it ended before its time.
    pub ended_early: Option<String>,
    /// Smallest distance of two centres \[m\].
    pub min_m: Option<f64>,
    /// When that was \[s\].
    pub min_at_s: Option<f64>,
    /// Which two.
    pub min_pair: Option<[usize; 2]>,
    /// What the law's certificate promised of this flight \[m\].
    pub certified_m: Option<f64>,
    /// Whether two came closer than that, by more than integration may cost: a defect.
    pub breaks_certificate: bool,
    /// Codes by which `tautline check` refuses it; it was flown all the same.
    pub refused: Vec<String>,
    /// Seed of the noise.
    pub noise_seed: u64,
    /// SHA-256 of the resolved scenario.
    pub scenario_sha256: String,
    /// Hash over the bits of every recorded state.
    pub state_hash: String,
}

/// A candidate that was worse than all before it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Candidate {
    /// The number of its flight, from 1.
    pub flight: u64,
    /// Which of the candidate's seeds, from 0.
    pub run: u64,
    /// Its values, in the order of the bounds.
    pub values: Vec<f64>,
    /// How it went.
    pub flown: Flown,
}

/// The worst that a search found. What does not apply is null.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Attack {
    /// [`SCHEMA_VERSION`].
    pub schema_version: u32,
    /// The scenario as its file has it.
    pub scenario: ScenarioIdentity,
    /// What flew it.
    pub tool: Tool,
    /// Safety distance delta \[m\].
    pub delta_m: f64,
    /// How candidates were found.
    pub method: Method,
    /// Seed of the search.
    pub seed: u64,
    /// Flights of each candidate, of which the worst counts.
    pub seeds: u64,
    /// Flights that were asked for.
    pub flights_asked: u64,
    /// Flights that were flown, that of the scenario as it is not among them.
    pub flights: u64,
    /// Each number that was free, and its bounds.
    pub bounds: Vec<Bound>,
    /// Candidates that could not be flown; they cost no flight.
    pub refused: u64,
    /// Why the first of them could not be.
    pub first_refusal: Option<String>,
    /// Flights with a violation.
    pub violated: u64,
    /// Flights without a violation that were not flown to their end.
    pub ended_early: u64,
    /// Flights that the judge could not tell about.
    pub undecided: u64,
    /// Flights that a certificate held for.
    pub certified: u64,
    /// Flights in which two came closer than the certificate promised: each shows a defect.
    pub certificates_broken: u64,
    /// How often the search began again from elsewhere.
    pub restarts: u64,
    /// Whether it ended for want of candidates that can be flown.
    pub exhausted: bool,
    /// Whether it was broken off before the flights were spent.
    pub interrupted: bool,
    /// The scenario as it is.
    pub own: Flown,
    /// Candidates that were each worse than all before; the last is the worst.
    pub progress: Vec<Candidate>,
    /// The overrides that fly the worst again by themselves, those of the call first.
    pub sets: Vec<String>,
}

/// What is known of a search under way.
#[derive(Debug, Default)]
pub(super) struct Found {
    pub(super) flights: u64,
    pub(super) refused: u64,
    pub(super) first_refusal: Option<String>,
    pub(super) exhausted: bool,
    violated: u64,
    ended_early: u64,
    undecided: u64,
    certified: u64,
    certificates_broken: u64,
    progress: Vec<Candidate>,
}

impl Flown {
    pub(super) fn new(row: &FlightRow) -> Self {
        Self {
            outcome: row.outcome,
            pass: row.pass,
            ended_early: row.ended_early.clone(),
            min_m: row.min_m,
            min_at_s: row.min_at_s,
            min_pair: row.min_pair,
            certified_m: row.certified_m,
            breaks_certificate: row.breaks_certificate,
            refused: row.refused.clone(),
            noise_seed: row.seed,
            scenario_sha256: row.scenario_sha256.clone(),
            state_hash: row.state_hash.clone(),
        }
    }

    /// Whether it is worse than another: a violation before none, then the smaller separation.
    fn is_worse_than(&self, other: &Self) -> bool {
        let rank = |flown: &Self| (flown.outcome != Outcome::Violated, flown.min_m.unwrap_or(f64::INFINITY));
        let ((calm, min_m), (other_calm, other_min_m)) = (rank(self), rank(other));
        (!calm && other_calm) || (calm == other_calm && min_m < other_min_m)
    }
}

impl Found {
    /// Takes note of a flight.
    pub(super) fn take(&mut self, row: &FlightRow, candidate: impl FnOnce(u64) -> Candidate) {
        self.flights += 1;
        match row.outcome {
            Outcome::Violated => self.violated += 1,
            Outcome::EndedEarly => self.ended_early += 1,
            Outcome::Undecided => self.undecided += 1,
            Outcome::Clear => {}
        }
        self.certified += u64::from(row.certified_m.is_some());
        // What was refused beforehand is not the motion of the law, and promised nothing.
        self.certificates_broken += u64::from(row.breaks_certificate && row.refused.is_empty());
        let candidate = candidate(self.flights);
        if self.progress.last().is_none_or(|worst| candidate.flown.is_worse_than(&worst.flown)) {
            self.progress.push(candidate);
        }
    }
}

impl Attack {
    pub(super) fn new(plan: &Plan, own: Flown, found: Found, restarts: u64, interrupted: bool) -> Self {
        let (scenario, asked) = (plan.own(), plan.asked());
        let sets = found.progress.last().map(|worst| {
            let of_call = plan.overrides().iter().map(|set| set.text().to_owned());
            of_call.chain(plan.sets(&worst.values, worst.run)).collect()
        });
        Self {
            schema_version: SCHEMA_VERSION,
            scenario: ScenarioIdentity { name: scenario.name.clone(), sha256: scenario.sha256_hex() },
            tool: Tool { name: tautline_core::PROGRAM.to_owned(), version: tautline_core::VERSION.to_owned() },
            delta_m: scenario.delta_m,
            method: asked.method,
            seed: asked.seed,
            seeds: asked.seeds,
            flights_asked: asked.flights,
            flights: found.flights,
            bounds: plan.bounds().to_vec(),
            refused: found.refused,
            first_refusal: found.first_refusal,
            violated: found.violated,
            ended_early: found.ended_early,
            undecided: found.undecided,
            certified: found.certified,
            certificates_broken: found.certificates_broken,
            restarts,
            exhausted: found.exhausted,
            interrupted,
            own,
            progress: found.progress,
            sets: sets.unwrap_or_default(),
        }
    }

    /// The worst candidate; none where none could be flown.
    #[must_use]
    pub fn worst(&self) -> Option<&Candidate> {
        self.progress.last()
    }

    /// Whether a flight violated, or came closer than its certificate, the scenario's own among them; or whether too little was
    /// flown to its end to say that none did.
    #[must_use]
    pub fn is_bad(&self) -> bool {
        let of_own = self.own.outcome == Outcome::Violated || self.own.breaks_certificate;
        let known = self.flights.saturating_sub(self.ended_early + self.undecided);
        of_own || self.violated > 0 || self.certificates_broken > 0 || known == 0
    }

    /// `attack --json`.
    ///
    /// # Errors
    /// None in practice: every value has a JSON form.
    pub fn to_json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self).map(|json| json + "\n")
    }
}
