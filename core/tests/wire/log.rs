//! Writes a bus log and its cells, for `tests/python/check_can_log.py` to read with a decoder that is not ours.

use std::fmt::Write as _;
use std::path::Path;

use fencepost_core::map::{CellState, MapGeometry};
use fencepost_core::wire::{CommandEncoder, FrameFormat, Status, VehicleMotionRepr, WireConfig, WireSettings};

use super::{Encoder, RUNNING, Random, SMALL, World};

/// Files `wire_classic.log`, `wire_fd.log`, `wire_truncated.log` and their `.csv` lie in `CARGO_TARGET_TMPDIR` afterwards.
#[test]
fn write_a_log_for_an_independent_decoder() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let logs = [
        (FrameFormat::Classic, 255, "wire_classic", SMALL),
        (FrameFormat::Fd, 255, "wire_fd", MapGeometry::default()),
        (FrameFormat::Classic, 6, "wire_truncated", SMALL),
    ];
    for (format, max_cell_frames, name, geometry) in logs {
        let mut random = Random::new(40);
        let settings = WireSettings { format, max_cell_frames, ..WireSettings::CLASSIC };
        let mut encoder = Encoder::new(WireConfig::new(settings).unwrap()).unwrap();
        let mut controller = CommandEncoder::new(encoder.config().address());
        let (mut log, mut csv) = (String::new(), String::from("frame,timestamp_ns,x_m,y_m,state,pixels\n"));
        for frame in 0..40_u16 {
            let changes = if frame % 10 == 3 { 0 } else { 1 + random.below(30) };
            let mut world = World::random(&mut random, frame.wrapping_sub(10), geometry, changes);
            if frame % 10 == 3 {
                world.cells.clear();
            }
            let status = Status { last_scan: frame.checked_sub(1), ..RUNNING };
            let mut frames = vec![encoder.heartbeat(&status)];
            frames.extend(world.encode(&mut encoder).0);
            frames.push(controller.scan_echo(world.scan_index));
            let speed = random.between(-32_768, 32_767) as i16;
            frames.push(controller.vehicle_motion(&VehicleMotionRepr {
                speed_mm_per_s: Some(speed),
                yaw_rate_cdeg_per_s: (frame % 2 == 0).then_some(speed),
            }));
            let timestamp_us = 1_436_509_052_249_713 + u64::from(frame) * 100_000;
            for (k, line) in frames.iter().enumerate() {
                let us = timestamp_us + k as u64 * 250;
                writeln!(log, "({}.{:06}) can0 {line:?}", us / 1_000_000, us % 1_000_000).unwrap();
            }
            for (index, cell) in world.cells.iter().enumerate() {
                let (i, j) = geometry.cell_at(index);
                let (x_m, y_m) = geometry.centre_m(i, j);
                let state = match cell.state {
                    CellState::Unknown(_) => continue,
                    CellState::Free => "free",
                    CellState::Obstacle => "obstacle",
                };
                writeln!(csv, "{frame},{},{x_m:.3},{y_m:.3},{state},{}", timestamp_us * 1000, cell.pixels).unwrap();
            }
        }
        std::fs::write(folder.join(name).with_extension("log"), log).unwrap();
        std::fs::write(folder.join(name).with_extension("csv"), csv).unwrap();
    }
}
