//! A scenario's text with its overrides, and the way back from a value to its place.
//!
//! Spans live in one address space: the file's bytes first, then each override's. A value therefore knows where it was
//! written, whichever text that was.

use std::borrow::Cow;
use std::ops::Range;

use serde::Deserialize as _;
use toml::de::{DeTable, DeValue};
use toml::{Spanned, map::Map};

use super::deserializer::{CHOICES, KeyError, Unknown, Value};
use super::document::{DEFAULT_KINDS, Document};
use super::error::{Field, Place, ScenarioError};
use super::overrides::{OTHER_NAMES, Override};
use super::schema::tables_with;
use super::suggest::suggest;

/// Keys that give a missing key its value, in order: an error at one of these keys stands where its value comes from.
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
    ("reference.times_s", &["reference.file"]),
    ("swarm.hull_radius_m", &["law.delta_m"]),
    ("swarm.count", &["start.positions_m", "formation.points_m", "formation.shape"]),
];

/// Longest part of an unknown name that a message repeats \[characters\].
const NAME_CHARS: usize = 40;

/// A named text and the overrides on top of it.
pub(super) struct Text<'a> {
    pub(super) name: &'a str,
    pub(super) toml: &'a str,
    pub(super) overrides: &'a [Override],
}

impl<'a> Text<'a> {
    /// Reads the keys of the scenario, without those of a choice that an override has left.
    pub(super) fn decode(&self) -> Result<Document, ScenarioError> {
        self.document()?.map_err(|error| self.explain(error))
    }

    /// Whether the type of the key that the last override sets asks for a whole number. The override must give a number that is
    /// none.
    pub(super) fn asks_for_whole_number(&self) -> bool {
        let Some((_, before)) = self.overrides.split_last() else { return false };
        let base = before.iter().fold(self.toml.len() + 1, |base, set| base + set.text().len() + 1);
        let is_of_last = |error: &KeyError| error.span.as_ref().is_some_and(|span| span.start >= base);
        matches!(self.document(), Ok(Err(error)) if error.asks_for_whole && is_of_last(&error))
    }

    /// The keys of the scenario, or what is wrong with one of them.
    fn document(&self) -> Result<Result<Document, KeyError>, ScenarioError> {
        let mut left: Vec<(String, String)> = Vec::new();
        loop {
            let mut root = self.tree()?;
            if root.get_ref().as_table().is_some_and(Map::is_empty) {
                return Err(ScenarioError::new("the scenario is empty")
                    .coded("scenario/empty")
                    .with_help("start from a built-in scenario, such as `pentagon`")
                    .with_place(Place::new(self.name, self.toml, 0..0)));
            }
            for (table, key) in &left {
                remove(&mut root, table, key);
            }
            match Document::deserialize(Value::from(root)) {
                Ok(document) => return Ok(Ok(document)),
                Err(error) => match self.left_behind(&error) {
                    Some(key) => left.push(key),
                    None => return Ok(Err(error)),
                },
            }
        }
    }

    /// The table and the key of the file that an error is about, where an override has left the choice that the key
    /// belongs to: `--set law.kind=laplacian` leaves `law.alpha`.
    fn left_behind(&self, error: &KeyError) -> Option<(String, String)> {
        let (Some(Unknown::Key(key, _)), Some(span)) = (&error.unknown, &error.span) else { return None };
        let in_file = |span: &Range<usize>| span.start <= self.toml.len();
        let root = self.tree().ok()?;
        let mut tables = root.get_ref().as_table()?.iter();
        let (name, chosen) = tables.find_map(|(name, table)| {
            let table = table.get_ref().as_table()?;
            let (key, value) = table.get_key_value(key.as_str())?;
            let holds_it = key.span() == *span && in_file(&value.span());
            let chosen = CHOICES.iter().find_map(|choice| table.get(*choice));
            holds_it.then_some((name.get_ref(), chosen?))
        })?;
        let is_of_a_choice = tables_with(key).iter().any(|place| place.starts_with(&format!("[{name}] with ")));
        (!in_file(&chosen.span()) && is_of_a_choice).then(|| (name.to_string(), key.clone()))
    }

    /// Gives an error about keys its place in the text: at the first key that an override touched, or else at the
    /// first key.
    pub(super) fn place(&self, error: ScenarioError) -> ScenarioError {
        let (None, Ok(root)) = (error.place(), self.tree()) else { return error };
        let spans = error.fields().iter().map(|&field| find(&root, field, self.toml.len() + 1));
        let overridden = spans.clone().find(|span| span.start > self.toml.len());
        match overridden.or_else(|| spans.clone().next()) {
            Some(span) => {
                let place = self.locate(span);
                error.with_place(place)
            }
            None => error,
        }
    }

    /// Gives an error about a law of `[laws.NAME]` its place: at the key, or else at the law's table.
    pub(super) fn place_in_law(&self, law: &str, error: ScenarioError) -> ScenarioError {
        let Ok(root) = self.tree() else { return error };
        let Some((name, keys)) = laws(&root).and_then(|laws| laws.get_key_value(law)) else { return error };
        let key = error.field().map_or("", |field| field.key.trim_start_matches("law."));
        let span = keys.get_ref().get(key).map_or_else(|| name.span(), Spanned::span);
        error.with_place(self.locate(span))
    }

    /// Whether a kind is missing where a name that is no kind stands for it: in `[laws.NAME]`.
    fn is_name_of_a_law(&self, span: Option<&Range<usize>>) -> bool {
        let is_it = |root: Spanned<_>| laws(&root)?.keys().any(|name| Some(&name.span()) == span).then_some(());
        self.tree().ok().and_then(is_it).is_some()
    }

    /// The text as a tree, overrides applied, keys under one name each, tables without a kind under the default one, one of
    /// `[laws.NAME]` under its name.
    fn tree(&self) -> Result<Spanned<DeValue<'a>>, ScenarioError> {
        let parsed = DeTable::parse(self.toml).map_err(|error| {
            ScenarioError::new(format!("this is not TOML: {}", error.message()))
                .coded("scenario/syntax")
                .with_help("a scenario is `key = value` lines below `[table]` headers")
                .with_place(self.locate(error.span().unwrap_or(0..0)))
        })?;
        let mut root = Spanned::new(0..0, DeValue::Table(parsed.into_inner()));
        self.name_keys(&mut root)?;
        let mut base = self.toml.len() + 1;
        for set in self.overrides {
            set.apply(&mut root, base)?;
            base += set.text().len() + 1;
        }
        // Tables that an override gives whole have other names too.
        self.name_keys(&mut root)?;
        for (table, kind) in DEFAULT_KINDS {
            if let DeValue::Table(tables) = root.get_mut()
                && let Some(table) = tables.get_mut(table)
            {
                let span = table.span();
                if let DeValue::Table(keys) = table.get_mut() {
                    let kind = Spanned::new(span.clone(), DeValue::String(kind.into()));
                    keys.entry(Spanned::new(span, Cow::from("kind"))).or_insert(kind);
                }
            }
        }
        if let DeValue::Table(tables) = root.get_mut()
            && let Some(DeValue::Table(laws)) = tables.get_mut("laws").map(Spanned::get_mut)
        {
            for (name, law) in laws {
                if let DeValue::Table(keys) = law.get_mut() {
                    let kind = Spanned::new(name.span(), DeValue::String(name.get_ref().clone()));
                    keys.entry(Spanned::new(name.span(), Cow::from("kind"))).or_insert(kind);
                }
            }
        }
        Ok(root)
    }

    /// Puts keys that have another name under the one that they are read under.
    fn name_keys(&self, root: &mut Spanned<DeValue<'a>>) -> Result<(), ScenarioError> {
        for (table, other, name) in OTHER_NAMES {
            let Some(tables) = keys_of(root) else { continue };
            let places = match table {
                None => vec![tables],
                Some(table) => match tables.get_mut(table).map(Spanned::get_mut) {
                    Some(DeValue::Table(keys)) => vec![keys],
                    Some(DeValue::Array(list)) => list.iter_mut().filter_map(keys_of).collect(),
                    _ => Vec::new(),
                },
            };
            for keys in places {
                let Some((key, value)) = keys.remove_entry(other) else { continue };
                if keys.contains_key(name) {
                    let [name, other] = [name, other].map(|key| match table {
                        None => format!("[{key}]"),
                        Some(_) => format!("`{key}`"),
                    });
                    return Err(ScenarioError::new(format!("both {name} and {other} are given"))
                        .coded("scenario/exclusive-keys")
                        .with_help(format!("{other} is another name of {name}: keep one of them"))
                        .with_place(self.locate(key.span())));
                }
                keys.insert(Spanned::new(key.span(), name.into()), value);
            }
        }
        Ok(())
    }

    /// The place of a span of the common address space.
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

    /// An error about a key with its place and its remedy.
    fn explain(&self, error: KeyError) -> ScenarioError {
        let short = |name: &str| name.chars().take(NAME_CHARS).collect::<String>();
        let code = match error.unknown {
            Some(Unknown::Key(..)) => "scenario/unknown-key",
            Some(Unknown::Choice(..)) => "scenario/unknown-choice",
            None if error.is_missing => "scenario/missing-key",
            None => "scenario/wrong-type",
        };
        let (said, help) = match error.unknown {
            Some(Unknown::Key(name, mut known)) => {
                known.sort_unstable();
                known.dedup();
                let help = match tables_with(&name)[..] {
                    [] => suggest(&name, &known),
                    ref tables => format!("`{name}` belongs in {}; {}", tables.join(", or "), suggest(&name, &known)),
                };
                (format!("unknown key `{}`", short(&name)), help)
            }
            Some(Unknown::Choice(name, known)) => {
                let help = suggest(&name, &known);
                let help = if self.is_name_of_a_law(error.span.as_ref()) {
                    format!("the name of a law is its kind, unless the table [laws.NAME] holds a `kind`: {help}")
                } else {
                    help
                };
                (format!("unknown choice `{}`", short(&name)), help)
            }
            None => (
                error.message,
                "the built-in scenarios show every table; `tautline schema` describes every key".to_owned(),
            ),
        };
        ScenarioError::new(said).coded(code).with_help(help).with_place(self.locate(error.span.unwrap_or(0..0)))
    }
}

/// The tables `[laws.NAME]`.
fn laws<'t, 'a>(root: &'t Spanned<DeValue<'a>>) -> Option<&'t DeTable<'a>> {
    root.get_ref().get("laws")?.get_ref().as_table()
}

/// The keys and values of a table.
fn keys_of<'t, 'a>(value: &'t mut Spanned<DeValue<'a>>) -> Option<&'t mut DeTable<'a>> {
    match value.get_mut() {
        DeValue::Table(keys) => Some(keys),
        _ => None,
    }
}

/// Takes a key out of a table.
fn remove(root: &mut Spanned<DeValue<'_>>, table: &str, key: &str) {
    if let DeValue::Table(tables) = root.get_mut()
        && let Some(DeValue::Table(keys)) = tables.get_mut(table).map(Spanned::get_mut)
    {
        keys.remove(key);
    }
}

/// The span of a field's value: of its entry if it is a list, of what it comes from if it is not there, of its table
/// if nothing is. A part of it that was overridden, with a span from `overridden` on, stands for all of it.
fn find(root: &Spanned<DeValue<'_>>, field: Field, overridden: usize) -> Range<usize> {
    let of_leg = field.leg.checked_sub(1).and_then(|leg| root.get_ref().get("leg")?.get_ref().get(leg));
    let at = |path: &str| match (of_leg, path.strip_prefix("formation.")) {
        (Some(leg), Some(key)) => leg.get_ref().get(key),
        _ => path.split('.').try_fold(root, |value, key| value.get_ref().get(key)),
    };
    let origins = ORIGINS.iter().find(|(key, _)| *key == field.key).map_or(&[][..], |(_, origins)| origins);
    let Some(value) = std::iter::once(&field.key).chain(origins).find_map(|key| at(key)) else {
        if let Some(leg) = of_leg {
            return leg.span();
        }
        let table = field.key.split('.').next().unwrap_or_default();
        let tables = root.get_ref().as_table();
        return tables.and_then(|tables| tables.get_key_value(table)).map_or(0..0, |(key, _)| key.span());
    };
    let value = field.entry.and_then(|entry| value.get_ref().get(entry)).unwrap_or(value);
    first_span_from(value, overridden).unwrap_or_else(|| value.span())
}

/// The first span within a list, or of the value, that starts at `least` or later.
fn first_span_from(value: &Spanned<DeValue<'_>>, least: usize) -> Option<Range<usize>> {
    if value.span().start >= least {
        return Some(value.span());
    }
    value.get_ref().as_array()?.iter().find_map(|entry| first_span_from(entry, least))
}
