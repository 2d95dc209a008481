//! Writes an MCAP file with the topics `/vehicles` and `/tracks`, and one topic per channel as in `run.mcap`.
//!
//! A channel message has one row per vehicle of the `/tracks` message that follows it.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter};

use mcap::WriteOptions;
use mcap::write::NoSeek;
use nalgebra::Vector3;

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

/// Recorder of positions in the order in which they are heard, into an MCAP file with the topics `/vehicles` and
/// `/tracks`.
///
/// A file that was not finished is read up to the last flush, with `allow_unfinished`.
pub struct TrackRecorder {
    out: TopicWriter<NoSeek<BufWriter<File>>>,
    /// Indices of the topics `/vehicles` and `/tracks`.
    topics: [usize; 2],
    /// Numbers of the vehicles.
    numbers: BTreeMap<String, u64>,
    /// Names of the vehicles, in the order of their numbers.
    vehicles: Vehicles,
    bytes: Vec<u8>,
}

impl TrackRecorder {
    /// Returns a recorder into an empty file.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn new(file: File) -> io::Result<Self> {
        // The recorder closes the chunks: what is flushed can be read.
        let options = WriteOptions::new().chunk_size(None).disable_seeking(true);
        let mut out = TopicWriter::new(NoSeek::new(BufWriter::new(file)), options)?;
        let topics = [out.declare(&VEHICLES)?, out.declare(&TRACKS)?];
        Ok(Self { out, topics, numbers: BTreeMap::new(), vehicles: Vehicles::default(), bytes: Vec::new() })
    }

    /// Appends the position \[m\] and, if known, the velocity \[m/s\] of a vehicle at a time \[s\].
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn push(
        &mut self,
        time_s: f64,
        vehicle: &str,
        position_m: Vector3<f64>,
        velocity_m_s: Option<Vector3<f64>>,
    ) -> io::Result<()> {
        let [vehicles, tracks] = self.topics;
        let number = if let Some(&number) = self.numbers.get(vehicle) {
            number
        } else {
            let number = self.vehicles.names.len() as u64;
            self.numbers.insert(vehicle.to_owned(), number);
            self.vehicles.names.push(vehicle.to_owned());
            encode(&self.vehicles, &mut self.bytes)?;
            self.out.write(vehicles, log_time_ns(0, time_s), &self.bytes)?;
            number
        };
        let instant = Instant {
            time_s,
            vehicles: vec![number],
            positions_m: position_m.iter().copied().collect(),
            velocities_m_s: velocity_m_s.iter().flatten().copied().collect(),
            radii_m: Vec::new(),
        };
        encode(&instant, &mut self.bytes)?;
        self.out.write(tracks, log_time_ns(0, time_s), &self.bytes)
    }

    /// Writes all positions so far to the file.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }

    /// Writes the remaining positions and the closing index.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn finish(mut self) -> io::Result<()> {
        self.out.finish()
    }
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
