//! Evidence against a reading is refused, and every recording states its facts with their sources.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use tautline_core::fact::{Coded as _, Fact, FactValue};
use tautline_recordings::read::{self, MessageClock, ReadError, ReadOptions, TimeUnit};

use crate::messages::{Message, NO_TURN, SEC, cdr, mcap_of, read_bytes, whole};
use crate::recording::{Whole, assert_refused};

const POSE: &str = "geometry_msgs/msg/PoseStamped";
const TF: &str = "tf2_msgs/msg/TFMessage";

fn usual() -> ReadOptions {
    ReadOptions::default()
}

fn read(text: &str, options: &ReadOptions) -> Result<Whole, ReadError> {
    read_bytes("flight.csv", text.as_bytes(), options)
}

#[track_caller]
fn refused(text: &str, options: &ReadOptions, code: &str) -> ReadError {
    let error = read(text, options).expect_err("refused");
    assert_eq!(error.code(), code, "{error}");
    assert!(!error.help().is_empty() && !error.file.is_empty(), "{error}");
    error
}

/// Returns kind, source and value of each fact of a recording.
fn facts_of(path: &Path, options: &ReadOptions) -> Vec<[String; 3]> {
    let mut tracks = read::open(path, options).unwrap_or_else(|error| panic!("{error}"));
    let mut items = Vec::new();
    while tracks.read(&mut items).expect("read") {}
    let value = |fact: &Fact| match &fact.value {
        Some(FactValue::Number(number, unit)) => format!("{number} {unit}"),
        Some(name) => name.to_string(),
        None => String::new(),
    };
    let texts = |fact: &Fact| [fact.kind.code().to_owned(), fact.source.code().to_owned(), value(fact)];
    tracks.facts().iter().map(texts).collect()
}

fn facts(name: &str, bytes: &[u8], options: &ReadOptions) -> Vec<[String; 3]> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    fs::write(&path, bytes).expect("written");
    facts_of(&path, options)
}

#[track_caller]
fn has(facts: &[[String; 3]], fact: [&str; 3]) {
    assert!(facts.iter().any(|known| known.each_ref().map(String::as_str) == fact), "{fact:?} is not in {facts:?}");
}

/// Returns messages of a pose topic at 10 Hz for 3 s, along x. Log times are `delay_ns` after the stamps, which are
/// counted from `epoch_ns`; 0 is written in place of the stamps that `has_stamp` leaves out.
fn poses(topic: &'static str, y: f64, epoch_ns: i64, delay_ns: i64, has_stamp: fn(u32) -> bool) -> Vec<Message> {
    let message = |k: u32| {
        let stamp_ns = epoch_ns + i64::from(k) * 100_000_000;
        let log_ns = (stamp_ns + delay_ns).cast_unsigned();
        let stamp_ns = if has_stamp(k) { stamp_ns } else { 0 };
        let parts = (stamp_ns.div_euclid(1_000_000_000), stamp_ns.rem_euclid(1_000_000_000));
        let stamp = (i32::try_from(parts.0).expect("seconds"), u32::try_from(parts.1).expect("nanoseconds"));
        let place = [f64::from(k) / 10.0, y, 1.0];
        (topic, POSE, "cdr", log_ns, cdr(&((stamp, "world"), (place, NO_TURN)), true))
    };
    (0..30).map(message).collect()
}

fn in_log_order(topics: &[Vec<Message>]) -> Vec<Message> {
    let mut all = topics.concat();
    all.sort_by_key(|message| message.3);
    all
}

const UNIX: i64 = SEC as i64 * 1_000_000_000;
const MS: i64 = 1_000_000;

fn with_clock(clock: MessageClock) -> ReadOptions {
    ReadOptions { clock: Some(clock), ..usual() }
}

#[test]
fn topics_with_and_without_stamps_have_no_common_clock() {
    let stamped = poses("/a/pose", 0.0, UNIX, 5 * MS, |_| true);
    let unstamped = poses("/b/pose", 2.0, UNIX, 400 * MS, |_| false);
    let partly = poses("/b/pose", 2.0, UNIX, 5 * MS, |k| k % 7 != 3);
    for other in [unstamped, partly] {
        let bytes = mcap_of(&in_log_order(&[stamped.clone(), other]));
        let error = read_bytes("bag.mcap", &bytes, &usual()).expect_err("two clocks");
        assert_refused(&error, "recording/several-clocks", "");
        assert!(error.to_string().contains("/b/pose") && error.help().contains("clock=log, or"), "{error}");
        let found = read_bytes("bag.mcap", &bytes, &with_clock(MessageClock::Log)).expect("one clock");
        assert_eq!(found.assumed.as_deref(), Some("positions at their times of logging"));
        assert_eq!(found.samples().len(), 60);
        let first = found.samples()[0];
        assert!((first.0 - 0.005).abs() < 1e-9, "{first:?}");
        let facts = facts("bag.mcap", &bytes, &with_clock(MessageClock::Log));
        has(&facts, ["clock", "declared", "log times"]);
    }
}

#[test]
fn messages_without_stamps_take_their_log_times_in_the_headline() {
    let both = [poses("/a/pose", 0.0, UNIX, 0, |_| false), poses("/b/pose", 2.0, UNIX, 0, |_| false)];
    let bytes = mcap_of(&in_log_order(&both));
    let found = whole("bag.mcap", &bytes);
    assert_eq!(found.assumed.as_deref(), Some("positions at their times of logging"));
    has(&facts("bag.mcap", &bytes, &usual()), ["clock", "deduced", "log times, because no message has a stamp"]);
}

#[test]
fn stamps_of_several_clocks_are_refused() {
    let first = || poses("/a/pose", 0.0, UNIX, 5 * MS, |_| true);
    let boot = |epoch: i64| poses("/b/pose", 2.0, epoch, UNIX - epoch + 7 * MS, |_| true);
    for other in [
        // The clock of another computer is 0.4 s behind or ahead.
        poses("/b/pose", 2.0, UNIX - 400 * MS, 405 * MS, |_| true),
        poses("/b/pose", 2.0, UNIX + 400 * MS, -395 * MS, |_| true),
        boot(12_345 * MS),
        boot(0),
    ] {
        let bytes = mcap_of(&in_log_order(&[first(), other]));
        let error = read_bytes("bag.mcap", &bytes, &usual()).expect_err("two clocks");
        assert_refused(&error, "recording/several-clocks", "");
        assert!(read_bytes("bag.mcap", &bytes, &with_clock(MessageClock::Stamp)).is_ok());
        assert!(read_bytes("bag.mcap", &bytes, &with_clock(MessageClock::Log)).is_ok());
    }
    // Other latencies, a common simulated clock, and a clock that starts at 0 are one clock.
    let sim = |topic, y| poses(topic, y, 0, UNIX, |_| true);
    let slow = |topic, y| {
        // A simulation at half speed: the log time runs twice as fast.
        let mut messages = poses(topic, y, 0, 0, |_| true);
        for message in &mut messages {
            message.3 = UNIX.cast_unsigned() + 2 * message.3;
        }
        messages
    };
    for both in [
        [first(), poses("/b/pose", 2.0, UNIX, 80 * MS, |_| true)],
        [sim("/a/pose", 0.0), sim("/b/pose", 2.0)],
        [slow("/a/pose", 0.0), slow("/b/pose", 2.0)],
    ] {
        let bytes = mcap_of(&in_log_order(&both));
        let found = whole("bag.mcap", &bytes);
        assert_eq!((found.samples().len(), found.assumed), (60, None));
        has(&facts("bag.mcap", &bytes, &usual()), ["clock", "recorded", "stamps of messages"]);
    }
}

#[test]
fn vehicles_of_transforms_have_one_clock_too() {
    let transform = |k: u32, child: &'static str, y: f64, offset_s: i32| {
        let stamp = (SEC + offset_s, k * 100_000_000);
        let sent = ((stamp, "world"), child, ([f64::from(k), y, 0.0], NO_TURN));
        let log_ns = UNIX.cast_unsigned() + u64::from(k) * 100_000_000;
        ("/tf", TF, "cdr", log_ns, cdr(&(vec![sent],), true))
    };
    let all = |offset_s: i32| -> Vec<Message> {
        (0..10).flat_map(|k| [transform(k, "cf1", 0.0, 0), transform(k, "cf2", 2.0, offset_s)]).collect()
    };
    assert_eq!(whole("bag.mcap", &mcap_of(&all(0))).vehicles, ["cf1", "cf2"]);
    let error = read_bytes("bag.mcap", &mcap_of(&all(-3)), &usual()).expect_err("two clocks");
    assert_refused(&error, "recording/several-clocks", "");
}

/// Returns messages of a pose topic at each time \[ms\], with the delay from stamp to log time \[ms\].
fn dated(topic: &'static str, frame: &str, y: f64, delays_ms: &[(i64, i64)]) -> Vec<Message> {
    let message = |&(log_ms, delay_ms): &(i64, i64)| {
        let (log_ns, stamp_ns) = (UNIX + log_ms * MS, UNIX + (log_ms - delay_ms) * MS);
        let parts = (stamp_ns.div_euclid(1_000_000_000), stamp_ns.rem_euclid(1_000_000_000));
        let stamp = (i32::try_from(parts.0).expect("seconds"), u32::try_from(parts.1).expect("nanoseconds"));
        let place = [log_ms as f64 / 1e3, y, 1.0];
        (topic, POSE, "cdr", log_ns.cast_unsigned(), cdr(&((stamp, frame), (place, NO_TURN)), true))
    };
    delays_ms.iter().map(message).collect()
}

#[track_caller]
fn has_one_clock(topics: &[Vec<Message>], options: &ReadOptions, expected: bool) {
    let found = read_bytes("bag.mcap", &mcap_of(&in_log_order(topics)), options);
    match found {
        Ok(_) => assert!(expected, "read"),
        Err(error) if expected => panic!("{error}"),
        Err(error) => assert_refused(&error, "recording/several-clocks", ""),
    }
}

#[test]
fn clocks_are_compared_at_low_rates_and_in_every_part_of_a_recording() {
    let every = |step_ms: i64, from_ms: i64, to_ms: i64, delay_ms: fn(i64) -> i64| -> Vec<(i64, i64)> {
        let count = (to_ms - from_ms) / step_ms;
        (0..count).map(|k| from_ms + k * step_ms).map(|log_ms| (log_ms, delay_ms(log_ms))).collect()
    };
    let fast = every(100, 0, 10_000, |_| 10);
    let slow = every(1000, 0, 10_000, |_| 10);
    let burst = |stamp_ms: i64| ((stamp_ms / 2000 + 1) * 2000, (stamp_ms / 2000 + 1) * 2000 - stamp_ms);
    let bursts: Vec<_> = (0..100).map(|k| burst(100 * k)).collect();
    for (a, b, expected) in [
        // One message per second.
        (&slow, every(1000, 10, 10_010, |_| 3010), false),
        (&fast, every(1000, 10, 10_010, |_| 410), false),
        (&slow, every(1000, 10, 10_010, |_| 90), true),
        // A clock that drifts, and one that is set during the recording.
        (&fast, every(100, 0, 10_000, |log_ms| 10 + log_ms / 10), false),
        (&fast, every(100, 0, 10_000, |log_ms| if log_ms < 5000 { 10 } else { -990 }), false),
        // A recorder that writes the messages of one topic every 2 s.
        (&fast, bursts, true),
        // Vehicles that are never present together.
        (&fast, every(100, 10_000, 20_000, |_| 3010), false),
        (&fast, every(100, 10_000, 20_000, |_| 80), true),
    ] {
        has_one_clock(&[dated("/a/pose", "world", 0.0, a), dated("/b/pose", "world", 2.0, &b)], &usual(), expected);
    }
    // A simulation at a tenth of real time, in which one vehicle appears later, has one clock.
    let sim = |from_ms| every(100, from_ms, 10_000, |log_ms| log_ms - log_ms / 10);
    let sources = [dated("/a/pose", "world", 0.0, &sim(0)), dated("/b/pose", "world", 2.0, &sim(4000))];
    has_one_clock(&sources, &usual(), true);
}

#[test]
fn clocks_of_transforms_between_frames_are_compared_with_those_of_poses() {
    let transforms = |delay_ms: i64| -> Vec<Message> {
        let transform = |k: i64| {
            let stamp_ns = UNIX + (100 * k - delay_ms) * MS;
            let parts = (stamp_ns.div_euclid(1_000_000_000), stamp_ns.rem_euclid(1_000_000_000));
            let stamp = (i32::try_from(parts.0).expect("seconds"), u32::try_from(parts.1).expect("nanoseconds"));
            let sent = ((stamp, "map"), "a/odom", ([k as f64, 0.0, 0.0], NO_TURN));
            ("/tf", TF, "cdr", (UNIX + 100 * k * MS).cast_unsigned(), cdr(&(vec![sent],), true))
        };
        (0..100).map(transform).collect()
    };
    let options = ReadOptions { frame: Some("map".to_owned()), ..usual() };
    let times: Vec<_> = (30..70).map(|k| (100 * k, 10)).collect();
    // A publisher may date its transforms forward by 1 s.
    for (delay_ms, expected) in [(10, true), (-900, true), (2010, false), (410, false), (-2000, false)] {
        let poses = [dated("/a/pose", "a/odom", 0.0, &times), dated("/b/pose", "map", 2.0, &times)];
        let [a, b] = poses;
        has_one_clock(&[a, b, transforms(delay_ms)], &options, expected);
    }
}

#[test]
fn clock_option_needs_messages() {
    for (name, text) in
        [("flight.csv", "t,id,x,y\n0,a,1,2\n"), ("flight.json", "[{\"t\": 0, \"id\": 1, \"x\": 1, \"y\": 2}]")]
    {
        let error = read_bytes(name, text.as_bytes(), &with_clock(MessageClock::Log)).expect_err("no messages");
        assert_refused(&error, "recording/unused-option", "");
    }
}

/// Returns a table of `traffic`: two aircraft 400 m apart in height, in feet, with vertical rates in feet per minute.
fn aircraft(height: &str, rate: &str, size_m: f64, rate_size_m_s: f64) -> String {
    let mut text = format!("timestamp,icao24,callsign,latitude,longitude,{height},groundspeed,track,{rate}\n");
    for k in 0..120 {
        for (name, call, longitude, above_m) in [("3c6444", "DLH1", 8.0, 0.0), ("3c6445", "DLH2", 8.001, 400.0)] {
            let time_s = f64::from(k);
            let height_m = 3000.0 + above_m + 6.0 * time_s + 50.0 * (time_s / 10.0).sin();
            let rate_m_s = 6.0 + 5.0 * (time_s / 10.0).cos();
            let (height, rate, latitude) = (height_m / size_m, rate_m_s / rate_size_m_s, 47.0 + 1e-3 * time_s);
            let track = 10 * k % 360;
            let _ = writeln!(
                text,
                "{},{name},{call},{latitude},{longitude},{height},250,{track},{rate}",
                1_700_000_000 + k
            );
        }
    }
    text
}

const FOOT_M: f64 = 0.3048;
const FOOT_PER_MINUTE_M_S: f64 = 0.3048 / 60.0;

fn scaled(metres: f64) -> ReadOptions {
    ReadOptions { scale: Some(metres.into()), ..usual() }
}

fn height_difference(found: &Whole) -> f64 {
    let samples = found.samples();
    samples[1].2[2] - samples[0].2[2]
}

#[test]
fn unitless_heights_of_aircraft_are_refused() {
    let text = aircraft("altitude", "vertical_rate", FOOT_M, FOOT_PER_MINUTE_M_S);
    let error = refused(&text, &usual(), "recording/unknown-unit");
    assert!(error.help().contains("scale=0.3048 for feet") && error.to_string().contains("`icao24`"), "{error}");
    let found = read(&text, &scaled(FOOT_M)).expect("feet");
    assert_eq!(found.vehicles, ["3c6444", "3c6445"]);
    assert!((height_difference(&found) - 400.0).abs() < 1.0);
    let known = aircraft("altitude_ft", "vertical_rate", FOOT_M, FOOT_PER_MINUTE_M_S);
    assert!((height_difference(&read(&known, &usual()).expect("feet")) - 400.0).abs() < 1.0);
    let facts_of_name = facts("flight.csv", known.as_bytes(), &usual());
    has(&facts_of_name, ["height-unit", "deduced", "ft"]);
    has(&facts_of_name, ["identity", "deduced", "column `icao24`"]);
    has(&facts_of_name, ["time-unit", "inferred", "s"]);
    has(&facts("flight.csv", text.as_bytes(), &scaled(FOOT_M)), ["height-unit", "declared", "0.3048 m"]);
    // Any column of aircraft is evidence; other columns are none.
    for column in ["icao24", "callsign", "squawk", "groundspeed", "vertical_rate", "alt_baro", "track"] {
        let other = format!("t,id,lat,lon,altitude,{column}\n0,a,47,8,1000,7\n1,a,47,8,1000,7\n");
        let error = read(&other, &ReadOptions { columns: id_is_id(), ..usual() }).expect_err(column);
        assert!(["recording/unknown-unit", "recording/ambiguous-column"].contains(&error.code()), "{column}: {error}");
    }
    assert!(read("t,id,lat,lon,altitude,yaw\n0,a,47,8,1000,7\n1,a,47,8,1000,7\n", &usual()).is_ok());
}

fn id_is_id() -> read::ColumnNames {
    let mut columns = read::ColumnNames::default();
    assert!(columns.set("id", "id"));
    columns
}

#[test]
fn heights_that_contradict_their_rate_are_refused() {
    // Heights in feet, named as metres, beside rates in any unit.
    for rate in [1.0, FOOT_PER_MINUTE_M_S] {
        let text = aircraft("altitude_m", "vertical_rate", FOOT_M, rate);
        let error = refused(&text, &usual(), "recording/unit-conflict");
        assert!(error.to_string().contains("`vertical_rate`"), "{error}");
        let declared = read(&text, &scaled(1.0)).expect("the user decides");
        assert!(declared.notes.iter().any(|note| note.contains("the given unit of heights is used")));
    }
    for (rate, size_m_s) in
        [("vertical_rate", 1.0), ("vertical_rate", FOOT_M), ("vertical_rate [ft/min]", FOOT_PER_MINUTE_M_S)]
    {
        assert!(read(&aircraft("altitude_m", rate, 1.0, size_m_s), &usual()).is_ok(), "{rate} {size_m_s}");
    }
    refused(&aircraft("altitude_m", "vertical_rate [m/s]", 1.0, FOOT_M), &usual(), "recording/unit-conflict");
    refused(&aircraft("altitude_m", "vertical_rate", 1.0, -1.0), &usual(), "recording/unit-conflict");
    // A rate in a table of drones is compared as well.
    let mut drone = "t,x,y,z,climb\n".to_owned();
    for k in 0..100 {
        let time_s = f64::from(k) / 10.0;
        let _ = writeln!(drone, "{time_s},0,0,{},{}", time_s.sin() * 10.0, time_s.cos());
    }
    let one = ReadOptions { one_vehicle: true, ..usual() };
    refused(&drone, &one, "recording/unit-conflict");
}

#[test]
fn state_vectors_are_in_metres() {
    let mut text =
        "time,icao24,lat,lon,velocity,heading,vertrate,callsign,onground,squawk,baroaltitude,hour\n".to_owned();
    for k in 0..40 {
        let _ = writeln!(text, "{},3c6444,47,8.{k:04},200,90,5,DLH1,false,1000,{},1", 1_600_000_000 + k, 3000 + 5 * k);
    }
    let facts = facts("states.csv", text.as_bytes(), &usual());
    has(&facts, ["height-unit", "convention", "m"]);
    has(&facts, ["height-reference", "deduced", "pressure"]);
}

#[test]
fn aircraft_are_named_by_their_address() {
    for header in ["t,callsign,track,icao24,lat,lon,alt_baro [m]", "t,flight,track,hex,lat,lon,baro_alt_m"] {
        let text = format!("{header}\n0,A,10,3c1,47,8,1\n0,,20,3c2,47,9,2\n1,A,11,3c1,47,8,1\n1,B,21,3c2,47,9,2\n");
        assert_eq!(read(&text, &usual()).expect(header).vehicles, ["3c1", "3c2"]);
    }
    let tracks = "t,track,x,y\n0,7,0,0\n0,8,5,0\n1,7,0,0\n1,8,5,1\n";
    assert_eq!(read(tracks, &usual()).expect("tracks of a sensor").vehicles, ["7", "8"]);
}

/// Returns a table with metres and degrees; the metres of drone 2 are counted from `home`.
fn two_positions(home: [f64; 3], is_sorted_by_vehicle: bool) -> String {
    let mut rows = Vec::new();
    for k in 0..100_u32 {
        for drone in [1, 2] {
            let side = if drone == 1 { 1.0 } else { -1.0 };
            let true_m = [side * (f64::from(k) / 10.0 - 5.0), 0.0, 5.0];
            let from = if drone == 1 { [0.0; 3] } else { home };
            let [x, y, z] = [0, 1, 2].map(|axis| true_m[axis] - from[axis]);
            let (lat, lon) = (true_m[1] / 110_574.0, true_m[0] / 111_319.5);
            rows.push((
                if is_sorted_by_vehicle { drone } else { 0 },
                format!("{},{drone},{x},{y},{z},{lat},{lon},{}\n", f64::from(k) / 10.0, true_m[2]),
            ));
        }
    }
    rows.sort_by_key(|(order, _)| *order);
    "t,drone_id,x,y,z,lat,lon,alt\n".to_owned() + &rows.into_iter().map(|(_, row)| row).collect::<String>()
}

#[test]
fn positions_from_own_homes_are_refused_beside_degrees() {
    for is_sorted in [false, true] {
        for home in [[0.0, 10.0, 0.0], [0.0, -2.0, 0.0], [0.0, 0.0, 8.0], [0.0, 0.9, 0.0]] {
            let text = two_positions(home, is_sorted);
            let error = refused(&text, &usual(), "recording/several-frames");
            for remedy in ["column=x=x column=y=y column=z=z", "column=lat=lat column=lon=lon column=alt=alt"] {
                assert!(error.help().contains(remedy), "{}", error.help());
            }
            let metres_m = (100.0 + home.iter().map(|axis| axis * axis).sum::<f64>()).sqrt();
            // Latitude and longitude 0 of both drones at one time are no fix.
            for (chosen, true_m, count) in [
                (&[("x", "x"), ("y", "y"), ("z", "z")], metres_m, 200),
                (&[("lat", "lat"), ("lon", "lon"), ("alt", "alt")], 10.0, 198),
            ] {
                let mut options = usual();
                assert!(chosen.iter().all(|(role, name)| options.columns.set(role, name)));
                let found = read(&text, &options).unwrap_or_else(|error| panic!("{error}\n{}", error.help()));
                let samples = found.samples();
                assert_eq!(samples.len(), count);
                let first =
                    |name: &str| samples.iter().find(|sample| sample.0 == 0.0 && sample.1 == name).expect("a sample").2;
                let [one, two] = ["1", "2"].map(first);
                let apart_m = (0..3).map(|axis| (one[axis] - two[axis]).powi(2)).sum::<f64>().sqrt();
                assert!((apart_m - true_m).abs() < 1e-3, "{chosen:?}: {apart_m} m instead of {true_m} m");
            }
        }
        assert!(read(&two_positions([0.0; 3], is_sorted), &usual()).is_ok());
    }
    // Both positions of the only vehicle describe one motion.
    let one = |metres: f64| {
        let row = |k: u32| format!("{k},1,{},0,{},0\n", f64::from(k) * metres, f64::from(k) / 111_319.5);
        "t,id,x,y,lon,lat\n".to_owned() + &(0..100).map(row).collect::<String>()
    };
    assert!(read(&one(1.0), &usual()).is_ok());
    let error = refused(&one(3.28), &usual(), "recording/several-frames");
    assert!(error.place.is_some(), "{error}");
    // Columns that name directions cannot be chosen by roles.
    let directed = two_positions([0.0, 10.0, 0.0], false).replace(",x,y,z,", ",east,north,up,");
    let error = refused(&directed, &usual(), "recording/several-frames");
    assert!(error.help().contains("by removing the columns `lat`, `lon`, `alt`"), "{}", error.help());
    // Rows without degrees, or without a fix, are not compared.
    for unknown in [",,,", ",0,0,0"] {
        let without = |(k, line): (usize, &str)| {
            let metres: Vec<_> = line.split(',').take(5).collect();
            if k % 5 == 3 { metres.join(",") + unknown + "\n" } else { format!("{line}\n") }
        };
        let partly = |home| two_positions(home, false).lines().enumerate().map(without).collect::<String>();
        assert!(read(&partly([0.0; 3]), &usual()).is_ok(), "{unknown}");
        refused(&partly([0.0, 10.0, 0.0]), &usual(), "recording/several-frames");
    }
}

/// Replaces the last cell of each row, or removes it, and appends cells; `header` is the new header.
fn with_last(text: &str, header: &str, last: impl Fn(&[&str]) -> String) -> String {
    let rows = text.lines().skip(1).map(|line| {
        let cells: Vec<_> = line.split(',').collect();
        cells[..cells.len() - 1].join(",") + &last(&cells) + "\n"
    });
    format!("{header}\n") + &rows.collect::<String>()
}

#[test]
fn the_plane_is_compared_whatever_other_columns_hold() {
    let usual_header = "t,drone_id,x,y,z,lat,lon,alt";
    let of_drone = |cells: &[&str], first: &str, second: &str| if cells[1] == "1" { first } else { second }.to_owned();
    #[allow(clippy::type_complexity)]
    let variants: [(&str, &dyn Fn(&[&str]) -> String); 7] = [
        (usual_header, &|_| ",".to_owned()),
        (usual_header, &|_| ",nan".to_owned()),
        (usual_header, &|cells| of_drone(cells, ",", ",5")),
        ("t,drone_id,x,y,z,lat,lon", &|_| String::new()),
        ("t,drone_id,x,y,z,lat,lon,alt,east_speed,north_speed,up_speed", &|_| ",5,0,0,0".to_owned()),
        ("t,drone_id,x,y,z,lat,lon,alt,gps_lat,gps_lon", &|cells| format!(",5,{},{}", cells[5], cells[6])),
        ("t,drone_id,x,y,z,lat,lon,alt,rel_alt", &|_| ",5,5".to_owned()),
    ];
    for (header, last) in variants {
        let mut options = usual();
        if header.contains("speed") {
            for (role, name) in [("vx", "east_speed"), ("vy", "north_speed"), ("vz", "up_speed")] {
                assert!(options.columns.set(role, name));
            }
        }
        let text = |home| with_last(&two_positions(home, false), header, last);
        refused(&text([0.0, 10.0, 0.0]), &options, "recording/several-frames");
        read(&text([0.0; 3]), &options).unwrap_or_else(|error| panic!("{header}: {error}"));
    }
}

#[test]
fn degrees_off_the_earth_contradict_metres() {
    let row = |k: u32| format!("{k},{},{},0,{},80000000\n", k % 2, f64::from(k) / 2.0, 470_000_000 + k);
    let text = "t,id,x,y,lat,lon\n".to_owned() + &(0..20).map(row).collect::<String>();
    let error = refused(&text, &usual(), "recording/several-frames");
    assert!(error.to_string().contains("not a place on the Earth"), "{error}");
    let mut options = usual();
    assert!(["x", "y"].iter().all(|role| options.columns.set(role, role)));
    assert_eq!(read(&text, &options).expect("metres are chosen").items.len(), 20);
}

#[test]
fn the_tolerance_between_metres_and_degrees_is_stated() {
    // A barometer and a receiver may differ by some metres.
    let text = two_positions([0.0, 0.0, 3.0], false);
    let facts = facts("flight.csv", text.as_bytes(), &usual());
    let said = |fact: &&[String; 3]| fact[0] == "frame" && fact[1] == "observed";
    let stated = facts.iter().find(said).expect("a fact");
    assert!(stated[2].starts_with("metres agree with degrees within 0.50"), "{stated:?}");
    assert!(stated[2].ends_with("m in height"), "{stated:?}");
    let notes = read(&text, &usual()).expect("read").notes;
    assert!(notes.iter().any(|note| note.contains("metres agree with degrees within")), "{notes:?}");
    // The tolerance does not grow without bound with the noise.
    let noisy = |home: f64| {
        let row = |k: u32| {
            let (drone, wave) = (k % 2, if k % 4 < 2 { 4.0 } else { -4.0 });
            let (x, y) = (f64::from(k), 20.0 * f64::from(drone) + wave);
            let (lat, lon) = ((y - wave) / 110_574.0, x / 111_319.5);
            format!("{k},{drone},{x},{},{lat},{lon}\n", y - home * f64::from(drone))
        };
        "t,id,x,y,lat,lon\n".to_owned() + &(0..200).map(row).collect::<String>()
    };
    read(&noisy(0.0), &usual()).unwrap_or_else(|error| panic!("{error}"));
    refused(&noisy(6.0), &usual(), "recording/several-frames");
}

#[test]
fn columns_that_would_be_ignored_are_refused() {
    let text = two_positions([0.0; 3], false);
    for given in [&["lat"][..], &["lon"], &["lat", "lon", "x"], &["lat", "lon", "y"], &["x", "y", "lat", "lon"]] {
        let mut options = usual();
        assert!(given.iter().all(|role| options.columns.set(role, role)));
        let error = refused(&text, &options, "recording/contradicts-option");
        assert!(error.to_string().contains("would be ignored"), "{error}");
    }
    // One of both columns may be recognised by its name.
    let mut options = usual();
    assert!(options.columns.set("lat", "breite"));
    let one = "t,id,breite,lon,alt\n0,a,47,8,1\n1,a,47,8,1\n";
    assert_eq!(read(one, &options).expect("read").items.len(), 2);
}

#[test]
fn wide_tables_with_two_positions_are_compared() {
    let text = |home: f64| {
        let row = |k: u32| {
            let x = f64::from(k);
            format!("{k},{x},0,0,{},{x},{},1e-4,{}\n", x / 111_319.5, 11.0574 - home, x / 111_319.5)
        };
        "t,a.x,a.y,a.lat,a.lon,b.x,b.y,b.lat,b.lon\n".to_owned() + &(0..50).map(row).collect::<String>()
    };
    assert!(read(&text(0.0), &usual()).is_ok());
    let error = refused(&text(11.0), &usual(), "recording/several-frames");
    assert!(error.help().contains("by removing all columns in degrees, such as `a.lat`, `a.lon`"), "{}", error.help());
    assert!(!error.help().contains("column="), "{}", error.help());
    // A vehicle without degrees leaves the others compared.
    let partly = |home| {
        let rows = text(home);
        let (header, rows) = rows.split_once('\n').expect("lines");
        format!("z.x,z.y,{header}\n") + &rows.lines().flat_map(|row| ["0,90,", row, "\n"]).collect::<String>()
    };
    let notes = read(&partly(0.0), &usual()).expect("read").notes;
    assert!(notes.iter().any(|note| note.contains("not compared with degrees for `z`")), "{notes:?}");
    refused(&partly(11.0), &usual(), "recording/several-frames");
}

#[test]
fn joined_files_with_two_positions_need_a_choice() {
    let folder = tempfile::tempdir().expect("a folder");
    for name in ["a.csv", "b.csv"] {
        fs::write(folder.path().join(name), "t,x,y,z,lat,lon,alt\n0,1,2,3,47,8,3\n1,1,2,3,47,8,3\n").expect("written");
    }
    let error = Whole::read(folder.path(), &usual()).expect_err("two positions");
    assert_eq!(error.code(), "recording/several-frames", "{error}");
    let mut metres = usual();
    assert!(["x", "y", "z"].iter().all(|role| metres.columns.set(role, role)));
    metres.distinct = true;
    assert_eq!(Whole::read(folder.path(), &metres).expect("chosen").vehicles, ["a", "b"]);
}

#[test]
fn two_topics_of_one_robot_need_the_topic_option() {
    let pose = |topic, y| poses(topic, y, UNIX, 5 * MS, |_| true);
    for topics in [
        ["/a/pose", "/a/pose_raw"],
        ["/a/pose", "/a/camera"],
        ["/a/left", "/a/right"],
        ["/a/left/fix", "/a/right/fix"],
        ["/uav1/mavros/local_position/pose", "/uav1/ground_truth/pose"],
        ["/pose", "/pose_filtered"],
    ] {
        let bytes = mcap_of(&in_log_order(&topics.map(|topic| pose(topic, 0.0))));
        let error = read_bytes("bag.mcap", &bytes, &usual()).expect_err("one robot");
        assert_refused(&error, "recording/ambiguous-topics", "");
        assert!(error.help().contains("topic=NAME"), "{error}");
        let one = ReadOptions { topics: vec![topics[0].to_owned()], ..usual() };
        assert_eq!(read_bytes("bag.mcap", &bytes, &one).expect("one").vehicles, [topics[0]]);
    }
    for topics in
        [["/mocap/cf1", "/mocap/cf2"], ["/r1/pose", "/r2/pose"], ["/swarm/pose1", "/swarm/pose2"], ["/cf1", "/cf2"]]
    {
        let both = topics.iter().zip([0.0, 2.0]).map(|(topic, y)| pose(topic, y)).collect::<Vec<_>>();
        assert_eq!(whole("bag.mcap", &mcap_of(&in_log_order(&both))).vehicles, topics);
    }
}

#[test]
fn vehicles_with_equal_positions_throughout_are_one() {
    let row = |k: u32, name: &str, x: f64| format!("{k},{name},{x},1,2\n");
    let moving = |k: u32| f64::from(k) * 0.5;
    let table = |rows: &mut dyn Iterator<Item = String>| "t,id,x,y,z\n".to_owned() + &rows.collect::<String>();
    let twins = |last: f64| {
        table(&mut (0..20).flat_map(|k| {
            let other = if k == 19 { moving(k) + last } else { moving(k) };
            [row(k, "a", moving(k)), row(k, "b", moving(k) + 9.0), row(k, "c", other)]
        }))
    };
    let error = refused(&twins(0.0), &usual(), "recording/vehicle-twice");
    assert!(
        error.to_string().contains("`a` and `c`") && error.help().contains("two vehicles with distinct"),
        "{error}"
    );
    let distinct = ReadOptions { distinct: true, ..usual() };
    assert_eq!(read(&twins(0.0), &distinct).expect("declared").vehicles.len(), 3);
    has(
        &facts("flight.csv", twins(0.0).as_bytes(), &distinct),
        ["identity", "declared", "vehicles with equal positions are different"],
    );
    assert!(read(&twins(1e-12), &usual()).is_ok(), "different at one time");
    // Vehicles that meet, that meet and stay together, or that stand at one place are several.
    let meet = table(&mut (0..20).flat_map(|k| [row(k, "a", moving(k)), row(k, "b", moving(k).max(5.0))]));
    let stand = table(&mut (0..20).flat_map(|k| [row(k, "a", 1.0), row(k, "b", 1.0)]));
    let cross = table(&mut (0..20).flat_map(|k| [row(k, "a", moving(k)), row(k, "b", 5.0 - moving(k))]));
    let short = table(&mut (0..2).flat_map(|k| [row(k, "a", moving(k)), row(k, "b", moving(k))]));
    for text in [meet, stand, cross, short] {
        assert_eq!(read(&text, &usual()).unwrap_or_else(|error| panic!("{error}\n{text}")).vehicles.len(), 2);
    }
    // The second name may begin later and have fewer rows.
    let later = table(&mut (0..40).flat_map(|k| {
        let second = (k >= 10 && k % 3 == 1).then(|| row(k, "b", moving(k)));
        std::iter::once(row(k, "a", moving(k))).chain(second)
    }));
    refused(&later, &usual(), "recording/vehicle-twice");
    // Two of three names separate later.
    let three = table(&mut (0..20).flat_map(|k| {
        let side = if k > 10 { 3.0 } else { 0.0 };
        [row(k, "a", moving(k)), row(k, "b", moving(k) + side), row(k, "c", moving(k) + side)]
    }));
    let error = refused(&three, &usual(), "recording/vehicle-twice");
    assert!(error.to_string().contains("`b` and `c`"), "{error}");
}

/// Positions of a vehicle by instant; `None` where it is not seen.
type Positions = Vec<Option<u32>>;

/// Returns whether two vehicles have equal positions at all common times, and move.
fn are_twins(a: &Positions, b: &Positions) -> bool {
    let both: Vec<_> = a.iter().zip(b).filter_map(|(a, b)| Some(((*a)?, (*b)?))).collect();
    let moves = both.windows(2).filter(|two| two[0] != two[1]).count();
    both.len() > 2 && moves > 1 && both.iter().all(|(a, b)| a == b)
}

#[test]
fn twins_of_random_tables_are_those_of_a_comparison_of_all_pairs() {
    let mut state = 1_u64;
    let mut random = move |below: u32| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        u32::try_from(state >> 33).expect("31 bits") % below
    };
    let (mut refused, mut read_whole) = (0, 0);
    for case in 0..600 {
        let is_whole = case % 2 == 0;
        let (count, instants) = (2 + random(4), 3 + random(8));
        let mut vehicles: Vec<Positions> = Vec::new();
        for vehicle in 0..count {
            // Half of the vehicles copy an earlier one, and change it at some times.
            let copied = (vehicle > 0 && random(2) == 0).then(|| vehicles[random(vehicle) as usize].clone());
            let mut positions: Positions = (0..instants).map(|_| Some(random(3))).collect();
            if let Some(copied) = copied {
                let changed = random(3) == 0;
                let change = random(instants) as usize;
                let kept = |k: usize| if changed && k == change { None } else { copied[k] };
                positions = positions.iter().enumerate().map(|(k, own)| kept(k).or(*own)).collect();
            }
            if !is_whole {
                for place in &mut positions {
                    *place = place.filter(|_| random(4) > 0);
                }
            }
            vehicles.push(positions);
        }
        let mut text = "t,id,x,y,z\n".to_owned();
        for k in 0..instants {
            for (vehicle, positions) in vehicles.iter().enumerate() {
                if let Some(x) = positions[k as usize] {
                    let _ = writeln!(text, "{k}.5,v{vehicle},{x},0,0");
                }
            }
        }
        let pairs = (0..vehicles.len()).flat_map(|a| (0..a).map(move |b| (a, b)));
        let twins: Vec<_> = pairs.filter(|&(a, b)| are_twins(&vehicles[a], &vehicles[b])).collect();
        match read(&text, &ReadOptions { columns: id_is_id(), ..usual() }) {
            Ok(_) if is_whole => assert!(twins.is_empty(), "{text}"),
            Ok(_) => {}
            Err(error) if error.code() == "recording/vehicle-twice" => {
                refused += 1;
                let is_named = |&(a, b): &(usize, usize)| {
                    [[a, b], [b, a]].iter().any(|[a, b]| error.to_string().contains(&format!("`v{a}` and `v{b}`")))
                };
                assert!(twins.iter().any(is_named), "{error}\n{text}");
            }
            Err(error) => assert_eq!(error.code(), "recording/empty", "{error}\n{text}"),
        }
        read_whole += u32::from(twins.is_empty());
    }
    assert!(refused > 50 && read_whole > 50, "{refused} {read_whole}");
}

#[test]
fn arrays_of_objects_are_rows() {
    let array = concat!(
        "\u{feff} [ {\"t\": 0, \"id\": \"a}\\\"\", \"x\": 1, \"y\": 2, \"z\": 3},\n",
        "{\"t\":0,\"id\":\"b\",\"x\":5,\"y\":2,\"z\":3}\n,",
        "{\"t\": 1, \"id\": \"a}\\\"\", \"x\": 2, \"y\": 2, \"z\": 3} ]\n",
    );
    let found = whole("flight.json", array.as_bytes());
    assert_eq!(found.samples()[2], (1.0, "a}\"", [2.0, 2.0, 3.0]));
    for (text, code, place) in [
        ("[{\"t\": 0, \"id\": 1, \"x\": 1, \"y\": 2}", "recording/truncated", "element 2"),
        ("[{\"t\": 0, \"id\": 1, \"x\": 1, \"y\": 2", "recording/truncated", "element 1"),
        ("[{\"t\": 0, \"id\": 1, \"x\": 1, \"y\": 2}, 7]", "recording/malformed", "element 2"),
        ("[{\"t\": 0, \"id\": 1, \"x\": 1, \"y\": 2}] 7", "recording/malformed", "element 2"),
        ("[{\"t\": 0, \"id\": 1, \"x\": 1, \"y\": 2} {}]", "recording/malformed", "element 2"),
        ("[{\"t\": 0, \"id\": 1, \"x\": \"one\", \"y\": 2}]", "recording/not-a-number", "element 1"),
        ("[{\"t\": 0, \"id\": 1, \"x\": 1, \"y\": 2, \"x\": 3}]", "recording/malformed", "element 1"),
    ] {
        assert_refused(&read_bytes("flight.json", text.as_bytes(), &usual()).expect_err(text), code, place);
    }
    let error = read_bytes("flight.json", b"[1, 2]", &usual()).expect_err("numbers");
    assert_refused(&error, "recording/unsupported-format", "");
}

#[test]
fn trajnet_scenes_hold_no_positions() {
    let text = concat!(
        "{\"scene\": {\"id\": 0, \"p\": 1, \"s\": 10, \"e\": 30, \"fps\": 2.5, \"tag\": [4, []]}}\n",
        "{\"scene\": {\"id\": 1, \"p\": 2, \"s\": 10, \"e\": 30, \"fps\": 2.5, \"tag\": 1}}\n",
        "{\"track\": {\"f\": 10, \"p\": 1, \"x\": 1.5, \"y\": 2}}\n",
        "{\"track\": {\"f\": 10, \"p\": 2, \"x\": 4, \"y\": 2}}\n",
        "{\"track\": {\"f\": 20, \"p\": 1, \"x\": 2.5, \"y\": 2}}\n",
        "{\"track\": {\"f\": 20, \"p\": 2, \"x\": 4, \"y\": 3}}\n",
    );
    let error = read_bytes("biwi.ndjson", text.as_bytes(), &usual()).expect_err("frames");
    assert_eq!(error.code(), "recording/frames", "{error}");
    let rate = ReadOptions { times_per_second: Some(25.0), ..usual() };
    let found = read_bytes("biwi.ndjson", text.as_bytes(), &rate).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(found.samples()[2], (0.8, "1", [2.5, 2.0, 0.0]));
    has(&facts("biwi.ndjson", text.as_bytes(), &rate), ["time-unit", "declared", "0.04 s"]);
    // Scenes state positions per second; `--fps` is frames per second.
    assert!(error.help().contains("25 frames per second"), "{error} {}", error.help());
    let wrong = ReadOptions { times_per_second: Some(2.5), ..usual() };
    let error = read_bytes("biwi.ndjson", text.as_bytes(), &wrong).expect_err("another rate");
    assert_refused(&error, "recording/unit-conflict", "");
    let mixed = text.replacen("2.5, \"tag\": 1", "5, \"tag\": 1", 1);
    let error = read_bytes("biwi.ndjson", mixed.as_bytes(), &rate).expect_err("two rates");
    assert_refused(&error, "recording/frames", "");
    // Names and rates may be text, and other keys may come first.
    for other in [
        text.replace("\"p\": 1,", "\"p\": \"1\",").replace("\"p\": 2,", "\"p\": \"2\","),
        text.replace("\"fps\": 2.5", "\"fps\": \"2.5\""),
        text.replace("{\"track\"", "{\"dataset\": \"a\", \"track\""),
    ] {
        let error = read_bytes("biwi.ndjson", other.as_bytes(), &wrong).expect_err("another rate");
        assert_refused(&error, "recording/unit-conflict", "");
    }
    let zero = text.replace("\"fps\": 2.5", "\"fps\": 0");
    assert_refused(&read_bytes("biwi.ndjson", zero.as_bytes(), &rate).expect_err("no rate"), "recording/frames", "");
    // All pedestrians may miss each second position, so frames of 50 a second may be frames of 25.
    let sparse = text.replace("\"f\": 20", "\"f\": 30");
    assert!(read_bytes("biwi.ndjson", sparse.as_bytes(), &rate).is_ok());
    // Predictions are refused.
    let predicted = |number: &str| {
        format!("{text}{{\"track\": {{\"f\": 30, \"p\": 1, \"x\": 3.5, \"y\": 2, \"prediction_number\": {number}}}}}\n")
    };
    let error = read_bytes("biwi.ndjson", predicted("0").as_bytes(), &rate).expect_err("a prediction");
    assert_refused(&error, "recording/ambiguous-layout", "line 7");
    assert_eq!(read_bytes("biwi.ndjson", predicted("null").as_bytes(), &rate).expect("measured").samples().len(), 5);
}

#[test]
fn times_have_several_names() {
    for (name, time_s) in [("tstamp", 1.5), ("epoch", 1.5), ("time_boot_ms", 0.0015), ("epoch_ms", 0.0015)] {
        let found = read(&format!("{name},id,x,y\n0,a,1,2\n1.5,a,1,2\n"), &usual()).expect(name);
        assert_eq!(found.samples()[1].0, time_s, "{name}");
    }
    // Beside a time they are other quantities.
    let both = read("timestamp,time_boot_ms,id,x,y\n0,7,a,1,2\n1.5,8,a,1,2\n", &usual()).expect("one time");
    assert_eq!(both.samples()[1].0, 1.5);
    refused("tstamp,epoch,id,x,y\n0,7,a,1,2\n", &usual(), "recording/ambiguous-column");
    // Computers of several vehicles start at several times.
    let assumed_of = |rows: &str| read(&format!("time_boot_ms,sysid,x,y\n{rows}"), &usual()).expect("read").assumed;
    assert_eq!(assumed_of("0,1,1,2\n100,1,1,3\n"), None);
    let assumed = assumed_of("0,1,1,2\n0,2,5,2\n100,1,1,3\n100,2,5,3\n");
    assert_eq!(assumed.as_deref(), Some("the clocks of all vehicles started together"));
}

#[test]
fn rows_that_lack_a_coordinate_are_skipped_by_option() {
    let text = "t,id,x,y,alt\n0,a,1,2,3\n1,a,1,2,\n2,a,1,2,5\n";
    let error = read(text, &usual()).expect_err("an empty cell");
    assert_refused(&error, "recording/empty-cell", "line 3");
    assert!(error.help().contains("with skip_incomplete"), "{}", error.help());
    let skipping = ReadOptions { skip_incomplete: true, ..usual() };
    let found = read(text, &skipping).expect("skipped");
    assert_eq!(found.samples(), [(0.0, "a", [1.0, 2.0, 3.0]), (2.0, "a", [1.0, 2.0, 5.0])]);
    assert!(found.notes.iter().any(|note| note.ends_with("coordinates is empty: 1")), "{:?}", found.notes);
    has(&facts("flight.csv", text.as_bytes(), &skipping), ["rows", "declared", "1 incomplete"]);
    let error =
        read_bytes("run.mcap", &mcap_of(&poses("/a/pose", 0.0, UNIX, 0, |_| true)), &skipping).expect_err("messages");
    assert_refused(&error, "recording/unused-option", "");
}

#[test]
fn facts_of_all_rows_survive_a_mapping_of_the_axes_and_a_join() {
    let text = "t_s,x,y,alt\n0,1,2,3\n1,1,2,\n2,1,2,5\n";
    let options = |axes: Option<&str>| ReadOptions {
        skip_incomplete: true,
        one_vehicle: true,
        axes: axes.map(|axes| axes.parse().expect("axes")),
        ..usual()
    };
    for axes in [None, Some("nwu")] {
        has(&facts("a.csv", text.as_bytes(), &options(axes)), ["rows", "declared", "1 incomplete"]);
    }
    let folder = tempfile::tempdir().expect("a folder");
    for (name, rows) in [("a.csv", text), ("b.csv", "t_s,x,y,alt\n0,8,2,3\n1,8,2,3\n2,8,2,5\n")] {
        fs::write(folder.path().join(name), rows).expect("written");
    }
    has(&facts_of(folder.path(), &options(None)), ["rows", "declared", "1 incomplete"]);
    // Negative twin: complete rows have no such fact.
    let complete = facts("b.csv", b"t_s,x,y,alt\n0,8,2,3\n1,8,2,3\n", &options(Some("nwu")));
    assert!(complete.iter().all(|[kind, ..]| kind != "rows"), "{complete:?}");
}

#[test]
fn unit_of_time_names_its_source() {
    for (text, options, source, unit) in [
        ("t_ms,id,x,y\n0,a,1,2\n5,a,1,2\n", usual(), "deduced", "ms"),
        ("t,id,x,y\n0,a,1,2\n5,a,1,2\n", usual(), "inferred", "ms"),
        ("t,id,x,y\n0,a,1,2\n0.5,a,1,2\n", usual(), "inferred", "s"),
        (
            "t,id,x,y\n0,a,1,2\n5,a,1,2\n",
            ReadOptions { time_unit: Some(TimeUnit::Seconds), ..usual() },
            "declared",
            "s",
        ),
        (
            "t_ms,id,x,y\n0,a,1,2\n5,a,1,2\n",
            ReadOptions { time_unit: Some(TimeUnit::Milliseconds), ..usual() },
            "declared",
            "ms",
        ),
        ("t,id,x,y\n0,a,1,2\n5,a,1,2\n", ReadOptions { times_per_second: Some(5.0), ..usual() }, "declared", "0.2 s"),
        ("t,id,x,y\n2023-11-14T22:13:20Z,a,1,2\n", usual(), "deduced", "ns"),
    ] {
        let facts = facts("flight.csv", text.as_bytes(), &options);
        has(&facts, ["time-unit", source, unit]);
        for kind in ["clock", "identity", "length-unit", "frame"] {
            assert_eq!(facts.iter().filter(|[known, ..]| known == kind).count(), 1, "{kind} in {facts:?}");
        }
    }
    let bag = mcap_of(&poses("/a/pose", 0.0, UNIX, 0, |_| true));
    has(&facts("bag.mcap", &bag, &usual()), ["time-unit", "convention", "ns"]);
    for other in [
        ReadOptions { time_unit: Some(TimeUnit::Seconds), ..usual() },
        ReadOptions { times_per_second: Some(10.0), ..usual() },
    ] {
        refused("t_ms,id,x,y\n0,a,1,2\n5,a,1,2\n", &other, "recording/unit-conflict");
    }
}
