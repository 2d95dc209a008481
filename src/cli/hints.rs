//! Tips for wrong arguments, beside those of clap.

use std::ffi::OsStr;
use std::path::Path;

use clap::Command;
use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};

use tautline_report::request::command_line;
use tautline_sim::scenario::builtin;

/// Largest number of changed letters of a word that is still recognised.
const MOST_CHANGES: usize = 2;

/// Adds tips to an error: the command or option that was meant, what to do with a file, and the form of a length.
pub(super) fn with_hints(mut usage: clap::Error, program: &Command, words: &[String]) -> clap::Error {
    let given = |kind| match usage.get(kind) {
        Some(ContextValue::String(text)) => text.clone(),
        _ => String::new(),
    };
    match usage.kind() {
        ErrorKind::InvalidSubcommand => {
            let word = given(ContextKind::InvalidSubcommand);
            let is_of_command = words.iter().take_while(|other| **other != word).any(|name| names(program, name));
            if is_of_command || usage.get(ContextKind::SuggestedSubcommand).is_some() {
                return usage;
            }
            if let Some(way) = way_with(&word) {
                tip(&mut usage, &way);
            } else if let Some(name) = nearest(&word, program.get_subcommands().map(Command::get_name)) {
                usage.insert(ContextKind::SuggestedSubcommand, ContextValue::Strings(vec![name]));
            }
        }
        // The parser took the word after `--json` as the scenario.
        ErrorKind::UnknownArgument if let Some(file) = behind_json(words) => {
            tip(&mut usage, &format!("write an equals sign before the file of --json: --json={file}"));
        }
        ErrorKind::UnknownArgument if usage.get(ContextKind::SuggestedArg).is_none() => {
            let word = given(ContextKind::InvalidArg);
            let command = words.iter().find_map(|name| program.find_subcommand(name)).unwrap_or(program);
            let options = command.get_arguments().filter_map(|argument| argument.get_long());
            if let Some(name) = word.strip_prefix("--").and_then(|word| nearest(word, options)) {
                usage.remove(ContextKind::Suggested);
                usage.insert(ContextKind::SuggestedArg, ContextValue::String(format!("--{name}")));
            }
        }
        ErrorKind::ValueValidation if given(ContextKind::InvalidArg).contains("<METRES>") => {
            let word = given(ContextKind::InvalidValue);
            let digits = word.trim_end_matches(|c: char| c.is_alphabetic() || c.is_whitespace());
            if digits.parse::<f64>().is_ok() {
                let example = if word.strip_prefix(digits).map(str::trim) == Some("m") { digits } else { "0.5" };
                tip(&mut usage, &format!("a length is a number of metres without a unit, such as {example}"));
            }
        }
        _ => {}
    }
    usage
}

/// Returns the word after `--json` if it names a JSON file; the option takes a file only after an equals sign.
fn behind_json(words: &[String]) -> Option<&str> {
    let place = words.iter().position(|word| word == "--json")?;
    words.get(place + 1).map(String::as_str).filter(|word| Path::new(word).extension() == Some("json".as_ref()))
}

fn names(program: &Command, word: &str) -> bool {
    program.find_subcommand(word).is_some()
}

fn tip(usage: &mut clap::Error, text: &str) {
    usage.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![StyledStr::from(text.to_owned())]));
}

/// Returns what to do with a file or a built-in scenario that stands in the place of a command.
fn way_with(word: &str) -> Option<String> {
    let extension = Path::new(word).extension().and_then(OsStr::to_str).unwrap_or_default().to_lowercase();
    if builtin::find(word).is_some() || extension == "toml" {
        return Some(format!("fly a scenario with `{}`", command_line(["run", word].into_iter())));
    }
    let is_file = Path::new(word).exists() || !extension.is_empty();
    is_file.then(|| format!("judge a recording with `{} --delta METRES`", command_line(["audit", word].into_iter())))
}

/// Returns the name that a word begins, or from which it differs in a few letters.
fn nearest<'a>(word: &str, names: impl Iterator<Item = &'a str>) -> Option<String> {
    let changes = |name: &str| {
        if word.len() > 1 && name.starts_with(word) { 0 } else { strsim::osa_distance(word, name) }
    };
    let (changes, name) = names.map(|name| (changes(name), name)).min()?;
    let is_meant = changes <= MOST_CHANGES.min(word.len().saturating_sub(1));
    is_meant.then(|| name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::{nearest, way_with};

    #[test]
    fn a_word_is_recognised_by_its_beginning_or_with_few_changes() {
        let names = ["run", "audit", "set", "snapshots"];
        for (word, name) in [("rnu", "run"), ("st", "set"), ("snap", "snapshots"), ("audti", "audit")] {
            assert_eq!(nearest(word, names.into_iter()).as_deref(), Some(name), "{word}");
        }
        for word in ["", "x", "fly", "pentagon"] {
            assert_eq!(nearest(word, names.into_iter()), None, "{word}");
        }
    }

    #[test]
    fn files_and_scenarios_are_arguments_of_commands() {
        assert!(way_with("pentagon.csv").is_some_and(|way| way.contains("audit pentagon.csv")));
        assert!(way_with("my.toml").is_some_and(|way| way.contains("run my.toml")));
        assert!(way_with("pentagon").is_some_and(|way| way.contains("run pentagon")));
        assert_eq!(way_with("fly"), None);
    }
}
