//! Writes an MCAP file with the topics `/vehicles` and `/tracks`, and one topic per channel as in `run.mcap`.
//!
//! A channel message has one row per vehicle of the `/tracks` message that follows it.

use std::fs::File;
use std::io::BufWriter;

use mcap::WriteOptions;

use super::ExportError;
use super::source::{ExportInfo, Source};
use crate::mcap::topic::{TopicWriter, encode, log_time_ns};
use crate::mcap::{ChannelMessage, channel_topic, topic_of_channel};
use crate::read::mcap::own::{Instant, TRACKS, VEHICLES, Vehicles};
use tautline_core::track::Sample;

/// Chunk size \[bytes\].
const CHUNK_BYTES: u64 = 1024 * 1024;

pub(super) fn write(source: &Source<'_>, info: &ExportInfo, file: &mut File) -> Result<(), ExportError> {
    let mut out = TopicWriter::new(BufWriter::new(file), WriteOptions::new().chunk_size(Some(CHUNK_BYTES)))?;
    let (vehicles, tracks) = (out.declare(&VEHICLES)?, out.declare(&TRACKS)?);
    let topics: Vec<_> = info.extra.channels.iter().map(|channel| channel_topic(&channel.name)).collect();
    let topics = topics.iter().map(|name| out.declare(&topic_of_channel(name))).collect::<Result<Vec<_>, _>>()?;
    let (epoch_ns, mut number) = (info.clock.epoch_ns, 0);
    let mut bytes = Vec::new();
    encode(&Vehicles { names: info.names.clone(), epoch_ns }, &mut bytes)?;
    out.write(vehicles, log_time_ns(epoch_ns, 0.0), &bytes)?;
    source.each_instant(|instant, channels| {
        let message = message(instant, info);
        for (written, &topic) in info.extra.channels.iter().zip(&topics) {
            let Some(channel) = written.of(channels) else { continue };
            encode(&ChannelMessage::of(message.time_s, number, channel), &mut bytes)?;
            out.write(topic, log_time_ns(epoch_ns, message.time_s), &bytes)?;
        }
        number += 1;
        encode(&message, &mut bytes)?;
        Ok(out.write(tracks, log_time_ns(epoch_ns, message.time_s), &bytes)?)
    })?;
    Ok(out.finish()?)
}

fn message(instant: &[Sample], info: &ExportInfo) -> Instant {
    let unknown = [f64::NAN; 3];
    let velocities = |sample: &Sample| sample.velocity_m_s.map_or(unknown, Into::into).into_iter().take(info.axes);
    let positions = |sample: &Sample| <[f64; 3]>::from(sample.position_m).into_iter().take(info.axes);
    Instant {
        time_s: instant.first().map_or(f64::NAN, |sample| sample.time_s),
        vehicles: instant.iter().map(|sample| sample.vehicle as u64).collect(),
        positions_m: instant.iter().flat_map(positions).collect(),
        velocities_m_s: if info.velocities { instant.iter().flat_map(velocities).collect() } else { Vec::new() },
        radii_m: if info.radii {
            instant.iter().map(|sample| sample.radius_m.unwrap_or(f64::NAN)).collect()
        } else {
            Vec::new()
        },
    }
}
