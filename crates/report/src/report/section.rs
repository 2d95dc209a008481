//! Sections of a report, each written as text and as a part of a page.

use super::page::{self, Markup};
use tautline_core::text::aligned;

/// A section of a report: a table, or lines if it has no columns.
#[derive(Clone, Debug)]
pub(super) struct Section {
    pub(super) heading: &'static str,
    /// Caption of the table, or a short description of the lines.
    pub(super) caption: String,
    pub(super) columns: &'static [&'static str],
    pub(super) rows: Vec<Vec<String>>,
    /// Number of all rows, listed or not.
    pub(super) all: usize,
}

/// Returns a sentence on the content of a section for the first reader of a page.
fn about(heading: &str) -> &'static str {
    match heading {
        "Violations" => "A distance or the value of a vehicle was beyond its limit in each of these times.",
        "Hulls that hit" => "Two vehicles touched; the law does not govern the motion after the first collision.",
        "Closest pairs" => "The pairs of vehicles that came closest, the closest first.",
        "Closest to obstacles" => "The vehicles that came closest to an obstacle; a distance below zero is inside.",
        "Each vehicle by itself" => "Limits of single vehicles, such as speed, with the vehicle nearest to each.",
        "Presence" => "Vehicles that the recording does not contain from its start to its end.",
        "Undecided" => "Times in which the recording is too coarse to prove or refute a violation.",
        "Against the plan" => "Largest distance of each vehicle from its planned curve, between the samples too.",
        "Distance from the plan not known" => "Times in which only one of flight and plan has the vehicle.",
        "Gaps" => "Times in which a vehicle was not recorded.",
        _ => "",
    }
}

impl Section {
    /// Returns a table whose first column names the rows.
    pub(super) fn table<const N: usize>(
        heading: &'static str,
        caption: impl Into<String>,
        columns: &'static [&'static str; N],
        rows: impl IntoIterator<Item = [String; N]>,
    ) -> Self {
        let rows: Vec<_> = rows.into_iter().map(Vec::from).collect();
        Self { heading, caption: caption.into(), columns, all: rows.len(), rows }
    }

    /// Returns lines of text.
    pub(super) fn list(heading: &'static str, caption: impl Into<String>, lines: Vec<String>) -> Self {
        let rows: Vec<_> = lines.into_iter().map(|line| vec![line]).collect();
        Self { heading, caption: caption.into(), columns: &[], all: rows.len(), rows }
    }

    /// Returns the same section with `all` rows in total; only the first are listed.
    pub(super) fn of_all(self, all: usize) -> Self {
        Self { all, ..self }
    }

    /// Returns the number of rows beyond the first `most` in words.
    fn more(&self, most: usize) -> Option<String> {
        let rest = self.all.saturating_sub(self.rows.len().min(most));
        (rest > 0).then(|| format!("and {rest} more"))
    }

    /// Returns the heading and the first `most` rows for a terminal, a line each.
    pub(super) fn text(&self, most: usize) -> Vec<String> {
        let rows = self.rows.iter().take(most);
        let table = if self.columns.is_empty() {
            rows.flatten().cloned().collect()
        } else {
            let head = self.columns.iter().map(ToString::to_string).collect();
            let table = aligned(&std::iter::once(head).chain(rows.cloned()).collect::<Vec<_>>());
            table.lines().map(str::to_owned).collect::<Vec<_>>()
        };
        let heading = format!("{}: {}", self.heading.to_lowercase(), self.caption);
        let lines = table.into_iter().chain(self.more(most)).map(|line| format!("  {line}"));
        std::iter::once(heading).chain(lines).collect()
    }

    /// Returns the first `most` rows under the heading for a page.
    pub(super) fn html(&self, most: usize) -> Markup {
        let rows = self.rows.iter().take(most);
        let content = if self.columns.is_empty() {
            page::list(&rows.flatten().chain(&self.more(most)).collect::<Vec<_>>())
        } else {
            let (caption, more) = (format!("{}: {}", self.heading, self.caption), self.more(most));
            maud::html! { (page::numbers(&caption, self.columns, rows)) @if let Some(more) = more { p { (more) } } }
        };
        page::section(self.heading, about(self.heading), &[content])
    }
}
