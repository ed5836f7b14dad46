//! A blob on its way into the inactive slot.
//!
//! On a device without an owner a transfer belongs to a peer. On one with an owner it belongs to whoever
//! brings the right bytes: each chunk is one piece of the chain that the owner signed, so it does not matter who
//! sends it, and nobody can spoil the transfer or hold it up.

use ray_runtime::OpenError;
use ray_runtime::format::HEADER_LEN;

use super::budget::Budget;
use super::contents::{open_verified, program_blob, program_manifest, read_blob, stored_checksum};
use super::log::{Log, erase_log};
use super::record::Record;
use super::rig;
use super::slot::SlotFlash;
use super::trust::{self, Claims, Trust, Verified};
use crate::manifest::{MANIFEST_LENGTH, NO_LINK};
use crate::port::Clock;
use crate::protocol::{Chunk, MAX_CHUNK, NewBlob, Refusal, Rig, UpdateStatus};

/// Who asks: one number for each link, or each connection.
pub type Peer = u32;

/// A transfer of which no chunk was accepted for so long may be given up for another, ms.
pub const SILENCE_MS: u64 = 5000;

/// Whose device it is, and what it has seen of its owner.
#[derive(Clone, Copy, Debug)]
pub struct Owner<'a> {
    /// Its own cameras, if it knows them.
    pub rig: Option<&'a Rig>,
    /// Who may change it.
    pub trust: Trust,
    /// What it has seen signed.
    pub claims: Claims,
    /// Versions of the blobs that its slots hold whole.
    pub held: [Option<u32>; 2],
}

/// A blob under way.
#[derive(Clone, Debug)]
pub struct Transfer {
    new: NewBlob,
    number: u32,
    peer: Peer,
    received: u32,
    /// Where the chunk stored last starts.
    last_offset: u32,
    /// When a chunk was last accepted; on a device with an owner, at first when it was announced.
    last_active_ms: Option<u64>,
    /// What is expected next on a device with an owner.
    verified: Option<Verified>,
}

/// The new blob, whole and checked, with the record that will make it count.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Checked {
    /// What makes it count, but for the sequence number.
    pub record: Record,
    /// Its manifest; empty without one.
    pub manifest: heapless::Vec<u8, MANIFEST_LENGTH>,
    /// Its version; 0 without an owner.
    pub version: u32,
}

impl Transfer {
    /// Starts one: checks what was announced. Nothing is erased yet. On a device with an owner this verifies
    /// the signature of the manifest, 1.8 million instructions on a Cortex-M4F, when all else fits.
    ///
    /// # Errors
    /// [`Refusal::TooLong`], [`Refusal::NotABlob`], [`Refusal::OtherRig`]; of a manifest
    /// [`Refusal::NotSigned`], [`Refusal::BadManifest`], [`Refusal::OtherManifest`],
    /// [`Refusal::KeyRetired`], [`Refusal::VersionTooOld`], [`Refusal::NoSuchKey`],
    /// [`Refusal::BadSignature`]; [`Refusal::Busy`] while `under_way` goes on.
    pub fn begin<S: SlotFlash>(
        slot: &S,
        new: &NewBlob,
        peer: Peer,
        owner: &Owner<'_>,
        under_way: Option<&Self>,
        number: u32,
        now_ms: u64,
    ) -> Result<Self, Refusal> {
        let limit = slot.max_blob(new.manifest.len() as u32);
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
        let mut begun = Self {
            new: new.clone(),
            number,
            peer,
            received: 0,
            last_offset: 0,
            last_active_ms: None,
            verified: None,
        };
        match owner.trust.keys() {
            None => {
                if let Some(other) = under_way {
                    other.make_way(peer, now_ms)?;
                }
                check_serial(new, owner.rig)?;
                if !new.manifest.is_empty() {
                    let (manifest, _) = trust::read(&new.manifest)?;
                    trust::check_fit(&manifest, new, owner.rig)?;
                }
            }
            Some(keys) => {
                let (manifest, signature) = trust::read(&new.manifest)?;
                trust::check_fit(&manifest, new, owner.rig)?;
                let held = owner.held.into_iter().flatten();
                owner.claims.check_update(&manifest, held)?;
                let claims = owner.claims.after(&manifest);
                if let Some(other) = under_way {
                    other.make_way_for(claims, now_ms)?;
                }
                keys.check_manifest(&manifest, &signature)?;
                begun.last_active_ms = Some(now_ms);
                begun.verified = Some(Verified {
                    keys,
                    version: manifest.version,
                    claims,
                    expected: manifest.root,
                });
            }
        }
        Ok(begun)
    }

    /// Whether this is the same blob, so that its transfer may go on.
    pub fn is_of(&self, new: &NewBlob) -> bool {
        if self.verified.is_some() {
            self.new.manifest == new.manifest
        } else {
            self.new == *new
        }
    }

    /// Goes on with this peer; how much has been stored. That alone is no sign of life.
    pub fn resume(&mut self, peer: Peer) -> u32 {
        self.peer = peer;
        self.received
    }

    /// Whether another peer's transfer stands in the way of this one, and for how long yet.
    ///
    /// # Errors
    /// [`Refusal::Busy`].
    pub fn make_way(&self, peer: Peer, now_ms: u64) -> Result<(), Refusal> {
        if peer == self.peer {
            return Ok(());
        }
        self.check_silence(now_ms)
    }

    /// The same for a manifest of the owner, whoever brings it: a newer one goes first.
    fn make_way_for(&self, claims: Claims, now_ms: u64) -> Result<(), Refusal> {
        match &self.verified {
            Some(own) if claims.is_newer_than(own.claims) => Ok(()),
            _ => self.check_silence(now_ms),
        }
    }

    fn check_silence(&self, now_ms: u64) -> Result<(), Refusal> {
        let Some(active_ms) = self.last_active_ms else {
            return Ok(());
        };
        match SILENCE_MS.checked_sub(now_ms.saturating_sub(active_ms)) {
            Some(wait_ms) if wait_ms > 0 => Err(Refusal::Busy {
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
        if peer == self.peer || self.verified.is_some() {
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
            checksum: self.new.checksum,
            number: self.number,
        }
    }

    /// Whether anything of the slot has been erased for it.
    pub fn has_stored(&self) -> bool {
        self.received > 0
    }

    /// Stores a chunk; how much has been stored then. The first one erases the slot's log, so that nothing in
    /// it counts any more.
    ///
    /// # Errors
    /// [`Refusal::WrongOffset`], [`Refusal::BadChunk`], [`Refusal::WrongPiece`] and
    /// [`Refusal::TooManyStarts`], after which the transfer can go on and nothing has changed;
    /// [`Refusal::FlashFailed`], after which it cannot.
    #[inline(never)]
    pub fn store<S: SlotFlash, C: Clock>(
        &mut self,
        slot: &mut S,
        chunk: &Chunk,
        budget: &mut Budget,
        clock: &mut C,
    ) -> Result<u32, Refusal> {
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
        let is_odd = match &self.verified {
            Some(_) => length != missing.min(MAX_CHUNK as u32),
            None => length < missing && length & slot.shape().blob.line().saturating_sub(1) != 0,
        };
        if length == 0 || length > missing || is_odd {
            return Err(Refusal::BadChunk { missing });
        }
        let next = chunk.next.unwrap_or(NO_LINK);
        if let Some(verified) = &self.verified
            && verified.keys.link(&chunk.bytes, &next) != verified.expected
        {
            return Err(Refusal::WrongPiece {
                offset: chunk.offset,
            });
        }
        if self.received == 0 {
            let signed = self.verified.as_ref().map(|verified| verified.claims);
            budget.take(signed, clock.uptime_ms())?;
            erase_log(slot, clock)?;
        }
        program_blob(slot, chunk.offset, &chunk.bytes, clock)?;
        self.last_active_ms = Some(clock.uptime_ms());
        self.last_offset = chunk.offset;
        self.received = self.received.saturating_add(length);
        if let Some(verified) = &mut self.verified {
            verified.expected = next;
        }
        Ok(self.received)
    }

    /// Whether this chunk is the one stored last, sent again because its answer was lost; on a device with
    /// an owner, any that was stored, as several peers may be sending.
    fn is_repeat<S: SlotFlash>(&self, slot: &mut S, chunk: &Chunk) -> bool {
        let end = chunk.offset.saturating_add(chunk.bytes.len() as u32);
        let may_be = if self.verified.is_some() {
            let within = chunk.offset & (MAX_CHUNK as u32 - 1);
            within == 0 && end <= self.received
        } else {
            chunk.offset == self.last_offset && end == self.received
        };
        if !may_be || chunk.bytes.is_empty() {
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
    /// check of the runtime, then compared with what was announced and with the device's cameras. The owner's
    /// signature was verified before, and each piece when it came.
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
        let verified = self.verified.as_ref();
        let record = Record {
            sequence: 0,
            length: self.new.length,
            checksum: stored,
            manifest_length: self.new.manifest.len() as u32,
            claims: verified.map_or(owner.claims, |verified| verified.claims),
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
        Ok(Checked {
            record,
            manifest: self.new.manifest.clone(),
            version: verified.map_or(0, |verified| verified.version),
        })
    }
}

impl Checked {
    /// Stores the manifest and makes the blob count from now on, under this sequence number.
    ///
    /// # Errors
    /// [`Refusal::LogFull`] if there is no number left, [`Refusal::FlashFailed`].
    pub fn commit<S: SlotFlash, C: Clock>(
        &self,
        slot: &mut S,
        sequence: Option<u32>,
        clock: &mut C,
    ) -> Result<u32, Refusal> {
        let sequence = sequence.ok_or(Refusal::LogFull)?;
        let record = Record {
            sequence,
            ..self.record
        };
        if !self.manifest.is_empty() {
            program_manifest(slot, record.length, &self.manifest, clock)?;
        }
        Log::commit(slot, &record, clock)?;
        Ok(sequence)
    }
}

/// Whether a blob that is announced for one rig is for this one.
fn check_serial(new: &NewBlob, own: Option<&Rig>) -> Result<(), Refusal> {
    match (&new.rig_serial, own) {
        (Some(serial), Some(own)) if *serial != own.serial => Err(trust::OTHER_SERIAL),
        _ => Ok(()),
    }
}
