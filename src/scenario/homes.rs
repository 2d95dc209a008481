//! Where a key belongs that was written somewhere else, as the JSON Schema says it.

use serde_json::Value;

use super::file::schema;

/// The places of the scenario file that have a key of this name: `[swarm]`, or `[law]` with `kind = "laplacian"`.
pub(super) fn homes(name: &str) -> Vec<String> {
    let schema = schema();
    let Some(tables) = schema["properties"].as_object() else { return Vec::new() };
    let mut homes = Vec::new();
    for (table, place) in tables {
        let definition = place["$ref"].as_str().and_then(|path| schema.pointer(path.trim_start_matches('#')));
        if let Some(definition) = definition {
            collect(definition, name, table, &mut homes);
        }
    }
    homes
}

/// Adds the homes in a table, or in one of its choices.
fn collect(definition: &Value, name: &str, table: &str, homes: &mut Vec<String>) {
    if definition["properties"].get(name).is_some() {
        homes.push(format!("[{table}]{}", chosen(&definition["properties"])));
    }
    let alternatives = ["oneOf", "anyOf"].iter().filter_map(|of| definition[of].as_array()).flatten();
    for alternative in alternatives {
        collect(alternative, name, table, homes);
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
    fn a_key_is_found_in_its_table_and_in_each_choice_that_has_it() {
        assert_eq!(homes("count"), ["[swarm]"]);
        assert_eq!(homes("alpha"), ["[law] with kind = \"edge-tension\""]);
        assert_eq!(homes("half_extent_m"), ["[start] with shape = \"random\""]);
        assert_eq!(homes("spacing_m").len(), 4);
        assert_eq!(homes("nowhere"), [] as [&str; 0]);
    }
}
