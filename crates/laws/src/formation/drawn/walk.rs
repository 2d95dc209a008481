//! Sample points on lines and inside areas, in an order in which neighbours stay near.

use super::mask::Mask;
use super::outline::Point;

/// Order of the curve that walks the inside of a raster: 2^16 pixels a side.
const ORDER: u8 = 16;

/// Points at equal steps along polylines, from half a step after the first end on, and the step; none without length.
pub(super) fn along(lines: &[&[Point]], points: usize) -> (Vec<Point>, f64) {
    let pieces =
        || lines.iter().flat_map(|line| line.windows(2).map(|ends| (ends[0], ends[1], length(ends[0], ends[1]))));
    let whole: f64 = pieces().map(|(.., length)| length).sum();
    let step = whole / points as f64;
    let mut walked = Vec::with_capacity(points);
    let mut before = 0.0;
    for (from, to, length) in pieces().filter(|&(.., length)| length > 0.0) {
        while walked.len() < points {
            let part = ((walked.len() as f64 + 0.5) * step - before) / length;
            if part > 1.0 {
                break;
            }
            walked.push([0, 1].map(|axis| from[axis] + (to[axis] - from[axis]) * part));
        }
        before += length;
    }
    (walked, step)
}

fn length([x0, y0]: Point, [x1, y1]: Point) -> f64 {
    libm::hypot(x1 - x0, y1 - y0)
}

/// Points inside what is drawn: `count` of the middles of its pixels, or of equal parts of them, the others evenly
/// left out; with them the side of a part. None where nothing is drawn.
pub(super) fn inside(mask: &Mask, count: usize) -> (Vec<Point>, f64) {
    let drawn = mask.count();
    let parts = (1..=count.isqrt() + 1).find(|parts| drawn * parts * parts >= count).unwrap_or(1);
    let mut places: Vec<[usize; 2]> = mask
        .pixels()
        .flat_map(|[x, y]| (0..parts * parts).map(move |part| [x * parts + part % parts, y * parts + part / parts]))
        .collect();
    places.sort_by_cached_key(|&[x, y]| fast_hilbert::xy2h(clamped(x), clamped(y), ORDER));
    let side = mask.side / parts as f64;
    let kept = places.len().min(count);
    let points = (0..kept).map(|i| places[(2 * i + 1) * places.len() / (2 * kept)].map(|x| (x as f64 + 0.5) * side));
    (points.collect(), side)
}

fn clamped(place: usize) -> u32 {
    u32::try_from(place).unwrap_or(u32::MAX)
}
