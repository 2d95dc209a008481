//! GIF encoder.

use std::io::Write;

use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};

use super::FilmEncoder;
use crate::error::RenderError;
use crate::picture::Picture;

/// Highest frame rate: browsers show a picture for at least two hundredths of a second.
pub(super) const MAX_FPS: u32 = 50;
/// Sampling factor of colours: 1 samples every pixel, 30 is the fastest. At 3 less than half as many pixels are off by
/// 16 units or more as at 10, in twice the time.
const SPEED: i32 = 3;

pub(super) struct Gif<W: Write> {
    encoder: gif::Encoder<W>,
    sides: [u16; 2],
    fps: u32,
    pictures: u32,
}

fn failed(error: gif::EncodingError) -> RenderError {
    match error {
        gif::EncodingError::Io(error) => error.into(),
        error => super::failed("GIF", error),
    }
}

impl<W: Write> Gif<W> {
    pub(super) fn new(out: W, size_px: [u32; 2], fps: u32) -> Result<Self, RenderError> {
        let sides = size_px.map(|side| u16::try_from(side).unwrap_or(u16::MAX));
        let mut encoder = gif::Encoder::new(out, sides[0], sides[1], &[]).map_err(failed)?;
        encoder.set_repeat(gif::Repeat::Infinite).map_err(failed)?;
        Ok(Self { encoder, sides, fps, pictures: 0 })
    }
}

impl<W: Write + Send> FilmEncoder for Gif<W> {
    fn add(&mut self, pictures: &[Picture]) -> Result<(), RenderError> {
        let [width, height] = self.sides;
        let chosen = pictures.par_iter().map(|picture| {
            let mut frame = gif::Frame::from_rgba_speed(width, height, &mut picture.rgba.clone(), SPEED);
            frame.make_lzw_pre_encoded();
            frame
        });
        for mut frame in chosen.collect::<Vec<_>>() {
            // Delays in hundredths of a second, rounded so that their sum is exact.
            let until = |pictures: u32| u64::from(pictures) * 100 / u64::from(self.fps);
            frame.delay = u16::try_from(until(self.pictures + 1) - until(self.pictures)).unwrap_or(u16::MAX);
            self.pictures += 1;
            self.encoder.write_lzw_pre_encoded_frame(&frame).map_err(failed)?;
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), RenderError> {
        self.encoder.into_inner().map(|_| ()).map_err(failed)
    }
}
