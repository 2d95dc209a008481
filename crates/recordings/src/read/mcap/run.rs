//! `run.mcap`.

use super::super::clock::{Stamp, TimeUnit};
use super::super::error::{Fault, Place, ReadError};
use super::super::names::Names;
use super::super::options::ReadOptions;
use super::super::order::{About, Ordered, Recording};
use super::super::rows::{BATCH, Row, Rows};
use super::super::source::Source;
use super::super::turned;
use crate::mcap::{Entry, McapRecording};

pub(super) fn open(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let recording = McapRecording::open(&source.path)?;
    turned::refuse_known(options, "a recording of tautline")?;
    let notes = options.accept_unfinished(recording.is_complete())?;
    let vehicles = recording.header().vehicles;
    let run = Run { recording, vehicles, names: Names::default(), samples: 0 };
    let none = Fault::coded("recording/empty", "it holds no sample", "record again");
    let about = About::new(source, options, Some(TimeUnit::Seconds), notes, none);
    Ok(Box::new(Ordered::open(run, about)?))
}

/// The samples of a run.
struct Run {
    recording: McapRecording,
    /// Number of vehicles, as the header claims.
    vehicles: usize,
    names: Names,
    samples: u64,
}

impl Rows for Run {
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError> {
        let before = rows.len();
        while rows.len() < before + BATCH {
            let Some(entry) = self.recording.next() else { break };
            let Entry::Sample(sample) = entry? else { continue };
            if self.names.all().is_empty() {
                // The sample really holds as many: the number is no longer a claim.
                self.names = Names::numbered(self.vehicles);
            }
            self.samples += 1;
            for vehicle in 0..self.vehicles {
                let position = sample.swarm.positions_m.row(vehicle).transpose();
                let velocity = Some(sample.swarm.velocities_m_s.row(vehicle).transpose());
                let stamp = Stamp::Real(sample.time_s);
                rows.push(Row { stamp, place: self.samples, vehicle, position, velocity, radius: None });
            }
        }
        Ok(rows.len() > before)
    }

    fn vehicles(&self) -> &[String] {
        self.names.all()
    }

    fn place(&self, number: u64) -> Place {
        Place::Part(format!("sample {number} of topic `/swarm`"))
    }
}
