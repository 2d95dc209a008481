//! Recordings written in other formats, without losing a bit.
//!
//! What is read back from an exported file has the same times, vehicles, positions, velocities and radii, bit for bit;
//! only a table in text cannot say what its times count from, and holds the same instants since 1970. A recording is
//! read several times, so that memory is bounded by an instant and a block, not by the recording. Curves cannot be
//! written as samples silently: [`ExportOptions::sample_hz`] says how often they are sampled.

mod csv;
mod mcap;
mod npz;
mod parquet;
mod sampled;

use std::fs::File;
use std::io;

use crate::read::{ReadError, Recording};
use crate::track::{Clock, Item, Sample};
use sampled::Sampled;

/// The formats that are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// A long table in text.
    Csv,
    /// A long table in Parquet.
    Parquet,
    /// `NumPy` arrays.
    Npz,
    /// MCAP with messages of our own.
    Mcap,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 4] = [Self::Csv, Self::Parquet, Self::Npz, Self::Mcap];

    /// What `--format` calls it, and the extension of its files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Csv => "csv",
            Self::Parquet => "parquet",
            Self::Npz => "npz",
            Self::Mcap => "mcap",
        }
    }

    /// The format of this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.name().eq_ignore_ascii_case(name))
    }
}

/// How a recording is written.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExportOptions {
    /// How often curves are sampled \[Hz\], from the beginning of the recording on.
    pub sample_hz: Option<f64>,
}

/// What was written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Exported {
    /// Number of vehicles.
    pub vehicles: usize,
    /// Number of samples: a vehicle at an instant each.
    pub samples: u64,
    /// What a person should know, a sentence each.
    pub notes: Vec<String>,
}

/// A recording cannot be exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The recording cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The file cannot be written.
    #[error("cannot write the exported file: {0}")]
    Write(#[from] io::Error),
    /// The recording holds curves, and nobody says how often they are to be sampled.
    #[error("the recording holds curves, and the file would hold samples")]
    Curves,
    /// The recording holds samples, which are written as they are.
    #[error("the recording holds samples, which are written as they are and not sampled again")]
    NoCurves,
    /// The curves cannot be sampled so often.
    #[error("curves cannot be sampled at {0} Hz")]
    SampleRate(f64),
    /// The name of a vehicle cannot be written in the format.
    #[error("the name {0:?} of a vehicle cannot be written in this format")]
    Name(String),
}

impl ExportError {
    /// What helps, as a sentence without a full stop.
    #[must_use]
    pub fn help(&self) -> String {
        match self {
            Self::Read(error) => return error.help(),
            Self::Write(error) if error.kind() == io::ErrorKind::NotSeekable => {
                "write it to a file: this format goes back to what it has written"
            }
            Self::Write(_) => "free some space or write to another folder",
            Self::Curves => "say how often curves are sampled with --sample-hz; between the samples they are lost",
            Self::NoCurves => "leave --sample-hz away",
            Self::SampleRate(_) => "give a positive number of samples per second, such that their count stays sensible",
            Self::Name(_) => "export to mcap or parquet",
        }
        .to_owned()
    }

    /// Whether the machine failed and not the input.
    #[must_use]
    pub fn is_machine(&self) -> bool {
        match self {
            Self::Read(error) => error.is_machine(),
            Self::Write(_) => true,
            _ => false,
        }
    }
}

/// Writes a recording into an empty file. `open` opens the recording, each time from its beginning.
///
/// # Errors
/// [`ExportError`] when the recording cannot be read, the file cannot be written, or one does not fit the other.
pub fn export(
    open: &dyn Fn() -> Result<Recording, ReadError>,
    format: Format,
    options: &ExportOptions,
    file: &mut File,
) -> Result<Exported, ExportError> {
    let source = Source { open, sample_hz: options.sample_hz };
    let about = source.survey()?;
    let mut exported = Exported { vehicles: about.names.len(), samples: about.samples, notes: about.notes.clone() };
    match format {
        Format::Csv => exported.notes.extend(csv::write(&source, &about, file)?),
        Format::Parquet => parquet::write(&source, &about, file)?,
        Format::Npz => npz::write(&source, &about, file)?,
        Format::Mcap => mcap::write(&source, &about, file)?,
    }
    Ok(exported)
}

/// A recording that can be read again and again.
struct Source<'a> {
    open: &'a dyn Fn() -> Result<Recording, ReadError>,
    sample_hz: Option<f64>,
}

/// What a recording holds.
#[derive(Debug, Default)]
struct About {
    names: Vec<String>,
    clock: Clock,
    notes: Vec<String>,
    samples: u64,
    instants: usize,
    /// Whether some sample has a velocity.
    velocities: bool,
    /// Whether some sample has a radius.
    radii: bool,
}

/// A column of numbers of a long table.
struct Column {
    name: &'static str,
    /// What stands in it; none where the cell is empty.
    of: fn(&Sample) -> Option<f64>,
}

/// The columns that every sample fills.
const POSITION: [Column; 3] = [
    Column { name: "x", of: |sample| Some(sample.position_m.x) },
    Column { name: "y", of: |sample| Some(sample.position_m.y) },
    Column { name: "z", of: |sample| Some(sample.position_m.z) },
];

const VELOCITY: [Column; 3] = [
    Column { name: "vx", of: |sample| sample.velocity_m_s.map(|v| v.x) },
    Column { name: "vy", of: |sample| sample.velocity_m_s.map(|v| v.y) },
    Column { name: "vz", of: |sample| sample.velocity_m_s.map(|v| v.z) },
];

const RADIUS: [Column; 1] = [Column { name: "radius", of: |sample| sample.radius_m }];

impl About {
    /// The columns that some samples fill and others may not.
    fn optional_columns(&self) -> impl Iterator<Item = &'static Column> {
        let velocities: &[_] = if self.velocities { &VELOCITY } else { &[] };
        let radii: &[_] = if self.radii { &RADIUS } else { &[] };
        velocities.iter().chain(radii)
    }
}

impl Source<'_> {
    fn survey(&self) -> Result<About, ExportError> {
        let mut about = About::default();
        let recording = self.each_instant(|instant| {
            about.instants += 1;
            about.samples += instant.len() as u64;
            about.velocities |= instant.iter().any(|sample| sample.velocity_m_s.is_some());
            about.radii |= instant.iter().any(|sample| sample.radius_m.is_some());
            Ok(())
        })?;
        about.names = recording.vehicles().to_vec();
        about.clock = recording.clock().clone();
        about.notes = recording.notes().to_vec();
        if let Some(hz) = self.sample_hz {
            about.notes.push(format!("curves were sampled at {hz} Hz: what is between the samples is lost"));
        }
        Ok(about)
    }

    /// Calls `take` with the samples of each instant, in order of time.
    fn each_instant(
        &self,
        mut take: impl FnMut(&[Sample]) -> Result<(), ExportError>,
    ) -> Result<Recording, ExportError> {
        let mut recording = (self.open)()?;
        if let Some(hz) = self.sample_hz {
            Sampled::new(recording.as_mut(), hz)?.each_instant(&mut take)?;
            return Ok(recording);
        }
        let (mut items, mut instant) = (Vec::new(), Vec::<Sample>::new());
        loop {
            items.clear();
            if !recording.read(&mut items)? {
                break;
            }
            for item in &items {
                let Item::Sample(sample) = item else { return Err(ExportError::Curves) };
                if instant.first().is_some_and(|first| first.time_s != sample.time_s) {
                    take(&instant)?;
                    instant.clear();
                }
                instant.push(*sample);
            }
        }
        if !instant.is_empty() {
            take(&instant)?;
        }
        Ok(recording)
    }
}
