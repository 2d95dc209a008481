//! Errors as a person reads them: what, where, and the remedy.

use std::fmt;
use std::io::Write as _;
use std::path::Path;
use std::process::ExitCode;

use miette::{Diagnostic, GraphicalReportHandler, LabeledSpan, NamedSource, SourceCode};

use crate::export::ExportError;
use crate::law::ParameterError;
use crate::read::ReadError;
use crate::record::RecordError;
use crate::report::ArtefactError;
use crate::scenario::ScenarioError;
use crate::sim::SimError;

/// Longest line of a source that is shown in a frame \[bytes\].
const LONGEST_LINE: usize = 400;

/// How the program ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Exit {
    /// Judged and good, or nothing to judge.
    Good = 0,
    /// Judged and bad: a violation, a claim not met.
    Bad = 1,
    /// The input is wrong: usage, scenario, recording.
    WrongInput = 2,
    /// The machine failed: input and output, no adapter.
    MachineFailed = 3,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

/// An error on its way to the user, with the exit code that it means.
#[derive(Debug)]
pub(super) struct Failure {
    exit: Exit,
    message: String,
    help: Option<String>,
    place: Option<Box<Excerpt>>,
}

/// Where in a text an error stands.
#[derive(Debug)]
struct Excerpt {
    source: NamedSource<String>,
    label: LabeledSpan,
}

impl Failure {
    /// The input is wrong.
    pub(super) fn input(message: impl Into<String>, help: impl Into<String>) -> Self {
        Self::plain(Exit::WrongInput, message).with_help(help)
    }

    /// The machine failed.
    pub(super) fn machine(message: impl Into<String>) -> Self {
        Self::plain(Exit::MachineFailed, message)
    }

    /// What an error says: the machine failed, or the input is wrong.
    pub(super) fn told(is_machine: bool, error: &dyn std::error::Error, help: Option<String>) -> Self {
        let exit = if is_machine { Exit::MachineFailed } else { Exit::WrongInput };
        Self { help: help.map(|help| harmless(&help)), ..Self::plain(exit, error.to_string()) }
    }

    pub(super) fn with_help(self, help: impl Into<String>) -> Self {
        Self { help: Some(harmless(&help.into())), ..self }
    }

    /// The same failure, said of a file.
    pub(super) fn of(self, file: &Path) -> Self {
        Self { message: harmless(&format!("{}: {}", file.display(), self.message)), ..self }
    }

    fn plain(exit: Exit, message: impl Into<String>) -> Self {
        Self { exit, message: harmless(&message.into()), help: None, place: None }
    }

    /// What is wrong and what helps, on one line.
    #[cfg(feature = "viewer")]
    pub(super) fn in_words(&self) -> String {
        self.help.as_ref().map_or_else(|| self.message.clone(), |help| format!("{} ({help})", self.message))
    }

    /// Shows the error on standard error.
    pub(super) fn show(&self) -> Exit {
        let mut text = String::new();
        if GraphicalReportHandler::new().render_report(&mut text, self).is_err() {
            text = format!("error: {}\n", self.message);
        }
        // Nobody is left to tell where standard error is closed.
        let _ = std::io::stderr().lock().write_all(text.as_bytes());
        self.exit
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Failure {}

impl Diagnostic for Failure {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.help.as_ref().map(|help| Box::new(help) as Box<dyn fmt::Display>)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.place.as_ref().map(|place| &place.source as &dyn SourceCode)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let label = self.place.as_ref()?.label.clone();
        Some(Box::new(std::iter::once(label)))
    }
}

impl From<ScenarioError> for Failure {
    fn from(error: ScenarioError) -> Self {
        // miette shows whole lines, and none beyond 65,535 columns; the error's own text shows a part of any line.
        if error.place().is_some_and(|place| place.text.lines().any(|line| line.len() > LONGEST_LINE)) {
            return Self::plain(Exit::WrongInput, error.to_string());
        }
        let field = error.field().filter(|_| error.place().is_none());
        let message = match field {
            Some(field) => format!("{field}: {}", error.message()),
            None => error.message().to_owned(),
        };
        Self {
            help: error.help().map(str::to_owned),
            place: error.place().map(|place| {
                Box::new(Excerpt {
                    source: NamedSource::new(&place.source, harmless(&place.text)),
                    label: LabeledSpan::underline(place.span.clone()),
                })
            }),
            ..Self::plain(Exit::WrongInput, message)
        }
    }
}

/// The text with control characters blanked, byte for byte: what a file holds must not steer the terminal.
pub(super) fn harmless(text: &str) -> String {
    let blank =
        |c: char| if c.is_control() && c != '\n' && c != '\t' { " ".repeat(c.len_utf8()) } else { c.to_string() };
    text.chars().map(blank).collect()
}

impl From<RecordError> for Failure {
    fn from(error: RecordError) -> Self {
        match error {
            RecordError::Write { .. } => Self::machine(error.to_string()).with_help(
                "what was recorded before stays readable; free some space or give another folder with --out",
            ),
            RecordError::Open { .. } | RecordError::Read { .. } => Self::plain(Exit::WrongInput, error.to_string()),
        }
    }
}

impl From<ArtefactError> for Failure {
    fn from(error: ArtefactError) -> Self {
        Self::machine(error.to_string()).with_help("free some space or write to another folder")
    }
}

impl From<ReadError> for Failure {
    fn from(error: ReadError) -> Self {
        Self::told(error.is_machine(), &error, Some(error.help()))
    }
}

impl From<ExportError> for Failure {
    fn from(error: ExportError) -> Self {
        Self::told(error.is_machine(), &error, Some(error.help()))
    }
}

impl From<ParameterError> for Failure {
    fn from(error: ParameterError) -> Self {
        Self::plain(Exit::WrongInput, error.to_string())
    }
}

impl From<SimError> for Failure {
    fn from(error: SimError) -> Self {
        match error {
            SimError::Record(error) => error.into(),
            SimError::Law(error) => error.into(),
            SimError::NoLeg | SimError::Vehicles { .. } | SimError::Commands { .. } => {
                Self::plain(Exit::WrongInput, error.to_string())
            }
            SimError::Audit(error) => {
                Self::input(error.to_string(), "choose a safety distance and a number of vehicles that can be judged")
            }
        }
    }
}
