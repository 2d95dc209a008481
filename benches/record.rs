//! Cost of one recorded sample: writing to `run.mcap`, hashing, and reading back.

use std::hint::black_box;
use std::path::Path;

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use tautline::mcap::{Header, McapRecorder, McapRecording};
use tautline::record::{Sample, Sink, StateHash};
use tautline::swarm::{ClosestApproach, Pair, Rows, Swarm};

const RECORD_HZ: f64 = 60.0;
/// Number of samples per measured file: five seconds of flight, so that chunks are closed by time and by size.
const SAMPLES: u32 = 300;

struct State {
    swarm: Swarm,
    control: Rows,
}

impl State {
    fn new(vehicles: usize) -> Self {
        let rows = |seed: usize| Rows::from_fn(vehicles, |i, axis| ((3 * i + axis + seed) as f64).sin());
        Self { swarm: Swarm { positions_m: rows(1), velocities_m_s: rows(2) }, control: rows(3) }
    }

    fn sample(&self, k: u32) -> Sample<'_> {
        let time_s = f64::from(k) / RECORD_HZ;
        let separation = Some(ClosestApproach { pair: Pair::new(0, 1), separation_m: 2.5, time_s });
        let (swarm, control) = (&self.swarm, &self.control);
        Sample { separation, energy: Some(1.0), ..Sample::new(time_s, u64::from(4 * k), swarm, control) }
    }

    fn write(&self, path: &Path) {
        let header = Header::new("bench", "name = \"bench\"\n", self.swarm.count(), 2.0);
        let mut recorder = McapRecorder::create(path, &header).expect("creates");
        for k in 0..SAMPLES {
            recorder.sample(&self.sample(k)).expect("records");
        }
        recorder.finish().expect("finishes");
    }
}

fn record(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("run.mcap");
    let mut group = criterion.benchmark_group("record");
    group.sample_size(20).throughput(Throughput::Elements(u64::from(SAMPLES)));
    for vehicles in [5, 100, 1000] {
        let state = State::new(vehicles);
        group.bench_function(BenchmarkId::new("mcap-write", vehicles), |bencher| {
            bencher.iter(|| state.write(&path));
        });
        state.write(&path);
        let bytes = std::fs::metadata(&path).expect("exists").len();
        let each = bytes as f64 / f64::from(SAMPLES) / vehicles as f64;
        println!("run.mcap of {vehicles} vehicles: {each:.2} bytes per vehicle and sample");
        group.bench_function(BenchmarkId::new("mcap-read", vehicles), |bencher| {
            bencher.iter(|| McapRecording::open(&path).expect("opens").read_all().expect("reads"));
        });
        group.bench_function(BenchmarkId::new("state-hash", vehicles), |bencher| {
            let hash_all = |mut hash: StateHash| {
                (0..SAMPLES).for_each(|k| hash.observe(&state.sample(k)));
                hash.finish()
            };
            bencher.iter_batched(StateHash::new, |hash| black_box(hash_all(hash)), BatchSize::SmallInput);
        });
    }
    group.finish();
}

criterion_group!(benches, record);
criterion_main!(benches);
