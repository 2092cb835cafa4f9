//! The most instructions that a stage takes for a frame, from the machine code of an image: each block of it runs as often as the loops
//! around it go round, and how often they do is known (`facts`). `docs/bounds.md` says what that proves.

mod facts;
mod memory;
mod program;
mod written;

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    image::{Block, Graph, Image, Line, Loop, plain},
    work::Shape,
};
use facts::{Fact, Most, Stage};
use program::{Count, Program, Times, rounds};

/// Width, height and disparities of the images whose machine code is looked at.
pub(crate) const SIZE: (usize, usize, usize) = (320, 240, 48);

/// What a stage takes at most.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Bound {
    pub(crate) stage: &'static str,
    pub(crate) instructions: u64,
    /// Loops of its machine code.
    pub(crate) loops: usize,
    /// What it is made of: the blocks that run, those that take the most first.
    pub(crate) blocks: Vec<Share>,
}

/// A block of the code in the worst of all ways that are not ruled out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Share {
    pub(crate) address: u32,
    pub(crate) function: String,
    /// The first line of the core that is known of it: file, number and text; empty if there is none.
    pub(crate) line: String,
    pub(crate) length: u64,
    pub(crate) times: u64,
}

impl core::fmt::Display for Share {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let Self { address, function, line, length, times } = self;
        write!(f, "{:>12} = {times:>9} x {length:>4}  {address:#x} {function}; {line}", length * times)
    }
}

/// The bounds of all stages whose functions are in the image, and what keeps others from having one.
pub(crate) fn bounds(image: &Image, shape: &Shape) -> (Vec<Bound>, Vec<String>) {
    let (mut bounds, mut faults) = (Vec::new(), Vec::new());
    for stage in facts::stages(shape) {
        match bound(image, &stage) {
            Ok(bound) => bounds.extend(bound),
            Err(mut why) => faults.append(&mut why),
        }
    }
    (bounds, faults)
}

/// The bound of a stage; `None` if the image has none of its functions.
fn bound(image: &Image, stage: &Stage) -> Result<Option<Bound>, Vec<String>> {
    let begun: BTreeMap<u32, u64> =
        stage.entries.iter().filter_map(|(name, times)| Some((image.address(name)?, *times))).collect();
    if begun.is_empty() {
        return Ok(None);
    }
    let told = |what: String| format!("instructions {}: {what}", stage.name);
    let (functions, mut faults) = functions(image, begun.keys().copied());
    let mut program = Program::new(&functions, &begun);
    let mut used = BTreeSet::new();
    let mut together = BTreeMap::<usize, program::Sum>::new();
    let mut groups = BTreeMap::<&str, (program::Sum, u64)>::new();
    let mut by_words = BTreeMap::<&str, (program::Sum, u64, u64)>::new();
    let mut beside = Vec::<(&str, (Count, f64))>::new();
    let mut loops = 0;
    let calls = program.calls();
    for (&at, graph) in &functions {
        let found = graph.loops();
        loops += found.len();
        let mut known = Vec::new();
        for (nth, one) in found.iter().enumerate() {
            let place = Place::of(image, at, nth, graph, one);
            match stage.facts.iter().position(|fact| place.is(fact)) {
                Some(number) => known.push((number, one)),
                None => faults.push(format!("a loop without a bound: {place}")),
            }
        }
        for &(number, one) in &known {
            // Of a loop that the compiler has made two of, one within the other, a round begins at the outer head, or goes back to
            // the inner one.
            let is_inner = known
                .iter()
                .any(|&(other, outer)| other == number && outer.head != one.head && outer.blocks.contains(&one.head));
            let Fact { most: Most { each, more }, by, written, weight, by_ways_back, .. } = stage.facts[number];
            let calls = calls.get(&at).map_or(&[][..], Vec::as_slice);
            let (rounds, entered) = rounds(at, graph, one, is_inner || by_ways_back, calls);
            if let Some(most) = stage.facts[number].entered {
                program.limit(entered.clone(), most);
            }
            if let Some((group, weight)) = stage.facts[number].begins {
                let (steps, _) = groups.entry(group).or_default();
                steps.extend(entered.iter().map(|(count, factor)| (*count, factor * weight as f64)));
            }
            let times = times_written(image, graph, &found, one, &stage.facts[number]);
            if times < written {
                let address = graph.blocks[one.head].instructions[0];
                let place = stage.facts[number].place();
                faults.push(format!(
                    "a round of the loop at {address:#x} is not {by} steps: {times} reads or writes, not {written}: {place}"
                ));
            }
            if let Some(group @ ("filled" | "copied")) = stage.facts[number].group {
                let (steps, words, beside) = by_words.entry(group).or_default();
                steps.extend(&rounds);
                (*words, *beside) = (each.max(*words), more.max(*beside));
            }
            let rounds = rounds.into_iter().map(|(count, factor)| (count, factor * by as f64));
            let entered = entered.into_iter().map(|(count, factor)| (count, -factor * each as f64));
            let sum: program::Sum = rounds.chain(entered).collect();
            used.insert(number);
            let of_groups = stage.facts[number].group.iter().chain(stage.facts[number].beside);
            for group in of_groups {
                let (steps, most) = groups.entry(group).or_default();
                steps.extend(sum.iter().map(|(count, factor)| (*count, factor * weight as f64)));
                *most = more.max(*most);
            }
            if more == 0 {
                program.limit(sum, 0);
            } else {
                together.entry(number).or_default().extend(sum);
            }
        }
        for (number, fact) in stage.facts.iter().enumerate() {
            let facts::At::Code(file, text) = fact.at else { continue };
            let of_line: Vec<_> = graph.blocks.iter().map(|block| is_all_of(image, block, file, text)).collect();
            for block in outside_loops(&of_line, &found) {
                let ran = (Count::Block(at, block), fact.weight as f64);
                match fact.group {
                    Some(group) => beside.push((group, ran)),
                    None => program.limit(vec![ran], fact.most.more),
                }
                used.insert(number);
            }
        }
    }
    for (number, fact) in stage.facts.iter().enumerate() {
        let facts::At::Written(file, text) = fact.at else { continue };
        match written::times(image, &functions, &|chain| chain.is(file, text)) {
            Ok(sum) => {
                used.extend((!sum.is_empty()).then_some(number));
                program.limit(sum, fact.most.more);
            }
            Err(why) => faults.push(format!("{why}: {}", fact.place())),
        }
    }
    for (name, most) in &stage.calls {
        let of_name = functions.keys().filter(|at| plain(image.name(**at)) == *name);
        let sum = of_name.filter_map(|at| calls.get(at)).flatten().map(|call| (*call, 1.0)).collect::<Vec<_>>();
        if sum.is_empty() {
            faults.push(format!("no calls of {name}"));
        }
        program.limit(sum, *most);
    }
    for (name, (sum, most)) in groups {
        let told = stage.groups.iter().find(|(group, _)| *group == name);
        let most = told.map_or(most, |(_, most)| *most);
        // Blocks of one line run one after the other: each counts with the loops by itself.
        for (_, ran) in beside.iter().filter(|(group, _)| *group == name) {
            program.limit(sum.iter().copied().chain([*ran]).collect(), most);
        }
        program.limit(sum, most);
    }
    let name = |at| plain(image.name(at));
    let length = |call, nth| match call {
        Count::Block(at, place) => {
            let block = &functions[&at].blocks[place];
            image.argument(&block.instructions, nth).filter(|_| block.calls.len() == 1)
        }
        Count::Way(..) => None,
    };
    for (group, (mut sum, most, beside)) in by_words {
        let words = memory::words_of_calls(&name, &length, &calls, group == "copied", most);
        sum.extend(words.into_iter().map(|(call, words)| (call, -words)));
        program.limit(sum, beside);
    }
    match memory::behind_words(&name, &functions, &calls) {
        Ok(limits) => limits.into_iter().for_each(|sum| program.limit(sum, 0)),
        Err(why) => faults.push(why),
    }
    for (number, sum) in together {
        program.limit(sum, stage.facts[number].most.more);
    }
    let idle = stage.facts.iter().enumerate().filter(|(number, fact)| !used.contains(number) && !fact.is_shared);
    faults.extend(idle.map(|(_, fact)| format!("no loop for what is known of {}", fact.place())));
    if !faults.is_empty() {
        return Err(faults.into_iter().map(told).collect());
    }
    let Some((instructions, times)) = program.most() else {
        return Err(vec![told("the bounds of its loops do not bound it".to_owned())]);
    };
    Ok(Some(Bound { stage: stage.name, instructions, loops, blocks: shares(image, &functions, &times) }))
}

/// The blocks that run, those that take the most first.
fn shares(image: &Image, functions: &BTreeMap<u32, Graph>, times: &Times) -> Vec<Share> {
    let share = |(&(at, place), &times): (&(u32, usize), &f64)| {
        let instructions = &functions[&at].blocks[place].instructions;
        let chains = instructions.iter().map(|&address| Chain::of(image, address));
        let line = chains.flat_map(|chain| chain.0.into_iter().next()).next();
        Share {
            address: instructions[0],
            function: plain(image.name(at)),
            line: line.map(|(file, line, text, _)| format!("{file}:{line}: {text}")).unwrap_or_default(),
            length: instructions.len() as u64,
            times: times.round() as u64,
        }
    };
    let mut shares: Vec<_> = times.iter().map(share).filter(|share| share.times > 0).collect();
    shares.sort_by_key(|share| core::cmp::Reverse(share.length * share.times));
    shares
}

/// How often a line stands in the code of a loop: its instructions that go to memory, which nothing is saved of.
fn times_written(image: &Image, graph: &Graph, all: &[Loop], one: &Loop, fact: &Fact) -> usize {
    let facts::At::Line(file, text) = fact.at else { return 1 };
    let mut times = BTreeMap::<bool, usize>::new();
    for block in own_blocks(all, one) {
        for &address in &graph.blocks[block].instructions {
            let Some(mnemonic) = image.memory_mnemonic(address) else { continue };
            let lines = Chain::of(image, address);
            if lines.is_inlined_at(file, text) {
                *times.entry(mnemonic.contains("ld")).or_default() += 1;
            }
        }
    }
    times.into_values().max().unwrap_or(1)
}

/// Lines of the core that an instruction comes from, the innermost first: file, number, text and that of the next line.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Chain(Vec<(String, u32, String, String)>);

impl Chain {
    fn of(image: &Image, address: u32) -> Self {
        let frames = image.lines.of_address(address);
        let of_core = frames.iter().filter(|line| line.line != 0);
        let line = |line: &Line| {
            let file = line.core_file()?;
            let [text, next] = [line.line, line.line + 1].map(|line| image.source(file, line));
            Some((file.to_owned(), line.line, text, next))
        };
        Self(of_core.filter_map(line).collect())
    }

    fn is(&self, file: &str, meant: &str) -> bool {
        let lines: Vec<_> = self.0.iter().map(|(_, _, text, next)| (text.clone(), next.clone())).collect();
        self.0.first().is_some_and(|(of, ..)| of == file) && facts::is_meant(meant, &lines)
    }

    /// Whether it or one that it was inlined into is such a one: what is written at a line may be a call.
    fn is_within(&self, is: &dyn Fn(&Self) -> bool) -> bool {
        (0..self.0.len()).any(|from| is(&Self(self.0[from..].to_vec())))
    }

    /// Whether it is of a line, or was inlined there.
    fn is_inlined_at(&self, file: &str, meant: &str) -> bool {
        self.is_within(&|chain| chain.is(file, meant))
    }
}

/// Whether all of a block that is known of a line is of this one, or was inlined there; `None` if nothing is known of it. What the
/// compiler has put together of several lines says of no line, and of where it was inlined.
fn is_all_of(image: &Image, block: &Block, file: &str, text: &str) -> Option<bool> {
    let says = |address: &u32| image.lines.of_address(*address).first().is_some_and(|line| line.line != 0);
    let chains = block.instructions.iter().filter(|address| says(address)).map(|&address| Chain::of(image, address));
    let mut known = chains.filter(|chain| !chain.0.is_empty()).peekable();
    known.peek()?;
    Some(known.all(|chain| chain.is_inlined_at(file, text)))
}

/// Blocks of a line that run as often as the line: those in a loop that is of the line as well may run more often. So may those in a
/// loop of which nothing is known to be of another line, whatever its head is.
fn outside_loops(of_line: &[Option<bool>], loops: &[Loop]) -> Vec<usize> {
    let may_be_inner =
        |one: &&Loop| of_line[one.head] == Some(true) || one.blocks.iter().all(|block| of_line[*block] != Some(false));
    let inner: Vec<&Loop> = loops.iter().filter(may_be_inner).collect();
    let is_outside =
        |block: &usize| of_line[*block] == Some(true) && !inner.iter().any(|one| one.blocks.contains(block));
    (0..of_line.len()).filter(is_outside).collect()
}

/// Blocks of a loop that belong to none within it.
fn own_blocks<'a>(all: &'a [Loop], one: &'a Loop) -> impl Iterator<Item = usize> + 'a {
    one.blocks.iter().copied().filter(move |block| {
        let is_inner =
            |other: &Loop| other.head != one.head && one.blocks.contains(&other.head) && other.blocks.contains(block);
        !all.iter().any(is_inner)
    })
}

/// The functions that can be reached, and what keeps ways through them from being known.
fn functions(image: &Image, from: impl Iterator<Item = u32>) -> (BTreeMap<u32, Graph>, Vec<String>) {
    let (mut functions, mut faults) = (BTreeMap::new(), Vec::new());
    let mut left: Vec<u32> = from.collect();
    while let Some(at) = left.pop() {
        if functions.contains_key(&at) {
            continue;
        }
        match Graph::of(image, at) {
            Ok(graph) => {
                left.extend(graph.blocks.iter().flat_map(|block| &block.calls));
                functions.insert(at, graph);
            }
            Err(no) => faults.push(format!("{} at {:#x}: {}", image.name(at), no.address, no.why)),
        }
    }
    (functions, faults)
}

/// Where a loop stands.
struct Place {
    address: u32,
    /// The function of the image, and the how manieth of its loops it is.
    function: String,
    nth: usize,
    /// What leads back to the head of the loop, as far as its line is known.
    lines: BTreeSet<Chain>,
}

impl Place {
    fn of(image: &Image, at: u32, nth: usize, graph: &Graph, one: &Loop) -> Self {
        let chains = |addresses: &mut dyn Iterator<Item = u32>| -> BTreeSet<Chain> {
            addresses.map(|address| Chain::of(image, address)).filter(|chain| !chain.0.is_empty()).collect()
        };
        let mut backs = one.backs.iter().filter_map(|back| graph.blocks[*back].instructions.last().copied());
        let lines = chains(&mut backs);
        let address = graph.blocks[one.head].instructions.first().copied().unwrap_or_default();
        Self { address, function: plain(image.name(at)), nth, lines }
    }

    fn is(&self, fact: &Fact) -> bool {
        match fact.at {
            facts::At::Line(file, text) => self.lines.iter().any(|chain| chain.is(file, text)),
            facts::At::LineOf(name, file, text) => {
                self.function == name && self.lines.iter().any(|chain| chain.is(file, text))
            }
            facts::At::Function(name) => self.function == name,
            facts::At::Unwritten(name) => self.function == name && self.lines.is_empty(),
            facts::At::Written(..) | facts::At::Code(..) => false,
            facts::At::LoopOf(name, nth) => self.function == name && self.nth == nth,
            facts::At::LoopsOf(loops) => loops.contains(&(self.function.as_str(), self.nth)),
        }
    }
}

impl core::fmt::Display for Place {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:#x}, loop {} of {}", self.address, self.nth, self.function)?;
        for (file, line, text, _) in self.lines.iter().filter_map(|chain| chain.0.first()) {
            write!(f, "; {file}:{line}: {text}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn code_of_a_line_runs_as_often_as_the_line_but_for_loops_in_it() {
        // Block 0 comes before a loop of 1 to 6, in which the line is 2 to 5; of them 3 and 4 go round.
        let around = Loop { head: 1, blocks: (1..=6).collect(), backs: BTreeSet::from([6]) };
        let inner = Loop { head: 3, blocks: BTreeSet::from([3, 4]), backs: BTreeSet::from([4]) };
        let mut of_line = [false, false, true, true, true, true, false].map(Some);
        assert_eq!(outside_loops(&of_line, &[around.clone(), inner.clone()]), [2, 5]);
        assert_eq!(outside_loops(&of_line, std::slice::from_ref(&around)), [2, 3, 4, 5]);
        // Nothing is known of the head.
        of_line[3] = None;
        assert_eq!(outside_loops(&of_line, &[around, inner]), [2, 5]);
    }
}
