//! The detector `pixel-normals`: a plane around every pixel.

use super::{
    PixelNormalSettings,
    disparity_plane::DisparityPlane,
    window::{ColumnSums, move_columns, windows},
};
use crate::{
    disparity::{DisparityPicture, DisparityPixel},
    error::{ConfigError, ConfigProblem},
    geometry::{DepthTable, RectifiedPair, VehicleFrame},
    surfaces::{CODES, SurfaceClass, SurfaceSettings},
};

/// Gives every pixel a class by the normal of the plane through the disparities around it.
///
/// Source: Murray's method as the paper tells it in sections 2.3 and 4.3: a surface fitted to the neighbourhood of each
/// pixel, and the normal as the criterion of segmentation. What took him minutes takes milliseconds here: the plane is fitted in the
/// disparity picture, where its sums are small whole numbers that slide along rows and columns, so the cost of a pixel is the
/// same for every window.
///
/// The window takes in all pixels with a disparity. One that lies across an edge does not fit a plane; its pixel takes the class of
/// the nearest pixel on the same surface whose window does, at most as many steps along columns and rows away as lie between the
/// middle of a window and its corner. That way an edge is told as sharply as
/// the disparities have it.
///
/// # Bound
/// Four passes of `width x height` steps.
pub struct PixelNormals<const WIDTH: usize> {
    settings: PixelNormalSettings,
    step_sixteenths: u16,
    /// Squares of the cosines of the limits of the classes.
    least_of_horizontal: f32,
    most_of_vertical: f32,
    columns: [ColumnSums; WIDTH],
}

/// Classes of pixels: those of the surfaces that they make.
pub(crate) const CLASSES: [SurfaceClass; CODES] =
    [SurfaceClass::Undefined, SurfaceClass::Horizontal, SurfaceClass::Slanted, SurfaceClass::Vertical];

const NONE: u8 = 0;
const HORIZONTAL: u8 = 1;
const SLANTED: u8 = 2;
const VERTICAL: u8 = 3;

/// The class of a pixel lies in the lowest bits, above it how many pixels away it was taken from.
const CLASS_MASK: u8 = 3;
const ONE_AWAY: u8 = CLASS_MASK + 1;

impl<const WIDTH: usize> PixelNormals<WIDTH> {
    /// A detector that is not configured.
    pub const fn new() -> Self {
        Self {
            settings: PixelNormalSettings::UNSET,
            step_sixteenths: 0,
            least_of_horizontal: 0.0,
            most_of_vertical: 0.0,
            columns: [ColumnSums::ZERO; WIDTH],
        }
    }

    /// Takes settings and the width of the pictures; of the settings of the surfaces the step and the angles count here.
    ///
    /// # Errors
    /// The first setting that cannot be used, named `pixel_normals.*`.
    pub fn configure(
        &mut self,
        settings: &PixelNormalSettings,
        surfaces: &SurfaceSettings,
        width: usize,
    ) -> Result<(), ConfigError> {
        settings.check()?;
        if width > WIDTH {
            let problem = ConfigProblem::OverCapacity { needed: width, capacity: WIDTH };
            return Err(ConfigError::new("calibration.width", problem));
        }
        let square = |degrees: f32| {
            let cos = libm::cosf(degrees.to_radians());
            cos * cos
        };
        self.settings = *settings;
        self.step_sixteenths = surfaces.step_sixteenths;
        self.least_of_horizontal = square(surfaces.horizontal_deg);
        self.most_of_vertical = square(surfaces.vertical_deg);
        Ok(())
    }

    /// Gives each pixel of `picture`, which has the configured width, its class.
    pub(crate) fn classify<const DISPARITIES: usize>(
        &mut self,
        picture: DisparityPicture<'_>,
        pair: &RectifiedPair,
        frame: &VehicleFrame,
        depth: &DepthTable<DISPARITIES>,
        codes: &mut [u8],
    ) {
        let width = picture.width().min(WIDTH);
        let steps_of = |pixel: &DisparityPixel| {
            let steps = pixel.steps();
            if depth.inverse(steps) != 0 { steps } else { 0 }
        };
        let steps = |x: usize, y: Option<usize>| y.and_then(|y| picture.row(y).get(x)).map_or(0, steps_of);
        let radius = self.settings.window / 2;
        // Of a window of up to 21 x 21 pixels: far from the limits of the numbers.
        let (edge, percent) = (u64::from(self.settings.window), u64::from(self.settings.min_filled_percent));
        let least = (edge.wrapping_mul(edge).wrapping_mul(percent).wrapping_add(99) / 100).max(3) as i64;
        let most_squares = 256.0 * self.settings.max_rms_px * self.settings.max_rms_px;
        let mut rows = codes.chunks_exact_mut(picture.width().max(1));
        for y in 0..picture.height() {
            let Some(codes) = rows.next() else { break };
            move_columns(self.columns.get_mut(..width).unwrap_or_default(), y, radius, steps);
            let columns = self.columns.get(..width).unwrap_or_default();
            let row = picture.row(y).iter().zip(windows(columns, radius));
            for ((x, (pixel, sums)), code) in (0..width).zip(row).zip(codes) {
                *code = NONE;
                if steps_of(pixel) == 0 || sums.n < least {
                    continue;
                }
                if let Some((plane, _)) = sums.fit().filter(|(_, squares)| *squares <= most_squares) {
                    *code = self.class(&plane, pair, frame, (x as f32, y as f32));
                }
            }
        }
        self.adopt(picture, &steps_of, codes);
    }

    /// The class of a plane around pixel `(u, v)`.
    fn class(&self, plane: &DisparityPlane, pair: &RectifiedPair, frame: &VehicleFrame, at: (f32, f32)) -> u8 {
        let [x, y, z] = plane.normal(pair, at);
        let up = frame.rows()[2];
        let dot = up[0] * x + up[1] * y + up[2] * z;
        let (dot, length) = (dot * dot, x * x + y * y + z * z);
        match dot {
            _ if length <= 0.0 => NONE,
            dot if dot >= self.least_of_horizontal * length => HORIZONTAL,
            dot if dot <= self.most_of_vertical * length => VERTICAL,
            _ => SLANTED,
        }
    }

    /// Gives pixels without a class that of the nearest pixel that has one, along pixels of contiguous disparity, forth and back.
    fn adopt(&self, picture: DisparityPicture<'_>, steps_of: &impl Fn(&DisparityPixel) -> u16, codes: &mut [u8]) {
        let (width, height, step) = (picture.width(), picture.height(), self.step_sixteenths);
        let farthest = ONE_AWAY.saturating_mul((self.settings.window & !1) as u8);
        let pixels = picture.pixels();
        let mut take = |at: usize, from: usize| {
            let (Some(&here), Some(&there)) = (codes.get(at), codes.get(from)) else { return };
            let nearer = here == NONE || here & !CLASS_MASK > (there & !CLASS_MASK).saturating_add(ONE_AWAY);
            if there == NONE || there & !CLASS_MASK >= farthest || !nearer {
                return;
            }
            let (Some(a), Some(b)) = (pixels.get(at).map(steps_of), pixels.get(from).map(steps_of)) else { return };
            let contiguous = a != 0 && b != 0 && a.abs_diff(b) <= step;
            if let Some(code) = codes.get_mut(at).filter(|_| contiguous) {
                *code = there.saturating_add(ONE_AWAY);
            }
        };
        // Places within the picture, and those beside them.
        let place = |x: usize, y: usize| y.wrapping_mul(width).wrapping_add(x);
        for y in 0..height {
            for x in 0..width {
                let at = place(x, y);
                if x > 0 {
                    take(at, at.wrapping_sub(1));
                }
                if y > 0 {
                    take(at, at.wrapping_sub(width));
                }
            }
        }
        for y in (0..height).rev() {
            for x in (0..width).rev() {
                let at = place(x, y);
                if x.wrapping_add(1) < width {
                    take(at, at.wrapping_add(1));
                }
                if y.wrapping_add(1) < height {
                    take(at, at.wrapping_add(width));
                }
            }
        }
        codes.iter_mut().for_each(|code| *code &= CLASS_MASK);
    }
}

impl<const WIDTH: usize> Default for PixelNormals<WIDTH> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
#[path = "tests/pixel_normals.rs"]
mod tests;
