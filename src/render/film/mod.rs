//! Films: pictures one after another, as MP4, GIF or animated PNG.

mod apng;
mod gif;
mod mp4;

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
}

/// A film in the making. It is held in memory, encoded.
pub struct Film {
    size_px: [u32; 2],
    encoder: Encoder,
}

enum Encoder {
    Mp4(Box<mp4::Mp4>),
    Gif(gif::Gif),
    Png(apng::Apng),
}

impl Film {
    /// An empty film of pictures of one size, so many a second.
    ///
    /// # Errors
    /// [`FilmError`] when the format does not allow the size or the rate.
    pub fn new(format: FilmFormat, size_px: [u32; 2], fps: u32) -> Result<Self, FilmError> {
        let (name, most) = match format {
            FilmFormat::Mp4 => (mp4::NAME, MOST_FPS),
            FilmFormat::Gif => (gif::NAME, gif::MOST_FPS),
            FilmFormat::Png => (apng::NAME, MOST_FPS),
        };
        if !(1..=most).contains(&fps) {
            return Err(FilmError::Rate { format: name, fps, most });
        }
        let encoder = match format {
            FilmFormat::Mp4 => Encoder::Mp4(Box::new(mp4::Mp4::new(size_px, fps)?)),
            FilmFormat::Gif => Encoder::Gif(gif::Gif::new(size_px, fps)?),
            FilmFormat::Png => Encoder::Png(apng::Apng::new(size_px, fps)),
        };
        Ok(Self { size_px, encoder })
    }

    /// Adds pictures in order. What can be done to each by itself is done side by side.
    ///
    /// # Errors
    /// [`FilmError`] when one has another size, or the encoder fails.
    pub fn add(&mut self, pictures: &[Picture]) -> Result<(), FilmError> {
        if pictures.iter().any(|picture| picture.size_px != self.size_px) {
            return Err(FilmError::Mixed);
        }
        match &mut self.encoder {
            Encoder::Mp4(film) => {
                let prepared: Vec<_> = pictures.par_iter().map(mp4::prepare).collect();
                prepared.iter().try_for_each(|picture| film.add(picture))
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

    /// The film's bytes.
    ///
    /// # Errors
    /// [`FilmError`] when it has no pictures, or the encoder fails.
    pub fn finish(self) -> Result<Vec<u8>, FilmError> {
        match self.encoder {
            Encoder::Mp4(film) => film.finish(),
            Encoder::Gif(film) => film.finish(),
            Encoder::Png(film) => film.finish(),
        }
    }
}

#[cfg(test)]
mod tests;
