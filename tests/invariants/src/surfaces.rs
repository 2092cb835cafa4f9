//! Disparity pictures into surfaces and regions, against flood fill over all pixels and sums in f64.

use std::cell::RefCell;

use fencepost_core::{
    disparity::{DisparityPicture, DisparityPixel},
    geometry::{DepthTable, Rays, VehicleFrame},
    surfaces::{Regions, Surface, SurfaceClass, Surfaces, TILE},
};

use crate::{
    Source,
    camera::{Camera, DISPARITIES, Eye, PIXELS, draw},
    detection::check_surface,
};

/// Surfaces: fewer than the worst of pictures have.
const CAPACITY: usize = 24;

struct Stages {
    surfaces: Surfaces<PIXELS, CAPACITY>,
    regions: Regions<CAPACITY>,
    depth: DepthTable<DISPARITIES>,
    pixels: Vec<DisparityPixel>,
    flood: Flood,
}

thread_local! {
    static STAGES: RefCell<Box<Stages>> = RefCell::new(Box::new(Stages {
        surfaces: Surfaces::new(),
        regions: Regions::new(),
        depth: DepthTable::new(),
        pixels: Vec::new(),
        flood: Flood::default(),
    }));
}

/// Runs one input.
pub fn run(bytes: &[u8]) {
    let mut source = Source::new(bytes);
    let mut camera = Camera::read(&mut source);
    if camera.pair.check().is_err() {
        return;
    }
    // Mostly a strip with a border of tiles across it, with room for surfaces on both sides: so few pixels are soon gone through.
    let (length, breadth) = ((TILE + source.one_of(&[1, 4, 8, 16])) as u32, 2 + source.below(7) as u32);
    let size = match source.byte() {
        0..120 => (length, breadth),
        120..240 => (breadth, length),
        240.. => (camera.pair.width, camera.pair.height),
    };
    (camera.pair.width, camera.pair.height) = size;
    let Ok(frame) = VehicleFrame::new(&camera.mount.without_place()) else { return };
    STAGES.with_borrow_mut(|stages| stages.check(&mut source, &camera, &frame));
}

impl Stages {
    fn check(&mut self, source: &mut Source<'_>, camera: &Camera, frame: &VehicleFrame) {
        let (width, height) = (camera.pair.width as usize, camera.pair.height as usize);
        let settings = &camera.settings.surfaces;
        let matching = &camera.settings.matching;
        let Self { surfaces, regions, depth, pixels, flood } = self;
        if surfaces.configure(settings, width, height).is_err() {
            return;
        }
        depth.configure(&camera.pair, matching.min_disparity, matching.disparities);
        draw(source, camera, pixels);
        let picture = DisparityPicture::new(pixels, width);
        let rays = Rays::new(&camera.pair, frame);
        if source.below(16) == 15 {
            let fewer = DisparityPicture::new(&pixels[..pixels.len() - width], width);
            surfaces.run(fewer, depth, &rays);
            assert!(surfaces.table().is_empty(), "surfaces in a picture of another size");
        }
        let report = surfaces.run(picture, depth, &rays);
        assert_eq!([surfaces.place_at(width, 0), surfaces.place_at(0, height)], [None; 2], "outside of the picture");

        // What hangs together, by the rule in words.
        let near = |a: usize, b: usize| {
            let [a, b] = [a, b].map(|place| pixels[place].steps());
            depth.distance_m(a) > 0.0 && depth.distance_m(b) > 0.0 && a.abs_diff(b) <= settings.step_sixteenths
        };
        let is_point = |place: usize| pixels[place].has_value() && depth.distance_m(pixels[place].steps()) > 0.0;
        flood.fill(width, height, is_point, |a, b, same_tile| same_tile && near(a, b));
        let enough = |pixels: &&u32| **pixels >= u32::from(settings.min_pixels);
        let found = flood.sizes.iter().filter(enough).count();
        assert_eq!(report.found as usize, found, "surfaces in the picture");
        assert_eq!(surfaces.table().len(), found.min(CAPACITY), "surfaces in the table");
        assert_eq!(report.dropped as usize, found - surfaces.table().len(), "surfaces that found no room");

        // Every one is in the table as a whole or not at all, and none that is smaller than one that is not.
        let mut place_of = vec![None; flood.sizes.len()];
        let mut sums = vec![Sums::default(); surfaces.table().len()];
        let eye = Eye::new(&camera.pair, &camera.mount);
        // In f64 the points take longer than the surfaces.
        let in_f64 = source.below(4) == 0;
        for (place, pixel) in pixels.iter().enumerate() {
            let (x, y) = (place % width, place / width);
            let Some(part) = flood.part(place) else {
                assert_eq!(surfaces.place_at(x, y), None, "a surface where nothing is");
                continue;
            };
            let in_table = surfaces.place_at(x, y);
            let known = place_of[part].get_or_insert(in_table);
            assert_eq!(*known, in_table, "a surface in pieces");
            if let Some(in_table) = in_table.filter(|_| in_f64) {
                let point = eye.in_pair(x, y, pixel.steps());
                sums[in_table].add(point, eye.distance_m(point));
            }
        }
        let kept = |kept: bool| {
            let parts = flood.sizes.iter().zip(&place_of);
            parts.filter(move |(_, place)| place.flatten().is_some() == kept).map(|(pixels, _)| *pixels)
        };
        let largest_dropped = kept(false).filter(|pixels| enough(&pixels)).max().unwrap_or(0);
        assert!(kept(true).min().unwrap_or(u32::MAX) >= largest_dropped, "a larger surface was dropped");
        for (surface, sums) in surfaces.table().iter().zip(&sums) {
            check_surface(surface, &camera.settings.surfaces);
            if in_f64 {
                sums.check(surface);
            }
        }

        // Joined over a picture of another size: none of them.
        if source.below(16) == 15 {
            regions.join(surfaces, DisparityPicture::new(&pixels[width..], width), |_| true);
            assert_eq!(regions.roots().count(), surfaces.table().len(), "surfaces joined over another picture");
        }
        // Joined over the whole picture: all of them, or those of one class.
        const CHOICES: [Option<SurfaceClass>; 2] = [None, Some(SurfaceClass::Vertical)];
        for only in source.one_of(&[&CHOICES[..1], &CHOICES[1..], &CHOICES]) {
            let takes_part = |surface: &Surface| only.is_none_or(|class| surface.class == class);
            regions.join(surfaces, picture, takes_part);
            let table = surfaces.table();
            let place = |pixel: usize| surfaces.place_at(pixel % width, pixel / width);
            let joins = |pixel: usize| place(pixel).is_some_and(|place| takes_part(&table[place]));
            flood.fill(
                width,
                height,
                |pixel| place(pixel).is_some(),
                |a, b, _| place(a) == place(b) || (near(a, b) && joins(a) && joins(b)),
            );
            let mut seen = [None; CAPACITY];
            let seen = &mut seen[..table.len()];
            for root in regions.roots() {
                for member in regions.members(root) {
                    assert_eq!(seen[member].replace(root), None, "a surface in two regions");
                }
            }
            assert!(seen.iter().all(Option::is_some), "a surface in no region");
            let mut region_of = vec![None; flood.sizes.len()];
            for pixel in 0..pixels.len() {
                if let (Some(part), Some(place)) = (flood.part(pixel), place(pixel)) {
                    assert_eq!(*region_of[part].get_or_insert(seen[place]), seen[place], "pieces that touch");
                }
            }
            assert_eq!(regions.roots().count(), flood.sizes.len(), "regions that do not touch are one");
        }
    }
}

/// Flood fill: parts of a picture and their pixels.
#[derive(Default)]
struct Flood {
    parts: Vec<u32>,
    sizes: Vec<u32>,
    open: Vec<usize>,
}

impl Flood {
    const NONE: u32 = u32::MAX;

    /// Finds the parts of the pixels that `counts`; `joined` says of neighbours, and whether they lie in one tile, if they hang
    /// together.
    fn fill(
        &mut self,
        width: usize,
        height: usize,
        counts: impl Fn(usize) -> bool,
        joined: impl Fn(usize, usize, bool) -> bool,
    ) {
        let Self { parts, sizes, open } = self;
        parts.clear();
        parts.resize(width * height, Self::NONE);
        sizes.clear();
        for first in 0..width * height {
            if parts[first] != Self::NONE || !counts(first) {
                continue;
            }
            let number = sizes.len() as u32;
            sizes.push(0);
            parts[first] = number;
            open.push(first);
            while let Some(place) = open.pop() {
                sizes[number as usize] += 1;
                let (x, y) = (place % width, place / width);
                let mut try_one = |inside: bool, other: usize, same_tile: bool| {
                    let fits = inside && parts[other] == Self::NONE && counts(other) && joined(place, other, same_tile);
                    if fits {
                        parts[other] = number;
                        open.push(other);
                    }
                };
                try_one(x > 0, place.wrapping_sub(1), !x.is_multiple_of(TILE));
                try_one(x + 1 < width, place + 1, !(x + 1).is_multiple_of(TILE));
                try_one(y > 0, place.wrapping_sub(width), !y.is_multiple_of(TILE));
                try_one(y + 1 < height, place + width, !(y + 1).is_multiple_of(TILE));
            }
        }
    }

    fn part(&self, place: usize) -> Option<usize> {
        (self.parts[place] != Self::NONE).then_some(self.parts[place] as usize)
    }
}

/// Mean and covariance of points, in f64.
#[derive(Clone, Copy, Default)]
struct Sums {
    n: f64,
    sum: [f64; 3],
    products: [[f64; 3]; 3],
    /// Distance of the farthest from the camera: sums in the core keep so many bits of that, not of the distance from the ground.
    farthest_m: f64,
}

impl Sums {
    fn add(&mut self, point: [f64; 3], from_camera_m: f64) {
        self.n += 1.0;
        self.farthest_m = self.farthest_m.max(from_camera_m);
        for i in 0..3 {
            self.sum[i] += point[i];
            for j in 0..3 {
                self.products[i][j] += point[i] * point[j];
            }
        }
    }

    fn variance_along(&self, v: [f64; 3]) -> f64 {
        let mean = self.sum.map(|sum| sum / self.n);
        let mut variance = 0.0;
        for i in 0..3 {
            for j in 0..3 {
                variance += v[i] * v[j] * (self.products[i][j] / self.n - mean[i] * mean[j]);
            }
        }
        variance
    }

    /// The surface is that of these points, and no mirror image of its normal fits them better.
    fn check(&self, surface: &Surface) {
        let far = self.farthest_m.max(0.1);
        assert_eq!(f64::from(surface.pixels()), self.n, "pixels");
        for i in 0..3 {
            let mean = self.sum[i] / self.n;
            let found = f64::from(surface.points.mean_m[i]);
            assert!((found - mean).abs() <= 3.0e-4 * far, "mean {i}: {found}, not {mean}");
        }
        let normal = surface.normal.map(f64::from);
        if normal == [0.0; 3] {
            return;
        }
        let tolerance = 1.0e-3 * far * far;
        let across = self.variance_along(normal);
        let told = f64::from(surface.rms_m).powi(2);
        assert!((across - told).abs() <= tolerance, "variance across the plane: {told}, not {across}");
        let [x, y, z] = normal;
        for mirrored in [[-x, y, z], [x, -y, z], [x, y, -z]] {
            let other = self.variance_along(mirrored);
            assert!(across <= other + tolerance, "{mirrored:?} fits better than {normal:?}: {other} and {across}");
        }
    }
}
