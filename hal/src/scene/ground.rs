//! The shape of the ground: a trail with two ruts through uneven grass, level or on a slope.

use super::noise::{Fractal, floor};
use super::options::SceneOptions;
use super::parallel::for_each_chunk;
use super::vector::{V3, mix, smoothstep, v3};

/// Heights on a grid, and between its nodes by bilinear interpolation. Outside, the ground goes on as at the edge.
#[derive(Debug)]
pub(crate) struct Ground {
    pub(crate) trail: Trail,
    slope: Slope,
    nodes: Vec<Node>,
    /// No steeper rise per metre occurs anywhere.
    steepest: f32,
}

#[derive(Clone, Copy, Debug, Default)]
struct Node {
    z: f32,
    dx: f32,
    dy: f32,
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

#[derive(Clone, Copy, Debug)]
struct Slope {
    tangent: f32,
    start: Option<f32>,
}

impl Slope {
    /// The slope begins and ends over a length, as hills do.
    const BEND_M: f32 = 0.8;
    const LENGTH_M: f32 = 34.0;

    fn z(self, x: f32) -> f32 {
        let ramp = |u: f32| {
            let bent = u.clamp(0.0, Self::BEND_M);
            bent * bent * (0.5 / Self::BEND_M) + (u - Self::BEND_M).max(0.0)
        };
        match self.start {
            None => self.tangent * x,
            Some(start) => self.tangent * (ramp(x - start) - ramp(x - start - Self::LENGTH_M)),
        }
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
        let tangent = libm::tanf(options.slope_deg.to_radians());
        let start = (options.slope_start_m > -20.0).then_some(options.slope_start_m);
        let slope = Slope { tangent, start };
        let mut nodes = vec![Node::default(); X_COUNT * Y_COUNT];
        let roll = Fractal { wave_m: 9.0, octaves: 2, gain: 0.45, seed: options.seed ^ 0x0151 };
        let bump = Fractal { wave_m: 1.3, octaves: 3, gain: 0.5, seed: options.seed ^ 0x0157 };
        let tuft = Fractal { wave_m: 0.38, octaves: 1, gain: 0.5, seed: options.seed ^ 0x0163 };
        for_each_chunk(&mut nodes, Y_COUNT, |i, column| {
            let x = X_FIRST_M + i as f32 * STEP_M;
            let (trail_y, base) = (trail.y(x), slope.z(x));
            for (j, node) in column.iter_mut().enumerate() {
                let y = Y_FIRST_M + j as f32 * STEP_M;
                let aside = (y - trail_y).abs();
                let verge = smoothstep(0.9, 1.6, aside);
                let rut = smoothstep(0.34, 0.1, (aside - 0.62).abs());
                let small = mix(0.35, 1.0, verge);
                let z = 0.045 * roll.plane(x, y, 0.01).value
                    + small * (0.016 * bump.plane(x, y, 0.01).value + 0.008 * tuft.plane(x, y, 0.01).value)
                    + 0.03 * verge
                    - 0.03 * rut;
                node.z = base + options.roughness * z;
            }
        });
        let mut ground = Self { trail, slope, nodes, steepest: 0.0 };
        ground.find_slopes();
        ground
    }

    fn find_slopes(&mut self) {
        let heights: Vec<f32> = self.nodes.iter().map(|node| node.z).collect();
        let mut steepest: f32 = 0.0;
        for i in 0..X_COUNT {
            let (a, b) = (i.saturating_sub(1), (i + 1).min(X_COUNT - 1));
            for j in 0..Y_COUNT {
                let (c, d) = (j.saturating_sub(1), (j + 1).min(Y_COUNT - 1));
                let at = |i: usize, j: usize| heights[i * Y_COUNT + j];
                let node = &mut self.nodes[i * Y_COUNT + j];
                node.dx = (at(b, j) - at(a, j)) / ((b - a) as f32 * STEP_M);
                node.dy = (at(i, d) - at(i, c)) / ((d - c) as f32 * STEP_M);
                let (ex, ey) = ((at(b, j) - at(i, j)) / STEP_M, (at(i, d) - at(i, j)) / STEP_M);
                steepest = steepest.max(ex * ex + ey * ey);
            }
        }
        self.steepest = steepest.sqrt() + 0.01;
    }

    /// Height without the bumps, and its rise per metre forward.
    pub(crate) fn base(&self, x: f32) -> (f32, f32) {
        (self.slope.z(x), (self.slope.z(x + 0.5) - self.slope.z(x - 0.5)))
    }

    pub(crate) fn height(&self, x: f32, y: f32) -> f32 {
        self.sample(x, y).z
    }

    /// The upward normal.
    pub(crate) fn normal(&self, x: f32, y: f32) -> V3 {
        let node = self.sample(x, y);
        v3(-node.dx, -node.dy, 1.0).unit()
    }

    fn sample(&self, x: f32, y: f32) -> Node {
        let u = ((x - X_FIRST_M) * (1.0 / STEP_M)).clamp(0.0, (X_COUNT - 1) as f32 - 0.001);
        let v = ((y - Y_FIRST_M) * (1.0 / STEP_M)).clamp(0.0, (Y_COUNT - 1) as f32 - 0.001);
        let (i, j) = (floor(u) as usize, floor(v) as usize);
        let (fu, fv) = (u - i as f32, v - j as f32);
        let row = i * Y_COUNT + j;
        let (a, b) = (&self.nodes[row], &self.nodes[row + 1]);
        let (c, d) = (&self.nodes[row + Y_COUNT], &self.nodes[row + Y_COUNT + 1]);
        let blend = |a: f32, b: f32, c: f32, d: f32| mix(mix(a, b, fv), mix(c, d, fv), fu);
        Node {
            z: blend(a.z, b.z, c.z, d.z),
            dx: blend(a.dx, b.dx, c.dx, d.dx),
            dy: blend(a.dy, b.dy, c.dy, d.dy),
        }
    }

    /// Where a ray from above meets the ground first.
    ///
    /// # Bound
    /// 160 steps.
    pub(crate) fn meet(&self, origin: V3, direction: V3) -> Option<f32> {
        let across = (direction.x * direction.x + direction.y * direction.y).sqrt();
        let closing = self.steepest * across - direction.z;
        if closing <= 1.0e-6 {
            return None;
        }
        let mut t = 0.0;
        for _ in 0..160 {
            let p = origin + direction * t;
            let gap = p.z - self.height(p.x, p.y);
            if gap < 0.0015 + 0.0002 * t {
                return Some(self.settle(origin, direction, t));
            }
            // No surface within reach rises faster than the steepest: this step cannot pass through it.
            t += gap / closing;
            if t > FAR_M {
                return None;
            }
        }
        // Grazing along a crest: near enough to be called a hit.
        Some(self.settle(origin, direction, t))
    }

    /// Newton's method over the last millimetres.
    fn settle(&self, origin: V3, direction: V3, mut t: f32) -> f32 {
        for _ in 0..3 {
            let p = origin + direction * t;
            let node = self.sample(p.x, p.y);
            let closing = node.dx * direction.x + node.dy * direction.y - direction.z;
            t += (p.z - node.z) / closing.max(0.02);
        }
        t
    }
}
