//! What is sent is what is received.

use fencepost_core::health::HealthLevel;
use fencepost_core::map::{CellState, MapGeometry, UnknownReason};
use fencepost_core::wire::{
    Command, CommandEncoder, CommandReceiver, Frame, FrameFormat, GroundRepr, MAX_RUN_LENGTH, Message, NoScan,
    NodeState, Received, Run, ScanEncoder, Status, VehicleMotionRepr, WireConfig, WireSettings, max_bits_per_scan,
    max_frames_per_scan, max_load_permille, scan_low,
};

use super::{CellSet, Encoder, Frames, RUNNING, Random, Receiver, SMALL, World, cell_set, config, encoder, receiver};

const MS: u64 = 1_000_000;

/// Sends `frames` and expects that the last one makes the scan whole.
fn send(receiver: &mut Receiver, frames: &[Frame], now_ns: u64) {
    for (k, frame) in frames.iter().enumerate() {
        let received = receiver.receive(frame.id(), frame.data(), now_ns).unwrap();
        assert_eq!(matches!(received, Received::Scan { .. }), k + 1 == frames.len(), "frame {k}: {received:?}");
    }
}

/// Receives `worlds` with a fresh receiver and checks everything that comes out.
fn check(format: FrameFormat, worlds: &[World]) {
    let mut encoder = encoder(format);
    let mut receiver = receiver(encoder.config().address());
    for (k, world) in worlds.iter().enumerate() {
        let now_ns = k as u64 * 100 * MS;
        let heartbeat = encoder.heartbeat(&RUNNING);
        receiver.receive(heartbeat.id(), heartbeat.data(), now_ns).unwrap();
        let (frames, report) = world.encode(&mut encoder);
        assert_eq!(report.dropped_cells, 0);
        send(&mut receiver, &frames, now_ns);

        let scan = receiver.scan(now_ns).unwrap();
        assert_eq!(cell_set(&scan), world.known());
        assert_eq!(scan.scan_index, world.scan_index);
        assert_eq!(scan.cell_size_mm, world.geometry.cell_size_mm);
        assert_eq!(scan.health, world.health.level);
        assert_eq!(scan.sectors, world.sectors);
        assert_eq!(scan.ground, GroundRepr::of(world.ground.as_ref(), 0).ground);
        assert!((world.age_ns..world.age_ns + 5 * MS).contains(&scan.age_ns));
        assert!(scan.runs.is_sorted_by_key(|run| run.rank()));
    }
    let statistics = receiver.statistics();
    assert_eq!((statistics.scans, statistics.lost, statistics.abandoned_scans), (worlds.len() as u32, 0, 0));
}

#[test]
fn maps_of_every_kind_come_out_as_they_went_in() {
    let mut random = Random::new(1);
    for changes in [0, 1, 5, 20] {
        let worlds = (65_530..65_540_u32)
            .map(|k| World::random(&mut random, k as u16, MapGeometry::default(), changes))
            .collect::<Vec<_>>();
        check(FrameFormat::Fd, &worlds);
        let worlds = (0..100).map(|k| World::random(&mut random, k, SMALL, 5 * changes)).collect::<Vec<_>>();
        check(FrameFormat::Classic, &worlds);
        check(FrameFormat::Fd, &worlds);
    }
}

#[test]
fn a_scan_of_many_frames_wraps_its_sequence_and_still_arrives() {
    let mut random = Random::new(2);
    let world = World::random(&mut random, 9, MapGeometry::default(), 100);
    let (frames, _) = world.encode(&mut encoder(FrameFormat::Fd));
    assert!(frames.len() > 100, "{}", frames.len());
    check(FrameFormat::Fd, &[world]);
}

#[test]
fn an_empty_scan_sends_a_header_and_an_end() {
    let mut world = World::random(&mut Random::new(3), 77, SMALL, 0);
    world.cells.clear();
    let mut encoder = encoder(FrameFormat::Classic);
    let (frames, report) = world.encode(&mut encoder);
    assert_eq!((report.frames, report.cells, report.dropped_cells), (8, 0, 0));
    let address = encoder.config().address();
    assert_eq!(frames[0].id(), address.id(Message::Header));
    assert_eq!(frames[7].id(), address.id(Message::End));
    check(FrameFormat::Classic, &[world]);
}

/// A run in the order of sending: whether it is free, distance squared in half cells, first cell, and its cells.
type PlainRun = (bool, i32, i8, i8, Vec<(i8, i8, bool)>);

/// Runs of a world the plain way: cell by cell, then sorted by what the documentation says.
fn plain_runs(world: &World) -> Vec<PlainRun> {
    let geometry = &world.geometry;
    let mut runs: Vec<Vec<(i8, i8, bool)>> = Vec::new();
    for i in geometry.x_first..geometry.x_first + geometry.x_count as i16 {
        let mut open = false;
        for j in geometry.y_first..geometry.y_first + geometry.y_count as i16 {
            let state = world.cells[geometry.index(i, j).unwrap()].state;
            if matches!(state, CellState::Unknown(_)) {
                open = false;
                continue;
            }
            let cell = (i as i8, j as i8, state == CellState::Obstacle);
            match runs.last_mut() {
                Some(run) if open && run[0].2 == cell.2 && run.len() < usize::from(MAX_RUN_LENGTH) => run.push(cell),
                _ => runs.push(vec![cell]),
            }
            open = true;
        }
    }
    let keyed = runs.into_iter().map(|run| {
        let half = |index: i8| 2 * i32::from(index) + 1;
        let nearest = run.iter().map(|(i, j, _)| half(*i).pow(2) + half(*j).pow(2)).min().unwrap();
        (!run[0].2, nearest, run[0].0, run[0].1, run)
    });
    let mut keyed = keyed.collect::<Vec<_>>();
    keyed.sort();
    keyed
}

#[test]
fn what_does_not_fit_is_the_farthest_free_and_is_counted() {
    let mut random = Random::new(4);
    for round in 0..60 {
        let max_cell_frames = random.between(1, 40) as u8;
        let format = if round % 2 == 0 { FrameFormat::Classic } else { FrameFormat::Fd };
        let settings = WireSettings { max_cell_frames, format, ..WireSettings::CLASSIC };
        let config = WireConfig::new(settings).unwrap();
        let mut encoder = Encoder::new(config).unwrap();
        let geometry = MapGeometry { x_first: -20, y_first: -30, x_count: 60, y_count: 70, ..SMALL };
        let world = World::random(&mut random, round, geometry, 30);

        let runs = plain_runs(&world);
        let kept = runs.iter().take(config.max_runs()).flat_map(|run| &run.4).copied().collect::<CellSet>();
        let (frames, report) = world.encode(&mut encoder);
        assert_eq!(usize::from(report.cells), kept.len());
        assert_eq!(report.dropped_cells as usize, world.known().len() - kept.len());
        assert!(report.dropped_cells > 0);

        let mut receiver = receiver(config.address());
        let heartbeat = encoder.heartbeat(&RUNNING);
        receiver.receive(heartbeat.id(), heartbeat.data(), 0).unwrap();
        send(&mut receiver, &frames, 0);
        let scan = receiver.scan(0).unwrap();
        assert_eq!(cell_set(&scan), kept);
        assert_eq!(u32::from(scan.dropped_cells), report.dropped_cells.min(4095));
        assert_eq!(scan.health, HealthLevel::Degraded, "a truncated map is never ok");
    }
}

#[test]
fn cells_whose_index_does_not_fit_are_counted_and_never_moved() {
    for (x_first, y_first) in [(-100, -100), (30, 40), (-32768, 0), (32700, 32700)] {
        let geometry = MapGeometry { x_first, y_first, x_count: 60, y_count: 60, ..SMALL };
        let mut world = World::random(&mut Random::new(5), 1, geometry, 3);
        let range = -64..=63;
        let sendable = |index: usize| {
            let (a, b) = (index as i32 / 60, index as i32 % 60);
            range.contains(&(i32::from(x_first) + a)) && range.contains(&(i32::from(y_first) + b))
        };
        let known = |cell: &fencepost_core::map::Cell| !matches!(cell.state, CellState::Unknown(_));
        let lost = world.cells.iter().enumerate().filter(|(index, cell)| known(cell) && !sendable(*index)).count();
        let (_, report) = world.encode(&mut encoder(FrameFormat::Fd));
        assert!(lost > 0);
        assert_eq!(report.dropped_cells as usize, lost);

        for (index, cell) in world.cells.iter_mut().enumerate() {
            if !sendable(index) {
                *cell = fencepost_core::map::Cell::default();
            }
        }
        world.geometry = geometry;
        check(FrameFormat::Fd, &[world]);
    }
}

#[test]
fn shapes_without_sense_do_no_harm() {
    let mut world = World::random(&mut Random::new(6), 1, SMALL, 50);
    for (x_count, y_count) in [(0, 0), (0, 5), (5, 0), (65535, 65535), (1, 65535), (65535, 1)] {
        world.geometry = MapGeometry { x_count, y_count, x_first: 32767, y_first: -32768, ..SMALL };
        let (frames, _) = world.encode(&mut encoder(FrameFormat::Classic));
        assert!(frames.len() >= 8);
    }
    // 128 x 128 known cells are one more than the header can count.
    world.geometry = MapGeometry { x_first: -64, y_first: -64, x_count: 128, y_count: 128, ..SMALL };
    world.cells = vec![fencepost_core::map::Cell { state: CellState::Free, ..Default::default() }; 128 * 128];
    let (_, report) = world.encode(&mut encoder(FrameFormat::Fd));
    assert!(report.cells <= 16383);
    assert_eq!(u32::from(report.cells) + report.dropped_cells, 16384);
    // One less is the most it can, and all of them go.
    world.cells[0].state = CellState::Unknown(UnknownReason::Hidden);
    let (_, report) = world.encode(&mut encoder(FrameFormat::Fd));
    assert_eq!((report.cells, report.dropped_cells), (16383, 0));
}

#[test]
fn a_small_output_truncates_and_a_tiny_one_is_refused() {
    let world = World::random(&mut Random::new(7), 1, SMALL, 50);
    let mut encoder = encoder(FrameFormat::Classic);
    let mut tiny: heapless::Vec<Frame, 7> = heapless::Vec::new();
    assert!(encoder.encode(&world.scan(), &mut tiny).is_err());
    assert!(tiny.is_empty());
    let mut small: heapless::Vec<Frame, 10> = heapless::Vec::new();
    let report = encoder.encode(&world.scan(), &mut small).unwrap();
    assert_eq!((report.frames, small.len()), (10, 10));
    assert_eq!(usize::from(report.cells) + report.dropped_cells as usize, world.known().len());
    assert!(report.dropped_cells > 0);
    let mut receiver = receiver(encoder.config().address());
    let heartbeat = encoder.heartbeat(&RUNNING);
    receiver.receive(heartbeat.id(), heartbeat.data(), 0).unwrap();
    send(&mut receiver, &small, 0);
    assert_eq!(receiver.scan(0).unwrap().cells().count(), usize::from(report.cells));
}

#[test]
fn an_encoder_without_room_for_its_settings_is_refused() {
    let error = ScanEncoder::<399>::new(WireConfig::default()).unwrap_err();
    assert_eq!(error.field, "wire.max_cell_frames");
    assert!(ScanEncoder::<400>::new(WireConfig::default()).is_ok());
}

#[test]
fn nodes_on_one_bus_do_not_hear_each_other() {
    let mut random = Random::new(8);
    let mut encoders =
        (0..16).map(|node| Encoder::new(config(FrameFormat::Classic, node)).unwrap()).collect::<Vec<_>>();
    let mut receivers = encoders.iter().map(|e| receiver(e.config().address())).collect::<Vec<_>>();
    let worlds = (0..16).map(|node| World::random(&mut random, node, SMALL, 20)).collect::<Vec<_>>();
    let mut streams = encoders
        .iter_mut()
        .zip(&worlds)
        .map(|(encoder, world)| {
            let mut frames = vec![encoder.heartbeat(&RUNNING)];
            frames.extend(world.encode(encoder).0);
            frames.into_iter()
        })
        .collect::<Vec<_>>();
    // The frames of all nodes mixed, in order within each node.
    while streams.iter().any(|stream| stream.len() > 0) {
        let node = random.below(16) as usize;
        if let Some(frame) = streams[node].next() {
            receivers.iter_mut().for_each(|receiver| {
                receiver.receive(frame.id(), frame.data(), 0).unwrap();
            });
        }
    }
    for (receiver, world) in receivers.iter().zip(&worlds) {
        assert_eq!(cell_set(&receiver.scan(0).unwrap()), world.known());
    }
}

#[test]
fn there_is_no_scan_before_the_first_and_none_when_it_is_too_old() {
    let mut encoder = encoder(FrameFormat::Classic);
    let mut receiver = receiver(encoder.config().address());
    let mut world = World::random(&mut Random::new(9), 5, SMALL, 20);
    world.age_ns = 40 * MS;
    assert_eq!(receiver.scan(0).unwrap_err(), NoScan::NoHeartbeat);

    let (frames, _) = world.encode(&mut encoder);
    send(&mut receiver, &frames, 0);
    assert_eq!(receiver.scan(0).unwrap_err(), NoScan::NoHeartbeat, "a scan without a heartbeat does not count");
    for state in [NodeState::Starting, NodeState::Stopping, NodeState::Fault] {
        let heartbeat = encoder.heartbeat(&Status { state, ..RUNNING });
        receiver.receive(heartbeat.id(), heartbeat.data(), 0).unwrap();
        assert_eq!(receiver.scan(0).unwrap_err(), NoScan::NotRunning(state));
    }
    let heartbeat = encoder.heartbeat(&RUNNING);
    receiver.receive(heartbeat.id(), heartbeat.data(), 0).unwrap();
    assert_eq!(receiver.scan(300 * MS).unwrap().age_ns, 340 * MS);
    assert_eq!(receiver.scan(301 * MS).unwrap_err(), NoScan::NoHeartbeat);

    // The same heartbeat again does not keep it alive: a frozen sender.
    assert_eq!(receiver.receive(heartbeat.id(), heartbeat.data(), 290 * MS), Ok(Received::Repeated));
    assert_eq!(receiver.scan(301 * MS).unwrap_err(), NoScan::NoHeartbeat);

    let heartbeat = encoder.heartbeat(&RUNNING);
    receiver.receive(heartbeat.id(), heartbeat.data(), 400 * MS).unwrap();
    assert!(receiver.scan(460 * MS).is_ok());
    assert_eq!(receiver.scan(461 * MS).unwrap_err(), NoScan::TooOld);
    assert!(receiver.heartbeat(461 * MS).is_some());
}

#[test]
fn a_scan_whose_age_is_off_the_scale_is_never_used() {
    let mut encoder = encoder(FrameFormat::Classic);
    let mut receiver = receiver(encoder.config().address());
    let mut world = World::random(&mut Random::new(10), 5, SMALL, 20);
    world.age_ns = u64::MAX;
    let (mut frames, _) = world.encode(&mut encoder);
    frames.push(encoder.heartbeat(&RUNNING));
    for frame in frames {
        receiver.receive(frame.id(), frame.data(), 0).unwrap();
    }
    assert_eq!(receiver.statistics().scans, 1);
    assert_eq!(receiver.scan(0).unwrap_err(), NoScan::TooOld);
}

#[test]
fn a_node_that_began_anew_is_heard_again() {
    let mut random = Random::new(11);
    let mut first = encoder(FrameFormat::Classic);
    let mut receiver = receiver(first.config().address());
    send(&mut receiver, &World::random(&mut random, 500, SMALL, 20).encode(&mut first).0, 0);
    let mut second = encoder(FrameFormat::Classic);
    let refused = World::random(&mut random, 0, SMALL, 20).encode(&mut second).0;
    let first_answer = receiver.receive(refused[0].id(), refused[0].data(), 100 * MS).unwrap();
    assert!(matches!(first_answer, Received::Old | Received::Repeated), "{first_answer:?}");
    let world = World::random(&mut random, 1, SMALL, 20);
    let frames = world.encode(&mut second).0;
    send(&mut receiver, &frames, 2_000 * MS);
    let heartbeat = second.heartbeat(&RUNNING);
    receiver.receive(heartbeat.id(), heartbeat.data(), 2_000 * MS).unwrap();
    assert_eq!(cell_set(&receiver.scan(2_000 * MS).unwrap()), world.known());
}

#[test]
fn a_receiver_with_less_room_gives_the_scan_up() {
    let mut encoder = encoder(FrameFormat::Classic);
    let address = encoder.config().address();
    let mut receiver =
        fencepost_core::wire::ScanReceiver::<10>::new(fencepost_core::wire::ReceiverConfig::new(address));
    let (frames, _) = World::random(&mut Random::new(12), 1, SMALL, 50).encode(&mut encoder);
    for frame in frames {
        receiver.receive(frame.id(), frame.data(), 0).unwrap();
    }
    assert_eq!((receiver.statistics().scans, receiver.statistics().abandoned_scans), (0, 1));
}

#[test]
fn commands_arrive_once_and_are_forgotten_in_time() {
    let address = WireConfig::default().address();
    let (mut encoder, mut receiver) = (CommandEncoder::new(address), CommandReceiver::new(address, 100 * MS));
    assert_eq!((receiver.vehicle_motion(0), receiver.scan_echo(0)), (None, None));
    for k in 0..40_i16 {
        let now_ns = k as u64 * 20 * MS;
        let motion = VehicleMotionRepr {
            speed_mm_per_s: (k % 3 > 0).then_some(k * 800 - 16_000),
            yaw_rate_cdeg_per_s: (k % 4 > 0).then_some(i16::MIN + k),
        };
        let frame = encoder.vehicle_motion(&motion);
        assert_eq!(receiver.receive(frame.id(), frame.data(), now_ns), Ok(Command::VehicleMotion(motion)));
        assert_eq!(receiver.receive(frame.id(), frame.data(), now_ns + 90 * MS), Ok(Command::Repeated));
        assert_eq!(receiver.vehicle_motion(now_ns + 100 * MS), Some(motion));
        assert_eq!(receiver.vehicle_motion(now_ns + 101 * MS), None);
        let frame = encoder.scan_echo(k as u16);
        receiver.receive(frame.id(), frame.data(), now_ns).unwrap();
        assert_eq!(receiver.scan_echo(now_ns), Some(k as u16));
    }
    assert_eq!(receiver.statistics().repeated, 40);
    assert_eq!(receiver.statistics().lost, 0);
    encoder.scan_echo(0);
    let mut frame = encoder.scan_echo(1).data().to_vec();
    let id = address.id(Message::ScanEcho);
    receiver.receive(id, &frame, 0).unwrap();
    assert_eq!(receiver.statistics().lost, 1);
    frame[3] ^= 1;
    assert!(receiver.receive(id, &frame, 0).is_err());
    assert_eq!(receiver.statistics().crc_errors, 1);
    assert_eq!(receiver.receive(address.id(Message::End), &[0; 8], 0), Ok(Command::NotOurs));
}

#[test]
fn runs_of_a_full_row_are_split_at_31() {
    let geometry = MapGeometry { x_first: 3, x_count: 1, y_first: -64, y_count: 128, ..SMALL };
    let mut world = World::random(&mut Random::new(13), 0x1234, geometry, 0);
    world.cells.iter_mut().for_each(|cell| cell.state = CellState::Obstacle);
    let mut encoder = encoder(FrameFormat::Classic);
    let (frames, _) = world.encode(&mut encoder);
    let runs = plain_runs(&world);
    let lengths = runs.iter().map(|run| run.4.len()).collect::<Vec<_>>();
    assert_eq!(lengths, [31, 31, 31, 31, 4]);
    assert_eq!(frames.len(), 8 + 3);
    check(FrameFormat::Classic, &[world]);
    assert_eq!(scan_low(0x1234), 4);
    assert_eq!(Run { i: 1, j: -2, length: 3, obstacle: true }.cells().collect::<Vec<_>>(), [(1, -2), (1, -1), (1, 0)]);
}

#[test]
fn the_bytes_of_a_scan_stay_what_they_are() {
    let geometry = MapGeometry { cell_size_mm: 500, x_first: 0, x_count: 2, y_first: -1, y_count: 3 };
    let mut world = World::random(&mut Random::new(14), 0xBEEF, geometry, 0);
    let states = [CellState::Free, CellState::Free, CellState::Obstacle];
    world.cells.iter_mut().zip(states).for_each(|(cell, state)| cell.state = state);
    world.cells.truncate(3);
    world.age_ns = 43_000_000;
    world.sectors.distance_dm = std::array::from_fn(|k| 10 * k as u8);
    world.ground = None;
    let mut encoder = encoder(FrameFormat::Classic);
    let mut out = Frames::new();
    out.push(encoder.heartbeat(&Status { last_scan: Some(0xBEEF), ..RUNNING })).unwrap();
    encoder.encode(&world.scan(), &mut out).unwrap();
    let lines = out.iter().map(|frame| format!("{frame:?}\n")).collect::<String>();
    assert_eq!(lines, include_str!("scan.golden"), "\n{lines}");
}

#[test]
fn the_bus_load_in_the_documentation_is_that_of_the_code() {
    let page = include_str!("../../../docs/wire.md");
    let rows = page.lines().filter(|line| line.ends_with("% |")).collect::<Vec<_>>();
    assert_eq!(rows.len(), 6);
    for row in rows {
        let columns = row.trim_matches('|').split('|').map(str::trim).collect::<Vec<_>>();
        let (frames, format) = columns[0].split_once(' ').unwrap();
        let format = if format.starts_with("FD") { FrameFormat::Fd } else { FrameFormat::Classic };
        let settings = WireSettings { format, max_cell_frames: frames.parse().unwrap(), ..WireSettings::CLASSIC };
        let config = WireConfig::new(settings).unwrap();
        let load = |bitrate| {
            let permille = max_load_permille(&config, bitrate, 10);
            format!("{}.{} %", permille / 10, permille % 10)
        };
        let expected = [
            config.max_runs().to_string(),
            max_frames_per_scan(&config).to_string(),
            max_bits_per_scan(&config).to_string(),
            load(250_000),
            load(500_000),
            load(1_000_000),
        ];
        assert_eq!(columns[1..], expected, "{row}");
    }
}
