//! `tautline audit` of one recording or of several, and the answers for programs.

use serde::Serialize;

use super::audit_arguments::{Annotations, AuditArguments};
use super::console::{self, Console, Terminal};
use super::{Exit, audit_formats};

use tautline_report::report::recorded::RecordedReport;
use tautline_report::report::write_atomically;
use tautline_report::request::{AuditRequest, Audited, Failure, Monitor as _};

/// Recordings that could not be judged, and why.
type Failures = [(String, Failure)];

/// Judges each recording; the exit code is the worst. One that cannot be judged does not keep the others from it. `command` is
/// the whole command line.
pub(super) fn audits(arguments: &AuditArguments, command: &str) -> Result<Exit, Failure> {
    let recordings = arguments.reading.recordings();
    let is_one = recordings.len() == 1;
    let refuse = |message: &str, help: &str| Err(Failure::input("usage/several-recordings", message, help));
    if !is_one && arguments.html.is_some() {
        let help = "give --join if each file holds a vehicle of one recording, or audit one at a time";
        return refuse("--html is a page on one recording, and several are given", help);
    }
    if !is_one && arguments.proof.is_some() {
        return refuse("--proof is about one recording, and several are given", "audit one at a time");
    }
    let mut asked = Vec::new();
    for paths in recordings {
        let (request, settings) = arguments.request(paths, command);
        // No output replaces an input of any recording, whether its settings can be read or not.
        request.check_outputs(&arguments.outputs())?;
        let configured = settings.and_then(|settings| AuditRequest { settings, ..request.clone() }.configured());
        asked.push((request.subject.called(), configured));
    }
    let mut complete = asked.iter().filter_map(|(_, asked)| asked.as_ref().ok());
    complete.try_for_each(|asked| asked.check_outputs(&arguments.outputs()))?;
    // A log in which a system looks for its own lines has none of ours, which hold foreign names.
    let quiet = arguments.quiet || arguments.annotations.is_some();
    let monitor = Terminal::without_signals(Console { data_on_stdout: arguments.json, quiet });
    let (mut judged, mut failures) = (Vec::new(), Vec::new());
    for (name, asked) in asked {
        if !is_one {
            monitor.say(&format!("{name}:"));
        }
        match asked.and_then(|asked| asked.judge(&monitor)) {
            Ok(audited) => judged.push(audited),
            Err(failure) => {
                if !is_one {
                    monitor.say(&format!("not judged: {}", failure.message()));
                }
                failures.push((name, failure));
            }
        }
    }
    if !is_one {
        monitor.say(&audit_formats::counts(&judged, failures.len()));
    }
    answer(arguments, &judged, &failures, is_one)?;
    let worst = judged.iter().map(|of| Exit::good_if(of.is_good())).max_by_key(|exit| *exit as u8);
    match failures.into_iter().map(|(_, failure)| failure).max_by_key(|failure| Exit::of(failure) as u8) {
        // It was said in a line that means nothing else to the system.
        Some(failure) if arguments.annotations.is_some() => Ok(Exit::of(&failure)),
        Some(failure) => Err(failure),
        None => Ok(worst.unwrap_or(Exit::Good)),
    }
}

/// What is for programs: of one recording by itself, of several as a list, with those that could not be judged and why.
fn answer(arguments: &AuditArguments, judged: &[Audited], failures: &Failures, is_one: bool) -> Result<(), Failure> {
    if arguments.json {
        match judged {
            [] if is_one => {}
            [of] if is_one => console::json(&of.report)?,
            judged => console::json(&Answers::of(judged, failures))?,
        }
    }
    if let Some(Annotations::Github) = arguments.annotations {
        let lines = audit_formats::github(judged, failures);
        if arguments.json { console::beside(&lines) } else { console::data(&lines)? }
    }
    if let Some(file) = &arguments.events {
        write_atomically(file, &audit_formats::csv(judged, !is_one)?)?;
    }
    if let Some(file) = &arguments.junit {
        write_atomically(file, audit_formats::junit(judged, failures)?.as_bytes())?;
    }
    if let Some(file) = &arguments.summary {
        // Pages of jobs are written by one step after another.
        let before = if file.is_file() { std::fs::read(file).unwrap_or_default() } else { Vec::new() };
        write_atomically(file, &[before, audit_formats::markdown(judged, failures).into_bytes()].concat())?;
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
    fn of(judged: &'a [Audited], failures: &'a Failures) -> Self {
        let not_judged = failures
            .iter()
            .map(|(recording, failure)| Answer::NotJudged { recording, error: failure.message().to_owned() });
        Self(judged.iter().map(|of| Answer::Judged(&of.report)).chain(not_judged).collect())
    }
}
