//! Pictures of any size to those of the image.

use fencepost_core::geometry::{CameraModel, RawPair, RectifiedPair, StereoCalibration};

/// A crop from the middle that is shrunk by the same factor both ways. Pictures that fit are left alone.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shrink {
    given: (usize, usize),
    pub(super) wanted: (usize, usize),
    /// Given pixels for one wanted pixel.
    factor: f32,
    /// Upper left corner of the crop.
    first: (f32, f32),
}

impl Shrink {
    /// From pictures of `given` to such that fit into `largest`.
    pub(super) fn new(given: (usize, usize), largest: (usize, usize)) -> Self {
        let [across, down] =
            [(given.0, largest.0), (given.1, largest.1)].map(|(given, most)| given as f32 / most as f32);
        let factor = across.min(down).max(1.0);
        let [width, height] = [(given.0, largest.0), (given.1, largest.1)]
            .map(|(given, most)| ((given as f32 / factor).round() as usize).min(most));
        let middle = |given: usize, wanted: usize| ((given as f32 - wanted as f32 * factor) / 2.0).max(0.0);
        Self { given, wanted: (width, height), factor, first: (middle(given.0, width), middle(given.1, height)) }
    }

    /// The picture, each pixel the mean of the area that it covers.
    pub(super) fn picture(&self, pixels: &[u8]) -> Vec<u8> {
        let columns: Vec<_> = (0..self.wanted.0).map(|x| self.covered(x, self.first.0, self.given.0)).collect();
        let rows = (0..self.wanted.1).map(|y| self.covered(y, self.first.1, self.given.1));
        rows.flat_map(|row| {
            let mean = |column: &Vec<(usize, f32)>| {
                let pixel = |&(y, height): &(usize, f32)| {
                    column
                        .iter()
                        .map(|&(x, width)| f32::from(pixels[y * self.given.0 + x]) * width * height)
                        .sum::<f32>()
                };
                row.iter().map(pixel).sum::<f32>().round() as u8
            };
            columns.iter().map(mean).collect::<Vec<u8>>()
        })
        .collect()
    }

    /// Given pixels under wanted pixel `at`, with their shares.
    fn covered(&self, at: usize, first: f32, given: usize) -> Vec<(usize, f32)> {
        let from = first + at as f32 * self.factor;
        let to = (from + self.factor).min(given as f32);
        let share = |pixel: usize| (to.min((pixel + 1) as f32) - from.max(pixel as f32)) / (to - from);
        (from as usize..(to.ceil() as usize).min(given)).map(|pixel| (pixel, share(pixel))).collect()
    }

    /// The cameras that would have taken the pictures so.
    pub(super) fn calibration(&self, calibration: &StereoCalibration) -> StereoCalibration {
        let (width, height) = (self.wanted.0 as u32, self.wanted.1 as u32);
        // Places are counted from the centres of pixels.
        let place = |x: f32, first: f32| (x + 0.5 - first) / self.factor - 0.5;
        match calibration {
            StereoCalibration::Rectified(pair) => StereoCalibration::Rectified(RectifiedPair {
                width,
                height,
                focal_px: pair.focal_px / self.factor,
                cx: place(pair.cx, self.first.0),
                cy: place(pair.cy, self.first.1),
                baseline_m: pair.baseline_m,
                disparity_offset_px: pair.disparity_offset_px / self.factor,
            }),
            StereoCalibration::Raw(pair) => {
                let camera = |camera: &CameraModel| CameraModel {
                    width,
                    height,
                    fx: camera.fx / self.factor,
                    fy: camera.fy / self.factor,
                    cx: place(camera.cx, self.first.0),
                    cy: place(camera.cy, self.first.1),
                    distortion: camera.distortion,
                };
                let (left, right) = (camera(&pair.left), camera(&pair.right));
                // Rectified cameras are chosen anew for the new pictures, unless nothing has changed.
                let rectification = pair.rectification.filter(|_| self.wanted == self.given);
                StereoCalibration::Raw(RawPair { left, right, rectification, ..*pair })
            }
        }
    }
}
