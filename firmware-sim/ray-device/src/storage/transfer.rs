//! A blob on its way into the inactive slot.

use ray_runtime::OpenError;
use ray_runtime::format::HEADER_LEN;

use super::log::{Log, erase_log};
use super::record::{Claims, Record};
use super::slot::SlotFlash;
use super::trust::Trust;
use super::{blob_bytes, open_verified, program_blob, read_blob, rig, stored_checksum};
use crate::port::Clock;
use crate::protocol::{Chunk, NewBlob, Refusal, Rig, RigPart, UpdateStatus};

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
    pub fn begin<S: SlotFlash, C: Clock>(
        slot: &mut S,
        new: &NewBlob,
        peer: Peer,
        owner: &Owner<'_>,
        clock: &mut C,
    ) -> Result<Self, Refusal> {
        let limit = slot.max_blob(0);
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
        erase_log(slot, clock)?;
        Ok(Self {
            new: new.clone(),
            peer,
            received: 0,
            last_offset: 0,
            last_active_ms: clock.uptime_ms(),
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
    pub fn store<S: SlotFlash, C: Clock>(
        &mut self,
        slot: &mut S,
        chunk: &Chunk,
        clock: &mut C,
    ) -> Result<u32, Refusal> {
        self.last_active_ms = clock.uptime_ms();
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
            || (length < missing && length & slot.shape().blob.line().saturating_sub(1) != 0)
        {
            return Err(Refusal::BadChunk { missing });
        }
        program_blob(slot, chunk.offset, &chunk.bytes, clock)?;
        self.last_offset = chunk.offset;
        self.received = self.received.saturating_add(length);
        Ok(self.received)
    }

    /// Whether this chunk is the one stored last, sent again because its answer was lost.
    fn is_repeat<S: SlotFlash>(&self, slot: &mut S, chunk: &Chunk) -> bool {
        let end = chunk.offset.saturating_add(chunk.bytes.len() as u32);
        if chunk.offset != self.last_offset || end != self.received {
            return false;
        }
        (chunk.offset..)
            .step_by(8)
            .zip(chunk.bytes.chunks(8))
            .all(|(offset, bytes)| {
                let mut stored = [0; 8];
                read_blob(slot, offset, &mut stored).is_ok() && stored.starts_with(bytes)
            })
    }

    /// Checks all that was stored: read back through the driver, then opened in place with every
    /// check of the runtime, then compared with what was announced and with the device's cameras, and
    /// its signature verified where one is asked for.
    ///
    /// # Errors
    /// [`Refusal::Incomplete`], after which the transfer can go on; otherwise why it cannot be taken.
    #[inline(never)]
    pub fn check<S: SlotFlash, C: Clock>(
        &self,
        slot: &mut S,
        owner: &Owner<'_>,
        clock: &mut C,
    ) -> Result<Checked, Refusal> {
        if self.received < self.new.length {
            return Err(Refusal::Incomplete {
                received: self.received,
            });
        }
        let stored = stored_checksum(slot, self.new.length, clock)?;
        if stored != self.new.checksum {
            return Err(Refusal::ChecksumMismatch {
                announced: self.new.checksum,
                stored,
            });
        }
        let record = Record {
            length: self.new.length,
            checksum: stored,
            ..Record::default()
        };
        let blob = open_verified(slot, &record).map_err(|error| Refusal::NotABlob {
            open_error: error.code(),
        })?;
        if *blob.identity() != self.new.identity {
            return Err(Refusal::OtherIdentity);
        }
        if let Some(own) = owner.rig {
            rig::compare(&blob, own)?;
        }
        let bytes = blob_bytes(slot, &record).unwrap_or_default();
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
    pub fn commit<S: SlotFlash, C: Clock>(
        self,
        slot: &mut S,
        sequence: Option<u32>,
        claims: Claims,
        clock: &mut C,
    ) -> Result<u32, Refusal> {
        let sequence = sequence.ok_or(Refusal::LogFull)?;
        let record = Record {
            sequence,
            length: self.length,
            checksum: self.checksum,
            manifest_length: 0,
            claims,
        };
        Log::commit(slot, &record, clock)?;
        Ok(sequence)
    }
}
