//! Obstacles: their paths, and distances from them.

use nalgebra::Vector3;

use super::segment::Segment;
use super::sweep::{MAX_LENGTH_M, RelativeMotion};
use tautline_core::obstacle::{Obstacle, Shape};

/// Bound of the time before the first and after the last point of a path, during which the obstacle stands still \[s\].
const ALWAYS_S: f64 = 1e300;
/// Largest computed distance from a box, relative to the coordinates, at which a path may still enter the box.
const INSIDE: f64 = 1e-9;

/// Object on a path that vehicles must stay clear of.
///
/// A vehicle must stay [`clearance_m`](Self::clearance_m) away from its surface. The default is the larger of the
/// vehicle's radius and delta / 2, so that a keep-out ball may touch an obstacle as it may touch another one.
#[derive(Clone, Debug, PartialEq)]
pub struct MovingObstacle {
    /// Name.
    pub name: String,
    /// Shape.
    pub shape: Shape,
    /// Distance that a vehicle's centre must keep from the surface \[m\]; at 0 m it may touch but not enter.
    pub clearance_m: Option<f64>,
    /// Path: times \[s\] and positions \[m\]. One point for an obstacle at rest, else points at increasing times,
    /// joined by straight lines. The obstacle stands still before the first and after the last point.
    pub path: Vec<(f64, Vector3<f64>)>,
}

/// Error in the definition of an obstacle.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("obstacle `{name}`: {fault}")]
pub struct ObstacleError {
    /// Name of the obstacle.
    pub name: String,
    /// The fault.
    pub fault: ObstacleFault,
}

/// Fault of an obstacle.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ObstacleFault {
    /// The radius of a ball or capsule \[m\] is not above 0, or too large.
    #[error("the radius must be above 0 m, got {0:?}")]
    Radius(f64),
    /// A length of a box is not above 0, or too large.
    #[error("every length of the box must be above 0 m")]
    BoxLength,
    /// The yaw of a box \[deg\] is not finite.
    #[error("the yaw must be a finite number, got {0:?}")]
    Yaw(f64),
    /// An end of a capsule is not finite, or too far away.
    #[error("the ends of the capsule must be finite numbers")]
    CapsuleEnd,
    /// The normal of a half-space is zero, not finite or too long.
    #[error("the normal must not be zero")]
    Normal,
    /// The clearance \[m\] is negative, not finite or too large.
    #[error("the clearance must be at least 0 m, got {0:?}")]
    Clearance(f64),
    /// The clearance of an obstacle of a flight is 0.
    #[error("the clearance must be above 0 m")]
    NoClearance,
    /// The path has no point.
    #[error("the path has no point")]
    NoPath,
    /// The point at a time \[s\] is not finite, or too far away.
    #[error("the point at {0:?} s is not finite")]
    Point(f64),
    /// The time of a point \[s\] is not later than the time before it \[s\].
    #[error("the time {time_s:?} s of a point is not later than {before_s:?} s before it")]
    Order {
        /// Time of the point \[s\].
        time_s: f64,
        /// Time of the point before it \[s\].
        before_s: f64,
    },
}

impl From<&Obstacle> for MovingObstacle {
    fn from(obstacle: &Obstacle) -> Self {
        let Obstacle { name, place_m, shape, clearance_m } = obstacle.clone();
        Self { name, shape, clearance_m: Some(clearance_m), path: vec![(0.0, place_m)] }
    }
}

impl MovingObstacle {
    /// Checks that the obstacle can be judged.
    ///
    /// # Errors
    /// [`ObstacleError`] if a length, a position, a time or the clearance is out of range.
    pub fn check(&self) -> Result<(), ObstacleError> {
        let wrong = |fault| Err(ObstacleError { name: self.name.clone(), fault });
        let length = |x: f64| x > 0.0 && x <= MAX_LENGTH_M;
        let place = |v: &Vector3<f64>| v.iter().all(|x| x.abs() <= MAX_LENGTH_M);
        match &self.shape {
            Shape::Ball { radius_m } | Shape::Capsule { radius_m, .. } if !length(*radius_m) => {
                return wrong(ObstacleFault::Radius(*radius_m));
            }
            Shape::Box { half_m, .. } if !half_m.iter().all(|x| length(*x)) => return wrong(ObstacleFault::BoxLength),
            Shape::Box { yaw_deg, .. } if !yaw_deg.is_finite() => return wrong(ObstacleFault::Yaw(*yaw_deg)),
            Shape::Capsule { from_m, to_m, .. } if !(place(from_m) && place(to_m)) => {
                return wrong(ObstacleFault::CapsuleEnd);
            }
            Shape::HalfSpace { normal } if !length(normal.norm()) => return wrong(ObstacleFault::Normal),
            _ => {}
        }
        if let Some(clearance_m) = self.clearance_m
            && !(0.0..=MAX_LENGTH_M).contains(&clearance_m)
        {
            return wrong(ObstacleFault::Clearance(clearance_m));
        }
        let Some((_, first)) = self.path.first() else { return wrong(ObstacleFault::NoPath) };
        if self.path.len() == 1 && place(first) {
            return Ok(());
        }
        if let Some((time_s, _)) = self.path.iter().find(|(time_s, at_m)| !(time_s.is_finite() && place(at_m))) {
            return wrong(ObstacleFault::Point(*time_s));
        }
        match self.path.windows(2).find(|points| points[1].0 <= points[0].0) {
            Some(points) => wrong(ObstacleFault::Order { time_s: points[1].0, before_s: points[0].0 }),
            None => Ok(()),
        }
    }

    /// Returns whether the section at height 0 equals the outline seen from above, at all times. Then no height brings
    /// a vehicle nearer to the obstacle than height 0.
    #[must_use]
    pub fn is_upright_through_ground(&self) -> bool {
        let holds_0 = |from: f64, to: f64| from.min(to) <= 0.0 && 0.0 <= from.max(to);
        self.path.iter().all(|(_, point)| match self.shape {
            Shape::Ball { .. } => point.z == 0.0,
            Shape::Box { half_m, .. } => holds_0(point.z - half_m.z, point.z + half_m.z),
            Shape::Capsule { from_m, to_m, .. } => {
                let (from, to) = (point.z + from_m.z, point.z + to_m.z);
                let (is_vertical, is_level) = (from_m.xy() == to_m.xy(), from == to);
                (is_vertical || is_level) && holds_0(from, to)
            }
            Shape::HalfSpace { normal } => normal.z == 0.0,
        })
    }

    /// Returns whether another unit of time changes the motion of the obstacle.
    #[must_use]
    pub fn rests_on_seconds(&self) -> bool {
        let Self { name: _, shape: _, clearance_m: _, path } = self;
        path.len() > 1
    }

    /// Returns the obstacle with all lengths but the normal multiplied by a factor.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        let shape = match self.shape {
            Shape::Ball { radius_m } => Shape::Ball { radius_m: radius_m * factor },
            Shape::Box { half_m, yaw_deg } => Shape::Box { half_m: half_m * factor, yaw_deg },
            Shape::Capsule { from_m, to_m, radius_m } => {
                Shape::Capsule { from_m: from_m * factor, to_m: to_m * factor, radius_m: radius_m * factor }
            }
            Shape::HalfSpace { normal } => Shape::HalfSpace { normal },
        };
        let path = self.path.iter().map(|&(time_s, place_m)| (time_s, place_m * factor)).collect();
        Self { name: self.name.clone(), shape, clearance_m: self.clearance_m.map(|m| m * factor), path }
    }

    /// Returns the path as segments, including the times before its first and after its last point.
    pub(super) fn segments(&self) -> Vec<Segment> {
        let (Some(&(_, first)), Some(&(last_s, last))) = (self.path.first(), self.path.last()) else {
            return Vec::new();
        };
        let [(first_s, _), _, ..] = self.path[..] else {
            return vec![Segment::straight(-ALWAYS_S, ALWAYS_S, first, first)];
        };
        let mut path = vec![Segment::straight(-ALWAYS_S, first_s, first, first)];
        path.extend(self.path.windows(2).map(|ends| Segment::straight(ends[0].0, ends[1].0, ends[0].1, ends[1].1)));
        path.push(Segment::straight(last_s, ALWAYS_S, last, last));
        path
    }
}

/// Returns the distance of a point from the surface \[m\], negative inside. The point is relative to the obstacle's
/// position.
pub(super) fn distance(shape: &Shape, point: Vector3<f64>) -> f64 {
    if let Shape::HalfSpace { normal } = shape {
        return point.dot(&normal.normalize());
    }
    let point = in_box_frame(shape, point);
    let off = offset_from_core(shape, point).norm();
    match shape {
        Shape::Box { half_m, .. } if off == 0.0 => (point.abs() - half_m).max(),
        _ => off - radius(shape),
    }
}

/// Returns the smallest distance of a point on a straight path, and the fraction of the path at which it is first
/// reached.
///
/// The core of a shape is a point, a line segment or a box. The vector from the nearest point of the core to the
/// moving point is linear in the fraction between changes of the nearest feature. Each part has a closed form.
pub(super) fn closest(shape: &Shape, from: Vector3<f64>, to: Vector3<f64>) -> (f64, f64) {
    if let Shape::HalfSpace { .. } = shape {
        let (start, end) = (distance(shape, from), distance(shape, to));
        return if end < start { (end, 1.0) } else { (start, 0.0) };
    }
    let (from, to) = (in_box_frame(shape, from), in_box_frame(shape, to));
    let position = |u: f64| if u >= 1.0 { to } else { from + (to - from) * u };
    let mut best = (f64::INFINITY, 0.0);
    let mut start = (0.0, offset_from_core(shape, from));
    for u in feature_changes(shape, from, to).into_iter().chain([1.0]) {
        let end = (u, offset_from_core(shape, position(u)));
        let part = RelativeMotion::new(start.1, end.1).closest();
        if part.squared < best.0 {
            best = (part.squared, start.0 + (end.0 - start.0) * part.at);
        }
        start = end;
    }
    let outside = (best.0.sqrt() - radius(shape), best.1);
    let Shape::Box { half_m, .. } = shape else { return outside };
    // The ends of the part inside the box are rounded and may lie outside.
    let rounding = INSIDE * (from.amax() + to.amax() + half_m.amax());
    if outside.0 > rounding {
        return outside;
    }
    let inside = deepest(half_m, from, to);
    if inside.0 <= 0.0 { inside } else { outside }
}

/// Returns the radius around the core \[m\].
pub(super) fn radius(shape: &Shape) -> f64 {
    match shape {
        Shape::Ball { radius_m } | Shape::Capsule { radius_m, .. } => *radius_m,
        Shape::Box { .. } | Shape::HalfSpace { .. } => 0.0,
    }
}

/// Transforms a point into the frame in which a box is not rotated.
pub(super) fn in_box_frame(shape: &Shape, point: Vector3<f64>) -> Vector3<f64> {
    match shape {
        Shape::Box { yaw_deg, .. } if *yaw_deg != 0.0 => {
            let yaw_rad = yaw_deg.to_radians();
            let (sin, cos) = (libm::sin(yaw_rad), libm::cos(yaw_rad));
            Vector3::new(cos * point.x + sin * point.y, cos * point.y - sin * point.x, point.z)
        }
        _ => point,
    }
}

/// Returns the vector from the nearest point of the core to a point.
fn offset_from_core(shape: &Shape, point: Vector3<f64>) -> Vector3<f64> {
    match shape {
        Shape::Ball { .. } | Shape::HalfSpace { .. } => point,
        Shape::Box { half_m, .. } => point.zip_map(half_m, |x, half| x - x.clamp(-half, half)),
        Shape::Capsule { from_m, to_m, .. } => {
            let (along, aside) = (to_m - from_m, point - from_m);
            let squared = along.norm_squared();
            let share = if squared > 0.0 { (aside.dot(&along) / squared).clamp(0.0, 1.0) } else { 0.0 };
            aside - along * share
        }
    }
}

/// Returns the fractions of a straight path at which the nearest feature changes, in order.
fn feature_changes(shape: &Shape, from: Vector3<f64>, to: Vector3<f64>) -> Vec<f64> {
    let by = to - from;
    let mut found = Vec::new();
    let mut cross = |start: f64, rate: f64| {
        let u = -start / rate;
        if u > 0.0 && u < 1.0 {
            found.push(u);
        }
    };
    match shape {
        Shape::Ball { .. } | Shape::HalfSpace { .. } => {}
        Shape::Box { half_m, .. } => {
            for axis in 0..3 {
                cross(from[axis] - half_m[axis], by[axis]);
                cross(from[axis] + half_m[axis], by[axis]);
            }
        }
        Shape::Capsule { from_m, to_m, .. } => {
            let along = to_m - from_m;
            let (start, rate) = ((from - from_m).dot(&along), by.dot(&along));
            cross(start, rate);
            cross(start - along.norm_squared(), rate);
        }
    }
    found.sort_unstable_by(f64::total_cmp);
    found
}

/// Returns the largest depth of a straight path in a box that it meets, as a negative distance, and the first fraction
/// of the path at which it is reached.
///
/// The distance from each of the six faces is linear in the fraction. The largest of them is least at an end of the
/// path or where two of them cross.
fn deepest(half_m: &Vector3<f64>, from: Vector3<f64>, to: Vector3<f64>) -> (f64, f64) {
    let by = to - from;
    let faces: [(f64, f64); 6] = std::array::from_fn(|face| {
        let (axis, sign) = (face / 2, if face % 2 == 0 { 1.0 } else { -1.0 });
        (sign * from[axis] - half_m[axis], sign * by[axis])
    });
    let depth = |u: f64| faces.iter().map(|(start, rate)| start + rate * u).fold(f64::NEG_INFINITY, f64::max);
    let crossings =
        faces.iter().enumerate().flat_map(|(k, a)| faces[..k].iter().map(move |b| (b.0 - a.0) / (a.1 - b.1)));
    let within = crossings.filter(|u| (0.0..=1.0).contains(u)).chain([1.0]);
    within.map(|u| (depth(u), u)).fold((depth(0.0), 0.0), |best, other| {
        let sooner = other.0 == best.0 && other.1 < best.1;
        if other.0 < best.0 || sooner { other } else { best }
    })
}

/// Returns one shape of each kind.
#[cfg(test)]
pub(super) fn one_of_each() -> [Shape; 4] {
    [
        Shape::Ball { radius_m: 0.7 },
        Shape::Box { half_m: Vector3::new(1.0, 0.5, 2.0), yaw_deg: 34.0 },
        Shape::Capsule { from_m: Vector3::new(-1.0, 0.0, 0.0), to_m: Vector3::new(1.0, 1.0, 0.5), radius_m: 0.3 },
        Shape::HalfSpace { normal: Vector3::new(0.0, 3.0, 4.0) },
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_distance_of_a_straight_path_matches_fine_sampling() {
        const STEPS: u32 = 20_000;
        // A step moves less than 1e-3 m, and the distance changes by no more than the point moves.
        const TOLERANCE_M: f64 = 1e-3;
        for shape in one_of_each() {
            for k in 0..40_u32 {
                let turn = f64::from(k) * 2.4;
                let from = Vector3::new(3.0 * turn.cos(), 3.0 * turn.sin(), 0.1 * f64::from(k) - 2.0);
                let to = Vector3::new(-3.0 * (turn + 0.4).cos(), -2.0 * turn.sin(), 1.5 - 0.07 * f64::from(k));
                let (found, u) = closest(&shape, from, to);
                let sampled =
                    (0..=STEPS).map(|s| distance(&shape, from + (to - from) * (f64::from(s) / f64::from(STEPS))));
                let sampled = sampled.fold(f64::INFINITY, f64::min);
                assert!(found <= sampled + 1e-12 && sampled - found < TOLERANCE_M, "{shape:?}: {found} {sampled}");
                assert!((distance(&shape, from + (to - from) * u) - found).abs() < 1e-12, "{shape:?}");
            }
        }
    }

    #[test]
    fn a_path_through_a_box_is_as_deep_as_its_deepest_sample() {
        let mut state = 1_u64;
        let mut random = |low: f64, high: f64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            // Few decimals let edges of the box and ends of the path coincide.
            ((low + (high - low) * ((state >> 11) as f64 / (1_u64 << 53) as f64)) * 10.0).round() / 10.0
        };
        let mut entered = 0;
        for _ in 0..20_000 {
            let half_m = Vector3::from_fn(|_, _| random(0.1, 3.0));
            let yaw_deg = if random(0.0, 1.0) < 0.5 { 0.0 } else { random(-180.0, 180.0) };
            let shape = Shape::Box { half_m, yaw_deg };
            let [from, to] = [0; 2].map(|_| Vector3::from_fn(|_, _| random(-9.0, 9.0)));
            let (found, u) = closest(&shape, from, to);
            let sampled = (0..=40).map(|s| distance(&shape, from + (to - from) * (f64::from(s) / 40.0)));
            let sampled = sampled.fold(f64::INFINITY, f64::min);
            assert!(found <= sampled + 1e-12, "{shape:?} {from:?} {to:?}: {found} {sampled}");
            assert!((distance(&shape, from + (to - from) * u) - found).abs() < 1e-12, "{shape:?} {from:?} {to:?}");
            entered += u32::from(found < 0.0);
        }
        assert!(entered > 1000, "{entered}");
    }

    #[test]
    fn an_obstacle_with_invalid_size_position_or_times_is_refused() {
        let good = MovingObstacle {
            name: "tower".to_owned(),
            shape: Shape::Ball { radius_m: 1.0 },
            clearance_m: None,
            path: vec![(0.0, Vector3::zeros()), (1.0, Vector3::x())],
        };
        assert_eq!(good.check(), Ok(()));
        assert_eq!(MovingObstacle { clearance_m: Some(0.0), ..good.clone() }.check(), Ok(()));
        for wrong in [
            MovingObstacle { shape: Shape::Ball { radius_m: 0.0 }, ..good.clone() },
            MovingObstacle { shape: Shape::Box { half_m: Vector3::new(1.0, -1.0, 1.0), yaw_deg: 0.0 }, ..good.clone() },
            MovingObstacle { shape: Shape::HalfSpace { normal: Vector3::zeros() }, ..good.clone() },
            MovingObstacle { clearance_m: Some(f64::NAN), ..good.clone() },
            MovingObstacle { clearance_m: Some(-1e-300), ..good.clone() },
            MovingObstacle { path: vec![], ..good.clone() },
            MovingObstacle { path: vec![(1.0, Vector3::zeros()), (1.0, Vector3::x())], ..good.clone() },
            MovingObstacle { path: vec![(0.0, Vector3::repeat(f64::NAN))], ..good.clone() },
        ] {
            assert!(wrong.check().is_err(), "{wrong:?}");
        }
    }
}
