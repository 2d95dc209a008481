//! Coverage of intervals: how often each contains the truth, over 10,000 repetitions with their own seeds.
//!
//! Intervals of counts (Clopper and Pearson, the confidence sequence, the difference of pairs) never cover less than
//! stated, and mostly more, because counts are integers. Intervals of normal means and of quantiles of many values
//! cover as stated.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};

use super::{ConfidenceSequence, Estimate, Paired, Proportion, anytime, looks};

const REPETITIONS: u32 = 10_000;

/// Admitted coverage. Its standard error over the repetitions is 0.22 % at 95 %.
#[derive(Clone, Copy, Debug)]
enum Claim {
    /// From 94 to 97 %.
    Exact,
    /// At least 94 %.
    Conservative,
}

impl Claim {
    fn holds(self, covered: f64) -> bool {
        covered >= 0.94 && (covered <= 0.97 || matches!(self, Self::Conservative))
    }
}

/// Random numbers of a test.
struct Draws(ChaCha8Rng);

impl Draws {
    fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    /// Uniform in \[0, 1).
    fn unit(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * (1.0 - self.unit()).ln()).sqrt() * (std::f64::consts::TAU * self.unit()).cos()
    }

    /// Returns the share of repetitions in which `holds` is true.
    fn share(&mut self, holds: &mut dyn FnMut(&mut Self) -> bool) -> f64 {
        f64::from((0..REPETITIONS).map(|_| u32::from(holds(self))).sum::<u32>()) / f64::from(REPETITIONS)
    }
}

/// Binomial counts of n runs with probability p, each drawn with one uniform number.
struct Counts(Vec<f64>);

impl Counts {
    fn new(n: u64, p: f64) -> Self {
        let (log_p, log_q) = (p.ln(), (-p).ln_1p());
        let mut ways: f64 = 0.0;
        let mut sum = 0.0;
        let mut up_to = Vec::new();
        for k in 0..=n {
            sum += (ways + k as f64 * log_p + (n - k) as f64 * log_q).exp();
            up_to.push(sum);
            ways += ((n - k) as f64 / (k + 1) as f64).ln();
        }
        Self(up_to)
    }

    fn draw(&self, draws: &mut Draws) -> u64 {
        let unit = draws.unit();
        (self.0.partition_point(|&up_to| up_to <= unit) as u64).min(self.0.len() as u64 - 1)
    }
}

/// Returns for each count of n whether its interval contains p.
fn held(n: u64, p: f64, interval: impl Fn(u64, u64) -> [f64; 2]) -> Vec<bool> {
    let holds = |count| {
        let [low, high] = interval(count, n);
        low <= p && p <= high
    };
    (0..=n).map(holds).collect()
}

fn fixed(count: u64, total: u64) -> [f64; 2] {
    let Proportion { low, high, .. } = Proportion::new(count, total);
    [low, high]
}

fn at_any_time(count: u64, total: u64) -> [f64; 2] {
    let Proportion { low, high, .. } = anytime(count, total);
    [low, high]
}

fn index(count: u64) -> usize {
    usize::try_from(count).expect("few")
}

fn of_counts(n: u64, p: f64, interval: impl Fn(u64, u64) -> [f64; 2]) -> f64 {
    let (counts, held) = (Counts::new(n, p), held(n, p, interval));
    Draws::new(n).share(&mut |draws| held[index(counts.draw(draws))])
}

#[test]
fn drawn_counts_have_the_binomial_mean() {
    for (n, p) in [(20_u64, 0.3), (1000, 0.001), (1000, 0.999)] {
        let (counts, mut draws) = (Counts::new(n, p), Draws::new(3));
        let drawn: Vec<_> = (0..REPETITIONS).map(|_| counts.draw(&mut draws) as f64).collect();
        let mean = drawn.iter().sum::<f64>() / drawn.len() as f64;
        let off = 4.0 * (n as f64 * p * (1.0 - p) / drawn.len() as f64).sqrt();
        assert!((mean - n as f64 * p).abs() < off, "{mean} of {n}, {p}");
    }
}

#[test]
fn a_share_is_covered() {
    for p in [0.001, 0.01, 0.1, 0.5, 0.9, 0.999] {
        for n in [20, 100, 1000] {
            let covered = of_counts(n, p, fixed);
            assert!(Claim::Conservative.holds(covered), "{covered} for {p} of {n}");
        }
    }
    // For many runs the coverage is the stated one.
    let covered = of_counts(5000, 0.5, fixed);
    assert!(Claim::Exact.holds(covered), "{covered}");
}

/// The same check rejects the textbook interval: normal, with the standard error of the observed share.
#[test]
fn walds_interval_does_not_cover_a_small_share() {
    let wald = |count: u64, total: u64| {
        let share = count as f64 / total as f64;
        let half = 1.96 * (share * (1.0 - share) / total as f64).sqrt();
        [share - half, share + half]
    };
    let covered = of_counts(100, 0.01, wald);
    assert!(!Claim::Conservative.holds(covered) && covered < 0.7, "{covered}");
    assert!(Claim::Exact.holds(of_counts(5000, 0.5, wald)), "where it is right it passes");
}

#[test]
fn the_mean_of_normal_values_is_covered() {
    for n in [2, 5, 30] {
        let covered = Draws::new(n).share(&mut |draws| {
            let values: Vec<_> = (0..n).map(|_| 3.0 + 2.0 * draws.normal()).collect();
            let Estimate { low, high, .. } = Estimate::mean(&values);
            low.is_some_and(|low| low <= 3.0) && high.is_some_and(|high| high >= 3.0)
        });
        assert!(Claim::Exact.holds(covered), "{covered} of {n}");
    }
}

/// Quantiles of the exponential distribution. For few ranks, or near the largest value, the interval is conservative.
#[test]
fn a_quantile_is_covered() {
    let cases = [
        (20_u32, 0.5, Claim::Exact),
        (200, 0.5, Claim::Exact),
        (200, 0.95, Claim::Conservative),
        (30, 0.95, Claim::Conservative),
    ];
    for (n, p, claim) in cases {
        let truth = -(1.0_f64 - p).ln();
        // For the integers from 0, each bound equals its rank.
        let places: Vec<_> = (0..n).map(f64::from).collect();
        let Estimate { low, high, .. } = Estimate::quantile(&places, p);
        let [low, high] = [low, high].map(|bound| places.iter().position(|&place| Some(place) == bound));
        let covered = Draws::new(u64::from(n)).share(&mut |draws| {
            let mut values: Vec<_> = (0..n).map(|_| -(1.0 - draws.unit()).ln()).collect();
            values.sort_by(f64::total_cmp);
            low.is_none_or(|low| values[low] <= truth) && high.is_none_or(|high| values[high] >= truth)
        });
        assert!(claim.holds(covered), "{covered} of {n}, {p}");
    }
}

/// Returns how often an interval contains p at every look of a campaign.
fn at_all_looks(p: f64, looks: &[u64], interval: impl Fn(u64, u64) -> [f64; 2]) -> f64 {
    let mut before = 0;
    let stages: Vec<_> =
        looks.iter().map(|&n| (Counts::new(n - std::mem::replace(&mut before, n), p), held(n, p, &interval))).collect();
    Draws::new(looks.len() as u64).share(&mut |draws| {
        let mut count = 0;
        stages.iter().all(|(more, held)| {
            count += more.draw(draws);
            held[index(count)]
        })
    })
}

/// A stop at the worst look is still covered: the interval holds at all looks at once.
#[test]
fn a_confidence_sequence_covers_at_all_looks_at_once() {
    let of_campaign: Vec<_> = looks(6400).collect();
    let each: Vec<_> = (1..=150).collect();
    for p in [0.001, 0.1, 0.5, 0.999] {
        for looks in [&of_campaign, &each] {
            let covered = at_all_looks(p, looks, at_any_time);
            assert!(covered >= 0.95 && Claim::Conservative.holds(covered), "{covered} for {p}, {} looks", looks.len());
        }
    }
}

/// An interval for a fixed number of runs does not hold at every look.
#[test]
fn a_fixed_interval_is_not_covered_at_repeated_looks() {
    let of_campaign: Vec<_> = looks(6400).collect();
    let covered = at_all_looks(0.5, &of_campaign, fixed);
    assert!(!Claim::Conservative.holds(covered) && covered < 0.9, "{covered}");
    let each: Vec<_> = (1..=100).collect();
    let covered = at_all_looks(0.5, &each, fixed);
    assert!(covered < 0.85, "{covered}");
}

/// The intersection contains the truth if all intervals do, and is narrower at the end than the last interval.
#[test]
fn the_intersection_of_looks_is_covered() {
    let all: Vec<_> = looks(800).collect();
    let mut before = 0;
    let stages: Vec<_> = all.iter().map(|&n| Counts::new(n - std::mem::replace(&mut before, n), 0.1)).collect();
    let mut narrower = 0_u32;
    let covered = Draws::new(8).share(&mut |draws| {
        let (mut sequence, mut count, mut held) = (ConfidenceSequence::new(), 0, true);
        for (&total, more) in all.iter().zip(&stages) {
            count += more.draw(draws);
            let Proportion { low, high, .. } = sequence.look(count, total);
            held &= low <= 0.1 && 0.1 <= high;
        }
        let (last, kept) = (anytime(count, 800), sequence.look(count, 800));
        narrower += u32::from(kept.high - kept.low < last.high - last.low);
        held
    });
    assert!(covered >= 0.95, "{covered}");
    assert!(narrower > 0);
}

/// Differences of two laws on the same starts.
#[test]
fn a_difference_of_pairs_is_covered() {
    for (n, only_first, only_second) in [(100_u64, 0.1, 0.1), (100, 0.3, 0.02), (40, 0.5, 0.2), (400, 0.005, 0.001)] {
        let (discordant, theta) = (only_first + only_second, only_first / (only_first + only_second));
        let counts = Counts::new(n, discordant);
        let truth = only_first - only_second;
        let covered = Draws::new(n).share(&mut |draws| {
            let discordant = counts.draw(draws);
            let first = (0..discordant).filter(|_| draws.unit() < theta).count() as u64;
            let Paired { low, high, .. } = Paired::new(first, discordant - first, n);
            low <= truth && truth <= high
        });
        assert!(Claim::Conservative.holds(covered), "{covered} of {n}, {only_first} and {only_second}");
    }
}

/// If all discordant pairs favour the first run, the difference is the unknown share of discordant pairs.
#[test]
fn a_difference_with_a_fixed_discordant_share_is_not_covered() {
    let counts = Counts::new(100, 0.1);
    let covered = Draws::new(100).share(&mut |draws| {
        let discordant = counts.draw(draws);
        let [low, high] = fixed(discordant, discordant).map(|theta| (2.0 * theta - 1.0) * discordant as f64 / 100.0);
        low <= 0.1 && 0.1 <= high
    });
    assert!(!Claim::Conservative.holds(covered), "{covered}");
}

pub(super) fn near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} instead of {expected}");
}

/// Returns P(X <= k) for X ~ Binomial(n, p), summed from the smaller tail.
pub(super) fn binomial_up_to(k: u64, n: u64, p: f64) -> f64 {
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
