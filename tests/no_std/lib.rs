//! Builds only if the core and all that it depends on do without `std` and without `alloc`.
//!
//! A crate that wants `std` brings a second panic handler, which the compiler refuses; one that wants `alloc` asks for a global
//! allocator, of which there is none.
#![no_std]

#[cfg(feature = "plant-alloc")]
extern crate alloc;
#[cfg(feature = "plant-std")]
extern crate std;

use fencepost_core::detector::Detector;

/// A detector in a `static`, as firmware keeps it.
pub static DETECTOR: Detector<{ 64 * 48 }, 64, 16, 0, 256, 16, 256> = Detector::new();

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {}
}
