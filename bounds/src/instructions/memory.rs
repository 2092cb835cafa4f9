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
pub(super) fn library(each: [u64; 2], [filled, copied]: [u64; 2]) -> Vec<Fact> {
    [fills(each, filled), copies(each, copied)].concat()
}

/// The fills alone.
pub(super) fn fills([aligned, each]: [u64; 2], more: u64) -> Vec<Fact> {
    let by_word = &[("__aeabi_memclr4", 0), ("__aeabi_memclr8", 0), ("__aeabi_memset4", 0), ("__aeabi_memset8", 0)];
    let mut facts = vec![
        words(&[("__aeabi_memclr", 1), ("__aeabi_memset", 1)], each, more, "filled"),
        words(by_word, aligned, more, "filled"),
    ];
    facts.extend(["__aeabi_memclr", "__aeabi_memset"].map(bytes).concat());
    facts.extend(by_word.map(|(name, _)| shared(At::LoopOf(name, 1), 3, 0)));
    facts
}

/// The copies alone.
pub(super) fn copies([aligned, each]: [u64; 2], more: u64) -> Vec<Fact> {
    let any = const { &[(MEMCPY, WORDS_OF_MEMCPY[0]), (MEMCPY, WORDS_OF_MEMCPY[1])] };
    let by_word = const { &[(MEMCPY_OF_WORDS[0], 0), (MEMCPY_OF_WORDS[1], 0)] };
    let mut facts = vec![words(any, each, more, "copied"), words(by_word, aligned, more, "copied")];
    facts.extend(bytes(MEMCPY));
    facts
}

/// Bytes to the first word, and behind the last one; fewer than 16 have no words.
fn bytes(name: &'static str) -> Vec<Fact> {
    [(0, 3), (2, 15)].map(|(nth, bytes)| shared(At::LoopOf(name, nth), bytes, 0)).to_vec()
}

fn words(loops: &'static [(&'static str, usize)], each: u64, more: u64, group: &'static str) -> Fact {
    Fact { group: Some(group), ..shared(At::LoopsOf(loops), each, more) }
}

const fn shared(at: At, each: u64, more: u64) -> Fact {
    Fact { is_shared: true, ..Fact::new(at, each, more) }
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
