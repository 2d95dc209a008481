//! Time of one evaluation of each law, its energy and its certificate, on one core.
//!
//! Run with `cargo bench --bench law`. The throughput of a control is in directed pairs (twice the edges), so its
//! inverse is the time a directed pair takes.

use std::hint::black_box;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main};
use tautline::formation::Formation;
use tautline::graph::Graph;
use tautline::law::{EdgeTensionLaw, EdgeTensionParameters, LaplacianLaw, Law};
use tautline::observation::Observation;
use tautline::swarm::{Rows, Swarm};

/// Vehicles on a sphere with about two metres to their neighbours, at rest lengths of about one.
fn swarm(count: usize) -> (Formation, Swarm) {
    let radius_m = (count as f64).sqrt();
    let formation = Formation::sphere(count, 0.5 * radius_m);
    let mut swarm = Swarm::at_rest(Formation::sphere(count, radius_m).slots_m);
    swarm.velocities_m_s = &swarm.positions_m * 0.1;
    (formation, swarm)
}

fn edge_tension(graph: &Graph, formation: &Formation) -> EdgeTensionLaw {
    let parameters = EdgeTensionParameters { alpha: 1.0, delta_m: 0.1, a22_per_s: 0.1 };
    EdgeTensionLaw::new(graph, formation, parameters).expect("slots farther apart than delta")
}

fn control(group: &mut BenchmarkGroup<'_, WallTime>, name: &str, at: &Observation<'_>, law: &mut dyn Law) {
    let mut control = Rows::zeros(at.own.count());
    group.throughput(Throughput::Elements(2 * at.links.edge_count() as u64));
    group.bench_function(name, |bencher| bencher.iter(|| law.command(black_box(at), &mut control)));
}

fn laws(criterion: &mut Criterion) {
    for count in [5, 100, 1000] {
        let mut group = criterion.benchmark_group(format!("law/{count}"));
        let (formation, swarm) = swarm(count);
        for (graph_name, graph) in [("complete", Graph::complete(count)), ("ring", Graph::ring(count))] {
            let at = Observation::exact(&swarm, &graph, &formation);
            let mut law = edge_tension(&graph, &formation);
            control(&mut group, &format!("edge-tension {graph_name}"), &at, &mut law);
            let mut law = LaplacianLaw::new(&graph, &formation, 1.0, 1.1).expect("finite gains");
            control(&mut group, &format!("laplacian {graph_name}"), &at, &mut law);
        }
        let complete = Graph::complete(count);
        let (law, at) = (edge_tension(&complete, &formation), Observation::exact(&swarm, &complete, &formation));
        group.throughput(Throughput::Elements((count * (count - 1)) as u64));
        group.bench_function("energy complete", |bencher| bencher.iter(|| law.energy(black_box(&at))));
        group.bench_function("certificate complete", |bencher| bencher.iter(|| law.certificate(black_box(&at))));
        group.finish();
    }
}

criterion_group!(benches, laws);
criterion_main!(benches);
