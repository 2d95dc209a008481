//! Normal random numbers with the same bits on every machine.

use std::f64::consts::TAU;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};

/// Generator of normal numbers of mean 0 and variance 1: Box-Muller pairs from `ChaCha8` words, with `libm` functions
/// only.
#[derive(Clone, Debug)]
pub struct Normals {
    random: ChaCha8Rng,
    /// Second number of a pair, until it is used.
    second: Option<f64>,
}

impl Normals {
    /// Creates the generator of a seed and a stream; streams are independent.
    #[must_use]
    pub fn new(seed: u64, stream: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(stream);
        Self { random, second: None }
    }

    /// Returns the next normal number (mean 0, variance 1).
    #[expect(clippy::should_implement_trait, reason = "the generator never ends and returns no Option")]
    pub fn next(&mut self) -> f64 {
        if let Some(second) = self.second.take() {
            return second;
        }
        // In (0, 1], so that the logarithm is finite.
        let radius = (-2.0 * libm::log(1.0 - self.unit())).sqrt();
        let angle = TAU * self.unit();
        self.second = Some(radius * libm::sin(angle));
        radius * libm::cos(angle)
    }

    /// Returns a uniform number in \[0, 1), a multiple of 2^-53.
    pub fn unit(&mut self) -> f64 {
        const SCALE: f64 = 1.0 / (1_u64 << 53) as f64;
        (self.random.next_u64() >> 11) as f64 * SCALE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_normal_and_streams_independent() {
        let count = 200_000_u32;
        let (mut one, mut other) = (Normals::new(7, 1), Normals::new(7, 2));
        let pairs: Vec<_> = (0..count).map(|_| (one.next(), other.next())).collect();
        let mean = |value_of: &dyn Fn(f64, f64) -> f64| {
            pairs.iter().map(|&(a, b)| value_of(a, b)).sum::<f64>() / f64::from(count)
        };
        // Four standard deviations of each mean.
        let near = |found: f64, expected: f64, variance: f64| {
            assert!((found - expected).abs() < 4.0 * (variance / f64::from(count)).sqrt(), "{found} for {expected}");
        };
        near(mean(&|a, _| a), 0.0, 1.0);
        near(mean(&|a, _| a * a), 1.0, 2.0);
        near(mean(&|a, _| a.powi(4)), 3.0, 96.0);
        near(mean(&|a, b| a * b), 0.0, 1.0);
        near(mean(&|a, _| f64::from(a.abs() < 1.0)), 0.682_689, 0.22);
        assert!(pairs.windows(2).all(|next| next[0].0 != next[1].0));
    }
}
