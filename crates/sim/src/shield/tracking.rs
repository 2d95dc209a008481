//! Quadrotors under a shield: keys from the measured `[tracking]` table of their model, and its conditions.

use super::search::CHANGED_FLIGHTS;
use super::{SAME, ShieldSpec, TRACKING_FACTOR, refused};
use crate::scenario::{ErrorKind, Scenario, ScenarioError, Space};
use crate::vehicle::{self, Quadrotor, Tracking, TrackingSearch};
use tautline_core::fact::{Fact, FactKind, Source};
use tautline_core::option::IDENTIFY;
use tautline_core::text::shortest;
use tautline_laws::law::LawSpec;
use tautline_shield::Limits;

/// Key of the wind.
const WIND: &str = "wind";
/// Default of the largest command without a measured table, as a share of what thrust and lift allow.
const ACCEL_SHARE: f64 = 0.5;

/// Basis of the bound on the distance of a vehicle to its reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TrackingBasis {
    /// Computed bound of the tracker's loop.
    Proved,
    /// Largest error of a search with this number of flights, times a margin.
    Searched(u64),
    /// Declared by the scenario, or by a table of the model without a full search of this model and this table. So is
    /// the error of a reference that accelerates more than that of the search.
    Assumed,
}

impl TrackingBasis {
    /// Returns the facts on the tracking error, with its bound \[m\].
    pub(crate) fn facts(self, error_m: f64) -> Vec<Fact> {
        let error = |source| Fact::number(FactKind::TrackingError, source, error_m, "m");
        match self {
            Self::Proved => vec![error(Source::Proved)],
            Self::Assumed => vec![error(Source::Declared)],
            Self::Searched(flights) => vec![
                error(Source::Observed),
                Fact::number(FactKind::TrackingSearch, Source::Recorded, flights as f64, "flights"),
            ],
        }
    }

    /// Returns the certificate of the shield in words.
    pub(crate) fn certificate(self, limits: &Limits) -> String {
        let words = limits.certificate();
        match self {
            Self::Proved | Self::Assumed => words,
            Self::Searched(flights) => {
                format!("certified {words}. The tracking error was measured by a search of {flights} flights")
            }
        }
    }
}

/// Returns whether a search has the flights of a full one in each of its dimensions, and the margin of `--identify`.
fn is_full(search: &TrackingSearch) -> bool {
    search.margin >= TRACKING_FACTOR && search.flights >= CHANGED_FLIGHTS * search.dimensions.len() as u64
}

impl Scenario {
    /// Returns the basis of the bound on the tracking error; `None` without a shield.
    pub(crate) fn tracking_basis(&self) -> Option<TrackingBasis> {
        let given = self.shield?;
        if given.tracking_error_m.is_some() {
            return Some(TrackingBasis::Assumed);
        }
        let Some(quadrotor) = self.airframe.quadrotor() else { return Some(TrackingBasis::Proved) };
        let dimensions = self.space.dimensions();
        let search = quadrotor.model.tracking_search().filter(|search| {
            // Searches use the engine, so that they do not cover the ideal plant.
            let is_searched = is_full(search) && search.dimensions.contains(&dimensions) && self.has_engine();
            is_searched && self.accelerates_as_searched()
        });
        Some(search.map_or(TrackingBasis::Assumed, |search| TrackingBasis::Searched(search.flights)))
    }

    /// Returns whether the reference accelerates at most as that of the search. A smaller speed or smaller errors than
    /// those of the table leave more of the commands to the reference.
    fn accelerates_as_searched(&self) -> bool {
        let table = self.airframe.quadrotor().and_then(|quadrotor| quadrotor.model.tracking.as_ref());
        let (Some(table), Some(spec)) = (table, self.shield_keys()) else { return false };
        let searched = ShieldSpec {
            accel_m_s2: Some(table.accel_m_s2),
            brake_m_s2: None,
            max_speed_m_s: Some(table.max_speed_m_s),
            position_error_m: table.position_error_m,
            velocity_error_m_s: table.velocity_error_m_s,
            disturbance_m_s2: Some(table.disturbance_m_s2),
            ..spec
        };
        let most_m_s2 = |spec: &ShieldSpec| {
            let limits = self.shield_settings(spec, table.control_hz).ok()?.limits().ok()?;
            Some(limits.reference_m_s2())
        };
        let (Some(flown_m_s2), Some(searched_m_s2)) = (most_m_s2(&spec), most_m_s2(&searched)) else { return false };
        flown_m_s2 <= searched_m_s2 * (1.0 + SAME)
    }

    /// Returns the table of the shield. For quadrotors, the measured table of the model replaces keys that are not
    /// given, and `tracking_error_m` if the scenario is within its conditions.
    pub(super) fn shield_keys(&self) -> Option<ShieldSpec> {
        let mut spec = self.shield?;
        let Some(Quadrotor { model, .. }) = self.airframe.quadrotor() else { return Some(spec) };
        let most_m_s2 = self.actuation.max_accel_m_s2.unwrap_or(f64::INFINITY);
        let Some(tracking) = &model.tracking else {
            let accel_m_s2 = ACCEL_SHARE * model.most_accel_m_s2(self.space == Space::Plane);
            spec.accel_m_s2 = spec.accel_m_s2.or(Some(accel_m_s2.min(most_m_s2)));
            return Some(spec);
        };
        let speed_m_s = self.law_speed_m_s().unwrap_or(f64::INFINITY).min(tracking.max_speed_m_s);
        spec.accel_m_s2 = spec.accel_m_s2.or(Some(tracking.accel_m_s2.min(most_m_s2)));
        spec.max_speed_m_s = spec.max_speed_m_s.or(Some(speed_m_s));
        spec.disturbance_m_s2 = spec.disturbance_m_s2.or(Some(tracking.disturbance_m_s2));
        spec.tracker_per_s2 = spec.tracker_per_s2.or(Some(tracking.tracker_per_s2));
        spec.tracker_per_s = spec.tracker_per_s.or(Some(tracking.tracker_per_s));
        if spec.tracking_error_m.is_none() && self.beyond_tracking(&spec, tracking).is_none() {
            spec.tracking_error_m = Some(tracking.error_m);
        }
        Some(spec)
    }

    /// Returns the largest speed that the law commands; `None` for laws without a limit \[m/s\].
    pub(super) fn law_speed_m_s(&self) -> Option<f64> {
        match &self.law {
            LawSpec::Orca(keys) => Some(keys.max_speed_m_s),
            LawSpec::CbfQp(keys) => Some(keys.max_speed_m_s),
            _ => None,
        }
    }

    /// Returns the key and the text of the first condition of the measured table that the scenario does not meet.
    fn beyond_tracking(&self, spec: &ShieldSpec, tracking: &Tracking) -> Option<(&'static str, String)> {
        let quadrotor = self.airframe.quadrotor()?;
        let given = |key: Option<f64>| key.unwrap_or(f64::NAN);
        let same = [
            ("shield.tracker_per_s2", given(spec.tracker_per_s2), tracking.tracker_per_s2),
            ("shield.tracker_per_s", given(spec.tracker_per_s), tracking.tracker_per_s),
            ("time.control_hz", given(self.time.control_hz), tracking.control_hz),
            ("vehicle.attitude_hz", quadrotor.attitude_hz, tracking.attitude_hz),
            ("sensing.latency_s", self.sensing.latency_s, 0.0),
            ("actuation.lag_s", self.actuation.lag_s, 0.0),
            ("shield.period_tolerance", spec.period_tolerance, 0.0),
            ("shield.hang_periods", spec.hang_periods as f64, 0.0),
        ];
        let at_most = [
            ("shield.accel_m_s2", given(spec.accel_m_s2), tracking.accel_m_s2),
            ("shield.max_speed_m_s", given(spec.max_speed_m_s), tracking.max_speed_m_s),
            ("shield.position_error_m", spec.position_error_m, tracking.position_error_m),
            ("shield.velocity_error_m_s", spec.velocity_error_m_s, tracking.velocity_error_m_s),
            ("time.dt_s", self.time.dt_s, tracking.dt_s),
            (WIND, self.fastest_wind_m_s(), tracking.wind_m_s),
        ];
        // A smaller push leaves more acceleration to the reference.
        let at_least = [("shield.disturbance_m_s2", given(spec.disturbance_m_s2), tracking.disturbance_m_s2)];
        // Limits of 0 need a floor that is small against a step of 0.002 s.
        let rounding = |limit: f64| SAME * limit.abs().max(1e-3);
        let lists = [
            (&same[..], "must be", f64::abs as fn(f64) -> f64),
            (&at_most[..], "must be at most", |excess| excess),
            (&at_least[..], "must be at least", |excess| -excess),
        ];
        let numbers = lists.into_iter().find_map(|(list, must, excess)| {
            let is_within = |value: f64, limit: f64| excess(value - limit) <= rounding(limit);
            let (key, value, limit) = list.iter().find(|(_, value, limit)| !is_within(*value, *limit))?;
            let name = if *key == WIND { "the fastest wind in m/s" } else { key };
            Some((*key, format!("{name} {must} {}, got {}", shortest(*limit), shortest(*value))))
        });
        let switches = [("vehicle.downwash", quadrotor.downwash), ("vehicle.ground_effect", quadrotor.ground_effect)];
        numbers.or_else(|| {
            switches.iter().find(|(_, is_on)| *is_on).map(|&(key, _)| (key, format!("{key} must be false")))
        })
    }

    /// Checks that the vehicles can carry out the largest command, and that their tracking error is known.
    pub(super) fn check_tracking(&self, spec: &ShieldSpec) -> Result<(), ScenarioError> {
        let Some(Quadrotor { model, .. }) = self.airframe.quadrotor() else { return Ok(()) };
        let most_m_s2 = model.most_accel_m_s2(self.space == Space::Plane);
        if let Some(accel_m_s2) = spec.accel_m_s2.filter(|accel_m_s2| *accel_m_s2 > most_m_s2) {
            let most = shortest(most_m_s2);
            let problem = format!("shield.accel_m_s2 must be at most {most}, which thrust and lift allow");
            let help = "reduce it; the default is that of the model";
            return Err(refused(&["shield.accel_m_s2", "vehicle.model"], &problem, accel_m_s2, help));
        }
        if spec.tracking_error_m.is_some() {
            return Ok(());
        }
        let beyond = model.tracking.as_ref().and_then(|tracking| self.beyond_tracking(spec, tracking));
        let other_loop = self.other_attitude_loop().map(|(key, measured, value)| {
            (key, format!("{key} must be {}, got {}", shortest(measured), shortest(value)))
        });
        let found = beyond.or(other_loop);
        let problem = match &found {
            None => "the distance of a quadrotor to its reference has no computed bound".to_owned(),
            Some((_, beyond)) => {
                format!("the scenario is beyond the measured tracking error of {}: {beyond}", model.name)
            }
        };
        let command = format!("tautline check {}", IDENTIFY.argument());
        let help = format!("measure it with `{command}`, and set shield.tracking_error_m");
        let error = ErrorKind::Shield.at(&["shield.tracking_error_m", "vehicle.model"], &problem, &help);
        Err(found.into_iter().fold(error, |error, (key, _)| error.at(&[key])))
    }

    /// Returns the first key of the attitude loop that differs from that of the measurement, with both values. The
    /// measurement is that of the built-in model.
    fn other_attitude_loop(&self) -> Option<(&'static str, f64, f64)> {
        let Quadrotor { model, .. } = self.airframe.quadrotor()?;
        let measured = vehicle::built_in(&model.name).filter(|measured| measured.tracking.is_some())?;
        let keys = [
            ("vehicle.attitude_rad_s", measured.attitude_rad_s, model.attitude_rad_s),
            ("vehicle.attitude_damping", measured.attitude_damping, model.attitude_damping),
        ];
        keys.into_iter().find(|(_, measured, value)| measured != value)
    }
}
