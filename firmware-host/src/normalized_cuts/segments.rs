//! Segments of a picture, and what they are.

use fencepost_core::{
    detector::Detection,
    disparity::DisparityPicture,
    geometry::DepthTable,
    planes::{Scatter, SymmetricMatrix3},
    surfaces::{Surface, SurfaceClass, SurfaceSettings},
};

use super::{NormalizedCuts, shrink::Shrunk};
use crate::detector::{CELLS, DISPARITIES, OBSTACLES};

/// One segment.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    /// Its pixels, with and without a disparity.
    pub pixels: u32,
    /// Its points in the frame of the pair, the plane through them, and the class that its tilt gives it. Where it is, the ground
    /// and the obstacles decide about it piece by piece: [`Segmentation::surface_at`].
    pub surface: Surface,
}

/// What became of a picture.
#[derive(Clone, Debug)]
pub struct Segmentation {
    /// Width and height of the picture, px.
    pub size: (usize, usize),
    /// Pixels of the picture along the edge of one pixel that was cut.
    pub factor: usize,
    /// Number of the segment of each pixel, row by row: places in `segments`.
    pub labels: Vec<u16>,
    /// The segments, in the order of their first pixels.
    pub segments: Vec<Segment>,
    /// Cells, ground and obstacles. Its health and statistics are empty: those are of the cameras.
    pub detection: Box<Detection<OBSTACLES, CELLS>>,
    /// Pieces of segments, and which of them each pixel belongs to; `u16::MAX` for none.
    pub(super) table: Vec<Surface>,
    pub(super) places: Vec<u16>,
}

impl Segmentation {
    /// The segments of a shrunk picture that was cut, in the whole picture.
    pub(super) fn of(shrunk: &Shrunk, numbers: &[u16], picture: DisparityPicture<'_>, cuts: &NormalizedCuts) -> Self {
        let (width, height) = (picture.width(), picture.height());
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let labels: Vec<u16> = places.map(|(x, y)| numbers[shrunk.place_of(x, y)]).collect();
        let count = labels.iter().max().map_or(0, |last| usize::from(*last) + 1);
        Self {
            size: (width, height),
            factor: shrunk.factor,
            segments: measure(&labels, count, picture, cuts),
            labels,
            detection: Box::new(Detection::new()),
            table: Vec::new(),
            places: Vec::new(),
        }
    }

    /// The number of the segment at column `x` and row `y`; `None` outside the picture.
    pub fn label_at(&self, x: usize, y: usize) -> Option<u16> {
        self.labels.get(y * self.size.0 + x).copied().filter(|_| x < self.size.0)
    }

    /// The piece of a segment at column `x` and row `y`, with the class that ground and obstacles gave it. Pixels without a
    /// disparity, along the borders of segments and in pieces too small for a plane have none.
    pub fn surface_at(&self, x: usize, y: usize) -> Option<Surface> {
        let place = *self.places.get(y * self.size.0 + x).filter(|_| x < self.size.0)?;
        self.table.get(usize::from(place)).copied()
    }
}

/// Fits a plane through the points of each segment and gives it a class.
fn measure(labels: &[u16], count: usize, picture: DisparityPicture<'_>, cuts: &NormalizedCuts) -> Vec<Segment> {
    let mut depth = Box::new(DepthTable::<DISPARITIES>::new());
    let matching = &cuts.core.matching;
    depth.configure(&cuts.pair, matching.min_disparity, matching.disparities);
    let points = || {
        let width = picture.width();
        labels.iter().zip(picture.pixels()).enumerate().filter_map(move |(i, (label, pixel))| {
            let point = |z_m| cuts.rays.point_m((i % width) as f32, (i / width) as f32, z_m).map(f64::from);
            Some(depth.distance_m(pixel.steps())).filter(|z| *z > 0.0).map(|z| (usize::from(*label), point(z)))
        })
    };
    // In double precision and about the mean: a segment may be a whole road.
    let mut sums = vec![(0.0, [0.0; 3]); count];
    let collected: Vec<(usize, [f64; 3])> = points().collect();
    for (label, point) in &collected {
        let (weight, sum) = &mut sums[*label];
        *weight += 1.0;
        (0..3).for_each(|k| sum[k] += point[k]);
    }
    let means: Vec<[f64; 3]> = sums.iter().map(|(weight, sum)| sum.map(|s| s / f64::max(*weight, 1.0))).collect();
    let mut squares = vec![[0.0; 6]; count];
    for (label, point) in &collected {
        let [x, y, z]: [f64; 3] = std::array::from_fn(|k| point[k] - means[*label][k]);
        let products = [x * x, x * y, x * z, y * y, y * z, z * z];
        squares[*label].iter_mut().zip(products).for_each(|(sum, product)| *sum += product);
    }
    let mut pixels = vec![0; count];
    labels.iter().for_each(|label| pixels[usize::from(*label)] += 1);
    let segment = |i: usize| {
        let (weight, _) = sums[i];
        let [xx, xy, xz, yy, yz, zz] = squares[i].map(|sum| (sum / weight.max(1.0)) as f32);
        let covariance = SymmetricMatrix3 { xx, xy, xz, yy, yz, zz };
        let points = Scatter { weight: weight as f32, mean_m: means[i].map(|m| m as f32), covariance };
        Segment { pixels: pixels[i], surface: classed(points, &cuts.core.surfaces) }
    };
    (0..count).map(segment).collect()
}

/// The plane through points, and what its tilt makes of it: the rule of the surfaces of tiles.
fn classed(points: Scatter, settings: &SurfaceSettings) -> Surface {
    let enough = points.weight >= f32::from(settings.min_pixels);
    let Some((normal, variance)) = points.plane().filter(|_| enough) else {
        return Surface { points, ..Surface::default() };
    };
    let surface = Surface { points, normal, rms_m: variance.sqrt(), class: SurfaceClass::Slanted };
    let class = match surface.dot() {
        dot if dot >= settings.horizontal_deg.to_radians().cos() => SurfaceClass::Horizontal,
        dot if dot <= settings.vertical_deg.to_radians().cos() => SurfaceClass::Vertical,
        _ => SurfaceClass::Slanted,
    };
    Surface { class, ..surface }
}
