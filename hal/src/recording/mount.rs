//! `mount.json`: how the left camera sits on the vehicle.

use std::path::Path;

use fencepost_core::error::{ConfigError, ConfigProblem};
use fencepost_core::geometry::Mount;
use serde_json::Value;

use super::error::{RecordingError, RecordingWarning};

/// What a `mount.json` may say.
const KEYS: [&str; 6] = ["height_m", "pitch_down_deg", "roll_deg", "forward_m", "left_m", "yaw_left_deg"];

/// Reads `mount.json` in `folder`; null or absent is not known.
pub(super) fn read(folder: &Path, warnings: &mut Vec<RecordingWarning>) -> Result<Mount, RecordingError> {
    let file = folder.join("mount.json");
    match std::fs::read(&file) {
        Ok(bytes) => parse(&file, &bytes, warnings),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            warnings.push(RecordingWarning::MountMissing(file));
            Ok(Mount::default())
        }
        Err(error) => Err(RecordingError::io(&file, &error)),
    }
}

/// As [`read`], from the bytes of the file.
pub(super) fn parse(file: &Path, bytes: &[u8], warnings: &mut Vec<RecordingWarning>) -> Result<Mount, RecordingError> {
    let error = |field: &str, problem: String, mend: &str| RecordingError::Mount {
        file: file.to_owned(),
        field: field.to_owned(),
        problem,
        mend: mend.to_owned(),
    };
    let shape = "write {\"height_m\": 1.0, \"pitch_down_deg\": 0.0, \"roll_deg\": 0.0}";
    let value: Value = serde_json::from_slice(bytes).map_err(|e| error("", format!("is not JSON ({e})"), shape))?;
    let Value::Object(map) = value else { return Err(error("", "is not an object".to_owned(), shape)) };
    let number = |field: &'static str, mend: &str| match map.get(field) {
        None | Some(Value::Null) => Ok(None),
        Some(Value::Number(number)) => Ok(number.as_f64().map(|value| value as f32)),
        Some(other) => Err(error(field, format!("`{other}` is not a number"), mend)),
    };
    let height_m = number("height_m", "write metres, or null if it is not known")?;
    let pitch = number("pitch_down_deg", "write degrees below the horizon")?;
    let roll = number("roll_deg", "write degrees, positive to the right")?;
    let forward = number("forward_m", "write metres ahead of the vehicle's origin")?;
    let left = number("left_m", "write metres to the left of the vehicle's origin")?;
    let yaw = number("yaw_left_deg", "write degrees, positive to the left")?;
    for (field, value) in [("pitch_down_deg", pitch), ("roll_deg", roll)] {
        if value.is_none() {
            warnings.push(RecordingWarning::TiltUnknown { file: file.to_owned(), field });
        }
    }
    for (key, value) in &map {
        let known = KEYS.contains(&key.as_str());
        if !known
            && value.is_number()
            && ["height", "pitch", "roll", "tilt", "yaw", "forward", "left"].iter().any(|word| key.contains(word))
        {
            warnings.push(RecordingWarning::MountKeyIgnored { file: file.to_owned(), key: key.clone() });
        }
    }
    let mount = Mount {
        height_m,
        pitch_down_deg: pitch.unwrap_or(0.0),
        roll_deg: roll.unwrap_or(0.0),
        forward_m: forward.unwrap_or(0.0),
        left_m: left.unwrap_or(0.0),
        yaw_left_deg: yaw.unwrap_or(0.0),
    };
    mount.check().map_err(|ConfigError { field, problem }| {
        let field = field.strip_prefix("mount.").unwrap_or(field);
        let mend = match problem {
            ConfigProblem::OutOfRange { .. } => "give metres and degrees, not millimetres or radians",
            _ => "mend the value",
        };
        error(field, problem.to_string(), mend)
    })?;
    Ok(mount)
}

/// The text of a `mount.json`; the place is left out where it is the origin, looking straight ahead.
pub(super) fn emit(mount: &Mount) -> String {
    let height = mount.height_m.map_or("null".to_owned(), |height_m| format!("{height_m:?}"));
    let (pitch, roll) = (mount.pitch_down_deg, mount.roll_deg);
    let mut text = format!("{{\n \"height_m\": {height},\n \"pitch_down_deg\": {pitch:?},\n \"roll_deg\": {roll:?}");
    if mount.without_place() != *mount {
        let Mount { forward_m, left_m, yaw_left_deg, .. } = mount;
        text += &format!(
            ",\n \"forward_m\": {forward_m:?},\n \"left_m\": {left_m:?},\n \"yaw_left_deg\": {yaw_left_deg:?}"
        );
    }
    text + "\n}\n"
}
