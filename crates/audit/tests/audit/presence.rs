//! Who was seen from when to when: what a verdict is about, and what is not known.

use tautline_audit::Status;
use tautline_audit::recorded::{Absence, Outcome, Presence, Settings, audit};
use tautline_core::track::Item;

use crate::recorded::{names, seen};

/// Samples of a vehicle far from the others, every `every_s` from one time to another.
fn track(vehicle: usize, from_s: f64, to_s: f64, every_s: f64) -> Vec<Item> {
    let times = std::iter::successors(Some(from_s), |time_s| Some(time_s + every_s));
    times
        .take_while(|time_s| *time_s <= to_s)
        .map(|time_s| seen(vehicle, time_s, [9.0 * vehicle as f64, 0.0, 0.0]))
        .collect()
}

fn judged(tracks: &[Vec<Item>], settings: Settings) -> Outcome {
    let mut items = tracks.concat();
    items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    audit(&names(tracks.len()), &items, settings).expect("an outcome")
}

fn required() -> Settings {
    Settings { require_presence: true, ..Settings::delta(1.0) }
}

#[test]
fn one_that_leaves_early_or_comes_late_is_named_and_undecided_where_presence_is_required() {
    let whole = || track(0, 0.0, 10.0, 1.0);
    for (part, from_s, to_s) in [
        (track(1, 0.0, 9.0, 1.0), 0.0, 9.0),
        (track(1, 1.0, 10.0, 1.0), 1.0, 10.0),
        (track(1, 0.0, 4.0, 1.0), 0.0, 4.0),
        (track(1, 5.0, 5.0, 1.0), 5.0, 5.0),
    ] {
        let expected = [Absence { vehicle: 1, seen: Some(Presence { from_s, to_s }) }];
        let plain = judged(&[whole(), part.clone()], Settings::delta(1.0));
        assert_eq!((plain.status, &plain.absences[..]), (Status::Clear, &expected[..]));
        let strict = judged(&[whole(), part], required());
        assert_eq!(
            (strict.status, strict.separation, &strict.absences[..]),
            (Status::Undecided, Some(Status::Clear), &expected[..])
        );
    }
}

#[test]
fn vehicles_that_are_seen_throughout_are_not_named_whenever_they_are_sampled() {
    let aligned = judged(&[track(0, 0.0, 10.0, 1.0), track(1, 0.0, 10.0, 1.0)], required());
    assert_eq!((aligned.status, aligned.absences.len()), (Status::Clear, 0));
    let between = judged(&[track(0, 0.0, 10.0, 1.0), track(1, 0.4, 9.5, 1.0)], required());
    assert_eq!((between.status, between.absences.len()), (Status::Clear, 0));
    let twice_as_often = judged(&[track(0, 0.0, 10.0, 1.0), track(1, 0.0, 9.5, 0.5)], required());
    assert_eq!(twice_as_often.status, Status::Undecided, "half a second is a sample of the second");
}

#[test]
fn the_window_that_was_asked_for_counts_and_those_who_are_not_judged_do_not() {
    let tracks = || [track(0, 0.0, 10.0, 1.0), track(1, 0.0, 10.0, 1.0), track(2, 0.0, 4.0, 1.0)];
    let early = judged(&tracks(), Settings { to_s: Some(4.0), ..required() });
    assert_eq!((early.status, early.absences.len()), (Status::Clear, 0));
    let late = judged(&tracks(), Settings { from_s: Some(6.0), ..required() });
    assert_eq!((late.status, late.absences[0]), (Status::Undecided, Absence { vehicle: 2, seen: None }));
    let longer = judged(&tracks(), Settings { to_s: Some(60.0), ..required() });
    assert_eq!((longer.status, longer.absences.len()), (Status::Undecided, 3));
    let only = Some(["alpha", "bravo"].map(str::to_owned).into());
    assert_eq!(judged(&tracks(), Settings { only, ..required() }).status, Status::Clear);
}

#[test]
fn a_violation_is_one_whoever_is_missing() {
    let near: Vec<_> = (0..=4).map(|k| seen(1, f64::from(k), [0.5, 0.0, 0.0])).collect();
    assert_eq!(judged(&[track(0, 0.0, 10.0, 1.0), near], required()).status, Status::Violation);
}
