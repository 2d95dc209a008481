//! GIF.

use std::io::Write;

use super::FilmError;
use crate::render::picture::Picture;

pub(super) const NAME: &str = "GIF";
/// Shortest that browsers show a picture: two hundredths of a second.
pub(super) const MOST_FPS: u32 = 50;
/// How coarsely the colours of a picture are looked at: 1 every pixel, 30 the fastest. At 3 less than half as many pixels
/// are off by 16 units or more as at 10, in twice the time.
const SPEED: i32 = 3;

pub(super) struct Gif<W: Write> {
    encoder: gif::Encoder<W>,
    fps: u32,
    pictures: u32,
}

/// Chooses the colours of a picture and compresses it.
pub(super) fn prepare(picture: &Picture) -> Result<gif::Frame<'static>, FilmError> {
    let [width, height] = sides(picture.size_px)?;
    let mut rgba = picture.rgba.clone();
    let mut frame = gif::Frame::from_rgba_speed(width, height, &mut rgba, SPEED);
    frame.make_lzw_pre_encoded();
    Ok(frame)
}

pub(super) fn sides(size_px: [u32; 2]) -> Result<[u16; 2], FilmError> {
    let [width, height] = size_px;
    match (u16::try_from(width), u16::try_from(height)) {
        (Ok(width @ 1..), Ok(height @ 1..)) => Ok([width, height]),
        _ => Err(FilmError::Size { format: NAME, width, height, why: "a side has from 1 to 65535" }),
    }
}

fn failed(error: gif::EncodingError) -> FilmError {
    match error {
        gif::EncodingError::Io(error) => error.into(),
        error => FilmError::Encoder { format: NAME, reason: error.to_string() },
    }
}

impl<W: Write> Gif<W> {
    pub(super) fn new(out: W, size_px: [u32; 2], fps: u32) -> Result<Self, FilmError> {
        let [width, height] = sides(size_px)?;
        let mut encoder = gif::Encoder::new(out, width, height, &[]).map_err(failed)?;
        encoder.set_repeat(gif::Repeat::Infinite).map_err(failed)?;
        Ok(Self { encoder, fps, pictures: 0 })
    }

    pub(super) fn add(&mut self, mut frame: gif::Frame<'static>) -> Result<(), FilmError> {
        // Hundredths of a second, rounded so that they add up to the right time.
        let until = |pictures: u32| u64::from(pictures) * 100 / u64::from(self.fps);
        frame.delay = u16::try_from(until(self.pictures + 1) - until(self.pictures)).unwrap_or(u16::MAX);
        self.pictures += 1;
        self.encoder.write_lzw_pre_encoded_frame(&frame).map_err(failed)
    }

    pub(super) fn finish(self) -> Result<(), FilmError> {
        self.encoder.into_inner().map(|_| ()).map_err(failed)
    }
}
