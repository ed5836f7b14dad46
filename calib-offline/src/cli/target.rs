//! `target`: a calibration target to print, and its `[board]`.

use super::Outcome;
use super::error::Error;
use super::output::Console;
use super::place::{check_file, place_in_words};
use super::usage_error::UsageError;
use calib_rays::board::BoardSpec;
use calib_rays::print::{Artwork, TagOrder, chessboard, pdf, rings, svg};
use calib_recording::atomic_file::{self, is_standard_output};
use calib_recording::dataset::BoardKind;
use calib_recording::dataset::manifest::read_board;
use clap::Args;
use serde::Serialize;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

const EXAMPLE: &str = "\
Example:
  calib-offline target --kind charuco --rows 8 --cols 11 --square-mm 20 --marker-mm 15 \\
    --dictionary DICT_4X4_100 -o board.pdf
  calib-offline target --kind aprilgrid --rows 6 --cols 6 --tag-mm 30 --spacing 0.3 -o tags.svg
  calib-offline target --kind circles --rows 7 --cols 10 --pitch-mm 20 --diameter-mm 12 \\
    --direction 3:4 --direction 3:5 --direction 1:2 -o circles.svg";

const FORMATS: &str = "\
Writes an SVG, or a PDF where the output's name ends so, at true size: print it at 100 %, without
fitting it to the page, and measure it. Its [board] for dataset.toml goes to standard output, and to
a file of the same name that ends in .toml. The keys of [board] are the options:
  chessboard   rows, cols (inner corners), square_mm, square_height_mm, marked (squares with a dot)
  charuco      rows, cols (inner corners), square_mm, marker_mm, dictionary, legacy, first_id
  aprilgrid    rows, cols (tags), tag_mm, spacing, family [36h11], first_id, border_bits
  circles      rows, cols, pitch_mm, diameter_mm, asymmetric, direction
  rings        rows, cols, pitch_mm, outer_radius_mm, direction_outer_radius_mm, direction
A printed grid of tags has its first one at the lower left; with border_bits = 2 it is Kalibr's grid, with 1
its tags are those of OpenCV's dictionary. Every way round and both borders are recognized.
Marked circles (direction) are printed with a hole.

With --json, schema calib-offline/target/1:
  output, board_file, kind, width_mm, height_mm
  board    the text of [board]";

/// The arguments.
#[derive(Debug, Args)]
#[command(before_help = EXAMPLE, after_help = FORMATS)]
pub struct TargetArgs {
    /// chessboard, charuco, aprilgrid, circles or rings
    #[arg(long, value_name = "KIND")]
    pub kind: String,
    /// Where to write it: a name that ends in .svg or .pdf
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Rows: of inner corners, tags, circles or rings
    #[arg(long, value_name = "N")]
    pub rows: Option<i64>,
    /// Columns of the same
    #[arg(long, value_name = "N")]
    pub cols: Option<i64>,
    /// Side of a square
    #[arg(long, value_name = "MM")]
    pub square_mm: Option<f64>,
    /// Height of a chessboard's square along a column, where it is not its side along a row
    #[arg(long, value_name = "MM")]
    pub square_height_mm: Option<f64>,
    /// A square of a chessboard with a dot: from 0 at the upper left
    #[arg(long, value_name = "ROW:COL", value_parser = parse_place)]
    pub marked: Vec<(i64, i64)>,
    /// Side of a marker with its black border
    #[arg(long, value_name = "MM")]
    pub marker_mm: Option<f64>,
    /// Name of the markers' dictionary.
    #[arg(
        long,
        value_name = "NAME",
        help = "OpenCV's name of the markers' dictionary, such as DICT_4X4_100"
    )]
    pub dictionary: Option<String>,
    /// The old pattern.
    #[arg(long, help = "The pattern of OpenCV before 4.6")]
    pub legacy: bool,
    /// Number of the first marker or tag [default: 0]
    #[arg(long, value_name = "ID")]
    pub first_id: Option<i64>,
    /// Side of a tag with its black border
    #[arg(long, value_name = "MM")]
    pub tag_mm: Option<f64>,
    /// Space between tags as a share of their side
    #[arg(long, value_name = "SHARE")]
    pub spacing: Option<f64>,
    /// Family of the tags [default: 36h11]
    #[arg(long, value_name = "NAME")]
    pub family: Option<String>,
    /// Black cells around a tag's code: 1, or 2 as in Kalibr's grids [default: 1]
    #[arg(long, value_name = "CELLS")]
    pub border_bits: Option<i64>,
    /// Distance of neighbors; of rows in an asymmetric grid
    #[arg(long, value_name = "MM")]
    pub pitch_mm: Option<f64>,
    /// Diameter of a circle
    #[arg(long, value_name = "MM")]
    pub diameter_mm: Option<f64>,
    /// Shift every other row by half the distance of columns
    #[arg(long)]
    pub asymmetric: bool,
    /// A marked circle or a large ring
    #[arg(long, value_name = "ROW:COL", value_parser = parse_place)]
    pub direction: Vec<(i64, i64)>,
    /// Outer radius of a ring
    #[arg(long, value_name = "MM")]
    pub outer_radius_mm: Option<f64>,
    /// Outer radius of a large ring
    #[arg(long, value_name = "MM")]
    pub direction_outer_radius_mm: Option<f64>,
    /// Replace whatever stands in the outputs' places
    #[arg(long)]
    pub force: bool,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct TargetObject<'a> {
    schema: &'static str,
    output: &'a Path,
    board_file: Option<&'a Path>,
    kind: &'static str,
    width_mm: f64,
    height_mm: f64,
    board: &'a str,
}

/// The forms of a drawing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Form {
    Svg,
    Pdf,
}

/// Runs the command.
///
/// # Errors
/// [`Error`], with nothing written.
pub fn run(args: &TargetArgs, console: &Console) -> Result<Outcome, Error> {
    let form = match args.output.extension().and_then(|ending| ending.to_str()) {
        Some("svg") => Form::Svg,
        Some("pdf") => Form::Pdf,
        _ if is_standard_output(&args.output) => Form::Svg,
        _ => {
            return Err(Error::Usage(UsageError::UnknownKind {
                path: args.output.clone(),
                expected: "a drawing: give the output a name that ends in .svg or .pdf",
            }));
        }
    };
    let board_file = args.output.with_extension("toml");
    let start: &[u8] = match form {
        Form::Svg => b"<svg",
        Form::Pdf => b"%PDF",
    };
    check_file(&args.output, start, &[], args.force)?;
    // The print has it, too.
    let board_file = (!is_standard_output(&args.output)).then_some(board_file);
    if let Some(board_file) = &board_file {
        check_file(board_file, b"[board]", &[], args.force)?;
    }
    let text = board_text(args);
    let (kind, board) = read_board(&text, board_file.as_deref().unwrap_or(&args.output))?;
    let Some(art) = artwork(&kind, &board) else {
        return Err(Error::Usage(UsageError::NothingToPrint {
            kind: kind.word(),
        }));
    };
    let file = match form {
        Form::Svg => svg::document(&art, text.trim()).into_bytes(),
        Form::Pdf => pdf::document(&art),
    };
    atomic_file::write(&args.output, &file)?;
    if let Some(board_file) = &board_file {
        atomic_file::write(board_file, text.as_bytes())?;
    }
    let [left, right, upper, lower] = art.plate_mm;
    let object = TargetObject {
        schema: "calib-offline/target/1",
        output: &args.output,
        board_file: board_file.as_deref(),
        kind: kind.word(),
        width_mm: right - left,
        height_mm: lower - upper,
        board: &text,
    };
    let board_place = object.board_file.map_or(String::new(), |file| {
        format!("; its [board] to {}", file.display())
    });
    console.narrate(&format!(
        "{} x {} mm, written to {}{board_place}",
        svg::number(object.width_mm),
        svg::number(object.height_mm),
        place_in_words(&args.output),
    ));
    console.result(&text, &object);
    Ok(Outcome::Done)
}

/// The `[board]` that the options describe.
fn board_text(args: &TargetArgs) -> String {
    let mut text = format!("[board]\nkind = {:?}\n", args.kind);
    let mut line = |key: &str, value: Option<String>| {
        if let Some(value) = value {
            // Writing to a string does not fail.
            let _ = writeln!(text, "{key} = {value}");
        }
    };
    let whole = |value: Option<i64>| value.map(|n| n.to_string());
    let length = |value: Option<f64>| value.map(|mm| format!("{mm:?}"));
    let word = |value: &Option<String>| value.as_ref().map(|word| format!("{word:?}"));
    let flag = |value: bool| value.then(|| "true".to_owned());
    line("rows", whole(args.rows));
    line("cols", whole(args.cols));
    line("square_mm", length(args.square_mm));
    line("square_height_mm", length(args.square_height_mm));
    line("marker_mm", length(args.marker_mm));
    line("dictionary", word(&args.dictionary));
    line("legacy", flag(args.legacy));
    line("tag_mm", length(args.tag_mm));
    line("spacing", length(args.spacing));
    line("family", word(&args.family));
    line("first_id", whole(args.first_id));
    line("border_bits", whole(args.border_bits));
    line("pitch_mm", length(args.pitch_mm));
    line("diameter_mm", length(args.diameter_mm));
    line("asymmetric", flag(args.asymmetric));
    line("outer_radius_mm", length(args.outer_radius_mm));
    line(
        "direction_outer_radius_mm",
        length(args.direction_outer_radius_mm),
    );
    let places = |of: &[(i64, i64)]| {
        let places: Vec<String> = of
            .iter()
            .map(|(row, col)| format!("[{row}, {col}]"))
            .collect();
        (!places.is_empty()).then(|| format!("[{}]", places.join(", ")))
    };
    line("marked", places(&args.marked));
    line("direction", places(&args.direction));
    text
}

/// What is printed of a kind; `None` of one that has no print.
fn artwork(kind: &BoardKind, board: &BoardSpec) -> Option<Artwork> {
    Some(match kind {
        BoardKind::Chessboard => {
            let size = (board.rows, board.cols);
            chessboard::artwork(size, board.square_sides_mm(), &[])
        }
        BoardKind::MarkedChessboard(marked) => {
            let size = (board.rows, board.cols);
            chessboard::artwork(size, board.square_sides_mm(), marked)
        }
        BoardKind::Charuco(board) => board.artwork(),
        BoardKind::AprilGrid(grid) => grid.artwork(TagOrder::Upwards),
        BoardKind::Circles(circles) => circles.artwork(),
        BoardKind::Rings(target) => {
            let size = (target.rows, target.cols);
            let radius = |row, col| target.outer_radius_mm_of(row, col);
            rings::artwork(size, target.pitch_mm, radius)
        }
        _ => return None,
    })
}

/// A row and a column.
fn parse_place(text: &str) -> Result<(i64, i64), String> {
    let place = text.split_once(':').and_then(|(row, col)| {
        let row = row.trim().parse().ok()?;
        Some((row, col.trim().parse().ok()?))
    });
    place.ok_or_else(|| "give a row and a column, counted from 0, such as 3:4".to_owned())
}
