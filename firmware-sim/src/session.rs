//! One conversation over one link: frames in, the application's answers out.
//!
//! Whatever comes in, each of these gets exactly one answer, and nothing else gets any:
//! - a whole frame: its reply, or a [`Reply::Refused`] under its own sequence number;
//! - bytes up to a delimiter that are no frame (damaged, truncated, oversized): a
//!   [`Reply::Refused`] under [`NO_SEQUENCE`](crate::frame::NO_SEQUENCE).
//!
//! A delimiter right behind another is silence, and a frame whose delimiter never comes is waited
//! for.

use crate::frame::{FrameReader, FrameWriter, Received, Rejected};
use crate::port::Link;
use crate::protocol::{Refusal, Reply, Request};

/// Answers requests: the application behind a session.
pub trait Responder {
    /// The answer to `request`.
    fn respond(&mut self, request: &Request) -> Reply;

    /// Takes note of a frame that was refused before it became a request.
    fn note_refused(&mut self, refusal: Refusal);
}

/// The frame buffers of one link; about 3 KiB, with no allocation.
#[derive(Debug, Default)]
pub struct Session {
    reader: FrameReader,
    writer: FrameWriter,
}

impl Session {
    /// A session before its first byte.
    pub const fn new() -> Self {
        Self {
            reader: FrameReader::new(),
            writer: FrameWriter::new(),
        }
    }

    /// Takes in one byte and returns the frame to send for it, if any.
    pub fn feed(&mut self, byte: u8, responder: &mut impl Responder) -> Option<&[u8]> {
        let (sequence, reply) = match self.reader.push(byte)? {
            Ok(Received { sequence, body }) => (sequence, responder.respond(&body)),
            Err(Rejected { sequence, refusal }) => {
                responder.note_refused(refusal);
                (sequence, Reply::Refused(refusal))
            }
        };
        self.writer.seal(sequence, &reply)
    }

    /// Converses until the other side closes the link.
    ///
    /// # Errors
    /// If the link broke.
    pub fn serve<L: Link>(
        &mut self,
        link: &mut L,
        responder: &mut impl Responder,
    ) -> Result<(), L::Error> {
        let mut arrived = [0; 64];
        loop {
            let count = link.read(&mut arrived)?;
            if count == 0 {
                return Ok(());
            }
            for &byte in arrived.iter().take(count) {
                if let Some(frame) = self.feed(byte, responder) {
                    link.write_all(frame)?;
                }
            }
        }
    }
}
