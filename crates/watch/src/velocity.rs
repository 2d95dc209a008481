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
//! The second bound is [`Fault::OutOfBounds`]. A velocity that is wrong by `e + b` is found at the latest when `b T` is
//! above `eps_n + eps_k + A sum of g^2 / 4`. Windows reach to `2 eps / e`, where both errors are equal, but at least to
//! [`SHORTEST_REACH_S`] and at most to [`LONGEST_REACH_S`].
//!
//! A first reading has no window, so its velocity is not tested.
//!
//! A position that is repeated without the change of a bit is no new measurement. Then the errors of both ends are
//! equal, and the summed velocities alone must be at most `e T + A sum of g^2 / 4`, with [`RESOLUTION_M`] for the
//! resolution of positions. This is tested from [`HELD_S`] on.
//!
//! # Memory
//!
//! The history has [`LEVELS`] rings of [`MARKS`] readings. The readings of a ring are [`SPACINGS_S`] apart, so that the
//! windows have the same lengths at every rate. Nothing is allocated after the first reading.

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

/// Reading with the sums of the sent velocities up to it.
#[derive(Clone, Copy, Debug)]
struct Mark {
    reading: Reading,
    /// Sum of the sent velocities times their steps, by the trapezoidal rule \[m\].
    travel_m: Vector3<f64>,
    /// Sum of the squares of the steps, divided by 4 \[s^2\].
    squares_s2: f64,
    /// Number of readings without a velocity so far; sums with different numbers are not comparable.
    breaks: u64,
}

impl Mark {
    fn first(reading: Reading) -> Self {
        Self { reading, travel_m: Vector3::zeros(), squares_s2: 0.0, breaks: 0 }
    }

    fn next(&self, reading: Reading) -> Self {
        let step_s = reading.t_s - self.reading.t_s;
        let mean = self.reading.velocity_m_s.zip(reading.velocity_m_s).map(|(from, to)| (from + to) * 0.5);
        Self {
            reading,
            travel_m: self.travel_m + mean.map_or_else(Vector3::zeros, |mean| mean * step_s),
            squares_s2: self.squares_s2 + step_s * step_s / 4.0,
            breaks: self.breaks + u64::from(mean.is_none()),
        }
    }

    fn window_s(&self, from: &Self) -> f64 {
        self.reading.t_s - from.reading.t_s
    }

    /// Returns the bound on the rounding of a displacement \[m\]. It covers the coordinates, and stamps that err by a
    /// unit in the last place at a speed.
    fn rounding_m(&self, speed_m_s: f64) -> f64 {
        1e-9 * (1.0 + self.reading.position_m.amax()) + speed_m_s * 4.0 * f64::EPSILON * self.reading.t_s.abs()
    }

    /// Returns the velocities that the positions at both ends of a window allow at each of its ends. Returns `None` for
    /// a window that is too short.
    fn quotient(&self, from: &Self, bounds: Bounds) -> Option<Ball> {
        let window_s = self.window_s(from);
        if window_s < LEAST_WINDOW_S {
            return None;
        }
        let centre = (self.reading.position_m - from.reading.position_m) / window_s;
        let errors_m = self.reading.position_error_m + from.reading.position_error_m;
        let rounding_m = self.rounding_m(centre.norm());
        Some(Ball { centre, radius: (errors_m + rounding_m) / window_s + bounds.accel_m_s2 * window_s / 2.0 })
    }

    /// Returns whether the sum of the sent velocities over a window agrees with the positions at its ends.
    fn agrees(&self, from: &Self, speed_m_s: f64, bounds: Bounds) -> bool {
        let window_s = self.window_s(from);
        let errors_m = self.reading.position_error_m + from.reading.position_error_m;
        let most_m = errors_m
            + bounds.velocity_error_m_s * window_s
            + bounds.accel_m_s2 * (self.squares_s2 - from.squares_s2)
            + 1e-9 * self.travel_m.norm()
            + self.rounding_m(speed_m_s + bounds.accel_m_s2 * window_s);
        let moved_m = self.reading.position_m - from.reading.position_m;
        (moved_m - (self.travel_m - from.travel_m)).norm() <= most_m
    }
}

/// Newest readings with a smallest time between two of them.
#[derive(Clone, Debug)]
struct Ring {
    marks: [Mark; MARKS],
    count: usize,
}

impl Ring {
    fn newest(&self) -> &Mark {
        &self.marks[(self.count - 1) % MARKS]
    }

    fn push(&mut self, mark: Mark, spacing_s: f64) {
        if mark.window_s(self.newest()) >= spacing_s {
            self.marks[self.count % MARKS] = mark;
            self.count += 1;
        }
    }

    /// Returns the readings, the newest first.
    fn iter(&self) -> impl Iterator<Item = &Mark> {
        (0..self.count.min(MARKS)).map(|age| &self.marks[(self.count - 1 - age) % MARKS])
    }
}

/// Rings of the history, the newest reading, and the velocities that both allow.
#[derive(Clone, Debug)]
struct Track {
    rings: [Ring; LEVELS],
    newest: Mark,
    /// Velocities that the positions allow.
    measured: Option<Ball>,
    /// Velocities that positions and sent velocities allow.
    velocity: Option<Ball>,
    /// First reading with the position of the newest one.
    held: Mark,
    /// Number of readings with this position after the first one.
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

    /// Returns whether positions bound the velocity, so that a sent velocity was compared with them.
    pub(crate) fn is_measured(&self) -> bool {
        self.track.as_ref().is_some_and(|track| track.measured.is_some())
    }

    /// Forgets all readings.
    pub(crate) fn clear(&mut self) {
        self.track = None;
    }

    /// Takes a reading with a later stamp than the newest one. Returns the fault of a reading that contradicts the
    /// bounds.
    pub(crate) fn take(&mut self, reading: Reading, bounds: Bounds) -> Option<Fault> {
        match &mut self.track {
            Some(track) => track.take(reading, bounds),
            None => {
                self.track = Some(Box::new(Track::new(reading, bounds)));
                None
            }
        }
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

fn sent(reading: &Reading, bounds: Bounds) -> Option<Ball> {
    reading.velocity_m_s.map(|centre| Ball { centre, radius: bounds.velocity_error_m_s })
}

impl Track {
    fn new(reading: Reading, bounds: Bounds) -> Self {
        let mark = Mark::first(reading);
        let ring = Ring { marks: [mark; MARKS], count: 1 };
        let rings = std::array::from_fn(|_| ring.clone());
        Self { rings, newest: mark, measured: None, velocity: sent(&reading, bounds), held: mark, repeated: 0 }
    }

    /// Starts anew with one reading.
    fn restart(&mut self, reading: Reading, bounds: Bounds) {
        let mark = Mark::first(reading);
        for ring in &mut self.rings {
            (ring.marks[0], ring.count) = (mark, 1);
        }
        (self.newest, self.held, self.repeated) = (mark, mark, 0);
        (self.measured, self.velocity) = (None, sent(&reading, bounds));
    }

    fn take(&mut self, reading: Reading, bounds: Bounds) -> Option<Fault> {
        let mark = self.newest.next(reading);
        let Ok(measured) = self.measure(&mark, bounds) else {
            // Positions before a jump bound no velocity after it.
            self.restart(reading, bounds);
            return Some(Fault::OutOfBounds);
        };
        let agrees = self.agrees(&mark, bounds);
        let moves = self.moves_while_held(&mark, bounds);
        let is_within = self.changes_within(&mark, bounds);
        let earlier = self.velocity.map(|ball| ball.grown(bounds.accel_m_s2 * mark.window_s(&self.newest)));
        let sent = sent(&reading, bounds);
        for (ring, spacing_s) in self.rings.iter_mut().zip(SPACINGS_S) {
            ring.push(mark, spacing_s);
        }
        (self.newest, self.measured) = (mark, measured);
        let velocity = match common(measured, sent) {
            Err(Disjoint) => Err(Fault::VelocityDisagrees),
            Ok(_) if !agrees || moves => Err(Fault::VelocityDisagrees),
            Ok(_) if !is_within => Err(Fault::OutOfBounds),
            Ok(both) => common(both, earlier).map_err(|Disjoint| match sent {
                Some(_) => Fault::OutOfBounds,
                None => Fault::VelocityDisagrees,
            }),
        };
        // After a contradiction the positions alone decide.
        self.velocity = velocity.unwrap_or(measured.or(sent));
        velocity.err()
    }

    /// Returns the velocities that the positions allow, if they allow a bound.
    fn measure(&self, mark: &Mark, bounds: Bounds) -> Result<Option<Ball>, Disjoint> {
        let step = mark.quotient(&self.newest, bounds);
        let growth = bounds.accel_m_s2 * mark.window_s(&self.newest);
        // The quotient of the step bounds the velocity at both of its ends.
        let before = common(self.measured, step)?.map(|ball| ball.grown(growth));
        let mut measured = common(before, step)?;
        for from in self.rings.iter().flat_map(Ring::iter) {
            measured = common(measured, mark.quotient(from, bounds))?;
        }
        Ok(measured)
    }

    /// Returns the readings from which windows to a reading with sent velocities throughout begin: the newest one, and
    /// those within reach.
    fn windows<'a>(&'a self, mark: &'a Mark, bounds: Bounds) -> impl Iterator<Item = &'a Mark> {
        let balanced_s = 2.0 * mark.reading.position_error_m / bounds.velocity_error_m_s;
        // `max` also replaces the quotient of two zeros.
        let reach_s = balanced_s.max(SHORTEST_REACH_S).min(LONGEST_REACH_S);
        let marks = self.rings.iter().flat_map(Ring::iter).filter(move |from| mark.window_s(from) <= reach_s);
        std::iter::once(&self.newest).chain(marks).filter(move |from| from.breaks == mark.breaks)
    }

    fn agrees(&self, mark: &Mark, bounds: Bounds) -> bool {
        let Some(velocity) = mark.reading.velocity_m_s else { return true };
        let speed_m_s = velocity.norm();
        self.windows(mark, bounds).all(|from| mark.agrees(from, speed_m_s, bounds))
    }

    /// Returns whether sent velocities changed by no more than the acceleration and their errors allow.
    fn changes_within(&self, mark: &Mark, bounds: Bounds) -> bool {
        let Some(velocity) = mark.reading.velocity_m_s else { return true };
        self.windows(mark, bounds).all(|from| {
            let most_m_s = 2.0 * bounds.velocity_error_m_s + bounds.accel_m_s2 * mark.window_s(from);
            let rounding_m_s = 1e-9 * (1.0 + velocity.amax());
            from.reading.velocity_m_s.is_none_or(|before| (velocity - before).norm() <= most_m_s + rounding_m_s)
        })
    }

    /// Counts repetitions of a position. Returns whether the sent velocities contradict them.
    fn moves_while_held(&mut self, mark: &Mark, bounds: Bounds) -> bool {
        if mark.reading.position_m != self.held.reading.position_m || mark.breaks != self.held.breaks {
            (self.held, self.repeated) = (*mark, 0);
            return false;
        }
        self.repeated = self.repeated.saturating_add(1);
        let window_s = mark.window_s(&self.held);
        let most_m = RESOLUTION_M
            + bounds.velocity_error_m_s * window_s
            + bounds.accel_m_s2 * (mark.squares_s2 - self.held.squares_s2)
            + 1e-9 * mark.travel_m.norm();
        let moved_m = (mark.travel_m - self.held.travel_m).norm();
        self.repeated >= HELD_READINGS && window_s >= HELD_S && moved_m > most_m
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
