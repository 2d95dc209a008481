//! Reads compressed segments: compiled Skybrush trajectories (`.skyb`), and compressed trajectories of Crazyflies.
//!
//! A file holds one drone, which is named after the file. Its times count from the start of the trajectory. Lights, yaw
//! and other blocks of a Skybrush file are not read. [`crate::segments`] describes the segments.

use std::io::Read as _;

use super::curves::{Curve, Curves, curves_of, piece, powers, stand_throughout};
use super::error::{ContentKind, Fault, Place, ReadError, refuse};
use super::format::Format;
use super::options::ReadOptions;
use super::order::Recording;
use super::source::{Source, VehicleFiles};
use crate::export::drones::fit::seconds;
use crate::export::drones::skybrush as skyb;
use crate::segments::{Trajectory, Truncated};
use tautline_core::track::{Item, Sample};

pub(super) fn open_crazyflie(
    vehicles: VehicleFiles,
    left_out: Option<String>,
    options: &ReadOptions,
) -> Result<Recording, ReadError> {
    open(vehicles, crazyflie, left_out, options)
}

pub(super) fn open_skyb(
    vehicles: VehicleFiles,
    left_out: Option<String>,
    options: &ReadOptions,
) -> Result<Recording, ReadError> {
    open(vehicles, skybrush, left_out, options)
}

/// Trajectory of a file, with its unit of length \[m\].
type Decoded = (Trajectory, f64);

fn open(
    vehicles: VehicleFiles,
    decode: fn(&[u8]) -> Result<Decoded, ReadError>,
    left_out: Option<String>,
    options: &ReadOptions,
) -> Result<Recording, ReadError> {
    let append = |curve: &mut Curve, file: &Source| {
        let mut bytes = Vec::new();
        file.bytes()?.read_to_end(&mut bytes)?;
        let (trajectory, unit_m) = decode(&bytes)?;
        append(curve, &trajectory, unit_m)
    };
    let (mut curves, notes) = curves_of(vehicles, left_out, options, append)?;
    stand_throughout(curves.iter_mut().map(|(_, items)| items));
    Ok(Curves::recording(curves, notes))
}

fn crazyflie(bytes: &[u8]) -> Result<Decoded, ReadError> {
    let (trajectory, length) = Trajectory::decode(bytes, true).map_err(|fault| truncated(fault, 0))?;
    if length < bytes.len() {
        let problem = format!("{} bytes follow the segment without a duration, which ends it", bytes.len() - length);
        let fault = Fault::content(ContentKind::Damaged, problem, "write the trajectory again");
        return Err(fault.at(Place::Byte(length as u64)));
    }
    Ok((trajectory, skyb::unit_m(1)))
}

fn skybrush(bytes: &[u8]) -> Result<Decoded, ReadError> {
    if !bytes.starts_with(skyb::MAGIC) {
        return Err(Fault::wrong_format(Format::SKYB).into());
    }
    let (start, body) = trajectory_block(bytes, start_of_blocks(bytes)?)?;
    let Some((&first, segments)) = body.split_first() else {
        return Err(truncated(Truncated { byte: 0 }, start));
    };
    // The eighth bit states whether the yaw is used.
    let scale = u32::from(first & 0x7f);
    if scale == 0 {
        let fault =
            Fault::content(ContentKind::NoPositions, "the scale of its trajectory is 0", "compile the show again");
        return Err(fault.at(Place::Byte(start as u64)));
    }
    let (trajectory, _) = Trajectory::decode(segments, false).map_err(|fault| truncated(fault, start + 1))?;
    Ok((trajectory, skyb::unit_m(scale)))
}

/// Checks the header of a Skybrush file and returns the offset of its first block.
fn start_of_blocks(bytes: &[u8]) -> Result<usize, ReadError> {
    let version_at = skyb::MAGIC.len();
    let again = "compile the show again, or give the .skyc show";
    let unsupported = |problem: String, byte: usize| {
        Err(Fault::content(ContentKind::UnsupportedFormat, problem, again).at(Place::Byte(byte as u64)))
    };
    let missing = || Fault::truncated("its header is incomplete");
    match bytes.get(version_at).ok_or_else(missing)? {
        1 => return Ok(version_at + 1),
        2 => {}
        version => return unsupported(format!("the version of the file is {version}, expected 1 or 2"), version_at),
    }
    let features = *bytes.get(version_at + 1).ok_or_else(missing)?;
    if features == 0 {
        return Ok(version_at + 2);
    }
    if features != skyb::HAS_CHECKSUM {
        return unsupported(format!("its features {features:#04x} are unknown, expected 0x00 or 0x01"), version_at + 1);
    }
    let end = skyb::CHECKSUM_AT + 4;
    let stored = bytes.get(skyb::CHECKSUM_AT..end).and_then(|sum| sum.try_into().ok()).map(u32::from_le_bytes);
    let (stored, sum) = (stored.ok_or_else(missing)?, skyb::checksum(bytes));
    if stored != sum {
        let problem = format!("its checksum is {sum:08x}, and the file states {stored:08x}");
        return Err(Fault::damaged(problem).at(Place::Byte(skyb::CHECKSUM_AT as u64)));
    }
    Ok(end)
}

/// Returns the first block with a trajectory: the offset of its body, and the body.
fn trajectory_block(bytes: &[u8], mut offset: usize) -> Result<(usize, &[u8]), ReadError> {
    while offset < bytes.len() {
        let block = || {
            let &[kind, low, high] = bytes.get(offset..offset + 3)? else { return None };
            let body = bytes.get(offset + 3..offset + 3 + usize::from(u16::from_le_bytes([low, high])))?;
            Some((kind, body))
        };
        let Some((kind, body)) = block() else {
            return Err(Fault::truncated("a block is incomplete").at(Place::Byte(offset as u64)));
        };
        if kind == skyb::TRAJECTORY {
            return Ok((offset + 3, body));
        }
        offset += 3 + body.len();
    }
    refuse(ContentKind::NoPositions, "it has no trajectory", "export the show with the paths of its drones")
}

/// Adds the segments of a trajectory to the curve of its vehicle.
fn append(curve: &mut Curve, trajectory: &Trajectory, unit_m: f64) -> Result<(), ReadError> {
    let (mut from_ms, scale) = (0, curve.scale);
    for (duration_ms, points) in trajectory.curves(unit_m) {
        let to_ms = from_ms + u64::from(duration_ms);
        // A segment without a duration is a jump to the start of the next one.
        if duration_ms > 0 {
            let (from_s, to_s) = (seconds(from_ms), seconds(to_ms));
            let coefficients = powers(&points, to_s - from_s);
            let piece = piece(curve.vehicle, from_s, to_s, coefficients, scale).ok_or_else(Fault::out_of_range)?;
            curve.items.push(Item::Piece(piece));
        }
        from_ms = to_ms;
    }
    if curve.items.is_empty() {
        let [x, y, z, _] = trajectory.start.map(|number| f64::from(number) * unit_m * scale);
        let (vehicle, position_m) = (curve.vehicle, [x, y, z].into());
        curve.items.push(Item::Sample(Sample { vehicle, time_s: 0.0, position_m, velocity_m_s: None, radius_m: None }));
    }
    Ok(())
}

/// Returns the error of an incomplete segment of a body that begins at an offset.
fn truncated(fault: Truncated, start: usize) -> ReadError {
    Fault::truncated("a segment of its trajectory is incomplete").at(Place::Byte((start + fault.byte) as u64))
}
