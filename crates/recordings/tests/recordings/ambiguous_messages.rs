//! Messages of foreign recordings with ambiguous vehicles, frames or setpoints are refused.

use tautline_recordings::read::ReadOptions;

use crate::messages::{Message, NO_TURN, cdr, header, mcap_of, read_bytes, whole};
use crate::recording::assert_refused;

const POSE: &str = "geometry_msgs/msg/PoseStamped";
const POSES: &str = "geometry_msgs/msg/PoseArray";
const FIX: &str = "sensor_msgs/msg/NavSatFix";
const AMBIGUOUS: &str = "recording/ambiguous-topics";

fn pose(topic: &'static str, frame: &str, nanosec: u32, x: f64) -> Message {
    let message = ((header(nanosec).0, frame), ([x, 0.0, 0.0], NO_TURN));
    (topic, POSE, "cdr", u64::from(nanosec), cdr(&message, true))
}

fn fix(topic: &'static str, nanosec: u32, place: [f64; 3]) -> Message {
    let message = ((header(nanosec).0, "gps"), (0_i8, 1_u16), place);
    (topic, FIX, "cdr", u64::from(nanosec), cdr(&message, true))
}

fn list(topic: &'static str, nanosec: u32, xs: &[f64]) -> Message {
    let poses: Vec<_> = xs.iter().map(|&x| ([x, 0.0, 0.0], NO_TURN)).collect();
    (topic, POSES, "cdr", u64::from(nanosec), cdr(&(header(nanosec), poses), true))
}

/// Asserts the code and the place of an error.
#[track_caller]
fn refused(messages: &[Message], options: &ReadOptions, code: &str, place: &str) {
    assert_refused(&read_bytes("ros.mcap", &mcap_of(messages), options).expect_err("refused"), code, place);
}

fn transform(topic: &'static str, nanosec: u32, parent: &str, child: &str, x: f64) -> Message {
    let of = ((header(nanosec).0, parent), child, ([x, 0.0, 0.0], NO_TURN));
    (topic, "tf2_msgs/msg/TFMessage", "cdr", u64::from(nanosec), cdr(&(vec![of],), true))
}

fn naming(topics: &[&str]) -> ReadOptions {
    ReadOptions { topics: topics.iter().map(|topic| (*topic).to_owned()).collect(), ..ReadOptions::default() }
}

fn framed(frame: &str) -> ReadOptions {
    ReadOptions { frame: Some(frame.to_owned()), ..ReadOptions::default() }
}

#[test]
fn pose_lists_of_changing_length_are_refused() {
    let shorter = [list("/poses", 1, &[0.0, 3.0, 6.0]), list("/poses", 2, &[3.0, 6.0])];
    refused(&shorter, &ReadOptions::default(), "recording/list-length", "message 2 on topic `/poses`");
    // An empty list contains no vehicle.
    let lists = [(1, &[0.0, 3.0][..]), (2, &[]), (3, &[0.0, 3.0])].map(|(ns, xs)| list("/poses", ns, xs));
    let found = whole("ros.mcap", &mcap_of(&lists));
    assert_eq!(found.samples().len(), 4);
}

#[test]
fn goal_is_not_a_vehicle() {
    let goal = [pose("/cf1/pose", "world", 1, 0.0), pose("/cf1/goal_pose", "world", 1, 0.1)];
    refused(&goal, &ReadOptions::default(), AMBIGUOUS, "");
    assert_eq!(read_bytes("ros.mcap", &mcap_of(&goal), &naming(&["/cf1/pose"])).expect("read").vehicles, ["/cf1/pose"]);
    let two = whole("ros.mcap", &mcap_of(&[pose("/mocap/cf1", "world", 1, 0.0), pose("/mocap/cf2", "world", 1, 3.0)]));
    assert_eq!(two.vehicles, ["/mocap/cf1", "/mocap/cf2"]);
}

#[test]
fn setpoint_in_any_topic_part_is_not_a_vehicle() {
    for [position, setpoint] in [
        ["/uav1/mavros/local_position/pose", "/uav1/mavros/setpoint_position/local"],
        ["/uav1/pose", "/uav1/setpoint/pose"],
        ["/drone0/self_localization/pose", "/drone0/motion_reference/pose"],
        ["/firefly/odometry_sensor1/pose", "/firefly/command/pose"],
        ["/optitrack/cf1", "/planner/cf1/goals"],
        ["/robot/pose", "/clicked_point"],
    ] {
        let both = [pose(position, "world", 1, 0.0), pose(setpoint, "world", 1, 9.0)];
        let error = read_bytes("ros.mcap", &mcap_of(&both), &ReadOptions::default()).expect_err(setpoint);
        assert_refused(&error, AMBIGUOUS, "");
        let found = read_bytes("ros.mcap", &mcap_of(&both), &naming(&[position])).expect("read");
        assert_eq!(found.vehicles, [position]);
    }
    // The same holds for lists and transforms beside setpoints.
    let setpoint = || pose("/swarm/cf1/setpoint/pose", "world", 1, 0.0);
    for other in [list("/swarm/poses", 1, &[0.0, 3.0]), transform("/tf", 1, "world", "cf1", 0.0)] {
        refused(&[setpoint(), other], &ReadOptions::default(), AMBIGUOUS, "");
    }
    // Setpoints are judged if there are no other positions.
    let targets = ["/target_1/pose", "/target_2/pose"];
    let found = whole("ros.mcap", &mcap_of(&targets.map(|topic| pose(topic, "world", 1, 0.0))));
    assert_eq!(found.vehicles, targets);
    assert!(found.notes.iter().any(|note| note.ends_with("not of measured positions: /target_1/pose, /target_2/pose")));
}

#[test]
fn topic_option_accepts_setpoint_names() {
    for topics in [["/chaser", "/target"], ["/chaser/pose", "/goal/pose"], ["/uav1/pose", "/uav1/ref"]] {
        let both = topics.map(|topic| pose(topic, "world", 1, 0.0));
        assert!(read_bytes("ros.mcap", &mcap_of(&both), &ReadOptions::default()).is_err());
        let found = read_bytes("ros.mcap", &mcap_of(&both), &naming(&topics)).expect("read");
        assert_eq!(found.vehicles, topics);
        assert!(!found.notes.iter().any(|note| note.contains("asked to be")), "{:?}", found.notes);
    }
    let of_other_kinds = [pose("/mocap/cf1", "world", 1, 0.0), fix("/mocap/cf2", 1, [47.0, 8.0, 400.0])];
    refused(&of_other_kinds, &ReadOptions::default(), AMBIGUOUS, "");
    let both = naming(&["/mocap/cf1", "/mocap/cf2"]);
    refused(&of_other_kinds, &both, "recording/several-frames", "message 2 on topic `/mocap/cf2`");
}

#[test]
fn ignored_topics_have_no_effect() {
    let vehicles = ["/uav1/pose", "/uav2/pose"];
    let of_others = [
        [list("/people", 1, &[0.0, 3.0]), list("/people", 2, &[0.0])],
        [pose("/earth", "WGS 84", 1, 0.0), pose("/earth", "WGS 84", 2, 0.0)],
        [("/torn", POSE, "cdr", 1, vec![0, 1, 0, 0, 7]), ("/odd", POSE, "json", 1, b"{}".to_vec())],
        [transform("/tf", 1, "map", "base_link", 0.0), transform("/tf", 2, "odom", "base_link", 1.0)],
    ];
    for others in of_others {
        let mut messages = vehicles.map(|topic| pose(topic, "world", 1, 0.0)).to_vec();
        messages.extend(others);
        let bytes = mcap_of(&messages);
        let name = messages[3].0;
        assert!(read_bytes("ros.mcap", &bytes, &ReadOptions::default()).is_err(), "{name}");
        let found =
            read_bytes("ros.mcap", &bytes, &naming(&vehicles)).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(found.vehicles, vehicles);
        assert!(read_bytes("ros.mcap", &bytes, &naming(&[name])).is_err(), "{name}");
    }
    let messages = [pose("/a", "world", 1, 0.0), list("/b", 1, &[0.0])];
    refused(&messages, &naming(&["/c"]), "recording/unknown-topic", "");
}

#[test]
fn degrees_and_metres_are_not_mixed() {
    let fixes = [fix("/r1/fix", 1, [47.0, 8.0, 400.0]), fix("/r2/fix", 2, [47.0, 8.0001, 400.0])];
    refused(&fixes, &framed("WGS 84"), "recording/unusable-frame", "message 1 on topic `/r1/fix`");
    let found = whole("ros.mcap", &mcap_of(&fixes));
    let (_, _, [east_m, ..]) = found.samples()[1];
    assert!((east_m - 7.606).abs() < 1e-3, "{east_m}");
    let named = [pose("/cf1/pose", "WGS 84", 1, 0.0)];
    refused(&named, &ReadOptions::default(), "recording/unusable-frame", "message 1 on topic `/cf1/pose`");
}

#[test]
fn origin_is_the_first_place_that_is_read() {
    let fixes = [fix("/base/fix", 1, [f64::NAN, 8.0, 400.0]), fix("/r2/fix", 2, [47.0, 8.0, 400.0])];
    let found = read_bytes("ros.mcap", &mcap_of(&fixes), &naming(&["/r2/fix"])).expect("the other is not read");
    assert_eq!(found.samples()[0].2, [0.0; 3]);
}

#[test]
fn local_positions_of_several_autopilots_are_refused() {
    let local = ["/uav1/mavros/local_position/pose", "/uav2/mavros/local_position/pose"];
    let messages = local.map(|topic| pose(topic, "map", 1, 0.0));
    refused(&messages, &ReadOptions::default(), "recording/several-frames", "");
    assert_eq!(read_bytes("ros.mcap", &mcap_of(&messages), &framed("map")).expect("read").vehicles, local);
}

#[test]
fn frame_with_constant_and_moving_poses_is_refused() {
    let torn = [("/tf_static", 1, 0.0), ("/tf", 2, 1.0), ("/tf", 3, 2.0)];
    let torn = torn.map(|(topic, nanosec, x)| transform(topic, nanosec, "map", "r1/base_link", x));
    refused(&torn, &ReadOptions::default(), "recording/transforms", "");
}
