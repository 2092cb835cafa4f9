//! Sliding sums against sums over every window.

use std::{vec, vec::Vec};

use super::*;
use crate::{methods::PixelNormalSettings, test_random::Random};

/// Sums over one window, pixel by pixel.
fn plain(steps: &[u16], (width, height): (usize, usize), (x, y): (usize, usize), radius: i32) -> PlaneSums {
    let mut sums = PlaneSums::default();
    for v in -radius..=radius {
        for u in -radius..=radius {
            let (column, row) = (x as i32 + u, y as i32 + v);
            let inside = column >= 0 && row >= 0 && column < width as i32 && row < height as i32;
            if inside && steps[row as usize * width + column as usize] != 0 {
                sums.add(u, v, steps[row as usize * width + column as usize]);
            }
        }
    }
    sums
}

/// Compares the sums of all windows of so many pictures for each radius; returns how many windows there were.
fn compare(pictures: u32, most: (u32, u32), random: &mut Random) -> u32 {
    let mut windows_seen = 0;
    for radius in 1..=PixelNormalSettings::MAX_WINDOW / 2 {
        for round in 0..pictures {
            let size = (1 + random.below(most.0) as usize, 1 + random.below(most.1) as usize);
            let holes = random.below(100);
            // Every other picture holds the largest disparities that there are.
            let most = if round % 2 == 0 { 0x7fff } else { 2000 };
            let steps: Vec<u16> = (0..size.0 * size.1)
                .map(|_| if random.below(100) < holes { 0 } else { 1 + random.below(most) as u16 })
                .collect();
            let mut columns = vec![ColumnSums::ZERO; size.0];
            for y in 0..size.1 {
                let at = |x: usize, y: Option<usize>| match y {
                    Some(y) if y < size.1 => steps[y * size.0 + x],
                    _ => 0,
                };
                move_columns(&mut columns, y, radius, at);
                let found: Vec<PlaneSums> = windows(&columns, radius).collect();
                assert_eq!(found.len(), size.0);
                for (x, found) in found.into_iter().enumerate() {
                    assert_eq!(found, plain(&steps, size, (x, y), i32::from(radius)), "({x}, {y}), radius {radius}");
                    windows_seen += 1;
                }
            }
        }
    }
    windows_seen
}

#[test]
fn sliding_sums_are_the_sums_of_every_window() {
    let windows = compare(12, (60, 45), &mut Random::seeded("windows", 0x5eed_0120));
    assert!(windows > 50_000, "{windows}");
}

/// The same in little time, for whoever breaks it.
#[test]
fn in_small_pictures_sliding_sums_are_those_of_every_window() {
    let windows = compare(2, (26, 26), &mut Random::seeded("small windows", 0x5eed_0134));
    assert!(windows > 1000, "{windows}");
}
