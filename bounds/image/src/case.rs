//! Pictures and cameras as they are handed to the image: in one file, which the simulator lays into memory.
//!
//! The same code reads it on the target and on the host, and writes it there. Little-endian:
//! ```text
//! file    "FENCECAS"  length of all, u32  cases, each padded to 4 bytes
//! case    name, 32 bytes  width, height, pairs, u32 each  numbers, f32 each (see `Setup::transfer`)  left, right, left, ...
//! ```

use fencepost_core::{
    geometry::{CameraModel, Mount, RawPair, Rectification, RectifiedPair, StereoCalibration},
    picture::Picture,
};

/// First bytes of the file.
pub(crate) const MAGIC: &[u8; 8] = b"FENCECAS";

/// Bytes of the name of a case.
pub(crate) const NAME: usize = 32;

/// Cameras and what is asked of the detector.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Setup {
    /// The cameras.
    pub(crate) calibration: StereoCalibration,
    /// How they sit.
    pub(crate) mount: Mount,
    /// Disparities searched, px.
    pub(crate) disparities: u16,
}

/// One recording.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Case<'a> {
    /// What it is called.
    pub(crate) name: &'a str,
    /// Cameras and settings.
    pub(crate) setup: Setup,
    /// Width and height of the pictures.
    pub(crate) size: (usize, usize),
    /// Left and right pictures in turn.
    pixels: &'a [u8],
}

/// The cases of a file, one after the other.
#[derive(Clone, Debug)]
pub(crate) struct Cases<'a> {
    rest: Reader<'a>,
}

impl<'a> Cases<'a> {
    /// Bytes that say how long the file is: magic and length.
    pub(crate) const HEADER: usize = MAGIC.len() + 4;

    /// Length of the file that begins with `header`; `None` if it is no such file.
    pub(crate) fn length(header: &[u8]) -> Option<usize> {
        let mut header = Reader(header);
        (header.bytes(MAGIC.len())? == MAGIC).then_some(())?;
        header.number()
    }

    /// The cases of `file`.
    pub(crate) fn new(file: &'a [u8]) -> Option<Self> {
        Some(Self { rest: Reader(file.get(Self::HEADER..Self::length(file)?)?) })
    }
}

impl<'a> Iterator for Cases<'a> {
    type Item = Case<'a>;

    fn next(&mut self) -> Option<Case<'a>> {
        let rest = &mut self.rest;
        let name = core::str::from_utf8(rest.bytes(NAME)?).ok()?.trim_end_matches('\0');
        let [width, height, pairs] = [rest.number()?, rest.number()?, rest.number()?];
        let mut setup = Setup::blank(rest.float()? != 0.0);
        setup.transfer(&mut |number| {
            *number = rest.float()?;
            Some(())
        })?;
        let bytes = width.checked_mul(height)?.checked_mul(2 * pairs)?;
        let pixels = rest.bytes(bytes)?;
        rest.bytes(bytes.next_multiple_of(4) - bytes)?;
        Some(Case { name, setup, size: (width, height), pixels })
    }
}

impl<'a> Case<'a> {
    /// The pictures, left and right.
    pub(crate) fn pairs(&self) -> impl Iterator<Item = [&'a [u8]; 2]> {
        let pixels = self.size.0 * self.size.1;
        self.pixels.chunks_exact(2 * pixels.max(1)).map(move |pair| {
            let (left, right) = pair.split_at(pixels);
            [left, right]
        })
    }

    /// A picture of this case.
    pub(crate) fn picture<'p>(&self, pixels: &'p [u8]) -> Option<Picture<'p>> {
        Picture::packed(pixels, self.size.0, self.size.1).ok()
    }
}

impl Setup {
    /// Cameras that are to be filled in: raw ones or a rectified pair.
    fn blank(raw: bool) -> Self {
        let pair = RectifiedPair {
            width: 0,
            height: 0,
            focal_px: 0.0,
            cx: 0.0,
            cy: 0.0,
            baseline_m: 0.0,
            disparity_offset_px: 0.0,
        };
        let camera =
            CameraModel { width: 0, height: 0, fx: 0.0, fy: 0.0, cx: 0.0, cy: 0.0, distortion: Default::default() };
        let turn = [[0.0; 3]; 3];
        let rectification = Some(Rectification { left_rotation: turn, right_rotation: turn, pair });
        let raw_pair = RawPair { left: camera, right: camera, rotation: turn, translation_m: [0.0; 3], rectification };
        let calibration = if raw { StereoCalibration::Raw(raw_pair) } else { StereoCalibration::Rectified(pair) };
        Self { calibration, mount: Mount { height_m: Some(0.0), ..Mount::default() }, disparities: 0 }
    }

    /// Hands every number to `io`, which reads or writes it. What may be absent has a number in front that says whether it is.
    pub(crate) fn transfer(&mut self, io: &mut impl FnMut(&mut f32) -> Option<()>) -> Option<()> {
        let mut disparities = f32::from(self.disparities);
        io(&mut disparities)?;
        self.disparities = disparities as u16;
        let Mount { height_m, pitch_down_deg, roll_deg, forward_m, left_m, yaw_left_deg } = &mut self.mount;
        maybe(height_m, io, |height_m, io| io(height_m))?;
        all([pitch_down_deg, roll_deg, forward_m, left_m, yaw_left_deg], io)?;
        match &mut self.calibration {
            StereoCalibration::Rectified(pair) => rectified(pair, io),
            StereoCalibration::Raw(RawPair { left, right, rotation, translation_m, rectification }) => {
                camera(left, io)?;
                camera(right, io)?;
                all(rotation.as_flattened_mut(), io)?;
                all(translation_m, io)?;
                maybe(rectification, io, |Rectification { left_rotation, right_rotation, pair }, io| {
                    all(left_rotation.as_flattened_mut(), io)?;
                    all(right_rotation.as_flattened_mut(), io)?;
                    rectified(pair, io)
                })
            }
        }
    }
}

fn camera(camera: &mut CameraModel, io: &mut impl FnMut(&mut f32) -> Option<()>) -> Option<()> {
    let CameraModel { width, height, fx, fy, cx, cy, distortion } = camera;
    size([width, height], io)?;
    all([fx, fy, cx, cy], io)?;
    all(&mut distortion.0, io)
}

fn rectified(pair: &mut RectifiedPair, io: &mut impl FnMut(&mut f32) -> Option<()>) -> Option<()> {
    let RectifiedPair { width, height, focal_px, cx, cy, baseline_m, disparity_offset_px } = pair;
    size([width, height], io)?;
    all([focal_px, cx, cy, baseline_m, disparity_offset_px], io)
}

fn size(edges: [&mut u32; 2], io: &mut impl FnMut(&mut f32) -> Option<()>) -> Option<()> {
    for edge in edges {
        let mut number = *edge as f32;
        io(&mut number)?;
        *edge = number as u32;
    }
    Some(())
}

fn all<'n>(numbers: impl IntoIterator<Item = &'n mut f32>, io: &mut impl FnMut(&mut f32) -> Option<()>) -> Option<()> {
    numbers.into_iter().try_for_each(io)
}

fn maybe<T, F: FnMut(&mut f32) -> Option<()>>(
    value: &mut Option<T>,
    io: &mut F,
    transfer: impl FnOnce(&mut T, &mut F) -> Option<()>,
) -> Option<()> {
    let mut present = f32::from(u8::from(value.is_some()));
    io(&mut present)?;
    if present == 0.0 {
        *value = None;
    }
    value.as_mut().map_or(Some(()), |value| transfer(value, io))
}

/// Reads from the front.
#[derive(Clone, Debug)]
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn bytes(&mut self, count: usize) -> Option<&'a [u8]> {
        let (bytes, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(bytes)
    }

    fn word(&mut self) -> Option<[u8; 4]> {
        self.bytes(4)?.try_into().ok()
    }

    fn number(&mut self) -> Option<usize> {
        usize::try_from(u32::from_le_bytes(self.word()?)).ok()
    }

    fn float(&mut self) -> Option<f32> {
        self.word().map(f32::from_le_bytes)
    }
}
