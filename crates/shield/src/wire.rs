//! Messages as bytes of a fixed size, for radios.
//!
//! A message of a pair has [`Message::BYTES`] = 64 bytes, in little endian. The sender is the owner of the pair if its
//! number is the smaller one.
//!
//! | bytes | type | content |
//! | --- | --- | --- |
//! | 0 | u8 | version, 1 |
//! | 1 | u8 | 1 if the sender accepted the proposal with the number, 0 otherwise |
//! | 2 to 3 | u16 | sender, counted from 0 |
//! | 4 to 5 | u16 | receiver, counted from 0 |
//! | 6 to 7 | | 0 |
//! | 8 to 11 | u32 | number of the sender's period, from 1 |
//! | 12 to 15 | u32 | number of the proposal or of the decision; 0 for none |
//! | 16 to 23 | u64 | hash of the starts of the pair |
//! | owner: 24 to 47 | 3 f64 | normal of the proposed plane |
//! | owner: 48 to 55 | f64 | extent of the plane along the normal \[m\] |
//! | owner: 56 to 59 | | 0 |
//! | follower: 24 to 47 | 3 f64 | begin of the segment \[m\] |
//! | follower: 48 to 59 | 3 f32 | stop point less the begin \[m\] |
//! | 60 to 63 | u32 | CRC-32 of the bytes 0 to 59 |
//!
//! The numbers of a plane arrive bit for bit. The normal may have been rounded to single precision before it was
//! proposed: both vehicles then divide by the same length. The segment of a follower helps to choose the next plane. No
//! step of the proof uses it, so its direction is sent in single precision.

use std::fmt;

use nalgebra::Vector3;

use crate::contract::{Body, Decision, Message, Proposal};
use crate::plane::{Divider, Segment};
use crate::start::{eight, four};

const VERSION: u8 = 1;
/// Number of the bytes before the CRC-32.
const CHECKED: usize = 60;

/// Reason why bytes are not a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum WireError {
    /// The number of bytes is wrong.
    Length,
    /// The CRC-32 differs: the bytes were altered.
    Altered,
    /// The version is another one, or a byte that must be 0 is not.
    Version,
    /// A number is not finite, a normal does not have length 1, or sender and receiver are one vehicle.
    Number,
}

impl fmt::Display for WireError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(match self {
            Self::Length => "must have 64 bytes",
            Self::Altered => "was altered: its CRC-32 differs",
            Self::Version => "has another version of the format",
            Self::Number => "has a number that no vehicle sends",
        })
    }
}

impl std::error::Error for WireError {}

impl Message {
    /// Number of bytes.
    pub const BYTES: usize = 64;

    /// Returns the bytes.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        bytes[0] = VERSION;
        bytes[2..4].copy_from_slice(&self.from.to_le_bytes());
        bytes[4..6].copy_from_slice(&self.to.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.stamp.to_le_bytes());
        bytes[16..24].copy_from_slice(&self.starts.to_le_bytes());
        let number = match self.body {
            Body::Owner { proposal } => proposal.map_or(0, |Proposal { number, divider }| {
                put(&mut bytes, 24, divider.normal.map(f64::to_le_bytes));
                put(&mut bytes, 48, [divider.offset_m.to_le_bytes()]);
                number
            }),
            Body::Follower { segment, decision } => {
                put(&mut bytes, 24, segment.position_m.map(f64::to_le_bytes));
                // Rounding of the direction is allowed.
                #[allow(clippy::cast_possible_truncation)]
                let along = <[f64; 3]>::from(segment.stop() - segment.position()).map(|value| value as f32);
                put(&mut bytes, 48, along.map(f32::to_le_bytes));
                bytes[1] = u8::from(decision.is_some_and(|decision| decision.accepted));
                decision.map_or(0, |decision| decision.number)
            }
        };
        bytes[12..16].copy_from_slice(&number.to_le_bytes());
        let check = crc32fast::hash(&bytes[..CHECKED]);
        put(&mut bytes, CHECKED, [check.to_le_bytes()]);
        bytes
    }

    /// Returns the message of bytes that arrived.
    ///
    /// # Errors
    /// If the bytes are not those of a message, or were altered.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, WireError> {
        let Some(bytes) = bytes.first_chunk::<{ Self::BYTES }>().filter(|_| bytes.len() == Self::BYTES) else {
            return Err(WireError::Length);
        };
        if crc32fast::hash(&bytes[..CHECKED]) != u32::from_le_bytes(four(bytes, CHECKED)) {
            return Err(WireError::Altered);
        }
        let [from, to] = [2, 4].map(|place| u16::from_le_bytes([bytes[place], bytes[place + 1]]));
        let is_owner = from < to;
        let has_rest = is_owner && bytes[56..60] != [0; 4];
        if bytes[0] != VERSION || bytes[1] > u8::from(!is_owner) || bytes[6..8] != [0; 2] || has_rest {
            return Err(WireError::Version);
        }
        let number = u32::from_le_bytes(four(bytes, 12));
        let vector = [24, 32, 40].map(|place| f64::from_le_bytes(eight(bytes, place)));
        let body = if is_owner {
            let divider = Divider { normal: vector, offset_m: f64::from_le_bytes(eight(bytes, 48)) };
            Body::Owner { proposal: (number > 0).then_some(Proposal { number, divider }) }
        } else {
            let along = [48, 52, 56].map(|place| f64::from(f32::from_le_bytes(four(bytes, place))));
            let position = Vector3::from(vector);
            let segment = Segment::new(position, position + Vector3::from(along));
            let accepted = bytes[1] == 1;
            Body::Follower { segment, decision: (number > 0).then_some(Decision { number, accepted }) }
        };
        let stamp = u32::from_le_bytes(four(bytes, 8));
        let message = Self { from, to, stamp, starts: u64::from_le_bytes(eight(bytes, 16)), body };
        if message.is_valid() { Ok(message) } else { Err(WireError::Number) }
    }
}

/// Writes numbers one after the other from a place.
fn put<const SIZE: usize, const COUNT: usize>(bytes: &mut [u8], from: usize, numbers: [[u8; SIZE]; COUNT]) {
    for (place, number) in bytes[from..].chunks_exact_mut(SIZE).zip(numbers) {
        place.copy_from_slice(&number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::Random;

    fn messages(random: &mut Random) -> [Message; 4] {
        let divider = Divider { normal: random.direction().into(), offset_m: random.between(-1e6, 1e6) };
        let position = random.vector(1e6);
        let segment = Segment::new(position, position + random.vector(1e3));
        let owner =
            |proposal| Message { from: 3, to: 65_535, stamp: 7, starts: 1 << 63, body: Body::Owner { proposal } };
        let follower = |decision| {
            let body = Body::Follower { segment, decision };
            Message { from: 9, to: 0, stamp: u32::MAX, starts: 5, body }
        };
        [
            owner(None),
            owner(Some(Proposal { number: 4_000_000_000, divider })),
            follower(None),
            follower(Some(Decision { number: 17, accepted: random.chance(0.5) })),
        ]
    }

    #[test]
    fn a_message_survives_its_64_bytes_but_for_the_single_precision_of_a_direction() {
        let mut random = Random::new(61);
        for _ in 0..500 {
            for message in messages(&mut random) {
                let bytes = message.to_bytes();
                let read = Message::from_bytes(&bytes).expect("own bytes");
                assert_eq!(read.to_bytes(), bytes);
                match (message.body, read.body) {
                    (Body::Owner { .. }, _) => assert_eq!(read, message),
                    (Body::Follower { segment, decision }, Body::Follower { segment: other, decision: another }) => {
                        assert_eq!((segment.position_m, decision), (other.position_m, another));
                        let length = (segment.stop() - segment.position()).norm();
                        let error = (segment.stop() - other.stop()).norm();
                        assert!(error <= 1.1e-7 * length + 1e-9, "{error} {length}");
                    }
                    other => panic!("{other:?}"),
                }
            }
        }
    }

    #[test]
    fn every_flip_of_up_to_three_bits_and_every_other_length_is_refused() {
        let mut random = Random::new(62);
        for message in messages(&mut random) {
            let bytes = message.to_bytes();
            let flipped = |bits: &[usize]| {
                let mut altered = bytes;
                for bit in bits {
                    altered[bit / 8] ^= 1 << (bit % 8);
                }
                altered
            };
            let count = 8 * Message::BYTES;
            assert!((0..count).all(|bit| Message::from_bytes(&flipped(&[bit])) == Err(WireError::Altered)));
            for first in 0..count {
                assert!((0..first).all(|second| Message::from_bytes(&flipped(&[first, second])).is_err()));
            }
            for _ in 0..10_000 {
                let bits = [(); 3].map(|()| random.index(count));
                assert!(
                    Message::from_bytes(&flipped(&bits)).is_err()
                        || bits[0] == bits[1]
                        || bits[1] == bits[2]
                        || bits[0] == bits[2]
                );
            }
            assert_eq!(Message::from_bytes(&bytes[..63]), Err(WireError::Length));
            assert_eq!(Message::from_bytes(&[&bytes[..], &[0]].concat()), Err(WireError::Length));
            assert_eq!(Message::from_bytes(&[]), Err(WireError::Length));
        }
    }

    /// Returns the result for bytes with an intact CRC-32.
    fn sealed(mut bytes: [u8; Message::BYTES], change: impl Fn(&mut [u8])) -> Result<Message, WireError> {
        change(&mut bytes);
        let check = crc32fast::hash(&bytes[..CHECKED]);
        put(&mut bytes, CHECKED, [check.to_le_bytes()]);
        Message::from_bytes(&bytes)
    }

    #[test]
    fn other_versions_and_numbers_that_no_vehicle_sends_are_refused() {
        let [asks, proposes, reports, decides] = messages(&mut Random::new(63)).map(|message| message.to_bytes());
        for bytes in [asks, proposes, reports, decides] {
            for place in [0, 6, 7] {
                assert_eq!(sealed(bytes, |bytes| bytes[place] += 1), Err(WireError::Version));
            }
            assert_eq!(sealed(bytes, |bytes| bytes[1] |= 2), Err(WireError::Version));
            assert_eq!(sealed(bytes, |bytes| put(bytes, 8, [[0; 4]])), Err(WireError::Number));
            assert_eq!(sealed(bytes, |bytes| put(bytes, 2, [[5, 0], [5, 0]])), Err(WireError::Number));
        }
        assert_eq!(sealed(proposes, |bytes| bytes[1] = 1), Err(WireError::Version));
        assert_eq!(sealed(proposes, |bytes| bytes[58] = 1), Err(WireError::Version));
        for number in [f64::NAN, f64::INFINITY, 2.0] {
            assert_eq!(sealed(proposes, |bytes| put(bytes, 24, [number.to_le_bytes()])), Err(WireError::Number));
        }
        assert_eq!(sealed(decides, |bytes| put(bytes, 48, [f32::NAN.to_le_bytes()])), Err(WireError::Number));
        assert_eq!(sealed(reports, |bytes| put(bytes, 24, [f64::INFINITY.to_le_bytes()])), Err(WireError::Number));
    }
}
