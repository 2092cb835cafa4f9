//! How often the loops of the matching go round.

use fencepost_core::matching::{MatchSettings, Prefilter};

use super::{Stage, each, library, outermost, total, unwritten};
use crate::work::Shape;

/// The matching by census with the instructions of the processor: the other ways that are linked along are not gone.
pub(super) fn stage(shape: &Shape, of: &dyn Fn(&str, &str) -> u64) -> Stage {
    let of = |name| of("match", name);
    let settings = &shape.settings.matching;
    let (width, disparities) = (shape.width, shape.disparities);
    let pushed = shape.height + shape.exchanged_rows();
    let [narrow, wide] = ["narrow_costs", "wide_costs"].map(|name| of(name) / disparities);
    let (decided, scanned) = (of("decided_pixels"), of("pixels_scanned_for_weak"));
    let chunks = decided / 64;
    let filtered = of("filtered_pixels") / 3;
    let margin = u64::from(settings.window_height) / 2 + 3;
    let rows = shape.height - 2 * margin + shape.exchanged;
    let begins = 1 + shape.exchanged;
    let blocks = disparities.div_ceil(8);
    let starts = of("costs_begun_afresh") / disparities;
    // Chunks of a row that is gone through as a whole: what comes on top of them begins afresh.
    let narrow_chunks = rows * (narrow / rows).div_ceil(64);
    let wide_chunks = narrow_chunks + rows * (wide / rows).div_ceil(64);
    // Pixels of which not all places are candidates: near the left end of a row, and near the right end of the other picture's.
    let cut = 2 * rows * disparities;
    let never = |file, text| total(file, text, 0);
    Stage {
        name: "match",
        // Each row that comes is asked for one that goes until there is none.
        entries: vec![("entry_match_begin", begins), ("entry_match_push", pushed), ("entry_match_pull", 2 * pushed)],
        facts: [
            vec![
                never("arch/plain.rs", ""),
                // Rows that come.
                total("matching/rows.rs", "[(&*grey_left", 2 * filtered / width),
                total("matching/prefilter.rs", "for (out, &grey) in", if grey(settings) { 2 * filtered } else { 0 })
                    .by(4),
                total("matching/prefilter.rs", "for ((out, ((&a1", if grey(settings) { 0 } else { 2 * filtered })
                    .by(4)
                    .written(24),
                total("arch/thumb/census.rs", "asm!(", 2 * filtered / 4),
                // What is left of a row of a width that is no multiple of four.
                each("matching/census.rs", "for ((code, &centre)", (width - 6) % 4),
                total("matching/rows.rs", "for ((low, high), &grey)", filtered).by(2).written(4),
                each("matching/rows.rs", "self.kept_spans[y % KEPT] = around", 7),
                total("matching/rows.rs", "for (sum, (&here, &flags))", 2 * filtered).by(4).written(8),
                total("arch/thumb/slide.rs", "asm!(", of("column_costs_slid") / 2 / 8),
                total("arch/thumb/slide.rs", "enter.left.iter().zip(leave.left)", filtered).of("rows in"),
                total(
                    "arch/thumb/slide.rs",
                    "for (x, &left_in) in (0..width).zip(enter.left)",
                    begins * u64::from(settings.window_height) * width,
                )
                .of("rows in"),
                total(
                    "arch/thumb/slide.rs",
                    "for (sums, right_in)",
                    begins * u64::from(settings.window_height) * width * disparities / 4,
                ),
                // Rows that go.
                total("matching/mod.rs", "out.fill(DisparityPixel", 2 * pushed * width).by(2),
                total("matching/mod.rs", "weak.contains(&true)", rows * width).early(4),
                each("matching/rows.rs", "(first..y.saturating_add(radius))", u64::from(settings.window_height) + 2),
                total("matching/best.rs", "self.tables.as_flattened_mut().fill", rows * 3 * width).by(32),
                total("matching/best.rs", "for (second, &first)", rows * 3 * width / 2).by(4).written(16),
                total(
                    "matching/mod.rs",
                    "if run.is_empty() && window == || search.follows = || loop {",
                    chunks + 2 * rows,
                ),
                // A block more, and what is left of it, for each run of weak pixels.
                total("matching/mod.rs", "blocks.find(", scanned / 32 + chunks),
                total("matching/mod.rs", "let some = |block", scanned + 32 * chunks).by(4),
                total("matching/mod.rs", "pixels.iter().position(", scanned).early(4),
                total("matching/mod.rs", "for (i, &weak) in || if weak { || if gap > most_gap", scanned),
                total(
                    "arch/decide.rs",
                    ".fold(0u32, |sum, &column|",
                    rows * u64::from(settings.window_width) * (narrow / rows).div_ceil(64)
                        + u64::from(settings.wide_window_width) * (chunks - narrow_chunks),
                )
                .by(3),
                total("arch/decide.rs", "for ((out, &enter), &leave)", narrow + wide).by(4).written(8),
                total("arch/decide.rs", "*out = sum", narrow + wide).by(2),
                total("arch/decide.rs", "*weak = u8::from(", decided).by(16),
                total("arch/decide.rs", "for (number, (decided, untold))", (narrow + wide) / 16 + chunks),
                each(
                    "arch/decide.rs",
                    "for (((offset, &farther), &best), &nearer) in all then *offset = refine_small",
                    16,
                )
                .by(2)
                .written(6),
                each("arch/decide.rs", "for (((offset, &farther), &best), &nearer) in all then *offset = refine(", 16)
                    .by(2)
                    .written(6),
                each("arch/decide.rs", "for i in 0..PART || decided[i] = ", 16).by(2),
                total("arch/decide.rs", "for ((out, weak), (&decided, &untold))", narrow + wide),
                total("arch/decide.rs", "for (start, out) in (first..end)", narrow_chunks),
                total("arch/decide.rs", "for (disparity, pixel) in || *disparity = ((pixel.bits()", narrow).by(4),
                total("arch/decide.rs", "for ((back, &disparity), x)", 64 * narrow_chunks).by(4),
                total("arch/decide.rs", "for (pixel, (&disparity, &back))", narrow).by(4).written(8),
                // The search, pixel by pixel and block by block.
                outermost("fencepost_core::arch::thumb::search::search_keys", narrow),
                outermost("fencepost_core::arch::thumb::search::search_costs", wide),
                total("arch/thumb/search.rs", "asm!( <- self.key_blocks(", narrow * blocks).of("blocks"),
                total("arch/thumb/search.rs", "asm!( <- self.cost_blocks(", wide * blocks).of("wide blocks"),
                total("arch/thumb/search.rs", "asm!( <- self.least()", (narrow + wide) * blocks),
                total("arch/thumb/search.rs", "asm!( <- self.next_below(", (narrow + wide) * (blocks + 4)),
                each("arch/thumb/search.rs", ">= AMBIGUOUS", 4),
                total("arch/thumb/search.rs", "near = inside.fold", 8 * 2 * cut).by(4),
                total("arch/thumb/search.rs", "for block in 0..first <- costs.go_on::<true>", narrow * blocks)
                    .of("blocks"),
                total("arch/thumb/search.rs", "for block in 0..first <- costs.go_on::<false>", wide * blocks)
                    .of("wide blocks"),
                total("arch/thumb/search.rs", "for place in candidates.start.max", cut * (8 + disparities.div_ceil(2))),
                total("arch/thumb/search.rs", "for x in range.clone() || let four = unsafe", starts * 2 * blocks).by(4),
                each("arch/thumb/search.rs", "for word in 0..words", 2 * blocks),
                total("arch/thumb/search.rs", "(0..self.blocks).find(", wide * blocks).early(4),
                total("arch/thumb/search.rs", "places.clone().find(", wide * 8).early(4),
                unwritten("fencepost_core::matching::Matcher::pass", chunks + 2 * rows),
            ],
            // Rows, and the sums of all columns of nine pictures and strips that begin.
            library([32, width / 4], [begins * (width * disparities / 2 + width), 0]),
        ]
        .concat(),
        calls: vec![
            ("fencepost_core::arch::plain::search_costs", 0),
            ("fencepost_core::arch::thumb::search::search_keys", narrow_chunks),
            ("fencepost_core::arch::thumb::search::search_costs", chunks - narrow_chunks),
            ("fencepost_core::arch::thumb::search::Costs::begin", chunks - wide_chunks + rows),
        ],
        groups: vec![("rows in", filtered), ("blocks", narrow * blocks), ("wide blocks", wide * blocks)],
    }
}

fn grey(settings: &MatchSettings) -> bool {
    settings.prefilter == Prefilter::Grey
}
