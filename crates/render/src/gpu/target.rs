//! What is drawn into, and how it is read back.

use super::adapter::{Gpu, failed, lost};
use crate::error::RenderError;
use crate::picture::Picture;

/// Samples of a pixel.
pub(super) const SAMPLES: u32 = 4;
/// Format of a picture while light is added up.
pub(super) const LIGHT_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;
/// Format of the same picture while words are laid over it.
pub(super) const WORDS_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
pub(super) const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Textures for pictures of one size.
pub(crate) struct Target {
    pub(super) size_px: [u32; 2],
    texture: wgpu::Texture,
    /// The picture as light.
    pub(super) light_view: wgpu::TextureView,
    /// The picture as bytes.
    pub(crate) words_view: wgpu::TextureView,
    pub(super) samples_view: wgpu::TextureView,
    pub(super) depth_view: wgpu::TextureView,
}

impl Target {
    pub(super) fn new(gpu: &Gpu, size_px: [u32; 2]) -> Result<Self, RenderError> {
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let make = |label, format, sample_count, usage, view_formats| {
            gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width: size_px[0], height: size_px[1], depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage,
                view_formats,
            })
        };
        let attachment = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let usage = attachment | wgpu::TextureUsages::COPY_SRC | wgpu::TextureUsages::TEXTURE_BINDING;
        let texture = make("picture", LIGHT_FORMAT, 1, usage, &[WORDS_FORMAT]);
        let samples = make("samples", LIGHT_FORMAT, SAMPLES, attachment, &[]);
        let depth = make("depth", DEPTH_FORMAT, SAMPLES, attachment, &[]);
        let view = |texture: &wgpu::Texture, format| {
            texture.create_view(&wgpu::TextureViewDescriptor { format, ..wgpu::TextureViewDescriptor::default() })
        };
        let target = Self {
            size_px,
            light_view: view(&texture, None),
            words_view: view(&texture, Some(WORDS_FORMAT)),
            samples_view: view(&samples, None),
            depth_view: view(&depth, None),
            texture,
        };
        match pollster::block_on(scope.pop()) {
            Some(error) => Err(failed(error)),
            None => Ok(target),
        }
    }

    /// The picture, once everything submitted is drawn.
    pub(super) fn read(&self, gpu: &Gpu) -> Result<Picture, RenderError> {
        let [width, height] = self.size_px;
        let row_bytes = width * 4;
        let padded_bytes = row_bytes.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read back"),
            size: u64::from(padded_bytes) * u64::from(height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_texture_to_buffer(
            self.texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(padded_bytes),
                    rows_per_image: None,
                },
            },
            wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        );
        gpu.queue.submit([encoder.finish()]);
        let (sender, receiver) = std::sync::mpsc::channel();
        buffer.map_async(wgpu::MapMode::Read, .., move |mapped| {
            // Whoever asked may have given up.
            let _ = sender.send(mapped);
        });
        gpu.device.poll(wgpu::PollType::wait_indefinitely()).map_err(failed)?;
        gpu.check()?;
        receiver.recv().map_err(|_| lost())?.map_err(failed)?;
        let mapped = buffer.get_mapped_range(..).map_err(failed)?;
        let mut rgba = Vec::with_capacity(row_bytes as usize * height as usize);
        for row in mapped.chunks_exact(padded_bytes as usize) {
            rgba.extend_from_slice(&row[..row_bytes as usize]);
        }
        Ok(Picture { size_px: self.size_px, rgba })
    }
}
