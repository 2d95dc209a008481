//! Brake of a vehicle: where it comes to rest, and the command that brings it there.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::saved::vector;

/// Position and velocity of a vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// Position \[m\].
    #[serde(with = "vector")]
    pub position_m: Vector3<f64>,
    /// Velocity \[m/s\].
    #[serde(with = "vector")]
    pub velocity_m_s: Vector3<f64>,
}

impl State {
    /// Returns a state at rest.
    #[must_use]
    pub fn at_rest(position_m: Vector3<f64>) -> Self {
        Self { position_m, velocity_m_s: Vector3::zeros() }
    }

    /// Returns the state after `seconds` of constant acceleration \[m/s^2\].
    #[inline]
    #[must_use]
    pub fn after(&self, acceleration: Vector3<f64>, seconds: f64) -> Self {
        Self {
            position_m: self.position_m + self.velocity_m_s * seconds + acceleration * (seconds * seconds / 2.0),
            velocity_m_s: self.velocity_m_s + acceleration * seconds,
        }
    }

    /// Whether all numbers are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.position_m.iter().chain(self.velocity_m_s.iter()).all(|value| value.is_finite())
    }
}

/// Brake in commands that are held over a period: full deceleration against the velocity for whole periods, and what is
/// left of the speed in the last period.
///
/// # Stop point
/// From (p, v) the brake ends at s = p + v G(|v|). Let b be the deceleration, h the period and
/// m = floor(|v| / (b h)):
///
/// ```text
/// G(0) = h/2,   G(|v|) = h (m + 1/2) - b h^2 m (m + 1) / (2 |v|)
/// ```
///
/// The m whole periods cover m h |v| - b h^2 m^2 / 2. The last period starts at |v| - m b h and covers half of that
/// times h. The sum is |v| G(|v|). G is continuous and does not decrease. |v| G(|v|) is convex and piecewise linear.
///
/// # Reservation
/// Lemma 1: the brake runs along the segment from p to s, and the segment after a period of brake is a part of it.
/// If |v| > b h, a period leads to a state with m - 1 whole periods left, and with the same stop point s:
///
/// ```text
/// p' = p + v h (1 - b h / (2 |v|)),   v' = v (1 - b h / |v|)
/// v h - v b h^2 / (2 |v|) + v' G(|v'|) = v G(|v|)
/// ```
///
/// Otherwise the vehicle stops at p + v h / 2 = s.
///
/// After a period of any command u the path of that period is a quadratic Bezier curve with the control points p, p + v
/// h / 2 and p+. The second point lies in the segment from p to s because G >= h/2. A half-space with p, s, p+ and the
/// stop point after the period therefore contains the path of the period and the whole brake after it.
///
/// # Irregular instants
/// With [`Brake::irregular`] a command is held over any time T in \[`h-`, H\], which is known only at its end. The
/// command of the brake is then that of the period H: it never reverses the vehicle. In the last phase, |v| <= b H, it
/// leaves the speed v (1 - T/H), so the distance of the brake depends on the times. With c = H - `h-` / 2, let
///
/// ```text
/// D(v) = c v  for v <= b c,   D(v) = v^2 / (2 b) + b c^2 / 2  for v >= b c,   G = D / v
/// ```
///
/// D is convex with a continuous slope, and D(v) >= c v for all v. The stop point is s = p + v G(|v|). Claim: for any T
/// the way w of the time T and the speed v' after it have w + D(v') <= D(v). So the next s is on the segment from p to
/// s, and the segment after any time of the brake is a part of it: Lemma 1 holds.
///
/// - **v > b H.** The way is (v^2 - v'^2) / (2 b), and D(v') <= v'^2 / (2 b) + b c^2 / 2 for each v'.
/// - **v <= b H.** The way is v T (1 - T / (2 H)), and v' = v (1 - T/H) <= b (H - `h-`) <= b c, so D(v') = c v'. Then
///   w + D(v') = c v + v T (`h-` - T) / (2 H) <= c v <= D(v).
///
/// For another command u the path until T is a part of the curve with the control points p, p + v H / 2 and p+ at the
/// time H. The second one is in the segment from p to s, because G >= c >= H/2. So p, s and p+ at the time H inside a
/// half-space put the path inside for every T. The stop point s(T) moves with T. Its second derivative is at most
/// |u| (1 + |u| / b), so it exceeds the chord from s(`h-`) to s(H) by at most [`Brake::bend_m`]:
///
/// ```text
/// (H - h-)^2 / 8 |u| (1 + |u| / b)
/// ```
///
/// For this, v G(|v|) has the second derivative D'' `u_r`^2 + G' `u_t`^2 along v and 2 G' `u_r` `u_t` across, where
/// `u_r` and `u_t` are the parts of u. With D'' <= 1/b and G' <= 1/(2 b) its length is at most |u|^2 / b.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brake {
    /// Deceleration \[m/s^2\].
    deceleration_m_s2: f64,
    /// Longest time over which a command is held \[s\].
    period_s: f64,
    /// Speed that a period of full brake removes \[m/s\].
    removed_m_s: f64,
    /// Shortest time over which a command is held, and c \[s\]. `None` if each command is held over a period.
    irregular: Option<Irregular>,
}

/// Shortest time over which a command is held, and stop distance over the speed at small speeds.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Irregular {
    /// \[s\].
    shortest_s: f64,
    /// Constant c \[s\].
    slow_s: f64,
}

impl Brake {
    /// Returns the brake of this deceleration \[m/s^2\] and period \[s\], both positive.
    #[must_use]
    pub fn new(deceleration_m_s2: f64, period_s: f64) -> Self {
        Self { deceleration_m_s2, period_s, removed_m_s: deceleration_m_s2 * period_s, irregular: None }
    }

    /// Returns the brake of this deceleration \[m/s^2\] where a command is held between a shortest and a longest time
    /// \[s\], all positive.
    #[must_use]
    pub fn irregular(deceleration_m_s2: f64, shortest_s: f64, longest_s: f64) -> Self {
        let irregular = Irregular { shortest_s, slow_s: longest_s - shortest_s / 2.0 };
        Self { irregular: (shortest_s < longest_s).then_some(irregular), ..Self::new(deceleration_m_s2, longest_s) }
    }

    /// Shortest time over which a command is held \[s\].
    #[must_use]
    pub fn shortest_s(&self) -> f64 {
        self.irregular.map_or(self.period_s, |irregular| irregular.shortest_s)
    }

    /// Returns a bound on the distance of the stop point after a command \[m/s^2\] from the segment between those after
    /// the shortest and the longest time \[m\].
    #[must_use]
    pub fn bend_m(&self, command_m_s2: f64) -> f64 {
        let Some(Irregular { shortest_s, .. }) = self.irregular else { return 0.0 };
        let spread_s = self.period_s - shortest_s;
        spread_s * spread_s / 8.0 * command_m_s2 * (1.0 + command_m_s2 / self.deceleration_m_s2)
    }

    /// Deceleration \[m/s^2\].
    #[must_use]
    pub fn deceleration_m_s2(&self) -> f64 {
        self.deceleration_m_s2
    }

    /// Returns G, the stop distance over the speed \[s\].
    #[inline]
    #[must_use]
    pub fn glide_s(&self, speed_m_s: f64) -> f64 {
        if let Some(Irregular { slow_s, .. }) = self.irregular {
            let slow_m_s = self.deceleration_m_s2 * slow_s;
            return if speed_m_s <= slow_m_s {
                slow_s
            } else {
                speed_m_s / (2.0 * self.deceleration_m_s2) + slow_m_s * slow_s / (2.0 * speed_m_s)
            };
        }
        if speed_m_s < self.removed_m_s {
            return self.period_s / 2.0;
        }
        let whole = (speed_m_s / self.removed_m_s).floor();
        let lost = self.removed_m_s * self.period_s * whole * (whole + 1.0) / 2.0;
        self.period_s * (whole + 0.5) - lost / speed_m_s
    }

    /// Returns the distance to the stop point \[m\].
    #[must_use]
    pub fn distance_m(&self, speed_m_s: f64) -> f64 {
        speed_m_s * self.glide_s(speed_m_s)
    }

    /// Returns the stop point \[m\].
    #[inline]
    #[must_use]
    pub fn stop_m(&self, state: &State) -> Vector3<f64> {
        state.position_m + state.velocity_m_s * self.glide_s(state.velocity_m_s.norm())
    }

    /// Returns the command of the brake \[m/s^2\].
    #[inline]
    #[must_use]
    pub fn command(&self, velocity_m_s: &Vector3<f64>) -> Vector3<f64> {
        let speed = velocity_m_s.norm();
        let factor = if speed <= self.removed_m_s { 1.0 / self.period_s } else { self.deceleration_m_s2 / speed };
        -velocity_m_s * factor
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::Random;

    /// Steps the brake to rest; returns the rest point and the largest distance from the segment to the stop point.
    fn stepped(brake: &Brake, start: State) -> (Vector3<f64>, f64) {
        let stop = brake.stop_m(&start);
        let mut state = start;
        let mut largest = 0.0_f64;
        for _ in 0..100_000 {
            if state.velocity_m_s.norm() == 0.0 {
                break;
            }
            let next = state.after(brake.command(&state.velocity_m_s), brake.period_s);
            largest = largest.max((brake.stop_m(&next) - stop).norm());
            // Along the segment: distance covered and distance left add to the distance of the stop point.
            let split = (next.position_m - start.position_m).norm() + (stop - next.position_m).norm();
            largest = largest.max((split - (stop - start.position_m).norm()).abs());
            state = next;
            if state.velocity_m_s.norm() < 1e-14 {
                break;
            }
        }
        (state.position_m, largest)
    }

    #[test]
    fn stop_distances_known_by_hand() {
        let brake = Brake::new(2.0, 0.1);
        assert_eq!(brake.glide_s(0.0), 0.05);
        assert_eq!(brake.glide_s(0.1), 0.05);
        // 0.5 m/s: two whole periods to 0.3 and 0.1 m/s, the last one to rest; 0.04 + 0.02 + 0.005 m.
        assert!((brake.distance_m(0.5) - 0.065).abs() < 1e-15);
        assert_eq!(brake.command(&Vector3::new(0.1, 0.0, 0.0)), Vector3::new(-1.0, 0.0, 0.0));
        assert_eq!(brake.command(&Vector3::new(0.0, 3.0, 0.0)), Vector3::new(0.0, -2.0, 0.0));
    }

    #[test]
    fn the_stop_point_is_where_stepping_ends() {
        let mut random = Random::new(1);
        for _ in 0..2_000 {
            let brake = Brake::new(random.between(0.5, 6.0), random.between(0.01, 0.2));
            let start = State { position_m: random.vector(3.0), velocity_m_s: random.vector(4.0) };
            let stop = brake.stop_m(&start);
            let (end, largest) = stepped(&brake, start);
            assert!((end - stop).norm() < 1e-11, "{brake:?} {start:?}: {end} {stop}");
            assert!(largest < 1e-11, "{brake:?} {start:?}: {largest}");
        }
    }

    #[test]
    fn a_period_of_brake_keeps_the_stop_point_and_a_period_of_command_stays_in_its_hull() {
        let mut random = Random::new(2);
        for _ in 0..1_000_000 {
            let (deceleration, period) = (random.between(0.2, 8.0), random.between(0.005, 0.3));
            let brake = Brake::new(deceleration, period);
            // A third of the speeds is at the step of G, where rounding chooses the number of whole periods.
            let whole = random.between(0.0, 12.0);
            let whole = if random.chance(1.0 / 3.0) { whole.floor() } else { whole };
            let direction = random.direction();
            let state =
                State { position_m: random.vector(10.0), velocity_m_s: direction * (whole * deceleration * period) };
            let stop = brake.stop_m(&state);
            let rounding = 1e-12 * (10.0 + (stop - state.position_m).norm());

            let next = state.after(brake.command(&state.velocity_m_s), period);
            assert!((brake.stop_m(&next) - stop).norm() <= rounding, "{brake:?} {state:?}");
            let covered = (next.position_m - state.position_m).norm() + (stop - next.position_m).norm();
            assert!(covered <= (stop - state.position_m).norm() + rounding, "{brake:?} {state:?}");

            // Bezier hull: at any time of the period, any direction has an extent of at most that of p, s and p+.
            let command = random.vector(8.0);
            let end = state.after(command, period);
            let within = state.after(command, period * random.between(0.0, 1.0)).position_m;
            let normal = random.direction();
            let hull = [state.position_m, stop, end.position_m].map(|point| normal.dot(&point));
            let largest = hull.into_iter().fold(f64::NEG_INFINITY, f64::max);
            assert!(normal.dot(&within) <= largest + rounding, "{brake:?} {state:?} {command}");
        }
    }

    #[test]
    fn the_stop_distance_is_continuous_and_its_quotient_does_not_decrease() {
        let brake = Brake::new(3.0, 0.05);
        let mut last = brake.glide_s(0.0);
        for k in 1..20_000 {
            let glide = brake.glide_s(f64::from(k) * 1e-4);
            assert!(glide >= last - 1e-15 && glide - last < 1e-4, "{k}: {glide} after {last}");
            last = glide;
        }
    }

    #[test]
    fn irregular_brakes_stay_in_the_segment_and_irregular_commands_in_its_hull() {
        let mut random = Random::new(3);
        for round in 0..300_000 {
            let (deceleration, shortest) = (random.between(0.2, 8.0), random.between(0.005, 0.1));
            let longest = shortest * random.between(1.0, if round % 2 == 0 { 1.5 } else { 8.0 });
            let brake = Brake::irregular(deceleration, shortest, longest);
            // Many speeds are near the change of the formula.
            let speed = deceleration * longest * [random.between(0.0, 2.0), random.between(0.0, 12.0)][round % 2];
            let state = State { position_m: random.vector(10.0), velocity_m_s: random.direction() * speed };
            let stop = brake.stop_m(&state);
            let reserved = (stop - state.position_m).norm();
            let rounding = 1e-12 * (10.0 + reserved);
            let times = [shortest, longest, random.between(shortest, longest)];
            let seconds = times[random.index(3)];

            let next = state.after(brake.command(&state.velocity_m_s), seconds);
            assert!(next.velocity_m_s.dot(&state.velocity_m_s) >= -rounding, "{brake:?} {state:?}");
            let way = (next.position_m - state.position_m).norm();
            let left = (brake.stop_m(&next) - next.position_m).norm();
            assert!(way + left <= reserved + rounding, "{brake:?} {state:?} {seconds}");
            assert!(brake.glide_s(speed) >= longest / 2.0, "{brake:?} {speed}");

            let command = random.vector(8.0);
            let normal = random.direction();
            let extent = |point: &Vector3<f64>| normal.dot(point);
            let at = |seconds: f64| state.after(command, seconds);
            let hull = [state.position_m, stop, at(longest).position_m].map(|point| extent(&point));
            let largest = hull.into_iter().fold(f64::NEG_INFINITY, f64::max);
            let within = at(longest * random.unit()).position_m;
            assert!(extent(&within) <= largest + rounding, "{brake:?} {state:?} {command}");
            let ends = [shortest, longest].map(|seconds| extent(&brake.stop_m(&at(seconds))));
            let bound = ends[0].max(ends[1]) + brake.bend_m(command.norm());
            assert!(extent(&brake.stop_m(&at(seconds))) <= bound + rounding, "{brake:?} {state:?} {command}");
        }
    }

    #[test]
    fn a_brake_whose_times_are_equal_is_the_regular_one() {
        assert_eq!(Brake::irregular(3.0, 0.05, 0.05), Brake::new(3.0, 0.05));
        assert_eq!(Brake::new(3.0, 0.05).bend_m(5.0), 0.0);
    }
}
