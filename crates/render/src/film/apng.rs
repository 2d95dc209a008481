//! Animated PNG.

use std::io::Write;

use super::encoder::{self, FilmEncoder};
use crate::error::RenderError;
use crate::picture::{Picture, png_encoder};

pub(super) struct Apng<W: Write>(png::Writer<W>);

fn failed(error: png::EncodingError) -> RenderError {
    match error {
        png::EncodingError::IoError(error) => error.into(),
        error => encoder::failed("PNG", error),
    }
}

impl<W: Write> Apng<W> {
    pub(super) fn new(out: W, size_px: [u32; 2], fps: u32, pictures: u32) -> Result<Self, RenderError> {
        let mut encoder = png_encoder(out, size_px);
        // 0: the film is shown again and again.
        encoder.set_animated(pictures, 0).map_err(failed)?;
        encoder.set_frame_delay(1, u16::try_from(fps).unwrap_or(u16::MAX)).map_err(failed)?;
        encoder.write_header().map(Self).map_err(failed)
    }
}

impl<W: Write + Send> FilmEncoder for Apng<W> {
    fn add(&mut self, pictures: &[Picture]) -> Result<(), RenderError> {
        pictures.iter().try_for_each(|picture| self.0.write_image_data(&picture.rgb())).map_err(failed)
    }

    fn finish(self: Box<Self>) -> Result<(), RenderError> {
        self.0.finish().map_err(failed)
    }
}
