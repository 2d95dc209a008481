//! What is varied, and between which values.

use std::fmt;

use serde::Serialize;

/// Steps, from one bound to the other, that a value is rounded to: what is flown again is said in few digits.
const STEPS: f64 = 1e6;
/// Most decimals of a value.
const MOST_DECIMALS: u8 = 15;

/// A key of a scenario and the values between which it may be, as `--vary` has it.
#[derive(Clone, Debug, PartialEq)]
pub struct Variation {
    /// The key, as for an override.
    pub key: String,
    /// Its smallest value.
    pub low: f64,
    /// Its largest value.
    pub high: f64,
}

/// A number that a search is free to choose, within its bounds.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bound {
    /// The key that it stands at.
    pub key: String,
    /// Its smallest value.
    pub low: f64,
    /// Its largest value.
    pub high: f64,
    /// Whether it is a whole number.
    pub whole: bool,
}

impl fmt::Display for Variation {
    /// As [`Variation::parse`] reads it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}..{}", self.key, self.low, self.high)
    }
}

impl Variation {
    /// Reads `KEY=LOW..HIGH`.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub fn parse(text: &str) -> Result<Self, String> {
        let parts = text.split_once('=').and_then(|(key, range)| Some((key.trim(), range.split_once("..")?)));
        let Some((key, (low, high))) = parts else { return Err(format!("`{text}` is not KEY=LOW..HIGH")) };
        let number = |text: &str| text.trim().parse::<f64>().map_err(|_| format!("`{}` is not a number", text.trim()));
        Self::new(key, number(low)?, number(high)?)
    }

    /// A key between two values.
    ///
    /// # Errors
    /// What is wrong with it, in words.
    pub fn new(key: &str, low: f64, high: f64) -> Result<Self, String> {
        if !(low.is_finite() && high.is_finite() && (high - low).is_finite()) {
            return Err(format!("{key} is to be between {low} and {high}"));
        }
        if low >= high {
            return Err(format!("{key} is to be between {low} and {high}, of which the first is not the smaller one"));
        }
        Ok(Self { key: key.to_owned(), low, high })
    }

    pub(super) fn bound(&self, whole: bool) -> Bound {
        Bound { key: self.key.clone(), low: self.low, high: self.high, whole }
    }
}

impl Bound {
    /// The value at a place from 0 to 1 between the bounds, rounded to a millionth of their distance, or to a whole number.
    #[must_use]
    pub fn at(&self, place: f64) -> f64 {
        let Self { low, high, whole, .. } = *self;
        if whole {
            // Each whole number has the same share of the places.
            return (low + ((high - low + 1.0) * place).floor()).clamp(low, high);
        }
        let value = low + (high - low) * place;
        let decimals = tautline_core::text::decimals_of((high - low) / STEPS, MOST_DECIMALS);
        let rounded = format!("{value:.decimals$}").parse().unwrap_or(value);
        // Adding 0 turns -0 into 0.
        f64::clamp(rounded, low, high) + 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_variation_is_a_key_and_two_numbers() {
        let read = Variation::parse("start.positions_m.2.x = -1.5..0.25");
        assert_eq!(read, Variation::new("start.positions_m.2.x", -1.5, 0.25));
        for (text, said) in [
            ("law.alpha", "is not KEY=LOW..HIGH"),
            ("law.alpha=1", "is not KEY=LOW..HIGH"),
            ("law.alpha=1..", "`` is not a number"),
            ("law.alpha=a..2", "`a` is not a number"),
            ("law.alpha=2..2", "not the smaller"),
            ("law.alpha=3..2", "not the smaller"),
            ("law.alpha=0..inf", "between 0 and inf"),
            ("law.alpha=nan..1", "between NaN and 1"),
            ("law.alpha=-1e308..1e308", "between"),
        ] {
            let refused = Variation::parse(text).expect_err(text);
            assert!(refused.contains(said), "{text}: {refused}");
        }
    }

    #[test]
    fn values_have_few_digits_and_never_leave_their_bounds() {
        let bound = Variation::new("key", -0.1, 2.0 / 3.0).expect("a variation").bound(false);
        assert_eq!([bound.at(0.0), bound.at(1.0)], [bound.low, bound.high]);
        for k in 0..=1000 {
            let value = bound.at(f64::from(k) / 1000.0);
            assert!((bound.low..=bound.high).contains(&value), "{value}");
            assert!(k == 1000 || value.to_string().len() <= "-0.1234567".len(), "{value}");
        }
        let whole = Variation::new("key", 1.0, 3.0).expect("a variation").bound(true);
        assert_eq!([0.0, 0.3, 0.34, 0.66, 0.67, 1.0].map(|place| whole.at(place)), [1.0, 1.0, 2.0, 2.0, 3.0, 3.0]);
    }
}
