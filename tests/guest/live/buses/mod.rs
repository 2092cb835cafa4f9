//! The program's CAN buses on real drivers.

mod faults;
mod traffic;

use std::time::Duration;

use fencepost_guest_tests::machine::wait_for;
use fencepost_hal::can::{BusErrorKind, CanBus, CanFrame, SocketCan};

const SECONDS: Duration = Duration::from_secs(5);

fn frame(text: &str) -> CanFrame {
    text.parse().unwrap_or_else(|error| panic!("{text}: {error}"))
}

/// The next `count` frames that arrive, with their times.
fn receive(bus: &mut SocketCan, count: usize) -> Vec<(u64, CanFrame)> {
    let mut frames = Vec::new();
    wait_for(SECONDS, || {
        frames.extend(bus.receive().expect("the bus can be read"));
        (frames.len() >= count).then_some(())
    });
    frames
}

/// Sends until the bus takes a frame; how often it did not.
fn send_until_taken(bus: &mut SocketCan, frame: &CanFrame) -> Vec<BusErrorKind> {
    use fencepost_hal::can::BusError;
    let mut errors = Vec::new();
    let taken = wait_for(SECONDS, || bus.send(frame, 0).map_err(|error| errors.push(error.kind())).ok());
    assert!(taken.is_some(), "the bus takes no frame: {:?}", errors.last());
    errors
}
