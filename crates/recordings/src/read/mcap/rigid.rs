//! Rigid transforms, and what lies between two samples of one.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};

use super::super::error::{Fault, UNSEEN};

/// Samples of a moving transform further apart than this say nothing of what is between them \[ns\].
const LONGEST_BRACKET_NS: i64 = 1_000_000_000;

/// How far the norm of a quaternion may be from 1, as tf2 has it.
const NORM: f64 = 0.01;

/// Above this cosine of half the angle the chord is the arc to 1e-9 of it.
const NEARLY_SAME: f64 = 1.0 - 1e-9;

/// Where a frame lies in its parent, as it is written: position and the quaternion x, y, z, w.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placed {
    pub(super) position: Vector3<f64>,
    pub(super) turn: [f64; 4],
}

impl Placed {
    /// What turns places in the frame into places in its parent.
    pub(super) fn rigid(&self) -> Result<Isometry3<f64>, Fault> {
        if let Some(odd) = self.position.iter().chain(&self.turn).find(|x| !x.is_finite()) {
            return Err(Fault::not_finite("transform", &odd.to_string(), UNSEEN));
        }
        let [x, y, z, w] = self.turn;
        let quaternion = Quaternion::new(w, x, y, z);
        if (quaternion.norm() - 1.0).abs() > NORM {
            let problem = format!("the quaternion {x}, {y}, {z}, {w} is no rotation: its length is not 1");
            return Err(Fault::coded("recording/transforms", problem, "record again, or leave --frame away"));
        }
        Ok(Isometry3::from_parts(Translation3::from(self.position), UnitQuaternion::new_normalize(quaternion)))
    }
}

/// A transform at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Known {
    pub(super) transform: Isometry3<f64>,
    /// Whether it is a guess between two samples.
    pub(super) guessed: bool,
}

/// A moving transform at a time, out of samples in order of time; none where no two of them are around it, or where these
/// are too far apart.
pub(super) fn at(samples: &[(i64, Isometry3<f64>)], time_ns: i64) -> Option<Known> {
    let after = samples.partition_point(|(stamp, _)| *stamp < time_ns);
    let (to_ns, to) = samples.get(after)?;
    if *to_ns == time_ns {
        return Some(Known { transform: *to, guessed: false });
    }
    let (from_ns, from) = samples.get(after.checked_sub(1)?)?;
    let span_ns = to_ns.checked_sub(*from_ns).filter(|span| *span <= LONGEST_BRACKET_NS)?;
    let part = (time_ns - from_ns) as f64 / span_ns as f64;
    let shift = from.translation.vector.lerp(&to.translation.vector, part);
    let turn = between(from.rotation, to.rotation, part);
    Some(Known { transform: Isometry3::from_parts(shift.into(), turn), guessed: true })
}

/// The rotation at a part of the shortest way between two, at a steady rate.
fn between(from: UnitQuaternion<f64>, to: UnitQuaternion<f64>, part: f64) -> UnitQuaternion<f64> {
    let cosine = from.coords.dot(&to.coords);
    let (cosine, to) = if cosine < 0.0 { (-cosine, -to.coords) } else { (cosine, to.coords) };
    let (a, b) = if cosine > NEARLY_SAME {
        (1.0 - part, part)
    } else {
        let angle = libm::acos(cosine);
        (libm::sin((1.0 - part) * angle), libm::sin(part * angle))
    };
    UnitQuaternion::new_normalize(Quaternion::from(from.coords * a + to * b))
}

#[cfg(test)]
mod tests {
    use nalgebra::vector;

    use super::*;

    fn turned(angle: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle)
    }

    fn sample(time_ns: i64, x: f64, angle: f64) -> (i64, Isometry3<f64>) {
        (time_ns, Isometry3::from_parts(vector![x, 0.0, 0.0].into(), turned(angle)))
    }

    #[test]
    fn a_transform_is_known_at_samples_guessed_between_and_unknown_outside() {
        let samples = [sample(0, 0.0, 0.0), sample(100, 1.0, 1.0), sample(1_000_000_101, 2.0, 0.0)];
        assert_eq!(at(&samples, 100), Some(Known { transform: samples[1].1, guessed: false }));
        let found = at(&samples, 25).expect("between");
        assert!(found.guessed && found.transform.translation.x == 0.25);
        assert!(found.transform.rotation.angle_to(&turned(0.25)) < 1e-12);
        for outside in [-1, 101, 1_000_000_102, i64::MIN, i64::MAX] {
            assert_eq!(at(&samples, outside), None, "{outside}");
        }
    }

    #[test]
    fn rotations_take_the_shortest_way() {
        let far = UnitQuaternion::new_unchecked(-turned(1.0).into_inner());
        assert!(between(turned(0.0), far, 0.5).angle_to(&turned(0.5)) < 1e-12);
        assert!(between(turned(0.0), turned(1e-7), 0.5).angle_to(&turned(5e-8)) < 1e-15);
    }

    #[test]
    fn what_is_no_rotation_is_refused() {
        let placed = |turn| Placed { position: Vector3::zeros(), turn }.rigid();
        assert!(placed([0.0, 0.0, 0.0, 0.0]).is_err() && placed([0.0, 0.0, f64::NAN, 1.0]).is_err());
        assert!(placed([0.0, 0.0, 0.0, 1.005]).is_ok());
    }
}
