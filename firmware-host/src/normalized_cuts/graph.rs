//! A picture as a graph: pixels, and how much they have in common.

use super::{NormalizedCutSettings, shrink::Shrunk};

/// Affinities below this are none: they would fill the matrix without a say in it.
const LEAST_WEIGHT: f64 = 1.0e-6;

/// A symmetric matrix of affinities, row by row, only what is not zero.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Graph {
    /// Where each row begins in the two lists behind it, and where the last one ends.
    pub(super) row_start: Vec<usize>,
    /// Columns, rising in each row.
    pub(super) columns: Vec<usize>,
    pub(super) weights: Vec<f64>,
    /// Sum of each row.
    pub(super) degrees: Vec<f64>,
}

impl Graph {
    /// The affinities of a picture: products of one bell curve each for the difference of grey values, of disparities and of
    /// places, as Shi and Malik have it for brightness and place. Where one of two pixels has no disparity the other two tell.
    ///
    /// # Bound
    /// `(2 radius + 1)^2` steps for each pixel.
    pub(super) fn of(picture: &Shrunk, settings: &NormalizedCutSettings) -> Self {
        let bell = |difference: f64, scale: f64| -(difference / scale) * (difference / scale);
        let radius = settings.radius_px as isize;
        let around = |middle: usize, length: usize| {
            let (middle, radius) = (middle, radius as usize);
            middle.saturating_sub(radius)..(middle + radius + 1).min(length)
        };
        let mut graph = Self::empty();
        for (i, (grey, disparity_px)) in picture.grey.iter().zip(&picture.disparity_px).enumerate() {
            let (x, y) = (i % picture.width, i / picture.width);
            for v in around(y, picture.height) {
                for u in around(x, picture.width) {
                    let (dx, dy) = (u as isize - x as isize, v as isize - y as isize);
                    let distance_2 = dx * dx + dy * dy;
                    if distance_2 > radius * radius {
                        continue;
                    }
                    let j = v * picture.width + u;
                    let mut exponent = bell(grey - picture.grey[j], settings.grey_scale)
                        + bell((distance_2 as f64).sqrt(), settings.place_scale_px);
                    if let (Some(a), Some(b)) = (disparity_px, picture.disparity_px[j]) {
                        exponent += bell(a - b, settings.disparity_scale_px);
                    }
                    graph.push(j, exponent.exp());
                }
            }
            graph.end_row();
        }
        graph
    }

    /// Number of nodes.
    pub(super) const fn len(&self) -> usize {
        self.degrees.len()
    }

    /// The nodes that a node has something in common with, itself among them, and how much.
    pub(super) fn row(&self, node: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.row_start[node]..self.row_start[node + 1];
        self.columns[range.clone()].iter().copied().zip(self.weights[range].iter().copied())
    }

    /// The graph of some of the nodes, given in rising order, with the affinities between them.
    pub(super) fn part(&self, nodes: &[usize]) -> Self {
        let mut number = vec![usize::MAX; self.len()];
        for (new, old) in nodes.iter().enumerate() {
            number[*old] = new;
        }
        let mut graph = Self::empty();
        for node in nodes {
            for (other, weight) in self.row(*node).filter(|(other, _)| number[*other] != usize::MAX) {
                graph.push(number[other], weight);
            }
            graph.end_row();
        }
        graph
    }

    pub(super) fn empty() -> Self {
        Self { row_start: vec![0], columns: Vec::new(), weights: Vec::new(), degrees: Vec::new() }
    }

    /// Adds to the last row.
    pub(super) fn push(&mut self, column: usize, weight: f64) {
        if weight >= LEAST_WEIGHT {
            self.columns.push(column);
            self.weights.push(weight);
        }
    }

    /// Ends the last row and begins the next.
    pub(super) fn end_row(&mut self) {
        let begin = *self.row_start.last().unwrap_or(&0);
        self.degrees.push(self.weights[begin..].iter().sum());
        self.row_start.push(self.columns.len());
    }
}
