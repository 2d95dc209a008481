//! Positions of a message, and the schemas whose messages hold positions.

use nalgebra::Vector3;

use super::{foxglove_poses, ros};
use crate::mcap::topic::{CDR, Declared};

/// Reads a message in an encoding; the error says what is wrong with it.
pub(super) type Reader = fn(encoding: &str, bytes: &[u8]) -> Result<Vec<Seen>, String>;

/// The frame of positions on the Earth: latitude and longitude \[degrees\], and height \[m\].
pub(super) const EARTH: &str = "WGS 84";

/// The schema of these positions.
pub(super) const FIXES: &str = "sensor_msgs/msg/NavSatFix";

/// The quaternion that turns nothing.
pub(super) const NO_TURN: [f64; 4] = [0.0, 0.0, 0.0, 1.0];

/// A position as a message says it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Seen {
    pub(super) who: Who,
    /// The frame that the position is given in.
    pub(super) frame: String,
    /// Since the clock's zero \[ns\]; 0 where the message does not say.
    pub(super) stamp_ns: i64,
    pub(super) position: Vector3<f64>,
    pub(super) what: What,
}

/// Which vehicle a message speaks of.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Who {
    /// The topic itself is the vehicle.
    Topic,
    /// The place in a list of poses, from 1.
    Listed(usize),
    /// A name in the message.
    Named(String),
}

/// What a position is.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum What {
    Pose,
    /// The pose of a robot's own frame.
    Odometry(String),
    /// Where a frame lies in its parent, with the quaternion x, y, z, w that turns it into the parent.
    Transform([f64; 4]),
}

pub(super) fn nanoseconds(seconds: i64, nanoseconds: i64) -> i64 {
    seconds.saturating_mul(1_000_000_000).saturating_add(nanoseconds)
}

/// What reads the messages of a schema, where they hold positions.
pub(super) fn reader_of(schema: &str) -> Option<Reader> {
    foxglove_poses::reader_of(schema).or_else(|| ros::reader_of(schema))
}

/// The same of a topic, where it is in an encoding that is read.
pub(super) fn reader_of_topic(topic: &Declared) -> Option<Reader> {
    reader_of(&topic.schema).filter(|_| matches!(&*topic.encoding, "protobuf" | "json" | CDR))
}

/// Whether the messages of a schema are lists of poses without names.
pub(super) fn is_list(schema: &str) -> bool {
    matches!(schema, "foxglove.PosesInFrame" | "geometry_msgs/msg/PoseArray")
}

/// Whether the messages of a schema are transforms between frames.
pub(super) fn is_of_transforms(schema: &str) -> bool {
    matches!(
        schema,
        "foxglove.FrameTransform"
            | "foxglove.FrameTransforms"
            | "geometry_msgs/msg/TransformStamped"
            | "tf2_msgs/msg/TFMessage"
    )
}
