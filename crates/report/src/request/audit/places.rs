//! Rejection of limits on heights and places that a recording cannot answer.

use super::super::Failure;
use super::AuditRequest;
use tautline_audit::MovingObstacle;
use tautline_audit::envelope::Quantity;
use tautline_audit::recorded::Settings;
use tautline_core::option::{ABOVE, COLUMN, CYLINDER, FROM, IDS, ORIGIN, UNTIL, WELL_CLEAR};
use tautline_core::track::{Item, Tracks};
use tautline_recordings::read::ReadError;

/// Largest drop of level ground below the tangent plane of the origin at which z counts as a height \[m\].
const MOST_DROP_M: f64 = 1.0;

/// Mean radius of the Earth \[m\].
const EARTH_RADIUS_M: f64 = 6_371_000.0;

/// Limits and obstacles of a request that depend on heights or places.
struct RequestedLimits<'a> {
    settings: &'a Settings,
}

impl RequestedLimits<'_> {
    fn limit(&self, is_asked: fn(Quantity) -> bool) -> Option<String> {
        let limit = self.settings.envelope.limits.iter().find(|limit| is_asked(limit.quantity));
        limit.map(|limit| format!("the limit `{}`", limit.quantity.name()))
    }

    fn fence(&self) -> Option<String> {
        self.settings.envelope.fence.as_ref().map(|_| "the fence".to_owned())
    }

    fn fence_with_heights(&self) -> Option<String> {
        let fence = self.settings.envelope.fence.as_ref().filter(|fence| fence.height_m().is_some());
        fence.map(|_| "the fence with `height_m`".to_owned())
    }

    fn above(&self) -> Option<String> {
        self.settings.above_m.map(|_| ABOVE.to_string())
    }

    /// Returns the measure of separations that needs the vertical distance of two vehicles.
    fn vertical_distance(&self) -> Option<String> {
        let cylinder = self.settings.cylinder.map(|_| CYLINDER.to_string());
        cylinder.or_else(|| self.settings.well_clear.map(|_| WELL_CLEAR.to_string()))
    }

    fn obstacle(&self, is_asked: fn(&MovingObstacle) -> bool) -> Option<String> {
        let obstacle = self.settings.obstacles.iter().find(|obstacle| is_asked(obstacle));
        obstacle.map(|obstacle| format!("the obstacle `{}`", obstacle.name))
    }

    /// Returns the part of the request that needs the height of each vehicle.
    fn of_heights(&self) -> Option<String> {
        let upright = || {
            let tilted = self.obstacle(|of| !of.is_upright_through_ground())?;
            Some(format!("{tilted}, which is not upright through height 0,"))
        };
        let limit = self.limit(Quantity::needs_height);
        limit
            .or_else(|| self.vertical_distance())
            .or_else(|| self.fence_with_heights())
            .or_else(|| self.above())
            .or_else(upright)
    }

    /// Returns the part of the request that depends on the origin of the positions.
    fn of_places(&self) -> Option<String> {
        let limit = self.limit(Quantity::needs_origin);
        limit.or_else(|| self.fence()).or_else(|| self.above()).or_else(|| self.obstacle(|_| true))
    }

    /// Returns the part of the request that takes z as a height above level ground.
    fn of_level(&self) -> Option<String> {
        let limit = self.limit(Quantity::needs_origin);
        limit.or_else(|| self.vertical_distance()).or_else(|| self.fence_with_heights()).or_else(|| self.above())
    }
}

/// Checks that z is a height above ground at all vehicles, if the request needs that.
pub(super) struct HeightCheck<'a> {
    settings: &'a Settings,
    /// Part of the request that needs heights; `None` without a check.
    asked: Option<String>,
}

/// Rejects limits on heights if the recording has no heights, and limits on places if the origin is not given.
pub(super) fn refuse_unknown<'a>(
    request: &AuditRequest<'_>,
    asked_by: Option<&str>,
    settings: &'a Settings,
    recording: &dyn Tracks<Error = ReadError>,
) -> Result<HeightCheck<'a>, Failure> {
    let asked = RequestedLimits { settings };
    let of_heights = || {
        let asked = asked.of_heights().filter(|_| recording.is_planar())?;
        let help = format!("name the column of the height with {}, or remove the limit", COLUMN.set("z=NAME"));
        Some((format!("the heights of its vehicles are unknown, and {asked} needs them"), help))
    };
    let origin = recording.earth_origin();
    let of_places = || {
        let place = origin.filter(|origin| origin.is_inferred)?;
        let asked = asked.of_places()?;
        let help = format!("give the origin with {}; a HEIGHT of 0 is the ellipsoid", ORIGIN.set("LAT,LON,HEIGHT"));
        Some((format!("positions are relative to the first one, {place}, and {asked} depends on that"), help))
    };
    let Some((problem, help)) = of_heights().or_else(of_places) else {
        return Ok(HeightCheck { settings, asked: origin.and_then(|_| asked.of_level()) });
    };
    let asked_by = asked_by.map_or(String::new(), |note| format!(" ({note})"));
    Err(Failure::input(
        "audit/unknown-place",
        format!("{}: {problem}", request.subject.name()),
        format!("{help}{asked_by}"),
    ))
}

impl HeightCheck<'_> {
    /// Rejects judged positions so far from the origin that level ground is well below the tangent plane.
    pub(super) fn check(&self, path: &str, names: &[String], items: &[Item]) -> Result<(), Failure> {
        let Some(asked) = &self.asked else { return Ok(()) };
        let Settings { from_s, until_s, only, .. } = self.settings;
        let is_judged = |name: &str, time_s: f64| {
            from_s.is_none_or(|from_s| time_s >= from_s)
                && until_s.is_none_or(|until_s| time_s <= until_s)
                && only.as_ref().is_none_or(|only| only.contains(name))
        };
        for item in items {
            let Item::Sample(sample) = item else { continue };
            let name = names.get(sample.vehicle).map_or("", String::as_str);
            let away_m = sample.position_m.xy().norm();
            let drop_m = away_m * away_m / (2.0 * EARTH_RADIUS_M);
            if drop_m > MOST_DROP_M && is_judged(name, sample.time_s) {
                let (time_s, away_km) = (sample.time_s, away_m / 1000.0);
                let message = format!(
                    "{path}: {name} is {away_km:.1} km from {ORIGIN} at {time_s:?} s, where level ground is \
                     {drop_m:.1} m lower, and {asked} needs heights above the ground"
                );
                let help = format!(
                    "give an {ORIGIN} within 3 km of all vehicles, or judge a part with {IDS}, {FROM} and {UNTIL}"
                );
                return Err(Failure::input("audit/far-from-origin", message, help));
            }
        }
        Ok(())
    }
}
