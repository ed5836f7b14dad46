//! The device application: opens the blob in its flash once, then answers.

use heapless::Vec;
use ray_runtime::{MeasureError, OpenError, PixelPoint, RayBlob};

use crate::health::Health;
use crate::port::{BlobStore, Clock};
use crate::protocol::{
    BlobStatus, CameraStatus, Hello, MAX_CHUNK, MAX_MATCHES, Match, Measured, Point, Refusal,
    Reply, Request, Sighting, SlotState, Status, name,
};
use crate::session::Responder;

/// Version of the application, as [`Hello`] gives it.
pub const FIRMWARE_VERSION: &str = env!("CARGO_PKG_VERSION");

/// A device that has started: the blob in its flash is open, or it is known why not.
#[derive(Debug)]
pub struct Device<'f, C> {
    kind: &'static str,
    blob: Result<RayBlob<'f>, OpenError>,
    clock: C,
    health: Health,
    answered: u32,
    refused: u32,
}

impl<'f, C: Clock> Device<'f, C> {
    /// Starts a device of the given kind: checks the whole blob in `store` and opens it in place.
    ///
    /// A blob that cannot be opened does not stop it: it answers, and says what is wrong.
    pub fn boot(kind: &'static str, store: &'f impl BlobStore, clock: C) -> Self {
        Self {
            kind,
            blob: open(store.active_blob()),
            clock,
            health: Health::new(),
            answered: 0,
            refused: 0,
        }
    }

    fn hello(&self) -> Hello {
        Hello {
            device: name(self.kind),
            firmware: name(FIRMWARE_VERSION),
            max_matches: MAX_MATCHES as u8,
            max_chunk: MAX_CHUNK as u16,
            max_blob: 0,
        }
    }

    fn status(&mut self) -> Status {
        Status {
            uptime_ms: self.clock.uptime_ms(),
            answered: self.answered,
            refused: self.refused,
            blob: self
                .blob
                .as_ref()
                .map(blob_status)
                .map_err(|error| error.code()),
            active_slot: None,
            slots: [SlotState::Empty; 2],
            update: None,
            max_blob: 0,
            updates: 0,
            rollbacks: 0,
            rig: None,
            gaps: self.health.report(),
        }
    }

    fn measure(&mut self, matches: &[Match]) -> Reply {
        let health = &mut self.health;
        match &self.blob {
            Ok(blob) => Reply::Measured(bounded(
                matches.iter().map(|asked| measure_one(blob, asked, health)),
            )),
            Err(error) => Reply::Refused(Refusal::NoBlob {
                open_error: error.code(),
            }),
        }
    }
}

impl<C: Clock> Responder for Device<'_, C> {
    fn respond(&mut self, request: &Request) -> Reply {
        let reply = match request {
            Request::Hello => Reply::Hello(self.hello()),
            Request::Status => Reply::Status(self.status()),
            Request::Measure(matches) => self.measure(matches),
            _ => Reply::Refused(Refusal::UnknownMessage),
        };
        match reply {
            Reply::Refused(refusal) => self.note_refused(refusal),
            _ => self.answered = self.answered.saturating_add(1),
        }
        reply
    }

    fn note_refused(&mut self, _: Refusal) {
        self.refused = self.refused.saturating_add(1);
    }
}

/// Opens the blob at the start of the flash; what lies behind it is left out.
fn open(flash: &[u8]) -> Result<RayBlob<'_>, OpenError> {
    let length = RayBlob::stated_len(flash)? as usize;
    // A blob that states more than there is goes to the runtime as it is, which then says so.
    RayBlob::open(flash.get(..length).unwrap_or(flash))
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

fn measure_one(blob: &RayBlob<'_>, asked: &Match, health: &mut Health) -> Measured {
    let pixel_of = |sighting: Sighting| {
        (
            usize::from(sighting.camera),
            PixelPoint::new(sighting.u_px, sighting.v_px),
        )
    };
    let outcome = blob.triangulate_with_covariance(pixel_of(asked.first), pixel_of(asked.second));
    if let Ok(measured) = &outcome {
        health.note(measured);
    }
    Measured {
        id: asked.id,
        outcome: outcome.map(Point::from).map_err(MeasureError::code),
    }
}

#[cfg(test)]
mod tests;
