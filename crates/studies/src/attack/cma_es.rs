//! CMA-ES with restarts: minimises a function of a box by samples from a normal distribution that adapts.
//!
//! Reference: N. Hansen, *The CMA evolution strategy: a tutorial* (2016), with its default parameters and positive
//! weights. A generation of candidates is drawn first and evaluated afterwards, so any number of threads may evaluate
//! it. Sums run in a fixed order and elementary functions come from `libm`: a seed gives the same candidates on every
//! machine.
//!
//! [`Optimiser`] restarts a converged search with twice the population (IPOP). [`folded`] maps candidates into their
//! bounds.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use tautline_laws::wind::Normals;

/// Initial standard deviation along each axis, for bounds that are 1 apart.
const FIRST_STEP: f64 = 0.3;
/// Standard deviation at which a search has converged.
const CONVERGED_STEP: f64 = 1e-4;
/// Range of the best values of the last generations, divided by delta, at which a search has converged.
const CONVERGED_VALUE: f64 = 1e-6;
/// Population of a restarted search, divided by the population before.
const GROWTH: usize = 2;
/// Width of the parabolic zone at each bound, for bounds that are 1 apart.
const BENT: f64 = 0.05;
/// Largest condition number of the covariance: above it, `f64` has too few digits.
const WORST_CONDITION: f64 = 1e14;

/// Normal distribution from which candidates are drawn.
#[derive(Clone, Debug)]
pub(super) struct CmaEs {
    mean: DVector<f64>,
    /// Global step size sigma.
    step: f64,
    covariance: DMatrix<f64>,
    /// Eigenvectors of the covariance, one per column.
    axes: DMatrix<f64>,
    /// Square roots of the eigenvalues.
    lengths: DVector<f64>,
    /// Evolution path of the step size.
    path_step: DVector<f64>,
    path_covariance: DVector<f64>,
    generation: u32,
    rates: Rates,
}

/// Constants of a search.
#[derive(Clone, Debug)]
struct Rates {
    population: usize,
    weights: Vec<f64>,
    /// Variance-effective number of parents.
    parents: f64,
    path_step: f64,
    damping: f64,
    path_covariance: f64,
    rank_one: f64,
    rank_many: f64,
    /// Expected norm of a vector of standard normal numbers.
    expected: f64,
}

/// Returns the default population: 4 + 3 ln n in n dimensions.
pub(super) fn default_population(dimensions: usize) -> usize {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive and far below 2^32")]
    let more = (3.0 * libm::log(dimensions.max(1) as f64)) as usize;
    4 + more
}

impl Rates {
    fn of(dimensions: usize, population: usize) -> Self {
        let n = dimensions as f64;
        let raw: Vec<_> = (1..=population / 2)
            .map(|rank| libm::log(f64::midpoint(population as f64, 1.0)) - libm::log(rank as f64))
            .collect();
        let sum: f64 = raw.iter().sum();
        let weights: Vec<_> = raw.iter().map(|weight| weight / sum).collect();
        let parents = 1.0 / weights.iter().map(|weight| weight * weight).sum::<f64>();
        let path_step = (parents + 2.0) / (n + parents + 5.0);
        let rank_one = 2.0 / ((n + 1.3) * (n + 1.3) + parents);
        let rank_many = 2.0 * (parents - 2.0 + 1.0 / parents) / ((n + 2.0) * (n + 2.0) + parents);
        Self {
            population,
            weights,
            parents,
            path_step,
            damping: 1.0 + 2.0 * (((parents - 1.0) / (n + 1.0)).sqrt() - 1.0).max(0.0) + path_step,
            path_covariance: (4.0 + parents / n) / (n + 4.0 + 2.0 * parents / n),
            rank_one,
            rank_many: rank_many.min(1.0 - rank_one),
            expected: n.sqrt() * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n)),
        }
    }
}

impl CmaEs {
    /// Returns an isotropic distribution around a mean. A generation has `population` candidates, at least 2.
    pub(super) fn new(mean: &[f64], step: f64, population: usize) -> Self {
        let n = mean.len();
        Self {
            mean: DVector::from_column_slice(mean),
            step,
            covariance: DMatrix::identity(n, n),
            axes: DMatrix::identity(n, n),
            lengths: DVector::from_element(n, 1.0),
            path_step: DVector::zeros(n),
            path_covariance: DVector::zeros(n),
            generation: 0,
            rates: Rates::of(n, population.max(2)),
        }
    }

    /// Returns the number of candidates in a generation.
    pub(super) fn population(&self) -> usize {
        self.rates.population
    }

    /// Draws a candidate.
    pub(super) fn draw(&self, normals: &mut Normals) -> Vec<f64> {
        let n = self.mean.len();
        let along = DVector::from_fn(n, |k, _| self.lengths[k] * normals.next());
        (0..n).map(|row| self.mean[row] + self.step * dot(n, |k| self.axes[(row, k)] * along[k])).collect()
    }

    /// Returns the largest standard deviation of a candidate along any direction.
    pub(super) fn spread(&self) -> f64 {
        self.step * self.lengths.max()
    }

    /// Returns whether the covariance is singular to working precision, or not finite.
    pub(super) fn is_degenerate(&self) -> bool {
        let [low, high] = [self.lengths.min(), self.lengths.max()];
        !(self.spread().is_finite() && high * high <= WORST_CONDITION * low * low)
    }

    /// Adapts the distribution to the values of a generation, where lower is better. Of equal values the first is
    /// better.
    pub(super) fn learn(&mut self, candidates: &[Vec<f64>], values: &[f64]) {
        let mut order: Vec<_> = (0..candidates.len()).collect();
        order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
        let n = self.mean.len();
        let rates = self.rates.clone();
        let steps: Vec<DVector<f64>> = order
            .iter()
            .zip(&rates.weights)
            .map(|(&rank, _)| DVector::from_fn(n, |k, _| (candidates[rank][k] - self.mean[k]) / self.step))
            .collect();
        let moved = DVector::from_fn(n, |k, _| rates.weights.iter().zip(&steps).map(|(w, step)| w * step[k]).sum());
        self.mean = DVector::from_fn(n, |k, _| self.mean[k] + self.step * moved[k]);

        let (c, kept) = (rates.path_step, 1.0 - rates.path_step);
        let gain = (c * (2.0 - c) * rates.parents).sqrt();
        let whitened = self.whitened(&moved);
        self.path_step = DVector::from_fn(n, |k, _| kept * self.path_step[k] + gain * whitened[k]);
        self.generation += 1;
        let length = dot(n, |k| self.path_step[k] * self.path_step[k]).sqrt();
        let settled = (1.0 - libm::pow(kept, 2.0 * f64::from(self.generation))).sqrt();
        let is_calm = length / settled < (1.4 + 2.0 / (n as f64 + 1.0)) * rates.expected;
        let calm = f64::from(u8::from(is_calm));

        let c = rates.path_covariance;
        let gain = calm * (c * (2.0 - c) * rates.parents).sqrt();
        self.path_covariance = DVector::from_fn(n, |k, _| (1.0 - c) * self.path_covariance[k] + gain * moved[k]);
        let kept = 1.0 - rates.rank_one - rates.rank_many + (1.0 - calm) * rates.rank_one * c * (2.0 - c);
        let path = &self.path_covariance;
        self.covariance = DMatrix::from_fn(n, n, |i, j| {
            let many: f64 = rates.weights.iter().zip(&steps).map(|(w, step)| w * (step[i] * step[j])).sum();
            kept * self.covariance[(i, j)] + rates.rank_one * (path[i] * path[j]) + rates.rank_many * many
        });
        self.step *=
            libm::exp((rates.path_step / rates.damping) * (length / rates.expected - 1.0)).min(std::f64::consts::E);
        self.decompose();
    }

    /// Returns a step multiplied by the inverse square root of the covariance.
    fn whitened(&self, step: &DVector<f64>) -> DVector<f64> {
        let n = self.mean.len();
        let along = DVector::from_fn(n, |k, _| dot(n, |row| self.axes[(row, k)] * step[row]) / self.lengths[k]);
        DVector::from_fn(n, |row, _| dot(n, |k| self.axes[(row, k)] * along[k]))
    }

    fn decompose(&mut self) {
        let SymmetricEigen { eigenvalues, eigenvectors } = SymmetricEigen::new(self.covariance.clone());
        self.lengths = eigenvalues.map(|value| value.max(0.0).sqrt());
        self.axes = eigenvectors;
    }
}

/// Returns a sum, added in the order of its terms.
fn dot(count: usize, term: impl Fn(usize) -> f64) -> f64 {
    (0..count).map(term).sum()
}

/// CMA-ES with restarts.
#[derive(Clone, Debug)]
pub(super) struct Optimiser {
    normals: Normals,
    dimensions: usize,
    /// Difference of values at which a search has converged \[m\].
    tolerance_m: f64,
    descent: Descent,
    restarts: u64,
}

/// One run of CMA-ES.
#[derive(Clone, Debug)]
struct Descent {
    distribution: CmaEs,
    /// Best value of each generation.
    best: Vec<f64>,
}

impl Descent {
    fn new(mean: &[f64], population: usize) -> Self {
        Self { distribution: CmaEs::new(mean, FIRST_STEP, population), best: Vec::new() }
    }

    fn has_converged(&self, dimensions: usize, tolerance: f64) -> bool {
        let late = 10 + (30 * dimensions).div_ceil(self.distribution.population());
        let is_flat = self.best.len() > late && {
            let late = &self.best[self.best.len() - late..];
            let low = late.iter().copied().fold(f64::INFINITY, f64::min);
            let high = late.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            high - low <= tolerance
        };
        is_flat || self.distribution.is_degenerate() || self.distribution.spread() < CONVERGED_STEP
    }
}

impl Optimiser {
    /// Returns a search that starts at the middle of the bounds.
    pub(super) fn new(dimensions: usize, delta_m: f64, seed: u64) -> Self {
        let descent = Descent::new(&vec![0.5; dimensions], default_population(dimensions));
        Self {
            normals: Normals::new(seed, 0),
            dimensions,
            tolerance_m: CONVERGED_VALUE * delta_m,
            descent,
            restarts: 0,
        }
    }

    /// Returns the number of candidates in a generation.
    pub(super) fn population(&self) -> usize {
        self.descent.distribution.population()
    }

    /// Returns the number of restarts.
    pub(super) fn restarts(&self) -> u64 {
        self.restarts
    }

    /// Draws a candidate on the real line; [`folded`] maps each coordinate into its bounds.
    pub(super) fn draw(&mut self) -> Vec<f64> {
        self.descent.distribution.draw(&mut self.normals)
    }

    /// Adapts to the values of a whole generation, and restarts after convergence.
    pub(super) fn learn(&mut self, candidates: &[Vec<f64>], values: &[f64]) {
        self.descent.distribution.learn(candidates, values);
        self.descent.best.push(values.iter().copied().fold(f64::INFINITY, f64::min));
        if self.descent.has_converged(self.dimensions, self.tolerance_m) {
            self.restart(GROWTH);
        }
    }

    /// Restarts from a random point, with `growth` times the population.
    pub(super) fn restart(&mut self, growth: usize) {
        let population = growth * self.population();
        let place: Vec<_> = (0..self.dimensions).map(|_| self.normals.unit()).collect();
        self.restarts += 1;
        self.descent = Descent::new(&place, population);
    }
}

/// Maps the real line to the interval from 0 to 1. The map is the identity except in a zone of 0.05 at each bound,
/// where a parabola leads to the bound and back. A function that falls towards a bound therefore has its minimum in the
/// interior, and the optimiser converges there (`BoxConstraintsLinQuadTransformation` of Hansen's `pycma`).
pub(super) fn folded(x: f64) -> f64 {
    let width = 1.0 + 2.0 * BENT;
    let along = (x + BENT).rem_euclid(2.0 * width);
    let place = if along > width { 2.0 * width - along } else { along } - BENT;
    let bent = |beyond: f64| beyond * beyond / (4.0 * BENT);
    if place < BENT {
        bent(place + BENT)
    } else if place > 1.0 - BENT {
        1.0 - bent(1.0 + BENT - place)
    } else {
        place
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the number of candidates until a value is below `goal`; panics after `most` candidates.
    fn count_candidates(n: usize, goal: f64, most: usize, value: &dyn Fn(&[f64]) -> f64) -> usize {
        let mut normals = Normals::new(3, 0);
        let mut search = CmaEs::new(&vec![0.5; n], 0.3, default_population(n));
        let mut count = 0;
        while count < most {
            let candidates: Vec<_> = (0..search.population()).map(|_| search.draw(&mut normals)).collect();
            let values: Vec<_> = candidates.iter().map(|candidate| value(candidate)).collect();
            count += candidates.len();
            if values.iter().any(|&value| value <= goal) {
                return count;
            }
            search.learn(&candidates, &values);
            assert!(!search.is_degenerate(), "after {count}");
        }
        panic!("{most} candidates were not enough");
    }

    #[test]
    fn test_functions_need_no_more_candidates_than_published() {
        // Hansen's tutorial and the BBOB tables: about 1e3 candidates for a sphere, about 6e3 for Rosenbrock in ten
        // dimensions.
        let ball = |x: &[f64]| x.iter().map(|x| (x - 0.2) * (x - 0.2)).sum::<f64>();
        assert!(count_candidates(10, 1e-9, 2_500, &ball) > 300);
        let narrow = |x: &[f64]| {
            let scale = |k: usize| libm::pow(1e6, k as f64 / 9.0);
            x.iter().enumerate().map(|(k, x)| scale(k) * (x - 0.2) * (x - 0.2)).sum::<f64>()
        };
        count_candidates(10, 1e-9, 9_000, &narrow);
        let valley = |x: &[f64]| {
            let part = |pair: &[f64]| {
                100.0 * (pair[1] - pair[0] * pair[0]) * (pair[1] - pair[0] * pair[0])
                    + (1.0 - pair[0]) * (1.0 - pair[0])
            };
            x.windows(2).map(part).sum::<f64>()
        };
        count_candidates(10, 1e-9, 12_000, &valley);
    }

    #[test]
    fn one_dimension_and_equal_values_work() {
        count_candidates(1, 1e-9, 400, &|x| (x[0] - 0.9) * (x[0] - 0.9));
        let mut search = CmaEs::new(&[0.5, 0.5], 0.3, 6);
        let mut normals = Normals::new(0, 0);
        for _ in 0..50 {
            let candidates: Vec<_> = (0..6).map(|_| search.draw(&mut normals)).collect();
            search.learn(&candidates, &[1.0; 6]);
        }
        assert!(search.spread().is_finite());
    }

    #[test]
    fn a_seed_determines_the_candidates() {
        let drawn = |seed: u64| CmaEs::new(&[0.5; 4], 0.3, 8).draw(&mut Normals::new(seed, 0));
        assert_eq!(drawn(1), drawn(1));
        assert_ne!(drawn(1), drawn(2));
    }

    #[test]
    fn folding_is_continuous_and_stays_in_the_interval() {
        let step = 1e-4;
        let mut before = folded(-7.0);
        for k in 1..140_000_i32 {
            let now = folded(-7.0 + f64::from(k) * step);
            assert!((0.0..=1.0).contains(&now) && (now - before).abs() <= step * (1.0 + 1e-6), "{k}: {before} {now}");
            before = now;
        }
        assert_eq!([0.05, 0.3, 0.5, 0.95].map(folded), [0.05, 0.3, 0.5, 0.95]);
        assert!(folded(-0.05).abs() < 1e-15 && (folded(1.05) - 1.0).abs() < 1e-15);
    }
}
