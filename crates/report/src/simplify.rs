//! Simplification of a line by its farthest points (Ramer 1972, Douglas and Peucker 1973).

/// Returns the points of a line that a simplification needs besides the `kept` points, each with the largest tolerance
/// that needs it. `kept` is in ascending order.
///
/// `off(k, from, to)` is the distance of point `k` from the line between two other points. Distances of at most `least`
/// need no point. A point follows the ends of its part in the result, and their tolerance is at least as large. The
/// line through all points with a tolerance above a bound therefore deviates by at most that bound.
pub(crate) fn needed(kept: &[usize], least: f64, off: impl Fn(usize, usize, usize) -> f64) -> Vec<(usize, f64)> {
    let mut parts: Vec<_> = kept.windows(2).map(|ends| (ends[0], ends[1], f64::INFINITY)).collect();
    let mut needed = Vec::new();
    while let Some((from, to, most)) = parts.pop() {
        let points = (from + 1..to).map(|k| (k, off(k, from, to)));
        let (farthest, off) = points.fold((from, least), |a, b| if b.1 > a.1 { b } else { a });
        if farthest != from {
            let tolerance = off.min(most);
            needed.push((farthest, tolerance));
            parts.extend([(from, farthest, tolerance), (farthest, to, tolerance)]);
        }
    }
    needed
}
