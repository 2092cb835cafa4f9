//! The smallest eigenvectors of a graph's normalized Laplacian.

use faer::{
    Col, Mat, Par, Side,
    dyn_stack::{MemBuffer, MemStack},
    matrix_free::eigen::{PartialEigenParams, partial_self_adjoint_eigen, partial_self_adjoint_eigen_scratch},
    sparse::{SparseRowMatRef, SymbolicSparseRowMatRef},
};

use super::graph::Graph;

/// An eigenvalue of the normalized Laplacian `D^-1/2 (D - W) D^-1/2` and its unit vector.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Eigenpair {
    /// Between 0 and 2.
    pub(super) value: f64,
    pub(super) vector: Vec<f64>,
}

/// Dimensions of the subspace that is kept at a restart, and that it grows to before the next.
const SUBSPACE: (usize, usize) = (12, 40);

/// Up to so many nodes the whole matrix is solved: the subspace must be smaller than the matrix.
const DENSE: usize = 128;

/// Length of the rest `A x - mu x` at which a pair counts as found. Only the order of the entries of `x` matters.
const TOLERANCE: f64 = 1.0e-6;

/// Restarts after which what was found must do.
const RESTARTS: usize = 200;

/// The `count` smallest eigenpairs, by rising value; fewer where they do not come out within 200 restarts.
///
/// The solver finds the eigenvalues `mu` of the greatest magnitude, so it is given `(I + D^-1/2 W D^-1/2) / 2`, whose lie
/// between 0 and 1 and are `1 - lambda / 2`: the smallest of the Laplacian are the greatest of it.
///
/// The start vector is made up but fixed: the same graph gives the same vectors.
///
/// # Bound
/// 200 restarts of 28 products with the matrix each.
pub(super) fn smallest(graph: &Graph, count: usize) -> Vec<Eigenpair> {
    if graph.len() <= DENSE.max(SUBSPACE.1) { smallest_dense(graph, count) } else { smallest_sparse(graph, count) }
}

fn smallest_sparse(graph: &Graph, count: usize) -> Vec<Eigenpair> {
    let nodes = graph.len();
    let scale: Vec<f64> = graph.degrees.iter().map(|degree| 1.0 / degree.sqrt()).collect();
    let mut values = Vec::with_capacity(graph.weights.len());
    for node in 0..nodes {
        for (other, weight) in graph.row(node) {
            let diagonal = if node == other { 1.0 } else { 0.0 };
            values.push(0.5 * (diagonal + weight * (scale[node] * scale[other])));
        }
    }
    let pattern = SymbolicSparseRowMatRef::new_checked(nodes, nodes, &graph.row_start, None, &graph.columns);
    let matrix = SparseRowMatRef::new(pattern, &values);
    let start = Col::from_fn(nodes, start_entry);
    let params = PartialEigenParams {
        min_dim: SUBSPACE.0,
        max_dim: SUBSPACE.1,
        max_restarts: RESTARTS,
        ..PartialEigenParams::default()
    };
    let mut memory = MemBuffer::new(partial_self_adjoint_eigen_scratch(&matrix, count, Par::Seq, params));
    let (mut vectors, mut found) = (Mat::zeros(nodes, count), vec![0.0; count]);
    let stack = MemStack::new(&mut memory);
    let info = partial_self_adjoint_eigen(
        vectors.as_mut(),
        &mut found,
        &matrix,
        start.as_ref(),
        TOLERANCE,
        Par::Seq,
        stack,
        params,
    );
    let pair = |k: usize| Eigenpair { value: 2.0 * (1.0 - found[k]), vector: vectors.col(k).iter().copied().collect() };
    (0..info.n_converged_eigen.min(count)).map(pair).collect()
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
