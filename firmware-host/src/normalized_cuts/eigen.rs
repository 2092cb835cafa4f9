//! The smallest eigenvectors of a graph's normalized Laplacian.

use nalgebra::{DMatrix, SymmetricEigen};

use super::graph::Graph;

/// An eigenvalue of the normalized Laplacian `D^-1/2 (D - W) D^-1/2` and its unit vector.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Eigenpair {
    /// Between 0 and 2.
    pub(super) value: f64,
    pub(super) vector: Vec<f64>,
}

/// Up to so many nodes the subspace is the whole space.
const DENSE: usize = 128;

/// Dimensions of the subspace of a larger graph, and what is kept of it at a restart.
const DIMENSIONS: usize = 64;
const KEPT: usize = 32;

/// Restarts after which what was found must do.
const RESTARTS: usize = 200;

/// What is left of a vector of length 1 by rounding alone is shorter.
const NOTHING: f64 = 1.0e-12;

/// The `count` smallest eigenpairs, by rising value; fewer where they do not come out within 200 restarts.
///
/// Lanczos with thick restarts (K. Wu and H. Simon, SIAM J. Matrix Anal. Appl. 22(2), 2000) finds the eigenvalues `mu` at the upper
/// end best, so it is given `(I + D^-1/2 W D^-1/2) / 2`, whose lie between 0 and 1 and are `1 - lambda / 2`: the smallest of the
/// Laplacian are the greatest of it.
///
/// The start vector is made up but fixed, and sums are taken in one order: the same graph gives the same vectors. A pair counts as
/// found when the length of the rest, `A x - mu x`, is at most `tolerance`.
///
/// # Bound
/// 200 restarts of 32 products with the matrix each.
pub(super) fn smallest(graph: &Graph, count: usize, tolerance: f64) -> Vec<Eigenpair> {
    let nodes = graph.len();
    let count = count.min(nodes);
    let dimensions = if nodes <= DENSE { nodes } else { DIMENSIONS };
    let mut space = Subspace::new(graph);
    let mut restarts = 0;
    loop {
        space.grow(dimensions);
        let ritz = space.ritz();
        let found = ritz.iter().take(count).take_while(|pair| pair.rest <= tolerance).count();
        if found == count || restarts == RESTARTS {
            let pair = |pair: &Ritz| Eigenpair { value: 2.0 * (1.0 - pair.value), vector: space.vector(&pair.weights) };
            return ritz[..found].iter().map(pair).collect();
        }
        space.keep(&ritz[..KEPT.max(count).min(dimensions - 1)]);
        restarts += 1;
    }
}

/// Orthogonal unit vectors, and the matrix `A` as it is seen in the space of all but the last of them.
struct Subspace<'a> {
    graph: &'a Graph,
    /// The diagonal of `D^-1/2`.
    scale: Vec<f64>,
    /// The last one is the direction in which `A` leads out of the space of the others.
    basis: Vec<Vec<f64>>,
    /// Products of the basis vectors with `A` times each.
    seen: DMatrix<f64>,
    /// How far `A` leads out of the space at the last vector within.
    out: f64,
    /// Vectors that were made up.
    made_up: usize,
}

/// An eigenpair of the matrix as it is seen in the subspace.
struct Ritz {
    value: f64,
    /// Of the basis vectors.
    weights: Vec<f64>,
    /// Length of `A x - value x`.
    rest: f64,
}

impl<'a> Subspace<'a> {
    fn new(graph: &'a Graph) -> Self {
        let scale = graph.degrees.iter().map(|degree| 1.0 / degree.sqrt()).collect();
        let seen = DMatrix::zeros(0, 0);
        let mut space = Self { graph, scale, basis: Vec::new(), seen, out: 0.0, made_up: 0 };
        space.lead_on(vec![0.0; graph.len()]);
        space
    }

    /// Adds dimensions, each by where `A` leads from the last.
    fn grow(&mut self, dimensions: usize) {
        let before = self.seen.nrows();
        self.seen.resize_mut(dimensions, dimensions, 0.0);
        for j in before..dimensions {
            let mut product = self.times(&self.basis[j]);
            // Once more for what rounding has left of the others.
            for _ in 0..2 {
                for (i, other) in self.basis.iter().enumerate() {
                    let share = dot(other, &product);
                    subtract(&mut product, share, other);
                    self.seen[(i, j)] += share;
                }
            }
            (0..j).for_each(|i| self.seen[(j, i)] = self.seen[(i, j)]);
            self.lead_on(product);
        }
    }

    /// Takes a vector that is orthogonal to the basis as the way out. Where there is none, any other direction goes on: a graph that
    /// falls apart is seen piece by piece.
    fn lead_on(&mut self, mut vector: Vec<f64>) {
        self.out = dot(&vector, &vector).sqrt();
        let mut length = self.out;
        if length < NOTHING {
            self.out = 0.0;
            // There is none in the whole space.
            if self.basis.len() == vector.len() {
                return;
            }
        }
        while length < NOTHING {
            vector = (0..vector.len()).map(|index| start_entry(index + self.made_up * vector.len())).collect();
            self.made_up += 1;
            normalize(&mut vector);
            for _ in 0..2 {
                for other in &self.basis {
                    let share = dot(other, &vector);
                    subtract(&mut vector, share, other);
                }
            }
            length = dot(&vector, &vector).sqrt();
        }
        normalize(&mut vector);
        self.basis.push(vector);
    }

    /// The eigenpairs within, by falling value.
    fn ritz(&self) -> Vec<Ritz> {
        let solved = SymmetricEigen::new(self.seen.clone());
        let last = self.seen.nrows() - 1;
        let pair = |(k, value): (usize, &f64)| {
            let weights: Vec<f64> = solved.eigenvectors.column(k).iter().copied().collect();
            Ritz { value: *value, rest: (self.out * weights[last]).abs(), weights }
        };
        let mut pairs: Vec<_> = solved.eigenvalues.iter().enumerate().map(pair).collect();
        pairs.sort_by(|a, b| b.value.total_cmp(&a.value));
        pairs
    }

    /// Keeps of the space what some pairs span, and the way out.
    fn keep(&mut self, pairs: &[Ritz]) {
        let mut basis: Vec<_> = pairs.iter().map(|pair| self.vector(&pair.weights)).collect();
        basis.extend(self.basis.pop());
        self.basis = basis;
        self.seen =
            DMatrix::from_diagonal(&nalgebra::DVector::from_iterator(pairs.len(), pairs.iter().map(|pair| pair.value)));
    }

    /// A unit vector by its weights.
    fn vector(&self, weights: &[f64]) -> Vec<f64> {
        let mut sum = vec![0.0; self.graph.len()];
        for (weight, vector) in weights.iter().zip(&self.basis) {
            subtract(&mut sum, -weight, vector);
        }
        normalize(&mut sum);
        sum
    }

    /// `(I + D^-1/2 W D^-1/2) / 2` times a vector.
    fn times(&self, x: &[f64]) -> Vec<f64> {
        let scaled: Vec<f64> = x.iter().zip(&self.scale).map(|(x, scale)| x * scale).collect();
        let entry = |(node, (x, scale)): (usize, (&f64, &f64))| {
            let sum: f64 = self.graph.row(node).map(|(other, weight)| weight * scaled[other]).sum();
            0.5 * (x + scale * sum)
        };
        x.iter().zip(&self.scale).enumerate().map(entry).collect()
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Eight sums side by side, which processors take in one go.
    let (mut sums, mut rest) = ([0.0; 8], 0.0);
    let (a_by_8, b_by_8) = (a.chunks_exact(8), b.chunks_exact(8));
    for (a, b) in a_by_8.remainder().iter().zip(b_by_8.remainder()) {
        rest += a * b;
    }
    for (a, b) in a_by_8.zip(b_by_8) {
        sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b);
    }
    sums.iter().sum::<f64>() + rest
}

fn subtract(from: &mut [f64], share: f64, what: &[f64]) {
    from.iter_mut().zip(what).for_each(|(from, what)| *from -= share * what);
}

fn normalize(vector: &mut [f64]) {
    let length = dot(vector, vector).sqrt();
    vector.iter_mut().for_each(|entry| *entry /= length);
}

/// Entries between 0.5 and 1.5 without a pattern that a picture could share: the golden ratio's multiples.
fn start_entry(index: usize) -> f64 {
    const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;
    let bits = (index as u64 + 1).wrapping_mul(GOLDEN);
    let mixed = (bits ^ (bits >> 31)).wrapping_mul(GOLDEN);
    0.5 + (mixed >> 11) as f64 / (1_u64 << 53) as f64
}
