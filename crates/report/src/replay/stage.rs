//! Contents of a replay besides motion: vehicles, obstacles, links and slots, and the box around everything.

use nalgebra::{UnitQuaternion, Vector3};
use serde::Serialize;

use super::{Viewpoint, base64_of, singles};
use crate::flight_log::FlightLog;
use tautline_audit::MovingObstacle;
use tautline_core::obstacle::Shape;
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

/// Rotors of a quadrotor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rotors {
    /// Centres relative to the centre of the body, x ahead and y to the left \[m\].
    pub at_m: [[f64; 2]; 4],
    /// Radius of each rotor \[m\].
    pub radius_m: f64,
}

/// Distance of the rotors from the centre, and their radius, over the radius of the hull, for an unknown model.
const ARM: f64 = 0.66;
const ROTOR: f64 = 0.33;

impl Rotors {
    /// Returns the rotors of a scenario's model, if its vehicles are quadrotors.
    #[must_use]
    pub fn of(scenario: &Scenario) -> Option<Self> {
        let model = &scenario.airframe.quadrotor()?.model;
        Some(Self { at_m: model.rotor_positions_m, radius_m: model.rotor_radius_m })
    }

    /// Creates four rotors within a hull of this radius \[m\].
    #[must_use]
    pub fn within(hull_radius_m: f64) -> Self {
        let out = hull_radius_m * ARM * std::f64::consts::FRAC_1_SQRT_2;
        let at_m = [[1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]].map(|at: [f64; 2]| at.map(|side| side * out));
        Self { at_m, radius_m: hull_radius_m * ROTOR }
    }

    /// Returns the rotors at another scale.
    #[must_use]
    pub fn scaled(&self, scale: f64) -> Self {
        Self { at_m: self.at_m.map(|at| at.map(|side| side * scale)), radius_m: self.radius_m * scale }
    }

    /// Returns the centres of the rotors at a height above the centre of the body \[m\].
    #[must_use]
    pub fn places_m(&self, above_m: f64) -> [Vector3<f64>; 4] {
        self.at_m.map(|[x, y]| Vector3::new(x, y, above_m))
    }

    /// Returns the distance of the outermost rotor from the centre \[m\].
    #[must_use]
    pub fn arm_m(&self) -> f64 {
        self.places_m(0.0).iter().map(Vector3::norm).fold(0.0, f64::max)
    }
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

/// Largest drawn radius of a vehicle with unknown radius \[m\].
const UNKNOWN_RADIUS_M: f64 = 0.1;

impl Stage {
    /// Returns formations and graph, with the changes of the target during the flight.
    pub(super) fn plan_of(&self, log: &FlightLog) -> Option<Plan> {
        let mut plan = self.plan.clone()?;
        log.targets().iter().for_each(|event| plan.note(event));
        Some(plan)
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

/// Smallest half edge of the box \[m\].
const LEAST_M: f64 = 1e-6;

/// A box around a flight with the shells, and with obstacles that are not far larger than the flight.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extent {
    pub(super) low_m: Vector3<f64>,
    pub(super) high_m: Vector3<f64>,
}

impl Extent {
    /// Returns the box of the drawn vehicles.
    pub(super) fn of(stage: &Stage, log: &FlightLog, shown: &[usize]) -> Self {
        let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        let places =
            log.keyframes().iter().flat_map(|at| shown.iter().map(move |&vehicle| row(&at.positions_m, vehicle)));
        for at in places.filter(|at| at.iter().all(|x| x.is_finite())) {
            (low, high) = (low.inf(&at), high.sup(&at));
        }
        if low.x > high.x {
            (low, high) = (Vector3::zeros(), Vector3::zeros());
        }
        let radii = shown.iter().map(|&vehicle| stage.drawn_radius_m(vehicle));
        let around_m = radii.chain(stage.shell_m.into_iter().flatten()).fold(LEAST_M, f64::max);
        (low, high) = (low.add_scalar(-around_m), high.add_scalar(around_m));
        let (size_m, middle) = ((high - low).norm(), 0.5 * (low + high));
        for (least, most) in stage.obstacles.iter().flat_map(boxes) {
            if (least - middle).amax().max((most - middle).amax()) < 2.0 * size_m {
                (low, high) = (low.inf(&least), high.sup(&most));
            }
        }
        Self { low_m: low, high_m: high }
    }

    pub(super) fn middle_m(&self) -> Vector3<f64> {
        0.5 * (self.low_m + self.high_m)
    }

    pub(super) fn half_m(&self) -> Vector3<f64> {
        0.5 * (self.high_m - self.low_m)
    }

    pub(super) fn reach_m(&self) -> f64 {
        self.half_m().norm()
    }
}

/// Returns a box around an obstacle at each point of its path; empty for an unbounded obstacle.
fn boxes(obstacle: &MovingObstacle) -> Vec<(Vector3<f64>, Vector3<f64>)> {
    let (low, high) = match obstacle.shape {
        Shape::Ball { radius_m } => (Vector3::repeat(-radius_m), Vector3::repeat(radius_m)),
        Shape::Box { half_m, .. } => (Vector3::repeat(-half_m.norm()), Vector3::repeat(half_m.norm())),
        Shape::Capsule { from_m, to_m, radius_m } => {
            (from_m.inf(&to_m).add_scalar(-radius_m), from_m.sup(&to_m).add_scalar(radius_m))
        }
        Shape::HalfSpace { .. } => return Vec::new(),
    };
    obstacle.path.iter().map(|(_, at)| (at + low, at + high)).collect()
}

/// Largest number of drawn links. More links would hide each other.
pub const MOST_LINKS: usize = 2100;

/// Numbers up to which parts of a drawing are shown. More would hide the formation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Limits {
    /// Vehicles that all have names. Of more, only important ones have.
    pub named: usize,
    /// Vehicles with trails of the whole flight, and with trails of 5 s. More have trails of 1 s.
    pub trails: [usize; 2],
    /// Vehicles with lines to the ground.
    pub drops: usize,
    /// Vehicles with slots at first.
    pub slots: usize,
    /// Links that are shown at first.
    pub links: usize,
    /// Vehicles with colours of their own. More have one colour.
    pub colours: usize,
}

/// Limits of pictures and replays.
pub const LIMITS: Limits = Limits { named: 24, trails: [24, 99], drops: 300, slots: 60, links: 40, colours: 199 };

/// Links of the graph, and the slots of the vehicles.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Targets {
    /// Indices in the list of vehicles, two 16-bit numbers for a link.
    links: String,
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
