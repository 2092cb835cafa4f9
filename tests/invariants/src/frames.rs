//! The checksum of the wire, bit by bit, as the standard defines it.

/// What a byte makes of the checksum, computed bit by bit when this is compiled.
const OF_BYTE: [u8; 256] = {
    let mut table = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let (mut crc, mut bit) = (byte as u8, 0);
        while bit < 8 {
            crc = if crc & 0x80 == 0 { crc << 1 } else { crc << 1 ^ 0x1D };
            bit += 1;
        }
        table[byte] = crc;
        byte += 1;
    }
    table
};

/// CRC-8 SAE J1850: polynomial 0x1D, most significant bit first; of the low byte of an identifier, a zero and all bytes of a frame
/// but the first.
pub(crate) fn sum(raw_id: u16, data: &[u8]) -> u8 {
    let of = |crc: u8| OF_BYTE[usize::from(crc)];
    data.iter().skip(1).fold(of(of(raw_id as u8)), |crc, byte| of(crc ^ byte))
}

/// Whether the bytes under an identifier carry the protection of E2E profile 11C that belongs to them: a checksum over the low byte
/// of the identifier, a zero and all bytes but the first; the bits 8 to 11 of the identifier; a counter up to 14.
pub(crate) fn is_protected(raw_id: u16, data: &[u8]) -> bool {
    let Some(second) = data.get(1).copied() else { return false };
    data[0] == sum(raw_id, data) && second >> 4 == (raw_id >> 8) as u8 && second & 0x0F < 15
}

/// Whether the checksum alone is right.
pub(crate) fn has_checksum(raw_id: u16, data: &[u8]) -> bool {
    data.first() == Some(&sum(raw_id, data))
}

/// Protects the bytes under an identifier as they should be, but with any counter: 15 is never sent.
pub(crate) fn forge(raw_id: u16, counter: u8, data: &mut [u8]) {
    let [_, second, ..] = data else { return };
    *second = ((raw_id >> 8) as u8 & 0x0F) << 4 | counter & 0x0F;
    data[0] = sum(raw_id, data);
}
