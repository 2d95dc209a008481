//! Announced starts of vehicles, their bytes, and the hash of the two starts of a pair.
//!
//! Each vehicle makes its own start from its own settings and sends the bytes to the others. The first plane of a pair
//! is computed from both announced starts. So both sides compute the same plane, also with different brakes, periods,
//! errors and limits.
//!
//! # Bytes
//! A start has [`Start::BYTES`] bytes, in little endian:
//!
//! | bytes | type | content |
//! | --- | --- | --- |
//! | 0 to 3 | | `TLS1` |
//! | 4 to 7 | u32 | CRC-32 of the bytes 8 to 143 |
//! | 8 to 15 | u64 | number of the flight |
//! | 16 to 63 | 6 f64 | position \[m\], velocity \[m/s\] |
//! | 64 to 111 | 6 f64 | reserved segment: its begin and its stop point \[m\] |
//! | 112 to 119 | f64 | margin \[m\], in scaled lengths |
//! | 120 to 127 | f64 | safety distance delta \[m\] |
//! | 128 to 135 | f64 | factor of vertical lengths; 1 for balls |
//! | 136 to 143 | f64 | reach of a period at the largest speed, with the lead \[m\] |
//!
//! The number of the flight distinguishes the messages of two flights with equal starts.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use crate::brake::State;
use crate::plane::{Metric, Segment};
use crate::settings::{FARTHEST_M, ROUNDING_M, ShieldError, ShieldFault};

const MAGIC: [u8; 4] = *b"TLS1";
/// Number of doubles of a start.
const NUMBERS: usize = 16;
/// Domain of the hash of a pair, so that it differs from other hashes of the same bytes.
const DOMAIN: &[u8] = b"tautline shield: starts of owner and follower, 1\n";
/// Excess of a distance that is rounding \[m\].
const EXCESS_M: f64 = 1e-9;

/// Start of a vehicle as announced to all.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Start {
    /// State of the reference.
    pub state: State,
    /// Reserved segment.
    pub segment: Segment,
    /// Distance that the vehicle keeps from the plane between a pair \[m\], in scaled lengths.
    pub margin_m: f64,
    /// Number of the flight, which the vehicle chooses anew for each flight.
    pub flight: u64,
    pub(crate) delta_m: f64,
    pub(crate) metric: Metric,
    /// Reach of a period at the largest speed, and the lead \[m\].
    pub(crate) reach_m: f64,
}

impl Start {
    /// Number of bytes.
    pub const BYTES: usize = 16 + 8 * NUMBERS;

    /// Returns this start with another number of the flight. [`Limits::start`](crate::Limits::start) gives 0.
    ///
    /// Vehicles whose messages of earlier flights may still arrive need a number that no earlier flight from the same
    /// starts had, such as the time of the flight.
    #[must_use]
    pub fn with_flight(self, flight: u64) -> Self {
        Self { flight, ..self }
    }

    /// Smallest separation that the vehicle certifies \[m\].
    #[must_use]
    pub fn delta_m(&self) -> f64 {
        self.delta_m
    }

    /// Lengths in which vehicles are delta apart.
    #[must_use]
    pub fn metric(&self) -> Metric {
        self.metric
    }

    /// Returns the bytes to be sent to all other vehicles.
    #[must_use]
    pub fn to_bytes(&self) -> [u8; Self::BYTES] {
        let mut bytes = [0; Self::BYTES];
        bytes[8..16].copy_from_slice(&self.flight.to_le_bytes());
        for (place, number) in bytes[16..].chunks_exact_mut(8).zip(self.numbers()) {
            place.copy_from_slice(&number.to_le_bytes());
        }
        let check = crc32fast::hash(&bytes[8..]);
        bytes[..4].copy_from_slice(&MAGIC);
        bytes[4..8].copy_from_slice(&check.to_le_bytes());
        bytes
    }

    /// Returns the start of bytes that another vehicle sent.
    ///
    /// # Errors
    /// If the bytes are not those of a start, were altered, or hold a number that no vehicle announces.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, ShieldError> {
        let fails = |problem: &str, value: f64| {
            Err(ShieldError::new(
                ShieldFault::Altered,
                "start",
                problem.into(),
                value,
                "send the bytes of `Start::to_bytes` unaltered",
            ))
        };
        let Some(bytes) = bytes.first_chunk::<{ Self::BYTES }>().filter(|_| bytes.len() == Self::BYTES) else {
            return fails(&format!("must have {} bytes", Self::BYTES), bytes.len() as f64);
        };
        if bytes[..4] != MAGIC {
            return fails("the bytes do not begin with `TLS1`", f64::from(bytes[0]));
        }
        let (check, found) = (crc32fast::hash(&bytes[8..]), u32::from_le_bytes(four(bytes, 4)));
        if check != found {
            return fails("the bytes were altered: their CRC-32 differs", f64::from(found));
        }
        let mut numbers = [0.0; NUMBERS];
        for (number, place) in numbers.iter_mut().zip(bytes[16..].as_chunks::<8>().0) {
            *number = f64::from_le_bytes(*place);
        }
        let vector = |from: usize| Vector3::new(numbers[from], numbers[from + 1], numbers[from + 2]);
        let start = Self {
            state: State { position_m: vector(0), velocity_m_s: vector(3) },
            segment: Segment::new(vector(6), vector(9)),
            margin_m: numbers[12],
            flight: u64::from_le_bytes(eight(bytes, 8)),
            delta_m: numbers[13],
            metric: Metric::of_vertical(numbers[14]),
            reach_m: numbers[15],
        };
        start.check()?;
        Ok(start)
    }

    fn numbers(&self) -> [f64; NUMBERS] {
        let [px, py, pz] = self.state.position_m.into();
        let [vx, vy, vz] = self.state.velocity_m_s.into();
        let Segment { position_m: [qx, qy, qz], stop_m: [sx, sy, sz] } = self.segment;
        let vertical = self.metric.vertical();
        [px, py, pz, vx, vy, vz, qx, qy, qz, sx, sy, sz, self.margin_m, self.delta_m, vertical, self.reach_m]
    }

    /// Checks the numbers of an own or an announced start.
    ///
    /// # Errors
    /// If a number is not finite or out of range, or a coordinate is beyond 1e6 m.
    pub(crate) fn check(&self) -> Result<(), ShieldError> {
        let fails = |problem: &str, value: f64, remedy| {
            Err(ShieldError::new(ShieldFault::OutOfRange, "start", problem.into(), value, remedy))
        };
        if let Some(value) = self.numbers().into_iter().find(|value| !value.is_finite()) {
            return fails("must be finite", value, "give a position and a velocity");
        }
        check_coordinates(&self.state.position_m, FARTHEST_M)?;
        self.check_segment(FARTHEST_M)?;
        let vertical = self.metric.vertical();
        if !(self.delta_m > 0.0 && vertical > 0.0 && self.reach_m >= 0.0) {
            let value = self.delta_m.min(vertical).min(self.reach_m);
            return fails("delta, ellipsoid and reach must be above 0", value, "announce the start of valid settings");
        }
        let error_m = self.margin_m - f64::midpoint(self.delta_m, ROUNDING_M * self.metric.stretch());
        if error_m < -EXCESS_M {
            let remedy = "announce the start of valid settings";
            return fails("the margin must be at least half of delta and rounding", self.margin_m, remedy);
        }
        let beside_m = self.metric.scaled(&(self.segment.position() - self.state.position_m)).norm();
        if beside_m > error_m + EXCESS_M {
            let problem = "the reserved segment begins farther from the position than the margin allows";
            return fails(problem, beside_m, "announce the start of valid settings");
        }
        Ok(())
    }

    /// Checks that the reserved segment is within these coordinates.
    pub(crate) fn check_segment(&self, farthest_m: f64) -> Result<(), ShieldError> {
        check_coordinates(&self.segment.position(), farthest_m)?;
        check_coordinates(&self.segment.stop(), farthest_m)
    }
}

/// Checks that the coordinates of a point of a start are within a limit.
fn check_coordinates(point_m: &Vector3<f64>, farthest_m: f64) -> Result<(), ShieldError> {
    let coordinate = point_m.amax();
    if coordinate <= farthest_m {
        return Ok(());
    }
    let problem = format!("reserves space farther than {farthest_m} m from the origin along an axis");
    Err(ShieldError::new(
        ShieldFault::OutOfRange,
        "start",
        problem,
        coordinate,
        "use a local frame with its origin near the vehicles",
    ))
}

/// Returns the hash of the starts of an owner and a follower, which each message of the pair carries.
pub(crate) fn hash_of_pair(owner: &Start, follower: &Start) -> u64 {
    let mut hash = Sha256::new();
    hash.update(DOMAIN);
    hash.update(owner.to_bytes());
    hash.update(follower.to_bytes());
    u64::from_le_bytes(eight(&hash.finalize(), 0))
}

/// Returns four bytes from a place.
pub(crate) fn four(bytes: &[u8], from: usize) -> [u8; 4] {
    std::array::from_fn(|k| bytes[from + k])
}

/// Returns eight bytes from a place.
pub(crate) fn eight(bytes: &[u8], from: usize) -> [u8; 8] {
    std::array::from_fn(|k| bytes[from + k])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::Settings;
    use crate::tests::Random;
    use crate::unicycle::{Loiter, Pose};

    fn starts() -> [Start; 3] {
        let level = Settings { half_height_m: Some(0.8), ..Settings::new(1.0, 0.05) }.limits().expect("valid");
        let ball = Settings { position_error_m: 0.03, ..Settings::new(1.0, 0.02) }.limits().expect("valid");
        let loiter = Loiter {
            delta_m: 1.0,
            period_s: 0.1,
            min_speed_m_s: 0.5,
            max_speed_m_s: 2.0,
            accel_m_s2: 1.0,
            turn_rad_s: 1.5,
            tracking_error_m: 0.2,
            is_left: true,
        };
        let state = State { position_m: Vector3::new(3.0, -0.0, 9e5), velocity_m_s: Vector3::new(0.5, 1.0, -0.2) };
        let pose = Pose { position_m: Vector3::new(5.0, 1.0, 0.0), heading_rad: 0.7, speed_m_s: 1.1 };
        let loiters = loiter.start(&pose).expect("valid");
        [level.start(state).expect("valid"), ball.start(state).expect("valid").with_flight(u64::MAX), loiters]
    }

    #[test]
    fn a_start_survives_its_bytes() {
        for start in starts() {
            let read = Start::from_bytes(&start.to_bytes()).expect("own bytes");
            assert_eq!((read, read.to_bytes()), (start, start.to_bytes()));
        }
    }

    #[test]
    fn every_flip_of_a_bit_and_every_other_length_is_refused() {
        let mut random = Random::new(51);
        for start in starts() {
            let bytes = start.to_bytes();
            for bit in 0..8 * Start::BYTES {
                let mut altered = bytes;
                altered[bit / 8] ^= 1 << (bit % 8);
                let error = Start::from_bytes(&altered).expect_err("altered").to_string();
                assert!(error.starts_with("start: "), "{error}");
            }
            for length in [0, 1, Start::BYTES - 1] {
                assert!(Start::from_bytes(&bytes[..length]).is_err());
            }
            assert!(Start::from_bytes(&[&bytes[..], &[0]].concat()).is_err());
            let noise: Vec<u8> = (0..Start::BYTES).map(|_| u8::try_from(random.index(256)).expect("a byte")).collect();
            assert!(Start::from_bytes(&noise).is_err());
        }
    }

    /// Returns the refusal of a start whose bytes are intact.
    fn refused(change: impl Fn(&mut Start)) -> String {
        let mut start = starts()[1];
        change(&mut start);
        Start::from_bytes(&start.to_bytes()).expect_err("refused").to_string()
    }

    #[test]
    fn numbers_that_no_vehicle_announces_are_refused() {
        assert!(refused(|start| start.state.velocity_m_s.x = f64::NAN).starts_with("start: must be finite (NaN)"));
        assert!(refused(|start| start.reach_m = f64::INFINITY).starts_with("start: must be finite (inf)"));
        let far = refused(|start| start.segment.stop_m[0] = 2e6);
        assert!(far.contains("farther than 1000000 m") && far.contains("a local frame"), "{far}");
        assert!(refused(|start| start.delta_m = 0.0).contains("must be above 0"));
        assert!(refused(|start| start.metric = Metric::of_vertical(-1.0)).contains("must be above 0"));
        assert!(refused(|start| start.margin_m = 0.4).contains("at least half of delta"));
        assert!(refused(|start| start.segment.position_m[0] += 0.5).contains("farther from the position"));
    }

    #[test]
    fn each_number_of_each_start_changes_the_hash_of_the_pair() {
        let [.., owner, follower] = starts();
        let hash = hash_of_pair(&owner, &follower);
        assert_eq!(hash, hash_of_pair(&owner, &follower));
        assert_ne!(hash, hash_of_pair(&follower, &owner));
        let changes: [fn(&mut Start); 9] = [
            |start| start.state.position_m.z += 1e-9,
            |start| start.state.velocity_m_s.y += 1e-9,
            |start| start.segment.position_m[1] += 1e-9,
            |start| start.segment.stop_m[2] += 1e-9,
            |start| start.margin_m += 1e-9,
            |start| start.flight ^= 1,
            |start| start.delta_m += 1e-9,
            |start| start.metric = Metric::of_vertical(1.0 + 1e-9),
            |start| start.reach_m += 1e-9,
        ];
        for change in changes {
            let (mut one, mut other) = (owner, follower);
            change(&mut one);
            change(&mut other);
            assert!(![hash_of_pair(&one, &follower), hash_of_pair(&owner, &other)].contains(&hash));
        }
    }
}
