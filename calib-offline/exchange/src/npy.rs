//! Arrays as files of `NumPy`: format version 1.0, little-endian, C order.
//!
//! Quirks. The header is padded with blanks so that numbers begin at a multiple of 64 bytes, and ends with a line feed. A shape of one number
//! needs its comma.

/// A file of an array. `dtype` is `NumPy`'s name of the numbers, such as `<f4`; `bytes` are the numbers, in C order.
pub(super) fn file(dtype: &str, shape: &[usize], bytes: &[u8]) -> Vec<u8> {
    let sizes: Vec<String> = shape.iter().map(usize::to_string).collect();
    let mut header = format!(
        "{{'descr': '{dtype}', 'fortran_order': False, 'shape': ({},), }}",
        sizes.join(", ")
    );
    // Magic, version and length take 10 bytes.
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend((header.len() as u16).to_le_bytes());
    file.extend(header.as_bytes());
    file.extend(bytes);
    file
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_begin_at_a_multiple_of_64() {
        let bytes = file("<u2", &[3], &[1, 0, 2, 0, 3, 0]);
        assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
        let start = bytes.len() - 6;
        assert_eq!(start % 64, 0);
        assert_eq!(
            usize::from(u16::from_le_bytes([bytes[8], bytes[9]])),
            start - 10
        );
        let header = std::str::from_utf8(&bytes[10..start]).unwrap();
        assert!(header.starts_with("{'descr': '<u2', 'fortran_order': False, 'shape': (3,), }"));
        assert!(header.ends_with('\n'));
    }
}
