//! Draws scenes with wgpu, with or without a screen.
//!
//! Balls are flat pieces on which every pixel finds its own point of the sphere and every sample of a pixel its own
//! edge, so that they are round at any size and cost what they cover. Everything is multisampled four times and blended
//! as light; words and legends are laid over it by egui. A frame is uploaded once and drawn in two passes.
//!
//! The same scene gives the same bytes on the same adapter and driver.

mod adapter;
mod overlay;
mod pipelines;
mod target;

pub use adapter::AdapterChoice;

pub(crate) use adapter::{Gpu, instance};
#[cfg(feature = "window")]
pub(crate) use adapter::{lost, unusable};
#[cfg(feature = "window")]
pub(crate) use overlay::paint;

use super::error::RenderError;
use super::picture::Picture;
use super::scene::{Extent, Scene, View};
use super::timeline::Timeline;
use overlay::Overlay;
use pipelines::Pipelines;
use target::Target;

/// Draws scenes into pictures.
pub struct Renderer {
    pub(crate) gpu: Gpu,
    pipelines: Pipelines,
    overlay: Overlay,
    target: Option<Target>,
}

impl Renderer {
    /// Starts an adapter.
    ///
    /// # Errors
    /// [`RenderError`] when there is none of this choice.
    pub fn open(choice: &AdapterChoice) -> Result<Self, RenderError> {
        Ok(Self::on(Gpu::open(&instance(None), choice, None)?))
    }

    pub(crate) fn on(gpu: Gpu) -> Self {
        let (pipelines, overlay) = (Pipelines::new(&gpu.device), Overlay::new(&gpu.device));
        Self { gpu, pipelines, overlay, target: None }
    }

    /// Name of the adapter, what kind it is and how it is driven.
    #[must_use]
    pub fn adapter(&self) -> &str {
        &self.gpu.name
    }

    /// Whether pictures of this width and height \[pixels\] can be drawn.
    ///
    /// # Errors
    /// [`RenderError::PictureSize`] when a side is not between 1 and the most that the adapter draws.
    pub fn check_size(&self, size_px: [u32; 2]) -> Result<(), RenderError> {
        self.gpu.check_size(size_px)
    }

    /// The picture of a scene.
    ///
    /// # Errors
    /// [`RenderError`] when the adapter cannot draw a picture of this size, or fails.
    pub fn paint(&mut self, scene: &Scene) -> Result<Picture, RenderError> {
        let gpu = self.gpu.clone();
        let picture = self.draw(scene, true)?.read(&gpu)?;
        gpu.check()?;
        Ok(picture)
    }

    /// The picture of a flight at a time \[s\], which is brought into its range.
    ///
    /// # Errors
    /// [`RenderError`] when there is nothing to draw, the camera cannot be used or the adapter fails.
    pub fn shoot(&mut self, timeline: &Timeline, time_s: f64, view: &View) -> Result<Picture, RenderError> {
        let frame = timeline.log.at(time_s).ok_or_else(|| RenderError::Empty(timeline.name.clone()))?;
        let extent = Extent::of(timeline);
        let camera = extent.camera(timeline, &frame, view)?;
        self.paint(&Scene::compose(timeline, &extent, &frame, view, camera))
    }

    /// Draws a scene into a texture, with or without its annotations.
    pub(crate) fn draw(&mut self, scene: &Scene, with_annotations: bool) -> Result<&Target, RenderError> {
        let size_px = scene.camera.size_px;
        self.gpu.check_size(size_px)?;
        // One of another size makes room first.
        self.target.take_if(|target| target.size_px != size_px);
        let target = match &mut self.target {
            Some(target) => target,
            none => none.insert(Target::new(&self.gpu, size_px)?),
        };
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.pipelines.draw(&self.gpu, &mut encoder, target, scene);
        if with_annotations {
            self.overlay.draw(&self.gpu, &mut encoder, target, &scene.annotations);
        }
        self.gpu.queue.submit([encoder.finish()]);
        self.gpu.check()?;
        Ok(target)
    }
}
