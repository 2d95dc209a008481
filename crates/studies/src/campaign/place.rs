//! The place in a specification that an error is about.

use std::ops::Range;

use toml::de::{DeTable, DeValue};

use super::error::CampaignError;
use tautline_sim::scenario::Place;

/// What overrides are called in errors of a scenario.
const SET: &str = "--set";

impl CampaignError {
    /// Returns the place in the text of a specification, which is called `name`: the key that the error is about, or else its table. None
    /// where the error is not about the specification.
    #[must_use]
    pub fn place(&self, name: &str, text: &str) -> Option<Place> {
        let keys = match self {
            Self::Vary { key, .. } => vec![format!("vary.{key}")],
            Self::Plan { key, .. } => vec![key.clone()],
            Self::Scenario { key, error, .. } => match error.place() {
                Some(place) if place.source == SET && !key.starts_with("vary.") => {
                    let set = place.text.split('=').next().unwrap_or_default().trim();
                    vec![format!("vary.{set}"), format!("set.{set}"), key.clone()]
                }
                // The scenario's own file has the place.
                Some(place) if place.source != SET && !key.starts_with("vary.") => return None,
                _ => vec![key.clone()],
            },
            _ => return None,
        };
        let parsed = DeTable::parse(text).ok()?;
        let span = keys.iter().find_map(|key| find(parsed.get_ref(), key)).or_else(|| {
            let key = keys.first()?;
            std::iter::successors(key.rsplit_once('.'), |(table, _)| table.rsplit_once('.'))
                .find_map(|(table, _)| find(parsed.get_ref(), table))
        })?;
        Some(Place::new(name, text, span))
    }
}

/// The bytes of a key, whose tables' names stand before it, each in a table of its own or joined by dots.
fn find(table: &DeTable<'_>, key: &str) -> Option<Range<usize>> {
    table.iter().find_map(|(name, value)| {
        let rest = key.strip_prefix(&**name.get_ref())?;
        match (rest.strip_prefix('.'), value.get_ref()) {
            (None, _) => rest.is_empty().then(|| name.span()),
            (Some(below), DeValue::Table(table)) => find(table, below),
            (Some(_), _) => None,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "scenario = \"pentagon\"\nruns = 3\n[vary]\n\"start.jitter_m\" = 1\nlaw.alpha = { unifrom = [0, 1] }\n\
                        [vary.network]\n  loss = 2\n[stop]\nwidth = 3\n";

    #[test]
    fn a_key_is_found_however_it_is_written_and_else_its_table() {
        let at = |key: &str| {
            let place = CampaignError::plan("", "").at(key).place("spec.toml", TEXT)?;
            Some((place.line, place.column))
        };
        assert_eq!(at("runs"), Some((2, 1)));
        assert_eq!(at("vary.start.jitter_m"), Some((4, 1)));
        assert_eq!(at("vary.law.alpha.unifrom"), Some((5, 15)));
        assert_eq!(at("vary.network.loss"), Some((7, 3)));
        assert_eq!(at("stop.width"), Some((9, 1)));
        assert_eq!(at("stop.decided"), Some((8, 2)), "its table");
        assert_eq!((at("laws"), at("")), (None, None));
    }
}
