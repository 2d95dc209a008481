//! Reference motion of a formation, and the vehicles that know it.

use nalgebra::Vector3;

use crate::graph::Pinning;

/// Reference motion at one instant, in the frame of the positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reference {
    /// Position r \[m\].
    pub position_m: Vector3<f64>,
    /// Velocity r' \[m/s\].
    pub velocity_m_s: Vector3<f64>,
    /// Acceleration r'' \[m/s^2\].
    pub acceleration_m_s2: Vector3<f64>,
}

impl Reference {
    /// Reference at rest at the origin: slots stay where they are given.
    #[must_use]
    pub fn at_rest() -> Self {
        Self::at(Vector3::zeros())
    }

    /// Reference at rest at a position \[m\].
    #[must_use]
    pub fn at(position_m: Vector3<f64>) -> Self {
        Self { position_m, velocity_m_s: Vector3::zeros(), acceleration_m_s2: Vector3::zeros() }
    }
}

/// Reference of a run: its motion, the vehicles that know it, and feed-forward.
#[derive(Clone, Debug, PartialEq)]
pub struct Guidance {
    /// Motion r(t).
    pub motion: ReferenceMotion,
    /// Vehicles that know r and r'. A leader flies it.
    pub known_by: Pinning,
    /// Whether r'' - a22 r' is fed forward to every vehicle.
    pub feed_forward: bool,
}

/// Motion r(t) with continuous velocity.
#[derive(Clone, Debug, PartialEq)]
pub enum ReferenceMotion {
    /// At rest.
    Rest {
        /// Position \[m\].
        position_m: Vector3<f64>,
    },
    /// Straight line at constant velocity.
    Velocity {
        /// Position at time 0 \[m\].
        from_m: Vector3<f64>,
        /// Velocity r' \[m/s\].
        velocity_m_s: Vector3<f64>,
    },
    /// Circle in a plane of constant z, counterclockwise seen from above, starting at the point of largest x.
    Circle {
        /// Centre of the circle \[m\].
        centre_m: Vector3<f64>,
        /// Radius \[m\].
        radius_m: f64,
        /// Period of one turn \[s\]; negative for clockwise.
        period_s: f64,
    },
    /// From rest to rest between points along straight lines: s(x) = 10 x^3 - 15 x^4 + 6 x^5 of the distance at the
    /// fraction x of the time. The largest speed is 15/8 of the mean. At rest before the first and after the last
    /// point.
    WayPoints {
        /// Times \[s\] and positions \[m\], in order of time.
        points: Vec<(f64, Vector3<f64>)>,
    },
    /// Natural cubic spline through points of a table: r'' is continuous, and zero at both ends.
    Table(Spline),
}

impl ReferenceMotion {
    /// Returns the reference at a time of the run \[s\]. A table continues straight beyond its ends.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Reference {
        match self {
            &Self::Rest { position_m } => Reference::at(position_m),
            &Self::Velocity { from_m, velocity_m_s } => {
                Reference { velocity_m_s, ..Reference::at(from_m + velocity_m_s * time_s) }
            }
            &Self::Circle { centre_m, radius_m, period_s } => {
                let rate_per_s = std::f64::consts::TAU / period_s;
                let (sin, cos) = libm::sincos(rate_per_s * time_s);
                let arm_m = Vector3::new(radius_m * cos, radius_m * sin, 0.0);
                Reference {
                    position_m: centre_m + arm_m,
                    velocity_m_s: Vector3::new(-arm_m.y, arm_m.x, 0.0) * rate_per_s,
                    acceleration_m_s2: arm_m * -(rate_per_s * rate_per_s),
                }
            }
            Self::WayPoints { points } => between_way_points(points, time_s),
            Self::Table(spline) => spline.at(time_s),
        }
    }

    /// Returns an upper bound of the distance from the position at time 0, up to a time \[m\].
    #[must_use]
    pub fn reach_m(&self, until_s: f64) -> f64 {
        let start_m = self.at(0.0).position_m;
        let away_m = |points: &mut dyn Iterator<Item = Vector3<f64>>| {
            points.map(|point| (point - start_m).norm()).fold(0.0, f64::max)
        };
        match self {
            Self::Rest { .. } => 0.0,
            Self::Velocity { velocity_m_s, .. } => velocity_m_s.norm() * until_s,
            Self::Circle { radius_m, .. } => 2.0 * radius_m,
            Self::WayPoints { points } => away_m(&mut points.iter().map(|&(_, point)| point)),
            // Between its points a spline stays within some 1.2 of their span; beyond the last point it is straight.
            Self::Table(spline) => {
                2.0 * away_m(&mut spline.rows.iter().map(|row| row.position_m))
                    + (self.at(until_s).position_m - start_m).norm()
            }
        }
    }

    /// Returns the shortest time scale of the motion \[s\]: a quarter period of a circle, the time between two way
    /// points, or twice the shortest time between two table points.
    #[must_use]
    pub fn shortest_s(&self) -> f64 {
        let least = |times_s: &mut dyn Iterator<Item = f64>| {
            let mut before_s = None;
            let lengths = times_s.filter_map(|time_s| before_s.replace(time_s).map(|before_s| time_s - before_s));
            lengths.fold(f64::INFINITY, f64::min)
        };
        match self {
            Self::Rest { .. } | Self::Velocity { .. } => f64::INFINITY,
            Self::Circle { period_s, .. } => 0.25 * period_s.abs(),
            Self::WayPoints { points } => least(&mut points.iter().map(|&(time_s, _)| time_s)),
            Self::Table(spline) => 2.0 * least(&mut spline.rows.iter().map(|row| row.time_s)),
        }
    }

    /// Whether the motion stays in the plane z = 0.
    #[must_use]
    pub fn is_level(&self) -> bool {
        match self {
            Self::Rest { position_m } => position_m.z == 0.0,
            Self::Velocity { from_m, velocity_m_s } => from_m.z == 0.0 && velocity_m_s.z == 0.0,
            Self::Circle { centre_m, .. } => centre_m.z == 0.0,
            Self::WayPoints { points } => points.iter().all(|(_, point)| point.z == 0.0),
            Self::Table(spline) => spline.rows.iter().all(|row| row.position_m.z == 0.0),
        }
    }

    /// Whether the motion never accelerates.
    #[must_use]
    pub fn is_uniform(&self) -> bool {
        matches!(self, Self::Rest { .. } | Self::Velocity { .. })
    }

    /// Whether the reference never moves.
    #[must_use]
    pub fn is_at_rest(&self) -> bool {
        match self {
            Self::Rest { .. } => true,
            Self::Velocity { velocity_m_s, .. } => velocity_m_s.norm() == 0.0,
            _ => false,
        }
    }
}

/// Returns the reference between way points in order of time.
fn between_way_points(points: &[(f64, Vector3<f64>)], time_s: f64) -> Reference {
    let next = points.partition_point(|&(at_s, _)| at_s <= time_s);
    let (before, after) = (next.checked_sub(1).and_then(|k| points.get(k)), points.get(next));
    match (before, after) {
        (Some(&(from_s, from_m)), Some(&(to_s, to_m))) => {
            let (length_s, way_m) = (to_s - from_s, to_m - from_m);
            let x = (time_s - from_s) / length_s;
            let share = x * x * x * (10.0 + x * (6.0 * x - 15.0));
            let speed = 30.0 * x * x * (1.0 - x) * (1.0 - x);
            let bend = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x);
            Reference {
                position_m: from_m + way_m * share,
                velocity_m_s: way_m * (speed / length_s),
                acceleration_m_s2: way_m * (bend / (length_s * length_s)),
            }
        }
        (Some(&(_, place_m)), None) | (None, Some(&(_, place_m))) => Reference::at(place_m),
        (None, None) => Reference::at_rest(),
    }
}

/// Natural cubic spline through points in time.
#[derive(Clone, Debug, PartialEq)]
pub struct Spline {
    rows: Vec<Knot>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Knot {
    time_s: f64,
    position_m: Vector3<f64>,
    /// Acceleration r'' at the knot \[m/s^2\].
    bend_m_s2: Vector3<f64>,
}

impl Spline {
    /// Builds the spline through these points; `None` unless there is at least one, all are finite and times \[s\]
    /// increase.
    #[must_use]
    pub fn through(points: &[(f64, Vector3<f64>)]) -> Option<Self> {
        let finite = |&(time_s, place): &(f64, Vector3<f64>)| time_s.is_finite() && place.iter().all(|x| x.is_finite());
        let grow = points.windows(2).all(|pair| pair[0].0 < pair[1].0);
        if points.is_empty() || !grow || !points.iter().all(finite) {
            return None;
        }
        let mut rows: Vec<_> = points
            .iter()
            .map(|&(time_s, position_m)| Knot { time_s, position_m, bend_m_s2: Vector3::zeros() })
            .collect();
        solve_bends(&mut rows);
        Some(Self { rows })
    }

    /// Returns the points: time \[s\] and position \[m\].
    pub fn points(&self) -> impl Iterator<Item = (f64, Vector3<f64>)> + '_ {
        self.rows.iter().map(|row| (row.time_s, row.position_m))
    }

    fn at(&self, time_s: f64) -> Reference {
        let [first, .., last] = &self.rows[..] else {
            return self.rows.first().map_or_else(Reference::at_rest, |only| Reference::at(only.position_m));
        };
        if time_s < first.time_s || time_s > last.time_s {
            let end = if time_s < first.time_s { first } else { last };
            let there = self.within(end.time_s);
            let position_m = end.position_m + there.velocity_m_s * (time_s - end.time_s);
            return Reference { position_m, acceleration_m_s2: Vector3::zeros(), ..there };
        }
        self.within(time_s)
    }

    fn within(&self, time_s: f64) -> Reference {
        let last = self.rows.len() - 1;
        let next = self.rows.partition_point(|row| row.time_s <= time_s).clamp(1, last);
        let (a, b) = (&self.rows[next - 1], &self.rows[next]);
        let length_s = b.time_s - a.time_s;
        let (left, right) = ((b.time_s - time_s) / length_s, (time_s - a.time_s) / length_s);
        let sixth = length_s * length_s / 6.0;
        Reference {
            position_m: a.position_m * left
                + b.position_m * right
                + (a.bend_m_s2 * (left * left * left - left) + b.bend_m_s2 * (right * right * right - right)) * sixth,
            velocity_m_s: (b.position_m - a.position_m) / length_s
                + (b.bend_m_s2 * (3.0 * right * right - 1.0) - a.bend_m_s2 * (3.0 * left * left - 1.0))
                    * (length_s / 6.0),
            acceleration_m_s2: a.bend_m_s2 * left + b.bend_m_s2 * right,
        }
    }
}

/// Computes r'' at every knot, zero at both ends, from the tridiagonal system of a natural spline.
fn solve_bends(rows: &mut [Knot]) {
    let count = rows.len();
    let mut shares = vec![0.0; count];
    for k in 1..count.saturating_sub(1) {
        let (before_s, after_s) = (rows[k].time_s - rows[k - 1].time_s, rows[k + 1].time_s - rows[k].time_s);
        let slope = |a: &Knot, b: &Knot, length_s: f64| (b.position_m - a.position_m) / length_s;
        let turn = (slope(&rows[k], &rows[k + 1], after_s) - slope(&rows[k - 1], &rows[k], before_s)) * 6.0;
        let pivot = 2.0 * (before_s + after_s) - before_s * shares[k - 1];
        shares[k] = after_s / pivot;
        rows[k].bend_m_s2 = (turn - rows[k - 1].bend_m_s2 * before_s) / pivot;
    }
    for k in (1..count.saturating_sub(1)).rev() {
        let next = rows[k + 1].bend_m_s2;
        rows[k].bend_m_s2 -= next * shares[k];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn motions() -> Vec<ReferenceMotion> {
        let point = |x: f64, y: f64, z: f64| Vector3::new(x, y, z);
        let points = vec![
            (0.0, point(0.0, 0.0, 0.0)),
            (2.0, point(3.0, -1.0, 0.5)),
            (5.0, point(-1.0, 2.0, 0.0)),
            (9.0, point(1.0, 1.0, 1.0)),
        ];
        vec![
            ReferenceMotion::Rest { position_m: point(1.0, 2.0, 3.0) },
            ReferenceMotion::Velocity { from_m: point(1.0, 0.0, 0.0), velocity_m_s: point(0.5, -0.25, 0.0) },
            ReferenceMotion::Circle { centre_m: point(1.0, 1.0, 2.0), radius_m: 3.0, period_s: -7.0 },
            ReferenceMotion::WayPoints { points: points.clone() },
            ReferenceMotion::Table(Spline::through(&points).expect("a spline")),
        ]
    }

    #[test]
    fn velocity_and_acceleration_are_the_derivatives_of_the_position() {
        const STEP_S: f64 = 1e-4;
        for motion in motions() {
            for k in 0..110 {
                // Avoids the knots, where the third derivative jumps.
                let time_s = 0.0137 + 0.1 * f64::from(k);
                let [before, now, after] = [-STEP_S, 0.0, STEP_S].map(|off_s| motion.at(time_s + off_s));
                let slope = (after.position_m - before.position_m) / (2.0 * STEP_S);
                let bend = (after.velocity_m_s - before.velocity_m_s) / (2.0 * STEP_S);
                assert!((slope - now.velocity_m_s).norm() < 1e-6, "{motion:?} at {time_s}");
                assert!((bend - now.acceleration_m_s2).norm() < 1e-6, "{motion:?} at {time_s}");
            }
        }
    }

    #[test]
    fn points_are_passed_at_their_times_within_the_reach() {
        for motion in motions() {
            if let ReferenceMotion::WayPoints { points } = &motion {
                for &(at_s, place_m) in points {
                    let there = motion.at(at_s);
                    assert_eq!((there.position_m, there.velocity_m_s.norm()), (place_m, 0.0));
                }
            }
            if let ReferenceMotion::Table(spline) = &motion {
                assert!(spline.points().all(|(at_s, place_m)| (motion.at(at_s).position_m - place_m).norm() < 1e-12));
            }
            let reach_m = motion.reach_m(12.0);
            let start_m = motion.at(0.0).position_m;
            assert!((0..=120).all(|k| (motion.at(0.1 * f64::from(k)).position_m - start_m).norm() <= reach_m + 1e-12));
        }
    }

    #[test]
    fn a_spline_through_a_line_is_the_line_and_times_must_increase() {
        let line: Vec<_> = [0.0, 1.0, 2.5, 4.0].map(|t| (t, Vector3::new(2.0 * t, -t, 1.0))).to_vec();
        let spline = ReferenceMotion::Table(Spline::through(&line).expect("a spline"));
        for time_s in [-1.0, 0.3, 2.0, 7.0] {
            let there = spline.at(time_s);
            assert!((there.position_m - Vector3::new(2.0 * time_s, -time_s, 1.0)).norm() < 1e-12);
            assert!(there.acceleration_m_s2.norm() < 1e-12);
        }
        let place = Vector3::zeros();
        assert_eq!(Spline::through(&[(0.0, place), (0.0, place)]), None);
        assert_eq!(Spline::through(&[(0.0, place), (f64::NAN, place)]), None);
        assert_eq!(Spline::through(&[]), None);
    }
}
