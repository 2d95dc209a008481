//! Self-contained HTML pages, built from plain parts.
//!
//! A [`Page`] is a verdict and sections of [`Block`]s: sentences, lists, tables, figures, commands, folded text. Every
//! text is escaped. A page refers to nothing outside itself and forbids the browser to load anything; it follows the
//! reader's choice of light or dark and fits a phone. The same parts give the same bytes.

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::figures::Figure;

const STYLE: &str = include_str!("style.css");
/// Nothing may be loaded and nothing may run.
const POLICY: &str =
    "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'";

/// A page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Page {
    /// What the page is about, such as the scenario's name.
    pub title: String,
    /// What kind of page it is, such as `Flight report`.
    pub kind: String,
    /// Good or bad, in a word.
    pub badge: Badge,
    /// The verdict in a sentence.
    pub verdict: String,
    /// Why it is not better, a sentence each.
    pub reasons: Vec<String>,
    /// Warnings with their codes.
    pub warnings: Vec<Warning>,
    /// Everything else.
    pub sections: Vec<Section>,
    /// Who made it, at the foot.
    pub foot: String,
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

/// Something to know before one relies on a result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Stable name, such as `start-on-line`.
    pub code: String,
    /// A sentence or two.
    pub message: String,
}

/// A part of a page under a heading.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Section {
    /// The heading.
    pub heading: String,
    /// What stands under it.
    pub blocks: Vec<Block>,
}

/// A piece of a section.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Block {
    /// A paragraph.
    Text(String),
    /// A list of sentences.
    List(Vec<String>),
    /// A table.
    Table(Table),
    /// Small tables side by side, as many as fit.
    Tables(Vec<Table>),
    /// Figures side by side, as many as fit.
    Figures(Vec<Figure>),
    /// Pictures side by side, as many as fit.
    Pictures(Vec<Picture>),
    /// A command to be typed.
    Command(String),
    /// Preformatted text that is folded away under a summary.
    Folded {
        /// What one sees.
        summary: String,
        /// What one sees after unfolding.
        text: String,
    },
}

/// A picture that is part of the page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Picture {
    /// What it shows, in a sentence.
    pub description: String,
    /// The picture itself as a `data:` address.
    pub data_uri: String,
}

/// A table whose first column names the rows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Table {
    /// What the table holds.
    pub caption: String,
    /// Headings of the columns.
    pub columns: Vec<Column>,
    /// Rows of as many cells as there are columns.
    pub rows: Vec<Vec<Cell>>,
}

/// A column of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// Its heading.
    pub heading: String,
    /// Whether it holds numbers, which are aligned to the right and never broken.
    pub numeric: bool,
}

/// A cell of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Cell {
    /// Words or a number.
    Text(String),
    /// Words or a number, and a remark in small print below.
    Noted(String, String),
    /// A judgement.
    Badge(Badge),
}

impl Badge {
    /// `pass` or `fail`.
    #[must_use]
    pub fn judged(pass: bool) -> Self {
        let (tone, word) = if pass { (Tone::Good, "pass") } else { (Tone::Bad, "fail") };
        Self { tone, word: word.to_owned() }
    }
}

impl Column {
    /// A column of words.
    #[must_use]
    pub fn words(heading: &str) -> Self {
        Self { heading: heading.to_owned(), numeric: false }
    }

    /// A column of numbers.
    #[must_use]
    pub fn numbers(heading: &str) -> Self {
        Self { heading: heading.to_owned(), numeric: true }
    }
}

impl Section {
    /// Blocks under a heading.
    #[must_use]
    pub fn new(heading: &str, blocks: Vec<Block>) -> Self {
        Self { heading: heading.to_owned(), blocks }
    }
}

impl<T: Into<String>> From<T> for Cell {
    fn from(text: T) -> Self {
        Self::Text(text.into())
    }
}

impl Page {
    /// The page as HTML.
    #[must_use]
    pub fn render(&self) -> String {
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    meta name="color-scheme" content="light dark";
                    meta http-equiv="Content-Security-Policy" content=(POLICY);
                    title { (self.title) " - " (self.badge.word) }
                    // An empty icon, or browsers ask for one.
                    link rel="icon" href="data:,";
                    style { (PreEscaped(STYLE)) }
                }
                body {
                    header {
                        p.kind { (self.kind) }
                        h1 { (self.title) }
                        p.verdict { (self.badge.render()) " " (self.verdict) }
                        @if !self.reasons.is_empty() {
                            ul.reasons { @for reason in &self.reasons { li { (reason) } } }
                        }
                    }
                    main {
                        @if !self.warnings.is_empty() {
                            section.warnings aria-label="Warnings" {
                                h2 { "Warnings" }
                                ul { @for warning in &self.warnings { li { code { (warning.code) } " " (warning.message) } } }
                            }
                        }
                        @for section in &self.sections { (section.render()) }
                    }
                    footer { p { (self.foot) } }
                }
            }
        };
        page.into_string()
    }
}

impl Badge {
    fn render(&self) -> Markup {
        let tone = match self.tone {
            Tone::Good => "badge good",
            Tone::Bad => "badge bad",
            Tone::Neutral => "badge",
        };
        html! { strong class=(tone) { (self.word) } }
    }
}

impl Section {
    fn render(&self) -> Markup {
        html! {
            section {
                h2 { (self.heading) }
                @for block in &self.blocks { (block.render()) }
            }
        }
    }
}

impl Block {
    fn render(&self) -> Markup {
        match self {
            Self::Text(text) => html! { p { (text) } },
            Self::List(items) => html! { ul { @for item in items { li { (item) } } } },
            Self::Table(table) => table.render(),
            Self::Tables(tables) => html! { div.tables { @for table in tables { (table.render()) } } },
            Self::Figures(figures) => html! {
                div.figures {
                    @for figure in figures {
                        figure {
                            (PreEscaped(&figure.svg))
                            figcaption { (figure.description) }
                        }
                    }
                }
            },
            Self::Pictures(pictures) => html! {
                div.figures {
                    @for picture in pictures {
                        figure {
                            img src=(picture.data_uri) alt=(picture.description);
                            figcaption { (picture.description) }
                        }
                    }
                }
            },
            Self::Command(command) => html! { pre.command tabindex="0" { code { (command) } } },
            Self::Folded { summary, text } => html! {
                details {
                    summary { (summary) }
                    pre tabindex="0" { code { (text) } }
                }
            },
        }
    }
}

impl Table {
    fn render(&self) -> Markup {
        let prose = self.columns.iter().skip(1).any(|column| !column.numeric);
        let class = |k: usize| self.columns.get(k).is_some_and(|column| column.numeric).then_some("number");
        html! {
            div.scroll role="region" tabindex="0" aria-label=(self.caption) {
                table.prose[prose] {
                    caption { (self.caption) }
                    thead { tr { @for (k, column) in self.columns.iter().enumerate() {
                        th scope="col" class=[class(k)] { (column.heading) }
                    } } }
                    tbody { @for row in &self.rows { tr {
                        @for (k, cell) in row.iter().enumerate() {
                            @if k == 0 { th scope="row" { (cell.render()) } }
                            @else { td class=[class(k)] { (cell.render()) } }
                        }
                    } } }
                }
            }
        }
    }
}

impl Cell {
    fn render(&self) -> Markup {
        match self {
            Self::Text(text) => html! { (text) },
            Self::Noted(text, note) => html! { (text) small { (note) } },
            Self::Badge(badge) => badge.render(),
        }
    }
}
