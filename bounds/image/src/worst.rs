//! Instructions of the stages with the pictures that cost the most of all that are known: what `fencepost-bounds search --inputs` has
//! written, laid into the board's outer memory by the simulator.
//!
//! Prints `taken STAGE INSTRUCTIONS` for each of them, and `done`. The functions are named so that their bounds are found in this very
//! image.
#![no_std]
#![no_main]

mod board;
mod clock;

use cortex_m::Peripherals;
use cortex_m_rt::entry;
use cortex_m_semihosting::hprintln;
use fencepost_core::{
    detector::{Detector, Stage},
    disparity::{DisparityPicture, DisparityPixel, Reason},
    geometry::{
        CameraModel, DepthTable, Distortion, Mount, Place, RawPair, Rays, Rectification, RectifiedPair,
        StereoCalibration, VehicleFrame,
    },
    ground::{GroundFinder, GroundPlane, Terrain},
    map::{Cell, CellState, MapBuilder, MapGeometry, ObstacleMap, SectorDistances, UnknownReason, View},
    obstacles::{Obstacle, ObstacleFinder},
    picture::Picture,
    rectify::grid_nodes,
    settings::Settings,
    surfaces::{Regions, SurfaceReport, Surfaces},
    validate::SurfaceSize,
    wire::{EncodeReport, Frame, OutputFull, Scan, ScanEncoder, WireConfig, WireSettings},
};
use heapless::{Vec, VecView};

use board::fail;
use clock::Clock;

const WIDTH: usize = 320;
const HEIGHT: usize = 240;
const PIXELS: usize = WIDTH * HEIGHT;
const DISPARITIES: usize = 48;
const SURFACES: usize = 400;
const OBSTACLES: usize = 64;
const CELLS: usize = 2500;
const GRID: usize = grid_nodes(WIDTH, HEIGHT);
const RUNS: usize = 512;
const FRAMES: usize = 256;

/// Where the simulator puts the pictures, and bytes that lie there.
const PICTURES: usize = 0x6000_0000;
const ROOM: usize = 16 << 20;

type Whole = Detector<PIXELS, WIDTH, DISPARITIES, GRID, SURFACES, OBSTACLES, CELLS>;

/// The stages behind the matching, each for itself.
struct Stages {
    validate: &'static mut SurfaceSize<WIDTH>,
    surfaces: &'static mut Surfaces<PIXELS, SURFACES>,
    regions: &'static mut Regions<SURFACES>,
    ground: &'static mut GroundFinder,
    builder: &'static mut MapBuilder<CELLS>,
    pixels: &'static mut [DisparityPixel; PIXELS],
    depth: &'static mut DepthTable<DISPARITIES>,
    map: &'static mut ObstacleMap<CELLS>,
}

#[entry]
fn main() -> ! {
    static mut DETECTOR: Whole = Detector::new();
    static mut VALIDATE: SurfaceSize<WIDTH> = SurfaceSize::new();
    static mut SURFACE_TABLE: Surfaces<PIXELS, SURFACES> = Surfaces::new();
    static mut REGIONS: Regions<SURFACES> = Regions::new();
    static mut GROUND: GroundFinder = GroundFinder::new();
    static mut BUILDER: MapBuilder<CELLS> = MapBuilder::new();
    static mut DISPARITY: [DisparityPixel; PIXELS] = [DisparityPixel::none(Reason::LowTexture); PIXELS];
    static mut DEPTH: DepthTable<DISPARITIES> = DepthTable::new();
    static mut MAP: ObstacleMap<CELLS> = ObstacleMap::EMPTY;
    static mut CELLS_OF_SCAN: Vec<Cell, CELLS> = Vec::new();
    static mut FRAMES_OF_SCAN: Vec<Frame, FRAMES> = Vec::new();

    let mut rest = memory();
    let Some(peripherals) = Peripherals::take() else { fail("the timer is taken") };
    let mut clock = Clock::new(peripherals.SYST);
    if !clock.counts() {
        fail("the timer does not count instructions: QEMU needs -icount shift=0");
    }
    let mut stages = Stages {
        validate: VALIDATE,
        surfaces: SURFACE_TABLE,
        regions: REGIONS,
        ground: GROUND,
        builder: BUILDER,
        pixels: DISPARITY,
        depth: DEPTH,
        map: MAP,
    };
    while let Some((stage, numbers)) = head(&mut rest) {
        match stage {
            "rectify" | "match" | "health" => {
                let (left, right) = (take(&mut rest, PIXELS), take(&mut rest, PIXELS));
                detect(DETECTOR, stage, &numbers, [left, right], &mut clock);
            }
            "wire" => {
                let states = take(&mut rest, CELLS);
                encode(&numbers, states, CELLS_OF_SCAN, FRAMES_OF_SCAN.as_mut_view(), &mut clock);
            }
            _ => stages.run(stage, numbers[11], take(&mut rest, 2 * PIXELS), &mut clock),
        }
    }
    hprintln!("done");
    board::succeed()
}

/// Where the simulator has laid the pictures.
fn memory() -> &'static [u8] {
    // SAFETY: the board has that much memory there, nobody writes to it, and any bytes are bytes.
    unsafe { core::slice::from_raw_parts(PICTURES as *const u8, ROOM) }
}

fn take(rest: &mut &'static [u8], length: usize) -> &'static [u8] {
    let Some((taken, after)) = rest.split_at_checked(length) else { fail("the file ends in the middle") };
    *rest = after;
    taken
}

/// The name of the next stage, 16 bytes, and twelve numbers; `None` behind the last.
fn head(rest: &mut &'static [u8]) -> Option<(&'static str, [u32; 12])> {
    let name = core::str::from_utf8(take(rest, 16)).ok()?.trim_end_matches('\0');
    if name.is_empty() {
        return None;
    }
    let (words, _) = take(rest, 48).as_chunks::<4>();
    let mut numbers = [0; 12];
    numbers.iter_mut().zip(words).for_each(|(number, word)| *number = u32::from_le_bytes(*word));
    Some((name, numbers))
}

fn told(stage: &str, clock: &mut Clock) {
    let Some(taken) = clock.instructions().last().copied() else { fail("nothing is counted") };
    hprintln!("taken {} {}", stage, taken);
}

/// The whole detector: rectification, matching and health work on the same rows.
fn detect(detector: &mut Whole, stage: &str, numbers: &[u32; 12], pair: [&'static [u8]; 2], clock: &mut Clock) {
    let mount = Mount { height_m: Some(1.0), ..Mount::default() };
    let mut settings = Settings::default();
    settings.matching.disparities = DISPARITIES as u16;
    if detector.configure(&settings, &calibration(stage, numbers), &mount).is_err() {
        fail("the detector cannot be configured");
    }
    // Larger pictures show whatever lies in the memory, left and right something else, so that strips are matched the other way round.
    let scale = scale(stage, numbers);
    let apart = memory().get(PIXELS * 23 + 7..).unwrap_or_default();
    let pair = if scale > 1 { [memory(), apart] } else { pair };
    let pixels = scale * scale * PIXELS;
    let pictures =
        pair.map(|all| Picture::packed(all.get(..pixels).unwrap_or_default(), scale * WIDTH, scale * HEIGHT));
    let [Ok(left), Ok(right)] = pictures else { fail("the pictures are too small") };
    clock.begin();
    if detector.detect(&left, &right, clock).is_err() {
        fail("the pictures have another size than the cameras");
    }
    clock.leave();
    for (of, instructions) in Stage::ALL.iter().zip(clock.instructions()) {
        if of.name() == stage {
            hprintln!("taken {} {}", stage, instructions);
        }
    }
}

impl Stages {
    fn run(&mut self, stage: &str, how: u32, disparities: &[u8], clock: &mut Clock) {
        let settings = Settings::default();
        if stage == "validate" {
            fill(self.pixels, disparities);
            if self.validate.configure(&settings.validate, WIDTH).is_err() {
                fail("the defaults cannot be used");
            }
            clock.begin();
            entry_validate_run(self.validate, &mut *self.pixels);
            return told(stage, clock);
        }
        let mut pair = pair();
        let on_mast = how / 288 % 2 == 1;
        match how / 48 % 3 {
            0 => {}
            long => {
                let (focal, share) = (4.0 * long as f32, if long == 1 || on_mast { 0.65 } else { 0.3 });
                pair.focal_px = focal * WIDTH as f32;
                pair.baseline_m = share * DISPARITIES as f32 * 29.6 / pair.focal_px;
            }
        }
        let pitch_down_deg = [0.0, 10.0, 30.0, 55.0, -20.0, -55.0][how as usize % 6];
        // A camera that looks ahead or back, of a robot or on a mast.
        let yaw_left_deg = if how / 144 % 2 == 0 { 0.0 } else { -135.0 };
        let step_m = if on_mast { 1.5 } else { 0.3 };
        let height_m = Some(step_m * (how / 6 % 8) as f32).filter(|height_m| *height_m > 0.0);
        let mount = Mount { height_m, pitch_down_deg, ..Mount::default() };
        let Ok(frame) = VehicleFrame::new(&mount) else { fail("the mount cannot be used") };
        let (rays, place) = (Rays::new(&pair, &frame), Place::new(&Mount { yaw_left_deg, ..mount }));
        self.depth.configure(&pair, 0, DISPARITIES as u16);
        let known = mount.height_m.is_some();
        if self.surfaces.configure(&settings.surfaces, WIDTH, HEIGHT).is_err()
            || self.ground.configure(&settings.ground, &frame, known, PIXELS).is_err()
        {
            fail("the defaults cannot be used");
        }
        // There is ground to begin from: that of the frame before, which showed nothing else.
        fill_level(self.pixels, &rays, &pair);
        let picture = DisparityPicture::new(&*self.pixels, WIDTH);
        entry_surfaces_run(self.surfaces, picture, self.depth, &rays);
        entry_ground_run(self.ground, self.surfaces, self.regions, picture, (self.depth, &rays));
        fill(self.pixels, disparities);
        let picture = DisparityPicture::new(&*self.pixels, WIDTH);
        clock.begin();
        entry_surfaces_run(self.surfaces, picture, self.depth, &rays);
        if stage == "surfaces" {
            return told(stage, clock);
        }
        clock.begin();
        entry_ground_run(self.ground, self.surfaces, self.regions, picture, (self.depth, &rays));
        if stage == "ground" {
            return told(stage, clock);
        }
        let mut finder = ObstacleFinder::new();
        let mut found: Vec<Obstacle, OBSTACLES, u16> = Vec::new();
        let heights = (settings.obstacles.min_height_m, settings.obstacles.clearance_m);
        if finder.configure(&settings.obstacles, pair.focal_px).is_err()
            || self.builder.configure(&settings.map, heights).is_err()
        {
            fail("the defaults cannot be used");
        }
        let terrain = self.ground.terrain();
        clock.begin();
        entry_obstacles_run(&mut finder, (self.surfaces, self.regions), picture, terrain, &place, &mut found);
        if stage == "obstacles" {
            return told(stage, clock);
        }
        let view = View { pair: &pair, frame: &frame, place: &place, rays: &rays, depth: self.depth, nearest_m: 0.5 };
        clock.begin();
        entry_map_run(self.builder, self.surfaces, picture, &view, (terrain, true), self.map);
        told(stage, clock);
    }
}

/// A map of `states`, one byte for each cell: unknown, free, obstacle.
fn encode(
    numbers: &[u32; 12],
    states: &[u8],
    cells: &mut Vec<Cell, CELLS>,
    frames: &mut VecView<Frame>,
    clock: &mut Clock,
) {
    cells.clear();
    for state in states {
        let state = match state {
            0 => CellState::Unknown(UnknownReason::NoMatch),
            1 => CellState::Free,
            _ => CellState::Obstacle,
        };
        // There is room: there are as many states.
        let _ = cells.push(Cell { state, ..Cell::default() });
    }
    let geometry = MapGeometry {
        cell_size_mm: 500,
        x_first: -((numbers[0] % 64) as i16),
        x_count: 50,
        y_first: -((numbers[1] % 64) as i16),
        y_count: 50,
    };
    let Ok(config) = WireConfig::new(WireSettings::default()) else { fail("the defaults cannot be used") };
    let Ok(mut encoder) = ScanEncoder::<RUNS>::new(config) else { fail("there is no room") };
    let scan = Scan {
        scan_index: 0,
        age_ns: 0,
        health: Default::default(),
        geometry: &geometry,
        cells,
        sectors: &SectorDistances::default(),
        ground: None,
    };
    frames.clear();
    clock.begin();
    let encoded = entry_wire_encode(&mut encoder, &scan, frames);
    told("wire", clock);
    if encoded.is_err() {
        fail("there is no room for the scan");
    }
}

fn pair() -> RectifiedPair {
    RectifiedPair {
        width: WIDTH as u32,
        height: HEIGHT as u32,
        focal_px: 0.8 * WIDTH as f32,
        cx: 0.5 * WIDTH as f32,
        cy: 0.5 * HEIGHT as f32,
        baseline_m: 0.12,
        disparity_offset_px: 0.0,
    }
}

/// Disparities in 1/16 px, two bytes each; 0 is none.
fn fill(pixels: &mut [DisparityPixel; PIXELS], disparities: &[u8]) {
    for (pixel, steps) in pixels.iter_mut().zip(disparities.as_chunks::<2>().0) {
        *pixel = match u16::from_le_bytes(*steps) {
            0 => DisparityPixel::none(Reason::LowTexture),
            steps => DisparityPixel::from_steps(steps),
        };
    }
}

/// What level ground looks like.
fn fill_level(level: &mut [DisparityPixel; PIXELS], rays: &Rays, pair: &RectifiedPair) {
    for (i, pixel) in level.iter_mut().enumerate() {
        let height_m = |z_m: f32| rays.point_m((i % WIDTH) as f32, (i / WIDTH) as f32, z_m)[2];
        let (here, ahead) = (height_m(0.0), height_m(1.0));
        let steps = 16.0 * pair.disparity_px(here / (here - ahead));
        // Where the ray does not go down there is no ground.
        *pixel = if ahead < here {
            DisparityPixel::from_steps(steps as u16)
        } else {
            DisparityPixel::none(Reason::NotUnique)
        };
    }
}

/// How much larger than the rectified pictures those of the cameras are: then a segment lies across more of them.
fn scale(stage: &str, numbers: &[u32; 12]) -> usize {
    if stage == "rectify" { 1 + (numbers[10] % 4) as usize } else { 1 }
}

/// Cameras as the numbers say, as the search has them. For rectifying they may be turned or see nothing but their last pixel; for
/// matching the right one may look past its picture.
fn calibration(stage: &str, numbers: &[u32; 12]) -> StereoCalibration {
    let (number, how, scale) = (numbers[9], numbers[11], scale(stage, numbers));
    let mut pair = pair();
    let times = scale as f32;
    let mut camera = CameraModel {
        width: (scale * WIDTH) as u32,
        height: (scale * HEIGHT) as u32,
        fx: times * pair.focal_px,
        fy: times * pair.focal_px,
        cx: times * pair.cx,
        cy: times * pair.cy,
        distortion: Distortion::default(),
    };
    let mut right = camera;
    let mut angle = 0.0;
    match stage {
        "rectify" if how % 2 == 1 => {
            pair.focal_px = 1.0e5;
            (camera.fx, camera.fy) = (1.0, 1.0);
            (camera.cx, camera.cy) = (camera.width as f32 - 1.0, camera.height as f32 - 1.0);
            right = camera;
        }
        "rectify" => {
            angle = ((number % 180) as f32).to_radians();
            camera.fx *= (1 + number / 180 % 4) as f32;
            camera.fy = camera.fx;
            right = camera;
        }
        "health" if how % 4 == 2 => {
            angle = core::f32::consts::FRAC_PI_2;
            camera.fx *= 0.7;
            camera.fy = camera.fx;
            right = camera;
        }
        "match" | "health" if how % 4 == 3 => right.cx += (number % 64) as f32,
        _ => return StereoCalibration::Rectified(pair),
    }
    let (sin, cos) = (libm::sinf(angle), libm::cosf(angle));
    let turn = [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]];
    let none = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    StereoCalibration::Raw(RawPair {
        left: camera,
        right,
        rotation: none,
        translation_m: [-pair.baseline_m, 0.0, 0.0],
        rectification: Some(Rectification { left_rotation: turn, right_rotation: turn, pair }),
    })
}

#[unsafe(no_mangle)]
#[inline(never)]
fn entry_validate_run(size: &mut SurfaceSize<WIDTH>, picture: &mut [DisparityPixel]) {
    size.run(picture);
}

#[unsafe(no_mangle)]
#[inline(never)]
fn entry_surfaces_run(
    surfaces: &mut Surfaces<PIXELS, SURFACES>,
    picture: DisparityPicture<'_>,
    depth: &DepthTable<DISPARITIES>,
    rays: &Rays,
) -> SurfaceReport {
    surfaces.run(picture, depth, rays)
}

#[unsafe(no_mangle)]
#[inline(never)]
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
#[inline(never)]
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
#[inline(never)]
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
#[inline(never)]
fn entry_wire_encode(
    encoder: &mut ScanEncoder<RUNS>,
    scan: &Scan<'_>,
    frames: &mut VecView<Frame>,
) -> Result<EncodeReport, OutputFull> {
    encoder.encode(scan, frames)
}
