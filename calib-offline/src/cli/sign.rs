//! `sign`: what the owner of devices says of a blob, in a manifest beside it.

use super::Outcome;
use super::error::Error;
use super::input_file::read;
use super::key_file;
use super::output::Console;
use super::place::check_file;
use super::rig_file::{RigFile, open};
use super::usage_error::UsageError;
use calib_recording::atomic_file;
use calib_recording::dataset::identity::hex;
use clap::{ArgGroup, Args};
use firmware_sim::owner::{Terms, manifest_of};
use ray_device::manifest::Manifest;
use ray_device::protocol::Signature;
use serde::Serialize;
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "\
Example:
  calib-offline sign results/rig.rays --key key.pem --version 3 --serial R-0042
  calib-offline flash results/rig.rays --device tcp:127.0.0.1:7777";

const FORMATS: &str = "\
A device with an owner takes a blob only with such a manifest, 168 bytes, written beside the blob as
RIG.rays.manifest unless -o says otherwise; calib-offline flash finds it there.

--version counts up: a device takes no version that is not above all it had. --least-version rules
older ones out, for a rollback, too. A device may have two keys, 0 and 1. When key 0 is lost or stolen, sign
the next blob with key 1 and --retire-keys-below 1: devices that have taken it obey key 0 no more, and count
versions anew from this one.

A key that another program holds, such as a hardware module, signs in three steps, with the same options
each time:
  calib-offline sign rig.rays --version 3 --serial R-0042 --to-be-signed tbs.bin
  openssl pkeyutl -sign -inkey key.pem -rawin -in tbs.bin -out tbs.sig
  calib-offline sign rig.rays --version 3 --serial R-0042 --signature tbs.sig --public-key key.pub.pem

With --json, schema calib-offline/sign/1:
  rig, written, bytes, identity, version, least_version, key_number, retired_below
  serial        null: for any rig
  public_key    64 hexadecimal digits; null: not known, so the signature was not verified";

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
#[command(group = ArgGroup::new("signer").required(true).args(["key", "to_be_signed", "signature"]))]
pub struct SignArgs {
    /// The blob
    #[arg(value_name = "RIG.rays")]
    pub rig: PathBuf,
    /// The owner's private key, as calib-offline keygen or openssl writes it
    #[arg(long, value_name = "KEY.pem")]
    pub key: Option<PathBuf>,
    /// The blob's version, above that of every one before, from 1
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub version: u32,
    /// The serial number of the one rig that it is for
    #[arg(long, value_name = "SERIAL")]
    pub serial: Option<String>,
    /// For every rig with these cameras; this is so without --serial, too
    #[arg(long, conflicts_with = "serial")]
    pub any_rig: bool,
    /// No device that has taken this may use a version below
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub least_version: u32,
    /// No device that has taken this obeys a key with a number below
    #[arg(long, value_name = "K", default_value_t = 0)]
    pub retire_keys_below: u8,
    /// Number of the key on the devices
    #[arg(long, value_name = "K", default_value_t = 0)]
    pub key_number: u8,
    /// Where the manifest goes: RIG.rays.manifest unless said otherwise
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Write the bytes to be signed, for a program that holds the key, and no manifest
    #[arg(long, value_name = "FILE", conflicts_with = "output")]
    pub to_be_signed: Option<PathBuf>,
    /// The 64 bytes that such a program wrote
    #[arg(long, value_name = "FILE")]
    pub signature: Option<PathBuf>,
    /// Verify that signature with this key: 64 hexadecimal digits or a PEM file
    #[arg(long, value_name = "KEY", requires = "signature")]
    pub public_key: Option<String>,
    /// Replace whatever stands in the output's place
    #[arg(long)]
    pub force: bool,
}

impl SignArgs {
    /// The files that it reads: none of them is ever replaced.
    fn inputs(&self) -> Vec<&Path> {
        let mut inputs = vec![self.rig.as_path()];
        inputs.extend(self.key.as_deref());
        inputs.extend(self.signature.as_deref());
        inputs.extend(self.public_key.as_deref().map(Path::new));
        inputs
    }
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct SignObject<'a> {
    schema: &'static str,
    rig: &'a Path,
    written: &'a Path,
    bytes: u32,
    identity: String,
    version: u32,
    least_version: u32,
    key_number: u8,
    retired_below: u8,
    serial: Option<&'a str>,
    public_key: Option<String>,
}

/// The place of a blob's manifest, unless said otherwise.
pub fn manifest_beside(rig: &Path) -> PathBuf {
    let mut path = rig.as_os_str().to_owned();
    path.push(".manifest");
    path.into()
}

/// Runs the command.
///
/// # Errors
/// [`Error`]; then nothing was written.
pub fn run(args: &SignArgs, console: &Console) -> Result<Outcome, Error> {
    let RigFile::Blob(bytes) = RigFile::read(&args.rig)? else {
        return Err(Error::Usage(UsageError::NotPacked {
            path: args.rig.clone(),
        }));
    };
    open(&bytes, &args.rig)?;
    let terms = Terms {
        version: args.version,
        least_version: args.least_version,
        key: args.key_number,
        least_key: args.retire_keys_below,
        rig_serial: args.serial.clone(),
    };
    let manifest = manifest_of(&bytes, &terms).map_err(UsageError::Manifest)?;
    let usual = manifest_beside(&args.rig);
    let written = args.output.as_ref().unwrap_or(&usual);
    if let Some(place) = &args.to_be_signed {
        check_file(place, b"ray-device manifest", &args.inputs(), args.force)?;
        atomic_file::write(place, &manifest.to_be_signed())?;
        return Ok(told(args, &manifest, place, None, console));
    }
    check_file(written, b"RayM", &args.inputs(), args.force)?;
    let (signature, public_key) = signature(args, &manifest, console)?;
    atomic_file::write(written, &manifest.to_bytes(&signature))?;
    Ok(told(args, &manifest, written, public_key, console))
}

/// The signature, and the key that it was verified with.
fn signature(
    args: &SignArgs,
    manifest: &Manifest,
    console: &Console,
) -> Result<(Signature, Option<String>), Error> {
    let to_be_signed = manifest.to_be_signed();
    if let Some(path) = &args.key {
        let key = key_file::private(path)?;
        return Ok((key.sign(&to_be_signed), Some(key.public().to_string())));
    }
    let path = args.signature.as_deref().unwrap_or(Path::new(""));
    let signature = Signature::from_bytes(&read(path)?).ok_or_else(|| {
        Error::Usage(UsageError::UnknownKind {
            path: path.to_owned(),
            expected: "an Ed25519 signature: 64 bytes",
        })
    })?;
    let Some(key) = &args.public_key else {
        console
            .warn("without --public-key nobody has verified this signature before a device does");
        return Ok((signature, None));
    };
    let key = key_file::public(key)?;
    if !key.has_signed(&to_be_signed, &signature) {
        return Err(Error::Usage(UsageError::OtherSignature {
            path: path.to_owned(),
        }));
    }
    Ok((signature, Some(key.to_string())))
}

fn told(
    args: &SignArgs,
    manifest: &Manifest,
    written: &Path,
    public_key: Option<String>,
    console: &Console,
) -> Outcome {
    let object = SignObject {
        schema: "calib-offline/sign/1",
        rig: &args.rig,
        written,
        bytes: manifest.length,
        identity: hex(&manifest.identity),
        version: manifest.version,
        least_version: manifest.least_version,
        key_number: manifest.key,
        retired_below: manifest.least_key,
        serial: manifest.rig_serial.as_deref(),
        public_key,
    };
    let what = match object.serial {
        Some(serial) => format!("for rig {serial}"),
        None => "for any rig (--serial ties it to one)".to_owned(),
    };
    let mut words = format!(
        "{}: blob {} as version {}, {what}",
        written.display(),
        object.identity,
        object.version
    );
    if args.to_be_signed.is_some() {
        words += "; to be signed now: openssl pkeyutl -sign -inkey key.pem -rawin -in FILE -out FILE.sig, then the same command with --signature FILE.sig in place of --to-be-signed";
    }
    console.result(&words, &object);
    Outcome::Done
}
