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

    /// Whether somebody else must answer from now on: another blob became active.
    fn is_over(&self) -> bool;
}

/// The frame buffers of one link; about 3 KiB, with no allocation. It outlives the responders, so that
/// nothing that has arrived is lost between two of them.
#[derive(Debug, Default)]
pub struct Session {
    reader: FrameReader,
    writer: FrameWriter,
    arrived: Arrived,
}

/// Bytes that have arrived and were not looked at yet.
#[derive(Debug)]
struct Arrived {
    bytes: [u8; 64],
    start: usize,
    end: usize,
}

impl Default for Arrived {
    fn default() -> Self {
        Self::new()
    }
}

impl Arrived {
    const fn new() -> Self {
        Self {
            bytes: [0; 64],
            start: 0,
            end: 0,
        }
    }

    fn next(&mut self) -> Option<u8> {
        let byte = *self.bytes.get(self.start..self.end)?.first()?;
        self.start += 1;
        Some(byte)
    }
}

/// Why a conversation paused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Paused {
    /// The other side closed the link.
    Closed,
    /// [`Responder::is_over`].
    Over,
}

impl Session {
    /// A session before its first byte.
    pub const fn new() -> Self {
        Self {
            reader: FrameReader::new(),
            writer: FrameWriter::new(),
            arrived: Arrived::new(),
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

    /// Converses until the other side closes the link, or until this responder's time is over.
    ///
    /// # Errors
    /// If the link broke.
    pub fn serve<L: Link>(
        &mut self,
        link: &mut L,
        responder: &mut impl Responder,
    ) -> Result<Paused, L::Error> {
        loop {
            while let Some(byte) = self.arrived.next() {
                if let Some(frame) = self.feed(byte, responder) {
                    link.write_all(frame)?;
                }
                if responder.is_over() {
                    return Ok(Paused::Over);
                }
            }
            self.arrived.start = 0;
            self.arrived.end = link.read(&mut self.arrived.bytes)?;
            if self.arrived.end == 0 {
                return Ok(Paused::Closed);
            }
        }
    }
}
