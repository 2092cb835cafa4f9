//! Recordings in the EuRoC layout, where they are at hand.

extern crate std;

use std::{
    env, format, fs,
    io::{BufReader, Write},
    path::{Path, PathBuf},
    string::String,
    vec,
    vec::Vec,
};

use nalgebra::{Matrix3, Matrix4};

use crate::geometry::{CameraModel, Distortion, RawPair};

/// The folder of a recording.
///
/// Says so loudly where it is absent; fails where the environment says that all tests have to run.
pub(super) fn find(name: &str) -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/recordings");
    let folder = env::var_os("FENCEPOST_RECORDINGS").map_or(beside, PathBuf::from).join(name);
    if folder.join("mav0").is_dir() {
        return Some(folder);
    }
    // Written straight to the stream: the test harness keeps what the macros print of tests that pass.
    let _ = writeln!(
        std::io::stderr(),
        "NOT RUN: no recording at {}. euroc-room: 12 pairs of a Vicon room sequence of the EuRoC MAV dataset (ETH Zurich); \
         k10-rover: the K10 pair of NASA's StereoPipeline examples. Set FENCEPOST_RECORDINGS to the folder that holds them.",
        folder.display()
    );
    assert!(env::var("CI").as_deref() != Ok("true"), "recording {name} is missing, and CI=true");
    None
}

/// The pair that `sensor.yaml` of both cameras describes. Only as much of YAML as these files use.
pub(super) fn calibration(recording: &Path) -> RawPair {
    let [(left, left_pose), (right, right_pose)] = ["cam0", "cam1"].map(|camera| {
        let path = recording.join("mav0").join(camera).join("sensor.yaml");
        let text = fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
        let size = list(&text, "resolution:");
        let [fx, fy, cx, cy] = list(&text, "intrinsics:").try_into().unwrap();
        let coefficients = list(&text, "distortion_coefficients:");
        let mut distortion = [0.0_f32; 8];
        for (to, from) in distortion.iter_mut().zip(&coefficients) {
            *to = *from as f32;
        }
        let model = CameraModel {
            width: size[0] as u32,
            height: size[1] as u32,
            fx: fx as f32,
            fy: fy as f32,
            cx: cx as f32,
            cy: cy as f32,
            distortion: Distortion(distortion),
        };
        (model, Matrix4::from_row_slice(&list(&text, "data:")))
    });
    let left_to_right = right_pose.try_inverse().unwrap() * left_pose;
    let rotation: Matrix3<f64> = left_to_right.fixed_view::<3, 3>(0, 0).into_owned();
    RawPair {
        left,
        right,
        rotation: core::array::from_fn(|i| core::array::from_fn(|j| rotation[(i, j)] as f32)),
        translation_m: core::array::from_fn(|i| left_to_right[(i, 3)] as f32),
        rectification: None,
    }
}

fn list(text: &str, key: &str) -> Vec<f64> {
    let from = text.find(key).unwrap_or_else(|| panic!("no {key}"));
    let body = text[from..].split_once('[').unwrap().1.split_once(']').unwrap().0;
    body.split(',').map(|number| number.trim().parse().unwrap()).collect()
}

/// A grey picture with its width and height.
pub(super) struct Grey {
    pub(super) pixels: Vec<u8>,
    pub(super) width: usize,
    pub(super) height: usize,
}

/// The pairs of a recording, in order.
pub(super) fn pairs(recording: &Path) -> Vec<[Grey; 2]> {
    let folders = ["cam0", "cam1"].map(|camera| recording.join("mav0").join(camera).join("data"));
    let mut names: Vec<_> = fs::read_dir(&folders[0]).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    names.iter().map(|name| [0, 1].map(|i: usize| read(&folders[i].join(name)))).collect()
}

fn read(path: &Path) -> Grey {
    let name: String = format!("{}", path.display());
    let file = fs::File::open(path).unwrap_or_else(|e| panic!("{name}: {e}"));
    let mut reader = png::Decoder::new(BufReader::new(file)).read_info().unwrap();
    let info = reader.info();
    let (width, height) = (info.width as usize, info.height as usize);
    assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Grayscale, png::BitDepth::Eight), "{name}");
    let mut pixels = vec![0; width * height];
    reader.next_frame(&mut pixels).unwrap();
    Grey { pixels, width, height }
}
