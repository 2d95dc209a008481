//! The slots of a shape.

use super::document::FormationShape;
use super::error::ScenarioError;
use super::limits::{DEFAULT_SPACING, rounded_up};
use super::shapes::HelixKeys;
use super::values::rows;
use tautline_laws::formation::Formation;

/// The formation of a shape.
pub(super) fn formation(shape: &FormationShape, count: usize, delta_m: f64) -> Result<Formation, ScenarioError> {
    Ok(match shape {
        &FormationShape::Pentagon { side_m } => Formation::pentagon(side_m),
        &FormationShape::Circle { radius_m } => Formation::circle(count, radius_m),
        &FormationShape::Line { spacing_m } => Formation::line(count, spacing_m),
        &FormationShape::Grid { spacing_m } => Formation::grid(count, spacing_m),
        &FormationShape::Sphere { radius_m } => Formation::sphere(count, radius_m),
        FormationShape::V(keys) => Formation::v(count, spacing(keys.spacing_m, delta_m), keys.angle_deg.to_radians()),
        FormationShape::Wedge(keys) => Formation::wedge(count, spacing(keys.spacing_m, delta_m)),
        FormationShape::Rings(keys) => Formation::rings(count, spacing(keys.spacing_m, delta_m)),
        FormationShape::Cube(keys) => Formation::cube(count, spacing(keys.spacing_m, delta_m)),
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

fn spacing(spacing_m: Option<f64>, delta_m: f64) -> f64 {
    spacing_m.unwrap_or(DEFAULT_SPACING * delta_m)
}

/// Part of the spacing by which rounding may bring slots of a helix nearer.
const ROUNDING: f64 = 1e-12;

/// How much steeper a helix is tried to be until its turns keep the spacing.
const STEEPER: f64 = 1.01;

fn helix(keys: &HelixKeys, count: usize, delta_m: f64) -> Result<Formation, ScenarioError> {
    let HelixKeys { radius_m, pitch_m, .. } = *keys;
    if let Some(turns) = keys.turns {
        if keys.spacing_m.is_some() {
            return Err(ScenarioError::new("both `spacing_m` and `turns` are given")
                .coded("scenario/exclusive-keys")
                .with_help("keep one of them")
                .at("formation.turns")
                .at("formation.spacing_m"));
        }
        let step_rad = std::f64::consts::TAU * turns / count.saturating_sub(1).max(1) as f64;
        return Ok(Formation::helix(count, radius_m, pitch_m, step_rad));
    }
    let spacing_m = spacing(keys.spacing_m, delta_m);
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
