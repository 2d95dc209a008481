//! Why there is no picture, no film or no window.

use crate::record::RecordError;

/// Largest coordinate and radius that are drawn \[m\]: more than twice as far as the Moon. Pictures are made in single
/// precision, where fourth powers of lengths must have room.
pub const FARTHEST_M: f64 = 1e9;

/// Why there is no picture, no film or no window.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The recording cannot be read.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// A length is too large to be drawn.
    #[error(
        "vehicle {vehicle} has a {what} of {value_m:?} m at {time_s} s; what is beyond {FARTHEST_M:e} m cannot be drawn"
    )]
    TooFar {
        /// The vehicle.
        vehicle: String,
        /// Which of its lengths.
        what: &'static str,
        /// The length \[m\].
        value_m: f64,
        /// When \[s\].
        time_s: f64,
    },
    /// The recording of this name holds no samples.
    #[error("{0} holds no samples, so there is nothing to draw")]
    Empty(String),
    /// The flight has not begun.
    #[error("the flight has no samples")]
    NoSamples,
    /// A camera that is none of the known ones.
    #[error("`{0}` is not a camera")]
    UnknownCamera(String),
    /// An angle or a distance of a camera is out of range.
    #[error("the camera `{text}` has {what}")]
    CameraRange {
        /// As given.
        text: String,
        /// What is wrong with it.
        what: &'static str,
    },
    /// A camera follows a vehicle that the flight does not have.
    #[error("there is no vehicle `{name}` to follow; the flight has {vehicles}")]
    NoVehicle {
        /// As given.
        name: String,
        /// Those that there are, in words.
        vehicles: String,
    },
    /// The machine has no adapter at all.
    #[error("this machine has no graphics adapter and no driver in software")]
    NoAdapter,
    /// It has adapters, but not of this choice.
    #[error("there is no {wanted} adapter; there are: {found}")]
    NoSuchAdapter {
        /// What was asked for.
        wanted: String,
        /// Names of those that there are.
        found: String,
    },
    /// The adapter cannot be started.
    #[error("the adapter {adapter} cannot be used: {reason}")]
    UnusableAdapter {
        /// Its name.
        adapter: String,
        /// What the driver said.
        reason: String,
    },
    /// A picture of this size cannot be drawn.
    #[error(
        "a picture of {width} x {height} pixels cannot be drawn: {adapter} draws from 1 to {largest} pixels a side"
    )]
    PictureSize {
        /// Width asked for.
        width: u32,
        /// Height asked for.
        height: u32,
        /// Largest side.
        largest: u32,
        /// Name of the adapter.
        adapter: String,
    },
    /// The adapter failed while drawing, and said this.
    #[error("the graphics driver failed: {0}")]
    Driver(String),
    /// The adapter is gone.
    #[error("the graphics adapter was lost")]
    AdapterLost,
    /// A picture cannot be encoded or put together.
    #[error("the picture cannot be made: {0}")]
    Picture(String),
    /// The name of the file does not say which format a film is to be.
    #[error("`{0}` does not end in .mp4, .gif or .png")]
    UnknownFilm(String),
    /// The format does not allow this number of pictures a second.
    #[error("{format} films have from 1 to {most} pictures a second, not {fps}")]
    FilmRate {
        /// The format.
        format: &'static str,
        /// Pictures a second.
        fps: u32,
        /// Most that it allows.
        most: u32,
    },
    /// The format does not allow pictures of this size.
    #[error("a {format} film cannot have pictures of {width} x {height} pixels: {why}")]
    FilmSize {
        /// The format.
        format: &'static str,
        /// Width.
        width: u32,
        /// Height.
        height: u32,
        /// What it allows.
        why: &'static str,
    },
    /// A picture has another size than the film.
    #[error("a picture of the film has another size than the film")]
    MixedSizes,
    /// There are more or fewer pictures than the film was made for.
    #[error("the film was to have {wanted} pictures, not {given}")]
    PictureCount {
        /// Pictures that it was made for.
        wanted: u32,
        /// Pictures that were added.
        given: u32,
    },
    /// The film cannot be written.
    #[error("the film cannot be written: {0}")]
    Write(#[from] std::io::Error),
    /// The encoder of a film failed.
    #[error("the {format} encoder failed: {reason}")]
    Encoder {
        /// The format.
        format: &'static str,
        /// What it said.
        reason: String,
    },
    /// There is no screen to open a window on.
    #[error("there is no display to open a window on: {0}")]
    NoDisplay(String),
    /// The window system refused.
    #[error("the window cannot be opened: {0}")]
    NoWindow(String),
}

impl RenderError {
    /// Whether the machine is at fault, and not what was asked for.
    #[must_use]
    pub fn is_machine(&self) -> bool {
        use RenderError as E;
        matches!(
            self,
            E::NoAdapter
                | E::UnusableAdapter { .. }
                | E::Driver(_)
                | E::AdapterLost
                | E::Picture(_)
                | E::MixedSizes
                | E::PictureCount { .. }
                | E::Write(_)
                | E::Encoder { .. }
                | E::NoDisplay(_)
                | E::NoWindow(_)
        )
    }

    /// What helps, where something does.
    #[must_use]
    pub fn help(&self) -> Option<&'static str> {
        use RenderError as E;
        Some(match self {
            E::TooFar { .. } => "mend the recording, or see whether its lengths are in metres",
            E::Empty(_) => "give a recording that holds at least one sample, such as a run's run.mcap",
            E::NoSamples => "give a flight with at least one sample",
            E::NoVehicle { .. } => "give the name of a vehicle of the recording",
            E::UnknownCamera(_) | E::CameraRange { .. } => {
                "give iso, top, front, side, follow:ID, closest, or AZIMUTH,ELEVATION,DISTANCE in degrees and metres such as -60,30,25"
            }
            E::NoAdapter => {
                "install a driver; one in software is in Debian's packages: apt-get install mesa-vulkan-drivers libvulkan1"
            }
            E::NoSuchAdapter { .. } => {
                "give hardware, software or a part of the name of an adapter that there is with --adapter"
            }
            E::PictureSize { .. } => "give another size with --size",
            E::UnusableAdapter { .. } | E::Driver(_) | E::AdapterLost => {
                "try a smaller picture, or another driver with --adapter software"
            }
            E::UnknownFilm(_) => "name the film something.mp4, something.gif or something.png",
            E::FilmRate { .. } => "give another rate with --fps",
            E::FilmSize { .. } => "give another size with --size, or another format",
            E::Write(_) => "free some space or write to another folder",
            E::NoDisplay(_) => "run it on a machine with a screen, or draw without one: tautline render RECORDING",
            _ => return None,
        })
    }
}

/// Refuses lengths \[m\] that are too large to be drawn.
pub(super) fn check_lengths<'a>(
    lengths_m: impl IntoIterator<Item = &'a f64>,
    what: &'static str,
    time_s: f64,
    vehicle: impl FnOnce() -> String,
) -> Result<(), RenderError> {
    let too_far = lengths_m.into_iter().find(|length_m| length_m.abs() > FARTHEST_M);
    too_far.map_or(Ok(()), |&value_m| Err(RenderError::TooFar { vehicle: vehicle(), what, value_m, time_s }))
}
