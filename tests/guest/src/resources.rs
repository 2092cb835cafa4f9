//! What a process holds.

use std::fs;

/// What a process holds at a moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Resources {
    /// Memory that is resident, KiB (`VmRSS`).
    pub resident_kib: u64,
    /// Open file descriptors.
    pub descriptors: usize,
    /// Threads.
    pub threads: usize,
}

impl Resources {
    /// What the process `pid` holds now.
    ///
    /// # Panics
    /// When there is no such process.
    pub fn of(pid: u32) -> Self {
        let status = fs::read_to_string(format!("/proc/{pid}/status")).expect("the process is there");
        let field = |name: &str| {
            let line = status.lines().find_map(|line| line.strip_prefix(name)).expect("the field is there");
            line.split_whitespace().next().and_then(|word| word.parse().ok()).expect("the field is a number")
        };
        let descriptors = fs::read_dir(format!("/proc/{pid}/fd")).expect("the process is there").count();
        Self { resident_kib: field("VmRSS:"), descriptors, threads: field("Threads:") as usize }
    }
}
