//! A spanning tree of a graph as a system of equations, solved from the leaves to the root and back.

use super::{Graph, Pinning};

/// M of a spanning tree with the graph's pins, factored: its solutions take O(N), and lie near those of the graph's own M where that
/// has few edges more.
pub(super) struct SpanningTree {
    /// Vehicles, each after the one that it hangs from: the root first.
    order: Vec<usize>,
    /// Whom each hangs from; the root from itself.
    parent: Vec<usize>,
    /// What is left of a vehicle's diagonal once all that hangs from it has been eliminated; infinite for a root that stays at 0,
    /// as a leader does, or somebody where nobody is pinned.
    pivot: Vec<f64>,
}

impl SpanningTree {
    /// Of a connected graph of at least one vehicle, breadth first from a leader or from the first.
    pub(super) fn new(graph: &Graph, pinning: &Pinning) -> Self {
        let count = graph.count();
        let root = pinning.leader().unwrap_or(0);
        let neighbours = Neighbours::of(graph);
        let (mut order, mut parent) = (vec![root], vec![usize::MAX; count]);
        parent[root] = root;
        let mut next = 0;
        while let Some(&i) = order.get(next) {
            next += 1;
            for &j in neighbours.get(i) {
                if parent[j] == usize::MAX {
                    parent[j] = i;
                    order.push(j);
                }
            }
        }
        // Pins below a vehicle, as if they were its own: an edge of stiffness 1 in series with s is one of s/(1 + s). No
        // difference is taken, and so no digit lost.
        let mut pins: Vec<f64> = (0..count).map(|i| if pinning.pins(i) { 1.0 } else { 0.0 }).collect();
        for &i in order.iter().skip(1).rev() {
            let pin = pins[i];
            pins[parent[i]] += pin / (1.0 + pin);
            pins[i] = 1.0 + pin;
        }
        if matches!(pinning, Pinning::Nobody | Pinning::Leader(_)) {
            pins[root] = f64::INFINITY;
        }
        Self { order, parent, pivot: pins }
    }

    /// Puts the solution in the place of the right side.
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_solution_on_a_tree_is_that_of_its_matrix() {
        let edges = [(0, 1), (1, 2), (1, 3), (3, 4), (3, 5), (5, 6), (0, 7)];
        let graph = Graph::from_edges(8, &edges).expect("a tree");
        let right: Vec<f64> = (0..8).map(|i| (3.0 * f64::from(i)).sin()).collect();
        for pinning in [Pinning::Listed(vec![4]), Pinning::Listed(vec![0, 6, 2]), Pinning::Leader(5)] {
            let mut x = right.clone();
            if let Some(leader) = pinning.leader() {
                x[leader] = 0.0;
            }
            let b = x.clone();
            SpanningTree::new(&graph, &pinning).solve(&mut x);
            for (i, &b) in b.iter().enumerate().filter(|&(i, _)| pinning.leader() != Some(i)) {
                let near = edges.iter().filter(|&&(j, k)| i == j || i == k);
                let pull: f64 = near.map(|&(j, k)| x[i] - x[j + k - i]).sum();
                let image = pull + if pinning.pins(i) && pinning.leader().is_none() { x[i] } else { 0.0 };
                assert!((image - b).abs() < 1e-12, "{pinning:?} {i}: {image} {b}");
            }
        }
    }
}
