//! The device as a Cortex-M4F image in QEMU: the bits of the host, noise on its line, and its end.
//!
//! Needs QEMU and a bare-metal toolchain; where they are missing these tests fail and name what to
//! install. `tests/run` installs them first.

mod rig;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use firmware_sim::client::DeviceClient;
use firmware_sim::protocol::Measured;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A `firmware-sim` process with a device in it.
struct Running {
    process: Child,
    address: String,
}

impl Running {
    fn start(kind: &str, flash: &[u8]) -> Self {
        let mut file = tempfile::NamedTempFile::new().unwrap();
        file.write_all(flash).unwrap();
        let mut process = Command::new(env!("CARGO_BIN_EXE_firmware-sim"))
            .args([kind, "--listen", "127.0.0.1:0", "--flash-file"])
            .arg(file.path())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(process.stdout.take().unwrap())
            .read_line(&mut line)
            .unwrap();
        let Some(address) = line.strip_prefix("listening on ") else {
            panic!(
                "firmware-sim {kind} did not start: its message stands above; {:?}",
                process.wait()
            );
        };
        Self {
            address: address.trim_end().to_owned(),
            process,
        }
    }

    fn client(&self) -> DeviceClient {
        DeviceClient::connect(&format!("tcp:{}", self.address)).unwrap()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn bits(measured: &Measured) -> (u32, Result<[Option<u32>; 7], u8>) {
    (measured.id, measured.outcome.map(|point| point.to_bits()))
}

#[test]
fn it_answers_the_bits_of_the_host_for_500_matches() {
    let blob = rig::blob();
    let on_host = Running::start("host", &blob);
    let in_qemu = Running::start("qemu", &blob);
    let asked = rig::matches(500, 5);
    let from_host = on_host.client().measure(&asked).unwrap();
    let from_qemu = in_qemu.client().measure(&asked).unwrap();
    assert_eq!(from_qemu.len(), 500);
    for (host, qemu) in from_host.iter().zip(&from_qemu) {
        assert_eq!(bits(host), bits(qemu), "{:?}", asked[host.id as usize]);
    }
    let points = from_qemu
        .iter()
        .filter(|measured| measured.outcome.is_ok_and(|p| p.sigma_mm.is_some()))
        .count();
    assert!(
        points > 200,
        "only {points} matches gave a point: little was compared"
    );

    let mut client = in_qemu.client();
    assert_eq!(client.hello().unwrap().device, "firmware-sim cortex-m");
    let start = Instant::now();
    let status = client.status().unwrap();
    assert_eq!(Ok(rig::IDENTITY), status.blob.map(|blob| blob.identity));
    // The clock runs, at the rate of this world but for its rounding and for what load takes.
    std::thread::sleep(Duration::from_millis(300));
    let passed_ms = client.status().unwrap().uptime_ms - status.uptime_ms;
    let most_ms = start.elapsed().as_millis() as u64 + 2;
    assert!(
        (100..=most_ms).contains(&passed_ms),
        "{passed_ms} ms of at most {most_ms}"
    );
}

#[test]
fn noise_on_its_line_is_answered_and_does_no_harm() {
    let device = Running::start("qemu", b"no blob at all");
    let mut random = ChaCha8Rng::seed_from_u64(6);
    let mut stream = TcpStream::connect(&device.address).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(30)))
        .unwrap();
    for _ in 0..100 {
        let length = random.random_range(1..3000);
        let mut noise: Vec<u8> = (0..length).map(|_| random.random_range(1..=255)).collect();
        noise.push(0);
        stream.write_all(&noise).unwrap();
        let mut byte = [0xff];
        while byte != [0] {
            stream.read_exact(&mut byte).unwrap();
        }
    }
    // Left unfinished by this peer, cut off by the next.
    stream.write_all(&[0x55; 700]).unwrap();
    drop(stream);
    let status = device.client().status().unwrap();
    assert_eq!(status.refused, 101);
    assert_eq!(
        status.blob,
        Err(ray_runtime::OpenError::BadMagic { found: 0 }.code())
    );
}

/// However it ends: here it is killed, which it cannot answer in any way.
#[test]
fn qemu_ends_with_its_parent() {
    let mut device = Running::start("qemu", &[]);
    drop(device.client());
    device.process.kill().unwrap();
    device.process.wait().unwrap();
    let deadline = Instant::now() + Duration::from_secs(10);
    while TcpStream::connect(&device.address).is_ok() {
        assert!(
            Instant::now() < deadline,
            "QEMU still listens on {}",
            device.address
        );
        std::thread::sleep(Duration::from_millis(20));
    }
}

#[test]
fn what_cannot_be_run_ends_with_code_2_and_its_reason() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let taken = taken.local_addr().unwrap().to_string();
    let long = tempfile::NamedTempFile::new().unwrap();
    long.as_file().set_len((16 << 20) + 1).unwrap();
    let long = long.path().to_str().unwrap();
    let here = Path::new(env!("CARGO_MANIFEST_DIR")).to_str().unwrap();
    for kind in ["host", "qemu"] {
        for (arguments, reason) in [
            (&["--listen", &taken][..], taken.as_str()),
            (&["--listen", "nowhere"], "ADDRESS:PORT"),
            (&["--flash-file", "/no/such.rays"], "/no/such.rays"),
            (&["--flash-file", here], here),
            (&["--flash-file", long], "16777217 bytes"),
            (&["--color"], "--color"),
        ] {
            let output = Command::new(env!("CARGO_BIN_EXE_firmware-sim"))
                .arg(kind)
                .args(arguments)
                .output()
                .unwrap();
            let message = String::from_utf8_lossy(&output.stderr);
            assert_eq!(
                output.status.code(),
                Some(2),
                "{kind} {arguments:?}: {message}"
            );
            assert!(message.contains(reason), "{kind} {arguments:?}: {message}");
            assert!(output.stdout.is_empty(), "{kind} {arguments:?}");
        }
    }
}
