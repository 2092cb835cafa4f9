//! What tests inside the guest drive: modules, interfaces, cameras, the program; and what they watch: the bus, the program's
//! memory.
//!
//! ```text
//!  tests/guest/run ── builds ──> program, tests
//!        │
//!     prepare ── makes ──> kernel with drivers, initramfs       once, cached by version
//!        │
//!      boot ── QEMU: kvaser_pci x 2, ctucan_pci (CAN FD) ──> init ──> tests ──> exit status
//!                                                                       │
//!         modules, net, device, loopback, vivid: drive ── program: runs ── bus, resources: watch
//! ```
//! Everything that changes the machine goes through `machine::run`, which refuses to work anywhere but in the guest. All
//! helpers panic when they fail: they are for tests.
#![cfg(all(feature = "guest", target_os = "linux"))]
#![deny(unsafe_code)]

pub mod bus;
pub mod device;
pub mod loopback;
pub mod machine;
pub mod modules;
pub mod net;
pub mod program;
pub mod resources;
pub mod scans;
pub mod vivid;
