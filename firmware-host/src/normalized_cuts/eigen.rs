//! The smallest eigenvectors of a graph's normalized Laplacian.

use faer::{
    Col, Mat, MatMut, MatRef, Par, Side,
    dyn_stack::{MemBuffer, MemStack, StackReq},
    matrix_free::{
        LinOp,
        eigen::{PartialEigenParams, partial_self_adjoint_eigen, partial_self_adjoint_eigen_scratch},
    },
};

use super::graph::Graph;

/// An eigenvalue of the normalized Laplacian `D^-1/2 (D - W) D^-1/2` and its unit vector.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Eigenpair {
    /// Between 0 and 2.
    pub(super) value: f64,
    pub(super) vector: Vec<f64>,
}

/// Up to so many nodes the whole matrix is solved: the solver needs more than the 64 dimensions of its subspace.
const DENSE: usize = 128;

/// Restarts after which what was found must do.
const RESTARTS: usize = 200;

/// The `count` smallest eigenpairs, by rising value; fewer where they do not come out within 200 restarts.
///
/// The solver finds the eigenvalues `mu` of the greatest magnitude, so it is given `(I + D^-1/2 W D^-1/2) / 2`, whose lie
/// between 0 and 1 and are `1 - lambda / 2`: the smallest of the Laplacian are the greatest of it.
///
/// The start vector is made up but fixed: the same graph gives the same vectors. A pair counts as found when the length of the
/// rest, `A x - mu x`, is at most `tolerance`.
///
/// # Bound
/// 200 restarts of 32 products with the matrix each.
pub(super) fn smallest(graph: &Graph, count: usize, tolerance: f64) -> Vec<Eigenpair> {
    if graph.len() <= DENSE { smallest_dense(graph, count) } else { smallest_sparse(graph, count, tolerance) }
}

fn smallest_sparse(graph: &Graph, count: usize, tolerance: f64) -> Vec<Eigenpair> {
    let nodes = graph.len();
    let matrix = Averaging { graph, scale: graph.degrees.iter().map(|degree| 1.0 / degree.sqrt()).collect() };
    let start = Col::from_fn(nodes, start_entry);
    let params = PartialEigenParams { max_restarts: RESTARTS, ..PartialEigenParams::default() };
    let mut memory = MemBuffer::new(partial_self_adjoint_eigen_scratch(&matrix, count, Par::Seq, params));
    let (mut vectors, mut found) = (Mat::zeros(nodes, count), vec![0.0; count]);
    let stack = MemStack::new(&mut memory);
    let info = partial_self_adjoint_eigen(
        vectors.as_mut(),
        &mut found,
        &matrix,
        start.as_ref(),
        tolerance,
        Par::Seq,
        stack,
        params,
    );
    let pair = |k: usize| Eigenpair { value: 2.0 * (1.0 - found[k]), vector: vectors.col(k).iter().copied().collect() };
    (0..info.n_converged_eigen.min(count)).map(pair).collect()
}

/// `(I + D^-1/2 W D^-1/2) / 2`.
#[derive(Debug)]
struct Averaging<'a> {
    graph: &'a Graph,
    /// The diagonal of `D^-1/2`.
    scale: Vec<f64>,
}

impl LinOp<f64> for Averaging<'_> {
    fn nrows(&self) -> usize {
        self.graph.len()
    }

    fn ncols(&self) -> usize {
        self.graph.len()
    }

    fn apply_scratch(&self, _columns: usize, _par: Par) -> StackReq {
        StackReq::EMPTY
    }

    fn apply(&self, mut out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, _par: Par, _stack: &mut MemStack) {
        for column in 0..rhs.ncols() {
            // The solver keeps its vectors in one piece each; if it ever does not, a copy does.
            let column_of_rhs = rhs.col(column);
            let copy: Vec<f64>;
            let x = match column_of_rhs.try_as_col_major() {
                Some(whole) => whole.as_slice(),
                None => {
                    copy = column_of_rhs.iter().copied().collect();
                    &copy
                }
            };
            let scaled: Vec<f64> = x.iter().zip(&self.scale).map(|(x, scale)| x * scale).collect();
            for (node, (x, scale)) in x.iter().zip(&self.scale).enumerate() {
                let sum: f64 = self.graph.row(node).map(|(other, weight)| weight * scaled[other]).sum();
                out[(node, column)] = 0.5 * (x + scale * sum);
            }
        }
    }

    /// The matrix is real.
    fn conj_apply(&self, out: MatMut<'_, f64>, rhs: MatRef<'_, f64>, par: Par, stack: &mut MemStack) {
        self.apply(out, rhs, par, stack);
    }
}

fn smallest_dense(graph: &Graph, count: usize) -> Vec<Eigenpair> {
    let nodes = graph.len();
    let mut laplacian = Mat::<f64>::identity(nodes, nodes);
    for node in 0..nodes {
        for (other, weight) in graph.row(node) {
            laplacian[(node, other)] -= weight / (graph.degrees[node] * graph.degrees[other]).sqrt();
        }
    }
    // Fails where an entry is not finite, which affinities are.
    let Ok(solved) = laplacian.self_adjoint_eigen(Side::Lower) else { return Vec::new() };
    let pair = |k: usize| Eigenpair { value: solved.S()[k], vector: solved.U().col(k).iter().copied().collect() };
    (0..count.min(nodes)).map(pair).collect()
}

/// Entries between 0.5 and 1.5 without a pattern that a picture could share: the golden ratio's multiples.
fn start_entry(index: usize) -> f64 {
    const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;
    let bits = (index as u64 + 1).wrapping_mul(GOLDEN);
    let mixed = (bits ^ (bits >> 31)).wrapping_mul(GOLDEN);
    0.5 + (mixed >> 11) as f64 / (1_u64 << 53) as f64
}
