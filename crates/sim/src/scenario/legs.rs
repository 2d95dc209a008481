//! `[formation]` and `[[leg]]` of the scenario file as legs: shapes into slots, placed and assigned one after the other.

use nalgebra::Vector3;

use super::document::{Assignment, FormationShape, FormationTable, LegTable};
use super::error::ScenarioError;
use super::slots::formation;
use super::spec::Scenario;
use super::values::{LegStart, Point};
use tautline_core::swarm::{Rows, row, set_row};
use tautline_laws::formation::{Freedom, most_assigned, optimal_slots, optimal_slots_around};
use tautline_laws::target::{Begins, Leg};

/// Slots of the pentagon.
const PENTAGON_COUNT: usize = 5;

/// How slots are placed.
struct Placement {
    scale: f64,
    yaw_rad: f64,
    offset_m: Vector3<f64>,
}

/// Gives a scenario without legs those of its file. One without a law is left for [`super::validate`] to refuse.
pub(super) fn legs(scenario: &mut Scenario, first: &FormationTable, later: &[LegTable]) -> Result<(), ScenarioError> {
    let (count, delta_m) = (scenario.count(), scenario.delta_m);
    let placement = Placement::of(first.scale, first.yaw_deg, first.move_m);
    let leg = placement.place(Leg::first(formation(&first.shape, count, delta_m)?));
    scenario.legs.push(leg);
    let mut assignments = std::iter::once(first.assignment).chain(later.iter().map(|leg| leg.assignment));
    let freedom = if assignments.any(|by| by != Assignment::Given) { freedom(scenario)? } else { None };
    let is_interchangeable = interchangeable(scenario, 0, first.assignment)?;
    scenario.legs[0].interchangeable = is_interchangeable;
    let starts_m = scenario.start.positions_m.clone();
    let leader = scenario.reference.as_ref().and_then(|guidance| guidance.known_by.leader());
    let assign = |leg: &mut Leg, by: Assignment, from_m: &Rows| assign(leg, by, from_m, (freedom, leader));
    assign(&mut scenario.legs[0], first.assignment, &starts_m);
    for (number, table) in later.iter().enumerate() {
        let placement = Placement::of(table.scale, table.yaw_deg, table.move_m);
        let before = scenario.legs[number].formation.clone();
        let formation = table
            .shape
            .as_ref()
            .map_or_else(|| Ok(before.clone()), |shape| formation(shape, count, delta_m))
            .map_err(|error| error.on_leg(number + 1))?;
        let begins = table.start_s.map_or(Begins::Reached, LegStart::begins);
        let interchangeable = interchangeable(scenario, number + 1, table.assignment)?;
        let mut leg = placement.place(Leg { formation, begins, interchangeable });
        assign(&mut leg, table.assignment, &before.slots_m);
        scenario.legs.push(leg);
    }
    anchor(scenario);
    Ok(())
}

/// How formations may be moved under the law of the scenario, where vehicles may be assigned to them.
fn freedom(scenario: &Scenario) -> Result<Option<Freedom>, ScenarioError> {
    let Ok(law) = scenario.law() else { return Ok(None) };
    let leads = scenario.reference.as_ref().is_some_and(|guidance| guidance.known_by.leader().is_some());
    // Wherever a leader is, slots are moved there.
    let freedom = if leads { Freedom::Translation } else { law.capabilities().controls.freedom() };
    let most = most_assigned(freedom);
    if scenario.count() > most {
        return Err(ScenarioError::new(format!("{} vehicles are too many to be assigned", scenario.count()))
            .coded("scenario/out-of-range")
            .with_help(format!("set assignment to \"given\", or fly at most {most} vehicles"))
            .at("formation.assignment")
            .at("swarm.count"));
    }
    Ok(Some(freedom))
}

/// Whether a leg's vehicles may be given other slots where they are stalled. Nobody tells whether they are under a law that
/// is not given spread slots then either, or where breathing is off.
fn interchangeable(scenario: &Scenario, leg: usize, assignment: Assignment) -> Result<bool, ScenarioError> {
    if assignment == Assignment::Given {
        return Ok(false);
    }
    let Ok(law) = scenario.law() else { return Ok(false) };
    let why = match (law.capabilities().settling, scenario.breathing.is_on()) {
        (Some(_), true) => return Ok(true),
        (None, _) => format!("under the law `{}` nobody is assigned anew where the swarm is stalled", law.name()),
        (Some(_), false) => "with breathing off nobody is assigned anew where the swarm is stalled".to_owned(),
    };
    if assignment != Assignment::WhenStalled {
        return Ok(false);
    }
    Err(ScenarioError::new(why).coded("scenario/unsupported-by-law")
        .with_help("set the assignment to \"given\" or \"optimal\", or law.kind to \"displacement\" and breathing.mode to \"auto\"")
        .at_leg(leg, "formation.assignment")
        .at("law.kind")
        .at("breathing.mode"))
}

/// Gives each vehicle the slot that makes the sum of squared ways from these places \[m\] least; a leader keeps its own.
fn assign(leg: &mut Leg, by: Assignment, from_m: &Rows, (freedom, leader): (Option<Freedom>, Option<usize>)) {
    let (Assignment::Optimal, Some(freedom)) = (by, freedom) else { return };
    let slots = match leader {
        Some(leader) => optimal_slots_around(from_m, &leg.formation, leader),
        None => optimal_slots(from_m, &leg.formation, freedom),
    };
    // What is not finite is told by validation.
    if let Some(slots) = slots {
        leg.formation = leg.formation.reordered(&slots);
    }
}

impl Placement {
    fn of(scale: f64, yaw_deg: f64, move_m: Option<Point>) -> Self {
        let offset_m = move_m.map_or_else(Vector3::zeros, |point| point.coordinates().into());
        Self { scale, yaw_rad: yaw_deg.to_radians(), offset_m }
    }

    fn place(&self, leg: Leg) -> Leg {
        let &Self { scale, yaw_rad, offset_m } = self;
        if scale == 1.0 && yaw_rad == 0.0 && offset_m == Vector3::zeros() {
            return leg;
        }
        leg.placed(scale, yaw_rad, offset_m)
    }
}

/// Moves each leg so that a leader's slot is where the leader is on the reference: it listens to nobody, and so the swarm is
/// formed around it.
fn anchor(scenario: &mut Scenario) {
    let Some(leader) = scenario.reference.as_ref().and_then(|guidance| guidance.known_by.leader()) else { return };
    let place_m = row(&scenario.start.positions_m, leader) - scenario.reference_at(0.0).position_m;
    for leg in &mut scenario.legs {
        let slots_m = &mut leg.formation.slots_m;
        let move_m = place_m - row(slots_m, leader);
        // What is not finite is told of whom it is.
        if move_m != Vector3::zeros() && move_m.iter().all(|x| x.is_finite()) {
            (0..slots_m.nrows()).for_each(|i| {
                let slot_m = row(slots_m, i) + move_m;
                set_row(slots_m, i, slot_m);
            });
            // Not a rounding beside it.
            set_row(slots_m, leader, place_m);
        }
    }
}

/// Number of slots of a shape that has its own.
pub(super) fn listed_slots(shape: &FormationShape) -> Option<usize> {
    match shape {
        FormationShape::Points { points_m } => Some(points_m.len()),
        FormationShape::Pentagon { .. } => Some(PENTAGON_COUNT),
        _ => None,
    }
}

/// Refuses a leg whose list of slots is not as long as there are vehicles.
pub(super) fn check_slots(legs: &[LegTable], count: usize) -> Result<(), ScenarioError> {
    let listed = legs.iter().map(|leg| leg.shape.as_ref().and_then(listed_slots));
    for (number, slots) in listed.enumerate() {
        if let Some(slots) = slots.filter(|&slots| slots != count) {
            return Err(ScenarioError::new(format!("leg {} has {slots} slots for {count} vehicles", number + 2))
                .coded("scenario/count-mismatch")
                .with_help("every leg needs a slot for each vehicle")
                .at_leg(number + 1, "formation.points_m")
                .at("swarm.count"));
        }
    }
    Ok(())
}
