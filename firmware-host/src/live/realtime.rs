//! What the loop asks the operating system for: a processor, a priority, memory that stays. All of it can be refused, and
//! then the loop runs without.

use fencepost_core::error::ConfigError;

/// What a thread asks for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct ThreadWishes {
    /// Processor to stay on.
    pub(super) cpu: Option<u16>,
    /// Priority of `SCHED_FIFO`; 0 for none.
    pub(super) priority: u8,
}

impl ThreadWishes {
    /// Asks for them for the thread that calls; tells what was refused.
    pub(super) fn ask(self) -> Vec<String> {
        let cpu = self.cpu.and_then(|cpu| stay_on(cpu).err());
        let priority = (self.priority > 0).then(|| be_urgent(self.priority).err()).flatten();
        cpu.into_iter().chain(priority).collect()
    }
}

/// Whether the machine has such a processor. Those that are kept free of other work (`isolcpus`) count, though the program is
/// not on them yet.
///
/// # Errors
/// Named `field`.
pub(crate) fn check_cpu(field: &'static str, cpu: u16) -> Result<(), ConfigError> {
    // As `0-3`, or `0,2-3`: the last number is the highest.
    let possible = std::fs::read_to_string("/sys/devices/system/cpu/possible").ok();
    let last = possible.and_then(|text| text.trim().rsplit(['-', ',']).next()?.parse::<u16>().ok());
    last.map_or(Ok(()), |last| ConfigError::check(field, f32::from(cpu), 0.0, f32::from(last)))
}

#[cfg(target_os = "linux")]
fn stay_on(cpu: u16) -> Result<(), String> {
    use rustix::thread::{CpuSet, sched_setaffinity};

    let refused =
        |why: String| format!("the thread cannot stay on processor {cpu}: {why}; set `cpu` to one that is there");
    if usize::from(cpu) >= CpuSet::MAX_CPU {
        return Err(refused("there is no such processor".to_string()));
    }
    let mut set = CpuSet::new();
    set.set(usize::from(cpu));
    sched_setaffinity(None, &set).map_err(|error| refused(error.to_string()))
}

#[cfg(not(target_os = "linux"))]
fn stay_on(cpu: u16) -> Result<(), String> {
    Err(format!("the thread cannot stay on processor {cpu}: only Linux does that; leave `cpu` out"))
}

#[cfg(target_os = "linux")]
fn be_urgent(priority: u8) -> Result<(), String> {
    use thread_priority::{
        RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
        set_thread_priority_and_policy, thread_native_id,
    };

    let refused = |why: String| {
        format!(
            "no real-time priority {priority}: {why}; allow it (LimitRTPRIO=99 in the unit, or rtprio in limits.conf), or set \
             run.priority = 0"
        )
    };
    let value = ThreadPriorityValue::try_from(priority).map_err(|why| refused(why.to_string()))?;
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Crossplatform(value), policy)
        .map_err(|why| refused(format!("{why:?}")))
}

#[cfg(not(target_os = "linux"))]
fn be_urgent(priority: u8) -> Result<(), String> {
    Err(format!("no real-time priority {priority}: only Linux gives it; set run.priority = 0"))
}

/// Keeps every page that is used from now on in memory. Pages are locked as they are first touched: the program's detectors
/// have room for far larger pictures than most cameras have, and what is never touched takes no memory.
#[cfg(target_os = "linux")]
pub(super) fn lock_memory() -> Result<(), String> {
    use rustix::mm::{MlockAllFlags, mlockall};

    mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE | MlockAllFlags::ONFAULT).map_err(|why| {
        format!(
            "memory is not locked: {why}; allow it (LimitMEMLOCK=infinity in the unit, or memlock in limits.conf), or set \
             run.lock_memory = false"
        )
    })
}

#[cfg(not(target_os = "linux"))]
pub(super) fn lock_memory() -> Result<(), String> {
    Err("memory is not locked: only Linux does that; set run.lock_memory = false".to_string())
}
