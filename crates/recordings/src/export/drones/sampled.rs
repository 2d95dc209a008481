//! Samples at a fixed rate: setpoints of MAVSDK Drone Show, and VVIZ shows.
//!
//! MAVSDK Drone Show sends a row when its time has come and PX4 holds it until the next one. Rows are north, east and
//! down in metres. Velocities and accelerations are differences of positions half an interval and an interval apart.
//!
//! VVIZ holds the home of a drone and displacements from sample to sample, with x right, y up and z forward. Positions
//! are rounded to micrometres before the differences are taken, so that errors do not add up.

use std::fmt::Write as _;

use nalgebra::Vector3;
use rayon::prelude::*;
use serde_json::json;

use super::motion::{Arc, Motion};
use super::{DroneError, DroneFile, Encoded, EncodedVehicle, Vehicle, Work, deviation_with_rests, first_error};

/// Largest number of samples of a vehicle.
const MOST_SAMPLES: f64 = 1e7;
/// Resolution of setpoints \[m\].
const SETPOINT_M: f64 = 1e-4;
/// Resolution of displacements \[m\].
const STEP_M: f64 = 1e-6;
/// Resolution of times \[s\].
const TIME_S: f64 = 1e-6;
/// Flight phase of rows on a trajectory.
const MODE: u32 = 70;

/// Returns the CSV of a drone.
pub(super) fn px4_show(
    work: &Work<'_>,
    name: &str,
    label: &str,
    motion: &Motion,
) -> Result<(DroneFile, EncodedVehicle), DroneError> {
    let times_s = work.times_s(motion)?;
    let interval_s = 1.0 / work.rate_hz()?;
    let places: Vec<_> = times_s.iter().map(|time_s| rounded(motion.position_m(*time_s), SETPOINT_M)).collect();
    work.check(name, motion, &times_s, &places, true)?;
    let mut text = "idx,t,px,py,pz,vx,vy,vz,ax,ay,az,yaw,mode,ledr,ledg,ledb\n".to_owned();
    for (row, (time_s, place)) in times_s.iter().zip(&places).enumerate() {
        let position_at = |shift: f64| motion.position_m(time_s + shift * interval_s);
        let velocity = (position_at(0.5) - position_at(-0.5)) / interval_s;
        let acceleration = (position_at(1.0) - position_at(0.0) * 2.0 + position_at(-1.0)) / (interval_s * interval_s);
        // Writing to a string cannot fail.
        let _ = write!(text, "{row},{time_s:.6}");
        for vector in [*place, velocity, acceleration] {
            for coordinate in north_east_down(vector) {
                let _ = write!(text, ",{:.4}", rounded_number(coordinate, SETPOINT_M));
            }
        }
        let _ = writeln!(text, ",0,{MODE},255,255,255");
    }
    let file = DroneFile { name: format!("{label}.csv"), bytes: text.into_bytes() };
    let (parts, bytes) = (places.len(), file.bytes.len());
    Ok((
        file,
        EncodedVehicle { name: name.to_owned(), label: label.to_owned(), parts, bytes, evaluation_m: Vec::new() },
    ))
}

/// Returns the show of all drones.
pub(super) fn vviz(work: &Work<'_>, vehicles: &[Vehicle<'_>]) -> Result<Encoded, DroneError> {
    let hz = work.rate_hz()?;
    let drones = vehicles.par_iter().map(|(name, label, motion)| {
        let times_s = work.times_s(motion)?;
        let places: Vec<_> = times_s.iter().map(|time_s| rounded(motion.position_m(*time_s), STEP_M)).collect();
        work.check(name, motion, &times_s, &places, false)?;
        let mut steps = vec![json!({"dx": 0, "dy": 0, "dz": 0})];
        for (pair, times_s) in places.windows(2).zip(times_s.windows(2)) {
            let by = rounded(pair[1] - pair[0], STEP_M);
            let mut step = json!({"dx": by.x, "dy": by.z, "dz": by.y});
            let duration_s = times_s[1] - times_s[0];
            if (duration_s * hz - 1.0).abs() > 1e-9 {
                step["dt"] = json!(duration_s);
            }
            steps.push(step);
        }
        let home = places.first().copied().unwrap_or_default();
        let agent = json!({"homeX": home.x, "homeY": home.z, "homeZ": home.y, "agentTraversal": steps});
        let drone = json!({"id": label, "type": "agent", "agentDescription": agent, "payloadDescription": []});
        let bytes = drone.to_string().len();
        let (name, label, parts) = ((*name).clone(), label.clone(), places.len());
        Ok((drone, EncodedVehicle { name, label, parts, bytes, evaluation_m: Vec::new() }))
    });
    let (drones, vehicles): (Vec<_>, Vec<_>) = first_error(drones)?.into_iter().unzip();
    let show = json!({
        "version": "1.0",
        "coordinateFrame": "ogl",
        "defaultPositionRate": hz,
        "defaultColorRate": hz,
        "timeOffsetSecs": 0,
        "performances": drones,
    });
    let bytes = serde_json::to_vec(&show).map_err(|error| DroneError::Write(error.to_string()))?;
    Ok(Encoded { files: vec![DroneFile { name: String::new(), bytes }], vehicles })
}

impl Work<'_> {
    fn rate_hz(&self) -> Result<f64, DroneError> {
        let hz = self.options.sample_hz.unwrap_or_else(|| self.options.dialect.usual_hz());
        if hz > 0.0 && hz.is_finite() { Ok(hz) } else { Err(DroneError::SampleRate(hz)) }
    }

    /// Returns the times of the samples \[s\]: regular intervals and the end.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "at most ten million")]
    fn times_s(&self, motion: &Motion) -> Result<Vec<f64>, DroneError> {
        let (hz, end_s) = (self.rate_hz()?, motion.span_s().map_or(0.0, |span| span.1));
        let end_s = rounded_number(end_s, TIME_S);
        let count = end_s * hz;
        if count.is_nan() || count > MOST_SAMPLES || hz * TIME_S > 0.5 {
            return Err(DroneError::SampleRate(hz));
        }
        if (self.is_interrupted)() {
            return Err(DroneError::Interrupted);
        }
        let regular = (0..=count as u64).map(|k| rounded_number(k as f64 / hz, TIME_S));
        let regular = regular.take_while(|time_s| *time_s < end_s - 2.0 * TIME_S);
        Ok(regular.chain([end_s]).collect())
    }

    /// Refuses samples that are farther from the motion than the tolerance.
    fn check(
        &self,
        name: &str,
        motion: &Motion,
        times_s: &[f64],
        places: &[Vector3<f64>],
        holds: bool,
    ) -> Result<(), DroneError> {
        let Some(tolerance_m) = self.options.tolerance_m else { return Ok(()) };
        let arcs = times_s.windows(2).zip(places.windows(2));
        let arcs = arcs.map(|(t, ends)| Arc::straight(t[0], t[1], ends[0], if holds { ends[0] } else { ends[1] }));
        let found = deviation_with_rests(motion, &Motion { arcs: arcs.collect() });
        if found.bound_m <= tolerance_m {
            return Ok(());
        }
        let (vehicle, time_s, found_m) = (name.to_owned(), found.time_s, found.bound_m);
        Err(DroneError::TooCoarse { vehicle, time_s, found_m, tolerance_m })
    }
}

fn north_east_down(v: Vector3<f64>) -> [f64; 3] {
    [v.y, v.x, -v.z]
}

fn rounded(v: Vector3<f64>, resolution: f64) -> Vector3<f64> {
    v.map(|x| rounded_number(x, resolution))
}

/// Rounds to the nearest double of a multiple of the resolution, which is a power of ten below 1. 0 has no sign.
fn rounded_number(x: f64, resolution: f64) -> f64 {
    let per_unit = (1.0 / resolution).round();
    (x * per_unit).round() / per_unit + 0.0
}

#[cfg(test)]
mod tests {
    use nalgebra::vector;

    use super::*;
    use crate::export::drones::{Dialect, DroneOptions, encode};

    fn flight() -> [(String, Motion); 1] {
        let arc = Arc::straight(0.0, 1.02, vector![1.0, 2.0, 3.0], vector![2.02, 2.0, 3.51]);
        [("a".to_owned(), Motion { arcs: vec![arc] })]
    }

    #[test]
    fn setpoints_are_north_east_down_at_20_hz() {
        let encoded = encode(&flight(), &DroneOptions::new(Dialect::Px4Show), &|| false).expect("encoded");
        assert_eq!(encoded.files[0].name, "a.csv");
        let text = String::from_utf8(encoded.files[0].bytes.clone()).expect("text");
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines[0], "idx,t,px,py,pz,vx,vy,vz,ax,ay,az,yaw,mode,ledr,ledg,ledb");
        assert_eq!(
            lines[2],
            "1,0.050000,2.0000,1.0500,-3.0250,0.0000,1.0000,-0.5000,0.0000,0.0000,0.0000,0,70,255,255,255"
        );
        // 0 to 1 s, and the end.
        assert!(lines.len() == 1 + 22 && lines[22].starts_with("21,1.020000,2.0000,2.0200,-3.5100,"), "{}", lines[22]);
    }

    #[test]
    fn held_setpoints_are_refused_beyond_a_tolerance() {
        let options_of =
            |tolerance_m| DroneOptions { tolerance_m: Some(tolerance_m), ..DroneOptions::new(Dialect::Px4Show) };
        // 1.118 m/s for 50 ms.
        assert!(encode(&flight(), &options_of(0.057), &|| false).is_ok());
        let refused = encode(&flight(), &options_of(0.055), &|| false).expect_err("refused");
        assert!(
            matches!(refused, DroneError::TooCoarse { .. }) && refused.help().contains("sample_hz or tolerance"),
            "{refused}"
        );
        for hz in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e9] {
            let options = DroneOptions { sample_hz: Some(hz), ..DroneOptions::new(Dialect::Vviz) };
            assert!(matches!(encode(&flight(), &options, &|| false), Err(DroneError::SampleRate(_))), "{hz}");
        }
    }
}
