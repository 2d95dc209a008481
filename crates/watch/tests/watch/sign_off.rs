//! Sign-offs: a vehicle that left is not awaited, and no violation is hidden.

use nalgebra::Vector3;
use serde_json::json;

use crate::{monitor, rest, settings};
use tautline_watch::{Bound, Event, Fault, Monitor, Notice, Pose, Reason, Settings, State, Statement, TimeBase};

const IDS: [&str; 3] = ["a", "b", "c"];

/// Takes poses of the first vehicles, 6 m apart, at each 0.1 s of an interval.
fn stay(monitor: &mut Monitor, count: usize, tenths: std::ops::RangeInclusive<u32>) -> State {
    let mut state = State::Undecided(Reason::TooFew(0));
    for k in tenths {
        let now_s = 0.1 * f64::from(k);
        for (id, x_m) in IDS.iter().zip([0.0, 6.0, 12.0]).take(count) {
            rest(monitor, id, now_s, x_m, now_s);
        }
        state = monitor.assess(now_s).state;
    }
    state
}

fn stale_events(monitor: &mut Monitor) -> usize {
    monitor.drain_events().filter(|event| matches!(event, Event::Stale { .. })).count()
}

#[test]
fn a_vehicle_that_signed_off_is_not_awaited() {
    for (signs_off, state) in [(true, State::Clear), (false, State::Undecided(Reason::Stale(2, 3.0)))] {
        let mut monitor = monitor(settings());
        assert_eq!(stay(&mut monitor, 3, 0..=10), State::Clear);
        assert_eq!(signs_off, signs_off && monitor.sign_off("c", 1.0, 1.0));
        let last = stay(&mut monitor, 2, 11..=40);
        match (last, state) {
            (State::Undecided(Reason::Stale(a, _)), State::Undecided(Reason::Stale(b, _))) => assert_eq!(a, b),
            _ => assert_eq!(last, state),
        }
        assert_eq!(stale_events(&mut monitor), usize::from(!signs_off));
        assert_eq!(monitor.assess(4.0).signed_off, usize::from(signs_off));
    }
}

#[test]
fn a_vehicle_that_is_heard_after_its_sign_off_is_present_again() {
    let mut monitor = monitor(settings());
    stay(&mut monitor, 3, 0..=10);
    assert!(monitor.sign_off("c", 1.0, 1.0));
    stay(&mut monitor, 2, 11..=30);
    monitor.drain_events();
    rest(&mut monitor, "c", 3.0, 6.5, 3.0);
    // It is too close to b now.
    assert!(matches!(monitor.assess(3.0).state, State::Violation([1, 2], _)));
    let back = Event::Back { vehicle: 2, signed_off_s: Some(1.0), at_s: 3.0 };
    assert!(monitor.drain_events().any(|event| event == back));
    assert_eq!(monitor.faults(Fault::Returned), 1);
    assert!(!monitor.has_signed_off(2));
    // Silent again, it is awaited.
    assert!(matches!(stay(&mut monitor, 2, 31..=50), State::Undecided(Reason::Stale(2, _))));
}

#[test]
fn a_return_after_a_sign_off_is_not_clear_with_the_time_of_arrival() {
    for (returns, state) in [(true, State::Undecided(Reason::Fault(Fault::Returned, None))), (false, State::Clear)] {
        let mut monitor = monitor(settings());
        stay(&mut monitor, 3, 0..=10);
        assert!(monitor.sign_off("c", 1.0, 1.0));
        stay(&mut monitor, 2, 11..=30);
        if returns {
            rest(&mut monitor, "c", 3.0, -6.0, 3.0);
        }
        assert_eq!(monitor.assess(3.0).state, state);
    }
}

#[test]
fn a_sign_off_without_a_proof_of_delta_is_refused() {
    // Delta is 1 m, and the errors of two fresh positions are 0.02 m.
    for (gap_m, is_accepted) in [(1.03, true), (1.01, false), (0.5, false)] {
        let mut monitor = monitor(settings());
        rest(&mut monitor, "a", 0.0, 0.0, 0.0);
        rest(&mut monitor, "b", 0.0, gap_m, 0.0);
        monitor.assess(0.0);
        assert_eq!(monitor.sign_off("b", 0.0, 0.0), is_accepted, "{gap_m}");
        assert_eq!(monitor.faults(Fault::SignOff), u64::from(!is_accepted));
        // A refused vehicle is awaited.
        for k in 1..=20 {
            rest(&mut monitor, "a", 0.1 * f64::from(k), 0.0, 0.1 * f64::from(k));
        }
        let state = monitor.assess(2.0).state;
        let is_stale = matches!(state, State::Undecided(Reason::Stale(1, _)));
        assert_eq!(
            (is_stale, state == State::Undecided(Reason::SignedOff(1))),
            (!is_accepted, is_accepted),
            "{state:?}"
        );
    }
}

#[test]
fn a_sign_off_is_refused_while_another_vehicle_is_stale_or_in_doubt() {
    let mut late = monitor(settings());
    stay(&mut late, 3, 0..=10);
    stay(&mut late, 2, 11..=25);
    // `c` is stale, so its separation from `b` is not known; `c` itself is stale, too.
    assert!(!late.sign_off("b", 2.5, 2.5) && !late.sign_off("c", 2.5, 2.5));
    let mut doubted = monitor(settings());
    stay(&mut doubted, 3, 0..=10);
    doubted.fault(Fault::OutOfBounds, Some(2), 1.0);
    assert!(!doubted.sign_off("c", 1.0, 1.0));
    stay(&mut doubted, 3, 11..=21);
    assert!(doubted.sign_off("c", 2.1, 2.1));
}

#[test]
fn wrong_sign_offs_are_faults() {
    let mut monitor = monitor(settings());
    stay(&mut monitor, 3, 0..=10);
    for (id, t_s, fault) in [
        ("d", 1.0, Fault::Garbage),
        ("", 1.0, Fault::Garbage),
        ("c", 0.9, Fault::SignOff),
        ("c", f64::NAN, Fault::OutOfRange),
        ("c", f64::INFINITY, Fault::OutOfRange),
        ("c", -1e12, Fault::OutOfRange),
    ] {
        let before = monitor.faults(fault);
        assert!(!monitor.sign_off(id, t_s, 1.0), "{id} {t_s}");
        assert_eq!(monitor.faults(fault), before + 1, "{id} {t_s}");
    }
    assert_eq!(stay(&mut monitor, 3, 11..=30), State::Clear);
    assert!(monitor.sign_off("c", 3.0, 3.0) && !monitor.sign_off("c", 3.0, 3.0));
    assert_eq!((monitor.faults(Fault::SignOff), monitor.names().len()), (2, 3));
    // A sign-off is not reported like a position.
    assert_eq!(monitor.faults(Fault::Reordered) + monitor.faults(Fault::Duplicate), 0);
}

#[test]
fn the_stamp_of_a_sign_off_is_checked_like_that_of_a_pose() {
    // At the arrival of 3 s; the newest position has this stamp.
    for (t_s, is_step, is_accepted) in [
        (500.0, true, false),
        (3.6, true, false),
        (3.2, true, false),
        (1.9, true, false),
        (3.05, false, true),
        (3.0, false, true),
    ] {
        let mut monitor = monitor(settings());
        stay(&mut monitor, 3, 0..=30);
        assert_eq!(monitor.sign_off("c", t_s, 3.0), is_accepted, "{t_s}");
        assert_eq!(monitor.faults(Fault::ClockStep), u64::from(is_step), "{t_s}");
        let doubt = State::Undecided(Reason::Fault(Fault::ClockStep, None));
        assert_eq!(monitor.assess(3.0).state, if is_step { doubt } else { State::Clear }, "{t_s}");
        // The clock of the other vehicles did not move.
        assert_eq!(stay(&mut monitor, if is_step { 3 } else { 2 }, 31..=45), State::Clear, "{t_s}");
    }
}

#[test]
fn a_refused_sign_off_is_reported_with_its_reason() {
    let refused = |prepare: fn(&mut Monitor), t_s: f64| {
        let mut monitor = monitor(settings());
        stay(&mut monitor, 3, 0..=10);
        prepare(&mut monitor);
        monitor.drain_events();
        assert!(!monitor.sign_off("c", t_s, t_s.max(1.0)));
        let events: Vec<_> = monitor.drain_events().collect();
        let event =
            events.iter().find(|of| matches!(of, Event::Fault { fault: Fault::SignOff, .. })).expect("an event");
        Notice::new(Statement::Event(event, None), &monitor).json["reason"].take()
    };
    let nothing = |_: &mut Monitor| {};
    let signed_off = |monitor: &mut Monitor| assert!(monitor.sign_off("c", 1.0, 1.0));
    let doubted = |monitor: &mut Monitor| monitor.fault(Fault::OutOfBounds, Some(2), 1.0);
    let stale = |monitor: &mut Monitor| {
        for k in 11..=25 {
            let now_s = 0.1 * f64::from(k);
            rest(monitor, "b", now_s, 6.0, now_s);
            rest(monitor, "c", now_s, 12.0, now_s);
        }
    };
    let near = |monitor: &mut Monitor| rest(monitor, "d", 1.0, 13.015, 1.0);
    for (found, code, key, value) in [
        (refused(nothing, 0.9), "late", "stamp_s", json!(0.9)),
        (refused(signed_off, 1.1), "repeated", "newest_s", json!(1.0)),
        (refused(doubted, 1.0), "fault", "fault", json!("out-of-bounds")),
        (refused(stale, 2.5), "stale", "vehicle", json!("a")),
        (refused(near, 1.0), "uncertain", "subjects", json!(["c", "d"])),
    ] {
        assert_eq!((&found["code"], &found["data"][key]), (&json!(code), &value), "{found}");
    }
}

#[test]
fn the_past_of_a_vehicle_is_judged_after_its_sign_off() {
    // `a` passes `b` and is 0.9 m behind it at its last position, at 1 s; `b` is heard at 0 s and 1.3 s only.
    let pass = |offset_m: f64| {
        let wide = Settings {
            time_base: TimeBase::Stamps,
            accel_m_s2: Bound::declared(0.5),
            max_age_s: Bound::declared(2.0),
            ..settings()
        };
        let mut monitor = monitor(wide);
        let take = |monitor: &mut Monitor, t_s: f64, id: &str, at: [f64; 3], speed: f64| {
            let velocity_m_s = Some(Vector3::x() * speed);
            monitor.take(&Pose { t_s, id, position_m: Vector3::from(at), velocity_m_s, accuracy_m: None }, t_s);
        };
        take(&mut monitor, 0.0, "a", [-5.1, 0.0, 0.0], 6.0);
        take(&mut monitor, 0.0, "b", [0.0, offset_m, 0.0], 0.0);
        take(&mut monitor, 0.0, "c", [50.0, 0.0, 0.0], 0.0);
        take(&mut monitor, 1.0, "a", [0.9, 0.0, 0.0], 6.0);
        assert!(monitor.sign_off("a", 1.3, 1.3), "3 m apart at 1.3 s");
        let before = monitor.violations();
        take(&mut monitor, 1.3, "b", [0.0, offset_m, 0.0], 0.0);
        take(&mut monitor, 1.3, "c", [50.0, 0.0, 0.0], 0.0);
        let state = monitor.assess(1.3).state;
        let ended: Vec<_> = monitor
            .drain_events()
            .filter_map(|event| match event {
                Event::Ended(of) => Some((of.pair, of.to_s)),
                _ => None,
            })
            .collect();
        (before, monitor.violations(), ended, state)
    };
    assert_eq!(pass(0.0), (0, 1, vec![([0, 1], 1.0)], State::Clear));
    // Negative twin: 1.1 m beside is no violation.
    assert_eq!(pass(1.1), (0, 0, Vec::new(), State::Clear));
}
