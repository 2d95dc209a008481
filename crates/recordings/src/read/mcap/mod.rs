//! Reads MCAP recordings: runs and exports of tautline, Foxglove and ROS 2 messages.
//!
//! | schema | encoding | vehicle |
//! | --- | --- | --- |
//! | `tautline_msgs/msg/Swarm` | cdr | its number |
//! | `tautline_msgs/msg/Tracks` | cdr | its name |
//! | `foxglove.PosesInFrame`, `geometry_msgs/msg/PoseArray` | protobuf or json, cdr | its place in the list |
//! | `foxglove.FrameTransform(s)`, `tf2_msgs/msg/TFMessage`, `geometry_msgs/msg/TransformStamped` | the same | the child frame |
//! | `motion_capture_tracking_interfaces/msg/NamedPoseArray` | cdr | the name of the pose |
//! | `traj_utils/msg/Bspline`, `traj_utils/msg/MultiBsplines`, `traj_utils/msg/MINCOTraj`, `traj_utils/msg/PolyTraj` | cdr | the number of the drone |
//! | `foxglove.PoseInFrame`, `geometry_msgs/msg/PoseStamped`, `PoseWithCovarianceStamped`, `PointStamped`, `nav_msgs/msg/Odometry`, `sensor_msgs/msg/NavSatFix` | the same | the topic |
//!
//! Times are the stamps of the messages, or the log times if no message has a stamp. All sources must have one clock.
//! All positions must be in one frame, or be transformed to it. A file that was not closed is refused, unless the user
//! accepts its complete part.

pub(super) mod bag;
mod clocks;
mod definition;
mod foreign;
mod messages;
mod outline;
pub(crate) mod own;
mod plan;
mod planned;
mod split;
mod tree;

pub use messages::{LivePose, has_live_poses, live_poses};
pub use own::Channels;
pub use planned::{LivePlan, live_plans};

use std::path::Path;

use super::error::{ContentKind, Fault, Place, ReadError, refuse};
use super::format::Format;
use super::options::ReadOptions;
use super::order::Recording;
use super::source::Source;
use crate::mcap::topic::{Part, TopicReader};
use crate::mcap::{McapRecording, SWARM_SCHEMA};
use split::SplitFiles;
use tautline_core::option::{CLOCK, PLAN_END};
use tautline_core::record::{ReadFault, RecordError};

/// Program that wrote the positions of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Origin {
    Run,
    Export,
    Foreign,
}

/// Returns the origin of a file by its first known schema.
fn origin(topics: &mut TopicReader) -> Result<Option<Origin>, ReadError> {
    while let Some(part) = topics.next()? {
        let Part::Schema(name, definition) = part else { continue };
        let is_export = name == own::TRACKS.schema_name;
        let origin = match name {
            SWARM_SCHEMA => Some(Origin::Run),
            _ if is_export => Some(Origin::Export),
            _ if definition::curve_kind(name, definition).is_some() => Some(Origin::Foreign),
            _ => messages::reader_of(name).map(|_| Origin::Foreign),
        };
        if origin.is_some() {
            return Ok(origin);
        }
    }
    Ok(None)
}

/// Opens a recording of `tautline run` if [`open`] would read the file as one; `None` for any other file.
pub(super) fn open_run(path: &Path) -> Option<McapRecording> {
    let origin = origin(&mut TopicReader::open(path).ok()?).ok()?;
    McapRecording::open(path).ok().filter(|_| origin == Some(Origin::Run))
}

/// Opens a recording by its first known schema.
pub(super) fn open(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let mut topics = TopicReader::open(&source.path)?;
    let origin = origin(&mut topics)?;
    if options.clock.is_some() && matches!(origin, Some(Origin::Run | Origin::Export)) {
        let problem = "it is a recording of tautline, which has one clock";
        return refuse(ContentKind::UnusedOption, problem, format!("omit {CLOCK}"));
    }
    if options.plan_end.is_some() && origin != Some(Origin::Foreign) {
        return refuse(ContentKind::UnusedOption, "it has no plans of a planner", format!("omit {PLAN_END}"));
    }
    match origin {
        Some(Origin::Run) => return own::open_samples(source, options),
        Some(Origin::Export) => return own::open_export(source, options),
        Some(Origin::Foreign) => {
            return foreign::open(source, SplitFiles::new(vec![source.clone()], 0, options), options);
        }
        None => {}
    }
    options.accept_unfinished(topics.is_complete())?;
    let remedy = "record one of the topics foxglove.PosesInFrame, foxglove.FrameTransforms, \
                  geometry_msgs/msg/PoseStamped, geometry_msgs/msg/PoseArray, nav_msgs/msg/Odometry, \
                  sensor_msgs/msg/NavSatFix, motion_capture_tracking_interfaces/msg/NamedPoseArray, \
                  tf2_msgs/msg/TFMessage, traj_utils/msg/Bspline, traj_utils/msg/MultiBsplines, \
                  traj_utils/msg/MINCOTraj or traj_utils/msg/PolyTraj";
    refuse(ContentKind::NoPositions, "it has no topic with positions", remedy)
}

impl From<RecordError> for ReadError {
    fn from(error: RecordError) -> Self {
        let fault = match error {
            RecordError::Write { source, .. } | RecordError::Open { source, .. } => {
                return Fault::System(source).into();
            }
            RecordError::Read { fault, .. } => fault,
        };
        match fault {
            ReadFault::Empty => Fault::empty().into(),
            ReadFault::NotMcap => Fault::wrong_format(Format::MCAP).into(),
            ReadFault::TooLong { offset, bytes, limit } => {
                let reason = format!("a record declares {bytes} bytes, more than the limit of {limit}");
                Fault::damaged(reason).at(Place::Byte(offset))
            }
            ReadFault::Damaged { offset, reason } => Fault::damaged(reason).at(Place::Byte(offset)),
            ReadFault::Message { topic, reason } => Fault::damaged(reason).at(Place::Part(format!("topic `{topic}`"))),
            other => Fault::damaged(other).into(),
        }
    }
}
