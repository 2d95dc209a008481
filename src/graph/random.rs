//! Graphs that are drawn at random, and connected whatever is drawn.

use std::collections::BTreeSet;

use super::{Graph, pair_count};

impl Graph {
    /// A connected graph with so many edges: a tree in which each vehicle is joined to one before it, and pairs that are drawn
    /// until there are enough, each as likely as any other. At least the tree's N - 1 edges, at most every pair.
    ///
    /// `below(n)` draws a whole number below n.
    #[must_use]
    pub fn random(count: usize, edge_count: usize, mut below: impl FnMut(usize) -> usize) -> Self {
        if edge_count >= pair_count(count) {
            return Self::complete(count);
        }
        let mut edges: BTreeSet<_> = (1..count).map(|later| (below(later), later)).collect();
        while edges.len() < edge_count {
            let (a, b) = (below(count), below(count));
            if a != b {
                edges.insert((a.min(b), a.max(b)));
            }
        }
        Self::from_sorted(count, edges.into_iter())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers without a pattern that a graph could show.
    fn numbers(seed: u64) -> impl FnMut(usize) -> usize {
        let mut state = seed;
        move |end| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            usize::try_from((state >> 33) % end as u64).unwrap_or_default()
        }
    }

    #[test]
    fn a_random_graph_is_connected_and_has_the_edges_that_are_asked_for() {
        for count in [1, 2, 3, 7, 40] {
            for edges in [0, count - 1, count, 2 * count, pair_count(count) - usize::from(count > 3), usize::MAX] {
                let graph = Graph::random(count, edges, numbers(count as u64));
                assert!(graph.is_connected(), "{count} {edges}");
                assert_eq!(
                    graph.edge_count(),
                    edges.clamp(count - 1, pair_count(count).max(count - 1)),
                    "{count} {edges}"
                );
                assert_eq!(graph, Graph::random(count, edges, numbers(count as u64)));
            }
        }
        assert_ne!(Graph::random(40, 80, numbers(1)), Graph::random(40, 80, numbers(2)));
    }

    #[test]
    fn extra_edges_join_any_two_alike() {
        // Beyond the tree: how often each of the pairs of 6 vehicles is joined in 2,000 graphs of 8 edges.
        let (mut below, mut joined) = (numbers(3), [0; 36]);
        for _ in 0..2000 {
            let graph = Graph::random(6, 8, &mut below);
            graph.edges().for_each(|(i, j)| joined[6 * i + j] += 1);
        }
        // 0-1 is always in the tree; each other pair is in it with the chance 1/later, and drawn otherwise.
        assert_eq!(joined[1], 2000);
        let others: Vec<_> =
            (0..6).flat_map(|i| (i + 1..6).map(move |j| (i, j))).filter(|&pair| pair != (0, 1)).collect();
        for later in 2..6 {
            let of_later: Vec<_> =
                others.iter().filter(|pair| pair.1 == later).map(|&(i, j)| joined[6 * i + j]).collect();
            let (least, most) = (of_later.iter().min().copied(), of_later.iter().max().copied());
            assert!(most.zip(least).is_some_and(|(most, least)| most - least < 200), "{later}: {of_later:?}");
        }
    }
}
