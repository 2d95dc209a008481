//! Splitting of a Gaussian random walk, whose probability of exceeding a height is known.

use std::convert::Infallible;
use std::ops::ControlFlow;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng as _, SeedableRng as _};

use crate::splitting::{RandomProcess, SplittingRule, split};

const STEPS: u32 = 200;

/// Walk with steps of mean 0 and variance 1.
#[derive(Clone)]
struct Walk {
    random: ChaCha8Rng,
    second: Option<f64>,
    steps: u32,
    place: f64,
    highest: f64,
    score_kind: Score,
}

/// Score of a walk.
#[derive(Clone, Copy)]
enum Score {
    /// The height.
    Height,
    /// The height, rounded down to a multiple of this number.
    Quantized(f64),
    /// Distance to this height in standard deviations of the remaining walk, negated; positive above the height. It
    /// predicts the event well: the relative spread of estimates at 1e-6 is about 0.25.
    Lookahead(f64),
}

impl Walk {
    fn new(score_kind: Score) -> Self {
        let (random, highest) = (ChaCha8Rng::seed_from_u64(0), f64::NEG_INFINITY);
        Self { random, second: None, steps: 0, place: 0.0, highest, score_kind }
    }

    fn normal(&mut self) -> f64 {
        if let Some(second) = self.second.take() {
            return second;
        }
        let mut unit = || (self.random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64;
        let (radius, turn) = ((-2.0 * libm::log(1.0 - unit())).sqrt(), std::f64::consts::TAU * unit());
        let (sin, cos) = libm::sincos(turn);
        self.second = Some(radius * sin);
        radius * cos
    }

    fn update_score(&mut self) {
        let seen = match self.score_kind {
            Score::Height => self.place,
            Score::Quantized(grain) => (self.place / grain).floor() * grain,
            Score::Lookahead(height) if self.place > height => self.place - height,
            // A walk in discrete time exceeds `height` as often as one in continuous time exceeds `height + 0.58`.
            Score::Lookahead(height) => -(height - self.place + 0.58) / f64::from(STEPS - self.steps).sqrt(),
        };
        self.highest = self.highest.max(seen);
    }
}

impl RandomProcess for Walk {
    type Saved = Self;
    type Error = Infallible;

    fn begin(&mut self, noise_seed: u64) -> Result<(), Infallible> {
        *self = Self { random: ChaCha8Rng::seed_from_u64(noise_seed), ..Self::new(self.score_kind) };
        self.update_score();
        Ok(())
    }

    fn step(&mut self) -> bool {
        if self.steps == STEPS {
            return false;
        }
        self.steps += 1;
        self.place += self.normal();
        self.update_score();
        true
    }

    fn score(&self) -> f64 {
        self.highest
    }

    fn save(&self) -> Self {
        self.clone()
    }

    fn restore(&mut self, saved: &Self, noise_seed: Option<u64>) {
        self.clone_from(saved);
        if let Some(seed) = noise_seed {
            (self.random, self.second) = (ChaCha8Rng::seed_from_u64(seed), None);
        }
    }
}

/// Returns nodes and weights of Gauss-Legendre quadrature on \[-1, 1\], by Newton's method.
fn gauss(count: u32) -> Vec<[f64; 2]> {
    let root = |k: u32| {
        let mut x = (std::f64::consts::PI * (f64::from(k) + 0.75) / (f64::from(count) + 0.5)).cos();
        let mut slope = 1.0;
        for _ in 0..50 {
            let (mut before, mut value) = (1.0, x);
            for n in 2..=count {
                let n = f64::from(n);
                (before, value) = (value, ((2.0 * n - 1.0) * x * value - (n - 1.0) * before) / n);
            }
            slope = f64::from(count) * (x * value - before) / (x * x - 1.0);
            x -= value / slope;
        }
        [x, 2.0 / ((1.0 - x * x) * slope * slope)]
    };
    (0..count).map(root).collect()
}

/// Returns the probability that the walk exceeds `height` at one of its steps.
///
/// The recursion is over the density of the walks that have not yet exceeded `height`, on panels of length 1 from
/// `height` down to -`depth` with `places` nodes each.
fn above(height: f64, depth: f64, places: u32) -> f64 {
    /// Reach of a step in panels; a longer step has a probability of 2e-33.
    const REACH: u32 = 13;
    let density = |x: f64| libm::exp(-0.5 * x * x) / std::f64::consts::TAU.sqrt();
    let beyond = |x: f64| 0.5 * libm::erfc(x * std::f64::consts::FRAC_1_SQRT_2);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a few hundred")]
    let panels = (height + depth).ceil() as u32;
    let on_panel = gauss(places);
    let nodes: Vec<_> = (0..panels)
        .flat_map(|panel| {
            on_panel.iter().map(move |[x, weight]| [height - f64::from(panel) - 0.5 * (1.0 - x), 0.5 * weight])
        })
        .collect();
    // Panels are in order, so the nodes within reach are contiguous.
    let reach = (REACH * places) as usize;
    let near = |index: usize| index.saturating_sub(reach)..(index + reach).min(nodes.len());
    let kernel: Vec<Vec<f64>> = (0..nodes.len())
        .map(|to| near(to).map(|from| nodes[from][1] * density(nodes[to][0] - nodes[from][0])).collect())
        .collect();
    let mut walks: Vec<_> = nodes.iter().map(|[x, _]| density(*x)).collect();
    let mut probability = beyond(height);
    for _ in 1..STEPS {
        probability +=
            nodes.iter().zip(&walks).map(|([x, weight], walks)| weight * walks * beyond(height - x)).sum::<f64>();
        let next = |(to, row): (usize, &Vec<f64>)| row.iter().zip(&walks[near(to)]).map(|(k, walks)| k * walks).sum();
        walks = kernel.iter().enumerate().map(next).collect();
    }
    probability
}

/// Returns the probability for a walk in continuous time, by reflection.
fn reflected(height: f64) -> f64 {
    libm::erfc(height / f64::from(2 * STEPS).sqrt())
}

fn estimates(walk: &Walk, rule: SplittingRule, repetitions: u64) -> Vec<f64> {
    let mut walk = walk.clone();
    let one = |repetition: u64| {
        let Ok(split) = split(&mut walk, rule, [2016, repetition], &mut |_| ControlFlow::Continue(()));
        let split = split.expect("no interruption");
        assert_eq!(split.extinct, split.probability == 0.0);
        split.probability
    };
    (0..repetitions).map(one).collect()
}

/// Returns the difference between the mean of estimates and a value, in standard errors. Estimates of 100 walks at 1e-9
/// with a good score have a skewness below 2. The skewness of the mean of 200 is then 0.14, normal enough within three
/// standard errors.
fn errors_above(estimates: &[f64], value: f64) -> f64 {
    let count = estimates.len() as f64;
    let mean = estimates.iter().sum::<f64>() / count;
    let squares = estimates.iter().map(|estimate| (estimate - mean).powi(2)).sum::<f64>();
    (mean - value) / (squares / (count - 1.0) / count).sqrt()
}

fn repetitions() -> u64 {
    if std::env::var_os("TAUTLINE_LONG").is_some() { 2000 } else { 200 }
}

/// The truth does not depend on the quadrature, and plain walks agree with it.
#[test]
fn the_recursion_converges_and_agrees_with_plain_walks() {
    for height in [HEIGHT_1E6, HEIGHT_1E9] {
        let truth = above(height, 45.0, 6);
        assert!((above(height, 60.0, 10) / truth - 1.0).abs() < 1e-7);
    }
    let (height, count) = (30.0, 20_000_u32);
    let mut walk = Walk::new(Score::Height);
    let hits = (0..count).filter(|&seed| {
        let Ok(()) = walk.begin(u64::from(seed));
        while walk.step() {}
        walk.score() > height
    });
    let (share, truth) = (hits.count() as f64 / f64::from(count), above(height, 60.0, 8));
    let error = (truth * (1.0 - truth) / f64::from(count)).sqrt();
    assert!((share - truth).abs() < 3.0 * error, "{share} for {truth}");
}

const HEIGHT_1E6: f64 = 68.5;
const HEIGHT_1E9: f64 = 85.5;

/// Describes the mean relative to the truth, its standard error, and the difference in standard errors.
fn described(estimates: &[f64], truth: f64) -> String {
    let mean = estimates.iter().sum::<f64>() / estimates.len() as f64;
    let off = errors_above(estimates, truth);
    format!(
        "{:.3} of {truth:.3e}, standard error {:.3}, off by {off:.2} of them",
        mean / truth,
        (mean / truth - 1.0) / off
    )
}

#[test]
fn estimates_of_1e_6_and_1e_9_have_no_bias() {
    for (height, near) in [(HEIGHT_1E6, 1e-6), (HEIGHT_1E9, 1e-9)] {
        let truth = above(height, 45.0, 6);
        assert!((0.5..2.0).contains(&(truth / near)), "{truth}");
        let estimates = estimates(&Walk::new(Score::Lookahead(height)), SplittingRule::new(100, 1, 0.0), repetitions());
        assert!(errors_above(&estimates, truth).abs() < 3.0, "{}", described(&estimates, truth));
        // The formula of continuous time is 20 % and 25 % too high, and the same check detects it.
        let reflected = reflected(height);
        assert!((1.19..1.27).contains(&(reflected / truth)), "{}", reflected / truth);
        assert!(errors_above(&estimates, reflected) < -3.0, "{}", described(&estimates, reflected));
    }
}

/// A poor score widens the spread without bias. With the height as score, estimates of 100 walks have a skewness near
/// 5: even the mean of 2000 is not normal enough for this check. Estimates of 400 walks have a skewness near 1. For 100
/// walks, 20,000 estimates gave 0.997 of the truth with a standard error of 0.011.
#[test]
fn estimates_by_height_alone_have_no_bias_and_a_larger_spread() {
    let truth = above(HEIGHT_1E6, 45.0, 6);
    let estimates = estimates(&Walk::new(Score::Height), SplittingRule::new(400, 20, HEIGHT_1E6), repetitions() / 4);
    assert!(errors_above(&estimates, truth).abs() < 3.0, "{}", described(&estimates, truth));
}

/// With integer heights many walks have equal scores.
#[test]
fn ties_are_unbiased_and_branching_at_the_level_is_biased() {
    let height = 40.0;
    // Integers above 40 are heights of 41 and more.
    let truth = above(height + 1.0, 45.0, 6);
    let right = SplittingRule::new(100, 1, height);
    let wrong = SplittingRule { is_past: |score, level| score >= level, ..right };
    let walk = Walk::new(Score::Quantized(1.0));
    let off = [right, wrong].map(|rule| {
        let estimates = estimates(&walk, rule, repetitions());
        errors_above(&estimates, truth)
    });
    assert!(off[0].abs() < 3.0, "{} standard errors", off[0]);
    assert!(off[1] < -3.0, "{} standard errors", off[1]);
}

#[test]
fn an_estimate_depends_only_on_seed_and_repetition_and_can_be_ended() {
    let rule = SplittingRule::new(20, 3, 30.0);
    let one = |seed, repetition, most: u64| {
        let carry_on = &mut |steps: u64| if steps < most { ControlFlow::Continue(()) } else { ControlFlow::Break(()) };
        let Ok(split) = split(&mut Walk::new(Score::Height), rule, [seed, repetition], carry_on);
        split.map(|split| (split.probability, split.iterations, split.steps))
    };
    let first = one(1, 0, u64::MAX).expect("an estimate");
    assert_eq!(one(1, 0, u64::MAX), Some(first));
    assert_ne!(one(1, 1, u64::MAX), Some(first));
    assert_ne!(one(2, 0, u64::MAX), Some(first));
    assert_eq!(one(1, 0, first.2 + 1), Some(first));
    for steps in [1, 1000, first.2] {
        assert_eq!(one(1, 0, steps), None, "{steps} of {}", first.2);
    }
}

/// Without a survivor the estimate is 0; if all walks exceed the target it is 1.
#[test]
fn no_survivor_gives_0_and_no_ended_walk_gives_1() {
    let coarse = Walk::new(Score::Quantized(1e6));
    assert!(estimates(&coarse, SplittingRule::new(10, 1, 5.0), 3).iter().all(|&estimate| estimate == 0.0));
    assert!(estimates(&coarse, SplittingRule::new(10, 1, -2e6), 3).iter().all(|&estimate| estimate == 1.0));
}
