//! Self-contained HTML pages.
//!
//! A [`Page`] is a verdict and sections. Every text is escaped. A page refers to nothing outside itself and forbids the
//! browser to load anything; where flights are replayed, one script of ours may run, and no other. It follows the reader's choice of light or dark and fits a phone. The same parts give the
//! same bytes.

mod replay;

use maud::{DOCTYPE, PreEscaped, html};
pub use maud::{Markup, Render};
pub use replay::{Start, replay};

use crate::figures::Figure;
use tautline_core::text::in_order;

const STYLE: &str = include_str!("style.css");
/// Nothing may be loaded; what may run is named by its hash, where anything may.
const POLICY: &str =
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'";

/// A page.
#[derive(Clone, Debug)]
pub struct Page {
    /// What the page is about, such as the scenario's name.
    pub title: String,
    /// What kind of page it is, such as `Flight report`.
    pub kind: &'static str,
    /// Good or bad, in a word.
    pub badge: Badge,
    /// The verdict in a sentence.
    pub verdict: String,
    /// Why it is not better, a sentence each.
    pub reasons: Vec<String>,
    /// What to know before one relies on the result: a stable name, such as `start-on-line`, and a sentence or two.
    pub warnings: Vec<(String, String)>,
    /// Everything else, see [`section`].
    pub sections: Vec<Markup>,
}

/// A word that is good, bad or neither.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Badge {
    /// Its colour.
    pub tone: Tone,
    /// The word; it says what the colour says.
    pub word: String,
}

/// How a word is meant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// As it should be.
    Good,
    /// Not as it should be.
    Bad,
    /// Neither.
    Neutral,
}

/// A picture that is part of the page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// What it shows, in a sentence.
    pub description: String,
    /// The picture itself as a `data:` address.
    pub data_uri: String,
}

impl Badge {
    /// `pass` or `fail`.
    #[must_use]
    pub fn judged(pass: bool) -> Self {
        let (tone, word) = if pass { (Tone::Good, "pass") } else { (Tone::Bad, "fail") };
        Self { tone, word: word.to_owned() }
    }
}

impl Render for Badge {
    fn render(&self) -> Markup {
        let tone = match self.tone {
            Tone::Good => "badge good",
            Tone::Bad => "badge bad",
            Tone::Neutral => "badge",
        };
        html! { strong class=(tone) { (self.word) } }
    }
}

impl Page {
    /// Returns a page without reasons, warnings and sections.
    #[must_use]
    pub fn new(kind: &'static str, title: String, badge: Badge, verdict: String) -> Self {
        Self { title, kind, badge, verdict, reasons: Vec::new(), warnings: Vec::new(), sections: Vec::new() }
    }

    /// Adds a [`section`], unless its content is empty.
    pub fn add(&mut self, heading: &str, content: impl IntoIterator<Item = Markup>) {
        let content: Vec<_> = content.into_iter().filter(|block| !block.0.is_empty()).collect();
        if !content.is_empty() {
            self.sections.push(section(heading, &content));
        }
    }

    /// Returns the page as HTML. Only if a section holds a [`replay`], the page has a script, which draws it.
    #[must_use]
    pub fn render(&self) -> String {
        let replays = self.sections.iter().any(|section| section.0.contains(replay::ELEMENT));
        let policy = if replays { format!("{POLICY}; {}", replay::script_source()) } else { POLICY.to_owned() };
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    meta name="color-scheme" content="light dark";
                    meta http-equiv="Content-Security-Policy" content=(policy);
                    title { (self.title) " - " (self.badge.word) }
                    // An empty icon, or browsers ask for one.
                    link rel="icon" href="data:,";
                    style { (PreEscaped(STYLE)) @if replays { (PreEscaped(replay::STYLE)) } }
                }
                body {
                    header {
                        p.kind { (self.kind) }
                        h1 { (self.title) }
                        p.verdict { (self.badge) " " (self.verdict) }
                        @if !self.reasons.is_empty() {
                            ul.reasons { @for reason in &self.reasons { li { (reason) } } }
                        }
                    }
                    main {
                        @if !self.warnings.is_empty() {
                            section.warnings aria-label="Warnings" {
                                h2 { "Warnings" }
                                ul { @for (code, message) in &self.warnings { li { code { (code) } " " (message) } } }
                            }
                        }
                        @for section in &self.sections { (section) }
                    }
                    footer { p { "Made by " (tautline_core::PROGRAM) " " (tautline_core::VERSION) "." } }
                    @if replays { (replay::script()) }
                }
            }
        };
        in_order(&page.into_string())
    }
}

/// A part of a page under a heading.
#[must_use]
pub fn section(heading: &str, content: &[Markup]) -> Markup {
    html! {
        section {
            h2 { (heading) }
            @for block in content { (block) }
        }
    }
}

/// A list of sentences; nothing if there are none.
#[must_use]
pub fn list(items: &[impl Render]) -> Markup {
    html! { @if !items.is_empty() { ul { @for item in items { li { (item) } } } } }
}

/// Figures side by side, as many as fit; nothing if there are none.
#[must_use]
pub fn figures(figures: &[Figure]) -> Markup {
    let figure = |figure: &Figure| (PreEscaped(&figure.svg).render(), figure.description.clone());
    side_by_side(figures.iter().map(figure))
}

/// Pictures side by side, as many as fit; nothing if there are none.
#[must_use]
pub fn pictures(pictures: &[Picture]) -> Markup {
    side_by_side(pictures.iter().map(|Picture { description, data_uri }| {
        (html! { img src=(data_uri) alt=(description); }, description.clone())
    }))
}

fn side_by_side(drawn: impl Iterator<Item = (Markup, String)>) -> Markup {
    let mut drawn = drawn.peekable();
    html! {
        @if drawn.peek().is_some() {
            div.figures { @for (drawn, description) in drawn { figure { (drawn) figcaption { (description) } } } }
        }
    }
}

/// A command to be typed.
#[must_use]
pub fn command(command: &str) -> Markup {
    html! { pre.command tabindex="0" { code { (command) } } }
}

/// A table whose first column names the rows and whose other columns hold numbers, which are aligned to the right and
/// never broken. Rows have as many cells as there are columns.
pub fn numbers<R: IntoIterator<Item: Render>>(
    caption: &str,
    columns: &[&str],
    rows: impl IntoIterator<Item = R>,
) -> Markup {
    table(caption, columns, false, rows)
}

/// A table of words, whose first column names the rows.
pub fn words<R: IntoIterator<Item: Render>>(
    caption: &str,
    columns: &[&str],
    rows: impl IntoIterator<Item = R>,
) -> Markup {
    table(caption, columns, true, rows)
}

fn table<R: IntoIterator<Item: Render>>(
    caption: &str,
    columns: &[&str],
    prose: bool,
    rows: impl IntoIterator<Item = R>,
) -> Markup {
    let class = |k: usize| (k > 0 && !prose).then_some("number");
    html! {
        div.scroll role="region" tabindex="0" aria-label=(caption) {
            table.prose[prose] {
                caption { (caption) }
                thead { tr { @for (k, heading) in columns.iter().enumerate() {
                    th scope="col" class=[class(k)] { (heading) }
                } } }
                tbody { @for row in rows { tr {
                    @for (k, cell) in row.into_iter().enumerate() {
                        @if k == 0 { th scope="row" { (cell) } } @else { td class=[class(k)] { (cell) } }
                    }
                } } }
            }
        }
    }
}

/// A cell with a remark in small print below.
#[must_use]
pub fn noted(text: &str, note: &str) -> Markup {
    html! { (text) small { (note) } }
}
