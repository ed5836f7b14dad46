//! The simulated device on the host, end to end over TCP.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::time::{Duration, Instant};

use crate::rig;
use firmware_sim::client::{ClientError, DeviceClient};
use firmware_sim::simulated::host::{FLASH_LENGTH, SimulatedDevice};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use ray_device::protocol::{Match, Point, Refusal};
use ray_runtime::{Aligned, MeasureError, OpenError, PixelPoint, RayBlob};

fn device(flash: &[u8]) -> (SimulatedDevice, DeviceClient) {
    let device = SimulatedDevice::start("127.0.0.1:0".parse().unwrap(), flash).unwrap();
    let client = DeviceClient::connect(&format!("tcp:{}", device.address())).unwrap();
    (device, client)
}

/// What the runtime says in this very process.
fn expected(blob: &RayBlob<'_>, asked: &Match) -> Result<Point, u8> {
    let pixel = |sighting: ray_device::protocol::Sighting| {
        (
            usize::from(sighting.camera),
            PixelPoint::new(sighting.u_px, sighting.v_px),
        )
    };
    blob.triangulate_with_covariance(pixel(asked.first), pixel(asked.second))
        .map(Point::from)
        .map_err(MeasureError::code)
}

#[test]
fn it_says_who_it_is_and_what_it_holds() {
    let blob = rig::blob();
    let (_, mut client) = device(&blob);
    let hello = client.hello().unwrap();
    assert_eq!(hello.device, "firmware-sim host");
    assert_eq!(hello.firmware, env!("CARGO_PKG_VERSION"));

    let status = client.status().unwrap();
    assert_eq!(
        (status.answered, status.refused),
        (2, 0),
        "the handshake and hello"
    );
    let held = status.blob.unwrap();
    assert_eq!(held.identity, rig::IDENTITY);
    assert_eq!(held.length as usize, blob.len());
    assert_eq!(held.camera_count, 2);
    let cameras = held.cameras.iter();
    let cameras = cameras.map(|camera| (camera.name.as_str(), camera.width_px, camera.height_px));
    assert!(cameras.eq(rig::CAMERAS));
}

#[test]
fn it_measures_the_bits_of_the_runtime() {
    let blob = rig::blob();
    let (_, mut client) = device(&blob);
    let mut aligned = Aligned([0; 16384]);
    aligned.0[..blob.len()].copy_from_slice(&blob);
    let opened = RayBlob::open(&aligned.0[..blob.len()]).unwrap();

    // Neither a multiple of a batch nor of the batches under way at once.
    let asked = rig::matches(3001, 1);
    let measured = client.measure(&asked).unwrap();
    assert_eq!(measured.len(), asked.len());
    let mut codes = std::collections::BTreeMap::new();
    for (asked, measured) in asked.iter().zip(&measured) {
        assert_eq!(measured.id, asked.id);
        let bits = |outcome: Result<Point, u8>| outcome.map(|point| point.to_bits());
        assert_eq!(
            bits(measured.outcome),
            bits(expected(&opened, asked)),
            "match {}",
            asked.id
        );
        // Two sightings of one camera never give a point, and of the two cameras it is known.
        if let Ok(point) = measured.outcome {
            assert!(point.sigma_mm.is_some_and(|s| s.iter().all(|s| *s > 0.0)));
        }
        *codes
            .entry(measured.outcome.err().unwrap_or(0))
            .or_insert(0) += 1;
    }
    // Points, pixels outside, a camera that is not there, and rays that meet behind the cameras.
    assert!(
        codes[&0] > 1000 && codes[&64] > 100 && codes[&65] > 30 && codes[&68] > 10,
        "{codes:?}"
    );
    assert_eq!(client.measure(&[]).unwrap(), []);
}

#[test]
fn an_empty_or_damaged_flash_is_told_and_measures_nothing() {
    let blob = rig::blob();
    let mut damaged = blob.clone();
    *damaged.last_mut().unwrap() ^= 0x80;
    let mut overlong = blob.clone();
    overlong[8..12].copy_from_slice(&(FLASH_LENGTH as u32 + 1).to_le_bytes());
    let magic = OpenError::BadMagic { found: 0 }.code();
    let crc = OpenError::BadCrc {
        stated: 0,
        computed: 0,
    }
    .code();
    let truncated = OpenError::Truncated { need: 0, have: 0 }.code();
    let cut = &blob[..blob.len() - 100];
    for (flash, code) in [
        (&[][..], magic),
        (&damaged, crc),
        (cut, truncated),
        (&overlong, truncated),
        (b"RAYS", truncated),
        (b"no blob at all, and a bit longer", magic),
    ] {
        let (_, mut client) = device(flash);
        assert_eq!(client.status().unwrap().blob, Err(code));
        let error = client.measure(&rig::matches(1, 1)).unwrap_err();
        assert!(
            matches!(error, ClientError::Refused(Refusal::NoBlob { open_error }) if open_error == code),
            "{error:?}"
        );
        assert_eq!(client.status().unwrap().refused, 1);
    }
}

#[test]
fn a_blob_may_be_followed_by_anything() {
    let mut flash = rig::blob();
    flash.extend(std::iter::repeat_n(0xa5, 1000));
    let (_, mut client) = device(&flash);
    assert!(client.status().unwrap().blob.is_ok());
}

#[test]
fn a_blob_longer_than_a_slot_is_refused() {
    let flash = vec![0; FLASH_LENGTH / 2];
    let error = SimulatedDevice::start("127.0.0.1:0".parse().unwrap(), &flash).unwrap_err();
    assert_eq!(error.kind(), std::io::ErrorKind::InvalidInput);
}

#[test]
fn one_peer_does_not_disturb_another() {
    let (device, mut client) = device(&rig::blob());
    let mut noise = TcpStream::connect(device.address()).unwrap();
    noise.write_all(&[0x55; 500]).unwrap();
    let asked = rig::matches(100, 3);
    let before = client.measure(&asked).unwrap();
    noise.write_all(&[0; 10]).unwrap();
    drop(noise);
    let after = client.measure(&asked).unwrap();
    assert_eq!(format!("{before:?}"), format!("{after:?}"));
}

#[test]
fn noise_is_answered_and_the_next_request_is_understood() {
    let (device, mut client) = device(&rig::blob());
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let mut stream = TcpStream::connect(device.address()).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(10)))
        .unwrap();
    for _ in 0..50 {
        let mut noise: Vec<u8> = (0..random.random_range(1..3000))
            .map(|_| random.random_range(1..=255))
            .collect();
        noise.push(0);
        stream.write_all(&noise).unwrap();
        // Exactly one answer, which ends in the only zero.
        let mut byte = [0xff];
        while byte != [0] {
            stream.read_exact(&mut byte).unwrap();
        }
    }
    assert_eq!(client.status().unwrap().refused, 50);
}

#[test]
fn a_link_that_ends_or_stays_silent_is_an_error_in_time() {
    let silent = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp:{}", silent.local_addr().unwrap());
    let limit = Duration::from_millis(200);
    let start = Instant::now();
    let error = DeviceClient::connect_within(&address, limit).unwrap_err();
    assert!(matches!(error, ClientError::Timeout { .. }), "{error}");
    // Generous, for machines under load; without a limit it would last for good.
    assert!(start.elapsed() >= limit && start.elapsed() < Duration::from_secs(20));

    let closing = std::thread::spawn(move || {
        for _ in 0..2 {
            let (mut peer, _) = silent.accept().unwrap();
            let _ = peer.read(&mut [0; 64]);
        }
    });
    let error = DeviceClient::connect(&address).unwrap_err();
    assert!(
        matches!(
            error,
            ClientError::Closed { .. } | ClientError::Broken { .. }
        ),
        "{error}"
    );
    closing.join().unwrap();

    let error = DeviceClient::connect(&address).unwrap_err();
    assert!(matches!(error, ClientError::Connect { .. }), "{error}");
}

#[test]
fn an_address_of_no_known_kind_is_refused() {
    for address in [
        "",
        "127.0.0.1:7777",
        "tcp:",
        "tcp:localhost",
        "tcp:h:70000",
        "tcp::7777",
        "serial:",
        "serial:/dev/x@fast",
    ] {
        let error = DeviceClient::connect(address).unwrap_err();
        assert!(
            matches!(error, ClientError::UnknownAddress { .. }),
            "{address}: {error}"
        );
    }
}
