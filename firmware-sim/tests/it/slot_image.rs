//! Images of slots for every part: a device whose flash holds one starts with the blob and answers its self-tests.

use std::path::Path;

use firmware_sim::slot_image::{
    MemoryFlash, PARTS, SlotImage, SlotImageError, SlotImageOptions, blank_regions, slot_image,
};
use ray_device::app::Device;
use ray_device::port::{Geometry, NoClock, Regions};
use ray_device::protocol::{Reply, Request, Status};
use ray_device::session::Responder;
use ray_device::storage::OTHER_PART;
use ray_device::storage::layout::Shape;
use ray_runtime::RayBlob;

fn blob() -> Vec<u8> {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/golden/stereo-v4-small.rays");
    std::fs::read(golden).unwrap()
}

/// Four sectors of the largest part, so that every part has room.
const REGION_SIZE: u32 = 4 * (256 << 10);
const REGION_ADDRESS: u32 = 0x0810_0000;

fn options(geometry: Geometry, slot: usize) -> SlotImageOptions<'static> {
    SlotImageOptions {
        geometry,
        region_address: REGION_ADDRESS,
        region_size: REGION_SIZE,
        slot,
        serial: None,
        manifest: &[],
    }
}

/// A blank flash with the image in it, by its pieces or all of it.
fn loaded(image: &SlotImage, options: &SlotImageOptions<'_>, whole: bool) -> Regions<MemoryFlash> {
    let mut regions = blank_regions(options).unwrap();
    let [slot_0, slot_1] = &mut regions.slots;
    for region in [&mut regions.factory, slot_0, slot_1] {
        if whole {
            region.load(image.address, &image.bytes);
        } else {
            for piece in &image.pieces {
                region.load(piece.address, &piece.bytes);
            }
        }
    }
    regions
}

/// What a device that starts with this flash says of itself, and how many self-tests of its blob pass.
fn started(regions: &mut Regions<MemoryFlash>) -> (Status, Option<u32>) {
    let mut device = Device::new("a device", NoClock);
    let mut epoch = device.epoch(regions);
    let Reply::Status(status) = epoch.respond(&Request::Status) else {
        panic!("no status");
    };
    let passed = match epoch.respond(&Request::SelfTest) {
        Reply::SelfTested(report) => {
            assert_eq!(report.equal, report.tests, "{report:?}");
            Some(u32::from(report.equal))
        }
        _ => None,
    };
    (status, passed)
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
                ..options(part.geometry, slot)
            };
            let image = slot_image(&blob, &options).unwrap();
            for whole in [false, true] {
                let mut regions = loaded(&image, &options, whole);
                let (status, passed) = started(&mut regions);
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
                let unit = part.geometry.unit;
                piece.address.is_multiple_of(unit)
                    && (piece.bytes.len() as u32).is_multiple_of(unit)
            }));
        }
    }
}

/// A device whose slots lie where the image's part has them, but which programs in other units, says so.
#[test]
fn an_image_for_another_part_is_refused_with_the_reason() {
    let blob = blob();
    let mut refused = 0;
    for made_for in PARTS {
        let image = slot_image(&blob, &options(made_for.geometry, 0)).unwrap();
        for other in PARTS {
            let is_placed_alike = other.geometry.block == made_for.geometry.block
                && other.geometry.erased == made_for.geometry.erased;
            let shapes = [made_for, other].map(|part| Shape::of(part.geometry));
            let is_read_alike = shapes[0].blob_start() == shapes[1].blob_start()
                && shapes[0].blob.line() == shapes[1].blob.line();
            if !is_placed_alike || is_read_alike {
                continue;
            }
            let mut regions = loaded(&image, &options(other.geometry, 0), true);
            let (status, passed) = started(&mut regions);
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
    let geometry = PARTS[0].geometry;
    let refused = |change: &dyn Fn(&mut SlotImageOptions<'_>)| {
        let mut options = options(geometry, 0);
        change(&mut options);
        slot_image(&blob, &options).unwrap_err()
    };
    for (unit, block) in [(24, 4096), (1024, 4096), (8, 32), (0, 4096), (8, 0)] {
        let odd = Geometry {
            unit,
            block,
            ..geometry
        };
        assert_eq!(
            refused(&|options| options.geometry = odd),
            SlotImageError::Unsupported(odd)
        );
    }
    assert!(matches!(
        refused(&|options| options.region_address += 4096),
        SlotImageError::NotBlocks { .. }
    ));
    assert!(matches!(
        refused(&|options| options.region_size = 2 * geometry.block),
        SlotImageError::TooShort { .. }
    ));
    assert!(matches!(
        refused(&|options| options.region_address = 0u32.wrapping_sub(geometry.block)),
        SlotImageError::TooShort { .. }
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
    let few = Geometry {
        block: 256,
        ..geometry
    };
    assert!(matches!(
        refused(&|options| {
            options.geometry = few;
            options.region_size = 256 * 9;
        }),
        SlotImageError::TooLong { .. } | SlotImageError::TooShort { .. }
    ));
    let mut damaged = blob.clone();
    damaged[100] ^= 1;
    let error = slot_image(&damaged, &options(geometry, 0)).unwrap_err();
    assert!(matches!(error, SlotImageError::Blob(_)));
}
