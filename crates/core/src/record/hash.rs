//! SHA-256 of texts, messages and recorded states.

use std::fmt::Write as _;

use sha2::{Digest, Sha256};

use super::{Event, RecordError, Sample, Sink};
use crate::swarm::Rows;

/// SHA-256 over the bits of every recorded state.
///
/// For each sample, in order: the time, then positions, velocities and controls, each vehicle by vehicle as x, y, z,
/// all as little-endian IEEE 754 binary64. Steps, separations, energies and events are left out: they follow from the
/// states. Two runs have the same hash exactly when every recorded number has the same bits, so 0.0 differs from -0.0.
#[derive(Clone, Debug, Default)]
pub struct StateHash {
    hasher: Sha256,
    bytes: Vec<u8>,
}

impl StateHash {
    /// Returns a hash of no samples.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds one sample. Allocates only for the first one.
    pub fn observe(&mut self, sample: &Sample<'_>) {
        self.bytes.clear();
        self.bytes.extend_from_slice(&sample.time_s.to_le_bytes());
        for rows in [&sample.swarm.positions_m, &sample.swarm.velocities_m_s, sample.control] {
            append_rows(&mut self.bytes, rows);
        }
        self.hasher.update(&self.bytes);
    }

    /// Returns the hash as 64 lower-case hexadecimal digits.
    #[must_use]
    pub fn finish(self) -> String {
        hex(&self.hasher.finalize())
    }
}

impl Sink for StateHash {
    fn sample(&mut self, sample: &Sample<'_>) -> Result<(), RecordError> {
        self.observe(sample);
        Ok(())
    }

    fn event(&mut self, _event: &Event) -> Result<(), RecordError> {
        Ok(())
    }

    fn needs_steps(&self) -> bool {
        false
    }
}

fn append_rows(bytes: &mut Vec<u8>, rows: &Rows) {
    for i in 0..rows.nrows() {
        for axis in 0..3 {
            bytes.extend_from_slice(&rows[(i, axis)].to_le_bytes());
        }
    }
}

/// SHA-256 over messages, each with the name of its topic and its length.
#[derive(Clone, Debug, Default)]
pub struct MessageHash(Sha256);

impl MessageHash {
    /// Adds a message and the name of its topic.
    pub fn take(&mut self, topic: &str, message: &[u8]) {
        self.0.update(topic.as_bytes());
        self.0.update((message.len() as u64).to_le_bytes());
        self.0.update(message);
    }

    /// Returns the hash as 64 lower-case hexadecimal digits.
    #[must_use]
    pub fn digits(&self) -> String {
        hex(&self.0.clone().finalize())
    }
}

/// Returns the SHA-256 of bytes as 64 lower-case hexadecimal digits.
#[must_use]
pub fn sha256_hex(bytes: impl AsRef<[u8]>) -> String {
    hex(&Sha256::digest(bytes))
}

/// Returns bytes as lower-case hexadecimal digits.
#[must_use]
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::with_capacity(2 * bytes.len()), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::swarm::Swarm;

    fn hash_of(positions: &[f64], control: &[f64]) -> String {
        let swarm = Swarm::at_rest(Rows::from_row_slice(positions));
        let control = Rows::from_row_slice(control);
        let mut hash = StateHash::new();
        hash.observe(&Sample::new(0.5, 1, &swarm, &control));
        hash.finish()
    }

    #[test]
    fn sha256_of_abc_is_the_published_digest() {
        assert_eq!(sha256_hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    }

    #[test]
    fn the_state_hash_covers_the_documented_bytes_and_no_others() {
        let numbers = [0.5, 1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 4.0, 5.0, 6.0];
        let bytes: Vec<u8> = numbers.iter().flat_map(|x: &f64| x.to_le_bytes()).collect();
        assert_eq!(hash_of(&[1.0, 2.0, 3.0], &[4.0, 5.0, 6.0]), hex(&Sha256::digest(&bytes)));
    }

    #[test]
    fn one_bit_of_one_state_changes_the_hash() {
        let reference = hash_of(&[1.0, 2.0, 3.0], &[0.0; 3]);
        assert_eq!(reference, hash_of(&[1.0, 2.0, 3.0], &[0.0; 3]));
        assert_ne!(reference, hash_of(&[1.0, 2.0, 3.0_f64.next_up()], &[0.0; 3]));
        assert_ne!(reference, hash_of(&[1.0, 2.0, 3.0], &[0.0, -0.0, 0.0]));
    }
}
