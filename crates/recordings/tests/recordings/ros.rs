//! ROS 2 recordings: pose messages, bags, and transforms between frames.

use std::fs;
use std::path::{Path, PathBuf};

use tautline_recordings::read::{ReadError, ReadOptions};
use tempfile::TempDir;

use crate::messages::{Message, NO_TURN, SEC, cdr, header, mcap_of, read_bytes, whole};
use crate::recording::{Whole, assert_refused};

/// Change of a valid folder.
type Spoil = Box<dyn FnOnce(&Path)>;

/// Quaternion of a quarter turn to the left.
const QUARTER: [f64; 4] = [0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2];

/// Rounding error of a rotation of lengths of some metres.
const ROUNDING_M: f64 = 1e-14;

const TF: &str = "tf2_msgs/msg/TFMessage";
const POSE: &str = "geometry_msgs/msg/PoseStamped";
const ODOMETRY: &str = "nav_msgs/msg/Odometry";
const NAMED: &str = "motion_capture_tracking_interfaces/msg/NamedPoseArray";

fn options(frame: Option<&str>, topics: &[&str]) -> ReadOptions {
    let topics = topics.iter().map(|topic| (*topic).to_owned()).collect();
    ReadOptions { frame: frame.map(str::to_owned), topics, ..ReadOptions::default() }
}

fn in_frame(frame: &str) -> ReadOptions {
    options(Some(frame), &[])
}

fn read(bytes: &[u8], options: &ReadOptions) -> Whole {
    read_bytes("ros.mcap", bytes, options).unwrap_or_else(|error| panic!("{error}\n{}", error.help()))
}

fn refused(messages: &[Message], options: &ReadOptions) -> ReadError {
    read_bytes("ros.mcap", &mcap_of(messages), options).expect_err("refused")
}

fn bag(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings/bags").join(name)
}

/// Encodes a transform at a time \[ns\].
fn transform(ns: u32, parent: &'static str, child: &'static str, at: [f64; 3], turn: [f64; 4]) -> Vec<u8> {
    cdr(&(vec![(((SEC, ns), parent), child, (at, turn))],), true)
}

fn pose(ns: u32, frame: &'static str, at: [f64; 3]) -> Vec<u8> {
    cdr(&(((SEC, ns), frame), (at, NO_TURN)), true)
}

fn odometry(ns: u32, frame: &'static str, child: &'static str, at: [f64; 3]) -> Vec<u8> {
    cdr(&(((SEC, ns), frame), child, ((at, NO_TURN), [[0.0; 6]; 6]), (([9.0; 3], [9.0; 3]), [[0.0; 6]; 6])), true)
}

#[test]
fn all_pose_messages_are_read_in_both_byte_orders() {
    let (at, covariance) = ([1.0, 2.0, 3.0], [[0.5; 6]; 6]);
    for little in [true, false] {
        let odometry = (header(5), "base_link", ((at, NO_TURN), covariance), (([9.0; 3], [9.0; 3]), covariance));
        let named = (header(5), vec![("cf1", (at, NO_TURN)), ("cf22", (at, NO_TURN))]);
        for (topic, kind, message, vehicles) in [
            ("/r1/odom", ODOMETRY, cdr(&odometry, little), vec!["/r1/odom"]),
            (
                "/amcl_pose",
                "geometry_msgs/msg/PoseWithCovarianceStamped",
                cdr(&(header(5), ((at, NO_TURN), covariance)), little),
                vec!["/amcl_pose"],
            ),
            ("/tag", "geometry_msgs/msg/PointStamped", cdr(&(header(5), at), little), vec!["/tag"]),
            ("/poses", NAMED, cdr(&named, little), vec!["cf1", "cf22"]),
        ] {
            let found = whole("ros.mcap", &mcap_of(&[(topic, kind, "cdr", 7, message.clone())]));
            let expected: Vec<_> = vehicles.iter().map(|name| (5e-9, *name, at)).collect();
            assert_eq!(found.samples(), expected, "{kind}");
            let cut = mcap_of(&[(topic, kind, "cdr", 7, message[..40].to_vec())]);
            let error = read_bytes("cut.mcap", &cut, &ReadOptions::default()).expect_err("refused");
            assert_refused(&error, "recording/damaged", &format!("message 1 on topic `{topic}`"));
        }
    }
}

#[test]
fn odometry_velocities_are_ignored_with_a_note() {
    let found =
        whole("odom.mcap", &mcap_of(&[("/odom", ODOMETRY, "cdr", 1, odometry(1, "odom", "base_link", [0.0; 3]))]));
    assert!(
        found.notes.iter().any(|note| note.starts_with("velocities of odometry are not used")),
        "{:?}",
        found.notes
    );
    let named = cdr(&(header(1), vec![("cf1", ([f64::NAN, 0.0, 0.0], NO_TURN))]), true);
    let error = refused(&[("/poses", NAMED, "cdr", 1, named)], &ReadOptions::default());
    assert_refused(&error, "recording/not-finite", "message 1 on topic `/poses`");
}

/// Returns two vehicles that pass each other, as in `bags.py`.
fn passing() -> Vec<(f64, &'static str, [f64; 3])> {
    let at = |k: u32| f64::from(k) / 10.0;
    let both = |k| [(at(k), "cf1", [at(k) - 1.0, 0.0, 1.0]), (at(k), "cf2", [1.0 - at(k), 0.5, 1.0])];
    (0..=20).flat_map(both).collect()
}

#[test]
fn crazyswarm_bag_has_each_vehicle_once() {
    let found = Whole::read(&bag("crazyswarm"), &ReadOptions::default()).expect("read");
    assert_eq!(found.samples(), passing());
    assert!(
        found.notes.iter().any(|note| note.contains("topics of poses describe them: cf1, cf2")),
        "{:?}",
        found.notes
    );
    let by_transforms = Whole::read(&bag("crazyswarm"), &options(None, &["/tf"])).expect("read");
    assert_eq!(by_transforms.items, found.items);
    let error = Whole::read(&bag("crazyswarm"), &options(None, &["/pose"])).expect_err("refused");
    assert_refused(&error, "recording/unknown-topic", "");
    assert!(error.to_string().ends_with("such topics are /poses, /tf"), "{error}");
}

#[test]
fn compressed_splits_form_one_recording() {
    let found = Whole::read(&bag("split"), &ReadOptions::default()).expect("read");
    assert_eq!((found.samples(), found.clock.epoch_ns), (passing(), i64::from(SEC) * 1_000_000_000));
}

#[test]
fn poses_with_covariance_are_named_by_topic() {
    let found = Whole::read(&bag("covariance"), &ReadOptions::default()).expect("read");
    assert_eq!(found.vehicles, ["/r1/pose", "/r2/pose"]);
    assert_eq!(found.samples()[5], (0.2, "/r2/pose", [2.0, 0.2, 0.0]));
}

/// Changes a copy of the bag with two compressed splits, and reads it.
fn changed(change: impl FnOnce(&Path)) -> (TempDir, Result<Whole, ReadError>) {
    let folder = tempfile::tempdir().expect("a folder");
    for entry in fs::read_dir(bag("split")).expect("a bag") {
        let path = entry.expect("a file").path();
        fs::copy(&path, folder.path().join(path.file_name().expect("a name"))).expect("copied");
    }
    change(folder.path());
    let read = Whole::read(folder.path(), &ReadOptions::default());
    (folder, read)
}

fn edit(file: &Path, change: impl FnOnce(String) -> String) {
    let text = fs::read_to_string(file).expect("text");
    fs::write(file, change(text)).expect("written");
}

#[test]
fn incomplete_bags_are_refused() {
    let remove = |name: &'static str| move |folder: &Path| fs::remove_file(folder.join(name)).expect("removed");
    let text = |from: &'static str, to: &'static str| {
        move |folder: &Path| edit(&folder.join("metadata.yaml"), |text| text.replace(from, to))
    };
    let cut = |folder: &Path| {
        let path = folder.join("split_1.mcap.zstd");
        let bytes = fs::read(&path).expect("bytes");
        fs::write(&path, &bytes[..bytes.len() / 2]).expect("written");
    };
    let foreign = |folder: &Path| fs::write(folder.join("split_1.mcap.zstd"), "no bag").expect("written");
    let other = |folder: &Path| drop(fs::copy(folder.join("split_1.mcap.zstd"), folder.join("split_2.mcap")));
    let is_folder = |folder: &Path| {
        let split = folder.join("split_1.mcap.zstd");
        fs::remove_file(&split).and_then(|()| fs::create_dir(&split)).expect("a folder in its place");
    };
    let (first, second, index) = ("split_0.mcap.zstd", "split_1.mcap.zstd", "metadata.yaml");
    let cases: [(Spoil, &str, &str); 13] = [
        (Box::new(text("message_count: 21", "message_count: 22")), "", "recording/bag-index"),
        (Box::new(is_folder), second, "recording/bag-index"),
        (Box::new(remove("split_1.mcap.zstd")), second, "recording/bag-index"),
        (Box::new(remove("split_0.mcap.zstd")), first, "recording/bag-index"),
        (Box::new(cut), second, "recording/truncated"),
        (Box::new(foreign), second, "recording/wrong-format"),
        (Box::new(other), "", "recording/bag-index"),
        (Box::new(text("- split_1.mcap.zstd", "- ../split_1.mcap.zstd")), index, "recording/bag-index"),
        (Box::new(text("- split_1.mcap.zstd", "- split_0.mcap.zstd")), index, "recording/bag-index"),
        (
            Box::new(text("storage_identifier: mcap", "storage_identifier: sqlite3")),
            index,
            "recording/unsupported-format",
        ),
        (
            Box::new(text("compression_mode: file", "compression_mode: MESSAGE")),
            index,
            "recording/unsupported-compression",
        ),
        (Box::new(text("relative_file_paths", "relative_paths")), index, "recording/bag-index"),
        (Box::new(text("storage_identifier: mcap", "storage_identifier: [")), index, "recording/bag-index"),
    ];
    for (change, file, code) in cases {
        let error = changed(change).1.expect_err(code);
        assert_eq!(error.code(), code, "{error}");
        assert!(error.file.ends_with(file) && !error.help().is_empty(), "{error}");
    }
}

#[test]
fn allow_unfinished_reads_a_truncated_bag() {
    let cut = |folder: &Path| {
        let path = folder.join("split_1.mcap.zstd");
        let bytes = zstd::decode_all(fs::File::open(&path).expect("a file")).expect("unpacked");
        // A recorder that is killed does not write the footer and the index, the last bytes of a file.
        let index = mcap::Summary::read(&bytes).expect("an index").expect("an index");
        let end = usize::try_from(index.chunk_indexes[0].chunk_start_offset).expect("an offset");
        fs::write(&path, &bytes[..end]).expect("written");
    };
    let (folder, refused) = changed(cut);
    assert_refused(&refused.expect_err("not closed"), "recording/unfinished", "");
    let accepting = ReadOptions { allow_unfinished: true, ..ReadOptions::default() };
    let found = Whole::read(folder.path(), &accepting).expect("accepted");
    assert!(
        found.samples().len() < passing().len() && passing().starts_with(&found.samples()),
        "{:?}",
        found.samples()
    );
    let counted = format!("its files have {} messages, but metadata.yaml counts 21", found.samples().len() / 2);
    for note in ["the recording was not closed", &counted] {
        assert!(found.notes.iter().any(|said| said.starts_with(note)), "{:?}", found.notes);
    }
    // A bag with closed files and a wrong message count has lost messages.
    let short = changed(|folder| edit(&folder.join("metadata.yaml"), |text| text.replace("t: 21", "t: 22"))).0;
    assert!(Whole::read(short.path(), &accepting).is_err());
}

#[test]
fn splits_are_read_in_listed_order_and_sorted_by_time() {
    let (_folder, swapped) = changed(|folder| {
        edit(&folder.join("metadata.yaml"), |text| {
            let (head, tail) = text.split_once("relative_file_paths:").expect("a list");
            let tail = tail
                .replacen("split_0", "split_x", 1)
                .replacen("split_1", "split_0", 1)
                .replacen("split_x", "split_1", 1);
            format!("{head}relative_file_paths:{tail}")
        });
    });
    let swapped = swapped.expect("read");
    assert_eq!(swapped.samples(), passing());
    assert!(swapped.notes.iter().any(|note| note.contains("sorted")), "{:?}", swapped.notes);
}

#[test]
fn transform_chain_leads_to_the_map_frame() {
    let alone = Whole::read(&bag("robot"), &ReadOptions::default()).expect("read");
    assert_eq!((alone.vehicles.clone(), alone.assumed), (vec!["/odom".to_owned()], None));
    assert_eq!(alone.items.len(), 21);
    // Odometry moves along x of a frame that is rotated by a quarter turn and moves along y of the map at the same
    // speed.
    for (topics, name) in [(vec![], "/odom"), (vec!["/tf"], "base_link")] {
        let found = Whole::read(&bag("robot"), &options(Some("map"), &topics)).expect("read");
        assert_eq!(found.vehicles, [name]);
        assert_eq!(found.items.len(), 21);
        for (time_s, _, [x, y, z]) in found.samples() {
            assert!(x.abs() < ROUNDING_M && (y - 2.0 * time_s).abs() < ROUNDING_M && z == 0.0, "{time_s}: {x} {y} {z}");
        }
        assert_eq!(found.assumed.as_deref(), Some("transforms uniform between their samples"));
        let counted =
            "5 by transforms at their time, 16 by interpolation between two samples at most 1 s apart; 0 omitted";
        assert!(found.notes.iter().any(|note| note.contains(counted)), "{:?}", found.notes);
    }
    let direct = Whole::read(&bag("robot"), &options(None, &["/tf"])).expect("read");
    assert_eq!((direct.vehicles, direct.items, direct.assumed), (vec!["base_link".to_owned()], alone.items, None));
}

#[test]
fn constant_transforms_are_exact() {
    let messages = [
        ("/tf_static", TF, "cdr", 1, transform(0, "map", "room", [10.0, 0.0, 0.0], QUARTER)),
        ("/room/pose", POSE, "cdr", 2, pose(1, "room", [1.0, 2.0, 3.0])),
        ("/hall/pose", POSE, "cdr", 3, pose(1, "map", [5.0, 5.0, 5.0])),
        ("/far/pose", POSE, "cdr", 3, pose(1, "elsewhere", [5.0, 5.0, 5.0])),
    ];
    let error = refused(&messages, &ReadOptions::default());
    assert_refused(&error, "recording/several-frames", "message 3 on topic `/hall/pose`");
    let found = read(&mcap_of(&messages), &in_frame("map"));
    let samples = found.samples();
    assert_eq!((found.vehicles.len(), samples[1], &found.assumed), (2, (1e-9, "/hall/pose", [5.0; 3]), &None));
    let error = [8.0, 1.0, 3.0].iter().zip(samples[0].2).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(error < ROUNDING_M, "{samples:?}");
    assert!(
        found.notes.iter().any(|note| note.ends_with("lead to `map`: /far/pose in elsewhere")),
        "{:?}",
        found.notes
    );
    // The inverse transform is equally accurate.
    let back = read(&mcap_of(&messages), &in_frame("room")).samples()[1].2;
    assert!([5.0, 5.0, 5.0].iter().zip(back).all(|(a, b)| (a - b).abs() < ROUNDING_M), "{back:?}");
}

#[test]
fn position_is_omitted_if_a_transform_is_unknown() {
    let moving = |ns, x| ("/tf", TF, "cdr", 1, transform(ns, "map", "odom", [x, 0.0, 0.0], NO_TURN));
    let at = |ns| ("/odom", ODOMETRY, "cdr", 2, odometry(ns, "odom", "base_link", [0.0; 3]));
    let messages = [moving(100, 1.0), moving(200, 2.0), at(50), at(100), at(150), at(201)];
    let found = read(&mcap_of(&messages), &in_frame("map"));
    let samples: Vec<_> = found.samples().iter().map(|(t, _, [x, ..])| (*t, *x)).collect();
    assert_eq!(samples, [(100e-9, 1.0), (150e-9, 1.5)]);
    assert!(found.notes.iter().any(|note| note.contains("1 by interpolation") && note.contains("2 omitted")));
    // Samples more than 1 s apart are not interpolated.
    let late = ("/tf", TF, "cdr", 9, cdr(&(vec![(((SEC + 2, 0), "map"), "odom", ([0.0; 3], NO_TURN))],), true));
    assert_refused(&refused(&[moving(0, 1.0), late, at(150)], &in_frame("map")), "recording/unusable-frame", "");
    let message = "message 4 on topic `/tf`";
    for (odd, code, place) in [
        (transform(300, "map", "odom", [0.0; 3], [0.0; 4]), "recording/transforms", message),
        (transform(300, "map", "odom", [f64::NAN, 0.0, 0.0], NO_TURN), "recording/not-finite", message),
        (transform(200, "map", "odom", [0.0; 3], NO_TURN), "recording/transforms", ""),
        (transform(300, "world", "odom", [0.0; 3], NO_TURN), "recording/transforms", ""),
    ] {
        let all = [moving(100, 1.0), moving(200, 2.0), at(150), ("/tf", TF, "cdr", 5, odd)];
        assert_refused(&refused(&all, &in_frame("map")), code, place);
    }
}

#[test]
fn vehicle_on_two_topics_requires_the_topic_option() {
    let named = cdr(&(header(1), vec![("cf1", ([1.0, 0.0, 0.0], NO_TURN))]), true);
    let poses = ("/poses", NAMED, "cdr", 1, named);
    for other in
        [("/cf1/pose", POSE, "cdr", 1, pose(1, "map", [1.0, 0.0, 0.0])), ("/more", NAMED, "cdr", 1, poses.4.clone())]
    {
        let both = [poses.clone(), other];
        let error = refused(&both, &ReadOptions::default());
        assert_refused(&error, "recording/ambiguous-topics", "");
        assert!(error.to_string().ends_with("`cf1`"), "{error}");
        assert_eq!(read(&mcap_of(&both), &options(None, &["/poses"])).vehicles, ["cf1"]);
    }
    let robot = [
        ("/r1/odom", ODOMETRY, "cdr", 1, odometry(1, "map", "base_link", [0.0; 3])),
        ("/r1/pose", POSE, "cdr", 1, pose(1, "map", [0.0; 3])),
    ];
    assert_refused(&refused(&robot, &ReadOptions::default()), "recording/ambiguous-topics", "");
    // A vehicle described only by transforms is not omitted silently.
    let stranger = ("/tf", TF, "cdr", 1, transform(1, "map", "cf2", [0.0; 3], NO_TURN));
    assert_refused(&refused(&[poses, stranger], &ReadOptions::default()), "recording/ambiguous-topics", "");
}

#[test]
fn local_frames_of_several_robots_are_refused() {
    let both = [
        ("/r1/odom", ODOMETRY, "cdr", 1, odometry(1, "odom", "base_link", [0.0; 3])),
        ("/r2/odom", ODOMETRY, "cdr", 1, odometry(1, "odom", "base_link", [0.0; 3])),
    ];
    assert_refused(&refused(&both, &ReadOptions::default()), "recording/several-frames", "");
    assert_eq!(read(&mcap_of(&both), &in_frame("odom")).vehicles.len(), 2);
    let tf = |topic, x| (topic, TF, "cdr", 1, transform(1, "map", "odom", [x, 0.0, 0.0], NO_TURN));
    let [one, two] = both;
    let found = read(&mcap_of(&[one, two, tf("/r1/tf", 1.0), tf("/r2/tf", 2.0)]), &in_frame("map"));
    assert_eq!(found.samples(), [(1e-9, "/r1/odom", [1.0, 0.0, 0.0]), (1e-9, "/r2/odom", [2.0, 0.0, 0.0])]);
}

#[test]
fn transforms_of_all_topics_form_one_tree() {
    let kind = "geometry_msgs/msg/TransformStamped";
    let at = |topic, child: &'static str| (topic, kind, "cdr", 1, cdr(&(header(1), child, ([1.0; 3], NO_TURN)), true));
    let found = whole("vicon.mcap", &mcap_of(&[at("/vicon/cf1/cf1", "cf1"), at("/vicon/cf2/cf2", "vicon/cf2/cf2")]));
    assert_eq!(found.vehicles, ["cf1", "vicon/cf2/cf2"]);
}

#[test]
fn robots_in_namespaces_are_named_by_namespace_and_frame() {
    let robot = |topic, x| {
        [
            (topic, TF, "cdr", 1, transform(1, "map", "odom", [x, 0.0, 0.0], NO_TURN)),
            (topic, TF, "cdr", 2, transform(1, "odom", "base_link", [0.0, 1.0, 0.0], NO_TURN)),
            (topic, TF, "cdr", 3, transform(1, "base_link", "wheel", [0.0, 0.0, 9.0], NO_TURN)),
        ]
    };
    let messages = [robot("/r1/tf", 1.0), robot("/r2/tf", 2.0)].concat();
    assert_refused(&refused(&messages, &ReadOptions::default()), "recording/several-frames", "");
    let found = read(&mcap_of(&messages), &in_frame("map"));
    assert_eq!(found.samples(), [(1e-9, "/r1/base_link", [1.0, 1.0, 0.0]), (1e-9, "/r2/base_link", [2.0, 1.0, 0.0])]);
    assert_eq!(found.assumed, None);
}
