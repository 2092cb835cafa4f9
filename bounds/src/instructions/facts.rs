//! How often the loops of the machine code go round.

mod ground;
mod health;
mod matching;
mod surfaces;

use super::memory::library;
use crate::work::Shape;

/// Where a loop stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum At {
    /// A file of the core, and part of the line that leads back to the head of the loop.
    Line(&'static str, &'static str),
    /// The same in one function of the image, which comes first.
    LineOf(&'static str, &'static str, &'static str),
    /// All loops of a function.
    Function(&'static str),
    /// A loop of a function by its number, in the order of their addresses.
    LoopOf(&'static str, usize),
    /// Several of those.
    LoopsOf(&'static [(&'static str, usize)]),
    /// The loop of a function whose code tells no line.
    Unwritten(&'static str),
    /// No loop, but what a line of the core writes to memory, wherever it was inlined.
    Written(&'static str, &'static str),
    /// No loop: the code of a line, and of what was inlined there, but for the loops in it. Each block of it runs so often.
    Code(&'static str, &'static str),
}

/// How often it goes round: so often each time it is entered, and so often more for a frame. Loops that are told of the same are that
/// together, unless it is by entry alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Most {
    pub(super) each: u64,
    pub(super) more: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Fact {
    pub(super) at: At,
    pub(super) most: Most,
    /// Steps of source that a round of it takes, where the compiler has unrolled it: as often, at least, its line is in its code.
    pub(super) by: usize,
    /// Reads or writes of its line that its code has at least: those of so many steps.
    pub(super) written: usize,
    /// Loops that take so many steps together, by a name that [`Stage::groups`] has; without, as many more as any of them may alone.
    pub(super) group: Option<&'static str>,
    /// More of them.
    pub(super) beside: &'static [&'static str],
    /// Of these, for each step of this loop.
    pub(super) weight: u64,
    /// How often it is entered for a frame.
    pub(super) entered: Option<u64>,
    /// What each time counts for that it is entered, in a group.
    pub(super) begins: Option<(&'static str, u64)>,
    /// Whether only its ways back to the head count, and not that it begins: it is left within a round.
    pub(super) by_ways_back: bool,
    /// Whether it is told of every stage, and need not be in each.
    pub(super) is_shared: bool,
}

impl Fact {
    pub(super) const fn new(at: At, each: u64, more: u64) -> Self {
        let most = Most { each, more };
        Self {
            at,
            most,
            by: 1,
            written: 1,
            group: None,
            beside: &[],
            weight: 1,
            entered: None,
            begins: None,
            by_ways_back: false,
            is_shared: false,
        }
    }

    const fn by_ways_back(mut self) -> Self {
        self.by_ways_back = true;
        self
    }

    const fn entered(mut self, times: u64) -> Self {
        self.entered = Some(times);
        self
    }

    const fn is_shared(mut self) -> Self {
        self.is_shared = true;
        self
    }

    const fn begins(mut self, group: &'static str, weight: u64) -> Self {
        self.begins = Some((group, weight));
        self
    }

    /// As [`Self::by`], where a round may end before all of them.
    const fn early(mut self, by: usize) -> Self {
        (self.by, self.written, self.most.each) = (by, by, by as u64);
        self
    }

    const fn of(mut self, group: &'static str) -> Self {
        self.group = Some(group);
        self
    }

    const fn and_of(mut self, groups: &'static [&'static str]) -> Self {
        self.beside = groups;
        self
    }

    const fn weighs(mut self, weight: u64) -> Self {
        self.weight = weight;
        self
    }

    const fn by(mut self, by: usize) -> Self {
        (self.by, self.written) = (by, by);
        self
    }

    /// For a line whose steps read or write more than once.
    const fn written(mut self, times: usize) -> Self {
        self.written = times;
        self
    }

    pub(super) fn place(&self) -> String {
        match self.at {
            At::Line(file, text) | At::Written(file, text) | At::Code(file, text) => format!("{file}: {text}"),
            At::LineOf(name, file, text) => format!("{file}: {text} in {name}"),
            At::Function(name) => name.to_owned(),
            At::LoopOf(name, nth) => format!("loop {nth} of {name}"),
            At::LoopsOf(loops) => {
                let places: Vec<_> = loops.iter().map(|(name, nth)| format!("loop {nth} of {name}")).collect();
                places.join(", ")
            }
            At::Unwritten(name) => format!("the loop without a line of {name}"),
        }
    }
}

pub(super) struct Stage {
    pub(super) name: &'static str,
    /// Functions that it begins with, and how often for a frame.
    pub(super) entries: Vec<(&'static str, u64)>,
    pub(super) facts: Vec<Fact>,
    /// Functions that are called so often for a frame at most.
    pub(super) calls: Vec<(&'static str, u64)>,
    /// Steps of loops together.
    pub(super) groups: Vec<(&'static str, u64)>,
}

const fn total(file: &'static str, text: &'static str, more: u64) -> Fact {
    Fact::new(At::Line(file, text), 0, more)
}

/// A line of the core in one function.
const fn line_of(name: &'static str, file: &'static str, text: &'static str, more: u64) -> Fact {
    Fact::new(At::LineOf(name, file, text), 0, more)
}

const fn each(file: &'static str, text: &'static str, each: u64) -> Fact {
    Fact::new(At::Line(file, text), each, 0)
}

/// What runs so often at most.
const fn ran(file: &'static str, text: &'static str, more: u64) -> Fact {
    Fact::new(At::Code(file, text), 0, more)
}

pub(super) fn stages(shape: &Shape) -> Vec<Stage> {
    let works = shape.stages();
    let of = |stage: &str, name: &str| -> u64 {
        let work = works.iter().find(|work| work.stage == stage).expect("a stage");
        work.loops.iter().find(|(other, _)| *other == name).expect("a loop").1
    };
    let (width, height) = (shape.width, shape.height);
    let pixels = width * height;
    let rows_of_tiles = height * width.div_ceil(32);
    let (tiles_down, tiles) = (height.div_ceil(32), height.div_ceil(32) * width.div_ceil(32));
    let cells = shape.settings.map.geometry.len() as u64;
    let limit = shape.wire_runs.min(cells);
    // Runs that take the place of another in the list of the wire.
    let replaced = (of("wire", "sifts") - limit - (limit - 1) - sorting(limit)) / u64::from(limit.ilog2());
    vec![
        rectify(width, 2 * height),
        Stage {
            name: "validate",
            entries: vec![("entry_validate_run", 1)],
            facts: [
                vec![
                    total("validate/mod.rs", "for y in 0..picture.len()", height),
                    total("validate/mod.rs", "for x in (0..row.len()).step_by(PIECE)", of("validate", "pieces")),
                    each("links.rs", "for (flag, (a, b)) in || *flag = u8::from(a.abs_diff", 32).by(8),
                    total("links.rs", "(bit != 0)", of("validate", "starts_and_joins")),
                    total("validate/mod.rs", "filter(|&parent| parent != label)", of("validate", "hops")),
                    each("links.rs", "for (to, from) in piece.iter_mut().zip(pixels)", width % 32),
                    // What stands for each, and what has ended.
                    total("validate/mod.rs", "for place in 0..used { then let Some(parent)", of("validate", "places")),
                    total(
                        "validate/mod.rs",
                        "for place in 0..used { then let (table, numbers)",
                        of("validate", "places"),
                    ),
                    total(
                        "validate/mod.rs",
                        "for (&here, above) in || renumbered.get_mut(root)",
                        of("validate", "runs"),
                    ),
                    each("validate/mod.rs", "for place in 0..if below", width),
                    total("validate/mod.rs", "while let Some(Step", of("validate", "pixels_taken_out")),
                    // Each pixel once, wherever the walk comes to it from.
                    written("validate/mod.rs", "*pixel = none", of("validate", "pixels_taken_out")),
                    // How all pieces of the row above hang together is kept up to this width.
                    written(
                        "validate/mod.rs",
                        "None => Links::of(&pixels_above",
                        if width <= 4096 { 0 } else { pixels },
                    ),
                ],
                // Pieces of 64 bytes; numbers of surfaces, 2 bytes each; entries of the surfaces that go on, 8 bytes each.
                library([16, 16], [of("validate", "places").div_ceil(2), 2 * pixels]),
            ]
            .concat(),
            // A surface ends once.
            calls: vec![("fencepost_core::validate::SurfaceSize::take_out", pixels)],
            groups: vec![],
        },
        ground::obstacles(shape, &of),
        Stage {
            name: "map",
            entries: vec![("entry_map_run", 1)],
            facts: [
                vec![
                    total("map/builder.rs", "for (index, evidence) in", cells),
                    each("map/votes.rs", "for y0 in", tiles_down),
                    total(
                        "map/votes.rs",
                        "for x0 in || let found = self.surfaces.of_tile || if found.is_empty()",
                        tiles,
                    ),
                    total("map/votes.rs", "for (common, surface) in || *common = Common::of", of("map", "surfaces")),
                    total("map/votes.rs", "for y in y0", of("map", "rows_of_tiles")),
                    each("links.rs", "for (to, from) in piece.iter_mut().zip(pixels)", width % 32),
                    each("map/votes.rs", "for ((ray, first), step) in row.rays", 4),
                    total("map/votes.rs", "and_then(|i| self.common.get(i)) else { continue }", of("map", "runs")),
                    total("map/votes.rs", ".fill(noise)", of("map", "noise_filled")).by(3),
                    total("map/votes.rs", "for first in (0..TILE)", 32 * rows_of_tiles),
                    total("links.rs", "(bit != 0)", of("map", "votes")),
                    total("map/votes.rs", "evidence.height_dm = heights", 32 * rows_of_tiles).by(4),
                    each("map/shadow.rs", "pub(super) fn mark", 128),
                    total("map/shadow.rs", "for (index, cell) in map.cells", 2 * cells),
                    total("map/shadow.rs", "for nearest in", of("map", "directions")),
                    total("map/smear.rs", "for index in (0..map.cells", cells),
                    total("map/smear.rs", "let smears = (1..=", of("map", "cells_looked_back") / 2),
                    function("memcmp", 32, 0),
                ],
                // The rays of a row of a tile, and the table of cells.
                library([32, 32], [128 * rows_of_tiles + 3 * cells, 0]),
            ]
            .concat(),
            calls: vec![],
            groups: vec![],
        },
        Stage {
            name: "wire",
            entries: vec![("entry_wire_encode", 1)],
            facts: [
                vec![
                    total("wire/select.rs", "for (row, a) in", cells / u64::from(shape.settings.map.geometry.y_count)),
                    total("wire/select.rs", "for (b, cell) in", of("wire", "cells")),
                    // Exchanges: below the root for each run that is sorted, when the list becomes a heap, and below each run that
                    // another takes the place of.
                    sifts("loop { <- sift_down(rest, 0)", sorting(limit)),
                    sifts("loop { <- sift_down(heap, parent)", limit),
                    sifts("loop { || heap.swap(a, b) <- sift_down(heap, 0)", replaced * u64::from(limit.ilog2()))
                        .entered(replaced),
                    each("wire/select.rs", "for len in (1..heap.len())", shape.wire_runs),
                    each("wire/select.rs", "for parent in (0..heap.len() / 2)", shape.wire_runs / 2),
                    each("wire/select.rs", "runs.iter().fold(0u32", shape.wire_runs),
                    each("wire/select.rs", "while total >", shape.wire_runs),
                    total("wire/encoder.rs", "for (chunk, sequence) in", shape.wire_frames),
                    each("wire/protect.rs", "digest.update(data", 8),
                    each("wire/protect.rs", "digest.update(payload", 8),
                    each("wire/message/cells.rs", "for (k, run) in", shape.wire_runs.div_ceil(shape.wire_frames)),
                    function("compiler_builtins::int::specialized_div_rem::u64_div_rem", 64, 0),
                ],
                library([24; 2], [0; 2]),
            ]
            .concat(),
            // When the list is full, and before it is sorted.
            calls: vec![("fencepost_core::wire::select::heapify", 2)],
            groups: vec![],
        },
        surfaces::stage(shape, &of),
        ground::stage(shape, &of),
        matching::picture(shape),
        health::stage(shape, &of),
    ]
}

/// Rows that are rectified.
fn rectify(width: u64, rows: u64) -> Stage {
    Stage {
        name: "rectify",
        entries: vec![("entry_rectify_row", rows)],
        facts: [
            vec![
                each("rectify/sample.rs", "for chunk in", width / 8),
                each("rectify/mod.rs", "for (to, from) in copied", width),
                each("rectify/sample.rs", "for pixel in out {", 8),
            ],
            library([width / 4; 2], [0; 2]),
        ]
        .concat(),
        calls: vec![],
        groups: vec![],
    }
}

/// A loop that goes down the heap of the wire: it goes on with each exchange.
const fn sifts(text: &'static str, more: u64) -> Fact {
    total("wire/select.rs", text, more).by_ways_back()
}

/// What a line writes.
const fn written(file: &'static str, text: &'static str, more: u64) -> Fact {
    Fact::new(At::Written(file, text), 0, more)
}

/// Exchanges below the root of a heap of so many when it is sorted.
fn sorting(limit: u64) -> u64 {
    (1..limit).map(|left| u64::from(left.ilog2())).sum()
}

/// Sines and cosines of angles of less than two turns: nothing is done about larger ones. Exponents have no more bits to be found
/// than a number has.
fn angles() -> Vec<Fact> {
    vec![function("libm::math::rem_pio2f::rem_pio2f", 0, 0), each("planes/eigen.rs", "libm::ilogbf", 24)]
}

/// The loop of a function that no line leads back to the head of.
const fn unwritten(name: &'static str, more: u64) -> Fact {
    Fact::new(At::Unwritten(name), 0, more)
}

const fn function(name: &'static str, each: u64, more: u64) -> Fact {
    Fact::new(At::Function(name), each, more)
}

/// Whether the lines of a place, the innermost first, are what is meant: one of some texts, and perhaps what the next line must have and
/// what a line must have that it was inlined into.
pub(super) fn is_meant(meant: &str, lines: &[(String, String)]) -> bool {
    let (meant, outer) = meant.split_once(" <- ").map_or((meant, None), |(meant, outer)| (meant, Some(outer)));
    let is_inner = |(line, next): &(String, String)| {
        meant.split(" || ").any(|text| match text.split_once(" then ") {
            Some((text, behind)) => line.contains(text) && next.contains(behind),
            None => line.contains(text),
        })
    };
    let is_outer = |outer: &str| lines.iter().skip(1).any(|(line, _)| line.contains(outer));
    lines.first().is_some_and(is_inner) && outer.is_none_or(is_outer)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_is_meant_by_its_line_the_next_one_and_those_around() {
        let lines = [("for y in 0..4 {", "let v = y;"), ("self.fill(7)", "}")];
        let lines = lines.map(|(line, next)| (line.to_owned(), next.to_owned()));
        assert!(is_meant("for y in", &lines));
        assert!(is_meant("for x in || for y in", &lines));
        assert!(is_meant("for y in then let v", &lines) && !is_meant("for y in then let u", &lines));
        assert!(is_meant("for y in <- self.fill(", &lines) && !is_meant("for y in <- self.clear(", &lines));
        assert!(!is_meant("self.fill(", &lines) && !is_meant("for y in", &[]));
    }

    #[test]
    fn bounds_of_loops_grow_with_the_picture() {
        let [small, large] = [Shape::of(128, 96, 16), Shape::of(640, 480, 64)].map(|shape| stages(&shape));
        for (small, large) in small.iter().zip(&large) {
            let facts = small.facts.iter().zip(&large.facts);
            let is_more = |small: Most, large: Most| small.more < large.more || small.each < large.each;
            let grown = facts.filter(|(small, large)| is_more(small.most, large.most)).count();
            assert!(grown > 0 || small.name == "wire", "{}", small.name);
        }
    }
}
