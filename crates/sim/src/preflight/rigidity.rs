//! Infinitesimal rigidity: whether the edges' lengths hold a formation to first order.

use nalgebra::DMatrix;
use serde::Serialize;

use tautline_core::swarm::row;
use tautline_laws::formation::Formation;
use tautline_laws::graph::Graph;

/// Offsets below this share of the extent do not make a start or a formation leave its line or plane: far above rounding
/// (1e-16), far below any offset that is meant.
pub const FLATNESS: f64 = 1e-9;

/// Most vehicles for which the rank is computed on a graph that is not complete, at O((3 N)^3): a second or two.
pub const MOST_RANKED: usize = 200;

/// Eigenvalues of R^T R above this part of the largest one count towards the rank. Rounding leaves up to 1e-13 of it in
/// the rigid motions at [`MOST_RANKED`]; a mode that is held 1e11 times more softly than another is not held in any
/// flight.
pub const RANK_TOLERANCE: f64 = 1e-11;

/// Infinitesimal rigidity of a formation on its graph.
///
/// Row (i, j) of the rigidity matrix R is the unit vector along that edge in the columns of i and its opposite in those
/// of j: R times the velocities of the slots is the rate of the edges' lengths. The formation is rigid where only rigid
/// motions keep all lengths, that is where the rank of R is as large as that of all pairs. Then the law's stiffness
/// matrix R^T diag(V'') R / N at the formation has no zero mode but these, and the formation is approached
/// exponentially; otherwise only algebraically, if at all.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Rigidity {
    /// Rank of R, the same in the plane and in space; null for a graph of more than [`MOST_RANKED`] vehicles that is not
    /// complete.
    pub rank: Option<usize>,
    /// Rank of a rigid formation: n N - n (n + 1)/2 in n dimensions, N (N - 1)/2 for N <= n vehicles.
    pub needed: usize,
    /// Whether the rank is the one needed; null where it cannot be told.
    pub rigid: Option<bool>,
    #[serde(skip)]
    pub(super) edges: usize,
}

impl Rigidity {
    /// Of a formation in a space of n = `dimensions`.
    ///
    /// On the complete graph the rank follows from the flat of dimension k that the slots span: k N - k (k + 1)/2. On
    /// another graph it is counted from the eigenvalues of R^T R; one with fewer edges than needed is not rigid
    /// whatever its rank is.
    #[must_use]
    pub fn of(formation: &Formation, graph: &Graph, dimensions: usize) -> Self {
        let count = formation.count();
        let rank = if graph.is_complete() {
            Some(needed(count, formation.affine_dimension(FLATNESS)))
        } else if count <= MOST_RANKED {
            Some(rank(formation, graph))
        } else {
            None
        };
        Self { rank, needed: 0, rigid: None, edges: graph.edge_count() }.within(dimensions, count)
    }

    /// The same formation of `count` vehicles judged in a space (or in its own flat) of another dimension.
    #[must_use]
    pub fn within(self, dimensions: usize, count: usize) -> Self {
        let needed = needed(count, dimensions);
        let too_few_edges = (self.edges < needed).then_some(false);
        Self { needed, rigid: self.rank.map_or(too_few_edges, |rank| Some(rank >= needed)), ..self }
    }
}

/// Rank of the rigidity matrix of all pairs of `count` points that span `dimensions`.
fn needed(count: usize, dimensions: usize) -> usize {
    if count <= dimensions {
        count * count.saturating_sub(1) / 2
    } else {
        dimensions * count - dimensions * (dimensions + 1) / 2
    }
}

pub(super) fn rank(formation: &Formation, graph: &Graph) -> usize {
    let count = formation.count();
    let mut gram = DMatrix::zeros(3 * count, 3 * count);
    for (i, j) in graph.edges() {
        let along = (row(&formation.slots_m, j) - row(&formation.slots_m, i)).normalize();
        let block = along * along.transpose();
        for (a, b, sign) in [(i, i, 1.0), (j, j, 1.0), (i, j, -1.0), (j, i, -1.0)] {
            let mut view = gram.fixed_view_mut::<3, 3>(3 * a, 3 * b);
            view += block * sign;
        }
    }
    if !gram.iter().all(|x: &f64| x.is_finite()) {
        return 0;
    }
    let eigenvalues = gram.symmetric_eigenvalues();
    let largest = eigenvalues.amax();
    eigenvalues.iter().filter(|&&value| value > RANK_TOLERANCE * largest).count()
}
