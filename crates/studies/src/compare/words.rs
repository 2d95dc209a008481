//! The comparison in words: a table for the terminal, and what one must know to read it.

use super::flight::Outcome;
use super::measures::{ARRIVALS, COSTS, Cell, OUTCOMES};
use super::plan::JITTER;
use super::result::{Comparison, LawRow};
use tautline_core::text::{aligned, counted, metres, significant};

/// Most law names that a line of the table holds, each with a number and its interval.
const SIDE_BY_SIDE: usize = 3;

impl Comparison {
    /// What was flown, in one line.
    #[must_use]
    pub fn headline(&self) -> String {
        let laws = counted(self.laws.len() as u64, "law", "laws");
        let starts = match self.runs {
            0 => "no start".to_owned(),
            1 => format!("the same start (start.seed {})", self.seed),
            runs => format!("the same {runs} starts (start.seed {} to {})", self.seed, self.seed + (runs - 1)),
        };
        format!("{}: {laws} from {starts}, delta {} m", self.scenario.name, self.delta_m)
    }

    /// What one must know to read the numbers, a sentence each.
    #[must_use]
    pub fn notes(&self) -> Vec<String> {
        let interrupted = (self.runs < self.runs_asked).then(|| {
            format!(
                "interrupted: of {} starts, {} were flown under every law, and these are compared",
                self.runs_asked, self.runs
            )
        });
        let jitter = self.jitter_m.map(|jitter_m| {
            format!(
                "the start has no randomness: start.seed moves each coordinate by up to {} m ({} % of delta)",
                metres(jitter_m),
                100.0 * JITTER
            )
        });
        interrupted.into_iter().chain(jitter).chain(self.laws.iter().flat_map(LawRow::notes)).collect()
    }

    /// The table, a few laws side by side, and the cost of each law on this machine.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = String::new();
        let costs: Vec<_> = self.performance.laws.iter().map(|law| cost(law.law_step_s)).collect();
        for (laws, costs) in self.laws.chunks(SIDE_BY_SIDE).zip(costs.chunks(SIDE_BY_SIDE)) {
            let mut rows = vec![row("", "", laws.iter().map(|law| law.name.clone()))];
            for measure in OUTCOMES.iter().chain(&ARRIVALS).chain(&COSTS) {
                rows.push(row(measure.name, measure.unit, laws.iter().map(|law| on_one_line((measure.cell)(law)))));
            }
            rows.push(row("a step of the law, on this machine", "us", costs.iter().cloned()));
            text += &aligned(&rows);
            text.push('\n');
        }
        text + "In brackets: 95 % intervals, of Clopper and Pearson (shares), order statistics (median, percentile) and \
                Student (means).\n"
    }
}

impl LawRow {
    fn notes(&self) -> Vec<String> {
        let (name, of) = (&self.name, self.flights.len());
        let refused = (self.refused > 0).then(|| {
            let mut codes: Vec<_> = self.flights.iter().flat_map(|row| &row.refused).map(String::as_str).collect();
            codes.sort_unstable();
            codes.dedup();
            let codes = codes.join(", ");
            format!(
                "{name}: {} of {of} flights are refused by `check` ({codes}) and were flown all the same",
                self.refused
            )
        });
        let early = self.flights.iter().filter_map(|row| Some((row, row.ended_early.as_deref()?)));
        let early_count = early.clone().count();
        let ended = early.clone().next().map(|(row, why)| {
            let violated = early.filter(|(row, _)| row.outcome == Outcome::Violated).count();
            let why = why.trim_end_matches('.');
            format!(
                "{name}: {early_count} of {of} flights ended early, {violated} of them after a violation; the first has \
                 start.seed {}: {why}",
                row.seed
            )
        });
        let reached = self.reached.count;
        let censored = (reached > 0 && reached < self.reached.of).then(|| {
            format!(
                "{name}: the times to reach are over the {reached} of {of} flights that reached the formation, alone"
            )
        });
        [refused, ended, censored].into_iter().flatten().collect()
    }
}

fn cost(law_step_s: Option<f64>) -> String {
    law_step_s.map_or_else(|| "-".to_owned(), |step_s| significant(1e6 * step_s, 3))
}

fn on_one_line(Cell { value, interval }: Cell) -> String {
    interval.map_or_else(|| value.clone(), |interval| format!("{value} {interval}"))
}

fn row(name: &str, unit: &str, cells: impl Iterator<Item = String>) -> Vec<String> {
    [name.to_owned(), unit.to_owned()].into_iter().chain(cells).collect()
}
