//! The step of the audit takes no memory once its lists have grown to the swarm.

use stats_alloc::Region;
use tautline::audit::Auditor;
use tautline::swarm::Rows;

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
