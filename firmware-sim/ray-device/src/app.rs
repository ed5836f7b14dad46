//! The device application: boots from its flash, then answers.
//!
//! It lives in epochs. During one, the active slot is only borrowed for reading, by the blob that is
//! open in place, and the other slot is the one that can be written. When another blob becomes
//! active, the epoch is over, and the next begins as after a restart:
//!
//! ```text
//! let mut device = Device::new(kind, clock);
//! loop {
//!     let mut epoch = device.epoch(&mut regions);
//!     session.serve(&mut link, &mut epoch)?;
//! }
//! ```

#[cfg(feature = "integer")]
mod integers;
mod self_test;

use heapless::Vec;
use ray_runtime::{MatchNoise, MeasureError, OpenError, PixelPoint, RayBlob};

use crate::health::Health;
use crate::port::{Clock, Regions};
use crate::protocol::{
    Arithmetic, BlobStatus, CameraStatus, Chunk, Hello, MAX_CHUNK, MAX_MATCHES, Match, Measured,
    NewBlob, Point, Refusal, Reply, Request, Rig, SlotState, Status, StoredBlob, name,
};
use crate::session::Responder;
use crate::storage::factory::Factory;
use crate::storage::log::Log;
use crate::storage::record::{Claims, Record};
use crate::storage::slot::SlotFlash;
use crate::storage::transfer::{Owner, Peer, Transfer};
use crate::storage::trust::Trust;
use crate::storage::{self, rig};

/// Version of the application, as [`Hello`] gives it.
pub const FIRMWARE_VERSION: &str = env!("CARGO_PKG_VERSION");

/// What of a device outlives its epochs.
#[derive(Debug)]
pub struct Device<C> {
    kind: &'static str,
    clock: C,
    trust: Trust,
    arithmetic: Arithmetic,
    transfer: Option<Transfer>,
    /// Of what this epoch's blob measured.
    health: Health,
    answered: u32,
    refused: u32,
    updates: u32,
    rollbacks: u32,
}

impl<C: Clock> Device<C> {
    /// A device of the given kind that has just been switched on.
    pub fn new(kind: &'static str, clock: C) -> Self {
        Self {
            kind,
            clock,
            trust: Trust::Anybody,
            arithmetic: Arithmetic::Float,
            transfer: None,
            health: Health::new(),
            answered: 0,
            refused: 0,
            updates: 0,
            rollbacks: 0,
        }
    }

    /// The same device, taking only blobs that this trust allows. What is in its slots stays there.
    #[must_use]
    pub fn taking(mut self, trust: Trust) -> Self {
        self.trust = trust;
        self
    }

    /// The same device, computing in integers: for a core without a floating-point unit. A blob that they cannot look up is refused
    /// when it is asked to measure, with the code of the runtime's `Unsuited`.
    #[cfg(feature = "integer")]
    #[must_use]
    pub fn computing_in_integers(mut self) -> Self {
        self.arithmetic = Arithmetic::Integer;
        self
    }

    /// Decides which blob is active, checks all of it and opens it in place.
    ///
    /// Flash without a blob that can be used does not stop it: it answers, and says what is wrong.
    #[inline(never)]
    pub fn epoch<'e, S: SlotFlash, F: Factory>(
        &'e mut self,
        regions: &'e mut Regions<S, F>,
    ) -> Epoch<'e, S, C> {
        self.health = Health::new();
        let booted = storage::boot(regions, &mut self.clock);
        let rig = regions.factory.rig();
        let Regions {
            factory,
            slots: [slot_0, slot_1],
        } = regions;
        let factory = factory.blob();
        let [record_0, record_1] = booted.records;
        let sequence = |record: Option<Record>| record.map_or(0, |record| record.sequence);
        let is_0_older = sequence(record_0) <= sequence(record_1);
        let (active, inactive, inactive_index) = match booted.active {
            Some(0) => (record_0.map(|record| (&*slot_0, record)), slot_1, 1),
            Some(1) => (record_1.map(|record| (&*slot_1, record)), slot_0, 0),
            // The one with less in it: the newest record's claims stay.
            _ if is_0_older => (None, slot_0, 0),
            _ => (None, slot_1, 1),
        };
        let stored = match (booted.active, booted.slots) {
            (Some(0), [SlotState::Holds(stored), _]) | (Some(1), [_, SlotState::Holds(stored)]) => {
                Some(stored)
            }
            (Some(storage::FACTORY), _) => storage::factory_blob(factory),
            _ => None,
        };
        let blob = match (active, stored) {
            (Some((slot, record)), _) => storage::open_of(slot, factory, &record),
            (None, Some(_)) => storage::open_factory(factory),
            (None, None) => Err(storage::NO_BLOB),
        };
        let blob = match stored {
            Some(_) => blob.map_err(OpenError::code),
            None => Err(booted.open_error),
        };
        #[cfg(feature = "integer")]
        let integers = integers::prepared(self.arithmetic, &blob);
        Epoch {
            device: self,
            #[cfg(feature = "integer")]
            integers,
            blob,
            rig,
            active: stored,
            slots: booted.slots,
            inactive,
            inactive_index,
            factory,
            inactive_record: if inactive_index == 0 {
                record_0
            } else {
                record_1
            },
            claims: booted.claims,
            next_sequence: booted.next_sequence,
            is_over: false,
        }
    }
}

/// A device for as long as the same blob is active.
#[derive(Debug)]
pub struct Epoch<'e, S, C> {
    device: &'e mut Device<C>,
    blob: Result<RayBlob<'e>, u8>,
    /// The blob prepared for integers where they are asked for, or why it cannot be.
    #[cfg(feature = "integer")]
    integers: Option<Result<integers::Rig<'e>, u8>>,
    rig: Option<Rig>,
    active: Option<StoredBlob>,
    slots: [SlotState; 2],
    inactive: &'e mut S,
    inactive_index: usize,
    factory: Option<&'e [u8]>,
    inactive_record: Option<Record>,
    claims: Claims,
    next_sequence: Option<u32>,
    is_over: bool,
}

impl<'e, S: SlotFlash, C: Clock> Epoch<'e, S, C> {
    /// The blob in use, open, or why there is none: the stable code of the runtime's `OpenError`, or
    /// [`OTHER_PART`](storage::OTHER_PART). It is a copy that borrows the slot and not the epoch, so that one task can
    /// measure while another serves: see `examples`. Both end with the epoch.
    ///
    /// # Errors
    /// That code.
    pub const fn blob(&self) -> Result<RayBlob<'e>, u8> {
        self.blob
    }

    /// The answer to a request of this peer.
    pub fn respond_to(&mut self, peer: Peer, request: &Request) -> Reply {
        let reply = match request {
            Request::Hello => Ok(Reply::Hello(self.hello())),
            Request::Status => Ok(Reply::Status(self.status())),
            Request::Measure(matches) => self.measure(matches, Asked::Sigmas(None)),
            Request::BeginUpdate(new) => self.begin_update(peer, new),
            Request::Chunk(chunk) => self.store(peer, chunk),
            Request::FinishUpdate => self.finish_update(peer),
            Request::AbortUpdate => self.abort_update(peer),
            Request::Rollback => self.rollback(peer),
            Request::SelfTest => self.self_test(),
            Request::MeasureNoisy(asked) => match MatchNoise::from_px(asked.noise_px) {
                Some(noise) => self.measure(&asked.matches, Asked::Sigmas(Some(noise))),
                None => Err(Refusal::BadNoise),
            },
            Request::MeasurePoints(matches) => self.measure(matches, Asked::Points),
        };
        match reply {
            Ok(reply) => {
                self.device.answered = self.device.answered.saturating_add(1);
                reply
            }
            Err(refusal) => {
                self.note_refused(refusal);
                Reply::Refused(refusal)
            }
        }
    }

    fn hello(&self) -> Hello {
        Hello {
            device: name(self.device.kind),
            firmware: name(FIRMWARE_VERSION),
            max_matches: MAX_MATCHES as u8,
            max_chunk: MAX_CHUNK as u16,
            max_blob: self.inactive.max_blob(0),
            unit: self.inactive.shape().blob.line() as u16,
            needs_signature: self.device.trust.needs_signature(),
        }
    }

    #[inline(never)]
    fn status(&mut self) -> Status {
        let mut slots = self.slots;
        let update = self.device.transfer.as_ref().map(Transfer::status);
        if let (Some(_), Some(slot)) = (&update, slots.get_mut(self.inactive_index)) {
            *slot = SlotState::Receiving;
        }
        Status {
            uptime_ms: self.device.clock.uptime_ms(),
            answered: self.device.answered,
            refused: self.device.refused,
            blob: self.blob.as_ref().map(blob_status).map_err(|code| *code),
            active_slot: self.active.map(|stored| stored.slot),
            slots,
            update,
            max_blob: self.inactive.max_blob(0),
            updates: self.device.updates,
            rollbacks: self.device.rollbacks,
            rig: self.rig.clone(),
            gaps: self.device.health.report(),
            arithmetic: self.device.arithmetic,
        }
    }

    #[inline(never)]
    fn measure(&mut self, matches: &[Match], asked: Asked) -> Result<Reply, Refusal> {
        let blob = opened(&self.blob)?;
        #[cfg(feature = "integer")]
        if let Some(integers) = integers::of(&self.integers)? {
            let measured = matches
                .iter()
                .map(|asked| integers::measure(integers, asked));
            return Ok(Reply::Measured(bounded(measured)));
        }
        let health = &mut self.device.health;
        let measured = matches
            .iter()
            .map(|of| measure_one(blob, of, asked, health));
        Ok(Reply::Measured(bounded(measured)))
    }

    fn self_test(&self) -> Result<Reply, Refusal> {
        let blob = opened(&self.blob)?;
        #[cfg(feature = "integer")]
        if let Some(integers) = integers::of(&self.integers)? {
            return Ok(Reply::SelfTested(integers::report(integers, blob)));
        }
        Ok(Reply::SelfTested(self_test::report(blob)))
    }

    #[inline(never)]
    fn begin_update(&mut self, peer: Peer, new: &NewBlob) -> Result<Reply, Refusal> {
        let now_ms = self.device.clock.uptime_ms();
        if let Some(transfer) = &mut self.device.transfer {
            if transfer.is_of(new) {
                let received = transfer.resume(peer, now_ms);
                return Ok(Reply::Receiving { received });
            }
            transfer.make_way(peer, now_ms)?;
        }
        self.device.transfer = None;
        if let Some(active) = self.active
            && active.length == new.length
            && active.checksum == new.checksum
            && active.identity == new.identity
        {
            return Ok(Reply::Active(active));
        }
        let owner = Owner {
            rig: self.rig.as_ref(),
            trust: self.device.trust,
        };
        let begun = Transfer::begin(self.inactive, new, peer, &owner, &mut self.device.clock);
        if matches!(begun, Ok(_) | Err(Refusal::FlashFailed { .. }))
            && let Some(slot) = self.slots.get_mut(self.inactive_index)
        {
            *slot = SlotState::Empty;
        }
        self.device.transfer = Some(begun?);
        Ok(Reply::Receiving { received: 0 })
    }

    #[inline(never)]
    fn store(&mut self, peer: Peer, chunk: &Chunk) -> Result<Reply, Refusal> {
        let transfer = self.device.transfer.as_mut().ok_or(Refusal::NoUpdate)?;
        transfer.check_peer(peer)?;
        let outcome = transfer.store(self.inactive, chunk, &mut self.device.clock);
        if let Err(Refusal::FlashFailed { .. }) = outcome {
            // Part of it may be programmed, and cannot be once more: only a new start helps.
            self.device.transfer = None;
        }
        Ok(Reply::Receiving { received: outcome? })
    }

    #[inline(never)]
    fn finish_update(&mut self, peer: Peer) -> Result<Reply, Refusal> {
        let transfer = self.device.transfer.as_ref().ok_or(Refusal::NoUpdate)?;
        transfer.check_peer(peer)?;
        let identity = transfer.status().identity;
        let owner = Owner {
            rig: self.rig.as_ref(),
            trust: self.device.trust,
        };
        let outcome = transfer.check(self.inactive, &owner, &mut self.device.clock);
        if let Err(refusal @ Refusal::Incomplete { .. }) = outcome {
            return Err(refusal);
        }
        self.device.transfer = None;
        let checked = outcome?;
        let sequence = checked.commit(
            self.inactive,
            self.next_sequence,
            self.claims,
            &mut self.device.clock,
        )?;
        self.device.updates = self.device.updates.saturating_add(1);
        self.is_over = true;
        Ok(Reply::Active(StoredBlob {
            slot: self.inactive_index as u8,
            sequence,
            length: checked.length,
            checksum: checked.checksum,
            identity,
        }))
    }

    fn abort_update(&mut self, peer: Peer) -> Result<Reply, Refusal> {
        if let Some(transfer) = &self.device.transfer {
            transfer.make_way(peer, self.device.clock.uptime_ms())?;
        }
        self.device.transfer = None;
        Ok(Reply::Aborted)
    }

    #[inline(never)]
    fn rollback(&mut self, peer: Peer) -> Result<Reply, Refusal> {
        if let Some(transfer) = &self.device.transfer {
            transfer.make_way(peer, self.device.clock.uptime_ms())?;
        }
        let state = self.slots.get(self.inactive_index).copied();
        let (stored, record) = match (state, self.inactive_record) {
            (Some(SlotState::Holds(stored)), Some(record)) => (stored, record),
            // Nothing else is there.
            _ => (self.factory_to_roll_back_to()?, Record::default()),
        };
        let sequence = self.next_sequence.ok_or(Refusal::LogFull)?;
        let record = Record {
            sequence,
            claims: self.claims,
            ..record
        };
        // It was whole when the device started; bits may have flipped since.
        let clock = &mut self.device.clock;
        let is_whole = record.length == 0 || storage::verify(self.inactive, &record, clock).is_ok();
        let blob = storage::open_of(&*self.inactive, self.factory, &record)
            .ok()
            .filter(|_| is_whole)
            .ok_or(Refusal::NothingToRollBackTo)?;
        if let Some(own) = &self.rig {
            rig::compare(&blob, own)?;
        }
        Log::commit(self.inactive, &record, clock)?;
        self.device.rollbacks = self.device.rollbacks.saturating_add(1);
        self.is_over = true;
        Ok(Reply::Active(StoredBlob { sequence, ..stored }))
    }
}

impl<S: SlotFlash, C: Clock> Epoch<'_, S, C> {
    /// The factory's blob, unless it is in use.
    fn factory_to_roll_back_to(&self) -> Result<StoredBlob, Refusal> {
        let stored = storage::factory_blob(self.factory).ok_or(Refusal::NothingToRollBackTo)?;
        match self.active {
            Some(active) if active.checksum != stored.checksum => Ok(StoredBlob {
                slot: self.inactive_index as u8,
                ..stored
            }),
            _ => Err(Refusal::NothingToRollBackTo),
        }
    }
}

impl<S: SlotFlash, C: Clock> Responder for Epoch<'_, S, C> {
    fn respond(&mut self, request: &Request) -> Reply {
        self.respond_to(0, request)
    }

    fn note_refused(&mut self, _: Refusal) {
        self.device.refused = self.device.refused.saturating_add(1);
    }

    fn is_over(&self) -> bool {
        self.is_over
    }
}

/// The blob, or why there is none.
fn opened<'a, 'b>(blob: &'a Result<RayBlob<'b>, u8>) -> Result<&'a RayBlob<'b>, Refusal> {
    blob.as_ref()
        .map_err(|&open_error| Refusal::NoBlob { open_error })
}

/// As many of the items as fit. (`collect` would panic at one more, and the image may not.)
fn bounded<T, const N: usize>(items: impl Iterator<Item = T>) -> Vec<T, N> {
    let mut vec = Vec::new();
    for item in items {
        if vec.push(item).is_err() {
            break;
        }
    }
    vec
}

fn blob_status(blob: &RayBlob<'_>) -> BlobStatus {
    let cameras = (0..blob.camera_count()).map_while(|index| blob.camera(index));
    BlobStatus {
        identity: *blob.identity(),
        length: blob.len() as u32,
        camera_count: blob.camera_count() as u8,
        cameras: bounded(cameras.map(|camera| CameraStatus {
            name: name(camera.name),
            width_px: camera.sensor_width,
            height_px: camera.sensor_height,
        })),
    }
}

/// What is asked of matches.
#[derive(Clone, Copy)]
enum Asked {
    /// Points alone.
    Points,
    /// Their standard deviations too, of pixels that are so noisy; that is the blob's business where it is not said.
    Sigmas(Option<MatchNoise>),
}

/// The two pixels of a match.
fn sightings(asked: &Match) -> [(usize, PixelPoint); 2] {
    [asked.first, asked.second].map(|sighting| {
        (
            usize::from(sighting.camera),
            PixelPoint::new(sighting.u_px, sighting.v_px),
        )
    })
}

fn measure_one(blob: &RayBlob<'_>, of: &Match, asked: Asked, health: &mut Health) -> Measured {
    let [first, second] = sightings(of);
    let outcome = match asked {
        Asked::Points => blob.triangulate(first, second).map(Point::from),
        Asked::Sigmas(noise) => {
            let outcome = match noise {
                Some(noise) => blob.triangulate_with_noise(first, second, noise),
                None => blob.triangulate_with_covariance(first, second),
            };
            if let Ok(measured) = &outcome {
                health.note(measured);
            }
            outcome.map(Point::from)
        }
    };
    Measured {
        id: of.id,
        outcome: outcome.map_err(MeasureError::code),
    }
}
