//! Flashing over TCP: what arrives, what is refused, links that break, devices that are killed.

use std::io::{BufReader, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use crate::rig;
use crate::running::Running;
use firmware_sim::client::{Begun, ClientError, DeviceClient, FlashOptions};
use firmware_sim::simulated::flash_file;
use firmware_sim::simulated::host::SimulatedDevice;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use ray_device::frame::{DELIMITER, FrameReader, FrameWriter, checksum};
use ray_device::protocol::{
    CameraStatus, Chunk, IDENTITY_LENGTH, MAX_CHUNK, NewBlob, Refusal, Reply, Request, Rig,
    RigPart, SlotState, name,
};

const OTHER: [u8; IDENTITY_LENGTH] = *b"another identity";

fn device(blob: &[u8]) -> (SimulatedDevice, DeviceClient) {
    let device = SimulatedDevice::start("127.0.0.1:0".parse().unwrap(), blob).unwrap();
    let client = DeviceClient::connect(&format!("tcp:{}", device.address())).unwrap();
    (device, client)
}

fn announced(blob: &[u8], identity: [u8; IDENTITY_LENGTH]) -> NewBlob {
    NewBlob {
        length: blob.len() as u32,
        checksum: checksum(blob),
        identity,
        rig_serial: None,
        signature: None,
    }
}

fn active(client: &mut DeviceClient) -> Result<[u8; IDENTITY_LENGTH], u8> {
    client.status().unwrap().blob.map(|blob| blob.identity)
}

fn refusal<T: std::fmt::Debug>(outcome: Result<T, ClientError>) -> Refusal {
    match outcome {
        Err(ClientError::Refused(refusal)) => refusal,
        other => panic!("{other:?}"),
    }
}

#[test]
fn flash_measure_flash_roll_back() {
    let (_device, mut client) = device(&[]);
    assert!(active(&mut client).is_err());
    let mut steps = Vec::new();
    let options = FlashOptions::default();
    let blob = rig::blob();
    let flashed = client.flash(&blob, &options, &mut |step| steps.push(step.stored));
    let flashed = flashed.unwrap();
    assert_eq!((flashed.stored.slot, flashed.was_active), (0, false));
    assert!(steps.is_sorted() && steps.last() == Some(&(blob.len() as u32)));
    assert_eq!(active(&mut client), Ok(rig::IDENTITY));
    assert_eq!(client.measure(&rig::matches(100, 1)).unwrap().len(), 100);
    let again = client.flash(&blob, &options, &mut |_| {}).unwrap();
    assert!(again.was_active);
    assert_eq!(refusal(client.rollback()), Refusal::NothingToRollBackTo);

    client
        .flash(&rig::blob_of(OTHER), &options, &mut |_| {})
        .unwrap();
    assert_eq!(active(&mut client), Ok(OTHER));
    let status = client.status().unwrap();
    assert_eq!((status.updates, status.active_slot), (2, Some(1)));
    assert!(matches!(status.slots[0], SlotState::Holds(held) if held.identity == rig::IDENTITY));
    assert_eq!(client.rollback().unwrap().slot, 0);
    assert_eq!(active(&mut client), Ok(rig::IDENTITY));
    assert_eq!(client.rollback().unwrap().slot, 1);
    assert_eq!(client.status().unwrap().rollbacks, 2);
}

#[test]
fn what_is_no_blob_is_refused_here_and_there() {
    let (_device, mut client) = device(&rig::blob());
    let mut damaged = rig::blob_of(OTHER);
    damaged[100] ^= 1;
    let outcome = client.flash(&damaged, &FlashOptions::default(), &mut |_| {});
    assert!(matches!(outcome, Err(ClientError::NotABlob(_))));

    let mut send = |bytes: &[u8], identity| {
        let begun = client.begin_update(&announced(bytes, identity)).unwrap();
        assert_eq!(begun, Begun::Receiving { received: 0 });
        for (offset, chunk) in (0..).step_by(MAX_CHUNK).zip(bytes.chunks(MAX_CHUNK)) {
            client.chunk(offset, chunk).unwrap();
        }
        let refusal = refusal(client.finish_update());
        assert_eq!(active(&mut client), Ok(rig::IDENTITY));
        refusal
    };
    assert_eq!(send(&damaged, OTHER), Refusal::NotABlob { open_error: 5 });
    assert_eq!(send(&[7; 100], OTHER), Refusal::NotABlob { open_error: 2 });
    let other = rig::blob_of(OTHER);
    assert_eq!(send(&other, *b"a third identity"), Refusal::OtherIdentity);
}

#[test]
fn a_blob_for_other_cameras_does_not_cost_the_blob_before() {
    let cameras = rig::CAMERAS.map(|(text, width_px, height_px)| CameraStatus {
        name: name(text),
        width_px,
        height_px,
    });
    let own = Rig {
        serial: name(""),
        cameras: cameras.into_iter().collect(),
    };
    let flash = flash_file::blank(Some(&own)).unwrap();
    let device = SimulatedDevice::start_with("127.0.0.1:0".parse().unwrap(), flash).unwrap();
    let mut client = DeviceClient::connect(&format!("tcp:{}", device.address())).unwrap();
    let mut flash = |blob: &[u8]| client.flash(blob, &FlashOptions::default(), &mut |_| {});
    flash(&rig::blob()).unwrap();
    flash(&rig::blob_of(OTHER)).unwrap();
    let another_rigs = include_bytes!("../../../data/golden/stereo-v2.rays");
    let refused = refusal(flash(another_rigs));
    assert!(matches!(refused, Refusal::OtherRig { .. }), "{refused:?}");
    let stored = client.rollback().unwrap();
    assert_eq!(stored.identity, rig::IDENTITY);
}

#[test]
fn a_blob_for_other_cameras_is_refused_with_what_differs() {
    let (left, right) = (rig::CAMERAS[0], rig::CAMERAS[1]);
    let cameras = |cameras: &[(&str, u32, u32)]| {
        let cameras = cameras
            .iter()
            .map(|&(text, width_px, height_px)| CameraStatus {
                name: name(text),
                width_px,
                height_px,
            });
        Rig {
            serial: name("R-7"),
            cameras: cameras.collect(),
        }
    };
    let blob = rig::blob();
    let flash = |own: &Rig, serial: Option<&str>| {
        let flash = flash_file::blank(Some(own)).unwrap();
        let device = SimulatedDevice::start_with("127.0.0.1:0".parse().unwrap(), flash).unwrap();
        let mut client = DeviceClient::connect(&format!("tcp:{}", device.address())).unwrap();
        let options = FlashOptions {
            rig_serial: serial.map(str::to_owned),
            ..FlashOptions::default()
        };
        client.flash(&blob, &options, &mut |_| {})
    };
    let whole = cameras(&[left, right]);
    flash(&whole, None).unwrap();
    flash(&whole, Some("R-7")).unwrap();
    let differs = |own: &Rig, serial| match refusal(flash(own, serial)) {
        Refusal::OtherRig { camera, what, .. } => (camera, what),
        other => panic!("{other:?}"),
    };
    assert_eq!(differs(&whole, Some("R-8")), (0, RigPart::Serial));
    assert_eq!(differs(&cameras(&[left]), None), (0, RigPart::Count));
    assert_eq!(differs(&cameras(&[right, left]), None), (0, RigPart::Name));
    let wide = ("right", 601, 500);
    assert_eq!(differs(&cameras(&[left, wide]), None), (1, RigPart::Width));
    let high = ("right", 600, 501);
    assert_eq!(differs(&cameras(&[left, high]), None), (1, RigPart::Height));
}

/// Passes bytes on to a device and cuts each connection after so many bytes from the client.
fn cutting_proxy(device: SocketAddr, cut_after: usize) -> (SocketAddr, Arc<AtomicUsize>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    let connections = Arc::new(AtomicUsize::new(0));
    let count = Arc::clone(&connections);
    thread::spawn(move || {
        for client in listener.incoming() {
            let mut client = client.unwrap();
            count.fetch_add(1, Ordering::Relaxed);
            let mut server = TcpStream::connect(device).unwrap();
            let (mut from_server, mut to_client) =
                (server.try_clone().unwrap(), client.try_clone().unwrap());
            thread::spawn(move || std::io::copy(&mut from_server, &mut to_client));
            let mut left = cut_after;
            let mut buffer = [0; 100];
            while left > 0 {
                let most = left.min(buffer.len());
                match client.read(&mut buffer[..most]) {
                    Ok(length) if length > 0 => {
                        let _ = server.write_all(&buffer[..length]);
                        left -= length;
                    }
                    _ => break,
                }
            }
            let _ = server.shutdown(Shutdown::Both);
            let _ = client.shutdown(Shutdown::Both);
        }
    });
    (address, connections)
}

#[test]
fn a_link_that_keeps_breaking_is_resumed_where_it_stopped() {
    let (device, mut direct) = device(&[]);
    let blob = rig::blob();
    // Enough for a greeting and at least one chunk each time.
    let (proxy, connections) = cutting_proxy(device.address(), 1500);
    let mut client = DeviceClient::connect(&format!("tcp:{proxy}")).unwrap();
    let mut most = 0;
    let flashed = client.flash(&blob, &FlashOptions::default(), &mut |step| {
        assert!(step.stored >= most, "it starts over");
        most = step.stored;
    });
    let flashed = flashed.unwrap();
    assert!(flashed.resumed >= 2, "{flashed:?}");
    assert_eq!(
        connections.load(Ordering::Relaxed) as u32,
        flashed.resumed + 1
    );
    assert_eq!(active(&mut direct), Ok(rig::IDENTITY));

    // Too little for any chunk: given up, and the device keeps what it has.
    let (proxy, _) = cutting_proxy(device.address(), 300);
    let mut client = DeviceClient::connect(&format!("tcp:{proxy}")).unwrap();
    let options = FlashOptions {
        retries: 2,
        ..FlashOptions::default()
    };
    let outcome = client.flash(&rig::blob_of(OTHER), &options, &mut |_| {});
    assert!(
        matches!(outcome, Err(ClientError::GaveUp { tries: 3, .. })),
        "{outcome:?}"
    );
    assert_eq!(active(&mut direct), Ok(rig::IDENTITY));
}

/// 20,000 frames that are damaged, made up or out of place, half of them in the midst of an update:
/// the active blob answers the same bits throughout, and a good update goes through in the end.
#[test]
fn fuzzed_frames_during_an_update_do_not_touch_the_active_blob() {
    const LAST: u16 = 2;
    let (device, mut client) = device(&rig::blob());
    let asked = rig::matches(28, 4);
    let bits = |client: &mut DeviceClient| format!("{:?}", client.measure(&asked).unwrap());
    let expected = bits(&mut client);
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut stream = TcpStream::connect(device.address()).unwrap();
    stream.set_nodelay(true).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(30)))
        .unwrap();
    let other = rig::blob_of(OTHER);
    let mut writer = FrameWriter::new();
    let mut frames = 0;
    for round in 0..200 {
        let mut bytes = Vec::new();
        for _ in 0..100 {
            let offset = random.random_range(0..other.len());
            let end = other.len().min(offset + random.random_range(0..=MAX_CHUNK));
            let chunk = Chunk {
                offset: match random.random_range(0..4) {
                    0 => random.random(),
                    _ => offset as u32 / 8 * 8,
                },
                bytes: heapless::Vec::from_slice(&other[offset..end]).unwrap(),
            };
            let request = match random.random_range(0..12) {
                0 | 1 => Request::BeginUpdate(NewBlob {
                    length: random.random_range(0..20_000_000),
                    ..announced(&other, OTHER)
                }),
                2 => Request::BeginUpdate(announced(&other, OTHER)),
                3 => Request::FinishUpdate,
                4 => Request::AbortUpdate,
                5 => Request::Status,
                _ => Request::Chunk(chunk),
            };
            let mut frame = writer.seal(1, &request).unwrap().to_vec();
            if random.random_range(0..3) == 0 {
                let at = random.random_range(0..frame.len() - 1);
                frame[at] ^= random.random_range(1..=255_u8);
            }
            if random.random_range(0..20) == 0 {
                let mut noise = vec![0; random.random_range(0..3000)];
                random.fill_bytes(&mut noise);
                frame.extend(noise);
            }
            bytes.extend(frame);
            frames += 1;
        }
        // Whatever they were, this one is a frame again, and answered last.
        bytes.push(DELIMITER);
        bytes.extend(writer.seal(LAST, &Request::Hello).unwrap());
        let answers = BufReader::new(stream.try_clone().unwrap());
        let reader = thread::spawn(move || {
            let mut frames = FrameReader::new();
            answers.bytes().map_while(Result::ok).any(|byte| {
                let frame = frames.push::<Reply>(byte);
                frame.is_some_and(|frame| frame.is_ok_and(|frame| frame.sequence == LAST))
            })
        });
        stream.write_all(&bytes).unwrap();
        assert!(reader.join().unwrap(), "round {round}: no answer");
        if round % 10 == 0 {
            assert_eq!(bits(&mut client), expected, "round {round}");
            assert_eq!(active(&mut client), Ok(rig::IDENTITY));
        }
    }
    println!("fuzzed frames during updates: {frames}");
    assert_eq!(bits(&mut client), expected);
    stream.shutdown(Shutdown::Both).unwrap();
    let flashed = client.flash(&other, &FlashOptions::default(), &mut |_| {});
    assert!(!flashed.unwrap().was_active);
    assert_eq!(active(&mut client), Ok(OTHER));
}

/// A device killed at random moments of updates, as often as `KILLS` says: the next one has the blob
/// before or the one that was sent, and what was acknowledged is there.
#[test]
fn a_device_that_is_killed_keeps_one_of_the_two_blobs() {
    let kills = std::env::var("KILLS").ok();
    let kills: u32 = kills.and_then(|text| text.parse().ok()).unwrap_or(40);
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("device.flash");
    let mut random = ChaCha8Rng::seed_from_u64(9);
    let identity_of = |number: u32| {
        let mut identity = [b'k'; IDENTITY_LENGTH];
        identity[..4].copy_from_slice(&number.to_le_bytes());
        identity
    };
    let mut before: Option<[u8; IDENTITY_LENGTH]> = None;
    let mut survived_new = 0;
    for number in 0..kills {
        let mut device = Running::keeping("host", &file, &[]);
        let new = identity_of(number);
        let mut client = device.client();
        let pause = Duration::from_micros(random.random_range(0..4000));
        let killer = thread::spawn(move || {
            thread::sleep(pause);
            device.process.kill().unwrap();
            device.process.wait().unwrap();
        });
        let options = FlashOptions {
            retries: 0,
            ..FlashOptions::default()
        };
        let outcome = client.flash(&rig::blob_of(new), &options, &mut |_| {});
        killer.join().unwrap();

        let device = Running::keeping("host", &file, &[]);
        let found = active(&mut device.client()).ok();
        assert!(
            found == before || found == Some(new),
            "kill {number}: {found:?}"
        );
        if outcome.is_ok() {
            assert_eq!(found, Some(new), "kill {number}: it was acknowledged");
        }
        survived_new += u32::from(found == Some(new));
        before = found;
    }
    println!(
        "killed {kills} times: {survived_new} with the new blob, the others with the one before"
    );
}

#[test]
fn two_devices_have_a_file_each() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("device.flash");
    let _first = Running::keeping("host", &file, &[]);
    for kind in ["host", "qemu"] {
        let second = Command::new(env!("CARGO_BIN_EXE_firmware-sim"))
            .args([kind, "--flash-file"])
            .arg(&file)
            .output()
            .unwrap();
        assert_eq!(second.status.code(), Some(2), "{kind}");
        let message = String::from_utf8_lossy(&second.stderr);
        assert!(message.contains("in use by another device"), "{message}");
    }
}

#[test]
fn a_plain_blob_is_left_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("rig.rays");
    std::fs::write(&file, rig::blob()).unwrap();
    let device = Running::keeping("host", &file, &[]);
    let mut client = device.client();
    client
        .flash(&rig::blob_of(OTHER), &FlashOptions::default(), &mut |_| {})
        .unwrap();
    assert_eq!(active(&mut client), Ok(OTHER));
    drop(device);
    assert_eq!(std::fs::read(&file).unwrap(), rig::blob());
}

#[test]
fn cameras_are_set_when_the_flash_is_made_and_not_later() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("device.flash");
    let cameras = [
        "--camera=left=640x480",
        "--camera=right=600x500",
        "--serial=R-7",
    ];
    let device = Running::keeping("host", &file, &cameras);
    let own = device.client().status().unwrap().rig.unwrap();
    assert_eq!((own.serial.as_str(), own.cameras.len()), ("R-7", 2));
    drop(device);
    let again = Command::new(env!("CARGO_BIN_EXE_firmware-sim"))
        .args(["host", "--camera=left=1x1", "--flash-file"])
        .arg(&file)
        .output()
        .unwrap();
    assert_eq!(again.status.code(), Some(2));
    let message = String::from_utf8_lossy(&again.stderr);
    assert!(message.contains("leave --camera"), "{message}");
    let device = Running::keeping("host", Path::new(&file), &[]);
    assert_eq!(device.client().status().unwrap().rig, Some(own));
}

/// The flash is that of the part that was asked for, and its file keeps that.
#[test]
fn a_flash_file_keeps_its_rules() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("device.flash");
    let rules = "unit=32,block=131072,erased=00,ecc=error,blank=fault";
    let device = Running::keeping("host", &file, &["--flash-rules", rules]);
    let mut client = device.client();
    assert_eq!(client.greeting().unit, 32);
    client
        .flash(&rig::blob(), &FlashOptions::default(), &mut |_| {})
        .unwrap();
    drop(device);
    for arguments in [&[][..], &["--flash-rules", rules]] {
        let device = Running::keeping("host", &file, arguments);
        assert_eq!(active(&mut device.client()), Ok(rig::IDENTITY));
    }
    let fails = |command: &str, more: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_firmware-sim"))
            .args([command, "--flash-file"])
            .arg(&file)
            .args(more)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(2));
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    let message = fails("host", &["--flash-rules", "unit=16"]);
    assert!(
        message.contains(rules) && message.contains("unit=16"),
        "{message}"
    );
    let message = fails("host", &["--flash-rules", "unit=24"]);
    assert!(message.contains("1, 2, 4 ... 512"), "{message}");
    let message = fails("qemu", &[]);
    assert!(message.contains(rules), "{message}");
}

#[test]
fn several_devices_at_once() {
    let devices: Vec<_> = (0..4_u8)
        .map(|number| device(&rig::blob_of([number; IDENTITY_LENGTH])))
        .collect();
    for (number, (_, mut client)) in (0..).zip(devices) {
        assert_eq!(active(&mut client), Ok([number; IDENTITY_LENGTH]));
    }
}

/// What answers is no device: said within the time limit, and in words.
#[test]
fn something_else_that_answers_is_told_apart() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("tcp:{}", listener.local_addr().unwrap());
    thread::spawn(move || {
        let (mut peer, _) = listener.accept().unwrap();
        let _ = peer.write_all(b"SSH-2.0-OpenSSH_9.2\r\n");
        let _ = peer.read(&mut [0; 1000]);
        thread::sleep(Duration::from_secs(5));
    });
    let start = Instant::now();
    let error = DeviceClient::connect_within(&address, Duration::from_millis(300)).unwrap_err();
    assert!(matches!(error, ClientError::NotADevice { .. }), "{error}");
    assert!(start.elapsed() < Duration::from_secs(4));
}
