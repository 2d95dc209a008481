//! Errors of pictures, films and the window.

use std::borrow::Cow;

use tautline_core::failure::Failure;
use tautline_core::option::{ADAPTER, FILM_FPS, SIZE};
use tautline_core::record::RecordError;

/// Largest coordinate and radius that can be drawn \[m\]: more than twice the distance of the Moon. Pictures use single
/// precision, in which fourth powers of lengths must not overflow.
pub const FARTHEST_M: f64 = 1e9;

/// Error of a picture, a film or the window.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The recording cannot be read.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// A length is too large to be drawn. The text names vehicle, quantity, value and time.
    #[error("{0}; coordinates and radii must be at most {FARTHEST_M:e} m")]
    TooFar(String),
    /// The flight of this name has no samples.
    #[error("{0} has no samples, so there is nothing to draw")]
    Empty(String),
    /// The camera is unknown or out of range.
    #[error("{0}")]
    Camera(String),
    /// The camera follows a vehicle that the flight does not have.
    #[error("{0}")]
    NoVehicle(String),
    /// The machine has no adapter.
    #[error("this machine has no graphics adapter and no software driver")]
    NoAdapter,
    /// The machine has adapters, but none that matches the choice.
    #[error("{0}")]
    NoSuchAdapter(String),
    /// A picture of this size cannot be drawn.
    #[error("{0}")]
    PictureSize(String),
    /// The adapter cannot be started, failed while drawing, or was lost.
    #[error("{0}")]
    Driver(String),
    /// A picture cannot be encoded or composed.
    #[error("the picture cannot be encoded or composed: {0}")]
    Picture(String),
    /// The file name has no extension of a film format.
    #[error("`{0}` does not end in .mp4 or .gif")]
    UnknownFilm(String),
    /// The format does not allow this frame rate.
    #[error("{0}")]
    FilmRate(String),
    /// The format does not allow pictures of this size.
    #[error("{0}")]
    FilmSize(String),
    /// The film got the wrong pictures, or its encoder failed.
    #[error("{0}")]
    Film(String),
    /// There is no encoder for MP4.
    #[error("this build encodes MP4 films with ffmpeg, and there is no ffmpeg on PATH")]
    NoFfmpeg,
    /// The film cannot be written.
    #[error("the film cannot be written: {0}")]
    Write(#[from] std::io::Error),
    /// There is no display for a window.
    #[error("there is no display to open a window on: {0}")]
    NoDisplay(String),
    /// The window system refused the window.
    #[error("the window cannot be opened: {0}")]
    NoWindow(String),
}

impl RenderError {
    /// Returns the stable code of the error, such as `render/no-adapter`.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Record(_) => "recording/malformed",
            Self::TooFar(_) => "render/too-far",
            Self::Empty(_) => "render/empty",
            Self::Camera(_) => "render/camera",
            Self::NoVehicle(_) => "render/no-vehicle",
            Self::NoAdapter => "render/no-adapter",
            Self::NoSuchAdapter(_) => "render/no-such-adapter",
            Self::PictureSize(_) => "render/picture-size",
            Self::Driver(_) => "render/driver",
            Self::Picture(_) => "render/picture",
            Self::UnknownFilm(_) => "render/unknown-film",
            Self::FilmRate(_) => "render/film-rate",
            Self::FilmSize(_) => "render/film-size",
            Self::Film(_) => "render/film",
            Self::NoFfmpeg => "render/no-ffmpeg",
            Self::Write(_) => "files/cannot-write",
            Self::NoDisplay(_) => "render/no-display",
            Self::NoWindow(_) => "render/no-window",
        }
    }

    /// Returns whether the cause is the machine, as opposed to the input.
    #[must_use]
    pub fn is_machine(&self) -> bool {
        use RenderError as E;
        let of_machine = matches!(self, E::NoAdapter | E::Driver(_) | E::NoDisplay(_) | E::NoWindow(_));
        of_machine || matches!(self, E::Picture(_) | E::Film(_) | E::NoFfmpeg | E::Write(_))
    }

    /// Returns a remedy, if there is one.
    #[must_use]
    pub fn help(&self) -> Option<Cow<'static, str>> {
        use RenderError as E;
        Some(match self {
            E::TooFar(_) => "correct the recording, or check that its lengths are in metres".into(),
            E::Empty(_) => "give a recording that holds at least one sample, such as a run's run.mcap".into(),
            E::NoVehicle(_) => "give the name of a vehicle of the recording".into(),
            E::Camera(_) => "give auto, perspective, top, front, side, follow, follow:ID, closest, or \
                 AZIMUTH,ELEVATION,DISTANCE in degrees and metres such as -60,30,25"
                .into(),
            E::NoAdapter => {
                "install a driver; Debian has one in software: apt-get install mesa-vulkan-drivers libvulkan1".into()
            }
            E::NoSuchAdapter(_) => {
                let help =
                    format!("give hardware, software or a part of the name of an existing adapter with {ADAPTER}");
                help.into()
            }
            E::PictureSize(_) => format!("give another size with {SIZE}").into(),
            E::Driver(_) => {
                let software = ADAPTER.set("software");
                format!("try a smaller picture, or another driver with {software}").into()
            }
            E::UnknownFilm(_) => "name the film something.mp4 or something.gif".into(),
            E::FilmRate(_) => format!("give another rate with {FILM_FPS}").into(),
            E::FilmSize(_) => format!("give another size with {SIZE}, or another format").into(),
            E::Write(_) => "free some space or write to another folder".into(),
            E::NoFfmpeg => "install ffmpeg, build tautline with --features film, or name a .gif film".into(),
            E::NoDisplay(_) => {
                "run it on a machine with a screen, or draw without one: tautline render RECORDING".into()
            }
            E::Record(_) | E::Picture(_) | E::Film(_) | E::NoWindow(_) => return None,
        })
    }
}

/// Checks that lengths \[m\] are small enough to be drawn.
pub(super) fn check_lengths<'a>(
    lengths_m: impl IntoIterator<Item = &'a f64>,
    what: &str,
    time_s: f64,
    vehicle: impl FnOnce() -> String,
) -> Result<(), RenderError> {
    let too_far = lengths_m.into_iter().find(|length_m| length_m.abs() > FARTHEST_M);
    too_far.map_or(Ok(()), |length_m| {
        Err(RenderError::TooFar(format!("vehicle {} has a {what} of {length_m:?} m at {time_s} s", vehicle())))
    })
}

/// Checks that a picture of this width and height can be drawn \[pixels\].
pub(super) fn check_size([width, height]: [u32; 2], largest_px: u32, painter: &str) -> Result<(), RenderError> {
    if [width, height].into_iter().all(|side| (1..=largest_px).contains(&side)) {
        return Ok(());
    }
    Err(RenderError::PictureSize(format!(
        "a picture of {width} x {height} pixels cannot be drawn: {painter} draws from 1 to {largest_px} pixels a side"
    )))
}

impl From<RenderError> for Failure {
    fn from(error: RenderError) -> Self {
        match error {
            RenderError::Record(error) => error.into(),
            error => {
                let failure = Self::new(error.code(), error.is_machine(), error.to_string());
                error.help().into_iter().fold(failure, Self::with_help)
            }
        }
    }
}
