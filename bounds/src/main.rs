//! What Fencepost takes at most, as numbers: memory, bus and stack, held against a budget. See `docs/bounds.md`.
#![deny(unsafe_code)]

mod budget;
mod bus;
mod figures;
mod image;
mod instructions;
mod latency;
mod memory;
mod painted;
mod report;
mod taken;

use std::{path::PathBuf, process::ExitCode};

use anyhow::{Context, Result};
use clap::{Args, Parser, Subcommand};
#[cfg(feature = "search")]
use fencepost_work::search;
use fencepost_work::work;

use figures::Figures;

/// What Fencepost takes at most of memory, bus and stack.
#[derive(Parser)]
#[command(name = "fencepost-bounds", version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Prints everything that is known.
    Report {
        #[command(flatten)]
        images: Images,
    },
    /// Compares with the budget; the exit status is 1 if a row is over it.
    Check {
        #[command(flatten)]
        images: Images,
        /// The budget.
        #[arg(long, default_value = "bounds/budget.toml")]
        budget: PathBuf,
    },
    /// Prints how long it takes from the exposure to the last CAN frame on a platform; the exit status is 1 if it does not keep up with
    /// its camera.
    Latency {
        /// What the platform takes; bounds/platforms has an example.
        #[arg(long)]
        platform: PathBuf,
        /// An image: stages take what its machine code takes at most, and not what was measured.
        #[arg(long)]
        image: Option<PathBuf>,
    },
    /// Compares the stack that an image was seen to take with what its code can take; the exit status is 1 if it took more, or too
    /// little for the bound to say much.
    Painted {
        /// The image; functions whose names begin with `entry_` are bounded.
        #[arg(long)]
        image: PathBuf,
        /// What it printed, with lines `stack NAME BYTES`.
        #[arg(long)]
        said: PathBuf,
    },
    /// Compares the instructions that the worst pictures were seen to take with what the code can take; the exit status is 1 if a stage
    /// took more, or too little for the bound to say much.
    Taken {
        /// The image that ran; stages whose functions it does not have are looked up in the budget.
        #[arg(long)]
        image: PathBuf,
        /// What it printed, with lines `taken STAGE INSTRUCTIONS`.
        #[arg(long)]
        said: PathBuf,
        /// The budget.
        #[arg(long, default_value = "bounds/budget.toml")]
        budget: PathBuf,
    },
    /// Runs the pictures that cost the most against the bounds of the work, and looks for worse ones; the exit status is 1 if a bound
    /// is exceeded, or says little because nothing comes near to it.
    #[cfg(feature = "search")]
    Search {
        /// The worst that is known.
        #[arg(long, default_value = "bounds/worst.toml")]
        worst: PathBuf,
        /// Pictures to try for each stage, beside those that are known.
        #[arg(long, default_value_t = 0)]
        rounds: usize,
        /// Seed of the search.
        #[arg(long, default_value_t = 1)]
        seed: u32,
        /// Only one stage.
        #[arg(long)]
        stage: Option<String>,
        /// Writes the pictures that are known for `fencepost-worst` in bounds/image.
        #[arg(long)]
        inputs: Option<PathBuf>,
        /// Climbs on the instructions that the stages take on the microcontroller that QEMU simulates, and not on steps: the program
        /// `fencepost-worst` of bounds/image.
        #[arg(long)]
        image: Option<PathBuf>,
        /// Keeps what was found.
        #[arg(long)]
        write: bool,
    },
    /// Prints what the bound of instructions of a stage is made of: the blocks of the code that take the most of it.
    Blocks {
        /// An image, as for `check`.
        #[arg(long)]
        image: PathBuf,
        /// The stage.
        #[arg(long)]
        stage: String,
    },
    /// Prints a budget that is what is found now.
    Budget {
        #[command(flatten)]
        images: Images,
        /// The budget whose limits are kept.
        #[arg(long, default_value = "bounds/budget.toml")]
        budget: PathBuf,
    },
}

/// Images for thumbv7em-none-eabihf that `bounds/entries/build` has made. What is not given is not looked at, and said.
#[derive(Args)]
struct Images {
    /// The image of the profile `release`: stack, memory on the microcontroller, allocators.
    #[arg(long)]
    image: Option<PathBuf>,
    /// The image of the profile `checked`: panics.
    #[arg(long)]
    checked: Option<PathBuf>,
}

fn main() -> ExitCode {
    match run(&Cli::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(1),
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}

/// Says whether everything is as it must be.
fn run(cli: &Cli) -> Result<bool> {
    let of = |images: &Images| Figures::find(images.image.as_deref(), images.checked.as_deref());
    match &cli.command {
        Command::Report { images } => {
            let figures = of(images)?;
            print!("{}", report::text(&figures));
            Ok(figures.faults.is_empty())
        }
        Command::Check { images, budget } => {
            let budget = budget::Budget::read(budget)?;
            let findings = budget.compare(&of(images)?);
            print!("{findings}");
            Ok(findings.are_good())
        }
        Command::Latency { platform, image } => {
            let figures = image.as_deref().map(|image| Figures::find(Some(image), None)).transpose()?;
            let bounds = figures.and_then(|figures| figures.instructions).unwrap_or_default();
            let latency = latency::Platform::read(platform)?.latency(&bounds)?;
            print!("{latency}");
            Ok(latency.keeps_up())
        }
        Command::Painted { image, said } => {
            let painted = painted::Painted::of(image, said)?;
            print!("{painted}");
            Ok(painted.is_good())
        }
        Command::Taken { image, said, budget } => {
            let taken = taken::Taken::of(image, said, &budget::Budget::read(budget)?)?;
            print!("{taken}");
            Ok(taken.is_good())
        }
        #[cfg(feature = "search")]
        Command::Search { worst, rounds, seed, stage, inputs, image, write } => {
            println!("seed {seed}");
            let (known, stage) = (search::Worst::read(worst)?, stage.as_deref());
            let (text, good, found) = match image {
                Some(image) => {
                    let (text, found) = search::search_instructions(&known, *rounds, *seed, stage, image)?;
                    (text, true, found)
                }
                None => search::search(&known, *rounds, *seed, stage),
            };
            print!("{text}");
            if let Some(inputs) = inputs {
                let bytes = search::inputs(&known);
                std::fs::write(inputs, bytes).with_context(|| format!("cannot write {}", inputs.display()))?;
            }
            if *write {
                std::fs::write(worst, found.to_toml()?).with_context(|| format!("cannot write {}", worst.display()))?;
            }
            Ok(good)
        }
        Command::Blocks { image, stage } => {
            let bounds = Figures::find(Some(image), None)?.instructions.unwrap_or_default();
            let bound = bounds.iter().find(|bound| bound.stage == stage);
            let names: Vec<_> = bounds.iter().map(|bound| bound.stage).collect();
            let bound = bound.with_context(|| format!("`{stage}` has no bound in the image; {names:?} have one"))?;
            println!("{} of {} instructions, by blocks", bound.stage, bound.instructions);
            for share in &bound.blocks {
                println!("{share}");
            }
            Ok(true)
        }
        Command::Budget { images, budget } => {
            let limits = budget::Budget::read(budget)?.limits;
            print!("{}", budget::Budget::of(&of(images)?, limits).to_toml()?);
            Ok(true)
        }
    }
}
