//! Builders of messages and MCAP files.

use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;

use byteorder::{BigEndian, LittleEndian};
use mcap::records::MessageHeader;
use serde::Serialize;
use tautline_recordings::read::{ReadError, ReadOptions};

use crate::recording::Whole;

pub(crate) fn read_bytes(name: &str, bytes: &[u8], options: &ReadOptions) -> Result<Whole, ReadError> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join(name);
    fs::write(&path, bytes).expect("written");
    Whole::read(&path, options)
}

pub(crate) fn whole(name: &str, bytes: &[u8]) -> Whole {
    read_bytes(name, bytes, &ReadOptions::default()).unwrap_or_else(|error| panic!("{error}"))
}

/// Message: topic, schema, encoding, log time \[ns\], content.
pub(crate) type Message = (&'static str, &'static str, &'static str, u64, Vec<u8>);

pub(crate) fn mcap_of(messages: &[Message]) -> Vec<u8> {
    mcap_with(mcap::WriteOptions::new().compression(None), messages)
}

pub(crate) fn mcap_with(options: mcap::WriteOptions, messages: &[Message]) -> Vec<u8> {
    let mut out = options.create(Cursor::new(Vec::new())).expect("a writer");
    for (sequence, (topic, schema, encoding, log_time, content)) in (0..).zip(messages) {
        let schema = out.add_schema(schema, encoding, b"").expect("a schema");
        let channel_id = out.add_channel(schema, topic, encoding, &BTreeMap::new()).expect("a channel");
        let header = MessageHeader { channel_id, sequence, log_time: *log_time, publish_time: *log_time };
        out.write_to_known_channel(&header, content).expect("a message");
    }
    out.finish().expect("finished");
    out.into_inner().into_inner()
}

/// Encodes CDR as ROS 2 does, in either byte order.
pub(crate) fn cdr(message: &impl Serialize, little: bool) -> Vec<u8> {
    let mut bytes = vec![0, u8::from(little), 0, 0];
    if little {
        cdr_encoding::to_writer::<_, LittleEndian, _>(&mut bytes, message).expect("encoded");
    } else {
        cdr_encoding::to_writer::<_, BigEndian, _>(&mut bytes, message).expect("encoded");
    }
    bytes
}

pub(crate) type Stamp = (i32, u32);
pub(crate) const NO_TURN: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
/// Time \[s\] at which a double in nanoseconds would lose digits.
pub(crate) const SEC: i32 = 1_700_000_000;

pub(crate) fn header(nanosec: u32) -> (Stamp, &'static str) {
    ((SEC, nanosec), "map")
}
