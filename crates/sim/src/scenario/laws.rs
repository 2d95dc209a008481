//! Laws under names of their own, which a scenario is flown under one after the other to compare them.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::error::ScenarioError;
use super::limits::{MAX_NAME_CHARS, may_be_in_a_name};
use tautline_laws::law::LawSpec;

/// `[laws.NAME]` by name.
pub(super) type Laws = BTreeMap<String, OtherLaw>;

/// A law beside that of `[law]`, flown by `tautline compare` alone: the keys of its kind.
#[derive(Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct OtherLaw {
    #[schemars(flatten)]
    pub(super) kind: LawSpec,
}

/// The name of a law's kind, as `law.kind` gives it.
pub(super) fn kind(law: &LawSpec) -> String {
    keys(law).0
}

/// What sets a law in a scenario, whatever it says: an override for its kind and for each of its keys.
pub(super) fn law_overrides(law: &LawSpec) -> Vec<String> {
    let (kind, keys) = keys(law);
    let of_kind = format!("law.kind={kind}");
    std::iter::once(of_kind).chain(keys.iter().map(|(key, value)| format!("law.{key}={value}"))).collect()
}

/// The kind of a law and its keys.
fn keys(law: &LawSpec) -> (String, Table) {
    // Every law has a form in TOML: a table with the name of its kind, which holds its keys.
    let choice = Table::try_from(law).unwrap_or_default().into_iter().next();
    choice.map_or_else(Default::default, |(kind, keys)| match keys {
        Value::Table(keys) => (kind, keys),
        _ => (kind, Table::new()),
    })
}

/// Checks the laws of a file, whether they are flown or not; what is wrong comes with the law's name.
pub(super) fn check(laws: &Laws) -> Result<(), (&str, ScenarioError)> {
    let kinds: Vec<_> = LawSpec::all().iter().map(kind).collect();
    for (name, OtherLaw { kind: law }) in laws {
        check_name(name).map_err(|error| (&**name, error))?;
        let kind = kind(law);
        if *name != kind && kinds.contains(name) {
            let error = ScenarioError::new(format!("the law named {name} is of the kind {kind}"))
                .coded("scenario/name")
                .with_help("give it a name that is no kind of law")
                .at("law.kind");
            return Err((name, error));
        }
    }
    Ok(())
}

fn check_name(name: &str) -> Result<(), ScenarioError> {
    let help = format!("use 1 to {MAX_NAME_CHARS} letters, digits, `-` and `_`");
    let said = match name.chars().find(|&c| !may_be_in_a_name(c)) {
        Some(c) => format!("the name of a law holds {c:?}"),
        None if name.is_empty() => "the name of a law is empty".to_owned(),
        None if name.len() > MAX_NAME_CHARS => format!("the name of a law has {} characters", name.len()),
        None => return Ok(()),
    };
    Err(ScenarioError::new(said).coded("scenario/name").with_help(help))
}
