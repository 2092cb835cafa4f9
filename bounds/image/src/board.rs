//! How a program under QEMU ends.

use core::panic::PanicInfo;

use cortex_m_semihosting::{debug, hio, hprintln};

pub(crate) fn fail(why: &str) -> ! {
    hprintln!("failed: {}", why);
    exit(debug::EXIT_FAILURE)
}

pub(crate) fn succeed() -> ! {
    exit(debug::EXIT_SUCCESS)
}

fn exit(status: debug::ExitStatus) -> ! {
    loop {
        debug::exit(status);
    }
}

/// Says where, and what if that is a text without numbers: the formatter calls through pointers, and with it whatever may panic would
/// have a stack without a bound.
#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    let place = info.location().map_or("somewhere", |place| place.file());
    let what = info.message().as_str().unwrap_or_default();
    if let Ok(mut out) = hio::hstdout() {
        for text in ["panicked in ", place, ": ", what, "\n"] {
            let _ = out.write_all(text.as_bytes());
        }
    }
    exit(debug::EXIT_FAILURE)
}
