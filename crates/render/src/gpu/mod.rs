//! Rendering of scenes with wgpu, off-screen or in a window.
//!
//! A ball is a flat quad. Every pixel computes its point of the sphere, and every sample of a pixel its own edge. Balls
//! are round at any size and cost only the pixels that they cover. Pictures use four samples per pixel and blending in
//! linear light. The processor draws text and legends over the finished picture.
//!
//! The same scene gives the same bytes on the same adapter and driver.

mod adapter;
mod pipelines;

pub use adapter::{AdapterChoice, adapters};

use adapter::failed;
pub(crate) use adapter::lost;
#[cfg(feature = "window")]
pub(crate) use adapter::unusable;
pub(crate) use adapter::{Gpu, instance};

use super::error::RenderError;
use super::overlay::Overlay;
use super::picture::Picture;
use super::scene::{Extent, Scene, View};
use super::software::Software;
use super::timeline::Timeline;
use pipelines::Pipelines;

/// Renderer of scenes to pictures.
pub struct Renderer(Backend);

enum Backend {
    Gpu(Box<GpuRenderer>),
    Software(Box<Software>),
}

impl Renderer {
    /// Starts an adapter. Without any adapter, [`AdapterChoice::Best`] draws on the processor.
    ///
    /// # Errors
    /// [`RenderError`] if no adapter matches the choice.
    pub fn open(choice: &AdapterChoice) -> Result<Self, RenderError> {
        let software = || Self(Backend::Software(Box::default()));
        if *choice == AdapterChoice::None {
            return Ok(software());
        }
        match Gpu::open(&instance(None), choice, None) {
            Ok(gpu) => Ok(Self(Backend::Gpu(Box::new(GpuRenderer::on(gpu))))),
            Err(RenderError::NoAdapter) if *choice == AdapterChoice::Best => Ok(software()),
            Err(error) => Err(error),
        }
    }

    /// Returns name, device type and graphics API of the adapter.
    #[must_use]
    pub fn adapter(&self) -> &str {
        match &self.0 {
            Backend::Gpu(renderer) => &renderer.gpu.name,
            Backend::Software(_) => Software::NAME,
        }
    }

    /// Checks that pictures of this width and height \[pixels\] can be drawn.
    ///
    /// # Errors
    /// [`RenderError::PictureSize`] if a side is not between 1 and the adapter's maximum.
    pub fn check_size(&self, size_px: [u32; 2]) -> Result<(), RenderError> {
        match &self.0 {
            Backend::Gpu(renderer) => renderer.gpu.check_size(size_px),
            Backend::Software(_) => Software::check_size(size_px),
        }
    }

    /// Draws a scene into a picture.
    ///
    /// # Errors
    /// [`RenderError`] if the adapter cannot draw a picture of this size, or fails.
    pub fn paint(&mut self, scene: &Scene) -> Result<Picture, RenderError> {
        match &mut self.0 {
            Backend::Gpu(renderer) => renderer.paint(scene),
            Backend::Software(software) => software.paint(scene),
        }
    }

    /// Draws a flight at a time \[s\], which is clamped to its range.
    ///
    /// # Errors
    /// [`RenderError`] without samples, with an invalid camera, or if the adapter fails.
    pub fn shoot(&mut self, timeline: &Timeline, time_s: f64, view: &View) -> Result<Picture, RenderError> {
        let frame = timeline.log.at(time_s).ok_or_else(|| RenderError::Empty(timeline.name.clone()))?;
        let extent = Extent::of(timeline);
        let camera = extent.camera(timeline, &frame, view)?;
        self.paint(&Scene::compose(timeline, &extent, &frame, view, camera))
    }
}

/// Renderer of scenes with an adapter.
pub(crate) struct GpuRenderer {
    pub(crate) gpu: Gpu,
    pipelines: Pipelines,
    overlay: Overlay,
    target: Option<Target>,
}

impl GpuRenderer {
    pub(crate) fn on(gpu: Gpu) -> Self {
        let (pipelines, overlay) = (Pipelines::new(&gpu.device), Overlay::default());
        Self { gpu, pipelines, overlay, target: None }
    }

    pub(crate) fn paint(&mut self, scene: &Scene) -> Result<Picture, RenderError> {
        let gpu = self.gpu.clone();
        let mut picture = self.draw(scene)?.read(&gpu)?;
        self.overlay.draw(&scene.annotations, &mut picture);
        gpu.check()?;
        Ok(picture)
    }

    /// Draws a scene without its annotations into a texture.
    pub(crate) fn draw(&mut self, scene: &Scene) -> Result<&Target, RenderError> {
        let size_px = scene.camera.size_px;
        self.gpu.check_size(size_px)?;
        // A target of another size is freed first.
        self.target.take_if(|target| target.size_px != size_px);
        let target = match &mut self.target {
            Some(target) => target,
            none => none.insert(Target::new(&self.gpu, size_px)?),
        };
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.pipelines.draw(&self.gpu, &mut encoder, target, scene);
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu.check()?;
        Ok(target)
    }
}

/// Number of samples per pixel.
const SAMPLES: u32 = 4;
/// Texture format for blending in linear light.
const LIGHT_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;
/// Texture format of the same picture for the window.
const BYTES_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

/// Textures for pictures of one size.
pub(crate) struct Target {
    pub(super) size_px: [u32; 2],
    texture: wgpu::Texture,
    /// View for blending in linear light.
    pub(super) light_view: wgpu::TextureView,
    /// View of the bytes as they are.
    #[cfg(feature = "window")]
    pub(crate) bytes_view: wgpu::TextureView,
    pub(super) samples_view: wgpu::TextureView,
    pub(super) depth_view: wgpu::TextureView,
}

impl Target {
    fn new(gpu: &Gpu, size_px: [u32; 2]) -> Result<Self, RenderError> {
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
        let texture = make("picture", LIGHT_FORMAT, 1, usage, &[BYTES_FORMAT]);
        let samples = make("samples", LIGHT_FORMAT, SAMPLES, attachment, &[]);
        let depth = make("depth", DEPTH_FORMAT, SAMPLES, attachment, &[]);
        let view = |texture: &wgpu::Texture, format| {
            texture.create_view(&wgpu::TextureViewDescriptor { format, ..wgpu::TextureViewDescriptor::default() })
        };
        let target = Self {
            size_px,
            light_view: view(&texture, None),
            #[cfg(feature = "window")]
            bytes_view: view(&texture, Some(BYTES_FORMAT)),
            samples_view: view(&samples, None),
            depth_view: view(&depth, None),
            texture,
        };
        match pollster::block_on(scope.pop()) {
            Some(error) => Err(failed(error)),
            None => Ok(target),
        }
    }

    /// Reads the picture back after all submitted work.
    fn read(&self, gpu: &Gpu) -> Result<Picture, RenderError> {
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
            // The receiver may be gone.
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
