//! Text of a scenario with its overrides, and the mapping from values to places in the text.
//!
//! Spans share one address space: the bytes of the file, then those of each override. A span therefore identifies the
//! text that holds a value.

use std::borrow::Cow;
use std::ops::Range;

use serde::Deserialize as _;
use toml::de::{DeTable, DeValue, ValueDeserializer};
use toml::{Spanned, map::Map};

use super::check::Check;
use super::document::{Document, TimeKeys};
use super::error::{ErrorKind, ScenarioError};
use super::schema::Node;
use tautline_core::failure::Place;
use tautline_core::option::SET;

/// Keys from which a missing key takes its value, in order. An error about the missing key is placed at one of these.
const ORIGINS: [(&str, &[&str]); 7] = [
    (
        "start.positions_m",
        &["start.spacing_m", "start.radius_m", "start.min_separation_m", "start.half_extent_m", "start.shape"],
    ),
    (
        "formation.points_m",
        &[
            "formation.file",
            "formation.height_m",
            "formation.width_m",
            "formation.side_m",
            "formation.radius_m",
            "formation.spacing_m",
            "formation.scale",
            "formation.shape",
        ],
    ),
    ("graph.edges", &["graph.kind"]),
    ("reference.points_m", &["reference.file"]),
    ("reference.times_s", &["reference.file", "reference.speed_m_s"]),
    ("swarm.hull_radius_m", &["law.delta_m"]),
    ("swarm.count", &["start.positions_m", "formation.points_m", "formation.shape"]),
];

/// Named text with overrides.
#[derive(Clone, Copy)]
pub(super) struct Text<'a> {
    pub(super) name: &'a str,
    pub(super) toml: &'a str,
    pub(super) overrides: &'a [Override],
}

impl<'a> Text<'a> {
    /// Makes something of the text. An error in the text is placed in an override if the text can be read with
    /// the overrides before it, and not with the override.
    pub(super) fn read<T>(self, make: impl Fn(&Self) -> Result<T, ScenarioError>) -> Result<T, ScenarioError> {
        make(&self).map_err(|error| {
            if error.place.as_ref().is_some_and(|place| place.source != self.name) {
                return error;
            }
            // Without a text that can be read, an error need not come from the override with which it first appears.
            let fault = |count: usize| make(&Self { overrides: &self.overrides[..count], ..self }).err();
            let Some(readable) = (0..self.overrides.len()).rev().find(|&count| fault(count).is_none()) else {
                return error;
            };
            let is_same = |other: ScenarioError| other.kind == error.kind && other.message == error.message;
            if !fault(readable + 1).is_some_and(is_same) {
                return error;
            }
            let set = &self.overrides[readable];
            error.with_place(set.place(set.value.clone()))
        })
    }

    /// Reads the keys of the scenario. Drops keys of a choice that an override has replaced.
    pub(super) fn decode(&self) -> Result<Document, ScenarioError> {
        let mut root = self.tree()?;
        if root.get_ref().as_table().is_some_and(Map::is_empty) {
            let problem = "the scenario is empty";
            let help = "start from a built-in scenario, such as `pentagon`";
            return Err(ErrorKind::Empty.at(&[], problem, help).with_place(self.locate(0..0)));
        }
        let time = root.get_ref().get("time");
        let gives = |key: &str| time.is_some_and(|time| time.get_ref().get(key).is_some());
        let given =
            TimeKeys { dt_s: gives("dt_s"), record_hz: gives("record_hz"), max_halvings: gives("max_halvings") };
        let locate = |span| Some(self.locate(span));
        let check = Check { file: Node::root(), overridden_from: self.toml.len() + 1, locate: &locate };
        check.nest(&mut root)?;
        // The check accepts only what serde reads. An error of serde is a defect of the schema.
        let document = Document::deserialize(ValueDeserializer::from(root)).map_err(|error| {
            let problem = error.message();
            let help = "`tautline schema` describes every key";
            ErrorKind::WrongType.at(&[], problem, help).with_place(self.locate(error.span().unwrap_or(0..0)))
        })?;
        Ok(Document { given, ..document })
    }

    /// Adds the place in the text to an error about keys: the first key that an override sets, or else the first key.
    pub(super) fn place(&self, error: ScenarioError) -> ScenarioError {
        let (None, Ok(root)) = (&error.place, self.tree()) else { return error };
        let spans = error.keys.iter().map(|key| find(&root, key, self.toml.len() + 1));
        let overridden = spans.clone().find(|span| span.start > self.toml.len());
        // A key that is not in the text has no span.
        let written = || spans.clone().find(|span| !span.is_empty());
        match overridden.or_else(written).or_else(|| spans.clone().next()) {
            Some(span) => {
                let place = self.locate(span);
                error.with_place(place)
            }
            None => error,
        }
    }

    /// Returns the text as a tree with its overrides applied.
    pub(super) fn tree(&self) -> Result<Spanned<DeValue<'a>>, ScenarioError> {
        let parsed = DeTable::parse(self.toml).map_err(|error| {
            let problem = format!("the text is not TOML: {}", error.message());
            let help = "a scenario is `key = value` lines below `[table]` headers";
            ErrorKind::Syntax.at(&[], problem, help).with_place(self.locate(error.span().unwrap_or(0..0)))
        })?;
        let mut root = Spanned::new(0..0, DeValue::Table(parsed.into_inner()));
        let mut base = self.toml.len() + 1;
        for set in self.overrides {
            set.apply(&mut root, base)?;
            base += set.text().len() + 1;
        }
        Ok(root)
    }

    /// Returns the place of a span of the common address space.
    fn locate(&self, span: Range<usize>) -> Place {
        let mut base = self.toml.len() + 1;
        if span.start >= base {
            for set in self.overrides {
                let end = base + set.text().len();
                if span.start <= end {
                    return set.place(span.start - base..span.end.saturating_sub(base));
                }
                base = end + 1;
            }
        }
        Place::new(self.name, self.toml, span)
    }
}

/// Returns the span of the value of a key or entry. A missing key has the span of its origin, or else of its table. An
/// overridden part, with a span from `overridden` on, replaces the whole.
fn find(root: &Spanned<DeValue<'_>>, path: &str, overridden: usize) -> Range<usize> {
    let list = path.rsplit_once('.').filter(|(_, entry)| entry.parse::<usize>().is_ok()).map_or(path, |(list, _)| list);
    // Keys of a leg have the origins of those of `[formation]`.
    let leg = list.strip_prefix("leg.").and_then(|rest| rest.split_once('.'));
    let key = leg.map_or_else(|| Cow::Borrowed(list), |(_, key)| Cow::Owned(format!("formation.{key}")));
    let origins = ORIGINS.iter().filter(|(missing, _)| **missing == *key).flat_map(|(_, origins)| origins.iter());
    let origins = origins.map(|origin| match leg {
        Some((leg, _)) => origin.replace("formation", &format!("leg.{leg}")),
        None => (*origin).to_owned(),
    });
    let mut found = [path, list].map(str::to_owned).into_iter().chain(origins).map(|path| value_at(root, &path));
    match found.find_map(|(value, key)| Some((value?, key))) {
        Some((value, key)) => {
            let span = if value.get_ref().is_table() { key } else { value.span() };
            first_span_from(value, overridden).unwrap_or(span)
        }
        None => value_at(root, list).1,
    }
}

/// Returns the value of a key or entry, and the span of the last key or entry on the way to it.
fn value_at<'t, 'a>(root: &'t Spanned<DeValue<'a>>, path: &str) -> (Option<&'t Spanned<DeValue<'a>>>, Range<usize>) {
    /// Returns the rest of a path after its first part; `None` if it begins with another one.
    fn after<'p>(path: &'p str, part: &str) -> Option<&'p str> {
        let rest = path.strip_prefix(part)?;
        if rest.is_empty() { Some(rest) } else { rest.strip_prefix('.') }
    }
    let (mut value, mut rest, mut span) = (root, path, 0..0);
    while !rest.is_empty() {
        let next = match value.get_ref() {
            // The name of a law may have dots.
            DeValue::Table(table) => {
                table.iter().find_map(|(key, value)| Some((key.span(), value, after(rest, key.get_ref())?)))
            }
            DeValue::Array(list) => {
                let (number, rest) = rest.split_once('.').unwrap_or((rest, ""));
                let entry = number.parse::<usize>().ok().and_then(|number| list.get(number.checked_sub(1)?));
                entry.map(|value| (value.span(), value, rest))
            }
            _ => None,
        };
        let Some(next) = next else { return (None, span) };
        (span, value, rest) = next;
    }
    (Some(value), span)
}

/// Returns the span of the value, or of the first part of a list, that starts at `least` or later.
fn first_span_from(value: &Spanned<DeValue<'_>>, least: usize) -> Option<Range<usize>> {
    if value.span().start >= least {
        return Some(value.span());
    }
    value.get_ref().as_array()?.iter().find_map(|entry| first_span_from(entry, least))
}

/// Override: a key of the scenario set to another value.
///
/// The path is dotted: `law.delta_m=1.5`. Missing keys and tables are created: `plant.kind=ideal`. Entries of lists are
/// counted from 1, as vehicles are; `x`, `y`, `z` stand for 1, 2, 3: `start.positions_m.4.x=-1` moves vehicle 4. The
/// value is TOML; a bare word is a string. An inline table replaces a whole table: `formation={shape="circle",
/// radius_m=3}`. A new `kind` or `shape` drops the keys that it does not have: `law.kind=laplacian` suffices if the
/// file gives `law.alpha`. The JSON Schema lists the keys of each `kind` and `shape`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Override {
    text: String,
    path: Vec<Range<usize>>,
    value: Range<usize>,
}

/// Length limit of a path; `start.positions_m.2.x` has four parts.
const MAX_DEPTH: usize = 8;

impl Override {
    /// Parses `key.path=value`.
    ///
    /// # Errors
    /// [`ScenarioError`] if `=` is missing, a part of the path is not a key, or the value is neither TOML nor a bare
    /// word.
    pub fn parse(text: &str) -> Result<Self, ScenarioError> {
        let place = |span: Range<usize>| Place::new(&SET.to_string(), text, span);
        let Some(equals) = text.find('=') else {
            let problem = "an override has no `=`";
            let help = "write it as key.path=value, for example time.dt_s=0.001";
            return Err(ErrorKind::Override.at(&[], problem, help).with_place(place(0..text.len())));
        };
        let mut path = Vec::new();
        let mut start = 0;
        for part in text[..equals].split('.') {
            let key = trimmed(text, start..start + part.len());
            if key.is_empty() || !text[key.clone()].chars().all(is_word) {
                let problem = format!("`{part}` is not a key of an override");
                let help = "a path is keys and entry numbers with dots between them, such as start.positions_m.2.x";
                return Err(ErrorKind::Override.at(&[], problem, help).with_place(place(start..start + part.len())));
            }
            path.push(key);
            start += part.len() + 1;
        }
        if path.len() > MAX_DEPTH {
            let problem = format!("a path must have at most {MAX_DEPTH} parts, got {}", path.len());
            let help = "`tautline schema` lists the keys of a scenario";
            return Err(ErrorKind::Override.at(&[], problem, help).with_place(place(0..equals)));
        }
        let value = trimmed(text, equals + 1..text.len());
        let parsed = Self { text: text.to_owned(), path, value };
        match parsed.value() {
            Ok(_) => Ok(parsed),
            Err(error) => {
                let base = parsed.value.start;
                let span = error.span().map_or(parsed.value.clone(), |span| base + span.start..base + span.end);
                let problem = format!("the value is not TOML: {}", error.message());
                let help = "numbers without a unit, true, false, [lists], {tables} and \"strings\" are; a bare word \
                            is a string";
                Err(ErrorKind::Override.at(&[], problem, help).with_place(place(span)))
            }
        }
    }

    /// Returns the override as written.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Returns the place of a span of bytes of the override.
    pub(super) fn place(&self, span: Range<usize>) -> Place {
        Place::new(&SET.to_string(), &self.text, span)
    }

    /// Sets the key in a document and creates missing tables. Spans of the new value count from `base`.
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
                    let what = format!("the entry must be from 1 to {}, got {name}", list.len());
                    let entry = self.entry(part)?.checked_sub(1).and_then(|entry| list.get_mut(entry));
                    entry.ok_or_else(|| self.refuse(part, &what))?
                }
                other => {
                    let what = format!("a value of the type {} has no keys", other.type_str());
                    return Err(self.refuse(part, &what));
                }
            };
        }
        *target = shifted(value, base + self.value.start);
        Ok(())
    }

    /// Parses the value, with spans from its own first byte.
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

    /// Returns the number of an entry of a list, from 1.
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
        let help = "entries of lists are counted from 1, as vehicles are; x, y, z name the axes of a point";
        ErrorKind::Override.at(&[], message, help).with_place(self.place(span.clone()))
    }
}

/// Shortens a span by white space at its ends.
fn trimmed(text: &str, span: Range<usize>) -> Range<usize> {
    let part = &text[span.clone()];
    let start = span.start + (part.len() - part.trim_start().len());
    start..start + part.trim().len()
}

fn is_word(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_' || c == '-'
}

/// Returns a value with all spans shifted.
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
