//! The schemas of others that hold positions.

use super::messages::Reader;
use super::{foxglove_poses, ros};
use crate::mcap::topic::{CDR, Declared};

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
