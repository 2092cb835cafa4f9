//! The grey values of a JPEG picture.

use std::panic::{AssertUnwindSafe, catch_unwind};

use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::{bytestream::ZCursor, colorspace::ColorSpace, options::DecoderOptions};

use super::PixelError;

/// Bits that are no Huffman code (ITU-T T.81, C.2: none is all ones), with the zero that says that 0xFF is no marker.
///
/// Where data is missing in front of a marker, decoders go on with zeroes and make up a picture. With ones they stop.
const NO_CODE: [u8; 16] = [0xFF, 0, 0xFF, 0, 0xFF, 0, 0xFF, 0, 0xFF, 0, 0xFF, 0, 0xFF, 0, 0xFF, 0];

/// A segment that says that the Huffman tables are those of ITU-T T.81, annex K: webcams leave them out.
const STANDARD_TABLES: [u8; 18] = *b"\xFF\xE0\x00\x10AVI1\0\0\0\0\0\0\0\0\0\0";

const END_OF_IMAGE: [u8; 2] = [0xFF, 0xD9];

/// Decodes JPEG pictures of one size.
#[derive(Clone, Debug)]
pub(super) struct JpegPictures {
    size: (usize, usize),
    /// The picture with what the decoder needs to tell a whole one from a damaged one.
    prepared: Vec<u8>,
}

impl JpegPictures {
    pub(super) fn new(size: (usize, usize)) -> Self {
        // Cameras need less than a byte for a pixel.
        Self { size, prepared: Vec::with_capacity(size.0.saturating_mul(size.1)) }
    }

    /// Decodes the picture at the start of `bytes` into `grey`, which has room for exactly its pixels.
    ///
    /// # Errors
    /// When it is no JPEG picture, has another size, or a part of it is missing.
    pub(super) fn decode(&mut self, bytes: &[u8], grey: &mut [u8]) -> Result<(), PixelError> {
        prepare(bytes, &mut self.prepared)?;
        let (prepared, size) = (&self.prepared, self.size);
        // Whatever comes over a disturbed cable must not end the program, also where the decoder has a mistake.
        catch_unwind(AssertUnwindSafe(|| decode(prepared, size, grey)))
            .unwrap_or_else(|_| Err(PixelError::Jpeg("the decoder gave up".to_owned())))
    }
}

fn decode(bytes: &[u8], size: (usize, usize), grey: &mut [u8]) -> Result<(), PixelError> {
    // Strict: otherwise what cannot be decoded is filled with grey, without a word.
    let options = DecoderOptions::new_fast()
        .set_strict_mode(true)
        .set_max_width(size.0)
        .set_max_height(size.1)
        .jpeg_set_out_colorspace(ColorSpace::Luma);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    let failed = |error: &dyn core::fmt::Debug| PixelError::Jpeg(format!("{error:?}"));
    decoder.decode_headers().map_err(|error| failed(&error))?;
    let found = decoder.info().map_or((0, 0), |info| (usize::from(info.width), usize::from(info.height)));
    if found != size {
        return Err(PixelError::JpegSize { found, wanted: size });
    }
    if decoder.output_buffer_size() != Some(grey.len()) {
        return Err(PixelError::Jpeg("it cannot be turned to grey".to_owned()));
    }
    decoder.decode_into(grey).map_err(|error| failed(&error))
}

/// Copies the picture without what an earlier one left behind it in the buffer, with tables where it has none, and so that
/// missing data is noticed.
fn prepare(bytes: &[u8], to: &mut Vec<u8>) -> Result<(), PixelError> {
    let wrong = |what: &str| Err(PixelError::Jpeg(what.to_owned()));
    // Within the data these two bytes never stand together (ITU-T T.81, B.1.1.5).
    let end = bytes.windows(2).rposition(|two| two == END_OF_IMAGE);
    let Some(picture) = end.and_then(|end| bytes.get(..end)) else {
        return wrong("its end is missing: the cable or the bus loses bytes");
    };
    let Some((head, data, has_tables)) = scan(picture) else { return wrong("its head is damaged") };
    let (start, rest) = head.split_at(2);
    to.clear();
    to.extend_from_slice(start);
    if !has_tables {
        to.extend_from_slice(&STANDARD_TABLES);
    }
    to.extend_from_slice(rest);
    let mut restarts = 0;
    let mut data = data;
    while let Some(at) = data.windows(2).position(|two| matches!(two, [0xFF, 0xD0..=0xD7])) {
        let (interval, behind) = data.split_at(at);
        let (marker, behind) = behind.split_at(2);
        if marker != [0xFF, 0xD0 + restarts] {
            return wrong("a part of it is missing: the cable or the bus loses bytes");
        }
        restarts = (restarts + 1) % 8;
        to.extend_from_slice(interval);
        to.extend_from_slice(&NO_CODE);
        to.extend_from_slice(marker);
        data = behind;
    }
    to.extend_from_slice(data);
    to.extend_from_slice(&NO_CODE);
    to.extend_from_slice(&END_OF_IMAGE);
    Ok(())
}

/// Head, up to and with the first start of scan, what follows it, and whether there are Huffman tables in the head.
///
/// # Bound
/// One pass over the segments of the head.
fn scan(picture: &[u8]) -> Option<(&[u8], &[u8], bool)> {
    let mut has_tables = false;
    let mut at = 2;
    if picture.get(..at)? != [0xFF, 0xD8] {
        return None;
    }
    loop {
        let [0xFF, marker, rest @ ..] = picture.get(at..)? else { return None };
        match marker {
            // A byte to fill up with, in front of a marker.
            0xFF => at += 1,
            _ => {
                let length = rest.first_chunk().map(|length| usize::from(u16::from_be_bytes(*length)))?;
                has_tables |= *marker == 0xC4;
                at += 2 + length.max(2);
                if *marker == 0xDA {
                    return picture.split_at_checked(at).map(|(head, data)| (head, data, has_tables));
                }
            }
        }
    }
}
