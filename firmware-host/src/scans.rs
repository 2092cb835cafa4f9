//! Whole scans, put together by the receiver of the core, to be looked at.

use embedded_can::StandardId;
use fencepost_core::{
    map::SectorDistances,
    wire::{
        Abandoned, Address, CellsRepr, EndRepr, GroundRepr, HeaderRepr, Message, Packet, Received, ReceiverConfig, Run,
        ScanReceiver, SectorsRepr, WireGround,
    },
};
use serde_json::{Value, json};

use crate::words;

/// Most runs of cells in a scan: 255 frames of 8.
const RUNS: usize = 255 * CellsRepr::FD_RUNS;

/// Puts the scans of one node together.
///
/// The receiver decides whether a scan is whole; what it holds is kept beside it, since the receiver lends it only while a
/// controller may drive by it, and whoever looks wants to see it in any case.
#[derive(Debug)]
pub struct ScanAssembly {
    receiver: Box<ScanReceiver<RUNS>>,
    parts: Parts,
}

#[derive(Clone, Debug, Default)]
struct Parts {
    header: Option<(HeaderRepr, u64)>,
    runs: Vec<Run>,
    sectors: SectorDistances,
    ground: Option<WireGround>,
    end: Option<EndRepr>,
}

/// What a message did to the scan of its node.
#[derive(Debug)]
pub enum Outcome {
    /// Nothing that is worth a word.
    Quiet,
    /// The scan is given up, and why.
    GivenUp(&'static str),
    /// The scan is whole.
    Whole(WholeScan),
}

/// A scan that came whole.
#[derive(Clone, Debug)]
pub struct WholeScan {
    /// What its header said.
    pub header: HeaderRepr,
    /// When that came, nanoseconds.
    pub header_ns: u64,
    /// What its end said.
    pub end: EndRepr,
    /// Nearest obstacle by direction.
    pub sectors: SectorDistances,
    /// The ground plane, if there is one.
    pub ground: Option<WireGround>,
    /// `(i, j, obstacle)` in the order in which they came.
    pub cells: Vec<(i8, i8, bool)>,
}

impl ScanAssembly {
    /// For the node at `address`.
    pub fn new(address: Address) -> Self {
        Self { receiver: Box::new(ScanReceiver::new(ReceiverConfig::new(address))), parts: Parts::default() }
    }

    /// Takes a frame of the node that came at `now_ns`; `packet` is the frame if its checks hold.
    pub fn receive(&mut self, id: StandardId, data: &[u8], now_ns: u64, packet: Option<&Packet<'_>>) -> Outcome {
        if let Some(packet) = packet {
            self.parts.take(packet, now_ns);
        }
        match self.receiver.receive(id, data, now_ns) {
            Ok(Received::Scan { .. }) => self.parts.clone().whole().map_or(Outcome::Quiet, Outcome::Whole),
            Ok(Received::Abandoned(reason)) => Outcome::GivenUp(words_of(reason)),
            Ok(Received::Old) => Outcome::GivenUp("its index is not newer than that of the scan before"),
            // What a damaged message breaks is said when the next one does not fit.
            Ok(_) | Err(_) => Outcome::Quiet,
        }
    }

    /// The receiver, which knows whether a controller may drive by the newest scan.
    pub const fn receiver(&self) -> &ScanReceiver<RUNS> {
        &self.receiver
    }
}

impl Parts {
    fn take(&mut self, packet: &Packet<'_>, now_ns: u64) {
        let data = packet.data();
        match packet.message() {
            Message::Header => {
                let header = HeaderRepr::parse(data).ok().map(|header| (header, now_ns));
                *self = Self { header, ..Self::default() };
            }
            Message::Cells | Message::CellsFd => {
                self.runs.extend(CellsRepr::parse(data).iter().flat_map(|cells| cells.runs.into_iter().flatten()));
            }
            Message::Sectors => self.take_sectors(data),
            Message::Ground => self.ground = GroundRepr::parse(data).ok().and_then(|ground| ground.ground),
            Message::End => self.end = EndRepr::parse(data).ok(),
            _ => {}
        }
    }

    fn take_sectors(&mut self, data: &[u8]) {
        match SectorsRepr::parse(data) {
            Ok(SectorsRepr::Distances { part, distance_dm, .. }) => {
                let first = usize::from(part) * distance_dm.len();
                self.sectors.distance_dm.iter_mut().skip(first).zip(distance_dm).for_each(|(to, from)| *to = from);
            }
            Ok(SectorsRepr::Layout { layout, .. }) => {
                self.sectors.left_deg = f32::from(layout.left_cdeg) / 100.0;
                self.sectors.width_deg = f32::from(layout.width_cdeg) / 100.0;
            }
            Err(_) => {}
        }
    }

    fn whole(self) -> Option<WholeScan> {
        let (header, header_ns) = self.header?;
        let cells = self.runs.iter().flat_map(|run| run.cells().map(|(i, j)| (i, j, run.obstacle))).collect();
        Some(WholeScan { header, header_ns, end: self.end?, sectors: self.sectors, ground: self.ground, cells })
    }
}

impl WholeScan {
    /// In a line.
    pub fn text(&self) -> String {
        let (obstacles, free) = self.counts();
        let nearest = match self.nearest_m() {
            Some((distance, x, y)) => format!(", the nearest {distance:.2} m away at ({x:.2}, {y:.2}) m"),
            None => String::new(),
        };
        format!(
            "scan {}, health {}: {obstacles} obstacle cells{nearest}; {} free cells",
            self.header.scan_index,
            words::level_name(self.header.health),
            free
        )
    }

    /// As an object.
    pub fn json(&self, time_s: f64, node: u8) -> Value {
        let cells: Vec<_> = self
            .cells
            .iter()
            .map(|(i, j, obstacle)| {
                let (x, y) = self.centre_m(*i, *j);
                json!({"x_m": x, "y_m": y, "state": if *obstacle { "obstacle" } else { "free" }})
            })
            .collect();
        json!({
            "time_s": time_s,
            "node": node,
            "message": "scan",
            "scan": self.header.scan_index,
            "health": words::level_name(self.header.health),
            "age_ms": self.header.age_ns().map(|ns| ns / 1_000_000),
            "dropped_cells": self.end.dropped_cells,
            "camera_height_m": self.ground.map(|g| f64::from(g.camera_height_mm) / 1000.0),
            "pitch_down_deg": self.ground.map(|g| words::tilt_deg(g.pitch_down)),
            "roll_deg": self.ground.map(|g| words::tilt_deg(g.roll)),
            "cells": cells,
        })
    }

    /// A map of characters: the robot `^` looks up, `#` is an obstacle, `.` is free.
    pub fn map(&self) -> String {
        let Some((first_j, last_j)) = span(self.cells.iter().map(|cell| cell.1).chain([0])) else {
            return String::new();
        };
        let Some((first_i, last_i)) = span(self.cells.iter().map(|cell| cell.0).chain([0])) else {
            return String::new();
        };
        let size_m = f64::from(self.end.cell_size_mm) / 1000.0;
        let mut lines = Vec::new();
        for i in (first_i..=last_i).rev() {
            let row = (first_j..=last_j).rev().map(|j| self.sign(i, j));
            lines.push(format!("{:>7.1} m {}", f64::from(i) * size_m, row.collect::<String>().trim_end()));
        }
        lines.join("\n")
    }

    fn sign(&self, i: i8, j: i8) -> char {
        match self.cells.iter().find(|cell| (cell.0, cell.1) == (i, j)) {
            Some((.., true)) => '#',
            Some((.., false)) => '.',
            None if (i, j) == (0, 0) => '^',
            None => ' ',
        }
    }

    /// Time since exposure at `now_ns`, nanoseconds; `None` if the header only knows that it is long.
    pub fn age_ns(&self, now_ns: u64) -> Option<u64> {
        Some(self.header.age_ns()?.saturating_add(now_ns.saturating_sub(self.header_ns)))
    }

    /// Obstacle cells and free cells.
    pub fn counts(&self) -> (usize, usize) {
        let obstacles = self.cells.iter().filter(|cell| cell.2).count();
        (obstacles, self.cells.len() - obstacles)
    }

    /// Distance and place `(x, y)` of the nearest obstacle cell's centre, metres.
    pub fn nearest_m(&self) -> Option<(f64, f64, f64)> {
        let centres = self.cells.iter().filter(|cell| cell.2).map(|(i, j, _)| self.centre_m(*i, *j));
        centres.map(|(x, y)| (x.hypot(y), x, y)).min_by(|a, b| a.0.total_cmp(&b.0))
    }

    fn centre_m(&self, i: i8, j: i8) -> (f64, f64) {
        let centre = |cell: i8| f64::from((2 * i32::from(cell) + 1) * i32::from(self.end.cell_size_mm)) / 2000.0;
        (centre(i), centre(j))
    }
}

fn span(values: impl Iterator<Item = i8> + Clone) -> Option<(i8, i8)> {
    Some((values.clone().min()?, values.max()?))
}

const fn words_of(reason: Abandoned) -> &'static str {
    match reason {
        Abandoned::Lost => "messages are missing",
        Abandoned::OutOfOrder => "its messages are out of order",
        Abandoned::OtherScan => "a part belongs to another scan",
        Abandoned::WrongCellCount => "it has not as many cells as its header says",
        Abandoned::WrongScanCrc => "the checksum over its cells does not fit",
        Abandoned::TooLarge => "it has more cells than there is room for",
    }
}
