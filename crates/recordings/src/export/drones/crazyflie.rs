//! Crazyflie trajectories: a CSV of polynomials, or compressed segments.
//!
//! The firmware holds trajectories in 4,096 bytes. A polynomial takes 132 bytes: 4 axes of 8 coefficients and the
//! duration, in single precision. The CSV holds these numbers as the firmware rounds them. The compressed form holds
//! the start, segments and a last segment without a duration; see [`crate::segments`].

use std::fmt::Write as _;

use nalgebra::Vector3;

use super::evaluation::{Evaluator, ROUNDING};
use super::fit::{POINTS, Piece, seconds};
use super::motion::{Arc, Motion};
use super::{DroneError, DroneFile, EncodedVehicle, Work, check_size};
use crate::segments::{HEAD_BYTES, LARGEST, OutOfRange, Trajectory, rounding_m};

/// Memory of the firmware for trajectories \[bytes\].
pub(super) const MEMORY_BYTES: usize = 4096;
/// Size of a polynomial in this memory \[bytes\].
const PIECE_BYTES: usize = 132;
/// Bound on the error of a polynomial that the firmware computes in single precision, relative to the sum of
/// `|c_k| T^k`. Scheme of Horner: 14 roundings; time: 7, one for each power. The others cover sums of errors.
const EVALUATION: f64 = 24.0 * ROUNDING;
/// Factor of bounds that covers sums of errors, and rounding in double precision.
const SUMS: f64 = 1.01;
/// Unit of length of compressed segments \[m\].
const UNIT_M: f64 = 1e-3;
/// Name of the memory in messages.
const MEMORY: &str = "the memory of a Crazyflie";

/// Polynomial as the firmware holds it: duration \[s\] and coefficients of the powers of time \[m/s^k\].
struct Polynomial {
    duration_s: f32,
    powers: [Vector3<f32>; POINTS],
}

/// Returns the CSV of a vehicle.
pub(super) fn polynomials(
    work: &Work<'_>,
    name: &str,
    label: &str,
    motion: &Motion,
) -> Result<(DroneFile, EncodedVehicle), DroneError> {
    // The sum of `|c_k| T^k` is at least the distance from the origin.
    let points = motion.arcs.iter().flat_map(|arc| [arc.points[0], arc.points[arc.points.len() - 1]]);
    let least_m = EVALUATION * points.map(|point| point.norm()).fold(0.0, f64::max);
    let (found, evaluation_m) = work.within(
        name,
        motion,
        least_m,
        |_| true,
        |pieces| {
            let (polynomials, evaluation_m, curve) = rounded(pieces);
            Ok(Some(((polynomials, evaluation_m), curve)))
        },
    )?;
    let bytes = found.len() * PIECE_BYTES;
    check_size(name, [found.len(), bytes], (MEMORY, MEMORY_BYTES, true))?;
    let file = DroneFile { name: format!("{label}.csv"), bytes: csv(&found).into_bytes() };
    let (name, label) = (name.to_owned(), label.to_owned());
    Ok((file, EncodedVehicle { name, label, parts: found.len(), bytes, evaluation_m }))
}

/// Rounds pieces to single precision; also returns the error of each in the firmware \[m\], and the curve of the
/// rounded numbers with these errors.
#[expect(clippy::cast_possible_truncation, reason = "the firmware has single precision")]
fn rounded(pieces: &[Piece]) -> (Vec<Polynomial>, Vec<f64>, Motion) {
    let (mut polynomials, mut arcs, mut from_s) = (Vec::with_capacity(pieces.len()), Vec::new(), 0.0);
    let mut end_ms = 0;
    for piece in pieces {
        let arc = Arc {
            from_s: 0.0,
            to_s: seconds(u64::from(piece.duration_ms)),
            points: piece.points.to_vec(),
            rounding_m: 0.0,
        };
        // Up to the exact end of the piece, so that rounding does not add up.
        end_ms += u64::from(piece.duration_ms);
        let duration_s = (seconds(end_ms) - from_s) as f32;
        let mut powers = [Vector3::zeros(); POINTS];
        for (power, exact) in powers.iter_mut().zip(arc.powers()) {
            // Adding 0 turns -0 into 0.
            *power = exact.map(|x| x as f32 + 0.0);
        }
        let to_s = from_s + f64::from(duration_s);
        arcs.push(Arc::of_powers(from_s, to_s, &powers.map(|power| power.map(f64::from))));
        polynomials.push(Polynomial { duration_s, powers });
        from_s = to_s;
    }
    let mut evaluation_m = clock_errors_m(&arcs);
    for (arc, error_m) in arcs.iter_mut().zip(&mut evaluation_m) {
        let length_s = arc.to_s - arc.from_s;
        // Horner's scheme from the last coefficient on.
        let size_m = arc.powers().iter().rev().fold(0.0, |sum, power| sum * length_s + power.norm());
        *error_m += EVALUATION * size_m;
        arc.rounding_m += *error_m;
    }
    (polynomials, evaluation_m, Motion { arcs })
}

/// Returns a bound on the distance that an error of the time adds to each arc \[m\].
///
/// The firmware subtracts the durations of all pieces before one after the other. Each subtraction rounds the remaining
/// time, which is at most that from the start of the next piece to the end of this one. Near its ends, an arc may be
/// taken for a neighbour.
fn clock_errors_m(arcs: &[Arc]) -> Vec<f64> {
    let speeds_m_s: Vec<_> = arcs.iter().map(Arc::speed_m_s).collect();
    let last = |arc: &Arc| arc.points[arc.points.len() - 1];
    let jumps_m: Vec<_> = arcs.windows(2).map(|pair| (pair[1].points[0] - last(&pair[0])).norm()).collect();
    let (mut errors_m, mut starts_s) = (Vec::with_capacity(arcs.len()), 0.0);
    for (index, arc) in arcs.iter().enumerate() {
        starts_s += arc.from_s;
        let error_s = SUMS * ROUNDING * (index as f64 * arc.to_s - starts_s).max(0.0);
        let first = arcs.partition_point(|other| other.to_s < arc.from_s - error_s);
        let end = arcs.partition_point(|other| other.from_s <= arc.to_s + error_s);
        let speed_m_s = speeds_m_s[first..end].iter().copied().fold(0.0, f64::max);
        let jump_m: f64 = jumps_m[first..end - 1].iter().sum();
        errors_m.push(SUMS * (speed_m_s * error_s + jump_m));
    }
    errors_m
}

/// Returns the CSV with one polynomial in each row. Its decimals have the values of single precision.
fn csv(polynomials: &[Polynomial]) -> String {
    let mut text = "duration".to_owned();
    for axis in ["x", "y", "z", "yaw"] {
        for power in 0..POINTS {
            // Writing to a string cannot fail.
            let _ = write!(text, ",{axis}^{power}");
        }
    }
    for polynomial in polynomials {
        let _ = write!(text, "\n{:?}", f64::from(polynomial.duration_s));
        for axis in 0..3 {
            for power in &polynomial.powers {
                let _ = write!(text, ",{:?}", f64::from(power[axis]));
            }
        }
        text.push_str(&",0.0".repeat(POINTS));
    }
    text + "\n"
}

/// Returns the compressed segments of a vehicle.
pub(super) fn compressed(
    work: &Work<'_>,
    name: &str,
    label: &str,
    motion: &Motion,
) -> Result<(DroneFile, EncodedVehicle), DroneError> {
    let found = work.within(
        name,
        motion,
        rounding_m(UNIT_M),
        |_| true,
        |pieces| {
            let trajectory =
                Trajectory::of_pieces(pieces, UNIT_M, false).map_err(|error| too_far(name, error, UNIT_M))?;
            let curve = trajectory.motion(UNIT_M, Evaluator::Crazyflie);
            Ok(Some((trajectory, curve)))
        },
    )?;
    let mut bytes = Vec::new();
    found.encode(&mut bytes);
    bytes.extend([0; HEAD_BYTES]);
    let (size, pieces) = (bytes.len(), found.segments.len());
    check_size(name, [pieces, size], (MEMORY, MEMORY_BYTES, false))?;
    let file = DroneFile { name: format!("{label}.traj"), bytes };
    let evaluation_m = Evaluator::Crazyflie.errors_m(&found, UNIT_M);
    let (name, label) = (name.to_owned(), label.to_owned());
    Ok((file, EncodedVehicle { name, label, parts: pieces, bytes: size, evaluation_m }))
}

/// Returns the error of a coordinate beyond 16 bits.
pub(super) fn too_far(name: &str, error: OutOfRange, unit_m: f64) -> DroneError {
    DroneError::TooFar {
        vehicle: name.to_owned(),
        time_s: seconds(error.from_ms),
        coordinate_m: error.coordinate_m,
        largest_m: f64::from(LARGEST) * unit_m,
    }
}

impl Trajectory {
    /// Returns the motion of the segments as a program evaluates them, for a unit of length \[m\].
    pub(super) fn motion(&self, unit_m: f64, evaluator: Evaluator) -> Motion {
        let (mut arcs, mut from_ms) = (Vec::with_capacity(self.segments.len()), 0);
        let mut errors_m = evaluator.errors_m(self, unit_m).into_iter();
        for (duration_ms, points) in self.curves(unit_m) {
            let to_ms = from_ms + u64::from(duration_ms);
            if to_ms > from_ms {
                let rounding_m = errors_m.next().unwrap_or(f64::INFINITY);
                arcs.push(Arc { from_s: seconds(from_ms), to_s: seconds(to_ms), points, rounding_m });
            }
            from_ms = to_ms;
        }
        Motion { arcs }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::vector;

    use super::*;
    use crate::export::drones::{Dialect, DroneOptions, deviation_with_rests, encode};

    fn line(duration_s: f64, to: Vector3<f64>) -> Motion {
        Motion { arcs: vec![Arc::straight(0.0, duration_s, Vector3::zeros(), to)] }
    }

    #[test]
    #[expect(clippy::cast_possible_truncation, reason = "the firmware has single precision")]
    fn rows_hold_the_numbers_of_the_firmware() {
        let flight = [("cf1".to_owned(), line(2.5, vector![1.0, 0.1, -2.0]))];
        let encoded = encode(&flight, &DroneOptions::new(Dialect::Crazyflie), &|| false).expect("encoded");
        let text = String::from_utf8(encoded.files[0].bytes.clone()).expect("text");
        let lines: Vec<_> = text.lines().collect();
        assert_eq!((lines.len(), encoded.vehicles[0].parts, encoded.vehicles[0].bytes), (2, 1, 132));
        assert!(lines[0].starts_with("duration,x^0,x^1,") && lines[0].ends_with(",yaw^7"), "{}", lines[0]);
        let numbers: Vec<f64> = lines[1].split(',').map(|cell| cell.parse().expect("a number")).collect();
        assert_eq!((numbers.len(), numbers[0]), (33, 2.5));
        assert!((numbers[2] - 0.4).abs() < 1e-6 && (numbers[10] - 0.04).abs() < 1e-6, "{numbers:?}");
        assert!(numbers.iter().all(|number| f64::from(*number as f32) == *number));
    }

    /// Returns the position at a time since the start \[s\] as the firmware computes it.
    fn flown(polynomials: &[Polynomial], mut time_s: f32) -> Vector3<f64> {
        for polynomial in polynomials {
            if time_s <= polynomial.duration_s {
                let horner = |sum: Vector3<f32>, power: &Vector3<f32>| sum * time_s + power;
                return polynomial.powers.iter().rev().fold(Vector3::zeros(), horner).map(f64::from);
            }
            time_s -= polynomial.duration_s;
        }
        panic!("the flight has ended")
    }

    #[test]
    #[expect(clippy::cast_possible_truncation, reason = "the firmware has single precision")]
    fn the_error_of_subtracted_durations_is_bounded() {
        // Long waits, each followed by a fast way: 10 m in 0.7 s.
        let points = |from: f64, to: f64| {
            std::array::from_fn(|k| vector![from + (to - from) * k as f64 / (POINTS - 1) as f64, 0.0, 1.0])
        };
        let piece = |k: u32| match k % 4 {
            0 => Piece { duration_ms: 31_001, points: points(-5.0, -5.0) },
            1 => Piece { duration_ms: 703, points: points(-5.0, 5.0) },
            2 => Piece { duration_ms: 17_013, points: points(5.0, 5.0) },
            _ => Piece { duration_ms: 703, points: points(5.0, -5.0) },
        };
        let pieces: Vec<_> = (0..30).map(piece).collect();
        let (polynomials, evaluation_m, curve) = rounded(&pieces);
        let (mut worst, mut worst_without_clock) = (0.0_f64, 0.0_f64);
        for (arc, error_m) in curve.arcs.iter().zip(&evaluation_m) {
            for k in 1..1000 {
                let time_s = (arc.from_s + (arc.to_s - arc.from_s) * f64::from(k) / 1000.0) as f32;
                let off_m = (flown(&polynomials, time_s) - curve.position_m(f64::from(time_s))).norm();
                worst = worst.max(off_m / error_m);
                worst_without_clock = worst_without_clock.max(off_m / (EVALUATION * 30.0));
            }
        }
        assert!(worst <= 1.0 && worst > 0.05, "{worst}");
        // Negative twin: Horner's scheme alone does not explain the error; |c_0| + |c_1| T is at most 16 m.
        assert!(worst_without_clock > 2.0, "{worst_without_clock}");
    }

    #[test]
    fn a_wavy_flight_exceeds_the_memory() {
        let place = |k: u32| {
            let t = f64::from(k) / 20.0;
            vector![libm::sin(7.0 * t), libm::cos(5.0 * t), 1.0]
        };
        let arc = |k: u32| Arc::straight(f64::from(k) / 20.0, f64::from(k + 1) / 20.0, place(k), place(k + 1));
        let motion = Motion { arcs: (0..1200).map(arc).collect() };
        let flight = [("cf1".to_owned(), motion)];
        let options = DroneOptions { tolerance_m: 0.03, ..DroneOptions::new(Dialect::Crazyflie) };
        let refused = encode(&flight, &options, &|| false).expect_err("refused");
        assert!(matches!(refused, DroneError::TooLong { pieces: 32.., most: 4096, compresses: true, .. }), "{refused}");
        assert!(refused.help().contains("from_s and until_s, or compressed"));
        let options = DroneOptions { is_compressed: true, ..options };
        let encoded = encode(&flight, &options, &|| false).expect("encoded");
        let bytes = &encoded.files[0].bytes;
        let (trajectory, length) = Trajectory::decode(bytes, true).expect("decoded");
        assert_eq!((length, encoded.vehicles[0].bytes), (bytes.len(), bytes.len()));
        assert!(deviation_with_rests(&flight[0].1, &trajectory.motion(UNIT_M, Evaluator::Crazyflie)).bound_m <= 0.03);
    }

    #[test]
    fn positions_beyond_32_m_need_another_form() {
        let flight = [("cf1".to_owned(), line(20.0, vector![40.0, 0.0, 1.0]))];
        let options = DroneOptions { is_compressed: true, ..DroneOptions::new(Dialect::Crazyflie) };
        let refused = encode(&flight, &options, &|| false).expect_err("refused");
        assert!(matches!(refused, DroneError::TooFar { largest_m: 32.767, .. }), "{refused}");
        assert!(encode(&flight, &DroneOptions::new(Dialect::Crazyflie), &|| false).is_ok());
        let fine = DroneOptions { tolerance_m: 0.001, ..options };
        assert!(matches!(encode(&flight, &fine, &|| false), Err(DroneError::Resolution { .. })));
    }

    #[test]
    fn tolerance_covers_single_precision_of_compressed_segments() {
        // A turn 30 m from the origin, which needs curves.
        let place = |k: u32| {
            let t = f64::from(k) / 20.0;
            vector![31.0 + libm::sin(t), 31.0 + libm::cos(t), 31.0]
        };
        let arc = |k: u32| Arc::straight(f64::from(k) / 20.0, f64::from(k + 1) / 20.0, place(k), place(k + 1));
        let flight = [("cf1".to_owned(), Motion { arcs: (0..100).map(arc).collect() })];
        let options = DroneOptions { is_compressed: true, ..DroneOptions::new(Dialect::Crazyflie) };
        let encoded = encode(&flight, &options, &|| false).expect("encoded");
        let largest_m = encoded.vehicles[0].evaluation_m.iter().copied().fold(0.0, f64::max);
        assert!(largest_m > 1e-4 && largest_m < 0.01, "{largest_m}");
        let (trajectory, _) = Trajectory::decode(&encoded.files[0].bytes, true).expect("decoded");
        let mut exact = trajectory.motion(UNIT_M, Evaluator::Crazyflie);
        exact.arcs.iter_mut().for_each(|arc| arc.rounding_m = 0.0);
        let of_file = deviation_with_rests(&flight[0].1, &exact);
        encoded.vehicles[0].add_evaluation(&mut exact);
        let of_drone = deviation_with_rests(&flight[0].1, &exact);
        // Negative twin: the deviation of the file alone is smaller.
        assert!(of_drone.bound_m <= 0.01 && of_drone.bound_m > of_file.bound_m + 1e-5, "{of_drone:?} {of_file:?}");
    }
}
