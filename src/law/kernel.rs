//! The edge-tension sums over all edges, a block of edges at a time.
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
/// Edges that are evaluated together, a multiple of [`LANES`].
const BLOCK: usize = 32;
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
        let mut block = Block::new(kernel.delta_m);
        let mut potential = [0.0; LANES];
        match &kernel.edges {
            Edges::All(count) => {
                let start = rows.start;
                for (i, row) in with_values(rows, *count, &kernel.inverse_k_per_m) {
                    let mut of_own = [[0.0; LANES]; 3];
                    for (c, inverse) in row.chunks(BLOCK).enumerate() {
                        let first = i + 1 + c * BLOCK;
                        block.fill_from_row(i, first, inverse, axes);
                        block.turn_into_pulls(&mut potential);
                        for axis in 0..3 {
                            let pulls = &block.edges_m[axis];
                            for lanes in pulls.as_chunks::<LANES>().0.iter().take(inverse.len().div_ceil(LANES)) {
                                for k in 0..LANES {
                                    of_own[axis][k] += lanes[k];
                                }
                            }
                            let theirs = &mut sums[axis][first - start..][..inverse.len()];
                            theirs.iter_mut().zip(pulls).for_each(|(sum, pull)| *sum -= pull);
                        }
                    }
                    for axis in 0..3 {
                        sums[axis][i - start] += total(of_own[axis]);
                    }
                }
            }
            Edges::Listed(edges) => {
                for (edges, inverse) in edges.chunks(BLOCK).zip(kernel.inverse_k_per_m.chunks(BLOCK)) {
                    block.fill_from_list(edges, inverse, axes);
                    block.turn_into_pulls(&mut potential);
                    for (sums, pulls) in sums.iter_mut().zip(&block.edges_m) {
                        for (&[i, j], pull) in edges.iter().zip(pulls) {
                            sums[i] += pull;
                            sums[j] -= pull;
                        }
                    }
                }
            }
        }
        block.within().map(|()| total(potential))
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

/// Up to [`BLOCK`] edges.
struct Block {
    delta_m: f64,
    /// Number of edges.
    len: usize,
    /// Along each axis `p_i - p_j` of the edges.
    edges_m: [[f64; BLOCK]; 3],
    inverse_k_per_m: [f64; BLOCK],
    /// Positive once some distance was not in (delta, infinity).
    outside: u64,
}

impl Block {
    #[inline(always)]
    fn new(delta_m: f64) -> Self {
        Self { delta_m, len: 0, edges_m: [[0.0; BLOCK]; 3], inverse_k_per_m: [0.0; BLOCK], outside: 0 }
    }

    #[inline(always)]
    fn within(&self) -> Result<(), OutOfDomain> {
        if self.outside == 0 { Ok(()) } else { Err(OutOfDomain) }
    }

    /// The edges from vehicle `i` to the vehicles from `first` on, as many as there are 1/K.
    #[inline(always)]
    fn fill_from_row(&mut self, i: usize, first: usize, inverse_k_per_m: &[f64], axes: [&[f64]; 3]) {
        let len = inverse_k_per_m.len();
        for (edges, axis) in self.edges_m.iter_mut().zip(axes) {
            let own = axis[i];
            edges.iter_mut().zip(&axis[first..first + len]).for_each(|(edge, other)| *edge = own - other);
        }
        self.pad(inverse_k_per_m);
    }

    #[inline(always)]
    fn fill_from_list(&mut self, list: &[[usize; 2]], inverse_k_per_m: &[f64], axes: [&[f64]; 3]) {
        for (edges, axis) in self.edges_m.iter_mut().zip(axes) {
            edges.iter_mut().zip(list).for_each(|(edge, &[i, j])| *edge = axis[i] - axis[j]);
        }
        self.pad(inverse_k_per_m);
    }

    /// Fills the last lanes with edges at a distance where every function is finite.
    #[inline(always)]
    fn pad(&mut self, inverse_k_per_m: &[f64]) {
        self.len = inverse_k_per_m.len();
        self.inverse_k_per_m[..self.len].copy_from_slice(inverse_k_per_m);
        for k in self.len..self.len.next_multiple_of(LANES).min(BLOCK) {
            self.inverse_k_per_m[k] = 1.0;
            self.edges_m[0][k] = 2.0 * self.delta_m + 1.0;
            self.edges_m[1][k] = 0.0;
            self.edges_m[2][k] = 0.0;
        }
    }

    /// Multiplies each edge by `w_ij/alpha = V'/(alpha l)`, and adds V/alpha of each to `potential`.
    #[inline(always)]
    fn turn_into_pulls(&mut self, potential: &mut Lanes) {
        let chunks = self.len.div_ceil(LANES);
        let mut values = [[0.0; LANES]; BLOCK / LANES];
        let [x, y, z] = self.edges_m.each_mut().map(|edges| edges.as_chunks_mut::<LANES>().0);
        let inverse = self.inverse_k_per_m.as_chunks::<LANES>().0;
        for ((((x, y), z), inverse_k), values) in x.iter_mut().zip(y).zip(z).zip(inverse).zip(&mut values).take(chunks)
        {
            let outside;
            ([*x, *y, *z], *values, outside) = pulls(self.delta_m, [*x, *y, *z], *inverse_k);
            self.outside |= outside;
        }
        values.as_flattened_mut()[self.len..].fill(0.0);
        for values in &values {
            for k in 0..LANES {
                potential[k] += values[k];
            }
        }
        for edges in &mut self.edges_m {
            edges[self.len..].iter_mut().take(LANES).for_each(|pull| *pull = 0.0);
        }
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
