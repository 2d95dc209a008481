//! Extreme eigenvalues of a Laplacian, pinned or not: closed forms of named graphs, a dense solver for small graphs and
//! inverse iteration for large ones.

use std::f64::consts::PI;

use nalgebra::DMatrix;

use super::inverse_iteration::Operator;
use super::{Graph, Pinning};

/// Largest number of vehicles for which all eigenvalues are computed, in O(N^3).
const DENSE_UP_TO: usize = 400;
/// Relative difference below which two eigenvalues count as equal.
const SAME: f64 = 1e-9;

impl Graph {
    /// Returns the algebraic connectivity lambda2, the second smallest eigenvalue of `L_G`. It is positive exactly if
    /// the graph is connected, and 0 for fewer than two vehicles. The value is cached.
    ///
    /// Closed forms exist for complete graphs, stars, rings and paths: N, 1, 2 - 2 cos(2 pi/N), 2 - 2 cos(pi/N). A
    /// disconnected graph has exactly 0. Otherwise a dense solver computes all eigenvalues for up to 400 vehicles.
    /// Beyond, block inverse iteration converges to at most a few parts in 1e9 above lambda2.
    ///
    /// If that takes more than some fifteen seconds (a minute for hundreds of thousands of vehicles), the lower bound
    /// `4/(N (N - 1))` replaces lambda2, and [`Graph::connectivity_is_bound`] returns true.
    #[must_use]
    pub fn algebraic_connectivity(&self) -> f64 {
        self.pinned_connectivity(&Pinning::Unpinned)
    }

    /// Returns the least eigenvalue of the pinned Laplacian M (see [`Pinning`]). It is positive exactly if the graph is
    /// connected and some vehicle is pinned. Without pinning it is the algebraic connectivity. The value of the first
    /// pinning queried is cached.
    ///
    /// Closed forms: 1 if all vehicles are pinned, 1 for a star led from its hub, and any pinning of the complete
    /// graph. Otherwise as [`Graph::algebraic_connectivity`], with the lower bound `1/N^2`.
    #[must_use]
    pub fn pinned_connectivity(&self, pinning: &Pinning) -> f64 {
        if *pinning == Pinning::Unpinned {
            return *self.cache.algebraic.get_or_init(|| self.least_eigenvalue(pinning));
        }
        let (first, least) = self.cache.pinned.get_or_init(|| (pinning.clone(), self.least_eigenvalue(pinning)));
        if first == pinning { *least } else { self.least_eigenvalue(pinning) }
    }

    /// Whether a lower bound replaced a connectivity that was queried before, on this graph or on a copy.
    #[must_use]
    pub fn connectivity_is_bound(&self) -> bool {
        self.cache.bounded.get().is_some()
    }

    fn least_eigenvalue(&self, pinning: &Pinning) -> f64 {
        let fewest = if *pinning == Pinning::Unpinned { 2 } else { 1 };
        if self.count() < fewest || !self.is_connected() {
            return 0.0;
        }
        let degrees = self.degrees();
        if let Some(least) = self.in_closed_form(pinning, &degrees) {
            return least;
        }
        if self.count() <= DENSE_UP_TO {
            let mut eigenvalues = self.pinned_laplacian(pinning).symmetric_eigenvalues().data.as_vec().clone();
            eigenvalues.sort_unstable_by(f64::total_cmp);
            return eigenvalues[usize::from(*pinning == Pinning::Unpinned)];
        }
        self.solved_or_bounded(pinning, &mut Operator::new(self, pinning, &degrees))
    }

    /// Marks the connectivity as a bound, so that tests of reports need no graph that takes half a minute.
    #[doc(hidden)]
    pub fn mark_connectivity_as_bound(&self) {
        self.cache.bounded.get_or_init(|| ());
    }

    fn solved_or_bounded(&self, pinning: &Pinning, operator: &mut Operator<'_>) -> f64 {
        operator.inverse_iteration().unwrap_or_else(|| {
            self.cache.bounded.get_or_init(|| ());
            let count = self.count() as f64;
            if *pinning == Pinning::Unpinned { 4.0 / (count * (count - 1.0)) } else { 1.0 / (count * count) }
        })
    }

    /// Returns the closed form for a connected graph, if there is one.
    fn in_closed_form(&self, pinning: &Pinning, degrees: &[usize]) -> Option<f64> {
        let count = self.count() as f64;
        let most = degrees.iter().copied().max().unwrap_or_default();
        let is_star = self.edge_count() + 1 == self.count() && most == self.edge_count();
        match pinning {
            Pinning::Unpinned if self.is_complete() => Some(count),
            Pinning::Unpinned if is_star => Some(1.0),
            Pinning::Unpinned if most == 2 && self.edge_count() == self.count() => {
                Some(2.0 - 2.0 * libm::cos(2.0 * PI / count))
            }
            Pinning::Unpinned if most == 2 => Some(2.0 - 2.0 * libm::cos(PI / count)),
            Pinning::All => Some(1.0),
            Pinning::Listed(listed) if listed.is_empty() => Some(0.0),
            // The smaller root of x^2 - (N + 1) x + m, without cancellation.
            Pinning::Listed(listed) if self.is_complete() => {
                let (half, pinned) = (0.5 * (count + 1.0), listed.len() as f64);
                Some(pinned / (half + (half * half - pinned).sqrt()))
            }
            // A leader without followers.
            Pinning::Leader(_) if self.count() == 1 => Some(1.0),
            Pinning::Leader(_) if self.is_complete() => Some(1.0),
            &Pinning::Leader(leader) if is_star && degrees[leader] == most => Some(1.0),
            Pinning::Unpinned | Pinning::Listed(_) | Pinning::Leader(_) => None,
        }
    }

    /// Returns M, N x N; with a leader N - 1 x N - 1, without its row and column. Takes 8 N^2 bytes.
    #[must_use]
    pub fn pinned_laplacian(&self, pinning: &Pinning) -> DMatrix<f64> {
        let mut matrix = self.laplacian();
        if let &Pinning::Leader(leader) = pinning {
            return matrix.remove_row(leader).remove_column(leader);
        }
        (0..self.count()).filter(|&i| pinning.pins(i)).for_each(|i| matrix[(i, i)] += 1.0);
        matrix
    }

    /// Returns the distinct relevant eigenvalues of M in ascending order; without pinning the 0 of common motion is
    /// left out. For more than 400 vehicles on an incomplete graph, returns the least one and an upper bound on the
    /// largest. Empty for a disconnected graph.
    #[must_use]
    pub fn pinned_spectrum(&self, pinning: &Pinning) -> Vec<f64> {
        let least = self.pinned_connectivity(pinning);
        if least <= 0.0 {
            return Vec::new();
        }
        let is_dense = self.count() <= DENSE_UP_TO;
        let mut eigenvalues = match pinning {
            Pinning::Unpinned if self.is_complete() => vec![least],
            Pinning::All if self.is_complete() => vec![least, self.count() as f64 + 1.0],
            _ if is_dense => self.pinned_laplacian(pinning).symmetric_eigenvalues().data.as_vec().clone(),
            _ => vec![least, self.largest_eigenvalue_bound(pinning)],
        };
        eigenvalues.sort_unstable_by(f64::total_cmp);
        eigenvalues.retain(|&eigenvalue| eigenvalue >= least * (1.0 - SAME));
        eigenvalues.dedup_by(|next, before| *next <= *before * (1.0 + SAME));
        eigenvalues
    }

    /// Returns the largest eigenvalue of the Laplacian, connected or not; an upper bound for more than 400 vehicles.
    #[must_use]
    pub fn largest_eigenvalue(&self) -> f64 {
        if self.is_complete() || self.count() > DENSE_UP_TO {
            return self.largest_eigenvalue_bound(&Pinning::Unpinned);
        }
        self.laplacian().symmetric_eigenvalues().iter().copied().fold(0.0, f64::max)
    }

    /// Returns the diagonal of M: the degree of each vehicle, plus one if it is pinned; without the entry of a leader.
    #[must_use]
    pub fn pinned_diagonal(&self, pinning: &Pinning) -> Vec<f64> {
        let degree_of = |(i, &degree): (usize, &usize)| degree as f64 + if pinning.pins(i) { 1.0 } else { 0.0 };
        let degrees = self.degrees();
        degrees.iter().enumerate().filter(|&(i, _)| pinning.leader() != Some(i)).map(degree_of).collect()
    }

    /// Returns an upper bound on the largest eigenvalue of M. Without pinning it is N for the complete graph. Otherwise
    /// it is the largest sum of the degrees of two joined vehicles (Anderson and Morley 1985), exact for stars and for
    /// rings of even N. Pinned vehicles add one. With a leader, the bound of the graph without it plus one is used if
    /// it is smaller: 1 for a star led from its hub.
    #[must_use]
    pub fn largest_eigenvalue_bound(&self, pinning: &Pinning) -> f64 {
        let pinned = if matches!(pinning, Pinning::All | Pinning::Listed(_)) { 1.0 } else { 0.0 };
        if self.is_complete() {
            return if self.count() < 2 { pinned } else { self.count() as f64 + pinned };
        }
        let mut degrees = self.degrees();
        let whole = self.edges().map(|(i, j)| degrees[i] + degrees[j]).max().unwrap_or_default() as f64 + pinned;
        let Some(leader) = pinning.leader() else { return whole };
        let leads = |(i, j): &(usize, usize)| *i == leader || *j == leader;
        for (i, j) in self.edges().filter(leads) {
            degrees[i] -= 1;
            degrees[j] -= 1;
        }
        let followers = self.edges().filter(|edge| !leads(edge)).map(|(i, j)| degrees[i] + degrees[j]);
        whole.min(followers.max().unwrap_or_default() as f64 + 1.0)
    }

    /// Number of neighbours of each vehicle.
    pub(super) fn degrees(&self) -> Vec<usize> {
        if self.is_complete() {
            return vec![self.count().saturating_sub(1); self.count()];
        }
        let mut degrees = vec![0; self.count()];
        for (i, j) in self.edges() {
            degrees[i] += 1;
            degrees[j] += 1;
        }
        degrees
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dense(graph: &Graph) -> Vec<f64> {
        let mut eigenvalues = graph.laplacian().symmetric_eigenvalues().data.as_vec().clone();
        eigenvalues.sort_unstable_by(f64::total_cmp);
        eigenvalues
    }

    /// Returns a random tree on `count` vehicles with `extra` more edges.
    fn random(count: usize, extra: usize) -> Graph {
        let mut state = count as u64;
        let mut below = |bound: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % bound
        };
        let mut edges: std::collections::BTreeSet<_> = (1..count).map(|j| (below(j), j)).collect();
        while edges.len() < count - 1 + extra {
            let (i, j) = (below(count), below(count));
            if i != j {
                edges.insert((i.min(j), i.max(j)));
            }
        }
        Graph::from_edges(count, &edges.into_iter().collect::<Vec<_>>()).expect("a graph")
    }

    #[test]
    fn closed_forms_match_the_eigenvalues_of_the_matrix() {
        for count in 2..12 {
            for graph in [Graph::complete(count), Graph::star(count), Graph::ring(count), Graph::path(count)] {
                let eigenvalues = dense(&graph);
                let found = graph.algebraic_connectivity();
                assert!((found - eigenvalues[1]).abs() < 1e-13 * count as f64, "{count}: {found}, {}", eigenvalues[1]);
                let (bound, largest) = (graph.largest_eigenvalue_bound(&Pinning::Unpinned), eigenvalues[count - 1]);
                assert!(bound >= largest * (1.0 - 1e-12), "{count}: {bound}, {largest}");
            }
        }
        // A star about another hub is a star.
        let hub = Graph::from_edges(5, &[(2, 0), (2, 1), (2, 3), (2, 4)]).expect("a graph");
        assert_eq!((hub.algebraic_connectivity(), hub.largest_eigenvalue_bound(&Pinning::Unpinned)), (1.0, 5.0));
        let apart = Graph::from_edges(4, &[(0, 1), (2, 3)]).expect("a graph");
        assert_eq!(apart.algebraic_connectivity(), 0.0);
    }

    #[test]
    fn connectivity_of_a_large_general_graph_matches_the_dense_solver() {
        for (count, extra) in [(450, 0), (450, 60), (450, 900)] {
            let graph = random(count, extra);
            let eigenvalues = dense(&graph);
            let found = graph.algebraic_connectivity();
            let off = found / eigenvalues[1] - 1.0;
            assert!((-1e-9..1e-8).contains(&off), "{extra}: {found} instead of {}", eigenvalues[1]);
            assert!(graph.largest_eigenvalue_bound(&Pinning::Unpinned) >= eigenvalues[count - 1]);
        }
    }

    /// Pinnings other than none, which other tests cover.
    fn pinnings(count: usize) -> Vec<Pinning> {
        vec![
            Pinning::All,
            Pinning::Listed(vec![count / 2]),
            Pinning::Listed(vec![0, count - 1]),
            Pinning::Leader(0),
            Pinning::Leader(count - 1),
        ]
    }

    fn least(graph: &Graph, pinning: &Pinning) -> f64 {
        graph.pinned_laplacian(pinning).symmetric_eigenvalues().min()
    }

    #[test]
    fn pinned_connectivity_matches_the_dense_solver() {
        for count in 2..12 {
            for graph in [Graph::complete(count), Graph::star(count), Graph::ring(count), Graph::path(count)] {
                for pinning in pinnings(count) {
                    let (found, expected) = (graph.pinned_connectivity(&pinning), least(&graph, &pinning));
                    assert!(
                        (found - expected).abs() < 1e-12 * count as f64,
                        "{count} {pinning:?}: {found}, {expected}"
                    );
                    let largest = graph.pinned_laplacian(&pinning).symmetric_eigenvalues().max();
                    assert!(graph.largest_eigenvalue_bound(&pinning) >= largest * (1.0 - 1e-12), "{count} {pinning:?}");
                }
            }
        }
        assert_eq!(Graph::ring(5).pinned_connectivity(&Pinning::Listed(Vec::new())), 0.0);
        let apart = Graph::from_edges(4, &[(0, 1), (2, 3)]).expect("a graph");
        assert_eq!(apart.pinned_connectivity(&Pinning::All), 0.0);
        let star = Graph::star(9);
        let bounds = [Pinning::Leader(0), Pinning::Leader(3), Pinning::All].map(|p| star.largest_eigenvalue_bound(&p));
        assert_eq!(bounds, [1.0, 9.0, 10.0], "followers of a leader at the hub have no other neighbour");
    }

    #[test]
    fn a_lower_bound_replaces_the_connectivity_at_the_work_limit() {
        let graph = random(420, 0);
        let exact = graph.algebraic_connectivity();
        assert!(!graph.connectivity_is_bound());
        let mut exhausted = Operator::new(&graph, &Pinning::Unpinned, &graph.degrees());
        exhausted.exhaust();
        let copy = graph.clone();
        let bound = copy.solved_or_bounded(&Pinning::Unpinned, &mut exhausted);
        assert!(0.0 < bound && bound <= exact && graph.connectivity_is_bound(), "{bound} {exact}");
        let (leader, exact) = (Pinning::Leader(7), least(&graph, &Pinning::Leader(7)));
        let mut exhausted = Operator::new(&graph, &leader, &graph.degrees());
        exhausted.exhaust();
        let bound = graph.solved_or_bounded(&leader, &mut exhausted);
        assert!(0.0 < bound && bound <= exact, "{bound} {exact}");
    }

    #[test]
    fn connectivity_of_large_pinned_graphs_matches_the_dense_solver() {
        let graph = random(420, 60);
        for pinning in [Pinning::Listed(vec![3, 200, 400]), Pinning::Leader(7)] {
            let (found, expected) = (graph.pinned_connectivity(&pinning), least(&graph, &pinning));
            let off = found / expected - 1.0;
            assert!((-1e-9..1e-8).contains(&off), "{pinning:?}: {found} instead of {expected}");
        }
    }
}
