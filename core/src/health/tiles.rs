//! Where a picture has structure, and where it is flat although the other one is not.

use crate::matching::ValidSpan;

/// Edge of the blocks whose means are compared, px: large enough for the noise of a sensor to drop out.
pub(super) const BLOCK: usize = 4;

/// Most tiles across and down.
const COLUMNS: usize = 16;
const ROWS: usize = 12;

/// Blocks that a tile has at least along each edge.
const LEAST_BLOCKS: usize = 4;

/// Marks a block that was not seen whole.
const UNSEEN: u16 = u16::MAX;

/// Structure of one picture: the mean difference of neighbouring 4 x 4 blocks, tile by tile.
#[derive(Clone, Debug)]
pub(super) struct Tiles<const WIDTH: usize> {
    /// Sums of the blocks of the current rows.
    blocks: [u16; WIDTH],
    /// Sum of the differences, 1/16 grey values.
    steps: [[u32; COLUMNS]; ROWS],
    counts: [[u16; COLUMNS]; ROWS],
    layout: Layout,
}

/// How tiles lie: the same for both pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Layout {
    columns: usize,
    rows: usize,
    /// Blocks of a tile across and down.
    across: usize,
    down: usize,
}

/// What a picture lacks that the other one has.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Covering {
    /// Tiles that are flat although every place of the other picture that they may show has structure.
    pub covered: u16,
    /// Tiles of which that could be said: all places of the other picture that they may show have structure.
    pub judged: u16,
    /// Share of all tiles that are flat, percent.
    pub flat_percent: f32,
}

impl<const WIDTH: usize> Tiles<WIDTH> {
    pub(super) const fn new() -> Self {
        Self {
            blocks: [0; WIDTH],
            steps: [[0; COLUMNS]; ROWS],
            counts: [[0; COLUMNS]; ROWS],
            layout: Layout { columns: 0, rows: 0, across: 0, down: 0 },
        }
    }

    /// Starts a picture.
    pub(super) fn begin(&mut self, width: usize, height: usize) {
        let (across, down) = (width / BLOCK, height / BLOCK);
        let columns = (across / LEAST_BLOCKS).clamp(1, COLUMNS);
        let rows = (down / LEAST_BLOCKS).clamp(1, ROWS);
        self.layout = Layout { columns, rows, across: (across / columns).max(1), down: (down / rows).max(1) };
        self.blocks.fill(0);
        self.steps.as_flattened_mut().fill(0);
        self.counts.as_flattened_mut().fill(0);
    }

    /// Takes row `y`; blocks that are not valid as a whole are left out.
    ///
    /// # Bound
    /// One pass over the row.
    #[inline(always)]
    pub(super) fn push(&mut self, y: usize, row: &[u8], span: ValidSpan) {
        // Blocks that are valid as a whole.
        let (first, end) = (usize::from(span.start).div_ceil(BLOCK), usize::from(span.end) / BLOCK);
        let (quads, _) = row.as_chunks::<BLOCK>();
        let end = end.min(quads.len()).min(self.blocks.len());
        let first = first.min(end);
        self.blocks.iter_mut().take(first).for_each(|block| *block = UNSEEN);
        self.blocks.iter_mut().take(quads.len()).skip(end).for_each(|block| *block = UNSEEN);
        let seen = self.blocks.get_mut(first..end).unwrap_or_default();
        for (block, quad) in seen.iter_mut().zip(quads.get(first..end).unwrap_or_default()) {
            // Four bytes added up in one word: all blocks of a row can go through this side by side.
            let word = u32::from_le_bytes(*quad);
            let pairs = (word & 0x00ff_00ff).wrapping_add(word >> 8 & 0x00ff_00ff);
            // A block that was not seen stays so: its mark is the largest value.
            *block = block.saturating_add(pairs.wrapping_add(pairs >> 16) as u16);
        }
        if y % BLOCK == BLOCK - 1 {
            self.end_blocks(y / BLOCK, row.len() / BLOCK);
        }
    }

    /// Compares the blocks of one row of blocks, and begins the next.
    #[inline(always)]
    fn end_blocks(&mut self, row: usize, count: usize) {
        let Layout { across, down, columns, .. } = self.layout;
        let blocks = self.blocks.get_mut(..count).unwrap_or_default();
        let row = row / down.max(1);
        if let (Some(steps), Some(counts)) = (self.steps.get_mut(row), self.counts.get_mut(row)) {
            for (column, (steps, count)) in (0..columns).zip(steps.iter_mut().zip(counts)) {
                let first = column.saturating_mul(across);
                // The last of a column is compared with the first of the next.
                let end = first.saturating_add(across).saturating_add(1).min(blocks.len());
                let blocks = blocks.get(first..end).unwrap_or_default();
                let pairs = blocks.iter().zip(blocks.iter().skip(1));
                for (&a, &b) in pairs {
                    let known = a != UNSEEN && b != UNSEEN;
                    // A tile has fewer than 2^16 blocks: the sum fits.
                    *steps = steps.wrapping_add(if known { u32::from(a.abs_diff(b)) } else { 0 });
                    *count = count.saturating_add(u16::from(known));
                }
            }
        }
        blocks.fill(0);
    }

    /// Adds what was seen of other rows of the same picture, from the first of a block on.
    pub(super) fn append(&mut self, other: &Self) {
        for (steps, other) in self.steps.as_flattened_mut().iter_mut().zip(other.steps.as_flattened()) {
            // Of each row of tiles, all was seen here or there: the sum fits as that of the whole picture does.
            *steps = steps.wrapping_add(*other);
        }
        for (count, other) in self.counts.as_flattened_mut().iter_mut().zip(other.counts.as_flattened()) {
            *count = count.saturating_add(*other);
        }
    }

    /// Structure of a tile, grey values; `None` where too little of it is valid.
    fn structure(&self, row: usize, column: usize) -> Option<f32> {
        let Layout { across, down, .. } = self.layout;
        let count = usize::from(*self.counts.get(row)?.get(column)?);
        let enough = count.saturating_mul(2) >= across.saturating_mul(down);
        let steps = *self.steps.get(row)?.get(column)?;
        enough.then(|| steps as f32 / (count.max(1) * BLOCK * BLOCK) as f32)
    }

    /// Compares this picture with `other`, where what it shows at x lies within `x - farthest.0 ..= x + farthest.1`, px.
    /// Tiles with at least `structure_grey` have structure, those with less than half of it are flat, if the other's is three
    /// times theirs.
    ///
    /// # Bound
    /// For each tile, once the tiles that lie within the range.
    pub(super) fn lacks(&self, other: &Self, range_px: (usize, usize), structure_grey: f32) -> Covering {
        let Layout { columns, rows, across, .. } = self.layout;
        let tile_px = across.saturating_mul(BLOCK).max(1);
        // A tile more to either side: the range begins and ends within tiles.
        let [before, after] = [range_px.0, range_px.1]
            .map(|px| (px / tile_px).saturating_add(1 + usize::from(!px.is_multiple_of(tile_px))));
        let (mut flat, mut seen) = (0u32, 0u32);
        let mut covering = Covering::default();
        for row in 0..rows {
            for column in 0..columns {
                let Some(mine) = self.structure(row, column) else { continue };
                // At most as many as there are tiles.
                seen = seen.wrapping_add(1);
                flat = flat.wrapping_add(u32::from(mine < 0.5 * structure_grey));
                // The tiles beside the range may be cut off, those within it may not.
                let last = column.saturating_add(after);
                let within = column.saturating_add(1) >= before && last <= columns;
                let places = column.saturating_sub(before)..last.saturating_add(1).min(columns);
                let theirs = places.map(|place| other.structure(row, place).unwrap_or(0.0)).fold(f32::MAX, f32::min);
                if within && theirs >= structure_grey {
                    let covered = mine < 0.5 * structure_grey && theirs > 3.0 * mine;
                    covering.judged = covering.judged.wrapping_add(1);
                    covering.covered = covering.covered.wrapping_add(u16::from(covered));
                }
            }
        }
        covering.flat_percent = 100.0 * flat as f32 / seen.max(1) as f32;
        covering
    }
}

#[cfg(test)]
#[path = "tiles_tests.rs"]
mod tests;
