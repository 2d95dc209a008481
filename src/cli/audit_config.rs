//! `tautline.toml`: what is asked of the recordings beside it, where the command line does not say otherwise.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use serde::Deserialize;

use super::Failure;
use super::audit_arguments::AuditArguments;
use super::text_file;
use tautline_audit::envelope::{Limit, Quantity};
use tautline_audit::recorded::Motion;
use tautline_recordings::read::ArrayAxis;

/// What the file is called.
const NAME: &str = "tautline.toml";
/// Largest file that is read \[bytes\].
const MOST_BYTES: u64 = 1 << 20;
const HELP: &str = "docs/ci.md lists the keys of [audit]; --no-config asks what the command line says alone";

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    audit: AuditTable,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct AuditTable {
    delta_m: Option<f64>,
    radius_m: Option<f64>,
    ellipsoid_m: Option<[f64; 3]>,
    motion: Option<MotionName>,
    max_accel_m_s2: Option<f64>,
    obstacles: Option<PathBuf>,
    fence: Option<PathBuf>,
    above_m: Option<f64>,
    max_gap_s: Option<f64>,
    expect_vehicles: Option<usize>,
    layout: Option<String>,
    allow_undecided: Option<bool>,
    axes: Option<String>,
    scale: Option<Scale>,
    require_presence: Option<bool>,
    accel_window_s: Option<f64>,
    limits: BTreeMap<String, f64>,
}

/// Metres per unit of length, of all axes or of each.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(untagged)]
enum Scale {
    All(f64),
    Each([f64; 3]),
}

impl Scale {
    /// As `--scale` says it.
    fn word(self) -> String {
        match self {
            Self::All(metres) => format!("{metres:?}"),
            Self::Each([x, y, z]) => format!("{x:?},{y:?},{z:?}"),
        }
    }
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
enum MotionName {
    Linear,
    Hold,
    Polynomial,
    Bounded,
}

impl From<MotionName> for Motion {
    fn from(name: MotionName) -> Self {
        match name {
            MotionName::Linear => Self::Linear,
            MotionName::Hold => Self::Hold,
            MotionName::Polynomial => Self::Polynomial,
            MotionName::Bounded => Self::Bounded,
        }
    }
}

/// The arguments for one recording, with what its `tautline.toml` asks where they are silent.
pub(super) fn configured(mut arguments: AuditArguments) -> Result<AuditArguments, Failure> {
    if arguments.config.is_none() && !arguments.no_config {
        arguments.config = nearest(&arguments.reading.recording);
        let is_none = arguments.config.as_ref().filter(|path| !path.is_file());
        if let Some(path) = is_none {
            return Err(Failure::input(format!("{} is no file", path.display()), HELP));
        }
    }
    match arguments.config.clone() {
        Some(path) => parse(&text_file::read(&path, MOST_BYTES, HELP)?, &path)?.fill(arguments, &path),
        None => Ok(arguments),
    }
}

/// The nearest file of that name in the recording's folder and in those above it, up to the working folder; of a recording
/// that is elsewhere, in its own folder alone. Links are followed, so that every name of a recording finds the same one.
fn nearest(recording: &Path) -> Option<PathBuf> {
    let beside = if recording.is_dir() { recording } else { recording.parent()? };
    let beside = if beside.as_os_str().is_empty() { Path::new(".") } else { beside };
    let folder = beside.canonicalize().ok()?;
    let here = std::env::current_dir().and_then(|here| here.canonicalize()).ok();
    let above = here.filter(|here| folder.starts_with(here));
    let levels = above.as_ref().map_or(1, |here| folder.components().count() - here.components().count() + 1);
    let found =
        folder.ancestors().take(levels).map(|folder| folder.join(NAME)).find(|file| file.symlink_metadata().is_ok())?;
    Some(above.and_then(|here| found.strip_prefix(here).map(Path::to_owned).ok()).unwrap_or(found))
}

fn parse(text: &str, path: &Path) -> Result<AuditTable, Failure> {
    let document: Document = toml::from_str(text).map_err(|error| {
        let start = error.span().map_or(0, |span| span.start.min(text.len()));
        let line = 1 + text[..start].matches('\n').count();
        Failure::input(format!("{}, line {line}: {}", path.display(), error.message()), HELP)
    })?;
    Ok(document.audit)
}

impl AuditTable {
    /// Fills what the command line leaves open. Files are named from the folder of `tautline.toml`.
    fn fill(self, mut arguments: AuditArguments, path: &Path) -> Result<AuditArguments, Failure> {
        let wrong = |message: String| Failure::input(format!("{}: {message}", path.display()), HELP);
        let folder = path.parent().unwrap_or(Path::new(""));
        let asks_otherwise = arguments.delta.is_some() || !arguments.radius.is_empty() || arguments.ellipsoid.is_some();
        if self.ellipsoid_m.is_some() && self.radius_m.is_some() {
            return Err(wrong("ellipsoid_m and radius_m are both given".to_owned()));
        }
        let numbers = [
            ("delta_m", self.delta_m),
            ("radius_m", self.radius_m),
            ("max_accel_m_s2", self.max_accel_m_s2),
            ("above_m", self.above_m),
            ("max_gap_s", self.max_gap_s),
            ("accel_window_s", self.accel_window_s),
        ];
        if let Some((key, _)) = numbers.into_iter().find(|(_, value)| value.is_some_and(|value| !value.is_finite())) {
            return Err(wrong(format!("{key} must be a finite number")));
        }
        if self.max_accel_m_s2.is_some()
            && arguments.motion.is_none()
            && !matches!(self.motion, Some(MotionName::Bounded))
        {
            return Err(wrong(
                "max_accel_m_s2 says nothing of a motion that is known exactly: add motion = \"bounded\"".to_owned(),
            ));
        }
        // Limits of distance are one question: a part of it from the command line and a part from here would be a third.
        if !asks_otherwise {
            arguments.delta = self.delta_m;
            arguments.radius.extend(self.radius_m.map(|radius_m| (None, radius_m)));
            arguments.ellipsoid = self.ellipsoid_m.map(Vector3::from);
        }
        if arguments.motion.is_none() {
            arguments.motion = self.motion.map(Motion::from);
        }
        if arguments.motion == Some(Motion::Bounded) && arguments.max_accel.is_empty() {
            arguments.max_accel.extend(self.max_accel_m_s2.map(|accel| (None, accel)));
        }
        let scale = self.scale.map(Scale::word);
        arguments.reading.fill(self.axes.as_deref(), scale.as_deref()).map_err(wrong)?;
        arguments.obstacles = arguments.obstacles.or(self.obstacles.map(|file| folder.join(file)));
        arguments.fence = arguments.fence.or(self.fence.map(|file| folder.join(file)));
        arguments.above = arguments.above.or(self.above_m);
        arguments.max_gap = arguments.max_gap.or(self.max_gap_s);
        arguments.expect_vehicles = arguments.expect_vehicles.or(self.expect_vehicles);
        let layout = self.layout.map(|layout| ArrayAxis::layout_of(&layout)).transpose();
        arguments.reading.usual_layout = layout.map_err(|error| wrong(format!("layout: {error}")))?;
        arguments.accel_window = arguments.accel_window.or(self.accel_window_s);
        arguments.require_presence |= self.require_presence.unwrap_or(false);
        arguments.allow_undecided |= self.allow_undecided.unwrap_or(false);
        for (key, allowed) in self.limits {
            let quantity = Quantity::NUMBERS.into_iter().find(|quantity| quantity.key() == key);
            let quantity = quantity.ok_or_else(|| {
                let keys = Quantity::NUMBERS.map(Quantity::key).join(", ");
                wrong(format!("`{key}` is no limit: the limits are {keys}"))
            })?;
            if arguments.limit.iter().all(|given| given.quantity != quantity) {
                arguments.limit.push(Limit { quantity, allowed });
            }
        }
        arguments.asked_by = Some(format!("what the command line leaves open is asked as {} says", path.display()));
        Ok(arguments)
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        audit: AuditArguments,
    }

    fn filled(line: &[&str], text: &str) -> Result<AuditArguments, String> {
        let line = Line::parse_from(["audit", "show/a.csv"].iter().chain(line));
        let path = Path::new("show/tautline.toml");
        parse(text, path).and_then(|table| table.fill(line.audit, path)).map_err(|failure| failure.said.message)
    }

    #[test]
    fn the_command_line_goes_before_the_file() {
        let text = "[audit]\ndelta_m = 1.5\nabove_m = 0.5\nobstacles = \"venue.toml\"\n[audit.limits]\nspeed_m_s = 5.0\nclimb_m_s = 2";
        let asked = filled(&[], text).expect("a question");
        assert_eq!((asked.delta, asked.above), (Some(1.5), Some(0.5)));
        assert_eq!(asked.obstacles, Some(PathBuf::from("show/venue.toml")));
        assert_eq!(asked.limit.len(), 2);
        assert!(asked.asked_by.is_some_and(|note| note.contains("show/tautline.toml")));
        let asked = filled(&["--radius", "0.2", "--limit", "speed=9", "--above", "1"], text).expect("a question");
        assert_eq!((asked.delta, asked.above), (None, Some(1.0)));
        assert_eq!(asked.limit.iter().map(|limit| limit.allowed).collect::<Vec<_>>(), [9.0, 2.0]);
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        for (text, expected) in [
            ("", "line 1: missing field `audit`"),
            ("[audit]\ndelta = 1.5", "show/tautline.toml, line 2: unknown field `delta`"),
            ("[audit]\nmotion = \"spline\"", "line 2: unknown variant `spline`"),
            ("[audit.limits]\nspeed = 5.0", "`speed` is no limit: the limits are speed_m_s,"),
            ("[audit]\nmax_accel_m_s2 = 2.0", "add motion = \"bounded\""),
            ("[audit]\naxes = \"nes\"", "`nes` is not three directions"),
            ("[audit]\nscale = [1, 0, 1]", "a scale of 0"),
            ("[audit]\nlayout = \"time,axis\"", "layout: `time,axis` is none of time,vehicle,axis "),
            ("[audit]\ndelta_m = nan", "delta_m must be a finite number"),
            ("[audit]\nellipsoid_m = [1.0, 1.0, 2.0]\nradius_m = 0.1", "are both given"),
        ] {
            let message = filled(&[], text).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }
}
