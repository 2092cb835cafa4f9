//! A lens for pictures that arrive rectified: what it would have made of them, so that rectifying them is work as it is for raw ones.

use fencepost_core::geometry::{CameraModel, Distortion, RawPair, Rectification, RectifiedPair};

/// Distortion of a common lens, k1 and k2, for a focal length of as many pixels as the picture is wide.
const DISTORTION: [f32; 2] = [-0.2, 0.05];

/// Rounds of the fixed-point iteration that follows a ray back through the lens: at the corner of a square picture the error falls
/// by more than half with each.
const ROUNDS: usize = 24;

const IDENTITY: [[f32; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// The raw pair that sees as `pair` does, through lenses that distort.
pub(super) fn raw_pair(pair: &RectifiedPair) -> RawPair {
    let scale = pair.focal_px / pair.width as f32;
    let [k1, k2] = [DISTORTION[0] * scale.powi(2), DISTORTION[1] * scale.powi(4)];
    let camera = |cx: f32| CameraModel {
        width: pair.width,
        height: pair.height,
        fx: pair.focal_px,
        fy: pair.focal_px,
        cx,
        cy: pair.cy,
        distortion: Distortion([k1, k2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]),
    };
    RawPair {
        left: camera(pair.cx),
        right: camera(pair.cx + pair.disparity_offset_px),
        rotation: IDENTITY,
        translation_m: [-pair.baseline_m, 0.0, 0.0],
        rectification: Some(Rectification { left_rotation: IDENTITY, right_rotation: IDENTITY, pair: *pair }),
    }
}

/// For each pixel of the raw picture of `camera`, its place in the picture without distortion.
pub(super) fn places(camera: &CameraModel) -> Vec<(f32, f32)> {
    let [k1, k2, ..] = camera.distortion.0;
    let place = |x: u32, y: u32| {
        let seen = [(x as f32 - camera.cx) / camera.fx, (y as f32 - camera.cy) / camera.fy];
        let mut ray = seen;
        for _ in 0..ROUNDS {
            let s = ray[0] * ray[0] + ray[1] * ray[1];
            ray = seen.map(|c| c / (1.0 + s * (k1 + s * k2)));
        }
        (ray[0] * camera.fx + camera.cx, ray[1] * camera.fy + camera.cy)
    };
    (0..camera.height).flat_map(|y| (0..camera.width).map(move |x| place(x, y))).collect()
}

/// The picture through the lens, bilinear; beyond the edge it goes on as it ends there.
pub(super) fn through(pixels: &[u8], (width, height): (usize, usize), places: &[(f32, f32)]) -> Vec<u8> {
    let grey = |x: usize, y: usize| f32::from(pixels[y.min(height - 1) * width + x.min(width - 1)]);
    let sample = |&(x, y): &(f32, f32)| {
        let (x, y) = (x.clamp(0.0, (width - 1) as f32), y.clamp(0.0, (height - 1) as f32));
        let (left, top) = (x as usize, y as usize);
        let (right, below) = (x - left as f32, y - top as f32);
        let row = |y: usize| grey(left, y) * (1.0 - right) + grey(left + 1, y) * right;
        (row(top) * (1.0 - below) + row(top + 1) * below).round() as u8
    };
    places.iter().map(sample).collect()
}

#[cfg(test)]
mod tests {
    use fencepost_core::{
        geometry::StereoCalibration,
        picture::Picture,
        rectify::{Rectifier, Side, grid_nodes},
    };

    use super::*;

    #[test]
    fn rectifying_gives_back_what_went_through_the_lens() {
        const WIDTH: usize = 192;
        const HEIGHT: usize = 128;
        let pair = RectifiedPair {
            width: WIDTH as u32,
            height: HEIGHT as u32,
            focal_px: 150.0,
            cx: 100.0,
            cy: 50.0,
            baseline_m: 0.1,
            disparity_offset_px: 6.0,
        };
        let raw = raw_pair(&pair);
        let mut rectifier = Box::new(Rectifier::<{ grid_nodes(WIDTH, HEIGHT) }>::new());
        assert_eq!(rectifier.configure(&StereoCalibration::Raw(raw)), Ok(pair));
        // Soft waves: sampling twice takes next to nothing away from them.
        let wave = |i: usize, period: f32| (i as f32 * std::f32::consts::TAU / period).sin();
        let pixels: Vec<u8> = (0..WIDTH * HEIGHT)
            .map(|i| (128.0 + 60.0 * wave(i % WIDTH, 31.0) + 60.0 * wave(i / WIDTH, 23.0)) as u8)
            .collect();
        for (side, camera) in [(Side::Left, raw.left), (Side::Right, raw.right)] {
            let bent = through(&pixels, (WIDTH, HEIGHT), &places(&camera));
            let moved = pixels.iter().zip(&bent).filter(|(a, b)| a.abs_diff(**b) > 20).count();
            assert!(moved > WIDTH * HEIGHT / 20, "the lens distorts: {moved}");
            let view = Picture::packed(&bent, WIDTH, HEIGHT).unwrap();
            let mut row = [0; WIDTH];
            for y in 2..HEIGHT - 2 {
                assert_eq!(rectifier.row(side, &view, y, &mut row), 0..WIDTH, "all of the picture is valid");
                // At the edge itself half of what is mixed lies beyond it.
                let inner = 2..WIDTH - 2;
                let expected = &pixels[y * WIDTH..][inner.clone()];
                let worst = row[inner].iter().zip(expected).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
                assert!(worst <= 5, "{side:?}, row {y}: {worst} grey values");
            }
        }
    }
}
