//! `[formation]` and `[[leg]]` of the scenario file: converts shapes to slots, then places and assigns them leg by leg.

use nalgebra::Vector3;

use super::document::{
    Assignment, FormationShape, FormationTable, HelixKeys, LegStart, LegTable, Placement, Point, rows,
};
use super::error::{ErrorKind, ScenarioError, leg_key};
use super::limits::{DEFAULT_SPACING, rounded_up};
use super::spec::Scenario;
use tautline_core::swarm::{Rows, row, set_row};
use tautline_laws::formation::{Formation, Freedom, most_assigned, optimal_slots, optimal_slots_around};
use tautline_laws::target::{Leg, LegTrigger};

/// Number of slots of the pentagon.
const PENTAGON_COUNT: usize = 5;

/// Adds the legs of the file to a scenario. A scenario with an invalid law is left to [`super::validate`].
pub(super) fn legs(scenario: &mut Scenario, first: &FormationTable, later: &[LegTable]) -> Result<(), ScenarioError> {
    let (count, delta_m) = (scenario.count(), scenario.delta_m);
    scenario.legs.push(first.placement.place(Leg::first(formation(&first.shape, count, delta_m)?)));
    let mut placements = std::iter::once(&first.placement).chain(later.iter().map(|leg| &leg.placement));
    let is_assigned = placements.any(|placement| placement.assignment != Assignment::Given);
    let freedom = if is_assigned { freedom(scenario)? } else { None };
    let leader = scenario.reference.as_ref().and_then(|guidance| guidance.known_by.leader());
    scenario.legs[0].interchangeable = interchangeable(scenario, 0, first.placement.assignment)?;
    assign(&mut scenario.legs[0], first.placement.assignment, &scenario.start.positions_m, (freedom, leader));
    for (number, LegTable { start_s, placement, shape }) in later.iter().enumerate() {
        let before = scenario.legs[number].formation.clone();
        let formation = shape
            .as_ref()
            .map_or_else(|| Ok(before.clone()), |shape| formation(shape, count, delta_m))
            .map_err(|error| error.on_leg(number + 1))?;
        let begins = start_s.map_or(LegTrigger::Reached, LegStart::begins);
        let interchangeable = interchangeable(scenario, number + 1, placement.assignment)?;
        let mut leg = placement.place(Leg { formation, begins, interchangeable });
        assign(&mut leg, placement.assignment, &before.slots_m, (freedom, leader));
        scenario.legs.push(leg);
    }
    anchor(scenario);
    Ok(())
}

/// Returns the rigid motions that the law leaves free, for the assignment of vehicles.
fn freedom(scenario: &Scenario) -> Result<Option<Freedom>, ScenarioError> {
    let Ok(law) = scenario.law() else { return Ok(None) };
    let leads = scenario.reference.as_ref().is_some_and(|guidance| guidance.known_by.leader().is_some());
    // The formation follows a leader by translation.
    let freedom = if leads { Freedom::Translation } else { law.capabilities().controls.freedom() };
    let most = most_assigned(freedom);
    if scenario.count() > most {
        let problem = format!("an assignment needs at most {most} vehicles, got {}", scenario.count());
        let help = "set assignment to \"given\", or reduce swarm.count";
        return Err(ErrorKind::OutOfRange.at(&["formation.assignment", "swarm.count"], problem, help));
    }
    Ok(Some(freedom))
}

/// Returns whether a stalled swarm may reassign the slots of a leg. Refuses `when-stalled` if the law has no deadlock
/// recovery or it is off.
fn interchangeable(scenario: &Scenario, leg: usize, assignment: Assignment) -> Result<bool, ScenarioError> {
    if assignment == Assignment::Given {
        return Ok(false);
    }
    let Ok(law) = scenario.law() else { return Ok(false) };
    let why = match (law.capabilities().settling, scenario.deadlock.is_on()) {
        (Some(_), true) => return Ok(true),
        (None, _) => format!("the law `{}` reassigns no slots when the swarm is stalled", law.name()),
        (Some(_), false) => "no slots are reassigned with deadlock recovery off".to_owned(),
    };
    if assignment != Assignment::WhenStalled {
        return Ok(false);
    }
    let help =
        "set assignment to \"given\" or \"optimal\", or law.kind to \"displacement\" and deadlock.mode to \"auto\"";
    Err(ErrorKind::UnsupportedByLaw.at(&[&leg_key(leg, "assignment"), "law.kind", "deadlock.mode"], why, help))
}

/// Assigns slots with the least sum of squared distances from the positions `from_m` \[m\]; a leader keeps its slot.
fn assign(leg: &mut Leg, by: Assignment, from_m: &Rows, (freedom, leader): (Option<Freedom>, Option<usize>)) {
    let (Assignment::Optimal, Some(freedom)) = (by, freedom) else { return };
    let slots = match leader {
        Some(leader) => optimal_slots_around(from_m, &leg.formation, leader),
        None => optimal_slots(from_m, &leg.formation, freedom),
    };
    // Validation refuses positions that are not finite.
    if let Some(slots) = slots {
        leg.formation = leg.formation.reordered(&slots);
    }
}

impl Placement {
    fn place(&self, leg: Leg) -> Leg {
        let (yaw_rad, offset_m) = (self.yaw_deg.to_radians(), self.move_m.map_or([0.0; 3], Point::coordinates).into());
        if self.scale == 1.0 && yaw_rad == 0.0 && offset_m == Vector3::zeros() {
            return leg;
        }
        leg.placed(self.scale, yaw_rad, offset_m)
    }
}

/// Translates each leg so that the slot of the leader is the leader's position relative to the reference: the leader
/// follows only its reference.
fn anchor(scenario: &mut Scenario) {
    let Some(leader) = scenario.reference.as_ref().and_then(|guidance| guidance.known_by.leader()) else { return };
    let place_m = row(&scenario.start.positions_m, leader) - scenario.reference_at(0.0).position_m;
    for leg in &mut scenario.legs {
        let slots_m = &mut leg.formation.slots_m;
        let move_m = place_m - row(slots_m, leader);
        // Validation refuses positions that are not finite, and names the vehicle.
        if move_m != Vector3::zeros() && move_m.iter().all(|x| x.is_finite()) {
            (0..slots_m.nrows()).for_each(|i| {
                let slot_m = row(slots_m, i) + move_m;
                set_row(slots_m, i, slot_m);
            });
            // Exactly, without rounding.
            set_row(slots_m, leader, place_m);
        }
    }
}

/// Returns the number of slots of a shape with a fixed number.
pub(super) fn listed_slots(shape: &FormationShape) -> Option<usize> {
    match shape {
        FormationShape::Points { points_m } => Some(points_m.len()),
        FormationShape::Pentagon { .. } => Some(PENTAGON_COUNT),
        _ => None,
    }
}

/// Refuses legs whose number of slots is not the number of vehicles.
pub(super) fn check_slots(legs: &[LegTable], count: usize) -> Result<(), ScenarioError> {
    let listed = legs.iter().map(|leg| leg.shape.as_ref().and_then(listed_slots));
    for (number, slots) in listed.enumerate() {
        if let Some(slots) = slots.filter(|&slots| slots != count) {
            let problem = format!("leg {} has {slots} slots for {count} vehicles", number + 2);
            let help = "every leg needs a slot for each vehicle";
            return Err(ErrorKind::CountMismatch.at(&[&leg_key(number + 1, "points_m"), "swarm.count"], problem, help));
        }
    }
    Ok(())
}

/// Returns the formation of a shape.
pub(super) fn formation(shape: &FormationShape, count: usize, delta_m: f64) -> Result<Formation, ScenarioError> {
    Ok(match shape {
        &FormationShape::Pentagon { side_m } => Formation::pentagon(side_m),
        FormationShape::Circle(keys) => Formation::circle(count, keys.radius_m),
        FormationShape::Line(keys) => Formation::line(count, keys.spacing_m),
        FormationShape::Grid(keys) => Formation::grid(count, keys.spacing_m),
        FormationShape::Sphere(keys) => Formation::sphere(count, keys.radius_m),
        FormationShape::V(keys) => Formation::v(count, spacing(keys.spacing_m, delta_m), keys.angle_deg.to_radians()),
        FormationShape::Wedge(keys) => Formation::wedge(count, spacing(keys.spacing_m, delta_m)),
        FormationShape::Rings(keys) => Formation::rings(count, spacing(keys.spacing_m, delta_m)),
        FormationShape::Cube(keys) => Formation::cube(count, spacing(keys.spacing_m, delta_m)),
        FormationShape::Helix(keys) => helix(keys, count, delta_m)?,
        FormationShape::Points { points_m } => Formation::points(rows(points_m)),
        #[cfg(feature = "drawn")]
        FormationShape::Text(keys) => super::drawing::text(keys, count, delta_m)?,
        #[cfg(feature = "drawn")]
        FormationShape::Svg(keys) => super::drawing::svg(keys, count, delta_m)?,
        #[cfg(feature = "drawn")]
        FormationShape::Image(keys) => super::drawing::image(keys, count, delta_m)?,
        #[cfg(not(feature = "drawn"))]
        FormationShape::Text(_) | FormationShape::Svg(_) | FormationShape::Image(_) => return Err(without_drawings()),
        FormationShape::File(keys) => Formation::points(rows(&super::files::slots(&keys.file)?)),
    })
}

/// Returns the error of a drawing in a build without the feature `drawn`.
#[cfg(not(feature = "drawn"))]
fn without_drawings() -> ScenarioError {
    let problem = "a drawing needs the feature `drawn`, which this build lacks";
    let help = "build tautline-sim with the feature `drawn`, or list the slots: shape = \"points\" or \"file\"";
    ErrorKind::Shape.at(&["formation.shape"], problem, help)
}

/// Resolves the file of a shape relative to a folder, and replaces a file of points by a list.
pub(super) fn resolve_path(folder: &std::path::Path, shape: &mut FormationShape) -> Result<(), ScenarioError> {
    match shape {
        FormationShape::Svg(keys) => keys.file = keys.file.take().map(|file| folder.join(file)),
        FormationShape::Image(keys) => keys.file = folder.join(&keys.file),
        FormationShape::File(keys) => {
            *shape = FormationShape::Points { points_m: super::files::slots(&folder.join(&keys.file))? };
        }
        _ => {}
    }
    Ok(())
}

/// Returns whether all slots lie in the plane z = 0.
pub(super) fn is_flat(shape: &FormationShape) -> bool {
    match shape {
        FormationShape::Points { points_m } => points_m.iter().all(|point| point.coordinates()[2] == 0.0),
        FormationShape::Sphere(_) | FormationShape::Helix(_) | FormationShape::Cube(_) => false,
        _ => true,
    }
}

fn spacing(spacing_m: Option<f64>, delta_m: f64) -> f64 {
    spacing_m.unwrap_or(DEFAULT_SPACING * delta_m)
}

/// Relative rounding of the smallest distance of slots of a helix.
const ROUNDING: f64 = 1e-12;

/// Factor between the pitches that are tried until turns of a helix keep the spacing.
const STEEPER: f64 = 1.01;

fn helix(keys: &HelixKeys, count: usize, delta_m: f64) -> Result<Formation, ScenarioError> {
    let HelixKeys { radius_m, pitch_m, .. } = *keys;
    if let Some(turns) = keys.turns {
        if keys.spacing_m.is_some() {
            let problem = "both `spacing_m` and `turns` are given";
            let help = "keep one of them";
            return Err(ErrorKind::ExclusiveKeys.at(&["formation.turns", "formation.spacing_m"], problem, help));
        }
        let step_rad = std::f64::consts::TAU * turns / count.saturating_sub(1).max(1) as f64;
        return Ok(Formation::helix(count, radius_m, pitch_m, step_rad));
    }
    let spacing_m = spacing(keys.spacing_m, delta_m);
    let Some(step_rad) = Formation::helix_step_rad(radius_m, pitch_m, spacing_m) else {
        let problem = format!("slots {spacing_m} m apart do not fit a helix of radius {radius_m} m");
        let help = format!("enlarge formation.radius_m to at least {}", 0.5 * spacing_m);
        return Err(ErrorKind::Shape.at(&["formation.radius_m", "formation.spacing_m"], problem, help));
    };
    let keeps = |pitch_m: f64, step_rad: f64| {
        Formation::helix_nearest_m(count, radius_m, pitch_m, step_rad) >= spacing_m * (1.0 - ROUNDING)
    };
    if !keeps(pitch_m, step_rad) {
        // With a smaller pitch, slots of adjacent turns are always closer than the spacing.
        let flattest_m = pitch_m.max(0.5 * spacing_m);
        let steeper = std::iter::successors(Some(flattest_m), |pitch_m| Some(pitch_m * STEEPER));
        let steeper = steeper.take_while(|&pitch_m| pitch_m <= 2.0 * spacing_m);
        let enough = |&pitch_m: &f64| {
            Formation::helix_step_rad(radius_m, pitch_m, spacing_m).is_some_and(|step_rad| keeps(pitch_m, step_rad))
        };
        let enough_m = steeper.skip(1).find(enough).unwrap_or(2.0 * spacing_m);
        let problem = format!("turns {pitch_m} m above each other do not keep a spacing of {spacing_m} m");
        let help = format!("enlarge formation.pitch_m to {}, or reduce formation.spacing_m", rounded_up(enough_m));
        return Err(ErrorKind::Shape.at(&["formation.pitch_m", "formation.spacing_m"], problem, help));
    }
    Ok(Formation::helix(count, radius_m, pitch_m, step_rad))
}
