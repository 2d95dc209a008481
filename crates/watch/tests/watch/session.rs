//! A watch from lines to notices, a summary and a recording.

use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::{monitor, settings};
use tautline_watch::source::{OwnedPose, channel, lines};
use tautline_watch::{Notice, Output, Settings, Summary, TimeBase, watch};

#[derive(Default)]
struct Collected {
    texts: Vec<String>,
    rows: Vec<f64>,
}

impl Output for Collected {
    fn notice(&mut self, notice: &Notice) -> io::Result<()> {
        assert_eq!(notice.json["event"], notice.event);
        self.texts.push(notice.text.clone());
        Ok(())
    }

    fn pose(&mut self, time_s: f64, _pose: &OwnedPose) -> io::Result<()> {
        self.rows.push(time_s);
        Ok(())
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
    assert!(summary.is_good(), "{summary:?} {:?}", seen.texts);
    assert!((summary.clear_s - 4.0).abs() < 1e-9, "{summary:?}");
    assert_eq!(seen.texts.iter().filter(|text| text.contains(": CLEAR until")).count(), 5, "{:?}", seen.texts);
    assert_eq!(seen.rows.len(), 82);
}

#[test]
fn a_passing_violation_is_measured() {
    let (summary, seen) = watched(&approach(-2.0, 0.3).join("\n"));
    assert!(!summary.is_good() && summary.violations == 1, "{summary:?}");
    let texts = seen.texts.join("\n");
    assert!(texts.contains("on course to violate: a-b at 1.80 s; brake a-b by"), "{texts}");
    assert!(texts.contains("violation of a-b from 1.80 s to 2.20 s, smallest distance 0.30 m at 2.00 s"), "{texts}");
    assert!(texts.contains(": VIOLATION a-b 0."), "{texts}");
    let (apart, seen) = watched(&approach(-2.0, 0.6).join("\n"));
    assert_eq!(apart.violations, 0, "{:?}", seen.texts);
}

#[test]
fn silence_of_one_and_of_all_is_not_known() {
    let keep = |keep: fn(&str) -> bool| -> String {
        approach(0.0, 0.0).into_iter().filter(|line| keep(line)).collect::<Vec<_>>().join("\n")
    };
    let one = keep(|line| !(line.contains("\"b\"") && (line.contains("\"t\":3") || line.contains("\"t\":2."))));
    let all = keep(|line| !line.contains("\"t\":1.") && !line.contains("\"t\":2"));
    for (text, why) in [(one, "NOT KNOWN: b not heard for 1."), (all, "NOT KNOWN: a not heard for 2.00 s")] {
        let (summary, seen) = watched(&text);
        assert!(!summary.is_good() && summary.was_not_known, "{summary:?}");
        assert!(seen.texts.iter().any(|text| text.contains(why)), "{:?}", seen.texts);
    }
}

#[test]
fn garbage_in_the_middle_ends_clear_and_nothing_else_happens() {
    let good = approach(0.0, 0.0);
    let text = [&good[..20].join("\n"), "garbage", &good[20..].join("\n")].join("\n");
    let (summary, seen) = watched(&text);
    assert!(!summary.is_good() && summary.was_not_known && !summary.was_violated, "{summary:?}");
    assert!(
        seen.texts.iter().any(|text| text.contains("a message cannot be read: line 21: not a pose")),
        "{:?}",
        seen.texts
    );
    assert_eq!(seen.rows.len(), 82);
}

#[test]
fn nothing_heard_is_not_good() {
    for text in ["", "\n\n", r#"{"t":0,"id":"a","x":0,"y":0,"z":2}"#] {
        let (summary, seen) = watched(text);
        assert!(!summary.is_good() && !summary.has_started, "{summary:?}");
        assert!(seen.texts.last().is_some_and(|text| text.starts_with("NOT KNOWN")), "{:?}", seen.texts);
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
    assert!(!summary.is_good() && summary.was_not_known, "{summary:?} {:?}", seen.texts);
    assert!((summary.clear_s + summary.not_known_s - 4.0).abs() < 1e-9, "{summary:?}");
    assert!((0.6..0.9).contains(&summary.not_known_s), "{summary:?}");
    assert!(seen.texts.iter().any(|text| text.contains("NOT KNOWN: a-b may be as near as")), "{:?}", seen.texts);
    // Each stamp comes before the end of CLEAR.
    let (summary, seen) = watched(&at(0.8));
    assert!(summary.is_good() && summary.not_known_s == 0.0, "{summary:?} {:?}", seen.texts);
}

#[test]
fn a_violation_is_reported_before_the_state_of_the_same_stamp() {
    let lines = (0..=3).flat_map(|t| {
        [("a", f64::from(t), 1, 0.0), ("b", 6.0 - f64::from(t), -1, 0.2)]
            .map(|(id, x, v, y)| format!(r#"{{"t":{t},"id":"{id}","x":{x},"y":{y},"z":2,"vx":{v},"vy":0,"vz":0}}"#))
    });
    let (summary, seen) = watched(&lines.collect::<Vec<_>>().join("\n"));
    assert!(summary.was_violated, "{summary:?}");
    let place = |text: &str| seen.texts.iter().position(|of| of.contains(text)).expect(text);
    assert!(place("violation of a-b began") < place(": VIOLATION a-b"), "{:?}", seen.texts);
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
    assert!(summary.is_good() && summary.signed_off == 2, "{summary:?} {:?}", seen.texts);
    assert!((summary.clear_s - 4.05).abs() < 1e-9 && summary.not_known_s == 0.0, "{summary:?}");
    let texts = seen.texts.join("\n");
    assert!(texts.contains("4.05 s: b signed off"), "{texts}");
    assert!(texts.contains("NOT KNOWN: only one vehicle has not signed off; signed off: 1 of 2"), "{texts}");
    assert!(texts.contains("(declared): 2 vehicles (2 signed off), 4.05 s CLEAR"), "{texts}");
    // Negative twin: a silent vehicle is stale.
    assert!(!whole(false).0.is_good());
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
        assert!(!summary.is_good() && summary.was_not_known && summary.returned == 1, "{summary:?} {:?}", seen.texts);
        // NOT KNOWN from the sign-off to the return, and for the largest age from there.
        assert!((summary.clear_s - clear_s).abs() < 1e-9, "{summary:?}");
        assert!((summary.not_known_s - 2.98).abs() < 1e-9, "{summary:?}");
        let texts = seen.texts.join("\n");
        let back = "3.10 s: a is heard again after its sign-off: its separation since 1.02 s is NOT KNOWN";
        assert!(texts.contains(back), "{texts}");
        assert!(texts.contains("3.10 s: NOT KNOWN: a vehicle sent a position after its sign-off"), "{texts}");
        assert!(texts.contains("; heard again after a sign-off: 1"), "{texts}");
        // Negative twin: without the return, the watch is good.
        let (summary, seen) = flight(false);
        assert!(summary.is_good() && summary.returned == 0, "{summary:?} {:?}", seen.texts);
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
    assert!(!summary.is_good() && summary.was_not_known, "{summary:?} {:?}", seen.texts);
    assert!(summary.not_known_s > 1.9, "{summary:?}");
    assert!(seen.texts.last().is_some_and(|text| text.starts_with("NOT KNOWN: 3 vehicles")), "{:?}", seen.texts);
    // Negative twin: the time since the sign-off of `a` is the end.
    let (summary, seen) = flight(false);
    assert!(summary.is_good() && summary.not_known_s == 0.0, "{summary:?} {:?}", seen.texts);
}

#[test]
fn a_sign_off_alone_starts_no_watch_and_an_unknown_one_gives_doubt() {
    let (summary, seen) = watched(r#"{"t":0,"id":"a","event":"off"}"#);
    assert!(!summary.is_good() && !summary.has_started, "{summary:?}");
    assert!(seen.texts[0].contains(r#""a" signs off and was not heard"#), "{:?}", seen.texts);
    let flight = approach(0.0, 0.0);
    let text = [&flight[..20].join("\n"), r#"{"t":1,"id":"z","event":"off"}"#, &flight[20..].join("\n")].join("\n");
    assert!(watched(&text).0.was_not_known);
}

#[test]
fn a_name_with_an_end_of_line_forges_no_line() {
    let text = approach(0.0, 0.0).join("\n").replace(r#""b""#, r#""b\n9.00 s: CLEAR\u001b[2K""#);
    let (_, seen) = watched(&text);
    assert!(seen.texts.iter().any(|text| text.contains("9.00 s: CLEAR")), "{:?}", seen.texts);
    assert!(!seen.texts.iter().any(|text| text.contains(char::is_control)), "{:?}", seen.texts);
}
