//! The budget: what is allowed, row by row, in a file that reviews see.

use std::{fmt, path::Path};

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};

use crate::figures::{Figures, Rows, instruction_rows};

/// The file.
#[derive(Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Budget {
    pub(crate) limits: Limits,
    /// Bytes.
    memory: Rows,
    /// Bytes, frames, bits, microseconds, tenths of a percent.
    bus: Rows,
    /// Steps of loops.
    work: Rows,
    /// Bytes.
    stack: Rows,
    /// Instructions for a frame on a Cortex-M7.
    pub(crate) instructions: Rows,
    /// Calls of panics in the checked image, and entries from which one can be reached.
    panics: Rows,
}

/// What no row may exceed, whatever its budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Limits {
    /// Stack of every entry on a Cortex-M7, bytes.
    pub(crate) stack_bytes: u64,
    /// A whole detector for 320 x 240 pixels and 48 disparities, bytes: so much goes beside two pictures into 1 MiB.
    pub(crate) memory_bytes_320x240x48: u64,
    /// A whole detector for 512 x 384 pixels and 64 disparities, bytes.
    pub(crate) memory_bytes_512x384x64: u64,
}

impl Default for Limits {
    fn default() -> Self {
        Self { stack_bytes: 8192, memory_bytes_320x240x48: 480 * 1024, memory_bytes_512x384x64: 1536 * 1024 }
    }
}

/// What a comparison says.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Findings {
    bad: Vec<String>,
    notes: Vec<String>,
    rows: usize,
}

impl Budget {
    pub(crate) fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).with_context(|| {
            format!("cannot read the budget {}: run from the root of the repository", path.display())
        })?;
        toml::from_str(&text).with_context(|| format!("the budget {} cannot be used", path.display()))
    }

    /// A budget of exactly what is found.
    pub(crate) fn of(figures: &Figures, limits: Limits) -> Self {
        Self {
            limits,
            memory: figures.memory.clone(),
            bus: figures.bus.clone(),
            work: figures.work.clone(),
            stack: figures.stack.as_ref().map(|stack| stack.depths.clone()).unwrap_or_default(),
            instructions: figures.instructions.as_deref().map(instruction_rows).unwrap_or_default(),
            panics: figures.panics.as_ref().map(|panics| panics.rows()).unwrap_or_default(),
        }
    }

    pub(crate) fn to_toml(&self) -> Result<String> {
        let head = "# What Fencepost may take; `fencepost-bounds check` compares. docs/bounds.md says what the rows mean and how to \
                    make this file anew.\n\n";
        Ok(head.to_owned() + &toml::to_string(self).context("the budget cannot be written")?)
    }

    /// Compares row by row.
    pub(crate) fn compare(&self, figures: &Figures) -> Findings {
        let mut findings = Findings::default();
        findings.bad.extend(figures.faults.iter().cloned());
        let mut memory = self.memory.clone();
        if figures.stack.is_none() {
            memory.retain(|name, _| !name.ends_with("_on_thumbv7em"));
        }
        findings.compare("memory", &memory, &figures.memory);
        findings.compare("bus", &self.bus, &figures.bus);
        findings.compare("work", &self.work, &figures.work);
        match &figures.stack {
            Some(stack) => {
                findings.compare("stack", &self.stack, &stack.depths);
                for (name, bytes) in stack.depths.iter().filter(|(_, bytes)| **bytes > self.limits.stack_bytes) {
                    findings.bad.push(format!("stack {name}: {bytes}, the limit is {}", self.limits.stack_bytes));
                }
            }
            None => findings.notes.push("NOT RUN: stack: no --image was given".to_owned()),
        }
        match &figures.instructions {
            Some(bounds) => findings.compare("instructions", &self.instructions, &instruction_rows(bounds)),
            None => findings.notes.push("NOT RUN: instructions: no --image was given".to_owned()),
        }
        match &figures.panics {
            Some(panics) => findings.compare("panics", &self.panics, &panics.rows()),
            None => findings.notes.push("NOT RUN: panics: no --checked image was given".to_owned()),
        }
        let limits = [
            ("320x240x48.whole", self.limits.memory_bytes_320x240x48),
            ("512x384x64.whole", self.limits.memory_bytes_512x384x64),
        ];
        for (name, limit) in limits {
            let found = figures.memory.get(name).copied().unwrap_or(u64::MAX);
            if found > limit {
                findings.bad.push(format!("memory {name}: {found}, the limit is {limit}"));
            }
        }
        findings
    }
}

impl Findings {
    pub(crate) fn are_good(&self) -> bool {
        self.bad.is_empty()
    }

    fn compare(&mut self, table: &str, budget: &Rows, found: &Rows) {
        for (name, found) in found {
            self.rows += 1;
            match budget.get(name) {
                Some(budget) if found > budget => {
                    self.bad.push(format!("{table} {name}: {found}, the budget is {budget} ({} more)", found - budget));
                }
                Some(budget) if found < budget => {
                    self.notes.push(format!("{table} {name}: {found}, the budget of {budget} can be lowered"));
                }
                Some(_) => {}
                None => self.bad.push(format!("{table} {name}: {found}, the budget has no such row")),
            }
        }
        let gone = budget.keys().filter(|name| !found.contains_key(*name));
        self.bad.extend(gone.map(|name| format!("{table} {name}: in the budget, but not found")));
    }
}

impl fmt::Display for Findings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.notes.iter().try_for_each(|note| writeln!(f, "{note}"))?;
        self.bad.iter().try_for_each(|bad| writeln!(f, "OVER THE BUDGET: {bad}"))?;
        writeln!(f, "{} rows compared, {} bad", self.rows, self.bad.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(rows: &[(&str, u64)]) -> Rows {
        rows.iter().map(|(name, figure)| ((*name).to_owned(), *figure)).collect()
    }

    #[test]
    fn more_less_new_and_gone_rows_are_told() {
        let mut findings = Findings::default();
        findings.compare(
            "stack",
            &rows(&[("a", 8), ("b", 8), ("c", 8), ("e", 1)]),
            &rows(&[("a", 8), ("b", 9), ("c", 7), ("d", 1)]),
        );
        assert_eq!(
            findings.bad,
            [
                "stack b: 9, the budget is 8 (1 more)",
                "stack d: 1, the budget has no such row",
                "stack e: in the budget, but not found"
            ]
        );
        assert_eq!(findings.notes, ["stack c: 7, the budget of 8 can be lowered"]);
        assert!(!findings.are_good());
    }

    #[test]
    fn what_is_found_is_within_its_own_budget_and_over_a_smaller_one() {
        let figures = Figures::find(None, None).unwrap();
        let mut budget = Budget::of(&figures, Limits::default());
        assert!(budget.compare(&figures).are_good(), "{}", budget.compare(&figures));
        *budget.memory.get_mut("320x240x48.map").unwrap() -= 1024;
        *budget.bus.get_mut("message_bytes.Ground").unwrap() -= 1;
        *budget.work.get_mut("320x240x48.validate.runs").unwrap() -= 1;
        budget.limits.memory_bytes_512x384x64 = 1024;
        let bad = budget.compare(&figures).bad;
        assert_eq!(bad.len(), 4, "{bad:?}");
        assert!(bad[0].starts_with("memory 320x240x48.map: "), "{bad:?}");
        assert!(bad[1].starts_with("bus message_bytes.Ground: 8"), "{bad:?}");
        assert!(bad[2].starts_with("work 320x240x48.validate.runs: 76800"), "{bad:?}");
        assert!(bad[3].starts_with("memory 512x384x64.whole: "), "{bad:?}");
    }

    #[test]
    fn a_written_budget_reads_back() {
        let budget = Budget::of(&Figures::find(None, None).unwrap(), Limits::default());
        let text = budget.to_toml().unwrap();
        assert_eq!(toml::from_str::<Budget>(&text).unwrap(), budget);
        let unknown = format!("{text}\n[bus_load]\n");
        assert!(toml::from_str::<Budget>(&unknown).unwrap_err().to_string().contains("bus_load"));
    }
}
