//! The ends of the spectrum of a Laplacian, pinned or not: in closed form where the graph has a name, without a matrix
//! where it is large.

use std::f64::consts::PI;

use nalgebra::DMatrix;

use super::inverse_iteration::Operator;
use super::{Graph, Pinning};

/// Up to here all eigenvalues are computed, in O(N^3).
const DENSE_UP_TO: usize = 400;
/// Relative difference of eigenvalues that are the same one.
const SAME: f64 = 1e-9;

impl Graph {
    /// The algebraic connectivity lambda2, the second smallest eigenvalue of `L_G`: positive exactly where the graph is
    /// connected, and 0 for fewer than two vehicles. Computed once.
    ///
    /// In closed form for complete graphs, stars, rings and paths (N, 1, 2 - 2 cos(2 pi/N), 2 - 2 cos(pi/N)), however the
    /// graph was made, and exactly 0 for a disconnected one. Otherwise all eigenvalues are computed for up to 400 vehicles;
    /// beyond, inverse iteration on a block of vectors, with conjugate gradients in the place of a matrix, led by a spanning
    /// tree where the graph is long and thin, or hardly more than a tree. That ends at most a few parts in 1e9 above lambda2. Where it
    /// would take more than some fifteen seconds (a minute of hundreds of thousands of vehicles), the bound from below `4/(N (N - 1))` stands in for lambda2, which
    /// [`Graph::connectivity_is_bound`] tells.
    #[must_use]
    pub fn algebraic_connectivity(&self) -> f64 {
        self.pinned_connectivity(&Pinning::Nobody)
    }

    /// The least eigenvalue of the pinned Laplacian M (see [`Pinning`]): positive exactly where the graph is connected and
    /// somebody is pinned, with the algebraic connectivity in its place where nobody is. Computed once for each pinning that
    /// is asked for first.
    ///
    /// In closed form where all are pinned (1), on the complete graph, and for a star led from its middle (1); otherwise as
    /// [`Graph::algebraic_connectivity`], with `1/N^2` as the bound from below.
    #[must_use]
    pub fn pinned_connectivity(&self, pinning: &Pinning) -> f64 {
        if *pinning == Pinning::Nobody {
            return *self.known.algebraic.get_or_init(|| self.least_eigenvalue(pinning));
        }
        let (first, least) = self.known.pinned.get_or_init(|| (pinning.clone(), self.least_eigenvalue(pinning)));
        if first == pinning { *least } else { self.least_eigenvalue(pinning) }
    }

    /// Whether a bound from below stood in for a connectivity that was asked for up to now, of this graph or of a copy of it.
    #[must_use]
    pub fn connectivity_is_bound(&self) -> bool {
        self.known.bounded.get().is_some()
    }

    fn least_eigenvalue(&self, pinning: &Pinning) -> f64 {
        let fewest = if *pinning == Pinning::Nobody { 2 } else { 1 };
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
            return eigenvalues[usize::from(*pinning == Pinning::Nobody)];
        }
        self.solved_or_bounded(pinning, &mut Operator::new(self, pinning, &degrees))
    }

    /// Marks the connectivity as a bound: tests of what reports a bound need no graph that takes half a minute.
    #[doc(hidden)]
    pub fn pretend_a_bound(&self) {
        self.known.bounded.get_or_init(|| ());
    }

    fn solved_or_bounded(&self, pinning: &Pinning, operator: &mut Operator<'_>) -> f64 {
        operator.inverse_iteration().unwrap_or_else(|| {
            self.known.bounded.get_or_init(|| ());
            let count = self.count() as f64;
            if *pinning == Pinning::Nobody { 4.0 / (count * (count - 1.0)) } else { 1.0 / (count * count) }
        })
    }

    /// Of a connected graph.
    fn in_closed_form(&self, pinning: &Pinning, degrees: &[usize]) -> Option<f64> {
        let count = self.count() as f64;
        let most = degrees.iter().copied().max().unwrap_or_default();
        let is_star = self.edge_count() + 1 == self.count() && most == self.edge_count();
        match pinning {
            Pinning::Nobody if self.is_complete() => Some(count),
            Pinning::Nobody if is_star => Some(1.0),
            Pinning::Nobody if most == 2 && self.edge_count() == self.count() => {
                Some(2.0 - 2.0 * libm::cos(2.0 * PI / count))
            }
            Pinning::Nobody if most == 2 => Some(2.0 - 2.0 * libm::cos(PI / count)),
            Pinning::All => Some(1.0),
            Pinning::Listed(listed) if listed.is_empty() => Some(0.0),
            // The smaller root of x^2 - (N + 1) x + m, without cancellation.
            Pinning::Listed(listed) if self.is_complete() => {
                let (half, pinned) = (0.5 * (count + 1.0), listed.len() as f64);
                Some(pinned / (half + (half * half - pinned).sqrt()))
            }
            // A leader alone has nobody to lead.
            Pinning::Leader(_) if self.count() == 1 => Some(1.0),
            Pinning::Leader(_) if self.is_complete() => Some(1.0),
            &Pinning::Leader(leader) if is_star && degrees[leader] == most => Some(1.0),
            Pinning::Nobody | Pinning::Listed(_) | Pinning::Leader(_) => None,
        }
    }

    /// M as a matrix, N x N; without the leader's row and column, N - 1 x N - 1, where there is one. Takes 8 N^2 bytes.
    #[must_use]
    pub fn pinned_laplacian(&self, pinning: &Pinning) -> DMatrix<f64> {
        let mut matrix = self.laplacian();
        if let &Pinning::Leader(leader) = pinning {
            return matrix.remove_row(leader).remove_column(leader);
        }
        (0..self.count()).filter(|&i| pinning.pins(i)).for_each(|i| matrix[(i, i)] += 1.0);
        matrix
    }

    /// The eigenvalues of M that count: all different ones but the 0 of common motion where nobody is pinned, in ascending
    /// order. For more than 400 vehicles on a graph that is not complete, the least of them and a bound on the largest, between
    /// which the others are. None of a graph that is not connected.
    #[must_use]
    pub fn pinned_spectrum(&self, pinning: &Pinning) -> Vec<f64> {
        let least = self.pinned_connectivity(pinning);
        if least <= 0.0 {
            return Vec::new();
        }
        let is_dense = self.count() <= DENSE_UP_TO;
        let mut eigenvalues = match pinning {
            Pinning::Nobody if self.is_complete() => vec![least],
            Pinning::All if self.is_complete() => vec![least, self.count() as f64 + 1.0],
            _ if is_dense => self.pinned_laplacian(pinning).symmetric_eigenvalues().data.as_vec().clone(),
            _ => vec![least, self.largest_eigenvalue_bound(pinning)],
        };
        eigenvalues.sort_unstable_by(f64::total_cmp);
        eigenvalues.retain(|&eigenvalue| eigenvalue >= least * (1.0 - SAME));
        eigenvalues.dedup_by(|next, before| *next <= *before * (1.0 + SAME));
        eigenvalues
    }

    /// The largest eigenvalue of the Laplacian, connected or not; a bound on it for more than 400 vehicles.
    #[must_use]
    pub fn largest_eigenvalue(&self) -> f64 {
        if self.is_complete() || self.count() > DENSE_UP_TO {
            return self.largest_eigenvalue_bound(&Pinning::Nobody);
        }
        self.laplacian().symmetric_eigenvalues().iter().copied().fold(0.0, f64::max)
    }

    /// The diagonal of M: for each vehicle whom it hears, and one more where it is pinned; without a leader's.
    #[must_use]
    pub fn pinned_diagonal(&self, pinning: &Pinning) -> Vec<f64> {
        let of = |(i, &degree): (usize, &usize)| degree as f64 + if pinning.pins(i) { 1.0 } else { 0.0 };
        let degrees = self.degrees();
        degrees.iter().enumerate().filter(|&(i, _)| pinning.leader() != Some(i)).map(of).collect()
    }

    /// A bound on the largest eigenvalue of M: for nobody pinned N where the graph is complete, otherwise the largest sum of
    /// the degrees of two vehicles that are joined (Anderson and Morley 1985), which is exact for stars and for rings of even
    /// N; one more where somebody is pinned. Where there is a leader, that without it and one more for who hears it, if this
    /// is less: 1 for a star that is led from its middle.
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

    /// A tree on `count` vehicles with some edges more.
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
    fn closed_forms_are_the_eigenvalues_of_the_matrix() {
        for count in 2..12 {
            for graph in [Graph::complete(count), Graph::star(count), Graph::ring(count), Graph::path(count)] {
                let eigenvalues = dense(&graph);
                let found = graph.algebraic_connectivity();
                assert!((found - eigenvalues[1]).abs() < 1e-13 * count as f64, "{count}: {found}, {}", eigenvalues[1]);
                let (bound, largest) = (graph.largest_eigenvalue_bound(&Pinning::Nobody), eigenvalues[count - 1]);
                assert!(bound >= largest * (1.0 - 1e-12), "{count}: {bound}, {largest}");
            }
        }
        // A star by any other centre is one.
        let hub = Graph::from_edges(5, &[(2, 0), (2, 1), (2, 3), (2, 4)]).expect("a graph");
        assert_eq!((hub.algebraic_connectivity(), hub.largest_eigenvalue_bound(&Pinning::Nobody)), (1.0, 5.0));
        let apart = Graph::from_edges(4, &[(0, 1), (2, 3)]).expect("a graph");
        assert_eq!(apart.algebraic_connectivity(), 0.0);
    }

    #[test]
    fn a_large_graph_without_a_name_has_the_eigenvalue_of_its_matrix() {
        for (count, extra) in [(450, 0), (450, 60), (450, 900)] {
            let graph = random(count, extra);
            let eigenvalues = dense(&graph);
            let found = graph.algebraic_connectivity();
            let off = found / eigenvalues[1] - 1.0;
            assert!((-1e-9..1e-8).contains(&off), "{extra}: {found} instead of {}", eigenvalues[1]);
            assert!(graph.largest_eigenvalue_bound(&Pinning::Nobody) >= eigenvalues[count - 1]);
        }
    }

    /// Nobody's second eigenvalue is left to the other tests.
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
    fn pinned_graphs_have_the_least_eigenvalue_of_their_matrix() {
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
        assert_eq!(bounds, [1.0, 9.0, 10.0], "whoever hears a leader in the middle hears nobody else");
    }

    #[test]
    fn a_bound_stands_in_where_the_work_is_too_much_and_the_graph_says_so() {
        let graph = random(420, 0);
        let exact = graph.algebraic_connectivity();
        assert!(!graph.connectivity_is_bound());
        let mut tired = Operator::new(&graph, &Pinning::Nobody, &graph.degrees());
        tired.tire();
        let copy = graph.clone();
        let bound = copy.solved_or_bounded(&Pinning::Nobody, &mut tired);
        assert!(0.0 < bound && bound <= exact && graph.connectivity_is_bound(), "{bound} {exact}");
        let (leader, exact) = (Pinning::Leader(7), least(&graph, &Pinning::Leader(7)));
        let mut tired = Operator::new(&graph, &leader, &graph.degrees());
        tired.tire();
        let bound = graph.solved_or_bounded(&leader, &mut tired);
        assert!(0.0 < bound && bound <= exact, "{bound} {exact}");
    }

    #[test]
    fn large_pinned_graphs_without_a_name_have_the_eigenvalue_of_their_matrix() {
        let graph = random(420, 60);
        for pinning in [Pinning::Listed(vec![3, 200, 400]), Pinning::Leader(7)] {
            let (found, expected) = (graph.pinned_connectivity(&pinning), least(&graph, &pinning));
            let off = found / expected - 1.0;
            assert!((-1e-9..1e-8).contains(&off), "{pinning:?}: {found} instead of {expected}");
        }
    }
}
