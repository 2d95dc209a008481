//! Output of the program: text, data, progress, failures and exit codes.

use std::io::{self, IsTerminal as _, Write as _};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use miette::{GraphicalReportHandler, LabeledSpan, MietteDiagnostic, NamedSource, Report};
use serde::Serialize;

use tautline_report::request::{Failure, Monitor, blanked};

/// Refresh rate of a progress bar \[Hz\].
const PROGRESS_HZ: u8 = 10;
/// Exit code of a second Ctrl-C, as shells give it.
const INTERRUPTED_TWICE: i32 = 130;

/// Output settings of a command.
#[derive(Clone, Copy, Debug)]
pub(super) struct Console {
    /// Whether standard output carries data; text then goes to standard error.
    pub(super) data_on_stdout: bool,
    /// Whether text is suppressed.
    pub(super) quiet: bool,
}

impl Console {
    /// Prints text without control characters. A closed stream is ignored.
    pub(super) fn say(self, text: &str) {
        if self.quiet {
            return;
        }
        let text = blanked(text.trim_end());
        let _ = if self.data_on_stdout {
            writeln!(io::stderr().lock(), "{text}")
        } else {
            writeln!(io::stdout().lock(), "{text}")
        };
    }

    /// Prints a warning on standard error.
    pub(super) fn warn(self, text: &str) {
        Self { data_on_stdout: true, ..self }.say(text);
    }

    /// Returns a progress bar on a terminal, hidden in a pipe; a counter if the total is unknown.
    pub(super) fn progress(self, total: Option<u64>, message: String) -> ProgressBar {
        if self.quiet || !io::stderr().is_terminal() {
            return ProgressBar::hidden();
        }
        let target = ProgressDrawTarget::stderr_with_hz(PROGRESS_HZ);
        let bar = ProgressBar::with_draw_target(total.or(Some(u64::MAX)), target);
        let template = match total {
            Some(_) => "{msg} {wide_bar} {percent:>3} %, {eta} left",
            None => "{msg} {spinner} {human_pos} samples, {elapsed}",
        };
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        bar.set_message(message);
        bar.enable_steady_tick(Duration::from_millis(500));
        bar
    }
}

/// Monitor of a request on the terminal. The first Ctrl-C or request to terminate interrupts the work, the second ends
/// the process.
pub(super) struct Terminal {
    console: Console,
    bar: Mutex<ProgressBar>,
    interruption: Arc<AtomicBool>,
}

impl Terminal {
    /// Returns a terminal that handles Ctrl-C.
    pub(super) fn new(console: Console) -> Result<Self, Failure> {
        let interruption = Arc::new(AtomicBool::new(false));
        let flag = Arc::clone(&interruption);
        let again = move || {
            if flag.swap(true, Ordering::Relaxed) {
                std::process::exit(INTERRUPTED_TWICE);
            }
        };
        ctrlc::set_handler(again)
            .map_err(|error| Failure::machine("machine/signals", format!("cannot listen to Ctrl-C: {error}")))?;
        Ok(Self::with(console, interruption))
    }

    /// Returns a terminal that leaves Ctrl-C to the system, which ends the program.
    pub(super) fn without_signals(console: Console) -> Self {
        Self::with(console, Arc::default())
    }

    fn with(console: Console, interruption: Arc<AtomicBool>) -> Self {
        Self { console, bar: Mutex::new(ProgressBar::hidden()), interruption }
    }

    fn bar(&self) -> ProgressBar {
        self.bar.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

impl Monitor for Terminal {
    fn interruption(&self) -> &Arc<AtomicBool> {
        &self.interruption
    }

    fn say(&self, text: &str) {
        self.bar().suspend(|| self.console.say(text));
    }

    fn warn(&self, text: &str) {
        self.bar().suspend(|| self.console.warn(text));
    }

    fn data(&self, text: &str) -> Result<(), Failure> {
        data(text)
    }

    fn begin(&self, task: &str, total: Option<u64>) {
        *self.bar.lock().unwrap_or_else(PoisonError::into_inner) = self.console.progress(total, task.to_owned());
    }

    fn advance(&self, units: u64) {
        self.bar().inc(units);
    }

    fn finish(&self) {
        self.bar().finish_and_clear();
    }
}

/// Writes data to standard output.
pub(super) fn data(text: &str) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            let message = format!("cannot write to standard output: {error}");
            Err(Failure::machine("files/cannot-write", message))
        }
        _ => Ok(()),
    }
}

/// Writes lines of data to standard error, beside data on standard output. A closed stream is ignored.
pub(super) fn beside(text: &str) {
    let _ = io::stderr().lock().write_all(text.as_bytes());
}

/// Writes an answer to standard output, as indented JSON.
pub(super) fn json(answer: &impl Serialize) -> Result<(), Failure> {
    match serde_json::to_string_pretty(answer) {
        Ok(json) => data(&(json + "\n")),
        Err(error) => Err(Failure::machine("files/cannot-write", format!("cannot write the answer: {error}"))),
    }
}

/// Exit code of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Exit {
    /// Good verdict, or nothing to judge.
    Good = 0,
    /// Bad verdict: a violation, or a claim that is not met.
    Bad = 1,
    /// Wrong input: arguments, scenario, recording.
    WrongInput = 2,
    /// Failure of the machine: input and output, no adapter.
    MachineFailed = 3,
}

impl Exit {
    /// Returns the exit code of a failure.
    pub(super) fn of(failure: &Failure) -> Self {
        if failure.is_machine() { Self::MachineFailed } else { Self::WrongInput }
    }

    /// Returns the exit code of a verdict.
    pub(super) fn good_if(is_good: bool) -> Self {
        if is_good { Self::Good } else { Self::Bad }
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

/// Prints a failure on standard error.
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
    let _ = io::stderr().lock().write_all(text.as_bytes());
    Exit::of(failure)
}
