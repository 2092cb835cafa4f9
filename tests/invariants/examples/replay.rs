//! Runs every file of folders of targets, and the seeds of all: `cargo run -p fencepost-invariants --example replay -- FOLDER...`.

use std::{fs, path::Path};

use fencepost_invariants::{TARGETS, run, seeds};

fn main() -> std::io::Result<()> {
    for target in TARGETS {
        let mut count = seeds(target.name).iter().map(|seed| run(target.name, seed)).count();
        for folder in std::env::args_os().skip(1).map(|folder| Path::new(&folder).join(target.name)) {
            if !folder.is_dir() {
                continue;
            }
            for file in fs::read_dir(folder)? {
                // A fuzzer that runs meanwhile takes away what it has found something shorter for.
                let Ok(bytes) = fs::read(file?.path()) else { continue };
                run(target.name, &bytes);
                count += 1;
            }
        }
        println!("{}: {count} inputs", target.name);
    }
    Ok(())
}
