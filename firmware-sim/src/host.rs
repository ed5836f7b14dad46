//! The simulated device on the host: the application behind a TCP port, its flash in memory.

use std::io::{BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::app::Device;
use crate::port::{BlobStore, Clock, Link};
use crate::protocol::{Refusal, Reply, Request};
use crate::session::{Responder, Session};

/// Size of a device's flash, bytes: that of the board which QEMU emulates.
pub const FLASH_LENGTH: usize = 16 << 20;

/// Peers at once; one more is turned away.
const MAX_PEERS: usize = 16;

/// A peer that says nothing for so long is taken for dead.
const SILENCE_LIMIT: Duration = Duration::from_mins(10);

/// A simulated device that serves in the background until the process ends.
#[derive(Debug)]
pub struct SimulatedDevice {
    address: SocketAddr,
    server: thread::JoinHandle<()>,
}

impl SimulatedDevice {
    /// Starts one that listens on `listen` (port 0 takes a free one), with `flash` at the start of
    /// its flash; the rest of the flash is zero, as in QEMU.
    ///
    /// # Errors
    /// If the address cannot be listened on, or `flash` is longer than [`FLASH_LENGTH`].
    pub fn start(listen: SocketAddr, flash: &[u8]) -> std::io::Result<Self> {
        let Some(flash) = Flash::with_contents(flash) else {
            let reason = format!(
                "{} bytes are more than the flash has, {FLASH_LENGTH}",
                flash.len()
            );
            return Err(std::io::Error::new(
                std::io::ErrorKind::InvalidInput,
                reason,
            ));
        };
        let listener = TcpListener::bind(listen)?;
        let address = listener.local_addr()?;
        let server = thread::Builder::new()
            .name("device".into())
            .spawn(move || serve(&listener, &flash))?;
        Ok(Self { address, server })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Waits for as long as it serves, which is until the process ends.
    pub fn serve_forever(self) {
        // The only other way out of the server is a panic, which has been reported by then.
        let _ = self.server.join();
    }
}

/// Accepts peers for good. All of them talk to the one device; each has its own session.
fn serve(listener: &TcpListener, flash: &Flash) {
    let device = Device::boot("firmware-sim host", flash, HostClock(Instant::now()));
    let device = Mutex::new(device);
    let peers = AtomicUsize::new(0);
    thread::scope(|scope| {
        for stream in listener.incoming() {
            // A connection that failed before it was taken concerns nobody else.
            let Ok(stream) = stream else { continue };
            if peers.fetch_add(1, Ordering::Relaxed) >= MAX_PEERS {
                peers.fetch_sub(1, Ordering::Relaxed);
                continue;
            }
            let (device, peers) = (&device, &peers);
            scope.spawn(move || {
                // How a conversation ended is the peer's affair.
                let _ = converse(stream, device);
                peers.fetch_sub(1, Ordering::Relaxed);
            });
        }
    });
}

fn converse(stream: TcpStream, device: &Mutex<Device<'_, HostClock>>) -> std::io::Result<()> {
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(SILENCE_LIMIT))?;
    stream.set_write_timeout(Some(SILENCE_LIMIT))?;
    Session::new().serve(&mut TcpLink(BufReader::new(stream)), &mut Shared(device))
}

/// Flash in memory: double words, because the runtime asks for a blob on a multiple of 8.
struct Flash(Vec<u64>);

impl Flash {
    fn with_contents(contents: &[u8]) -> Option<Self> {
        let mut words = vec![0; FLASH_LENGTH / 8];
        bytemuck::cast_slice_mut(&mut words)
            .get_mut(..contents.len())?
            .copy_from_slice(contents);
        Some(Self(words))
    }
}

impl BlobStore for Flash {
    fn active_blob(&self) -> &[u8] {
        bytemuck::cast_slice(&self.0)
    }
}

#[derive(Debug)]
struct HostClock(Instant);

impl Clock for HostClock {
    fn uptime_ms(&mut self) -> u64 {
        u64::try_from(self.0.elapsed().as_millis()).unwrap_or(u64::MAX)
    }
}

struct TcpLink(BufReader<TcpStream>);

impl Link for TcpLink {
    type Error = std::io::Error;

    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        self.0.read(buffer)
    }

    fn write_all(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.0.get_mut().write_all(bytes)
    }
}

/// One device, many sessions: they take turns, request by request.
struct Shared<'a, 'f>(&'a Mutex<Device<'f, HostClock>>);

impl Responder for Shared<'_, '_> {
    fn respond(&mut self, request: &Request) -> Reply {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .respond(request)
    }

    fn note_refused(&mut self, refusal: Refusal) {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .note_refused(refusal);
    }
}
