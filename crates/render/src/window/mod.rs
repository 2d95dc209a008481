//! The window: a flight played, scrubbed, turned around and looked into, live or from a recording.

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
use state::WindowState;

/// Longest time between two pictures that is played \[s\]: a window that was hidden does not jump.
const LONGEST_PAUSE_S: f64 = 0.1;
/// How long the window sleeps while it waits for a flight in the air.
const LIVE_SLEEP: Duration = Duration::from_millis(30);

/// Opens a window on a flight and stays until it is closed.
///
/// `live` brings samples of a flight that is still in the air. Pictures that the person asks for are written into the
/// working folder.
///
/// # Errors
/// [`RenderError`] when there is no display, or nothing that can draw on it.
pub fn show(
    timeline: Timeline,
    live: Option<Receiver<LiveUpdate>>,
    theme: Theme,
    adapter: AdapterChoice,
) -> Result<(), RenderError> {
    in_library(|| {
        let events = EventLoop::new().map_err(|error| RenderError::NoDisplay(reason(&error)))?;
        let (player, state) = (Player::new(timeline, live), WindowState::new(theme));
        let mut app = App { adapter, player, state, open: None, drawn: Instant::now(), failure: None };
        events.run_app(&mut app).map_err(|error| RenderError::NoWindow(error.to_string()))?;
        app.failure.map_or(Ok(()), Err)
    })
}

/// What the window system said, without the place in a library that noticed it.
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
    /// When the last picture was drawn.
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
                } else if self.state.quits {
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
        let came = out_of_library(|| self.player.receive());
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

impl App {
    fn fail(&mut self, events: &ActiveEventLoop, error: RenderError) {
        self.failure = Some(error);
        events.exit();
    }

    /// Draws the picture, then the panels around it, in the order that what the person does is seen at once.
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
            if state.framed {
                state.frame(&open.extent, open.picture_px);
            }
            let (view, camera) = (state.view(open.picture_px), state.camera(open.picture_px));
            let drawn = player.timeline.log.at(player.time_s).map(|frame| {
                let scene = Scene::compose(&player.timeline, &open.extent, &frame, &view, camera);
                (frame, scene)
            });
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
        // What the panels leave is known now: the next picture fits.
        open.fit_picture(area_px);
        open.present(output)
    }
}

thread_local! {
    static WITHIN: Cell<bool> = const { Cell::new(false) };
}

/// Whether this thread runs the window library, and no callback of this program. A panic there means that the display went
/// away: the library reports it in no other way.
#[must_use]
pub fn is_in_window_library() -> bool {
    WITHIN.get()
}

/// Runs a call of the window library.
fn in_library<T>(act: impl FnOnce() -> T) -> T {
    marked(true, act)
}

/// Runs a callback of this program.
fn out_of_library<T>(act: impl FnOnce() -> T) -> T {
    marked(false, act)
}

fn marked<T>(within: bool, act: impl FnOnce() -> T) -> T {
    let before = WITHIN.replace(within);
    let done = act();
    WITHIN.set(before);
    done
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_library_calls_of_ours_is_not_the_library() {
        assert!(!is_in_window_library());
        in_library(|| {
            assert!(is_in_window_library());
            assert!(!out_of_library(is_in_window_library));
            assert!(is_in_window_library());
        });
        assert!(!is_in_window_library());
    }
}
