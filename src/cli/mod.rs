//! The command line, one file per command. Only this module prints.
//!
//! Exit codes are the same for all commands: 0 judged and good, 1 judged and bad, 2 wrong input, 3 the machine failed.
//! Human text goes to standard output, or to standard error where standard output carries data.

mod audit;
mod audit_formats;
mod campaign;
mod check;
mod command;
mod console;
mod diagnostic;
#[cfg(feature = "viewer")]
mod drawing;
#[cfg(all(feature = "viewer", target_os = "linux"))]
mod driver;
mod export;
mod list;
mod pictures;
mod reading;
#[cfg(feature = "viewer")]
mod render;
mod run;
mod scenario;
mod studies;
mod validate;
#[cfg(feature = "viewer")]
mod view;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::Parser as _;

use command::{Arguments, Command, dispatch, quiet_guarded_panics};
use diagnostic::Exit;
use tautline_report::request::command_line;

/// Runs the program with the arguments of the process.
#[must_use]
pub fn main() -> ExitCode {
    entry(&std::env::args_os().collect::<Vec<_>>()).into()
}

/// Runs the program with these arguments, the first of which is its own name, and gives its exit code.
#[must_use]
pub fn entry(arguments: &[OsString]) -> u8 {
    quiet_guarded_panics();
    let words: Vec<_> = arguments.iter().skip(1).map(|word| word.to_string_lossy().into_owned()).collect();
    let line = command_line(words.iter().map(String::as_str));
    let arguments = match Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(usage) => {
            // A closed pipe is the reader's choice.
            let _ = usage.print();
            return if usage.use_stderr() { Exit::WrongInput } else { Exit::Good } as u8;
        }
    };
    let command = arguments.command.unwrap_or_else(|| Command::Run(run::RunArguments::parse_from(["run"])));
    #[cfg(all(feature = "viewer", target_os = "linux"))]
    if match &command {
        Command::Run(run) => run.draws(),
        Command::Compare(compare) => compare.draws(),
        Command::Attack(attack) => attack.draws(),
        other => matches!(other, Command::Campaign(_) | Command::Render(_) | Command::View(_)),
    } {
        driver::silence();
    }
    dispatch(command, &line).unwrap_or_else(|failure| diagnostic::show(&failure)) as u8
}
