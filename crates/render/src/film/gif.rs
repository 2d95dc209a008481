//! GIF encoder.

use std::io::Write;

use rayon::iter::{IndexedParallelIterator as _, IntoParallelRefIterator as _, ParallelIterator as _};

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
    fps: u32,
    pictures: u32,
    /// Last picture.
    last: Option<Picture>,
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
        Ok(Self { encoder, fps, pictures: 0, last: None })
    }
}

/// Encodes a picture, or only the pixels that differ from the picture before.
fn encode(picture: &Picture, before: Option<&Picture>) -> gif::Frame<'static> {
    let Some(before) = before else {
        let [width, height] = picture.size_px.map(|side| u16::try_from(side).unwrap_or(u16::MAX));
        let mut frame = gif::Frame::from_rgba_speed(width, height, &mut picture.rgba.clone(), SPEED);
        frame.make_lzw_pre_encoded();
        return frame;
    };
    let width = picture.size_px[0] as usize;
    let pixels = || picture.rgba.chunks_exact(4).zip(before.rgba.chunks_exact(4)).enumerate();
    let changed = pixels().filter(|(_, (new, old))| new != old).map(|(k, _)| [k % width, k / width]);
    // A picture without changes has one pixel.
    let [low, high] = changed
        .fold(None, |bounds: Option<[[usize; 2]; 2]>, [x, y]| {
            let [low, high] = bounds.unwrap_or([[x, y]; 2]);
            Some([[low[0].min(x), low[1].min(y)], [high[0].max(x), high[1].max(y)]])
        })
        .unwrap_or_default();
    let is_inside = |k: usize| {
        let (x, y) = (k % width, k / width);
        (low[0]..=high[0]).contains(&x) && (low[1]..=high[1]).contains(&y)
    };
    let mut rgba: Vec<u8> = pixels()
        .filter(|(k, _)| is_inside(*k))
        .flat_map(|(_, (new, old))| if new == old { [0; 4] } else { [new[0], new[1], new[2], u8::MAX] })
        .collect();
    let side = |length: usize| u16::try_from(length).unwrap_or(u16::MAX);
    let sides = [0, 1].map(|axis| side(high[axis] - low[axis] + 1));
    let mut frame = gif::Frame::from_rgba_speed(sides[0], sides[1], &mut rgba, SPEED);
    (frame.left, frame.top, frame.dispose) = (side(low[0]), side(low[1]), gif::DisposalMethod::Keep);
    frame.make_lzw_pre_encoded();
    frame
}

impl<W: Write + Send> FilmEncoder for Gif<W> {
    fn add(&mut self, pictures: &[Picture]) -> Result<(), RenderError> {
        let before = self.last.iter().chain(pictures).map(Some);
        let before: Vec<_> = self.last.is_none().then_some(None).into_iter().chain(before).collect();
        let frames = pictures.par_iter().zip(before).map(|(picture, before)| encode(picture, before));
        for mut frame in frames.collect::<Vec<_>>() {
            // Delays in hundredths of a second, rounded so that their sum is exact.
            let until = |pictures: u32| u64::from(pictures) * 100 / u64::from(self.fps);
            frame.delay = u16::try_from(until(self.pictures + 1) - until(self.pictures)).unwrap_or(u16::MAX);
            self.pictures += 1;
            self.encoder.write_lzw_pre_encoded_frame(&frame).map_err(failed)?;
        }
        self.last = pictures.last().cloned().or_else(|| self.last.take());
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), RenderError> {
        self.encoder.into_inner().map(|_| ()).map_err(failed)
    }
}
