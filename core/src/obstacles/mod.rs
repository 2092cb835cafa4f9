//! Obstacles: near-vertical surfaces that belong together and pass the thresholds.

/// One obstacle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Obstacle {
    /// Middle of its points in the vehicle frame, metres.
    pub mean_m: [f32; 3],
    /// Smallest x, y and height above the ground, metres.
    pub min_m: [f32; 3],
    /// Largest x, y and height above the ground, metres.
    pub max_m: [f32; 3],
    /// Direction of its largest extent on the ground, radians from +x towards +y, in -pi/2 ..= pi/2.
    pub orientation_rad: f32,
    /// Length along that direction, metres.
    pub length_m: f32,
    /// Number of pixels.
    pub pixels: u32,
    /// Number of surfaces.
    pub surfaces: u16,
}

impl Obstacle {
    /// Distance on the ground from the vehicle's origin to its nearest corner, metres.
    pub fn distance_m(&self) -> f32 {
        let nearest = |min: f32, max: f32| if min > 0.0 { min } else { (-max).max(0.0) };
        let x = nearest(self.min_m[0], self.max_m[0]);
        let y = nearest(self.min_m[1], self.max_m[1]);
        libm::sqrtf(x * x + y * y)
    }
}

/// Settings of the obstacles.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct ObstacleSettings {
    /// An obstacle reaches at least this height above the ground, metres. The paper, section 4.1: 0.25.
    pub min_height_m: f32,
    /// What begins above this height can be driven under, metres.
    pub clearance_m: f32,
    /// An obstacle has at least this many pixels.
    pub min_pixels: u16,
    /// An obstacle is at least this long, wide or high, metres.
    pub min_size_m: f32,
}

impl Default for ObstacleSettings {
    fn default() -> Self {
        Self { min_height_m: 0.25, clearance_m: 2.2, min_pixels: 40, min_size_m: 0.15 }
    }
}
