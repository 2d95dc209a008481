//! Mapping of the axes of a recording.

use std::str::FromStr;

use nalgebra::Vector3;

/// Returns the axis of a direction by its first letter, 0 for east, 1 for north and 2 for up, and its sign.
pub(super) fn direction(letter: char) -> Option<(usize, f64)> {
    match letter {
        'e' => Some((0, 1.0)),
        'w' => Some((0, -1.0)),
        'n' => Some((1, 1.0)),
        's' => Some((1, -1.0)),
        'u' => Some((2, 1.0)),
        'd' => Some((2, -1.0)),
        _ => None,
    }
}

/// Mapping of the axes of a recording to x, y and z: a permutation with factors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    from: [usize; 3],
    factors: [f64; 3],
}

impl Default for Axes {
    /// Returns the identity.
    fn default() -> Self {
        Self { from: [0, 1, 2], factors: [1.0; 3] }
    }
}

impl FromStr for Axes {
    type Err = String;

    /// Parses as [`Self::from_name`] does.
    fn from_str(name: &str) -> Result<Self, String> {
        let help = "three directions such as enu, ned and nwu; or the source of x, y and z such as y,x,-z";
        Self::from_name(name).ok_or_else(|| format!("`{name}` is not {help}"))
    }
}

impl Axes {
    /// Parses the directions of the recorded axes, such as `enu`, `ned` or `nwu`, or the sources of x, y and z, such as
    /// `y,x,-z`.
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
                let (to, sign) = direction(letter)?;
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

    /// Returns this mapping, applied after multiplying the recorded axes by these factors.
    #[must_use]
    pub fn scaled(self, by: [f64; 3]) -> Self {
        let factors = [0, 1, 2].map(|axis| self.factors[axis] * by[self.from[axis]]);
        Self { factors, ..self }
    }

    /// Returns the target axis of a recorded axis, and its factor.
    pub(super) fn of(&self, axis: usize) -> (usize, f64) {
        let to = self.from.iter().position(|from| *from == axis).unwrap_or(axis);
        (to, self.factors[to])
    }

    /// Returns whether the mapping is the identity.
    pub(super) fn is_identity(&self) -> bool {
        *self == Self::default()
    }

    /// Returns whether z remains the third axis; its sign and scale may change.
    pub(super) fn keeps_plane(&self) -> bool {
        self.from[2] == 2
    }

    /// Returns whether z remains up.
    pub(super) fn keeps_up(&self) -> bool {
        self.keeps_plane() && self.factors[2] > 0.0
    }

    /// Returns whether lengths are preserved.
    pub(super) fn keeps_lengths(&self) -> bool {
        self.factors.iter().all(|factor| factor.abs() == 1.0)
    }

    /// Returns whether all factors are finite and not 0.
    pub(super) fn are_finite(&self) -> bool {
        self.factors.iter().all(|factor| factor.is_finite() && *factor != 0.0)
    }

    pub(super) fn turn(&self, vector: Vector3<f64>) -> Vector3<f64> {
        // Adding 0 converts -0 to +0.
        Vector3::from_fn(|axis, _| self.factors[axis] * vector[self.from[axis]] + 0.0)
    }

    /// Returns the note for the user.
    pub(super) fn note(&self) -> String {
        let named = |axis: usize| match self.factors[axis] {
            1.0 => ["x", "y", "z"][self.from[axis]].to_owned(),
            -1.0 => format!("-{}", ["x", "y", "z"][self.from[axis]]),
            factor => format!("{factor:?} {}", ["x", "y", "z"][self.from[axis]]),
        };
        format!("axes are mapped: x, y, z are {}, {}, {} of the recording", named(0), named(1), named(2))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::vector;

    use super::*;

    #[test]
    fn axes_are_parsed_by_direction_and_by_position() {
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
    fn scale_applies_to_the_axes_of_the_recording() {
        let ned = Axes::from_name("ned").expect("axes");
        assert_eq!(ned.scaled([2.0, 1.0, -1.0]).turn(vector![1.0, 2.0, 3.0]).as_slice(), [2.0, 2.0, 3.0]);
        assert!(
            Axes::default().scaled([1.0, -1.0, 1.0]).keeps_lengths() && !ned.scaled([1.0, 2.0, 1.0]).keeps_lengths()
        );
        assert!(ned.turn(Vector3::zeros()).iter().all(|x| x.is_sign_positive()));
    }
}
