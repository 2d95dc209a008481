//! Self-contained HTML pages.
//!
//! A [`Page`] has a verdict and sections. Every text is escaped. A page needs no other file, and its policy forbids the
//! browser to load anything. Pictures link to their files in full size. If it holds replays, a single script of this
//! crate may run. The page follows the browser's light or dark theme and fits a phone. Equal parts give equal bytes.

/// Embeds a file of the folder whose path a variable of the build holds.
macro_rules! embedded {
    ($folder:literal, $name:literal) => {
        include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/", env!($folder), "/", $name))
    };
}

mod live;
mod replay;

pub use live::live_page;
use maud::{DOCTYPE, PreEscaped, html};
pub use maud::{Markup, Render};
pub use replay::{Start, replay};

use crate::drawing::colours;
use crate::figures::Figure;
use tautline_core::text::in_order;

/// Style sheet of pages.
const STYLE: &str = include_str!("style.css");
/// Content security policy: no loading. A script is admitted by its hash, on pages with a replay only.
const POLICY: &str =
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'";

/// Sentence below the heading of a replay.
const ABOUT_REPLAY: &str =
    "Replay of the flight. Play starts the replay, dragging turns the view, and the button ? lists all keys.";

/// Returns the style sheet of pages, with the colours of drawings on light and dark pages.
fn style() -> String {
    colours::variables() + STYLE
}

/// A page.
#[derive(Clone, Debug)]
pub struct Page {
    /// Subject of the page, such as the name of the scenario.
    pub title: String,
    /// Kind of the page, such as `Flight report`.
    pub kind: &'static str,
    /// Badge beside the verdict.
    pub badge: Badge,
    /// What was done, below the title; may be empty.
    pub setup: String,
    /// Verdict in a sentence.
    pub verdict: String,
    /// Reasons against a better verdict, a sentence each.
    pub reasons: Vec<String>,
    /// Replay before warnings and sections, see [`replay`].
    pub replay: Option<Markup>,
    /// Warnings, each with its stable name, such as `start-on-line`, and a sentence or two.
    pub warnings: Vec<(String, String)>,
    /// Sections, see [`section`].
    pub sections: Vec<Markup>,
}

/// A word with the colour of its meaning.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Badge {
    /// Colour.
    pub tone: Tone,
    /// Word, with the same meaning as the colour.
    pub word: String,
}

/// Meaning of a badge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// Good result.
    Good,
    /// Bad result.
    Bad,
    /// Neither good nor bad.
    Neutral,
}

/// A picture embedded in the page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// Description of the picture in a sentence.
    pub description: String,
    /// Picture as a `data:` address.
    pub data_uri: String,
    /// Path of the picture in full size, relative to the page.
    pub file: String,
    /// Whether the picture is on white paper; a dark page inverts its lightness.
    pub is_light: bool,
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
        let (reasons, warnings, sections) = (Vec::new(), Vec::new(), Vec::new());
        Self { title, kind, badge, setup: String::new(), verdict, reasons, replay: None, warnings, sections }
    }

    /// Adds a [`section`], unless its content is empty.
    pub fn add(&mut self, heading: &str, about: &str, content: impl IntoIterator<Item = Markup>) {
        let content: Vec<_> = content.into_iter().filter(|block| !block.0.is_empty()).collect();
        if !content.is_empty() {
            self.sections.push(section(heading, about, &content));
        }
    }

    /// Returns the page as HTML. It has a script only if a section holds a [`replay`].
    #[must_use]
    pub fn render(&self) -> String {
        let replays = self.replay.iter().chain(&self.sections).any(|section| section.0.contains(replay::ELEMENT));
        let policy = if replays { format!("{POLICY}; {}", replay::script_source()) } else { POLICY.to_owned() };
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    (metadata(&policy))
                    title { (self.title) " - " (self.badge.word) }
                    style {
                        (PreEscaped(style())) (PreEscaped(colours::figure_rules()))
                        @if replays { (PreEscaped(replay::STYLE)) }
                    }
                }
                body {
                    header {
                        (theme_choice())
                        p.kind { (self.kind) }
                        h1 { (self.title) }
                        @if !self.setup.is_empty() { p.setup { (self.setup) } }
                        p.verdict { (self.badge) " " (with_code(&self.verdict)) }
                        @if !self.reasons.is_empty() {
                            ul.reasons { @for reason in &self.reasons { li { (with_code(reason)) } } }
                        }
                    }
                    main {
                        @if let Some(replay) = &self.replay {
                            section.replays { h2 { "Replay" } p.about { (ABOUT_REPLAY) } (replay) }
                        }
                        @if !self.warnings.is_empty() {
                            section.warnings aria-label="Warnings" {
                                h2 { "Warnings" }
                                p { "The check before the first step found these limits of the result." }
                                ul {
                                    @for (code, message) in &self.warnings {
                                        li { code { (code) } " " (with_code(message)) }
                                    }
                                }
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

/// Returns the elements of the head that all pages share, with a policy of content.
fn metadata(policy: &str) -> Markup {
    html! {
        meta charset="utf-8";
        meta name="viewport" content="width=device-width, initial-scale=1";
        meta name="color-scheme" content="light dark";
        meta http-equiv="Content-Security-Policy" content=(policy);
        // An empty icon, because browsers request one otherwise.
        link rel="icon" href="data:,";
    }
}

/// Returns the selection of the theme.
fn theme_choice() -> Markup {
    html! {
        label.theme {
            "Theme "
            select autocomplete="off" {
                option value="auto" { "automatic" }
                option value="light" { "light" }
                option value="dark" { "dark" }
            }
        }
    }
}

/// Returns a part of a page under a heading and a sentence on its content for a first reader.
#[must_use]
pub fn section(heading: &str, about: &str, content: &[Markup]) -> Markup {
    html! {
        section {
            h2 { (heading) }
            @if !about.is_empty() { p.about { (about) } }
            @for block in content { (block) }
        }
    }
}

/// Returns a list of sentences; empty without items.
#[must_use]
pub fn list(items: &[impl Render]) -> Markup {
    html! { @if !items.is_empty() { ul { @for item in items { li { (with_code(item)) } } } } }
}

/// Returns figures side by side in rows; empty without figures.
#[must_use]
pub fn figures(figures: &[Figure]) -> Markup {
    let figure = |figure: &Figure| (PreEscaped(&figure.svg).render(), figure.description.clone());
    side_by_side(figures.iter().map(figure))
}

/// Returns pictures side by side in rows, each a link to its file in full size; empty without pictures.
#[must_use]
pub fn pictures(pictures: &[Picture]) -> Markup {
    side_by_side(pictures.iter().map(|Picture { description, data_uri, file, is_light }| {
        (html! { a href=(file) { img.day[*is_light] src=(data_uri) alt=(description); } }, description.clone())
    }))
}

/// Returns text with a `code` element in the place of each word in backticks. Elements stay unchanged.
fn with_code(text: &impl Render) -> Markup {
    let html = text.render().into_string();
    let parts: Vec<_> = html.split('`').collect();
    if html.contains('<') || parts.len().is_multiple_of(2) {
        return PreEscaped(html);
    }
    let part = |(k, part): (usize, &&str)| match k % 2 {
        0 => (*part).to_owned(),
        _ => format!("<code>{part}</code>"),
    };
    PreEscaped(parts.iter().enumerate().map(part).collect())
}

fn side_by_side(drawn: impl Iterator<Item = (Markup, String)>) -> Markup {
    let mut drawn = drawn.peekable();
    html! {
        @if drawn.peek().is_some() {
            div.figures { @for (drawn, description) in drawn { figure { (drawn) figcaption { (description) } } } }
        }
    }
}

/// Returns blocks below a line that unfolds them.
#[must_use]
pub fn folded(summary: &str, blocks: &[Markup]) -> Markup {
    html! { details { summary { (summary) } @for block in blocks { (block) } } }
}

/// Returns a command line to copy.
#[must_use]
pub fn command(command: &str) -> Markup {
    html! { pre.command tabindex="0" { code { (command) } } }
}

/// Returns a table whose first column names the rows. The other columns hold numbers, aligned to the right and never
/// broken. Rows have as many cells as there are columns.
pub fn numbers<R: IntoIterator<Item: Render>>(
    caption: &str,
    columns: &[&str],
    rows: impl IntoIterator<Item = R>,
) -> Markup {
    table(caption, columns, false, rows)
}

/// Returns a table of words whose first column names the rows.
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
                        @if k == 0 {
                            th scope="row" data-label=[columns.first()] { (with_code(&cell)) }
                        } @else {
                            td class=[class(k)] data-label=[columns.get(k)] { (with_code(&cell)) }
                        }
                    }
                } } }
            }
        }
    }
}

/// Returns a cell with a background of a tone, the stronger the larger its share from 0 to 1.
#[must_use]
pub fn tinted(content: &Markup, tone: Tone, share: f64) -> Markup {
    let class = if tone == Tone::Bad { "tint bad" } else { "tint" };
    html! { span class=(class) style=(format!("--share:{:.0}%", 100.0 * share)) { (content) } }
}

/// Returns a cell with a remark in small print below.
#[must_use]
pub fn noted(text: &str, note: &str) -> Markup {
    html! { (text) small { (note) } }
}

#[cfg(test)]
mod tests {
    use super::{list, numbers, words};

    #[test]
    fn words_in_backticks_are_code_and_other_backticks_stay() {
        let shown = |text: &str| list(&[text]).into_string();
        assert_eq!(shown("column `i<d`, `x`"), "<ul><li>column <code>i&lt;d</code>, <code>x</code></li></ul>");
        assert_eq!(shown("a`b"), "<ul><li>a`b</li></ul>");
    }

    #[test]
    fn every_cell_has_the_heading_of_its_column() {
        for table in [words("t", &["Fact", "Value"], [["a", "b"]]), numbers("t", &["Fact", "Value"], [["a", "1"]])] {
            let html = table.into_string();
            assert!(html.contains("<th scope=\"row\" data-label=\"Fact\">"), "{html}");
            assert!(html.contains("data-label=\"Value\">"), "{html}");
        }
    }
}
