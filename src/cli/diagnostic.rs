//! Errors as a person reads them: what, where, and the remedy.

use std::io::Write as _;
use std::path::Path;
use std::process::ExitCode;

use miette::{GraphicalReportHandler, LabeledSpan, MietteDiagnostic, NamedSource, Report};

use tautline_core::record::RecordError;
use tautline_laws::law::ParameterError;
use tautline_recordings::export::ExportError;
use tautline_recordings::read::ReadError;
use tautline_report::report::ArtefactError;
use tautline_sim::scenario::{Place, ScenarioError};
use tautline_sim::sim::SimError;

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
    pub(super) said: Box<MietteDiagnostic>,
    /// The text that it is about.
    source: Option<Box<NamedSource<String>>>,
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
        let failure = Self::plain(exit, error.to_string());
        match help {
            Some(help) => failure.with_help(help),
            None => failure,
        }
    }

    pub(super) fn with_help(mut self, help: impl Into<String>) -> Self {
        self.said.help = Some(harmless(&help.into()));
        self
    }

    /// The same failure, with what it happened under.
    pub(super) fn under(mut self, what: &str) -> Self {
        self.said.message = harmless(&format!("{what}: {}", self.said.message));
        self
    }

    /// The same failure, whose help says FOLDER for one.
    pub(super) fn naming(mut self, folder: &str) -> Self {
        self.said.help = self.said.help.map(|help| harmless(&help.replace("FOLDER", folder)));
        self
    }

    /// The same failure, said of a file.
    pub(super) fn of(mut self, file: &Path) -> Self {
        self.said.message = harmless(&format!("{}: {}", file.display(), self.said.message));
        self
    }

    /// The same failure, shown at a place in a text.
    pub(super) fn at(mut self, place: &Place) -> Self {
        // miette shows whole lines, and none beyond 65,535 columns.
        if place.text.lines().any(|line| line.len() > LONGEST_LINE) {
            return self.under(&format!("{}:{}:{}", place.source, place.line, place.column));
        }
        self.said.labels = Some(vec![LabeledSpan::underline(place.span.clone())]);
        self.source = Some(Box::new(NamedSource::new(&place.source, harmless(&place.text))));
        self
    }

    fn plain(exit: Exit, message: impl Into<String>) -> Self {
        Self { exit, said: Box::new(MietteDiagnostic::new(harmless(&message.into()))), source: None }
    }

    /// Where in a text it is wrong, what is, and what helps, on one line.
    pub(super) fn in_full(&self) -> String {
        let place = || {
            let (text, labels) = (self.source.as_deref()?, self.said.labels.as_deref()?);
            let before = text.inner().get(..labels.first()?.offset())?;
            Some(format!("{}, line {}: ", text.name(), 1 + before.matches('\n').count()))
        };
        place().unwrap_or_default() + &self.in_words()
    }

    /// How the program ends by it.
    pub(super) fn exit(&self) -> Exit {
        self.exit
    }

    /// What is wrong and what helps, on one line.
    pub(super) fn in_words(&self) -> String {
        let message = &self.said.message;
        self.said.help.as_ref().map_or_else(|| message.clone(), |help| format!("{message} ({help})"))
    }

    /// Shows the error on standard error.
    pub(super) fn show(self) -> Exit {
        let message = self.said.message.clone();
        let mut report = Report::new(*self.said);
        if let Some(source) = self.source {
            report = report.with_source_code(*source);
        }
        let mut text = String::new();
        if GraphicalReportHandler::new().render_report(&mut text, report.as_ref()).is_err() {
            text = format!("error: {message}\n");
        }
        // Nobody is left to tell where standard error is closed.
        let _ = std::io::stderr().lock().write_all(text.as_bytes());
        self.exit
    }
}

impl From<ScenarioError> for Failure {
    fn from(error: ScenarioError) -> Self {
        // miette shows whole lines, and none beyond 65,535 columns; the error's own text shows a part of any line.
        if error.place().is_some_and(|place| place.text.lines().any(|line| line.len() > LONGEST_LINE)) {
            return Self::plain(Exit::WrongInput, error.to_string());
        }
        let message = match error.field().filter(|_| error.place().is_none()) {
            Some(field) => format!("{field}: {}", error.message()),
            None => error.message().to_owned(),
        };
        let mut failure = Self::plain(Exit::WrongInput, message);
        failure.said.help = error.help().map(str::to_owned);
        error.place().into_iter().fold(failure, Self::at)
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
            SimError::NoLeg | SimError::Obstacle(_) | SimError::Vehicles { .. } | SimError::Commands { .. } => {
                Self::plain(Exit::WrongInput, error.to_string())
            }
            SimError::Audit(error) => {
                Self::input(error.to_string(), "choose a safety distance and a number of vehicles that can be judged")
            }
        }
    }
}
