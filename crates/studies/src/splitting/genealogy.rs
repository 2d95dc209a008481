//! From which random numbers a path comes.

use serde::{Deserialize, Serialize};

/// The random numbers that a path was made of, as they came one after the other: with them it can be made again.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Genealogy {
    /// Its seed of noise at the start.
    pub noise_seed: u64,
    /// Where other random numbers took over, in the order of steps.
    pub branches: Vec<Branch>,
}

/// Where a path left the one that it is a copy of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Branch {
    /// The last step that both have in common, from 1; 0 is the start.
    pub step: u64,
    /// The seed of noise from there on.
    pub noise_seed: u64,
}

impl Genealogy {
    /// Of a path that is no copy.
    pub(super) fn new(noise_seed: u64) -> Self {
        Self { noise_seed, branches: Vec::new() }
    }

    /// Of a copy up to a step.
    pub(super) fn branched(&self, branch: Branch) -> Self {
        let branches = self.branches.iter().copied().chain([branch]).collect();
        Self { noise_seed: self.noise_seed, branches }
    }
}
