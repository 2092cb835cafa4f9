//! How often a line of the core writes to memory.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    Chain,
    program::{Count, Sum},
};
use crate::image::{Graph, Image};

/// The blocks in which a line writes to memory, each of them once for each time that the line is come to.
///
/// # Errors
/// What was inlined once writes twice, one after the other: it may be two parts of one write.
pub(super) fn times(
    image: &Image,
    functions: &BTreeMap<u32, Graph>,
    is_line: &dyn Fn(&Chain) -> bool,
) -> Result<Sum, String> {
    let mut sum = Sum::new();
    for (&at, graph) in functions {
        let mut writing = BTreeMap::<Chain, BTreeSet<usize>>::new();
        for (place, block) in graph.blocks.iter().enumerate() {
            for &address in &block.instructions {
                let is_write = image.memory_mnemonic(address).is_some_and(|mnemonic| mnemonic.contains("st"));
                let chain = Chain::of(image, address);
                if is_write && chain.is_within(is_line) {
                    writing.entry(chain).or_default().insert(place);
                }
            }
        }
        if let Some(second) = writing.values().find_map(|blocks| again(graph, blocks)) {
            return Err(format!("it is written again at {:#x}", graph.blocks[second].instructions[0]));
        }
        let blocks: BTreeSet<usize> = writing.into_values().flatten().collect();
        sum.extend(blocks.into_iter().map(|place| (Count::Block(at, place), 1.0)));
    }
    Ok(sum)
}

/// One of some blocks that can be reached from one of them in the same round of all loops around that.
fn again(graph: &Graph, blocks: &BTreeSet<usize>) -> Option<usize> {
    let loops = graph.loops();
    blocks.iter().find_map(|from| {
        let heads: BTreeSet<usize> = loops.iter().filter(|one| one.blocks.contains(from)).map(|one| one.head).collect();
        let (mut seen, mut left) = (BTreeSet::new(), vec![*from]);
        while let Some(at) = left.pop() {
            let next = graph.blocks[at].next.iter().copied().filter(|next| !heads.contains(next));
            left.extend(next.filter(|next| seen.insert(*next)));
        }
        seen.into_iter().find(|at| blocks.contains(at))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Block;

    #[test]
    fn what_is_written_again_in_a_round_is_found() {
        // Two ways round a loop, of which one has two blocks, and one block behind it.
        let next: [&[usize]; 6] = [&[1], &[2, 3], &[4], &[4], &[1, 5], &[]];
        let block = |next: &[usize]| Block { next: next.to_vec(), ends: next.is_empty(), ..Block::default() };
        let graph = Graph { blocks: next.iter().map(|next| block(next)).collect() };
        let again = |blocks: &[usize]| again(&graph, &blocks.iter().copied().collect());
        assert_eq!([again(&[]), again(&[2]), again(&[2, 3])], [None; 3]);
        assert_eq!([again(&[2, 4]), again(&[0, 3]), again(&[3, 5])], [Some(4), Some(3), Some(5)]);
    }
}
