//! Specification of a campaign: the keys of its TOML file, and their places for errors.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::de::{DeTable, DeValue};
use toml::{Spanned, Table, Value};

use super::vary::{BY_RUN, FORMS, Variation};
use crate::Criterion;
use crate::base::overlap;
use crate::splitting::SplittingSettings;
use tautline_core::failure::Failure;
use tautline_core::failure::Place;
use tautline_core::option::SET;
use tautline_sim::scenario::{ScenarioError, TomlSchema, edit_distance};

/// Names of distributions. A table in `[vary]` with these keys is a variation; any other table holds scenario keys.
const DRAWS: [&str; 6] = ["uniform", "log_uniform", "normal", "integer", "list", "grid"];

static SPEC: LazyLock<TomlSchema> = LazyLock::new(TomlSchema::of::<Spec>);
static VARIATION: LazyLock<TomlSchema> = LazyLock::new(TomlSchema::of::<Variation>);

/// Keys of a specification.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Spec {
    /// Name of a built-in scenario, or the path of a file relative to the folder of the specification.
    pub scenario: String,
    /// Number of runs; by default one for each point of the grids.
    #[schemars(range(min = 1))]
    pub runs: Option<u64>,
    /// Seed of all random numbers.
    #[serde(default)]
    pub seed: u64,
    /// Laws that fly every run; by default the scenario's own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub laws: Vec<String>,
    /// Scenario keys with the same value in every run.
    #[serde(default, skip_serializing_if = "Table::is_empty")]
    #[schemars(with = "BTreeMap<String, serde_json::Value>")]
    pub set: Table,
    /// Scenario keys that differ from run to run.
    #[serde(default, skip_serializing_if = "Table::is_empty")]
    #[schemars(with = "BTreeMap<String, serde_json::Value>")]
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
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
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
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
    /// [`Failure`] `campaign/specification` or `campaign/variation`, with its place.
    pub fn read(name: &str, text: &str) -> Result<Self, Failure> {
        let failed = |code, problem: &str, remedy: &str, span: Range<usize>| {
            Failure::input(code, problem, remedy).at(&Place::new(name, text, span))
        };
        let not_toml = |error: toml::de::Error| {
            let problem = format!("the text is not TOML: {}", error.message());
            let remedy = "a specification is `key = value` lines below `[table]` headers";
            failed("campaign/specification", &problem, remedy, error.span().unwrap_or_default())
        };
        let misfit = |code| {
            move |error: ScenarioError| {
                let failure = Failure::input(code, &error.message, &error.help);
                error.place.iter().fold(failure, |failure, place| failure.at(place))
            }
        };
        let locate = |span| Place::new(name, text, span);
        let table = DeTable::parse(text).map_err(not_toml)?.into_inner();
        let mut file = Spanned::new(0..0, DeValue::Table(table));
        SPEC.check("specification", &mut file, &locate).map_err(misfit("campaign/specification"))?;
        if let DeValue::Table(file) = file.get_mut()
            && let Some(DeValue::Table(vary)) = file.get_mut("vary").map(Spanned::get_mut)
        {
            check_variations("", vary, &locate).map_err(misfit("campaign/variation"))?;
        }
        let source = Source { name: name.to_owned(), text: text.to_owned() };
        // The schema admits only what serde reads. An error of serde is a defect of the schema.
        Ok(Self { source, ..toml::from_str(text).map_err(not_toml)? })
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
        flatten("", &self.vary, &|table| is_variation(table.keys().map(String::as_str)), &mut keys);
        let read = |(key, value): (String, Value)| match Variation::read(&value) {
            Ok(variation) => Ok((key, variation)),
            Err(problem) => {
                let failure = Failure::input("campaign/variation", format!("vary.{key}: {problem}"), FORMS);
                Err(self.at(&format!("vary.{key}"), failure))
            }
        };
        keys.into_iter().map(read).collect()
    }

    /// Returns the failure with the place of a key, or else of its table; unchanged if the file has neither.
    pub(super) fn at(&self, key: &str, failure: Failure) -> Failure {
        let Ok(parsed) = DeTable::parse(&self.source.text) else { return failure };
        let keys = std::iter::successors(Some(key), |key| Some(key.rsplit_once('.')?.0));
        let span = keys.into_iter().find_map(|key| Some(find(parsed.get_ref(), key)?.0));
        span.map_or(failure.clone(), |span| failure.at(&self.place(span)))
    }

    /// Returns the failure with the beginning of the file as its place, for a missing key.
    pub(super) fn at_beginning(&self, failure: Failure) -> Failure {
        failure.at(&self.place(0..0))
    }

    fn place(&self, span: Range<usize>) -> Place {
        Place::new(&self.source.name, &self.source.text, span)
    }

    /// Returns the failure of a key with its place.
    pub(super) fn refuse(&self, key: &str, problem: impl AsRef<str>, remedy: impl AsRef<str>) -> Failure {
        self.at(key, refused(problem, remedy))
    }

    /// Returns the error of a scenario that a key of the specification caused. The place is in the specification unless
    /// the error has a place in the scenario's own file. `situation` precedes the message if it is not empty.
    pub(super) fn scenario(&self, key: &str, situation: &str, error: ScenarioError) -> Failure {
        let place = error.place.clone();
        let failure = Failure::from(error);
        let failure = if situation.is_empty() { failure } else { failure.under(situation) };
        match place {
            Some(place) if place.source == SET.to_string() => match self.place_of_override(&place) {
                Some(place) => failure.at(&place),
                None => self.at(key, failure),
            },
            Some(_) if !key.starts_with("vary.") => failure,
            _ => self.at(key, failure),
        }
    }

    /// Returns the place in the specification of a place in an override `KEY=VALUE`.
    fn place_of_override(&self, place: &Place) -> Option<Place> {
        let parsed = DeTable::parse(&self.source.text).ok()?;
        let (key, _) = place.text.split_once('=')?;
        let table = |table: &str| Some((table.to_owned(), find(parsed.get_ref(), &format!("{table}.{key}"))?));
        let (table, (name, value)) = table("vary").or_else(|| table("set"))?;
        if place.span.start > key.len() {
            return Some(self.place(if table == "set" { value } else { name }));
        }
        // The key of the file that ends with the refused part, or that has the refused part within its quotes.
        let part = key.get(place.span.clone())?;
        let upto = find(parsed.get_ref(), &format!("{table}.{}", key.get(..place.span.end)?));
        let after = if upto.is_some() { 0 } else { key.len() - place.span.end };
        let whole = upto.map_or(name, |(name, _)| name);
        let written = self.source.text.get(whole.clone())?;
        let quote = written.len() - written.trim_end_matches(['"', '\'']).len();
        let end = whole.end.checked_sub(quote + after)?;
        let span = end.checked_sub(part.len())?..end;
        let is_part = self.source.text.get(span.clone()) == Some(part);
        Some(self.place(if is_part { span } else { whole }))
    }
}

/// Checks each variation of `[vary]`. `above` is the dotted key of the table.
fn check_variations(
    above: &str,
    table: &mut DeTable<'_>,
    locate: &dyn Fn(Range<usize>) -> Place,
) -> Result<(), ScenarioError> {
    for (name, value) in table.iter_mut() {
        let key = if above.is_empty() { name.get_ref().to_string() } else { format!("{above}.{}", name.get_ref()) };
        match value.get_mut() {
            DeValue::String(word) if word == BY_RUN => {}
            DeValue::Table(below) if !below.is_empty() && !is_variation(below.keys().map(|name| &**name.get_ref())) => {
                check_variations(&key, below, locate)?;
            }
            _ => VARIATION.check(&format!("vary.{key}"), value, locate)?,
        }
    }
    Ok(())
}

/// Returns the failure of a specification that makes no campaign.
pub(super) fn refused(problem: impl AsRef<str>, remedy: impl AsRef<str>) -> Failure {
    Failure::input("campaign/plan", problem, remedy)
}

/// Returns the bytes of a key with the names of its tables before it, and those of its value. Tables may be nested or
/// joined by dots; entries of lists are counted from 1.
fn find(table: &DeTable<'_>, key: &str) -> Option<(Range<usize>, Range<usize>)> {
    table.iter().find_map(|(name, value)| {
        let rest = key.strip_prefix(&**name.get_ref())?;
        match (rest.strip_prefix('.'), value.get_ref()) {
            (None, _) => rest.is_empty().then(|| (name.span(), value.span())),
            (Some(below), DeValue::Table(table)) => find(table, below),
            (Some(entry), DeValue::Array(list)) => {
                let value = list.get(entry.parse::<usize>().ok()?.checked_sub(1)?)?;
                Some((value.span(), value.span()))
            }
            (Some(_), _) => None,
        }
    })
}

/// Returns whether a table with these keys is a variation, also with a misspelt name of its distribution.
fn is_variation<'a>(keys: impl Iterator<Item = &'a str>) -> bool {
    let is_near = |key: &str| DRAWS.iter().any(|draw| edit_distance(key, draw) <= draw.len() / 3);
    let keys: Vec<_> = keys.collect();
    keys.iter().all(|key| DRAWS.contains(key)) || matches!(keys[..], [key] if is_near(key))
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
            let remedy = "write the key as words with dots between them, such as time.dt_s";
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
        assert_eq!(variations["start.seed"], Variation::Seed);
        assert_eq!(spec.stop.map(|stop| stop.of), Some(Criterion::Clear));
        let again = Spec::read("again", &spec.to_toml().expect("TOML")).expect("read");
        assert_eq!(Spec { source: spec.source.clone(), ..again }, spec);
    }

    #[test]
    fn errors_have_a_place_and_the_words_of_scenario_errors() {
        let serde = ["invalid", "untagged", "u64", "f64", "variant", "sequence"];
        let refused = |text: &str| {
            let spec = Spec::read("spec.toml", text);
            spec.and_then(|spec| spec.variations().and(spec.check_stop())).expect_err(text).to_string()
        };
        let vary = |value: &str| format!("scenario = 'p'\n[vary]\nlaw.alpha = {value}");
        for (text, expected) in [
            ("scenario = 'p'\nruns = 10\nvery = 3\n", "line 3: unknown key `very` (did you mean `vary`? Known here: "),
            ("runs = 10", "spec.toml, line 1: missing key `scenario` (`scenario` is text)"),
            ("scenario = ", "line 1: the text is not TOML: "),
            ("scenario = 'p'\nmethod = 'split'", "line 2: unknown choice `split` (did you mean `splitting`? "),
            (
                "scenario = 'p'\nmethod = ['splitting']",
                "`method` must be \"flights\" or \"splitting\", got a list of 1",
            ),
            ("scenario = 'p'\nruns = -1", "line 2: `runs` must be at least 1, got -1 (Number of runs; by default"),
            ("scenario = 'p'\nruns = 2.5", "line 2: `runs` must be a whole number, got 2.5 "),
            ("scenario = 'p'\nruns = 'ten'", "line 2: `runs` must be a whole number, got the text \"ten\" "),
            ("scenario = 3", "line 1: `scenario` must be text, got 3 (Name of a built-in scenario, or "),
            ("scenario = 'p'\nlaws = 'orca'", "line 2: `laws` must be a list of entries, got the text \"orca\" "),
            ("scenario = 'p'\nlaws = [\n'orca',\n1]", "line 4: `laws` must be text, got 1 "),
            ("scenario = 'p'\nset = 3", "line 2: `set` must be a table, got 3 (Scenario keys with the same value "),
            ("scenario = 'p'\nseed = -1", "line 2: `seed` must be at least 0, got -1 "),
            ("scenario = 'p'\n[stop]\nof = 'won'", "unknown choice `won` (known here: `clear`, `reached`, `pass`)"),
            ("scenario = 'p'\n[stop]\nwidth = 'small'", "line 3: `width` must be a number, got the text \"small\" "),
            ("scenario = 'p'\n[splitting]\nflight = 3", "unknown key `flight` (did you mean `flights`? "),
            ("scenario = 'p'\n[splitting]\nkill = -3", "line 3: `kill` must be at least 1, got -3 "),
            (&vary("3"), "line 3: `vary.law.alpha` must be a table, got 3 (write \"run\" for a seed, or one of { "),
            (&vary("'seed'"), "line 3: `vary.law.alpha` must be a table, got the text \"seed\" (write \"run\" "),
            (&vary("{ unifrom = [0.0, 1.0] }"), "line 3: unknown key `unifrom` (did you mean `uniform`? Known here: "),
            (&vary("{ uniform = [0.0] }"), "line 3: `uniform` must be a list of 2 numbers, got a list of 1 "),
            (&vary("{ uniform = '0..1' }"), "line 3: `uniform` must be a list of 2 numbers, got the text \"0..1\" "),
            (&vary("{ uniform = [0, 1], list = [2] }"), "line 3: `vary.law.alpha` must have one key, got 2 "),
            (
                &vary("{ uniform = [1, 0] }"),
                "vary.law.alpha: must be two finite numbers in increasing order, got 1 and ",
            ),
            (&vary("{ integer = [0.5, 2] }"), "line 3: `integer` must be a whole number, got 0.5 "),
            (&vary("{ grid = [] }"), "line 3: `grid` must be a list with at least one entry, got a list of 0 "),
            (&vary("{ list = [] }"), "line 3: `list` must be a list with at least one entry, got a list of 0 "),
            (&vary("{ grid = 3 }"), "line 3: `grid` must be a list with at least one entry or a table, got 3 "),
            (&vary("{ grid = { from = 0, to = 1, coutn = 3 } }"), "unknown key `coutn` (did you mean `count`? "),
            (&vary("{ grid = { from = 0, to = 1 } }"), "line 3: missing key `count` (`count` is a whole number)"),
            (&vary("{ grid = { from = 0, to = 1, count = -3 } }"), "`count` must be at least 2, got -3 (Number of"),
            (&vary("{ grid = { from = 'a', to = 1, count = 3 } }"), "`from` must be a number, got the text \"a\" "),
            ("scenario = 'p'\n[stop]\nwidth = 0", "line 3: stop.width: must be more than 0 and less than 1, got 0 "),
            (
                "scenario = 'p'\n[stop]\ndecided = 1",
                "line 3: stop.decided: must be more than 0 and less than 1, got 1 ",
            ),
            ("scenario = 'p'\n[stop]\nwidth = nan", "line 3: `width` must be a finite number, got nan "),
            ("scenario = 'p'\n[stop]", "line 2: stop: neither width nor decided is given"),
        ] {
            let said = refused(text);
            assert!(said.contains(expected), "{said}");
            assert!(!serde.iter().any(|word| said.contains(word)), "{said}");
        }
    }

    #[test]
    fn a_key_or_else_its_table_is_found_in_any_notation() {
        const KEYS: &str = "scenario = \"pentagon\"\nruns = 3\n[vary]\n\"start.jitter_m\" = \"run\"\n\
                            law.alpha = { list = [0, 1] }\n[vary.network]\n  loss = \"run\"\n[stop]\nwidth = 3\n";
        let spec = Spec::read("spec.toml", KEYS).expect("read");
        let place_of = |key: &str| spec.refuse(key, "", "").place().map(|place| (place.line, place.column));
        assert_eq!(place_of("runs"), Some((2, 1)));
        assert_eq!(place_of("vary.start.jitter_m"), Some((4, 1)));
        assert_eq!(place_of("vary.law.alpha.list"), Some((5, 15)));
        assert_eq!(place_of("vary.law.alpha.list.2"), Some((5, 26)));
        assert_eq!(place_of("vary.network.loss"), Some((7, 3)));
        assert_eq!(place_of("stop.width"), Some((9, 1)));
        assert_eq!(place_of("stop.decided"), Some((8, 2)), "its table");
        assert_eq!((place_of("laws"), place_of("")), (None, None));
    }
}
