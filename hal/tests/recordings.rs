//! Every recording at hand opens, and every frame of it is a pair of the size that the calibration says.

use std::path::PathBuf;

use fencepost_core::geometry::StereoCalibration;
use fencepost_hal::camera::Camera;
use fencepost_hal::recording::{Layout, Recording};

/// The folder with the recordings, if there is one.
fn recordings() -> Option<PathBuf> {
    let beside = || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/recordings"));
    let folder = std::env::var_os("FENCEPOST_RECORDINGS").map_or_else(beside, PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!(
        "NOT RUN: no recordings in {}. Set FENCEPOST_RECORDINGS to a folder that holds recordings in the layout of KITTI \
         odometry or EuRoC ASL (public: KITTI odometry and stereo 2015, EuRoC MAV, ETH3D two-view, Middlebury 2003).",
        folder.display()
    );
    assert_ne!(std::env::var("CI").as_deref(), Ok("true"), "the recordings must be there in CI");
    None
}

#[test]
fn every_frame_of_every_recording_is_delivered() {
    let Some(folder) = recordings() else { return };
    let mut folders: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    folders.retain(|folder| folder.is_dir());
    folders.sort();
    assert!(!folders.is_empty(), "the folder with recordings is empty");
    for folder in folders {
        let recording = Recording::open(&folder).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(recording.warnings, vec![], "{}", folder.display());
        let baseline_m = match &recording.calibration.stereo {
            StereoCalibration::Rectified(pair) => {
                assert_eq!(recording.layout, Layout::Kitti);
                pair.check().unwrap();
                pair.baseline_m
            }
            StereoCalibration::Raw(pair) => {
                assert_eq!(recording.layout, Layout::Euroc);
                assert!(pair.translation_m[0] < 0.0, "the right camera lies to the right of the left one");
                assert!(pair.left.fx > 100.0 && pair.right.fy > 100.0);
                assert!(pair.left.distortion.0[0] < 0.0, "both lenses are barrel-shaped");
                pair.translation_m.iter().map(|t| t * t).sum::<f32>().sqrt()
            }
        };
        assert!((0.02..1.0).contains(&baseline_m), "{}: baseline {baseline_m} m", folder.display());
        let size = recording.picture_size();
        let frames = recording.frames.clone();
        let mut camera = recording.into_camera();
        for frame in &frames {
            let seen = camera.next_pair(|pair| {
                assert_eq!((pair.left.width() as u32, pair.left.height() as u32), size);
                assert_eq!((pair.right.width() as u32, pair.right.height() as u32), size);
                assert_eq!(pair.timestamp_ns, frame.timestamp_ns);
                let sum = |row: &[u8]| row.iter().map(|value| u64::from(*value)).sum::<u64>();
                (0..pair.left.height()).map(|y| sum(pair.left.row(y)) + sum(pair.right.row(y))).sum::<u64>()
            });
            let sum = seen.unwrap_or_else(|error| panic!("{error}")).expect("a pair for every frame");
            assert!(sum > 0, "{}: frame {} is black", folder.display(), frame.number);
        }
        assert!(camera.next_pair(|_| ()).unwrap().is_none());
        assert_eq!(camera.take_warnings(), vec![]);
        println!("{}: {} frames of {size:?}, baseline {baseline_m} m", folder.display(), frames.len());
    }
}
