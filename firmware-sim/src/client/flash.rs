//! Sends a blob to a device, and goes on after a link that broke.

use std::collections::VecDeque;
use std::time::Duration;

use super::error::unexpected;
use super::{ClientError, DeviceClient};
use crate::ask_blob::ask_blob;
use ray_device::frame::checksum;
use ray_device::manifest::{Link, ManifestBytes, NO_LINK, PIECE_LENGTH, link};
use ray_device::protocol::{Chunk, MAX_CHUNK, NewBlob, Refusal, Reply, Request, StoredBlob, name};
use ray_device::storage::rig;

/// How patiently a blob is sent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FlashOptions {
    /// Failures in a row, with no byte stored in between, after which it gives up.
    pub retries: u32,
    /// How long one answer may take. A device erases a block or checks a whole blob meanwhile.
    pub timeout: Duration,
    /// Serial number of the rig that the blob was calibrated on, if known.
    pub rig_serial: Option<String>,
    /// The blob's manifest, signed by the owner, for a device that has one.
    pub manifest: Option<ManifestBytes>,
}

impl Default for FlashOptions {
    fn default() -> Self {
        Self {
            retries: 5,
            timeout: Duration::from_secs(20),
            rig_serial: None,
            manifest: None,
        }
    }
}

/// How far it has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashProgress {
    /// Bytes stored on the device.
    pub stored: u32,
    /// Bytes of the blob.
    pub length: u32,
    /// How often it was resumed.
    pub resumed: u32,
}

/// A blob that is active on a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Flashed {
    /// As the device stored it.
    pub stored: StoredBlob,
    /// It was active before, so nothing was sent.
    pub was_active: bool,
    /// How often the transfer was resumed.
    pub resumed: u32,
}

/// Pause before the first new try; it doubles with each failure in a row.
const FIRST_PAUSE: Duration = Duration::from_millis(50);
const LONGEST_PAUSE: Duration = Duration::from_secs(2);

impl DeviceClient {
    /// Sends `blob`, has the device check it and makes it active. When the link breaks or stays
    /// silent it connects again and goes on where the device stopped.
    ///
    /// Whatever goes wrong, the device keeps the blob it had, or has the new one whole.
    ///
    /// # Errors
    /// [`ClientError::NotABlob`] before anything is sent; [`ClientError::Refused`] with the device's
    /// reason; [`ClientError::GaveUp`].
    pub fn flash(
        &mut self,
        blob: &[u8],
        options: &FlashOptions,
        on_progress: &mut dyn FnMut(FlashProgress),
    ) -> Result<Flashed, ClientError> {
        let new = NewBlob {
            length: u32::try_from(blob.len()).unwrap_or(u32::MAX),
            checksum: checksum(blob),
            identity: ask_blob(blob, |blob| *blob.identity()).map_err(ClientError::NotABlob)?,
            rig_serial: options.rig_serial.as_deref().map(name),
            manifest: options.manifest.iter().flatten().copied().collect(),
        };
        let links = match options.manifest {
            Some(_) => links(blob),
            None => Vec::new(),
        };
        let pieces = Pieces { blob, links };
        let usual_timeout = std::mem::replace(&mut self.timeout, options.timeout);
        let outcome = self.flash_patiently(&new, &pieces, options.retries, on_progress);
        self.timeout = usual_timeout;
        outcome
    }

    fn flash_patiently(
        &mut self,
        new: &NewBlob,
        pieces: &Pieces<'_>,
        retries: u32,
        on_progress: &mut dyn FnMut(FlashProgress),
    ) -> Result<Flashed, ClientError> {
        let mut progress = FlashProgress {
            stored: 0,
            length: new.length,
            resumed: 0,
        };
        let mut failures = 0;
        let mut is_connected = true;
        loop {
            let best = progress.stored;
            let connected = if is_connected {
                Ok(())
            } else {
                self.reconnect()
            };
            let outcome = connected.and_then(|()| {
                is_connected = true;
                self.transfer(new, pieces, &mut progress, on_progress)
            });
            let error = match outcome {
                Ok(flashed) => return Ok(flashed),
                Err(error) if error.is_passing() => error,
                Err(error) => return Err(error),
            };
            failures = if progress.stored > best {
                1
            } else {
                failures + 1
            };
            if failures > retries {
                return Err(ClientError::GaveUp {
                    tries: progress.resumed + 1,
                    source: Box::new(error),
                });
            }
            progress.resumed += 1;
            is_connected = false;
            std::thread::sleep(match error {
                ClientError::Refused(Refusal::Busy { wait_ms }) => {
                    Duration::from_millis(u64::from(wait_ms))
                }
                _ => (FIRST_PAUSE * (1 << (failures - 1).min(10))).min(LONGEST_PAUSE),
            });
        }
    }

    /// One try over the present link.
    fn transfer(
        &mut self,
        new: &NewBlob,
        pieces: &Pieces<'_>,
        progress: &mut FlashProgress,
        on_progress: &mut dyn FnMut(FlashProgress),
    ) -> Result<Flashed, ClientError> {
        // The device compares the cameras itself, but only once it has given up the blob before for it.
        if let Some(own) = &self.status()?.rig {
            let compared = ask_blob(pieces.blob, |blob| rig::compare(blob, own));
            compared
                .map_err(ClientError::NotABlob)?
                .map_err(ClientError::Refused)?;
        }
        let mut stored = match self.begin_update(new)? {
            Begun::Active(stored) => {
                return Ok(Flashed {
                    stored,
                    was_active: progress.resumed == 0,
                    resumed: progress.resumed,
                });
            }
            Begun::Receiving { received } => received,
        };
        let mut note = |stored| {
            progress.stored = stored;
            on_progress(*progress);
        };
        note(stored);
        let rest = pieces.blob.get(stored as usize..).unwrap_or_default();
        let mut chunks = rest.chunks(self.chunk_length());
        let mut next = stored;
        let mut under_way = VecDeque::new();
        let window = self.window();
        loop {
            while under_way.len() < window
                && let Some(chunk) = chunks.next()
            {
                under_way.push_back(self.send_chunk(next, chunk, pieces.link_behind(next))?);
                next += chunk.len() as u32;
            }
            let Some(sequence) = under_way.pop_front() else {
                break;
            };
            stored = received(&self.receive(sequence)?)?;
            note(stored);
        }
        let resumed = progress.resumed;
        Ok(Flashed {
            stored: self.finish_update()?,
            was_active: false,
            resumed,
        })
    }

    /// Announces a blob. [`DeviceClient::flash`] does this and all that follows.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn begin_update(&mut self, new: &NewBlob) -> Result<Begun, ClientError> {
        match self.ask(&Request::BeginUpdate(new.clone()))? {
            Reply::Receiving { received } => Ok(Begun::Receiving { received }),
            Reply::Active(stored) => Ok(Begun::Active(stored)),
            reply => Err(unexpected("the start of an update", &reply)),
        }
    }

    /// Sends bytes of the announced blob; how many the device has stored then.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn chunk(&mut self, offset: u32, bytes: &[u8]) -> Result<u32, ClientError> {
        let sequence = self.send_chunk(offset, bytes, None)?;
        received(&self.receive(sequence)?)
    }

    /// Has the device check what it was sent and make it active.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn finish_update(&mut self) -> Result<StoredBlob, ClientError> {
        match self.ask(&Request::FinishUpdate)? {
            Reply::Active(stored) => Ok(stored),
            reply => Err(unexpected("the end of an update", &reply)),
        }
    }

    /// Gives an update up. On a device with an owner: [`DeviceClient::order`].
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn abort_update(&mut self) -> Result<(), ClientError> {
        match self.ask(&Request::AbortUpdate)? {
            Reply::Aborted => Ok(()),
            reply => Err(unexpected("giving up an update", &reply)),
        }
    }

    fn send_chunk(
        &mut self,
        offset: u32,
        bytes: &[u8],
        next: Option<Link>,
    ) -> Result<u16, ClientError> {
        let Ok(bytes) = heapless::Vec::from_slice(bytes) else {
            return Err(ClientError::Refused(Refusal::BadChunk { missing: 0 }));
        };
        self.send(&Request::Chunk(Chunk {
            offset,
            bytes,
            next,
        }))
    }

    fn chunk_length(&self) -> usize {
        let most = usize::from(self.greeting.max_chunk).min(MAX_CHUNK);
        let unit = usize::from(self.greeting.unit).clamp(1, MAX_CHUNK);
        (most / unit * unit).max(unit)
    }
}

/// What is sent of a blob.
struct Pieces<'a> {
    blob: &'a [u8],
    /// Of each piece, for a blob with a manifest.
    links: Vec<Link>,
}

impl Pieces<'_> {
    /// The link behind the piece that starts here.
    fn link_behind(&self, offset: u32) -> Option<Link> {
        let piece = offset as usize / PIECE_LENGTH;
        self.links.get(piece)?;
        Some(self.links.get(piece + 1).copied().unwrap_or(NO_LINK))
    }
}

/// The links of a blob's pieces, in their order.
fn links(blob: &[u8]) -> Vec<Link> {
    let mut links = Vec::new();
    let mut next = NO_LINK;
    for piece in blob.chunks(PIECE_LENGTH).rev() {
        next = link(piece, &next);
        links.push(next);
    }
    links.reverse();
    links
}

/// What a device says to an announced blob.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Begun {
    /// It is active already.
    Active(StoredBlob),
    /// It is under way.
    Receiving {
        /// So many bytes are stored already.
        received: u32,
    },
}

fn received(reply: &Reply) -> Result<u32, ClientError> {
    match reply {
        Reply::Receiving { received } => Ok(*received),
        reply => Err(unexpected("a chunk", reply)),
    }
}
