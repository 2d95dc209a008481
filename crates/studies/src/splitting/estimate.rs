//! Probability that a flight is violated: settings, one estimate, the mean of several, and replays of violated flights.

use std::ops::ControlFlow;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::levels::{RandomProcess, SplitResult, SplittingRule, split};
use super::lineage::{Genealogy, Lineage};
use crate::statistics::{CONFIDENCE, Estimate, Proportion};
use tautline_core::failure::Failure;
use tautline_core::record::{Event, RecordError, Sample, Sink, StateHash, Step};
use tautline_sim::plant::FreeSteps;
use tautline_sim::scenario::Scenario;
use tautline_sim::sim::{Breakdown, Ending, Flight, SavedState, SimError, Simulation, continue_flight};

/// Recommended smallest number of flights. With fewer, many estimates end without a survivor.
const ENOUGH: usize = 100;
/// Number of estimates below which Student's interval of a skewed distribution is too narrow.
const MANY: usize = 20;

/// Settings of an estimate: the keys of `[splitting]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct SplittingSettings {
    /// Number of simultaneous flights, n: at least 2; 100 or more is recommended.
    #[schemars(range(min = 2))]
    pub flights: usize,
    /// Smallest number k of flights that a round ends, from 1 to n - 1. k = 1 has the smallest error per step flown.
    #[schemars(range(min = 1))]
    pub kill: usize,
    /// Largest number of violated flights that an estimate keeps.
    pub keep: usize,
}

impl Default for SplittingSettings {
    fn default() -> Self {
        Self { flights: ENOUGH, kill: 1, keep: 10 }
    }
}

impl SplittingSettings {
    /// Refuses numbers of flights with which no round can end or copy a flight.
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

    /// Returns the warning of a small number of flights.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        (self.flights < ENOUGH).then(|| warning(self.flights as u64)).flatten()
    }
}

/// Returns the warning of a small number of flights.
fn warning(flights: u64) -> Option<String> {
    (flights < ENOUGH as u64).then(|| {
        format!(
            "{flights} flights at a time are few: for a rare event most estimates are 0, and their mean is \
             unreliable; take {ENOUGH} or more"
        )
    })
}

/// Estimate of the probability that a flight is violated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Splitting {
    /// Number of the estimate under its seed.
    pub repetition: u64,
    /// Unbiased estimate. Its error is unknown from a single estimate; [`Repetitions`] has an interval.
    pub probability: f64,
    /// Number of simultaneous flights.
    pub flights: u64,
    /// Smallest number of flights that a round ended.
    pub kill: u64,
    /// Number of rounds.
    pub iterations: u64,
    /// Whether a round ended all flights; the estimate is then 0.
    pub extinct: bool,
    /// Number of steps flown.
    pub steps: u64,
    /// Some of the flights that were violated at the end, each equally likely. Flights with different first ancestors
    /// come first, because they have the least in common.
    pub bad: Vec<ViolatedFlight>,
}

/// Estimates the probability, over the noise and from the scenario's start, that a flight is violated.
///
/// A flight is violated if its judge finds two vehicles closer than delta, or a vehicle closer to an obstacle than its
/// clearance, also between steps. The score is the largest -clearance so far ([`Simulation::least_clearance_m`]). A
/// flight that ends early, such as at the barrier of its law, is violated only if the judge found a violation before
/// its end.
///
/// The result depends only on the scenario, the settings, `seed` and `repetition`. `carry_on` is called after each step
/// with the number of all steps; if it breaks, the result is `None`.
///
/// Memory holds at most ten states of each flight ([`SavedState`]), each 30 kB for 3 vehicles and 0.3 MB for 100. A
/// hundred flights of 100 vehicles take 0.3 GB.
///
/// # Errors
/// [`Failure`] for wrong settings, for a scenario without noise from step to step, and for a law or a judge that cannot
/// be built.
pub fn estimate(
    scenario: &Scenario,
    settings: &SplittingSettings,
    [seed, repetition]: [u64; 2],
    carry_on: &mut dyn FnMut(u64) -> ControlFlow<()>,
) -> Result<Option<Splitting>, Failure> {
    check(scenario, settings)?;
    let simulation = simulation_at_start(scenario, scenario.noise_seed)?;
    let mut path = SimulatedFlight { scenario, simulation, defect: None };
    let rule = SplittingRule::new(settings.flights, settings.kill, 0.0);
    let Some(mut split) = split(&mut path, rule, [seed, repetition], carry_on)? else { return Ok(None) };
    if let Some(defect) = path.defect {
        return Err(SimError::EngineDiffers(defect).into());
    }
    let bad = bad(&mut path, &mut split, settings.keep);
    let SplitResult { probability, iterations, extinct, steps, .. } = split;
    let [flights, kill] = [settings.flights, settings.kill].map(|number| number as u64);
    Ok(Some(Splitting { repetition, probability, flights, kill, iterations, extinct, steps, bad }))
}

/// Checks the settings, and that the scenario has the noise that [`estimate`] needs.
///
/// # Errors
/// [`Failure`] `campaign/splitting` for wrong settings, and for a scenario without noise from step to step.
pub fn check(scenario: &Scenario, settings: &SplittingSettings) -> Result<(), Failure> {
    settings.check()?;
    if is_noisy(scenario) {
        return Ok(());
    }
    Err(Failure::input(
        "campaign/splitting",
        "nothing in this flight is random from step to step, as splitting requires",
        "add turbulence (wind.dryden), errors of measurement (sensing.position_noise_m and sensing.rate_hz), or losses \
         or jitter of messages (network.loss, network.jitter_s)",
    ))
}

/// Returns whether two flights from one state can differ. Constant errors are drawn once, so they do not count.
fn is_noisy(scenario: &Scenario) -> bool {
    let Scenario { wind, sensing, network, .. } = scenario;
    let errs = sensing.position_noise_m > 0.0 || sensing.velocity_noise_m_s > 0.0;
    let is_lossy = network.loss > 0.0 && network.loss < 1.0;
    wind.turbulence.is_some() || errs || is_lossy || network.jitter_s > 0.0
}

/// Running flight.
struct SimulatedFlight<'a> {
    scenario: &'a Scenario,
    simulation: Simulation,
    /// First difference between the engine and a step without it.
    defect: Option<Breakdown>,
}

impl RandomProcess for SimulatedFlight<'_> {
    type Saved = SavedState;
    type Error = SimError;

    fn begin(&mut self, noise_seed: u64) -> Result<(), SimError> {
        self.simulation = simulation_at_start(self.scenario, noise_seed)?;
        Ok(())
    }

    fn step(&mut self) -> bool {
        let goes_on = self.simulation.ending().is_none();
        self.simulation.step();
        // The replay of a flight reports its events.
        drop(self.simulation.events());
        if let Some(Ending::BrokeDown(defect @ Breakdown::EngineDiffers { .. })) = self.simulation.ending() {
            self.defect.get_or_insert(*defect);
        }
        goes_on
    }

    fn score(&self) -> f64 {
        self.simulation.least_clearance_m().map_or(f64::NEG_INFINITY, |clearance_m| -clearance_m)
    }

    fn save(&self) -> SavedState {
        self.simulation.save()
    }

    fn restore(&mut self, saved: &SavedState, noise_seed: Option<u64>) {
        self.simulation.load(saved, noise_seed);
    }
}

/// Returns up to `keep` of the violated flights, those with different first ancestors first.
fn bad(path: &mut SimulatedFlight<'_>, split: &mut SplitResult<SavedState>, keep: usize) -> Vec<ViolatedFlight> {
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
        Some(ViolatedFlight {
            genealogy: hit[index].genealogy().clone(),
            violated_at_step,
            clearance_m: simulation.least_clearance_m()?,
            state_hash: hash.finish(),
        })
    })
    .collect()
}

/// Violated flight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ViolatedFlight {
    /// Random numbers that repeat the flight.
    pub genealogy: Genealogy,
    /// Step of the violation, from 1; 0 is the start.
    pub violated_at_step: u64,
    /// Smallest clearance up to this step \[m\], less than 0.
    pub clearance_m: f64,
    /// SHA-256 over time, positions, velocities and commands after this step, as in
    /// [`tautline_core::record::StateHash`].
    pub state_hash: String,
}

/// Hash over the state after one step, as in [`ViolatedFlight::state_hash`].
#[derive(Clone, Debug)]
pub struct StateHashAtStep {
    step: u64,
    seen: u64,
    hash: Option<String>,
}

impl StateHashAtStep {
    /// Returns the hasher for the step at which a flight was violated.
    #[must_use]
    pub fn violation_of(flight: &ViolatedFlight) -> Self {
        Self { step: flight.violated_at_step, seen: 0, hash: None }
    }

    /// Returns the hash; `None` before the step has been flown.
    #[must_use]
    pub fn hash(&self) -> Option<&str> {
        self.hash.as_deref()
    }
}

impl Sink for StateHashAtStep {
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

/// Repeats a flight to its end, with the same bits, and records it in `sink`. The scenario must be the split one.
///
/// # Errors
/// [`SimError`] if the law or the judge cannot be built, or `sink` cannot record.
pub fn replay(scenario: &Scenario, genealogy: &Genealogy, sink: &mut dyn Sink) -> Result<Flight, SimError> {
    let mut simulation = simulation_at_start(scenario, genealogy.noise_seed)?;
    let mut branches = genealogy.branches.iter().peekable();
    let mut take_over = |simulation: &mut Simulation| {
        while let Some(branch) = branches.next_if(|branch| branch.step == simulation.steps()) {
            simulation.load(&simulation.save(), Some(branch.noise_seed));
        }
        ControlFlow::Continue(())
    };
    let _goes_on = take_over(&mut simulation);
    continue_flight(simulation, sink, &mut take_over)
}

/// Returns the scenario at its start, with a seed of noise.
fn simulation_at_start(scenario: &Scenario, noise_seed: u64) -> Result<Simulation, SimError> {
    let mut simulation = Simulation::new(&Scenario { noise_seed, ..scenario.clone() })?;
    simulation.allow_free_steps(FreeSteps::Compared);
    Ok(simulation)
}

/// Mean of independent estimates of one probability.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Repetitions {
    /// Number of estimates.
    pub repetitions: u64,
    /// Mean, without bias, with Student's interval limited to 0 and 1. The interval assumes normal values; estimates
    /// are skewed, more so with fewer flights. `advice` states where this matters.
    pub probability: Estimate,
    /// [`CONFIDENCE`].
    pub confidence: f64,
    /// Estimates without a survivor, which are 0.
    pub extinct: Proportion,
    /// Steps flown for all estimates.
    pub steps: u64,
    /// Warnings about the interval, a sentence each.
    pub advice: Vec<String>,
}

impl Repetitions {
    /// Returns the mean of estimates that have the same seed and different repetition numbers.
    #[must_use]
    pub fn new(estimates: &[Splitting]) -> Self {
        let probabilities: Vec<_> = estimates.iter().map(|estimate| estimate.probability).collect();
        let extinct = estimates.iter().filter(|estimate| estimate.extinct).count();
        let all_extinct = extinct == estimates.len();
        let Estimate { value, low, high } = Estimate::mean(&probabilities);
        let low = low.map(|low| low.max(0.0));
        // If all estimates are 0, their spread does not bound the probability.
        let high = high.map(|high| high.min(1.0)).filter(|_| !all_extinct);
        let fewest = estimates.iter().map(|estimate| estimate.flights).min();
        let mut advice: Vec<_> = fewest.and_then(warning).into_iter().collect();
        if extinct > 0 {
            advice.push(format!(
                "{extinct} of {} estimates ended without a survivor and are 0: {}; increase splitting.flights",
                estimates.len(),
                if all_extinct { "there is no upper bound" } else { "the mean comes from the others" }
            ));
        }
        if estimates.len() < MANY {
            advice.push(format!(
                "the interval assumes normal values, which {} estimates do not justify; take {MANY} or more",
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
    fn repetitions_have_an_interval_and_warnings() {
        let many = Repetitions::new(&vec![[estimate(0.25, 100), estimate(0.75, 100)]; 10].concat());
        assert_eq!((many.advice.as_slice(), many.steps, many.probability.value), ([].as_slice(), 200, Some(0.5)));
        // s = 0.2565, t = 2.093 for 19 degrees of freedom.
        assert!(many.probability.low.is_some_and(|low| (low - 0.37996).abs() < 1e-4));
        let few = Repetitions::new(&[estimate(1e-6, 20), estimate(0.0, 20)]);
        assert_eq!((few.probability.low, few.extinct.count, few.advice.len()), (Some(0.0), 1, 3));
        assert!(few.advice[0].contains("20 flights at a time are few") && few.advice[1].contains("1 of 2"));
    }

    #[test]
    fn estimates_of_zero_have_no_upper_bound() {
        let none = Repetitions::new(&vec![estimate(0.0, 100); 30]);
        assert_eq!((none.probability.value, none.probability.high), (Some(0.0), None));
        assert!(none.advice[0].contains("no upper bound"));
    }
}
