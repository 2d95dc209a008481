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

/// Names of values that are numbers: what the number is, its unit, and an example.
const NUMBERS: [(&str, &str, &str, &str); 7] = [
    ("<METRES>", "a length", "metres", "0.5"),
    ("<[NAME=]R>", "a radius", "metres", "0.5"),
    ("<SECONDS>", "a time", "seconds", "1.5"),
    ("<[NAME=]A>", "an acceleration", "m/s^2", "5"),
    ("<M/S2>", "an acceleration", "m/s^2", "5"),
    ("<M/S>", "a speed", "m/s", "0.5"),
    ("<HZ>", "a rate", "Hz", "20"),
];

/// Words for options that have another name.
const OTHER_NAMES: [(&str, &str); 2] = [("to", "until"), ("format", "input-format")];

/// Options that a command does not have, and what to write.
const ABSENT: [(&str, &[&str], &str); 3] = [
    ("run", &["--html"], "the page is always written: report.html in the folder of --out"),
    ("audit", &["-o", "--out"], "write the page with --html FILE, and the answer with --json=FILE"),
    ("watch", &["--html"], "--page serves a live page; --record FILE writes the positions for `tautline audit`"),
];

/// Adds tips to an error: the command or option that was meant, what to do with a file, and the form of a number.
pub(super) fn with_hints(mut usage: clap::Error, program: &Command, words: &[String]) -> clap::Error {
    let given = |kind| match usage.get(kind) {
        Some(ContextValue::String(text)) => text.clone(),
        _ => String::new(),
    };
    let (argument, value) = (given(ContextKind::InvalidArg), given(ContextKind::InvalidValue));
    let word = given(ContextKind::InvalidSubcommand);
    let command = command_of(program, words.iter().take_while(|other| **other != word));
    match usage.kind() {
        ErrorKind::InvalidSubcommand if usage.get(ContextKind::SuggestedSubcommand).is_none() => {
            let is_of_program = command.get_name() == program.get_name();
            if let Some(way) = way_with(&word).filter(|_| is_of_program) {
                tip(&mut usage, &way);
            } else if let Some(name) = nearest(&word, command.get_subcommands().map(Command::get_name)) {
                usage.insert(ContextKind::SuggestedSubcommand, ContextValue::Strings(vec![name]));
            }
        }
        // The parser took the word after `--json` as the scenario.
        ErrorKind::UnknownArgument if let Some(file) = behind_json(words) => {
            tip(&mut usage, &equals_sign_before(file));
        }
        ErrorKind::UnknownArgument => {
            if let Some(way) = way_without(command.get_name(), &argument) {
                usage.remove(ContextKind::SuggestedArg);
                tip(&mut usage, &way);
            } else if let Some(name) = option_meant(command, &argument, usage.get(ContextKind::SuggestedArg).is_some())
            {
                usage.remove(ContextKind::Suggested);
                // The usage is that of the option that clap suggests.
                usage.remove(ContextKind::Usage);
                usage.insert(ContextKind::SuggestedArg, ContextValue::String(format!("--{name}")));
            }
        }
        ErrorKind::InvalidValue if argument.starts_with("--color ") && has_option(command, "colour") => {
            tip(&mut usage, &format!("--colour {value} sets the colour of vehicles, --color that of the text"));
        }
        ErrorKind::ValueValidation if let Some(form) = form_of_number(&argument, &value) => tip(&mut usage, &form),
        _ => {}
    }
    usage
}

/// Returns the word after `--json` if it names a JSON file; the option takes a file only after an equals sign.
pub(super) fn behind_json(words: &[String]) -> Option<&str> {
    let place = words.iter().position(|word| word == "--json")?;
    words.get(place + 1).map(String::as_str).filter(|word| Path::new(word).extension() == Some("json".as_ref()))
}

/// Returns the remedy for a file behind `--json`.
pub(super) fn equals_sign_before(file: &str) -> String {
    format!("write an equals sign before the file of --json: --json={file}")
}

/// Returns the command that the words name, of a group the command within it.
fn command_of<'a, 'b>(program: &'a Command, words: impl Iterator<Item = &'b String>) -> &'a Command {
    words.fold(program, |command, word| command.find_subcommand(word).unwrap_or(command))
}

fn has_option(command: &Command, name: &str) -> bool {
    command.get_arguments().any(|argument| argument.get_long() == Some(name))
}

/// Returns the name of the option that was meant, without dashes. A tip of clap is replaced only if the option has
/// another name.
fn option_meant(command: &Command, argument: &str, has_tip: bool) -> Option<String> {
    let word = argument.strip_prefix("--")?;
    let other = OTHER_NAMES.iter().find(|(other, name)| *other == word && has_option(command, name));
    let options = command.get_arguments().filter_map(|argument| argument.get_long());
    other.map(|(_, name)| (*name).to_owned()).or_else(|| if has_tip { None } else { nearest(word, options) })
}

/// Returns the way to what an argument asks for, if the command has no such option or argument.
fn way_without(command: &str, argument: &str) -> Option<String> {
    let absent = ABSENT.iter().find(|(name, options, _)| *name == command && options.contains(&argument));
    let is_shown = command == "list" && (builtin::find(argument).is_some() || Path::new(argument).exists());
    let shown = || command_line(["list", "--show", argument].into_iter());
    absent.map(|(.., way)| (*way).to_owned()).or_else(|| is_shown.then(|| format!("print it with `{}`", shown())))
}

/// Returns the form of a number for a value that is none: without a unit, with a decimal point.
fn form_of_number(argument: &str, value: &str) -> Option<String> {
    let (_, what, unit, example) = NUMBERS.iter().find(|(name, ..)| argument.contains(name))?;
    let value = value.rsplit_once('=').map_or(value, |(_, value)| value);
    if value.parse::<f64>().is_ok() {
        return None;
    }
    let with_point = value.replacen(',', ".", 1);
    let digits = value.trim_end_matches(|c: char| c.is_alphabetic() || c.is_whitespace());
    let example = match value.strip_prefix(digits).map(str::trim) {
        _ if with_point.parse::<f64>().is_ok() => with_point.as_str(),
        Some("m" | "s") if digits.parse::<f64>().is_ok() => digits,
        _ => *example,
    };
    Some(format!("{what} is a number of {unit} without a unit, such as {example}"))
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

/// Returns a question after the built-in scenario that was meant, with a space behind it.
pub(super) fn builtin_meant(word: &str) -> Option<String> {
    let name = nearest(word, builtin::all().iter().map(|builtin| builtin.name))?;
    Some(format!("did you mean `{name}`? "))
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
    use super::{form_of_number, nearest, way_with, way_without};

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

    #[test]
    fn a_number_has_no_unit_and_a_decimal_point() {
        for (argument, value, example) in [
            ("--delta <METRES>", "2m", "a length is a number of metres without a unit, such as 2"),
            ("--delta <METRES>", "500mm", "such as 0.5"),
            ("--delta <METRES>", "1,5", "such as 1.5"),
            ("--radius <[NAME=]R>", "a=10cm", "a radius is a number of metres"),
            ("--max-gap <SECONDS>", "1 s", "a time is a number of seconds without a unit, such as 1"),
            ("--accel <M/S2>", "fast", "an acceleration is a number of m/s^2"),
        ] {
            let form = form_of_number(argument, value).unwrap_or_default();
            assert!(form.contains(example), "{argument} {value}: {form}");
        }
        for (argument, value) in [("--delta <METRES>", "-1"), ("--radius <[NAME=]R>", "a=1"), ("--size <WxH>", "2m")] {
            assert_eq!(form_of_number(argument, value), None, "{argument} {value}");
        }
    }

    #[test]
    fn an_absent_option_has_a_way_in_its_own_command_only() {
        assert!(way_without("run", "--html").is_some_and(|way| way.contains("report.html")));
        assert!(way_without("audit", "-o").is_some_and(|way| way.contains("--html FILE")));
        assert!(way_without("list", "pentagon").is_some_and(|way| way.contains("list --show pentagon")));
        for (command, argument) in [("audit", "--html"), ("run", "-o"), ("list", "nothing"), ("run", "pentagon")] {
            assert_eq!(way_without(command, argument), None, "{command} {argument}");
        }
    }
}
