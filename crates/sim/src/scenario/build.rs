//! Builds a scenario from a document: values per vehicle, points of shapes, defaults that depend on other keys.
//!
//! This module checks only the conditions that the finished scenario no longer shows, and those that bound the memory
//! to allocate; [`super::validate`] checks the rest.

use super::document::{Document, StartShape, StartTable};
use super::document::{PerVehicle, Point, rows};
use super::error::{ErrorKind, ScenarioError};
use super::formation::is_flat;
use super::formation::{check_slots, legs, listed_slots};
use super::graph::{edge_count, graph};
use super::limits::{CONTACT_PREDICTION_M, check_count, check_lengths, check_memory};
use super::reference::ReferenceTable;
use super::spec::{Safety, Scenario, Space};
use super::start;
use super::time::bounded_record_hz;
use super::vehicle::{QUADROTOR_CONTROL_HZ, QUADROTOR_DT_S};
use crate::vehicle::Quadrotor;
use tautline_core::swarm::{Rows, Swarm, set_row};

/// Builds a scenario, which is not validated yet.
pub(super) fn scenario(document: Document) -> Result<Scenario, ScenarioError> {
    let count = count(&document)?;
    check_count(count)?;
    check_memory(count, edge_count(&document.graph.kind, document.law.kind.keeps_edges(), count))?;
    check_lists(&document, count)?;
    let space = space(&document)?;
    let (a22_per_s, of_velocity_per_s) = (document.a22_per_s(), document.velocity_coefficient_per_s());
    let safety = document.safety.shape;
    let delta_m = delta_m(document.law.delta_m, safety)?;
    let law = document.law.kind.complete(of_velocity_per_s);
    let reference = document.reference.map(|table| table.guidance(count, document.time.duration_s)).transpose()?;
    let mut start = start(&document.start, count, space, delta_m)?;
    if let (Some(guidance), None) = (&reference, &document.start.velocities_m_s)
        && let Some(leader) = guidance.known_by.leader()
    {
        set_row(&mut start.velocities_m_s, leader, guidance.motion.at(0.0).velocity_m_s);
    }
    let airframe = document.vehicle.airframe()?;
    let (mass_kg, hull_radius_m) = match airframe.quadrotor() {
        None => (document.swarm.mass_kg.clone(), document.swarm.hull_radius_m.clone()),
        Some(Quadrotor { model, .. }) => (PerVehicle::All(model.mass_kg), PerVehicle::All(model.hull_radius_m)),
    };
    let hull_radius_m = per_vehicle(hull_radius_m, count);
    let clearance_m =
        hull_radius_m.iter().fold(0.5 * delta_m, |most_m, &radius_m| most_m.max(radius_m + CONTACT_PREDICTION_M));
    let obstacles = document.obstacle.iter().enumerate();
    let obstacles = obstacles.map(|(number, table)| table.obstacle(number, clearance_m)).collect::<Result<_, _>>()?;
    let (gives_step, gives_halvings) = (document.given.dt_s, document.given.max_halvings);
    let mut time = document.time;
    if !document.given.record_hz {
        time.record_hz = bounded_record_hz(count, time.duration_s, document.arrival.hold_s);
    }
    if airframe.quadrotor().is_some() {
        time.dt_s = if gives_step { time.dt_s } else { QUADROTOR_DT_S };
        time.control_hz = time.control_hz.or(Some(QUADROTOR_CONTROL_HZ));
    }
    let shield = document.shield.filter(|shield| shield.enabled);
    let chooses_rate = shield.is_some() && time.control_hz.is_none();
    let mut scenario = Scenario {
        start,
        mass_kg: per_vehicle(mass_kg, count),
        hull_radius_m,
        a22_per_s,
        drag_per_s: document.vehicle.drag_per_s,
        wind: document.wind,
        legs: Vec::new(),
        obstacles,
        reference,
        graph: graph(&document.graph.kind, count)?,
        plant: document.plant.kind,
        time,
        sensing: document.sensing,
        network: document.network,
        actuation: document.actuation,
        shield,
        failures: document.failure,
        arrival: document.arrival,
        deadlock: document.deadlock,
        noise_seed: document.noise.seed,
        name: document.name.unwrap_or_default(),
        airframe,
        space,
        law,
        external_law: None,
        delta_m,
        safety,
    };
    legs(&mut scenario, &document.formation, &document.leg)?;
    if chooses_rate {
        scenario.choose_shield_rate();
    }
    if !gives_step {
        scenario.choose_step();
    }
    if !gives_halvings {
        scenario.choose_halvings();
    }
    Ok(scenario)
}

/// Returns the safety distance \[m\]: `law.delta_m`, or else the width of the ellipsoid.
fn delta_m(given_m: Option<f64>, safety: Safety) -> Result<f64, ScenarioError> {
    match (given_m, safety) {
        (Some(delta_m), _) => Ok(delta_m),
        (None, Safety::Ellipsoid { half_axes_m: [a_m, ..] }) => Ok(2.0 * a_m),
        (None, Safety::Ball) => {
            Err(ErrorKind::MissingKey.at(&["law"], "missing key `delta_m`", "give the safety distance"))
        }
    }
}

/// Returns the number of vehicles: `swarm.count`, or else the number of start positions, or else of slots.
fn count(document: &Document) -> Result<usize, ScenarioError> {
    if let Some(count) = document.swarm.count {
        return usize::try_from(count)
            .map_err(|_| ErrorKind::OutOfRange.at(&["swarm.count"], "too many vehicles", "fly fewer vehicles"));
    }
    let listed = document.start.positions_m.as_ref().map(Vec::len);
    listed.or(listed_slots(&document.formation.shape)).ok_or_else(|| {
        let problem = "the number of vehicles is missing";
        let help = "add `count` to [swarm], for example count = 6";
        ErrorKind::MissingKey.at(&["swarm.count"], problem, help)
    })
}

/// Refuses lists whose length is not the number of vehicles.
fn check_lists(document: &Document, count: usize) -> Result<(), ScenarioError> {
    let per_vehicle = |numbers: &PerVehicle| match numbers {
        PerVehicle::All(_) => None,
        PerVehicle::Each(list) => Some(list.len()),
    };
    let Document { swarm, start, formation, .. } = document;
    check_slots(&document.leg, count)?;
    check_lengths(
        count,
        [
            ("start.positions_m", "start positions", start.positions_m.as_ref().map(Vec::len)),
            ("start.velocities_m_s", "start velocities", start.velocities_m_s.as_ref().map(Vec::len)),
            ("formation.points_m", "slots in the formation", listed_slots(&formation.shape)),
            ("swarm.mass_kg", "masses", per_vehicle(&swarm.mass_kg)),
            ("swarm.hull_radius_m", "hull radii", per_vehicle(&swarm.hull_radius_m)),
        ],
    )
}

/// Returns the space of `swarm.dimensions`, or else the plane if every given vector lies in it.
fn space(document: &Document) -> Result<Space, ScenarioError> {
    let flat = |points: &[Point]| points.iter().all(|point| point.coordinates()[2] == 0.0);
    let moved = document.leg.iter().filter_map(|leg| leg.placement.move_m).chain(document.formation.placement.move_m);
    let shapes = document.leg.iter().filter_map(|leg| leg.shape.as_ref()).chain([&document.formation.shape]);
    let reference_is_flat = document.reference.as_ref().is_none_or(ReferenceTable::is_flat);
    let formation_is_flat =
        reference_is_flat && moved.into_iter().all(|point| flat(&[point])) && shapes.into_iter().all(is_flat);
    match document.swarm.dimensions {
        Some(2) => Ok(Space::Plane),
        Some(3) => Ok(Space::Volume),
        Some(other) => Err(ErrorKind::OutOfRange.at(
            &["swarm.dimensions"],
            format!("`dimensions` must be 2 or 3, got {other}"),
            "2 is the plane z = 0, 3 is space",
        )),
        None => {
            let listed = [&document.start.positions_m, &document.start.velocities_m_s];
            let start_is_flat = listed.into_iter().flatten().all(|points| flat(points))
                && !matches!(document.start.shape, Some(StartShape::Sphere(_)));
            Ok(if start_is_flat && formation_is_flat { Space::Plane } else { Space::Volume })
        }
    }
}

/// Returns the positions and velocities at time 0.
fn start(table: &StartTable, count: usize, space: Space, delta_m: f64) -> Result<Swarm, ScenarioError> {
    let mut random = super::start::random(table.seed);
    let mut positions_m = match (&table.positions_m, &table.shape) {
        (Some(points), None) => rows(points),
        (None, Some(shape)) => start::positions(shape, count, space, delta_m, &mut random)?,
        (Some(_), Some(_)) => {
            let problem = "both `positions_m` and a `shape` are given";
            let help = "keep one of them";
            return Err(ErrorKind::ExclusiveKeys.at(&["start.shape", "start.positions_m"], problem, help));
        }
        (None, None) => {
            let problem = "no start positions are given";
            let help = "add positions_m = [[x, y], ...] or a shape, for example shape = \"line\", spacing_m = 3.0";
            return Err(ErrorKind::MissingKey.at(&["start"], problem, help));
        }
    };
    start::jitter(&mut positions_m, table.jitter_m, space, &mut random);
    let velocities_m_s = table.velocities_m_s.as_deref().map_or_else(|| Rows::zeros(count), rows);
    let mut swarm = Swarm { positions_m, velocities_m_s };
    if table.shuffle {
        start::shuffle(&mut swarm, &mut random);
    }
    Ok(swarm)
}

fn per_vehicle(numbers: PerVehicle, count: usize) -> Vec<f64> {
    match numbers {
        PerVehicle::All(number) => vec![number; count],
        PerVehicle::Each(list) => list,
    }
}
