//! The schema of the scenario file says what its reader does.

use tautline_sim::scenario::{self, Override, Scenario, Source};

use super::scenario_files::RIGHT;

#[test]
fn the_schema_describes_every_key_and_refuses_null() {
    let schema = scenario::schema();
    let text = schema.to_string();
    for key in ["delta_m", "hull_radius_m", "max_halvings", "min_separation_m", "points_m", "disagreement_m_s", "edges"]
    {
        assert!(text.contains(&format!("\"{key}\":")), "{key}");
    }
    assert!(text.contains("\"default\":0.004166666666666667") && text.contains("\"const\":\"edge-tension\""));
    let default = |of: &str| &schema.pointer(of).expect("a key")["default"];
    assert_eq!(default("/$defs/TimeTable/properties/max_rate_dt"), 0.3);
    assert_eq!(default("/$defs/NetworkSpec/properties/missing"), "hold");
    assert_eq!(default("/$defs/NetworkSpec/properties/near"), "seen");
    assert!(!text.contains("null") && !text.contains("\\["), "{schema:#}");
    assert_eq!(schema["required"], serde_json::json!(["start", "formation", "law", "time"]));
    assert!(described(&schema["properties"]));
    assert!(schema["$defs"].as_object().is_some_and(|defs| defs.values().all(|def| described(&def["properties"]))));
}

#[test]
fn the_schema_bounds_a_number_where_the_reader_does() {
    let schema = scenario::schema();
    let mut bounded = 0;
    for (table, place) in schema["properties"].as_object().expect("tables") {
        let Some(of) = place["$ref"].as_str().filter(|_| place["deprecated"] != true) else { continue };
        let definition = schema.pointer(of.trim_start_matches('#')).expect("a definition");
        let listed = ["oneOf", "anyOf"].iter().filter_map(|of| definition[of].as_array()).flatten();
        for alternative in listed.chain([&serde_json::json!({})]) {
            let keys = |of: &str| -> Vec<(String, serde_json::Value)> {
                let maps = [definition, alternative].map(|of_table| of_table[of].as_object().cloned());
                maps.into_iter().flatten().flatten().collect()
            };
            let required = |key: &str| {
                let lists = [definition, alternative].map(|of| of["required"].as_array().cloned());
                lists.into_iter().flatten().flatten().any(|needed| needed == key)
            };
            let properties = keys("properties");
            // Files are looked for, and lists read, before numbers are.
            if alternative["deprecated"] == true {
                continue;
            }
            let is_read_first = |(key, value): &(String, serde_json::Value)| {
                value["const"] == "file" || (required(key) && value["type"] == "array")
            };
            if properties.iter().any(is_read_first) {
                continue;
            }
            let of_numbers: Vec<_> = properties.iter().filter(|(_, value)| value["type"] == "number").collect();
            for (key, property) in &of_numbers {
                let others = properties
                    .iter()
                    .filter(|(other, value)| other != key && (required(other) || value["const"].is_string()));
                let others = others.map(|(other, value)| match value["const"].as_str() {
                    Some(choice) => format!(", {other} = \"{choice}\""),
                    None if value["type"] == "string" => format!(", {other} = \"A\""),
                    None => format!(", {other} = 3.0"),
                });
                let mut others: String = others.collect();
                if table == "start" && !others.contains("shape") {
                    others += ", shape = \"line\", spacing_m = 4.0";
                }
                if table == "formation" && !others.contains("shape") {
                    others += ", shape = \"circle\", radius_m = 4.0";
                }
                let refuses = |number: &str| {
                    let start = "start={shape=\"line\", spacing_m=4}".to_owned();
                    let set = format!("{table}={{{key} = {number}{others}}}");
                    let sets = ["swarm.count=5".to_owned(), start, set];
                    let sets =
                        sets.iter().map(|set| Override::parse(set)).collect::<Result<Vec<_>, _>>().expect("TOML");
                    let source = Source::Text { name: "f".to_owned(), text: RIGHT.to_owned() };
                    let said = Scenario::read(&source, &sets).err().map(|error| error.message().to_owned());
                    said.is_some_and(|said| said.contains(&format!(" is {number}")))
                };
                let (minimum, above) = (&property["minimum"], &property["exclusiveMinimum"]);
                assert_eq!(refuses("-1"), minimum == 0 || above == 0, "{table}.{key}{others}");
                assert_eq!(refuses("0"), above == 0, "{table}.{key}{others}");
                bounded += usize::from(minimum == 0 || above == 0);
            }
        }
    }
    assert!(bounded > 20, "{bounded} numbers are bounded");
    assert_eq!(schema["$defs"]["PerVehicle"]["anyOf"][0]["exclusiveMinimum"], 0);
    assert_eq!(schema["not"]["anyOf"], serde_json::json!([{ "required": ["arrival", "judge"] }]));
}

/// Whether every key of a table has a description.
fn described(properties: &serde_json::Value) -> bool {
    properties.as_object().is_none_or(|keys| keys.values().all(|key| key["description"].is_string()))
}

#[test]
fn the_schema_knows_every_other_name_and_asks_for_none() {
    let schema = scenario::schema();
    let of = |path: &str| schema.pointer(path).unwrap_or(&serde_json::Value::Null).clone();
    let keys = [("Breathing", "when"), ("FormationTable", "offset_m"), ("LegTable", "offset_m"), ("LegTable", "start")];
    for (table, key) in keys {
        assert_eq!(of(&format!("/$defs/{table}/properties/{key}/deprecated")), true, "{table}.{key}");
    }
    assert_eq!(of("/$defs/LegTable/required"), serde_json::Value::Null);
    let text = schema.to_string();
    for word in ["ring", "mask", "points-file", "waypoints", "stalled", "always", "never"] {
        assert!(text.contains(&format!("\"const\":\"{word}\"")), "{word}");
    }
    let both = serde_json::json!({ "anyOf": [{ "required": ["mode", "when"] }] });
    assert_eq!(of("/$defs/Breathing/not"), both);
}
