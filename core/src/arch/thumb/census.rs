//! Census codes of four pixels at a time.

use core::arch::asm;

/// Writes the codes of pixels whose ring begins at `x` of the rows, from the first on, and says how many were written: a multiple of
/// four, and fewer than four are left. The rows are those three above, two above, the pixel's own, two below and three below.
///
/// # Bound
/// One round for four pixels.
pub(in crate::arch) fn census_codes(rows: [&[u8]; 5], out: &mut [u8]) -> usize {
    let shortest = rows.iter().fold(usize::MAX, |shortest, row| shortest.min(row.len()));
    let words = out.len().min(shortest.saturating_sub(6)) / 4;
    if words == 0 {
        return 0;
    }
    let [top, upper, middle, lower, bottom] = rows.map(<[u8]>::as_ptr);
    // SAFETY: each round reads four bytes of every row at up to six bytes from `x` on, and writes as many codes; rows were seen to be
    // six bytes longer than what is written. `build.rs` guarantees that the processor has the instructions.
    unsafe {
        asm!(
            // A byte of the middle that is greater leaves no carry, and its bit is set; the last bit comes first.
            "2:",
            "ldr {centre}, [{middle}, #3]",
            "ldr {grey}, [{bottom}, #3]",
            "usub8 {grey}, {grey}, {centre}",
            "sel {codes}, {zero}, {bits}",
            "ldr {grey}, [{top}, #3]",
            "usub8 {grey}, {grey}, {centre}",
            "sel {grey}, {zero}, {bits}",
            "orr {codes}, {grey}, {codes}, lsl #1",
            "ldr {grey}, [{middle}, #6]",
            "usub8 {grey}, {grey}, {centre}",
            "sel {grey}, {zero}, {bits}",
            "orr {codes}, {grey}, {codes}, lsl #1",
            "ldr {grey}, [{middle}], #4",
            "usub8 {grey}, {grey}, {centre}",
            "sel {grey}, {zero}, {bits}",
            "orr {codes}, {grey}, {codes}, lsl #1",
            "ldr {grey}, [{lower}, #5]",
            "usub8 {grey}, {grey}, {centre}",
            "sel {grey}, {zero}, {bits}",
            "orr {codes}, {grey}, {codes}, lsl #1",
            "ldr {grey}, [{lower}, #1]",
            "usub8 {grey}, {grey}, {centre}",
            "sel {grey}, {zero}, {bits}",
            "orr {codes}, {grey}, {codes}, lsl #1",
            "ldr {grey}, [{upper}, #5]",
            "usub8 {grey}, {grey}, {centre}",
            "sel {grey}, {zero}, {bits}",
            "orr {codes}, {grey}, {codes}, lsl #1",
            "ldr {grey}, [{upper}, #1]",
            "usub8 {grey}, {grey}, {centre}",
            "sel {grey}, {zero}, {bits}",
            "orr {codes}, {grey}, {codes}, lsl #1",
            "str {codes}, [{out}], #4",
            "add {top}, {top}, #4",
            "add {upper}, {upper}, #4",
            "add {lower}, {lower}, #4",
            "add {bottom}, {bottom}, #4",
            "cmp {out}, {end}",
            "bne 2b",
            top = inout(reg) top => _,
            upper = inout(reg) upper => _,
            middle = inout(reg) middle => _,
            lower = inout(reg) lower => _,
            bottom = inout(reg) bottom => _,
            out = inout(reg) out.as_mut_ptr() => _,
            end = in(reg) out.as_mut_ptr().add(4 * words),
            zero = in(reg) 0,
            bits = in(reg) 0x0101_0101,
            centre = out(reg) _,
            grey = out(reg) _,
            codes = out(reg) _,
            options(nostack),
        );
    }
    4 * words
}
