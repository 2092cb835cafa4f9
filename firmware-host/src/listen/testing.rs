//! A node and its controller that say made-up things, for tests.

use fencepost_core::{
    ground::GroundPlane,
    health::{Health, HealthLevel, HealthReason},
    map::{Cell, CellState, MapGeometry, SectorDistances},
    wire::{
        Address, BaseId, CommandEncoder, Frame, NodeId, NodeState, Scan, ScanEncoder, Status, VehicleMotionRepr,
        WireConfig, WireSettings,
    },
};
use fencepost_hal::can::CanFrame;

pub(crate) fn node(number: u8) -> NodeId {
    NodeId::new(number).unwrap()
}

/// What goes on the bus for one node.
pub(crate) struct Speaker {
    encoder: ScanEncoder<400>,
    commands: CommandEncoder,
    next_scan: u16,
    pub(crate) status: Status,
}

impl Speaker {
    pub(crate) fn new(number: u8) -> Self {
        let wire = WireConfig::new(WireSettings { node: number, ..WireSettings::CLASSIC }).unwrap();
        Self {
            encoder: ScanEncoder::new(wire).unwrap(),
            commands: CommandEncoder::new(Address { base: BaseId::DEFAULT, node: node(number) }),
            next_scan: 0,
            status: Status { state: NodeState::Running, health: Health::OK, last_scan: None },
        }
    }

    pub(crate) fn degrade(&mut self) {
        self.status.health.raise(HealthReason::NoGround, HealthLevel::Degraded);
        self.status.health.raise(HealthReason::EchoMissing, HealthLevel::Degraded);
    }

    pub(crate) fn heartbeat(&mut self) -> Vec<CanFrame> {
        vec![on_bus(&self.encoder.heartbeat(&self.status))]
    }

    /// Obstacles 5 m ahead from 2 m to the left to 2 m to the right, and free cells before them: 10 frames.
    pub(crate) fn scan(&mut self) -> Vec<CanFrame> {
        let geometry = MapGeometry { cell_size_mm: 500, x_first: 9, x_count: 2, y_first: -5, y_count: 10 };
        let cells: Vec<Cell> = (0..geometry.len())
            .map(|index| {
                let (i, j) = geometry.cell_at(index);
                let state = if i == 10 && (-4..4).contains(&j) { CellState::Obstacle } else { CellState::Free };
                Cell { state, ..Cell::default() }
            })
            .collect();
        let mut sectors = SectorDistances::default();
        sectors.distance_dm[..4].copy_from_slice(&[254, 254, 32, 126]);
        let ground = GroundPlane {
            normal: [0.0, 0.0, 1.0],
            offset_m: 0.0,
            camera_height_m: 1.28,
            pitch_down_rad: 12.3_f32.to_radians(),
            roll_rad: -0.5_f32.to_radians(),
            support: 100,
            rms_m: 0.01,
            age_frames: 3,
        };
        let scan = Scan {
            scan_index: self.next_scan,
            age_ns: 45_000_000,
            health: self.status.health,
            geometry: &geometry,
            cells: &cells,
            sectors: &sectors,
            ground: Some(&ground),
        };
        let mut frames = heapless::Vec::<Frame, 64>::new();
        self.encoder.encode(&scan, &mut frames).unwrap();
        self.status.last_scan = Some(self.next_scan);
        self.next_scan += 1;
        frames.iter().map(on_bus).collect()
    }

    /// Motion, and the echo of the newest scan.
    pub(crate) fn commands(&mut self) -> Vec<CanFrame> {
        let motion = VehicleMotionRepr { speed_mm_per_s: Some(1_200), yaw_rate_cdeg_per_s: Some(-350) };
        let echo = self.commands.scan_echo(self.next_scan.saturating_sub(1));
        vec![on_bus(&self.commands.vehicle_motion(&motion)), on_bus(&echo)]
    }
}

pub(crate) fn on_bus(frame: &Frame) -> CanFrame {
    CanFrame::new(frame.id(), frame.data(), frame.is_fd()).unwrap()
}
