//! `export`: a blob in the form that a flash tool or a compiler takes, or a rig in the form of another tool.

use super::Outcome;
use super::error::Error;
use super::export_folder::{self, FolderForm, LossObject};
use super::output::Console;
use super::place::check_file;
use super::rig_file::{RigFile, open};
use super::usage_error::UsageError;
use calib_blob::export::{self, ExportError, Form};
use calib_recording::atomic_file;
use clap::{Args, ValueEnum};
use serde::Serialize;
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "\
Example:
  calib-offline export rig.rays -o rig.hex --format hex --base-address 0x08100000
  calib-offline export rig.rays -o rig.uf2 --format uf2 --base-address 0x10100000 --family 0xe48bff56
  calib-offline export rig.rays -o rig.c --format c --name rig_blob
  calib-offline export calibration.json -o opencv --format opencv";

const FORMATS: &str = "\
hex, uf2, bin and c take a blob and write one file. The base address is where it goes in the device's memory: a
multiple of 8, of 256 for uf2, whose last page is filled up with 0xff. The C source defines an
array, aligned to 8, and its length NAME_len (ray-runtime/c/rays.h opens it). An earlier file of the same
form is replaced; any other only with --force.

The others take a blob or a calibration.json and write a folder; files in it are replaced only with --force.
opencv  NAME.yml a camera and extrinsics.yml (R, T: the second camera from the first, mm)
ros     NAME.yaml a camera (camera_info); where the cameras stand is lost
kalibr  camchain.yaml, in meters
npy     rays_NAME.npy a camera, as --ray-tables of calibrate writes them, and rays.json: shapes and units
The first three hold the pinholes that come nearest to the rays of the calibrated area at the working
distance, with 5 coefficients, or with 8 where these lose a fifth less (kalibr: 4). What they lose is
printed and written to FOLDER.loss.json.

With --json, schema calib-offline/export/1:
  output, format
  file_bytes    of all files
  blob_bytes, base_address, family, name    null where the form has none
  files    those of a folder; else null
  loss (rms_px, max_px, rms_mm, max_mm, distance_mm,
    cameras (name, coefficients, rms_px, max_px, rms_mm, max_mm))    of pinholes; else null";

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct ExportArgs {
    /// The blob, or a calibration.json for the forms of other tools
    #[arg(value_name = "RIG")]
    pub rig: PathBuf,
    /// The file or the folder to write
    #[arg(short, long, value_name = "PATH")]
    pub output: PathBuf,
    /// The form to write
    #[arg(long, value_name = "FORM", value_enum)]
    pub format: FormatArg,
    /// Where the blob goes in the device's memory: hex and uf2 need it
    #[arg(long, value_name = "0x...", value_parser = parse_number)]
    pub base_address: Option<u32>,
    /// The number of the family of devices that may take it, for uf2: 0xe48bff56 is the RP2040's
    #[arg(long, value_name = "0x...", value_parser = parse_number)]
    pub family: Option<u32>,
    /// The name of the array.
    #[arg(
        long,
        value_name = "SYMBOL",
        help = "The name of the array, for c [default: rays_blob]"
    )]
    pub name: Option<String>,
    /// Replace whatever stands in the output's place
    #[arg(long)]
    pub force: bool,
}

/// The form to write.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum FormatArg {
    /// Intel HEX
    Hex,
    /// UF2, for bootloaders that show up as a drive
    Uf2,
    /// The bytes of the blob
    Bin,
    /// C source
    C,
    /// `OpenCV`'s `FileStorage`.
    #[value(name = "opencv", help = "OpenCV's FileStorage, a folder")]
    OpenCv,
    /// Kalibr's `camchain.yaml`.
    #[value(help = "Kalibr's camchain.yaml, a folder")]
    Kalibr,
    /// ROS' `camera_info`.
    #[value(help = "ROS' camera_info, a folder")]
    Ros,
    /// The rays themselves.
    #[value(help = "The ray of every pixel as NumPy arrays, a folder")]
    Npy,
}

impl FormatArg {
    const fn name(self) -> &'static str {
        match self {
            Self::Hex => "hex",
            Self::Uf2 => "uf2",
            Self::Bin => "bin",
            Self::C => "c",
            Self::OpenCv => "opencv",
            Self::Kalibr => "kalibr",
            Self::Ros => "ros",
            Self::Npy => "npy",
        }
    }

    /// What it takes to write it.
    const fn kind(self) -> Kind {
        match self {
            Self::Hex => Kind::File(b":02000004"),
            Self::Uf2 => Kind::File(b"UF2\n"),
            Self::Bin => Kind::File(&ray_runtime::format::MAGIC),
            Self::C => Kind::File(b"/* A ray blob"),
            Self::OpenCv => Kind::Folder(FolderForm::OpenCv),
            Self::Kalibr => Kind::Folder(FolderForm::Kalibr),
            Self::Ros => Kind::Folder(FolderForm::Ros),
            Self::Npy => Kind::Folder(FolderForm::Npy),
        }
    }
}

/// One file or several.
enum Kind {
    /// How every file of the form begins.
    File(&'static [u8]),
    Folder(FolderForm),
}

const SCHEMA: &str = "calib-offline/export/1";

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct ExportObject<'a> {
    schema: &'static str,
    output: &'a Path,
    format: &'static str,
    blob_bytes: Option<usize>,
    file_bytes: usize,
    base_address: Option<u32>,
    family: Option<u32>,
    name: Option<&'a str>,
    files: Option<&'a [PathBuf]>,
    loss: Option<&'a LossObject>,
}

/// Runs the command.
///
/// # Errors
/// [`Error`], with nothing written.
pub fn run(args: &ExportArgs, console: &Console) -> Result<Outcome, Error> {
    check_options(args)?;
    match args.format.kind() {
        Kind::File(start) => write_file(args, start, console),
        Kind::Folder(form) => write_folder(args, form, console),
    }
}

fn write_folder(args: &ExportArgs, form: FolderForm, console: &Console) -> Result<Outcome, Error> {
    let written = export_folder::write(&args.rig, form, &args.output, args.force)?;
    let object = ExportObject {
        schema: SCHEMA,
        output: &args.output,
        format: args.format.name(),
        blob_bytes: None,
        file_bytes: written.bytes,
        base_address: None,
        family: None,
        name: None,
        files: Some(&written.files),
        loss: written.loss.as_ref(),
    };
    let lost = match &written.loss {
        Some(loss) => format!("; {}", loss.in_words()),
        None => String::new(),
    };
    let words = format!(
        "{} files of {} written to {}{lost}",
        written.files.len(),
        args.format.name(),
        args.output.display()
    );
    console.result(&words, &object);
    Ok(Outcome::Done)
}

fn write_file(args: &ExportArgs, start: &[u8], console: &Console) -> Result<Outcome, Error> {
    check_file(&args.output, start, &[&args.rig], args.force)?;
    let form = form(args)?;
    let RigFile::Blob(bytes) = RigFile::read(&args.rig)? else {
        return Err(Error::Usage(UsageError::UnknownKind {
            path: args.rig.clone(),
            expected: "a blob: make one of the calibration with calib-offline pack",
        }));
    };
    open(&bytes, &args.rig)?;
    let file = export::file(&bytes, &form)?;
    atomic_file::write(&args.output, &file)?;
    let object = ExportObject {
        schema: SCHEMA,
        output: &args.output,
        format: args.format.name(),
        blob_bytes: Some(bytes.len()),
        file_bytes: file.len(),
        base_address: args.base_address,
        family: args.family,
        name: match &form {
            Form::C { name } => Some(name),
            _ => None,
        },
        files: None,
        loss: None,
    };
    let place = match (args.base_address, object.name) {
        (Some(first), _) => {
            // The last byte has an address of 32 bits: the form was refused otherwise.
            let last = u64::from(first) + bytes.len() as u64 - 1;
            format!(" at {first:#010x} to {last:#010x}")
        }
        (None, Some(name)) => format!(" as {name}"),
        (None, None) => String::new(),
    };
    let words = format!(
        "a blob of {} bytes{place}; written to {}",
        bytes.len(),
        args.output.display()
    );
    console.result(&words, &object);
    Ok(Outcome::Done)
}

/// Refuses what the form has no place for.
fn check_options(args: &ExportArgs) -> Result<(), ExportError> {
    let form = args.format.name();
    let is_placed = matches!(args.format, FormatArg::Hex | FormatArg::Uf2);
    let needless = [
        ("--base-address", args.base_address.is_some() && !is_placed),
        (
            "--family",
            args.family.is_some() && args.format != FormatArg::Uf2,
        ),
        ("--name", args.name.is_some() && args.format != FormatArg::C),
    ];
    match needless.into_iter().find(|(_, is_needless)| *is_needless) {
        Some((option, _)) => Err(ExportError::NeedlessOption { form, option }),
        None => Ok(()),
    }
}

/// The form of one file that the arguments ask for.
fn form(args: &ExportArgs) -> Result<Form, ExportError> {
    let form = args.format.name();
    let base_address = || args.base_address.ok_or(ExportError::NoAddress { form });
    Ok(match args.format {
        FormatArg::Hex => Form::Hex {
            base_address: base_address()?,
        },
        FormatArg::Uf2 => Form::Uf2 {
            base_address: base_address()?,
            family: args.family,
        },
        FormatArg::C => Form::C {
            name: args.name.clone().unwrap_or_else(|| "rays_blob".to_owned()),
        },
        _ => Form::Binary,
    })
}

/// A number of 32 bits, hexadecimal behind `0x` or decimal.
fn parse_number(text: &str) -> Result<u32, String> {
    let digits = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
    let parsed = match digits {
        Some(digits) => u32::from_str_radix(digits, 16),
        None => text.parse(),
    };
    parsed.map_err(|_| "give a number of 32 bits such as 0x10100000".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_hexadecimal_or_decimal() {
        assert_eq!(parse_number("0x10100000"), Ok(0x1010_0000));
        assert_eq!(parse_number("0XFF"), Ok(255));
        assert_eq!(parse_number("4096"), Ok(4096));
        for bad in ["", "0x", "0x100000000", "-8", "10h", "ff"] {
            assert!(parse_number(bad).is_err(), "{bad}");
        }
    }
}
