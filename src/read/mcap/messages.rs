//! Messages of others that hold positions: Foxglove in protobuf and JSON, ROS 2 in CDR.

use nalgebra::{Vector3, vector};
use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::record::mcap::topic::{CDR, decode};

/// Reads a message in an encoding; the error says what is wrong with it.
pub(super) type Reader = fn(encoding: &str, bytes: &[u8]) -> Result<Vec<Seen>, String>;

/// What reads the messages of a schema, where they hold positions.
pub(super) fn reader_of(schema: &str) -> Option<Reader> {
    Some(match schema {
        "foxglove.PoseInFrame" => foxglove::<PoseInFrame>,
        "foxglove.PosesInFrame" => foxglove::<PosesInFrame>,
        "foxglove.FrameTransform" => foxglove::<FrameTransform>,
        "foxglove.FrameTransforms" => foxglove::<FrameTransforms>,
        "geometry_msgs/msg/PoseStamped" => ros::<PoseStamped>,
        "geometry_msgs/msg/PoseArray" => ros::<PoseArray>,
        "geometry_msgs/msg/TransformStamped" => ros::<TransformStamped>,
        "tf2_msgs/msg/TFMessage" => ros::<TfMessage>,
        _ => return None,
    })
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

/// A message with positions.
trait Positions {
    fn seen(self) -> Vec<Seen>;
}

fn foxglove<T: prost::Message + Default + DeserializeOwned + Positions>(
    encoding: &str,
    bytes: &[u8],
) -> Result<Vec<Seen>, String> {
    let message = match encoding {
        "protobuf" => T::decode(bytes).map_err(|error| error.to_string()),
        "json" => serde_json::from_slice(bytes).map_err(|error| error.to_string()),
        _ => Err("Foxglove messages are read in protobuf and JSON, not in CDR".to_owned()),
    };
    message.map(T::seen)
}

fn ros<T: DeserializeOwned + Positions>(encoding: &str, bytes: &[u8]) -> Result<Vec<Seen>, String> {
    if encoding == CDR { decode(bytes).map(T::seen) } else { Err("ROS 2 messages are read in CDR alone".to_owned()) }
}

#[derive(Clone, PartialEq, prost::Message, Deserialize)]
#[serde(default)]
struct Timestamp {
    #[prost(int64, tag = "1")]
    #[serde(alias = "sec")]
    seconds: i64,
    #[prost(int32, tag = "2")]
    #[serde(alias = "nsec")]
    nanos: i32,
}

impl Timestamp {
    fn ns(stamp: Option<&Self>) -> i64 {
        stamp.map_or(0, |stamp| nanoseconds(stamp.seconds, stamp.nanos.into()))
    }
}

fn nanoseconds(seconds: i64, nanoseconds: i64) -> i64 {
    seconds.saturating_mul(1_000_000_000).saturating_add(nanoseconds)
}

#[derive(Clone, PartialEq, prost::Message, Deserialize)]
#[serde(default)]
struct Vec3 {
    #[prost(double, tag = "1")]
    x: f64,
    #[prost(double, tag = "2")]
    y: f64,
    #[prost(double, tag = "3")]
    z: f64,
}

#[derive(Clone, PartialEq, prost::Message, Deserialize)]
#[serde(default)]
struct Pose {
    #[prost(message, optional, tag = "1")]
    position: Option<Vec3>,
}

fn point(point: Option<&Vec3>) -> Vector3<f64> {
    point.map_or_else(Vector3::zeros, |point| vector![point.x, point.y, point.z])
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

impl Positions for PoseInFrame {
    fn seen(self) -> Vec<Seen> {
        let position = point(self.pose.as_ref().and_then(|pose| pose.position.as_ref()));
        let stamp_ns = Timestamp::ns(self.timestamp.as_ref());
        vec![Seen { who: Who::Topic, frame: self.frame_id, stamp_ns, position }]
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

impl Positions for PosesInFrame {
    fn seen(self) -> Vec<Seen> {
        let stamp_ns = Timestamp::ns(self.timestamp.as_ref());
        let seen = |(k, pose): (usize, &Pose)| Seen {
            who: Who::Listed(k + 1),
            frame: self.frame_id.clone(),
            stamp_ns,
            position: point(pose.position.as_ref()),
        };
        self.poses.iter().enumerate().map(seen).collect()
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

impl Positions for FrameTransform {
    fn seen(self) -> Vec<Seen> {
        let stamp_ns = Timestamp::ns(self.timestamp.as_ref());
        let position = point(self.translation.as_ref());
        vec![Seen { who: Who::Named(self.child_frame_id), frame: self.parent_frame_id, stamp_ns, position }]
    }
}

#[derive(Clone, PartialEq, prost::Message, Deserialize)]
#[serde(default)]
struct FrameTransforms {
    #[prost(message, repeated, tag = "1")]
    transforms: Vec<FrameTransform>,
}

impl Positions for FrameTransforms {
    fn seen(self) -> Vec<Seen> {
        self.transforms.into_iter().flat_map(FrameTransform::seen).collect()
    }
}

#[derive(Deserialize)]
struct RosTime {
    sec: i32,
    nanosec: u32,
}

#[derive(Deserialize)]
struct RosHeader {
    stamp: RosTime,
    frame_id: String,
}

impl RosHeader {
    fn seen(&self, who: Who, position: &[f64; 3]) -> Seen {
        let stamp_ns = nanoseconds(self.stamp.sec.into(), self.stamp.nanosec.into());
        Seen { who, frame: self.frame_id.clone(), stamp_ns, position: (*position).into() }
    }
}

/// `Pose` and `Transform` alike: a position and a quaternion.
#[derive(Deserialize)]
struct RosPose {
    position: [f64; 3],
    _orientation: [f64; 4],
}

#[derive(Deserialize)]
struct PoseStamped {
    header: RosHeader,
    pose: RosPose,
}

impl Positions for PoseStamped {
    fn seen(self) -> Vec<Seen> {
        vec![self.header.seen(Who::Topic, &self.pose.position)]
    }
}

#[derive(Deserialize)]
struct PoseArray {
    header: RosHeader,
    poses: Vec<RosPose>,
}

impl Positions for PoseArray {
    fn seen(self) -> Vec<Seen> {
        let seen = |(k, pose): (usize, &RosPose)| self.header.seen(Who::Listed(k + 1), &pose.position);
        self.poses.iter().enumerate().map(seen).collect()
    }
}

#[derive(Deserialize)]
struct TransformStamped {
    header: RosHeader,
    child_frame_id: String,
    transform: RosPose,
}

impl Positions for TransformStamped {
    fn seen(self) -> Vec<Seen> {
        vec![self.header.seen(Who::Named(self.child_frame_id), &self.transform.position)]
    }
}

#[derive(Deserialize)]
struct TfMessage {
    transforms: Vec<TransformStamped>,
}

impl Positions for TfMessage {
    fn seen(self) -> Vec<Seen> {
        self.transforms.into_iter().flat_map(TransformStamped::seen).collect()
    }
}
