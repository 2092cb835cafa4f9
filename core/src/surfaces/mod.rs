//! Surfaces: contiguous pieces of the disparity picture inside 32 x 32 tiles.

/// What a surface is taken for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum SurfaceClass {
    /// Too few points, or no plane fits them.
    #[default]
    Undefined,
    /// Near-horizontal, and on the ground.
    Ground,
    /// Near-horizontal, but not part of the ground.
    Horizontal,
    /// Between horizontal and vertical.
    Slanted,
    /// Near-vertical, but below the thresholds of an obstacle.
    Vertical,
    /// Part of an obstacle.
    Obstacle,
}

/// One surface and the plane through it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surface {
    /// Number of pixels.
    pub pixels: u16,
    /// What it is taken for.
    pub class: SurfaceClass,
    /// Mean of its points in the vehicle frame, metres.
    pub mean_m: [f32; 3],
    /// Covariance of its points in the vehicle frame, m^2: xx, xy, xz, yy, yz, zz.
    pub covariance: [f32; 6],
    /// Unit normal in the vehicle frame, upward; zero where no plane fits.
    pub normal: [f32; 3],
}

impl Surface {
    /// Absolute dot product of the normal with the vehicle's +Z: 1 on level ground, 0 on a wall. The paper, section 4.4.
    pub fn dot(&self) -> f32 {
        self.normal[2].abs()
    }

    /// `sqrt(1 - dot^2)`: 0 on level ground, 1 on a wall. The paper, section 4.4.
    pub fn cross(&self) -> f32 {
        let dot = self.dot();
        libm::sqrtf((1.0 - dot * dot).max(0.0))
    }
}

/// Edge of a tile, px. The paper, section 4.4.
pub const TILE: usize = 32;

/// Settings of the surfaces and their classes.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct SurfaceSettings {
    /// Neighbours belong to the same surface if their disparities differ by no more, 1/16 px.
    pub step_sixteenths: u16,
    /// Surfaces of fewer pixels are left out: no plane through them means anything.
    pub min_pixels: u16,
    /// Surfaces within this angle of horizontal may be ground, degrees. The paper, section 4.4: 30.
    pub horizontal_deg: f32,
    /// Surfaces steeper than this are vertical, degrees; what lies between is for its height to decide.
    pub vertical_deg: f32,
}

impl Default for SurfaceSettings {
    fn default() -> Self {
        Self { step_sixteenths: 16, min_pixels: 24, horizontal_deg: 30.0, vertical_deg: 45.0 }
    }
}
