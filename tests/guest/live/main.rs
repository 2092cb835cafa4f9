//! Tests with real V4L2 and CAN drivers, inside the guest. `tests/guest/run` runs them; docs/testing.md tells more.

#[cfg(all(feature = "guest", target_os = "linux"))]
mod buses;
#[cfg(all(feature = "guest", target_os = "linux"))]
mod cameras;
#[cfg(all(feature = "guest", target_os = "linux"))]
mod machinery;
#[cfg(all(feature = "guest", target_os = "linux"))]
mod program;

#[cfg(not(all(feature = "guest", target_os = "linux")))]
#[test]
fn not_run_here() {
    use std::io::Write;
    let complaint = "NOT RUN: tests with real V4L2 and CAN drivers, which need a virtual machine: run tests/guest/run";
    // Past the capture of the test runner; nobody listening is no reason to fail.
    let _ = writeln!(std::io::stderr().lock(), "    {complaint}");
}
