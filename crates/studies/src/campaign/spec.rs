//! Specification of a campaign: the keys of its TOML file, and their places for errors.

use std::collections::BTreeMap;
use std::ops::Range;

use serde::{Deserialize, Serialize};
use toml::de::{DeTable, DeValue};
use toml::{Table, Value};

use super::vary::Variation;
use crate::Criterion;
use crate::base::overlap;
use crate::splitting::SplittingSettings;
use tautline_report::request::Failure;
use tautline_sim::scenario::{Place, ScenarioError};

/// Source of overrides in errors of a scenario.
const SET: &str = "--set";
/// Forms of a variation.
const VARIATIONS: &str = "write \"run\" for a seed, or one of { uniform = [low, high] }, log_uniform, \
                          { normal = [mean, deviation] }, { integer = [low, high] }, { list = [...] }, \
                          { grid = [...] }, { grid = { from = 0.0, to = 1.0, count = 11 } }";

/// Names of distributions. A table in `[vary]` with one of these keys is a variation; any other table holds scenario
/// keys.
const DRAWS: [&str; 6] = ["uniform", "log_uniform", "normal", "integer", "list", "grid"];

/// Keys of a specification.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spec {
    /// Name of a built-in scenario, or the path of a file relative to the folder of the specification.
    pub scenario: String,
    /// Number of runs; by default one for each point of the grids.
    pub runs: Option<u64>,
    /// Seed of all random numbers.
    #[serde(default)]
    pub seed: u64,
    /// Laws that fly every run; by default the scenario's own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub laws: Vec<String>,
    /// Scenario keys with the same value in every run.
    #[serde(default, skip_serializing_if = "Table::is_empty")]
    pub set: Table,
    /// Scenario keys that differ from run to run.
    #[serde(default, skip_serializing_if = "Table::is_empty")]
    pub vary: Table,
    /// Rule for an early stop.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stop: Option<Stop>,
    /// Meaning of a run.
    #[serde(default, skip_serializing_if = "Method::is_flights")]
    pub method: Method,
    /// Settings of splitting.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub splitting: Option<SplittingSettings>,
    #[serde(skip)]
    source: Source,
}

/// Name and text of the file, for the places of errors.
#[derive(Clone, Debug, Default, PartialEq)]
struct Source {
    name: String,
    text: String,
}

/// Meaning of a run.
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
    #[expect(clippy::trivially_copy_pass_by_ref, reason = "required by serde")]
    fn is_flights(&self) -> bool {
        *self == Self::Flights
    }
}

/// Rule for an early stop, by intervals that hold at every look.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stop {
    /// Verdict whose share decides.
    #[serde(default)]
    pub of: Criterion,
    /// Stop when the interval of every law's share is at most this wide.
    pub width: Option<f64>,
    /// Stop when the interval of every law's share does not contain this share.
    pub decided: Option<f64>,
}

impl Spec {
    /// Reads the TOML of a specification. `name` is the source in messages.
    ///
    /// # Errors
    /// [`Failure`] `campaign/specification`, with its place.
    pub fn read(name: &str, text: &str) -> Result<Self, Failure> {
        let source = Source { name: name.to_owned(), text: text.to_owned() };
        let refused = |error: toml::de::Error| {
            let (problem, remedy) = in_words(error.message());
            let remedy = remedy.unwrap_or_else(|| "docs/campaigns.md shows every key of a specification".to_owned());
            let place = Place::new(name, text, error.span().unwrap_or_default());
            Failure::input("campaign/specification", problem, remedy).at(&place)
        };
        Ok(Self { source, ..toml::from_str(text).map_err(refused)? })
    }

    /// Returns the specification as TOML from which [`Spec::read`] reads the same keys.
    ///
    /// # Errors
    /// [`Failure`] for numbers that TOML cannot hold, such as a seed of 64 bits.
    pub fn to_toml(&self) -> Result<String, Failure> {
        toml::to_string(self).map_err(|error| refused(error.to_string(), "choose a seed below 2^63"))
    }

    /// Returns the keys of `[set]`, with the names of their tables before them.
    #[must_use]
    pub fn sets(&self) -> BTreeMap<String, Value> {
        let mut keys = BTreeMap::new();
        flatten("", &self.set, &|_| false, &mut keys);
        keys
    }

    /// Returns the keys of `[vary]`, with the names of their tables before them, in alphabetical order.
    ///
    /// # Errors
    /// [`Failure`] `campaign/variation`, with its place.
    pub fn variations(&self) -> Result<BTreeMap<String, Variation>, Failure> {
        let mut keys = BTreeMap::new();
        flatten("", &self.vary, &draws, &mut keys);
        let read = |(key, value): (String, Value)| match Variation::read(&value) {
            Ok(variation) => Ok((key, variation)),
            Err(problem) => {
                let failure = Failure::input("campaign/variation", format!("vary.{key}: {problem}"), VARIATIONS);
                Err(self.at(&format!("vary.{key}"), failure))
            }
        };
        keys.into_iter().map(read).collect()
    }

    /// Returns the failure with the place of a key, or else of its table; unchanged if the file has neither.
    pub(super) fn at(&self, key: &str, failure: Failure) -> Failure {
        self.at_first(&[key.to_owned()], failure)
    }

    /// Returns the failure of a key with its place.
    pub(super) fn refuse(&self, key: &str, problem: impl AsRef<str>, remedy: impl AsRef<str>) -> Failure {
        self.at(key, refused(problem, remedy))
    }

    /// Returns the error of a scenario that a key of the specification caused. The place is in the specification unless
    /// the error has a place in the scenario's own file. `situation` precedes the message if it is not empty.
    pub(super) fn scenario(&self, key: &str, situation: &str, error: ScenarioError) -> Failure {
        let is_varied = key.starts_with("vary.");
        let keys = match error.place() {
            Some(place) if place.source == SET && !is_varied => {
                let set = place.text.split('=').next().unwrap_or_default().trim();
                vec![format!("vary.{set}"), format!("set.{set}"), key.to_owned()]
            }
            Some(place) if place.source != SET && !is_varied => Vec::new(),
            _ => vec![key.to_owned()],
        };
        let failure = Failure::from(error);
        self.at_first(&keys, if situation.is_empty() { failure } else { failure.under(situation) })
    }

    fn at_first(&self, keys: &[String], failure: Failure) -> Failure {
        let Ok(parsed) = DeTable::parse(&self.source.text) else { return failure };
        let of_table = || {
            let tables = std::iter::successors(keys.first()?.rsplit_once('.'), |(table, _)| table.rsplit_once('.'));
            tables.into_iter().find_map(|(table, _)| find(parsed.get_ref(), table))
        };
        let span = keys.iter().find_map(|key| find(parsed.get_ref(), key)).or_else(of_table);
        match span {
            Some(span) => failure.at(&Place::new(&self.source.name, &self.source.text, span)),
            None => failure,
        }
    }
}

/// Returns the failure of a specification that makes no campaign.
pub(super) fn refused(problem: impl AsRef<str>, remedy: impl AsRef<str>) -> Failure {
    Failure::input("campaign/plan", problem, remedy)
}

/// Returns problem and remedy of a message of serde, in the words of scenario errors.
pub(super) fn in_words(message: &str) -> (String, Option<String>) {
    let message = message.trim_end();
    let (problem, expected) = message.split_once(", expected ").map_or((message, None), |(a, b)| (a, Some(b)));
    let words =
        [("unknown field", "unknown key"), ("missing field", "missing key"), ("unknown variant", "unknown choice")];
    let problem = words.iter().fold(problem.to_owned(), |text, (serde, ours)| text.replace(serde, ours));
    (problem, expected.map(|expected| format!("give {expected}")))
}

/// Returns the bytes of a key with the names of its tables before it; the tables may be nested or joined by dots.
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

/// Returns whether a table is a variation.
fn draws(table: &Table) -> bool {
    let mut keys = table.keys();
    matches!((keys.next(), keys.next()), (Some(word), None) if DRAWS.contains(&word.as_str()))
}

/// Collects the keys of nested tables, joined by dots: `[set.time] duration_s` is `[set] "time.duration_s"`.
fn flatten(above: &str, table: &Table, is_value: &dyn Fn(&Table) -> bool, keys: &mut BTreeMap<String, Value>) {
    for (name, value) in table {
        let key = if above.is_empty() { name.clone() } else { format!("{above}.{name}") };
        match value {
            Value::Table(below) if !below.is_empty() && !is_value(below) => flatten(&key, below, is_value, keys),
            value => drop(keys.insert(key, value.clone())),
        }
    }
}

impl Spec {
    /// Refuses numbers of `[stop]` that are not shares.
    pub(super) fn check_stop(&self) -> Result<(), Failure> {
        let Some(Stop { width, decided, .. }) = self.stop else { return Ok(()) };
        let is_share = |number: f64| number > 0.0 && number < 1.0;
        for (key, number) in [("stop.width", width), ("stop.decided", decided)] {
            if let Some(number) = number.filter(|&number| !is_share(number)) {
                let problem = format!("{key}: must be more than 0 and less than 1, got {number}");
                return Err(self.refuse(key, problem, "give a share such as 0.01"));
            }
        }
        if width.is_none() && decided.is_none() {
            let remedy = "give width or decided, or leave the table out";
            return Err(self.refuse("stop", "stop: neither width nor decided is given", remedy));
        }
        Ok(())
    }

    /// Refuses two keys if one contains the other, and a varied law if laws are named.
    pub(super) fn check_overlaps(
        &self,
        sets: &BTreeMap<String, Value>,
        variations: &BTreeMap<String, Variation>,
    ) -> Result<(), Failure> {
        let is_key = |key: &&String| key.split('.').all(|part| !part.is_empty() && part.chars().all(is_word));
        if let Some(key) = sets.keys().chain(variations.keys()).find(|key| !is_key(key)) {
            let place = format!("{}.{key}", if sets.contains_key(key) { "set" } else { "vary" });
            let remedy = "write the key as --set takes it: time.dt_s";
            return Err(self.refuse(&place, format!("{place}: not a key of a scenario"), remedy));
        }
        let all: Vec<_> = sets.keys().chain(variations.keys()).collect();
        for (k, key) in all.iter().enumerate().skip(sets.len()) {
            if let Some(other) = all[..k].iter().find(|other| overlap(key, other)) {
                let other_table = if sets.contains_key(*other) { "set" } else { "vary" };
                let problem = format!("vary.{key}: overlaps with {other_table}.{other}");
                let remedy = "a key either has one value or differs from run to run: leave one of the two out";
                return Err(self.refuse(&format!("vary.{key}"), problem, remedy));
            }
        }
        let is_law = |key: &&String| ["law", "law.kind"].contains(&key.as_str());
        match variations.keys().find(is_law) {
            Some(key) if !self.laws.is_empty() => {
                let problem = format!("vary.{key}: must not be given with `laws`");
                let remedy = "give `laws` to fly each of them from the same starts, or vary the law";
                Err(self.refuse(&format!("vary.{key}"), problem, remedy))
            }
            _ => Ok(()),
        }
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
    fn nested_keys_are_joined_and_a_written_spec_reads_back() {
        let spec = Spec::read("spec.toml", TEXT).expect("read");
        assert_eq!(spec.sets().keys().collect::<Vec<_>>(), ["law.delta_m", "time.duration_s"]);
        let variations = spec.variations().expect("variations");
        assert_eq!(variations.keys().collect::<Vec<_>>(), ["network.loss", "start.jitter_m", "start.seed"]);
        assert_eq!(variations["start.seed"], Variation::Seed {});
        assert_eq!(spec.stop.map(|stop| stop.of), Some(Criterion::Clear));
        let again = Spec::read("again", &spec.to_toml().expect("TOML")).expect("read");
        assert_eq!(Spec { source: spec.source.clone(), ..again }, spec);
    }

    #[test]
    fn errors_have_a_place_and_the_words_of_scenario_errors() {
        let refused = |text: &str| {
            let spec = Spec::read("spec.toml", text);
            spec.and_then(|spec| spec.variations().and(spec.check_stop())).expect_err(text).to_string()
        };
        for (text, expected) in [
            (
                "scenario = 'pentagon'\nruns = 10\nvery = 3\n",
                "spec.toml, line 3: unknown key `very` (give one of `scenario`",
            ),
            ("runs = 10", "spec.toml, line 1: missing key `scenario`"),
            ("scenario = 'p'\nmethod = 'split'", "line 2: unknown choice `split` (give `flights` or `splitting`)"),
            ("scenario = 'pentagon'\nruns = -1", "line 2: "),
            ("scenario = 'p'\n[vary]\nlaw.alpha = { unifrom = [0.0, 1.0] }", "line 3: vary.law.alpha.unifrom: "),
            ("scenario = 'p'\n[stop]\nwidth = 0", "line 3: stop.width: must be more than 0 and less than 1, got 0 "),
            (
                "scenario = 'p'\n[stop]\ndecided = 1",
                "line 3: stop.decided: must be more than 0 and less than 1, got 1 ",
            ),
            ("scenario = 'p'\n[stop]\nwidth = nan", "line 3: stop.width: "),
            ("scenario = 'p'\n[stop]", "line 2: stop: neither width nor decided is given"),
        ] {
            assert!(refused(text).contains(expected), "{}", refused(text));
        }
    }

    #[test]
    fn a_key_or_else_its_table_is_found_in_any_notation() {
        const KEYS: &str = "scenario = \"pentagon\"\nruns = 3\n[vary]\n\"start.jitter_m\" = 1\n\
                            law.alpha = { unifrom = [0, 1] }\n[vary.network]\n  loss = 2\n[stop]\nwidth = 3\n";
        let spec = Spec::read("spec.toml", KEYS).expect("read");
        let at = |key: &str| spec.refuse(key, "", "").place().map(|place| (place.line, place.column));
        assert_eq!(at("runs"), Some((2, 1)));
        assert_eq!(at("vary.start.jitter_m"), Some((4, 1)));
        assert_eq!(at("vary.law.alpha.unifrom"), Some((5, 15)));
        assert_eq!(at("vary.network.loss"), Some((7, 3)));
        assert_eq!(at("stop.width"), Some((9, 1)));
        assert_eq!(at("stop.decided"), Some((8, 2)), "its table");
        assert_eq!((at("laws"), at("")), (None, None));
    }
}
