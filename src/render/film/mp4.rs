//! H.264 in MP4.

use muxide::api::{Muxer, MuxerBuilder, VideoCodec};
use openh264::OpenH264API;
use openh264::encoder::{Encoder, EncoderConfig, FrameRate, FrameType, IntraFramePeriod, RateControlMode, VuiConfig};
use openh264::formats::{RgbaSliceU8, YUVBuffer};

use super::FilmError;
use crate::render::picture::Picture;

pub(super) const NAME: &str = "MP4";
/// Largest pictures that the encoder takes.
const LARGEST: [u32; 2] = [3840, 2160];
/// Pictures from one that stands by itself to the next, in seconds of film.
const KEY_EVERY_S: u32 = 4;

pub(super) struct Mp4 {
    encoder: Encoder,
    muxer: Muxer<Shared>,
    bytes: Shared,
    fps: u32,
    pictures: u32,
}

/// Where the container is written: kept on this side of the library too.
#[derive(Clone, Default)]
struct Shared(std::sync::Arc<std::sync::Mutex<Vec<u8>>>);

impl std::io::Write for Shared {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.lock().map_err(|_| std::io::Error::other("a writer failed before"))?.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

fn failed(error: &dyn std::fmt::Display) -> FilmError {
    FilmError::Encoder { format: NAME, reason: error.to_string() }
}

/// Brightness and colour of a picture.
pub(super) fn prepare(picture: &Picture) -> YUVBuffer {
    let size = picture.size_px.map(|side| side as usize);
    YUVBuffer::from_rgba8_source(RgbaSliceU8::new(&picture.rgba, (size[0], size[1])))
}

impl Mp4 {
    pub(super) fn new(size_px: [u32; 2], fps: u32) -> Result<Self, FilmError> {
        let [width, height] = size_px;
        let size = |why| Err(FilmError::Size { format: NAME, width, height, why });
        if width % 2 == 1 || height % 2 == 1 {
            return size("H.264 needs even sides");
        }
        if width.min(height) < 16 || width.max(height) > LARGEST[0] || width.min(height) > LARGEST[1] {
            return size("from 16 x 16 to 3840 x 2160");
        }
        let config = EncoderConfig::new()
            .max_frame_rate(FrameRate::from_hz(fps as f32))
            .intra_frame_period(IntraFramePeriod::from_num_frames(KEY_EVERY_S * fps))
            // The same quality for every picture: steps of brightness of 26, at which text stays sharp.
            .rate_control_mode(RateControlMode::Off)
            .skip_frames(false)
            // What the library makes of red, green and blue.
            .vui(VuiConfig::bt601());
        let encoder = Encoder::with_api_config(OpenH264API::from_source(), config).map_err(|error| failed(&error))?;
        let bytes = Shared::default();
        let muxer = MuxerBuilder::new(bytes.clone())
            .video(VideoCodec::H264, width, height, f64::from(fps))
            .build()
            .map_err(|error| failed(&error))?;
        Ok(Self { encoder, muxer, bytes, fps, pictures: 0 })
    }

    pub(super) fn add(&mut self, picture: &YUVBuffer) -> Result<(), FilmError> {
        let stream = self.encoder.encode(picture).map_err(|error| failed(&error))?;
        let is_key = matches!(stream.frame_type(), FrameType::IDR | FrameType::I);
        let time_s = f64::from(self.pictures) / f64::from(self.fps);
        self.pictures += 1;
        self.muxer.write_video(time_s, &stream.to_vec(), is_key).map_err(|error| failed(&error))
    }

    #[cfg(test)]
    pub(super) fn encoded(&mut self, picture: &YUVBuffer) -> Result<Vec<u8>, FilmError> {
        Ok(self.encoder.encode(picture).map_err(|error| failed(&error))?.to_vec())
    }

    pub(super) fn finish(self) -> Result<Vec<u8>, FilmError> {
        if self.pictures == 0 {
            return Err(failed(&"the film has no pictures"));
        }
        self.muxer.finish().map_err(|error| failed(&error))?;
        let mut bytes = self.bytes.0.lock().map_err(|error| failed(&error))?;
        Ok(std::mem::take(&mut bytes))
    }
}
