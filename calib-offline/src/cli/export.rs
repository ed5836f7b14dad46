//! `export`: a blob in the form that a flash tool or a compiler takes, or a rig in the form of another tool.

use super::Outcome;
use super::error::Error;
use super::export_blob::{self, BlobArgs};
use super::export_folder;
use super::export_form::{FolderForm, FormatArg, Kind};
use super::export_help::{EXAMPLE, FORMATS};
use super::export_loss::LossObject;
use super::export_mesh::{self, MeshArgs, MeshLoss};
use super::export_options::FolderArgs;
use super::export_slot::{self, SlotArgs, SlotObject};
use super::output::Console;
use super::place::{check_file, place_in_words};
use super::rig_file::{RigFile, open};
use super::usage_error::UsageError;
use calib_blob::export::{self, ExportError, Form};
use calib_exchange::mesh::MeshFormat;
use calib_exchange::ply;
use calib_recording::atomic_file;
use clap::Args;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct ExportArgs {
    /// The blob, or a calibration.json for the forms of other tools; for ply a points.csv
    #[arg(value_name = "RIG")]
    pub rig: PathBuf,
    /// The file or the folder to write
    #[arg(short, long, value_name = "PATH")]
    pub output: PathBuf,
    /// The form to write
    #[arg(long, value_name = "FORM", value_enum)]
    pub format: FormatArg,
    /// What the forms of one file take.
    #[command(flatten)]
    pub blob: BlobArgs,
    /// What the image of a slot takes.
    #[command(flatten)]
    pub slot: SlotArgs,
    /// What the forms of other tools take.
    #[command(flatten)]
    pub folder: FolderArgs,
    /// What meshes take.
    #[command(flatten)]
    pub mesh: MeshArgs,
    /// Replace whatever stands in the output's place
    #[arg(long)]
    pub force: bool,
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
    loss: Option<LossOf<'a>>,
    points: Option<PointsObject>,
    slot: Option<&'a SlotObject>,
}

/// Whose loss.
#[derive(Debug, Serialize)]
#[serde(untagged)]
enum LossOf<'a> {
    Lenses(&'a LossObject),
    Meshes(&'a MeshLoss),
}

#[derive(Debug, Serialize)]
struct PointsObject {
    count: usize,
    left_out: usize,
    has_sigma: bool,
}

/// Runs the command.
///
/// # Errors
/// [`Error`], with nothing written.
pub fn run(args: &ExportArgs, console: &Console) -> Result<Outcome, Error> {
    check_options(args)?;
    match args.format.kind() {
        Kind::File(start) => write_file(args, start, console),
        Kind::Slot => write_slot(args, console),
        Kind::Folder(form) => write_folder(args, form, console),
        Kind::Mesh(format) => write_mesh(args, format, console),
        Kind::Points => write_points(args, console),
    }
}

fn write_folder(args: &ExportArgs, form: FolderForm, console: &Console) -> Result<Outcome, Error> {
    let written = export_folder::write(&args.rig, form, &args.folder, &args.output, args.force)?;
    let lost = written.loss.iter().map(LossObject::in_words);
    let notes: Vec<String> = lost.chain(written.notes).collect();
    let loss = written.loss.as_ref().map(LossOf::Lenses);
    tell_of_folder(args, &written.files, written.bytes, &notes, loss, console);
    Ok(Outcome::Done)
}

fn write_mesh(args: &ExportArgs, format: MeshFormat, console: &Console) -> Result<Outcome, Error> {
    let distance_mm = args.folder.distance_mm;
    let (files, bytes, loss) = export_mesh::write(
        &args.rig,
        (format, distance_mm),
        &args.mesh,
        &args.output,
        args.force,
    )?;
    let notes = [loss.in_words()];
    tell_of_folder(
        args,
        &files,
        bytes,
        &notes,
        Some(LossOf::Meshes(&loss)),
        console,
    );
    Ok(Outcome::Done)
}

fn tell_of_folder(
    args: &ExportArgs,
    files: &[PathBuf],
    file_bytes: usize,
    notes: &[String],
    loss: Option<LossOf<'_>>,
    console: &Console,
) {
    let object = ExportObject {
        schema: SCHEMA,
        output: &args.output,
        format: args.format.name(),
        blob_bytes: None,
        file_bytes,
        base_address: None,
        family: None,
        name: None,
        files: Some(files),
        loss,
        points: None,
        slot: None,
    };
    let mut words = format!(
        "{} files of {} written to {}",
        files.len(),
        args.format.name(),
        args.output.display()
    );
    for note in notes {
        words += "; ";
        words += note;
    }
    console.result(&words, &object);
}

fn write_points(args: &ExportArgs, console: &Console) -> Result<Outcome, Error> {
    check_file(&args.output, ply::START, &[&args.rig], args.force)?;
    let cloud = ply::read(&args.rig)?;
    atomic_file::write(&args.output, &cloud.bytes)?;
    let object = ExportObject {
        schema: SCHEMA,
        output: &args.output,
        format: args.format.name(),
        blob_bytes: None,
        file_bytes: cloud.bytes.len(),
        base_address: None,
        family: None,
        name: None,
        files: None,
        loss: None,
        points: Some(PointsObject {
            count: cloud.count,
            left_out: cloud.left_out,
            has_sigma: cloud.has_sigma,
        }),
        slot: None,
    };
    let sigma = if cloud.has_sigma { ", with sigma" } else { "" };
    let words = format!(
        "{} points{sigma}, {} rows without one left out; written to {}",
        cloud.count,
        cloud.left_out,
        place_in_words(&args.output)
    );
    console.result(&words, &object);
    Ok(Outcome::Done)
}

fn write_file(args: &ExportArgs, start: &[u8], console: &Console) -> Result<Outcome, Error> {
    check_file(&args.output, start, &[&args.rig], args.force)?;
    let form = args.blob.form(args.format)?;
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
        base_address: args.blob.base_address,
        family: args.blob.family.map(|family| family.0),
        name: match &form {
            Form::C { name } => Some(name),
            _ => None,
        },
        files: None,
        loss: None,
        points: None,
        slot: None,
    };
    let place = match (args.blob.base_address, object.name) {
        (Some(first), _) => {
            // The last byte has an address of 32 bits: the form was refused otherwise.
            let last = u64::from(first) + bytes.len() as u64 - 1;
            format!(" at {first:#010x} to {last:#010x}")
        }
        (None, Some(name)) => format!(" as {name}"),
        (None, None) => String::new(),
    };
    let mut words = format!(
        "a blob of {} bytes{place}; written to {}",
        bytes.len(),
        place_in_words(&args.output)
    );
    for note in export_blob::notes(&form, bytes.len()) {
        words += "; ";
        words += &note;
    }
    console.result(&words, &object);
    Ok(Outcome::Done)
}

fn write_slot(args: &ExportArgs, console: &Console) -> Result<Outcome, Error> {
    let written = export_slot::write(
        &args.rig,
        (&args.slot, &args.blob),
        &args.output,
        args.force,
    )?;
    let object = ExportObject {
        schema: SCHEMA,
        output: &args.output,
        format: args.format.name(),
        blob_bytes: Some(written.blob_bytes),
        file_bytes: written.file_bytes,
        base_address: Some(written.base_address),
        family: args.blob.family.map(|family| family.0),
        name: None,
        files: None,
        loss: None,
        points: None,
        slot: Some(&written.object),
    };
    console.result(&written.words, &object);
    Ok(Outcome::Done)
}

/// Refuses what the form has no place for.
fn check_options(args: &ExportArgs) -> Result<(), ExportError> {
    let form = args.format.name();
    let kind = args.format.kind();
    let is_mesh = matches!(kind, Kind::Mesh(_));
    let folder_form = match kind {
        Kind::Folder(form) => Some(form),
        Kind::File(_) | Kind::Slot | Kind::Mesh(_) | Kind::Points => None,
    };
    let of_meshes = args.mesh.given().into_iter();
    let mut of_meshes = of_meshes.filter(|(_, is_given)| *is_given && !is_mesh);
    let is_slot = args.format == FormatArg::SlotImage;
    let is_uf2 = args.format == FormatArg::Uf2 || (is_slot && args.slot.is_uf2());
    let needless = args.blob.needless(args.format, is_uf2);
    let needless = needless.or_else(|| args.slot.given().filter(|_| !is_slot));
    let needless = needless.or_else(|| of_meshes.next().map(|(option, _)| option));
    match needless.or_else(|| args.folder.needless(folder_form, is_mesh)) {
        Some(option) => Err(ExportError::NeedlessOption { form, option }),
        None => Ok(()),
    }
}
