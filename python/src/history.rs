//! History of a simulation, from which another process repeats its bits.
//!
//! A saved simulation is its scenario, the accelerations from outside, and the commands of a law in Python. The same
//! program repeats the flight from them with the same bits. A law in Python is not called for this.

use std::sync::Arc;

use pyo3::prelude::*;
use serde_json::{Value, json};
use sha2::{Digest as _, Sha256};
use tautline::campaign::Program;
use tautline::request::Failure;
use tautline::swarm::{Rows, Swarm};

use crate::errors::{IntoException as _, internal_error, wrong_input};
use crate::numbers::by_row;

/// Length of the SHA-256 of all bytes, which ends a saved simulation \[bytes\].
const HASH: usize = 32;
/// First bytes of a saved simulation.
const MAGIC: &[u8] = b"tautline simulation 1\n";
/// Largest memory of the commands of a history \[bytes\]. A longer history is dropped ([`TOO_LONG`]).
const MAX_BYTES: usize = 256 << 20;
/// Tags of the records of a saved simulation.
const OWN: u8 = 1;
const OUTSIDE: u8 = 2;
const RESEED: u8 = 3;
const COMMAND: u8 = 4;
const FAILED: u8 = 5;
const STATE: u8 = 6;

/// Call of a law in Python: its command, or `None` if it failed.
pub(crate) type Call = Option<Arc<Rows>>;

/// Part of the history of a simulation.
#[derive(Clone)]
pub(crate) enum Part {
    /// Steps under the law.
    Own(u64),
    /// Steps with accelerations from outside.
    Outside(Arc<Rows>, u64),
    /// Another seed of noise.
    Reseed(u64),
}

/// Everything that determines the state of a simulation, besides its scenario.
#[derive(Clone, Default)]
pub(crate) struct History {
    pub(crate) parts: Vec<Part>,
    /// Calls of the law in Python, in order.
    pub(crate) calls: Vec<Call>,
    bytes: usize,
    /// Reason and remedy, if the history is not known.
    lost: Option<&'static str>,
}

/// Reason of a history that was too long, and its remedy.
const TOO_LONG: &str = "the accelerations of the flight so far exceed 256 MiB and were dropped; save earlier, or let a \
                        law of the scenario fly";
/// Reason of a copy of a world, and its remedy.
const OF_A_WORLD: &str =
    "a copy of a world of a VectorSimulation has no history; fly a Simulation of the same scenario";

impl History {
    /// Returns the history of a copy of a world, which is not known.
    pub(crate) fn of_world() -> Self {
        Self { lost: Some(OF_A_WORLD), ..Self::default() }
    }

    /// Adds steps, with accelerations if they came from outside. Returns `None` for more than 2^64 steps.
    #[must_use]
    pub(crate) fn add_steps(&mut self, commands: Option<&Arc<Rows>>, steps: u64) -> Option<()> {
        let same = |one: &Rows, other: &Rows| one.iter().map(|x| x.to_bits()).eq(other.iter().map(|x| x.to_bits()));
        match (self.parts.last_mut(), commands) {
            _ if steps == 0 => {}
            (Some(Part::Own(count)), None) => *count = count.checked_add(steps)?,
            (Some(Part::Outside(before, count)), Some(commands)) if same(before, commands) => {
                *count = count.checked_add(steps)?;
            }
            (_, None) => self.parts.push(Part::Own(steps)),
            (_, Some(commands)) => {
                self.parts.push(Part::Outside(Arc::clone(commands), steps));
                self.count(commands.len());
            }
        }
        Some(())
    }

    /// Adds calls of the law in Python.
    pub(crate) fn add_calls(&mut self, calls: Vec<Call>) {
        let numbers = calls.iter().flatten().map(|command| command.len()).sum();
        self.calls.extend(calls);
        self.count(numbers);
    }

    /// Adds another seed of noise.
    pub(crate) fn reseed(&mut self, seed: u64) {
        self.parts.push(Part::Reseed(seed));
    }

    fn count(&mut self, numbers: usize) {
        self.bytes += 8 * numbers;
        if self.bytes > MAX_BYTES || self.lost.is_some() {
            *self = Self { lost: self.lost.or(Some(TOO_LONG)), ..Self::default() };
        }
    }

    /// Returns a saved simulation with this history and state.
    ///
    /// # Errors
    /// `Error` if the history is not known.
    pub(crate) fn save(&self, toml: &str, law: Option<&str>, state: &Swarm) -> PyResult<Vec<u8>> {
        if let Some(lost) = self.lost {
            return Err(wrong_input(format!("save: {lost}")));
        }
        let program = Program::running().map_err(Failure::into_exception)?.sha256;
        let header = json!({ "program": program, "law": law, "vehicles": state.count(), "scenario": toml });
        let header = serde_json::to_vec(&header).map_err(|error| internal_error(&error.to_string()))?;
        let mut bytes = [MAGIC, &header, b"\n"].concat();
        let rows = |bytes: &mut Vec<u8>, rows: &Rows| by_row(rows).for_each(|x| bytes.extend(x.to_le_bytes()));
        for call in &self.calls {
            bytes.push(if call.is_some() { COMMAND } else { FAILED });
            if let Some(command) = call {
                rows(&mut bytes, command);
            }
        }
        for part in &self.parts {
            match part {
                Part::Own(steps) => {
                    bytes.push(OWN);
                    bytes.extend(steps.to_le_bytes());
                }
                Part::Outside(commands, steps) => {
                    bytes.push(OUTSIDE);
                    bytes.extend(steps.to_le_bytes());
                    rows(&mut bytes, commands);
                }
                Part::Reseed(seed) => {
                    bytes.push(RESEED);
                    bytes.extend(seed.to_le_bytes());
                }
            }
        }
        bytes.push(STATE);
        rows(&mut bytes, &state.positions_m);
        rows(&mut bytes, &state.velocities_m_s);
        bytes.extend(Sha256::digest(&bytes));
        Ok(bytes)
    }
}

/// Contents of a saved simulation.
pub(crate) struct Saved {
    /// Resolved scenario.
    pub(crate) toml: String,
    /// Name of its law in Python.
    pub(crate) law: Option<String>,
    pub(crate) history: History,
    /// State at the time of saving.
    pub(crate) positions_m: Rows,
    pub(crate) velocities_m_s: Rows,
}

impl Saved {
    /// Reads a saved simulation.
    ///
    /// # Errors
    /// `Error` for other bytes, for truncated ones, and for those of another program.
    pub(crate) fn read(bytes: &[u8]) -> PyResult<Self> {
        let remedy = "give the bytes that save() returned";
        let wrong = |problem: &str| wrong_input(format!("data: {problem} ({} bytes); {remedy}", bytes.len()));
        let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| wrong("this is no saved simulation"))?;
        let end = rest.iter().position(|&byte| byte == b'\n').ok_or_else(|| wrong("it is truncated"))?;
        let header: Value = serde_json::from_slice(&rest[..end]).map_err(|_| wrong("its header is damaged"))?;
        let text = |key: &str| header[key].as_str().map(str::to_owned);
        let damaged = || wrong("its header is damaged");
        let program = Program::running().map_err(Failure::into_exception)?.sha256;
        let (saved_by, toml) = (text("program").ok_or_else(damaged)?, text("scenario").ok_or_else(damaged)?);
        if saved_by != program {
            return Err(wrong_input(format!(
                "data: the simulation was saved by another program (SHA-256 {saved_by}, this is {program}); load it \
                 with that one"
            )));
        }
        let vehicles = header["vehicles"].as_u64().and_then(|count| usize::try_from(count).ok()).ok_or_else(damaged)?;
        let truncated = || wrong("it is truncated or damaged");
        let (records, hash) = rest[end + 1..].split_last_chunk::<HASH>().ok_or_else(truncated)?;
        if Sha256::digest(&bytes[..bytes.len() - HASH])[..] != hash[..] {
            return Err(truncated());
        }
        let mut reader = Reader { bytes: records, vehicles };
        let mut history = History::default();
        loop {
            match reader.tag().ok_or_else(truncated)? {
                OWN => {
                    let steps = reader.integer().ok_or_else(truncated)?;
                    history.add_steps(None, steps).ok_or_else(truncated)?;
                }
                OUTSIDE => {
                    let steps = reader.integer().ok_or_else(truncated)?;
                    let commands = reader.rows().ok_or_else(truncated)?;
                    history.add_steps(Some(&Arc::new(commands)), steps).ok_or_else(truncated)?;
                }
                RESEED => history.reseed(reader.integer().ok_or_else(truncated)?),
                COMMAND => history.add_calls(vec![Some(Arc::new(reader.rows().ok_or_else(truncated)?))]),
                FAILED => history.add_calls(vec![None]),
                STATE => break,
                _ => return Err(truncated()),
            }
        }
        let (positions_m, velocities_m_s) = (reader.rows(), reader.rows());
        let is_whole = reader.bytes.is_empty();
        let state = positions_m.zip(velocities_m_s).filter(|_| is_whole).ok_or_else(truncated)?;
        Ok(Self { toml, law: text("law"), history, positions_m: state.0, velocities_m_s: state.1 })
    }

    /// Returns whether a state has the bits of the saved one.
    pub(crate) fn is_state(&self, state: &Swarm) -> bool {
        let same = |one: &Rows, other: &Rows| {
            one.len() == other.len() && one.iter().zip(other.iter()).all(|(a, b)| a.to_bits() == b.to_bits())
        };
        same(&self.positions_m, &state.positions_m) && same(&self.velocities_m_s, &state.velocities_m_s)
    }
}

/// Reads the records of a saved simulation.
struct Reader<'a> {
    bytes: &'a [u8],
    vehicles: usize,
}

impl Reader<'_> {
    fn tag(&mut self) -> Option<u8> {
        let (&tag, rest) = self.bytes.split_first()?;
        self.bytes = rest;
        Some(tag)
    }

    fn integer(&mut self) -> Option<u64> {
        let (number, rest) = self.bytes.split_first_chunk::<8>()?;
        self.bytes = rest;
        Some(u64::from_le_bytes(*number))
    }

    /// Reads a table N x 3. Memory grows with the bytes that are there.
    fn rows(&mut self) -> Option<Rows> {
        let length = self.vehicles.checked_mul(24).filter(|&length| length <= self.bytes.len())?;
        let (numbers, rest) = self.bytes.split_at(length);
        self.bytes = rest;
        let numbers = numbers.chunks_exact(8).filter_map(|chunk| chunk.try_into().ok().map(f64::from_le_bytes));
        let numbers: Vec<_> = numbers.collect();
        Some(Rows::from_fn(self.vehicles, |i, axis| numbers[3 * i + axis]))
    }
}
