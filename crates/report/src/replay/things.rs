//! Obstacles as a page holds them.

use std::collections::BinaryHeap;

use nalgebra::Vector3;
use serde::Serialize;

use super::bytes::singles;
use super::extent::Extent;
use super::mesh::Mesh;
use super::words::{LONGEST_NAME, cut};
use tautline_audit::{Obstacle, Shape};

/// What is in the way.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Thing {
    name: String,
    /// Of a ball \[m\], which has no triangles.
    radius_m: Option<f64>,
    /// Triangles, and lines, in single precision from its place \[m\].
    solid: String,
    rims: String,
    opacity: f64,
    /// When \[s\] it is where \[m\].
    path: Vec<[f64; 4]>,
    /// Most that it is drawn off its way \[m\].
    #[serde(skip)]
    pub(super) off_m: f64,
}

/// Bytes that a point of a way takes, at most.
pub(super) const POINT_BYTES: usize = 4 * 26;

impl Thing {
    /// As it is drawn, on a way of so many points and where it was at these times \[s\].
    pub(super) fn of(obstacle: &Obstacle, extent: &Extent, times_s: &[f64], most: usize) -> Self {
        let place_m = obstacle.path.first().map_or(Vector3::zeros(), |point| point.1);
        let mesh = Mesh::of(&obstacle.shape, extent.middle_m() - place_m, 1.5 * extent.reach_m());
        let (kept, off_m) = simplified(&obstacle.path, times_s, most);
        let points = kept.into_iter().map(|k| obstacle.path[k]);
        let (radius_m, opacity) = match obstacle.shape {
            Shape::Ball { radius_m } => (Some(radius_m), 1.0),
            Shape::Capsule { .. } => (None, 1.0),
            Shape::Box { .. } => (None, 0.5),
            Shape::HalfSpace { .. } => (None, 0.14),
        };
        Self {
            name: cut(&obstacle.name, LONGEST_NAME),
            radius_m,
            solid: singles(&mesh.solid),
            rims: singles(&mesh.rims),
            opacity,
            path: points.map(|(time_s, at)| [time_s, at.x, at.y, at.z]).collect(),
            off_m,
        }
    }
}

/// A part of a way between two points that are kept, and where it is farthest from the straight line between them.
#[derive(Clone, Copy, Debug)]
struct Part {
    off_m: f64,
    from: usize,
    farthest: usize,
    to: usize,
}

impl Part {
    fn new(path: &[(f64, Vector3<f64>)], from: usize, to: usize) -> Self {
        let ((from_s, a), (to_s, b)) = (path[from], path[to]);
        let off_m = |k: usize| {
            let (time_s, at) = path[k];
            (at - (a + (b - a) * ((time_s - from_s) / (to_s - from_s)))).norm()
        };
        let none = Self { off_m: 0.0, from, farthest: from, to };
        let off = (from + 1..to).map(|farthest| Self { off_m: off_m(farthest), farthest, ..none });
        off.fold(none, |a, b| if b.off_m > a.off_m { b } else { a })
    }
}

impl PartialEq for Part {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Part {}

impl PartialOrd for Part {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Part {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.off_m.total_cmp(&other.off_m).then(other.from.cmp(&self.from))
    }
}

/// Points of a way that are kept, at most about so many: the first and the last, those around these times, and then time and
/// again the one that is farthest off. And how far off any other is \[m\].
fn simplified(path: &[(f64, Vector3<f64>)], times_s: &[f64], most: usize) -> (Vec<usize>, f64) {
    let Some(last) = path.len().checked_sub(1) else { return (Vec::new(), 0.0) };
    let around = times_s.iter().flat_map(|&at_s| {
        let after = path.partition_point(|point| point.0 < at_s);
        [after.saturating_sub(1), after.min(last)]
    });
    let mut kept: Vec<_> = [0, last].into_iter().chain(around.take(most / 2)).collect();
    kept.sort_unstable();
    kept.dedup();
    let mut parts: BinaryHeap<_> = kept.windows(2).map(|two| Part::new(path, two[0], two[1])).collect();
    while kept.len() < most && parts.peek().is_some_and(|part| part.off_m > 0.0) {
        let Some(Part { from, farthest, to, .. }) = parts.pop() else { break };
        kept.push(farthest);
        parts.extend([Part::new(path, from, farthest), Part::new(path, farthest, to)]);
    }
    kept.sort_unstable();
    (kept, parts.peek().map_or(0.0, |part| part.off_m))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_long_way_the_points_that_matter_are_kept_and_how_far_off_it_is_drawn_is_known() {
        // At rest but for a leap of five points.
        let x = |k: u32| if (2003..2008).contains(&k) { 5.0 } else { 0.0 };
        let path: Vec<_> = (0..5000).map(|k| (f64::from(k), Vector3::new(x(k), 0.0, 0.0))).collect();
        let (kept, off_m) = simplified(&path, &[], 100);
        assert_eq!((kept, off_m), (vec![0, 2002, 2003, 2007, 2008, 4999], 0.0));
        let circle = |k: u32| (f64::from(k) * 0.01).sin_cos();
        let path: Vec<_> = (0..5000).map(|k| (f64::from(k), Vector3::new(circle(k).0, circle(k).1, 0.0))).collect();
        let (kept, off_m) = simplified(&path, &[1234.5], 50);
        assert!(kept.len() == 50 && kept.contains(&1234) && kept.contains(&1235), "{kept:?}");
        assert!((0.01..1.5).contains(&off_m), "{off_m}");
        let line = |at: f64| {
            let k = kept.partition_point(|&k| (k as f64) < at).max(1);
            let (a, b) = (path[kept[k - 1]], path[kept[k]]);
            a.1 + (b.1 - a.1) * ((at - a.0) / (b.0 - a.0))
        };
        let farthest_m = path.iter().map(|&(at_s, at)| (line(at_s) - at).norm()).fold(0.0, f64::max);
        assert!((farthest_m - off_m).abs() < 1e-9, "{farthest_m} and {off_m}");
        assert_eq!(simplified(&[], &[0.0], 9), (Vec::new(), 0.0));
    }
}
