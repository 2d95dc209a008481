//! Random flights with all imperfections within their bounds, and flights whose end is known.

use nalgebra::Vector3;
use tautline_core::fact::FactKind;

use super::Random;
use super::world::{Flight, Law, Radio, STEPS, World, flat};
use crate::plane::Segment;
use crate::report::Exceeded;
use crate::{Body, Counters, Fleet, Limits, Message, SavedShield, Settings, Shield, ShieldError, Start, State, Timing};

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
        largest_share = largest_share.max(report.tracking_share.expect("observed"));
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
    let count = u16::try_from(world.states.len()).expect("few");
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
        for message in &sent {
            let read = Message::from_bytes(&message.to_bytes()).expect("own bytes");
            assert_eq!(
                (read.from, read.to, read.stamp, read.starts),
                (message.from, message.to, message.stamp, message.starts)
            );
        }
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
    let before = fleet.clone();
    let segment = Segment::new(Vector3::x() * f64::NAN, Vector3::zeros());
    let invalid = Message { from: 1, to: 0, body: Body::Follower { segment, decision: None }, ..message };
    fleet.hear(&invalid);
    fleet.hear(&Message { stamp: 0, ..message });
    fleet.hear(&Message { from: 1, to: 1, ..message });
    // To a vehicle that does not exist.
    fleet.hear(&Message { to: 9, ..message });
    fleet.shields_mut()[1].hear_bytes(b"{}");
    fleet.shields_mut()[1].hear_bytes(&message.to_bytes()[1..]);
    assert_eq!(fleet.report().invalid_messages, 5);
    // Nothing else has changed.
    for (shield, before) in fleet.shields().iter().zip(before.shields()) {
        let without = Counters { invalid_messages: 0, ..*shield.counters() };
        assert_eq!((without, shield.segment()), (*before.counters(), before.segment()));
        assert_eq!(format!("{:?}", shield.assumptions()), format!("{:?}", before.assumptions()));
    }
    assert_eq!(fleet.report().exceeded(), before.report().exceeded());
}

/// Returns shields of vehicles with these settings, each from the announced bytes of all, at 0 and `apart_m` along x.
/// The second one flies at the first one at 1.5 m/s.
fn announced(settings: &[Settings; 2], apart_m: f64) -> Result<[Shield; 2], ShieldError> {
    let limits = settings.each_ref().map(|settings| settings.limits().expect("valid"));
    let states = [[0.0, 0.0], [apart_m, -1.5]]
        .map(|[x, v]| State { position_m: Vector3::x() * x, velocity_m_s: Vector3::x() * v });
    let sent = [0, 1].map(|i| limits[i].start(states[i]).expect("valid").to_bytes());
    let starts = sent.map(|bytes| Start::from_bytes(&bytes).expect("own bytes"));
    Ok([Shield::new(&limits[0], 0, &starts)?, Shield::new(&limits[1], 1, &starts)?])
}

/// Flies two exact vehicles at each other without a radio, each at its own period. Returns the least separation.
fn closest_without_radio(mut shields: [Shield; 2]) -> f64 {
    let periods = [0, 1].map(|i| shields[i].limits().settings().period_s);
    let (mut next, mut now) = ([0.0_f64; 2], 0.0_f64);
    let mut states = [0, 1].map(|i| shields[i].next_reference());
    let (mut commands, mut begun) = ([Vector3::zeros(); 2], [0.0; 2]);
    let mut closest = f64::INFINITY;
    while now < 6.0 {
        for (i, shield) in shields.iter_mut().enumerate() {
            if now >= next[i] - 1e-9 {
                (states[i], begun[i]) = (shield.next_reference(), now);
                let towards = if i == 0 { 50.0 } else { -50.0 };
                commands[i] = shield.filter(states[i], Vector3::x() * towards);
                next[i] += periods[i];
            }
        }
        let places = [0, 1].map(|i| states[i].after(commands[i], now - begun[i]).position_m);
        closest = closest.min((places[1] - places[0]).norm());
        now += 0.001;
    }
    closest
}

#[test]
fn vehicles_with_different_settings_stay_apart_by_the_starts_that_they_announce() {
    let base = Settings { ease_m: Some(0.0), turn: 0.0, ..Settings::new(1.0, 0.05) };
    let brake = |brake| Settings { brake_m_s2: Some(brake), ..base };
    let accel = |accel_m_s2| Settings { accel_m_s2, ..base };
    let period = |period_s| Settings { period_s, ..base };
    let error = |position_error_m| Settings { position_error_m, ..base };
    for settings in [
        [brake(3.0), brake(1.0)],
        [brake(1.0), brake(3.0)],
        [accel(5.0), accel(2.0)],
        [period(0.02), period(0.2)],
        [error(0.0), error(0.1)],
    ] {
        let apart = [2.2, 2.4, 2.8, 3.2].into_iter().find_map(|apart_m| announced(&settings, apart_m).ok());
        let closest = closest_without_radio(apart.expect("far enough"));
        assert!((1.0..1.6).contains(&closest), "{settings:?}: {closest}");
    }
    // delta and ellipsoid are shared.
    let other = Settings { delta_m: 2.0, ..base };
    let error = announced(&[base, other], 9.0).expect_err("delta").to_string();
    assert!(error.starts_with("delta_m: vehicle 2 has another value (1)"), "{error}");
    let other = Settings { half_height_m: Some(0.3), ..base };
    let error = announced(&[base, other], 9.0).expect_err("ellipsoid").to_string();
    assert!(error.starts_with("half_height_m: vehicle 2 has another value"), "{error}");
}

#[test]
fn vehicles_that_compute_the_start_of_the_other_one_from_their_own_settings_violate() {
    let base = Settings { ease_m: Some(0.0), turn: 0.0, ..Settings::new(1.0, 0.05) };
    let brake = |brake| Settings { brake_m_s2: Some(brake), ..base };
    let accel = |accel_m_s2| Settings { accel_m_s2, ..base };
    let period = |period_s| Settings { period_s, ..base };
    let delta = |delta_m| Settings { delta_m, ..base };
    for (settings, apart_m, certified_m) in [
        ([brake(3.0), brake(1.0)], 2.2, 1.0),
        ([accel(5.0), accel(2.0)], 2.2, 1.0),
        ([period(0.02), period(0.2)], 2.2, 1.0),
        ([delta(1.0), delta(2.0)], 3.2, 2.0),
    ] {
        let states = [[0.0, 0.0], [apart_m, -1.5]]
            .map(|[x, v]| State { position_m: Vector3::x() * x, velocity_m_s: Vector3::x() * v });
        let shields = [0, 1].map(|i| {
            let limits = settings[i].limits().expect("valid");
            let starts = states.map(|state| limits.start(state).expect("valid"));
            Shield::of_checked(&limits, i, &starts.as_slice().into()).expect("apart")
        });
        let closest = closest_without_radio(shields);
        assert!(closest < certified_m - 0.005, "{settings:?}: {closest}");
    }
}

#[test]
fn an_own_start_of_other_settings_is_refused() {
    let base = Settings::new(1.0, 0.05);
    let limits = base.limits().expect("valid");
    let weak = Settings { brake_m_s2: Some(1.0), ..base }.limits().expect("valid");
    let moving = State { position_m: Vector3::x() * 5.0, velocity_m_s: Vector3::x() };
    let other = limits.start(State::at_rest(Vector3::zeros())).expect("valid");
    let own = weak.start(moving).expect("valid").with_flight(7);
    assert!(Shield::new(&weak, 1, &[other, own]).is_ok());
    let error = Shield::new(&limits, 1, &[other, own]).expect_err("another brake").to_string();
    assert!(error.starts_with("start: the announced start of vehicle 2 is not that of its own settings"), "{error}");
    assert!(Shield::new(&limits, 2, &[other, own]).expect_err("no such vehicle").to_string().starts_with("index: "));
}

#[test]
fn another_version_of_a_start_voids_the_certificate_on_both_sides_by_the_first_message() {
    let limits = Settings::new(1.0, 0.05).limits().expect("valid");
    let start = |x: f64| limits.start(State::at_rest(Vector3::x() * x)).expect("valid");
    let held = [[start(0.0), start(2.2)], [start(0.0).with_flight(1), start(2.2)]];
    let mut shields = [0, 1].map(|i| Shield::new(&limits, i, &held[i]).expect("apart"));
    for _ in 0..40 {
        for (i, shield) in shields.iter_mut().enumerate() {
            let towards = if i == 0 { 5.0 } else { -5.0 };
            shield.filter(shield.next_reference(), Vector3::x() * towards);
        }
        for i in 0..2 {
            for message in shields[i].messages().collect::<Vec<_>>() {
                shields[1 - i].hear_bytes(&message.to_bytes());
            }
        }
    }
    for (i, shield) in shields.iter().enumerate() {
        let counters = shield.counters();
        let other = u16::try_from(1 - i).expect("small");
        assert_eq!(counters.exceeded(), Some(Exceeded::OtherStarts(other)));
        assert!(counters.other_starts >= 30 && counters.accepted + counters.refused == 0, "{counters:?}");
        assert_eq!((shield.shared_starts().agreed, shield.assumptions()[0].held), (0, Some(false)));
    }
    // Both wait behind the first plane.
    let places = [0, 1].map(|i| shields[i].next_reference().position_m.x);
    assert!(places[0] <= 0.6 && places[1] >= 1.6, "{places:?}");

    // A message from a vehicle without a start.
    let mut alone = Shield::new(&limits, 0, &held[0][..1]).expect("alone");
    let body = Body::Follower { segment: alone.segment(), decision: None };
    alone.hear(&Message { from: 4, to: 0, stamp: 1, starts: 1, body });
    assert_eq!(alone.counters().exceeded(), Some(Exceeded::UnknownSender));
}

#[test]
fn messages_of_an_earlier_flight_void_the_certificate_and_are_not_read() {
    let limits = Settings::new(1.0, 0.05).limits().expect("valid");
    let flight = |flight: u64| {
        let start = |x: f64| limits.start(State::at_rest(Vector3::x() * x)).expect("valid").with_flight(flight);
        let starts = [start(0.0), start(2.5)];
        [0, 1].map(|i| Shield::new(&limits, i, &starts).expect("apart"))
    };
    let period = |shields: &mut [Shield; 2], wanted: f64| {
        for shield in shields.iter_mut() {
            shield.filter(shield.next_reference(), Vector3::x() * wanted);
        }
        let sent: Vec<_> = shields.iter_mut().flat_map(Shield::messages).collect();
        for message in &sent {
            shields[message.to as usize].hear(message);
        }
        sent
    };
    let mut earlier = flight(1);
    let old: Vec<_> = (0..100).flat_map(|_| period(&mut earlier, 2.0)).collect();
    let proposals = old.iter().filter(|message| matches!(message.body, Body::Owner { proposal: Some(_) }));
    assert!(proposals.count() > 20);
    for (now, is_void) in [(2, true), (1, false)] {
        let mut shields = flight(now);
        period(&mut shields, 0.0);
        for message in &old {
            shields[message.to as usize].hear(message);
        }
        // Without a number of the flight nothing tells the messages apart.
        let is_read = shields.iter().any(|shield| shield.counters().exceeded().is_none());
        assert_eq!(is_read, !is_void);
    }
}

#[test]
fn a_shield_that_was_saved_and_loaded_continues_with_the_same_bits() {
    let ranges = Ranges { most_vehicles: 6, laws: &[Law::Slot], imperfect: true };
    let flight = random_flight(3, ranges);
    let mut world = World::new(&flight);
    (0..200).for_each(|_| world.step(&flight));
    let mut loaded = world.clone();
    for shield in loaded.fleet.shields_mut() {
        let json = serde_json::to_string(&shield.save().expect("no obstacles")).expect("plain data");
        let saved: SavedShield = serde_json::from_str(&json).expect("plain data");
        let read = saved.load().expect("own data");
        assert_eq!(serde_json::to_string(&read.save()).expect("plain data"), json);
        *shield = read;
        // Altered data are refused.
        let starts = json.replace("\"flight\":0", "\"flight\":1");
        let altered: SavedShield = serde_json::from_str(&starts).expect("plain data");
        assert!(altered.load().expect_err("other starts").to_string().starts_with("saved: "));
    }
    (0..200).for_each(|_| world.step(&flight));
    (0..200).for_each(|_| loaded.step(&flight));
    assert_eq!((&world.states, world.report()), (&loaded.states, loaded.report()));
    let wall = crate::obstacle::SolidHalfSpace { normal: Vector3::z_axis(), offset_m: -50.0 };
    let walled = world.fleet.shields()[0].clone().with_obstacles(&[crate::Obstacle::new(wall, 0.1)]);
    assert!(walled.expect("far").save().is_none());
}

#[test]
fn commands_beyond_the_limits_of_the_vehicle_count_as_changed() {
    let limits = Settings::new(1.0, 0.05).limits().expect("valid");
    let start = limits.start(State::at_rest(Vector3::zeros())).expect("valid");
    let mut shield = Shield::new(&limits, 0, &[start]).expect("alone");
    // Each command is cut to a twentieth.
    for _ in 0..4 {
        shield.filter(shield.next_reference(), Vector3::x() * 100.0);
    }
    let counters = shield.counters();
    assert_eq!((counters.changed_share(), counters.limited), (1.0, 4));
    assert!((counters.largest_change_m_s2 - 95.0).abs() < 1e-9, "{counters:?}");
    shield.filter(shield.next_reference(), Vector3::x());
    assert_eq!(shield.counters().changed, 4);
}

#[test]
fn calls_with_nominal_times_have_the_bits_of_those_without() {
    let ranges = Ranges { most_vehicles: 6, laws: &[Law::DiveAtNearest], imperfect: false };
    let flight = random_flight(3, ranges);
    let mut world = World::new(&flight);
    (0..100).for_each(|_| world.step(&flight));
    for shield in world.fleet.shields_mut() {
        let mut timed = shield.clone();
        let period_s = shield.limits().settings().period_s;
        for round in 0..50 {
            let measured = shield.next_reference();
            let wanted = Vector3::new(f64::from(round), 1.0, 0.0);
            let timing = Timing { elapsed_s: period_s, age_s: f64::NAN };
            assert_eq!(shield.filter(measured, wanted), timed.filter_timed(measured, wanted, timing));
        }
        assert_eq!(timed.counters().exceeded(), None);
        let period = |shield: &Shield| shield.assumptions().into_iter().find(|one| one.fact.kind == FactKind::Period);
        assert_eq!(period(shield).and_then(|one| one.held), None);
        assert_eq!(period(&timed).and_then(|one| one.held), Some(true));
    }
}

#[test]
fn times_and_ages_out_of_their_range_are_counted_and_leave_the_reference_in_its_range() {
    let settings = Settings {
        period_tolerance: 0.1,
        hang_periods: 1,
        measurement_age_s: 0.1,
        position_error_m: 0.01,
        ..Settings::new(DELTA_M, 0.05)
    };
    let limits = settings.limits().expect("valid");
    let start = limits.start(State { position_m: Vector3::zeros(), velocity_m_s: Vector3::x() }).expect("valid");
    let moved = |elapsed_s: f64, age_s: f64| {
        let mut shield = Shield::new(&limits, 0, &[start]).expect("alone");
        let first = Timing { elapsed_s: f64::NAN, age_s: 0.0 };
        shield.filter_timed(start.state, Vector3::zeros(), first);
        let measured =
            start.state.after(Vector3::zeros(), if elapsed_s.is_nan() { 0.05 } else { elapsed_s.clamp(0.045, 0.11) });
        shield.brake_timed(measured, Timing { elapsed_s, age_s });
        (shield.reference().position_m.x, shield.counters().exceeded())
    };
    let (way_m, exceeded) = moved(0.07, 0.0);
    assert!((way_m - 0.07).abs() < 1e-12 && exceeded.is_none(), "{way_m} {exceeded:?}");
    let exceeded = moved(0.2, 0.0).1;
    assert!(matches!(exceeded, Some(Exceeded::Period(share)) if (share - 0.2 / 0.11).abs() < 1e-6), "{exceeded:?}");
    for (elapsed_s, expected) in [(0.2, 0.11), (0.0, 0.045), (-1.0, 0.045), (f64::NAN, 0.05), (f64::INFINITY, 0.11)] {
        let (way_m, exceeded) = moved(elapsed_s, 0.0);
        assert!((way_m - expected).abs() < 1e-9, "{elapsed_s}: {way_m}");
        assert!(matches!(exceeded, Some(Exceeded::Period(share)) if share > 1.0), "{elapsed_s}: {exceeded:?}");
    }
    for age_s in [0.2, -0.01, f64::NAN, f64::INFINITY] {
        assert!(matches!(moved(0.05, age_s).1, Some(Exceeded::Age(share)) if share > 1.0), "{age_s}");
    }
}

#[test]
fn a_measurement_of_a_known_age_is_predicted_with_the_commands_since() {
    let settings = Settings {
        period_tolerance: 0.2,
        hang_periods: 1,
        measurement_age_s: 0.2,
        a22_per_s: -0.2,
        position_error_m: 1e-9,
        ..Settings::new(DELTA_M, 0.05)
    };
    let limits = settings.limits().expect("valid");
    let start = limits.start(State { position_m: Vector3::zeros(), velocity_m_s: Vector3::x() }).expect("valid");
    let mut random = Random::new(17);
    let mut shield = Shield::new(&limits, 0, &[start]).expect("alone");
    // True states in steps of 1 ms; the plant is exact, so that the feedback stays small.
    let mut truth = vec![start.state];
    let mut elapsed_ms = 0;
    for _ in 0..200 {
        let age_ms = random.index(200);
        let measured = truth[truth.len().saturating_sub(1 + age_ms)];
        let timing = Timing { elapsed_s: elapsed_ms as f64 * 1e-3, age_s: age_ms as f64 * 1e-3 };
        let command = shield.filter_timed(measured, random.vector(9.0), timing);
        let drag = shield.reference().velocity_m_s * -0.2;
        let feedback = (command + drag - shield.reference_acceleration_m_s2()).norm();
        // The reference has no drag within an interval: the push of the drag is within its bound in the tube.
        assert!(feedback <= limits.tube().feedback_m_s2 && feedback < 0.5, "{feedback}");
        let offset = shield.counters().offset_share.expect("measured");
        assert!(offset <= 1.0, "{offset}");
        elapsed_ms = 40 + random.index(81);
        for _ in 0..elapsed_ms {
            let last = truth[truth.len() - 1];
            // The rule of the midpoint.
            let middle = last.after(command + last.velocity_m_s * -0.2, 5e-4);
            truth.push(last.after(command + middle.velocity_m_s * -0.2, 1e-3));
        }
        // A loaded shield continues with the same bits.
        let json = serde_json::to_string(&shield.save().expect("no obstacles")).expect("plain data");
        let mut saved: SavedShield = serde_json::from_str(&json).expect("own data");
        shield = saved.load().expect("own data");
        // Without a command no measurement before it could be used.
        if saved.legs.pop().is_some() {
            assert!(saved.load().is_err_and(|error| error.to_string().contains("commands")));
        }
    }
    assert_eq!(shield.counters().exceeded(), None);
}
