//! How much light a surface gives back, and how rough it is, by material and place.

use super::ground::Trail;
use super::mesh::Material;
use super::noise::{Fractal, floor, hash2, noise2, unit};
use super::vector::{V3, mix, smoothstep, v3};

/// What a surface does with light at a point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Finish {
    /// Share of the light that it gives back.
    pub(crate) albedo: f32,
    /// What to add to the normal for the roughness that the shape does not have.
    pub(crate) bump: V3,
    /// Share of the light on the far side that shines through.
    pub(crate) through: f32,
}

const DIRT: Fractal = Fractal { wave_m: 1.7, octaves: 10, gain: 0.68, seed: 0x0d17 };
const GRASS: Fractal = Fractal { wave_m: 2.3, octaves: 10, gain: 0.74, seed: 0x06a5 };
const STALK: Fractal = Fractal { wave_m: 0.3, octaves: 6, gain: 0.8, seed: 0x57a1 };
const ROCK: Fractal = Fractal { wave_m: 0.5, octaves: 8, gain: 0.68, seed: 0x0c4e };
const BARK: Fractal = Fractal { wave_m: 0.16, octaves: 6, gain: 0.72, seed: 0xba4c };
const WOOD: Fractal = Fractal { wave_m: 0.09, octaves: 6, gain: 0.7, seed: 0x300d };
const PLASTER: Fractal = Fractal { wave_m: 1.1, octaves: 9, gain: 0.66, seed: 0x91a5 };
const THICKET: Fractal = Fractal { wave_m: 0.21, octaves: 5, gain: 0.85, seed: 0x741c };
const LEAF: Fractal = Fractal { wave_m: 0.06, octaves: 3, gain: 0.7, seed: 0x1eaf };

/// The ground at a point, seen by a pixel that covers `footprint_m` of it.
pub(crate) fn ground(p: V3, trail: Trail, footprint_m: f32, seed: u32) -> Finish {
    let aside = (p.y - trail.y(p.x)).abs();
    let ragged = 0.2 * noise2(p.x * 0.9, p.y * 0.9, seed ^ 3).value
        + 0.14 * noise2(p.x * 4.3, p.y * 4.3, seed ^ 5).value
        + 0.07 * noise2(p.x * 17.0, p.y * 17.0, seed ^ 6).value;
    let edge = smoothstep(1.2, 0.95, aside + ragged);
    let middle = 0.8 * smoothstep(0.36, 0.16, aside + 0.8 * ragged);
    let dirt = edge * (1.0 - middle);
    let mut finish = Finish { albedo: 0.0, bump: V3::default(), through: 0.0 };
    if dirt > 0.003 {
        let n = DIRT.plane(p.x, p.y, footprint_m);
        let (pebble, px, py) = pebbles(p, footprint_m, seed);
        finish.albedo += dirt * (0.27 * (1.0 + 0.22 * n.value) + 0.13 * pebble).max(0.03);
        finish.bump += v3(-n.dx * 0.011 + px, -n.dy * 0.011 + py, 0.0) * dirt;
    }
    if dirt < 0.997 {
        let grass = 1.0 - dirt;
        let n = GRASS.plane(p.x, p.y, footprint_m);
        let m = STALK.plane(p.x, p.y, footprint_m);
        let dry = smoothstep(-0.2, 0.9, noise2(p.x * 0.45, p.y * 0.45, seed ^ 9).value + 0.35 * n.value);
        let base = mix(0.13, 0.195, dry);
        finish.albedo += grass * (base * (1.0 + 0.4 * n.value + 0.5 * m.value)).max(0.02);
        finish.bump += v3(-n.dx - m.dx, -n.dy - m.dy, 0.0) * (0.008 * grass);
    }
    finish
}

/// Small stones in the dirt: brightness over it, and what they do to the normal.
fn pebbles(p: V3, footprint_m: f32, seed: u32) -> (f32, f32, f32) {
    let mut sum = (0.0, 0.0, 0.0);
    for (size_m, share) in [(0.11f32, 0.35f32), (0.05, 0.5), (0.023, 0.6)] {
        let kept = (size_m / footprint_m * 0.5 - 0.8).clamp(0.0, 1.0);
        if kept <= 0.0 {
            break;
        }
        let (x, y) = (p.x / size_m, p.y / size_m);
        let (i, j) = (floor(x), floor(y));
        let h = hash2(i, j, seed ^ size_m.to_bits());
        if unit(h) > share {
            continue;
        }
        let pick = |salt: i32| unit(hash2(i ^ salt, j, h));
        let r = 0.13 + 0.24 * pick(1);
        let (dx, dy) = (x - i as f32 - mix(r, 1.0 - r, pick(2)), y - j as f32 - mix(r, 1.0 - r, pick(3)));
        let d2 = (dx * dx * (0.8 + 0.5 * pick(4)) + dy * dy) / (r * r);
        if d2 < 1.0 {
            let rim = 1.0 - d2 * d2;
            sum.0 += kept * rim * (pick(5) * 1.5 - 0.5);
            sum.1 += kept * dx / r * 0.8;
            sum.2 += kept * dy / r * 0.8;
        } else if d2 < 1.8 {
            // The dark gap around a stone.
            sum.0 -= kept * 0.35 * (1.8 - d2);
        }
    }
    sum
}

/// A thing at a point: `grain` is the direction of its fibres, `above_m` the height above the ground.
pub(crate) fn thing(material: Material, p: V3, normal: V3, grain: V3, above_m: f32, footprint_m: f32) -> Finish {
    let mut finish = Finish { albedo: 0.0, bump: V3::default(), through: 0.0 };
    // Fibres: the texture is drawn out along the grain.
    let drawn = |factor: f32| p - grain * (p.dot(grain) * (1.0 - factor));
    match material {
        Material::Rock => {
            let (n, g) = ROCK.space(p, footprint_m);
            let (spot, _) = super::noise::noise3(p * 5.5, 0x11c4);
            let lichen = smoothstep(0.3, 0.55, spot + 0.25 * n);
            let moss = 0.5 * smoothstep(0.55, 0.95, normal.z + 0.3 * n);
            finish.albedo = mix(mix(0.27 * (1.0 + 0.4 * n), 0.42, 0.6 * lichen), 0.17, moss).max(0.03);
            finish.bump = g * -0.022;
        }
        Material::Bark => {
            let (n, g) = BARK.space(drawn(0.22), footprint_m);
            let crack = smoothstep(-0.1, -0.7, n);
            finish.albedo = (0.22 * (1.0 + 0.6 * n)).max(0.03) * (1.0 - 0.65 * crack);
            finish.bump = g * -0.011;
        }
        Material::Wood => {
            let (n, g) = WOOD.space(drawn(0.07), footprint_m);
            let (stain, _) = super::noise::noise3(p * 3.3, 0x57a1);
            finish.albedo = (0.3 * (1.0 + 0.34 * n + 0.22 * stain)).max(0.03);
            finish.bump = g * -0.003;
        }
        Material::Plaster => {
            let (n, g) = PLASTER.space(p, footprint_m);
            // Rain draws dirt down from the coping and splashes it up from the soil.
            let (streak, _) = super::noise::noise3(v3(p.x * 6.0, p.y * 6.0, p.z * 0.7), 0x57e4);
            let (patch, _) = super::noise::noise3(p * 2.1, 0x9a7c);
            let splash = smoothstep(0.5, 0.05, above_m + 0.22 * patch + 0.1 * n);
            let bare = smoothstep(0.5, 0.62, patch + 0.3 * n);
            let clean = 0.5 * (1.0 + 0.05 * n + 0.05 * streak);
            finish.albedo = mix(mix(clean, 0.33 * (1.0 + 0.3 * n), 0.8 * bare), 0.24 * (1.0 + 0.35 * n), 0.75 * splash);
            finish.bump = g * (-0.0015 - 0.004 * bare);
        }
        Material::Coping => {
            let (n, g) = ROCK.space(p * 1.7, footprint_m);
            finish.albedo = (0.33 * (1.0 + 0.35 * n)).max(0.03);
            finish.bump = g * -0.008;
        }
        Material::Leaf => {
            let (n, _) = LEAF.space(p, footprint_m);
            finish.albedo = (0.2 * (1.0 + 0.35 * n)).max(0.02);
            finish.through = 0.5;
        }
        Material::Thicket => {
            let (n, g) = THICKET.space(p, footprint_m);
            finish.albedo = (0.36 * smoothstep(-0.9, 1.4, n)).max(0.02);
            finish.bump = g * -0.03;
            finish.through = 0.3;
        }
        Material::Blade => {
            finish.albedo = 0.26 * smoothstep(-0.05, 0.09, above_m);
            finish.through = 0.4;
        }
    }
    finish
}
