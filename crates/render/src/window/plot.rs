//! The smallest separation over time.

use egui::{Align2, Color32, Sense, Stroke, Ui, pos2, vec2};

use super::player::Player;
use crate::scene::metres;

/// Most points of the plot.
const PLOT_POINTS: usize = 600;

/// The smallest separation over time against delta, with where one is.
pub(super) fn plot(ui: &mut Ui, player: &Player) {
    let (area, response) = ui.allocate_exact_size(vec2(ui.available_width(), 120.0), Sense::hover());
    let painter = ui.painter_at(area);
    let visuals = ui.visuals();
    painter.rect_filled(area, 3.0, visuals.extreme_bg_color);
    let [first_s, last_s] = player.timeline.log.range_s();
    let span_s = (last_s - first_s).max(1e-9);
    let delta_m = player.timeline.delta_m;
    let keyframes = player.timeline.log.keyframes();
    let separations: Vec<_> =
        keyframes.iter().filter_map(|keyframe| Some([keyframe.time_s, keyframe.closest?.separation_m])).collect();
    // The smallest of those that share a point is what counts.
    let smallest =
        |shared: &[[f64; 2]]| [shared[0][0], shared.iter().fold(f64::INFINITY, |least, at| least.min(at[1]))];
    let points: Vec<_> = separations.chunks(keyframes.len().div_ceil(PLOT_POINTS).max(1)).map(smallest).collect();
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

#[cfg(test)]
mod tests {
    use super::*;

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
}
