//! The layout of KITTI odometry: `image_0/NNNNNN.png`, `image_1/NNNNNN.png`, `times.txt`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::error::{RecordingError, RecordingWarning};
use super::{RecordedFrame, list_folder};

/// Time from frame to frame where it is not known, nanoseconds.
const ASSUMED_PERIOD_NS: u64 = 100_000_000;

/// Every frame that has a picture on one side at least: a missing partner is an error of that frame, said when it is read.
pub(super) fn frames(
    folder: &Path,
    warnings: &mut Vec<RecordingWarning>,
) -> Result<Vec<RecordedFrame>, RecordingError> {
    let mut pictures: BTreeMap<u32, [Option<PathBuf>; 2]> = BTreeMap::new();
    for (side, name) in ["image_0", "image_1"].iter().enumerate() {
        let folder = folder.join(name);
        let mut strangers: Vec<PathBuf> = Vec::new();
        let mut found = 0_usize;
        for path in list_folder(&folder)? {
            // What was being written when the writer was stopped.
            if path.extension().is_some_and(|extension| extension == "part") {
                continue;
            }
            match number(&path) {
                Some(number) => {
                    found += 1;
                    pictures.entry(number).or_default()[side] = Some(path);
                }
                None => strangers.push(path),
            }
        }
        if let Some(path) = strangers.first() {
            warnings.push(RecordingWarning::NotNumbered { path: path.clone(), count: strangers.len() });
        }
        if found == 0 {
            return Err(RecordingError::NoFrames(folder));
        }
    }
    // The writer makes the right picture first.
    if pictures.len() > 1
        && let Some(last) = pictures.last_entry()
        && let [None, Some(path)] = last.get()
    {
        warnings.push(RecordingWarning::Unfinished { frame: *last.key(), path: path.clone() });
        last.remove();
    }
    let numbers: Vec<u32> = pictures.keys().copied().collect();
    let times = times(&folder.join("times.txt"), &numbers, warnings)?;
    let frames = pictures.into_iter().zip(times).map(|((number, [left, right]), timestamp_ns)| {
        let file_name =
            left.as_ref().or(right.as_ref()).and_then(|path| path.file_name()).unwrap_or_default().to_owned();
        let name = Path::new(&file_name).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let left = left.unwrap_or_else(|| folder.join("image_0").join(&file_name));
        let right = right.unwrap_or_else(|| folder.join("image_1").join(&file_name));
        RecordedFrame { number, timestamp_ns, name, left, right }
    });
    Ok(frames.collect())
}

/// Seconds, as `times.txt` has them, in nanoseconds. Plain decimals are read exactly.
pub(super) fn seconds(word: &str) -> Option<u64> {
    let digits = |part: &str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
    if let Some((whole, fraction)) = word.split_once('.')
        && digits(whole)
        && digits(fraction)
    {
        let nanos: u64 = format!("{fraction:0<9}").get(..9)?.parse().ok()?;
        return whole.parse::<u64>().ok()?.checked_mul(1_000_000_000)?.checked_add(nanos);
    }
    let seconds: f64 = word.parse().ok()?;
    // Above 500 years the nanoseconds do not fit.
    (0.0..1.6e10).contains(&seconds).then(|| (seconds * 1.0e9).round() as u64)
}

fn number(path: &Path) -> Option<u32> {
    let stem = path.file_stem()?.to_str()?;
    let extension = path.extension()?.to_str()?.to_ascii_lowercase();
    let digits = !stem.is_empty() && stem.bytes().all(|byte| byte.is_ascii_digit());
    (digits && matches!(extension.as_str(), "png" | "pgm" | "ppm")).then(|| stem.parse().ok())?
}

fn times(file: &Path, numbers: &[u32], warnings: &mut Vec<RecordingWarning>) -> Result<Vec<u64>, RecordingError> {
    let made_up = || numbers.iter().map(|number| u64::from(*number) * ASSUMED_PERIOD_NS).collect();
    let text = match std::fs::read_to_string(file) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            warnings.push(RecordingWarning::TimesMissing(file.to_owned()));
            return Ok(made_up());
        }
        Err(error) => return Err(RecordingError::io(file, &error)),
    };
    let mut listed = Vec::new();
    let lines = text.lines().count();
    for (index, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let time = seconds(line.trim());
        if time.is_none() && index + 1 == lines && !text.ends_with('\n') && !listed.is_empty() {
            warnings.push(RecordingWarning::TornLine { file: file.to_owned(), line: lines });
            break;
        }
        listed.push(time.ok_or_else(|| RecordingError::Line {
            file: file.to_owned(),
            line: index + 1,
            problem: format!(
                "`{}` is not a time; write seconds from 0 up",
                line.trim().chars().take(40).collect::<String>()
            ),
        })?);
    }
    // Line i is the time of frame i; a part cut out of a sequence may have kept a line for each of its own frames only.
    let by_number: Option<Vec<u64>> = numbers.iter().map(|number| listed.get(*number as usize).copied()).collect();
    let times = match by_number {
        Some(times) => times,
        None if listed.len() == numbers.len() => listed,
        None => {
            let (times, frames) = (listed.len(), numbers.len());
            warnings.push(RecordingWarning::TimesTooFew { file: file.to_owned(), times, frames });
            return Ok(made_up());
        }
    };
    Ok(times)
}
