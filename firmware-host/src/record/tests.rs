use std::collections::VecDeque;

use fencepost_core::picture::Picture;
use fencepost_hal::{
    camera::{FaultyCamera, MemoryCamera, StereoPair},
    recording::Recording,
    scene::{Scene, SceneOptions},
};

use super::*;

const OPTIONS: fn() -> SceneOptions =
    || SceneOptions { width: 64, height: 48, focal_px: 50.0, frames: 4, ..SceneOptions::default() };

fn plan(folder: &Path) -> RecordPlan {
    let scene = Scene::new(OPTIONS()).unwrap();
    RecordPlan {
        folder: folder.join("recording"),
        pair: "front".to_string(),
        calibration: scene.calibration(),
        calibration_files: Vec::new(),
        mount: scene.mount(),
        queue_pairs: 8,
        frames: None,
        duration: None,
        patience: Duration::from_millis(50),
    }
}

fn scene(rounds: u32) -> MemoryCamera {
    MemoryCamera::fill(&mut Scene::new(OPTIONS()).unwrap().into_camera()).repeated(rounds)
}

/// A camera that waits a moment for each pair, so that the disk keeps up.
struct Slow<C>(C);

impl<C: Camera> Camera for Slow<C> {
    type Error = C::Error;

    fn next_pair<R>(&mut self, consume: impl FnOnce(&StereoPair<'_>) -> R) -> Result<Option<R>, Self::Error> {
        thread::sleep(Duration::from_millis(2));
        self.0.next_pair(consume)
    }
}

fn run<C: Camera>(camera: &mut C, plan: &RecordPlan) -> (RecordReport, Vec<String>) {
    let mut said = Vec::new();
    let report = record(camera, plan, &AtomicBool::new(false), |event| match event {
        RecordEvent::Trouble(error) => said.push(error.to_string()),
        RecordEvent::Mended => said.push("mended".to_string()),
        RecordEvent::Odd(odd) => said.push(odd.to_string()),
        RecordEvent::Status(_) => {}
    });
    (report.unwrap(), said)
}

fn pixels(picture: &Picture<'_>) -> Vec<u8> {
    (0..picture.height()).flat_map(|y| picture.row(y).to_vec()).collect()
}

type Seen = (u64, Vec<u8>, Vec<u8>);

fn see(pair: &StereoPair<'_>) -> Seen {
    (pair.timestamp_ns, pixels(&pair.left), pixels(&pair.right))
}

fn replayed(plan: &RecordPlan) -> VecDeque<Seen> {
    let recording = Recording::open(&plan.folder).unwrap();
    assert_eq!(recording.warnings, []);
    let mut camera = recording.into_camera();
    std::iter::from_fn(|| camera.next_pair(see).unwrap()).collect()
}

#[test]
fn what_is_recorded_is_what_the_camera_saw() {
    let folder = tempfile::tempdir().unwrap();
    let plan = RecordPlan { frames: Some(10), queue_pairs: 16, ..plan(folder.path()) };
    let (report, said) = run(&mut Slow(scene(3)), &plan);
    assert_eq!((report.recorded, report.written, report.dropped, &report.end), (10, 10, 0, &RecordEnd::Enough));
    assert_eq!((report.losses(), said), (None, vec![]));
    let mut truth = scene(3);
    let expected: VecDeque<Seen> = (0..10).map(|_| truth.next_pair(see).unwrap().unwrap()).collect();
    assert_eq!(replayed(&plan), expected);
    let saved: serde_json::Value =
        serde_json::from_slice(&std::fs::read(plan.folder.join("record.json")).unwrap()).unwrap();
    assert_eq!((&saved["written"], &saved["end"]), (&10.into(), &"enough".into()));
}

#[test]
fn a_source_that_ends_is_recorded_to_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(folder.path());
    let (report, _) = run(&mut Slow(scene(1)), &plan);
    assert_eq!((report.written, report.end), (4, RecordEnd::SourceEnded));
}

#[test]
fn a_disk_that_is_too_slow_costs_pairs_that_are_counted_and_never_holds_the_camera_up() {
    let folder = tempfile::tempdir().unwrap();
    let plan = RecordPlan { queue_pairs: 1, ..plan(folder.path()) };
    // Pairs come faster than any disk takes them.
    let (report, _) = run(&mut scene(100), &plan);
    assert_eq!(report.recorded + report.dropped, 400);
    assert_eq!(report.written, report.recorded);
    assert!(report.dropped > 0, "{report:?}");
    assert!(report.losses().is_some_and(|losses| losses.contains("disk was too slow")));
    assert_eq!(replayed(&plan).len() as u64, report.written);
}

#[test]
fn errors_of_the_camera_are_counted_said_once_and_passed_over() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(folder.path());
    let mut camera = FaultyCamera::new(Slow(scene(5)), (64, 48), 0, 1);
    camera.set_stall(2);
    camera.set_damaged(1);
    let (report, said) = run(&mut camera, &plan);
    assert_eq!((report.no_picture, report.damaged, report.written), (2, 1, 17));
    assert_eq!(said.len(), 3, "{said:?}");
    assert_eq!(said.last().map(String::as_str), Some("mended"));
}

#[test]
fn a_camera_that_is_pulled_ends_the_recording_which_replays() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(folder.path());
    let mut camera = Pulled { camera: scene(5), left: 6 };
    let (report, said) = run(&mut camera, &plan);
    assert!(matches!(&report.end, RecordEnd::Camera(error) if error.contains("gone")), "{report:?}");
    assert_eq!((report.written, said.len()), (6, 1));
    assert!(report.lost > 0);
    assert_eq!(replayed(&plan).len(), 6);
}

/// Gone for good after some pairs.
struct Pulled {
    camera: MemoryCamera,
    left: u32,
}

#[derive(Debug)]
struct Gone;

impl std::fmt::Display for Gone {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("the camera is gone")
    }
}

impl std::error::Error for Gone {}

impl CameraError for Gone {
    fn kind(&self) -> CameraErrorKind {
        CameraErrorKind::Lost
    }
}

impl Camera for Pulled {
    type Error = Gone;

    fn next_pair<R>(&mut self, consume: impl FnOnce(&StereoPair<'_>) -> R) -> Result<Option<R>, Gone> {
        thread::sleep(Duration::from_millis(2));
        if self.left == 0 {
            return Err(Gone);
        }
        self.left -= 1;
        let Ok(result) = self.camera.next_pair(consume);
        Ok(result)
    }
}

#[test]
fn times_that_do_not_rise_and_pictures_of_another_size_are_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(folder.path());
    let mut camera = Odd { number: 0, warned: false };
    let (report, said) = run(&mut camera, &plan);
    assert_eq!((report.recorded, report.times_not_rising, report.wrong_size), (2, 1, 1));
    assert_eq!(said, ["the second pair is odd"], "what a camera finds odd on the way is said");
    assert_eq!(replayed(&plan).iter().map(|(time, ..)| *time).collect::<Vec<_>>(), [100, 200]);
}

/// Four pairs: one good, one before it in time, one too small, one good.
struct Odd {
    number: usize,
    warned: bool,
}

impl Camera for Odd {
    type Error = std::convert::Infallible;

    fn next_pair<R>(&mut self, consume: impl FnOnce(&StereoPair<'_>) -> R) -> Result<Option<R>, Self::Error> {
        let odd = [(100, 64), (50, 64), (150, 32), (200, 64)];
        let Some((timestamp_ns, width)) = odd.get(self.number).copied() else { return Ok(None) };
        self.number += 1;
        let pixels = vec![9; width * 48];
        let grey = Picture::packed(&pixels, width, 48).unwrap();
        let pair = StereoPair { left: grey, right: grey, timestamp_ns, skew_ns: 0, sequence: 0, missed: 0 };
        Ok(Some(consume(&pair)))
    }

    fn take_warning(&mut self) -> Option<String> {
        let odd = self.number == 2 && !std::mem::replace(&mut self.warned, true);
        odd.then(|| "the second pair is odd".to_string())
    }
}

#[test]
fn the_report_is_saved_on_the_way_even_while_no_picture_comes() {
    let folder = tempfile::tempdir().unwrap();
    let plan = RecordPlan { patience: Duration::from_secs(60), ..plan(folder.path()) };
    let mut camera = FaultyCamera::new(Slow(scene(100_000)), (64, 48), 0, 1);
    camera.set_stall(u32::MAX);
    let (stop, path) = (AtomicBool::new(false), plan.folder.join("record.json"));
    let mut statuses = 0;
    let mut saved = serde_json::Value::Null;
    let report = record(&mut camera, &plan, &stop, |event| {
        if matches!(event, RecordEvent::Status(_)) {
            statuses += 1;
            saved = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
            // The writer looks once a second; that it takes a minute is a mistake.
            stop.store(saved["no_picture"] != 0 || statuses > 60, Ordering::Relaxed);
        }
    });
    assert_eq!(report.unwrap().end, RecordEnd::Asked);
    assert!(saved["no_picture"].as_u64().is_some_and(|count| count > 0), "{saved}");
    assert_eq!(saved["end"], "running");
}

#[test]
fn a_disk_that_takes_no_more_ends_the_recording_which_replays() {
    let folder = tempfile::tempdir().unwrap();
    let plan = plan(folder.path());
    // The place of a picture is taken.
    std::fs::create_dir_all(&plan.folder).unwrap();
    let blocked = plan.folder.join("image_0/000003.png");
    let mut camera = Blocking { camera: scene(5), at: 2, path: blocked };
    let (report, _) = run(&mut camera, &plan);
    assert!(matches!(&report.end, RecordEnd::Disk(error) if error.contains("000003.png")), "{report:?}");
    assert_eq!(report.written, 3);
    let recording = Recording::open(&plan.folder).unwrap();
    assert_eq!(recording.frames.len(), 3, "{:?}", recording.frames);
}

/// Makes a folder where the recording wants to write a picture.
struct Blocking {
    camera: MemoryCamera,
    at: u32,
    path: PathBuf,
}

impl Camera for Blocking {
    type Error = std::convert::Infallible;

    fn next_pair<R>(&mut self, consume: impl FnOnce(&StereoPair<'_>) -> R) -> Result<Option<R>, Self::Error> {
        thread::sleep(Duration::from_millis(5));
        if self.at == 0 {
            let _ = std::fs::create_dir(&self.path);
        }
        self.at = self.at.saturating_sub(1);
        self.camera.next_pair(consume)
    }
}
