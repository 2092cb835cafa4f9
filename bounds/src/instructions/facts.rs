//! How often the loops of the machine code go round.

mod ground;
mod matching;

use crate::work::Shape;

/// Where a loop stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum At {
    /// A file of the core, and part of the line that leads back to the head of the loop.
    Line(&'static str, &'static str),
    /// All loops of a function.
    Function(&'static str),
    /// A loop of a function by its number, in the order of their addresses.
    LoopOf(&'static str, usize),
    /// The loop of a function whose code tells no line.
    Unwritten(&'static str),
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
    /// Loops that take so many steps together, by a name that [`Stage::groups`] has.
    pub(super) group: Option<&'static str>,
    /// Whether it is told of every stage, and need not be in each.
    pub(super) is_shared: bool,
}

impl Fact {
    /// As [`Self::by`], where a round may end before all of them.
    const fn early(mut self, by: usize) -> Self {
        (self.by, self.written, self.most.each) = (by, by, by as u64);
        self
    }

    const fn of(mut self, group: &'static str) -> Self {
        self.group = Some(group);
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
            At::Line(file, text) | At::Code(file, text) => format!("{file}: {text}"),
            At::Function(name) => name.to_owned(),
            At::LoopOf(name, nth) => format!("loop {nth} of {name}"),
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
    Fact { at: At::Line(file, text), most: Most { each: 0, more }, by: 1, written: 1, group: None, is_shared: false }
}

const fn each(file: &'static str, text: &'static str, each: u64) -> Fact {
    Fact { at: At::Line(file, text), most: Most { each, more: 0 }, by: 1, written: 1, group: None, is_shared: false }
}

/// What runs so often at most.
const fn ran(file: &'static str, text: &'static str, more: u64) -> Fact {
    Fact { at: At::Code(file, text), most: Most { each: 0, more }, by: 1, written: 1, group: None, is_shared: false }
}

pub(super) fn stages(shape: &Shape) -> Vec<Stage> {
    let works = shape.stages();
    let of = |stage: &str, name: &str| -> u64 {
        let work = works.iter().find(|work| work.stage == stage).expect("a stage");
        work.loops.iter().find(|(other, _)| *other == name).expect("a loop").1
    };
    let (width, height) = (shape.width, shape.height);
    let pixels = width * height;
    let rows = 2 * (height + shape.exchanged_rows());
    let rows_of_tiles = height * width.div_ceil(32);
    let (tiles_down, tiles) = (height.div_ceil(32), height.div_ceil(32) * width.div_ceil(32));
    let cells = shape.settings.map.geometry.len() as u64;
    let limit = shape.wire_runs.min(cells);
    vec![
        Stage {
            name: "rectify",
            entries: vec![("entry_rectify_row", rows)],
            facts: [
                vec![
                    total("rectify/sample.rs", "for chunk in", rows * (width / 8)),
                    each("rectify/mod.rs", "for (to, from) in copied", width),
                    each("rectify/sample.rs", "for pixel in out {", 8),
                ],
                library([width / 4; 2], [0; 2]),
            ]
            .concat(),
            calls: vec![],
            groups: vec![],
        },
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
                    total("validate/mod.rs", "for place in 0..used {", of("validate", "places")),
                    total(
                        "validate/mod.rs",
                        "for (&here, above) in || renumbered.get_mut(root)",
                        of("validate", "runs"),
                    ),
                    each("validate/mod.rs", "for place in 0..if below", width),
                    total("validate/mod.rs", "while let Some(Step", of("validate", "pixels_taken_out")),
                ],
                // Pieces of 64 bytes, and the entries of the surfaces that go on, 8 bytes each.
                library([32, 32], [height * width, 2 * height * width]),
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
                    // Once more each than it exchanges: as often as runs are sorted, come into the heap, and become one.
                    sifts("loop { <- sift_down(rest, 0)", sorting(limit)),
                    sifts("loop { <- sift_down(heap, parent)", limit),
                    sifts(
                        "loop { || heap.swap(a, b) <- sift_down(heap, 0)",
                        of("wire", "sifts") - sorting(limit) - limit,
                    ),
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
        Stage {
            name: "surfaces",
            entries: vec![("entry_surfaces_run", 1)],
            facts: [
                vec![
                    unwritten("fencepost_core::surfaces::part::Part::keep_largest", tiles),
                    total("surfaces/tile.rs", "for (y, row) in rows.iter_mut()", rows_of_tiles),
                    each("links.rs", "for (flag, (a, b)) in || *flag = u8::from(a.abs_diff", 32).by(8),
                    total("surfaces/tile.rs", "for (run, bit) in (runs..AREA)", pixels),
                    total("links.rs", "bit <- for bit in each_bit(up", of("surfaces", "joins")),
                    total("links.rs", "bit <- for bit in each_bit(links.starts())", pixels),
                    total("surfaces/tile.rs", "if parent == place", of("surfaces", "hops")),
                    total("surfaces/tile.rs", "for run in 0..runs", pixels),
                    total("surfaces/tile.rs", "for (y, links) in rows", rows_of_tiles),
                    total("surfaces/mod.rs", "here.get(first) <- for (label, run) in segments(self.labels", pixels),
                    total("surfaces/mod.rs", "here.get(first) <- for (label, run) in segments(labels)", pixels),
                    total("surfaces/mod.rs", "*farthest = run.iter()", pixels).by(4),
                    each("surfaces/mod.rs", "here.iter_mut().zip(labels)", width % 32),
                    total("surfaces/mod.rs", "farthest.iter().zip(", of("surfaces", "planes")),
                    total("surfaces/mod.rs", "if labels.iter().all(", pixels).early(4),
                    total("surfaces/moments.rs", "for z in z {", pixels),
                    total("surfaces/moments.rs", "for ((z, square), column) || *square = ", 3 * 32 * rows_of_tiles)
                        .by(8),
                    total("surfaces/moments.rs", "for (&square, column)", 3 * 32 * rows_of_tiles).by(8).written(8),
                    total("surfaces/mod.rs", "for (i, number) in renumbered", of("surfaces", "planes")),
                    total("surfaces/mod.rs", "for y in 0..tile.height { then for &label", rows_of_tiles),
                    total("surfaces/mod.rs", "for y in 0..tile.height { then let pixels", rows_of_tiles),
                    total("surfaces/mod.rs", "for y in 0..tile.height { then let v", rows_of_tiles),
                    total("surfaces/mod.rs", "for y in 0..tile.height { then for label", rows_of_tiles),
                    total("surfaces/mod.rs", "for label in self.labels || *label = usize::from", pixels)
                        .by(4)
                        .written(8),
                    // Which are kept where there are too many.
                    total("surfaces/mod.rs", "for &label in self.labels", pixels).by(4),
                    total(
                        "surfaces/mod.rs",
                        "for &pixels in pixels.iter() || if let Some(count) = by_size",
                        51 * tiles,
                    ),
                    each("surfaces/mod.rs", "for (i, &count) in by_size", 1024),
                    each(
                        "surfaces/mod.rs",
                        "*found = stage.go_through || let found = part.label_tiles || keep = part.keep_largest",
                        tiles,
                    ),
                    each("surfaces/mod.rs", "part.measure_tiles::", tiles),
                ],
                angles(),
                // The numbers of the runs of a row, byte by byte or a word at a time; and what a tile begins with.
                fills(pixels, tiles * 128),
                // What lies beside a tile: how the pixels of its rows hang together, and sizes where there are too many.
                library([32, 32], [64 * tiles + 512, 64 * tiles]),
            ]
            .concat(),
            calls: vec![("libm::math::rem_pio2f::rem_pio2f", 0)],
            groups: vec![],
        },
        ground::stage(shape, &of),
        matching::stage(shape, &of),
    ]
}

/// A loop that goes down the heap of the wire.
const fn sifts(text: &'static str, more: u64) -> Fact {
    Fact {
        at: At::Line("wire/select.rs", text),
        most: Most { each: 1, more },
        by: 1,
        written: 1,
        group: None,
        is_shared: false,
    }
}

/// Exchanges of a heap of so many when it is sorted.
fn sorting(limit: u64) -> u64 {
    (1..limit).map(|left| 1 + u64::from(left.ilog2())).sum()
}

/// Sines and cosines of angles of less than two turns: nothing is done about larger ones. Exponents have no more bits to be found
/// than a number has.
fn angles() -> Vec<Fact> {
    vec![function("libm::math::rem_pio2f::rem_pio2f", 0, 0), each("planes/eigen.rs", "libm::ilogbf", 24)]
}

/// The loop of a function that no line leads back to the head of.
const fn unwritten(name: &'static str, more: u64) -> Fact {
    Fact { at: At::Unwritten(name), most: Most { each: 0, more }, by: 1, written: 1, group: None, is_shared: false }
}

/// The first loop of a function, around all others.
const fn outermost(name: &'static str, more: u64) -> Fact {
    Fact { at: At::LoopOf(name, 0), most: Most { each: 0, more }, by: 1, written: 1, group: None, is_shared: false }
}

const fn function(name: &'static str, each: u64, more: u64) -> Fact {
    Fact { at: At::Function(name), most: Most { each, more }, by: 1, written: 1, group: None, is_shared: false }
}

/// Fills of `bytes` in all, and of `words` beside.
fn fills(bytes: u64, words: u64) -> Vec<Fact> {
    let fact = |nth, more| Fact {
        at: At::LoopOf("__aeabi_memset", nth),
        most: Most { each: 0, more },
        by: 1,
        written: 1,
        group: None,
        is_shared: false,
    };
    vec![fact(0, bytes), fact(1, bytes / 4 + words), fact(2, bytes)]
}

/// The memory functions: each fill and copy has so many words at most, the first where it is known that they are whole words, and some have
/// so many more together: fills, and copies.
fn library([aligned, each]: [u64; 2], [filled, copied]: [u64; 2]) -> Vec<Fact> {
    let fact = |name, nth, each, more| {
        let most = Most { each, more };
        Fact { at: At::LoopOf(name, nth), most, by: 1, written: 1, group: None, is_shared: true }
    };
    let mut facts = Vec::new();
    for name in ["__aeabi_memclr", "__aeabi_memset"] {
        // Bytes to the first word, words, and bytes behind the last one.
        facts.extend([fact(name, 0, 16, 0), fact(name, 1, each, filled), fact(name, 2, 16, 0)]);
    }
    let by_word = [
        ("__aeabi_memclr4", filled),
        ("__aeabi_memclr8", filled),
        ("__aeabi_memset4", filled),
        ("__aeabi_memcpy4", copied),
    ];
    for (name, more) in by_word {
        facts.extend([fact(name, 0, aligned, more), fact(name, 1, 3, 0)]);
    }
    let name = "compiler_builtins::mem::memcpy";
    facts.extend([
        fact(name, 0, 16, 0),
        fact(name, 1, each, copied),
        fact(name, 2, 16, 0),
        fact(name, 3, each, copied),
    ]);
    facts
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
            let grown = facts.filter(|(small, large)| small.most.more < large.most.more).count();
            assert!(grown > 0 || small.name == "wire", "{}", small.name);
        }
    }
}
