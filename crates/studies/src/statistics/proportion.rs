//! Shares of a number of runs that was fixed beforehand, and of pairs of runs.

use serde::Serialize;
use statrs::distribution::{Beta, Binomial, ContinuousCDF as _, DiscreteCDF as _};

use super::{CONFIDENCE, TAIL};

/// `count` of `of`, with a confidence interval of the share.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Proportion {
    /// Number of runs that count.
    pub count: u64,
    /// Number of all runs.
    pub of: u64,
    /// `count / of`, from 0 to 1; `None` if `of` is 0.
    pub share: Option<f64>,
    /// Lower bound of the true share.
    pub low: f64,
    /// Upper bound of the true share.
    pub high: f64,
    /// [`CONFIDENCE`].
    pub confidence: f64,
}

impl Proportion {
    /// Returns `count` of `of` with the interval of Clopper and Pearson (Biometrika 26, 1934): the shares that neither
    /// one-sided binomial test rejects. It never covers less than [`CONFIDENCE`], also for counts of 0 and `of`. A
    /// count above `of` is reduced to `of`.
    #[must_use]
    pub fn new(count: u64, total: u64) -> Self {
        Self::between(count, total, clopper_pearson(count, total, TAIL))
    }

    /// Returns `count` of `of` of flights that are no sample, such as all points of a grid. Both ends of the interval
    /// are the share, with a confidence of 1. A count above `of` is reduced to `of`.
    #[must_use]
    pub fn exact(count: u64, total: u64) -> Self {
        let share = (total > 0).then(|| count.min(total) as f64 / total as f64);
        Self { confidence: 1.0, ..Self::between(count, total, [share.unwrap_or(0.0), share.unwrap_or(1.0)]) }
    }

    /// Returns the one-sided upper bound of Clopper and Pearson: the largest share with which `count` or fewer of `of`
    /// have a probability of 1 - [`CONFIDENCE`]. All of the error probability is on one side; [`Proportion::new`] has
    /// half of it on either side. For a count of 0 the bound is `1 - (1 - CONFIDENCE)^(1 / of)`. A count above `of` is
    /// reduced to `of`.
    #[must_use]
    pub fn upper_bound(count: u64, total: u64) -> f64 {
        let [_, high] = clopper_pearson(count, total, 1.0 - CONFIDENCE);
        high
    }

    /// Returns `count` of `of` with the bounds of another interval. A count above `of` is reduced to `of`.
    pub(super) fn between(count: u64, total: u64, [low, high]: [f64; 2]) -> Self {
        let count = count.min(total);
        let share = (total > 0).then(|| count as f64 / total as f64);
        Self { count, of: total, share, low, high, confidence: CONFIDENCE }
    }
}

/// Returns the bounds of Clopper and Pearson with an error probability of `tail` on either side. A count above `of` is
/// reduced to `of`.
pub(super) fn clopper_pearson(count: u64, total: u64, tail: f64) -> [f64; 2] {
    let count = count.min(total);
    let (hits, misses) = (count as f64, (total - count) as f64);
    let low = if count == 0 { None } else { beta_quantile(hits, misses + 1.0, tail) };
    let high = if count == total { None } else { beta_quantile(hits + 1.0, misses, 1.0 - tail) };
    [low.unwrap_or(0.0), high.unwrap_or(1.0)]
}

/// Returns the `p` quantile of Beta(a, b).
fn beta_quantile(a: f64, b: f64, p: f64) -> Option<f64> {
    Beta::new(a, b).map(|beta| beta.inverse_cdf(p)).ok()
}

/// Pairs of runs that differ in one thing, such as the law, and in each run whether an event occurred.
///
/// Pairs in which the event occurred in both runs or in neither are concordant; the others are discordant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Paired {
    /// Pairs in which it occurred in the first run only.
    pub only_first: u64,
    /// Pairs in which it occurred in the second run only.
    pub only_second: u64,
    /// Number of all pairs.
    pub of: u64,
    /// Two-sided p-value of the exact test of `McNemar` (Psychometrika 12, 1947): the probability of discordant pairs
    /// at least this uneven if each favours either run equally. 1 without discordant pairs.
    pub p_value: f64,
    /// Share of `only_first` in the discordant pairs, with the interval of Clopper and Pearson given their number.
    pub first_of_discordant: Proportion,
    /// Probability of the event in the first run less that in the second, from -1 to 1; `None` without pairs.
    pub difference: Option<f64>,
    /// Lower bound of the true difference.
    pub low: f64,
    /// Upper bound of the true difference.
    pub high: f64,
    /// [`CONFIDENCE`].
    pub confidence: f64,
}

impl Paired {
    /// Returns the statistics of `of` pairs. An `of` below the number of discordant pairs is raised to it.
    ///
    /// The difference of the two probabilities is psi (2 theta - 1): psi is the probability of a discordant pair, theta
    /// that of one that favours the first. The interval is conservative: psi (of all pairs) and theta (of the
    /// discordant pairs, given their number) have the intervals of Clopper and Pearson at 1 - alpha/2. Both hold
    /// together with a probability of at least 1 - alpha (Bonferroni). The bounds are the smallest and the largest
    /// product within them.
    #[must_use]
    pub fn new(only_first: u64, only_second: u64, total: u64) -> Self {
        let discordant = only_first.saturating_add(only_second);
        let total = total.max(discordant);
        let [psi_low, psi_high] = clopper_pearson(discordant, total, 0.5 * TAIL);
        let [theta_low, theta_high] = clopper_pearson(only_first, discordant, 0.5 * TAIL);
        let [from, to] = [theta_low, theta_high].map(|theta| 2.0 * theta - 1.0);
        Self {
            only_first,
            only_second,
            of: total,
            p_value: p_value(only_first.min(only_second), discordant),
            first_of_discordant: Proportion::new(only_first, discordant),
            difference: (total > 0).then(|| (only_first as f64 - only_second as f64) / total as f64),
            low: (from * psi_low).min(from * psi_high),
            high: (to * psi_low).max(to * psi_high),
            confidence: CONFIDENCE,
        }
    }
}

/// Returns twice the probability of at most `fewer` of `of` for two equally likely kinds, at most 1.
fn p_value(fewer: u64, total: u64) -> f64 {
    if total == 0 {
        return 1.0;
    }
    Binomial::new(0.5, total).map_or(1.0, |even| (2.0 * even.cdf(fewer)).min(1.0))
}

#[cfg(test)]
mod tests {
    use super::super::tests::{binomial_up_to, near};
    use super::*;

    #[test]
    fn a_share_has_the_interval_of_clopper_and_pearson() {
        for (count, total, low, high) in
            [(26, 60, 0.306, 0.568), (100, 100, 0.9637, 1.0), (0, 500, 0.0, 0.00735), (20, 20, 0.8316, 1.0)]
        {
            let share = Proportion::new(count, total);
            near(share.low, low, 5e-4);
            near(share.high, high, 5e-4);
        }
        assert_eq!(Proportion::new(0, 0).share, None);
        assert_eq!((Proportion::new(0, 0).low, Proportion::new(0, 0).high), (0.0, 1.0));
        assert_eq!(Proportion::new(9, 4).count, 4);
    }

    #[test]
    fn a_one_sided_bound_has_an_error_probability_of_5_percent() {
        for total in [1_u64, 20, 200, 1000, 10_000] {
            near(Proportion::upper_bound(0, total), 1.0 - 0.05_f64.powf(1.0 / total as f64), 1e-9);
        }
        near(Proportion::upper_bound(0, 200), 0.014_867, 1e-6);
        for (count, total) in [(1, 7), (3, 60), (299, 300)] {
            let bound = Proportion::upper_bound(count, total);
            near(binomial_up_to(count, total, bound), 1.0 - CONFIDENCE, 1e-9);
            assert!(bound < Proportion::new(count, total).high, "below the upper end of the two-sided interval");
        }
        assert_eq!([Proportion::upper_bound(7, 7), Proportion::upper_bound(0, 0)], [1.0, 1.0]);
    }

    #[test]
    fn bounds_are_where_the_one_sided_tests_turn() {
        for total in [1_u64, 2, 7, 20, 60, 300] {
            for count in 0..=total {
                let Proportion { low, high, .. } = Proportion::new(count, total);
                if count > 0 {
                    near(1.0 - binomial_up_to(count - 1, total, low), TAIL, 1e-9);
                }
                if count < total {
                    near(binomial_up_to(count, total, high), TAIL, 1e-9);
                }
            }
        }
    }

    #[test]
    fn the_p_value_is_that_of_the_sign_test() {
        for (first, second, expected) in
            [(10, 0, 2.0 / 1024.0), (0, 10, 2.0 / 1024.0), (5, 5, 1.0), (0, 0, 1.0), (1, 0, 1.0)]
        {
            near(Paired::new(first, second, 50).p_value, expected, 1e-12);
        }
        for total in 1..60 {
            for first in 0..=total {
                let expected = (2.0 * binomial_up_to(first.min(total - first), total, 0.5)).min(1.0);
                near(Paired::new(first, total - first, 100).p_value, expected, 1e-10);
            }
        }
    }

    /// Under the null hypothesis a p-value is at most alpha with a probability of at most alpha.
    #[test]
    fn equal_laws_are_rejected_at_most_at_the_stated_rate() {
        let law = |count: u64, total: u64| {
            binomial_up_to(count, total, 0.5) - if count == 0 { 0.0 } else { binomial_up_to(count - 1, total, 0.5) }
        };
        for total in 1..80 {
            for alpha in [0.01, 0.05, 0.2] {
                let rejected = (0..=total).filter(|&first| Paired::new(first, total - first, total).p_value <= alpha);
                let size: f64 = rejected.map(|first| law(first, total)).sum();
                assert!(size <= alpha + 1e-12, "{size} of {total}");
            }
        }
    }

    #[test]
    fn the_difference_is_antisymmetric_and_within_its_bounds() {
        for (first, second, total) in [(10, 0, 100), (3, 8, 40), (0, 0, 20), (7, 7, 14), (500, 100, 10_000)] {
            let (one, other) = (Paired::new(first, second, total), Paired::new(second, first, total));
            near(one.low, -other.high, 1e-12);
            near(one.high, -other.low, 1e-12);
            assert!(
                one.difference.is_some_and(|difference| one.low <= difference && difference <= one.high),
                "{one:?}"
            );
            assert!(-1.0 <= one.low && one.high <= 1.0);
        }
        let none = Paired::new(0, 0, 0);
        assert_eq!((none.difference, none.low, none.high), (None, -1.0, 1.0));
        assert_eq!(Paired::new(3, 4, 5).of, 7);
    }

    #[test]
    fn ten_to_zero_is_significant_and_five_to_zero_is_not() {
        let ten = Paired::new(10, 0, 100);
        assert!(ten.low > 0.0 && ten.p_value < 0.05 && ten.first_of_discordant.low > 0.5);
        let five = Paired::new(5, 0, 100);
        assert!(five.low < 0.0 && five.p_value > 0.05 && five.first_of_discordant.low < 0.5);
    }
}
