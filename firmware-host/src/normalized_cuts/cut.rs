//! Cutting a graph in two, and the parts again.

use super::{NormalizedCutSettings, eigen, graph::Graph};

/// A graph in two parts.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cut {
    /// `cut(A, B) / assoc(A, V) + cut(A, B) / assoc(B, V)`: Shi and Malik, equation 2.
    pub(super) value: f64,
    /// Whether each node is in A.
    pub(super) in_a: Vec<bool>,
}

/// A part that may be cut further.
struct Part {
    /// Its nodes in the whole graph, rising.
    nodes: Vec<usize>,
    /// How it would be cut.
    cut: Option<Cut>,
}

/// The number of the segment of each node, from 0 in the order of their first nodes.
///
/// The recursive two-way cut of Shi and Malik, section 3: the part whose normalized cut is least is cut next, until no cut is
/// below the limit or there are enough segments. Each part is a graph of its own.
///
/// # Bound
/// Two eigen-problems for each segment.
pub(super) fn segments(graph: &Graph, settings: &NormalizedCutSettings) -> Vec<u16> {
    let whole = |nodes: Vec<usize>| {
        let cut = best_of(&graph.part(&nodes), settings.min_pixels as usize).filter(|cut| cut.value < settings.max_cut);
        Part { nodes, cut }
    };
    let mut parts = vec![whole((0..graph.len()).collect())];
    while parts.len() < settings.max_segments as usize {
        let value = |part: &Part| part.cut.as_ref().map(|cut| cut.value);
        let cuttable = (0..parts.len()).filter_map(|place| Some((place, value(&parts[place])?)));
        let Some((place, _)) = cuttable.min_by(|(_, a), (_, b)| a.total_cmp(b)) else { break };
        let Part { nodes, cut: Some(cut) } = parts.swap_remove(place) else { break };
        for side in [true, false] {
            let nodes = nodes.iter().zip(&cut.in_a).filter(|(_, in_a)| **in_a == side).map(|(node, _)| *node);
            parts.push(whole(nodes.collect()));
        }
    }
    parts.sort_by_key(|part| part.nodes.first().copied());
    let mut numbers = vec![0; graph.len()];
    for (number, part) in parts.iter().enumerate() {
        for node in &part.nodes {
            numbers[*node] = number as u16;
        }
    }
    numbers
}

/// The best cut along one of the two smallest eigenvectors, none of whose parts has fewer nodes than `least`.
///
/// The smallest is constant over each piece that hangs together (times the roots of the degrees), so it has a say only where
/// the graph falls apart by itself.
pub(super) fn best_of(graph: &Graph, least: usize) -> Option<Cut> {
    if graph.len() < 2 * least.max(1) {
        return None;
    }
    let pairs = eigen::smallest(graph, 2);
    let cuts = pairs.iter().filter_map(|pair| along(graph, &pair.vector, least));
    cuts.min_by(|a, b| a.value.total_cmp(&b.value))
}

/// The best of all cuts between nodes with smaller and with larger entries of `D^-1/2 x`: the eigenvectors of the generalized
/// problem, Shi and Malik, equation 5.
///
/// # Bound
/// Sorting, and one step for each affinity: a node that changes sides changes the cut by what it has in common with both.
fn along(graph: &Graph, vector: &[f64], least: usize) -> Option<Cut> {
    let nodes = graph.len();
    let entries: Vec<f64> = vector.iter().zip(&graph.degrees).map(|(x, degree)| x / degree.sqrt()).collect();
    let mut order: Vec<usize> = (0..nodes).collect();
    order.sort_by(|a, b| entries[*a].total_cmp(&entries[*b]));
    let total: f64 = graph.degrees.iter().sum();
    let (mut in_a, mut common, mut of_a) = (vec![false; nodes], 0.0, 0.0);
    let mut best: Option<(f64, usize)> = None;
    for (place, &node) in order.iter().enumerate() {
        for (other, weight) in graph.row(node).filter(|(other, _)| *other != node) {
            common += if in_a[other] { -weight } else { weight };
        }
        in_a[node] = true;
        of_a += graph.degrees[node];
        let count = place + 1;
        if count >= least && nodes - count >= least {
            // What is left of rounding must not make a cut look better than none.
            let common = f64::max(common, 0.0);
            let value = common / of_a + common / (total - of_a);
            if best.is_none_or(|(least, _)| value < least) {
                best = Some((value, count));
            }
        }
    }
    let (value, count) = best?;
    in_a.fill(false);
    order[..count].iter().for_each(|node| in_a[*node] = true);
    Some(Cut { value, in_a })
}
