//! The detector `ground-deviation`: what is not where the ground would be.

use super::{
    GroundDeviationSettings,
    disparity_plane::{DisparityPlane, PlaneSums},
};
use crate::{
    disparity::DisparityPicture,
    error::ConfigError,
    geometry::{RectifiedPair, VehicleFrame},
    ground::{GroundPlane, GroundSettings},
    surfaces::{CODES, SurfaceClass},
};

/// Rounds of choosing the pixels near the plane and fitting it again.
const REFINEMENTS: usize = 4;

/// Pixels that are looked at to find one with a disparity.
const TRIES: usize = 8;

/// Starts the choice of pixels: the same picture gives the same plane.
const SEED: u64 = 0x6665_6e63_6570_6f73;

/// Estimates the ground plane from the disparities alone and finds what deviates from it.
///
/// Source: the paper, section 2.3. The plane is the one of a number of planes through three pixels, and of the one that
/// the mount promises, that the most pixels agree with; it is fitted anew to those by least squares. It says which disparity each pixel
/// would have on the ground; what is nearer by more than noise explains is an obstacle.
///
/// One plane serves the whole picture, and a pixel is judged by itself: ground that bends deviates, and so does a false match.
///
/// # Bound
/// `hypotheses x samples` steps, and one pass of `width x height`.
pub struct GroundDeviation {
    settings: GroundDeviationSettings,
    ground: GroundSettings,
    pair: Option<(RectifiedPair, VehicleFrame)>,
    height_known: bool,
    /// Distance of the samples in columns and rows, px.
    stride: usize,
}

/// The plane of the ground in the disparity picture, and how far its pixels scatter around it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GroundDisparity {
    plane: DisparityPlane,
    /// Standard deviation, 1/16 px.
    noise_steps: f32,
}

/// Classes of pixels.
const OTHER: u8 = 0;
const GROUND: u8 = 1;
const OBSTACLE: u8 = 2;

/// The classes of the surfaces that the pixels make, where the ground was seen.
pub(crate) const CLASSES: [SurfaceClass; CODES] =
    [SurfaceClass::Undefined, SurfaceClass::Ground, SurfaceClass::Vertical, SurfaceClass::Undefined];

impl GroundDeviation {
    /// A detector that is not configured and finds nothing.
    pub const fn new() -> Self {
        Self {
            settings: GroundDeviationSettings::UNSET,
            ground: GroundSettings::UNSET,
            pair: None,
            height_known: false,
            stride: 0,
        }
    }

    /// Takes settings and cameras; of the settings of the ground the limits of tilt and height and the least support count.
    ///
    /// # Errors
    /// The first setting that cannot be used, named `ground_deviation.*`.
    pub fn configure(
        &mut self,
        settings: &GroundDeviationSettings,
        ground: &GroundSettings,
        pair: &RectifiedPair,
        frame: &VehicleFrame,
        height_known: bool,
    ) -> Result<(), ConfigError> {
        settings.check()?;
        self.settings = *settings;
        self.ground = *ground;
        self.pair = Some((*pair, *frame));
        self.height_known = height_known;
        let (width, height) = (pair.width as usize, pair.height as usize);
        let along = |length: usize, stride: &usize| {
            (length / (*stride).max(1)).saturating_add(usize::from(!length.is_multiple_of(*stride)))
        };
        let fits = |stride: &usize| {
            along(width, stride).saturating_mul(along(height, stride)) <= usize::from(settings.samples)
        };
        self.stride = (1..=width.max(height).max(1)).find(fits).unwrap_or(1);
        Ok(())
    }

    /// The ground that the most pixels agree on, in the picture and in the world; `None` where no plane that can be ground has
    /// the support that it needs.
    pub(crate) fn ground(&self, picture: DisparityPicture<'_>) -> Option<(GroundDisparity, GroundPlane)> {
        let (pair, frame) = self.pair?;
        let centre = centre(&pair);
        let tolerance = 16.0 * self.settings.fit_tolerance_px;
        let mut best: Option<(u32, DisparityPlane)> = None;
        let mut attempt = |plane: DisparityPlane| {
            if self.plausible(&plane).is_none() {
                return;
            }
            let near = |&(u, v, steps): &(i32, i32, u16)| off(&plane, u, v, steps).abs() <= tolerance;
            let support = self.samples(picture).filter(near).fold(0u32, |support, _| support.saturating_add(1));
            if best.is_none_or(|(most, _)| support > most) {
                best = Some((support, plane));
            }
        };
        if self.height_known {
            let mount = GroundPlane::of_mount(&frame);
            attempt(DisparityPlane::of_ground(mount.normal, mount.camera_height_m, &pair, &frame, centre));
        }
        let mut random = Choice(SEED);
        for _ in 0..self.settings.hypotheses {
            let mut sums = PlaneSums::default();
            for _ in 0..3 {
                if let Some((u, v, steps)) = self.choose(picture, &mut random) {
                    sums.add(u, v, steps);
                }
            }
            if let Some((plane, _)) = sums.fit() {
                attempt(plane);
            }
        }
        let (_, mut plane) = best?;
        let mut found = None;
        for round in 0..REFINEMENTS {
            // A plane through three pixels is a rough one.
            let tolerance = if round == 0 { 2.0 * tolerance } else { tolerance };
            let mut sums = PlaneSums::default();
            for (u, v, steps) in
                self.samples(picture).filter(|&(u, v, steps)| off(&plane, u, v, steps).abs() <= tolerance)
            {
                sums.add(u, v, steps);
            }
            let (fitted, squares) = sums.fit()?;
            plane = fitted;
            found = Some((sums.n, squares));
        }
        let (samples, squares) = found?;
        let (normal, camera_height_m) = self.plausible(&plane)?;
        // Samples at the edge of the picture stand for fewer pixels than others.
        let pixels = pair.width.saturating_mul(pair.height);
        let each = self.stride.saturating_mul(self.stride) as u32;
        let support = u32::try_from(samples).unwrap_or(u32::MAX).saturating_mul(each).min(pixels);
        if (support as f32) < self.ground.min_support_permille * 1.0e-3 * pixels as f32 {
            return None;
        }
        let origin = frame.origin_m();
        let offset_m = normal[0] * origin[0] + normal[1] * origin[1] + normal[2] * origin[2] - camera_height_m;
        let noise_steps = libm::sqrtf(squares);
        let world = GroundPlane {
            support,
            rms_m: rms_m(&plane, noise_steps, self.samples(picture), tolerance, camera_height_m, &pair),
            ..GroundPlane::new(normal, offset_m, &frame)
        };
        Some((GroundDisparity { plane, noise_steps }, world))
    }

    /// The disparities that the mount promises, where the ground was not seen.
    pub(crate) fn of_mount(&self) -> Option<GroundDisparity> {
        let (pair, frame) = self.pair?;
        let mount = GroundPlane::of_mount(&frame);
        let plane = DisparityPlane::of_ground(mount.normal, mount.camera_height_m, &pair, &frame, centre(&pair));
        Some(GroundDisparity { plane, noise_steps: 0.0 })
    }

    /// Gives each pixel its class: on the ground, nearer than the ground, or neither.
    pub(crate) fn classify(&self, picture: DisparityPicture<'_>, ground: &GroundDisparity, codes: &mut [u8]) {
        let Some((pair, _)) = self.pair else { return };
        let centre = centre(&pair);
        let limit = (16.0 * self.settings.deviation_px).max(self.settings.deviation_sigmas * ground.noise_steps);
        let mut rows = codes.chunks_exact_mut(picture.width().max(1));
        for y in 0..picture.height() {
            let Some(codes) = rows.next() else { break };
            let v = y as f32 - centre.1;
            let row = picture.row(y);
            for ((x, pixel), code) in (0..row.len()).zip(row).zip(codes) {
                let deviation = f32::from(pixel.steps()) - ground.plane.steps_at(x as f32 - centre.0, v);
                *code = match deviation {
                    _ if !pixel.has_value() => OTHER,
                    d if d > limit => OBSTACLE,
                    d if d >= -limit => GROUND,
                    _ => OTHER,
                };
            }
        }
    }

    /// Normal of a plane and distance of the camera from it, if it can be the ground.
    fn plausible(&self, plane: &DisparityPlane) -> Option<([f32; 3], f32)> {
        let (pair, frame) = self.pair?;
        let (normal, camera_height_m) = plane.in_world(&pair, &frame, centre(&pair))?;
        let level = normal[2] >= libm::cosf(self.ground.max_tilt_deg.to_radians());
        let off = (camera_height_m - frame.camera_height_m()).abs();
        let height = if self.height_known { off <= self.ground.height_tolerance_m } else { camera_height_m > 0.05 };
        // A tolerance that is larger than the height lets in what lies above a camera.
        (level && height && camera_height_m > 0.0).then_some((normal, camera_height_m))
    }

    /// Pixels with a disparity, evenly spread: column and row from the centre, and the disparity in 1/16 px.
    fn samples<'a>(&self, picture: DisparityPicture<'a>) -> impl Iterator<Item = (i32, i32, u16)> + use<'a> {
        let (stride, (u0, v0)) = (self.stride.max(1), whole_centre(picture));
        evenly(picture.height(), stride).flat_map(move |y| {
            let row = picture.row(y);
            evenly(row.len(), stride).filter_map(move |x| {
                let pixel = row.get(x).filter(|pixel| pixel.has_value())?;
                Some((from_centre(x, u0), from_centre(y, v0), pixel.steps()))
            })
        })
    }

    /// One pixel with a disparity.
    fn choose(&self, picture: DisparityPicture<'_>, random: &mut Choice) -> Option<(i32, i32, u16)> {
        let (u0, v0) = whole_centre(picture);
        for _ in 0..TRIES {
            let (x, y) = (random.below(picture.width()), random.below(picture.height()));
            if let Some(pixel) = picture.row(y).get(x).filter(|pixel| pixel.has_value()) {
                return Some((from_centre(x, u0), from_centre(y, v0), pixel.steps()));
            }
        }
        None
    }
}

impl Default for GroundDeviation {
    fn default() -> Self {
        Self::new()
    }
}

/// Columns and rows are counted from here.
fn centre(pair: &RectifiedPair) -> (f32, f32) {
    ((pair.width / 2) as f32, (pair.height / 2) as f32)
}

fn whole_centre(picture: DisparityPicture<'_>) -> (i32, i32) {
    ((picture.width() / 2) as i32, (picture.height() / 2) as i32)
}

/// One of `stride` places among `length`, from the middle of the first stride on.
fn evenly(length: usize, stride: usize) -> impl Iterator<Item = usize> {
    let mut next = stride / 2;
    core::iter::from_fn(move || {
        let here = next;
        next = next.saturating_add(stride);
        (here < length).then_some(here)
    })
}

/// A column or row counted from the centre; pictures have at most 2^31 of either.
const fn from_centre(at: usize, centre: i32) -> i32 {
    (at as i32).wrapping_sub(centre)
}

/// How far a disparity lies off a plane, 1/16 px.
fn off(plane: &DisparityPlane, u: i32, v: i32, steps: u16) -> f32 {
    f32::from(steps) - plane.steps_at(u as f32, v as f32)
}

/// Root mean square distance of the pixels near the plane from it: a disparity that is off by a share of itself is off the ground by
/// that share of the camera's height.
fn rms_m(
    plane: &DisparityPlane,
    noise_steps: f32,
    samples: impl Iterator<Item = (i32, i32, u16)>,
    tolerance: f32,
    camera_height_m: f32,
    pair: &RectifiedPair,
) -> f32 {
    let offset = 16.0 * pair.disparity_offset_px;
    let (mut n, mut sum) = (0u32, 0.0_f32);
    for (_, _, steps) in samples.filter(|&(u, v, steps)| off(plane, u, v, steps).abs() <= tolerance) {
        let share = noise_steps / (f32::from(steps) + offset).max(1.0);
        n = n.saturating_add(1);
        sum += share * share;
    }
    camera_height_m * libm::sqrtf(sum / n.max(1) as f32)
}

/// Repeatable choice: SplitMix64 (Steele, Lea, Flood: *Fast splittable pseudorandom number generators*, 2014).
struct Choice(u64);

impl Choice {
    /// A number below `n`, 0 for none.
    fn below(&mut self, n: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^= z >> 31;
        ((z >> 32).wrapping_mul(n as u64) >> 32) as usize
    }
}

#[cfg(test)]
#[path = "tests/ground_deviation.rs"]
mod tests;
