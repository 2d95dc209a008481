//! Splitting of a random path: levels, rounds and the random choice of survivors.

use std::ops::ControlFlow;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};

use super::lineage::{Crossing, Lineage, StepCounter};

/// Random path that advances step by step. One value holds one path at a time.
pub trait RandomProcess {
    /// Complete state at a step, random number generators included.
    type Saved;
    /// Reason why a path cannot begin.
    type Error;

    /// Begins a new path with a seed of noise.
    ///
    /// # Errors
    /// If the path cannot begin.
    fn begin(&mut self, noise_seed: u64) -> Result<(), Self::Error>;

    /// Advances by a step. Returns `false`, without a change, at the end of the path.
    fn step(&mut self) -> bool;

    /// Returns the score: larger is closer to the event. It never decreases along a path.
    fn score(&self) -> f64;

    /// Returns the complete state.
    fn save(&self) -> Self::Saved;

    /// Restores a saved state and continues with the same bits. With a `noise_seed`, all later random numbers come from
    /// this seed; nothing else changes.
    fn restore(&mut self, saved: &Self::Saved, noise_seed: Option<u64>);
}

/// Parameters of a splitting.
#[derive(Clone, Copy, Debug)]
pub struct SplittingRule {
    /// Number of simultaneous paths, n.
    pub flights: usize,
    /// The level is the k-th smallest score; k is at least 1 and less than n.
    pub kill: usize,
    /// The event is a score above this.
    pub target: f64,
    /// Whether a copy may branch off at a score, given the level. `score > level` is without bias.
    pub is_past: fn(score: f64, level: f64) -> bool,
}

impl SplittingRule {
    /// Returns the rule whose copies branch off above the level.
    #[must_use]
    pub fn new(flights: usize, kill: usize, target: f64) -> Self {
        Self { flights, kill, target, is_past: |score, level| score > level }
    }
}

/// Result of a splitting.
pub struct SplitResult<S> {
    /// Estimated probability of the event.
    pub probability: f64,
    /// Number of rounds that ended paths.
    pub iterations: u64,
    /// Whether a round ended all paths; the estimate is then 0.
    pub extinct: bool,
    /// Number of steps, repeated steps included.
    pub steps: u64,
    /// Paths at the end.
    pub lineages: Vec<Lineage<S>>,
}

/// Estimates the probability that a path comes above the target:
///
/// ```text
/// repeat   Z = the k-th smallest of the scores S;   stop if Z > target
///          end all K paths with S <= Z, ties included;   if all end, the estimate is 0
///          replace each by a copy of a random survivor, up to the survivor's first step with a score above Z
/// estimate = product of (1 - K/n) over the rounds, times the share of S > target at the end
/// ```
///
/// The result depends only on the path, the rule, `seed` and `repetition`; repetitions under one seed are independent.
/// Between rounds memory holds at most nine states of each path and 16 bytes for each of its steps; during a round one
/// more state of each path. `carry_on` is called after each step with the number of all steps; if it breaks, the result
/// is `None`.
///
/// # Errors
/// The error of a path that cannot begin.
pub fn split<P: RandomProcess>(
    path: &mut P,
    rule: SplittingRule,
    [seed, repetition]: [u64; 2],
    carry_on: &mut dyn FnMut(u64) -> ControlFlow<()>,
) -> Result<Option<SplitResult<P::Saved>>, P::Error> {
    let SplittingRule { flights, kill, target, is_past } = rule;
    let (mut draws, mut watch) = (Draws::new(seed, repetition), StepCounter { steps: 0, carry_on });
    let mut lineages = Vec::with_capacity(flights);
    for _ in 0..flights {
        match Lineage::begin(path, draws.noise_seed(), target, &mut watch)? {
            ControlFlow::Continue(lineage) => lineages.push(lineage),
            ControlFlow::Break(()) => return Ok(None),
        }
    }
    let (mut product, mut iterations) = (1.0, 0);
    let is_hit = |lineage: &&Lineage<_>| lineage.score() > target;
    loop {
        let level = level(&lineages, kill);
        if level > target {
            break;
        }
        let (survivors, ended): (Vec<_>, Vec<_>) = (0..flights).partition(|&index| lineages[index].score() > level);
        product *= survivors.len() as f64 / flights as f64;
        iterations += 1;
        if survivors.is_empty() {
            break;
        }
        let is_past = |score: f64| is_past(score, level);
        for &index in &survivors {
            lineages[index].forget_before(is_past);
        }
        let mut crossings: Vec<Option<Crossing<_>>> = (0..flights).map(|_| None).collect();
        for index in ended {
            let parent = survivors[draws.below(survivors.len())];
            let noise_seed = draws.noise_seed();
            if crossings[parent].is_none() {
                crossings[parent] = match lineages[parent].crossing(path, is_past, &mut watch) {
                    Some(ControlFlow::Break(())) => return Ok(None),
                    found => found.and_then(ControlFlow::continue_value),
                };
            }
            // A survivor has been above the level.
            let Some(crossing) = &crossings[parent] else { continue };
            match lineages[parent].branch(path, crossing, noise_seed, target, &mut watch) {
                ControlFlow::Continue(child) => lineages[index] = child,
                ControlFlow::Break(()) => return Ok(None),
            }
        }
    }
    let share = lineages.iter().filter(is_hit).count() as f64 / flights as f64;
    let extinct = product == 0.0;
    Ok(Some(SplitResult { probability: product * share, iterations, extinct, steps: watch.steps, lineages }))
}

/// Returns the k-th smallest score.
fn level<S>(lineages: &[Lineage<S>], k: usize) -> f64 {
    let mut scores: Vec<_> = lineages.iter().map(Lineage::score).collect();
    scores.sort_by(f64::total_cmp);
    scores.get(k.saturating_sub(1)).copied().unwrap_or(f64::INFINITY)
}

/// Random numbers of one repetition under a seed: seeds of noise and choices of survivors.
#[derive(Clone, Debug)]
struct Draws(ChaCha8Rng);

impl Draws {
    fn new(seed: u64, repetition: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(repetition);
        Self(random)
    }

    /// Draws a seed that a scenario file can hold.
    fn noise_seed(&mut self) -> u64 {
        self.0.next_u64() >> 1
    }

    /// Draws uniformly from 0 to `count - 1`; 0 if `count` is 0.
    fn below(&mut self, count: usize) -> usize {
        let count = (count as u64).max(1);
        // Numbers beyond the last multiple of `count` would favour the smallest results.
        let whole = u64::MAX - u64::MAX % count;
        loop {
            let word = self.0.next_u64();
            if word < whole {
                return usize::try_from(word % count).unwrap_or_default();
            }
        }
    }
}
