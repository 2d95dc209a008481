//! Films: pictures one after another, as MP4, GIF or animated PNG.

mod apng;
mod gif;
mod mp4;

use std::io::{self, Write};
use std::path::Path;

use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};

use super::picture::{Picture, PictureError};

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

/// Why there is no film.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FilmError {
    /// The name of the file does not say which format it is to be.
    #[error("`{0}` does not end in .mp4, .gif or .png")]
    UnknownFormat(String),
    /// The format does not allow this number of pictures a second.
    #[error("{format} films have from 1 to {most} pictures a second, not {fps}")]
    Rate {
        /// The format.
        format: &'static str,
        /// Pictures a second.
        fps: u32,
        /// Most that it allows.
        most: u32,
    },
    /// The format does not allow pictures of this size.
    #[error("a {format} film cannot have pictures of {width} x {height} pixels: {why}")]
    Size {
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
    Mixed,
    /// There are more or fewer pictures than the film was made for.
    #[error("the film was to have {wanted} pictures, not {given}")]
    Count {
        /// Pictures that it was made for.
        wanted: u32,
        /// Pictures that were added.
        given: u32,
    },
    /// The film cannot be written.
    #[error("the film cannot be written: {0}")]
    Write(String),
    /// A picture cannot be encoded.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// The encoder failed.
    #[error("the {format} encoder failed: {reason}")]
    Encoder {
        /// The format.
        format: &'static str,
        /// What it said.
        reason: String,
    },
}

impl FilmFormat {
    /// The format that a file's name asks for.
    ///
    /// # Errors
    /// [`FilmError::UnknownFormat`] when it is none of those that can be made.
    pub fn of(path: &Path) -> Result<Self, FilmError> {
        let extension = path.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        match extension.as_deref() {
            Some("mp4") => Ok(Self::Mp4),
            Some("gif") => Ok(Self::Gif),
            Some("png") => Ok(Self::Png),
            _ => Err(FilmError::UnknownFormat(path.display().to_string())),
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
    /// [`FilmError::Size`] or [`FilmError::Rate`] when it cannot.
    pub fn check(self, size_px: [u32; 2], fps: u32) -> Result<(), FilmError> {
        let most = if self == Self::Gif { gif::MOST_FPS } else { MOST_FPS };
        if !(1..=most).contains(&fps) {
            return Err(FilmError::Rate { format: self.name(), fps, most });
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
pub struct Film<W: Write> {
    size_px: [u32; 2],
    wanted: u32,
    given: u32,
    encoder: Encoder<W>,
}

enum Encoder<W: Write> {
    Mp4(Box<mp4::Mp4<W>>),
    Gif(gif::Gif<W>),
    Png(apng::Apng<W>),
}

impl From<io::Error> for FilmError {
    fn from(error: io::Error) -> Self {
        Self::Write(error.to_string())
    }
}

impl<W: Write> Film<W> {
    /// The beginning of a film of so many pictures of one size, so many a second. It is written in small pieces: `out`
    /// should be buffered, and flushed at the end.
    ///
    /// # Errors
    /// [`FilmError`] when the format does not allow the size or the rate, when it has no pictures, or when it cannot be
    /// written.
    pub fn new(out: W, format: FilmFormat, size_px: [u32; 2], fps: u32, pictures: u32) -> Result<Self, FilmError> {
        format.check(size_px, fps)?;
        if pictures == 0 {
            return Err(FilmError::Encoder { format: format.name(), reason: "the film has no pictures".to_owned() });
        }
        let encoder = match format {
            FilmFormat::Mp4 => Encoder::Mp4(Box::new(mp4::Mp4::new(out, size_px, fps)?)),
            FilmFormat::Gif => Encoder::Gif(gif::Gif::new(out, size_px, fps)?),
            FilmFormat::Png => Encoder::Png(apng::Apng::new(out, size_px, fps, pictures)),
        };
        Ok(Self { size_px, wanted: pictures, given: 0, encoder })
    }

    /// Adds pictures in order. What can be done to each by itself is done side by side.
    ///
    /// # Errors
    /// [`FilmError`] when one has another size, when the encoder fails, or when it cannot be written.
    pub fn add(&mut self, pictures: &[Picture]) -> Result<(), FilmError> {
        if pictures.iter().any(|picture| picture.size_px != self.size_px) {
            return Err(FilmError::Mixed);
        }
        self.given = u32::try_from(pictures.len()).map_or(u32::MAX, |more| self.given.saturating_add(more));
        match &mut self.encoder {
            Encoder::Mp4(film) => {
                let prepared: Vec<_> = pictures.par_iter().map(mp4::prepare).collect();
                prepared.into_iter().try_for_each(|picture| film.add(picture))
            }
            Encoder::Gif(film) => {
                let prepared: Vec<_> = pictures.par_iter().map(gif::prepare).collect::<Result<_, _>>()?;
                prepared.into_iter().try_for_each(|picture| film.add(picture))
            }
            Encoder::Png(film) => {
                let prepared: Vec<_> = pictures.par_iter().map(Picture::to_png).collect::<Result<_, _>>()?;
                prepared.iter().try_for_each(|png| film.add(png))
            }
        }
    }

    /// Writes the end of the film.
    ///
    /// # Errors
    /// [`FilmError`] when it has not as many pictures as it was made for, when the encoder fails, or when it cannot be
    /// written.
    pub fn finish(self) -> Result<(), FilmError> {
        let Self { wanted, given, .. } = self;
        if wanted != given {
            return Err(FilmError::Count { wanted, given });
        }
        match self.encoder {
            Encoder::Mp4(film) => film.finish(),
            Encoder::Gif(film) => film.finish(),
            Encoder::Png(film) => film.finish(),
        }
    }
}

#[cfg(test)]
mod tests;
