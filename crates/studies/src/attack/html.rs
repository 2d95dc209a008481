//! The worst that was found as a page.

use super::result::Attack;
use super::words::CAVEAT;
use tautline_report::figures::attack as figure;
use tautline_report::report::page::{self, Badge, Page, Tone, section};

/// What a page shows beside what was found.
#[derive(Clone, Copy, Debug)]
pub struct AttackPage<'a> {
    /// The command that makes the search again.
    pub command: &'a str,
    /// The command that flies the worst again; none where nothing could be flown.
    pub worst: Option<&'a str>,
}

/// What the numbers rest on.
const ASSUMED: [&str; 4] = [
    CAVEAT,
    "A candidate is as bad as its flight brings two vehicles close, as the judge saw it between the samples too; clearances of \
     obstacles are judged, and not searched for.",
    "Bounds are a box: every number is free between its own two, whatever the others are. What cannot be flown, such as a start of \
     two vehicles within delta, is no attack and costs no flight.",
    "Noise has the seed of the scenario, and those that follow it where several are asked for: other luck is no attack.",
];

impl Attack {
    /// What was found as a self-contained page. Two searches for the same give the same bytes.
    #[must_use]
    pub fn to_html(&self, page: &AttackPage<'_>) -> String {
        let found = self.progress.iter().filter_map(|worst| Some((worst.flight, worst.flown.min_m?)));
        let chart = figure(&found.collect::<Vec<_>>(), self.flights, self.delta_m, self.own.min_m);
        let columns = ["", "Separation [m]", "Certified [m]", "Verdict"];
        let mut sections = vec![section(
            "How the search went",
            &[
                page::figures(&[chart]),
                page::numbers("The scenario as it is, and the worst found", &columns, self.beside()),
            ],
        )];
        let columns = ["Key", "Smallest", "Largest", "Worst"];
        sections.push(section(
            "Bounds and the worst within them",
            &[page::numbers("All else is as the scenario says", &columns, self.rows())],
        ));
        let notes = self.notes();
        if !notes.is_empty() {
            sections.push(section("What to know", &[page::list(&notes)]));
        }
        sections.push(section("What was assumed", &[page::list(&ASSUMED)]));
        sections.push(section("Repeat it", &[page::command(page.command)]));
        if let Some(worst) = page.worst {
            sections.push(section("Fly the worst again", &[page::command(worst)]));
        }
        let tone = if self.is_bad() { Tone::Bad } else { Tone::Neutral };
        Page {
            title: self.scenario.name.clone(),
            kind: "Attack",
            badge: Badge { tone, word: self.effort() },
            verdict: self.headline(),
            reasons: Vec::new(),
            warnings: Vec::new(),
            sections,
        }
        .render()
    }
}
