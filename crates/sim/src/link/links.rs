//! Links one way: who may hear whom.

use tautline_laws::graph::Graph;

/// The links of a graph, each of them twice, in the order of who sends and then of who hears.
#[derive(Clone, Debug)]
pub(super) struct Links {
    count: usize,
    /// Who hears vehicle j: `hearers[offsets[j]..offsets[j + 1]]`, ascending.
    offsets: Vec<usize>,
    hearers: Vec<usize>,
}

impl Links {
    pub(super) fn of(graph: &Graph) -> Self {
        let count = graph.count();
        let mut offsets = vec![0; count + 1];
        for (i, j) in graph.edges() {
            offsets[i + 1] += 1;
            offsets[j + 1] += 1;
        }
        (0..count).for_each(|i| offsets[i + 1] += offsets[i]);
        let (mut next, mut hearers) = (offsets.clone(), vec![0; 2 * graph.edge_count()]);
        for (i, j) in graph.edges() {
            for (from, to) in [(i, j), (j, i)] {
                hearers[next[from]] = to;
                next[from] += 1;
            }
        }
        // Edges come in row order: whoever is before a vehicle was put down before whoever is after it.
        Self { count, offsets, hearers }
    }

    /// Number of links one way.
    pub(super) fn len(&self) -> usize {
        self.hearers.len()
    }

    /// Number of vehicles.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// The links on which a vehicle sends, with who hears it there.
    pub(super) fn from(&self, sender: usize) -> impl ExactSizeIterator<Item = (usize, usize)> + '_ {
        let places = self.offsets[sender]..self.offsets[sender + 1];
        places.clone().zip(&self.hearers[places]).map(|(link, &hearer)| (link, hearer))
    }

    /// The link on which one vehicle hears another.
    pub(super) fn find(&self, hearer: usize, sender: usize) -> Option<usize> {
        let from = self.offsets[sender];
        self.hearers[from..self.offsets[sender + 1]].binary_search(&hearer).ok().map(|place| from + place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_link_is_found_both_ways_and_no_other() {
        for graph in [Graph::complete(5), Graph::star(5), Graph::ring(6), Graph::path(4)] {
            let links = Links::of(&graph);
            assert_eq!((links.len(), links.count()), (2 * graph.edge_count(), graph.count()));
            let mut met = vec![false; links.len()];
            for sender in 0..graph.count() {
                for (link, hearer) in links.from(sender) {
                    assert!(graph.has_edge(sender, hearer) && links.find(hearer, sender) == Some(link));
                    met[link] = true;
                }
                assert_eq!(links.find(sender, sender), None);
            }
            assert!(met.iter().all(|met| *met));
        }
        assert_eq!(Links::of(&Graph::star(4)).find(1, 2), None);
    }
}
