//! CAN buses: the trait, the buses of Linux, a bus in memory, wrappers that log and spoil, and the queue towards a bus.
//!
//! ```text
//! Transmitter<CandumpWriter<FaultInjector<VirtualNode>>>     every layer gives back what it wraps
//!      │             └─────────────────┴───────────┴──────── all of these are a CanBus
//!      └──────────────────────────────────────────────────── takes heartbeats and scans, and never waits
//! ```

mod bus_fault;
mod candump;
mod fault;
mod frame;
#[cfg(target_os = "linux")]
mod socket;
mod transmit;
mod virtual_bus;

pub use bus_fault::{BusFaultControl, BusFaultCounts, BusFaultError, BusFaultInjector};
pub use candump::{CandumpError, CandumpLine, CandumpProblem, CandumpWriter, LoggedBusError, parse_candump};
pub use fault::{FaultCounts, FaultInjector};
pub use frame::{CanFrame, FrameParseError};
#[cfg(target_os = "linux")]
pub use socket::{BitTiming, CanInterface, IdFilter, SocketCan, SocketCanError, SocketCanProblem, can_interfaces};
pub use transmit::{Pump, ScanTooLong, TransmitCounters, Transmitter};
pub use virtual_bus::{VirtualBus, VirtualNode};

/// What an error of a bus means for whoever sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusErrorKind {
    /// The queue towards the bus is full: the frame can be sent later.
    Full,
    /// The interface is there, but down.
    Down,
    /// The interface is gone.
    Gone,
    /// This bus never takes such a frame.
    Refused,
    /// Something else.
    Other,
}

/// An error of a bus. Says what, where and the mend.
pub trait BusError: core::error::Error {
    /// What it means for whoever sends.
    fn kind(&self) -> BusErrorKind;
}

/// A bus without errors.
impl BusError for core::convert::Infallible {
    fn kind(&self) -> BusErrorKind {
        match *self {}
    }
}

/// How a CAN controller stands (ISO 11898-1, fault confinement).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum ControllerState {
    /// Takes part in full.
    #[default]
    ErrorActive,
    /// Takes part in full; one of its error counters has reached 96.
    Warning,
    /// Sends, but cannot mark errors; one of its error counters has passed 127.
    ErrorPassive,
    /// Sends nothing until it is restarted.
    BusOff,
}

/// What is known of a bus besides its frames. Counts stay at their largest value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BusCondition {
    /// How the controller stands.
    pub controller: ControllerState,
    /// Frames that nobody acknowledged.
    pub no_acknowledgement: u32,
    /// Errors on the bus and in the controller that it told of, those above among them.
    pub errors: u32,
    /// Times that the controller gave way to another's frame, where it tells: that is how a bus is shared and no error.
    pub lost_arbitrations: u32,
    /// Restarts after bus-off.
    pub restarts: u32,
    /// Frames of others that were lost because they were not fetched in time.
    pub overflows: u32,
}

/// A place on a CAN bus from which frames are sent and where the others' frames arrive.
pub trait CanBus {
    /// What can go wrong.
    type Error: BusError + 'static;

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

    /// What is known of the bus besides its frames, as of the last call of `send` or `receive`.
    fn condition(&self) -> BusCondition {
        BusCondition::default()
    }
}

impl<B: CanBus> CanBus for &mut B {
    type Error = B::Error;

    fn send(&mut self, frame: &CanFrame, now_ns: u64) -> Result<(), Self::Error> {
        (**self).send(frame, now_ns)
    }

    fn receive(&mut self) -> Result<Option<(u64, CanFrame)>, Self::Error> {
        (**self).receive()
    }

    fn condition(&self) -> BusCondition {
        (**self).condition()
    }
}
