//! What is too far away to have a place: sky, clouds and the hills on the horizon.

use super::noise::{Fractal, noise2};
use super::vector::{V3, mix, smoothstep};

const CLOUD: Fractal = Fractal { wave_m: 2.6, octaves: 6, gain: 0.52, seed: 0xc10d };
const RIDGE: Fractal = Fractal { wave_m: 0.5, octaves: 6, gain: 0.5, seed: 0x41d6 };
const WOODS: Fractal = Fractal { wave_m: 0.014, octaves: 4, gain: 0.75, seed: 0x300d };

/// Distance, height and darkness of the ridges, nearest first. They stand around the origin of the world.
const RIDGES: [Ridge; 3] = [
    Ridge { radius_m: 170.0, base_m: 3.5, rise_m: 7.0, detail: 1.0, albedo: 0.1, haze: 0.16 },
    Ridge { radius_m: 700.0, base_m: 38.0, rise_m: 34.0, detail: 0.5, albedo: 0.15, haze: 0.42 },
    Ridge { radius_m: 2500.0, base_m: 190.0, rise_m: 150.0, detail: 0.2, albedo: 0.17, haze: 0.72 },
];

struct Ridge {
    radius_m: f32,
    base_m: f32,
    rise_m: f32,
    detail: f32,
    albedo: f32,
    haze: f32,
}

/// Brightness of the haze in front of far things.
pub(crate) const HAZE: f32 = 0.6;

/// Light that comes from far away along a ray, and the length of the ray to a ridge if there is one.
pub(crate) fn far(origin: V3, direction: V3, pixel_rad: f32, seed: u32) -> (f32, Option<f32>) {
    let flat = (direction.x * direction.x + direction.y * direction.y).max(1.0e-9);
    for (i, ridge) in (0u32..).zip(&RIDGES) {
        let b = origin.x * direction.x + origin.y * direction.y;
        let c = origin.x * origin.x + origin.y * origin.y - ridge.radius_m * ridge.radius_m;
        let t = ((b * b - flat * c).max(0.0).sqrt() - b) / flat;
        let p = origin + direction * t;
        // Along the ridge in units of its distance: no angle is needed as only the forward side is seen closely.
        let (a, z) = (p.y / ridge.radius_m + if p.x < 0.0 { 7.0 } else { 0.0 }, p.z);
        let line = RIDGE.plane(a + 10.0 * i as f32, 0.7, pixel_rad * 2.0);
        let crown = WOODS.plane(a, 3.0, pixel_rad).value * ridge.detail;
        let top = ridge.base_m + ridge.rise_m * (0.8 * line.value + 0.13 * crown);
        if z < top {
            let n = WOODS.plane(a, z / ridge.radius_m * 1.3, pixel_rad);
            let light = ridge.albedo * (1.0 + 0.5 * n.value * ridge.detail) * (1.0 + 0.25 * line.value);
            return (mix(light, HAZE, ridge.haze), Some(t));
        }
    }
    let up = direction.z / direction.length();
    // Clouds on a plane overhead; near the horizon they melt into the haze.
    let height = 1.0 / (up + 0.06).max(0.03);
    let (x, y) = (direction.x * height, direction.y * height);
    let n = CLOUD.plane(x * 0.8, y * 0.8, pixel_rad * height).value + 0.25 * noise2(x * 0.2, y * 0.2, seed).value;
    let cloud = smoothstep(-0.1, 0.6, n) * smoothstep(0.0, 0.12, up);
    let blue = mix(0.78, 0.36, smoothstep(-0.02, 0.35, up));
    (mix(blue, 1.15 - 0.35 * smoothstep(0.35, 1.1, n), 0.9 * cloud), None)
}
