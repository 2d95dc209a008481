//! How vehicles stand in space, and where their rotors are.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use tautline_core::record::Sample;
use tautline_sim::scenario::Scenario;

/// A channel of a sample with this name and these columns is one of attitudes: quaternions that turn body into world.
const CHANNEL: &str = "attitude";
const COLUMNS: [&str; 4] = ["qw", "qx", "qy", "qz"];
/// A quaternion that is shorter says nothing.
const LEAST_NORM: f64 = 1e-6;
/// Of a hull of which no more is known: how far out the rotors are, and how large they are.
const ARM: f64 = 0.66;
const ROTOR: f64 = 0.33;

/// Where the rotors of a quadrotor are, and how large.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuadrotorShape {
    /// Their middles from the centre of the body, x ahead and y to the left \[m\].
    pub rotors_m: [Vector3<f64>; 4],
    /// Radius of each \[m\].
    pub rotor_radius_m: f64,
}

impl QuadrotorShape {
    /// That of a scenario's model, where its vehicles are quadrotors.
    pub(crate) fn of(scenario: &Scenario) -> Option<Self> {
        let model = &scenario.airframe.quadrotor()?.model;
        let rotors_m = model.rotor_positions_m.map(|[x, y]| Vector3::new(x, y, 0.0));
        Some(Self { rotors_m, rotor_radius_m: model.rotor_radius_m })
    }

    /// Four rotors within a hull of this radius \[m\].
    #[must_use]
    pub fn within(hull_radius_m: f64) -> Self {
        let out = hull_radius_m * ARM * std::f64::consts::FRAC_1_SQRT_2;
        let rotors_m = [[1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]];
        Self {
            rotors_m: rotors_m.map(|[x, y]| Vector3::new(x * out, y * out, 0.0)),
            rotor_radius_m: hull_radius_m * ROTOR,
        }
    }

    /// How far the outermost rotor is from the centre \[m\].
    #[must_use]
    pub fn arm_m(&self) -> f64 {
        self.rotors_m.iter().map(Vector3::norm).fold(0.0, f64::max)
    }
}

/// Attitudes of the vehicles, of those where it is known; empty where none is.
pub(super) type Attitudes = Vec<Option<UnitQuaternion<f64>>>;

/// Those of a sample.
pub(crate) fn attitudes_of(sample: &Sample<'_>) -> Attitudes {
    let is_it = |columns: &[String]| columns.iter().eq(&COLUMNS);
    let channel = sample.channels.iter().find(|channel| &*channel.name == CHANNEL && is_it(&channel.columns));
    let rows = channel.map_or(&[][..], |channel| &channel.values).chunks_exact(COLUMNS.len());
    let attitude = |row: &[f64]| {
        let turn = Quaternion::new(row[0], row[1], row[2], row[3]);
        UnitQuaternion::try_new(turn, LEAST_NORM).filter(|turn| turn.coords.iter().all(|x| x.is_finite()))
    };
    if rows.len() == sample.swarm.count() { rows.map(attitude).collect() } else { Attitudes::new() }
}

/// Those at this part of the way from one instant to the next, turned the shorter way; a vehicle whose attitude is not
/// known then keeps the one before.
pub(super) fn between(before: &Attitudes, after: &Attitudes, part: f64) -> Attitudes {
    let turned = |(k, from): (usize, &Option<UnitQuaternion<f64>>)| {
        let (from, to) = ((*from)?, after.get(k).copied().flatten());
        // Half a turn has no shorter way.
        to.and_then(|to| from.try_slerp(&to, part, f64::EPSILON)).or(Some(from))
    };
    before.iter().enumerate().map(turned).collect()
}
