//! Foxglove's messages that hold positions, in protobuf and JSON.

use nalgebra::Vector3;
use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::messages::{NO_TURN, Reader, Seen, What, Who, nanoseconds};

/// What reads the messages of a schema, where they hold positions.
pub(super) fn reader_of(schema: &str) -> Option<Reader> {
    let reader: Reader = match schema {
        "foxglove.PoseInFrame" => |encoding, bytes| decoded(encoding, bytes).map(|pose: PoseInFrame| vec![pose.seen()]),
        "foxglove.PosesInFrame" => |encoding, bytes| decoded(encoding, bytes).map(PosesInFrame::seen),
        "foxglove.FrameTransform" => {
            |encoding, bytes| decoded(encoding, bytes).map(|transform: FrameTransform| vec![transform.seen()])
        }
        "foxglove.FrameTransforms" => |encoding, bytes| {
            let transforms = decoded(encoding, bytes).map(|message: FrameTransforms| message.transforms);
            Ok(transforms?.into_iter().map(FrameTransform::seen).collect())
        },
        _ => return None,
    };
    Some(reader)
}

fn decoded<T: prost::Message + Default + DeserializeOwned>(encoding: &str, bytes: &[u8]) -> Result<T, String> {
    match encoding {
        "protobuf" => T::decode(bytes).map_err(|error| error.to_string()),
        "json" => serde_json::from_slice(bytes).map_err(|error| error.to_string()),
        _ => Err("Foxglove messages are read in protobuf and JSON, not in CDR".to_owned()),
    }
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
struct Quaternion {
    #[prost(double, tag = "1")]
    x: f64,
    #[prost(double, tag = "2")]
    y: f64,
    #[prost(double, tag = "3")]
    z: f64,
    #[prost(double, tag = "4")]
    w: f64,
}

#[derive(Clone, Copy, PartialEq, prost::Message, Deserialize)]
#[serde(default)]
struct Pose {
    #[prost(message, optional, tag = "1")]
    position: Option<Vec3>,
}

/// What a Foxglove message does not say is 0.
fn seen(who: Who, frame: String, timestamp: Option<Timestamp>, position: Option<Vec3>) -> Seen {
    let stamp_ns = timestamp.map_or(0, |stamp| nanoseconds(stamp.seconds, stamp.nanos.into()));
    let position = position.map_or_else(Vector3::zeros, |point| Vector3::new(point.x, point.y, point.z));
    Seen { who, frame, stamp_ns, position, what: What::Pose }
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
        seen(Who::Topic, self.frame_id, self.timestamp, self.pose.and_then(|pose| pose.position))
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
        let one = |(number, pose): (usize, &Pose)| {
            seen(Who::Listed(number), self.frame_id.clone(), self.timestamp, pose.position)
        };
        (1..).zip(&self.poses).map(one).collect()
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
    #[prost(message, optional, tag = "5")]
    rotation: Option<Quaternion>,
}

impl FrameTransform {
    fn seen(self) -> Seen {
        let turn = self.rotation.map_or(NO_TURN, |q| [q.x, q.y, q.z, q.w]);
        let seen = seen(Who::Named(self.child_frame_id), self.parent_frame_id, self.timestamp, self.translation);
        Seen { what: What::Transform(turn), ..seen }
    }
}

#[derive(Clone, PartialEq, prost::Message, Deserialize)]
#[serde(default)]
struct FrameTransforms {
    #[prost(message, repeated, tag = "1")]
    transforms: Vec<FrameTransform>,
}
