//! Surfaces joined over the whole picture, against union-find over all pixels.

use super::*;

/// Union-find over all pixels of the picture: neighbours are joined if their disparities are contiguous and the surfaces of
/// both take part.
fn plain(input: &RandomPicture, places: &[Option<usize>], takes_part: &[bool]) -> Vec<Option<usize>> {
    fn root(parent: &[usize], mut at: usize) -> usize {
        while parent[at] != at {
            at = parent[at];
        }
        at
    }
    let RandomPicture { width, height, settings, pixels } = input;
    let mut parent: Vec<usize> = (0..pixels.len()).collect();
    let takes_part = |at: usize| places[at].is_some_and(|place| takes_part[place]);
    for y in 0..*height {
        for x in 0..*width {
            let at = y * width + x;
            let right = (x + 1 < *width).then_some(at + 1);
            let below = (y + 1 < *height).then_some(at + width);
            for other in [right, below].into_iter().flatten() {
                let apart = pixels[at].steps().abs_diff(pixels[other].steps());
                if takes_part(at) && takes_part(other) && apart <= settings.step_sixteenths {
                    let (a, b) = (root(&parent, at), root(&parent, other));
                    parent[a.max(b)] = a.min(b);
                }
            }
        }
    }
    (0..pixels.len()).map(|at| takes_part(at).then(|| root(&parent, at))).collect()
}

/// The number of surfaces, and how many of them were joined to another.
fn check(seed: u64, rounds: usize) -> (usize, usize) {
    let mut random = Random::seeded("joined surfaces", seed);
    let (depth, rays) = (depth(), rays());
    let mut stage = Box::new(Surfaces::<{ WIDTH * HEIGHT }, 1024>::new());
    let mut small = Box::new(Surfaces::<{ WIDTH * HEIGHT }, 24>::new());
    let mut regions = Box::new(Regions::<1024>::new());
    let mut small_regions = Box::new(Regions::<24>::new());
    let (mut surfaces, mut joins) = (0, 0);
    for round in 0..rounds {
        let input = RandomPicture::new(&mut random);
        let all = random.below(3) == 0;
        let classes: Vec<bool> = (0..1024).map(|_| all || random.below(4) > 0).collect();
        // Every fourth with a table that may be full.
        let (table, found, partition) = if round % 4 == 0 {
            join(&mut small, &mut small_regions, &input, &classes, (&depth, &rays))
        } else {
            join(&mut stage, &mut regions, &input, &classes, (&depth, &rays))
        };
        let expected = plain(&input, &found, &classes);
        assert!(
            same_up_to_renaming(&partition, &expected),
            "round {round}: {} x {}, {:?}",
            input.width,
            input.height,
            input.settings
        );
        surfaces += table;
        let mut labels: Vec<_> = partition.iter().flatten().collect();
        labels.sort_unstable();
        labels.dedup();
        joins += classes[..table].iter().filter(|&&part| part).count() - labels.len();
    }
    std::println!("{surfaces} surfaces, {joins} of them joined to another");
    (surfaces, joins)
}

#[test]
fn joining_tiles_equals_union_find_over_all_pixels() {
    let (surfaces, joins) = check(0x5eed_0103, 10_000);
    assert!(surfaces > 30_000 && joins > 5_000);
}

/// The same, so quick that it is among the first that a mistake meets.
#[test]
fn a_few_pictures_are_joined_as_union_find_joins_them() {
    let (surfaces, joins) = check(0x5eed_0109, 40);
    assert!(surfaces > 100 && joins > 10);
}

/// Labels by region of the pixels whose surfaces take part; the number of surfaces and the place of each pixel's.
fn join<const SURFACES: usize>(
    stage: &mut Surfaces<{ WIDTH * HEIGHT }, SURFACES>,
    regions: &mut Regions<SURFACES>,
    input: &RandomPicture,
    classes: &[bool],
    (depth, rays): (&DepthTable<DISPARITIES>, &Rays),
) -> (usize, Vec<Option<usize>>, Vec<Option<usize>>) {
    stage.configure(&input.settings, input.width, input.height).unwrap();
    stage.run(input.picture(), depth, rays);
    // The class carries the choice, and the place of a surface carries its class.
    for (surface, &takes_part) in stage.table_mut().iter_mut().zip(classes) {
        surface.class = if takes_part { SurfaceClass::Obstacle } else { SurfaceClass::Ground };
    }
    regions.join(stage, input.picture(), |surface| surface.class == SurfaceClass::Obstacle);
    let places = super::labels::places(stage, input);
    let len = stage.table().len();
    assert!(places.iter().flatten().all(|&place| place < len), "a place beyond the table");

    // Roots and members give every surface once, in order, and agree with `root`.
    let mut region_of = vec![None; len];
    for root in regions.roots() {
        let members: Vec<usize> = regions.members(root).collect();
        assert!(members.is_sorted() && members.first() == Some(&root), "{members:?}");
        for &member in &members {
            assert_eq!(region_of[member].replace(root), None, "surface {member} is in two regions");
            assert!(members.len() == 1 || classes[member], "a surface that takes no part is joined");
        }
    }
    assert!(region_of.iter().all(Option::is_some), "a surface in no region");
    for (place, region) in region_of.iter().enumerate() {
        assert_eq!(Some(regions.root(place)), *region);
    }
    assert_eq!(regions.members(SURFACES).count(), 0);
    assert_eq!(regions.root(SURFACES + 5), SURFACES + 5);
    let partition =
        places.iter().map(|place| place.filter(|&place| classes[place]).and_then(|place| region_of[place])).collect();
    (len, places, partition)
}

#[test]
fn below_the_picture_there_is_no_tile() {
    let pixels = vec![DisparityPixel::from_steps(300); 64 * 64];
    let mut stage = Box::new(Surfaces::<{ 64 * 64 }, 64>::new());
    stage.configure(&SurfaceSettings::default(), 64, 64).unwrap();
    stage.run(DisparityPicture::new(&pixels, 64), &depth(), &rays());
    assert_eq!([(0, 0), (63, 63), (0, 64), (32, 1000)].map(|(x, y)| stage.of_tile(x, y).len()), [1, 1, 0, 0]);
}
