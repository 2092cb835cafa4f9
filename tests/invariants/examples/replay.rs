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
                run(target.name, &fs::read(file?.path())?);
                count += 1;
            }
        }
        println!("{}: {count} inputs", target.name);
    }
    Ok(())
}
