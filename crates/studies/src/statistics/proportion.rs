//! How often something happens, of a number of runs that was fixed beforehand.

use serde::Serialize;
use statrs::distribution::{Beta, ContinuousCDF as _};

use super::confidence::{CONFIDENCE, TAIL};

/// So many of so many, with the interval of their share.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Proportion {
    /// How many.
    pub count: u64,
    /// Of how many.
    pub of: u64,
    /// One over the other, from 0 to 1; none of none.
    pub share: Option<f64>,
    /// The true share is at least this.
    pub low: f64,
    /// And at most this.
    pub high: f64,
    /// [`CONFIDENCE`].
    pub confidence: f64,
}

impl Proportion {
    /// `count` of `of`, with the interval of Clopper and Pearson (Biometrika 26, 1934): the shares that are not rejected by
    /// either one-sided binomial test. It never covers less than [`CONFIDENCE`], and holds for 0 and for all of them. A count
    /// beyond `of` is taken for `of`.
    #[must_use]
    pub fn new(count: u64, of: u64) -> Self {
        Self::between(count, of, clopper_pearson(count, of, TAIL))
    }

    /// Returns the one-sided upper bound of the share, of Clopper and Pearson: the largest share in which `count` of `of` or fewer are met
    /// with a probability of 1 - [`CONFIDENCE`]. A one-sided bound leaves out all of that on one side, and the interval of
    /// [`Proportion::new`] half of it on either side. For a count of 0 it is `1 - (1 - CONFIDENCE)^(1 / of)`. A count beyond `of` is taken
    /// for `of`.
    #[must_use]
    pub fn upper_bound(count: u64, of: u64) -> f64 {
        let [_, high] = clopper_pearson(count, of, 1.0 - CONFIDENCE);
        high
    }

    /// `count` of `of` with the bounds of another interval; a count beyond `of` is taken for `of`.
    pub(super) fn between(count: u64, of: u64, [low, high]: [f64; 2]) -> Self {
        let count = count.min(of);
        let share = (of > 0).then(|| count as f64 / of as f64);
        Self { count, of, share, low, high, confidence: CONFIDENCE }
    }
}

/// The bounds of Clopper and Pearson that leave out `tail` on either side; a count beyond `of` is taken for `of`.
pub(super) fn clopper_pearson(count: u64, of: u64, tail: f64) -> [f64; 2] {
    let count = count.min(of);
    let (hits, misses) = (count as f64, (of - count) as f64);
    let low = if count == 0 { None } else { beta_quantile(hits, misses + 1.0, tail) };
    let high = if count == of { None } else { beta_quantile(hits + 1.0, misses, 1.0 - tail) };
    [low.unwrap_or(0.0), high.unwrap_or(1.0)]
}

/// Where the distribution function of Beta(a, b) reaches p.
fn beta_quantile(a: f64, b: f64, p: f64) -> Option<f64> {
    Beta::new(a, b).map(|beta| beta.inverse_cdf(p)).ok()
}

#[cfg(test)]
mod tests {
    use super::super::testing::{binomial_up_to, near};
    use super::*;

    #[test]
    fn a_share_has_the_interval_of_clopper_and_pearson() {
        for (count, of, low, high) in
            [(26, 60, 0.306, 0.568), (100, 100, 0.9637, 1.0), (0, 500, 0.0, 0.00735), (20, 20, 0.8316, 1.0)]
        {
            let share = Proportion::new(count, of);
            near(share.low, low, 5e-4);
            near(share.high, high, 5e-4);
        }
        assert_eq!(Proportion::new(0, 0).share, None);
        assert_eq!((Proportion::new(0, 0).low, Proportion::new(0, 0).high), (0.0, 1.0));
        assert_eq!(Proportion::new(9, 4).count, 4);
    }

    #[test]
    fn a_one_sided_bound_leaves_out_a_twentieth_on_its_side() {
        for of in [1_u64, 20, 200, 1000, 10_000] {
            near(Proportion::upper_bound(0, of), 1.0 - 0.05_f64.powf(1.0 / of as f64), 1e-9);
        }
        near(Proportion::upper_bound(0, 200), 0.014_867, 1e-6);
        for (count, of) in [(1, 7), (3, 60), (299, 300)] {
            let bound = Proportion::upper_bound(count, of);
            near(binomial_up_to(count, of, bound), 1.0 - CONFIDENCE, 1e-9);
            assert!(bound < Proportion::new(count, of).high, "below the upper end of the two-sided interval");
        }
        assert_eq!([Proportion::upper_bound(7, 7), Proportion::upper_bound(0, 0)], [1.0, 1.0]);
    }

    #[test]
    fn its_bounds_are_where_the_one_sided_tests_turn() {
        for of in [1_u64, 2, 7, 20, 60, 300] {
            for count in 0..=of {
                let Proportion { low, high, .. } = Proportion::new(count, of);
                if count > 0 {
                    near(1.0 - binomial_up_to(count - 1, of, low), TAIL, 1e-9);
                }
                if count < of {
                    near(binomial_up_to(count, of, high), TAIL, 1e-9);
                }
            }
        }
    }
}
