//! The answer of a campaign in words: a sentence, what one must know to read it, and tables for the terminal.

use super::result::{LawSummary, Summary};
use super::tally::{BoundKind, Intervals};
use crate::splitting::Repetitions;
use crate::statistics::Proportion;
use tautline_core::text::{aligned, at_least, at_most, counted, fixed, metres, seconds, significant};

/// Decimals that show two digits of a share in per cent, at most 8.
fn decimals(share: f64) -> u8 {
    let from_the_nearer_end = (100.0 * share).min(100.0 * (1.0 - share));
    if from_the_nearer_end <= 0.0 {
        return 0;
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "between 0 and 8")]
    let decimals = (1.0 - from_the_nearer_end.log10().floor()).clamp(0.0, 8.0) as u8;
    decimals
}

/// A share in per cent.
pub(super) fn percent(share: f64) -> String {
    format!("{} %", fixed(100.0 * share, decimals(share).into()))
}

/// The interval of a share, rounded outwards.
pub(super) fn interval(share: &Proportion) -> String {
    format!("{} to {}", from(share.low), up_to(share.high))
}

/// The lower end of an interval in per cent, rounded down.
fn from(share: f64) -> String {
    format!("{} %", at_least(100.0 * share, decimals(share)))
}

/// The upper end of an interval in per cent, rounded up.
fn up_to(share: f64) -> String {
    format!("{} %", at_most(100.0 * share, decimals(share)))
}

/// How likely chance alone is.
pub(super) fn p_value(p: f64) -> String {
    const LEAST: f64 = 1e-4;
    if p < LEAST { "below 0.0001".to_owned() } else { significant(p, 2) }
}

/// A number with separators, as people write large ones.
pub(super) fn number(number: u64) -> String {
    let digits = number.to_string();
    let first = digits.len() % 3;
    digits.chars().enumerate().fold(String::new(), |mut text, (k, digit)| {
        if k > 0 && k % 3 == first {
            text.push(',');
        }
        text.push(digit);
        text
    })
}

impl LawSummary {
    /// Violations in a sentence, such as `0 of 10,000 flights violated: below 0.030 % with 95 % confidence (one-sided)`.
    #[must_use]
    pub fn sentence(&self) -> String {
        if let Some(splitting) = &self.splitting {
            return rare(splitting);
        }
        let Proportion { count, of, confidence, .. } = self.violated;
        if confidence == 1.0 && of > 0 {
            let unknown =
                if self.unknown > 0 { format!(", of {} it is not known", number(self.unknown)) } else { String::new() };
            return format!(
                "{} of {} flights violated{unknown}: all points of the grid, and no sample",
                number(count),
                number(of)
            );
        }
        if of == 0 {
            return "no flight was flown: nothing is known".to_owned();
        }
        // A share that may be 1 is below nothing.
        let bound = self.violated_below.filter(|bound| bound.share < 1.0).map(|bound| {
            let kind = match bound.kind {
                BoundKind::OneSided => "one-sided",
                BoundKind::ConfidenceSequence => "confidence sequence",
            };
            format!(": below {} with {:.0} % confidence ({kind})", up_to(bound.share), 100.0 * bound.confidence)
        });
        let flights = if of == 1 { "flight" } else { "flights" };
        let unknown = match self.unknown {
            0 => String::new(),
            unknown => format!(", of {} it is not known", number(unknown)),
        };
        format!("{} of {} {flights} violated{unknown}{}", number(count), number(of), bound.unwrap_or_default())
    }
}

/// The probability of a violation in a sentence.
fn rare(splitting: &Repetitions) -> String {
    let Repetitions { repetitions, probability, confidence, extinct, .. } = splitting;
    let number = |value: f64| format!("{value:.2e}");
    let range = match (probability.low, probability.high) {
        (Some(low), Some(high)) => {
            format!(": between {} and {} with {:.0} % confidence", number(low), number(high), 100.0 * confidence)
        }
        _ => ": how far off that is is not known".to_owned(),
    };
    let estimates = counted(*repetitions, "estimate", "estimates");
    match probability.value {
        Some(0.0) => format!("no violation was found in {estimates}: nothing is known of how rare one is"),
        Some(value) => format!(
            "a flight is violated with a probability of {}{range}, from {estimates}, of which {} came to nothing",
            number(value),
            extinct.count
        ),
        None => "nothing was estimated".to_owned(),
    }
}

impl Summary {
    /// A table of estimated probabilities.
    fn estimates(&self) -> String {
        let names = ["law", "estimates", "probability", "at least", "at most", "came to nothing", "steps flown"];
        let mut rows = vec![names.map(str::to_owned).to_vec()];
        let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.2e}"));
        rows.extend(self.laws.iter().filter_map(|law| {
            let of = law.splitting.as_ref()?;
            let Repetitions { repetitions, probability, extinct, steps, .. } = of;
            let numbers = [probability.value, probability.low, probability.high].map(number);
            let counts = [extinct.count, *steps].map(self::number);
            Some([&[law.name.clone(), self::number(*repetitions)][..], &numbers, &counts].concat())
        }));
        aligned(&rows)
    }

    /// The answer in a sentence for each law.
    #[must_use]
    pub fn headline(&self) -> String {
        match &self.laws[..] {
            [law] => law.sentence(),
            laws => laws.iter().map(|law| format!("{}: {}", law.name, law.sentence())).collect::<Vec<_>>().join("; "),
        }
    }

    /// What one must know to read it, a sentence each.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        let early = self.stopped_early.then(|| {
            format!(
                "enough was known after {} of {}: later ones are left out",
                counted(self.runs, "run", "runs"),
                number(self.runs_planned)
            )
        });
        let sequence = (self.intervals == Intervals::ConfidenceSequence).then(|| {
            "the number of runs was not fixed beforehand: shares have the interval of a confidence sequence, which is wider, and \
             quantiles have none"
                .to_owned()
        });
        let impossible = self.laws.iter().filter(|law| law.not_flown > 0).map(|law| {
            format!(
                "{}: {} could not be flown as drawn and count nowhere ({})",
                law.name,
                counted(law.not_flown, "run", "runs"),
                law.not_flown_because.as_deref().unwrap_or("for no reason that was kept")
            )
        });
        let broken = self.laws.iter().filter(|law| law.certificates_broken > 0).map(|law| {
            format!(
                "{}: CERTIFICATE BROKEN in {}: two vehicles came closer than the law promised, by a step too long for it or a defect; \
                 column breaks_certificate of the table says where",
                law.name,
                counted(law.certificates_broken, "flight", "flights")
            )
        });
        let unknown = self.laws.iter().filter(|law| law.unknown > 0).map(|law| {
            format!(
                "{}: {} ended early without a violation, or the judge cannot tell; the upper end of the interval counts {} as \
                 violations",
                law.name,
                counted(law.unknown, "flight", "flights"),
                if law.unknown == 1 { "it" } else { "them" }
            )
        });
        let advice = self.laws.iter().filter_map(|law| Some((law, law.splitting.as_ref()?)));
        let advice = advice.flat_map(|(law, of)| of.advice.iter().map(move |said| format!("{}: {said}", law.name)));
        advice.chain(early).chain(sequence).chain(impossible).chain(broken).chain(unknown).collect()
    }

    /// A table of the laws, and one of each two of them.
    #[must_use]
    pub fn text(&self) -> String {
        if self.laws.iter().any(|law| law.splitting.is_some()) {
            return self.estimates();
        }
        let names = [
            "law",
            "flown",
            "violated",
            "two-sided 95 % interval",
            "reached",
            "two-sided 95 % interval",
            "least clearance [m]",
            "median [m]",
            "reached at, median",
        ];
        let mut rows = vec![names.map(str::to_owned).to_vec()];
        rows.extend(self.laws.iter().map(|law| {
            let optional =
                |number: Option<f64>, said: &dyn Fn(f64) -> String| number.map_or_else(|| "-".to_owned(), said);
            vec![
                law.name.clone(),
                number(law.violated.of),
                number(law.violated.count),
                interval(&law.violated),
                number(law.reached.count),
                interval(&law.reached),
                optional(law.clearance_m.min, &metres),
                optional(law.clearance_m.median.value, &metres),
                optional(law.reached_at_s.median.value, &seconds),
            ]
        }));
        let mut text = aligned(&rows);
        if !self.pairs.is_empty() {
            let names =
                ["first", "second", "only first clear", "only second", "p", "only first reached", "only second", "p"];
            let mut rows = vec![names.map(str::to_owned).to_vec()];
            rows.extend(self.pairs.iter().map(|pair| {
                let paired = [pair.clear, pair.reached]
                    .map(|of| [number(of.only_first), number(of.only_second), p_value(of.p_value)].to_vec());
                [pair.laws.to_vec(), paired.concat()].concat()
            }));
            text = format!("{text}\n{}", aligned(&rows));
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_grouped_and_small_shares_are_told() {
        assert_eq!([0, 7, 1000, 10_000, 1_234_567].map(number), ["0", "7", "1,000", "10,000", "1,234,567"]);
        assert_eq!([0.0, 0.000_369, 0.5, 0.999_87, 1.0].map(percent), ["0 %", "0.037 %", "50 %", "99.987 %", "100 %"]);
        let share = crate::statistics::Proportion::new(0, 10_000);
        assert_eq!((from(share.low), up_to(share.high)), ("0 %".to_owned(), "0.037 %".to_owned()));
        // Rounded outwards: an interval never says more than is known.
        assert_eq!((from(0.123_9), up_to(0.123_1)), ("12 %".to_owned(), "13 %".to_owned()));
        assert_eq!((p_value(1e-30), p_value(0.25)), ("below 0.0001".to_owned(), "0.25".to_owned()));
    }
}
