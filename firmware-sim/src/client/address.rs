//! The links that a device can be reached over, by their addresses.

use std::time::Duration;

use super::error::ClientError;
use super::transport::{Transport, connect_tcp};

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
