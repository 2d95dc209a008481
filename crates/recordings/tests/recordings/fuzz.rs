//! Readers end with motion or an error for arbitrary bytes, without a panic and with little memory.
//!
//! The number of cases is small by default; `TAUTLINE_FUZZ_CASES` sets the number of each kind. `TAUTLINE_FUZZ_CORPUS`
//! is a folder for the seeds, as the first inputs of the targets in `fuzz/`.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{Cursor, Write as _};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::{Duration, Instant};

use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use tautline_recordings::export::{self, ExportOptions};
use tautline_recordings::read::{self, Format, ReadOptions};

use crate::contract::read_whole;
use crate::messages::{cdr, mcap_with};
use crate::recording::Whole;
use crate::ulog::Log;

/// Default number of cases of each kind.
const CASES: u32 = 60;

/// Time limit for a file of a few kilobytes, on a slow and busy machine.
const PATIENCE: Duration = Duration::from_secs(20);

fn cases() -> u32 {
    std::env::var("TAUTLINE_FUZZ_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(CASES)
}

const CSV: &str =
    "t,id,x,y,z,vx,vy,vz,radius\n0,1,1,2,3,0,0,0,0.1\n0,\"2\",-1.5,0.25,1e-3,,,,\n0.5,1,1.5,2,3,1,1,1,0.1\n";
const WIDE: &str = "t,x1,y1,z1,x2,y2,z2\n0,1,2,3,-1.5,.25,1e-3\n.5,1.5,2,3,,,\n";
const TEXT: &str = "# t x1 y1 z1 x2 y2 z2\n0 1 2 3 -1.5 .25 1e-3\n.5   1.5\t2 3 -1 .25 2e-3\n";
const TUPLES: &str = "0 (1,2) (-1.5,.25)\n.5 (1.5, 2) (-1,.25)\n";
const TRAJNET: &str = "0 1 1.5 2\n0 2 3 4\n10 1 1.5 2.5\n10 2 3 4.5\n";
const ONE: &str = "t,x,y,z\n0,1,2,3\n.5,1,2,4\n";
const POLYNOMIAL: &str = "duration,x^0,x^1,y^0,y^1,z^0,z^1,\n1,0,1,0,0,1,0,\n0.5,1,1,0,0,1,0,\n";
const BEZIER: &str = "#duration,p0x,p0y,p0z,...\n1,0,0,1,1,2,1,\n0.5,1,2,1,1,2,1\n";
const SHOW: &str = r#"{"version": 1, "swarm": {"drones": [{"settings": {"name": "A", "trajectory": {"version": 1,
    "takeoffTime": 2, "points": [[0, [1, 2, 0], []], [4, [1, 2, 8], [[0, 0, 0]]]]}}},
    {"settings": {"trajectory": {"$ref": "./a.json#"}}}]}}"#;
const MOTIVE: &str = concat!(
    "Format Version,1.23,Length Units,Meters,Coordinate Space,Global\n",
    "\n",
    ",Type,Rigid Body,Rigid Body,Rigid Body,Marker,Marker,Marker\n",
    ",Name,a,a,a,a:1,a:1,a:1\n",
    ",ID,A,A,A,B,B,B\n",
    ",,Position,Position,Position,Position,Position,Position\n",
    "Frame,Time (Seconds),X,Y,Z,X,Y,Z\n",
    "0,0.00,1,2,3,1,2,3\n",
    "1,0.01,,,,1,2,3\n",
    "2,0.02,1,2,4,,,\n",
);
const VICON: &str = concat!(
    "Trajectories\n",
    "100\n",
    ",,a:1,,,a:2,,,b,,\n",
    "Frame,Sub Frame,X,Y,Z,X,Y,Z,X,Y,Z\n",
    ",,mm,mm,mm,mm,mm,mm,mm,mm,mm\n",
    "1,0,1,2,3,4,5,6,7,8,9\n",
    "2,0,1,2,3,,,,7,8,9\n",
    "\n",
    "Devices\n",
    "1000\n",
);
const EARTH: &str =
    "t,id,lat,lon,alt,radius\n0,a,47.3,8.5,400,0.1\n0,b,47.300001,-179.9,401,\n1,a,47.301,8.5,400,0.1\n";
const JSONL: &str =
    "{\"t\": 0, \"id\": \"a\", \"pos\": [1, 2, 3]}\n{\"t\": 1.5, \"id\": 7, \"pos\": [1, 2, 3.5], \"q\": null}\n";
const ARRAY: &str =
    "[{\"t\": 0, \"id\": \"a}\", \"x\": 1, \"y\": 2},\n {\"t\": 1, \"id\": \"b\", \"x\": 1, \"y\": 2}]\n";
const SCENES: &str = concat!(
    "{\"scene\": {\"id\": 0, \"p\": 1, \"s\": 1, \"e\": 3, \"fps\": 2.5}}\n",
    "{\"track\": {\"f\": 1, \"p\": 1, \"x\": 1, \"y\": 2}}\n",
    "{\"track\": {\"f\": 3, \"p\": 1, \"x\": 1, \"y\": 3}}\n",
);
const COMPARED: &str = concat!(
    "t,id,x,y,z,lat,lon,alt,climb\n",
    "0,a,1,2,3,47,8,403,1\n0,b,1,3,3,47.000009,8,403,\n1,a,1,2,4,47,8,404,1\n1,b,1,3,3,,8,403,0\n",
);
const PX4: &str = "timestamp,x,y,z,ref_lat,ref_lon,ref_alt,xy_valid\n0,1,2,-3,47,8,400,1\n20000,1,2,-3,nan,8,400,1\n";
const SPLIT: &str = "sec,nanosec,id,north,east,down\ns,ns,-,m,m,m\n1,5,a,1,2,3\n1,999999999,a,1,2,4\n";
const DATES: &str = "time,id,x,y\n2023-11-14T22:13:20.5Z,a,1,2\n2023-11-14 23:13:21+01:00,a,1,2\n";
const METADATA: &str = "rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: mcap\n\
    \x20 compression_format: ''\n  compression_mode: ''\n  relative_file_paths:\n\
    \x20 - bag_0.mcap\n  - bag_1.mcap.zstd\n  message_count: 3\n";

/// Valid files of every format.
fn seeds() -> Vec<(&'static str, Vec<u8>)> {
    let folder = tempfile::tempdir().expect("a folder");
    let source = folder.path().join("source.csv");
    fs::write(&source, CSV).expect("written");
    let exported = |format: export::Format| {
        let path = folder.path().join(format.name);
        let mut file = File::create(&path).expect("a file");
        let open = || read::open(&source, &ReadOptions::default());
        export::export(&open, format, &ExportOptions::default(), &mut file).expect("exported");
        fs::read(&path).expect("read")
    };
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    gzip.write_all(CSV.as_bytes()).expect("written");
    let zipped = |files: &[(&str, &str)]| {
        let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
        for (name, bytes) in files {
            zip.start_file(*name, zip::write::SimpleFileOptions::default()).expect("an entry");
            zip.write_all(bytes.as_bytes()).expect("written");
        }
        zip.finish().expect("finished").into_inner()
    };
    let log = Log::new().gps(1, 1_700_000_000_000_000).global(1_000_000, 47.0, 8.0, 400.0);
    let log = log.local(1_000_000, [1.0, 2.0, -3.0], 1, [47.0, 8.0]);
    vec![
        ("long", CSV.into()),
        ("wide", WIDE.into()),
        ("text", TEXT.into()),
        ("tuples", TUPLES.into()),
        ("polynomial", POLYNOMIAL.into()),
        ("bezier", BEZIER.into()),
        ("trajnet", TRAJNET.into()),
        ("planned", planned()),
        ("show", SHOW.into()),
        ("gzip", gzip.finish().expect("finished")),
        ("skyc", zipped(&[("show.json", SHOW), ("a.json", r#"{"points": [[0, [1, 2, 3]], [1, [1, 2, 4]]]}"#)])),
        ("tables", zipped(&[("f/a.csv", ONE), ("f/b.txt", "0 1 2 3\n.5 1 2 4\n"), ("f/readme.txt", "1 2 3\n")])),
        ("pieces", zipped(&[("a/1.csv", POLYNOMIAL), ("a/2.csv", POLYNOMIAL), ("b/1.csv", POLYNOMIAL)])),
        ("parquet", exported(export::Format::PARQUET)),
        ("npz", exported(export::Format::NPZ)),
        ("mcap", exported(export::Format::MCAP)),
        ("jsonl", JSONL.into()),
        ("array", ARRAY.into()),
        ("scenes", SCENES.into()),
        ("compared", COMPARED.into()),
        ("px4", PX4.into()),
        ("split", SPLIT.into()),
        ("dates", DATES.into()),
        ("ulog", log.bytes()),
        ("skyb", b"skyb\x01\x01\x10\x00\x02\0\0\0\0\0\0\0\0\x11\x60\xea\x88\x13\xa8\x61".into()),
        ("traj", b"\0\0\0\0\xe8\x03\0\0\x01\xf4\x01\x88\x13\0\0\0".into()),
        ("motive", MOTIVE.into()),
        ("vicon", VICON.into()),
        ("earth", EARTH.into()),
        ("frames", frames()),
        ("foreign", foreign(None)),
        ("zstd", foreign(Some("zstd"))),
    ]
}

/// Returns the options that a seed requires. MCAP seeds are also read unclosed; other formats refuse that option.
fn options_of(seed: &str) -> ReadOptions {
    let is_mcap = ["mcap", "planned", "foreign", "zstd", "frames", "metadata.yaml", "bag_0.mcap", "bag_1.mcap.zstd"]
        .contains(&seed);
    let frame = (seed == "frames").then(|| "map".to_owned());
    let times_per_second = match seed {
        "trajnet" => Some(30.0),
        "scenes" => Some(5.0),
        _ => None,
    };
    ReadOptions { frame, times_per_second, allow_unfinished: is_mcap, ..ReadOptions::default() }
}

/// Returns a curve of each planner.
fn planned() -> Vec<u8> {
    let knots = [0.0, 0.0, 1.0, 2.0, 2.0];
    let spline = (1, 1, 5_i64, (1, 5), knots.to_vec(), vec![[0.0, 1.0, 2.0], [1.0; 3], [2.0; 3]], vec![0.0], 0.1);
    let ends = [[1.0_f32, 2.0, 3.0]; 6];
    let minco = (2_i16, 5, (1, 5), 0.5_f32, 5_u8, ends, [vec![2.0_f32], vec![2.0], vec![2.0]], vec![1.0_f32, 0.5]);
    let six = |x: f32| (0..6_u8).map(|k| x - f32::from(k)).collect::<Vec<_>>();
    let polynomials = (3_i16, 5, (1, 5), 5_u8, six(1.0), six(2.0), six(3.0), vec![1.5_f32]);
    let messages = [
        ("/planning/polynomials", "traj_utils/msg/PolyTraj", "cdr", 1, cdr(&polynomials, true)),
        ("/planning/bspline", "traj_utils/msg/Bspline", "cdr", 1, cdr(&spline, true)),
        ("/planning/trajectory", "traj_utils/msg/MINCOTraj", "cdr", 1, cdr(&minco, false)),
    ];
    mcap_with(mcap::WriteOptions::new().compression(None).use_chunks(false), &messages)
}

/// Returns poses in frames connected by transforms, one message each.
fn frames() -> Vec<u8> {
    const TURN: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
    const TF: &str = "tf2_msgs/msg/TFMessage";
    let transform = |nanosec: u32, parent, child| {
        cdr(&(vec![(((1, nanosec), parent), child, ([1.0, 2.0, 3.0], TURN))],), nanosec.is_multiple_of(2))
    };
    let named = (((1, 5), "map"), vec![("cf1", ([1.0, 2.0, 3.0], TURN)), ("cf2", ([1.0, 2.0, 3.0], TURN))]);
    let odometry = (((1, 5), "odom"), "base_link", ([1.0, 2.0, 3.0], TURN));
    let fix = (((1, 5), "gps"), (0_i8, 1_u16), [47.0, 8.0, 400.0]);
    let options = mcap::WriteOptions::new().compression(None).use_chunks(false);
    let messages: Vec<_> = [
        ("/tf_static", TF, transform(0, "base_link", "camera")),
        ("/tf", TF, transform(1, "map", "odom")),
        ("/tf", TF, transform(4, "odom", "base_link")),
        ("/odom", "nav_msgs/msg/Odometry", cdr(&odometry, true)),
        ("/swarm/poses", "motion_capture_tracking_interfaces/msg/NamedPoseArray", cdr(&named, false)),
        ("/car/gps/fix", "sensor_msgs/msg/NavSatFix", cdr(&fix, true)),
        ("/tf", TF, transform(9, "map", "odom")),
    ]
    .map(|(topic, schema, content)| (topic, schema, "cdr", 1, content))
    .into();
    mcap_with(options, &messages)
}

/// Returns a foreign recording with JSON and CDR messages, with chunks packed or not.
fn foreign(compression: Option<&str>) -> Vec<u8> {
    let options = mcap::WriteOptions::new().compression(None).use_chunks(false);
    let mut out = options.create(Cursor::new(Vec::new())).expect("a writer");
    let pose =
        r#"{"timestamp": {"sec": 1, "nsec": 2}, "frame_id": "m", "poses": [{"position": {"x": 1, "y": 2, "z": 3}}]}"#;
    let mut cdr = vec![0, 1, 0, 0];
    let array = (((1, 2), "m"), vec![([1.0, 2.0, 3.0], [0.0, 0.0, 0.0, 1.0])]);
    cdr_encoding::to_writer::<_, byteorder::LittleEndian, _>(&mut cdr, &array).expect("encoded");
    let protobuf = b"\x0a\x02\x08\x01\x12\x01m\x1a\x0b\x0a\x09\x09\0\0\0\0\0\0\xf0\x3f".to_vec();
    for (topic, schema, encoding, content) in [
        ("/json", "foxglove.PosesInFrame", "json", pose.as_bytes().to_vec()),
        ("/cdr", "geometry_msgs/msg/PoseArray", "cdr", cdr),
        ("/protobuf", "foxglove.PosesInFrame", "protobuf", protobuf),
    ] {
        let schema = out.add_schema(schema, encoding, b"").expect("a schema");
        let channel_id = out.add_channel(schema, topic, encoding, &BTreeMap::new()).expect("a channel");
        let header = mcap::records::MessageHeader { channel_id, sequence: 0, log_time: 1, publish_time: 1 };
        out.write_to_known_channel(&header, &content).expect("a message");
    }
    out.finish().expect("finished");
    let plain = out.into_inner().into_inner();
    compression.map_or_else(|| plain.clone(), |name| packed(&plain, name))
}

/// Moves the records of the data section into one compressed chunk.
fn packed(plain: &[u8], compression: &str) -> Vec<u8> {
    let (mut at, mut header, mut records) = (mcap::MAGIC.len(), Vec::new(), Vec::new());
    while plain[at] != mcap::records::op::DATA_END {
        let length = u64::from_le_bytes(plain[at + 1..at + 9].try_into().expect("8 bytes"));
        let end = at + 9 + usize::try_from(length).expect("fits");
        let part = if plain[at] == mcap::records::op::HEADER { &mut header } else { &mut records };
        part.extend_from_slice(&plain[at..end]);
        at = end;
    }
    let data = zstd::encode_all(records.as_slice(), 1).expect("packed");
    let mut chunk = [0; 16].to_vec();
    chunk.extend_from_slice(&(records.len() as u64).to_le_bytes());
    chunk.extend_from_slice(&[0; 4]);
    chunk.extend_from_slice(&u32::try_from(compression.len()).expect("short").to_le_bytes());
    chunk.extend_from_slice(compression.as_bytes());
    chunk.extend_from_slice(&(data.len() as u64).to_le_bytes());
    chunk.extend_from_slice(&data);
    let mut file = mcap::MAGIC.to_vec();
    file.extend_from_slice(&header);
    file.push(mcap::records::op::CHUNK);
    file.extend_from_slice(&(chunk.len() as u64).to_le_bytes());
    file.extend_from_slice(&chunk);
    file.extend_from_slice(&plain[at..]);
    file
}

/// Reads a file to its end or to an error, and checks the items.
fn check_read(path: &Path, options: &ReadOptions) -> Result<(), String> {
    let begin = Instant::now();
    let outcome = catch_unwind(AssertUnwindSafe(|| read_whole(path, options)));
    if begin.elapsed() > PATIENCE {
        return Err(format!("it took {:?}", begin.elapsed()));
    }
    outcome.unwrap_or_else(|_| Err("it panicked".to_owned()))
}

fn each(name: &str, strategy: impl Strategy<Value = Vec<u8>>, options: &ReadOptions) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("recording");
    each_at(&path, &path, name, strategy, options);
}

/// Writes mutations of a file, and reads the recording that contains it.
fn each_at(file: &Path, recording: &Path, name: &str, strategy: impl Strategy<Value = Vec<u8>>, options: &ReadOptions) {
    let config = Config { cases: cases(), failure_persistence: None, ..Config::default() };
    let done = TestRunner::new(config).run(&strategy, |bytes| {
        fs::write(file, &bytes).expect("written");
        check_read(recording, options).map_err(|fault| TestCaseError::fail(format!("{name}: {fault}")))
    });
    if let Err(fault) = done {
        panic!("{name}: {fault}");
    }
}

/// Mutation of a file.
#[derive(Clone, Debug)]
enum Change {
    Set(prop::sample::Index, u8),
    /// Typical value of a length.
    Length(prop::sample::Index, u64, usize),
    Cut(prop::sample::Index),
    Remove(prop::sample::Index, usize),
    Repeat(prop::sample::Index, usize),
    Insert(prop::sample::Index, Vec<u8>),
}

fn change() -> impl Strategy<Value = Change> {
    let at = any::<prop::sample::Index>;
    let lengths =
        prop::sample::select(vec![0, 1, 0x7f, 0xff, 0x7fff, 0xffff, 0x7fff_ffff, 0xffff_ffff, u64::MAX / 2, u64::MAX]);
    let words = ["nan", "inf", "-", ",", "\n", "\"", "1e308", "9223372036854775807", ";", "{", "[[", "]", "\0", "\r\n"];
    prop_oneof![
        (at(), any::<u8>()).prop_map(|(at, byte)| Change::Set(at, byte)),
        (at(), lengths, prop::sample::select(vec![1, 2, 4, 8])).prop_map(|(at, n, width)| Change::Length(at, n, width)),
        at().prop_map(Change::Cut),
        (at(), 1..40_usize).prop_map(|(at, count)| Change::Remove(at, count)),
        (at(), 1..200_usize).prop_map(|(at, count)| Change::Repeat(at, count)),
        (at(), prop::sample::select(words.to_vec())).prop_map(|(at, word)| Change::Insert(at, word.into())),
        (at(), prop::collection::vec(any::<u8>(), 1..9)).prop_map(|(at, bytes)| Change::Insert(at, bytes)),
    ]
}

fn changed(mut bytes: Vec<u8>, changes: Vec<Change>) -> Vec<u8> {
    for change in changes {
        if bytes.is_empty() {
            break;
        }
        let length = bytes.len();
        match change {
            Change::Set(at, byte) => bytes[at.index(length)] = byte,
            Change::Length(at, number, width) => {
                let at = at.index(length);
                let end = (at + width).min(length);
                bytes[at..end].copy_from_slice(&number.to_le_bytes()[..end - at]);
            }
            Change::Cut(at) => bytes.truncate(at.index(length)),
            Change::Remove(at, count) => {
                let at = at.index(length);
                bytes.drain(at..(at + count).min(length));
            }
            Change::Repeat(at, count) => {
                let at = at.index(length);
                let part = bytes[at..(at + count).min(length)].to_vec();
                bytes.splice(at..at, part);
            }
            Change::Insert(at, part) => {
                let at = at.index(length);
                bytes.splice(at..at, part);
            }
        }
    }
    bytes
}

#[test]
fn mutated_files_of_every_format_never_panic() {
    for (name, seed) in seeds() {
        let strategy = prop::collection::vec(change(), 1..6).prop_map(move |changes| changed(seed.clone(), changes));
        each(name, strategy, &options_of(name));
    }
}

#[test]
fn mutated_bags_never_panic() {
    let folder = tempfile::tempdir().expect("a folder");
    let packed = zstd::encode_all(foreign(None).as_slice(), 1).expect("packed");
    let files =
        [("metadata.yaml", METADATA.as_bytes().to_vec()), ("bag_0.mcap", foreign(None)), ("bag_1.mcap.zstd", packed)];
    for (name, bytes) in &files {
        fs::write(folder.path().join(name), bytes).expect("written");
    }
    let whole = Whole::read(folder.path(), &ReadOptions::default()).expect_err("the same messages twice");
    assert_eq!(whole.code(), "recording/duplicate-row", "{whole}");
    for (name, seed) in files {
        let (file, valid) = (folder.path().join(name), seed.clone());
        let strategy = prop::collection::vec(change(), 1..6).prop_map(move |changes| changed(seed.clone(), changes));
        each_at(&file, folder.path(), name, strategy, &options_of(name));
        fs::write(file, valid).expect("written");
    }
}

#[test]
fn random_bytes_never_panic_any_reader() {
    for format in Format::all() {
        let options = ReadOptions { format: Some(format), ..ReadOptions::default() };
        each(format.name, prop::collection::vec(any::<u8>(), 0..2000), &options);
    }
    let magics: Vec<&[u8]> =
        vec![b"PAR1", b"PK\x03\x04", b"\x89MCAP0\r\n", b"\x1f\x8b\x08\0\0\0\0\0\0\0", b"{", b"t,id,x,y,z\n"];
    let begun = (prop::sample::select(magics), prop::collection::vec(any::<u8>(), 0..500));
    each("begun", begun.prop_map(|(magic, rest)| [magic, &rest].concat()), &ReadOptions::default());
}

#[test]
fn seeds_are_valid() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("recording");
    for (name, seed) in seeds() {
        fs::write(&path, seed).expect("written");
        let mut items = Vec::new();
        let read = read::open(&path, &options_of(name)).and_then(|mut tracks| {
            while tracks.read(&mut items)? {}
            Ok(())
        });
        // The JSON show refers to a part that only the archive contains.
        assert_eq!(read.is_ok(), name != "show", "{name}: {:?}", read.err().map(|error| error.to_string()));
    }
}

#[test]
fn every_format_has_a_seed() {
    let folder = tempfile::tempdir().expect("a folder");
    let corpus = std::env::var_os("TAUTLINE_FUZZ_CORPUS").map_or_else(|| folder.path().join("corpus"), Into::into);
    let path = folder.path().join("recording");
    let mut seedless: Vec<_> = Format::all().map(|format| format.name).collect();
    for (name, seed) in seeds() {
        fs::write(&path, &seed).expect("written");
        let is_read = |format: &Format| {
            let options = ReadOptions { format: Some(*format), ..options_of(name) };
            read::open(&path, &options).is_ok_and(|mut tracks| {
                let mut items = Vec::new();
                tracks.read(&mut items).is_ok()
            })
        };
        let readers: Vec<_> = Format::all().filter(is_read).map(|format| format.name).collect();
        seedless.retain(|format| !readers.contains(format));
        for target in readers.into_iter().chain(["recording"]) {
            fs::create_dir_all(corpus.join(target)).expect("a folder");
            fs::write(corpus.join(target).join(name), &seed).expect("written");
        }
    }
    assert_eq!(seedless, [""; 0]);
}
