//! A watch from lines to notices, a summary and a recording.

use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use serde_json::{Value, json};

use crate::{monitor, settings};
use tautline_watch::source::{OwnedPose, channel, lines};
use tautline_watch::{Notice, Output, Settings, Summary, TimeBase, watch};

#[derive(Default)]
struct Collected {
    notices: Vec<Value>,
    rows: Vec<f64>,
}

impl Output for Collected {
    fn notice(&mut self, notice: &Notice) -> io::Result<()> {
        assert_eq!(notice.json["event"], notice.event);
        assert!(!notice.text.contains(char::is_control), "{}", notice.text);
        self.notices.push(notice.json.clone());
        Ok(())
    }

    fn pose(&mut self, time_s: f64, _pose: &OwnedPose) -> io::Result<()> {
        self.rows.push(time_s);
        Ok(())
    }
}

impl Collected {
    /// Returns the place of the first notice with these values at their paths.
    fn place(&self, values: &[(&str, Value)]) -> Option<usize> {
        self.notices.iter().position(|of| values.iter().all(|(path, value)| of.pointer(path) == Some(value)))
    }

    fn has(&self, values: &[(&str, Value)]) -> bool {
        self.place(values).is_some()
    }

    fn count(&self, status: &str) -> usize {
        self.notices.iter().filter(|of| of["event"] == "state" && of["status"] == status).count()
    }

    fn summary(&self) -> &Value {
        self.notices.last().expect("a summary")
    }
}

fn watched(text: &str) -> (Summary, Collected) {
    let (feed, inputs) = channel(Arc::new(AtomicBool::new(false)));
    lines(text.as_bytes(), &feed);
    let settings = Settings { delta_m: 0.5, time_base: TimeBase::Stamps, ..settings() };
    let mut collected = Collected::default();
    let summary = watch(monitor(settings), &inputs, &mut collected).expect("outputs do not fail");
    (summary, collected)
}

/// Returns lines of `a` at rest and `b`, which moves along x from 4 m, for 4 s at 10 Hz.
fn approach(speed: f64, offset_m: f64) -> Vec<String> {
    let lines = (0..=40).map(|k| f64::from(k) / 10.0).flat_map(|t| {
        let x = 4.0 + speed * t;
        [
            format!(r#"{{"t":{t},"id":"a","x":0,"y":0,"z":2,"vx":0,"vy":0,"vz":0}}"#),
            format!(r#"{{"t":{t},"id":"b","x":{x},"y":{offset_m},"z":2,"vx":{speed},"vy":0,"vz":0}}"#),
        ]
    });
    lines.collect()
}

#[test]
fn a_clear_watch_has_a_line_each_second_and_is_good() {
    let (summary, seen) = watched(&approach(0.0, 0.0).join("\n"));
    assert!(summary.passes(), "{summary:?} {:?}", seen.notices);
    assert!((summary.clear_s - 4.0).abs() < 1e-9, "{summary:?}");
    assert_eq!(seen.count("clear"), 5, "{:?}", seen.notices);
    assert_eq!(seen.rows.len(), 82);
}

#[test]
fn a_passing_violation_is_measured() {
    let (summary, seen) = watched(&approach(-2.0, 0.3).join("\n"));
    assert!(!summary.passes() && summary.violations == 1, "{summary:?}");
    let announced = seen.notices.iter().filter_map(|of| of["nominal_violation"]["at_s"].as_f64());
    assert!(announced.clone().count() > 0 && announced.into_iter().all(|at_s| (at_s - 1.8).abs() < 1e-9));
    assert!(seen.count("violation") > 0, "{:?}", seen.notices);
    let end = &seen.notices[seen.place(&[("/event", json!("violation-end"))]).expect("an end")];
    for (path, value) in [("/from_s", 1.8), ("/to_s", 2.2), ("/value/upper", 0.3), ("/at_s", 2.0)] {
        assert!(end.pointer(path).and_then(Value::as_f64).is_some_and(|of| (of - value).abs() < 1e-9), "{end}");
    }
    let (apart, seen) = watched(&approach(-2.0, 0.6).join("\n"));
    assert_eq!(apart.violations, 0, "{:?}", seen.notices);
}

#[test]
fn silence_of_one_and_of_all_is_not_known() {
    let keep = |keep: fn(&str) -> bool| -> String {
        approach(0.0, 0.0).into_iter().filter(|line| keep(line)).collect::<Vec<_>>().join("\n")
    };
    let one = keep(|line| !(line.contains("\"b\"") && (line.contains("\"t\":3") || line.contains("\"t\":2."))));
    let all = keep(|line| !line.contains("\"t\":1.") && !line.contains("\"t\":2"));
    for (text, vehicle) in [(one, "b"), (all, "a")] {
        let (summary, seen) = watched(&text);
        assert!(!summary.passes() && summary.was_undecided, "{summary:?}");
        let stale = [("/reason/code", json!("stale")), ("/reason/data/vehicle", json!(vehicle))];
        assert!(seen.has(&stale), "{:?}", seen.notices);
    }
}

#[test]
fn garbage_in_the_middle_ends_clear_and_nothing_else_happens() {
    let good = approach(0.0, 0.0);
    let text = [&good[..20].join("\n"), "garbage", &good[20..].join("\n")].join("\n");
    let (summary, seen) = watched(&text);
    assert!(!summary.passes() && summary.was_undecided && !summary.was_violated, "{summary:?}");
    let wrong = [
        ("/fault", json!("garbage")),
        ("/reason/code", json!("not-pose")),
        ("/reason/data/place", json!("line 21")),
        ("/reason/data/other", json!("garbage")),
    ];
    assert!(seen.has(&wrong), "{:?}", seen.notices);
    assert_eq!(seen.rows.len(), 82);
}

#[test]
fn nothing_heard_is_not_good() {
    for text in ["", "\n\n", r#"{"t":0,"id":"a","x":0,"y":0,"z":2}"#] {
        let (summary, seen) = watched(text);
        assert!(!summary.passes() && !summary.has_started, "{summary:?}");
        assert_eq!((&seen.summary()["status"], &seen.summary()["pass"]), (&json!("undecided"), &json!(false)));
    }
}

#[test]
fn time_after_the_end_of_clear_is_not_known() {
    let at = |period_s: f64| -> String {
        let lines = (0..=4).flat_map(|k| {
            let t = f64::from(k) * period_s;
            [("a", 0.0), ("b", 4.0)]
                .map(|(id, x)| format!(r#"{{"t":{t},"id":"{id}","x":{x},"y":0,"z":2,"vx":0,"vy":0,"vz":0}}"#))
        });
        lines.collect::<Vec<_>>().join("\n")
    };
    // The bounds prove sqrt((4 - 0.5) / 5) s = 0.84 s at most, less the errors of the poses.
    let (summary, seen) = watched(&at(1.0));
    assert!(!summary.passes() && summary.was_undecided, "{summary:?} {:?}", seen.notices);
    assert!((summary.clear_s + summary.undecided_s - 4.0).abs() < 1e-9, "{summary:?}");
    assert!((0.6..0.9).contains(&summary.undecided_s), "{summary:?}");
    assert!(seen.has(&[("/reason/code", json!("uncertain")), ("/reason/data/subjects", json!(["a", "b"]))]));
    // Each stamp comes before the end of CLEAR.
    let (summary, seen) = watched(&at(0.8));
    assert!(summary.passes() && summary.undecided_s == 0.0, "{summary:?} {:?}", seen.notices);
}

#[test]
fn a_violation_is_reported_before_the_state_of_the_same_stamp() {
    let lines = (0..=3).flat_map(|t| {
        [("a", f64::from(t), 1, 0.0), ("b", 6.0 - f64::from(t), -1, 0.2)]
            .map(|(id, x, v, y)| format!(r#"{{"t":{t},"id":"{id}","x":{x},"y":{y},"z":2,"vx":{v},"vy":0,"vz":0}}"#))
    });
    let (summary, seen) = watched(&lines.collect::<Vec<_>>().join("\n"));
    assert!(summary.was_violated, "{summary:?}");
    let began = seen.place(&[("/event", json!("violation"))]).expect("a violation");
    assert!(Some(began) < seen.place(&[("/status", json!("violation"))]), "{:?}", seen.notices);
}

#[test]
fn a_watch_whose_vehicles_sign_off_one_by_one_is_good() {
    let flight = approach(0.0, 0.0);
    let rest_of_a = (41..=80).map(|k| format!(r#"{{"t":{},"id":"a","x":0,"y":0,"z":2}}"#, f64::from(k) / 10.0));
    let off = |t: f64, id: &str| format!(r#"{{"t":{t},"id":"{id}","event":"off"}}"#);
    let whole = |sign_offs: bool| {
        let mut lines = flight.clone();
        lines.extend(sign_offs.then(|| off(4.05, "b")));
        lines.extend(rest_of_a.clone());
        lines.extend(sign_offs.then(|| off(8.0, "a")));
        watched(&lines.join("\n"))
    };
    let (summary, seen) = whole(true);
    assert!(summary.passes() && summary.signed_off == 2, "{summary:?} {:?}", seen.notices);
    assert!((summary.clear_s - 4.05).abs() < 1e-9 && summary.undecided_s == 0.0, "{summary:?}");
    assert!(seen.has(&[("/event", json!("signed-off")), ("/t_s", json!(4.05)), ("/vehicle", json!("b"))]));
    let alone = [("/reason/code", json!("signed-off")), ("/heard", json!(2)), ("/signed_off", json!(["b"]))];
    assert!(seen.has(&alone), "{:?}", seen.notices);
    assert_eq!(seen.summary()["signed_off"], json!(["a", "b"]));
    // Negative twin: a silent vehicle is stale.
    assert!(!whole(false).0.passes());
}

/// Returns lines of vehicles at rest on the x axis, each at 10 Hz for its tenths of a second.
fn resting(vehicles: &[(&str, f64, std::ops::Range<u32>)]) -> Vec<(f64, String)> {
    let lines = vehicles.iter().flat_map(|(id, x, tenths)| {
        tenths.clone().map(move |k| {
            let t = f64::from(k) / 10.0;
            (t, format!(r#"{{"t":{t},"id":"{id}","x":{x},"y":0,"z":2,"vx":0,"vy":0,"vz":0}}"#))
        })
    });
    lines.collect()
}

/// Returns lines in the order of their stamps.
fn in_order(mut lines: Vec<(f64, String)>) -> String {
    lines.sort_by(|a, b| a.0.total_cmp(&b.0));
    lines.into_iter().map(|(_, line)| line).collect::<Vec<_>>().join("\n")
}

fn off(t: f64, id: &str) -> (f64, String) {
    (t, format!(r#"{{"t":{t},"id":"{id}","event":"off"}}"#))
}

#[test]
fn a_return_after_a_sign_off_makes_the_time_since_the_sign_off_not_known() {
    // `a` signs off at 1.02 s and is heard again at 3.1 s, on the other side of `b`.
    for (others, clear_s) in [(&[("b", 5.0, 0..41)][..], 1.02), (&[("b", 5.0, 0..41), ("c", 20.0, 0..41)], 1.02)] {
        let flight = |returns: bool| {
            let mut lines = resting(others);
            lines.extend(resting(&[("a", 0.0, 0..11)]));
            lines.push(off(1.02, "a"));
            lines.extend(returns.then(|| resting(&[("a", 10.0, 31..41)])).into_iter().flatten());
            watched(&in_order(lines))
        };
        let (summary, seen) = flight(true);
        assert!(!summary.passes() && summary.was_undecided && summary.returned == 1, "{summary:?} {:?}", seen.notices);
        // UNDECIDED from the sign-off to the return, and for the largest age from there.
        assert!((summary.clear_s - clear_s).abs() < 1e-9, "{summary:?}");
        assert!((summary.undecided_s - 2.98).abs() < 1e-9, "{summary:?}");
        let back = [("/event", json!("back")), ("/t_s", json!(3.1)), ("/signed_off_s", json!(1.02))];
        assert!(seen.has(&back), "{:?}", seen.notices);
        let doubt = [("/status", json!("undecided")), ("/reason/data/fault", json!("pose-after-sign-off"))];
        assert!(seen.has(&doubt), "{:?}", seen.notices);
        assert_eq!(seen.summary()["returned"], 1);
        // Negative twin: without the return, the watch is good.
        let (summary, seen) = flight(false);
        assert!(summary.passes() && summary.returned == 0, "{summary:?} {:?}", seen.notices);
    }
}

#[test]
fn only_the_last_time_with_one_vehicle_is_the_end_of_a_watch() {
    // `a` signs off, `b` is silent from 1 s to 3 s, and `c` comes then or never.
    let flight = |comes: bool| {
        let mut lines = resting(&[("a", 0.0, 0..11), ("b", 5.0, 0..11), ("b", 5.0, 30..41)]);
        lines.push(off(1.02, "a"));
        lines.extend(comes.then(|| resting(&[("c", 10.0, 31..41)])).into_iter().flatten());
        watched(&in_order(lines))
    };
    let (summary, seen) = flight(true);
    assert!(!summary.passes() && summary.was_undecided, "{summary:?} {:?}", seen.notices);
    assert!(summary.undecided_s > 1.9, "{summary:?}");
    assert_eq!(
        (&seen.summary()["status"], &seen.summary()["vehicles"]),
        (&json!("undecided"), &json!(["a", "b", "c"]))
    );
    // Negative twin: the time since the sign-off of `a` is the end.
    let (summary, seen) = flight(false);
    assert!(summary.passes() && summary.undecided_s == 0.0, "{summary:?} {:?}", seen.notices);
}

#[test]
fn a_sign_off_alone_starts_no_watch_and_an_unknown_one_gives_doubt() {
    let (summary, seen) = watched(r#"{"t":0,"id":"a","event":"off"}"#);
    assert!(!summary.passes() && !summary.has_started, "{summary:?}");
    assert_eq!(
        (&seen.notices[0]["reason"]["code"], &seen.notices[0]["reason"]["data"]["detail"]),
        (&json!("not-heard"), &json!("a"))
    );
    let flight = approach(0.0, 0.0);
    let text = [&flight[..20].join("\n"), r#"{"t":1,"id":"z","event":"off"}"#, &flight[20..].join("\n")].join("\n");
    assert!(watched(&text).0.was_undecided);
}

#[test]
fn a_name_with_an_end_of_line_forges_no_line() {
    let text = approach(0.0, 0.0).join("\n").replace(r#""b""#, r#""b\n9.00 s: CLEAR\u001b[2K""#);
    let (_, seen) = watched(&text);
    // `Collected` refuses control characters in texts.
    assert!(seen.has(&[("/event", json!("heard")), ("/vehicle", json!("b\u{fffd}9.00 s: CLEAR\u{fffd}[2K"))]));
}
