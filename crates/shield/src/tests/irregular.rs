//! Flights with irregular instants, hangs and old measurements at their worst, on a plant without a common step.
//!
//! Each vehicle has its own instants. Between two events of any vehicles the accelerations are constant, so motion and
//! the least separation are exact. The adversary chooses the time until the next instant, the age and the error of each
//! measurement, and the push.

use nalgebra::Vector3;

use super::Random;
use super::flights::long;
use super::world::least_separation;
use crate::brake::Brake;
use crate::report::Exceeded;
use crate::{Fleet, Limits, Message, Settings, State, Timing};

const DELTA_M: f64 = 1.0;

/// Choice of times, ages, errors and pushes.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Adversary {
    /// Random within the bounds, often at one of them.
    Random,
    /// Times that bring the vehicle farthest towards the nearest one; errors and pushes towards it.
    Greedy,
    /// Times and ages of a list that a search improves; errors and pushes towards the nearest vehicle.
    Listed,
}

/// Times that the shields receive.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Known {
    /// Times of the clocks of the vehicles, with their largest error.
    Clock,
    /// The nominal period, and measurements that count as new.
    Nothing,
}

#[derive(Clone)]
struct Flight {
    /// Limits of the shields.
    limits: Vec<Limits>,
    /// Settings that hold for the plant.
    truth: Vec<Settings>,
    starts: Vec<State>,
    adversary: Adversary,
    known: Known,
    /// Shares of the range of times and ages, by vehicle and instant.
    list: Vec<Vec<[f64; 2]>>,
    /// Law that flies at the nearest vehicle in place of a random one.
    dives: bool,
    latency_s: f64,
    loss: f64,
    duration_s: f64,
    seed: u64,
}

/// Motion since a time.
#[derive(Clone, Copy)]
struct Piece {
    begun_s: f64,
    state: State,
    acceleration: Vector3<f64>,
}

impl Piece {
    fn at(&self, time_s: f64) -> State {
        self.state.after(self.acceleration, time_s - self.begun_s)
    }
}

struct Vehicle {
    piece: Piece,
    /// Earlier motion, oldest first.
    past: Vec<Piece>,
    command: Vector3<f64>,
    last_s: f64,
    next_s: f64,
    instants: usize,
    wish: Vector3<f64>,
}

struct Outcome {
    closest_m: f64,
    tracking_share: f64,
    command_share: f64,
    exceeded: Option<Exceeded>,
}

fn towards(vehicles: &[Vehicle], i: usize, time_s: f64) -> Vector3<f64> {
    let own = vehicles[i].piece.at(time_s).position_m;
    let others = vehicles.iter().enumerate().filter(|(j, _)| *j != i);
    let nearest = others.map(|(_, other)| other.piece.at(time_s).position_m - own);
    let nearest = nearest.min_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()));
    nearest.map_or_else(Vector3::zeros, |to| to.normalize())
}

impl Flight {
    fn fly(&self) -> Outcome {
        let mut random = Random::new(self.seed);
        let mut fleet = Fleet::new(&self.limits, &self.starts).expect("starts are apart");
        let mut vehicles: Vec<_> = self
            .starts
            .iter()
            .zip(&self.truth)
            .map(|(start, settings)| {
                let state = State {
                    position_m: start.position_m + flat(random.vector(settings.position_error_m)),
                    velocity_m_s: start.velocity_m_s + flat(random.vector(settings.velocity_error_m_s)),
                };
                let piece = Piece { begun_s: 0.0, state, acceleration: Vector3::zeros() };
                let none = Vector3::zeros();
                Vehicle { piece, past: vec![], command: none, last_s: 0.0, next_s: 0.0, instants: 0, wish: none }
            })
            .collect();
        let mut flying: Vec<(f64, Message)> = vec![];
        let (mut now_s, mut closest_m) = (0.0_f64, f64::INFINITY);
        while now_s < self.duration_s {
            flying.retain(|(arrives_s, message)| {
                if *arrives_s <= now_s {
                    fleet.hear(message);
                }
                *arrives_s > now_s
            });
            for i in 0..vehicles.len() {
                if vehicles[i].next_s <= now_s {
                    self.instant(&mut fleet, &mut vehicles, i, now_s, &mut random);
                    for message in fleet.shields_mut()[i].messages() {
                        if !random.chance(self.loss) {
                            flying.push((now_s + 1e-6 + self.latency_s * random.unit(), message));
                        }
                    }
                }
            }
            self.push(&mut vehicles, now_s, &mut random);
            let next_s = vehicles.iter().map(|vehicle| vehicle.next_s).fold(f64::INFINITY, f64::min);
            for i in 0..vehicles.len() {
                for j in i + 1..vehicles.len() {
                    let [one, other] = [i, j].map(|k| &vehicles[k].piece);
                    let (one_at, other_at) = (one.at(now_s), other.at(now_s));
                    let (least_m, _) = least_separation(
                        &(one_at.position_m - other_at.position_m),
                        &(one_at.velocity_m_s - other_at.velocity_m_s),
                        &(one.acceleration - other.acceleration),
                        next_s - now_s,
                    );
                    closest_m = closest_m.min(least_m);
                }
            }
            for (vehicle, shield) in vehicles.iter().zip(fleet.shields_mut()) {
                for share in [0.25, 0.5, 0.75, 1.0] {
                    let time_s = now_s + share * (next_s - now_s);
                    shield.observe(time_s - vehicle.last_s, &vehicle.piece.at(time_s));
                }
            }
            now_s = next_s;
        }
        let report = fleet.report();
        Outcome {
            closest_m,
            tracking_share: report.tracking_share.unwrap_or_default(),
            command_share: report.command_share.unwrap_or_default(),
            exceeded: report.exceeded(),
        }
    }

    /// Begins a piece of motion of every vehicle, with a new push.
    fn push(&self, vehicles: &mut [Vehicle], now_s: f64, random: &mut Random) {
        for i in 0..vehicles.len() {
            let bound = self.truth[i].disturbance_m_s2;
            let push = match self.adversary {
                Adversary::Random => flat(random.vector(bound)),
                Adversary::Greedy | Adversary::Listed => towards(vehicles, i, now_s) * bound,
            };
            let state = vehicles[i].piece.at(now_s);
            let acceleration = vehicles[i].command + push;
            let before = std::mem::replace(&mut vehicles[i].piece, Piece { begun_s: now_s, state, acceleration });
            vehicles[i].past.push(before);
        }
    }

    fn instant(&self, fleet: &mut Fleet, vehicles: &mut [Vehicle], i: usize, now_s: f64, random: &mut Random) {
        let settings = &self.truth[i];
        let towards = towards(vehicles, i, now_s);
        let listed = self.list.get(i).and_then(|list| list.get(vehicles[i].instants)).copied().unwrap_or([1.0; 2]);
        let age_s = settings.measurement_age_s
            * match self.adversary {
                Adversary::Random => [0.0, 1.0, random.unit()][random.index(3)],
                Adversary::Greedy => 1.0,
                Adversary::Listed => listed[1],
            };
        let measured_s = (now_s - age_s).max(0.0);
        let pieces = vehicles[i].past.iter().chain([&vehicles[i].piece]);
        let truth =
            pieces.rev().find(|piece| piece.begun_s <= measured_s).map_or(self.starts[i], |piece| piece.at(measured_s));
        let errors = [settings.position_error_m, settings.velocity_error_m_s].map(|bound| match self.adversary {
            Adversary::Random => flat(random.vector(bound)),
            Adversary::Greedy | Adversary::Listed => -towards * bound,
        });
        let measured = State { position_m: truth.position_m + errors[0], velocity_m_s: truth.velocity_m_s + errors[1] };
        let largest = settings.accel_m_s2;
        if !self.dives && (vehicles[i].instants == 0 || random.chance(0.1)) {
            vehicles[i].wish = flat(random.direction()) * largest;
        }
        let wanted = if self.dives { towards * largest } else { vehicles[i].wish };
        let shield = &mut fleet.shields_mut()[i];
        let elapsed_s = now_s - vehicles[i].last_s;
        vehicles[i].command = match self.known {
            Known::Clock => {
                let error_s = settings.elapsed_error_s * if random.chance(0.5) { 1.0 } else { -1.0 };
                shield.filter_timed(measured, wanted, Timing { elapsed_s: elapsed_s + error_s, age_s })
            }
            Known::Nothing => shield.filter(measured, wanted),
        };
        let [shortest_s, longest_s] = times_s(settings);
        let until = |share: f64| shortest_s + share * (longest_s - shortest_s);
        let share = match self.adversary {
            Adversary::Random => [0.0, 1.0, random.unit()][random.index(3)],
            Adversary::Greedy => {
                let state = vehicles[i].piece.at(now_s);
                let reach = |share: f64| {
                    let after = state.after(vehicles[i].command, until(share));
                    towards.dot(&(after.position_m + after.velocity_m_s * 0.3))
                };
                [0.0, 0.5, 1.0].into_iter().max_by(|a, b| reach(*a).total_cmp(&reach(*b))).expect("three")
            }
            Adversary::Listed => listed[0],
        };
        let vehicle = &mut vehicles[i];
        (vehicle.last_s, vehicle.next_s) = (now_s, now_s + until(share));
        vehicle.instants += 1;
        // Motion that no measurement needs any more.
        if vehicle.past.len() > 400 {
            vehicle.past.drain(..200);
        }
    }

    /// Improves the list of times and ages for a number of flights. Returns the least separation of all.
    fn search(&mut self, flights: usize, random: &mut Random) -> f64 {
        self.adversary = Adversary::Listed;
        let share = |random: &mut Random| [0.0, 1.0, random.unit()][random.index(3)];
        self.list =
            (0..self.starts.len()).map(|_| (0..400).map(|_| [share(random), share(random)]).collect()).collect();
        let mut best_m = f64::INFINITY;
        for _ in 0..flights {
            let before = self.list.clone();
            for list in &mut self.list {
                // A stretch of one vehicle, or single entries.
                let (from, every) = (random.index(list.len()), 1 + random.index(4));
                let value = [share(random), share(random)];
                list.iter_mut().skip(from).take(12).step_by(every).for_each(|entry| *entry = value);
            }
            let outcome = self.fly();
            if outcome.closest_m < best_m {
                best_m = outcome.closest_m;
            } else {
                self.list = before;
            }
        }
        best_m
    }
}

fn flat(vector: Vector3<f64>) -> Vector3<f64> {
    Vector3::new(vector.x, vector.y, 0.0)
}

fn times_s(settings: &Settings) -> [f64; 2] {
    let Settings { period_s, period_tolerance, hang_periods, .. } = *settings;
    [period_s * (1.0 - period_tolerance), period_s * (1.0 + period_tolerance) * (hang_periods + 1) as f64]
}

/// Returns random settings with irregular instants and old measurements.
fn random_settings(random: &mut Random) -> Settings {
    let period_s = [0.02, 0.05][random.index(2)];
    let age = [0.0, 0.0, random.between(0.0, 0.1)][random.index(3)];
    Settings {
        accel_m_s2: [5.0, 8.0][random.index(2)],
        max_speed_m_s: [1.0, 2.0, 4.0][random.index(3)],
        position_error_m: random.between(0.0, 0.03),
        velocity_error_m_s: random.between(0.0, 0.05),
        disturbance_m_s2: random.between(0.0, 0.4),
        period_tolerance: [0.0, 0.1, 0.3, random.between(0.0, 0.5)][random.index(4)],
        hang_periods: [0, 0, 1, 3][random.index(4)],
        measurement_age_s: age,
        turn: [1.0, 0.0][random.index(2)],
        ease_m: [None, Some(0.0)][random.index(2)],
        stop_only: random.chance(0.3),
        ..Settings::new(DELTA_M, period_s)
    }
}

fn limits(random: &mut Random, count: usize) -> Vec<Limits> {
    std::iter::repeat_with(|| {
        let mut settings = random_settings(random);
        if settings.period_tolerance > 0.0 && random.chance(0.5) {
            settings.elapsed_error_s = random.between(0.0, 0.0005);
        }
        settings.limits().ok()
    })
    .flatten()
    .take(count)
    .collect()
}

/// Returns a flight of vehicles that start near each other.
fn flight(seed: u64, known: &[Limits]) -> Flight {
    let mut random = Random::new(seed);
    let count = 2 + random.index(4);
    let first = known[random.index(known.len())];
    let apart = random.chance(0.5);
    let limits: Vec<_> = (0..count).map(|_| if apart { known[random.index(known.len())] } else { first }).collect();
    let mut half_m = 1.5;
    let starts = loop {
        half_m *= 1.02;
        let starts: Vec<_> = limits
            .iter()
            .map(|limits| State {
                position_m: flat(Vector3::from_fn(|_, _| random.between(-half_m, half_m))),
                velocity_m_s: flat(random.vector(limits.settings().max_speed_m_s)),
            })
            .collect();
        if Fleet::new(&limits, &starts).is_ok() {
            break starts;
        }
    };
    Flight {
        truth: limits.iter().map(|limits| *limits.settings()).collect(),
        limits,
        starts,
        adversary: [Adversary::Random, Adversary::Greedy][random.index(2)],
        known: Known::Clock,
        list: vec![],
        dives: random.chance(0.6),
        latency_s: random.between(0.0, 0.2),
        loss: random.between(0.0, 0.3),
        duration_s: 4.0,
        seed: seed ^ 0xA5A5,
    }
}

/// Flies flights of random settings, half of them with a search of times and ages. Returns the least separation, the
/// largest share of a tube, and the number of flights.
fn fly(seeds: std::ops::Range<u64>, settings: usize) -> (f64, f64, u64) {
    let known = limits(&mut Random::new(seeds.start ^ 0x4D), settings);
    let (mut closest_m, mut largest, mut flights) = (f64::INFINITY, 0.0_f64, 0);
    for seed in seeds {
        let mut flight = flight(seed, &known);
        let outcome = flight.fly();
        assert!(outcome.closest_m >= DELTA_M, "flight {seed}: {}", outcome.closest_m);
        assert_eq!(outcome.exceeded, None, "flight {seed}");
        assert!(outcome.command_share <= 1.0, "flight {seed}: {}", outcome.command_share);
        (closest_m, largest) = (closest_m.min(outcome.closest_m), largest.max(outcome.tracking_share));
        flights += 1;
        if seed % 10 == 0 {
            let found_m = flight.search(10, &mut Random::new(seed));
            assert!(found_m >= DELTA_M, "search {seed}: {found_m}");
            closest_m = closest_m.min(found_m);
            flights += 10;
        }
    }
    (closest_m, largest, flights)
}

/// Sums of times and ages have rounding, so an age may count as older than all commands since.
#[test]
fn ages_at_their_bound_keep_the_safety_distance_and_every_bound() {
    let mut flights = 0;
    for period_s in [0.005, 0.02, 0.05, 0.1] {
        for periods in 1_u32..=20 {
            let settings = Settings {
                measurement_age_s: f64::from(periods) * period_s,
                disturbance_m_s2: 0.4,
                tracker_per_s2: 1.0,
                tracker_per_s: 1.5,
                ..Settings::new(DELTA_M, period_s)
            };
            let Ok(limits) = settings.limits() else { continue };
            let mut flight = flight(periods.into(), &[limits]);
            (flight.dives, flight.adversary) = (true, Adversary::Greedy);
            let outcome = flight.fly();
            assert!(outcome.closest_m >= DELTA_M, "{period_s} {periods}: {}", outcome.closest_m);
            assert!(outcome.exceeded.is_none(), "{period_s} {periods}: {:?}", outcome.exceeded);
            flights += 1;
        }
    }
    assert!(flights >= 60, "{flights}");
}

/// 400 flights, or 20,000 with `TAUTLINE_LONG`.
#[test]
fn irregular_flights_keep_the_safety_distance_and_every_bound() {
    let (seeds, settings) = if long() { (10_000, 200) } else { (200, 40) };
    let (closest_m, largest, flights) = fly(0..seeds, settings);
    assert_eq!(flights, 2 * seeds);
    let (near_m, share) = if long() { (0.001, 0.99) } else { (0.01, 0.6) };
    assert!(closest_m < DELTA_M + near_m && largest > share, "{closest_m} {largest}");
}

/// Returns the number of flights that violate, and the least separation, with shields whose settings are changed.
fn twins(flights: u64, truth: &Settings, change: impl Fn(&mut Flight, &Limits)) -> (usize, f64) {
    let limits = truth.limits().expect("valid");
    let mut found = vec![];
    for seed in 0..flights {
        let mut flight = flight(seed, &[limits]);
        (flight.dives, flight.adversary) = (true, Adversary::Greedy);
        change(&mut flight, &limits);
        if Fleet::new(&flight.limits, &flight.starts).is_ok() {
            let outcome = flight.fly().closest_m.min(flight.search(5, &mut Random::new(seed)));
            found.push(outcome);
        }
    }
    let least = found.iter().copied().fold(f64::INFINITY, f64::min);
    (found.iter().filter(|closest_m| **closest_m < DELTA_M).count(), least)
}

/// Settings of the twins: exact states, no push, no ease.
fn twin_settings() -> Settings {
    Settings { ease_m: Some(0.0), stop_only: true, ..Settings::new(DELTA_M, 0.05) }
}

/// Compares flights under these settings with flights whose shields have other settings and receive no times. All of
/// those must violate, down to the separation `closest_m`.
fn compare(truth: &Settings, unaware: &Settings, closest_m: f64) {
    let (violations, least) = twins(40, truth, |_, _| ());
    assert_eq!(violations, 0, "{least}");
    let limits = unaware.limits().expect("valid");
    let (violations, twin) = twins(40, truth, |flight, _| {
        flight.limits.iter_mut().for_each(|own| *own = limits);
        flight.known = Known::Nothing;
    });
    assert!(violations == 40 && (twin - closest_m).abs() < 0.01, "{violations} of 40 violate, least {twin}");
}

#[test]
fn a_shield_without_tolerance_violates_with_longer_periods() {
    let settings = twin_settings();
    compare(&Settings { period_tolerance: 0.1, ..settings }, &settings, 0.91);
}

#[test]
fn a_shield_without_hangs_violates_with_hangs() {
    let settings = twin_settings();
    compare(&Settings { hang_periods: 3, ..settings }, &settings, 0.0);
}

#[test]
fn a_shield_for_new_measurements_violates_with_old_ones() {
    let settings = twin_settings();
    compare(&Settings { measurement_age_s: 0.1, ..settings }, &settings, 0.75);
}

#[test]
fn a_shield_with_the_brake_of_regular_instants_violates() {
    let truth = Settings { hang_periods: 3, period_tolerance: 0.1, ..twin_settings() };
    let (violations, least) = twins(40, &truth, |flight, limits| {
        let mut limits = *limits;
        limits.envelope.brake = Brake::new(limits.brake().deceleration_m_s2(), 0.05);
        flight.limits.iter_mut().for_each(|own| *own = limits);
    });
    assert_eq!(violations, 40, "{least}");
}

#[test]
fn unknown_times_are_covered_as_errors_of_the_elapsed_time() {
    let settings = twin_settings();
    let truth = Settings { period_tolerance: 0.1, elapsed_error_s: 0.005, ..settings };
    let (violations, least) = twins(40, &truth, |flight, _| flight.known = Known::Nothing);
    assert_eq!(violations, 0, "{least}");
}
