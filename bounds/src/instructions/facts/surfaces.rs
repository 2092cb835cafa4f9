//! How often the loops of finding surfaces go round.

use super::{At, Fact, Stage, angles, each, ran, total, unwritten};
use crate::{
    instructions::memory::{copies, fills},
    work::Shape,
};

/// Pixels from which on a run is summed up with the rest of its row, and those of a row.
const LONG_RUN: u64 = 10;
const ROW: u64 = 32;

pub(super) fn stage(shape: &Shape, of: &dyn Fn(&str, &str) -> u64) -> Stage {
    let of = |name| of("surfaces", name);
    let (width, height) = (shape.width, shape.height);
    let pixels = width * height;
    let rows_of_tiles = height * width.div_ceil(ROW);
    let tiles = height.div_ceil(ROW) * width.div_ceil(ROW);
    // What is left over of a row at the edge of the picture.
    let cut_off = if width.is_multiple_of(ROW) { 0 } else { height };
    Stage {
        name: "surfaces",
        entries: vec![("entry_surfaces_run", 1)],
        facts: [
            vec![
                // It is a function of its own, or none.
                unwritten("fencepost_core::surfaces::part::Part::keep_largest", tiles).is_shared(),
                total("surfaces/tile.rs", "for (y, row) in rows.iter_mut()", rows_of_tiles),
                each("links.rs", "for (flag, (a, b)) in || *flag = u8::from(a.abs_diff", 32).by(8),
                // A pixel begins a run, or a run that is joined already may be joined there again.
                total("surfaces/tile.rs", "for (run, bit) in (runs..AREA)", pixels).of("begun or joined again"),
                total("surfaces/tile.rs", "if parent == place <- let a = self.root", of("joins")).of("begun or joined again").and_of(&["gone through or joined again", "numbered or joined again", "runs", "runs before"]),
                total("surfaces/tile.rs", "if parent == place <- let b = self.root", of("hops") - of("joins")),
                // The first run of a surface is joined nowhere; a surface is numbered once.
                total("links.rs", "bit <- for bit in each_bit(up", of("joins")).of("joined or first"),
                ran(
                    "surfaces/tile.rs",
                    "let large = *pixels || let enough = large || found.wrapping_add(u8::from(enough)) || *pixels = NUMBERED",
                    pixels,
                )
                .of("joined or first"),
                total("links.rs", "bit <- for bit in each_bit(links.starts())", pixels).of("numbered or joined again"),
                total("surfaces/tile.rs", "for run in 0..runs || self.parent[run] = root", pixels)
                    .by(4)
                    .of("gone through or joined again"),
                total("surfaces/tile.rs", "for (y, links) in rows", rows_of_tiles),
                ran("surfaces/tile.rs", "labels.iter_mut().zip(numbers)", cut_off),
                total("surfaces/mod.rs", "here.get(first) <- for (label, run) in segments(self.labels", pixels)
                    .of("runs before"),
                // Of the pixels of a long run one begins it, and none is summed up by itself.
                total("surfaces/mod.rs", "here.get(first) <- for (label, run) in segments(labels)", pixels).of("runs"),
                each("surfaces/moments.rs", "for ((z, square), column) || *square = ", ROW)
                    .by(8)
                    .begins("runs", LONG_RUN - 1),
                total("surfaces/moments.rs", "for z in z {", pixels).of("summed up"),
                each("surfaces/moments.rs", "for (&square, column)", ROW)
                    .by(8)
                    .written(8)
                    .begins("summed up", LONG_RUN),
                total("surfaces/mod.rs", "*farthest = run.iter()", pixels).by(4),
                each("surfaces/mod.rs", "here.iter_mut().zip(labels)", width % ROW),
                total("surfaces/mod.rs", "farthest.iter().zip(", of("planes")),
                total("surfaces/mod.rs", "if labels.iter().all(", pixels).early(4),
                total("surfaces/mod.rs", "for (i, number) in renumbered", of("planes")),
                total("surfaces/mod.rs", "for y in 0..tile.height { then for &label", rows_of_tiles),
                total("surfaces/mod.rs", "for y in 0..tile.height { then let pixels", rows_of_tiles),
                total("surfaces/mod.rs", "for y in 0..tile.height { then let v", rows_of_tiles),
                total("surfaces/mod.rs", "for y in 0..tile.height { then for label", rows_of_tiles),
                total("surfaces/mod.rs", "for label in self.labels || *label = usize::from", pixels).by(4).written(8),
                // Which are kept where there are too many.
                total("surfaces/mod.rs", "for &label in self.labels", pixels).by(4),
                total("surfaces/mod.rs", "for &pixels in pixels.iter() || if let Some(count) = by_size", 51 * tiles),
                each("surfaces/mod.rs", "for (i, &count) in by_size", 1024),
                each(
                    "surfaces/mod.rs",
                    "*found = stage.go_through || let found = part.label_tiles || keep = part.keep_largest",
                    tiles,
                ),
                each("surfaces/mod.rs", "part.measure_tiles::", tiles),
                ran("links.rs", "for (to, from) in piece.iter_mut().zip(pixels)", 3 * cut_off),
            ],
            angles(),
            numbers(pixels, tiles * 128),
            // Beside the rows: how the pixels of those of a tile hang together, and sizes where there are too many.
            fills([16; 2], 64 * tiles + 512 + 4 * of("planes")),
            copies([16; 2], 64 * tiles),
        ]
        .concat(),
        calls: vec![("libm::math::rem_pio2f::rem_pio2f", 0)],
        groups: vec![
            ("begun or joined again", pixels),
            ("joined or first", pixels),
            ("gone through or joined again", pixels),
            ("numbered or joined again", pixels),
            ("runs before", pixels),
            ("runs", pixels),
            ("summed up", pixels),
            ("numbered", pixels),
        ],
    }
}

/// The numbers of the runs of a row, `bytes` in all, byte by byte or a word at a time; and `words` that a tile begins with.
fn numbers(bytes: u64, words: u64) -> Vec<Fact> {
    let fact = |nth, more| Fact::new(At::LoopOf("__aeabi_memset", nth), 0, more);
    let of_words = bytes / 16;
    vec![
        fact(0, bytes).of("numbered").entered(of_words),
        fact(1, bytes / 4 + words).entered(of_words),
        fact(2, bytes).of("numbered"),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP: u16 = 16;
    const AREA: usize = 1024;

    /// What is counted in a tile.
    #[derive(Clone, Copy, Debug, Default)]
    struct Counts {
        runs: usize,
        /// Joins of a pixel with the one above, and those of a run that had none before.
        joins: usize,
        first_joins: usize,
        /// Steps to what stands for the run of the pixel, and for the run above.
        hops: [usize; 2],
        surfaces: usize,
        /// Pieces of rows that belong to one surface, those that are summed up with their row, and pixels of the others.
        segments: usize,
        long: usize,
        short_pixels: usize,
    }

    /// Joins the runs of a tile as the stage does, written down once more.
    fn counted(tile: &[[u16; 32]; 32]) -> Counts {
        let mut counts = Counts::default();
        let mut parent = Vec::<usize>::new();
        let mut run_of = [[0; 32]; 32];
        for y in 0..32 {
            let mut last_joined = None;
            for x in 0..32 {
                let is_near = |other: u16| tile[y][x].abs_diff(other) <= STEP;
                let left = x > 0 && is_near(tile[y][x - 1]);
                if !left {
                    parent.push(parent.len());
                    counts.runs += 1;
                }
                let run = parent.len() - 1;
                run_of[y][x] = run;
                let is_up = |x: usize| y > 0 && tile[y][x].abs_diff(tile[y - 1][x]) <= STEP;
                let left_above = y > 0 && x > 0 && tile[y - 1][x].abs_diff(tile[y - 1][x - 1]) <= STEP;
                if !is_up(x) || left && left_above && is_up(x - 1) {
                    continue;
                }
                counts.joins += 1;
                counts.first_joins += usize::from(last_joined != Some(run));
                last_joined = Some(run);
                let [a, b] = [(run, 0), (run_of[y - 1][x], 1)].map(|(mut at, which)| {
                    while parent[at] != at {
                        counts.hops[which] += 1;
                        parent[at] = parent[parent[at]];
                        at = parent[at];
                    }
                    at
                });
                parent[a.max(b)] = a.min(b);
            }
        }
        for run in 0..parent.len() {
            parent[run] = parent[parent[run]];
        }
        counts.surfaces = (0..parent.len()).filter(|run| parent[*run] == *run).count();
        for row in run_of {
            for piece in row.map(|run| parent[run]).chunk_by(|a, b| a == b) {
                counts.segments += 1;
                let is_long = piece.len() as u64 >= LONG_RUN;
                *if is_long { &mut counts.long } else { &mut counts.short_pixels } +=
                    if is_long { 1 } else { piece.len() };
            }
        }
        counts
    }

    fn hold(counts: &Counts) {
        let Counts { runs, joins, first_joins, hops, surfaces, segments, long, short_pixels } = *counts;
        assert!(hops[0] <= joins - first_joins && hops[1] <= 2 * joins, "{counts:?}");
        assert!(runs + hops[0] <= AREA && segments + hops[0] <= AREA, "{counts:?}");
        assert!(surfaces + joins <= AREA, "{counts:?}");
        let (begun, summed) = (LONG_RUN as usize - 1, LONG_RUN as usize);
        assert!(segments + begun * long <= AREA && short_pixels + summed * long <= AREA, "{counts:?}");
    }

    #[test]
    fn what_excludes_each_other_does_so_in_every_tile() {
        const SEED: u64 = 0x5eed_0801;
        println!("tiles: seed {SEED:#x}");
        let mut state = SEED;
        let mut below = |end: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % end
        };
        for _ in 0..60 {
            // Blocks of a few levels; then it climbs towards more steps.
            let (across, down, levels) = (1 + below(6), 1 + below(32), 1 + below(5));
            let scattered: Vec<u16> = (0..AREA).map(|_| 20 * below(levels) as u16).collect();
            let place = |x: usize, y: usize| (y / down as usize * 32 + x / across as usize) % AREA;
            let mut tile: [[u16; 32]; 32] = core::array::from_fn(|y| core::array::from_fn(|x| scattered[place(x, y)]));
            let mut best = counted(&tile);
            hold(&best);
            for _ in 0..400 {
                let mut other = tile;
                let (x, y, level) = (below(32) as usize, below(32) as usize, 20 * below(levels + 1) as u16);
                let (width, height) = (1 + below(4) as usize, 1 + below(8) as usize);
                other
                    .iter_mut()
                    .skip(y)
                    .take(height)
                    .for_each(|row| row.iter_mut().skip(x).take(width).for_each(|v| *v = level));
                let counts = counted(&other);
                hold(&counts);
                if counts.hops[0] + counts.hops[1] >= best.hops[0] + best.hops[1] {
                    (tile, best) = (other, counts);
                }
            }
        }
    }
}
