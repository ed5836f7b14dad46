//! Over a serial port: a pseudo terminal, with the device behind it.

use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::thread;
use std::time::{Duration, Instant};

use crate::rig;
use firmware_sim::client::{ClientError, DeviceClient, FlashOptions};
use firmware_sim::simulated::sim_flash::SimFlash;
use ray_device::app::Device;
use ray_device::port::{Clock, Link};
use ray_device::session::Session;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};

struct HostClock(Instant);

impl Clock for HostClock {
    fn uptime_ms(&mut self) -> u64 {
        self.0.elapsed().as_millis() as u64
    }
}

/// The device's end of the line, on which every so many bytes one is damaged.
struct Line {
    end: File,
    damage_every: usize,
    count: usize,
}

impl Link for Line {
    type Error = std::io::Error;

    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let length = self.end.read(buffer)?;
        for byte in &mut buffer[..length] {
            self.count += 1;
            if self.damage_every > 0 && self.count.is_multiple_of(self.damage_every) {
                *byte ^= 0x10;
            }
        }
        Ok(length)
    }

    fn write_all(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.end.write_all(bytes)
    }
}

/// A device behind a pseudo terminal: its address, and what keeps the line open.
fn device(damage_every: usize) -> (String, File) {
    let end = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
    grantpt(&end).unwrap();
    unlockpt(&end).unwrap();
    let path = ptsname(&end, Vec::new()).unwrap().into_string().unwrap();
    let mut options = OpenOptions::new();
    let open = options.read(true).write(true).open(&path).unwrap();
    // Without this, what the device says before anybody listens would come back to it.
    let mut modes = rustix::termios::tcgetattr(&open).unwrap();
    modes.make_raw();
    rustix::termios::tcsetattr(&open, rustix::termios::OptionalActions::Now, &modes).unwrap();
    let mut line = Line {
        end: end.into(),
        damage_every,
        count: 0,
    };
    thread::spawn(move || {
        let mut flash = SimFlash::blank(9, 0).unwrap();
        let mut regions = flash.regions();
        let mut device = Device::new("behind a line", HostClock(Instant::now()));
        let mut session = Session::new();
        loop {
            let mut epoch = device.epoch(&mut regions);
            if session.serve(&mut line, &mut epoch).is_err() {
                return;
            }
        }
    });
    (format!("serial:{path}"), open)
}

#[test]
fn it_is_flashed_and_measures() {
    let (address, _open) = device(0);
    let mut client = DeviceClient::connect(&address).unwrap();
    assert_eq!(client.hello().unwrap().device, "behind a line");
    let flashed = client.flash(&rig::blob(), &FlashOptions::default(), &mut |_| {});
    assert_eq!(flashed.unwrap().resumed, 0);
    assert_eq!(client.measure(&rig::matches(200, 1)).unwrap().len(), 200);
    // And again, at another rate.
    drop(client);
    let mut client = DeviceClient::connect(&format!("{address}@9600")).unwrap();
    assert!(client.status().unwrap().blob.is_ok());
}

#[test]
fn a_line_that_damages_bytes_is_overcome() {
    let (address, _open) = device(2000);
    let timeout = Duration::from_millis(500);
    let mut client = DeviceClient::connect_within(&address, timeout).unwrap();
    let options = FlashOptions {
        timeout,
        ..FlashOptions::default()
    };
    let flashed = client.flash(&rig::blob(), &options, &mut |_| {}).unwrap();
    assert!(flashed.resumed > 0, "{flashed:?}");
}

#[test]
fn a_port_that_is_not_there_is_told() {
    let error = DeviceClient::connect("serial:/dev/no-such-port").unwrap_err();
    let text = error.to_string();
    assert!(matches!(error, ClientError::Connect { .. }), "{text}");
    assert!(text.contains("no such port"), "{text}");
}
