//! The stage against plain versions and known planes.

mod bands;
mod classes;
mod labels;
mod regions;
mod sums;

use std::{boxed::Box, collections::HashMap, vec, vec::Vec};

use super::*;
use crate::{disparity::Reason, geometry::RectifiedPair, test_random::Random, test_world::tile_of_blocks};

/// Largest picture of the random tests.
const WIDTH: usize = 100;
const HEIGHT: usize = 80;
const DISPARITIES: usize = 64;

/// A pair in which disparities up to 1 px have no distance.
const PAIR: RectifiedPair = RectifiedPair {
    width: WIDTH as u32,
    height: HEIGHT as u32,
    focal_px: 100.0,
    cx: 50.0,
    cy: 40.0,
    baseline_m: 0.1,
    disparity_offset_px: -1.0,
};

/// A random disparity picture: pieces of a few levels or slopes with noise and holes, or any bits at all.
struct RandomPicture {
    width: usize,
    height: usize,
    settings: SurfaceSettings,
    pixels: Vec<DisparityPixel>,
}

impl RandomPicture {
    fn new(random: &mut Random) -> Self {
        // One of four is smaller than a tile in one direction at least.
        let (most_w, most_h) = if random.below(4) == 0 { (31, 40) } else { (WIDTH as u32, HEIGHT as u32) };
        let width = 1 + random.below(most_w) as usize;
        let height = 1 + random.below(most_h) as usize;
        let settings = SurfaceSettings {
            step_sixteenths: random.below(24) as u16,
            min_pixels: 16 + random.below(30) as u16,
            ..SurfaceSettings::default()
        };
        let kind = random.below(10);
        let (levels, holes, noise) = (1 + random.below(5), random.below(60), 1 + random.below(30));
        let block = 1 + random.below(24) as usize;
        let slopes = (random.below(9) as i32 - 4, random.below(9) as i32 - 4);
        let blocks: Vec<u32> = (0..WIDTH * HEIGHT).map(|_| random.below(levels)).collect();
        let pixels = (0..width * height)
            .map(|i| {
                let (x, y) = (i % width, i / width);
                if kind == 0 {
                    return DisparityPixel::from_bits(random.next() as u16);
                }
                if random.below(100) < holes / 2 {
                    return DisparityPixel::none(Reason::ALL[random.below(7) as usize]);
                }
                let level = blocks[y / block * WIDTH + x / block] as i32 * 20;
                let slope = slopes.0 * x as i32 + slopes.1 * y as i32;
                let steps = level + slope + random.below(noise) as i32 + if kind == 1 { 0 } else { 300 };
                DisparityPixel::from_steps(steps.clamp(0, 1100) as u16)
            })
            .collect();
        Self { width, height, settings, pixels }
    }

    fn picture(&self) -> DisparityPicture<'_> {
        DisparityPicture::new(&self.pixels, self.width)
    }
}

fn depth() -> DepthTable<DISPARITIES> {
    let mut depth = DepthTable::new();
    depth.configure(&PAIR, 0, DISPARITIES as u16);
    depth
}

fn rays() -> Rays {
    let mount =
        crate::geometry::Mount { height_m: Some(1.0), pitch_down_deg: 10.0, roll_deg: 3.0, ..Default::default() };
    Rays::new(&PAIR, &crate::geometry::VehicleFrame::new(&mount).unwrap())
}

/// Whether two labellings split the pixels alike: label for label up to renaming, and the same pixels without a label.
fn same_up_to_renaming(a: &[Option<usize>], b: &[Option<usize>]) -> bool {
    let (mut forth, mut back) = (HashMap::new(), HashMap::new());
    a.len() == b.len()
        && a.iter().zip(b).all(|pair| match pair {
            (None, None) => true,
            (Some(a), Some(b)) => *forth.entry(*a).or_insert(*b) == *b && *back.entry(*b).or_insert(*a) == *a,
            _ => false,
        })
}

#[test]
fn the_comparison_of_labellings_tells_them_apart() {
    let labels = |l: &[usize]| -> Vec<Option<usize>> { l.iter().map(|&l| Some(l).filter(|&l| l > 0)).collect() };
    assert!(same_up_to_renaming(&labels(&[0, 1, 1, 2]), &labels(&[0, 7, 7, 3])));
    for other in [[1, 1, 1, 2], [0, 1, 1, 1], [0, 1, 2, 3], [0, 0, 1, 2]] {
        assert!(!same_up_to_renaming(&labels(&[0, 1, 1, 2]), &labels(&other)), "{other:?}");
    }
}
