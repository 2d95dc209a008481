//! Where text goes: data to standard output, talk beside it, nothing into a closed pipe.

use std::io::{self, IsTerminal as _, Write as _};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;

use super::Failure;
use super::caller;
use super::diagnostic::harmless;

/// Refresh rate of a progress bar \[Hz\].
const PROGRESS_HZ: u8 = 10;

/// What the user wants to see.
#[derive(Clone, Copy, Debug)]
pub(super) struct Console {
    /// Standard output carries data, so talk goes to standard error.
    pub(super) data_on_stdout: bool,
    /// No talk at all.
    pub(super) quiet: bool,
}

impl Console {
    /// Says something to a person, and nothing to the terminal. What nobody reads any more is dropped.
    pub(super) fn say(self, text: &str) {
        if self.quiet || caller::is_program() {
            return;
        }
        let text = harmless(text.trim_end());
        let _ = if self.data_on_stdout {
            writeln!(io::stderr().lock(), "{text}")
        } else {
            writeln!(io::stdout().lock(), "{text}")
        };
    }

    /// Says something that must not stand between a reader and what was asked for: on standard error.
    pub(super) fn warn(self, text: &str) {
        Self { data_on_stdout: true, ..self }.say(text);
    }

    /// A count of what was read, on a terminal, for work whose end is not known.
    pub(super) fn counter(self, message: String) -> ProgressBar {
        let bar = self.progress(u64::MAX, message);
        if let Ok(style) = ProgressStyle::with_template("{msg} {spinner} {human_pos} samples, {elapsed}") {
            bar.set_style(style);
        }
        bar
    }

    /// A progress bar on a terminal, nothing in a pipe.
    pub(super) fn progress(self, total: u64, message: String) -> ProgressBar {
        if self.quiet || caller::is_program() || !io::stderr().is_terminal() {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr_with_hz(PROGRESS_HZ));
        if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {percent:>3} %, {eta} left") {
            bar.set_style(style);
        }
        bar.set_message(message);
        bar.enable_steady_tick(Duration::from_millis(500));
        bar
    }
}

/// Writes data to standard output, or gives it to the program that called.
pub(super) fn data(text: &str) -> Result<(), Failure> {
    if caller::takes(text) {
        return Ok(());
    }
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::machine(format!("cannot write to standard output: {error}")))
        }
        _ => Ok(()),
    }
}

/// Writes lines that are not for a person beside data on standard output: to standard error. What nobody reads is dropped.
pub(super) fn beside(text: &str) {
    let _ = io::stderr().lock().write_all(text.as_bytes());
}

/// Writes an answer to standard output, as indented JSON.
pub(super) fn json(answer: &impl Serialize) -> Result<(), Failure> {
    match serde_json::to_string_pretty(answer) {
        Ok(json) => data(&(json + "\n")),
        Err(error) => Err(Failure::machine(format!("cannot write the answer: {error}"))),
    }
}

/// The program with these words behind it, for a shell.
pub(super) fn command_line<'a>(words: impl Iterator<Item = &'a str> + Clone) -> String {
    let words = std::iter::once("tautline").chain(words);
    // Only a zero byte cannot be quoted, and no argument has one.
    shlex::try_join(words.clone()).unwrap_or_else(|_| words.collect::<Vec<_>>().join(" "))
}
