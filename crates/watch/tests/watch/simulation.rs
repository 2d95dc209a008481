//! CLEAR against random motions and wrong input: no violation comes before the time of CLEAR without a fault.

use nalgebra::Vector3;

use crate::monitor;
use tautline_watch::{Bound, Fault, Monitor, Pose, Settings, State, TimeBase};

const ACCEL_M_S2: f64 = 4.0;
const POSITION_ERROR_M: f64 = 0.05;
const VELOCITY_ERROR_M_S: f64 = 0.1;
const DELTA_M: f64 = 1.0;
/// Time in which poses are sent \[s\].
const SENT_S: f64 = 3.0;
/// Time in which separations are compared with CLEAR \[s\].
const COMPARED_S: f64 = 6.0;
/// Length of a piece with constant acceleration \[s\].
const PIECE_S: f64 = 0.25;
/// Time between two compared separations \[s\].
const STEP_S: f64 = 0.005;
/// Longest window in which a wrong velocity is searched for \[s\]: `2 eps / e`.
const REACH_S: f64 = 2.0 * POSITION_ERROR_M / VELOCITY_ERROR_M_S;

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to COMPARED_S / STEP_S")]
fn index(x: f64) -> usize {
    x as usize
}

/// Random numbers of a linear congruential generator.
struct Random(u64);

impl Random {
    fn share(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn between(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.share()
    }

    fn direction(&mut self) -> Vector3<f64> {
        loop {
            let vector = Vector3::new(self.share() - 0.5, self.share() - 0.5, self.share() - 0.5);
            if vector.norm() > 0.1 {
                return vector.normalize();
            }
        }
    }

    /// Returns a vector of at most a length, and of exactly this length in half of the cases.
    fn within(&mut self, length: f64) -> Vector3<f64> {
        let share = if self.share() < 0.5 { 1.0 } else { self.share() };
        self.direction() * (length * share)
    }
}

/// True motion with a constant acceleration on each piece.
struct Motion {
    /// Position and velocity at the start of each piece, and its acceleration.
    pieces: Vec<[Vector3<f64>; 3]>,
}

impl Motion {
    fn new(position_m: Vector3<f64>, velocity_m_s: Vector3<f64>, random: &mut Random) -> Self {
        let mut pieces = Vec::new();
        let (mut position, mut velocity) = (position_m, velocity_m_s);
        let is_steady = random.share() < 0.3;
        let steady = random.within(ACCEL_M_S2);
        for _ in 0..=index(COMPARED_S / PIECE_S) {
            let accel = if is_steady { steady } else { random.within(ACCEL_M_S2) };
            pieces.push([position, velocity, accel]);
            position += velocity * PIECE_S + accel * (PIECE_S * PIECE_S / 2.0);
            velocity += accel * PIECE_S;
        }
        Self { pieces }
    }

    fn state(&self, t_s: f64) -> (Vector3<f64>, Vector3<f64>) {
        let k = index(t_s / PIECE_S).min(self.pieces.len() - 1);
        let ([position, velocity, accel], h_s) = (self.pieces[k], t_s - PIECE_S * k as f64);
        (position + velocity * h_s + accel * (h_s * h_s / 2.0), velocity + accel * h_s)
    }
}

/// What a vehicle sends.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Sent {
    /// Positions and velocities within their errors.
    Right,
    /// Positions within their errors and no velocity.
    PositionsOnly,
    /// A velocity of zero.
    Zero,
    /// The velocity of the first pose, always.
    Frozen,
    /// The velocity times a factor.
    Scaled(f64),
    /// The velocity some time ago.
    Late(f64),
    /// The velocity turned around the vertical, as in a frame of its own.
    Turned(f64),
    /// The velocity with an error beyond its bound, another one in each pose.
    Noisy(f64),
    /// The position stands still from a time on, and velocities go on.
    StuckPosition(f64),
    /// Position and velocity stand still from a time on.
    Stuck(f64),
}

/// Readings that have a velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Part {
    /// Each reading of this number.
    Every(u32),
    /// A random half.
    Random,
}

impl Part {
    fn has(self, reading: u32, random: &mut Random) -> bool {
        match self {
            Self::Every(number) => reading.is_multiple_of(number),
            Self::Random => random.share() < 0.5,
        }
    }

    /// Returns the number of readings for one velocity.
    fn readings(self) -> f64 {
        match self {
            Self::Every(number) => f64::from(number),
            Self::Random => 2.0,
        }
    }
}

/// Sender of the poses of one vehicle.
struct Sender {
    motion: Motion,
    sent: Sent,
    readings: u32,
    period_s: f64,
    /// Constant part of the errors, as shares of their bounds.
    bias: [Vector3<f64>; 2],
    next_s: f64,
    frozen_m_s: Option<Vector3<f64>>,
    stuck: Option<(Vector3<f64>, Vector3<f64>)>,
    /// Time, position without error, and velocity of each reading with a velocity.
    said: Vec<(f64, Vector3<f64>, Vector3<f64>)>,
}

impl Sender {
    /// Returns whether the readings contradict themselves in a window for all errors of the positions within their
    /// bound. Then the integral of the velocities leaves its bound by more than these errors.
    fn contradicts_itself(&self) -> bool {
        let shows = |from: usize| {
            let (mut travel_m, mut squares_s2) = (Vector3::zeros(), 0.0);
            self.said[from..].windows(2).any(|pair| {
                let [(before_s, _, before_m_s), (t_s, position_m, velocity_m_s)] = [pair[0], pair[1]];
                let step_s = t_s - before_s;
                travel_m += (before_m_s + velocity_m_s) * (step_s / 2.0);
                squares_s2 += step_s * step_s / 4.0;
                let window_s = t_s - self.said[from].0;
                let most_m = 4.0 * POSITION_ERROR_M + VELOCITY_ERROR_M_S * window_s + ACCEL_M_S2 * squares_s2;
                window_s <= REACH_S && (position_m - self.said[from].1 - travel_m).norm() > most_m
            })
        };
        (0..self.said.len()).any(shows)
    }

    fn pose(&mut self, t_s: f64, random: &mut Random) -> (Vector3<f64>, Option<Vector3<f64>>) {
        let (position, velocity) = self.motion.state(t_s);
        let mut error = |k: usize, bound: f64| (self.bias[k] + random.within(0.5)) * (bound / 1.5);
        let seen = (position + error(0, POSITION_ERROR_M), velocity + error(1, VELOCITY_ERROR_M_S));
        let frozen = *self.frozen_m_s.get_or_insert(seen.1);
        match self.sent {
            Sent::Right => (seen.0, Some(seen.1)),
            Sent::PositionsOnly => (seen.0, None),
            Sent::Zero => (seen.0, Some(Vector3::zeros())),
            Sent::Frozen => (seen.0, Some(frozen)),
            Sent::Scaled(factor) => (seen.0, Some(seen.1 * factor)),
            Sent::Late(by_s) => (seen.0, Some(self.motion.state((t_s - by_s).max(0.0)).1)),
            Sent::Turned(angle) => {
                let turn = nalgebra::Rotation3::from_axis_angle(&Vector3::z_axis(), angle);
                (seen.0, Some(turn * seen.1))
            }
            Sent::Noisy(bound) => (seen.0, Some(velocity + random.within(bound))),
            Sent::StuckPosition(from_s) | Sent::Stuck(from_s) => {
                if t_s < from_s {
                    return (seen.0, Some(seen.1));
                }
                let stuck = *self.stuck.get_or_insert(seen);
                let goes_on = matches!(self.sent, Sent::StuckPosition(_));
                (stuck.0, Some(if goes_on { seen.1 } else { stuck.1 }))
            }
        }
    }

    /// Records a reading with a velocity.
    fn note(&mut self, t_s: f64, velocity_m_s: Option<Vector3<f64>>) {
        let position_m = self.stuck.map_or_else(|| self.motion.state(t_s).0, |(position_m, _)| position_m);
        self.said.extend(velocity_m_s.map(|velocity_m_s| (t_s, position_m, velocity_m_s)));
    }
}

/// Result of a run.
struct Run {
    /// Number of judgements that were CLEAR.
    clear: u32,
    /// Time of the first fault \[s\].
    fault_s: f64,
    /// Earliest violation before the time of an earlier CLEAR \[s\].
    broken_s: f64,
    /// Whether the readings contradicted themselves at such a CLEAR, before the first fault.
    was_contradicted: bool,
}

fn faults(monitor: &Monitor) -> u64 {
    Fault::ALL.into_iter().map(|fault| monitor.faults(fault)).sum()
}

/// Flies two vehicles towards each other. One of them sends what is given, the other one what is right. Both send
/// velocities in a part of the readings.
fn fly(sent: Sent, part: Part, seed: u64) -> Run {
    let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    let time_base = if random.share() < 0.5 { TimeBase::Arrival } else { TimeBase::Stamps };
    let mut monitor = monitor(Settings {
        delta_m: DELTA_M,
        accel_m_s2: Bound::declared(ACCEL_M_S2),
        position_error_m: Some(Bound::declared(POSITION_ERROR_M)),
        velocity_error_m_s: Bound::declared(VELOCITY_ERROR_M_S),
        time_base,
        ..Settings::default()
    });
    let gap_m = random.between(2.0, 14.0);
    let mut senders = [(0.0, 1.0), (gap_m, -1.0)].map(|(x, towards)| {
        let speed = random.between(0.0, 8.0);
        let velocity = Vector3::x() * (towards * speed) + random.within(1.0);
        let position = Vector3::x() * x + random.within(0.5);
        let motion = Motion::new(position, velocity, &mut random);
        // Rates of velocities from 2 to 500 Hz.
        let period_s = 0.5 * 0.004_f64.powf(random.share()) / part.readings();
        let bias = [random.direction(), random.direction()];
        Sender {
            motion,
            sent: Sent::Right,
            readings: 0,
            period_s,
            bias,
            next_s: 0.0,
            frozen_m_s: None,
            stuck: None,
            said: Vec::new(),
        }
    });
    senders[0].sent = sent;
    if sent == Sent::PositionsOnly {
        senders[1].sent = sent;
    }
    // Time of the first violation at or after each step.
    let steps = index(COMPARED_S / STEP_S);
    let mut next_violation_s = vec![f64::INFINITY; steps + 1];
    for k in (0..steps).rev() {
        let t_s = STEP_S * k as f64;
        let apart_m = (senders[0].motion.state(t_s).0 - senders[1].motion.state(t_s).0).norm();
        next_violation_s[k] = if apart_m < DELTA_M - 1e-9 { t_s } else { next_violation_s[k + 1] };
    }
    let mut run = Run { clear: 0, fault_s: f64::INFINITY, broken_s: f64::INFINITY, was_contradicted: false };
    let judge = |monitor: &mut Monitor, run: &mut Run, wrong: &Sender, now_s: f64| {
        let judged = monitor.assess(now_s);
        monitor.drain_events();
        let Some(until) = judged.clear_until else { return };
        assert_eq!(judged.state, State::Clear);
        run.clear += 1;
        let first = index((judged.now_s / STEP_S).ceil());
        let violation_s = next_violation_s.get(first).copied().unwrap_or(f64::INFINITY);
        if violation_s < until.at_s {
            run.was_contradicted |= run.fault_s == f64::INFINITY && wrong.contradicts_itself();
            run.broken_s = run.broken_s.min(violation_s);
        }
    };
    let (mut last_s, mut taken) = (0.0, 0);
    loop {
        let k = usize::from(senders[1].next_s < senders[0].next_s);
        let t_s = senders[k].next_s;
        if t_s > SENT_S {
            return run;
        }
        if t_s > last_s && taken > 1 && random.share() < 0.3 {
            // With stamps, the present is the newest stamp.
            let now_s = random.between(last_s, t_s);
            judge(&mut monitor, &mut run, &senders[0], now_s);
        }
        let (position_m, velocity_m_s) = senders[k].pose(t_s, &mut random);
        let velocity_m_s = velocity_m_s.filter(|_| part.has(senders[k].readings, &mut random));
        senders[k].readings += 1;
        senders[k].note(t_s, velocity_m_s);
        let before = faults(&monitor);
        monitor.take(&Pose { t_s, id: ["a", "b"][k], position_m, velocity_m_s, accuracy_m: None }, t_s);
        if faults(&monitor) > before {
            run.fault_s = run.fault_s.min(t_s);
        }
        taken += u32::from(k == 0 && (velocity_m_s.is_some() || sent == Sent::PositionsOnly));
        // A first velocity is not tested.
        if taken > 1 || matches!(sent, Sent::Right | Sent::PositionsOnly) {
            judge(&mut monitor, &mut run, &senders[0], t_s);
        }
        last_s = t_s;
        senders[k].next_s += senders[k].period_s * random.between(0.7, 1.3);
    }
}

/// Counts of runs and judgements.
#[derive(Default)]
struct Counts {
    /// Runs with a fault.
    faults: u64,
    /// Judgements that were CLEAR.
    clear: u64,
    /// Runs with a violation before the time of CLEAR and before any fault.
    broken: u64,
    /// Runs whose readings contradicted themselves at a wrong CLEAR, before the first fault.
    contradicted: u64,
}

fn count(sent: impl Fn(&mut Random) -> Sent, part: Part, runs: u64) -> Counts {
    let mut found = Counts::default();
    for seed in 0..runs {
        let mut random = Random(seed);
        random.share();
        let run = fly(sent(&mut random), part, seed);
        found.faults += u64::from(run.fault_s < f64::INFINITY);
        found.clear += u64::from(run.clear);
        found.broken += u64::from(run.broken_s < run.fault_s);
        found.contradicted += u64::from(run.was_contradicted);
    }
    found
}

/// Returns a number of runs, or a fifth of it unless `TAUTLINE_LONG` is set.
fn runs_of(most: u64) -> u64 {
    if std::env::var_os("TAUTLINE_LONG").is_some() { most } else { most / 5 }
}

#[test]
fn right_input_has_no_fault_and_no_violation_before_the_time_of_clear() {
    for (sent, part) in [
        (Sent::Right, Part::Every(1)),
        (Sent::Right, Part::Every(2)),
        (Sent::Right, Part::Every(3)),
        (Sent::Right, Part::Random),
        (Sent::PositionsOnly, Part::Every(1)),
    ] {
        let runs = runs_of(2000);
        let Counts { faults, clear, broken, .. } = count(|_| sent, part, runs);
        assert_eq!((faults, broken), (0, 0), "{sent:?} {part:?}");
        assert!(clear > 25 * runs, "{sent:?} {part:?}: {clear}");
    }
}

#[test]
fn wrong_velocities_and_stuck_positions_are_found_before_a_violation() {
    type Kind = fn(&mut Random) -> Sent;
    let kinds: [(&str, Kind); 8] = [
        ("zero", |_| Sent::Zero),
        ("frozen", |_| Sent::Frozen),
        ("scaled", |random| Sent::Scaled(random.between(-1.0, 3.0))),
        ("late", |random| Sent::Late(random.between(0.1, 2.0))),
        ("turned", |random| Sent::Turned(random.between(0.2, 6.0))),
        ("noisy", |random| Sent::Noisy(random.between(0.2, 5.0))),
        ("stuck position", |random| Sent::StuckPosition(random.between(0.0, 2.0))),
        ("stuck", |random| Sent::Stuck(random.between(0.0, 2.0))),
    ];
    let mut wrong = Vec::new();
    for (name, kind) in kinds {
        for part in [Part::Every(1), Part::Every(2), Part::Every(3), Part::Random] {
            let runs = runs_of(500);
            let Counts { faults, clear, contradicted, .. } = count(kind, part, runs);
            // An error of a velocity that shows in no window is not found (docs/watch-proof.md).
            if contradicted > 0 || faults <= runs / 2 || clear <= runs {
                wrong.push(format!("{name} {part:?}: {contradicted} contradicted, {faults} faults, {clear} CLEAR"));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
