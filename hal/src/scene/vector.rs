//! Three numbers that make a point or a direction.

use core::ops::{Add, AddAssign, Mul, Neg, Sub};

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct V3 {
    pub(crate) x: f32,
    pub(crate) y: f32,
    pub(crate) z: f32,
}

pub(crate) const fn v3(x: f32, y: f32, z: f32) -> V3 {
    V3 { x, y, z }
}

impl V3 {
    pub(crate) const UP: Self = v3(0.0, 0.0, 1.0);

    pub(crate) fn dot(self, o: Self) -> f32 {
        self.x * o.x + self.y * o.y + self.z * o.z
    }

    pub(crate) fn cross(self, o: Self) -> Self {
        v3(self.y * o.z - self.z * o.y, self.z * o.x - self.x * o.z, self.x * o.y - self.y * o.x)
    }

    /// The square root is one of the operations that IEEE 754 rounds correctly: the same bits on every machine.
    pub(crate) fn length(self) -> f32 {
        self.dot(self).sqrt()
    }

    pub(crate) fn unit(self) -> Self {
        self * (1.0 / self.length().max(1.0e-12))
    }

    pub(crate) fn scaled(self, o: Self) -> Self {
        v3(self.x * o.x, self.y * o.y, self.z * o.z)
    }

    pub(crate) fn min(self, o: Self) -> Self {
        v3(least(self.x, o.x), least(self.y, o.y), least(self.z, o.z))
    }

    pub(crate) fn max(self, o: Self) -> Self {
        v3(most(self.x, o.x), most(self.y, o.y), most(self.z, o.z))
    }

    pub(crate) fn axis(self, i: usize) -> f32 {
        match i {
            0 => self.x,
            1 => self.y,
            _ => self.z,
        }
    }

    /// Two unit vectors across this unit vector.
    pub(crate) fn across(self) -> (Self, Self) {
        let helper = if self.z.abs() < 0.9 { Self::UP } else { v3(1.0, 0.0, 0.0) };
        let a = self.cross(helper).unit();
        (a, self.cross(a))
    }
}

impl From<[f32; 3]> for V3 {
    fn from(a: [f32; 3]) -> Self {
        v3(a[0], a[1], a[2])
    }
}

impl Add for V3 {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        v3(self.x + o.x, self.y + o.y, self.z + o.z)
    }
}

impl AddAssign for V3 {
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl Sub for V3 {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        v3(self.x - o.x, self.y - o.y, self.z - o.z)
    }
}

impl Mul<f32> for V3 {
    type Output = Self;
    fn mul(self, s: f32) -> Self {
        v3(self.x * s, self.y * s, self.z * s)
    }
}

impl Neg for V3 {
    type Output = Self;
    fn neg(self) -> Self {
        v3(-self.x, -self.y, -self.z)
    }
}

/// One instruction, unlike `f32::min`, which has to look for NaN.
pub(crate) fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

pub(crate) fn most(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// 0 below `a`, 1 above `b`, smooth between.
pub(crate) fn smoothstep(a: f32, b: f32, x: f32) -> f32 {
    let t = ((x - a) / (b - a)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

pub(crate) fn mix(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}
