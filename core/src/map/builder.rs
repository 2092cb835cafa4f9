//! From classified surfaces to cells.

use super::{
    Cell, CellState, MapGeometry, MapSettings, ObstacleMap, UnknownReason, shadow, smear,
    votes::{Collect, Common, TileRows},
};
use crate::{
    arch::{self, Chosen},
    disparity::{DisparityPicture, Reason},
    error::ConfigError,
    geometry::{DepthTable, Place, Rays, RectifiedPair, VehicleFrame},
    ground::Terrain,
    surfaces::{MAX_TILE_SURFACES, Surfaces},
    work::{self, Loop},
};

/// How the left camera sees the world.
#[derive(Clone, Copy)]
pub struct View<'a, const DISPARITIES: usize> {
    /// The rectified pair.
    pub pair: &'a RectifiedPair,
    /// How the left camera sits in the frame of the pair.
    pub frame: &'a VehicleFrame,
    /// Where the pair stands on the vehicle.
    pub place: &'a Place,
    /// Rays of the left camera, in the frame of the pair.
    pub rays: &'a Rays,
    /// Distances of the search range.
    pub depth: &'a DepthTable<DISPARITIES>,
    /// Nearest distance along the optical axis that the search range reaches, metres.
    pub nearest_m: f32,
}

/// What the pixels say of one cell.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Evidence {
    /// Pixels of obstacles between the least height and the clearance.
    pub(crate) obstacle: u16,
    /// Pixels of surfaces on the ground.
    pub(crate) ground: u16,
    /// Other pixels too high for a free cell.
    pub(crate) unclear: u16,
    /// Greatest height of an obstacle pixel, decimetres.
    pub(crate) height_dm: u8,
}

/// What a pixel says of a cell, where a detector decides by itself what its pixels say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Vote {
    /// Ground was seen.
    Ground,
    /// Something stands there.
    Obstacle {
        /// Height above the ground, metres.
        height_m: f32,
    },
}

/// Turns the points of surfaces into cells.
///
/// Source: the paper, section 4.4, last step. A pixel is a vote; how many votes a cell needs follows from its distance, because
/// the same piece of ground or obstacle covers fewer pixels far away.
///
/// # Bound
/// One pass of `width x height` steps, one of `CELLS`.
pub struct MapBuilder<const CELLS: usize> {
    pub(super) settings: MapSettings,
    pub(super) obstacle_heights_m: (f32, f32),
    pub(super) evidence: [Evidence; CELLS],
    /// Of the surfaces of one tile.
    pub(super) common: [Common; MAX_TILE_SURFACES],
    pub(super) chosen: Chosen,
}

impl<const CELLS: usize> MapBuilder<CELLS> {
    /// A stage that is not configured.
    pub const fn new() -> Self {
        const NOTHING: Evidence = Evidence { obstacle: 0, ground: 0, unclear: 0, height_dm: 0 };
        Self {
            settings: MapSettings::UNSET,
            obstacle_heights_m: (0.0, 0.0),
            evidence: [NOTHING; CELLS],
            common: [Common::UNSET; MAX_TILE_SURFACES],
            chosen: Chosen::PLAIN,
        }
    }

    /// Takes settings, and the least height and the clearance of obstacles, metres.
    ///
    /// # Errors
    /// The first setting that cannot be used, named `map.*`.
    pub fn configure(&mut self, settings: &MapSettings, obstacle_heights_m: (f32, f32)) -> Result<(), ConfigError> {
        settings.check(CELLS)?;
        self.settings = *settings;
        self.obstacle_heights_m = obstacle_heights_m;
        Ok(())
    }

    /// Has the votes collected with the instructions of a backend.
    pub(crate) const fn choose(&mut self, chosen: Chosen) {
        self.chosen = chosen;
    }

    /// The backend whose instructions are used.
    pub(crate) const fn chosen(&self) -> Chosen {
        self.chosen
    }

    /// Fills `map`. Without a ground plane nothing is free, and obstacles are measured from the plane of the mount.
    pub fn run<const PIXELS: usize, const SURFACES: usize, const DISPARITIES: usize>(
        &mut self,
        surfaces: &Surfaces<PIXELS, SURFACES>,
        picture: DisparityPicture<'_>,
        view: &View<'_, DISPARITIES>,
        ground: &Terrain,
        ground_seen: bool,
        map: &mut ObstacleMap<CELLS>,
    ) {
        self.begin();
        // The surfaces of another picture say nothing about this one.
        if (picture.width(), picture.height()) == surfaces.size() {
            let Self { settings, obstacle_heights_m, evidence, common, chosen } = self;
            let evidence = evidence.get_mut(..settings.geometry.len()).unwrap_or_default();
            let (obstacle_heights_m, rows) = (*obstacle_heights_m, TileRows::ALL);
            arch::compiled(
                *chosen,
                Collect { settings, obstacle_heights_m, evidence, common, surfaces, picture, view, ground, rows },
            );
        }
        self.fill(picture, view, ground, ground_seen, map, |_, cell| cell);
        self.compare_cells(view.place, map);
    }

    /// Begins a map for which nothing was seen.
    pub(crate) fn begin(&mut self) {
        self.table().fill(Evidence::default());
    }

    /// Where the cells lie.
    pub(crate) const fn geometry(&self) -> MapGeometry {
        self.settings.geometry
    }

    /// What was said of each cell: room for numbers by cell, before [`Self::begin`].
    pub(crate) fn table(&mut self) -> &mut [Evidence] {
        // Never more than there is: `configure` made sure of it.
        self.evidence.get_mut(..self.settings.geometry.len()).unwrap_or_default()
    }

    /// What a pixel says of the cell at `[x, y]` of the vehicle frame, metres.
    pub(crate) fn vote(&mut self, [x, y]: [f32; 2], vote: Vote) {
        let place = self.settings.geometry.index_at(x, y);
        let Some(evidence) = place.and_then(|place| self.evidence.get_mut(place)) else { return };
        match vote {
            Vote::Ground => evidence.ground = evidence.ground.saturating_add(1),
            Vote::Obstacle { height_m } => {
                evidence.obstacle = evidence.obstacle.saturating_add(1);
                evidence.height_dm = evidence.height_dm.max((height_m * 10.0) as u8);
            }
        }
    }

    /// Fills `map` by what was said since [`Self::begin`]; `verdict` has the last word on each cell. What the window smears stays in: the
    /// paper's earlier detectors count it.
    pub(crate) fn finish<const DISPARITIES: usize>(
        &self,
        picture: DisparityPicture<'_>,
        view: &View<'_, DISPARITIES>,
        ground: &Terrain,
        ground_seen: bool,
        map: &mut ObstacleMap<CELLS>,
        verdict: impl Fn(&Evidence, Cell) -> Cell,
    ) {
        self.fill(picture, view, ground, ground_seen, map, verdict);
        shadow::mark(map, view.place);
    }

    fn fill<const DISPARITIES: usize>(
        &self,
        picture: DisparityPicture<'_>,
        view: &View<'_, DISPARITIES>,
        ground: &Terrain,
        ground_seen: bool,
        map: &mut ObstacleMap<CELLS>,
        verdict: impl Fn(&Evidence, Cell) -> Cell,
    ) {
        let geometry = self.settings.geometry;
        map.geometry = geometry;
        map.cells.clear();
        work::count(Loop::MapCells, geometry.len());
        for (index, evidence) in (0..geometry.len()).zip(&self.evidence) {
            let cell = self.decide(index, evidence, picture, view, ground, ground_seen);
            // Cannot fail: `configure` made sure that there is room.
            let _ = map.cells.push(verdict(evidence, cell));
        }
    }

    /// Looks at the cells of a map beside each other, when each has been decided on.
    pub(super) fn compare_cells(&self, place: &Place, map: &mut ObstacleMap<CELLS>) {
        smear::take_out(map, place, &self.settings);
        shadow::mark(map, place);
    }

    /// What the votes make of a cell.
    pub(super) fn decide<const DISPARITIES: usize>(
        &self,
        index: usize,
        evidence: &Evidence,
        picture: DisparityPicture<'_>,
        view: &View<'_, DISPARITIES>,
        ground: &Terrain,
        ground_seen: bool,
    ) -> Cell {
        let geometry = self.settings.geometry;
        let (i, j) = geometry.cell_at(index);
        // Seen from the camera: what can be seen and told of a cell is a matter of where the pair is.
        let [x, y] = view.place.to_pair(geometry.centre_m(i, j).into());
        let unknown = |reason| Cell { state: CellState::Unknown(reason), ..Cell::default() };
        let seen = Sight::of_ground(x, y, view, ground);
        if x * x + y * y > self.settings.max_range_m * self.settings.max_range_m {
            return unknown(UnknownReason::TooFar);
        }
        let Some(seen) = seen else { return unknown(UnknownReason::OutsideView) };
        // Pixels that a metre takes at this distance, across and, foreshortened, along the ground.
        let per_m = view.pair.focal_px / seen.distance_m;
        let across = geometry.cell_size_m() * per_m;
        let along = across * (ground.plane().camera_height_m / seen.distance_m).min(1.0);
        let obstacle_area = across * self.obstacle_heights_m.0 * per_m;
        let need_obstacle =
            (self.settings.obstacle_cover * obstacle_area).max(f32::from(self.settings.obstacle_min_pixels));
        let need_free = (self.settings.free_cover * across * along).max(f32::from(self.settings.free_min_pixels));
        // Without ground heights are those above the mount's plane, and what is unclear stays so.
        let unclear_share = if ground_seen { self.settings.unclear_share } else { 0.0 };
        let for_obstacle = f32::from(evidence.obstacle) + unclear_share * f32::from(evidence.unclear);
        if for_obstacle >= need_obstacle {
            let (pixels, height_dm) = (evidence.obstacle, evidence.height_dm);
            return Cell { state: CellState::Obstacle, pixels, height_dm, ..Cell::CERTAIN };
        }
        let against = f32::from(evidence.obstacle) + f32::from(evidence.unclear);
        if ground_seen && f32::from(evidence.ground) >= need_free && against < 0.5 * need_obstacle {
            return Cell { state: CellState::Free, pixels: evidence.ground, ..Cell::CERTAIN };
        }
        unknown(match seen.pixel {
            None => UnknownReason::OutsideView,
            Some(_) if seen.distance_m < view.nearest_m => UnknownReason::TooNear,
            Some(_) if !ground_seen => UnknownReason::NoGround,
            Some((u, v)) => match picture.row(v).get(u).map(|pixel| pixel.get()) {
                None => UnknownReason::OutsideView,
                Some(Ok(_)) => UnknownReason::TooFewPixels,
                Some(Err(Reason::LowTexture | Reason::Saturated)) => UnknownReason::LowTexture,
                Some(Err(_)) => UnknownReason::NoMatch,
            },
        })
    }
}

impl<const CELLS: usize> Default for MapBuilder<CELLS> {
    fn default() -> Self {
        Self::new()
    }
}

/// How the camera sees a point on the ground.
struct Sight {
    /// Distance along the optical axis, metres.
    distance_m: f32,
    /// Pixel, if it lies in the picture.
    pixel: Option<(usize, usize)>,
}

impl Sight {
    /// Looks at the ground at `(x, y)` of the pair's frame; `None` if it lies behind the camera.
    fn of_ground<const DISPARITIES: usize>(
        x: f32,
        y: f32,
        view: &View<'_, DISPARITIES>,
        ground: &Terrain,
    ) -> Option<Self> {
        let plane = ground.plane();
        let [nx, ny, nz] = plane.normal;
        let level = plane.offset_m + ground.lift_m(x, y);
        let z = if nz.abs() > 1.0e-3 { (level - nx * x - ny * y) / nz } else { 0.0 };
        let origin = view.rays.origin_m;
        let [right, down, distance_m] = view.frame.to_camera([x - origin[0], y - origin[1], z - origin[2]]);
        if distance_m <= 0.0 {
            return None;
        }
        let per_m = view.pair.focal_px / distance_m;
        let (u, v) = (view.pair.cx + right * per_m, view.pair.cy + down * per_m);
        let inside = u >= 0.0 && v >= 0.0 && u < view.pair.width as f32 && v < view.pair.height as f32;
        Some(Self { distance_m, pixel: inside.then_some((u as usize, v as usize)) })
    }
}
