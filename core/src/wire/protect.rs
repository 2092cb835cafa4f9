//! End-to-end protection: AUTOSAR E2E profile 11, variant 11C.
//!
//! Byte 0 of a message is a CRC-8, the low half of byte 1 a counter that runs from 0 to 14, the high half of byte 1 the bits
//! 8 to 11 of the data id, which is the CAN identifier. The CRC is taken over the low byte of the data id, a zero byte, and
//! the data from byte 1 on.
//!
//! The polynomial 0x1D is primitive: errors of one or two bits are caught as long as they lie less than 255 bits apart. With
//! the two bytes of the data id, 8 bytes of data make 80 bits and 24 bytes make 208. That is why cells travel in CAN FD
//! frames of 24 bytes and not of 32 or 64.
//!
//! Source: AUTOSAR FO, E2E Protocol Specification, profile 11; Specification of CRC Routines, 8-bit SAE J1850.

use crc::{CRC_8_SAE_J1850, Crc};
use embedded_can::StandardId;

use super::address::{Address, Message};
use super::signal::Signal;

/// Values of the counter: 0 to 14. The value 15 is never sent.
pub const COUNTER_VALUES: u8 = 15;

/// Place of the CRC in every message.
pub const CRC: Signal = Signal::new(0, 8);
/// Place of the counter in every message.
pub const COUNTER: Signal = Signal::new(8, 4);
/// Place of the bits 8 to 11 of the data id in every message.
pub const DATA_ID_NIBBLE: Signal = Signal::new(12, 4);

static J1850: Crc<u8> = Crc::<u8>::new(&CRC_8_SAE_J1850);

/// Why received bytes are not a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PacketError {
    /// Not as many bytes as the message has.
    WrongLength {
        /// Bytes that the message has.
        expected: usize,
        /// Bytes that came.
        found: usize,
    },
    /// The checksum does not fit.
    WrongCrc,
    /// The data id in the message is not the one of its identifier.
    WrongDataId,
    /// The counter has the value that is never sent.
    InvalidCounter,
}

/// A view of the bytes of a message that passed every check of the protection.
#[derive(Clone, Copy, Debug)]
pub struct Packet<'a> {
    message: Message,
    data: &'a [u8],
}

impl<'a> Packet<'a> {
    /// Checks `data`, received with `id`. `None` if `id` is none of the identifiers of `address`.
    ///
    /// # Errors
    /// [`PacketError`]
    ///
    /// # Bound
    /// The bytes of the longest message.
    pub fn check(address: Address, id: StandardId, data: &'a [u8]) -> Option<Result<Self, PacketError>> {
        let message = address.message(id)?;
        Some(Self::check_message(message, address.raw_id(message), data))
    }

    fn check_message(message: Message, data_id: u16, data: &'a [u8]) -> Result<Self, PacketError> {
        if data.len() != message.data_len() {
            return Err(PacketError::WrongLength { expected: message.data_len(), found: data.len() });
        }
        if CRC.get(data) != u32::from(checksum(data_id, data)) {
            return Err(PacketError::WrongCrc);
        }
        if DATA_ID_NIBBLE.get(data) != u32::from(data_id >> 8) {
            return Err(PacketError::WrongDataId);
        }
        if COUNTER.get(data) >= u32::from(COUNTER_VALUES) {
            return Err(PacketError::InvalidCounter);
        }
        Ok(Self { message, data })
    }

    /// Which message it is.
    pub const fn message(&self) -> Message {
        self.message
    }

    /// The counter, 0 to 14.
    pub fn counter(&self) -> u8 {
        COUNTER.get(self.data) as u8
    }

    /// The CRC.
    pub fn crc(&self) -> u8 {
        CRC.get(self.data) as u8
    }

    /// All bytes of the message.
    pub const fn data(&self) -> &'a [u8] {
        self.data
    }

    /// The bytes after CRC and counter.
    pub fn payload(&self) -> &'a [u8] {
        self.data.get(2..).unwrap_or(&[])
    }
}

/// Writes counter, data id and CRC into the first two bytes of a message whose other bytes are complete.
///
/// # Bound
/// The bytes of `data`.
pub fn protect(data_id: u16, counter: u8, data: &mut [u8]) {
    COUNTER.put(data, u32::from(counter % COUNTER_VALUES));
    DATA_ID_NIBBLE.put(data, u32::from(data_id >> 8));
    let crc = checksum(data_id, data);
    CRC.put(data, u32::from(crc));
}

/// The counter after `counter`.
pub const fn next_counter(counter: u8) -> u8 {
    if counter >= COUNTER_VALUES - 1 { 0 } else { counter + 1 }
}

/// CRC of profile 11. The profile calls the routine with a start value of 0xFF, which the routine takes as "not the first
/// call" and inverts, and inverts the result once more: together a start of 0 and no final exclusive or.
fn checksum(data_id: u16, data: &[u8]) -> u8 {
    let [low, _] = data_id.to_le_bytes();
    let mut digest = J1850.digest_with_initial(0x00);
    digest.update(&[low, 0x00]);
    digest.update(data.get(1..).unwrap_or(&[]));
    digest.finalize() ^ CRC_8_SAE_J1850.xorout
}

/// CRC over the payloads of all cell frames of a scan, in their order; sent in the end message, so that frames of different
/// scans are never taken for one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ScanCrc(u8);

impl ScanCrc {
    /// The value before the first frame.
    pub const START: Self = Self(0xFF);

    /// Adds the bytes of a cell frame from byte 2 on.
    ///
    /// # Bound
    /// The bytes of `payload`.
    pub fn add(&mut self, payload: &[u8]) {
        let mut digest = J1850.digest_with_initial(self.0);
        digest.update(payload);
        self.0 = digest.finalize() ^ CRC_8_SAE_J1850.xorout;
    }

    /// The checksum, a CRC-8 SAE J1850.
    pub const fn get(self) -> u8 {
        self.0 ^ CRC_8_SAE_J1850.xorout
    }
}

/// What the counter of a message tells about those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// None came before.
    First,
    /// The next one.
    Next,
    /// The same one again.
    Repeated,
    /// At least that many are missing.
    Lost(u8),
}

/// Follows the counter of one message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct CounterCheck {
    /// Counter and CRC of the newest.
    newest: Option<(u8, u8)>,
}

impl CounterCheck {
    /// Before the first message.
    pub const NEW: Self = Self { newest: None };

    /// Takes the next message.
    pub fn step(&mut self, packet: &Packet<'_>) -> Step {
        let (counter, crc) = (packet.counter(), packet.crc());
        let Some((old_counter, old_crc)) = self.newest.replace((counter, crc)) else { return Step::First };
        match (counter + COUNTER_VALUES).wrapping_sub(old_counter) % COUNTER_VALUES {
            // The same counter in another message: a whole turn of the counter is missing.
            0 if crc != old_crc => Step::Lost(COUNTER_VALUES - 1),
            0 => Step::Repeated,
            1 => Step::Next,
            steps => Step::Lost(steps - 1),
        }
    }
}

impl core::fmt::Display for PacketError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::WrongLength { expected, found } => write!(f, "the message has {expected} bytes, {found} came"),
            Self::WrongCrc => write!(f, "the checksum does not fit"),
            Self::WrongDataId => write!(f, "the data id is not that of the identifier"),
            Self::InvalidCounter => write!(f, "the counter is 15, which is never sent"),
        }
    }
}

impl core::error::Error for PacketError {}

#[cfg(test)]
mod tests {
    use super::super::address::{BaseId, NodeId};
    use super::*;

    fn j1850(bytes: &[u8]) -> u8 {
        J1850.checksum(bytes)
    }

    #[test]
    fn crc_gives_the_values_published_for_the_crc_routines() {
        // AUTOSAR, Specification of CRC Routines, 8-bit SAE J1850 CRC calculation.
        assert_eq!(j1850(b"123456789"), 0x4B);
        assert_eq!(j1850(&[0x00, 0x00, 0x00, 0x00]), 0x59);
        assert_eq!(j1850(&[0xF2, 0x01, 0x83]), 0x37);
        assert_eq!(j1850(&[0x0F, 0xAA, 0x00, 0x55]), 0x79);
        assert_eq!(j1850(&[0x00, 0xFF, 0x55, 0x11]), 0xB8);
        assert_eq!(j1850(&[0x33, 0x22, 0x55, 0xAA, 0xBB, 0xCC, 0xDD, 0xEE, 0xFF]), 0xCB);
        assert_eq!(j1850(&[0x92, 0x6B, 0x55]), 0x8C);
        assert_eq!(j1850(&[0xFF, 0xFF, 0xFF, 0xFF]), 0x74);
    }

    #[test]
    fn scan_crc_is_the_plain_crc_however_the_bytes_are_split() {
        for split in 0..=9 {
            let (a, b) = b"123456789".split_at(split);
            let mut crc = ScanCrc::START;
            crc.add(a);
            crc.add(b);
            assert_eq!(crc.get(), 0x4B);
        }
    }

    #[test]
    fn frames_are_the_examples_published_for_profile_11_in_nibble_mode() {
        // AUTOSAR, E2E Protocol Specification, profile 11, example: data id 0x123, 8 bytes of zeros, counters 0 and 1.
        let mut data = [0; 8];
        protect(0x123, 0, &mut data);
        assert_eq!(data, [0x2A, 0x10, 0, 0, 0, 0, 0, 0]);
        protect(0x123, 1, &mut data);
        assert_eq!(data, [0x77, 0x11, 0, 0, 0, 0, 0, 0]);
    }

    #[test]
    fn every_error_of_one_or_two_bits_is_caught_in_every_message() {
        let address = Address { base: BaseId::new(0x600).unwrap(), node: NodeId::new(5).unwrap() };
        for message in Message::ALL {
            let (id, bits) = (address.id(message), message.data_len() * 8);
            let mut data = [0; 24];
            let data = &mut data[..message.data_len()];
            data.iter_mut().enumerate().for_each(|(i, byte)| *byte = (i as u8).wrapping_mul(73));
            protect(id.as_raw(), 9, data);
            assert!(Packet::check(address, id, data).unwrap().is_ok());
            for a in 0..bits {
                data[a / 8] ^= 1 << (a % 8);
                // The CRC alone has to notice: it is checked first.
                assert_eq!(Packet::check(address, id, data).unwrap().unwrap_err(), PacketError::WrongCrc, "bit {a}");
                for b in a + 1..bits {
                    data[b / 8] ^= 1 << (b % 8);
                    assert_eq!(Packet::check(address, id, data).unwrap().unwrap_err(), PacketError::WrongCrc);
                    data[b / 8] ^= 1 << (b % 8);
                }
                data[a / 8] ^= 1 << (a % 8);
            }
        }
    }

    #[test]
    fn a_packet_hands_out_its_parts() {
        let address = Address::default();
        let id = address.id(Message::Header);
        for counter in 0..COUNTER_VALUES {
            let mut data = [0, 0, 0x21, 0x43, 0x65, 0x87, 0xA9, 0xCB];
            protect(id.as_raw(), counter, &mut data);
            let packet = Packet::check(address, id, &data).unwrap().unwrap();
            // CRC in the first byte, the counter in the low half of the second.
            assert_eq!((packet.crc(), packet.counter()), (data[0], data[1] & 0xF));
            assert_eq!((packet.message(), packet.counter()), (Message::Header, counter));
            assert_eq!((packet.data(), packet.payload()), (&data[..], &data[2..]));
        }
    }

    #[test]
    fn a_message_under_another_identifier_is_refused() {
        let sender = Address::default();
        for message in Message::ALL.into_iter().filter(|message| !message.is_fd()) {
            let mut data = [0x5A; 8];
            protect(sender.raw_id(message), 3, &mut data);
            for base in (0x100..=0x700).step_by(0x100) {
                for node in 0..16 {
                    let other = Address { base: BaseId::new(base).unwrap(), node: NodeId::new(node).unwrap() };
                    for other_message in Message::ALL.into_iter().filter(|message| !message.is_fd()) {
                        let accepted = Packet::check(other, other.id(other_message), &data).unwrap().is_ok();
                        assert_eq!(accepted, other == sender && other_message == message);
                    }
                }
            }
        }
    }

    #[test]
    fn all_zeros_all_ones_wrong_lengths_and_counter_15_are_refused() {
        let address = Address::default();
        for message in Message::ALL {
            let id = address.id(message);
            for fill in [0x00, 0xFF] {
                assert!(Packet::check(address, id, &[fill; 24][..message.data_len()]).unwrap().is_err());
            }
            for len in (0..=64).filter(|len| *len != message.data_len()) {
                let error = Packet::check(address, id, &[0; 64][..len]).unwrap().unwrap_err();
                assert_eq!(error, PacketError::WrongLength { expected: message.data_len(), found: len });
            }
            let mut data = [0x11; 24];
            let data = &mut data[..message.data_len()];
            protect(id.as_raw(), 0, data);
            COUNTER.put(data, 15);
            data[0] = checksum(id.as_raw(), data);
            assert_eq!(Packet::check(address, id, data).unwrap().unwrap_err(), PacketError::InvalidCounter);
        }
    }

    #[test]
    fn counters_tell_next_repeated_and_lost() {
        let address = Address::default();
        let id = address.id(Message::ScanEcho);
        for old in 0..COUNTER_VALUES {
            for new in 0..COUNTER_VALUES {
                let mut check = CounterCheck::NEW;
                let mut step = |counter, fill| {
                    let mut data = [fill; 8];
                    protect(id.as_raw(), counter, &mut data);
                    check.step(&Packet::check(address, id, &data).unwrap().unwrap())
                };
                assert_eq!(step(old, 1), Step::First);
                let mut steps = 0;
                let mut counter = old;
                while counter != new {
                    counter = next_counter(counter);
                    steps += 1;
                }
                let expected = match steps {
                    0 => Step::Lost(14),
                    1 => Step::Next,
                    steps => Step::Lost(steps - 1),
                };
                assert_eq!(step(new, 2), expected);
                assert_eq!(step(new, 2), Step::Repeated);
            }
        }
    }
}
