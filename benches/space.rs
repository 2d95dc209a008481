//! Time of a search for the pairs within a range, and of a sweep of all pairs for comparison.
//!
//! Run with `cargo bench --bench space`; compare times of one run only.

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use tautline::space::CellList;
use tautline::swarm::{Rows, separation};

/// Range \[m\]; evenly spread points are about 1 m apart.
const RANGE_M: f64 = 1.3;

/// Returns points in a square or cube, with one point per square or cubic metre.
fn spread(count: u32, axes: i32) -> Rows {
    let side_m = f64::from(count).powf(1.0 / f64::from(axes));
    let place = |k: u32| {
        let [x, y, z] =
            [0.754_877_666, 0.569_840_290, 0.819_172_513].map(|step| side_m * (step * f64::from(k)).fract());
        [x, y, if axes == 3 { z } else { 0.0 }]
    };
    Rows::from_row_slice(&(0..count).flat_map(place).collect::<Vec<_>>())
}

fn full_sweep(positions_m: &Rows, found: &mut Vec<(usize, usize)>) {
    found.clear();
    for i in 0..positions_m.nrows() {
        found
            .extend((i + 1..positions_m.nrows()).filter(|&j| separation(positions_m, i, j) <= RANGE_M).map(|j| (i, j)));
    }
}

fn near_pairs(criterion: &mut Criterion) {
    for count in [100, 1000, 10_000] {
        let mut group = criterion.benchmark_group(format!("near-pairs/{count}"));
        group.sample_size(10);
        for (name, axes) in [("plane", 2), ("volume", 3)] {
            let positions_m = spread(count, axes);
            let (mut near, mut found) = (CellList::default(), Vec::new());
            group.bench_function(format!("cells {name}"), |bencher| {
                bencher.iter(|| near.update(black_box(&positions_m), RANGE_M));
            });
            group.bench_function(format!("full sweep {name}"), |bencher| {
                bencher.iter(|| full_sweep(black_box(&positions_m), &mut found));
            });
            assert_eq!(near.pairs(), found);
        }
        group.finish();
    }
}

criterion_group!(benches, near_pairs);
criterion_main!(benches);
