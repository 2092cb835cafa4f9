//! Surfaces that are found in bands against those that are found in one pass.

use super::*;
use crate::bands::{Job, OneThread, Workers};

/// Does nothing of what it is given: the caller must.
struct Idle;

impl Workers for Idle {
    fn run<J: Job>(&mut self, _: &mut [J]) {}
}

/// How often the table was full.
fn check<const SURFACES: usize>(seed: u64, bands: usize, rounds: usize) -> usize {
    let mut random = Random::seeded("surfaces in bands", seed);
    let (depth, rays) = (depth(), rays());
    let [mut whole, mut cut] = [0; 2].map(|_| Box::new(Surfaces::<{ WIDTH * HEIGHT }, SURFACES>::new()));
    let mut works: Vec<Box<TileWork>> = (1..bands).map(|_| Box::new(TileWork::new())).collect();
    let mut full = 0;
    for round in 0..rounds {
        let mut input = RandomPicture::new(&mut random);
        input.settings.min_pixels = 16;
        if whole.configure(&input.settings, input.width, input.height).is_err() {
            continue;
        }
        cut.configure(&input.settings, input.width, input.height).unwrap();
        let expected = whole.run(input.picture(), &depth, &rays);
        full += usize::from(expected.dropped > 0);
        let mut works: Vec<&mut TileWork> = works.iter_mut().map(|work| &mut **work).collect();
        let found = if round % 2 == 0 {
            cut.run_in_bands(input.picture(), &depth, &rays, &mut works, &mut OneThread)
        } else {
            cut.run_in_bands(input.picture(), &depth, &rays, &mut works, &mut Idle)
        };
        let what = std::format!("round {round}, {bands} bands: {} x {}", input.width, input.height);
        assert_eq!(found, expected, "{what}");
        assert!(cut.table() == whole.table(), "{what}");
        assert!(cut.tiles == whole.tiles, "{what}");
        assert!(labels::places(&cut, &input) == labels::places(&whole, &input), "{what}");
        // A picture of another size has no surface, and those of the one before are forgotten.
        let fewer = DisparityPicture::new(&input.pixels[input.width..], input.width);
        let found = cut.run_in_bands(fewer, &depth, &rays, &mut works, &mut OneThread);
        assert_eq!((found, cut.table()), (SurfaceReport::default(), &[][..]), "{what}");
    }
    full
}

#[test]
fn bands_find_the_surfaces_that_one_pass_finds() {
    for (bands, seed) in [(1, 0x5eed_0105), (2, 0x5eed_0106), (3, 0x5eed_0107), (5, 0x5eed_0108)] {
        assert_eq!(check::<1024>(seed, bands, 300), 0, "there is room for all");
        assert!(check::<24>(seed, bands, 300) > 5, "{bands} bands: the table was never full");
    }
}

/// The same, so quick that it is among the first that a mistake meets.
#[test]
fn bands_find_the_surfaces_of_a_few_pictures() {
    assert_eq!(check::<1024>(0x5eed_010a, 3, 8), 0);
}
