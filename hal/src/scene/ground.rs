//! The shape of the ground: a trail with two ruts through uneven grass, level or on a slope.

use super::noise::Fractal;
use super::options::SceneOptions;
use super::parallel::for_each_chunk;
use super::vector::{V3, mix, smoothstep, v3};

/// Heights on a grid, and between its nodes by bilinear interpolation. Outside, the ground goes on as at the edge.
#[derive(Debug)]
pub(crate) struct Ground {
    pub(crate) trail: Trail,
    slope: Slope,
    heights: Vec<f32>,
    /// Rise per metre along x and y.
    rises: Vec<[f32; 2]>,
    /// Rise per metre along x and y that hardly any part of the ground exceeds.
    steep: f32,
    /// Greatest height of a bump over the slope.
    ceiling_m: f32,
}

/// Where the trail runs: `y` to the left of the x axis at a distance `x`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Trail {
    phase: f32,
}

impl Trail {
    const BEND_M: f32 = 1.1;
    const TURN: f32 = 0.1;

    pub(crate) fn y(self, x: f32) -> f32 {
        Self::BEND_M * libm::sinf(Self::TURN * x + self.phase)
    }

    /// Bearing of the trail, radians.
    pub(crate) fn bearing(self, x: f32) -> f32 {
        libm::atanf(Self::BEND_M * Self::TURN * libm::cosf(Self::TURN * x + self.phase))
    }
}

/// Level ground up to a line, a plane that rises or falls from there on, and what comes after it. The line lies across the
/// way of the plane's fall, so that a plane that is tilted sideways begins along an oblique line and nothing steps.
#[derive(Clone, Copy, Debug)]
struct Slope {
    tangent: f32,
    /// Rise per metre to the left.
    tangent_aside: f32,
    /// Rise per metre ahead beyond the slope.
    tangent_after: f32,
    start: Option<f32>,
    length_m: f32,
}

impl Slope {
    /// The slope begins and ends over a length, as hills do.
    const BEND_M: f32 = 0.8;

    fn new(options: &SceneOptions) -> Self {
        let [tangent, tangent_aside, tangent_after] =
            [options.slope_deg, options.slope_aside_deg, options.slope_after_deg]
                .map(|deg| libm::tanf(deg.to_radians()));
        // Ground that only tilts sideways has no line where it could begin.
        let begins = options.slope_start_m > -20.0 && (tangent != 0.0 || tangent_aside == 0.0);
        let start = begins.then_some(options.slope_start_m);
        Self { tangent, tangent_aside, tangent_after, start, length_m: options.slope_length_m }
    }

    fn z(self, x: f32, y: f32) -> f32 {
        let ramp = |u: f32| {
            let bent = u.clamp(0.0, Self::BEND_M);
            bent * bent * (0.5 / Self::BEND_M) + (u - Self::BEND_M).max(0.0)
        };
        match self.start {
            None => self.tangent * x + self.tangent_aside * y,
            Some(start) => {
                let oblique = if self.tangent_aside == 0.0 { 0.0 } else { self.tangent_aside / self.tangent * y };
                let u = x - start + oblique;
                self.tangent * (ramp(u) - ramp(u - self.length_m)) + self.tangent_after * ramp(u - self.length_m)
            }
        }
    }

    /// Rise per metre that no part of it exceeds, along x and along y.
    fn steepest(self) -> [f32; 2] {
        let ahead = self.tangent.abs().max(self.tangent_after.abs());
        // Beyond the slope the tilt to the side is as much greater or smaller as the rise ahead.
        let part = if self.tangent == 0.0 { 1.0 } else { ahead / self.tangent.abs() };
        [ahead, self.tangent_aside.abs() * part]
    }
}

const STEP_M: f32 = 0.0625;
const X_FIRST_M: f32 = -6.0;
const Y_FIRST_M: f32 = -32.0;
const X_COUNT: usize = 1152;
const Y_COUNT: usize = 1024;
/// Rays that have not met the ground by then see the far hills.
const FAR_M: f32 = 160.0;

impl Ground {
    pub(crate) fn new(options: &SceneOptions) -> Self {
        let trail = Trail { phase: -0.5 + 0.9 * super::noise::unit(super::noise::hash(options.seed ^ 0x7a11)) };
        let slope = Slope::new(options);
        let mut heights = vec![0.0; X_COUNT * Y_COUNT];
        let roll = Fractal { wave_m: 9.0, octaves: 2, gain: 0.45, seed: options.seed ^ 0x0151 };
        let bump = Fractal { wave_m: 1.3, octaves: 3, gain: 0.5, seed: options.seed ^ 0x0157 };
        let tuft = Fractal { wave_m: 0.38, octaves: 1, gain: 0.5, seed: options.seed ^ 0x0163 };
        for_each_chunk(&mut heights, Y_COUNT, |i, column| {
            let x = X_FIRST_M + i as f32 * STEP_M;
            let trail_y = trail.y(x);
            for (j, height) in column.iter_mut().enumerate() {
                let y = Y_FIRST_M + j as f32 * STEP_M;
                let aside = (y - trail_y).abs();
                let verge = smoothstep(0.9, 1.6, aside);
                let rut = smoothstep(0.34, 0.1, (aside - 0.62).abs());
                let small = mix(0.35, 1.0, verge);
                let z = 0.045 * roll.plane(x, y, 0.01).value
                    + small * (0.016 * bump.plane(x, y, 0.01).value + 0.008 * tuft.plane(x, y, 0.01).value)
                    + 0.03 * verge
                    - 0.03 * rut;
                *height = slope.z(x, y) + options.roughness * z;
            }
        });
        let rises = rises(&heights);
        let [ahead, aside] = slope.steepest();
        let steep = ahead + aside + 0.16 * options.roughness;
        let mut ceiling_m: f32 = 0.0;
        for (i, column) in heights.chunks(Y_COUNT).enumerate() {
            let x = X_FIRST_M + i as f32 * STEP_M;
            for (j, z) in column.iter().enumerate() {
                ceiling_m = ceiling_m.max(z - slope.z(x, Y_FIRST_M + j as f32 * STEP_M));
            }
        }
        Self { trail, slope, heights, rises, steep, ceiling_m }
    }

    /// Rise per metre along x and along y of the ground without its bumps.
    pub(crate) fn base_rise(&self, x: f32, y: f32) -> [f32; 2] {
        let z = |dx: f32, dy: f32| self.slope.z(x + dx, y + dy);
        [z(0.5, 0.0) - z(-0.5, 0.0), z(0.0, 0.5) - z(0.0, -0.5)]
    }

    pub(crate) fn height(&self, x: f32, y: f32) -> f32 {
        let (node, fu, fv) = Self::node(x, y);
        let near = &self.heights[node..node + 2];
        let far = &self.heights[node + Y_COUNT..node + Y_COUNT + 2];
        mix(mix(near[0], near[1], fv), mix(far[0], far[1], fv), fu)
    }

    /// The upward normal.
    pub(crate) fn normal(&self, x: f32, y: f32) -> V3 {
        let [dx, dy] = self.rise(x, y);
        v3(-dx, -dy, 1.0).unit()
    }

    fn rise(&self, x: f32, y: f32) -> [f32; 2] {
        let (node, fu, fv) = Self::node(x, y);
        let near = &self.rises[node..node + 2];
        let far = &self.rises[node + Y_COUNT..node + Y_COUNT + 2];
        core::array::from_fn(|k| mix(mix(near[0][k], near[1][k], fv), mix(far[0][k], far[1][k], fv), fu))
    }

    /// The node before a place along both axes, and the way from it to the next.
    fn node(x: f32, y: f32) -> (usize, f32, f32) {
        let u = ((x - X_FIRST_M) * (1.0 / STEP_M)).clamp(0.0, (X_COUNT - 1) as f32 - 0.001);
        let v = ((y - Y_FIRST_M) * (1.0 / STEP_M)).clamp(0.0, (Y_COUNT - 1) as f32 - 0.001);
        let (i, j) = (u as usize, v as usize);
        (i * Y_COUNT + j, u - i as f32, v - j as f32)
    }

    /// Where a ray from above meets the ground first.
    ///
    /// # Bound
    /// 112 steps.
    pub(crate) fn meet(&self, origin: V3, direction: V3) -> Option<f32> {
        let mut t = 0.0;
        // First down to the height that no bump exceeds: one step where the ground is level.
        let [ahead, aside] = self.slope.steepest();
        let closing = ahead * direction.x.abs() + aside * direction.y.abs() - direction.z;
        if closing <= 1.0e-6 {
            return None;
        }
        for _ in 0..32 {
            let base = self.slope.z(origin.x + direction.x * t, origin.y + direction.y * t);
            let gap = origin.z + direction.z * t - base - self.ceiling_m;
            if gap < 0.01 || t > FAR_M {
                break;
            }
            t += gap / closing;
        }
        let across = (direction.x * direction.x + direction.y * direction.y).sqrt();
        let closing = self.steep * across - direction.z;
        for _ in 0..80 {
            if t > FAR_M {
                return None;
            }
            let p = origin + direction * t;
            let gap = p.z - self.height(p.x, p.y);
            if gap < 0.004 + 0.0006 * t {
                break;
            }
            t += gap / closing;
        }
        Some(self.settle(origin, direction, t))
    }

    /// Newton's method over the last centimetre.
    fn settle(&self, origin: V3, direction: V3, mut t: f32) -> f32 {
        for _ in 0..3 {
            let p = origin + direction * t;
            let [dx, dy] = self.rise(p.x, p.y);
            let closing = dx * direction.x + dy * direction.y - direction.z;
            t += (p.z - self.height(p.x, p.y)) / closing.max(0.03);
        }
        t
    }
}

fn rises(heights: &[f32]) -> Vec<[f32; 2]> {
    let mut rises = vec![[0.0; 2]; heights.len()];
    for_each_chunk(&mut rises, Y_COUNT, |i, column| {
        let (a, b) = (i.saturating_sub(1), (i + 1).min(X_COUNT - 1));
        for (j, rise) in column.iter_mut().enumerate() {
            let (c, d) = (j.saturating_sub(1), (j + 1).min(Y_COUNT - 1));
            let at = |i: usize, j: usize| heights[i * Y_COUNT + j];
            rise[0] = (at(b, j) - at(a, j)) / ((b - a) as f32 * STEP_M);
            rise[1] = (at(i, d) - at(i, c)) / ((d - c) as f32 * STEP_M);
        }
    });
    rises
}
