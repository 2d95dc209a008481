//! Knowledge of the vehicles through the link of a scenario.

use tautline_core::swarm::{Rows, Swarm, row};
use tautline_laws::formation::Formation;
use tautline_laws::graph::Graph;
use tautline_laws::observation::{NeighbourState, NeighbourStates, OtherStates};
use tautline_sim::link::{Imperfections, StateEstimates, of};
use tautline_sim::scenario::{Failure, FailureKind, LinkFailure, NearStates, Scenario, StalePolicy};

const DT_S: f64 = 0.01;
const COUNT: usize = 4;

/// Returns the true state: vehicle i is at x = 10 i + t^2, y = -t.
fn truth(time_s: f64) -> Swarm {
    Swarm {
        positions_m: Rows::from_fn(COUNT, |i, axis| [10.0 * i as f64 + time_s * time_s, -time_s, 0.0][axis]),
        velocities_m_s: Rows::from_fn(COUNT, |_, axis| [2.0 * time_s, -1.0, 0.0][axis]),
    }
}

fn in_row(swarm: &Swarm, i: usize) -> NeighbourState {
    NeighbourState { position_m: row(&swarm.positions_m, i), velocity_m_s: row(&swarm.velocities_m_s, i), age_s: 0.0 }
}

fn scenario() -> Scenario {
    let mut scenario = Scenario::new("world", truth(0.0), Formation::line(COUNT, 10.0), 1.0, 60.0);
    scenario.graph = Graph::star(COUNT);
    scenario.noise_seed = 5;
    scenario
}

/// Advances a link over steps and passes its result at each to `show`.
fn after(
    link: &mut dyn Imperfections,
    steps: std::ops::RangeInclusive<u32>,
    mut show: impl FnMut(f64, StateEstimates<'_>),
) {
    for step in steps {
        let time_s = f64::from(step) * DT_S;
        let now = truth(time_s);
        link.accept(time_s, &now);
        link.settle(time_s);
        show(time_s, link.sense(time_s, &now));
    }
}

fn picture<'a>(sensed: &StateEstimates<'a>) -> &'a dyn NeighbourStates {
    match sensed.others {
        OtherStates::PerVehicle(picture) => picture,
        OtherStates::Shared => panic!("all is shared"),
    }
}

fn is_of(neighbour: NeighbourState, vehicle: usize, time_s: f64) -> bool {
    let then = truth(time_s.max(0.0));
    (neighbour.position_m - row(&then.positions_m, vehicle)).norm() < 1e-9
        && (neighbour.velocity_m_s - row(&then.velocities_m_s, vehicle)).norm() < 1e-9
}

#[test]
fn delayed_states_have_exactly_the_given_age() {
    // One latency is not a multiple of the step, the other is.
    for latency_s in [0.037, 0.05] {
        let mut late = scenario();
        late.sensing.latency_s = latency_s;
        let mut link = of(&late, true);
        after(link.as_mut(), 0..=100, |time_s, sensed| {
            assert!(matches!(sensed.others, OtherStates::Shared));
            (0..COUNT).for_each(|i| assert!(is_of(in_row(sensed.own, i), i, time_s - latency_s), "{time_s}"));
        });
        assert!(!link.is_exact());
    }
}

#[test]
fn the_network_delays_only_received_states() {
    for rate_hz in [None, Some(100.0)] {
        let mut late = scenario();
        (late.network.latency_s, late.network.rate_hz) = (0.05, rate_hz);
        let mut link = of(&late, true);
        after(link.as_mut(), 0..=100, |time_s, sensed| {
            let picture = picture(&sensed);
            assert_eq!(sensed.own, &truth(time_s));
            let received = picture.received(1, 0);
            assert!(is_of(received, 0, time_s - 0.05), "{rate_hz:?} {time_s}");
            assert!((received.age_s - time_s.min(0.05)).abs() < 1e-9);
            assert!(is_of(picture.sensed(1, 2), 2, time_s));
        });
    }
}

#[test]
fn near_vehicles_are_sensed_or_received_with_the_given_delays() {
    let mut own_late = scenario();
    (own_late.sensing.latency_s, own_late.sensing.near_latency_s) = (0.05, Some(0.0));
    after(of(&own_late, true).as_mut(), 0..=50, |time_s, sensed| {
        let (near, own_m) = (picture(&sensed).sensed(1, 2), row(&sensed.own.positions_m, 1));
        assert!(is_of(in_row(sensed.own, 1), 1, time_s - 0.05));
        let apart_m = row(&truth(time_s).positions_m, 2) - row(&truth(time_s).positions_m, 1);
        assert!((near.position_m - own_m - apart_m).norm() < 1e-12, "present relative position");
    });
    let mut received = scenario();
    (received.network.latency_s, received.network.near) = (0.05, NearStates::Received);
    after(of(&received, true).as_mut(), 0..=50, |time_s, sensed| {
        assert!(is_of(picture(&sensed).sensed(1, 2), 2, time_s - 0.05), "without a link too");
        let (positions_m, slack_m) = picture(&sensed).near_search_positions().expect("a place to look from");
        let held_m = (picture(&sensed).sensed(1, 2).position_m - row(&sensed.own.positions_m, 1)).norm();
        let found_m = (row(positions_m, 2) - row(positions_m, 1)).norm();
        assert!(held_m + slack_m >= found_m && slack_m >= (found_m - held_m).abs());
    });
}

#[test]
fn old_messages_are_held_or_extrapolated() {
    let mut scenario = scenario();
    (scenario.network.latency_s, scenario.network.rate_hz) = (0.05, Some(10.0));
    for missing in [StalePolicy::Hold, StalePolicy::Extrapolate] {
        scenario.network.missing = missing;
        after(of(&scenario, true).as_mut(), 0..=100, |time_s, sensed| {
            let received = picture(&sensed).received(2, 0);
            let sent_s = ((time_s - 0.05 + 1e-9).max(0.0) * 10.0).floor() / 10.0;
            let (then, ahead_s) = (truth(sent_s), time_s - sent_s);
            let carried_m = if missing == StalePolicy::Hold { 0.0 } else { ahead_s };
            let expected = row(&then.positions_m, 0) + row(&then.velocities_m_s, 0) * carried_m;
            assert!((received.position_m - expected).norm() < 1e-9, "{missing:?} {time_s}");
        });
    }
}

#[test]
fn broken_links_and_silent_vehicles_leave_the_last_message() {
    let mut scenario = scenario();
    scenario.network.rate_hz = Some(100.0);
    scenario.network.failure = vec![LinkFailure { link: [1, 3], from_s: 0.2, to_s: Some(0.4) }];
    scenario.failures = vec![Failure { vehicle: 2, at_s: 0.3, kind: FailureKind::Silent {} }];
    let mut link = of(&scenario, true);
    after(link.as_mut(), 0..=80, |time_s, sensed| {
        let picture = picture(&sensed);
        let is_down = (0.2 - 1e-9..0.4 - 1e-9).contains(&time_s);
        let known_s = if is_down { 0.19 } else { time_s };
        assert!(is_of(picture.received(2, 0), 0, known_s) && is_of(picture.received(0, 2), 2, known_s), "{time_s}");
        assert!(is_of(picture.received(3, 0), 0, time_s), "other links are up");
        assert!(is_of(picture.received(0, 1), 1, time_s.min(0.29)), "{time_s}");
        assert!(is_of(picture.received(1, 0), 0, time_s), "the silent vehicle still receives");
    });
    let traffic = link.traffic().expect("messages");
    // 81 instants, six directed links: 20 messages are lost on two of them, and one sender stops at message 30.
    assert_eq!((traffic.sent, traffic.lost), (81 * 6 - 51, 40));
    assert!(traffic.age_p95_s.is_some_and(|age_s| (0.2..0.5).contains(&age_s)), "{traffic:?}");
}

#[test]
fn vehicles_pass_on_messages_up_to_the_largest_number_of_hops() {
    let mut scenario = scenario();
    scenario.graph = Graph::complete(COUNT);
    (scenario.network.rate_hz, scenario.network.latency_s) = (Some(100.0), 0.02);
    // Vehicles are 10 m apart on a line.
    scenario.network.range_m = Some(10.5);
    let known_s = |scenario: &Scenario, receiver: usize, steps: u32| {
        let mut link = of(scenario, true);
        let mut known_s = f64::NAN;
        after(link.as_mut(), 0..=steps, |time_s, sensed| {
            known_s = time_s - picture(&sensed).received(receiver, 0).age_s;
        });
        known_s
    };
    for (relay_hops, reached) in [(None, 1), (Some(1), 1), (Some(2), 2), (Some(3), 3), (Some(64), 3)] {
        scenario.network.relay_hops = relay_hops;
        for receiver in 1..COUNT {
            // One latency for each hop, or the start.
            let expected_s = if receiver <= reached { 0.5 - 0.02 * receiver as f64 } else { 0.0 };
            let found_s = known_s(&scenario, receiver, 50);
            assert!((found_s - expected_s).abs() < 1e-9, "{relay_hops:?} {receiver}: {found_s}");
        }
    }
    // The path is that of the time of sending: no link that is down then, and no vehicle that is silent then.
    scenario.network.relay_hops = Some(3);
    scenario.failures = vec![Failure { vehicle: 3, at_s: 0.3, kind: FailureKind::Silent {} }];
    assert!((known_s(&scenario, 3, 50) - 0.29).abs() < 1e-9);
    assert!((known_s(&scenario, 2, 50) - 0.46).abs() < 1e-9);
    scenario.network.failure = vec![LinkFailure { link: [1, 2], from_s: 0.1, to_s: Some(0.4) }];
    assert!((known_s(&scenario, 2, 30) - 0.09).abs() < 1e-9);
    // Each hop may lose the message.
    (scenario.failures, scenario.network.failure) = (vec![], vec![]);
    scenario.network.loss = 0.2;
    let mut link = of(&scenario, true);
    after(link.as_mut(), 0..=2000, |_, _| {});
    let traffic = link.traffic().expect("messages");
    // Of the pairs, 6 have one hop, 4 have two, and 2 have three.
    let expected = 1.0 - (6.0 * 0.8 + 4.0 * 0.8_f64.powi(2) + 2.0 * 0.8_f64.powi(3)) / 12.0;
    let lost = traffic.lost as f64 / traffic.sent as f64;
    assert!((lost - expected).abs() < 0.01, "{lost} {expected}");
    // A link that is bad for long loses the messages of all paths over it at once.
    scenario.network.loss_burst = Some(100.0);
    let mut link = of(&scenario, true);
    let [mut both, mut near] = [0_u32; 2];
    after(link.as_mut(), 0..=4000, |_, sensed| {
        let picture = picture(&sensed);
        let is_late = |receiver: usize| picture.received(receiver, 0).age_s > 0.02 * receiver as f64 + 0.005;
        both += u32::from(is_late(1) && is_late(2));
        near += u32::from(is_late(1));
    });
    assert!(near > 200 && f64::from(both) > 0.7 * f64::from(near), "{both} of {near}");
}

#[test]
fn errors_have_the_given_deviation_and_are_drawn_for_each_measurement() {
    let mut noisy = scenario();
    (noisy.sensing.position_noise_m, noisy.sensing.velocity_noise_m_s) = (0.1, 0.02);
    noisy.sensing.rate_hz = Some(50.0);
    let (mut sums, mut number, mut last) = ([0.0; 4], 0.0, None);
    after(of(&noisy, true).as_mut(), 0..=20_000, |time_s, sensed| {
        let own = in_row(sensed.own, 1);
        let sensed = picture(&sensed).sensed(1, 2);
        let is_new = last.replace(own) != Some(own);
        assert_eq!(is_new, (time_s / DT_S).round() % 2.0 == 0.0, "{time_s}");
        let measured_s = (time_s * 50.0 + 1e-9).floor() / 50.0;
        let then = in_row(&truth(measured_s), 1);
        let apart_m = sensed.position_m - own.position_m;
        if is_new {
            number += 1.0;
            sums[0] += (own.position_m - then.position_m).x.powi(2);
            sums[1] += (own.velocity_m_s - then.velocity_m_s).y.powi(2);
            sums[2] += (apart_m.x - 10.0).powi(2);
            sums[3] += (own.position_m - then.position_m).x * (apart_m.x - 10.0);
        }
        assert_eq!((own.position_m.z, sensed.position_m.z), (0.0, 0.0), "no error leaves the plane");
    });
    let [own, speed, sensed, both] = sums.map(|sum| sum / number);
    // 10,001 draws: the standard error of a variance is 1.4 %.
    for (variance, expected) in [(own, 0.01), (speed, 0.0004), (sensed, 0.01)] {
        assert!((variance / expected - 1.0).abs() < 0.05, "{variance} {expected}");
    }
    assert!(both.abs() < 0.0004, "errors of near vehicles are independent: {both}");
}

#[test]
fn a_bias_is_constant_and_does_not_affect_near_vehicles() {
    let mut biased = scenario();
    biased.sensing.position_bias_m = 0.5;
    let mut first = None;
    after(of(&biased, true).as_mut(), 0..=100, |time_s, sensed| {
        let off_m = &sensed.own.positions_m - truth(time_s).positions_m;
        let before = first.get_or_insert_with(|| off_m.clone());
        assert!((&off_m - &*before).amax() < 1e-12 && off_m.amax() > 0.1);
        let apart_m = picture(&sensed).sensed(1, 2).position_m - row(&sensed.own.positions_m, 1);
        assert!((apart_m - row(&truth(time_s).positions_m, 2) + row(&truth(time_s).positions_m, 1)).norm() < 1e-12);
        assert!((picture(&sensed).received(1, 0).position_m - row(&sensed.own.positions_m, 0)).norm() == 0.0);
    });
}

#[test]
fn refused_steps_and_trial_states_change_no_estimates() {
    let mut scenario = scenario();
    scenario.sensing.rate_hz = Some(30.0);
    scenario.sensing.position_noise_m = 0.1;
    (scenario.network.latency_s, scenario.network.jitter_s) = (0.03, 0.05);
    (scenario.network.loss, scenario.network.loss_burst) = (0.3, Some(4.0));
    let received = |link: &mut dyn Imperfections, disturb: bool| {
        let mut all = Vec::new();
        for step in 0..=200 {
            let time_s = f64::from(step) * DT_S;
            if disturb && step > 0 {
                // A refused step of double length, then one in halves.
                link.accept(time_s + DT_S, &truth(7.0));
                link.sense(time_s + DT_S, &truth(7.0));
                link.forget_after(time_s - DT_S);
                let half_s = time_s - 0.5 * DT_S;
                link.accept(half_s, &truth(half_s));
                link.settle(half_s);
                link.sense(half_s, &truth(half_s));
            }
            after(link, step..=step, |_, sensed| {
                let picture = picture(&sensed);
                all.push((sensed.own.clone(), picture.received(0, 2), picture.received(3, 0), picture.sensed(1, 3)));
            });
        }
        (all, link.traffic())
    };
    let plain = received(of(&scenario, true).as_mut(), false);
    let disturbed = received(of(&scenario, true).as_mut(), true);
    assert_eq!(plain.1, disturbed.1);
    let far = |a: &NeighbourState, b: &NeighbourState| (a.position_m - b.position_m).norm();
    for (a, b) in plain.0.iter().zip(&disturbed.0) {
        // Values between two states are interpolated from different states.
        assert!((&a.0.positions_m - &b.0.positions_m).amax() < 1e-12);
        assert!(far(&a.1, &b.1) < 1e-12 && far(&a.2, &b.2) < 1e-12 && far(&a.3, &b.3) < 1e-12);
    }
    scenario.noise_seed = 6;
    assert_ne!(received(of(&scenario, true).as_mut(), false).1, plain.1, "another seed, another fate");
}

#[test]
fn a_dead_vehicle_has_no_command_and_a_frozen_one_keeps_its_last() {
    let mut scenario = scenario();
    scenario.failures = vec![
        Failure { vehicle: 2, at_s: 0.5, kind: FailureKind::Dead {} },
        Failure { vehicle: 3, at_s: 0.5, kind: FailureKind::Frozen {} },
    ];
    let mut link = of(&scenario, true);
    for step in 0..=100 {
        let time_s = f64::from(step) * DT_S;
        let given = Rows::from_element(COUNT, 1.0 + time_s);
        let mut command = given.clone();
        link.actuate(time_s, &mut command);
        assert_eq!((command[(0, 0)], command[(3, 1)]), (given[(0, 0)], given[(0, 0)]));
        let (dead, frozen) = if step < 50 { (1.0 + time_s, 1.0 + time_s) } else { (0.0, 1.5) };
        assert_eq!((command[(1, 0)], command[(2, 0)]), (dead, frozen), "{time_s}");
    }
}

#[test]
fn without_imperfections_laws_read_the_true_state() {
    assert!(of(&scenario(), true).is_exact());
    let mut scenario = scenario();
    scenario.network.missing = StalePolicy::Extrapolate;
    assert!(of(&scenario, true).is_exact(), "no imperfection");
}
