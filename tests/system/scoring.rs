//! The program's own scores against the field's scripts, figure by figure, and what such truth is made of.

use std::{collections::HashMap, fs, path::Path, sync::Arc};

use fencepost::{
    cli::{CompareArgs, DetectorArgs, FrameRange},
    commands::{self, Ending},
    compare::Method,
    console::Console,
    output::CellRow,
    score::{CellCounts, DisparityCounts, RecordedTruth, Said},
};
use fencepost_core::map::{Cell, CellState};
use fencepost_hal::recording::Recording;
use fencepost_tests::{at_hand, say};
use serde_json::Value;

/// Largest difference between a figure here and there.
const TOLERANCE: f64 = 1.0e-6;
/// Seeds of made-up cells.
const SEEDS: [u64; 6] = [1, 2, 3, 4, 5, 6];
/// Edges of cells that are tried, millimetres.
const CELL_SIZES_MM: [u16; 3] = [500, 250, 1000];

/// Asserts that the script prints the same figures as `ours`, under the same names.
fn assert_same(ours: &Value, script: &Path, arguments: &[&std::ffi::OsStr], what: &str) {
    let Some(python) = at_hand::python() else { return };
    let said = at_hand::run_python(&python, script, arguments);
    let theirs: Value = serde_json::from_str(&said).unwrap();
    let (ours, theirs) = (ours.as_object().unwrap(), theirs.as_object().unwrap());
    let names = |map: &serde_json::Map<String, Value>| map.keys().cloned().collect::<std::collections::BTreeSet<_>>();
    assert_eq!(names(ours), names(theirs), "{what}");
    for (name, value) in theirs {
        let (here, there) = (&ours[name], value);
        let agree = match (here.as_f64(), there.as_f64()) {
            (Some(here), Some(there)) => (here - there).abs() <= TOLERANCE,
            _ => here == there,
        };
        assert!(agree, "{what}: {name} is {here} here and {there} there");
    }
}

/// What the program wrote in `summary.json` about a part of the truth.
fn score_in_summary(out: &Path, part: &str) -> Value {
    let summary: Value = serde_json::from_str(&fs::read_to_string(out.join("summary.json")).unwrap()).unwrap();
    summary["score"][part].clone()
}

#[test]
fn cells_of_the_program() {
    let name = "kitti15-road";
    let (Some(recording), Some(tool)) = (at_hand::recording(name), at_hand::scoring_tool("score_cells.py")) else {
        return;
    };
    let Some(out) = super::replayed(name) else { return };
    let (ours, cells) = (score_in_summary(&out, "cells"), out.join("cells.csv"));
    assert_same(&ours, &tool, &[recording.as_ref(), cells.as_ref(), "--json".as_ref()], name);
    say!("{name}: the scores of its cells here and there are the same: {ours}");
}

#[test]
fn disparity_of_the_program() {
    for name in ["kitti15-road", "eth3d-terrace", "middlebury-cones"] {
        let (Some(recording), Some(tool)) = (at_hand::recording(name), at_hand::scoring_tool("score_disparity.py"))
        else {
            continue;
        };
        let Some(out) = super::replayed(name) else { continue };
        let (ours, disparity) = (score_in_summary(&out, "disparity"), out.join("disparity"));
        assert_same(&ours, &tool, &[recording.as_ref(), disparity.as_ref(), "--json".as_ref()], name);
        say!("{name}: the scores of its disparity here and there are the same: {ours}");
    }
}

#[test]
fn every_detector_of_a_comparison() {
    let name = "kitti15-road";
    let tools = ["score_cells.py", "score_disparity.py"].map(at_hand::scoring_tool);
    let (Some(recording), [Some(cells_tool), Some(disparity_tool)]) = (at_hand::recording(name), tools) else { return };
    let out = Path::new(super::SCRATCH).join("compared").join(name);
    // One that takes seconds for a frame is scored like the others.
    let detectors: Vec<_> = Method::ALL.into_iter().filter(|method| matches!(method, Method::Core(_))).collect();
    let args = CompareArgs {
        recording: recording.clone(),
        detectors: detectors.clone(),
        out: out.clone(),
        frames: FrameRange::default(),
        show: 1,
        detector: DetectorArgs::default(),
    };
    let ending = commands::compare(&args, &mut Console::new(true, false)).unwrap_or_else(|e| panic!("{name}: {e}"));
    assert_eq!(ending, Ending::Good);
    let written: Value = serde_json::from_str(&fs::read_to_string(out.join("compare.json")).unwrap()).unwrap();
    let outcomes = written["detectors"].as_array().unwrap();
    assert_eq!(outcomes.len(), detectors.len());
    for detector in outcomes {
        let folder = out.join(detector["folder"].as_str().unwrap());
        let (cells, disparity) = (folder.join("cells.csv"), folder.join("disparity"));
        let score = &detector["score"];
        let what = format!("{name}, {}", detector["name"]);
        assert_same(&score["cells"], &cells_tool, &[recording.as_ref(), cells.as_ref(), "--json".as_ref()], &what);
        let arguments = [recording.as_ref(), disparity.as_ref(), "--json".as_ref()];
        assert_same(&score["disparity"], &disparity_tool, &arguments, &what);
        say!("{what}: the scores here and there are the same: {}", score["cells"]);
    }
}

/// Random numbers that are the same everywhere: SplitMix64 (Steele, Lea and Flood, OOPSLA 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }
}

/// Cells of the truth, cells beside them and cells anywhere, each called what the dice say; some frames stay without any.
fn made_up_rows(truth: &RecordedTruth, frame: u32, size_mm: u16, random: &mut Random) -> Vec<CellRow> {
    let cells = truth.cells_of(frame, size_mm).unwrap().unwrap();
    let mut known: Vec<_> = cells.obstacles.iter().chain(&cells.free).copied().collect();
    known.sort_unstable();
    let mut said = HashMap::new();
    if random.below(6) > 0 {
        for (i, j) in known {
            let aside = (random.below(5) as i32 - 2, random.below(5) as i32 - 2);
            let state = if random.below(3) == 0 { CellState::Obstacle } else { CellState::Free };
            match random.below(4) {
                0 => said.insert((i, j), state),
                1 => said.insert((i + aside.0, j + aside.1), state),
                _ => None,
            };
        }
        for _ in 0..200 {
            said.insert((random.below(90) as i32 - 5, random.below(90) as i32 - 45), CellState::Obstacle);
        }
    }
    let mut rows: Vec<_> = said.into_iter().collect();
    rows.sort_unstable_by_key(|(cell, _)| *cell);
    let row = |((i, j), state)| CellRow { cell: (i as i16, j as i16), content: Cell { state, ..Cell::default() } };
    rows.into_iter().map(row).collect()
}

fn csv_of(rows: &[(u32, CellRow)], size_mm: u16) -> String {
    let centre = |index: i16| f64::from((2 * i32::from(index) + 1) * i32::from(size_mm)) / 2000.0;
    let line = |(frame, row): &(u32, CellRow)| {
        let state = if row.content.state == CellState::Obstacle { "obstacle" } else { "free" };
        format!("{frame},{},{},{state}\n", centre(row.cell.0), centre(row.cell.1))
    };
    std::iter::once("frame,x_m,y_m,state\n".to_owned()).chain(rows.iter().map(line)).collect()
}

#[test]
fn made_up_cells() {
    let name = "kitti15-road";
    let (Some(folder), Some(tool)) = (at_hand::recording(name), at_hand::scoring_tool("score_cells.py")) else {
        return;
    };
    let recording = Recording::open(&folder).unwrap();
    let truth = RecordedTruth::of(&recording).0.unwrap();
    let scratch = tempfile::tempdir().unwrap();
    for seed in SEEDS {
        let size_mm = CELL_SIZES_MM[seed as usize % CELL_SIZES_MM.len()];
        let (mut random, mut counts, mut table) = (Random(seed), CellCounts::default(), Vec::new());
        for frame in recording.frames.iter().map(|frame| frame.number) {
            let rows = made_up_rows(&truth, frame, size_mm, &mut random);
            counts += CellCounts::of_frame(&truth.cells_of(frame, size_mm).unwrap().unwrap(), &Said::of(&rows));
            table.extend(rows.into_iter().map(|row| (frame, row)));
        }
        let ours = serde_json::to_value(counts.score().unwrap()).unwrap();
        let file = scratch.path().join("cells.csv");
        fs::write(&file, csv_of(&table, size_mm)).unwrap();
        let size_m = (f64::from(size_mm) / 1000.0).to_string();
        let arguments = [folder.as_ref(), file.as_ref(), "--json".as_ref(), "--cell".as_ref(), size_m.as_ref()];
        let what = format!("seed {seed}, cells of {size_mm} mm");
        assert_same(&ours, &tool, &arguments, &what);
        let some = ["recall", "precision", "false_alarm", "missed_free", "free_found"];
        assert!(some.iter().all(|figure| ours[figure].as_f64().unwrap() > 0.0), "{what} tries every figure: {ours}");
        say!("{what}: {ours}");
    }
}

#[test]
fn made_up_disparity() {
    let Some(tool) = at_hand::scoring_tool("score_disparity.py") else { return };
    for (seed, (width, height)) in SEEDS.into_iter().zip([(40, 30), (7, 5), (1, 1), (64, 3), (33, 33), (2, 9)]) {
        let scratch = tempfile::tempdir().unwrap();
        let (truth, found) = (scratch.path().join("disp_occ_0"), scratch.path().join("found"));
        for folder in [&truth, &found] {
            fs::create_dir(folder).unwrap();
        }
        let (mut random, mut counts) = (Random(seed), DisparityCounts::default());
        for frame in 0..3 {
            let pixels = (0..width * height).map(|_| made_up_pixel(&mut random));
            let (true_px, found_px): (Vec<u16>, Vec<u16>) = pixels.unzip();
            counts.frame(frame, &true_px, &found_px, [(width, height); 2]).unwrap();
            for (folder, pixels) in [(&truth, &true_px), (&found, &found_px)] {
                let png = fencepost::paint::grey16_png(width, height, pixels);
                fs::write(folder.join(format!("{frame:06}.png")), png).unwrap();
            }
        }
        let ours = serde_json::to_value(counts.score().unwrap()).unwrap();
        let arguments = [scratch.path().as_ref(), found.as_ref(), "--json".as_ref()];
        assert_same(&ours, &tool, &arguments, &format!("seed {seed}, {width} x {height}"));
    }
}

/// Truth that is known three times in four, a value that is there as often, and errors of all sizes, limits among them.
fn made_up_pixel(random: &mut Random) -> (u16, u16) {
    let truth = 1 + random.below(60_000) as u16;
    let off = match random.below(5) {
        0 => 256,
        1 => 768,
        2 => random.below(256) as u16,
        _ => random.below(1500) as u16,
    };
    let found = if random.below(2) == 0 { truth.saturating_add(off) } else { truth.saturating_sub(off).max(1) };
    let known = |value: u16, random: &mut Random| if random.below(4) > 0 { value } else { 0 };
    // The very first is always there, so that there is something to divide by.
    (known(truth, random).max(1), known(found, random))
}

#[test]
fn a_score_says_which_frames_it_lacks() {
    let Some(folder) = at_hand::recording("kitti15-road") else { return };
    let scratch = tempfile::tempdir().unwrap();
    let copy = scratch.path().join("velodyne");
    fs::create_dir(&copy).unwrap();
    for name in ["calib.txt", "mount.json", "times.txt"] {
        fs::copy(folder.join(name), scratch.path().join(name)).unwrap();
    }
    for side in ["image_0", "image_1"] {
        fs::create_dir(scratch.path().join(side)).unwrap();
        for number in 0..3 {
            let file = format!("{side}/{number:06}.png");
            fs::copy(folder.join(&file), scratch.path().join(&file)).unwrap();
        }
    }
    let sweep = fs::read(folder.join("velodyne/000000.bin")).unwrap();
    fs::write(copy.join("000000.bin"), &sweep).unwrap();
    fs::write(copy.join("000001.bin"), &sweep[..sweep.len() / 2 - 3]).unwrap();
    fs::write(copy.join("000002.bin"), vec![0; 1600]).unwrap();
    let recording = Recording::open(scratch.path()).unwrap();
    let truth = Arc::new(RecordedTruth::of(&recording).0.unwrap());
    assert!(truth.cells_of(0, 500).unwrap().is_some());
    let torn = truth.cells_of(1, 500).unwrap_err();
    assert!(torn.contains("000001.bin") && torn.contains("cut off") && torn.contains("copy it again"), "{torn}");
    let nothing = truth.cells_of(2, 500).unwrap_err();
    assert!(nothing.contains("frame 2") && nothing.contains("shows no road"), "{nothing}");
    assert_eq!(truth.cells_of(3, 500), Ok(None));
}
