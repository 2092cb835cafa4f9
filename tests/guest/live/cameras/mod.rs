//! The program's cameras on real V4L2 devices.

mod faults;
mod formats;

use fencepost_core::picture::Picture;
use fencepost_guest_tests::vivid;
use fencepost_hal::camera::{Camera, CameraSettings, v4l2::V4l2Camera};

const WIDTH: u32 = 512;
const HEIGHT: u32 = 384;

/// Both virtual cameras as a pair. They run at 60 Hz and are not triggered together, so that pictures of the same moment are up
/// to half a period apart; under emulation they come late now and then.
fn virtual_pair() -> CameraSettings {
    CameraSettings {
        pairing_tolerance_ms: 9.0,
        timeout_ms: Some(500),
        ..CameraSettings::two(vivid::LEFT, vivid::RIGHT, WIDTH, HEIGHT)
    }
}

/// A pair of pictures that was lent, kept.
#[derive(Debug)]
struct Kept {
    left: Vec<u8>,
    right: Vec<u8>,
    skew_ns: i64,
    sequence: u32,
    missed: u32,
}

fn next(camera: &mut V4l2Camera) -> Result<Kept, fencepost_hal::camera::v4l2::V4l2Error> {
    let rows = |picture: &Picture<'_>| (0..picture.height()).flat_map(|y| picture.row(y)).copied().collect();
    let kept = camera.next_pair(|pair| Kept {
        left: rows(&pair.left),
        right: rows(&pair.right),
        skew_ns: pair.skew_ns,
        sequence: pair.sequence,
        missed: pair.missed,
    })?;
    Ok(kept.expect("a live camera never ends"))
}
