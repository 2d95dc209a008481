//! Plant, radio, laws and an exact minimum of the separation, for flights in tests.

use nalgebra::Vector3;

use super::Random;
use crate::contract::{Body, Decision};
use crate::plane::Segment;
use crate::{Counters, Fleet, Limits, Message, Obstacle, State};

/// Steps of the plant in a common period.
pub(super) const STEPS: usize = 4;

/// Law that a vehicle flies under.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Law {
    /// To its slot, with 1/s^2 and 2/s.
    Slot,
    /// At the nearest vehicle or obstacle, with the largest command.
    DiveAtNearest,
    /// At the origin, with random jerks.
    DiveAtCentre,
    /// A random command, held for up to a second.
    Random,
}

/// Radio: latency up to a bound, loss in bursts, and duplicates.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Radio {
    pub(super) latency_s: f64,
    pub(super) loss: f64,
    /// Mean length of a burst of lost messages; up to 1 for independent losses.
    pub(super) burst: f64,
    pub(super) duplicates: f64,
    /// Period and vehicle of lost broadcasts of the reference case D.
    pub(super) every_third: bool,
}

/// Defect of a negative twin that acts in the flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Defect {
    None,
    /// Planes come from the segments heard last.
    PlanesAsHeard,
    /// The owner takes its own proposal as accepted.
    OwnerDropsOldPlane,
}

/// A flight to be flown.
#[derive(Clone, Debug)]
pub(super) struct Flight {
    pub(super) limits: Vec<Limits>,
    pub(super) starts: Vec<State>,
    pub(super) slots: Vec<Vector3<f64>>,
    pub(super) obstacles: Vec<Obstacle>,
    pub(super) law: Law,
    pub(super) radio: Radio,
    /// Common period \[s\]; the plant makes [`STEPS`] steps in it.
    pub(super) period_s: f64,
    /// Steps between two instants of each vehicle.
    pub(super) instants: Vec<usize>,
    pub(super) duration_s: f64,
    pub(super) planar: bool,
    /// Whether noise and pushes are at their bounds and towards the nearest vehicle or obstacle.
    pub(super) adversarial: bool,
    /// Largest command that the plant carries out, if it is not that of the limits.
    pub(super) plant_m_s2: f64,
    pub(super) defect: Defect,
    /// Factor of vertical lengths in the separation that is judged.
    pub(super) judge_vertical: f64,
    pub(super) seed: u64,
}

impl Flight {
    /// Returns a flight to slots with a clean radio.
    pub(super) fn new(limits: &Limits, starts: Vec<State>, slots: Vec<Vector3<f64>>) -> Self {
        let count = starts.len();
        Self {
            limits: vec![*limits; count],
            starts,
            slots,
            obstacles: vec![],
            law: Law::Slot,
            radio: Radio::default(),
            period_s: limits.settings().period_s,
            instants: vec![STEPS; count],
            duration_s: 8.0,
            planar: false,
            adversarial: false,
            plant_m_s2: f64::INFINITY,
            defect: Defect::None,
            judge_vertical: 1.0,
            seed: 1,
        }
    }

    /// Returns a vector in the lengths that are judged.
    fn scaled(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        Vector3::new(vector.x, vector.y, vector.z * self.judge_vertical)
    }

    /// Flies to the end.
    pub(super) fn fly(&self) -> World {
        let mut world = World::new(self);
        while world.time_s() < self.duration_s - 1e-9 {
            world.step(self);
        }
        world
    }
}

/// State of a flight.
#[derive(Clone)]
pub(super) struct World {
    pub(super) fleet: Fleet,
    pub(super) states: Vec<State>,
    /// True states at the instants of each vehicle, for measurements that are late.
    past: Vec<Vec<State>>,
    commands: Vec<Vector3<f64>>,
    accelerations: Vec<Vector3<f64>>,
    /// Seconds from the last instant of each vehicle.
    since_s: Vec<f64>,
    held: Vec<(f64, Vector3<f64>)>,
    /// Messages on their way, with the time of arrival and the segment of the sender.
    flying: Vec<(f64, Message, Segment)>,
    /// Stamp and segment of the newest message, by receiver and sender.
    heard: Vec<Vec<(u32, Segment)>>,
    /// Whether the last message of each pair was lost.
    lost: Vec<bool>,
    random: Random,
    step: usize,
    step_s: f64,
    pub(super) closest_m: f64,
    pub(super) closest_s: f64,
    /// Least distance from an obstacle beyond its clearance.
    pub(super) obstacle_room_m: f64,
}

impl World {
    pub(super) fn new(flight: &Flight) -> Self {
        let mut random = Random::new(flight.seed);
        let fleet = Fleet::new(&flight.limits, &flight.starts).expect("starts are apart");
        let fleet = fleet.with_obstacles(&flight.obstacles).expect("starts are before obstacles");
        let count = flight.starts.len();
        // True states may err like a measurement.
        let states = flight.starts.iter().zip(&flight.limits).map(|(start, limits)| {
            let settings = limits.settings();
            State {
                position_m: start.position_m + flat(random.vector(settings.position_error_m), flight.planar),
                velocity_m_s: start.velocity_m_s + flat(random.vector(settings.velocity_error_m_s), flight.planar),
            }
        });
        let segments: Vec<_> = fleet.shields().iter().map(|shield| (0, shield.segment())).collect();
        Self {
            fleet,
            states: states.collect(),
            past: vec![vec![]; count],
            commands: vec![Vector3::zeros(); count],
            accelerations: vec![Vector3::zeros(); count],
            since_s: vec![0.0; count],
            held: vec![(0.0, Vector3::zeros()); count],
            flying: vec![],
            heard: vec![segments; count],
            lost: vec![false; count * count],
            random,
            step: 0,
            step_s: flight.period_s / STEPS as f64,
            closest_m: f64::INFINITY,
            closest_s: 0.0,
            obstacle_room_m: f64::INFINITY,
        }
    }

    pub(super) fn time_s(&self) -> f64 {
        self.step as f64 * self.step_s
    }

    pub(super) fn report(&self) -> Counters {
        self.fleet.report()
    }

    /// Makes one step of the plant, with the instants at its start.
    pub(super) fn step(&mut self, flight: &Flight) {
        self.deliver(flight);
        for i in 0..self.states.len() {
            if self.step.is_multiple_of(flight.instants[i]) {
                self.instant(i, flight);
            }
        }
        self.push(flight);
        self.judge(flight);
        self.judge_obstacles(flight);
        for i in 0..self.states.len() {
            self.states[i] = self.states[i].after(self.accelerations[i], self.step_s);
            self.since_s[i] += self.step_s;
            let truth = self.states[i];
            self.fleet.shields_mut()[i].observe(self.since_s[i], &truth);
        }
        self.step += 1;
    }

    fn deliver(&mut self, flight: &Flight) {
        let now = self.time_s() + 1e-12;
        let mut place = 0;
        while place < self.flying.len() {
            if self.flying[place].0 > now {
                place += 1;
                continue;
            }
            let (_, mut message, segment) = self.flying.swap_remove(place);
            if flight.defect == Defect::OwnerDropsOldPlane {
                let owner = &self.fleet.shields()[message.to as usize];
                if let Some(number) = owner.pending_number(message.from) {
                    let decision = Some(Decision { number, accepted: true });
                    message.body = Body::Follower { segment, decision };
                }
            }
            let heard = &mut self.heard[message.to as usize][message.from as usize];
            if message.stamp > heard.0 {
                *heard = (message.stamp, segment);
            }
            self.fleet.hear(&message);
        }
    }

    fn instant(&mut self, i: usize, flight: &Flight) {
        let settings = *flight.limits[i].settings();
        self.past[i].push(self.states[i]);
        let late = self.past[i].len().saturating_sub(1 + settings.measurement_delay_periods);
        let truth = self.past[i][late];
        let towards = self.nearest(i, flight);
        let errors = [settings.position_error_m, settings.velocity_error_m_s].map(|bound| {
            // A vehicle that believes to be farther from the nearest one than it is flies towards it.
            let error = if flight.adversarial { -towards * bound } else { self.random.vector(bound) };
            flat(error, flight.planar)
        });
        let measured = State { position_m: truth.position_m + errors[0], velocity_m_s: truth.velocity_m_s + errors[1] };
        let wanted = flat(self.wanted(i, &measured, flight), flight.planar);
        let shield = &mut self.fleet.shields_mut()[i];
        shield.observe_measurement(&measured, &truth);
        let heard: Vec<_> = self.heard[i].iter().map(|(_, segment)| *segment).collect();
        let brakes = flight.defect == Defect::PlanesAsHeard && !shield.hold_heard(&heard);
        self.commands[i] = if brakes { shield.brake(measured) } else { shield.filter(measured, wanted) };
        self.since_s[i] = 0.0;
        self.send(i, flight);
    }

    fn send(&mut self, i: usize, flight: &Flight) {
        let (now, count) = (self.time_s(), self.states.len());
        let broadcast_is_lost = flight.radio.every_third && (self.step / flight.instants[i] + i).is_multiple_of(3);
        let messages: Vec<_> = self.fleet.shields_mut()[i].messages().collect();
        let segment = self.fleet.shields()[i].segment();
        for message in messages {
            let burst = flight.radio.burst.max(1.0);
            let lost = &mut self.lost[i * count + message.to as usize];
            *lost = if *lost {
                !self.random.chance(1.0 / burst)
            } else {
                flight.radio.loss > 0.0 && self.random.chance(flight.radio.loss / ((1.0 - flight.radio.loss) * burst))
            };
            if *lost || broadcast_is_lost {
                continue;
            }
            let copies = 1 + usize::from(self.random.chance(flight.radio.duplicates));
            for _ in 0..copies {
                self.flying.push((now + 1e-6 + flight.radio.latency_s * self.random.unit(), message, segment));
            }
        }
    }

    /// Returns the direction to the nearest vehicle or obstacle.
    fn nearest(&self, i: usize, flight: &Flight) -> Vector3<f64> {
        let own = self.states[i].position_m;
        let others = (0..self.states.len()).filter(|j| *j != i).map(|j| self.states[j].position_m);
        let bodies = flight.obstacles.iter().filter_map(|obstacle| obstacle.body.closest_point_m(&own));
        others
            .chain(bodies)
            .map(|other| other - own)
            .min_by(|a, b| flight.scaled(a).norm_squared().total_cmp(&flight.scaled(b).norm_squared()))
            .map_or_else(Vector3::zeros, |to| to.normalize())
    }

    fn wanted(&mut self, i: usize, measured: &State, flight: &Flight) -> Vector3<f64> {
        let largest = flight.limits[i].settings().accel_m_s2;
        match flight.law {
            Law::Slot => -(measured.position_m - flight.slots[i]) - measured.velocity_m_s * 2.0,
            Law::DiveAtNearest => self.nearest(i, flight) * largest,
            Law::DiveAtCentre if self.random.chance(0.1) => self.random.direction() * largest,
            Law::DiveAtCentre => measured.position_m * -10.0,
            Law::Random => {
                if self.time_s() >= self.held[i].0 {
                    let until = self.time_s() + self.random.between(0.1, 1.0);
                    self.held[i] = (until, self.random.direction() * largest);
                }
                self.held[i].1
            }
        }
    }

    fn push(&mut self, flight: &Flight) {
        for i in 0..self.states.len() {
            let settings = flight.limits[i].settings();
            let bound = settings.disturbance_m_s2;
            let push = if flight.adversarial { self.nearest(i, flight) * bound } else { self.random.vector(bound) };
            let command = self.commands[i].cap_magnitude(flight.plant_m_s2);
            self.accelerations[i] =
                command + flat(push, flight.planar) + self.states[i].velocity_m_s * settings.a22_per_s;
        }
    }

    /// Finds the least distance from obstacles over a step to 1e-9 m. Halves an interval of time while the path within
    /// it may come closer than found so far. Its distance is at least that of both ends from the plane before the body
    /// at its middle, less the bend of the path.
    fn judge_obstacles(&mut self, flight: &Flight) {
        for (state, acceleration) in self.states.iter().zip(&self.accelerations) {
            let position_at = |seconds: f64| state.after(*acceleration, seconds).position_m;
            for obstacle in &flight.obstacles {
                let mut open = vec![(0.0, self.step_s)];
                while let Some((from, to)) = open.pop() {
                    let middle = f64::midpoint(from, to);
                    let Some(closest) = obstacle.body.closest_point_m(&position_at(middle)) else {
                        self.obstacle_room_m = self.obstacle_room_m.min(-obstacle.clearance_m);
                        continue;
                    };
                    let (outward, distance) =
                        ((position_at(middle) - closest).normalize(), (position_at(middle) - closest).norm());
                    self.obstacle_room_m = self.obstacle_room_m.min(distance - obstacle.clearance_m);
                    let ends = [from, to].map(|end| outward.dot(&(position_at(end) - closest)));
                    let bend = acceleration.norm() * (to - from) * (to - from) / 8.0;
                    let least = (ends[0].min(ends[1]) - bend).max(0.0) - obstacle.clearance_m;
                    if least < self.obstacle_room_m - 1e-9 {
                        open.extend([(from, middle), (middle, to)]);
                    }
                }
            }
        }
    }

    fn judge(&mut self, flight: &Flight) {
        for i in 0..self.states.len() {
            for j in i + 1..self.states.len() {
                let apart = flight.scaled(&(self.states[i].position_m - self.states[j].position_m));
                let closing = flight.scaled(&(self.states[i].velocity_m_s - self.states[j].velocity_m_s));
                let bend = flight.scaled(&(self.accelerations[i] - self.accelerations[j]));
                let moved = closing.norm() * self.step_s + bend.norm() * self.step_s * self.step_s / 2.0;
                if apart.norm() - moved < self.closest_m {
                    let (separation, time_s) = least_separation(&apart, &closing, &bend, self.step_s);
                    if separation < self.closest_m {
                        (self.closest_m, self.closest_s) = (separation, self.time_s() + time_s);
                    }
                }
            }
        }
    }
}

/// Removes the vertical component in the plane.
pub(super) fn flat(vector: Vector3<f64>, planar: bool) -> Vector3<f64> {
    if planar { Vector3::new(vector.x, vector.y, 0.0) } else { vector }
}

/// Returns the minimum of |r + v t + a t^2 / 2| over a step, and its time.
///
/// The derivative of the square is a cubic. Between its extrema it is monotone, so each change of sign from minus to
/// plus has one minimum, found by bisection.
pub(super) fn least_separation(r: &Vector3<f64>, v: &Vector3<f64>, a: &Vector3<f64>, step_s: f64) -> (f64, f64) {
    let distance_at = |t: f64| (r + v * t + a * (t * t / 2.0)).norm();
    let slope = |t: f64| {
        let (point, speed) = (r + v * t + a * (t * t / 2.0), v + a * t);
        point.dot(&speed)
    };
    // Derivative of the slope: |v|^2 + r.a + 3 v.a t + 1.5 |a|^2 t^2.
    let (c, b, q) = (v.norm_squared() + r.dot(a), 3.0 * v.dot(a), 1.5 * a.norm_squared());
    let root = (b * b - 4.0 * q * c).max(0.0).sqrt();
    let mut ends = [0.0, 0.0, 0.0, step_s];
    if q > 0.0 {
        ends[1] = ((-b - root) / (2.0 * q)).clamp(0.0, step_s);
        ends[2] = ((-b + root) / (2.0 * q)).clamp(0.0, step_s);
    }
    let mut best =
        if distance_at(0.0) <= distance_at(step_s) { (distance_at(0.0), 0.0) } else { (distance_at(step_s), step_s) };
    for piece in ends.windows(2) {
        let (mut low, mut high) = (piece[0], piece[1]);
        if slope(low) < 0.0 && slope(high) > 0.0 {
            for _ in 0..60 {
                let middle = 0.5 * (low + high);
                if slope(middle) < 0.0 { low = middle } else { high = middle }
            }
            if distance_at(low) < best.0 {
                best = (distance_at(low), low);
            }
        }
    }
    best
}

#[test]
fn the_least_separation_is_no_larger_than_any_sample() {
    let mut random = Random::new(8);
    for _ in 0..2_000 {
        let (r, v, a) = (random.vector(2.0), random.vector(5.0), random.vector(20.0));
        let (separation, time_s) = least_separation(&r, &v, &a, 0.5);
        let samples = (0..=1_000).map(|k| f64::from(k) * 5e-4).map(|t| (r + v * t + a * (t * t / 2.0)).norm());
        let sampled = samples.fold(f64::INFINITY, f64::min);
        assert!(
            separation <= sampled + 1e-12 && separation > sampled - 0.01,
            "{r} {v} {a}: {separation} {sampled} {time_s}"
        );
    }
}
