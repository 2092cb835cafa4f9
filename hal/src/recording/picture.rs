//! Picture files to 8-bit grey and back.

use std::io::{BufWriter, Write};
use std::path::Path;

use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ColorType, DynamicImage, ExtendedColorType, ImageEncoder, ImageReader, Limits};

use super::error::RecordingError;

/// Largest side of a picture that is read, px: the largest the core can be told of.
const MAX_SIDE: u32 = 8192;

/// An 8-bit grey picture that owns its pixels, rows without gaps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GreyPicture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Pixels, row by row from the top.
    pub pixels: Vec<u8>,
}

/// What had to be done to a picture to make it 8-bit grey.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Converted {
    pub(super) colour: bool,
    pub(super) sixteen_bit: bool,
}

/// Decodes the picture at `path`, whatever its format, by what is in it.
pub(super) fn decode(frame: u32, path: &Path) -> Result<(GreyPicture, Converted), RecordingError> {
    let bytes = read(frame, path)?;
    let bad = |reason: String| RecordingError::BadPicture { frame, path: path.to_owned(), reason };
    let decoded = reader(&bytes).and_then(ImageReader::decode).map_err(|e| bad(e.to_string()))?;
    let (width, height) = (decoded.width(), decoded.height());
    let colour = decoded.color().has_color();
    let sixteen_bit = !matches!(decoded.color(), ColorType::L8 | ColorType::La8 | ColorType::Rgb8 | ColorType::Rgba8);
    let pixels = match decoded {
        DynamicImage::ImageLuma8(grey) => grey.into_raw(),
        DynamicImage::ImageLuma16(grey) => grey.into_raw().into_iter().map(high_byte).collect(),
        DynamicImage::ImageLumaA8(grey) => grey.pixels().map(|pixel| pixel.0[0]).collect(),
        DynamicImage::ImageLumaA16(grey) => grey.pixels().map(|pixel| high_byte(pixel.0[0])).collect(),
        other => other.into_rgb8().pixels().map(|pixel| luma(pixel.0)).collect(),
    };
    Ok((GreyPicture { width, height, pixels }, Converted { colour, sixteen_bit }))
}

/// Decodes a grey picture of 16 bits: width, height, pixels row by row; `None` if it is of another kind.
pub(super) fn decode_16_bit(frame: u32, path: &Path) -> Result<Option<(u32, u32, Vec<u16>)>, RecordingError> {
    let bytes = read(frame, path)?;
    let bad = |reason: String| RecordingError::BadPicture { frame, path: path.to_owned(), reason };
    match reader(&bytes).and_then(ImageReader::decode).map_err(|e| bad(e.to_string()))? {
        DynamicImage::ImageLuma16(grey) => Ok(Some((grey.width(), grey.height(), grey.into_raw()))),
        _ => Ok(None),
    }
}

/// Width and height of the picture at `path`, from its header alone.
pub(super) fn size(frame: u32, path: &Path) -> Result<(u32, u32), RecordingError> {
    let bytes = read(frame, path)?;
    let size = reader(&bytes).and_then(ImageReader::into_dimensions);
    size.map_err(|e| RecordingError::BadPicture { frame, path: path.to_owned(), reason: e.to_string() })
}

/// Writes 8-bit grey pixels as PNG; the file appears under its name only when it is whole.
pub(super) fn write_grey(path: &Path, pixels: &[u8], width: u32, height: u32) -> Result<(), RecordingError> {
    write(path, |to| {
        PngEncoder::new_with_quality(to, CompressionType::Fast, FilterType::Adaptive).write_image(
            pixels,
            width,
            height,
            ExtendedColorType::L8,
        )
    })
}

/// Writes 16-bit pixels as PNG; the file appears under its name only when it is whole.
pub(super) fn write_16_bit(path: &Path, pixels: &[u16], width: u32, height: u32) -> Result<(), RecordingError> {
    // The encoder takes 16-bit samples in the machine's byte order.
    let bytes: Vec<u8> = pixels.iter().flat_map(|value| value.to_ne_bytes()).collect();
    write(path, |to| {
        PngEncoder::new_with_quality(to, CompressionType::Fast, FilterType::Adaptive).write_image(
            &bytes,
            width,
            height,
            ExtendedColorType::L16,
        )
    })
}

fn read(frame: u32, path: &Path) -> Result<Vec<u8>, RecordingError> {
    std::fs::read(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::NotFound => RecordingError::MissingPicture { frame, path: path.to_owned() },
        _ => RecordingError::io(path, &error),
    })
}

fn reader(bytes: &[u8]) -> image::ImageResult<ImageReader<std::io::Cursor<&[u8]>>> {
    let mut reader = ImageReader::new(std::io::Cursor::new(bytes)).with_guessed_format()?;
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE);
    limits.max_image_height = Some(MAX_SIDE);
    reader.limits(limits);
    Ok(reader)
}

fn write(
    path: &Path,
    encode: impl FnOnce(&mut BufWriter<std::fs::File>) -> image::ImageResult<()>,
) -> Result<(), RecordingError> {
    let part = path.with_extension("part");
    let written = write_part(&part, path, encode);
    if written.is_err() {
        // On a full disk every byte counts.
        let _ = std::fs::remove_file(&part);
    }
    written
}

fn write_part(
    part: &Path,
    path: &Path,
    encode: impl FnOnce(&mut BufWriter<std::fs::File>) -> image::ImageResult<()>,
) -> Result<(), RecordingError> {
    let io = |error: std::io::Error| RecordingError::io(path, &error);
    let mut to = BufWriter::new(std::fs::File::create(part).map_err(io)?);
    encode(&mut to).map_err(|error| RecordingError::Io { path: path.to_owned(), reason: error.to_string() })?;
    to.flush().map_err(io)?;
    drop(to);
    std::fs::rename(part, path).map_err(io)
}

/// Luma of ITU-R BT.601, section 2.5.1: 0.299 R + 0.587 G + 0.114 B, rounded.
fn luma([r, g, b]: [u8; 3]) -> u8 {
    ((u32::from(r) * 299 + u32::from(g) * 587 + u32::from(b) * 114 + 500) / 1000) as u8
}

const fn high_byte(value: u16) -> u8 {
    (value >> 8) as u8
}
