//! What can go wrong with an interface of SocketCAN.

use std::io;
use std::sync::Arc;

use rustix::io::Errno;

use crate::can::{BusError, BusErrorKind};

/// An error of an interface: what, where and the mend.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SocketCanError {
    interface: Arc<str>,
    problem: SocketCanProblem,
}

/// What is wrong with an interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SocketCanProblem {
    /// There is none of that name.
    NotThere,
    /// It is an interface of another kind, such as Ethernet.
    NotCan,
    /// It is down.
    Down,
    /// Its queue is full.
    Full,
    /// CAN FD was not asked for.
    FdNotWanted,
    /// It takes classic frames only.
    FdOnClassic,
    /// It does not take this frame.
    FrameRefused,
    /// The kernel has no CAN.
    NoCanInKernel,
    /// The program may not use CAN.
    NotAllowed,
    /// Another error of the system, by its number.
    System(i32),
}

impl SocketCanError {
    pub(super) const fn new(interface: Arc<str>, problem: SocketCanProblem) -> Self {
        Self { interface, problem }
    }

    /// What an error of the system means. `fd` says whether it met a CAN FD frame that was to be sent.
    pub(super) fn of(interface: &Arc<str>, error: &io::Error, fd: bool) -> Self {
        Self::new(Arc::clone(interface), SocketCanProblem::of(error, fd))
    }

    /// Name of the interface.
    pub fn interface(&self) -> &str {
        &self.interface
    }

    /// What is wrong.
    pub const fn problem(&self) -> SocketCanProblem {
        self.problem
    }

    /// What is wrong, in words.
    pub fn what(&self) -> String {
        let Self { interface, problem } = self;
        match problem {
            SocketCanProblem::NotThere => format!("there is no CAN interface {interface}"),
            SocketCanProblem::NotCan => format!("{interface} is no CAN interface"),
            SocketCanProblem::Down => format!("the CAN interface {interface} is down"),
            SocketCanProblem::Full => format!("the queue of {interface} is full"),
            SocketCanProblem::FdNotWanted => {
                format!("a CAN FD frame for {interface}, which is used for classic frames")
            }
            SocketCanProblem::FdOnClassic => format!("a CAN FD frame for {interface}, which takes classic frames only"),
            SocketCanProblem::FrameRefused => format!("{interface} does not take the frame"),
            SocketCanProblem::NoCanInKernel => format!("the kernel has no CAN, which {interface} needs"),
            SocketCanProblem::NotAllowed => format!("this program may not use {interface}"),
            SocketCanProblem::System(number) => format!("{interface}: {}", io::Error::from_raw_os_error(*number)),
        }
    }

    /// What to do about it.
    pub fn mend(&self) -> String {
        let interface = &*self.interface;
        let is_virtual = interface.starts_with("vcan") || interface.starts_with("vxcan");
        match self.problem {
            SocketCanProblem::NotThere if is_virtual => {
                format!("make it: `sudo ip link add {interface} type vcan && sudo ip link set {interface} up`")
            }
            SocketCanProblem::NotThere => {
                "plug the adapter in, or load its driver; `ip -brief link show type can` lists what is there".to_owned()
            }
            SocketCanProblem::NotCan => {
                "name a CAN interface; `ip -brief link show type can` lists what is there".to_owned()
            }
            SocketCanProblem::Down if is_virtual => format!("bring it up: `sudo ip link set {interface} up`"),
            SocketCanProblem::Down => {
                format!("bring it up, with your bus's rate: `sudo ip link set {interface} up type can bitrate 500000`")
            }
            SocketCanProblem::Full => format!(
                "nothing, if it happens now and then; otherwise look for another node that acknowledges, a faster bit rate, \
                 or fewer cells; a longer queue helps against bursts: `sudo ip link set {interface} txqueuelen 100`"
            ),
            SocketCanProblem::FdNotWanted => "set the format of the wire to classic, or ask for CAN FD".to_owned(),
            SocketCanProblem::FdOnClassic if is_virtual => format!(
                "let it take CAN FD: `sudo ip link set {interface} down && sudo ip link set {interface} mtu 72 up`; or set \
                 the format of the wire to classic"
            ),
            SocketCanProblem::FdOnClassic => format!(
                "let it take CAN FD, if the controller can: `sudo ip link set {interface} up type can bitrate 500000 dbitrate \
                 2000000 fd on`; or set the format of the wire to classic"
            ),
            SocketCanProblem::FrameRefused => format!("look at the mode of the controller: `ip -details link show {interface}`"),
            SocketCanProblem::NoCanInKernel => {
                "load it: `sudo modprobe can_raw`; a kernel for virtual machines may lack it altogether".to_owned()
            }
            SocketCanProblem::NotAllowed => {
                "allow it: no root is needed, but a container or a systemd unit with RestrictAddressFamilies= has to name \
                 AF_CAN"
                    .to_owned()
            }
            SocketCanProblem::System(_) => format!("look at `ip -details link show {interface}` and `dmesg`"),
        }
    }
}

impl SocketCanProblem {
    fn of(error: &io::Error, fd: bool) -> Self {
        match Errno::from_io_error(error) {
            Some(Errno::NOBUFS | Errno::AGAIN) => Self::Full,
            Some(Errno::NETDOWN) => Self::Down,
            Some(Errno::NODEV | Errno::NXIO) => Self::NotThere,
            // By version of the kernel.
            Some(Errno::INVAL | Errno::MSGSIZE) if fd => Self::FdOnClassic,
            Some(Errno::INVAL | Errno::MSGSIZE) => Self::FrameRefused,
            Some(Errno::AFNOSUPPORT | Errno::PROTONOSUPPORT) => Self::NoCanInKernel,
            Some(Errno::PERM | Errno::ACCESS) => Self::NotAllowed,
            Some(errno) => Self::System(errno.raw_os_error()),
            None => Self::System(Errno::IO.raw_os_error()),
        }
    }

    /// What it means for whoever sends.
    pub const fn kind(self) -> BusErrorKind {
        match self {
            Self::NotThere | Self::NotCan | Self::NoCanInKernel => BusErrorKind::Gone,
            Self::Down => BusErrorKind::Down,
            Self::Full => BusErrorKind::Full,
            Self::FdNotWanted | Self::FdOnClassic | Self::FrameRefused => BusErrorKind::Refused,
            Self::NotAllowed | Self::System(_) => BusErrorKind::Other,
        }
    }
}

impl BusError for SocketCanError {
    fn kind(&self) -> BusErrorKind {
        self.problem.kind()
    }
}

impl std::fmt::Display for SocketCanError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}; {}", self.what(), self.mend())
    }
}

impl std::error::Error for SocketCanError {}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers of errors on Linux (asm-generic/errno.h).
    #[test]
    fn errors_of_the_system_are_told_apart_by_what_the_sender_has_to_do() {
        for (number, fd, kind) in [
            (105, false, BusErrorKind::Full),
            (11, false, BusErrorKind::Full),
            (100, false, BusErrorKind::Down),
            (19, false, BusErrorKind::Gone),
            (6, true, BusErrorKind::Gone),
            (22, true, BusErrorKind::Refused),
            (90, true, BusErrorKind::Refused),
            (22, false, BusErrorKind::Refused),
            (97, false, BusErrorKind::Gone),
            (1, false, BusErrorKind::Other),
            (5, false, BusErrorKind::Other),
        ] {
            let error = SocketCanError::of(&"can0".into(), &io::Error::from_raw_os_error(number), fd);
            assert_eq!(error.kind(), kind, "{error}");
            assert!(error.what().contains("can0") && !error.mend().is_empty(), "{error}");
        }
    }

    #[test]
    fn the_mend_names_the_command_for_this_interface() {
        let mend = |interface: &str, problem| SocketCanError::new(interface.into(), problem).mend();
        assert!(mend("can1", SocketCanProblem::Down).contains("`sudo ip link set can1 up type can bitrate 500000`"));
        assert!(mend("vcan0", SocketCanProblem::Down).contains("`sudo ip link set vcan0 up`"));
        assert!(mend("vcan3", SocketCanProblem::NotThere).contains("ip link add vcan3 type vcan"));
        assert!(mend("can0", SocketCanProblem::FdOnClassic).contains("fd on"));
    }
}
