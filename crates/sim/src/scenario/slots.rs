//! The slots of a shape.

use super::document::FormationShape;
use super::error::ScenarioError;
use super::limits::{DEFAULT_SPACING, positive, require_finite, rounded_up};
use super::shapes::{HelixKeys, VKeys};
use super::values::rows;
use tautline_laws::formation::{Formation, NARROWEST_V_RAD};

/// The formation of a shape.
pub(super) fn formation(shape: &FormationShape, count: usize, delta_m: f64) -> Result<Formation, ScenarioError> {
    let radius = |radius_m| positive("formation.radius_m", "the radius", radius_m);
    Ok(match shape {
        &FormationShape::Pentagon { side_m } => Formation::pentagon(positive("formation.side_m", "the side", side_m)?),
        &FormationShape::Circle { radius_m } => Formation::circle(count, radius(radius_m)?),
        &FormationShape::Line { spacing_m } => Formation::line(count, spacing(Some(spacing_m), delta_m)?),
        &FormationShape::Grid { spacing_m } => Formation::grid(count, spacing(Some(spacing_m), delta_m)?),
        &FormationShape::Sphere { radius_m } => Formation::sphere(count, radius(radius_m)?),
        FormationShape::V(keys) => v(keys, count, delta_m)?,
        FormationShape::Wedge(keys) => Formation::wedge(count, spacing(keys.spacing_m, delta_m)?),
        FormationShape::Rings(keys) => Formation::rings(count, spacing(keys.spacing_m, delta_m)?),
        FormationShape::Cube(keys) => Formation::cube(count, spacing(keys.spacing_m, delta_m)?),
        FormationShape::Helix(keys) => helix(keys, count, delta_m)?,
        FormationShape::Points { points_m } => Formation::points(rows(points_m)),
        FormationShape::Text(keys) => super::drawn::text(keys, count, delta_m)?,
        FormationShape::Svg(keys) => super::drawn::svg(keys, count, delta_m)?,
        FormationShape::Image(keys) => super::drawn::image(keys, count, delta_m)?,
        FormationShape::File(keys) => Formation::points(rows(&super::points::slots(&keys.file)?)),
    })
}

/// Makes a shape's file, named relative to a folder, one that can be opened from where the program runs, and a file of
/// points a list of them.
pub(super) fn found_from(folder: &std::path::Path, shape: &mut FormationShape) -> Result<(), ScenarioError> {
    match shape {
        FormationShape::Svg(keys) => keys.file = keys.file.take().map(|file| folder.join(file)),
        FormationShape::Image(keys) => keys.file = folder.join(&keys.file),
        FormationShape::File(keys) => {
            *shape = FormationShape::Points { points_m: super::points::slots(&folder.join(&keys.file))? };
        }
        _ => {}
    }
    Ok(())
}

/// Whether all slots lie in the plane z = 0.
pub(super) fn is_flat(shape: &FormationShape) -> bool {
    match shape {
        FormationShape::Points { points_m } => points_m.iter().all(|point| point.coordinates()[2] == 0.0),
        FormationShape::Sphere { .. } | FormationShape::Helix(_) | FormationShape::Cube(_) => false,
        _ => true,
    }
}

fn spacing(spacing_m: Option<f64>, delta_m: f64) -> Result<f64, ScenarioError> {
    let default_m =
        || positive("law.delta_m", "the safety distance delta", delta_m).map(|delta_m| DEFAULT_SPACING * delta_m);
    spacing_m.map_or_else(default_m, |spacing_m| positive("formation.spacing_m", "the spacing", spacing_m))
}

fn v(keys: &VKeys, count: usize, delta_m: f64) -> Result<Formation, ScenarioError> {
    let angle_deg = require_finite("the angle", keys.angle_deg).map_err(|error| error.at("formation.angle_deg"))?;
    let angle_rad = angle_deg.to_radians();
    // As many degrees as there are in its least angle are not less than it.
    if angle_rad < NARROWEST_V_RAD * (1.0 - f64::EPSILON) || angle_deg > 180.0 {
        return Err(ScenarioError::new(format!("a V with an angle of {angle_deg} degrees"))
            .coded("scenario/out-of-range")
            .with_help("it must be from 60, so that the arms keep the spacing, to 180")
            .at("formation.angle_deg"));
    }
    Ok(Formation::v(count, spacing(keys.spacing_m, delta_m)?, angle_rad))
}

/// Part of the spacing by which rounding may bring slots of a helix nearer.
const ROUNDING: f64 = 1e-12;

/// How much steeper a helix is tried to be until its turns keep the spacing.
const STEEPER: f64 = 1.01;

fn helix(keys: &HelixKeys, count: usize, delta_m: f64) -> Result<Formation, ScenarioError> {
    let radius_m = positive("formation.radius_m", "the radius", keys.radius_m)?;
    let pitch_m = positive("formation.pitch_m", "the pitch", keys.pitch_m)?;
    if let Some(turns) = keys.turns {
        if keys.spacing_m.is_some() {
            return Err(ScenarioError::new("both `spacing_m` and `turns` are given")
                .coded("scenario/exclusive-keys")
                .with_help("keep one of them")
                .at("formation.turns")
                .at("formation.spacing_m"));
        }
        let turns = positive("formation.turns", "the number of turns", turns)?;
        let step_rad = std::f64::consts::TAU * turns / count.saturating_sub(1).max(1) as f64;
        return Ok(Formation::helix(count, radius_m, pitch_m, step_rad));
    }
    let spacing_m = spacing(keys.spacing_m, delta_m)?;
    let Some(step_rad) = Formation::helix_step_rad(radius_m, pitch_m, spacing_m) else {
        return Err(ScenarioError::new(format!("slots {spacing_m} m apart do not fit a helix of radius {radius_m} m"))
            .coded("scenario/shape")
            .with_help(format!("enlarge formation.radius_m to at least {}", 0.5 * spacing_m))
            .at("formation.radius_m")
            .at("formation.spacing_m"));
    };
    let keeps = |pitch_m: f64, step_rad: f64| {
        Formation::helix_nearest_m(count, radius_m, pitch_m, step_rad) >= spacing_m * (1.0 - ROUNDING)
    };
    if !keeps(pitch_m, step_rad) {
        // With less, a slot is too near to the one above it wherever that is.
        let flattest_m = pitch_m.max(0.5 * spacing_m);
        let steeper = std::iter::successors(Some(flattest_m), |pitch_m| Some(pitch_m * STEEPER));
        let steeper = steeper.take_while(|&pitch_m| pitch_m <= 2.0 * spacing_m);
        let enough = |&pitch_m: &f64| {
            Formation::helix_step_rad(radius_m, pitch_m, spacing_m).is_some_and(|step_rad| keeps(pitch_m, step_rad))
        };
        let enough_m = steeper.skip(1).find(enough).unwrap_or(2.0 * spacing_m);
        return Err(ScenarioError::new(format!(
            "turns {pitch_m} m above each other do not keep a spacing of {spacing_m} m"
        ))
        .coded("scenario/shape")
        .with_help(format!("enlarge formation.pitch_m to {}, or reduce formation.spacing_m", rounded_up(enough_m)))
        .at("formation.pitch_m")
        .at("formation.spacing_m"));
    }
    Ok(Formation::helix(count, radius_m, pitch_m, step_rad))
}
