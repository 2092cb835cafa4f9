//! Surfaces inside tiles, against a plain flood fill.

use super::*;

/// Surfaces by flood fill: for each pixel the number of its surface, from 0, in the order of the tiles and of the first
/// pixels; and their sizes.
pub(super) fn plain(input: &RandomPicture, has_distance: impl Fn(u16) -> bool) -> (Vec<Option<usize>>, Vec<usize>) {
    plain_coded(input, &vec![0; input.pixels.len()], has_distance)
}

/// The same where only pixels of one code make a surface.
fn plain_coded(
    input: &RandomPicture,
    codes: &[u8],
    has_distance: impl Fn(u16) -> bool,
) -> (Vec<Option<usize>>, Vec<usize>) {
    let RandomPicture { width, height, settings, pixels } = input;
    let steps = |x: usize, y: usize| Some(pixels[y * width + x].steps()).filter(|&s| s != 0 && has_distance(s));
    let mut labels = vec![None; pixels.len()];
    let mut sizes = Vec::new();
    for tile_y in (0..*height).step_by(32) {
        for tile_x in (0..*width).step_by(32) {
            let (end_x, end_y) = ((tile_x + 32).min(*width), (tile_y + 32).min(*height));
            let mut seen = vec![false; pixels.len()];
            for start_y in tile_y..end_y {
                for start_x in tile_x..end_x {
                    if seen[start_y * width + start_x] || steps(start_x, start_y).is_none() {
                        continue;
                    }
                    seen[start_y * width + start_x] = true;
                    let (mut surface, mut next) = (vec![(start_x, start_y)], 0);
                    while next < surface.len() {
                        let (x, y) = surface[next];
                        next += 1;
                        let neighbours = [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
                        for (nx, ny) in neighbours {
                            let inside = nx >= tile_x && ny >= tile_y && nx < end_x && ny < end_y;
                            if !inside || seen[ny * width + nx] {
                                continue;
                            }
                            let (Some(a), Some(b)) = (steps(x, y), steps(nx, ny)) else { continue };
                            let alike = codes[y * width + x] == codes[ny * width + nx];
                            if alike && a.abs_diff(b) <= settings.step_sixteenths {
                                seen[ny * width + nx] = true;
                                surface.push((nx, ny));
                            }
                        }
                    }
                    if surface.len() >= usize::from(settings.min_pixels) {
                        for (x, y) in &surface {
                            labels[y * width + x] = Some(sizes.len());
                        }
                        sizes.push(surface.len());
                    }
                }
            }
        }
    }
    (labels, sizes)
}

pub(super) fn places<const PIXELS: usize, const SURFACES: usize>(
    stage: &Surfaces<PIXELS, SURFACES>,
    input: &RandomPicture,
) -> Vec<Option<usize>> {
    (0..input.pixels.len()).map(|i| stage.place_at(i % input.width, i / input.width)).collect()
}

#[test]
fn numbers_and_sizes_are_those_of_a_flood_fill() {
    let mut random = Random::seeded("tile surfaces", 0x5eed_0101);
    let (depth, rays) = (depth(), rays());
    // 16 px with the offset of one: the first step with a distance.
    assert_eq!((depth.inverse(16), depth.inverse(17) > 0), (0, true));
    let mut stage = Box::new(Surfaces::<{ WIDTH * HEIGHT }, 1024>::new());
    let mut without_distance = 0;
    for round in 0..3000 {
        let input = RandomPicture::new(&mut random);
        stage.configure(&input.settings, input.width, input.height).unwrap();
        let report = stage.run(input.picture(), &depth, &rays);
        let has_distance = |steps: u16| steps > 16 && steps < DISPARITIES as u16 * 16;
        without_distance += input.pixels.iter().filter(|p| p.has_value() && !has_distance(p.steps())).count();
        let (labels, sizes) = plain(&input, has_distance);
        let what = std::format!("round {round}: {} x {}, {:?}", input.width, input.height, input.settings);
        assert!(places(&stage, &input) == labels, "{what}");
        assert_eq!(report, SurfaceReport { found: sizes.len() as u32, dropped: 0 }, "{what}");
        let found: Vec<usize> = stage.table().iter().map(|s| s.pixels() as usize).collect();
        assert_eq!(found, sizes, "{what}");
    }
    assert!(without_distance > 10_000, "the pictures held {without_distance} disparities without a distance");
}

/// The surfaces that stay in a table for `room`, in their order: the largest, of equals those that come first.
fn largest(sizes: &[usize], room: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    order.sort_by_key(|&i| (core::cmp::Reverse(sizes[i]), i));
    let mut kept: Vec<usize> = order.into_iter().take(room).collect();
    kept.sort_unstable();
    kept
}

/// The place of a surface among those that stayed.
fn place_among(kept: &[usize], label: Option<usize>) -> Option<usize> {
    label.and_then(|label| kept.iter().position(|&k| k == label))
}

#[test]
fn surfaces_of_coded_pixels_are_those_of_a_flood_fill_and_have_their_class() {
    const CLASSES: [SurfaceClass; CODES] =
        [SurfaceClass::Undefined, SurfaceClass::Ground, SurfaceClass::Slanted, SurfaceClass::Obstacle];
    const ROOM: usize = 24;
    let mut random = Random::seeded("coded surfaces", 0x5eed_0104);
    let (depth, rays) = (depth(), rays());
    let mut stage = Box::new(Surfaces::<{ WIDTH * HEIGHT }, 1024>::new());
    let mut small = Box::new(Surfaces::<{ WIDTH * HEIGHT }, ROOM>::new());
    let (mut full, mut of_class) = (0, [0; CODES]);
    for round in 0..3000 {
        let mut input = RandomPicture::new(&mut random);
        input.settings.min_pixels = 17;
        let block = 1 + random.below(20) as usize;
        let colours: Vec<u8> = (0..WIDTH * HEIGHT).map(|_| random.below(CODES as u32) as u8).collect();
        let at = |i: usize| (i % input.width, i / input.width);
        let codes: Vec<u8> =
            (0..input.pixels.len()).map(at).map(|(x, y)| colours[y / block * WIDTH + x / block]).collect();
        let (labels, sizes) = plain_coded(&input, &codes, |steps| steps > 16 && steps < DISPARITIES as u16 * 16);
        stage.configure(&input.settings, input.width, input.height).unwrap();
        stage.codes_mut().copy_from_slice(&codes);
        let report = stage.run_coded(input.picture(), &depth, &rays, &CLASSES);
        assert!(places(&stage, &input) == labels, "round {round}: {:?}", input.settings);
        assert_eq!(report, SurfaceReport { found: sizes.len() as u32, dropped: 0 }, "round {round}");
        for (i, label) in labels.iter().enumerate() {
            if let Some(label) = *label {
                assert_eq!(stage.table()[label].class, CLASSES[usize::from(codes[i])], "round {round}");
                assert_eq!(stage.table()[label].pixels() as usize, sizes[label], "round {round}");
                of_class[usize::from(codes[i])] += 1;
            }
        }
        // Where the table is full the largest stay, with their classes.
        if small.configure(&input.settings, input.width, input.height).is_ok() {
            small.codes_mut().copy_from_slice(&codes);
            let report = small.run_coded(input.picture(), &depth, &rays, &CLASSES);
            assert_eq!(report.dropped as usize, sizes.len().saturating_sub(ROOM), "round {round}");
            full += usize::from(report.dropped > 0);
            let kept = largest(&sizes, ROOM);
            let left: Vec<_> = labels.iter().map(|label| place_among(&kept, *label)).collect();
            let found = places(&small, &input);
            assert!(found == left, "round {round}: {} surfaces", sizes.len());
            for (i, place) in found.into_iter().enumerate() {
                let class = place.map(|place| small.table()[place].class);
                assert!(class.is_none_or(|class| class == CLASSES[usize::from(codes[i])]), "round {round}");
            }
        }
    }
    assert!(full > 100 && of_class.iter().all(|&pixels| pixels > 10_000), "{full}, {of_class:?}");
}

#[test]
fn a_full_table_loses_the_smallest_and_says_how_many() {
    const ROOM: usize = 24;
    let mut random = Random::seeded("full table", 0x5eed_0102);
    let (depth, rays) = (depth(), rays());
    let mut stage = Box::new(Surfaces::<{ WIDTH * HEIGHT }, ROOM>::new());
    let mut full = 0;
    for round in 0..3000 {
        let mut input = RandomPicture::new(&mut random);
        input.settings.min_pixels = 16;
        stage.configure(&input.settings, input.width, input.height).unwrap();
        let report = stage.run(input.picture(), &depth, &rays);
        let (mut labels, sizes) = plain(&input, |steps| steps > 16 && steps < DISPARITIES as u16 * 16);
        let kept = largest(&sizes, ROOM);
        for label in &mut labels {
            *label = place_among(&kept, *label);
        }
        assert!(places(&stage, &input) == labels, "round {round}: {} surfaces", sizes.len());
        let dropped = sizes.len().saturating_sub(ROOM);
        assert_eq!(report, SurfaceReport { found: sizes.len() as u32, dropped: dropped as u32 }, "round {round}");
        let found: Vec<usize> = stage.table().iter().map(|s| s.pixels() as usize).collect();
        assert_eq!(found, kept.iter().map(|&k| sizes[k]).collect::<Vec<_>>(), "round {round}");
        full += usize::from(dropped > 0);
    }
    assert!(full > 150, "the table was full {full} times");
}

#[test]
fn a_tile_holds_the_most_surfaces_possible() {
    let pixels = tile_of_blocks();
    let mut stage = Box::new(Surfaces::<1024, 64>::new());
    let settings = SurfaceSettings { min_pixels: 16, ..SurfaceSettings::default() };
    stage.configure(&settings, 32, 32).unwrap();
    let report = stage.run(DisparityPicture::new(&pixels, 32), &depth(), &rays());
    assert_eq!(report, SurfaceReport { found: 64, dropped: 0 });
    for y in 0..32 {
        for x in 0..32 {
            assert_eq!(stage.place_at(x, y), Some(y / 4 * 8 + x / 4));
        }
    }
}

#[test]
fn a_tile_of_coded_pixels_holds_one_surface_less_and_counts_it() {
    // Those of the test above; beside two bits of a class there are six for a number.
    let block = |i: usize| i / 32 / 4 * 8 + i % 32 / 4;
    let code = |i: usize| (1 + block(i) % (CODES - 1)) as u8;
    let pixels = tile_of_blocks();
    let classes = [SurfaceClass::Undefined, SurfaceClass::Ground, SurfaceClass::Slanted, SurfaceClass::Obstacle];
    let mut stage = Box::new(Surfaces::<1024, 64>::new());
    stage.configure(&SurfaceSettings { min_pixels: 16, ..SurfaceSettings::default() }, 32, 32).unwrap();
    (0..32 * 32).zip(stage.codes_mut()).for_each(|(i, to)| *to = code(i));
    let report = stage.run_coded(DisparityPicture::new(&pixels, 32), &depth(), &rays(), &classes);
    assert_eq!((report, stage.table().len()), (SurfaceReport { found: 64, dropped: 1 }, 63));
    for i in 0..32 * 32 {
        let class = stage.surface_at(i % 32, i / 32).map(|surface| surface.class);
        assert_eq!(class, (block(i) < 63).then(|| classes[usize::from(code(i))]), "block {}", block(i));
    }
}

#[test]
fn a_picture_of_another_size_gives_no_surface() {
    let pixels = vec![DisparityPixel::from_steps(300); 64 * 64];
    let mut stage = Box::new(Surfaces::<{ 64 * 64 }, 64>::new());
    let (depth, rays) = (depth(), rays());
    assert_eq!(stage.run(DisparityPicture::new(&pixels, 64), &depth, &rays), SurfaceReport::default());
    stage.configure(&SurfaceSettings::default(), 64, 64).unwrap();
    assert_eq!(stage.run(DisparityPicture::new(&pixels, 64), &depth, &rays).found, 4);
    assert_eq!(stage.place_at(63, 63), Some(3));
    assert_eq!((stage.place_at(64, 0), stage.place_at(0, 64)), (None, None));
    for width in [63, 65, 0] {
        assert_eq!(stage.run(DisparityPicture::new(&pixels, width), &depth, &rays), SurfaceReport::default());
        assert_eq!((stage.place_at(63, 63), stage.surface_at(0, 0)), (None, None), "what was seen before is forgotten");
    }
}

#[test]
fn what_is_too_large_is_named() {
    let mut stage = Box::new(Surfaces::<1024, 4>::new());
    let settings = SurfaceSettings::default();
    let error = stage.configure(&settings, 33, 32).unwrap_err();
    let problem = ConfigProblem::OverCapacity { needed: 33 * 32, capacity: 1024 };
    assert_eq!(error, ConfigError::new("calibration.width x calibration.height", problem));
    let error = stage.configure(&settings, 5 * 32, 1).unwrap_err();
    assert_eq!(error.problem, ConfigProblem::OverCapacity { needed: 5, capacity: 4 });
    assert!(stage.configure(&settings, usize::MAX, usize::MAX).is_err());
    assert!(stage.configure(&settings, 4 * 32, 1).is_ok());
}
