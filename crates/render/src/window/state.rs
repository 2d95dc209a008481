//! State of the window that the user controls, and keyboard input.

use egui::{Key, Vec2};

use super::player::Player;
use crate::scene::{Adjustment, Camera, CameraSpec, Colouring, Layers, Theme, View};
use crate::timeline::Timeline;

/// Rotation of the camera per key press \[degrees\].
const KEY_TURN_DEG: f64 = 5.0;

/// Limits of the zoom.
const ZOOM: [f64; 2] = [1e-3, 1e3];
/// Length of short trails relative to the flight.
const SHORT_TRAIL: f64 = 0.1;

/// Keys and mouse of the window with their effects.
pub const WINDOW_KEYS: [(&str, &str); 19] = [
    ("Space", "play, pause"),
    ("Left, Right", "previous, next sample"),
    ("Home, End", "start, end"),
    ("Up, Down or +, -", "faster, slower"),
    ("N", "closest approach"),
    ("B, Shift+B", "next, previous violation"),
    ("1, 2, 3", "perspective, top, front"),
    ("F", "follow the picked vehicle or the swarm; again: the whole flight"),
    ("T", "trails: whole, short, none"),
    ("C", "colour by vehicle, speed, clearance, lights"),
    ("L", "labels"),
    ("W, A, S, D or drag", "turn the camera"),
    ("right drag", "move the camera"),
    ("Page Up, Page Down or wheel", "zoom"),
    ("click, V", "pick a vehicle, the next vehicle"),
    ("M", "dark or light background"),
    ("P", "save a picture in the working folder"),
    ("H", "help"),
    ("Q", "quit"),
];

/// Length of trails.
#[derive(Clone, Copy, PartialEq)]
enum Trails {
    Whole,
    Short,
    None,
}

/// State of the window that the user controls.
pub(super) struct WindowState {
    camera: CameraSpec,
    adjustment: Adjustment,
    layers: Layers,
    trails: Trails,
    /// Length of whole trails \[s\]; `None` from the start.
    trail_s: Option<f64>,
    colouring: Colouring,
    pub(super) theme: Theme,
    pub(super) picked: Option<usize>,
    pub(super) help: bool,
    pub(super) message: Option<String>,
    /// Whether a picture is to be saved.
    pub(super) wants_picture: bool,
    /// Whether the window is to be closed.
    pub(super) is_closing: bool,
}

impl WindowState {
    /// Returns the first view of a flight.
    pub(super) fn new(theme: Theme, timeline: &Timeline) -> Self {
        let View { camera, layers, colouring, trail_s, .. } = View::of(timeline);
        Self {
            camera,
            adjustment: Adjustment::NONE,
            layers,
            trails: Trails::Whole,
            trail_s,
            colouring,
            theme,
            picked: None,
            help: false,
            message: None,
            wants_picture: false,
            is_closing: false,
        }
    }

    /// Returns the view of a flight of this duration \[s\].
    pub(super) fn view(&self, size_px: [u32; 2], duration_s: f64) -> View {
        View {
            camera: self.camera.clone(),
            adjustment: self.adjustment,
            colouring: self.colouring,
            theme: self.theme,
            size_px,
            text_scale: 1.0,
            layers: Layers { trails: self.layers.trails && self.trails != Trails::None, ..self.layers },
            trail_s: if self.trails == Trails::Short { Some(SHORT_TRAIL * duration_s) } else { self.trail_s },
            picked: self.picked,
        }
    }

    /// Selects a camera and drops changes by hand.
    fn look(&mut self, camera: CameraSpec) {
        (self.camera, self.adjustment) = (camera, Adjustment::NONE);
    }

    pub(super) fn turn(&mut self, azimuth_deg: f64, elevation_deg: f64) {
        let [azimuth, elevation] = &mut self.adjustment.turn_deg;
        *azimuth = (*azimuth + azimuth_deg).rem_euclid(360.0);
        *elevation = (*elevation + elevation_deg).clamp(-180.0, 180.0);
    }

    pub(super) fn approach(&mut self, factor: f64) {
        self.adjustment.zoom = (self.adjustment.zoom * factor).clamp(ZOOM[0], ZOOM[1]);
    }

    /// Moves the target with the mouse, in a picture of this height \[points\].
    pub(super) fn pan(&mut self, drag: Vec2, camera: &Camera, height: f32) {
        let metres = 2.0 * camera.half_height_m() / f64::from(height.max(1.0));
        self.adjustment.move_m += (camera.up * f64::from(drag.y) - camera.right * f64::from(drag.x)) * metres;
    }

    /// Returns the layers with their names.
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
        let pressed: Vec<(Key, bool)> = context.input(|input| {
            let pressed = |event: &egui::Event| match event {
                egui::Event::Key { key, pressed: true, modifiers, .. } if !modifiers.command => {
                    Some((*key, modifiers.shift))
                }
                _ => None,
            };
            input.events.iter().filter_map(pressed).collect()
        });
        // A key press clears the last message.
        if !pressed.is_empty() {
            self.message = None;
        }
        let acting = pressed.into_iter().filter(|(key, _)| !operates_focus(*key));
        acting.for_each(|(key, shift)| self.press(key, shift, player));
    }

    /// Performs the action of a key or of its button.
    pub(super) fn press(&mut self, key: Key, shift: bool, player: &mut Player) {
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
            Key::B => player.seek_violation(!shift),
            Key::ArrowDown | Key::Minus => player.change_speed(false),
            Key::ArrowUp | Key::Plus | Key::Equals => player.change_speed(true),
            Key::Num1 => self.look(CameraSpec::Perspective),
            Key::Num2 => self.look(CameraSpec::Top),
            Key::Num3 => self.look(CameraSpec::Front),
            Key::F if matches!(self.camera, CameraSpec::Follow(_)) => self.look(CameraSpec::Auto),
            Key::F => {
                let picked = self.picked.and_then(|picked| player.timeline.vehicles.get(picked).cloned());
                self.look(CameraSpec::Follow(picked));
            }
            Key::T => {
                self.trails = match self.trails {
                    Trails::Whole => Trails::Short,
                    Trails::Short => Trails::None,
                    Trails::None => Trails::Whole,
                }
            }
            Key::C => self.colouring = next(&Colouring::ALL, self.colouring),
            Key::L => self.layers.labels = !self.layers.labels,
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
            Key::M => self.theme = next(&Theme::ALL, self.theme),
            Key::P => self.wants_picture = true,
            Key::H | Key::F1 | Key::Questionmark => self.help = !self.help,
            Key::Escape if self.help => self.help = false,
            Key::Q | Key::Escape => self.is_closing = true,
            _ => {}
        }
    }
}

/// Returns the choice after this one; the first follows the last.
fn next<T: Copy + PartialEq, const N: usize>(all: &[(&str, T); N], this: T) -> T {
    let index = all.iter().position(|(_, choice)| *choice == this).unwrap_or(N - 1);
    all[(index + 1) % N].1
}
