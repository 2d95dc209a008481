//! Random scenarios from the schema: what reading accepts can be written, read back and flown, and what cannot be
//! flown is refused with its key.

use std::panic::{AssertUnwindSafe, catch_unwind};

use serde_json::Value as Schema;
use tautline_sim::preflight::Preflight;
use tautline_sim::scenario::{self, Scenario, ScenarioError, Source, builtin};
use tautline_sim::sim::{Components, Simulation};
use toml::{Table, Value};

use super::numbers::Numbers;

/// Longest message that is read at a glance \[characters\].
const LONGEST_MESSAGE: usize = 500;

/// Most vehicles of a scenario that is flown.
const MOST_FLOWN: usize = 40;

/// Number of steps that are flown.
const STEPS: u32 = 3;

/// Generates values of a schema.
struct Generator<'a> {
    file: &'a Schema,
    numbers: Numbers,
}

impl<'a> Generator<'a> {
    fn chance(&mut self, share: f64) -> bool {
        self.numbers.unit() < share
    }

    fn pick<T: Clone>(&mut self, values: &[T]) -> T {
        values[self.numbers.below(values.len())].clone()
    }

    fn resolved(&self, schema: &'a Schema) -> &'a Schema {
        let target = schema["$ref"].as_str().and_then(|path| self.file.pointer(path.trim_start_matches('#')));
        target.map_or(schema, |target| self.resolved(target))
    }

    fn alternatives(schema: &'a Schema) -> impl Iterator<Item = &'a Schema> {
        let lists = ["oneOf", "anyOf"].into_iter().filter_map(|list| schema[list].as_array()).flatten();
        lists.filter(|part| part.as_object().is_some_and(|part| !part.is_empty()))
    }

    /// Returns a value of a schema; `key` is its name.
    fn value(&mut self, key: &str, part: &'a Schema) -> Value {
        let schema = self.resolved(part);
        if let Some(word) = schema["const"].as_str() {
            return Value::String(word.to_owned());
        }
        if schema["properties"].is_object() {
            return Value::Table(self.table(schema));
        }
        let alternatives: Vec<_> = Self::alternatives(schema).collect();
        if !alternatives.is_empty() {
            let chosen = self.pick(&alternatives);
            return self.value(key, chosen);
        }
        match schema["type"].as_str() {
            Some("number") => Value::Float(self.number(part, schema)),
            Some("integer") => Value::Integer(self.integer(key, schema)),
            Some("boolean") => Value::Boolean(self.chance(0.5)),
            Some("array") => {
                let bound = |name: &str| schema[name].as_u64().and_then(|bound| usize::try_from(bound).ok());
                let least = bound("minItems").unwrap_or(0);
                let most = bound("maxItems").unwrap_or(least + 4);
                let length = if self.chance(0.03) { most + 1 } else { least + self.numbers.below(most - least + 1) };
                Value::Array((0..length).map(|_| self.value(key, &schema["items"])).collect())
            }
            Some("object") => Value::Table(self.table(schema)),
            _ => Value::String(
                self.pick(&["a", "V", "", "no-such-file.csv", "crazyflie", "hummingbird", "M0 0L9 9"]).to_owned(),
            ),
        }
    }

    /// Returns a table with the required keys, some of the others, and the keys of one of its choices.
    fn table(&mut self, schema: &'a Schema) -> Table {
        let mut table = Table::new();
        let tagged: Vec<_> = Self::alternatives(schema).map(|part| self.resolved(part)).collect();
        let chosen = (!tagged.is_empty()).then(|| self.pick(&tagged));
        for part in std::iter::once(schema).chain(chosen) {
            let is_required =
                |key: &str| part["required"].as_array().is_some_and(|list| list.iter().any(|of| of == key));
            for (key, child) in part["properties"].as_object().into_iter().flatten() {
                let is_tag = child["const"].is_string();
                if is_tag || is_required(key) || self.chance(0.3) {
                    let value = self.value(key, child);
                    table.insert(key.clone(), value);
                }
            }
        }
        table
    }

    /// Returns a number near the default, within the bounds, at a bound, or beyond it.
    fn number(&mut self, part: &Schema, schema: &Schema) -> f64 {
        let keyword = |name: &str| part[name].as_f64().or(schema[name].as_f64());
        let least = keyword("exclusiveMinimum").or(keyword("minimum"));
        let most = keyword("maximum");
        if self.chance(0.12) {
            let bounds =
                [least, most].into_iter().flatten().flat_map(|bound| [bound, bound.next_up(), bound.next_down()]);
            let extremes = [
                0.0,
                -0.0,
                -1.0,
                -0.5,
                1e-9,
                1e-10,
                -1e-9,
                1e9,
                1e9_f64.next_up(),
                -1e9,
                1e300,
                -1e300,
                1e-300,
                f64::NAN,
                f64::INFINITY,
                f64::NEG_INFINITY,
            ];
            let values: Vec<f64> = bounds.chain(extremes).collect();
            return self.pick(&values);
        }
        let size = match keyword("default").filter(|default| *default != 0.0) {
            Some(default) => default.abs() * self.numbers.over_decades(0.3, 3.0),
            None => self.numbers.over_decades(0.02, 20.0),
        };
        match (least, most) {
            (Some(least), Some(most)) => self.numbers.between(least, most),
            (Some(least), None) => least + size,
            _ if self.chance(0.3) => -size,
            _ => size,
        }
    }

    fn integer(&mut self, key: &str, schema: &Schema) -> i64 {
        let least = schema["minimum"].as_i64().unwrap_or(0);
        if self.chance(0.05) {
            return self.pick(&[least - 1, -1, 0, 1_000_000_000_000, i64::MAX, i64::MIN]);
        }
        let most = schema["maximum"].as_i64().unwrap_or(if key == "seed" { 1 << 40 } else { 7 });
        least + i64::try_from(self.numbers.below(usize::try_from(most - least + 1).unwrap_or(1))).unwrap_or(0)
    }
}

/// Replaces a table or a key of a scenario by a random one.
fn mutate(generator: &mut Generator<'_>, scenario: &mut Table) {
    let file = generator.file;
    let tables: Vec<_> = file["properties"].as_object().into_iter().flatten().collect();
    let (name, part) = generator.pick(&tables);
    let schema = generator.resolved(part);
    let replaces = generator.chance(0.4) || !scenario.get(name).is_some_and(Value::is_table);
    if replaces {
        let value = generator.value(name, part);
        scenario.insert(name.clone(), value);
        return;
    }
    let Some(table) = scenario.get_mut(name).and_then(Value::as_table_mut) else { return };
    let parts = Generator::alternatives(schema).map(|part| generator.resolved(part));
    let applies = |part: &&Schema| {
        let tag = part["properties"].as_object().into_iter().flatten().find(|(_, child)| child["const"].is_string());
        tag.is_none_or(|(key, child)| table.get(key).is_none_or(|value| value.as_str() == child["const"].as_str()))
    };
    let chosen: Vec<_> = parts.filter(applies).collect();
    let keys: Vec<_> = std::iter::once(schema)
        .chain(chosen)
        .flat_map(|part| part["properties"].as_object().into_iter().flatten())
        .filter(|(_, child)| !child["const"].is_string())
        .collect();
    if let Some((key, child)) = (!keys.is_empty()).then(|| generator.pick(&keys)) {
        let value = generator.value(key, child);
        table.insert(key.clone(), value);
    }
}

/// Returns the text of a random scenario.
fn text(seed: u64, schema: &Schema) -> String {
    let mut generator = Generator { file: schema, numbers: Numbers(seed.wrapping_mul(0xd134_2543_de82_ef95)) };
    let built_ins: Vec<_> = builtin::all().iter().filter(|built_in| built_in.toml.len() < 20_000).collect();
    let base = generator.pick(&built_ins).toml;
    let mut scenario: Table = base.parse().expect("a built-in scenario is TOML");
    for _ in 0..=generator.numbers.below(4) {
        mutate(&mut generator, &mut scenario);
    }
    toml::to_string(&scenario).expect("every table is TOML")
}

fn read(toml: &str) -> Result<Scenario, ScenarioError> {
    Scenario::read(&Source::Text { name: "random.toml".to_owned(), text: toml.to_owned() }, &[])
}

/// Returns the fault of a refusal: a missing place, key or remedy, or a long message.
fn fault_of_refusal(error: &ScenarioError, paths: &[String]) -> Option<String> {
    let shown = error.to_string();
    let is_key = |key: &str| {
        let table = [format!("{key}."), format!("{key}.1.")];
        // The model of a vehicle is one path, but may be a table.
        let is_within = |path: &String| key.strip_prefix(path.as_str()).is_some_and(|rest| rest.starts_with('.'));
        paths.iter().any(|path| path == key || is_within(path) || table.iter().any(|table| path.starts_with(table)))
    };
    // Entries of lists of tables have the number 1 in paths.
    let first_entries = |key: &str| {
        let parts = key.split('.').map(|part| if part.parse::<u64>().is_ok() { "1" } else { part });
        parts.collect::<Vec<_>>().join(".")
    };
    let unknown = error.keys.first().filter(|key| !is_key(first_entries(key).trim_end_matches(".1")));
    if error.place.is_none() {
        return Some(format!("without a place: {shown}"));
    }
    if let Some(key) = unknown {
        return Some(format!("the key {key} does not exist: {shown}"));
    }
    if error.help.is_empty() {
        return Some(format!("without a remedy: {shown}"));
    }
    let is_long =
        error.message.chars().count() > LONGEST_MESSAGE || shown.split_whitespace().any(|word| word.len() > 60);
    is_long.then(|| format!("a long message: {shown}"))
}

/// Returns the fault of an accepted scenario: it cannot be written, read back, checked or flown.
fn fault_of_accepted(scenario: &Scenario) -> Option<String> {
    let written = scenario.resolved().toml;
    match read(&written) {
        Err(error) => return Some(format!("its own text is refused: {error}")),
        Ok(again) if again != *scenario => return Some("its own text is another scenario".to_owned()),
        Ok(_) => {}
    }
    if let Err(error) = scenario.validate() {
        return Some(format!("validation refuses it: {error}"));
    }
    let found = match Preflight::of(scenario) {
        Ok(found) => found,
        Err(error) => return Some(format!("the check fails: {error}")),
    };
    if found.text().contains("NaN") {
        return Some(format!("the check prints NaN: {}", found.text()));
    }
    if scenario.count() > MOST_FLOWN {
        return None;
    }
    let components = match Components::of(scenario) {
        Ok(components) => components,
        Err(error) => return Some(format!("no components: {error}")),
    };
    let mut simulation = match Simulation::with(scenario, components) {
        Ok(simulation) => simulation,
        Err(error) => return Some(format!("the flight is refused: {error}")),
    };
    if let (Some(ending), false) = (simulation.ending(), found.refuses()) {
        return Some(format!("READY, but the flight ends at its start: {:?}", ending.reason()));
    }
    (0..STEPS).for_each(|_| simulation.step());
    let _ = simulation.finish();
    None
}

/// Reads one random scenario. Returns whether it was accepted, and its fault.
fn judge(toml: &str, paths: &[String]) -> (bool, Option<String>) {
    match read(toml) {
        Err(error) => (false, fault_of_refusal(&error, paths)),
        Ok(scenario) => (true, fault_of_accepted(&scenario)),
    }
}

/// `TAUTLINE_RANDOM_SCENARIOS=A..B` reads the scenarios of these seeds.
#[test]
fn what_is_accepted_can_be_written_read_and_flown() {
    let (schema, paths) = (scenario::schema(), scenario::key_paths());
    let most = if std::env::var_os("TAUTLINE_LONG").is_some() { 20_000 } else { 300 };
    let given = std::env::var("TAUTLINE_RANDOM_SCENARIOS").ok();
    let range = given.and_then(|range| {
        let (from, to) = range.split_once("..")?;
        Some(from.parse().ok()?..to.parse().ok()?)
    });
    let (mut accepted, mut refused, mut faults) = (0, 0, Vec::new());
    for seed in range.unwrap_or(0..most) {
        let toml = text(seed, &schema);
        let judged = catch_unwind(AssertUnwindSafe(|| judge(&toml, &paths)));
        let (is_accepted, fault) = judged.unwrap_or_else(|_| (false, Some("a panic".to_owned())));
        accepted += u64::from(is_accepted);
        refused += u64::from(!is_accepted);
        faults.extend(fault.map(|fault| format!("seed {seed}: {fault}")));
    }
    println!("{accepted} accepted, {refused} refused, {} faults", faults.len());
    assert!(faults.is_empty(), "{} faults\n{}", faults.len(), faults.join("\n"));
    assert!(accepted > refused / 10 && refused > accepted / 10, "both kinds occur: {accepted} and {refused}");
}
