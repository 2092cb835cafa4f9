//! How deep the stack gets: a walk through the code of a function and of those that it calls.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
};

use capstone::arch::arm::ArmInsn;

use super::{
    Image,
    code::{Instruction, PC},
    effect::{self, Stack},
};

/// What a function takes of the stack.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Depth {
    /// Bytes of its own.
    pub(crate) own: u32,
    /// Bytes with all that it calls.
    pub(crate) worst: u32,
    /// The call that is worst.
    through: Option<u32>,
    returns: bool,
}

/// What must not be in an image: where it is found, its depth is not known.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Flaw {
    pub(crate) function: String,
    pub(crate) address: u32,
    pub(crate) kind: FlawKind,
}

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum FlawKind {
    /// The functions from the first call to the last, which calls the first.
    Recursion(Vec<String>),
    /// A call or jump to an address that the program computes.
    Indirect(String),
    /// The stack pointer is set to what is not known here.
    UnknownFrame(String),
    /// Two ways lead to an instruction with different depths.
    DifferentDepths { one: i64, other: i64 },
    /// The compiler says that the frame is larger.
    SmallerThanTold { found: u32, told: u32 },
    /// Code that is not known where it is reached.
    NoCode,
    /// A jump into the middle of another function.
    IntoTheMiddle(u32),
    /// A table of jumps that is not known.
    NoTable,
}

impl fmt::Display for Flaw {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { function, address, kind } = self;
        match kind {
            FlawKind::Recursion(circle) => write!(f, "recursion: {}", circle.join(" calls ")),
            FlawKind::Indirect(text) => write!(f, "indirect call or jump in {function} at {address:#x}: {text}"),
            FlawKind::UnknownFrame(text) => write!(f, "frame of unknown size in {function} at {address:#x}: {text}"),
            FlawKind::DifferentDepths { one, other } => {
                write!(f, "frame of unknown size in {function} at {address:#x}: {one} or {other} bytes")
            }
            FlawKind::SmallerThanTold { found, told } => {
                write!(f, "frame of unknown size in {function}: {found} bytes by its code, {told} by the compiler")
            }
            FlawKind::NoCode => write!(f, "{function} runs into no code at {address:#x}"),
            FlawKind::IntoTheMiddle(target) => {
                write!(f, "{function} jumps at {address:#x} to {target:#x}, where no function begins")
            }
            FlawKind::NoTable => write!(f, "a jump by a table that is not known in {function} at {address:#x}"),
        }
    }
}

/// Depths of functions, found as they are asked for.
pub(crate) struct Analysis<'a> {
    image: &'a Image,
    depths: BTreeMap<u32, Depth>,
    /// The functions on the way from the entry to the one that is looked at.
    active: Vec<u32>,
    flaws: BTreeSet<Flaw>,
    /// Calls of functions of the core library that do not come back: panics. By the function that calls.
    panics: BTreeMap<u32, BTreeSet<u32>>,
    calls: BTreeMap<u32, BTreeSet<u32>>,
}

/// An instruction, and whether the condition of the IT instruction before it holds.
type Place = (u32, Option<(bool, u8)>);

impl<'a> Analysis<'a> {
    pub(crate) fn new(image: &'a Image) -> Self {
        Self {
            image,
            depths: BTreeMap::new(),
            active: Vec::new(),
            flaws: BTreeSet::new(),
            panics: BTreeMap::new(),
            calls: BTreeMap::new(),
        }
    }

    /// The depth of the function at `start`.
    pub(crate) fn depth(&mut self, start: u32) -> Depth {
        if let Some(known) = self.depths.get(&start) {
            return known.clone();
        }
        if let Some(at) = self.active.iter().position(|active| *active == start) {
            let circle = self.active[at..].iter().chain([&start]).map(|at| self.image.name(*at).to_owned()).collect();
            self.flaw(start, start, FlawKind::Recursion(circle));
            return Depth { returns: true, ..Depth::default() };
        }
        self.active.push(start);
        let depth = self.walk(start);
        self.active.pop();
        self.depths.insert(start, depth.clone());
        depth
    }

    /// What was found that must not be there.
    pub(crate) fn flaws(&self) -> impl Iterator<Item = &Flaw> {
        self.flaws.iter()
    }

    /// The functions on the way to the greatest depth, each with its own bytes.
    pub(crate) fn deepest_way(&self, start: u32) -> Vec<(&str, u32)> {
        let mut way = Vec::new();
        let mut next = Some(start);
        while let Some((at, depth)) = next.and_then(|at| Some((at, self.depths.get(&at)?))) {
            way.push((self.image.name(at), depth.own));
            next = depth.through;
        }
        way
    }

    /// The functions that call a panic, and how many calls there are.
    pub(crate) fn panics(&self) -> impl Iterator<Item = (&str, usize)> {
        self.panics.iter().map(|(at, calls)| (self.image.name(*at), calls.len()))
    }

    /// Whether the function at `start`, or one that it calls, calls a panic.
    pub(crate) fn can_panic(&self, start: u32) -> bool {
        let (mut seen, mut left) = (BTreeSet::new(), vec![start]);
        while let Some(at) = left.pop() {
            if self.panics.contains_key(&at) {
                return true;
            }
            if seen.insert(at) {
                left.extend(self.calls.get(&at).into_iter().flatten());
            }
        }
        false
    }

    fn flaw(&mut self, function: u32, address: u32, kind: FlawKind) {
        self.flaws.insert(Flaw { function: self.image.name(function).to_owned(), address, kind });
    }

    fn walk(&mut self, start: u32) -> Depth {
        let image = self.image;
        let mut depth = Depth::default();
        let mut seen = BTreeMap::<Place, Stack>::new();
        let mut left = vec![((start, None), Stack::default())];
        while let Some((place, stack)) = left.pop() {
            let stack = match seen.get(&place).map(|before| (before, before.meet(&stack))) {
                None => stack,
                Some((before, Some(both))) if both == *before => continue,
                Some((_, Some(both))) => both,
                Some((before, None)) => {
                    let kind = FlawKind::DifferentDepths { one: before.depth, other: stack.depth };
                    self.flaw(start, place.0, kind);
                    continue;
                }
            };
            seen.insert(place, stack.clone());
            depth.own = depth.own.max(stack.depth.max(0) as u32);
            let Some(instruction) = image.code.at(place.0) else {
                self.flaw(start, place.0, FlawKind::NoCode);
                continue;
            };
            self.step(start, instruction, place, &stack, &mut depth, &mut left);
        }
        if let Some(told) = image.told.get(&start).copied().filter(|told| *told > depth.own) {
            self.flaw(start, start, FlawKind::SmallerThanTold { found: depth.own, told });
        }
        depth.worst = depth.worst.max(depth.own);
        depth
    }

    /// Goes through one instruction and adds the places that may come after it.
    fn step(
        &mut self,
        start: u32,
        instruction: &Instruction,
        (_, condition): Place,
        stack: &Stack,
        depth: &mut Depth,
        left: &mut Vec<(Place, Stack)>,
    ) {
        let next = instruction.next();
        let id = ArmInsn::from(instruction.id);
        if id == ArmInsn::ARM_INS_IT {
            let length = instruction.mnemonic.len().saturating_sub(1) as u8;
            for holds in [true, false] {
                left.push(((next, Some((holds, length))), stack.clone()));
            }
            return;
        }
        // The instructions after an IT run, or do not, by its condition: that of the first of them, or the opposite.
        let mut runs = true;
        let mut after = None;
        if let Some((holds, remaining)) = condition {
            runs = instruction.is_then(self.image.code.first_of_it(instruction.address)) == holds;
            after = (remaining > 1).then_some((holds, remaining - 1));
        }
        if !runs {
            left.push(((next, after), stack.clone()));
            return;
        }
        if effect::returns(instruction) {
            depth.returns = true;
            return;
        }
        match id {
            ArmInsn::ARM_INS_B | ArmInsn::ARM_INS_CBZ | ArmInsn::ARM_INS_CBNZ => {
                let Some(target) = instruction.immediate(instruction.operands.len() - 1).map(|at| at as u32) else {
                    self.flaw(start, instruction.address, FlawKind::Indirect(instruction.text.clone()));
                    return;
                };
                if id != ArmInsn::ARM_INS_B || (instruction.is_conditional() && condition.is_none()) {
                    left.push(((next, None), stack.clone()));
                }
                if self.image.is_inside(start, target) {
                    left.push(((target, None), stack.clone()));
                } else if self.call(start, instruction, target, stack, depth) {
                    depth.returns = true;
                }
            }
            ArmInsn::ARM_INS_BL | ArmInsn::ARM_INS_BLX if instruction.immediate(0).is_some() => {
                let target = instruction.immediate(0).unwrap_or_default() as u32;
                if self.call(start, instruction, target, stack, depth) {
                    left.push(((next, after), stack.after_call()));
                }
            }
            ArmInsn::ARM_INS_TBB | ArmInsn::ARM_INS_TBH => {
                let Some(targets) = table(self.image, start, instruction, id == ArmInsn::ARM_INS_TBH) else {
                    self.flaw(start, instruction.address, FlawKind::NoTable);
                    return;
                };
                left.extend(targets.into_iter().map(|target| ((target, None), stack.clone())));
            }
            // Traps: the end, and no return.
            ArmInsn::ARM_INS_UDF | ArmInsn::ARM_INS_TRAP | ArmInsn::ARM_INS_BKPT => {}
            _ if instruction.writes(PC) || matches!(id, ArmInsn::ARM_INS_BX | ArmInsn::ARM_INS_BLX) => {
                self.flaw(start, instruction.address, FlawKind::Indirect(instruction.text.clone()));
            }
            _ => match stack.after(instruction) {
                Ok(stack) => left.push(((next, after), stack)),
                Err(effect::UnknownFrame) => {
                    self.flaw(start, instruction.address, FlawKind::UnknownFrame(instruction.text.clone()));
                }
            },
        }
    }

    /// Looks at a call, and says whether it comes back.
    fn call(&mut self, start: u32, from: &Instruction, target: u32, stack: &Stack, depth: &mut Depth) -> bool {
        if !self.image.functions.contains_key(&target) {
            self.flaw(start, from.address, FlawKind::IntoTheMiddle(target));
            return true;
        }
        let called = self.depth(target);
        self.calls.entry(start).or_default().insert(target);
        let is_core = |at: u32| self.image.name(at).starts_with("core::");
        if !called.returns && is_core(target) && !is_core(start) {
            self.panics.entry(start).or_default().insert(from.address);
        }
        let worst = stack.depth.max(0) as u32 + called.worst;
        if worst > depth.worst {
            (depth.worst, depth.through) = (worst, Some(target));
        }
        called.returns
    }
}

/// Where a table of jumps leads: half the distances from the jump on, in bytes or half words. It ends where code goes on, or before that
/// with what leads to no code: padding, and constants behind the table. A constant that happens to lead to code is followed as well,
/// which can only add to the bound.
pub(super) fn table(image: &Image, start: u32, instruction: &Instruction, is_wide: bool) -> Option<Vec<u32>> {
    let from = instruction.next();
    let bytes = image.code.table_at(image.code.base_of_table(instruction)?)?;
    let distances: Vec<u32> = if is_wide {
        bytes.chunks_exact(2).map(|pair| u32::from(pair[0]) | u32::from(pair[1]) << 8).collect()
    } else {
        bytes.iter().map(|byte| u32::from(*byte)).collect()
    };
    let targets = distances.into_iter().map(|distance| from + 2 * distance);
    let is_code = |target: &u32| image.is_inside(start, *target) && image.code.at(*target).is_some();
    let targets = targets.take_while(is_code).collect::<Vec<_>>();
    (!targets.is_empty()).then_some(targets)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{
        Function,
        code::{Code, Kind},
        source::Lines,
    };

    /// Functions as an assembler makes them; their names, and the first addresses after them.
    const CODE: [u16; 62] = [
        // fixed: push {r4, lr}; sub sp, #16; bl saved; add sp, #16; pop {r4, pc}
        0xb510, 0xb084, 0xf000, 0xf802, 0xb004, 0xbd10,
        // saved: push {r7, lr}; vpush {d8, d9}; str lr, [sp, #-4]!; ldr lr, [sp], #4; vpop {d8, d9}; pop {r7, pc}
        0xb580, 0xed2d, 0x8b04, 0xf84d, 0xed04, 0xf85d, 0xeb04, 0xecbd, 0x8b04, 0xbd80,
        // circle: push {lr}; cmp r0, #0; itt eq; subeq r0, #1; popeq {pc}; bl circle; pop {pc}
        0xb500, 0x2800, 0xbf04, 0x3801, 0xbd00, 0xf7ff, 0xfff9, 0xbd00,
        // aligned: push {r4, r6, r7, lr}; add r7, sp, #8; sub r4, sp, #100; bfc r4, #0, #5; mov sp, r4; sub r4, r7, #8;
        // mov sp, r4; pop {r4, r6, r7, pc}
        0xb5d0, 0xaf02, 0xf1ad, 0x0464, 0xf36f, 0x0404, 0x46a5, 0xf1a7, 0x0408, 0x46a5, 0xbdd0,
        // pointer: push {r7, lr}; blx r0; pop {r7, pc}
        0xb580, 0x4780, 0xbd80,
        // table: push {r7, lr}; tbb [pc, r0]; .byte 2, 4, 4, 0; sub sp, #64; add sp, #64; pop {r7, pc}
        0xb580, 0xe8df, 0xf000, 0x0402, 0x0004, 0xb090, 0xb010, 0xbd80, // variable: sub sp, sp, r0; bx lr
        0xebad, 0x0d00, 0x4770, // uneven: cbz r0, 1f; push {r4}; 1: bx lr
        0xb100, 0xb410, 0x4770,
        // behind: push {r7, lr}; addw r5, pc, #8; tbb [r5, r0]; .byte 66, 67; .byte 2, 4; sub sp, #32; add sp, #32; pop {r7, pc}
        0xb580, 0xf20f, 0x0508, 0xe8d5, 0xf000, 0x4342, 0x0402, 0xb088, 0xb008, 0xbd80,
    ];

    const FUNCTIONS: [(&str, u32, u32); 9] = [
        ("fixed", 0x0, 0xc),
        ("saved", 0xc, 0x20),
        ("circle", 0x20, 0x30),
        ("aligned", 0x30, 0x46),
        ("pointer", 0x46, 0x4c),
        ("table", 0x4c, 0x5c),
        ("variable", 0x5c, 0x62),
        ("uneven", 0x62, 0x68),
        ("behind", 0x68, 0x7c),
    ];

    fn image() -> Image {
        let bytes: Vec<u8> = CODE.iter().flat_map(|half| half.to_le_bytes()).collect();
        let marks = BTreeMap::from([
            (0, Kind::Thumb),
            (0x52, Kind::Data),
            (0x56, Kind::Thumb),
            (0x72, Kind::Data),
            (0x76, Kind::Thumb),
        ]);
        let functions = FUNCTIONS.map(|(name, start, end)| (start, Function { name: name.to_owned(), end }));
        Image {
            functions: BTreeMap::from(functions),
            code: Code::disassemble(&[(0, &bytes)], &marks).unwrap(),
            lines: Lines::default(),
            told: BTreeMap::from([(0, 24), (0xc, 28), (0x4c, 73)]),
            detector_bytes: None,
            allocators: Vec::new(),
        }
    }

    /// Own depth, worst depth and flaws of a function.
    fn found(name: &str) -> (u32, u32, Vec<String>) {
        let image = image();
        let mut analysis = Analysis::new(&image);
        let (_, start, _) = FUNCTIONS.into_iter().find(|(other, ..)| *other == name).unwrap();
        let depth = analysis.depth(start);
        (depth.own, depth.worst, analysis.flaws().map(ToString::to_string).collect())
    }

    #[test]
    fn pushes_and_calls_add_up() {
        assert_eq!(found("saved"), (8 + 16 + 4, 28, vec![]));
        assert_eq!(found("fixed"), (8 + 16, 24 + 28, vec![]));
    }

    #[test]
    fn an_aligned_frame_takes_as_much_as_it_may() {
        // 16 pushed, 100 for itself, up to 28 more down to a multiple of 32.
        assert_eq!(found("aligned"), (144, 144, vec![]));
    }

    #[test]
    fn a_table_leads_to_all_of_its_places() {
        assert_eq!((found("table").0, found("table").1), (8 + 64, 72));
        // The register points behind a word that is none of it.
        assert_eq!(found("behind"), (8 + 32, 40, vec![]));
    }

    #[test]
    fn a_frame_that_the_compiler_says_is_larger_is_told() {
        assert_eq!(found("table").2, ["frame of unknown size in table: 72 bytes by its code, 73 by the compiler"]);
    }

    #[test]
    fn what_has_no_bound_is_told_by_name() {
        let flaw = |name: &str| found(name).2.join("; ");
        assert_eq!(flaw("circle"), "recursion: circle calls circle");
        assert_eq!(flaw("pointer"), "indirect call or jump in pointer at 0x48: blx r0");
        assert!(flaw("variable").starts_with("frame of unknown size in variable at 0x5c: sub"), "{}", flaw("variable"));
        assert!(flaw("uneven").starts_with("frame of unknown size in uneven at 0x66: "), "{}", flaw("uneven"));
    }
}
