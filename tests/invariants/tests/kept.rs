//! Every seed, and every input that fuzzing has found something with: `fuzz/regressions/TARGET/`.

use std::{collections::BTreeSet, fs, path::Path};

use fencepost_invariants::{TARGETS, run, seeds};

fn fuzz() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz")
}

#[test]
fn seeds_hold() {
    for target in TARGETS {
        let seeds = seeds(target.name);
        assert!(seeds.len() >= 18, "{}: {} seeds", target.name, seeds.len());
        seeds.iter().for_each(|seed| run(target.name, seed));
        println!("{}: {} seeds", target.name, seeds.len());
    }
}

#[test]
fn what_was_found_stays_mended() {
    let known: BTreeSet<&str> = TARGETS.iter().map(|target| target.name).collect();
    let mut count = 0;
    for folder in fs::read_dir(fuzz().join("regressions")).unwrap() {
        let folder = folder.unwrap().path();
        let name = folder.file_name().unwrap().to_str().unwrap().to_owned();
        if !known.contains(name.as_str()) {
            // Targets of the host when only the core is built.
            if cfg!(feature = "host") {
                panic!("{name} is no target");
            }
            continue;
        }
        for file in fs::read_dir(&folder).unwrap() {
            let file = file.unwrap().path();
            println!("{}", file.display());
            run(&name, &fs::read(&file).unwrap());
            count += 1;
        }
    }
    assert!(count > 0, "no regressions were found in {}", fuzz().display());
}

/// `cargo fuzz` has a program for each target, and one that climbs towards the worst case (`docs/bounds.md`).
#[test]
fn every_target_has_a_fuzzer() {
    let programs: BTreeSet<String> = fs::read_dir(fuzz().join("fuzz_targets"))
        .unwrap()
        .map(|file| file.unwrap().path().file_stem().unwrap().to_str().unwrap().to_owned())
        .collect();
    if cfg!(feature = "host") {
        let expected = TARGETS.iter().map(|target| target.name).chain(["worst_case"]);
        assert_eq!(programs, expected.map(str::to_owned).collect());
    }
    let manifest = fs::read_to_string(fuzz().join("Cargo.toml")).unwrap();
    for name in programs {
        assert!(manifest.contains(&format!("name = \"{name}\"")), "{name} is not in fuzz/Cargo.toml");
    }
}
