//! The stages of a detector, one after the other, with the work of each counted by itself.

use fencepost_core::{
    detector::{Capacities, Detector},
    disparity::{DisparityPicture, DisparityPixel, Reason},
    geometry::{
        CameraModel, DepthTable, Distortion, Mount, Place, RawPair, Rays, Rectification, RectifiedPair,
        StereoCalibration, VehicleFrame,
    },
    ground::GroundFinder,
    map::{Cell, CellState, MapBuilder, MapGeometry, ObstacleMap, SectorDistances, UnknownReason, View},
    obstacles::{Obstacle, ObstacleFinder},
    picture::Picture,
    settings::Settings,
    surfaces::{Regions, Surfaces},
    validate::SurfaceSize,
    wire::{Frame, Scan, ScanEncoder, WireConfig, WireSettings},
    work,
};
use heapless::Vec;

use super::genome::{Genome, Random};
use crate::work::Shape;

/// Steps of each loop, in the order of [`work::LOOPS`].
pub(super) type Taken = [u64; work::LOOPS.len()];

/// Stages of one size of pictures.
pub(super) trait Rig {
    fn shape(&self) -> Shape;
    /// What the loops of `stage` take with the pictures of `genome`.
    fn run(&mut self, stage: &str, genome: &Genome) -> Taken;
}

macro_rules! rig {
    ($name:ident, $width:literal, $height:literal, $disparities:literal) => {
        pub(super) struct $name {
            detector: Box<
                Detector<
                    { $width * $height },
                    $width,
                    $disparities,
                    { Capacities::for_pictures($width, $height, $disparities).grid },
                    { Capacities::for_pictures($width, $height, $disparities).surfaces },
                    64,
                    2500,
                >,
            >,
            validate: Box<SurfaceSize<$width>>,
            surfaces: Box<
                Surfaces<{ $width * $height }, { Capacities::for_pictures($width, $height, $disparities).surfaces }>,
            >,
            regions: Box<Regions<{ Capacities::for_pictures($width, $height, $disparities).surfaces }>>,
            ground: Box<GroundFinder>,
            builder: Box<MapBuilder<2500>>,
        }

        impl $name {
            pub(super) fn new() -> Self {
                Self {
                    detector: Box::new(Detector::new()),
                    validate: Box::new(SurfaceSize::new()),
                    surfaces: Box::new(Surfaces::new()),
                    regions: Box::new(Regions::new()),
                    ground: Box::new(GroundFinder::new()),
                    builder: Box::new(MapBuilder::new()),
                }
            }
        }

        impl Rig for $name {
            fn shape(&self) -> Shape {
                Shape::of($width, $height, $disparities)
            }

            fn run(&mut self, stage: &str, genome: &Genome) -> Taken {
                let settings = self.shape().settings;
                match stage {
                    "rectify" | "match" | "health" => {
                        let calibration = calibration($width, $height, stage, &genome.numbers);
                        let mount = Mount { height_m: Some(1.0), ..Mount::default() };
                        self.detector.configure(&settings, &calibration, &mount).expect("it can be configured");
                        let pair = genome.pair_of(stage, ($width, $height));
                        let [left, right] = pair
                            .each_ref()
                            .map(|pixels| Picture::packed(pixels, $width, $height).expect("it has all pixels"));
                        work::reset();
                        self.detector.detect(&left, &right, &mut ()).expect("it is configured");
                        work::taken()
                    }
                    "wire" => encode(genome),
                    _ => self.interpret(stage, genome, &settings),
                }
            }
        }

        impl $name {
            fn interpret(&mut self, stage: &str, genome: &Genome, settings: &Settings) -> Taken {
                const { assert!($disparities > 8) };
                let numbers = genome.disparities(($width, $height), 16 * ($disparities - 1));
                let mut pixels: std::vec::Vec<DisparityPixel> = numbers
                    .iter()
                    .map(|&steps| match steps {
                        0 => DisparityPixel::none(Reason::LowTexture),
                        steps => DisparityPixel::from_steps(steps),
                    })
                    .collect();
                if stage == "validate" {
                    self.validate.configure(&settings.validate, $width).expect("the defaults can be used");
                    work::reset();
                    self.validate.run(&mut pixels);
                    return work::taken();
                }
                let how = genome.numbers[11] as usize;
                let mut pair = pair($width, $height);
                let on_mast = how / 288 % 2 == 1;
                let wide = if on_mast { 0.65 } else { 0.3 };
                if let Some((focal, share)) = [None, Some((4.0, 0.65)), Some((8.0, wide))][how / 48 % 3] {
                    // Through a long lens, what lies at the end of the terrain has disparities that are fine enough for a slope.
                    pair.focal_px = focal * $width as f32;
                    pair.baseline_m = share * $disparities as f32 * 29.6 / pair.focal_px;
                }
                let pitch_down_deg = [0.0, 10.0, 30.0, 55.0, -20.0, -55.0][how % 6];
                // A camera that looks ahead or back, of a robot or on a mast.
                let yaw_left_deg = [0.0, -135.0][how / 144 % 2];
                let step_m = if on_mast { 1.5 } else { 0.3 };
                let height_m = Some(step_m * (how / 6 % 8) as f32).filter(|height_m| *height_m > 0.0);
                let mount = Mount { height_m, pitch_down_deg, ..Mount::default() };
                let frame = VehicleFrame::new(&mount).expect("it can be used");
                let (rays, place) = (Rays::new(&pair, &frame), Place::new(&Mount { yaw_left_deg, ..mount }));
                let mut depth = DepthTable::<$disparities>::new();
                depth.configure(&pair, 0, $disparities);
                let picture = DisparityPicture::new(&pixels, $width);
                self.surfaces.configure(&settings.surfaces, $width, $height).expect("the defaults can be used");
                work::reset();
                self.surfaces.run(picture, &depth, &rays);
                if stage == "surfaces" {
                    return work::taken();
                }
                let known = mount.height_m.is_some();
                self.ground
                    .configure(&settings.ground, &frame, known, $width * $height)
                    .expect("the defaults can be used");
                // There is ground to begin from: that of the frame before, which showed nothing else.
                let level = level(&rays, &pair);
                for picture in [DisparityPicture::new(&level, $width), picture] {
                    self.surfaces.run(picture, &depth, &rays);
                    work::reset();
                    self.ground.run(&mut self.surfaces, &mut self.regions, picture, (&depth, &rays));
                }
                if stage == "ground" {
                    return work::taken();
                }
                let mut obstacles = ObstacleFinder::new();
                obstacles.configure(&settings.obstacles, pair.focal_px).expect("the defaults can be used");
                let mut found: Vec<Obstacle, 64, u16> = Vec::new();
                work::reset();
                let terrain = self.ground.terrain();
                obstacles.run(&mut self.surfaces, &mut self.regions, picture, terrain, &place, &mut found);
                if stage == "obstacles" {
                    return work::taken();
                }
                let heights = (settings.obstacles.min_height_m, settings.obstacles.clearance_m);
                self.builder.configure(&settings.map, heights).expect("the defaults can be used");
                let view =
                    View { pair: &pair, frame: &frame, place: &place, rays: &rays, depth: &depth, nearest_m: 0.5 };
                let mut map = ObstacleMap::<2500>::EMPTY;
                work::reset();
                self.builder.run(&self.surfaces, picture, &view, terrain, true, &mut map);
                work::taken()
            }
        }
    };
}

rig!(Small, 128, 96, 16);
rig!(Robot, 320, 240, 48);

fn pair(width: usize, height: usize) -> RectifiedPair {
    RectifiedPair {
        width: width as u32,
        height: height as u32,
        focal_px: 0.8 * width as f32,
        cx: 0.5 * width as f32,
        cy: 0.5 * height as f32,
        baseline_m: 0.12,
        disparity_offset_px: 0.0,
    }
}

/// What level ground looks like.
fn level(rays: &Rays, pair: &RectifiedPair) -> std::vec::Vec<DisparityPixel> {
    let (width, height) = (pair.width as usize, pair.height as usize);
    let pixel = |x: usize, y: usize| {
        let height_m = |z_m: f32| rays.point_m(x as f32, y as f32, z_m)[2];
        let (here, ahead) = (height_m(0.0), height_m(1.0));
        let steps = 16.0 * pair.disparity_px(here / (here - ahead));
        // Where the ray does not go down there is no ground.
        if ahead < here { DisparityPixel::from_steps(steps as u16) } else { DisparityPixel::none(Reason::NotUnique) }
    };
    (0..width * height).map(|i| pixel(i % width, i / width)).collect()
}

/// Cameras as the numbers say. For rectifying they may be turned, so far that rows of the pair run across those of the picture, or see
/// nothing but their last pixel; for matching the right one may look past its picture, so that its rows end early. For the health both may
/// be turned by a right angle, and see all of the pair.
fn calibration(width: usize, height: usize, stage: &str, numbers: &[u32; 12]) -> StereoCalibration {
    let mut pair = pair(width, height);
    let (number, how) = (numbers[9], numbers[11]);
    let mut camera = CameraModel {
        width: width as u32,
        height: height as u32,
        fx: pair.focal_px,
        fy: pair.focal_px,
        cx: pair.cx,
        cy: pair.cy,
        distortion: Distortion::default(),
    };
    let mut right = camera;
    let (mut sin, mut cos) = (0.0, 1.0);
    match stage {
        "rectify" if how % 2 == 1 => {
            // Next to no angle at all.
            pair.focal_px = 1.0e5;
            (camera.fx, camera.fy) = (1.0, 1.0);
            (camera.cx, camera.cy) = (width as f32 - 1.0, height as f32 - 1.0);
            right = camera;
        }
        "rectify" => {
            (sin, cos) = ((number % 180) as f32).to_radians().sin_cos();
            camera.fx *= (1 + number / 180 % 4) as f32;
            camera.fy = camera.fx;
            right = camera;
        }
        _ if Genome::is_turned(stage, numbers) => {
            (sin, cos) = (1.0, 0.0);
            camera.fx *= 0.7;
            camera.fy = camera.fx;
            right = camera;
        }
        "match" | "health" if how % 4 == 3 => right.cx += (number % 64) as f32,
        _ => return StereoCalibration::Rectified(pair),
    }
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

/// The work of sending a map whose cells are as `genome` says.
fn encode(genome: &Genome) -> Taken {
    let n = &genome.numbers;
    // The order of the cells is that of their place; where the vehicle stands among them decides which of them are near.
    let geometry = MapGeometry {
        cell_size_mm: 500,
        x_first: -((n[0] % 64) as i16),
        x_count: 50,
        y_first: -((n[1] % 64) as i16),
        y_count: 50,
    };
    let cell = |state| Cell { state, ..Cell::default() };
    let kinds = [CellState::Unknown(UnknownReason::NoMatch), CellState::Free, CellState::Obstacle].map(cell);
    let cells: std::vec::Vec<Cell> = states(genome).into_iter().map(|state| kinds[usize::from(state)]).collect();
    let config = WireConfig::new(WireSettings::default()).expect("the defaults can be used");
    let mut encoder = ScanEncoder::<512>::new(config).expect("there is room");
    let mut frames: Vec<Frame, 256> = Vec::new();
    let scan = Scan {
        scan_index: 0,
        age_ns: 0,
        health: Default::default(),
        geometry: &geometry,
        cells: &cells,
        sectors: &SectorDistances::default(),
        ground: None,
    };
    work::reset();
    encoder.encode(&scan, frames.as_mut_view()).expect("there is room");
    work::taken()
}

/// What is known of the cells: nothing, free, obstacle.
pub(super) fn states(genome: &Genome) -> std::vec::Vec<u8> {
    let n = &genome.numbers;
    let mut random = Random::seeded(n[2]);
    let (period, free_rows) = (1 + (n[3] % 4) as usize, (n[4] % 51) as usize);
    let mut states: std::vec::Vec<u8> = (0..2500)
        .map(|index| {
            let (row, column) = (index / 50, index % 50);
            match n[5] % 3 {
                0 if (row + column) % (period + 1) == 0 => 1 + u8::from(row >= free_rows),
                0 => 0,
                1 => 1 + ((column + row) % 2) as u8,
                _ => random.below(3) as u8,
            }
        })
        .collect();
    for &seed in &genome.patches {
        let mut random = Random::seeded(seed);
        let (first, count) = (random.below(2500) as usize, 1 + random.below(60) as usize);
        let kind = random.below(4);
        for (index, state) in states.iter_mut().enumerate().skip(first).take(count) {
            *state = if kind < 3 { kind as u8 } else { 1 + (index % 2) as u8 };
        }
    }
    states
}
