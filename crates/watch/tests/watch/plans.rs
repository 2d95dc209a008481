//! Plans of planners: conflicts are announced before they are flown, and withdrawn with their plan.

use std::io;
use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde_json::{Value, json};
use tautline_core::fact::FactKind;
use tautline_recordings::read::{LivePlan, live_plans};
use tungstenite::Message;

use crate::{monitor, rest, settings};
use tautline_watch::source::{NamingOptions, PlanMessage, channel, rosbridge};
use tautline_watch::{
    Event, Monitor, Notice, Output, PlanClock, PlanEnd, Problem, Reason, Settings, State, Statement, watch,
};

/// Second since 1970 of the clock of the positions at arrival 0.
const EPOCH_S: i64 = 1_700_000_000;
const NS_PER_S: i64 = 1_000_000_000;

/// Returns a plan along a straight line, in JSON of rosbridge.
fn line(drone: i32, start_ns: i64, from_m: [f64; 3], velocity_m_s: [f64; 3], duration_s: f64) -> Value {
    let axis = |k: usize| json!([0.0, 0.0, 0.0, 0.0, velocity_m_s[k], from_m[k]]);
    json!({
        "drone_id": drone, "traj_id": 1, "order": 5,
        "start_time": { "sec": start_ns / NS_PER_S, "nanosec": start_ns % NS_PER_S },
        "coef_x": axis(0), "coef_y": axis(1), "coef_z": axis(2), "duration": [duration_s],
    })
}

#[expect(clippy::cast_possible_truncation, reason = "times of tests are small")]
fn nanoseconds(start_s: f64) -> i64 {
    EPOCH_S * NS_PER_S + (start_s * 1e9).round() as i64
}

/// Returns a plan that starts at a time of the caller's clock \[s\].
fn plan(drone: i32, start_s: f64, from_m: [f64; 3], velocity_m_s: [f64; 3], duration_s: f64) -> LivePlan {
    let message = line(drone, nanoseconds(start_s), from_m, velocity_m_s, duration_s);
    live_plans(&message).expect("a plan").expect("a valid one").remove(0)
}

/// Takes a plan that arrives at a time \[s\]. The clock of this machine is that of the positions.
fn take(monitor: &mut Monitor, plan: LivePlan, arrival_s: f64) -> Result<(), Problem> {
    let arrival_ns = nanoseconds(arrival_s);
    monitor.take_plan(&PlanMessage { topic: "/plans".to_owned(), plan, arrival_s, arrival_ns })
}

/// Takes positions of two vehicles at rest, far from each other.
fn heard(monitor: &mut Monitor, arrival_s: f64) -> State {
    for (id, x_m) in [("a", 0.0), ("b", 50.0)] {
        rest(monitor, id, EPOCH_S as f64 + arrival_s, x_m, arrival_s);
    }
    monitor.assess(arrival_s).state
}

fn conflicts(monitor: &mut Monitor) -> Vec<(Event, Value, String)> {
    let events: Vec<_> = monitor.drain_events().filter(|event| matches!(event, Event::PlanConflict { .. })).collect();
    let shown = |event: &Event| Notice::new(Statement::Event(event, None), monitor);
    events.iter().map(|event| (*event, shown(event).json, shown(event).text)).collect()
}

/// Along x through the origin after 4 s.
fn along(start_s: f64) -> LivePlan {
    plan(0, start_s, [-4.0, 0.0, 1.0], [1.0, 0.0, 0.0], 8.0)
}

/// Along y, past the origin at `x_m` after 4 s.
fn across(start_s: f64, x_m: f64) -> LivePlan {
    plan(1, start_s, [x_m, 8.0, 1.0], [0.0, -2.0, 0.0], 8.0)
}

#[test]
fn a_violating_plan_is_announced_before_its_violation_and_the_mended_one_is_silent() {
    for has_positions in [true, false] {
        let mut monitor = monitor(settings());
        if has_positions {
            assert_eq!(heard(&mut monitor, 0.0), State::Clear);
        }
        take(&mut monitor, along(0.1), 0.1).expect("a plan");
        assert!(conflicts(&mut monitor).is_empty());
        take(&mut monitor, across(0.2, 0.0), 0.15).expect("a plan");
        let found = conflicts(&mut monitor);
        let [(Event::PlanConflict { conflict, left_s, at_s }, json, text)] = &found[..] else { panic!("{found:?}") };
        // The squared distance is (t - 0.1 - 4)^2 + (2 (t - 0.2 - 4))^2, least at 4.18 s.
        let zero_s = if has_positions { EPOCH_S as f64 } else { 0.0 };
        let min_s = (4.1 + 4.0 * 4.2) / 5.0;
        let least_m = (min_s - 4.1_f64).hypot(2.0 * (min_s - 4.2));
        assert!((conflict.lower_m - least_m).abs() < 1e-5, "{conflict:?}");
        assert!(conflict.min_at_s.is_some_and(|at_s| (at_s - zero_s - min_s).abs() < 1e-5), "{conflict:?}");
        assert!((at_s - zero_s - 0.15).abs() < 1e-5 && (conflict.from_s - at_s - left_s).abs() < 1e-9, "{found:?}");
        assert!(*left_s > 3.0 && *left_s < 4.0, "{left_s}");
        for (path, value) in [
            ("/event", json!("plan-conflict")),
            ("/plan/vehicle", json!("1")),
            ("/plan/number", json!(1)),
            ("/other/vehicle", json!("0")),
            ("/limit", json!(1.0)),
            ("/facts/1/subject", json!("plans")),
            ("/facts/1/value", json!(if has_positions { "that of the positions" } else { "that of this machine" })),
            ("/facts/1/source", json!(if has_positions { "default" } else { "inferred" })),
            ("/facts/2/value", json!("hold")),
            ("/facts/2/source", json!("default")),
        ] {
            assert_eq!(json.pointer(path), Some(&value), "{path}: {json}");
        }
        assert!(text.contains("plan 1 of drone 1") && text.contains("holds the last point (default)"), "{text}");
        // Negative twin: 3 m aside the distance is never below 1 m.
        let mut mended = crate::monitor(settings());
        if has_positions {
            heard(&mut mended, 0.0);
        }
        take(&mut mended, along(0.1), 0.1).expect("a plan");
        take(&mut mended, across(0.2, 3.0), 0.15).expect("a plan");
        assert!(conflicts(&mut mended).is_empty());
        if has_positions {
            assert_eq!(heard(&mut mended, 0.2), State::Clear);
        }
    }
}

#[test]
fn the_state_is_undecided_until_the_conflict_is_over_or_its_plan_replaced() {
    let is_in_conflict = |state: State| matches!(state, State::Undecided(Reason::PlanConflict(_)));
    for is_replaced in [true, false] {
        let mut monitor = monitor(settings());
        heard(&mut monitor, 0.0);
        take(&mut monitor, along(0.1), 0.1).expect("a plan");
        assert_eq!(heard(&mut monitor, 0.15), State::Clear);
        take(&mut monitor, across(0.2, 0.0), 0.2).expect("a plan");
        assert!(is_in_conflict(heard(&mut monitor, 0.3)));
        // A repetition replaces nothing.
        take(&mut monitor, across(0.2, 0.0), 0.4).expect("a plan");
        assert_eq!((conflicts(&mut monitor).len(), monitor.plan_counts()), (1, Some([2, 1])));
        if is_replaced {
            // The drone stops where it is at 1 s.
            take(&mut monitor, plan(1, 1.0, [0.0, 6.4, 1.0], [0.0; 3], 1.0), 0.9).expect("a plan");
            assert!(conflicts(&mut monitor).is_empty());
        }
        for tenth in 10..80 {
            let now_s = f64::from(tenth) / 10.0;
            assert_eq!(is_in_conflict(heard(&mut monitor, now_s)), !is_replaced && now_s < 4.7, "{now_s}");
        }
    }
}

#[test]
fn a_conflict_before_the_next_plan_starts_is_not_withdrawn() {
    let mut monitor = monitor(settings());
    heard(&mut monitor, 0.0);
    take(&mut monitor, along(0.1), 0.1).expect("a plan");
    take(&mut monitor, across(0.2, 0.0), 0.2).expect("a plan");
    // It starts within the conflict, whose first part is still flown.
    take(&mut monitor, plan(1, 4.2, [0.0, 40.0, 1.0], [0.0; 3], 1.0), 0.9).expect("a plan");
    let State::Undecided(Reason::PlanConflict(left)) = heard(&mut monitor, 1.0) else { panic!("a conflict") };
    assert!((left.to_s - EPOCH_S as f64 - 4.2).abs() < 1e-5, "{left:?}");
    for tenth in 11..43 {
        heard(&mut monitor, f64::from(tenth) / 10.0);
    }
    assert_eq!(heard(&mut monitor, 4.3), State::Clear);
}

#[test]
fn the_clock_of_positions_moves_no_plan_against_another() {
    // The clock of planners and positions is 3 s ahead of this machine, or 3 s behind it.
    for ahead_s in [3.0, -3.0, 0.0] {
        for heard_before in 0..3 {
            let mut monitor = monitor(settings());
            let plans = [along(0.1), across(0.2, 0.0)];
            for (number, plan) in plans.into_iter().enumerate() {
                if number == heard_before {
                    assert_eq!(heard(&mut monitor, 0.0), State::Clear);
                }
                let (arrival_s, arrival_ns) = (0.1 + 0.05 * number as f64, nanoseconds(0.1 - ahead_s));
                let message = PlanMessage { topic: "/plans".to_owned(), plan, arrival_s, arrival_ns };
                monitor.take_plan(&message).expect("a plan");
            }
            let found = conflicts(&mut monitor);
            let [(Event::PlanConflict { conflict, .. }, ..)] = &found[..] else {
                panic!("{ahead_s} {heard_before} {found:?}")
            };
            // The least distance is that of the two plans on one clock.
            let least_m = (4.18_f64 - 4.1).hypot(2.0 * (4.18 - 4.2));
            assert!((conflict.lower_m - least_m).abs() < 1e-5, "{ahead_s} {heard_before} {conflict:?}");
        }
    }
}

#[test]
fn a_refused_plan_does_not_coarsen_the_times_of_others() {
    let mut monitor = monitor(settings());
    take(&mut monitor, along(-1.6e9), 0.0).expect_err("another clock");
    // At 1000 and 2000 m/s both are at the origin after 4.1 s.
    take(&mut monitor, plan(0, 0.1, [-4000.0, 0.0, 1.0], [1000.0, 0.0, 0.0], 8.0), 0.1).expect("a plan");
    take(&mut monitor, plan(1, 0.2, [0.0, 7800.0, 1.0], [0.0, -2000.0, 0.0], 8.0), 0.2).expect("a plan");
    let found = conflicts(&mut monitor);
    let [(Event::PlanConflict { conflict, .. }, ..)] = &found[..] else { panic!("{found:?}") };
    assert!(conflict.upper_m < 1e-5, "{conflict:?}");
}

#[test]
fn an_undecided_plan_is_announced() {
    // The two pass each other at exactly 1 m, on curves.
    let bent = |drone: i32, y_m: f64, sign: f64| {
        let coefficients = |last: [f64; 2]| json!([0.0, 0.0, 0.0, last[0], last[1], 0.0]);
        let mut message = line(drone, nanoseconds(0.1), [0.0; 3], [0.0; 3], 2.0);
        message["coef_x"] = json!([0.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
        message["coef_y"] = coefficients([sign * 0.25, -sign * 0.5]);
        message["coef_y"][5] = json!(y_m + sign * 0.25);
        live_plans(&message).expect("a plan").expect("a valid one").remove(0)
    };
    let judged = |gap_m: f64| {
        let mut monitor = monitor(settings());
        heard(&mut monitor, 0.0);
        take(&mut monitor, bent(0, 0.0, -1.0), 0.1).expect("a plan");
        take(&mut monitor, bent(1, gap_m, 1.0), 0.1).expect("a plan");
        let found = conflicts(&mut monitor);
        (found, heard(&mut monitor, 0.2))
    };
    let (found, state) = judged(1.0);
    let [(Event::PlanConflict { conflict, .. }, json, text)] = &found[..] else { panic!("{found:?}") };
    assert!(conflict.min_at_s.is_none() && conflict.lower_m < 1.0 && conflict.upper_m >= 1.0, "{conflict:?}");
    assert!(
        text.contains(" may come to ") && text.contains("possibly closer") && json["min_at_s"].is_null(),
        "{text} {json}"
    );
    assert!(matches!(state, State::Undecided(Reason::PlanConflict(_))), "{state:?}");
    // Negative twin.
    let (found, state) = judged(1.001);
    assert!(found.is_empty() && state == State::Clear, "{found:?} {state:?}");
}

#[test]
fn an_old_plan_that_is_sent_again_replaces_none() {
    let mut monitor = monitor(settings());
    heard(&mut monitor, 0.0);
    let stand = |k: u32| plan(0, 0.01 * f64::from(k), [0.0, f64::from(k % 7), 1.0], [0.0; 3], 100.0);
    for k in 0..1100 {
        take(&mut monitor, stand(k), 0.01 * f64::from(k)).expect("a plan");
    }
    // Among the newest plans it is a repetition; older ones are refused.
    take(&mut monitor, stand(100), 11.0).expect("a repetition");
    let error = take(&mut monitor, stand(50), 11.0).expect_err("forgotten");
    assert!(matches!(error, Problem::WrongPlan(_)), "{error:?}");
    assert_eq!(monitor.plan_counts(), Some([1100, 0]));
    // The last plan is still valid.
    let y_m = f64::from(1099 % 7);
    take(&mut monitor, plan(1, 11.0, [0.5, y_m, 1.0], [0.0; 3], 1.0), 11.0).expect("a plan");
    assert_eq!(conflicts(&mut monitor).len(), 1);
}

#[test]
fn the_end_of_a_plan_is_that_of_the_settings() {
    // The first plan ends at the origin after 1 s; the second one passes there later.
    for (end, count, source) in [
        (None, 1, "default"),
        (Some(PlanEnd::Hold), 1, "declared"),
        (Some(PlanEnd::Continue), 0, "declared"),
        (Some(PlanEnd::Unknown), 0, "declared"),
    ] {
        let mut monitor = monitor(Settings { plan_end: end, ..settings() });
        heard(&mut monitor, 0.0);
        take(&mut monitor, plan(0, 0.0, [-5.0, 0.0, 1.0], [5.0, 0.0, 0.0], 1.0), 0.0).expect("a plan");
        take(&mut monitor, across(0.1, 0.0), 0.1).expect("a plan");
        assert_eq!(conflicts(&mut monitor).len(), count, "{end:?}");
        let facts = monitor.facts();
        let fact = facts.iter().find(|fact| fact.kind == FactKind::PlanEnd).expect("a fact");
        assert_eq!(serde_json::to_value(fact).expect("JSON")["source"], source);
    }
}

#[test]
fn plans_that_cannot_be_used_are_errors() {
    for has_positions in [true, false] {
        let mut monitor = monitor(settings());
        if has_positions {
            heard(&mut monitor, 0.0);
        }
        let clock = if has_positions { PlanClock::Positions } else { PlanClock::Machine };
        for (start_s, lead_s) in [(61.0, 61.0), (-61.0, -61.0), (-1.6e9, -1.6e9)] {
            let error = take(&mut monitor, along(start_s), 0.0).expect_err("another clock");
            let Problem::OtherPlanClock(found_s, found) = error else { panic!("{error:?}") };
            assert!(found == clock && (found_s - lead_s).abs() < 1e-3, "{found_s} {found:?}");
        }
        take(&mut monitor, along(59.0), 0.0).expect("a plan");
        // Another curve with the same start.
        let other = plan(0, 59.0, [0.0; 3], [0.0; 3], 1.0);
        assert!(matches!(take(&mut monitor, other, 0.1), Err(Problem::WrongPlan(_))));
        let long = LivePlan { pieces: vec![along(0.0).pieces[0].clone(); 1001], ..along(0.0) };
        assert!(matches!(take(&mut monitor, long, 0.1), Err(Problem::WrongPlan(_))));
        // Pieces that are not in order are refused by the auditor.
        let twice = LivePlan { pieces: vec![along(0.0).pieces[0].clone(); 2], ..along(0.0) };
        assert!(matches!(take(&mut monitor, twice, 0.1), Err(Problem::WrongPlan(_))));
        assert!(conflicts(&mut monitor).is_empty());
    }
}

#[test]
fn plans_that_all_start_later_are_limited() {
    let mut monitor = monitor(settings());
    let taken = |monitor: &mut Monitor, k: u32| {
        take(monitor, plan(0, 1.0 + 0.1 * f64::from(k), [0.0; 3], [0.0; 3], 1.0), 0.001 * f64::from(k))
    };
    for k in 0..100 {
        taken(&mut monitor, k).expect("a plan");
    }
    assert!(matches!(taken(&mut monitor, 100), Err(Problem::WrongPlan(_))));
    // When some have started, there is room again.
    take(&mut monitor, plan(0, 12.0, [0.0; 3], [0.0; 3], 1.0), 2.0).expect("a plan");
}

/// Collects notices, and ends the watch at one with a code.
struct Collected {
    notices: Vec<Value>,
    stop: Arc<AtomicBool>,
    last: &'static str,
}

impl Output for Collected {
    fn notice(&mut self, notice: &Notice) -> io::Result<()> {
        self.notices.push(notice.json.clone());
        if notice.event == self.last {
            self.stop.store(true, Ordering::Relaxed);
        }
        Ok(())
    }
}

/// Watches a server of rosbridge that sends messages of one topic, until a notice with a code comes.
fn watched(messages: Vec<Value>, last: &'static str) -> Vec<Value> {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let url = format!("ws://{}", listener.local_addr().expect("an address"));
    let server = std::thread::spawn(move || {
        let mut socket = tungstenite::accept(listener.accept().expect("a client").0).expect("a handshake");
        socket.read().expect("a subscription");
        for message in messages {
            let text = json!({ "op": "publish", "topic": "/plans", "msg": message }).to_string();
            socket.send(Message::text(text)).expect("sends");
        }
        // Until the watch closes the connection.
        while socket.read().is_ok() {}
    });
    let stop = Arc::new(AtomicBool::new(false));
    let (feed, inputs) = channel(Arc::clone(&stop));
    let topics = vec!["/plans".to_owned()];
    rosbridge(&url, NamingOptions { topics, ..NamingOptions::default() }, feed).expect("an address");
    let mut collected = Collected { notices: Vec::new(), stop, last };
    watch(monitor(settings()), &inputs, &mut collected).expect("outputs do not fail");
    server.join().expect("ends");
    collected.notices
}

#[test]
fn plans_come_through_rosbridge() {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).expect("after 1970") + Duration::from_millis(500);
    let now_ns = i64::try_from(now.as_nanos()).expect("before 2262");
    let first = line(0, now_ns, [-4.0, 0.0, 1.0], [1.0, 0.0, 0.0], 8.0);
    let second = line(1, now_ns, [0.0, 8.0, 1.0], [0.0, -2.0, 0.0], 8.0);
    let notices = watched(vec![first.clone(), second], "plan-conflict");
    let found = notices.iter().find(|notice| notice["event"] == "plan-conflict").expect("a conflict");
    assert_eq!((&found["plan"]["vehicle"], &found["other"]["vehicle"]), (&json!("1"), &json!("0")), "{found}");
    assert!(found["left_s"].as_f64().is_some_and(|left_s| left_s > 2.0 && left_s < 4.5), "{found}");
    assert!(found["min_m"].as_f64().is_some_and(|min_m| min_m < 1e-3), "{found}");
    assert_eq!(notices.last().expect("a summary")["plans"], json!({ "count": 2, "conflicts": 1 }));
    // A malformed plan is an error of the input.
    let mut spoiled = first;
    spoiled["coef_y"] = json!([]);
    let notices = watched(vec![spoiled], "fault");
    let found = notices.iter().find(|notice| notice["event"] == "fault").expect("an error");
    let reason = &found["reason"];
    assert_eq!((&found["fault"], &reason["code"]), (&json!("garbage"), &json!("wrong-plan")), "{found}");
    assert_eq!(reason["data"]["place"], "/plans", "{found}");
    assert!(reason["text"].as_str().is_some_and(|text| text.contains("coef_y: 1 duration needs 6 numbers")), "{found}");
}
