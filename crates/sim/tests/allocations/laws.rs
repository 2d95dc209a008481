//! A step of a law and a check of the formation allocate no memory.

use stats_alloc::Region;
use tautline_core::swarm::{Rows, Swarm};
use tautline_laws::formation::{Formation, best_rigid_motion, largest_edge_error_m, procrustes_rms_m};
use tautline_laws::graph::Graph;
use tautline_laws::law::{
    CbfQpKeys, CbfQpVariant, DisplacementKeys, DisplacementLaw, EdgeTensionKeys, EdgeTensionLaw, LaplacianKeys,
    LaplacianLaw, Law, LawContext, LawSpec,
};
use tautline_laws::observation::Observation;
use tautline_laws::space::CellList;

use crate::ALLOCATOR;

pub(crate) fn control_energy_and_errors_of_the_shape_allocate_nothing() {
    for count in [5, 40, 300] {
        let formation = Formation::sphere(count, 10.0);
        let swarm = Swarm::at_rest(Formation::sphere(count, 12.0).slots_m);
        let mut control = Rows::zeros(count);
        for graph in [Graph::complete(count), Graph::ring(count)] {
            let context = LawContext::new(&graph, &formation, 0.1, 0.1);
            let mut edge_tension = EdgeTensionLaw::new(&context, EdgeTensionKeys::default()).expect("a law");
            let mut laplacian = LaplacianLaw::new(&context, LaplacianKeys::default()).expect("a law");
            let mut displacement = DisplacementLaw::new(&context, DisplacementKeys::default()).expect("a law");
            let laws: [&mut dyn Law; 3] = [&mut edge_tension, &mut laplacian, &mut displacement];
            let at = Observation::exact(&swarm, &graph, &formation);
            let region = Region::new(ALLOCATOR);
            for law in laws {
                for _ in 0..3 {
                    law.command(&at, &mut control).expect("a state clear of delta");
                    std::hint::black_box(law.energy(&at));
                }
            }
            std::hint::black_box(largest_edge_error_m(&swarm.positions_m, &formation, &graph));
            std::hint::black_box(procrustes_rms_m(&swarm.positions_m, &formation));
            std::hint::black_box(best_rigid_motion(&swarm.positions_m, &formation));
            let change = region.change();
            assert_eq!(change.allocations + change.reallocations, 0, "{count} vehicles, {change:?}");
        }
    }
    let region = Region::new(ALLOCATOR);
    std::hint::black_box(Graph::complete(40).laplacian());
    assert!(region.change().allocations > 0, "the counter counts allocations");
}

pub(crate) fn a_law_that_senses_allocates_nothing_once_its_lists_have_grown() {
    let (links, formation) = (Graph::ring(30), Formation::sphere(30, 6.0));
    let crowd = Swarm::at_rest(Formation::sphere(30, 3.0).slots_m);
    let mut control = Rows::zeros(30);
    let braking = LawSpec::CbfQp(CbfQpKeys { variant: CbfQpVariant::Braking, ..CbfQpKeys::default() });
    for spec in LawSpec::all().into_iter().chain([braking]) {
        let context = LawContext::new(&links, &formation, 0.8, 0.1);
        let mut law = spec.complete(0.1).build(&context).expect("a law");
        let mut near = CellList::default();
        near.update(&crowd.positions_m, law.capabilities().sensing_range_m.unwrap_or(0.0));
        let at = Observation { near: near.pairs(), ..Observation::exact(&crowd, &links, &formation) };
        law.command(&at, &mut control).expect("a state clear of delta");
        let region = Region::new(ALLOCATOR);
        law.command(&at, &mut control).expect("a state clear of delta");
        let change = region.change();
        assert_eq!(change.allocations + change.reallocations, 0, "{}: {change:?}", law.name());
    }
}
