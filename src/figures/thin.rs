//! Lines without the points that nobody can see.

/// Farthest that a point left out may lie from the line that is drawn \[tenths of a pixel\].
const TOLERANCE: f64 = 1.0;

/// The points of a line that show: every point left out lies within [`TOLERANCE`] of the line through the others
/// (Ramer 1972, Douglas and Peucker 1973). `pixels` maps a point to the drawing. The ends are kept, so are extremes.
pub(super) fn thinned<P: Copy>(points: &[P], pixels: impl Fn(P) -> (f64, f64)) -> Vec<P> {
    let on_paper: Vec<_> = points.iter().map(|&point| pixels(point)).collect();
    let Some(end) = points.len().checked_sub(1) else { return Vec::new() };
    let mut kept = vec![false; points.len()];
    (kept[0], kept[end]) = (true, true);
    let mut stretches = vec![(0, end)];
    while let Some((from, to)) = stretches.pop() {
        let farthest = (from + 1..to)
            .map(|k| (k, distance(on_paper[k], on_paper[from], on_paper[to])))
            .fold((from, TOLERANCE), |farthest, candidate| if candidate.1 > farthest.1 { candidate } else { farthest });
        if farthest.0 != from {
            kept[farthest.0] = true;
            stretches.extend([(from, farthest.0), (farthest.0, to)]);
        }
    }
    points.iter().zip(kept).filter_map(|(&point, kept)| kept.then_some(point)).collect()
}

/// Distance of a point from the segment between two others.
fn distance(point: (f64, f64), from: (f64, f64), to: (f64, f64)) -> f64 {
    let (along_x, along_y) = (to.0 - from.0, to.1 - from.1);
    let (x, y) = (point.0 - from.0, point.1 - from.1);
    let length_squared = along_x * along_x + along_y * along_y;
    let share = if length_squared > 0.0 { ((x * along_x + y * along_y) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
    (x - share * along_x).hypot(y - share * along_y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_straight_line_is_its_ends_and_a_spike_stays() {
        let line: Vec<_> = (0..1000).map(|k| (f64::from(k), 0.5 * f64::from(k))).collect();
        assert_eq!(thinned(&line, |p| p), [line[0], line[999]]);
        let mut spiked = line.clone();
        spiked[500].1 += 20.0;
        assert!(thinned(&spiked, |p| p).contains(&spiked[500]));
        assert_eq!(thinned(&spiked, |(x, y)| (x / 100.0, y / 100.0)).len(), 2, "too small to be seen");
    }

    #[test]
    fn no_point_left_out_is_farther_from_the_line_than_the_tolerance() {
        let curve: Vec<_> = (0..2000).map(|k| f64::from(k) * 0.5).map(|x| (x, 300.0 * (x / 80.0).sin())).collect();
        let kept = thinned(&curve, |p| p);
        assert!(kept.len() < curve.len() / 4, "{} of {}", kept.len(), curve.len());
        for &point in &curve {
            let nearest = kept.windows(2).map(|ends| distance(point, ends[0], ends[1])).fold(f64::INFINITY, f64::min);
            assert!(nearest <= TOLERANCE, "{point:?} is {nearest} off");
        }
    }

    #[test]
    fn nothing_one_point_and_points_in_one_place_are_lines_too() {
        assert!(thinned::<(f64, f64)>(&[], |p| p).is_empty());
        assert_eq!(thinned(&[(1.0, 2.0)], |p| p), [(1.0, 2.0)]);
        assert_eq!(thinned(&[(1.0, 2.0); 9], |p| p).len(), 2);
    }
}
