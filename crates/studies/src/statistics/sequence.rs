//! Confidence sequences: intervals that hold at every number of runs at once.

use super::CONFIDENCE;
use super::proportion::Proportion;

/// Both parameters of the beta mixture: Jeffreys' prior. With 1 instead, bounds of small counts are a third wider: for
/// 0 of 10,000 the upper bound is 0.00122 instead of 0.00082. Near a share of 0.5, Jeffreys' prior is 2 % wider.
const PRIOR: f64 = 0.5;

/// Number of runs of the first look; each further look has twice the number.
const FIRST_LOOK: u64 = 100;

/// Returns `count` of the first `of` runs with an interval of a confidence sequence.
///
/// With probability [`CONFIDENCE`] the intervals of all numbers of runs contain the true share at once, for any rule by
/// which the campaign stops.
///
/// The sequence is the beta mixture (Robbins, Annals of Mathematical Statistics 41, 1970):
///
/// ```text
/// { p : B(a + k, a + n - k) / [B(a, a) p^k (1 - p)^(n - k)] < 1/alpha },   a = 1/2
/// ```
///
/// The ratio is a martingale under p that begins with 1. By Ville's inequality it ever reaches 1/alpha with a
/// probability of at most alpha. The bounds are the first numbers outside the set. A count above `of` is reduced to
/// `of`.
#[must_use]
pub fn anytime(count: u64, total: u64) -> Proportion {
    let count = count.min(total);
    let low = if count == 0 { 0.0 } else { bound(count, total, 0.0) };
    let high = if count == total { 1.0 } else { bound(count, total, 1.0) };
    Proportion::between(count, total, [low, high])
}

/// Returns the first number outside the interval, by bisection between the share and `out`, which is outside.
fn bound(count: u64, total: u64, mut out: f64) -> f64 {
    let (hits, misses) = (count as f64, (total - count) as f64);
    let mixture = ln_beta(PRIOR + hits, PRIOR + misses) - ln_beta(PRIOR, PRIOR);
    let limit = -libm::log(1.0 - CONFIDENCE);
    let times = |number: f64, logarithm: f64| if number > 0.0 { number * logarithm } else { 0.0 };
    let is_out = |p: f64| mixture - times(hits, libm::log(p)) - times(misses, libm::log1p(-p)) >= limit;
    let mut within = hits / (hits + misses);
    loop {
        let middle = f64::midpoint(out, within);
        // `out` and `within` are adjacent numbers.
        if middle == out || middle == within {
            return out;
        }
        *(if is_out(middle) { &mut out } else { &mut within }) = middle;
    }
}

/// Returns the logarithm of the beta function with `libm` only, so that a campaign stops at the same run on every
/// machine.
fn ln_beta(a: f64, b: f64) -> f64 {
    libm::lgamma(a) + libm::lgamma(b) - libm::lgamma(a + b)
}

/// Returns the numbers of runs at which a campaign of at most `runs` considers a stop: 100, 200, 400, ... and `runs`.
pub fn looks(runs: u64) -> impl Iterator<Item = u64> {
    let doubled = std::iter::successors(Some(FIRST_LOOK), |look| look.checked_mul(2));
    doubled.take_while(move |&look| look < runs).chain((runs > 0).then_some(runs))
}

/// Intersection of the [`anytime`] intervals of several looks.
///
/// All intervals contain the true share at once with probability [`CONFIDENCE`], and so does their intersection. It
/// depends on the looks, which are therefore fixed beforehand: [`looks`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ConfidenceSequence {
    bounds: Option<[f64; 2]>,
}

impl ConfidenceSequence {
    /// Returns the sequence before the first look.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a look, `count` of the first `of` runs, and returns the intersection.
    ///
    /// An empty intersection means that one of the intervals misses the true share. The sequence then restarts with
    /// this look.
    pub fn look(&mut self, count: u64, total: u64) -> Proportion {
        let now = anytime(count, total);
        let [low, high] = self.bounds.unwrap_or([0.0, 1.0]);
        let common = [low.max(now.low), high.min(now.high)];
        let bounds = if common[0] <= common[1] { common } else { [now.low, now.high] };
        self.bounds = Some(bounds);
        Proportion::between(count, total, bounds)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::near;
    use super::*;

    /// Returns the ratio by its product over the runs, all hits first.
    fn ratio(count: u64, total: u64, p: f64) -> f64 {
        let hit = |k: u64| (PRIOR + k as f64) / (2.0 * PRIOR + k as f64) / p;
        let miss = |k: u64| (PRIOR + k as f64) / (2.0 * PRIOR + (count + k) as f64) / (1.0 - p);
        (0..count).map(hit).product::<f64>() * (0..total - count).map(miss).product::<f64>()
    }

    #[test]
    fn bounds_are_where_the_ratio_reaches_20() {
        for total in [1, 7, 100, 400] {
            for count in (0..=total).step_by(usize::try_from(total).expect("few").div_ceil(20)) {
                let Proportion { low, high, share, .. } = anytime(count, total);
                assert!(0.0 <= low && share.is_some_and(|share| low <= share && share <= high) && high <= 1.0);
                for bound in [low, high].into_iter().filter(|bound| (0.0..1.0).contains(bound) && *bound > 0.0) {
                    near(ratio(count, total, bound), 20.0, 1e-9);
                }
            }
        }
        assert_eq!((anytime(0, 0).low, anytime(0, 0).high, anytime(0, 0).share), (0.0, 1.0, None));
        assert_eq!(anytime(9, 4), anytime(4, 4));
    }

    #[test]
    fn the_interval_is_monotone_symmetric_and_wider_than_for_a_fixed_number() {
        for total in [1, 10, 100, 5_000] {
            let all: Vec<_> = (0..=total).map(|count| anytime(count, total)).collect();
            assert!(all.windows(2).all(|next| next[0].low < next[1].low && next[0].high < next[1].high), "{total}");
            for (one, count) in all.iter().zip(0..) {
                let fixed = Proportion::new(count, total);
                // For one run both intervals have the same bounds.
                assert!(one.low <= fixed.low + 1e-12 && fixed.high <= one.high + 1e-12, "{count} of {total}");
                near(one.low, 1.0 - anytime(total - count, total).high, 1e-14);
            }
        }
    }

    /// Bounds with 1 as the prior, where the ratio has a closed form, justify the choice of the prior.
    #[test]
    fn jeffreys_prior_gives_a_third_lower_bound_for_a_count_of_zero() {
        let uniform = |total: f64| -libm::expm1(-libm::log(20.0 * (total + 1.0)) / total);
        near(anytime(0, 10_000).high, 0.000_817, 1e-6);
        near(uniform(10_000.0), 0.001_220, 1e-6);
        assert!(anytime(0, 1_000_000).high < 0.64 * uniform(1e6));
    }

    #[test]
    fn many_runs_have_narrow_bounds() {
        let half = anytime(500_000_000, 1_000_000_000);
        near(half.high - half.low, 1.6e-4, 1e-5);
        near(1e12 * anytime(0, 1_000_000_000_000).high, 17.38, 0.05);
        near(anytime(1, 1_000_000_000).low, 0.0, 1e-10);
    }

    #[test]
    fn looks_double_up_to_the_last_run() {
        assert_eq!(looks(1000).collect::<Vec<_>>(), [100, 200, 400, 800, 1000]);
        assert_eq!(looks(400).collect::<Vec<_>>(), [100, 200, 400]);
        assert_eq!(looks(7).collect::<Vec<_>>(), [7]);
        assert_eq!(looks(0).count(), 0);
        assert_eq!(looks(u64::MAX).last(), Some(u64::MAX));
    }

    #[test]
    fn the_intersection_shrinks_unless_it_is_empty() {
        let mut sequence = ConfidenceSequence::new();
        let first = sequence.look(50, 100);
        assert_eq!(first, anytime(50, 100));
        let second = sequence.look(80, 200);
        assert_eq!((second.low, second.high), (first.low, anytime(80, 200).high), "each bound is the tighter of two");
        let third = sequence.look(0, 400);
        assert_eq!(third, anytime(0, 400), "nothing is left");
    }
}
