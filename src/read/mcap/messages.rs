//! Messages of others that hold positions: Foxglove in protobuf and JSON, ROS 2 in CDR.

use nalgebra::Vector3;
use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::record::mcap::topic::{CDR, decode};

/// Reads a message in an encoding; the error says what is wrong with it.
pub(super) type Reader = fn(encoding: &str, bytes: &[u8]) -> Result<Vec<Seen>, String>;

/// What reads the messages of a schema, where they hold positions.
pub(super) fn reader_of(schema: &str) -> Option<Reader> {
    let reader: Reader = match schema {
        "foxglove.PoseInFrame" => {
            |encoding, bytes| foxglove(encoding, bytes).map(|pose: PoseInFrame| vec![pose.seen()])
        }
        "foxglove.PosesInFrame" => |encoding, bytes| foxglove(encoding, bytes).map(PosesInFrame::seen),
        "foxglove.FrameTransform" => {
            |encoding, bytes| foxglove(encoding, bytes).map(|transform: FrameTransform| vec![transform.seen()])
        }
        "foxglove.FrameTransforms" => |encoding, bytes| {
            let transforms = foxglove(encoding, bytes).map(|message: FrameTransforms| message.transforms);
            Ok(transforms?.into_iter().map(FrameTransform::seen).collect())
        },
        "geometry_msgs/msg/PoseStamped" => |encoding, bytes| {
            let (header, pose): (RosHeader, RosPose) = ros(encoding, bytes)?;
            Ok(vec![ros_seen(Who::Topic, &header, &pose)])
        },
        "geometry_msgs/msg/PoseArray" => |encoding, bytes| {
            let (header, poses): (RosHeader, Vec<RosPose>) = ros(encoding, bytes)?;
            Ok((1..).zip(&poses).map(|(number, pose)| ros_seen(Who::Listed(number), &header, pose)).collect())
        },
        "geometry_msgs/msg/TransformStamped" => |encoding, bytes| {
            let (header, child, transform): RosTransform = ros(encoding, bytes)?;
            Ok(vec![ros_seen(Who::Named(child), &header, &transform)])
        },
        "tf2_msgs/msg/TFMessage" => |encoding, bytes| {
            let (transforms,): (Vec<RosTransform>,) = ros(encoding, bytes)?;
            let seen = |(header, child, transform)| ros_seen(Who::Named(child), &header, &transform);
            Ok(transforms.into_iter().map(seen).collect())
        },
        _ => return None,
    };
    Some(reader)
}

/// A position as a message says it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Seen {
    /// Whose: a frame's name, or the place in a list of poses from 1; none where the topic itself is the vehicle.
    pub(super) who: Who,
    /// The frame that the position is given in.
    pub(super) frame: String,
    /// Since the clock's zero \[ns\]; 0 where the message does not say.
    pub(super) stamp_ns: i64,
    pub(super) position: Vector3<f64>,
}

/// Which vehicle a message speaks of.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Who {
    Topic,
    Listed(usize),
    Named(String),
}

fn foxglove<T: prost::Message + Default + DeserializeOwned>(encoding: &str, bytes: &[u8]) -> Result<T, String> {
    match encoding {
        "protobuf" => T::decode(bytes).map_err(|error| error.to_string()),
        "json" => serde_json::from_slice(bytes).map_err(|error| error.to_string()),
        _ => Err("Foxglove messages are read in protobuf and JSON, not in CDR".to_owned()),
    }
}

fn ros<T: DeserializeOwned>(encoding: &str, bytes: &[u8]) -> Result<T, String> {
    if encoding == CDR { decode(bytes) } else { Err("ROS 2 messages are read in CDR alone".to_owned()) }
}

fn nanoseconds(seconds: i64, nanoseconds: i64) -> i64 {
    seconds.saturating_mul(1_000_000_000).saturating_add(nanoseconds)
}

#[derive(Clone, Copy, PartialEq, prost::Message, Deserialize)]
#[serde(default)]
struct Timestamp {
    #[prost(int64, tag = "1")]
    #[serde(alias = "sec")]
    seconds: i64,
    #[prost(int32, tag = "2")]
    #[serde(alias = "nsec")]
    nanos: i32,
}

#[derive(Clone, Copy, PartialEq, prost::Message, Deserialize)]
#[serde(default)]
struct Vec3 {
    #[prost(double, tag = "1")]
    x: f64,
    #[prost(double, tag = "2")]
    y: f64,
    #[prost(double, tag = "3")]
    z: f64,
}

#[derive(Clone, Copy, PartialEq, prost::Message, Deserialize)]
#[serde(default)]
struct Pose {
    #[prost(message, optional, tag = "1")]
    position: Option<Vec3>,
}

/// What a Foxglove message does not say is 0.
fn foxglove_seen(who: Who, frame: String, timestamp: Option<Timestamp>, position: Option<Vec3>) -> Seen {
    let stamp_ns = timestamp.map_or(0, |stamp| nanoseconds(stamp.seconds, stamp.nanos.into()));
    let position = position.map_or_else(Vector3::zeros, |point| Vector3::new(point.x, point.y, point.z));
    Seen { who, frame, stamp_ns, position }
}

#[derive(Clone, PartialEq, prost::Message, Deserialize)]
#[serde(default)]
struct PoseInFrame {
    #[prost(message, optional, tag = "1")]
    timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    frame_id: String,
    #[prost(message, optional, tag = "3")]
    pose: Option<Pose>,
}

impl PoseInFrame {
    fn seen(self) -> Seen {
        foxglove_seen(Who::Topic, self.frame_id, self.timestamp, self.pose.and_then(|pose| pose.position))
    }
}

#[derive(Clone, PartialEq, prost::Message, Deserialize)]
#[serde(default)]
struct PosesInFrame {
    #[prost(message, optional, tag = "1")]
    timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    frame_id: String,
    #[prost(message, repeated, tag = "3")]
    poses: Vec<Pose>,
}

impl PosesInFrame {
    fn seen(self) -> Vec<Seen> {
        let seen = |(number, pose): (usize, &Pose)| {
            foxglove_seen(Who::Listed(number), self.frame_id.clone(), self.timestamp, pose.position)
        };
        (1..).zip(&self.poses).map(seen).collect()
    }
}

#[derive(Clone, PartialEq, prost::Message, Deserialize)]
#[serde(default)]
struct FrameTransform {
    #[prost(message, optional, tag = "1")]
    timestamp: Option<Timestamp>,
    #[prost(string, tag = "2")]
    parent_frame_id: String,
    #[prost(string, tag = "3")]
    child_frame_id: String,
    #[prost(message, optional, tag = "4")]
    translation: Option<Vec3>,
}

impl FrameTransform {
    fn seen(self) -> Seen {
        foxglove_seen(Who::Named(self.child_frame_id), self.parent_frame_id, self.timestamp, self.translation)
    }
}

#[derive(Clone, PartialEq, prost::Message, Deserialize)]
#[serde(default)]
struct FrameTransforms {
    #[prost(message, repeated, tag = "1")]
    transforms: Vec<FrameTransform>,
}

/// Seconds and nanoseconds, and the frame.
type RosHeader = ((i32, u32), String);

/// `Pose` and `Transform` alike: a position and a quaternion.
type RosPose = ([f64; 3], [f64; 4]);

/// `TransformStamped`: the name is that of the child frame.
type RosTransform = (RosHeader, String, RosPose);

fn ros_seen(who: Who, ((sec, nanosec), frame): &RosHeader, (position, _): &RosPose) -> Seen {
    let stamp_ns = nanoseconds((*sec).into(), (*nanosec).into());
    Seen { who, frame: frame.clone(), stamp_ns, position: (*position).into() }
}
