//! Skybrush: a compiled trajectory of each drone (`.skyb`), or a show (`.skyc`).
//!
//! A `.skyb` file holds `skyb`, a version and blocks of a type, a length of 16 bits and a body. Version 2 has a byte of
//! features after the version and, with feature 1, a checksum of the file. The body of a trajectory is a scale of 7
//! bits, then segments ([`crate::segments`]) in units of 1 mm times the scale.
//!
//! A `.skyc` file is a zip archive with `show.json`. Skybrush compiles it to `.skyb` with rounding towards zero, from
//! durations rounded down to milliseconds. Positions and times are written such that this gives the numbers that were
//! judged.

use std::io::{Cursor, Write as _};

use rayon::prelude::*;
use serde_json::{Value, json};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::crazyflie::too_far;
use super::evaluation::Evaluator;
use super::fit::{Piece, seconds};
use super::motion::Motion;
use super::{DroneError, DroneFile, Encoded, EncodedVehicle, Vehicle, Work, check_size, first_error};
use crate::segments::{LARGEST, Trajectory, rounding_m};

/// First bytes of a `.skyb` file.
pub(crate) const MAGIC: &[u8] = b"skyb";
/// Type of the block with the trajectory.
pub(crate) const TRAJECTORY: u8 = 1;
/// Feature of a version 2 file: a checksum.
pub(crate) const HAS_CHECKSUM: u8 = 1;
/// Offset of the checksum \[bytes\].
pub(crate) const CHECKSUM_AT: usize = 6;
/// Largest scale; the eighth bit has another meaning.
const LARGEST_SCALE: u32 = 127;
/// Largest body of a block \[bytes\].
const LARGEST_BODY: usize = u16::MAX as usize;
/// Name of a block in messages.
const BLOCK: &str = "a block of a .skyb file";
/// Millimetres per metre.
const MM_PER_M: f64 = 1000.0;

/// Returns the unit of length of a scale \[m\].
pub(crate) fn unit_m(scale: u32) -> f64 {
    f64::from(scale) / MM_PER_M
}

/// Returns the checksum of a file whose own checksum is replaced by zeros: CRC-32 with the start value 0 and without a
/// final complement.
pub(crate) fn checksum(file: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new_with_initial(u32::MAX);
    let (before, rest) = file.split_at(CHECKSUM_AT.min(file.len()));
    hasher.update(before);
    hasher.update(&[0; 4]);
    hasher.update(rest.get(4..).unwrap_or_default());
    !hasher.finalize()
}

/// Trajectory of a drone in units of a scale, and the body of its block.
struct Compiled {
    scale: u32,
    trajectory: Trajectory,
    body: Vec<u8>,
    vehicle: EncodedVehicle,
}

/// Compiles the trajectory of a drone. That of a show must be compiled alike by Skybrush.
fn compiled(work: &Work<'_>, name: &str, label: &str, motion: &Motion, is_show: bool) -> Result<Compiled, DroneError> {
    let is_allowed = if is_show { is_kept } else { |_| true };
    let (scale, trajectory) = scaled(motion, |scale| {
        let unit_m = unit_m(scale);
        let encode = |pieces: &[Piece]| {
            let found = Trajectory::of_pieces(pieces, unit_m, is_show).map_err(|error| too_far(name, error, unit_m))?;
            let curve = found.motion(unit_m, Evaluator::Skybrush);
            let is_alike = !is_show || proposed_scale(reach_m(&found, scale)) == scale;
            Ok(is_alike.then_some((found, curve)))
        };
        work.within(name, motion, rounding_m(unit_m), is_allowed, encode)
    })?;
    let mut body = vec![scale_byte(scale)];
    trajectory.encode(&mut body);
    let (parts, bytes) = (trajectory.segments.len(), body.len());
    check_size(name, [parts, bytes], (BLOCK, LARGEST_BODY, false))?;
    let evaluation_m = Evaluator::Skybrush.errors_m(&trajectory, unit_m(scale));
    let vehicle = EncodedVehicle { name: name.to_owned(), label: label.to_owned(), parts, bytes, evaluation_m };
    Ok(Compiled { scale, trajectory, body, vehicle })
}

/// Returns the compiled trajectory of a drone.
pub(super) fn trajectory(
    work: &Work<'_>,
    name: &str,
    label: &str,
    motion: &Motion,
) -> Result<(DroneFile, EncodedVehicle), DroneError> {
    let Compiled { body, vehicle, .. } = compiled(work, name, label, motion, false)?;
    let bytes = file(&body, work.options.skyb_version);
    let vehicle = EncodedVehicle { bytes: bytes.len(), ..vehicle };
    Ok((DroneFile { name: format!("{label}.skyb"), bytes }, vehicle))
}

/// Calls `encode` with the smallest scale that can hold a motion. A curve may leave the range of its motion, and needs
/// a larger scale then.
fn scaled<T>(motion: &Motion, encode: impl Fn(u32) -> Result<T, DroneError>) -> Result<(u32, T), DroneError> {
    let points = motion.arcs.iter().flat_map(|arc| &arc.points);
    let reach_m = points.map(|point| point.abs().max()).fold(0.0, f64::max);
    let mut scale = proposed_scale(reach_m).min(LARGEST_SCALE);
    loop {
        match encode(scale) {
            Err(DroneError::TooFar { .. }) if scale < LARGEST_SCALE => scale += 1,
            other => return other.map(|encoded| (scale, encoded)),
        }
    }
}

/// Returns the scale that Skybrush chooses for the largest coordinate \[m\]: for 0 to 32767 mm it is 1, and so on.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "the cast saturates")]
fn proposed_scale(reach_m: f64) -> u32 {
    let extremum_mm = (reach_m * MM_PER_M).ceil();
    // A value beyond 32 bits is clamped.
    ((extremum_mm + 1.0) / 32768.0).ceil() as u32
}

/// Returns the byte of a scale, which has at most 7 bits.
fn scale_byte(scale: u32) -> u8 {
    u8::try_from(scale.min(LARGEST_SCALE)).unwrap_or(u8::MAX)
}

/// Returns a file with one block.
fn file(body: &[u8], version: u8) -> Vec<u8> {
    let length = u16::try_from(body.len()).unwrap_or(u16::MAX);
    let mut bytes = [MAGIC, &[version]].concat();
    if version == 2 {
        bytes.push(HAS_CHECKSUM);
        bytes.extend([0; 4]);
    }
    bytes.push(TRAJECTORY);
    bytes.extend(length.to_le_bytes());
    bytes.extend(body);
    if version == 2 {
        let sum = checksum(&bytes).to_le_bytes();
        bytes[CHECKSUM_AT..CHECKSUM_AT + 4].copy_from_slice(&sum);
    }
    bytes
}

/// Returns the show of all drones.
pub(super) fn show(work: &Work<'_>, vehicles: &[Vehicle<'_>]) -> Result<Encoded, DroneError> {
    let drones = vehicles.par_iter().map(|(name, label, motion)| {
        let Compiled { scale, trajectory, vehicle, .. } = compiled(work, name, label, motion, true)?;
        Ok((drone(label, &trajectory, scale), vehicle))
    });
    let (drones, vehicles): (Vec<_>, Vec<_>) = first_error(drones)?.into_iter().unzip();
    let mut show = json!({
        "version": 1,
        "environment": {"type": "outdoor"},
        "swarm": {"drones": drones},
    });
    if let Some(delta_m) = work.options.delta_m {
        show["settings"] = json!({"validation": {"minDistance": delta_m}});
    }
    let bytes = packed(&show).map_err(|error| DroneError::Write(error.to_string()))?;
    Ok(Encoded { files: vec![DroneFile { name: String::new(), bytes }], vehicles })
}

/// Returns whether Skybrush keeps a duration \[ms\]. It rounds the product of seconds and 1000 down.
fn is_kept(duration_ms: u64) -> bool {
    (seconds(duration_ms) * MM_PER_M).floor() == duration_ms as f64
}

/// Returns the coordinate \[m\] that Skybrush rounds to `number` units of a scale: the nearest one to the exact value
/// whose product does not fall short of the number.
fn coordinate_m(number: i16, scale: u32) -> f64 {
    let (number, factor) = (f64::from(number), MM_PER_M / f64::from(scale));
    let mut found = number * f64::from(scale) / MM_PER_M;
    while (found * factor).trunc() != number {
        found = if number > 0.0 { found.next_up() } else { found.next_down() };
    }
    found
}

/// Returns the largest coordinate of a trajectory \[m\].
fn reach_m(trajectory: &Trajectory, scale: u32) -> f64 {
    let points = trajectory.segments.iter().flat_map(|segment| segment.points[..3].iter().flatten());
    let numbers = points.chain(&trajectory.start[..3]);
    numbers.map(|number| coordinate_m((*number).max(-LARGEST), scale).abs()).fold(0.0, f64::max)
}

/// Returns the JSON of a drone with keyed points `[t, [x, y, z], [control points]]`.
fn drone(label: &str, trajectory: &Trajectory, scale: u32) -> Value {
    let mut position: [i16; 3] = [trajectory.start[0], trajectory.start[1], trajectory.start[2]];
    let place = |point: [i16; 3]| point.map(|number| coordinate_m(number, scale));
    let home = place(position);
    let (mut points, mut time_ms) = (vec![json!([0.0, home, []])], 0);
    for segment in &trajectory.segments {
        time_ms += u64::from(segment.duration_ms);
        let count = segment.points[0].len();
        let point = |k: usize| place([0, 1, 2].map(|axis| segment.points[axis][k]));
        let control: Vec<_> = (0..count.saturating_sub(1)).map(point).collect();
        if count > 0 {
            position = [0, 1, 2].map(|axis| segment.points[axis][count - 1]);
        }
        points.push(json!([seconds(time_ms), place(position), control]));
    }
    json!({
        "type": "generic",
        "settings": {
            "name": label,
            "home": home,
            "landAt": place(position),
            "trajectory": {"version": 1, "takeoffTime": 0, "points": points},
        },
    })
}

/// Returns the archive with the show. Its entry has a fixed time.
fn packed(show: &Value) -> Result<Vec<u8>, Box<dyn std::error::Error>> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
    archive.start_file("show.json", options.last_modified_time(zip::DateTime::default()))?;
    archive.write_all(&serde_json::to_vec(show)?)?;
    Ok(archive.finish()?.into_inner())
}

#[cfg(test)]
mod tests {
    use nalgebra::{Vector3, vector};

    use super::*;
    use crate::export::drones::motion::Arc;
    use crate::export::drones::{Dialect, DroneOptions, encode};

    fn line(to: Vector3<f64>) -> [(String, Motion); 1] {
        [("1".to_owned(), Motion { arcs: vec![Arc::straight(0.0, 60.0, Vector3::zeros(), to)] })]
    }

    #[test]
    fn bytes_are_those_of_the_specification() {
        let encoded = |version| {
            let options = DroneOptions { skyb_version: version, ..DroneOptions::new(Dialect::Skyb) };
            encode(&line(vector![10.0, 0.0, 50.0]), &options, &|| false).expect("encoded").files.remove(0).bytes
        };
        // Scale 2: 10 m are 5000 units, 50 m are 25000. Lines of x and z in 60,000 ms.
        let body = [2, 0, 0, 0, 0, 0, 0, 0, 0, 0b01_0001, 0x60, 0xea, 0x88, 0x13, 0xa8, 0x61];
        assert_eq!(encoded(1), [b"skyb\x01\x01\x10\x00", &body[..]].concat());
        let second = encoded(2);
        assert_eq!((&second[..6], &second[10..]), (&b"skyb\x02\x01"[..], &[&[1, 16, 0], &body[..]].concat()[..]));
        assert_eq!(second[6..10], bitwise(&[&second[..6], &[0; 4], &second[10..]].concat()).to_le_bytes());
    }

    /// CRC-32 of the polynomial 0x04c11db7, bit by bit, reflected, from 0 and without a complement.
    fn bitwise(bytes: &[u8]) -> u32 {
        bytes.iter().fold(0, |sum: u32, byte| {
            (0..8).fold(sum ^ u32::from(*byte), |sum, _| (sum >> 1) ^ if sum & 1 == 1 { 0xedb8_8320 } else { 0 })
        })
    }

    #[test]
    fn skybrush_compiles_a_show_to_the_judged_numbers() {
        for scale in 1..=LARGEST_SCALE {
            for number in (-LARGEST..=LARGEST).step_by(61).chain([-1, 0, 1, LARGEST]) {
                let found = coordinate_m(number, scale);
                assert_eq!((found * (MM_PER_M / f64::from(scale))).trunc(), f64::from(number), "{number} {scale}");
                assert!((found - f64::from(number) * unit_m(scale)).abs() < 1e-9);
            }
        }
        // 1.001 * 1000 is below 1001, so a duration of 1001 ms would become 1000 ms.
        assert!(is_kept(1) && is_kept(1000) && !is_kept(1001));
        assert_eq!([0.0, 32.766, 32.768, 65.534, 65.536].map(proposed_scale), [1, 1, 2, 2, 3]);
    }

    #[test]
    fn scale_grows_with_the_distance_up_to_its_largest_value() {
        let scale = |x: f64| {
            let options = DroneOptions { tolerance_m: 1.0, ..DroneOptions::new(Dialect::Skyb) };
            encode(&line(vector![x, 0.0, 0.0]), &options, &|| false).map(|encoded| encoded.files[0].bytes[13])
        };
        assert_eq!([1.0, 32.7, 33.0, 4000.0].map(|x| scale(x).expect("encoded")), [1, 1, 2, 123]);
        assert!(matches!(scale(4200.0), Err(DroneError::TooFar { largest_m: 4161.409, .. })), "{:?}", scale(4200.0));
    }
}
