//! A row of codes into the sums of its columns, and another one out.

use crate::arch::jobs::{CodeRow, SlideCodes};

/// Bytes that are all the same.
const fn bytes(byte: u8) -> u32 {
    u32::from_ne_bytes([byte; 4])
}

pub(super) fn slide_codes(job: SlideCodes<'_>) {
    let SlideCodes { columns, stride, disparities, min_disparity, enter, leave } = job;
    let Some(back) = (min_disparity + disparities).checked_sub(1) else { return };
    // The right code that place 0 of the first column is compared with. What lies in front of the row goes into sums that no search
    // looks at, and out of them again when the row leaves.
    let right = |row: &CodeRow<'_>| row.lead.checked_sub(back);
    let Some(right_in) = right(&enter).and_then(|first| enter.low.get(first..)) else { return };
    let columns = columns.chunks_exact_mut(stride.max(1));
    match leave {
        Some(leave) => {
            let Some(right_out) = right(&leave).and_then(|first| leave.low.get(first..)) else { return };
            let rights = right_in.windows(stride).zip(right_out.windows(stride));
            for ((column, (&left_in, &left_out)), (right_in, right_out)) in
                columns.zip(enter.left.iter().zip(leave.left)).zip(rights)
            {
                let codes = [bytes(left_in), !bytes(left_out)];
                let rights = right_in.as_chunks::<8>().0.iter().zip(right_out.as_chunks::<8>().0);
                for (sums, (right_in, right_out)) in column.as_chunks_mut::<8>().0.iter_mut().zip(rights) {
                    let [low, high] = halves(sums);
                    let [low_in, high_in] = halves(right_in);
                    let [low_out, high_out] = halves(right_out);
                    put(sums, [slide(low, codes, [low_in, low_out]), slide(high, codes, [high_in, high_out])]);
                }
            }
        }
        None => {
            for ((column, &left_in), right_in) in columns.zip(enter.left).zip(right_in.windows(stride)) {
                let code = bytes(left_in);
                for (sums, right_in) in column.as_chunks_mut::<8>().0.iter_mut().zip(right_in.as_chunks::<8>().0) {
                    let ([low, high], [low_in, high_in]) = (halves(sums), halves(right_in));
                    put(sums, [low.wrapping_add(ones(code ^ low_in)), high.wrapping_add(ones(code ^ high_in))]);
                }
            }
        }
    }
}

#[inline(always)]
fn halves(bytes: &[u8; 8]) -> [u32; 2] {
    let [a, b, c, d, e, f, g, h] = *bytes;
    [u32::from_ne_bytes([a, b, c, d]), u32::from_ne_bytes([e, f, g, h])]
}

#[inline(always)]
fn put(to: &mut [u8; 8], [low, high]: [u32; 2]) {
    to[..4].copy_from_slice(&low.to_ne_bytes());
    to[4..].copy_from_slice(&high.to_ne_bytes());
}

/// Four sums with one row more and another one less. The left code that leaves comes with its bits turned: counting the bits that
/// agree gives eight less those that differ, and both counts can go together.
///
/// Sums of whole words are sums of bytes, because no sum of a byte is negative or above 255 in the end.
#[inline(always)]
fn slide(sums: u32, codes: [u32; 2], right: [u32; 2]) -> u32 {
    let counts = fours(codes[0] ^ right[0]) + fours(codes[1] ^ right[1]);
    let high = (counts >> 4) & bytes(0x0f);
    sums.wrapping_add(counts & bytes(0x0f)).wrapping_add(high).wrapping_sub(bytes(8))
}

/// Bits of each byte.
#[inline(always)]
const fn ones(bits: u32) -> u32 {
    let fours = fours(bits);
    (fours & bytes(0x0f)) + ((fours >> 4) & bytes(0x0f))
}

/// Bits of each four bits.
#[inline(always)]
const fn fours(bits: u32) -> u32 {
    let pairs = bits - ((bits >> 1) & bytes(0x55));
    (pairs & bytes(0x33)) + ((pairs >> 2) & bytes(0x33))
}
