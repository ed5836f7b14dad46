//! Images of slots for every part: a simulated device with that part's rules whose flash holds one starts with the blob and
//! answers its self-tests.

use std::path::Path;

use firmware_sim::client::DeviceClient;
use firmware_sim::simulated::host::SimulatedDevice;
use firmware_sim::simulated::sim_flash::{Rules, SimFlash};
use firmware_sim::slot_image::{PARTS, SlotImage, SlotImageError, SlotImageOptions, slot_image};
use ray_device::protocol::Status;
use ray_device::storage::OTHER_PART;
use ray_runtime::RayBlob;

fn blob() -> Vec<u8> {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/golden/stereo-v4-small.rays");
    std::fs::read(golden).unwrap()
}

/// Four sectors of the largest part, so that every part has room.
const REGION_SIZE: u32 = 4 * (256 << 10);
const REGION_ADDRESS: u32 = 0x0810_0000;

fn options(rules: Rules, slot: usize) -> SlotImageOptions<'static> {
    SlotImageOptions {
        rules,
        region_address: REGION_ADDRESS,
        region_size: REGION_SIZE,
        slot,
        serial: None,
        manifest: &[],
    }
}

/// A blank flash by these rules with the image in it: its pieces, as a flash tool writes HEX, or all bytes, as it
/// writes a plain binary.
fn loaded(image: &SlotImage, rules: Rules, whole: bool) -> SimFlash {
    let mut contents = vec![rules.erased; REGION_SIZE as usize];
    let mut programmed = vec![0u8; (REGION_SIZE / rules.unit).div_ceil(8) as usize];
    let mut put = |address: u32, bytes: &[u8]| {
        let at = (address - REGION_ADDRESS) as usize;
        contents[at..at + bytes.len()].copy_from_slice(bytes);
        let unit = rules.unit as usize;
        for unit in at / unit..(at + bytes.len()).div_ceil(unit) {
            programmed[unit / 8] |= 1 << (unit % 8);
        }
    };
    if whole {
        put(image.address, &image.bytes);
    } else {
        for piece in &image.pieces {
            put(piece.address, &piece.bytes);
        }
    }
    SimFlash::with(rules, &contents, Some(&programmed), 0).unwrap()
}

/// What the simulated device says of itself that starts with this flash, and how many self-tests of its blob pass; all of
/// them do, if there is a blob.
fn started(flash: SimFlash) -> (Status, Option<u16>) {
    let device = SimulatedDevice::start_with("127.0.0.1:0".parse().unwrap(), flash).unwrap();
    let mut client = DeviceClient::connect(&format!("tcp:{}", device.address())).unwrap();
    let status = client.status().unwrap();
    let report = status.blob.is_ok().then(|| client.self_test().unwrap());
    if let Some(report) = &report {
        assert_eq!(report.equal, report.tests, "{report:?}");
    }
    (status, report.map(|report| report.equal))
}

#[test]
fn a_device_of_every_part_starts_with_its_image() {
    let blob = blob();
    let mut words = vec![0_u64; blob.len().div_ceil(8)];
    let copy = &mut bytemuck::cast_slice_mut::<u64, u8>(&mut words)[..blob.len()];
    copy.copy_from_slice(&blob);
    let identity = *RayBlob::open(copy).unwrap().identity();
    for part in PARTS {
        for (slot, serial) in [(0, None), (1, None), (0, Some("SN-0012"))] {
            let options = SlotImageOptions {
                serial,
                ..options(part.rules, slot)
            };
            let image = slot_image(&blob, &options).unwrap();
            for whole in [false, true] {
                let (status, passed) = started(loaded(&image, part.rules, whole));
                let blob = status
                    .blob
                    .unwrap_or_else(|code| panic!("{part:?}: {code}"));
                assert_eq!(status.active_slot, Some(slot as u8), "{part:?}");
                assert_eq!(blob.identity, identity);
                assert!(passed > Some(0), "{part:?}");
                let rig = status.rig.map(|rig| rig.serial.as_str().to_owned());
                assert_eq!(rig.as_deref(), serial, "{part:?}");
            }
            // Only what was programmed is in the pieces: the log's blank entries are not.
            let programmed: usize = image.pieces.iter().map(|piece| piece.bytes.len()).sum();
            assert!(programmed < image.bytes.len(), "{part:?}");
            assert!(image.pieces.iter().all(|piece| {
                let unit = part.rules.unit;
                piece.address.is_multiple_of(unit)
                    && (piece.bytes.len() as u32).is_multiple_of(unit)
            }));
        }
    }
}

/// A manifest is checked as if the device were asked, and counts from the first start on.
#[test]
fn a_manifest_goes_in_only_with_its_blob_and_its_rig() {
    use crate::owner::{key, manifest, owner};
    use firmware_sim::owner::Terms;

    let blob = blob();
    let rules = PARTS[0].rules;
    let terms = Terms {
        version: 7,
        least_version: 5,
        rig_serial: Some("SN-0012".to_owned()),
        ..Terms::default()
    };
    let good = manifest(&blob, &terms);
    let with = |manifest: &[u8], serial: Option<&str>| {
        let options = SlotImageOptions {
            serial,
            manifest,
            ..options(rules, 0)
        };
        slot_image(&blob, &options)
    };
    let image = with(&good, Some("SN-0012")).unwrap();
    let flash = loaded(&image, rules, false);
    let any_port = "127.0.0.1:0".parse().unwrap();
    let device = SimulatedDevice::start_trusting(any_port, flash, owner()).unwrap();
    let mut client = DeviceClient::connect(&format!("tcp:{}", device.address())).unwrap();
    let status = client.status().unwrap();
    assert!(status.blob.is_ok(), "{:?}", status.blob);
    let claims = status.owner.unwrap().claims;
    assert_eq!((claims.newest_version, claims.least_version), (7, 5));

    for own in [None, Some("SN-0013")] {
        let other = SlotImageError::OtherSerial {
            signed: "SN-0012".to_owned(),
            own: own.map(str::to_owned),
        };
        assert_eq!(with(&good, own), Err(other));
    }
    let private = key(0).to_pem();
    for junk in [private.as_bytes(), &good[1..], &[0; 168]] {
        assert_eq!(with(junk, None), Err(SlotImageError::NotAManifest));
    }
    // Its length, its checksum, its identity and its pieces: each alone is enough.
    for at in [16, 20, 24, 72] {
        let mut other = good;
        other[at] ^= 1;
        let refused = with(&other, Some("SN-0012"));
        assert_eq!(refused, Err(SlotImageError::OtherManifest), "byte {at}");
    }
}

/// The program `firmware-sim`, told the part's name, with an image written into its flash file as a flash tool would.
#[cfg(feature = "command")]
#[test]
fn the_program_starts_with_an_image_in_its_flash_file() {
    use crate::running::Running;
    use firmware_sim::simulated::flash_file::FLASH_LENGTH;
    use firmware_sim::slot_image::Part;
    use std::io::{Seek, SeekFrom, Write};

    let blob = blob();
    for name in ["stm32h743", "stm32l0", "nrf54l", "rp2040"] {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("device.flash");
        let rules = ["--flash-rules", name];
        let mut empty = Running::keeping("host", &path, &rules);
        assert!(empty.client().status().unwrap().blob.is_err());
        empty.process.kill().unwrap();
        empty.process.wait().unwrap();
        let options = SlotImageOptions {
            region_address: 0,
            region_size: FLASH_LENGTH as u32,
            ..options(Part::of_name(name).unwrap().rules, 1)
        };
        let image = slot_image(&blob, &options).unwrap();
        let mut file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
        for piece in &image.pieces {
            file.seek(SeekFrom::Start(piece.address.into())).unwrap();
            file.write_all(&piece.bytes).unwrap();
        }
        drop(file);
        let device = Running::keeping("host", &path, &rules);
        let mut client = device.client();
        assert_eq!(client.status().unwrap().active_slot, Some(1), "{name}");
        let report = client.self_test().unwrap();
        assert!(report.tests > 0 && report.equal == report.tests, "{name}");
    }
}

/// A device whose slots lie where the image's part has them, but which programs in other units, says so.
#[test]
fn an_image_for_another_part_is_refused_with_the_reason() {
    let blob = blob();
    let mut refused = 0;
    for made_for in PARTS {
        let image = slot_image(&blob, &options(made_for.rules, 0)).unwrap();
        for other in PARTS {
            let is_placed_alike = other.rules.block == made_for.rules.block
                && other.rules.erased == made_for.rules.erased;
            let shapes = [made_for, other].map(|part| part.rules.shape());
            let is_read_alike = shapes[0].blob_start() == shapes[1].blob_start()
                && shapes[0].blob.line() == shapes[1].blob.line();
            if !is_placed_alike || is_read_alike {
                continue;
            }
            let (status, passed) = started(loaded(&image, other.rules, true));
            assert_eq!(
                status.blob.err(),
                Some(OTHER_PART),
                "{made_for:?} on {other:?}"
            );
            assert_eq!(passed, None);
            refused += 1;
        }
    }
    assert!(refused > 20, "{refused}");
}

#[test]
fn what_cannot_be_an_image_is_refused() {
    let blob = blob();
    let rules = PARTS[0].rules;
    let refused = |change: &dyn Fn(&mut SlotImageOptions<'_>)| {
        let mut options = options(rules, 0);
        change(&mut options);
        slot_image(&blob, &options).unwrap_err()
    };
    for (unit, block) in [(24, 4096), (1024, 4096), (8, 32), (0, 4096), (8, 0)] {
        let odd = Rules {
            unit,
            block,
            ..rules
        };
        assert_eq!(
            refused(&|options| options.rules = odd),
            SlotImageError::Unsupported(odd)
        );
    }
    assert!(matches!(
        refused(&|options| options.region_address += 4096),
        SlotImageError::NotBlocks { .. }
    ));
    assert!(matches!(
        refused(&|options| options.region_size = 2 * rules.block),
        SlotImageError::TooShort { .. }
    ));
    assert!(matches!(
        refused(&|options| options.region_address = 0u32.wrapping_sub(rules.block)),
        SlotImageError::PastTheEnd { .. }
    ));
    assert_eq!(
        refused(&|options| options.slot = 2),
        SlotImageError::NoSuchSlot(2)
    );
    assert_eq!(
        refused(&|options| options.serial =
            Some("a serial number that is longer than any record holds")),
        SlotImageError::NoRecord
    );
    let few = Rules {
        block: 256,
        ..rules
    };
    assert!(matches!(
        refused(&|options| {
            options.rules = few;
            options.region_size = 256 * 13;
        }),
        SlotImageError::TooLong { .. }
    ));
    let mut damaged = blob.clone();
    damaged[100] ^= 1;
    let error = slot_image(&damaged, &options(rules, 0)).unwrap_err();
    assert!(matches!(error, SlotImageError::Blob(_)));
}
