//! How a program under QEMU ends.

use core::panic::PanicInfo;

use cortex_m_semihosting::{debug, hprintln};

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

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    hprintln!("{}", info);
    exit(debug::EXIT_FAILURE)
}
