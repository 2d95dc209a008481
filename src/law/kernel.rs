//! The edge-tension sums over all edges, in blocks that fill the lanes of vector instructions.
//!
//! The loops over edges hold nothing but IEEE additions, multiplications, divisions, square roots and selections, which
//! the compiler turns into whatever vector instructions were found at run time. Nothing is fused or reordered, and sums
//! are taken in an order fixed by the edges alone, so the bits depend neither on the width of the machine's vectors
//! nor on the level of optimisation.
#![expect(clippy::inline_always, reason = "only what is inlined is compiled for the instructions found at run time")]

mod block;

use std::ops::Range;

use pulp::{Simd, WithSimd};

use self::block::{Block, LANES, Lanes};
use super::bands::Bands;
use crate::graph::Graph;
use crate::swarm::Rows;

/// Up to this many vehicles even the complete graph is taken as a list, because short rows leave lanes empty. The order of sums
/// differs, so this number is a part of what the bits of a flight rest on.
const LISTED_UP_TO: usize = 16;
/// From this many vehicles on all threads at hand share the rows of the complete graph, in bands. Sums of bands differ from
/// those of all rows in their last bits, so this number is a part of what the bits of a flight rest on.
const BANDED_FROM: usize = 640;
/// Edges in a block of a row: so many that stages follow each other seldom, and so few that they stay near the processor.
const ROW_BLOCK: usize = 8 * LANES;
/// Edges in a block of a list: few, because lists are often short and a block is cleared for each.
const LIST_BLOCK: usize = 2 * LANES;

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
        match &kernel.edges {
            Edges::All(count) => {
                let mut evaluator = Evaluator::<ROW_BLOCK>::new(kernel.delta_m);
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
                evaluator.finish()
            }
            Edges::Listed(edges) => {
                let mut evaluator = Evaluator::<LIST_BLOCK>::new(kernel.delta_m);
                let blocks = edges.chunks(LIST_BLOCK).zip(kernel.inverse_k_per_m.chunks(LIST_BLOCK));
                for (edges, inverse_k_per_m) in blocks {
                    evaluator.block.take_list(inverse_k_per_m, edges, axes);
                    evaluator.evaluate();
                    for (axis, sums) in sums.iter_mut().enumerate() {
                        for (&[i, j], pull) in edges.iter().zip(evaluator.block.pulls(axis)) {
                            sums[i] += pull;
                            sums[j] -= pull;
                        }
                    }
                }
                evaluator.finish()
            }
        }
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

/// Evaluates edges, a block at a time.
struct Evaluator<const B: usize> {
    delta_m: f64,
    block: Block<B>,
    /// Sum of V/alpha.
    potential: Lanes,
    /// Whether some distance was not in (delta, infinity).
    is_outside: bool,
}

impl<const B: usize> Evaluator<B> {
    #[inline(always)]
    fn new(delta_m: f64) -> Self {
        Self { delta_m, block: Block::new(), potential: [0.0; LANES], is_outside: false }
    }

    /// The edges from a vehicle at `own` \[m\] to as many others as there are 1/K: subtracts the pull of each from theirs, and
    /// returns their sum along each axis in lanes.
    #[inline(always)]
    fn row(
        &mut self,
        own: [f64; 3],
        inverse_k_per_m: &[f64],
        others: [&[f64]; 3],
        mut theirs: [&mut [f64]; 3],
    ) -> [Lanes; 3] {
        let mut of_own = [[0.0; LANES]; 3];
        for (from, inverse_k_per_m) in (0..).step_by(B).zip(inverse_k_per_m.chunks(B)) {
            self.block.take_row(inverse_k_per_m, own, others.map(|axis| &axis[from..]));
            self.evaluate();
            for (axis, (of_own, theirs)) in of_own.iter_mut().zip(&mut theirs).enumerate() {
                add_lanes(of_own, self.block.pulls_in_lanes(axis));
                theirs[from..].iter_mut().zip(self.block.pulls(axis)).for_each(|(sum, pull)| *sum -= pull);
            }
        }
        of_own
    }

    #[inline(always)]
    fn evaluate(&mut self) {
        self.is_outside |= self.block.evaluate(self.delta_m);
        add_lanes(&mut self.potential, self.block.values_in_lanes());
    }

    /// (1/alpha) sum of V.
    #[inline(always)]
    fn finish(self) -> Result<f64, OutOfDomain> {
        if self.is_outside { Err(OutOfDomain) } else { Ok(total(self.potential)) }
    }
}

#[inline(always)]
fn add_lanes(sums: &mut Lanes, lanes: &[Lanes]) {
    for lanes in lanes {
        sums.iter_mut().zip(lanes).for_each(|(sum, lane)| *sum += lane);
    }
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
