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
use super::homes::homes;
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

/// Longest part of an unknown name that a message repeats \[characters\].
const NAME_CHARS: usize = 40;

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

    /// Gives an error about keys its place in the text: at the first key that an override touched, or else at the
    /// first key.
    pub(super) fn place(&self, error: ScenarioError) -> ScenarioError {
        let (None, Ok(root)) = (error.place(), self.tree()) else { return error };
        let spans = error.fields().iter().map(|&field| find(&root, field, self.text.len() + 1));
        let overridden = spans.clone().find(|span| span.start > self.text.len());
        match overridden.or_else(|| spans.clone().next()) {
            Some(span) => {
                let place = self.locate(span);
                error.with_place(place)
            }
            None => error,
        }
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
        let span = error.span().unwrap_or(0..0);
        let place = self.locate(span.clone());
        let name: String = place.text[place.span.clone()].trim_matches(['"', '\'']).chars().take(NAME_CHARS).collect();
        let message = error.message();
        let (said, help) = if message.starts_with("unknown field ") || message.starts_with("unexpected keys ") {
            let known = self.with_common_keys(known_names(message), &span);
            let help = match homes(&name)[..] {
                [] => suggest(&name, &known),
                ref homes => format!("`{name}` belongs in {}; {}", homes.join(", or "), suggest(&name, &known)),
            };
            (format!("unknown key `{name}`"), help)
        } else if message.starts_with("unknown variant ") {
            (format!("unknown choice `{name}`"), suggest(&name, &known_names(message)))
        } else {
            let help = "the built-in scenarios show every table; `tautline schema` describes every key".to_owned();
            (in_words(message), help)
        };
        ScenarioError::new(said).with_help(help).with_place(place)
    }

    /// The known keys of a choice, with those common to all choices of its table.
    fn with_common_keys(&self, mut known: Vec<String>, span: &Range<usize>) -> Vec<String> {
        let Ok(root) = self.tree() else { return known };
        let holds = |table: &str| match root.get_ref().get(table).map(Spanned::get_ref) {
            Some(DeValue::Table(keys)) => keys.keys().any(|key| key.span() == *span),
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

/// The names that serde's sentence about an unknown name ends with. What comes before is the input's and may hold
/// anything.
fn known_names(message: &str) -> Vec<String> {
    match (message.rfind(", expected "), message.rfind(", available keys: ")) {
        (Some(at), None) => message[at..].split('`').skip(1).step_by(2).map(str::to_owned).collect(),
        (_, Some(at)) => {
            let list = &message[at + ", available keys: ".len()..];
            list.split(", ").filter(|name| !name.is_empty()).map(str::to_owned).collect()
        }
        (None, None) => Vec::new(),
    }
}

/// What the types of Rust that stand in serde's sentences are called here.
const WORDS: [(&str, &str); 4] =
    [("f64", "a number"), ("u64", "a whole number from 0"), ("u32", "a whole number from 0"), ("u8", "2 or 3")];

/// serde's sentence about a value without the names of Rust's types.
fn in_words(message: &str) -> String {
    if message == "wanted string or table" {
        return "expected a string".to_owned();
    }
    if let Some(at) = message.rfind("expected struct ") {
        return format!("{}expected a table", &message[..at]);
    }
    let mut said = message.replacen("missing field ", "missing key ", 1).replace(" as i128", "");
    for (rust, words) in WORDS {
        if let Some(start) = said.strip_suffix(rust).filter(|start| start.ends_with("expected ")) {
            said = format!("{start}{words}");
        }
    }
    said
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
/// if nothing is. A part of it that was overridden, with a span from `overridden` on, stands for all of it.
fn find(root: &Spanned<DeTable<'_>>, field: Field, overridden: usize) -> Range<usize> {
    let origins = ORIGINS.iter().find(|(key, _)| *key == field.key).map_or(&[][..], |(_, origins)| origins);
    let found = std::iter::once(field.key).chain(origins.iter().copied()).find_map(|key| lookup(root, key));
    let Some(value) = found else {
        let table = field.key.split('.').next().unwrap_or_default();
        return root.get_ref().get_key_value(table).map_or(0..0, |(key, _)| key.span());
    };
    let value = match (value.get_ref(), field.entry) {
        (DeValue::Array(list), Some(entry)) => list.get(entry).unwrap_or(value),
        _ => value,
    };
    first_span_from(value, overridden).unwrap_or_else(|| value.span())
}

/// The first span within a list, or of the value, that starts at `least` or later.
fn first_span_from(value: &Spanned<DeValue<'_>>, least: usize) -> Option<Range<usize>> {
    if value.span().start >= least {
        return Some(value.span());
    }
    match value.get_ref() {
        DeValue::Array(list) => list.iter().find_map(|entry| first_span_from(entry, least)),
        _ => None,
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
