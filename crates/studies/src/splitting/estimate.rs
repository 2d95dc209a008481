//! The probability that a flight is violated: its settings, one estimate, several of them, and violated flights flown again.

use std::ops::ControlFlow;

use serde::{Deserialize, Serialize};

use super::levels::{Path, Rule, Split, split};
use super::lineage::{Genealogy, Lineage};
use crate::statistics::{CONFIDENCE, Estimate, Proportion};
use tautline_core::record::{Event, RecordError, Sample, Sink, StateHash, Step};
use tautline_report::request::Failure;
use tautline_sim::scenario::Scenario;
use tautline_sim::sim::{Flight, Saved, SimError, Simulation, fly_on};

/// Flights from which on estimates seldom end with nothing.
const ENOUGH: usize = 100;
/// Estimates below which Student's interval of what is skewed is too optimistic to go without a word.
const MANY: usize = 20;

/// Settings of an estimate: the keys of `[splitting]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Flights at a time, n: at least 2, better 100 or more.
    pub flights: usize,
    /// Smallest number of flights that a round ends, k, less than n. 1 is the most accurate for the steps flown.
    pub kill: usize,
    /// Most bad flights that are kept of an estimate.
    pub keep: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self { flights: ENOUGH, kill: 1, keep: 10 }
    }
}

impl Settings {
    /// Refuses numbers that leave no flight to end or to copy.
    ///
    /// # Errors
    /// [`Failure`] `campaign/splitting`.
    pub fn check(&self) -> Result<(), Failure> {
        let &Self { flights, kill, .. } = self;
        let refuse = |problem: String, remedy: &str| Err(Failure::input("campaign/splitting", problem, remedy));
        if flights < 2 {
            return refuse(format!("splitting.flights: must be at least 2, got {flights}"), "give 100 or more");
        }
        if kill == 0 || kill >= flights {
            let most = flights - 1;
            return refuse(
                format!("splitting.kill: must be from 1 to {most}, got {kill}"),
                "give a number in this range",
            );
        }
        Ok(())
    }

    /// What is to be said before so few flights are flown.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        (self.flights < ENOUGH).then(|| warning(self.flights as u64)).flatten()
    }
}

/// What is to be said of so few flights.
fn warning(flights: u64) -> Option<String> {
    (flights < ENOUGH as u64).then(|| {
        format!(
            "{flights} flights at a time are few: where the event is rare, most estimates end at 0 and a few far above the truth, \
             so that their mean is right only over very many of them; take {ENOUGH} or more"
        )
    })
}

/// An estimate of the probability that a flight is violated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Splitting {
    /// Its number under its seed.
    pub repetition: u64,
    /// The estimate, without bias; a single one says nothing of how far off it is: [`Repetitions`] does.
    pub probability: f64,
    /// Flights at a time.
    pub flights: u64,
    /// At least so many were ended in a round.
    pub kill: u64,
    /// Rounds.
    pub iterations: u64,
    /// Whether all flights were ended at once, which makes the estimate 0.
    pub extinct: bool,
    /// Steps flown.
    pub steps: u64,
    /// Some of the flights that were violated in the end. Each stands for as large a part of all that would be, so none is
    /// likelier than another; those of different first ancestors come first, which have the least in common.
    pub bad: Vec<BadFlight>,
}

/// Estimates the probability that a flight of this scenario is violated, over its noise: from its start, which stays the same.
///
/// A flight is violated where two vehicles come nearer than delta, or one nearer to an obstacle than its clearance, between steps
/// too, as its judge says; its score is the largest of -clearance so far ([`Simulation::least_clearance_m`]). A flight that ends
/// early, such as at its law's barrier, is violated if the judge found it so by then, and not for its end.
///
/// The answer depends on the scenario, the settings, `seed` and `repetition` alone. None where `carry_on`, which is asked after each
/// step with the number of all steps, ends it. Memory holds at most ten states a flight ([`Saved`]): 30 kB
/// each for three vehicles, 0.3 MB for a hundred, so that a hundred flights of a hundred vehicles take 0.3 GB.
///
/// # Errors
/// [`Failure`] for settings that leave nothing to split, for a scenario without noise from step to step, and for a law or a judge
/// that cannot be built.
pub fn estimate(
    scenario: &Scenario,
    settings: &Settings,
    [seed, repetition]: [u64; 2],
    carry_on: &mut dyn FnMut(u64) -> ControlFlow<()>,
) -> Result<Option<Splitting>, Failure> {
    check(scenario, settings)?;
    let mut path = Running { scenario, simulation: begun(scenario, scenario.noise_seed)? };
    let rule = Rule::new(settings.flights, settings.kill, 0.0);
    let Some(mut split) = split(&mut path, rule, [seed, repetition], carry_on)? else { return Ok(None) };
    let bad = bad(&mut path, &mut split, settings.keep);
    let Split { probability, iterations, extinct, steps, .. } = split;
    let [flights, kill] = [settings.flights, settings.kill].map(|number| number as u64);
    Ok(Some(Splitting { repetition, probability, flights, kill, iterations, extinct, steps, bad }))
}

/// Refuses what [`estimate`] refuses before it flies.
///
/// # Errors
/// [`Failure`] `campaign/splitting` for settings that leave nothing to split, and for a scenario without noise from step to step.
pub fn check(scenario: &Scenario, settings: &Settings) -> Result<(), Failure> {
    settings.check()?;
    if is_noisy(scenario) {
        return Ok(());
    }
    Err(Failure::input(
        "campaign/splitting",
        "nothing in this flight is random from step to step, and splitting needs two flights from one state to differ",
        "add turbulence (wind.dryden), errors of measurement (sensing.position_noise_m and sensing.rate_hz), or losses or jitter of \
         messages (network.loss, network.jitter_s)",
    ))
}

/// Whether two flights from one state differ: errors that last are drawn once.
fn is_noisy(scenario: &Scenario) -> bool {
    let Scenario { wind, sensing, network, .. } = scenario;
    let errs = sensing.position_noise_m > 0.0 || sensing.velocity_noise_m_s > 0.0;
    let is_lossy = network.loss > 0.0 && network.loss < 1.0;
    wind.turbulence.is_some() || errs || is_lossy || network.jitter_s > 0.0
}

/// A flight under way.
struct Running<'a> {
    scenario: &'a Scenario,
    simulation: Simulation,
}

impl Path for Running<'_> {
    type Saved = Saved;
    type Error = SimError;

    fn begin(&mut self, noise_seed: u64) -> Result<(), SimError> {
        self.simulation = begun(self.scenario, noise_seed)?;
        Ok(())
    }

    fn step(&mut self) -> bool {
        let goes_on = self.simulation.ending().is_none();
        self.simulation.step();
        // What happened is told when the flight is flown again.
        drop(self.simulation.events());
        goes_on
    }

    fn score(&self) -> f64 {
        self.simulation.least_clearance_m().map_or(f64::NEG_INFINITY, |clearance_m| -clearance_m)
    }

    fn save(&self) -> Saved {
        self.simulation.save()
    }

    fn restore(&mut self, saved: &Saved, noise_seed: Option<u64>) {
        self.simulation.load(saved, noise_seed);
    }
}

/// So many of the flights that were violated, those of different first ancestors first.
fn bad(path: &mut Running<'_>, split: &mut Split<Saved>, keep: usize) -> Vec<BadFlight> {
    let hit: Vec<_> = split.lineages.iter().filter(|lineage| lineage.score() > 0.0).collect();
    let ancestor = |lineage: &Lineage<_>| lineage.genealogy().noise_seed;
    let earlier = |index: usize| hit[..index].iter().filter(|other| ancestor(other) == ancestor(hit[index])).count();
    let mut order: Vec<_> = (0..hit.len()).map(|index| (earlier(index), index)).collect();
    order.sort_unstable();
    let kept = order.into_iter().take(keep);
    kept.filter_map(|(_, index)| {
        let violated_at_step = hit[index].last(path)?;
        let simulation = &path.simulation;
        let mut hash = StateHash::new();
        let (time_s, steps) = (simulation.time_s(), simulation.steps());
        hash.observe(&Sample::new(time_s, steps, simulation.state(), simulation.control()));
        Some(BadFlight {
            genealogy: hit[index].genealogy().clone(),
            violated_at_step,
            clearance_m: simulation.least_clearance_m()?,
            state_hash: hash.finish(),
        })
    })
    .collect()
}

/// A flight that was violated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BadFlight {
    /// How it is flown again.
    pub genealogy: Genealogy,
    /// The step in which it was violated, from 1; 0 is the start.
    pub violated_at_step: u64,
    /// The smallest clearance up to there \[m\], below 0.
    pub clearance_m: f64,
    /// SHA-256 over time, positions, velocities and commands after that step, as [`tautline_core::record::StateHash`] has it.
    pub state_hash: String,
}

/// Hash over the state after one step, as [`BadFlight::state_hash`] has it.
#[derive(Clone, Debug)]
pub struct StateAt {
    step: u64,
    seen: u64,
    hash: Option<String>,
}

impl StateAt {
    /// Of the step in which a flight was violated.
    #[must_use]
    pub fn violation_of(flight: &BadFlight) -> Self {
        Self { step: flight.violated_at_step, seen: 0, hash: None }
    }

    /// The hash, once the step has been flown.
    #[must_use]
    pub fn hash(&self) -> Option<&str> {
        self.hash.as_deref()
    }
}

impl Sink for StateAt {
    fn sample(&mut self, _sample: &Sample<'_>) -> Result<(), RecordError> {
        Ok(())
    }

    fn event(&mut self, _event: &Event) -> Result<(), RecordError> {
        Ok(())
    }

    fn step(&mut self, step: &Step<'_>) {
        if self.seen == self.step {
            let mut hash = StateHash::new();
            hash.observe(&Sample::new(step.time_s, self.seen, step.swarm, step.control));
            self.hash = Some(hash.finish());
        }
        self.seen += 1;
    }
}

/// Flies a flight again to its end, with the same bits, and hands what is recorded to `sink`.
///
/// The scenario must be the one that was split.
///
/// # Errors
/// [`SimError`] where law or judge do not exist, or the recording cannot be kept.
pub fn replay(scenario: &Scenario, genealogy: &Genealogy, sink: &mut dyn Sink) -> Result<Flight, SimError> {
    let mut simulation = begun(scenario, genealogy.noise_seed)?;
    let mut branches = genealogy.branches.iter().peekable();
    let mut take_over = |simulation: &mut Simulation| {
        while let Some(branch) = branches.next_if(|branch| branch.step == simulation.steps()) {
            simulation.load(&simulation.save(), Some(branch.noise_seed));
        }
        ControlFlow::Continue(())
    };
    let _goes_on = take_over(&mut simulation);
    fly_on(simulation, sink, &mut take_over)
}

/// The scenario at its start, with the noise of a seed.
fn begun(scenario: &Scenario, noise_seed: u64) -> Result<Simulation, SimError> {
    Simulation::new(&Scenario { noise_seed, ..scenario.clone() })
}

/// The mean of independent estimates of one probability, with its interval.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Repetitions {
    /// Number of estimates.
    pub repetitions: u64,
    /// Their mean, which has no bias, with Student's interval, cut off at 0 and 1. It is that of normal values, and estimates
    /// are skewed, the more the fewer flights each has: `advice` says where that matters.
    pub probability: Estimate,
    /// [`CONFIDENCE`].
    pub confidence: f64,
    /// Estimates that ended with nothing, at 0.
    pub extinct: Proportion,
    /// Steps flown for all of them.
    pub steps: u64,
    /// What is to be said with the interval, if anything.
    pub advice: Vec<String>,
}

impl Repetitions {
    /// Of repetitions under one seed, each of another number.
    #[must_use]
    pub fn new(estimates: &[Splitting]) -> Self {
        let probabilities: Vec<_> = estimates.iter().map(|estimate| estimate.probability).collect();
        let extinct = estimates.iter().filter(|estimate| estimate.extinct).count();
        let all_extinct = extinct == estimates.len();
        let Estimate { value, low, high } = Estimate::mean(&probabilities);
        let low = low.map(|low| low.max(0.0));
        // Where no estimate has found anything there is no spread to tell how much more there may be.
        let high = high.map(|high| high.min(1.0)).filter(|_| !all_extinct);
        let fewest = estimates.iter().map(|estimate| estimate.flights).min();
        let mut advice: Vec<_> = fewest.and_then(warning).into_iter().collect();
        if extinct > 0 {
            advice.push(format!(
                "{extinct} of {} estimates ended with no flight left, at 0: {}; fly more at a time",
                estimates.len(),
                if all_extinct { "there is no upper bound" } else { "the mean rests on the others" }
            ));
        }
        if estimates.len() < MANY {
            advice.push(format!(
                "the interval of {} estimates is that of normal values, which estimates are not; {MANY} or more make it near that",
                estimates.len()
            ));
        }
        Self {
            repetitions: estimates.len() as u64,
            probability: Estimate { value, low, high },
            confidence: CONFIDENCE,
            extinct: Proportion::new(extinct as u64, estimates.len() as u64),
            steps: estimates.iter().map(|estimate| estimate.steps).sum(),
            advice,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(probability: f64, flights: u64) -> Splitting {
        Splitting {
            repetition: 0,
            probability,
            flights,
            kill: 1,
            iterations: 0,
            extinct: probability == 0.0,
            steps: 10,
            bad: Vec::new(),
        }
    }

    #[test]
    fn estimates_are_told_with_what_is_to_be_said_of_them() {
        let many = Repetitions::new(&vec![[estimate(0.25, 100), estimate(0.75, 100)]; 10].concat());
        assert_eq!((many.advice.as_slice(), many.steps, many.probability.value), ([].as_slice(), 200, Some(0.5)));
        // s = 0.2565, t = 2.093 for 19 degrees of freedom.
        assert!(many.probability.low.is_some_and(|low| (low - 0.37996).abs() < 1e-4));
        let few = Repetitions::new(&[estimate(1e-6, 20), estimate(0.0, 20)]);
        assert_eq!((few.probability.low, few.extinct.count, few.advice.len()), (Some(0.0), 1, 3));
        assert!(few.advice[0].contains("20 flights at a time are few") && few.advice[1].contains("1 of 2"));
    }

    #[test]
    fn nothing_found_is_no_bound() {
        let none = Repetitions::new(&vec![estimate(0.0, 100); 30]);
        assert_eq!((none.probability.value, none.probability.high), (Some(0.0), None));
        assert!(none.advice[0].contains("no upper bound"));
    }
}
