//! Directions of the axes of a recording, and recordings turned to x east, y north and z up.

use std::str::FromStr;

use nalgebra::Vector3;

use super::error::{Fault, ReadError, quoted, refuse};
use super::options::ReadOptions;
use super::order::Recording;
use tautline_core::track::{Clock, EarthOrigin, Item, Tracks};

/// Which axis of a recording becomes x, y and z, and by what it is multiplied.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    from: [usize; 3],
    factors: [f64; 3],
}

impl Default for Axes {
    /// Axes as they are.
    fn default() -> Self {
        Self { from: [0, 1, 2], factors: [1.0; 3] }
    }
}

impl FromStr for Axes {
    type Err = String;

    /// As [`Self::from_name`].
    fn from_str(name: &str) -> Result<Self, String> {
        let help = "three directions such as enu, ned or nwu, or what becomes x, y and z, such as y,x,-z";
        Self::from_name(name).ok_or_else(|| format!("`{name}` is not {help}"))
    }
}

impl Axes {
    /// Reads the directions of the axes of a recording, such as `enu`, `ned` or `nwu`, or what becomes x, y and z, such as
    /// `y,x,-z`; none where it is neither.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        let mut found: [Option<(usize, f64)>; 3] = [None; 3];
        if name.contains(',') {
            let mut parts = name.split(',');
            for slot in &mut found {
                let part = parts.next()?.trim().to_lowercase();
                let (sign, axis) = match part.strip_prefix('-') {
                    Some(axis) => (-1.0, axis),
                    None => (1.0, part.strip_prefix('+').unwrap_or(&part)),
                };
                *slot = Some((["x", "y", "z"].iter().position(|known| *known == axis)?, sign));
            }
            if parts.next().is_some() {
                return None;
            }
        } else {
            for (axis, letter) in name.to_lowercase().chars().enumerate() {
                let (to, sign) = match letter {
                    'e' => (0, 1.0),
                    'w' => (0, -1.0),
                    'n' => (1, 1.0),
                    's' => (1, -1.0),
                    'u' => (2, 1.0),
                    'd' => (2, -1.0),
                    _ => return None,
                };
                let is_first = axis < 3 && found[to].replace((axis, sign)).is_none();
                if !is_first {
                    return None;
                }
            }
        }
        let [x, y, z] = found;
        let [x, y, z] = [x?, y?, z?];
        let is_permutation = (0..3).all(|axis| [x.0, y.0, z.0].contains(&axis));
        is_permutation.then_some(Self { from: [x.0, y.0, z.0], factors: [x.1, y.1, z.1] })
    }

    /// The same, with the axes of the recording multiplied by these numbers first.
    #[must_use]
    pub fn scaled(self, by: [f64; 3]) -> Self {
        let factors = [0, 1, 2].map(|axis| self.factors[axis] * by[self.from[axis]]);
        Self { factors, ..self }
    }

    /// Where an axis of the recording goes, and by what it is multiplied.
    pub(super) fn of(&self, axis: usize) -> (usize, f64) {
        let to = self.from.iter().position(|from| *from == axis).unwrap_or(axis);
        (to, self.factors[to])
    }

    /// Whether axes stay as they are.
    pub(super) fn is_identity(&self) -> bool {
        *self == Self::default()
    }

    /// Whether z stays the third axis: its sign may change, and its length.
    pub(super) fn keeps_plane(&self) -> bool {
        self.from[2] == 2
    }

    /// Whether what is up stays up.
    pub(super) fn keeps_up(&self) -> bool {
        self.keeps_plane() && self.factors[2] > 0.0
    }

    /// Whether lengths stay as they are.
    pub(super) fn keeps_lengths(&self) -> bool {
        self.factors.iter().all(|factor| factor.abs() == 1.0)
    }

    /// Whether all factors can be multiplied by.
    pub(super) fn are_finite(&self) -> bool {
        self.factors.iter().all(|factor| factor.is_finite() && *factor != 0.0)
    }

    pub(super) fn turn(&self, vector: Vector3<f64>) -> Vector3<f64> {
        // Adding 0 makes a zero positive.
        Vector3::from_fn(|axis, _| self.factors[axis] * vector[self.from[axis]] + 0.0)
    }

    /// What a person should know.
    pub(super) fn note(&self) -> String {
        let named = |axis: usize| match self.factors[axis] {
            1.0 => ["x", "y", "z"][self.from[axis]].to_owned(),
            -1.0 => format!("-{}", ["x", "y", "z"][self.from[axis]]),
            factor => format!("{factor:?} {}", ["x", "y", "z"][self.from[axis]]),
        };
        format!("axes are turned: x, y, z are {}, {}, {} of the recording", named(0), named(1), named(2))
    }
}

/// A recording whose axes are turned as the user says.
pub(super) fn turned(recording: Recording, options: &ReadOptions) -> Result<Recording, ReadError> {
    if options.turn().is_identity() {
        return Ok(recording);
    }
    if recording.is_planar() && !options.turn().keeps_plane() {
        let problem = "its third axis would become x or y, and it has none";
        let remedy = "name the column of the third axis with --column z=NAME, or give --axes that leave z in its place";
        return refuse("recording/contradicts-option", problem, remedy);
    }
    let notes = [recording.notes(), &[options.turn().note()]].concat();
    Ok(Box::new(Turned { recording, axes: options.turn(), notes }))
}

/// Refuses to turn axes whose directions are known, in what is called so.
pub(super) fn refuse_known(options: &ReadOptions, what: &str) -> Result<(), Fault> {
    if options.turn().is_identity() {
        return Ok(());
    }
    refuse(
        "recording/contradicts-option",
        format!("{what} gives the directions of its axes"),
        "leave --axes and signs of --scale away",
    )
}

/// Refuses to turn a height over that is up by the name of its column.
pub(super) fn refuse_turned_height(options: &ReadOptions, column: &str) -> Result<(), Fault> {
    if options.turn().keeps_up() {
        return Ok(());
    }
    let problem =
        format!("column {} says by its name which way is up, and --axes or --scale another way", quoted(column));
    let remedy = format!("leave z as it is there, or have the numbers taken as they are with --column z={column}");
    refuse("recording/contradicts-option", problem, remedy)
}

struct Turned {
    recording: Recording,
    axes: Axes,
    notes: Vec<String>,
}

impl Tracks for Turned {
    type Error = ReadError;

    fn vehicles(&self) -> &[String] {
        self.recording.vehicles()
    }

    fn read(&mut self, items: &mut Vec<Item>) -> Result<bool, ReadError> {
        let before = items.len();
        let more = self.recording.read(items)?;
        for item in &mut items[before..] {
            match item {
                Item::Sample(sample) => {
                    if sample.radius_m.is_some() && !self.axes.keeps_lengths() {
                        let problem = "its axes are scaled by different numbers, and vehicles have a radius";
                        return refuse(
                            "recording/contradicts-option",
                            problem,
                            "give one number of metres with --scale",
                        );
                    }
                    sample.position_m = self.axes.turn(sample.position_m);
                    sample.velocity_m_s = sample.velocity_m_s.map(|velocity| self.axes.turn(velocity));
                }
                Item::Piece(piece) => {
                    piece.coefficients.iter_mut().for_each(|coefficient| *coefficient = self.axes.turn(*coefficient));
                }
            }
        }
        if !more {
            let turned = self.axes.note();
            self.notes = [self.recording.notes(), &[turned]].concat();
        }
        Ok(more)
    }

    fn clock(&self) -> &Clock {
        self.recording.clock()
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn assumed(&self) -> Option<&str> {
        self.recording.assumed()
    }

    fn is_planar(&self) -> bool {
        self.recording.is_planar()
    }

    fn earth_origin(&self) -> Option<&EarthOrigin> {
        self.recording.earth_origin()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::vector;

    use super::*;

    #[test]
    fn axes_are_read_by_direction_and_by_place() {
        let file = vector![1.0, 2.0, 3.0];
        for (name, expected) in [
            ("enu", [1.0, 2.0, 3.0]),
            ("x,y,z", [1.0, 2.0, 3.0]),
            ("NED", [2.0, 1.0, -3.0]),
            ("y,x,-z", [2.0, 1.0, -3.0]),
            ("nwu", [-2.0, 1.0, 3.0]),
            ("eus", [1.0, -3.0, 2.0]),
            ("+x, -z, +y", [1.0, -3.0, 2.0]),
        ] {
            let axes = Axes::from_name(name).unwrap_or_else(|| panic!("{name}"));
            assert_eq!(axes.turn(file).as_slice(), expected, "{name}");
        }
        for name in ["", "en", "enn", "enud", "exu", "x,y", "x,x,z", "x,y,w", "x,y,z,z", "x,y,--z", "ens"] {
            assert_eq!(Axes::from_name(name), None, "{name}");
        }
    }

    #[test]
    fn a_scale_is_of_the_axes_of_the_recording() {
        let ned = Axes::from_name("ned").expect("axes");
        assert_eq!(ned.scaled([2.0, 1.0, -1.0]).turn(vector![1.0, 2.0, 3.0]).as_slice(), [2.0, 2.0, 3.0]);
        assert!(
            Axes::default().scaled([1.0, -1.0, 1.0]).keeps_lengths() && !ned.scaled([1.0, 2.0, 1.0]).keeps_lengths()
        );
        assert!(ned.turn(Vector3::zeros()).iter().all(|x| x.is_sign_positive()));
    }
}
