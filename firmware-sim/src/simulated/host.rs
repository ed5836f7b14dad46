//! The simulated device on the host: the application behind a TCP port, its flash simulated.
//!
//! One thread is the device: it owns the flash and answers one request after the other. Each peer has
//! a thread with a session of its own, which hands requests over and waits for their answers.

use std::io::{BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, Sender};
use std::thread;
use std::time::{Duration, Instant};

use crate::simulated::flash_file;
use crate::simulated::sim_flash::SimFlash;
use ray_device::app::Device;
use ray_device::port::{Clock, Link};
use ray_device::protocol::{Arithmetic, Refusal, Reply, Request};
use ray_device::session::{Paused, Responder, Session};
use ray_device::storage::transfer::Peer;
use ray_device::storage::trust::Trust;

pub use crate::simulated::flash_file::FLASH_LENGTH;

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
    /// Starts one that listens on `listen` (port 0 takes a free one), with `blob` in the first slot
    /// of a flash in memory; without any bytes, the flash is blank.
    ///
    /// # Errors
    /// If the address cannot be listened on, or `blob` is longer than a slot.
    pub fn start(listen: SocketAddr, blob: &[u8]) -> std::io::Result<Self> {
        let flash = flash_file::holding(blob, None);
        let invalid = |error| std::io::Error::new(std::io::ErrorKind::InvalidInput, error);
        Self::start_with(listen, flash.map_err(invalid)?)
    }

    /// The same with any flash, such as one that is kept in a file.
    ///
    /// # Errors
    /// If the address cannot be listened on.
    pub fn start_with(listen: SocketAddr, flash: SimFlash) -> std::io::Result<Self> {
        Self::start_trusting(listen, flash, Trust::Anybody)
    }

    /// The same, computing in integers.
    ///
    /// # Errors
    /// If the address cannot be listened on.
    pub fn start_in_integers(listen: SocketAddr, flash: SimFlash) -> std::io::Result<Self> {
        Self::start_device(listen, flash, Trust::Anybody, Arithmetic::Integer)
    }

    /// The same, taking only blobs that this trust allows.
    ///
    /// # Errors
    /// If the address cannot be listened on.
    pub fn start_trusting(
        listen: SocketAddr,
        flash: SimFlash,
        trust: Trust,
    ) -> std::io::Result<Self> {
        Self::start_device(listen, flash, trust, Arithmetic::Float)
    }

    /// Whose blobs it takes and what it computes in, both of which its owner settles.
    ///
    /// # Errors
    /// If the address cannot be listened on.
    pub fn start_device(
        listen: SocketAddr,
        flash: SimFlash,
        trust: Trust,
        arithmetic: Arithmetic,
    ) -> std::io::Result<Self> {
        let listener = TcpListener::bind(listen)?;
        let address = listener.local_addr()?;
        let (asks, asked) = mpsc::channel();
        thread::Builder::new()
            .name("device".into())
            .spawn(move || run(flash, trust, arithmetic, &asked))?;
        let server = thread::Builder::new()
            .name("listener".into())
            .spawn(move || accept(&listener, &asks))?;
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

/// What a peer's thread hands to the device's.
enum Ask {
    Request {
        peer: Peer,
        request: Box<Request>,
        answer: Sender<Reply>,
    },
    NoteRefused(Refusal),
}

/// The device, until nobody can ask it any more.
fn run(mut flash: SimFlash, trust: Trust, arithmetic: Arithmetic, asked: &Receiver<Ask>) {
    let clock = HostClock(Instant::now());
    let mut device = Device::new("firmware-sim host", clock).trusting(trust);
    if arithmetic == Arithmetic::Integer {
        device = device.computing_in_integers();
    }
    let mut regions = flash.regions();
    loop {
        let mut epoch = device.epoch(&mut regions);
        while !epoch.is_over() {
            match asked.recv() {
                Ok(Ask::Request {
                    peer,
                    request,
                    answer,
                }) => {
                    // A peer that has gone meanwhile does without.
                    let _ = answer.send(epoch.respond_to(peer, &request));
                }
                Ok(Ask::NoteRefused(refusal)) => epoch.note_refused(refusal),
                Err(_) => return,
            }
        }
    }
}

/// Accepts peers for good. All of them talk to the one device; each has its own session.
fn accept(listener: &TcpListener, asks: &Sender<Ask>) {
    let peers = Arc::new(AtomicUsize::new(0));
    let mut next_peer: Peer = 0;
    for stream in listener.incoming() {
        // A connection that failed before it was taken concerns nobody else.
        let Ok(stream) = stream else { continue };
        if peers.fetch_add(1, Ordering::Relaxed) >= MAX_PEERS {
            peers.fetch_sub(1, Ordering::Relaxed);
            continue;
        }
        next_peer = next_peer.wrapping_add(1);
        let (asks, peers, peer) = (asks.clone(), Arc::clone(&peers), next_peer);
        thread::spawn(move || {
            // How a conversation ended is the peer's affair.
            let _ = converse(stream, asks, peer);
            peers.fetch_sub(1, Ordering::Relaxed);
        });
    }
}

fn converse(stream: TcpStream, asks: Sender<Ask>, peer: Peer) -> std::io::Result<Paused> {
    stream.set_nodelay(true)?;
    stream.set_read_timeout(Some(SILENCE_LIMIT))?;
    stream.set_write_timeout(Some(SILENCE_LIMIT))?;
    let (answer, answers) = mpsc::channel();
    let mut shared = Shared {
        asks,
        peer,
        answer,
        answers,
        is_gone: false,
    };
    Session::new().serve(&mut TcpLink(BufReader::new(stream)), &mut shared)
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
struct Shared {
    asks: Sender<Ask>,
    peer: Peer,
    answer: Sender<Reply>,
    answers: Receiver<Reply>,
    is_gone: bool,
}

impl Responder for Shared {
    fn respond(&mut self, request: &Request) -> Reply {
        let ask = Ask::Request {
            peer: self.peer,
            request: Box::new(request.clone()),
            answer: self.answer.clone(),
        };
        let asked = self.asks.send(ask).ok();
        asked
            .and_then(|()| self.answers.recv().ok())
            .unwrap_or_else(|| {
                // Only when the device's thread has ended, by a panic that was reported there.
                self.is_gone = true;
                Reply::Refused(Refusal::NoUpdate)
            })
    }

    fn note_refused(&mut self, refusal: Refusal) {
        let _ = self.asks.send(Ask::NoteRefused(refusal));
    }

    fn is_over(&self) -> bool {
        self.is_gone
    }
}
