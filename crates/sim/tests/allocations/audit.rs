//! A step of the audit allocates no memory once its lists have grown.

use nalgebra::Vector3;
use stats_alloc::Region;
use tautline_audit::recorded::{Settings, audit};
use tautline_audit::{Auditor, Status};
use tautline_core::swarm::Rows;
use tautline_core::track::{Item, Sample};

use crate::ALLOCATOR;

const DELTA_M: f64 = 2.0;
const SPACING_M: f64 = 5.0;
/// Enough steps for many lists of near pairs: each lasts about 30 steps.
const STEPS: u32 = 400;

/// Returns a square lattice, sheared back and forth: the lattice at phase 0 repeats at every integer phase.
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

/// Returns three samples of a drifting grid in which each vehicle has its own velocity.
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

pub(crate) fn the_memory_of_an_audit_is_linear_in_the_vehicles() {
    /// Limit per vehicle: its name, segments, extents, and four times the capacity that growing lists leave unused.
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
