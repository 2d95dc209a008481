//! Lines without the corners that nobody can see.

use super::svg::Point;

/// Farthest that a corner left out may lie from the line that is drawn \[px\], unless there would be too many.
const TOLERANCE: f64 = 0.1;
/// Most corners of a drawing, the ends of its lines not counted: some 120 kB.
const MOST_CORNERS: usize = 12_000;

/// The corners of lines that show: every corner left out lies within a tolerance of the line through the others
/// (Ramer 1972, Douglas and Peucker 1973). The tolerance is a tenth of a pixel, and as much larger as it takes to keep at
/// most [`MOST_CORNERS`]. The ends are kept, so are extremes.
pub(super) fn thinned<T>(mut lines: Vec<(T, Vec<Point>)>) -> Vec<(T, Vec<Point>)> {
    let weights: Vec<_> = lines.iter().map(|(_, points)| weights(points)).collect();
    let mut corners: Vec<f64> = weights.iter().flatten().copied().filter(|weight| weight.is_finite()).collect();
    corners.retain(|&weight| weight > TOLERANCE);
    let tolerance = match corners.len().checked_sub(MOST_CORNERS + 1) {
        Some(dropped) => *corners.select_nth_unstable_by(dropped, f64::total_cmp).1,
        None => TOLERANCE,
    };
    for ((_, points), weights) in lines.iter_mut().zip(weights) {
        let mut weights = weights.into_iter();
        points.retain(|_| weights.next().is_some_and(|weight| weight > tolerance));
    }
    lines
}

/// The largest tolerance \[px\] that keeps each point of a line; 0 where it is below [`TOLERANCE`].
fn weights(points: &[Point]) -> Vec<f64> {
    let mut weights = vec![0.0; points.len()];
    let Some(end) = points.len().checked_sub(1) else { return weights };
    (weights[0], weights[end]) = (f64::INFINITY, f64::INFINITY);
    let mut stretches = vec![(0, end)];
    while let Some((from, to)) = stretches.pop() {
        let farthest = (from + 1..to)
            .map(|k| (k, distance(points[k], points[from], points[to])))
            .fold((from, TOLERANCE), |farthest, candidate| if candidate.1 > farthest.1 { candidate } else { farthest });
        if farthest.0 != from {
            // A point is only looked at where both ends of its stretch are kept.
            weights[farthest.0] = farthest.1.min(weights[from]).min(weights[to]);
            stretches.extend([(from, farthest.0), (farthest.0, to)]);
        }
    }
    weights
}

/// Distance of a point from the segment between two others.
fn distance(point: Point, from: Point, to: Point) -> f64 {
    let (along_x, along_y) = (to.0 - from.0, to.1 - from.1);
    let (x, y) = (point.0 - from.0, point.1 - from.1);
    let length_squared = along_x * along_x + along_y * along_y;
    let share = if length_squared > 0.0 { ((x * along_x + y * along_y) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
    (x - share * along_x).hypot(y - share * along_y)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn thinned_line(points: &[Point]) -> Vec<Point> {
        thinned(vec![((), points.to_vec())]).remove(0).1
    }

    #[test]
    fn a_straight_line_is_its_ends_and_a_spike_stays() {
        let line: Vec<_> = (0..1000).map(|k| (f64::from(k), 0.5 * f64::from(k))).collect();
        assert_eq!(thinned_line(&line), [line[0], line[999]]);
        let mut spiked = line.clone();
        spiked[500].1 += 2.0;
        assert!(thinned_line(&spiked).contains(&spiked[500]));
        spiked[500].1 -= 1.95;
        assert_eq!(thinned_line(&spiked).len(), 2, "too small to be seen");
    }

    #[test]
    fn no_point_left_out_is_farther_from_the_line_than_the_tolerance() {
        let curve: Vec<_> = (0..2000).map(|k| f64::from(k) * 0.05).map(|x| (x, 30.0 * (x / 8.0).sin())).collect();
        let kept = thinned_line(&curve);
        assert!(kept.len() < curve.len() / 4, "{} of {}", kept.len(), curve.len());
        for &point in &curve {
            let nearest = kept.windows(2).map(|ends| distance(point, ends[0], ends[1])).fold(f64::INFINITY, f64::min);
            assert!(nearest <= TOLERANCE, "{point:?} is {nearest} off");
        }
    }

    #[test]
    fn of_too_many_corners_the_farthest_stay() {
        let noise = |k: u32, height: f64| (f64::from(k), if k.is_multiple_of(2) { 0.0 } else { height });
        let lines = vec![
            ("high", (0..9001).map(|k| noise(k, 50.0)).collect()),
            ("low", (0..9001).map(|k| noise(k, 2.0)).collect::<Vec<_>>()),
        ];
        let thinned = thinned(lines);
        let corners = thinned.iter().map(|(_, points)| points.len() - 2).sum::<usize>();
        assert!(corners <= MOST_CORNERS, "{corners}");
        assert!(thinned[0].1.len() > 8000 && thinned[1].1.len() < 8000);
    }

    #[test]
    fn nothing_one_point_and_points_in_one_place_are_lines_too() {
        assert!(thinned_line(&[]).is_empty());
        assert_eq!(thinned_line(&[(1.0, 2.0)]), [(1.0, 2.0)]);
        assert_eq!(thinned_line(&[(1.0, 2.0); 9]).len(), 2);
    }
}
