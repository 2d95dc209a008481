//! Random flights with all imperfections within their bounds, and flights whose end is known.

use nalgebra::Vector3;

use super::Random;
use super::world::{Flight, Law, Radio, STEPS, World, flat};
use crate::{Fleet, Limits, Settings, State};

/// Safety distance of the random flights \[m\].
const DELTA_M: f64 = 1.0;

/// Whether the environment asks for more flights.
pub(super) fn long() -> bool {
    std::env::var_os("TAUTLINE_LONG").is_some()
}

/// Ranges of the imperfections of random flights.
#[derive(Clone, Copy)]
pub(super) struct Ranges {
    pub(super) most_vehicles: usize,
    pub(super) laws: &'static [Law],
    pub(super) imperfect: bool,
}

/// Returns random settings, starts, law and radio.
pub(super) fn random_flight(seed: u64, ranges: Ranges) -> Flight {
    let mut random = Random::new(seed);
    let period_s = [0.02, 0.05, 0.1][random.index(3)];
    let mut settings = Settings {
        accel_m_s2: [4.0, 6.0][random.index(2)],
        max_speed_m_s: [1.0, 2.0, 4.0][random.index(3)],
        turn: [1.0, 1.0, 0.0, -1.0][random.index(4)],
        ease_m: [None, Some(0.0)][random.index(2)],
        stop_only: random.chance(0.2),
        ..Settings::new(DELTA_M, period_s)
    };
    let mut radio = Radio::default();
    if ranges.imperfect {
        settings.position_error_m = random.between(0.0, 0.05);
        settings.velocity_error_m_s = random.between(0.0, 0.1);
        settings.disturbance_m_s2 = random.between(0.0, 0.5);
        settings.a22_per_s = random.between(-0.3, 0.1);
        settings.measurement_delay_periods = if period_s < 0.1 { random.index(3) } else { 0 };
        radio = Radio {
            latency_s: random.between(0.0, 0.3),
            loss: random.between(0.0, 0.5),
            burst: [1.0, 5.0][random.index(2)],
            duplicates: 0.2,
            every_third: false,
        };
    }
    let count = 2 + random.index(ranges.most_vehicles - 1);
    let planar = random.chance(0.5);
    let law = ranges.laws[random.index(ranges.laws.len())];
    let apart = ranges.imperfect && random.chance(0.5);
    // Different periods, margins and commands need no agreement.
    let instants: Vec<_> = (0..count).map(|_| if apart { STEPS - 1 + random.index(4) } else { STEPS }).collect();
    let shares: Vec<_> = (0..4).map(|_| if apart { random.unit() } else { 1.0 }).collect();
    let of_steps: Vec<_> = (0..4)
        .map(|k| {
            let mut own = settings;
            own.period_s = period_s * (STEPS - 1 + k) as f64 / STEPS as f64;
            own.position_error_m *= shares[k];
            (apart || k == 1).then(|| own.limits().expect("settings are valid"))
        })
        .collect();
    let limits: Vec<_> =
        instants.iter().map(|steps| of_steps[steps + 1 - STEPS].expect("periods that are used")).collect();
    let moves = random.chance(0.5);
    let largest = limits.iter().map(Limits::margin_m).fold(0.0, f64::max);
    let least = 2.0 * largest + if moves { 0.6 } else { 0.02 };
    let starts = loop {
        let starts: Vec<_> = places(&mut random, count, least, planar)
            .into_iter()
            .map(|position_m| {
                let fastest = if moves { settings.max_speed_m_s } else { 0.0 };
                State { position_m, velocity_m_s: flat(random.vector(fastest), planar) }
            })
            .collect();
        if Fleet::new(&limits, &starts).is_ok() {
            break starts;
        }
    };
    let slots = places(&mut random, count, least + 0.3, planar);
    let common = limits[0];
    Flight {
        limits,
        law,
        radio,
        period_s,
        instants,
        duration_s: 8.0,
        planar,
        adversarial: random.chance(0.5),
        seed: seed ^ 0x5EED,
        ..Flight::new(&common, starts, slots)
    }
}

/// Returns points at least so far apart.
fn places(random: &mut Random, count: usize, least_m: f64, planar: bool) -> Vec<Vector3<f64>> {
    let mut found: Vec<Vector3<f64>> = vec![];
    let mut half = least_m;
    while found.len() < count {
        let place = Vector3::from_fn(|_, _| random.between(-half, half));
        let place = flat(place, planar);
        if found.iter().all(|other| (place - other).norm() >= least_m) {
            found.push(place);
        } else {
            half *= 1.01;
        }
    }
    found
}

#[test]
fn random_flights_keep_the_safety_distance_and_every_bound() {
    let laws = &[Law::Slot, Law::DiveAtNearest, Law::DiveAtCentre, Law::Random];
    let (flights, most_vehicles) = if long() { (5_000, 30) } else { (300, 10) };
    let ranges = Ranges { most_vehicles, laws, imperfect: true };
    let (mut closest, mut largest_share, mut changed) = (f64::INFINITY, 0.0_f64, 0);
    for seed in 0..flights {
        let flight = random_flight(seed, ranges);
        let world = flight.fly();
        assert!(world.closest_m >= DELTA_M, "flight {seed}: {} at {}", world.closest_m, world.closest_s);
        let report = world.report();
        assert_eq!(report.exceeded(), None, "flight {seed}: {report:?}");
        closest = closest.min(world.closest_m);
        largest_share = largest_share.max(report.tracking_share);
        changed += report.changed;
    }
    // The flights use what they are given: some vehicles come close, and some tubes are used up.
    assert!(closest < DELTA_M + 0.05 && largest_share > 0.8 && changed > 10_000, "{closest} {largest_share} {changed}");
}

#[test]
fn a_dive_at_the_nearest_vehicle_comes_to_the_safety_distance_and_no_closer() {
    let ranges = Ranges { most_vehicles: 8, laws: &[Law::DiveAtNearest], imperfect: false };
    let closest = (0..40).map(|seed| random_flight(seed, ranges).fly().closest_m).fold(f64::INFINITY, f64::min);
    assert!((0.0..2e-6).contains(&(closest - DELTA_M)), "{closest}");
}

/// Two vehicles that swap their places head-on, exactly.
fn head_on(settings: Settings) -> Flight {
    let starts = [-4.0, 4.0].map(|x| State::at_rest(Vector3::new(x, 0.0, 0.0))).to_vec();
    let slots = [4.0, -4.0].map(|x| Vector3::new(x, 0.0, 0.0)).to_vec();
    Flight { duration_s: 20.0, planar: true, ..Flight::new(&settings.limits().expect("valid"), starts, slots) }
}

#[test]
fn two_vehicles_that_only_stop_end_head_on_at_the_safety_distance_and_two_tubes() {
    let settings = Settings { tracking_error_m: Some(0.25), stop_only: true, ..Settings::new(DELTA_M, 0.05) };
    let world = head_on(settings).fly();
    let apart = (world.states[0].position_m - world.states[1].position_m).norm();
    // The last centimetres take the longest: the distance to a plane halves in a constant time.
    assert!((0.0..1e-4).contains(&(apart - 1.5)), "{apart}");
}

#[test]
fn two_vehicles_that_give_way_arrive_under_latency_and_loss() {
    let settings = Settings::new(DELTA_M, 0.05);
    for (radio, duration_s) in [
        (Radio::default(), 20.0),
        (Radio { latency_s: 1.0, ..Radio::default() }, 60.0),
        (Radio { loss: 0.9, ..Radio::default() }, 60.0),
        (Radio { loss: 0.3, burst: 10.0, latency_s: 0.3, duplicates: 0.5, ..Radio::default() }, 60.0),
    ] {
        let flight = Flight { radio, duration_s, ..head_on(settings) };
        let world = flight.fly();
        assert!(world.closest_m >= DELTA_M, "{radio:?}: {}", world.closest_m);
        for (state, slot) in world.states.iter().zip(&flight.slots) {
            assert!((state.position_m - slot).norm() < 0.1, "{radio:?}: {}", state.position_m);
        }
    }
}

#[test]
fn a_crowd_is_clear_under_a_second_of_latency_and_nine_of_ten_messages_lost() {
    let ranges = Ranges { most_vehicles: 10, laws: &[Law::Slot, Law::DiveAtCentre], imperfect: false };
    for seed in 0..20 {
        let radios = [Radio { latency_s: 1.0, ..Radio::default() }, Radio { loss: 0.9, ..Radio::default() }];
        for radio in radios {
            let world = Flight { radio, ..random_flight(seed, ranges) }.fly();
            assert!(world.closest_m >= DELTA_M, "{seed} {radio:?}: {}", world.closest_m);
        }
    }
}

#[test]
fn circles_and_crossing_crowds_arrive() {
    let limits = Settings::new(DELTA_M, 0.05).limits().expect("valid");
    for seed in 0..8 {
        let mut random = Random::new(seed);
        let (starts, slots): (Vec<_>, Vec<_>) = if seed % 2 == 0 {
            // Opposite places of a circle, up to 0.1 m beside it.
            let place = |k: usize| Vector3::from([[4.0, 0.0, 0.0], [2.0, 3.4, 0.0], [-2.0, 3.4, 0.0]][k % 3]);
            let place = |k: usize| if k < 3 { place(k) } else { -place(k) };
            (0..6).map(|k| (place(k) + flat(random.vector(0.1), true), place((k + 3) % 6))).unzip()
        } else {
            let starts = places(&mut random, 10, 2.4, true);
            starts.into_iter().zip(places(&mut random, 10, 2.4, true)).unzip()
        };
        let starts: Vec<_> = starts.into_iter().map(State::at_rest).collect();
        let radio = Radio { latency_s: 0.1, loss: 0.3, burst: 3.0, ..Radio::default() };
        let flight = Flight { duration_s: 60.0, planar: true, radio, ..Flight::new(&limits, starts, slots) };
        let world = flight.fly();
        assert!(world.closest_m >= DELTA_M, "{seed}: {}", world.closest_m);
        let left = world.states.iter().zip(&flight.slots).map(|(state, slot)| (state.position_m - slot).norm());
        assert!(left.fold(0.0, f64::max) < 0.1, "{seed}: {:?}", world.states);
    }
}

#[test]
fn a_saved_flight_continues_with_the_same_bits() {
    let ranges = Ranges { most_vehicles: 6, laws: &[Law::Slot], imperfect: true };
    let flight = random_flight(3, ranges);
    let mut world = World::new(&flight);
    (0..200).for_each(|_| world.step(&flight));
    let mut loaded = world.clone();
    (0..200).for_each(|_| world.step(&flight));
    (0..200).for_each(|_| loaded.step(&flight));
    assert_eq!(world.states, loaded.states);
    assert_eq!(world.report(), loaded.report());
    assert_eq!(format!("{:?}", world.fleet), format!("{:?}", loaded.fleet));
}

#[test]
fn a_broadcast_contains_the_messages_and_is_heard_like_them() {
    let ranges = Ranges { most_vehicles: 6, laws: &[Law::Slot], imperfect: true };
    let flight = random_flight(3, ranges);
    let mut world = World::new(&flight);
    (0..101).for_each(|_| world.step(&flight));
    // The messages of the last instants have been taken.
    for shield in world.fleet.shields_mut() {
        shield.filter(shield.next_reference(), Vector3::zeros());
    }
    let (mut by_message, mut by_broadcast) = (world.fleet.clone(), world.fleet.clone());
    let mut broadcast = crate::Broadcast::default();
    let count = u32::try_from(world.states.len()).expect("few");
    let mut count_sent = 0;
    for shield in world.fleet.shields_mut() {
        // Messages are taken once.
        shield.clone().write_broadcast(&mut broadcast);
        let sent: Vec<_> = shield.messages().collect();
        let contained: Vec<_> = (0..count + 2).filter_map(|to| broadcast.message(to)).collect();
        assert_eq!((&contained, broadcast.messages().collect::<Vec<_>>()), (&sent, sent.clone()));
        assert_eq!(shield.messages().count(), 0);
        count_sent += sent.len();
        for message in &sent {
            by_message.hear(message);
        }
        by_broadcast.hear_broadcast(&broadcast);
        let json = serde_json::to_string(&broadcast).expect("plain data");
        assert_eq!(serde_json::from_str::<crate::Broadcast>(&json).expect("plain data"), broadcast);
    }
    assert!(count_sent > 3, "{count_sent}");
    assert_ne!(format!("{by_message:?}"), format!("{:?}", world.fleet));
    assert_eq!(format!("{by_broadcast:?}"), format!("{by_message:?}"));
}

#[test]
fn invalid_numbers_and_messages_leave_the_reference_finite_and_are_counted() {
    let limits = [Settings::new(DELTA_M, 0.05).limits().expect("valid"); 2];
    let states = [-1.0, 1.0].map(|x| State::at_rest(Vector3::new(x, 0.0, 0.0)));
    let mut fleet = Fleet::new(&limits, &states).expect("apart");
    let invalid = Vector3::new(f64::NAN, f64::INFINITY, 0.0);
    let mut commands = [Vector3::zeros(); 2];
    fleet.filter(&[State::at_rest(invalid), states[1]], &[invalid, invalid], &mut commands);
    assert!(commands.iter().all(|command| command.iter().all(|value| value.is_finite())), "{commands:?}");
    let report = fleet.report();
    assert_eq!((report.missing_measurements, report.brakes), (1, 2));
    assert!(report.exceeded().is_some());

    let message = fleet.messages().next().expect("two vehicles");
    let json = serde_json::to_string(&message).expect("plain data");
    assert_eq!(serde_json::from_str::<crate::Message>(&json).expect("plain data"), message);
    let before = fleet.clone();
    let mut bad = message;
    bad.stamp = 99;
    bad.segment.stop_m[1] = f64::NAN;
    fleet.hear(&bad);
    for (from, to) in [(7, 1), (1, 1), (0, 9)] {
        fleet.hear(&crate::Message { from, to, stamp: 99, ..message });
    }
    assert_eq!(format!("{fleet:?}"), format!("{before:?}"));
}
