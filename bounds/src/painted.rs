//! What an image was seen to take of its stack, held against what its code can take.

use std::{collections::BTreeMap, fmt, fs, path::Path};

use anyhow::{Context, Result};

use crate::figures::Figures;

/// Least share of the bound that the deepest entry was seen to take, percent: below it the bound would say little.
const LEAST_PERCENT: u64 = 60;

/// The entries of an image: what was seen of each, and its bound.
pub(crate) struct Painted {
    rows: Vec<(String, u64, Option<u64>)>,
    faults: Vec<String>,
}

impl Painted {
    /// Reads what the image said, lines `stack NAME BYTES`, and bounds its functions `entry_NAME`.
    ///
    /// # Errors
    /// A file cannot be read or used.
    pub(crate) fn of(image: &Path, said: &Path) -> Result<Self> {
        let text = fs::read_to_string(said)
            .with_context(|| format!("{} cannot be read; it is what the image prints", said.display()))?;
        let mut seen = BTreeMap::<String, u64>::new();
        for line in text.lines() {
            let mut words = line.split_whitespace();
            if let (Some("stack"), Some(name), Some(bytes)) = (words.next(), words.next(), words.next()) {
                let bytes: u64 =
                    bytes.parse().with_context(|| format!("{}: `{line}` has no number", said.display()))?;
                let most = seen.entry(name.to_owned()).or_default();
                *most = bytes.max(*most);
            }
        }
        let figures = Figures::find(Some(image), None)?;
        let depths = figures.stack.map(|stack| stack.depths).unwrap_or_default();
        let rows = seen.into_iter().map(|(name, bytes)| {
            let bound = depths.get(&format!("entry_{name}")).copied();
            (name, bytes, bound)
        });
        Ok(Self { rows: rows.collect(), faults: figures.faults })
    }

    /// Whether every entry stays within its bound, and the deepest one comes near to it.
    pub(crate) fn is_good(&self) -> bool {
        self.faults.is_empty() && self.bad().next().is_none()
    }

    fn bad(&self) -> impl Iterator<Item = String> {
        // By its bound: what was seen of it is what is in question.
        let deepest = self.rows.iter().max_by_key(|(_, _, bound)| *bound);
        let near = deepest.is_some_and(|(_, seen, bound)| bound.is_some_and(|b| 100 * seen >= LEAST_PERCENT * b));
        let far = (!near).then(|| format!("the deepest entry takes less than {LEAST_PERCENT} % of its bound"));
        let over = self.rows.iter().filter_map(|(name, seen, bound)| match bound {
            None => Some(format!("{name}: the image has no `entry_{name}`")),
            Some(bound) if seen > bound => Some(format!("{name}: {seen} bytes were seen, the bound is {bound}")),
            Some(_) => None,
        });
        over.chain(far)
    }
}

impl fmt::Display for Painted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, seen, bound) in &self.rows {
            let Some(bound) = bound else { continue };
            writeln!(f, "stack {name}: {seen} bytes seen, {bound} at most by its code ({} %)", 100 * seen / bound)?;
        }
        self.faults.iter().cloned().chain(self.bad()).try_for_each(|bad| writeln!(f, "NOT BOUNDED: {bad}"))
    }
}
