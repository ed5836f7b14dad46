//! `flash`: a blob into the inactive slot of a device, checked there, and only then in use.

use super::Outcome;
use super::error::Error;
use super::input_file::read;
use super::output::Console;
use super::rig_file::{RigFile, open};
use super::sign::manifest_beside;
use super::usage_error::UsageError;
use crate::device::{DeviceError, connect};
use calib_rays::progress::Progress;
use calib_recording::dataset::identity::hex;
use clap::Args;
use firmware_sim::client::{DeviceClient, FlashOptions, FlashProgress};
use ray_device::frame::checksum;
use ray_device::manifest::{Manifest, ManifestBytes};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Duration;

const EXAMPLE: &str = "\
Example:
  calib-offline flash results/rig.rays --device tcp:127.0.0.1:7777
  calib-offline flash results/rig.rays --device serial:/dev/ttyACM0@115200 --rig-serial R-0042";

const FORMATS: &str = "\
The device stores the blob in the slot that it does not use, reads it back, opens it and compares its
cameras with its own; only then it is in use, at once and after every restart. Whatever fails or is cut
off, the blob before stays in use; `calib-offline device rollback` brings it back later, too. A link that
breaks is opened again, and the transfer goes on where it stopped.

A device that knows its cameras refuses the blob of another rig, and one that knows its serial number
that of another --rig-serial. A device with an owner takes only blobs with a manifest that the owner signed
(calib-offline sign); without --manifest it is RIG.rays.manifest beside the blob. A device without an owner
stores the manifest, too, so that the blob stays in use when the device gets one; there a manifest beside the blob that
does not fit is left out with a warning.

With --json, schema calib-offline/flash/1:
  rig, device, slot, sequence, bytes, identity
  version       of its manifest; null without one
  was_active    true: the device had it in use already and nothing was sent
  resumed       how often a broken transfer went on";

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct FlashArgs {
    /// The blob
    #[arg(value_name = "RIG.rays")]
    pub rig: PathBuf,
    /// The device: tcp:HOST:PORT or serial:PORT@BAUD
    #[arg(long, value_name = "ADDRESS")]
    pub device: String,
    /// The serial number of the rig that was calibrated
    #[arg(long, value_name = "SERIAL")]
    pub rig_serial: Option<String>,
    /// The blob's manifest: RIG.rays.manifest, if it is there, unless said otherwise
    #[arg(long, value_name = "FILE")]
    pub manifest: Option<PathBuf>,
    /// How long an answer may take, s: the device erases and checks meanwhile
    #[arg(long, value_name = "SECONDS", default_value_t = 20, value_parser = clap::value_parser!(u16).range(1..=600))]
    pub timeout: u16,
    /// Failures in a row after which to give up
    #[arg(long, value_name = "COUNT", default_value_t = 5)]
    pub retries: u32,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct FlashObject<'a> {
    schema: &'static str,
    rig: &'a Path,
    device: &'a str,
    slot: u8,
    sequence: u32,
    bytes: u32,
    identity: String,
    version: Option<u32>,
    was_active: bool,
    resumed: u32,
}

/// Runs the command.
///
/// # Errors
/// [`Error`]; the device then has the blob in use that it had before.
pub fn run(args: &FlashArgs, console: &Console) -> Result<Outcome, Error> {
    let RigFile::Blob(bytes) = RigFile::read(&args.rig)? else {
        return Err(Error::Usage(UsageError::NotPacked {
            path: args.rig.clone(),
        }));
    };
    // Before the device is bothered: the file's own fault is told with its name.
    open(&bytes, &args.rig)?;
    let timeout = Duration::from_secs(args.timeout.into());
    let given = args.manifest.as_deref().map(read_manifest).transpose()?;
    let mut client = connect(&args.device, timeout)?;
    let options = FlashOptions {
        retries: args.retries,
        timeout,
        rig_serial: args.rig_serial.clone(),
        manifest: match given {
            None if client.greeting().needs_signature => Some(usual_manifest(args, &mut client)?),
            None => spare_manifest(args, &bytes, &mut client, console)?,
            given => given,
        },
    };
    let has_manifest = options.manifest.is_some();
    let mut shown = Shown::new(console.progress());
    let flashed = client.flash(&bytes, &options, &mut |progress| shown.show(progress));
    console.progress().end();
    let flashed = flashed.map_err(DeviceError::Client)?;
    let object = FlashObject {
        schema: "calib-offline/flash/1",
        rig: &args.rig,
        device: &args.device,
        slot: flashed.stored.slot,
        sequence: flashed.stored.sequence,
        bytes: flashed.stored.length,
        identity: hex(&flashed.stored.identity),
        version: Some(flashed.stored.version).filter(|&version| version > 0),
        was_active: flashed.was_active,
        resumed: flashed.resumed,
    };
    console.result(&in_words(&object, has_manifest), &object);
    Ok(Outcome::Done)
}

/// The manifest beside the blob; without one, what to run.
fn usual_manifest(args: &FlashArgs, client: &mut DeviceClient) -> Result<ManifestBytes, Error> {
    let beside = manifest_beside(&args.rig);
    if beside.exists() {
        return read_manifest(&beside);
    }
    let status = client.status().map_err(DeviceError::Client)?;
    let newest = status.owner.map_or(0, |owner| owner.claims.newest_version);
    let serial = status.rig.map(|rig| rig.serial.to_string());
    let rig = match serial.filter(|serial| !serial.is_empty()) {
        Some(serial) => format!("--serial {serial:?}"),
        None => "--any-rig".to_owned(),
    };
    Err(Error::Usage(UsageError::NotSigned {
        rig: args.rig.clone(),
        command: format!(
            "calib-offline sign {} --key key.pem --version {} {rig}, with the owner's key, then the same again",
            args.rig.display(),
            newest.saturating_add(1)
        ),
    }))
}

/// The manifest beside the blob for a device that needs none; `None`, with a warning, where the device would refuse it.
fn spare_manifest(
    args: &FlashArgs,
    blob: &[u8],
    client: &mut DeviceClient,
    console: &Console,
) -> Result<Option<ManifestBytes>, Error> {
    let beside = manifest_beside(&args.rig);
    if !beside.exists() {
        return Ok(None);
    }
    let fault = match read_manifest(&beside)
        .ok()
        .map(|bytes| (bytes, Manifest::parse(&bytes)))
    {
        Some((bytes, Ok((manifest, _)))) => {
            let status = client.status().map_err(DeviceError::Client)?;
            let own = status.rig.map(|rig| rig.serial);
            if (manifest.length, manifest.checksum) != (blob.len() as u32, checksum(blob)) {
                "is of another blob"
            } else if manifest.rig_serial.is_some() && manifest.rig_serial != own {
                "is for a rig of another serial number"
            } else {
                return Ok(Some(bytes));
            }
        }
        _ => "is damaged, or no manifest",
    };
    console.warn(&format!(
        "{} {fault}: the blob goes without it, as this device has no owner; sign it again before the device gets one",
        beside.display()
    ));
    Ok(None)
}

/// The manifest in a file.
///
/// # Errors
/// [`UsageError::UnknownKind`] where it holds none, and where it cannot be read.
pub(super) fn read_manifest(file: &Path) -> Result<ManifestBytes, Error> {
    let bytes = read(file)?;
    let bytes = bytes.try_into().ok();
    let manifest = bytes.filter(|bytes: &ManifestBytes| Manifest::parse(bytes).is_ok());
    manifest.ok_or_else(|| {
        Error::Usage(UsageError::UnknownKind {
            path: file.to_owned(),
            expected: "a manifest as calib-offline sign writes it: 168 bytes",
        })
    })
}

/// Shows what the device has stored, in kilobytes.
struct Shown<'a> {
    progress: &'a dyn Progress,
    steps: Option<u32>,
}

impl<'a> Shown<'a> {
    const STEP: u32 = 1 << 10;

    const fn new(progress: &'a dyn Progress) -> Self {
        Self {
            progress,
            steps: None,
        }
    }

    fn show(&mut self, now: FlashProgress) {
        let mut steps = self.steps.unwrap_or_else(|| {
            let total = now.length.div_ceil(Self::STEP);
            self.progress.begin("send, KiB", total as usize);
            0
        });
        while steps < now.stored.div_ceil(Self::STEP) {
            self.progress.advance();
            steps += 1;
        }
        self.steps = Some(steps);
    }
}

fn in_words(object: &FlashObject<'_>, has_manifest: bool) -> String {
    let what = format!("blob {} ({} bytes)", object.identity, object.bytes);
    if object.was_active {
        // A device without an owner does not say whether it has a manifest.
        let manifest = if has_manifest && object.version.is_none() {
            ", not its manifest either; if it was flashed without one, flash another blob and then this one again"
        } else {
            ""
        };
        return format!(
            "{what} is in use on the device already, in slot {}: nothing was sent{manifest}",
            object.slot
        );
    }
    let version = match object.version {
        Some(version) => format!(", version {version},"),
        None => String::new(),
    };
    let resumed = match object.resumed {
        0 => String::new(),
        1 => "; the link broke once on the way".to_owned(),
        count => format!("; the link broke {count} times on the way"),
    };
    format!(
        "{what}{version} is in use on the device, in slot {} as number {}{resumed}",
        object.slot, object.sequence
    )
}
