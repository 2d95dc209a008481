//! History of a path: its random numbers, and the states from which copies branch off.

use std::ops::ControlFlow;
use std::rc::Rc;

use serde::{Deserialize, Serialize};

use super::levels::RandomProcess;

/// Largest number of kept states of a path besides its first.
const KEPT: usize = 8;

/// Initial number of steps between two kept states.
const FIRST_APART: u64 = 16;

/// Seeds of noise of a path in order, which repeat the path.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Genealogy {
    /// Seed of noise at the start.
    pub noise_seed: u64,
    /// Changes of the seed, in the order of steps.
    pub branches: Vec<Branch>,
}

/// Step at which a copy leaves its original.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Branch {
    /// Last common step, from 1; 0 is the start.
    pub step: u64,
    /// Seed of noise after this step.
    pub noise_seed: u64,
}

impl Genealogy {
    /// Returns the history of a path that is not a copy.
    pub(super) fn new(noise_seed: u64) -> Self {
        Self { noise_seed, branches: Vec::new() }
    }

    /// Returns the history of a copy up to a step.
    pub(super) fn branched(&self, branch: Branch) -> Self {
        let branches = self.branches.iter().copied().chain([branch]).collect();
        Self { noise_seed: self.noise_seed, branches }
    }
}

/// Counts steps and calls `carry_on` after each.
pub(super) struct StepCounter<'a> {
    pub(super) steps: u64,
    pub(super) carry_on: &'a mut dyn FnMut(u64) -> ControlFlow<()>,
}

impl StepCounter<'_> {
    fn flown(&mut self) -> ControlFlow<()> {
        self.steps += 1;
        (self.carry_on)(self.steps)
    }
}

/// Path that was run to its end: its score, and each step at which the score rose.
///
/// A copy can branch off at any step whose score is higher than all before, called a record. For each record the
/// lineage keeps step number and score (16 bytes), and for at most nine of them the state. Other states are recomputed,
/// with the same bits, from the kept state before them.
pub struct Lineage<S> {
    genealogy: Genealogy,
    score: f64,
    records: Vec<Record>,
    /// Kept states; the first is not after the first record.
    states: Vec<State<S>>,
    /// Smallest number of steps between two kept states.
    apart: u64,
}

/// Step at which the score was higher than at all steps before.
#[derive(Clone, Copy)]
struct Record {
    step: u64,
    score: f64,
}

/// State at a step; with a seed, later random numbers come from this seed.
struct State<S> {
    step: u64,
    saved: Rc<S>,
    noise_seed: Option<u64>,
}

/// First step above a level.
pub(super) struct Crossing<S> {
    step: u64,
    score: f64,
    saved: Rc<S>,
}

impl<S> Lineage<S> {
    /// Returns the largest score; for a path above the target, the first score above it.
    #[must_use]
    pub fn score(&self) -> f64 {
        self.score
    }

    /// Returns the random numbers of the path.
    #[must_use]
    pub fn genealogy(&self) -> &Genealogy {
        &self.genealogy
    }

    /// Runs a path from its start to its end or above the target.
    pub(super) fn begin<P: RandomProcess<Saved = S>>(
        path: &mut P,
        noise_seed: u64,
        target: f64,
        watch: &mut StepCounter<'_>,
    ) -> Result<ControlFlow<(), Self>, P::Error> {
        path.begin(noise_seed)?;
        let mut lineage = Self {
            genealogy: Genealogy::new(noise_seed),
            score: f64::NEG_INFINITY,
            records: Vec::new(),
            states: vec![State { step: 0, saved: Rc::new(path.save()), noise_seed: None }],
            apart: FIRST_APART,
        };
        lineage.observe(path, 0);
        Ok(lineage.grow(path, 0, target, watch))
    }

    /// Runs a copy: the path up to a crossing, then with fresh noise.
    pub(super) fn branch<P: RandomProcess<Saved = S>>(
        &self,
        path: &mut P,
        crossing: &Crossing<S>,
        noise_seed: u64,
        target: f64,
        watch: &mut StepCounter<'_>,
    ) -> ControlFlow<(), Self> {
        let &Crossing { step, score, ref saved } = crossing;
        path.restore(saved, Some(noise_seed));
        let lineage = Self {
            genealogy: self.genealogy.branched(Branch { step, noise_seed }),
            score,
            records: vec![Record { step, score }],
            states: vec![State { step, saved: Rc::clone(saved), noise_seed: Some(noise_seed) }],
            apart: FIRST_APART,
        };
        lineage.grow(path, step, target, watch)
    }

    /// Continues from a step, whose state `path` has.
    fn grow<P: RandomProcess<Saved = S>>(
        mut self,
        path: &mut P,
        mut step: u64,
        target: f64,
        watch: &mut StepCounter<'_>,
    ) -> ControlFlow<(), Self> {
        while self.score <= target && path.step() {
            step += 1;
            if watch.flown().is_break() {
                return ControlFlow::Break(());
            }
            self.observe(path, step);
        }
        ControlFlow::Continue(self)
    }

    /// Adds a record if the score is higher than before.
    fn observe<P: RandomProcess<Saved = S>>(&mut self, path: &P, step: u64) {
        let score = path.score();
        if score > self.score {
            self.score = score;
            self.records.push(Record { step, score });
            if self.states.last().is_none_or(|last| step - last.step >= self.apart) {
                self.states.push(State { step, saved: Rc::new(path.save()), noise_seed: None });
            }
            if self.states.len() > KEPT + 1 {
                let mut index = 0;
                self.states.retain(|_| (index % 2 == 0, index += 1).0);
                self.apart *= 2;
            }
        }
    }

    /// Drops all records before the first that satisfies `is_past`: no copy branches off there any more.
    pub(super) fn forget_before(&mut self, is_past: impl Fn(f64) -> bool) {
        self.records.drain(..self.records.partition_point(|record| !is_past(record.score)));
        if let Some(first) = self.records.first() {
            let later = self.states.partition_point(|state| state.step <= first.step);
            self.states.drain(..later.saturating_sub(1));
        }
    }

    /// Moves `path` to the first record that satisfies `is_past`. Returns `None` without such a record.
    pub(super) fn crossing<P: RandomProcess<Saved = S>>(
        &self,
        path: &mut P,
        is_past: impl Fn(f64) -> bool,
        watch: &mut StepCounter<'_>,
    ) -> Option<ControlFlow<(), Crossing<S>>> {
        let &Record { step, score } = self.records.iter().find(|record| is_past(record.score))?;
        Some(match self.reach(path, step, watch) {
            ControlFlow::Continue(()) => ControlFlow::Continue(Crossing { step, score, saved: Rc::new(path.save()) }),
            ControlFlow::Break(()) => ControlFlow::Break(()),
        })
    }

    /// Moves `path` to its last record and returns the step.
    pub(super) fn last<P: RandomProcess<Saved = S>>(&self, path: &mut P) -> Option<u64> {
        let step = self.records.last()?.step;
        let reached =
            self.reach(path, step, &mut StepCounter { steps: 0, carry_on: &mut |_| ControlFlow::Continue(()) });
        reached.is_continue().then_some(step)
    }

    /// Recomputes the path up to a step, from the last kept state before it.
    fn reach<P: RandomProcess<Saved = S>>(
        &self,
        path: &mut P,
        step: u64,
        watch: &mut StepCounter<'_>,
    ) -> ControlFlow<()> {
        if let Some(state) = self.states.iter().rev().find(|state| state.step <= step) {
            path.restore(&state.saved, state.noise_seed);
            for _ in state.step..step {
                path.step();
                watch.flown()?;
            }
        }
        ControlFlow::Continue(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Path whose score rises by 1 at each step, up to 10,000.
    struct Climb(u64);

    impl RandomProcess for Climb {
        type Saved = u64;
        type Error = std::convert::Infallible;

        fn begin(&mut self, _noise_seed: u64) -> Result<(), Self::Error> {
            self.0 = 0;
            Ok(())
        }

        fn step(&mut self) -> bool {
            self.0 += u64::from(self.0 < 10_000);
            self.0 < 10_000
        }

        fn score(&self) -> f64 {
            self.0 as f64
        }

        fn save(&self) -> u64 {
            self.0
        }

        fn restore(&mut self, saved: &u64, _noise_seed: Option<u64>) {
            self.0 = *saved;
        }
    }

    #[test]
    fn few_states_are_kept_and_every_record_is_recomputed() {
        let mut carry_on = |_| ControlFlow::Continue(());
        let mut watch = StepCounter { steps: 0, carry_on: &mut carry_on };
        let mut path = Climb(0);
        let ControlFlow::Continue(mut climb) = Lineage::begin(&mut path, 1, f64::INFINITY, &mut watch).expect("a path")
        else {
            panic!("interrupted");
        };
        assert!((2..=KEPT + 1).contains(&climb.states.len()));
        assert_eq!((climb.score(), climb.records.len()), (9_999.0, 10_000));
        for level in [-1.0, 0.0, 77.5, 5_000.0, 9_998.0] {
            climb.forget_before(|score| score > level);
            let found = climb.crossing(&mut path, |score| score > level, &mut watch);
            let Some(ControlFlow::Continue(Crossing { step, score, saved })) = found else { panic!("no crossing") };
            assert_eq!((step, score, *saved), (path.0, path.score(), path.0));
            assert_eq!(score, level.floor() + 1.0);
            assert!(climb.states[0].step <= step && climb.states.get(1).is_none_or(|next| next.step > step));
        }
        assert!(climb.crossing(&mut path, |score| score > 9_999.0, &mut watch).is_none());
    }
}
