//! `tautline audit` of one recording or of several, and the answers for programs.

use serde::Serialize;

use super::audit::judge;
use super::audit_arguments::{Annotations, AuditArguments};
use super::audit_config;
use super::console::{self, Console};
use super::judgement::Judgement;
use super::{Exit, Failure, events, summary};
use tautline_report::report::recorded::RecordedReport;
use tautline_report::report::write_atomically;

/// Recordings that could not be judged, and why.
type Failures = [(String, Failure)];

/// Judges each recording; the exit code is the worst. One that cannot be judged does not keep the others from it.
pub(super) fn audits(arguments: &AuditArguments) -> Result<Exit, Failure> {
    let recordings = arguments.reading.recordings();
    let is_one = recordings.len() == 1;
    if !is_one && arguments.html.is_some() {
        let help = "give --join if each file holds a vehicle of one recording, or audit one at a time";
        return Err(Failure::input("--html is a page on one recording, and several are given", help));
    }
    if !is_one && arguments.proof.is_some() {
        return Err(Failure::input("--proof is about one recording, and several are given", "audit one at a time"));
    }
    arguments.check_outputs()?;
    let asked: Vec<_> = recordings
        .into_iter()
        .map(|reading| (reading.called(), audit_config::configured(AuditArguments { reading, ..arguments.clone() })))
        .collect();
    // Nothing is written where something would be written over what is read, of whichever recording.
    asked.iter().filter_map(|(_, asked)| asked.as_ref().ok()).try_for_each(AuditArguments::check_outputs)?;
    // A log in which a system looks for its own lines has none of ours, which hold foreign names.
    let quiet = arguments.quiet || arguments.annotations.is_some();
    let console = Console { data_on_stdout: arguments.json, quiet };
    let (mut judged, mut failures) = (Vec::new(), Vec::new());
    for (name, asked) in asked {
        if !is_one {
            console.say(&format!("{name}:"));
        }
        match asked.and_then(|asked| judgement(&asked, console)) {
            Ok(judgement) => judged.push(judgement),
            Err(failure) => {
                if !is_one {
                    console.say(&format!("not judged: {}", failure.said));
                }
                failures.push((name, failure));
            }
        }
    }
    if !is_one {
        console.say(&summary::counts(&judged, failures.len()));
    }
    answer(arguments, &judged, &failures, is_one)?;
    let worst = judged.iter().map(Judgement::exit).max_by_key(|exit| *exit as u8).unwrap_or(Exit::Good);
    match failures.into_iter().map(|(_, failure)| failure).max_by_key(|failure| failure.exit() as u8) {
        // It was said in a line that means nothing else to the system.
        Some(failure) if arguments.annotations.is_some() => Ok(failure.exit()),
        Some(failure) => Err(failure),
        None => Ok(worst),
    }
}

/// Judges one recording as it and the file of settings beside it ask.
pub(super) fn one(arguments: AuditArguments, console: Console) -> Result<Judgement, Failure> {
    let arguments = audit_config::configured(arguments)?;
    arguments.check_outputs()?;
    judgement(&arguments, console)
}

fn judgement(arguments: &AuditArguments, console: Console) -> Result<Judgement, Failure> {
    let (allows_undecided, asked_by) = (arguments.allow_undecided, arguments.asked_by.clone());
    Ok(Judgement { report: judge(arguments, console)?, allows_undecided, asked_by })
}

/// What is for programs: of one recording by itself, of several as a list, with those that could not be judged and why.
fn answer(arguments: &AuditArguments, judged: &[Judgement], failures: &Failures, is_one: bool) -> Result<(), Failure> {
    if arguments.json {
        match judged {
            [] if is_one => {}
            [of] if is_one => console::json(&of.report)?,
            judged => console::json(&Answers::of(judged, failures))?,
        }
    }
    if let Some(Annotations::Github) = arguments.annotations {
        let lines = summary::github(judged, failures);
        if arguments.json { console::beside(&lines) } else { console::data(&lines)? }
    }
    if let Some(file) = &arguments.events {
        write_atomically(file, &events::csv(judged, !is_one)?)?;
    }
    if let Some(file) = &arguments.junit {
        write_atomically(file, events::junit(judged, failures)?.as_bytes())?;
    }
    if let Some(file) = &arguments.summary {
        // Pages of jobs are written by one step after another.
        let before = if file.is_file() { std::fs::read(file).unwrap_or_default() } else { Vec::new() };
        write_atomically(file, &[before, summary::markdown(judged, failures).into_bytes()].concat())?;
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
    fn of(judged: &'a [Judgement], failures: &'a Failures) -> Self {
        let not_judged = failures
            .iter()
            .map(|(recording, failure)| Answer::NotJudged { recording, error: failure.said.to_string() });
        Self(judged.iter().map(|of| Answer::Judged(&of.report)).chain(not_judged).collect())
    }
}
