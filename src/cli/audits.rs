//! `tautline audit` of one recording or of several, and the answers for programs.

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
    let (mut reports, mut failed) = (Vec::new(), None);
    for reading in recordings {
        if !is_one {
            console.say(&format!("{}:", reading.recording.display()));
        }
        let mut one = arguments.clone();
        one.reading = reading;
        match judge(&one, console) {
            Ok(report) => reports.push(report),
            Err(failure) => {
                if !is_one {
                    console.say(&format!("not judged: {}", failure.said));
                }
                failed = failed.or(Some(failure));
            }
        }
    }
    // Programs get what could be judged; that something could not is the exit code.
    if failed.is_none() || !reports.is_empty() {
        answer(arguments, &reports, is_one)?;
    }
    if let Some(failure) = failed {
        return Err(failure);
    }
    let is_good = |report: &RecordedReport| match report.status {
        Status::Clear => true,
        Status::Undecided => arguments.allow_undecided,
        Status::Violation => false,
    };
    Ok(if reports.iter().all(is_good) { Exit::Good } else { Exit::Bad })
}

/// What is for programs: of one recording by itself, of several as a list.
fn answer(arguments: &AuditArguments, reports: &[RecordedReport], is_one: bool) -> Result<(), Failure> {
    if arguments.json {
        match reports {
            [report] if is_one => console::json(report)?,
            reports => console::json(&reports)?,
        }
    }
    if let Some(file) = &arguments.events {
        write_atomically(file, &events::csv(reports, !is_one)?)?;
    }
    if let Some(file) = &arguments.junit {
        write_atomically(file, events::junit(reports, arguments.allow_undecided)?.as_bytes())?;
    }
    Ok(())
}
