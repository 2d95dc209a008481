//! Means and quantiles of measured values.

use serde::Serialize;
use statrs::distribution::{Binomial, ContinuousCDF as _, DiscreteCDF as _, StudentsT};

use super::TAIL;

/// Estimate with its interval. A bound is `None` if too few values determine it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Estimate {
    /// Estimate; `None` without values.
    pub value: Option<f64>,
    /// Lower bound of the true value.
    pub low: Option<f64>,
    /// Upper bound of the true value.
    pub high: Option<f64>,
}

impl Estimate {
    /// Returns the mean with Student's interval: exact for normal values, approximate for many values; no interval for
    /// fewer than two values.
    #[must_use]
    pub fn mean(values: &[f64]) -> Self {
        let count = values.len() as f64;
        if values.is_empty() {
            return Self::default();
        }
        let mean = values.iter().sum::<f64>() / count;
        let squares = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>();
        let times = StudentsT::new(0.0, 1.0, count - 1.0).map(|distribution| distribution.inverse_cdf(1.0 - TAIL)).ok();
        let half = times.map(|times| times * (squares / (count - 1.0) / count).sqrt());
        Self { value: Some(mean), low: half.map(|half| mean - half), high: half.map(|half| mean + half) }
    }

    /// Returns the estimate without an interval, for values that are no sample.
    #[must_use]
    pub fn without_interval(self) -> Self {
        Self { low: None, high: None, ..self }
    }

    /// Returns the `p` quantile, 0 < p < 1: 0.5 is the median. Between two values it is their mean.
    ///
    /// The interval is that of order statistics, for any continuous distribution: the number of values below the true
    /// quantile is binomial. A bound is `None` if there are too few values: both bounds need six values for the median
    /// and 72 for the 95th percentile.
    #[must_use]
    pub fn quantile(values: &[f64], p: f64) -> Self {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        let value_at =
            |rank: u64| usize::try_from(rank).ok()?.checked_sub(1).and_then(|index| sorted.get(index)).copied();
        let count = sorted.len() as u64;
        let Ok(below) = Binomial::new(p, count) else { return Self::default() };
        Self {
            value: middle(&sorted, p),
            low: value_at(below.inverse_cdf(TAIL)),
            high: value_at(below.inverse_cdf(1.0 - TAIL).saturating_add(1)),
        }
    }
}

/// Returns the `p` quantile of sorted values: one value, or the mean of the two on either side.
fn middle(sorted: &[f64], p: f64) -> Option<f64> {
    /// Tolerance within which the product of `p` and a length counts as an integer.
    const ROUNDING: f64 = 1e-9;
    let rank = p * sorted.len() as f64;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a part of a length")]
    let value_at = |rank: f64| sorted.get((rank.max(1.0) as usize - 1).min(sorted.len().saturating_sub(1))).copied();
    let (lower, upper) = (value_at((rank - ROUNDING).ceil())?, value_at((rank + ROUNDING).floor() + 1.0)?);
    Some(if lower == upper { lower } else { f64::midpoint(lower, upper) })
}

#[cfg(test)]
mod tests {
    use super::super::tests::{binomial_up_to, near};
    use super::*;

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
    fn quantiles_have_the_interval_of_order_statistics() {
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
    fn intervals_of_order_statistics_are_the_narrowest_that_cover() {
        for n in [6_u64, 20, 72, 200] {
            for p in [0.5, 0.95] {
                let values: Vec<_> = (1..=n).map(|rank| rank as f64).collect();
                let Estimate { low, high, .. } = Estimate::quantile(&values, p);
                #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "ranks")]
                let rank = |bound: Option<f64>| bound.map(|bound| bound as u64);
                // The quantile is below the lower bound if fewer values than the rank of the bound are below the
                // quantile.
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
