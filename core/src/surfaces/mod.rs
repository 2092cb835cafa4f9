//! Surfaces: contiguous pieces of the disparity picture inside 32 x 32 tiles, and the plane through each.

mod bands;
mod join;
mod moments;
mod part;
mod settings;
mod tile;

pub use join::Regions;
pub use settings::SurfaceSettings;

use core::ops::Range;

use heapless::Vec;

use crate::{
    arch::{self, Chosen, Steps},
    disparity::{DisparityPicture, DisparityPixel},
    error::{ConfigError, ConfigProblem},
    geometry::{DepthTable, Rays},
    links::{changes, piece},
    planes::Scatter,
    work::{self, Loop},
};
use moments::{Moments, RowMoments};
pub(crate) use part::TileWork;
use part::{Growing, Limits, Part, Table};
use tile::{CODE_SHIFT, MAX_SURFACES, NUMBER_MASK, Tile};
pub(crate) use tile::{CODES, MAX_SURFACES as MAX_TILE_SURFACES};

/// Edge of a tile, px. The paper, section 4.4.
pub const TILE: usize = 32;

/// What a surface is taken for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum SurfaceClass {
    /// No plane fits: the points lie on a line or in a ball.
    #[default]
    Undefined,
    /// Near-horizontal, and on the ground.
    Ground,
    /// Near-horizontal, but not part of the ground.
    Horizontal,
    /// Between horizontal and vertical.
    Slanted,
    /// Near-vertical, but not part of an obstacle that passes the thresholds.
    Vertical,
    /// Part of an obstacle.
    Obstacle,
}

/// One surface and the plane through it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surface {
    /// Its points in the frame of the pair; the weight is their number.
    pub points: Scatter,
    /// Unit normal in the frame of the pair, upward; zero where no plane fits.
    pub normal: [f32; 3],
    /// Root mean square distance of the points from the plane, metres.
    pub rms_m: f32,
    /// What it is taken for.
    pub class: SurfaceClass,
}

impl Surface {
    /// Absolute dot product of the normal with the vehicle's +Z: 1 on level ground, 0 on a wall. The paper, section 4.4.
    pub fn dot(&self) -> f32 {
        self.normal[2].abs().min(1.0)
    }

    /// `sqrt(1 - dot^2)`: 0 on level ground, 1 on a wall. The paper, section 4.4.
    pub fn cross(&self) -> f32 {
        let dot = self.dot();
        libm::sqrtf((1.0 - dot * dot).max(0.0))
    }

    /// Number of pixels.
    pub fn pixels(&self) -> u32 {
        self.points.weight as u32
    }
}

/// How many surfaces were found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SurfaceReport {
    /// Surfaces with enough pixels.
    pub found: u32,
    /// Those among them that the table had no room for: the smallest.
    pub dropped: u32,
}

/// Finds the surfaces of a disparity picture of up to `PIXELS` pixels, up to `SURFACES` of them.
///
/// Source: the paper, section 4.4. Splitting into tiles keeps an object from melting into the ground that it stands on.
///
/// # Bound
/// Five passes of `width x height` steps, and an eigen-solution for each surface.
pub struct Surfaces<const PIXELS: usize, const SURFACES: usize> {
    settings: SurfaceSettings,
    limits: Limits,
    width: usize,
    height: usize,
    /// Number of the surface of each pixel within its tile, from 1; 0 where there is none.
    labels: [u8; PIXELS],
    work: TileWork,
    /// Place of each tile's first surface in the table.
    tiles: Vec<u16, SURFACES, u16>,
    table: Vec<Surface, SURFACES, u16>,
    chosen: Chosen,
}

impl<const PIXELS: usize, const SURFACES: usize> Surfaces<PIXELS, SURFACES> {
    /// A stage that is not configured and finds nothing.
    pub const fn new() -> Self {
        const { assert!(SURFACES < u16::MAX as usize, "places in the table must fit 16 bits") };
        Self {
            settings: SurfaceSettings::UNSET,
            limits: Limits::UNSET,
            width: 0,
            height: 0,
            labels: [0; PIXELS],
            work: TileWork::new(),
            tiles: Vec::new(),
            table: Vec::new(),
            chosen: Chosen::PLAIN,
        }
    }

    /// Takes settings and the size of the pictures.
    ///
    /// # Errors
    /// The first setting that cannot be used, named `surfaces.*`, or a picture that is too large.
    pub fn configure(&mut self, settings: &SurfaceSettings, width: usize, height: usize) -> Result<(), ConfigError> {
        settings.check()?;
        let capacity = |field, needed: usize, capacity: usize| {
            let error = ConfigError::new(field, ConfigProblem::OverCapacity { needed, capacity });
            if needed > capacity { Err(error) } else { Ok(()) }
        };
        capacity("calibration.width x calibration.height", width.saturating_mul(height), PIXELS)?;
        capacity("tiles of the picture", width.div_ceil(TILE).saturating_mul(height.div_ceil(TILE)), SURFACES)?;
        self.settings = *settings;
        self.limits = Limits::new(settings);
        self.width = width;
        self.height = height;
        self.tiles.clear();
        self.table.clear();
        Ok(())
    }

    /// Has surfaces found with the instructions of a backend.
    pub(crate) const fn choose(&mut self, chosen: Chosen) {
        self.chosen = chosen;
    }

    /// Finds the surfaces of `picture`, which must have the configured size, and fits a plane to each.
    pub fn run<const DISPARITIES: usize>(
        &mut self,
        picture: DisparityPicture<'_>,
        depth: &DepthTable<DISPARITIES>,
        rays: &Rays,
    ) -> SurfaceReport {
        self.find::<DISPARITIES, false>(picture, depth, rays, &[SurfaceClass::Undefined; CODES])
    }

    /// As [`Self::run`], with surfaces of pixels that have one class each: those that [`Self::codes_mut`] holds, below [`CODES`].
    /// A surface gets the class that `classes` has for them, whatever its own plane says.
    pub(crate) fn run_coded<const DISPARITIES: usize>(
        &mut self,
        picture: DisparityPicture<'_>,
        depth: &DepthTable<DISPARITIES>,
        rays: &Rays,
        classes: &[SurfaceClass; CODES],
    ) -> SurfaceReport {
        self.find::<DISPARITIES, true>(picture, depth, rays, classes)
    }

    /// A byte for each pixel, row by row: room for what a method knows of the pixels before [`Self::run_coded`] makes surfaces of
    /// them. The surfaces of the picture before are forgotten.
    pub(crate) fn codes_mut(&mut self) -> &mut [u8] {
        self.tiles.clear();
        self.table.clear();
        self.labels.get_mut(..self.width.saturating_mul(self.height)).unwrap_or_default()
    }

    fn find<const DISPARITIES: usize, const CODED: bool>(
        &mut self,
        picture: DisparityPicture<'_>,
        depth: &DepthTable<DISPARITIES>,
        rays: &Rays,
        classes: &[SurfaceClass; CODES],
    ) -> SurfaceReport {
        self.tiles.clear();
        self.table.clear();
        if (picture.width(), picture.height()) != (self.width, self.height) {
            return SurfaceReport::default();
        }
        let mut found = 0;
        arch::compiled(
            self.chosen,
            Find::<_, _, _, CODED> { stage: self, picture, depth, rays, classes, found: &mut found },
        );
        SurfaceReport { found, dropped: found.saturating_sub(self.table.len() as u32) }
    }

    /// Finds the surfaces and measures them; returns how many there are.
    #[inline(always)]
    fn go_through<const DISPARITIES: usize, const CODED: bool>(
        &mut self,
        picture: DisparityPicture<'_>,
        depth: &DepthTable<DISPARITIES>,
        rays: &Rays,
        classes: &[SurfaceClass; CODES],
    ) -> u32 {
        let pixels = picture.pixels();
        let (mut part, mut grown) = self.whole();
        let found = part.label_tiles::<CODED>(pixels, &depth.covered());
        let mut keep = KeepRule::everything();
        if found as usize > SURFACES {
            keep = part.keep_largest::<CODED>(SURFACES);
        }
        part.measure_tiles::<DISPARITIES, CODED>(pixels, depth, rays, &mut keep, classes, &mut grown);
        found
    }

    /// All rows of the picture, and the tables that grow with them.
    #[inline(always)]
    fn whole(&mut self) -> (Part<'_>, Growing<'_, SURFACES>) {
        let Self { settings, limits, width, height, labels, work, tiles, table, .. } = self;
        let (settings, limits) = (&*settings, &*limits);
        let labels = labels.get_mut(..width.saturating_mul(*height)).unwrap_or_default();
        let TileWork { union, moments, shifts } = work;
        let part = Part { settings, limits, width: *width, height: *height, top: 0, labels, union, moments, shifts };
        (part, Growing { tiles, table })
    }

    /// The surfaces, tile by tile.
    pub fn table(&self) -> &[Surface] {
        &self.table
    }

    /// The surfaces, to be given a class.
    pub fn table_mut(&mut self) -> &mut [Surface] {
        &mut self.table
    }

    /// Place in the table of the surface at pixel `(x, y)`.
    pub fn place_at(&self, x: usize, y: usize) -> Option<usize> {
        if x >= self.width || y >= self.height {
            return None;
        }
        let label = usize::from(*self.labels.get(y.wrapping_mul(self.width).wrapping_add(x))?);
        let first = usize::from(*self.tiles.get(self.tile_at(x, y))?);
        label.checked_sub(1).and_then(|label| first.checked_add(label))
    }

    /// The surface at pixel `(x, y)`.
    pub fn surface_at(&self, x: usize, y: usize) -> Option<&Surface> {
        self.table.get(self.place_at(x, y)?)
    }

    /// Numbers of the surfaces along row `y` within their tiles, from 1; 0 where there is none.
    pub(crate) fn labels_row(&self, y: usize) -> &[u8] {
        let start = y.saturating_mul(self.width);
        self.labels.get(start..start.saturating_add(self.width)).unwrap_or_default()
    }

    /// [`Self::labels_row`] of all rows, one after the other.
    pub(crate) fn labels(&self) -> &[u8] {
        self.labels.get(..self.width.saturating_mul(self.height)).unwrap_or_default()
    }

    /// Place in the table of the first surface of the tile at `(x, y)`.
    pub(crate) fn first_of_tile(&self, x: usize, y: usize) -> usize {
        self.tiles.get(self.tile_at(x, y)).map_or(0, |&first| usize::from(first))
    }

    /// The surfaces of the tile at `(x, y)`, in the order of their numbers.
    pub(crate) fn of_tile(&self, x: usize, y: usize) -> &[Surface] {
        let tile = self.tile_at(x, y);
        let Some(&first) = self.tiles.get(tile) else { return &[] };
        let end = self.tiles.get(tile.wrapping_add(1)).map_or(self.table.len(), |&end| usize::from(end));
        self.table.get(usize::from(first)..end).unwrap_or_default()
    }

    /// The number of the tile at `(x, y)`, row by row.
    const fn tile_at(&self, x: usize, y: usize) -> usize {
        (y / TILE).wrapping_mul(self.width.div_ceil(TILE)).wrapping_add(x / TILE)
    }

    /// Width and height of the pictures.
    pub(crate) const fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Settings in force.
    pub(crate) const fn settings(&self) -> &SurfaceSettings {
        &self.settings
    }
}

impl Part<'_> {
    /// The size from which on a table of `capacity` has room for all surfaces.
    fn keep_largest<const CODED: bool>(&mut self, capacity: usize) -> KeepRule {
        // Sizes are counted from the largest down; the union's counters are free now.
        let by_size = self.union.scratch();
        by_size.fill(0);
        for tile in Tile::all(self.width, self.height) {
            let mut pixels = [0u16; MAX_SURFACES];
            work::count(Loop::SurfaceCounted, tile.width.saturating_mul(tile.height));
            for y in 0..tile.height {
                for &label in self.labels.get(tile.row(y, self.width)).unwrap_or_default() {
                    let label = if CODED { label & NUMBER_MASK } else { label };
                    if let Some(pixels) = usize::from(label).checked_sub(1).and_then(|i| pixels.get_mut(i)) {
                        *pixels = pixels.wrapping_add(1);
                    }
                }
            }
            for &pixels in pixels.iter().filter(|&&pixels| pixels > 0) {
                if let Some(count) = usize::from(pixels).checked_sub(1).and_then(|i| by_size.get_mut(i)) {
                    *count = count.saturating_add(1);
                }
            }
        }
        let mut room = capacity;
        for (i, &count) in by_size.iter().enumerate().rev() {
            let Some(left) = room.checked_sub(usize::from(count)) else {
                return KeepRule { at_least: (i as u16).wrapping_add(1), of_smallest: room as u16 };
            };
            room = left;
        }
        KeepRule::everything()
    }

    /// Takes the codes out of the labels of one tile; returns the classes of its surfaces.
    fn take_classes(&mut self, tile: Tile, classes: &[SurfaceClass; CODES]) -> [SurfaceClass; MAX_SURFACES] {
        let mut given = [SurfaceClass::Undefined; MAX_SURFACES];
        for y in 0..tile.height {
            for label in self.labels.get_mut(tile.row(y, self.width)).unwrap_or_default() {
                let code = usize::from(*label >> CODE_SHIFT);
                *label &= NUMBER_MASK;
                if let Some(class) = usize::from(*label).checked_sub(1).and_then(|i| given.get_mut(i)) {
                    *class = classes.get(code).copied().unwrap_or_default();
                }
            }
        }
        given
    }

    /// Measures the surfaces of one tile and appends them to the table, with the classes `given` for them, if any.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "what a tile has, input and output")]
    fn measure<const DISPARITIES: usize>(
        &mut self,
        pixels: &[DisparityPixel],
        tile: Tile,
        depth: &DepthTable<DISPARITIES>,
        rays: &Rays,
        keep: &mut KeepRule,
        given: Option<&[SurfaceClass; MAX_SURFACES]>,
        table: &mut impl Table,
    ) {
        let stride = self.width;
        let row = |y: usize| tile.row(y, stride);
        // The farthest point of a surface decides how many bits its distances can keep; it has the smallest disparity.
        let mut farthest = [u16::MAX; MAX_SURFACES];
        let mut count = 0;
        for y in 0..tile.height {
            let pixels = pixels.get(row(y)).unwrap_or_default();
            for (label, run) in segments(self.labels.get(row(y)).unwrap_or_default()) {
                work::count(Loop::SurfaceSegments, 1);
                if let Some(farthest) = usize::from(label).checked_sub(1).and_then(|i| farthest.get_mut(i)) {
                    let run = pixels.get(run).unwrap_or_default();
                    work::count(Loop::SurfaceSums, run.len());
                    *farthest = run.iter().fold(*farthest, |least, pixel| least.min(pixel.bits()));
                    count = count.max(usize::from(label));
                }
            }
        }
        for ((farthest, shift), moments) in
            farthest.iter().zip(self.shifts.iter_mut()).zip(self.moments.iter_mut()).take(count)
        {
            // The bits beyond the lowest 16 that are used.
            *shift = 16u32.saturating_sub(depth.inverse(*farthest).leading_zeros()) as u8;
            *moments = Moments::ZERO;
        }
        let middle = (TILE / 2) as i32;
        for y in 0..tile.height {
            let v = (y as i32).wrapping_sub(middle);
            let labels = self.labels.get(row(y)).unwrap_or_default();
            if labels.iter().all(|&label| label == 0) {
                continue;
            }
            let distances = depth.inverses(&piece(pixels.get(row(y)).unwrap_or_default(), 0));
            for (label, run) in segments(labels) {
                work::count(Loop::SurfaceSegments, 1);
                let Some(i) = usize::from(label).checked_sub(1) else { continue };
                if let (Some(moments), Some(&shift)) = (self.moments.get_mut(i), self.shifts.get(i)) {
                    moments.add(&RowMoments::of_run(&distances, run, u32::from(shift)), v);
                }
            }
        }
        let mut renumbered = [0u8; MAX_SURFACES];
        let (mut kept, mut left_out) = (0u8, false);
        let [u, v] = [tile.x, self.top.wrapping_add(tile.y)].map(|first| first.wrapping_add(TILE / 2) as f32);
        for (i, number) in renumbered.iter_mut().enumerate().take(count) {
            work::count(Loop::SurfaceFitted, 1);
            let (moments, shift) = (&self.moments[i], u32::from(self.shifts[i]));
            let unit_m = depth.scale_m() * (1u32 << (shift & 31)) as f32;
            let mut surface = self.limits.classify(moments.scatter(rays, u, v, unit_m));
            if let Some(&class) = given.and_then(|given| given.get(i)) {
                surface.class = class;
            }
            if keep.keeps(moments.pixels()) && table.push(surface) {
                kept = kept.wrapping_add(1);
                *number = kept;
            } else {
                left_out = true;
            }
        }
        if left_out {
            work::count(Loop::SurfaceRelabelled, tile.width.saturating_mul(tile.height));
            for y in 0..tile.height {
                for label in self.labels.get_mut(row(y)).unwrap_or_default() {
                    *label = usize::from(*label).checked_sub(1).and_then(|i| renumbered.get(i)).copied().unwrap_or(0);
                }
            }
        }
    }
}

impl Limits {
    /// Fits the plane and tells horizontal from vertical.
    fn classify(&self, points: Scatter) -> Surface {
        let Some((normal, variance)) = points.plane() else {
            return Surface { points, class: SurfaceClass::Undefined, ..Surface::default() };
        };
        let mut surface = Surface { points, normal, rms_m: libm::sqrtf(variance), class: SurfaceClass::Slanted };
        let dot = surface.dot();
        if dot >= self.least_dot_of_horizontal {
            surface.class = SurfaceClass::Horizontal;
        } else if dot <= self.most_dot_of_vertical {
            surface.class = SurfaceClass::Vertical;
        }
        surface
    }
}

impl<const PIXELS: usize, const SURFACES: usize> Default for Surfaces<PIXELS, SURFACES> {
    fn default() -> Self {
        Self::new()
    }
}

/// All tiles of a picture.
struct Find<'a, const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize, const CODED: bool> {
    stage: &'a mut Surfaces<PIXELS, SURFACES>,
    picture: DisparityPicture<'a>,
    depth: &'a DepthTable<DISPARITIES>,
    rays: &'a Rays,
    classes: &'a [SurfaceClass; CODES],
    found: &'a mut u32,
}

impl<const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize, const CODED: bool> Steps
    for Find<'_, PIXELS, SURFACES, DISPARITIES, CODED>
{
    #[inline(always)]
    fn run(self) {
        let Self { stage, picture, depth, rays, classes, found } = self;
        *found = stage.go_through::<DISPARITIES, CODED>(picture, depth, rays, classes);
    }
}

/// The pieces of a row of a tile that have one label each: label and columns.
#[inline(always)]
fn segments(labels: &[u8]) -> impl Iterator<Item = (u8, Range<usize>)> {
    // Beyond the end everything is without a label, and so is what lies before.
    let mut here = [0u8; TILE];
    if let Some(whole) = labels.first_chunk() {
        here = *whole;
    } else {
        here.iter_mut().zip(labels).for_each(|(to, from)| *to = *from);
    }
    let mut changes = changes(&here);
    let length = labels.len().min(TILE);
    core::iter::from_fn(move || {
        let first = changes.trailing_zeros() as usize;
        changes &= changes.wrapping_sub(1);
        let end = (changes.trailing_zeros() as usize).min(length);
        here.get(first).map(|&label| (label, first..end))
    })
}

/// Which surfaces are kept when there are too many: all that are larger than a size, and as many of that size as there is
/// room for, in the order of the tiles.
struct KeepRule {
    at_least: u16,
    of_smallest: u16,
}

impl KeepRule {
    const fn everything() -> Self {
        Self { at_least: 0, of_smallest: u16::MAX }
    }

    fn keeps(&mut self, pixels: u16) -> bool {
        if pixels == self.at_least {
            let room = self.of_smallest > 0;
            self.of_smallest = self.of_smallest.saturating_sub(1);
            return room;
        }
        pixels > self.at_least
    }
}

#[cfg(test)]
mod tests;
