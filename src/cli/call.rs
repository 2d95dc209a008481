//! The program as another program calls it: words in, an answer out, and nothing printed.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::Parser as _;

use super::audit::{Recorded, judge_recorded};
use super::audit_config::configured;
use super::audits::one;
use super::caller::by_program;
use super::command::{Arguments, Command, obey, quiet_guarded_panics};
use super::console::Console;
use super::diagnostic::{Exit, Failure};
use super::own::OwnRecording;
use tautline_core::track::Tracks;
use tautline_recordings::read::{ReadError, Recording};
use tautline_report::report::recorded::RecordedReport;

/// What a command answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// Whether its exit code is 0: judged and good. It is 1 otherwise.
    pub is_good: bool,
    /// What it wrote for programs, such as the report that `--json` asks for.
    pub data: String,
}

/// Why a command has no answer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct Refusal {
    /// Whether the machine failed (exit code 3) and not the input (exit code 2).
    pub is_machine: bool,
    /// What is wrong, where, and what helps.
    pub message: String,
}

/// Motion that a program holds itself, to be judged.
pub struct Held<'a> {
    /// How the program would ask again, for a person to read.
    pub command: &'a str,
    /// What it says of itself, where it is a flight of ours: as of our recordings, what the run saw between the instants binds, and
    /// its limits and obstacles are asked about where the words ask nothing.
    pub own: Option<&'a OwnRecording>,
    /// Opens the motion, each time from its beginning.
    pub open: &'a dyn Fn() -> Result<Box<dyn Tracks<Error = ReadError> + 'a>, ReadError>,
}

/// Runs the command of these words, which do not begin with the program's name: what `tautline WORDS` does in a process of
/// its own. `input` stands for standard input, where the words ask for a scenario `-`. Ctrl-C is the caller's; it ends the work
/// by setting `interrupted`.
///
/// ```
/// # use std::sync::Arc;
/// let words = ["list", "--show", "pentagon"].map(str::to_owned);
/// let answer = tautline::cli::call(&words, None, &Arc::default())?;
/// assert!(answer.is_good && answer.data.contains("[formation]"));
/// # Ok::<(), tautline::cli::Refusal>(())
/// ```
///
/// # Errors
/// [`Refusal`] where the exit code would be 2 or 3.
pub fn call(words: &[String], input: Option<&str>, interrupted: &Arc<AtomicBool>) -> Result<Answer, Refusal> {
    quiet_guarded_panics();
    let command = parsed(words)?;
    let (done, data) = by_program(words, input, interrupted, || obey(command));
    match done? {
        exit @ (Exit::Good | Exit::Bad) => Ok(Answer { is_good: exit == Exit::Good, data }),
        exit => Err(Refusal { is_machine: exit == Exit::MachineFailed, message: data }),
    }
}

/// Judges a recording as `tautline WORDS` does, where the words are those of `audit`; or motion that the caller `held`s itself,
/// whose name then stands for the recording in the words. Nothing is written but what `--html` asks for.
///
/// # Errors
/// [`Refusal`] where the exit code would be 2 or 3.
pub fn judge(
    words: &[String],
    held: Option<&Held<'_>>,
    interrupted: &Arc<AtomicBool>,
) -> Result<RecordedReport, Refusal> {
    quiet_guarded_panics();
    let refused = |message: &str| Refusal { is_machine: false, message: message.to_owned() };
    let Command::Audit(arguments) = parsed(words)? else {
        return Err(refused("the words are not those of `audit`"));
    };
    if arguments.reading.recordings().len() > 1 {
        return Err(refused("several recordings are given, and one is judged (judge each by itself, or join them)"));
    }
    let console = Console { data_on_stdout: true, quiet: true };
    let work = || match held {
        None => Ok(one(arguments, console)?.report),
        Some(held) => {
            // Beside what a program holds there is no folder to find settings in.
            let arguments = if arguments.config.is_some() { configured(arguments)? } else { arguments };
            arguments.check_outputs()?;
            let command = held.command.to_owned();
            let recorded = Recorded { own: held.own.cloned(), own_limit_m: None, command, open: held.open };
            judge_recorded(&arguments, recorded, console)
        }
    };
    Ok(by_program(words, None, interrupted, work).0?)
}

/// Opens a recording as `tautline WORDS` does, where the words are those of `audit`.
///
/// # Errors
/// [`Refusal`] where the words or the recording are wrong.
pub fn open(words: &[String]) -> Result<Recording, Refusal> {
    quiet_guarded_panics();
    let Command::Audit(arguments) = parsed(words)? else {
        return Err(Refusal { is_machine: false, message: "the words are not those of `audit`".to_owned() });
    };
    Ok(arguments.open()?)
}

fn parsed(words: &[String]) -> Result<Command, Refusal> {
    let arguments = Arguments::try_parse_from(std::iter::once("tautline").chain(words.iter().map(String::as_str)));
    let refused = |usage: clap::Error| {
        let text = usage.render().to_string();
        // What is wrong, without how the program is used and where to read on.
        let message = text.split("\n\nUsage").next().unwrap_or(&text).split("\n\nFor more").next().unwrap_or(&text);
        Refusal { is_machine: false, message: message.trim_start_matches("error: ").trim_end().to_owned() }
    };
    let none = Refusal { is_machine: false, message: "there is no command".to_owned() };
    arguments.map_err(refused)?.command.ok_or(none)
}

impl From<Failure> for Refusal {
    fn from(failure: Failure) -> Self {
        Self { is_machine: failure.exit() == Exit::MachineFailed, message: failure.in_full() }
    }
}
