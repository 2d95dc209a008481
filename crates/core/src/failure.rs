//! Errors of requests. Each crate converts its own errors to them.

use std::fmt::{self, Display};
use std::ops::{Range, RangeInclusive};
use std::path::Path;

use crate::files::FileError;
use crate::option::{OUT, Opt};
use crate::record::RecordError;
use crate::text::with_short_numbers;

/// Longest line of a source text that is shown in a frame \[bytes\].
pub const LONGEST_LINE: usize = 400;

/// Error of a request: the input is wrong, or the machine failed.
///
/// [`fmt::Display`] writes place, problem and remedy in one line. Control characters of the input are replaced by
/// blanks.
#[derive(Clone, Debug)]
pub struct Failure {
    code: &'static str,
    is_machine: bool,
    message: String,
    help: Option<String>,
    place: Option<Box<Place>>,
}

impl Failure {
    /// Code of the failure after an interruption.
    pub const INTERRUPTED: &'static str = "interrupted";

    /// Returns a failure of the input. `code` is stable, such as `audit/no-limit`.
    #[must_use]
    pub fn input(code: &'static str, message: impl AsRef<str>, help: impl AsRef<str>) -> Self {
        Self::new(code, false, message).with_help(help)
    }

    /// Returns a failure of the machine: no space, no permission, no adapter.
    #[must_use]
    pub fn machine(code: &'static str, message: impl AsRef<str>) -> Self {
        Self::new(code, true, message)
    }

    /// Returns the failure after an interruption.
    #[must_use]
    pub fn interrupted() -> Self {
        Self::machine(Self::INTERRUPTED, "interrupted")
    }

    /// Returns a failure of either kind, without a remedy.
    #[must_use]
    pub fn new(code: &'static str, is_machine: bool, message: impl AsRef<str>) -> Self {
        let message = blanked(&with_short_numbers(message.as_ref()));
        Self { code, is_machine, message, help: None, place: None }
    }

    /// Adds the remedy.
    #[must_use]
    pub fn with_help(mut self, help: impl AsRef<str>) -> Self {
        self.help = Some(blanked(&with_short_numbers(help.as_ref())));
        self
    }

    /// Puts the context in front of the message.
    #[must_use]
    pub fn under(mut self, situation: &str) -> Self {
        self.message = blanked(&format!("{situation}: {}", self.message));
        self
    }

    /// Puts the file in front of the message.
    #[must_use]
    pub fn of(self, file: &Path) -> Self {
        self.under(&file.display().to_string())
    }

    /// Adds the place of the problem in a text.
    #[must_use]
    pub fn at(mut self, place: &Place) -> Self {
        if place.text.lines().any(|line| line.len() > LONGEST_LINE) {
            return self.under(&format!("{}:{}:{}", place.source, place.line, place.column));
        }
        self.place = Some(Box::new(Place { text: blanked(&place.text), ..place.clone() }));
        self
    }

    /// Returns the stable error code, such as `audit/no-limit`.
    #[must_use]
    pub fn code(&self) -> &'static str {
        self.code
    }

    /// Returns whether the machine failed (exit code 3), as opposed to the input (exit code 2).
    #[must_use]
    pub fn is_machine(&self) -> bool {
        self.is_machine
    }

    /// Returns the problem, without place and remedy.
    #[must_use]
    pub fn message(&self) -> &str {
        &self.message
    }

    /// Returns the remedy.
    #[must_use]
    pub fn help(&self) -> Option<&str> {
        self.help.as_deref()
    }

    /// Returns the place of the problem in a text, whose lines are short enough to be shown.
    #[must_use]
    pub fn place(&self) -> Option<&Place> {
        self.place.as_deref()
    }

    /// Returns the problem and its remedy in one line.
    #[must_use]
    pub fn in_words(&self) -> String {
        self.help.as_ref().map_or_else(|| self.message.clone(), |help| format!("{} ({help})", self.message))
    }
}

impl Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(place) = &self.place {
            write!(f, "{}, line {}: ", place.source, place.line)?;
        }
        f.write_str(&self.in_words())
    }
}

impl std::error::Error for Failure {}

/// Replaces control characters by blanks of the same length, because the content of a file must not control a terminal.
#[must_use]
pub fn blanked(text: &str) -> String {
    let blank =
        |c: char| if c.is_control() && c != '\n' && c != '\t' { " ".repeat(c.len_utf8()) } else { c.to_string() };
    text.chars().map(blank).collect()
}

/// Checks that the number of an option is in its range.
///
/// # Errors
/// [`Failure`] with the code `request/out-of-range`.
pub fn in_range<T: PartialOrd + Display>(option: Opt, value: &T, range: &RangeInclusive<T>) -> Result<(), Failure> {
    if range.contains(value) {
        return Ok(());
    }
    let (least, most) = (range.start(), range.end());
    let message = format!("{}: must be from {least} to {most}", option.set(value));
    Err(Failure::input("request/out-of-range", message, "give a number in this range"))
}

/// Place of an error in a text.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// Name of the text: a path, the name of a built-in scenario, or `set` for an override.
    pub source: String,
    /// The whole text.
    pub text: String,
    /// Offending bytes of the text.
    pub span: Range<usize>,
    /// Line of the first offending byte, from 1.
    pub line: usize,
    /// Column of the first offending byte, from 1, in characters.
    pub column: usize,
}

impl Place {
    /// Returns the place of a span of bytes in a text. A span beyond the text or within a character moves to the
    /// nearest boundary before it.
    #[must_use]
    pub fn new(source: &str, text: &str, span: Range<usize>) -> Self {
        let start = floor_char_boundary(text, span.start);
        let end = floor_char_boundary(text, span.end).max(start);
        let line_start = text[..start].rfind('\n').map_or(0, |newline| newline + 1);
        Self {
            source: source.to_owned(),
            text: text.to_owned(),
            span: start..end,
            line: text[..start].bytes().filter(|&byte| byte == b'\n').count() + 1,
            column: text[line_start..start].chars().count() + 1,
        }
    }
}

/// Returns the largest character boundary that is at most `index`.
fn floor_char_boundary(text: &str, index: usize) -> usize {
    (0..=index.min(text.len())).rev().find(|&i| text.is_char_boundary(i)).unwrap_or(0)
}

impl From<RecordError> for Failure {
    fn from(error: RecordError) -> Self {
        match error {
            RecordError::Write { .. } => Self::machine("files/cannot-write", error.to_string()).with_help(format!(
                "the recording up to here is readable; free some space or give another folder with {OUT}"
            )),
            RecordError::Open { .. } => Self::new("files/cannot-read", false, error.to_string()),
            RecordError::Read { .. } => Self::new("recording/malformed", false, error.to_string()),
        }
    }
}

impl From<FileError> for Failure {
    fn from(error: FileError) -> Self {
        let parent = Path::new(&error.path).parent().filter(|parent| !parent.as_os_str().is_empty());
        match parent.filter(|parent| !parent.is_dir()) {
            Some(parent) => {
                let problem = if parent.exists() { "is not a folder" } else { "does not exist" };
                let message = format!("{}: cannot write the file: {} {problem}", error.path, parent.display());
                Self::input("files/no-folder", message, "create the folder first, or give a path in another folder")
            }
            None => Self::machine("files/cannot-write", error.to_string())
                .with_help("free some space or write to another folder"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::option::RUNS;

    #[test]
    fn a_span_outside_the_text_or_within_a_character_is_moved_into_it() {
        assert_eq!(Place::new("f", "aä", 2..99).span, 1..3);
        assert_eq!(Place::new("f", "", 7..9).span, 0..0);
    }

    #[test]
    fn a_number_out_of_range_is_named_by_its_option() {
        let failure = in_range(RUNS, &0, &(1..=9)).expect_err("refused");
        assert_eq!(failure.to_string(), "runs=0: must be from 1 to 9 (give a number in this range)");
        assert!(in_range(RUNS, &9, &(1..=9)).is_ok());
    }
}
