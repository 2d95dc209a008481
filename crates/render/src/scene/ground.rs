//! Ground with its scale, and coordinate axes.

use nalgebra::Vector3;

use super::camera::Lens;
use super::compose::SceneBuilder;
use super::labels::{LabelLayout, width};
use super::{Annotation, Line};
use tautline_core::text::decimals_of;
use tautline_report::drawing::colours::{AXES, LINE, SOFT_INK};

/// Largest number of ground lines in each direction.
const MAX_LINES: u32 = 60;
/// Width of the lines of a ground that is an obstacle, relative to the usual width.
const HARD: f32 = 2.0;
/// Sine of the elevation below which the ground is seen edge-on.
const EDGE_ON: f64 = 0.05;
/// Distance of numbers from the ground in units of the line distance.
const OUTWARDS: f64 = 0.42;
/// Number of positions along a line at which its number may be.
const CROSSINGS: u32 = 240;
/// Length of the axes in a picture 720 pixels high \[pixels\], and part of it below which an axis is not drawn.
const TRIAD_PX: f32 = 30.0;
const FORESHORTENED: f32 = 0.15;

/// Smallest component of the direction of a parallel camera along an axis that it looks along.
const ALONG_AXIS: f64 = 0.999_999;

impl SceneBuilder<'_> {
    /// Returns the corners of the ground \[m\], which fills the picture of a parallel camera along an axis.
    fn ground_m(&self) -> [Vector3<f64>; 2] {
        let ([low, high], step, camera) = (self.extent.ground.corners_m, self.extent.ground.step_m, &self.camera);
        let Lens::Parallel([across, half]) = camera.lens else { return [low, high] };
        if camera.back.amax() < ALONG_AXIS {
            return [low, high];
        }
        let reach = (camera.right * across).abs() + (camera.up * half).abs();
        let mut corners = [low, high];
        for axis in 0..2 {
            // Along the line of sight the ground keeps its length.
            if reach[axis] > 1e-3 * half {
                let beyond =
                    [low[axis] - camera.eye_m[axis] + reach[axis], camera.eye_m[axis] + reach[axis] - high[axis]];
                let most = f64::from(MAX_LINES) / 3.0;
                let [before, after] = beyond.map(|beyond_m| (beyond_m / step).ceil().clamp(0.0, most) * step);
                (corners[0][axis], corners[1][axis]) = (low[axis] - before, high[axis] + after);
            }
        }
        corners
    }

    pub(super) fn ground(&self, lines: &mut Vec<Line>) {
        let ([low, high], step) = (self.ground_m(), self.extent.ground.step_m);
        let width_px = self.view.unit_px().max(0.7) * if self.extent.ground.is_obstacle { HARD } else { 1.0 };
        let colour = self.view.theme.pick(LINE);
        for (along, across) in [(0, 1), (1, 0)] {
            for k in 0..=steps(high[along] - low[along], step) {
                let mut ends_m = [low, low];
                ends_m[0][along] = low[along] + f64::from(k) * step;
                ends_m[1] = ends_m[0];
                ends_m[1][across] = high[across];
                lines.push(Line::new(ends_m, colour, width_px));
            }
        }
    }

    /// Draws the directions of the axes in the lower right corner, and coordinates in metres where ground lines end or
    /// leave the picture.
    pub(super) fn scale(&self, labels: &mut LabelLayout) {
        let [low, high] = self.ground_m();
        let (size_px, soft) = (self.view.text_px(0.8), self.view.theme.pick(SOFT_INK));
        if self.view.has_legend() {
            self.triad(labels);
        }
        // A number on a ball would look like its name.
        let covered_px = self.covered_areas_px();
        let is_covered = |[x, y]: [f64; 2], text: &str| {
            let half = [width(size_px, text), size_px].map(|side| f64::from(side) / 2.0);
            covered_px.iter().any(|([at_x, at_y], radius)| {
                ((x - at_x).abs() - half[0]).max(0.0).hypot(((y - at_y).abs() - half[1]).max(0.0)) < *radius
            })
        };
        let mut taken = None;
        for axis in 0..2 {
            let other = 1 - axis;
            // Edge-on there is no edge to write along.
            if self.camera.back[axis].abs() > 0.97
                || self.camera.back.z.abs() < EDGE_ON && axis == 1 && self.camera.back.y.abs() > 0.5
            {
                continue;
            }
            // The lower of the two edges.
            let height = |edge: f64| {
                let mut point = (low + high) / 2.0;
                point[other] = edge;
                self.camera.project(point).map_or(f64::INFINITY, |projected| projected.at_px[1])
            };
            let is_high = height(high[other]) > height(low[other]);
            // Only the last number that fits has the unit.
            let mut unit = " m";
            for (place, number) in self.numbers(axis, is_high, size_px, &mut taken) {
                let text = format!("{number}{unit}");
                if !is_covered(place, &text) && labels.put_if_free(place, [0.5; 2], size_px, soft, &text) {
                    unit = "";
                }
            }
        }
    }

    /// Returns the coordinates of ground lines across an axis, from the largest one, with the middles of their texts
    /// \[pixels\]. The texts are beyond the ends of the lines, or where the lines leave the picture. All are at one
    /// side of the picture that is not taken.
    fn numbers(&self, axis: usize, is_high: bool, size_px: f32, taken: &mut Option<usize>) -> Vec<([f64; 2], String)> {
        let ([low, high], step, origin_m) = (self.ground_m(), self.extent.ground.step_m, self.extent.origin_m());
        let other = 1 - axis;
        let (from, to) = if is_high { (high[other], low[other]) } else { (low[other], high[other]) };
        let from = from + OUTWARDS * step * (from - to).signum();
        // Edge-on the numbers are below the line of the ground.
        let is_edge_on = self.camera.back.z.abs() < EDGE_ON;
        let below_px = if is_edge_on { 0.9 * f64::from(size_px) } else { 0.0 };
        let area = self.view.area(self.extent.has_violations);
        let [width_px, height_px] = area.size_px.map(f64::from);
        let [top, bottom] = area.texts_px;
        let bottom = if is_edge_on { 0.0 } else { bottom };
        let number = |k: u32| {
            let mut point = low;
            point[axis] += f64::from(k) * step;
            let text = format_multiple(point[axis] + origin_m[axis], step);
            // Any number may get the unit.
            let half = f64::from(width(size_px, &format!("{text} m")) + 0.6 * size_px) / 2.0;
            let line = f64::from(size_px);
            let place = |n: u32| {
                point[other] = from + (to - from) * f64::from(n) / f64::from(CROSSINGS);
                let [x, y] = self.camera.project(point)?.at_px;
                let place_px = [x, y + below_px];
                // Distances from the sides of the free area.
                let free_px = [
                    place_px[0] - half,
                    width_px - half - place_px[0],
                    place_px[1] - top - line,
                    height_px - bottom.max(line) - place_px[1],
                ];
                let side = (0..4).min_by(|&a, &b| free_px[a].total_cmp(&free_px[b])).filter(|_| n > 0);
                free_px.iter().all(|&free_px| free_px >= 0.0).then_some((side, place_px))
            };
            let (side, crossing) = (0..=CROSSINGS).find_map(place)?;
            Some((side, crossing, text))
        };
        let numbers: Vec<_> = (0..=steps(high[axis] - low[axis], step)).rev().filter_map(number).collect();
        // Numbers at several sides of the picture would be taken for those of the other axis.
        let count = |side| numbers.iter().filter(|(own_side, ..)| *own_side == side).count();
        let sides = numbers.iter().map(|(side, ..)| *side).filter(|side| side.is_none() || side != taken);
        let commonest = sides.max_by_key(|&side| count(side));
        let kept = numbers.iter().filter(|(side, ..)| Some(*side) == commonest);
        let numbers = kept.map(|(_, point, text)| (*point, text.clone())).collect();
        *taken = commonest.flatten();
        numbers
    }

    /// Draws the directions of the axes.
    fn triad(&self, labels: &mut LabelLayout) {
        let (size_px, unit_px) = (self.view.text_px(0.8), self.view.unit_px());
        let (arm, reach) = (TRIAD_PX * unit_px, TRIAD_PX * unit_px + size_px);
        let middle = self.view.size_px.map(|side| side as f32 - reach - self.view.margin_px());
        for (axis, colour) in AXES.map(|colour| self.view.theme.pick(colour)).into_iter().enumerate() {
            #[expect(clippy::cast_possible_truncation, reason = "pixels")]
            let [x, y] = [self.camera.right[axis] as f32, -self.camera.up[axis] as f32];
            if x.hypot(y) < FORESHORTENED {
                continue;
            }
            let tip = [middle[0] + x * arm, middle[1] + y * arm];
            labels.draw(Annotation::Stroke { ends_px: [middle, tip], colour, width_px: 2.0 * unit_px.max(0.5) });
            let beyond = (arm + 0.6 * size_px) / arm;
            let at_px = [middle[0] + x * arm * beyond, middle[1] + y * arm * beyond];
            labels.put(at_px, [0.5, 0.5], size_px, colour, ["x", "y", "z"][axis]);
        }
        labels.reserve([middle.map(|value| value - 0.2 * arm), middle.map(|value| value + 0.2 * arm)]);
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
            [(-0.0, 2.0), (4.000_000_1, 2.0), (0.3, 0.05), (-15.0, 5.0)]
                .map(|(number, step)| format_multiple(number, step)),
            ["0", "4", "0.30", "-15"]
        );
        assert_eq!(steps(f64::INFINITY, 1.0), MAX_LINES);
    }
}
