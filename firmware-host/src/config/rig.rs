//! The part of a configuration file that is a rig: `[bus]`, `[run]` and a `[[pair]]` for each pair of cameras.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use fencepost_core::{
    error::{ConfigError, ConfigProblem},
    geometry::{Mount, StereoCalibration},
    settings::Settings,
};
use fencepost_hal::{
    calibration::{Calibration, CalibrationError},
    camera::CameraSettings,
    recording::Recording,
    scene::{Scene, SceneOptions},
};
use serde::{Deserialize, Serialize};

use super::mistake::{Reader, Refused, Section};
use crate::{
    detector,
    live::{BusSettings, MAX_PAIRS, RunSettings},
};

/// A rig, with everything that its files say.
#[derive(Clone, Debug, Default)]
pub struct Rig {
    /// Where the frames go.
    pub bus: BusSettings,
    /// The loop.
    pub run: RunSettings,
    /// The pairs of cameras.
    pub pairs: Vec<RigPair>,
}

/// A pair of cameras of a rig.
#[derive(Clone, Debug)]
pub struct RigPair {
    /// What it is called.
    pub name: String,
    /// Where its pictures come from.
    pub source: RigSource,
    /// Calibration of the cameras.
    pub calibration: StereoCalibration,
    /// The files that it was read from.
    pub calibration_files: Vec<PathBuf>,
    /// Where the left camera sits.
    pub mount: Mount,
    /// Processor of its thread.
    pub cpu: Option<u16>,
    /// What is odd about its files.
    pub warnings: Vec<String>,
}

/// Where the pictures of a pair come from.
#[derive(Clone, Debug, PartialEq)]
pub enum RigSource {
    /// Two cameras, or one that delivers both pictures.
    Camera(CameraSettings),
    /// A recording, played as if it were live.
    Recording(RecordingSettings),
    /// The scene renderer.
    Scene(SceneSettings),
}

/// `[pair.recording]`
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordingSettings {
    /// Folder of the recording.
    pub path: PathBuf,
    /// Whether it begins anew at its end.
    #[serde(default)]
    pub repeat: bool,
    /// Pairs per second; the times of the recording if not set.
    #[serde(default)]
    pub rate_hz: Option<f32>,
}

/// `[pair.scene]`
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SceneSettings {
    /// Chooses the scene.
    pub seed: u32,
    /// Width of the pictures, px.
    pub width: u32,
    /// Height of the pictures, px.
    pub height: u32,
    /// Pairs that are rendered at the start.
    pub frames: u32,
    /// Whether they begin anew at their end.
    pub repeat: bool,
    /// Pairs per second.
    pub rate_hz: f32,
}

impl Default for SceneSettings {
    fn default() -> Self {
        Self { seed: 1, width: 512, height: 384, frames: 16, repeat: true, rate_hz: 10.0 }
    }
}

impl SceneSettings {
    /// As the renderer takes them. The view stays the same whatever the width.
    pub fn options(&self) -> SceneOptions {
        let usual = SceneOptions::default();
        let focal_px = usual.focal_px * self.width as f32 / usual.width as f32;
        let Self { seed, width, height, frames, rate_hz, .. } = *self;
        SceneOptions { seed, width, height, focal_px, frames, rate_hz, ..usual }
    }
}

/// The settings of `[[pair]]` that are no sections.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct PairSettings {
    name: Option<String>,
    calibration: Vec<PathBuf>,
    cpu: Option<u16>,
}

const MOUNT_UNKNOWN: &str = "the mount is not known: height is taken as 1 m, tilt as level; add [pair.mount]";
const PAIR_SECTIONS: [&str; 4] = ["mount", "camera", "recording", "scene"];

/// Reads the rig of a file in `folder`, the files that it names among it. Notes every mistake.
pub(super) fn read<'a>(
    reader: &mut Reader<'a>,
    root: &Section<'a>,
    folder: &Path,
    (mount, settings_for): (Option<Mount>, impl Fn(u32) -> Settings),
) -> Rig {
    let bus = reader.section(root, "bus").and_then(|section| {
        reader.settings(&section, &[], |bus: &BusSettings| {
            bus.check().err().map(|(field, problem)| refused(field, problem)).into_iter().collect()
        })
    });
    let run = reader.section(root, "run").and_then(|section| {
        reader.settings(&section, &[], |run: &RunSettings| run.check().err().map(Refused::of).into_iter().collect())
    });
    let sections = reader.sections(root, "pair");
    if sections.len() > 1 && root.has("mount") {
        reader.note_at(root, "mount", "does not say of which pair it is", "write [pair.mount] below each [[pair]]");
    }
    if sections.len() > MAX_PAIRS {
        let line = reader.line(&sections[MAX_PAIRS].span);
        reader.note(
            Some(line),
            "pair",
            format!("has {} of the {MAX_PAIRS} pairs that a rig may have", sections.len()),
            "run a second program with another node id for the others",
        );
    }
    let mut pairs: Vec<RigPair> = Vec::new();
    for (index, section) in sections.iter().enumerate() {
        if sections.len() > 1 && !section.has("mount") {
            let mend = "add [pair.mount] with `forward_m`, `left_m` and `yaw_left_deg`: otherwise all pairs are taken to look ahead";
            reader.note_at(section, "mount", "is missing, and there is more than one pair", mend);
        }
        if let Some(mut pair) = read_pair(reader, section, folder, index, &settings_for) {
            if let Some(mount) = mount.filter(|_| !section.has("mount") && sections.len() == 1) {
                pair.mount = mount;
                pair.warnings.retain(|warning| warning != MOUNT_UNKNOWN);
            }
            if pairs.iter().any(|other| other.mount == pair.mount) {
                let mend = "say where each stands and looks: `forward_m`, `left_m`, `yaw_left_deg`";
                reader.note_at(section, "mount", "is that of another pair too", mend);
            }
            if pairs.iter().any(|other| other.name == pair.name) {
                reader.note_at(
                    section,
                    "name",
                    format!("`{}` is the name of another pair too", pair.name),
                    "change one",
                );
            }
            pairs.push(pair);
        }
    }
    Rig { bus: bus.unwrap_or_default(), run: run.unwrap_or_default(), pairs }
}

fn read_pair<'a>(
    reader: &mut Reader<'a>,
    section: &Section<'a>,
    folder: &Path,
    index: usize,
    settings_for: &impl Fn(u32) -> Settings,
) -> Option<RigPair> {
    let table = section.table.clone().into_iter();
    let table = table.filter(|(key, _)| !PAIR_SECTIONS.contains(&key.get_ref().as_ref())).collect();
    let plain = Section { table, ..section.clone() };
    let settings = reader.settings(&plain, &[], |pair: &PairSettings| {
        let empty = pair.name.as_ref().is_some_and(String::is_empty);
        let many = pair.calibration.len() > 2;
        let cpu = pair.cpu.and_then(|cpu| crate::live::check_cpu("pair.cpu", cpu).err()).map(Refused::of);
        let empty = empty.then(|| refused("pair.name", "is empty".to_string()));
        let many = many.then(|| refused("pair.calibration", "names more than two files".to_string()));
        empty.into_iter().chain(many).chain(cpu).collect()
    });
    let mount_section = reader.section(section, "mount");
    let mount = mount_section.as_ref().map(|section| {
        reader.settings(section, &[], |mount: &Mount| mount.check().err().map(Refused::of).into_iter().collect())
    });
    let source = read_source(reader, section, folder);
    let settings = settings?;
    let name = settings.name.unwrap_or_else(|| if index == 0 { "front".to_string() } else { format!("pair{index}") });
    let mut pair = load(reader, section, folder, source?, &settings.calibration)?;
    pair.name = name;
    pair.cpu = settings.cpu;
    match mount {
        Some(mount) => pair.mount = mount?,
        None if pair.mount == Mount::default() => {
            pair.warnings
                .push("the mount is not known: height is taken as 1 m, tilt as level; add [pair.mount]".into());
        }
        None => {}
    }
    if let Some(error) = unusable(&pair, settings_for) {
        note_unusable(reader, section, &error);
        return None;
    }
    Some(pair)
}

fn read_source<'a>(reader: &mut Reader<'a>, section: &Section<'a>, folder: &Path) -> Option<RigSource> {
    let given: Vec<&str> = ["camera", "recording", "scene"].into_iter().filter(|name| section.has(name)).collect();
    let [kind] = given.as_slice() else {
        let problem = match given.len() {
            0 => "has no source of pictures".to_string(),
            _ => format!("has more than one source of pictures: {}", given.join(" and ")),
        };
        reader.note_at(section, "", problem, "write one of [pair.camera], [pair.recording] and [pair.scene]");
        return None;
    };
    let source = reader.section(section, kind)?;
    match *kind {
        "camera" => {
            let camera = reader.settings(&source, &[("width", "640"), ("height", "480")], |c: &CameraSettings| {
                // A device that is wrong is not asked for again: the others are told at the same time.
                c.mistakes()
                    .into_iter()
                    .map(|error| refused(&format!("camera.{}", error.field), error.problem))
                    .collect()
            })?;
            Some(RigSource::Camera(camera))
        }
        "recording" => {
            let mut recording = reader.settings(&source, &[("path", "''")], |r: &RecordingSettings| {
                let rate = r.rate_hz.map(|rate| ConfigError::check("recording.rate_hz", rate, 0.1, 1000.0));
                rate.and_then(Result::err).map(Refused::of).into_iter().collect()
            })?;
            recording.path = folder.join(&recording.path);
            Some(RigSource::Recording(recording))
        }
        _ => {
            let scene = reader.settings(&source, &[], |scene: &SceneSettings| {
                let frames = ConfigError::check("scene.frames", scene.frames as f32, 1.0, 1000.0);
                let options = scene.options().check();
                frames.err().into_iter().chain(options.err()).map(Refused::of).collect()
            })?;
            Some(RigSource::Scene(scene))
        }
    }
}

/// Reads the files of a pair.
fn load(
    reader: &mut Reader<'_>,
    section: &Section<'_>,
    folder: &Path,
    source: RigSource,
    calibration: &[PathBuf],
) -> Option<RigPair> {
    let files: Vec<PathBuf> = calibration.iter().map(|file| folder.join(file)).collect();
    let mut pair = match &source {
        RigSource::Camera(camera) => {
            if files.is_empty() {
                let mend =
                    "name the file of both cameras, or one for each: calibration = [\"left.yaml\", \"right.yaml\"]";
                reader.note_at(section, "calibration", "is missing", mend);
                return None;
            }
            let size = (camera.width, camera.height);
            of_files(&files, Some(size), source).map_err(|error| note_calibration(reader, section, &error)).ok()?
        }
        RigSource::Recording(recording) => match Recording::open(&recording.path) {
            Ok(opened) => RigPair {
                name: String::new(),
                calibration: opened.calibration.stereo,
                calibration_files: opened.calibration.files,
                mount: opened.mount,
                cpu: None,
                warnings: opened.warnings.iter().map(ToString::to_string).collect(),
                source,
            },
            Err(error) => {
                let problem = format!("cannot be opened: {error}");
                reader.note_at(section, "recording", problem, "name the folder of a recording");
                return None;
            }
        },
        RigSource::Scene(scene) => {
            let options = scene.options();
            let (calibration, mount) = (options.calibration(), options.mount());
            let calibration_files = Vec::new();
            RigPair {
                name: String::new(),
                calibration,
                calibration_files,
                mount,
                cpu: None,
                warnings: Vec::new(),
                source,
            }
        }
    };
    if !matches!(pair.source, RigSource::Camera(_)) && !files.is_empty() {
        let source = pair.source.clone();
        let own = of_files(&files, None, source).map_err(|error| note_calibration(reader, section, &error)).ok()?;
        pair = RigPair { mount: pair.mount, ..own };
    }
    Some(pair)
}

fn of_files(files: &[PathBuf], size: Option<(u32, u32)>, source: RigSource) -> Result<RigPair, CalibrationError> {
    let calibration = Calibration::load(files, size)?;
    Ok(RigPair {
        name: String::new(),
        source,
        calibration: calibration.stereo,
        calibration_files: calibration.files,
        mount: Mount::default(),
        cpu: None,
        warnings: calibration.warnings.iter().map(ToString::to_string).collect(),
    })
}

fn note_calibration(reader: &mut Reader<'_>, section: &Section<'_>, error: &CalibrationError) {
    let sentence = error.to_string();
    let (problem, mend) = sentence.split_once("; ").unwrap_or((&sentence, "give a calibration that can be used"));
    reader.note_at(section, "calibration", format!("cannot be used: {problem}"), mend);
}

/// What the detector says to the pair.
fn unusable(pair: &RigPair, settings_for: &impl Fn(u32) -> Settings) -> Option<ConfigError> {
    let width = pair.picture_size().0;
    detector::lock().configure(&settings_for(width), &pair.calibration, &pair.mount).err()
}

fn note_unusable(reader: &mut Reader<'_>, section: &Section<'_>, error: &ConfigError) {
    let (place, field) = error.field.split_once('.').unwrap_or(("", error.field));
    let problem = format!("cannot be used: {field} {}", error.problem);
    let mend = match error.problem {
        ConfigProblem::Exchanged => "exchange the left and the right camera in the calibration".to_string(),
        ConfigProblem::OverCapacity { .. } if place == "calibration" => {
            format!("give pictures of at most {}", detector::capacity_in_words())
        }
        _ => Refused::of(*error).mend,
    };
    match place {
        "calibration" => reader.note_at(section, "calibration", problem, mend),
        "mount" => reader.note_at(section, "mount", problem, mend),
        _ => reader.note(None, error.field, error.problem.to_string(), mend),
    }
}

impl RigPair {
    /// Width and height of the raw pictures, px.
    pub const fn picture_size(&self) -> (u32, u32) {
        match &self.calibration {
            StereoCalibration::Rectified(pair) => (pair.width, pair.height),
            StereoCalibration::Raw(pair) => (pair.left.width, pair.left.height),
        }
    }
}

impl RigSource {
    /// Longest time that the camera may take for a pair.
    pub fn longest_wait(&self) -> Duration {
        match self {
            Self::Camera(camera) => Duration::from_millis(camera.timeout_ms().into()),
            Self::Recording(_) | Self::Scene(_) => {
                Duration::from_secs_f32(1.0 / self.rate_hz()).max(Duration::from_secs(1))
            }
        }
    }

    /// Pairs of pictures a second; 30 where only the camera knows.
    pub fn rate_hz(&self) -> f32 {
        const USUAL_HZ: f32 = 30.0;
        match self {
            Self::Camera(camera) => camera.rate_hz.unwrap_or(USUAL_HZ),
            Self::Recording(recording) => recording.rate_hz.unwrap_or(USUAL_HZ),
            Self::Scene(scene) => scene.rate_hz,
        }
    }

    /// What it is, in words.
    pub fn describe(&self) -> String {
        let path = |path: &Option<PathBuf>| path.as_ref().map_or_else(String::new, |path| path.display().to_string());
        match self {
            Self::Camera(camera) if camera.device.is_some() => format!("camera {}", path(&camera.device)),
            Self::Camera(camera) => format!("cameras {} and {}", path(&camera.left), path(&camera.right)),
            Self::Recording(recording) => format!("recording {}", recording.path.display()),
            Self::Scene(scene) => format!("rendered scene {}", scene.seed),
        }
    }
}

/// Renders the pictures of a scene.
///
/// # Errors
/// As [`Scene::new`].
pub fn build_scene(settings: &SceneSettings) -> Result<Scene, ConfigError> {
    Scene::new(settings.options())
}

fn refused(field: &str, problem: String) -> Refused {
    // The library's sentences hold the mend behind a semicolon.
    let field = field.split_once('.').map_or(field, |(_, field)| field).to_string();
    match problem.split_once("; ") {
        Some((problem, mend)) => Refused { field, problem: problem.to_string(), mend: mend.to_string() },
        None => Refused { field, problem, mend: "correct it".to_string() },
    }
}
