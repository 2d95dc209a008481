//! The window: a flight played, scrubbed, turned around and looked into, live or from a recording.

mod panels;
mod player;

pub use player::Fed;

use std::cell::Cell;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use winit::application::ApplicationHandler;
use winit::dpi::LogicalSize;
use winit::error::EventLoopError;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::window::{Window, WindowId};

use super::gpu::{AdapterChoice, BACKENDS, Gpu, GpuError, Renderer};
use super::scene::{Camera, Scene, Stage, View};
use super::{Footage, Theme};
use panels::{Desk, Shown, Wishes};
use player::Player;

/// Size of the window at first \[points\].
const FIRST_SIZE: [f64; 2] = [1280.0, 800.0];
/// Longest time between two pictures that is played \[s\]: a window that was hidden does not jump.
const LONGEST_PASS_S: f64 = 0.1;
/// How long the window sleeps while it waits for a flight in the air.
const LIVE_SLEEP: Duration = Duration::from_millis(30);
/// Formats that egui blends right, the better ones first.
const SURFACE_FORMATS: [wgpu::TextureFormat; 2] = [wgpu::TextureFormat::Bgra8Unorm, wgpu::TextureFormat::Rgba8Unorm];

/// Why there is no window.
#[derive(Clone, Debug, thiserror::Error)]
pub enum WindowError {
    /// There is no screen to open it on.
    #[error("there is no display to open a window on: {0}")]
    NoDisplay(String),
    /// The window system refused.
    #[error("the window cannot be opened: {0}")]
    Refused(String),
    /// It cannot be drawn.
    #[error(transparent)]
    Gpu(#[from] GpuError),
}

thread_local! {
    /// Whether the library of windows runs on this thread, and not what it calls.
    static IN_LIBRARY: Cell<bool> = const { Cell::new(false) };
}

/// Whether this thread is in the library of windows, whose panics mean that the display went away: it has no other
/// words for it.
#[must_use]
pub fn in_window_library() -> bool {
    IN_LIBRARY.get()
}

/// Says whose code runs until it is dropped.
struct Running {
    before: bool,
}

impl Running {
    fn library(in_library: bool) -> Self {
        Self { before: IN_LIBRARY.replace(in_library) }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        IN_LIBRARY.set(self.before);
    }
}

/// Opens a window on a flight and stays until it is closed.
///
/// `feed` brings samples of a flight that is still in the air. Pictures that the person asks for are written into the
/// working folder.
///
/// # Errors
/// [`WindowError`] when there is no display, or nothing that can draw on it.
pub fn show(
    footage: Footage,
    feed: Option<Receiver<Fed>>,
    theme: Theme,
    adapter: AdapterChoice,
) -> Result<(), WindowError> {
    let _library = Running::library(true);
    let events = EventLoop::new().map_err(|error| WindowError::NoDisplay(reason(&error)))?;
    let mut shell = Shell {
        adapter,
        player: Player::new(footage, feed),
        desk: Desk::new(theme),
        open: None,
        passed: Instant::now(),
        failure: None,
    };
    events.run_app(&mut shell).map_err(|error| WindowError::Refused(error.to_string()))?;
    shell.failure.map_or(Ok(()), Err)
}

/// What the window system said, without the place in a library that noticed it.
fn reason(error: &EventLoopError) -> String {
    let text = error.to_string();
    match text.strip_prefix("os error at ").and_then(|placed| placed.split_once(": ")) {
        Some((_, reason)) => reason.to_owned(),
        None => text,
    }
}

/// The program between the window system and what is drawn.
struct Shell {
    adapter: AdapterChoice,
    player: Player,
    desk: Desk,
    open: Option<Open>,
    passed: Instant,
    failure: Option<WindowError>,
}

/// A window that is open.
struct Open {
    surface: wgpu::Surface<'static>,
    configuration: wgpu::SurfaceConfiguration,
    renderer: Renderer,
    panels: egui_wgpu::Renderer,
    input: egui_winit::State,
    stage: Stage,
    /// How many instants the stage knows.
    staged: usize,
    texture: egui::TextureId,
    /// Size of the picture, without the panels \[pixels\].
    picture_px: [u32; 2],
    window: Arc<Window>,
}

impl ApplicationHandler for Shell {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        let _ours = Running::library(false);
        if self.open.is_none() {
            match self.open_window(events) {
                Ok(open) => self.open = Some(open),
                Err(error) => self.fail(events, error),
            }
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let _ours = Running::library(false);
        let Some(open) = &mut self.open else { return };
        let response = open.input.on_window_event(&open.window, &event);
        match event {
            WindowEvent::CloseRequested => return events.exit(),
            WindowEvent::Resized(size) => open.resize([size.width, size.height]),
            WindowEvent::RedrawRequested => {
                match self.draw() {
                    Ok(wishes) if wishes.quit => events.exit(),
                    Ok(_) => {}
                    Err(error) => self.fail(events, error.into()),
                }
                return;
            }
            _ => {}
        }
        if response.repaint {
            open.window.request_redraw();
        }
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        let _ours = Running::library(false);
        let Some(open) = &self.open else { return };
        let came = self.player.receive();
        if self.player.playing || came {
            open.window.request_redraw();
        }
        events.set_control_flow(if self.player.is_live() {
            ControlFlow::WaitUntil(Instant::now() + LIVE_SLEEP)
        } else {
            ControlFlow::Wait
        });
    }
}

impl Shell {
    fn fail(&mut self, events: &ActiveEventLoop, error: WindowError) {
        self.failure = Some(error);
        events.exit();
    }

    fn open_window(&self, events: &ActiveEventLoop) -> Result<Open, WindowError> {
        let attributes = Window::default_attributes()
            .with_title(format!("tautline: {}", self.player.footage.name))
            .with_inner_size(LogicalSize::new(FIRST_SIZE[0], FIRST_SIZE[1]));
        let refused = |error: &dyn std::fmt::Display| WindowError::Refused(error.to_string());
        let window = Arc::new(events.create_window(attributes).map_err(|error| refused(&error))?);
        let display = Box::new(events.owned_display_handle());
        let mut descriptor = wgpu::InstanceDescriptor::new_with_display_handle(display);
        descriptor.backends = BACKENDS;
        let instance = wgpu::Instance::new(descriptor);
        // Without any driver the instance has nothing to make a surface with.
        let surface = instance.create_surface(Arc::clone(&window)).map_err(|_| GpuError::NoAdapter)?;
        let (gpu, capabilities) = Gpu::open_for(&instance, &surface, &self.adapter)?;
        Open::new(window, surface, gpu, &capabilities, &self.player)
    }

    /// Draws the picture, then the panels around it, in the order that what the person does is seen at once.
    fn draw(&mut self) -> Result<Wishes, GpuError> {
        let Some(open) = &mut self.open else { return Ok(Wishes::default()) };
        let now = Instant::now();
        let passed_s = (now - self.passed).as_secs_f64().min(LONGEST_PASS_S);
        self.passed = now;
        self.player.receive();
        self.player.pass(passed_s);
        open.restage(&self.player.footage);
        if self.desk.framed {
            self.desk.frame(&open.stage, open.picture_px);
        }
        let view =
            View { theme: self.desk.theme, size_px: open.picture_px, layers: self.desk.layers, ..View::default() };
        let moment = self.player.footage.at(self.player.time_s);
        let scene = moment.as_ref().map(|moment| {
            let camera = Camera::orbiting(self.desk.orbit, self.desk.target_m, view.size_px);
            Scene::seen_by(camera, &self.player.footage, &open.stage, moment, &view)
        });
        if let Some(scene) = &scene {
            open.show_picture(scene)?;
        }
        let context = open.input.egui_ctx().clone();
        context.set_theme(if self.desk.theme == Theme::Dark { egui::Theme::Dark } else { egui::Theme::Light });
        let input = open.input.take_egui_input(&open.window);
        let mut wishes = Wishes::default();
        let mut area = egui::Rect::NOTHING;
        let (desk, player) = (&mut self.desk, &mut self.player);
        let shown = Shown {
            texture: open.texture,
            marks: scene.as_ref().map_or(&[], |scene| &scene.marks),
            camera: scene.as_ref().map(|scene| scene.camera),
            moment: moment.as_ref(),
            origin_m: open.stage.origin_m(),
        };
        let output = context.run_ui(input, |ui| {
            wishes = desk.keys(ui.ctx(), player);
            area = desk.show(ui, player, &shown);
        });
        if wishes.picture
            && let Some(scene) = &scene
        {
            self.desk.message = Some(open.write_picture(scene, &self.player.footage.name, self.player.time_s));
        }
        let points = context.pixels_per_point();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the cast saturates")]
        let wanted = [area.width(), area.height()].map(|side| (side * points).round() as u32);
        let fitting = wanted.map(|side| side.clamp(16, open.renderer.largest_px()));
        // What the panels leave is known now: the next picture fits.
        if fitting != open.picture_px {
            open.picture_px = fitting;
            open.window.request_redraw();
        }
        open.present(&context, output)?;
        Ok(wishes)
    }
}

impl Open {
    fn new(
        window: Arc<Window>,
        surface: wgpu::Surface<'static>,
        gpu: Gpu,
        capabilities: &wgpu::SurfaceCapabilities,
        player: &Player,
    ) -> Result<Self, WindowError> {
        let size = window.inner_size();
        let unusable =
            || GpuError::Unusable { adapter: gpu.name.clone(), reason: "it cannot draw on windows".to_owned() };
        let mut configuration = surface_configuration(capabilities).ok_or_else(unusable)?;
        [configuration.width, configuration.height] =
            [size.width, size.height].map(|side| side.clamp(1, gpu.largest_px));
        surface.configure(&gpu.device, &configuration);
        let options = egui_wgpu::RendererOptions::default();
        let mut panels = egui_wgpu::Renderer::new(&gpu.device, configuration.format, options);
        let context = egui::Context::default();
        context.options_mut(|options| options.zoom_with_keyboard = false);
        let side = gpu.largest_px as usize;
        let scale = window.scale_factor();
        #[expect(clippy::cast_possible_truncation, reason = "a factor of a few")]
        let input =
            egui_winit::State::new(context, egui::ViewportId::ROOT, &window, Some(scale as f32), None, Some(side));
        let mut renderer = Renderer::on(gpu);
        let picture_px = [configuration.width.max(16), configuration.height.max(16)];
        let stage = Stage::of(&player.footage);
        let blank = Scene::blank(picture_px);
        let view = renderer.draw(&blank, false)?.clone();
        let texture = panels.register_native_texture(&renderer.gpu().device, &view, wgpu::FilterMode::Nearest);
        let staged = player.footage.instants();
        window.request_redraw();
        Ok(Self { surface, configuration, renderer, panels, input, stage, staged, texture, picture_px, window })
    }

    fn resize(&mut self, size_px: [u32; 2]) {
        let gpu = self.renderer.gpu();
        [self.configuration.width, self.configuration.height] = size_px.map(|side| side.clamp(1, gpu.largest_px));
        self.surface.configure(&gpu.device, &self.configuration);
        self.window.request_redraw();
    }

    /// Looks again at how far a flight in the air reaches, when it has grown by a tenth.
    fn restage(&mut self, footage: &Footage) {
        let known = footage.instants();
        if known > self.staged + self.staged / 10 || known < self.staged {
            self.stage = Stage::of(footage);
            self.staged = known;
        }
    }

    fn show_picture(&mut self, scene: &Scene) -> Result<(), GpuError> {
        let view = self.renderer.draw(scene, false)?.clone();
        let device = &self.renderer.gpu().device;
        let nearest = wgpu::FilterMode::Nearest;
        self.panels.update_egui_texture_from_wgpu_texture(device, &view, nearest, self.texture);
        Ok(())
    }

    /// Writes the picture as PNG; gives a sentence about it.
    fn write_picture(&mut self, scene: &Scene, name: &str, time_s: f64) -> String {
        let path = PathBuf::from(format!("{name}-{time_s:.3}s.png"));
        let written = self.renderer.paint(scene).map_err(|error| error.to_string()).and_then(|picture| {
            let png = picture.to_png().map_err(|error| error.to_string())?;
            std::fs::write(&path, png).map_err(|error| error.to_string())
        });
        match written {
            Ok(()) => format!("wrote {}", path.display()),
            Err(error) => format!("cannot write {}: {error}", path.display()),
        }
    }

    /// Puts the panels on the window.
    fn present(&mut self, context: &egui::Context, mut output: egui::FullOutput) -> Result<(), GpuError> {
        let soon = output.viewport_output.values().any(|viewport| viewport.repaint_delay.is_zero());
        if soon {
            self.window.request_redraw();
        }
        self.input.handle_platform_output(&self.window, std::mem::take(&mut output.platform_output));
        let primitives = context.tessellate(std::mem::take(&mut output.shapes), output.pixels_per_point);
        let gpu = self.renderer.gpu();
        for (id, deltas) in &output.textures_delta.set {
            for delta in deltas {
                self.panels.update_texture(&gpu.device, &gpu.queue, *id, delta);
            }
        }
        let frame = match self.surface.get_current_texture() {
            wgpu::CurrentSurfaceTexture::Success(frame) | wgpu::CurrentSurfaceTexture::Suboptimal(frame) => Some(frame),
            wgpu::CurrentSurfaceTexture::Outdated | wgpu::CurrentSurfaceTexture::Lost => {
                self.surface.configure(&gpu.device, &self.configuration);
                self.window.request_redraw();
                None
            }
            _ => None,
        };
        if let Some(frame) = frame {
            let view = frame.texture.create_view(&wgpu::TextureViewDescriptor::default());
            let screen = egui_wgpu::ScreenDescriptor {
                size_in_pixels: [self.configuration.width, self.configuration.height],
                pixels_per_point: output.pixels_per_point,
            };
            let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
            self.panels.update_buffers(&gpu.device, &gpu.queue, &mut encoder, &primitives, &screen);
            let mut pass = encoder
                .begin_render_pass(&wgpu::RenderPassDescriptor {
                    label: Some("window"),
                    color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                        view: &view,
                        depth_slice: None,
                        resolve_target: None,
                        ops: wgpu::Operations {
                            load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                            store: wgpu::StoreOp::Store,
                        },
                    })],
                    ..wgpu::RenderPassDescriptor::default()
                })
                .forget_lifetime();
            self.panels.render(&mut pass, &primitives, &screen);
            drop(pass);
            gpu.queue.submit([encoder.finish()]);
            self.window.pre_present_notify();
            gpu.queue.present(frame);
        }
        for id in &output.textures_delta.free {
            self.panels.free_texture(id);
        }
        output.textures_delta.clear();
        gpu.check()
    }
}

fn surface_configuration(capabilities: &wgpu::SurfaceCapabilities) -> Option<wgpu::SurfaceConfiguration> {
    let known = SURFACE_FORMATS.into_iter().find(|format| capabilities.formats.contains(format));
    let format = known.or_else(|| capabilities.formats.first().copied())?;
    Some(wgpu::SurfaceConfiguration {
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
        format,
        color_space: wgpu::SurfaceColorSpace::default(),
        width: 1,
        height: 1,
        present_mode: wgpu::PresentMode::Fifo,
        desired_maximum_frame_latency: 2,
        alpha_mode: wgpu::CompositeAlphaMode::Auto,
        view_formats: Vec::new(),
    })
}
