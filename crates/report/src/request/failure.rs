//! Errors of requests.

use std::fmt::{self, Display};
use std::ops::RangeInclusive;
use std::path::Path;

use tautline_audit::recorded::RecordedError;
use tautline_core::option::{
    ABOVE, ACCEL_WINDOW, CYLINDER, DELTA, ELLIPSOID, FENCE, FROM, IDS, LAND_ON, LIMIT, MAX_ACCEL, MOTION, OFFSET, OUT,
    Opt, RADIUS, TIME_SCALE, TO, WELL_CLEAR,
};
use tautline_core::record::RecordError;
use tautline_core::text::with_short_numbers;
use tautline_laws::law::ParameterError;
use tautline_recordings::export::ExportError;
use tautline_recordings::export::drones::DroneError;
use tautline_recordings::read::ReadError;
use tautline_sim::scenario::{Place, ScenarioError};
use tautline_sim::sim::SimError;

use crate::report::ArtefactError;

/// Longest line of a source text that is shown in a frame \[bytes\].
const LONGEST_LINE: usize = 400;

/// Error of a request: the input is wrong, or the machine failed.
///
/// [`fmt::Display`] writes place, problem and remedy in one line. Control characters of the input are replaced by
/// blanks.
#[derive(Clone, Debug)]
pub struct Failure {
    code: &'static str,
    is_machine: bool,
    message: String,
    help: Option<String>,
    place: Option<Box<Place>>,
}

impl Failure {
    /// Code of the failure after an interruption.
    pub const INTERRUPTED: &'static str = "interrupted";

    /// Returns a failure of the input. `code` is stable, such as `audit/no-limit`.
    #[must_use]
    pub fn input(code: &'static str, message: impl AsRef<str>, help: impl AsRef<str>) -> Self {
        Self::new(code, false, message).with_help(help)
    }

    /// Returns a failure of the machine: no space, no permission, no adapter.
    #[must_use]
    pub fn machine(code: &'static str, message: impl AsRef<str>) -> Self {
        Self::new(code, true, message)
    }

    /// Returns the failure after an interruption.
    #[must_use]
    pub fn interrupted() -> Self {
        Self::machine(Self::INTERRUPTED, "interrupted")
    }

    /// Returns a failure of either kind, without a remedy.
    #[must_use]
    pub fn new(code: &'static str, is_machine: bool, message: impl AsRef<str>) -> Self {
        let message = blanked(&with_short_numbers(message.as_ref()));
        Self { code, is_machine, message, help: None, place: None }
    }

    /// Adds the remedy.
    #[must_use]
    pub fn with_help(mut self, help: impl AsRef<str>) -> Self {
        self.help = Some(blanked(&with_short_numbers(help.as_ref())));
        self
    }

    /// Puts the context in front of the message.
    #[must_use]
    pub fn under(mut self, situation: &str) -> Self {
        self.message = blanked(&format!("{situation}: {}", self.message));
        self
    }

    /// Puts the file in front of the message.
    #[must_use]
    pub fn of(self, file: &Path) -> Self {
        self.under(&file.display().to_string())
    }

    /// Adds the place of the problem in a text.
    #[must_use]
    pub fn at(mut self, place: &Place) -> Self {
        if place.text.lines().any(|line| line.len() > LONGEST_LINE) {
            return self.under(&format!("{}:{}:{}", place.source, place.line, place.column));
        }
        self.place = Some(Box::new(Place { text: blanked(&place.text), ..place.clone() }));
        self
    }

    /// Returns the stable error code, such as `audit/no-limit`.
    #[must_use]
    pub fn code(&self) -> &'static str {
        self.code
    }

    /// Returns whether the machine failed (exit code 3), as opposed to the input (exit code 2).
    #[must_use]
    pub fn is_machine(&self) -> bool {
        self.is_machine
    }

    /// Returns the problem, without place and remedy.
    #[must_use]
    pub fn message(&self) -> &str {
        &self.message
    }

    /// Returns the remedy.
    #[must_use]
    pub fn help(&self) -> Option<&str> {
        self.help.as_deref()
    }

    /// Returns the place of the problem in a text, whose lines are short enough to be shown.
    #[must_use]
    pub fn place(&self) -> Option<&Place> {
        self.place.as_deref()
    }

    /// Returns the problem and its remedy in one line.
    #[must_use]
    pub fn in_words(&self) -> String {
        self.help.as_ref().map_or_else(|| self.message.clone(), |help| format!("{} ({help})", self.message))
    }
}

impl Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(place) = &self.place {
            write!(f, "{}, line {}: ", place.source, place.line)?;
        }
        f.write_str(&self.in_words())
    }
}

impl std::error::Error for Failure {}

/// Replaces control characters by blanks of the same length, because the content of a file must not control a terminal.
#[must_use]
pub fn blanked(text: &str) -> String {
    let blank =
        |c: char| if c.is_control() && c != '\n' && c != '\t' { " ".repeat(c.len_utf8()) } else { c.to_string() };
    text.chars().map(blank).collect()
}

/// Checks that the number of an option is in its range.
///
/// # Errors
/// [`Failure`] with the code `request/out-of-range`.
pub fn in_range<T: PartialOrd + Display>(option: Opt, value: &T, range: &RangeInclusive<T>) -> Result<(), Failure> {
    if range.contains(value) {
        return Ok(());
    }
    let (least, most) = (range.start(), range.end());
    let message = format!("{}: must be from {least} to {most}", option.set(value));
    Err(Failure::input("request/out-of-range", message, "give a number in this range"))
}

impl From<ScenarioError> for Failure {
    fn from(error: ScenarioError) -> Self {
        // The message of the error shows a part of a line of any length.
        if error.place().is_some_and(|place| place.text.lines().any(|line| line.len() > LONGEST_LINE)) {
            return Self::new(error.code(), false, error.to_string());
        }
        let message = match error.field().filter(|_| error.place().is_none()) {
            Some(field) => format!("{field}: {}", error.message()),
            None => error.message().to_owned(),
        };
        let mut failure = Self::new(error.code(), false, message);
        failure.help = error.help().map(str::to_owned);
        error.place().into_iter().fold(failure, Self::at)
    }
}

impl From<RecordError> for Failure {
    fn from(error: RecordError) -> Self {
        match error {
            RecordError::Write { .. } => Self::machine("files/cannot-write", error.to_string()).with_help(format!(
                "the recording up to here is readable; free some space or give another folder with {OUT}"
            )),
            RecordError::Open { .. } => Self::new("files/cannot-read", false, error.to_string()),
            RecordError::Read { .. } => Self::new("recording/malformed", false, error.to_string()),
        }
    }
}

impl From<ArtefactError> for Failure {
    fn from(error: ArtefactError) -> Self {
        let parent = Path::new(&error.path).parent().filter(|parent| !parent.as_os_str().is_empty());
        match parent.filter(|parent| !parent.is_dir()) {
            Some(parent) => {
                let problem = if parent.exists() { "is not a folder" } else { "does not exist" };
                let message = format!("{}: cannot write the file: {} {problem}", error.path, parent.display());
                Self::input("files/no-folder", message, "create the folder first, or give a path in another folder")
            }
            None => Self::machine("files/cannot-write", error.to_string())
                .with_help("free some space or write to another folder"),
        }
    }
}

impl From<ReadError> for Failure {
    fn from(error: ReadError) -> Self {
        Self::new(error.code(), error.is_machine(), error.to_string()).with_help(error.help())
    }
}

impl From<ExportError> for Failure {
    fn from(error: ExportError) -> Self {
        Self::new(error.code(), error.is_machine(), error.to_string()).with_help(error.help())
    }
}

impl From<DroneError> for Failure {
    fn from(error: DroneError) -> Self {
        Self::new(error.code(), error.is_machine(), error.to_string()).with_help(error.help())
    }
}

impl From<ParameterError> for Failure {
    fn from(error: ParameterError) -> Self {
        Self::new("law/parameter", false, error.to_string())
    }
}

impl From<SimError> for Failure {
    fn from(error: SimError) -> Self {
        match error {
            SimError::Record(error) => error.into(),
            SimError::Law(error) => error.into(),
            SimError::NoLeg
            | SimError::Obstacle(_)
            | SimError::Vehicles { .. }
            | SimError::Commands { .. }
            | SimError::ShieldedCommands => Self::new("simulation/inconsistent", false, error.to_string()),
            SimError::Shield(error) => error.into(),
            SimError::ExternalLaw { .. } => Self::input(
                "simulation/law-failed",
                error.to_string(),
                "correct the law; it gives every vehicle a finite command at every instant",
            ),
            SimError::Audit(error) => Self::input(
                "simulation/cannot-judge",
                error.to_string(),
                "choose a safety distance and a number of vehicles that can be judged",
            ),
        }
    }
}

impl From<RecordedError> for Failure {
    fn from(error: RecordedError) -> Self {
        let message = error.to_string();
        let (code, message, help) = match &error {
            RecordedError::Interrupted => return Self::interrupted(),
            RecordedError::OutOfRange { option, of, range, .. } => {
                let name = if of.is_some() { "NAME=" } else { "" };
                let help = match *option {
                    CYLINDER => format!("give {} with two numbers above 0, such as 2,4", CYLINDER.set("R,H")),
                    WELL_CLEAR => format!("give {}, or D,Z,T such as 1219.2,137.16,35", WELL_CLEAR.set("PRESET")),
                    _ => format!("give {}, where NUMBER is {range}", option.set(format!("{name}NUMBER"))),
                };
                ("audit/out-of-range", message, help)
            }
            RecordedError::EmptyWindow { .. } => {
                ("audit/empty-window", message, format!("give a {TO} that is at least {FROM}"))
            }
            RecordedError::NoBound { .. } => {
                let [of_all, of_one] = ["A", "NAME=A"].map(|value| MAX_ACCEL.set(value));
                let help = format!("give the largest acceleration with {of_all} or {of_one}");
                ("audit/no-acceleration-bound", message, help)
            }
            RecordedError::NoLimit { .. } => {
                let radius = RADIUS.set("NAME=R");
                let help = format!("give {DELTA}, or {radius}; or give {LIMIT} and {FENCE} alone");
                ("audit/no-limit", message, help)
            }
            RecordedError::NoAccelWindow => {
                let [limit, motion] = [LIMIT.set("accel=A"), MOTION.set("bounded")];
                let help = format!("add {limit} and leave {motion} out, or leave {ACCEL_WINDOW} out");
                ("audit/acceleration-window", message, help)
            }
            RecordedError::LimitOfJumps { .. } => {
                let help = format!("give {}, or bounded with {MAX_ACCEL}", MOTION.set("linear"));
                ("audit/limit-of-jumps", message, help)
            }
            RecordedError::UnknownVehicle { .. } => {
                let help = format!("use the names of the recording in {IDS}, {RADIUS}, {MAX_ACCEL} and {OFFSET}");
                ("audit/unknown-vehicle", message, help)
            }
            RecordedError::NoGround { .. } => {
                let help = format!("give the height of the ground with {}, or leave {LAND_ON} out", ABOVE.set("Z"));
                ("audit/land-on", message, help)
            }
            RecordedError::AmbiguousObstacle { .. } => {
                let help = format!("give each obstacle its own name, or leave {LAND_ON} out");
                ("audit/land-on", message, help)
            }
            RecordedError::UnknownObstacle { .. } => {
                let help = format!("use the names of the obstacles, or leave {LAND_ON} out");
                ("audit/land-on", message, help)
            }
            RecordedError::NotACurve { .. } => {
                ("audit/no-curves", message, format!("give {}, hold or bounded", MOTION.set("linear")))
            }
            RecordedError::NotSamples { .. } => {
                let help = format!("leave {MOTION} out, or give {}", MOTION.set("polynomial"));
                ("audit/no-samples", message, help)
            }
            RecordedError::RadiusChanges { .. } => {
                let help = format!("give one radius of the vehicle with {}", RADIUS.set("NAME=R"));
                ("audit/radius-changes", message, help)
            }
            RecordedError::ObstaclesAndEllipsoid => {
                let help = format!("judge obstacles by {DELTA} or {RADIUS}, and ellipsoids without them");
                ("audit/obstacles-and-ellipsoid", message, help)
            }
            RecordedError::CylinderAnd { other } => {
                let help = format!("leave {CYLINDER} or {other} out");
                ("audit/cylinder", message, help)
            }
            RecordedError::WellClearMotion { .. } => {
                let help = format!("give {}, or leave {MOTION} out", MOTION.set("linear"));
                ("audit/well-clear", message, help)
            }
            RecordedError::WellClearAndEllipsoid => {
                let help = format!("leave {ELLIPSOID} or {WELL_CLEAR} out");
                ("audit/well-clear", message, help)
            }
            RecordedError::Obstacle(_) => ("audit/obstacle", message, "correct the obstacle file".to_owned()),
            RecordedError::TwoClocks { .. } => {
                let offset = OFFSET.set("NAME=SECONDS");
                let help = format!(
                    "correct a clock with {offset}, or judge vehicles of one clock with {IDS}, or a time with {FROM}"
                );
                ("audit/two-clocks", message, help)
            }
            RecordedError::Unnamed { .. }
            | RecordedError::TimeNotIncreasing { .. }
            | RecordedError::OutOfOrder { .. }
            | RecordedError::Item { .. } => {
                let help = format!(
                    "correct the recording there, exclude the vehicle with {IDS}, or check {OFFSET} and {TIME_SCALE}"
                );
                ("audit/malformed", message, help)
            }
        };
        Self::input(code, message, help)
    }
}

#[cfg(test)]
mod tests {
    use tautline_audit::recorded::{Settings, TrackAuditor, VehicleSettings};
    use tautline_core::option::RUNS;

    use super::*;

    #[test]
    fn errors_of_an_audit_name_options() {
        let delta = Settings::delta(1.0);
        let of_one = VehicleSettings { max_accel_m_s2: Some(-1.0), ..VehicleSettings::default() };
        let land_on = [String::from("pad")].into();
        for (settings, expected) in [
            (
                Settings { vehicles: [("a".to_owned(), of_one)].into(), ..delta.clone() },
                "max_accel: must be a finite number of at least 0, got a=-1.0 \
                 (give max_accel=NAME=NUMBER, where NUMBER is a finite number of at least 0)",
            ),
            (
                Settings { from_s: Some(f64::NAN), ..delta.clone() },
                "from_s: must be a finite number, got NaN (give from_s=NUMBER, where NUMBER is a finite number)",
            ),
            (
                Settings { to_s: Some(f64::NAN), ..delta.clone() },
                "to_s: must be a finite number, got NaN (give to_s=NUMBER, where NUMBER is a finite number)",
            ),
            (
                Settings { land_on, ..delta },
                "land_on: the obstacle `pad` is exempt at or below a height, which is not given \
                 (give the height of the ground with above=Z, or leave land_on out)",
            ),
        ] {
            let error = TrackAuditor::new(settings).expect_err("refused");
            assert_eq!(Failure::from(error).to_string(), expected);
        }
    }

    #[test]
    fn a_number_out_of_range_is_named_by_its_option() {
        let failure = in_range(RUNS, &0, &(1..=9)).expect_err("refused");
        assert_eq!(failure.to_string(), "runs=0: must be from 1 to 9 (give a number in this range)");
        assert!(in_range(RUNS, &9, &(1..=9)).is_ok());
    }
}
