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

mod changes;
#[cfg(feature = "integer")]
mod integers;
mod measure;
mod self_test;

use heapless::Vec;
use ray_runtime::{MatchNoise, OpenError, RayBlob};

use crate::health::Health;
use crate::manifest::MANIFEST_LENGTH;
use crate::port::{Clock, Regions};
use crate::protocol::{
    Arithmetic, BlobStatus, CameraStatus, Hello, MAX_CHUNK, MAX_MATCHES, Match, OwnerStatus,
    Refusal, Reply, Request, Rig, SlotState, Status, StoredBlob, name,
};
use crate::session::Responder;
use crate::storage;
use crate::storage::budget::Budget;
use crate::storage::factory::Factory;
use crate::storage::record::Record;
use crate::storage::slot::SlotFlash;
use crate::storage::transfer::{Peer, Transfer};
use crate::storage::trust::{Claims, Trust};

use measure::{Asked, measure_one};

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
    budget: Budget,
    /// Updates begun.
    begun: u32,
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
            budget: Budget::default(),
            begun: 0,
            health: Health::new(),
            answered: 0,
            refused: 0,
            updates: 0,
            rollbacks: 0,
        }
    }

    /// The same device, which only those change whom this trusts. What is in its slots stays there; with an
    /// owner it is in use only if the owner signed it.
    #[must_use]
    pub fn trusting(mut self, trust: Trust) -> Self {
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
        let rig = regions.factory.rig();
        let booted = storage::boot(regions, self.trust, rig.as_ref(), &mut self.clock);
        let Regions {
            factory,
            slots: [slot_0, slot_1],
        } = regions;
        let factory = storage::usable_factory(factory.blob(), self.trust, booted.claims);
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
            Request::AbortUpdate => self.asked_to_abort(peer),
            Request::Rollback => self.asked_to_roll_back(peer),
            Request::Order(order) => self.ordered(order),
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

    /// Bytes that a slot keeps for a manifest.
    fn manifest_length(&self) -> u32 {
        if self.device.trust.needs_signature() {
            MANIFEST_LENGTH as u32
        } else {
            0
        }
    }

    fn hello(&self) -> Hello {
        Hello {
            device: name(self.device.kind),
            firmware: name(FIRMWARE_VERSION),
            max_matches: MAX_MATCHES as u8,
            max_chunk: MAX_CHUNK as u16,
            max_blob: self.inactive.max_blob(self.manifest_length()),
            unit: self.inactive.shape().blob.line() as u16,
            needs_signature: self.device.trust.needs_signature(),
        }
    }

    #[inline(never)]
    fn status(&mut self) -> Status {
        let mut slots = self.slots;
        let transfer = self.device.transfer.as_ref();
        let update = transfer.map(Transfer::status);
        if transfer.is_some_and(Transfer::has_stored)
            && let Some(slot) = slots.get_mut(self.inactive_index)
        {
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
            max_blob: self.inactive.max_blob(self.manifest_length()),
            updates: self.device.updates,
            rollbacks: self.device.rollbacks,
            rig: self.rig.clone(),
            gaps: self.device.health.report(),
            arithmetic: self.device.arithmetic,
            owner: self.device.trust.keys().map(|keys| OwnerStatus {
                keys: keys.ids(),
                claims: self.claims,
            }),
        }
    }

    #[inline(never)]
    fn measure(&mut self, matches: &[Match], asked: Asked) -> Result<Reply, Refusal> {
        let blob = opened(&self.blob)?;
        #[cfg(feature = "integer")]
        if let Some(integers) = integers::of(self.integers.as_ref())? {
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
        if let Some(integers) = integers::of(self.integers.as_ref())? {
            return Ok(Reply::SelfTested(integers::report(integers, blob)));
        }
        Ok(Reply::SelfTested(self_test::report(blob)))
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
