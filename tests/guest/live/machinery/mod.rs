//! That the guest is what the other tests take it for: tools and drivers, without the program.

mod buses;
mod cameras;

use fencepost_guest_tests::machine::{assert_guest, run};

/// The tests stand on the kernel's own words, not on a stand-in.
#[test]
fn this_is_a_linux_kernel_with_can_and_v4l2() {
    assert_guest();
    assert!(run("cat /proc/version").starts_with("Linux version "));
    run("modprobe can-raw");
    run("modprobe videodev");
    assert!(std::path::Path::new("/proc/net/can").exists());
    assert!(std::path::Path::new("/sys/class/video4linux").exists());
}
