//! A CAN frame as the core hands it out.

use embedded_can::{Id, StandardId};

use super::address::Message;

/// Most data bytes in a frame of the wire.
pub const MAX_DATA: usize = 24;

/// A data frame with an 11-bit identifier: classic with up to 8 bytes, or CAN FD with 24.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Frame {
    id: StandardId,
    len: u8,
    fd: bool,
    data: [u8; MAX_DATA],
}

impl Frame {
    /// A classic frame; `None` if `data` has more than 8 bytes.
    pub fn classic(id: StandardId, data: &[u8]) -> Option<Self> {
        if data.len() > 8 { None } else { Self::with_data(id, data, false) }
    }

    /// A CAN FD frame; `None` if CAN FD has no frames of that length, or there is no room for it here.
    pub fn fd(id: StandardId, data: &[u8]) -> Option<Self> {
        match data.len() {
            0..=8 | 12 | 16 | 20 | 24 => Self::with_data(id, data, true),
            _ => None,
        }
    }

    /// The frame of a message whose bytes are complete; bytes behind its length are not sent.
    pub(super) const fn of_message(id: StandardId, message: Message, data: [u8; MAX_DATA]) -> Self {
        Self { id, len: message.data_len() as u8, fd: message.is_fd(), data }
    }

    /// The identifier.
    pub const fn id(&self) -> StandardId {
        self.id
    }

    /// The data bytes.
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.len)).unwrap_or(&self.data)
    }

    /// Whether it is a CAN FD frame.
    pub const fn is_fd(&self) -> bool {
        self.fd
    }

    fn with_data(id: StandardId, data: &[u8], fd: bool) -> Option<Self> {
        let mut bytes = [0; MAX_DATA];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        Some(Self { id, len: data.len() as u8, fd, data: bytes })
    }
}

impl core::fmt::Debug for Frame {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{:03X}{}", self.id.as_raw(), if self.fd { "##1" } else { "#" })?;
        self.data().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

/// For drivers that know `embedded-can`: such frames are classic.
impl embedded_can::Frame for Frame {
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        match id.into() {
            Id::Standard(id) => Self::classic(id, data),
            Id::Extended(_) => None,
        }
    }

    fn new_remote(_: impl Into<Id>, _: usize) -> Option<Self> {
        None
    }

    fn is_extended(&self) -> bool {
        false
    }

    fn is_remote_frame(&self) -> bool {
        false
    }

    fn id(&self) -> Id {
        self.id.into()
    }

    fn dlc(&self) -> usize {
        usize::from(self.len)
    }

    fn data(&self) -> &[u8] {
        Self::data(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_lengths_that_the_bus_has_are_accepted() {
        let id = StandardId::new(0x401).unwrap();
        for len in 0..=64 {
            let data = [7; 64];
            let data = &data[..len];
            assert_eq!(Frame::classic(id, data).is_some(), len <= 8);
            assert_eq!(Frame::fd(id, data).is_some(), len <= 8 || [12, 16, 20, 24].contains(&len));
            if let Some(frame) = Frame::fd(id, data) {
                assert_eq!((frame.data(), frame.id(), frame.is_fd()), (data, id, true));
            }
            if let Some(frame) = Frame::classic(id, data) {
                assert_eq!((frame.data(), frame.id(), frame.is_fd()), (data, id, false));
            }
        }
    }

    #[test]
    fn drivers_see_the_frame_through_their_own_trait() {
        use embedded_can::{ExtendedId, Frame as _};

        let id = StandardId::new(0x2A5).unwrap();
        let frame = <Frame as embedded_can::Frame>::new(id, &[1, 2, 3]).unwrap();
        assert_eq!(frame, Frame::classic(id, &[1, 2, 3]).unwrap());
        assert_eq!((embedded_can::Frame::id(&frame), frame.dlc()), (Id::Standard(id), 3));
        assert_eq!(embedded_can::Frame::data(&frame), [1, 2, 3]);
        assert!(frame.is_standard() && frame.is_data_frame());
        // The wire has neither.
        assert!(<Frame as embedded_can::Frame>::new(ExtendedId::new(0x2A5).unwrap(), &[1]).is_none());
        assert!(Frame::new_remote(id, 3).is_none());
    }
}
