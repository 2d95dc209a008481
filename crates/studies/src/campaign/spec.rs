//! What a campaign is asked to fly: the keys of its TOML file.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use super::error::CampaignError;
use super::vary::Variation;
use crate::Question;
use crate::splitting::Settings;

/// Words by which a table of `[vary]` says how it draws; another table holds keys of the scenario.
const DRAWS: [&str; 6] = ["uniform", "log_uniform", "normal", "integer", "list", "grid"];

/// The keys of a specification.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spec {
    /// Name of a built-in scenario, or the path of a file, from the folder of the specification.
    pub scenario: String,
    /// Number of runs; one for each point of the grids unless given.
    pub runs: Option<u64>,
    /// What all random numbers begin from.
    #[serde(default)]
    pub seed: u64,
    /// Laws, each of which flies every run; the scenario's own unless given.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub laws: Vec<String>,
    /// Keys of the scenario that are set in every run.
    #[serde(default, skip_serializing_if = "Table::is_empty")]
    pub set: Table,
    /// Keys of the scenario that differ from run to run.
    #[serde(default, skip_serializing_if = "Table::is_empty")]
    pub vary: Table,
    /// When enough has been flown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop: Option<Stop>,
    /// What a run is.
    #[serde(default, skip_serializing_if = "Method::is_flights")]
    pub method: Method,
    /// How many flights each estimate has.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub splitting: Option<SplittingKeys>,
}

/// What a run is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// A flight.
    #[default]
    Flights,
    /// An estimate of the probability of a violation, by adaptive multilevel splitting ([`crate::splitting`]).
    Splitting,
}

impl Method {
    #[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks so")]
    fn is_flights(&self) -> bool {
        *self == Self::Flights
    }
}

/// `[splitting]`: the numbers of an estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SplittingKeys {
    /// Flights at a time.
    pub flights: usize,
    /// At least so many are ended in a round.
    pub kill: usize,
    /// Most bad flights that are kept of each estimate.
    pub keep: usize,
}

impl Default for SplittingKeys {
    fn default() -> Self {
        let Settings { flights, kill, keep } = Settings::default();
        Self { flights, kill, keep }
    }
}

impl From<SplittingKeys> for Settings {
    fn from(keys: SplittingKeys) -> Self {
        Self { flights: keys.flights, kill: keys.kill, keep: keys.keep }
    }
}

/// When enough has been flown. What is decided is decided by intervals that hold at every look.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stop {
    /// Which share it is about.
    #[serde(default)]
    pub of: Question,
    /// Once the interval of every law's share is no wider than this.
    pub width: Option<f64>,
    /// Once every law's share is known to be above or below this.
    pub decided: Option<f64>,
}

impl Spec {
    /// Reads the TOML of a specification, which messages call `name`.
    ///
    /// # Errors
    /// [`CampaignError::Input`] for what is not TOML and for keys that there are not, with their place.
    pub fn read(name: &str, text: &str) -> Result<Self, CampaignError> {
        toml::from_str(text).map_err(|error| CampaignError::specification(name, error.to_string().trim_end()))
    }

    /// The specification as TOML that reads back as the same one.
    ///
    /// # Errors
    /// [`CampaignError::Input`] for numbers that TOML cannot hold, such as a seed of 64 bits.
    pub fn to_toml(&self) -> Result<String, CampaignError> {
        let wrong = |error: toml::ser::Error| CampaignError::plan(error.to_string(), "choose a seed below 2^63");
        toml::to_string(self).map_err(wrong)
    }

    /// The keys of `[set]`, with their tables' names before them.
    #[must_use]
    pub fn sets(&self) -> BTreeMap<String, Value> {
        let mut keys = BTreeMap::new();
        flatten("", &self.set, &|_| false, &mut keys);
        keys
    }

    /// The keys of `[vary]`, with their tables' names before them, in the order of the alphabet.
    ///
    /// # Errors
    /// [`CampaignError::Input`] for what is no variation.
    pub fn variations(&self) -> Result<BTreeMap<String, Variation>, CampaignError> {
        let mut keys = BTreeMap::new();
        flatten("", &self.vary, &draws, &mut keys);
        keys.into_iter().map(|(key, said)| Variation::read(&key, &said).map(|read| (key, read))).collect()
    }
}

/// Whether a table says how a value is drawn, and holds no keys of a scenario.
fn draws(table: &Table) -> bool {
    let mut keys = table.keys();
    matches!((keys.next(), keys.next()), (Some(word), None) if DRAWS.contains(&word.as_str()))
}

/// Keys of tables within tables, with dots between them: `[set.time] duration_s` is `[set] "time.duration_s"`.
fn flatten(above: &str, table: &Table, is_value: &dyn Fn(&Table) -> bool, keys: &mut BTreeMap<String, Value>) {
    for (name, value) in table {
        let key = if above.is_empty() { name.clone() } else { format!("{above}.{name}") };
        match value {
            Value::Table(below) if !below.is_empty() && !is_value(below) => flatten(&key, below, is_value, keys),
            value => drop(keys.insert(key, value.clone())),
        }
    }
}

impl Stop {
    /// Refuses numbers that no share can reach.
    ///
    /// # Errors
    /// [`CampaignError::Input`].
    pub fn check(&self) -> Result<(), CampaignError> {
        let inside = |number: f64| number > 0.0 && number < 1.0;
        for (key, number) in [("stop.width", self.width), ("stop.decided", self.decided)] {
            if let Some(number) = number.filter(|&number| !inside(number)) {
                return Err(CampaignError::plan(
                    format!("{key} = {number}"),
                    "it is a share: give a number between 0 and 1, such as 0.01",
                )
                .at(key));
            }
        }
        if self.width.is_none() && self.decided.is_none() {
            let help = "give width or decided, or leave the table out";
            return Err(CampaignError::plan("[stop] says nothing", help).at("stop"));
        }
        Ok(())
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"
        scenario = "pentagon"
        runs = 10
        laws = ["edge-tension", "displacement"]
        [set]
        "time.duration_s" = 50.0
        law.delta_m = 1.5
        [vary]
        "start.jitter_m" = { uniform = [0.0, 0.3] }
        start.seed = "run"
        [vary.network]
        loss = { grid = [0.0, 0.1] }
        [stop]
        width = 0.01
    "#;

    #[test]
    fn keys_of_tables_have_their_names_before_them_and_what_is_written_reads_back() {
        let spec = Spec::read("spec.toml", TEXT).expect("read");
        assert_eq!(spec.sets().keys().collect::<Vec<_>>(), ["law.delta_m", "time.duration_s"]);
        let variations = spec.variations().expect("variations");
        assert_eq!(variations.keys().collect::<Vec<_>>(), ["network.loss", "start.jitter_m", "start.seed"]);
        assert_eq!(variations["start.seed"], Variation::Seed {});
        assert_eq!(spec.stop.map(|stop| stop.of), Some(Question::Clear));
        let again = Spec::read("again", &spec.to_toml().expect("TOML")).expect("read");
        assert_eq!(again, spec);
    }

    #[test]
    fn what_is_wrong_is_told_with_its_place() {
        let refused = |text: &str| Spec::read("spec.toml", text).expect_err(text).to_string();
        let said = refused("scenario = 'pentagon'\nruns = 10\nvery = 3\n");
        assert!(said.contains("spec.toml") && said.contains("line 3") && said.contains("very"), "{said}");
        assert!(refused("runs = 10").contains("scenario"));
        assert!(refused("scenario = 'pentagon'\nruns = -1").contains("line 2"));
        let said =
            Spec::read("s", "scenario = 'p'\n[vary]\nlaw.alpha = { unifrom = [0.0, 1.0] }").expect("TOML").variations();
        assert!(said.expect_err("no variation").to_string().contains("law.alpha.unifrom"));
        for (width, decided) in [(Some(0.0), None), (None, Some(1.0)), (Some(f64::NAN), None), (None, None)] {
            assert!(Stop { of: Question::Clear, width, decided }.check().is_err());
        }
    }
}
