//! The recording of a request: files, or motion in memory.

use std::path::{Path, PathBuf};

use super::super::{Failure, Monitor, RECORDING};
use super::OwnRecording;
use tautline_core::track::Tracks;
use tautline_recordings::read::{self, Format, ReadError, ReadOptions, ShowRules};

/// Function that opens the recording at its beginning, at each call.
pub type Open<'a> = dyn Fn() -> Result<Box<dyn Tracks<Error = ReadError> + 'a>, ReadError> + Sync + 'a;

/// The recording of a request.
#[derive(Clone)]
pub enum Subject<'a> {
    /// Files or folders. Several paths are one recording, each with a vehicle of its own.
    Files {
        /// Paths, at least one.
        paths: Vec<PathBuf>,
        /// Options of the readers.
        options: Box<ReadOptions>,
    },
    /// Motion in the memory of the caller.
    InMemory {
        /// Name of the motion in messages.
        name: &'a str,
        /// Limits, obstacles and audit of a flight of `tautline run`.
        own: Option<&'a OwnRecording>,
        /// Function that opens the motion.
        open: &'a Open<'a>,
    },
}

impl Subject<'_> {
    /// Returns the name of the recording in messages.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Files { paths, .. } => read::recording_name(&paths.iter().map(PathBuf::as_path).collect::<Vec<_>>()),
            Self::InMemory { name, .. } => (*name).to_owned(),
        }
    }

    /// Opens the recording at its beginning.
    ///
    /// # Errors
    /// [`ReadError`] if the recording cannot be read.
    pub fn open(&self) -> Result<Box<dyn Tracks<Error = ReadError> + '_>, ReadError> {
        match self {
            Self::Files { paths, options } => open(paths, options).map(|recording| recording as _),
            Self::InMemory { open, .. } => open(),
        }
    }

    pub(super) fn paths(&self) -> &[PathBuf] {
        match self {
            Self::Files { paths, .. } => paths,
            Self::InMemory { .. } => &[],
        }
    }

    /// Returns limits, obstacles and audit of a `tautline run` recording, and the rules of a show file.
    pub(super) fn own(&self, monitor: &dyn Monitor) -> Result<(Option<OwnRecording>, Option<ShowRules>), Failure> {
        match self {
            Self::InMemory { own, .. } => Ok((own.cloned(), None)),
            Self::Files { paths, options } => {
                let show = match paths.first() {
                    Some(path) => read::show_rules(path, options).map_err(|error| Failure::from(error).of(path))?,
                    None => None,
                };
                Ok((own_recording(paths, options, monitor)?, show))
            }
        }
    }
}

/// Opens files or folders as one recording.
///
/// # Errors
/// [`ReadError`] if one of them cannot be read.
pub fn open(paths: &[PathBuf], options: &ReadOptions) -> Result<read::Recording, ReadError> {
    match paths {
        [path] => read::open(&recording_in(path), options),
        paths => read::open_joined(&paths.iter().map(PathBuf::as_path).collect::<Vec<_>>(), options),
    }
}

/// Returns the recording in the folder of a run, and any other path unchanged.
#[must_use]
pub fn recording_in(path: &Path) -> PathBuf {
    let recorded = path.join(RECORDING);
    if recorded.is_file() { recorded } else { path.to_owned() }
}

/// Returns the contents of a recording of `tautline run` besides positions; `None` for any other recording.
///
/// # Errors
/// [`Failure`] if its scenario cannot be read.
pub fn own_recording(
    paths: &[PathBuf],
    options: &ReadOptions,
    monitor: &dyn Monitor,
) -> Result<Option<OwnRecording>, Failure> {
    match paths {
        [path] if options.format.is_none_or(|format| format == Format::MCAP) => {
            OwnRecording::read(path, options, monitor)
        }
        _ => Ok(None),
    }
}
