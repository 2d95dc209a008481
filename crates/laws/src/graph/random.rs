//! Random connected graphs.

use super::{Graph, pair_count};

impl Graph {
    /// Returns a random connected graph with `edge_count` edges, clamped to N - 1 and the number of pairs. The edges
    /// are a tree that joins each vehicle to a random earlier one, and uniformly drawn pairs.
    ///
    /// `below(n)` draws an integer below n. If more than half of the pairs are edges, the missing pairs are drawn
    /// instead.
    #[must_use]
    pub fn random(count: usize, edge_count: usize, mut below: impl FnMut(usize) -> usize) -> Self {
        let pairs = pair_count(count);
        if edge_count >= pairs {
            return Self::complete(count);
        }
        // tree[j - 1] is the earlier vehicle that vehicle j is joined to.
        let tree: Vec<usize> = (1..count).map(&mut below).collect();
        let is_of_tree = |(i, j): (usize, usize)| tree[j - 1] == i;
        let (beside, absent) = (edge_count.saturating_sub(tree.len()), pairs - edge_count.max(tree.len()));
        let drawn = draw(count, beside.min(absent), &mut below, is_of_tree);
        let mut edges = Vec::with_capacity(edge_count.max(tree.len()));
        if beside <= absent {
            edges.extend(drawn);
            edges.extend(tree.iter().enumerate().map(|(before, &i)| code(count, (i, before + 1))));
            edges.sort_unstable();
        } else {
            let all = (0..count).flat_map(|i| (i + 1..count).map(move |j| code(count, (i, j))));
            edges.extend(all.filter(|pair| drawn.binary_search(pair).is_err()));
        }
        Self::from_sorted(count, edges.into_iter().map(|code| (code / count, code % count)))
    }
}

/// Encodes a pair as one number; the order is row order.
fn code(count: usize, (i, j): (usize, usize)) -> usize {
    i * count + j
}

/// Draws `pairs` distinct pairs in row order, without those that `is_left_out` excludes.
fn draw(
    count: usize,
    pairs: usize,
    mut below: impl FnMut(usize) -> usize,
    is_left_out: impl Fn((usize, usize)) -> bool,
) -> Vec<usize> {
    let mut drawn = Vec::with_capacity(pairs);
    // At most about half of the pairs are ever drawn, so each round halves the number of missing pairs or better.
    while drawn.len() < pairs {
        let missing = pairs - drawn.len();
        let some = (0..missing).map(|_| (below(count), below(count))).map(|(a, b)| (a.min(b), a.max(b)));
        drawn.extend(some.filter(|&(a, b)| a != b && !is_left_out((a, b))).map(|pair| code(count, pair)));
        drawn.sort_unstable();
        drawn.dedup();
    }
    drawn
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pseudorandom numbers from a linear congruential generator.
    fn numbers(seed: u64) -> impl FnMut(usize) -> usize {
        let mut state = seed;
        move |end| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            usize::try_from((state >> 33) % end as u64).unwrap_or_default()
        }
    }

    #[test]
    fn a_random_graph_is_connected_and_has_the_given_number_of_edges() {
        for count in [1, 2, 3, 7, 40] {
            let all = pair_count(count);
            for edges in
                [0, count - 1, count, 2 * count, all / 2, all - all / 3, all - usize::from(count > 3), usize::MAX]
            {
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
    fn extra_edges_are_uniformly_distributed() {
        // Count how often each pair of 6 vehicles is joined in 2,000 graphs. With 8 edges the edges are drawn, with 12
        // the missing pairs.
        for edges in [8, 12] {
            let (mut below, mut joined) = (numbers(3), [0; 36]);
            for _ in 0..2000 {
                Graph::random(6, edges, &mut below).edges().for_each(|(i, j)| joined[6 * i + j] += 1);
            }
            // 0-1 is always in the tree. Any other pair is in the tree with probability 1/later, and otherwise drawn
            // uniformly.
            assert_eq!(joined[1], 2000);
            for later in 2..6 {
                let of_later = (0..later).map(|i| joined[6 * i + later]);
                let (least, most) = (of_later.clone().min(), of_later.max());
                let is_even = most.zip(least).is_some_and(|(most, least)| most - least < 200 && least > 500);
                assert!(is_even, "{edges} edges, {later}: {least:?} to {most:?}");
            }
        }
    }

    #[test]
    fn a_nearly_complete_graph_is_drawn_by_its_missing_pairs() {
        let drawn = std::cell::Cell::new(0);
        let mut numbers = numbers(5);
        let counted = |end: usize| {
            drawn.set(drawn.get() + 1);
            numbers(end)
        };
        let graph = Graph::random(300, pair_count(300) - 10, counted);
        assert_eq!(graph.edge_count(), pair_count(300) - 10);
        assert!(graph.is_connected() && drawn.get() < 400, "{} numbers", drawn.get());
    }
}
