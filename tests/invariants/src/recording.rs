//! The files of a recording: lists, times, mount, calibration and pictures, one of them of any bytes; and logs of a bus.

use std::{
    cell::RefCell,
    fs,
    path::{Path, PathBuf},
};

use fencepost_hal::{
    calibration::LidarCalibration,
    camera::Camera,
    can::{CandumpLine, parse_candump},
    recording::{Layout, Recording},
};

use crate::Source;

/// Width and height of the pictures.
const SIZE: (u32, u32) = (20, 16);

/// A file of a recording.
#[derive(Clone, Copy, PartialEq, Eq)]
enum File {
    Text(&'static str, &'static str),
    Picture(&'static str),
}

const CALIBRATION: &str = "P0: 20 0 9.5 0 0 20 7.5 0 0 0 1 0\nP1: 20 0 9.5 -3 0 20 7.5 0 0 0 1 0\n\
                           Tr: 0 -1 0 0 0 0 -1 0 1 0 0 0\n";
const MOUNT: &str = "{\"height_m\": 1.0, \"pitch_down_deg\": 10.0, \"roll_deg\": 0.0}\n";
const LIST: &str = "#timestamp [ns],filename\n100,100.png\n200,200.png\n";

const KITTI: [File; 8] = [
    File::Text("times.txt", "0.0\n0.1\n"),
    File::Text("calib.txt", CALIBRATION),
    File::Text("mount.json", MOUNT),
    File::Picture("image_0/000000.png"),
    File::Picture("image_1/000000.png"),
    File::Picture("image_1/000001.png"),
    File::Picture("image_0/000001.png"),
    File::Picture("disp_occ_0/000000.png"),
];

const EUROC: [File; 8] = [
    File::Text("mav0/cam0/data.csv", LIST),
    File::Text("mav0/cam1/data.csv", LIST),
    File::Text("calib.txt", CALIBRATION),
    File::Text("mount.json", MOUNT),
    File::Picture("mav0/cam0/data/100.png"),
    File::Picture("mav0/cam1/data/100.png"),
    File::Picture("mav0/cam0/data/200.png"),
    File::Picture("mav0/cam1/data/200.png"),
];

/// Two recordings that stay, and of which a file is another one for an input.
struct Folders {
    _root: tempfile::TempDir,
    folders: [PathBuf; 2],
}

thread_local! {
    static FOLDERS: RefCell<Option<Folders>> = const { RefCell::new(None) };
}

impl Folders {
    /// In memory where the system has a place for that.
    fn new() -> Self {
        let memory = Path::new("/dev/shm");
        let parent = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
        let root = tempfile::tempdir_in(parent).expect("a folder");
        let folders = [root.path().join("kitti"), root.path().join("euroc")];
        for (folder, files) in folders.iter().zip([&KITTI, &EUROC]) {
            for file in files {
                let path = folder.join(file.name());
                fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
                fs::write(path, file.good()).expect("a file");
            }
        }
        Self { _root: root, folders }
    }
}

impl File {
    const fn name(self) -> &'static str {
        match self {
            Self::Text(name, _) | Self::Picture(name) => name,
        }
    }

    fn good(self) -> Vec<u8> {
        match self {
            Self::Text(_, text) => text.as_bytes().to_vec(),
            Self::Picture(name) if name.starts_with("disp") => png(SIZE, [16, 0, 0, 0, 0], &rows(2)),
            Self::Picture(_) => png(SIZE, [8, 0, 0, 0, 0], &rows(1)),
        }
    }
}

/// Rows of a grey picture with so many bytes to a pixel, each with the filter that it begins with.
fn rows(bytes: u32) -> Vec<u8> {
    let row = (0..1 + SIZE.0 * bytes).map(|x| if x == 0 { 0 } else { (x * 7) as u8 });
    (0..SIZE.1).flat_map(|_| row.clone()).collect()
}

/// A PNG file with whatever is in its header, right in its form: checksums fit, data are stored without compression.
fn png((width, height): (u32, u32), rest_of_header: [u8; 5], data: &[u8]) -> Vec<u8> {
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |name: &[u8; 4], data: &[u8]| {
        let named = [name.as_slice(), data].concat();
        file.extend((data.len() as u32).to_be_bytes());
        file.extend(&named);
        file.extend(crc32(&named).to_be_bytes());
    };
    chunk(b"IHDR", &[&width.to_be_bytes()[..], &height.to_be_bytes(), &rest_of_header].concat());
    let mut stream = vec![0x78, 0x01];
    let mut pieces = data.chunks(65_535).peekable();
    while let Some(piece) = pieces.next() {
        let length = piece.len() as u16;
        stream.push(u8::from(pieces.peek().is_none()));
        stream.extend(length.to_le_bytes());
        stream.extend((!length).to_le_bytes());
        stream.extend(piece);
    }
    let (a, b) = data.iter().fold((1u32, 0u32), |(a, b), byte| {
        let a = (a + u32::from(*byte)) % 65_521;
        (a, (b + a) % 65_521)
    });
    stream.extend((b << 16 | a).to_be_bytes());
    chunk(b"IDAT", &stream);
    chunk(b"IEND", &[]);
    file
}

/// CRC-32 as PNG has it.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| if crc & 1 == 0 { crc >> 1 } else { crc >> 1 ^ 0xEDB8_8320 })
    })
}

/// Runs one input.
pub fn run(bytes: &[u8]) {
    let mut source = Source::new(bytes);
    let which = source.byte();
    if which % 17 == 16 {
        return candump(source.rest());
    }
    let (folder, file) = (usize::from(which) / 8 % 2, usize::from(which) % 8);
    let file = [KITTI, EUROC][folder][file];
    FOLDERS.with_borrow_mut(|folders| {
        let folders = folders.get_or_insert_with(Folders::new);
        let folder = &folders.folders[folder];
        let path = folder.join(file.name());
        fs::write(&path, content(&mut source, file)).expect("a file");
        check(folder, which & 0x60 == 0);
        fs::write(&path, file.good()).expect("a file");
    });
}

/// Any bytes; for pictures also a file that is right in its form.
fn content(source: &mut Source<'_>, file: File) -> Vec<u8> {
    if matches!(file, File::Text(..)) || source.below(4) == 0 {
        return source.rest().to_vec();
    }
    let side = |source: &mut Source<'_>, usual: u32| match source.byte() {
        0..=127 => usual,
        128..=239 => u32::from(source.byte()),
        _ => source.double_word(),
    };
    let size = (side(source, SIZE.0), side(source, SIZE.1));
    let header = [source.one_of(&[8, 16, 1, 2, 4, 3]), source.one_of(&[0, 2, 3, 4, 6, 1]), 0, 0, source.below(3) as u8];
    let mut data = source.rest().to_vec();
    // Enough for a picture of the usual size, so that few bytes make a whole one.
    data.resize(data.len().max(2000), 0);
    png(size, header, &data)
}

/// A recording is refused with words, or each of its pairs is one of two pictures of the size that was told, or refused; the same if
/// it is opened `twice`.
fn check(folder: &Path, twice: bool) {
    match LidarCalibration::read(folder) {
        Ok(Some(lidar)) => assert!(lidar.focal_px > 0.0 && lidar.to_camera.iter().flatten().all(|n| n.is_finite())),
        Ok(None) => {}
        Err(error) => assert!(!error.to_string().is_empty()),
    }
    let recording = match Recording::open(folder) {
        Ok(recording) => recording,
        Err(error) => return assert!(!error.to_string().is_empty()),
    };
    if twice {
        assert_eq!(Recording::open(folder).ok().as_ref(), Some(&recording), "the same files again");
    }
    assert_eq!(recording.mount.check(), Ok(()));
    assert!(!recording.frames.is_empty() && recording.frames.len() < 10_000);
    for frame in &recording.frames {
        for path in [&frame.left, &frame.right] {
            assert!(path.starts_with(folder), "a picture outside of the recording: {path:?}");
        }
    }
    if recording.layout == Layout::Kitti {
        assert!(recording.frames.windows(2).all(|two| two[0].number < two[1].number));
    }
    for warning in &recording.warnings {
        assert!(!warning.to_string().is_empty());
    }
    for frame in recording.frames.iter().take(2) {
        match recording.truth.disparity_of(frame.number) {
            Ok(Some(truth)) => assert_eq!(truth.pixels.len(), truth.width * truth.height),
            Ok(None) => {}
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
    let (width, height) = recording.picture_size();
    let mut camera = recording.into_camera();
    for _ in 0..4 {
        let size = camera.next_pair(|pair| [pair.left, pair.right].map(|picture| (picture.width(), picture.height())));
        match size {
            Ok(None) => break,
            Ok(Some(sizes)) => assert_eq!(sizes, [(width as usize, height as usize); 2]),
            Err(error) => assert!(!error.to_string().is_empty()),
        }
    }
    let _ = camera.take_warnings();
}

/// Every line is a frame or a mistake in that line; a frame written down reads as itself.
fn candump(log: &[u8]) {
    let lines = log.split(|byte| *byte == b'\n').count();
    let (mut before, mut count) = (0, 0);
    for line in parse_candump(log) {
        count += 1;
        match line {
            Ok(line) => {
                let written = line.to_string();
                let again: CandumpLine = written.parse().unwrap_or_else(|problem| panic!("{written}: {problem:?}"));
                assert_eq!(again.to_string(), written, "{line:?}");
                assert_eq!(again.frame, line.frame);
            }
            Err(error) => {
                assert!(error.line > before && error.line <= lines, "line {} of {lines}", error.line);
                before = error.line;
            }
        }
    }
    assert!(count <= lines);
}

pub(crate) fn seeds() -> Vec<Vec<u8>> {
    let mut seeds = Vec::new();
    for (folder, files) in [KITTI, EUROC].into_iter().enumerate() {
        for (place, file) in files.into_iter().enumerate() {
            let first = (8 * folder + place) as u8;
            let unwrapped: &[u8] = if matches!(file, File::Text(..)) { &[] } else { &[0] };
            seeds.push([&[first], unwrapped, &file.good()].concat());
            if file == File::Picture(file.name()) {
                seeds.push(vec![first, 1, 0, 0, 0, 0, 0, 1, 2, 3]);
                seeds.push(vec![first, 1, 0, 0, 1, 1, 0, 0, 2, 3]);
            }
        }
    }
    let log =
        "(1436509053.249713) can0 4AA#0102\n(0000000001.000001) can1 403##1000102030405060708090A0B T\n# a note\n";
    seeds.push([&[16], log.as_bytes()].concat());
    seeds
}
