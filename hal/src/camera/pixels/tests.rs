use jpeg_encoder::{ColorType, Encoder, SamplingFactor};

use super::*;
use crate::camera::PixelFormat::*;

/// SplitMix64.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn bytes(&mut self, count: usize) -> Vec<u8> {
        (0..count).map(|_| self.next() as u8).collect()
    }
}

fn pixels(picture: &Picture<'_>) -> Vec<u8> {
    (0..picture.height()).flat_map(|y| picture.row(y).to_vec()).collect()
}

/// Grey value of one pixel, from the kernel's description of each format, without any thought of speed.
fn plain(format: PixelFormat, bytes: &[u8], stride: usize, x: usize, y: usize) -> u8 {
    let word = |at: usize| u32::from(bytes[at]) + 256 * u32::from(bytes[at + 1]);
    let row = y * stride;
    match format {
        Grey | Nv12 => bytes[row + x],
        Y10 => (word(row + 2 * x) % 1024 / 4) as u8,
        Y12 => (word(row + 2 * x) % 4096 / 16) as u8,
        Y16 => (word(row + 2 * x) / 256) as u8,
        Yuyv => bytes[row + 4 * (x / 2) + [0, 2][x % 2]],
        Uyvy => bytes[row + 4 * (x / 2) + [1, 3][x % 2]],
        Mjpg => unreachable!(),
    }
}

#[test]
fn every_format_gives_the_grey_values_of_its_description() {
    let seed = 0xCA3E;
    println!("seed {seed}");
    let mut random = Random(seed);
    for format in PixelFormat::ALL.into_iter().filter(|format| *format != Mjpg) {
        for (width, height, gap) in [(2, 1, 0), (16, 3, 0), (34, 7, 6), (17, 5, 3), (1, 1, 0), (640, 4, 64)] {
            let stride = format.row_bytes(width) + gap;
            let needed = format.needed_bytes(width, height, stride).unwrap();
            for rest in [0, 1, 300] {
                let bytes = random.bytes(needed + rest);
                let mut unpacker = Unpacker::new(format, width, height, stride).unwrap();
                let picture = unpacker.picture(&bytes).unwrap();
                assert_eq!((picture.width(), picture.height()), (width, height));
                let expected: Vec<u8> = (0..height)
                    .flat_map(|y| (0..width).map(move |x| (x, y)))
                    .map(|(x, y)| plain(format, &bytes, stride, x, y))
                    .collect();
                assert_eq!(pixels(&picture), expected, "{format} {width} x {height}, stride {stride}");
                let lent = picture.data().as_ptr() == bytes.as_ptr();
                assert_eq!(lent, format.is_lent(), "{format}");
            }
        }
    }
}

#[test]
fn every_word_of_the_deep_formats() {
    let bytes: Vec<u8> = (0..=u16::MAX).flat_map(u16::to_le_bytes).collect();
    for (format, bits) in [(Y10, 10), (Y12, 12), (Y16, 16)] {
        let mut unpacker = Unpacker::new(format, 256, 256, 0).unwrap();
        let picture = unpacker.picture(&bytes).unwrap();
        for (word, grey) in pixels(&picture).into_iter().enumerate() {
            assert_eq!(usize::from(grey), (word % (1 << bits)) >> (bits - 8), "{format} {word:#06x}");
        }
    }
}

#[test]
fn too_few_bytes_are_an_error_whatever_their_number() {
    for format in PixelFormat::ALL.into_iter().filter(|format| *format != Mjpg) {
        let needed = format.needed_bytes(6, 4, 30).unwrap();
        let mut unpacker = Unpacker::new(format, 6, 4, 30).unwrap();
        let bytes = vec![7; needed];
        for found in 0..needed {
            let error = unpacker.picture(&bytes[..found]).unwrap_err();
            assert_eq!(error, PixelError::TooShort { found, needed });
        }
        assert!(unpacker.picture(&bytes).is_ok());
    }
    assert_eq!(Unpacker::new(Grey, 0, 4, 8).unwrap_err(), PixelError::NoPixels);
    assert_eq!(Unpacker::new(Y16, 6, 4, 8).unwrap_err(), PixelError::StrideTooShort { stride: 8, needed: 12 });
}

#[test]
fn a_picture_of_two_is_split_without_a_copy() {
    let bytes: Vec<u8> = (0..20 * 6).map(|i| i as u8).collect();
    let both = Picture::new(&bytes, 16, 6, 20).unwrap();
    let at = |x: usize, y: usize| (20 * y + x) as u8;
    let (left, right) = split(both, PackedLayout::SideBySide).unwrap();
    let (top, bottom) = split(both, PackedLayout::TopBottom).unwrap();
    for (picture, size, origin) in
        [(left, (8, 6), (0, 0)), (right, (8, 6), (8, 0)), (top, (16, 3), (0, 0)), (bottom, (16, 3), (0, 3))]
    {
        assert_eq!((picture.width(), picture.height()), size);
        for y in 0..size.1 {
            let expected: Vec<u8> = (0..size.0).map(|x| at(x + origin.0, y + origin.1)).collect();
            assert_eq!(picture.row(y), expected);
        }
        let start = picture.data().as_ptr() as usize - bytes.as_ptr() as usize;
        assert_eq!(start, 20 * origin.1 + origin.0);
    }
    // A buffer that ends with the last row's last pixel.
    let exact = Picture::new(&bytes[..5 * 20 + 16], 16, 6, 20).unwrap();
    assert_eq!(split(exact, PackedLayout::SideBySide).unwrap().1.row(5), right.row(5));
    assert_eq!(split(exact, PackedLayout::TopBottom).unwrap().1.row(2), bottom.row(2));
    let odd = Picture::new(&bytes, 15, 5, 20).unwrap();
    assert_eq!(split(odd, PackedLayout::SideBySide).unwrap_err(), PixelError::NotHalved { length: 15 });
    assert_eq!(split(odd, PackedLayout::TopBottom).unwrap_err(), PixelError::NotHalved { length: 5 });
    let single = Picture::new(&bytes, 1, 1, 1).unwrap();
    assert!(split(single, PackedLayout::SideBySide).is_err());
}

const WIDTH: u16 = 70;
const HEIGHT: u16 = 46;

/// A smooth picture with an edge in it.
fn truth() -> Vec<u8> {
    let grey = |x: u16, y: u16| 30 + x + 2 * y + if x > 40 { 50 } else { 0 };
    (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| grey(x, y) as u8)).collect()
}

fn encode(set: impl FnOnce(&mut Encoder<&mut Vec<u8>>), colour: ColorType) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = Encoder::new(&mut bytes, 95);
    set(&mut encoder);
    // Neutral chroma beside the grey: three channels of Y, Cb, Cr.
    let pixels = match colour {
        ColorType::Ycbcr => truth().into_iter().flat_map(|grey| [grey, 128, 128]).collect(),
        _ => truth(),
    };
    encoder.encode(&pixels, WIDTH, HEIGHT, colour).unwrap();
    bytes
}

fn decode(bytes: &[u8]) -> Result<Vec<u8>, PixelError> {
    let mut unpacker = Unpacker::new(Mjpg, WIDTH.into(), HEIGHT.into(), 0).unwrap();
    unpacker.picture(bytes).map(|picture| pixels(&picture))
}

#[track_caller]
fn close_to_truth(bytes: &[u8], what: &str) {
    let decoded = decode(bytes).unwrap();
    let worst = decoded.iter().zip(truth()).map(|(a, b)| a.abs_diff(b)).max();
    assert!(worst <= Some(8), "{what}: off by {worst:?}");
    let sum: u32 = decoded.iter().zip(truth()).map(|(a, b)| u32::from(a.abs_diff(b))).sum();
    assert!(sum < u32::from(WIDTH) * u32::from(HEIGHT) * 3 / 2, "{what}: off by {sum} in sum");
}

#[test]
fn jpeg_in_the_ways_that_cameras_write_it() {
    for sampling in [SamplingFactor::F_1_1, SamplingFactor::F_2_1, SamplingFactor::F_2_2] {
        for restart in [0, 4] {
            let bytes = encode(
                |encoder| {
                    encoder.set_sampling_factor(sampling);
                    encoder.set_restart_interval(restart);
                },
                ColorType::Ycbcr,
            );
            close_to_truth(&bytes, &format!("{sampling:?}, restart {restart}"));
        }
    }
    close_to_truth(&encode(|_| (), ColorType::Luma), "grey");
    close_to_truth(&encode(|encoder| encoder.set_progressive(true), ColorType::Ycbcr), "progressive");
}

#[test]
fn jpeg_without_its_standard_tables_and_with_rests_behind_it() {
    let whole = encode(|encoder| encoder.set_sampling_factor(SamplingFactor::F_2_1), ColorType::Ycbcr);
    // Webcams leave the Huffman tables out, since they are always those of ITU-T T.81, annex K.
    let mut bytes = whole.clone();
    while let Some(at) = bytes.windows(2).position(|two| two == [0xFF, 0xC4]) {
        let length = usize::from(bytes[at + 2]) * 256 + usize::from(bytes[at + 3]);
        bytes.drain(at..at + 2 + length);
    }
    assert!(bytes.len() < whole.len() - 400, "the tables are out");
    assert_eq!(decode(&bytes), decode(&whole));
    for rest in [vec![0; 5000], vec![0xFF; 3], vec![0xD9, 0xAA, 0x55]] {
        assert_eq!(decode(&[whole.clone(), rest].concat()), decode(&whole));
    }
}

#[test]
fn a_jpeg_cut_short_is_an_error_wherever_it_is_cut() {
    for bytes in [encode(|_| (), ColorType::Ycbcr), encode(|encoder| encoder.set_restart_interval(3), ColorType::Luma)]
    {
        for length in 0..bytes.len() {
            assert!(decode(&bytes[..length]).is_err(), "{length} of {} bytes", bytes.len());
        }
        // Cut in the middle, with the end of the picture before it, as a lost packet leaves it.
        let data = bytes.windows(2).position(|two| two == [0xFF, 0xDA]).unwrap() + 12;
        for start in (data..bytes.len() - 40).step_by(7) {
            let end = bytes.len() - 2;
            let lost = [&bytes[..start], &bytes[end..]].concat();
            assert!(decode(&lost).is_err(), "cut at {start} of {}", bytes.len());
        }
    }
}

#[test]
fn a_jpeg_with_a_hole_between_two_restarts_is_an_error() {
    let bytes = encode(|encoder| encoder.set_restart_interval(8), ColorType::Luma);
    let marker = |at: &usize| bytes[*at] == 0xFF && matches!(bytes[at + 1], 0xD0..=0xD7);
    let restarts: Vec<usize> = (0..bytes.len() - 1).filter(marker).collect();
    assert!(restarts.len() >= 5, "{restarts:?}");
    for pair in restarts.windows(2) {
        for start in pair[0] + 2..pair[1] - 1 {
            let hole = [&bytes[..start], &bytes[pair[1]..]].concat();
            assert!(decode(&hole).is_err(), "hole from {start} to {}", pair[1]);
        }
        let whole_interval = [&bytes[..pair[0]], &bytes[pair[1]..]].concat();
        assert!(decode(&whole_interval).is_err(), "an interval is missing at {}", pair[0]);
    }
}

#[test]
fn a_jpeg_with_hardly_any_data_is_a_picture_too() {
    // A covered lens: the data of all rows together are a few bytes, read ahead of in one go.
    for grey in [0, 1, 128, 255] {
        for (colour, pixels) in
            [(ColorType::Luma, vec![grey; 64 * 48]), (ColorType::Ycbcr, [grey, 128, 128].repeat(64 * 48))]
        {
            let mut bytes = Vec::new();
            Encoder::new(&mut bytes, 90).encode(&pixels, 64, 48, colour).unwrap();
            let mut unpacker = Unpacker::new(Mjpg, 64, 48, 0).unwrap();
            let picture = unpacker.picture(&bytes).unwrap();
            assert!((0..48).all(|y| picture.row(y).iter().all(|pixel| pixel.abs_diff(grey) <= 2)), "{grey}");
        }
    }
}

#[test]
fn no_bytes_make_the_jpeg_decoder_panic() {
    let seed = 0x1BE6;
    println!("seed {seed}");
    let mut random = Random(seed);
    let whole = encode(|encoder| encoder.set_restart_interval(5), ColorType::Ycbcr);
    for round in 0..3000 {
        let mut bytes = whole.clone();
        for _ in 0..1 + round % 20 {
            let at = random.next() as usize % bytes.len();
            bytes[at] = random.next() as u8;
        }
        // Right or wrong: it ends, and a picture has its size.
        if let Ok(pixels) = decode(&bytes) {
            assert_eq!(pixels.len(), usize::from(WIDTH) * usize::from(HEIGHT));
        }
        let length = random.next() as usize % 200;
        assert!(decode(&random.bytes(length)).is_err());
    }
    let other = encode(|_| (), ColorType::Luma);
    let mut unpacker = Unpacker::new(Mjpg, 64, 46, 0).unwrap();
    let error = unpacker.picture(&other).unwrap_err();
    assert!(matches!(error, PixelError::JpegSize { .. } | PixelError::Jpeg(_)), "{error}");
}
