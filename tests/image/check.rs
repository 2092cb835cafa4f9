//! What the image said, held against the host and against what a microcontroller has.

use std::{collections::BTreeMap, fs, path::Path};

use fencepost_core::{
    arch::Backend,
    wire::{Frame, ScanEncoder},
};
use heapless::Vec as Bounded;
use object::{Object, ObjectSection, SectionFlags, SectionKind, elf};

use super::{
    case::{Case, Cases},
    counts,
    robot::{self, FRAMES, RUNS, RobotDetector},
    said::{Run, Said},
};

/// RAM of the microcontroller, bytes: statics, both pictures and the stack.
const RAM: u64 = 1 << 20;

/// Statics that do not begin with zeros lie in the flash as well: the encoder of 1.6 KiB may, and not the detector. Bytes.
const INITIALISED: u64 = 4 << 10;

/// Most that any entry may take of the stack, bytes.
const STACK: u64 = 8 << 10;

pub(super) fn check(cases: &Path, said: &Path, image: &Path) -> Result<(), String> {
    let read = |path: &Path| fs::read(path).map_err(|error| format!("{}: {error}", path.display()));
    let file = read(cases)?;
    let cases = Cases::new(&file).ok_or_else(|| "the file of cases holds no pictures".to_owned())?;
    let said = Said::parse(&String::from_utf8_lossy(&read(said)?))?;
    let mut wrong = Vec::new();
    for case in cases {
        let expected = on_host(&case)?;
        let runs: Vec<&Run> = said.runs.iter().filter(|run| run.case == case.name).collect();
        if runs.is_empty() {
            wrong.push(format!("{}: the image says nothing of it", case.name));
        }
        for run in runs {
            wrong.extend(differences(run, &expected));
        }
    }
    println!("{}", table(&said));
    wrong.extend(memory(&said, &read(image)?)?);
    wrong.extend(counts::check(&said)?);
    wrong.extend(counts::worst(&said));
    if wrong.is_empty() { Ok(()) } else { Err(wrong.join("\n")) }
}

/// The frames on the bus that the host sends for each pair.
fn on_host(case: &Case<'_>) -> Result<Vec<Vec<String>>, String> {
    let mut detector = Box::<RobotDetector>::default();
    let mut encoder = ScanEncoder::<RUNS>::new(robot::WIRE).map_err(|error| error.to_string())?;
    robot::configure(&mut detector, &case.setup, Backend::fastest())
        .map_err(|error| format!("{}: {error}", case.name))?;
    let mut scans = Vec::new();
    for (index, pixels) in case.pairs().enumerate() {
        let pictures = pixels.map(|pixels| case.picture(pixels));
        let [Some(left), Some(right)] = pictures else { return Err(format!("{}: pictures are too small", case.name)) };
        let detection = robot::detect(&mut detector, &[left, right], &mut ())
            .map_err(|error| format!("{}: {error:?}", case.name))?;
        let mut frames = Bounded::<Frame, FRAMES>::new();
        robot::encode(&mut encoder, detection, index as u16, &mut frames).map_err(|error| error.to_string())?;
        scans.push(frames.iter().map(written).collect());
    }
    Ok(scans)
}

fn written(frame: &Frame) -> String {
    let payload: String = frame.data().iter().map(|byte| format!("{byte:02X}")).collect();
    format!("{:03X}#{payload}", frame.id().as_raw())
}

/// Where the image and the host say different things.
fn differences(run: &Run, expected: &[Vec<String>]) -> Vec<String> {
    let place = format!("{}, {}", run.case, run.backend);
    if run.frames.len() != expected.len() {
        return vec![format!("{place}: {} pairs, not {}", run.frames.len(), expected.len())];
    }
    let differs = |(index, (found, expected)): (usize, (&Vec<String>, &Vec<String>))| {
        let at = (0..found.len().max(expected.len())).find(|&at| found.get(at) != expected.get(at))?;
        let [found, expected] = [found, expected].map(|frames| frames.get(at).map_or("nothing", String::as_str));
        Some(format!("{place}, pair {index}, CAN frame {at}: {found} on the target, {expected} on the host"))
    };
    run.frames.iter().map(|frame| &frame.can).zip(expected).enumerate().filter_map(differs).collect()
}

/// Instructions of each stage: the most of all pairs of a case.
pub(super) fn most(run: &Run) -> Vec<(String, u64)> {
    let mut most: Vec<(String, u64)> = Vec::new();
    for frame in &run.frames {
        for (place, (stage, instructions)) in frame.stages.iter().enumerate() {
            match most.get_mut(place) {
                Some((_, before)) => *before = (*before).max(*instructions),
                None => most.push((stage.clone(), *instructions)),
            }
        }
    }
    let total = run.frames.iter().map(|frame| frame.total()).max().unwrap_or_default();
    most.push(("total".to_owned(), total));
    most
}

/// Thousands of instructions, a line for each case and backend.
fn table(said: &Said) -> String {
    let mut lines = vec!["thousands of instructions on the target, the most of all pairs:".to_owned()];
    for (index, run) in said.runs.iter().enumerate() {
        let most = most(run);
        if index == 0 {
            let names: String = most.iter().map(|(stage, _)| format!("{stage:>10}")).collect();
            lines.push(format!("{:<28}{names}", ""));
        }
        let numbers: String = most.iter().map(|(_, instructions)| format!("{:>10}", instructions / 1000)).collect();
        lines.push(format!("{:<28}{numbers}", format!("{} {}", run.case, run.backend)));
    }
    lines.join("\n")
}

/// What the image takes, and what of it is too much.
fn memory(said: &Said, image: &[u8]) -> Result<Vec<String>, String> {
    let image = object::File::parse(image).map_err(|error| format!("the image: {error}"))?;
    let mut sizes = BTreeMap::from([("flash", 0), ("RAM", 0), ("both", 0)]);
    for section in image.sections() {
        let SectionFlags::Elf { sh_flags } = section.flags() else { continue };
        if sh_flags & u64::from(elf::SHF_ALLOC) == 0 {
            continue;
        }
        let writable = sh_flags & u64::from(elf::SHF_WRITE) != 0;
        *sizes.entry("RAM").or_default() += if writable { section.size() } else { 0 };
        // What is initialised lies in the flash as well.
        let stored = section.kind() != SectionKind::UninitializedData;
        *sizes.entry("flash").or_default() += if stored { section.size() } else { 0 };
        *sizes.entry("both").or_default() += if stored && writable { section.size() } else { 0 };
    }
    let mut wrong = Vec::new();
    for (entry, (bytes, case)) in &said.stacks {
        println!("stack of {entry}: {bytes} bytes at most, in {case}");
        if *bytes > STACK {
            wrong.push(format!("{entry} takes {bytes} bytes of stack in {case}: more than {STACK}"));
        }
    }
    for (what, bytes) in &said.memory {
        println!("{what}: {bytes} bytes");
    }
    let ram = sizes["RAM"] + STACK;
    println!("flash: {} bytes; RAM: {ram} bytes, {STACK} of them stack", sizes["flash"]);
    if sizes["both"] > INITIALISED {
        wrong.push(format!(
            "{} bytes of RAM begin with something other than zero: a detector that is not configured is to be all zero",
            sizes["both"]
        ));
    }
    if ram > RAM {
        wrong.push(format!("the image takes {ram} bytes of RAM with its stack: more than {RAM}"));
    }
    Ok(wrong)
}
