//! Where a pair of cameras stands on the vehicle, seen from above.

use super::Mount;

/// From the frame of the pair to the vehicle frame, on the ground: moved and turned about z.
///
/// The frame of the pair has its origin on the ground below the left camera, and its x axis along the heading of that camera.
/// All that is seen is worked out there, where ranges and angles are those from the camera; what leaves the detector is moved
/// and turned here. A pair at the origin that looks straight ahead leaves every number as it is, to the bit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    origin_m: [f32; 2],
    sin: f32,
    cos: f32,
}

impl Place {
    /// A pair at the origin of the vehicle frame that looks straight ahead.
    pub const ORIGIN: Self = Self { origin_m: [0.0; 2], sin: 0.0, cos: 1.0 };

    /// The place that `mount` describes.
    pub fn new(mount: &Mount) -> Self {
        let (sin, cos) = libm::sincosf(mount.yaw_left_deg.to_radians());
        Self { origin_m: [mount.forward_m, mount.left_m], sin, cos }
    }

    /// The point on the ground below the left camera, vehicle frame, metres.
    pub const fn origin_m(&self) -> [f32; 2] {
        self.origin_m
    }

    /// Heading of the pair against that of the vehicle, radians, positive to the left.
    pub fn yaw_left_rad(&self) -> f32 {
        libm::atan2f(self.sin, self.cos)
    }

    /// A direction of the pair's frame, in the vehicle frame.
    pub fn turn(&self, [x, y]: [f32; 2]) -> [f32; 2] {
        [x * self.cos - y * self.sin, x * self.sin + y * self.cos]
    }

    /// A direction of the vehicle frame, in the pair's frame.
    pub fn turn_back(&self, [x, y]: [f32; 2]) -> [f32; 2] {
        [x * self.cos + y * self.sin, y * self.cos - x * self.sin]
    }

    /// A point of the pair's frame, in the vehicle frame, metres.
    pub fn to_vehicle(&self, point_m: [f32; 2]) -> [f32; 2] {
        let [x, y] = self.turn(point_m);
        [x + self.origin_m[0], y + self.origin_m[1]]
    }

    /// A point of the vehicle frame, in the pair's frame, metres.
    pub fn to_pair(&self, [x, y]: [f32; 2]) -> [f32; 2] {
        self.turn_back([x - self.origin_m[0], y - self.origin_m[1]])
    }
}
