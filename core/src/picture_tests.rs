//! Views of bytes of every shape.

use std::string::ToString;

use super::*;

#[test]
fn a_picture_holds_all_of_its_rows_or_is_refused() {
    let data: [u8; 60] = core::array::from_fn(|i| i as u8);
    for (width, height, stride) in (0..9).flat_map(|w| (0..9).flat_map(move |h| (0..10).map(move |s| (w, h, s)))) {
        for len in 0..=60 {
            let picture = Picture::new(&data[..len], width, height, stride);
            let needed = (height.max(1) - 1) * stride + width;
            match picture {
                Err(PictureError::Empty) => assert!(width == 0 || height == 0),
                Err(PictureError::StrideTooShort) => assert!(stride < width),
                Err(PictureError::Truncated { needed: n, found }) => {
                    assert!(n == needed && found == len && len < needed);
                }
                Ok(picture) => {
                    assert!(width > 0 && height > 0 && stride >= width && len >= needed);
                    for y in 0..height {
                        assert_eq!(picture.row(y), &data[y * stride..y * stride + width]);
                    }
                    assert_eq!(picture.data(), &data[..len]);
                    assert_eq!(picture.row(usize::MAX), picture.row(height - 1));
                    assert_eq!((picture.width(), picture.height(), picture.stride()), (width, height, stride));
                }
            }
        }
    }
    assert!(Picture::new(&data, 1, usize::MAX, usize::MAX).is_err());
    assert!(Picture::packed(&data, 7, 8).is_ok() && Picture::packed(&data, 8, 8).is_err());
}

#[test]
fn errors_say_what_is_wrong() {
    let error = Picture::packed(&[0; 5], 2, 3).unwrap_err();
    assert_eq!(error.to_string(), "the picture needs 6 bytes, 5 are there");
    assert_eq!(Picture::packed(&[], 0, 3).unwrap_err().to_string(), "the picture has no pixels");
    assert_eq!(Picture::new(&[], 4, 3, 2).unwrap_err().to_string(), "the stride is shorter than a row");
}
