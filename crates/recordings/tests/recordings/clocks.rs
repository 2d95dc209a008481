//! Times are ordered, from one clock, exact, and in a known or noted unit.

use std::fs;

use tautline_recordings::read::{Duplicates, ReadError, ReadOptions, TimeUnit};

use crate::messages::read_bytes;
use crate::recording::{Whole, assert_refused};

fn read_with(text: &str, options: &ReadOptions) -> Result<Whole, ReadError> {
    read_bytes("flight.csv", text.as_bytes(), options)
}

fn read(text: &str) -> Result<Whole, ReadError> {
    read_with(text, &ReadOptions::default())
}

fn times(text: &str) -> Vec<f64> {
    let whole = read(text).unwrap_or_else(|error| panic!("{error}\n{}\n{text}", error.help()));
    whole.samples().iter().map(|sample| sample.0).collect()
}

#[track_caller]
fn refused(text: &str, options: &ReadOptions, code: &str, place: &str) {
    assert_refused(&read_with(text, options).expect_err(text), code, place);
}

#[test]
fn decreasing_time_of_a_vehicle_is_refused() {
    let plain = ReadOptions::default();
    let sorted = ReadOptions { sort: true, ..ReadOptions::default() };
    let back = "t,id,x,y,z\n0,a,0,0,0\n2,a,2,0,0\n1,b,9,9,9\n1,a,1,0,0\n";
    refused(back, &plain, "recording/time-backwards", "line 5");
    let found = read_with(back, &sorted).expect("sorted");
    let expected =
        [(0.0, "a", [0.0; 3]), (1.0, "b", [9.0; 3]), (1.0, "a", [1.0, 0.0, 0.0]), (2.0, "a", [2.0, 0.0, 0.0])];
    assert_eq!(found.samples(), expected);
    assert!(found.notes.iter().any(|note| note.contains("were sorted")), "{:?}", found.notes);
    // Vehicles in sequence are ordered individually.
    let by_vehicle = "t,id,x,y,z\n0,a,0,0,0\n1,a,1,0,0\n0,b,9,9,9\n1,b,9,9,9\n";
    assert_eq!(times(by_vehicle), [0.0, 0.0, 1.0, 1.0]);
    // One row per time.
    let wide = "t,x1,y1\n0,0,0\n2,2,0\n1,1,0\n";
    refused(wide, &plain, "recording/time-backwards", "line 4");
    assert_eq!(read_with(wide, &sorted).expect("sorted").samples()[1], (1.0, "1", [1.0, 0.0, 0.0]));
    let curves = read_bytes("cf1.csv", b"duration,x^0,y^0,z^0\n1,0,0,0\n", &sorted).expect_err("no rows");
    assert_refused(&curves, "recording/unused-option", "");
}

#[test]
fn duplicates_option_selects_a_row() {
    let long = "t,id,x,y,z\n0,a,1,0,0\n0,b,9,9,9\n0,a,2,0,0\n1,a,3,0,0\n1,b,9,9,9\n";
    let wide = "t,x1,y1\n0,1,0\n0,2,0\n1,3,0\n";
    let which = |duplicates| ReadOptions { duplicates, ..ReadOptions::default() };
    for text in [long, wide] {
        let place = if text == long { "line 4" } else { "line 3" };
        refused(text, &which(None), "recording/duplicate-row", place);
        refused(text, &which(Some(Duplicates::Refuse)), "recording/duplicate-row", place);
        for (duplicates, x) in [(Duplicates::First, 1.0), (Duplicates::Last, 2.0)] {
            let found = read_with(text, &which(Some(duplicates))).expect("read");
            assert_eq!(found.samples()[0].2[0], x, "{duplicates:?}");
            assert_eq!(found.items.len(), if text == long { 4 } else { 2 });
            assert!(found.notes.iter().any(|note| note.contains("rows omitted")), "{:?}", found.notes);
        }
    }
    // Equal rows are read once.
    let same = "t,id,x,y,z\n0,a,1,0,0\n0,a,1,0,0\n1,a,3,0,0\n";
    let found = read(same).expect("read");
    assert_eq!(found.items.len(), 2);
    assert!(found.notes.iter().any(|note| note.ends_with("has the same time: 1")), "{:?}", found.notes);
    refused(same, &which(Some(Duplicates::Refuse)), "recording/duplicate-row", "line 3");
}

#[test]
fn last_duplicate_is_found_across_batches() {
    let vehicles = 12_000;
    let rows = (0..2).flat_map(|round| (0..vehicles).map(move |k| format!("0,{k},{round},0,0\n")));
    let text = format!("t_s,id,x,y,z\n{}", rows.collect::<String>());
    let options = ReadOptions { duplicates: Some(Duplicates::Last), ..ReadOptions::default() };
    let found = read_with(&text, &options).expect("read");
    assert_eq!(found.items.len(), vehicles);
    assert!(found.samples().iter().all(|sample| sample.2[0] == 1.0));
}

#[test]
fn omitted_duplicates_of_joined_files_are_noted() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["a.csv", "b.csv"] {
        fs::write(folder.path().join(name), "t_s,x,y\n0,1,2\n0,1,2\n1,1,2\n").expect("written");
    }
    let found = Whole::read(folder.path(), &ReadOptions::default()).expect("read");
    assert!(found.notes.iter().any(|note| note.contains("rows omitted")), "{:?}", found.notes);
    assert_eq!(found.items.len(), 4);
}

#[test]
fn seconds_and_subseconds_form_one_time() {
    for (header, unit, per_second) in [
        ("t_sec,t_nsec", "ns", 1_000_000_000),
        ("time_s,time_ns", "ns", 1_000_000_000),
        ("timestamp,timestamp_ns", "ns", 1_000_000_000),
        ("time,usec", "us", 1_000_000),
        ("sec,nanosec", "ns", 1_000_000_000),
        ("secs,nsecs", "ns", 1_000_000_000_i64),
        ("header.stamp.sec,header.stamp.nanosec", "ns", 1_000_000_000),
    ] {
        let rows = [(1_700_000_000, 1), (1_700_000_000, per_second / 2), (1_700_000_001, 0)];
        let rows = rows.map(|(whole, rest)| format!("{whole},{rest},a,1,2,3\n")).concat();
        let found = read(&format!("{header},id,x,y,z\n{rows}")).unwrap_or_else(|error| panic!("{header}: {error}"));
        assert_eq!((found.clock.unit, found.clock.inferred), (unit, false), "{header}");
        let times: Vec<_> = found.samples().iter().map(|sample| sample.0).collect();
        assert_eq!(times, [1.0 / per_second as f64, 0.5, 1.0], "{header}");
        assert_eq!(found.clock.epoch_ns, 1_700_000_000_000_000_000);
        assert!(found.notes.iter().any(|note| note.starts_with("times are the sum of")), "{:?}", found.notes);
    }
    // Integral values in decimal notation, in a wide table.
    assert_eq!(times("x1,y1,sec,nanosec\n1,2,5.0,250000000.0\n1,2,6.0,0.0\n"), [5.25, 6.0]);
}

#[test]
fn unrelated_time_columns_are_refused() {
    let plain = ReadOptions::default();
    let (time_format, ambiguous) = ("recording/time-format", "recording/ambiguous-column");
    for (text, code, place) in [
        ("time_s,time_ns,id,x,y\n0,0,a,1,2\n1,1000000000,a,1,2\n", time_format, "line 3"),
        ("time_s,time_ns,id,x,y\n0.5,500000000,a,1,2\n", time_format, "line 2"),
        ("sec,nanosec,id,x,y\n1,-5,a,1,2\n", time_format, "line 2"),
        ("sec,nanosec,id,x,y\n1,0.5,a,1,2\n", time_format, "line 2"),
        ("t,stamp,id,x,y\n1,2,a,1,2\n", ambiguous, "line 1"),
        ("sec,nanosec,time,id,x,y\n1,2,3,a,1,2\n", ambiguous, "line 1"),
    ] {
        refused(text, &plain, code, place);
    }
    let unit = ReadOptions { time_unit: Some(TimeUnit::Seconds), ..ReadOptions::default() };
    refused("sec,nanosec,id,x,y\n1,2,a,1,2\n", &unit, "recording/contradicts-option", "line 1");
    let mut named = ReadOptions::default();
    assert!(named.columns.set("t", "stamp"));
    assert_eq!(read_with("t,stamp,id,x,y\n1,2,a,1,2\n", &named).expect("read").samples()[0].0, 2.0);
    // A part of a time alone is not a time, nor are other quantities in seconds.
    refused("sec,id,x,y\n1,a,1,2\n", &plain, "recording/no-time-column", "line 1");
    assert_eq!(times("t_s,flight_sec,latency_ms,id,x,y\n7,1,2,a,1,2\n"), [7.0]);
}

#[test]
fn dates_keep_all_digits() {
    let text = "time,id,x,y\n2023-11-14T22:13:20.000000001Z,a,1,2\n2023-11-14T23:13:20.5+01:00,a,1,2\n\
                2023-11-14 22:13:21Z,a,1,2\n";
    let found = read(text).expect("read");
    assert_eq!(found.samples().iter().map(|sample| sample.0).collect::<Vec<_>>(), [1e-9, 0.5, 1.0]);
    assert_eq!(
        (found.clock.unit, found.clock.inferred, found.clock.epoch_ns),
        ("ns", false, 1_700_000_000_000_000_000)
    );
    let local = read("datetime;x1;y1\n2023-11-14 22:13:20;1;2\n2023-11-14 22:13:20,25;1;2\n").expect("read");
    assert_eq!(local.samples()[1].0, 0.25);
    assert!(local.notes.iter().any(|note| note.contains("read as UTC")), "{:?}", local.notes);
    assert!(!found.notes.iter().any(|note| note.contains("read as UTC")));
    assert_eq!(times("time (utc),x,y\n2023-11-14T22:13:20Z,1,2\n"), [0.0]);
}

#[test]
fn other_values_among_dates_are_refused() {
    let plain = ReadOptions::default();
    let dates = |last: &str| format!("t,id,x,y\n2023-11-14T22:13:20Z,a,1,2\n{last},a,1,2\n");
    for (text, code, place) in [
        (dates("5").as_str(), "recording/time-format", "line 3"),
        (&dates("2023-11-14T22:13:21"), "recording/time-format", "line 3"),
        (&dates(""), "recording/empty-cell", "line 3"),
        ("t,id,x,y\n5,a,1,2\n2023-11-14T22:13:20Z,a,1,2\n", "recording/time-format", "line 3"),
        ("t,id,x,y\n12:00:01,a,1,2\n", "recording/time-format", "line 2"),
    ] {
        refused(text, &plain, code, place);
    }
    let unit = ReadOptions { time_unit: Some(TimeUnit::Seconds), ..ReadOptions::default() };
    refused(&dates("2023-11-14T22:13:21Z"), &unit, "recording/contradicts-option", "");
}

#[test]
fn integral_times_leave_the_unit_uncertain() {
    let unsure = |first: &str, second: &str| {
        read(&format!("t,id,x,y\n{first},a,1,2\n{second},a,1,2\n")).expect("read").clock.other_unit.is_some()
    };
    assert!(unsure("0", "1") && unsure("0.0", "10.0") && unsure("0", "10"));
    assert!(unsure("0", "16.667") && unsure("0.0", "10.5"), "milliseconds have decimals too");
    assert!(!unsure("0", "0.5") && !unsure("0.0", "1.5") && !unsure("1700000000", "1700000001"));
    assert_eq!(read("t_s,id,x,y\n0,a,1,2\n1,a,1,2\n").expect("read").clock.other_unit, None, "the name says it");
}

#[test]
fn time_column_of_one_vehicle_is_refused() {
    for header in ["t,x1,y1,t2,x2,y2", "t,a.x,a.y,a.timestamp,b.x,b.y", "t,a_x,a_y,time_b,b_x,b_y"] {
        let error = read(&format!("{header}\n0,1,2,3,4,5\n")).expect_err(header);
        assert_refused(&error, "recording/several-clocks", "line 1");
    }
}
