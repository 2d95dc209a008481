//! The ends of a Laplacian's spectrum: in closed form where the graph has a name, without a matrix where it is large.

use std::f64::consts::PI;

use nalgebra::{DMatrix, SymmetricEigen};

use super::Graph;

/// Up to here all eigenvalues are computed, in O(N^3).
const DENSE_UP_TO: usize = 400;
/// Vectors that are iterated together: the slower ones, which are close to each other, do not hold up the first.
const BLOCK: usize = 6;
/// Relative change of lambda2 from one iteration to the next at which it is known: what is left falls in proportion.
const SETTLED: f64 = 1e-12;
const MOST_ITERATIONS: usize = 300;
/// Residual of a linear system, relative to its right side.
const SOLVED: f64 = 1e-6;

impl Graph {
    /// The algebraic connectivity lambda2, the second smallest eigenvalue of `L_G`: positive exactly where the graph is
    /// connected, and 0 for fewer than two vehicles.
    ///
    /// In closed form for complete graphs, stars, rings and paths (N, 1, 2 - 2 cos(2 pi/N), 2 - 2 cos(pi/N)), however the
    /// graph was made, and exactly 0 for a disconnected one. Otherwise all eigenvalues are computed for up to 400 vehicles;
    /// beyond, inverse iteration on a block of vectors, with conjugate gradients in the place of a matrix. That ends at most
    /// a few parts in 1e9 above lambda2.
    #[must_use]
    pub fn algebraic_connectivity(&self) -> f64 {
        let count = self.count() as f64;
        if self.count() < 2 || !self.is_connected() {
            return 0.0;
        }
        if self.is_complete() {
            return count;
        }
        let degrees = self.degrees();
        let most = degrees.iter().copied().max().unwrap_or_default();
        match (self.edge_count(), most) {
            (edges, most) if edges + 1 == self.count() && most == edges => 1.0,
            (edges, 2) if edges == self.count() => 2.0 - 2.0 * libm::cos(2.0 * PI / count),
            (_, 2) => 2.0 - 2.0 * libm::cos(PI / count),
            _ if self.count() <= DENSE_UP_TO => {
                let mut eigenvalues = self.laplacian().symmetric_eigenvalues().data.as_vec().clone();
                eigenvalues.sort_unstable_by(f64::total_cmp);
                eigenvalues[1]
            }
            _ => self.inverse_iteration(&degrees),
        }
    }

    /// A bound on the largest eigenvalue of `L_G`: N where the graph is complete, otherwise the largest sum of the degrees
    /// of two vehicles that are joined (Anderson and Morley 1985), which is exact for stars and for rings of even N.
    #[must_use]
    pub fn largest_eigenvalue_bound(&self) -> f64 {
        if self.is_complete() {
            return if self.count() < 2 { 0.0 } else { self.count() as f64 };
        }
        let degrees = self.degrees();
        self.edges().map(|(i, j)| degrees[i] + degrees[j]).max().unwrap_or_default() as f64
    }

    /// Number of neighbours of each vehicle.
    fn degrees(&self) -> Vec<usize> {
        let mut degrees = vec![0; self.count()];
        for (i, j) in self.edges() {
            degrees[i] += 1;
            degrees[j] += 1;
        }
        degrees
    }

    fn product(&self, x: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for (i, j) in self.edges() {
            let difference = x[i] - x[j];
            out[i] += difference;
            out[j] -= difference;
        }
    }

    /// lambda2 of a connected graph, from above.
    fn inverse_iteration(&self, degrees: &[usize]) -> f64 {
        let count = self.count();
        // Vectors that no symmetry of a graph is likely to share: the fractions of multiples of irrational numbers.
        let mut block = DMatrix::from_fn(count, BLOCK, |i, k| {
            let irrational = ((k + 2) as f64).sqrt() + 0.123_456_789;
            (irrational * (i + 1) as f64).fract() - 0.5
        });
        let (mut images, mut before) = (DMatrix::zeros(count, BLOCK), f64::INFINITY);
        for _ in 0..MOST_ITERATIONS {
            block.column_iter_mut().for_each(|mut column| centre(column.as_mut_slice()));
            block = block.qr().q();
            for (x, mut image) in block.column_iter().zip(images.column_iter_mut()) {
                self.product(x.as_slice(), image.as_mut_slice());
            }
            let SymmetricEigen { eigenvalues, eigenvectors } = SymmetricEigen::new(block.tr_mul(&images));
            let least = eigenvalues.min();
            if (before - least).abs() <= SETTLED * least {
                return least;
            }
            before = least;
            block *= eigenvectors;
            for (k, mut x) in block.column_iter_mut().enumerate() {
                self.solve(degrees, eigenvalues[k], x.as_mut_slice());
            }
        }
        before
    }

    /// Puts the solution y of L y = x, without its mean, in the place of x: conjugate gradients, scaled by the degrees, from
    /// x over its Rayleigh quotient.
    fn solve(&self, degrees: &[usize], quotient: f64, x: &mut [f64]) {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut y: Vec<f64> = x.iter().map(|x| x / quotient).collect();
        let mut image = vec![0.0; x.len()];
        self.product(&y, &mut image);
        let mut residual: Vec<f64> = x.iter().zip(&image).map(|(x, image)| x - image).collect();
        let scaled = |residual: &[f64]| {
            let mut scaled: Vec<f64> = residual.iter().zip(degrees).map(|(r, &degree)| r / degree as f64).collect();
            centre(&mut scaled);
            scaled
        };
        let mut z = scaled(&residual);
        let mut direction = z.clone();
        let (mut size, enough) = (dot(&residual, &z), (SOLVED * SOLVED) * dot(x, x));
        for _ in 0..10 * x.len() {
            if dot(&residual, &residual) <= enough {
                break;
            }
            self.product(&direction, &mut image);
            let step = size / dot(&direction, &image);
            y.iter_mut().zip(&direction).for_each(|(y, d)| *y += step * d);
            residual.iter_mut().zip(&image).for_each(|(r, image)| *r -= step * image);
            z = scaled(&residual);
            let next = dot(&residual, &z);
            direction.iter_mut().zip(&z).for_each(|(d, z)| *d = z + next / size * *d);
            size = next;
        }
        centre(&mut y);
        x.copy_from_slice(&y);
    }
}

/// Takes the mean away.
fn centre(x: &mut [f64]) {
    let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
    for x in x {
        *x -= mean;
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
                let (bound, largest) = (graph.largest_eigenvalue_bound(), eigenvalues[count - 1]);
                assert!(bound >= largest * (1.0 - 1e-12), "{count}: {bound}, {largest}");
            }
        }
        // A star by any other centre is one.
        let hub = Graph::from_edges(5, &[(2, 0), (2, 1), (2, 3), (2, 4)]).expect("a graph");
        assert_eq!((hub.algebraic_connectivity(), hub.largest_eigenvalue_bound()), (1.0, 5.0));
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
            assert!(graph.largest_eigenvalue_bound() >= eigenvalues[count - 1]);
        }
    }
}
