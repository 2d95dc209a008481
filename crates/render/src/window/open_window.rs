//! Open window: surface, panels, and the picture between them.

use std::num::NonZeroU32;
use std::path::PathBuf;
use std::sync::Arc;

use egui::{TextureId, ViewportId};
use egui_wgpu::winit::Painter;
use egui_wgpu::{RenderState, RendererOptions, SurfaceConfig, WgpuConfiguration, WgpuSetupExisting};
use winit::dpi::LogicalSize;
use winit::event_loop::ActiveEventLoop;
use winit::window::Window;

use crate::error::RenderError;
use crate::gpu::{AdapterChoice, Gpu, GpuRenderer, instance, lost, unusable};
use crate::scene::{Extent, Scene};
use crate::timeline::Timeline;

/// Initial size of the window \[points\].
const INITIAL_SIZE: [f64; 2] = [1280.0, 800.0];
/// Smallest side of the picture \[pixels\].
const MIN_PX: u32 = 16;

/// Open window with its renderer.
pub(super) struct OpenWindow {
    painter: Painter,
    panels: RenderState,
    renderer: GpuRenderer,
    pub(super) input: egui_winit::State,
    pub(super) extent: Extent,
    /// Number of keyframes in the extent.
    known_keyframes: usize,
    /// Texture that shows the picture between the panels.
    pub(super) texture: TextureId,
    /// Size of the picture without panels \[pixels\].
    pub(super) picture_px: [u32; 2],
    pub(super) window: Arc<Window>,
}

impl OpenWindow {
    pub(super) fn new(
        events: &ActiveEventLoop,
        adapter: &AdapterChoice,
        timeline: &Timeline,
    ) -> Result<Self, RenderError> {
        let attributes = Window::default_attributes()
            .with_title(format!("tautline: {}", timeline.name))
            .with_inner_size(LogicalSize::new(INITIAL_SIZE[0], INITIAL_SIZE[1]));
        let window = events.create_window(attributes).map_err(|error| RenderError::NoWindow(error.to_string()))?;
        let window = Arc::new(window);
        let context = egui::Context::default();
        context.options_mut(|options| options.zoom_with_keyboard = false);
        let shown = Arc::clone(&window);
        context.set_request_repaint_callback(move |repaint| {
            if repaint.delay.is_zero() {
                shown.request_redraw();
            }
        });
        let (gpu, painter) = start(events, adapter, &window, &context)?;
        let panels = painter.render_state().ok_or_else(lost)?;
        #[expect(clippy::cast_possible_truncation, reason = "a factor of a few")]
        let scale = window.scale_factor() as f32;
        let side = Some(gpu.largest_px as usize);
        let input = egui_winit::State::new(context, ViewportId::ROOT, &window, Some(scale), None, side);
        let mut renderer = GpuRenderer::on(gpu);
        let picture_px = clamped_size(window.inner_size().into(), &renderer);
        let view = &renderer.draw(&Scene::blank(picture_px))?.bytes_view;
        let nearest = wgpu::FilterMode::Nearest;
        let texture = panels.renderer.write().register_native_texture(&panels.device, view, nearest);
        let (extent, known_keyframes) = (Extent::of(timeline), timeline.log.keyframes().len());
        window.request_redraw();
        Ok(Self { painter, panels, renderer, input, extent, known_keyframes, texture, picture_px, window })
    }

    pub(super) fn resize(&mut self, size_px: [u32; 2]) {
        let largest = self.renderer.gpu.largest_px;
        if let [Some(width), Some(height)] = size_px.map(|side| NonZeroU32::new(side.min(largest))) {
            self.painter.on_window_resized(ViewportId::ROOT, width, height);
        }
        self.window.request_redraw();
    }

    /// Recomputes the extent of a live flight when its number of keyframes has grown by a tenth.
    pub(super) fn update_extent(&mut self, timeline: &Timeline) {
        let now = timeline.log.keyframes().len();
        if now > self.known_keyframes + self.known_keyframes / 10 || now < self.known_keyframes {
            (self.extent, self.known_keyframes) = (Extent::of(timeline), now);
        }
    }

    /// Resizes the picture \[pixels\] if necessary.
    pub(super) fn fit_picture(&mut self, size_px: [u32; 2]) {
        let clamped_size = clamped_size(size_px, &self.renderer);
        if clamped_size != self.picture_px {
            self.picture_px = clamped_size;
            self.window.request_redraw();
        }
    }

    /// Draws the picture between the panels.
    pub(super) fn show_picture(&mut self, scene: &Scene) -> Result<(), RenderError> {
        let view = &self.renderer.draw(scene)?.bytes_view;
        let mut panels = self.panels.renderer.write();
        let nearest = wgpu::FilterMode::Nearest;
        panels.update_egui_texture_from_wgpu_texture(&self.panels.device, view, nearest, self.texture);
        Ok(())
    }

    /// Saves the picture as PNG; returns a message.
    pub(super) fn write_picture(&mut self, scene: &Scene, name: &str, time_s: f64) -> String {
        let path = PathBuf::from(format!("{name}-{time_s:.3}s.png"));
        let png = self.renderer.paint(scene).and_then(|picture| picture.to_png()).map_err(|error| error.to_string());
        match png.and_then(|png| std::fs::write(&path, png).map_err(|error| error.to_string())) {
            Ok(()) => format!("wrote {}", path.display()),
            Err(error) => format!("cannot write {}: {error}", path.display()),
        }
    }

    /// Draws the panels on the window.
    pub(super) fn present(&mut self, mut output: egui::FullOutput) -> Result<(), RenderError> {
        self.input.handle_platform_output(&self.window, std::mem::take(&mut output.platform_output));
        let scale = output.pixels_per_point;
        let primitives = self.input.egui_ctx().tessellate(std::mem::take(&mut output.shapes), scale);
        let (black, textures) = ([0.0, 0.0, 0.0, 1.0], &mut output.textures_delta);
        self.painter.paint_and_update_textures(
            ViewportId::ROOT,
            scale,
            black,
            &primitives,
            textures,
            Vec::new(),
            &self.window,
        );
        output.textures_delta.clear();
        self.renderer.gpu.check()
    }
}

/// Starts an adapter that can draw on a window, and the painter of the panels.
fn start(
    events: &ActiveEventLoop,
    adapter: &AdapterChoice,
    window: &Arc<Window>,
    context: &egui::Context,
) -> Result<(Gpu, Painter), RenderError> {
    let instance = instance(Some(Box::new(events.owned_display_handle())));
    // Without a driver the instance cannot create a surface.
    let probe = instance.create_surface(Arc::clone(window)).map_err(|_| RenderError::NoAdapter)?;
    let gpu = Gpu::open(&instance, adapter, Some(&probe))?;
    drop(probe);
    let (adapter, device, queue) = (gpu.adapter.clone(), gpu.device.clone(), gpu.queue.clone());
    let wgpu_setup = WgpuSetupExisting { instance, adapter, device, queue }.into();
    // Pictures are presented in order: a mode that drops late ones can leave an older picture on the window.
    let surface = SurfaceConfig { present_mode: wgpu::PresentMode::Fifo, ..SurfaceConfig::HIGH_THROUGHPUT };
    let configuration = WgpuConfiguration { wgpu_setup, surface, ..WgpuConfiguration::default() };
    let options = RendererOptions::default();
    let mut painter = pollster::block_on(Painter::new(context.clone(), configuration, false, options));
    pollster::block_on(painter.set_window(ViewportId::ROOT, Some(Arc::clone(window))))
        .map_err(|error| unusable(&gpu.name, error))?;
    Ok((gpu, painter))
}

fn clamped_size(size_px: [u32; 2], renderer: &GpuRenderer) -> [u32; 2] {
    size_px.map(|side| side.clamp(MIN_PX, renderer.gpu.largest_px))
}
