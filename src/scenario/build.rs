//! From the keys of a scenario file to the scenario: numbers per vehicle, shapes into points, defaults that depend on
//! other keys.
//!
//! What is checked here is what cannot be told from the finished scenario, or must be known before memory is taken for
//! it; [`super::validate`] judges the rest.

use nalgebra::Vector3;

use super::error::ScenarioError;
use super::file::{
    Edge, FormationFile, FormationShape, GraphKind, LawFile, LawKind, PerVehicle, PlantFile, PlantKind, Point,
    PrecisionFile, ScenarioFile, StartFile, StartShape,
};
use super::validate::{check_count, check_memory, pair_count, positive};
use super::{PlantSpec, Precision, Scenario, Space, TimeSpec, start};
use crate::formation::Formation;
use crate::graph::{Graph, GraphError};
use crate::law::{EdgeTensionKeys, LaplacianKeys, LawSpec};
use crate::swarm::{Rows, Swarm, set_row};
use crate::target::{Arrival, Leg};

/// Slots of the pentagon.
const PENTAGON_COUNT: usize = 5;

/// Completes a scenario. It still has to be validated.
pub(super) fn scenario(file: ScenarioFile) -> Result<Scenario, ScenarioError> {
    let count = count(&file)?;
    check_count(count)?;
    check_memory(count, edge_count(&file.graph.kind, count))?;
    check_counts(&file, count)?;
    let space = space(&file)?;
    let (delta_m, law) = law(&file.law, file.swarm.a22_per_s);
    Ok(Scenario {
        start: start(&file.start, count, space, delta_m)?,
        mass_kg: per_vehicle(file.swarm.mass_kg, count),
        hull_radius_m: per_vehicle(file.swarm.hull_radius_m, count),
        a22_per_s: file.swarm.a22_per_s,
        legs: vec![Leg::first(formation(&file.formation, count)?)],
        graph: graph(&file.graph.kind, count)?,
        plant: plant(&file.plant),
        time: TimeSpec {
            duration_s: file.time.duration_s,
            dt_s: file.time.dt_s,
            record_hz: file.time.record_hz,
            max_halvings: file.time.max_halvings,
        },
        arrival: Arrival {
            edge_error_m: file.judge.edge_error_m,
            disagreement_m_s: file.judge.disagreement_m_s,
            hold_s: file.judge.hold_s,
        },
        name: file.name,
        space,
        law,
        delta_m,
    })
}

/// Number of vehicles: as given, or else as many as there are points, start before formation.
fn count(file: &ScenarioFile) -> Result<usize, ScenarioError> {
    if let Some(count) = file.swarm.count {
        return usize::try_from(count).map_err(|_| ScenarioError::new("too many vehicles").at("swarm.count"));
    }
    let listed = file.start.positions_m.as_ref().map(Vec::len);
    let slots = match &file.formation.shape {
        FormationShape::Points { points_m } => Some(points_m.len()),
        FormationShape::Pentagon { .. } => Some(PENTAGON_COUNT),
        _ => None,
    };
    listed.or(slots).ok_or_else(|| {
        ScenarioError::new("the number of vehicles is not given")
            .with_help("add `count` to [swarm], for example count = 6")
            .at("swarm.count")
    })
}

/// Refuses lists that are not as long as there are vehicles.
fn check_counts(file: &ScenarioFile, count: usize) -> Result<(), ScenarioError> {
    let per_vehicle = |numbers: &PerVehicle| match numbers {
        PerVehicle::All(_) => None,
        PerVehicle::Each(list) => Some(list.len()),
    };
    let slots = match &file.formation.shape {
        FormationShape::Points { points_m } => Some(points_m.len()),
        FormationShape::Pentagon { .. } => Some(PENTAGON_COUNT),
        _ => None,
    };
    let lists = [
        ("start.positions_m", "start positions", file.start.positions_m.as_ref().map(Vec::len)),
        ("start.velocities_m_s", "start velocities", file.start.velocities_m_s.as_ref().map(Vec::len)),
        ("formation.points_m", "slots in the formation", slots),
        ("swarm.mass_kg", "masses", per_vehicle(&file.swarm.mass_kg)),
        ("swarm.hull_radius_m", "hull radii", per_vehicle(&file.swarm.hull_radius_m)),
    ];
    for (key, what, listed) in lists {
        if let Some(listed) = listed.filter(|&listed| listed != count) {
            let vehicles = if count == 1 { "vehicle" } else { "vehicles" };
            return Err(ScenarioError::new(format!("{listed} {what} for {count} {vehicles}"))
                .with_help("the number of vehicles is swarm.count if given, or else the number of start positions")
                .at(key)
                .at("swarm.count"));
        }
    }
    Ok(())
}

/// The space asked for, or else the plane if everything lies in it.
fn space(file: &ScenarioFile) -> Result<Space, ScenarioError> {
    let flat = |points: &[Point]| points.iter().all(|point| point.0[2] == 0.0);
    let formation_is_flat = match &file.formation.shape {
        FormationShape::Points { points_m } => flat(points_m),
        FormationShape::Sphere { .. } => false,
        _ => true,
    };
    match file.swarm.dimensions {
        Some(2) => Ok(Space::Plane),
        Some(3) => Ok(Space::Volume),
        Some(other) => Err(ScenarioError::new(format!("a swarm of {other} dimensions"))
            .with_help("2 is the plane z = 0, 3 is space")
            .at("swarm.dimensions")),
        None => {
            let listed = [&file.start.positions_m, &file.start.velocities_m_s];
            let start_is_flat = listed.into_iter().flatten().all(|points| flat(points))
                && !matches!(file.start.shape, Some(StartShape::Sphere { .. }));
            Ok(if start_is_flat && formation_is_flat { Space::Plane } else { Space::Volume })
        }
    }
}

/// Positions and velocities at time 0.
fn start(file: &StartFile, count: usize, space: Space, delta_m: f64) -> Result<Swarm, ScenarioError> {
    let mut random = start::random(file.seed);
    let mut positions_m = match (&file.positions_m, &file.shape) {
        (Some(points), None) => rows(points),
        (None, Some(shape)) => start::positions(shape, count, space, delta_m, &mut random)?,
        (Some(_), Some(_)) => {
            return Err(ScenarioError::new("both `positions_m` and a `shape` are given")
                .with_help("keep one of them")
                .at("start.shape")
                .at("start.positions_m"));
        }
        (None, None) => {
            return Err(ScenarioError::new("no start positions are given")
                .with_help("add positions_m = [[x, y], ...] or a shape, for example shape = \"line\", spacing_m = 3.0")
                .at("start"));
        }
    };
    start::jitter(&mut positions_m, file.jitter_m, space, &mut random)?;
    let velocities_m_s = file.velocities_m_s.as_deref().map_or_else(|| Rows::zeros(count), rows);
    Ok(Swarm { positions_m, velocities_m_s })
}

fn formation(file: &FormationFile, count: usize) -> Result<Formation, ScenarioError> {
    let radius = |radius_m| positive("formation.radius_m", "the radius", radius_m);
    let spacing = |spacing_m| positive("formation.spacing_m", "the spacing", spacing_m);
    Ok(match &file.shape {
        &FormationShape::Pentagon { side_m } => Formation::pentagon(positive("formation.side_m", "the side", side_m)?),
        &FormationShape::Circle { radius_m } => Formation::circle(count, radius(radius_m)?),
        &FormationShape::Line { spacing_m } => Formation::line(count, spacing(spacing_m)?),
        &FormationShape::Grid { spacing_m } => Formation::grid(count, spacing(spacing_m)?),
        &FormationShape::Sphere { radius_m } => Formation::sphere(count, radius(radius_m)?),
        FormationShape::Points { points_m } => Formation::points(rows(points_m)),
    })
}

fn law(file: &LawFile, a22_per_s: f64) -> (f64, LawSpec) {
    let mut law = match file.kind {
        LawKind::EdgeTension { alpha } => LawSpec::EdgeTension(EdgeTensionKeys { alpha }),
        LawKind::Laplacian { f1_per_s2, f2_per_s } => LawSpec::Laplacian(LaplacianKeys { f1_per_s2, f2_per_s }),
    };
    law.complete(a22_per_s);
    (file.delta_m, law)
}

fn plant(file: &PlantFile) -> PlantSpec {
    match (file.kind, file.precision) {
        (PlantKind::Rapier, PrecisionFile::Single) => PlantSpec::Rapier(Precision::Single),
        (PlantKind::Rapier, PrecisionFile::Double) => PlantSpec::Rapier(Precision::Double),
        (PlantKind::Ideal, _) => PlantSpec::Ideal,
    }
}

/// Number of edges, at most, without making them.
fn edge_count(kind: &GraphKind, count: usize) -> u128 {
    match kind {
        GraphKind::Complete {} => pair_count(count),
        GraphKind::Star {} | GraphKind::Ring {} | GraphKind::Path {} => count as u128,
        GraphKind::Edges { edges } => edges.len() as u128,
    }
}

fn graph(kind: &GraphKind, count: usize) -> Result<Graph, ScenarioError> {
    match kind {
        GraphKind::Complete {} => Ok(Graph::complete(count)),
        GraphKind::Star {} => Ok(Graph::star(count)),
        GraphKind::Ring {} => Ok(Graph::ring(count)),
        GraphKind::Path {} => Ok(Graph::path(count)),
        GraphKind::Edges { edges } => listed_graph(edges, count),
    }
}

fn listed_graph(edges: &[Edge], count: usize) -> Result<Graph, ScenarioError> {
    let index = |number: u64| usize::try_from(number).unwrap_or(usize::MAX).checked_sub(1);
    let indices = edges.iter().enumerate().map(|(entry, Edge([a, b]))| {
        index(*a).zip(index(*b)).ok_or_else(|| {
            ScenarioError::new(format!("edge {} names vehicle 0", entry + 1))
                .with_help("vehicles are counted from 1")
                .at_entry("graph.edges", entry)
        })
    });
    let indices = indices.collect::<Result<Vec<_>, _>>()?;
    Graph::from_edges(count, &indices).map_err(|error| {
        let (GraphError::SelfLoop { edge, .. }
        | GraphError::OutOfRange { edge, .. }
        | GraphError::Duplicate { edge, .. }) = error;
        ScenarioError::new(error.to_string())
            .with_help("list each pair of different vehicles once, in either order")
            .at_entry("graph.edges", edge)
    })
}

fn per_vehicle(numbers: PerVehicle, count: usize) -> Vec<f64> {
    match numbers {
        PerVehicle::All(number) => vec![number; count],
        PerVehicle::Each(list) => list,
    }
}

fn rows(points: &[Point]) -> Rows {
    let mut rows = Rows::zeros(points.len());
    for (i, &Point([x, y, z])) in points.iter().enumerate() {
        set_row(&mut rows, i, Vector3::new(x, y, z));
    }
    rows
}
