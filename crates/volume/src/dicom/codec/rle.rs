//! DICOM's run length encoding (PS3.5 annex G): byte planes, highest first, each in PackBits.

use super::CodecError;

/// Unpacks a frame into little-endian pixels of `bytes` bytes.
pub(in crate::dicom) fn decode(packed: &[u8], pixels: usize, bytes: usize) -> Result<Vec<u8>, CodecError> {
    let word = |n: usize| {
        let raw = packed.get(4 * n..4 * n + 4).and_then(|b| b.try_into().ok());
        raw.map_or(0, |raw| u32::from_le_bytes(raw) as usize)
    };
    if word(0) != bytes || pixels.saturating_mul(bytes) > packed.len().saturating_mul(64) {
        return Err(CodecError::Wrong("its number of byte planes does not fit the pixels"));
    }
    let mut out = vec![0; pixels * bytes];
    for plane in 0..bytes {
        let start = word(1 + plane);
        let end = if plane + 1 < bytes { word(2 + plane) } else { packed.len() };
        let segment = packed.get(start..end).unwrap_or_default();
        let place = bytes - 1 - plane;
        let written = unpack(segment, pixels, |at, value| out[at * bytes + place] = value);
        if written < pixels {
            return Err(CodecError::Short(written));
        }
    }
    Ok(out)
}

/// PackBits: n < 128 copies n + 1 bytes, n > 128 repeats the next one 257 - n times. Returns the
/// output length.
fn unpack(segment: &[u8], limit: usize, mut put: impl FnMut(usize, u8)) -> usize {
    let (mut at, mut written) = (0, 0);
    while written < limit {
        let Some(&n) = segment.get(at) else { break };
        let (count, step) = match n {
            0..128 => (usize::from(n) + 1, 1),
            128 => (0, 0),
            129.. => (257 - usize::from(n), 0),
        };
        for i in 0..count.min(limit - written) {
            let Some(&value) = segment.get(at + 1 + i * step) else { return written };
            put(written, value);
            written += 1;
        }
        at += 1 + if step == 1 { count } else { usize::from(count > 0) };
    }
    written
}
