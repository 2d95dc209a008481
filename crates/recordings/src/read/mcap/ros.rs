//! ROS 2's messages that hold positions, in CDR.

use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::messages::{EARTH, FIXES, Reader, Seen, What, Who, nanoseconds};
use crate::mcap::topic::{CDR, decode};

/// What reads the messages of a schema, where they hold positions.
pub(super) fn reader_of(schema: &str) -> Option<Reader> {
    let reader: Reader = match schema {
        "geometry_msgs/msg/PoseStamped" | "geometry_msgs/msg/PoseWithCovarianceStamped" => |encoding, bytes| {
            // The covariance is behind the pose.
            let (header, pose): (Header, Pose) = decoded(encoding, bytes)?;
            Ok(vec![header.seen(Who::Topic, pose)])
        },
        "geometry_msgs/msg/PointStamped" => |encoding, bytes| {
            let (header, point): (Header, [f64; 3]) = decoded(encoding, bytes)?;
            Ok(vec![header.seen(Who::Topic, Pose(point, [0.0; 4]))])
        },
        "geometry_msgs/msg/PoseArray" => |encoding, bytes| {
            let (header, poses): (Header, Vec<Pose>) = decoded(encoding, bytes)?;
            Ok((1..).zip(poses).map(|(number, pose)| header.seen(Who::Listed(number), pose)).collect())
        },
        "motion_capture_tracking_interfaces/msg/NamedPoseArray" => |encoding, bytes| {
            let (header, poses): (Header, Vec<(String, Pose)>) = decoded(encoding, bytes)?;
            Ok(poses.into_iter().map(|(name, pose)| header.seen(Who::Named(name), pose)).collect())
        },
        // The velocity behind the pose is not read: publishers differ on the frame that it is given in.
        "nav_msgs/msg/Odometry" => |encoding, bytes| {
            let (header, child, pose): (Header, String, Pose) = decoded(encoding, bytes)?;
            Ok(vec![Seen { what: What::Odometry(child), ..header.seen(Who::Topic, pose) }])
        },
        FIXES => |encoding, bytes| decoded(encoding, bytes).map(Fix::seen),
        "geometry_msgs/msg/TransformStamped" => {
            |encoding, bytes| decoded(encoding, bytes).map(|transform: Transform| vec![transform.seen()])
        }
        "tf2_msgs/msg/TFMessage" => |encoding, bytes| {
            let (transforms,): (Vec<Transform>,) = decoded(encoding, bytes)?;
            Ok(transforms.into_iter().map(Transform::seen).collect())
        },
        _ => return None,
    };
    Some(reader)
}

fn decoded<T: DeserializeOwned>(encoding: &str, bytes: &[u8]) -> Result<T, String> {
    if encoding == CDR { decode(bytes) } else { Err("ROS 2 messages are read in CDR alone".to_owned()) }
}

/// Seconds and nanoseconds, and the frame.
#[derive(Deserialize)]
struct Header((i32, u32), String);

impl Header {
    fn seen(&self, who: Who, Pose(position, _): Pose) -> Seen {
        let Self((sec, nanosec), frame) = self;
        let stamp_ns = nanoseconds((*sec).into(), (*nanosec).into());
        Seen { who, frame: frame.clone(), stamp_ns, position: position.into(), what: What::Pose }
    }
}

/// A position and a quaternion, of poses and transforms alike.
#[derive(Deserialize)]
struct Pose([f64; 3], [f64; 4]);

/// The name is that of the child frame.
#[derive(Deserialize)]
struct Transform(Header, String, Pose);

impl Transform {
    fn seen(self) -> Seen {
        let Self(header, child, pose) = self;
        Seen { what: What::Transform(pose.1), ..header.seen(Who::Named(child), pose) }
    }
}

/// Whether there is a fix, by which satellites, and latitude, longitude and height.
#[derive(Deserialize)]
struct Fix(Header, (i8, u16), [f64; 3]);

impl Fix {
    /// Where there is no fix, or none with a height, nothing was seen.
    fn seen(self) -> Vec<Seen> {
        let Self(header, (status, _), place) = self;
        if status < 0 || place[2].is_nan() {
            return Vec::new();
        }
        vec![Seen { frame: EARTH.to_owned(), ..header.seen(Who::Topic, Pose(place, [0.0; 4])) }]
    }
}
