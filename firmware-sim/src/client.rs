//! The workstation's side: a device as something that can be asked.

mod address;
mod error;
mod flash;
mod measure;
#[cfg(feature = "serial")]
mod serial;
mod transport;

use std::collections::VecDeque;
use std::io::ErrorKind;
use std::time::{Duration, Instant};

use ray_device::frame::{DELIMITER, FrameReader, FrameWriter, NO_SEQUENCE, Received, Rejected};
use ray_device::protocol::{
    Hello, Order, Refusal, Reply, Request, SelfTestReport, Status, StoredBlob,
};

use error::unexpected;

pub use error::ClientError;
pub use flash::{Begun, FlashOptions, FlashProgress, Flashed};
pub use transport::Transport;

/// How long an answer may take, unless said otherwise.
pub const DEFAULT_TIMEOUT: Duration = Duration::from_secs(5);

/// A connection to a device.
///
/// # Example
/// ```
/// use firmware_sim::client::DeviceClient;
/// use firmware_sim::simulated::host::SimulatedDevice;
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
    /// `None` only between the end of one connection and the start of the next.
    transport: Option<Box<dyn Transport>>,
    timeout: Duration,
    arrived: VecDeque<u8>,
    reader: FrameReader,
    writer: FrameWriter,
    last_sequence: u16,
    greeting: Hello,
    /// Bytes that came since the connection was made.
    heard: usize,
}

impl DeviceClient {
    /// Connects to `address`, `tcp:HOST:PORT` or `serial:PORT[@BAUD]`, and makes sure that a device
    /// of this protocol version answers.
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
        let mut client = Self {
            address: address.to_owned(),
            transport: None,
            timeout,
            arrived: VecDeque::new(),
            reader: FrameReader::new(),
            writer: FrameWriter::new(),
            last_sequence: NO_SEQUENCE,
            greeting: Hello::default(),
            heard: 0,
        };
        client.reconnect()?;
        Ok(client)
    }

    /// Talks over a link of another kind, on which a device answers already. It cannot be opened
    /// again when it breaks.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn over(link: Box<dyn Transport>, timeout: Duration) -> Result<Self, ClientError> {
        let mut client = Self {
            address: "this link".to_owned(),
            transport: Some(link),
            timeout,
            arrived: VecDeque::new(),
            reader: FrameReader::new(),
            writer: FrameWriter::new(),
            last_sequence: NO_SEQUENCE,
            greeting: Hello::default(),
            heard: 0,
        };
        client.start_over()?;
        Ok(client)
    }

    /// What the device said of itself and its limits when the connection was made.
    pub fn greeting(&self) -> &Hello {
        &self.greeting
    }

    /// Drops the connection, if there still is one, and makes another.
    ///
    /// # Errors
    /// [`ClientError`].
    pub fn reconnect(&mut self) -> Result<(), ClientError> {
        // The old one first: a serial port can be open only once.
        self.transport = None;
        self.transport = Some(address::open(&self.address, self.timeout)?);
        self.start_over()
    }

    fn start_over(&mut self) -> Result<(), ClientError> {
        self.arrived.clear();
        self.heard = 0;
        self.reader = FrameReader::new();
        // Ends what an earlier peer may have left unfinished; the device refuses it, and `greet`
        // skips that refusal.
        self.send_bytes(&[DELIMITER])?;
        self.greeting = self.greet()?;
        Ok(())
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

    /// Makes the blob of the other slot active, after the device has checked all of it. On a device with an
    /// owner: [`DeviceClient::order`].
    ///
    /// # Errors
    /// [`ClientError`]; [`Refusal::NothingToRollBackTo`] inside it if there is none.
    pub fn rollback(&mut self) -> Result<StoredBlob, ClientError> {
        match self.ask(&Request::Rollback)? {
            Reply::Active(stored) => Ok(stored),
            reply => Err(unexpected("rollback", &reply)),
        }
    }

    /// What the owner of a device orders. For a rollback the blob that is active then; `None` where an
    /// update was given up.
    ///
    /// # Errors
    /// [`ClientError`]; inside it [`Refusal::StaleOrder`] and [`Refusal::BadSignature`] for an order that is
    /// not for this device and moment, and the refusals of what was ordered.
    pub fn order(&mut self, order: &Order) -> Result<Option<StoredBlob>, ClientError> {
        match self.ask(&Request::Order(*order))? {
            Reply::Active(stored) => Ok(Some(stored)),
            Reply::Aborted => Ok(None),
            reply => Err(unexpected("an order", &reply)),
        }
    }

    /// Has the device compare the self-tests in its blob: bits that the packing host computed.
    ///
    /// # Errors
    /// [`ClientError`]; [`Refusal::NoBlob`] inside it if there is nothing to test. A test that fails
    /// is no error here but a number in the report.
    pub fn self_test(&mut self) -> Result<SelfTestReport, ClientError> {
        match self.ask(&Request::SelfTest)? {
            Reply::SelfTested(report) => Ok(report),
            reply => Err(unexpected("self-test", &reply)),
        }
    }

    /// The first hello on a link that may still carry the remains of an earlier conversation.
    fn greet(&mut self) -> Result<Hello, ClientError> {
        let sequence = self.send(&Request::Hello)?;
        let deadline = Instant::now() + self.timeout;
        let mut is_device = false;
        loop {
            let frame = match self.next_frame(deadline) {
                Err(
                    ClientError::Timeout { .. }
                    | ClientError::Closed { .. }
                    | ClientError::Broken { .. },
                ) if self.heard > 0 && !is_device => {
                    return Err(ClientError::NotADevice {
                        address: self.address.clone(),
                        bytes: self.heard,
                    });
                }
                frame => frame?,
            };
            match frame {
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
                Ok(_) => is_device = true,
                Err(_) => {}
            }
        }
    }

    fn ask(&mut self, request: &Request) -> Result<Reply, ClientError> {
        let sequence = self.send(request)?;
        self.receive(sequence)
    }

    /// How many requests may be under way at once.
    fn window(&self) -> usize {
        self.transport
            .as_ref()
            .map_or(1, |transport| transport.window().max(1))
    }

    fn send(&mut self, request: &Request) -> Result<u16, ClientError> {
        self.last_sequence = self.last_sequence.checked_add(1).unwrap_or(NO_SEQUENCE + 1);
        let Some(frame) = self.writer.seal(self.last_sequence, request) else {
            return Err(ClientError::Refused(Refusal::BadFrame));
        };
        let sent = write(self.transport.as_mut(), frame);
        sent.map_err(|source| self.broken(source))?;
        Ok(self.last_sequence)
    }

    /// The reply to the request of this number. Replies come in the order of the requests; those to
    /// requests whose answers nobody waits for any more are skipped.
    fn receive(&mut self, sequence: u16) -> Result<Reply, ClientError> {
        let deadline = Instant::now() + self.timeout;
        loop {
            match self.next_frame(deadline)? {
                Ok(Received {
                    sequence: found,
                    body: Reply::Refused(refusal),
                }) if found == sequence || found == NO_SEQUENCE => return Err(refused(refusal)),
                Ok(Received {
                    sequence: found,
                    body,
                }) if found == sequence => return Ok(body),
                Ok(_) => {}
                Err(Rejected { refusal, .. }) => {
                    return Err(ClientError::BadReply {
                        asked: "a request",
                        found: refusal.to_string(),
                    });
                }
            }
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
            let read = match &mut self.transport {
                Some(transport) => transport.read(&mut buffer, remaining),
                None => Ok(0),
            };
            match read {
                Ok(0) => {
                    return Err(ClientError::Closed {
                        address: self.address.clone(),
                    });
                }
                Ok(count) => {
                    self.heard = self.heard.saturating_add(count);
                    self.arrived.extend(&buffer[..count]);
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(source) => return Err(self.broken(source)),
            }
        }
    }

    fn send_bytes(&mut self, bytes: &[u8]) -> Result<(), ClientError> {
        write(self.transport.as_mut(), bytes).map_err(|source| self.broken(source))
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

fn write(transport: Option<&mut Box<dyn Transport>>, bytes: &[u8]) -> std::io::Result<()> {
    match transport {
        Some(transport) => transport.write_all(bytes),
        None => Err(ErrorKind::NotConnected.into()),
    }
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
