//! Every public entry of the core as a function of a linked image, of a detector for 320 x 240 pixels and 48 disparities.
//!
//! What the entries work on comes from outside, so that nothing is known when the image is built: no call is folded away, no
//! check is left out because of a value. Names begin with `entry_`; that is how the linker and `fencepost-bounds` find them.
#![no_std]
#![allow(unsafe_code, reason = "names that the linker can find; the core is called with plain references")]

#[cfg(feature = "detector")]
mod detector;
#[cfg(any(
    feature = "plant-panic",
    feature = "plant-recursion",
    feature = "plant-indirect-call",
    feature = "plant-deep-stack",
    feature = "plant-unbounded-stack"
))]
mod planted;
mod values;
mod wire;

#[cfg(feature = "panic-cannot-link")]
unsafe extern "C" {
    /// Nobody has it.
    fn a_panic_is_reachable() -> !;
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    #[cfg(feature = "panic-cannot-link")]
    // SAFETY: never called: where it could be, the image does not link.
    unsafe {
        a_panic_is_reachable()
    }
    #[cfg(not(feature = "panic-cannot-link"))]
    loop {}
}
