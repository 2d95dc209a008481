//! Curves as polylines of a drawing whose longer side is 1.

use kurbo::{Affine, BezPath, PathEl, Rect, Shape as _};

use super::error::DrawingError;

/// x to the right and y upwards, in longer sides of the drawing.
pub(super) type Point = [f64; 2];

/// How far a polyline may lie from its curve.
const TOLERANCE: f64 = 1e-5;

/// Coordinates are rounded to this part of the drawing, so that slots do not hang on the last bits of a platform's
/// sines.
const GRID: f64 = (1_u64 << 36) as f64;

/// Longest side of a drawing in its own units, and shortest: squares of both are normal numbers.
const SIDES: std::ops::RangeInclusive<f64> = 1e-100..=1e100;

/// What is filled together, by one rule.
#[derive(Clone, Debug)]
pub(super) struct Region {
    /// Polylines; as areas they are closed.
    pub(super) lines: Vec<Vec<Point>>,
    /// Whether what an even number of lines surround is outside; else what they surround in sum no times, with their
    /// sense.
    pub(super) even_odd: bool,
}

/// A path as it was read, and its rule.
#[derive(Clone, Debug)]
pub(super) struct Curves {
    pub(super) path: BezPath,
    pub(super) even_odd: bool,
}

/// Curves as polylines, moved and scaled so that all of it just fits within 1 x 1, from the origin; turned upside down
/// where y counts downwards.
pub(super) fn regions(curves: &[Curves], y_is_down: bool) -> Result<Vec<Region>, DrawingError> {
    let boxes =
        curves.iter().filter(|curves| curves.path.segments().next().is_some()).map(|curves| curves.path.bounding_box());
    let whole = boxes.reduce(|a: Rect, b| a.union(b)).ok_or(DrawingError::Empty)?;
    let side = whole.width().max(whole.height());
    if !(whole.is_finite() && side.is_finite()) || side > *SIDES.end() {
        return Err(DrawingError::NotFinite);
    }
    if side < *SIDES.start() {
        return Err(DrawingError::Empty);
    }
    let (scale, top) = if y_is_down { (-1.0 / side, whole.y1) } else { (1.0 / side, whole.y0) };
    let fit = Affine::scale_non_uniform(1.0 / side, scale) * Affine::translate((-whole.x0, -top));
    Ok(curves
        .iter()
        .map(|Curves { path, even_odd }| Region { lines: polylines(&(fit * path)), even_odd: *even_odd })
        .collect())
}

fn polylines(path: &BezPath) -> Vec<Vec<Point>> {
    let rounded = |point: kurbo::Point| [point.x, point.y].map(|x| (x * GRID).round() / GRID);
    let mut lines: Vec<Vec<Point>> = Vec::new();
    kurbo::flatten(path, TOLERANCE, |element| match element {
        PathEl::MoveTo(point) => lines.push(vec![rounded(point)]),
        PathEl::ClosePath => {
            if let Some(line) = lines.last_mut()
                && let Some(&first) = line.first()
            {
                line.push(first);
            }
        }
        other => {
            if let (Some(line), Some(point)) = (lines.last_mut(), other.end_point()) {
                line.push(rounded(point));
            }
        }
    });
    lines.retain(|line| line.len() > 1);
    lines
}
