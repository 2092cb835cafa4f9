//! One frame as every writer and painter sees it.

use fencepost_core::{
    detector::Detection,
    disparity::DisparityPicture,
    geometry::{RectifiedPair, VehicleFrame},
    health::Health,
    picture::Picture,
    surfaces::Surface,
};

use crate::detector::{CELLS, OBSTACLES};

/// What the detector made of a frame. `SurfaceAt` finds the surface that a pixel belongs to.
#[derive(Clone, Copy)]
pub struct FrameView<'a> {
    /// Number of the frame in its recording.
    pub number: u32,
    /// Time of exposure, nanoseconds.
    pub timestamp_ns: u64,
    /// Left rectified picture.
    pub left: Picture<'a>,
    /// Disparity of the left rectified picture.
    pub disparity: DisparityPicture<'a>,
    /// Cells, ground, obstacles.
    pub detection: &'a Detection<OBSTACLES, CELLS>,
    /// How far this can be trusted: what the detector says, and what the bus has to add.
    pub health: Health,
    /// The rectified cameras.
    pub pair: &'a RectifiedPair,
    /// How the left camera sits on the vehicle.
    pub vehicle: &'a VehicleFrame,
    /// The surface at column x and row y.
    pub surface_at: &'a dyn Fn(usize, usize) -> Option<Surface>,
}

impl FrameView<'_> {
    /// Width and height of the rectified picture, px.
    pub const fn size(&self) -> (usize, usize) {
        (self.disparity.width(), self.disparity.height())
    }
}

impl std::fmt::Debug for FrameView<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("FrameView").field("number", &self.number).field("size", &self.size()).finish_non_exhaustive()
    }
}

/// A made-up frame for the tests of writers and painters.
#[cfg(test)]
pub(crate) mod testing {
    use fencepost_core::{
        detector::Statistics,
        disparity::{DisparityPixel, Reason},
        geometry::Mount,
        ground::GroundPlane,
        health::{HealthLevel, HealthReason},
        map::{Cell, CellState, MapGeometry, ObstacleMap, SectorDistances, UnknownReason},
        methods::Detectors,
        obstacles::Obstacle,
        surfaces::SurfaceClass,
    };

    use super::*;

    const WIDTH: usize = 160;
    const HEIGHT: usize = 96;

    /// Level ground that begins below row 40, a box of 20 x 40 pixels on it, nothing above.
    pub(crate) struct MadeUp {
        left: Vec<u8>,
        pixels: Vec<DisparityPixel>,
        pub(crate) detection: Box<Detection<OBSTACLES, CELLS>>,
        pair: RectifiedPair,
        vehicle: VehicleFrame,
    }

    fn is_box(x: usize, y: usize) -> bool {
        (70..90).contains(&x) && (30..70).contains(&y)
    }

    impl MadeUp {
        pub(crate) fn new() -> Self {
            let at = |i: usize| (i % WIDTH, i / WIDTH);
            let pixel = |(x, y): (usize, usize)| match (x, y) {
                _ if is_box(x, y) => DisparityPixel::from_steps(30 * 16 + (x % 3) as u16),
                _ if y > 40 => DisparityPixel::from_steps(((y - 40) * 16) as u16),
                _ if y < 3 => DisparityPixel::none(Reason::OutsideValidArea),
                _ => DisparityPixel::none(Reason::ALL[1 + x * 6 / WIDTH]),
            };
            let left = (0..WIDTH * HEIGHT).map(at).map(|(x, y)| ((x * 7 + y * 3) % 200 + 20) as u8).collect();
            let pixels = (0..WIDTH * HEIGHT).map(at).map(pixel).collect();
            let pair = RectifiedPair {
                width: WIDTH as u32,
                height: HEIGHT as u32,
                focal_px: 130.0,
                cx: 80.0,
                cy: 48.0,
                baseline_m: 0.12,
                disparity_offset_px: 0.0,
            };
            let mount = Mount { height_m: Some(1.0), pitch_down_deg: 15.0, ..Mount::default() };
            let mut made_up = Self {
                left,
                pixels,
                detection: Box::new(detection()),
                pair,
                vehicle: VehicleFrame::new(&mount).unwrap(),
            };
            made_up.set_geometry(MapGeometry::default());
            made_up
        }

        pub(crate) fn set_geometry(&mut self, geometry: MapGeometry) {
            self.detection.map.geometry = geometry;
            self.detection.map.cells.clear();
            for index in 0..geometry.len() {
                let (i, j) = geometry.cell_at(index);
                let ahead = i > 2 && i32::from(j.abs()) < i32::from(i);
                let state = match (i, j) {
                    (9..=10, -1..=2) => CellState::Obstacle,
                    _ if i > 10 && (-3..4).contains(&j) => CellState::Unknown(UnknownReason::Hidden),
                    _ if ahead => CellState::Free,
                    _ => CellState::Unknown(UnknownReason::OutsideView),
                };
                self.detection.map.cells.push(Cell { state, pixels: 20, height_dm: 3, ..Cell::default() }).unwrap();
            }
        }

        pub(crate) fn view<R>(&self, look: impl FnOnce(&FrameView<'_>) -> R) -> R {
            let surface_at = |x: usize, y: usize| {
                let (class, normal) = match (x, y) {
                    _ if is_box(x, y) => (SurfaceClass::Obstacle, [1.0, 0.0, 0.0]),
                    _ if y > 40 => (SurfaceClass::Ground, [0.1, 0.0, 0.99]),
                    _ => return None,
                };
                Some(Surface { class, normal, ..Surface::default() })
            };
            look(&FrameView {
                number: 7,
                timestamp_ns: 1_500_000_000,
                left: Picture::packed(&self.left, WIDTH, HEIGHT).unwrap(),
                disparity: DisparityPicture::new(&self.pixels, WIDTH),
                detection: &self.detection,
                health: self.detection.health,
                pair: &self.pair,
                vehicle: &self.vehicle,
                surface_at: &surface_at,
            })
        }
    }

    fn detection() -> Detection<OBSTACLES, CELLS> {
        let mut health = Health::OK;
        health.raise(HealthReason::LowCoverage, HealthLevel::Degraded);
        health.raise(HealthReason::ExposureMismatch, HealthLevel::Degraded);
        let obstacle = Obstacle {
            mean_m: [5.0, 0.3, 0.5],
            min_m: [4.8, -0.5, 0.0],
            max_m: [5.2, 1.1, 1.2],
            orientation_rad: 1.4,
            length_m: 1.6,
            pixels: 800,
            surfaces: 4,
        };
        Detection {
            map: ObstacleMap { geometry: MapGeometry::default(), cells: Default::default() },
            sectors: SectorDistances::default(),
            ground: Some(GroundPlane {
                normal: [0.0, 0.0, 1.0],
                offset_m: 0.01,
                camera_height_m: 1.02,
                pitch_down_rad: 15.0_f32.to_radians(),
                roll_rad: 0.5_f32.to_radians(),
                support: 4000,
                rms_m: 0.02,
                age_frames: 0,
            }),
            obstacles: [obstacle].into_iter().collect(),
            health,
            statistics: Statistics::default(),
            detectors: Detectors::default(),
        }
    }
}
