//! CAN buses: the trait, a bus in memory, and wrappers that log and spoil.
//!
//! ```text
//! CandumpWriter<FaultInjector<VirtualNode>>     every layer is a CanBus and gives back what it wraps
//! ```

mod candump;
mod fault;
mod frame;
mod virtual_bus;

pub use candump::{CandumpError, CandumpLine, CandumpProblem, CandumpWriter, LoggedBusError, parse_candump};
pub use fault::{FaultCounts, FaultInjector};
pub use frame::{CanFrame, FrameParseError};
pub use virtual_bus::{VirtualBus, VirtualNode};

/// A place on a CAN bus from which frames are sent and where the others' frames arrive.
pub trait CanBus {
    /// What can go wrong.
    type Error: core::error::Error + 'static;

    /// Hands `frame` to the bus at `now_ns`, nanoseconds of a monotonic clock. Does not wait.
    ///
    /// # Errors
    /// When the bus does not take the frame; it is not sent then.
    fn send(&mut self, frame: &CanFrame, now_ns: u64) -> Result<(), Self::Error>;

    /// The next frame that has arrived with the time at which it was sent, nanoseconds; `None` when there is none now.
    ///
    /// # Errors
    /// When the bus cannot be read.
    fn receive(&mut self) -> Result<Option<(u64, CanFrame)>, Self::Error>;
}

impl<B: CanBus> CanBus for &mut B {
    type Error = B::Error;

    fn send(&mut self, frame: &CanFrame, now_ns: u64) -> Result<(), Self::Error> {
        (**self).send(frame, now_ns)
    }

    fn receive(&mut self) -> Result<Option<(u64, CanFrame)>, Self::Error> {
        (**self).receive()
    }
}
