//! What changes a device: updates, rollbacks, and who may ask for them.

use super::Epoch;
use crate::manifest::{Action, OrderText};
use crate::port::Clock;
use crate::protocol::{Chunk, NewBlob, Order, Refusal, Reply, SlotState, StoredBlob};
use crate::storage::log::Log;
use crate::storage::record::Record;
use crate::storage::slot::SlotFlash;
use crate::storage::transfer::{Owner, Peer, Transfer};
use crate::storage::trust::{self, Distrust};
use crate::storage::{self, rig};

impl<S: SlotFlash, C: Clock> Epoch<'_, S, C> {
    #[inline(never)]
    pub(super) fn begin_update(&mut self, peer: Peer, new: &NewBlob) -> Result<Reply, Refusal> {
        let now_ms = self.device.clock.uptime_ms();
        if let Some(transfer) = &mut self.device.transfer
            && transfer.is_of(new)
        {
            let received = transfer.resume(peer);
            return Ok(Reply::Receiving { received });
        }
        if let Some(active) = self.active
            && active.length == new.length
            && active.checksum == new.checksum
            && active.identity == new.identity
            && self.is_version_of(active, new)
        {
            return Ok(Reply::Active(active));
        }
        let number = self.device.begun.saturating_add(1);
        let begun = Transfer::begin(
            self.inactive,
            new,
            peer,
            &self.owner(),
            self.device.transfer.as_ref(),
            number,
            now_ms,
        )?;
        self.device.begun = number;
        self.device.transfer = Some(begun);
        Ok(Reply::Receiving { received: 0 })
    }

    /// Whether a blob that is announced with the bytes of the active one comes with nothing new.
    fn is_version_of(&self, active: StoredBlob, new: &NewBlob) -> bool {
        !self.device.trust.needs_signature()
            || trust::read(&new.manifest)
                .is_ok_and(|(manifest, _)| manifest.version == active.version)
    }

    fn owner(&self) -> Owner<'_> {
        Owner {
            rig: self.rig.as_ref(),
            trust: self.device.trust,
            claims: self.claims,
            held: self.slots.map(|slot| match slot {
                SlotState::Holds(stored) => Some(stored.version),
                _ => None,
            }),
        }
    }

    #[inline(never)]
    pub(super) fn store(&mut self, peer: Peer, chunk: &Chunk) -> Result<Reply, Refusal> {
        let device = &mut *self.device;
        let transfer = device.transfer.as_mut().ok_or(Refusal::NoUpdate)?;
        transfer.check_peer(peer)?;
        let outcome = transfer.store(self.inactive, chunk, &mut device.budget, &mut device.clock);
        let has_failed = matches!(outcome, Err(Refusal::FlashFailed { .. }));
        if (has_failed || transfer.has_stored())
            && let Some(slot) = self.slots.get_mut(self.inactive_index)
        {
            *slot = SlotState::Empty;
        }
        if has_failed {
            // Part of it may be programmed, and cannot be once more: only a new start helps.
            self.device.transfer = None;
        }
        Ok(Reply::Receiving { received: outcome? })
    }

    #[inline(never)]
    pub(super) fn finish_update(&mut self, peer: Peer) -> Result<Reply, Refusal> {
        let transfer = self.device.transfer.as_ref().ok_or(Refusal::NoUpdate)?;
        transfer.check_peer(peer)?;
        let identity = transfer.status().identity;
        let owner = Owner {
            rig: self.rig.as_ref(),
            trust: self.device.trust,
            claims: self.claims,
            held: [None; 2],
        };
        let outcome = transfer.check(self.inactive, &owner, &mut self.device.clock);
        if let Err(refusal @ Refusal::Incomplete { .. }) = outcome {
            return Err(refusal);
        }
        self.device.transfer = None;
        let checked = outcome?;
        let sequence = checked.commit(self.inactive, self.next_sequence, &mut self.device.clock)?;
        self.device.updates = self.device.updates.saturating_add(1);
        self.device.budget.refund();
        self.is_over = true;
        Ok(Reply::Active(StoredBlob {
            slot: self.inactive_index as u8,
            sequence,
            length: checked.record.length,
            checksum: checked.record.checksum,
            identity,
            version: checked.version,
        }))
    }

    pub(super) fn asked_to_abort(&mut self, peer: Peer) -> Result<Reply, Refusal> {
        self.check_asked(peer)?;
        Ok(self.abort_update())
    }

    pub(super) fn asked_to_roll_back(&mut self, peer: Peer) -> Result<Reply, Refusal> {
        self.check_asked(peer)?;
        self.rollback()
    }

    /// Whether this peer may ask for what ends an update.
    fn check_asked(&mut self, peer: Peer) -> Result<(), Refusal> {
        if self.device.trust.needs_signature() {
            return Err(Refusal::NeedsOrder);
        }
        match &self.device.transfer {
            Some(transfer) => transfer.make_way(peer, self.device.clock.uptime_ms()),
            None => Ok(()),
        }
    }

    /// What the owner orders, if it is the owner who does.
    #[inline(never)]
    pub(super) fn ordered(&mut self, order: &Order) -> Result<Reply, Refusal> {
        let keys = self.device.trust.keys().ok_or(Refusal::NoOwner)?;
        if u32::from(order.key) < self.claims.least_key {
            return Err(Refusal::KeyRetired { key: order.key });
        }
        let sequence = self.active.map_or(0, |active| active.sequence);
        if order.sequence != sequence {
            return Err(Refusal::StaleOrder { sequence });
        }
        let under_way = self.device.transfer.as_ref().map(Transfer::status);
        let (update, checksum) = match order.action {
            Action::Rollback => (0, self.active.map_or(0, |active| active.checksum)),
            Action::Abort => under_way.map_or((0, 0), |update| (update.number, update.checksum)),
        };
        let text = OrderText {
            action: order.action,
            key: order.key,
            serial: self.rig.as_ref().map_or("", |rig| rig.serial.as_str()),
            sequence,
            update,
            checksum,
        };
        keys.check(order.key, &text.to_be_signed(), &order.signature)?;
        match order.action {
            Action::Rollback => self.rollback(),
            Action::Abort => Ok(self.abort_update()),
        }
    }

    /// Gives an update up, if one is under way. Call it for somebody who stands before the device, such as at a
    /// button: it asks for no signature.
    pub fn abort_update(&mut self) -> Reply {
        self.device.transfer = None;
        Reply::Aborted
    }

    /// Makes the other slot's blob active, after a check of all of it, and gives up an update that is under way.
    /// Call it for somebody who stands before the device, such as at a button: it asks for no signature, but
    /// a device with an owner goes back to no version that the owner ruled out.
    ///
    /// # Errors
    /// [`Refusal::NothingToRollBackTo`], [`Refusal::OtherRig`], [`Refusal::LogFull`],
    /// [`Refusal::FlashFailed`]; with an owner also why the blob is not trusted.
    #[inline(never)]
    pub fn rollback(&mut self) -> Result<Reply, Refusal> {
        let (record, checksum) = match (self.slots.get(self.inactive_index), self.inactive_record) {
            (Some(SlotState::Holds(stored)), Some(record)) => (record, stored.checksum),
            // What is not trusted is told, for what it is.
            (Some(SlotState::Unusable { open_error, .. }), Some(record))
                if Distrust::from_code(*open_error).is_some() =>
            {
                (record, record.checksum)
            }
            // Nothing else is there.
            _ => (Record::default(), self.factory_to_roll_back_to()?),
        };
        let sequence = self.next_sequence.ok_or(Refusal::LogFull)?;
        let record = Record {
            sequence,
            claims: self.claims,
            ..record
        };
        // It was whole when the device started; bits may have flipped since.
        let (rig, trust) = (self.rig.as_ref(), self.device.trust);
        let clock = &mut self.device.clock;
        let is_whole = record.length == 0 || storage::verify(self.inactive, &record, clock).is_ok();
        let blob = storage::open_of(&*self.inactive, self.factory, &record)
            .ok()
            .filter(|_| is_whole)
            .ok_or(Refusal::NothingToRollBackTo)?;
        if let Some(own) = rig {
            rig::compare(&blob, own)?;
        }
        let (identity, length) = (*blob.identity(), blob.len() as u32);
        let manifest = storage::trusted(self.inactive, &record, trust, rig, self.claims, clock)?;
        Log::commit(self.inactive, &record, clock)?;
        self.device.transfer = None;
        self.device.rollbacks = self.device.rollbacks.saturating_add(1);
        self.is_over = true;
        Ok(Reply::Active(StoredBlob {
            slot: self.inactive_index as u8,
            sequence,
            length,
            checksum,
            identity,
            version: manifest.map_or(0, |manifest| manifest.version),
        }))
    }

    /// The checksum of the factory's blob, unless it is in use.
    fn factory_to_roll_back_to(&self) -> Result<u32, Refusal> {
        let stored = storage::factory_blob(self.factory).ok_or(Refusal::NothingToRollBackTo)?;
        match self.active {
            Some(active) if active.checksum != stored.checksum => Ok(stored.checksum),
            _ => Err(Refusal::NothingToRollBackTo),
        }
    }
}
