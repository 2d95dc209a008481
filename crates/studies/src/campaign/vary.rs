//! Variations of a campaign: distributions and grids of the values of a key.

use std::f64::consts::TAU;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

/// Number of bits of drawn seeds; a double holds them exactly.
const SEED_BITS: u32 = 53;

/// Word for a seed that each run draws.
pub(super) const BY_RUN: &str = "run";

/// Forms of a variation.
pub(super) const FORMS: &str = "write \"run\" for a seed, or one of { uniform = [low, high] }, { log_uniform = [low, \
                                high] }, { normal = [mean, deviation] }, { integer = [low, high] }, { list = [...] }, \
                                { grid = [...] }, { grid = { from = 0.0, to = 1.0, count = 11 } }";

/// Distribution or grid of the values of a key.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[schemars(description = FORMS)]
pub enum Variation {
    /// A seed of 53 bits.
    #[serde(skip)]
    Seed,
    /// Uniform between two numbers.
    Uniform([f64; 2]),
    /// Uniform in the logarithm between two positive numbers.
    LogUniform([f64; 2]),
    /// Normal with this mean and standard deviation.
    Normal([f64; 2]),
    /// Uniform integer in a range, both ends included.
    Integer([i64; 2]),
    /// Uniform choice from a list.
    List(#[schemars(with = "Vec<serde_json::Value>", length(min = 1))] Vec<toml::Value>),
    /// Values in turn, crossed with every other grid.
    Grid(Grid),
}

/// Values that are flown in turn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Grid {
    /// Listed values.
    Listed(#[schemars(with = "Vec<serde_json::Value>", length(min = 1))] Vec<toml::Value>),
    /// Evenly spaced values, both ends included.
    Spaced {
        /// First value.
        from: f64,
        /// Last value.
        to: f64,
        /// Number of values, at least 2.
        #[schemars(range(min = 2))]
        count: u64,
    },
}

impl Grid {
    fn len(&self) -> u64 {
        match self {
            Self::Listed(values) => values.len() as u64,
            Self::Spaced { count, .. } => *count,
        }
    }

    fn at(&self, number: u64) -> toml::Value {
        match self {
            Self::Listed(values) => {
                let listed = usize::try_from(number).ok().and_then(|number| values.get(number));
                listed.cloned().unwrap_or(toml::Value::Boolean(false))
            }
            Self::Spaced { from, to, count } => {
                let part = number as f64 / (*count - 1) as f64;
                toml::Value::Float((1.0 - part) * from + part * to)
            }
        }
    }
}

impl Variation {
    /// Reads the value of a key of `[vary]`.
    ///
    /// # Errors
    /// The problem, if the value is not a variation or its range is empty.
    pub fn read(value: &toml::Value) -> Result<Self, String> {
        if value.as_str() == Some(BY_RUN) {
            return Ok(Self::Seed);
        }
        let variation: Self = value.clone().try_into().map_err(|error: toml::de::Error| error.message().to_owned())?;
        match &variation {
            Self::Uniform([low, high]) | Self::LogUniform([low, high])
                if !(low < high && low.is_finite() && high.is_finite()) =>
            {
                Err(format!("must be two finite numbers in increasing order, got {low} and {high}"))
            }
            Self::LogUniform([low, _]) if *low <= 0.0 => Err(format!("must be more than 0, got {low}")),
            Self::Normal([mean, deviation]) if !(mean.is_finite() && *deviation > 0.0 && deviation.is_finite()) => {
                Err(format!("must be a finite mean and a positive deviation, got {mean} and {deviation}"))
            }
            Self::Integer([low, high]) if low >= high => {
                Err(format!("must be two integers in increasing order, got {low} and {high}"))
            }
            Self::List(values) | Self::Grid(Grid::Listed(values)) if values.is_empty() => {
                Err("must have at least one value".to_owned())
            }
            Self::Grid(Grid::Spaced { from, to, count })
                if *count < 2 || !(from < to && from.is_finite() && to.is_finite()) =>
            {
                Err(format!("must be at least 2 values in increasing order, got {count} values from {from} to {to}"))
            }
            _ => Ok(variation),
        }
    }

    /// Returns whether all values are equal.
    #[must_use]
    pub fn is_constant(&self) -> bool {
        match self {
            Self::List(values) | Self::Grid(Grid::Listed(values)) => values.iter().all(|value| *value == values[0]),
            _ => false,
        }
    }

    /// Returns whether the values are listed.
    #[must_use]
    pub fn is_listed(&self) -> bool {
        matches!(self, Self::List(_) | Self::Grid(_))
    }

    /// Returns the number of values of a grid; `None` for drawn values.
    #[must_use]
    pub fn grid_len(&self) -> Option<u64> {
        if let Self::Grid(grid) = self { Some(grid.len()) } else { None }
    }

    /// Returns values that show whether the key takes all values: the ends of a range, or all listed values.
    #[must_use]
    pub fn samples(&self) -> Vec<toml::Value> {
        let ends = |[low, high]: [f64; 2]| vec![toml::Value::Float(low), toml::Value::Float(high)];
        match self {
            Self::Seed => vec![toml::Value::Integer(0)],
            Self::Uniform(between) | Self::LogUniform(between) => ends(*between),
            Self::Normal([mean, _]) => vec![toml::Value::Float(*mean)],
            Self::Integer(between) => between.map(toml::Value::Integer).to_vec(),
            Self::List(values) | Self::Grid(Grid::Listed(values)) => values.clone(),
            Self::Grid(Grid::Spaced { from, to, .. }) => ends([*from, *to]),
        }
    }

    /// Returns the value of a run: drawn from the campaign's seed, the key and the run's number only, or the value of a
    /// grid with index `place`.
    #[must_use]
    pub fn value(&self, seed: u64, key: &str, run: u64, place: u64) -> toml::Value {
        let mut random = Random::of(seed, key, run);
        match self {
            Self::Seed => toml::Value::Integer((random.word() >> (u64::BITS - SEED_BITS)).cast_signed()),
            Self::Uniform([low, high]) => toml::Value::Float(between(*low, *high, random.unit())),
            Self::LogUniform([low, high]) => {
                let drawn = libm::exp(between(libm::log(*low), libm::log(*high), random.unit()));
                toml::Value::Float(drawn.clamp(*low, *high))
            }
            Self::Normal([mean, deviation]) => toml::Value::Float(mean + deviation * random.normal()),
            Self::Integer([low, high]) => {
                let drawn = random.below(high.abs_diff(*low).saturating_add(1));
                toml::Value::Integer(low.saturating_add_unsigned(drawn))
            }
            Self::List(values) => {
                let drawn = usize::try_from(random.below(values.len() as u64)).ok();
                drawn.and_then(|drawn| values.get(drawn)).cloned().unwrap_or(toml::Value::Boolean(false))
            }
            Self::Grid(grid) => grid.at(place),
        }
    }
}

fn between(low: f64, high: f64, part: f64) -> f64 {
    ((1.0 - part) * low + part * high).clamp(low, high)
}

/// `ChaCha8` stream of a key and a run, independent of all others.
struct Random(ChaCha8Rng);

impl Random {
    fn of(seed: u64, key: &str, run: u64) -> Self {
        let hash = Sha256::new().chain_update(seed.to_le_bytes()).chain_update(key.as_bytes()).finalize();
        let mut random = ChaCha8Rng::from_seed(hash.into());
        random.set_stream(run);
        Self(random)
    }

    fn word(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// Draws a number uniform in \[0, 1), a multiple of 2^-53.
    fn unit(&mut self) -> f64 {
        const SCALE: f64 = 1.0 / (1_u64 << SEED_BITS) as f64;
        (self.word() >> (u64::BITS - SEED_BITS)) as f64 * SCALE
    }

    /// Draws an integer below `end`. Words that would favour small results are rejected.
    fn below(&mut self, end: u64) -> u64 {
        let fair = u64::MAX - u64::MAX % end.max(1);
        loop {
            let word = self.word();
            if word < fair {
                return word % end.max(1);
            }
        }
    }

    /// Draws a normal number with mean 0 and variance 1, by Box and Muller.
    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * libm::log(1.0 - self.unit())).sqrt();
        radius * libm::cos(TAU * self.unit())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Variation, String> {
        let table: toml::Table = text.parse().expect("TOML");
        Variation::read(&table["key"])
    }

    fn numbers(text: &str, count: u64) -> Vec<f64> {
        let variation = parse(text).expect("a variation");
        let value = |run| match variation.value(7, "key", run, run) {
            toml::Value::Float(value) => value,
            toml::Value::Integer(value) => value as f64,
            other => panic!("{other}"),
        };
        (0..count).map(value).collect()
    }

    #[test]
    fn drawn_numbers_have_the_stated_moments() {
        const COUNT: u64 = 20_000;
        let mean =
            |values: &[f64], of: &dyn Fn(f64) -> f64| values.iter().map(|&value| of(value)).sum::<f64>() / COUNT as f64;
        // Five standard deviations of the mean of `COUNT` numbers.
        let near = |found: f64, expected: f64, variance: f64| {
            assert!((found - expected).abs() < 5.0 * (variance / COUNT as f64).sqrt(), "{found} for {expected}");
        };
        let uniform = numbers("key = { uniform = [2.0, 6.0] }", COUNT);
        near(mean(&uniform, &|x| x), 4.0, 16.0 / 12.0);
        assert!(uniform.iter().all(|x| (2.0..=6.0).contains(x)));
        let spread = numbers("key = { log_uniform = [0.01, 100.0] }", COUNT);
        near(mean(&spread, &f64::log10), 0.0, 16.0 / 12.0);
        let normal = numbers("key = { normal = [3.0, 0.5] }", COUNT);
        near(mean(&normal, &|x| x), 3.0, 0.25);
        near(mean(&normal, &|x| (x - 3.0).powi(2)), 0.25, 2.0 * 0.25 * 0.25);
        let whole = numbers("key = { integer = [-1, 4] }", COUNT);
        near(mean(&whole, &|x| x), 1.5, 35.0 / 12.0);
        for value in -1..=4 {
            near(mean(&whole, &|x| f64::from(x == f64::from(value))), 1.0 / 6.0, 5.0 / 36.0);
        }
        near(mean(&numbers("key = { list = [10, 20] }", COUNT), &|x| x), 15.0, 25.0);
        let seeds = numbers("key = 'run'", COUNT);
        assert!(seeds.iter().all(|seed| (0.0..9.1e15).contains(seed)));
        let mut distinct: Vec<_> = seeds.iter().map(|seed| seed.to_bits()).collect();
        distinct.sort_unstable();
        distinct.dedup();
        assert_eq!(distinct.len() as u64, COUNT);
    }

    #[test]
    fn a_grid_is_flown_in_turn() {
        assert_eq!(numbers("key = { grid = { from = 1.0, to = 3.0, count = 5 } }", 5), [1.0, 1.5, 2.0, 2.5, 3.0]);
        assert_eq!(numbers("key = { grid = [4, 2] }", 2), [4.0, 2.0]);
    }

    #[test]
    fn keys_runs_and_seeds_have_independent_numbers() {
        let uniform = Variation::Uniform([0.0, 1.0]);
        let drawn = [(7, "a", 0), (7, "b", 0), (7, "a", 1), (8, "a", 0)]
            .map(|(seed, key, run)| uniform.value(seed, key, run, 0).as_float().expect("a number").to_bits());
        assert!((0..4).all(|i| (0..i).all(|j| drawn[i] != drawn[j])), "{drawn:?}");
        assert_eq!(uniform.value(7, "a", 0, 0), uniform.value(7, "a", 0, 5));
    }

    #[test]
    fn a_value_that_is_not_a_variation_is_refused() {
        for wrong in [
            "key = 3",
            "key = 'seed'",
            "key = { unifrom = [0, 1] }",
            "key = { uniform = [1.0, 1.0] }",
            "key = { uniform = [0.0, inf] }",
            "key = { uniform = [0.0, nan] }",
            "key = { uniform = [0.0, 1.0, 2.0] }",
            "key = { log_uniform = [0.0, 1.0] }",
            "key = { normal = [0.0, 0.0] }",
            "key = { integer = [2, 2] }",
            "key = { list = [] }",
            "key = { grid = [] }",
            "key = { grid = { from = 0.0, to = 1.0, count = 1 } }",
            "key = { grid = { from = 1.0, to = 0.0, count = 3 } }",
        ] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
    }
}
