//! Evaluation of the edge tension for a block of edges, stage by stage.
//!
//! The pull between two vehicles takes a chain of some forty dependent operations. A stage is a short part of the chain
//! for all edges of a block, so the processor overlaps the operations of many edges.
#![expect(clippy::inline_always, reason = "only inlined code is compiled for the instructions detected at run time")]

use pulp::Simd;

use crate::law::tension::{self, OutOfDomain};

/// Number of partial sums of a long sum, independent of the machine's vector width. Edges are processed in groups of
/// this size, so tables of edges or vehicles are padded to a multiple of it.
pub(super) const LANES: usize = 8;

pub(super) type Lanes = [f64; LANES];

/// Coordinate of padding lanes: so far away that the pull is 0.
pub(super) const PADDING_M: f64 = f64::MAX;

/// Evaluates edges from one vehicle to others, at most B at a time. B is a multiple of the number of lanes.
///
/// Arrays begin on cache lines, which vectors of a whole line would otherwise cross.
#[repr(C, align(64))]
pub(super) struct Block<const B: usize> {
    /// Lengths of the edges \[m\]; at the end their weights.
    lengths_m: [f64; B],
    /// Scaled clearance s; at the end V/alpha.
    scaled: [f64; B],
    /// Reduced exponent r of the single exponential of an edge; then e^r - 1.
    reduced: [f64; B],
    /// Power of 2 of that exponential.
    powers: [f64; B],
    /// Sum of V/alpha.
    potential: Lanes,
    delta_m: f64,
    /// Whether some edge is not longer than delta.
    is_inside: bool,
}

/// Other ends of `count` edges. Each slice has whole lanes. Padding lanes have any 1/K, and positions at [`PADDING_M`]
/// (weight 0).
pub(super) struct Ends<'a> {
    pub(super) count: usize,
    pub(super) inverse_k_per_m: &'a [f64],
    pub(super) positions_m: [&'a [f64]; 3],
}

impl<const B: usize> Block<B> {
    #[inline(always)]
    pub(super) fn new(delta_m: f64) -> Self {
        const { assert!(B.is_multiple_of(LANES), "blocks hold whole lanes") };
        let zeros = [0.0; B];
        Self {
            lengths_m: zeros,
            scaled: zeros,
            reduced: zeros,
            powers: zeros,
            potential: [0.0; LANES],
            delta_m,
            is_inside: false,
        }
    }

    /// Returns `w_ij/alpha` of each edge from a vehicle at `own` \[m\], in whole lanes, with `w_ij = V'/l`. The pull of
    /// an edge is this weight times the edge.
    #[inline(always)]
    pub(super) fn weights(&mut self, own: [f64; 3], to: &Ends<'_>) -> &[f64] {
        let lanes = to.inverse_k_per_m.len();
        let (lengths_m, scaled) = (&mut self.lengths_m[..lanes], &mut self.scaled[..lanes]);
        let (reduced, powers) = (&mut self.reduced[..lanes], &mut self.powers[..lanes]);

        self.is_inside |= measure(self.delta_m, own, to, lengths_m, scaled, reduced, powers);
        for reduced in &mut *reduced {
            *reduced = tension::expm1_reduced(*reduced);
        }
        weigh(to.inverse_k_per_m, reduced, powers, lengths_m, scaled);
        scaled[to.count..].fill(0.0);
        add_lanes(&mut self.potential, scaled);
        lengths_m
    }

    /// Returns (1/alpha) times the sum of V. Fails if an edge is not longer than delta or a position gives no finite
    /// value.
    #[inline(always)]
    pub(super) fn finish(self) -> Result<f64, OutOfDomain> {
        let potential = total(self.potential);
        if !self.is_inside && potential.is_finite() { Ok(potential) } else { Err(OutOfDomain) }
    }
}

/// Computes lengths, s, reduced exponents and powers. Returns whether some edge is not longer than delta.
///
/// Separate arguments for mutable slices do not alias, which vectorisation needs.
#[inline(always)]
fn measure(
    delta_m: f64,
    own: [f64; 3],
    to: &Ends<'_>,
    lengths_m: &mut [f64],
    scaled: &mut [f64],
    reduced: &mut [f64],
    powers: &mut [f64],
) -> bool {
    let lanes = to.inverse_k_per_m.len();
    let [x, y, z] = to.positions_m.map(|axis| &axis[..lanes]);
    let (lengths_m, scaled) = (&mut lengths_m[..lanes], &mut scaled[..lanes]);
    let (reduced, powers) = (&mut reduced[..lanes], &mut powers[..lanes]);
    let mut inside = 0;
    for k in 0..lanes {
        let (x, y, z) = (own[0] - x[k], own[1] - y[k], own[2] - z[k]);
        let length_m = (x * x + y * y + z * z).sqrt();
        inside |= u64::from(length_m <= delta_m);
        lengths_m[k] = length_m;
        scaled[k] = (length_m - delta_m) * to.inverse_k_per_m[k];
        (reduced[k], powers[k]) = tension::reduce(tension::exponent(scaled[k], scaled[k] - tension::REST));
    }
    inside != 0
}

/// Turns lengths into weights and s into V/alpha.
#[inline(always)]
fn weigh(inverse_k_per_m: &[f64], reduced: &[f64], powers: &[f64], lengths_m: &mut [f64], scaled: &mut [f64]) {
    let lanes = inverse_k_per_m.len();
    let (reduced, powers) = (&reduced[..lanes], &powers[..lanes]);
    let (lengths_m, scaled) = (&mut lengths_m[..lanes], &mut scaled[..lanes]);
    for k in 0..lanes {
        let h = scaled[k] - tension::REST;
        let decay = tension::scale(powers[k], reduced[k]);
        let (slope_per_m, value) = tension::slope_and_value_over(lengths_m[k], scaled[k], h, decay);
        lengths_m[k] = inverse_k_per_m[k] * slope_per_m;
        scaled[k] = value;
    }
}

/// Adds the pulls along one axis to the sums of a vehicle at `own` \[m\], and subtracts them from the sums of the other
/// ends. All slices have the same number of whole lanes.
///
/// Explicit vectors keep `of_own` in registers of full width.
#[inline(always)]
pub(super) fn add_pulls<S: Simd>(simd: S, own: f64, to: &[f64], weights: &[f64], sums: &mut [f64], of_own: &mut Lanes) {
    let width = LANES / S::F64_LANES;
    let own = simd.splat_f64s(own);
    let to = S::as_simd_f64s(to).0.chunks_exact(width);
    let weights = S::as_simd_f64s(weights).0.chunks_exact(width);
    let sums = S::as_mut_simd_f64s(sums).0.chunks_exact_mut(width);
    // A copy stays in registers.
    let mut added = *of_own;
    for ((to, weights), sums) in to.zip(weights).zip(sums) {
        let added = S::as_mut_simd_f64s(&mut added).0;
        for k in 0..width {
            let pull = simd.mul_f64s(simd.sub_f64s(own, to[k]), weights[k]);
            sums[k] = simd.sub_f64s(sums[k], pull);
            added[k] = simd.add_f64s(added[k], pull);
        }
    }
    *of_own = added;
}

/// Adds each term to the sum of its lane. `terms` has whole lanes.
#[inline(always)]
fn add_lanes(sums: &mut Lanes, terms: &[f64]) {
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
