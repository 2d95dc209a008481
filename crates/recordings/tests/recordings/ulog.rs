//! PX4 logs: one vehicle per file, with a common origin and clock.

use std::fs;

use tautline_recordings::read::{ReadError, ReadOptions};

use crate::messages::read_bytes;
use crate::recording::{Whole, assert_refused};

const GLOBAL: &str = "vehicle_global_position:uint64_t timestamp;uint64_t timestamp_sample;double lat;double lon;\
                      float alt;float[2] spare;uint8_t[4] _padding0;";
const LOCAL: &str = "vehicle_local_position:uint64_t timestamp;float x;float y;float z;bool xy_valid;bool z_valid;\
                     uint8_t[2] _padding0;double ref_lat;double ref_lon;float ref_alt;";
const GPS: &str = "sensor_gps:uint64_t timestamp;uint64_t time_utc_usec;";

/// Log, built message by message.
pub(crate) struct Log(Vec<u8>);

impl Log {
    pub(crate) fn new() -> Self {
        let mut log = Self(b"ULog\x01\x12\x35\x01\0\0\0\0\0\0\0\0".to_vec());
        log.message(b'B', &[0; 40]);
        for format in [GLOBAL, LOCAL, GPS] {
            log.message(b'F', format.as_bytes());
        }
        log.message(b'I', b"\x0achar[5] sysPX4");
        for (id, name) in [(0_u16, &b"vehicle_global_position"[..]), (1, b"vehicle_local_position"), (2, b"sensor_gps")]
        {
            log.message(b'A', &[&[0][..], &id.to_le_bytes(), name].concat());
        }
        log
    }

    fn message(&mut self, kind: u8, body: &[u8]) {
        let size = u16::try_from(body.len()).expect("short").to_le_bytes();
        self.0.extend([&size[..], &[kind], body].concat());
    }

    pub(crate) fn global(mut self, time_us: u64, lat: f64, lon: f64, alt: f32) -> Self {
        let times = [time_us.to_le_bytes(), time_us.to_le_bytes(), lat.to_le_bytes(), lon.to_le_bytes()].concat();
        self.message(b'D', &[&0_u16.to_le_bytes()[..], &times, &alt.to_le_bytes(), &[0; 8]].concat());
        self
    }

    pub(crate) fn local(mut self, time_us: u64, at: [f32; 3], valid: u8, reference: [f64; 2]) -> Self {
        let at = at.map(f32::to_le_bytes).concat();
        let of = reference.map(f64::to_le_bytes).concat();
        let alt = 400_f32.to_le_bytes();
        let body = [&1_u16.to_le_bytes()[..], &time_us.to_le_bytes(), &at, &[valid, 1, 0, 0], &of, &alt].concat();
        self.message(b'D', &body);
        self
    }

    pub(crate) fn gps(mut self, time_us: u64, utc_us: u64) -> Self {
        self.message(b'D', &[&2_u16.to_le_bytes()[..], &time_us.to_le_bytes(), &utc_us.to_le_bytes()].concat());
        self
    }

    pub(crate) fn bytes(self) -> Vec<u8> {
        self.0
    }
}

fn read(bytes: &[u8]) -> Result<Whole, ReadError> {
    read_bytes("cf1.ulg", bytes, &ReadOptions::default())
}

#[test]
fn global_positions_are_read() {
    let log = Log::new().global(1_000_000, 47.0, 8.0, 400.0).global(1_100_000, 47.0, 8.0, 402.5).bytes();
    let found = read(&log).expect("read");
    assert_eq!(found.vehicles, ["cf1"]);
    assert_eq!((found.samples()[0].0, found.samples()[1].0), (1.0, 1.1));
    assert!((found.samples()[1].2[2] - 2.5).abs() < 1e-8, "{:?}", found.samples());
    assert!(found.notes.iter().any(|note| note.contains("vehicle_global_position")), "{:?}", found.notes);
}

#[test]
fn local_positions_are_north_east_down_of_their_reference() {
    let here = [47.0, 8.0];
    let log = Log::new().local(1_000_000, [1.0, 2.0, -3.0], 1, here).local(1_020_000, [9.0; 3], 0, here);
    let log = log.local(1_040_000, [9.0; 3], 1, [0.0; 2]).local(1_060_000, [9.0; 3], 1, [f64::NAN; 2]).bytes();
    assert_eq!(read(&log).expect("read").samples(), [(1.0, "cf1", [2.0, 1.0, 3.0])], "the others are not known");
    let both = Log::new().local(1_000_000, [1.0, 2.0, -3.0], 1, here).global(1_000_000, 47.0, 8.0, 400.0).bytes();
    assert_eq!(read(&both).expect("read").samples(), [(1.0, "cf1", [0.0; 3])], "the global one goes before");
    let options = ReadOptions { topics: vec!["vehicle_local_position".to_owned()], ..ReadOptions::default() };
    assert_eq!(read_bytes("cf1.ulg", &both, &options).expect("read").samples()[0].2, [2.0, 1.0, 3.0]);
    let nowhere = Log::new().local(1_000_000, [1.0, 2.0, -3.0], 1, [f64::NAN; 2]).bytes();
    let error = read(&nowhere).expect_err("nowhere");
    assert_refused(&error, "recording/no-fix", "");
}

#[test]
fn joined_logs_share_origin_and_clock() {
    let folder = tempfile::tempdir().expect("a folder");
    let utc = 1_700_000_000_000_000;
    // The computers start 5 s apart; the shortest delay of a GPS message is 0.1 s.
    let a =
        Log::new().gps(1_300_000, utc + 1_000_000).gps(2_100_000, utc + 2_000_000).global(3_100_000, 47.0, 8.0, 400.0);
    let b = Log::new().gps(7_100_000, utc + 2_000_000).global(8_100_000, 47.0, 8.0, 401.0);
    for (name, log) in [("a.ulg", a), ("b.ulg", b)] {
        fs::write(folder.path().join(name), log.bytes()).expect("written");
    }
    let asked = Whole::read(folder.path(), &ReadOptions::default()).expect_err("no origin");
    assert_refused(&asked, "recording/no-origin", "");
    assert!(asked.help().contains("origin=47.0,8.0,400.0"), "{}", asked.help());
    let options = ReadOptions { origin: Some([47.0, 8.0, 400.0]), ..ReadOptions::default() };
    let found = Whole::read(folder.path(), &options).expect("read");
    let times: Vec<_> = found.samples().iter().map(|sample| sample.0).collect();
    assert_eq!(times[0], times[1], "{:?}", found.samples());
    assert_eq!(found.assumed.as_deref(), Some("clocks set by the GPS of each vehicle"));
}

#[test]
fn invalid_logs_are_refused() {
    let whole = Log::new().global(1_000_000, 47.0, 8.0, 400.0).global(1_100_000, 47.0, 8.0, 402.5).bytes();
    let broken = read(&whole[..whole.len() - 5]).expect_err("broken off");
    assert_refused(&broken, "recording/unfinished", "");
    let accept = ReadOptions { allow_unfinished: true, ..ReadOptions::default() };
    let found = read_bytes("cf1.ulg", &whole[..whole.len() - 5], &accept).expect("what it holds");
    assert_eq!(found.items.len(), 1, "a message that breaks off is no position");
    let mut newer = whole.clone();
    newer[16 + 3 + 8] = 2;
    assert_refused(&read(&newer).expect_err("newer"), "recording/unsupported-format", "byte 16");
    let mut odd = whole;
    odd.extend([0, 0, 7]);
    assert_refused(&read(&odd).expect_err("odd"), "recording/damaged", "byte 605");
    let topic = ReadOptions { topics: vec!["vehicle_attitude".to_owned()], ..ReadOptions::default() };
    let log = Log::new().bytes();
    assert_refused(&read_bytes("cf1.ulg", &log, &topic).expect_err("no position"), "recording/unknown-topic", "");
    assert!(read(&log).is_err(), "no position at all");
}

#[test]
fn formats_of_formats_are_measured_once() {
    // Seven levels of formats with 200 fields each: 200^7 fields in all.
    let mut log = Log::new();
    for level in 0..7 {
        let kind = if level == 6 { "uint8_t".to_owned() } else { format!("f{}", level + 1) };
        let fields = (0..200).map(|field| format!("{kind} a{field};")).collect::<Vec<_>>().concat();
        log.message(b'F', format!("f{level}:{fields}").as_bytes());
    }
    log.message(b'F', b"vehicle_global_position:uint64_t timestamp;f0 deep;double lat;double lon;float alt;");
    log.message(b'A', &[&[0][..], &0_u16.to_le_bytes(), b"vehicle_global_position"].concat());
    let found = read(&log.global(1_000_000, 47.0, 8.0, 400.0).bytes());
    assert!(found.is_err(), "{found:?}");
}
