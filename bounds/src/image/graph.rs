//! The blocks of a function, how control goes from one to the next, and its loops.

use std::collections::{BTreeMap, BTreeSet};

use capstone::arch::arm::ArmInsn;

use super::{
    Image,
    code::{Instruction, PC},
    effect,
};

/// Instructions that run one after the other, all or none.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Block {
    /// Addresses of its instructions.
    pub(crate) instructions: Vec<u32>,
    /// Blocks that may come next; none of them is outside the function.
    pub(crate) next: Vec<usize>,
    /// Functions that are called.
    pub(crate) calls: Vec<u32>,
    /// Whether the function may end here.
    pub(crate) ends: bool,
}

/// A loop: blocks from which its head can be reached again without leaving it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Loop {
    pub(crate) head: usize,
    pub(crate) blocks: BTreeSet<usize>,
    /// Blocks that go back to the head.
    pub(crate) backs: BTreeSet<usize>,
}

/// A function.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Graph {
    /// The first is where the function begins.
    pub(crate) blocks: Vec<Block>,
}

/// Why the ways through a function are not known.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct NoGraph {
    pub(crate) address: u32,
    pub(crate) why: String,
}

/// What comes after an instruction.
#[derive(Default)]
struct After {
    next: Vec<u32>,
    call: Option<u32>,
    ends: bool,
    /// Whether a block ends here.
    splits: bool,
}

impl Graph {
    /// The function that begins at `start`.
    ///
    /// # Errors
    /// A jump to an address that the program computes, or code that is not known.
    pub(crate) fn of(image: &Image, start: u32) -> Result<Self, NoGraph> {
        let mut after = BTreeMap::<u32, After>::new();
        let mut heads = BTreeSet::from([start]);
        let mut left = vec![start];
        while let Some(at) = left.pop() {
            if after.contains_key(&at) {
                continue;
            }
            let found = image.after(start, at)?;
            left.extend(&found.next);
            if found.splits {
                heads.extend(&found.next);
            }
            after.insert(at, found);
        }
        let number: BTreeMap<u32, usize> =
            core::iter::once(&start).chain(heads.iter().filter(|at| **at != start)).copied().zip(0..).collect();
        let mut graph = Self { blocks: vec![Block::default(); number.len()] };
        for (&head, &place) in &number {
            let block = &mut graph.blocks[place];
            let mut at = head;
            loop {
                let After { next, call, ends, splits } = &after[&at];
                block.instructions.push(at);
                block.calls.extend(call);
                block.ends |= ends;
                let goes_on = next.first().filter(|next| !splits && !number.contains_key(*next));
                let Some(&next) = goes_on else {
                    let places: BTreeSet<usize> = next.iter().map(|at| number[at]).collect();
                    block.next = places.into_iter().collect();
                    break;
                };
                at = next;
            }
        }
        Ok(graph)
    }

    /// The blocks from which each one can be reached in a single step.
    pub(crate) fn before(&self) -> Vec<Vec<usize>> {
        let mut before = vec![Vec::new(); self.blocks.len()];
        for (from, block) in self.blocks.iter().enumerate() {
            block.next.iter().for_each(|to| before[*to].push(from));
        }
        before
    }

    /// The loops, each by its head; those with the same head are one. A way leads back if it leads to a block that the walk through all
    /// of them has come from: every circle has one, so that no circle is left out even where a loop can be entered beside its head.
    pub(crate) fn loops(&self) -> Vec<Loop> {
        let before = self.before();
        let mut loops = BTreeMap::<usize, Loop>::new();
        for (from, head) in self.ways_back() {
            let found = loops.entry(head).or_insert_with(|| Loop {
                head,
                blocks: BTreeSet::from([head]),
                backs: BTreeSet::new(),
            });
            found.backs.insert(from);
            let after = self.reached_from(head);
            let mut left = vec![from];
            while let Some(at) = left.pop() {
                if after.contains(&at) && found.blocks.insert(at) {
                    left.extend(&before[at]);
                }
            }
        }
        loops.into_values().collect()
    }

    /// Blocks that can be reached from one.
    pub(crate) fn reached_from(&self, from: usize) -> BTreeSet<usize> {
        let (mut after, mut left) = (BTreeSet::new(), vec![from]);
        while let Some(at) = left.pop() {
            if after.insert(at) {
                left.extend(&self.blocks[at].next);
            }
        }
        after
    }

    /// Ways from a block to one on the way to it.
    fn ways_back(&self) -> Vec<(usize, usize)> {
        let (mut seen, mut active) = (BTreeSet::from([0]), BTreeSet::from([0]));
        let (mut way, mut backs) = (vec![(0, 0)], Vec::new());
        while let Some((at, child)) = way.pop() {
            let Some(&next) = self.blocks[at].next.get(child) else {
                active.remove(&at);
                continue;
            };
            way.push((at, child + 1));
            if active.contains(&next) {
                backs.push((at, next));
            } else if seen.insert(next) {
                active.insert(next);
                way.push((next, 0));
            }
        }
        backs
    }
}

impl Image {
    /// What comes after the instruction at `at`, in the function at `start`.
    fn after(&self, start: u32, at: u32) -> Result<After, NoGraph> {
        let wrong = |why: &str| NoGraph { address: at, why: why.to_owned() };
        let instruction = self.code.at(at).ok_or_else(|| wrong("no code"))?;
        let id = ArmInsn::from(instruction.id);
        let (next, conditional) = (instruction.next(), instruction.is_conditional());
        let inside = self.is_inside(start, next);
        let falls = |falls: bool| if falls { vec![next] } else { Vec::new() };
        if effect::returns(instruction) {
            return Ok(After { next: falls(conditional), call: None, ends: true, splits: true });
        }
        match id {
            ArmInsn::ARM_INS_B | ArmInsn::ARM_INS_CBZ | ArmInsn::ARM_INS_CBNZ => {
                let last = instruction.operands.len().wrapping_sub(1);
                let target =
                    instruction.immediate(last).ok_or_else(|| wrong("a jump to an address that is computed"))?;
                let (target, goes_on) = (target as u32, id != ArmInsn::ARM_INS_B || conditional);
                if self.is_inside(start, target) {
                    let mut next = falls(goes_on);
                    next.push(target);
                    return Ok(After { next, call: None, ends: false, splits: true });
                }
                Ok(After { next: falls(goes_on), call: Some(self.function(at, target)?), ends: true, splits: true })
            }
            ArmInsn::ARM_INS_BL | ArmInsn::ARM_INS_BLX if instruction.immediate(0).is_some() => {
                let call = Some(self.function(at, instruction.immediate(0).unwrap_or_default() as u32)?);
                // What a call that does not come back is followed by is no code, or another function.
                let comes_back = inside && self.code.at(next).is_some();
                Ok(After { next: falls(comes_back), call, ends: !comes_back, splits: true })
            }
            ArmInsn::ARM_INS_TBB | ArmInsn::ARM_INS_TBH => {
                let targets = super::flow::table(self, start, instruction, id == ArmInsn::ARM_INS_TBH);
                let next = targets.ok_or_else(|| wrong("a jump by a table that is not known"))?;
                Ok(After { next, call: None, ends: false, splits: true })
            }
            ArmInsn::ARM_INS_UDF | ArmInsn::ARM_INS_TRAP | ArmInsn::ARM_INS_BKPT => {
                Ok(After { ends: true, splits: true, ..After::default() })
            }
            _ if jumps(instruction) => Err(wrong("a call or jump to an address that is computed")),
            _ => Ok(After { next: vec![next], ..After::default() }),
        }
    }

    fn function(&self, at: u32, target: u32) -> Result<u32, NoGraph> {
        let wrong = || NoGraph { address: at, why: format!("a jump to {target:#x}, where no function begins") };
        self.functions.contains_key(&target).then_some(target).ok_or_else(wrong)
    }
}

fn jumps(instruction: &Instruction) -> bool {
    instruction.writes(PC) || matches!(ArmInsn::from(instruction.id), ArmInsn::ARM_INS_BX | ArmInsn::ARM_INS_BLX)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks of one instruction each, by where they lead; those that lead nowhere end the function.
    fn graph(next: &[&[usize]]) -> Graph {
        let block = |(at, next): (usize, &&[usize])| Block {
            instructions: vec![at as u32],
            next: next.to_vec(),
            calls: Vec::new(),
            ends: next.is_empty(),
        };
        Graph { blocks: next.iter().enumerate().map(block).collect() }
    }

    /// Head, blocks, and blocks that go back, of each loop.
    fn loops(next: &[&[usize]]) -> Vec<(usize, Vec<usize>, Vec<usize>)> {
        let all = graph(next).loops().into_iter();
        all.map(|one| (one.head, one.blocks.into_iter().collect(), one.backs.into_iter().collect())).collect()
    }

    #[test]
    fn loops_are_found_one_within_the_other() {
        // 0 -> 1 -> 2 <-> 3, 3 -> 1, 3 -> 4
        let found = loops(&[&[1], &[2], &[3], &[1, 2, 4], &[]]);
        assert_eq!(found, [(1, vec![1, 2, 3], vec![3]), (2, vec![2, 3], vec![3])]);
    }

    #[test]
    fn a_circle_that_is_entered_in_two_places_is_a_loop_all_the_same() {
        // 0 -> 1 and 0 -> 2, 1 <-> 2, 2 -> 3
        let found = loops(&[&[1, 2], &[2], &[1, 3], &[]]);
        assert_eq!(found, [(1, vec![1, 2], vec![2])]);
    }

    #[test]
    fn without_a_way_back_there_is_no_loop() {
        assert_eq!(loops(&[&[1, 2], &[3], &[3], &[]]), []);
    }

    #[test]
    fn every_circle_of_a_random_graph_goes_through_a_way_back() {
        let mut seed = 0x5eed_0042u32;
        let mut random = |below: usize| {
            seed ^= seed << 13;
            seed ^= seed >> 17;
            seed ^= seed << 5;
            seed as usize % below
        };
        for _ in 0..500 {
            let count = 2 + random(9);
            let next: Vec<Vec<usize>> = (0..count).map(|_| (0..random(4)).map(|_| random(count)).collect()).collect();
            let next: Vec<&[usize]> = next.iter().map(Vec::as_slice).collect();
            let graph = graph(&next);
            let backs: BTreeSet<(usize, usize)> =
                graph.loops().iter().flat_map(|one| one.backs.iter().map(|back| (*back, one.head))).collect();
            // What can be reached without them can be put in an order: nothing comes back to where it began.
            let reached = graph.reached_from(0);
            for &start in &reached {
                let (mut seen, mut left) = (BTreeSet::new(), vec![start]);
                while let Some(at) = left.pop() {
                    for &to in next[at].iter().filter(|to| !backs.contains(&(at, **to))) {
                        assert_ne!(to, start, "{next:?}");
                        if seen.insert(to) {
                            left.push(to);
                        }
                    }
                }
            }
        }
    }
}
