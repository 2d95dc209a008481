//! Access of exporters to a recording: instants, sampled curves and channels.

use std::sync::Arc;

use nalgebra::Vector3;

use super::error::ExportError;
use crate::read::{Channels, ReadError, Recording, is_read};
use tautline_core::record::Channel;
use tautline_core::track::{Clock, Item, Piece, Sample, Tracks};

/// Recording that can be opened repeatedly.
pub(super) struct Source<'a> {
    pub(super) open: &'a dyn Fn() -> Result<Recording, ReadError>,
    /// Opens the channels.
    pub(super) channels: &'a dyn Fn() -> Result<Option<Channels>, ReadError>,
    pub(super) sample_hz: Option<f64>,
}

/// Properties of a recording, found in a first pass.
#[derive(Debug, Default)]
pub(super) struct ExportInfo {
    pub(super) names: Vec<String>,
    pub(super) clock: Clock,
    pub(super) notes: Vec<String>,
    pub(super) samples: u64,
    pub(super) instants: usize,
    /// Number of axes of positions and velocities: 2 without heights.
    pub(super) axes: usize,
    /// Whether a sample has a velocity.
    pub(super) velocities: bool,
    /// Whether a sample has a radius.
    pub(super) radii: bool,
    /// Channels.
    pub(super) extra: ExtraColumns,
}

/// Numeric column of a long table.
pub(super) struct Column {
    pub(super) name: &'static str,
    /// Returns the value of the cell; `None` for an empty cell.
    pub(super) of: fn(&Sample) -> Option<f64>,
}

const POSITION: [Column; 3] = [
    Column { name: "x", of: |sample| Some(sample.position_m.x) },
    Column { name: "y", of: |sample| Some(sample.position_m.y) },
    Column { name: "z", of: |sample| Some(sample.position_m.z) },
];

const VELOCITY: [Column; 3] = [
    Column { name: "vx", of: |sample| sample.velocity_m_s.map(|v| v.x) },
    Column { name: "vy", of: |sample| sample.velocity_m_s.map(|v| v.y) },
    Column { name: "vz", of: |sample| sample.velocity_m_s.map(|v| v.z) },
];

const RADIUS: [Column; 1] = [Column { name: "radius", of: |sample| sample.radius_m }];

impl ExportInfo {
    /// Returns the columns that every sample fills.
    pub(super) fn position_columns(&self) -> &'static [Column] {
        &POSITION[..self.axes]
    }

    /// Returns the columns that may have empty cells.
    pub(super) fn optional_columns(&self) -> impl Iterator<Item = &'static Column> {
        let velocities: &[_] = if self.velocities { &VELOCITY[..self.axes] } else { &[] };
        let radii: &[_] = if self.radii { &RADIUS } else { &[] };
        velocities.iter().chain(radii)
    }
}

impl Source<'_> {
    pub(super) fn survey(&self) -> Result<ExportInfo, ExportError> {
        let mut info = ExportInfo::default();
        let recording = self.each_instant(|instant, channels| {
            info.extra.note(channels);
            info.instants += 1;
            info.samples += instant.len() as u64;
            info.velocities |= instant.iter().any(|sample| sample.velocity_m_s.is_some());
            info.radii |= instant.iter().any(|sample| sample.radius_m.is_some());
            Ok(())
        })?;
        info.names = recording.vehicles().to_vec();
        info.axes = if recording.is_planar() { 2 } else { 3 };
        info.clock = recording.clock().clone();
        info.notes = recording.notes().to_vec();
        for fact in recording.facts().iter().filter(|fact| fact.is_assumption()) {
            info.notes.push(format!("the samples rest on an assumption that the file does not contain: {fact}"));
        }
        if let Some(hz) = self.sample_hz {
            info.notes.push(format!("curves were sampled at {hz} Hz; the motion between samples is lost"));
        }
        Ok(info)
    }

    /// Calls `take` with the samples of each instant in order of time, and the channels with one row per sample.
    pub(super) fn each_instant(
        &self,
        mut take: impl FnMut(&[Sample], &[Channel]) -> Result<(), ExportError>,
    ) -> Result<Recording, ExportError> {
        let mut recording = (self.open)()?;
        if let Some(hz) = self.sample_hz {
            Sampled::new(recording.as_mut(), hz)?.each_instant(&mut |instant: &[Sample]| take(instant, &[]))?;
            return Ok(recording);
        }
        let mut channels = (self.channels)()?;
        let mut take = |instant: &[Sample]| {
            let extra = channels.as_mut().map_or_else(|| Ok(Vec::new()), |channels| channels.next(instant.len()))?;
            take(instant, &extra)
        };
        let (mut items, mut instant) = (Vec::new(), Vec::<Sample>::new());
        loop {
            items.clear();
            if !recording.read(&mut items)? {
                break;
            }
            for item in &items {
                let Item::Sample(sample) = item else { return Err(ExportError::Curves) };
                if instant.first().is_some_and(|first| first.time_s != sample.time_s) {
                    take(&instant)?;
                    instant.clear();
                }
                instant.push(*sample);
            }
        }
        if !instant.is_empty() {
            take(&instant)?;
        }
        Ok(recording)
    }
}

/// Channels to export, in order of first appearance.
#[derive(Clone, Debug, Default)]
pub(super) struct ExtraColumns {
    pub(super) channels: Vec<ChannelColumns>,
}

/// Name and columns of an exported channel.
#[derive(Clone, Debug)]
pub(super) struct ChannelColumns {
    pub(super) name: Arc<str>,
    pub(super) columns: Arc<[String]>,
}

impl ChannelColumns {
    /// Returns this channel at an instant, if present.
    pub(super) fn of<'a>(&self, channels: &'a [Channel]) -> Option<&'a Channel> {
        channels.iter().find(|channel| self.name == channel.name && self.columns == channel.columns)
    }

    /// Returns a row of this channel at an instant, if present.
    pub(super) fn row<'a>(&self, channels: &'a [Channel], row: usize) -> Option<&'a [f64]> {
        let width = self.columns.len();
        self.of(channels)?.values.get(row * width..(row + 1) * width)
    }
}

impl ExtraColumns {
    /// Registers the channels of an instant. Of two channels with one name the first is exported.
    pub(super) fn note(&mut self, channels: &[Channel]) {
        for channel in channels {
            if self.channels.iter().all(|known| known.name != channel.name) {
                let (name, columns) = (channel.name.clone(), channel.columns.clone());
                self.channels.push(ChannelColumns { name, columns });
            }
        }
    }

    /// Returns the column names of all channels in a long table. A name with another meaning or a second use is
    /// prefixed with its channel's name.
    pub(super) fn columns(&self) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for channel in &self.channels {
            for column in &*channel.columns {
                let taken = is_read(column) || names.contains(column);
                names.push(if taken { format!("{}_{column}", channel.name) } else { column.clone() });
            }
        }
        names
    }

    /// Appends the values of these columns in one row, NaN for unknown values.
    pub(super) fn cells(&self, channels: &[Channel], row: usize, cells: &mut Vec<f64>) {
        for channel in &self.channels {
            match channel.row(channels, row) {
                Some(known) => cells.extend(known),
                None => cells.extend(std::iter::repeat_n(f64::NAN, channel.columns.len())),
            }
        }
    }
}

/// Largest number of samples of the curves of a recording.
const MOST_SAMPLES: f64 = 1e9;

/// Curves in memory, sampled at regular intervals.
pub(super) struct Sampled {
    /// Pieces of each vehicle, in order of time.
    pieces: Vec<Vec<Piece>>,
    /// Recorded samples, in order of time.
    samples: Vec<Sample>,
    hz: f64,
    from_s: f64,
}

impl Sampled {
    pub(super) fn new(recording: &mut dyn Tracks<Error = ReadError>, hz: f64) -> Result<Self, ExportError> {
        let mut items = Vec::new();
        while recording.read(&mut items)? {}
        let (mut pieces, mut samples) = (Vec::new(), Vec::new());
        pieces.resize_with(recording.vehicles().len(), Vec::new);
        let (mut from_s, mut to_s, mut count) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
        for item in items {
            match item {
                Item::Sample(sample) => samples.push(sample),
                Item::Piece(piece) => {
                    (from_s, to_s) = (from_s.min(piece.from_s), to_s.max(piece.to_s));
                    count += (piece.to_s - piece.from_s) * hz;
                    pieces[piece.vehicle].push(piece);
                }
            }
        }
        if from_s > to_s {
            return Err(ExportError::NoCurves);
        }
        if !(hz > 0.0 && hz.is_finite() && count <= MOST_SAMPLES) {
            return Err(ExportError::SampleRate(hz));
        }
        Ok(Self { pieces, samples, hz, from_s })
    }

    /// Returns the sampling times \[s\]: regular intervals, and the end of each vehicle's curve.
    fn times_s(&self) -> impl Iterator<Item = f64> + '_ {
        let mut ends: Vec<f64> = self.pieces.iter().filter_map(|pieces| Some(pieces.last()?.to_s)).collect();
        ends.sort_by(f64::total_cmp);
        ends.dedup();
        let mut ends = ends.into_iter().peekable();
        let mut regular = (0_u64..).map(|k| self.from_s + k as f64 / self.hz).peekable();
        std::iter::from_fn(move || {
            let end_s = *ends.peek()?;
            let regular_s = regular.next_if(|&time_s| time_s <= end_s);
            if regular_s.is_none_or(|time_s| time_s == end_s) {
                ends.next();
            }
            regular_s.or(Some(end_s))
        })
    }

    /// Calls `take` with the samples of each instant, in order of time.
    pub(super) fn each_instant(
        &self,
        take: &mut impl FnMut(&[Sample]) -> Result<(), ExportError>,
    ) -> Result<(), ExportError> {
        let mut recorded = self.samples.chunk_by(|a, b| a.time_s == b.time_s).peekable();
        let mut current = vec![0; self.pieces.len()];
        let mut instant = Vec::new();
        for time_s in self.times_s() {
            while let Some(before) = recorded.next_if(|samples| samples[0].time_s < time_s) {
                take(before)?;
            }
            instant.clear();
            for (pieces, current) in self.pieces.iter().zip(&mut current) {
                while pieces.get(*current + 1).is_some_and(|next| next.from_s <= time_s) {
                    *current += 1;
                }
                instant.extend(pieces.get(*current).and_then(|piece| sample(piece, time_s)));
            }
            if let Some(same) = recorded.next_if(|samples| samples[0].time_s == time_s) {
                instant.extend_from_slice(same);
            }
            if !instant.is_empty() {
                take(&instant)?;
            }
        }
        recorded.try_for_each(take)
    }
}

/// Evaluates position and velocity of a piece by Horner's rule; `None` outside its interval.
fn sample(piece: &Piece, time_s: f64) -> Option<Sample> {
    if !(piece.from_s..=piece.to_s).contains(&time_s) {
        return None;
    }
    let dt = time_s - piece.from_s;
    let (mut position_m, mut velocity_m_s) = (Vector3::zeros(), Vector3::zeros());
    for coefficient in piece.coefficients.iter().rev() {
        velocity_m_s = velocity_m_s * dt + position_m;
        position_m = position_m * dt + coefficient;
    }
    let vehicle = piece.vehicle;
    Some(Sample { vehicle, time_s, position_m, velocity_m_s: Some(velocity_m_s), radius_m: None })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channel_columns_do_not_collide_with_read_columns() {
        let mut extra = ExtraColumns::default();
        extra.note(&[
            Channel::new("attitude", &["qw", "qx"]),
            Channel::new("gps", &["x", "y1", "t_s", "id", "radius", "vx", "qw"]),
            Channel::new("wind", &["wind_x_m_s"]),
        ]);
        let expected =
            ["qw", "qx", "gps_x", "gps_y1", "gps_t_s", "gps_id", "gps_radius", "gps_vx", "gps_qw", "wind_x_m_s"];
        assert_eq!(extra.columns(), expected);
        assert!(expected.iter().all(|name| !is_read(name)), "{expected:?}");
    }
}
