//! A scenario's text with its overrides, and the way back from a value to its place.
//!
//! Spans live in one address space: the file's bytes first, then each override's. A value therefore knows where it was
//! written, whichever text that was.

use std::ops::Range;

use serde::Deserialize;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::{Field, Place, ScenarioError};
use super::file::{CHOICES, ScenarioFile};
use super::overrides::Override;

/// Keys that give a missing key its value, in order: an error at one of these keys stands where its value comes from.
const ORIGINS: [(&str, &[&str]); 5] = [
    (
        "start.positions_m",
        &["start.spacing_m", "start.radius_m", "start.min_separation_m", "start.half_extent_m", "start.shape"],
    ),
    ("formation.points_m", &["formation.side_m", "formation.radius_m", "formation.spacing_m", "formation.shape"]),
    ("graph.edges", &["graph.kind"]),
    ("swarm.hull_radius_m", &["law.delta_m"]),
    ("swarm.count", &["start.positions_m", "formation.points_m", "formation.shape"]),
];

/// A named text and the overrides on top of it.
pub(super) struct Document<'a> {
    pub(super) name: &'a str,
    pub(super) text: &'a str,
    pub(super) overrides: &'a [Override],
}

impl<'a> Document<'a> {
    /// Reads the keys of the scenario.
    pub(super) fn decode(&self) -> Result<ScenarioFile, ScenarioError> {
        let mut root = self.tree()?;
        if root.get_ref().is_empty() {
            return Err(ScenarioError::new("the scenario is empty")
                .with_help("start from a built-in scenario, such as `pentagon`")
                .with_place(Place::new(self.name, self.text, 0..0)));
        }
        for (table, choice, common) in CHOICES {
            if let Some(value) = root.get_mut().get_mut(table) {
                nest(value, choice, common);
            }
        }
        ScenarioFile::deserialize(toml::Deserializer::from(root)).map_err(|error| self.explain(&error))
    }

    /// Gives an error about a key its place in the text.
    pub(super) fn place(&self, error: ScenarioError) -> ScenarioError {
        let (Some(field), None, Ok(root)) = (error.field(), error.place(), self.tree()) else { return error };
        let place = self.locate(find(&root, field));
        error.with_place(place)
    }

    /// The text as a tree, overrides applied.
    fn tree(&self) -> Result<Spanned<DeTable<'a>>, ScenarioError> {
        let mut root = DeTable::parse(self.text).map_err(|error| {
            ScenarioError::new(format!("this is not TOML: {}", error.message()))
                .with_help("a scenario is `key = value` lines below `[table]` headers")
                .with_place(self.locate(error.span().unwrap_or(0..0)))
        })?;
        let mut base = self.text.len() + 1;
        for set in self.overrides {
            set.apply(root.get_mut(), base)?;
            base += set.text().len() + 1;
        }
        Ok(root)
    }

    /// The place of a span of the common address space.
    fn locate(&self, span: Range<usize>) -> Place {
        let mut base = self.text.len() + 1;
        if span.start >= base {
            for set in self.overrides {
                let end = base + set.text().len();
                if span.start <= end {
                    return set.place(span.start - base..span.end.saturating_sub(base));
                }
                base = end + 1;
            }
        }
        Place::new(self.name, self.text, span)
    }

    /// An error of serde in the words of the file.
    fn explain(&self, error: &toml::de::Error) -> ScenarioError {
        let place = self.locate(error.span().unwrap_or(0..0));
        let message = error.message();
        let (said, help) = if let Some((name, known)) = unknown("unknown field `", message) {
            let known = self.with_common_keys(known, error.span());
            (format!("unknown key `{name}`"), Some(suggest(&name, &known)))
        } else if let Some((name, known)) = unknown("unknown variant `", message) {
            (format!("unknown choice `{name}`"), Some(suggest(&name, &known)))
        } else if let Some(name) = message.strip_prefix("missing field ") {
            (format!("missing key {name}"), None)
        } else {
            (message.replace("expected f64", "expected a number").replace(" u64", " a whole number"), None)
        };
        let said = ScenarioError::new(said).with_place(place);
        help.into_iter().fold(said, ScenarioError::with_help)
    }

    /// The known keys of a choice, with those common to all choices of its table.
    fn with_common_keys(&self, mut known: Vec<String>, span: Option<Range<usize>>) -> Vec<String> {
        let Ok(root) = self.tree() else { return known };
        let holds = |table: &str| match root.get_ref().get(table).map(Spanned::get_ref) {
            Some(DeValue::Table(keys)) => keys.keys().any(|key| Some(key.span()) == span),
            _ => false,
        };
        for (table, choice, common) in CHOICES {
            if holds(table) {
                known.extend(common.iter().copied().chain([choice]).map(str::to_owned));
            }
        }
        known.sort_unstable();
        known.dedup();
        known
    }
}

/// Moves the keys of a choice below it: `{ kind = "k", a = 1, common = 2 }` becomes `{ kind = { k = { a = 1 } },
/// common = 2 }`, all spans kept. A table without the choice, or with one that is not a string, stays as it is.
fn nest<'a>(value: &mut Spanned<DeValue<'a>>, choice: &'static str, common: &[&str]) {
    let span = value.span();
    let DeValue::Table(table) = value.get_mut() else { return };
    let Some((choice_key, chosen)) = table.remove_entry(choice) else { return };
    let chosen_span = chosen.span();
    let DeValue::String(name) = chosen.get_ref().clone() else {
        table.insert(choice_key, chosen);
        return;
    };
    let (outer, inner): (DeTable<'a>, DeTable<'a>) =
        std::mem::take(table).into_iter().partition(|(key, _)| common.contains(&&**key.get_ref()));
    *table = outer;
    let named =
        DeTable::from_iter([(Spanned::new(chosen_span.clone(), name), Spanned::new(span, DeValue::Table(inner)))]);
    table.insert(choice_key, Spanned::new(chosen_span, DeValue::Table(named)));
}

/// The span of a field's value: of its entry if it is a list, of what it comes from if it is not there, of its table
/// if nothing is.
fn find(root: &Spanned<DeTable<'_>>, field: Field) -> Range<usize> {
    let origins = ORIGINS.iter().find(|(key, _)| *key == field.key).map_or(&[][..], |(_, origins)| origins);
    let found = std::iter::once(field.key).chain(origins.iter().copied()).find_map(|key| lookup(root, key));
    match found {
        Some(value) => match (value.get_ref(), field.entry) {
            (DeValue::Array(list), Some(entry)) => list.get(entry).map_or(value.span(), Spanned::span),
            _ => value.span(),
        },
        None => {
            let table = field.key.split('.').next().unwrap_or_default();
            root.get_ref().get_key_value(table).map_or(0..0, |(key, _)| key.span())
        }
    }
}

/// The value at a dotted path.
fn lookup<'t, 'a>(root: &'t Spanned<DeTable<'a>>, path: &str) -> Option<&'t Spanned<DeValue<'a>>> {
    let mut parts = path.split('.');
    let first = root.get_ref().get(parts.next()?)?;
    parts.try_fold(first, |value, key| match value.get_ref() {
        DeValue::Table(table) => table.get(key),
        _ => None,
    })
}

/// The name and the known names of serde's sentence about an unknown one.
fn unknown(prefix: &str, message: &str) -> Option<(String, Vec<String>)> {
    let rest = message.strip_prefix(prefix)?;
    // The name is the input's and may hold anything; the list after it is ours.
    let (name, known) = rest.rsplit_once("`, ")?;
    let (name, known) = match rest.rfind("`, expected ") {
        Some(at) => (&rest[..at], &rest[at..]),
        None => (name, known),
    };
    let known = known.split('`').skip(1).filter(|part| !part.is_empty() && !part.contains([',', ' ']));
    Some((name.to_owned(), known.map(str::to_owned).collect()))
}

/// A remedy for a name that is not known: the nearest one, if it is near, and all of them.
pub(super) fn suggest(name: &str, known: &[String]) -> String {
    let list = known.iter().map(|known| format!("`{known}`")).collect::<Vec<_>>().join(", ");
    let nearest = known.iter().map(|known| (edit_distance(name, known), known)).min();
    match nearest {
        None => "none is known here".to_owned(),
        Some((distance, nearest)) if distance <= 1 + nearest.chars().count() / 3 => {
            format!("did you mean `{nearest}`? Known here: {list}")
        }
        Some(_) => format!("known here: {list}"),
    }
}

/// Fewest insertions, deletions and replacements of a character that turn one word into another (Levenshtein). Words
/// of more than 64 characters are compared by their first 64.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().take(64).collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().take(64).enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, &y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edit_distance_counts_single_character_changes() {
        assert_eq!(edit_distance("", "abc"), 3);
        assert_eq!(edit_distance("side_m", "side_m"), 0);
        assert_eq!(edit_distance("sied_m", "side_m"), 2);
        assert_eq!(edit_distance("pentagram", "pentagon"), 3);
    }
}
