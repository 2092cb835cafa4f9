//! Identifiers: which node speaks, and what it says.

use embedded_can::StandardId;

use crate::error::{ConfigError, ConfigProblem};

/// First of the 256 identifiers that the nodes of one bus share: a multiple of `0x100` from `0x100` to `0x700`.
///
/// `0x000` is no base: there the data of node 0 could be all zeros with a checksum of zero, which is what a stuck bus or a
/// cleared buffer looks like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BaseId(u16);

impl BaseId {
    /// `0x400`: below what most vehicles use for diagnosis and above their control messages.
    pub const DEFAULT: Self = Self(0x400);

    /// Takes `id` if it is a base.
    ///
    /// # Errors
    /// Named `wire.base_id`.
    pub const fn new(id: u16) -> Result<Self, ConfigError> {
        if id < 0x100 || id > 0x700 {
            let problem = ConfigProblem::OutOfRange { min: 256.0, max: 1792.0 };
            return Err(ConfigError::new("wire.base_id", problem));
        }
        if !id.is_multiple_of(0x100) {
            return Err(ConfigError::new("wire.base_id", ConfigProblem::NotAMultiple { of: 256 }));
        }
        Ok(Self(id))
    }

    /// The identifier.
    pub const fn get(self) -> u16 {
        self.0
    }
}

/// One pair of cameras on a bus: 0 to 15.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct NodeId(u8);

impl NodeId {
    /// Takes `node` if it is at most 15.
    ///
    /// # Errors
    /// Named `wire.node`.
    pub const fn new(node: u8) -> Result<Self, ConfigError> {
        if node > 15 {
            return Err(ConfigError::new("wire.node", ConfigProblem::OutOfRange { min: 0.0, max: 15.0 }));
        }
        Ok(Self(node))
    }

    /// The number.
    pub const fn get(self) -> u8 {
        self.0
    }
}

/// The messages. The number is the lowest four bits of the identifier.
///
/// The numbers of the messages of a scan rise in the order in which they are sent: a controller that sends the lowest
/// identifier of its buffers first keeps that order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Message {
    /// State and health of the node, ten times a second.
    Heartbeat = 0,
    /// Begins a scan.
    Header = 1,
    /// Cells of a scan, in 8 bytes.
    Cells = 2,
    /// Cells of a scan, in 24 bytes (CAN FD).
    CellsFd = 3,
    /// Nearest obstacles of a scan by direction.
    Sectors = 4,
    /// Ground plane of a scan.
    Ground = 5,
    /// Ends a scan.
    End = 6,
    /// To the node: how the vehicle moves.
    VehicleMotion = 14,
    /// To the node: the newest scan that was taken over.
    ScanEcho = 15,
}

impl Message {
    /// Every message.
    pub const ALL: [Self; 9] = [
        Self::Heartbeat,
        Self::Header,
        Self::Cells,
        Self::CellsFd,
        Self::Sectors,
        Self::Ground,
        Self::End,
        Self::VehicleMotion,
        Self::ScanEcho,
    ];

    /// Name in the DBC file.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Heartbeat => "Heartbeat",
            Self::Header => "Header",
            Self::Cells => "Cells",
            Self::CellsFd => "CellsFd",
            Self::Sectors => "Sectors",
            Self::Ground => "Ground",
            Self::End => "End",
            Self::VehicleMotion => "VehicleMotion",
            Self::ScanEcho => "ScanEcho",
        }
    }

    /// Number of data bytes.
    pub const fn data_len(self) -> usize {
        if self.is_fd() { 24 } else { 8 }
    }

    /// Whether it needs CAN FD.
    pub const fn is_fd(self) -> bool {
        matches!(self, Self::CellsFd)
    }
}

/// What a node is called on its bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Address {
    /// First identifier of all nodes.
    pub base: BaseId,
    /// The node.
    pub node: NodeId,
}

impl Default for Address {
    fn default() -> Self {
        Self { base: BaseId::DEFAULT, node: NodeId::default() }
    }
}

impl Address {
    /// Identifier of a message: `base | node << 4 | message`.
    pub const fn raw_id(self, message: Message) -> u16 {
        self.base.0 | (self.node.0 as u16) << 4 | message as u16
    }

    /// Identifier of a message.
    pub fn id(self, message: Message) -> StandardId {
        // A base is at most 0x700 and the rest at most 0xFF, so that the identifier always fits in 11 bits.
        StandardId::new(self.raw_id(message)).unwrap_or(StandardId::MAX)
    }

    /// The message of this node that `id` stands for.
    ///
    /// # Bound
    /// The nine messages.
    pub fn message(self, id: StandardId) -> Option<Message> {
        Message::ALL.into_iter().find(|message| self.raw_id(*message) == id.as_raw())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_base_node_and_message_has_its_own_identifier() {
        let mut seen = [false; 0x800];
        for base in (0x100..=0x700).step_by(0x100) {
            for node in 0..16 {
                let address = Address { base: BaseId::new(base).unwrap(), node: NodeId::new(node).unwrap() };
                assert_eq!((address.base.get(), address.node.get()), (base, node));
                for message in Message::ALL {
                    let id = address.id(message);
                    assert!(!core::mem::replace(&mut seen[usize::from(id.as_raw())], true), "{id:?} twice");
                    assert_eq!(address.message(id), Some(message));
                }
                let own = (0..=0x7FF).filter(|raw| address.message(StandardId::new(*raw).unwrap()).is_some());
                assert_eq!(own.count(), Message::ALL.len());
            }
        }
    }

    #[test]
    fn bases_and_nodes_out_of_range_are_refused() {
        for id in [0x000, 0x0FF, 0x401, 0x480, 0x800, 0xFFFF] {
            assert_eq!(BaseId::new(id).unwrap_err().field, "wire.base_id");
        }
        assert_eq!(NodeId::new(16).unwrap_err().field, "wire.node");
    }
}
