//! The JSON Schema of the scenario file: its keys, their types, bounds, defaults and units.
//!
//! The schema is generated from the types of `document` and their doc comments. [`check`](super::check) checks files
//! against the schema.

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::LazyLock;

use schemars::JsonSchema;
use serde_json::{Value, json};
use toml::Spanned;
use toml::de::DeValue;

use super::check::Check;
use super::document::Document;
use super::error::ScenarioError;
use tautline_core::failure::Place;

/// Tables with their default kind.
const DEFAULT_KINDS: [(&str, &str); 3] =
    [("LawTable", "edge-tension"), ("ReferenceTable", "rest"), ("SafetyTable", "ball")];

static SCHEMA: LazyLock<Value> = LazyLock::new(generate);

/// Returns the JSON Schema of the scenario file, with descriptions, units, bounds and defaults.
#[must_use]
pub fn schema() -> Value {
    SCHEMA.clone()
}

fn generate() -> Value {
    let mut schema = schemars::schema_for!(Document).to_value();
    tidy(&mut schema);
    for (table, default) in DEFAULT_KINDS {
        for kind in schema["$defs"][table]["oneOf"].as_array_mut().into_iter().flatten() {
            if ["kind", "shape"].iter().any(|tag| kind["properties"][tag]["const"] == default) {
                kind["required"] = json!([]);
            }
        }
    }
    // NAME of `[laws.NAME]` is the kind unless one is given.
    if let Some(law) = schema["$defs"]["OtherLaw"].as_object_mut()
        && let Some(mut kinds) = law.remove("oneOf")
    {
        kinds.as_array_mut().into_iter().flatten().for_each(|kind| kind["required"] = json!([]));
        law.insert("anyOf".to_owned(), kinds);
    }
    schema
}

/// Removes parts that TOML cannot express: null as a type and as a default, and defaults of whole tables.
fn tidy(schema: &mut Value) {
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
                    _ => tidy(value),
                }
            }
        }
        Value::Array(list) => list.iter_mut().for_each(tidy),
        _ => {}
    }
}

/// JSON Schema of the keys of a TOML file that is not a scenario.
#[derive(Debug)]
pub struct TomlSchema(Value);

impl TomlSchema {
    /// Returns the schema of a type. Its doc comments are the help of errors.
    #[must_use]
    pub fn of<T: JsonSchema>() -> Self {
        let mut schema = schemars::schema_for!(T).to_value();
        tidy(&mut schema);
        Self(schema)
    }

    /// Checks keys, types, words and bounds of a value. `key` is its name in messages, `locate` returns the place of a
    /// span.
    ///
    /// # Errors
    /// The first error.
    pub fn check(
        &'static self,
        key: &str,
        value: &mut Spanned<DeValue<'_>>,
        locate: &dyn Fn(Range<usize>) -> Place,
    ) -> Result<(), ScenarioError> {
        let file = Node::of_file(&self.0);
        Check { file, overridden_from: usize::MAX, locate: &|span| Some(locate(span)) }.value(value, file, key, None)
    }
}

/// A part of a schema, for one value of the file.
#[derive(Clone, Copy)]
pub(super) struct Node {
    /// Schema of the whole file.
    file: &'static Value,
    schema: &'static Value,
    /// Description of the key, if the part belongs to a key.
    description: Option<&'static str>,
}

impl Node {
    /// Returns the part for a whole scenario file.
    pub(super) fn root() -> Self {
        Self::of_file(&SCHEMA)
    }

    /// Returns the part for the whole file that a schema describes.
    fn of_file(file: &'static Value) -> Self {
        Self { file, schema: file, description: None }.resolve(file)
    }

    /// Returns the part that a reference points to. The description of the key precedes the description of its type.
    fn resolve(self, schema: &'static Value) -> Self {
        let description = schema["description"].as_str();
        let definition = schema["$ref"].as_str().and_then(|path| self.file.pointer(path.trim_start_matches('#')));
        definition.map_or(Self { schema, description, ..self }, |definition| {
            let resolved = self.resolve(definition);
            Self { description: description.or(resolved.description), ..resolved }
        })
    }

    /// Returns a part of the same key, with the description of the key.
    fn part(self, schema: &'static Value) -> Self {
        let part = self.resolve(schema);
        Self { description: self.description.or(part.description), ..part }
    }

    /// Returns the description of the key or of the type.
    pub(super) fn description(self) -> Option<&'static str> {
        self.description
    }

    /// Returns the value of a keyword, such as `minimum`.
    pub(super) fn keyword(self, name: &str) -> &'static Value {
        &self.schema[name]
    }

    /// Returns the name of the type, such as `number`; empty for several types.
    pub(super) fn kind(self) -> &'static str {
        self.schema["type"].as_str().unwrap_or_default()
    }

    /// Returns the part for a key of a table, without the keys of alternatives.
    pub(super) fn property(self, key: &str) -> Option<Self> {
        self.schema["properties"].get(key).map(|schema| {
            let property = self.resolve(schema);
            Self { description: property.description.or(self.description), ..property }
        })
    }

    /// Returns the keys of a table, without those of alternatives.
    pub(super) fn keys(self) -> impl Iterator<Item = &'static str> {
        self.schema["properties"].as_object().into_iter().flat_map(|keys| keys.keys().map(String::as_str))
    }

    /// Returns the part for every value of a table with free keys.
    pub(super) fn values(self) -> Option<Self> {
        self.schema["additionalProperties"].is_object().then(|| self.resolve(&self.schema["additionalProperties"]))
    }

    /// Returns the part for the entries of a list.
    pub(super) fn items(self) -> Option<Self> {
        self.schema["items"].is_object().then(|| self.part(&self.schema["items"]))
    }

    /// Returns whether a table needs a key.
    pub(super) fn requires(self, key: &str) -> bool {
        self.required().any(|name| name == key)
    }

    /// Returns the keys that a table needs.
    pub(super) fn required(self) -> impl Iterator<Item = &'static str> {
        self.schema["required"].as_array().into_iter().flatten().filter_map(Value::as_str)
    }

    /// Returns the alternatives, nested ones included; exactly one applies to a value.
    pub(super) fn alternatives(self) -> Vec<Self> {
        let listed = ["oneOf", "anyOf"].into_iter().filter_map(|keyword| self.schema[keyword].as_array()).flatten();
        let parts = listed.filter(|part| part.as_object().is_some_and(|part| !part.is_empty()));
        let parts = parts.map(|part| self.part(part));
        let is_nested = |part: &Self| part.schema["oneOf"].is_array() && part.words().is_empty();
        parts.flat_map(|part| if is_nested(&part) { part.alternatives() } else { vec![part] }).collect()
    }

    /// Returns the admitted words; empty for other values.
    pub(super) fn words(self) -> Vec<&'static str> {
        let words = |part: Self| part.schema["const"].as_str();
        self.schema["oneOf"].as_array().into_iter().flatten().filter_map(|part| words(self.resolve(part))).collect()
    }

    /// Returns whether the part describes a table.
    pub(super) fn is_table(self) -> bool {
        self.kind() == "object"
            || self.schema["properties"].is_object()
            || self.alternatives().iter().any(|part| part.tag().is_some())
    }

    /// Returns the tag of an alternative: the key with a constant value, and this value.
    pub(super) fn tag(self) -> Option<(&'static str, &'static str)> {
        let keys = self.schema["properties"].as_object()?;
        keys.iter().find_map(|(key, value)| Some((key.as_str(), value["const"].as_str()?)))
    }
}

/// Returns the paths of all keys of the scenario file, such as `law.delta_m`. Entries of lists of tables have the
/// number 1, such as `leg.1.radius_m`. Keys under names that the file chooses, such as `laws.NAME.alpha`, are left out.
#[must_use]
pub fn key_paths() -> Vec<String> {
    let mut paths = BTreeSet::new();
    collect_paths(Node::root(), "", &mut paths);
    paths.into_iter().collect()
}

fn collect_paths(table: Node, prefix: &str, paths: &mut BTreeSet<String>) {
    let parts = || std::iter::once(table).chain(table.alternatives());
    for (part, key) in parts().flat_map(|part| part.keys().map(move |key| (part, key))) {
        let Some(node) = part.property(key) else { continue };
        let path = format!("{prefix}{key}");
        match node.items() {
            Some(entry) if entry.is_table() => collect_paths(entry, &format!("{path}.1."), paths),
            _ if node.is_table() => collect_paths(node, &format!("{path}."), paths),
            _ => {
                paths.insert(path);
            }
        }
    }
}

/// Returns the words that a key of the scenario file admits, such as those of `law.kind`; empty for other values.
#[must_use]
pub fn key_choices(path: &str) -> Vec<&'static str> {
    let mut nodes = vec![Node::root()];
    for key in path.split('.') {
        let child = |part: Node| part.property(key).or_else(|| part.values()).or_else(|| part.items());
        let parts = nodes.into_iter().flat_map(|node| std::iter::once(node).chain(node.alternatives()));
        nodes = parts.filter_map(child).collect();
    }
    let words = nodes.into_iter().flat_map(|node| match node.kind() {
        "boolean" => vec!["true", "false"],
        _ => node.keyword("const").as_str().into_iter().chain(node.words()).collect(),
    });
    let mut seen = BTreeSet::new();
    words.filter(|word| seen.insert(*word)).collect()
}

/// Returns the tables of a file that have a key of this name, such as `[swarm]`, or
/// `[law] with kind = "laplacian" or "orca"`.
pub(super) fn tables_with(file: Node, key: &str) -> Vec<String> {
    let mut found = Vec::new();
    for table in file.keys() {
        let Some(node) = file.property(table) else { continue };
        let node = node.items().unwrap_or(node);
        let parts: Vec<_> = node.alternatives().into_iter().filter(|part| part.property(key).is_some()).collect();
        let choices = parts.iter().map(|part| part.tag().filter(|(tag, _)| *tag != key)).collect::<Option<Vec<_>>>();
        match choices.as_deref() {
            _ if node.property(key).is_some() => found.push(format!("[{table}]")),
            None => found.push(format!("[{table}]")),
            Some([]) => {}
            Some(choices @ [(tag, _), ..]) => {
                let names: Vec<_> = choices.iter().map(|(_, name)| format!("\"{name}\"")).collect();
                found.push(format!("[{table}] with {tag} = {}", names.join(" or ")));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_found_in_its_table_and_in_each_alternative_that_has_it() {
        assert_eq!(tables_with(Node::root(), "count"), ["[swarm]"]);
        assert_eq!(tables_with(Node::root(), "alpha"), ["[law] with kind = \"edge-tension\" or \"displacement\""]);
        assert_eq!(tables_with(Node::root(), "half_extent_m"), ["[start] with shape = \"random\""]);
        assert_eq!(tables_with(Node::root(), "nowhere"), [] as [&str; 0]);
    }

    #[test]
    fn paths_lead_to_keys_of_tables_lists_and_alternatives() {
        let paths = key_paths();
        for path in
            ["name", "law.kind", "law.alpha", "law.f1_per_s2", "leg.1.radius_m", "wind.gust.1.rise_s", "time.dt_s"]
        {
            assert!(paths.iter().any(|known| known == path), "{path}: {paths:?}");
        }
        assert!(!paths.iter().any(|path| path == "law" || path.ends_with('.')), "{paths:?}");
    }

    #[test]
    fn keys_with_choices_have_words() {
        assert!(key_choices("law.kind").starts_with(&["edge-tension"]), "{:?}", key_choices("law.kind"));
        assert_eq!(key_choices("plant.kind"), ["rapier", "ideal"]);
        assert_eq!(key_choices("laws.mine.kind"), key_choices("law.kind"));
        assert!(key_choices("failure.1.kind").contains(&"silent"), "{:?}", key_choices("failure.1.kind"));
        assert_eq!(key_choices("start.shuffle"), ["true", "false"]);
        for path in ["law.alpha", "law", "nowhere", "name", ""] {
            assert_eq!(key_choices(path), [] as [&str; 0], "{path}");
        }
    }
}
