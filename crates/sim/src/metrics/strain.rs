//! How far bodies that turn tilt, and how hard their rotors push.

use tautline_core::record::Sample;

/// What the channels of quadrotors showed, over the samples that have them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strain {
    /// Largest angle between a vehicle's thrust and the vertical \[rad\].
    pub max_tilt_rad: f64,
    /// Largest thrust of a rotor \[N\].
    pub max_thrust_n: f64,
}

impl Strain {
    /// Takes one sample; what has no channel `attitude` changes nothing.
    pub(super) fn observe(strain: &mut Option<Self>, sample: &Sample<'_>) {
        let channel = |name: &str| sample.channels.iter().find(|channel| &*channel.name == name);
        let (Some(attitude), Some(rotors)) = (channel("attitude"), channel("rotors")) else { return };
        let Self { max_tilt_rad, max_thrust_n } = strain.get_or_insert(Self { max_tilt_rad: 0.0, max_thrust_n: 0.0 });
        for q in attitude.values.chunks_exact(4) {
            // The half angle from the vertical: its sine is that of the quaternion's part about x and y.
            *max_tilt_rad = max_tilt_rad.max(2.0 * libm::asin((q[1] * q[1] + q[2] * q[2]).sqrt().min(1.0)));
        }
        *max_thrust_n = rotors.values.iter().copied().fold(*max_thrust_n, f64::max);
    }
}
