//! `run.mcap`, and recordings that were exported.

use nalgebra::Vector3;

use super::super::clock::Stamp;
use super::super::error::{Fault, Place, ReadError};
use super::super::names::Names;
use super::super::order::{BATCH, Ordered, Row, Rows};
use super::super::source::Source;
use super::super::{ReadOptions, Recording, TimeUnit};
use super::exported::{self, Instant, TRACKS, VEHICLES, Vehicles};
use super::{accept_unfinished, error_of, fault_of, records};
use crate::record::RecordError;
use crate::record::mcap::framing::{Fields, Record, RecordReader};
use crate::record::mcap::{Entry, McapRecording};
use mcap::records::op;

pub(super) fn open_run(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let recording = McapRecording::open(&source.path).map_err(|error| run_error(source, error))?;
    let notes = accept_unfinished(source, recording.is_complete(), options)?;
    let vehicles = recording.header().vehicles;
    let run = Run { source: source.clone(), recording, vehicles, names: Names::default(), samples: 0 };
    let none = Fault::content("it holds no sample", "record again");
    let about = options.about(Some(TimeUnit::Seconds), notes, none);
    Ok(Box::new(Ordered::open(run, about)?))
}

fn run_error(source: &Source, error: RecordError) -> ReadError {
    match error {
        RecordError::Write { source: error, .. } | RecordError::Open { source: error, .. } => {
            source.error(Fault::System(error))
        }
        RecordError::Read { fault, .. } => fault_of(source, fault),
    }
}

/// The samples of a run.
struct Run {
    source: Source,
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
            let Entry::Sample(sample) = entry.map_err(|error| run_error(&self.source, error))? else { continue };
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

    fn error(&self, fault: Fault) -> ReadError {
        self.source.error(fault)
    }

    fn place(&self, number: u64) -> Place {
        Place::Part(format!("sample {number} of topic `/swarm`"))
    }

    fn is_wide(&self) -> bool {
        true
    }
}

pub(super) fn open_exported(source: &Source, options: &ReadOptions) -> Result<Recording, ReadError> {
    let mut exported = Exported {
        source: source.clone(),
        records: records(source)?,
        schemas: Vec::new(),
        channels: Vec::new(),
        names: Names::default(),
        epoch_ns: 0,
        instants: 0,
    };
    let notes = accept_unfinished(source, exported.records.is_complete(), options)?;
    let mut first = Vec::new();
    exported.next(&mut first)?;
    let none = Fault::content("it holds no instant", "export again");
    let mut about = options.about(Some(TimeUnit::Seconds), notes, none);
    about.epoch_ns = exported.epoch_ns;
    exported.restart()?;
    Ok(Box::new(Ordered::open(exported, about)?))
}

/// The instants of an exported recording.
struct Exported {
    source: Source,
    records: RecordReader,
    /// Numbers and names of the schemas.
    schemas: Vec<(u16, String)>,
    /// Numbers of the channels, and whether they hold motion or names.
    channels: Vec<(u16, bool)>,
    names: Names,
    epoch_ns: i64,
    instants: u64,
}

impl Exported {
    fn restart(&mut self) -> Result<(), ReadError> {
        self.records = records(&self.source)?;
        self.schemas.clear();
        self.channels.clear();
        self.names = Names::default();
        self.instants = 0;
        Ok(())
    }

    /// Takes in one record; `false` when there is none.
    fn advance(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError> {
        let record = self.records.next().map_err(|trouble| error_of(&self.source, trouble))?;
        let Some(Record { offset, opcode, body }) = record else { return Ok(false) };
        let mut fields = Fields(body);
        let taken = match opcode {
            op::SCHEMA => fields.u16().zip(fields.str()).map(|(number, name)| {
                self.schemas.push((number, name.to_owned()));
                Ok(())
            }),
            op::CHANNEL => fields.u16().zip(fields.u16()).map(|(number, schema)| {
                let name = self.schemas.iter().find(|known| known.0 == schema).map(|known| known.1.as_str());
                if let Some(name) = name.filter(|&name| name == TRACKS.schema || name == VEHICLES.schema) {
                    self.channels.push((number, name == TRACKS.schema));
                }
                Ok(())
            }),
            op::MESSAGE => message(fields).map(|(channel, bytes)| {
                let channel = self.channels.iter().find(|known| known.0 == channel);
                match channel.map(|known| known.1) {
                    Some(true) => exported::decode(bytes).and_then(|instant| {
                        self.instants += 1;
                        take(&instant, self.names.all().len(), self.instants, rows)
                    }),
                    Some(false) => exported::decode(bytes).and_then(|Vehicles { names, epoch_ns }| {
                        if !names.starts_with(self.names.all()) {
                            return Err("the vehicles are not those of before".to_owned());
                        }
                        self.names = Names::from_list(names);
                        self.epoch_ns = epoch_ns;
                        Ok(())
                    }),
                    None => Ok(()),
                }
            }),
            _ => Some(Ok(())),
        };
        let taken = taken.unwrap_or_else(|| Err("a record is shorter than its fields".to_owned()));
        taken.map_err(|reason| self.source.error(Fault::Damaged { reason }).at(Place::Byte(offset)))?;
        Ok(true)
    }
}

/// Channel and content of a message.
pub(super) fn message(mut fields: Fields<'_>) -> Option<(u16, &[u8])> {
    let channel = fields.u16()?;
    let _sequence = fields.u32()?;
    let _times = (fields.u64()?, fields.u64()?);
    Some((channel, fields.0))
}

/// Appends the rows of an instant; the error says what is wrong with it.
fn take(instant: &Instant, vehicles: usize, number: u64, rows: &mut Vec<Row>) -> Result<(), String> {
    let count = instant.vehicles.len();
    let fits = |length: usize, each: usize| length == each * count;
    let velocities = !instant.velocities_m_s.is_empty();
    let radii = !instant.radii_m.is_empty();
    if !(fits(instant.positions_m.len(), 3)
        && (!velocities || fits(instant.velocities_m_s.len(), 3))
        && (!radii || fits(instant.radii_m.len(), 1)))
    {
        return Err(format!("its arrays do not belong to {count} vehicles"));
    }
    let vector = |numbers: &[f64], k: usize| Vector3::from_column_slice(&numbers[3 * k..3 * k + 3]);
    for (k, &vehicle) in instant.vehicles.iter().enumerate() {
        let vehicle = usize::try_from(vehicle).ok().filter(|&vehicle| vehicle < vehicles);
        let vehicle = vehicle.ok_or("it speaks of a vehicle without a name")?;
        let velocity = velocities.then(|| vector(&instant.velocities_m_s, k)).filter(|v| !v.x.is_nan());
        let radius = radii.then(|| instant.radii_m[k]).filter(|radius| !radius.is_nan());
        let stamp = Stamp::Real(instant.time_s);
        rows.push(Row { stamp, place: number, vehicle, position: vector(&instant.positions_m, k), velocity, radius });
    }
    Ok(())
}

impl Rows for Exported {
    fn next(&mut self, rows: &mut Vec<Row>) -> Result<bool, ReadError> {
        let before = rows.len();
        while rows.len() < before + BATCH && self.advance(rows)? {}
        Ok(rows.len() > before)
    }

    fn vehicles(&self) -> &[String] {
        self.names.all()
    }

    fn error(&self, fault: Fault) -> ReadError {
        self.source.error(fault)
    }

    fn place(&self, number: u64) -> Place {
        Place::Part(format!("message {number} of topic `{}`", TRACKS.topic))
    }

    fn is_wide(&self) -> bool {
        true
    }
}
