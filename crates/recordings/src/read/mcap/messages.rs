//! Decodes positions from messages: ROS 2 in CDR, and Foxglove in protobuf and JSON.

use nalgebra::Vector3;
use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::mcap::topic::{CDR, DeclaredTopic, decode};

/// Decoder of messages in an encoding; the error describes the damage.
pub(super) type Reader = fn(encoding: &str, bytes: &[u8]) -> Result<Vec<Observation>, String>;

/// Frame name of positions on the Earth: latitude, longitude \[degrees\] and height \[m\].
pub(super) const EARTH: &str = "WGS 84";

/// Schema of positions on the Earth.
pub(super) const FIXES: &str = "sensor_msgs/msg/NavSatFix";

/// Quaternion of no rotation.
pub(super) const NO_TURN: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

/// Position in a message.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Observation {
    pub(super) vehicle: VehicleKey,
    /// Frame of the position.
    pub(super) frame: String,
    /// Time since the epoch of the clock \[ns\]; 0 if the message has none.
    pub(super) stamp_ns: i64,
    pub(super) position: Vector3<f64>,
    pub(super) kind: PoseKind,
}

/// Identification of the vehicle of a position.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum VehicleKey {
    /// The topic is the vehicle.
    Topic,
    /// Index in a list of poses, from 1.
    Listed(usize),
    /// Name in the message.
    Named(String),
}

/// Kind of a position.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum PoseKind {
    Pose,
    /// Pose of a robot's own frame, with the name of that frame.
    Odometry(String),
    /// Pose of a frame in its parent, with the quaternion x, y, z, w of its rotation.
    Transform([f64; 4]),
}

/// Position in a message of a live source.
#[derive(Clone, Debug, PartialEq)]
pub struct LivePose {
    /// Name in the message; `None` if the topic is the vehicle.
    pub name: Option<String>,
    /// Index in a list of poses without names, from 1.
    pub number: Option<usize>,
    /// Frame of the position.
    pub frame: String,
    /// Time since the epoch of the clock \[ns\]; 0 if the message has none.
    pub stamp_ns: i64,
    /// Position \[m\]; latitude, longitude \[degrees\] and height \[m\] if `is_on_earth`.
    pub position: Vector3<f64>,
    /// Standard deviation of the position \[m\], if the message has it.
    pub accuracy_m: Option<f64>,
    /// Whether the position is a place on the Earth.
    pub is_on_earth: bool,
    /// Whether the position is a transform between two frames. Some frames are no vehicles.
    pub is_transform: bool,
}

/// Returns whether [`live_poses`] reads messages of a schema in an encoding.
#[must_use]
pub fn has_live_poses(schema: &str, encoding: &str) -> bool {
    reader_of(schema).is_some() && matches!(encoding, "protobuf" | "json" | CDR)
}

/// Decodes the positions of one message of a live source.
///
/// # Errors
/// A sentence if the message is damaged or its schema is not read.
pub fn live_poses(schema: &str, encoding: &str, bytes: &[u8]) -> Result<Vec<LivePose>, String> {
    let reader = reader_of(schema).ok_or_else(|| format!("messages of {schema} are not read"))?;
    let accuracy_m = if schema == FIXES { fix_accuracy_m(encoding, bytes) } else { None };
    let live = |observation: Observation| {
        let (name, number) = match observation.vehicle {
            VehicleKey::Topic => (None, None),
            VehicleKey::Listed(number) => (None, Some(number)),
            VehicleKey::Named(name) => (Some(name), None),
        };
        let is_on_earth = observation.frame == EARTH;
        let is_transform = matches!(observation.kind, PoseKind::Transform(_));
        LivePose {
            name,
            number,
            frame: observation.frame,
            stamp_ns: observation.stamp_ns,
            position: observation.position,
            accuracy_m,
            is_on_earth,
            is_transform,
        }
    };
    Ok(reader(encoding, bytes)?.into_iter().map(live).collect())
}

pub(super) fn nanoseconds(seconds: i64, nanoseconds: i64) -> i64 {
    seconds.saturating_mul(1_000_000_000).saturating_add(nanoseconds)
}

/// Returns the decoder of a schema with positions.
pub(super) fn reader_of(schema: &str) -> Option<Reader> {
    let reader: Reader = match schema {
        "foxglove.PoseInFrame" => {
            |encoding, bytes| decode_foxglove(encoding, bytes).map(|pose: PoseInFrame| vec![pose.observation()])
        }
        "foxglove.PosesInFrame" => |encoding, bytes| decode_foxglove(encoding, bytes).map(PosesInFrame::observation),
        "foxglove.FrameTransform" => |encoding, bytes| {
            decode_foxglove(encoding, bytes).map(|transform: FrameTransform| vec![transform.observation()])
        },
        "foxglove.FrameTransforms" => |encoding, bytes| {
            let transforms = decode_foxglove(encoding, bytes).map(|message: FrameTransforms| message.transforms);
            Ok(transforms?.into_iter().map(FrameTransform::observation).collect())
        },
        "geometry_msgs/msg/PoseStamped" | "geometry_msgs/msg/PoseWithCovarianceStamped" => |encoding, bytes| {
            // The covariance follows the pose.
            let (header, pose): (Header, CdrPose) = decode_ros(encoding, bytes)?;
            Ok(vec![header.observation(VehicleKey::Topic, pose)])
        },
        "geometry_msgs/msg/PointStamped" => |encoding, bytes| {
            let (header, point): (Header, [f64; 3]) = decode_ros(encoding, bytes)?;
            Ok(vec![header.observation(VehicleKey::Topic, CdrPose(point, [0.0; 4]))])
        },
        "geometry_msgs/msg/PoseArray" => |encoding, bytes| {
            let (header, poses): (Header, Vec<CdrPose>) = decode_ros(encoding, bytes)?;
            Ok((1..).zip(poses).map(|(number, pose)| header.observation(VehicleKey::Listed(number), pose)).collect())
        },
        "motion_capture_tracking_interfaces/msg/NamedPoseArray" => |encoding, bytes| {
            let (header, poses): (Header, Vec<(String, CdrPose)>) = decode_ros(encoding, bytes)?;
            Ok(poses.into_iter().map(|(name, pose)| header.observation(VehicleKey::Named(name), pose)).collect())
        },
        // The velocity after the pose is not read: publishers differ on its frame.
        "nav_msgs/msg/Odometry" => |encoding, bytes| {
            let (header, child, pose): (Header, String, CdrPose) = decode_ros(encoding, bytes)?;
            Ok(vec![Observation { kind: PoseKind::Odometry(child), ..header.observation(VehicleKey::Topic, pose) }])
        },
        FIXES => |encoding, bytes| decode_ros(encoding, bytes).map(Fix::observation),
        "geometry_msgs/msg/TransformStamped" => {
            |encoding, bytes| decode_ros(encoding, bytes).map(|transform: Transform| vec![transform.observation()])
        }
        "tf2_msgs/msg/TFMessage" => |encoding, bytes| {
            let (transforms,): (Vec<Transform>,) = decode_ros(encoding, bytes)?;
            Ok(transforms.into_iter().map(Transform::observation).collect())
        },
        _ => return None,
    };
    Some(reader)
}

/// Returns the decoder of a topic with positions in a supported encoding.
pub(super) fn reader_of_topic(topic: &DeclaredTopic) -> Option<Reader> {
    reader_of(&topic.schema).filter(|_| matches!(&*topic.encoding, "protobuf" | "json" | CDR))
}

/// Returns whether the messages of a schema are lists of poses without names.
pub(super) fn is_list(schema: &str) -> bool {
    matches!(schema, "foxglove.PosesInFrame" | "geometry_msgs/msg/PoseArray")
}

/// Returns whether the messages of a schema are transforms between frames.
pub(super) fn is_of_transforms(schema: &str) -> bool {
    matches!(
        schema,
        "foxglove.FrameTransform"
            | "foxglove.FrameTransforms"
            | "geometry_msgs/msg/TransformStamped"
            | "tf2_msgs/msg/TFMessage"
    )
}

fn decode_ros<T: DeserializeOwned>(encoding: &str, bytes: &[u8]) -> Result<T, String> {
    if encoding == CDR { decode(bytes) } else { Err("ROS 2 messages are supported in CDR only".to_owned()) }
}

/// Seconds and nanoseconds, and the frame.
#[derive(Deserialize)]
struct Header((i32, u32), String);

impl Header {
    fn observation(&self, vehicle: VehicleKey, CdrPose(position, _): CdrPose) -> Observation {
        let Self((sec, nanosec), frame) = self;
        let stamp_ns = nanoseconds((*sec).into(), (*nanosec).into());
        Observation { vehicle, frame: frame.clone(), stamp_ns, position: position.into(), kind: PoseKind::Pose }
    }
}

/// Position and quaternion of a pose or transform.
#[derive(Deserialize)]
struct CdrPose([f64; 3], [f64; 4]);

/// Header, name of the child frame, and transform.
#[derive(Deserialize)]
struct Transform(Header, String, CdrPose);

impl Transform {
    fn observation(self) -> Observation {
        let Self(header, child, pose) = self;
        Observation { kind: PoseKind::Transform(pose.1), ..header.observation(VehicleKey::Named(child), pose) }
    }
}

/// Header, status and service of the fix, and latitude, longitude and height.
#[derive(Deserialize)]
struct Fix(Header, (i8, u16), [f64; 3]);

impl Fix {
    /// Returns the position, or nothing without a fix or a height.
    fn observation(self) -> Vec<Observation> {
        let Self(header, (status, _), place) = self;
        if status < 0 || place[2].is_nan() {
            return Vec::new();
        }
        vec![Observation { frame: EARTH.to_owned(), ..header.observation(VehicleKey::Topic, CdrPose(place, [0.0; 4])) }]
    }
}

/// Returns the standard deviation of a fix \[m\]; `None` if the covariance after its position is unknown.
fn fix_accuracy_m(encoding: &str, bytes: &[u8]) -> Option<f64> {
    let (_, covariance, kind): (Fix, [f64; 9], u8) = decode_ros(encoding, bytes).ok()?;
    let variances = [covariance[0], covariance[4], covariance[8]];
    (kind > 0 && variances.iter().all(|variance| *variance > 0.0)).then(|| variances.iter().sum::<f64>().sqrt())
}

fn decode_foxglove<T: prost::Message + Default + DeserializeOwned>(encoding: &str, bytes: &[u8]) -> Result<T, String> {
    match encoding {
        "protobuf" => T::decode(bytes).map_err(|error| error.to_string()),
        "json" => serde_json::from_slice(bytes).map_err(|error| error.to_string()),
        _ => Err("Foxglove messages are supported in protobuf and JSON only".to_owned()),
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

/// Returns the position of a Foxglove message, whose absent values are 0.
fn foxglove_observation(
    vehicle: VehicleKey,
    frame: String,
    timestamp: Option<Timestamp>,
    position: Option<Vec3>,
) -> Observation {
    let stamp_ns = timestamp.map_or(0, |stamp| nanoseconds(stamp.seconds, stamp.nanos.into()));
    let position = position.map_or_else(Vector3::zeros, |point| Vector3::new(point.x, point.y, point.z));
    Observation { vehicle, frame, stamp_ns, position, kind: PoseKind::Pose }
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
    fn observation(self) -> Observation {
        foxglove_observation(VehicleKey::Topic, self.frame_id, self.timestamp, self.pose.and_then(|pose| pose.position))
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
    fn observation(self) -> Vec<Observation> {
        let one = |(number, pose): (usize, &Pose)| {
            foxglove_observation(VehicleKey::Listed(number), self.frame_id.clone(), self.timestamp, pose.position)
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
    fn observation(self) -> Observation {
        let turn = self.rotation.map_or(NO_TURN, |q| [q.x, q.y, q.z, q.w]);
        let observation = foxglove_observation(
            VehicleKey::Named(self.child_frame_id),
            self.parent_frame_id,
            self.timestamp,
            self.translation,
        );
        Observation { kind: PoseKind::Transform(turn), ..observation }
    }
}

#[derive(Clone, PartialEq, prost::Message, Deserialize)]
#[serde(default)]
struct FrameTransforms {
    #[prost(message, repeated, tag = "1")]
    transforms: Vec<FrameTransform>,
}

#[cfg(test)]
mod tests {
    use super::{FIXES, live_poses};
    use crate::mcap::topic::{CDR, encode};

    #[test]
    fn a_fix_has_the_accuracy_of_its_covariance_unless_it_is_unknown() {
        let accuracy_m = |[east, north, up]: [f64; 3], kind: u8| {
            let covariance = [east, 0.0, 0.0, 0.0, north, 0.0, 0.0, 0.0, up];
            let header = ((7_i32, 0_u32), "gps".to_owned());
            let mut bytes = Vec::new();
            encode(&(header, (0_i8, 1_u16), [47.0, 8.0, 400.0], covariance, kind), &mut bytes).expect("a message");
            let poses = live_poses(FIXES, CDR, &bytes).expect("a message");
            (poses.len(), poses[0].accuracy_m)
        };
        assert_eq!(accuracy_m([1.0, 4.0, 4.0], 2), (1, Some(3.0)));
        for (variances, kind) in [([1.0, 4.0, 4.0], 0), ([0.0, 4.0, 4.0], 2), ([1.0, f64::NAN, 4.0], 2)] {
            assert_eq!(accuracy_m(variances, kind), (1, None), "{variances:?} {kind}");
        }
    }
}
