//! Written files of an export, and their audit.

use std::collections::hash_map::RandomState;
use std::fs;
use std::hash::BuildHasher as _;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::super::audit::{AuditOptions, AuditRequest, Subject};
use super::super::{Failure, Monitor, Quiet};
use super::{DroneExport, Flight};
use tautline_audit::recorded::Settings;
use tautline_core::files::{FileError, write_atomically};
use tautline_core::option::{OUTPUT, TOLERANCE};
use tautline_core::track::Tracks;
use tautline_recordings::export::drones::motion::Motion;
use tautline_recordings::export::drones::{self, DroneOptions, Encoded, deviation_with_rests};
use tautline_recordings::read::{self, ReadError, ReadOptions};

/// Files beside the output, removed when dropped unless kept.
pub(super) struct Written<'a> {
    output: &'a Path,
    /// Folder of the files.
    folder: PathBuf,
    /// The output in it.
    content: PathBuf,
    pub(super) bytes: usize,
}

impl<'a> Written<'a> {
    pub(super) fn new(output: &'a Path, options: &DroneOptions, encoded: &Encoded) -> Result<Self, Failure> {
        let name = output.file_name().ok_or_else(|| {
            let message = format!("{OUTPUT}: {} has no name", output.display());
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
        FileError { path: self.output.display().to_string(), source }.into()
    }

    /// Opens the files with the public readers.
    fn open(&self) -> Result<Box<dyn Tracks<Error = ReadError>>, ReadError> {
        read::open(&self.content, &ReadOptions::default())
    }

    /// Reads the files back, compares them with the flight and judges them.
    pub(super) fn judged(
        &self,
        flight: &Flight,
        options: &DroneOptions,
        encoded: Encoded,
        monitor: &dyn Monitor,
    ) -> Result<DroneExport, Failure> {
        let start_s = flight.span_s.0;
        let mut held = drones::motions(self.open()?.as_mut())?;
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
            && found.bound_m > options.tolerance_m
        {
            let message = format!("vehicle {vehicle}: the written file is {:?} m from the flight", found.bound_m);
            return Err(Failure::input("export/too-fast", message, format!("give a larger {TOLERANCE}")));
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
        let name = self.output.display().to_string();
        let subject = Subject::InMemory { name: &name, own: None, open: &|| self.open() };
        let audit = AuditRequest::new(subject, AuditOptions::default()).configured()?;
        answer.add(audit.judge_with(Settings { motion: None, ..settings }, &Quiet::new(monitor))?.report, start_s);
        Ok(answer)
    }

    /// Moves the files to the output.
    pub(super) fn keep(&self, force: bool) -> Result<(), Failure> {
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

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

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
