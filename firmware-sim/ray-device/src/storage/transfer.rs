//! A blob on its way into the inactive slot.

use embedded_storage::nor_flash::NorFlash;
use ray_runtime::OpenError;
use ray_runtime::format::HEADER_LEN;

use super::log::{Log, Record, erase_block};
use super::trust::Trust;
use super::{blob_bytes, blob_of, max_blob, program, rig};
use crate::port::{MappedFlash, UNIT};
use crate::protocol::{Chunk, FlashOperation, NewBlob, Refusal, Rig, RigPart, UpdateStatus};

/// Who asks: one number for each link, or each connection.
pub type Peer = u32;

/// A transfer that its peer has left alone for so long may be given up for another peer's, ms.
pub const SILENCE_MS: u64 = 5000;

/// Whose device it is.
#[derive(Clone, Copy, Debug)]
pub struct Owner<'a> {
    /// Its own cameras, if it knows them.
    pub rig: Option<&'a Rig>,
    /// Whose blobs it takes.
    pub trust: Trust,
}

/// A blob under way.
#[derive(Clone, Debug)]
pub struct Transfer {
    new: NewBlob,
    peer: Peer,
    received: u32,
    /// Where the chunk stored last starts.
    last_offset: u32,
    last_active_ms: u64,
}

/// The new blob, whole and checked, with the record that will make it count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Checked {
    /// Length of the blob, bytes.
    pub length: u32,
    /// Its checksum.
    pub checksum: u32,
}

impl Transfer {
    /// Starts one: checks what was announced and erases the log of the slot, so that nothing in it
    /// counts any more.
    ///
    /// # Errors
    /// [`Refusal::TooLong`], [`Refusal::NotABlob`], [`Refusal::OtherRig`], [`Refusal::NotSigned`],
    /// [`Refusal::FlashFailed`].
    pub fn begin<R: NorFlash>(
        slot: &mut R,
        new: &NewBlob,
        peer: Peer,
        owner: &Owner<'_>,
        now_ms: u64,
    ) -> Result<Self, Refusal> {
        let limit = max_blob(slot);
        if new.length > limit {
            return Err(Refusal::TooLong { limit });
        }
        if new.length < HEADER_LEN as u32 {
            let truncated = OpenError::Truncated {
                need: HEADER_LEN as u32,
                have: new.length,
            };
            return Err(Refusal::NotABlob {
                open_error: truncated.code(),
            });
        }
        if let (Some(serial), Some(own)) = (&new.rig_serial, owner.rig)
            && *serial != own.serial
        {
            return Err(Refusal::OtherRig {
                camera: 0,
                what: RigPart::Serial,
                expected: 0,
                found: 0,
            });
        }
        if owner.trust.needs_signature() && new.signature.is_none() {
            return Err(Refusal::NotSigned);
        }
        erase_block(slot, 0)?;
        Ok(Self {
            new: new.clone(),
            peer,
            received: 0,
            last_offset: 0,
            last_active_ms: now_ms,
        })
    }

    /// Whether this is the same blob, so that its transfer may go on.
    pub fn is_of(&self, new: &NewBlob) -> bool {
        self.new == *new
    }

    /// Goes on with this peer; how much has been stored.
    pub fn resume(&mut self, peer: Peer, now_ms: u64) -> u32 {
        self.peer = peer;
        self.last_active_ms = now_ms;
        self.received
    }

    /// Whether another peer's transfer stands in the way of this one, and for how long yet.
    ///
    /// # Errors
    /// [`Refusal::Busy`].
    pub fn make_way(&self, peer: Peer, now_ms: u64) -> Result<(), Refusal> {
        let silent_ms = now_ms.saturating_sub(self.last_active_ms);
        match SILENCE_MS.checked_sub(silent_ms) {
            Some(wait_ms) if peer != self.peer && wait_ms > 0 => Err(Refusal::Busy {
                wait_ms: wait_ms as u32,
            }),
            _ => Ok(()),
        }
    }

    /// Whether this peer may go on.
    ///
    /// # Errors
    /// [`Refusal::NoUpdate`].
    pub fn check_peer(&self, peer: Peer) -> Result<(), Refusal> {
        if peer == self.peer {
            Ok(())
        } else {
            Err(Refusal::NoUpdate)
        }
    }

    /// How far it has come.
    pub fn status(&self) -> UpdateStatus {
        UpdateStatus {
            length: self.new.length,
            received: self.received,
            identity: self.new.identity,
        }
    }

    /// Stores a chunk; how much has been stored then.
    ///
    /// # Errors
    /// [`Refusal::WrongOffset`] and [`Refusal::BadChunk`], after which the transfer can go on;
    /// [`Refusal::FlashFailed`], after which it cannot.
    #[inline(never)]
    pub fn store<R: MappedFlash>(
        &mut self,
        slot: &mut R,
        chunk: &Chunk,
        now_ms: u64,
    ) -> Result<u32, Refusal> {
        self.last_active_ms = now_ms;
        if chunk.offset != self.received {
            if self.is_repeat(slot, chunk) {
                return Ok(self.received);
            }
            return Err(Refusal::WrongOffset {
                expected: self.received,
            });
        }
        let length = chunk.bytes.len() as u32;
        let missing = self.new.length.saturating_sub(self.received);
        if length == 0
            || length > missing
            || (length < missing && !length.is_multiple_of(UNIT as u32))
        {
            return Err(Refusal::BadChunk { missing });
        }
        let block = R::ERASE_SIZE as u32;
        let start = block.saturating_add(chunk.offset);
        let end = start.saturating_add(length);
        // Each block is erased when the first byte for it comes.
        let mut boundary = start.next_multiple_of(block);
        while boundary < end {
            erase_block(slot, boundary)?;
            boundary = boundary.saturating_add(block);
        }
        program(slot, start, &chunk.bytes)?;
        self.last_offset = chunk.offset;
        self.received = self.received.saturating_add(length);
        Ok(self.received)
    }

    /// Whether this chunk is the one stored last, sent again because its answer was lost.
    fn is_repeat<R: MappedFlash>(&self, slot: &R, chunk: &Chunk) -> bool {
        let end = chunk.offset.saturating_add(chunk.bytes.len() as u32);
        let stored = blob_bytes(slot, self.received).unwrap_or_default();
        chunk.offset == self.last_offset
            && end == self.received
            && stored.get(chunk.offset as usize..) == Some(&chunk.bytes)
    }

    /// Checks all that was stored: read back through the driver, then opened in place with every
    /// check of the runtime, then compared with what was announced and with the device's cameras, and
    /// its signature verified where one is asked for.
    ///
    /// # Errors
    /// [`Refusal::Incomplete`], after which the transfer can go on; otherwise why it cannot be taken.
    #[inline(never)]
    pub fn check<R: MappedFlash>(
        &self,
        slot: &mut R,
        owner: &Owner<'_>,
    ) -> Result<Checked, Refusal> {
        if self.received < self.new.length {
            return Err(Refusal::Incomplete {
                received: self.received,
            });
        }
        let stored = stored_checksum(slot, self.new.length)?;
        if stored != self.new.checksum {
            return Err(Refusal::ChecksumMismatch {
                announced: self.new.checksum,
                stored,
            });
        }
        let record = Record {
            sequence: 0,
            length: self.new.length,
            checksum: stored,
        };
        let blob = blob_of(slot, record).map_err(|error| Refusal::NotABlob {
            open_error: error.code(),
        })?;
        if *blob.identity() != self.new.identity {
            return Err(Refusal::OtherIdentity);
        }
        if let Some(own) = owner.rig {
            rig::compare(&blob, own)?;
        }
        let bytes = blob_bytes(slot, self.new.length).unwrap_or_default();
        owner.trust.check(bytes, self.new.signature.as_ref())?;
        Ok(Checked {
            length: self.new.length,
            checksum: stored,
        })
    }
}

impl Checked {
    /// Makes the blob count from now on, under this sequence number.
    ///
    /// # Errors
    /// [`Refusal::LogFull`] if there is no number left, [`Refusal::FlashFailed`].
    pub fn commit<R: NorFlash>(self, slot: &mut R, sequence: Option<u32>) -> Result<u32, Refusal> {
        let sequence = sequence.ok_or(Refusal::LogFull)?;
        let record = Record {
            sequence,
            length: self.length,
            checksum: self.checksum,
        };
        Log::commit(slot, record)?;
        Ok(sequence)
    }
}

/// The checksum of the blob as the driver reads it.
fn stored_checksum<R: NorFlash>(slot: &mut R, length: u32) -> Result<u32, Refusal> {
    let mut sum = crate::frame::RunningChecksum::default();
    let mut piece = [0; 256];
    let mut at = 0;
    while at < length {
        let address = (R::ERASE_SIZE as u32).saturating_add(at);
        let wanted = (length - at).min(piece.len() as u32);
        let Some(piece) = piece.get_mut(..wanted as usize) else {
            break;
        };
        slot.read(address, piece)
            .map_err(|_| Refusal::FlashFailed {
                operation: FlashOperation::Read,
                address,
            })?;
        sum.add(piece);
        at = at.saturating_add(wanted);
    }
    Ok(sum.finish())
}
