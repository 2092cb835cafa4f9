//! Rectification against the full model in f64, on made-up calibrations and on recordings.

mod behaviour;
mod model;
mod recordings;
mod rows;

use crate::{
    geometry::{CameraModel, Distortion, RawPair},
    test_random::Random,
};

impl Random {
    fn within_f32(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * (self.next() >> 40) as f32 / (1_u32 << 24) as f32
    }
}

/// Rotations about x, y and z, one after the other, radians.
fn turned(angles: [f64; 3]) -> [[f32; 3]; 3] {
    let r = nalgebra::Rotation3::from_euler_angles(angles[0], angles[1], angles[2]);
    core::array::from_fn(|i| core::array::from_fn(|j| r[(i, j)] as f32))
}

/// A camera of 512 x 384 with a field of view of 75 degrees.
fn camera(distortion: [f32; 8]) -> CameraModel {
    CameraModel {
        width: 512,
        height: 384,
        fx: 331.5,
        fy: 333.25,
        cx: 259.5,
        cy: 186.25,
        distortion: Distortion(distortion),
    }
}

/// Made-up pairs: each count of coefficients, misaligned by up to two degrees.
fn made_up() -> [(&'static str, RawPair); 5] {
    let pair = |left: [f32; 8], right: [f32; 8], angles, translation_m| RawPair {
        left: camera(left),
        right: CameraModel { fx: 334.0, fy: 335.5, cx: 251.25, cy: 195.5, ..camera(right) },
        rotation: turned(angles),
        translation_m,
        rectification: None,
    };
    let none = [0.0; 8];
    let four = [-0.312, 0.109, 0.0007, -0.0004, 0.0, 0.0, 0.0, 0.0];
    let five = [-0.348, 0.151, -0.0006, 0.0009, -0.0342, 0.0, 0.0, 0.0];
    let eight = [0.412, -0.02, 0.0004, -0.0011, 0.0061, 0.731, 0.058, -0.0032];
    let pincushion = [0.11, 0.02, 0.0005, 0.0008, 0.0, 0.0, 0.0, 0.0];
    [
        ("no lens", pair(none, none, [0.01, -0.02, 0.015], [-0.12, 0.002, -0.003])),
        ("4 coefficients", pair(four, four, [0.012, 0.021, -0.011], [-0.1, -0.003, 0.002])),
        ("5 coefficients", pair(five, four, [-0.017, 0.014, 0.024], [-0.2, 0.004, 0.006])),
        ("8 coefficients", pair(eight, eight, [0.008, -0.03, 0.019], [-0.065, 0.001, 0.002])),
        ("pincushion", pair(pincushion, pincushion, [0.02, 0.02, -0.03], [-0.3, 0.01, -0.01])),
    ]
}
