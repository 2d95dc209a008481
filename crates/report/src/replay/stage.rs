//! Contents of a replay besides motion: vehicles, obstacles, links and slots.

use nalgebra::{UnitQuaternion, Vector3};
use serde::Serialize;

use super::{base64_of, singles};
use crate::drawing::{MOST_LINKS, Rotors, Surroundings, UNKNOWN_RADIUS_M, Viewpoint, link_look};
use crate::flight_log::FlightLog;
use tautline_audit::MovingObstacle;
use tautline_core::swarm::{Rows, mean_row, row};
use tautline_laws::formation::Formation;
use tautline_sim::plan::Plan;
use tautline_sim::scenario::Scenario;

/// Vehicles, their shells, their formations and the obstacles.
#[derive(Clone, Debug)]
pub struct Stage {
    /// Names of the vehicles.
    pub vehicles: Vec<String>,
    /// Radius of each vehicle \[m\]; `None` if unknown.
    pub radius_m: Vec<Option<f64>>,
    /// Half axes of the shell around each vehicle \[m\], half of the limit of two centres; `None` without such a limit.
    pub shell_m: Option<[f64; 3]>,
    /// Formations and graph, if known.
    pub plan: Option<Plan>,
    /// Rotors of every vehicle, if the vehicles are quadrotors.
    pub rotors: Option<Rotors>,
    /// Obstacles.
    pub obstacles: Vec<MovingObstacle>,
}

/// Smallest radius around a vehicle \[m\].
const LEAST_M: f64 = 1e-6;

/// Returns the largest distance of a vehicle from the mean of all at an instant, along each axis \[m\].
pub(super) fn swarm_m(log: &FlightLog, shown: &[usize]) -> Vector3<f64> {
    let mut swarm_m = Vector3::zeros();
    for keyframe in log.keyframes() {
        let places = shown.iter().map(|&vehicle| row(&keyframe.positions_m, vehicle));
        let places: Vec<_> = places.filter(|at| at.iter().all(|x| x.is_finite())).collect();
        let mean = places.iter().sum::<Vector3<f64>>() / places.len() as f64;
        swarm_m = places.iter().fold(swarm_m, |most, at| most.sup(&(at - mean).abs()));
    }
    swarm_m
}

/// Returns the attitudes of some vehicles as three signed bytes each: the vector part of the quaternion with a positive
/// scalar part, times 127. A vehicle with unknown attitude is upright.
pub(super) fn turn_bytes(attitudes: &[Option<UnitQuaternion<f64>>], shown: &[usize]) -> Vec<u8> {
    #[expect(clippy::cast_possible_truncation, reason = "between -127 and 127")]
    let byte = |part: f64| (127.0 * part).round() as i8;
    let turn = |&vehicle: &usize| {
        let turn = attitudes.get(vehicle).copied().flatten().unwrap_or_default();
        let sign = if turn.w < 0.0 { -1.0 } else { 1.0 };
        [turn.i, turn.j, turn.k].map(|part| byte(sign * part).to_le_bytes()[0])
    };
    shown.iter().flat_map(turn).collect()
}

impl Stage {
    /// Returns formations and graph, with the changes of the target during the flight.
    pub(super) fn plan_of(&self, log: &FlightLog) -> Option<Plan> {
        let mut plan = self.plan.clone()?;
        log.targets().iter().for_each(|event| plan.note(event));
        Some(plan)
    }

    /// Returns the safety distance \[m\], in horizontal lengths.
    pub(super) fn delta_m(&self) -> Option<f64> {
        self.shell_m.map(|[half_m, ..]| 2.0 * half_m)
    }

    /// Returns the drawn radius of a vehicle with unknown radius \[m\]. Two vehicles at their limit do not touch.
    pub(super) fn unknown_radius_m(&self) -> f64 {
        self.shell_m.into_iter().flatten().fold(UNKNOWN_RADIUS_M, f64::min)
    }

    /// Returns the number of these vehicles without a known radius, if there are any, and their drawn radius \[m\].
    pub(super) fn unknown_radii(&self, vehicles: &[usize]) -> Option<(usize, f64)> {
        let unknown =
            vehicles.iter().filter(|&&vehicle| self.radius_m.get(vehicle).copied().flatten().is_none()).count();
        (unknown > 0).then(|| (unknown, self.unknown_radius_m()))
    }

    /// Returns the direction from which the replay shows a flight first. Moving obstacles do not count.
    pub(super) fn viewpoint(&self, log: &FlightLog) -> Viewpoint {
        let at_rest = |of: &MovingObstacle| matches!(*of.path, [(_, at_m)] if at_m.iter().all(|x| x.is_finite()));
        let obstacles = self.obstacles.iter().filter(|of| at_rest(of));
        Viewpoint::of(&[log], &obstacles.map(|of| (of.shape, of.path[0].1)).collect::<Vec<_>>())
    }

    /// Returns the surroundings of the drawn vehicles with their shells.
    pub(super) fn surroundings(&self, log: &FlightLog, shown: &[usize]) -> Surroundings {
        let places =
            log.keyframes().iter().flat_map(|at| shown.iter().map(move |&vehicle| row(&at.positions_m, vehicle)));
        let places = places.filter(|at| at.iter().all(|x| x.is_finite())).map(|at| [at; 2]);
        let flown_m = places.reduce(|[low, high], [at, _]| [low.inf(&at), high.sup(&at)]);
        let radii = shown.iter().map(|&vehicle| self.drawn_radius_m(vehicle));
        let around_m = radii.chain(self.shell_m.into_iter().flatten()).fold(LEAST_M, f64::max);
        let obstacles = self.obstacles.iter().flat_map(|of| of.path.iter().map(|&(_, at_m)| (of.shape, at_m)));
        Surroundings::of(flown_m, around_m, &obstacles.collect::<Vec<_>>())
    }

    pub(super) fn drawn_radius_m(&self, vehicle: usize) -> f64 {
        self.radius_m.get(vehicle).copied().flatten().unwrap_or_else(|| self.unknown_radius_m())
    }

    /// Returns the stage of a scenario. Later changes of the target are in the log.
    #[must_use]
    pub fn of(scenario: &Scenario) -> Self {
        Self {
            vehicles: (1..=scenario.count()).map(|number| number.to_string()).collect(),
            radius_m: scenario.hull_radius_m.iter().copied().map(Some).collect(),
            shell_m: Some(scenario.half_axes_m().unwrap_or([0.5 * scenario.delta_m; 3])),
            plan: Some(Plan::of(scenario)),
            rotors: Rotors::of(scenario),
            obstacles: scenario.obstacles.iter().map(MovingObstacle::from).collect(),
        }
    }
}

/// Links of the graph, and the slots of the vehicles.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Targets {
    /// Indices in the list of vehicles, two 16-bit numbers for a link.
    links: String,
    /// Width of a link \[px\], and its opacity at rest.
    link_look: (f32, f32),
    /// Whether links have an edge tension with its barrier at `delta_m`; otherwise they are springs.
    tension: bool,
    delta_m: f64,
    formations: Vec<Target>,
    /// Length of the axes that carry the slots \[m\].
    axis_m: f64,
    /// First of four points: the middle of the slots and the ends of their axes; null without slots.
    axes: Option<usize>,
    /// Point at the reference; null without a reference.
    reference: Option<usize>,
}

#[derive(Clone, Debug, Serialize)]
struct Target {
    from_s: f64,
    /// Slot of each vehicle relative to their middle \[m\], in single precision.
    slots: String,
}

/// Points that are packed beside the vehicles.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Guides {
    axis_m: Option<f64>,
    reference: bool,
}

/// Returns the links and slots of a plan for the drawn vehicles, and the guides that move. Slots that take more than
/// `room_bytes` are omitted.
pub(super) fn targets_of(plan: Option<&Plan>, shown: &[usize], begin_s: f64, room_bytes: usize) -> (Targets, Guides) {
    let Some(plan) = plan else { return (Targets::default(), Guides::default()) };
    let place = |vehicle: usize| shown.binary_search(&vehicle).ok().and_then(|at| u16::try_from(at).ok());
    let links: Vec<u16> = if plan.graph.edge_count() <= MOST_LINKS {
        let both = |(i, j): (usize, usize)| Some([place(i)?, place(j)?]);
        plan.graph.edges().filter_map(both).flatten().collect()
    } else {
        Vec::new()
    };
    let formations = plan.formations();
    let fits = formations.len() * shown.len() * 16 <= room_bytes;
    let formations: Vec<_> = formations.into_iter().filter(|_| fits).collect();
    let reach = |formation: &Formation| {
        let middle = mean_row(&formation.slots_m);
        (0..formation.count()).map(|k| (row(&formation.slots_m, k) - middle).norm()).fold(0.0, f64::max)
    };
    let axis_m = formations.iter().map(|(_, formation)| reach(formation)).reduce(f64::max);
    // A formation of one slot has axes too.
    let axis_m = axis_m.map(|axis_m| if axis_m > 0.0 { axis_m } else { 1.0 });
    let guides = Guides { axis_m, reference: plan.reference_at(begin_s).is_some() };
    let targets = Targets {
        links: base64_of(links.iter().flat_map(|at| at.to_le_bytes())),
        link_look: link_look(links.len() / 2),
        tension: plan.has_tension(),
        delta_m: plan.delta_m(),
        formations: formations
            .iter()
            .map(|&(from_s, formation)| Target::of(formation, from_s.max(begin_s), shown))
            .collect(),
        axis_m: axis_m.unwrap_or(0.0),
        axes: axis_m.map(|_| shown.len()),
        reference: guides.reference.then(|| guides.count() - 1 + shown.len()),
    };
    (targets, guides)
}

impl Target {
    fn of(formation: &Formation, from_s: f64, shown: &[usize]) -> Self {
        let middle = mean_row(&formation.slots_m);
        let slots = shown.iter().filter(|&&k| k < formation.count()).map(|&k| row(&formation.slots_m, k) - middle);
        Self { from_s, slots: singles(&slots.collect::<Vec<_>>()) }
    }
}

impl Guides {
    pub(super) fn count(self) -> usize {
        4 * usize::from(self.axis_m.is_some()) + usize::from(self.reference)
    }

    /// Returns the positions of the guides at a time \[s\] \[m\].
    pub(super) fn at(self, plan: Option<&Plan>, time_s: f64, positions_m: &Rows) -> Vec<Option<Vector3<f64>>> {
        let laid = plan.and_then(|plan| Some((plan, plan.laid_at(time_s, positions_m)?)));
        let axes = self.axis_m.map(|axis_m| {
            [None, Some(0), Some(1), Some(2)].map(|axis| {
                let (plan, laid) = laid.as_ref()?;
                let middle = mean_row(&plan.formation_at(time_s).slots_m);
                Some(laid.apply(middle + axis.map_or(Vector3::zeros(), |axis| Vector3::ith(axis, axis_m))))
            })
        });
        let reference = self.reference.then(|| plan.and_then(|plan| plan.reference_at(time_s)));
        axes.into_iter().flatten().chain(reference).collect()
    }
}
