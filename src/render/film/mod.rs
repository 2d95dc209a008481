//! Films: pictures one after another, as MP4, GIF or animated PNG.

mod apng;
mod encoder;
mod gif;
mod mp4;

use std::io::Write;
use std::path::Path;

use super::error::RenderError;
use super::picture::Picture;
use encoder::FilmEncoder;

/// Most pictures a second that a film is made for.
const MOST_FPS: u32 = 240;

/// What a film is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FilmFormat {
    /// H.264 in MP4.
    Mp4,
    /// GIF: 256 colours a picture, at most 50 pictures a second.
    Gif,
    /// Animated PNG: every picture without loss.
    Png,
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
            Some("png") => Ok(Self::Png),
            _ => Err(RenderError::UnknownFilm(path.display().to_string())),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Mp4 => mp4::NAME,
            Self::Gif => gif::NAME,
            Self::Png => apng::NAME,
        }
    }

    /// Whether a film can have pictures of this size, so many a second.
    ///
    /// # Errors
    /// [`RenderError::FilmSize`] or [`RenderError::FilmRate`] when it cannot.
    pub fn check(self, size_px: [u32; 2], fps: u32) -> Result<(), RenderError> {
        let most = if self == Self::Gif { gif::MOST_FPS } else { MOST_FPS };
        if !(1..=most).contains(&fps) {
            return Err(RenderError::FilmRate { format: self.name(), fps, most });
        }
        match self {
            Self::Mp4 => mp4::check(size_px),
            Self::Gif => gif::sides(size_px).map(|_| ()),
            Self::Png => Ok(()),
        }
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
            return Err(RenderError::Encoder { format: format.name(), reason: "the film has no pictures".to_owned() });
        }
        let encoder: Box<dyn FilmEncoder + 'a> = match format {
            FilmFormat::Mp4 => Box::new(mp4::Mp4::new(out, size_px, fps)?),
            FilmFormat::Gif => Box::new(gif::Gif::new(out, size_px, fps)?),
            FilmFormat::Png => Box::new(apng::Apng::new(out, size_px, fps, pictures)?),
        };
        Ok(Self { size_px, wanted: pictures, given: 0, encoder })
    }

    /// Adds pictures in order. What can be done to each by itself is done side by side.
    ///
    /// # Errors
    /// [`RenderError`] when one has another size, when the encoder fails, or when it cannot be written.
    pub fn add(&mut self, pictures: &[Picture]) -> Result<(), RenderError> {
        if pictures.iter().any(|picture| picture.size_px != self.size_px) {
            return Err(RenderError::MixedSizes);
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
            return Err(RenderError::PictureCount { wanted, given });
        }
        self.encoder.finish()
    }
}

#[cfg(test)]
mod tests;
