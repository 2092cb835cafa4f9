//! The things of the scene as triangles and leaves.

use super::bvh::Shape;
use super::noise::{Rng, noise3};
use super::vector::{V3, v3};

/// What a surface is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Material {
    Rock,
    Bark,
    Leaf,
    /// The inside of a leafy body: leaves upon leaves.
    Thicket,
    Blade,
    Wood,
    Plaster,
    Coping,
}

/// What belongs to a [`Shape`] besides its corners.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Skin {
    /// Normals at the three corners.
    pub(crate) normals: [V3; 3],
    pub(crate) material: Material,
    /// Number of the object.
    pub(crate) object: u16,
    /// Brightness over that of the material.
    pub(crate) tint: f32,
}

/// What belongs to an object as a whole.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Object {
    /// Direction of the grain.
    pub(crate) grain: V3,
    /// Whether it throws a shadow that can be told from that of its neighbours.
    pub(crate) shadow: bool,
}

/// Shapes under construction.
#[derive(Debug, Default)]
pub(crate) struct Mesh {
    pub(crate) shapes: Vec<Shape>,
    pub(crate) skins: Vec<Skin>,
    pub(crate) objects: Vec<Object>,
}

impl Mesh {
    /// Begins an object: what is added from now on belongs to it.
    pub(crate) fn begin(&mut self, grain: V3, shadow: bool) {
        self.objects.push(Object { grain, shadow });
    }

    fn add(&mut self, corners: [V3; 3], normals: [V3; 3], parallelogram: bool, material: Material, tint: f32) {
        let id = self.shapes.len() as u32;
        let [corner, a, b] = corners;
        self.shapes.push(Shape { corner, side_a: a - corner, side_b: b - corner, parallelogram, id });
        let object = self.objects.len().saturating_sub(1) as u16;
        self.skins.push(Skin { normals, material, object, tint });
    }

    /// A curved sheet over `0..=1` x `0..=1`, with normals on the side of `du x dv`.
    fn sheet(&mut self, nu: usize, nv: usize, material: Material, tint: f32, f: impl Fn(f32, f32) -> V3) {
        let (rows, columns) = (nv + 3, nu + 3);
        let mut points = Vec::with_capacity(rows * columns);
        for j in 0..rows {
            for i in 0..columns {
                // One node beyond each edge, so that sheets that touch have the same normals there.
                points.push(f((i as f32 - 1.0) / nu as f32, (j as f32 - 1.0) / nv as f32));
            }
        }
        let at = |i: usize, j: usize| points[j * columns + i];
        let normal = |i: usize, j: usize| (at(i + 1, j) - at(i - 1, j)).cross(at(i, j + 1) - at(i, j - 1)).unit();
        for j in 1..=nv {
            for i in 1..=nu {
                let p = [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)];
                let n = [normal(i, j), normal(i + 1, j), normal(i, j + 1), normal(i + 1, j + 1)];
                self.add([p[0], p[1], p[2]], [n[0], n[1], n[2]], false, material, tint);
                self.add([p[3], p[2], p[1]], [n[3], n[2], n[1]], false, material, tint);
            }
        }
    }

    /// A closed body: the six sides of a cube, blown up to the points `f(direction)`.
    fn ball(&mut self, n: usize, material: Material, tint: f32, f: impl Fn(V3) -> V3) {
        let sides = [
            (v3(1.0, 0.0, 0.0), v3(0.0, 1.0, 0.0), v3(0.0, 0.0, 1.0)),
            (v3(-1.0, 0.0, 0.0), v3(0.0, -1.0, 0.0), v3(0.0, 0.0, 1.0)),
            (v3(0.0, 1.0, 0.0), v3(-1.0, 0.0, 0.0), v3(0.0, 0.0, 1.0)),
            (v3(0.0, -1.0, 0.0), v3(1.0, 0.0, 0.0), v3(0.0, 0.0, 1.0)),
            (v3(0.0, 0.0, 1.0), v3(1.0, 0.0, 0.0), v3(0.0, 1.0, 0.0)),
            (v3(0.0, 0.0, -1.0), v3(-1.0, 0.0, 0.0), v3(0.0, 1.0, 0.0)),
        ];
        for (out, right, up) in sides {
            self.sheet(n, n, material, tint, |u, v| f((out + right * (2.0 * u - 1.0) + up * (2.0 * v - 1.0)).unit()));
        }
    }

    /// A weathered stone: an ellipsoid cut by planes and roughened.
    pub(crate) fn stone(&mut self, centre: V3, radii: V3, detail: usize, rng: &mut Rng) {
        let seed = rng.bits();
        let tint = rng.range(0.85, 1.15);
        let mut cuts = [(V3::UP, 1.0); 9];
        for cut in &mut cuts {
            *cut = (rng.direction(), rng.range(0.68, 0.92));
        }
        self.ball(detail, Material::Rock, tint, |direction| {
            let mut r = 1.0 + 0.13 * noise3(direction * 1.4, seed).0;
            for (normal, distance) in cuts {
                let c = direction.dot(normal);
                if c > 0.05 {
                    r = r.min(distance / c);
                }
            }
            r += 0.06 * noise3(direction * 3.1, seed ^ 1).0 + 0.03 * noise3(direction * 7.3, seed ^ 2).0;
            centre + direction.scaled(radii) * r
        });
    }

    /// A round, tapering limb.
    pub(crate) fn limb(&mut self, from: V3, to: V3, radii: (f32, f32), rough: f32, material: Material, rng: &mut Rng) {
        let along = to - from;
        let (a, b) = along.unit().across();
        let seed = rng.bits();
        let tint = rng.range(0.9, 1.1);
        let (nu, nv) = if radii.0 > 0.05 { (20, 12) } else { (6, 3) };
        self.sheet(nu, nv, material, tint, |u, v| {
            let (s, c) = libm::sincosf(u * core::f32::consts::TAU);
            let ring = b * s + a * c;
            let axis = from + along * v.min(1.0);
            let bulge = 1.0
                + rough * noise3(ring * 1.7 + axis * 1.2, seed).0
                + 0.5 * rough * noise3(axis * 4.0 + ring * 4.0, seed).0;
            // The last ring closes the end.
            let r = if v > 0.999 { 0.002 } else { radii.0 + (radii.1 - radii.0) * v };
            axis + ring * (r * bulge)
        });
    }

    /// A box with its middle, its half sides (each a direction times half a length).
    pub(crate) fn slab(&mut self, middle: V3, half: [V3; 3], material: Material, tint: f32) {
        for axis in 0..3 {
            let (out, a, b) = (half[axis], half[(axis + 1) % 3], half[(axis + 2) % 3]);
            for side in [1.0, -1.0] {
                let corner = middle + out * side - a - b;
                let n = out.unit() * side;
                self.add([corner, corner + a * 2.0, corner + b * 2.0], [n, n, n], true, material, tint);
            }
        }
    }

    /// A heap of leaves around `clumps` twigs on the shell of an ellipsoid, with a dark inside.
    pub(crate) fn foliage(&mut self, centre: V3, radii: V3, clumps: usize, leaves: usize, leaf_m: f32, rng: &mut Rng) {
        let seed = rng.bits();
        let body_tint = rng.range(0.85, 1.2);
        self.ball(12, Material::Thicket, 0.8, |d| {
            centre + d.scaled(radii) * (0.6 + 0.16 * noise3(d * 2.6, seed).0 + 0.07 * noise3(d * 6.3, seed).0)
        });
        let mean = (radii.x + radii.y + radii.z) / 3.0;
        let clump_m = (mean * 1.9 / (clumps as f32).sqrt()).max(leaf_m);
        for _ in 0..clumps {
            let d = rng.direction();
            let middle = centre + d.scaled(radii) * (rng.range(0.6, 0.98) + 0.12 * noise3(d * 2.6, seed).0);
            let tint = body_tint * rng.range(0.78, 1.2);
            for _ in 0..leaves {
                let mut out = rng.direction();
                if out.dot(d) < -0.2 {
                    out = -out;
                }
                let at = middle + out * (clump_m * rng.range(0.45, 1.0));
                let face = (out * 1.1 + rng.direction() + V3::UP * 0.4).unit();
                let (a, b) = face.across();
                let (s, c) = libm::sincosf(rng.range(0.0, core::f32::consts::TAU));
                let size = leaf_m * rng.range(0.7, 1.25);
                let (long, wide) = ((a * c + b * s) * (size * 0.5), (b * c - a * s) * (size * 0.28));
                // Light goes round a leafy body more softly than single leaves would have it.
                let n = (face + out * 0.9 + d * 0.7).unit();
                let tip = at - long;
                self.add([tip, at + wide, at - wide], [n, n, n], true, Material::Leaf, tint * rng.range(0.8, 1.2));
            }
        }
    }

    /// A blade of grass.
    pub(crate) fn blade(&mut self, root: V3, tip: V3, width_m: f32, tint: f32) {
        let along = tip - root;
        let aside = v3(-along.y, along.x, 0.02).unit() * (width_m * 0.5);
        let n = (aside.cross(along).unit() * 0.4 + V3::UP).unit();
        self.add([root - aside, root + aside, tip], [n, n, n], false, Material::Blade, tint);
    }
}
