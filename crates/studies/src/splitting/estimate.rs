//! The probability that a flight is violated.

use std::ops::ControlFlow;

use serde::{Deserialize, Serialize};

use super::bad::{BadFlight, begun};
use super::levels::{Rule, Split, split};
use super::lineage::Lineage;
use super::path::Path;
use super::settings::{Settings, SplittingError};
use tautline_core::record::{Sample, StateHash};
use tautline_sim::scenario::Scenario;
use tautline_sim::sim::{Saved, SimError, Simulation};

/// An estimate of the probability that a flight is violated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Splitting {
    /// Its number under its seed.
    pub repetition: u64,
    /// The estimate, without bias; a single one says nothing of how far off it is: [`super::Repetitions`] does.
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
/// [`SplittingError`] for settings that leave nothing to split, a scenario without noise from step to step, or one without law or
/// judge.
pub fn estimate(
    scenario: &Scenario,
    settings: &Settings,
    [seed, repetition]: [u64; 2],
    carry_on: &mut dyn FnMut(u64) -> ControlFlow<()>,
) -> Result<Option<Splitting>, SplittingError> {
    check(scenario, settings)?;
    let mut path = Flown { scenario, simulation: begun(scenario, scenario.noise_seed)? };
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
/// [`SplittingError`] for settings that leave nothing to split, and a scenario without noise from step to step.
pub fn check(scenario: &Scenario, settings: &Settings) -> Result<(), SplittingError> {
    settings.check()?;
    if is_noisy(scenario) { Ok(()) } else { Err(SplittingError::NoNoise) }
}

/// Whether two flights from one state differ: errors that last are drawn once.
fn is_noisy(scenario: &Scenario) -> bool {
    let Scenario { wind, sensing, network, .. } = scenario;
    let errs = sensing.position_noise_m > 0.0 || sensing.velocity_noise_m_s > 0.0;
    let is_lossy = network.loss > 0.0 && network.loss < 1.0;
    wind.turbulence.is_some() || errs || is_lossy || network.jitter_s > 0.0
}

/// A flight under way.
struct Flown<'a> {
    scenario: &'a Scenario,
    simulation: Simulation,
}

impl Path for Flown<'_> {
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
fn bad(path: &mut Flown<'_>, split: &mut Split<Saved>, keep: usize) -> Vec<BadFlight> {
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
