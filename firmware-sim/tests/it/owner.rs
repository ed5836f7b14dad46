//! The owner of a device, and what the owner and others send it.

use std::cell::Cell;

use firmware_sim::owner::{OwnerKey, Terms, manifest_of};
use ray_device::app::Device;
use ray_device::frame::checksum;
use ray_device::manifest::{Action, Link, ManifestBytes, NO_LINK, OrderText, PIECE_LENGTH, link};
use ray_device::port::Clock;
use ray_device::protocol::{Chunk, NewBlob, Refusal, Reply, Request, Status};
use ray_device::storage::trust::{Keys, Trust};

use crate::rig;

/// A clock that the test sets.
#[derive(Clone, Copy)]
pub struct Hand<'a>(pub &'a Cell<u64>);

impl Clock for Hand<'_> {
    fn uptime_ms(&mut self) -> u64 {
        self.0.get()
    }
}

/// The key of this number; 0 and 1 are the owner's.
pub fn key(number: u8) -> OwnerKey {
    OwnerKey::from_bytes(&[number + 7; 32])
}

/// The owner of keys 0 and 1.
pub fn owner() -> Trust {
    Trust::Owner(Keys::two(key(0).public(), key(1).public()))
}

/// A device that trusts these.
pub fn device(trust: Trust, now_ms: &Cell<u64>) -> Device<Hand<'_>> {
    Device::new("a device", Hand(now_ms)).trusting(trust)
}

/// Terms of this version, for any rig, with key 0.
pub fn version(version: u32) -> Terms {
    Terms {
        version,
        ..Terms::default()
    }
}

/// A blob of its own for each version.
pub fn blob(version: u32) -> Vec<u8> {
    let mut identity = [b'v'; 16];
    identity[..4].copy_from_slice(&version.to_le_bytes());
    rig::blob_of(identity)
}

/// The manifest of a blob under these terms, signed by the key that they name.
pub fn manifest(blob: &[u8], terms: &Terms) -> ManifestBytes {
    key(terms.key).sign_manifest(&manifest_of(blob, terms).unwrap())
}

/// Announces a blob, with or without a manifest.
pub fn announce(blob: &[u8], manifest: &[u8]) -> Request {
    let identity = {
        let mut words = vec![0_u64; blob.len().div_ceil(8)];
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut words);
        bytes[..blob.len()].copy_from_slice(blob);
        *ray_runtime::RayBlob::open(&bytes[..blob.len()])
            .unwrap()
            .identity()
    };
    Request::BeginUpdate(NewBlob {
        length: blob.len() as u32,
        checksum: checksum(blob),
        identity,
        rig_serial: None,
        manifest: heapless::Vec::from_slice(manifest).unwrap(),
    })
}

/// The pieces of a blob, each with the link of the next.
pub fn pieces(blob: &[u8]) -> Vec<Request> {
    let mut next: Link = NO_LINK;
    let mut requests: Vec<_> = (0..blob.len())
        .step_by(PIECE_LENGTH)
        .rev()
        .map(|at| {
            let piece = &blob[at..blob.len().min(at + PIECE_LENGTH)];
            let request = chunk(at as u32, piece, Some(next));
            next = link(piece, &next);
            request
        })
        .collect();
    requests.reverse();
    requests
}

/// One chunk.
pub fn chunk(offset: u32, bytes: &[u8], next: Option<Link>) -> Request {
    Request::Chunk(Chunk {
        offset,
        bytes: heapless::Vec::from_slice(bytes).unwrap(),
        next,
    })
}

/// All that it takes to flash a blob.
pub fn update(blob: &[u8], manifest: &[u8]) -> Vec<Request> {
    let mut requests = vec![announce(blob, manifest)];
    requests.extend(pieces(blob));
    requests.push(Request::FinishUpdate);
    requests
}

/// An order for the device as its status says that it is, by the key of this number.
pub fn order(action: Action, number: u8, status: &Status) -> Request {
    use ray_device::protocol::SlotState;
    let active = status.slots.iter().find_map(|slot| match slot {
        SlotState::Holds(stored) if status.active_slot == Some(stored.slot) => Some(stored),
        _ => None,
    });
    let update = status.update;
    let text = OrderText {
        action,
        key: number.min(1),
        serial: status.rig.as_ref().map_or("", |rig| rig.serial.as_str()),
        sequence: active.map_or(0, |active| active.sequence),
        update: match action {
            Action::Rollback => 0,
            Action::Abort => update.map_or(0, |update| update.number),
        },
        checksum: match action {
            Action::Rollback => active.map_or(0, |active| active.checksum),
            Action::Abort => update.map_or(0, |update| update.checksum),
        },
    };
    Request::Order(key(number).sign_order(&text))
}

/// The refusal in an answer.
pub fn refusal(reply: &Reply) -> Refusal {
    match reply {
        Reply::Refused(refusal) => *refusal,
        other => panic!("{other:?}"),
    }
}
