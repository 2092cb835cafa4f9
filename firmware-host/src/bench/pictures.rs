//! The pictures that are measured on: all of them in memory, raw, in the size that is wanted.

use std::{ops::Range, path::Path};

use fencepost_core::{
    geometry::{CameraModel, Mount, RawPair, RectifiedPair, StereoCalibration},
    picture::Picture,
};
use fencepost_hal::{
    camera::{Camera, StereoPair},
    scene::{Scene, SceneOptions},
};

use super::{fit::Fit, lens};
use crate::{console::Console, error::Failure, source::Input};

/// Most pairs that are kept: more say nothing new, and a recording may have thousands.
const MOST_PAIRS: usize = 16;

/// Pairs that are rendered. A picture that comes again within three frames would be taken for a frozen one.
const RENDERED: u32 = 8;

/// Pairs in memory, and the cameras that took them.
#[derive(Clone, Debug)]
pub struct BenchPictures {
    /// Where they come from.
    pub name: String,
    /// One at least, all of one size.
    pub pairs: Vec<Pair>,
    /// A raw pair: it has to be rectified.
    pub calibration: StereoCalibration,
    /// The left camera on the vehicle.
    pub mount: Mount,
}

/// One pair of pictures.
#[derive(Clone, Debug)]
pub struct Pair {
    left: Vec<u8>,
    right: Vec<u8>,
    size: (usize, usize),
}

impl Pair {
    /// The left and the right picture.
    pub fn views(&self) -> (Picture<'_>, Picture<'_>) {
        let view = |pixels| Picture::packed(pixels, self.size.0, self.size.1).expect("pictures are made to their size");
        (view(&self.left), view(&self.right))
    }
}

impl BenchPictures {
    /// Width and height of the pictures, px.
    pub const fn size(&self) -> (u32, u32) {
        match &self.calibration {
            StereoCalibration::Rectified(pair) => (pair.width, pair.height),
            StereoCalibration::Raw(pair) => (pair.left.width, pair.left.height),
        }
    }

    /// The first frames of a recording, in the size that is wanted. Pictures that arrive rectified are seen through a lens: the
    /// detector has the same work with them as with raw ones, and finds the same in them.
    ///
    /// # Errors
    /// When it is no recording, or none of its frames can be read.
    pub fn recorded(folder: &Path, wanted: Option<(u32, u32)>, console: &mut Console) -> Result<Self, Failure> {
        let frames: Range<u32> = 0..u32::MAX;
        let mut input = Input::recording(folder, &frames)?;
        input.warnings.drain(..).for_each(|warning| console.warn(warning));
        let size = input.picture_size();
        let fit = Fit::new(size, wanted.unwrap_or(size));
        let wanted = wanted.unwrap_or(size);
        let raw = match &input.calibration {
            StereoCalibration::Rectified(pair) => lens::raw_pair(&fitted_pair(pair, fit, wanted)),
            StereoCalibration::Raw(pair) if size == wanted => *pair,
            StereoCalibration::Raw(pair) => fitted_raw(pair, fit, wanted),
        };
        let bends = matches!(input.calibration, StereoCalibration::Rectified(_));
        let places = bends.then(|| [lens::places(&raw.left), lens::places(&raw.right)]);
        let size = (wanted.0 as usize, wanted.1 as usize);
        let make = |pair: &StereoPair<'_>| {
            let [left, right] = [&pair.left, &pair.right].map(|picture| fit.picture(&pixels(picture)));
            match &places {
                None => Pair { left, right, size },
                Some([left_places, right_places]) => Pair {
                    left: lens::through(&left, size, left_places),
                    right: lens::through(&right, size, right_places),
                    size,
                },
            }
        };
        let mut pairs = Vec::new();
        let mut failure = None;
        while pairs.len() < MOST_PAIRS {
            match input.source.next_pair(make) {
                Ok(Some(pair)) => pairs.push(pair),
                Ok(None) => break,
                Err(error) => failure = failure.or(Some(Failure::from(error))),
            }
        }
        if pairs.is_empty() {
            return Err(failure.unwrap_or_else(|| Failure::work("the recording has no frame that can be read")));
        }
        if let Some(failure) = failure {
            console.warn(failure);
        }
        Ok(Self { name: input.name, pairs, calibration: StereoCalibration::Raw(raw), mount: input.mount })
    }

    /// A rendered trail, seen through lenses that distort.
    ///
    /// # Errors
    /// When the renderer does not make pictures of this size.
    pub fn rendered((width, height): (u32, u32)) -> Result<Self, Failure> {
        let ideal = SceneOptions::default();
        // The field of view of the default, whatever the size.
        let focal_px = ideal.focal_px * width as f32 / ideal.width as f32;
        let options = SceneOptions { width, height, focal_px, frames: RENDERED, ..ideal };
        let [k1, k2, p1, p2, ..] = lens::raw_pair(&options.ideal_pair()).left.distortion.0;
        let options = SceneOptions { distortion: Some([k1, k2, p1, p2]), ..options };
        let scene = Scene::new(options).map_err(|error| Failure::config(error, None))?;
        let (calibration, mount) = (scene.calibration(), scene.mount());
        let size = (width as usize, height as usize);
        let mut pairs = Vec::new();
        let mut camera = scene.into_camera();
        let make = |pair: &StereoPair<'_>| Pair { left: pixels(&pair.left), right: pixels(&pair.right), size };
        while let Ok(Some(pair)) = camera.next_pair(make) {
            pairs.push(pair);
        }
        Ok(Self { name: "a rendered trail".to_string(), pairs, calibration, mount })
    }
}

fn pixels(picture: &Picture<'_>) -> Vec<u8> {
    (0..picture.height()).flat_map(|y| picture.row(y)).copied().collect()
}

/// The cameras of pictures that were fitted to a size.
fn fitted_pair(pair: &RectifiedPair, fit: Fit, (width, height): (u32, u32)) -> RectifiedPair {
    let (cx, cy) = fit.place((pair.cx, pair.cy));
    RectifiedPair { width, height, cx, cy, ..*pair }
}

/// The same of raw ones; the rectified cameras that came with the calibration are those of the whole picture.
fn fitted_raw(pair: &RawPair, fit: Fit, (width, height): (u32, u32)) -> RawPair {
    let camera = |camera: &CameraModel| {
        let (cx, cy) = fit.place((camera.cx, camera.cy));
        CameraModel { width, height, cx, cy, ..*camera }
    };
    RawPair { left: camera(&pair.left), right: camera(&pair.right), rectification: None, ..*pair }
}
