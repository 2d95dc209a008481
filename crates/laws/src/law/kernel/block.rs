//! Edges taken through the edge tension side by side, stage by stage.
//!
//! From the positions of two vehicles to the pull between them leads a chain of some forty operations, each of which waits for
//! the one before. A stage is a short part of it for all edges of a block, of which a processor has many in flight.
#![expect(clippy::inline_always, reason = "only what is inlined is compiled for the instructions found at run time")]

use pulp::Simd;

use crate::law::tension::{self, OutOfDomain};

/// Number of partial sums that a long sum is split into, whatever the machine's vectors hold. Edges are taken so many at a time:
/// whoever holds tables of edges or vehicles leaves room for the rest of the lanes behind the last.
pub(super) const LANES: usize = 8;

pub(super) type Lanes = [f64; LANES];

/// A coordinate that no vehicle pulls at: lanes behind the last edge end there.
pub(super) const NOWHERE_M: f64 = f64::MAX;

/// Takes edges from one vehicle to others, at most B at a time, a multiple of the lanes.
pub(super) struct Block<const B: usize> {
    delta_m: f64,
    /// The edges along each axis \[m\]; at the end their pulls.
    edges: [[f64; B]; 3],
    lengths_m: [f64; B],
    /// s; at the end V/alpha.
    scaled: [f64; B],
    /// The exponent of the one exponential that an edge takes; then that exponential less 1.
    decays: [f64; B],
    /// Sum of V/alpha.
    potential: Lanes,
    /// Whether some edge was not longer than delta.
    is_inside: bool,
}

/// The other ends of so many edges. Each slice has whole lanes: behind the last edge any 1/K, [`NOWHERE_M`], which is infinitely
/// far and pulls with a weight of 0, and sums of nobody.
pub(super) struct Ends<'a> {
    pub(super) count: usize,
    pub(super) inverse_k_per_m: &'a [f64],
    pub(super) positions_m: [&'a [f64]; 3],
    pub(super) sums: [&'a mut [f64]; 3],
}

impl<const B: usize> Block<B> {
    #[inline(always)]
    pub(super) fn new(delta_m: f64) -> Self {
        const { assert!(B.is_multiple_of(LANES), "blocks hold whole lanes") };
        let zeros = [0.0; B];
        let potential = [0.0; LANES];
        Self { delta_m, edges: [zeros; 3], lengths_m: zeros, scaled: zeros, decays: zeros, potential, is_inside: false }
    }

    /// Subtracts the pull of each edge from a vehicle at `own` \[m\] from the sums of its other end: `w_ij/alpha` times the edge,
    /// with `w_ij = V'/l`. Returns these pulls, in whole lanes, along each axis.
    #[inline(always)]
    pub(super) fn pull<S: Simd>(&mut self, simd: S, own: [f64; 3], to: Ends<'_>) -> [&[f64]; 3] {
        let lanes = to.inverse_k_per_m.len();
        let Self { delta_m, edges: [x, y, z], lengths_m, scaled, decays, .. } = self;
        let edges = [&mut x[..lanes], &mut y[..lanes], &mut z[..lanes]];
        let (lengths_m, scaled, decays) = (&mut lengths_m[..lanes], &mut scaled[..lanes], &mut decays[..lanes]);

        self.is_inside |= measure(*delta_m, own, to.positions_m, to.inverse_k_per_m, edges, lengths_m, scaled, decays);
        for decay in &mut *decays {
            *decay = tension::expm1(*decay);
        }
        let edges = [&mut x[..lanes], &mut y[..lanes], &mut z[..lanes]];
        weigh(to.count, to.inverse_k_per_m, lengths_m, decays, edges, scaled, to.sums);
        add_lanes(simd, &mut self.potential, scaled);
        [&x[..lanes], &y[..lanes], &z[..lanes]]
    }

    /// (1/alpha) sum of V. It has no finite value where a position has none, or lies too far away to tell how far.
    #[inline(always)]
    pub(super) fn finish(self) -> Result<f64, OutOfDomain> {
        let potential = total(self.potential);
        if !self.is_inside && potential.is_finite() { Ok(potential) } else { Err(OutOfDomain) }
    }
}

/// The edges, their lengths, s and the exponents; and whether some edge is not longer than delta.
#[expect(
    clippy::too_many_arguments,
    reason = "what arguments point at is known to be apart, which vector instructions need"
)]
#[inline(always)]
fn measure(
    delta_m: f64,
    own: [f64; 3],
    others: [&[f64]; 3],
    inverse_k_per_m: &[f64],
    [x, y, z]: [&mut [f64]; 3],
    lengths_m: &mut [f64],
    scaled: &mut [f64],
    exponents: &mut [f64],
) -> bool {
    let lanes = inverse_k_per_m.len();
    let [of_x, of_y, of_z] = [&others[0][..lanes], &others[1][..lanes], &others[2][..lanes]];
    let (x, y, z) = (&mut x[..lanes], &mut y[..lanes], &mut z[..lanes]);
    let (lengths_m, scaled, exponents) = (&mut lengths_m[..lanes], &mut scaled[..lanes], &mut exponents[..lanes]);
    let mut inside = 0;
    for k in 0..lanes {
        (x[k], y[k], z[k]) = (own[0] - of_x[k], own[1] - of_y[k], own[2] - of_z[k]);
        let length_m = (x[k] * x[k] + y[k] * y[k] + z[k] * z[k]).sqrt();
        inside |= u64::from(length_m <= delta_m);
        lengths_m[k] = length_m;
        scaled[k] = (length_m - delta_m) * inverse_k_per_m[k];
        exponents[k] = tension::exponent(scaled[k], scaled[k] - tension::REST);
    }
    inside != 0
}

/// Turns edges into their pulls, which are subtracted from the sums of the other ends, and s into V/alpha.
#[inline(always)]
fn weigh(
    count: usize,
    inverse_k_per_m: &[f64],
    lengths_m: &[f64],
    decays: &[f64],
    [x, y, z]: [&mut [f64]; 3],
    scaled: &mut [f64],
    [of_x, of_y, of_z]: [&mut [f64]; 3],
) {
    let lanes = inverse_k_per_m.len();
    let (lengths_m, decays, scaled) = (&lengths_m[..lanes], &decays[..lanes], &mut scaled[..lanes]);
    let (x, y, z) = (&mut x[..lanes], &mut y[..lanes], &mut z[..lanes]);
    let (of_x, of_y, of_z) = (&mut of_x[..lanes], &mut of_y[..lanes], &mut of_z[..lanes]);
    for k in 0..lanes {
        let h = scaled[k] - tension::REST;
        let (slope_per_m, value) = tension::slope_and_value_over(lengths_m[k], scaled[k], h, decays[k]);
        let weight = inverse_k_per_m[k] * slope_per_m;
        x[k] *= weight;
        y[k] *= weight;
        z[k] *= weight;
        of_x[k] -= x[k];
        of_y[k] -= y[k];
        of_z[k] -= z[k];
        scaled[k] = if k < count { value } else { 0.0 };
    }
}

/// Adds each term to the sum of its lane. There are whole lanes of them.
#[inline(always)]
pub(super) fn add_lanes<S: Simd>(simd: S, sums: &mut Lanes, terms: &[f64]) {
    let (sums, terms) = (S::as_mut_simd_f64s(sums).0, S::as_simd_f64s(terms).0);
    for first in 0..terms.len() / sums.len() {
        for k in 0..sums.len() {
            sums[k] = simd.add_f64s(sums[k], terms[first * sums.len() + k]);
        }
    }
}

#[inline(always)]
pub(super) fn total(lanes: Lanes) -> f64 {
    ((lanes[0] + lanes[4]) + (lanes[2] + lanes[6])) + ((lanes[1] + lanes[5]) + (lanes[3] + lanes[7]))
}
