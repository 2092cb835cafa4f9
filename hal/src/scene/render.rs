//! Follows rays into the scene and gathers their light.

use super::bvh::ShapeHit;
use super::materials::{self, Finish};
use super::mesh::Material;
use super::noise::hash;
use super::optics::Eye;
use super::parallel::for_each_chunk;
use super::sensor::Sensor;
use super::sky::{self, HAZE};
use super::vector::{V3, mix};
use super::{RenderedPair, Scene};

/// What a ray meets first.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Hit {
    Ground(f32),
    Thing(ShapeHit),
    /// Sky, or hills beyond the ground.
    Far,
}

/// Four rays a pixel, on a turned square: near-vertical and near-level edges get four shades each.
const RAYS: [(f32, f32); 4] = [(-0.375, -0.125), (0.125, -0.375), (0.375, 0.125), (-0.125, 0.375)];

/// Size in pixels of the finest texture of a pixel that is looked at once.
const COARSE: f32 = 0.62;

const SUN: f32 = 1.05;
const SKY: f32 = 0.36;
/// Light that the ground gives back to what stands on it.
const BOUNCE: f32 = 0.1;
/// Distance over which half of the contrast goes into the haze, metres.
const CLEAR_M: f32 = 420.0;

impl Scene {
    /// Takes both pictures of a frame.
    ///
    /// # Bound
    /// Eight rays a pixel.
    pub fn render(&self, frame: u32) -> RenderedPair {
        let [left, right] = self.eyes(frame);
        RenderedPair {
            left: self.photograph(&left, frame, 0, 1.0),
            right: self.photograph(&right, frame, 1, self.options.exposure_ratio),
        }
    }

    fn photograph(&self, eye: &Eye, frame: u32, side: u32, exposure: f32) -> Vec<u8> {
        let (width, height) = (self.options.width as usize, self.options.height as usize);
        let mut light = vec![0.0f32; width * height];
        for_each_chunk(&mut light, width, |y, row| {
            for (x, pixel) in row.iter_mut().enumerate() {
                *pixel = self.pixel(eye, x as f32, y as f32);
            }
        });
        let seed = hash(self.options.seed ^ hash(frame.wrapping_mul(2).wrapping_add(side)));
        let sensor = Sensor { width, height, exposure, noise_sigma: self.options.noise_sigma, seed };
        let mut grey = vec![0; width * height];
        sensor.expose(&light, &mut grey);
        grey
    }

    fn pixel(&self, eye: &Eye, x: f32, y: f32) -> f32 {
        let [a, b, c, d] = RAYS.map(|(dx, dy)| eye.look(x + dx, y + dy));
        let (hit_a, hit_c) = (self.meet(eye.origin, a), self.meet(eye.origin, c));
        let light = |a, hit_a, c, hit_c| self.light_along(eye, a, hit_a) + self.light_along(eye, c, hit_c);
        // Two rays do where there is no edge between them, and on the ground one look at what they meet.
        match (hit_a, hit_c) {
            (Hit::Ground(ta), Hit::Ground(tc)) if (ta - tc).abs() < 0.1 * ta => {
                let t = 0.5 * (ta + tc);
                let p = (a * ta + c * tc) * 0.5;
                let light = self.ground_light(eye.origin + p, p, t * COARSE / eye.focal_px());
                return hazy(light, t);
            }
            (Hit::Ground(_), Hit::Ground(_)) | (Hit::Far, Hit::Far) => return 0.5 * light(a, hit_a, c, hit_c),
            (Hit::Thing(one), Hit::Thing(other)) if self.is_one_face(&one, &other) => {
                return 0.5 * light(a, hit_a, c, hit_c);
            }
            _ => {}
        }
        let (hit_b, hit_d) = (self.meet(eye.origin, b), self.meet(eye.origin, d));
        0.25 * (light(a, hit_a, c, hit_c) + light(b, hit_b, d, hit_d))
    }

    /// Whether two neighbouring rays meet the same smooth surface, so that there is nothing to be seen between them.
    fn is_one_face(&self, one: &ShapeHit, other: &ShapeHit) -> bool {
        let (a, b) = (&self.skins[one.id as usize], &self.skins[other.id as usize]);
        let leafy = matches!(a.material, Material::Leaf | Material::Blade);
        !leafy && a.object == b.object && a.material == b.material && (one.t - other.t).abs() < 0.02 * one.t
    }

    /// Follows a ray. `direction` is 1 long along the optical axis, so that the distances are depths.
    pub(crate) fn meet(&self, origin: V3, direction: V3) -> Hit {
        let ground = self.ground.meet(origin, direction);
        let far = ground.unwrap_or(400.0);
        match (self.bvh.nearest(origin, direction, 0.05, far), ground) {
            (Some(hit), _) => Hit::Thing(hit),
            (None, Some(t)) => Hit::Ground(t),
            (None, None) => Hit::Far,
        }
    }

    fn light_along(&self, eye: &Eye, direction: V3, hit: Hit) -> f32 {
        let pixel_rad = 0.5 / eye.focal_px();
        match hit {
            Hit::Far => sky::far(eye.origin, direction, pixel_rad, self.options.seed).0,
            Hit::Ground(t) => hazy(self.ground_light(eye.origin + direction * t, direction, t * pixel_rad), t),
            Hit::Thing(hit) => {
                let p = eye.origin + direction * hit.t;
                hazy(self.thing_light(p, direction, &hit, hit.t * pixel_rad), hit.t)
            }
        }
    }

    fn ground_light(&self, p: V3, direction: V3, across_m: f32) -> f32 {
        let normal = self.ground.normal(p.x, p.y);
        // A pixel covers more of the ground along the view than across it. Fine texture is kept nearer to what it covers
        // across, as blades and stones stand up and are seen from the side.
        let slant = (-direction.dot(normal) / direction.length()).clamp(0.04, 1.0);
        let footprint_m = across_m / slant.sqrt();
        let finish = materials::ground(p, self.ground.trail, footprint_m, self.options.seed);
        let open = self.light.sky(p.x, p.y);
        self.lit(&finish, (normal + finish.bump).unit(), open, self.light.sun(p, normal, 0.02))
    }

    fn thing_light(&self, p: V3, direction: V3, hit: &ShapeHit, footprint_m: f32) -> f32 {
        let skin = &self.skins[hit.id as usize];
        let grain = self.objects[usize::from(skin.object)].grain;
        let [a, b, c] = skin.normals;
        let mut normal = (a * (1.0 - hit.u - hit.v) + b * hit.u + c * hit.v).unit();
        if skin.material == Material::Leaf || skin.material == Material::Blade {
            if normal.dot(direction) > 0.35 {
                normal = -normal;
            }
        } else if normal.dot(direction) > 0.0 {
            normal = normal + direction.unit() * (-normal.dot(direction) / direction.length());
        }
        let above_m = p.z - self.ground.height(p.x, p.y);
        let finish = materials::thing(skin.material, p, normal, grain, above_m, footprint_m);
        let finish = Finish { albedo: finish.albedo * skin.tint, ..finish };
        let near_ground = mix(self.light.sky(p.x, p.y), 1.0, (above_m * 1.6 + 0.15).clamp(0.0, 1.0));
        let bias = if skin.material == Material::Leaf { 0.05 } else { 0.03 };
        self.lit(&finish, (normal + finish.bump).unit(), near_ground, self.light.sun(p, normal, bias))
    }

    fn lit(&self, finish: &Finish, normal: V3, open: f32, sun: f32) -> f32 {
        let towards = normal.dot(self.light.to_sun);
        let direct = SUN * sun * (towards.max(0.0) + finish.through * (-towards).max(0.0));
        let sky = SKY * open * (0.5 + 0.5 * normal.z);
        let bounce = BOUNCE * open * (0.5 - 0.5 * normal.z);
        finish.albedo * (direct + sky + bounce)
    }
}

fn hazy(light: f32, t: f32) -> f32 {
    mix(light, HAZE, t / (t + CLEAR_M))
}
