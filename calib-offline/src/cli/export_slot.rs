//! `export --format slot-image`: what a production line writes into a device's flash, so that it starts with the blob.

use super::error::Error;
use super::export_blob::{BlobArgs, parse_number};
use super::flash::read_manifest;
use super::place::check_file;
use super::rig_file::{RigFile, open};
use super::usage_error::UsageError;
use calib_blob::export::{self, ExportError, Uf2, uf2_filled_len};
use calib_recording::atomic_file;
use clap::{Args, ValueEnum};
use firmware_sim::simulated::sim_flash::{Ecc, Rules};
use firmware_sim::slot_image::{
    PARTS, Part, SlotImage, SlotImageError, SlotImageOptions, slot_image,
};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// The arguments.
#[derive(Debug, Args)]
pub struct SlotArgs {
    /// The file to write, for slot-image [default: hex]
    #[arg(long, value_name = "FORM", value_enum)]
    pub container: Option<ContainerArg>,
    /// The part, for slot-image, such as stm32h743: its unit, block and erased value
    #[arg(long, value_name = "PART", value_parser = parse_part, conflicts_with_all = ["unit", "block", "erased"])]
    pub part: Option<Part>,
    /// Bytes that the part programs at once, for slot-image without --part
    #[arg(long, value_name = "BYTES", value_parser = parse_number)]
    pub unit: Option<u32>,
    /// Bytes that the part erases at once, for slot-image without --part
    #[arg(long, value_name = "BYTES", value_parser = parse_number)]
    pub block: Option<u32>,
    /// What an erased byte reads as [default: ff]
    #[arg(long, value_name = "ff or 00", value_parser = parse_erased)]
    pub erased: Option<u8>,
    /// Where the flash starts that the firmware gives to the storage, for slot-image
    #[arg(long, value_name = "0x...", value_parser = parse_number)]
    pub region_address: Option<u32>,
    /// Its length, bytes
    #[arg(long, value_name = "BYTES", value_parser = parse_number)]
    pub region_size: Option<u32>,
    /// The slot, 0 or 1 [default: 0]
    #[arg(long, value_name = "SLOT")]
    pub slot: Option<usize>,
    /// Write a factory record, too: the blob's cameras are the device's own, and this is its serial number ("" for none)
    #[arg(long, value_name = "TEXT")]
    pub serial: Option<String>,
    /// The owner's manifest, for a device that takes nothing else
    #[arg(long, value_name = "FILE")]
    pub manifest: Option<PathBuf>,
}

/// The file around a slot's image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ContainerArg {
    /// Intel HEX: only what is programmed
    Hex,
    /// Bytes from the first to the last, blank ones between
    Bin,
    /// UF2, of whole pages or sectors
    Uf2,
}

impl ContainerArg {
    /// How every file of the form begins: bytes with the log's first record, or with the factory's.
    const fn start(self, has_factory_record: bool) -> &'static [u8] {
        match self {
            Self::Hex => b":02000004",
            Self::Bin if has_factory_record => b"RigF",
            Self::Bin => b"RayD",
            Self::Uf2 => b"UF2\n",
        }
    }
}

fn parse_part(text: &str) -> Result<Part, String> {
    Part::of_name(text).copied().ok_or_else(|| {
        let names: Vec<&str> = PARTS.iter().map(|part| part.name).collect();
        format!(
            "give one of {}, or --unit, --block and --erased",
            names.join(", ")
        )
    })
}

fn parse_erased(text: &str) -> Result<u8, String> {
    match text {
        "ff" | "FF" | "0xff" => Ok(0xff),
        "00" | "0x00" => Ok(0),
        _ => Err("give ff or 00".to_owned()),
    }
}

impl SlotArgs {
    /// The first option that is given; other forms have no place for any.
    pub(super) fn given(&self) -> Option<&'static str> {
        let options = [
            ("--container", self.container.is_some()),
            ("--part", self.part.is_some()),
            ("--unit", self.unit.is_some()),
            ("--block", self.block.is_some()),
            ("--erased", self.erased.is_some()),
            ("--region-address", self.region_address.is_some()),
            ("--region-size", self.region_size.is_some()),
            ("--slot", self.slot.is_some()),
            ("--serial", self.serial.is_some()),
            ("--manifest", self.manifest.is_some()),
        ];
        let found = options.into_iter().find(|(_, is_given)| *is_given);
        found.map(|(option, _)| option)
    }

    /// Whether the file is UF2.
    pub(super) fn is_uf2(&self) -> bool {
        self.container == Some(ContainerArg::Uf2)
    }

    fn rules(&self) -> Result<Rules, UsageError> {
        if let Some(part) = self.part {
            return Ok(part.rules);
        }
        let (Some(unit), Some(block)) = (self.unit, self.block) else {
            return Err(UsageError::SlotImageLacks {
                option: "--part, or --unit and --block",
            });
        };
        Ok(Rules {
            unit,
            block,
            erased: self.erased.unwrap_or(0xff),
            ..Rules::default()
        })
    }
}

/// What `--json` says of a slot's image.
#[derive(Debug, Serialize)]
pub(super) struct SlotObject {
    container: &'static str,
    slot: usize,
    unit: u32,
    block: u32,
    erased: u8,
    region_address: u32,
    region_size: u32,
    blob_address: u32,
    programmed_bytes: usize,
    has_factory_record: bool,
}

/// What was written.
pub(super) struct SlotWritten {
    pub(super) blob_bytes: usize,
    pub(super) file_bytes: usize,
    pub(super) base_address: u32,
    pub(super) object: SlotObject,
    pub(super) words: String,
}

/// Writes the image with the blob of the file `rig` to `output`.
///
/// # Errors
/// [`Error`], with nothing written.
pub(super) fn write(
    rig: &Path,
    (args, blob): (&SlotArgs, &BlobArgs),
    output: &Path,
    is_forced: bool,
) -> Result<SlotWritten, Error> {
    let container = args.container.unwrap_or(ContainerArg::Hex);
    let has_factory_record = args.serial.is_some();
    let start = container.start(has_factory_record);
    let mut inputs = vec![rig];
    inputs.extend(args.manifest.as_deref());
    check_file(output, start, &inputs, is_forced)?;
    let lacks = |option| UsageError::SlotImageLacks { option };
    let region_address = args.region_address;
    let region_address = region_address.ok_or(lacks("--region-address"))?;
    let region_size = args.region_size.ok_or(lacks("--region-size"))?;
    let manifest = args.manifest.as_deref().map(read_manifest).transpose()?;
    let options = SlotImageOptions {
        rules: args.rules()?,
        region_address,
        region_size,
        slot: args.slot.unwrap_or(0),
        serial: args.serial.as_deref(),
        manifest: manifest.as_ref().map_or(&[], |bytes| bytes.as_slice()),
    };
    let RigFile::Blob(bytes) = RigFile::read(rig)? else {
        return Err(Error::Usage(UsageError::UnknownKind {
            path: rig.to_owned(),
            expected: "a blob: make one of the calibration with calib-offline pack",
        }));
    };
    open(&bytes, rig)?;
    let image = slot_image(&bytes, &options).map_err(|error| match (&args.manifest, error) {
        (
            Some(path),
            source @ (SlotImageError::OtherManifest | SlotImageError::OtherSerial { .. }),
        ) => UsageError::ManifestOfSlot {
            path: path.clone(),
            source,
        },
        (_, error) => UsageError::SlotImage(error),
    })?;
    let file = contained(blob, container, &image, options.rules.erased)?;
    atomic_file::write(output, &file)?;
    let programmed = image.pieces.iter().map(|piece| piece.bytes.len()).sum();
    let object = SlotObject {
        container: match container {
            ContainerArg::Hex => "hex",
            ContainerArg::Bin => "bin",
            ContainerArg::Uf2 => "uf2",
        },
        slot: options.slot,
        unit: options.rules.unit,
        block: options.rules.block,
        erased: options.rules.erased,
        region_address,
        region_size,
        blob_address: image.blob_address,
        programmed_bytes: programmed,
        has_factory_record,
    };
    let last = u64::from(image.address) + image.bytes.len() as u64 - 1;
    let mut words = format!(
        "slot {} with a blob of {} bytes: {:#010x} to {last:#010x}, {programmed} bytes of it programmed, \
         the blob at {:#010x}; written to {}",
        options.slot,
        bytes.len(),
        image.address,
        image.blob_address,
        output.display()
    );
    words += "; the rest of the region must be blank when the device starts";
    if options.rules.ecc != Ecc::None && container != ContainerArg::Hex {
        words += "; this part has ECC: what writes the blank units too leaves the device's log no room, so take --container hex";
    }
    Ok(SlotWritten {
        blob_bytes: bytes.len(),
        file_bytes: file.len(),
        base_address: image.address,
        object,
        words,
    })
}

/// The image as a file.
fn contained(
    blob: &BlobArgs,
    container: ContainerArg,
    image: &SlotImage,
    erased: u8,
) -> Result<Vec<u8>, ExportError> {
    match container {
        ContainerArg::Bin => Ok(image.bytes.clone()),
        ContainerArg::Hex => {
            let pieces = image.pieces.iter();
            let pieces: Vec<_> = pieces
                .map(|piece| (piece.address, piece.bytes.as_slice()))
                .collect();
            export::hex_of_pieces(&pieces)
        }
        ContainerArg::Uf2 => {
            let mut bytes = image.bytes.clone();
            bytes.resize(uf2_filled_len(bytes.len(), blob.family), erased);
            let uf2 = Uf2 {
                base_address: image.address,
                family: blob.family,
                absolute_block: blob.absolute_block,
            };
            export::file(&bytes, &export::Form::Uf2(uf2))
        }
    }
}
