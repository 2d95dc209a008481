//! `tautline.toml`: defaults for audits of the recordings beside it. Options of the request take precedence.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::super::Failure;
use super::rules::{self, Rules};
use super::toml_file::TomlFile;
use super::{AuditRequest, ConfigFile, ConfiguredAudit, Subject};
use tautline_audit::Cylinder;
use tautline_audit::envelope::{Limit, Quantity};
use tautline_audit::recorded::Interpolation;
use tautline_core::option::NO_CONFIG;
use tautline_recordings::read::{ArrayAxis, Axes, Scale};

/// Name of the file.
const NAME: &str = "tautline.toml";
const FILE: TomlFile = TomlFile { code: "audit/settings-file", help, most_bytes: 1 << 20 };

/// Returns the remedy for a wrong file.
fn help() -> String {
    format!("docs/ci.md lists the keys of [audit]; {NO_CONFIG} ignores the file")
}

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
    ellipsoid_m: Option<NamedShape>,
    cylinder_m: Option<[f64; 2]>,
    well_clear: Option<NamedShape>,
    rules: Option<String>,
    motion: Option<Interpolation>,
    max_accel_m_s2: Option<f64>,
    obstacles: Option<PathBuf>,
    fence: Option<PathBuf>,
    above_m: Option<f64>,
    land_on: BTreeSet<String>,
    max_gap_s: Option<f64>,
    expect_vehicles: Option<usize>,
    layout: Option<String>,
    allow_undecided: Option<bool>,
    axes: Option<String>,
    scale: Option<ScaleEntry>,
    require_presence: Option<bool>,
    accel_window_s: Option<f64>,
    limits: BTreeMap<String, f64>,
    /// Names of the given keys.
    #[serde(skip)]
    keys: Vec<String>,
}

/// Name, or three numbers.
#[derive(Clone, Debug, Deserialize)]
#[serde(untagged)]
enum NamedShape {
    Name(String),
    Numbers([f64; 3]),
}

impl NamedShape {
    /// Parses a shape with the function of its option, which has the same checks.
    fn read<T>(self, parse: fn(&str) -> Result<T, String>) -> Result<T, String> {
        match self {
            Self::Name(name) => parse(&name),
            Self::Numbers([x, y, z]) => parse(&format!("{x:?},{y:?},{z:?}")),
        }
    }
}

/// Metres per unit of length, for all axes or for each.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(untagged)]
enum ScaleEntry {
    All(f64),
    Each([f64; 3]),
}

impl ScaleEntry {
    fn scale(self) -> Result<Scale, String> {
        match self {
            Self::All(metres) => Ok(metres.into()),
            // Parsed like the words of `--scale`, with the same checks.
            Self::Each([x, y, z]) => format!("{x:?},{y:?},{z:?}").parse(),
        }
    }
}

/// Returns the request, with options that it leaves open taken from its `tautline.toml`.
pub(super) fn configured(mut request: AuditRequest<'_>) -> Result<ConfiguredAudit<'_>, Failure> {
    let found = file_of(&request);
    if request.config == ConfigFile::Nearest
        && let Some(path) = found.as_ref().filter(|path| !path.is_file())
    {
        return Err(Failure::input("audit/settings-file", format!("{} is not a file", path.display()), help()));
    }
    request.config = found.map_or(ConfigFile::None, ConfigFile::File);
    match request.config.clone() {
        ConfigFile::File(path) => parse(&FILE.read(&path)?, &path)?.fill(request, &path),
        ConfigFile::Nearest | ConfigFile::None => Ok(ConfiguredAudit { request, asked_by: None }),
    }
}

/// Returns the `tautline.toml` of a request.
pub(super) fn file_of(request: &AuditRequest<'_>) -> Option<PathBuf> {
    match &request.config {
        ConfigFile::File(path) => Some(path.clone()),
        ConfigFile::Nearest => request.subject.paths().first().and_then(|recording| nearest(recording)),
        ConfigFile::None => None,
    }
}

/// Returns the nearest `tautline.toml` in the recording's folder and its parents, up to the working folder. For a
/// recording outside the working folder, only its own folder counts. Links are resolved, so that every path of a
/// recording finds the same file.
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
    let Document { audit } = FILE.parse(text, path)?;
    let given = text.parse::<toml::Table>().ok().and_then(|mut table| table.remove("audit"));
    let keys = given.iter().filter_map(toml::Value::as_table).flat_map(toml::Table::keys).cloned().collect();
    Ok(AuditTable { keys, ..audit })
}

impl AuditTable {
    /// Fills options that the request leaves open. Relative paths start at the folder of `tautline.toml`.
    fn fill<'a>(self, mut request: AuditRequest<'a>, path: &Path) -> Result<ConfiguredAudit<'a>, Failure> {
        let wrong =
            |message: String| Failure::input("audit/settings-file", format!("{}: {message}", path.display()), help());
        let folder = path.parent().unwrap_or(Path::new(""));
        let is_silent = request.is_silent();
        let is_bounded = self.motion.is_some_and(|motion| motion == Interpolation::Bounded);
        if self.ellipsoid_m.is_some() && self.radius_m.is_some() {
            return Err(wrong("ellipsoid_m and radius_m are both given".to_owned()));
        }
        let shape = |of: Option<NamedShape>| of.map(|of| of.read(rules::ellipsoid)).transpose();
        let ellipsoid_m = shape(self.ellipsoid_m).map_err(|error| wrong(format!("ellipsoid_m: {error}")))?;
        let well_clear = self.well_clear.map(|of| of.read(rules::well_clear)).transpose();
        let well_clear = well_clear.map_err(|error| wrong(format!("well_clear: {error}")))?;
        let rules = self.rules.map(|name| name.parse()).transpose();
        let rules: Option<Rules> = rules.map_err(|error| wrong(format!("rules: {error}")))?;
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
        if self.max_accel_m_s2.is_some() && request.settings.motion.is_none() && !is_bounded {
            return Err(wrong("max_accel_m_s2 has no effect without motion = \"bounded\"".to_owned()));
        }
        let has_max_accel = request.has_max_accel();
        let settings = &mut request.settings;
        // Limits of distance come either all from the request or all from the file. A mixture would be a third
        // question.
        if is_silent {
            settings.delta_m = self.delta_m;
            settings.radius_m = self.radius_m;
            settings.ellipsoid_m = ellipsoid_m;
            settings.cylinder = self.cylinder_m.map(|[horizontal_m, vertical_m]| Cylinder { horizontal_m, vertical_m });
        }
        settings.well_clear = settings.well_clear.or(well_clear);
        settings.motion = settings.motion.or(self.motion);
        if settings.motion == Some(Interpolation::Bounded) && !has_max_accel {
            settings.max_accel_m_s2 = self.max_accel_m_s2;
        }
        settings.above_m = settings.above_m.or(self.above_m);
        if settings.land_on.is_empty() {
            settings.land_on = self.land_on;
        }
        settings.max_gap_s = settings.max_gap_s.or(self.max_gap_s);
        settings.accel_window_s = settings.accel_window_s.or(self.accel_window_s);
        settings.require_presence |= self.require_presence.unwrap_or(false);
        let given = self.layout.clone().unwrap_or_default();
        let layout = self.layout.map(|layout| ArrayAxis::layout_of(&layout)).transpose();
        let layout = layout.map_err(|error| wrong(format!("layout: {error}, got `{given}`")))?;
        let axes = self.axes.map(|axes| axes.parse::<Axes>()).transpose().map_err(wrong)?;
        let scale = self.scale.map(ScaleEntry::scale).transpose().map_err(wrong)?;
        if let Subject::Files { options, .. } = &mut request.subject {
            options.axes = options.axes.or(axes);
            options.scale = options.scale.or(scale);
            options.usual_layout = layout;
        }
        request.obstacles = request.obstacles.or(self.obstacles.map(|file| folder.join(file)));
        request.fence = request.fence.or(self.fence.map(|file| folder.join(file)));
        if request.rules == Rules::default() {
            request.rules = rules.unwrap_or_default();
        }
        request.expect_vehicles = request.expect_vehicles.or(self.expect_vehicles);
        request.allow_undecided |= self.allow_undecided.unwrap_or(false);
        for (key, allowed) in self.limits {
            let quantity = Quantity::NUMBERS.into_iter().find(|quantity| quantity.key() == key);
            let quantity = quantity.ok_or_else(|| {
                let keys = Quantity::NUMBERS.map(Quantity::key).join(", ");
                wrong(format!("`{key}` is not a limit: the limits are {keys}"))
            })?;
            let limits = &mut request.settings.envelope.limits;
            if limits.iter().all(|given| given.quantity != quantity) {
                limits.push(Limit { quantity, allowed });
            }
        }
        // Each key may change the verdict.
        let (path, keys) = (path.display(), self.keys.join(", "));
        let asked_by = Some(format!("options that the command line does not set come from {path}: {keys}"));
        Ok(ConfiguredAudit { request, asked_by })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn request() -> AuditRequest<'static> {
        let paths = vec![PathBuf::from("show/a.csv")];
        AuditRequest::new(Subject::Files { paths, options: Box::default() })
    }

    fn filled(request: AuditRequest<'static>, text: &str) -> Result<ConfiguredAudit<'static>, String> {
        let path = Path::new("show/tautline.toml");
        parse(text, path).and_then(|table| table.fill(request, path)).map_err(|failure| failure.message().to_owned())
    }

    #[test]
    fn request_takes_precedence_over_the_file() {
        let text = "[audit]\ndelta_m = 1.5\nabove_m = 0.5\nobstacles = \"venue.toml\"\n\
                    [audit.limits]\nspeed_m_s = 5.0\nclimb_m_s = 2";
        let asked = filled(request(), text).expect("a question");
        assert!(asked.asked_by().is_some_and(|note| note.contains("show/tautline.toml")));
        let AuditRequest { settings, obstacles, .. } = asked.request;
        assert_eq!((settings.delta_m, settings.above_m), (Some(1.5), Some(0.5)));
        assert_eq!(obstacles, Some(PathBuf::from("show/venue.toml")));
        assert_eq!(settings.envelope.limits.len(), 2);
        let mut other = request();
        (other.settings.radius_m, other.settings.above_m) = (Some(0.2), Some(1.0));
        other.settings.envelope.limits = vec![Limit { quantity: Quantity::Speed, allowed: 9.0 }];
        let settings = filled(other, text).expect("a question").request.settings;
        assert_eq!((settings.delta_m, settings.above_m), (None, Some(1.0)));
        assert_eq!(settings.envelope.limits.iter().map(|limit| limit.allowed).collect::<Vec<_>>(), [9.0, 2.0]);
    }

    #[test]
    fn errors_name_their_line() {
        for (text, expected) in [
            ("", "line 1: missing field `audit`"),
            ("[audit]\ndelta = 1.5", "show/tautline.toml, line 2: unknown field `delta`"),
            ("[audit]\nmotion = \"spline\"", "line 2: unknown variant `spline`"),
            ("[audit.limits]\nspeed = 5.0", "`speed` is not a limit: the limits are speed_m_s,"),
            ("[audit]\nmax_accel_m_s2 = 2.0", "has no effect without motion = \"bounded\""),
            ("[audit]\naxes = \"nes\"", "`nes` is not three directions"),
            ("[audit]\nscale = [1, 0, 1]", "a scale must not be 0"),
            ("[audit]\nlayout = \"time,axis\"", "layout: must be one of `time,vehicle,axis`, "),
            ("[audit]\ndelta_m = nan", "delta_m must be a finite number"),
            ("[audit]\nellipsoid_m = \"crazyfly\"", "ellipsoid_m: `crazyfly` is no ellipsoid"),
            ("[audit]\nwell_clear = \"do-178\"", "well_clear: `do-178` is no preset"),
            ("[audit]\nrules = \"all\"", "rules: unknown rules `all`"),
            ("[audit]\nellipsoid_m = [1.0, 1.0, 2.0]\nradius_m = 0.1", "are both given"),
        ] {
            let message = filled(request(), text).map(drop).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }
}
