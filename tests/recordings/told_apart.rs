//! Who is who in messages of others, and where: what does not say it is refused, and never judged as somebody else.

use tautline::read::ReadOptions;

use crate::messages::{Message, NO_TURN, cdr, header, mcap_of, read_bytes, whole};

const POSE: &str = "geometry_msgs/msg/PoseStamped";
const POSES: &str = "geometry_msgs/msg/PoseArray";
const FIX: &str = "sensor_msgs/msg/NavSatFix";

fn pose(topic: &'static str, frame: &str, nanosec: u32, x: f64) -> Message {
    let message = ((header(nanosec).0, frame), ([x, 0.0, 0.0], NO_TURN));
    (topic, POSE, "cdr", u64::from(nanosec), cdr(&message, true))
}

fn fix(topic: &'static str, nanosec: u32, place: [f64; 3]) -> Message {
    let message = ((header(nanosec).0, "gps"), (0_i8, 1_u16), place);
    (topic, FIX, "cdr", u64::from(nanosec), cdr(&message, true))
}

fn list(nanosec: u32, xs: &[f64]) -> Message {
    let poses: Vec<_> = xs.iter().map(|&x| ([x, 0.0, 0.0], NO_TURN)).collect();
    ("/poses", POSES, "cdr", u64::from(nanosec), cdr(&(header(nanosec), poses), true))
}

fn refused(messages: &[Message], options: &ReadOptions) -> String {
    read_bytes("ros.mcap", &mcap_of(messages), options).expect_err("refused").to_string()
}

fn framed(frame: &str) -> ReadOptions {
    ReadOptions { frame: Some(frame.to_owned()), ..ReadOptions::default() }
}

#[test]
fn a_list_that_gets_shorter_does_not_say_who_was_lost() {
    let said = refused(&[list(1, &[0.0, 3.0, 6.0]), list(2, &[3.0, 6.0])], &ReadOptions::default());
    assert!(
        said.contains("message 2 on topic `/poses`") && said.contains("it lists 2 poses, and those before 3"),
        "{said}"
    );
    // An empty one says that nobody was seen.
    let found = whole("ros.mcap", &mcap_of(&[list(1, &[0.0, 3.0]), list(2, &[]), list(3, &[0.0, 3.0])]));
    assert_eq!(found.samples().len(), 4);
}

#[test]
fn a_goal_is_no_vehicle() {
    let goal = [pose("/cf1/pose", "world", 1, 0.0), pose("/cf1/goal_pose", "world", 1, 0.1)];
    let said = refused(&goal, &ReadOptions::default());
    assert!(said.contains("`/cf1/goal_pose` and `/cf1/pose` both tell of `/cf1`"), "{said}");
    let topics = vec!["/cf1/pose".to_owned()];
    let alone = ReadOptions { topics, ..ReadOptions::default() };
    assert_eq!(read_bytes("ros.mcap", &mcap_of(&goal), &alone).expect("read").vehicles, ["/cf1/pose"]);
    let two = whole("ros.mcap", &mcap_of(&[pose("/mocap/cf1", "world", 1, 0.0), pose("/mocap/cf2", "world", 1, 3.0)]));
    assert_eq!(two.vehicles, ["/mocap/cf1", "/mocap/cf2"]);
}

#[test]
fn degrees_are_never_metres() {
    let fixes = [fix("/r1/fix", 1, [47.0, 8.0, 400.0]), fix("/r2/fix", 2, [47.0, 8.0001, 400.0])];
    let said = refused(&fixes, &framed("WGS 84"));
    assert!(said.contains("latitudes and longitudes"), "{said}");
    let found = whole("ros.mcap", &mcap_of(&fixes));
    let (_, _, [east_m, ..]) = found.samples()[1];
    assert!((east_m - 7.606).abs() < 1e-3, "{east_m}");
    let called = refused(&[pose("/cf1/pose", "WGS 84", 1, 0.0)], &ReadOptions::default());
    assert!(called.contains("its frame is called `WGS 84`"), "{called}");
}

#[test]
fn the_origin_is_a_place_that_is_read() {
    let fixes = [fix("/base/fix", 1, [f64::NAN, 8.0, 400.0]), fix("/r2/fix", 2, [47.0, 8.0, 400.0])];
    let topics = vec!["/r2/fix".to_owned()];
    let one = ReadOptions { topics, ..ReadOptions::default() };
    let found = read_bytes("ros.mcap", &mcap_of(&fixes), &one).expect("the other is not read");
    assert_eq!(found.samples()[0].2, [0.0; 3]);
}

#[test]
fn local_positions_of_autopilots_are_each_counted_from_its_own_start() {
    let local = ["/uav1/mavros/local_position/pose", "/uav2/mavros/local_position/pose"];
    let messages = local.map(|topic| pose(topic, "map", 1, 0.0));
    let said = refused(&messages, &ReadOptions::default());
    assert!(said.contains("of which each robot has one of its own as a rule"), "{said}");
    assert_eq!(read_bytes("ros.mcap", &mcap_of(&messages), &framed("map")).expect("read").vehicles, local);
}

#[test]
fn a_frame_that_stands_still_and_moves_is_nobodys_place() {
    let transform = |topic, nanosec: u32, x: f64| -> Message {
        let of = |child: &str| (header(nanosec), child.to_owned(), ([x, 0.0, 0.0], NO_TURN));
        (topic, "tf2_msgs/msg/TFMessage", "cdr", u64::from(nanosec), cdr(&(vec![of("r1/base_link")],), true))
    };
    let torn = [transform("/tf_static", 1, 0.0), transform("/tf", 2, 1.0), transform("/tf", 3, 2.0)];
    let said = refused(&torn, &ReadOptions::default());
    assert!(said.contains("stands still in more than one place, or moves as well"), "{said}");
}
