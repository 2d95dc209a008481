//! GIF encoder.

use std::io::Write;

use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};

use super::FilmEncoder;
use crate::error::RenderError;
use crate::picture::Picture;

/// Highest frame rate: browsers show a picture for at least two hundredths of a second.
pub(super) const MAX_FPS: u32 = 50;
/// Sampling factor of colours: 1 samples every pixel, 30 is the fastest. At 3 less than half as many pixels are off by
/// 16 units or more as at 10, in twice the time.
const SPEED: i32 = 3;
/// Largest change of a colour that is not written.
const SAME: u8 = 4;

pub(super) struct Gif<W: Write> {
    encoder: gif::Encoder<W>,
    fps: u32,
    pictures: u32,
    /// Bytes of the picture that is shown; empty before the first one.
    shown: Vec<u8>,
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
        Ok(Self { encoder, fps, pictures: 0, shown: Vec::new() })
    }
}

/// Rectangle of a picture whose pixels have straight opacity; unchanged ones are transparent.
struct Patch {
    corner: [usize; 2],
    sides: [usize; 2],
    rgba: Vec<u8>,
}

impl Patch {
    /// Returns the rectangle of changed pixels and copies it into `shown`. Changes of at most [`SAME`] are left out.
    fn take(picture: &Picture, shown: &mut Vec<u8>) -> Self {
        let [width, height] = picture.size_px.map(|side| side as usize);
        if shown.is_empty() {
            shown.clone_from(&picture.rgba);
            return Self { corner: [0, 0], sides: [width, height], rgba: picture.rgba.clone() };
        }
        let is_changed = |new: &[u8], old: &[u8]| new.iter().zip(old).any(|(new, old)| new.abs_diff(*old) > SAME);
        let pixels = picture.rgba.chunks_exact(4).zip(shown.chunks_exact(4)).enumerate();
        let changed = pixels.filter(|(_, (new, old))| is_changed(new, old)).map(|(k, _)| [k % width, k / width]);
        let bounds = changed.fold(None, |bounds: Option<[[usize; 2]; 2]>, [x, y]| {
            let [low, high] = bounds.unwrap_or([[x, y]; 2]);
            Some([[low[0].min(x), low[1].min(y)], [high[0].max(x), high[1].max(y)]])
        });
        // A picture without changes has one pixel.
        let [low, high] = bounds.unwrap_or_default();
        let mut rgba = Vec::new();
        for y in low[1]..=high[1] {
            for index in (low[0]..=high[0]).map(|x| 4 * (y * width + x)) {
                let (new, old) = (&picture.rgba[index..index + 4], &mut shown[index..index + 4]);
                if is_changed(new, old) {
                    old.copy_from_slice(new);
                    rgba.extend_from_slice(new);
                } else {
                    rgba.extend_from_slice(&[0; 4]);
                }
            }
        }
        Self { corner: low, sides: [0, 1].map(|axis| high[axis] - low[axis] + 1), rgba }
    }

    /// Chooses colours and compresses the patch.
    fn encode(mut self) -> gif::Frame<'static> {
        let side = |length: usize| u16::try_from(length).unwrap_or(u16::MAX);
        let [width, height] = self.sides.map(side);
        let mut frame = gif::Frame::from_rgba_speed(width, height, &mut self.rgba, SPEED);
        (frame.left, frame.top, frame.dispose) =
            (side(self.corner[0]), side(self.corner[1]), gif::DisposalMethod::Keep);
        frame.make_lzw_pre_encoded();
        frame
    }
}

impl<W: Write + Send> FilmEncoder for Gif<W> {
    fn add(&mut self, pictures: &[Picture]) -> Result<(), RenderError> {
        let patches: Vec<_> = pictures.iter().map(|picture| Patch::take(picture, &mut self.shown)).collect();
        for mut frame in patches.into_par_iter().map(Patch::encode).collect::<Vec<_>>() {
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
