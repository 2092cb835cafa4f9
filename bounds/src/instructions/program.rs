//! The most instructions that the ways through some functions can take, as a linear program: how often each block runs is unknown, as
//! often as it is begun it is left, and loops go round as often as they may. (Implicit path enumeration: Li and Malik, 1995.)

use std::collections::BTreeMap;

use microlp::{ComparisonOp, OptimizationDirection, Problem, Variable};

use crate::image::{Graph, Loop};

/// A sum of counts: each block or way by its number, with a factor.
pub(super) type Sum = Vec<(Count, f64)>;

/// What is counted: how often a block runs, or how often control goes from one to another. The function comes first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Count {
    Block(u32, usize),
    Way(u32, usize, usize),
}

/// How often each block runs, by its function and its number.
pub(super) type Times = BTreeMap<(u32, usize), f64>;

/// Functions, and what is known about how often their blocks run.
pub(super) struct Program<'a> {
    functions: &'a BTreeMap<u32, Graph>,
    /// How often functions are called from outside.
    begun: &'a BTreeMap<u32, u64>,
    /// Sums that are at most so many.
    limits: Vec<(Sum, f64)>,
}

impl<'a> Program<'a> {
    pub(super) const fn new(functions: &'a BTreeMap<u32, Graph>, begun: &'a BTreeMap<u32, u64>) -> Self {
        Self { functions, begun, limits: Vec::new() }
    }

    pub(super) fn limit(&mut self, sum: Sum, most: u64) {
        self.limits.push((sum, most as f64));
    }

    /// The most instructions, and how often each block runs then; `None` if there is no most.
    pub(super) fn most(&self) -> Option<(u64, Times)> {
        let same = self.same();
        let mut problem = Problem::new(OptimizationDirection::Maximize);
        let mut weights = BTreeMap::<Count, f64>::new();
        for (&at, graph) in self.functions {
            for (place, block) in graph.blocks.iter().enumerate() {
                *weights.entry(same.of(Count::Block(at, place))).or_default() += block.instructions.len() as f64;
                for &next in &block.next {
                    weights.entry(same.of(Count::Way(at, place, next))).or_default();
                }
            }
        }
        let variables: BTreeMap<Count, Variable> =
            weights.iter().map(|(count, weight)| (*count, problem.add_var(*weight, (0.0, f64::INFINITY)))).collect();
        let add = |problem: &mut Problem, sum: Sum, compare: ComparisonOp, right: f64| {
            let mut terms = BTreeMap::<Count, f64>::new();
            sum.into_iter().for_each(|(count, factor)| *terms.entry(same.of(count)).or_default() += factor);
            let terms: Vec<_> = terms.into_iter().filter(|(_, factor)| *factor != 0.0).collect();
            if !terms.is_empty() {
                problem.add_constraint(terms.iter().map(|(count, factor)| (variables[count], *factor)), compare, right);
            }
        };
        let calls = self.calls();
        for (&at, graph) in self.functions {
            let before = graph.before();
            for (place, block) in graph.blocks.iter().enumerate() {
                let mut into: Sum = before[place].iter().map(|from| (Count::Way(at, *from, place), 1.0)).collect();
                let mut begun = 0.0;
                if place == 0 {
                    into.extend(calls.get(&at).into_iter().flatten().map(|from| (*from, 1.0)));
                    begun = self.begun.get(&at).copied().unwrap_or_default() as f64;
                }
                into.push((Count::Block(at, place), -1.0));
                add(&mut problem, into, ComparisonOp::Eq, -begun);
                let mut out: Sum = block.next.iter().map(|next| (Count::Way(at, place, *next), 1.0)).collect();
                if !out.is_empty() {
                    out.push((Count::Block(at, place), -1.0));
                    let compare = if block.ends { ComparisonOp::Le } else { ComparisonOp::Eq };
                    add(&mut problem, out, compare, 0.0);
                }
            }
        }
        for (sum, most) in &self.limits {
            add(&mut problem, sum.clone(), ComparisonOp::Le, *most);
        }
        let solution = problem.solve().ok().filter(|outcome| outcome.is_optimal())?.into_solution().ok()?;
        let blocks =
            self.functions.iter().flat_map(|(&at, graph)| (0..graph.blocks.len()).map(move |place| (at, place)));
        let times = blocks.map(|(at, place)| ((at, place), solution[variables[&same.of(Count::Block(at, place))]]));
        // Whole numbers of instructions: no more than what was found, of which the solver knows some twelve digits.
        Some(((solution.objective() * (1.0 + 1e-9) + 1e-3) as u64, times.collect()))
    }

    /// Blocks that call each function.
    pub(super) fn calls(&self) -> BTreeMap<u32, Vec<Count>> {
        let mut calls = BTreeMap::<u32, Vec<Count>>::new();
        for (&at, graph) in self.functions {
            for (place, block) in graph.blocks.iter().enumerate() {
                block.calls.iter().for_each(|to| calls.entry(*to).or_default().push(Count::Block(at, place)));
            }
        }
        calls
    }

    /// Counts that are the same by how the blocks hang together: a block and the only way into it or out of it.
    fn same(&self) -> Same {
        let mut same = Same(BTreeMap::new());
        for (&at, graph) in self.functions {
            let before = graph.before();
            for (place, block) in graph.blocks.iter().enumerate() {
                if let ([from], true) = (before[place].as_slice(), place != 0) {
                    same.join(Count::Way(at, *from, place), Count::Block(at, place));
                }
                if let ([next], false) = (block.next.as_slice(), block.ends) {
                    same.join(Count::Way(at, place, *next), Count::Block(at, place));
                }
            }
        }
        same
    }
}

/// Counts that are the same, each by one that stands for it.
struct Same(BTreeMap<Count, Count>);

impl Same {
    fn of(&self, mut count: Count) -> Count {
        while let Some(other) = self.0.get(&count) {
            count = *other;
        }
        count
    }

    fn join(&mut self, one: Count, other: Count) {
        let (one, other) = (self.of(one), self.of(other));
        if one != other {
            self.0.insert(one.max(other), one.min(other));
        }
    }
}

/// How often a loop goes round, and how often it is entered. By its ways back, the round that leaves it is none.
pub(super) fn rounds(at: u32, graph: &Graph, one: &Loop, by_ways_back: bool, calls: &[Count]) -> (Sum, Sum) {
    let leaves =
        |from: &usize| graph.blocks[*from].ends || graph.blocks[*from].next.iter().any(|to| !one.blocks.contains(to));
    let is_tested_at_end = !by_ways_back && one.backs.iter().all(leaves);
    // Beside its head as well, where the code has it so.
    let before = graph.before();
    let mut entered: Sum = one
        .blocks
        .iter()
        .flat_map(|to| before[*to].iter().filter(|from| !one.blocks.contains(from)).map(move |from| (*from, *to)))
        .map(|(from, to)| (Count::Way(at, from, to), 1.0))
        .collect();
    if one.head == 0 {
        entered.extend(calls.iter().map(|call| (*call, 1.0)));
    }
    let rounds = if is_tested_at_end {
        vec![(Count::Block(at, one.head), 1.0)]
    } else {
        one.backs.iter().map(|back| (Count::Way(at, *back, one.head), 1.0)).collect()
    };
    (rounds, entered)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Block;

    /// A block of `length` instructions.
    fn block(length: u32, next: &[usize], calls: &[u32]) -> Block {
        let ends = next.is_empty();
        Block { instructions: (0..length).collect(), next: next.to_vec(), calls: calls.to_vec(), ends }
    }

    /// Two ways of 5 and 7 instructions between one of 1 and one of 2; the longer one calls a function with a loop of 3.
    fn functions() -> BTreeMap<u32, Graph> {
        let blocks = vec![block(1, &[1, 2], &[]), block(5, &[3], &[]), block(7, &[3], &[100]), block(2, &[], &[])];
        let called = vec![block(1, &[1], &[]), block(3, &[1, 2], &[]), block(1, &[], &[])];
        BTreeMap::from([(0, Graph { blocks }), (100, Graph { blocks: called })])
    }

    /// The most instructions, and how often the blocks of both functions run then.
    fn limited(most: u64, calls: Option<u64>) -> (u64, [u64; 7]) {
        let (functions, begun) = (functions(), BTreeMap::from([(0, 10)]));
        let mut program = Program::new(&functions, &begun);
        let found = functions[&100].loops();
        assert_eq!(found.len(), 1);
        let (rounds, entered) = rounds(100, &functions[&100], &found[0], false, &[]);
        // Each round is counted where the loop is tested at its end.
        assert_eq!(rounds, [(Count::Block(100, 1), 1.0)]);
        let entered = entered.into_iter().map(|(count, factor)| (count, -factor * most as f64));
        program.limit(rounds.into_iter().chain(entered).collect(), 0);
        if let Some(calls) = calls {
            program.limit(vec![(Count::Block(0, 2), 1.0)], calls);
        }
        let (most, times) = program.most().unwrap();
        let times: Vec<_> = times.into_values().map(|times| times.round() as u64).collect();
        (most, times.try_into().unwrap())
    }

    #[test]
    fn the_longer_way_is_taken_with_as_many_rounds_as_there_may_be() {
        // 1 + 7 + 2 and the call of 1 + 3 x 4 + 1, ten times.
        assert_eq!(limited(4, None), (10 * (10 + 14), [10, 0, 10, 10, 10, 40, 10]));
        // Six of ten take the other way.
        assert_eq!(limited(4, Some(4)), (4 * (10 + 14) + 6 * 8, [10, 6, 4, 10, 4, 16, 4]));
    }

    #[test]
    fn a_loop_by_its_ways_back_has_a_round_more_than_it_goes_back() {
        let (functions, begun) = (functions(), BTreeMap::from([(100, 10)]));
        let found = functions[&100].loops();
        let (rounds, entered) = rounds(100, &functions[&100], &found[0], true, &[]);
        assert_eq!((&rounds, &entered), (&vec![(Count::Way(100, 1, 1), 1.0)], &vec![(Count::Way(100, 0, 1), 1.0)]));
        let mut program = Program::new(&functions, &begun);
        program.limit(rounds, 7);
        assert_eq!(program.most().unwrap().0, 10 * (1 + 3 + 1) + 7 * 3);
    }

    #[test]
    fn a_loop_that_is_not_limited_has_no_most() {
        let (functions, begun) = (functions(), BTreeMap::from([(0, 1)]));
        assert_eq!(Program::new(&functions, &begun).most(), None);
    }
}
