//! The layout of EuRoC ASL: `mav0/cam0` and `mav0/cam1`, each with `data.csv` and `data/`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::error::{RecordingError, RecordingWarning};
use super::{RecordedFrame, list_folder};

/// Pictures further apart in time are not a pair, nanoseconds: a robot at 2 m/s moves 1 cm in it.
const PAIRING_TOLERANCE_NS: u64 = 5_000_000;

/// The pairs, in the order of the left camera's list.
pub(super) fn frames(
    folder: &Path,
    warnings: &mut Vec<RecordingWarning>,
) -> Result<Vec<RecordedFrame>, RecordingError> {
    let [left_folder, right_folder] = ["mav0/cam0", "mav0/cam1"].map(|name| folder.join(name));
    let left = pictures(&left_folder, warnings)?;
    let right = pictures(&right_folder, warnings)?;
    let mut free: BTreeMap<u64, PathBuf> = right.into_iter().collect();
    // Equal times first, so that a picture near by never takes the partner of one that fits exactly.
    let mut partners: Vec<Option<(u64, PathBuf)>> =
        left.iter().map(|(time, _)| free.remove(time).map(|path| (*time, path))).collect();
    for ((time, _), partner) in left.iter().zip(&mut partners).filter(|(_, partner)| partner.is_none()) {
        let window = time.saturating_sub(PAIRING_TOLERANCE_NS)..=time.saturating_add(PAIRING_TOLERANCE_NS);
        let nearest = free.range(window).map(|(near, _)| *near).min_by_key(|near| near.abs_diff(*time));
        *partner = nearest.and_then(|near| free.remove_entry(&near));
    }
    let mut frames = Vec::new();
    let mut unpaired = Vec::new();
    let (mut count, mut largest_ns) = (0, 0);
    for ((timestamp_ns, left), partner) in left.into_iter().zip(partners) {
        let Some((right_ns, right)) = partner else {
            unpaired.push(timestamp_ns);
            continue;
        };
        if right_ns != timestamp_ns {
            count += 1;
            largest_ns = largest_ns.max(right_ns.abs_diff(timestamp_ns));
        }
        let name = left.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let number = u32::try_from(frames.len()).unwrap_or(u32::MAX);
        frames.push(RecordedFrame { number, timestamp_ns, name, left, right });
    }
    if frames.is_empty() {
        return Err(RecordingError::NoFrames(folder.to_owned()));
    }
    if count > 0 {
        warnings.push(RecordingWarning::PairedByNearest { folder: folder.to_owned(), count, largest_ns });
    }
    for (folder, times) in [(left_folder, unpaired), (right_folder, free.into_keys().collect())] {
        if let Some(first_ns) = times.first() {
            warnings.push(RecordingWarning::Unpaired { folder, count: times.len(), first_ns: *first_ns });
        }
    }
    Ok(frames)
}

/// Time and path of each picture of one camera.
fn pictures(camera: &Path, warnings: &mut Vec<RecordingWarning>) -> Result<Vec<(u64, PathBuf)>, RecordingError> {
    let list = camera.join("data.csv");
    let data = camera.join("data");
    match std::fs::read_to_string(&list) {
        Ok(text) => parse(&list, &text, &data, warnings),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            warnings.push(RecordingWarning::ListMissing(list));
            let time = |path: &PathBuf| path.file_stem()?.to_str()?.parse().ok();
            Ok(list_folder(&data)?.into_iter().filter_map(|path| Some((time(&path)?, path))).collect())
        }
        Err(error) => Err(RecordingError::io(&list, &error)),
    }
}

fn parse(
    list: &Path,
    text: &str,
    data: &Path,
    warnings: &mut Vec<RecordingWarning>,
) -> Result<Vec<(u64, PathBuf)>, RecordingError> {
    let mut pictures = Vec::new();
    let lines = text.lines().count();
    for (index, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        // A name may be torn off and still be one: then its picture is not there.
        let unended = index + 1 == lines && !text.ends_with('\n') && !pictures.is_empty();
        match row(list, index, line, data) {
            Ok((_, path)) if unended && !path.exists() => {}
            Ok(row) => {
                pictures.push(row);
                continue;
            }
            Err(_) if unended => {}
            Err(error) => return Err(error),
        }
        warnings.push(RecordingWarning::TornLine { file: list.to_owned(), line: lines });
    }
    Ok(pictures)
}

fn row(list: &Path, index: usize, line: &str, data: &Path) -> Result<(u64, PathBuf), RecordingError> {
    let error = |problem: &str| RecordingError::Line {
        file: list.to_owned(),
        line: index + 1,
        problem: format!("{problem}; write `timestamp in ns,name of the picture`"),
    };
    let (time, name) = line.split_once(',').ok_or_else(|| error("there is no comma"))?;
    let time = time.trim().parse().map_err(|_| error("the timestamp is not a whole number"))?;
    let name = Path::new(name.trim());
    // Only plain names: a list must not lead out of its folder.
    if name.file_name().is_none_or(|plain| plain != name) {
        return Err(error("the name is not that of a picture in data/"));
    }
    Ok((time, data.join(name)))
}
