//! Time of draw lists, frames with read-back, and PNG, over the number of vehicles.
//!
//! The best adapter of the machine draws the frames; its name is printed first. Without an adapter only draw lists are
//! measured.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use nalgebra::Vector3;
use tautline::formation::Formation;
use tautline::record::Sample;
use tautline::render::scene::Extent;
use tautline::render::{AdapterChoice, CameraSpec, Renderer, Scene, Timeline, View};
use tautline::scenario::Scenario;
use tautline::swarm::{ClosestApproach, Pair, Rows, Swarm, row, set_row};

const SAMPLES: u32 = 200;

/// Returns a grid of vehicles in a plane that wave for twenty seconds.
fn timeline(count: usize) -> Timeline {
    let formation = Formation::grid(count, 3.0);
    let start = Swarm::at_rest(formation.slots_m.clone());
    let scenario = Scenario::new("wave", start.clone(), formation, 2.0, 20.0);
    let mut timeline = Timeline::of(&scenario);
    let control = Rows::zeros(count);
    for k in 0..SAMPLES {
        let time_s = f64::from(k) * 0.1;
        let mut swarm = start.clone();
        for vehicle in 0..count {
            let place = row(&start.positions_m, vehicle);
            let wave = (0.1 * place.x + time_s).sin();
            set_row(&mut swarm.positions_m, vehicle, place + Vector3::new(0.2 * wave, 0.0, 1.0 + wave));
        }
        let separation = Some(ClosestApproach { pair: Pair::new(0, 1), separation_m: 2.8, time_s });
        timeline.take(&Sample { separation, ..Sample::new(time_s, u64::from(k), &swarm, &control) });
    }
    timeline
}

fn benchmarks(criterion: &mut Criterion) {
    let mut renderer = Renderer::open(&AdapterChoice::Best).map_err(|error| println!("no frames: {error}")).ok();
    if let Some(renderer) = &renderer {
        println!("drawn by {}", renderer.adapter());
    }
    let view = View::default();
    for count in [10, 200, 1_000, 10_000] {
        let timeline = timeline(count);
        let extent = Extent::of(&timeline);
        let frame = timeline.log.at(15.0).expect("a frame");
        let list_of = |view: &View| {
            let camera = extent.camera(&timeline, &frame, view).expect("a camera");
            Scene::compose(&timeline, &extent, &frame, view, camera)
        };
        let list = || list_of(&view);
        let near = View { camera: CameraSpec::Closest, ..View::default() };
        criterion.bench_with_input(BenchmarkId::new("frame", count), &timeline, |bencher, timeline| {
            bencher.iter(|| timeline.log.at(black_box(15.03)));
        });
        criterion.bench_function(&format!("draw list/{count}"), |bencher| {
            bencher.iter(|| black_box(list()));
        });
        let Some(renderer) = &mut renderer else { continue };
        let scene = list();
        let picture = renderer.paint(&scene).expect("a picture");
        let mut group = criterion.benchmark_group("frame 1280x720");
        group.sample_size(10);
        group.bench_function(BenchmarkId::new("with read-back", count), |bencher| {
            bencher.iter(|| renderer.paint(&scene).expect("a picture"));
        });
        let close_up = list_of(&near);
        group.bench_function(BenchmarkId::new("with read-back, close up", count), |bencher| {
            bencher.iter(|| renderer.paint(&close_up).expect("a picture"));
        });
        group.bench_function(BenchmarkId::new("PNG", count), |bencher| bencher.iter(|| picture.to_png()));
        group.finish();
    }
}

criterion_group!(benches, benchmarks);
criterion_main!(benches);
