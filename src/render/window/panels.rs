//! What the window shows around the picture, and what keys and mouse do.

use egui::{Align2, Color32, Key, RichText, Sense, Slider, Stroke, Ui, Vec2, pos2, vec2};
use nalgebra::Vector3;

use super::player::Player;
use crate::render::gpu::paint;
use crate::render::scene::{Camera, Mark, Orbit, Stage, metres};
use crate::render::{CameraSpec, Layers, Moment, Plan, Theme};
use crate::swarm::{Pair, row};

/// Degrees that the camera turns for a point that the mouse is dragged.
const TURN_DEG: f64 = 0.35;
/// Degrees that the camera turns for a key.
const KEY_TURN_DEG: f64 = 5.0;
/// Most neighbours of the picked vehicle that are listed.
const LISTED: usize = 8;
/// Room for the button of the help \[points\].
const HELP_HEIGHT: f32 = 28.0;
/// Most points of the plot.
const PLOT_POINTS: usize = 600;

/// Keys and what they do, for the help.
const HELP: [(&str, &str); 14] = [
    ("Space", "play, pause"),
    ("Left, Right", "a sample back, on"),
    ("Home, End", "to the start, to the end"),
    ("N", "to the closest approach"),
    ("- , +", "slower, faster"),
    ("drag, W A S D", "turn the camera"),
    ("right drag", "move the camera"),
    ("wheel, Page Up, Page Down", "nearer, farther"),
    ("click, V", "pick a vehicle, the next one"),
    ("F, T", "frame everything, change colours"),
    ("1 to 8", "shells, edges, trails, marks, ground, names, closest pair, caption"),
    ("Tab", "to the next button"),
    ("P", "write a picture beside you"),
    ("H, Q", "this help, quit"),
];

/// What the person has chosen.
pub(super) struct Desk {
    pub(super) orbit: Orbit,
    pub(super) target_m: Vector3<f64>,
    pub(super) layers: Layers,
    pub(super) theme: Theme,
    pub(super) picked: Option<usize>,
    pub(super) help: bool,
    /// The camera follows the extent of the flight until somebody moves it.
    pub(super) framed: bool,
    pub(super) message: Option<String>,
}

/// What is asked of the window.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Wishes {
    pub(super) picture: bool,
    pub(super) quit: bool,
}

/// The picture and what is laid over it.
pub(super) struct Shown<'a> {
    pub(super) texture: egui::TextureId,
    pub(super) marks: &'a [Mark],
    pub(super) camera: Option<Camera>,
    pub(super) moment: Option<&'a Moment>,
    /// Where the origin of the camera's frame is \[m\].
    pub(super) origin_m: Vector3<f64>,
}

impl Desk {
    pub(super) fn new(theme: Theme) -> Self {
        let orbit = Orbit { azimuth_deg: -62.0, elevation_deg: 32.0, distance_m: 20.0 };
        Self {
            orbit,
            target_m: Vector3::zeros(),
            layers: Layers::ALL,
            theme,
            picked: None,
            help: false,
            framed: true,
            message: None,
        }
    }

    /// Frames the whole flight.
    pub(super) fn frame(&mut self, stage: &Stage, size_px: [u32; 2]) {
        (self.orbit, self.target_m) = stage.orbit(&CameraSpec::Iso, size_px);
        self.framed = true;
    }

    fn turn(&mut self, azimuth_deg: f64, elevation_deg: f64) {
        self.orbit.azimuth_deg = (self.orbit.azimuth_deg + azimuth_deg).rem_euclid(360.0);
        self.orbit.elevation_deg = (self.orbit.elevation_deg + elevation_deg).clamp(-90.0, 90.0);
        self.framed = false;
    }

    fn approach(&mut self, factor: f64) {
        self.orbit.distance_m = (self.orbit.distance_m * factor).clamp(1e-2, 1e7);
        self.framed = false;
    }

    fn layer(&mut self, k: usize) -> Option<(&'static str, &mut bool)> {
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
        .into_iter()
        .nth(k)
    }

    pub(super) fn keys(&mut self, context: &egui::Context, player: &mut Player) -> Wishes {
        // A field being typed into has its keys to itself; any other field in focus has those that work it.
        let focus = context.memory(egui::Memory::focused);
        if focus.is_some_and(|id| egui::text_edit::TextEditState::load(context, id).is_some()) {
            return Wishes::default();
        }
        let works_it = |key: Key| {
            matches!(key, Key::Space | Key::Enter | Key::ArrowLeft | Key::ArrowRight | Key::Escape) && focus.is_some()
        };
        let pressed: Vec<Key> = context.input(|input| {
            let pressed = |event: &egui::Event| match event {
                egui::Event::Key { key, pressed: true, modifiers, .. } if !modifiers.command => Some(*key),
                _ => None,
            };
            input.events.iter().filter_map(pressed).collect()
        });
        // What was said last is read by now.
        if !pressed.is_empty() {
            self.message = None;
        }
        let mut wishes = Wishes::default();
        for key in pressed.into_iter().filter(|&key| !works_it(key)) {
            match key {
                Key::Space => player.toggle(),
                Key::ArrowLeft => player.step(-1),
                Key::ArrowRight => player.step(1),
                Key::Home => player.seek(f64::NEG_INFINITY),
                Key::End => player.seek(f64::INFINITY),
                Key::N => {
                    if let Some(closest) = player.footage.closest() {
                        player.playing = false;
                        player.seek(closest.time_s);
                    }
                }
                Key::Minus => player.faster(false),
                Key::Plus | Key::Equals => player.faster(true),
                Key::A => self.turn(-KEY_TURN_DEG, 0.0),
                Key::D => self.turn(KEY_TURN_DEG, 0.0),
                Key::W => self.turn(0.0, KEY_TURN_DEG),
                Key::S => self.turn(0.0, -KEY_TURN_DEG),
                Key::PageUp => self.approach(0.9),
                Key::PageDown => self.approach(1.0 / 0.9),
                Key::V => {
                    let next = self.picked.map_or(0, |picked| picked + 1);
                    self.picked = (next < player.footage.count()).then_some(next);
                }
                Key::F => self.framed = true,
                Key::T => {
                    let at = Theme::ALL.iter().position(|(_, theme)| *theme == self.theme).unwrap_or(0);
                    self.theme = Theme::ALL[(at + 1) % Theme::ALL.len()].1;
                }
                Key::P => wishes.picture = true,
                Key::H | Key::F1 | Key::Questionmark => self.help = !self.help,
                Key::Escape if self.help => self.help = false,
                Key::Q | Key::Escape => wishes.quit = true,
                digit => {
                    const DIGITS: [Key; 8] =
                        [Key::Num1, Key::Num2, Key::Num3, Key::Num4, Key::Num5, Key::Num6, Key::Num7, Key::Num8];
                    let layer = DIGITS.iter().position(|known| *known == digit).and_then(|k| self.layer(k));
                    if let Some((_, shown)) = layer {
                        *shown = !*shown;
                    }
                }
            }
        }
        wishes
    }

    /// Draws the panels; gives the area that is left for the picture \[points\].
    pub(super) fn show(&mut self, ui: &mut Ui, player: &mut Player, shown: &Shown<'_>) -> egui::Rect {
        egui::Panel::bottom("time").show(ui, |ui| controls(ui, player, self.message.as_deref()));
        egui::Panel::right("sides").default_size(230.0).show(ui, |ui| self.sides(ui, player, shown));
        egui::CentralPanel::no_frame().show(ui, |ui| self.picture(ui, player, shown)).inner
    }

    fn picture(&mut self, ui: &mut Ui, player: &Player, shown: &Shown<'_>) -> egui::Rect {
        let area = ui.available_rect_before_wrap();
        let response = ui.allocate_rect(area, Sense::click_and_drag());
        let points = ui.ctx().pixels_per_point();
        let whole = egui::Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        let painter = ui.painter_at(area);
        painter.image(shown.texture, area, whole, Color32::WHITE);
        paint(&painter, shown.marks, area.min.to_vec2(), points);
        if let Some((at, radius)) = self.picked.and_then(|picked| shown.on_picture(picked, player)) {
            let stroke = Stroke::new(2.0, ui.visuals().strong_text_color());
            painter.circle_stroke(area.min + at / points, (radius / points).max(6.0) + 4.0, stroke);
        }
        let drag = response.drag_delta();
        if response.dragged_by(egui::PointerButton::Primary) && !ui.input(|input| input.modifiers.shift) {
            self.turn(-f64::from(drag.x) * TURN_DEG, f64::from(drag.y) * TURN_DEG);
        } else if response.dragged() {
            self.pan(drag, shown.camera, area);
        }
        if response.hovered() {
            let wheel = ui.input(|input| input.smooth_scroll_delta().y);
            if wheel != 0.0 {
                self.approach((-f64::from(wheel) * 0.003).exp());
            }
        }
        if response.clicked()
            && let Some(at) = response.interact_pointer_pos()
        {
            self.picked = shown.pick((at - area.min) * points, player);
        }
        if self.help {
            help(ui.ctx(), &mut self.help);
        }
        area
    }

    fn pan(&mut self, drag: Vec2, camera: Option<Camera>, area: egui::Rect) {
        let Some(camera) = camera else { return };
        let metres = 2.0 * 0.315 * self.orbit.distance_m / f64::from(area.height().max(1.0));
        self.target_m += (camera.up * f64::from(drag.y) - camera.right * f64::from(drag.x)) * metres;
        self.framed = false;
    }

    fn sides(&mut self, ui: &mut Ui, player: &Player, shown: &Shown<'_>) {
        ui.add_space(4.0);
        ui.label(RichText::new("Layers").strong());
        ui.columns(2, |columns| {
            for k in 0..8 {
                if let Some((name, shown)) = self.layer(k) {
                    columns[k % 2].checkbox(shown, format!("{} {name}", k + 1));
                }
            }
        });
        ui.separator();
        ui.label(RichText::new("Separation").strong());
        plot(ui, player);
        ui.separator();
        let height = (ui.available_height() - HELP_HEIGHT).max(0.0);
        egui::ScrollArea::vertical().max_height(height).show(ui, |ui| match (self.picked, shown.moment) {
            (Some(picked), Some(moment)) if picked < player.footage.count() => vehicle(ui, player, moment, picked),
            _ => {
                ui.label("Click a vehicle to see its distances and forces.");
            }
        });
        ui.with_layout(egui::Layout::bottom_up(egui::Align::LEFT), |ui| {
            if ui.button("Help (H)").clicked() {
                self.help = true;
            }
        });
    }
}

impl Shown<'_> {
    /// Where a vehicle is in the picture and how large \[pixels\].
    fn on_picture(&self, k: usize, player: &Player) -> Option<(Vec2, f32)> {
        let place = row(&self.moment?.positions_m, k) - self.origin_m;
        let at = self.camera?.project(place)?;
        #[expect(clippy::cast_possible_truncation, reason = "pixels")]
        let [x, y, radius] = [at.at_px[0], at.at_px[1], player.footage.radius_m[k] * at.px_per_m].map(|v| v as f32);
        Some((vec2(x, y), radius))
    }

    /// The nearest vehicle whose ball, or a few pixels around its middle, is at a point of the picture.
    fn pick(&self, at: Vec2, player: &Player) -> Option<usize> {
        let depth_m = |k: usize| {
            let (place, radius) = self.on_picture(k, player)?;
            let projected = self.camera?.project(row(&self.moment?.positions_m, k) - self.origin_m)?;
            ((place - at).length() <= radius.max(8.0)).then_some(projected.depth_m)
        };
        let hit = (0..player.footage.count()).filter_map(|k| Some((k, depth_m(k)?)));
        hit.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
    }
}

/// Play, step, scrub, speed.
fn controls(ui: &mut Ui, player: &mut Player, message: Option<&str>) {
    ui.add_space(3.0);
    ui.horizontal(|ui| {
        if ui.button("|<").on_hover_text("to the start (Home)").clicked() {
            player.seek(f64::NEG_INFINITY);
        }
        if ui.button("<").on_hover_text("a sample back (Left)").clicked() {
            player.step(-1);
        }
        let play = if player.playing { "Pause" } else { "Play" };
        if ui.add_sized([56.0, 18.0], egui::Button::new(play)).on_hover_text("Space").clicked() {
            player.toggle();
        }
        if ui.button(">").on_hover_text("a sample on (Right)").clicked() {
            player.step(1);
        }
        if ui.button(">|").on_hover_text("to the end (End)").clicked() {
            player.seek(f64::INFINITY);
        }
        let [first_s, last_s] = player.footage.range_s();
        let mut time_s = player.time_s;
        ui.spacing_mut().slider_width = (ui.available_width() - 230.0).max(60.0);
        let slider = Slider::new(&mut time_s, first_s..=last_s.max(first_s + 1e-9))
            .custom_formatter(|time_s, _| format!("{time_s:.2}"))
            .suffix(" s");
        if ui.add(slider).changed() {
            player.playing = false;
            player.seek(time_s);
        }
        if ui.small_button("-").on_hover_text("slower (-)").clicked() {
            player.faster(false);
        }
        ui.label(format!("{} x", player.speed));
        if ui.small_button("+").on_hover_text("faster (+)").clicked() {
            player.faster(true);
        }
        if player.is_live() {
            ui.label(RichText::new("live").strong());
        }
    });
    // Its line is always there, so that the picture keeps its size.
    ui.add(egui::Label::new(player.said.as_deref().or(message).unwrap_or(" ")).truncate());
    ui.add_space(2.0);
}

/// The smallest separation over time against delta, with where one is.
fn plot(ui: &mut Ui, player: &Player) {
    let (area, response) = ui.allocate_exact_size(vec2(ui.available_width(), 120.0), Sense::hover());
    let painter = ui.painter_at(area);
    let visuals = ui.visuals();
    painter.rect_filled(area, 3.0, visuals.extreme_bg_color);
    let [first_s, last_s] = player.footage.range_s();
    let span_s = (last_s - first_s).max(1e-9);
    let delta_m = player.footage.delta_m;
    let most = player.footage.instants().div_ceil(PLOT_POINTS).max(1);
    let mut points: Vec<[f64; 2]> = Vec::new();
    for (k, [time_s, separation_m]) in player.footage.separations().enumerate() {
        match points.last_mut() {
            // The smallest of those that share a point is what counts.
            Some(last) if k % most != 0 => last[1] = last[1].min(separation_m),
            _ => points.push([time_s, separation_m]),
        }
    }
    let values = || points.iter().map(|point| point[1]).chain(delta_m);
    let top = values().fold(0.0, f64::max) * 1.1;
    let bottom = (values().fold(f64::INFINITY, f64::min) * 0.9).min(top);
    #[expect(clippy::cast_possible_truncation, reason = "points of a plot")]
    let at = |time_s: f64, separation_m: f64| {
        let (x, y) = ((time_s - first_s) / span_s, (separation_m - bottom) / (top - bottom).max(1e-9));
        pos2(area.left() + x as f32 * area.width(), area.bottom() - y as f32 * area.height())
    };
    if let Some(delta_m) = delta_m {
        let stroke = Stroke::new(1.5, Color32::from_rgb(0xE0, 0x30, 0x3C));
        painter.line_segment([at(first_s, delta_m), at(last_s, delta_m)], stroke);
        let font = egui::FontId::proportional(11.0);
        painter.text(at(last_s, delta_m), Align2::RIGHT_BOTTOM, format!("delta {delta_m} m "), font, stroke.color);
    }
    let curve = points.iter().map(|&[time_s, separation_m]| at(time_s, separation_m)).collect();
    painter.add(egui::Shape::line(curve, Stroke::new(1.5, visuals.hyperlink_color)));
    let ink = plot_ink(visuals);
    let number = |corner: egui::Pos2, anchor, text| {
        painter.text(corner, anchor, text, egui::FontId::proportional(11.0), ink);
    };
    number(area.left_top(), Align2::LEFT_TOP, format!(" {top:.1} m"));
    number(area.left_bottom(), Align2::LEFT_BOTTOM, format!(" {bottom:.1} m, {first_s:.0} s"));
    number(area.right_bottom(), Align2::RIGHT_BOTTOM, format!("{last_s:.0} s "));
    let now = at(player.time_s, bottom).x;
    painter.vline(now, area.y_range(), Stroke::new(1.0, visuals.strong_text_color()));
    if let Some(pointer) = response.hover_pos() {
        let time_s = first_s + f64::from((pointer.x - area.left()) / area.width()) * span_s;
        let near = points.iter().min_by(|a, b| (a[0] - time_s).abs().total_cmp(&(b[0] - time_s).abs()));
        if let Some([time_s, separation_m]) = near {
            response.on_hover_text(format!("{} at {time_s:.2} s", metres(*separation_m)));
        }
    }
}

/// The colour of the numbers of the plot.
fn plot_ink(visuals: &egui::Visuals) -> Color32 {
    visuals.text_color()
}

/// What is known of a vehicle at a moment.
fn vehicle(ui: &mut Ui, player: &Player, moment: &Moment, k: usize) {
    let footage = &player.footage;
    ui.label(RichText::new(format!("Vehicle {}", footage.vehicles[k])).strong());
    let place = row(&moment.positions_m, k);
    ui.label(format!("at ({:.3}, {:.3}, {:.3}) m", place.x, place.y, place.z));
    if let Some(control) = &moment.control_m_s2 {
        let control = row(control, k);
        ui.label(format!("commanded {:.3} m/s\u{b2}", control.norm()));
        ui.label(format!("  ({:.3}, {:.3}, {:.3})", control.x, control.y, control.z));
    }
    let mut others: Vec<(f64, usize)> = (0..footage.count())
        .filter(|&other| other != k)
        .map(|other| (moment.distance_m(Pair::new(k, other)), other))
        .filter(|(distance_m, _)| distance_m.is_finite())
        .collect();
    others.sort_by(|a, b| a.0.total_cmp(&b.0));
    egui::Grid::new("neighbours").num_columns(3).show(ui, |ui| {
        ui.label("to");
        ui.label("distance");
        ui.label("tension");
        ui.end_row();
        for (distance_m, other) in others.into_iter().take(LISTED) {
            ui.label(&footage.vehicles[other]);
            ui.label(metres(distance_m));
            ui.label(
                footage.plan.as_ref().map_or_else(String::new, |plan| in_words(plan, Pair::new(k, other), distance_m)),
            );
            ui.end_row();
        }
    });
}

/// How hard an edge pulls or pushes, or by how much it is too long where the law has no tension.
fn in_words(plan: &Plan, pair: Pair, distance_m: f64) -> String {
    if plan.graph.later_neighbours(pair.first()).all(|other| other != pair.second()) {
        return "no edge".to_owned();
    }
    match plan.pull_m_s2(pair, distance_m) {
        Some(pull) if pull == f64::NEG_INFINITY => "inside delta".to_owned(),
        Some(pull) if pull.abs() < 0.005 => "rest".to_owned(),
        Some(pull) if pull < 0.0 => format!("push {:.2} m/s\u{b2}", -pull),
        Some(pull) => format!("pull {pull:.2} m/s\u{b2}"),
        None => {
            let stretch = plan.stretch(pair, distance_m);
            format!("{:.0} % too {}", 100.0 * stretch.abs(), if stretch < 0.0 { "short" } else { "long" })
        }
    }
}

fn help(context: &egui::Context, open: &mut bool) {
    egui::Window::new("Keys and mouse").open(open).collapsible(false).resizable(false).show(context, |ui| {
        egui::Grid::new("help").num_columns(2).spacing([18.0, 4.0]).show(ui, |ui| {
            for (keys, what) in HELP {
                ui.label(RichText::new(keys).strong());
                ui.label(what);
                ui.end_row();
            }
        });
    });
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::graph::Graph;
    use crate::scenario::{Scenario, Source};
    use crate::swarm::{Rows, Swarm, row};

    fn plan(name: &str) -> Plan {
        Plan::of(&Scenario::read(&Source::Builtin(name.to_owned()), &[]).expect("built in"))
    }

    #[test]
    fn the_table_gives_the_acceleration_of_an_edge_and_no_share_of_a_limit() {
        let (plan, pair) = (plan("pentagon"), Pair::new(0, 1));
        let pushed = plan.pull_m_s2(pair, 2.001).expect("a tension");
        assert!(
            pushed < -10.0 && plan.tension(pair, 2.001) == -1.0,
            "{pushed} m/s^2, far below the limit of the colour"
        );
        assert_eq!(in_words(&plan, pair, 2.001), format!("push {:.2} m/s\u{b2}", -pushed));
        let pulled = plan.pull_m_s2(pair, 9.0).expect("a tension");
        assert_eq!(in_words(&plan, pair, 9.0), format!("pull {pulled:.2} m/s\u{b2}"));
        let rest_m = plan.formation.desired_distance(0, 1);
        assert_eq!(in_words(&plan, pair, rest_m), "rest");
        assert_eq!(in_words(&plan, pair, 2.0), "inside delta");
    }

    #[test]
    fn the_accelerations_of_its_edges_add_up_to_what_the_law_commands() {
        let scenario = Scenario::read(&Source::Builtin("pentagon".to_owned()), &[]).expect("built in");
        let (plan, swarm) = (Plan::of(&scenario), Swarm::at_rest(scenario.start.positions_m.clone()));
        let mut control = Rows::zeros(swarm.count());
        scenario.law().expect("a law").command(&scenario.observation(&swarm), &mut control).expect("a command");
        for i in 0..swarm.count() {
            let others = (0..swarm.count()).filter(|&j| j != i);
            let pulls = others.map(|j| {
                let to_other = row(&swarm.positions_m, j) - row(&swarm.positions_m, i);
                to_other.normalize() * plan.pull_m_s2(Pair::new(i, j), to_other.norm()).expect("a tension")
            });
            assert!((pulls.sum::<Vector3<f64>>() - row(&control, i)).norm() < 1e-12, "vehicle {}", i + 1);
        }
    }

    #[test]
    fn the_numbers_of_the_plot_stand_out_from_its_ground() {
        for visuals in [egui::Visuals::dark(), egui::Visuals::light()] {
            let luminance = |colour: Color32| {
                let [red, green, blue, _] = egui::Rgba::from(colour).to_array();
                0.2126 * red + 0.7152 * green + 0.0722 * blue
            };
            let [ink, ground] = [plot_ink(&visuals), visuals.extreme_bg_color].map(luminance);
            // WCAG 2.2, level AA.
            assert!((ink.max(ground) + 0.05) / (ink.min(ground) + 0.05) >= 4.5, "{ink} on {ground}");
        }
    }

    #[test]
    fn two_without_an_edge_have_no_tension_and_springs_are_long_or_short() {
        let mut ring = plan("pentagon");
        ring.graph = Graph::ring(5);
        assert_eq!(in_words(&ring, Pair::new(0, 2), 3.0), "no edge");
        let springs = plan("pentagon-laplacian");
        let rest_m = springs.formation.desired_distance(0, 1);
        assert_eq!(in_words(&springs, Pair::new(0, 1), 1.5 * rest_m), "50 % too long");
    }
}
