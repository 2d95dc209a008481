//! `export_drones`: writes a flight for drones, and judges the written motion.
//!
//! The flight is audited, encoded and written beside the output. The written files are read back, compared with the
//! flight and audited. Only files that were proved get the name of the output.

mod answer;
mod written;

use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;

pub use self::answer::DroneExport;
use self::written::Written;
#[cfg(feature = "cli")]
use super::audit::rules;
use super::audit::{AuditOptions, AuditRequest, Subject, recording_in};
use super::{ExportRequest, Failure, Monitor, Quiet, outputs};
use crate::report::Status;
use crate::report::recorded::RecordedReport;
use tautline_audit::envelope::{Limit, Quantity};
use tautline_audit::recorded::Settings;
use tautline_core::option::{
    COLUMN, COMPRESSED, DELTA, ELLIPSOID, EXPORT_FORMAT, FORCE, FROM, OBSTACLES, OUTPUT, Opt, SAMPLE_HZ, SKYB_VERSION,
    TOLERANCE, UNTIL,
};
use tautline_recordings::export::drones::{self, Dialect, DroneOptions, FlownVehicle};

/// Largest speed of a limit that no vehicle reaches \[m/s\]: a lone vehicle is read under it for its gaps.
const BEYOND_M_S: f64 = 1e9;

/// Newest version of `.skyb` files.
const NEWEST_SKYB: u8 = 2;

/// Options that only an export for drones has; an option that is not given has its default value.
///
/// With the feature `cli` this struct is a part of the arguments of `tautline export`, and its comments are the help.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "cli", derive(clap::Args), command(next_help_heading = "For drones"))]
#[allow(rustdoc::broken_intra_doc_links, reason = "units are in brackets, as in the help")]
pub struct DroneExportOptions {
    /// Largest distance of the written motion from the flight [m] [default: 0.01].
    #[cfg_attr(feature = "cli", arg(long = "tolerance", value_name = "METRES"))]
    #[cfg_attr(feature = "cli", arg(allow_negative_numbers = true))]
    pub tolerance_m: Option<f64>,
    /// Safety distance between two centres [m] [default: that of the recording].
    #[cfg_attr(feature = "cli", arg(long = "delta", value_name = "METRES"))]
    #[cfg_attr(feature = "cli", arg(allow_negative_numbers = true))]
    pub delta_m: Option<f64>,
    /// Half axes [m] of an ellipsoid around each vehicle, or a name (crazyswarm, crazyflie-firmware) [default: those of
    /// the recording].
    #[cfg_attr(feature = "cli", arg(long = "ellipsoid", value_name = "AX,AY,AZ"))]
    #[cfg_attr(feature = "cli", arg(value_parser = rules::ellipsoid, allow_hyphen_values = true))]
    pub ellipsoid_m: Option<Vector3<f64>>,
    /// TOML file of obstacles [default: those of the recording].
    #[cfg_attr(feature = "cli", arg(long, value_name = "FILE"))]
    pub obstacles: Option<PathBuf>,
    /// Start of the exported part of the flight [s].
    #[cfg_attr(feature = "cli", arg(long = "from", value_name = "SECONDS"))]
    #[cfg_attr(feature = "cli", arg(allow_negative_numbers = true))]
    pub from_s: Option<f64>,
    /// End of the exported part of the flight [s].
    #[cfg_attr(feature = "cli", arg(long = "until", value_name = "SECONDS"))]
    #[cfg_attr(feature = "cli", arg(allow_negative_numbers = true))]
    pub until_s: Option<f64>,
    /// Write the compressed form of a Crazyflie, whose coordinates reach 32.767 m.
    #[cfg_attr(feature = "cli", arg(long = "compressed"))]
    pub is_compressed: bool,
    /// Version of .skyb files: 1, or 2 with a checksum [default: 2].
    #[cfg_attr(feature = "cli", arg(long, value_name = "VERSION"))]
    pub skyb_version: Option<u8>,
}

/// A recording and the files to write for drones.
#[derive(Clone, Debug)]
pub struct DroneExportRequest {
    /// Recording, output, and sampling rate. The output is a folder or a file, as the format demands.
    pub file: ExportRequest,
    /// Format that drones fly.
    pub dialect: Dialect,
    /// Tolerance, limits and part of the flight.
    pub options: DroneExportOptions,
}

/// Writes a flight for drones, judges the written files, and removes them if they are not clear.
///
/// # Errors
/// [`Failure`] if the request or the recording is wrong, if the format cannot hold the flight, or if no file can be
/// written. A violation is no error: see [`DroneExport::refusal`].
pub fn export_drones(request: &DroneExportRequest, monitor: &dyn Monitor) -> Result<DroneExport, Failure> {
    let mut request = request.clone();
    for path in &mut request.file.paths {
        *path = recording_in(path);
    }
    request.check()?;
    let request = &request;
    let flight = Flight::read(request, monitor)?;
    for note in &flight.notes {
        monitor.warn(&format!("note: {note}"));
    }
    if flight.audit.status == Status::Violation {
        let message = format!("the flight itself is not clear: {}", flight.audit.headline());
        let help =
            format!("fly it with a larger separation, or export a part without the violation by {FROM} and {UNTIL}");
        let refusal = Some(Failure::input("export/violation", message, help));
        return Ok(DroneExport { span_s: flight.span_s, refusal, ..DroneExport::empty() });
    }
    let options = request.encoding(&flight.settings);
    let motions: Vec<_> = flight.vehicles.iter().map(|of| (of.name.clone(), of.motion.clone())).collect();
    monitor.begin("fit", None);
    let encoded = drones::encode(&motions, &options, &|| monitor.is_interrupted());
    monitor.finish();
    let encoded = encoded.map_err(|error| error.later(flight.span_s.0))?;
    let written = Written::new(&request.file.output, &options, &encoded)?;
    let mut answer = written.judged(&flight, &options, encoded, monitor)?;
    if answer.refusal.is_none() {
        written.keep(request.file.force)?;
        monitor.say(&answer.text(request, &flight));
    }
    answer.bytes = written.bytes;
    Ok(answer)
}

impl DroneExportOptions {
    /// Returns the first option that is given.
    fn given(&self) -> Option<Opt> {
        let Self { tolerance_m, delta_m, ellipsoid_m, obstacles, from_s, until_s, is_compressed, skyb_version } = self;
        let all = [
            (tolerance_m.is_some(), TOLERANCE),
            (delta_m.is_some(), DELTA),
            (ellipsoid_m.is_some(), ELLIPSOID),
            (obstacles.is_some(), OBSTACLES),
            (from_s.is_some(), FROM),
            (until_s.is_some(), UNTIL),
            (*is_compressed, COMPRESSED),
            (skyb_version.is_some(), SKYB_VERSION),
        ];
        all.into_iter().find_map(|(is_given, option)| is_given.then_some(option))
    }

    /// Rejects options for an export that is not for drones.
    ///
    /// # Errors
    /// [`Failure`] `export/unused-option` that names the first option.
    pub fn refuse(&self) -> Result<(), Failure> {
        let Some(option) = self.given() else { return Ok(()) };
        let formats = Dialect::ALL.map(Dialect::name).join(", ");
        let message = format!("{option}: has no effect without a format for drones");
        let help = format!("leave it out, or give {EXPORT_FORMAT} one of {formats}");
        Err(Failure::input("export/unused-option", message, help))
    }
}

impl DroneExportRequest {
    /// Checks the options and the output.
    fn check(&self) -> Result<(), Failure> {
        let Self { file: ExportRequest { paths, output, sample_hz, force, .. }, dialect, options } = self;
        let has_old_version = options.skyb_version.is_some_and(|version| version != NEWEST_SKYB);
        let unused = [
            (options.is_compressed && *dialect != Dialect::Crazyflie, COMPRESSED, "crazyflie"),
            (has_old_version && *dialect != Dialect::Skyb, SKYB_VERSION, "skyb"),
            (sample_hz.is_some(), SAMPLE_HZ, "csv"),
        ];
        if let Some((_, option, format)) = unused.into_iter().find(|(is_unused, ..)| *is_unused) {
            let message = format!("{option}: has no effect with {}", EXPORT_FORMAT.set(dialect.name()));
            let help = format!("leave it out, or give {}", EXPORT_FORMAT.set(format));
            return Err(Failure::input("export/unused-option", message, help));
        }
        if options.ellipsoid_m.is_some() && options.obstacles.is_some() {
            let message = format!("{ELLIPSOID} and {OBSTACLES}: must not both be given");
            return Err(Failure::input("export/unused-option", message, "leave one of them out"));
        }
        let replaceable = match fs::read_dir(output) {
            Ok(mut entries) => dialect.is_folder() && (entries.next().is_none() || (*force && is_export(output))),
            Err(_) => !output.exists() || (!dialect.is_folder() && *force),
        };
        if !replaceable {
            let help = if output.is_dir() != dialect.is_folder() {
                format!("give a {} that does not exist", if dialect.is_folder() { "folder" } else { "file" })
            } else if *force {
                "give another folder: it holds other files than an export".to_owned()
            } else {
                format!("overwrite it with {FORCE}, or give another path")
            };
            return Err(Failure::input("files/exists", format!("`{}` exists", output.display()), help));
        }
        let parent = output.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if !parent.is_dir() {
            let message = format!("{OUTPUT}: there is no folder {}", parent.display());
            return Err(Failure::input("files/no-folder", message, "make this folder, or give another path"));
        }
        let mut inputs: Vec<_> = paths.iter().map(|path| ("the recording".to_owned(), path.as_path())).collect();
        inputs.extend(options.obstacles.as_deref().map(|path| ("the file of obstacles".to_owned(), path)));
        let replaced = fs::canonicalize(output).ok();
        let is_within =
            |path: &Path| fs::canonicalize(path).ok().zip(replaced.as_ref()).is_some_and(|(a, b)| a.starts_with(b));
        if let Some((called, path)) = inputs.iter().find(|(_, path)| is_within(path)) {
            let message = format!("{OUTPUT} {} would overwrite {called}, {}", output.display(), path.display());
            return Err(Failure::input("files/overwrites-input", message, "give another path"));
        }
        outputs::check(&inputs, &[(OUTPUT.to_string(), output)])
    }

    /// Returns the options of the encoder. A show states the safety distance of the flight.
    fn encoding(&self, limits: &Settings) -> DroneOptions {
        let usual = DroneOptions::new(self.dialect);
        DroneOptions {
            tolerance_m: self.options.tolerance_m.unwrap_or(usual.tolerance_m),
            is_compressed: self.options.is_compressed,
            skyb_version: self.options.skyb_version.unwrap_or(NEWEST_SKYB),
            delta_m: limits.delta_m.filter(|_| limits.ellipsoid_m.is_none()),
            ..usual
        }
    }

    /// Returns the request for the audit of the flight.
    fn audit(&self) -> AuditRequest<'static> {
        let ExportRequest { paths, options, .. } = &self.file;
        let subject = Subject::Files { paths: paths.clone(), options: Box::new(options.clone()) };
        let DroneExportOptions { delta_m, ellipsoid_m, obstacles, from_s, until_s, .. } = self.options.clone();
        let options = AuditOptions {
            delta_m,
            ellipsoid_m,
            obstacles,
            from_s,
            until_s,
            no_config: true,
            ..AuditOptions::default()
        };
        AuditRequest { for_drones: true, ..AuditRequest::new(subject, options) }
    }

    /// Checks the window before anything is read.
    fn check_window(&self) -> Result<(), Failure> {
        for (option, given) in [(FROM, self.options.from_s), (UNTIL, self.options.until_s)] {
            if let Some(given) = given.filter(|given| !given.is_finite()) {
                let message = format!("{option}: must be a finite number of seconds, got {given:?}");
                return Err(Failure::input("export/window", message, format!("give {option} a time such as 2.5")));
            }
        }
        match (self.options.from_s, self.options.until_s) {
            (Some(from_s), Some(until_s)) if until_s <= from_s => {
                let message = format!("{UNTIL}: must be after {FROM}, got {until_s:?} s and {from_s:?} s");
                Err(Failure::input("export/window", message, format!("give a larger {UNTIL} or a smaller {FROM}")))
            }
            _ => Ok(()),
        }
    }

    /// Refuses a vehicle that is absent for a part of the window, or whose motion has a gap.
    fn check_presence(&self, report: &RecordedReport) -> Result<(), Failure> {
        let is_window = self.options.from_s.is_some() || self.options.until_s.is_some();
        if let Some(absent) = report.presence.listed.first() {
            let spans = report.presence.listed.iter();
            let is_seen = spans.clone().all(|of| of.finding.from_s.is_some());
            let from_s = spans.clone().filter_map(|of| of.finding.from_s).fold(f64::NEG_INFINITY, f64::max);
            let to_s = spans.filter_map(|of| of.finding.to_s).fold(f64::INFINITY, f64::min);
            let seen = match (absent.finding.from_s, absent.finding.to_s) {
                (Some(first_s), Some(last_s)) => {
                    format!("is absent for a part of the flight (seen {first_s:?} s to {last_s:?} s)")
                }
                _ if self.options.from_s.is_none() && self.options.until_s.is_none() => {
                    "is not seen at any time".to_owned()
                }
                _ => "is not seen in the exported part".to_owned(),
            };
            let message = format!("vehicle {}: it {seen}", absent.vehicle);
            let help = if is_seen && from_s < to_s {
                let [from, until] = [FROM.set(format!("{from_s:?}")), UNTIL.set(format!("{to_s:?}"))];
                format!("export the part in which all vehicles are present: {from} {until}")
            } else {
                let part = if is_window { ", or export a part in which all vehicles are present" } else { "" };
                format!("leave the vehicle out of the recording{part}")
            };
            return Err(Failure::input("export/absent", message, help));
        }
        if let Some(gap) = report.gaps.first() {
            let (from_s, to_s) = (gap.finding.from_s, gap.finding.to_s);
            let message =
                format!("vehicle {}: its motion from {from_s:?} s to {to_s:?} s is unknown, a gap", gap.vehicle);
            let help = format!("export a part without the gap by {FROM} and {UNTIL}, or record all samples");
            return Err(Failure::input("export/gap", message, help));
        }
        Ok(())
    }

    /// Returns an error of the audit in terms of the options of an export.
    fn in_own_terms(&self, failure: Failure, vehicles: &[FlownVehicle]) -> Failure {
        let help = match failure.code() {
            "audit/empty-window" => {
                let spans = || vehicles.iter().filter_map(|of| of.motion.span_s());
                let first_s = spans().map(|span| span.0).fold(f64::INFINITY, f64::min);
                let last_s = spans().map(|span| span.1).fold(f64::NEG_INFINITY, f64::max);
                let (option, given) = match (self.options.from_s, self.options.until_s) {
                    (Some(from_s), until_s) if until_s.is_none() || from_s > last_s => (FROM, from_s),
                    (_, until_s) => (UNTIL, until_s.unwrap_or(last_s)),
                };
                let message = format!(
                    "{option}: no vehicle is present in the exported part, got {given:?} s; the recording has \
                     {first_s:?} s to {last_s:?} s"
                );
                return Failure::input(
                    "export/window",
                    message,
                    format!("give {FROM} and {UNTIL} within the recording"),
                );
            }
            "audit/no-limit" => format!("give {DELTA} or {ELLIPSOID}"),
            "audit/obstacles-and-ellipsoid" => format!("give {DELTA}, or leave {OBSTACLES} out"),
            _ => return failure,
        };
        failure.with_help(help)
    }
}

/// Returns whether a folder holds nothing but files of an export.
fn is_export(folder: &Path) -> bool {
    let is_exported = |entry: fs::DirEntry| {
        let path = entry.path();
        entry.file_type().is_ok_and(|of| of.is_file()) && drones::is_exported(&path).unwrap_or(false)
    };
    fs::read_dir(folder).is_ok_and(|mut entries| entries.all(|entry| entry.is_ok_and(is_exported)))
}

/// Exported part of a flight.
struct Flight {
    /// Vehicles with their motions from the start of the part on.
    vehicles: Vec<FlownVehicle>,
    /// Start and end \[s\].
    span_s: (f64, f64),
    /// Limits for the written motion.
    settings: Settings,
    /// Whether there are two objects to keep apart.
    has_pair: bool,
    /// Verdict on the flight.
    audit: RecordedReport,
    notes: Vec<String>,
}

impl Flight {
    fn read(request: &DroneExportRequest, monitor: &dyn Monitor) -> Result<Self, Failure> {
        request.check_window()?;
        let quiet = Quiet::new(monitor);
        let mut audit = request.audit();
        let mut settings = audit.settings_with_limits(&quiet)?;
        let mut vehicles = {
            let mut recording = audit.subject.open()?;
            if recording.is_planar() {
                let message = format!("{}: no heights are known", audit.subject.name());
                let help = format!("name the column of the height with {}", COLUMN.set("z=NAME"));
                return Err(Failure::input("export/no-heights", message, help));
            }
            drones::motions(recording.as_mut())?
        };
        let has_pair = vehicles.len() > 1 || !settings.obstacles.is_empty();
        if !has_pair {
            audit.options.limits = vec![Limit { quantity: Quantity::Speed, allowed: BEYOND_M_S }];
        }
        let judged = audit.configured()?.judge(&quiet).map_err(|error| request.in_own_terms(error, &vehicles))?;
        let report = judged.report;
        request.check_presence(&report)?;
        let span = |of: &FlownVehicle| {
            of.motion.span_s().ok_or_else(|| {
                let message = format!("vehicle {}: it has fewer than two samples", of.name);
                let help = "leave it out of the recording: a drone needs a motion";
                Failure::input("export/absent", message, help)
            })
        };
        let spans = vehicles.iter().map(span).collect::<Result<Vec<_>, _>>()?;
        let from_s =
            spans.iter().map(|span| span.0).fold(request.options.from_s.unwrap_or(f64::NEG_INFINITY), f64::max);
        let until_s = spans.iter().map(|span| span.1).fold(request.options.until_s.unwrap_or(f64::INFINITY), f64::min);
        if until_s <= from_s {
            let message = format!("the exported part from {from_s:?} s to {until_s:?} s is empty");
            let help = format!("give {FROM} and {UNTIL} within the recording");
            return Err(Failure::input("export/absent", message, help));
        }
        for vehicle in &mut vehicles {
            vehicle.motion = vehicle.motion.window(from_s, until_s);
        }
        let mut notes = report.source.notes.clone();
        if report.status == Status::Undecided {
            notes.push(format!("the flight itself is {}", report.headline()));
        }
        // The written motion begins at 0 s.
        for (time_s, _) in settings.obstacles.iter_mut().flat_map(|obstacle| &mut obstacle.path) {
            *time_s -= from_s;
        }
        settings.max_gap_s = Some(f64::INFINITY);
        (settings.from_s, settings.until_s) = (None, None);
        Ok(Self { vehicles, span_s: (from_s, until_s), settings, has_pair, audit: report, notes })
    }
}
