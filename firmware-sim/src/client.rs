//! The workstation's side: a device as something that can be asked.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use thiserror::Error;

use crate::frame::{DELIMITER, FrameReader, FrameWriter, NO_SEQUENCE, Received, Rejected};
use crate::protocol::{Hello, MAX_MATCHES, Match, Measured, Refusal, Reply, Request, Status};

/// How long an answer may take, unless said otherwise.
pub const DEFAULT_TIMEOUT: Duration = Duration::from_secs(5);

/// Batches under way at once: enough to hide the link's delay, few enough that neither side's
/// socket buffer fills up while the other is still sending.
const WINDOW: usize = 8;

/// Why a device gave no answer, or not the one asked for.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ClientError {
    /// The address is of no known kind.
    #[error("`{address}` is no device address: give tcp:HOST:PORT, such as tcp:127.0.0.1:7777")]
    UnknownAddress {
        /// As given.
        address: String,
    },
    /// Nobody listens there.
    #[error("no device at {address}: is it running, and is the port right?")]
    Connect {
        /// As given.
        address: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// The connection broke.
    #[error("the connection to {address} broke")]
    Broken {
        /// As given.
        address: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// The device closed the connection.
    #[error("the device at {address} closed the connection")]
    Closed {
        /// As given.
        address: String,
    },
    /// No answer came in time.
    #[error(
        "no answer from {address} within {} s: is it a device of this kind, and is nobody else connected to it?",
        timeout.as_secs_f32()
    )]
    Timeout {
        /// As given.
        address: String,
        /// How long was waited.
        timeout: Duration,
    },
    /// The device speaks another version of the protocol.
    #[error(
        "the device speaks protocol version {device}, this program version {ours}: bring the older one up to date"
    )]
    WrongVersion {
        /// The device's version.
        device: u8,
        /// The version spoken here.
        ours: u8,
    },
    /// The device refused the request.
    #[error("the device refused: {0}")]
    Refused(Refusal),
    /// What came back is no answer to what was asked, or cannot be read.
    #[error("the device's answer to {asked} makes no sense: {found}")]
    BadReply {
        /// The request.
        asked: &'static str,
        /// What came instead.
        found: String,
    },
}

/// A connection to a device.
///
/// # Example
/// ```
/// use firmware_sim::client::DeviceClient;
/// use firmware_sim::host::SimulatedDevice;
///
/// let device = SimulatedDevice::start("127.0.0.1:0".parse()?, &[])?;
/// let mut client = DeviceClient::connect(&format!("tcp:{}", device.address()))?;
/// assert_eq!(client.hello()?.device, "firmware-sim host");
/// assert!(client.status()?.blob.is_err(), "its flash is empty");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct DeviceClient {
    address: String,
    stream: TcpStream,
    timeout: Duration,
    arrived: VecDeque<u8>,
    reader: FrameReader,
    writer: FrameWriter,
    last_sequence: u16,
    batch_length: usize,
}

impl DeviceClient {
    /// Connects to `address`, `tcp:HOST:PORT`, and makes sure that a device of this protocol
    /// version answers.
    ///
    /// # Errors
    /// [`ClientError`], after [`DEFAULT_TIMEOUT`] at the latest.
    pub fn connect(address: &str) -> Result<Self, ClientError> {
        Self::connect_within(address, DEFAULT_TIMEOUT)
    }

    /// The same with another limit for the connection and for each later answer.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn connect_within(address: &str, timeout: Duration) -> Result<Self, ClientError> {
        let unknown = || ClientError::UnknownAddress {
            address: address.to_owned(),
        };
        let host_and_port = address.strip_prefix("tcp:").ok_or_else(unknown)?;
        if host_and_port
            .rsplit_once(':')
            .is_none_or(|(_, port)| port.parse::<u16>().is_err())
        {
            return Err(unknown());
        }
        let stream =
            connect_tcp(host_and_port, timeout).map_err(|source| ClientError::Connect {
                address: address.to_owned(),
                source,
            })?;
        let mut client = Self {
            address: address.to_owned(),
            stream,
            timeout,
            arrived: VecDeque::new(),
            reader: FrameReader::new(),
            writer: FrameWriter::new(),
            last_sequence: NO_SEQUENCE,
            batch_length: MAX_MATCHES,
        };
        // Ends what an earlier peer may have left unfinished; the device refuses it, and `greet`
        // skips that refusal.
        client.send_bytes(&[DELIMITER])?;
        let hello = client.greet()?;
        client.batch_length = usize::from(hello.max_matches).clamp(1, MAX_MATCHES);
        Ok(client)
    }

    /// Who the device is.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn hello(&mut self) -> Result<Hello, ClientError> {
        match self.ask(&Request::Hello)? {
            Reply::Hello(hello) => Ok(hello),
            reply => Err(unexpected("hello", &reply)),
        }
    }

    /// How the device is, and which blob it uses.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn status(&mut self) -> Result<Status, ClientError> {
        match self.ask(&Request::Status)? {
            Reply::Status(status) => Ok(status),
            reply => Err(unexpected("status", &reply)),
        }
    }

    /// Has the device triangulate `matches`; one answer each, in the same order.
    ///
    /// They travel in batches, several of which are under way at once.
    ///
    /// # Errors
    /// [`ClientError`]; [`Refusal::NoBlob`] inside it if the device has nothing to measure with. A
    /// match that the device cannot triangulate is no error here but an outcome of its own.
    pub fn measure(&mut self, matches: &[Match]) -> Result<Vec<Measured>, ClientError> {
        let mut measured = Vec::with_capacity(matches.len());
        let mut under_way = VecDeque::with_capacity(WINDOW);
        let mut batches = matches.chunks(self.batch_length);
        loop {
            while under_way.len() < WINDOW
                && let Some(batch) = batches.next()
            {
                let batch_on_wire = batch.iter().copied().collect();
                under_way.push_back((self.send(&Request::Measure(batch_on_wire))?, batch));
            }
            let Some((sequence, batch)) = under_way.pop_front() else {
                break;
            };
            let answers = match self.receive(sequence)? {
                Reply::Measured(answers) => answers,
                reply => return Err(unexpected("measure", &reply)),
            };
            if !answers
                .iter()
                .map(|answer| answer.id)
                .eq(batch.iter().map(|asked| asked.id))
            {
                let found = format!(
                    "{} matches asked, {} answers with other ids",
                    batch.len(),
                    answers.len()
                );
                return Err(ClientError::BadReply {
                    asked: "measure",
                    found,
                });
            }
            measured.extend_from_slice(&answers);
        }
        Ok(measured)
    }

    /// The first hello on a link that may still carry the remains of an earlier conversation.
    fn greet(&mut self) -> Result<Hello, ClientError> {
        let sequence = self.send(&Request::Hello)?;
        let deadline = Instant::now() + self.timeout;
        loop {
            match self.next_frame(deadline)? {
                Ok(Received {
                    sequence: found,
                    body: Reply::Hello(hello),
                }) if found == sequence => return Ok(hello),
                Ok(Received {
                    sequence: found,
                    body: Reply::Refused(refusal),
                }) if found == sequence => {
                    return Err(refused(refusal));
                }
                Err(Rejected {
                    refusal: Refusal::WrongVersion { found, supported },
                    ..
                }) => {
                    return Err(ClientError::WrongVersion {
                        device: found,
                        ours: supported,
                    });
                }
                Ok(_) | Err(_) => {}
            }
        }
    }

    fn ask(&mut self, request: &Request) -> Result<Reply, ClientError> {
        let sequence = self.send(request)?;
        self.receive(sequence)
    }

    fn send(&mut self, request: &Request) -> Result<u16, ClientError> {
        self.last_sequence = self.last_sequence.checked_add(1).unwrap_or(NO_SEQUENCE + 1);
        let Some(frame) = self.writer.seal(self.last_sequence, request) else {
            return Err(ClientError::Refused(Refusal::BadFrame));
        };
        let sent = self.stream.write_all(frame);
        sent.map_err(|source| self.broken(source))?;
        Ok(self.last_sequence)
    }

    /// The reply to the request of this number; replies come in the order of the requests.
    fn receive(&mut self, sequence: u16) -> Result<Reply, ClientError> {
        let deadline = Instant::now() + self.timeout;
        match self.next_frame(deadline)? {
            Ok(Received {
                body: Reply::Refused(refusal),
                ..
            }) => Err(refused(refusal)),
            Ok(Received {
                sequence: found,
                body,
            }) if found == sequence => Ok(body),
            Ok(Received {
                sequence: found, ..
            }) => {
                let found = format!("number {found} was answered instead of {sequence}");
                Err(ClientError::BadReply {
                    asked: "a request",
                    found,
                })
            }
            Err(Rejected { refusal, .. }) => Err(ClientError::BadReply {
                asked: "a request",
                found: refusal.to_string(),
            }),
        }
    }

    fn next_frame(
        &mut self,
        deadline: Instant,
    ) -> Result<Result<Received<Reply>, Rejected>, ClientError> {
        loop {
            while let Some(byte) = self.arrived.pop_front() {
                if let Some(frame) = self.reader.push(byte) {
                    return Ok(frame);
                }
            }
            let remaining = deadline.saturating_duration_since(Instant::now());
            if remaining.is_zero() {
                return Err(self.timed_out());
            }
            let mut buffer = [0; 8192];
            let read = self
                .stream
                .set_read_timeout(Some(remaining))
                .and_then(|()| self.stream.read(&mut buffer));
            match read {
                Ok(0) => {
                    return Err(ClientError::Closed {
                        address: self.address.clone(),
                    });
                }
                Ok(count) => self.arrived.extend(&buffer[..count]),
                Err(error)
                    if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) =>
                {
                    return Err(self.timed_out());
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(source) => return Err(self.broken(source)),
            }
        }
    }

    fn send_bytes(&mut self, bytes: &[u8]) -> Result<(), ClientError> {
        self.stream
            .write_all(bytes)
            .map_err(|source| self.broken(source))
    }

    fn timed_out(&self) -> ClientError {
        ClientError::Timeout {
            address: self.address.clone(),
            timeout: self.timeout,
        }
    }

    fn broken(&self, source: std::io::Error) -> ClientError {
        match source.kind() {
            ErrorKind::WouldBlock | ErrorKind::TimedOut => self.timed_out(),
            _ => ClientError::Broken {
                address: self.address.clone(),
                source,
            },
        }
    }
}

/// Tries every address that the name stands for; the last failure counts.
fn connect_tcp(host_and_port: &str, timeout: Duration) -> std::io::Result<TcpStream> {
    let mut failure = std::io::Error::new(ErrorKind::NotFound, "the name stands for no address");
    for address in host_and_port.to_socket_addrs()? {
        match TcpStream::connect_timeout(&address, timeout) {
            Ok(stream) => {
                // Without this, each question waits for the acknowledgement of the one before: 47
                // ms instead of 2.
                stream.set_nodelay(true)?;
                stream.set_write_timeout(Some(timeout))?;
                return Ok(stream);
            }
            Err(error) => failure = error,
        }
    }
    Err(failure)
}

fn refused(refusal: Refusal) -> ClientError {
    match refusal {
        Refusal::WrongVersion { found, supported } => ClientError::WrongVersion {
            device: supported,
            ours: found,
        },
        refusal => ClientError::Refused(refusal),
    }
}

fn unexpected(asked: &'static str, reply: &Reply) -> ClientError {
    let found = match reply {
        Reply::Refused(_) => "a refusal",
        Reply::Hello(_) => "an answer to hello",
        Reply::Status(_) => "an answer to status",
        Reply::Measured(_) => "an answer to measure",
        Reply::Receiving { .. } => "an acknowledgement of a blob's bytes",
        Reply::Active(_) => "an answer to an update",
        Reply::Aborted => "an answer to the end of an update",
        Reply::SelfTested(_) => "an answer to the self-test",
    };
    ClientError::BadReply {
        asked,
        found: found.to_owned(),
    }
}
