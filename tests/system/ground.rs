//! The ground plane against what is known of the vehicles: the height and the tilt of the camera.

use fencepost_tests::{say, table};

/// What must hold of the ground in a recording.
struct Expected {
    height_m: f64,
    height_tolerance_m: f64,
    /// Pitch and tolerance, degrees, where it is known.
    pitch_down_deg: Option<(f64, f64)>,
    /// At least so many frames ...
    frames: usize,
    /// ... of so many.
    of: usize,
}

impl Expected {
    fn check(&self, name: &str) {
        let Some(out) = super::replayed(name) else { return };
        let rows = table::rows(&out.join("ground.csv"));
        assert_eq!(rows.len(), self.of, "{name}: frames");
        let (mut good, mut seen) = (0, Vec::new());
        for row in &rows {
            let is_seen = row["found"] == "seen";
            let (height_m, pitch_deg) = (table::number(row, "camera_height_m"), table::number(row, "pitch_down_deg"));
            let height_fits = height_m.is_some_and(|h| (h - self.height_m).abs() <= self.height_tolerance_m);
            let pitch_fits = self
                .pitch_down_deg
                .is_none_or(|(expected, tolerance)| pitch_deg.is_some_and(|p| (p - expected).abs() <= tolerance));
            good += usize::from(is_seen && height_fits && pitch_fits);
            seen.push(match (height_m, pitch_deg) {
                (Some(height_m), Some(pitch_deg)) => format!("{height_m:.3} m {pitch_deg:.2}°"),
                _ => "none".to_owned(),
            });
        }
        let seen = seen.join(", ");
        say!("{name}: {good} of {} frames have the right ground (at least {}): {seen}", self.of, self.frames);
        assert!(good >= self.frames, "{name}: {good} of {} frames: {seen}", self.of);
    }
}

#[test]
fn bridge() {
    // The vehicle's calibration gives the height and the tilt.
    let pitch_down_deg = Some((0.355, 0.5));
    Expected { height_m: 1.28, height_tolerance_m: 0.05, pitch_down_deg, frames: 11, of: 12 }.check("bridge");
}

#[test]
fn grenoble() {
    Expected { height_m: 1.28, height_tolerance_m: 0.10, pitch_down_deg: None, frames: 3, of: 3 }
        .check("inria-grenoble");
}

#[test]
fn residential_road() {
    Expected { height_m: 1.65, height_tolerance_m: 0.12, pitch_down_deg: None, frames: 14, of: 16 }
        .check("kitti-urban");
}

#[test]
fn country_road() {
    Expected { height_m: 1.65, height_tolerance_m: 0.12, pitch_down_deg: None, frames: 14, of: 16 }
        .check("kitti-rural");
}
