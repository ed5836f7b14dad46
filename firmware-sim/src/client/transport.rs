//! A link to a device, and TCP as one.

use std::fmt::Debug;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

/// A byte stream to a device.
pub trait Transport: Debug + Send {
    /// Waits until something arrives and returns how many bytes of `buffer` were filled; 0 only when
    /// the other side has closed the stream.
    ///
    /// # Errors
    /// [`ErrorKind::TimedOut`] or [`ErrorKind::WouldBlock`] if nothing came within `timeout`; any
    /// other if the stream broke.
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> std::io::Result<usize>;

    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// If the stream broke, or does not take them in time.
    fn write_all(&mut self, bytes: &[u8]) -> std::io::Result<()>;

    /// Requests that may be under way at once: 1 on a line that loses what a busy device does not
    /// take in.
    fn window(&self) -> usize;
}

/// Requests under way at once over TCP: enough to hide the link's delay, few enough that neither
/// side's socket buffer fills up while the other is still sending.
const TCP_WINDOW: usize = 8;

impl Transport for TcpStream {
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> std::io::Result<usize> {
        self.set_read_timeout(Some(timeout))?;
        Read::read(self, buffer)
    }

    fn write_all(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        Write::write_all(self, bytes)
    }

    fn window(&self) -> usize {
        TCP_WINDOW
    }
}

/// Tries every address that the name stands for; the last failure counts.
pub fn connect_tcp(host_and_port: &str, timeout: Duration) -> std::io::Result<TcpStream> {
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
