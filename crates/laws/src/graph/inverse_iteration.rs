//! Least eigenvalue of a Laplacian, pinned or not, without forming a matrix: block inverse iteration.
//!
//! Each iteration also searches along the previous change, as conjugate gradients do (LOBPCG). The linear systems are
//! solved by conjugate gradients, preconditioned with a spanning tree of the graph or with its diagonal.

use nalgebra::{DMatrix, SymmetricEigen};

use super::tree::SpanningTree;
use super::{Graph, Pinning};

/// Number of vectors iterated together, so that eigenvalues close to the least one do not slow convergence.
const BLOCK: usize = 6;
/// Dimension of the search space: the present vectors, their images under the inverse of M, and the previous change.
const SEARCHED: usize = 3 * BLOCK;
/// Relative decrease of the least eigenvalue per iteration at which the iteration stops. The remaining error is
/// proportional to it.
const SETTLED: f64 = 1e-12;
/// Residual of a linear system, relative to its right-hand side.
const SOLVED: f64 = 1e-6;
/// Largest number of visits of edges and vehicles: some fifteen seconds, and more if neighbours are far apart in
/// memory. Wide graphs of tens of thousands of vehicles may exceed it.
const MOST_VISITS: u64 = 4_000_000_000;

/// M as a linear operator on its invariant subspace: vectors of mean 0 without pinning, and zero at a leader.
pub(super) struct Operator<'a> {
    graph: &'a Graph,
    pinning: &'a Pinning,
    preconditioner: Preconditioner,
    visits: u64,
}

/// Preconditioner: an approximation of M that is quick to solve.
enum Preconditioner {
    Tree(SpanningTree),
    /// Diagonal of M.
    Diagonal(Vec<f64>),
}

impl<'a> Operator<'a> {
    /// Builds the operator of a connected graph.
    pub(super) fn new(graph: &'a Graph, pinning: &'a Pinning, degrees: &[usize]) -> Self {
        let preconditioner = SpanningTree::new_if_worthwhile(graph, pinning).map_or_else(
            || {
                let adds = |i: usize| if pinning.pins(i) { 1.0 } else { 0.0 };
                Preconditioner::Diagonal(
                    degrees.iter().enumerate().map(|(i, &degree)| degree as f64 + adds(i)).collect(),
                )
            },
            Preconditioner::Tree,
        );
        Self { graph, pinning, preconditioner, visits: 0 }
    }

    /// Exhausts the work limit.
    #[cfg(test)]
    pub(super) fn exhaust(&mut self) {
        self.visits = MOST_VISITS + 1;
    }

    fn product(&mut self, x: &[f64], out: &mut [f64]) {
        self.visits += (self.graph.edge_count() + x.len()) as u64;
        out.fill(0.0);
        for (i, j) in self.graph.edges() {
            let difference = x[i] - x[j];
            out[i] += difference;
            out[j] -= difference;
        }
        if matches!(self.pinning, Pinning::Listed(_)) {
            (0..x.len()).filter(|&i| self.pinning.pins(i)).for_each(|i| out[i] += x[i]);
        }
        if let &Pinning::Leader(leader) = self.pinning {
            out[leader] = 0.0;
        }
    }

    fn project(&self, x: &mut [f64]) {
        match *self.pinning {
            Pinning::Unpinned => {
                let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
                for x in x {
                    *x -= mean;
                }
            }
            Pinning::Leader(leader) => x[leader] = 0.0,
            Pinning::All | Pinning::Listed(_) => {}
        }
    }

    /// Returns X' M X as sums over edges and pins. Products of differences avoid the cancellation of M X.
    fn forms(&mut self, block: &DMatrix<f64>) -> DMatrix<f64> {
        let width = block.ncols();
        self.visits += (width * (self.graph.edge_count() + block.nrows())) as u64;
        let rows = block.transpose();
        let mut forms = DMatrix::zeros(width, width);
        let mut values = [0.0; SEARCHED];
        let mut add = |value_of: &dyn Fn(usize) -> f64| {
            values.iter_mut().take(width).enumerate().for_each(|(k, value)| *value = value_of(k));
            (0..width).for_each(|l| (l..width).for_each(|k| forms[(k, l)] += values[k] * values[l]));
        };
        for (i, j) in self.graph.edges() {
            add(&|k| rows[(k, i)] - rows[(k, j)]);
        }
        if matches!(self.pinning, Pinning::Listed(_)) {
            (0..block.nrows()).filter(|&i| self.pinning.pins(i)).for_each(|i| add(&|k| rows[(k, i)]));
        }
        forms.fill_upper_triangle_with_lower_triangle();
        forms
    }

    /// Returns an orthonormal basis of the span of these vectors, completed within the invariant subspace if they are
    /// dependent.
    fn orthonormal(&self, block: DMatrix<f64>) -> DMatrix<f64> {
        let kept_out = match *self.pinning {
            Pinning::Unpinned => Some(vec![1.0; block.nrows()]),
            Pinning::Leader(leader) => {
                let mut unit = vec![0.0; block.nrows()];
                unit[leader] = 1.0;
                Some(unit)
            }
            Pinning::All | Pinning::Listed(_) => None,
        };
        let Some(kept_out) = kept_out else { return block.qr().q() };
        let mut beside = block.insert_column(0, 0.0);
        beside.column_mut(0).copy_from_slice(&kept_out);
        beside.qr().q().remove_column(0)
    }

    /// Returns the least eigenvalue, approximated from above; `None` if the work limit is reached.
    pub(super) fn inverse_iteration(&mut self) -> Option<f64> {
        let count = self.graph.count();
        // Start vectors without symmetry: fractional parts of multiples of irrational numbers.
        let mut block = DMatrix::from_fn(count, BLOCK, |i, k| {
            let irrational = ((k + 2) as f64).sqrt() + 0.123_456_789;
            (irrational * (i + 1) as f64).fract() - 0.5
        });
        block.column_iter_mut().for_each(|mut column| self.project(column.as_mut_slice()));
        let (mut searched, mut before) = (block.clone(), f64::INFINITY);
        loop {
            let basis = self.orthonormal(searched);
            let SymmetricEigen { eigenvalues, eigenvectors } = SymmetricEigen::new(self.forms(&basis));
            let mut ascending: Vec<usize> = (0..eigenvalues.len()).collect();
            ascending.sort_unstable_by(|&k, &l| eigenvalues[k].total_cmp(&eigenvalues[l]));
            ascending.truncate(BLOCK);
            let least = eigenvalues[*ascending.first()?];
            if !least.is_finite() {
                return None;
            }
            // The sequence is monotone up to rounding.
            if before - least <= SETTLED * least {
                return Some(least);
            }
            before = least;
            let next = basis * eigenvectors.select_columns(&ascending);
            let mut solved = next.clone();
            for (&k, mut x) in ascending.iter().zip(solved.column_iter_mut()) {
                self.solve(eigenvalues[k], x.as_mut_slice())?;
            }
            let added = &next - &block * block.tr_mul(&next);
            searched = concatenated(&[&next, &solved, &added]);
            block = next;
        }
    }

    /// Replaces x by the solution y of M y = x with preconditioned conjugate gradients, starting at x over its Rayleigh
    /// quotient.
    fn solve(&mut self, quotient: f64, x: &mut [f64]) -> Option<()> {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut y: Vec<f64> = x.iter().map(|x| x / quotient).collect();
        let mut image = vec![0.0; x.len()];
        self.product(&y, &mut image);
        let mut residual: Vec<f64> = x.iter().zip(&image).map(|(x, image)| x - image).collect();
        let mut z = self.preconditioned(&residual);
        let mut direction = z.clone();
        let (mut size, enough) = (dot(&residual, &z), (SOLVED * SOLVED) * dot(x, x));
        for _ in 0..10 * x.len() {
            if dot(&residual, &residual) <= enough {
                break;
            }
            if self.visits > MOST_VISITS {
                return None;
            }
            self.product(&direction, &mut image);
            let step = size / dot(&direction, &image);
            y.iter_mut().zip(&direction).for_each(|(y, d)| *y += step * d);
            residual.iter_mut().zip(&image).for_each(|(r, image)| *r -= step * image);
            z = self.preconditioned(&residual);
            let next = dot(&residual, &z);
            direction.iter_mut().zip(&z).for_each(|(d, z)| *d = z + next / size * *d);
            size = next;
        }
        self.project(&mut y);
        x.copy_from_slice(&y);
        Some(())
    }

    fn preconditioned(&mut self, residual: &[f64]) -> Vec<f64> {
        let mut near = residual.to_vec();
        match &self.preconditioner {
            Preconditioner::Tree(tree) => {
                self.visits += 2 * residual.len() as u64;
                tree.solve(&mut near);
            }
            Preconditioner::Diagonal(diagonal) => {
                near.iter_mut().zip(diagonal).for_each(|(x, diagonal)| *x /= diagonal);
            }
        }
        self.project(&mut near);
        near
    }
}

/// Concatenates the columns of matrices with equal numbers of rows.
fn concatenated(blocks: &[&DMatrix<f64>]) -> DMatrix<f64> {
    let columns: Vec<_> = blocks.iter().flat_map(|block| block.column_iter()).collect();
    DMatrix::from_columns(&columns)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Eigenvalues close to each other: the legs of a spider, and a path with every third vehicle pinned.
    #[test]
    fn clustered_eigenvalues_are_solved_accurately() {
        let solved = |graph: &Graph, pinning: &Pinning| {
            Operator::new(graph, pinning, &graph.degrees()).inverse_iteration().expect("solved")
        };
        // Seven of the eight slowest modes of the longest legs leave the centre at rest.
        let (count, mut edges) = (1 + 8 * 100 + 8 * 101, Vec::new());
        let mut next = 1;
        for length in [100, 101].repeat(8) {
            edges.push((0, next));
            edges.extend((next + 1..next + length).map(|i| (i - 1, i)));
            next += length;
        }
        assert_eq!(next, count);
        let spider = Graph::from_edges(count, &edges).expect("a graph");
        let exact = 2.0 - 2.0 * libm::cos(std::f64::consts::PI / (2.0 * 101.0 + 1.0));
        let off = solved(&spider, &Pinning::Unpinned) / exact - 1.0;
        assert!(off.abs() < 1e-8, "{off}");
        let ring = Graph::ring(600);
        for (graph, every) in [(Graph::path(401), 3), (Graph::path(401), 2), (ring.clone(), 4), (ring, 5)] {
            let pinning = Pinning::Listed((0..graph.count()).step_by(every).collect());
            let exact = graph.pinned_laplacian(&pinning).symmetric_eigenvalues().min();
            let off = solved(&graph, &pinning) / exact - 1.0;
            assert!(off.abs() < 1e-8, "{every}: {off}");
        }
    }

    #[test]
    fn long_thin_graphs_are_solved_accurately() {
        let count = 10_000;
        let path = Graph::path(count);
        let degrees = vec![2; count];
        let found = Operator::new(&path, &Pinning::Unpinned, &degrees).inverse_iteration().expect("solved");
        let exact = 2.0 - 2.0 * libm::cos(std::f64::consts::PI / count as f64);
        assert!((found / exact - 1.0).abs() < 1e-8, "{found} {exact}");
        // A path pinned at one end is half of a path of twice its length.
        let pinned = Pinning::Leader(0);
        let found = Operator::new(&path, &pinned, &degrees).inverse_iteration().expect("solved");
        let exact = 2.0 - 2.0 * libm::cos(std::f64::consts::PI / (2.0 * count as f64 - 1.0));
        assert!((found / exact - 1.0).abs() < 1e-8, "{found} {exact}");
        // The even modes of a ring with one pinned vehicle are those of a path pinned at its end with half the
        // stiffness.
        let ring = Graph::ring(count);
        let pinned = Pinning::Listed(vec![17]);
        let found = Operator::new(&ring, &pinned, &degrees).inverse_iteration().expect("solved");
        let exact = ring_pinned_at_one(count);
        assert!((found / exact - 1.0).abs() < 1e-8, "{found} {exact}");
    }

    /// Exact least eigenvalue of a ring of N vehicles with vehicle 0 pinned.
    ///
    /// `x_k = cos(q (N/2 - k))` has the eigenvalue 2 - 2 cos q at every other vehicle. At vehicle 0 this requires the
    /// following equation, solved for the smallest q by bisection:
    ///
    /// ```text
    /// 2 (cos(q N/2) - cos(q (N/2 - 1))) + cos(q N/2) = (2 - 2 cos q) cos(q N/2)
    /// ```
    fn ring_pinned_at_one(count: usize) -> f64 {
        let half = 0.5 * count as f64;
        let off = |q: f64| {
            let (current, next) = (libm::cos(q * half), libm::cos(q * (half - 1.0)));
            3.0 * current - 2.0 * next - (2.0 - 2.0 * libm::cos(q)) * current
        };
        let (mut low, mut high) = (1e-9, std::f64::consts::PI / count as f64);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if off(low).signum() == off(middle).signum() { low = middle } else { high = middle }
        }
        2.0 - 2.0 * libm::cos(low)
    }
}
