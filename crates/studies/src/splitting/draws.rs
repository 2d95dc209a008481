//! The random choices of splitting itself.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};

/// Seeds of noise and choices of survivors, of one repetition under a seed; those of others are independent.
#[derive(Clone, Debug)]
pub(super) struct Draws(ChaCha8Rng);

impl Draws {
    pub(super) fn new(seed: u64, repetition: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(repetition);
        Self(random)
    }

    /// A seed that a scenario file can hold.
    pub(super) fn noise_seed(&mut self) -> u64 {
        self.0.next_u64() >> 1
    }

    /// One of 0, 1, ... below `count`, each as likely; 0 of none.
    pub(super) fn below(&mut self, count: usize) -> usize {
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
