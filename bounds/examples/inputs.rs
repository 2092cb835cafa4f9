//! Writes the worst pictures that are known into a folder, as inputs for the fuzzer `worst_case`:
//! `cargo run -p fencepost-bounds --no-default-features --features search --example inputs -- FOLDER`.

use std::{fs, path::Path};

use anyhow::{Context, Result};
use fencepost_work::search::{Attack, Worst};

fn main() -> Result<()> {
    let folder = std::env::args_os().nth(1).context("usage: inputs FOLDER")?;
    fs::create_dir_all(&folder)?;
    let inputs = Attack::new().inputs(&Worst::read(Path::new("bounds/worst.toml"))?);
    for (number, input) in inputs.iter().enumerate() {
        fs::write(Path::new(&folder).join(format!("kept-{number:03}")), input)?;
    }
    Ok(())
}
