//! Says which processors have the instructions that work on four bytes of a register: the compiler does not tell them apart by anything
//! but the name of the target, as long as its names of these features are not settled.

use std::env;

/// Every Cortex-M with a name of its own for it (M4, M7), and whatever has ARMv7 with an operating system.
const WITH_DSP: [&str; 3] = ["thumbv7em", "thumbv7neon", "armv7"];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rustc-check-cfg=cfg(dsp)");
    let target = env::var("TARGET").unwrap_or_default();
    if WITH_DSP.iter().any(|name| target.starts_with(name)) {
        println!("cargo:rustc-cfg=dsp");
    }
}
