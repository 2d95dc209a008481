//! What obstacles must be for a swarm to be flown among them.

use nalgebra::Vector3;

use super::error::ScenarioError;
use super::limits::{CONTACT_PREDICTION_M, SLOT_MARGIN, SMALLEST};
use super::spec::Scenario;
use tautline_core::swarm::{Rows, row, set_row};
use tautline_laws::space::{Obstacle, Shape, least_room};

impl Scenario {
    /// Solids with a size, a place and a clearance that holds a vehicle's hull; no start within a clearance, and no slot where
    /// slots are places that stay.
    pub(super) fn check_obstacles(&self) -> Result<(), ScenarioError> {
        for (number, obstacle) in self.obstacles.iter().enumerate() {
            check_solid(obstacle).map_err(|error| error.at_entry("obstacle", number))?;
            if self.obstacles[..number].iter().any(|before| before.name == obstacle.name) {
                return Err(ScenarioError::new(format!("two obstacles are named `{}`", obstacle.name))
                    .coded("scenario/name")
                    .with_help("give each a name of its own")
                    .at_entry("obstacle", number));
            }
            self.check_hulls_beside(number, obstacle)?;
        }
        if let Some((_, vehicle, number)) = self.too_near(&self.start.positions_m, 0.0) {
            return Err(self
                .refuse(row(&self.start.positions_m, vehicle), number, format_args!("vehicle {} starts", vehicle + 1))
                .at_entry("start.positions_m", vehicle)
                .at_entry("obstacle", number));
        }
        self.check_slots_beside_obstacles()
    }

    fn check_slots_beside_obstacles(&self) -> Result<(), ScenarioError> {
        let Some(guidance) = self.reference.as_ref().filter(|guidance| guidance.motion.is_at_rest()) else {
            return Ok(());
        };
        let place_m = guidance.motion.at(0.0).position_m;
        for (leg, of_leg) in self.legs.iter().enumerate() {
            let mut slots_m = of_leg.formation.slots_m.clone();
            (0..slots_m.nrows()).for_each(|i| {
                let slot_m = row(&slots_m, i) + place_m;
                set_row(&mut slots_m, i, slot_m);
            });
            if let Some((_, vehicle, number)) = self.too_near(&slots_m, SLOT_MARGIN * self.delta_m) {
                let of = if leg == 0 { String::new() } else { format!(" of leg {}", leg + 1) };
                return Err(self
                    .refuse(row(&slots_m, vehicle), number, format_args!("the slot of vehicle {}{of} is", vehicle + 1))
                    .at_leg_entry(leg, "formation.points_m", vehicle)
                    .at_entry("obstacle", number));
            }
        }
        Ok(())
    }

    /// Who of these has the least room, and which obstacle leaves no more of it than that \[m\].
    fn too_near(&self, positions_m: &Rows, margin_m: f64) -> Option<(f64, usize, usize)> {
        least_room(&self.obstacles, positions_m).filter(|&(room_m, ..)| room_m <= margin_m)
    }

    fn refuse(&self, point_m: Vector3<f64>, number: usize, who: std::fmt::Arguments<'_>) -> ScenarioError {
        let Obstacle { name, clearance_m, shape, place_m } = &self.obstacles[number];
        let (distance_m, _) = shape.signed_distance_m(point_m - place_m);
        let said = if distance_m <= 0.0 {
            format!("{who} inside obstacle `{name}`")
        } else {
            format!("{who} {distance_m} m from obstacle `{name}`, not more than its clearance of {clearance_m} m")
        };
        ScenarioError::new(said)
            .coded("scenario/near-obstacle")
            .with_help("move one of them away, or reduce the clearance_m of the obstacle")
    }

    fn check_hulls_beside(&self, number: usize, obstacle: &Obstacle) -> Result<(), ScenarioError> {
        let widest = self.hull_radius_m.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        let Some((vehicle, &radius_m)) = widest else { return Ok(()) };
        if radius_m + CONTACT_PREDICTION_M <= obstacle.clearance_m {
            return Ok(());
        }
        Err(ScenarioError::new(format!(
            "the hull of vehicle {} touches obstacle `{}` at {radius_m} m, not {CONTACT_PREDICTION_M} m before its \
             clearance of {} m",
            vehicle + 1,
            obstacle.name,
            obstacle.clearance_m
        ))
        .coded("scenario/hulls-touch")
        .with_help("enlarge the clearance_m of the obstacle, or reduce swarm.hull_radius_m")
        .at_entry("obstacle", number)
        .at_entry("swarm.hull_radius_m", vehicle))
    }
}

/// A solid with a name that is no vehicle's, and a normal with a direction.
fn check_solid(obstacle: &Obstacle) -> Result<(), ScenarioError> {
    let Obstacle { name, shape, .. } = obstacle;
    if name.trim().is_empty() {
        return Err(ScenarioError::new("the name of an obstacle is empty")
            .coded("scenario/name")
            .with_help("give it one"));
    }
    if name.trim().parse::<u64>().is_ok() {
        return Err(ScenarioError::new(format!("an obstacle is named `{name}`, as a vehicle is"))
            .coded("scenario/name")
            .with_help("give it a name that is no number"));
    }
    match shape {
        Shape::HalfSpace { normal } if normal.norm() < SMALLEST => {
            Err(ScenarioError::new(format!("the normal of obstacle `{name}` has the length {}", normal.norm()))
                .coded("scenario/out-of-range")
                .with_help("give the direction that points out of the half-space, such as [0, 0, 1]"))
        }
        _ => Ok(()),
    }
}
