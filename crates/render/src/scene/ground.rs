//! Ground with its scale, and coordinate axes.

use nalgebra::Vector3;

use super::Line;
use super::colour::{Colour, Theme};
use super::compose::SceneBuilder;
use super::labels::{LabelLayout, width};
use tautline_core::text::decimals_of;

/// Largest number of ground lines in each direction.
const MAX_LINES: u32 = 60;
/// Opacity of the lines of a ground that is an obstacle.
const HARD: f32 = 0.45;
/// Sine of the elevation below which the ground is seen edge-on.
const EDGE_ON: f64 = 0.05;
/// Length of the axes in units of the line distance.
const AXIS: f64 = 1.0;
/// Colours of x, y and z on dark and on light background.
const AXES: [[Colour; 3]; 2] = [
    [Colour::hex(0xE0_6C_75), Colour::hex(0x7F_C9_7F), Colour::hex(0x61_AF_EF)],
    [Colour::hex(0xB0_2A_37), Colour::hex(0x2B_7A_2B), Colour::hex(0x1F_5F_B0)],
];

impl SceneBuilder<'_> {
    pub(super) fn ground(&self, lines: &mut Vec<Line>) {
        let ([low, high], step) = (self.extent.ground_m, self.extent.grid_m);
        let width_px = self.view.unit_px().max(0.7);
        let theme = self.view.theme;
        let colour = if self.extent.has_hard_ground { theme.obstacle().at(HARD) } else { theme.grid() };
        for (along, across) in [(0, 1), (1, 0)] {
            for k in 0..=steps(high[along] - low[along], step) {
                let mut ends_m = [low, low];
                ends_m[0][along] = low[along] + f64::from(k) * step;
                ends_m[1] = ends_m[0];
                ends_m[1][across] = high[across];
                lines.push(Line::new(ends_m, colour, width_px));
            }
        }
        for (axis, colour) in self.axes().into_iter().enumerate() {
            lines.push(Line::new([low, low + Vector3::ith(axis, AXIS * step)], colour, 2.4 * width_px));
        }
    }

    fn axes(&self) -> [Colour; 3] {
        AXES[usize::from(self.view.theme != Theme::Dark)]
    }

    /// Draws coordinates in metres along the two edges of the ground nearest to the camera, and the names of the axes.
    pub(super) fn scale(&self, labels: &mut LabelLayout) {
        let ([low, high], step) = (self.extent.ground_m, self.extent.grid_m);
        let (size_px, soft) = (self.view.text_px(0.8), self.view.theme.soft_ink());
        for (axis, colour) in self.axes().into_iter().enumerate() {
            let tip = low + Vector3::ith(axis, (AXIS + 0.22) * step);
            let foreshortened = self.camera.back[axis].abs() > 0.97;
            if let Some(at) = self.camera.project(tip).filter(|_| !foreshortened) {
                labels.put_if_free(at.at_px, [0.5, 0.5], size_px, colour, ["x", "y", "z"][axis]);
            }
        }
        // A number on a ball would look like its name.
        let covered_px = self.covered_areas_px();
        let is_covered = |[x, y]: [f64; 2], text: &str| {
            let half = [width(size_px, text), size_px].map(|side| f64::from(side) / 2.0);
            covered_px.iter().any(|([at_x, at_y], radius)| {
                ((x - at_x).abs() - half[0]).max(0.0).hypot(((y - at_y).abs() - half[1]).max(0.0)) < *radius
            })
        };
        for axis in 0..2 {
            let other = 1 - axis;
            // Edge-on there is no edge to write along.
            if self.camera.back[axis].abs() > 0.97
                || self.camera.back.z.abs() < EDGE_ON && axis == 1 && self.camera.back.y.abs() > 0.5
            {
                continue;
            }
            // The lower of the two edges, or the other one if more of it is in the picture.
            let mut edges = [low[other], high[other]].map(|edge| {
                let numbers = self.numbers(axis, edge, size_px);
                let visible = numbers.iter().filter(|(at, text)| labels.is_free(*at, size_px, text)).count();
                let lowest = numbers.iter().fold(f64::NEG_INFINITY, |lowest, (at, _)| lowest.max(at[1]));
                (visible, lowest, numbers)
            });
            if edges[1].1 > edges[0].1 {
                edges.swap(0, 1);
            }
            if edges[1].0 > 2 * edges[0].0 {
                edges.swap(0, 1);
            }
            // Only the last number that fits has the unit.
            let mut unit = " m";
            for (at, number) in &edges[0].2 {
                let text = format!("{number}{unit}");
                if !is_covered(*at, &text) && labels.put_if_free(*at, [0.5; 2], size_px, soft, &text) {
                    unit = "";
                }
            }
        }
    }

    /// Returns the coordinates along an edge of the ground, from the largest one, with the middles of their texts
    /// \[pixels\].
    fn numbers(&self, axis: usize, edge: f64, size_px: f32) -> Vec<([f64; 2], String)> {
        let ([low, high], step, origin_m) = (self.extent.ground_m, self.extent.grid_m, self.extent.origin_m());
        let other = 1 - axis;
        let outwards = if edge > f64::midpoint(low[other], high[other]) { 1.0 } else { -1.0 };
        // Edge-on the numbers are below the line of the ground.
        let below_px = if self.camera.back.z.abs() < EDGE_ON { 0.9 * f64::from(size_px) } else { 0.0 };
        let number = |k: u32| {
            let mut point = low;
            point[axis] += f64::from(k) * step;
            point[other] = edge + outwards * 0.42 * step;
            let [x, y] = self.camera.project(point)?.at_px;
            Some(([x, y + below_px], format_multiple(point[axis] + origin_m[axis], step)))
        };
        (0..=steps(high[axis] - low[axis], step)).rev().filter_map(number).collect()
    }
}

/// Returns the number of steps in a length, at most [`MAX_LINES`].
fn steps(length: f64, step: f64) -> u32 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the cast saturates")]
    let steps = (length / step).round() as u32;
    steps.min(MAX_LINES)
}

/// Formats a multiple of a step with the decimals of the step.
fn format_multiple(metres: f64, step: f64) -> String {
    let decimals = decimals_of(step, 9);
    // Adding 0 turns a negative zero into zero.
    format!("{:.decimals$}", (metres / step).round() * step + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scale_shows_round_numbers() {
        assert_eq!(
            [(-0.0, 2.0), (4.000_000_1, 2.0), (0.3, 0.05), (-15.0, 5.0)].map(|(at, step)| format_multiple(at, step)),
            ["0", "4", "0.30", "-15"]
        );
        assert_eq!(steps(f64::INFINITY, 1.0), MAX_LINES);
    }
}
