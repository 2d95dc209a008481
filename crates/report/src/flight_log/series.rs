//! Channels of samples that figures show, as a number of each vehicle.

use tautline_core::record::{Channel, Sample};

/// A channel as a figure shows it.
pub(crate) struct Series {
    /// Name and title of the figure.
    pub(crate) name: &'static str,
    pub(crate) title: &'static str,
    /// Name of the quantity, and its unit.
    pub(crate) what: &'static str,
    pub(crate) unit: &'static str,
    /// Name and columns of the channel.
    channel: &'static str,
    columns: &'static [&'static str],
    /// Computes the number from a row of the channel. Merged instants keep the largest number.
    number: fn(&[f64]) -> f64,
}

/// Number of series.
pub(crate) const COUNT: usize = 4;

/// All series, in the order of the figures.
pub(crate) const SERIES: [Series; COUNT] = [
    Series {
        name: "attitude",
        title: "Tilt",
        what: "tilt from upright",
        unit: "°",
        channel: "attitude",
        columns: &["qw", "qx", "qy", "qz"],
        number: tilt_deg,
    },
    Series {
        name: ROTORS,
        title: "Rotor thrust",
        what: "largest thrust of a rotor",
        unit: "N",
        channel: "rotors",
        columns: &["thrust_1_n", "thrust_2_n", "thrust_3_n", "thrust_4_n"],
        number: largest,
    },
    Series {
        name: "wind",
        title: "Wind",
        what: "wind speed",
        unit: "m/s",
        channel: "wind",
        columns: &["wind_x_m_s", "wind_y_m_s", "wind_z_m_s"],
        number: length,
    },
    Series {
        name: "message-age",
        title: "Age of received states",
        what: "age of the oldest message",
        unit: "s",
        channel: "message_age",
        columns: &["oldest_s", "mean_s"],
        number: first,
    },
];

/// Name of the figure of rotors.
pub(crate) const ROTORS: &str = "rotors";

/// Returns the numbers of every series at an instant, one for each vehicle; empty for a channel that the sample lacks.
pub(crate) fn numbers_of(sample: &Sample<'_>) -> [Vec<f64>; COUNT] {
    let vehicles = sample.swarm.count();
    SERIES.map(|series| {
        let is_it = |channel: &&Channel| {
            let width = series.columns.len();
            let fits = channel.values.len() == width * vehicles && channel.columns.iter().eq(series.columns);
            &*channel.name == series.channel && fits
        };
        let rows = sample.channels.iter().find(is_it).map(|channel| channel.values.chunks_exact(series.columns.len()));
        rows.map_or_else(Vec::new, |rows| rows.map(series.number).collect())
    })
}

/// Returns the angle between the axis of thrust and the vertical \[degrees\] of a quaternion (w, x, y, z) that turns
/// body into world.
fn tilt_deg(q: &[f64]) -> f64 {
    let [w, x, y, z] = [q[0], q[1], q[2], q[3]];
    let (across, up) = (2.0 * (x * z + w * y).hypot(y * z - w * x), w * w - x * x - y * y + z * z);
    across.atan2(up).to_degrees()
}

fn largest(row: &[f64]) -> f64 {
    row.iter().copied().fold(f64::NAN, f64::max)
}

fn length(row: &[f64]) -> f64 {
    row.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn first(row: &[f64]) -> f64 {
    row[0]
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;

    #[test]
    fn tilt_is_the_angle_from_upright_whatever_the_heading() {
        for (roll, pitch, yaw) in [(0.0, 0.0, 2.0), (0.3, 0.0, -1.0), (0.2, -0.4, 0.7), (3.0, 0.1, 0.0)] {
            let q = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            let up: Vector3<f64> = q * Vector3::z();
            let expected = up.angle(&Vector3::z()).to_degrees();
            let found = tilt_deg(&[q.w, q.i, q.j, q.k]);
            assert!((found - expected).abs() < 1e-6, "{found} instead of {expected}");
        }
    }
}
