//! The search for the worst: hill climbing over what the pictures are made of, against the bounds of `work`.

mod genome;
mod rig;

use std::{collections::BTreeMap, fmt::Write, path::Path};

use anyhow::{Context, Result};
use fencepost_core::work::LOOPS;
use serde::{Deserialize, Serialize};

use crate::work::{Shape, StageWork};
use genome::{Genome, Random};
use rig::{Rig, Robot, Small, Taken};

/// Least share of the bound that the best attack on every stage has to reach, percent.
const NEAR_PERCENT: f64 = 90.0;

/// The worst that was found, by stage; kept as a regression.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Worst(BTreeMap<String, Vec<Genome>>);

impl Worst {
    /// # Errors
    /// The file cannot be read or is none of these.
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read {}: run from the root of the repository", path.display()))?;
        toml::from_str(&text).with_context(|| format!("{} cannot be used", path.display()))
    }

    pub(crate) fn to_toml(&self) -> Result<String> {
        let head = "# The pictures that cost the most of all that were tried, for each stage: numbers that they are made of.\n\
                    # `fencepost-bounds search` runs them; with --rounds it goes on from them, and --write keeps what it finds.\n\n";
        Ok(head.to_owned() + &toml::to_string(self).context("it cannot be written")?)
    }
}

/// How near a stage came to its bound.
struct Found {
    work: StageWork,
    /// Steps of the most that was seen of each loop, with whatever picture, and of all together.
    loops: Vec<u64>,
    total: u64,
    best: Genome,
}

/// Runs what is kept and goes on from it for `rounds` rounds for each stage; returns what to print, whether it is as it must be, and
/// the worst that was found.
pub(crate) fn search(kept: &Worst, rounds: usize, seed: u32, only: Option<&str>) -> (String, bool, Worst) {
    let (mut text, mut good, mut worst) = (String::new(), true, Worst::default());
    let mut rigs: [Box<dyn Rig>; 2] = [Box::new(Small::new()), Box::new(Robot::new())];
    let stages = rigs[0].shape().stages();
    for stage in stages.iter().map(|work| work.stage) {
        let mut genomes = kept.0.get(stage).cloned().unwrap_or_default();
        if only.is_none_or(|only| only == stage) && rounds > 0 {
            // What is worst for small pictures need not be so for larger ones: the best for each is kept.
            let best = rigs.each_mut().map(|rig| climb(&mut **rig, stage, &genomes, rounds, seed));
            genomes = best.into();
            genomes.dedup();
        }
        for rig in &mut rigs {
            let found = Found::of(&mut **rig, stage, &genomes);
            text += &found.text(&rig.shape(), &mut good);
        }
        worst.0.insert(stage.to_owned(), genomes);
    }
    (text, good, worst)
}

/// The best of a few starts, each changed as long as it does not get better by it.
fn climb(rig: &mut dyn Rig, stage: &str, known: &[Genome], rounds: usize, seed: u32) -> Genome {
    let mut random = Random::seeded(seed);
    let mut candidates: Vec<Genome> = known.to_vec();
    let known = candidates.len();
    candidates.extend((0..rounds / 2).map(|_| Genome::random(&mut random)));
    let mut scored: Vec<(u64, Genome)> =
        candidates.into_iter().map(|genome| (total(rig, stage, &genome), genome)).collect();
    scored.sort_by_key(|(steps, _)| std::cmp::Reverse(*steps));
    scored.truncate(3.max(known));
    for (steps, genome) in &mut scored {
        for _ in 0..rounds / 2 {
            let changed = genome.changed(&mut random);
            let now = total(rig, stage, &changed);
            // As many is as good: on a plain one has to walk.
            if now >= *steps && (now > *steps || changed.patches.len() <= genome.patches.len()) {
                (*steps, *genome) = (now, changed);
            }
        }
    }
    scored.into_iter().max_by_key(|(steps, _)| *steps).map(|(_, genome)| genome).unwrap_or_default()
}

/// Whether a loop belongs to the stage: surfaces are joined for the ground and for the obstacles.
fn belongs(stage: &str, of: &str) -> bool {
    of == stage || (of == "regions" && (stage == "ground" || stage == "obstacles"))
}

fn of_stage(stage: &str, taken: &Taken) -> u64 {
    LOOPS.iter().zip(taken).filter(|((of, _), _)| belongs(stage, of)).map(|(_, steps)| steps).sum()
}

fn total(rig: &mut dyn Rig, stage: &str, genome: &Genome) -> u64 {
    of_stage(stage, &rig.run(stage, genome))
}

impl Found {
    fn of(rig: &mut dyn Rig, stage: &str, genomes: &[Genome]) -> Self {
        let work = rig.shape().stages().into_iter().find(|work| work.stage == stage).expect("stages are the same");
        let mut found = Self { loops: vec![0; work.loops.len()], work, total: 0, best: Genome::default() };
        for genome in genomes {
            let taken = rig.run(stage, genome);
            let steps = of_stage(stage, &taken);
            if steps > found.total {
                (found.total, found.best) = (steps, genome.clone());
            }
            for ((name, _), most) in found.work.loops.iter().zip(&mut found.loops) {
                let at = LOOPS.iter().position(|(of, loops)| belongs(stage, of) && loops == name);
                let steps = at.and_then(|at| taken.get(at)).copied().expect("every bounded loop is counted");
                *most = steps.max(*most);
            }
        }
        found
    }

    fn text(&self, shape: &Shape, good: &mut bool) -> String {
        let name = format!("{}x{}x{}.{}", shape.width, shape.height, shape.disparities, self.work.stage);
        let share = |steps: u64, bound: u64| 100.0 * steps as f64 / bound.max(1) as f64;
        let mut text = String::new();
        let reached = share(self.total, self.work.total);
        writeln!(text, "{name:<22} {:>10} of {:>10} steps, {reached:5.1} %", self.total, self.work.total)
            .expect("a string takes it");
        for ((loops, bound), steps) in self.work.loops.iter().zip(&self.loops) {
            writeln!(text, "    {loops:<26} {steps:>10} of {bound:>10}, {:5.1} %", share(*steps, *bound))
                .expect("a string takes it");
            if steps > bound {
                *good = false;
                text += &format!("OVER THE BOUND: work {name}.{loops}: {steps}, the bound is {bound}\n");
            }
        }
        if self.total > self.work.total {
            *good = false;
            text += &format!("OVER THE BOUND: work {name}: {}, the bound is {}\n", self.total, self.work.total);
        }
        if reached < NEAR_PERCENT {
            *good = false;
            text += &format!("SAYS LITTLE: work {name}: the worst that is known takes {reached:.1} % of the bound\n");
        }
        text
    }
}
