//! A world of flat patches for the tests of this crate: what a perfect stereo camera would see, worked out in f64 with
//! matrices of its own.

use std::{boxed::Box, vec, vec::Vec};

use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::{
    disparity::DisparityPicture,
    disparity::{DisparityPixel, Reason},
    geometry::{DepthTable, Mount, Place, Rays, RectifiedPair, VehicleFrame},
    ground::{GroundFinder, GroundPlane, GroundSettings},
    obstacles::{Obstacle, ObstacleFinder, ObstacleSettings},
    surfaces::{Regions, SurfaceSettings, Surfaces},
};

pub(crate) type Point = Vector3<f64>;

/// A parallelogram: `middle + a * half_a + b * half_b` with `a` and `b` within -1..=1, in the vehicle frame, metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Patch {
    pub(crate) middle: Point,
    pub(crate) half_a: Point,
    pub(crate) half_b: Point,
    /// Why the matcher finds nothing there, if so.
    pub(crate) hole: Option<Reason>,
}

/// Patches before a camera, in the frame of the pair.
#[derive(Clone, Debug)]
pub(crate) struct World {
    pub(crate) pair: RectifiedPair,
    pub(crate) height_m: f64,
    pub(crate) pitch_down_deg: f64,
    pub(crate) roll_deg: f64,
    /// Where the pair stands on the vehicle: metres ahead and to the left of its origin, and degrees to the left.
    pub(crate) place: (f64, f64, f64),
    pub(crate) patches: Vec<Patch>,
}

/// 320 x 240, 70 degrees wide, 0.2 m apart.
pub(crate) const PAIR: RectifiedPair = RectifiedPair {
    width: 320,
    height: 240,
    focal_px: 228.0,
    cx: 159.5,
    cy: 119.5,
    baseline_m: 0.2,
    disparity_offset_px: 0.0,
};

/// Disparities that [`World::render`] finds, from 0 on, px.
pub(crate) const DISPARITIES: usize = 96;

impl Patch {
    /// A parallelogram.
    pub(crate) fn new(middle: [f64; 3], half_a: [f64; 3], half_b: [f64; 3]) -> Self {
        Self { middle: middle.into(), half_a: half_a.into(), half_b: half_b.into(), hole: None }
    }

    /// A rectangle around `middle` with sides in the plane across `normal`.
    pub(crate) fn across(normal: Point, middle: Point, half_m: f64) -> Self {
        let normal = normal.normalize();
        let aside = if normal.x.abs() < 0.9 { Point::x() } else { Point::y() };
        let a = normal.cross(&aside).normalize();
        Self { middle, half_a: a * half_m, half_b: normal.cross(&a) * half_m, hole: None }
    }

    /// Unit normal, upward.
    pub(crate) fn normal(&self) -> Point {
        let normal = self.half_a.cross(&self.half_b).normalize();
        if normal.z < 0.0 { -normal } else { normal }
    }
}

impl World {
    /// Level ground and nothing on it.
    pub(crate) fn level(height_m: f64, pitch_down_deg: f64, roll_deg: f64) -> Self {
        Self { patches: vec![ground(0.0)], ..Self::empty(height_m, pitch_down_deg, roll_deg) }
    }

    /// No patch at all.
    pub(crate) fn empty(height_m: f64, pitch_down_deg: f64, roll_deg: f64) -> Self {
        Self { pair: PAIR, height_m, pitch_down_deg, roll_deg, place: (0.0, 0.0, 0.0), patches: Vec::new() }
    }

    /// Adds a box that stands with its base at height `min[2]`, turned by `yaw_deg` about its middle.
    pub(crate) fn add_box(&mut self, min: [f64; 3], max: [f64; 3], yaw_deg: f64) {
        let (min, max) = (Point::from(min), Point::from(max));
        let (middle, half) = ((min + max) / 2.0, (max - min) / 2.0);
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw_deg.to_radians());
        let axes = [0, 1, 2].map(|i| {
            let mut axis = Point::zeros();
            axis[i] = half[i];
            turn * axis
        });
        for i in 0..3 {
            for sign in [-1.0, 1.0] {
                self.patches.push(Patch {
                    middle: middle + axes[i] * sign,
                    half_a: axes[(i + 1) % 3],
                    half_b: axes[(i + 2) % 3],
                    hole: None,
                });
            }
        }
    }

    /// Turns the camera's directions into the vehicle's: pitch about the vehicle's y, roll about its x, then the axes are
    /// exchanged.
    pub(crate) fn rotation(&self) -> Matrix3<f64> {
        let axes = Matrix3::new(0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0);
        let turn = Rotation3::from_euler_angles(self.roll_deg.to_radians(), self.pitch_down_deg.to_radians(), 0.0);
        turn.matrix() * axes
    }

    /// Direction of pixel `(u, v)` in the vehicle frame, of length 1 along the optical axis.
    pub(crate) fn direction(&self, u: f64, v: f64) -> Point {
        let f = f64::from(self.pair.focal_px);
        self.rotation() * Point::new((u - f64::from(self.pair.cx)) / f, (v - f64::from(self.pair.cy)) / f, 1.0)
    }

    /// The nearest patch that pixel `(u, v)` shows and its distance along the optical axis.
    pub(crate) fn hit(&self, u: f64, v: f64) -> Option<(f64, &Patch)> {
        let (eye, direction) = (Point::new(0.0, 0.0, self.height_m), self.direction(u, v));
        let hits = self.patches.iter().filter_map(|patch| {
            let [a, b, z]: [f64; 3] = Matrix3::from_columns(&[patch.half_a, patch.half_b, -direction])
                .try_inverse()
                .map(|inverse| inverse * (eye - patch.middle))?
                .into();
            (z > 0.0 && a.abs() <= 1.0 && b.abs() <= 1.0).then_some((z, patch))
        });
        hits.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// The disparity picture, rounded to 1/16 px.
    pub(crate) fn render(&self) -> Vec<DisparityPixel> {
        let (width, height) = (self.pair.width, self.pair.height);
        let scale = f64::from(self.pair.focal_px) * f64::from(self.pair.baseline_m);
        let pixels = (0..height).flat_map(|v| (0..width).map(move |u| (u, v)));
        pixels
            .map(|(u, v)| {
                let Some((z, patch)) = self.hit(f64::from(u), f64::from(v)) else {
                    return DisparityPixel::none(Reason::LowTexture);
                };
                let steps = 16.0 * (scale / z - f64::from(self.pair.disparity_offset_px));
                let largest = (DISPARITIES as f64 - 2.0) * 16.0;
                match patch.hole {
                    Some(reason) => DisparityPixel::none(reason),
                    None if steps > largest => DisparityPixel::none(Reason::OutOfRange),
                    None => DisparityPixel::from_steps(steps.round() as u16),
                }
            })
            .collect()
    }

    /// The mount as it is.
    pub(crate) fn mount(&self) -> Mount {
        Mount {
            height_m: Some(self.height_m as f32),
            pitch_down_deg: self.pitch_down_deg as f32,
            roll_deg: self.roll_deg as f32,
            forward_m: self.place.0 as f32,
            left_m: self.place.1 as f32,
            yaw_left_deg: self.place.2 as f32,
        }
    }

    /// A point of the pair's frame in that of the vehicle.
    pub(crate) fn to_vehicle(&self, p: Point) -> Point {
        let (forward_m, left_m, yaw_deg) = self.place;
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw_deg.to_radians());
        turn * p + Point::new(forward_m, left_m, 0.0)
    }

    /// A point of the vehicle frame in that of the pair.
    pub(crate) fn to_pair(&self, p: Point) -> Point {
        let (forward_m, left_m, yaw_deg) = self.place;
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), -yaw_deg.to_radians());
        turn * (p - Point::new(forward_m, left_m, 0.0))
    }

    pub(crate) fn frame(&self) -> VehicleFrame {
        VehicleFrame::new(&self.mount().without_place()).unwrap()
    }

    pub(crate) fn rays(&self) -> Rays {
        Rays::new(&self.pair, &self.frame())
    }

    pub(crate) fn depth(&self) -> DepthTable<DISPARITIES> {
        let mut depth = DepthTable::new();
        depth.configure(&self.pair, 0, DISPARITIES as u16);
        depth
    }
}

/// Level ground at a height.
pub(crate) fn ground(height_m: f64) -> Patch {
    Patch::new([0.0, 0.0, height_m], [1000.0, 0.0, 0.0], [0.0, 1000.0, 0.0])
}

/// A tile with as many surfaces as it can hold, row by row: 64 blocks of 4 x 4 pixels, all unlike their neighbours.
pub(crate) fn tile_of_blocks() -> Vec<DisparityPixel> {
    let steps = |i: usize| if (i % 32 / 4 + i / 32 / 4).is_multiple_of(2) { 100 } else { 500 };
    (0..32 * 32).map(|i| DisparityPixel::from_steps(steps(i))).collect()
}

/// The stages from the surfaces to the obstacles, for pictures of [`PAIR`].
pub(crate) struct Stages {
    pub(crate) surfaces: Box<Surfaces<{ 320 * 240 }, 1024>>,
    pub(crate) regions: Box<Regions<1024>>,
    pub(crate) ground: GroundFinder,
    pub(crate) obstacles: ObstacleFinder,
    pub(crate) depth: DepthTable<DISPARITIES>,
    pub(crate) rays: Rays,
    pub(crate) frame: VehicleFrame,
    pub(crate) place: Place,
}

impl Stages {
    /// Stages that take `mount` for that of the camera.
    pub(crate) fn new(mount: &Mount, ground: &GroundSettings, obstacles: &ObstacleSettings) -> Self {
        let frame = VehicleFrame::new(&mount.without_place()).unwrap();
        let mut stages = Self {
            surfaces: Box::new(Surfaces::new()),
            regions: Box::new(Regions::new()),
            ground: GroundFinder::new(),
            obstacles: ObstacleFinder::new(),
            depth: DepthTable::new(),
            rays: Rays::new(&PAIR, &frame),
            frame,
            place: Place::new(mount),
        };
        stages.depth.configure(&PAIR, 0, DISPARITIES as u16);
        stages.surfaces.configure(&SurfaceSettings::default(), 320, 240).unwrap();
        stages.ground.configure(ground, &frame, mount.height_m.is_some(), 320 * 240).unwrap();
        stages.obstacles.configure(obstacles, PAIR.focal_px).unwrap();
        stages
    }

    /// Surfaces and ground.
    pub(crate) fn ground(&mut self, pixels: &[DisparityPixel]) -> Option<GroundPlane> {
        let picture = DisparityPicture::new(pixels, 320);
        self.surfaces.run(picture, &self.depth, &self.rays);
        self.ground.run(&mut self.surfaces, &mut self.regions, picture, (&self.depth, &self.rays))
    }

    /// All of them: the ground, the obstacles and how many were dropped.
    pub(crate) fn run<const OBSTACLES: usize>(
        &mut self,
        pixels: &[DisparityPixel],
    ) -> (Option<GroundPlane>, Vec<Obstacle>, u32) {
        let ground = self.ground(pixels);
        let mut obstacles = heapless::Vec::<_, OBSTACLES, u16>::new();
        let picture = DisparityPicture::new(pixels, 320);
        let Self { surfaces, regions, place, ground: finder, .. } = self;
        let dropped = self.obstacles.run(surfaces, regions, picture, finder.terrain(), place, &mut obstacles);
        (ground, obstacles.to_vec(), dropped)
    }
}
