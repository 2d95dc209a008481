//! The margin as a page.

use super::result::Margin;
use super::words::{held, prediction, value};
use tautline_core::text::metres;
use tautline_report::figures::{Share, margin as figure};
use tautline_report::report::page::{self, Badge, Page, Render as _, Tone, noted, section};

/// What a page shows beside the margin.
#[derive(Clone, Copy, Debug)]
pub struct MarginPage<'a> {
    /// The command that makes the search again.
    pub command: &'a str,
    /// What it is, and the command that flies it: the sides of the bracket.
    pub sides: &'a [(String, String)],
}

/// What the numbers rest on.
const ASSUMED: [&str; 3] = [
    "A value of the key holds where every run of it does. One run that does not is enough, so more runs find a smaller margin.",
    "The range is looked at in a few places first, and the first interval in which the verdict turns is halved. A turn and back \
     between two neighbouring places is not seen.",
    "Shares have the interval of Clopper and Pearson for a number of runs that was fixed before the first.",
];

impl Margin {
    /// The margin as a self-contained page. Two searches for the same give the same bytes.
    #[must_use]
    pub fn to_html(&self, page: &MarginPage<'_>) -> String {
        let shares = self.probes.iter().map(|probe| Share {
            value: probe.value,
            share: probe.held.share.unwrap_or(f64::NAN),
            interval: (self.runs > 1).then_some([probe.held.low, probe.held.high]),
        });
        let chart = figure(
            &shares.collect::<Vec<_>>(),
            &self.key,
            self.question.words()[0],
            self.turn.map(|turn| turn.bracket),
            &self.predicted.iter().filter_map(|margin| Some((margin.value?, prediction(margin)))).collect::<Vec<_>>(),
            self.logarithmic,
        );
        let rows = self.probes.iter().map(|probe| {
            let [held, interval] = held(probe);
            let min = probe.min_m.map_or_else(|| "-".to_owned(), metres);
            [value(probe.value).render(), noted(&held, &interval), min.render()]
        });
        let caption = if self.runs == 1 { "One flight each" } else { "With 95 % intervals" };
        let columns = [self.key.as_str(), self.question.words()[0], "Smallest separation [m]"];
        let mut sections = vec![section("Where the verdict turns", &[page::figures(&[chart])])];
        sections.push(section("Every value tried", &[page::numbers(caption, &columns, rows)]));
        let notes = [self.predictions(), self.notes()].concat();
        if !notes.is_empty() {
            sections.push(section("What to know", &[page::list(&notes)]));
        }
        sections.push(section("What was assumed", &[page::list(&ASSUMED)]));
        sections.push(section("Repeat it", &[page::command(page.command)]));
        if !page.sides.is_empty() {
            let blocks = page.sides.iter().flat_map(|(what, command)| [page::list(&[what]), page::command(command)]);
            sections.push(section("Fly both sides", &blocks.collect::<Vec<_>>()));
        }
        Page {
            title: format!("{}: {}", self.scenario.name, self.key),
            kind: "Margin",
            badge: Badge { tone: Tone::Neutral, word: self.effort() },
            verdict: self.headline(),
            reasons: Vec::new(),
            warnings: Vec::new(),
            sections,
        }
        .render()
    }
}
