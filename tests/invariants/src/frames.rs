//! The checksum of the wire, bit by bit, as the standard defines it.

/// CRC-8 SAE J1850: polynomial 0x1D, most significant bit first.
fn crc(start: u8, bytes: impl IntoIterator<Item = u8>) -> u8 {
    bytes.into_iter().fold(start, |crc, byte| {
        (0..8).fold(crc ^ byte, |crc, _| if crc & 0x80 == 0 { crc << 1 } else { crc << 1 ^ 0x1D })
    })
}

/// Whether the bytes under an identifier carry the protection of E2E profile 11C that belongs to them: a checksum over the low byte
/// of the identifier, a zero and all bytes but the first; the bits 8 to 11 of the identifier; a counter up to 14.
pub(crate) fn is_protected(raw_id: u16, data: &[u8]) -> bool {
    let [Some(sum), Some(second)] = [0, 1].map(|i| data.get(i).copied()) else { return false };
    let covered = [raw_id as u8, 0].into_iter().chain(data.iter().skip(1).copied());
    sum == crc(0, covered) && second >> 4 == (raw_id >> 8) as u8 && second & 0x0F < 15
}

/// Whether the checksum alone is right.
pub(crate) fn has_checksum(raw_id: u16, data: &[u8]) -> bool {
    let covered = [raw_id as u8, 0].into_iter().chain(data.iter().skip(1).copied());
    data.first() == Some(&crc(0, covered))
}
