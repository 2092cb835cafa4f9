//! The search for what takes the most instructions: the same pictures, run on the microcontroller that QEMU simulates.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

use anyhow::{Context, Result, bail};

use super::{Worst, climb, genome::Genome, inputs};

/// Goes on for `rounds` rounds from what is kept of each stage; returns what to print, and the worst that was found. `image` is
/// `fencepost-worst` of bounds/image.
///
/// # Errors
/// The simulator cannot be run, or does not say what a stage takes.
pub fn search_instructions(
    kept: &Worst,
    rounds: usize,
    seed: u32,
    only: Option<&str>,
    image: &Path,
) -> Result<(String, Worst)> {
    let simulator = Simulator::new(image)?;
    let (mut text, mut worst) = (String::new(), kept.clone());
    for (stage, genomes) in &mut worst.0 {
        if only.is_some_and(|only| only != stage) {
            continue;
        }
        let mut failed = None;
        let mut measure = |genome: &Genome| {
            // Once it has failed nothing is worth trying.
            if failed.is_some() {
                return 0;
            }
            simulator.instructions(stage, genome).map_err(|error| failed = Some(error)).unwrap_or_default()
        };
        let best = climb(genomes, rounds, seed, &mut measure);
        let instructions = measure(&best);
        if let Some(error) = failed {
            return Err(error);
        }
        text += &format!("{instructions:>12} instructions  {stage}\n");
        *genomes = vec![best];
    }
    Ok((text, worst))
}

/// The board and its program.
struct Simulator {
    image: PathBuf,
    /// Where the pictures are handed over.
    pictures: PathBuf,
}

impl Simulator {
    fn new(image: &Path) -> Result<Self> {
        if !image.is_file() {
            bail!("{} is no image: bounds/image/run makes it", image.display());
        }
        let pictures = std::env::temp_dir().join(format!("fencepost-worst-{}", std::process::id()));
        Ok(Self { image: image.to_owned(), pictures })
    }

    /// What a stage takes with the pictures of a genome.
    fn instructions(&self, stage: &str, genome: &Genome) -> Result<u64> {
        let only = Worst(BTreeMap::from([(stage.to_owned(), vec![genome.clone()])]));
        std::fs::write(&self.pictures, inputs(&only))
            .with_context(|| format!("cannot write {}", self.pictures.display()))?;
        // As in bounds/image/run: time goes by with the instructions.
        let ran = Command::new("qemu-system-arm")
            .args(["-M", "mps2-an500", "-nographic", "-monitor", "none", "-serial", "none"])
            .args(["-semihosting-config", "enable=on,target=native", "-icount", "shift=0", "-kernel"])
            .arg(&self.image)
            .arg("-device")
            .arg(format!("loader,file={},addr=0x60000000,force-raw=on", self.pictures.display()))
            .stdin(Stdio::null())
            .output()
            .context("cannot run qemu-system-arm, of Debian's package of that name")?;
        let said = String::from_utf8_lossy(&ran.stdout);
        let taken =
            said.lines().filter_map(|line| line.strip_prefix("taken ")?.strip_prefix(stage)?.trim().parse().ok());
        taken.max().with_context(|| format!("the image does not say what {stage} takes, but: {said}"))
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        // If it is gone already there is nothing to do.
        let _ = std::fs::remove_file(&self.pictures);
    }
}
