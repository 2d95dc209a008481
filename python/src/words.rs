//! Words of Python in messages: options of the command line become arguments of functions.
//!
//! Messages of the library name options, such as `--time-unit ms`. [`in_python`] is the only place that translates
//! them, into `time_unit="ms"`. `tests/python/test_words.py` compares [`OPTIONS`] with the sources of all messages.

use pyo3::prelude::*;

/// Kind of the value of an option.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    /// No value: an argument that is True.
    Flag,
    /// A number, several numbers, or a path.
    Number,
    /// A word.
    Text,
    /// A name and a number: an entry of a dictionary.
    Numbers,
    /// A name and a word.
    Texts,
}

/// Options with the kind of their value.
const OPTIONS: &[(&str, Kind)] = &[
    ("above", Kind::Number),
    ("accel-window", Kind::Number),
    ("allow-unfinished", Kind::Flag),
    ("apart", Kind::Number),
    ("axes", Kind::Text),
    ("clock", Kind::Text),
    ("column", Kind::Texts),
    ("compressed", Kind::Flag),
    ("csv", Kind::Number),
    ("cylinder", Kind::Number),
    ("delta", Kind::Number),
    ("dimensions", Kind::Number),
    ("distinct", Kind::Flag),
    ("duplicates", Kind::Text),
    ("ellipsoid", Kind::Number),
    ("expect-vehicles", Kind::Number),
    ("fence", Kind::Number),
    ("flights", Kind::Number),
    ("force", Kind::Flag),
    ("format", Kind::Text),
    ("fps", Kind::Number),
    ("frame", Kind::Text),
    ("from", Kind::Number),
    ("halvings", Kind::Number),
    ("html", Kind::Number),
    ("ids", Kind::Number),
    ("independent", Kind::Flag),
    ("join", Kind::Flag),
    ("key", Kind::Text),
    ("land-on", Kind::Text),
    ("latex", Kind::Number),
    ("laws", Kind::Text),
    ("layout", Kind::Text),
    ("limit", Kind::Numbers),
    ("log", Kind::Flag),
    ("max-accel", Kind::Numbers),
    ("max-gap", Kind::Number),
    ("motion", Kind::Text),
    ("no-config", Kind::Flag),
    ("obstacles", Kind::Number),
    ("offset", Kind::Numbers),
    ("one-vehicle", Kind::Flag),
    ("origin", Kind::Number),
    ("out", Kind::Number),
    ("output", Kind::Number),
    ("plan", Kind::Number),
    ("plan-delay", Kind::Number),
    ("radius", Kind::Numbers),
    ("require-presence", Kind::Flag),
    ("rules", Kind::Text),
    ("runs", Kind::Number),
    ("sample-hz", Kind::Number),
    ("scale", Kind::Number),
    ("scan", Kind::Number),
    ("seed", Kind::Number),
    ("seeds", Kind::Number),
    ("set", Kind::Texts),
    ("shards", Kind::Number),
    ("skip-incomplete", Kind::Flag),
    ("skyb-version", Kind::Number),
    ("sort", Kind::Flag),
    ("start", Kind::Numbers),
    ("threads", Kind::Number),
    ("time-scale", Kind::Number),
    ("time-unit", Kind::Text),
    ("to", Kind::Text),
    ("tolerance", Kind::Number),
    ("topic", Kind::Text),
    ("tube", Kind::Number),
    ("until", Kind::Number),
    ("until-decided", Kind::Number),
    ("until-width", Kind::Number),
    ("vary", Kind::Numbers),
    ("velocity", Kind::Number),
    ("verdict", Kind::Text),
    ("well-clear", Kind::Text),
    ("worst", Kind::Number),
];

/// Words after an option that are not its value.
const NO_VALUES: [&str; 36] = [
    "alone",
    "also",
    "and",
    "are",
    "at",
    "begins",
    "both",
    "change",
    "contradicts",
    "gives",
    "has",
    "ignores",
    "in",
    "is",
    "judges",
    "keep",
    "keeps",
    "leaves",
    "map",
    "maps",
    "must",
    "names",
    "needs",
    "of",
    "once",
    "or",
    "out",
    "requires",
    "select",
    "sets",
    "takes",
    "that",
    "to",
    "two",
    "within",
    "writes",
];

/// Returns a separation [m] with at most six decimals, rounded down.
#[pyfunction]
pub(crate) fn separation_text(distance_m: f64) -> String {
    tautline::text::at_least(distance_m, 6)
}

/// Returns a text of the library with arguments of Python instead of options. `code` is the code of the failure, if the
/// text is a message of one.
#[pyfunction]
#[pyo3(signature = (text, code = None))]
pub(crate) fn in_python(text: &str, code: Option<&str>) -> String {
    let mut words = String::with_capacity(text.len());
    let mut rest = text;
    // Commands in backticks stay as they are.
    let mut is_quoted = false;
    while let Some(next) = rest.chars().next() {
        let begins = words.chars().next_back().is_none_or(|before| before.is_whitespace() || "(,:".contains(before));
        let found = rest.strip_prefix("--").filter(|_| begins && !is_quoted).and_then(|after| option(after, code));
        if let Some((argument, after)) = found {
            words.push_str(&argument);
            rest = after;
        } else {
            is_quoted ^= next == '`';
            words.push(next);
            rest = &rest[next.len_utf8()..];
        }
    }
    words
}

/// Returns the argument for an option at the beginning of a text without its dashes, and the text after it.
fn option<'a>(text: &'a str, code: Option<&str>) -> Option<(String, &'a str)> {
    let end = text.find(|c: char| !(c.is_ascii_lowercase() || c == '-')).unwrap_or(text.len());
    let (name, after) = text.split_at(end);
    let &(_, kind) = OPTIONS.iter().find(|(option, _)| *option == name)?;
    let argument = argument(name, code);
    let kind = if argument == "stop" { Kind::Number } else { kind };
    if kind == Kind::Flag {
        let value = if name == "no-config" { "False" } else { "True" };
        return Some((format!("{argument}={value}"), after));
    }
    let given = after.strip_prefix([' ', '=']).map(|value| {
        let end = value.find(|c: char| c.is_whitespace() || ";)".contains(c)).unwrap_or(value.len());
        value[..end].trim_end_matches([',', ':', '.'])
    });
    let value = given.filter(|value| !value.is_empty()).and_then(|value| Some((value, shown(value, kind)?)));
    Some(match value {
        Some((value, shown)) => (format!("{argument}={shown}"), &after[1 + value.len()..]),
        None => (argument, after),
    })
}

/// Returns the name of the argument for an option.
fn argument(name: &str, code: Option<&str>) -> String {
    let command = code.and_then(|code| code.split('/').next()).unwrap_or_default();
    let argument = match (name, command) {
        ("force", _) => "overwrite",
        ("no-config", _) => "config",
        ("from", "margin") => "start",
        ("to", "margin") => "stop",
        ("key", "sweep") => "keys",
        ("format" | "to", "export") => "to",
        ("from", _) => "from_s",
        ("to", _) => "to_s",
        ("until", _) => "until_s",
        (name, _) => name,
    };
    argument.replace('-', "_")
}

/// Returns a value of an option in Python; `None` if the word is not a value.
fn shown(value: &str, kind: Kind) -> Option<String> {
    let plain = |text: &str| {
        let is_placeholder = |part: &str| part.chars().all(|c| c.is_ascii_uppercase());
        let parts: Vec<_> = text.split(',').collect();
        let are_plain =
            parts.iter().all(|part| !part.is_empty() && (is_placeholder(part) || part.parse::<f64>().is_ok()));
        are_plain.then(|| if parts.len() == 1 { text.to_owned() } else { format!("[{}]", parts.join(", ")) })
    };
    match kind {
        Kind::Flag => None,
        Kind::Number => plain(value),
        Kind::Text => plain(value)
            .filter(|_| value.chars().all(|c| c.is_ascii_uppercase()))
            .or_else(|| (!NO_VALUES.contains(&value)).then(|| format!("{value:?}"))),
        Kind::Numbers | Kind::Texts => match value.split_once('=') {
            None => plain(value),
            Some((name, given)) => {
                let range = given.split_once("..").map(|(low, high)| format!("({low}, {high})"));
                let number = range.or_else(|| plain(given).filter(|_| kind == Kind::Numbers));
                let given = number.unwrap_or_else(|| format!("{given:?}"));
                Some(format!("{{{name:?}: {given}}}"))
            }
        },
    }
}
