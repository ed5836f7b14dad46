//! Consistent Overhead Byte Stuffing: any bytes become bytes without a zero, so that a zero can end
//! a frame.
//!
//! Each block starts with a code byte `c`: `c - 1` bytes follow as they are, and unless `c` is 255
//! or the frame ends there, a zero stands behind them (Cheshire and Baker, 1997). The cost is one
//! byte, plus one for every 254 bytes without a zero.
//!
//! Written here because the crate that `postcard` brings for it links a panic into the device
//! image; all access below goes through `get`, so that none is reachable.

/// The code byte of a block of 254 bytes with no zero behind it.
const FULL_BLOCK: u8 = 0xff;

/// The longest encoding of `length` bytes, the final zero not counted.
pub const fn max_encoded_length(length: usize) -> usize {
    length + length / 254 + 1
}

/// Encodes `message` into `out` and returns how many bytes were written: never a zero among them,
/// and no delimiter at the end. `None` if `out` is too short; [`max_encoded_length`] always
/// suffices.
///
/// # Example
/// ```
/// let mut out = [0; 8];
/// assert_eq!(ray_device::cobs::encode(&[0x11, 0x00, 0x22], &mut out), Some(4));
/// assert_eq!(out[..4], [0x02, 0x11, 0x02, 0x22]);
/// ```
pub fn encode(message: &[u8], out: &mut [u8]) -> Option<usize> {
    let mut code_at = 0;
    let mut write_at = 1;
    let mut code = 1_u8;
    let mut bytes = message.iter().peekable();
    while let Some(&byte) = bytes.next() {
        if byte != 0 {
            *out.get_mut(write_at)? = byte;
            write_at += 1;
            code = code.wrapping_add(1);
        }
        let block_is_full = code == FULL_BLOCK && bytes.peek().is_some();
        if byte == 0 || block_is_full {
            *out.get_mut(code_at)? = code;
            code_at = write_at;
            write_at += 1;
            code = 1;
        }
    }
    *out.get_mut(code_at)? = code;
    Some(write_at)
}

/// Decodes `frame` (without its delimiter) in place and returns the length of the message, which
/// then stands at its start. `None` if the bytes are no encoding: a zero inside, or a block longer
/// than the frame.
pub fn decode_in_place(frame: &mut [u8]) -> Option<usize> {
    let mut read_at = 0;
    let mut write_at = 0;
    while let Some(&code) = frame.get(read_at) {
        read_at += 1;
        for _ in 0..code.checked_sub(1)? {
            let byte = *frame.get(read_at)?;
            if byte == 0 {
                return None;
            }
            *frame.get_mut(write_at)? = byte;
            read_at += 1;
            write_at += 1;
        }
        if code != FULL_BLOCK && read_at < frame.len() {
            *frame.get_mut(write_at)? = 0;
            write_at += 1;
        }
    }
    Some(write_at)
}

#[cfg(test)]
mod tests {
    use super::{decode_in_place, encode, max_encoded_length};

    fn encoded(message: &[u8]) -> Vec<u8> {
        let mut out = vec![0xaa; max_encoded_length(message.len())];
        let length = encode(message, &mut out).expect("the stated maximum suffices");
        out.truncate(length);
        out
    }

    fn decoded(frame: &[u8]) -> Option<Vec<u8>> {
        let mut bytes = frame.to_vec();
        let length = decode_in_place(&mut bytes)?;
        bytes.truncate(length);
        Some(bytes)
    }

    /// The worked examples that go round with the algorithm, the 254-byte boundary among them.
    #[test]
    fn known_encodings() {
        assert_eq!(encoded(&[]), [0x01]);
        assert_eq!(encoded(&[0x00]), [0x01, 0x01]);
        assert_eq!(encoded(&[0x00, 0x00]), [0x01, 0x01, 0x01]);
        assert_eq!(
            encoded(&[0x11, 0x22, 0x00, 0x33]),
            [0x03, 0x11, 0x22, 0x02, 0x33]
        );
        assert_eq!(
            encoded(&[0x11, 0x00, 0x00, 0x00]),
            [0x02, 0x11, 0x01, 0x01, 0x01]
        );

        let run_254: Vec<u8> = (1..=254).collect();
        let mut expected = vec![0xff];
        expected.extend_from_slice(&run_254);
        assert_eq!(encoded(&run_254), expected);

        let zero_then_254: Vec<u8> = (0..=254).collect();
        let mut expected = vec![0x01, 0xff];
        expected.extend_from_slice(&run_254);
        assert_eq!(encoded(&zero_then_254), expected);

        let run_255: Vec<u8> = (1..=255).collect();
        let mut expected = vec![0xff];
        expected.extend_from_slice(&run_254);
        expected.extend_from_slice(&[0x02, 0xff]);
        assert_eq!(encoded(&run_255), expected);

        let mut run_254_then_zero = run_254.clone();
        run_254_then_zero.push(0);
        let mut expected = vec![0xff];
        expected.extend_from_slice(&run_254);
        expected.extend_from_slice(&[0x01, 0x01]);
        assert_eq!(encoded(&run_254_then_zero), expected);
    }

    #[test]
    fn every_length_and_position_of_a_zero_comes_back() {
        for length in 0..600 {
            let mut message: Vec<u8> = (0..length).map(|k| (k % 255) as u8 + 1).collect();
            assert_eq!(decoded(&encoded(&message)).as_deref(), Some(&message[..]));
            for zero_at in [0, length / 2, 253, 254, 255, 508] {
                if let Some(byte) = message.get_mut(zero_at) {
                    *byte = 0;
                }
                let frame = encoded(&message);
                assert!(
                    !frame.contains(&0),
                    "a zero inside the frame of {length} bytes"
                );
                assert_eq!(decoded(&frame).as_deref(), Some(&message[..]));
            }
        }
    }

    #[test]
    fn a_short_buffer_is_refused_at_every_length() {
        let message: Vec<u8> = (0..300).map(|k| (k % 7) as u8).collect();
        let needed = encoded(&message).len();
        for length in 0..needed {
            assert_eq!(encode(&message, &mut vec![0; length]), None);
        }
    }

    #[test]
    fn what_is_no_encoding_is_refused() {
        assert_eq!(decoded(&[0x00]), None, "a zero code byte");
        assert_eq!(
            decoded(&[0x03, 0x11]),
            None,
            "a block longer than the frame"
        );
        assert_eq!(decoded(&[0x03, 0x11, 0x00]), None, "a zero inside a block");
        assert_eq!(decoded(&[]), Some(vec![]));
    }
}
