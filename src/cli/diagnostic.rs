//! Errors on standard error: code, place, problem and remedy.

use std::io::Write as _;
use std::process::ExitCode;

use miette::{GraphicalReportHandler, LabeledSpan, MietteDiagnostic, NamedSource, Report};

use tautline_report::request::Failure;

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

impl Exit {
    /// The end after a failure.
    pub(super) fn of(failure: &Failure) -> Self {
        if failure.is_machine() { Self::MachineFailed } else { Self::WrongInput }
    }

    /// The end after an answer.
    pub(super) fn good_if(is_good: bool) -> Self {
        if is_good { Self::Good } else { Self::Bad }
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

/// Shows a failure on standard error.
pub(super) fn show(failure: &Failure) -> Exit {
    let mut diagnostic = MietteDiagnostic::new(failure.message()).with_code(failure.code());
    diagnostic.help = failure.help().map(str::to_owned);
    let report = match failure.place() {
        Some(place) => {
            diagnostic.labels = Some(vec![LabeledSpan::underline(place.span.clone())]);
            Report::new(diagnostic).with_source_code(NamedSource::new(&place.source, place.text.clone()))
        }
        None => Report::new(diagnostic),
    };
    let mut text = String::new();
    if GraphicalReportHandler::new().render_report(&mut text, report.as_ref()).is_err() {
        text = format!("error: {failure}\n");
    }
    // An error here means that standard error is closed.
    let _ = std::io::stderr().lock().write_all(text.as_bytes());
    Exit::of(failure)
}
