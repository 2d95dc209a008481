//! State of the window that the user controls, and keyboard input.

use egui::{Key, Vec2};
use nalgebra::Vector3;

use super::player::Player;
use crate::scene::{Camera, Extent, Layers, Orbit, TAN_HALF_VIEW, Theme, View};

/// Rotation of the camera per key press \[degrees\].
const KEY_TURN_DEG: f64 = 5.0;

/// State of the window that the user controls.
#[expect(clippy::struct_excessive_bools, reason = "each is on or off by itself")]
pub(super) struct WindowState {
    orbit: Orbit,
    target_m: Vector3<f64>,
    layers: Layers,
    pub(super) theme: Theme,
    pub(super) picked: Option<usize>,
    pub(super) help: bool,
    /// Whether the camera frames the whole flight; a camera movement ends it.
    pub(super) framed: bool,
    pub(super) message: Option<String>,
    /// Whether a picture is to be saved.
    pub(super) wants_picture: bool,
    /// Whether the window is to be closed.
    pub(super) is_closing: bool,
}

impl WindowState {
    pub(super) fn new(theme: Theme) -> Self {
        Self {
            orbit: Orbit { azimuth_deg: 0.0, elevation_deg: 0.0, distance_m: 20.0 },
            target_m: Vector3::zeros(),
            layers: Layers::ALL,
            theme,
            picked: None,
            help: false,
            framed: true,
            message: None,
            wants_picture: false,
            is_closing: false,
        }
    }

    pub(super) fn view(&self, size_px: [u32; 2]) -> View {
        View { theme: self.theme, size_px, layers: self.layers, ..View::default() }
    }

    pub(super) fn camera(&self, size_px: [u32; 2]) -> Camera {
        Camera::orbiting(self.orbit, self.target_m, size_px)
    }

    /// Frames the whole flight.
    pub(super) fn frame(&mut self, extent: &Extent, size_px: [u32; 2]) {
        (self.orbit, self.target_m) = extent.orbit(size_px);
    }

    pub(super) fn turn(&mut self, azimuth_deg: f64, elevation_deg: f64) {
        self.orbit.azimuth_deg = (self.orbit.azimuth_deg + azimuth_deg).rem_euclid(360.0);
        self.orbit.elevation_deg = (self.orbit.elevation_deg + elevation_deg).clamp(-90.0, 90.0);
        self.framed = false;
    }

    pub(super) fn approach(&mut self, factor: f64) {
        self.orbit.distance_m = (self.orbit.distance_m * factor).clamp(1e-2, 1e7);
        self.framed = false;
    }

    /// Moves the target with the mouse, in a picture of this height \[points\].
    pub(super) fn pan(&mut self, drag: Vec2, camera: &Camera, height: f32) {
        let metres = 2.0 * TAN_HALF_VIEW * self.orbit.distance_m / f64::from(height.max(1.0));
        self.target_m += (camera.up * f64::from(drag.y) - camera.right * f64::from(drag.x)) * metres;
        self.framed = false;
    }

    /// Returns the layers with their names, in the order of their keys.
    pub(super) fn layers(&mut self) -> [(&'static str, &mut bool); 8] {
        let layers = &mut self.layers;
        [
            ("shells", &mut layers.shells),
            ("edges", &mut layers.edges),
            ("trails", &mut layers.trails),
            ("marks", &mut layers.marks),
            ("ground", &mut layers.ground),
            ("names", &mut layers.labels),
            ("closest", &mut layers.closest),
            ("caption", &mut layers.caption),
        ]
    }

    pub(super) fn keys(&mut self, context: &egui::Context, player: &mut Player) {
        // A text field in focus receives all keys, any other field only the keys that operate it.
        let focus = context.memory(egui::Memory::focused);
        if focus.is_some_and(|id| egui::text_edit::TextEditState::load(context, id).is_some()) {
            return;
        }
        let operates_focus = |key: Key| {
            matches!(key, Key::Space | Key::Enter | Key::ArrowLeft | Key::ArrowRight | Key::Escape) && focus.is_some()
        };
        let pressed: Vec<Key> = context.input(|input| {
            let pressed = |event: &egui::Event| match event {
                egui::Event::Key { key, pressed: true, modifiers, .. } if !modifiers.command => Some(*key),
                _ => None,
            };
            input.events.iter().filter_map(pressed).collect()
        });
        // A key press clears the last message.
        if !pressed.is_empty() {
            self.message = None;
        }
        pressed.into_iter().filter(|&key| !operates_focus(key)).for_each(|key| self.press(key, player));
    }

    /// Performs the action of a key or of its button.
    pub(super) fn press(&mut self, key: Key, player: &mut Player) {
        match key {
            Key::Space => player.toggle(),
            Key::ArrowLeft => player.step(-1),
            Key::ArrowRight => player.step(1),
            Key::Home => player.seek(f64::NEG_INFINITY),
            Key::End => player.seek(f64::INFINITY),
            Key::N => {
                if let Some(closest) = player.timeline.log.closest() {
                    player.playing = false;
                    player.seek(closest.time_s);
                }
            }
            Key::Minus => player.change_speed(false),
            Key::Plus | Key::Equals => player.change_speed(true),
            Key::A => self.turn(-KEY_TURN_DEG, 0.0),
            Key::D => self.turn(KEY_TURN_DEG, 0.0),
            Key::W => self.turn(0.0, KEY_TURN_DEG),
            Key::S => self.turn(0.0, -KEY_TURN_DEG),
            Key::PageUp => self.approach(0.9),
            Key::PageDown => self.approach(1.0 / 0.9),
            Key::V => {
                let next = self.picked.map_or(0, |picked| picked + 1);
                self.picked = (next < player.timeline.count()).then_some(next);
            }
            Key::F => self.framed = true,
            Key::T => {
                let at = Theme::ALL.iter().position(|(_, theme)| *theme == self.theme).unwrap_or(0);
                self.theme = Theme::ALL[(at + 1) % Theme::ALL.len()].1;
            }
            Key::P => self.wants_picture = true,
            Key::H | Key::F1 | Key::Questionmark => self.help = !self.help,
            Key::Escape if self.help => self.help = false,
            Key::Q | Key::Escape => self.is_closing = true,
            digit => {
                if let Ok(number @ 1..=8) = digit.name().parse::<usize>() {
                    let (_, shown) = &mut self.layers()[number - 1];
                    **shown = !**shown;
                }
            }
        }
    }
}
