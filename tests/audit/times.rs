//! Times before zero, and gaps that somebody else is there at the edge of alone.

use tautline::audit::Status;
use tautline::audit::recorded::{Settings, VehicleSettings};
use tautline::track::Item;

use crate::recorded::{asked, seen};

/// Two that fly side by side from a time on, ten times a second for 20 s, and are near each other in the second after it.
fn beside(begin_s: f64) -> Vec<Item> {
    let at = |k: u32| {
        let time_s = begin_s + 0.1 * f64::from(k);
        let apart_m = if k < 10 { 1.0 } else { 9.0 };
        [seen(0, time_s, [0.0, 0.0, f64::from(k)]), seen(1, time_s, [apart_m, 0.0, f64::from(k)])]
    };
    (0..200).flat_map(at).collect()
}

#[test]
fn it_does_not_matter_when_a_recording_begins() {
    for begin_s in [0.0, -50.0, -10.0, 1e6] {
        for offset_s in [0.0, -3.0, 3.0] {
            let set = || VehicleSettings { offset_s, ..VehicleSettings::default() };
            let vehicles = ["alpha", "bravo"].map(|name| (name.to_owned(), set())).into();
            let outcome = asked(&beside(begin_s), Settings { vehicles, ..Settings::delta(2.0) });
            let [found] = outcome.violations[..] else { panic!("{begin_s} {offset_s}: {outcome:?}") };
            assert_eq!((found.from_s, found.min_m), (begin_s + offset_s, 1.0));
            assert_eq!((outcome.segments, outcome.presence.iter().flatten().count()), (400, 2));
        }
    }
}

#[test]
fn a_gap_matters_where_somebody_is_there_within_it_and_not_at_its_edge() {
    // Alpha is not seen between 2 s and 5 s, and bravo until a time, or from one on.
    let with_bravo = |there: &dyn Fn(f64) -> bool| {
        let mut items = Vec::new();
        for k in 0..16 {
            let time_s = 0.5 * f64::from(k);
            if time_s <= 2.0 || time_s >= 5.0 {
                items.push(seen(0, time_s, [0.0; 3]));
            }
            if there(time_s) {
                items.push(seen(1, time_s, [9.0, 0.0, 0.0]));
            }
        }
        asked(&items, Settings::delta(2.0))
    };
    for (there, expected) in [
        (&(|t| t <= 2.0) as &dyn Fn(f64) -> bool, Status::Clear),
        (&|t| t >= 5.0, Status::Clear),
        (&|t| t <= 2.5, Status::Undecided),
        (&|t| t >= 4.5, Status::Undecided),
    ] {
        let outcome = with_bravo(there);
        assert_eq!(outcome.status, expected, "{:?}", outcome.gaps);
        assert_eq!(outcome.gaps.len(), usize::from(expected == Status::Undecided));
    }
}
