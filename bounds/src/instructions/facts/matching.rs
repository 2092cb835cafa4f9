//! How often the loops of the matching go round.

use fencepost_core::matching::{MatchSettings, Prefilter};

use super::{Stage, each, library, line_of, total, unwritten};
use crate::work::Shape;

/// The matching of the picture: each row that comes is asked for one that goes until there is none.
pub(super) fn picture(shape: &Shape) -> Stage {
    facts("match", shape, [1, 0], [shape.height, 2 * shape.height])
}

/// Strips that are matched the other way round where hardly anything matches, of which one row each is asked for.
pub(super) fn strips(shape: &Shape) -> Stage {
    let strips = Shape::EXCHANGED;
    facts("strips", shape, [0, strips], [shape.exchanged_rows(), strips])
}

/// The matching by census with the instructions of the processor, of a picture or of strips, where `begins` pictures are begun, `pushed`
/// rows come, and `pulled` times one that goes is asked for: the other ways that are linked along are not gone.
fn facts(name: &'static str, shape: &Shape, [pictures, strips]: [u64; 2], [pushed, pulled]: [u64; 2]) -> Stage {
    let begins = pictures + strips;
    let loops = shape.matching_of(pictures, strips);
    let of = |name| loops.iter().find(|(other, _)| *other == name).expect("a loop").1;
    let settings = &shape.settings.matching;
    let (width, disparities) = (shape.width, shape.disparities);
    let [narrow, wide] = ["narrow_costs", "wide_costs"].map(|name| of(name) / disparities);
    let (decided, scanned) = (of("decided_pixels"), of("pixels_scanned_for_weak"));
    let chunks = decided / 64;
    let filtered = of("filtered_pixels") / 3;
    // Pixels of rows that leave the window as others come in. A strip has no more rows than the window, so that none leaves it.
    let leaving = of("column_costs_slid") / disparities - filtered;
    let margin = u64::from(settings.window_height) / 2 + 3;
    let rows = pictures * (shape.height - 2 * margin) + strips;
    let blocks = disparities.div_ceil(8);
    let starts = of("costs_begun_afresh") / disparities;
    // Chunks of a row that is gone through as a whole.
    let narrow_chunks = rows * (narrow / rows).div_ceil(64);
    let edges = Edges::of(disparities);
    // Of each row that both windows go along.
    let on_edges = |of_a_row: u64| 2 * rows * of_a_row;
    let pixels = |name, most| line_of(name, "arch/thumb/search.rs", "for (i, x) in (0..CHUNK)", most);
    let never = |file, text| total(file, text, 0);
    Stage {
        name,
        entries: vec![("entry_match_begin", begins), ("entry_match_push", pushed), ("entry_match_pull", pulled)],
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
                total("matching/rows.rs", "for (sum, (&here, &flags))", filtered + leaving).by(4).written(8),
                total("arch/thumb/slide.rs", "asm!(", leaving * disparities / 8),
                total("arch/thumb/slide.rs", "enter.left.iter().zip(leave.left)", leaving).of("rows in"),
                total(
                    "arch/thumb/slide.rs",
                    "for (x, &left_in) in (0..width).zip(enter.left)",
                    begins * u64::from(settings.window_height) * width,
                )
                .of("rows in"),
                total(
                    "arch/thumb/slide.rs",
                    "for (sums, right_in) || *sums = u32",
                    begins * u64::from(settings.window_height) * width * disparities / 4,
                )
                .by(4),
                // Rows that go.
                total("matching/mod.rs", "out.fill(DisparityPixel", pulled * width).by(2),
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
                pixels("fencepost_core::arch::thumb::search::search_keys", narrow),
                pixels("fencepost_core::arch::thumb::search::search_costs", wide).weighs(2 * blocks).of("columns"),
                total("arch/thumb/search.rs", "asm!( <- self.key_blocks(", narrow * blocks).of("blocks"),
                total("arch/thumb/search.rs", "asm!( <- self.cost_blocks(", wide * blocks).of("wide blocks"),
                total("arch/thumb/search.rs", "asm!( <- self.least()", (narrow + wide) * blocks),
                // Of each block once: it goes on behind the one that was found.
                total("arch/thumb/search.rs", "asm!( <- self.next_below(", (narrow + wide) * blocks),
                each("arch/thumb/search.rs", ">= AMBIGUOUS", 4),
                total("arch/thumb/search.rs", "places.fold(0u32, |near", on_edges(edges.partly)).by(4),
                total("arch/thumb/search.rs", "for block in 0..first <- costs.go_on::<true>", rows * edges.blocks)
                    .of("blocks"),
                total("arch/thumb/search.rs", "for block in 0..first <- costs.go_on::<false>", rows * edges.blocks)
                    .of("wide blocks"),
                total("arch/thumb/search.rs", "for place in candidates.start.max", on_edges(edges.places)),
                total("arch/thumb/search.rs", "for x in range.clone() || let four = unsafe", starts * 2 * blocks)
                    .by(4)
                    .of("columns"),
                each("arch/thumb/search.rs", "for word in 0..words", 2 * blocks),
                total("arch/thumb/search.rs", "(0..self.blocks).find(", wide * blocks).early(4),
                total("arch/thumb/search.rs", "places.clone().find(", wide * 8).early(4),
                unwritten("fencepost_core::matching::Matcher::pass", chunks + 2 * rows),
            ],
            // Rows, and the sums of all columns of pictures and strips that begin.
            library([32, width / 4], [begins * (width * disparities / 2 + width), 0]),
        ]
        .concat(),
        calls: vec![
            ("fencepost_core::arch::plain::search_costs", 0),
            ("fencepost_core::arch::thumb::search::search_keys", narrow_chunks),
            ("fencepost_core::arch::thumb::search::search_costs", chunks - narrow_chunks),
            ("fencepost_core::arch::thumb::search::Costs::begin", rows * (1 + shape.wide_runs()[0])),
            ("fencepost_core::arch::thumb::search::Costs::below_at_edge", on_edges(edges.parts)),
        ],
        groups: vec![
            ("rows in", filtered),
            ("blocks", narrow * blocks),
            ("wide blocks", wide * blocks),
            // Words of columns: where the wide window starts anew it does not go on.
            ("columns", rows * shape.columns_summed() * 2 * blocks),
        ],
    }
}

/// What the ends of a row take, where not all places of a pixel are candidates: the next pixel has one more or one less, and there are
/// as many of these pixels at either end as there are places but one.
struct Edges {
    /// Blocks of eight places that are gone through place by place: those in front of the first that is whole at the left end, all at the
    /// right end.
    blocks: u64,
    /// Candidates in these blocks.
    places: u64,
    /// Blocks that have candidates and other places, of which each pixel has one at most.
    parts: u64,
    /// Candidates in these.
    partly: u64,
}

impl Edges {
    fn of(disparities: u64) -> Self {
        let cut = 1..disparities;
        let partly = cut.clone().map(|missing| (8 - missing % 8) % 8).sum::<u64>();
        let blocks = cut.clone().map(|missing| missing.div_ceil(8) + disparities.div_ceil(8)).sum();
        let parts = 2 * cut.clone().filter(|missing| missing % 8 != 0).count() as u64;
        Self { blocks, places: partly + cut.sum::<u64>(), parts, partly: 2 * partly }
    }
}

fn grey(settings: &MatchSettings) -> bool {
    settings.prefilter == Prefilter::Grey
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_of_a_row_take_what_their_pixels_take_one_by_one() {
        for disparities in [16, 48, 128] {
            let (mut blocks, mut places, mut parts, mut partly) = (0, 0, 0, 0);
            // As the search goes along: columns of the left picture, the right one's from 200 up to 600.
            for x in 0..1000_u64 {
                let largest = (disparities - 1).min(x.saturating_sub(200));
                let smallest = (x + 1).saturating_sub(600);
                if x < 200 || largest < smallest {
                    continue;
                }
                let candidates = disparities - 1 - largest..disparities - smallest;
                let is_candidate = |place: &u64| candidates.contains(place);
                let of_block = |block: u64| (8 * block..8 * block + 8).filter(is_candidate).count() as u64;
                let all = 0..disparities / 8;
                let first = if candidates.end == disparities { candidates.start.div_ceil(8) } else { disparities / 8 };
                blocks += first;
                places += (0..first).map(of_block).sum::<u64>();
                let of_parts: Vec<_> = all.map(of_block).filter(|count| (1..8).contains(count)).collect();
                parts += of_parts.len() as u64;
                partly += of_parts.iter().sum::<u64>();
            }
            let edges = Edges::of(disparities);
            assert_eq!(
                [edges.blocks, edges.places, edges.parts, edges.partly],
                [blocks, places, parts, partly],
                "{disparities}"
            );
        }
    }
}
