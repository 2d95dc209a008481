//! `tautline doctor`: what this machine can do, with a remedy for each thing that is missing.

use std::env;
use std::process::{Command, Stdio};

use clap::Args;
use serde::Serialize;

use super::Exit;
use super::console::Console;
use super::json::JsonArgument;
use tautline_report::request::Failure;

/// Arguments of `tautline doctor`.
#[derive(Debug, Args)]
pub(super) struct DoctorArguments {
    #[command(flatten)]
    json: JsonArgument,
}

/// A capability of the machine.
#[derive(Debug, Serialize)]
struct Finding {
    /// The capability.
    name: &'static str,
    /// Whether it is available.
    available: bool,
    /// What was found, or what cannot be done.
    found: String,
    /// How to get it, if it is missing.
    remedy: Option<&'static str>,
}

impl Finding {
    fn new(name: &'static str, found: Option<String>, missing: &str, remedy: &'static str) -> Self {
        let available = found.is_some();
        let remedy = (!available).then_some(remedy);
        Self { name, available, found: found.unwrap_or_else(|| missing.to_owned()), remedy }
    }
}

pub(super) fn doctor(arguments: &DoctorArguments) -> Result<Exit, Failure> {
    arguments.json.check_new()?;
    let findings = findings();
    let console = Console { data_on_stdout: arguments.json.is_piped(), quiet: arguments.json.is_piped() };
    for finding in &findings {
        let mark = if finding.available { "yes" } else { "no" };
        console.say(&format!("{:<10} {mark:<4} {}", finding.name, finding.found));
        if let Some(remedy) = finding.remedy {
            console.say(&format!("{:<10} {:<4} remedy: {remedy}", "", ""));
        }
    }
    arguments.json.write(&findings, console)?;
    Ok(Exit::Good)
}

fn findings() -> Vec<Finding> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let program = format!("{}, {} {}", env!("CARGO_PKG_VERSION"), env::consts::ARCH, env::consts::OS);
    let python = first_line("python3", &["--version"]);
    let package = first_line("python3", &["-c", "import importlib.metadata as m; print(m.version('tautline'))"]);
    let film = if cfg!(feature = "film") { Some("built in".to_owned()) } else { first_line("ffmpeg", &["-version"]) };
    vec![
        Finding::new("tautline", Some(program), "", ""),
        Finding::new("cores", Some(format!("{cores}; a flight uses at most two, a study all")), "", ""),
        adapters(),
        Finding::new(
            "window",
            display().filter(|_| cfg!(feature = "viewer")),
            "no desktop: `tautline view` cannot open a window; `tautline render` needs none",
            "run on a desktop (DISPLAY or WAYLAND_DISPLAY), or open report.html, which has a replay",
        ),
        Finding::new(
            "mp4",
            film,
            "no ffmpeg: films are written as GIF only",
            "install ffmpeg (Debian: `apt install ffmpeg`), or build with `--features film`",
        ),
        Finding::new("python", python, "no python3: the Python package cannot be used", "install Python 3.10 or later"),
        Finding::new(
            "package",
            package.map(|version| format!("tautline {version} for Python")),
            "the Python package is not installed",
            "`pip install ./python` in the source folder",
        ),
    ]
}

/// Returns the graphics adapters that draw pictures.
fn adapters() -> Finding {
    #[cfg(feature = "viewer")]
    let (found, remedy) = {
        let found = tautline_render::adapters();
        let remedy = "install a driver; software suffices (Debian: `apt install mesa-vulkan-drivers libvulkan1`)";
        ((!found.is_empty()).then(|| found.join("; ")), remedy)
    };
    #[cfg(not(feature = "viewer"))]
    let (found, remedy) = (None, "build without `--no-default-features`");
    Finding::new("pictures", found, "no graphics adapter: the processor draws pictures, and there is no window", remedy)
}

/// Returns the display of a window.
fn display() -> Option<String> {
    if !cfg!(target_os = "linux") {
        return Some("the desktop of the system".to_owned());
    }
    let of = |name: &str| env::var(name).ok().filter(|value| !value.is_empty()).map(|value| format!("{name}={value}"));
    of("WAYLAND_DISPLAY").or_else(|| of("DISPLAY"))
}

/// Returns the first line that a program prints; `None` if it is missing or fails.
fn first_line(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).stdin(Stdio::null()).stderr(Stdio::null()).output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout);
    let line = text.lines().next().map(|line| line.trim().to_owned());
    line.filter(|line| output.status.success() && !line.is_empty())
}
