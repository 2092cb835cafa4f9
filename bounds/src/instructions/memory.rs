//! What is known of the functions that fill and copy memory.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    facts::{At, Fact},
    program::{Count, Sum},
};
use crate::image::Graph;

/// Copies of what need not be whole words. What is left behind whole words comes here as well.
const MEMCPY: &str = "compiler_builtins::mem::memcpy";

/// Copies of whole words.
const MEMCPY_OF_WORDS: [&str; 2] = ["__aeabi_memcpy4", "__aeabi_memcpy8"];

/// Where words are copied that need not be whole ones: those that lie alike, and those that lie across the words that are read.
const WORDS_OF_MEMCPY: [usize; 2] = [1, 3];

/// The memory functions: each fill and copy has so many words at most, the first where it is known that they are whole words, and some have
/// so many more together: fills, and copies, whichever function does them.
pub(super) fn library([aligned, each]: [u64; 2], [filled, copied]: [u64; 2]) -> Vec<Fact> {
    let fact = |at, each, more, group| Fact { group, is_shared: true, ..Fact::new(at, each, more) };
    let words = |loops, each, more, group| fact(At::LoopsOf(loops), each, more, Some(group));
    let fills = &[("__aeabi_memclr", 1), ("__aeabi_memset", 1)];
    let fills_of_words =
        &[("__aeabi_memclr4", 0), ("__aeabi_memclr8", 0), ("__aeabi_memset4", 0), ("__aeabi_memset8", 0)];
    let copies = const { &[(MEMCPY, WORDS_OF_MEMCPY[0]), (MEMCPY, WORDS_OF_MEMCPY[1])] };
    let copies_of_words = const { &[(MEMCPY_OF_WORDS[0], 0), (MEMCPY_OF_WORDS[1], 0)] };
    let mut facts = vec![
        words(fills, each, filled, "filled"),
        words(fills_of_words, aligned, filled, "filled"),
        words(copies, each, copied, "copied"),
        words(copies_of_words, aligned, copied, "copied"),
    ];
    // Bytes to the first word, and behind the last one; fewer than 16 have no words.
    for name in ["__aeabi_memclr", "__aeabi_memset", MEMCPY] {
        facts.extend([(0, 3), (2, 15)].map(|(nth, bytes)| fact(At::LoopOf(name, nth), bytes, 0, None)));
    }
    facts.extend(fills_of_words.map(|(name, _)| fact(At::LoopOf(name, 1), 3, 0, None)));
    facts
}

/// How often copies come to words more often than they are called for them: a copy of whole words leaves less than a word to them.
///
/// # Errors
/// Copies of less than a word cannot be told by the way that they take from the beginning.
pub(super) fn words_behind_words(
    name: &dyn Fn(u32) -> String,
    functions: &BTreeMap<u32, Graph>,
    calls: &BTreeMap<u32, Vec<Count>>,
) -> Result<Sum, String> {
    let Some((&at, graph)) = functions.iter().find(|(at, _)| name(**at) == MEMCPY) else { return Ok(Vec::new()) };
    let found = graph.loops();
    let heads: BTreeSet<usize> = WORDS_OF_MEMCPY.iter().filter_map(|nth| found.get(*nth)).map(|one| one.head).collect();
    let first = &graph.blocks[0].next;
    let to_words: Vec<_> = first.iter().filter(|next| !graph.reached_from(**next).is_disjoint(&heads)).collect();
    if to_words.is_empty() || to_words.len() == first.len() {
        return Err(format!("copies of less than a word take no way of their own from {at:#x}: {MEMCPY}"));
    }
    let is_of_words =
        |call: &Count| matches!(call, Count::Block(from, _) if MEMCPY_OF_WORDS.contains(&name(*from).as_str()));
    let called = calls.get(&at).into_iter().flatten().filter(|call| !is_of_words(call));
    let words = to_words.into_iter().map(|next| (Count::Way(at, 0, *next), 1.0));
    Ok(words.chain(called.map(|call| (*call, -1.0))).collect())
}

/// Words that copies, or fills, go through for their calls: those that the code of a call says, or as many as `most` says of one.
pub(super) fn words_of_calls(
    (name, length): (&dyn Fn(u32) -> String, &dyn Fn(Count, u16) -> Option<u32>),
    calls: &BTreeMap<u32, Vec<Count>>,
    is_copied: bool,
    most: u64,
) -> Sum {
    let is_library =
        |at: u32| ["__aeabi_mem", "compiler_builtins::mem::"].iter().any(|prefix| name(at).starts_with(prefix));
    let from = |call: &Count| match *call {
        Count::Block(at, _) | Count::Way(at, _, _) => at,
    };
    let of_kind = calls.iter().filter(|(at, _)| is_library(**at) && name(**at).contains("memcpy") == is_copied);
    let outer = of_kind.flat_map(|(_, calls)| calls).filter(|call| !is_library(from(call)));
    // (to, from, length), and (to, length) or (to, length, value): run-time ABI for the Arm architecture, section 4.3.4.
    let words = |call| length(call, if is_copied { 2 } else { 1 }).map_or(most, |bytes| u64::from(bytes / 4));
    outer.map(|call| (*call, words(*call) as f64)).collect()
}

#[cfg(test)]
mod tests {
    use super::{super::facts::Most, *};
    use crate::image::Block;

    fn block(next: &[usize]) -> Block {
        Block { instructions: vec![0], next: next.to_vec(), calls: Vec::new(), ends: next.is_empty() }
    }

    /// Copies at 100, called by a copy of words at 0 and by something else at 50.
    fn called(blocks: Vec<Block>) -> Result<Sum, String> {
        let name = |at| [MEMCPY_OF_WORDS[0], "something else", MEMCPY][at as usize / 50].to_owned();
        let functions = BTreeMap::from([(100, Graph { blocks })]);
        words_behind_words(&name, &functions, &BTreeMap::from([(100, vec![Count::Block(0, 1), Count::Block(50, 2)])]))
    }

    #[test]
    fn a_copy_of_words_leaves_no_words_behind() {
        // Bytes in front, words, bytes behind, and words that lie across; few bytes go straight to those behind.
        let loops = [block(&[1, 3]), block(&[1, 2]), block(&[2, 3]), block(&[3, 4]), block(&[4, 5]), block(&[])];
        let mut blocks = loops.to_vec();
        blocks[3] = block(&[3, 5]);
        blocks[1] = block(&[1, 2, 4]);
        blocks[4] = block(&[4, 3]);
        assert_eq!(called(blocks).unwrap(), [(Count::Way(100, 0, 1), 1.0), (Count::Block(50, 2), -1.0)]);
        // All copies go through all loops.
        let mut blocks = loops.to_vec();
        blocks[0] = block(&[1]);
        assert!(called(blocks).unwrap_err().contains("no way of their own from 0x64"));
    }

    #[test]
    fn a_call_takes_the_words_that_its_code_says() {
        let name = |at: u32| ["__aeabi_memclr4", MEMCPY, "__aeabi_memcpy", "core"][at as usize / 10].to_owned();
        let length = |call, nth| (call == Count::Block(30, nth.into())).then_some(70);
        let [cleared, copied, unknown, wrapped] =
            [(30, 1), (30, 2), (30, 3), (20, 0)].map(|(at, place)| Count::Block(at, place));
        let calls = BTreeMap::from([(0, vec![cleared]), (10, vec![wrapped, copied]), (20, vec![unknown])]);
        let of = |is_copied| words_of_calls((&name, &length), &calls, is_copied, 32);
        assert_eq!(of(true), [(copied, 17.0), (unknown, 32.0)]);
        assert_eq!(of(false), [(cleared, 17.0)]);
    }

    #[test]
    fn fills_share_what_they_have_more_and_so_do_copies() {
        let facts = library([4, 8], [100, 200]);
        let of = |group| facts.iter().filter(move |fact| fact.group == Some(group)).map(|fact| fact.most);
        assert!(of("filled").eq([8, 4].map(|each| Most { each, more: 100 })));
        assert!(of("copied").eq([8, 4].map(|each| Most { each, more: 200 })));
        // What is left is bytes.
        assert!(
            facts.iter().filter(|fact| fact.group.is_none()).all(|fact| fact.most.each < 16 && fact.most.more == 0)
        );
    }
}
