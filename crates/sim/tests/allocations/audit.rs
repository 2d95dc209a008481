//! The step of the audit takes no memory once its lists have grown to the swarm.

use nalgebra::Vector3;
use stats_alloc::Region;
use tautline_audit::recorded::{Settings, audit};
use tautline_audit::{Auditor, Status};
use tautline_core::swarm::Rows;
use tautline_core::track::{Item, Sample};

use crate::ALLOCATOR;

const DELTA_M: f64 = 2.0;
const SPACING_M: f64 = 5.0;
/// Wide enough that many near-pair lists are made while counting: each lasts some 30 steps.
const STEPS: u32 = 400;

/// A square lattice, sheared to and fro: the lattice at phase 0 is that at every whole phase.
fn lattice(n: usize, phase: f64) -> Rows {
    let side = n.isqrt();
    let shear = (std::f64::consts::TAU * phase).sin();
    Rows::from_fn(n, |i, axis| {
        let (column, line) = ((i % side) as f64, (i / side) as f64);
        SPACING_M * if axis == 0 { column + 0.3 * shear * line } else { [0.0, line, 0.0][axis] }
    })
}

pub(crate) fn a_step_of_a_warm_auditor_allocates_nothing() {
    for n in [5, 100, 900] {
        let flight: Vec<Rows> = (0..=STEPS).map(|k| lattice(n, f64::from(k) / f64::from(STEPS))).collect();
        let mut auditor = Auditor::new(n, DELTA_M).unwrap();
        auditor.start(0.0, &flight[0]).unwrap();
        let mut fly = |lap: u32| {
            for (k, positions) in (1..).zip(&flight[1..]) {
                auditor.step(f64::from(lap * STEPS + k), positions).unwrap();
            }
        };
        fly(0);
        let region = Region::new(ALLOCATOR);
        fly(1);
        assert_eq!(region.change().allocations + region.change().reallocations, 0, "{n} vehicles");
    }
}

/// A grid that drifts, each vehicle a little its own way, seen three times.
fn recorded(side: usize) -> (Vec<String>, Vec<Item>) {
    let count = side * side;
    let items = (0..3).flat_map(|k| {
        (0..count).map(move |vehicle| {
            let (column, line) = ((vehicle % side) as f64, (vehicle / side) as f64);
            let own = 0.3 * (vehicle as f64).sin();
            let time_s = f64::from(k);
            let position_m = Vector3::new(SPACING_M * column + own + 0.1 * time_s, SPACING_M * line - own, 0.0);
            Item::Sample(Sample { vehicle, time_s, position_m, velocity_m_s: None, radius_m: None })
        })
    });
    ((1..=count).map(|number| number.to_string()).collect(), items.collect())
}

pub(crate) fn a_recording_is_judged_in_memory_for_its_vehicles_and_not_for_their_pairs() {
    /// A vehicle with its name, segments, extents, and four times over what lists leave behind as they grow.
    const MOST_BYTES_EACH: usize = 4000;
    for side in [20, 80] {
        let (names, items) = recorded(side);
        let region = Region::new(ALLOCATOR);
        let outcome = audit(&names, &items, Settings::delta(DELTA_M)).unwrap();
        let bytes = region.change().bytes_allocated + region.change().bytes_reallocated.unsigned_abs();
        assert_eq!(outcome.status, Status::Clear);
        let each = bytes / names.len();
        println!("a recording of {} vehicles is judged in {each} bytes each", names.len());
        assert!(each < MOST_BYTES_EACH, "{each} bytes for each of {} vehicles", names.len());
    }
}
