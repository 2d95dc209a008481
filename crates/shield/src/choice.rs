//! Choice of the reference's acceleration: the wish of the law where it is accepted, otherwise a command near it.
//!
//! The certificate depends on `Reach::accepts` alone: a command that it accepts, or the command of the brake, is
//! safe. Everything else here decides how soon vehicles arrive.

use nalgebra::Vector3;
use tautline_core::half_spaces::{HalfSpace, HalfSpaces};

use crate::brake::{Brake, State};
use crate::plane::Plane;

/// Relative excess of a limit that counts as rounding.
const ROUNDING: f64 = 1e-12;
/// Halvings of the search between the brake and an aim.
const HALVINGS: usize = 40;
/// Part of the way from the brake to an aim up to which a command counts as that of the brake.
const BRAKES: f64 = 1e-6;
/// Rate at which a gap below the ease is opened \[1/s^2\], and the speed towards the plane is removed \[1/s\].
const OPENING: f64 = 4.0;
/// Largest part of the acceleration that opens a gap.
const OPENING_SHARE: f64 = 0.5;
/// Share of the squared vertical cut above which a vehicle gives way to a side and not in the vertical.
const LEVEL: f64 = 0.2;
/// Share of the cut above which the rest of a wish before an obstacle is to one side. With a smaller share, a vehicle
/// turns back before the end of a wall. Near 1 the turn to the right cancels the rest of the wish.
const ASIDE: f64 = 0.6;
/// Reach that is added because of rounding \[m\].
const SLACK_M: f64 = 1e-6;

/// Rule of the choice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Choice {
    /// The accepted command nearest to the wish that gives way to the right and keeps a gap.
    ///
    /// 1. Planes and the largest acceleration bound the command by half-spaces, to first order of the stop point.
    /// 2. Where the stop point is nearer to a plane than half the ease, the bound is lower and opens the gap.
    /// 3. What the projection cuts from the wish is added again, turned by a right angle. Vehicles that meet head-on
    ///    therefore pass on the same side. Before obstacles alone, a wish that is clearly to the left is turned to the
    ///    left. At a wall, a turn to the right would cancel it.
    /// 4. The command is on the line from the brake to this aim, as far as it is accepted.
    GiveWay {
        /// Gap that two vehicles keep by choice \[m\]; 0 for none.
        ease_m: f64,
        /// Share of the cut that is turned to the right before vehicles, from -1 (left) to 1; 0 for none.
        turn: f64,
    },
    /// The accepted command on the line from the brake to the wish, nearest to the wish. Vehicles stop before each
    /// other.
    Scale,
}

/// Limits of the reference of a vehicle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Envelope {
    /// Largest acceleration `A_n` \[m/s^2\].
    pub(crate) accel_m_s2: f64,
    /// Largest speed V \[m/s\].
    pub(crate) speed_m_s: f64,
    /// Longest time between two instants; the period h if all are equal \[s\].
    pub(crate) period_s: f64,
    /// Brake, with the shortest time between two instants.
    pub(crate) brake: Brake,
}

/// Chosen command.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Chosen {
    pub(crate) acceleration: Vector3<f64>,
    /// Whether no command but that of the brake was accepted.
    pub(crate) is_brake: bool,
}

impl Envelope {
    /// Cuts a wish to the largest acceleration, then to the largest speed, then again to the largest acceleration.
    pub(crate) fn cut(&self, velocity: &Vector3<f64>, wish: Vector3<f64>) -> Vector3<f64> {
        let wish = cap(wish, self.accel_m_s2);
        let next = velocity + wish * self.period_s;
        let speed = next.norm();
        if speed <= self.speed_m_s {
            return wish;
        }
        cap((next * (self.speed_m_s / speed) - velocity) / self.period_s, self.accel_m_s2)
    }

    /// Returns the largest distance from the position, within which planes limit the choice \[m\].
    ///
    /// With w = |v| + A h, the position after a period is at most w h away and its stop point at most w G(w) more,
    /// because G does not decrease. The same bounds hold for the half-spaces of the command.
    pub(crate) fn reach_m(&self, state: &State, choice: Choice) -> f64 {
        self.reach_at_m(state.velocity_m_s.norm(), choice)
    }

    /// Returns the reach at the largest speed \[m\].
    pub(crate) fn largest_reach_m(&self, choice: Choice) -> f64 {
        self.reach_at_m(self.speed_m_s, choice)
    }

    /// Returns the reach at a speed \[m\]. It does not decrease with the speed.
    pub(crate) fn reach_at_m(&self, speed_m_s: f64, choice: Choice) -> f64 {
        let fastest = speed_m_s + self.accel_m_s2 * self.period_s;
        let ease = if let Choice::GiveWay { ease_m, .. } = choice { ease_m / 2.0 } else { 0.0 };
        let bend = self.brake.bend_m(self.accel_m_s2 * (1.0 + ROUNDING));
        fastest * (self.period_s + self.brake.glide_s(fastest)) + ease + bend + SLACK_M
    }
}

/// Shortens a vector to a length. One that is not finite stays so.
fn cap(vector: Vector3<f64>, length: f64) -> Vector3<f64> {
    let norm = vector.norm();
    if norm <= length {
        vector
    } else if norm.is_finite() {
        vector * (length / norm)
    } else {
        // The square of the length is too large for a double.
        let shorter = vector / vector.amax();
        shorter * (length / shorter.norm())
    }
}

/// Planes within reach of a vehicle, with scratch memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reach {
    planes: Vec<Plane>,
    /// Number of planes before obstacles, which are the last ones.
    obstacles: usize,
    hard: HalfSpaces,
    soft: HalfSpaces,
}

impl Reach {
    /// Returns memory for this many planes.
    pub(crate) fn with_capacity(count: usize) -> Self {
        Self {
            planes: Vec::with_capacity(count),
            obstacles: 0,
            hard: HalfSpaces::with_capacity(count),
            soft: HalfSpaces::with_capacity(count),
        }
    }

    pub(crate) fn clear(&mut self) {
        self.planes.clear();
        self.obstacles = 0;
    }

    /// Adds a plane before another vehicle.
    #[inline]
    pub(crate) fn push(&mut self, plane: Plane) {
        self.planes.push(plane);
    }

    /// Adds the planes before obstacles, after those before vehicles.
    pub(crate) fn push_obstacles(&mut self, planes: impl Iterator<Item = Plane>) {
        let vehicles = self.planes.len();
        self.planes.extend(planes);
        self.obstacles = self.planes.len() - vehicles;
    }

    /// Whether a point is inside all planes.
    pub(crate) fn contains(&self, point_m: &Vector3<f64>) -> bool {
        self.planes.iter().all(|plane| plane.room_m(point_m) >= 0.0)
    }

    /// Whether the reference may take this command: it is within the limits, and the position after the period and its
    /// stop point are inside all planes. With irregular instants these are the position after the longest time and all
    /// stop points, see [`Brake`].
    pub(crate) fn accepts(&self, envelope: &Envelope, state: &State, command: Vector3<f64>) -> bool {
        let next = state.after(command, envelope.period_s);
        let within = |value: f64, limit: f64| value <= limit * limit * (1.0 + ROUNDING);
        if !within(command.norm_squared(), envelope.accel_m_s2)
            || !within(next.velocity_m_s.norm_squared(), envelope.speed_m_s)
        {
            return false;
        }
        let stop = envelope.brake.stop_m(&next);
        let (shortest_s, bend) = (envelope.brake.shortest_s(), envelope.brake.bend_m(command.norm()));
        let is_inside = |plane: &Plane| plane.room_m(&next.position_m) >= 0.0 && plane.room_m(&stop) >= bend;
        if !self.planes.iter().all(is_inside) {
            return false;
        }
        if shortest_s == envelope.period_s {
            return true;
        }
        let early_stop = envelope.brake.stop_m(&state.after(command, shortest_s));
        self.planes.iter().all(|plane| plane.room_m(&early_stop) >= bend)
    }

    /// Returns the command for a wish that [`Envelope::cut`] returned.
    pub(crate) fn choose(&mut self, envelope: &Envelope, state: &State, wish: Vector3<f64>, choice: Choice) -> Chosen {
        let eases = match choice {
            Choice::GiveWay { ease_m, .. } => {
                let stop = envelope.brake.stop_m(state);
                self.planes.iter().any(|plane| plane.room_m(&stop) < ease_m / 2.0)
            }
            Choice::Scale => false,
        };
        if !eases && self.accepts(envelope, state, wish) {
            return Chosen { acceleration: wish, is_brake: false };
        }
        let brake = envelope.brake.command(&state.velocity_m_s);
        let aim = match choice {
            Choice::GiveWay { ease_m, turn } => self.aim(envelope, state, wish, ease_m, turn),
            Choice::Scale => Some(wish),
        };
        let Some(aim) = aim else { return Chosen { acceleration: brake, is_brake: true } };
        self.towards(envelope, state, brake, aim)
    }

    /// Returns the accepted command between the brake and an aim that is nearest to the aim, by bisection.
    fn towards(&self, envelope: &Envelope, state: &State, brake: Vector3<f64>, aim: Vector3<f64>) -> Chosen {
        if self.accepts(envelope, state, aim) {
            return Chosen { acceleration: aim, is_brake: false };
        }
        let (mut accepted, mut refused) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (accepted + refused);
            if self.accepts(envelope, state, brake + (aim - brake) * middle) {
                accepted = middle;
            } else {
                refused = middle;
            }
        }
        Chosen { acceleration: brake + (aim - brake) * accepted, is_brake: accepted <= BRAKES }
    }

    /// Returns the aim of [`Choice::GiveWay`], with the stop point to first order at the present speed, and then at the
    /// speed after a period of brake. `None` if no command is in the half-spaces of either.
    fn aim(
        &mut self,
        envelope: &Envelope,
        state: &State,
        wish: Vector3<f64>,
        ease_m: f64,
        turn: f64,
    ) -> Option<Vector3<f64>> {
        let brake = &envelope.brake;
        let speed = state.velocity_m_s.norm();
        let slower = (speed - brake.deceleration_m_s2() * envelope.period_s).max(0.0);
        let now = brake.glide_s(speed);
        [now, brake.glide_s(slower)].into_iter().find_map(|glide| {
            let meets_vehicle = self.bound(envelope, state, wish, [glide, now], ease_m);
            let radius = envelope.accel_m_s2;
            let nearest = self.soft.nearest_inside(wish, radius).or_else(|| self.hard.nearest_inside(wish, radius))?;
            if turn == 0.0 {
                return Some(nearest);
            }
            let right = right_hand(wish - nearest);
            let is_aside = right.dot(&wish) * turn.signum() < -ASIDE * right.norm_squared();
            let turn = if is_aside && !meets_vehicle { -turn } else { turn };
            let turned = nearest + right * turn;
            self.hard.nearest_inside(envelope.cut(&state.velocity_m_s, turned), radius)
        })
    }

    /// Sets the half-spaces `a . u <= r` of the command for the stop point at the glide time g. Returns whether one
    /// before a vehicle cuts the wish.
    ///
    /// ```text
    /// hard   r = min( (b - a.p - a.v h) / (h^2/2), (b - a.p - a.v (h + g)) / (h^2/2 + h g) )
    /// soft   min( r, max( -4 (ease/2 - R) - 4 max(a.v, 0), -A/2 ) )   where the room R of the stop point is < ease/2
    /// ```
    fn bound(
        &mut self,
        envelope: &Envelope,
        state: &State,
        wish: Vector3<f64>,
        [glide, glide_now]: [f64; 2],
        ease_m: f64,
    ) -> bool {
        let h = envelope.period_s;
        let (half, whole) = (h * h / 2.0, h * h / 2.0 + h * glide);
        self.hard.clear();
        self.soft.clear();
        let vehicles = self.planes.len() - self.obstacles;
        let mut meets_vehicle = false;
        for (number, plane) in self.planes.iter().enumerate() {
            let room = plane.room_m(&state.position_m);
            let closing = plane.normal.dot(&state.velocity_m_s);
            let hard = ((room - closing * h) / half).min((room - closing * (h + glide)) / whole);
            let short = ease_m / 2.0 - (room - closing * glide_now);
            let soft = if short > 0.0 {
                let opening = -OPENING * short - OPENING * closing.max(0.0);
                hard.min(opening.max(-OPENING_SHARE * envelope.accel_m_s2))
            } else {
                hard
            };
            meets_vehicle |= number < vehicles && plane.normal.dot(&wish) > soft;
            // A half-space that contains the ball of all commands is left out.
            for (half_spaces, limit) in [(&mut self.hard, hard), (&mut self.soft, soft)] {
                if limit < envelope.accel_m_s2 {
                    half_spaces.push(HalfSpace { normal: -plane.normal, offset: -limit });
                }
            }
        }
        meets_vehicle
    }
}

/// Returns a vector turned to the right by a right angle about the vertical, or about the x axis if it is nearly
/// vertical.
fn right_hand(cut: Vector3<f64>) -> Vector3<f64> {
    if cut.x * cut.x + cut.y * cut.y > LEVEL * cut.z * cut.z {
        Vector3::new(cut.y, -cut.x, 0.0)
    } else {
        Vector3::new(0.0, cut.z, -cut.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::Random;

    const ENVELOPE: fn() -> Envelope =
        || Envelope { accel_m_s2: 5.0, speed_m_s: 2.0, period_s: 0.05, brake: Brake::new(3.0, 0.05) };

    #[test]
    fn a_wish_is_cut_to_the_acceleration_and_the_speed() {
        let envelope = ENVELOPE();
        let mut random = Random::new(6);
        for _ in 0..10_000 {
            let velocity = random.vector(2.0);
            let wish = random.vector(40.0);
            let cut = envelope.cut(&velocity, wish);
            assert!(cut.norm() <= 5.0 + 1e-12, "{velocity} {wish}");
            assert!((velocity + cut * 0.05).norm() <= 2.0 + 1e-12, "{velocity} {wish}");
        }
        assert_eq!(envelope.cut(&Vector3::zeros(), Vector3::x()), Vector3::x());
        assert_eq!(envelope.cut(&Vector3::zeros(), Vector3::x() * 9.0), Vector3::x() * 5.0);
        assert_eq!(envelope.cut(&(Vector3::x() * 2.0), Vector3::x()), Vector3::zeros());
        // The squares of large wishes are infinite.
        for size in [1e150, 1e200, f64::MAX] {
            let cut = envelope.cut(&Vector3::zeros(), Vector3::new(size, -size, 0.0));
            assert!((cut - Vector3::new(12.5_f64.sqrt(), -(12.5_f64.sqrt()), 0.0)).amax() < 1e-12, "{size}: {cut}");
        }
        for wish in [Vector3::x() * f64::INFINITY, Vector3::y() * f64::NAN] {
            assert!(envelope.cut(&Vector3::zeros(), wish).iter().any(|value| value.is_nan()), "{wish}");
        }
    }

    #[test]
    fn every_choice_is_accepted_or_the_brake_and_planes_beyond_reach_change_nothing() {
        let envelope = ENVELOPE();
        let mut random = Random::new(7);
        let (mut changed, mut brakes) = (0, 0);
        for round in 0..30_000 {
            let state = State { position_m: random.vector(1.0), velocity_m_s: random.vector(2.0) };
            let stop = envelope.brake.stop_m(&state);
            let choice = match round % 3 {
                0 => Choice::Scale,
                1 => Choice::GiveWay { ease_m: 0.0, turn: 0.0 },
                _ => Choice::GiveWay { ease_m: 0.2, turn: 1.0 },
            };
            // Planes with the reserved segment inside, some of them touching it.
            let planes: Vec<_> = (0..random.index(6))
                .map(|_| {
                    let normal = random.direction();
                    let least = normal.dot(&state.position_m).max(normal.dot(&stop));
                    let room = if random.chance(0.3) { 1e-12 } else { random.between(0.0, 2.0) };
                    Plane { normal, offset_m: least + room }
                })
                .collect();
            let wish = envelope.cut(&state.velocity_m_s, random.vector(8.0));
            let reach = envelope.reach_m(&state, choice);
            let mut near = Reach::default();
            planes.iter().filter(|plane| plane.room_m(&state.position_m) <= reach).for_each(|plane| near.push(*plane));
            let mut all = Reach { planes, ..Reach::default() };
            let chosen = all.choose(&envelope, &state, wish, choice);
            assert_eq!(near.choose(&envelope, &state, wish, choice), chosen, "{state:?}");
            let brake = envelope.brake.command(&state.velocity_m_s);
            assert!(all.accepts(&envelope, &state, chosen.acceleration) || chosen.acceleration == brake, "{state:?}");
            changed += u32::from(chosen.acceleration != wish);
            brakes += u32::from(chosen.is_brake);
        }
        assert!(changed > 5_000 && brakes > 100, "{changed} {brakes}");
    }

    #[test]
    fn a_vehicle_before_a_plane_gives_way_to_the_right() {
        let envelope = ENVELOPE();
        let state = State { position_m: Vector3::zeros(), velocity_m_s: Vector3::x() };
        let mut reach = Reach::default();
        reach.push(Plane { normal: Vector3::x(), offset_m: 0.25 });
        let wish = Vector3::x() * 2.0;
        let chosen = reach.choose(&envelope, &state, wish, Choice::GiveWay { ease_m: 0.2, turn: 1.0 }).acceleration;
        assert!(chosen.x < 0.0 && chosen.y < -0.5, "{chosen}");
        let scaled = reach.choose(&envelope, &state, wish, Choice::Scale).acceleration;
        assert!(scaled.x < wish.x && scaled.y == 0.0, "{scaled}");
        assert_eq!(right_hand(Vector3::z()), Vector3::y());
    }

    #[test]
    fn a_vehicle_before_an_obstacle_turns_to_the_side_of_its_wish() {
        let envelope = ENVELOPE();
        let state = State { position_m: Vector3::zeros(), velocity_m_s: Vector3::zeros() };
        let wall = Plane { normal: Vector3::x(), offset_m: 1e-6 };
        let beside = Plane { normal: -Vector3::x(), offset_m: 1.0 };
        for turn in [1.0, -1.0] {
            let choice = Choice::GiveWay { ease_m: 0.2, turn };
            let chosen = |vehicles: &[Plane], obstacles: &[Plane], wish: Vector3<f64>| {
                let mut reach = Reach::default();
                for plane in vehicles {
                    reach.push(*plane);
                }
                reach.push_obstacles(obstacles.iter().copied());
                reach.choose(&envelope, &state, wish, choice).acceleration
            };
            // A wish clearly to the other side of the turn, and one nearly straight at the wall.
            let (aside, straight) = (Vector3::new(2.0, 1.6 * turn, 0.0), Vector3::new(2.0, 0.5 * turn, 0.0));
            assert!(chosen(&[], &[wall], aside).y * turn > 1.6, "{}", chosen(&[], &[wall], aside));
            assert!(chosen(&[], &[wall], straight).y * turn < 0.0, "{}", chosen(&[], &[wall], straight));
            // Before a vehicle, with or without an obstacle, the turn is to the same side for all wishes.
            assert!(chosen(&[wall], &[], aside).y * turn < 0.0, "{}", chosen(&[wall], &[], aside));
            assert!(chosen(&[wall], &[wall], aside).y * turn < 0.0, "{}", chosen(&[wall], &[wall], aside));
            // A vehicle that is not in the way has no effect.
            assert_eq!(chosen(&[beside], &[wall], aside), chosen(&[], &[wall], aside));
        }
    }
}
