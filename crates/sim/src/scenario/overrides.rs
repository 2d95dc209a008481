//! `key.path=value`: one key of a scenario set for one run.

use std::borrow::Cow;
use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::{Place, ScenarioError};

/// What the text of an override is called in messages.
const SOURCE: &str = "--set";

/// One key of the scenario set to another value, whatever the file says.
///
/// The path is dotted: `law.delta_m=1.5`. Keys and tables that the file does not have are made:
/// `plant.kind=ideal`. Entries of a list are counted from 1, as vehicles are, and `x`, `y`, `z` are other names
/// for 1, 2, 3: `start.positions_m.4.x=-1` moves vehicle 4. The value is TOML, and a bare word is a string. A whole
/// table is replaced by an inline table: `formation={shape="circle", radius_m=3}`. Another `kind` or `shape` leaves the
/// keys behind that it does not have: `law.kind=laplacian` is enough where the file gives `law.alpha`. The
/// JSON Schema lists the keys of each `kind` and `shape`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Override {
    text: String,
    path: Vec<Range<usize>>,
    value: Range<usize>,
}

/// Most parts of a path: `start.positions_m.2.x` has four.
const MAX_DEPTH: usize = 8;

impl Override {
    /// Reads `key.path=value`.
    ///
    /// # Errors
    /// [`ScenarioError`] when there is no `=`, a part of the path is empty or is no key, or the value is neither TOML
    /// nor a bare word.
    pub fn parse(text: &str) -> Result<Self, ScenarioError> {
        let place = |span: Range<usize>| Place::new(SOURCE, text, span);
        let Some(equals) = text.find('=') else {
            return Err(ScenarioError::new("an override has no `=`")
                .coded("scenario/override")
                .with_help("write it as key.path=value, for example time.dt_s=0.001")
                .with_place(place(0..text.len())));
        };
        let mut path = Vec::new();
        let mut start = 0;
        for part in text[..equals].split('.') {
            let key = trimmed(text, start..start + part.len());
            if key.is_empty() || !text[key.clone()].chars().all(is_word) {
                return Err(ScenarioError::new(format!("`{part}` is not a key of an override"))
                    .coded("scenario/override")
                    .with_help("a path is keys and entry numbers with dots between them, such as start.positions_m.2.x")
                    .with_place(place(start..start + part.len())));
            }
            path.push(key);
            start += part.len() + 1;
        }
        if path.len() > MAX_DEPTH {
            return Err(ScenarioError::new(format!("the path has {} parts", path.len()))
                .coded("scenario/override")
                .with_help(format!("no key of a scenario has more than {MAX_DEPTH}"))
                .with_place(place(0..equals)));
        }
        let value = trimmed(text, equals + 1..text.len());
        let parsed = Self { text: text.to_owned(), path, value };
        match parsed.value() {
            Ok(_) => Ok(parsed),
            Err(error) => {
                let base = parsed.value.start;
                let span = error.span().map_or(parsed.value.clone(), |span| base + span.start..base + span.end);
                Err(ScenarioError::new(format!("the value is not TOML: {}", error.message()))
                    .coded("scenario/override")
                    .with_help("numbers, true, false, [lists], {tables} and \"strings\" are; a bare word is a string")
                    .with_place(place(span)))
            }
        }
    }

    /// The override as it was written.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The place of a span of bytes of the override.
    pub(super) fn place(&self, span: Range<usize>) -> Place {
        Place::new(SOURCE, &self.text, span)
    }

    /// Sets the key in a document, and makes it and its tables where they are not there. Spans of what is set count from
    /// `base`.
    pub(super) fn apply<'a>(&'a self, root: &mut Spanned<DeValue<'a>>, base: usize) -> Result<(), ScenarioError> {
        let value = self.value().map_err(|error| self.refuse(&self.value, error.message()))?;
        let mut target = root;
        for part in &self.path {
            let name = &self.text[part.clone()];
            target = match target.get_mut() {
                DeValue::Table(table) => {
                    let span = base + part.start..base + part.end;
                    let below = Spanned::new(span.clone(), DeValue::Table(DeTable::new()));
                    table.entry(Spanned::new(span, Cow::Borrowed(name))).or_insert(below)
                }
                DeValue::Array(list) => {
                    let what = format!("the list has entries 1 to {}, not {name}", list.len());
                    let entry = self.entry(part)?.checked_sub(1).and_then(|entry| list.get_mut(entry));
                    entry.ok_or_else(|| self.refuse(part, &what))?
                }
                other => {
                    let what = format!("there is nothing below a {}", other.type_str());
                    return Err(self.refuse(part, &what));
                }
            };
        }
        *target = shifted(value, base + self.value.start);
        Ok(())
    }

    /// The value, with spans from its own first byte.
    fn value(&self) -> Result<Spanned<DeValue<'_>>, toml::de::Error> {
        let text = &self.text[self.value.clone()];
        DeValue::parse(text).or_else(|error| {
            if text.starts_with(|c: char| c.is_ascii_alphabetic()) && text.chars().all(is_word) {
                Ok(Spanned::new(0..text.len(), DeValue::String(Cow::Borrowed(text))))
            } else {
                Err(error)
            }
        })
    }

    /// The number of a list's entry, from 1.
    fn entry(&self, segment: &Range<usize>) -> Result<usize, ScenarioError> {
        match &self.text[segment.clone()] {
            "x" => Ok(1),
            "y" => Ok(2),
            "z" => Ok(3),
            number => number
                .parse()
                .map_err(|_| self.refuse(segment, &format!("`{number}` is not the number of an entry of a list"))),
        }
    }

    fn refuse(&self, span: &Range<usize>, message: &str) -> ScenarioError {
        ScenarioError::new(message)
            .coded("scenario/override")
            .with_help("entries of lists are counted from 1, as vehicles are; x, y, z name the axes of a point")
            .with_place(self.place(span.clone()))
    }
}

/// The span without white space at its ends.
fn trimmed(text: &str, span: Range<usize>) -> Range<usize> {
    let part = &text[span.clone()];
    let start = span.start + (part.len() - part.trim_start().len());
    start..start + part.trim().len()
}

fn is_word(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_' || c == '-'
}

/// A value with all its spans moved.
fn shifted(value: Spanned<DeValue<'_>>, by: usize) -> Spanned<DeValue<'_>> {
    let moved = |span: Range<usize>| span.start + by..span.end + by;
    let span = moved(value.span());
    let inner = match value.into_inner() {
        DeValue::Array(list) => DeValue::Array(list.into_iter().map(|entry| shifted(entry, by)).collect()),
        DeValue::Table(table) => {
            let key = |key: Spanned<_>| Spanned::new(moved(key.span()), key.into_inner());
            DeValue::Table(table.into_iter().map(|(name, entry)| (key(name), shifted(entry, by))).collect())
        }
        plain => plain,
    };
    Spanned::new(span, inner)
}
