//! Wrong input: clock steps, duplicates, floods and garbage give events, never a crash, never CLEAR.

use std::iter::repeat_n;

use nalgebra::Vector3;
use proptest::prelude::*;

use crate::{monitor, rest, settings};
use tautline_watch::{ClockScope, Event, Expected, Fault, HISTORY, Monitor, Pose, Reason, Settings, State, TimeBase};

fn both(monitor: &mut Monitor, t_s: f64, arrival_s: f64) -> State {
    rest(monitor, "a", t_s, 0.0, arrival_s);
    rest(monitor, "b", t_s, 6.0, arrival_s);
    monitor.assess(arrival_s).state
}

#[test]
fn nothing_is_clear_before_two_vehicles_are_heard() {
    let mut monitor = monitor(settings());
    assert_eq!(monitor.assess(0.0).state, State::Undecided(Reason::TooFew(0)));
    rest(&mut monitor, "a", 0.0, 0.0, 1.0);
    assert_eq!(monitor.assess(1.0).state, State::Undecided(Reason::TooFew(1)));
    rest(&mut monitor, "b", 0.0, 6.0, 1.0);
    assert_eq!(monitor.assess(1.0).state, State::Clear);
}

#[test]
fn time_passes_from_the_first_pose_on_after_a_long_wait() {
    let mut monitor = monitor(settings());
    for k in 0..50 {
        monitor.assess(0.1 * f64::from(k));
    }
    monitor.fault(Fault::Garbage, None, 4.9);
    assert_eq!(both(&mut monitor, 0.0, 5.0), State::Undecided(Reason::Fault(Fault::Garbage, None)));
    let of = monitor.assess(6.01);
    assert!((of.now_s - 1.01).abs() < 1e-9, "{}", of.now_s);
    assert!(matches!(of.state, State::Undecided(Reason::Stale(..))), "{of:?}");
}

#[test]
fn expected_vehicles_must_be_heard() {
    let mut counted = monitor(Settings { expected: Expected::Count(3), ..settings() });
    assert_eq!(both(&mut counted, 0.0, 0.0), State::Undecided(Reason::Missing([2, 3])));
    rest(&mut counted, "c", 0.0, 12.0, 0.0);
    assert_eq!(counted.assess(0.0).state, State::Clear);
    let names = ["b", "c", "a"].map(str::to_owned).to_vec();
    let mut named = monitor(Settings { expected: Expected::Names(names), ..settings() });
    assert_eq!(both(&mut named, 0.0, 0.0), State::Undecided(Reason::Missing([2, 3])));
    assert_eq!(named.missing(), ["c"]);
}

#[test]
fn a_stale_vehicle_ends_clear_until_it_is_heard_again() {
    let mut monitor = monitor(settings());
    assert_eq!(both(&mut monitor, 0.0, 10.0), State::Clear);
    rest(&mut monitor, "a", 1.2, 0.0, 11.2);
    let state = monitor.assess(11.2).state;
    let State::Undecided(Reason::Stale(1, age_s)) = state else { panic!("{state:?}") };
    assert!((age_s - 1.2).abs() < 1e-9);
    rest(&mut monitor, "b", 1.2, 6.0, 11.3);
    assert_eq!(monitor.assess(11.3).state, State::Clear);
    let events: Vec<_> = monitor.drain_events().collect();
    assert!(events.iter().any(|of| matches!(of, Event::Stale { vehicle: 1, .. })), "{events:?}");
    assert!(events.iter().any(|of| matches!(of, Event::Back { vehicle: 1, .. })), "{events:?}");
}

#[test]
fn a_sender_that_repeats_one_stamp_becomes_stale() {
    let mut monitor = monitor(settings());
    both(&mut monitor, 0.0, 0.0);
    for k in 1..=20 {
        let now_s = 0.1 * f64::from(k);
        rest(&mut monitor, "a", now_s, 0.0, now_s);
        rest(&mut monitor, "b", 0.0, 6.0, now_s);
        let state = monitor.assess(now_s).state;
        assert_eq!(state == State::Clear, now_s <= 1.0, "{now_s} {state:?}");
    }
    assert_eq!(monitor.faults(Fault::Duplicate), 20);
}

#[test]
fn two_positions_at_one_time_are_a_conflict() {
    let mut monitor = monitor(settings());
    both(&mut monitor, 0.0, 0.0);
    rest(&mut monitor, "b", 0.0, 9.0, 0.1);
    assert!(matches!(monitor.assess(0.1).state, State::Undecided(_)));
    assert_eq!(monitor.faults(Fault::Conflict), 1);
}

#[test]
fn a_step_of_the_common_clock_makes_all_vehicles_unknown_until_heard_again() {
    for (step_s, time_base) in [(-100.0, TimeBase::Arrival), (100.0, TimeBase::Arrival), (-100.0, TimeBase::Stamps)] {
        let mut monitor = monitor(Settings { time_base, ..settings() });
        assert_eq!(both(&mut monitor, 1000.0, 0.0), State::Clear);
        assert_eq!(both(&mut monitor, 1000.5, 0.5), State::Clear);
        rest(&mut monitor, "a", 1000.6 + step_s, 0.0, 0.6);
        assert_eq!(monitor.faults(Fault::ClockStep), 1, "{step_s}");
        let state = monitor.assess(0.6).state;
        assert!(matches!(state, State::Undecided(_)), "{state:?}");
        rest(&mut monitor, "b", 1000.6 + step_s, 6.0, 0.6);
        // The doubt lasts for the largest age.
        assert!(matches!(
            both(&mut monitor, 1000.7 + step_s, 0.7),
            State::Undecided(Reason::Fault(Fault::ClockStep, None))
        ));
        for k in 0..20 {
            let t_s = 0.8 + 0.1 * f64::from(k);
            both(&mut monitor, 1000.0 + t_s + step_s, t_s);
        }
        assert_eq!(both(&mut monitor, 1003.0 + step_s, 3.0), State::Clear, "{step_s}");
        assert_eq!(monitor.faults(Fault::ClockStep), 1);
    }
}

#[test]
fn late_messages_are_ignored_and_do_not_refresh_an_age() {
    let mut monitor = monitor(settings());
    both(&mut monitor, 0.0, 0.0);
    both(&mut monitor, 0.5, 0.5);
    rest(&mut monitor, "b", 0.3, 6.0, 0.6);
    assert_eq!(monitor.faults(Fault::Reordered), 1);
    let (.., age_s) = monitor.newest(1).expect("heard");
    assert!((age_s - 0.1).abs() < 1e-9, "{age_s}");
}

#[test]
fn a_vehicle_that_breaks_its_bounds_is_not_clear() {
    let mut monitor = monitor(settings());
    both(&mut monitor, 0.0, 0.0);
    rest(&mut monitor, "a", 0.1, 0.0, 0.1);
    // 2 * 0.01 + 0.02 * 0.1 + 5 * 0.01 / 4 = 0.0345 m.
    rest(&mut monitor, "b", 0.1, 6.034, 0.1);
    assert_eq!(monitor.assess(0.1).state, State::Clear);
    rest(&mut monitor, "b", 0.2, 6.134, 0.2);
    assert_eq!(monitor.assess(0.2).state, State::Undecided(Reason::Fault(Fault::VelocityDisagrees, None)));
    // A change of the velocity by 2 * 0.02 + 5 * 0.1 = 0.54 m/s, and by more.
    for (speed, fault) in [(0.53, 0), (0.55, 1)] {
        let mut monitor = crate::monitor(settings());
        for (t_s, x_m, vx) in [(0.0, 0.0, 0.0), (0.1, 0.03, speed)] {
            let (position_m, velocity_m_s) = (Vector3::x() * x_m, Some(Vector3::x() * vx));
            monitor.take(&Pose { t_s, id: "a", position_m, velocity_m_s, accuracy_m: None }, t_s);
        }
        assert_eq!(monitor.faults(Fault::OutOfBounds), fault, "{speed}");
    }
}

#[test]
fn clocks_of_vehicles_may_differ_if_each_has_its_own() {
    let mut monitor = monitor(Settings { clocks: Some(ClockScope::PerVehicle), ..settings() });
    for k in 0..20 {
        let now_s = 50.0 + 0.1 * f64::from(k);
        rest(&mut monitor, "a", now_s + 900.0, 0.0, now_s);
        rest(&mut monitor, "b", now_s - 7.0, 6.0, now_s);
        assert_eq!(monitor.assess(now_s).state, State::Clear);
    }
    // The restart of one vehicle leaves the other alone.
    rest(&mut monitor, "b", 0.0, 6.0, 52.0);
    assert_eq!(monitor.faults(Fault::ClockStep), 1);
    let (.., age_s) = monitor.newest(0).expect("heard");
    assert!(age_s < 0.2, "{age_s}");
}

#[test]
fn too_many_vehicles_are_not_clear() {
    let mut monitor = monitor(Settings { max_vehicles: 2, ..settings() });
    both(&mut monitor, 0.0, 0.0);
    rest(&mut monitor, "c", 0.0, 20.0, 0.0);
    assert_eq!(monitor.assess(0.0).state, State::Undecided(Reason::Fault(Fault::TooManyVehicles, None)));
    assert_eq!(monitor.names().len(), 2);
}

#[test]
fn a_flood_gives_one_event_a_second_and_no_growth() {
    let mut monitor = monitor(settings());
    both(&mut monitor, 0.0, 0.0);
    for t_s in repeat_n(f64::NAN, 100_000) {
        rest(&mut monitor, "a", t_s, 0.0, 0.1);
    }
    assert!(matches!(monitor.assess(0.1).state, State::Undecided(Reason::Fault(Fault::OutOfRange, None))));
    assert!(monitor.drain_events().count() <= 4);
    monitor.assess(1.2);
    let events: Vec<_> = monitor.drain_events().collect();
    assert!(events.iter().any(|of| matches!(of, Event::Fault { fault: Fault::OutOfRange, count: 99_999, .. })));
}

#[test]
fn a_flood_of_one_vehicle_leaves_a_part_of_the_past_unjudged() {
    let mut monitor = monitor(settings());
    both(&mut monitor, 0.0, 0.0);
    for k in 1..=2 * HISTORY {
        let t_s = 0.001 * k as f64;
        rest(&mut monitor, "a", t_s, 4.9, t_s);
        monitor.assess(t_s);
    }
    rest(&mut monitor, "b", 0.3, 6.0, 0.3);
    monitor.assess(0.3);
    assert_eq!(monitor.faults(Fault::NotJudged), 1);
}

#[test]
fn memory_does_not_grow_with_time() {
    let mut monitor = monitor(settings());
    let is_long = std::env::var_os("TAUTLINE_LONG").is_some();
    // 20 vehicles at 50 Hz, over 24 h with TAUTLINE_LONG and else over three minutes.
    let rounds = if is_long { 24 * 3600 * 50 } else { 180 * 50 };
    let ids: Vec<_> = (0..20).map(|k| format!("v{k}")).collect();
    let mut capacity = None;
    for round in 0..rounds {
        let now_s = f64::from(round) / 50.0;
        for (k, id) in ids.iter().enumerate() {
            rest(&mut monitor, id, now_s, 6.0 * k as f64, now_s);
        }
        // Some errors, too.
        if round % 50 == 7 {
            rest(&mut monitor, "v3", f64::INFINITY, 0.0, now_s);
        }
        monitor.assess(now_s);
        assert!(monitor.drain_events().count() <= 64);
        if round > 10 {
            assert_eq!(*capacity.get_or_insert(monitor.capacity()), monitor.capacity());
        }
    }
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        -3.0..3.0_f64,
        Just(0.0),
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(1e9),
        Just(-1e9),
        Just(1e11),
        Just(1e300),
        Just(5e-324),
        any::<f64>(),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Any numbers in any order give finite answers, and CLEAR only without doubt.
    #[test]
    fn any_poses_give_finite_answers(
        poses in prop::collection::vec(
            (0..5_usize, [number(), number(), number(), number(), number()], 0.0..0.4_f64), 1..60,
        ),
        stamps in any::<bool>(), own_clocks in any::<bool>(),
    ) {
        let mut monitor = monitor(Settings {
            time_base: if stamps { TimeBase::Stamps } else { TimeBase::Arrival },
            clocks: own_clocks.then_some(ClockScope::PerVehicle),
            ..settings()
        });
        let mut arrival_s = 0.0;
        for (k, [t_s, x, y, vx, vy], wait_s) in poses {
            arrival_s += wait_s;
            let doubts = |monitor: &Monitor| {
                Fault::ALL.into_iter().filter(|of| of.gives_doubt()).map(|of| monitor.faults(of)).sum::<u64>()
            };
            let before = doubts(&monitor);
            if k == 4 {
                let is_off = monitor.sign_off(["a", "b"][usize::from(x > 0.0)], t_s, arrival_s);
                prop_assert!(!is_off || monitor.assess(arrival_s).signed_off > 0);
                continue;
            }
            let pose = Pose {
                t_s, id: ["a", "b", "c", ""][k], position_m: Vector3::new(x, y, 0.0),
                velocity_m_s: (k > 0).then(|| Vector3::new(vx, vy, 0.0)), accuracy_m: None
            };
            monitor.take(&pose, arrival_s);
            let of = monitor.assess(arrival_s);
            if doubts(&monitor) > before {
                prop_assert!(of.state != State::Clear);
            }
            if let Some(until) = of.clear_until {
                prop_assert!(until.at_s.is_finite() && until.at_s >= of.now_s);
                prop_assert_eq!(of.state, State::Clear);
            }
            if let Some(near) = of.closest {
                prop_assert!(near.nominal_m.is_finite() && near.least_m <= near.nominal_m);
            }
        }
        monitor.finish(arrival_s);
    }
}

#[test]
fn stamps_that_run_faster_than_arrival_are_never_clear_for_long() {
    for (rate, is_clear) in [(1.0, true), (3.0, false), (1.1, false)] {
        let mut monitor = monitor(settings());
        let mut clear = 0;
        for k in 0..200 {
            let arrival_s = f64::from(k) / 20.0;
            rest(&mut monitor, "a", arrival_s * rate, 0.0, arrival_s);
            rest(&mut monitor, "b", arrival_s * rate, 50.0, arrival_s);
            // The fault is found within 2 s.
            clear += u32::from(arrival_s >= 2.0 && monitor.assess(arrival_s).state == State::Clear);
        }
        assert_eq!((clear > 0, monitor.faults(Fault::ClockStep) == 0), (is_clear, is_clear), "{rate}: {clear}");
    }
}
