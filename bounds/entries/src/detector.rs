//! The whole detector, and each of its stages by itself.

use fencepost_core::{
    arch::Backend,
    bands::{Job, Workers},
    detector::{Band, DetectError, Detection, Detector},
    disparity::{DisparityPicture, DisparityPixel},
    error::ConfigError,
    geometry::{DepthTable, Mount, Place, Rays, RectifiedPair, StereoCalibration, VehicleFrame},
    ground::{GroundFinder, GroundPlane, GroundSettings, Terrain},
    health::{Exposure, Health, HealthSettings},
    map::{MapBuilder, MapSettings, Merged, ObstacleMap, OtherCells, SectorDistances, View},
    matching::{MatchSettings, Matcher, ValidSpan},
    methods::{
        ConfidenceSettings, CostMap, CostMapSettings, DisparitySegmentSettings, DisparitySegments, GroundDeviation,
        GroundDeviationSettings, OtherMap, PixelNormalSettings, PixelNormals,
    },
    obstacles::{Obstacle, ObstacleFinder, ObstacleSettings},
    picture::Picture,
    rectify::{Rectifier, Side, grid_nodes},
    settings::Settings,
    surfaces::{Regions, Surface, SurfaceReport, SurfaceSettings, Surfaces},
    validate::{SurfaceSize, ValidateSettings},
};
use heapless::Vec;

const WIDTH: usize = 320;
const HEIGHT: usize = 240;
const PIXELS: usize = WIDTH * HEIGHT;
const DISPARITIES: usize = 48;
const GRID: usize = grid_nodes(WIDTH, HEIGHT);
const SURFACES: usize = 400;
const OBSTACLES: usize = 64;
const CELLS: usize = 2500;

type Whole = Detector<PIXELS, WIDTH, DISPARITIES, GRID, SURFACES, OBSTACLES, CELLS>;

/// As firmware keeps it: its size is that of the symbol.
#[unsafe(no_mangle)]
static mut DETECTOR: Whole = Detector::new();

/// The static, so that it is part of the image.
#[unsafe(no_mangle)]
fn entry_detector_static() -> *mut Whole {
    &raw mut DETECTOR
}

#[unsafe(no_mangle)]
fn entry_detector_configure(
    detector: &mut Whole,
    settings: &Settings,
    calibration: &StereoCalibration,
    mount: &Mount,
) -> Result<(), ConfigError> {
    detector.configure(settings, calibration, mount)
}

#[unsafe(no_mangle)]
fn entry_detector_detect<'a>(
    detector: &'a mut Whole,
    left: &Picture<'_>,
    right: &Picture<'_>,
) -> Result<&'a Detection<OBSTACLES, CELLS>, DetectError> {
    detector.detect(left, right, &mut ())
}

#[unsafe(no_mangle)]
fn entry_detector_detect_in_bands<'a>(
    detector: &'a mut Whole,
    pictures: &[Picture<'_>; 2],
    bands: &mut [Band<WIDTH, DISPARITIES, CELLS>],
    order: &[u8],
) -> Result<&'a Detection<OBSTACLES, CELLS>, DetectError> {
    detector.detect_in_bands(&pictures[0], &pictures[1], bands, &mut InOrder(order), &mut ())
}

/// Does the jobs that it is told of, on its own stack, as the first core of several does with its share: not all of them, and some
/// twice, as it may be.
struct InOrder<'a>(&'a [u8]);

impl Workers for InOrder<'_> {
    fn run<J: Job>(&mut self, jobs: &mut [J]) {
        for &at in self.0 {
            if let Some(job) = jobs.get_mut(usize::from(at)) {
                job.run();
            }
        }
    }
}

#[unsafe(no_mangle)]
fn entry_detector_forget(detector: &mut Whole) {
    detector.forget();
}

#[unsafe(no_mangle)]
fn entry_detector_backend(detector: &mut Whole, backend: Backend) -> (bool, Backend) {
    (detector.set_backend(backend), detector.backend())
}

#[unsafe(no_mangle)]
fn entry_detector_disparity(detector: &Whole) -> DisparityPicture<'_> {
    detector.disparity()
}

#[unsafe(no_mangle)]
fn entry_detector_surface_at(detector: &Whole, x: usize, y: usize) -> Option<&Surface> {
    detector.surface_at(x, y)
}

#[unsafe(no_mangle)]
fn entry_rectify_configure(
    rectifier: &mut Rectifier<GRID>,
    calibration: &StereoCalibration,
) -> Result<RectifiedPair, ConfigError> {
    rectifier.configure(calibration)
}

#[unsafe(no_mangle)]
fn entry_rectify_row(
    rectifier: &Rectifier<GRID>,
    side: Side,
    raw: &Picture<'_>,
    y: usize,
    out: &mut [u8],
) -> core::ops::Range<usize> {
    rectifier.row(side, raw, y, out)
}

#[unsafe(no_mangle)]
fn entry_rectify_source(rectifier: &Rectifier<GRID>, side: Side, u: f32, v: f32) -> Option<(f32, f32)> {
    rectifier.source_of(side, u, v)
}

#[unsafe(no_mangle)]
fn entry_match_configure(
    matcher: &mut Matcher<WIDTH, DISPARITIES>,
    settings: &MatchSettings,
    width: usize,
    height: usize,
) -> Result<(), ConfigError> {
    matcher.configure(settings, width, height)
}

#[unsafe(no_mangle)]
fn entry_match_begin(matcher: &mut Matcher<WIDTH, DISPARITIES>) {
    matcher.begin();
}

#[unsafe(no_mangle)]
fn entry_match_push(matcher: &mut Matcher<WIDTH, DISPARITIES>, rows: &[&[u8]; 2], spans: &[ValidSpan; 2]) {
    matcher.push(rows[0], rows[1], spans[0], spans[1]);
}

#[unsafe(no_mangle)]
fn entry_match_pull(matcher: &mut Matcher<WIDTH, DISPARITIES>, next: usize, out: &mut [DisparityPixel]) -> bool {
    matcher.pull(next, out)
}

#[unsafe(no_mangle)]
fn entry_validate_configure(
    size: &mut SurfaceSize<WIDTH>,
    settings: &ValidateSettings,
    width: usize,
) -> Result<(), ConfigError> {
    size.configure(settings, width)
}

#[unsafe(no_mangle)]
fn entry_validate_run(size: &mut SurfaceSize<WIDTH>, picture: &mut [DisparityPixel]) {
    size.run(picture);
}

#[unsafe(no_mangle)]
fn entry_surfaces_configure(
    surfaces: &mut Surfaces<PIXELS, SURFACES>,
    settings: &SurfaceSettings,
    width: usize,
    height: usize,
) -> Result<(), ConfigError> {
    surfaces.configure(settings, width, height)
}

#[unsafe(no_mangle)]
fn entry_surfaces_run(
    surfaces: &mut Surfaces<PIXELS, SURFACES>,
    picture: DisparityPicture<'_>,
    depth: &DepthTable<DISPARITIES>,
    rays: &Rays,
) -> SurfaceReport {
    surfaces.run(picture, depth, rays)
}

#[unsafe(no_mangle)]
fn entry_surfaces_join(
    regions: &mut Regions<SURFACES>,
    surfaces: &Surfaces<PIXELS, SURFACES>,
    picture: DisparityPicture<'_>,
) -> usize {
    regions.join(surfaces, picture, |surface| surface.normal[2] > 0.5);
    let count = |root| regions.members(root).fold(0usize, |count, _| count.saturating_add(1));
    regions.roots().map(count).max().unwrap_or(0)
}

#[unsafe(no_mangle)]
fn entry_surfaces_root(regions: &mut Regions<SURFACES>, place: usize) -> usize {
    regions.root(place)
}

#[unsafe(no_mangle)]
fn entry_depth_configure(depth: &mut DepthTable<DISPARITIES>, pair: &RectifiedPair, first: u16, count: u16) {
    depth.configure(pair, first, count);
}

#[unsafe(no_mangle)]
fn entry_depth_of(depth: &DepthTable<DISPARITIES>, steps: u16) -> (u32, f32) {
    (depth.inverse(steps), depth.distance_m(steps))
}

#[unsafe(no_mangle)]
fn entry_ground_configure(
    ground: &mut GroundFinder,
    settings: &GroundSettings,
    frame: &VehicleFrame,
    height_known: bool,
    pixels: usize,
) -> Result<(), ConfigError> {
    ground.configure(settings, frame, height_known, pixels)
}

#[unsafe(no_mangle)]
fn entry_ground_run(
    ground: &mut GroundFinder,
    surfaces: &mut Surfaces<PIXELS, SURFACES>,
    regions: &mut Regions<SURFACES>,
    picture: DisparityPicture<'_>,
    geometry: (&DepthTable<DISPARITIES>, &Rays),
) -> Option<GroundPlane> {
    ground.run(surfaces, regions, picture, geometry)
}

#[unsafe(no_mangle)]
fn entry_ground_terrain(terrain: &mut Terrain, plane: &GroundPlane, p: [f32; 3]) -> (f32, f32) {
    terrain.flatten(*plane);
    (terrain.lift_m(p[0], p[1]), terrain.height_m(p))
}

#[unsafe(no_mangle)]
fn entry_obstacles_configure(
    finder: &mut ObstacleFinder,
    settings: &ObstacleSettings,
    focal_px: f32,
) -> Result<(), ConfigError> {
    finder.configure(settings, focal_px)
}

#[unsafe(no_mangle)]
fn entry_obstacles_run(
    finder: &mut ObstacleFinder,
    tables: (&mut Surfaces<PIXELS, SURFACES>, &mut Regions<SURFACES>),
    picture: DisparityPicture<'_>,
    ground: &Terrain,
    place: &Place,
    obstacles: &mut Vec<Obstacle, OBSTACLES, u16>,
) -> u32 {
    finder.run(tables.0, tables.1, picture, ground, place, obstacles)
}

#[unsafe(no_mangle)]
fn entry_map_configure(
    builder: &mut MapBuilder<CELLS>,
    settings: &MapSettings,
    heights_m: (f32, f32),
) -> Result<(), ConfigError> {
    builder.configure(settings, heights_m)
}

#[unsafe(no_mangle)]
fn entry_map_run(
    builder: &mut MapBuilder<CELLS>,
    surfaces: &Surfaces<PIXELS, SURFACES>,
    picture: DisparityPicture<'_>,
    view: &View<'_, DISPARITIES>,
    ground: (&Terrain, bool),
    map: &mut ObstacleMap<CELLS>,
) {
    builder.run(surfaces, picture, view, ground.0, ground.1, map);
}

#[unsafe(no_mangle)]
fn entry_map_sectors(map: &ObstacleMap<CELLS>, width_deg: f32) -> SectorDistances {
    SectorDistances::of(map, width_deg)
}

#[unsafe(no_mangle)]
fn entry_map_merge(merged: &mut Merged<CELLS>, detection: &Detection<OBSTACLES, CELLS>) -> Result<Health, OtherCells> {
    merged.clear();
    merged.add(detection)?;
    Ok(merged.health())
}

#[unsafe(no_mangle)]
fn entry_cross_check(other: &mut OtherMap<CELLS>, map: &mut ObstacleMap<CELLS>, settings: &ConfidenceSettings) {
    other.keep(map);
    other.check(map, settings);
}

#[unsafe(no_mangle)]
fn entry_health_begin(detector: &mut Whole, width: usize, height: usize) {
    detector.begin_health(width, height);
}

#[unsafe(no_mangle)]
fn entry_health_rows(
    detector: &mut Whole,
    y: usize,
    rows: &[&[u8]; 2],
    spans: &[ValidSpan; 2],
    disparities: (usize, usize),
) {
    detector.look_at_rows(y, *rows, *spans, disparities);
}

#[unsafe(no_mangle)]
fn entry_health_judge<'a>(
    detector: &'a mut Whole,
    left: &Picture<'_>,
    right: &Picture<'_>,
) -> Option<&'a Detection<OBSTACLES, CELLS>> {
    detector.judge_health(left, right)
}

#[unsafe(no_mangle)]
fn entry_exposure(picture: &Picture<'_>) -> Exposure {
    Exposure::of(picture)
}

#[unsafe(no_mangle)]
fn entry_health_settings(settings: &HealthSettings) -> Result<(), ConfigError> {
    settings.check()
}

#[unsafe(no_mangle)]
fn entry_cost_map_configure(
    method: &mut CostMap,
    settings: &CostMapSettings,
    ground: &GroundSettings,
    pixels: usize,
) -> Result<(), ConfigError> {
    method.configure(settings, ground, pixels)
}

#[unsafe(no_mangle)]
fn entry_ground_deviation_configure(
    method: &mut GroundDeviation,
    settings: (&GroundDeviationSettings, &GroundSettings),
    pair: &RectifiedPair,
    frame: &VehicleFrame,
    height_known: bool,
) -> Result<(), ConfigError> {
    method.configure(settings.0, settings.1, pair, frame, height_known)
}

#[unsafe(no_mangle)]
fn entry_disparity_segments_configure(
    method: &mut DisparitySegments,
    settings: &DisparitySegmentSettings,
    ground: &GroundSettings,
    pixels: usize,
) -> Result<(), ConfigError> {
    method.configure(settings, ground, pixels)
}

#[unsafe(no_mangle)]
fn entry_disparity_segments_run(
    method: &DisparitySegments,
    surfaces: &mut Surfaces<PIXELS, SURFACES>,
    regions: &mut Regions<SURFACES>,
    picture: DisparityPicture<'_>,
    frame: &VehicleFrame,
) -> Option<GroundPlane> {
    method.run(surfaces, regions, picture, frame)
}

#[unsafe(no_mangle)]
fn entry_pixel_normals_configure(
    method: &mut PixelNormals<WIDTH>,
    settings: (&PixelNormalSettings, &SurfaceSettings),
    width: usize,
) -> Result<(), ConfigError> {
    method.configure(settings.0, settings.1, width)
}
