use std::f64::consts::PI;

use super::*;

/// Relative error allowed to an eigenvalue of a symmetric matrix of a few dozen rows.
const EIGENVALUE_TOLERANCE: f64 = 1e-12;

#[test]
fn algebraic_connectivity_matches_the_closed_forms() {
    for n in 2..24 {
        let of_path = 2.0 - 2.0 * (PI / n as f64).cos();
        let of_ring = 2.0 - 2.0 * (2.0 * PI / n as f64).cos();
        let star = if n == 2 { 2.0 } else { 1.0 };
        let mut cases = vec![(Graph::complete(n), n as f64), (Graph::star(n), star), (Graph::path(n), of_path)];
        if n > 2 {
            cases.push((Graph::ring(n), of_ring));
        }
        for (graph, expected) in cases {
            let found = graph.algebraic_connectivity();
            assert!((found - expected).abs() <= EIGENVALUE_TOLERANCE * n as f64, "{graph:?}: {found} {expected}");
        }
    }
}

#[test]
fn the_complete_graph_has_the_same_connectivity_from_its_eigenvalues() {
    let mut eigenvalues = Graph::complete(7).laplacian().symmetric_eigenvalues().data.as_vec().clone();
    eigenvalues.sort_unstable_by(f64::total_cmp);
    assert!((eigenvalues[1] - 7.0).abs() < EIGENVALUE_TOLERANCE * 7.0);
}

#[test]
fn components_of_a_disconnected_graph_are_found() -> Result<(), GraphError> {
    let graph = Graph::from_edges(6, &[(4, 0), (1, 0), (3, 2)])?;
    assert_eq!((graph.components(), graph.is_connected(), graph.unreachable()), (3, false, vec![2, 3, 5]));
    assert_eq!(graph.algebraic_connectivity(), 0.0);
    let joined = Graph::from_edges(6, &[(4, 0), (1, 0), (3, 2), (4, 3), (5, 2)])?;
    assert_eq!((joined.components(), joined.is_connected(), joined.unreachable()), (1, true, vec![]));
    assert!(joined.algebraic_connectivity() > 0.0);
    Ok(())
}

#[test]
fn edges_are_listed_once_in_row_order() -> Result<(), GraphError> {
    let edges = |graph: &Graph| graph.edges().collect::<Vec<_>>();
    assert_eq!(edges(&Graph::complete(4)), [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]);
    assert_eq!(edges(&Graph::star(4)), [(0, 1), (0, 2), (0, 3)]);
    assert_eq!(edges(&Graph::ring(4)), [(0, 1), (0, 3), (1, 2), (2, 3)]);
    assert_eq!(edges(&Graph::path(4)), [(0, 1), (1, 2), (2, 3)]);
    let listed = Graph::from_edges(4, &[(3, 1), (1, 0), (2, 1)])?;
    assert_eq!(edges(&listed), [(0, 1), (1, 2), (1, 3)]);
    assert_eq!(listed.later_neighbours(1), LaterNeighbours::Listed(&[2, 3]));
    for graph in [Graph::complete(9), Graph::star(9), Graph::ring(9), Graph::path(9), listed] {
        assert_eq!(graph.edges().count(), graph.edge_count());
    }
    Ok(())
}

#[test]
fn listing_all_pairs_gives_the_complete_graph() -> Result<(), GraphError> {
    assert_eq!(Graph::from_edges(3, &[(0, 1), (2, 0), (2, 1)])?, Graph::complete(3));
    assert_eq!(Graph::ring(3), Graph::complete(3));
    assert_eq!(Graph::path(2), Graph::complete(2));
    assert!(!Graph::path(3).is_complete());
    Ok(())
}

#[test]
fn tiny_graphs_are_connected_and_have_no_edges() {
    for make in [Graph::complete, Graph::star, Graph::ring, Graph::path] {
        for n in 0..2 {
            let graph = make(n);
            assert_eq!((graph.count(), graph.edge_count(), graph.edges().count()), (n, 0, 0));
            assert!(graph.is_connected() && graph.unreachable().is_empty());
            assert_eq!(graph.algebraic_connectivity(), 0.0);
        }
    }
}

#[test]
fn a_vehicle_out_of_range_has_no_neighbours() {
    for graph in [Graph::complete(4), Graph::star(4)] {
        for i in [4, 5, usize::MAX] {
            assert_eq!(graph.later_neighbours(i).count(), 0);
        }
    }
}

#[test]
fn invalid_edge_lists_are_refused_with_numbers_from_one() {
    let message = |edges: &[(usize, usize)]| Graph::from_edges(3, edges).map_err(|e| e.to_string());
    assert_eq!(message(&[(0, 1), (2, 2)]), Err("edge 2 joins vehicle 3 to itself".into()));
    assert_eq!(message(&[(0, 3)]), Err("edge 1 names vehicle 4, but the swarm has 3".into()));
    assert_eq!(
        message(&[(0, usize::MAX)]),
        Err(format!("edge 1 names vehicle {}, but the swarm has 3", usize::MAX as u128 + 1))
    );
    assert_eq!(message(&[(1, 2), (0, 1), (2, 1)]), Err("edge 3 joins vehicles 2 and 3 a second time".into()));
    assert_eq!(message(&[(1, 2), (0, 1)]), Ok(Graph::path(3)).map_err(|e: GraphError| e.to_string()));
}

#[test]
fn the_weighted_laplacian_is_symmetric_with_zero_row_sums() {
    let graph = Graph::ring(6);
    let laplacian = graph.weighted_laplacian(|i, j| (i * 10 + j) as f64 - 20.0);
    assert_eq!(laplacian, laplacian.transpose());
    assert_eq!(laplacian[(1, 2)], 8.0);
    assert_eq!(laplacian[(0, 2)], 0.0);
    for i in 0..6 {
        assert_eq!(laplacian.row(i).sum(), 0.0);
    }
    assert_eq!(graph.laplacian()[(3, 3)], 2.0);
}
