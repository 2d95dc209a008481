//! H.264 encoder with an MP4 muxer.

use std::io::Write;

use muxide::api::{Muxer, MuxerBuilder, MuxerError, VideoCodec};
use openh264::OpenH264API;
use openh264::encoder::{Encoder, EncoderConfig, FrameRate, FrameType, IntraFramePeriod, RateControlMode, VuiConfig};
use openh264::formats::{RgbaSliceU8, YUVBuffer};

use rayon::iter::{IntoParallelRefIterator as _, ParallelIterator as _};

use super::FilmEncoder;
use crate::error::RenderError;
use crate::picture::Picture;

/// Interval of key frames, in seconds of film.
const KEY_EVERY_S: u32 = 4;

pub(super) struct Mp4<W> {
    encoder: Encoder,
    muxer: Muxer<W>,
    fps: u32,
    pictures: u32,
    /// First picture, as long as it is the only one.
    only_picture: Option<YUVBuffer>,
}

fn failed(error: impl std::fmt::Display) -> RenderError {
    super::failed("MP4", error)
}

/// Converts a picture to brightness and colour.
pub(super) fn yuv(picture: &Picture) -> YUVBuffer {
    let size = picture.size_px.map(|side| side as usize);
    YUVBuffer::from_rgba8_source(RgbaSliceU8::new(&picture.rgba, (size[0], size[1])))
}

impl<W: Write> Mp4<W> {
    pub(super) fn new(out: W, [width, height]: [u32; 2], fps: u32) -> Result<Self, RenderError> {
        let config = EncoderConfig::new()
            .max_frame_rate(FrameRate::from_hz(fps as f32))
            .intra_frame_period(IntraFramePeriod::from_num_frames(KEY_EVERY_S * fps))
            // Constant quality: quantizer 26, at which text stays sharp.
            .rate_control_mode(RateControlMode::Off)
            .skip_frames(false)
            // Colour space of the library's conversion from RGB.
            .vui(VuiConfig::bt601());
        let encoder = Encoder::with_api_config(OpenH264API::from_source(), config).map_err(failed)?;
        let muxer = MuxerBuilder::new(out).video(VideoCodec::H264, width, height, f64::from(fps));
        let muxer = muxer.build().map_err(failed)?;
        Ok(Self { encoder, muxer, fps, pictures: 0, only_picture: None })
    }

    fn encode(&mut self, picture: &YUVBuffer, time_s: f64) -> Result<(), RenderError> {
        let stream = self.encoder.encode(picture).map_err(failed)?;
        let is_key = matches!(stream.frame_type(), FrameType::IDR | FrameType::I);
        self.muxer.write_video(time_s, &stream.to_vec(), is_key).map_err(failed)
    }

    #[cfg(test)]
    pub(super) fn encoded(&mut self, picture: &YUVBuffer) -> Result<Vec<u8>, RenderError> {
        Ok(self.encoder.encode(picture).map_err(failed)?.to_vec())
    }
}

impl<W: Write + Send> FilmEncoder for Mp4<W> {
    fn add(&mut self, pictures: &[Picture]) -> Result<(), RenderError> {
        for picture in pictures.par_iter().map(yuv).collect::<Vec<_>>() {
            self.encode(&picture, f64::from(self.pictures) / f64::from(self.fps))?;
            self.only_picture = (self.pictures == 0).then_some(picture);
            self.pictures += 1;
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<(), RenderError> {
        // The last picture lasts as long as the one before. A single picture is shown twice, for half the time each.
        if let Some(picture) = self.only_picture.take() {
            self.encode(&picture, 0.5 / f64::from(self.fps))?;
        }
        self.muxer.finish().map_err(|error| match error {
            MuxerError::Io(error) => error.into(),
            error => failed(error),
        })
    }
}
