//! Helpers of the commands that draw: themes, sizes, recordings and adapters.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;
use std::sync::Arc;

use clap::builder::TypedValueParser;

use super::console::Console;
use tautline_recordings::mcap::McapRecording;
use tautline_recordings::read::{self, Format, ReadError, ReadOptions};
use tautline_render::{Colouring, FARTHEST_M, FlightLog, RenderError, Theme, Timeline, TracksError};
use tautline_report::request::{Failure, ScenarioRequest, one_of};
use tautline_report::run::run;
use tautline_sim::scenario::builtin;

/// Number of bytes at the start of an MCAP file that contain the name of its writer.
const FIRST_BYTES: u64 = 64;

/// Returns a parser of the name of a theme.
pub(super) fn theme() -> impl TypedValueParser<Value = Theme> {
    one_of(Theme::ALL.map(|(name, theme)| (name.into(), theme)).into())
}

/// Returns a parser of the name of a colouring.
pub(super) fn colouring() -> impl TypedValueParser<Value = Colouring> {
    one_of(Colouring::ALL.map(|(name, colouring)| (name.into(), colouring)).into())
}

/// Returns whether a path names a scenario: a TOML file, or the name of a built-in one and of no file.
pub(super) fn is_scenario(path: &Path) -> bool {
    let is_toml = path.extension().is_some_and(|extension| extension == "toml") && !path.is_dir();
    is_toml || !path.exists() && path.to_str().is_some_and(|name| builtin::find(name).is_some())
}

/// Reads a recording to draw it, or flies a scenario.
pub(super) fn flight(
    path: &Path,
    reading: &ReadOptions,
    delta_m: Option<f64>,
    console: Console,
) -> Result<Timeline, Failure> {
    if !is_scenario(path) {
        return timeline(path, reading, delta_m, console);
    }
    refuse_for_scenario(reading, delta_m)?;
    let scenario = ScenarioRequest::named(&path.to_string_lossy(), &[])?.read()?;
    let mut log = FlightLog::of(&scenario);
    let report = run(&scenario, &mut log)?;
    if let Some(closest) = report.closest_pair() {
        log.conclude(closest.separation_m, closest.time_s);
    }
    Ok(Timeline::flown(&scenario, Arc::new(log)).judged(report.answer.status))
}

/// Refuses options of recordings for a scenario.
pub(super) fn refuse_for_scenario(reading: &ReadOptions, delta_m: Option<f64>) -> Result<(), Failure> {
    let no_effect = |message: &str, help: &str| Err(Failure::input("usage/no-effect", message, help));
    if delta_m.is_some() {
        let help = "leave --delta out, or set the key with --set law.delta_m=METRES";
        return no_effect("--delta: has no effect on a scenario, which has its own safety distance", help);
    }
    if *reading != ReadOptions::default() {
        let help = "leave these options out, or give a recording";
        return no_effect("options for reading: have no effect on a scenario", help);
    }
    Ok(())
}

/// Parses width and height in pixels, such as 1280x720.
pub(super) fn size(text: &str) -> Result<[u32; 2], String> {
    pair(text).ok_or_else(|| "give width and height in pixels, each at least 1, such as 1280x720".to_owned())
}

/// Parses columns and rows, such as 4x3.
pub(super) fn sheet(text: &str) -> Result<[u32; 2], String> {
    pair(text).ok_or_else(|| "give columns and rows, each at least 1, such as 4x3".to_owned())
}

fn pair(text: &str) -> Option<[u32; 2]> {
    let (first, second) = text.split_once(['x', 'X'])?;
    let side = |text: &str| text.trim().parse().ok().filter(|&side| side > 0);
    Some([side(first)?, side(second)?])
}

/// Reads a recording to draw it, and prints notes on how it was read. `delta_m` is the safety distance for recordings
/// without one.
pub(super) fn timeline(
    recording: &Path,
    reading: &ReadOptions,
    delta_m: Option<f64>,
    console: Console,
) -> Result<Timeline, Failure> {
    if let Some(delta_m) = delta_m.filter(|delta_m| !(*delta_m > 0.0 && *delta_m <= FARTHEST_M)) {
        let message = format!("--delta: must be more than 0 and at most {FARTHEST_M:e}, got {delta_m:?}");
        return Err(Failure::input("render/out-of-range", message, "give a distance in metres"));
    }
    // Recordings of tautline also contain formation, graph and law.
    let may_be_ours = reading.format.is_none_or(|format| format == Format::MCAP);
    let timeline = match McapRecording::open(recording) {
        Ok(ours) if may_be_ours => {
            speaks_for_itself(&ours, reading, delta_m)?;
            Timeline::read_mcap(recording)?
        }
        _ => of_others(recording, reading, delta_m)?,
    };
    if timeline.log.keyframes().is_empty() {
        return Err(RenderError::Empty(recording.display().to_string()).into());
    }
    for note in &timeline.notes {
        console.warn(&format!("note: {note}"));
    }
    if timeline.log.every() > 1 {
        console
            .warn(&format!("the recording is long: pictures are drawn from one in {} samples", timeline.log.every()));
    }
    Ok(timeline)
}

/// Reads a recording of positions only.
fn of_others(recording: &Path, reading: &ReadOptions, delta_m: Option<f64>) -> Result<Timeline, Failure> {
    let unreadable = |error: ReadError| {
        let help = error.help();
        let failure = Failure::from(error);
        if !recording.is_dir() {
            return failure;
        }
        failure.with_help(format!("the folder was taken for one recording, a file for each vehicle: {help}"))
    };
    let mut tracks = match read::open(recording, reading) {
        Err(_) if has_nothing_yet(recording, reading) => {
            let message = format!("{}: the run was cut off before anything was written", recording.display());
            return Err(Failure::input(
                "recording/empty",
                message,
                "fly it again, or give the recording of another run",
            ));
        }
        opened => opened.map_err(unreadable)?,
    };
    let name = recording.file_stem().unwrap_or_default().to_string_lossy();
    Timeline::from_tracks(&name, tracks.as_mut(), delta_m).map_err(|error| match error {
        TracksError::Read(error) => unreadable(error),
        TracksError::Render(error) => error.into(),
    })
}

/// Returns whether a file starts like a tautline recording and has no channel, because its writer was killed at once.
fn has_nothing_yet(recording: &Path, reading: &ReadOptions) -> bool {
    let mut start = Vec::new();
    let read = File::open(recording).and_then(|file| file.take(FIRST_BYTES).read_to_end(&mut start));
    let ours = start.starts_with(b"\x89MCAP") && start.windows(9).any(|name| name == b"tautline ");
    let accept = ReadOptions { allow_unfinished: true, ..reading.clone() };
    let no_positions = |error: &ReadError| matches!(error.code(), "recording/no-positions" | "recording/empty");
    read.is_ok() && ours && read::open(recording, &accept).is_err_and(|error| no_positions(&error))
}

/// Refuses options that have no effect on a tautline recording.
fn speaks_for_itself(ours: &McapRecording, reading: &ReadOptions, delta_m: Option<f64>) -> Result<(), Failure> {
    if delta_m.is_some() {
        let message = format!("--delta: the recording was judged by its own delta, {} m", ours.header().delta_m);
        return Err(Failure::input(
            "render/own-recording",
            message,
            "leave --delta out; `tautline audit` judges by another delta",
        ));
    }
    let said = ReadOptions { format: None, allow_unfinished: false, ..reading.clone() };
    if said != ReadOptions::default() {
        return Err(Failure::input(
            "render/own-recording",
            "options for reading: have no effect on a recording of tautline",
            "leave --time-unit, --scale, --column, --axis-order and --frame out",
        ));
    }
    Ok(())
}

/// Environment variable that switches off the layer of Mesa that selects a device.
#[cfg(target_os = "linux")]
const NO_LAYER: &str = "NODEVICE_SELECT";
/// Environment variable in which a user selects a device of this layer.
#[cfg(target_os = "linux")]
const CHOICE: &str = "MESA_VK_DEVICE_SELECT";

/// Restarts the program once without the layer if there is no desktop, where the layer writes complaints to standard
/// error. If the program cannot be restarted, this process continues.
#[cfg(target_os = "linux")]
pub(super) fn silence_driver() {
    use std::env::{args_os, current_exe, var_os};
    use std::os::unix::process::CommandExt as _;

    let has_desktop = var_os("XDG_RUNTIME_DIR").is_some_and(|folder| Path::new(&folder).is_absolute());
    if has_desktop || var_os(NO_LAYER).is_some() || var_os(CHOICE).is_some() {
        return;
    }
    let (Ok(program), mut arguments) = (current_exe(), args_os()) else { return };
    let called = arguments.next().unwrap_or_else(|| program.clone().into());
    // `exec` returns only after a failure.
    let _ = std::process::Command::new(program).arg0(called).args(arguments).env(NO_LAYER, "1").exec();
}
