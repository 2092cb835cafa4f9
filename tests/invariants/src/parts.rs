//! Parts that a detector uses in one way alone, used in others: maps and planes of any pair side by side, a map of a picture that its
//! surfaces are not of, planes that no ground has, messages whose checksum is right and nothing else, signals anywhere, and the longest of scans.

use fencepost_core::{
    disparity::DisparityPicture,
    geometry::{DepthTable, Place, Rays, VehicleFrame},
    ground::{GroundPlane, Terrain},
    health::{Health, HealthLevel},
    map::{Cell, CellState, MapBuilder, MapGeometry, Merged, ObstacleMap, SectorDistances, UnknownReason, View},
    surfaces::Surfaces,
    wire::{
        Address, BaseId, EndRepr, Frame, FrameFormat, Message, NodeId, Packet, PacketError, Scan, ScanEncoder, Signal,
        WireConfig, WireSettings,
    },
};

use crate::{
    Source,
    camera::{CELLS, Camera, DISPARITIES, PIXELS, SURFACES, draw},
    detection::check_sectors,
    frames::sum,
};

/// One of them.
pub(crate) fn check(source: &mut Source<'_>) {
    match source.byte() % 4 {
        0 => check_merged(source),
        1 => check_map(source),
        2 => check_messages(source),
        // Thousands of cells.
        _ if source.seldom(8) => check_longest_scan(source),
        _ => {}
    }
}

fn cell(source: &mut Source<'_>) -> Cell {
    let state = source.one_of(&[CellState::Unknown(UnknownReason::Hidden), CellState::Free, CellState::Obstacle]);
    Cell { state, ..Cell::default() }
}

/// Of two grounds the one that was seen just now is told, and of two of a kind the one that more supports; sectors are those of the
/// cells, wherever these lie.
fn check_merged(source: &mut Source<'_>) {
    let geometry = MapGeometry {
        cell_size_mm: source.word(),
        x_first: source.word() as i16,
        x_count: 1 + source.below(8) as u16,
        y_first: source.word() as i16,
        y_count: 1 + source.below(8) as u16,
    };
    let mut merged = Merged::<CELLS>::new();
    let mut told: Option<GroundPlane> = None;
    for _ in 0..2 + source.below(2) {
        let mut map = ObstacleMap { geometry, ..ObstacleMap::EMPTY };
        (0..geometry.len()).for_each(|_| map.cells.push(cell(source)).expect("room for the cells"));
        let ground = source.flag().then(|| GroundPlane {
            normal: [0.0, 0.0, 1.0],
            offset_m: source.within(-1.0, 1.0),
            camera_height_m: 1.0,
            pitch_down_rad: 0.0,
            roll_rad: 0.0,
            support: source.below(3) as u32,
            rms_m: 0.0,
            age_frames: source.below(3) as u16,
        });
        let level = source.one_of(&[HealthLevel::Ok, HealthLevel::Degraded, HealthLevel::Blind]);
        assert_eq!(merged.add_parts(&map, ground.as_ref(), Health { level, reasons: 0 }), Ok(()));
        let rank = |ground: &GroundPlane| (ground.age_frames == 0, ground.support);
        if let Some(ground) = ground.filter(|ground| told.is_none_or(|told| rank(ground) > rank(&told))) {
            told = Some(ground);
        }
        assert_eq!(merged.ground(), told.as_ref());
    }
    let width_deg = source.any_number(0.5, 18.0);
    let sectors: SectorDistances = merged.sectors(width_deg);
    if (0.5..=18.0).contains(&width_deg) {
        check_sectors(merged.map(), &sectors);
    }
}

/// A map knows nothing of a picture of another size than its surfaces', and nothing is free where no ground was seen; whatever plane
/// heights are measured from.
fn check_map(source: &mut Source<'_>) {
    let camera = Camera::read(source);
    let Camera { pair, mount, settings } = &camera;
    let Ok(frame) = VehicleFrame::new(&mount.without_place()) else { return };
    let (width, height) = (pair.width as usize, pair.height as usize);
    let (mut builder, mut surfaces) = (MapBuilder::<CELLS>::new(), Surfaces::<PIXELS, SURFACES>::new());
    let heights = (settings.obstacles.min_height_m, settings.obstacles.clearance_m);
    if pair.check().is_err()
        || builder.configure(&settings.map, heights).is_err()
        || surfaces.configure(&settings.surfaces, width, height).is_err()
    {
        return;
    }
    let mut depth = DepthTable::<DISPARITIES>::new();
    depth.configure(pair, settings.matching.min_disparity, settings.matching.disparities);
    let (rays, place) = (Rays::new(pair, &frame), Place::new(mount));
    let mut pixels = Vec::new();
    draw(source, &camera, &mut pixels);
    let whole = DisparityPicture::new(&pixels, width);
    surfaces.run(whole, &depth, &rays);
    let level = GroundPlane::of_mount(&frame);
    let upright = source.one_of(&[[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.6, 0.0, 0.8]]);
    let mut terrain = Terrain::new();
    terrain.flatten(GroundPlane { normal: upright, offset_m: source.within(-1.0, 1.0), ..level });
    let view = View { pair, frame: &frame, place: &place, rays: &rays, depth: &depth, nearest_m: 0.5 };
    let mut map = ObstacleMap::EMPTY;
    let fewer = DisparityPicture::new(&pixels[width..], width);
    for (picture, is_same) in [(whole, true), (fewer, false)] {
        let seen = source.flag();
        builder.run(&surfaces, picture, &view, &terrain, seen, &mut map);
        assert_eq!((map.geometry, map.cells.len()), (settings.map.geometry, settings.map.geometry.len()));
        for cell in &map.cells {
            let is_known = !matches!(cell.state, CellState::Unknown(_));
            assert!(is_same || !is_known, "known of a picture of another size: {cell:?}");
            assert!(seen || cell.state != CellState::Free, "free without ground: {cell:?}");
        }
    }
}

/// A frame under whose checksum stands another's identifier is refused, and so is a counter that is never sent; the end of a scan says
/// what it was made of, and that its cells have a size.
fn check_messages(source: &mut Source<'_>) {
    let (base, node) = (u16::from(source.byte() % 7 + 1) * 0x100, source.byte() % 16);
    let address =
        Address { base: BaseId::new(base).unwrap_or(BaseId::DEFAULT), node: NodeId::new(node).unwrap_or_default() };
    let message = source.one_of(&Message::ALL);
    let raw = address.raw_id(message);
    let mut data = [0; 24];
    let data = &mut data[..message.data_len()];
    data.iter_mut().for_each(|byte| *byte = source.byte());
    let (own, counter) = ((raw >> 8) as u8, source.byte() & 15);
    let any = source.byte() & 15;
    data[1] = source.one_of(&[own, own, any]) << 4 | counter;
    data[0] = sum(raw, data);
    let found = Packet::check(address, address.id(message), data).expect("an identifier of this address");
    let expected = match (data[1] >> 4 == own, counter < 15) {
        (false, _) => Some(PacketError::WrongDataId),
        (true, false) => Some(PacketError::InvalidCounter),
        (true, true) => None,
    };
    assert_eq!(found.err(), expected, "{data:?}");

    // A signal anywhere in the bytes keeps its value.
    let size = 1 + source.below(24) as u8;
    let signal = Signal::new(source.below(65 - usize::from(size)) as u8, size);
    let (value, mut bytes) = (source.double_word(), [source.byte(); 8]);
    signal.put(&mut bytes, value);
    assert_eq!(signal.get(&bytes), value.min(signal.max()), "{signal:?}");

    let mut end = [0; 8];
    end.iter_mut().for_each(|byte| *byte = source.one_of(&[0, 1, 0xF0, 0xFF, 0x5A]));
    let size_mm = u16::from_le_bytes([end[4], end[5]]) & 0x0FFF;
    match EndRepr::parse(&end) {
        Ok(repr) => {
            assert_eq!(repr.cell_size_mm, size_mm);
            let mut again = [end[0], end[1], 0, 0, 0, 0, 0, 0];
            repr.emit(&mut again);
            assert_eq!(again, end);
        }
        Err(_) => assert_eq!(size_mm, 0),
    }
}

/// What a scan of any shape sends and what it drops is all that is known, even of more cells than the header can count.
fn check_longest_scan(source: &mut Source<'_>) {
    const CELL_FRAMES: u8 = 255;
    let settings = WireSettings { format: FrameFormat::Fd, max_cell_frames: CELL_FRAMES, ..WireSettings::CLASSIC };
    let config = WireConfig::new(settings).expect("good settings");
    let mut encoder = ScanEncoder::<{ 8 * CELL_FRAMES as usize }>::new(config).expect("room for the runs");
    let (x_count, y_count) = source.one_of(&[(128, 128), (128, 128), (5, 0), (0, 5), (0, 0), (1, 128), (128, 1)]);
    let geometry = MapGeometry { cell_size_mm: 100, x_first: -64, x_count, y_first: -64, y_count };
    let mut cells = vec![Cell { state: CellState::Free, ..Cell::default() }; 128 * 128];
    for _ in 0..source.below(4) {
        let place = usize::from(source.word()) % cells.len();
        cells[place] = cell(source);
    }
    cells.truncate(geometry.len());
    let scan = Scan {
        scan_index: source.word(),
        age_ns: 0,
        health: Health::OK,
        geometry: &geometry,
        cells: &cells,
        sectors: &SectorDistances::unknown(SectorDistances::WIDTH_DEG),
        ground: None,
    };
    let mut frames = heapless::Vec::<Frame, 300>::new();
    let report = encoder.encode(&scan, &mut frames).expect("room for a scan");
    let known = cells.iter().filter(|cell| !matches!(cell.state, CellState::Unknown(_))).count();
    assert_eq!(usize::from(report.cells) + report.dropped_cells as usize, known, "cells sent and dropped");
    // All of them, but for what 14 bits cannot count.
    assert!(report.dropped_cells == 0 || known > 16_383, "{} dropped of {known}", report.dropped_cells);
}
