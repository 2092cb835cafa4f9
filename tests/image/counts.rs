//! Instructions on the target, held against those that were agreed.

use std::{env, fs, path::PathBuf};

use fencepost_tests::at_hand::ROOT;

use super::{check::most, said::Said};

/// Cases that every clone has.
const CASES: [&str; 2] = ["trail", "trail-raw"];

/// What may differ, of 100: more than that, either way, is worth a look.
const TOLERANCE: u64 = 3;

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
