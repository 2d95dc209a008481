//! An MCAP file with the messages of [`crate::read`]'s exported recordings: `/vehicles` and `/tracks`.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter};

use mcap::records::MessageHeader;
use mcap::{McapError, WriteOptions, Writer};
use serde::Serialize;

use super::{About, ExportError, Source};
use crate::read::mcap::exported::{Channel, Instant, TRACKS, VEHICLES, Vehicles, encode};
use crate::track::Sample;

/// Size at which a chunk is closed \[bytes\].
const CHUNK_BYTES: u64 = 1024 * 1024;

pub(super) fn write(source: &Source<'_>, about: &About, file: &mut File) -> Result<(), ExportError> {
    let options =
        WriteOptions::new().library(concat!("tautline ", env!("CARGO_PKG_VERSION"))).chunk_size(Some(CHUNK_BYTES));
    let mut out = options.create(BufWriter::new(file)).map_err(write_error)?;
    let vehicles = declare(&mut out, &VEHICLES)?;
    let tracks = declare(&mut out, &TRACKS)?;
    let epoch_ns = about.clock.epoch_ns;
    send(&mut out, vehicles, 0, log_time(epoch_ns, 0.0), &Vehicles { names: about.names.clone(), epoch_ns })?;
    let mut sequence = 0_u32;
    source.each_instant(|instant| {
        let message = message(instant, about);
        send(&mut out, tracks, sequence, log_time(epoch_ns, message.time_s), &message)?;
        sequence = sequence.wrapping_add(1);
        Ok(())
    })?;
    out.finish().map_err(write_error)?;
    Ok(())
}

fn message(instant: &[Sample], about: &About) -> Instant {
    let unknown = [f64::NAN; 3];
    let velocities = |sample: &Sample| sample.velocity_m_s.map_or(unknown, Into::into);
    Instant {
        time_s: instant.first().map_or(f64::NAN, |sample| sample.time_s),
        vehicles: instant.iter().map(|sample| sample.vehicle as u64).collect(),
        positions_m: instant.iter().flat_map(|sample| <[f64; 3]>::from(sample.position_m)).collect(),
        velocities_m_s: if about.velocities { instant.iter().flat_map(velocities).collect() } else { Vec::new() },
        radii_m: if about.radii {
            instant.iter().map(|sample| sample.radius_m.unwrap_or(f64::NAN)).collect()
        } else {
            Vec::new()
        },
    }
}

fn declare(out: &mut Writer<BufWriter<&mut File>>, channel: &Channel) -> Result<u16, ExportError> {
    let schema = out.add_schema(channel.schema, "ros2msg", channel.text.as_bytes()).map_err(write_error)?;
    out.add_channel(schema, channel.topic, "cdr", &BTreeMap::new()).map_err(write_error)
}

fn send(
    out: &mut Writer<BufWriter<&mut File>>,
    channel_id: u16,
    sequence: u32,
    log_time: u64,
    message: &impl Serialize,
) -> Result<(), ExportError> {
    let bytes = encode(message).map_err(io::Error::other)?;
    let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
    out.write_to_known_channel(&header, &bytes).map_err(write_error)
}

/// Nanoseconds since the zero of the clock; 0 for what is negative.
fn log_time(epoch_ns: i64, time_s: f64) -> u64 {
    #[expect(clippy::cast_possible_truncation, reason = "the cast saturates")]
    let since_epoch = (time_s * 1e9).round() as i64;
    u64::try_from(epoch_ns.saturating_add(since_epoch)).unwrap_or(0)
}

fn write_error(error: McapError) -> ExportError {
    match error {
        McapError::Io(error) => ExportError::Write(error),
        other => ExportError::Write(io::Error::other(other)),
    }
}
