//! Panels around the picture, and mouse input.

use egui::{
    Align2, Button, Color32, Key, PointerButton, Rect, RichText, Sense, Slider, Stroke, TextureId, Ui, Vec2, pos2, vec2,
};

use nalgebra::{UnitQuaternion, Vector3};

use super::player::Player;
use super::state::{WINDOW_KEYS, WindowState};
use crate::overlay::paint;
use crate::scene::{Extent, Projected, Scene, metres};
use tautline_core::swarm::{Pair, row};
use tautline_report::flight_log::Frame;
use tautline_sim::plan::Plan;

/// Rotation of the camera per point of a mouse drag \[degrees\].
const DRAG_TURN_DEG: f64 = 0.35;
/// Largest number of neighbours that are listed for the picked vehicle.
const MAX_NEIGHBOURS: usize = 8;
/// Colour of violations and of delta.
const ALARM: Color32 = Color32::from_rgb(0xE0, 0x30, 0x3C);
/// Height of the help button \[points\].
const HELP_HEIGHT: f32 = 28.0;

/// Picture and its content.
pub(super) struct Viewport<'a> {
    pub(super) texture: TextureId,
    pub(super) extent: &'a Extent,
    /// Frame at the current time and its draw list; `None` before the first sample.
    pub(super) drawn: Option<&'a (Frame, Scene)>,
}

impl Viewport<'_> {
    /// Returns projection, position and radius of a vehicle in the picture \[pixels\].
    fn on_picture(&self, k: usize, player: &Player) -> Option<(Projected, Vec2, f32)> {
        let (frame, scene) = self.drawn?;
        let centre_px = scene.camera.project(self.extent.place(&frame.positions_m, k)?)?;
        #[expect(clippy::cast_possible_truncation, reason = "pixels")]
        let [x, y, radius] = [centre_px.at_px[0], centre_px.at_px[1], player.timeline.radius_m[k] * centre_px.px_per_m]
            .map(|v| v as f32);
        Some((centre_px, vec2(x, y), radius))
    }

    /// Returns the nearest vehicle at a point of the picture, within its ball or a few pixels around its centre.
    fn pick(&self, point: Vec2, player: &Player) -> Option<usize> {
        let depth_m = |k: usize| {
            let (centre_px, place, radius) = self.on_picture(k, player)?;
            ((place - point).length() <= radius.max(8.0)).then_some(centre_px.depth_m)
        };
        let hit = (0..player.timeline.count()).filter_map(|k| Some((k, depth_m(k)?)));
        hit.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(k, _)| k)
    }
}

/// Draws the panels and the picture; returns the area left for the picture \[points\].
pub(super) fn show(ui: &mut Ui, state: &mut WindowState, player: &mut Player, viewport: &Viewport<'_>) -> Rect {
    egui::Panel::bottom("time").show(ui, |ui| controls(ui, state, player));
    egui::Panel::right("sides").default_size(230.0).show(ui, |ui| sides(ui, state, player, viewport));
    egui::CentralPanel::no_frame().show(ui, |ui| picture(ui, state, player, viewport)).inner
}

fn picture(ui: &mut Ui, state: &mut WindowState, player: &Player, viewport: &Viewport<'_>) -> Rect {
    let area = ui.available_rect_before_wrap();
    let response = ui.allocate_rect(area, Sense::click_and_drag());
    let points = ui.ctx().pixels_per_point();
    let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
    let painter = ui.painter_at(area);
    painter.image(viewport.texture, area, whole, Color32::WHITE);
    if let Some((_, scene)) = viewport.drawn {
        paint(&painter, &scene.annotations, area.min.to_vec2(), points);
    }
    if let Some((_, centre_px, radius)) = state.picked.and_then(|picked| viewport.on_picture(picked, player)) {
        let stroke = Stroke::new(2.0, ui.visuals().strong_text_color());
        painter.circle_stroke(area.min + centre_px / points, (radius / points).max(6.0) + 4.0, stroke);
    }
    let drag = response.drag_delta();
    if response.dragged_by(PointerButton::Primary) && !ui.input(|input| input.modifiers.shift) {
        state.turn(-f64::from(drag.x) * DRAG_TURN_DEG, f64::from(drag.y) * DRAG_TURN_DEG);
    } else if response.dragged()
        && let Some((_, scene)) = viewport.drawn
    {
        state.pan(drag, &scene.camera, area.height());
    }
    if response.hovered() {
        let wheel = ui.input(|input| input.smooth_scroll_delta().y);
        if wheel != 0.0 {
            state.approach((-f64::from(wheel) * 0.003).exp());
        }
    }
    if response.clicked()
        && let Some(pointer) = response.interact_pointer_pos()
    {
        state.picked = viewport.pick((pointer - area.min) * points, player);
    }
    if state.help {
        help(ui.ctx(), &mut state.help);
    }
    area
}

fn sides(ui: &mut Ui, state: &mut WindowState, player: &Player, viewport: &Viewport<'_>) {
    ui.add_space(4.0);
    ui.label(RichText::new("Layers").strong());
    ui.columns(2, |columns| {
        for (k, (name, shown)) in state.layers().into_iter().enumerate() {
            columns[k % 2].checkbox(shown, name);
        }
    });
    ui.separator();
    ui.label(RichText::new("Separation").strong());
    plot(ui, player);
    ui.separator();
    let height = (ui.available_height() - HELP_HEIGHT).max(0.0);
    egui::ScrollArea::vertical().max_height(height).show(ui, |ui| match (state.picked, viewport.drawn) {
        (Some(picked), Some((frame, _))) if picked < player.timeline.count() => vehicle(ui, player, frame, picked),
        _ => {
            ui.label("Click a vehicle to see its separations and tensions.");
        }
    });
    ui.with_layout(egui::Layout::bottom_up(egui::Align::LEFT), |ui| {
        if ui.button("Help (H)").clicked() {
            state.help = true;
        }
    });
}

/// Draws the buttons, the time slider and the speed.
fn controls(ui: &mut Ui, state: &mut WindowState, player: &mut Player) {
    ui.add_space(3.0);
    ui.horizontal(|ui| {
        let play = Button::new(if player.playing { "Pause" } else { "Play" }).min_size(vec2(56.0, 18.0));
        let buttons = [
            (Button::new("|<"), "start (Home)", Key::Home),
            (Button::new("<"), "previous sample (Left)", Key::ArrowLeft),
            (play, "Space", Key::Space),
            (Button::new(">"), "next sample (Right)", Key::ArrowRight),
            (Button::new(">|"), "end (End)", Key::End),
        ];
        for (button, what, key) in buttons {
            if ui.add(button).on_hover_text(what).clicked() {
                state.press(key, false, player);
            }
        }
        let [first_s, last_s] = player.timeline.log.range_s();
        let mut time_s = player.time_s;
        ui.spacing_mut().slider_width = (ui.available_width() - 230.0).max(60.0);
        let end_s = last_s.max(first_s + 1e-9);
        let response = ui.add(Slider::new(&mut time_s, first_s..=end_s).show_value(false));
        if response.changed() {
            player.playing = false;
            player.seek(time_s);
        }
        marks(ui, response.rect, [first_s, end_s], player);
        ui.label(format!("{:.2} s", player.time_s));
        if ui.small_button("-").on_hover_text("slower (-)").clicked() {
            player.change_speed(false);
        }
        ui.label(format!("{} x", player.speed));
        if ui.small_button("+").on_hover_text("faster (+)").clicked() {
            player.change_speed(true);
        }
        if player.is_live() {
            ui.label(RichText::new("live").strong());
        }
    });
    // The message line is always present, so that the picture keeps its size.
    ui.add(egui::Label::new(player.end_message.as_deref().or(state.message.as_deref()).unwrap_or(" ")).truncate());
    ui.add_space(2.0);
}

/// Draws marks on the time slider: a bar for each violation, a triangle at the closest approach.
fn marks(ui: &Ui, slider: Rect, [first_s, last_s]: [f64; 2], player: &Player) {
    // The handle stays within the slider.
    let handle = slider.height() / 2.5;
    let x = |time_s: f64| {
        #[expect(clippy::cast_possible_truncation, reason = "points")]
        let part = ((time_s - first_s) / (last_s - first_s)).clamp(0.0, 1.0) as f32;
        slider.left() + handle + part * (slider.width() - 2.0 * handle)
    };
    let (painter, log) = (ui.painter(), &player.timeline.log);
    for found in log.violations().all() {
        let (from, to) = (x(found.from_s), x(found.to_s.min(last_s)).max(x(found.from_s) + 2.0));
        let bar = Rect::from_min_max(pos2(from, slider.bottom() - 3.0), pos2(to, slider.bottom()));
        painter.rect_filled(bar, 0.0, ALARM);
    }
    if let Some(closest) = log.closest() {
        let (x_px, top) = (x(closest.time_s), slider.top());
        let corners = vec![pos2(x_px - 4.0, top - 1.0), pos2(x_px + 4.0, top - 1.0), pos2(x_px, top + 5.0)];
        let colour = ui.visuals().strong_text_color();
        painter.add(egui::Shape::convex_polygon(corners, colour, Stroke::NONE));
    }
}

/// Draws the state of a vehicle at a time.
fn vehicle(ui: &mut Ui, player: &Player, frame: &Frame, k: usize) {
    let timeline = &player.timeline;
    ui.label(RichText::new(format!("Vehicle {}", timeline.vehicles[k])).strong());
    let place = row(&frame.positions_m, k);
    ui.label(format!("at ({:.3}, {:.3}, {:.3}) m", place.x, place.y, place.z));
    if let Some(attitude) = frame.attitude(k) {
        let (tilt_deg, heading_deg) = tilt_and_heading_deg(&attitude);
        ui.label(format!("tilted {tilt_deg:.1}\u{b0}, heading {heading_deg:.0}\u{b0}"));
    }
    if let Some(control) = &frame.control_m_s2 {
        let control = row(control, k);
        ui.label(format!("commanded {:.3} m/s\u{b2}", control.norm()));
        ui.label(format!("  ({:.3}, {:.3}, {:.3})", control.x, control.y, control.z));
    }
    let mut others: Vec<(f64, usize)> = (0..timeline.count())
        .filter(|&other| other != k)
        .map(|other| (frame.distance_m(Pair::new(k, other)), other))
        .filter(|(distance_m, _)| distance_m.is_finite())
        .collect();
    others.sort_by(|a, b| a.0.total_cmp(&b.0));
    egui::Grid::new("neighbours").num_columns(3).show(ui, |ui| {
        let row = |ui: &mut Ui, cells: [&str; 3]| {
            for cell in cells {
                ui.label(cell);
            }
            ui.end_row();
        };
        row(ui, ["to", "separation", "tension"]);
        for (distance_m, other) in others.into_iter().take(MAX_NEIGHBOURS) {
            let tension = timeline
                .plan
                .as_ref()
                .map(|plan| describe_tension(plan, Pair::new(k, other), distance_m, frame.time_s));
            row(ui, [&timeline.vehicles[other], &metres(distance_m), &tension.unwrap_or_default()]);
        }
    });
}

/// Returns the angle of the thrust axis from the vertical, and the heading from the x axis towards the y axis
/// \[degrees\].
fn tilt_and_heading_deg(attitude: &UnitQuaternion<f64>) -> (f64, f64) {
    let (up, ahead) = (attitude * Vector3::z(), attitude * Vector3::x());
    (up.xy().norm().atan2(up.z).to_degrees(), ahead.y.atan2(ahead.x).to_degrees())
}

/// Describes the acceleration of an edge, or its relative elongation if the law has no tension.
fn describe_tension(plan: &Plan, pair: Pair, distance_m: f64, time_s: f64) -> String {
    if plan.graph.later_neighbours(pair.first()).all(|other| other != pair.second()) {
        return "no edge".to_owned();
    }
    match plan.pull_m_s2(pair, distance_m, time_s) {
        Some(pull) if pull == f64::NEG_INFINITY => "inside delta".to_owned(),
        Some(pull) if pull.abs() < 0.005 => "rest".to_owned(),
        Some(pull) if pull < 0.0 => format!("push {:.2} m/s\u{b2}", -pull),
        Some(pull) => format!("pull {pull:.2} m/s\u{b2}"),
        None => {
            let elongation = plan.elongation(pair, distance_m, time_s);
            format!("{:.0} % too {}", 100.0 * elongation.abs(), if elongation < 0.0 { "short" } else { "long" })
        }
    }
}

fn help(context: &egui::Context, open: &mut bool) {
    egui::Window::new("Keys and mouse").open(open).collapsible(false).resizable(false).show(context, |ui| {
        egui::Grid::new("help").num_columns(2).spacing([18.0, 4.0]).show(ui, |ui| {
            for (keys, what) in WINDOW_KEYS {
                ui.label(RichText::new(keys).strong());
                ui.label(what);
                ui.end_row();
            }
        });
    });
}

/// Largest number of points in the plot.
const MAX_PLOT_POINTS: usize = 600;

/// Draws the smallest separation over time with delta and the current time.
fn plot(ui: &mut Ui, player: &Player) {
    let (whole, response) = ui.allocate_exact_size(vec2(ui.available_width(), 136.0), Sense::hover());
    // Times are below the plot, where no curve and no limit is.
    let area = whole.with_max_y(whole.bottom() - 16.0);
    let painter = ui.painter_at(whole);
    let visuals = ui.visuals();
    painter.rect_filled(area, 3.0, visuals.extreme_bg_color);
    let [first_s, last_s] = player.timeline.log.range_s();
    let span_s = (last_s - first_s).max(1e-9);
    let delta_m = player.timeline.delta_m;
    let keyframes = player.timeline.log.keyframes();
    let separations: Vec<_> =
        keyframes.iter().filter_map(|keyframe| Some([keyframe.time_s, keyframe.closest?.separation_m])).collect();
    // A point shows the smallest of its separations.
    let smallest =
        |shared: &[[f64; 2]]| [shared[0][0], shared.iter().fold(f64::INFINITY, |least, point| least.min(point[1]))];
    let points: Vec<_> = separations.chunks(keyframes.len().div_ceil(MAX_PLOT_POINTS).max(1)).map(smallest).collect();
    let values = || points.iter().map(|point| point[1]).chain(delta_m);
    let top = values().fold(0.0, f64::max) * 1.1;
    let bottom = (values().fold(f64::INFINITY, f64::min) * 0.9).min(top);
    #[expect(clippy::cast_possible_truncation, reason = "points of a plot")]
    let point_at = |time_s: f64, separation_m: f64| {
        let (x, y) = ((time_s - first_s) / span_s, (separation_m - bottom) / (top - bottom).max(1e-9));
        pos2(area.left() + x as f32 * area.width(), area.bottom() - y as f32 * area.height())
    };
    if let Some(delta_m) = delta_m {
        let stroke = Stroke::new(1.5, ALARM);
        painter.line_segment([point_at(first_s, delta_m), point_at(last_s, delta_m)], stroke);
        let font = egui::FontId::proportional(11.0);
        // Above the line, or below a line at the top.
        let place = point_at(last_s, delta_m);
        let is_high = place.y - area.top() < 16.0;
        painter.text(
            place,
            if is_high { Align2::RIGHT_TOP } else { Align2::RIGHT_BOTTOM },
            format!("delta {delta_m} m "),
            font,
            stroke.color,
        );
    }
    let curve = points.iter().map(|&[time_s, separation_m]| point_at(time_s, separation_m)).collect();
    painter.add(egui::Shape::line(curve, Stroke::new(1.5, visuals.hyperlink_color)));
    let ink = plot_ink(visuals);
    let number = |corner: egui::Pos2, anchor, text| {
        painter.text(corner, anchor, text, egui::FontId::proportional(11.0), ink);
    };
    number(area.left_top(), Align2::LEFT_TOP, format!(" {top:.1} m"));
    number(area.left_bottom(), Align2::LEFT_BOTTOM, format!(" {bottom:.1} m"));
    number(area.left_bottom(), Align2::LEFT_TOP, format!(" {first_s:.0} s"));
    number(area.right_bottom(), Align2::RIGHT_TOP, format!("{last_s:.0} s "));
    let now = point_at(player.time_s, bottom).x;
    painter.vline(now, area.y_range(), Stroke::new(1.0, visuals.strong_text_color()));
    if let Some(pointer) = response.hover_pos() {
        let time_s = first_s + f64::from((pointer.x - area.left()) / area.width()) * span_s;
        let near = points.iter().min_by(|a, b| (a[0] - time_s).abs().total_cmp(&(b[0] - time_s).abs()));
        if let Some([time_s, separation_m]) = near {
            response.on_hover_text(format!("{} at {time_s:.2} s", metres(*separation_m)));
        }
    }
}

/// Returns the colour of the plot's numbers.
fn plot_ink(visuals: &egui::Visuals) -> Color32 {
    visuals.text_color()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tautline_core::swarm::{Rows, Swarm, row};
    use tautline_laws::graph::Graph;
    use tautline_sim::scenario::{Scenario, Source};

    fn plan(name: &str) -> Plan {
        Plan::of(&Scenario::read(&Source::Builtin(name.to_owned()), &[]).expect("built in"))
    }

    #[test]
    fn the_table_shows_the_acceleration_of_an_edge() {
        let (plan, pair) = (plan("pentagon"), Pair::new(0, 1));
        let pushed = plan.pull_m_s2(pair, 2.001, 0.0).expect("a tension");
        assert!(
            pushed < -10.0 && plan.tension(pair, 2.001, 0.0) == -1.0,
            "{pushed} m/s^2, far below the limit of the colour"
        );
        assert_eq!(describe_tension(&plan, pair, 2.001, 0.0), format!("push {:.2} m/s\u{b2}", -pushed));
        let pulled = plan.pull_m_s2(pair, 9.0, 0.0).expect("a tension");
        assert_eq!(describe_tension(&plan, pair, 9.0, 0.0), format!("pull {pulled:.2} m/s\u{b2}"));
        let rest_m = plan.formation_at(0.0).desired_distance(0, 1);
        assert_eq!(describe_tension(&plan, pair, rest_m, 0.0), "rest");
        assert_eq!(describe_tension(&plan, pair, 2.0, 0.0), "inside delta");
    }

    #[test]
    fn tilt_is_measured_from_the_vertical_and_heading_from_x_to_y() {
        let (ahead, left) = (Vector3::x_axis(), Vector3::y_axis());
        let yawed = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.5);
        let (tilt, heading) = tilt_and_heading_deg(&(yawed * UnitQuaternion::from_axis_angle(&left, 0.3)));
        assert!((tilt.to_radians() - 0.3).abs() < 1e-12 && (heading.to_radians() - 0.5).abs() < 1e-12);
        let (over, _) = tilt_and_heading_deg(&UnitQuaternion::from_axis_angle(&ahead, std::f64::consts::PI));
        assert!((over - 180.0).abs() < 1e-9, "{over}");
    }

    #[test]
    fn edge_accelerations_add_up_to_the_command() {
        let scenario = Scenario::read(&Source::Builtin("pentagon".to_owned()), &[]).expect("built in");
        let (plan, swarm) = (Plan::of(&scenario), Swarm::at_rest(scenario.start.positions_m.clone()));
        let mut control = Rows::zeros(swarm.count());
        scenario.law().expect("a law").command(&scenario.observation(&swarm), &mut control).expect("a command");
        for i in 0..swarm.count() {
            let others = (0..swarm.count()).filter(|&j| j != i);
            let pulls = others.map(|j| {
                let to_other = row(&swarm.positions_m, j) - row(&swarm.positions_m, i);
                to_other.normalize() * plan.pull_m_s2(Pair::new(i, j), to_other.norm(), 0.0).expect("a tension")
            });
            assert!((pulls.sum::<Vector3<f64>>() - row(&control, i)).norm() < 1e-12, "vehicle {}", i + 1);
        }
    }

    #[test]
    fn a_pair_without_an_edge_has_no_tension_and_springs_have_an_elongation() {
        let mut ring = plan("pentagon");
        ring.graph = Graph::ring(5);
        assert_eq!(describe_tension(&ring, Pair::new(0, 2), 3.0, 0.0), "no edge");
        let springs = plan("pentagon-laplacian");
        let rest_m = springs.formation_at(0.0).desired_distance(0, 1);
        assert_eq!(describe_tension(&springs, Pair::new(0, 1), 1.5 * rest_m, 0.0), "50 % too long");
    }

    #[test]
    fn the_numbers_of_the_plot_have_enough_contrast() {
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
}
