//! Where things stand: a trail through a meadow, as a gardener would place them rather than as dice would.

use super::ground::Ground;
use super::mesh::{Material, Mesh};
use super::noise::Rng;
use super::options::{Content, SceneOptions};
use super::vector::{V3, v3};

/// What stands on the ground of [`Content::Course`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CourseThing {
    /// A wooden crate, 0.5 m long, wide and high.
    Crate,
    /// A wooden post, 1.2 m high and 0.16 m thick.
    Post,
}

/// The things of [`Content::Course`] with the places of their middles: metres along the world's x axis, which is how far ahead
/// of the first frame they are, and metres to the left of the trail (to the right in scenes with an even seed).
///
/// None hides another, and there is room between them to drive.
pub const COURSE: [(CourseThing, f32, f32); 6] = [
    (CourseThing::Post, 3.6, 1.1),
    (CourseThing::Crate, 4.4, -1.3),
    (CourseThing::Post, 5.8, -0.2),
    (CourseThing::Crate, 6.6, 2.0),
    (CourseThing::Post, 7.6, -3.0),
    (CourseThing::Crate, 8.6, 0.7),
];

/// Places things on the ground.
pub(crate) struct Planter<'a> {
    ground: &'a Ground,
    pub(crate) mesh: Mesh,
    rng: Rng,
    /// -1 where the scene is the mirror image of the usual one.
    side: f32,
}

pub(crate) fn furnish(options: &SceneOptions, ground: &Ground) -> Mesh {
    let mut planter = Planter::new(ground, options.seed);
    planter.grass(2200);
    planter.pebbles(90);
    match options.content {
        Content::Rural => planter.rural(),
        Content::OpenGround => {}
        Content::Course => COURSE.iter().for_each(|(thing, x, aside_m)| planter.stand(*thing, *x, *aside_m)),
    }
    planter.mesh
}

/// The ground `aside_m` to the left of the trail on the given [`side`].
pub(crate) fn spot(ground: &Ground, side: f32, x: f32, aside_m: f32) -> V3 {
    let y = ground.trail.y(x) + side * aside_m;
    v3(x, y, ground.height(x, y))
}

/// -1 where the scene of a seed is the mirror image of the usual one, otherwise 1.
pub(crate) const fn side(seed: u32) -> f32 {
    if seed.is_multiple_of(2) { -1.0 } else { 1.0 }
}

impl<'a> Planter<'a> {
    pub(crate) fn new(ground: &'a Ground, seed: u32) -> Self {
        Self { ground, mesh: Mesh::default(), rng: Rng::new(seed), side: side(seed) }
    }

    fn rural(&mut self) {
        let mut jitter = |width: f32| self.rng.range(-width, width);
        let j: [f32; 12] = core::array::from_fn(|_| jitter(0.3));
        self.fence(4.6 + j[0], 9, -2.75);
        self.wall(v3(8.9 + j[1], 3.5, 0.0), 3.2, 1.6, -0.45 + 0.4 * j[2]);
        self.boulder(5.3 + j[3], 1.45 + 0.5 * j[4], 0.62);
        self.boulder(7.4 + j[5], -1.3 + 0.4 * j[6], 0.5);
        self.boulder(10.4 + j[7], 0.9 + j[8], 0.8);
        self.bush(5.0 + 0.5 * j[11], 2.5 + 0.4 * j[0], 0.5);
        self.bush(6.9 + j[1], 2.5 + 0.5 * j[2], 0.6);
        self.bush(9.4 + j[3], -1.95 + 0.3 * j[4], 0.42);
        self.bush(13.5 + j[7], -5.0 + j[8], 1.2);
        self.bush(14.5 + j[9], 3.2 + j[10], 0.9);
        self.bush(17.5, 5.6 + j[0], 1.3);
        self.tree(7.8 + j[2], 3.1 + 0.5 * j[3], 5.2, 0.16);
        self.tree(9.2 + j[4], -4.0 + j[5], 6.2, 0.2);
        self.tree(15.5 + j[6], 5.0 + j[7], 7.0, 0.22);
        self.tree(19.0 + j[8], -6.0 + j[9], 7.6, 0.24);
        for i in 0..13 {
            let x = self.rng.range(22.0, 52.0);
            let side = if i % 2 == 0 { 1.0 } else { -1.0 };
            let s = side * (4.0 + self.rng.range(0.0, 0.42) * x);
            if i % 3 == 0 {
                self.bush(x, s, 1.5);
            } else {
                let height = self.rng.range(6.0, 10.0);
                self.tree(x, s, height, 0.25);
            }
        }
    }

    /// The ground `aside_m` to the left of the trail; to the right in a mirrored scene.
    fn spot(&self, x: f32, aside_m: f32) -> V3 {
        spot(self.ground, self.side, x, aside_m)
    }

    /// A rock that rises `height_m` above the ground.
    pub(crate) fn boulder(&mut self, x: f32, aside_m: f32, height_m: f32) {
        self.mesh.begin(V3::UP, true);
        let radii = v3(self.rng.range(0.6, 0.85), self.rng.range(0.65, 0.95), 0.82) * height_m;
        let centre = self.spot(x, aside_m) + V3::UP * (0.3 * height_m);
        self.mesh.stone(centre, radii, 26, &mut self.rng);
    }

    /// One of the things of the course, upright whatever the ground does, its foot deep enough for any slope.
    fn stand(&mut self, thing: CourseThing, x: f32, aside_m: f32) {
        let spot = self.spot(x, aside_m);
        self.mesh.begin(V3::UP, true);
        match thing {
            CourseThing::Crate => {
                let half = [v3(0.25, 0.0, 0.0), v3(0.0, 0.25, 0.0), V3::UP * 0.35];
                self.mesh.slab(spot + V3::UP * 0.15, half, Material::Wood, 1.0);
            }
            CourseThing::Post => {
                let (foot, top) = (spot - V3::UP * 0.1, spot + V3::UP * 1.2);
                self.mesh.limb(foot, top, (0.08, 0.08), 0.02, Material::Wood, &mut self.rng);
            }
        }
    }

    fn pebbles(&mut self, count: usize) {
        for _ in 0..count {
            let (x, s) = (self.rng.range(0.8, 14.0), self.rng.range(-1.5, 1.5));
            let size = self.rng.range(0.008, 0.03) + if self.rng.bits().is_multiple_of(7) { 0.03 } else { 0.0 };
            let radii = v3(self.rng.range(0.9, 1.5), self.rng.range(0.9, 1.5), 0.75) * size;
            let centre = self.spot(x, s) + V3::UP * (0.25 * size);
            self.mesh.begin(V3::UP, size > 0.03);
            self.mesh.stone(centre, radii, 4, &mut self.rng);
        }
    }

    pub(crate) fn bush(&mut self, x: f32, aside_m: f32, radius_m: f32) {
        let spot = self.spot(x, aside_m);
        self.mesh.begin(V3::UP, true);
        let leaf = (0.055 + 0.0025 * x).min(0.16);
        for _ in 0..3 {
            let shift =
                v3(self.rng.range(-0.5, 0.5), self.rng.range(-0.5, 0.5), self.rng.range(-0.12, 0.15)) * radius_m;
            let radii = v3(0.8, 0.8, 0.72) * (radius_m * self.rng.range(0.75, 1.0));
            let centre = spot + shift + V3::UP * (0.55 * radius_m);
            self.mesh.foliage(centre, radii, 40, 24, leaf, &mut self.rng);
        }
    }

    pub(crate) fn tree(&mut self, x: f32, aside_m: f32, height_m: f32, radius_m: f32) {
        let spot = self.spot(x, aside_m);
        self.mesh.begin(V3::UP, true);
        let near = x < 21.0;
        let lean = v3(self.rng.range(-0.25, 0.25), self.rng.range(-0.25, 0.25), 0.0);
        let fork = spot + V3::UP * (0.5 * height_m) + lean;
        let rng = &mut self.rng;
        self.mesh.limb(
            spot - V3::UP * 0.15,
            spot + V3::UP * 0.35,
            (radius_m * 1.5, radius_m),
            0.22,
            Material::Bark,
            rng,
        );
        self.mesh.limb(spot + V3::UP * 0.25, fork, (radius_m * 1.03, radius_m * 0.6), 0.12, Material::Bark, rng);
        let leaf = if near { 0.1 } else { 0.2 };
        let crowns = if near { 10 } else { 6 };
        for i in 0..crowns {
            let turn = core::f32::consts::TAU * (i as f32 + rng.range(-0.3, 0.3)) / crowns as f32;
            let (s, c) = libm::sincosf(turn);
            let reach = height_m * rng.range(0.14, 0.25);
            // The lowest leaves stay well above what a vehicle could touch.
            let rise = (0.56 * height_m).max(3.4) + height_m * rng.range(0.0, 0.3);
            let end = spot + lean + v3(c * reach, s * reach, rise);
            self.mesh.limb(fork - V3::UP * rng.range(0.0, 0.3), end, (radius_m * 0.4, 0.02), 0.1, Material::Bark, rng);
            let size = height_m * rng.range(0.09, 0.16);
            let leaves = if near { 38 } else { 18 };
            self.mesh.foliage(end, v3(1.15, 1.15, 0.85) * size, 30, leaves, leaf, rng);
        }
    }

    /// Posts 1.5 m apart with three rails, along the trail.
    pub(crate) fn fence(&mut self, x: f32, posts: usize, aside_m: f32) {
        let mut feet = Vec::with_capacity(posts);
        for i in 0..posts {
            let shift = self.rng.range(-0.04, 0.04);
            feet.push(self.spot(x + 1.5 * i as f32, aside_m + shift));
        }
        for foot in &feet {
            self.mesh.begin(V3::UP, true);
            let top = *foot + v3(self.rng.range(-0.03, 0.03), self.rng.range(-0.03, 0.03), self.rng.range(1.12, 1.2));
            self.mesh.limb(*foot - V3::UP * 0.1, top, (0.085, 0.075), 0.05, Material::Wood, &mut self.rng);
        }
        for pair in feet.windows(2) {
            for height in [0.38, 0.68, 0.98] {
                let from = pair[0] + v3(0.0, 0.09 * self.side, height + self.rng.range(-0.03, 0.03));
                let to = pair[1] + v3(0.0, 0.09 * self.side, height + self.rng.range(-0.03, 0.03));
                let along = to - from;
                let direction = along.unit();
                self.mesh.begin(direction, true);
                let side = v3(-direction.y, direction.x, 0.0).unit();
                let up = direction.cross(side);
                let half = [along * 0.53, side * 0.02, up * self.rng.range(0.065, 0.08)];
                let tint = self.rng.range(0.8, 1.15);
                self.mesh.slab((from + to) * 0.5, half, Material::Wood, tint);
            }
        }
    }

    /// A plastered wall under a coping; `turn` is its bearing from across the trail, radians.
    pub(crate) fn wall(&mut self, at: V3, length_m: f32, height_m: f32, turn: f32) {
        let foot = self.spot(at.x, at.y);
        let (s, c) = libm::sincosf(turn * self.side);
        let (along, through) = (v3(s, c, 0.0), v3(c, -s, 0.0));
        self.mesh.begin(along, true);
        let middle = foot + V3::UP * (0.5 * height_m - 0.1);
        let half = [along * (0.5 * length_m), V3::UP * (0.5 * height_m + 0.1), through * 0.13];
        self.mesh.slab(middle, half, Material::Plaster, 1.0);
        // The coping is of single slabs, never quite in line.
        let slabs = (length_m / 0.57) as usize;
        let part = length_m / slabs as f32;
        for i in 0..slabs {
            let shift = along * ((i as f32 + 0.5) * part - 0.5 * length_m) + V3::UP * self.rng.range(-0.006, 0.006);
            let middle = foot + shift + V3::UP * (height_m + 0.03);
            let half = [along * (part * 0.492), V3::UP * 0.035, through * self.rng.range(0.165, 0.18)];
            let tint = self.rng.range(0.85, 1.1);
            self.mesh.slab(middle, half, Material::Coping, tint);
        }
    }

    fn grass(&mut self, tufts: usize) {
        for _ in 0..tufts {
            // Denser where the camera passes close by.
            let near = self.rng.range(0.0, 1.0);
            let x = 0.6 + 19.0 * near * near.sqrt();
            let s = self.rng.range(-1.0, 1.0) * (2.4 + 0.5 * x);
            let middle = s.abs() < 0.3;
            if !middle && s.abs() < 1.05 + self.rng.range(-0.1, 0.5) {
                continue;
            }
            self.mesh.begin(V3::UP, false);
            let tall = if middle { self.rng.range(0.03, 0.06) } else { self.rng.range(0.05, 0.13) };
            let tint = self.rng.range(0.75, 1.25);
            let width = 0.006 + 0.0011 * x;
            let count = if x < 6.0 { 26 } else { 16 };
            for _ in 0..count {
                let spread = 0.35 * tall + 0.04;
                let (dx, dy) = (self.rng.range(-spread, spread), self.rng.range(-spread, spread));
                let root = self.spot(x + dx, s + dy) - V3::UP * 0.01;
                let lean = v3(dx + self.rng.range(-0.03, 0.03), dy + self.rng.range(-0.03, 0.03), 0.0);
                let tip = root + lean * 0.9 + V3::UP * (tall * self.rng.range(0.6, 1.1));
                let shade = tint * self.rng.range(0.75, 1.3);
                self.mesh.blade(root, tip, width, shade);
            }
        }
    }
}
