//! Buffers of a driver into grey pictures: every format, with strides and lengths that are right and wrong.

use std::{cell::Cell, panic, sync::Once};

use fencepost_core::picture::Picture;
use fencepost_hal::camera::{
    PackedLayout, PixelFormat,
    pixels::{PixelError, Unpacker, split},
};

use crate::Source;

thread_local! {
    /// The decoder of JPEG may give up with a panic: it is caught where it is called, and no finding.
    static DECODES: Cell<bool> = const { Cell::new(false) };
}

/// Lets panics pass that are caught.
fn expect_panics_of_the_decoder() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let usual = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !DECODES.get() {
                usual(info);
            }
        }));
    });
}

/// Runs one input.
pub fn run(bytes: &[u8]) {
    expect_panics_of_the_decoder();
    let mut source = Source::new(bytes);
    let format = source.one_of(&PixelFormat::ALL);
    let (width, height) = (source.below(40), source.below(24));
    let row = format.row_bytes(width);
    let stride = match source.byte() {
        0..=99 => 0,
        100..=159 => row,
        160..=199 => row + source.below(20),
        200..=229 => source.below(64),
        230..=249 => row.saturating_sub(1),
        _ => usize::MAX - source.below(64),
    };
    let mut unpacker = match Unpacker::new(format, width, height, stride) {
        Ok(unpacker) => unpacker,
        Err(PixelError::NoPixels) => return assert!(width == 0 || height == 0),
        Err(PixelError::StrideTooShort { stride: told, needed }) => {
            return assert!(told == stride && needed == row && stride < row && stride != 0);
        }
        Err(error) => panic!("{error}"),
    };
    assert!(width > 0 && height > 0 && (stride == 0 || stride >= row || format == PixelFormat::Mjpg));
    let stride = if stride == 0 { row } else { stride };
    let needed = (height as u128 - 1) * stride as u128 + row as u128;
    let mut alone = unpacker.clone();
    // A buffer of any length, then one that is long enough or not.
    for last in [false, true] {
        let length = match source.byte() {
            0..=149 => needed.min(4096) as usize,
            150..=199 => (needed.min(4096) as usize).saturating_sub(1 + source.below(4)),
            200..=229 => needed.min(4096) as usize + source.below(30),
            _ => source.below(255),
        };
        let mut buffer = if format == PixelFormat::Mjpg {
            let half = source.bytes(if last { usize::MAX } else { source_half(bytes) });
            half.to_vec()
        } else {
            source.bytes(length).to_vec()
        };
        if format != PixelFormat::Mjpg {
            let from = buffer.len();
            buffer.resize(length, 0);
            buffer.iter_mut().enumerate().skip(from).for_each(|(i, byte)| *byte = (i * 31) as u8);
        }
        DECODES.set(format == PixelFormat::Mjpg);
        let found = unpacker.picture(&buffer);
        DECODES.set(false);
        match &found {
            Ok(picture) => {
                assert_eq!((picture.width(), picture.height()), (width, height));
                assert!(
                    format == PixelFormat::Mjpg || buffer.len() as u128 >= needed,
                    "fewer bytes than a picture has"
                );
                if format != PixelFormat::Mjpg {
                    check_pixels(picture, format, &buffer, stride);
                }
                check_split(picture);
            }
            Err(PixelError::TooShort { found, needed: told }) => {
                let short = if format == PixelFormat::Mjpg { buffer.is_empty() } else { (*found as u128) < needed };
                assert!(*found == buffer.len() && short && *found < *told, "{found} of {told}");
            }
            Err(PixelError::Jpeg(_) | PixelError::JpegSize { .. }) => assert_eq!(format, PixelFormat::Mjpg),
            Err(error) => panic!("{error}"),
        }
        if last {
            // What came before has no say.
            DECODES.set(format == PixelFormat::Mjpg);
            let again = alone.picture(&buffer);
            DECODES.set(false);
            match (found, again) {
                (Ok(found), Ok(again)) => (0..height).for_each(|y| assert_eq!(found.row(y), again.row(y), "row {y}")),
                (Err(found), Err(again)) => assert_eq!(found, again),
                (found, again) => panic!("{found:?}, alone {again:?}"),
            }
        }
    }
}

/// Where the first of two JPEG pictures ends.
const fn source_half(bytes: &[u8]) -> usize {
    bytes.len() / 4
}

/// Grey values by the kernel's description of each format.
fn check_pixels(picture: &Picture<'_>, format: PixelFormat, bytes: &[u8], stride: usize) {
    for y in 0..picture.height() {
        for (x, found) in picture.row(y).iter().enumerate() {
            let byte = |at: usize| u32::from(bytes[y * stride + at]);
            let word = || byte(2 * x) + 256 * byte(2 * x + 1);
            let grey = match format {
                PixelFormat::Grey | PixelFormat::Nv12 => byte(x),
                PixelFormat::Y16 => word() >> 8,
                PixelFormat::Y12 => word() >> 4 & 0xFF,
                PixelFormat::Y10 => word() >> 2 & 0xFF,
                PixelFormat::Yuyv => byte(2 * x),
                PixelFormat::Uyvy => byte(2 * x + 1),
                PixelFormat::Mjpg => return,
            };
            assert_eq!(u32::from(*found), grey, "{format} at {x}, {y}");
        }
    }
}

/// Both halves have every pixel of the whole, once.
fn check_split(both: &Picture<'_>) {
    for layout in [PackedLayout::SideBySide, PackedLayout::TopBottom] {
        let length = if layout == PackedLayout::SideBySide { both.width() } else { both.height() };
        match split(*both, layout) {
            Ok((left, right)) => {
                assert!(length.is_multiple_of(2) && (left.width(), left.height()) == (right.width(), right.height()));
                let (columns, rows) = match layout {
                    PackedLayout::SideBySide => (left.width(), 0),
                    PackedLayout::TopBottom => (0, left.height()),
                };
                for y in 0..left.height() {
                    assert_eq!(left.row(y), &both.row(y)[..left.width()]);
                    assert_eq!(right.row(y), &both.row(y + rows)[columns..columns + right.width()]);
                }
            }
            Err(error) => assert!(length == 1 || !length.is_multiple_of(2), "{error}"),
        }
    }
}

pub(crate) fn seeds() -> Vec<Vec<u8>> {
    let mut seeds = Vec::new();
    for (place, format) in PixelFormat::ALL.into_iter().enumerate() {
        for (stride, length) in [(0, 0), (100, 150), (160, 200), (230, 0), (255, 0), (210, 240)] {
            seeds.push(vec![place as u8, 12, 6, stride, 7, length, 3, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, length, 1]);
        }
        if format == PixelFormat::Mjpg {
            seeds.extend(jpegs(place as u8));
        }
    }
    seeds
}

/// JPEG pictures as cameras write them.
fn jpegs(place: u8) -> Vec<Vec<u8>> {
    use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
    let mut seeds = Vec::new();
    for (sampling, restart) in [(SamplingFactor::F_1_1, 0), (SamplingFactor::F_2_1, 4), (SamplingFactor::F_2_2, 0)] {
        let mut jpeg = Vec::new();
        let mut encoder = Encoder::new(&mut jpeg, 60);
        encoder.set_sampling_factor(sampling);
        encoder.set_restart_interval(restart);
        let pixels: Vec<u8> = (0..16 * 8 * 3).map(|i| (i * 5) as u8).collect();
        encoder.encode(&pixels, 16, 8, ColorType::Ycbcr).expect("a picture");
        seeds.push([&[place, 16, 8, 0, 0], jpeg.as_slice()].concat());
        // The first of the two buffers takes a quarter of the input; this picture is the second.
        let quarter = jpeg.len() / 3;
        seeds.push([&[place, 16, 8, 0, 0], vec![0; quarter].as_slice(), &[0], jpeg.as_slice()].concat());
    }
    seeds
}
