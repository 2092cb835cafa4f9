//! `record` on rendered pictures and a played recording: killed at any moment, out of room, called wrongly.
#![cfg(unix)]

mod common;

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    thread,
    time::Duration,
};

use common::fencepost;
use fencepost_core::geometry::{CameraModel, Distortion, RawPair, StereoCalibration};
use fencepost_hal::{
    camera::Camera,
    recording::{Layout, Recording, RecordingError, RecordingWriter},
    scene::{Scene, SceneOptions},
};
use tempfile::TempDir;

const SIZE: (u32, u32) = (96, 72);

/// SplitMix64.
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        (z ^ (z >> 31)) % end
    }
}

/// A rig with rendered pictures (rectified: KITTI's layout) and one with a recording of raw ones (EuRoC's layout).
fn rigs(folder: &Path) -> [(PathBuf, Layout); 2] {
    let scene = folder.join("scene.toml");
    let (width, height) = SIZE;
    let section = format!("[pair.scene]\nwidth = {width}\nheight = {height}\nframes = 6\nrate_hz = 250.0\n");
    fs::write(&scene, format!("[[pair]]\n{section}")).unwrap();
    raw_recording(&folder.join("raw"));
    let raw = folder.join("raw.toml");
    fs::write(&raw, "[[pair]]\nname = \"nose\"\n[pair.recording]\npath = \"raw\"\nrepeat = true\nrate_hz = 250.0\n")
        .unwrap();
    [(scene, Layout::Kitti), (raw, Layout::Euroc)]
}

fn raw_recording(folder: &Path) {
    let (width, height) = SIZE;
    let options = SceneOptions { width, height, focal_px: 80.0, frames: 5, ..SceneOptions::default() };
    let scene = Scene::new(options).unwrap();
    let camera =
        CameraModel { width, height, fx: 80.0, fy: 80.0, cx: 47.5, cy: 35.5, distortion: Distortion::default() };
    let pair = RawPair {
        left: camera,
        right: camera,
        rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        translation_m: [-0.12, 0.0, 0.0],
        rectification: None,
    };
    let mut writer = RecordingWriter::create(folder, &StereoCalibration::Raw(pair), &scene.mount()).unwrap();
    let mut camera = scene.into_camera();
    while let Some(written) = camera.next_pair(|pair| writer.write_pair(pair)).unwrap() {
        written.unwrap();
    }
}

fn start(rig: &Path, out: &Path) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fencepost"));
    command.args(["record", "--quiet", "--config"]).arg(rig).arg("--out").arg(out);
    command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// Reads every picture of a recording as `replay` does.
fn read_all(folder: &Path) -> Result<usize, RecordingError> {
    let mut camera = Recording::open(folder)?.into_camera();
    let mut pairs = 0;
    while camera.next_pair(|_| ())?.is_some() {
        pairs += 1;
    }
    Ok(pairs)
}

fn wait_for(path: &Path) {
    for _ in 0..3000 {
        if path.exists() {
            return;
        }
        thread::sleep(Duration::from_millis(10));
    }
    panic!("{} does not come", path.display());
}

#[test]
fn killed_at_any_moment_it_leaves_a_recording_that_replay_accepts() {
    let seed = 0x4B11;
    println!("seed {seed:#x}");
    let mut random = Random(seed);
    let folder = TempDir::new().unwrap();
    let mut with_frames = 0;
    for (rig, layout) in rigs(folder.path()) {
        for round in 0..14 {
            let out = folder.path().join(format!("{layout:?}{round}"));
            let mut child = start(&rig, &out);
            // The last file that is made before the pictures: rounds that die sooner than that show nothing.
            wait_for(&out.join("record.json"));
            thread::sleep(Duration::from_micros(random.below(150_000)));
            child.kill().unwrap();
            child.wait().unwrap();
            let pairs = match read_all(&out) {
                Ok(pairs) => pairs,
                Err(RecordingError::NoFrames(_)) => 0,
                Err(error) => panic!("{layout:?}, round {round}: {error}"),
            };
            with_frames += usize::from(pairs > 0);
            if pairs > 0 && round % 4 == 0 {
                let replayed = folder.path().join("replayed");
                let last = format!("{}..", pairs.saturating_sub(3));
                let run = fencepost()
                    .args(["replay", "--quiet", "--write", "cells", "--frames", &last])
                    .arg(&out)
                    .arg("--out")
                    .arg(&replayed)
                    .output()
                    .unwrap();
                let said = String::from_utf8_lossy(&run.stderr).into_owned();
                assert_eq!(run.status.code(), Some(0), "{layout:?}, round {round}, {pairs} pairs: {said}");
            }
        }
    }
    assert!(with_frames >= 20, "{with_frames} of 28 recordings hold pictures");
}

#[test]
fn a_file_that_may_not_grow_ends_the_recording_with_a_message_and_one_that_replays() {
    let folder = TempDir::new().unwrap();
    for (rig, layout) in rigs(folder.path()) {
        let out = folder.path().join(format!("{layout:?}"));
        // The list of pictures is the file that grows: 16 blocks of 512 or 1024 bytes. No picture is so large.
        let program = env!("CARGO_BIN_EXE_fencepost");
        let limited = format!(
            "ulimit -f 16; exec '{program}' record --config '{}' --out '{}' --seconds 60",
            rig.display(),
            out.display()
        );
        let run = Command::new("sh").args(["-c", &limited]).output().unwrap();
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        assert_eq!(run.status.code(), Some(1), "{said}");
        assert!(said.contains("the recording ends here") && said.contains("make room on the disk"), "{said}");
        let pairs = read_all(&out).unwrap();
        assert!(pairs > 50, "{layout:?}: {pairs} pairs");
        let report: serde_json::Value = serde_json::from_slice(&fs::read(out.join("record.json")).unwrap()).unwrap();
        assert!(report["end"]["disk"].is_string() && report["written"] == pairs, "{pairs} pairs, {report}");
        let replayed = folder.path().join("replayed");
        let last = format!("{}..", pairs - 2);
        let arguments = ["replay", "--write", "cells", "--frames", &last];
        fencepost().args(arguments).arg(&out).arg("--out").arg(replayed).assert().success();
    }
}

#[test]
fn as_many_pairs_as_asked_for_are_recorded_as_they_are() {
    let folder = TempDir::new().unwrap();
    let [_, (rig, _)] = rigs(folder.path());
    let out = folder.path().join("out");
    let arguments = ["record", "--frames", "7", "--pair", "nose", "--config"];
    fencepost().args(arguments).arg(&rig).arg("--out").arg(&out).assert().success();
    let grey = |folder: &Path| {
        let mut camera = Recording::open(folder).unwrap().into_camera();
        let pixels = |picture: fencepost_core::picture::Picture<'_>| {
            (0..picture.height()).flat_map(|y| picture.row(y).to_vec()).collect::<Vec<u8>>()
        };
        std::iter::from_fn(|| camera.next_pair(|pair| (pixels(pair.left), pixels(pair.right))).unwrap())
            .collect::<Vec<_>>()
    };
    let (source, recorded) = (grey(&folder.path().join("raw")), grey(&out));
    assert_eq!(recorded.len(), 7);
    for (index, pair) in recorded.iter().enumerate() {
        assert!(*pair == source[index % source.len()], "pair {index}: every pixel as it came");
    }
    let calibrations = [folder.path().join("raw"), out.clone()].map(|f| Recording::open(f).unwrap().calibration.stereo);
    assert_eq!(calibrations[0], calibrations[1], "to the last bit");
    // Nothing is written over.
    let again = fencepost().args(["record", "--config"]).arg(&rig).arg("--out").arg(&out).output().unwrap();
    assert_eq!(again.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&again.stderr).contains("holds a recording already"));
}

#[test]
fn a_signal_ends_the_recording_in_good_order() {
    let folder = TempDir::new().unwrap();
    let [(rig, _), _] = rigs(folder.path());
    let out = folder.path().join("out");
    let mut child = start(&rig, &out);
    wait_for(&out.join("image_0/000003.png"));
    let killed = Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    assert!(killed.success());
    assert_eq!(child.wait().unwrap().code(), Some(0));
    let report: serde_json::Value = serde_json::from_slice(&fs::read(out.join("record.json")).unwrap()).unwrap();
    assert_eq!(report["end"], "asked");
    assert_eq!(report["written"], read_all(&out).unwrap());
}

#[test]
fn what_cannot_be_recorded_is_said_with_the_mend() {
    let folder = TempDir::new().unwrap();
    let [(rig, _), _] = rigs(folder.path());
    let record = |arguments: &[&str], rig: &Path| {
        let out = folder.path().join("none");
        let run = fencepost().args(arguments).arg("--config").arg(rig).arg("--out").arg(out).output().unwrap();
        (run.status.code(), String::from_utf8_lossy(&run.stderr).into_owned())
    };
    let (status, said) = record(&["record", "--pair", "rear"], &rig);
    assert!(status == Some(2) && said.contains("no pair `rear`") && said.contains("front"), "{said}");
    let (status, said) = record(&["record"], &folder.path().join("missing.toml"));
    assert!(status == Some(2) && said.contains("cannot be read"), "{said}");
    let two = folder.path().join("two.toml");
    let text = fs::read_to_string(&rig).unwrap();
    let mount = |yaw_deg: u32| format!("\n[pair.mount]\nheight_m = 1.0\nyaw_left_deg = {yaw_deg}\n");
    let rear = text.replace("[[pair]]", "[[pair]]\nname = \"rear\"");
    fs::write(&two, format!("{text}{}{rear}{}", mount(0), mount(180))).unwrap();
    let (status, said) = record(&["record"], &two);
    assert!(status == Some(2) && said.contains("--pair NAME, of front, rear"), "{said}");
    let (status, said) = record(&["record", "--queue", "0"], &rig);
    assert!(status == Some(2) && said.contains("1 to 10000"), "{said}");
    let (status, said) = record(&["record", "--frames", "1", "--seconds", "1"], &rig);
    assert!(status == Some(2), "{said}");
}
