//! Links and slots.

use nalgebra::Vector3;
use serde::Serialize;

use super::{base64_of, singles};
use tautline_core::swarm::{Rows, mean_row, row};
use tautline_laws::formation::Formation;
use tautline_sim::plan::Plan;

/// Most links that are drawn: more hide what they join.
const MOST_LINKS: usize = 2100;

/// Links of the graph, and the slots of the vehicles.
#[derive(Clone, Debug, Default, Serialize)]
pub(super) struct Targets {
    /// Places in the list of vehicles, two 16-bit numbers for a link.
    links: String,
    /// Whether links have an edge tension with its barrier at `delta_m`, and are no springs.
    tension: bool,
    delta_m: f64,
    formations: Vec<Target>,
    /// Length of the axes that carry slots \[m\].
    axis_m: f64,
    /// The first of four points, the middle of the slots and the ends of their axes; null where there are none.
    axes: Option<usize>,
    /// The point at the reference; null where there is none.
    reference: Option<usize>,
}

#[derive(Clone, Debug, Serialize)]
struct Target {
    from_s: f64,
    /// The slot of each vehicle from their middle \[m\], in single precision.
    slots: String,
}

/// Points that are packed beside vehicles.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Guides {
    axis_m: Option<f64>,
    reference: bool,
}

/// What a plan has for the vehicles that are shown, and what of it moves. Slots that take more than `room_bytes` are left out.
pub(super) fn of(plan: Option<&Plan>, shown: &[usize], begin_s: f64, room_bytes: usize) -> (Targets, Guides) {
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

    /// Where they are at a time \[s\] \[m\].
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
