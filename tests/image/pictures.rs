//! The pictures: rendered ones, those made to hurt, and recorded ones where they are at hand.

use std::path::Path;

use fencepost::config::default_disparities;
use fencepost_core::geometry::{Mount, RectifiedPair, StereoCalibration};
use fencepost_hal::{
    camera::{Camera, StereoPair},
    recording::Recording,
    scene::{Scene, SceneOptions},
};
use fencepost_tests::{at_hand, golden};

use super::{
    case::{MAGIC, NAME, Setup},
    robot::{DISPARITIES, HEIGHT, WIDTH},
    shrink::Shrink,
};

/// Pairs of each recording.
const PAIRS: usize = 2;

/// A case that has its pictures in memory.
struct Made {
    name: String,
    setup: Setup,
    size: (usize, usize),
    pairs: Vec<[Vec<u8>; 2]>,
}

pub(super) fn make(file: &Path) -> Result<(), String> {
    let mut cases = vec![recorded("trail", &golden::recording(), 6)?];
    cases.extend(rendered()?);
    cases.extend(made_to_hurt(&cases[0]));
    for name in at_hand::RECORDINGS {
        if let Some(folder) = at_hand::recording(name) {
            cases.push(recorded(name, &folder, PAIRS)?);
        }
    }
    let mut bytes = MAGIC.to_vec();
    bytes.extend([0; 4]);
    for case in &cases {
        case.write_to(&mut bytes)?;
    }
    let length = u32::try_from(bytes.len()).map_err(|_| "the pictures are too many".to_owned())?;
    bytes[MAGIC.len()..MAGIC.len() + 4].copy_from_slice(&length.to_le_bytes());
    println!("{} recordings, {} pairs", cases.len(), cases.iter().map(|case| case.pairs.len()).sum::<usize>());
    std::fs::write(file, bytes).map_err(|error| format!("{}: {error}", file.display()))
}

impl Made {
    fn write_to(&self, bytes: &mut Vec<u8>) -> Result<(), String> {
        let mut name = [0; NAME];
        let room = name.get_mut(..self.name.len()).ok_or_else(|| format!("{} is too long a name", self.name))?;
        room.copy_from_slice(self.name.as_bytes());
        bytes.extend(name);
        for number in [self.size.0, self.size.1, self.pairs.len()] {
            bytes.extend((number as u32).to_le_bytes());
        }
        let raw = matches!(self.setup.calibration, StereoCalibration::Raw(_));
        bytes.extend(f32::from(u8::from(raw)).to_le_bytes());
        let mut setup = self.setup;
        setup.transfer(&mut |number| {
            bytes.extend(number.to_le_bytes());
            Some(())
        });
        let first = bytes.len();
        self.pairs.iter().flatten().for_each(|pixels| bytes.extend(pixels));
        bytes.resize(first + (bytes.len() - first).next_multiple_of(4), 0);
        Ok(())
    }
}

/// The first pairs of whatever is a camera.
fn taken<C: Camera>(
    name: &str,
    calibration: &StereoCalibration,
    mount: Mount,
    size: (u32, u32),
    mut camera: C,
    count: usize,
) -> Result<Made, String> {
    let shrink = Shrink::new((size.0 as usize, size.1 as usize), (WIDTH, HEIGHT));
    let take = |pair: &StereoPair<'_>| {
        [pair.left, pair.right].map(|picture| {
            let pixels: Vec<u8> = (0..picture.height()).flat_map(|y| picture.row(y)).copied().collect();
            shrink.picture(&pixels)
        })
    };
    let mut pairs = Vec::new();
    while pairs.len() < count {
        match camera.next_pair(take).map_err(|error| format!("{name}: {error}"))? {
            Some(pair) => pairs.push(pair),
            None => break,
        }
    }
    let calibration = shrink.calibration(calibration);
    let disparities = default_disparities(shrink.wanted.0 as u32).min(DISPARITIES as u16);
    Ok(Made { name: name.to_owned(), setup: Setup { calibration, mount, disparities }, size: shrink.wanted, pairs })
}

fn recorded(name: &str, folder: &Path, count: usize) -> Result<Made, String> {
    let recording = Recording::open(folder).map_err(|error| error.to_string())?;
    let (calibration, mount, size) = (recording.calibration.stereo, recording.mount, recording.picture_size());
    taken(name, &calibration, mount, size, recording.into_camera(), count)
}

/// The trail through lenses that distort, with a right camera that was mounted without great care: rectifying is work here.
fn rendered() -> Result<Vec<Made>, String> {
    let raw = SceneOptions {
        distortion: Some(SceneOptions::USUAL_DISTORTION),
        misalignment: Some(SceneOptions::USUAL_MISALIGNMENT),
        frames: 3,
        ..golden::options()
    };
    let slope = SceneOptions { seed: 7, slope_deg: 12.0, slope_start_m: 6.0, ..raw };
    [("trail-raw", raw), ("slope-raw", slope)]
        .map(|(name, options)| {
            let scene = Scene::new(options).map_err(|error| error.to_string())?;
            let (calibration, mount) = (scene.calibration(), scene.mount());
            taken(name, &calibration, mount, (options.width, options.height), scene.into_camera(), usize::MAX)
        })
        .into_iter()
        .collect()
}

/// Pictures that no camera takes, with the cameras of `like`: where branches go the other way, and where most is to be done.
fn made_to_hurt(like: &Made) -> Vec<Made> {
    let StereoCalibration::Rectified(pair) = like.setup.calibration else { return Vec::new() };
    let pair = RectifiedPair { disparity_offset_px: 0.0, ..pair };
    let setup = Setup { calibration: StereoCalibration::Rectified(pair), ..like.setup };
    let (width, height) = like.size;
    let made = |name: &str, grey: &mut dyn FnMut(usize, usize) -> [u8; 2]| {
        let pixels: Vec<[u8; 2]> = (0..width * height).map(|i| grey(i % width, i / width)).collect();
        let pairs = vec![[0, 1].map(|side| pixels.iter().map(|pixel| pixel[side]).collect())];
        Made { name: name.to_owned(), setup, size: like.size, pairs }
    };
    // A linear congruential generator's upper bits are noise enough.
    let mut state = 1u32;
    let mut noise = move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 24) as u8
    };
    let texture: Vec<u8> = (0..width + DISPARITIES).map(|_| noise()).collect();
    vec![
        made("noise", &mut |_, _| [noise(), noise()]),
        made("stripes", &mut |x, _| [(x % 4 * 60) as u8; 2]),
        made("checkerboard", &mut |x, y| [if (x / 5 + y / 5) % 2 == 0 { 40 } else { 200 }; 2]),
        made("flat", &mut |_, _| [128; 2]),
        made("one-surface", &mut |x, y| [20, 0].map(|shift| texture[x + shift].wrapping_add((y * y / 7 % 64) as u8))),
        Made {
            name: "exchanged".to_owned(),
            setup: like.setup,
            size: like.size,
            pairs: like.pairs.iter().take(1).map(|[left, right]| [right.clone(), left.clone()]).collect(),
        },
    ]
}
