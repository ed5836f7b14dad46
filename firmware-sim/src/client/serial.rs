//! A serial port as a link.

use std::fmt::{Debug, Formatter};
use std::io::{ErrorKind, Read, Write};
use std::time::Duration;

use super::transport::Transport;

struct SerialLink(Box<dyn serialport::SerialPort>);

/// Opens the port, eight bits without parity.
pub fn open(port: &str, baud: u32, timeout: Duration) -> std::io::Result<Box<dyn Transport>> {
    let port = serialport::new(port, baud).timeout(timeout).open();
    port.map(|port| Box::new(SerialLink(port)) as Box<dyn Transport>)
        .map_err(|error| {
            let kind = match error.kind() {
                serialport::ErrorKind::NoDevice => ErrorKind::NotFound,
                serialport::ErrorKind::InvalidInput => ErrorKind::InvalidInput,
                serialport::ErrorKind::Io(kind) => kind,
                serialport::ErrorKind::Unknown => ErrorKind::Other,
            };
            std::io::Error::new(kind, error)
        })
}

impl Debug for SerialLink {
    fn fmt(&self, out: &mut Formatter<'_>) -> std::fmt::Result {
        write!(out, "SerialLink({:?})", self.0.name())
    }
}

impl Transport for SerialLink {
    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> std::io::Result<usize> {
        self.0.set_timeout(timeout).map_err(std::io::Error::from)?;
        self.0.read(buffer)
    }

    fn write_all(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.0.write_all(bytes)
    }

    /// A device that programs its flash does not empty its receiver: one request at a time.
    fn window(&self) -> usize {
        1
    }
}
