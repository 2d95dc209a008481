//! `tautline.toml`: defaults for audits of the recordings beside it. Options of the request take precedence.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::Spanned;
use toml::de::DeTable;

use super::super::Failure;
use super::options::{FILE_KEYS, unknown_limit};
use super::toml_file::TomlFile;
use super::{AuditOptions, AuditRequest, ConfiguredAudit};
use tautline_audit::envelope::Quantity;
use tautline_audit::recorded::Interpolation;
use tautline_core::option::NO_CONFIG;

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
    audit: AuditOptions,
}

/// Returns the request, with options that it leaves open taken from its `tautline.toml`.
pub(super) fn configured(mut request: AuditRequest<'_>) -> Result<ConfiguredAudit<'_>, Failure> {
    let Some(path) = file_of(&request) else { return Ok(ConfiguredAudit { request, asked_by: None }) };
    if request.options.config.is_none() && !path.is_file() {
        return Err(Failure::input("audit/settings-file", format!("{} is not a file", path.display()), help()));
    }
    request.options.config = Some(path.clone());
    fill(request, &FILE.read(&path)?, &path)
}

/// Returns the `tautline.toml` of a request.
pub(super) fn file_of(request: &AuditRequest<'_>) -> Option<PathBuf> {
    let nearest = || request.subject.paths().first().and_then(|recording| nearest(recording));
    if request.options.no_config { None } else { request.options.config.clone().or_else(nearest) }
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

/// Fills options that the request leaves open from the text of a file.
fn fill<'a>(mut request: AuditRequest<'a>, text: &str, path: &Path) -> Result<ConfiguredAudit<'a>, Failure> {
    let wrong =
        |message: String| Failure::input("audit/settings-file", format!("{}: {message}", path.display()), help());
    let (file, keys) = parse(text, path)?;
    if file.ellipsoid_m.is_some() && !file.radius_m.is_empty() {
        return Err(wrong("ellipsoid_m and radius_m are both given".to_owned()));
    }
    let may_be_bounded = request.options.motion.is_some() || file.motion == Some(Interpolation::Bounded);
    if !file.max_accel_m_s2.is_empty() && !may_be_bounded {
        return Err(wrong("max_accel_m_s2 has no effect without motion = \"bounded\"".to_owned()));
    }
    // Each key may change the verdict.
    let asked_by = format!("options that the command line does not set come from {}: {keys}", path.display());
    request.options = request.options.or(file, path.parent().unwrap_or(Path::new("")));
    Ok(ConfiguredAudit { request, asked_by: Some(asked_by) })
}

/// Parses the text of a file. Returns its options, and the names of its keys.
fn parse(text: &str, path: &Path) -> Result<(AuditOptions, String), Failure> {
    let wrong = |start: usize, message: String| Err(FILE.wrong(text, path, start, &message));
    let table = DeTable::parse(text).map(Spanned::into_inner).unwrap_or_default();
    let audit = table.get("audit");
    let given = audit.and_then(|audit| audit.get_ref().as_table());
    if let (Some(audit), None) = (audit, given) {
        return wrong(audit.span().start, "audit must be a table".to_owned());
    }
    let entries: Vec<_> = given.into_iter().flatten().collect();
    // Keys with their values, also of tables such as `limits`.
    let tables = entries.iter().filter_map(|(key, value)| Some((key.get_ref(), value.get_ref().as_table()?)));
    let inner = tables.flat_map(|(table, entries)| entries.iter().map(move |(key, value)| (Some(table), key, value)));
    let keyed: Vec<_> = entries.iter().map(|(key, value)| (None, *key, *value)).chain(inner).collect();
    for (table, key, value) in &keyed {
        let is_limit = |key: &str| Quantity::NUMBERS.into_iter().any(|quantity| quantity.key() == key);
        if table.is_some_and(|table| table == "limits") && !is_limit(key.get_ref()) {
            return wrong(key.span().start, unknown_limit(key.get_ref()));
        }
        let number = value.get_ref().as_float().and_then(|number| number.as_str().parse::<f64>().ok());
        if number.is_some_and(|number| !number.is_finite()) {
            let place = table.map_or(String::new(), |table| format!("{table}."));
            return wrong(value.span().start, format!("{place}{} must be a finite number", key.get_ref()));
        }
    }
    for (key, _) in &entries {
        if FILE_KEYS.split(' ').all(|known| known != key.get_ref()) {
            let keys = FILE_KEYS.replace(' ', "`, `");
            return wrong(key.span().start, format!("unknown field `{}`, expected one of `{keys}`", key.get_ref()));
        }
    }
    match toml::from_str(text) {
        Ok(Document { audit }) => {
            let keys: Vec<_> = entries.iter().map(|(key, _)| &**key.get_ref()).collect();
            Ok((audit, keys.join(", ")))
        }
        Err(error) => {
            let start = error.span().map_or(0, |span| span.start);
            // The innermost value with the error.
            let place = keyed.iter().rfind(|(_, _, value)| value.span().contains(&start));
            let place = place.map_or(String::new(), |(table, key, _)| {
                table.map_or(String::new(), |table| format!("{table}.")) + key.get_ref() + ": "
            });
            wrong(start, place + error.message())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::request::Subject;
    use tautline_audit::envelope::Limit;

    fn request() -> AuditRequest<'static> {
        let paths = vec![PathBuf::from("show/a.csv")];
        AuditRequest::new(Subject::Files { paths, options: Box::default() }, AuditOptions::default())
    }

    fn filled(request: AuditRequest<'static>, text: &str) -> Result<ConfiguredAudit<'static>, String> {
        let path = Path::new("show/tautline.toml");
        fill(request, text, path).map_err(|failure| failure.message().to_owned())
    }

    #[test]
    fn request_takes_precedence_over_the_file() {
        let text = "[audit]\ndelta_m = 1.5\nabove_m = 0.5\nobstacles = \"venue.toml\"\n\
                    [audit.limits]\nspeed_m_s = 5.0\nclimb_m_s = 2";
        let asked = filled(request(), text).expect("a question");
        assert!(asked.asked_by().is_some_and(|note| note.contains("show/tautline.toml")));
        let options = asked.request.options;
        assert_eq!((options.delta_m, options.above_m), (Some(1.5), Some(0.5)));
        assert_eq!(options.obstacles, Some(PathBuf::from("show/venue.toml")));
        assert_eq!(options.limits.len(), 2);
        let mut other = request();
        (other.options.radius_m, other.options.above_m) = (vec![(None, 0.2)], Some(1.0));
        other.options.limits = vec![Limit { quantity: Quantity::Speed, allowed: 9.0 }];
        let options = filled(other, text).expect("a question").request.options;
        assert_eq!((options.delta_m, options.above_m), (None, Some(1.0)));
        assert_eq!(options.limits.iter().map(|limit| limit.allowed).collect::<Vec<_>>(), [9.0, 2.0]);
    }

    #[test]
    fn every_key_of_the_file_has_an_effect() {
        let values = [
            ("delta_m", "1.0"),
            ("radius_m", "1.0"),
            ("ellipsoid_m", "[1.0, 1.0, 2.0]"),
            ("cylinder_m", "[1.0, 2.0]"),
            ("well_clear", "\"do-365\""),
            ("rules", "\"skybrush\""),
            ("motion", "\"hold\""),
            ("max_accel_m_s2", "1.0\nmotion = \"bounded\""),
            ("obstacles", "\"venue.toml\""),
            ("fence", "\"fence.toml\""),
            ("above_m", "1.0"),
            ("land_on", "[\"roof\"]"),
            ("max_gap_s", "1.0"),
            ("expect_vehicles", "2"),
            ("layout", "\"vehicle,time,axis\""),
            ("allow_undecided", "true"),
            ("axes", "\"ned\""),
            ("scale", "2.0"),
            ("require_presence", "true"),
            ("accel_window_s", "1.0"),
            ("limits", "{ speed_m_s = 1.0 }"),
        ];
        assert_eq!(values.map(|(key, _)| key).join(" "), FILE_KEYS);
        let text = |key: &str, value: &str| format!("[audit]\n{key} = {value}");
        let shown = |text: &str| format!("{:?}", filled(request(), text).expect(text).request.options);
        let bounded = shown(&text("motion", "\"bounded\""));
        for (key, value) in values {
            let options = shown(&text(key, value));
            assert!(options != shown("[audit]") && options != bounded, "{key}: {options}");
        }
    }

    #[test]
    fn errors_name_their_line() {
        for (text, expected) in [
            ("", "line 1: missing field `audit`"),
            ("[audit]\ndelta = 1.5", "show/tautline.toml, line 2: unknown field `delta`"),
            ("[audit]\nmotion = \"spline\"", "line 2: motion: unknown variant `spline`"),
            ("[audit]\nids = [\"a\"]", "line 2: unknown field `ids`, expected one of `delta_m`, "),
            ("[audit]\n[audit.limits]\nheight_m = 9\nspeed = 5.0", "line 4: `speed` is not a limit: the limits are "),
            ("[audit]\nlimits = 5", "line 2: limits: numbers by the names of limits are needed"),
            ("[audit.radius_m]\na = 1\nb = \"x\"", "line 3: radius_m.b: invalid type"),
            ("[audit]\nradius_m = { a = nan }", "line 2: radius_m.a must be a finite number"),
            ("audit = [1.0]", "line 1: audit must be a table"),
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
