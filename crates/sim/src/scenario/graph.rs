//! `[graph]` of the scenario file: its keys, and the graph that they describe.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::document::Edge;
use super::error::{ErrorKind, ScenarioError, entry_key};
use super::limits::pair_count;
use tautline_laws::graph::{Graph, GraphError};

/// Default mean number of links of a vehicle of a random graph.
const DEFAULT_DEGREE: u64 = 4;

/// Pairs of vehicles that sense each other.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(super) struct GraphTable {
    #[schemars(flatten)]
    pub(super) kind: GraphKind,
}

/// An undirected, connected graph.
#[derive(Clone, Debug, Deserialize, Serialize, JsonSchema)]
#[schemars(tag = "kind")]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) enum GraphKind {
    /// Every pair.
    Complete {},
    /// One vehicle with every other vehicle.
    Star {
        /// Centre of the star.
        #[serde(default = "first")]
        #[schemars(extend("default" = 1), range(min = 1))]
        hub: u64,
    },
    /// Each vehicle with the next, and the last with the first.
    Ring {},
    /// Each vehicle with the next.
    Path {},
    /// A random tree, and random pairs up to the given degree.
    Random {
        /// Mean number of links of a vehicle, at least that of a tree; 4 unless given, or N - 1 if that is less.
        #[schemars(range(min = 1))]
        degree: Option<u64>,
        /// Seed of the random numbers (`ChaCha8`, the same on every machine). All runs of a campaign have the same
        /// graph, unless its `[vary]` holds `"graph.seed" = "run"`.
        #[serde(default)]
        #[schemars(extend("default" = 0))]
        seed: u64,
    },
    /// Listed pairs.
    Edges {
        /// Pairs of vehicles, counted from 1.
        edges: Vec<Edge>,
    },
}

impl Default for GraphTable {
    fn default() -> Self {
        Self { kind: GraphKind::Complete {} }
    }
}

fn first() -> u64 {
    1
}

/// Returns a bound on the number of edges that need memory.
pub(super) fn edge_count(kind: &GraphKind, law_keeps_edges: bool, count: usize) -> u128 {
    match kind {
        GraphKind::Complete {} if !law_keeps_edges => 0,
        GraphKind::Complete {} => pair_count(count),
        GraphKind::Star { .. } | GraphKind::Ring {} | GraphKind::Path {} => count as u128,
        GraphKind::Random { degree, .. } => {
            random_edge_count(degree.unwrap_or(DEFAULT_DEGREE), count).min(pair_count(count))
        }
        GraphKind::Edges { edges } => edges.len() as u128,
    }
}

/// Returns the graph of a number of vehicles.
pub(super) fn graph(kind: &GraphKind, count: usize) -> Result<Graph, ScenarioError> {
    match *kind {
        GraphKind::Complete {} => Ok(Graph::complete(count)),
        GraphKind::Star { hub } => star(hub, count),
        GraphKind::Ring {} => Ok(Graph::ring(count)),
        GraphKind::Path {} => Ok(Graph::path(count)),
        GraphKind::Random { degree, seed } => drawn(degree, seed, count),
        GraphKind::Edges { ref edges } => listed(edges, count),
    }
}

/// Returns the number of edges for a mean number of links of a vehicle, rounded up.
fn random_edge_count(degree: u64, count: usize) -> u128 {
    (u128::from(degree) * count as u128).div_ceil(2)
}

fn index(number: u64) -> Option<usize> {
    usize::try_from(number).unwrap_or(usize::MAX).checked_sub(1)
}

fn star(hub: u64, count: usize) -> Result<Graph, ScenarioError> {
    index(hub).filter(|&hub| hub < count).map(|hub| Graph::star_about(count, hub)).ok_or_else(|| {
        let problem = format!("the hub must be a vehicle from 1 to {count}, got {hub}");
        ErrorKind::UnknownVehicle.at(&["graph.hub"], problem, "vehicles are counted from 1")
    })
}

fn drawn(degree: Option<u64>, seed: u64, count: usize) -> Result<Graph, ScenarioError> {
    let most = count.saturating_sub(1).max(1) as u64;
    let degree = degree.unwrap_or(DEFAULT_DEGREE.min(most));
    if !(1..=most).contains(&degree) {
        let problem = format!("the mean number of links must be from 1 to {most}, got {degree}");
        let help = "a connected graph has a mean degree of about 2 or more";
        return Err(ErrorKind::OutOfRange.at(&["graph.degree"], problem, help));
    }
    let edges = usize::try_from(random_edge_count(degree, count)).unwrap_or(usize::MAX);
    let mut numbers = super::start::random(seed);
    Ok(Graph::random(count, edges, |end| super::start::below(end as u64, &mut numbers)))
}

fn listed(edges: &[Edge], count: usize) -> Result<Graph, ScenarioError> {
    let indices = edges.iter().enumerate().map(|(entry, Edge([a, b]))| {
        index(*a).zip(index(*b)).ok_or_else(|| {
            let problem = format!("edge {} names vehicle 0", entry + 1);
            ErrorKind::Edge.at(&[&entry_key("graph.edges", entry)], problem, "vehicles are counted from 1")
        })
    });
    let indices = indices.collect::<Result<Vec<_>, _>>()?;
    Graph::from_edges(count, &indices).map_err(|error| {
        let (GraphError::SelfLoop { edge, .. }
        | GraphError::OutOfRange { edge, .. }
        | GraphError::Duplicate { edge, .. }) = error;
        let problem = error.to_string();
        let help = "list each pair of different vehicles once, in either order";
        ErrorKind::Edge.at(&[&entry_key("graph.edges", edge)], problem, help)
    })
}
