//! Output of the program: text, data, progress, failures and exit codes.

use std::io::{self, IsTerminal as _, Write as _};
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet, normalize_untrusted_str};
use anstream::stream::RawStream;
use anstream::{AutoStream, ColorChoice};
use anstyle::{AnsiColor, Style};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;

use tautline_report::request::{Failure, Monitor, blanked};

/// Refresh rate of a progress bar \[Hz\].
const PROGRESS_HZ: u8 = 10;

/// Output settings of a command.
#[derive(Clone, Copy, Debug)]
pub(super) struct Console {
    /// Whether standard output carries data; text then goes to standard error.
    pub(super) data_on_stdout: bool,
    /// Whether text is suppressed.
    pub(super) quiet: bool,
}

/// Words of verdicts with their colours. Of words with a common beginning the longest comes first.
const VERDICTS: [(&str, AnsiColor); 13] = [
    ("CERTIFICATE BROKEN", AnsiColor::Red),
    ("CLEAR", AnsiColor::Green),
    ("INTERRUPTED", AnsiColor::Yellow),
    ("NOT REACHED", AnsiColor::Yellow),
    ("OFF PLAN", AnsiColor::Red),
    ("PROVED CLEAR", AnsiColor::Green),
    ("PROVED", AnsiColor::Green),
    ("REACHED", AnsiColor::Green),
    ("READY", AnsiColor::Green),
    ("REFUSED BY CHECK", AnsiColor::Red),
    ("REFUSED", AnsiColor::Red),
    ("UNDECIDED", AnsiColor::Yellow),
    ("VIOLATION", AnsiColor::Red),
];

/// Returns a text with colours for the verdict that begins a line, or follows its first `: `, and for counts of unknown
/// flights such as `2 unknown`. Other words may be names of the user.
fn coloured(text: &str) -> String {
    text.split_inclusive('\n').map(coloured_line).collect()
}

fn coloured_line(line: &str) -> String {
    let starts_word = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-' | '/' | '.');
    // A row of a table may begin with the name of a vehicle.
    let is_name = |after: &str| after.starts_with(" and ") || after.starts_with("  ");
    let verdict_at = |at: usize| {
        let ends = |after: &str| !after.starts_with(starts_word) && !is_name(after);
        let is_verdict = |word: &str| line[at..].strip_prefix(word).is_some_and(ends);
        VERDICTS.iter().find(|(word, _)| is_verdict(word)).map(|(word, colour)| (at, word.len(), *colour))
    };
    let unknown = || {
        let end = line.find(" unknown")?;
        let digits = line[..end].trim_end_matches(|c: char| c.is_ascii_digit() || c == ',').len();
        let is_count = !matches!(&line[digits..end], "" | "0");
        is_count.then_some((digits, end + " unknown".len() - digits, AnsiColor::Yellow))
    };
    let later = line.find(": ").and_then(|colon| verdict_at(colon + 2));
    let found = [verdict_at(0).or(later), unknown()];
    let (mut shown, mut done) = (String::with_capacity(line.len()), 0);
    for (at, length, colour) in found.into_iter().flatten().filter(|(at, ..)| *at < line.len()) {
        if at < done {
            continue;
        }
        let style = Style::new().bold().fg_color(Some(colour.into()));
        shown.push_str(&line[done..at]);
        shown.extend([&style.render().to_string(), &line[at..at + length], &style.render_reset().to_string()]);
        done = at + length;
    }
    shown + &line[done..]
}

/// Sets whether the output of this process has colours, help and errors of arguments included, by the option `--color`.
/// Otherwise the environment decides.
pub(super) fn set_colours(words: &[String]) {
    let mut given = words.iter().zip(words.iter().skip(1)).filter(|(option, _)| *option == "--color");
    let joined = words.iter().find_map(|word| word.strip_prefix("--color="));
    match given.next().map(|(_, value)| value.as_str()).or(joined) {
        Some("always") => ColorChoice::Always,
        Some("never") => ColorChoice::Never,
        _ => ColorChoice::Auto,
    }
    .write_global();
}

/// Returns whether a stream has colours. `CLICOLOR_FORCE=0` asks for no more than the default, but `anstream` forces
/// colours for any value.
fn colour_choice(stream: &impl RawStream) -> ColorChoice {
    let is_given = ColorChoice::global() != ColorChoice::Auto;
    let forces_nothing = !is_given && std::env::var_os("CLICOLOR_FORCE").is_some_and(|value| value == "0");
    if forces_nothing && !stream.is_terminal() { ColorChoice::Never } else { AutoStream::choice(stream) }
}

impl Console {
    /// Prints text without control characters. A closed stream is ignored.
    pub(super) fn say(self, text: &str) {
        if self.quiet {
            return;
        }
        let text = coloured(&blanked(text.trim_end()));
        // These streams remove the colours unless they are a terminal; they observe NO_COLOR and CLICOLOR_FORCE.
        let _ = if self.data_on_stdout {
            writeln!(AutoStream::new(io::stderr(), colour_choice(&io::stderr())), "{text}")
        } else {
            writeln!(AutoStream::new(io::stdout(), colour_choice(&io::stdout())), "{text}")
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
    bar: Arc<Mutex<ProgressBar>>,
    interruption: Arc<AtomicBool>,
    /// Message of the first Ctrl-C while work cannot be interrupted: it ends the process.
    abandonment: Arc<Mutex<Option<&'static str>>>,
}

impl Terminal {
    /// Returns a terminal that handles Ctrl-C.
    pub(super) fn new(console: Console) -> Result<Self, Failure> {
        Self::listening(console, None)
    }

    /// Returns a terminal for work that cannot be continued: the first Ctrl-C prints `message` and ends the process.
    pub(super) fn that_abandons(console: Console, message: &'static str) -> Result<Self, Failure> {
        Self::listening(console, Some(message))
    }

    /// Returns a terminal that leaves Ctrl-C to the system, which ends the program.
    pub(super) fn without_signals(console: Console) -> Self {
        let bar = Arc::new(Mutex::new(ProgressBar::hidden()));
        Self { console, bar, interruption: Arc::default(), abandonment: Arc::default() }
    }

    /// Returns the output settings.
    pub(super) fn console(&self) -> Console {
        self.console
    }

    /// From now on the first Ctrl-C interrupts the work and does not end the process.
    #[cfg(feature = "viewer")]
    pub(super) fn abandons_no_more(&self) {
        *locked(&self.abandonment) = None;
    }

    fn listening(console: Console, abandonment: Option<&'static str>) -> Result<Self, Failure> {
        let terminal = Self::without_signals(console);
        *locked(&terminal.abandonment) = abandonment;
        let (flag, bar) = (Arc::clone(&terminal.interruption), Arc::clone(&terminal.bar));
        let abandonment = Arc::clone(&terminal.abandonment);
        let handler = move || {
            let message = *locked(&abandonment);
            if flag.swap(true, Ordering::Relaxed) || message.is_some() {
                locked(&bar).finish_and_clear();
                if let Some(message) = message {
                    console.warn(message);
                }
                std::process::exit(Exit::Interrupted as i32);
            }
        };
        ctrlc::set_handler(handler)
            .map_err(|error| Failure::machine("machine/signals", format!("cannot listen to Ctrl-C: {error}")))?;
        Ok(terminal)
    }

    /// Opens a page in the browser; warns if that fails.
    pub(super) fn open_page(&self, page: &Path) {
        if let Err(error) = open::that_detached(page) {
            self.warn(&format!("note: cannot open {} in a browser: {error}", page.display()));
        }
    }

    fn bar(&self) -> ProgressBar {
        locked(&self.bar).clone()
    }
}

fn locked<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
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
        *locked(&self.bar) = self.console.progress(total, task.to_owned());
    }

    fn advance(&self, units: u64) {
        self.bar().inc(units);
    }

    fn finish(&self) {
        self.bar().finish_and_clear();
    }
}

/// Prints a help. A closed stream is ignored.
pub(super) fn help(help: &clap::builder::StyledStr) {
    let _ = write!(AutoStream::new(io::stdout(), colour_choice(&io::stdout())), "{}", help.ansi());
}

/// Prints the help, the version, or an error of the arguments. A closed stream is ignored.
pub(super) fn usage(usage: &clap::Error) {
    let text = usage.render().ansi().to_string();
    let _ = if usage.use_stderr() {
        write!(AutoStream::new(io::stderr(), colour_choice(&io::stderr())), "{text}")
    } else {
        write!(AutoStream::new(io::stdout(), colour_choice(&io::stdout())), "{text}")
    };
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

/// Returns an answer as indented JSON.
pub(super) fn to_json(answer: &impl Serialize) -> Result<String, Failure> {
    match serde_json::to_string_pretty(answer) {
        Ok(json) => Ok(json + "\n"),
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
    /// Ctrl-C, with the code of shells for it.
    Interrupted = 130,
}

impl Exit {
    /// Returns the exit code of a failure.
    pub(super) fn of(failure: &Failure) -> Self {
        match failure.code() {
            Failure::INTERRUPTED => Self::Interrupted,
            _ if failure.is_machine() => Self::MachineFailed,
            _ => Self::WrongInput,
        }
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

/// Prints a failure on standard error: what is wrong, where, the remedy, and the code.
pub(super) fn show(failure: &Failure) -> Exit {
    let mut error = Group::with_title(Level::ERROR.primary_title(failure.message()));
    if let Some(place) = failure.place() {
        let annotation = AnnotationKind::Primary.span(place.span.clone());
        error = error.element(Snippet::source(&place.text).path(&place.source).annotation(annotation));
    }
    if let Some(help) = failure.help() {
        error = error.element(Level::HELP.message(normalize_untrusted_str(help)));
    }
    error = error.element(Level::NOTE.with_name("code").message(failure.code()));
    let text = Renderer::styled().render(&[error]);
    // An error here means that standard error is closed.
    let _ = writeln!(AutoStream::new(io::stderr(), colour_choice(&io::stderr())), "{text}");
    Exit::of(failure)
}

#[cfg(test)]
mod tests {
    use super::coloured;

    #[test]
    fn verdicts_have_colours_as_whole_words_only() {
        for (text, colour) in [
            ("CLEAR: never closer than 2.460 m", "32m"),
            ("PROVED CLEAR", "32m"),
            ("VIOLATION: vehicles 2 and 3", "31m"),
            ("edge-tension: CERTIFICATE BROKEN in 1 flight", "31m"),
            ("NOT REACHED: largest edge error 1 m", "33m"),
            ("1,234 unknown, 3 clear", "33m"),
        ] {
            let shown = coloured(text);
            assert!(shown.contains(colour), "{shown:?}");
            assert_eq!(shown.matches("\u{1b}[0m").count(), 1, "{shown:?}");
        }
        let names = ["VIOLATION and b  2.000 m", "VIOLATION  1.5 s", "between VIOLATION and b"];
        for text in names.into_iter().chain([
            "clear",
            "CLEARANCE",
            "out/CLEAR.csv",
            "UNCLEAR",
            "PASSED",
            "0 unknown",
            "no unknown key",
            "",
        ]) {
            assert_eq!(coloured(text), text);
        }
    }
}
