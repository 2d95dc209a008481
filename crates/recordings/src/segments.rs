//! Compressed segments: Bezier curves of 16-bit numbers, as Crazyflie and Skybrush drones hold them.
//!
//! ```text
//! start     x y z yaw, each int16
//! segment   kinds, 1 byte: bits 0-1 of x, 2-3 of y, 4-5 of z, 6-7 of yaw
//!           duration, uint16 [ms]
//!           control points of x, then of y, z and yaw, each int16, without the first
//! kind      0 constant, 1 line (1 point), 2 cubic (3 points), 3 degree 7 (7 points)
//! ```
//!
//! Numbers are little endian. A length has a unit of 1 mm times a scale, an angle one of 0.1 degrees. The first control
//! point of a segment is the last one of the segment before.

use nalgebra::Vector3;

use crate::export::drones::fit::{DEGREE, POINTS, Piece};
use crate::export::drones::motion::raise;

/// Largest number of a control point. The smallest is its negative.
pub(crate) const LARGEST: i16 = i16::MAX;
/// Number of axes: x, y, z and yaw.
const AXES: usize = 4;
/// Length of the start \[bytes\].
pub(crate) const START_BYTES: usize = 2 * AXES;
/// Length of the kinds and the duration of a segment \[bytes\].
pub(crate) const HEAD_BYTES: usize = 3;
/// Number of control points without the first, by kind.
const POINTS_OF_KIND: [usize; 4] = [0, 1, 3, 7];
/// Largest distance of a curve of lower degree from one of degree 7 that it replaces \[units\].
const REPLACED_WITHIN: f64 = 1.0;

/// Returns a bound on the distance that rounding adds to a curve, for a unit of length \[m\].
pub(crate) fn rounding_m(unit_m: f64) -> f64 {
    // Each axis of a control point moves by at most this many units.
    3.0_f64.sqrt() * REPLACED_WITHIN * unit_m
}

/// Trajectory of compressed segments.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Trajectory {
    /// Start: x, y, z and yaw.
    pub(crate) start: [i16; AXES],
    /// Segments in order of time.
    pub(crate) segments: Vec<Segment>,
}

/// Segment of a trajectory.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Segment {
    /// Duration \[ms\].
    pub(crate) duration_ms: u16,
    /// Control points of each axis without the first: 0, 1, 3 or 7.
    pub(crate) points: [Vec<i16>; AXES],
}

/// A coordinate that 16 bits cannot hold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct OutOfRange {
    /// Start of the segment \[ms\].
    pub(crate) from_ms: u64,
    /// Coordinate \[m\].
    pub(crate) coordinate_m: f64,
}

/// Fault of encoded segments: byte and reason.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Truncated {
    /// Offset of the incomplete segment \[bytes\].
    pub(crate) byte: usize,
}

impl Trajectory {
    /// Rounds fitted pieces to a unit of length \[m\]. With `is_uniform`, the axes of a segment have one kind.
    ///
    /// # Errors
    /// [`OutOfRange`] if a control point exceeds 16 bits.
    #[expect(clippy::cast_possible_truncation, reason = "compared with the range before")]
    pub(crate) fn of_pieces(pieces: &[Piece], unit_m: f64, is_uniform: bool) -> Result<Self, OutOfRange> {
        let mut from_ms = 0;
        let whole = |coordinate_m: f64, from_ms: u64| {
            let rounded = (coordinate_m / unit_m).round();
            // Coordinates that are not finite fail the comparison, too.
            if rounded.abs() <= f64::from(LARGEST) {
                Ok(rounded as i16)
            } else {
                Err(OutOfRange { from_ms, coordinate_m })
            }
        };
        let Some(first) = pieces.first() else { return Ok(Self::default()) };
        let mut position = [0; AXES];
        for (coordinate, coordinate_m) in position.iter_mut().zip(&first.points[0]) {
            *coordinate = whole(*coordinate_m, 0)?;
        }
        let mut trajectory = Self { start: position, segments: Vec::with_capacity(pieces.len()) };
        for piece in pieces {
            let mut units = [[0.0; POINTS]; 3];
            for (axis, units) in units.iter_mut().enumerate() {
                for (unit, point) in units.iter_mut().zip(&piece.points) {
                    whole(point[axis], from_ms)?;
                    *unit = point[axis] / unit_m;
                }
            }
            let kinds: Vec<_> = (0..3).map(|axis| lowest_kind(&units[axis], position[axis])).collect();
            let common = kinds.iter().copied().max().unwrap_or(0);
            let mut segment = Segment { duration_ms: piece.duration_ms, ..Segment::default() };
            for axis in 0..3 {
                let kind = if is_uniform { common } else { kinds[axis] };
                segment.points[axis] = of_kind(&units[axis], position[axis], kind);
                position[axis] = segment.points[axis].last().copied().unwrap_or(position[axis]);
            }
            from_ms += u64::from(piece.duration_ms);
            trajectory.segments.push(segment);
        }
        Ok(trajectory)
    }

    /// Appends the bytes of the start and of all segments.
    pub(crate) fn encode(&self, bytes: &mut Vec<u8>) {
        bytes.extend(self.start.iter().flat_map(|number| number.to_le_bytes()));
        for segment in &self.segments {
            let kind = |axis: usize| {
                let count = segment.points[axis].len();
                let mut kinds = (0_u8..).zip(POINTS_OF_KIND);
                kinds.find(|(_, length)| *length == count).map_or(0, |(kind, _)| kind)
            };
            bytes.push((0..AXES).map(|axis| kind(axis) << (2 * axis)).sum());
            bytes.extend(segment.duration_ms.to_le_bytes());
            bytes.extend(segment.points.iter().flatten().flat_map(|number| number.to_le_bytes()));
        }
    }

    /// Decodes a start and segments up to the end of the bytes, or with `is_terminated` up to and including the first
    /// segment without a duration, which ends the trajectory. Returns the number of bytes, too.
    ///
    /// # Errors
    /// [`Truncated`] if a segment is incomplete, or the segment at the end is missing.
    pub(crate) fn decode(bytes: &[u8], is_terminated: bool) -> Result<(Self, usize), Truncated> {
        let number = |offset: usize| Some(i16::from_le_bytes(bytes.get(offset..offset + 2)?.try_into().ok()?));
        let mut trajectory = Self::default();
        for (axis, start) in trajectory.start.iter_mut().enumerate() {
            *start = number(2 * axis).ok_or(Truncated { byte: 0 })?;
        }
        let mut offset = START_BYTES;
        while is_terminated || offset < bytes.len() {
            let byte = offset;
            let read = || {
                let &[kinds, low, high] = bytes.get(offset..offset + HEAD_BYTES)? else { return None };
                let mut segment = Segment { duration_ms: u16::from_le_bytes([low, high]), ..Segment::default() };
                let mut next = offset + HEAD_BYTES;
                if is_terminated && segment.duration_ms == 0 {
                    return Some((segment, next));
                }
                for (axis, points) in segment.points.iter_mut().enumerate() {
                    let count = POINTS_OF_KIND[usize::from((kinds >> (2 * axis)) & 3)];
                    *points = (0..count).map(|k| number(next + 2 * k)).collect::<Option<_>>()?;
                    next += 2 * count;
                }
                Some((segment, next))
            };
            let (segment, next) = read().ok_or(Truncated { byte })?;
            offset = next;
            if is_terminated && segment.duration_ms == 0 {
                break;
            }
            trajectory.segments.push(segment);
        }
        Ok((trajectory, offset))
    }

    /// Returns the duration \[ms\] and the Bernstein coefficients of each segment \[m\], for a unit of length \[m\].
    pub(crate) fn curves(&self, unit_m: f64) -> impl Iterator<Item = (u16, Vec<Vector3<f64>>)> + '_ {
        let mut position = self.start;
        self.segments.iter().map(move |segment| {
            let degree = segment.points[..3].iter().map(Vec::len).max().unwrap_or(0);
            let axes: Vec<Vec<f64>> = (0..3)
                .map(|axis| {
                    let points = std::iter::once(&position[axis]).chain(&segment.points[axis]);
                    raised(points.map(|number| f64::from(*number)).collect(), degree)
                })
                .collect();
            for (coordinate, points) in position.iter_mut().zip(&segment.points) {
                *coordinate = points.last().copied().unwrap_or(*coordinate);
            }
            let point = |k: usize| Vector3::from_fn(|axis, _| axes[axis][k]) * unit_m;
            (segment.duration_ms, (0..=degree).map(point).collect())
        })
    }
}

/// Raises the degree of Bernstein coefficients.
fn raised(mut points: Vec<f64>, degree: usize) -> Vec<f64> {
    raise(&mut points, degree + 1);
    points
}

/// Returns the lowest kind that keeps an axis within [`REPLACED_WITHIN`] of its control points \[units\].
fn lowest_kind(units: &[f64; POINTS], start: i16) -> usize {
    let is_near = |kind: usize| {
        let points = std::iter::once(start).chain(of_kind(units, start, kind));
        let curve = raised(points.map(f64::from).collect(), DEGREE);
        // The first control point is given.
        let within = if kind == 0 { 0.5 } else { REPLACED_WITHIN };
        curve.iter().zip(units).skip(1).all(|(replaced, unit)| (replaced - unit).abs() <= within)
    };
    (0..3).find(|kind| is_near(*kind)).unwrap_or(3)
}

/// Returns the control points of an axis without the first, for a kind.
#[expect(clippy::cast_possible_truncation, reason = "clamped to the range")]
fn of_kind(units: &[f64; POINTS], start: i16, kind: usize) -> Vec<i16> {
    let whole = |unit: f64| unit.round().clamp(-f64::from(LARGEST), f64::from(LARGEST)) as i16;
    let end = whole(units[DEGREE]);
    match kind {
        0 => Vec::new(),
        1 => vec![end],
        2 => {
            // A cubic raised to degree 7 has the control points b0, b0 + 7/3 (b1 - b0), b7 + 7/3 (b6 - b7), b7.
            let inner = |outer: f64, next: f64| outer + (next - outer) * DEGREE as f64 / 3.0;
            let first = whole(inner(f64::from(start), units[1]));
            vec![first, whole(inner(f64::from(end), units[DEGREE - 1])), end]
        }
        _ => units[1..].iter().map(|unit| whole(*unit)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::vector;

    use super::*;

    /// Start at (1, -2, 0) m. A line of x in 1.5 s, then a cubic of y and a curve of degree 7 of z in 65.535 s.
    fn trajectory() -> (Trajectory, Vec<u8>) {
        let none = Vec::new;
        let segments = vec![
            Segment { duration_ms: 1500, points: [vec![2000], none(), none(), none()] },
            Segment {
                duration_ms: u16::MAX,
                points: [none(), vec![-1, 256, 3], vec![1, 2, 3, 4, 5, 6, -32767], vec![900]],
            },
        ];
        let mut bytes = vec![0xe8, 0x03, 0x30, 0xf8, 0, 0, 0, 0];
        bytes.extend([0b01, 0xdc, 0x05, 0xd0, 0x07]);
        bytes.extend([0b0111_1000, 0xff, 0xff, 0xff, 0xff, 0x00, 0x01, 0x03, 0x00]);
        bytes.extend([1, 0, 2, 0, 3, 0, 4, 0, 5, 0, 6, 0, 0x01, 0x80, 0x84, 0x03]);
        (Trajectory { start: [1000, -2000, 0, 0], segments }, bytes)
    }

    #[test]
    fn bytes_are_those_of_the_specification() {
        let (trajectory, bytes) = trajectory();
        let mut encoded = Vec::new();
        trajectory.encode(&mut encoded);
        assert_eq!(encoded, bytes);
        assert_eq!(Trajectory::decode(&bytes, false), Ok((trajectory.clone(), bytes.len())));
        let terminated = [&bytes[..], &[0, 0, 0, 77]].concat();
        assert_eq!(Trajectory::decode(&terminated, true), Ok((trajectory, bytes.len() + 3)));
    }

    #[test]
    fn every_cut_is_noticed() {
        let (_, bytes) = trajectory();
        for length in 0..bytes.len() {
            let is_whole = [START_BYTES, START_BYTES + 5].contains(&length);
            assert_eq!(Trajectory::decode(&bytes[..length], false).is_ok(), is_whole, "{length}");
            assert!(Trajectory::decode(&bytes[..length], true).is_err(), "{length}");
        }
    }

    #[test]
    fn curves_begin_where_the_one_before_ends() {
        let (trajectory, _) = trajectory();
        let curves: Vec<_> = trajectory.curves(0.002).collect();
        assert_eq!(curves[0], (1500, vec![vector![2.0, -4.0, 0.0], vector![4.0, -4.0, 0.0]]));
        let (first, last) = (curves[1].1[0], curves[1].1[7]);
        assert_eq!((curves[1].1.len(), first), (8, vector![4.0, -4.0, 0.0]));
        assert!((last - vector![4.0, 0.006, -65.534]).norm() < 1e-12, "{last}");
    }

    fn piece(place: impl Fn(f64) -> Vector3<f64>) -> Piece {
        Piece { duration_ms: 1000, points: std::array::from_fn(|i| place(i as f64 / 7.0)) }
    }

    #[test]
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index up to 7")]
    fn each_axis_has_the_lowest_kind_that_holds_it() {
        let wavy = |u: f64| if (0.4..0.5).contains(&u) { 1.0 } else { u };
        // The control points of a cubic 0, 1, 1, 0 whose degree is raised.
        let cubic = raised(vec![0.0, 1.0, 1.0, 0.0], DEGREE);
        let pieces = [piece(|u| vector![u, cubic[(u * 7.0).round() as usize], wavy(u)])];
        let counts = |is_uniform| {
            let found = Trajectory::of_pieces(&pieces, 0.001, is_uniform).expect("in range");
            found.segments[0].points.each_ref().map(Vec::len)
        };
        assert_eq!(counts(false), [1, 3, 7, 0]);
        assert_eq!(counts(true), [7, 7, 7, 0]);
        let still = [piece(|_| vector![1.0004, 0.0, 0.0])];
        let found = Trajectory::of_pieces(&still, 0.001, false).expect("in range");
        assert!(found.segments[0].points.iter().all(Vec::is_empty) && found.start[0] == 1000);
    }

    #[test]
    fn rounded_curves_stay_within_the_bound() {
        let pieces = [piece(|u| vector![3.0 * u, (9.0 * u).sin(), 1.0 + u * u])];
        let found = Trajectory::of_pieces(&pieces, 0.001, false).expect("in range");
        for (_, points) in found.curves(0.001) {
            for (point, fitted) in points.iter().zip(&pieces[0].points) {
                assert!((point - fitted).norm() <= rounding_m(0.001));
            }
        }
    }

    #[test]
    fn coordinates_beyond_16_bits_are_refused() {
        let far = |x: f64| [piece(|_| vector![0.0, x, 0.0])];
        assert!(Trajectory::of_pieces(&far(32.767), 0.001, false).is_ok());
        for x in [32.768, -32.768, f64::NAN, f64::INFINITY] {
            let refused = Trajectory::of_pieces(&far(x), 0.001, false).expect_err("refused");
            assert!(refused.from_ms == 0 && (refused.coordinate_m == x || x.is_nan()));
        }
        assert!(Trajectory::of_pieces(&far(32.768), 0.002, false).is_ok());
    }
}
