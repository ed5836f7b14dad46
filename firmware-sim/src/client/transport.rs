//! The links that a device can be reached over, and their addresses.

use std::fmt::Debug;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use super::ClientError;

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

/// Opens the link that `address` names.
pub fn open(address: &str, timeout: Duration) -> Result<Box<dyn Transport>, ClientError> {
    let unknown = || ClientError::UnknownAddress {
        address: address.to_owned(),
    };
    let failed = |source| ClientError::Connect {
        address: address.to_owned(),
        source,
    };
    match address.split_once(':') {
        Some(("tcp", host_and_port)) => {
            host_and_port
                .rsplit_once(':')
                .filter(|(host, _)| !host.is_empty())
                .and_then(|(_, port)| port.parse::<u16>().ok())
                .ok_or_else(unknown)?;
            let stream = connect_tcp(host_and_port, timeout).map_err(failed)?;
            Ok(Box::new(stream))
        }
        Some(("serial", port)) => {
            let (port, baud) = serial_port(port).ok_or_else(unknown)?;
            open_serial(address, port, baud, timeout)
        }
        _ => Err(unknown()),
    }
}

/// Baud rate where the address gives none; a USB device does not care.
const DEFAULT_BAUD: u32 = 115_200;

/// Name and baud rate from `NAME[@BAUD]`.
fn serial_port(text: &str) -> Option<(&str, u32)> {
    let (name, baud) = match text.rsplit_once('@') {
        Some((name, baud)) => (name, baud.parse().ok().filter(|&baud| baud > 0)?),
        None => (text, DEFAULT_BAUD),
    };
    (!name.is_empty()).then_some((name, baud))
}

#[cfg(feature = "serial")]
fn open_serial(
    address: &str,
    port: &str,
    baud: u32,
    timeout: Duration,
) -> Result<Box<dyn Transport>, ClientError> {
    super::serial::open(port, baud, timeout).map_err(|source| ClientError::Connect {
        address: address.to_owned(),
        source,
    })
}

#[cfg(not(feature = "serial"))]
fn open_serial(
    address: &str,
    _: &str,
    _: u32,
    _: Duration,
) -> Result<Box<dyn Transport>, ClientError> {
    Err(ClientError::NoSerial {
        address: address.to_owned(),
    })
}

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

#[cfg(test)]
mod tests {
    use super::serial_port;

    #[test]
    fn a_serial_port_may_name_its_baud_rate() {
        assert_eq!(serial_port("/dev/ttyACM0"), Some(("/dev/ttyACM0", 115_200)));
        assert_eq!(serial_port("COM3@9600"), Some(("COM3", 9600)));
        for wrong in ["", "@9600", "COM3@", "COM3@0", "COM3@fast"] {
            assert_eq!(serial_port(wrong), None, "{wrong}");
        }
    }
}
