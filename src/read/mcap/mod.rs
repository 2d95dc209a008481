//! MCAP recordings: our own, exported ones, Foxglove and ROS 2 messages.
//!
//! | schema | encoding | vehicle |
//! | --- | --- | --- |
//! | `tautline_msgs/msg/Swarm` | cdr | its number |
//! | `tautline_msgs/msg/Tracks` | cdr | its name |
//! | `foxglove.PosesInFrame`, `geometry_msgs/msg/PoseArray` | protobuf or json, cdr | its place in the list |
//! | `foxglove.FrameTransform(s)`, `tf2_msgs/msg/TFMessage`, `geometry_msgs/msg/TransformStamped` | the same | the child frame |
//! | `foxglove.PoseInFrame`, `geometry_msgs/msg/PoseStamped` | the same | the topic |
//!
//! Times are those of the messages; where no message of a channel has one, those when they were logged. All positions must be given
//! in one frame. A file that was not closed is refused, unless the user accepts what it holds.

pub(crate) mod exported;
mod foreign;
mod messages;
mod run;

use super::error::{Fault, Place, ReadError};
use super::source::Source;
use super::{ReadOptions, Recording};
use crate::record::mcap::topic::{Part, TopicReader};
use crate::record::{ReadFault, RecordError};

/// Opens a recording, going by the first schema that is known.
pub(super) fn open(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let error = |error| error_of(source, error);
    let mut topics = TopicReader::open(&source.path).map_err(error)?;
    while let Some(part) = topics.next().map_err(error)? {
        match part {
            Part::Schema("tautline_msgs/msg/Swarm") => return run::open(source, options),
            Part::Schema(name) if name == exported::TRACKS.schema_name => return exported::open(source, options),
            Part::Schema(name) if messages::Kind::of_schema(name).is_some() => return foreign::open(source, options),
            _ => {}
        }
    }
    accept_unfinished(source, topics.is_complete(), options)?;
    let remedy = "topics of foxglove.PosesInFrame, foxglove.FrameTransforms, geometry_msgs/msg/PoseStamped, \
                  geometry_msgs/msg/PoseArray or tf2_msgs/msg/TFMessage are read";
    Err(source.error(Fault::content("it has no topic with positions", remedy)))
}

fn error_of(source: &Source, error: RecordError) -> ReadError {
    let fault = match error {
        RecordError::Write { source: error, .. } | RecordError::Open { source: error, .. } => {
            return source.error(Fault::System(error));
        }
        RecordError::Read { fault, .. } => fault,
    };
    match fault {
        ReadFault::Empty => source.error(Fault::Empty),
        ReadFault::NotMcap => source.error(Fault::WrongFormat {
            format: super::Format::Mcap,
            reason: "it does not begin as MCAP files do".to_owned(),
        }),
        ReadFault::TooLong { offset, bytes, limit } => {
            let reason = format!("a record claims {bytes} bytes, more than the limit of {limit}");
            source.error(Fault::Damaged { reason }).at(Place::Byte(offset))
        }
        ReadFault::Damaged { offset, reason } => source.error(Fault::Damaged { reason }).at(Place::Byte(offset)),
        ReadFault::Message { topic, reason } => {
            source.error(Fault::Damaged { reason }).at(Place::Part(format!("topic `{topic}`")))
        }
        other => source.error(Fault::damaged(other)),
    }
}

/// What is to be said of a file that was not closed, or the error that it is.
fn accept_unfinished(source: &Source, complete: bool, options: &ReadOptions) -> Result<Vec<String>, ReadError> {
    let note = "the recording was not closed: it is read up to the last part that was written";
    match (complete, options.allow_unfinished) {
        (true, _) => Ok(Vec::new()),
        (false, true) => Ok(vec![note.to_owned()]),
        (false, false) => Err(source.error(Fault::Unfinished)),
    }
}
