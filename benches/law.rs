//! Time of one evaluation of each law, of its energy and of its certificate, on one core unless threads are named.
//!
//! Run with `cargo bench --bench law`. The throughput of a command is in directed pairs (twice the edges). That of the
//! displacement law is in vehicles. Its time includes the search for near pairs, as in a flight:
//! `cargo bench --bench law -- displacement`.

use std::hint::black_box;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, Throughput, criterion_group, criterion_main};
use tautline::formation::Formation;
use tautline::graph::Graph;
use tautline::law::{
    DisplacementKeys, DisplacementLaw, EdgeTensionKeys, EdgeTensionLaw, LaplacianKeys, LaplacianLaw, Law, LawContext,
};
use tautline::observation::Observation;
use tautline::space::VerletList;
use tautline::swarm::{Rows, Swarm};

/// Returns vehicles on a sphere about 2 m apart, and a formation in which they are about 1 m apart.
fn swarm(count: usize) -> (Formation, Swarm) {
    let radius_m = (count as f64).sqrt();
    let formation = Formation::sphere(count, 0.5 * radius_m);
    let mut swarm = Swarm::at_rest(Formation::sphere(count, radius_m).slots_m);
    swarm.velocities_m_s = &swarm.positions_m * 0.1;
    (formation, swarm)
}

fn edge_tension(graph: &Graph, formation: &Formation) -> EdgeTensionLaw {
    let context = LawContext::new(graph, formation, 0.1, 0.1);
    EdgeTensionLaw::new(&context, EdgeTensionKeys::default()).expect("slots farther apart than delta")
}

fn control(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    at: &Observation<'_>,
    law: &mut dyn Law,
    threads: usize,
) {
    let mut control = Rows::zeros(at.own.count());
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
    group.throughput(Throughput::Elements(2 * at.links.edge_count() as u64));
    group.bench_function(name, |bencher| {
        bencher.iter_custom(|times| {
            pool.install(|| {
                let began = std::time::Instant::now();
                (0..times).for_each(|_| law.command(black_box(at), &mut control).expect("a state clear of delta"));
                began.elapsed()
            })
        });
    });
}

fn laws(criterion: &mut Criterion) {
    for count in [5, 100, 1000] {
        let mut group = criterion.benchmark_group(format!("law/{count}"));
        let (formation, swarm) = swarm(count);
        for (graph_name, graph) in [("complete", Graph::complete(count)), ("ring", Graph::ring(count))] {
            let at = Observation::exact(&swarm, &graph, &formation);
            let mut law = edge_tension(&graph, &formation);
            control(&mut group, &format!("edge-tension {graph_name}"), &at, &mut law, 1);
            if count == 1000 && graph.is_complete() {
                control(&mut group, "edge-tension complete, 2 threads", &at, &mut law, 2);
            }
            let context = LawContext::new(&graph, &formation, 0.1, 0.1);
            let mut law = LaplacianLaw::new(&context, LaplacianKeys::default()).expect("finite gains");
            control(&mut group, &format!("laplacian {graph_name}"), &at, &mut law, 1);
        }
        let complete = Graph::complete(count);
        let (law, at) = (edge_tension(&complete, &formation), Observation::exact(&swarm, &complete, &formation));
        group.throughput(Throughput::Elements((count * (count - 1)) as u64));
        group.bench_function("energy complete", |bencher| bencher.iter(|| law.energy(black_box(&at))));
        group.bench_function("certificate complete", |bencher| bencher.iter(|| law.certificate(black_box(&at), &[])));
        group.finish();
    }
}

/// Measures the displacement law on a grid of 2 m that contracts to 1.6 m.
///
/// Vehicles have offsets of at most a third of a metre, as if at random. For any number of vehicles 5.5 % to 7 % of the
/// neighbours are near enough to repel each other.
fn displacement(criterion: &mut Criterion) {
    const DELTA_M: f64 = 1.0;
    for count in [1000, 10_000, 100_000] {
        let mut group = criterion.benchmark_group(format!("displacement/{count}"));
        group.sample_size(10).throughput(Throughput::Elements(count as u64));
        let (formation, grid) = (Formation::grid(count, 1.6), Formation::grid(count, 2.0).slots_m);
        let moved = |i: usize, axis: usize| [0.2, 0.25, 0.0][axis] * ((i * i + axis) as f64).sin();
        let mut swarm = Swarm::at_rest(Rows::from_fn(count, |i, axis| grid[(i, axis)] + moved(i, axis)));
        swarm.velocities_m_s = &swarm.positions_m * 0.01;
        for (name, graph) in [("star", Graph::star(count)), ("complete", Graph::complete(count))] {
            let context = LawContext::new(&graph, &formation, DELTA_M, 0.1);
            let mut law = DisplacementLaw::new(&context, DisplacementKeys::default()).expect("a law");
            let range_m = law.capabilities().sensing_range_m.expect("it senses");
            let (mut near, mut control) = (VerletList::default(), Rows::zeros(count));
            group.bench_function(name, |bencher| {
                bencher.iter(|| {
                    near.update(black_box(&swarm.positions_m), range_m);
                    let exact = Observation::exact(black_box(&swarm), &graph, &formation);
                    law.command(&Observation { near: near.pairs(), ..exact }, &mut control)
                });
            });
        }
        group.finish();
    }
}

criterion_group!(benches, laws, displacement);
criterion_main!(benches);
