//! A step of a law and a look at the formation take no memory.

use stats_alloc::Region;
use tautline::formation::{Formation, best_rigid_motion, largest_edge_error_m, procrustes_rms_m};
use tautline::graph::Graph;
use tautline::law::{
    DisplacementKeys, DisplacementLaw, EdgeTensionLaw, EdgeTensionParameters, LaplacianLaw, Law, Setting,
};
use tautline::observation::Observation;
use tautline::swarm::{Rows, Swarm};

use crate::ALLOCATOR;

pub(crate) fn control_energy_and_errors_of_the_shape_allocate_nothing() {
    let parameters = EdgeTensionParameters { alpha: 1.0, delta_m: 0.1, a22_per_s: 0.1 };
    for count in [5, 40, 300] {
        let formation = Formation::sphere(count, 10.0);
        let swarm = Swarm::at_rest(Formation::sphere(count, 12.0).slots_m);
        let mut control = Rows::zeros(count);
        for graph in [Graph::complete(count), Graph::ring(count)] {
            let mut edge_tension = EdgeTensionLaw::new(&graph, &formation, parameters).expect("slots clear of delta");
            let mut laplacian = LaplacianLaw::new(&graph, &formation, 1.0, 1.1).expect("finite gains");
            let setting = Setting::new(&graph, &formation, 0.1, 0.1);
            let mut displacement = DisplacementLaw::new(&setting, DisplacementKeys::default()).expect("a law");
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
    assert!(region.change().allocations > 0, "the counter sees what is allocated");
}
