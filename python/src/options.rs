//! Options in messages, in the spelling of Python.

use std::fmt::{Formatter, Result};

use tautline::option::{Opt, ValueKind};

/// Writes an option as an argument of a function, such as `time_unit="ms"`.
pub(crate) fn as_argument(option: Opt, value: Option<&str>, out: &mut Formatter<'_>) -> Result {
    out.write_str(option.field)?;
    match (option.kind, value) {
        (ValueKind::Flag, _) => out.write_str("=True"),
        (ValueKind::Off, _) => out.write_str("=False"),
        (_, None) => Ok(()),
        (kind, Some(value)) => write!(out, "={}", literal(kind, value)),
    }
}

/// Returns the value of an option as a literal of Python.
fn literal(kind: ValueKind, value: &str) -> String {
    let words = || if is_placeholder(value) { value.to_owned() } else { format!("{value:?}") };
    match kind {
        ValueKind::NamedNumber | ValueKind::NamedWord => match value.split_once('=') {
            None => numbers(value).unwrap_or_else(words),
            Some((name, given)) => {
                let range = given.split_once("..").map(|(low, high)| format!("({low}, {high})"));
                let number = range.or_else(|| numbers(given).filter(|_| kind == ValueKind::NamedNumber));
                format!("{{{name:?}: {}}}", number.unwrap_or_else(|| format!("{given:?}")))
            }
        },
        ValueKind::Number => numbers(value).unwrap_or_else(words),
        ValueKind::Flag | ValueKind::Off | ValueKind::Word => words(),
    }
}

fn is_placeholder(text: &str) -> bool {
    text.chars().all(|c| c.is_ascii_uppercase())
}

/// Returns a number, or a list of several; `None` if a part is neither a number nor a placeholder.
fn numbers(value: &str) -> Option<String> {
    let parts: Vec<_> = value.split(',').collect();
    let are_numbers =
        parts.iter().all(|part| !part.is_empty() && (is_placeholder(part) || part.parse::<f64>().is_ok()));
    are_numbers.then(|| if parts.len() == 1 { value.to_owned() } else { format!("[{}]", parts.join(", ")) })
}
