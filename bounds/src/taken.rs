//! Instructions that the worst pictures were seen to take, held against what the code can take.

use std::{collections::BTreeMap, fmt, fs, path::Path};

use anyhow::{Context, Result};

use crate::{
    budget::Budget,
    figures::{Figures, Rows, instruction_rows},
    instructions::SIZE,
};

/// Least share of its bound that a stage was seen to take, percent: below it the bound would say little.
const LEAST_PERCENT: u64 = 70;

/// The stages: what was seen of each, and its bound.
pub(crate) struct Taken {
    rows: Vec<(String, u64, Option<u64>)>,
}

impl Taken {
    /// Reads what the image said, lines `taken STAGE INSTRUCTIONS`, and finds the bounds of its stages.
    ///
    /// # Errors
    /// A file cannot be read or used.
    pub(crate) fn of(image: &Path, said: &Path, budget: &Budget) -> Result<Self> {
        let text = fs::read_to_string(said)
            .with_context(|| format!("{} cannot be read; it is what the image prints", said.display()))?;
        let bounds = Figures::find(Some(image), None)?.instructions.unwrap_or_default();
        Self::parse(&text, &instruction_rows(&bounds), &budget.instructions)
            .with_context(|| format!("{} cannot be used", said.display()))
    }

    fn parse(text: &str, of_image: &Rows, budget: &Rows) -> Result<Self> {
        let mut seen = BTreeMap::<&str, u64>::new();
        for line in text.lines() {
            let mut words = line.split_whitespace();
            if let (Some("taken"), Some(stage), Some(number)) = (words.next(), words.next(), words.next()) {
                let number: u64 = number.parse().with_context(|| format!("`{line}` has no number"))?;
                let most = seen.entry(stage).or_default();
                *most = number.max(*most);
            }
        }
        let (width, height, disparities) = SIZE;
        let rows = seen.into_iter().map(|(stage, taken)| {
            let name = format!("{width}x{height}x{disparities}.{stage}");
            (stage.to_owned(), taken, of_image.get(&name).or_else(|| budget.get(&name)).copied())
        });
        Ok(Self { rows: rows.collect() })
    }

    /// Whether every stage stays within its bound, and comes near to it.
    pub(crate) fn is_good(&self) -> bool {
        !self.rows.is_empty() && self.bad().next().is_none()
    }

    fn bad(&self) -> impl Iterator<Item = String> {
        self.rows.iter().filter_map(|(stage, taken, bound)| match bound {
            Some(bound) if taken > bound => Some(format!("{stage}: {taken} were taken, the bound is {bound}")),
            Some(bound) if 100 * taken < LEAST_PERCENT * bound => {
                Some(format!("{stage}: the worst that is known takes less than {LEAST_PERCENT} % of the bound {bound}"))
            }
            _ => None,
        })
    }
}

impl fmt::Display for Taken {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (stage, taken, bound) in &self.rows {
            match bound {
                Some(bound) => {
                    let percent = 100.0 * *taken as f64 / (*bound).max(1) as f64;
                    writeln!(f, "{taken:>12} of {bound:>12} instructions, {percent:5.1} %  {stage}")?;
                }
                None => writeln!(f, "{taken:>12}    {:>12}                        {stage}, which has no bound", "")?,
            }
        }
        self.bad().try_for_each(|bad| writeln!(f, "BAD: {bad}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn taken(text: &str) -> Taken {
        let row = |figure| Rows::from([("320x240x48.map".to_owned(), figure)]);
        Taken::parse(text, &row(1000), &row(1)).unwrap()
    }

    #[test]
    fn the_most_of_each_stage_is_held_against_its_bound() {
        assert!(taken("taken map 700\ntaken map 1000\ntaken health 7\ndone\n").is_good());
        assert!(!taken("done\n").is_good());
        let told = |text: &str| taken(text).bad().collect::<Vec<_>>();
        assert_eq!(told("taken map 1001\ntaken map 5"), ["map: 1001 were taken, the bound is 1000"]);
        assert_eq!(told("taken map 699"), ["map: the worst that is known takes less than 70 % of the bound 1000"]);
    }

    #[test]
    fn what_is_no_number_is_refused() {
        assert!(Taken::parse("taken map many", &Rows::new(), &Rows::new()).is_err());
    }
}
