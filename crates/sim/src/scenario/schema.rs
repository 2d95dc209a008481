//! The JSON Schema of the scenario file, and where a key belongs as it says.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::document::{DEFAULT_KINDS, Document};
use super::overrides::OTHER_NAMES;
use tautline_laws::law::LawSpec;

/// Keys, of any table, whose number is positive.
const POSITIVE: [&str; 18] = [
    "delta_m",
    "disagreement_m_s",
    "dt_s",
    "duration_s",
    "edge_error_m",
    "half_extent_m",
    "height_m",
    "min_separation_m",
    "PerVehicle",
    "pitch_m",
    "radius_m",
    "range_m",
    "record_hz",
    "scale",
    "side_m",
    "spacing_m",
    "turns",
    "width_m",
];
/// Keys, of any table, whose number is 0 or positive.
const FROM_ZERO: [&str; 3] = ["hold_s", "jitter_m", "margin_m"];

/// Definitions, the key of theirs that holds a choice, choices and other names of these.
const OTHER_CHOICES: [(&str, &str, &str, &str); 10] = [
    ("FormationTable", "shape", "circle", "ring"),
    ("FormationTable", "shape", "image", "mask"),
    ("FormationTable", "shape", "file", "points-file"),
    ("LegTable", "shape", "circle", "ring"),
    ("LegTable", "shape", "image", "mask"),
    ("LegTable", "shape", "file", "points-file"),
    ("ReferenceTable", "kind", "way-points", "waypoints"),
    ("BreathingMode", "", "auto", "stalled"),
    ("BreathingMode", "", "start", "always"),
    ("BreathingMode", "", "off", "never"),
];

/// The JSON Schema of the scenario file, with descriptions, units, bounds and defaults.
#[must_use]
pub fn schema() -> Value {
    let mut schema = schemars::schema_for!(Document).to_value();
    let gains = LawSpec::all().into_iter().flat_map(|law| law.complete(0.0).gains());
    let gains = gains.map(|gain| (gain.key.trim_start_matches("law."), gain.may_be_zero));
    let bounds = POSITIVE.map(|key| (key, false)).into_iter().chain(FROM_ZERO.map(|key| (key, true))).chain(gains);
    tidy(&mut schema, &bounds.collect());
    for (table, other, name) in OTHER_NAMES {
        let of = match table {
            None => &mut schema,
            Some("formation") => &mut schema["$defs"]["FormationTable"],
            Some("leg") => &mut schema["$defs"]["LegTable"],
            Some(_) => &mut schema["$defs"]["Breathing"],
        };
        add_name(of, name, other);
    }
    for (definition, tag, name, other) in OTHER_CHOICES {
        add_choice(&mut schema["$defs"][definition], tag, name, other);
    }
    for (table, (_, default)) in ["LawTable", "ReferenceTable"].into_iter().zip(DEFAULT_KINDS) {
        for kind in schema["$defs"][table]["oneOf"].as_array_mut().into_iter().flatten() {
            if kind["properties"]["kind"]["const"] == default {
                kind["required"] = json!([]);
            }
        }
    }
    // The name of `[laws.NAME]` stands for a kind that is not given.
    if let Some(law) = schema["$defs"]["OtherLaw"].as_object_mut()
        && let Some(mut kinds) = law.remove("oneOf")
    {
        kinds.as_array_mut().into_iter().flatten().for_each(|kind| kind["required"] = json!([]));
        law.insert("anyOf".to_owned(), kinds);
    }
    schema
}

/// Another name of a key, which is not given beside it.
fn add_name(table: &mut Value, name: &str, other: &str) {
    let Some(mut key) = table["properties"].get(name).cloned() else { return };
    key["deprecated"] = true.into();
    key["description"] = format!("Another name of `{name}`.").into();
    table["properties"][other] = key;
    let both = json!({ "required": [name, other] });
    match table.pointer_mut("/not/anyOf").and_then(Value::as_array_mut) {
        Some(refused) => refused.push(both),
        None => table["not"] = json!({ "anyOf": [both] }),
    }
}

/// Another name of a choice: a choice like it.
fn add_choice(value: &mut Value, tag: &str, name: &str, other: &str) {
    for alternative in value.get_mut("anyOf").and_then(Value::as_array_mut).into_iter().flatten() {
        add_choice(alternative, tag, name, other);
    }
    let Some(choices) = value.get_mut("oneOf").and_then(Value::as_array_mut) else { return };
    let word = if tag.is_empty() { "/const".to_owned() } else { format!("/properties/{tag}/const") };
    let is_it = |choice: &&mut Value| choice.pointer(&word).is_some_and(|word| word == name);
    let Some(choice) = choices.iter_mut().find(is_it) else { return };
    let mut another = choice.clone();
    if let Some(Value::String(description)) = choice.get_mut("description") {
        *description = format!("{description} `{other}` is another name of it.");
    }
    if let Some(word) = another.pointer_mut(&word) {
        *word = other.into();
    }
    another["deprecated"] = true.into();
    another["description"] = format!("Another name of `{name}`.").into();
    choices.push(another);
}

/// TOML has no null: a key that may be left out has the type that it has when it is there. The defaults of a table stand
/// at its keys, and so do bounds: whether a number may be 0.
fn tidy(schema: &mut Value, bounds: &BTreeMap<&str, bool>) {
    match schema {
        Value::Object(object) => {
            object.retain(|key, value| key != "default" || !(value.is_null() || value.is_object()));
            for (key, value) in object {
                match value {
                    Value::Array(types) if key == "type" => {
                        types.retain(|name| name != "null");
                        if let [only] = &mut types[..] {
                            *value = only.take();
                        }
                    }
                    _ => tidy(value, bounds),
                }
                if let Some(&may_be_zero) = bounds.get(key.as_str()) {
                    bound(value, if may_be_zero { "minimum" } else { "exclusiveMinimum" });
                }
            }
        }
        Value::Array(list) => list.iter_mut().for_each(|value| tidy(value, bounds)),
        _ => {}
    }
}

/// Sets 0 as the bound of a number, or of those within.
fn bound(schema: &mut Value, bound: &str) {
    match schema {
        Value::Object(object) if object.get("type").is_some_and(|of| of == "number") => {
            object.insert(bound.to_owned(), 0.into());
        }
        // The least whole number that is more than 0 is 1.
        Value::Object(object) if object.get("type").is_some_and(|of| of == "integer") => {
            object.insert("minimum".to_owned(), u8::from(bound != "minimum").into());
        }
        Value::Object(object) => object.values_mut().for_each(|value| self::bound(value, bound)),
        Value::Array(list) => list.iter_mut().for_each(|value| self::bound(value, bound)),
        _ => {}
    }
}

/// The tables of the scenario file that have a key of this name: `[swarm]`, or `[law] with kind = "laplacian"`.
pub(super) fn tables_with(key: &str) -> Vec<String> {
    let schema = schema();
    let Some(tables) = schema["properties"].as_object() else { return Vec::new() };
    let mut found = Vec::new();
    for (table, place) in tables.iter().filter(|(_, place)| place["deprecated"] != true) {
        let definition = place["$ref"].as_str().and_then(|path| schema.pointer(path.trim_start_matches('#')));
        if let Some(definition) = definition {
            collect(definition, key, table, &mut found);
        }
    }
    found
}

/// Adds the places of a key in a table, or in one of its choices.
fn collect(definition: &Value, key: &str, table: &str, found: &mut Vec<String>) {
    if definition["properties"].get(key).is_some_and(|key| key["deprecated"] != true) {
        found.push(format!("[{table}]{}", chosen(&definition["properties"])));
    }
    let alternatives = ["oneOf", "anyOf"].iter().filter_map(|of| definition[of].as_array()).flatten();
    for alternative in alternatives.filter(|alternative| alternative["deprecated"] != true) {
        collect(alternative, key, table, found);
    }
}

/// The choice that these keys belong to, if they belong to one.
fn chosen(keys: &Value) -> String {
    let choice = keys.as_object().into_iter().flatten().find_map(|(key, value)| Some((key, value["const"].as_str()?)));
    choice.map_or_else(String::new, |(key, value)| format!(" with {key} = \"{value}\""))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_more_than_0_is_bounded_by_0_and_what_is_counted_by_1() {
        let schema = schema();
        let mut law = schema["$defs"]["LawTable"]["oneOf"].as_array().into_iter().flatten();
        let orca = law.find(|law| law["properties"]["kind"]["const"] == "orca").expect("orca");
        let key = |name: &str| {
            let keys =
                orca["$ref"].as_str().map_or(orca, |path| &schema["$defs"][path.rsplit('/').next().expect("a name")]);
            keys["properties"][name].clone()
        };
        assert_eq!((&key("neighbours_max")["minimum"], &key("speed_m_s")["exclusiveMinimum"]), (&json!(1), &json!(0)));
        assert_eq!((&key("margin_m")["minimum"], &key("margin_m")["exclusiveMinimum"]), (&json!(0), &Value::Null));
    }

    #[test]
    fn a_key_is_found_in_its_table_and_in_each_choice_that_has_it() {
        assert_eq!(tables_with("count"), ["[swarm]"]);
        assert_eq!(tables_with("alpha"), ["[law] with kind = \"edge-tension\"", "[law] with kind = \"displacement\""]);
        assert_eq!(tables_with("half_extent_m"), ["[start] with shape = \"random\""]);
        assert_eq!(tables_with("spacing_m").len(), 13);
        assert_eq!(tables_with("nowhere"), [] as [&str; 0]);
    }
}
