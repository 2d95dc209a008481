//! Communication graphs: undirected simple graphs over the vehicles of a swarm, and the spectra of their Laplacians.
//!
//! The laws sum over the neighbours j in `N_i` of vehicle i. Their guarantees depend on the graph's Laplacian `L_G` and
//! on its algebraic connectivity, the second smallest eigenvalue of `L_G`.

mod inverse_iteration;
mod pinning;
mod random;
mod spectrum;
mod tree;

use std::ops::Range;
use std::sync::{Arc, OnceLock};

use nalgebra::DMatrix;

use tautline_core::swarm::Pair;

pub use pinning::Pinning;

/// An undirected graph without self-loops on the vehicles 0..N.
///
/// The complete graph takes no memory for its edges. Any other graph stores for each vehicle its neighbours of higher
/// index in ascending order, so every edge is listed once, in row order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Graph {
    count: usize,
    edges: Edges,
    cache: Arc<EigenvalueCache>,
}

/// Cache of eigenvalues, shared by copies of a graph and ignored by comparisons.
#[derive(Debug, Default)]
struct EigenvalueCache {
    algebraic: OnceLock<f64>,
    /// Value of the first pinning that was queried.
    pinned: OnceLock<(Pinning, f64)>,
    /// Set if a lower bound replaces one of the values.
    bounded: OnceLock<()>,
}

impl PartialEq for EigenvalueCache {
    fn eq(&self, _other: &Self) -> bool {
        true
    }
}

impl Eq for EigenvalueCache {}

#[derive(Clone, Debug, PartialEq, Eq)]
enum Edges {
    All,
    /// The later neighbours of vehicle i are `neighbours[offsets[i]..offsets[i + 1]]`.
    Listed {
        offsets: Vec<usize>,
        neighbours: Vec<usize>,
    },
}

/// Neighbours of a vehicle with a higher index than its own, in ascending order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LaterNeighbours<'a> {
    /// Every later vehicle: the graph is complete.
    All(Range<usize>),
    /// The listed vehicles.
    Listed(&'a [usize]),
}

impl Iterator for LaterNeighbours<'_> {
    type Item = usize;

    fn next(&mut self) -> Option<usize> {
        match self {
            Self::All(range) => range.next(),
            Self::Listed(listed) => {
                let (&first, rest) = listed.split_first()?;
                *listed = rest;
                Some(first)
            }
        }
    }
}

/// Reason why a list of edges is not a simple graph. Messages count edges and vehicles from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GraphError {
    /// An edge joins a vehicle to itself.
    #[error("edge {} joins vehicle {} to itself", edge + 1, vehicle + 1)]
    SelfLoop {
        /// Index in the list, from 0.
        edge: usize,
        /// The vehicle, from 0.
        vehicle: usize,
    },
    /// An edge names a vehicle that the swarm does not have.
    #[error("edge {} names vehicle {}, but the swarm has {count}", edge + 1, *vehicle as u128 + 1)]
    OutOfRange {
        /// Index in the list, from 0.
        edge: usize,
        /// The vehicle, from 0.
        vehicle: usize,
        /// Number of vehicles.
        count: usize,
    },
    /// An edge is listed twice, in either direction.
    #[error("edge {} joins vehicles {pair:#} a second time", edge + 1)]
    Duplicate {
        /// Index of the repetition in the list, from 0.
        edge: usize,
        /// The two vehicles.
        pair: Pair,
    },
}

impl Graph {
    /// Returns the complete graph: every pair of vehicles is joined.
    #[must_use]
    pub fn complete(count: usize) -> Self {
        Self { count, edges: Edges::All, cache: Arc::default() }
    }

    /// Returns the star about vehicle 0: it is joined to all others, and they are not joined to each other.
    #[must_use]
    pub fn star(count: usize) -> Self {
        Self::star_about(count, 0)
    }

    /// Returns the star about the vehicle `hub`.
    ///
    /// # Panics
    /// If `count` > 0 and the hub is out of range.
    #[must_use]
    pub fn star_about(count: usize, hub: usize) -> Self {
        assert!(count == 0 || hub < count, "the hub is one of the vehicles");
        Self::from_sorted(count, (0..hub).map(|i| (i, hub)).chain((hub + 1..count).map(|j| (hub, j))))
    }

    /// Returns the ring: each vehicle is joined to the one before and the one after it, and the last to the first.
    #[must_use]
    pub fn ring(count: usize) -> Self {
        if count < 4 {
            return Self::complete(count);
        }
        let closing = std::iter::once((0, count - 1));
        Self::from_sorted(count, std::iter::once((0, 1)).chain(closing).chain((2..count).map(|j| (j - 1, j))))
    }

    /// Returns the path: each vehicle is joined to the one before and the one after it.
    #[must_use]
    pub fn path(count: usize) -> Self {
        Self::from_sorted(count, (1..count).map(|j| (j - 1, j)))
    }

    /// Returns the graph on `count` vehicles with the given edges (vehicles from 0, either end first, in any order).
    ///
    /// # Errors
    /// [`GraphError`] for the first self-loop, vehicle out of range or repeated edge in the list.
    pub fn from_edges(count: usize, edges: &[(usize, usize)]) -> Result<Self, GraphError> {
        for (edge, &(a, b)) in edges.iter().enumerate() {
            if let Some(vehicle) = [a, b].into_iter().find(|&vehicle| vehicle >= count) {
                return Err(GraphError::OutOfRange { edge, vehicle, count });
            }
            if a == b {
                return Err(GraphError::SelfLoop { edge, vehicle: a });
            }
        }
        let mut sorted: Vec<_> = edges.iter().enumerate().map(|(edge, &(a, b))| (a.min(b), a.max(b), edge)).collect();
        sorted.sort_unstable();
        let repeated = sorted.windows(2).filter(|w| (w[0].0, w[0].1) == (w[1].0, w[1].1)).min_by_key(|w| w[1].2);
        if let Some(&[_, (i, j, edge)]) = repeated {
            return Err(GraphError::Duplicate { edge, pair: Pair::new(i, j) });
        }
        Ok(Self::from_sorted(count, sorted.into_iter().map(|(i, j, _)| (i, j))))
    }

    /// Builds the graph from distinct edges i < j in row order.
    fn from_sorted(count: usize, edges: impl Iterator<Item = (usize, usize)>) -> Self {
        let mut offsets = vec![0; count + 1];
        let neighbours: Vec<_> = edges
            .map(|(i, j)| {
                offsets[i + 1] += 1;
                j
            })
            .collect();
        if neighbours.len() == pair_count(count) {
            return Self::complete(count);
        }
        for i in 0..count {
            offsets[i + 1] += offsets[i];
        }
        Self { count, edges: Edges::Listed { offsets, neighbours }, cache: Arc::default() }
    }

    /// Number of vehicles N.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// Number of edges, each counted once.
    #[must_use]
    pub fn edge_count(&self) -> usize {
        match &self.edges {
            Edges::All => pair_count(self.count),
            Edges::Listed { neighbours, .. } => neighbours.len(),
        }
    }

    /// Whether every pair of vehicles is joined, also if the graph was built from a list.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        matches!(self.edges, Edges::All)
    }

    /// Returns the neighbours of vehicle `i` with higher indices; none for a vehicle out of range.
    #[must_use]
    pub fn later_neighbours(&self, i: usize) -> LaterNeighbours<'_> {
        match &self.edges {
            Edges::All => LaterNeighbours::All(i.saturating_add(1).min(self.count)..self.count),
            Edges::Listed { offsets, neighbours } => match offsets.get(i..).unwrap_or_default() {
                &[from, to, ..] => LaterNeighbours::Listed(&neighbours[from..to]),
                _ => LaterNeighbours::Listed(&[]),
            },
        }
    }

    /// Whether two vehicles are joined; false for i = j.
    #[must_use]
    pub fn has_edge(&self, i: usize, j: usize) -> bool {
        match self.later_neighbours(i.min(j)) {
            LaterNeighbours::All(later) => later.contains(&i.max(j)),
            LaterNeighbours::Listed(later) => later.binary_search(&i.max(j)).is_ok(),
        }
    }

    /// Returns every edge once, as (i, j) with i < j, in row order.
    pub fn edges(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        (0..self.count).flat_map(|i| self.later_neighbours(i).map(move |j| (i, j)))
    }

    /// Whether a path joins every pair of vehicles. A graph with at most one vehicle is connected.
    #[must_use]
    pub fn is_connected(&self) -> bool {
        self.components() <= 1
    }

    /// Number of connected components.
    #[must_use]
    pub fn components(&self) -> usize {
        let roots = self.component_roots();
        roots.iter().enumerate().filter(|&(i, &root)| i == root).count()
    }

    /// Returns the vehicles that no path joins to vehicle 0.
    #[must_use]
    pub fn unreachable(&self) -> Vec<usize> {
        self.component_roots().iter().enumerate().filter(|&(_, &root)| root != 0).map(|(i, _)| i).collect()
    }

    /// Returns for each vehicle the lowest vehicle of its component, by union-find with path halving.
    fn component_roots(&self) -> Vec<usize> {
        fn root(parents: &mut [usize], mut i: usize) -> usize {
            while parents[i] != i {
                parents[i] = parents[parents[i]];
                i = parents[i];
            }
            i
        }
        if self.is_complete() {
            return vec![0; self.count];
        }
        let mut parents: Vec<_> = (0..self.count).collect();
        for (i, j) in self.edges() {
            let (a, b) = (root(&mut parents, i), root(&mut parents, j));
            parents[a.max(b)] = a.min(b);
        }
        for i in 0..self.count {
            parents[i] = root(&mut parents, i);
        }
        parents
    }

    /// Returns the Laplacian `L_G`, N x N: degrees on the diagonal, -1 for each edge. Takes 8 N^2 bytes.
    #[must_use]
    pub fn laplacian(&self) -> DMatrix<f64> {
        self.weighted_laplacian(|_, _| 1.0)
    }

    /// Returns the weighted Laplacian `L_w`, N x N. `weight(i, j)` is called once for each edge i < j, in row order;
    /// weights may be negative. Takes 8 N^2 bytes.
    #[must_use]
    pub fn weighted_laplacian(&self, mut weight: impl FnMut(usize, usize) -> f64) -> DMatrix<f64> {
        let mut laplacian = DMatrix::zeros(self.count, self.count);
        for (i, j) in self.edges() {
            let w = weight(i, j);
            laplacian[(i, j)] = -w;
            laplacian[(j, i)] = -w;
            laplacian[(i, i)] += w;
            laplacian[(j, j)] += w;
        }
        laplacian
    }
}

/// Returns N (N - 1) / 2, saturating.
fn pair_count(count: usize) -> usize {
    let pairs = count as u128 * count.saturating_sub(1) as u128 / 2;
    usize::try_from(pairs).unwrap_or(usize::MAX)
}

#[cfg(test)]
mod tests;
