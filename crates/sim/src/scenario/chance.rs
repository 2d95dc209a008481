//! Random numbers of a seed: `ChaCha8` words turned into numbers by exact arithmetic, so a seed means the same on every machine.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// The random numbers of a seed.
#[must_use]
pub fn random(seed: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(seed)
}

/// A whole number below `end`, each as likely as any other: words that would favour the smaller ones are drawn again.
#[expect(clippy::cast_possible_truncation, reason = "it is below a number of vehicles")]
pub(super) fn below(end: u64, random: &mut ChaCha8Rng) -> usize {
    let fair = u64::MAX - u64::MAX % end;
    loop {
        let word = random.next_u64();
        if word < fair {
            return (word % end) as usize;
        }
    }
}

/// Uniform in \[0, 1), a multiple of 2^-53.
pub(super) fn unit(random: &mut ChaCha8Rng) -> f64 {
    const SCALE: f64 = 1.0 / (1_u64 << 53) as f64;
    (random.next_u64() >> 11) as f64 * SCALE
}
