//! What several estimates say together.

use serde::Serialize;

use super::estimate::Splitting;
use super::settings::warning;
use crate::statistics::{CONFIDENCE, Estimate, Proportion};

/// Estimates below which Student's interval of what is skewed is too optimistic to go without a word.
const MANY: usize = 20;

/// The mean of independent estimates of one probability, with its interval.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Repetitions {
    /// Number of estimates.
    pub repetitions: u64,
    /// Their mean, which has no bias, with Student's interval, cut off at 0 and 1. It is that of normal values, and estimates
    /// are skewed, the more the fewer flights each has: `advice` says where that matters.
    pub probability: Estimate,
    /// [`CONFIDENCE`].
    pub confidence: f64,
    /// Estimates that ended with nothing, at 0.
    pub extinct: Proportion,
    /// Steps flown for all of them.
    pub steps: u64,
    /// What is to be said with the interval, if anything.
    pub advice: Vec<String>,
}

impl Repetitions {
    /// Of repetitions under one seed, each of another number.
    #[must_use]
    pub fn new(estimates: &[Splitting]) -> Self {
        let probabilities: Vec<_> = estimates.iter().map(|estimate| estimate.probability).collect();
        let extinct = estimates.iter().filter(|estimate| estimate.extinct).count();
        let all_extinct = extinct == estimates.len();
        let Estimate { value, low, high } = Estimate::mean(&probabilities);
        let low = low.map(|low| low.max(0.0));
        // Where no estimate has found anything there is no spread to tell how much more there may be.
        let high = high.map(|high| high.min(1.0)).filter(|_| !all_extinct);
        let fewest = estimates.iter().map(|estimate| estimate.flights).min();
        let mut advice: Vec<_> = fewest.and_then(warning).into_iter().collect();
        if extinct > 0 {
            advice.push(format!(
                "{extinct} of {} estimates ended with no flight left, at 0: {}; fly more at a time",
                estimates.len(),
                if all_extinct { "there is no upper bound" } else { "the mean rests on the others" }
            ));
        }
        if estimates.len() < MANY {
            advice.push(format!(
                "the interval of {} estimates is that of normal values, which estimates are not; {MANY} or more make it near that",
                estimates.len()
            ));
        }
        Self {
            repetitions: estimates.len() as u64,
            probability: Estimate { value, low, high },
            confidence: CONFIDENCE,
            extinct: Proportion::new(extinct as u64, estimates.len() as u64),
            steps: estimates.iter().map(|estimate| estimate.steps).sum(),
            advice,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn estimate(probability: f64, flights: u64) -> Splitting {
        Splitting {
            repetition: 0,
            probability,
            flights,
            kill: 1,
            iterations: 0,
            extinct: probability == 0.0,
            steps: 10,
            bad: Vec::new(),
        }
    }

    #[test]
    fn estimates_are_told_with_what_is_to_be_said_of_them() {
        let many = Repetitions::new(&vec![[estimate(0.25, 100), estimate(0.75, 100)]; 10].concat());
        assert_eq!((many.advice.as_slice(), many.steps, many.probability.value), ([].as_slice(), 200, Some(0.5)));
        // s = 0.2565, t = 2.093 for 19 degrees of freedom.
        assert!(many.probability.low.is_some_and(|low| (low - 0.37996).abs() < 1e-4));
        let few = Repetitions::new(&[estimate(1e-6, 20), estimate(0.0, 20)]);
        assert_eq!((few.probability.low, few.extinct.count, few.advice.len()), (Some(0.0), 1, 3));
        assert!(few.advice[0].contains("20 flights at a time are few") && few.advice[1].contains("1 of 2"));
    }

    #[test]
    fn nothing_found_is_no_bound() {
        let none = Repetitions::new(&vec![estimate(0.0, 100); 30]);
        assert_eq!((none.probability.value, none.probability.high), (Some(0.0), None));
        assert!(none.advice[0].contains("no upper bound"));
    }
}
