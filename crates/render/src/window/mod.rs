//! Interactive window: plays a flight, live or from a recording, with camera, timeline and panels.

mod open_window;
mod panels;
mod player;
mod state;

use std::cell::Cell;
use std::sync::mpsc::Receiver;
use std::time::{Duration, Instant};

use winit::application::ApplicationHandler;
use winit::error::EventLoopError;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::window::WindowId;

use crate::error::RenderError;
use crate::gpu::AdapterChoice;
use crate::scene::{Scene, Theme};
use crate::timeline::Timeline;
use open_window::OpenWindow;
use panels::Viewport;
pub use player::LiveUpdate;
use player::Player;
pub use state::WINDOW_KEYS;
use state::WindowState;
use tautline_report::flight_log::Frame;

/// Longest time between two pictures that is played \[s\], so that a window that was hidden does not jump.
const LONGEST_PAUSE_S: f64 = 0.1;
/// Interval at which the window checks a live flight for updates.
const LIVE_SLEEP: Duration = Duration::from_millis(30);

/// Opens a window on a flight and returns when it is closed.
///
/// `live` delivers samples of a flight in progress. Saved pictures are written to the working folder.
///
/// # Errors
/// [`RenderError`] without a display, or without an adapter that can draw on it.
pub fn show(
    timeline: Timeline,
    live: Option<Receiver<LiveUpdate>>,
    theme: Theme,
    adapter: AdapterChoice,
) -> Result<(), RenderError> {
    in_library(|| {
        let events = EventLoop::new().map_err(|error| RenderError::NoDisplay(reason(&error)))?;
        let state = WindowState::new(theme, &timeline);
        let player = Player::new(timeline, live);
        let mut app = App { adapter, player, state, open: None, drawn: Instant::now(), failure: None };
        events.run_app(&mut app).map_err(|error| RenderError::NoWindow(error.to_string()))?;
        app.failure.map_or(Ok(()), Err)
    })
}

/// Returns the message of the window system without its source location.
fn reason(error: &EventLoopError) -> String {
    let text = error.to_string();
    match text.strip_prefix("os error at ").and_then(|placed| placed.split_once(": ")) {
        Some((_, reason)) => reason.to_owned(),
        None => text,
    }
}

struct App {
    adapter: AdapterChoice,
    player: Player,
    state: WindowState,
    open: Option<OpenWindow>,
    /// Time of the last picture.
    drawn: Instant,
    failure: Option<RenderError>,
}

impl ApplicationHandler for App {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.open.is_none() {
            match OpenWindow::new(events, &self.adapter, &self.player.timeline) {
                Ok(open) => self.open = Some(open),
                Err(error) => self.fail(events, error),
            }
        }
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(open) = &mut self.open else { return };
        let response = open.input.on_window_event(&open.window, &event);
        match event {
            WindowEvent::CloseRequested => return events.exit(),
            WindowEvent::Resized(size) => open.resize(size.into()),
            WindowEvent::RedrawRequested => {
                if let Err(error) = self.draw() {
                    self.fail(events, error);
                } else if self.state.is_closing {
                    events.exit();
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
        let Some(open) = &self.open else { return };
        let received = out_of_library(|| self.player.receive());
        if self.player.playing || received {
            open.window.request_redraw();
        }
        events.set_control_flow(if self.player.is_live() {
            ControlFlow::WaitUntil(Instant::now() + LIVE_SLEEP)
        } else {
            ControlFlow::Wait
        });
    }
}

impl App {
    fn fail(&mut self, events: &ActiveEventLoop, error: RenderError) {
        self.failure = Some(error);
        events.exit();
    }

    /// Draws the picture, then the panels, so that an input takes effect in the same frame.
    fn draw(&mut self) -> Result<(), RenderError> {
        let (Some(open), player, state) = (&mut self.open, &mut self.player, &mut self.state) else { return Ok(()) };
        let now = Instant::now();
        let passed_s = (now - self.drawn).as_secs_f64().min(LONGEST_PAUSE_S);
        self.drawn = now;
        let input = open.input.take_egui_input(&open.window);
        let (output, area_px) = out_of_library(|| {
            player.receive();
            player.advance(passed_s);
            open.update_extent(&player.timeline);
            let [first_s, last_s] = player.timeline.log.range_s();
            let view = state.view(open.picture_px, last_s - first_s);
            let compose = |frame: Frame| {
                let camera = open.extent.camera(&player.timeline, &frame, &view)?;
                let scene = Scene::compose(&player.timeline, &open.extent, &frame, &view, camera);
                Ok::<_, RenderError>((frame, scene))
            };
            let drawn = player.timeline.log.at(player.time_s).map(compose).transpose()?;
            if let Some((_, scene)) = &drawn {
                open.show_picture(scene)?;
            }
            let viewport = Viewport { texture: open.texture, extent: &open.extent, drawn: drawn.as_ref() };
            let context = open.input.egui_ctx().clone();
            context.set_theme(if state.theme == Theme::Dark { egui::Theme::Dark } else { egui::Theme::Light });
            let mut area = egui::Rect::NOTHING;
            let output = context.run_ui(input, |ui| {
                state.keys(ui.ctx(), player);
                area = panels::show(ui, state, player, &viewport);
            });
            if std::mem::take(&mut state.wants_picture)
                && let Some((_, scene)) = &drawn
            {
                state.message = Some(open.write_picture(scene, &player.timeline.name, player.time_s));
            }
            let points = context.pixels_per_point();
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the cast saturates")]
            let area_px = [area.width(), area.height()].map(|side| (side * points).round() as u32);
            Ok::<_, RenderError>((output, area_px))
        })?;
        // The panels have determined the area of the picture: the next picture has this size.
        open.fit_picture(area_px);
        open.present(output)
    }
}

thread_local! {
    static IN_LIBRARY: Cell<bool> = const { Cell::new(false) };
}

/// Returns whether this thread is in the window library, outside of callbacks. A panic there means that the display was
/// closed: the library reports that in no other way.
#[must_use]
pub fn is_in_window_library() -> bool {
    IN_LIBRARY.get()
}

/// Runs a call of the window library.
fn in_library<T>(act: impl FnOnce() -> T) -> T {
    with_flag(true, act)
}

/// Runs a callback of this program.
fn out_of_library<T>(act: impl FnOnce() -> T) -> T {
    with_flag(false, act)
}

fn with_flag<T>(is_inside: bool, act: impl FnOnce() -> T) -> T {
    let before = IN_LIBRARY.replace(is_inside);
    let done = act();
    IN_LIBRARY.set(before);
    done
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn callbacks_are_outside_the_library() {
        assert!(!is_in_window_library());
        in_library(|| {
            assert!(is_in_window_library());
            assert!(!out_of_library(is_in_window_library));
            assert!(is_in_window_library());
        });
        assert!(!is_in_window_library());
    }
}
