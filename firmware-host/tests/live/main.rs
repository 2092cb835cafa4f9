//! The live loop on virtual devices: what it says on the bus, with and without faults.

mod faults;
mod listener;
mod loops;
mod rig;
mod soak;
