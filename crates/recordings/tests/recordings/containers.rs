//! MCAP, NPZ, Skybrush shows and Crazyflie polynomials are read with the motion that was written.

use std::fs;
use std::io::{Cursor, Write as _};
use std::path::Path;

use tautline_core::track::{Item, Piece};
use tautline_recordings::read::{ArrayAxis, ReadOptions};
use zip::write::SimpleFileOptions;

use crate::messages::{NO_TURN, SEC, cdr, header, mcap_of, mcap_with, read_bytes, whole};
use crate::recording::{Whole, assert_refused};

#[test]
fn ros_messages_keep_nanoseconds_in_both_byte_orders() {
    for little in [true, false] {
        let array = |ns| cdr(&(header(ns), vec![([1.0, 2.0, 3.0], NO_TURN), ([4.0, 5.0, 6.0], NO_TURN)]), little);
        let poses = "geometry_msgs/msg/PoseArray";
        let whole =
            whole("ros.mcap", &mcap_of(&[("/p", poses, "cdr", 7, array(1)), ("/p", poses, "cdr", 8, array(2))]));
        let (a, b) = ([1.0, 2.0, 3.0], [4.0, 5.0, 6.0]);
        assert_eq!(whole.samples(), [(1e-9, "1", a), (1e-9, "2", b), (2e-9, "1", a), (2e-9, "2", b)]);
        assert_eq!((whole.clock.unit, whole.clock.epoch_ns), ("ns", i64::from(SEC) * 1_000_000_000));
    }
}

#[test]
fn poses_are_named_by_topic_and_transforms_by_frame() {
    let stamped = |ns| cdr(&(header(ns), ([1.0, 2.0, 3.0], NO_TURN)), true);
    let kind = "geometry_msgs/msg/PoseStamped";
    let file = mcap_of(&[("/cf1/pose", kind, "cdr", 1, stamped(5)), ("/cf2/pose", kind, "cdr", 1, stamped(6))]);
    assert_eq!(whole("topics.mcap", &file).vehicles, ["/cf1/pose", "/cf2/pose"]);

    let transform = |child: &'static str| (header(5), child, ([1.0, 2.0, 3.0], NO_TURN));
    let tf = cdr(&(vec![transform("cf1"), transform("cf2")],), true);
    let found = whole("tf.mcap", &mcap_of(&[("/tf", "tf2_msgs/msg/TFMessage", "cdr", 1, tf)]));
    assert_eq!(found.samples(), [(5e-9, "cf1", [1.0, 2.0, 3.0]), (5e-9, "cf2", [1.0, 2.0, 3.0])]);
}

#[test]
fn constant_frames_are_not_vehicles() {
    let kind = "tf2_msgs/msg/TFMessage";
    let transform = |parent: &'static str, child: &'static str, x: f64| {
        cdr(&(vec![(((SEC, 5), parent), child, ([x, 2.0, 3.0], NO_TURN))],), true)
    };
    let fixed = ("/tf_static", kind, "cdr", 1, transform("cf1", "camera", 0.1));
    let found = whole("tf.mcap", &mcap_of(&[fixed.clone(), ("/tf", kind, "cdr", 2, transform("map", "cf1", 1.0))]));
    assert_eq!(found.samples(), [(5e-9, "cf1", [1.0, 2.0, 3.0])]);
    assert!(found.notes.iter().any(|note| note.ends_with("not vehicles: camera")), "{:?}", found.notes);
    // On a topic with another name the same transform counts as moving; its frame still belongs to the vehicle.
    let moving = ("/other", kind, "cdr", 1, fixed.4);
    let both = whole("tf.mcap", &mcap_of(&[moving, ("/tf", kind, "cdr", 2, transform("map", "cf1", 1.0))]));
    assert_eq!(both.samples(), [(5e-9, "cf1", [1.0, 2.0, 3.0])]);
    assert!(both.notes.iter().any(|note| note.ends_with("belong to them: camera")), "{:?}", both.notes);
}

/// Foxglove message with fields that the reader ignores.
mod foxglove {
    #[derive(Clone, PartialEq, prost::Message)]
    pub(crate) struct Time {
        #[prost(int64, tag = "1")]
        pub(crate) seconds: i64,
        #[prost(int32, tag = "2")]
        pub(crate) nanos: i32,
    }

    #[derive(Clone, PartialEq, prost::Message)]
    pub(crate) struct Numbers {
        #[prost(double, tag = "1")]
        pub(crate) x: f64,
        #[prost(double, tag = "2")]
        pub(crate) y: f64,
        #[prost(double, tag = "3")]
        pub(crate) z: f64,
        #[prost(double, tag = "4")]
        pub(crate) w: f64,
    }

    #[derive(Clone, PartialEq, prost::Message)]
    pub(crate) struct Pose {
        #[prost(message, optional, tag = "1")]
        pub(crate) position: Option<Numbers>,
        #[prost(message, optional, tag = "2")]
        pub(crate) orientation: Option<Numbers>,
    }

    #[derive(Clone, PartialEq, prost::Message)]
    pub(crate) struct PosesInFrame {
        #[prost(message, optional, tag = "1")]
        pub(crate) timestamp: Option<Time>,
        #[prost(string, tag = "2")]
        pub(crate) frame_id: String,
        #[prost(message, repeated, tag = "3")]
        pub(crate) poses: Vec<Pose>,
    }
}

fn foxglove_poses() -> Vec<u8> {
    use foxglove::{Numbers, Pose, PosesInFrame, Time};
    use prost::Message as _;
    let turn = Numbers { x: 0.0, y: 0.0, z: 0.0, w: 1.0 };
    let pose = |x, y, z| Pose { position: Some(Numbers { x, y, z, w: 0.0 }), orientation: Some(turn.clone()) };
    let timestamp = Some(Time { seconds: 12, nanos: 500_000_000 });
    PosesInFrame { timestamp, frame_id: "map".into(), poses: vec![pose(1.0, 2.0, 3.0), pose(4.0, 5.0, 6.0)] }
        .encode_to_vec()
}

const FOXGLOVE_TRUTH: [(f64, &str, [f64; 3]); 2] = [(12.5, "1", [1.0, 2.0, 3.0]), (12.5, "2", [4.0, 5.0, 6.0])];

#[test]
fn foxglove_messages_are_read_in_protobuf_and_json() {
    let kind = "foxglove.PosesInFrame";
    let found = whole("protobuf.mcap", &mcap_of(&[("/p", kind, "protobuf", 1, foxglove_poses())]));
    assert_eq!(found.samples(), FOXGLOVE_TRUTH);
    let json = concat!(
        r#"{"timestamp": {"sec": 12, "nsec": 500000000}, "frame_id": "map", "poses": [ "#,
        r#"{"position": {"x": 1, "y": 2, "z": 3}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}, "#,
        r#"{"position": {"x": 4, "y": 5, "z": 6}}]}"#,
    );
    let found = whole("json.mcap", &mcap_of(&[("/p", kind, "json", 1, json.into())]));
    assert_eq!(found.samples(), FOXGLOVE_TRUTH);
    let json = concat!(
        r#"{"transforms": [{"timestamp": {"sec": 12, "nsec": 500000000}, "parent_frame_id": "map", "#,
        r#""child_frame_id": "1", "translation": {"x": 1, "y": 2, "z": 3}}, "#,
        r#"{"timestamp": {"sec": 12, "nsec": 500000000}, "#,
        r#""parent_frame_id": "map", "child_frame_id": "2", "translation": {"x": 4, "y": 5, "z": 6}}]}"#,
    );
    let found = whole("tf.mcap", &mcap_of(&[("/tf", "foxglove.FrameTransforms", "json", 1, json.into())]));
    assert_eq!(found.samples(), FOXGLOVE_TRUTH);
}

#[test]
fn messages_without_a_time_use_the_log_time() {
    let json = r#"{"poses": [{"position": {"x": 1, "y": 2, "z": 3}}]}"#;
    let found = whole("json.mcap", &mcap_of(&[("/p", "foxglove.PosesInFrame", "json", 2_500_000_000, json.into())]));
    assert_eq!(found.samples(), [(2.5, "1", [1.0, 2.0, 3.0])]);
}

#[test]
fn zero_is_a_valid_time_on_a_stamped_topic() {
    let json = |nsec: u32| {
        format!(r#"{{"timestamp": {{"sec": 0, "nsec": {nsec}}}, "poses": [{{"position": {{"x": {nsec}}}}}]}}"#)
            .into_bytes()
    };
    let kind = "foxglove.PosesInFrame";
    let wall = 1_700_000_000_000_000_000;
    let sent = [0, 100, 200].map(|ns| ("/p", kind, "json", wall + u64::from(ns), json(ns)));
    let found = whole("sim.mcap", &mcap_of(&sent));
    let times: Vec<_> = found.samples().iter().map(|&(t, _, [x, ..])| (t, x)).collect();
    assert_eq!((times, found.clock.epoch_ns), (vec![(0.0, 0.0), (1e-7, 100.0), (2e-7, 200.0)], 0));
}

#[test]
fn several_frames_require_the_frame_option() {
    let at = |frame: &'static str| cdr(&(((1, 0), frame), ([1.0, 2.0, 3.0], NO_TURN)), true);
    let kind = "geometry_msgs/msg/PoseStamped";
    let file = mcap_of(&[("/a", kind, "cdr", 1, at("map")), ("/b", kind, "cdr", 1, at("odom"))]);
    let refused = read_bytes("frames.mcap", &file, &ReadOptions::default()).expect_err("refused");
    assert_refused(&refused, "recording/several-frames", "message 2 on topic `/b`");
    let options = ReadOptions { frame: Some("odom".to_owned()), ..ReadOptions::default() };
    assert_eq!(read_bytes("frames.mcap", &file, &options).expect("read").vehicles, ["/b"]);
}

#[test]
fn unclosed_file_requires_allow_unfinished() {
    let json = |x: u32| format!(r#"{{"poses": [{{"position": {{"x": {x}}}}}]}}"#).into_bytes();
    let kind = "foxglove.PosesInFrame";
    let options = mcap::WriteOptions::new().compression(None).chunk_size(Some(1));
    let file = mcap_with(options, &[("/p", kind, "json", 1, json(1)), ("/p", kind, "json", 2, json(2))]);
    let cut = &file[..file.len() / 2];
    let refused = read_bytes("cut.mcap", cut, &ReadOptions::default()).expect_err("refused");
    assert_refused(&refused, "recording/unfinished", "");
    let options = ReadOptions { allow_unfinished: true, ..ReadOptions::default() };
    let found = read_bytes("cut.mcap", cut, &options).expect("read");
    assert!(!found.items.is_empty() && found.notes.iter().any(|note| note.contains("not closed")), "{found:?}");
}

/// Returns an archive of these entries, packed or not.
fn archive(entries: &[(&str, Vec<u8>)], packed: bool) -> Vec<u8> {
    let method = if packed { zip::CompressionMethod::Deflated } else { zip::CompressionMethod::Stored };
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in entries {
        zip.start_file(*name, SimpleFileOptions::default().compression_method(method)).expect("an entry");
        zip.write_all(bytes).expect("written");
    }
    zip.finish().expect("finished").into_inner()
}

fn npy(descr: &str, fortran: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend_from_slice(&u16::try_from(header.len()).expect("short").to_le_bytes());
    bytes.extend_from_slice(header.as_bytes());
    bytes.extend_from_slice(data);
    bytes
}

/// Returns options with a layout: 0 is time, vehicle, axis, and 1 is vehicle, time, axis.
fn laid_out(layout: usize) -> ReadOptions {
    ReadOptions { layout: Some(ArrayAxis::LAYOUTS[layout]), ..ReadOptions::default() }
}

fn doubles(numbers: &[f64]) -> Vec<u8> {
    numbers.iter().flat_map(|x| x.to_le_bytes()).collect()
}

const NPZ_TRUTH: [(f64, &str, [f64; 3]); 6] = [
    (0.0, "1", [0.0, 1.0, 2.0]),
    (0.0, "2", [3.0, 4.0, 5.0]),
    (0.5, "1", [6.0, 7.0, 8.0]),
    (0.5, "2", [9.0, 10.0, 11.0]),
    (1.0, "1", [12.0, 13.0, 14.0]),
    (1.0, "2", [15.0, 16.0, 17.0]),
];

/// Returns the numbers of [`NPZ_TRUTH`] in the order of an array; each index is (time, vehicle, axis).
fn arranged(indices: impl Iterator<Item = [usize; 3]>) -> Vec<f64> {
    indices.map(|[k, i, axis]| NPZ_TRUTH[2 * k + i].2[axis]).collect()
}

fn cube(a: usize, b: usize, c: usize) -> impl Iterator<Item = [usize; 3]> {
    (0..a).flat_map(move |i| (0..b).flat_map(move |j| (0..c).map(move |k| [i, j, k])))
}

#[test]
fn npz_is_read_in_every_axis_order_packed_or_not() {
    let time_first = arranged(cube(3, 2, 3));
    let vehicle_first = arranged(cube(2, 3, 3).map(|[i, k, axis]| [k, i, axis]));
    let fortran = arranged(cube(3, 2, 3).map(|[axis, i, k]| [k, i, axis]));
    let big: Vec<u8> = time_first.iter().flat_map(|x| x.to_be_bytes()).collect();
    #[expect(clippy::cast_possible_truncation, reason = "small whole numbers")]
    let single: Vec<u8> = time_first.iter().flat_map(|&x| (x as f32).to_le_bytes()).collect();
    let axis_first = arranged(cube(3, 3, 2).map(|[axis, k, i]| [k, i, axis]));
    let axis_between = arranged(cube(3, 3, 2).map(|[k, axis, i]| [k, i, axis]));
    for (positions, packed, layout) in [
        (npy("<f8", "False", "(3, 2, 3)", &doubles(&time_first)), false, 0),
        (npy("<f8", "False", "(3, 2, 3)", &doubles(&time_first)), true, 0),
        (npy("<f8", "False", "(2, 3, 3)", &doubles(&vehicle_first)), true, 1),
        (npy("<f8", "True", "(3, 2, 3)", &doubles(&fortran)), false, 0),
        (npy(">f8", "False", "(3, 2, 3)", &big), false, 0),
        (npy("<f4", "False", "(3, 2, 3)", &single), true, 0),
        (npy("<f8", "False", "(3, 3, 2)", &doubles(&axis_between)), false, 2),
        (npy("<f8", "True", "(3, 3, 2)", &doubles(&arranged(cube(2, 3, 3).map(|[i, axis, k]| [k, i, axis])))), true, 2),
        (npy("<f8", "False", "(3, 3, 2)", &doubles(&axis_first)), false, 4),
    ] {
        let t = npy("<f8", "False", "(3,)", &doubles(&[0.0, 0.5, 1.0]));
        let bytes = archive(&[("t.npy", t), ("positions.npy", positions)], packed);
        let found = read_bytes("flight.npz", &bytes, &laid_out(layout)).expect("read");
        assert_eq!(found.samples(), NPZ_TRUTH);
    }
}

#[test]
fn npz_seen_has_the_layout_of_positions() {
    let t = || ("t.npy", npy("<f8", "False", "(3,)", &doubles(&[0.0, 0.5, 1.0])));
    let positions = || ("positions.npy", npy("<f8", "False", "(3, 2, 3)", &doubles(&arranged(cube(3, 2, 3)))));
    // Vehicle 2 was not seen at 0.5 s.
    let time_first = [1, 1, 1, 0, 1, 1];
    let vehicle_first = [1, 1, 1, 1, 0, 1];
    let all_but_one: Vec<_> = NPZ_TRUTH.iter().copied().filter(|&(t, name, _)| (t, name) != (0.5, "2")).collect();
    for seen in [npy("|b1", "False", "(3, 2)", &time_first), npy("|b1", "True", "(3, 2)", &vehicle_first)] {
        let bytes = archive(&[t(), positions(), ("seen.npy", seen)], false);
        let found = read_bytes("seen.npz", &bytes, &laid_out(0)).expect("read");
        assert_eq!(found.samples(), all_but_one);
    }
    let turned = (
        "positions.npy",
        npy("<f8", "True", "(2, 3, 3)", &doubles(&arranged(cube(3, 3, 2).map(|[axis, k, i]| [k, i, axis])))),
    );
    let seen = ("seen.npy", npy("|b1", "False", "(2, 3)", &vehicle_first));
    let bytes = archive(&[t(), turned, seen], true);
    assert_eq!(read_bytes("turned.npz", &bytes, &laid_out(1)).expect("read").samples(), all_but_one);

    for (name, array, code) in [
        ("seen", npy("|b1", "False", "(2, 3)", &vehicle_first), "recording/array-shape"),
        ("seen", npy("|b1", "False", "(6,)", &time_first), "recording/array-shape"),
        ("velocities", npy("<f8", "False", "(3, 3, 2)", &doubles(&[0.0; 18])), "recording/array-shape"),
        ("radii", npy("<f8", "False", "(2, 3)", &doubles(&[0.1; 6])), "recording/array-shape"),
        ("names", npy("|S1", "False", "(2,)", b"aa"), "recording/vehicle-twice"),
        ("names", npy("|S1", "False", "(3,)", b"abc"), "recording/array-shape"),
    ] {
        let bytes = archive(&[t(), positions(), (&format!("{name}.npy"), array)], false);
        let refused = read_bytes("odd.npz", &bytes, &laid_out(0)).expect_err(name);
        assert_refused(&refused, code, &format!("array `{name}`"));
    }
}

#[test]
fn two_time_arrays_are_refused() {
    let times = || npy("<f8", "False", "(3,)", &doubles(&[0.0, 0.5, 1.0]));
    let positions = ("positions.npy", npy("<f8", "False", "(3, 2, 3)", &doubles(&arranged(cube(3, 2, 3)))));
    let bytes = archive(&[("t.npy", times()), ("timestamps.npy", times()), positions], true);
    let refused = read_bytes("two.npz", &bytes, &ReadOptions::default()).expect_err("two clocks");
    assert_refused(&refused, "recording/ambiguous-column", "");
    let mut named = laid_out(0);
    assert!(named.columns.set("t", "timestamps"));
    assert_eq!(read_bytes("two.npz", &bytes, &named).expect("named").samples().len(), 6);
}

#[test]
fn nat_time_is_refused() {
    let stamps: Vec<u8> = [0_i64, i64::MIN, 1000].iter().flat_map(|ms| ms.to_le_bytes()).collect();
    let t = ("t.npy", npy("<M8[ms]", "False", "(3,)", &stamps));
    let positions = ("positions.npy", npy("<f8", "False", "(3, 2, 3)", &doubles(&arranged(cube(3, 2, 3)))));
    let refused = read_bytes("nat.npz", &archive(&[t, positions], true), &ReadOptions::default()).expect_err("refused");
    assert_refused(&refused, "recording/not-finite", "t[1]");
}

#[test]
fn npz_time_unit_is_read_and_square_shape_is_ambiguous() {
    let stamps: Vec<u8> = [0_i64, 500, 1000].iter().flat_map(|ms| ms.to_le_bytes()).collect();
    let t = npy("<M8[ms]", "False", "(3,)", &stamps);
    let positions = npy("<f8", "False", "(3, 2, 3)", &doubles(&arranged(cube(3, 2, 3))));
    let bytes = archive(&[("t.npy", t), ("positions.npy", positions)], true);
    let found = read_bytes("flight.npz", &bytes, &laid_out(0)).expect("read");
    assert_eq!((found.samples(), found.clock.unit), (NPZ_TRUTH.to_vec(), "ms"));

    let t = npy("<f8", "False", "(2,)", &doubles(&[0.0, 0.5]));
    let positions = npy("<f8", "False", "(2, 2, 3)", &doubles(&arranged(cube(2, 2, 3))));
    let square = archive(&[("t.npy", t), ("positions.npy", positions)], true);
    let refused = read_bytes("square.npz", &square, &ReadOptions::default()).expect_err("refused");
    assert_refused(&refused, "recording/ambiguous-layout", "array `positions`");
    assert!(refused.help().contains("layout=time,vehicle,axis or vehicle,time,axis"), "{}", refused.help());
    let found = read_bytes("square.npz", &square, &laid_out(0)).expect("read");
    assert_eq!(found.samples(), NPZ_TRUTH[..4]);
    let turned = read_bytes("square.npz", &square, &laid_out(1)).expect("read");
    assert_eq!(turned.samples()[1].2, NPZ_TRUTH[2].2);
}

fn pieces(whole: &Whole) -> Vec<&Piece> {
    whole.items.iter().map(|item| if let Item::Piece(piece) = item { piece } else { panic!("a sample") }).collect()
}

fn at(piece: &Piece, time_s: f64) -> [f64; 3] {
    let dt = time_s - piece.from_s;
    piece.coefficients.iter().rev().fold([0.0; 3], |sum, c| [0, 1, 2].map(|axis| sum[axis] * dt + c[axis]))
}

const TRAJECTORY: &str = r#"{"version": 1, "takeoffTime": 2,
    "points": [[0, [1, 2, 0], []], [4, [1, 2, 8], []], [6, [5, 2, 8], [[1, 2, 8], [5, 2, 8]]]], "landingHeight": 0}"#;

#[test]
fn skybrush_shows_are_read_as_json_and_skyc() {
    let show = |trajectory: &str| {
        format!(
            r#"{{"version": 1, "environment": {{"type": "outdoor"}}, "swarm": {{"drones": [
                {{"type": "generic", "settings": {{"name": "Drone 1", "home": [1, 2, 0], "lights": {{"data": "AA=="}},
                "trajectory": {trajectory}}}}}]}}}}"#
        )
    };
    let alone = whole("show.json", show(TRAJECTORY).as_bytes());
    let reference = show(r#"{"$ref": "./drones/Drone 1/trajectory.json#"}"#);
    let parts = [("show.json", reference.into_bytes()), ("drones/Drone 1/trajectory.json", TRAJECTORY.into())];
    let parted = whole("show.skyc", &archive(&parts, true));
    for found in [&alone, &parted] {
        assert_eq!(found.vehicles, ["Drone 1"]);
        let pieces = pieces(found);
        let spans: Vec<_> = pieces.iter().map(|piece| (piece.from_s, piece.to_s)).collect();
        assert_eq!(spans, [(0.0, 2.0), (2.0, 6.0), (6.0, 8.0)]);
        assert_eq!(at(pieces[0], 1.0), [1.0, 2.0, 0.0]);
        assert_eq!(at(pieces[1], 4.0), [1.0, 2.0, 4.0]);
        // The midpoint of a cubic Bezier curve is (P0 + 3 P1 + 3 P2 + P3) / 8.
        assert_eq!(at(pieces[2], 7.0), [3.0, 2.0, 8.0]);
        // The control points give zero velocity at both ends.
        assert_eq!(pieces[2].coefficients[1].x, 0.0);
    }
    assert_eq!(alone.items, parted.items);
}

#[test]
fn skybrush_drone_with_one_point_stands_throughout() {
    let drone = |name: &str, points: &str| {
        format!(r#"{{"settings": {{"name": "{name}", "trajectory": {{"points": {points}}}}}}}"#)
    };
    let show = |drones: &[String]| format!(r#"{{"swarm": {{"drones": [{}]}}}}"#, drones.join(", "));
    let (still, flies) = (drone("A", "[[0, [1, 2, 3], []]]"), drone("B", "[[0, [9, 9, 0], []], [7, [9, 9, 9], []]]"));
    let found = whole("show.json", show(&[still.clone(), flies]).as_bytes());
    let a: Vec<_> = pieces(&found).into_iter().filter(|piece| piece.vehicle == 0).collect();
    assert_eq!(a.iter().map(|piece| (piece.from_s, piece.to_s)).collect::<Vec<_>>(), [(0.0, 7.0)]);
    assert_eq!(at(a[0], 5.0), [1.0, 2.0, 3.0]);
    assert_eq!(whole("still.json", show(&[still]).as_bytes()).samples(), [(0.0, "A", [1.0, 2.0, 3.0])]);
}

fn polynomial(pieces: &[(f64, [f64; 3])]) -> String {
    let header = "duration,x^0,x^1,y^0,y^1,z^0,z^1,yaw^0,yaw^1,\n".to_owned();
    let row = |&(duration, [x, y, z]): &(f64, [f64; 3])| format!("{duration},{x},1,{y},0,{z},0,0,0,\n");
    header + &pieces.iter().map(row).collect::<String>()
}

fn write(folder: &Path, name: &str, content: &str) {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
    fs::write(path, content).expect("written");
}

#[test]
fn polynomials_are_concatenated_within_and_across_files() {
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path(), "cf10.csv", &polynomial(&[(1.0, [5.0, 0.0, 1.0])]));
    write(folder.path(), "cf9.csv", &polynomial(&[(1.5, [0.0, 0.0, 1.0]), (0.5, [1.5, 0.0, 1.0])]));
    let found = Whole::read(folder.path(), &ReadOptions::default()).expect("read");
    assert_eq!(found.vehicles, ["cf9", "cf10"]);
    let spans: Vec<_> = pieces(&found).iter().map(|piece| (piece.vehicle, piece.from_s, piece.to_s)).collect();
    assert_eq!(spans, [(0, 0.0, 1.5), (1, 0.0, 1.0), (0, 1.5, 2.0)]);
    assert_eq!(at(pieces(&found)[2], 2.0), [2.0, 0.0, 1.0]);

    let split = tempfile::tempdir().expect("a folder");
    write(split.path(), "cf9/1.csv", &polynomial(&[(1.5, [0.0, 0.0, 1.0])]));
    write(split.path(), "cf9/2.csv", &polynomial(&[(0.5, [1.5, 0.0, 1.0])]));
    write(split.path(), "cf10/1.csv", &polynomial(&[(1.0, [5.0, 0.0, 1.0])]));
    let parted = Whole::read(split.path(), &ReadOptions::default()).expect("read");
    assert_eq!((parted.vehicles, parted.items), (found.vehicles, found.items));
}

#[test]
fn curve_jump_is_noted() {
    let folder = tempfile::tempdir().expect("a folder");
    write(folder.path(), "cf1.csv", &polynomial(&[(1.0, [0.0, 0.0, 1.0]), (1.0, [1.5, 0.0, 1.0])]));
    let found = Whole::read(folder.path(), &ReadOptions::default()).expect("read");
    assert!(
        found.notes.iter().any(|note| note.contains("jump of a curve is 0.5000 m, of `cf1` at 1 s")),
        "{:?}",
        found.notes
    );
}

#[test]
fn only_ambiguous_npz_shapes_are_refused() {
    let read = |shape: [usize; 3], times: usize, axes: &[&str], options: &ReadOptions| {
        let stamps: Vec<_> = (0..u8::try_from(times).expect("few")).map(f64::from).collect();
        let t = ("t.npy", npy("<f8", "False", &format!("({times},)"), &doubles(&stamps)));
        let numbers = vec![0.5; shape.iter().product()];
        let [a, b, c] = shape;
        let positions = ("positions.npy", npy("<f8", "False", &format!("({a}, {b}, {c})"), &doubles(&numbers)));
        let letters: Vec<u8> = axes.iter().flat_map(|name| format!("{name:\0<7}").into_bytes()).collect();
        let axes =
            (!axes.is_empty()).then(|| ("axes.npy", npy("|S7", "False", &format!("({},)", axes.len()), &letters)));
        let arrays: Vec<_> = [t, positions].into_iter().chain(axes).collect();
        read_bytes("flight.npz", &archive(&arrays, false), options)
    };
    let plain = ReadOptions::default();
    // Times, vehicles, and whether the recording is planar.
    for (shape, times, vehicles) in [([9, 4, 3], 9, 4), ([4, 9, 3], 9, 4), ([9, 4, 2], 9, 4), ([9, 1, 3], 9, 1)] {
        let found = read(shape, times, &[], &plain).unwrap_or_else(|error| panic!("{shape:?}: {error}"));
        assert_eq!((found.vehicles.len(), found.items.len()), (vehicles, times * vehicles), "{shape:?}");
    }
    for (shape, times) in [
        ([9, 3, 2], 9),
        ([9, 3, 3], 9),
        ([9, 2, 3], 9),
        ([9, 2, 2], 9),
        ([9, 3, 6], 9),
        ([3, 9, 5], 9),
        ([3, 5, 3], 3),
        ([2, 5, 2], 2),
        ([5, 5, 3], 5),
        ([4, 3, 9], 9),
    ] {
        let refused = read(shape, times, &[], &plain).expect_err("asked");
        assert_refused(&refused, "recording/ambiguous-layout", "array `positions`");
    }
    let refused = read([9, 4, 5], 9, &[], &plain).expect_err("no axes");
    assert_refused(&refused, "recording/array-shape", "array `positions`");
    assert!(read([9, 4, 3], 9, &[], &laid_out(2)).is_err(), "it is not laid out so");
    assert_eq!(read([9, 3, 2], 9, &[], &laid_out(2)).expect("read").vehicles.len(), 2);
    assert_eq!(read([9, 3, 2], 9, &["time", "axis", "vehicle"], &plain).expect("read").vehicles.len(), 2);
    assert_eq!(read([9, 3, 2], 9, &["time", "vehicle", "xy"], &plain).expect("read").vehicles.len(), 3);
    assert!(read([3, 3, 3], 3, &["time"], &plain).is_err(), "the other two are not told apart");
}
