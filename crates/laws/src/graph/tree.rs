//! Spanning tree of a graph as a preconditioner: a linear system that is solved from the leaves to the root and back.

use super::{Graph, Pinning};

/// Factored M of a spanning tree with the graph's pins. A solution takes O(N), and is close to that of the graph's own
/// M if the graph has few additional edges.
pub(super) struct SpanningTree {
    /// Vehicles in breadth-first order; the root is first, and each vehicle comes after its parent.
    order: Vec<usize>,
    /// Parent of each vehicle; the root is its own parent.
    parent: Vec<usize>,
    /// Diagonal of each vehicle after the elimination of its subtree. Infinite for a root whose value stays 0: a
    /// leader, or an arbitrary vehicle without pinning.
    pivot: Vec<f64>,
}

/// Factor of the choice of preconditioner: the tree is used if `54 lacks <= reach^2`.
///
/// With the tree, conjugate gradients need about `(2 lacks reach)^(1/3)` iterations of three times the work. Here
/// `2 lacks reach` bounds the sum of tree distances across the `lacks` edges beyond the tree. With the diagonal they
/// need about `reach` iterations. The tree is faster if `3 (2 lacks reach)^(1/3) <= reach`.
const THRESHOLD: usize = 54;

impl SpanningTree {
    /// Returns the tree if it is the faster preconditioner: on long thin graphs and on graphs with few edges beyond a
    /// tree.
    pub(super) fn new_if_worthwhile(graph: &Graph, pinning: &Pinning) -> Option<Self> {
        let lacks = (graph.edge_count() + 1).saturating_sub(graph.count());
        let neighbours = Neighbours::of(graph);
        let reach = neighbours.reach(pinning);
        (THRESHOLD.saturating_mul(lacks) <= reach.saturating_mul(reach)).then(|| Self::new(&neighbours, pinning))
    }

    /// Builds the tree of a connected graph with at least one vehicle, breadth first from a leader or from vehicle 0.
    fn new(neighbours: &Neighbours, pinning: &Pinning) -> Self {
        let root = pinning.leader().unwrap_or(0);
        let (order, parent) = neighbours.breadth_first(vec![root]);
        let count = parent.len();
        // Stiffness of the pins below a vehicle, seen from it: an edge of stiffness 1 in series with s has s/(1 + s).
        // No differences are taken, so no digits are lost.
        let mut pins: Vec<f64> = (0..count).map(|i| if pinning.pins(i) { 1.0 } else { 0.0 }).collect();
        for &i in order.iter().skip(1).rev() {
            let pin = pins[i];
            pins[parent[i]] += pin / (1.0 + pin);
            pins[i] = 1.0 + pin;
        }
        if matches!(pinning, Pinning::Unpinned | Pinning::Leader(_)) {
            pins[root] = f64::INFINITY;
        }
        Self { order, parent, pivot: pins }
    }

    /// Replaces the right-hand side by the solution.
    pub(super) fn solve(&self, x: &mut [f64]) {
        let Some((&root, others)) = self.order.split_first() else { return };
        for &i in others.iter().rev() {
            x[self.parent[i]] += x[i] / self.pivot[i];
        }
        x[root] /= self.pivot[root];
        for &i in others {
            x[i] = (x[i] + x[self.parent[i]]) / self.pivot[i];
        }
    }
}

/// All neighbours of each vehicle.
struct Neighbours {
    offsets: Vec<usize>,
    all: Vec<usize>,
}

impl Neighbours {
    fn of(graph: &Graph) -> Self {
        let mut offsets = vec![0; graph.count() + 1];
        for (i, j) in graph.edges() {
            offsets[i + 1] += 1;
            offsets[j + 1] += 1;
        }
        for i in 0..graph.count() {
            offsets[i + 1] += offsets[i];
        }
        let (mut all, mut ends) = (vec![0; 2 * graph.edge_count()], offsets.clone());
        for (i, j) in graph.edges() {
            for (one, other) in [(i, j), (j, i)] {
                all[ends[one]] = other;
                ends[one] += 1;
            }
        }
        Self { offsets, all }
    }

    fn get(&self, i: usize) -> &[usize] {
        &self.all[self.offsets[i]..self.offsets[i + 1]]
    }

    /// Returns the vehicles in breadth-first order from `from`, and the parent of each; the vehicles of `from` are
    /// their own parents. Within a layer the vehicle with the most unreached neighbours goes first. This keeps the tree
    /// distances across the other edges short: a ladder gives a comb instead of its two rails.
    fn breadth_first(&self, from: Vec<usize>) -> (Vec<usize>, Vec<usize>) {
        let mut parent = vec![usize::MAX; self.offsets.len() - 1];
        for &i in &from {
            parent[i] = i;
        }
        let (mut order, mut reached) = (from, 0);
        while reached < order.len() {
            let ahead = |&i: &usize| self.get(i).iter().filter(|&&j| parent[j] == usize::MAX).count();
            order[reached..].sort_by_cached_key(|i| std::cmp::Reverse(ahead(i)));
            let layer = reached..order.len();
            reached = order.len();
            for node in layer {
                let i = order[node];
                for &j in self.get(i) {
                    if parent[j] == usize::MAX {
                        parent[j] = i;
                        order.push(j);
                    }
                }
            }
        }
        (order, parent)
    }

    /// Returns the largest number of edges between a vehicle and the nearest pinned one, or the leader, or vehicle 0.
    fn reach(&self, pinning: &Pinning) -> usize {
        let mut from: Vec<usize> = (0..self.offsets.len() - 1).filter(|&i| pinning.pins(i)).collect();
        if from.is_empty() {
            from.push(pinning.leader().unwrap_or(0));
        }
        let (order, parent) = self.breadth_first(from);
        let up = |&i: &usize| (parent[i] != i).then_some(parent[i]);
        std::iter::successors(order.last().copied(), up).skip(1).count()
    }
}

#[cfg(test)]
mod tests {
    use super::super::inverse_iteration::Operator;
    use super::*;

    /// Returns a ladder: two rails with rungs between them.
    fn ladder(rungs: usize) -> Graph {
        let rails = (2..2 * rungs).map(|i| (i - 2, i));
        let edges: Vec<_> = rails.chain((0..rungs).map(|k| (2 * k, 2 * k + 1))).collect();
        Graph::from_edges(2 * rungs, &edges).expect("a ladder")
    }

    #[test]
    fn the_tree_is_chosen_on_long_thin_graphs() {
        let is_chosen = |graph: &Graph, pinning: &Pinning| SpanningTree::new_if_worthwhile(graph, pinning).is_some();
        let half = |graph: &Graph| Pinning::Listed((0..graph.count()).step_by(2).collect());
        let (path, ladder) = (Graph::path(1000), ladder(1000));
        assert!(is_chosen(&path, &Pinning::Unpinned) && is_chosen(&path, &half(&path)), "the tree is the graph itself");
        assert!(is_chosen(&Graph::star(1000), &Pinning::Leader(3)));
        assert!(is_chosen(&ladder, &Pinning::Unpinned) && is_chosen(&ladder, &Pinning::Leader(7)));
        assert!(!is_chosen(&ladder, &half(&ladder)), "every vehicle is near a pinned one");
        let side = 40;
        let right = (0..side * side).filter(|i| i % side + 1 < side).map(|i| (i, i + 1));
        let grid: Vec<_> = right.chain((side..side * side).map(|i| (i - side, i))).collect();
        let grid = Graph::from_edges(side * side, &grid).expect("a grid");
        assert!(!is_chosen(&grid, &Pinning::Unpinned));
    }

    #[test]
    fn the_tree_of_a_ladder_has_short_distances_for_any_numbering() {
        let rungs = 60;
        let (interleaved, rail_by_rail) = (ladder(rungs), |i: usize| i / 2 + rungs * (i % 2));
        let renumbered: Vec<_> = interleaved.edges().map(|(i, j)| (rail_by_rail(i), rail_by_rail(j))).collect();
        for graph in [interleaved, Graph::from_edges(2 * rungs, &renumbered).expect("a ladder")] {
            let (_, parent) = Neighbours::of(&graph).breadth_first(vec![0]);
            let up = |i: usize| std::iter::successors(Some(i), |&i| (parent[i] != i).then_some(parent[i]));
            let longest = graph.edges().map(|(i, j)| {
                let above: Vec<usize> = up(i).collect();
                let (k, l) = up(j)
                    .enumerate()
                    .find_map(|(l, node)| Some((above.iter().position(|&parent| parent == node)?, l)))
                    .expect("a root");
                k + l
            });
            assert_eq!(longest.max(), Some(3));
        }
    }

    #[test]
    fn the_connectivity_of_a_large_ladder_is_exact() {
        // The slowest mode of a ladder is that of one rail.
        let rungs = 3000;
        let graph = ladder(rungs);
        let found = Operator::new(&graph, &Pinning::Unpinned, &graph.degrees()).inverse_iteration().expect("solved");
        let exact = 2.0 - 2.0 * libm::cos(std::f64::consts::PI / rungs as f64);
        assert!((found / exact - 1.0).abs() < 1e-8, "{found} {exact}");
    }

    #[test]
    fn the_solution_on_a_tree_solves_its_matrix() {
        let edges = [(0, 1), (1, 2), (1, 3), (3, 4), (3, 5), (5, 6), (0, 7)];
        let graph = Graph::from_edges(8, &edges).expect("a tree");
        let right: Vec<f64> = (0..8).map(|i| (3.0 * f64::from(i)).sin()).collect();
        for pinning in [Pinning::Listed(vec![4]), Pinning::Listed(vec![0, 6, 2]), Pinning::Leader(5)] {
            let mut x = right.clone();
            if let Some(leader) = pinning.leader() {
                x[leader] = 0.0;
            }
            let b = x.clone();
            SpanningTree::new(&Neighbours::of(&graph), &pinning).solve(&mut x);
            for (i, &b) in b.iter().enumerate().filter(|&(i, _)| pinning.leader() != Some(i)) {
                let near = edges.iter().filter(|&&(j, k)| i == j || i == k);
                let pull: f64 = near.map(|&(j, k)| x[i] - x[j + k - i]).sum();
                let image = pull + if pinning.pins(i) && pinning.leader().is_none() { x[i] } else { 0.0 };
                assert!((image - b).abs() < 1e-12, "{pinning:?} {i}: {image} {b}");
            }
        }
    }
}
