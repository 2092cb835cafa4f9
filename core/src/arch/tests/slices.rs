//! What backends are handed that does not fit: no backend may touch anything beyond the slices.

use super::*;

/// Sizes of a search, all just enough for `range`, and the right tables' lead.
#[derive(Clone)]
struct Sizes {
    search: Search,
    columns: usize,
    work: usize,
    tables: [usize; 2],
    lead: usize,
}

fn good() -> Sizes {
    Sizes { search: search(10..20), columns: 22 * 16, work: 16 + 32, tables: [20 + 16; 2], lead: 15 }
}

/// What a search finds with slices of these sizes.
fn lent(sizes: &Sizes, run: impl FnOnce(&[u8], &mut [i16], Right<'_>, &mut Found)) -> Found {
    // More memory than any of it says, so that nothing else is touched by what is not refused.
    let (columns, mut found) = (vec![0; 8192], Found::new());
    let mut rooms = [vec![0_i16; 4096], vec![0; 4096], vec![0; 4096]];
    let [work, even, odd] = &mut rooms;
    let right = Right { tables: [&mut even[..sizes.tables[0]], &mut odd[..sizes.tables[1]]], lead: sizes.lead };
    run(&columns[..sizes.columns], &mut work[..sizes.work], right, &mut found);
    found
}

fn by_costs(chosen: Chosen, sizes: &Sizes) -> Found {
    lent(sizes, |columns, work, right, found| {
        search_bytes(chosen, CostJob { search: &sizes.search, columns, work, right: Some(right), found });
    })
}

fn by_keys(chosen: Chosen, sizes: &Sizes) -> Found {
    lent(sizes, |columns, work, right, found| {
        let (search, limits) = (&sizes.search, &KeyLimits::new());
        search_keys(chosen, KeyJob { search, limits, columns, work, right, found });
    })
}

/// Slices of a row of codes: the sums, and the codes that come in and go out.
#[derive(Clone)]
struct Row {
    sums: usize,
    stride: usize,
    disparities: usize,
    /// Codes of the left picture that come in and that go out, and both tables of right ones, with their lead.
    left: [usize; 2],
    right: [[usize; 2]; 2],
    lead: [usize; 2],
}

/// A row of 20 pixels that just has all that it needs.
fn good_row() -> Row {
    Row { sums: 20 * 16, stride: 16, disparities: 16, left: [20; 2], right: [[36; 2]; 2], lead: [15; 2] }
}

/// Lets a row in and another one out and returns the sums.
fn slid(chosen: Chosen, row: &Row) -> Vec<u8> {
    let mut columns = vec![0; 4096];
    // Codes of eight bits against those of none, and out again against the same: sums that were touched are told apart.
    let (ones, zeros) = (vec![255; 256], vec![0; 256]);
    let code_row = |out: usize| CodeRow {
        left: &[&ones, &zeros][out][..row.left[out]],
        low: &zeros[..row.right[out][0]],
        high: &zeros[..row.right[out][1]],
        lead: row.lead[out],
    };
    let (enter, leave) = (code_row(0), Some(code_row(1)));
    let Row { stride, disparities, .. } = *row;
    let sums = &mut columns[..row.sums];
    slide_codes(chosen, SlideCodes { columns: sums, stride, disparities, min_disparity: 0, enter, leave });
    columns
}

/// Every backend reads and writes through pointers, so each looks whether all of that lies in the slices: what is too short by one is
/// refused.
#[test]
#[cfg(target_arch = "x86_64")]
fn searches_beyond_the_slices_are_refused() {
    let chosen = Chosen::new(Backend::Sse2).unwrap();
    let refused =
        |sizes: &Sizes| [by_costs, by_keys].map(|search| std::panic::catch_unwind(|| search(chosen, sizes)).is_err());
    let good = good();
    assert_eq!(refused(&good), [false; 2]);
    let ends = |range: core::ops::Range<usize>| Sizes {
        columns: (range.end + 2) * 16,
        tables: [range.end + 16; 2],
        search: search(range),
        ..good.clone()
    };
    assert_eq!(refused(&ends(3..67)), [false; 2], "the first pixel with a window, and as many as a chunk has");
    let nothing = Sizes { columns: 0, work: 0, tables: [0; 2], ..ends(20..20) };
    assert_eq!(refused(&nothing), [false; 2], "no pixel needs anything");
    for (what, bad) in [
        ("more pixels than a chunk has", ends(3..68)),
        ("a window that begins before the row", ends(2..20)),
        ("columns", Sizes { columns: good.columns - 1, ..good.clone() }),
        ("room for sums", Sizes { work: good.work - 1, ..good.clone() }),
        ("a table", Sizes { tables: [35, 36], ..good.clone() }),
        ("the other table", Sizes { tables: [36, 35], ..good.clone() }),
        ("lead", Sizes { lead: 14, ..good.clone() }),
        (
            "a part of a vector",
            Sizes {
                search: Search { stride: 24, ..good.search.clone() },
                columns: 22 * 24,
                work: 24 + 32,
                tables: [20 + 24; 2],
                ..good.clone()
            },
        ),
        (
            "fewer sums than disparities",
            Sizes { search: Search { disparities: 17, ..good.search.clone() }, lead: 16, ..good.clone() },
        ),
    ] {
        assert_eq!(refused(&bad), [cfg!(debug_assertions); 2], "{what}");
    }
}

#[test]
#[cfg(target_arch = "x86_64")]
fn rows_beyond_the_slices_are_refused() {
    let chosen = Chosen::new(Backend::Sse2).unwrap();
    let refused = |row: &Row| std::panic::catch_unwind(|| slid(chosen, row)).is_err();
    let good = good_row();
    // Eight bits differ, of as many disparities as a pixel has.
    let expected: Vec<u8> = (0..20 * 16).map(|i| if i % 16 + i / 16 >= 15 { 8 } else { 0 }).collect();
    assert_eq!(slid(chosen, &good)[..20 * 16], expected);
    assert_eq!(slid(Chosen::PLAIN, &good)[..20 * 16], expected);
    let none = Row { disparities: 0, sums: 0, ..good.clone() };
    assert_eq!(slid(chosen, &none), [0; 4096], "no disparity needs anything");
    for (what, bad) in [
        ("sums", Row { sums: good.sums - 1, ..good.clone() }),
        ("a part of a vector", Row { stride: 24, sums: 20 * 24, right: [[44; 2]; 2], ..good.clone() }),
        ("a vector that nobody needs", Row { stride: 32, sums: 20 * 32, right: [[52; 2]; 2], ..good.clone() }),
        ("fewer sums than disparities", Row { disparities: 17, lead: [16; 2], ..good.clone() }),
        ("lead", Row { lead: [14, 15], right: [[40; 2]; 2], ..good.clone() }),
        ("lead of what goes out", Row { lead: [15, 14], right: [[40; 2]; 2], ..good.clone() }),
        ("right codes", Row { right: [[35, 36], [36; 2]], ..good.clone() }),
        ("their upper halves", Row { right: [[36, 35], [36; 2]], ..good.clone() }),
        ("right codes that go out", Row { right: [[36; 2], [35, 36]], ..good.clone() }),
        ("left codes that go out", Row { left: [20, 19], ..good.clone() }),
    ] {
        assert!(refused(&bad) == cfg!(debug_assertions), "{what}");
    }
}

/// Plain Rust cannot reach beyond a slice: what does not fit is left alone.
#[test]
fn plain_rust_leaves_alone_what_has_no_room() {
    for search in [by_costs, by_keys] {
        assert_ne!(search(Chosen::PLAIN, &good()), Found::new());
        assert_eq!(search(Chosen::PLAIN, &Sizes { work: PAD + 15, ..good() }), Found::new());
    }

    let good = Row { right: [[20; 2]; 2], lead: [0; 2], ..good_row() };
    let sums = |row: &Row| slid(Chosen::PLAIN, row).iter().map(|sum| u32::from(*sum)).sum::<u32>();
    // Sums of pixels from the left: one disparity more for each, up to sixteen.
    let of = |pixels: u32| (1..=pixels).map(|x| 8 * x.min(16)).sum::<u32>();
    assert_eq!(sums(&good), of(20));
    for (what, row, pixels) in [
        ("sums for nine pixels", Row { sums: 9 * 16 + 15, ..good.clone() }, 9),
        ("sums for fewer disparities", Row { stride: 8, disparities: 16, ..good.clone() }, 0),
        ("right codes for nine pixels", Row { right: [[9, 9], [20, 20]], ..good.clone() }, 9),
        ("left codes that go out for nine pixels", Row { left: [20, 9], ..good.clone() }, 9),
        ("right codes that go out for nine pixels", Row { right: [[20, 20], [9, 9]], ..good.clone() }, 9),
    ] {
        assert_eq!(sums(&row), of(pixels), "{what}");
    }
}
