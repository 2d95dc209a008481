//! Search for the worst start, wind or loss within stated bounds: minimises the smallest separation of a flight.
//!
//! [`Options`] define the bounds and fly candidates on all threads. An [`Attack`] holds the worst flight found. A
//! search that finds no violation proves nothing.

mod cma_es;
mod space;
#[cfg(test)]
mod tests;

use std::ops::RangeInclusive;
use std::path::PathBuf;

use serde::Serialize;

pub use space::{Bound, SearchSpace};

use crate::base::BaseScenario;
use crate::batch::Batch;
use crate::flight::{FlightSummary, Outcome};
use crate::study::{About, Block, Experiment, Section, Study};
use crate::table::{Kind, Table};
use cma_es::{Optimiser, folded};
use tautline_core::failure::{Failure, in_range};
use tautline_core::monitor::{Monitor, Quiet};
use tautline_core::option::{self, APART, MOVE_START, SEED, SEEDS, VARY, VELOCITY};
use tautline_core::text::{beside_limit, counted, exact, seconds};
use tautline_report::figures::attack as figure;
use tautline_report::report::page::{Badge, Tone};
use tautline_report::request::{OutFolder, Pictures, RECORDING, RunRequest, ScenarioRequest, run_into};
use tautline_sim::scenario::Scenario;

/// Admitted numbers of flights of a search.
pub const FLIGHTS: RangeInclusive<u64> = 1..=10_000_000;
/// Admitted numbers of seeds of a candidate.
pub const SEEDS_OF_A_CANDIDATE: RangeInclusive<u64> = 1..=10_000;
/// Refused candidates in a row after which the search restarts at another point.
const MOST_REFUSED: usize = 1000;
/// Restarts in a row without a flyable candidate after which the search ends.
const MOST_PLACES: usize = 4;

/// Caveat in every headline.
const CAVEAT: &str = "This is a search, not a proof: worse flights may exist within the bounds.";

/// Assumptions of the numbers.
const ASSUMED: [&str; 3] = [
    CAVEAT,
    "The search minimises the smallest separation of two vehicles, also between samples. Clearances of obstacles are \
     judged, but not minimised.",
    "Bounds are a box: each number varies independently of the others. Candidates that cannot be flown, such as a \
     start of two vehicles within delta, cost no flight.",
];

/// Options of an attack.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Varied keys, each with its bounds.
    pub vary: Vec<Bound>,
    /// Largest displacement of each start from that of the scenario, along each axis \[m\].
    pub start_m: Option<f64>,
    /// Largest change of each initial velocity, along each axis \[m/s\].
    pub velocity_m_s: Option<f64>,
    /// Smallest separation of two starts, more than delta \[m\]; by default any start that can be flown.
    pub apart_m: Option<f64>,
    /// Flights of the whole search: [`FLIGHTS`].
    pub flights: u64,
    /// Flights of each candidate, with consecutive seeds of noise from the scenario's on; the worst one counts:
    /// [`SEEDS_OF_A_CANDIDATE`].
    pub seeds: u64,
    /// Seed of the search.
    pub seed: u64,
    /// Folder for the recording, report and pictures of the worst flight, as `tautline run` writes them.
    pub out: Option<PathBuf>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            vary: Vec::new(),
            start_m: None,
            velocity_m_s: None,
            apart_m: None,
            flights: 1000,
            seeds: 1,
            seed: 0,
            out: None,
        }
    }
}

/// Candidate that was worse than all before it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Candidate {
    /// Number of its flight, from 1.
    pub flight: u64,
    /// Index of the candidate's seed, from 0.
    pub run: u64,
    /// Values, in the order of the bounds.
    pub values: Vec<f64>,
    /// Summary of the flight; its seed is the seed of noise.
    pub flown: FlightSummary,
}

/// Worst flight that a search found. Inapplicable values are null.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Attack {
    /// The scenario, the program and the safety distance.
    #[serde(flatten)]
    pub about: About,
    /// Seed of the search.
    pub seed: u64,
    /// Flights of each candidate; the worst one counts.
    pub seeds: u64,
    /// Requested number of flights.
    pub flights_asked: u64,
    /// Number of flights flown, without the flight of the unchanged scenario.
    pub flights: u64,
    /// Varied numbers with their bounds.
    pub bounds: Vec<Bound>,
    /// Candidates that cannot be flown. They cost no flight.
    pub refused: u64,
    /// Reason of the first refusal.
    pub first_refusal: Option<String>,
    /// Flights with a violation.
    pub violated: u64,
    /// Flights without a violation that ended early.
    pub ended_early: u64,
    /// Flights that the judge cannot decide.
    pub undecided: u64,
    /// Flights with a certificate.
    pub certified: u64,
    /// Flights in which two vehicles came closer than certified. Each shows a defect.
    pub certificates_broken: u64,
    /// Number of restarts at another point.
    pub restarts: u64,
    /// Whether the search ended because too few candidates can be flown.
    pub exhausted: bool,
    /// Whether the search was interrupted before all flights were flown.
    pub interrupted: bool,
    /// Flight of the unchanged scenario.
    pub own: FlightSummary,
    /// Candidates that were each worse than all before, in order; the last is the worst.
    pub progress: Vec<Candidate>,
    /// Overrides that repeat the worst flight, those of the call first.
    pub sets: Vec<String>,
}

impl Experiment for Options {
    type Study = Attack;

    const COMMAND: &'static str = "attack";

    fn check(&self) -> Result<(), Failure> {
        in_range(option::FLIGHTS, &self.flights, &FLIGHTS)?;
        in_range(SEEDS, &self.seeds, &SEEDS_OF_A_CANDIDATE)
    }

    fn arguments(&self, _study: &Attack) -> Vec<String> {
        let vary = self.vary.iter().map(|range| (VARY, range.to_string()));
        let reaches = [(MOVE_START, self.start_m), (VELOCITY, self.velocity_m_s), (APART, self.apart_m)];
        let reaches = reaches.into_iter().filter_map(|(option, by)| Some((option, format!("{:?}", by?))));
        let counts = [(option::FLIGHTS, self.flights), (SEEDS, self.seeds), (SEED, self.seed)];
        let counts = counts.into_iter().map(|(option, count)| (option, count.to_string()));
        vary.chain(reaches).chain(counts).flat_map(|(option, value)| [option.argument(), value]).collect()
    }

    fn fly(&self, base: &BaseScenario, batch: &Batch<'_>) -> Result<Option<Attack>, Failure> {
        base.check_keys(self.vary.iter().map(|bound| bound.key.as_str()))?;
        let space = SearchSpace::new(base, self)?;
        batch
            .monitor()
            .begin(Self::COMMAND, Some(base.own().time.steps().saturating_mul(self.flights.saturating_add(1))));
        let as_it_is = |error| Failure::from(error).under("in the unchanged scenario");
        let Some(own) = batch.fly(base.own(), space.noise_seed(0)).map_err(as_it_is)? else { return Ok(None) };
        let delta_m = base.own().delta_m;
        let mut search = Search {
            space: &space,
            batch,
            optimiser: Optimiser::new(space.bounds().len(), delta_m, self.seed),
            found: Attack {
                about: About::new(base.own()),
                seed: self.seed,
                seeds: self.seeds,
                flights_asked: self.flights,
                flights: 0,
                bounds: space.bounds().to_vec(),
                refused: 0,
                first_refusal: None,
                violated: 0,
                ended_early: 0,
                undecided: 0,
                certified: 0,
                certificates_broken: 0,
                restarts: 0,
                exhausted: false,
                interrupted: false,
                own,
                progress: Vec::new(),
                sets: Vec::new(),
            },
        };
        search.fly()?;
        let Search { optimiser, mut found, .. } = search;
        found.restarts = optimiser.restarts();
        found.interrupted = batch.is_interrupted();
        if let Some(worst) = found.progress.last() {
            found.sets = base.sets().chain(space.sets(&worst.values, worst.run)).collect();
        }
        let is_empty = found.interrupted && found.flights == 0;
        Ok((!is_empty).then_some(found))
    }

    fn prepare(&self, force: bool) -> Result<(), Failure> {
        let Some(path) = self.out.as_deref() else { return Ok(()) };
        // The flight opens the folder again.
        OutFolder::at(path, "run", "report.json").open(force).map(drop)
    }

    fn conclude(
        &self,
        request: &ScenarioRequest,
        study: &Attack,
        pictures: &dyn Pictures,
        monitor: &dyn Monitor,
    ) -> Result<(), Failure> {
        let (Some(out), Some(_), false) = (&self.out, study.worst(), study.interrupted) else { return Ok(()) };
        let own = ScenarioRequest { overrides: study.sets.clone(), ..request.clone() };
        let scenario = own.read()?;
        let run = RunRequest::reproducible(&scenario, request.run_command(&study.sets), out.clone());
        let run = RunRequest { changes: study.sets.clone(), ..run };
        run_into(&run, pictures, &Quiet::new(monitor))?;
        monitor.say(&format!("wrote {} and the report beside it", out.join(RECORDING).display()));
        Ok(())
    }
}

/// Candidate that can be flown.
struct FlyableCandidate {
    /// Coordinates on the real line.
    drawn: Vec<f64>,
    values: Vec<f64>,
    /// Scenario of each seed.
    flights: Vec<Scenario>,
}

/// Running search.
struct Search<'a> {
    space: &'a SearchSpace,
    batch: &'a Batch<'a>,
    optimiser: Optimiser,
    found: Attack,
}

impl Search<'_> {
    /// Flies generations of candidates until the number of flights is reached.
    fn fly(&mut self) -> Result<(), Failure> {
        let (flights, seeds) = (self.found.flights_asked, self.found.seeds);
        while let Some(left) = (flights - self.found.flights).checked_div(seeds).filter(|&left| left > 0) {
            let whole = self.optimiser.population();
            let count = usize::try_from(left).map_or(whole, |left| left.min(whole));
            let Some(next) = self.next(count) else {
                self.found.exhausted = !self.batch.is_interrupted();
                return Ok(());
            };
            let Some(values) = self.values(&next)? else { return Ok(()) };
            if count == whole {
                let drawn: Vec<_> = next.into_iter().map(|next| next.drawn).collect();
                self.optimiser.learn(&drawn, &values);
            }
        }
        Ok(())
    }

    /// Draws candidates that can be flown. Returns `None` if hardly any can.
    fn next(&mut self, count: usize) -> Option<Vec<FlyableCandidate>> {
        for _ in 0..MOST_PLACES {
            let next: Option<Vec<_>> = std::iter::repeat_with(|| self.flyable()).take(count).collect();
            if next.is_some() || self.batch.is_interrupted() {
                return next;
            }
            self.optimiser.restart(1);
        }
        None
    }

    fn flyable(&mut self) -> Option<FlyableCandidate> {
        for _ in 0..MOST_REFUSED {
            if self.batch.is_interrupted() {
                return None;
            }
            let drawn = self.optimiser.draw();
            let values = self.space.values(&drawn.iter().copied().map(folded).collect::<Vec<_>>());
            match self.space.candidate(&values) {
                Ok(flights) => return Some(FlyableCandidate { drawn, values, flights }),
                Err(why) => {
                    self.found.refused += 1;
                    self.found.first_refusal.get_or_insert(why);
                }
            }
        }
        None
    }

    /// Flies candidates and returns the smallest clearance of each. Returns `None` after an interruption.
    fn values(&mut self, next: &[FlyableCandidate]) -> Result<Option<Vec<f64>>, Failure> {
        let flights: Vec<_> = next
            .iter()
            .flat_map(|next| next.flights.iter().enumerate().map(move |(k, flight)| (next, k as u64, flight)))
            .collect();
        let (space, batch) = (self.space, self.batch);
        let flown = batch.run(flights.len(), |number| {
            let (next, k, scenario) = flights[number];
            let flight = batch.fly(scenario, space.noise_seed(k));
            let under = || format!("with {}", space.sets(&next.values, k).join(", "));
            flight.map_err(|error| Failure::from(error).under(&under()))
        })?;
        let mut values = vec![f64::INFINITY; next.len()];
        let seeds = flights.len() / next.len().max(1);
        for (number, flight) in flown.into_iter().enumerate() {
            // An interrupted flight and all later flights do not count.
            let Some(flight) = flight else { return Ok(None) };
            let (candidate, run) = (number / seeds, (number % seeds) as u64);
            values[candidate] = values[candidate].min(flight.clearance_m().unwrap_or(f64::INFINITY));
            self.found.take(flight, run, &next[candidate].values);
        }
        Ok(Some(values))
    }
}

impl Attack {
    /// Counts a flight of a candidate.
    fn take(&mut self, flown: FlightSummary, run: u64, values: &[f64]) {
        self.flights += 1;
        match flown.outcome {
            Outcome::Violated => self.violated += 1,
            Outcome::EndedEarly => self.ended_early += 1,
            Outcome::Undecided => self.undecided += 1,
            Outcome::Clear => {}
        }
        self.certified += u64::from(flown.certified_m.is_some());
        // A scenario that `check` refuses has no certificate.
        self.certificates_broken += u64::from(flown.breaks_certificate && flown.refused.is_empty());
        if self.progress.last().is_none_or(|worst| flown.is_worse_than(&worst.flown)) {
            self.progress.push(Candidate { flight: self.flights, run, values: values.to_vec(), flown });
        }
    }

    /// Returns the worst candidate; `None` if no candidate was flown.
    #[must_use]
    pub fn worst(&self) -> Option<&Candidate> {
        self.progress.last()
    }

    /// Returns whether a flight, the scenario's own included, violated or came closer than certified, or whether no
    /// flight of a candidate was decided.
    #[must_use]
    pub fn is_bad(&self) -> bool {
        let of_own = self.own.outcome == Outcome::Violated || self.own.breaks_certificate;
        let known = self.flights.saturating_sub(self.ended_early + self.undecided);
        of_own || self.violated > 0 || self.certificates_broken > 0 || known == 0
    }

    /// Returns the result as a sentence without a full stop.
    fn result(&self) -> String {
        let flights = counted(self.flights, "flight", "flights");
        let delta = exact(self.about.delta_m);
        let Some(worst) = self.worst() else { return "no flight was flown: every candidate was refused".to_owned() };
        let closest = self.closest(worst);
        if self.violated > 0 {
            return format!("VIOLATION found: {closest} (delta {delta} m); {} of {flights} violated", self.violated);
        }
        if self.own.outcome == Outcome::Violated {
            return format!(
                "VIOLATION in the unchanged scenario; none in {flights} of the search: smallest separation {closest}"
            );
        }
        if self.ended_early + self.undecided >= self.flights {
            return format!("no result: none of {flights} ended with a verdict");
        }
        format!("no violation found in {flights}: smallest separation {closest} (delta {delta} m)")
    }

    /// Returns the closest approach of a candidate: separation, time and vehicles.
    fn closest(&self, worst: &Candidate) -> String {
        let FlightSummary { min_m, min_at_s, min_pair, .. } = &worst.flown;
        let Some(min_m) = *min_m else { return "no two vehicles".to_owned() };
        let shown = beside_limit(min_m, self.about.delta_m, 3);
        let when = min_at_s.map_or_else(String::new, |at_s| format!(" at {}", seconds(at_s)));
        let pair = min_pair.map_or_else(String::new, |[a, b]| format!(", vehicles {a} and {b}"));
        format!("{shown} m{when}{pair}")
    }
}

impl Study for Attack {
    fn kind(&self) -> &'static str {
        "Attack"
    }

    fn title(&self) -> String {
        self.about.scenario.name.clone()
    }

    fn badge(&self) -> Badge {
        let tone = if self.is_bad() { Tone::Bad } else { Tone::Neutral };
        Badge { tone, word: counted(self.flights, "flight", "flights") }
    }

    fn headline(&self) -> String {
        let is_broken = self.certificates_broken > 0 || self.own.breaks_certificate;
        let broken = if is_broken { "CERTIFICATE BROKEN, " } else { "" };
        let interrupted = if self.interrupted { "INTERRUPTED, " } else { "" };
        format!("{broken}{interrupted}{}. {CAVEAT}", self.result())
    }

    fn notes(&self) -> Vec<String> {
        let flights = |count: u64| counted(count, "flight", "flights");
        let flown = format!("{} of {} flights were flown", self.flights, self.flights_asked);
        let mut notes = Vec::new();
        let mut note = |is_noted: bool, text: String| notes.extend(is_noted.then_some(text));
        note(
            self.certificates_broken > 0,
            format!(
                "defect: in {} two vehicles came closer than certified, because of a defect of law, plant or step; \
                 please report it with the command below",
                flights(self.certificates_broken)
            ),
        );
        note(
            self.certified > 0 && self.certified == self.flights && self.certificates_broken == 0,
            "every flight had a certificate and kept it; unlike the search, a certificate is a proof".to_owned(),
        );
        let worst = self.worst().map(|worst| &worst.flown);
        note(
            worst.is_some_and(|worst| {
                worst.outcome == Outcome::Violated && worst.clearance_m().is_some_and(|clearance_m| clearance_m >= 0.0)
            }),
            "the violation is of an obstacle's clearance; the search minimises separations of vehicles only".to_owned(),
        );
        note(self.about.external_law.is_some(), self.about.note().unwrap_or_default());
        note(self.interrupted, format!("interrupted: {flown}"));
        note(
            self.exhausted,
            format!("hardly any candidate within the bounds can be flown: {flown}; narrow the bounds"),
        );
        let first = self.first_refusal.as_ref().map_or_else(String::new, |first| format!(", the first: {first}"));
        let candidates = counted(self.refused, "candidate", "candidates");
        note(self.refused > 0, format!("{candidates} could not be flown and cost no flight{first}"));
        note(
            worst.is_some_and(|worst| worst.min_at_s == Some(0.0)),
            format!("the smallest separation is that of two starts; {APART} keeps starts farther apart"),
        );
        note(
            self.ended_early > 0,
            format!(
                "{} ended early without a violation, and count with their separation up to the end",
                flights(self.ended_early)
            ),
        );
        note(self.undecided > 0, format!("{} undecided", flights(self.undecided)));
        notes
    }

    fn records(&self) -> Table {
        let table = Table::of("Candidates that were worse than all before", &self.progress)
            .column("flight", "Flight", Kind::Count, |row| row.flight)
            .column("noise_seed", "", Kind::Integer, |row| row.flown.seed)
            .column("outcome", "Verdict", Kind::Text, |row| row.flown.outcome.name())
            .column("min", "Separation [m]", Kind::AtLeast, |row| row.flown.min_m)
            .column("min_at", "At [s]", Kind::Exact, |row| row.flown.min_at_s)
            .column("certified", "Certified [m]", Kind::AtLeast, |row| row.flown.certified_m);
        let keys = self.bounds.iter().enumerate();
        keys.fold(table, |table, (k, bound)| {
            table.column(&bound.key, &bound.key, Kind::Exact, |row| row.values.get(k).copied())
        })
        .build()
    }

    fn sections(&self) -> Vec<Section> {
        let found = self.progress.iter().filter_map(|worst| Some((worst.flight, worst.flown.min_m?)));
        let chart = figure(&found.collect::<Vec<_>>(), self.flights, self.about.delta_m, self.own.min_m);
        let own = ("unchanged scenario", &self.own);
        let worst = self.worst().map(|worst| ("worst found", &worst.flown));
        let flights: Vec<_> = std::iter::once(own).chain(worst).collect();
        let flights = Table::of("Unchanged scenario and worst flight found", &flights)
            .column("", "Flight", Kind::Text, |(what, _)| *what)
            .column("", "Separation [m]", Kind::AtLeast, |(_, flown)| flown.min_m)
            .column("", "Certified [m]", Kind::AtLeast, |(_, flown)| flown.certified_m)
            .column("", "Verdict", Kind::Text, |(_, flown)| flown.outcome.name().replace('_', " "))
            .build();
        let worst = |k: usize| self.worst().and_then(|worst| worst.values.get(k).copied());
        let bounds: Vec<_> = self.bounds.iter().enumerate().collect();
        let bounds = Table::of("All other keys keep the values of the scenario", &bounds)
            .column("", "Key", Kind::Text, |(_, bound)| bound.key.clone())
            .column("", "Smallest", Kind::Exact, |(_, bound)| bound.low)
            .column("", "Largest", Kind::Exact, |(_, bound)| bound.high)
            .column("", "Worst", Kind::Exact, |(k, _)| worst(*k))
            .build();
        vec![
            Section::new(
                "How the search went",
                "The smallest separation that the search found, flight by flight.",
                [Block::Figures(vec![chart]), Block::Table(flights)],
            ),
            Section::new(
                "Bounds and the worst within them",
                "The searched keys, and their values in the worst flight.",
                [Block::Table(bounds)],
            ),
        ]
    }

    fn assumptions(&self) -> Vec<String> {
        let seeds = format!(
            "Noise has the seed of the scenario, or with {SEEDS} also the next: a seed does not make a scenario harder."
        );
        ASSUMED.map(str::to_owned).into_iter().chain([seeds]).collect()
    }

    fn is_good(&self) -> bool {
        !self.is_bad() && !self.interrupted
    }

    fn repeats(&self, scenario: &ScenarioRequest) -> Vec<(String, String)> {
        let worst = self.worst().map(|_| ("Repeat the worst flight:".to_owned(), scenario.run_command(&self.sets)));
        worst.into_iter().collect()
    }
}
