//! The edge-tension sums over all edges, as many at a time as there are lanes.
//!
//! The loops over lanes hold nothing but IEEE additions, multiplications, divisions, square roots and selections, which
//! the compiler turns into whatever vector instructions were found at run time. Nothing is fused or reordered, and sums
//! are taken in an order fixed by the edges alone, so the bits depend neither on the width of the machine's vectors
//! nor on the level of optimisation.
#![expect(clippy::inline_always, reason = "only what is inlined is compiled for the instructions found at run time")]

use std::ops::Range;

use pulp::{Simd, WithSimd};

use super::bands::Bands;
use super::tension;
use crate::graph::Graph;
use crate::swarm::Rows;

/// Number of partial sums that a long sum is split into, whatever the machine's vectors hold.
const LANES: usize = 8;
/// Up to this many vehicles even the complete graph is taken as a list, because short rows leave lanes empty. Around
/// this number both ways take the same time.
const LISTED_UP_TO: usize = 16;
/// From this many vehicles on all threads at hand share the rows of the complete graph, in bands. Sums of bands differ from
/// those of all rows in their last bits, so this number is a part of what the bits of a flight rest on.
const BANDED_FROM: usize = 640;

type Lanes = [f64; LANES];

/// The edges of a graph with the length scale of each.
#[derive(Clone, Debug)]
pub(super) struct Kernel {
    delta_m: f64,
    edges: Edges,
    /// 1/K of each edge, in row order.
    inverse_k_per_m: Vec<f64>,
    bands: Option<Bands>,
    arch: pulp::Arch,
}

#[derive(Clone, Debug)]
enum Edges {
    /// All pairs of this many vehicles.
    All(usize),
    Listed(Vec<[usize; 2]>),
}

/// Some distance is not in (delta, infinity).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct OutOfDomain;

impl Kernel {
    /// `inverse_k_per_m` holds 1/K for each edge of the graph in row order.
    pub(super) fn new(graph: &Graph, delta_m: f64, inverse_k_per_m: Vec<f64>) -> Self {
        let edges = if graph.is_complete() && graph.count() > LISTED_UP_TO {
            Edges::All(graph.count())
        } else {
            Edges::Listed(graph.edges().map(|(i, j)| [i, j]).collect())
        };
        let is_banded = matches!(edges, Edges::All(BANDED_FROM..));
        let bands = is_banded.then(|| Bands::new(graph.count()));
        Self { delta_m, edges, inverse_k_per_m, bands, arch: pulp::Arch::new() }
    }

    /// 1/K of each edge in row order \[1/m\].
    pub(super) fn inverse_k_per_m_mut(&mut self) -> &mut [f64] {
        &mut self.inverse_k_per_m
    }

    /// Adds `(1/alpha) sum_j w_ij (p_i - p_j)` over the neighbours j of each vehicle i to row i of `sums` \[1/m\], and
    /// returns (1/alpha) sum of V over all edges, which costs next to nothing here.
    /// Both tables have a row for each vehicle of the graph.
    pub(super) fn add_pulls(&mut self, positions_m: &Rows, sums: &mut Rows) -> Result<f64, OutOfDomain> {
        let mut bands = self.bands.take();
        let potential = self.add_pulls_in(bands.as_mut(), positions_m, sums);
        self.bands = bands;
        potential
    }

    /// (1/alpha) sum of V over all edges.
    pub(super) fn potential(&self, positions_m: &Rows) -> Result<f64, OutOfDomain> {
        self.add_pulls_in(self.bands.clone().as_mut(), positions_m, &mut Rows::zeros(positions_m.nrows()))
    }

    fn add_pulls_in(&self, bands: Option<&mut Bands>, positions_m: &Rows, sums: &mut Rows) -> Result<f64, OutOfDomain> {
        let (axes, sums) = (columns(positions_m), columns_mut(sums));
        let add =
            |rows: Range<usize>, sums: [&mut [f64]; 3]| self.arch.dispatch(AddPulls { kernel: self, rows, axes, sums });
        match bands {
            Some(bands) => bands.add_to(sums, |rows, sums| add(rows, sums).ok()).ok_or(OutOfDomain),
            None => add(0..positions_m.nrows(), sums),
        }
    }
}

/// Adds the pulls of the edges from these rows of the complete graph to later ones, or of all edges that are listed.
struct AddPulls<'a> {
    kernel: &'a Kernel,
    rows: Range<usize>,
    axes: [&'a [f64]; 3],
    /// From the first of the rows on.
    sums: [&'a mut [f64]; 3],
}

impl WithSimd for AddPulls<'_> {
    type Output = Result<f64, OutOfDomain>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Self::Output {
        let Self { kernel, rows, axes, mut sums } = self;
        let mut evaluator = Evaluator { delta_m: kernel.delta_m, potential: [0.0; LANES], outside: 0 };
        match &kernel.edges {
            Edges::All(count) => {
                let start = rows.start;
                for (i, row) in with_values(rows, *count, &kernel.inverse_k_per_m) {
                    let own = axes.map(|axis| axis[i]);
                    let of_own = evaluator.row(
                        own,
                        row,
                        axes.map(|axis| &axis[i + 1..]),
                        sums.each_mut().map(|axis| &mut axis[i + 1 - start..]),
                    );
                    for axis in 0..3 {
                        sums[axis][i - start] += total(of_own[axis]);
                    }
                }
            }
            Edges::Listed(edges) => {
                for (edges, inverse) in edges.chunks(LANES).zip(kernel.inverse_k_per_m.chunks(LANES)) {
                    let apart_m = |axis: usize, k: usize| axes[axis][edges[k][0]] - axes[axis][edges[k][1]];
                    let pulls = evaluator.some(inverse, apart_m);
                    for (sums, pulls) in sums.iter_mut().zip(&pulls) {
                        for (&[i, j], pull) in edges.iter().zip(pulls) {
                            sums[i] += pull;
                            sums[j] -= pull;
                        }
                    }
                }
            }
        }
        if evaluator.outside == 0 { Ok(total(evaluator.potential)) } else { Err(OutOfDomain) }
    }
}

/// Each of these vehicles of the complete graph with the values of its edges to all later ones.
#[inline(always)]
fn with_values(rows: Range<usize>, count: usize, values: &[f64]) -> impl Iterator<Item = (usize, &[f64])> {
    let edges_before = rows.start * (2 * count - rows.start).saturating_sub(1) / 2;
    let mut values = &values[edges_before..];
    rows.map(move |i| {
        let (row, rest) = values.split_at(count - i - 1);
        values = rest;
        (i, row)
    })
}

/// Evaluates edges, as many at once as there are lanes.
struct Evaluator {
    delta_m: f64,
    /// Sum of V/alpha.
    potential: Lanes,
    /// Positive once some distance was not in (delta, infinity).
    outside: u64,
}

impl Evaluator {
    /// The edges from a vehicle at `own` \[m\] to as many others as there are 1/K: subtracts the pull of each from theirs, and
    /// returns their sum along each axis in lanes.
    #[inline(always)]
    fn row(&mut self, own: [f64; 3], inverse_k: &[f64], others: [&[f64]; 3], theirs: [&mut [f64]; 3]) -> [Lanes; 3] {
        let mut of_own = [[0.0; LANES]; 3];
        let (whole, rest) = inverse_k.as_chunks::<LANES>();
        let [x, y, z] = others.map(|axis| axis.as_chunks::<LANES>().0);
        let [mut of_x, mut of_y, mut of_z] = theirs;
        let sums = of_x
            .as_chunks_mut::<LANES>()
            .0
            .iter_mut()
            .zip(of_y.as_chunks_mut::<LANES>().0)
            .zip(of_z.as_chunks_mut::<LANES>().0);
        for ((((inverse_k, x), y), z), ((of_x, of_y), of_z)) in whole.iter().zip(x).zip(y).zip(z).zip(sums) {
            let others = [x, y, z];
            let edges_m = [0, 1, 2].map(|axis| others[axis].map(|other| own[axis] - other));
            let pulls = self.pulls(edges_m, *inverse_k);
            for (axis, theirs) in [of_x, of_y, of_z].into_iter().enumerate() {
                for k in 0..LANES {
                    of_own[axis][k] += pulls[axis][k];
                    theirs[k] -= pulls[axis][k];
                }
            }
        }
        let from = whole.len() * LANES;
        if !rest.is_empty() {
            let pulls = self.some(rest, |axis, k| own[axis] - others[axis][from + k]);
            for (axis, theirs) in [&mut of_x, &mut of_y, &mut of_z].into_iter().enumerate() {
                for k in 0..LANES {
                    of_own[axis][k] += pulls[axis][k];
                }
                theirs[from..].iter_mut().zip(&pulls[axis][..rest.len()]).for_each(|(sum, pull)| *sum -= pull);
            }
        }
        of_own
    }

    /// The pulls of fewer edges than there are lanes, or as many; 0 in the lanes that are left.
    #[inline(always)]
    fn some(&mut self, inverse_k_per_m: &[f64], apart_m: impl Fn(usize, usize) -> f64) -> [Lanes; 3] {
        let count = inverse_k_per_m.len();
        // A distance where every function is finite.
        let mut edges_m = [[2.0 * self.delta_m + 1.0; LANES], [0.0; LANES], [0.0; LANES]];
        let mut inverse_k = [1.0; LANES];
        for k in 0..count {
            inverse_k[k] = inverse_k_per_m[k];
            edges_m.iter_mut().enumerate().for_each(|(axis, edges_m)| edges_m[k] = apart_m(axis, k));
        }
        let before = self.potential;
        let mut pulls = self.pulls(edges_m, inverse_k);
        for k in count..LANES {
            self.potential[k] = before[k];
            for pulls in &mut pulls {
                pulls[k] = 0.0;
            }
        }
        pulls
    }

    /// Multiplies each edge by `w_ij/alpha = V'/(alpha l)`, and adds V/alpha of each to the potential.
    #[inline(always)]
    fn pulls(&mut self, edges_m: [Lanes; 3], inverse_k_per_m: Lanes) -> [Lanes; 3] {
        let (pulls, values, outside) = pulls(self.delta_m, edges_m, inverse_k_per_m);
        self.outside |= outside;
        self.potential.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        pulls
    }
}

/// The length of an edge, and 1 where it is not in (delta, infinity).
#[inline(always)]
fn distance_m(delta_m: f64, x: f64, y: f64, z: f64) -> (f64, u64) {
    let distance_m = (x * x + y * y + z * z).sqrt();
    (distance_m, u64::from(!(distance_m > delta_m && distance_m < f64::INFINITY)))
}

/// The edges times `w_ij/alpha`, their V/alpha, and 1 where some length is not in (delta, infinity). Arrays go in and out
/// by value: with nothing that may alias, the loop becomes vector instructions.
#[inline(always)]
fn pulls(delta_m: f64, edges_m: [Lanes; 3], inverse_k_per_m: Lanes) -> ([Lanes; 3], Lanes, u64) {
    let [mut x, mut y, mut z] = edges_m;
    let mut values = [0.0; LANES];
    let mut outside = 0;
    for k in 0..LANES {
        let (distance_m, out) = distance_m(delta_m, x[k], y[k], z[k]);
        outside |= out;
        let s = (distance_m - delta_m) * inverse_k_per_m[k];
        let (slope_per_m, value) = tension::slope_and_value_over(distance_m, s, s - tension::REST);
        let weight = inverse_k_per_m[k] * slope_per_m;
        x[k] *= weight;
        y[k] *= weight;
        z[k] *= weight;
        values[k] = value;
    }
    ([x, y, z], values, outside)
}

#[inline(always)]
fn total(lanes: Lanes) -> f64 {
    ((lanes[0] + lanes[4]) + (lanes[2] + lanes[6])) + ((lanes[1] + lanes[5]) + (lanes[3] + lanes[7]))
}

fn columns(rows: &Rows) -> [&[f64]; 3] {
    let (x, rest) = rows.as_slice().split_at(rows.nrows());
    let (y, z) = rest.split_at(rows.nrows());
    [x, y, z]
}

fn columns_mut(rows: &mut Rows) -> [&mut [f64]; 3] {
    let count = rows.nrows();
    let (x, rest) = rows.as_mut_slice().split_at_mut(count);
    let (y, z) = rest.split_at_mut(count);
    [x, y, z]
}

#[cfg(test)]
mod tests;
