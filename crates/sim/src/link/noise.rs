//! Random numbers that depend on a counter, not on the order of draws.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng as _;
use std::f64::consts::TAU;

use crate::scenario::unit;

/// Words of a block of the generator; each draw begins at a block boundary.
const BLOCK_WORDS: u128 = 16;
/// Words of a double.
const DOUBLE_WORDS: usize = 2;

/// Use of random numbers; each source has its own streams.
#[derive(Clone, Copy, Debug)]
pub(super) enum NoiseSource {
    /// Errors of vehicles' measurements of themselves.
    Own,
    /// Constant errors of vehicles' measurements of themselves.
    Bias,
    /// Errors of vehicles' measurements of each other.
    RelativeSensor,
    /// Losses and delays of messages.
    Messages,
}

/// Random numbers that depend only on a seed, a source, a pair of vehicles and the number of the draw, not on the order
/// or number of calls.
#[derive(Clone, Debug)]
pub(super) struct Noise {
    random: ChaCha8Rng,
    source: NoiseSource,
    /// Last draw made before the seed was changed, and its generator.
    before: Option<(u64, ChaCha8Rng)>,
}

impl Noise {
    pub(super) fn new(seed: u64, source: NoiseSource) -> Self {
        Self { random: ChaCha8Rng::seed_from_u64(seed), source, before: None }
    }

    /// Changes the seed for draws after number `made`. Draw `made` keeps its value; earlier draws must not be repeated.
    pub(super) fn reseed(&mut self, seed: u64, made: u64) {
        let before = self.before.take().filter(|(last, _)| made <= *last);
        let random = std::mem::replace(&mut self.random, ChaCha8Rng::seed_from_u64(seed));
        self.before = Some(before.unwrap_or((made, random)));
    }

    /// Returns a draw of at most `doubles` numbers for two vehicles.
    pub(super) fn draw(&self, vehicle: usize, other: usize, number: u64, doubles: usize) -> Draw {
        let made = self.before.as_ref().filter(|(last, _)| number <= *last);
        let mut random = made.map_or(&self.random, |(_, random)| random).clone();
        // Two bits for the source, 31 for each vehicle.
        random.set_stream((self.source as u64) << 62 | (vehicle as u64) << 31 | other as u64);
        let blocks = (doubles * DOUBLE_WORDS).div_ceil(BLOCK_WORDS as usize) as u128;
        random.set_word_pos(u128::from(number) * blocks * BLOCK_WORDS);
        Draw { random }
    }
}

/// Random numbers of one draw.
pub(super) struct Draw {
    random: ChaCha8Rng,
}

impl Draw {
    /// Returns a uniform number in \[0, 1), a multiple of 2^-53.
    pub(super) fn unit(&mut self) -> f64 {
        unit(&mut self.random)
    }

    /// Returns two independent standard normal numbers (Box and Muller) from two doubles.
    fn normals(&mut self) -> [f64; 2] {
        let (u, turn) = (self.unit(), self.unit());
        let length = (-2.0 * libm::log(1.0 - u)).sqrt();
        let (sin, cos) = libm::sincos(TAU * turn);
        [length * cos, length * sin]
    }

    /// Returns six independent standard normal numbers, from six doubles.
    pub(super) fn six_normals(&mut self) -> [f64; 6] {
        let [[a, b], [c, d], [e, f]] = [self.normals(), self.normals(), self.normals()];
        [a, b, c, d, e, f]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_draw_depends_only_on_source_vehicles_and_number() {
        let noise = Noise::new(7, NoiseSource::Own);
        let first = noise.draw(3, 0, 41, 6).six_normals();
        noise.draw(3, 0, 42, 6).six_normals();
        assert_eq!(noise.draw(3, 0, 41, 6).six_normals(), first);
        let others = [
            noise.draw(3, 0, 42, 6),
            noise.draw(4, 0, 41, 6),
            noise.draw(3, 1, 41, 6),
            Noise::new(8, NoiseSource::Own).draw(3, 0, 41, 6),
            Noise::new(7, NoiseSource::RelativeSensor).draw(3, 0, 41, 6),
        ];
        for mut other in others {
            assert!(other.six_normals().iter().zip(first).all(|(a, b)| *a != b));
        }
    }

    #[test]
    fn another_seed_changes_only_later_draws() {
        let draw = |noise: &Noise, number: u64| noise.draw(3, 0, number, 6).six_normals();
        let (first, second, third) =
            (Noise::new(7, NoiseSource::Own), Noise::new(8, NoiseSource::Own), Noise::new(9, NoiseSource::Own));
        let mut noise = first.clone();
        noise.reseed(8, 41);
        assert_eq!([draw(&noise, 41), draw(&noise, 42)], [draw(&first, 41), draw(&second, 42)]);
        let mut at_once = noise.clone();
        at_once.reseed(9, 41);
        assert_eq!([draw(&at_once, 41), draw(&at_once, 42)], [draw(&first, 41), draw(&third, 42)]);
        noise.reseed(9, 50);
        assert_eq!([draw(&noise, 50), draw(&noise, 51)], [draw(&second, 50), draw(&third, 51)]);
    }

    #[test]
    fn normal_numbers_have_mean_0_variance_1_and_the_fourth_moment_3() {
        let noise = Noise::new(1, NoiseSource::Own);
        let numbers: Vec<f64> = (0..50_000).flat_map(|number| noise.draw(0, 0, number, 6).six_normals()).collect();
        let moment = |power: i32| numbers.iter().map(|x| x.powi(power)).sum::<f64>() / numbers.len() as f64;
        // Standard errors of 300,000 numbers: 0.002, 0.003 and 0.02.
        assert!(moment(1).abs() < 0.007 && (moment(2) - 1.0).abs() < 0.01 && (moment(4) - 3.0).abs() < 0.07);
        // Consecutive numbers of a draw are uncorrelated.
        let pairs = numbers.chunks_exact(2).map(|pair| pair[0] * pair[1]).sum::<f64>() / 150_000.0;
        assert!(pairs.abs() < 0.01, "{pairs}");
    }
}
