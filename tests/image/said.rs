//! What the image printed.

use std::collections::BTreeMap;

/// A case with one of the backends.
#[derive(Clone, Debug, Default)]
pub(super) struct Run {
    pub(super) case: String,
    pub(super) backend: String,
    pub(super) frames: Vec<FrameSaid>,
}

/// What was said of one pair.
#[derive(Clone, Debug, Default)]
pub(super) struct FrameSaid {
    /// Stages in order, with their instructions.
    pub(super) stages: Vec<(String, u64)>,
    /// Frames on the bus: identifier and payload.
    pub(super) can: Vec<String>,
}

/// All of it.
#[derive(Clone, Debug, Default)]
pub(super) struct Said {
    pub(super) runs: Vec<Run>,
    /// Deepest stack of each entry, bytes, and the case in which it was.
    pub(super) stacks: BTreeMap<String, (u64, String)>,
    /// Sizes, bytes.
    pub(super) memory: BTreeMap<String, u64>,
}

impl Said {
    /// Reads what was printed.
    pub(super) fn parse(text: &str) -> Result<Self, String> {
        let mut said = Self::default();
        let mut done = false;
        for line in text.lines() {
            let words: Vec<&str> = line.split_whitespace().collect();
            let number = |word: &str| word.parse::<u64>().map_err(|_| format!("no number: {line}"));
            match words[..] {
                ["memory", "detector", detector, "pictures", pictures] => {
                    said.memory.insert("detector".to_owned(), number(detector)?);
                    said.memory.insert("pictures".to_owned(), number(pictures)?);
                }
                ["case", case, "backend", backend] => {
                    let (case, backend) = (case.to_owned(), backend.to_owned());
                    said.runs.push(Run { case, backend, frames: Vec::new() });
                }
                ["frame", _] => said.run(line)?.frames.push(FrameSaid::default()),
                ["stage", stage, instructions] => {
                    let instructions = number(instructions)?;
                    said.frame(line)?.stages.push((stage.to_owned(), instructions));
                }
                ["stack", entry, bytes] => {
                    let (bytes, case) = (number(bytes)?, said.run(line)?.case.clone());
                    let deepest = said.stacks.entry(entry.to_owned()).or_default();
                    if bytes > deepest.0 {
                        *deepest = (bytes, case);
                    }
                }
                ["can", frame] => said.frame(line)?.can.push(frame.to_owned()),
                ["done"] => done = true,
                [] => {}
                _ => return Err(format!("the image says: {line}")),
            }
        }
        if done { Ok(said) } else { Err("the image did not come to its end".to_owned()) }
    }

    fn run(&mut self, line: &str) -> Result<&mut Run, String> {
        self.runs.last_mut().ok_or_else(|| format!("before the first case: {line}"))
    }

    fn frame(&mut self, line: &str) -> Result<&mut FrameSaid, String> {
        self.run(line)?.frames.last_mut().ok_or_else(|| format!("before the first frame: {line}"))
    }
}

impl FrameSaid {
    /// Instructions of the whole frame.
    pub(super) fn total(&self) -> u64 {
        self.stages.iter().map(|(_, instructions)| instructions).sum()
    }
}
