//! Chance that repeats: hashes of whole numbers, and smooth noise in the plane and in space with its slope.

use super::vector::{V3, v3};

/// Mixes the bits of `h` (the finaliser of MurmurHash3).
pub(crate) const fn hash(mut h: u32) -> u32 {
    h ^= h >> 16;
    h = h.wrapping_mul(0x85eb_ca6b);
    h ^= h >> 13;
    h = h.wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}

/// Lighter than [`hash`], as textures ask for it a hundred times a pixel.
pub(crate) const fn hash2(x: i32, y: i32, seed: u32) -> u32 {
    let mut h = (x as u32).wrapping_mul(0x8da6_b343) ^ (y as u32).wrapping_mul(0xd816_3841) ^ seed;
    h ^= h >> 15;
    h = h.wrapping_mul(0x2c1b_3c6d);
    h ^= h >> 12;
    h = h.wrapping_mul(0x297a_2d39);
    h ^ (h >> 15)
}

pub(crate) const fn hash3(x: i32, y: i32, z: i32, seed: u32) -> u32 {
    hash2(x, y, seed ^ (z as u32).wrapping_mul(0xcb1a_b31f))
}

/// `0.0..1.0` from the bits of a hash.
pub(crate) const fn unit(h: u32) -> f32 {
    (h >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// `-1.0..1.0` from the bits of a hash.
pub(crate) const fn signed(h: u32) -> f32 {
    (h >> 8) as f32 * (2.0 / 16_777_216.0) - 1.0
}

/// The whole number below `x`, without the call that `f32::floor` is where the processor has no instruction for it.
pub(crate) const fn floor(x: f32) -> i32 {
    let i = x as i32;
    if (i as f32) > x { i - 1 } else { i }
}

/// A sequence of random numbers.
#[derive(Clone, Debug)]
pub(crate) struct Rng {
    seed: u32,
    count: u32,
}

impl Rng {
    pub(crate) const fn new(seed: u32) -> Self {
        Self { seed: hash(seed ^ 0x9e37_79b9), count: 0 }
    }

    pub(crate) fn bits(&mut self) -> u32 {
        self.count = self.count.wrapping_add(0x9e37_79b9);
        hash(self.count ^ self.seed)
    }

    pub(crate) fn range(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * unit(self.bits())
    }

    /// A unit vector, every direction as likely as any other.
    pub(crate) fn direction(&mut self) -> V3 {
        loop {
            let p = v3(signed(self.bits()), signed(self.bits()), signed(self.bits()));
            let l = p.dot(p);
            if l > 0.01 && l <= 1.0 {
                return p.unit();
            }
        }
    }
}

/// Noise in the plane: its value in `-1..1` and its slope.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Slope2 {
    pub(crate) value: f32,
    pub(crate) dx: f32,
    pub(crate) dy: f32,
}

fn fade(t: f32) -> (f32, f32) {
    (t * t * t * (t * (t * 6.0 - 15.0) + 10.0), 30.0 * t * t * (t * (t - 2.0) + 1.0))
}

/// Value noise with a lattice of edge 1.
pub(crate) fn noise2(x: f32, y: f32, seed: u32) -> Slope2 {
    let (ix, iy) = (floor(x), floor(y));
    let ((u, du), (v, dv)) = (fade(x - ix as f32), fade(y - iy as f32));
    let (jx, jy) = (ix.wrapping_add(1), iy.wrapping_add(1));
    let a = signed(hash2(ix, iy, seed));
    let b = signed(hash2(jx, iy, seed));
    let c = signed(hash2(ix, jy, seed));
    let d = signed(hash2(jx, jy, seed));
    let (k1, k2, k3) = (b - a, c - a, a - b - c + d);
    Slope2 { value: a + k1 * u + k2 * v + k3 * u * v, dx: du * (k1 + k3 * v), dy: dv * (k2 + k3 * u) }
}

/// Value noise in space with a lattice of edge 1, and its gradient.
pub(crate) fn noise3(p: V3, seed: u32) -> (f32, V3) {
    let (ix, iy, iz) = (floor(p.x), floor(p.y), floor(p.z));
    let ((u, du), (v, dv), (w, dw)) = (fade(p.x - ix as f32), fade(p.y - iy as f32), fade(p.z - iz as f32));
    let at = |a: i32, b: i32, c: i32| signed(hash3(ix.wrapping_add(a), iy.wrapping_add(b), iz.wrapping_add(c), seed));
    let (a, b, c, d) = (at(0, 0, 0), at(1, 0, 0), at(0, 1, 0), at(1, 1, 0));
    let (e, f, g, h) = (at(0, 0, 1), at(1, 0, 1), at(0, 1, 1), at(1, 1, 1));
    let (k1, k2, k3) = (b - a, c - a, e - a);
    let (k4, k5, k6) = (a - b - c + d, a - c - e + g, a - b - e + f);
    let k7 = b + c + e + h - a - d - f - g;
    let value = a + k1 * u + k2 * v + k3 * w + k4 * u * v + k5 * v * w + k6 * u * w + k7 * u * v * w;
    let gradient = v3(
        du * (k1 + k4 * v + k6 * w + k7 * v * w),
        dv * (k2 + k4 * u + k5 * w + k7 * u * w),
        dw * (k3 + k5 * v + k6 * u + k7 * u * v),
    );
    (value, gradient)
}

/// Noise on many scales, each half as long as the one before.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fractal {
    /// Longest wave, metres.
    pub(crate) wave_m: f32,
    /// Number of scales.
    pub(crate) octaves: u32,
    /// Strength of a scale over that of the one before.
    pub(crate) gain: f32,
    pub(crate) seed: u32,
}

impl Fractal {
    /// How much of a wave is left when a pixel sees `footprint_m` of the surface: what is finer would only flicker.
    fn kept(wave_m: f32, footprint_m: f32) -> f32 {
        (wave_m / footprint_m * 0.7 - 0.8).clamp(0.0, 1.0)
    }

    /// Value and slope per metre in the plane.
    pub(crate) fn plane(&self, x: f32, y: f32, footprint_m: f32) -> Slope2 {
        let mut sum = Slope2::default();
        let (mut wave, mut strength) = (self.wave_m, 1.0);
        // The lattice is turned from scale to scale (cosine 0.8, sine 0.6), so that its axes do not show.
        let (mut c, mut s) = (1.0f32, 0.0f32);
        for octave in 0..self.octaves {
            let kept = Self::kept(wave, footprint_m);
            if kept <= 0.0 {
                break;
            }
            let f = 1.0 / wave;
            let n = noise2((c * x + s * y) * f, (c * y - s * x) * f, self.seed.wrapping_add(octave * 0x51ed));
            let k = strength * kept;
            sum.value += k * n.value;
            sum.dx += k * f * (c * n.dx - s * n.dy);
            sum.dy += k * f * (s * n.dx + c * n.dy);
            (wave, strength) = (wave * 0.5, strength * self.gain);
            (c, s) = (0.8 * c - 0.6 * s, 0.6 * c + 0.8 * s);
        }
        sum
    }

    /// Value and gradient per metre in space.
    pub(crate) fn space(&self, p: V3, footprint_m: f32) -> (f32, V3) {
        let (mut value, mut gradient) = (0.0, V3::default());
        let (mut wave, mut strength) = (self.wave_m, 1.0);
        for octave in 0..self.octaves {
            let kept = Self::kept(wave, footprint_m);
            if kept <= 0.0 {
                break;
            }
            let shift = octave as f32 * 17.31;
            let (n, g) = noise3(p * (1.0 / wave) + v3(shift, shift, shift), self.seed.wrapping_add(octave * 0x51ed));
            value += strength * kept * n;
            gradient += g * (strength * kept / wave);
            (wave, strength) = (wave * 0.5, strength * self.gain);
        }
        (value, gradient)
    }
}
