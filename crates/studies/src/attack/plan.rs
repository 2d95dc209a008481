//! What may be varied, and how far.

use super::bounds::{Bound, Variation};
use super::method::Method;
use tautline_core::swarm::{Rows, separation};
use tautline_core::text::as_toml;
use tautline_sim::scenario::{Override, Scenario, ScenarioError, Source, takes_integers_only};
use tautline_sim::sim::SimError;

/// A place between two bounds, neither an end nor the middle, at which a key is tried.
const BETWEEN: f64 = 0.381_966;

/// The axes of a point, as keys have them.
const AXES: [&str; 3] = ["x", "y", "z"];

/// What is asked of a search.
#[derive(Clone, Debug, PartialEq)]
pub struct Asked {
    /// Keys, each between two values.
    pub vary: Vec<Variation>,
    /// How far each start may be from that of the scenario along each axis \[m\].
    pub start_m: Option<f64>,
    /// How far each velocity at the start may be from that of the scenario along each axis \[m/s\].
    pub velocity_m_s: Option<f64>,
    /// How far apart any two are at least at the start, more than delta \[m\]; none for any start that can be flown.
    pub apart_m: Option<f64>,
    /// How candidates are found.
    pub method: Method,
    /// Flights of the whole search.
    pub flights: u64,
    /// Flights of each candidate, with the scenario's seed of noise and those that follow it; the worst counts.
    pub seeds: u64,
    /// Seed of the search itself.
    pub seed: u64,
}

/// A scenario and what may be varied of it.
#[derive(Clone, Debug)]
pub struct Plan {
    source: Source,
    overrides: Vec<Override>,
    own: Scenario,
    asked: Asked,
    bounds: Vec<Bound>,
}

/// Why there is no such search.
#[derive(Debug, thiserror::Error)]
pub enum AttackError {
    /// Nothing is varied.
    #[error("nothing is varied: the one flight that there is to search is the scenario's own")]
    Nothing,
    /// A key that is named twice, or that the start as a whole is varied with.
    #[error("{0} is varied twice")]
    Twice(String),
    /// A seed, of which another value is other luck and no other situation.
    #[error("{0} is a seed: another one is other luck and not a worse situation")]
    Seed(String),
    /// How far the start may be is no positive finite number.
    #[error("{what} is to be varied by {by}")]
    Reach {
        /// What.
        what: &'static str,
        /// By how much.
        by: f64,
    },
    /// How far apart starts are to be is less than the scenario asks for, or more than its own are.
    #[error(
        "starts are to be {apart_m} m apart, where delta is {delta_m} m and the scenario's own are {own_m} m apart"
    )]
    Apart {
        /// How far they are to be.
        apart_m: f64,
        /// The safety distance.
        delta_m: f64,
        /// Smallest distance of two starts of the scenario.
        own_m: f64,
    },
    /// Not even one candidate can be flown.
    #[error("of {flights} flights none is left for a candidate that is flown with {seeds} seeds")]
    Flights {
        /// Flights that were asked for.
        flights: u64,
        /// Flights of a candidate.
        seeds: u64,
    },
    /// Several seeds where chance has no part.
    #[error("nothing in the flight is random: with each of {0} seeds it is the same")]
    Seeds(u64),
    /// A scenario that cannot be flown.
    #[error("with {set}: {error}")]
    Scenario {
        /// The key and the value.
        set: String,
        /// What is wrong.
        error: ScenarioError,
    },
    /// A law or a judge that does not exist.
    #[error("with {set}: {error}")]
    Flight {
        /// The keys and their values.
        set: String,
        /// What is wrong.
        error: SimError,
    },
}

impl Plan {
    /// A search over what is asked, all else being as the source and its overrides say.
    ///
    /// The source must be one that can be read again: standard input is read by [`Source::resolve`] once.
    ///
    /// # Errors
    /// [`AttackError`] where nothing or something twice is varied, for a key that is no number of the scenario, and where the
    /// scenario itself cannot be flown.
    pub fn new(source: Source, overrides: &[Override], asked: Asked) -> Result<Self, AttackError> {
        let as_it_is = |error| AttackError::Scenario { set: "the keys as they are".to_owned(), error };
        let own = Scenario::read(&source, overrides).map_err(as_it_is)?;
        if asked.seeds == 0 || asked.flights < asked.seeds {
            return Err(AttackError::Flights { flights: asked.flights, seeds: asked.seeds });
        }
        let mut plan = Self { source, overrides: overrides.to_vec(), own, asked, bounds: Vec::new() };
        let mut is_random = plan.own.is_random_in_flight();
        for variation in plan.asked.vary.clone() {
            plan.check_key(&variation.key)?;
            let (bound, varied) = plan.bound(&variation)?;
            is_random |= varied.is_random_in_flight();
            plan.bounds.push(bound);
        }
        let reaches = [("the start", plan.asked.start_m), ("the velocity at the start", plan.asked.velocity_m_s)];
        for (what, by) in reaches.into_iter().filter_map(|(what, by)| Some((what, by?))) {
            if !(by.is_finite() && by > 0.0) {
                return Err(AttackError::Reach { what, by });
            }
        }
        plan.check_apart()?;
        plan.bounds.extend(plan.start_bounds());
        if plan.bounds.is_empty() {
            return Err(AttackError::Nothing);
        }
        if plan.asked.seeds > 1 && !is_random {
            return Err(AttackError::Seeds(plan.asked.seeds));
        }
        Ok(plan)
    }

    /// The scenario as it is.
    #[must_use]
    pub fn own(&self) -> &Scenario {
        &self.own
    }

    /// What is asked.
    #[must_use]
    pub fn asked(&self) -> &Asked {
        &self.asked
    }

    /// Each number that is free, and its bounds.
    #[must_use]
    pub fn bounds(&self) -> &[Bound] {
        &self.bounds
    }

    /// Steps of all flights, as far as they are flown to their end.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.own.time.steps().saturating_mul(self.asked.flights.saturating_add(1))
    }

    /// The value of each number at places from 0 to 1.
    #[must_use]
    pub fn values(&self, places: &[f64]) -> Vec<f64> {
        self.bounds.iter().zip(places).map(|(bound, &place)| bound.at(place)).collect()
    }

    /// The overrides that every flight has.
    #[must_use]
    pub fn overrides(&self) -> &[Override] {
        &self.overrides
    }

    /// The overrides that fly a candidate of these values with the `k`-th seed of noise, from 0, on top of those that every
    /// flight has.
    #[must_use]
    pub fn sets(&self, values: &[f64], k: u64) -> Vec<String> {
        let of_keys = self.asked.vary.len();
        let keys = self.bounds.iter().zip(values).take(of_keys);
        let mut sets: Vec<_> = keys.map(|(bound, &value)| format!("{}={}", bound.key, as_toml(value))).collect();
        sets.extend(self.start(values.get(of_keys..).unwrap_or_default()));
        if self.asked.seeds > 1 {
            sets.push(format!("noise.seed={}", self.noise_seed(k)));
        }
        sets
    }

    /// The seed of noise of a candidate's `k`-th flight, from 0.
    #[must_use]
    pub fn noise_seed(&self, k: u64) -> u64 {
        self.own.noise_seed.saturating_add(k)
    }

    /// The flights of a candidate, one for each seed of noise.
    ///
    /// # Errors
    /// Why they are no attack: what cannot be flown, such as a start of two vehicles within delta, or a start of two nearer than asked.
    pub(super) fn candidate(&self, values: &[f64]) -> Result<Vec<Scenario>, String> {
        let flight = |k: u64| {
            let scenario = self.scenario(values, k).map_err(|error| error.message().to_owned())?;
            scenario.law().map_err(|error| error.to_string())?;
            let near_m = self.asked.apart_m.map(|apart_m| (apart_m, closest_start_m(&scenario)));
            match near_m {
                Some((apart_m, near_m)) if near_m < apart_m => {
                    Err(format!("two vehicles start {near_m} m apart, nearer than the {apart_m} m that were asked for"))
                }
                _ => Ok(scenario),
            }
        };
        (0..self.asked.seeds).map(flight).collect()
    }

    /// The flight of a candidate with the `k`-th seed of noise.
    ///
    /// # Errors
    /// [`ScenarioError`] where it cannot be flown, as a start of two vehicles within delta.
    pub fn scenario(&self, values: &[f64], k: u64) -> Result<Scenario, ScenarioError> {
        self.with(&self.sets(values, k))
    }

    fn with(&self, sets: &[String]) -> Result<Scenario, ScenarioError> {
        let more = sets.iter().map(|set| Override::parse(set)).collect::<Result<Vec<_>, _>>()?;
        Scenario::read(&self.source, &[self.overrides.as_slice(), &more].concat())
    }

    fn check_key(&self, key: &str) -> Result<(), AttackError> {
        let Asked { start_m, velocity_m_s, .. } = self.asked;
        let same = |a: &str, b: &str| a == b || a.starts_with(&format!("{b}.")) || b.starts_with(&format!("{a}."));
        let twice = self.bounds.iter().any(|bound| same(&numbered(&bound.key), &numbered(key)));
        let of_start = (start_m.is_some() || velocity_m_s.is_some()) && same(key, "start");
        if twice || of_start {
            return Err(AttackError::Twice(key.to_owned()));
        }
        if key.rsplit('.').next() == Some("seed") {
            return Err(AttackError::Seed(key.to_owned()));
        }
        Ok(())
    }

    /// The scenario itself must be a candidate: where it is none, hardly any is.
    fn check_apart(&self) -> Result<(), AttackError> {
        let Some(apart_m) = self.asked.apart_m else { return Ok(()) };
        let (delta_m, own_m) = (self.own.delta_m, closest_start_m(&self.own));
        let is_asked = apart_m.is_finite() && apart_m > delta_m && own_m >= apart_m;
        if is_asked { Ok(()) } else { Err(AttackError::Apart { apart_m, delta_m, own_m }) }
    }

    /// The bound of a key, and a scenario with a value in it.
    ///
    /// # Errors
    /// [`AttackError::Scenario`] where neither a value between the bounds nor a bound can be read, and for a bound with a fraction
    /// of a key that takes whole numbers alone.
    fn bound(&self, variation: &Variation) -> Result<(Bound, Scenario), AttackError> {
        let Variation { ref key, low, high } = *variation;
        let read = |value: f64| self.with(&[format!("{key}={}", as_toml(value))]);
        let whole = takes_integers_only(&self.source, &self.overrides, key);
        let refused = |value: f64| move |error| AttackError::Scenario { set: format!("{key} = {value}"), error };
        if let Some(end) = [low, high].into_iter().find(|end| whole && end.fract() != 0.0) {
            read(end).map_err(refused(end))?;
        }
        let bound = variation.bound(whole);
        if let Ok(scenario) = read(bound.at(BETWEEN)) {
            return Ok((bound, scenario));
        }
        // What cannot be flown at one end may be at the other.
        let scenario = read(low).or_else(|error| read(high).map_err(|_| error)).map_err(refused(low))?;
        Ok((bound, scenario))
    }

    /// What `--start` and `--velocity` leave free: each coordinate, positions before velocities.
    fn start_bounds(&self) -> Vec<Bound> {
        let of = |list: &str, rows: &Rows, by: Option<f64>| {
            let Some(by) = by else { return Vec::new() };
            let numbers = (0..rows.nrows()).flat_map(|i| (0..self.own.space.dimensions()).map(move |axis| (i, axis)));
            let bound = |(i, axis): (usize, usize)| Bound {
                key: format!("start.{list}.{}.{}", i + 1, AXES[axis]),
                low: rows[(i, axis)] - by,
                high: rows[(i, axis)] + by,
                whole: false,
            };
            numbers.map(bound).collect()
        };
        let start = &self.own.start;
        let mut bounds = of("positions_m", &start.positions_m, self.asked.start_m);
        bounds.extend(of("velocities_m_s", &start.velocities_m_s, self.asked.velocity_m_s));
        bounds
    }

    /// The start as an override, where it is varied as a whole.
    fn start(&self, values: &[f64]) -> Option<String> {
        let Asked { start_m, velocity_m_s, .. } = self.asked;
        (start_m.is_some() || velocity_m_s.is_some()).then(|| {
            let axes = self.own.space.dimensions();
            let count = self.own.count() * axes;
            let split = if start_m.is_some() { count.min(values.len()) } else { 0 };
            let start = &self.own.start;
            let positions = self.list(start_m.map(|_| &values[..split]), &start.positions_m);
            let velocities = self.list(velocity_m_s.map(|_| &values[split..]), &start.velocities_m_s);
            let is_at_rest = velocity_m_s.is_none() && start.velocities_m_s.iter().all(|&speed_m_s| speed_m_s == 0.0);
            let velocities = if is_at_rest { String::new() } else { format!(", velocities_m_s=[{velocities}]") };
            format!("start={{positions_m=[{positions}]{velocities}}}")
        })
    }

    /// Points as TOML: those of the values, or else the rows.
    fn list(&self, values: Option<&[f64]>, rows: &Rows) -> String {
        let axes = self.own.space.dimensions();
        let value = |i: usize, axis: usize| values.and_then(|values| values.get(i * axes + axis).copied());
        let point = |i: usize| {
            let number = |axis: usize| as_toml(value(i, axis).unwrap_or(rows[(i, axis)]));
            format!("[{}]", (0..axes).map(number).collect::<Vec<_>>().join(", "))
        };
        (0..rows.nrows()).map(point).collect::<Vec<_>>().join(", ")
    }
}

/// A key with the numbers of axes for their names.
fn numbered(key: &str) -> String {
    let number = |part: &str| AXES.iter().position(|axis| *axis == part).map(|axis| (axis + 1).to_string());
    key.split('.').map(|part| number(part).unwrap_or_else(|| part.to_owned())).collect::<Vec<_>>().join(".")
}

/// Smallest distance of two starts in the lengths that delta is one of \[m\].
fn closest_start_m(scenario: &Scenario) -> f64 {
    let places = scenario.metric().scaled_rows(&scenario.start.positions_m);
    let count = places.nrows();
    let pairs = (0..count).flat_map(|i| (i + 1..count).map(move |j| (i, j)));
    pairs.map(|(i, j)| separation(&places, i, j)).fold(f64::INFINITY, f64::min)
}
