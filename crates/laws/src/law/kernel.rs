//! Edge-tension sums over all edges, in blocks that fill the lanes of vector instructions.
//!
//! The loops over edges contain only IEEE additions, multiplications, divisions, square roots and selections. The
//! compiler turns them into the vector instructions detected at run time. No operation is fused or reordered, and the
//! edges alone fix the order of sums. The bits therefore depend neither on the vector width nor on the optimisation
//! level.
#![expect(clippy::inline_always, reason = "only inlined code is compiled for the instructions detected at run time")]

mod block;

use std::collections::TryReserveError;
use std::ops::Range;

use pulp::{Simd, WithSimd};
use rayon::iter::{IndexedParallelIterator as _, IntoParallelRefMutIterator as _, ParallelIterator as _};

use self::block::{Block, Ends, LANES, PADDING_M, add_pulls, total};
use super::tension::OutOfDomain;
use crate::graph::Graph;
use tautline_core::swarm::{Rows, columns, columns_mut};

/// Up to this number of vehicles the complete graph is stored as a list of edges, because short rows leave lanes empty.
/// The order of sums differs, so this number affects the last bits of results.
const LISTED_UP_TO: usize = 16;
/// From this number of vehicles all threads share the rows of the complete graph, in bands. Sums in bands differ from
/// sums in rows in their last bits, so this number affects the last bits of results.
const BANDED_FROM: usize = 640;
/// Number of bands, and the largest number of threads with work. All bands have about the same number of edges.
const BANDS: usize = 16;
/// Edges per block of a row: large enough to change stages seldom, small enough for the processor's first-level cache.
const ROW_BLOCK: usize = 16 * LANES;
/// Edges per block of a list: small, because lists are often short and each block is cleared first.
const LIST_BLOCK: usize = 2 * LANES;

/// Edges of a graph with the inverse length scale of each.
#[derive(Clone, Debug)]
pub(super) struct Kernel {
    delta_m: f64,
    /// Number of edges.
    edges: usize,
    /// 1/K of each edge in row order, padded to whole lanes.
    inverse_k_per_m: Vec<f64>,
    /// Rows of the complete graph; `None` if edges are listed.
    bands: Option<Bands>,
    list: Vec<[usize; 2]>,
    arch: pulp::Arch,
}

impl Kernel {
    /// Builds the kernel of a graph with 1/K still unset. Fails if the edges do not fit in memory.
    pub(super) fn new(graph: &Graph, delta_m: f64) -> Result<Self, TryReserveError> {
        let (count, edges) = (graph.count(), graph.edge_count());
        let mut inverse_k_per_m = Vec::new();
        inverse_k_per_m.try_reserve_exact(edges + LANES)?;
        inverse_k_per_m.resize(edges, f64::NAN);
        inverse_k_per_m.resize(edges + LANES, 1.0);
        let is_listed = !graph.is_complete() || count <= LISTED_UP_TO;
        let bands = if count < BANDED_FROM { 1 } else { BANDS };
        Ok(Self {
            delta_m,
            edges,
            inverse_k_per_m,
            bands: (!is_listed).then(|| Bands::new(count, bands, LANES, PADDING_M)),
            list: if is_listed { graph.edges().map(|(i, j)| [i, j]).collect() } else { Vec::new() },
            arch: pulp::Arch::new(),
        })
    }

    /// 1/K of each edge in row order \[1/m\].
    pub(super) fn inverse_k_per_m_mut(&mut self) -> &mut [f64] {
        &mut self.inverse_k_per_m[..self.edges]
    }

    /// Adds `(1/alpha) sum_j w_ij (p_i - p_j)` over the neighbours j of each vehicle i to row i of `sums` \[1/m\].
    /// Returns (1/alpha) times the sum of V over all edges, which is almost free here. Both tables have one row per
    /// vehicle.
    pub(super) fn add_pulls(&mut self, positions_m: &Rows, sums: &mut Rows) -> Result<f64, OutOfDomain> {
        let mut bands = self.bands.take();
        let potential = self.add_pulls_in(bands.as_mut(), positions_m, sums);
        self.bands = bands;
        potential
    }

    /// Returns (1/alpha) times the sum of V over all edges.
    pub(super) fn potential(&self, positions_m: &Rows) -> Result<f64, OutOfDomain> {
        self.add_pulls_in(self.bands.clone().as_mut(), positions_m, &mut Rows::zeros(positions_m.nrows()))
    }

    fn add_pulls_in(&self, bands: Option<&mut Bands>, positions_m: &Rows, sums: &mut Rows) -> Result<f64, OutOfDomain> {
        let (axes, sums) = (columns(positions_m), columns_mut(sums));
        match bands {
            Some(bands) => bands.add_to(axes, sums, |rows, axes, sums| {
                self.arch.dispatch(AddRows { kernel: self, count: positions_m.nrows(), rows, axes, sums })
            }),
            None => self.arch.dispatch(AddList { kernel: self, axes, sums }),
        }
    }
}

/// Adds the pulls of the edges from a range of rows of the complete graph to later rows.
struct AddRows<'a> {
    kernel: &'a Kernel,
    count: usize,
    rows: Range<usize>,
    /// Positions along each axis; [`PADDING_M`] in the padding lanes.
    axes: [&'a [f64]; 3],
    /// Sums along each axis from the first of the rows on, padded to whole lanes.
    sums: [&'a mut [f64]; 3],
}

impl WithSimd for AddRows<'_> {
    type Output = Result<f64, OutOfDomain>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Self { kernel, count, rows, axes: [x, y, z], sums: [of_x, of_y, of_z] } = self;
        let mut block = Block::<ROW_BLOCK>::new(kernel.delta_m);
        let start = rows.start;
        let mut edge = start * (2 * count - start).saturating_sub(1) / 2;
        for i in start..rows.end {
            let own = [x[i], y[i], z[i]];
            let mut of_own = [[0.0; LANES]; 3];
            let mut j = i + 1;
            while j < count {
                let edges = ROW_BLOCK.min(count - j);
                let lanes = edges.next_multiple_of(LANES);
                let ends = Ends {
                    count: edges,
                    inverse_k_per_m: &kernel.inverse_k_per_m[edge..edge + lanes],
                    positions_m: [&x[j..j + lanes], &y[j..j + lanes], &z[j..j + lanes]],
                };
                let weights = block.weights(own, &ends);
                let (from, to) = (j - start, j - start + lanes);
                let sums = [&mut of_x[from..to], &mut of_y[from..to], &mut of_z[from..to]];
                for (axis, sums) in sums.into_iter().enumerate() {
                    add_pulls(simd, own[axis], ends.positions_m[axis], weights, sums, &mut of_own[axis]);
                }
                edge += edges;
                j += edges;
            }
            of_x[i - start] += total(of_own[0]);
            of_y[i - start] += total(of_own[1]);
            of_z[i - start] += total(of_own[2]);
        }
        block.finish()
    }
}

/// Adds the pulls of all listed edges.
struct AddList<'a> {
    kernel: &'a Kernel,
    axes: [&'a [f64]; 3],
    sums: [&'a mut [f64]; 3],
}

impl WithSimd for AddList<'_> {
    type Output = Result<f64, OutOfDomain>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _simd: S) -> Self::Output {
        let Self { kernel, axes, sums } = self;
        let mut block = Block::<LIST_BLOCK>::new(kernel.delta_m);
        let mut first = 0;
        while first < kernel.list.len() {
            let list = &kernel.list[first..kernel.list.len().min(first + LIST_BLOCK)];
            // Each edge begins at the origin and ends at the position of its second vehicle relative to its first.
            let mut ends_m = [[PADDING_M; LIST_BLOCK]; 3];
            for axis in 0..3 {
                for k in 0..list.len() {
                    ends_m[axis][k] = axes[axis][list[k][1]] - axes[axis][list[k][0]];
                }
            }
            let lanes = list.len().next_multiple_of(LANES);
            let ends = Ends {
                count: list.len(),
                inverse_k_per_m: &kernel.inverse_k_per_m[first..first + lanes],
                positions_m: ends_m.each_ref().map(|axis| &axis[..lanes]),
            };
            let weights = block.weights([0.0; 3], &ends);
            for axis in 0..3 {
                for k in 0..list.len() {
                    let pull = (0.0 - ends_m[axis][k]) * weights[k];
                    sums[axis][list[k][0]] += pull;
                    sums[axis][list[k][1]] -= pull;
                }
            }
            first += list.len();
        }
        block.finish()
    }
}

/// Bands of rows of the complete graph, with a buffer for the sums of each band and a shared copy of the positions.
/// Takes 48 bytes per vehicle for one band, some 290 for 16.
#[derive(Clone, Debug)]
pub(super) struct Bands {
    /// Positions along each axis \[m\], followed by padding entries at one common place.
    axes: [Vec<f64>; 3],
    bands: Vec<Band>,
}

#[derive(Clone, Debug)]
struct Band {
    rows: Range<usize>,
    /// Sums along each axis over the edges of the band, for every vehicle from its first row on.
    sums: [Vec<f64>; 3],
    potential: Result<f64, OutOfDomain>,
}

impl Bands {
    /// Builds `bands` bands of `count` vehicles, with `room` padding entries at `beyond_m`. The number of bands fixes
    /// the order of all sums, independent of the number of threads.
    pub(super) fn new(count: usize, bands: usize, room: usize, beyond_m: f64) -> Self {
        // The rows from r on have about (N - r)^2/2 edges.
        let start = |band: usize| count - (count * count * (bands - band) / bands).isqrt();
        let band = |k: usize| {
            let rows = start(k)..if k + 1 == bands { count } else { start(k + 1) };
            let sums = [(); 3].map(|()| vec![0.0; count - rows.start + room]);
            Band { rows, sums, potential: Ok(0.0) }
        };
        Self { axes: [(); 3].map(|()| vec![beyond_m; count + room]), bands: (0..bands).map(band).collect() }
    }

    /// Evaluates every band once, in parallel if there are threads. `evaluate` receives a range of rows, the padded
    /// positions and padded sums that begin at the first of these rows. It adds the pulls of these rows to the sums and
    /// returns their potential. Adds all bands to `sums` in order, so the bits are the same for any number of threads.
    /// Returns the sum of the potentials.
    pub(super) fn add_to(
        &mut self,
        axes: [&[f64]; 3],
        mut sums: [&mut [f64]; 3],
        evaluate: impl Fn(Range<usize>, [&[f64]; 3], [&mut [f64]; 3]) -> Result<f64, OutOfDomain> + Sync,
    ) -> Result<f64, OutOfDomain> {
        for (own, axis) in self.axes.iter_mut().zip(axes) {
            own[..axis.len()].copy_from_slice(axis);
        }
        let axes = self.axes.each_ref().map(Vec::as_slice);
        let of_band = |band: &mut Band| {
            band.sums.iter_mut().for_each(|sums| sums.fill(0.0));
            band.potential = evaluate(band.rows.clone(), axes, band.sums.each_mut().map(Vec::as_mut_slice));
        };
        if self.bands.len() > 1 && rayon::current_num_threads() > 1 {
            self.bands.par_iter_mut().with_max_len(1).for_each(of_band);
        } else {
            self.bands.iter_mut().for_each(of_band);
        }
        for band in &self.bands {
            for (sums, of_band) in sums.iter_mut().zip(&band.sums) {
                sums[band.rows.start..].iter_mut().zip(of_band).for_each(|(sum, add)| *sum += add);
            }
        }
        self.bands.iter().map(|band| band.potential).sum()
    }
}

#[cfg(test)]
mod tests;
