//! Fence: a polygon seen from above with optional heights, in which vehicles must stay.

use nalgebra::{Vector2, Vector3};

use crate::ledger::Interruption;
use crate::sweep::MAX_LENGTH_M;

/// Largest number of corners: every edge is compared with every other.
const MAX_CORNERS: usize = 4096;
/// Relative precision of a distance outside the fence.
const RESOLUTION: f64 = 1e-9;
/// Largest number of parts of a line outside that are examined.
const MAX_PARTS: usize = 100;

/// Polygon in the plane of x and y, convex or not, with an optional range of heights, in which every vehicle must stay.
#[derive(Clone, Debug, PartialEq)]
pub struct Fence {
    corners_m: Vec<Vector2<f64>>,
    /// Whether vehicles must stay outside the polygon.
    is_exclusion: bool,
    /// Further polygons, each inside or outside.
    more: Vec<Fence>,
    height_m: Option<[f64; 2]>,
    margin_m: f64,
}

/// Error in the definition of a fence.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FenceError {
    /// The number of corners is out of range.
    #[error("a fence must have 3 to {MAX_CORNERS} corners, got {0}")]
    Corners(usize),
    /// A number is not finite or too large.
    #[error("{what} of the fence must be a finite number below 1e70, got {value:?}")]
    Number {
        /// Name of the number.
        what: String,
        /// Value.
        value: f64,
    },
    /// Two consecutive corners have the same position.
    #[error("corners {0} and {1} of the fence have the same position")]
    SamePosition(usize, usize),
    /// Two edges cross or touch, identified by their first corners.
    #[error("the edges of the fence from corner {0} and from corner {1} cross or touch; list the corners in order")]
    Crosses(usize, usize),
    /// The range of heights is empty.
    #[error("the heights of the fence must increase, got {from_m:?} m and {to_m:?} m")]
    Heights {
        /// Lower height \[m\].
        from_m: f64,
        /// Upper height \[m\].
        to_m: f64,
    },
    /// The margin is negative.
    #[error("the margin of the fence must be at least 0 m, got {0:?} m")]
    Margin(f64),
}

impl Fence {
    /// Creates a fence through these corners \[m\], clockwise or counter-clockwise, with an optional range of heights
    /// \[m\]. Vehicles must stay at least `margin_m` inside.
    ///
    /// # Errors
    /// [`FenceError`] if the polygon is not simple, or a number is out of range.
    pub fn new(corners_m: &[[f64; 2]], height_m: Option<[f64; 2]>, margin_m: f64) -> Result<Self, FenceError> {
        let mut corners_m: Vec<_> = corners_m.iter().map(|&[x, y]| Vector2::new(x, y)).collect();
        // A first corner repeated at the end closes the polygon.
        if corners_m.len() > 3 && corners_m.first() == corners_m.last() {
            corners_m.pop();
        }
        let count = corners_m.len();
        if !(3..=MAX_CORNERS).contains(&count) {
            return Err(FenceError::Corners(count));
        }
        let number = |what: String, value: f64| {
            let is_one = value.abs() <= MAX_LENGTH_M;
            if is_one { Ok(()) } else { Err(FenceError::Number { what, value }) }
        };
        for (k, corner) in corners_m.iter().enumerate() {
            corner.iter().try_for_each(|&value| number(format!("corner {}", k + 1), value))?;
        }
        height_m.iter().flatten().try_for_each(|&value| number("a height".to_owned(), value))?;
        number("the margin".to_owned(), margin_m)?;
        if margin_m < 0.0 {
            return Err(FenceError::Margin(margin_m));
        }
        if let Some([from_m, to_m]) = height_m.filter(|[from_m, to_m]| from_m >= to_m) {
            return Err(FenceError::Heights { from_m, to_m });
        }
        let fence = Self { corners_m, is_exclusion: false, more: Vec::new(), height_m, margin_m };
        fence.check_edges()?;
        Ok(fence)
    }

    /// Returns the polygon, seen from above, as one that vehicles must stay outside of.
    #[must_use]
    pub fn as_exclusion(self) -> Self {
        Self { is_exclusion: true, ..self }
    }

    /// Returns the fence with further polygons. Every polygon applies.
    #[must_use]
    pub fn with(mut self, more: Vec<Self>) -> Self {
        self.more.extend(more);
        self
    }

    fn check_edges(&self) -> Result<(), FenceError> {
        let count = self.corners_m.len();
        let edges: Vec<_> = self.edges().collect();
        for (first, one) in edges.iter().enumerate() {
            if one[0] == one[1] {
                return Err(FenceError::SamePosition(first + 1, (first + 1) % count + 1));
            }
            for (second, other) in edges.iter().enumerate().skip(first + 1) {
                let are_neighbours = second == first + 1 || (first == 0 && second == count - 1);
                let meet = if are_neighbours {
                    // Neighbours share a corner. They overlap further only if one runs back along the other.
                    let (shared, [a, b]) =
                        if second == first + 1 { (one[1], [one[0], other[1]]) } else { (one[0], [one[1], other[0]]) };
                    let (a, b) = (a - shared, b - shared);
                    a.perp(&b) == 0.0 && a.dot(&b) > 0.0
                } else {
                    distance(*one, *other) == 0.0
                };
                if meet {
                    return Err(FenceError::Crosses(first + 1, second + 1));
                }
            }
        }
        Ok(())
    }

    /// Returns whether the fence is one polygon that vehicles must stay inside of.
    #[must_use]
    pub fn is_single_inclusion(&self) -> bool {
        self.more.is_empty() && !self.is_exclusion
    }

    /// Distance that vehicles must keep from the fence \[m\].
    #[must_use]
    pub fn margin_m(&self) -> f64 {
        self.margin_m
    }

    /// Lowest and highest allowed height \[m\], if given.
    #[must_use]
    pub fn height_m(&self) -> Option<[f64; 2]> {
        self.height_m
    }

    /// Corners seen from above \[m\].
    #[must_use]
    pub fn corners_m(&self) -> &[Vector2<f64>] {
        &self.corners_m
    }

    /// Returns the smallest clearance margin \[m\] of a vehicle on a straight line between two positions: its distance
    /// from the nearest wall, floor or ceiling, negative outside.
    #[must_use]
    pub fn clearance_margin_m(&self, from: Vector3<f64>, to: Vector3<f64>) -> f64 {
        self.margin_until(from, to, &Interruption::default())
    }

    /// As [`clearance_margin_m`](Self::clearance_margin_m); returns an arbitrary number after an interruption.
    pub(super) fn margin_until(&self, from: Vector3<f64>, to: Vector3<f64>, interruption: &Interruption) -> f64 {
        if interruption.is_set() {
            return f64::INFINITY;
        }
        let across = self.margin_across(from.xy(), to.xy(), interruption);
        let others = self.more.iter().map(|other| other.margin_until(from, to, interruption));
        let across = others.fold(across, f64::min);
        self.height_m.map_or(across, |[low, high]| {
            let (least, most) = (from.z.min(to.z), from.z.max(to.z));
            across.min(least - low).min(high - most)
        })
    }

    fn edges(&self) -> impl Iterator<Item = [Vector2<f64>; 2]> + '_ {
        let next = self.corners_m.iter().cycle().skip(1);
        self.corners_m.iter().zip(next).map(|(&from, &to)| [from, to])
    }

    fn margin_across(&self, from: Vector2<f64>, to: Vector2<f64>, interruption: &Interruption) -> f64 {
        let wall_m = self.edges().map(|edge| distance(edge, [from, to])).fold(f64::INFINITY, f64::min);
        if wall_m > 0.0 && self.contains(from) {
            return wall_m;
        }
        // At least a part of the line is outside.
        let mut crossings: Vec<f64> = self.edges().filter_map(|edge| crossing([from, to], edge)).collect();
        crossings.extend([0.0, 1.0]);
        crossings.sort_unstable_by(f64::total_cmp);
        let parts = crossings.windows(2).map(|pair| [pair[0], pair[1]]);
        let parts = parts.take_while(|_| !interruption.is_set());
        let is_outside = |&[start, end]: &[f64; 2]| !self.contains(from.lerp(&to, 0.5 * (start + end)));
        let farthest =
            parts.filter(is_outside).map(|[start, end]| self.farthest_m(from.lerp(&to, start), from.lerp(&to, end)));
        0.0 - farthest.fold(0.0, f64::max)
    }

    /// Returns the largest distance from the fence of a line that is outside \[m\]. The distance from one edge is a
    /// convex function of the position, so over a part of the line it is largest at an end. Parts are bisected until
    /// the least of these distances is reached.
    fn farthest_m(&self, from: Vector2<f64>, to: Vector2<f64>) -> f64 {
        let mut farthest_m = self.wall_m(from).max(self.wall_m(to));
        let (mut open, mut examined) = (vec![[from, to]], 0);
        while let Some([from, to]) = open.pop() {
            let upper_m =
                self.edges().map(|edge| from_edge(from, edge).max(from_edge(to, edge))).fold(f64::INFINITY, f64::min);
            examined += 1;
            if upper_m > farthest_m * (1.0 + RESOLUTION) && examined < MAX_PARTS {
                let middle = from.lerp(&to, 0.5);
                farthest_m = farthest_m.max(self.wall_m(middle));
                open.extend([[from, middle], [middle, to]]);
            }
        }
        farthest_m
    }

    fn wall_m(&self, place: Vector2<f64>) -> f64 {
        self.edges().map(|edge| from_edge(place, edge)).fold(f64::INFINITY, f64::min)
    }

    /// Returns whether a position is on the allowed side of the polygon.
    fn contains(&self, place: Vector2<f64>) -> bool {
        self.surrounds(place) != self.is_exclusion
    }

    /// Returns whether a position is inside: a ray along x crosses an odd number of edges.
    fn surrounds(&self, place: Vector2<f64>) -> bool {
        let crosses = |[a, b]: [Vector2<f64>; 2]| {
            (a.y > place.y) != (b.y > place.y) && {
                // The position is left of an edge that goes up, or right of one that goes down.
                let side = (b - a).perp(&(place - a));
                if b.y > a.y { side > 0.0 } else { side < 0.0 }
            }
        };
        self.edges().filter(|&edge| crosses(edge)).count() % 2 == 1
    }
}

/// Returns the fraction of a line at which it crosses an edge.
fn crossing([from, to]: [Vector2<f64>; 2], [a, b]: [Vector2<f64>; 2]) -> Option<f64> {
    let (line, edge) = (to - from, b - a);
    let turn = line.perp(&edge);
    let u = (a - from).perp(&edge) / turn;
    let along = (a - from).perp(&line) / turn;
    ((0.0..=1.0).contains(&u) && (0.0..=1.0).contains(&along)).then_some(u)
}

/// Returns the distance of a position from an edge.
fn from_edge(place: Vector2<f64>, [a, b]: [Vector2<f64>; 2]) -> f64 {
    let edge = b - a;
    let squared = edge.norm_squared();
    let along = if squared > 0.0 { ((place - a).dot(&edge) / squared).clamp(0.0, 1.0) } else { 0.0 };
    (place - (a + edge * along)).norm()
}

/// Returns the distance of two line segments.
fn distance(one: [Vector2<f64>; 2], other: [Vector2<f64>; 2]) -> f64 {
    if crossing(one, other).is_some() {
        return 0.0;
    }
    let ends = |of: [Vector2<f64>; 2], from: [Vector2<f64>; 2]| from_edge(of[0], from).min(from_edge(of[1], from));
    ends(one, other).min(ends(other, one))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns an L-shaped fence: the square from 0 to 10 without its upper right quarter.
    fn l_shape() -> Fence {
        let corners = [[0.0, 0.0], [10.0, 0.0], [10.0, 5.0], [5.0, 5.0], [5.0, 10.0], [0.0, 10.0], [0.0, 0.0]];
        Fence::new(&corners, Some([0.0, 20.0]), 0.0).expect("a fence")
    }

    fn margin(from: [f64; 3], to: [f64; 3]) -> f64 {
        l_shape().clearance_margin_m(Vector3::from(from), Vector3::from(to))
    }

    #[test]
    fn the_margin_is_that_of_the_nearest_wall_floor_or_ceiling() {
        assert_eq!(margin([2.0, 2.5, 10.0], [8.0, 2.5, 10.0]), 2.0);
        assert_eq!(margin([2.0, 2.5, 1.0], [8.0, 2.5, 10.0]), 1.0);
        assert_eq!(margin([2.0, 2.5, 3.0], [8.0, 2.5, 19.5]), 0.5);
        assert_eq!(margin([2.0, 2.0, 10.0], [2.0, 2.0, 10.0]), 2.0);
    }

    #[test]
    fn a_line_that_cuts_a_corner_is_outside_in_between() {
        let cut = margin([9.0, 4.0, 10.0], [4.0, 9.0, 10.0]);
        // The middle of the line is (6.5, 6.5), 1.5 m from either wall.
        assert!((cut + 1.5).abs() < 1e-12, "{cut}");
        assert!(margin([4.0, 4.0, 10.0], [4.5, 4.5, 10.0]) > 0.0);
    }

    #[test]
    fn the_margin_is_negative_outside_and_zero_on_the_wall() {
        assert_eq!(margin([12.0, 2.0, 10.0], [12.0, 2.0, 10.0]), -2.0);
        assert_eq!(margin([2.0, 2.0, 10.0], [2.0, 2.0, 21.0]), -1.0);
        assert_eq!(margin([0.0, 1.0, 10.0], [0.0, 9.0, 10.0]), 0.0);
        assert_eq!(margin([-3.0, 2.0, 10.0], [13.0, 2.0, 10.0]), -3.0);
        // Along a wall, and past it: the farthest point is neither an end nor the middle.
        assert_eq!(margin([12.0, 1.0, 10.0], [12.0, 4.0, 10.0]), -2.0);
        let past = margin([10.0, 5.5, 10.0], [5.5, 10.0, 10.0]);
        assert!((past + 2.75).abs() < 1e-8, "{past}");
        let (low, high) = (Vector3::new(9.0, 5.5, 10.0), Vector3::new(6.0, 9.5, 10.0));
        let sampled = (0..=3000)
            .map(|k| low.lerp(&high, f64::from(k) / 3000.0))
            .map(|place| l_shape().clearance_margin_m(place, place));
        let sampled = sampled.fold(0.0, f64::min);
        let computed = l_shape().clearance_margin_m(low, high);
        assert!(computed <= sampled + 1e-12 && sampled - computed < 1e-3, "{computed} {sampled}");
    }

    #[test]
    fn the_order_of_the_corners_may_be_reversed() {
        let reversed: Vec<_> = l_shape().corners_m.iter().rev().map(|corner| [corner.x, corner.y]).collect();
        let reversed = Fence::new(&reversed, None, 0.0).expect("a fence");
        for (x, y) in [(1.0, 1.0), (7.0, 7.0), (-1.0, 2.0), (4.999, 9.0), (9.9, 4.9)] {
            let place = Vector3::new(x, y, 5.0);
            assert_eq!(
                reversed.clearance_margin_m(place, place).signum(),
                l_shape().clearance_margin_m(place, place).signum()
            );
        }
    }

    #[test]
    fn all_of_several_polygons_apply() {
        let pool = Fence::new(&[[1.0, 1.0], [3.0, 1.0], [3.0, 3.0], [1.0, 3.0]], None, 0.0).expect("a fence");
        let fence = l_shape().with(vec![pool.as_exclusion()]);
        let margin =
            |x: f64, y: f64, to: f64| fence.clearance_margin_m(Vector3::new(x, y, 10.0), Vector3::new(to, y, 10.0));
        assert_eq!((margin(4.0, 2.0, 4.0), margin(2.0, 2.0, 2.0)), (1.0, -1.0));
        // Across the pool between two allowed positions, and past it.
        assert!((margin(0.5, 2.0, 4.0) + 1.0).abs() < 1e-9);
        assert_eq!(margin(0.5, 4.0, 4.0), 0.5);
    }

    #[test]
    fn an_invalid_fence_is_refused_with_its_corner() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let bow_tie = [[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]];
        let refused = |corners: &[[f64; 2]]| Fence::new(corners, None, 0.0).expect_err("no fence");
        assert_eq!(refused(&bow_tie), FenceError::Crosses(1, 3));
        assert_eq!(refused(&square[..2]), FenceError::Corners(2));
        assert_eq!(refused(&[[0.0, 0.0], [0.0, 0.0], [1.0, 0.0]]), FenceError::SamePosition(1, 2));
        assert_eq!(refused(&[[0.0, 0.0], [2.0, 0.0], [1.0, 0.0]]), FenceError::Crosses(1, 2));
        assert!(matches!(refused(&[[f64::NAN, 0.0], [2.0, 0.0], [1.0, 1.0]]), FenceError::Number { .. }));
        assert!(matches!(Fence::new(&square, Some([2.0, 2.0]), 0.0), Err(FenceError::Heights { .. })));
        assert!(matches!(Fence::new(&square, None, -1.0), Err(FenceError::Margin(_))));
    }
}
