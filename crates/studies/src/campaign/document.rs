//! Answer of a campaign for readers: headline, notes, tables and figures.

use super::summary::{LawSummary, Pair, Quantiles, Summary};
use super::tally::{Bin, BinShares, Varied};
use super::tally::{BoundKind, Intervals};
use crate::splitting::Repetitions;
use crate::statistics::Proportion;
use crate::study::{Block, Section, Study};
use crate::table::{Kind, Table, percent_at_most, separated};
use tautline_core::text::{counted, significant};
use tautline_report::figures::{Figure, Histogram, Share as Point, histograms, shares};
use tautline_report::report::page::{Badge, Tone};

/// Assumptions of the numbers.
const ASSUMED: [&str; 4] = [
    "Runs are independent draws from the distributions of [vary], and shares apply to these distributions only. If \
     only grids vary, the runs are all points of the grids, and shares have no interval.",
    "A flight is violated if the independent judge finds two vehicles closer than delta, or a vehicle closer to an \
     obstacle than its clearance, also between steps. Flights that ended early and undecided flights count at the \
     upper end of an interval.",
    "For a number of runs fixed beforehand, shares have the two-sided interval of Clopper and Pearson, with an error \
     probability of 2.5 % on either side. The bound of the verdict is one-sided, with 5 %. With an early stop both are \
     those of a confidence sequence.",
    "An interval contains the true value in at least 95 of 100 campaigns. Of many intervals on one page some miss it.",
];
/// Assumptions of estimates of rare violations.
const ASSUMED_OF_SPLITTING: [&str; 2] = [
    "Each estimate is without bias for any number of flights. The mean has Student's interval for normal values.",
    "Flights from one start differ by their noise from step to step. Each run draws its start and all varied keys.",
];

/// Returns a p-value, or its bound if it is small.
fn p_value(p: f64) -> String {
    const LEAST: f64 = 1e-4;
    if p < LEAST { "below 0.0001".to_owned() } else { significant(p, 2) }
}

impl LawSummary {
    /// Returns the violations in a sentence, such as `0 of 10,000 flights violated: below 0.030 % with 95 % confidence
    /// (one-sided)`.
    #[must_use]
    pub fn sentence(&self) -> String {
        if let Some(splitting) = &self.splitting {
            return rare_event_sentence(splitting);
        }
        let Proportion { count, of: total, confidence, .. } = self.violated;
        if total == 0 {
            return "no flight was flown".to_owned();
        }
        let refused = if self.is_mostly_refused() {
            let runs = separated(self.not_flown + total);
            format!("MOST DRAWS REFUSED, {} of {runs} could not be flown: ", separated(self.not_flown))
        } else {
            String::new()
        };
        // An upper bound of 1 is no information.
        let bound = self.violated_below.filter(|bound| bound.share < 1.0).map(|bound| {
            let kind = match bound.kind {
                BoundKind::OneSided => "one-sided",
                BoundKind::ConfidenceSequence => "confidence sequence",
            };
            let (below, confidence) = (percent_at_most(bound.share), 100.0 * bound.confidence);
            let link = if count == 0 && self.unknown == 0 { ": " } else { "; violated " };
            format!("{link}below {below} with {confidence:.0} % confidence ({kind})")
        });
        let bound = if confidence == 1.0 { Some(": all points of the grid, no sample".to_owned()) } else { bound };
        let flights = if total == 1 { "flight" } else { "flights" };
        let broken = match self.certificates_broken {
            0 => String::new(),
            count => format!("CERTIFICATE BROKEN in {}: ", counted(count, "flight", "flights")),
        };
        let counts = outcomes(count, self.unknown, self.clear.count, &format!("{} {flights}", separated(total)));
        let bound = bound.unwrap_or_default();
        format!("{refused}{broken}{counts}{bound}")
    }

    /// Returns whether more than half of the runs cannot be flown as drawn. The answer is then of a small part of what
    /// the specification describes.
    #[must_use]
    pub fn is_mostly_refused(&self) -> bool {
        self.not_flown > self.violated.of
    }
}

/// Returns the numbers of flights by outcome, what failed first. `all` names all flights, such as `100 flights`.
fn outcomes(violated: u64, unknown: u64, clear: u64, all: &str) -> String {
    let [shown, not_known, proved] = [violated, unknown, clear].map(separated);
    match (violated, unknown, clear) {
        (0, 0, _) | (_, 0, 0) => format!("{shown} of {all} violated"),
        (_, 0, _) => format!("{shown} of {all} violated, {proved} clear"),
        (0, ..) => format!("{not_known} of {all} unknown, 0 violated, {proved} clear"),
        _ => format!("{shown} of {all} violated, {not_known} unknown, {proved} clear"),
    }
}

/// Returns the probability of a violation in a sentence.
fn rare_event_sentence(splitting: &Repetitions) -> String {
    let Repetitions { repetitions, probability, confidence, extinct, .. } = splitting;
    let range = match (probability.low, probability.high) {
        (Some(low), Some(high)) => {
            format!(": between {low:.2e} and {high:.2e} with {:.0} % confidence", 100.0 * confidence)
        }
        _ => ", with an unknown error".to_owned(),
    };
    let estimates = counted(*repetitions, "estimate", "estimates");
    match probability.value {
        Some(0.0) => format!("no violation in {estimates}: the probability has no upper bound"),
        Some(value) => {
            format!("probability of a violation {value:.2e}{range}, from {estimates}, {} of them 0", extinct.count)
        }
        None => "no estimate".to_owned(),
    }
}

impl Summary {
    /// Returns whether runs are estimates of rare violations.
    fn is_of_estimates(&self) -> bool {
        self.laws.iter().any(|law| law.splitting.is_some())
    }

    fn shares_table(&self) -> Table {
        Table::of("Flights, with two-sided 95 % intervals of their shares", &self.laws)
            .column("law", "Law", Kind::Text, |law| law.name.clone())
            .column("flown", "Flights", Kind::Count, |law| law.violated.of)
            .column("violated", "Violated", Kind::Share, |law| law.violated)
            .column("clear", "Clear", Kind::Share, |law| law.clear)
            .column("unknown", "Unknown", Kind::Count, |law| law.unknown)
            .column("reached", "Reached", Kind::Share, |law| law.reached)
            .column("pass", "Passed", Kind::Share, |law| law.pass)
            .build()
    }

    fn numbers_table(&self) -> Table {
        let numbers = |law: &LawSummary| {
            [
                (format!("{}: smallest separation less delta [m]", law.name), law.clearance_m),
                (format!("{}: time to reach the formation [s]", law.name), law.reached_at_s),
                (format!("{}: path length of all vehicles [m]", law.name), law.path_length_m),
            ]
        };
        let rows: Vec<(String, Quantiles)> = self.laws.iter().flat_map(numbers).collect();
        Table::of("Quantiles over the flights, with 95 % intervals of order statistics", &rows)
            .column("", "Number", Kind::Text, |(name, _)| name.clone())
            .column("", "Least", Kind::AtLeast, |(_, row)| row.min)
            .column("", "5 %", Kind::AtLeast, |(_, row)| row.p05)
            .column("", "Median", Kind::AtLeast, |(_, row)| row.median)
            .column("", "95 %", Kind::AtLeast, |(_, row)| row.p95)
            .column("", "Most", Kind::AtLeast, |(_, row)| row.max)
            .build()
    }

    fn pairs_table(&self) -> Table {
        Table::of("Runs that two laws ended differently, with McNemar's exact test", &self.pairs)
            .column("", "Two laws", Kind::Text, |pair: &Pair| pair.laws.join(" and "))
            .column("", "Only the first clear", Kind::Count, |pair| pair.clear.only_first)
            .column("", "Only the second clear", Kind::Count, |pair| pair.clear.only_second)
            .column("", "p", Kind::Text, |pair| p_value(pair.clear.p_value))
            .column("", "Only the first reached", Kind::Count, |pair| pair.reached.only_first)
            .column("", "Only the second reached", Kind::Count, |pair| pair.reached.only_second)
            .column("", "p", Kind::Text, |pair| p_value(pair.reached.p_value))
            .build()
    }

    fn estimates_table(&self) -> Table {
        let rows: Vec<_> = self.laws.iter().filter_map(|law| Some((&law.name, law.splitting.as_ref()?))).collect();
        Table::of("By adaptive multilevel splitting, with 95 % intervals", &rows)
            .column("law", "Law", Kind::Text, |(law, _)| (*law).clone())
            .column("estimates", "Estimates", Kind::Count, |(_, estimate)| estimate.repetitions)
            .column("probability", "Probability of a violation", Kind::Rare, |(_, estimate)| estimate.probability)
            .column("extinct", "Estimates of 0", Kind::Count, |(_, estimate)| estimate.extinct.count)
            .column("steps", "Steps flown", Kind::Count, |(_, estimate)| estimate.steps)
            .build()
    }

    fn histograms(&self) -> Vec<Figure> {
        let column_of = |pick: fn(&LawSummary) -> &Option<Histogram>| {
            self.laws.iter().filter_map(|law| Some((law.name.clone(), pick(law).clone()?))).collect::<Vec<_>>()
        };
        let (clearance, reached) =
            (column_of(|law| &law.clearance_histogram_m), column_of(|law| &law.reached_histogram_s));
        let limit = Some((0.0, "delta"));
        let drawn = (!clearance.is_empty())
            .then(|| histograms("clearance", "Smallest separation less delta", "clearance [m]", &clearance, limit));
        let arrived = (!reached.is_empty())
            .then(|| histograms("reached", "Time to reach the formation", "time [s]", &reached, None));
        drawn.into_iter().chain(arrived).collect()
    }

    /// Returns the section with the shares over a varied key.
    fn varied_section(&self, varied: &Varied) -> Section {
        let share = |bin: &Bin, law: usize, pick: fn(&BinShares) -> Proportion| bin.laws.get(law).map(pick);
        let violated: fn(&BinShares) -> Proportion = |bin| bin.violated;
        let reached: fn(&BinShares) -> Proportion = |bin| bin.reached;
        let names = self.laws.iter().map(|law| law.name.as_str()).enumerate();
        let key = Table::of("Shares with two-sided 95 % intervals", &varied.bins).column(
            "",
            &varied.key,
            Kind::Text,
            |bin: &Bin| bin.said.clone(),
        );
        let table = names.clone().fold(key, |table, (law, name)| {
            table.column("", &format!("{name}: violated"), Kind::Share, |bin| share(bin, law, violated)).column(
                "",
                &format!("{name}: reached"),
                Kind::Share,
                |bin| share(bin, law, reached),
            )
        });
        let figure = |name: &str, pick: fn(&BinShares) -> Proportion| {
            let of_law = |law: usize| {
                let point = |bin: &Bin| {
                    let proportion = share(bin, law, pick)?;
                    let value = f64::midpoint(bin.low?, bin.high?);
                    Some(Point { value, share: proportion.share?, interval: Some([proportion.low, proportion.high]) })
                };
                varied.bins.iter().filter_map(point).collect::<Vec<_>>()
            };
            let series: Vec<_> = names.clone().map(|(law, name)| (name.to_owned(), of_law(law))).collect();
            shares(name, &varied.key, name, &series, varied.logarithmic)
        };
        let are_numbers = varied.bins.iter().all(|bin| bin.low.is_some());
        let figures =
            are_numbers.then(|| Block::Figures(vec![figure("violated", violated), figure("reached", reached)]));
        Section::detail(
            format!("Over {}", varied.key),
            "Shares of the flights over the values of a key, with 95 % intervals.",
            figures.into_iter().chain([Block::Table(table.build())]),
        )
    }
}

impl Study for Summary {
    fn kind(&self) -> &'static str {
        if self.is_of_estimates() { "Rare violations" } else { "Campaign" }
    }

    fn title(&self) -> String {
        self.name.clone()
    }

    fn badge(&self) -> Badge {
        let violated = self.laws.iter().any(|law| law.violated.count > 0 || !law.bad.is_empty());
        let is_broken = self.laws.iter().any(|law| law.certificates_broken > 0);
        let (tone, word) = match (self.is_good(), violated) {
            (true, _) => (Tone::Good, "no violation"),
            (false, true) => (Tone::Bad, "violations"),
            (false, false) if is_broken => (Tone::Bad, "certificate broken"),
            (false, false) if self.laws.iter().any(LawSummary::is_mostly_refused) => (Tone::Bad, "most draws refused"),
            (false, false) if self.is_of_estimates() => (Tone::Bad, "no result"),
            (false, false) => (Tone::Bad, "unknown flights"),
        };
        Badge { tone, word: word.to_owned() }
    }

    fn headline(&self) -> String {
        match &self.laws[..] {
            [law] => law.sentence(),
            laws => {
                // Laws with violations come first, then laws with unknown flights.
                let mut laws: Vec<_> = laws.iter().collect();
                laws.sort_by_key(|law| (law.certificates_broken == 0, law.violated.count == 0, law.unknown == 0));
                laws.iter().map(|law| format!("{}: {}", law.name, law.sentence())).collect::<Vec<_>>().join("; ")
            }
        }
    }

    fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        for law in &self.laws {
            let advice = law.splitting.iter().flat_map(|splitting| &splitting.advice);
            notes.extend(advice.map(|advice| format!("{}: {advice}", law.name)));
        }
        notes.extend(self.stopped_early.then(|| {
            let runs = counted(self.runs, "run", "runs");
            format!("early stop after {runs} of {}: later runs are left out", separated(self.runs_planned))
        }));
        notes.extend((self.intervals == Intervals::ConfidenceSequence).then(|| {
            "the number of runs was not fixed beforehand: shares have the wider interval of a confidence sequence, and \
             quantiles have no interval"
                .to_owned()
        }));
        let mut each = |count: fn(&LawSummary) -> u64, what: [&str; 2], rest: &dyn Fn(&LawSummary) -> String| {
            for law in self.laws.iter().filter(|law| count(law) > 0) {
                notes.push(format!("{}: {}{}", law.name, counted(count(law), what[0], what[1]), rest(law)));
            }
        };
        each(|law| law.not_flown, ["run", "runs"], &|law| {
            let why = law.not_flown_because.as_deref().unwrap_or("unknown reason");
            let advice = if law.is_mostly_refused() {
                "; more than half of the draws, so narrow [vary] until most can be flown"
            } else {
                ""
            };
            format!(" could not be flown and count in no share ({why}){advice}")
        });
        each(|law| law.certificates_broken, ["flight", "flights"], &|_| {
            ": CERTIFICATE BROKEN, two vehicles came closer than certified, because of a step too long for the law or \
             a defect; see the column breaks_certificate of the table"
                .to_owned()
        });
        each(|law| law.unknown, ["flight", "flights"], &|law| {
            let them = if law.unknown == 1 { "it as a violation" } else { "them as violations" };
            format!(" ended early without a violation or undecided; the upper end of the interval counts {them}")
        });
        notes
    }

    fn sections(&self) -> Vec<Section> {
        if self.is_of_estimates() {
            return vec![Section::new(
                "Probability of a violation",
                "Estimated from flights that are split near a violation.",
                [Block::Table(self.estimates_table())],
            )];
        }
        let mut sections = vec![
            Section::new(
                "How flights ended",
                "Outcome of the flights of each law, with how close and how late they were.",
                [Block::Table(self.shares_table()), Block::Figures(self.histograms())],
            ),
            Section::new(
                "Quantiles",
                "A quantile of 5 % is the number below which 5 % of the flights lie.",
                [Block::Table(self.numbers_table())],
            ),
        ];
        if !self.pairs.is_empty() {
            sections.push(Section::new(
                "Laws on the same runs",
                "Runs that differ between two laws; a small p means more than chance.",
                [Block::Table(self.pairs_table())],
            ));
        }
        sections.extend(self.varied.iter().map(|varied| self.varied_section(varied)));
        sections
    }

    fn records(&self) -> Table {
        if self.is_of_estimates() { self.estimates_table() } else { self.shares_table() }
    }

    fn assumptions(&self) -> Vec<String> {
        let assumed = if self.is_of_estimates() { &ASSUMED_OF_SPLITTING[..] } else { &ASSUMED };
        assumed.iter().map(|&assumed| assumed.to_owned()).collect()
    }

    fn is_good(&self) -> bool {
        self.laws.iter().all(|law| {
            law.violated.count == 0
                && law.unknown == 0
                && law.certificates_broken == 0
                && law.splitting.is_none()
                && !law.is_mostly_refused()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_headline_begins_with_what_failed() {
        for (violated, unknown, clear, expected) in [
            (3, 2, 95, "3 of 100 flights violated, 2 unknown, 95 clear"),
            (3, 0, 97, "3 of 100 flights violated, 97 clear"),
            (0, 2, 98, "2 of 100 flights unknown, 0 violated, 98 clear"),
            (0, 0, 100, "0 of 100 flights violated"),
            (100, 0, 0, "100 of 100 flights violated"),
        ] {
            assert_eq!(outcomes(violated, unknown, clear, "100 flights"), expected);
        }
    }

    #[test]
    fn a_small_p_value_is_a_bound() {
        assert_eq!([1e-30, 0.25].map(p_value), ["below 0.0001", "0.25"]);
    }
}
