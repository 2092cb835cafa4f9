//! The pictures of the paper's Figure 11, as far as they have the camera's view.

use fencepost_core::{
    disparity::{DisparityPicture, Reason, STEPS_PER_PIXEL},
    surfaces::SurfaceClass,
};

use super::{
    Canvas,
    colours::{self, Colour, mix, object_colour, reason_colour, value_colour},
    labels::{NO_OBJECT, joined},
};
use crate::view::FrameView;

/// Steps of grey under what is painted, so that the colours of a picture fit a palette of 256: 8 kinds of pixels of 32
/// greys, 3 kinds of 64, and 16 greys beside the objects.
const REASON_STEP: u8 = 8;
const CLASS_STEP: u8 = 4;
const HIDDEN_STEP: u8 = 16;
/// Steps of the disparity's colours, for the same reason.
const DISPARITY_STEPS: f32 = 250.0;

/// Disparity in KITTI's convention: value / 256 px, 0 = none, row by row.
pub fn disparity16(disparity: DisparityPicture<'_>) -> Vec<u16> {
    const SCALE: u32 = 256 / STEPS_PER_PIXEL as u32;
    let value = |steps: u16| u16::try_from(u32::from(steps) * SCALE).unwrap_or(u16::MAX);
    disparity.pixels().iter().map(|pixel| value(pixel.steps())).collect()
}

/// Ground red, obstacle blue over the left picture; the paper, Figure 11 (g).
pub fn classes(view: &FrameView<'_>) -> Canvas {
    over_left(view, 1, |x, y, grey| class_colour(view, x, y, grey))
}

fn class_colour(view: &FrameView<'_>, x: usize, y: usize, grey: Colour) -> Colour {
    const SHARE: f32 = 0.55;
    match (view.surface_at)(x, y).map(|surface| surface.class) {
        Some(SurfaceClass::Ground) => mix(grey, colours::GROUND, SHARE),
        Some(SurfaceClass::Obstacle) => mix(grey, colours::OBSTACLE, SHARE),
        _ => grey,
    }
}

/// Paints the figures of one frame. The disparity's colours span the range searched.
#[derive(Clone, Copy, Debug)]
pub struct Figures<'a> {
    /// The frame.
    pub view: &'a FrameView<'a>,
    /// Smallest and largest disparity of the colour scale, px.
    pub scale_px: (f32, f32),
    /// Neighbours belong to one object if their disparities differ by no more, 1/16 px.
    pub step_sixteenths: u16,
}

impl Figures<'_> {
    /// (a) The left rectified picture.
    pub fn left(&self) -> Canvas {
        over_left(self.view, 1, |_, _, grey| grey)
    }

    /// (b) Disparity, blue (far) to yellow (near); dark red has none.
    pub fn disparity(&self) -> Canvas {
        let (low, high) = self.scale_px;
        let per_step = 1.0 / (f32::from(STEPS_PER_PIXEL) * (high - low).max(1.0e-3));
        let low_share = low / (high - low).max(1.0e-3);
        self.paint(|x, y| {
            let pixel = self.view.disparity.row(y)[x];
            match pixel.has_value() {
                true => {
                    let value = f32::from(pixel.steps()) * per_step - low_share;
                    value_colour((value * DISPARITY_STEPS).round() / DISPARITY_STEPS)
                }
                false => colours::NO_VALUE,
            }
        })
    }

    /// Why pixels have no disparity: a colour for each reason over the dimmed left picture.
    pub fn reasons(&self) -> Canvas {
        over_left(self.view, REASON_STEP, |x, y, grey| match self.view.disparity.row(y)[x].get() {
            Ok(_) => mix(grey, [18, 20, 24], 0.45),
            Err(Reason::OutsideValidArea) => reason_colour(Reason::OutsideValidArea),
            Err(reason) => mix(grey, reason_colour(reason), 0.72),
        })
    }

    /// (c) Dot product of each surface's normal with the vehicle's +Z: white is level.
    pub fn dot(&self) -> Canvas {
        self.surface_grey(|surface| surface.dot())
    }

    /// (d) Its cross product: white is upright.
    pub fn cross(&self) -> Canvas {
        self.surface_grey(|surface| surface.cross())
    }

    /// (e) Near-horizontal surfaces, joined over the whole picture, each object in its own colour.
    pub fn horizontal(&self) -> Canvas {
        self.objects(|class| matches!(class, SurfaceClass::Ground | SurfaceClass::Horizontal))
    }

    /// (f) Near-vertical surfaces, joined over the whole picture, each object in its own colour.
    pub fn vertical(&self) -> Canvas {
        self.objects(|class| matches!(class, SurfaceClass::Vertical | SurfaceClass::Obstacle))
    }

    /// (g) The final classification.
    pub fn classes(&self) -> Canvas {
        over_left(self.view, CLASS_STEP, |x, y, grey| class_colour(self.view, x, y, grey))
    }

    fn surface_grey(&self, value: impl Fn(&fencepost_core::surfaces::Surface) -> f32) -> Canvas {
        self.paint(|x, y| match (self.view.surface_at)(x, y) {
            Some(surface) if surface.class != SurfaceClass::Undefined => [(value(&surface) * 255.0) as u8; 3],
            _ => colours::NO_VALUE,
        })
    }

    fn objects(&self, wanted: impl Fn(SurfaceClass) -> bool) -> Canvas {
        let labels = joined(self.view, self.step_sixteenths, wanted);
        let (width, _) = self.view.size();
        over_left(self.view, HIDDEN_STEP, |x, y, grey| match labels[y * width + x] {
            NO_OBJECT => mix(grey, colours::HIDDEN, 0.8),
            object => object_colour(object, 1.0),
        })
    }

    fn paint(&self, paint: impl FnMut(usize, usize) -> Colour) -> Canvas {
        let (width, height) = self.view.size();
        Canvas::from_fn(width, height, paint)
    }
}

/// Paints over the left picture, whose grey values are rounded down to multiples of `step`.
fn over_left(view: &FrameView<'_>, step: u8, mut paint: impl FnMut(usize, usize, Colour) -> Colour) -> Canvas {
    let (width, height) = view.size();
    Canvas::from_fn(width, height, |x, y| {
        let grey = view.left.row(y).get(x).copied().unwrap_or_default();
        paint(x, y, [grey - grey % step; 3])
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        paint::{canvas::tests::read_png, grey16_png},
        view::testing::MadeUp,
    };

    #[test]
    fn disparity_files_hold_the_value_exactly() {
        MadeUp::new().view(|view| {
            let (width, height) = view.size();
            let (read_width, read_height, bytes) = read_png(&grey16_png(width, height, &disparity16(view.disparity)));
            assert_eq!((read_width, read_height), (width, height));
            for (value, pixel) in bytes.chunks_exact(2).zip(view.disparity.pixels()) {
                let px = f64::from(u16::from_be_bytes([value[0], value[1]])) / 256.0;
                assert_eq!(px, f64::from(pixel.steps()) / 16.0);
            }
        });
    }

    #[test]
    fn disparities_too_large_for_the_file_are_cut_off_and_not_wrapped() {
        let pixels = [fencepost_core::disparity::DisparityPixel::from_steps(0x7FFF)];
        assert_eq!(disparity16(DisparityPicture::new(&pixels, 1)), [u16::MAX]);
    }

    #[test]
    fn classes_are_painted_over_their_pixels_only() {
        MadeUp::new().view(|view| {
            let classes = classes(view);
            let [box_pixel, ground, sky] = [(80, 50), (20, 80), (20, 20)].map(|(x, y)| classes.get(x, y));
            assert!(box_pixel[2] > box_pixel[0] + 60, "{box_pixel:?} is not blue");
            assert!(ground[0] > ground[2] + 60, "{ground:?} is not red");
            assert_eq!(sky, [view.left.row(20)[20]; 3]);
        });
    }

    #[test]
    fn dot_is_bright_on_the_ground_and_cross_on_the_box() {
        MadeUp::new().view(|view| {
            let figures = Figures { view, scale_px: (0.0, 64.0), step_sixteenths: 16 };
            let (dot, cross) = (figures.dot(), figures.cross());
            assert!(dot.get(20, 80)[0] > 240 && dot.get(80, 50)[0] < 10);
            assert!(cross.get(20, 80)[0] < 60 && cross.get(80, 50)[0] > 240);
            assert_eq!(dot.get(20, 20), colours::NO_VALUE);
        });
    }

    #[test]
    fn objects_have_one_colour_each() {
        MadeUp::new().view(|view| {
            let labels = joined(view, 16, |class| class == SurfaceClass::Obstacle);
            let (width, _) = view.size();
            let inside: Vec<_> = (30..70).flat_map(|y| (70..90).map(move |x| (x, y))).collect();
            assert!(inside.iter().all(|(x, y)| labels[y * width + x] == 1));
            assert_eq!(labels.iter().filter(|l| **l != NO_OBJECT).count(), inside.len());
        });
    }
}
