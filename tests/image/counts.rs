//! Instructions on the target, held against those that were agreed.

use std::{env, fs, path::PathBuf};

use fencepost_tests::at_hand::ROOT;

use super::{
    check::most,
    said::{Run, Said},
};

/// Cases that every clone has.
const CASES: [&str; 2] = ["trail", "trail-raw"];

/// What may differ, of 100: more than that, either way, is worth a look.
const TOLERANCE: u64 = 3;

/// Pictures that are made to cost much.
const HURTING: [&str; 6] = ["noise", "stripes", "checkerboard", "flat", "one-surface", "exchanged"];

/// What they are held against: an ordinary street, or where recordings are not at hand the trail.
const ORDINARY: [&str; 2] = ["kitti-urban", "trail"];

/// Most that a frame made to cost much may take, of 100 that an ordinary one takes.
const WORST: u64 = 130;

/// Which of the pictures made to cost much cost too much.
pub(super) fn worst(said: &Said) -> Vec<String> {
    let total = |run: &Run| most(run).last().map_or(0, |(_, instructions)| *instructions);
    let of = |case: &'static str| said.runs.iter().filter(move |run| run.case == case);
    let ordinary = ORDINARY.into_iter().find(|case| of(case).next().is_some()).unwrap_or(ORDINARY[1]);
    let mut wrong = Vec::new();
    for typical in of(ordinary) {
        let same = HURTING.into_iter().flat_map(of).filter(|run| run.backend == typical.backend);
        let Some(hardest) = same.max_by_key(|run| total(run)) else {
            wrong.push(format!("{}: no pictures that are made to cost much", typical.backend));
            continue;
        };
        let percent = 100 * total(hardest) / total(typical).max(1);
        println!("{}: the hardest frame, {}, takes {percent} % of {ordinary}", typical.backend, hardest.case);
        if percent > WORST {
            wrong.push(format!(
                "{}: {} takes {percent} % of {ordinary}, at most {WORST}",
                typical.backend, hardest.case
            ));
        }
    }
    wrong
}

/// What differs from `bounds/image/instructions.golden`; with `BLESS=1` it is written anew.
pub(super) fn check(said: &Said) -> Result<Vec<String>, String> {
    let path = PathBuf::from(ROOT).join("bounds/image/instructions.golden");
    let fail = |error| format!("{}: {error}", path.display());
    let runs = said.runs.iter().filter(|run| CASES.contains(&run.case.as_str()));
    let found: Vec<(String, u64)> = runs
        .flat_map(|run| {
            let name = move |stage: String| format!("{} {} {stage}", run.case, run.backend);
            most(run).into_iter().map(move |(stage, instructions)| (name(stage), instructions))
        })
        .collect();
    if env::var_os("BLESS").is_some_and(|value| value == "1") {
        let lines: String = found.iter().map(|(name, instructions)| format!("{name} {instructions}\n")).collect();
        fs::write(&path, lines).map_err(fail)?;
    }
    let text = fs::read_to_string(&path).map_err(fail)?;
    let golden: Vec<(&str, u64)> = text
        .lines()
        .filter_map(|line| line.rsplit_once(' '))
        .filter_map(|(name, number)| Some((name, number.parse().ok()?)))
        .collect();
    let mut wrong = Vec::new();
    for (name, expected) in &golden {
        match found.iter().find(|(found, _)| found == name) {
            // A few ticks of the timer are neither here nor there.
            Some((_, found)) if found.abs_diff(*expected) <= (expected * TOLERANCE / 100).max(1000) => {}
            Some((_, found)) => wrong.push(format!(
                "{name}: {found} instructions, {expected} were agreed; if the change is meant, run \
                 `BLESS=1 bounds/image/run` and commit bounds/image/instructions.golden, saying why"
            )),
            None => wrong.push(format!("{name}: the image says nothing of it")),
        }
    }
    if golden.len() != found.len() {
        wrong.push(format!("{} counts, {} were agreed; see docs/testing.md", found.len(), golden.len()));
    }
    Ok(wrong)
}
