//! Frames: how one message travels over a byte stream that may lose, damage or invent bytes.
//!
//! ```text
//! COBS( version u8 | sequence u16 LE | body (postcard) | CRC-32 LE of all before ) 0x00
//! ```
//! The head and the checksum stay as they are in every protocol version, so that a device can
//! refuse a version that it does not speak in words that the other side understands. The checksum
//! is CRC-32/ISO-HDLC (zlib's).
//!
//! Sequence 0 belongs to refusals of frames whose own number could not be read; requests have any
//! other. Delimiters with nothing between them are skipped in silence, so a sender may begin with
//! one to cut off what an earlier peer left unfinished.

use crc::{CRC_32_ISO_HDLC, Crc, Table};
use serde::{Serialize, de::DeserializeOwned};

use crate::cobs;
use crate::protocol::{PROTOCOL_VERSION, Refusal};

/// Ends every frame.
pub const DELIMITER: u8 = 0;

/// Longest message: head, body and checksum, bytes. A full batch of points takes below 1000.
pub const MAX_MESSAGE: usize = 1024;

/// Longest frame on the wire, its delimiter included, bytes.
pub const MAX_FRAME: usize = cobs::max_encoded_length(MAX_MESSAGE) + 1;

/// The sequence number of a reply to a frame whose own could not be read.
pub const NO_SEQUENCE: u16 = 0;

const HEAD_LENGTH: usize = 3;
const CHECKSUM_LENGTH: usize = 4;
/// One 1 KiB table on a device; sixteen, which take sixteen bytes at a time, where there is memory.
type Tables = Table<
    {
        if cfg!(feature = "wide-checksum") {
            16
        } else {
            1
        }
    },
>;
static CHECKSUM: Crc<u32, Tables> = Crc::<u32, Tables>::new(&CRC_32_ISO_HDLC);

/// CRC-32/ISO-HDLC (zlib's) of `bytes`: of frames, of blobs under way, of commit records.
pub fn checksum(bytes: &[u8]) -> u32 {
    CHECKSUM.checksum(bytes)
}

/// The same, piece by piece.
pub struct RunningChecksum(crc::Digest<'static, u32, Tables>);

impl Default for RunningChecksum {
    /// Of no bytes yet.
    fn default() -> Self {
        Self(CHECKSUM.digest())
    }
}

impl RunningChecksum {
    /// Takes more bytes in.
    pub fn add(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }

    /// The checksum of all of them.
    pub fn finish(self) -> u32 {
        self.0.finalize()
    }
}

/// A refusal together with the sequence number to answer it under.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rejected {
    /// The number of the refused frame, or [`NO_SEQUENCE`].
    pub sequence: u16,
    /// Why it was refused.
    pub refusal: Refusal,
}

/// A message taken out of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Received<Body> {
    /// The sender's number.
    pub sequence: u16,
    /// The message.
    pub body: Body,
}

/// Packs messages into frames, in a buffer of its own.
#[derive(Debug)]
pub struct FrameWriter {
    message: [u8; MAX_MESSAGE],
    frame: [u8; MAX_FRAME],
}

impl Default for FrameWriter {
    fn default() -> Self {
        Self::new()
    }
}

impl FrameWriter {
    /// An empty one.
    pub const fn new() -> Self {
        Self {
            message: [0; MAX_MESSAGE],
            frame: [0; MAX_FRAME],
        }
    }

    /// The frame of `body` with its delimiter, or `None` if the message is longer than
    /// [`MAX_MESSAGE`]: no message of [`crate::protocol`] is, which a test there shows.
    pub fn seal<Body: Serialize>(&mut self, sequence: u16, body: &Body) -> Option<&[u8]> {
        let [low, high] = sequence.to_le_bytes();
        let (head, rest) = self.message.split_first_chunk_mut::<HEAD_LENGTH>()?;
        *head = [PROTOCOL_VERSION, low, high];
        let body_length = postcard::to_slice(body, rest).ok()?.len();

        let checked_length = HEAD_LENGTH + body_length;
        let checksum = CHECKSUM.checksum(self.message.get(..checked_length)?);
        let length = checked_length + CHECKSUM_LENGTH;
        let checksum_place = self.message.get_mut(checked_length..length)?;
        for (place, byte) in checksum_place.iter_mut().zip(checksum.to_le_bytes()) {
            *place = byte;
        }

        let encoded_length = cobs::encode(self.message.get(..length)?, &mut self.frame)?;
        *self.frame.get_mut(encoded_length)? = DELIMITER;
        self.frame(encoded_length + 1)
    }

    /// The frame sealed last, whose length it was.
    pub(crate) fn frame(&self, length: usize) -> Option<&[u8]> {
        self.frame.get(..length)
    }
}

/// Collects bytes until a delimiter and takes the message out, in a buffer of its own.
#[derive(Debug)]
pub struct FrameReader {
    buffer: [u8; MAX_FRAME],
    length: usize,
    overflowed: bool,
}

impl Default for FrameReader {
    fn default() -> Self {
        Self::new()
    }
}

impl FrameReader {
    /// An empty one.
    pub const fn new() -> Self {
        Self {
            buffer: [0; MAX_FRAME],
            length: 0,
            overflowed: false,
        }
    }

    /// Takes in one byte. `None` while a frame is under way; at its delimiter the message, or why
    /// it is refused.
    ///
    /// A frame that does not fit is dropped up to its delimiter and then refused as oversized,
    /// once.
    pub fn push<Body: DeserializeOwned>(
        &mut self,
        byte: u8,
    ) -> Option<Result<Received<Body>, Rejected>> {
        if byte != DELIMITER {
            match self.buffer.get_mut(self.length) {
                Some(place) => {
                    *place = byte;
                    self.length += 1;
                }
                None => self.overflowed = true,
            }
            return None;
        }
        let length = core::mem::take(&mut self.length);
        if core::mem::take(&mut self.overflowed) {
            let refusal = Refusal::Oversized {
                limit: MAX_FRAME as u16,
            };
            return Some(Err(Rejected {
                sequence: NO_SEQUENCE,
                refusal,
            }));
        }
        if length == 0 {
            return None;
        }
        Some(open(self.buffer.get_mut(..length)?))
    }
}

/// Takes the message out of a frame without its delimiter.
fn open<Body: DeserializeOwned>(frame: &mut [u8]) -> Result<Received<Body>, Rejected> {
    let unreadable = |refusal| Rejected {
        sequence: NO_SEQUENCE,
        refusal,
    };
    let length = cobs::decode_in_place(frame).ok_or(unreadable(Refusal::BadFrame))?;
    let message = frame.get(..length).ok_or(unreadable(Refusal::BadFrame))?;
    let (checked, checksum) = message
        .split_last_chunk::<CHECKSUM_LENGTH>()
        .ok_or(unreadable(Refusal::BadFrame))?;
    let (&[version, low, high], body) = checked
        .split_first_chunk::<HEAD_LENGTH>()
        .ok_or(unreadable(Refusal::BadFrame))?;
    if CHECKSUM.checksum(checked) != u32::from_le_bytes(*checksum) {
        return Err(unreadable(Refusal::BadChecksum));
    }
    let sequence = u16::from_le_bytes([low, high]);
    if version != PROTOCOL_VERSION {
        let refusal = Refusal::WrongVersion {
            found: version,
            supported: PROTOCOL_VERSION,
        };
        return Err(Rejected { sequence, refusal });
    }
    match postcard::take_from_bytes(body) {
        Ok((body, [])) => Ok(Received { sequence, body }),
        _ => Err(Rejected {
            sequence,
            refusal: Refusal::UnknownMessage,
        }),
    }
}

#[cfg(test)]
mod tests;
