//! Small rendered recordings, and the program run on them.
#![allow(dead_code, reason = "each test file uses its own part")]

use std::{
    fs,
    path::{Path, PathBuf},
    sync::OnceLock,
};

use assert_cmd::Command;
use fencepost_hal::{
    camera::Camera,
    recording::RecordingWriter,
    scene::{Scene, SceneOptions},
};
use tempfile::TempDir;

/// Number of frames of the rendered recording.
pub(crate) const FRAMES: u32 = 4;

/// The program.
pub(crate) fn fencepost() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fencepost"));
    command.env_remove("NO_COLOR").timeout(std::time::Duration::from_secs(300));
    command
}

/// The scene of the rendered recording.
pub(crate) fn scene_options() -> SceneOptions {
    SceneOptions { width: 160, height: 120, focal_px: 130.0, frames: FRAMES, ..SceneOptions::default() }
}

/// Adds the true disparity to a copy of the rendered recording.
pub(crate) fn add_true_disparity(recording: &Path) {
    let scene = Scene::new(scene_options()).unwrap();
    fs::create_dir(recording.join("disp_occ_0")).unwrap();
    for frame in 0..FRAMES {
        let png = fencepost::paint::grey16_png(160, 120, &scene.truth(frame).disparity);
        fs::write(recording.join(format!("disp_occ_0/{frame:06}.png")), png).unwrap();
    }
}

/// A fresh copy of a rendered recording in KITTI's layout, 160 x 120 px, to be damaged.
pub(crate) fn recording() -> TempDir {
    static RENDERED: OnceLock<TempDir> = OnceLock::new();
    let rendered = RENDERED.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let scene = Scene::new(scene_options()).unwrap();
        let path = folder.path().join("recording");
        let mut writer = RecordingWriter::create(&path, &scene.calibration(), &scene.mount()).unwrap();
        let mut camera = scene.into_camera();
        while let Some(result) = camera.next_pair(|pair| writer.write_pair(pair)).unwrap() {
            result.unwrap();
        }
        folder
    });
    let copy = tempfile::tempdir().unwrap();
    copy_folder(&rendered.path().join("recording"), copy.path());
    copy
}

fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy_folder(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// What the program said and wrote.
pub(crate) struct Run {
    pub(crate) status: i32,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
    pub(crate) out: PathBuf,
    _folder: TempDir,
}

/// Replays a recording with more arguments.
pub(crate) fn replay(recording: &Path, arguments: &[&str]) -> Run {
    run("replay", recording, arguments)
}

/// Compares detectors on a recording with more arguments.
pub(crate) fn compare(recording: &Path, arguments: &[&str]) -> Run {
    run("compare", recording, arguments)
}

fn run(command: &str, recording: &Path, arguments: &[&str]) -> Run {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let output = fencepost().arg(command).arg(recording).arg("--out").arg(&out).args(arguments).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let run = Run {
        status: output.status.code().unwrap_or(-1),
        stdout: text(&output.stdout),
        stderr: text(&output.stderr),
        out,
        _folder: folder,
    };
    assert!(!run.stderr.contains("panicked"), "the program panicked:\n{}", run.stderr);
    run
}

impl Run {
    /// The rows of a table, by the names of its columns.
    pub(crate) fn rows(&self, name: &str) -> Vec<std::collections::HashMap<String, String>> {
        let mut reader = csv::Reader::from_path(self.out.join(name)).unwrap();
        reader.deserialize().map(Result::unwrap).collect()
    }

    /// Frame numbers that have rows in a table.
    pub(crate) fn frames_in(&self, name: &str) -> Vec<u32> {
        let mut frames: Vec<u32> = self.rows(name).iter().map(|row| row["frame"].parse().unwrap()).collect();
        frames.dedup();
        frames
    }

    /// `summary.json`.
    pub(crate) fn summary(&self) -> serde_json::Value {
        self.json("summary.json")
    }

    /// A file with JSON.
    pub(crate) fn json(&self, name: &str) -> serde_json::Value {
        serde_json::from_str(&fs::read_to_string(self.out.join(name)).unwrap()).unwrap()
    }

    /// Asserts on exit status and on what stderr says; `says` are parts that must be there.
    pub(crate) fn assert(&self, status: i32, says: &[&str]) -> &Self {
        assert_eq!(self.status, status, "stdout:\n{}\nstderr:\n{}", self.stdout, self.stderr);
        for part in says {
            assert!(self.stderr.contains(part), "`{part}` is not said:\n{}", self.stderr);
        }
        self
    }

    /// Asserts that the frames given are in the tables, the pictures and the CAN log, and no others.
    pub(crate) fn assert_frames(&self, frames: &[u32]) -> &Self {
        assert_eq!(self.frames_in("ground.csv"), frames);
        for folder in ["disparity", "classes", "map"] {
            let mut names: Vec<_> = fs::read_dir(self.out.join(folder))
                .unwrap()
                .map(|e| e.unwrap().file_name().into_string().unwrap())
                .collect();
            names.sort();
            let expected: Vec<_> = frames.iter().map(|number| format!("{number:06}.png")).collect();
            assert_eq!(names, expected, "{folder}");
        }
        let decoded = fencepost().args(["can", "decode", "--json"]).arg(self.out.join("can.log")).output().unwrap();
        assert!(decoded.status.success(), "{}", String::from_utf8_lossy(&decoded.stdout));
        let scans: Vec<u32> = String::from_utf8(decoded.stdout)
            .unwrap()
            .lines()
            .map(|line| serde_json::from_str::<serde_json::Value>(line).unwrap())
            .filter(|value| value["message"] == "scan")
            .map(|value| value["scan"].as_u64().unwrap() as u32)
            .collect();
        assert_eq!(scans, (0..frames.len() as u32).collect::<Vec<_>>(), "scans are counted without gaps");
        self
    }
}
