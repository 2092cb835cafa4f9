//! The same stages for a fuzzer: any bytes are a stage and the numbers that its pictures are made of.

use std::collections::BTreeMap;

use super::{
    Trial, Worst,
    genome::{Genome, NUMBERS},
    rig::{Rig, Small},
};
use crate::work::StageWork;

/// The stages of the smallest size of pictures that is bounded.
pub struct Attack {
    rig: Small,
    works: Vec<StageWork>,
}

/// What an input took.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// Its stage, as a place in the order of the data.
    pub stage: usize,
    /// Steps and bound of all loops together, then of each loop.
    pub steps: Vec<(u64, u64)>,
}

impl Attack {
    /// Prepares the stages.
    #[must_use]
    pub fn new() -> Self {
        let rig = Small::new();
        let works = rig.shape().stages();
        Self { rig, works }
    }

    /// Runs the stage that the first byte names with the pictures that the others describe.
    ///
    /// # Panics
    /// If a bound is exceeded, with the lines for `bounds/worst.toml` that show it.
    pub fn run(&mut self, bytes: &[u8]) -> Outcome {
        let stage = usize::from(bytes.first().copied().unwrap_or(0)) % self.works.len();
        let genome = Genome::of_bytes(bytes.get(1..).unwrap_or_default());
        let mut trial = Trial::new(&mut self.rig, &self.works[stage]);
        trial.steps(&genome);
        let work = &self.works[stage];
        if !trial.over.is_empty() {
            let worst = Worst(BTreeMap::from([(work.stage.to_owned(), vec![genome])])).to_toml();
            panic!("{:?}, by\n{}", trial.over, worst.unwrap_or_default());
        }
        let loops = trial.loops.iter().zip(&work.loops).map(|(steps, (_, bound))| (*steps, *bound));
        Outcome { stage, steps: [(trial.total, work.total)].into_iter().chain(loops).collect() }
    }

    /// The inputs that stand for what is kept, to begin from.
    #[must_use]
    pub fn inputs(&self, worst: &Worst) -> Vec<Vec<u8>> {
        let stages = self.works.iter().enumerate();
        let kept = stages.flat_map(|(stage, work)| {
            let genomes = worst.0.get(work.stage).map(Vec::as_slice).unwrap_or_default();
            genomes.iter().map(move |genome| [vec![stage as u8], genome.to_bytes()].concat())
        });
        kept.collect()
    }
}

impl Default for Attack {
    fn default() -> Self {
        Self::new()
    }
}

impl Genome {
    /// Numbers and patches from bytes, four each; what is missing is zero.
    fn of_bytes(bytes: &[u8]) -> Self {
        let mut words = bytes.chunks(4).map(|chunk| {
            let mut word = [0; 4];
            word.iter_mut().zip(chunk).for_each(|(to, from)| *to = *from);
            u32::from_le_bytes(word)
        });
        let numbers = core::array::from_fn::<u32, NUMBERS, _>(|_| words.next().unwrap_or(0));
        Self { numbers, patches: words.collect() }
    }

    fn to_bytes(&self) -> Vec<u8> {
        self.numbers.iter().chain(&self.patches).flat_map(|word| word.to_le_bytes()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_is_the_same_as_bytes() {
        let worst = toml::from_str::<Worst>(include_str!("../../worst.toml")).unwrap();
        for genome in worst.0.values().flatten() {
            assert_eq!(Genome::of_bytes(&genome.to_bytes()), *genome);
        }
        let count = worst.0.values().flatten().count();
        assert_eq!(Attack::new().inputs(&worst).len(), count);
    }

    #[test]
    fn an_input_takes_what_its_pictures_take() {
        let _one = super::super::tests::ONE.lock();
        let worst = toml::from_str::<Worst>(include_str!("../../worst.toml")).unwrap();
        let mut attack = Attack::new();
        let inputs = attack.inputs(&worst);
        let near = |outcome: &Outcome| outcome.steps[0].0 * 100 >= outcome.steps[0].1 * 90;
        let stages: std::collections::BTreeSet<usize> =
            inputs.iter().map(|input| attack.run(input)).filter(near).map(|outcome| outcome.stage).collect();
        assert_eq!(stages, (0..attack.works.len()).collect(), "stages that come near to their bound");
    }

    #[test]
    #[should_panic(expected = "work 128x96x16.validate: the bound is 100")]
    fn a_bound_that_is_exceeded_is_told_with_its_pictures() {
        let _one = super::super::tests::ONE.lock();
        let mut attack = Attack::new();
        let stage = attack.works.iter().position(|work| work.stage == "validate").unwrap();
        attack.works[stage].total = 100;
        attack.run(&[stage as u8]);
    }
}
