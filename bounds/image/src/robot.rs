//! What runs on the target, and on the host to be compared with: the detector and the encoder, in fixed memory.

use fencepost_core::{
    arch::Backend,
    detector::{Capacities, DetectError, Detection, Detector, Probe},
    error::ConfigError,
    matching::MatchSettings,
    picture::Picture,
    settings::Settings,
    wire::{EncodeReport, Frame, OutputFull, Scan, ScanEncoder, WireConfig, WireSettings},
};
use heapless::VecView;

use super::case::Setup;

/// Largest pictures.
pub(crate) const WIDTH: usize = 320;
/// Largest pictures.
pub(crate) const HEIGHT: usize = 240;
/// Most disparities.
pub(crate) const DISPARITIES: usize = 48;

const CAPACITIES: Capacities = Capacities::for_pictures(WIDTH, HEIGHT, DISPARITIES);

/// Everything that the detector holds. All zero until it is configured: it belongs into `.bss`.
pub(crate) type RobotDetector = Detector<
    { CAPACITIES.pixels },
    WIDTH,
    DISPARITIES,
    { CAPACITIES.grid },
    { CAPACITIES.surfaces },
    { CAPACITIES.obstacles },
    { CAPACITIES.cells },
>;

/// What it finds.
pub(crate) type RobotDetection = Detection<{ CAPACITIES.obstacles }, { CAPACITIES.cells }>;

/// The bus: classic frames.
pub(crate) const WIRE: WireConfig = match WireConfig::new(WireSettings::CLASSIC) {
    Ok(config) => config,
    Err(_) => panic!("the defaults can be used"),
};

/// Runs of cells in a scan.
pub(crate) const RUNS: usize = WIRE.max_runs();

/// Frames of the longest scan.
pub(crate) const FRAMES: usize = fencepost_core::wire::max_frames_per_scan(&WIRE) as usize;

/// Takes cameras and settings.
///
/// # Errors
/// The first value that cannot be used.
pub(crate) fn configure(detector: &mut RobotDetector, setup: &Setup, backend: Backend) -> Result<(), ConfigError> {
    let matching = MatchSettings { disparities: setup.disparities, ..MatchSettings::DEFAULT };
    detector.set_backend(backend);
    detector.configure(&Settings { matching, ..Settings::default() }, &setup.calibration, &setup.mount)
}

/// Looks at a pair.
///
/// # Errors
/// Where the pictures have not the size of the cameras.
pub(crate) fn detect<'d>(
    detector: &'d mut RobotDetector,
    [left, right]: &[Picture<'_>; 2],
    probe: &mut impl Probe,
) -> Result<&'d RobotDetection, DetectError> {
    detector.detect(left, right, probe)
}

/// Makes the frames of a scan.
///
/// # Errors
/// Where `frames` is not empty.
pub(crate) fn encode(
    encoder: &mut ScanEncoder<RUNS>,
    detection: &RobotDetection,
    scan_index: u16,
    frames: &mut VecView<Frame>,
) -> Result<EncodeReport, OutputFull> {
    let scan = Scan {
        scan_index,
        // Nobody knows here when the pictures were taken.
        age_ns: 0,
        health: detection.health,
        geometry: &detection.map.geometry,
        cells: &detection.map.cells,
        sectors: &detection.sectors,
        ground: detection.ground.as_ref(),
    };
    encoder.encode(&scan, frames)
}
