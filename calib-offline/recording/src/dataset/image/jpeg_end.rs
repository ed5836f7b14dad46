//! Whether a JPEG file goes on to its end: decoders fill what is missing with gray and say nothing.

/// Whether the file ends before the image's end-of-image marker (ITU-T T.81, B.1.1 and B.2). `false` for a file
/// that is no JPEG, or whose markers cannot be followed.
pub(super) fn is_cut_off(bytes: &[u8]) -> bool {
    const START: u8 = 0xd8;
    const END: u8 = 0xd9;
    const SCAN: u8 = 0xda;
    if !bytes.starts_with(&[0xff, START]) {
        return false;
    }
    let mut at = 2;
    loop {
        // A marker, with any number of fill bytes before it.
        let Some(code) = bytes.get(at..).and_then(next_marker) else {
            return true;
        };
        at += code.0;
        match code.1 {
            END => return false,
            // Without a length.
            0x01 | START | 0xd0..=0xd7 => {}
            marker => {
                let Some(length) = bytes.get(at..at + 2) else {
                    return true;
                };
                at += usize::from(u16::from_be_bytes([length[0], length[1]]));
                if at > bytes.len() {
                    return true;
                }
                if marker == SCAN {
                    at += scan_len(&bytes[at..]);
                }
            }
        }
    }
}

/// Bytes up to and with the next marker, and its code.
fn next_marker(bytes: &[u8]) -> Option<(usize, u8)> {
    let start = bytes.iter().position(|byte| *byte == 0xff)?;
    let code = bytes[start..].iter().position(|byte| *byte != 0xff)?;
    Some((start + code + 1, bytes[start + code]))
}

/// Bytes of entropy-coded data: up to a marker that is no restart and no stuffed zero.
fn scan_len(bytes: &[u8]) -> usize {
    let is_end = |pair: &[u8]| pair[0] == 0xff && !matches!(pair[1], 0x00 | 0xd0..=0xd7 | 0xff);
    bytes.windows(2).position(is_end).unwrap_or(bytes.len())
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{ExtendedColorType, ImageEncoder, codecs::jpeg::JpegEncoder};

    #[test]
    fn a_file_cut_anywhere_is_cut_off_and_a_whole_one_is_not() {
        let pixels: Vec<u8> = (0..64 * 64).map(|k| (k * 37 % 251) as u8).collect();
        let mut bytes = Vec::new();
        JpegEncoder::new_with_quality(&mut bytes, 90)
            .write_image(&pixels, 64, 64, ExtendedColorType::L8)
            .unwrap();
        assert!(!is_cut_off(&bytes));
        for length in 2..bytes.len() {
            assert!(is_cut_off(&bytes[..length]), "{length} of {}", bytes.len());
        }
        // Cameras append a preview, or padding.
        bytes.extend([0, 0, 0xff, 0xd8, 7]);
        assert!(!is_cut_off(&bytes));
        assert!(!is_cut_off(b"P5 2 2 255 abcd"));
    }
}
