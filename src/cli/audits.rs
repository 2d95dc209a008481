//! `tautline audit` of one recording or of several, and the answers for programs.

use serde::Serialize;

use super::audit::{AuditArguments, judge};
use super::console::{self, Console};
use super::{Exit, Failure, events};
use crate::report::recorded::RecordedReport;
use crate::report::{Status, write_atomically};

/// Judges each recording; bad where one is. One that cannot be judged does not keep the others from it, and fails the whole.
pub(super) fn audits(arguments: &AuditArguments) -> Result<Exit, Failure> {
    let recordings = arguments.reading.recordings();
    let is_one = recordings.len() == 1;
    if !is_one && arguments.html.is_some() {
        let help = "give --join if each file holds a vehicle of one recording, or audit one at a time";
        return Err(Failure::input("--html is a page on one recording, and several are given", help));
    }
    arguments.check_outputs()?;
    let console = Console { data_on_stdout: arguments.json, quiet: arguments.quiet };
    let (mut reports, mut failures) = (Vec::new(), Vec::new());
    for reading in recordings {
        if !is_one {
            console.say(&format!("{}:", reading.called()));
        }
        let name = reading.called();
        let mut one = arguments.clone();
        one.reading = reading;
        match judge(&one, console) {
            Ok(report) => reports.push(report),
            Err(failure) => {
                if !is_one {
                    console.say(&format!("not judged: {}", failure.said));
                }
                failures.push((name, failure));
            }
        }
    }
    if !is_one || failures.is_empty() {
        answer(arguments, &reports, &failures, is_one)?;
    }
    if let Some((_, failure)) = failures.into_iter().next() {
        return Err(failure);
    }
    let is_good = |report: &RecordedReport| match report.status {
        Status::Clear => true,
        Status::Undecided => arguments.allow_undecided,
        Status::Violation => false,
    };
    Ok(if reports.iter().all(is_good) { Exit::Good } else { Exit::Bad })
}

/// What is for programs: of one recording by itself, of several as a list, with those that could not be judged and why.
fn answer(
    arguments: &AuditArguments,
    reports: &[RecordedReport],
    failures: &[(String, Failure)],
    is_one: bool,
) -> Result<(), Failure> {
    if arguments.json {
        match reports {
            [report] if is_one => console::json(report)?,
            reports => console::json(&Answers::of(reports, failures))?,
        }
    }
    if let Some(file) = &arguments.events {
        write_atomically(file, &events::csv(reports, !is_one)?)?;
    }
    if let Some(file) = &arguments.junit {
        write_atomically(file, events::junit(reports, failures, arguments.allow_undecided)?.as_bytes())?;
    }
    Ok(())
}

/// An answer for each of several recordings.
#[derive(Serialize)]
#[serde(transparent)]
struct Answers<'a>(Vec<Answer<'a>>);

#[derive(Serialize)]
#[serde(untagged)]
enum Answer<'a> {
    Judged(&'a RecordedReport),
    NotJudged { recording: &'a str, error: String },
}

impl<'a> Answers<'a> {
    fn of(reports: &'a [RecordedReport], failures: &'a [(String, Failure)]) -> Self {
        let not_judged = failures
            .iter()
            .map(|(recording, failure)| Answer::NotJudged { recording, error: failure.said.to_string() });
        Self(reports.iter().map(Answer::Judged).chain(not_judged).collect())
    }
}
