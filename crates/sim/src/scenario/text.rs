//! A scenario's text with its overrides, and the way back from a value to its place.
//!
//! Spans live in one address space: the file's bytes first, then each override's. A value therefore knows where it was
//! written, whichever text that was.

use std::ops::Range;

use serde::Deserialize as _;
use toml::de::{DeTable, DeValue, ValueDeserializer};
use toml::{Spanned, map::Map};

use super::check::conform;
use super::document::{Document, Given};
use super::error::{Field, Place, ScenarioError};
use super::overrides::Override;

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

/// A named text and the overrides on top of it.
pub(super) struct Text<'a> {
    pub(super) name: &'a str,
    pub(super) toml: &'a str,
    pub(super) overrides: &'a [Override],
}

impl<'a> Text<'a> {
    /// Reads the keys of the scenario, without those of a choice that an override has left.
    pub(super) fn decode(&self) -> Result<Document, ScenarioError> {
        let mut root = self.tree()?;
        if root.get_ref().as_table().is_some_and(Map::is_empty) {
            return Err(ScenarioError::new("the scenario is empty")
                .coded("scenario/empty")
                .with_help("start from a built-in scenario, such as `pentagon`")
                .with_place(Place::new(self.name, self.toml, 0..0)));
        }
        let time = root.get_ref().get("time");
        let gives = |key: &str| time.is_some_and(|time| time.get_ref().get(key).is_some());
        let given = Given { dt_s: gives("dt_s"), record_hz: gives("record_hz"), max_halvings: gives("max_halvings") };
        conform(&mut root, self.toml.len() + 1).map_err(|misfit| misfit.error.with_place(self.locate(misfit.span)))?;
        // `conform` accepts only what serde reads. An error of serde is a defect of the schema.
        let document = Document::deserialize(ValueDeserializer::from(root)).map_err(|error| {
            ScenarioError::new(error.message())
                .coded("scenario/wrong-type")
                .with_help("`tautline schema` describes every key")
                .with_place(self.locate(error.span().unwrap_or(0..0)))
        })?;
        Ok(Document { given, ..document })
    }

    /// Gives an error about keys its place in the text: at the first key that an override touched, or else at the
    /// first key.
    pub(super) fn place(&self, error: ScenarioError) -> ScenarioError {
        let (None, Ok(root)) = (error.place(), self.tree()) else { return error };
        let spans = error.fields().iter().map(|field| find(&root, field, self.toml.len() + 1));
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

    /// Gives an error about a law of `[laws.NAME]` its place: at the key, or else at the law's table.
    pub(super) fn place_in_law(&self, law: &str, error: ScenarioError) -> ScenarioError {
        let Ok(root) = self.tree() else { return error };
        let Some((name, keys)) = laws(&root).and_then(|laws| laws.get_key_value(law)) else { return error };
        let field = error.fields().first();
        let key = field.map_or("", |field| field.key.trim_start_matches("law."));
        let span = keys.get_ref().get(key).map_or_else(|| name.span(), Spanned::span);
        error.with_place(self.locate(span))
    }

    /// Returns the text as a tree with its overrides applied.
    pub(super) fn tree(&self) -> Result<Spanned<DeValue<'a>>, ScenarioError> {
        let parsed = DeTable::parse(self.toml).map_err(|error| {
            ScenarioError::new(format!("this is not TOML: {}", error.message()))
                .coded("scenario/syntax")
                .with_help("a scenario is `key = value` lines below `[table]` headers")
                .with_place(self.locate(error.span().unwrap_or(0..0)))
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

/// Returns the tables `[laws.NAME]`.
fn laws<'t, 'a>(root: &'t Spanned<DeValue<'a>>) -> Option<&'t DeTable<'a>> {
    root.get_ref().get("laws")?.get_ref().as_table()
}

/// Returns the span of a field's value: of its entry if it is a list, of what it comes from if it is not there, of its
/// table if nothing is. A part of it that was overridden, with a span from `overridden` on, stands for all of it.
fn find(root: &Spanned<DeValue<'_>>, field: &Field, overridden: usize) -> Range<usize> {
    let of_leg = field.leg.checked_sub(1).and_then(|leg| root.get_ref().get("leg")?.get_ref().get(leg));
    let at = |path: &str| match (of_leg, path.strip_prefix("formation.")) {
        (Some(leg), Some(key)) => leg.get_ref().get(key),
        _ => path.split('.').try_fold(root, |value, key| value.get_ref().get(key)),
    };
    let origins = ORIGINS.iter().find(|(key, _)| *key == field.key).map_or(&[][..], |(_, origins)| origins);
    let Some(value) = std::iter::once(&*field.key).chain(origins.iter().copied()).find_map(at) else {
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

/// Returns the first span within a list, or of the value, that starts at `least` or later.
fn first_span_from(value: &Spanned<DeValue<'_>>, least: usize) -> Option<Range<usize>> {
    if value.span().start >= least {
        return Some(value.span());
    }
    value.get_ref().as_array()?.iter().find_map(|entry| first_span_from(entry, least))
}
