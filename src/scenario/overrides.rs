//! `key.path=value`: one key of a scenario set for one run.

use std::borrow::Cow;
use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::{Place, ScenarioError};

/// What the text of an override is called in messages.
const SOURCE: &str = "--set";

/// The table of what counts as a reached formation, and the name that it had.
pub(super) const ARRIVAL: &str = "arrival";
pub(super) const OLD_ARRIVAL: &str = "judge";

/// One key of the scenario set to another value, whatever the file says.
///
/// The path is dotted: `law.delta_m=1.5`. Keys and tables that the file does not have are made:
/// `plant.precision=double`. Entries of a list are counted from 1, as vehicles are, and `x`, `y`, `z` are other names
/// for 1, 2, 3: `start.positions_m.4.x=-1` moves vehicle 4. The value is TOML, and a bare word is a string. A whole
/// table is replaced by an inline table: `formation={shape="circle", radius_m=3}`.
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
                .with_help("write it as key.path=value, for example time.dt_s=0.001")
                .with_place(place(0..text.len())));
        };
        let mut path = Vec::new();
        let mut start = 0;
        for part in text[..equals].split('.') {
            let key = trimmed(text, start..start + part.len());
            if key.is_empty() || !text[key.clone()].chars().all(is_word) {
                return Err(ScenarioError::new(format!("`{part}` is not a key of an override"))
                    .with_help("a path is keys and entry numbers with dots between them, such as start.positions_m.2.x")
                    .with_place(place(start..start + part.len())));
            }
            path.push(key);
            start += part.len() + 1;
        }
        if path.len() > MAX_DEPTH {
            return Err(ScenarioError::new(format!("the path has {} parts", path.len()))
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

    /// Sets the key in a document. Spans of what is set count from `base`.
    pub(super) fn apply<'a>(&'a self, root: &mut DeTable<'a>, base: usize) -> Result<(), ScenarioError> {
        let mut value = self.value().map_err(|error| self.refuse(&self.value, error.message()))?;
        shift(&mut value, base + self.value.start);
        let Some((first, rest)) = self.path.split_first() else { return Ok(()) };
        let table = match &self.text[first.clone()] {
            OLD_ARRIVAL => ARRIVAL,
            table => table,
        };
        self.set_key(root, (table, first), rest, value, base)
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

    fn set<'a>(
        &'a self,
        target: &mut DeValue<'a>,
        path: &'a [Range<usize>],
        value: Spanned<DeValue<'a>>,
        base: usize,
    ) -> Result<(), ScenarioError> {
        let Some((first, rest)) = path.split_first() else {
            *target = value.into_inner();
            return Ok(());
        };
        match target {
            DeValue::Table(table) => self.set_key(table, (&self.text[first.clone()], first), rest, value, base),
            DeValue::Array(list) => {
                let count = list.len();
                let entry = self.entry(first)?.checked_sub(1).and_then(|entry| list.get_mut(entry));
                let Some(entry) = entry else {
                    let what = format!("the list has entries 1 to {count}, not {}", &self.text[first.clone()]);
                    return Err(self.refuse(first, &what));
                };
                if rest.is_empty() {
                    *entry = value;
                    Ok(())
                } else {
                    self.set(entry.get_mut(), rest, value, base)
                }
            }
            other => {
                let what = format!("there is nothing below a {}", other.type_str());
                Err(self.refuse(first, &what))
            }
        }
    }

    fn set_key<'a>(
        &'a self,
        table: &mut DeTable<'a>,
        (name, key): (&'a str, &Range<usize>),
        rest: &'a [Range<usize>],
        value: Spanned<DeValue<'a>>,
        base: usize,
    ) -> Result<(), ScenarioError> {
        let span = base + key.start..base + key.end;
        if rest.is_empty() {
            // Removed first: a map keeps the key that it has, and this key's place is here now.
            table.remove(name);
            table.insert(Spanned::new(span, Cow::Borrowed(name)), value);
            return Ok(());
        }
        if !table.contains_key(name) {
            let below = Spanned::new(span.clone(), DeValue::Table(DeTable::new()));
            table.insert(Spanned::new(span, Cow::Borrowed(name)), below);
        }
        match table.get_mut(name) {
            Some(below) => self.set(below.get_mut(), rest, value, base),
            None => Ok(()),
        }
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

/// Moves all spans within a value.
fn shift(value: &mut Spanned<DeValue<'_>>, by: usize) {
    let moved = |span: Range<usize>| span.start + by..span.end + by;
    let inner = std::mem::replace(value.get_mut(), DeValue::Boolean(false));
    let inner = match inner {
        DeValue::Array(mut list) => {
            list.iter_mut().for_each(|entry| shift(entry, by));
            DeValue::Array(list)
        }
        DeValue::Table(table) => DeValue::Table(
            table
                .into_iter()
                .map(|(key, mut entry)| {
                    shift(&mut entry, by);
                    (Spanned::new(moved(key.span()), key.into_inner()), entry)
                })
                .collect(),
        ),
        plain => plain,
    };
    *value = Spanned::new(moved(value.span()), inner);
}
