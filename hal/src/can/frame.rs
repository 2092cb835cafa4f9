//! A CAN frame, classic or FD.

use embedded_can::{ExtendedId, Frame, Id, StandardId};

/// Bytes that a classic frame carries at most.
const CLASSIC_BYTES: usize = 8;
/// Lengths that CAN FD has beyond 8 bytes (ISO 11898-1, table of data length codes).
const FD_LENGTHS: [usize; 7] = [12, 16, 20, 24, 32, 48, 64];

/// A CAN frame: 11- or 29-bit identifier and up to 8 bytes, or up to 64 bytes in CAN FD.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct CanFrame {
    id: Id,
    bytes: [u8; 64],
    length: u8,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Data,
    Remote,
    Fd { bit_rate_switch: bool },
}

impl CanFrame {
    /// A data frame. An FD frame switches to the fast bit rate for its data.
    ///
    /// `None` where no frame has that many bytes: above 8 in a classic frame; in CAN FD above 8 only 12, 16, 20, 24, 32, 48
    /// and 64.
    pub fn new(id: impl Into<Id>, data: &[u8], fd: bool) -> Option<Self> {
        let kind = if fd { Kind::Fd { bit_rate_switch: true } } else { Kind::Data };
        let fits = data.len() <= CLASSIC_BYTES || (fd && FD_LENGTHS.contains(&data.len()));
        let mut bytes = [0; 64];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        fits.then_some(Self { id: id.into(), bytes, length: data.len() as u8, kind })
    }

    /// The same frame with or without the fast bit rate; no change to a classic frame.
    #[must_use]
    pub const fn with_bit_rate_switch(mut self, on: bool) -> Self {
        if let Kind::Fd { bit_rate_switch } = &mut self.kind {
            *bit_rate_switch = on;
        }
        self
    }

    /// Identifier.
    pub const fn id(&self) -> Id {
        self.id
    }

    /// Identifier as a number, 11 or 29 bits.
    pub fn raw_id(&self) -> u32 {
        match self.id {
            Id::Standard(id) => id.as_raw() as u32,
            Id::Extended(id) => id.as_raw(),
        }
    }

    /// The bytes that are carried; none in a remote frame.
    pub fn data(&self) -> &[u8] {
        let length = if self.kind == Kind::Remote { 0 } else { usize::from(self.length) };
        self.bytes.get(..length).unwrap_or_default()
    }

    /// Whether this is a CAN FD frame.
    pub const fn is_fd(&self) -> bool {
        matches!(self.kind, Kind::Fd { .. })
    }

    /// Whether the data are sent at the fast bit rate of CAN FD.
    pub const fn bit_rate_switch(&self) -> bool {
        matches!(self.kind, Kind::Fd { bit_rate_switch: true })
    }

    /// Whether this asks for a frame instead of carrying one.
    pub const fn is_remote(&self) -> bool {
        matches!(self.kind, Kind::Remote)
    }

    /// Which of two frames the bus carries first: the smaller key wins arbitration (ISO 11898-1: 0 is dominant, the base
    /// identifier goes first, and a standard frame beats the extended one with the same base).
    pub fn arbitration_key(&self) -> u64 {
        let (base, extension) = match self.id {
            Id::Standard(id) => (id.as_raw() as u64, 0),
            Id::Extended(id) => ((id.as_raw() >> 18) as u64, 1 << 18 | (id.as_raw() & 0x3_FFFF) as u64),
        };
        (base << 19 | extension) << 1 | self.is_remote() as u64
    }

    /// The frame with its data changed by `change`; length and identifier stay.
    #[must_use]
    pub fn map_data(mut self, change: impl FnOnce(&mut [u8])) -> Self {
        let length = self.data().len();
        if let Some(data) = self.bytes.get_mut(..length) {
            change(data);
        }
        self
    }
}

/// Classic frames only: the trait knows no others, and `new` refuses more than 8 bytes.
impl Frame for CanFrame {
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        Self::new(id, data, false)
    }

    fn new_remote(id: impl Into<Id>, dlc: usize) -> Option<Self> {
        let length = u8::try_from(dlc).ok().filter(|length| usize::from(*length) <= CLASSIC_BYTES)?;
        Some(Self { id: id.into(), bytes: [0; 64], length, kind: Kind::Remote })
    }

    fn is_extended(&self) -> bool {
        matches!(self.id, Id::Extended(_))
    }

    fn is_remote_frame(&self) -> bool {
        self.is_remote()
    }

    fn id(&self) -> Id {
        self.id
    }

    fn dlc(&self) -> usize {
        usize::from(self.length)
    }

    fn data(&self) -> &[u8] {
        self.data()
    }
}

/// As candump writes it: `4AA#0102`, `1F334455#R`, `123##1AABB`.
impl std::fmt::Display for CanFrame {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.id {
            Id::Standard(id) => write!(f, "{:03X}#", id.as_raw())?,
            Id::Extended(id) => write!(f, "{:08X}#", id.as_raw())?,
        }
        match self.kind {
            Kind::Data => {}
            // candump leaves the length 0 of a remote frame out.
            Kind::Remote if self.length == 0 => write!(f, "R")?,
            Kind::Remote => write!(f, "R{}", self.length)?,
            Kind::Fd { bit_rate_switch } => write!(f, "#{:X}", u8::from(bit_rate_switch))?,
        }
        self.data().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

impl std::fmt::Debug for CanFrame {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "CanFrame({self})")
    }
}

/// Why a frame cannot be read from text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameParseError {
    /// No `#` between identifier and data.
    NoSeparator,
    /// Not 3 or 8 hexadecimal digits, or above 11 or 29 bits.
    Identifier,
    /// Not pairs of hexadecimal digits.
    Data,
    /// No frame has that many bytes.
    Length(usize),
    /// Flags of a CAN FD frame that are not one hexadecimal digit.
    Flags,
}

impl std::str::FromStr for CanFrame {
    type Err = FrameParseError;

    fn from_str(text: &str) -> Result<Self, FrameParseError> {
        let (id, rest) = text.split_once('#').ok_or(FrameParseError::NoSeparator)?;
        let raw = hexadecimal(id).ok_or(FrameParseError::Identifier)?;
        let id = match id.len() {
            3 => u16::try_from(raw).ok().and_then(StandardId::new).map(Id::Standard),
            8 => ExtendedId::new(raw).map(Id::Extended),
            _ => None,
        };
        let id = id.ok_or(FrameParseError::Identifier)?;
        if let Some(length) = rest.strip_prefix(['R', 'r']) {
            let dlc = if length.is_empty() { 0 } else { hexadecimal(length).ok_or(FrameParseError::Data)? as usize };
            return <Self as Frame>::new_remote(id, dlc).ok_or(FrameParseError::Length(dlc));
        }
        let (fd, rest) = match rest.strip_prefix('#') {
            Some(rest) => {
                let flags = rest.get(..1).and_then(hexadecimal).ok_or(FrameParseError::Flags)?;
                (Some(flags), rest.get(1..).unwrap_or_default())
            }
            None => (None, rest),
        };
        let bytes = data(rest)?;
        let frame = Self::new(id, &bytes, fd.is_some()).ok_or(FrameParseError::Length(bytes.len()))?;
        Ok(frame.with_bit_rate_switch(fd.is_some_and(|flags| flags & 1 != 0)))
    }
}

impl std::fmt::Display for FrameParseError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoSeparator => write!(f, "there is no `#` between identifier and data"),
            Self::Identifier => write!(f, "the identifier is not 3 (to 7FF) or 8 (to 1FFFFFFF) hexadecimal digits"),
            Self::Data => write!(f, "the data are not pairs of hexadecimal digits"),
            Self::Length(length) => write!(f, "no frame has {length} bytes"),
            Self::Flags => write!(f, "the flags of a CAN FD frame are not one hexadecimal digit"),
        }
    }
}

impl std::error::Error for FrameParseError {}

/// A number from hexadecimal digits alone; `from_str_radix` would take a sign as well.
fn hexadecimal(text: &str) -> Option<u32> {
    text.bytes().all(|byte| byte.is_ascii_hexdigit()).then(|| u32::from_str_radix(text, 16).ok())?
}

fn data(text: &str) -> Result<Vec<u8>, FrameParseError> {
    // candump -L writes no dots, cansend and older tools do.
    let digits: Vec<u8> = text.bytes().filter(|byte| *byte != b'.').collect();
    if digits.len() > 2 * 64 {
        return Err(FrameParseError::Length(digits.len() / 2));
    }
    let pairs = digits.chunks(2).map(|pair| {
        let text = std::str::from_utf8(pair).ok().filter(|text| text.len() == 2)?;
        hexadecimal(text).map(|value| value as u8)
    });
    pairs.collect::<Option<Vec<u8>>>().ok_or(FrameParseError::Data)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn standard(id: u16) -> StandardId {
        StandardId::new(id).unwrap()
    }

    #[test]
    fn text_and_back_in_every_kind() {
        // The examples of can-utils' own description of the format, and the ends of every range.
        for text in [
            "123#DEADBEEF",
            "5AA#",
            "7FF#1122334455667788",
            "1F334455#1122334455667788",
            "00000123#01",
            "123##1",
            "123##0112233",
            "123#R",
            "1F334455#R8",
        ] {
            let frame: CanFrame = text.parse().unwrap();
            assert_eq!(frame.to_string(), text);
        }
        let long = format!("1FFFFFFF##1{}", "A5".repeat(64));
        assert_eq!(long.parse::<CanFrame>().unwrap().to_string(), long);
        let dotted: CanFrame = "123#de.ad.be.ef".parse().unwrap();
        assert_eq!(dotted.to_string(), "123#DEADBEEF");
    }

    #[test]
    fn text_that_is_no_frame_is_refused() {
        use FrameParseError::{Data, Flags, Identifier, Length, NoSeparator};
        for (text, error) in [
            ("", NoSeparator),
            ("123", NoSeparator),
            ("#11", Identifier),
            ("800#11", Identifier),
            ("+12#11", Identifier),
            ("12#11", Identifier),
            ("2FFFFFFF#11", Identifier),
            ("123#1", Data),
            ("123#+1", Data),
            ("123#0G", Data),
            ("123#é", Data),
            ("123#112233445566778899", Length(9)),
            ("123##1112233445566778899", Length(9)),
            ("123##", Flags),
            ("123##G", Flags),
            ("123#R9", Length(9)),
            ("123#RG", Data),
        ] {
            assert_eq!(text.parse::<CanFrame>(), Err(error), "{text}");
        }
        assert_eq!(format!("123##1{}", "00".repeat(65)).parse::<CanFrame>(), Err(Length(65)));
    }

    #[test]
    fn only_lengths_that_the_standard_has_make_a_frame() {
        let classic: Vec<usize> =
            (0..=70).filter(|n| CanFrame::new(standard(1), &vec![0; *n], false).is_some()).collect();
        assert_eq!(classic, (0..=8).collect::<Vec<_>>());
        let fd: Vec<usize> = (0..=70).filter(|n| CanFrame::new(standard(1), &vec![0; *n], true).is_some()).collect();
        assert_eq!(fd, [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64]);
    }

    #[test]
    fn arbitration_follows_the_bits_on_the_wire() {
        let extended = |id| CanFrame::new(ExtendedId::new(id).unwrap(), &[], false).unwrap();
        let in_order = [
            CanFrame::new(standard(0), &[], false).unwrap(),
            CanFrame::new(standard(0x123), &[], false).unwrap(),
            <CanFrame as Frame>::new_remote(standard(0x123), 0).unwrap(),
            extended(0x123 << 18),
            extended(0x123 << 18 | 1),
            CanFrame::new(standard(0x124), &[], false).unwrap(),
            CanFrame::new(standard(0x7FF), &[], false).unwrap(),
            extended(0x1FFF_FFFF),
        ];
        assert!(in_order.iter().map(CanFrame::arbitration_key).is_sorted_by(|a, b| a < b));
    }

    #[test]
    fn the_common_trait_sees_a_classic_frame() {
        fn look<F: Frame>(frame: &F) -> (bool, bool, usize, Vec<u8>) {
            (frame.is_extended(), frame.is_remote_frame(), frame.dlc(), frame.data().to_vec())
        }
        let frame = <CanFrame as Frame>::new(standard(1), &[1, 2]).unwrap();
        assert_eq!(look(&frame), (false, false, 2, vec![1, 2]));
        let remote = <CanFrame as Frame>::new_remote(ExtendedId::new(1).unwrap(), 5).unwrap();
        assert_eq!(look(&remote), (true, true, 5, vec![]));
        assert!(<CanFrame as Frame>::new(standard(1), &[0; 9]).is_none());
        assert!(<CanFrame as Frame>::new_remote(standard(1), 9).is_none());
    }
}
