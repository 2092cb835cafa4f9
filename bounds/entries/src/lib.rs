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
    feature = "plant-loop",
    feature = "plant-unbounded-stack",
    feature = "plant-allocator"
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
#[cfg_attr(feature = "panic-cannot-link", expect(unused_variables, reason = "no panic gets here"))]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    #[cfg(feature = "panic-cannot-link")]
    // SAFETY: never called: where it could be, the image does not link.
    unsafe {
        a_panic_is_reachable()
    }
    // Where it happened is looked at, so that no two calls are the same to the compiler and each is counted.
    #[cfg(not(feature = "panic-cannot-link"))]
    loop {
        core::hint::black_box(info);
    }
}
