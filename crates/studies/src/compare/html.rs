//! The comparison as a page.

use super::measures::{ARRIVALS, COSTS, Cell, Measure, OUTCOMES};
use super::result::{Comparison, LawRow};
use tautline_core::text::significant;
use tautline_report::report::page::{self, Badge, Markup, Page, Picture, Render as _, Tone, noted, section};

/// What a page shows beside the comparison.
#[derive(Clone, Copy, Debug)]
pub struct ComparePage<'a> {
    /// One picture a law, at its worst moment.
    pub pictures: &'a [Picture],
    /// Why there are none.
    pub no_pictures: Option<&'a str>,
    /// The command that makes the comparison again.
    pub command: &'a str,
    /// A law's name, and the command that flies its worst flight.
    pub worst: &'a [(String, String)],
}

/// What the numbers rest on.
const ASSUMED: [&str; 5] = [
    "Every law is flown from the same starts, on the same plant, and judged by the same audit: a flight is proved clear where it \
     was flown to its end, no two vehicles came closer than delta at any time, and both detectors agree.",
    "Starts are draws, and intervals say what they tell about all starts that could have been drawn: they hold for a number of \
     runs that was fixed before the first.",
    "Shares have the interval of Clopper and Pearson, medians and percentiles that of order statistics, means that of Student.",
    "Times to reach are over the flights that reached the formation and kept it to the end.",
    "Path length and total control are sums over all vehicles and the whole flight.",
];

impl Comparison {
    /// The comparison as a self-contained page. Two comparisons of the same give the same bytes but for the part on
    /// performance, which is the last.
    #[must_use]
    pub fn to_html(&self, page: &ComparePage<'_>) -> String {
        let mut sections = vec![section(
            "Laws side by side",
            &[
                table("How flights ended, with 95 % intervals", &OUTCOMES, &self.laws),
                table("How soon they reached the formation, and how near two vehicles came", &ARRIVALS, &self.laws),
                table("What it cost", &COSTS, &self.laws),
            ],
        )];
        let notes = self.notes();
        if !notes.is_empty() {
            sections.push(section("What to know", &[page::list(&notes)]));
        }
        match page.no_pictures {
            Some(why) => sections.push(section("The worst moment of each law", &[page::list(&[why])])),
            None => sections.push(section("The worst moment of each law", &[page::pictures(page.pictures)])),
        }
        let settings = self.laws.iter().map(|law| [law.name.clone(), law.overrides.join(", ")]);
        sections.extend([
            section("Keys", &[page::words("The keys of each law", &["Law", "Keys"], settings)]),
            section("What was assumed", &[page::list(&ASSUMED)]),
            section("Repeat it", &[page::command(page.command)]),
        ]);
        let worst: Vec<_> = page.worst.iter().map(|(_, command)| page::command(command)).collect();
        if !worst.is_empty() {
            sections.push(section("Fly the worst flight of each law", &worst));
        }
        sections.push(section("Performance", &[self.cost()]));
        Page {
            title: self.scenario.name.clone(),
            kind: "Laws side by side",
            badge: Badge { tone: Tone::Neutral, word: "compared".to_owned() },
            verdict: self.headline(),
            reasons: Vec::new(),
            warnings: Vec::new(),
            sections,
        }
        .render()
    }

    fn cost(&self) -> Markup {
        let rows = self.performance.laws.iter().map(|law| {
            let cost = law.law_step_s.map_or_else(|| "-".to_owned(), |step_s| significant(1e6 * step_s, 3));
            [law.name.clone(), cost]
        });
        page::numbers("Measured on the machine that flew", &["Law", "A step of the law [us]"], rows)
    }
}

fn table(caption: &str, measures: &[Measure], laws: &[LawRow]) -> Markup {
    let heading = |of: &Measure| {
        if of.unit.is_empty() { of.name.to_owned() } else { format!("{} [{}]", of.name, of.unit) }
    };
    let headings: Vec<_> = std::iter::once("Law".to_owned()).chain(measures.iter().map(heading)).collect();
    let headings: Vec<_> = headings.iter().map(String::as_str).collect();
    let row = |law: &LawRow| {
        let cells = measures.iter().map(|measure| cell((measure.cell)(law))).collect::<Vec<_>>();
        std::iter::once(law.name.render()).chain(cells)
    };
    page::numbers(caption, &headings, laws.iter().map(row))
}

fn cell(Cell { value, interval }: Cell) -> Markup {
    interval.map_or_else(|| value.render(), |interval| noted(&value, &interval))
}
