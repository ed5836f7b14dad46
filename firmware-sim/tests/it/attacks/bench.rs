//! A device under attack, and who asks it.

use std::cell::Cell;

use firmware_sim::owner::Terms;
use firmware_sim::simulated::sim_flash::SimFlash;
use ray_device::app::Device;
use ray_device::port::NoClock;
use ray_device::protocol::{
    BlobStatus, CameraStatus, Reply, Request, Rig, Status, StoredBlob, name,
};
use ray_device::storage::transfer::Peer;
use ray_device::storage::trust::Trust;

use crate::owner::{Hand, blob, device, manifest, update};
use crate::rig;

pub const OWNER: Peer = 1;
pub const OTHER: Peer = 2;

/// A device and its flash; each request is answered by an epoch of its own, as behind a restart of the session.
pub struct Bench<'a> {
    pub flash: SimFlash,
    pub device: Device<Hand<'a>>,
    now_ms: &'a Cell<u64>,
    pub trust: Trust,
}

impl<'a> Bench<'a> {
    pub fn new(trust: Trust, serial: &str, now_ms: &'a Cell<u64>) -> Self {
        let mut flash = SimFlash::blank(9, 1).unwrap();
        if !serial.is_empty() {
            let cameras = rig::CAMERAS.map(|(text, width_px, height_px)| CameraStatus {
                name: name(text),
                width_px,
                height_px,
            });
            let own = Rig {
                serial: name(serial),
                cameras: cameras.into_iter().collect(),
            };
            ray_device::storage::rig::write(&mut flash.regions().factory, &own, &mut NoClock)
                .unwrap();
        }
        Self {
            flash,
            device: device(trust, now_ms),
            now_ms,
            trust,
        }
    }

    pub fn ask(&mut self, peer: Peer, request: &Request) -> Reply {
        let mut regions = self.flash.regions();
        self.device.epoch(&mut regions).respond_to(peer, request)
    }

    /// All of them, up to the first that ends the update, whose answer this is.
    pub fn ask_all(&mut self, peer: Peer, requests: &[Request]) -> Reply {
        let mut last = None;
        for request in requests {
            let reply = self.ask(peer, request);
            let is_end = matches!(reply, Reply::Refused(_) | Reply::Active(_));
            last = Some(reply);
            if is_end {
                break;
            }
        }
        last.unwrap()
    }

    pub fn flash(&mut self, peer: Peer, number: u32, terms: &Terms) -> Reply {
        let blob = blob(number);
        self.ask_all(peer, &update(&blob, &manifest(&blob, terms)))
    }

    #[track_caller]
    pub fn flash_well(&mut self, number: u32, terms: &Terms) -> StoredBlob {
        match self.flash(OWNER, number, terms) {
            Reply::Active(stored) => stored,
            other => panic!("{other:?}"),
        }
    }

    pub fn status(&mut self) -> Status {
        match self.ask(OWNER, &Request::Status) {
            Reply::Status(status) => status,
            other => panic!("{other:?}"),
        }
    }

    /// The identity of the blob in use, or why there is none.
    pub fn active(&mut self) -> Result<[u8; 16], u8> {
        self.status()
            .blob
            .map(|BlobStatus { identity, .. }| identity)
    }

    pub fn restart(&mut self) {
        self.device = device(self.trust, self.now_ms);
    }

    pub fn erases(&mut self) -> u32 {
        self.flash.wear().iter().sum()
    }
}

/// The identity of the blob of this number, as [`Bench::active`] gives it.
pub fn identity(number: u32) -> [u8; 16] {
    let mut identity = [b'v'; 16];
    identity[..4].copy_from_slice(&number.to_le_bytes());
    identity
}
