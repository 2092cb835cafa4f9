//! Codes of pictures made by hand.

use super::*;

/// Every pixel of the ring alone, darker, equal and lighter; then pixels that are not on it.
#[test]
fn each_neighbour_on_the_ring_has_a_bit_of_its_own() {
    // Three pixels straight and two diagonally; the rest is not looked at.
    let picture = [
        b"...a...", //
        b".b...c.", b".......", b"d..*..e", b".......", b".f...g.", b"...h...",
    ];
    let mut bits = 0u32;
    for (y, row) in picture.iter().enumerate() {
        for (x, mark) in row.iter().enumerate() {
            if *mark == b'*' {
                continue;
            }
            let code = |grey: u8| {
                // The rest is as light as the middle, so that only the pixel in question can speak.
                let mut rows = [[100; 7]; 7];
                rows[y][x] = grey;
                code_in_the_middle(&rows)
            };
            assert_eq!([code(100), code(101), code(255)], [0; 3], "({x}, {y}) is not darker");
            let code = [code(99), code(0)];
            assert_eq!(code[0], code[1], "by how much does not count");
            if *mark == b'.' {
                assert_eq!(code[0], 0, "({x}, {y}) is not on the ring");
            } else {
                assert_eq!(code[0].count_ones(), 1, "({x}, {y})");
                bits |= u32::from(code[0]);
            }
        }
    }
    assert_eq!(bits, 0xff, "eight bits for eight neighbours");
}

fn code_in_the_middle(rows: &[[u8; 7]; 7]) -> u8 {
    let mut out = [0xaa; 7];
    codes(Chosen::PLAIN, core::array::from_fn(|i| &rows[i][..]), &mut out);
    for x in [0, 1, 2, 4, 5, 6] {
        assert_eq!(out[x], 0, "too near to an end");
    }
    out[3]
}

#[test]
fn codes_along_a_row_are_those_of_each_pixel_by_itself() {
    // A bright field, a dark post of two columns and a bar over the upper rows.
    let rows: [[u8; 16]; ROWS] = core::array::from_fn(|y| {
        core::array::from_fn(|x| match (x, y) {
            (7 | 8, _) => 20,
            (_, 0..=1) => 60,
            _ => 200,
        })
    });
    let mut out = [0xff; 16];
    codes(Chosen::PLAIN, core::array::from_fn(|i| &rows[i][..]), &mut out);
    // The bar is darker for the three neighbours above, the post for those three aside and two aside and below; for the post nothing
    // is.
    let count = out.map(u8::count_ones);
    assert_eq!(count, [0, 0, 0, 3, 3 + 1, 3 + 2, 3 + 1, 0, 0, 3 + 1, 3 + 2, 3 + 1, 3, 0, 0, 0]);
    // What a pixel says does not grow with contrast, nor change with brightness.
    let mut faint = [0; 16];
    let faint_rows = rows.map(|row| row.map(|grey| 50 + grey / 20));
    codes(Chosen::PLAIN, core::array::from_fn(|i| &faint_rows[i][..]), &mut faint);
    assert_eq!(faint, out);
}

#[test]
fn rows_too_short_for_the_ring_have_no_codes() {
    for width in 0..7 {
        let row = [0u8, 255, 0, 255, 0, 255, 0];
        let mut out = [1; 7];
        codes(Chosen::PLAIN, [&row[..width]; ROWS], &mut out);
        assert_eq!(out, [0; 7], "{width}");
    }
}
