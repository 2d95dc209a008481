//! Places of short texts beside marks, where they overlap neither each other nor a mark.

use super::svg::{Align, Canvas, Marker, Point, Rect, Stroke, text_px, text_rect};
use crate::drawing::colours::SOFT_INK;

/// Distances of the middle of a text from its mark \[px\]. From the second on, a line joins both.
const DISTANCES: [f64; 5] = [9.5, 19.0, 27.0, 36.0, 46.0];
/// Number of directions that are tried at each distance.
const DIRECTIONS: u32 = 12;
/// Half of the width of a mark, and of the height of a text \[px\].
const MARK: f64 = 4.0;
const HALF_HEIGHT: f64 = 5.5;

/// Rectangles that later texts avoid.
#[derive(Debug, Default)]
pub(super) struct Labels {
    taken: Vec<Rect>,
}

impl Labels {
    /// Makes later texts avoid a mark.
    pub(super) fn avoid_mark(&mut self, (x, y): Point) {
        self.taken.push([x - MARK, y - MARK, x + MARK, y + MARK]);
    }

    /// Draws a text that later texts avoid.
    pub(super) fn text(&mut self, canvas: &mut Canvas, at: Point, align: Align, words: &str) {
        canvas.text(at, align, words);
        self.taken.push(text_rect(at, align, words));
    }

    /// Draws a text beside a marker, at the first free place: near the lower left of a cross, and near the upper right
    /// of a ring. Without a free place it has the one with the least overlap.
    pub(super) fn beside(&mut self, canvas: &mut Canvas, marker: Marker, at: Point, words: &str) {
        let first = if marker == Marker::Cross { 0.75 } else { -0.25 } * std::f64::consts::PI;
        let half_width = 0.5 * text_px(words);
        let places = DISTANCES.iter().flat_map(|&distance| {
            (0..DIRECTIONS).map(move |k| {
                // Directions alternate around the first: 0, 1, -1, 2, -2.
                let turn = f64::from(k.div_ceil(2)) * if k % 2 == 0 { 1.0 } else { -1.0 };
                let (sin, cos) = (first + std::f64::consts::TAU / f64::from(DIRECTIONS) * turn).sin_cos();
                (distance, (at.0 + (distance + half_width - HALF_HEIGHT).max(0.0) * cos, at.1 + distance * sin))
            })
        });
        let rect = |(x, y): Point| [x - half_width, y - HALF_HEIGHT, x + half_width, y + HALF_HEIGHT];
        let covered = |place: Point| {
            let outside = if canvas.contains(rect(place)) { 0.0 } else { f64::MAX };
            self.taken.iter().map(|&other| overlap(rect(place), other)).fold(outside, f64::max)
        };
        let mut best: Option<(f64, f64, Point)> = None;
        for (distance, place) in places {
            let covered = covered(place);
            if best.is_none_or(|(least, ..)| covered < least) {
                best = Some((covered, distance, place));
            }
            if covered == 0.0 {
                break;
            }
        }
        let Some((_, distance, place)) = best else { return };
        if distance > DISTANCES[0] {
            let along = (place.0 - at.0, place.1 - at.1);
            let length = along.0.hypot(along.1);
            let on = |part_px: f64| (at.0 + part_px / length * along.0, at.1 + part_px / length * along.1);
            canvas
                .line(&[on(MARK), on((length - half_width.max(HALF_HEIGHT)).max(MARK))], Stroke::solid(SOFT_INK, 0.6));
        }
        canvas.text(place, Align::CENTRE, words);
        self.taken.push(rect(place));
    }
}

/// Returns the area that two rectangles share.
fn overlap(one: Rect, other: Rect) -> f64 {
    let across = one[2].min(other[2]) - one[0].max(other[0]);
    let down = one[3].min(other[3]) - one[1].max(other[1]);
    across.max(0.0) * down.max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_of_near_marks_do_not_overlap() {
        let mut canvas = Canvas::new((400.0, 300.0), "title", 200.0);
        let mut labels = Labels::default();
        let marks: Vec<_> = (0..8).map(|k| (200.0 + 3.0 * f64::from(k % 4), 150.0 + 4.0 * f64::from(k / 4))).collect();
        for &at in &marks {
            labels.avoid_mark(at);
        }
        for (k, &at) in marks.iter().enumerate() {
            labels.beside(&mut canvas, Marker::Ring, at, &format!("{}", k + 8));
        }
        let taken = &labels.taken;
        assert_eq!(taken.len(), 16);
        for (k, &text) in taken.iter().enumerate().skip(8) {
            assert!(taken[..k].iter().all(|&other| overlap(text, other) == 0.0), "{k}: {taken:?}");
        }
    }
}
