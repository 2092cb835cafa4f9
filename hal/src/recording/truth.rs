//! Truth that lies beside the pictures: disparity from a laser or structured light, and lidar sweeps.

use std::path::{Path, PathBuf};

use super::error::RecordingError;
use super::picture;

/// Folders with truth that lie beside the pictures.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Truth {
    /// Disparity, `disp_occ_0/`.
    pub disparity: Option<PathBuf>,
    /// Lidar points, `velodyne/`.
    pub lidar: Option<PathBuf>,
}

/// What the disparity of a left picture really is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TrueDisparity {
    /// Width, px.
    pub width: usize,
    /// Height, px.
    pub height: usize,
    /// Disparity of each pixel in 1/256 px, row by row; 0 where it is not known. KITTI's convention.
    pub pixels: Vec<u16>,
}

/// Bytes of a point of a sweep: x, y, z and reflectance, 32-bit floats, little endian.
const POINT_BYTES: usize = 16;

impl Truth {
    pub(super) fn of(folder: &Path) -> Self {
        let present = |name: &str| Some(folder.join(name)).filter(|path| path.is_dir());
        Self { disparity: present("disp_occ_0"), lidar: present("velodyne") }
    }

    /// True disparity of a frame, where there is a file of it: `NNNNNN.png`, grey, 16 bits.
    ///
    /// # Errors
    /// [`RecordingError`] where the file cannot be used.
    pub fn disparity_of(&self, frame: u32) -> Result<Option<TrueDisparity>, RecordingError> {
        let Some(path) = file(self.disparity.as_deref(), frame, "png") else { return Ok(None) };
        match picture::decode_16_bit(frame, &path)? {
            Some((width, height, pixels)) => {
                Ok(Some(TrueDisparity { width: width as usize, height: height as usize, pixels }))
            }
            None => {
                let problem =
                    "is not grey with 16 bits; true disparity is written as value = 256 x disparity".to_owned();
                Err(RecordingError::BadTruth { frame, path, problem })
            }
        }
    }

    /// Points of the sweep of a frame in the lidar's own frame, metres, where there is a file of it: `NNNNNN.bin`.
    ///
    /// # Errors
    /// [`RecordingError`] where the file cannot be used.
    pub fn sweep_of(&self, frame: u32) -> Result<Option<Vec<[f32; 3]>>, RecordingError> {
        let Some(path) = file(self.lidar.as_deref(), frame, "bin") else { return Ok(None) };
        let bytes = std::fs::read(&path).map_err(|error| RecordingError::io(&path, &error))?;
        let (points, rest) = bytes.as_chunks::<POINT_BYTES>();
        if !rest.is_empty() {
            let problem = format!(
                "has {} bytes, which is not a whole number of points of {POINT_BYTES} bytes; it is cut off: copy it again",
                bytes.len()
            );
            return Err(RecordingError::BadTruth { frame, path, problem });
        }
        let float = |[a, b, c, d]: [u8; 4]| f32::from_le_bytes([a, b, c, d]);
        let point = |p: &[u8; POINT_BYTES]| {
            let (words, _) = p.as_chunks::<4>();
            std::array::from_fn(|axis| words.get(axis).copied().map_or(0.0, float))
        };
        Ok(Some(points.iter().map(point).collect()))
    }
}

fn file(folder: Option<&Path>, frame: u32, extension: &str) -> Option<PathBuf> {
    folder.map(|folder| folder.join(format!("{frame:06}.{extension}"))).filter(|path| path.is_file())
}
