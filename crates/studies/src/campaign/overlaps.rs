//! Keys of a specification that contradict each other.

use std::collections::BTreeMap;

use super::error::CampaignError;
use super::vary::Variation;

/// Refuses keys of which one is the other, or a part of it, and a varied law where laws are named.
pub(super) fn refuse_overlaps(
    sets: &BTreeMap<String, toml::Value>,
    variations: &BTreeMap<String, Variation>,
    names_laws: bool,
) -> Result<(), CampaignError> {
    let place = |key: &String| format!("{}.{key}", if sets.contains_key(key) { "set" } else { "vary" });
    let is_key = |key: &&String| key.split('.').all(|part| !part.is_empty() && part.chars().all(is_word));
    if let Some(key) = sets.keys().chain(variations.keys()).find(|key| !is_key(key)) {
        let refused = CampaignError::plan(
            format!("`{key}` is not a key of a scenario"),
            "write the key as --set takes it: time.dt_s",
        );
        return Err(refused.at(&place(key)));
    }
    let plain = |key: &String| {
        let axis = |part: &str| match part {
            "x" => "1".to_owned(),
            "y" => "2".to_owned(),
            "z" => "3".to_owned(),
            other => other.to_owned(),
        };
        key.split('.').map(axis).collect::<Vec<_>>()
    };
    let all: Vec<_> = sets.keys().chain(variations.keys()).collect();
    for (k, key) in all.iter().enumerate() {
        let varies = |number: usize| number >= sets.len();
        let clash = |&number: &usize| {
            let (one, other) = (plain(key), plain(all[number]));
            (varies(k) || varies(number)) && (one.starts_with(&other) || other.starts_with(&one))
        };
        if let Some(other) = (0..k).find(clash) {
            let places = if varies(k) && varies(other) { "both in [vary]" } else { "in [set] and in [vary]" };
            let refused = CampaignError::plan(
                format!("{} and {key} stand {places}, and one is the other or a part of it", all[other]),
                "a key either has one value or differs from run to run: take one of them out",
            );
            return Err(refused.at(&format!("vary.{key}")));
        }
    }
    let is_law = |key: &&String| ["law", "law.kind"].contains(&key.as_str());
    match variations.keys().find(is_law) {
        Some(key) if names_laws => Err(CampaignError::plan(
            format!("{key} stands in [vary], and laws are named beside it"),
            "name laws to fly each of them from the same starts, or vary the law, and not both",
        )
        .at(&format!("vary.{key}"))),
        _ => Ok(()),
    }
}

fn is_word(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_' || c == '-'
}
