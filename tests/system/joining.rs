//! Surfaces joined along tile borders against plain union-find over all pixels.

use std::collections::HashMap;

use fencepost::{
    config::Config,
    detector::{ProgramDetector, SURFACES},
};
use fencepost_core::surfaces::{Regions, SurfaceClass};
use fencepost_tests::{
    at_hand::{self, RECORDINGS},
    golden, replay, say,
};

/// The classes that are joined to ground and to obstacles, and the wider ones that they are chosen from.
const SETS: [(&str, &[SurfaceClass]); 4] = [
    ("ground", &[SurfaceClass::Ground]),
    ("near-horizontal", &[SurfaceClass::Ground, SurfaceClass::Horizontal]),
    ("obstacle", &[SurfaceClass::Obstacle]),
    ("steep", &[SurfaceClass::Slanted, SurfaceClass::Vertical, SurfaceClass::Obstacle]),
];

#[test]
fn borders_join_what_all_pixels_join() {
    let mut folders = vec![golden::recording()];
    folders.extend(RECORDINGS.into_iter().filter_map(at_hand::recording));
    let mut regions = Box::new(Regions::<SURFACES>::new());
    for folder in folders {
        let (mut frames, mut joined) = (0, [0; SETS.len()]);
        replay::for_each_detection(&folder, |detector, pair| {
            for ((name, classes), joined) in SETS.iter().zip(&mut joined) {
                *joined += compare(detector, &mut regions, classes)
                    .unwrap_or_else(|e| panic!("{}: frame {}: {name}: {e}", folder.display(), pair.sequence));
            }
            frames += 1;
        });
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        let [ground, horizontal, obstacle, steep] = joined;
        say!(
            "{name}: {frames} frames joined alike: {ground} ground, {horizontal} near-horizontal, {obstacle} obstacle, \
             {steep} steep regions"
        );
    }
}

/// Joins the surfaces of some classes both ways and says how many regions there are, or where the two differ.
fn compare(
    detector: &ProgramDetector,
    regions: &mut Regions<SURFACES>,
    classes: &[SurfaceClass],
) -> Result<usize, String> {
    let (surfaces, picture) = (detector.surfaces(), detector.disparity());
    let takes_part = |class: SurfaceClass| classes.contains(&class);
    regions.join(surfaces, picture, |surface| takes_part(surface.class));
    let (width, height) = (picture.width(), picture.height());
    let steps: Vec<u16> = (0..width * height)
        .map(|place| {
            let (x, y) = (place % width, place / width);
            let chosen = surfaces.surface_at(x, y).is_some_and(|surface| takes_part(surface.class));
            if chosen { picture.row(y)[x].steps() } else { 0 }
        })
        .collect();
    let step = Config::default().settings_for(width as u32).surfaces.step_sixteenths;
    let plain = join_all_pixels(&steps, width, step);
    // The same up to renaming: each label of one goes with one label of the other, both ways.
    let (mut there, mut back) = (HashMap::new(), HashMap::new());
    for (place, label) in plain.into_iter().enumerate().filter(|(place, _)| steps[*place] != 0) {
        let (x, y) = (place % width, place / width);
        let surface = surfaces.place_at(x, y).ok_or_else(|| format!("({x}, {y}) has lost its surface"))?;
        let region = regions.root(surface);
        if *there.entry(label).or_insert(region) != region || *back.entry(region).or_insert(label) != label {
            return Err(format!("the two part at ({x}, {y})"));
        }
    }
    Ok(there.len())
}

/// Union-find over all pixels: those with a disparity (other than 0) that are neighbours in a row or column and differ by no
/// more than `step` belong together. Returns a label for each pixel.
fn join_all_pixels(steps: &[u16], width: usize, step: u16) -> Vec<usize> {
    fn root(parents: &mut [usize], mut place: usize) -> usize {
        while parents[place] != place {
            parents[place] = parents[parents[place]];
            place = parents[place];
        }
        place
    }
    let mut parents: Vec<usize> = (0..steps.len()).collect();
    for place in 0..steps.len() {
        let right = (place % width + 1 < width).then_some(place + 1);
        let below = (place + width < steps.len()).then_some(place + width);
        for neighbour in [right, below].into_iter().flatten() {
            if steps[place] != 0 && steps[neighbour] != 0 && steps[place].abs_diff(steps[neighbour]) <= step {
                let (a, b) = (root(&mut parents, place), root(&mut parents, neighbour));
                parents[a.max(b)] = a.min(b);
            }
        }
    }
    (0..steps.len()).map(|place| root(&mut parents, place)).collect()
}

#[test]
fn the_plain_method_joins_what_touches() {
    // Two fields that touch only at a corner, one that steps too far, one with a hole.
    let steps = [16, 20, 0, 90, 0, 0, 40, 90, 50, 66, 0, 90];
    let labels = join_all_pixels(&steps, 4, 16);
    assert_eq!(labels[0], labels[1]);
    assert_eq!(labels[3], labels[7]);
    assert_eq!(labels[7], labels[11]);
    assert_eq!(labels[8], labels[9]);
    assert_ne!(labels[1], labels[6]);
    assert_ne!(labels[6], labels[9]);
    assert_ne!(labels[6], labels[7]);
}
