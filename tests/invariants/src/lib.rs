//! What must hold of Fencepost whatever comes in.
//!
//! Each [`Target`] takes any bytes, makes an input of them (geometry within capacity, pictures, frames, files), runs it, and panics
//! if something does not hold that must. The fuzzers in `fuzz/` run the targets, the tests of this crate run the same with proptest,
//! on the seeds and on all that fuzzing has found. See `docs/fuzzing.md`.
#![deny(unsafe_code)]

#[cfg(feature = "host")]
mod calibration;
mod camera;
mod cameras;
mod command;
mod detection;
mod disparity;
mod frames;
#[cfg(feature = "host")]
mod live;
mod matchers;
mod pairs;
mod parts;
#[cfg(feature = "host")]
mod pixels;
mod receiver;
#[cfg(feature = "host")]
mod recording;
mod rectifier;
#[cfg(feature = "host")]
mod rig;
mod seeds;
mod settings;
mod source;
mod stages;
mod surfaces;
mod values;

// Each target as a function of its own: a fuzzer has only the code, and the counters, of what its target leads to.
#[cfg(feature = "host")]
pub use calibration::run as calibration;
pub use command::run as command;
pub use disparity::run as disparity;
#[cfg(feature = "host")]
pub use live::run as live;
pub use pairs::run as pairs;
#[cfg(feature = "host")]
pub use pixels::run as pixels;
pub use receiver::run as receiver;
#[cfg(feature = "host")]
pub use recording::run as recording;
pub use rectifier::run as rectifier;
#[cfg(feature = "host")]
pub use rig::run as rig;
pub use seeds::seeds;
pub use source::Source;
pub use stages::run as stages;
pub use surfaces::run as surfaces;

/// One way in.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Its name: that of the fuzzer, of the folder of its regressions, and of its test.
    pub name: &'static str,
    /// Whether it is one of the core's, of which more is asked.
    pub core: bool,
    /// Runs one input.
    pub run: fn(&[u8]),
}

/// Every target, the core's first.
pub const TARGETS: &[Target] = &[
    Target { name: "surfaces", core: true, run: surfaces::run },
    Target { name: "disparity", core: true, run: disparity::run },
    Target { name: "pairs", core: true, run: pairs::run },
    Target { name: "rectifier", core: true, run: rectifier::run },
    Target { name: "receiver", core: true, run: receiver::run },
    Target { name: "command", core: true, run: command::run },
    Target { name: "stages", core: true, run: stages::run },
    #[cfg(feature = "host")]
    Target { name: "calibration", core: false, run: calibration::run },
    #[cfg(feature = "host")]
    Target { name: "recording", core: false, run: recording::run },
    #[cfg(feature = "host")]
    Target { name: "rig", core: false, run: rig::run },
    #[cfg(feature = "host")]
    Target { name: "pixels", core: false, run: pixels::run },
    #[cfg(feature = "host")]
    Target { name: "live", core: false, run: live::run },
];

/// Runs one input of the target of that name.
///
/// # Panics
/// If there is no such target, and if something does not hold.
pub fn run(name: &str, bytes: &[u8]) {
    let target = TARGETS.iter().find(|target| target.name == name).unwrap_or_else(|| panic!("no target {name}"));
    (target.run)(bytes);
}
