//! Checks the tree of a file against the schema, and converts the tree into the form that serde reads.
//!
//! This module checks every key, type, word and bound; `validate` checks conditions on several keys. In TOML, a table
//! holds its choice (`kind`, `shape`) and the keys of this choice side by side. serde reads the choice as
//! `kind = { NAME = { keys } }`.

use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::{ErrorKind, ScenarioError, suggest};
use super::limits::{LARGEST, SMALLEST};
use super::schema::{Node, tables_with};
use tautline_core::failure::Place;
use tautline_core::text::shortest;

/// Longest part of an unknown name that a message repeats \[characters\].
const NAME_CHARS: usize = 40;

/// Check of a file, or of a part of it, against its schema.
pub(super) struct Check<'a> {
    /// Part of the schema for the whole file.
    pub(super) file: Node,
    /// Begin of the spans of overrides. A choice of an override drops the keys of the file that belong to another
    /// choice.
    pub(super) overridden_from: usize,
    /// Returns the place of a span, for errors.
    pub(super) locate: &'a dyn Fn(Range<usize>) -> Option<Place>,
}

/// Checks the TOML of a scenario that no file holds, such as one built in code. An error has its key, but no place.
pub(super) fn check_written(toml: &str) -> Result<(), ScenarioError> {
    let table = DeTable::parse(toml)
        .map_err(|error| ErrorKind::Syntax.at(&[], error.message(), "give values that TOML can hold"))?;
    let mut file = Spanned::new(0..0, DeValue::Table(table.into_inner()));
    Check { file: Node::root(), overridden_from: usize::MAX, locate: &|_| None }.nest(&mut file)
}

/// Returns the error about a value that the scenario does not give.
pub(super) fn of_filled_value(ScenarioError { kind, message, keys, .. }: ScenarioError) -> ScenarioError {
    let path = keys.into_iter().next().unwrap_or_default();
    let problem = format!("{path}, which follows from other keys: {message}");
    let help = format!("give {path} another value, or change the keys that it follows from");
    kind.at(&[&path], problem, help)
}

impl Check<'_> {
    /// Checks a whole file, and nests its choices.
    pub(super) fn nest(&self, file: &mut Spanned<DeValue<'_>>) -> Result<(), ScenarioError> {
        self.value(file, self.file, "scenario", None)
    }

    /// Checks a value. `name` is the key of the value; `own_name` replaces a missing tag.
    pub(super) fn value(
        &self,
        value: &mut Spanned<DeValue<'_>>,
        node: Node,
        name: &str,
        own_name: Option<&(&str, Range<usize>)>,
    ) -> Result<(), ScenarioError> {
        let span = value.span();
        if let (Some(node), DeValue::Table(table)) = (node.values(), value.get_mut()) {
            return table.iter_mut().try_for_each(|(key, value)| {
                let name = &**key.get_ref();
                self.value(value, node, name, Some(&(name, key.span()))).map_err(|error| error.below(name))
            });
        }
        if node.keyword("additionalProperties") == true && value.get_ref().is_table() {
            return Ok(());
        }
        if node.is_table() {
            return match value.get_mut() {
                DeValue::Table(table) => self.table(table, node, &span, own_name),
                other => Err(self.wrong_type(name, node, other, span)),
            };
        }
        let words = node.words();
        if !words.is_empty() {
            return match value.get_ref().as_str() {
                Some(word) if words.contains(&word) => Ok(()),
                Some(word) => Err(self.unknown_choice(word, &words, span)),
                None => Err(self.wrong_type(name, node, value.get_ref(), span)),
            };
        }
        let alternatives = node.alternatives();
        if !alternatives.is_empty() {
            let admitting: Vec<_> =
                alternatives.into_iter().filter(|part| admits(*part, value.get_ref().type_str())).collect();
            let part = match (&admitting[..], value.get_ref()) {
                ([], _) => return Err(self.wrong_type(name, node, value.get_ref(), span)),
                (parts @ [_, _, ..], DeValue::Table(table)) => self.named_by_key(name, parts, table, span)?,
                (&[first, ..], _) => first,
            };
            return self.value(value, part, name, None);
        }
        if !admits(node, value.get_ref().type_str()) {
            return Err(self.wrong_type(name, node, value.get_ref(), span));
        }
        match value.get_mut() {
            DeValue::Array(list) => {
                self.check_length(name, node, list.len(), span)?;
                let Some(node) = node.items() else { return Ok(()) };
                list.iter_mut().enumerate().try_for_each(|(entry, value)| {
                    self.value(value, node, name, None).map_err(|error| error.below(entry + 1))
                })
            }
            DeValue::Integer(written) => {
                let Ok(whole) = i64::from_str_radix(written.as_str(), written.radix()) else {
                    let most = if node.kind() == "integer" { i64::MAX.to_string() } else { format!("{LARGEST:e}") };
                    return Err(self.out_of_range(
                        name,
                        node,
                        &format!("at most {most} in magnitude"),
                        written.as_str(),
                        span,
                    ));
                };
                self.in_range(name, node, whole as f64, || whole.to_string(), span)
            }
            DeValue::Float(written) => {
                let number: f64 = written.as_str().parse().unwrap_or(f64::NAN);
                let shown = || if number.is_finite() { shortest(number) } else { written.as_str().to_owned() };
                self.in_range(name, node, number, shown, span)
            }
            _ => Ok(()),
        }
    }

    /// Returns the alternative of a table whose only key names the alternative.
    fn named_by_key(
        &self,
        name: &str,
        parts: &[Node],
        table: &DeTable<'_>,
        span: Range<usize>,
    ) -> Result<Node, ScenarioError> {
        let names: Vec<_> = parts.iter().flat_map(|part| part.keys()).collect();
        let mut keys = table.keys();
        let (Some(key), None) = (keys.next(), keys.next()) else {
            let message = format!("`{}` must have one key, got {}", short(name), table.len());
            let help = format!("give one of {}", names.join(", "));
            return Err(self.refuse(ErrorKind::WrongType, message, help, span));
        };
        let of_key = parts.iter().copied().find(|part| part.property(key.get_ref()).is_some());
        of_key.ok_or_else(|| self.unknown_key(key.get_ref(), names, key.span()))
    }

    fn unknown_key(&self, name: &str, mut known: Vec<&str>, span: Range<usize>) -> ScenarioError {
        known.sort_unstable();
        known.dedup();
        let help = match tables_with(self.file, name)[..] {
            [] => suggest(name, &known),
            ref tables => format!("`{name}` belongs in {}; {}", tables.join(", or "), suggest(name, &known)),
        };
        self.refuse(ErrorKind::UnknownKey, format!("unknown key `{}`", short(name)), help, span).below(name)
    }

    fn table(
        &self,
        table: &mut DeTable<'_>,
        node: Node,
        span: &Range<usize>,
        own_name: Option<&(&str, Range<usize>)>,
    ) -> Result<(), ScenarioError> {
        let alternatives: Vec<_> = node.alternatives().into_iter().filter(|part| part.tag().is_some()).collect();
        let choice = match alternatives.first().and_then(|part| part.tag()) {
            Some((tag, _)) => self.choice(table, tag, &alternatives, span, own_name, node)?,
            None => None,
        };
        let chosen = choice.as_ref().map(|(chosen, _)| *chosen);
        let known = |key: &str| node.property(key).or_else(|| chosen?.property(key));
        for (key, value) in table.iter_mut() {
            let name = key.get_ref();
            let Some(node) = known(name) else {
                // The key of the file may have a value of an override.
                let is_of_override = |span: Range<usize>| span.start >= self.overridden_from;
                let place =
                    if !is_of_override(key.span()) && is_of_override(value.span()) { value.span() } else { key.span() };
                let known: Vec<_> = node.keys().chain(chosen.into_iter().flat_map(Node::keys)).collect();
                return Err(self.unknown_key(name, known, place));
            };
            // `choice` has checked the tag.
            if node.keyword("const").is_null() {
                self.value(value, node, name, None).map_err(|error| error.below(name))?;
            }
        }
        let required = node.required().chain(chosen.into_iter().flat_map(Node::required));
        if let Some(missing) = required.into_iter().find(|key| !table.contains_key(*key)) {
            let help = format!("`{missing}` is {}", known(missing).map_or_else(String::new, expected));
            let problem = format!("missing key `{missing}`");
            return Err(self.refuse(ErrorKind::MissingKey, problem, help, span.clone()));
        }
        if let Some((chosen, tag_span)) = choice {
            nest_choice(table, node, chosen, tag_span);
        }
        Ok(())
    }

    /// Returns the alternative that the tag of a table or its default selects, and the span of the tag.
    fn choice(
        &self,
        table: &mut DeTable<'_>,
        tag: &'static str,
        alternatives: &[Node],
        span: &Range<usize>,
        own_name: Option<&(&str, Range<usize>)>,
        node: Node,
    ) -> Result<Option<(Node, Range<usize>)>, ScenarioError> {
        let names: Vec<_> = alternatives.iter().filter_map(|part| part.tag()).map(|(_, name)| name).collect();
        let default = alternatives.iter().find(|part| !part.requires(tag)).and_then(|part| part.tag());
        let (name, tag_span) = match (table.get(tag), own_name, default) {
            (Some(value), ..) => {
                let Some(name) = value.get_ref().as_str() else {
                    let message = format!("`{tag}` must be {}, got {}", listed(&names), found(value.get_ref()));
                    return Err(self.refuse(ErrorKind::WrongType, message, description(node), value.span()).below(tag));
                };
                (name, value.span())
            }
            (None, Some((own, own_span)), _) => (*own, own_span.clone()),
            (None, None, Some((_, default))) => (default, span.clone()),
            // Some tables, such as `[[leg]]`, need no tag.
            (None, None, None) if node.keyword("anyOf").is_array() => return Ok(None),
            (None, None, None) => {
                let help = format!("give one of {}", listed(&names));
                return Err(self.refuse(ErrorKind::MissingKey, format!("missing key `{tag}`"), help, span.clone()));
            }
        };
        let Some(&chosen) = alternatives.iter().find(|part| part.tag().is_some_and(|(_, known)| known == name)) else {
            let mut error = self.unknown_choice(name, &names, tag_span);
            if own_name.is_some() && !table.contains_key(tag) {
                let unless = "the name of a law is its kind unless the table [laws.NAME] has a `kind`: ";
                error.help.insert_str(0, unless);
            }
            return Err(error.below(tag));
        };
        if tag_span.start >= self.overridden_from {
            let is_left = |key: &str, value: &Spanned<DeValue<'_>>| {
                value.span().start < self.overridden_from
                    && node.property(key).is_none()
                    && chosen.property(key).is_none()
                    && alternatives.iter().any(|part| part.property(key).is_some())
            };
            let left = table.iter().filter(|(key, value)| is_left(key.get_ref(), value));
            let left: Vec<_> = left.map(|(key, _)| key.get_ref().to_string()).collect();
            for key in left {
                table.remove(&*key);
            }
        }
        Ok(Some((chosen, tag_span)))
    }

    /// Refuses a list that is shorter or longer than the schema allows.
    fn check_length(&self, name: &str, node: Node, length: usize, span: Range<usize>) -> Result<(), ScenarioError> {
        let bound = |keyword: &str| node.keyword(keyword).as_u64();
        let lengths = bound("minItems").unwrap_or(0)..=bound("maxItems").unwrap_or(u64::MAX);
        if lengths.contains(&(length as u64)) {
            return Ok(());
        }
        let message = format!("`{}` must be {}, got a list of {length}", short(name), expected(node));
        Err(self.refuse(ErrorKind::WrongType, message, description(node), span))
    }

    /// Refuses a number that is not finite, outside the bounds of the schema, or outside [`SMALLEST`] to [`LARGEST`].
    fn in_range(
        &self,
        name: &str,
        node: Node,
        number: f64,
        shown: impl FnOnce() -> String,
        span: Range<usize>,
    ) -> Result<(), ScenarioError> {
        let bound = |keyword: &str| node.keyword(keyword).as_f64();
        let refuse = |must: String| Err(self.out_of_range(name, node, &must, &shown(), span));
        if !number.is_finite() {
            return refuse("a finite number".to_owned());
        }
        match (bound("exclusiveMinimum"), bound("minimum"), bound("maximum")) {
            (Some(least), ..) if number <= least => return refuse(format!("more than {least}")),
            (_, Some(least), Some(most)) if number < least || number > most => {
                return refuse(format!("from {least} to {most}"));
            }
            (_, Some(least), _) if number < least => return refuse(format!("at least {least}")),
            (_, _, Some(most)) if number > most => return refuse(format!("at most {most}")),
            _ => {}
        }
        if node.kind() == "integer" {
            return Ok(());
        }
        if number.abs() > LARGEST {
            return refuse(format!("at most {LARGEST:e} in magnitude"));
        }
        if bound("exclusiveMinimum") == Some(0.0) && number < SMALLEST {
            return refuse(format!("at least {SMALLEST:e}"));
        }
        Ok(())
    }

    fn out_of_range(&self, name: &str, node: Node, must: &str, number: &str, span: Range<usize>) -> ScenarioError {
        let message = format!("`{name}` must be {must}, got {number}");
        self.refuse(ErrorKind::OutOfRange, message, description(node), span)
    }

    fn unknown_choice(&self, name: &str, known: &[&str], span: Range<usize>) -> ScenarioError {
        let message = format!("unknown choice `{}`", short(name));
        self.refuse(ErrorKind::UnknownChoice, message, suggest(name, known), span)
    }

    fn wrong_type(&self, name: &str, node: Node, value: &DeValue<'_>, span: Range<usize>) -> ScenarioError {
        let message = format!("`{}` must be {}, got {}", short(name), expected(node), found(value));
        self.refuse(ErrorKind::WrongType, message, description(node), span)
    }

    /// Returns an error about the bytes of a value.
    fn refuse(
        &self,
        kind: ErrorKind,
        problem: impl AsRef<str>,
        help: impl AsRef<str>,
        span: Range<usize>,
    ) -> ScenarioError {
        ScenarioError { place: (self.locate)(span).map(Box::new), ..kind.at(&[], problem, help) }
    }
}

/// Moves the keys of a choice into a table below the tag, named as the choice.
fn nest_choice(table: &mut DeTable<'_>, node: Node, chosen: Node, span: Range<usize>) {
    let Some((tag, name)) = chosen.tag() else { return };
    table.remove(tag);
    let own = chosen.keys().filter(|key| node.property(key).is_none());
    let keys = own.filter_map(|key| table.remove_entry(key)).collect();
    let named = |name: &'static str, table| {
        (Spanned::new(span.clone(), name.into()), Spanned::new(span.clone(), DeValue::Table(table)))
    };
    table.extend([named(tag, DeTable::from_iter([named(name, keys)]))]);
}

/// Returns whether a part of the schema has a type of TOML.
fn admits(node: Node, type_name: &str) -> bool {
    match type_name {
        "table" => node.is_table(),
        "string" => node.kind() == "string" || !node.words().is_empty(),
        "integer" => matches!(node.kind(), "integer" | "number"),
        "float" => node.kind() == "number",
        other => node.kind() == other,
    }
}

/// Returns a value in words.
fn found(value: &DeValue<'_>) -> String {
    match value {
        DeValue::String(text) => format!("the text \"{}\"", short(text)),
        DeValue::Integer(number) => number.as_str().to_owned(),
        DeValue::Float(number) => number.as_str().to_owned(),
        DeValue::Boolean(flag) => flag.to_string(),
        DeValue::Datetime(_) => "a date".to_owned(),
        DeValue::Array(list) => format!("a list of {}", list.len()),
        DeValue::Table(_) => "a table".to_owned(),
    }
}

/// Returns the type of a part of the schema in words.
fn expected(node: Node) -> String {
    let words = node.words();
    if !words.is_empty() {
        return listed(&words);
    }
    if node.is_table() {
        return "a table".to_owned();
    }
    match node.kind() {
        "number" => "a number".to_owned(),
        "integer" => "a whole number".to_owned(),
        "boolean" => "true or false".to_owned(),
        "string" => "text".to_owned(),
        "array" => {
            let entries = node.items().map_or_else(String::new, |items| match items.kind() {
                "number" => " numbers".to_owned(),
                "integer" => " whole numbers".to_owned(),
                "array" => " lists".to_owned(),
                _ => " entries".to_owned(),
            });
            match (node.keyword("minItems").as_u64(), node.keyword("maxItems").as_u64()) {
                (Some(least), Some(most)) if least == most => format!("a list of {least}{entries}"),
                (Some(least), Some(most)) => format!("a list of {least} to {most}{entries}"),
                (Some(1), None) => "a list with at least one entry".to_owned(),
                (Some(least), None) => format!("a list of at least {least}{entries}"),
                _ => format!("a list of{entries}"),
            }
        }
        _ => {
            let mut types: Vec<_> = node.alternatives().into_iter().map(expected).collect();
            types.dedup();
            types.join(" or ")
        }
    }
}

/// Returns the first sentence of the description of a key, without a full stop.
fn description(node: Node) -> String {
    let description = node.description().unwrap_or("`tautline schema` describes every key");
    description.split_once(". ").map_or(description, |(first, _)| first).trim_end_matches('.').replace('\n', " ")
}

fn listed(names: &[&str]) -> String {
    names.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(" or ")
}

fn short(name: &str) -> String {
    name.chars().take(NAME_CHARS).collect()
}
