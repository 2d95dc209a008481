//! A recording that is exported, instant by instant.

use super::beside::Beside;
use super::error::ExportError;
use super::sampled::Sampled;
use crate::read::{Channels, ReadError, Recording};
use tautline_core::record::Channel;
use tautline_core::track::{Clock, Item, Sample};

/// A recording that can be read again and again.
pub(super) struct Source<'a> {
    pub(super) open: &'a dyn Fn() -> Result<Recording, ReadError>,
    /// Opens what it says beside the motion.
    pub(super) channels: &'a dyn Fn() -> Result<Option<Channels>, ReadError>,
    pub(super) sample_hz: Option<f64>,
}

/// What a recording holds.
#[derive(Debug, Default)]
pub(super) struct About {
    pub(super) names: Vec<String>,
    pub(super) clock: Clock,
    pub(super) notes: Vec<String>,
    pub(super) samples: u64,
    pub(super) instants: usize,
    /// Number of axes of positions and velocities: 2 where no height is known.
    pub(super) axes: usize,
    /// Whether some sample has a velocity.
    pub(super) velocities: bool,
    /// Whether some sample has a radius.
    pub(super) radii: bool,
    /// What it says beside the motion.
    pub(super) beside: Beside,
}

/// A column of numbers of a long table.
pub(super) struct Column {
    pub(super) name: &'static str,
    /// What stands in it; none where the cell is empty.
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

impl About {
    /// The columns that every sample fills.
    pub(super) fn position_columns(&self) -> &'static [Column] {
        &POSITION[..self.axes]
    }

    /// The columns that some samples fill and others may not.
    pub(super) fn optional_columns(&self) -> impl Iterator<Item = &'static Column> {
        let velocities: &[_] = if self.velocities { &VELOCITY[..self.axes] } else { &[] };
        let radii: &[_] = if self.radii { &RADIUS } else { &[] };
        velocities.iter().chain(radii)
    }
}

impl Source<'_> {
    pub(super) fn survey(&self) -> Result<About, ExportError> {
        let mut about = About::default();
        let recording = self.each_instant(|instant, channels| {
            about.beside.note(channels);
            about.instants += 1;
            about.samples += instant.len() as u64;
            about.velocities |= instant.iter().any(|sample| sample.velocity_m_s.is_some());
            about.radii |= instant.iter().any(|sample| sample.radius_m.is_some());
            Ok(())
        })?;
        about.names = recording.vehicles().to_vec();
        about.axes = if recording.is_planar() { 2 } else { 3 };
        about.clock = recording.clock().clone();
        about.notes = recording.notes().to_vec();
        if let Some(assumed) = recording.assumed() {
            about.notes.push(format!("what is written does not say that samples hold only if {assumed}"));
        }
        if let Some(hz) = self.sample_hz {
            about.notes.push(format!("curves were sampled at {hz} Hz: what is between the samples is lost"));
        }
        Ok(about)
    }

    /// Calls `take` with the samples of each instant, in order of time, and the channels that have a row for each of them.
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
            let beside = channels.as_mut().map_or_else(|| Ok(Vec::new()), |channels| channels.next(instant.len()))?;
            take(instant, &beside)
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
