//! `tautline view`: a window on a recording, or on a running flight of a scenario.

use std::io;
use std::ops::ControlFlow;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use clap::Args;

use super::console::{self, Console};
use super::reading::ReadArguments;
use super::{Exit, completions, drawing};
use tautline_core::record::{Event, RecordError, Sample, Sink};
use tautline_render::{LiveUpdate, Theme, Timeline, WINDOW_KEYS, show};
use tautline_report::request::{Failure, ScenarioRequest};
use tautline_sim::scenario::Scenario;
use tautline_sim::sim::{self, Components};

/// Samples of a running flight that wait for the window.
const WAITING: usize = 256;

/// Arguments of `tautline view`.
#[derive(Debug, Args)]
#[command(mut_arg("recording", |what| {
    let help = "Recording, scenario file, or name of a built-in scenario";
    what.required(false).default_value("pentagon").value_name("RECORDING|SCENARIO").help(help)
        .add(completions::scenario())
}), after_help = keys())]
pub(super) struct ViewArguments {
    /// Set a key of the scenario; repeatable.
    #[arg(long = "set", value_name = "KEY.PATH=VALUE", add = completions::setting())]
    overrides: Vec<String>,
    /// Safety distance for a recording without one [m].
    #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
    delta: Option<f64>,
    /// Theme.
    #[arg(long, default_value = "dark", value_parser = drawing::theme())]
    theme: Theme,
    /// Graphics adapter: best, hardware, software, or a part of its name.
    #[arg(long, value_name = "NAME", default_value = "best")]
    adapter: String,
    // Last, because its help heading also applies to all later arguments.
    #[command(flatten)]
    reading: ReadArguments,
}

/// Returns the keys of the window for the help.
fn keys() -> String {
    let row = |(keys, effect): &(&str, &str)| format!("  {keys:28}{effect}\n");
    format!("Keys and mouse:\n{}", WINDOW_KEYS.iter().map(row).collect::<String>())
}

pub(super) fn view(arguments: &ViewArguments) -> Result<Exit, Failure> {
    let path = arguments.reading.only("shown")?;
    let reading = arguments.reading.options();
    let console = Console { data_on_stdout: true, quiet: false };
    let is_recording = path.exists() && !drawing::is_scenario(path);
    let (timeline, live) = if is_recording {
        if !arguments.overrides.is_empty() {
            let (message, help) = ("--set: has no effect on a recording", "leave --set out, or give a scenario");
            return Err(Failure::input("usage/no-effect", message, help));
        }
        (drawing::timeline(path, &reading, arguments.delta, console)?, None)
    } else {
        drawing::refuse_for_scenario(&reading, arguments.delta)?;
        let scenario = ScenarioRequest::named(&path.to_string_lossy(), &arguments.overrides)?.read()?;
        (Timeline::of(&scenario), Some(take_off(scenario)?))
    };
    show(timeline, live, arguments.theme, arguments.adapter.as_str().into())?;
    Ok(Exit::Good)
}

/// Starts a flight in its own thread. The thread waits for a slower window, and ends when the window is closed.
fn take_off(scenario: Scenario) -> Result<Receiver<LiveUpdate>, Failure> {
    let parts = Components::of(&scenario)?;
    let (sender, receiver) = sync_channel(WAITING);
    std::thread::spawn(move || {
        let mut sink = LiveSink(sender);
        let mut carry_on = |_| ControlFlow::Continue(());
        let flown = sim::fly(&scenario, parts, &mut sink, &mut carry_on);
        let said = match flown {
            Ok(flight) => match flight.ending {
                sim::Ending::LawUndefined(why) => Some(format!("the flight ended: the law is undefined: {why}")),
                sim::Ending::BrokeDown(why) => Some(format!("the flight ended: {why}")),
                sim::Ending::Completed | sim::Ending::Interrupted => None,
            },
            Err(error) => Some(format!("the flight ended: {error}")),
        };
        // A closed window receives no message.
        let _ = sink.send(LiveUpdate::Ended(said));
    });
    Ok(receiver)
}

/// Sink that sends a flight to the window.
struct LiveSink(SyncSender<LiveUpdate>);

impl LiveSink {
    /// Sends an update; a closed window ends the flight.
    fn send(&self, update: LiveUpdate) -> Result<(), RecordError> {
        let closed = |_| io::Error::from(io::ErrorKind::BrokenPipe);
        let sent = self.0.send(update).map_err(closed);
        sent.map_err(|source| RecordError::Write { path: "the window".to_owned(), source })
    }
}

impl Sink for LiveSink {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        self.send(LiveUpdate::Sample(Box::new(sample.into())))
    }

    fn event(&mut self, event: &Event) -> Result<(), RecordError> {
        self.send(LiveUpdate::Event(event.clone()))
    }
}

/// Reports that the display is gone. Its resources cannot be released any more, so the program must end at once.
pub(super) fn lose_display() -> Exit {
    let help = "open the window again, or draw without a display: tautline render RECORDING";
    let message = "the display is gone, and the window with it";
    console::show(&Failure::machine("render/no-display", message).with_help(help))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_book_lists_the_keys_of_the_window() {
        let book = include_str!("../../docs/viewer.md");
        let rows: Vec<String> = WINDOW_KEYS.iter().map(|(keys, effect)| format!("| {keys} | {effect} |")).collect();
        assert!(book.contains(&rows.join("\n")), "{}", rows.join("\n"));
    }
}
