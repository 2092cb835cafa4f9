//! The search for the worst: hill climbing over what the pictures are made of, against the bounds of `work`.

mod attack;
mod genome;
mod rig;
mod simulator;

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
};

use anyhow::{Context, Result};
use fencepost_core::work::LOOPS;
use serde::{Deserialize, Serialize};

use crate::work::{Shape, StageWork};
pub use attack::{Attack, Outcome};
use genome::{Genome, Random};
use rig::{Rig, Robot, Small, Taken};
pub use simulator::search_instructions;

/// Least share of the bound that the best attack on every stage has to reach, percent.
const NEAR_PERCENT: f64 = 90.0;

/// The worst that was found, by stage; kept as a regression.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Worst(BTreeMap<String, Vec<Genome>>);

impl Worst {
    /// # Errors
    /// The file cannot be read or is none of these.
    pub fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path)
            .with_context(|| format!("cannot read {}: run from the root of the repository", path.display()))?;
        toml::from_str(&text).with_context(|| format!("{} cannot be used", path.display()))
    }

    /// The text of such a file.
    ///
    /// # Errors
    /// It cannot be written as TOML.
    pub fn to_toml(&self) -> Result<String> {
        let head = "# The pictures that cost the most of all that were tried, for each stage: numbers that they are made of.\n\
                    # `fencepost-bounds search` runs them; with --rounds it goes on from them, and --write keeps what it finds.\n\n";
        Ok(head.to_owned() + &toml::to_string(self).context("it cannot be written")?)
    }
}

/// Runs what is kept and goes on from it for `rounds` rounds for each stage; returns what to print, whether it is as it must be, and
/// the worst that was found. Every picture that is tried is held against the bounds, not only those that are kept.
pub fn search(kept: &Worst, rounds: usize, seed: u32, only: Option<&str>) -> (String, bool, Worst) {
    let (mut text, mut good, mut worst) = (String::new(), true, Worst::default());
    let mut rigs: [Box<dyn Rig>; 2] = [Box::new(Small::new()), Box::new(Robot::new())];
    let [small, robot] = rigs.each_ref().map(|rig| rig.shape().stages());
    for works in small.into_iter().zip(robot).map(|(small, robot)| [small, robot]) {
        let stage = works[0].stage;
        let mut genomes = kept.0.get(stage).cloned().unwrap_or_default();
        let mut over = BTreeSet::new();
        let [small, robot] = &mut rigs;
        let mut trials = [Trial::new(&mut **small, &works[0]), Trial::new(&mut **robot, &works[1])];
        if only.is_none_or(|only| only == stage) && rounds > 0 {
            // What is worst for small pictures need not be so for larger ones: the best for each is kept.
            let best = trials.each_mut().map(|trial| trial.climb(&genomes, rounds, seed));
            genomes = best.into();
            genomes.dedup();
        }
        for trial in &mut trials {
            genomes.iter().for_each(|genome| _ = trial.steps(genome));
            text += &trial.text();
            over.append(&mut trial.over);
            good &= trial.share() >= NEAR_PERCENT;
        }
        good &= over.is_empty();
        over.iter().for_each(|over| text += &format!("OVER THE BOUND: {over}\n"));
        worst.0.insert(stage.to_owned(), genomes);
    }
    (text, good, worst)
}

/// The pictures that are kept, for pictures of 320 x 240, as bounds/image/src/worst.rs reads them: for each the name of its stage, 16
/// bytes, its numbers, and the pair of pictures, the disparities or the cells that the stage begins with.
pub fn inputs(kept: &Worst) -> Vec<u8> {
    let (size, largest) = ((320, 240), 16 * 47);
    let mut bytes = Vec::new();
    for (stage, genome) in kept.0.iter().flat_map(|(stage, genomes)| genomes.iter().map(move |genome| (stage, genome)))
    {
        bytes.extend(stage.bytes().chain(std::iter::repeat(0)).take(16));
        bytes.extend(genome.numbers.iter().flat_map(|number| number.to_le_bytes()));
        match stage.as_str() {
            "rectify" | "match" | "health" => bytes.extend(genome.pair_of(stage, size).concat()),
            "wire" => bytes.extend(rig::states(genome)),
            _ => bytes.extend(genome.disparities(size, largest).iter().flat_map(|steps| steps.to_le_bytes())),
        }
    }
    bytes.extend([0; 16]);
    bytes
}

/// Whether a loop belongs to the stage: surfaces are joined for the ground and for the obstacles.
fn belongs(stage: &str, of: &str) -> bool {
    of == stage || (of == "regions" && (stage == "ground" || stage == "obstacles"))
}

/// A stage with one size of pictures, and what was seen of it.
struct Trial<'a> {
    rig: &'a mut dyn Rig,
    work: &'a StageWork,
    name: String,
    /// Steps of the most that was seen of each loop, with whatever picture, and of all together.
    loops: Vec<u64>,
    total: u64,
    tried: usize,
    /// Bounds that were exceeded.
    over: BTreeSet<String>,
}

impl<'a> Trial<'a> {
    fn new(rig: &'a mut dyn Rig, work: &'a StageWork) -> Self {
        let Shape { width, height, disparities, .. } = rig.shape();
        let name = format!("{width}x{height}x{disparities}.{}", work.stage);
        Self { rig, work, name, loops: vec![0; work.loops.len()], total: 0, tried: 0, over: BTreeSet::new() }
    }

    /// Steps that the stage takes with the pictures of `genome`.
    fn steps(&mut self, genome: &Genome) -> u64 {
        let taken = self.rig.run(self.work.stage, genome);
        self.take(&taken)
    }

    /// Holds what was taken against the bounds.
    fn take(&mut self, taken: &Taken) -> u64 {
        let of = |of: &str| belongs(self.work.stage, of);
        let total = LOOPS.iter().zip(taken).filter(|((stage, _), _)| of(stage)).map(|(_, steps)| steps).sum();
        for ((name, bound), most) in self.work.loops.iter().zip(&mut self.loops) {
            let at = LOOPS.iter().position(|(stage, loops)| of(stage) && loops == name);
            let steps = at.and_then(|at| taken.get(at)).copied().expect("every bounded loop is counted");
            *most = steps.max(*most);
            if steps > *bound {
                self.over.insert(format!("work {}.{name}: the bound is {bound}", self.name));
            }
        }
        if total > self.work.total {
            self.over.insert(format!("work {}: the bound is {}", self.name, self.work.total));
        }
        self.total = self.total.max(total);
        self.tried += 1;
        total
    }

    fn climb(&mut self, known: &[Genome], rounds: usize, seed: u32) -> Genome {
        climb(known, rounds, seed, &mut |genome| self.steps(genome))
    }

    /// How near the worst came to the bound, percent.
    fn share(&self) -> f64 {
        percent(self.total, self.work.total)
    }

    fn text(&self) -> String {
        let Self { name, total, work, tried, .. } = self;
        let reached = self.share();
        let mut text = format!("{name:<22} {total:>10} of {:>10} steps, {reached:5.1} %; {tried} tried\n", work.total);
        for ((loops, bound), steps) in work.loops.iter().zip(&self.loops) {
            text += &format!("    {loops:<26} {steps:>10} of {bound:>10}, {:5.1} %\n", percent(*steps, *bound));
        }
        if reached < NEAR_PERCENT {
            text += &format!("SAYS LITTLE: work {name}: the worst that is known takes {reached:.1} % of the bound\n");
        }
        text
    }
}

/// The best of a few starts, each changed as long as it does not get better by it. Of a stage that nothing is known of, random pictures
/// are the first.
fn climb(known: &[Genome], rounds: usize, seed: u32, measure: &mut dyn FnMut(&Genome) -> u64) -> Genome {
    let mut random = Random::seeded(seed);
    let mut candidates: Vec<Genome> = known.to_vec();
    candidates.extend((0..rounds / 2).map(|_| Genome::random(&mut random)));
    let mut scored: Vec<(u64, Genome)> = candidates.into_iter().map(|genome| (measure(&genome), genome)).collect();
    scored.sort_by_key(|(taken, _)| std::cmp::Reverse(*taken));
    scored.truncate(3.max(known.len()));
    for (taken, genome) in &mut scored {
        for _ in 0..rounds / 2 {
            let changed = genome.changed(&mut random);
            let now = measure(&changed);
            // As many is as good: on a plain one has to walk.
            if now > *taken || (now == *taken && changed.patches.len() <= genome.patches.len()) {
                (*taken, *genome) = (now, changed);
            }
        }
    }
    scored.into_iter().max_by_key(|(taken, _)| *taken).map(|(_, genome)| genome).unwrap_or_default()
}

fn percent(steps: u64, bound: u64) -> f64 {
    100.0 * steps as f64 / bound.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts are those of the whole program: one test at a time.
    pub(super) static ONE: std::sync::Mutex<()> = std::sync::Mutex::new(());

    #[test]
    fn a_step_more_than_the_bound_is_told_by_name() {
        let _one = ONE.lock();
        let mut rig = Small::new();
        let mut work = rig.shape().stages().into_iter().find(|work| work.stage == "validate").unwrap();
        let worst = toml::from_str::<Worst>(include_str!("../../worst.toml")).unwrap();
        let genome = &worst.0["validate"][0];
        let mut trial = Trial::new(&mut rig, &work);
        assert_eq!(trial.steps(genome), work.total);
        assert!(trial.over.is_empty(), "{:?}", trial.over);
        // One more loop over the runs than is reckoned with is the same as a bound that is one loop too small.
        work.loops.iter_mut().find(|(name, _)| *name == "runs").unwrap().1 -= 1;
        work.total -= 1;
        let mut trial = Trial::new(&mut rig, &work);
        trial.steps(genome);
        let over: Vec<_> = trial.over.iter().map(String::as_str).collect();
        let expected =
            ["work 128x96x16.validate.runs: the bound is 12287", "work 128x96x16.validate: the bound is 61695"];
        assert_eq!(over, expected);
    }

    #[test]
    fn random_pictures_stay_within_the_bounds() {
        let _one = ONE.lock();
        let mut rig = Small::new();
        for work in rig.shape().stages() {
            let mut trial = Trial::new(&mut rig, &work);
            trial.climb(&[], 60, 77);
            assert!(trial.over.is_empty(), "{:?}", trial.over);
            assert!(trial.total > 0, "{}", work.stage);
        }
    }

    #[test]
    fn turned_cameras_see_what_is_compared_most_while_hardly_anything_matches() {
        let _one = ONE.lock();
        let mut rig = Robot::new();
        let work = rig.shape().stages().into_iter().find(|work| work.stage == "health").unwrap();
        let worst = toml::from_str::<Worst>(include_str!("../../worst_instructions.toml")).unwrap();
        let genome = &worst.0["health"][0];
        assert!(Genome::is_turned("health", &genome.numbers));
        let mut trial = Trial::new(&mut rig, &work);
        trial.steps(genome);
        let share = |of: &str| {
            let at = work.loops.iter().position(|(name, _)| *name == of).unwrap();
            percent(trial.loops[at], work.loops[at].1)
        };
        // Strips are matched the other way round, whose pixels count.
        assert_eq!(share("pixels"), 100.0);
        assert!(share("patches_compared") >= 90.0, "{}", share("patches_compared"));
    }
}
