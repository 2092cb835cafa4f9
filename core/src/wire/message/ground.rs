use crate::ground::GroundPlane;

use super::{MeaninglessValue, SCAN_LOW, Signal};

/// Steps of the angles in a degree.
const STEPS_PER_DEGREE: f32 = 20.0;

/// The ground plane as it is sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WireGround {
    /// Frames since it was last seen; 0 if it was seen in this one; 15 = that many or more.
    pub age_frames: u8,
    /// Distance of the left camera from the plane, millimetres; 16383 = that or more.
    pub camera_height_mm: u16,
    /// Tilt of the optical axis below the plane, twentieths of a degree.
    pub pitch_down: i16,
    /// Roll of the camera against the plane, twentieths of a degree.
    pub roll: i16,
}

impl From<&GroundPlane> for WireGround {
    fn from(plane: &GroundPlane) -> Self {
        let angle = |radians: f32| {
            let steps = libm::roundf(radians.to_degrees() * STEPS_PER_DEGREE) as i32;
            steps.clamp(GroundRepr::PITCH.min_signed(), GroundRepr::PITCH.max_signed()) as i16
        };
        let height_mm = libm::roundf(plane.camera_height_m * 1000.0) as u32;
        Self {
            age_frames: u32::from(plane.age_frames).min(GroundRepr::AGE.max()) as u8,
            camera_height_mm: height_mm.min(GroundRepr::CAMERA_HEIGHT.max()) as u16,
            pitch_down: angle(plane.pitch_down_rad),
            roll: angle(plane.roll_rad),
        }
    }
}

/// Ground: the ground plane of a scan, or that there is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GroundRepr {
    /// Low four bits of the scan's index.
    pub scan_low: u8,
    /// The plane.
    pub ground: Option<WireGround>,
}

impl GroundRepr {
    /// `State`: 0 none, 1 measured, 2 held.
    pub const STATE: Signal = Signal::new(20, 2);
    /// `AgeFrames`
    pub const AGE: Signal = Signal::new(22, 4);
    /// `CameraHeight`
    pub const CAMERA_HEIGHT: Signal = Signal::new(26, 14);
    /// `PitchDown`
    pub const PITCH: Signal = Signal::new(40, 12);
    /// `Roll`
    pub const ROLL: Signal = Signal::new(52, 12);

    /// The message for `plane`. A plane with a number that is not finite is sent as none.
    pub fn of(plane: Option<&GroundPlane>, scan_low: u8) -> Self {
        let finite =
            |p: &&GroundPlane| p.camera_height_m.is_finite() && p.pitch_down_rad.is_finite() && p.roll_rad.is_finite();
        Self { scan_low, ground: plane.filter(finite).map(WireGround::from) }
    }

    /// Reads the signals.
    ///
    /// # Errors
    /// A state that does not exist, or that contradicts the age.
    pub fn parse(data: &[u8]) -> Result<Self, MeaninglessValue> {
        let ground = WireGround {
            age_frames: Self::AGE.get(data) as u8,
            camera_height_mm: Self::CAMERA_HEIGHT.get(data) as u16,
            pitch_down: Self::PITCH.get_signed(data) as i16,
            roll: Self::ROLL.get_signed(data) as i16,
        };
        let ground = match (Self::STATE.get(data), ground.age_frames) {
            (0, _) => None,
            (1, 0) | (2, 1..) => Some(ground),
            _ => return Err(MeaninglessValue("State")),
        };
        Ok(Self { scan_low: SCAN_LOW.get(data) as u8, ground })
    }

    /// Writes the signals.
    pub fn emit(&self, data: &mut [u8]) {
        SCAN_LOW.put(data, u32::from(self.scan_low));
        let state = match self.ground {
            None => 0,
            Some(WireGround { age_frames: 0, .. }) => 1,
            Some(_) => 2,
        };
        Self::STATE.put(data, state);
        let ground = self.ground.unwrap_or_default();
        Self::AGE.put(data, u32::from(ground.age_frames));
        Self::CAMERA_HEIGHT.put(data, u32::from(ground.camera_height_mm));
        Self::PITCH.put_signed(data, i32::from(ground.pitch_down));
        Self::ROLL.put_signed(data, i32::from(ground.roll));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_rounded_and_saturate() {
        let plane = GroundPlane {
            normal: [0.0, 0.0, 1.0],
            offset_m: 0.0,
            camera_height_m: 1.2804,
            pitch_down_rad: 12.34_f32.to_radians(),
            roll_rad: -3.21_f32.to_radians(),
            support: 1,
            rms_m: 0.0,
            age_frames: 0,
        };
        let wire = WireGround { age_frames: 0, camera_height_mm: 1280, pitch_down: 247, roll: -64 };
        assert_eq!(GroundRepr::of(Some(&plane), 1).ground, Some(wire));
        let far = GroundPlane { camera_height_m: 1e9, pitch_down_rad: 1e9, roll_rad: -1e9, age_frames: 999, ..plane };
        let wire = WireGround { age_frames: 15, camera_height_mm: 16383, pitch_down: 2047, roll: -2048 };
        assert_eq!(GroundRepr::of(Some(&far), 1).ground, Some(wire));
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for plane in [
                GroundPlane { camera_height_m: bad, ..plane },
                GroundPlane { pitch_down_rad: bad, ..plane },
                GroundPlane { roll_rad: bad, ..plane },
            ] {
                assert_eq!(GroundRepr::of(Some(&plane), 1).ground, None);
            }
        }
    }
}
