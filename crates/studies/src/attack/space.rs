//! Search space of an attack: the varied numbers, their bounds, and the scenario of each candidate.

use std::fmt;

use serde::Serialize;

use super::Options;
use crate::base::{BaseScenario, overlap, refusal};
use crate::key_range;
use tautline_core::failure::Failure;
use tautline_core::option::{APART, FLIGHTS, MOVE_START, SEEDS, VARY, VELOCITY};
use tautline_core::swarm::{Rows, separation};
use tautline_core::text::{at_least, beside_limit, shortest};
use tautline_sim::scenario::{Scenario, ScenarioError};

/// Point between the bounds, neither an end nor the middle, at which a key is tried.
const BETWEEN: f64 = 0.381_966;
/// Names of axes in keys.
const AXES: [&str; 3] = ["x", "y", "z"];
/// Number of steps between the bounds to which values are rounded, so that few digits repeat a flight.
const STEPS: f64 = 1e6;
/// Most decimals of a value.
const MOST_DECIMALS: u8 = 15;

/// Number that a search varies within bounds: an argument of `--vary`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bound {
    /// Key, as for an override.
    pub key: String,
    /// Smallest value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// Whether the number is an integer. A search sets it from the key.
    pub whole: bool,
}

impl fmt::Display for Bound {
    /// Writes the form that [`Bound::parse`] reads.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}..{}", self.key, self.low, self.high)
    }
}

impl Bound {
    /// Parses `KEY=FROM..TO`.
    ///
    /// # Errors
    /// [`Failure`] `attack/variation`.
    pub fn parse(text: &str) -> Result<Self, Failure> {
        let (key, [low, high]) = key_range(text).map_err(|why| wrong(text, &why))?;
        Self::new(&key, low, high)
    }

    /// Returns the bounds of a key.
    ///
    /// # Errors
    /// [`Failure`] `attack/variation` unless the values are finite and in increasing order.
    pub fn new(key: &str, low: f64, high: f64) -> Result<Self, Failure> {
        if !(low.is_finite() && high.is_finite() && (high - low).is_finite()) {
            return Err(wrong(&format!("{key}={low}..{high}"), "the range must be finite"));
        }
        if low >= high {
            return Err(wrong(&format!("{key}={low}..{high}"), "the range must be in increasing order"));
        }
        Ok(Self { key: key.to_owned(), low, high, whole: false })
    }

    /// Returns the value at a point from 0 to 1 between the bounds, rounded to an integer or to a millionth of their
    /// distance.
    #[must_use]
    pub fn at(&self, place: f64) -> f64 {
        let Self { low, high, whole, .. } = *self;
        if whole {
            // Each integer has the same share of the interval from 0 to 1.
            return (low + ((high - low + 1.0) * place).floor()).clamp(low, high);
        }
        let value = low + (high - low) * place;
        let decimals = tautline_core::text::decimals_of((high - low) / STEPS, MOST_DECIMALS);
        let rounded = format!("{value:.decimals$}").parse().unwrap_or(value);
        // Adding 0 turns -0 into 0.
        f64::clamp(rounded, low, high) + 0.0
    }
}

/// Returns the failure of an argument of `--vary`.
fn wrong(text: &str, why: &str) -> Failure {
    let example = VARY.set("sensing.latency_s=0..0.1");
    let help = format!("write a numeric key and two finite numbers in increasing order, such as {example}");
    Failure::input("attack/variation", format!("{}: {why}", VARY.set(text)), help)
}

/// Varied numbers of a search, and the scenario that they change.
#[derive(Clone, Debug)]
pub struct SearchSpace {
    base: BaseScenario,
    options: Options,
    bounds: Vec<Bound>,
}

impl SearchSpace {
    /// Returns the space of a search. All other keys keep the values of the scenario.
    ///
    /// # Errors
    /// [`Failure`] if nothing is varied, a key is varied twice, a key is not a number of the scenario, or the numbers
    /// of flights and seeds do not fit.
    pub fn new(base: &BaseScenario, options: &Options) -> Result<Self, Failure> {
        let Options { flights, seeds, start_m, velocity_m_s, .. } = *options;
        if seeds == 0 || flights < seeds {
            return Err(Failure::input(
                "attack/too-few-flights",
                format!("{}: must be at least {seeds}, the number of {SEEDS}", FLIGHTS.set(flights)),
                "give more flights or fewer seeds",
            ));
        }
        let mut space = Self { base: base.clone(), options: options.clone(), bounds: Vec::new() };
        let mut is_random = base.own().is_random_in_flight();
        for bound in &options.vary {
            space.check_key(&bound.key)?;
            let (bound, varied) = space.bound(bound)?;
            is_random |= varied.is_random_in_flight();
            space.bounds.push(bound);
        }
        let reaches = [(MOVE_START, start_m), (VELOCITY, velocity_m_s)];
        for (option, by) in reaches.into_iter().filter_map(|(option, by)| Some((option, by?))) {
            if !(by.is_finite() && by > 0.0) {
                return Err(Failure::input(
                    "attack/out-of-range",
                    format!("{}: must be a finite number above 0", option.set(by)),
                    format!("give {MOVE_START} in metres and {VELOCITY} in metres per second"),
                ));
            }
        }
        space.check_apart()?;
        space.bounds.extend(space.start_bounds());
        if space.bounds.is_empty() {
            let (start, key) = (MOVE_START.set(1), VARY.set("sensing.latency_s=0..0.1"));
            return Err(Failure::input(
                "attack/nothing-varied",
                "nothing is varied",
                format!("vary starts, such as {start} (up to 1 m), or a key, such as {key}"),
            ));
        }
        if seeds > 1 && !is_random {
            let given = SEEDS.set(seeds);
            return Err(Failure::input(
                "attack/nothing-random",
                format!("{given}: nothing in the flight is random, so all seeds give the same flight"),
                format!("leave {SEEDS} out, or add turbulence, noise of measurement, loss or jitter to the scenario"),
            ));
        }
        Ok(space)
    }

    /// Returns the varied numbers with their bounds.
    #[must_use]
    pub fn bounds(&self) -> &[Bound] {
        &self.bounds
    }

    /// Returns the values at points from 0 to 1.
    #[must_use]
    pub fn values(&self, places: &[f64]) -> Vec<f64> {
        self.bounds.iter().zip(places).map(|(bound, &place)| bound.at(place)).collect()
    }

    /// Returns the overrides that fly a candidate with the `k`-th seed of noise, from 0, after the overrides of the
    /// call.
    #[must_use]
    pub fn sets(&self, values: &[f64], k: u64) -> Vec<String> {
        let of_keys = self.options.vary.len();
        let keys = self.bounds.iter().zip(values).take(of_keys);
        let mut sets: Vec<_> = keys.map(|(bound, &value)| format!("{}={}", bound.key, shortest(value))).collect();
        sets.extend(self.start(values.get(of_keys..).unwrap_or_default()));
        if self.options.seeds > 1 {
            sets.push(format!("noise.seed={}", self.noise_seed(k)));
        }
        sets
    }

    /// Returns the seed of noise of a candidate's `k`-th flight, from 0.
    #[must_use]
    pub fn noise_seed(&self, k: u64) -> u64 {
        self.base.own().noise_seed.saturating_add(k)
    }

    /// Returns the flights of a candidate, one for each seed of noise.
    ///
    /// # Errors
    /// The reason of a refusal: the candidate cannot be flown, or two vehicles start closer than `apart_m`.
    pub fn candidate(&self, values: &[f64]) -> Result<Vec<Scenario>, String> {
        let flight = |k: u64| {
            let scenario = self.scenario(values, k).map_err(refusal)?;
            scenario.law().map_err(|error| error.to_string())?;
            let near_m = self.options.apart_m.map(|apart_m| (apart_m, closest_start_m(&scenario)));
            match near_m {
                Some((apart_m, near_m)) if near_m < apart_m => {
                    let near = beside_limit(near_m, apart_m, 3);
                    Err(format!("two vehicles start {near} m apart, less than {} m", APART.set(apart_m)))
                }
                _ => Ok(scenario),
            }
        };
        (0..self.options.seeds).map(flight).collect()
    }

    /// Returns the flight of a candidate with the `k`-th seed of noise.
    ///
    /// # Errors
    /// [`ScenarioError`] if the candidate cannot be flown, such as a start of two vehicles within delta.
    pub fn scenario(&self, values: &[f64], k: u64) -> Result<Scenario, ScenarioError> {
        self.base.with(&self.sets(values, k))
    }

    fn check_key(&self, key: &str) -> Result<(), Failure> {
        let Options { start_m, velocity_m_s, .. } = self.options;
        let twice = self.bounds.iter().any(|bound| overlap(&bound.key, key));
        let of_start = (start_m.is_some() || velocity_m_s.is_some()) && overlap(key, "start");
        if twice || of_start {
            return Err(Failure::input(
                "attack/key-twice",
                format!("{}: the key is varied twice", VARY.set(key)),
                format!("vary each key once; {MOVE_START} and {VELOCITY} vary the whole of [start]"),
            ));
        }
        if key.rsplit('.').next() == Some("seed") {
            let (given, seeds) = (VARY.set(key), SEEDS.set("K"));
            return Err(Failure::input(
                "attack/seed-varied",
                format!("{given}: the key is a seed, and varying a seed does not make a scenario harder"),
                format!("leave the seed out; {seeds} flies each candidate with K seeds of noise"),
            ));
        }
        Ok(())
    }

    /// Refuses an `apart_m` that the scenario's own start does not satisfy: hardly any candidate would.
    fn check_apart(&self) -> Result<(), Failure> {
        let Some(apart_m) = self.options.apart_m else { return Ok(()) };
        let (delta_m, own_m) = (self.base.own().delta_m, closest_start_m(self.base.own()));
        if apart_m.is_finite() && apart_m > delta_m && own_m >= apart_m {
            return Ok(());
        }
        Err(Failure::input(
            "attack/out-of-range",
            format!(
                "{}: must be more than delta ({delta_m} m) and at most {} m, the smallest separation of the scenario's \
                 start",
                APART.set(apart_m),
                at_least(own_m, 3)
            ),
            format!("give a distance in this range, or leave {APART} out"),
        ))
    }

    /// Returns a bound that states whether its key takes integers only, and a scenario with a value within the bound.
    ///
    /// # Errors
    /// [`Failure`] if no tried value can be read, and for a fractional bound of a key that takes integers only.
    fn bound(&self, bound: &Bound) -> Result<(Bound, Scenario), Failure> {
        let Bound { ref key, low, high, .. } = *bound;
        let read = |value: f64| self.base.with(&[format!("{key}={}", shortest(value))]);
        let refused = |value: f64, error: ScenarioError| Failure::from(error).under(&format!("with {key} = {value}"));
        let whole = self.base.takes_integers_only(key);
        if let Some(end) = [low, high].into_iter().find(|end| whole && end.fract() != 0.0) {
            read(end).map_err(|error| refused(end, error))?;
        }
        let bound = Bound { whole, ..bound.clone() };
        if let Ok(scenario) = read(bound.at(BETWEEN)) {
            return Ok((bound, scenario));
        }
        // A value that cannot be flown at one end may be valid at the other.
        let scenario = read(low).or_else(|error| read(high).map_err(|_| refused(low, error)))?;
        Ok((bound, scenario))
    }

    /// Returns the bounds of `--move-start` and `--velocity` for each coordinate, positions before velocities.
    fn start_bounds(&self) -> Vec<Bound> {
        let bounds_of = |list: &str, rows: &Rows, by: Option<f64>| {
            let Some(by) = by else { return Vec::new() };
            let numbers =
                (0..rows.nrows()).flat_map(|i| (0..self.base.own().space.dimensions()).map(move |axis| (i, axis)));
            let bound = |(i, axis): (usize, usize)| Bound {
                key: format!("start.{list}.{}.{}", i + 1, AXES[axis]),
                low: rows[(i, axis)] - by,
                high: rows[(i, axis)] + by,
                whole: false,
            };
            numbers.map(bound).collect()
        };
        let start = &self.base.own().start;
        let mut bounds = bounds_of("positions_m", &start.positions_m, self.options.start_m);
        bounds.extend(bounds_of("velocities_m_s", &start.velocities_m_s, self.options.velocity_m_s));
        bounds
    }

    /// Returns the whole start as an override, if it is varied as a whole.
    fn start(&self, values: &[f64]) -> Option<String> {
        let Options { start_m, velocity_m_s, .. } = self.options;
        (start_m.is_some() || velocity_m_s.is_some()).then(|| {
            let axes = self.base.own().space.dimensions();
            let count = self.base.own().count() * axes;
            let split = if start_m.is_some() { count.min(values.len()) } else { 0 };
            let start = &self.base.own().start;
            let positions = self.list(start_m.map(|_| &values[..split]), &start.positions_m);
            let velocities = self.list(velocity_m_s.map(|_| &values[split..]), &start.velocities_m_s);
            let is_at_rest = velocity_m_s.is_none() && start.velocities_m_s.iter().all(|&speed_m_s| speed_m_s == 0.0);
            let velocities = if is_at_rest { String::new() } else { format!(", velocities_m_s=[{velocities}]") };
            format!("start={{positions_m=[{positions}]{velocities}}}")
        })
    }

    /// Returns points as TOML: the given values, or else the rows.
    fn list(&self, values: Option<&[f64]>, rows: &Rows) -> String {
        let axes = self.base.own().space.dimensions();
        let value = |i: usize, axis: usize| values.and_then(|values| values.get(i * axes + axis).copied());
        let point = |i: usize| {
            let number = |axis: usize| shortest(value(i, axis).unwrap_or(rows[(i, axis)]));
            format!("[{}]", (0..axes).map(number).collect::<Vec<_>>().join(", "))
        };
        (0..rows.nrows()).map(point).collect::<Vec<_>>().join(", ")
    }
}

/// Returns the smallest separation of two starts, in the metric of delta \[m\].
fn closest_start_m(scenario: &Scenario) -> f64 {
    let places = scenario.metric().scaled_rows(&scenario.start.positions_m);
    let count = places.nrows();
    let pairs = (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j)));
    pairs.map(|(i, j)| separation(&places, i, j)).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_parsed() {
        let read = Bound::parse("start.positions_m.2.x = -1.5..0.25");
        let expected = Bound::new("start.positions_m.2.x", -1.5, 0.25);
        assert_eq!(read.expect("a bound"), expected.expect("a bound"));
        for (text, why) in [
            ("law.alpha", "is not KEY=FROM..TO"),
            ("law.alpha=1", "is not KEY=FROM..TO"),
            ("law.alpha=1..", "`` is not a number"),
            ("law.alpha=1...2", "has more than two points"),
            ("law.alpha=a..2", "`a` is not a number"),
            ("law.alpha=2..2", "must be in increasing order"),
            ("law.alpha=3..2", "must be in increasing order"),
            ("law.alpha=0..inf", "law.alpha=0..inf: the range must be finite"),
            ("law.alpha=nan..1", "law.alpha=NaN..1: the range must be finite"),
            ("law.alpha=-1e308..1e308", "must be finite"),
        ] {
            let refused = Bound::parse(text).expect_err(text);
            assert!(refused.message().contains(why), "{text}: {refused}");
        }
    }

    #[test]
    fn values_have_few_digits_and_stay_within_their_bounds() {
        let bound = Bound::new("key", -0.1, 2.0 / 3.0).expect("a bound");
        assert_eq!([bound.at(0.0), bound.at(1.0)], [bound.low, bound.high]);
        for k in 0..=1000 {
            let value = bound.at(f64::from(k) / 1000.0);
            assert!((bound.low..=bound.high).contains(&value), "{value}");
            assert!(k == 1000 || value.to_string().len() <= "-0.1234567".len(), "{value}");
        }
        let whole = Bound { whole: true, ..Bound::new("key", 1.0, 3.0).expect("a bound") };
        assert_eq!([0.0, 0.3, 0.34, 0.66, 0.67, 1.0].map(|place| whole.at(place)), [1.0, 1.0, 2.0, 2.0, 3.0, 3.0]);
    }
}
