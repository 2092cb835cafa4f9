//! Work: the most steps that the loops of each stage can take, in closed form. `docs/bounds.md` says why each is a bound.
//!
//! What the core's loops are made of is written down here once more, on purpose: a loop that takes a step more than it is said to is
//! found by the search (`search`), and a row that grows is found by the budget.

use fencepost_core::{
    detector::Capacities, map::MapGeometry, matching::MatchSettings, settings::Settings, wire::WireConfig,
};

/// What decides the bounds.
#[derive(Clone, Copy, Debug)]
pub struct Shape {
    /// Of a picture, px.
    pub width: u64,
    /// Of a picture, px.
    pub height: u64,
    /// Disparities that are searched.
    pub disparities: u64,
    /// Capacity of the table of surfaces.
    pub surfaces: u64,
    /// Capacity of the table of obstacles.
    pub obstacles: u64,
    /// Settings of all stages.
    pub settings: Settings,
    /// Runs of cells that a scan can hold.
    pub wire_runs: u64,
    /// Frames of a scan.
    pub wire_frames: u64,
}

/// The bound of a stage: its loops, and what all of them can take together. That may be less than the sum, as not all can take the
/// most at the same time.
#[derive(Clone, Debug)]
pub struct StageWork {
    /// Its name.
    pub stage: &'static str,
    /// The most steps of each of its loops.
    pub loops: Vec<(&'static str, u64)>,
    /// The most steps of all of them together.
    pub total: u64,
    /// The total, as it is written on paper.
    pub formula: &'static str,
}

/// Edge of a tile, px.
const TILE: u64 = 32;
/// Pixels of which comparisons are made at once.
const PIECE: u64 = 32;
/// Pixels of a row that are searched for together.
const CHUNK: u64 = 64;
/// Rows around a row that a census code looks at.
const REACH: u64 = 3;
/// Rows that are matched the other way round if hardly anything matches.
const EXCHANGED: u64 = 8;
/// Weak runs of a row before gaps have to be longer.
const SHORT_GAPS: u64 = 4;
/// Patches of the terrain, ahead and in all.
const AHEAD: u64 = 40;
const PATCHES: u64 = AHEAD * 40;
/// Strips for sparse matches, places in each, places that are compared at once, searches without a known disparity.
const STRIPS: u64 = 16;
const PLACES: u64 = 8;
const LANES: u64 = 16;
const SEARCHES: u64 = 64;
const ROWS_COMPARED: u64 = 9;

impl Shape {
    /// The default settings with the capacities of [`Capacities::for_pictures`].
    pub fn of(width: usize, height: usize, disparities: usize) -> Self {
        let capacities = Capacities::for_pictures(width, height, disparities);
        let mut settings = Settings::default();
        settings.matching.disparities = disparities as u16;
        let wire = WireConfig::new(fencepost_core::wire::WireSettings::default()).expect("the defaults can be used");
        Self {
            width: width as u64,
            height: height as u64,
            disparities: disparities as u64,
            surfaces: capacities.surfaces as u64,
            obstacles: capacities.obstacles as u64,
            settings,
            wire_runs: wire.max_runs() as u64,
            wire_frames: fencepost_core::wire::max_frames_per_scan(&wire) as u64,
        }
    }

    fn pixels(&self) -> u64 {
        self.width * self.height
    }

    fn tiles(&self) -> (u64, u64) {
        (self.width.div_ceil(TILE), self.height.div_ceil(TILE))
    }

    fn margins(&self) -> [u64; 2] {
        let MatchSettings { window_width, window_height, .. } = self.settings.matching;
        [window_width, window_height].map(|edge| u64::from(edge) / 2 + REACH)
    }

    /// Strips that are matched the other way round.
    pub const EXCHANGED: u64 = EXCHANGED;

    /// Rows that go into the matcher, beside those of the picture, to be matched the other way round.
    pub fn exchanged_rows(&self) -> u64 {
        EXCHANGED * (2 * self.margins()[1] + 1)
    }

    /// All stages, in the order of the data.
    pub fn stages(&self) -> Vec<StageWork> {
        vec![
            self.rectify(),
            self.matching(),
            self.validate(),
            self.surfaces(),
            self.ground(),
            self.obstacles(),
            self.map(),
            self.health(),
            self.wire(),
        ]
    }

    fn rectify(&self) -> StageWork {
        let rows = 2 * (self.height + self.exchanged_rows());
        let loops = vec![("segments", rows * (self.width / 8 + 1)), ("pixels_one_by_one", rows * self.width)];
        StageWork::sum("rectify", loops, "2 (H + 8 (2 margin + 1)) (W + W/8 + 1)")
    }

    /// What the loops of the matching take for so many pictures, and strips that are matched the other way round.
    pub fn matching_of(&self, pictures: u64, strips: u64) -> Vec<(&'static str, u64)> {
        let Self { width, height, disparities, .. } = *self;
        let settings = &self.settings.matching;
        let [margin_x, margin_y] = self.margins();
        let strip = 2 * margin_y + 1;
        let filtered = pictures * (height - 2 * REACH) + strips * (strip - 2 * REACH);
        let window_rows = u64::from(settings.window_height);
        let slid = pictures * (2 * (height - 2 * REACH)).saturating_sub(window_rows)
            + strips * (2 * (strip - 2 * REACH) - window_rows);
        let rows = pictures * (height - 2 * margin_y) + strips;
        let narrow = width - 2 * margin_x;
        let wide_width = u64::from(settings.wide_window_width);
        let wide = self.wide();
        let [wide_runs, wide_parts] = self.wide_runs();
        let begun = wide_width * wide_runs;
        let decided = CHUNK * (narrow.div_ceil(CHUNK) + wide_parts);
        let begun_narrow = u64::from(settings.window_width);
        vec![
            ("filtered_pixels", 3 * width * filtered),
            ("column_costs_slid", width * disparities * slid),
            ("narrow_costs", rows * narrow * disparities),
            ("wide_costs", rows * wide * disparities),
            ("costs_begun_afresh", rows * (begun_narrow + begun) * disparities),
            ("decided_pixels", rows * decided),
            ("pixels_checked_back", rows * narrow),
            ("pixels_scanned_for_weak", rows * 2 * wide),
        ]
    }

    /// Pixels of a row that have a wide window within it.
    fn wide(&self) -> u64 {
        self.width.saturating_sub(2 * (u64::from(self.settings.matching.wide_window_width) / 2 + REACH))
    }

    /// Runs of weak pixels that a row has at most, which the wide window starts anew at, and parts of [`CHUNK`] pixels that they have.
    pub fn wide_runs(&self) -> [u64; 2] {
        let width = u64::from(self.settings.matching.wide_window_width);
        let short = width / 2 / 3 + 1;
        let (mut most, mut parts) = (0, 0);
        for runs in 1..=self.wide() {
            let gaps = runs - 1;
            let apart = short * gaps.min(SHORT_GAPS) + width * gaps.saturating_sub(SHORT_GAPS);
            // Each has a pixel at least, and those beyond that fill parts one after the other.
            let Some(left) = self.wide().checked_sub(apart + runs) else { break };
            (most, parts) = (runs, parts.max(runs + left / CHUNK));
        }
        [most, parts]
    }

    /// Columns that are summed for a row where a window starts, and pixels that the wide window goes on by.
    pub fn columns_summed(&self) -> u64 {
        let MatchSettings { window_width, wide_window_width, .. } = self.settings.matching;
        let [begun_narrow, wide_width] = [window_width, wide_window_width].map(u64::from);
        // A start adds up the window; the first few have at least a third of its radius between them, the others all of it.
        let (short, wide) = (wide_width / 2 / 3 + 1, self.wide());
        // Where it starts anew it does not go on: both together are less than each for itself.
        begun_narrow + wide + wide_width * (SHORT_GAPS + 1) - short * SHORT_GAPS.min(wide / short)
    }

    fn matching(&self) -> StageWork {
        let loops = self.matching_of(1, EXCHANGED);
        let rows = self.height - 2 * self.margins()[1] + EXCHANGED;
        let together = rows * self.disparities * self.columns_summed();
        let apart = loops.iter().filter(|(name, _)| !["wide_costs", "costs_begun_afresh"].contains(name));
        let total = apart.map(|(_, steps)| steps).sum::<u64>() + together;
        let formula = "W D (rows in and out) + rows D (W - 2 margin + W - 2 wide margin + 5 wide window + narrow window) + 10 W H";
        StageWork { stage: "match", loops, total, formula }
    }

    fn validate(&self) -> StageWork {
        let (pixels, width) = (self.pixels(), self.width);
        let pieces = self.height * width.div_ceil(PIECE);
        let loops = vec![
            ("pieces", pieces),
            ("starts_and_joins", pixels),
            ("hops", pixels),
            ("runs", pixels),
            ("places", 2 * pixels - width),
            ("pixels_taken_out", pixels),
        ];
        // A column begins a run or goes on with one, finds a surface anew or looks it up, and stands for one above or leads to it.
        StageWork { stage: "validate", loops, total: pieces + 5 * pixels - width, formula: "H W/32 + 5 W H - W" }
    }

    fn surfaces(&self) -> StageWork {
        let (pixels, (across, down)) = (self.pixels(), self.tiles());
        let firsts = self.width * down;
        let joins = pixels - firsts;
        // Those that are cut off at the edges hold fewer.
        let sizes = |length: u64| (0..length.div_ceil(TILE)).map(move |nth| TILE.min(length - nth * TILE));
        let of_tile = |area: u64| area / u64::from(self.settings.surfaces.min_pixels);
        let fitted =
            sizes(self.width).map(|width| sizes(self.height).map(|height| of_tile(width * height)).sum::<u64>());
        let fitted: u64 = fitted.sum();
        let rows = self.height * across;
        let loops = vec![
            ("rows_of_tiles", rows),
            ("runs", 2 * pixels),
            ("joins", joins),
            ("hops", 3 * joins),
            ("runs_numbered", pixels),
            ("segments", 2 * pixels),
            // A run of ten pixels is summed up with the rest of its row: three of them in a row of a tile.
            ("pixels_summed", pixels + 3 * TILE * rows + 2 * rows),
            ("planes", fitted),
            ("pixels_counted", pixels),
            ("pixels_relabelled", pixels),
        ];
        // A start takes two steps, a number one, two segments, two sums, a join and one or two hops: nine, and a second hop where two
        // surfaces of its way were joined since. Such a join takes four steps less than a start, and 16 of the 32 pixels of a row can
        // be on the way of either, once: two of them for a row add 32 - 8 steps, more of them less.
        let total = rows + (39 * joins).div_ceil(4) + (17 * firsts).div_ceil(2) + fitted + 2 * pixels;
        StageWork { stage: "surfaces", loops, total, formula: "H W/32 + 11.75 W H - 1.25 W H/32 + surfaces of tiles" }
    }

    /// The joining of surfaces over the borders of tiles, `times` times.
    fn regions(&self, times: u64) -> Vec<(&'static str, u64)> {
        let (across, down) = self.tiles();
        vec![
            ("pairs", times * (self.width * (down - 1) + self.height * (across - 1))),
            ("surfaces_moved", times * self.surfaces * u64::from(self.surfaces.ilog2())),
            ("places", times * 4 * self.surfaces),
        ]
    }

    fn ground(&self) -> StageWork {
        let looked_at = (self.width.div_ceil(TILE) - 1) * (TILE / 4) + ((self.width - 1) % TILE + 1).div_ceil(4);
        let pixels = looked_at * self.height.div_ceil(2);
        let mut loops = self.regions(2);
        loops.extend([
            ("surfaces_asked", 59 * self.surfaces),
            ("pixels", 3 * pixels),
            ("patches_looked_back", (AHEAD - 2) * pixels),
            ("patches", PATCHES * (1 + 3 * 15)),
        ]);
        StageWork::sum("ground", loops, "2 joins + 59 surfaces + 41 W/4 H/2 + 73 600")
    }

    fn obstacles(&self) -> StageWork {
        let mut loops = self.regions(1);
        let moved = loops[1].1;
        let filling = self.obstacles.min(self.surfaces);
        let passed = self.surfaces * filling - filling * (filling + 1) / 2;
        loops.extend([("surfaces_asked", 3 * self.surfaces), ("obstacles_passed", passed)]);
        // Surfaces that are joined are one obstacle. Both together are a convex function of the number of regions: the most is where each
        // surface is a region, or all are one.
        let total = loops.iter().map(|(_, steps)| steps).sum::<u64>() - moved.min(passed);
        let formula = "W (H/32 - 1) + H (W/32 - 1) + 7 surfaces + surfaces x obstacles";
        StageWork { stage: "obstacles", loops, total, formula }
    }

    fn map(&self) -> StageWork {
        let rows = self.height * self.width.div_ceil(TILE);
        let geometry = self.settings.map.geometry;
        let cells = geometry.len() as u64;
        // What is an obstacle has the pixels for it.
        let least = u64::from(self.settings.map.obstacle_min_pixels.max(1));
        let obstacles = cells.min(self.pixels() / least);
        let loops = vec![
            ("surfaces", self.surfaces),
            ("rows_of_tiles", rows),
            ("runs", rows * TILE),
            ("noise_filled", rows * TILE * (TILE + 1) / 2),
            ("votes", rows * TILE),
            ("cells", 2 * cells),
            ("cells_looked_back", obstacles * 2 * u64::from(self.settings.map.smear_cells)),
            ("directions", directions(&geometry, obstacles as usize)),
        ];
        StageWork::sum("map", loops, "H W/32 (1 + 32 + 528 + 32) + surfaces + 6 cells + directions")
    }

    fn health(&self) -> StageWork {
        let (width, height) = (self.width, self.height);
        let lanes = |places: u64| places.div_ceil(LANES) * LANES;
        let range = lanes(self.disparities);
        let nearer = lanes(2 * (self.disparities - 1) + 1);
        let lower = STRIPS / 2 * PLACES;
        let row_error = ROWS_COMPARED * LANES;
        let costs = SEARCHES * (ROWS_COMPARED * range + row_error)
            + (STRIPS * PLACES - SEARCHES) * row_error
            + lower * (nearer + range.max(LANES));
        let geometry = self.settings.map.geometry;
        let loops = vec![
            ("row_pixels", 2 * width * height),
            ("places_for_contrast", STRIPS * (width + PLACES * (LANES - 1))),
            ("patches_compared", costs),
            (
                "pixels",
                2 * width.div_ceil(4) * height.div_ceil(4)
                    + (width * height).div_ceil(2)
                    + EXCHANGED * width
                    + geometry.len() as u64,
            ),
        ];
        StageWork::sum("health", loops, "2.6 W H + 24 W + patches in D + cells")
    }

    fn wire(&self) -> StageWork {
        let cells = self.settings.map.geometry.len() as u64;
        let limit = self.wire_runs.min(cells);
        let depth = |of: u64| u64::from(of.max(1).ilog2());
        let sorting: u64 = (1..limit).map(|left| 1 + depth(left)).sum();
        // Neighbours of one kind are one run. As soon as there are as many obstacles as the list has room for, no free run gets in: more
        // than the list and one kind for every other cell never do.
        let columns = u64::from(self.settings.map.geometry.y_count.max(1));
        let rows = cells / columns;
        let taken = cells.min(limit + rows * columns.div_ceil(2));
        let loops = vec![
            ("cells", cells),
            ("sifts", limit + taken.saturating_sub(limit) * depth(limit) + sorting),
            ("frames", self.wire_frames),
        ];
        StageWork::sum("wire", loops, "cells + (cells / 2 + runs) log2 runs + 2 runs + frames")
    }
}

impl StageWork {
    fn sum(stage: &'static str, loops: Vec<(&'static str, u64)>, formula: &'static str) -> Self {
        let total = loops.iter().map(|(_, steps)| steps).sum();
        Self { stage, loops, total, formula }
    }
}

/// Directions that `obstacles` cells of the map hide at most, if the camera stands at the origin of the map.
fn directions(geometry: &MapGeometry, obstacles: usize) -> u64 {
    const DIRECTIONS: f32 = 128.0;
    const REACH: f32 = 2.0;
    let half = 0.5 * geometry.cell_size_m();
    let cells = (0..geometry.len()).map(|index| {
        let (i, j) = geometry.cell_at(index);
        let (x, y) = geometry.centre_m(i, j);
        if x - half <= 0.0 {
            return 0;
        }
        let place = |y: f32, x: f32| {
            let place = ((y / x).clamp(-REACH, REACH) + REACH) * (DIRECTIONS / (2.0 * REACH));
            (place as u64).min(DIRECTIONS as u64 - 1)
        };
        let corners =
            [(-half, -half), (-half, half), (half, -half), (half, half)].map(|(dx, dy)| place(y + dy, x + dx));
        let (low, high) = corners.iter().fold((u64::MAX, 0), |(low, high), &at| (low.min(at), high.max(at)));
        high + 1 - low
    });
    let mut cells: Vec<u64> = cells.collect();
    cells.sort_unstable_by(|a, b| b.cmp(a));
    cells.iter().take(obstacles).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stage_takes_no_more_than_its_loops_together() {
        for (width, height, disparities) in [(128, 96, 16), (320, 240, 48), (1242, 375, 128)] {
            for stage in Shape::of(width, height, disparities).stages() {
                let sum: u64 = stage.loops.iter().map(|(_, steps)| steps).sum();
                assert!(stage.total <= sum, "{}: {} of {sum}", stage.stage, stage.total);
                assert!(stage.loops.iter().all(|(_, steps)| *steps <= stage.total), "{stage:?}");
            }
        }
    }

    #[test]
    fn runs_of_weak_pixels_are_as_many_as_find_room() {
        let shape = Shape::of(320, 240, 48);
        let width = usize::from(shape.settings.matching.wide_window_width);
        let (radius, wide) = (width / 2, shape.wide() as usize);
        // Runs of equal length, as near to each other as they may be: as the core goes along a row.
        let count = |length: usize| {
            let (mut at, mut runs, mut parts) = (0, 0, 0);
            while at < wide {
                let end = (at + length).min(wide);
                (runs, parts) = (runs + 1, parts + (end - at).div_ceil(64));
                at = end + 1 + if runs <= 4 { radius / 3 } else { 2 * radius };
            }
            [runs, parts]
        };
        let seen = (1..=wide).map(count).fold([0, 0], |most, seen| [most[0].max(seen[0]), most[1].max(seen[1])]);
        assert_eq!(shape.wide_runs(), seen.map(|count| count as u64));
    }

    #[test]
    fn bounds_grow_with_the_picture() {
        let [small, large] = [Shape::of(128, 96, 16), Shape::of(320, 240, 48)].map(|shape| shape.stages());
        for (small, large) in small.iter().zip(&large).filter(|(small, _)| small.stage != "wire") {
            assert!(small.total < large.total, "{}", small.stage);
        }
    }
}
