//! What the chain puts on the bus with each backend, and its stages one by one, for `tests/aarch64` to count their instructions.
//!
//! ```text
//! payloads list                    the backends that this processor has
//! payloads frames BACKEND          the CAN frames of committed and made-up pictures, as candump writes them
//! payloads run STAGE BACKEND N     runs a stage N times on the first committed pair
//! ```

#[expect(dead_code, reason = "the benches use all of it")]
#[path = "../benches/common/mod.rs"]
mod common;

use std::hint::black_box;

use common::{DISPARITIES, HEIGHT, MOUNT, PAIR, Stages, WIDTH, Whole};
use fencepost_core::{
    arch::Backend,
    detector::{Capacities, Detector},
    geometry::{RectifiedPair, StereoCalibration},
    matching::MatchSettings,
    picture::Picture,
    settings::Settings,
    wire::{CellsRepr, FIXED_FRAMES_PER_SCAN, Frame, Scan, ScanEncoder, WireConfig, WireSettings},
};

/// Pairs of the committed recording.
const COMMITTED: usize = 6;

const LARGE: Capacities = Capacities::for_pictures(512, 384, 64);
const LARGE_PAIR: RectifiedPair =
    RectifiedPair { width: 512, height: 384, focal_px: 420.0, cx: 255.5, cy: 191.5, ..PAIR };

type Large = Detector<
    { LARGE.pixels },
    { LARGE.width },
    { LARGE.disparities },
    { LARGE.grid },
    { LARGE.surfaces },
    { LARGE.obstacles },
    { LARGE.cells },
>;

type Pair = [Vec<u8>; 2];

fn main() -> Result<(), String> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match &arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["list"] => {
            let there = Backend::ALL.iter().filter(|backend| backend.is_available());
            there.for_each(|backend| println!("{}", backend.name()));
        }
        ["frames", name] => frames(backend(name)?),
        ["run", stage, name, times] => run(stage, backend(name)?, times.parse().map_err(|e| format!("{times}: {e}"))?)?,
        _ => return Err("list, frames BACKEND or run STAGE BACKEND N".into()),
    }
    Ok(())
}

fn backend(name: &str) -> Result<Backend, String> {
    let named = Backend::ALL.iter().copied().find(|backend| backend.name() == name);
    named.filter(|backend| backend.is_available()).ok_or_else(|| format!("{name} is no backend of this processor"))
}

fn run(stage: &str, backend: Backend, times: usize) -> Result<(), String> {
    let mut stages = Stages::with(backend);
    for _ in 0..times {
        match stage {
            "rectify" => drop(black_box(stages.rectify())),
            "matching" => drop(black_box(stages.match_rows())),
            "validate" => drop(black_box(stages.validate())),
            "surfaces" => drop(black_box(stages.surfaces())),
            "detect" => drop(black_box(stages.detect())),
            _ => return Err(format!("{stage} is no stage")),
        }
    }
    Ok(())
}

/// All kinds of pictures, in two sizes, rectified and through a lens.
fn frames(backend: Backend) {
    let committed = || (0..COMMITTED).map(|i| ["image_0", "image_1"].map(|folder| common::picture(folder, i)));
    let small = [StereoCalibration::Rectified(PAIR), StereoCalibration::Raw(common::raw(PAIR))];
    for calibration in small {
        show(&mut Box::<Whole>::default(), backend, calibration, committed().chain(hard()));
    }
    let repeated = || committed().map(|pair| pair.map(|pixels| repeat(&pixels)));
    for calibration in [StereoCalibration::Rectified(LARGE_PAIR), StereoCalibration::Raw(common::raw(LARGE_PAIR))] {
        show(&mut Box::<Large>::default(), backend, calibration, repeated());
    }
}

/// Lets one detector see the pairs in turn and writes down what it says.
fn show<
    const PIXELS: usize,
    const COLUMNS: usize,
    const DEPTH: usize,
    const GRID: usize,
    const SURFACES: usize,
    const OBSTACLES: usize,
    const CELLS: usize,
>(
    detector: &mut Detector<PIXELS, COLUMNS, DEPTH, GRID, SURFACES, OBSTACLES, CELLS>,
    backend: Backend,
    calibration: StereoCalibration,
    pairs: impl Iterator<Item = Pair>,
) {
    let matching = MatchSettings { disparities: DEPTH as u16, ..MatchSettings::DEFAULT };
    assert!(detector.set_backend(backend));
    detector.configure(&Settings { matching, ..Settings::default() }, &calibration, &MOUNT).unwrap();
    assert_eq!(detector.backend(), backend);
    let config = WireConfig::new(WireSettings::CLASSIC).unwrap();
    let mut encoder = Box::new(ScanEncoder::<{ 255 * CellsRepr::FD_RUNS }>::new(config).unwrap());
    let mut out = Box::new(heapless::Vec::<Frame, { 255 + FIXED_FRAMES_PER_SCAN }>::new());
    for (number, pair) in pairs.enumerate() {
        let [left, right] = pair.each_ref().map(|p| Picture::packed(p, COLUMNS, PIXELS / COLUMNS).unwrap());
        let found = detector.detect(&left, &right, &mut ()).unwrap();
        println!("{COLUMNS} pair {number}: {} obstacles, {:?}", found.obstacles.len(), found.health);
        let scan = Scan {
            scan_index: number as u16,
            age_ns: 0,
            health: found.health,
            geometry: &found.map.geometry,
            cells: &found.map.cells,
            sectors: &found.sectors,
            ground: found.ground.as_ref(),
        };
        out.clear();
        encoder.encode(&scan, out.as_mut_view()).unwrap();
        out.iter().for_each(|frame| println!("{frame:?}"));
    }
}

/// The picture again and again, in the larger size.
fn repeat(pixels: &[u8]) -> Vec<u8> {
    let place = |i: usize| (i / LARGE.width % HEIGHT) * WIDTH + i % LARGE.width % WIDTH;
    (0..LARGE.pixels).map(|i| pixels[place(i)]).collect()
}

/// Pictures made to hurt: noise, stripes of every period, a checkerboard, nothing at all.
fn hard() -> impl Iterator<Item = Pair> {
    // xorshift32 (G. Marsaglia, Journal of Statistical Software 8(14), 2003).
    let mut state = 0x5eed_0201_u32;
    let noise: Vec<u8> = (0..WIDTH * HEIGHT + DISPARITIES)
        .map(|_| {
            state ^= state << 13;
            state ^= state >> 17;
            state ^= state << 5;
            (state >> 24) as u8
        })
        .collect();
    let drawn = |pixel: fn(usize, usize) -> u8| (0..WIDTH * HEIGHT).map(|i| pixel(i % WIDTH, i / WIDTH)).collect();
    let stripes: Vec<u8> = drawn(|x, y| if x % (2 + y / 8) < 1 + y / 16 { 200 } else { 50 });
    let board: Vec<u8> = drawn(|x, y| if (x / 8 + y / 8) % 2 == 0 { 30 } else { 220 });
    let shifted = noise[7..][..WIDTH * HEIGHT].to_vec();
    let noise = noise[..WIDTH * HEIGHT].to_vec();
    let reversed = noise.iter().rev().copied().collect();
    [[noise.clone(), shifted], [noise, reversed], [stripes.clone(), stripes], [board.clone(), board]]
        .into_iter()
        .chain([[vec![0; WIDTH * HEIGHT], vec![255; WIDTH * HEIGHT]]])
}
