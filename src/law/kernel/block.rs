//! Edges taken through the edge tension side by side, stage by stage.
//!
//! From the positions of two vehicles to the pull between them leads a chain of some forty operations, each of which waits for
//! the one before. A stage is a short part of it for all edges of a block, of which a processor has many in flight.
#![expect(clippy::inline_always, reason = "only what is inlined is compiled for the instructions found at run time")]

use crate::law::tension;

/// Number of partial sums that a long sum is split into, whatever the machine's vectors hold.
pub(super) const LANES: usize = 8;

pub(super) type Lanes = [f64; LANES];

/// Room for B edges, a multiple of the lanes, and what becomes of them. Behind the last edge, lanes are filled with edges that
/// pull nobody.
pub(super) struct Block<const B: usize> {
    count: usize,
    inverse_k_per_m: [f64; B],
    /// The edges along each axis \[m\]; at the end their pulls.
    edges: [[f64; B]; 3],
    lengths_m: [f64; B],
    /// s; at the end V/alpha.
    scaled: [f64; B],
    /// The exponent of the one exponential that an edge takes; then that exponential less 1.
    decays: [f64; B],
}

impl<const B: usize> Block<B> {
    #[inline(always)]
    pub(super) fn new() -> Self {
        let zeros = [0.0; B];
        Self { count: 0, inverse_k_per_m: zeros, edges: [zeros; 3], lengths_m: zeros, scaled: zeros, decays: zeros }
    }

    /// Takes the edges from a vehicle at `own` \[m\] to others, at most B of them, with their 1/K.
    #[inline(always)]
    pub(super) fn take_row(&mut self, inverse_k_per_m: &[f64], own: [f64; 3], others: [&[f64]; 3]) {
        self.take_scales(inverse_k_per_m);
        for ((edges, own), others) in self.edges.iter_mut().zip(own).zip(others) {
            edges[..self.count].iter_mut().zip(&others[..self.count]).for_each(|(edge, other)| *edge = own - other);
        }
    }

    /// Takes edges between vehicles at positions given by axis \[m\], at most B of them, with their 1/K.
    #[inline(always)]
    pub(super) fn take_list(&mut self, inverse_k_per_m: &[f64], list: &[[usize; 2]], axes: [&[f64]; 3]) {
        self.take_scales(inverse_k_per_m);
        for (edges, axis) in self.edges.iter_mut().zip(axes) {
            edges[..self.count]
                .iter_mut()
                .zip(&list[..self.count])
                .for_each(|(edge, &[i, j])| *edge = axis[i] - axis[j]);
        }
    }

    #[inline(always)]
    fn take_scales(&mut self, inverse_k_per_m: &[f64]) {
        const { assert!(B.is_multiple_of(LANES), "blocks hold whole lanes") };
        self.count = inverse_k_per_m.len();
        self.inverse_k_per_m[..self.count].copy_from_slice(inverse_k_per_m);
    }

    #[inline(always)]
    fn filled(&self) -> usize {
        self.count.next_multiple_of(LANES)
    }

    /// Turns the edges into their pulls: `w_ij/alpha` times each, with `w_ij = V'/l`. Says whether some length is not in (delta,
    /// infinity).
    #[inline(always)]
    pub(super) fn evaluate(&mut self, delta_m: f64) -> bool {
        let (count, filled) = (self.count, self.filled());
        let Self { inverse_k_per_m, edges: [x, y, z], lengths_m, scaled, decays, .. } = self;
        let (x, y, z) = (&mut x[..filled], &mut y[..filled], &mut z[..filled]);
        let (inverse_k_per_m, lengths_m) = (&mut inverse_k_per_m[..filled], &mut lengths_m[..filled]);
        let (scaled, decays) = (&mut scaled[..filled], &mut decays[..filled]);
        for k in count..filled {
            // A length where every function is finite, for every delta below 1e153 m.
            (x[k], y[k], z[k], inverse_k_per_m[k]) = (2.0 * delta_m + 1.0, 0.0, 0.0, 1.0);
        }
        let mut outside = 0;
        for k in 0..filled {
            let length_m = (x[k] * x[k] + y[k] * y[k] + z[k] * z[k]).sqrt();
            outside |= u64::from(!(length_m > delta_m && length_m < f64::INFINITY));
            lengths_m[k] = length_m;
            scaled[k] = (length_m - delta_m) * inverse_k_per_m[k];
        }
        for k in 0..filled {
            decays[k] = tension::exponent(scaled[k], scaled[k] - tension::REST);
        }
        for decay in &mut *decays {
            *decay = tension::expm1(*decay);
        }
        for k in 0..filled {
            let h = scaled[k] - tension::REST;
            let (slope_per_m, value) = tension::slope_and_value_over(lengths_m[k], scaled[k], h, decays[k]);
            let weight = inverse_k_per_m[k] * slope_per_m;
            x[k] *= weight;
            y[k] *= weight;
            z[k] *= weight;
            scaled[k] = value;
        }
        for k in count..filled {
            (x[k], y[k], z[k], scaled[k]) = (0.0, 0.0, 0.0, 0.0);
        }
        outside != 0
    }

    /// The pulls along an axis.
    #[inline(always)]
    pub(super) fn pulls(&self, axis: usize) -> &[f64] {
        &self.edges[axis][..self.count]
    }

    /// The pulls along an axis, in lanes.
    #[inline(always)]
    pub(super) fn pulls_in_lanes(&self, axis: usize) -> &[Lanes] {
        self.edges[axis][..self.filled()].as_chunks().0
    }

    /// V/alpha of the edges, in lanes.
    #[inline(always)]
    pub(super) fn values_in_lanes(&self) -> &[Lanes] {
        self.scaled[..self.filled()].as_chunks().0
    }
}
