//! The image of a device's slot as a production line writes it: blob and sealed commit record, and the factory record if
//! wanted, made by the storage of `ray-device` itself in a simulated flash with the rules of the device's part.

mod parts;

use ray_device::frame::checksum;
use ray_device::manifest::{Manifest, root};
use ray_device::port::NoClock;
use ray_device::protocol::{CameraStatus, MAX_CAMERAS_LISTED, MAX_NAME, Refusal, Rig, name};
use ray_device::storage::log::Log;
use ray_device::storage::record::Record;
use ray_device::storage::slot::SlotFlash;
use ray_device::storage::trust::Claims;
use ray_device::storage::{program_blob, program_manifest, rig};
use ray_runtime::RayBlob;
use thiserror::Error;

use crate::ask_blob::ask_blob;
use crate::simulated::sim_flash::{Rules, SimFlash};

pub use parts::{PARTS, Part};

/// Where an image goes and what is in it.
#[derive(Debug, Clone)]
pub struct SlotImageOptions<'a> {
    /// The rules of the part's flash, as the device's driver states them.
    pub rules: Rules,
    /// Where the flash starts that the device's firmware gives to the storage.
    pub region_address: u32,
    /// Its length, bytes.
    pub region_size: u32,
    /// The slot, 0 or 1.
    pub slot: usize,
    /// The serial number for a factory record that names the blob's cameras as the device's own, so that it takes no
    /// blob for others; `None` for no record.
    pub serial: Option<&'a str>,
    /// The owner's manifest behind the blob; empty for a device without an owner. Its signature is not verified here, as
    /// the device's keys are not known: the device does that when it starts.
    pub manifest: &'a [u8],
}

/// An image of a slot.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SlotImage {
    /// The address of the first byte.
    pub address: u32,
    /// All bytes, from there to the last one that was programmed; what was not reads as erased.
    pub bytes: Vec<u8>,
    /// The parts of them that were programmed: an address, and bytes in whole units. Parts with ECC must be
    /// written with these alone, because a blank unit that was programmed cannot take a record later.
    pub pieces: Vec<Piece>,
    /// Where the slot's blob starts.
    pub blob_address: u32,
}

/// Bytes that were programmed one behind the other.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Piece {
    /// The address of the first.
    pub address: u32,
    /// The bytes.
    pub bytes: Vec<u8>,
}

/// Why there is no image.
#[derive(Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum SlotImageError {
    /// The storage does not work on such flash.
    #[error(
        "no device stores a blob in flash with units of {} and blocks of {} bytes: both are powers of two, the unit of at most 512, the block of at least 64 and no less than the unit",
        .0.unit, .0.block
    )]
    Unsupported(Rules),
    /// The region is not made of blocks.
    #[error("the region of {size} bytes at {address:#x} is not made of blocks of {block} bytes")]
    NotBlocks {
        /// Where it starts.
        address: u32,
        /// Its length.
        size: u32,
        /// Of the part.
        block: u32,
    },
    /// The region ends behind the last address of 32 bits.
    #[error("the region of {size} bytes at {address:#x} ends behind 0xffffffff")]
    PastTheEnd {
        /// Where it starts.
        address: u32,
        /// Its length.
        size: u32,
    },
    /// The region is too short for two slots.
    #[error(
        "a region of {size} bytes at {address:#x} has no room for a factory block and two slots with blocks of {block} bytes: {least} bytes at least"
    )]
    TooShort {
        /// Where it starts.
        address: u32,
        /// Its length.
        size: u32,
        /// Of the part.
        block: u32,
        /// Fewest bytes.
        least: u64,
    },
    /// There are two slots.
    #[error("a device has slots 0 and 1, none of number {0}")]
    NoSuchSlot(usize),
    /// The blob does not fit.
    #[error("the blob of {length} bytes does not fit a slot, {limit} bytes")]
    TooLong {
        /// Of the blob.
        length: usize,
        /// Of a slot, beside the manifest.
        limit: u32,
    },
    /// The blob cannot be opened.
    #[error("the blob cannot be opened")]
    Blob(#[source] ray_runtime::OpenError),
    /// A factory record has no room for the serial number, a camera's name, or so many cameras.
    #[error(
        "a factory record holds {MAX_CAMERAS_LISTED} cameras, and names and a serial number of {MAX_NAME} bytes, at most"
    )]
    NoRecord,
    /// The bytes are no manifest.
    #[error("this is no manifest of an owner")]
    NotAManifest,
    /// The manifest was signed for another blob.
    #[error("this manifest is not of this blob")]
    OtherManifest,
    /// The manifest was signed for one rig, and the device is to be another, or none.
    #[error(
        "this manifest is for rig {signed:?} only, and the device {}",
        .own.as_ref().map_or("gets no serial number".to_owned(), |own| format!("gets the serial number {own:?}"))
    )]
    OtherSerial {
        /// The one in the manifest.
        signed: String,
        /// The one of the factory record, if one is written.
        own: Option<String>,
    },
    /// The storage refused.
    #[error("the storage refused: {0}")]
    Storage(Refusal),
}

/// The image with which a device starts with this blob in use, if the rest of its region is blank.
///
/// # Errors
/// [`SlotImageError`].
pub fn slot_image(
    blob: &[u8],
    options: &SlotImageOptions<'_>,
) -> Result<SlotImage, SlotImageError> {
    let mut flash = blank(options)?;
    let (identity, own) = ask_blob(blob, |blob| {
        let own = options.serial.map(|serial| rig_of(blob, serial));
        (*blob.identity(), own)
    })
    .map_err(SlotImageError::Blob)?;
    let claims = claims_of(blob, identity, options)?;
    let slot_at = flash.areas().slots + options.slot * flash.areas().slot;
    let mut regions = flash.regions();
    if let Some(own) = own.transpose()? {
        rig::write(&mut regions.factory, &own, &mut NoClock).map_err(SlotImageError::Storage)?;
    }
    let slot = regions
        .slots
        .get_mut(options.slot)
        .ok_or(SlotImageError::NoSuchSlot(options.slot))?;
    let limit = slot.max_blob(options.manifest.len() as u32);
    if blob.len() as u64 > u64::from(limit) {
        return Err(SlotImageError::TooLong {
            length: blob.len(),
            limit,
        });
    }
    let record = Record {
        sequence: 1,
        length: blob.len() as u32,
        checksum: checksum(blob),
        manifest_length: options.manifest.len() as u32,
        claims,
    };
    program_blob(slot, 0, blob, &mut NoClock)
        .and_then(|()| program_manifest(slot, record.length, options.manifest, &mut NoClock))
        .and_then(|()| Log::commit(slot, &record, &mut NoClock))
        .map_err(SlotImageError::Storage)?;
    let blob_address = options.region_address + slot_at as u32 + slot.shape().blob_start();
    Ok(image(options, blob_address, &flash))
}

/// What a device claims that has taken this blob with its manifest, as if it had been sent.
fn claims_of(
    blob: &[u8],
    identity: [u8; 16],
    options: &SlotImageOptions<'_>,
) -> Result<Claims, SlotImageError> {
    if options.manifest.is_empty() {
        return Ok(Claims::default());
    }
    let (manifest, _) =
        Manifest::parse(options.manifest).map_err(|_| SlotImageError::NotAManifest)?;
    let signed = (manifest.length, manifest.checksum, manifest.identity);
    let is_of_it = signed == (blob.len() as u32, checksum(blob), identity)
        && manifest.root == root(blob, || ());
    if !is_of_it {
        return Err(SlotImageError::OtherManifest);
    }
    match manifest.rig_serial.as_deref() {
        Some(signed) if options.serial != Some(signed) => Err(SlotImageError::OtherSerial {
            signed: signed.to_owned(),
            own: options.serial.map(str::to_owned),
        }),
        _ => Ok(Claims::default().after(&manifest)),
    }
}

/// The blob's cameras as a device's own.
fn rig_of(blob: &RayBlob<'_>, serial: &str) -> Result<Rig, SlotImageError> {
    let mut cameras = heapless::Vec::new();
    for camera in (0..blob.camera_count()).filter_map(|index| blob.camera(index)) {
        let status = CameraStatus {
            name: name(camera.name),
            width_px: camera.sensor_width,
            height_px: camera.sensor_height,
        };
        let is_fit = camera.name.len() <= MAX_NAME && cameras.push(status).is_ok();
        if !is_fit {
            return Err(SlotImageError::NoRecord);
        }
    }
    if serial.len() > MAX_NAME {
        return Err(SlotImageError::NoRecord);
    }
    Ok(Rig {
        serial: name(serial),
        cameras,
    })
}

/// The region as the device finds it on its first start.
fn blank(options: &SlotImageOptions<'_>) -> Result<SimFlash, SlotImageError> {
    let rules = options.rules;
    let (address, size) = (options.region_address, options.region_size);
    let block = rules.block;
    if !rules.shape().is_supported() {
        return Err(SlotImageError::Unsupported(rules));
    }
    if !(address.is_multiple_of(block) && size.is_multiple_of(block)) {
        return Err(SlotImageError::NotBlocks {
            address,
            size,
            block,
        });
    }
    let least = u64::from(block) + 2 * u64::from(rules.shape().least_region());
    if u64::from(address) + u64::from(size) > 1 << 32 {
        return Err(SlotImageError::PastTheEnd { address, size });
    }
    SimFlash::blank_with(rules, size as usize, 0).ok_or(SlotImageError::TooShort {
        address,
        size,
        block,
        least,
    })
}

/// What was programmed of a flash.
fn image(options: &SlotImageOptions<'_>, blob_address: u32, flash: &SimFlash) -> SlotImage {
    let units = flash.contents().chunks(options.rules.unit as usize);
    let programmed = flash.programmed();
    let is_programmed = |unit: usize| {
        let bits = programmed.get(unit / 8).copied().unwrap_or(0);
        bits >> (unit % 8) & 1 == 1
    };
    let mut pieces: Vec<Piece> = Vec::new();
    for (unit, bytes) in units.enumerate().filter(|(unit, _)| is_programmed(*unit)) {
        let address = options.region_address + unit as u32 * options.rules.unit;
        match pieces.last_mut() {
            Some(last) if last.address + last.bytes.len() as u32 == address => {
                last.bytes.extend(bytes);
            }
            _ => pieces.push(Piece {
                address,
                bytes: bytes.to_vec(),
            }),
        }
    }
    let address = pieces
        .first()
        .map_or(options.region_address, |piece| piece.address);
    let mut bytes = Vec::new();
    for piece in &pieces {
        bytes.resize((piece.address - address) as usize, options.rules.erased);
        bytes.extend(&piece.bytes);
    }
    SlotImage {
        address,
        bytes,
        pieces,
        blob_address,
    }
}
