//! The algorithm: paths, levels and the random choices between them.

use std::ops::ControlFlow;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};

use super::lineage::{Crossing, Lineage, StepCounter};

/// A random path that is made step by step, one at a time in the same place.
pub trait Path {
    /// Everything of it at one instant, random numbers included.
    type Saved;
    /// Why a path cannot be begun.
    type Error;

    /// Begins anew, with random numbers of a seed.
    ///
    /// # Errors
    /// Where there is no such path.
    fn begin(&mut self, noise_seed: u64) -> Result<(), Self::Error>;

    /// Goes on by a step; false, and nothing else, where it is at its end.
    fn step(&mut self) -> bool;

    /// How near the event it has come so far: the larger, the nearer. It never falls.
    fn score(&self) -> f64;

    /// Everything as it is now.
    fn save(&self) -> Self::Saved;

    /// Becomes what was saved and goes on with the same bits as if it had never been left; with a `noise_seed`, all that is drawn
    /// from now on is drawn from it and nothing else changes.
    fn restore(&mut self, saved: &Self::Saved, noise_seed: Option<u64>);
}

/// What is split, and how.
#[derive(Clone, Copy, Debug)]
pub struct Rule {
    /// Paths at a time, n.
    pub flights: usize,
    /// The level is the k-th smallest score; at least 1, and less than n.
    pub kill: usize,
    /// The event is a score above this.
    pub target: f64,
    /// Whether a score is one from which a copy may go on past a level. Without bias it is whether it is larger.
    pub is_past: fn(score: f64, level: f64) -> bool,
}

impl Rule {
    /// Copies go on from where they are above the level.
    #[must_use]
    pub fn new(flights: usize, kill: usize, target: f64) -> Self {
        Self { flights, kill, target, is_past: |score, level| score > level }
    }
}

/// What came of it.
pub struct Split<S> {
    /// Of the event.
    pub probability: f64,
    /// Rounds in which paths were ended.
    pub iterations: u64,
    /// Whether all paths were ended at once, which makes the estimate 0.
    pub extinct: bool,
    /// Steps that were made, those that were made again included.
    pub steps: u64,
    /// The paths at the end.
    pub lineages: Vec<Lineage<S>>,
}

/// The probability that a path comes past the target:
///
/// ```text
/// repeat   Z = the k-th smallest of the scores S;   stop where Z > target
///          end all K with S <= Z, ties too;   all of them: the estimate is 0
///          each becomes a copy of one of the others, drawn at random, up to its first step with a score above Z
/// estimate = product of (1 - K/n) over the rounds, times the share of S > target at the end
/// ```
///
/// It depends on `seed` and `repetition` alone; repetitions under one seed are independent. Between rounds memory holds at most nine states
/// a path and 16 bytes for each step of it, and one state more a path while a round lasts. None where `carry_on`, which is
/// asked after each step with the number of all steps, ends it.
///
/// # Errors
/// That of a path that cannot be begun.
pub fn split<P: Path>(
    path: &mut P,
    rule: Rule,
    [seed, repetition]: [u64; 2],
    carry_on: &mut dyn FnMut(u64) -> ControlFlow<()>,
) -> Result<Option<Split<P::Saved>>, P::Error> {
    let Rule { flights, kill, target, is_past } = rule;
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
            // A survivor has been past the level.
            let Some(crossing) = &crossings[parent] else { continue };
            match lineages[parent].branch(path, crossing, noise_seed, target, &mut watch) {
                ControlFlow::Continue(child) => lineages[index] = child,
                ControlFlow::Break(()) => return Ok(None),
            }
        }
    }
    let share = lineages.iter().filter(is_hit).count() as f64 / flights as f64;
    let extinct = product == 0.0;
    Ok(Some(Split { probability: product * share, iterations, extinct, steps: watch.steps, lineages }))
}

/// The k-th smallest score.
fn level<S>(lineages: &[Lineage<S>], k: usize) -> f64 {
    let mut scores: Vec<_> = lineages.iter().map(Lineage::score).collect();
    scores.sort_by(f64::total_cmp);
    scores.get(k.saturating_sub(1)).copied().unwrap_or(f64::INFINITY)
}

/// Seeds of noise and choices of survivors, of one repetition under a seed; those of others are independent.
#[derive(Clone, Debug)]
struct Draws(ChaCha8Rng);

impl Draws {
    fn new(seed: u64, repetition: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(repetition);
        Self(random)
    }

    /// A seed that a scenario file can hold.
    fn noise_seed(&mut self) -> u64 {
        self.0.next_u64() >> 1
    }

    /// One of 0, 1, ... below `count`, each as likely; 0 of none.
    fn below(&mut self, count: usize) -> usize {
        let count = (count as u64).max(1);
        // Words beyond the last whole multiple would favour the first ones.
        let whole = u64::MAX - u64::MAX % count;
        loop {
            let word = self.0.next_u64();
            if word < whole {
                return usize::try_from(word % count).unwrap_or_default();
            }
        }
    }
}
