//! Puts a scan together from its messages, in the one order in which they may come.

use embedded_can::StandardId;
use heapless::VecView;

use crate::map::{SECTOR_COUNT, SECTOR_UNKNOWN, SectorDistances};

use super::address::{Address, Message};
use super::message::{
    CellsRepr, EndRepr, GroundRepr, HeaderRepr, HeartbeatRepr, MeaninglessValue, Run, SECTORS_PER_PART, SectorLayout,
    SectorsRepr, WireGround, scan_low,
};
use super::protect::{CounterCheck, Packet, PacketError, ScanCrc, Step};
use super::receiver::{Abandoned, ReceiveError, Received, ReceivedScan};

/// What one frame did beside what it was, also one that was refused.
#[derive(Default)]
pub(super) struct Outcome {
    /// What the counter said.
    pub step: Option<Step>,
    pub heartbeat: Option<HeartbeatRepr>,
    pub committed: Option<Committed>,
    /// A scan was given up.
    pub abandoned: bool,
}

/// A whole scan, but for its runs.
#[derive(Clone, Copy, Debug)]
pub(super) struct Committed {
    header: HeaderRepr,
    header_ns: u64,
    end: EndRepr,
    sectors: SectorDistances,
    ground: Option<WireGround>,
}

impl Committed {
    pub(super) const fn scan_index(&self) -> u16 {
        self.header.scan_index
    }

    /// Time since exposure; `None` if it is not known how long.
    fn age_ns(&self, now_ns: u64) -> Option<u64> {
        Some(self.header.age_ns()?.saturating_add(now_ns.saturating_sub(self.header_ns)))
    }

    pub(super) fn is_fresh(&self, now_ns: u64, max_age_ns: u64) -> bool {
        self.age_ns(now_ns).is_some_and(|age_ns| age_ns <= max_age_ns)
    }

    pub(super) fn view<'a>(&self, now_ns: u64, runs: &'a [Run]) -> ReceivedScan<'a> {
        ReceivedScan {
            scan_index: self.header.scan_index,
            age_ns: self.age_ns(now_ns).unwrap_or(u64::MAX),
            health: self.header.health,
            cell_size_mm: self.end.cell_size_mm,
            dropped_cells: self.end.dropped_cells,
            runs,
            sectors: self.sectors,
            ground: self.ground,
        }
    }
}

/// The message that has to follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Expected {
    /// Cell frame of this number in the scan.
    Cells(u8),
    /// This part of the sectors.
    Sectors(u8),
    Ground,
    End,
}

/// The scan that is being received.
#[derive(Clone, Copy, Debug)]
struct Pending {
    header: HeaderRepr,
    header_ns: u64,
    expected: Expected,
    cells: u32,
    crc: ScanCrc,
    distance_dm: [u8; SECTOR_COUNT],
    layout: SectorLayout,
    ground: Option<WireGround>,
}

/// Counters of the node's messages, and the scan that is being received.
#[derive(Clone, Debug)]
pub(super) struct Assembly {
    counters: [CounterCheck; 16],
    pending: Option<Pending>,
}

impl Assembly {
    pub(super) const fn new() -> Self {
        Self { counters: [CounterCheck::NEW; 16], pending: None }
    }

    /// Takes one frame: identifier, data, time. `newest` is the index of the newest scan while that is fresh; `runs` is the
    /// table for the scan that is being received.
    pub(super) fn receive(
        &mut self,
        address: Address,
        newest: Option<u16>,
        runs: &mut VecView<Run, u16>,
        (id, data, now_ns): (StandardId, &[u8], u64),
        outcome: &mut Outcome,
    ) -> Result<Received, ReceiveError> {
        let packet = match Packet::check(address, id, data) {
            None => return Ok(Received::NotOurs),
            Some(checked) => checked?,
        };
        if matches!(packet.message(), Message::VehicleMotion | Message::ScanEcho) {
            return Ok(Received::NotOurs);
        }
        let Some(counter) = self.counters.get_mut(packet.message() as usize) else { return Ok(Received::NotOurs) };
        let step = counter.step(&packet);
        outcome.step = Some(step);
        if step == Step::Repeated {
            return Ok(Received::Repeated);
        }
        match packet.message() {
            Message::Heartbeat => {
                outcome.heartbeat = Some(HeartbeatRepr::parse(packet.data())?);
                Ok(Received::Heartbeat)
            }
            Message::Header => {
                let header = HeaderRepr::parse(packet.data())?;
                outcome.abandoned = self.pending.take().is_some();
                runs.clear();
                let received = self.begin(header, newest, now_ns);
                let cut_short = outcome.abandoned && received == Received::Part;
                Ok(if cut_short { Received::Abandoned(Abandoned::OutOfOrder) } else { received })
            }
            _ => self.take_part(&packet, step, runs, outcome),
        }
    }

    fn take_part(
        &mut self,
        packet: &Packet<'_>,
        step: Step,
        runs: &mut VecView<Run, u16>,
        outcome: &mut Outcome,
    ) -> Result<Received, ReceiveError> {
        // Taken out, and put back only if the part fits: whatever else happens, the scan is given up.
        let Some(mut pending) = self.pending.take() else { return Ok(Received::Waiting) };
        outcome.abandoned = true;
        let received = match pending.take(packet, step, runs)? {
            Err(reason) => return Ok(Received::Abandoned(reason)),
            Ok(None) => {
                self.pending = Some(pending);
                Received::Part
            }
            Ok(Some(committed)) => {
                outcome.committed = Some(committed);
                Received::Scan { scan_index: committed.scan_index() }
            }
        };
        outcome.abandoned = false;
        Ok(received)
    }

    fn begin(&mut self, header: HeaderRepr, newest: Option<u16>, now_ns: u64) -> Received {
        // A scan that is not newer is one that came late, or the same once more; once the newest has grown too old there is
        // nothing left to compare with, so that a node which began to count anew is heard again.
        let steps = newest.map_or(1, |newest| header.scan_index.wrapping_sub(newest));
        if steps == 0 || steps > 0x7FFF {
            return Received::Old;
        }
        self.pending = Some(Pending {
            header,
            header_ns: now_ns,
            expected: if header.frame_count == 0 { Expected::Sectors(0) } else { Expected::Cells(0) },
            cells: 0,
            crc: ScanCrc::START,
            distance_dm: [SECTOR_UNKNOWN; SECTOR_COUNT],
            layout: SectorLayout::default(),
            ground: None,
        });
        Received::Part
    }
}

impl Pending {
    /// Takes the next message of the scan. The inner result is the scan if it is whole now, or why it is given up.
    fn take(
        &mut self,
        packet: &Packet<'_>,
        step: Step,
        runs: &mut VecView<Run, u16>,
    ) -> Result<Result<Option<Committed>, Abandoned>, MeaninglessValue> {
        let scan_low = scan_low(self.header.scan_index);
        let (part, expected) = match (packet.message(), self.expected) {
            (Message::Cells | Message::CellsFd, Expected::Cells(frame)) => (frame, Expected::Cells(frame)),
            (Message::Sectors, Expected::Sectors(part)) => (part, Expected::Sectors(part)),
            (Message::Ground, Expected::Ground) => (0, Expected::Ground),
            (Message::End, Expected::End) => (0, Expected::End),
            _ => return Ok(Err(Abandoned::OutOfOrder)),
        };
        // What is missing before the first of its kind belongs to earlier scans, which never became whole.
        if part > 0 && step != Step::Next {
            return Ok(Err(Abandoned::Lost));
        }
        let data = packet.data();
        let found_scan_low = match expected {
            Expected::Cells(frame) => {
                let cells = CellsRepr::parse(data)?;
                if cells.sequence != frame & 0xF {
                    return Ok(Err(Abandoned::OutOfOrder));
                }
                self.crc.add(packet.payload());
                for run in cells.runs.iter().flatten() {
                    self.cells = self.cells.saturating_add(u32::from(run.length));
                    if runs.push(*run).is_err() {
                        return Ok(Err(Abandoned::TooLarge));
                    }
                }
                let next = frame.saturating_add(1);
                self.expected =
                    if next < self.header.frame_count { Expected::Cells(next) } else { Expected::Sectors(0) };
                cells.scan_low
            }
            Expected::Sectors(part) => {
                let sectors = SectorsRepr::parse(data)?;
                if sectors.part() != part {
                    return Ok(Err(Abandoned::OutOfOrder));
                }
                self.take_sectors(&sectors)?;
                let next = part.saturating_add(1);
                self.expected = if next < SectorsRepr::PARTS { Expected::Sectors(next) } else { Expected::Ground };
                sectors.scan_low()
            }
            Expected::Ground => {
                let ground = GroundRepr::parse(data)?;
                self.ground = ground.ground;
                self.expected = Expected::End;
                ground.scan_low
            }
            Expected::End => {
                let end = EndRepr::parse(data)?;
                return Ok(self.commit(end).map(Some));
            }
        };
        Ok(if found_scan_low == scan_low { Ok(None) } else { Err(Abandoned::OtherScan) })
    }

    fn take_sectors(&mut self, sectors: &SectorsRepr) -> Result<(), MeaninglessValue> {
        match sectors {
            SectorsRepr::Distances { part, distance_dm, .. } => {
                let first = usize::from(*part) * SECTORS_PER_PART;
                self.distance_dm.iter_mut().skip(first).zip(distance_dm).for_each(|(to, from)| *to = *from);
            }
            SectorsRepr::Layout { layout, .. } => {
                if usize::from(layout.count) != SECTOR_COUNT {
                    return Err(MeaninglessValue("SectorCount"));
                }
                self.layout = *layout;
            }
        }
        Ok(())
    }

    fn commit(&self, end: EndRepr) -> Result<Committed, Abandoned> {
        if end.scan_index != self.header.scan_index {
            return Err(Abandoned::OtherScan);
        }
        if self.cells != u32::from(self.header.cell_count) {
            return Err(Abandoned::WrongCellCount);
        }
        if end.scan_crc != self.crc.get() {
            return Err(Abandoned::WrongScanCrc);
        }
        let sectors = SectorDistances {
            left_deg: f32::from(self.layout.left_cdeg) / 100.0,
            width_deg: f32::from(self.layout.width_cdeg) / 100.0,
            distance_dm: self.distance_dm,
        };
        Ok(Committed { header: self.header, header_ns: self.header_ns, end, sectors, ground: self.ground })
    }
}

impl From<PacketError> for ReceiveError {
    fn from(error: PacketError) -> Self {
        Self::Packet(error)
    }
}

impl From<MeaninglessValue> for ReceiveError {
    fn from(error: MeaninglessValue) -> Self {
        Self::Value(error)
    }
}

impl core::fmt::Display for ReceiveError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Packet(error) => error.fmt(f),
            Self::Value(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for ReceiveError {}
