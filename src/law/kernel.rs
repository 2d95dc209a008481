//! The edge-tension sums over all edges, eight edges at a time.
//!
//! The loops over lanes hold nothing but IEEE additions, multiplications, divisions, square roots and selections, which
//! the compiler turns into whatever vector instructions were found at run time. Nothing is fused or reordered, and sums
//! are taken in an order fixed by the edges alone, so the bits depend neither on the width of the machine's vectors
//! nor on the level of optimisation.
#![expect(clippy::inline_always, reason = "only what is inlined is compiled for the instructions found at run time")]

use super::tension;
use crate::graph::Graph;
use crate::swarm::Rows;

/// Edges that are evaluated together.
const LANES: usize = 8;
/// Up to this many vehicles even the complete graph is taken as a list, because short rows leave lanes empty.
const LISTED_UP_TO: usize = 24;

type Lanes = [f64; LANES];

/// The edges of a graph with the length scale of each.
#[derive(Clone, Debug)]
pub(super) struct Kernel {
    delta_m: f64,
    edges: Edges,
    /// 1/K of each edge, in row order.
    inverse_k_per_m: Vec<f64>,
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

/// Up to [`LANES`] edges: the differences p_i - p_j along each axis, and 1/K.
struct Chunk {
    offset_m: [Lanes; 3],
    inverse_k_per_m: Lanes,
}

impl Kernel {
    /// `inverse_k_per_m` holds 1/K for each edge of the graph in row order.
    pub(super) fn new(graph: &Graph, delta_m: f64, inverse_k_per_m: Vec<f64>) -> Self {
        let edges = if graph.is_complete() && graph.count() > LISTED_UP_TO {
            Edges::All(graph.count())
        } else {
            Edges::Listed(graph.edges().map(|(i, j)| [i, j]).collect())
        };
        Self { delta_m, edges, inverse_k_per_m, arch: pulp::Arch::new() }
    }

    /// Adds (1/alpha) sum_j w_ij (p_i - p_j) over the neighbours j of each vehicle i to row i of `sums` \[1/m\].
    /// Both tables have a row for each vehicle of the graph.
    pub(super) fn add_pulls(&self, positions_m: &Rows, sums: &mut Rows) -> Result<(), OutOfDomain> {
        let axes = columns(positions_m);
        let sums = columns_mut(sums);
        self.arch.dispatch(
            #[inline(always)]
            || match &self.edges {
                Edges::All(count) => self.add_pulls_by_row(*count, axes, sums),
                Edges::Listed(edges) => self.add_pulls_by_list(edges, axes, sums),
            },
        )
    }

    /// (1/alpha) sum of V over all edges.
    pub(super) fn potential(&self, positions_m: &Rows) -> Result<f64, OutOfDomain> {
        let axes = columns(positions_m);
        self.arch.dispatch(
            #[inline(always)]
            || match &self.edges {
                Edges::All(count) => self.potential_by_row(*count, axes),
                Edges::Listed(edges) => self.potential_by_list(edges, axes),
            },
        )
    }

    #[inline(always)]
    fn add_pulls_by_row(&self, count: usize, axes: [&[f64]; 3], mut sums: [&mut [f64]; 3]) -> Result<(), OutOfDomain> {
        let mut outside = 0;
        let mut rest = self.inverse_k_per_m.as_slice();
        for i in 0..count {
            let mut own = [[0.0; LANES]; 3];
            rest = for_each_chunk_of_row(self.delta_m, i, axes, rest, |from, len, chunk| {
                let weights = chunk.weights(self.delta_m, len, &mut outside);
                for axis in 0..3 {
                    let mut pull = [0.0; LANES];
                    for k in 0..LANES {
                        pull[k] = weights[k] * chunk.offset_m[axis][k];
                        own[axis][k] += pull[k];
                    }
                    let theirs = &mut sums[axis][from..from + len];
                    if let Ok(theirs) = <&mut Lanes>::try_from(&mut *theirs) {
                        for k in 0..LANES {
                            theirs[k] -= pull[k];
                        }
                    } else {
                        theirs.iter_mut().zip(pull).for_each(|(sum, pull)| *sum -= pull);
                    }
                }
            });
            for axis in 0..3 {
                sums[axis][i] += total(own[axis]);
            }
        }
        within(outside)
    }

    #[inline(always)]
    fn add_pulls_by_list(
        &self,
        edges: &[[usize; 2]],
        axes: [&[f64]; 3],
        sums: [&mut [f64]; 3],
    ) -> Result<(), OutOfDomain> {
        let mut outside = 0;
        for (edges, inverse) in edges.chunks(LANES).zip(self.inverse_k_per_m.chunks(LANES)) {
            let chunk = Chunk::of_list(self.delta_m, edges, axes, inverse);
            let weights = chunk.weights(self.delta_m, edges.len(), &mut outside);
            for axis in 0..3 {
                for (k, &[i, j]) in edges.iter().enumerate() {
                    let pull = weights[k] * chunk.offset_m[axis][k];
                    sums[axis][i] += pull;
                    sums[axis][j] -= pull;
                }
            }
        }
        within(outside)
    }

    #[inline(always)]
    fn potential_by_row(&self, count: usize, axes: [&[f64]; 3]) -> Result<f64, OutOfDomain> {
        let (mut outside, mut sum) = (0, [0.0; LANES]);
        let mut rest = self.inverse_k_per_m.as_slice();
        for i in 0..count {
            rest = for_each_chunk_of_row(self.delta_m, i, axes, rest, |_, len, chunk| {
                chunk.add_values(self.delta_m, len, &mut sum, &mut outside);
            });
        }
        within(outside).map(|()| total(sum))
    }

    #[inline(always)]
    fn potential_by_list(&self, edges: &[[usize; 2]], axes: [&[f64]; 3]) -> Result<f64, OutOfDomain> {
        let (mut outside, mut sum) = (0, [0.0; LANES]);
        for (edges, inverse) in edges.chunks(LANES).zip(self.inverse_k_per_m.chunks(LANES)) {
            let chunk = Chunk::of_list(self.delta_m, edges, axes, inverse);
            chunk.add_values(self.delta_m, edges.len(), &mut sum, &mut outside);
        }
        within(outside).map(|()| total(sum))
    }
}

/// Calls `each(first later vehicle, number of lanes in use, chunk)` along row `i` of the complete graph. Takes the
/// row's 1/K from the front of `inverse_k_per_m` and returns what is behind them.
#[inline(always)]
fn for_each_chunk_of_row<'a>(
    delta_m: f64,
    i: usize,
    axes: [&[f64]; 3],
    inverse_k_per_m: &'a [f64],
    mut each: impl FnMut(usize, usize, Chunk),
) -> &'a [f64] {
    let from = i + 1;
    let (row, rest) = inverse_k_per_m.split_at(axes[0].len() - from);
    let (full, partial) = row.as_chunks::<LANES>();
    let own = axes.map(|axis| axis[i]);
    let [x, y, z] = axes.map(|axis| axis[from..].as_chunks::<LANES>());
    for (c, (((inverse, x), y), z)) in full.iter().zip(x.0).zip(y.0).zip(z.0).enumerate() {
        let offset_m = [(own[0], x), (own[1], y), (own[2], z)].map(|(own, others)| others.map(|other| own - other));
        each(from + c * LANES, LANES, Chunk { offset_m, inverse_k_per_m: *inverse });
    }
    if !partial.is_empty() {
        let mut chunk = Chunk::padding(delta_m);
        for (k, &inverse) in partial.iter().enumerate() {
            chunk.inverse_k_per_m[k] = inverse;
            chunk.offset_m[0][k] = own[0] - x.1[k];
            chunk.offset_m[1][k] = own[1] - y.1[k];
            chunk.offset_m[2][k] = own[2] - z.1[k];
        }
        each(from + full.len() * LANES, partial.len(), chunk);
    }
    rest
}

impl Chunk {
    /// Pairs at a distance where every function is finite.
    #[inline(always)]
    fn padding(delta_m: f64) -> Self {
        Self { offset_m: [[2.0 * delta_m + 1.0; LANES], [0.0; LANES], [0.0; LANES]], inverse_k_per_m: [1.0; LANES] }
    }

    #[inline(always)]
    fn of_list(delta_m: f64, edges: &[[usize; 2]], axes: [&[f64]; 3], inverse_k_per_m: &[f64]) -> Self {
        let mut chunk = Self::padding(delta_m);
        for (k, (&[i, j], &inverse)) in edges.iter().zip(inverse_k_per_m).take(LANES).enumerate() {
            chunk.inverse_k_per_m[k] = inverse;
            for (offset_m, axis) in chunk.offset_m.iter_mut().zip(axes) {
                offset_m[k] = axis[i] - axis[j];
            }
        }
        chunk
    }

    #[inline(always)]
    fn distances(&self) -> Lanes {
        let [x, y, z] = &self.offset_m;
        std::array::from_fn(|k| (x[k] * x[k] + y[k] * y[k] + z[k] * z[k]).sqrt())
    }

    /// w_ij/alpha = V'/(alpha l) of each edge, 0 in the lanes from `len`. `outside` becomes positive where some
    /// distance is not in (delta, infinity).
    #[inline(always)]
    fn weights(&self, delta_m: f64, len: usize, outside: &mut u64) -> Lanes {
        let distances = self.distances();
        let mut weights = [0.0; LANES];
        for k in 0..LANES {
            let (distance, inverse_k) = (distances[k], self.inverse_k_per_m[k]);
            *outside |= u64::from(!(distance > delta_m && distance < f64::INFINITY));
            let s = (distance - delta_m) * inverse_k;
            let (numerator, denominator) = tension::slope_fraction(s, s - tension::REST);
            weights[k] = inverse_k * numerator / (denominator * distance);
        }
        clear_from(len, &mut weights);
        weights
    }

    /// Adds V/alpha of each edge of the first `len` lanes to `sum`, lane by lane. `outside` as in [`Chunk::weights`].
    #[inline(always)]
    fn add_values(&self, delta_m: f64, len: usize, sum: &mut Lanes, outside: &mut u64) {
        let distances = self.distances();
        let mut values = [0.0; LANES];
        for k in 0..LANES {
            *outside |= u64::from(!(distances[k] > delta_m && distances[k] < f64::INFINITY));
            let s = (distances[k] - delta_m) * self.inverse_k_per_m[k];
            values[k] = tension::value(s, s - tension::REST);
        }
        clear_from(len, &mut values);
        for k in 0..LANES {
            sum[k] += values[k];
        }
    }
}

#[inline(always)]
fn clear_from(len: usize, lanes: &mut Lanes) {
    if len < LANES {
        lanes[len..].fill(0.0);
    }
}

#[inline(always)]
fn total(lanes: Lanes) -> f64 {
    ((lanes[0] + lanes[4]) + (lanes[2] + lanes[6])) + ((lanes[1] + lanes[5]) + (lanes[3] + lanes[7]))
}

#[inline(always)]
fn within(outside: u64) -> Result<(), OutOfDomain> {
    if outside == 0 { Ok(()) } else { Err(OutOfDomain) }
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
