//! What some runs say of all that could have been flown: shares, means and quantiles with 95 % intervals.
//!
//! All intervals are two-sided, with at most 2.5 % on either side, and for a number of runs that was fixed beforehand.

use serde::Serialize;
use statrs::distribution::{Beta, Binomial, ContinuousCDF as _, DiscreteCDF as _, StudentsT};

/// How often an interval holds the true value.
pub const CONFIDENCE: f64 = 0.95;

/// What an interval leaves out on either side.
const TAIL: f64 = 0.5 * (1.0 - CONFIDENCE);

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

/// An estimate with its interval; a bound that so few values do not give is none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Estimate {
    /// Of the values at hand; none of none.
    pub value: Option<f64>,
    /// The true one is at least this.
    pub low: Option<f64>,
    /// And at most this.
    pub high: Option<f64>,
}

impl Proportion {
    /// `count` of `of`, with the interval of Clopper and Pearson (Biometrika 26, 1934): the shares that are not rejected by
    /// either one-sided binomial test. It never covers less than [`CONFIDENCE`], and holds for 0 and for all of them. A count
    /// beyond `of` is taken for `of`.
    #[must_use]
    pub fn new(count: u64, of: u64) -> Self {
        let count = count.min(of);
        let (hits, misses) = (count as f64, (of - count) as f64);
        let low = if count == 0 { None } else { beta_quantile(hits, misses + 1.0, TAIL) };
        let high = if count == of { None } else { beta_quantile(hits + 1.0, misses, 1.0 - TAIL) };
        Self {
            count,
            of,
            share: (of > 0).then(|| hits / of as f64),
            low: low.unwrap_or(0.0),
            high: high.unwrap_or(1.0),
            confidence: CONFIDENCE,
        }
    }
}

/// Where the distribution function of Beta(a, b) reaches p.
fn beta_quantile(a: f64, b: f64, p: f64) -> Option<f64> {
    Beta::new(a, b).map(|beta| beta.inverse_cdf(p)).ok()
}

impl Estimate {
    /// The mean with Student's interval: exact for normal values, near it for many; none of fewer than two values.
    #[must_use]
    pub fn mean(values: &[f64]) -> Self {
        let count = values.len() as f64;
        if values.is_empty() {
            return Self::default();
        }
        let mean = values.iter().sum::<f64>() / count;
        let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
        let times = StudentsT::new(0.0, 1.0, count - 1.0).map(|of| of.inverse_cdf(1.0 - TAIL)).ok();
        let half = times.map(|times| times * (squares / (count - 1.0) / count).sqrt());
        Self { value: Some(mean), low: half.map(|half| mean - half), high: half.map(|half| mean + half) }
    }

    /// The value that a part `p` of all is not above, between 0 and 1: 0.5 is the median. Where it falls between two values it
    /// is their mean.
    ///
    /// The interval is that of order statistics, for any continuous distribution: the number of values below the true one
    /// is binomial. A bound is none where there are too few values for it: six give both of the median, 72 those of the
    /// 95th percentile.
    #[must_use]
    pub fn quantile(values: &[f64], p: f64) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let at = |rank: u64| usize::try_from(rank).ok()?.checked_sub(1).and_then(|index| sorted.get(index)).copied();
        let count = sorted.len() as u64;
        let Ok(below) = Binomial::new(p, count) else { return Self::default() };
        Self {
            value: middle(&sorted, p),
            low: at(below.inverse_cdf(TAIL)),
            high: at(below.inverse_cdf(1.0 - TAIL).saturating_add(1)),
        }
    }
}

/// The mean of the two values on either side of a part `p`, or the one that is on both.
fn middle(sorted: &[f64], p: f64) -> Option<f64> {
    /// Products of a part and a number are whole to this.
    const ROUNDING: f64 = 1e-9;
    let rank = p * sorted.len() as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a part of a length")]
    let at = |rank: f64| sorted.get((rank.max(1.0) as usize - 1).min(sorted.len().saturating_sub(1))).copied();
    let (lower, upper) = (at((rank - ROUNDING).ceil())?, at((rank + ROUNDING).floor() + 1.0)?);
    Some(if lower == upper { lower } else { f64::midpoint(lower, upper) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: f64, expected: f64, tolerance: f64) {
        assert!((found - expected).abs() <= tolerance, "{found} instead of {expected}");
    }

    /// Share of `Binomial(n, p)` up to and with k, by its sum from the side where it does not begin with nothing.
    fn binomial_up_to(k: u64, n: u64, p: f64) -> f64 {
        if p > 0.5 {
            return if k >= n { 1.0 } else { 1.0 - binomial_up_to(n - k - 1, n, 1.0 - p) };
        }
        let mut term = (1.0 - p).powi(i32::try_from(n).expect("small"));
        let mut sum = 0.0;
        for i in 0..=k.min(n) {
            sum += term;
            term *= (n - i) as f64 / (i + 1) as f64 * p / (1.0 - p);
        }
        sum
    }

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

    #[test]
    fn a_mean_has_students_interval() {
        let values = [4.0, 6.0, 5.0, 9.0];
        let Estimate { value, low, high } = Estimate::mean(&values);
        assert_eq!(value, Some(6.0));
        // s = sqrt(14/3), t = 3.182446 for three degrees of freedom.
        let half = 3.182_446 * (14.0_f64 / 3.0 / 4.0).sqrt();
        near(low.expect("a bound"), 6.0 - half, 1e-5);
        near(high.expect("a bound"), 6.0 + half, 1e-5);
        assert_eq!(Estimate::mean(&[3.0]), Estimate { value: Some(3.0), low: None, high: None });
        assert_eq!(Estimate::mean(&[]), Estimate::default());
        assert_eq!(Estimate::mean(&[2.0; 5]), Estimate { value: Some(2.0), low: Some(2.0), high: Some(2.0) });
    }

    #[test]
    fn a_quantile_has_the_interval_of_order_statistics() {
        let upto = |n: u32| (1..=n).map(f64::from).collect::<Vec<_>>();
        let median = |n| Estimate::quantile(&upto(n), 0.5);
        assert_eq!(median(20), Estimate { value: Some(10.5), low: Some(6.0), high: Some(15.0) });
        assert_eq!(median(5), Estimate { value: Some(3.0), low: None, high: None });
        assert_eq!(median(6), Estimate { value: Some(3.5), low: Some(1.0), high: Some(6.0) });
        let late = |n| Estimate::quantile(&upto(n), 0.95);
        assert_eq!((late(20).value, late(20).low, late(20).high), (Some(19.5), Some(17.0), None));
        assert_eq!((late(71).high, late(72).high), (None, Some(72.0)));
        assert_eq!(late(100).value, Some(95.5));
        assert_eq!(Estimate::quantile(&[], 0.5), Estimate::default());
        assert_eq!(Estimate::quantile(&[7.0], 0.95).value, Some(7.0));
    }

    #[test]
    fn an_interval_of_order_statistics_covers_as_it_says_and_not_much_more() {
        for n in [6_u64, 20, 72, 200] {
            for p in [0.5, 0.95] {
                let values: Vec<_> = (1..=n).map(|rank| rank as f64).collect();
                let Estimate { low, high, .. } = Estimate::quantile(&values, p);
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "ranks")]
                let rank = |bound: Option<f64>| bound.map(|bound| bound as u64);
                // The true one is below the lower bound where fewer values than its rank are below the true one.
                let too_low = rank(low).map_or(0.0, |low| binomial_up_to(low - 1, n, p));
                let too_high = rank(high).map_or(0.0, |high| 1.0 - binomial_up_to(high - 1, n, p));
                assert!(too_low <= TAIL && too_high <= TAIL, "{n}, {p}: {too_low}, {too_high}");
                if let Some(low) = rank(low) {
                    assert!(binomial_up_to(low, n, p) > TAIL, "{n}, {p}: the next rank would not do");
                }
            }
        }
    }
}
