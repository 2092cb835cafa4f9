//! The sun and what keeps its light off: a depth picture of the scene as the sun sees it, and the dimming near the foot of things.

use super::bvh::Shape;
use super::ground::Ground;
use super::mesh::Mesh;
use super::noise::floor;
use super::vector::{V3, v3};

/// Where the light comes from and where it is kept out.
#[derive(Debug)]
pub(crate) struct Light {
    pub(crate) to_sun: V3,
    across: V3,
    up: V3,
    depth: Vec<f32>,
    nearness: Vec<f32>,
}

const TEXEL_M: f32 = 0.03;
const WIDTH: usize = 1500;
const HEIGHT: usize = 1500;
const ORIGIN: V3 = v3(18.0, 0.0, 0.5);
/// Cells of the map of what stands near.
const NEAR_M: f32 = 0.1;
const NEAR_X: usize = 460;
const NEAR_Y: usize = 320;
const NEAR_X_FIRST: f32 = -4.0;
const NEAR_Y_FIRST: f32 = -16.0;

impl Light {
    pub(crate) fn new(mesh: &Mesh, ground: &Ground) -> Self {
        let to_sun = v3(-0.3, 0.62, 0.62).unit();
        let across = V3::UP.cross(to_sun).unit();
        let up = to_sun.cross(across);
        let mut light = Self { to_sun, across, up, depth: vec![f32::MIN; WIDTH * HEIGHT], nearness: Vec::new() };
        for shape in &mesh.shapes {
            let object = usize::from(mesh.skins[shape.id as usize].object);
            if mesh.objects.get(object).is_some_and(|o| o.shadow) {
                light.draw(shape);
            }
        }
        light.nearness = nearness(mesh, ground);
        light
    }

    fn project(&self, p: V3) -> (f32, f32, f32) {
        let q = p - ORIGIN;
        let u = q.dot(self.across) * (1.0 / TEXEL_M) + WIDTH as f32 * 0.5;
        let v = q.dot(self.up) * (1.0 / TEXEL_M) + HEIGHT as f32 * 0.5;
        (u, v, q.dot(self.to_sun))
    }

    /// Draws a shape into the depth picture, nearest to the sun first.
    fn draw(&mut self, shape: &Shape) {
        let (u0, v0, d0) = self.project(shape.corner);
        let (ua, va, da) = self.project(shape.corner + shape.side_a);
        let (ub, vb, db) = self.project(shape.corner + shape.side_b);
        let (ax, ay, az) = (ua - u0, va - v0, da - d0);
        let (bx, by, bz) = (ub - u0, vb - v0, db - d0);
        let determinant = ax * by - ay * bx;
        if determinant.abs() < 1.0e-6 {
            return;
        }
        let far = if shape.parallelogram { (ax + bx, ay + by) } else { (0.0, 0.0) };
        let (low_u, high_u) = (ax.min(bx).min(0.0).min(far.0) + u0, ax.max(bx).max(0.0).max(far.0) + u0);
        let (low_v, high_v) = (ay.min(by).min(0.0).min(far.1) + v0, ay.max(by).max(0.0).max(far.1) + v0);
        let (i0, i1) = (floor(low_u).max(0), floor(high_u).min(WIDTH as i32 - 1));
        let (j0, j1) = (floor(low_v).max(0), floor(high_v).min(HEIGHT as i32 - 1));
        let inverse = 1.0 / determinant;
        for j in j0..=j1 {
            for i in i0..=i1 {
                let (x, y) = (i as f32 + 0.5 - u0, j as f32 + 0.5 - v0);
                let (s, t) = ((x * by - y * bx) * inverse, (ax * y - ay * x) * inverse);
                let limit = if shape.parallelogram { t } else { s + t };
                if s >= 0.0 && t >= 0.0 && s <= 1.0 && limit <= 1.0 {
                    let texel = &mut self.depth[j as usize * WIDTH + i as usize];
                    *texel = texel.max(d0 + s * az + t * bz);
                }
            }
        }
    }

    /// Share of the sun that reaches `p`, soft over the width of its disc.
    pub(crate) fn sun(&self, p: V3, normal: V3, bias_m: f32) -> f32 {
        let (u, v, d) = self.project(p + normal * bias_m);
        let (u, v) = (u - 0.5, v - 0.5);
        let (i, j) = (floor(u), floor(v));
        if i < 1 || j < 1 || i + 2 >= WIDTH as i32 || j + 2 >= HEIGHT as i32 {
            return 1.0;
        }
        let (fu, fv) = (u - i as f32, v - j as f32);
        let (wu, wv) = ([1.0 - fu, 1.0, 1.0, fu], [1.0 - fv, 1.0, 1.0, fv]);
        let mut lit = 0.0;
        for (k, wv) in wv.iter().enumerate() {
            let start = (j as usize + k - 1) * WIDTH + i as usize - 1;
            for (texel, wu) in self.depth[start..start + 4].iter().zip(wu) {
                if *texel < d + bias_m {
                    lit += wu * wv;
                }
            }
        }
        lit * (1.0 / 9.0)
    }

    /// Share of the sky that the ground at a place sees past what stands next to it.
    pub(crate) fn sky(&self, x: f32, y: f32) -> f32 {
        let u = ((x - NEAR_X_FIRST) * (1.0 / NEAR_M)).clamp(0.0, (NEAR_X - 2) as f32);
        let v = ((y - NEAR_Y_FIRST) * (1.0 / NEAR_M)).clamp(0.0, (NEAR_Y - 2) as f32);
        let (i, j) = (floor(u) as usize, floor(v) as usize);
        let (fu, fv) = (u - i as f32, v - j as f32);
        let at = |i: usize, j: usize| self.nearness[i * NEAR_Y + j];
        let low = at(i, j) + (at(i, j + 1) - at(i, j)) * fv;
        let high = at(i + 1, j) + (at(i + 1, j + 1) - at(i + 1, j)) * fv;
        1.0 - 0.72 * (low + (high - low) * fu)
    }
}

/// How much of the surroundings of a place is taken by things that stand on the ground there.
fn nearness(mesh: &Mesh, ground: &Ground) -> Vec<f32> {
    let mut map = vec![0.0f32; NEAR_X * NEAR_Y];
    for shape in &mesh.shapes {
        let skin = &mesh.skins[shape.id as usize];
        if !mesh.objects.get(usize::from(skin.object)).is_some_and(|o| o.shadow) {
            continue;
        }
        shape.sprinkle(NEAR_M * 0.7, |p| {
            let above = p.z - ground.height(p.x, p.y);
            let (i, j) = (floor((p.x - NEAR_X_FIRST) / NEAR_M), floor((p.y - NEAR_Y_FIRST) / NEAR_M));
            if above < 0.5 && i >= 0 && j >= 0 && i < NEAR_X as i32 && j < NEAR_Y as i32 {
                let cell = &mut map[i as usize * NEAR_Y + j as usize];
                *cell = cell.max(1.0 - above.max(0.0));
            }
        });
    }
    let mut other = map.clone();
    for _ in 0..3 {
        blur(&map, &mut other, NEAR_X, NEAR_Y, NEAR_Y, 1);
        blur(&other, &mut map, NEAR_Y, NEAR_X, 1, NEAR_Y);
    }
    map.iter().map(|v| (v * 1.5).min(1.0)).collect()
}

/// Mean of three along lines of `length` elements `stride` apart.
fn blur(from: &[f32], to: &mut [f32], length: usize, lines: usize, stride: usize, line_stride: usize) {
    for line in 0..lines {
        let at = |i: usize| line * line_stride + i * stride;
        for i in 0..length {
            let (a, b) = (i.saturating_sub(1), (i + 1).min(length - 1));
            to[at(i)] = (from[at(a)] + from[at(i)] + from[at(b)]) * (1.0 / 3.0);
        }
    }
}
