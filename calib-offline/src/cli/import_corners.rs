//! `import` of corners by other tools: `corners.csv` of a dataset.

use super::error::Error;
use super::output::Console;
use super::place::{check_file, place_in_words};
use super::usage_error::UsageError;
use calib_exchange::corners::columns::{self, Columns};
use calib_exchange::corners::vnl::{self, Images};
use calib_exchange::corners::{CornerRow, to_csv, views};
use calib_exchange::{ImportError, Problem};
use calib_recording::atomic_file;
use clap::Args;
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// What files of corners do not say.
#[derive(Debug, Args)]
pub struct CornerArgs {
    /// Corners from a table: which column is what, such as camera=cam,pose=frame,row=r,col=c,u=x,v=y;
    /// index=id for a number that counts row by row, camera:left for a value that all rows have
    #[arg(long, value_name = "MAP", value_parser = Columns::parse)]
    pub columns: Option<Columns>,
    /// What a table of corners calls the center of the top-left pixel: 0, 0.5 or 1
    #[arg(long, value_name = "X", value_parser = parse_origin)]
    pub pixel_origin: Option<f64>,
    /// Inner corners of the board, for corners that come row by row
    #[arg(long, value_name = "ROWSxCOLS", value_parser = parse_board)]
    pub board: Option<[usize; 2]>,
    /// The images of a camera in a .vnl, such as left=left-*.png; the star is the pose
    #[arg(long, value_name = "NAME=PATTERN", value_parser = Images::parse)]
    pub images: Vec<Images>,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct CornersObject<'a> {
    schema: &'static str,
    output: &'a Path,
    cameras: Vec<&'a str>,
    poses: usize,
    corners: usize,
}

/// Reads the corners of all files, and writes them together.
///
/// # Errors
/// [`Error`], with nothing written.
pub(super) fn run(
    files: &[PathBuf],
    output: &Path,
    args: &CornerArgs,
    names: &[String],
    force: bool,
    console: &Console,
) -> Result<(), Error> {
    let inputs: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    // Corners may be somebody's work: they are replaced only when that is asked for.
    check_file(output, b"\0", &inputs, force)?;
    let mut rows = Vec::new();
    let mut single = 0;
    for file in files {
        let fail = |problem: Problem| problem.in_file(file);
        let text = std::fs::read_to_string(file)
            .map_err(|error| fail(Problem::Read(error.to_string())))?;
        rows.extend(of_file(file, &text, args, names, &mut single)?);
    }
    let cameras: BTreeSet<&str> = rows.iter().map(|row| row.camera.as_str()).collect();
    if let Some(name) = cameras.iter().find(|name| name.contains([',', '"', '\n'])) {
        return Err(UsageError::UnknownCamera {
            name: (*name).to_owned(),
            known: vec!["names without commas and quotes".to_owned()],
        }
        .into());
    }
    let poses: BTreeSet<usize> = rows.iter().map(|row| row.pose).collect();
    atomic_file::write(output, to_csv(&rows).as_bytes())?;
    let object = CornersObject {
        schema: "calib-offline/import-corners/1",
        output,
        cameras: cameras.into_iter().collect(),
        poses: poses.len(),
        corners: rows.len(),
    };
    let words = format!(
        "{} corners of {} poses by {}; written to {}",
        object.corners,
        object.poses,
        object.cameras.join(", "),
        place_in_words(output)
    );
    console.result(&words, &object);
    Ok(())
}

/// The corners of a file; `single` counts those that hold one camera each.
fn of_file(
    file: &Path,
    text: &str,
    args: &CornerArgs,
    names: &[String],
    single: &mut usize,
) -> Result<Vec<CornerRow>, ImportError> {
    let found = if let Some(map) = &args.columns {
        columns::corners(
            text,
            map,
            args.pixel_origin,
            args.board.map(|[_, cols]| cols),
        )
    } else if file.extension().is_some_and(|ending| ending == "vnl") || !args.images.is_empty() {
        vnl::corners(text, args.board, &args.images)
    } else {
        let stem = file.file_stem().unwrap_or_default().to_string_lossy();
        let name = names.get(*single).map_or(&*stem, String::as_str);
        *single += 1;
        views::corners(text, name)
    };
    found.map_err(|problem| problem.in_file(file))
}

fn parse_origin(text: &str) -> Result<f64, String> {
    match text {
        "0" => Ok(0.0),
        "0.5" => Ok(0.5),
        "1" => Ok(1.0),
        _ => Err("give 0, 0.5 or 1".to_owned()),
    }
}

fn parse_board(text: &str) -> Result<[usize; 2], String> {
    let sides = text.split_once('x').and_then(|(rows, cols)| {
        let side = |text: &str| {
            text.parse::<usize>()
                .ok()
                .filter(|side| (1..=1000).contains(side))
        };
        Some([side(rows)?, side(cols)?])
    });
    sides.ok_or_else(|| "give rows and columns of inner corners, such as 6x9".to_owned())
}
