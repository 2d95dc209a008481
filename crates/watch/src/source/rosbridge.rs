//! rosbridge: topics of ROS 1 and ROS 2 as JSON over a WebSocket.
//!
//! The protocol needs two kinds of messages, so this is a client over `tungstenite`. `roslibrust` would bring an
//! asynchronous runtime and generated types of messages. Only positions and plans of planners are read here.

use std::time::{SystemTime, UNIX_EPOCH};

use nalgebra::Vector3;
use serde_json::{Value, json};

use super::websocket::{Incoming, Protocol, websocket};
use super::{Feed, Input, Naming, NamingOptions, PlanMessage};
use crate::event::{MessageError, Problem};
use tautline_core::option::TOPIC;
use tautline_recordings::read::{LivePose, live_plans};

/// Connects to a server of rosbridge and subscribes to the topics of the options.
///
/// # Errors
/// A sentence if the address is wrong or no topic is given.
pub fn rosbridge(url: &str, options: NamingOptions, feed: Feed) -> Result<(), String> {
    if options.topics.is_empty() {
        let example = TOPIC.set("/cf1/pose");
        return Err(format!("rosbridge: no topic is given; give each with {TOPIC}, such as {example}"));
    }
    let topics = options.topics.clone();
    websocket(url, feed, Rosbridge { topics, naming: Naming::new(options) })
}

struct Rosbridge {
    topics: Vec<String>,
    naming: Naming,
}

impl Protocol for Rosbridge {
    fn names(&self) -> &'static [&'static str] {
        &[]
    }

    fn start(&mut self) -> Vec<String> {
        let subscribe = |topic: &String| json!({ "op": "subscribe", "topic": topic }).to_string();
        self.topics.iter().map(subscribe).collect()
    }

    fn take(&mut self, message: Incoming<'_>, arrival_s: f64, inputs: &mut Vec<Input>) -> Vec<String> {
        let read = match message {
            Incoming::Text(text) => inputs_of_message(text, &mut self.naming, arrival_s, inputs),
            Incoming::Binary(_) => Err(Problem::NotOfTopic),
        };
        let place = "rosbridge".to_owned();
        inputs.extend(read.err().map(|problem| Input::Garbage(MessageError { place, problem }, arrival_s)));
        Vec::new()
    }
}

/// Appends the poses or plans of a message of the server that arrived at a time \[s\], and the errors of those that
/// cannot be used.
///
/// # Errors
/// If the message is none of rosbridge, reports an error, or has neither positions nor plans.
pub fn inputs_of_message(
    text: &str,
    naming: &mut Naming,
    arrival_s: f64,
    inputs: &mut Vec<Input>,
) -> Result<(), Problem> {
    let of: Value = serde_json::from_str(text).map_err(|error| Problem::NotDecoded(error.to_string()))?;
    let topic = of["topic"].as_str().unwrap_or_default();
    match of["op"].as_str() {
        Some("publish") if !topic.is_empty() => {}
        Some("status") if of["level"] == "error" => return Err(Problem::ServerError(of["msg"].to_string())),
        Some("status") => return Ok(()),
        _ => return Err(Problem::NotOfTopic),
    }
    if let Some(plans) = live_plans(&of["msg"]) {
        match plans {
            Ok(plans) => {
                let arrival_ns = machine_ns();
                let message = |plan| PlanMessage { topic: topic.to_owned(), plan, arrival_s, arrival_ns };
                inputs.extend(plans.into_iter().map(message).map(Input::Plan));
            }
            Err(why) => {
                let error = MessageError { place: topic.to_owned(), problem: Problem::WrongPlan(why) };
                inputs.push(Input::Garbage(error, arrival_s));
            }
        }
        return Ok(());
    }
    let poses = live_poses(&of["msg"]).ok_or_else(|| Problem::NoPosition(topic.to_owned()))?;
    inputs.extend(poses.into_iter().filter_map(|pose| naming.input(topic, pose, arrival_s)));
    Ok(())
}

/// Returns the time of this machine since 1970 \[ns\].
fn machine_ns() -> i64 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)
}

/// Returns the positions of a message of ROS by its fields, as rosbridge does not send its type.
fn live_poses(message: &Value) -> Option<Vec<LivePose>> {
    if let Some(transforms) = message["transforms"].as_array() {
        return transforms.iter().map(transform).collect();
    }
    if let Some(poses) = message["poses"].as_array() {
        let one = |(number, of): (usize, &Value)| match of["name"].as_str() {
            Some(name) => pose(&message["header"], &of["pose"]["position"], Some(name.to_owned()), None),
            None => pose(&message["header"], &of["position"], None, Some(number)),
        };
        return (1..).zip(poses).map(one).collect();
    }
    if message["transform"].is_object() {
        return Some(vec![transform(message)?]);
    }
    if message["latitude"].is_number() {
        if message["status"]["status"].as_i64().is_some_and(|status| status < 0) || message["altitude"].is_null() {
            return Some(Vec::new());
        }
        let place = json!({ "x": message["latitude"], "y": message["longitude"], "z": message["altitude"] });
        let accuracy_m = fix_accuracy_m(message);
        return Some(vec![LivePose { is_on_earth: true, accuracy_m, ..pose(&message["header"], &place, None, None)? }]);
    }
    let place = [&message["pose"]["pose"]["position"], &message["pose"]["position"], &message["point"]];
    let place = place.into_iter().find(|of| of.is_object())?;
    Some(vec![pose(&message["header"], place, None, None)?])
}

/// Returns the standard deviation of a fix \[m\], unless its covariance is unknown.
fn fix_accuracy_m(message: &Value) -> Option<f64> {
    let is_known = message["position_covariance_type"].as_u64().is_some_and(|kind| kind > 0);
    let variances = [0, 4, 8].map(|k| message["position_covariance"][k].as_f64());
    let [Some(east), Some(north), Some(up)] =
        variances.map(|found| found.filter(|variance| is_known && *variance > 0.0))
    else {
        return None;
    };
    Some((east + north + up).sqrt())
}

fn transform(of: &Value) -> Option<LivePose> {
    let name = of["child_frame_id"].as_str()?.to_owned();
    let pose = pose(&of["header"], &of["transform"]["translation"], Some(name), None)?;
    Some(LivePose { is_transform: true, ..pose })
}

fn pose(header: &Value, place: &Value, name: Option<String>, number: Option<usize>) -> Option<LivePose> {
    let stamp = &header["stamp"];
    let part = |names: [&str; 2]| names.into_iter().find_map(|name| stamp[name].as_i64());
    let (seconds, nanoseconds) = (part(["sec", "secs"])?, part(["nanosec", "nsecs"])?);
    let axis = |name: &str| place[name].as_f64();
    Some(LivePose {
        name,
        number,
        frame: header["frame_id"].as_str()?.to_owned(),
        stamp_ns: seconds.saturating_mul(1_000_000_000).saturating_add(nanoseconds),
        position: Vector3::new(axis("x")?, axis("y")?, axis("z")?),
        accuracy_m: None,
        is_on_earth: false,
        is_transform: false,
    })
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::inputs_of_message;
    use crate::source::{Input, Naming, NamingOptions, OwnedPose};
    use tautline_recordings::read::EarthFrame;

    const HEADER: &str = r#""header":{"stamp":{"sec":3,"nanosec":500000000},"frame_id":"world"}"#;

    /// Returns the poses of a message without an error.
    fn poses_of(text: &str, naming: &mut Naming) -> Vec<OwnedPose> {
        let mut inputs = Vec::new();
        inputs_of_message(text, naming, 0.0, &mut inputs).expect(text);
        let pose = |input| if let Input::Pose(pose, _) = input { pose } else { panic!("{input:?}") };
        inputs.into_iter().map(pose).collect()
    }

    fn read(topic: &str, body: &str) -> Vec<(String, f64, Vector3<f64>)> {
        let mut naming = Naming::new(NamingOptions { frame: Some("world".to_owned()), ..NamingOptions::default() });
        let text = format!(r#"{{"op":"publish","topic":"{topic}","msg":{{{body}}}}}"#);
        poses_of(&text, &mut naming).into_iter().map(|of| (of.id, of.t_s, of.position_m)).collect()
    }

    #[test]
    fn positions_of_all_kinds_of_messages_are_read() {
        let place = r#"{"x":1,"y":2,"z":3}"#;
        let one = |id: &str| vec![(id.to_owned(), 3.5, Vector3::new(1.0, 2.0, 3.0))];
        let odometry = format!(r#"{HEADER},"pose":{{"pose":{{"position":{place}}}}}"#);
        let tf = format!(r#""transforms":[{{{HEADER},"child_frame_id":"cf5","transform":{{"translation":{place}}}}}]"#);
        for (topic, body, id) in [
            ("/cf1/pose", format!(r#"{HEADER},"pose":{{"position":{place}}}"#), "cf1"),
            ("/cf2/odom", odometry, "cf2"),
            ("/cf3/point", format!(r#"{HEADER},"point":{place}"#), "cf3"),
            ("/poses", format!(r#"{HEADER},"poses":[{{"name":"cf4","pose":{{"position":{place}}}}}]"#), "cf4"),
            ("/tf", tf, "cf5"),
            ("/swarm/poses", format!(r#"{HEADER},"poses":[{{"position":{place}}}]"#), "swarm/1"),
        ] {
            assert_eq!(read(topic, &body), one(id), "{body}");
        }
    }

    #[test]
    fn a_fix_has_the_accuracy_of_its_covariance_unless_it_is_unknown() {
        let earth = EarthFrame::new([47.0, 8.0, 400.0]).expect("an origin");
        let accuracy_m = |kind: u8| {
            let mut naming = Naming::new(NamingOptions { earth: Some(earth), ..NamingOptions::default() });
            let place = r#""latitude":47.0,"longitude":8.0,"altitude":401.0"#;
            let covariance = format!(r#""position_covariance":[1,0,0,0,4,0,0,0,4],"position_covariance_type":{kind}"#);
            let text = format!(r#"{{"op":"publish","topic":"/a/fix","msg":{{{HEADER},{place},{covariance}}}}}"#);
            poses_of(&text, &mut naming)[0].accuracy_m
        };
        assert_eq!((accuracy_m(2), accuracy_m(0)), (Some(3.0), None));
    }

    #[test]
    fn other_messages_are_errors() {
        let mut naming = Naming::new(NamingOptions::default());
        for text in [
            "",
            "[]",
            r#"{"op":"publish"}"#,
            r#"{"op":"publish","topic":"/a/b","msg":{"data":1}}"#,
            r#"{"op":"publish","topic":"/a/b","msg":{"pose":{"position":{"x":1,"y":2,"z":3}}}}"#,
            r#"{"op":"status","level":"error","msg":"no such topic"}"#,
        ] {
            assert!(inputs_of_message(text, &mut naming, 0.0, &mut Vec::new()).is_err(), "{text}");
        }
    }
}
