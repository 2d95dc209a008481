//! Templates: a scenario file from which many flights are made, under other laws or from other starts.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::document::{Document, StartShape, StartTable};
use super::error::suggest;
use super::error::{ErrorKind, ScenarioError};
use super::external::ExternalLaw;
use super::limits::check_name;
use super::source::{Source, decoded, finish};
use super::spec::Scenario;
use super::text::Override;
use super::text::Text;
use crate::shield::ShieldSpec;
use tautline_laws::law::LawSpec;

/// Validated scenario file from which many flights are made. [`Template::scenario`] builds each flight from the file,
/// so that values that depend on the law or the start (assignment, step) are derived anew.
#[derive(Clone, Debug)]
pub struct Template {
    name: String,
    toml: String,
    overrides: Vec<Override>,
    /// Keys of the file, with the overrides.
    document: Document,
    own: Scenario,
    start_is_random: bool,
    laws: Vec<(String, LawSpec)>,
}

/// Law of a comparison, with its name.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedLaw {
    /// Name: that of its kind, or of its table `[laws.NAME]`.
    pub name: String,
    /// Law with all keys, defaults included.
    pub law: LawSpec,
    /// Whether the law flies under the shield, whatever the scenario says; `None` for the scenario's choice.
    pub shield: Option<bool>,
}

/// Suffixes of a law's name that select flights with and without the shield.
const SHIELD: [(&str, bool); 2] = [("+shield", true), ("+bare", false)];

impl NamedLaw {
    /// Returns the name of its kind.
    #[must_use]
    pub fn kind(&self) -> String {
        kind(&self.law)
    }

    /// Returns the overrides that select the law: one for its kind, one for each key, and one for the shield if the
    /// name ends with `+shield` or `+bare`.
    #[must_use]
    pub fn overrides(&self) -> Vec<String> {
        let mut overrides = law_overrides(&self.law);
        overrides.extend(self.shield.map(|enabled| format!("shield.enabled={enabled}")));
        overrides
    }
}

/// Random draw of one flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Draw {
    /// Replaces `start.seed`, and `noise.seed` if the flight is random.
    pub seed: u64,
    /// Replaces `start.jitter_m` \[m\], if given.
    pub jitter_m: Option<f64>,
}

impl Template {
    /// Reads a scenario and the laws that it names.
    ///
    /// # Errors
    /// As [`Scenario::read`].
    pub fn read(source: &Source, overrides: &[Override]) -> Result<Self, ScenarioError> {
        let (name, toml) = source.text()?;
        let (document, own, start_is_random, laws) = Text { name: &name, toml: &toml, overrides }.read(|text| {
            let document = decoded(text, source.folder())?;
            let a22_per_s = document.velocity_coefficient_per_s();
            let named = document.laws.iter();
            let laws = named.map(|(name, other)| (name.clone(), other.kind.clone().complete(a22_per_s))).collect();
            let start_is_random = is_random(&document);
            Ok((document.clone(), finish(document, text, None)?, start_is_random, laws))
        })?;
        Ok(Self { document, own, start_is_random, laws, overrides: overrides.to_vec(), name, toml })
    }

    /// Returns the template with an external law, which all its scenarios fly.
    #[must_use]
    pub fn with_external_law(mut self, law: Option<ExternalLaw>) -> Self {
        self.own.external_law = law;
        self
    }

    /// Returns the unchanged scenario of the file.
    #[must_use]
    pub fn own(&self) -> &Scenario {
        &self.own
    }

    /// Returns whether the start depends on its seed.
    #[must_use]
    pub fn start_is_random(&self) -> bool {
        self.start_is_random
    }

    /// Returns whether the flight depends on the seed of noise.
    #[must_use]
    pub fn flight_is_random(&self) -> bool {
        self.own.is_random_in_flight()
    }

    /// Returns the law of the file.
    #[must_use]
    pub fn own_law(&self) -> NamedLaw {
        NamedLaw { name: kind(&self.own.law), law: self.own.law.clone(), shield: None }
    }

    /// Returns the names of all available laws: those of `[laws.NAME]`, then the kinds that are not among them.
    #[must_use]
    pub fn law_names(&self) -> Vec<String> {
        let named: Vec<_> = self.laws.iter().map(|(name, _)| name.clone()).collect();
        let kinds = LawSpec::all().iter().map(kind).filter(|kind| !named.contains(kind)).collect::<Vec<_>>();
        named.into_iter().chain(kinds).collect()
    }

    /// Returns each name twice: for the law without and under the shield.
    #[must_use]
    pub fn with_and_without_shield(names: &[String]) -> Vec<String> {
        names.iter().flat_map(|name| SHIELD.iter().rev().map(move |(end, _)| format!("{name}{end}"))).collect()
    }

    /// Returns the names of the laws to compare by default: those of `[laws.NAME]`, or else every kind.
    #[must_use]
    pub fn compared_laws(&self) -> Vec<String> {
        let listed: Vec<_> = self.laws.iter().map(|(name, _)| name.clone()).collect();
        if listed.is_empty() { self.law_names() } else { listed }
    }

    /// Returns the law of `[laws.NAME]`; else that of the file, if its kind has this name; else the law of this kind
    /// with default keys. `NAME+shield` flies the law under the shield, `NAME+bare` without it.
    ///
    /// # Errors
    /// [`ScenarioError`] if no law has this name.
    pub fn law(&self, name: &str) -> Result<NamedLaw, ScenarioError> {
        let ending = SHIELD.into_iter().find_map(|(end, with)| Some((name.strip_suffix(end)?, with)));
        if let Some((name_of_law, with)) = ending {
            return Ok(NamedLaw { name: name.to_owned(), shield: Some(with), ..self.law(name_of_law)? });
        }
        let listed = self.laws.iter().find(|(listed, _)| listed == name).map(|(_, law)| law.clone());
        let own = || (kind(&self.own.law) == name).then(|| self.own.law.clone());
        let default = || LawSpec::all().into_iter().find(|law| kind(law) == name);
        let Some(law) = listed.or_else(own).or_else(default) else {
            let known = self.law_names();
            let known: Vec<_> = known.iter().map(String::as_str).collect();
            let help = format!("{}; give other names in tables [laws.NAME] of the scenario", suggest(name, &known));
            let problem = if name.is_empty() {
                "the name of a law is empty".to_owned()
            } else {
                format!("no law has the name `{name}`")
            };
            return Err(ErrorKind::UnknownChoice.at(&[], problem, help));
        };
        let law = law.complete(self.own.velocity_coefficient_per_s());
        Ok(NamedLaw { name: name.to_owned(), law, shield: None })
    }

    /// Returns the scenario under a law, from a drawn start.
    ///
    /// # Errors
    /// [`ScenarioError`] if that scenario is invalid, for example because two starts are within delta.
    pub fn scenario(&self, law: &NamedLaw, draw: Draw) -> Result<Scenario, ScenarioError> {
        let text = Text { name: &self.name, toml: &self.toml, overrides: &self.overrides };
        let mut document = self.document.clone();
        document.law.kind = law.law.clone();
        if let Some(enabled) = law.shield {
            document.shield = Some(ShieldSpec { enabled, ..document.shield.unwrap_or_default() });
        }
        document.start.seed = draw.seed;
        if self.flight_is_random() {
            document.noise.seed = draw.seed;
        }
        document.start.jitter_m = draw.jitter_m.unwrap_or(document.start.jitter_m);
        Ok(Scenario { external_law: self.own.external_law.clone(), ..finish(document, &text, Some(&self.own))? })
    }
}

fn is_random(document: &Document) -> bool {
    let StartTable { jitter_m, shuffle, .. } = document.start;
    shuffle || jitter_m != 0.0 || matches!(document.start.shape, Some(StartShape::Random { .. }))
}

/// Tables `[laws.NAME]` by name.
pub(super) type Laws = BTreeMap<String, OtherLaw>;

/// Law of `[laws.NAME]`, which only `tautline compare` flies: the keys of its kind.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct OtherLaw {
    #[schemars(flatten)]
    pub(super) kind: LawSpec,
}

/// Returns the name of the kind of a law, as in `law.kind`.
pub(super) fn kind(law: &LawSpec) -> String {
    keys(law).0
}

/// Returns the overrides that select a law in any scenario: one for its kind and one for each key.
pub(super) fn law_overrides(law: &LawSpec) -> Vec<String> {
    let (kind, keys) = keys(law);
    let of_kind = format!("law.kind={kind}");
    std::iter::once(of_kind).chain(keys.iter().map(|(key, value)| format!("law.{key}={value}"))).collect()
}

/// Returns the kind of a law and its keys.
fn keys(law: &LawSpec) -> (String, Table) {
    // A law serializes to a table with one entry: its kind, with the keys as value.
    let choice = Table::try_from(law).unwrap_or_default().into_iter().next();
    choice.map_or_else(Default::default, |(kind, keys)| match keys {
        Value::Table(keys) => (kind, keys),
        _ => (kind, Table::new()),
    })
}

/// Checks all laws of a file.
pub(super) fn check_laws(laws: &Laws) -> Result<(), ScenarioError> {
    let kinds: Vec<_> = LawSpec::all().iter().map(kind).collect();
    for (name, OtherLaw { kind: law }) in laws {
        check_name("the name of a law", name, &format!("laws.{name}"))?;
        let kind = kind(law);
        if *name != kind && kinds.contains(name) {
            let problem = format!("the law {name} has the name of a kind, but is of the kind {kind}");
            let help = "give it a name that is not a kind of law";
            return Err(ErrorKind::Name.at(&[&format!("laws.{name}.kind")], problem, help));
        }
    }
    Ok(())
}
