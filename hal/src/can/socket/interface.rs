//! What an interface is: up or down, classic or FD, how fast.

use std::fs;
use std::path::{Path, PathBuf};

use socketcan::nl::{CanInterface as Netlink, CanState, InterfaceCanParams};

use super::error::{SocketCanError, SocketCanProblem};
use crate::can::ControllerState;

/// Where the kernel shows its interfaces.
const FOLDER: &str = "/sys/class/net";
/// The kind of an interface that is CAN (linux/if_arp.h).
const ARPHRD_CAN: u32 = 280;
/// The flag of an interface that is up (linux/if.h).
const IFF_UP: u32 = 1;
/// Bytes of the kernel's structure for a CAN FD frame: interfaces that take such frames have at least this MTU.
const CAN_FD_MTU: u32 = 72;

/// A CAN interface as the kernel describes it. What a virtual one has not is `None`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CanInterface {
    /// Its name.
    pub name: String,
    /// Whether it is up.
    pub up: bool,
    /// Largest frame in the kernel's format, bytes: 16 classic, 72 CAN FD.
    pub mtu: u32,
    /// Frames that the kernel queues for it before it says that it is full.
    pub tx_queue_len: Option<u32>,
    /// Bit rates.
    pub timing: Option<BitTiming>,
    /// How its controller stands.
    pub controller: Option<ControllerState>,
    /// Time after which the kernel restarts a controller that is off the bus, ms; 0: it does not.
    pub restart_ms: Option<u32>,
}

/// Bit rates of an interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitTiming {
    /// Bits per second.
    pub bitrate: u32,
    /// Bits per second in the data of CAN FD frames.
    pub data_bitrate: Option<u32>,
}

impl CanInterface {
    /// Looks at the interface `name`. Needs no rights.
    ///
    /// # Errors
    /// When there is none of that name, or it is no CAN interface.
    pub fn look(name: &str) -> Result<Self, SocketCanError> {
        let wrong = |problem| SocketCanError::new(name.into(), problem);
        let folder = folder(name).filter(|folder| folder.is_dir()).ok_or(wrong(SocketCanProblem::NotThere))?;
        if number(&folder.join("type")) != Some(ARPHRD_CAN) {
            return Err(wrong(SocketCanProblem::NotCan));
        }
        // A virtual interface has no parameters; and without netlink the rest is still true.
        let can = Netlink::open(name).and_then(|netlink| netlink.can_params()).unwrap_or_default();
        Ok(Self {
            name: name.to_owned(),
            up: number(&folder.join("flags")).is_some_and(|flags| flags & IFF_UP != 0),
            mtu: number(&folder.join("mtu")).unwrap_or(0),
            tx_queue_len: number(&folder.join("tx_queue_len")),
            timing: timing(&can),
            controller: can.state.and_then(controller_state),
            restart_ms: can.restart_ms,
        })
    }

    /// Whether it takes CAN FD frames.
    pub const fn takes_fd(&self) -> bool {
        self.mtu >= CAN_FD_MTU
    }
}

/// Names of the CAN interfaces of this machine, in order.
pub fn can_interfaces() -> Vec<String> {
    let entries = fs::read_dir(FOLDER).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let is_can = |name: &String| number(&Path::new(FOLDER).join(name).join("type")) == Some(ARPHRD_CAN);
    let mut names: Vec<String> = names.filter(is_can).collect();
    names.sort();
    names
}

/// The file that says whether the interface has a carrier: it has none while its controller is off the bus.
pub(super) fn carrier_file(name: &str) -> Option<PathBuf> {
    folder(name).map(|folder| folder.join("carrier"))
}

/// The file that counts the frames that have gone out.
pub(super) fn sent_file(name: &str) -> Option<PathBuf> {
    folder(name).map(|folder| folder.join("statistics/tx_packets"))
}

/// A name must not lead out of the folder of the interfaces.
fn folder(name: &str) -> Option<PathBuf> {
    (!name.is_empty() && name != "." && name != ".." && !name.contains('/')).then(|| Path::new(FOLDER).join(name))
}

/// The number in a file of the kernel, decimal or as `0x1003`.
fn number(file: &Path) -> Option<u32> {
    let text = fs::read_to_string(file).ok()?;
    let text = text.trim();
    text.strip_prefix("0x").map_or_else(|| text.parse().ok(), |digits| u32::from_str_radix(digits, 16).ok())
}

fn timing(can: &InterfaceCanParams) -> Option<BitTiming> {
    let rate = |bitrate: u32| (bitrate > 0).then_some(bitrate);
    let bitrate = can.bit_timing.and_then(|timing| rate(timing.bitrate))?;
    Some(BitTiming { bitrate, data_bitrate: can.data_bit_timing.and_then(|timing| rate(timing.bitrate)) })
}

pub(super) const fn controller_state(state: CanState) -> Option<ControllerState> {
    match state {
        CanState::ErrorActive => Some(ControllerState::ErrorActive),
        CanState::ErrorWarning => Some(ControllerState::Warning),
        CanState::ErrorPassive => Some(ControllerState::ErrorPassive),
        CanState::BusOff => Some(ControllerState::BusOff),
        CanState::Stopped | CanState::Sleeping => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::{BusError, BusErrorKind};

    #[test]
    fn what_is_no_can_interface_is_said_to_be_none() {
        for (name, problem) in [
            ("nothere0", SocketCanProblem::NotThere),
            ("", SocketCanProblem::NotThere),
            ("..", SocketCanProblem::NotThere),
            ("../net/lo", SocketCanProblem::NotThere),
            ("lo", SocketCanProblem::NotCan),
        ] {
            let error = CanInterface::look(name).unwrap_err();
            assert_eq!((error.problem(), error.kind()), (problem, BusErrorKind::Gone), "{name}");
        }
        assert!(!can_interfaces().contains(&"lo".to_owned()));
    }
}
