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
mod own;

use super::error::{Fault, Place, ReadError};
use super::source::Source;
use super::{ReadOptions, Recording};
use crate::record::ReadFault;
use crate::record::mcap::framing::{Fields, Record, RecordReader, Trouble};
use mcap::records::op;

/// Opens a recording, going by the first channel that is known.
pub(super) fn open(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    match first_known_schema(source, options)? {
        Some(Known::Run) => own::open_run(source, options),
        Some(Known::Exported) => own::open_exported(source, options),
        Some(Known::Foreign) => foreign::open(source, options),
        None => {
            let remedy = "topics of foxglove.PosesInFrame, foxglove.FrameTransforms, geometry_msgs/msg/PoseStamped, \
                          geometry_msgs/msg/PoseArray or tf2_msgs/msg/TFMessage are read";
            Err(source.error(Fault::content("it has no topic with positions", remedy)))
        }
    }
}

enum Known {
    Run,
    Exported,
    Foreign,
}

fn first_known_schema(source: &Source, options: &ReadOptions) -> Result<Option<Known>, ReadError> {
    let mut records = records(source)?;
    while let Some(Record { opcode, body, .. }) = records.next().map_err(|trouble| error_of(source, trouble))? {
        if opcode != op::SCHEMA {
            continue;
        }
        let mut fields = Fields(body);
        let (Some(_), Some(name)) = (fields.u16(), fields.str()) else { continue };
        match name {
            "tautline_msgs/msg/Swarm" => return Ok(Some(Known::Run)),
            name if name == exported::TRACKS.schema => return Ok(Some(Known::Exported)),
            name if messages::Kind::of_schema(name).is_some() => return Ok(Some(Known::Foreign)),
            _ => {}
        }
    }
    accept_unfinished(source, records.is_complete(), options).map(|_| None)
}

fn records(source: &Source) -> Result<RecordReader, ReadError> {
    RecordReader::open(&source.path).map_err(|trouble| error_of(source, trouble))
}

fn error_of(source: &Source, trouble: Trouble) -> ReadError {
    match trouble {
        Trouble::System(error) => source.error(Fault::System(error)),
        Trouble::Fault(fault) => fault_of(source, fault),
    }
}

fn fault_of(source: &Source, fault: ReadFault) -> ReadError {
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
