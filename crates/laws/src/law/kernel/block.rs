//! Evaluation of the edge tension for a block of edges, stage by stage.
//!
//! The pull between two vehicles takes a chain of some forty dependent operations. A stage is a short part of the chain
//! for all edges of a block, so the processor overlaps the operations of many edges.
#![expect(clippy::inline_always, reason = "only inlined code is compiled for the instructions detected at run time")]

use crate::law::tension::{self, OutOfDomain};

/// Number of partial sums of a long sum, independent of the machine's vector width. Edges are processed in groups of
/// this size, so tables of edges or vehicles are padded to a multiple of it.
pub(super) const LANES: usize = 8;

pub(super) type Lanes = [f64; LANES];

/// Coordinate of padding lanes: so far away that the pull is 0.
pub(super) const PADDING_M: f64 = f64::MAX;

/// Evaluates edges from one vehicle to others, at most B at a time. B is a multiple of the number of lanes.
pub(super) struct Block<const B: usize> {
    delta_m: f64,
    /// Edge vectors along each axis \[m\]; at the end their pulls.
    edges: [[f64; B]; 3],
    lengths_m: [f64; B],
    /// Scaled clearance s; at the end V/alpha.
    scaled: [f64; B],
    /// Exponent of the single exponential of an edge; then that exponential less 1.
    decays: [f64; B],
    /// Sum of V/alpha.
    potential: Lanes,
    /// Whether some edge is not longer than delta.
    is_inside: bool,
}

/// Other ends of `count` edges. Each slice has whole lanes. Padding lanes have any 1/K, positions at [`PADDING_M`]
/// (pull with weight 0), and sums that no vehicle reads.
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

    /// Subtracts the pull of each edge on a vehicle at `own` \[m\] from the sums of its other end. The pull is
    /// `w_ij/alpha` times the edge, with `w_ij = V'/l`. Returns the pulls along each axis, in whole lanes.
    #[inline(always)]
    pub(super) fn pull(&mut self, own: [f64; 3], to: Ends<'_>) -> [&[f64]; 3] {
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
        add_lanes(&mut self.potential, scaled);
        [&x[..lanes], &y[..lanes], &z[..lanes]]
    }

    /// Returns (1/alpha) times the sum of V. Fails if an edge is not longer than delta or a position gives no finite
    /// value.
    #[inline(always)]
    pub(super) fn finish(self) -> Result<f64, OutOfDomain> {
        let potential = total(self.potential);
        if !self.is_inside && potential.is_finite() { Ok(potential) } else { Err(OutOfDomain) }
    }
}

/// Computes edges, lengths, s and exponents. Returns whether some edge is not longer than delta.
#[expect(clippy::too_many_arguments, reason = "separate slice arguments do not alias, which vectorisation needs")]
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

/// Turns edges into pulls, subtracts the pulls from the sums of the other ends, and turns s into V/alpha.
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
        scaled[k] = value;
    }
    scaled[count..].fill(0.0);
}

/// Adds each term to the sum of its lane. `terms` has whole lanes.
#[inline(always)]
pub(super) fn add_lanes(sums: &mut Lanes, terms: &[f64]) {
    // A copy stays in registers.
    let mut added = *sums;
    for terms in terms.as_chunks::<LANES>().0 {
        for k in 0..LANES {
            added[k] += terms[k];
        }
    }
    *sums = added;
}

#[inline(always)]
pub(super) fn total(lanes: Lanes) -> f64 {
    ((lanes[0] + lanes[4]) + (lanes[2] + lanes[6])) + ((lanes[1] + lanes[5]) + (lanes[3] + lanes[7]))
}
