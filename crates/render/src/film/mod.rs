//! Films: sequences of pictures as MP4 or GIF.

#[cfg(not(feature = "mp4"))]
mod ffmpeg;
mod gif;
#[cfg(feature = "mp4")]
mod mp4;

use std::io::Write;
use std::path::Path;

use super::error::RenderError;
use super::picture::Picture;

/// Highest frame rate \[Hz\].
const MAX_FPS: u32 = 240;

/// Film format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilmFormat {
    /// H.264 in MP4, by the encoder of the feature `mp4`, or else by `ffmpeg` on PATH.
    Mp4,
    /// GIF: 256 colours per picture, at most 50 pictures per second.
    Gif,
}

impl FilmFormat {
    /// Returns the format of a file name.
    ///
    /// # Errors
    /// [`RenderError::UnknownFilm`] for any other extension.
    pub fn of(path: &Path) -> Result<Self, RenderError> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("mp4") => Ok(Self::Mp4),
            Some("gif") => Ok(Self::Gif),
            _ => Err(RenderError::UnknownFilm(path.display().to_string())),
        }
    }

    /// Checks that an encoder for the format is available.
    ///
    /// # Errors
    /// [`RenderError::NoFfmpeg`] for MP4 without the feature `mp4` and without `ffmpeg` on PATH.
    pub fn check_encoder(self) -> Result<(), RenderError> {
        #[cfg(not(feature = "mp4"))]
        if self == Self::Mp4 {
            return ffmpeg::check();
        }
        Ok(())
    }

    /// Checks that a film can have pictures of this size at this frame rate.
    ///
    /// # Errors
    /// [`RenderError::FilmSize`] or [`RenderError::FilmRate`] if it cannot.
    pub fn check(self, size_px: [u32; 2], fps: u32) -> Result<(), RenderError> {
        let (name, max_fps) = match self {
            Self::Mp4 => ("MP4", MAX_FPS),
            Self::Gif => ("GIF", gif::MAX_FPS),
        };
        if !(1..=max_fps).contains(&fps) {
            let what = format!("{name} films must have 1 to {max_fps} pictures per second, got {fps}");
            return Err(RenderError::FilmRate(what));
        }
        let [width, height] = size_px;
        let (shorter, longer) = (width.min(height), width.max(height));
        let why = match self {
            Self::Mp4 if width % 2 == 1 || height % 2 == 1 => "H.264 needs even sides",
            Self::Mp4 if shorter < 16 || longer > 3840 || shorter > 2160 => {
                "the size must be from 16 x 16 to 3840 x 2160"
            }
            Self::Gif if shorter == 0 || longer > u32::from(u16::MAX) => "sides must be from 1 to 65535",
            _ => return Ok(()),
        };
        let what = format!("a {name} film cannot have pictures of {width} x {height} pixels: {why}");
        Err(RenderError::FilmSize(what))
    }
}

/// Film that is being encoded. Encoded data are written at once, except for MP4: its encoded pictures, which are small,
/// stay in memory until the table before them is written.
pub struct Film<'a> {
    size_px: [u32; 2],
    wanted: u32,
    given: u32,
    encoder: Box<dyn FilmEncoder + 'a>,
}

impl<'a> Film<'a> {
    /// Begins a film of `pictures` pictures of one size at `fps`. It is written in small parts, so `out` should be
    /// buffered and flushed at the end.
    ///
    /// # Errors
    /// [`RenderError`] if the format does not allow the size or the rate, without pictures, or if writing fails.
    pub fn new<W: Write + Send + 'a>(
        out: W,
        format: FilmFormat,
        size_px: [u32; 2],
        fps: u32,
        pictures: u32,
    ) -> Result<Self, RenderError> {
        format.check(size_px, fps)?;
        if pictures == 0 {
            return Err(RenderError::Film("a film needs at least one picture".to_owned()));
        }
        let encoder: Box<dyn FilmEncoder + 'a> = match format {
            #[cfg(feature = "mp4")]
            FilmFormat::Mp4 => Box::new(mp4::Mp4::new(out, size_px, fps)?),
            #[cfg(not(feature = "mp4"))]
            FilmFormat::Mp4 => Box::new(ffmpeg::Ffmpeg::new(out, size_px, fps)?),
            FilmFormat::Gif => Box::new(gif::Gif::new(out, size_px, fps)?),
        };
        Ok(Self { size_px, wanted: pictures, given: 0, encoder })
    }

    /// Adds pictures in order. Work on single pictures runs in parallel.
    ///
    /// # Errors
    /// [`RenderError`] if a picture has another size, the encoder fails, or writing fails.
    pub fn add(&mut self, pictures: &[Picture]) -> Result<(), RenderError> {
        if pictures.iter().any(|picture| picture.size_px != self.size_px) {
            return Err(RenderError::Film("all pictures of a film must have the size of the film".to_owned()));
        }
        self.given = u32::try_from(pictures.len()).map_or(u32::MAX, |more| self.given.saturating_add(more));
        self.encoder.add(pictures)
    }

    /// Writes the end of the film.
    ///
    /// # Errors
    /// [`RenderError`] if the number of pictures is not the announced one, the encoder fails, or writing fails.
    pub fn finish(self) -> Result<(), RenderError> {
        let Self { wanted, given, .. } = self;
        if wanted != given {
            return Err(RenderError::Film(format!("the film must have {wanted} pictures, got {given}")));
        }
        self.encoder.finish()
    }
}

/// That the encoder of a format failed.
fn failed(format: &str, error: impl std::fmt::Display) -> RenderError {
    RenderError::Film(format!("the {format} encoder failed: {error}"))
}

/// Writes pictures of one size as a film.
trait FilmEncoder: Send {
    /// Adds pictures in order. What can be done to each by itself is done side by side.
    fn add(&mut self, pictures: &[Picture]) -> Result<(), RenderError>;

    /// Writes the end of the film.
    fn finish(self: Box<Self>) -> Result<(), RenderError>;
}

#[cfg(test)]
mod tests;
