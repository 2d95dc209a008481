//! How candidates are found.

use serde::Serialize;

use super::cma_es::{CmaEs, usual_population};
use super::fold::folded;
use tautline_laws::wind::Normals;

/// Standard deviation of the first candidates along each axis, of bounds that are 1 apart.
const FIRST_STEP: f64 = 0.3;
/// Standard deviation at which a search has come to rest.
const AT_REST: f64 = 1e-4;
/// Part of delta by which the best of late generations differ where a search has come to rest.
const SAME: f64 = 1e-6;
/// Candidates that random search flies at a time; the answer does not depend on it.
const AT_A_TIME: usize = 16;
/// The population of a restarted search over that before.
const GROWTH: usize = 2;

/// How candidates are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// CMA-ES, started again with twice the population where it has come to rest (IPOP).
    CmaEs,
    /// Uniform within the bounds, each for itself.
    Random,
}

impl Method {
    /// All methods.
    pub const ALL: [Self; 2] = [Self::CmaEs, Self::Random];

    /// The name of the method for `--method`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::CmaEs => "cma-es",
            Self::Random => "random",
        }
    }
}

/// A search under way.
#[derive(Clone, Debug)]
pub(super) struct Searcher {
    chance: Normals,
    dimensions: usize,
    /// Lengths that are the same \[m\].
    same_m: f64,
    cma_es: Option<Descent>,
    restarts: u64,
}

/// One run of CMA-ES.
#[derive(Clone, Debug)]
struct Descent {
    distribution: CmaEs,
    /// The best value of each generation.
    best: Vec<f64>,
}

impl Descent {
    fn new(mean: &[f64], population: usize) -> Self {
        Self { distribution: CmaEs::new(mean, FIRST_STEP, population), best: Vec::new() }
    }

    fn is_at_rest(&self, dimensions: usize, same: f64) -> bool {
        let late = 10 + (30 * dimensions).div_ceil(self.distribution.population());
        let is_flat = self.best.len() > late && {
            let late = &self.best[self.best.len() - late..];
            let [low, high] = [
                late.iter().copied().fold(f64::INFINITY, f64::min),
                late.iter().copied().fold(f64::NEG_INFINITY, f64::max),
            ];
            high - low <= same
        };
        is_flat || self.distribution.is_degenerate() || self.distribution.spread() < AT_REST
    }
}

impl Searcher {
    /// A search in so many dimensions, from the middle of the bounds.
    pub(super) fn new(method: Method, dimensions: usize, delta_m: f64, seed: u64) -> Self {
        let middle = vec![0.5; dimensions];
        let first = || Descent::new(&middle, usual_population(dimensions));
        let cma_es = (method == Method::CmaEs).then(first);
        Self { chance: Normals::new(seed, 0), dimensions, same_m: SAME * delta_m, cma_es, restarts: 0 }
    }

    /// Candidates to be flown before anything is learned from them.
    pub(super) fn generation(&self) -> usize {
        self.cma_es.as_ref().map_or(AT_A_TIME, |descent| descent.distribution.population())
    }

    /// How often it has begun again.
    pub(super) fn restarts(&self) -> u64 {
        self.restarts
    }

    /// A candidate, from anywhere; [`folded`] gives its place within the bounds, from 0 to 1.
    pub(super) fn draw(&mut self) -> Vec<f64> {
        match &self.cma_es {
            Some(descent) => descent.distribution.draw(&mut self.chance),
            None => self.anywhere(),
        }
    }

    /// Takes note of the values of a whole generation.
    pub(super) fn learn(&mut self, candidates: &[Vec<f64>], values: &[f64]) {
        let Some(descent) = &mut self.cma_es else { return };
        descent.distribution.learn(candidates, values);
        descent.best.push(values.iter().copied().fold(f64::INFINITY, f64::min));
        if descent.is_at_rest(self.dimensions, self.same_m) {
            self.begin_again(GROWTH);
        }
    }

    /// Begins again from elsewhere. Random search has nowhere to begin.
    pub(super) fn move_elsewhere(&mut self) {
        self.begin_again(1);
    }

    fn begin_again(&mut self, growth: usize) {
        let Some(descent) = &self.cma_es else { return };
        let population = growth * descent.distribution.population();
        self.restarts += 1;
        self.cma_es = Some(Descent::new(&self.anywhere(), population));
    }

    fn anywhere(&mut self) -> Vec<f64> {
        (0..self.dimensions).map(|_| self.chance.unit()).collect()
    }
}

/// Places within the bounds, from 0 to 1.
pub(super) fn within(method: Method, candidate: &[f64]) -> Vec<f64> {
    match method {
        Method::CmaEs => candidate.iter().copied().map(folded).collect(),
        Method::Random => candidate.to_vec(),
    }
}
