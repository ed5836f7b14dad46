//! The device application: opens the blob in its flash once, then answers.

use ray_runtime::{OpenError, PixelPoint, RayBlob};

use crate::port::{BlobStore, Clock};
use crate::protocol::{
    BlobStatus, CameraStatus, Hello, MAX_MATCHES, Match, Measured, Point, Refusal, Reply, Request, Sighting, Status,
    name,
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
    answered: u32,
    refused: u32,
}

impl<'f, C: Clock> Device<'f, C> {
    /// Starts a device of the given kind: checks the blob in `store`, all of it, and opens it in place.
    ///
    /// A blob that cannot be opened does not stop it: it answers, and says what is wrong.
    pub fn boot(kind: &'static str, store: &'f impl BlobStore, clock: C) -> Self {
        Self { kind, blob: RayBlob::open(store.active_blob()), clock, answered: 0, refused: 0 }
    }

    fn hello(&self) -> Hello {
        Hello { device: name(self.kind), firmware: name(FIRMWARE_VERSION), max_matches: MAX_MATCHES as u8 }
    }

    fn status(&mut self) -> Status {
        Status {
            uptime_ms: self.clock.uptime_ms(),
            answered: self.answered,
            refused: self.refused,
            blob: self.blob.as_ref().map(blob_status).map_err(|error| error.code()),
        }
    }

    fn measure(&self, matches: &[Match]) -> Reply {
        match &self.blob {
            Ok(blob) => Reply::Measured(matches.iter().map(|asked| measure_one(blob, asked)).collect()),
            Err(error) => Reply::Refused(Refusal::NoBlob { open_error: error.code() }),
        }
    }
}
