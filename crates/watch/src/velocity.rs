//! Enclosure of the velocity of one vehicle, and the test whether its positions and sent velocities agree.
//!
//! # Assumptions
//!
//! The reading k has the stamp `s_k`, the position `p_k` and, if it is sent, the velocity `v_k`. The true motion x
//! satisfies three bounds, which the user declares, the source reports, or a default gives:
//!
//! ```text
//! |x(s_k) - p_k| <= eps_k      |x'(s_k) - v_k| <= e      |x''| <= A
//! ```
//!
//! Every formula below follows from these bounds alone. n is the newest reading, `T = s_n - s_k` a window of the
//! history, and u the true velocity at `s_n`. B(c, r) is the ball with the centre c and the radius r.
//!
//! # Enclosure
//!
//! The mean velocity over a window differs from the velocity at each of its ends by at most `A T / 2`. So
//!
//! ```text
//! u in B((p_n - p_k) / T, (eps_n + eps_k) / T + A T / 2)      for every window      (positions)
//! u in B(v_n, e)                                              if v_n is sent       (sent)
//! u in B(c, r + A h)      if B(c, r) encloses the velocity at the reading before, h seconds earlier
//! ```
//!
//! The velocity lies in the intersection of all these balls. The enclosure intersects two balls at a time, and takes
//! the smallest ball around the intersection. The tighter ball decides. With sent velocities it is usually a ball of a
//! sent velocity. Without them it is the ball of the window with the smallest radius.
//!
//! # Agreement
//!
//! An empty intersection contradicts the bounds. Positions that contradict each other or the acceleration are
//! [`Fault::OutOfBounds`]. Sent velocities that contradict the positions are [`Fault::VelocityDisagrees`].
//!
//! Neighbouring readings cannot show a wrong velocity, because `(eps_n + eps_k) / T` grows with the rate. So sent
//! velocities are also summed over windows. Over a step of g seconds, the trapezoidal rule has an error of at most
//! `A g^2 / 4`. So
//!
//! ```text
//! |p_n - p_k - sum of g (v + v') / 2| <= eps_n + eps_k + e T + A sum of g^2 / 4      for every window
//! |v_n - v_k| <= 2 e + A T
//! ```
//!
//! The sum runs over the readings with a velocity alone. With other readings between them, g is the time between two
//! sent velocities. The bound on the trapezoidal rule holds for it as well.
//!
//! The second bound is [`Fault::OutOfBounds`]. A velocity that is wrong by `e + b` is found at the latest when `b T` is
//! above `eps_n + eps_k + A sum of g^2 / 4`. Windows reach to `2 eps / e`, where both errors are equal, but at least to
//! [`SHORTEST_REACH_S`] and at most to [`LONGEST_REACH_S`].
//!
//! A first reading has no window, so its velocity is not tested. A first sent velocity after other readings is tested
//! against their windows alone.
//!
//! A position that is repeated without the change of a bit is no new measurement. Then the errors of both ends are
//! equal, and the summed velocities alone must be at most `e T + A sum of g^2 / 4`, with [`RESOLUTION_M`] for the
//! resolution of positions. This is tested from [`HELD_S`] on.
//!
//! # Memory
//!
//! The history has [`LEVELS`] rings of [`MARKS`] readings, and as many rings of readings with a velocity. The readings
//! of a ring are [`SPACINGS_S`] apart, so that the windows have the same lengths at every rate. Nothing is allocated
//! after the first reading.

use nalgebra::Vector3;

use crate::event::Fault;

/// Number of rings of the history.
const LEVELS: usize = 5;
/// Number of readings of a ring.
const MARKS: usize = 8;
/// Smallest time between two readings of each ring \[s\].
const SPACINGS_S: [f64; LEVELS] = [0.01, 0.04, 0.16, 0.64, 2.56];
/// Smallest length of a window that bounds a velocity \[s\].
const LEAST_WINDOW_S: f64 = 1e-6;
/// Smallest length to which windows reach \[s\].
const SHORTEST_REACH_S: f64 = 1.0;
/// Largest length to which windows reach \[s\].
const LONGEST_REACH_S: f64 = 20.0;
/// Time from which a position without the change of a bit is tested \[s\].
const HELD_S: f64 = 0.25;
/// Number of repetitions of a position from which it is tested.
const HELD_READINGS: u32 = 3;
/// Resolution of positions: two units of 1e-7 degrees of latitude \[m\].
const RESOLUTION_M: f64 = 0.025;

/// Bounds on the motion and on sent velocities.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    pub(crate) accel_m_s2: f64,
    pub(crate) velocity_error_m_s: f64,
}

/// Reading of a vehicle, with the bound on the error of its position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reading {
    pub(crate) t_s: f64,
    pub(crate) position_m: Vector3<f64>,
    pub(crate) position_error_m: f64,
    pub(crate) velocity_m_s: Option<Vector3<f64>>,
}

/// Set of velocities within a distance of a centre \[m/s\].
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ball {
    pub(crate) centre: Vector3<f64>,
    pub(crate) radius: f64,
}

impl Ball {
    fn grown(self, by: f64) -> Self {
        Self { radius: self.radius + by, ..self }
    }

    /// Returns the smallest ball around the intersection of two balls; `None` if it is empty.
    fn intersection(self, other: Self) -> Option<Self> {
        let (small, large) = if self.radius <= other.radius { (self, other) } else { (other, self) };
        let change = large.centre - small.centre;
        let distance = change.norm();
        if distance + small.radius <= large.radius {
            return Some(small);
        }
        if distance > small.radius + large.radius {
            return None;
        }
        // Both spheres meet in a plane with this distance from the centre of the small ball.
        let plane =
            (distance * distance + small.radius * small.radius - large.radius * large.radius) / (2.0 * distance);
        let rounding = 8.0 * f64::EPSILON * (large.radius + distance);
        let nearest = plane - rounding;
        if nearest <= 0.0 {
            return Some(small);
        }
        let half = (small.radius * small.radius - nearest * nearest).max(0.0).sqrt();
        let radius = (half + rounding + 1e-9 * small.radius).min(small.radius);
        Some(Self { centre: small.centre + change * (plane / distance), radius })
    }
}

impl Reading {
    fn window_s(&self, from: &Self) -> f64 {
        self.t_s - from.t_s
    }

    /// Returns the bound on the rounding of a displacement \[m\]. It covers the coordinates, and stamps that err by a
    /// unit in the last place at a speed.
    fn rounding_m(&self, speed_m_s: f64) -> f64 {
        1e-9 * (1.0 + self.position_m.amax()) + speed_m_s * 4.0 * f64::EPSILON * self.t_s.abs()
    }

    /// Returns the velocities that the positions at both ends of a window allow at each of its ends. Returns `None` for
    /// a window that is too short.
    fn quotient(&self, from: &Self, bounds: Bounds) -> Option<Ball> {
        let window_s = self.window_s(from);
        if window_s < LEAST_WINDOW_S {
            return None;
        }
        let centre = (self.position_m - from.position_m) / window_s;
        let errors_m = self.position_error_m + from.position_error_m;
        let rounding_m = self.rounding_m(centre.norm());
        Some(Ball { centre, radius: (errors_m + rounding_m) / window_s + bounds.accel_m_s2 * window_s / 2.0 })
    }

    fn sent(&self, bounds: Bounds) -> Option<Ball> {
        self.velocity_m_s.map(|centre| Ball { centre, radius: bounds.velocity_error_m_s })
    }
}

/// Reading with a velocity, and the sums of the sent velocities up to it.
#[derive(Clone, Copy, Debug)]
struct Mark {
    reading: Reading,
    velocity_m_s: Vector3<f64>,
    /// Sum of the sent velocities times their steps, by the trapezoidal rule \[m\].
    travel_m: Vector3<f64>,
    /// Sum of the squares of the steps, divided by 4 \[s^2\].
    squares_s2: f64,
}

impl Mark {
    fn first(reading: Reading, velocity_m_s: Vector3<f64>) -> Self {
        Self { reading, velocity_m_s, travel_m: Vector3::zeros(), squares_s2: 0.0 }
    }

    /// Returns the mark of the next reading with a velocity.
    fn next(&self, reading: Reading, velocity_m_s: Vector3<f64>) -> Self {
        let step_s = reading.window_s(&self.reading);
        Self {
            reading,
            velocity_m_s,
            travel_m: self.travel_m + (self.velocity_m_s + velocity_m_s) * (0.5 * step_s),
            squares_s2: self.squares_s2 + step_s * step_s / 4.0,
        }
    }

    fn window_s(&self, from: &Self) -> f64 {
        self.reading.window_s(&from.reading)
    }

    /// Returns whether the sum of the sent velocities over a window agrees with the positions at its ends.
    fn agrees(&self, from: &Self, bounds: Bounds) -> bool {
        let window_s = self.window_s(from);
        let errors_m = self.reading.position_error_m + from.reading.position_error_m;
        let most_m = errors_m
            + bounds.velocity_error_m_s * window_s
            + bounds.accel_m_s2 * (self.squares_s2 - from.squares_s2)
            + 1e-9 * self.travel_m.norm()
            + self.reading.rounding_m(self.velocity_m_s.norm() + bounds.accel_m_s2 * window_s);
        let moved_m = self.reading.position_m - from.reading.position_m;
        (moved_m - (self.travel_m - from.travel_m)).norm() <= most_m
    }

    /// Returns whether the sent velocity changed by no more than the acceleration and the errors allow.
    fn changes_within(&self, from: &Self, bounds: Bounds) -> bool {
        let most_m_s = 2.0 * bounds.velocity_error_m_s + bounds.accel_m_s2 * self.window_s(from);
        let rounding_m_s = 1e-9 * (1.0 + self.velocity_m_s.amax());
        (self.velocity_m_s - from.velocity_m_s).norm() <= most_m_s + rounding_m_s
    }

    /// Returns whether the sent velocities move the vehicle over a window in which its position was repeated.
    fn moves(&self, held: &Self, bounds: Bounds) -> bool {
        let window_s = self.window_s(held);
        let most_m = RESOLUTION_M
            + bounds.velocity_error_m_s * window_s
            + bounds.accel_m_s2 * (self.squares_s2 - held.squares_s2)
            + 1e-9 * self.travel_m.norm();
        window_s >= HELD_S && (self.travel_m - held.travel_m).norm() > most_m
    }
}

/// Item of a ring.
trait Stamped: Copy {
    fn t_s(&self) -> f64;
}

impl Stamped for Reading {
    fn t_s(&self) -> f64 {
        self.t_s
    }
}

impl Stamped for Mark {
    fn t_s(&self) -> f64 {
        self.reading.t_s
    }
}

/// Newest items with a smallest time between two of them.
#[derive(Clone, Copy, Debug)]
struct Ring<T> {
    items: [T; MARKS],
    count: usize,
}

impl<T: Stamped> Ring<T> {
    fn push(&mut self, item: T, spacing_s: f64) {
        let newest = &self.items[(self.count - 1) % MARKS];
        if item.t_s() - newest.t_s() >= spacing_s {
            self.items[self.count % MARKS] = item;
            self.count += 1;
        }
    }

    /// Returns the items, the newest first.
    fn iter(&self) -> impl Iterator<Item = &T> {
        (0..self.count.min(MARKS)).map(|age| &self.items[(self.count - 1 - age) % MARKS])
    }
}

/// Rings of the history, and the newest item.
#[derive(Clone, Copy, Debug)]
struct Rings<T> {
    rings: [Ring<T>; LEVELS],
    newest: T,
}

impl<T: Stamped> Rings<T> {
    fn new(first: T) -> Self {
        Self { rings: [Ring { items: [first; MARKS], count: 1 }; LEVELS], newest: first }
    }

    fn push(&mut self, item: T) {
        for (ring, spacing_s) in self.rings.iter_mut().zip(SPACINGS_S) {
            ring.push(item, spacing_s);
        }
        self.newest = item;
    }

    fn iter(&self) -> impl Iterator<Item = &T> {
        self.rings.iter().flat_map(Ring::iter)
    }
}

/// Readings of a vehicle, and the velocities that they allow.
#[derive(Clone, Debug)]
struct Track {
    readings: Rings<Reading>,
    /// Readings with a velocity; `None` before the first one.
    marks: Option<Rings<Mark>>,
    /// Velocities that the positions allow.
    measured: Option<Ball>,
    /// Velocities that positions and sent velocities allow.
    velocity: Option<Ball>,
    /// Whether positions bounded the velocity when the newest velocity was sent.
    is_compared: bool,
    /// First reading with a velocity that has the position of the newest reading.
    held: Option<Mark>,
    /// Number of readings with this position after that one.
    repeated: u32,
}

/// Velocity of a vehicle with the bound on its error.
#[derive(Clone, Debug, Default)]
pub(crate) struct VelocityEnclosure {
    track: Option<Box<Track>>,
}

impl VelocityEnclosure {
    /// Returns the velocities at the newest reading; `None` with one reading without a velocity.
    pub(crate) fn velocity(&self) -> Option<Ball> {
        self.track.as_ref()?.velocity
    }

    /// Returns whether the newest velocity that was sent was compared with positions; `None` if none was sent.
    pub(crate) fn is_compared(&self) -> Option<bool> {
        let track = self.track.as_ref()?;
        track.marks.as_ref().map(|_| track.is_compared)
    }

    /// Forgets all readings.
    pub(crate) fn clear(&mut self) {
        self.track = None;
    }

    /// Takes a reading with a later stamp than the newest one. Returns the fault of a reading that contradicts the
    /// bounds.
    pub(crate) fn take(&mut self, reading: Reading, bounds: Bounds) -> Option<Fault> {
        if let Some(track) = &mut self.track {
            return track.take(reading, bounds);
        }
        self.track = Some(Box::new(Track::new(reading, bounds)));
        None
    }
}

/// Two sets of velocities without a common one.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Disjoint;

/// Returns the common velocities of two sets. A set may be unknown.
fn common(a: Option<Ball>, b: Option<Ball>) -> Result<Option<Ball>, Disjoint> {
    match (a, b) {
        (Some(a), Some(b)) => a.intersection(b).map(Some).ok_or(Disjoint),
        (a, b) => Ok(a.or(b)),
    }
}

impl Track {
    fn new(reading: Reading, bounds: Bounds) -> Self {
        let first = reading.velocity_m_s.map(|velocity_m_s| Mark::first(reading, velocity_m_s));
        Self {
            readings: Rings::new(reading),
            marks: first.map(Rings::new),
            measured: None,
            velocity: reading.sent(bounds),
            is_compared: false,
            held: first,
            repeated: 0,
        }
    }

    fn take(&mut self, reading: Reading, bounds: Bounds) -> Option<Fault> {
        let Ok(measured) = self.measure(&reading, bounds) else {
            // Positions before a jump bound no velocity after it.
            *self = Self::new(reading, bounds);
            return Some(Fault::OutOfBounds);
        };
        let step_s = reading.window_s(&self.readings.newest);
        let earlier = self.velocity.map(|ball| ball.grown(bounds.accel_m_s2 * step_s));
        let sent = reading.sent(bounds);
        self.readings.push(reading);
        self.measured = measured;
        let fault = self.take_sent(reading, bounds);
        let velocity = match common(measured, sent) {
            Err(Disjoint) => Err(Fault::VelocityDisagrees),
            Ok(both) => match fault {
                Some(fault) => Err(fault),
                None => common(both, earlier).map_err(|Disjoint| match sent {
                    Some(_) => Fault::OutOfBounds,
                    None => Fault::VelocityDisagrees,
                }),
            },
        };
        // After a contradiction the positions alone decide.
        self.velocity = velocity.unwrap_or(measured.or(sent));
        velocity.err()
    }

    /// Returns the velocities that the positions allow, if they allow a bound.
    fn measure(&self, reading: &Reading, bounds: Bounds) -> Result<Option<Ball>, Disjoint> {
        let newest = &self.readings.newest;
        let step = reading.quotient(newest, bounds);
        let growth = bounds.accel_m_s2 * reading.window_s(newest);
        // The quotient of the step bounds the velocity at both of its ends.
        let before = common(self.measured, step)?.map(|ball| ball.grown(growth));
        let mut measured = common(before, step)?;
        for from in self.readings.iter() {
            measured = common(measured, reading.quotient(from, bounds))?;
        }
        Ok(measured)
    }

    /// Compares a sent velocity with the earlier ones and with the positions. Returns the fault of a contradiction.
    fn take_sent(&mut self, reading: Reading, bounds: Bounds) -> Option<Fault> {
        if self.held.is_some_and(|held| held.reading.position_m != reading.position_m) {
            self.held = None;
        }
        self.repeated = if self.held.is_some() { self.repeated.saturating_add(1) } else { 0 };
        let velocity_m_s = reading.velocity_m_s?;
        self.is_compared = self.measured.is_some();
        let Some(marks) = &mut self.marks else {
            let first = Mark::first(reading, velocity_m_s);
            (self.marks, self.held) = (Some(Rings::new(first)), Some(first));
            return None;
        };
        let mark = marks.newest.next(reading, velocity_m_s);
        let balanced_s = 2.0 * reading.position_error_m / bounds.velocity_error_m_s;
        // `max` also replaces the quotient of two zeros.
        let reach_s = balanced_s.clamp(SHORTEST_REACH_S, LONGEST_REACH_S);
        let within_reach = marks.iter().filter(|from| mark.window_s(from) <= reach_s);
        // The newest velocity is compared even if it is older.
        let (mut agrees, mut is_within) = (true, true);
        for from in std::iter::once(&marks.newest).chain(within_reach) {
            agrees &= mark.agrees(from, bounds);
            is_within &= mark.changes_within(from, bounds);
        }
        marks.push(mark);
        let held = self.held.get_or_insert(mark);
        let moves = self.repeated >= HELD_READINGS && mark.moves(held, bounds);
        if !agrees || moves {
            return Some(Fault::VelocityDisagrees);
        }
        (!is_within).then_some(Fault::OutOfBounds)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::{Ball, Bounds, Reading, VelocityEnclosure};
    use crate::event::Fault;

    const BOUNDS: Bounds = Bounds { accel_m_s2: 5.0, velocity_error_m_s: 0.1 };

    fn reading(t_s: f64, x_m: f64, vx_m_s: Option<f64>) -> Reading {
        let velocity_m_s = vx_m_s.map(|vx| Vector3::new(vx, 0.0, 0.0));
        Reading { t_s, position_m: Vector3::new(x_m, 0.0, 0.0), position_error_m: 0.05, velocity_m_s }
    }

    /// Returns times at a rate \[Hz\] up to an end \[s\].
    fn times(rate_hz: f64, end_s: f64) -> impl Iterator<Item = f64> {
        (0_u32..).map(move |k| f64::from(k) / rate_hz).take_while(move |t_s| *t_s < end_s)
    }

    /// Returns the time of the first fault of readings at a rate \[Hz\] for 3 s, with its kind.
    fn first_fault(rate_hz: f64, reading_at: impl Fn(f64) -> Reading, bounds: Bounds) -> Option<(f64, Fault)> {
        let mut enclosure = VelocityEnclosure::default();
        times(rate_hz, 3.0).find_map(|t_s| enclosure.take(reading_at(t_s), bounds).map(|fault| (t_s, fault)))
    }

    #[test]
    fn the_intersection_of_balls_contains_their_common_points() {
        let mut state = 1_u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let (mut common, mut empty) = (0, 0);
        for _ in 0..20_000 {
            let mut vector = || Vector3::new(random() - 0.5, random() - 0.5, random() - 0.5) * 4.0;
            let [a, b] = [vector(), vector()].map(|centre| (centre, 0.0));
            let [a, b] = [a, b].map(|(centre, _)| Ball { centre, radius: 0.05 + 2.0 * random() });
            let found = a.intersection(b);
            assert_eq!(found, b.intersection(a));
            assert_eq!(found.is_none(), (a.centre - b.centre).norm() > a.radius + b.radius);
            let Some(ball) = found else {
                empty += 1;
                continue;
            };
            assert!(ball.radius <= a.radius.min(b.radius));
            for _ in 0..10 {
                let direction = Vector3::new(random() - 0.5, random() - 0.5, random() - 0.5).normalize();
                let point = a.centre + direction * (a.radius * random().cbrt());
                if (point - b.centre).norm() <= b.radius {
                    common += 1;
                    assert!((point - ball.centre).norm() <= ball.radius, "{a:?} {b:?} {ball:?}");
                }
            }
        }
        assert!(common > 10_000 && empty > 1000, "{common} {empty}");
        // Two balls that touch have one common point, and a ball within another one is the intersection.
        let ball = |x: f64, radius: f64| Ball { centre: Vector3::new(x, 0.0, 0.0), radius };
        let touch = ball(0.0, 1.0).intersection(ball(3.0, 2.0)).expect("one point");
        assert!((touch.centre.x - 1.0).abs() < 1e-9 && touch.radius < 1e-3, "{touch:?}");
        assert_eq!(ball(0.0, 1.0).intersection(ball(0.5, 2.0)), Some(ball(0.0, 1.0)));
    }

    #[test]
    fn a_sent_velocity_of_zero_at_5_m_s_is_found_at_every_rate() {
        for rate_hz in [2.0, 10.0, 50.0, 200.0, 1000.0, 10_000.0] {
            let (t_s, fault) = first_fault(rate_hz, |t_s| reading(t_s, 5.0 * t_s, Some(0.0)), BOUNDS).expect("a fault");
            assert_eq!(fault, Fault::VelocityDisagrees);
            assert!(t_s < 0.06 || t_s * rate_hz < 2.0, "{rate_hz} Hz: {t_s} s");
            // Negative twin: the right velocity.
            assert_eq!(first_fault(rate_hz, |t_s| reading(t_s, 5.0 * t_s, Some(5.0)), BOUNDS), None);
        }
        // An error within its bound is none, and above it one within the reach of windows.
        for (error_m_s, is_found) in [(0.099, false), (0.3, true)] {
            let found = first_fault(50.0, |t_s| reading(t_s, 2.0 * t_s, Some(2.0 + error_m_s)), BOUNDS);
            assert_eq!(found.map(|(_, fault)| fault), is_found.then_some(Fault::VelocityDisagrees), "{error_m_s}");
        }
    }

    #[test]
    fn a_wrong_velocity_that_comes_in_a_part_of_the_readings_is_found() {
        // Positions within 2 m, 4 m/s, and accelerations within 2 m/s^2.
        let bounds = Bounds { accel_m_s2: 2.0, velocity_error_m_s: 0.1 };
        for every in 1..=5_u32 {
            let found = |sent_m_s: f64| {
                let mut enclosure = VelocityEnclosure::default();
                (0..60).find_map(|k| {
                    let t_s = 0.2 * f64::from(k);
                    let coarse = reading(t_s, 4.0 * t_s, (k % every == 0).then_some(sent_m_s));
                    let fault = enclosure.take(Reading { position_error_m: 2.0, ..coarse }, bounds)?;
                    Some((t_s, fault))
                })
            };
            let (t_s, fault) = found(0.0).expect("a fault");
            assert!(fault == Fault::VelocityDisagrees && t_s < 2.1, "every {every}: {fault:?} {t_s}");
            // Negative twin: the right velocity.
            assert_eq!(found(4.0), None, "every {every}");
        }
    }

    #[test]
    fn a_position_that_comes_back_between_two_sent_velocities_is_not_repeated() {
        let coarse = |k: u32, x_m: f64, vx: Option<f64>| Reading {
            position_error_m: 5.0,
            ..reading(0.1 * f64::from(k), x_m, vx)
        };
        // Each third reading has a velocity. All positions, or those with a velocity alone, are the same.
        for (between_m, is_found) in [(3.0, true), (3.1, false)] {
            let mut enclosure = VelocityEnclosure::default();
            let found = (0..10).find_map(|k| {
                let sends = k % 3 == 0;
                let vx = sends.then_some(2.0);
                enclosure.take(coarse(k, if sends { 3.0 } else { between_m }, vx), BOUNDS)
            });
            assert_eq!(found, is_found.then_some(Fault::VelocityDisagrees), "{between_m}");
        }
    }

    #[test]
    fn a_position_that_is_repeated_while_a_velocity_is_sent_is_found() {
        // The error of GNSS hides the difference for longer than the repeated position.
        let coarse = |fine: Reading| Reading { position_error_m: 5.0, ..fine };
        let frozen = first_fault(10.0, |t_s| coarse(reading(t_s, 3.0, Some(2.0))), BOUNDS);
        assert_eq!(frozen, Some((0.3, Fault::VelocityDisagrees)));
        // Negative twins: at rest, with a position that changes, and with a velocity within its error.
        assert_eq!(first_fault(10.0, |t_s| coarse(reading(t_s, 3.0, Some(0.0))), BOUNDS), None);
        assert_eq!(first_fault(10.0, |t_s| coarse(reading(t_s, 3.0 + 2.0 * t_s, Some(2.0))), BOUNDS), None);
        assert_eq!(first_fault(10.0, |t_s| coarse(reading(t_s, 3.0, Some(0.09))), BOUNDS), None);
    }

    #[test]
    fn an_acceleration_above_its_bound_is_found_in_positions_and_in_velocities() {
        for accel in [4.9, 7.0] {
            let position = |t_s: f64| accel * t_s * t_s / 2.0;
            for sends in [false, true] {
                let found = first_fault(50.0, |t_s| reading(t_s, position(t_s), sends.then_some(accel * t_s)), BOUNDS);
                assert_eq!(found.map(|(_, fault)| fault), (accel > 5.0).then_some(Fault::OutOfBounds), "{sends}");
            }
        }
    }

    #[test]
    fn the_enclosure_without_velocities_is_as_tight_as_its_best_window() {
        let bounds = Bounds { accel_m_s2: 5.0, velocity_error_m_s: 0.1 };
        for rate_hz in [30.0, 100.0, 1000.0] {
            let mut enclosure = VelocityEnclosure::default();
            let mut widest: f64 = 0.0;
            for (k, t_s) in times(rate_hz, 2.0).enumerate() {
                // Errors of alternating sign.
                let error_m = if k % 2 == 0 { 0.01 } else { -0.01 };
                let noisy = Reading { position_error_m: 0.01, ..reading(t_s, 2.5 * t_s * t_s + error_m, None) };
                assert_eq!(enclosure.take(noisy, bounds), None, "{rate_hz} {t_s}");
                let Some(ball) = enclosure.velocity() else { continue };
                assert!((ball.centre.x - 5.0 * t_s).abs() <= ball.radius, "{rate_hz} {t_s}: {ball:?}");
                widest = if t_s > 0.5 { widest.max(ball.radius) } else { widest };
            }
            // sqrt(4 eps A) is the smallest radius of one window.
            assert!(widest < 1.06 * (4.0_f64 * 0.01 * 5.0).sqrt(), "{rate_hz}: {widest}");
        }
    }

    #[test]
    fn a_jump_of_the_position_forgets_the_positions_before_it() {
        let mut enclosure = VelocityEnclosure::default();
        for k in 0..20 {
            assert_eq!(enclosure.take(reading(0.1 * f64::from(k), 0.0, None), BOUNDS), None);
        }
        assert_eq!(enclosure.take(reading(2.0, 40.0, None), BOUNDS), Some(Fault::OutOfBounds));
        assert_eq!(enclosure.velocity(), None);
        assert_eq!(enclosure.take(reading(2.1, 40.0, None), BOUNDS), None);
        assert!(enclosure.velocity().is_some_and(|ball| ball.centre.norm() < 1e-9));
    }
}
