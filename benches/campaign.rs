//! Time of a campaign on one and two threads, and of a plain loop of the same flights: their ratio is the overhead.

use std::hint::black_box;
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use tautline::campaign::{Campaign, Program, Spec};
use tautline::request::Silent;
use tautline::run::run;
use tautline::studies::Batch;

const SPEC: &str = "scenario = \"pentagon\"\nruns = 16\n[vary]\n\"start.jitter_m\" = { uniform = [0.0, 0.3] }\n";

fn campaigns(criterion: &mut Criterion) {
    let spec = Spec::read("bench", SPEC).expect("a specification");
    let campaign =
        Campaign::plan(&spec, "bench", Path::new("."), None, Program::running().expect("read"), None).expect("a plan");
    let law = campaign.laws()[0].clone();
    let scenarios: Vec<_> = (0..16).map(|run| campaign.scenario(run, &law).expect("a scenario")).collect();
    let mut group = criterion.benchmark_group("sixteen flights of the pentagon");
    group.sample_size(10);
    group.bench_function("a bare loop", |bencher| {
        bencher
            .iter(|| scenarios.iter().map(|scenario| run(scenario, &mut ()).expect("it flies").run.steps).sum::<u64>());
    });
    for threads in [1, 2] {
        group.bench_function(format!("a campaign on {threads} threads"), |bencher| {
            let monitor = Silent::default();
            let batch = Batch::new(Some(threads), &monitor).expect("threads");
            bencher.iter(|| black_box(campaign.fly(&batch).expect("it flies")));
        });
    }
    group.finish();
}

criterion_group!(benches, campaigns);
criterion_main!(benches);
