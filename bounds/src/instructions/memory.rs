//! What is known of the functions that fill and copy memory.

use std::collections::{BTreeMap, BTreeSet};

use super::{
    facts::{At, Fact},
    program::{Count, Sum, rounds},
};
use crate::image::Graph;

/// Copies of what need not be whole words. What is left behind whole words comes here as well.
const MEMCPY: &str = "compiler_builtins::mem::memcpy";

/// Copies of whole words.
const MEMCPY_OF_WORDS: [&str; 2] = ["__aeabi_memcpy4", "__aeabi_memcpy8"];

/// Fills and copies of any bytes, and their loops of words. Behind those is a loop of bytes.
const WORDS: [(&str, &[usize]); 3] = [("__aeabi_memclr", &[1]), ("__aeabi_memset", &[1]), (MEMCPY, &WORDS_OF_MEMCPY)];
const BYTES_BEHIND: usize = 2;

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
    [(0, 3), (BYTES_BEHIND, 15)].map(|(nth, bytes)| shared(At::LoopOf(name, nth), bytes, 0)).to_vec()
}

fn words(loops: &'static [(&'static str, usize)], each: u64, more: u64, group: &'static str) -> Fact {
    Fact { group: Some(group), ..shared(At::LoopsOf(loops), each, more) }
}

const fn shared(at: At, each: u64, more: u64) -> Fact {
    Fact { is_shared: true, ..Fact::new(at, each, more) }
}

/// What is never more than zero: bytes behind the words of a fill or a copy more than three each time, or more than 15 if there are no
/// words; and copies that come to words more often than they are called for them, since a copy of whole words leaves less than one.
///
/// # Errors
/// What is less than 16 bytes cannot be told by the way that it takes from the beginning.
pub(super) fn behind_words(
    name: &dyn Fn(u32) -> String,
    functions: &BTreeMap<u32, Graph>,
    calls: &BTreeMap<u32, Vec<Count>>,
) -> Result<Vec<Sum>, String> {
    let mut limits = Vec::new();
    for (&at, graph) in functions {
        let name_of_it = name(at);
        let Some((_, words)) = WORDS.iter().find(|(of, _)| *of == name_of_it) else { continue };
        let found = graph.loops();
        let heads: BTreeSet<usize> = words.iter().filter_map(|nth| found.get(*nth)).map(|one| one.head).collect();
        let is_to_words = |next: &usize| !graph.reached_from(*next).is_disjoint(&heads);
        let (to_words, to_bytes): (Vec<usize>, Vec<usize>) =
            graph.blocks[0].next.iter().partition(|next| is_to_words(next));
        let (Some(bytes), false, false) = (found.get(BYTES_BEHIND), to_words.is_empty(), to_bytes.is_empty()) else {
            return Err(format!("less than 16 bytes take no way of their own from {at:#x}: {name_of_it}"));
        };
        let ways =
            |to: &[usize], factor: f64| -> Sum { to.iter().map(|next| (Count::Way(at, 0, *next), factor)).collect() };
        let (bytes, _) = rounds(at, graph, bytes, false, &[]);
        limits.push([bytes, ways(&to_words, -3.0), ways(&to_bytes, -15.0)].concat());
        if name_of_it == MEMCPY {
            let called = calls.get(&at).into_iter().flatten().filter(
                |call| !matches!(call, Count::Block(from, _) if MEMCPY_OF_WORDS.contains(&name(*from).as_str())),
            );
            limits.push(ways(&to_words, 1.0).into_iter().chain(called.map(|call| (*call, -1.0))).collect());
        }
    }
    Ok(limits)
}

/// Words that copies, or fills, go through for their calls: those that the code of a call says, or as many as `most` says of one.
pub(super) fn words_of_calls(
    name: &dyn Fn(u32) -> String,
    length: &dyn Fn(Count, u16) -> Option<u32>,
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
    fn called(blocks: Vec<Block>) -> Result<Vec<Sum>, String> {
        let name = |at| [MEMCPY_OF_WORDS[0], "something else", MEMCPY][at as usize / 50].to_owned();
        let functions = BTreeMap::from([(100, Graph { blocks })]);
        behind_words(&name, &functions, &BTreeMap::from([(100, vec![Count::Block(0, 1), Count::Block(50, 2)])]))
    }

    #[test]
    fn words_leave_a_few_bytes_behind_and_copies_of_words_no_words() {
        // Bytes in front, words, bytes behind, and words that lie across; few bytes go straight to those behind.
        let loops = [block(&[1, 3]), block(&[1, 2]), block(&[2, 3]), block(&[3, 4]), block(&[4, 5]), block(&[])];
        let mut blocks = loops.to_vec();
        blocks[3] = block(&[3, 5]);
        blocks[1] = block(&[1, 2, 4]);
        blocks[4] = block(&[4, 3]);
        let [bytes, words] = &called(blocks).unwrap()[..] else { panic!("two limits") };
        assert_eq!(
            bytes[..],
            [(Count::Block(100, 3), 1.0), (Count::Way(100, 0, 1), -3.0), (Count::Way(100, 0, 3), -15.0)]
        );
        assert_eq!(words[..], [(Count::Way(100, 0, 1), 1.0), (Count::Block(50, 2), -1.0)]);
        // All copies go through all loops.
        let mut blocks = loops.to_vec();
        blocks[0] = block(&[1]);
        assert!(called(blocks).unwrap_err().contains("no way of their own from 0x64"));
    }

    #[test]
    fn a_call_takes_the_words_that_its_code_says() {
        let name = |at: u32| ["__aeabi_memclr4", MEMCPY, "__aeabi_memcpy", "core"][at as usize / 10].to_owned();
        let length = |call, nth: u16| (call == Count::Block(30, nth.into())).then_some(70);
        let [cleared, copied, unknown, wrapped] =
            [(30, 1), (30, 2), (30, 3), (20, 0)].map(|(at, place)| Count::Block(at, place));
        let calls = BTreeMap::from([(0, vec![cleared]), (10, vec![wrapped, copied]), (20, vec![unknown])]);
        let of = |is_copied| words_of_calls(&name, &length, &calls, is_copied, 32);
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
