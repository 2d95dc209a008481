//! `export_drones`: writes a flight for drones, and judges the written motion.
//!
//! The flight is audited, encoded and written beside the output. The written files are read back, compared with the
//! flight and audited. Only files that were proved, or judged clear for sampled formats, get the name of the output.

use std::collections::hash_map::RandomState;
use std::fmt::Write as _;
use std::fs;
use std::hash::BuildHasher as _;
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use rayon::prelude::*;
use serde_json::json;

use super::audit::{AuditRequest, ConfigFile, Subject, recording_in};
use super::{Failure, Monitor, Quiet, outputs};
use crate::report::recorded::RecordedReport;
use crate::report::{ArtefactError, Status, write_atomically};
use tautline_audit::envelope::{Limit, Quantity};
use tautline_audit::recorded::{Interpolation, Settings};
use tautline_core::text::{at_least, at_most, counted, fixed};
use tautline_core::track::Tracks;
use tautline_recordings::export::drones::motion::{Deviation, Motion};
use tautline_recordings::export::drones::{
    self, Dialect, DroneOptions, Encoded, EncodedVehicle, FlownVehicle, deviation_with_rests,
};
use tautline_recordings::read::{self, ReadError, ReadOptions, TimeUnit};

/// Largest speed of a limit that no vehicle reaches \[m/s\]: a lone vehicle is read under it for its gaps.
const BEYOND_M_S: f64 = 1e9;
/// Decimals of lengths in the answer.
const DECIMALS: u8 = 6;

/// A recording and the files to write for drones.
#[derive(Clone, Debug)]
pub struct DroneExportRequest {
    /// Files or folders. Several paths are one recording, each with a vehicle of its own.
    pub paths: Vec<PathBuf>,
    /// Options of the readers.
    pub options: ReadOptions,
    /// Path of the output: a folder or a file, as the format demands.
    pub output: PathBuf,
    /// Format, tolerance and rate. The safety distance is set from the limits.
    pub drones: DroneOptions,
    /// Safety distance \[m\]; by default that of the recording.
    pub delta_m: Option<f64>,
    /// Half axes of the ellipsoid around each vehicle \[m\]; by default that of the recording.
    pub ellipsoid_m: Option<Vector3<f64>>,
    /// TOML file of obstacles; by default those of the recording.
    pub obstacles: Option<PathBuf>,
    /// Start of the exported part of the flight \[s\].
    pub from_s: Option<f64>,
    /// End of the exported part of the flight \[s\].
    pub until_s: Option<f64>,
    /// Whether an existing output is overwritten.
    pub force: bool,
}

/// Answer of an export for drones.
#[derive(Clone, Debug)]
pub struct DroneExport {
    /// Vehicles.
    pub vehicles: Vec<EncodedVehicle>,
    /// Largest deviation of the written motion from the flight, and its vehicle. Times are those of the flight.
    pub deviation: Option<(Deviation, String)>,
    /// Verdict on the written motion; `None` without two objects to keep apart.
    pub audit: Option<RecordedReport>,
    /// Smallest margin of a distance to its limit \[m\], with the names of the pair and the time of the flight \[s\].
    pub margin: Option<(f64, [String; 2], f64)>,
    /// Start and end of the exported part of the flight \[s\].
    pub span_s: (f64, f64),
    /// Size of all files \[bytes\].
    pub bytes: usize,
    /// Reason why nothing was written: the flight or its written motion is not clear.
    pub refusal: Option<Failure>,
}

/// Writes a flight for drones, judges the written files, and removes them if they are not clear.
///
/// # Errors
/// [`Failure`] if the request or the recording is wrong, if the format cannot hold the flight, or if no file can be
/// written. A violation is no error: see [`DroneExport::refusal`].
pub fn export_drones(request: &DroneExportRequest, monitor: &dyn Monitor) -> Result<DroneExport, Failure> {
    let paths = request.paths.iter().map(|path| recording_in(path)).collect();
    let request = &DroneExportRequest { paths, ..request.clone() };
    request.check()?;
    let flight = Flight::read(request, monitor)?;
    for note in &flight.notes {
        monitor.warn(&format!("note: {note}"));
    }
    if flight.audit.status == Status::Violation {
        let message = format!("the flight itself is not clear: {}", flight.audit.headline());
        let help = "fly it with a larger separation, or export a part without the violation by --from and --until";
        let refusal = Some(Failure::input("export/violation", message, help));
        return Ok(DroneExport { span_s: flight.span_s, refusal, ..DroneExport::empty() });
    }
    let mut options = request.drones;
    options.delta_m = flight.settings.delta_m.filter(|_| flight.settings.ellipsoid_m.is_none());
    let motions: Vec<_> = flight.vehicles.iter().map(|of| (of.name.clone(), of.motion.clone())).collect();
    monitor.begin("fit", None);
    let encoded = drones::encode(&motions, &options, &|| monitor.is_interrupted());
    monitor.finish();
    let encoded = encoded.map_err(|error| error.later(flight.span_s.0))?;
    let written = Written::new(&request.output, &options, &encoded)?;
    let mut answer = written.judged(&flight, &options, encoded, monitor)?;
    if answer.refusal.is_none() {
        written.keep(request.force)?;
        monitor.say(&answer.text(request, &flight));
    }
    answer.bytes = written.bytes;
    Ok(answer)
}

impl DroneExportRequest {
    /// Checks the options and the output.
    fn check(&self) -> Result<(), Failure> {
        let Self { drones, output, .. } = self;
        let dialect = drones.dialect;
        let unused = [
            (drones.is_compressed && dialect != Dialect::Crazyflie, "--compressed", "crazyflie"),
            (drones.skyb_version != 2 && dialect != Dialect::Skyb, "--skyb-version", "skyb"),
            (drones.sample_hz.is_some() && !dialect.is_sampled(), "--sample-hz", "px4-show and vviz"),
        ];
        if let Some((_, option, of)) = unused.into_iter().find(|(is_unused, ..)| *is_unused) {
            let message = format!("{option}: has no effect with --to {}", dialect.name());
            return Err(Failure::input("export/unused-option", message, format!("leave it out, or give --to {of}")));
        }
        if self.ellipsoid_m.is_some() && self.obstacles.is_some() {
            let message = "--ellipsoid and --obstacles: must not both be given";
            return Err(Failure::input("export/unused-option", message, "leave one of them out"));
        }
        let replaceable = match fs::read_dir(output) {
            Ok(mut entries) => dialect.is_folder() && (entries.next().is_none() || (self.force && is_export(output))),
            Err(_) => !output.exists() || (!dialect.is_folder() && self.force),
        };
        if !replaceable {
            let help = if output.is_dir() != dialect.is_folder() {
                format!("give a {} that does not exist", if dialect.is_folder() { "folder" } else { "file" })
            } else if self.force {
                "give another folder: it holds other files than an export".to_owned()
            } else {
                "overwrite it with --force, or give another path".to_owned()
            };
            return Err(Failure::input("files/exists", format!("`{}` exists", output.display()), help));
        }
        let parent = output.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if !parent.is_dir() {
            let message = format!("--output: there is no folder {}", parent.display());
            return Err(Failure::input("files/no-folder", message, "make this folder, or give another path"));
        }
        let mut inputs: Vec<_> = self.paths.iter().map(|path| ("the recording", path.as_path())).collect();
        inputs.extend(self.obstacles.as_deref().map(|path| ("the file of obstacles", path)));
        let replaced = fs::canonicalize(output).ok();
        let is_within =
            |path: &Path| fs::canonicalize(path).ok().zip(replaced.as_ref()).is_some_and(|(a, b)| a.starts_with(b));
        if let Some((called, path)) = inputs.iter().find(|(_, path)| is_within(path)) {
            let message = format!("--output {} would overwrite {called}, {}", output.display(), path.display());
            return Err(Failure::input("files/overwrites-input", message, "give another path"));
        }
        outputs::check(&inputs, &[("--output", output)])
    }

    /// Returns the request for the audit of the flight.
    fn audit(&self) -> AuditRequest<'static> {
        let subject = Subject::Files { paths: self.paths.clone(), options: Box::new(self.options.clone()) };
        let settings = Settings {
            delta_m: self.delta_m,
            ellipsoid_m: self.ellipsoid_m,
            from_s: self.from_s,
            to_s: self.until_s,
            ..Settings::default()
        };
        let obstacles = self.obstacles.clone();
        AuditRequest { settings, obstacles, for_drones: true, config: ConfigFile::None, ..AuditRequest::new(subject) }
    }

    /// Checks the window before anything is read.
    fn check_window(&self) -> Result<(), Failure> {
        for (option, given) in [("--from", self.from_s), ("--until", self.until_s)] {
            if let Some(given) = given.filter(|given| !given.is_finite()) {
                let message = format!("{option}: must be a finite number of seconds, got {given:?}");
                return Err(Failure::input("export/window", message, format!("give {option} a time such as 2.5")));
            }
        }
        match (self.from_s, self.until_s) {
            (Some(from_s), Some(until_s)) if until_s <= from_s => {
                let message = format!("--until: must be after --from, got {until_s:?} s and {from_s:?} s");
                Err(Failure::input("export/window", message, "give a larger --until or a smaller --from"))
            }
            _ => Ok(()),
        }
    }

    /// Returns an error of the audit in terms of the options of an export.
    fn in_own_terms(&self, failure: Failure, vehicles: &[FlownVehicle]) -> Failure {
        let help = match failure.code() {
            "audit/empty-window" => {
                let spans = || vehicles.iter().filter_map(|of| of.motion.span_s());
                let first_s = spans().map(|span| span.0).fold(f64::INFINITY, f64::min);
                let last_s = spans().map(|span| span.1).fold(f64::NEG_INFINITY, f64::max);
                let (option, given) = match (self.from_s, self.until_s) {
                    (Some(from_s), until_s) if until_s.is_none() || from_s > last_s => ("--from", from_s),
                    (_, until_s) => ("--until", until_s.unwrap_or(last_s)),
                };
                let message = format!(
                    "{option}: no vehicle is present in the exported part, got {given:?} s; the recording has \
                     {first_s:?} s to {last_s:?} s"
                );
                return Failure::input("export/window", message, "give --from and --until within the recording");
            }
            "audit/no-limit" => "give --delta or --ellipsoid",
            "audit/obstacles-and-ellipsoid" => "give --delta, or leave --obstacles out",
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
                let help = "name the column of the height with --column z=NAME";
                return Err(Failure::input("export/no-heights", message, help));
            }
            drones::motions(recording.as_mut(), false)?
        };
        let has_pair = vehicles.len() > 1 || !settings.obstacles.is_empty();
        if !has_pair {
            audit.settings.envelope.limits = vec![Limit { quantity: Quantity::Speed, allowed: BEYOND_M_S }];
        }
        let judged = audit.configured()?.judge(&quiet).map_err(|error| request.in_own_terms(error, &vehicles))?;
        let report = judged.report;
        check_presence(&report)?;
        let span = |of: &FlownVehicle| {
            of.motion.span_s().ok_or_else(|| {
                let message = format!("vehicle {}: it has fewer than two samples", of.name);
                let help = "leave it out of the recording: a drone needs a motion";
                Failure::input("export/absent", message, help)
            })
        };
        let spans = vehicles.iter().map(span).collect::<Result<Vec<_>, _>>()?;
        let from_s = spans.iter().map(|span| span.0).fold(request.from_s.unwrap_or(f64::NEG_INFINITY), f64::max);
        let until_s = spans.iter().map(|span| span.1).fold(request.until_s.unwrap_or(f64::INFINITY), f64::min);
        if until_s <= from_s {
            let message = format!("the exported part from {from_s:?} s to {until_s:?} s is empty");
            return Err(Failure::input("export/absent", message, "give --from and --until within the recording"));
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
        (settings.from_s, settings.to_s, settings.is_own_limit) = (None, None, false);
        Ok(Self { vehicles, span_s: (from_s, until_s), settings, has_pair, audit: report, notes })
    }
}

/// Refuses a vehicle that is absent for a part of the window, or whose motion has a gap.
fn check_presence(report: &RecordedReport) -> Result<(), Failure> {
    if let Some(absent) = report.presence.listed.first() {
        let spans = report.presence.listed.iter();
        let is_seen = spans.clone().all(|of| of.finding.from_s.is_some());
        let from_s = spans.clone().filter_map(|of| of.finding.from_s).fold(f64::NEG_INFINITY, f64::max);
        let to_s = spans.filter_map(|of| of.finding.to_s).fold(f64::INFINITY, f64::min);
        let seen = match (absent.finding.from_s, absent.finding.to_s) {
            (Some(first_s), Some(last_s)) => {
                format!("is absent for a part of the flight (seen {first_s:?} s to {last_s:?} s)")
            }
            _ => "is not seen between --from and --until".to_owned(),
        };
        let message = format!("vehicle {}: it {seen}", absent.vehicle);
        let help = if is_seen && from_s < to_s {
            format!("export the part in which all vehicles are present: --from {from_s:?} --until {to_s:?}")
        } else {
            "export a recording in which all vehicles are present at one time".to_owned()
        };
        return Err(Failure::input("export/absent", message, help));
    }
    if let Some(gap) = report.gaps.first() {
        let (from_s, to_s) = (gap.finding.from_s, gap.finding.to_s);
        let message = format!("vehicle {}: its motion from {from_s:?} s to {to_s:?} s is unknown, a gap", gap.vehicle);
        let help = "export a part without the gap by --from and --until, or record all samples";
        return Err(Failure::input("export/gap", message, help));
    }
    Ok(())
}

/// Files beside the output, removed when dropped unless kept.
struct Written<'a> {
    output: &'a Path,
    /// Folder of the files.
    folder: PathBuf,
    /// The output in it.
    content: PathBuf,
    bytes: usize,
}

impl<'a> Written<'a> {
    fn new(output: &'a Path, options: &DroneOptions, encoded: &Encoded) -> Result<Self, Failure> {
        let name = output.file_name().ok_or_else(|| {
            let message = format!("--output: {} has no name", output.display());
            Failure::input("files/no-folder", message, "give the path of a file or folder")
        })?;
        // Several machines may write into one folder, so the number of the process is not enough.
        let mark = format!(".{:016x}.partial", RandomState::new().hash_one(std::process::id()));
        let mut hidden = std::ffi::OsString::from(".");
        hidden.push(name);
        hidden.push(mark);
        let folder = output.with_file_name(hidden);
        let content = folder.join(name);
        let files = encoded.files.iter().map(|file| file.bytes.len()).sum();
        let written = Self { output, folder, content, bytes: files };
        let target = if options.dialect.is_folder() { &written.content } else { &written.folder };
        fs::create_dir_all(target).map_err(|error| written.error(error))?;
        for file in &encoded.files {
            let path = if file.name.is_empty() { written.content.clone() } else { written.content.join(&file.name) };
            write_atomically(&path, &file.bytes)?;
        }
        Ok(written)
    }

    fn error(&self, source: std::io::Error) -> Failure {
        ArtefactError { path: self.output.display().to_string(), source }.into()
    }

    /// Opens the files with the public readers.
    fn open(&self, options: &DroneOptions) -> Result<Box<dyn Tracks<Error = ReadError>>, ReadError> {
        let time_unit = (options.dialect == Dialect::Px4Show).then_some(TimeUnit::Seconds);
        read::open(&self.content, &ReadOptions { time_unit, ..ReadOptions::default() })
    }

    /// Reads the files back, compares them with the flight and judges them.
    fn judged(
        &self,
        flight: &Flight,
        options: &DroneOptions,
        encoded: Encoded,
        monitor: &dyn Monitor,
    ) -> Result<DroneExport, Failure> {
        let start_s = flight.span_s.0;
        let mut held = drones::motions(self.open(options)?.as_mut(), options.dialect.holds_samples())?;
        let mut evaluation_m = 0.0_f64;
        for of in &encoded.vehicles {
            let read_back = held.iter_mut().find(|held| held.name == of.label).ok_or_else(|| lost(&of.label))?;
            evaluation_m = evaluation_m.max(of.add_evaluation(&mut read_back.motion));
        }
        let compared = flight.vehicles.par_iter().zip(&encoded.vehicles).map(|(flown, of)| {
            let read_back = held.iter().find(|held| held.name == of.label).ok_or_else(|| lost(&of.label))?;
            let curve = if read_back.motion.arcs.is_empty() { Motion::default() } else { read_back.motion.clone() };
            let mut found = deviation_with_rests(&flown.motion, &curve);
            found.time_s += start_s;
            Ok((found, of.name.clone()))
        });
        let compared = compared.collect::<Result<Vec<_>, Failure>>()?;
        let deviation = compared.into_iter().max_by(|a, b| a.0.bound_m.total_cmp(&b.0.bound_m));
        if let Some((found, vehicle)) = &deviation
            && options.tolerance_m.is_some_and(|tolerance_m| found.bound_m > tolerance_m)
        {
            let message = format!("vehicle {vehicle}: the written file is {:?} m from the flight", found.bound_m);
            return Err(Failure::input("export/too-fast", message, "give a larger --tolerance"));
        }
        let mut answer = DroneExport {
            vehicles: encoded.vehicles,
            deviation,
            span_s: flight.span_s,
            bytes: self.bytes,
            ..DroneExport::empty()
        };
        if !flight.has_pair {
            return Ok(answer);
        }
        let mut settings = flight.settings.clone();
        inflate(&mut settings, evaluation_m);
        for (flown, of) in flight.vehicles.iter().zip(&answer.vehicles) {
            // An ellipsoid replaces recorded radii.
            if flown.radius_m.is_some() && settings.ellipsoid_m.is_none() {
                settings.vehicles.entry(of.label.clone()).or_default().radius_m =
                    flown.radius_m.map(|radius_m| radius_m + evaluation_m);
            }
        }
        let motions: &[_] = match options.dialect {
            // Setpoints are held. A vehicle that follows them smoothly is between two of them.
            Dialect::Px4Show => &[Some(Interpolation::Hold), Some(Interpolation::Linear)],
            Dialect::Vviz => &[Some(Interpolation::Linear)],
            _ => &[None],
        };
        let name = self.output.display().to_string();
        for motion in motions {
            let subject = Subject::InMemory { name: &name, own: None, open: &|| self.open(options) };
            let settings = Settings { motion: *motion, ..settings.clone() };
            let request = AuditRequest { settings, config: ConfigFile::None, ..AuditRequest::new(subject) };
            let report = request.configured()?.judge(&Quiet::new(monitor))?.report;
            answer.add(report, start_s);
        }
        Ok(answer)
    }

    /// Moves the files to the output.
    fn keep(&self, force: bool) -> Result<(), Failure> {
        if !(self.output.is_dir() && force) {
            return fs::rename(&self.content, self.output).map_err(|error| self.error(error));
        }
        // Beside the folder, which is removed in any case.
        let old = self.folder.with_extension("old");
        fs::rename(self.output, &old).map_err(|error| self.error(error))?;
        fs::rename(&self.content, self.output).map_err(|error| match fs::rename(&old, self.output) {
            Ok(()) => self.error(error),
            Err(_) => self.error(error).with_help(format!("the old folder is now {}", old.display())),
        })?;
        // The export is complete, even if the old folder remains.
        let _ = fs::remove_dir_all(&old);
        Ok(())
    }
}

impl Drop for Written<'_> {
    fn drop(&mut self) {
        // The first error is reported; an error of the removal is ignored.
        let _ = fs::remove_dir_all(&self.folder);
    }
}

/// Inflates limits, so that they hold if each vehicle is up to `by_m` \[m\] from the judged motion.
fn inflate(settings: &mut Settings, by_m: f64) {
    if by_m == 0.0 {
        return;
    }
    // Rounded up to a micrometre, for messages.
    let up = |x: f64| ((x * 1e6).ceil() / 1e6).max(x);
    settings.delta_m = settings.delta_m.map(|delta_m| up(delta_m + 2.0 * by_m));
    settings.radius_m = settings.radius_m.map(|radius_m| radius_m + by_m);
    for radius_m in settings.vehicles.values_mut().filter_map(|of| of.radius_m.as_mut()) {
        *radius_m += by_m;
    }
    for clearance_m in settings.obstacles.iter_mut().filter_map(|of| of.clearance_m.as_mut()) {
        *clearance_m += by_m;
    }
    // An ellipsoid scaled by 1 + e / a, with a the shortest half axis, contains its sum with a ball of radius e.
    settings.ellipsoid_m = settings.ellipsoid_m.map(|axes| axes * (1.0 + by_m / axes.min()));
}

/// Returns the failure of a vehicle that is not in the written files.
fn lost(label: &str) -> Failure {
    let message = format!("vehicle {label}: the written files have no vehicle of this name");
    Failure::input("export/name", message, "rename the vehicle in the recording")
}

impl DroneExport {
    fn empty() -> Self {
        Self {
            vehicles: Vec::new(),
            deviation: None,
            audit: None,
            margin: None,
            span_s: (0.0, 0.0),
            bytes: 0,
            refusal: None,
        }
    }

    /// Adds a verdict on the written motion, whose times begin `start_s` after those of the flight. The worst one is
    /// kept.
    fn add(&mut self, report: RecordedReport, start_s: f64) {
        let closest = report.closest.iter().chain(&report.obstacles.closest);
        let name = |label: &String| {
            self.vehicles.iter().find(|of| of.label == *label).map_or_else(|| label.clone(), |of| of.name.clone())
        };
        let margins =
            closest.map(|of| (of.finding.lower_m - of.finding.limit_m, of.who.each_ref().map(name), of.finding.time_s));
        let least = margins.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(margin, who, at_s)| (margin, who, at_s + start_s));
        let is_less = match (&least, &self.margin) {
            (Some((new, ..)), Some((old, ..))) => new < old,
            (least, _) => least.is_some(),
        };
        if report.status != Status::Clear && self.refusal.is_none() {
            let shift =
                if start_s == 0.0 { String::new() } else { format!(", whose 0 s are {start_s:?} s of the flight") };
            let message = format!("the flight is clear, but not the written motion{shift}: {}", report.headline());
            let help = "give a smaller --tolerance or a larger --sample-hz, or fly it with a larger separation";
            self.refusal = Some(Failure::input("export/violation", message, help));
        }
        if is_less || self.audit.is_none() {
            (self.margin, self.audit) = (least, Some(report));
        }
    }

    /// Returns whether the files were written.
    #[must_use]
    pub fn is_good(&self) -> bool {
        self.refusal.is_none()
    }

    /// Returns the answer as JSON; docs/export.md lists the keys.
    #[must_use]
    pub fn to_json(&self) -> String {
        let vehicle =
            |of: &EncodedVehicle| json!({"name": of.name, "label": of.label, "parts": of.parts, "bytes": of.bytes});
        let margin =
            self.margin.as_ref().map(|(margin, who, at_s)| json!({"margin": margin, "who": who, "at_s": at_s}));
        let deviation = self.deviation.as_ref().map(|(found, vehicle)| {
            json!({"bound_m": found.bound_m, "found_m": found.found_m, "at_s": found.time_s, "vehicle": vehicle})
        });
        let answer = json!({
            "verdict": self.audit.as_ref().map(RecordedReport::headline),
            "refusal": self.refusal.as_ref().map(Failure::in_words),
            "margin": margin,
            "deviation": deviation,
            "from_s": self.span_s.0,
            "until_s": self.span_s.1,
            "bytes": self.bytes,
            "vehicles": self.vehicles.iter().map(vehicle).collect::<Vec<_>>(),
        });
        answer.to_string()
    }

    /// Returns whether times or names of the files differ from those of the flight.
    fn has_own_terms(&self) -> bool {
        self.span_s.0 != 0.0 || self.vehicles.iter().any(|of| of.name != of.label)
    }

    /// Returns the answer in words.
    fn text(&self, request: &DroneExportRequest, flight: &Flight) -> String {
        let mut text = match &self.audit {
            Some(report) if self.has_own_terms() => report.headline() + "; times and names of the files\n",
            Some(report) => report.headline() + "\n",
            None => "not judged: there is one vehicle and no obstacle\n".to_owned(),
        };
        let unit = if flight.settings.ellipsoid_m.is_some() { "half axes" } else { "m" };
        let of_flight = if self.has_own_terms() { " of the flight" } else { "" };
        // Writing to a string cannot fail.
        if let Some((margin, [one, other], at_s)) = &self.margin {
            let left = at_least(*margin, DECIMALS);
            let _ = writeln!(
                text,
                "margin       {left} {unit} above the limit, {one} and {other} at {} s{of_flight}",
                fixed(*at_s, 3)
            );
        }
        if let Some((found, vehicle)) = &self.deviation {
            let most = at_most(found.bound_m, DECIMALS);
            let at_s = fixed(found.time_s, 3);
            let _ = writeln!(
                text,
                "deviation    at most {most} m from the flight at every instant, vehicle {vehicle} at {at_s} \
                 s{of_flight}"
            );
        }
        let dialect = request.drones.dialect;
        let [one, many] = if dialect.is_sampled() { ["sample", "samples"] } else { ["piece", "pieces"] };
        let parts = || self.vehicles.iter().map(|of| of.parts);
        let (fewest, most) = (parts().min().unwrap_or(0), parts().max().unwrap_or(0));
        let range = counted(most as u64, one, many);
        let range = if fewest == most { range } else { format!("{fewest} to {range}") };
        let bytes = self.vehicles.iter().map(|of| of.bytes).max().unwrap_or(0);
        let vehicles = counted(self.vehicles.len() as u64, "vehicle", "vehicles");
        let _ = writeln!(text, "vehicles     {vehicles}, {range} each, at most {bytes} bytes each");
        let (from_s, until_s) = self.span_s;
        let shift =
            if from_s == 0.0 { String::new() } else { format!("; {from_s:?} s of the flight are 0 s of the files") };
        let _ = writeln!(text, "flight       {} s to {} s{shift}", fixed(from_s, 3), fixed(until_s, 3));
        let _ = write!(text, "wrote {}: {}, {} bytes", request.output.display(), dialect.title(), self.bytes);
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_that_cannot_be_replaced_is_restored() {
        let place = tempfile::tempdir().expect("a folder");
        let output = place.path().join("cf");
        fs::create_dir(&output).expect("made");
        fs::write(output.join("a.csv"), "old").expect("written");
        let folder = place.path().join(".cf.partial");
        // There is no new content, so the second rename fails.
        let written = Written { output: &output, content: folder.join("cf"), folder, bytes: 0 };
        assert!(written.keep(true).is_err());
        drop(written);
        assert_eq!(fs::read_to_string(output.join("a.csv")).expect("restored"), "old");
        assert_eq!(fs::read_dir(place.path()).expect("a folder").count(), 1);
    }

    #[test]
    fn inflated_ellipsoids_contain_a_ball_around_each_point() {
        let mut settings = Settings { ellipsoid_m: Some(Vector3::new(1.0, 1.0, 2.0)), ..Settings::default() };
        inflate(&mut settings, 0.1);
        assert_eq!(settings.ellipsoid_m, Some(Vector3::new(1.1, 1.1, 2.2)));
        let mut settings = Settings { radius_m: Some(0.2), ..Settings::delta(1.0) };
        inflate(&mut settings, 0.125);
        assert_eq!((settings.delta_m, settings.radius_m), (Some(1.25), Some(0.325)));
    }
}
