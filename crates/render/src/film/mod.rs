//! Films: pictures one after another, as MP4 or GIF.

#[cfg(not(feature = "mp4"))]
mod ffmpeg;
mod gif;
#[cfg(feature = "mp4")]
mod mp4;

use std::io::Write;
use std::path::Path;

use super::error::RenderError;
use super::picture::Picture;

/// Most pictures a second that a film is made for.
const MOST_FPS: u32 = 240;

/// What a film is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilmFormat {
    /// H.264 in MP4, by the encoder of the feature `mp4`, or else by `ffmpeg` on PATH.
    Mp4,
    /// GIF: 256 colours a picture, at most 50 pictures a second.
    Gif,
}

impl FilmFormat {
    /// The format that a file's name asks for.
    ///
    /// # Errors
    /// [`RenderError::UnknownFilm`] when it is none of those that can be made.
    pub fn of(path: &Path) -> Result<Self, RenderError> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("mp4") => Ok(Self::Mp4),
            Some("gif") => Ok(Self::Gif),
            _ => Err(RenderError::UnknownFilm(path.display().to_string())),
        }
    }

    /// Whether something here encodes the format.
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

    /// Whether a film can have pictures of this size, so many a second.
    ///
    /// # Errors
    /// [`RenderError::FilmSize`] or [`RenderError::FilmRate`] when it cannot.
    pub fn check(self, size_px: [u32; 2], fps: u32) -> Result<(), RenderError> {
        let (name, most) = match self {
            Self::Mp4 => ("MP4", MOST_FPS),
            Self::Gif => ("GIF", gif::MOST_FPS),
        };
        if !(1..=most).contains(&fps) {
            let what = format!("{name} films have from 1 to {most} pictures a second, not {fps}");
            return Err(RenderError::FilmRate(what));
        }
        let [width, height] = size_px;
        let (shorter, longer) = (width.min(height), width.max(height));
        let why = match self {
            Self::Mp4 if width % 2 == 1 || height % 2 == 1 => "H.264 needs even sides",
            Self::Mp4 if shorter < 16 || longer > 3840 || shorter > 2160 => "from 16 x 16 to 3840 x 2160",
            Self::Gif if shorter == 0 || longer > u32::from(u16::MAX) => "a side has from 1 to 65535",
            _ => return Ok(()),
        };
        let what = format!("a {name} film cannot have pictures of {width} x {height} pixels: {why}");
        Err(RenderError::FilmSize(what))
    }
}

/// A film in the making. What is encoded is written at once, but for MP4: its pictures, which are small, wait in memory
/// for the table that comes before them.
pub struct Film<'a> {
    size_px: [u32; 2],
    wanted: u32,
    given: u32,
    encoder: Box<dyn FilmEncoder + 'a>,
}

impl<'a> Film<'a> {
    /// The beginning of a film of so many pictures of one size, so many a second. It is written in small pieces: `out`
    /// should be buffered, and flushed at the end.
    ///
    /// # Errors
    /// [`RenderError`] when the format does not allow the size or the rate, when it has no pictures, or when it cannot be
    /// written.
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

    /// Adds pictures in order. What can be done to each by itself is done side by side.
    ///
    /// # Errors
    /// [`RenderError`] when one has another size, when the encoder fails, or when it cannot be written.
    pub fn add(&mut self, pictures: &[Picture]) -> Result<(), RenderError> {
        if pictures.iter().any(|picture| picture.size_px != self.size_px) {
            return Err(RenderError::Film("a picture of the film has another size than the film".to_owned()));
        }
        self.given = u32::try_from(pictures.len()).map_or(u32::MAX, |more| self.given.saturating_add(more));
        self.encoder.add(pictures)
    }

    /// Writes the end of the film.
    ///
    /// # Errors
    /// [`RenderError`] when it has not as many pictures as it was made for, when the encoder fails, or when it cannot be
    /// written.
    pub fn finish(self) -> Result<(), RenderError> {
        let Self { wanted, given, .. } = self;
        if wanted != given {
            return Err(RenderError::Film(format!("the film was to have {wanted} pictures, not {given}")));
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
