//! The device as a Cortex-M4F image in QEMU: the bits of the host, noise on its line, and its end.
//!
//! Needs QEMU and a bare-metal toolchain; where they are missing these tests fail and name what to
//! install. `tests/run` installs them first.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use crate::rig;
use crate::running::Running;
use firmware_sim::client::{DeviceClient, FlashOptions};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use ray_device::protocol::Measured;

fn bits(measured: &Measured) -> (u32, Result<[Option<u32>; 7], u8>) {
    (measured.id, measured.outcome.map(|point| point.to_bits()))
}

#[test]
fn it_answers_the_bits_of_the_host_for_500_matches() {
    let blob = rig::blob();
    let on_host = Running::with_blob("host", &blob);
    let in_qemu = Running::with_blob("qemu", &blob);
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
    let device = Running::start("qemu", &[]);
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

/// One file, three devices after each other: what is flashed to one is in the next, bit for bit.
#[test]
fn host_and_qemu_keep_their_flash_in_the_same_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a, b.flash");
    let asked = rig::matches(300, 8);
    let mut expected: Option<Vec<_>> = None;
    let mut answers_are_the_same = |client: &mut DeviceClient| {
        let measured = client.measure(&asked).unwrap();
        let measured: Vec<_> = measured.iter().map(bits).collect();
        assert_eq!(*expected.get_or_insert(measured.clone()), measured);
    };
    let options = FlashOptions::default();
    let other = rig::blob_of(*b"another identity");

    let device = Running::keeping(
        "qemu",
        &file,
        &["--camera=left=640x480", "--camera=right=600x500"],
    );
    let mut client = device.client();
    let flashed = client.flash(&rig::blob(), &options, &mut |_| {}).unwrap();
    assert_eq!((flashed.stored.slot, flashed.resumed), (0, 0));
    answers_are_the_same(&mut client);
    let flashed = client.flash(&other, &options, &mut |_| {}).unwrap();
    assert_eq!((flashed.stored.slot, flashed.stored.sequence), (1, 2));
    drop((client, device));

    let device = Running::keeping("host", &file, &[]);
    let mut client = device.client();
    let status = client.status().unwrap();
    assert_eq!(status.blob.unwrap().identity, *b"another identity");
    assert_eq!(status.rig.unwrap().cameras.len(), 2);
    answers_are_the_same(&mut client);
    assert_eq!(client.rollback().unwrap().identity, rig::IDENTITY);
    drop((client, device));

    let device = Running::keeping("qemu", &file, &[]);
    let mut client = device.client();
    let status = client.status().unwrap();
    assert_eq!(status.blob.unwrap().identity, rig::IDENTITY);
    answers_are_the_same(&mut client);
    assert_eq!(client.rollback().unwrap().identity, *b"another identity");
    // The golden blob is for other cameras, and brings self-tests with it.
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/golden/stereo-v3-small.rays");
    let golden = std::fs::read(golden).unwrap();
    let refused = client.flash(&golden, &options, &mut |_| {}).unwrap_err();
    assert!(refused.to_string().contains("64 px wide"), "{refused}");
    assert_eq!(client.status().unwrap().active_slot, Some(1));
}

#[test]
fn the_self_tests_of_a_golden_blob_hold_on_the_cortex_m4f() {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/golden/stereo-v3-small.rays");
    for kind in ["host", "qemu"] {
        let device = Running::start(kind, &[]);
        let mut client = device.client();
        let blob = std::fs::read(&golden).unwrap();
        client
            .flash(&blob, &FlashOptions::default(), &mut |_| {})
            .unwrap();
        let report = client.self_test().unwrap();
        assert!(report.tests > 0);
        assert_eq!(
            (report.equal, report.unanswered),
            (report.tests, 0),
            "{kind}"
        );
    }
}

/// Killed in the midst of an update, QEMU ends, too, and the file is free again.
#[test]
fn a_cortex_m_that_is_killed_keeps_one_of_the_two_blobs() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("device.flash");
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let options = FlashOptions {
        retries: 0,
        ..FlashOptions::default()
    };
    let mut before = None;
    for number in 0..6_u8 {
        let mut device = Running::keeping("qemu", &file, &[]);
        let mut client = device.client();
        let found = client.status().unwrap().blob.ok().map(|blob| blob.identity);
        assert!(number == 0 || found == before || found == Some([number - 1; 16]));
        before = found;
        let pause = Duration::from_millis(random.random_range(0..250));
        let killer = std::thread::spawn(move || {
            std::thread::sleep(pause);
            device.process.kill().unwrap();
            device.process.wait().unwrap();
        });
        let blob = rig::blob_of([number; 16]);
        if client.flash(&blob, &options, &mut |_| {}).is_ok() {
            before = Some([number; 16]);
        }
        killer.join().unwrap();
    }
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
            (&["--flash-file", "/no/such.flash"], "/no/such.flash"),
            (&["--flash-file", here], here),
            (&["--flash-file", long], "16777217 bytes"),
            (&["--camera", "left=640"], "NAME=WIDTHxHEIGHT"),
            (&["--serial", "7"], "--camera"),
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
