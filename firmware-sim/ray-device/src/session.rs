//! One conversation over one link: frames in, the application's answers out.
//!
//! Whatever comes in, each of these gets exactly one answer, and nothing else gets any:
//! - a whole frame: its reply, or a [`Reply::Refused`] under its own sequence number;
//! - bytes up to a delimiter that are no frame (damaged, truncated, oversized): a
//!   [`Reply::Refused`] under [`NO_SEQUENCE`](crate::frame::NO_SEQUENCE).
//!
//! A delimiter right behind another is silence, and a frame whose delimiter never comes is waited
//! for.

#[cfg(feature = "embedded-io-async")]
use embedded_io_async::{Read, Write};

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

    /// After a read of so many bytes; whether there were any.
    fn restart(&mut self, count: usize) -> bool {
        self.start = 0;
        self.end = count;
        count > 0
    }
}

/// Why a conversation paused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
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

    /// Looks at what has arrived, up to the first frame to send.
    fn advance(&mut self, responder: &mut impl Responder) -> Next<'_> {
        // A frame that a loop returns would stay borrowed in all its turns, so the loop asks for its length.
        let mut length = None;
        while !responder.is_over()
            && length.is_none()
            && let Some(byte) = self.arrived.next()
        {
            length = self.feed(byte, responder).map(<[u8]>::len);
        }
        match length.and_then(|length| self.writer.frame(length)) {
            Some(frame) => Next::Send(frame),
            None if responder.is_over() => Next::Pause,
            None => Next::Read(&mut self.arrived),
        }
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
            match self.advance(responder) {
                Next::Send(frame) => link.write_all(frame)?,
                Next::Read(arrived) => {
                    let count = link.read(&mut arrived.bytes)?;
                    if !arrived.restart(count) {
                        return Ok(Paused::Closed);
                    }
                }
                Next::Pause => return Ok(Paused::Over),
            }
        }
    }

    /// The same over an asynchronous stream, beside whatever else the executor runs. It waits for bytes and for their
    /// sending; what a request takes it takes at once, the erasing of a block included.
    ///
    /// It may be dropped at any of its waits, as `select` does. A frame that was being sent then is lost, and
    /// its request is answered when it is sent again.
    ///
    /// # Errors
    /// If the stream broke.
    #[cfg(feature = "embedded-io-async")]
    pub async fn serve_async<L: Read + Write>(
        &mut self,
        link: &mut L,
        responder: &mut impl Responder,
    ) -> Result<Paused, L::Error> {
        loop {
            match self.advance(responder) {
                Next::Send(frame) => {
                    link.write_all(frame).await?;
                    link.flush().await?;
                }
                Next::Read(arrived) => {
                    let count = link.read(&mut arrived.bytes).await?;
                    if !arrived.restart(count) {
                        return Ok(Paused::Closed);
                    }
                }
                Next::Pause => return Ok(Paused::Over),
            }
        }
    }
}

/// What a conversation does next.
enum Next<'a> {
    Send(&'a [u8]),
    /// Everything was looked at.
    Read(&'a mut Arrived),
    Pause,
}

#[cfg(all(test, feature = "embedded-io", feature = "embedded-io-async"))]
mod tests;
