//! Presence of vehicles: absences, and the requirement of presence over the whole window.

use tautline_audit::Status;
use tautline_audit::recorded::{Absence, Outcome, Presence, Settings, audit};
use tautline_core::track::Item;

use crate::recorded::{names, seen};

/// Returns samples of a vehicle far from the others, at an interval of `every_s`.
fn track(vehicle: usize, from_s: f64, to_s: f64, every_s: f64) -> Vec<Item> {
    let times = std::iter::successors(Some(from_s), |time_s| Some(time_s + every_s));
    times
        .take_while(|time_s| *time_s <= to_s)
        .map(|time_s| seen(vehicle, time_s, [9.0 * vehicle as f64, 0.0, 0.0]))
        .collect()
}

fn judge(tracks: &[Vec<Item>], settings: Settings) -> Outcome {
    let mut items = tracks.concat();
    items.sort_by(|a, b| a.time_s().total_cmp(&b.time_s()));
    audit(&names(tracks.len()), &items, settings).expect("an outcome")
}

fn required() -> Settings {
    Settings { require_presence: true, ..Settings::delta(1.0) }
}

#[test]
fn an_early_end_or_late_start_is_undecided_if_presence_is_required() {
    let whole = || track(0, 0.0, 10.0, 1.0);
    for (part, from_s, to_s) in [
        (track(1, 0.0, 9.0, 1.0), 0.0, 9.0),
        (track(1, 1.0, 10.0, 1.0), 1.0, 10.0),
        (track(1, 0.0, 4.0, 1.0), 0.0, 4.0),
        (track(1, 5.0, 5.0, 1.0), 5.0, 5.0),
    ] {
        let expected = [Absence { vehicle: 1, seen: Some(Presence { from_s, to_s }) }];
        let plain = judge(&[whole(), part.clone()], Settings::delta(1.0));
        assert_eq!((plain.status, &plain.absences[..]), (Status::Clear, &expected[..]));
        let strict = judge(&[whole(), part], required());
        assert_eq!(
            (strict.status, strict.separation, &strict.absences[..]),
            (Status::Undecided, Some(Status::Clear), &expected[..])
        );
    }
}

#[test]
fn vehicles_present_throughout_are_not_absent_at_any_sampling() {
    let aligned = judge(&[track(0, 0.0, 10.0, 1.0), track(1, 0.0, 10.0, 1.0)], required());
    assert_eq!((aligned.status, aligned.absences.len()), (Status::Clear, 0));
    let between = judge(&[track(0, 0.0, 10.0, 1.0), track(1, 0.4, 9.5, 1.0)], required());
    assert_eq!((between.status, between.absences.len()), (Status::Clear, 0));
    let twice_as_often = judge(&[track(0, 0.0, 10.0, 1.0), track(1, 0.0, 9.5, 0.5)], required());
    assert_eq!(twice_as_often.status, Status::Undecided, "half a second is one interval of the second vehicle");
}

#[test]
fn absences_refer_to_the_window_and_the_selected_vehicles() {
    let tracks = || [track(0, 0.0, 10.0, 1.0), track(1, 0.0, 10.0, 1.0), track(2, 0.0, 4.0, 1.0)];
    let early = judge(&tracks(), Settings { until_s: Some(4.0), ..required() });
    assert_eq!((early.status, early.absences.len()), (Status::Clear, 0));
    let late = judge(&tracks(), Settings { from_s: Some(6.0), ..required() });
    assert_eq!((late.status, late.absences[0]), (Status::Undecided, Absence { vehicle: 2, seen: None }));
    let longer = judge(&tracks(), Settings { until_s: Some(60.0), ..required() });
    assert_eq!((longer.status, longer.absences.len()), (Status::Undecided, 3));
    let only = Some(["alpha", "bravo"].map(str::to_owned).into());
    assert_eq!(judge(&tracks(), Settings { only, ..required() }).status, Status::Clear);
}

#[test]
fn a_violation_outranks_an_absence() {
    let near: Vec<_> = (0..=4).map(|k| seen(1, f64::from(k), [0.5, 0.0, 0.0])).collect();
    assert_eq!(judge(&[track(0, 0.0, 10.0, 1.0), near], required()).status, Status::Violation);
}
