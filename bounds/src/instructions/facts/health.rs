//! How often the loops of the health go round.

use fencepost_core::{health::HealthReason, map::SECTOR_COUNT};

use super::{Fact, Stage, each, matching, ran, total};
use crate::{
    instructions::memory::{copies, fills},
    work::Shape,
};

/// Strips with sparse matches, and places in each.
const STRIPS: u64 = 16;
const PLACES: u64 = 8;
/// Pixels of a row that are looked at together.
const LANES: u64 = 16;
/// Rows and columns of patches, and places of them that are compared.
const PATCH: u64 = 7;
/// Pixels of a row that those take.
const WINDOW: u64 = LANES + PATCH - 1;
/// Rows in which a patch is looked for; places where it is so over the whole range. In the lower half it is looked for along its own row
/// as well, twice. So often, in all, a patch is searched along a row.
const ROWS: u64 = 9;
const RANGES: u64 = 64;
const SEARCHED: u64 = (STRIPS * PLACES + RANGES) * ROWS + 2 * STRIPS / 2 * PLACES;
/// Edge of a block, and tiles down and across.
const BLOCK: u64 = 4;
const TILES: [u64; 2] = [12, 16];
/// Bands of rows at most, those around one, steps by which pictures may be out of line, pictures that are remembered.
const BANDS: u64 = 256;
const AROUND: u64 = 9;
const OUT_OF_LINE: u64 = 17;
const REMEMBERED: u64 = 5;

/// The looks at the rows, and the judgement with the strips that are matched the other way round.
pub(super) fn stage(shape: &Shape, of: &dyn Fn(&str, &str) -> u64) -> Stage {
    let (width, height) = (shape.width, shape.height);
    let matching = matching::strips(shape);
    // The sums of all columns of each strip, and the tables of both pictures.
    let filled = Shape::EXCHANGED * (width * shape.disparities / 2 + width)
        + 2 * (width / 2 + TILES[0] * TILES[1] * 3 / 2 + 2 * BANDS);
    // The rows of the strips, and the detection's place.
    let copied = 2 * shape.exchanged_rows() * (width / 4) + 64;
    Stage {
        name: "health",
        entries: vec![("entry_health_begin", 1), ("entry_health_rows", height), ("entry_health_judge", 1)],
        facts: [
            rows(width, height),
            sparse(of("health", "places_for_contrast").div_ceil(LANES), of("health", "patches_compared") / LANES),
            judged(shape),
            exchanged(shape),
            fills([width / 4; 2], filled),
            copies([WINDOW / 4; 2], copied),
            matching.facts,
        ]
        .concat(),
        calls: matching.calls,
        groups: matching.groups,
    }
}

/// What is seen of each row of both pictures.
fn rows(width: u64, height: u64) -> Vec<Fact> {
    vec![
        each("health/content.rs", "for (side, (row, span)) in", 2),
        total("health/tiles.rs", "for (block, quad) in || *block = block.saturating_add", 2 * height * (width / BLOCK))
            .by(4),
        total("health/tiles.rs", "for (column, (steps, count)) in", 2 * (height / BLOCK) * TILES[1]),
        total("health/tiles.rs", "for (&a, &b) in pairs", 2 * (height / BLOCK) * (width / BLOCK)),
        total("health/profile.rs", "let sum = valid.iter()", 2 * height * width).by(4),
        total("health/profile.rs", ".fold(0u32, |sum, (&after", 2 * height * width).by(4),
    ]
}

/// Sparse matches: the places with the most contrast, and what is compared there.
fn sparse(looked_at: u64, compared: u64) -> Vec<Fact> {
    vec![
        // A strip more each time that it goes back.
        total("health/content.rs", "while self.next_strip < STRIPS", STRIPS).by_ways_back(),
        total("health/row_error.rs", "for place in 0..PLACES", STRIPS * PLACES),
        total("health/row_error.rs", "for first in part.clone()", looked_at),
        total("health/row_error.rs", "if contrast < LEAST_CONTRAST || if !matches!(pixel.get()", LANES / 2 * looked_at)
            .by_ways_back(),
        total("health/row_error.rs", "[above, middle, below].iter().fold(0", (LANES + 1) * looked_at),
        total("health/row_error.rs", "while upto > first", compared),
        total("health/row_error.rs", "for (left, right) in rows", PATCH * compared),
        // The patch of the left picture lies within the row, whose end no place is nearer to than the margin. Of the windows of a search
        // one at most reads beyond it, as they go on to the left from what is valid.
        ran("health/row_error.rs", "padded.iter_mut() <- let left: [u8;", 0),
        ran("health/row_error.rs", "padded.iter_mut() <- let right: [u8;", PATCH * SEARCHED),
        total("health/row_error.rs", "for (column, &grey) in", PATCH * PATCH * compared),
        total("health/row_error.rs", "let least = costs.iter()", LANES * compared).by(4),
        total("health/row_error.rs", "(0..lanes).zip(&costs)", LANES * compared).by(4),
    ]
}

/// What all of it says.
fn judged(shape: &Shape) -> Vec<Fact> {
    let cells = shape.settings.map.geometry.len() as u64;
    let [across, down] = [shape.width, shape.height].map(|edge| edge.div_ceil(4));
    let lower = (shape.width * shape.height).div_ceil(2);
    vec![
        total("health/tiles.rs", "for row in 0..rows", 2 * TILES[0]),
        total("health/tiles.rs", "for column in 0..columns", 2 * TILES[0] * TILES[1]).by_ways_back(),
        each("health/tiles.rs", "let theirs = places.map", TILES[1]),
        each("health/pairing.rs", "for (profile, signature) in", 2),
        each("health/pairing.rs", "let as_given = ", OUT_OF_LINE),
        each("health/pairing.rs", "for age in 0..self.known", REMEMBERED),
        each("health/profile.rs", "for band in 0..profile.len() || for (band, value) in", BANDS),
        each("health/profile.rs", "let mean = around.iter()", AROUND).by(4),
        each("health/profile.rs", "for ((&upper, &below), &b) in || aa = aa.wrapping_add", BANDS),
        each("health/row_error.rs", "errors.iter().fold(0usize", STRIPS * PLACES).by(4),
        total("health/exposure.rs", "for y in (0..picture.height())", 2 * down),
        total("health/exposure.rs", "for &grey in picture.row(y)", 2 * across * down).by(4),
        each("health/mod.rs", "let out_of_range = counts", lower.div_ceil(4096)),
        total("health/mod.rs", "let counts = lower.chunks", lower).by(4),
        each("health/debounce.rs", "self.told.levels.iter_mut()", HealthReason::ALL.len() as u64),
        total("map/cells.rs", "for cell in &mut self.cells", cells),
        total("detector/detection.rs", "for cell in &map.cells", cells),
        total("map/sectors.rs", "for (index, cell) in", cells),
        total("map/sectors.rs", "for (distance_dm, seen) in", SECTOR_COUNT as u64),
    ]
}

/// The strips that are matched the other way round, beside the matching.
fn exchanged(shape: &Shape) -> Vec<Fact> {
    let (width, rows) = (shape.width, shape.exchanged_rows());
    vec![
        each("detector/mod.rs", "for strip in 0..EXCHANGE_ROWS", Shape::EXCHANGED),
        each("detector/mod.rs", "for y in top..top", rows / Shape::EXCHANGED),
        each("detector/mod.rs", "let values = row.iter().fold", width).by(4),
        each("rectify/sample.rs", "for chunk in", width / 8),
        each("rectify/mod.rs", "for (to, from) in copied", width),
        each("rectify/sample.rs", "for pixel in out {", 8),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Half a patch, and what a place keeps from the ends of what is valid.
    const RADIUS: u64 = PATCH / 2;

    /// Windows of [`WINDOW`] pixels that a search reads, from places up to `upto` down to `first`, and those of them that end beyond a row
    /// of `width` pixels.
    fn windows(width: u64, first: u64, mut upto: u64) -> [u64; 2] {
        let (mut all, mut beyond) = (0, 0);
        while upto > first {
            upto = upto.saturating_sub(LANES).max(first);
            all += 1;
            beyond += u64::from(upto - RADIUS + WINDOW > width);
        }
        [all, beyond]
    }

    #[test]
    fn a_search_reads_beyond_its_row_once_and_the_patch_never() {
        let width = 64;
        for (start, end) in (0..width).flat_map(|start| (start..=width).map(move |end| (start, end))) {
            // Places, of the left picture and of the right one, whose patches are valid.
            for x in start + RADIUS + 1..end.saturating_sub(RADIUS + 1) {
                assert!(x - RADIUS + PATCH <= width, "{x} of {start}..{end}");
            }
            let (first, last) = (start + RADIUS, end.saturating_sub(RADIUS));
            for (from, upto) in (first..last).flat_map(|from| (from..=last).map(move |upto| (from, upto))) {
                let [all, beyond] = windows(width, from, upto);
                assert!(beyond == 0 || all == 1, "{beyond} of {all} windows for {from}..{upto}");
            }
        }
    }

    #[test]
    fn patches_are_searched_as_often_as_the_work_says() {
        // With a range that one window goes over there are as many windows as searches, but for those that are nearer: two there.
        let shape = Shape::of(128, 96, 16);
        let works = shape.stages();
        let loops = &works.iter().find(|work| work.stage == "health").unwrap().loops;
        let (_, compared) = loops.iter().find(|(name, _)| *name == "patches_compared").unwrap();
        assert_eq!(compared / LANES, SEARCHED + STRIPS / 2 * PLACES);
    }
}
