//! Errors of an audit as failures of requests, with remedies.

use tautline_core::failure::Failure;
use tautline_core::option::{
    ABOVE, ACCEL_WINDOW, CYLINDER, DELTA, ELLIPSOID, FENCE, FROM, IDS, LAND_ON, LIMIT, MAX_ACCEL, MOTION, OFFSET,
    RADIUS, TIME_SCALE, TOPIC, UNTIL, WELL_CLEAR,
};

use super::RecordedError;

impl From<RecordedError> for Failure {
    fn from(error: RecordedError) -> Self {
        let message = error.to_string();
        let (code, message, help) = match &error {
            RecordedError::Interrupted => return Self::interrupted(),
            RecordedError::OutOfRange { option, of: subject, range, .. } => {
                let name = if subject.is_some() { "NAME=" } else { "" };
                let help = match *option {
                    ELLIPSOID => format!("give {} with three numbers above 0", ELLIPSOID.set("X,Y,Z")),
                    CYLINDER => format!("give {} with two numbers above 0, such as 2,4", CYLINDER.set("R,H")),
                    WELL_CLEAR => format!("give {}, or D,Z,T such as 1219.2,137.16,35", WELL_CLEAR.set("PRESET")),
                    _ => format!("give {}, where NUMBER is {range}", option.set(format!("{name}NUMBER"))),
                };
                ("audit/out-of-range", message, help)
            }
            RecordedError::EmptyWindow { .. } => {
                ("audit/empty-window", message, format!("give a {UNTIL} that is at least {FROM}"))
            }
            RecordedError::NoBound { .. } => {
                let [of_all, of_one] = ["A", "NAME=A"].map(|value| MAX_ACCEL.set(value));
                let help = format!("give the largest acceleration with {of_all} or {of_one}");
                ("audit/no-acceleration-bound", message, help)
            }
            RecordedError::NoLimit { .. } => {
                let radius = RADIUS.set("NAME=R");
                let help = format!("give {DELTA}, or {radius}; or give {LIMIT} and {FENCE} alone");
                ("audit/no-limit", message, help)
            }
            RecordedError::NoAccelWindow => {
                let [limit, motion] = [LIMIT.set("accel=A"), MOTION.set("bounded")];
                let help = format!("add {limit} and leave {motion} out, or leave {ACCEL_WINDOW} out");
                ("audit/acceleration-window", message, help)
            }
            RecordedError::LimitOfJumps { .. } => {
                let help = format!("give {}, or bounded with {MAX_ACCEL}", MOTION.set("linear"));
                ("audit/limit-of-jumps", message, help)
            }
            RecordedError::UnknownVehicle { .. } => {
                let help = format!("use the names of the recording in {IDS}, {RADIUS}, {MAX_ACCEL} and {OFFSET}");
                ("audit/unknown-vehicle", message, help)
            }
            RecordedError::NoGround { .. } => {
                let help = format!("give the height of the ground with {}, or leave {LAND_ON} out", ABOVE.set("Z"));
                ("audit/land-on", message, help)
            }
            RecordedError::AmbiguousObstacle { .. } => {
                ("audit/land-on", message, format!("give each obstacle its own name, or leave {LAND_ON} out"))
            }
            RecordedError::UnknownObstacle { .. } => {
                ("audit/land-on", message, format!("use the names of the obstacles, or leave {LAND_ON} out"))
            }
            RecordedError::NotACurve { .. } => {
                ("audit/no-curves", message, format!("give {}, hold or bounded", MOTION.set("linear")))
            }
            RecordedError::NotSamples { .. } => {
                ("audit/no-samples", message, format!("leave {MOTION} out, or give {}", MOTION.set("polynomial")))
            }
            RecordedError::RadiusChanges { .. } => (
                "audit/radius-changes",
                message,
                format!("give one radius of the vehicle with {}", RADIUS.set("NAME=R")),
            ),
            RecordedError::ExchangedFlights { .. } => {
                ("audit/exchanged-flights", message, format!("judge plans or positions alone with {TOPIC}"))
            }
            RecordedError::OffsetOfPlans { .. } => {
                ("audit/offset-of-plans", message, format!("omit {OFFSET}, or judge positions alone with {TOPIC}"))
            }
            RecordedError::ObstaclesAndEllipsoid => (
                "audit/obstacles-and-ellipsoid",
                message,
                format!("judge obstacles by {DELTA} or {RADIUS}, and ellipsoids without them"),
            ),
            RecordedError::CylinderAnd { other } => {
                ("audit/cylinder", message, format!("leave {CYLINDER} or {other} out"))
            }
            RecordedError::WellClearMotion { .. } => {
                ("audit/well-clear", message, format!("give {}, or leave {MOTION} out", MOTION.set("linear")))
            }
            RecordedError::WellClearAndEllipsoid => {
                ("audit/well-clear", message, format!("leave {ELLIPSOID} or {WELL_CLEAR} out"))
            }
            RecordedError::Obstacle(_) => ("audit/obstacle", message, "correct the obstacle file".to_owned()),
            RecordedError::TwoClocks { .. } => {
                let offset = OFFSET.set("NAME=SECONDS");
                let help = format!(
                    "correct a clock with {offset}, or judge vehicles of one clock with {IDS}, or a time with {FROM}"
                );
                ("audit/two-clocks", message, help)
            }
            RecordedError::Unnamed { .. }
            | RecordedError::TimeNotIncreasing { .. }
            | RecordedError::OutOfOrder { .. }
            | RecordedError::Item { .. } => {
                let help = format!(
                    "correct the recording there, exclude the vehicle with {IDS}, or check {OFFSET} and {TIME_SCALE}"
                );
                ("audit/malformed", message, help)
            }
        };
        Self::input(code, message, help)
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Settings, TrackAuditor, VehicleSettings};
    use super::*;

    #[test]
    fn errors_of_an_audit_name_options() {
        let delta = Settings::delta(1.0);
        let of_one = VehicleSettings { max_accel_m_s2: Some(-1.0), ..VehicleSettings::default() };
        let land_on = [String::from("pad")].into();
        for (settings, expected) in [
            (
                Settings { vehicles: [("a".to_owned(), of_one)].into(), ..delta.clone() },
                "max_accel: must be a finite number of at least 0, got a=-1.0 \
                 (give max_accel=NAME=NUMBER, where NUMBER is a finite number of at least 0)",
            ),
            (
                Settings { from_s: Some(f64::NAN), ..delta.clone() },
                "from_s: must be a finite number, got NaN (give from_s=NUMBER, where NUMBER is a finite number)",
            ),
            (
                Settings { until_s: Some(f64::NAN), ..delta.clone() },
                "until_s: must be a finite number, got NaN (give until_s=NUMBER, where NUMBER is a finite number)",
            ),
            (
                Settings { land_on, ..delta },
                "land_on: the obstacle `pad` is exempt at or below a height, which is not given \
                 (give the height of the ground with above=Z, or leave land_on out)",
            ),
        ] {
            let error = TrackAuditor::new(settings).expect_err("refused");
            assert_eq!(Failure::from(error).to_string(), expected);
        }
    }
}
