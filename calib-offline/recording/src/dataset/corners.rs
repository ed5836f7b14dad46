//! `corners.csv`: labelled corners in and out. One row per corner, header
//! `camera,pose,row,col,u,v` with an optional seventh column `sigma_px`.

pub(super) mod error;
mod header;

pub use error::CornersError;
pub use header::{HEADER, HEADER_WITH_SIGMA};

use super::Dataset;
use crate::atomic_file::{self, WriteError};
use calib_rays::geometry::PixelPoint;
use calib_rays::observed::{Corner, View};
use std::fmt::Write as _;
use std::path::Path;

/// One line of the file.
#[derive(Debug, Clone, Copy)]
struct Row {
    line: usize,
    camera_idx: usize,
    pose: usize,
    corner: Corner,
}

/// The corners beside the manifest; `None` if there is no `corners.csv`.
///
/// Views come by pose, then camera; poses that the user leaves out are still among them
/// (see [`super::split::without_excluded`]), so that a result can tell how much was left out.
///
/// # Errors
/// [`CornersError`], with the line.
pub fn load_corners(dataset: &Dataset) -> Result<Option<Vec<View>>, CornersError> {
    let path = dataset.corners_path();
    if !path.exists() {
        return Ok(None);
    }
    let views = read_corners(dataset, &path)?;
    super::stage::check_lengths(dataset, &views)?;
    Ok(Some(views))
}

/// The corners in any file of this format.
///
/// # Errors
/// [`CornersError`], with the line.
pub fn read_corners(dataset: &Dataset, path: &Path) -> Result<Vec<View>, CornersError> {
    let bytes = std::fs::read(path).map_err(|source| CornersError::Read {
        file: path.to_owned(),
        source,
    })?;
    let text = String::from_utf8(bytes).map_err(|error| CornersError::NotText {
        file: path.to_owned(),
        line: error.as_bytes()[..error.utf8_error().valid_up_to()]
            .split(|b| *b == b'\n')
            .count(),
    })?;
    parse_corners(dataset, path, &text)
}

/// The corners in the text of a file; `file` is for messages only.
///
/// # Errors
/// [`CornersError`], with the line.
pub fn parse_corners(
    dataset: &Dataset,
    file: &Path,
    text: &str,
) -> Result<Vec<View>, CornersError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = text.lines().enumerate();
    let header = lines.next().map_or("", |(_, line)| line.trim());
    // As in the rows, blanks and quotes around a name mean nothing.
    let names: Vec<&str> = header.split(',').map(unquoted).collect();
    let columns = match names.join(",").as_str() {
        HEADER => 6,
        HEADER_WITH_SIGMA => 7,
        "" if text.trim().is_empty() => {
            return Err(CornersError::Empty {
                file: file.to_owned(),
                line: 1,
            });
        }
        _ => {
            return Err(CornersError::Header {
                file: file.to_owned(),
                found: shortened(header),
            });
        }
    };
    let mut rows = Vec::new();
    let mut last_line = 1;
    for (index, line) in lines {
        last_line = index + 1;
        if !line.trim().is_empty() {
            rows.push(parse_row(dataset, file, index + 1, line, columns)?);
        }
    }
    if rows.is_empty() {
        return Err(CornersError::Empty {
            file: file.to_owned(),
            line: last_line,
        });
    }
    check_on_board(dataset, file, &rows)?;
    check_on_sensor(dataset, file, &rows)?;
    views(dataset, file, rows)
}

fn parse_row(
    dataset: &Dataset,
    file: &Path,
    line: usize,
    text: &str,
    columns: usize,
) -> Result<Row, CornersError> {
    let mut fields = [""; 7];
    let mut have = 0;
    for field in text.split(',') {
        if let Some(slot) = fields.get_mut(have) {
            *slot = unquoted(field);
        }
        have += 1;
    }
    if have != columns {
        return Err(CornersError::FieldCount {
            file: file.to_owned(),
            line,
            have,
            need: columns,
        });
    }
    let not_a = |column, text: &str, expected| CornersError::Number {
        file: file.to_owned(),
        line,
        column,
        text: shortened(text),
        expected,
    };
    let count = |text: &str, column| {
        text.parse::<usize>()
            .map_err(|_| not_a(column, text, "whole number from 0"))
    };
    let number = |text: &str, column| {
        text.parse::<f64>()
            .map_err(|_| not_a(column, text, "number"))
    };
    let pixel = |text: &str, column| {
        let value = number(text, column)?;
        if value.is_finite() {
            return Ok(value);
        }
        Err(CornersError::NotFinite {
            file: file.to_owned(),
            line,
            column,
            value,
        })
    };
    let camera_idx = dataset
        .camera_idx(fields[0])
        .ok_or_else(|| CornersError::UnknownCamera {
            file: file.to_owned(),
            line,
            camera: shortened(fields[0]),
            known: dataset.cameras.iter().map(|c| c.name.clone()).collect(),
        })?;
    let sigma_px = match fields[6] {
        "" => None,
        text => match number(text, "sigma_px")? {
            value if value.is_finite() && value > 0.0 => Some(value),
            value => {
                return Err(CornersError::Sigma {
                    file: file.to_owned(),
                    line,
                    value,
                });
            }
        },
    };
    Ok(Row {
        line,
        camera_idx,
        pose: count(fields[1], "pose")?,
        corner: Corner {
            row: count(fields[2], "row")?,
            col: count(fields[3], "col")?,
            pixel: PixelPoint::new(pixel(fields[4], "u")?, pixel(fields[5], "v")?),
            sigma_px,
        },
    })
}

fn check_on_board(dataset: &Dataset, file: &Path, rows: &[Row]) -> Result<(), CornersError> {
    let board = &dataset.board;
    let off_board = rows
        .iter()
        .find(|r| r.corner.row >= board.rows || r.corner.col >= board.cols);
    let Some(row) = off_board else { return Ok(()) };
    Err(CornersError::OutOfBoard {
        file: file.to_owned(),
        line: row.line,
        row: row.corner.row,
        col: row.corner.col,
        rows: board.rows,
        cols: board.cols,
        largest_row: rows.iter().map(|r| r.corner.row).max().unwrap_or(0),
        largest_col: rows.iter().map(|r| r.corner.col).max().unwrap_or(0),
    })
}

fn check_on_sensor(dataset: &Dataset, file: &Path, rows: &[Row]) -> Result<(), CornersError> {
    let off_sensor = rows.iter().find(|r| {
        !dataset.cameras[r.camera_idx]
            .sensor
            .contains(r.corner.pixel)
    });
    let Some(row) = off_sensor else { return Ok(()) };
    let camera = &dataset.cameras[row.camera_idx];
    let pixels = || {
        rows.iter()
            .filter(|r| r.camera_idx == row.camera_idx)
            .map(|r| r.corner.pixel)
    };
    let fold = |pick: fn(f64, f64) -> f64, start: f64| {
        PixelPoint::new(
            pixels().map(|p| p.u).fold(start, pick),
            pixels().map(|p| p.v).fold(start, pick),
        )
    };
    Err(CornersError::OutsideImage {
        file: file.to_owned(),
        line: row.line,
        camera: camera.name.clone(),
        sensor: camera.sensor,
        pixel: row.corner.pixel,
        least: fold(f64::min, f64::INFINITY),
        most: fold(f64::max, f64::NEG_INFINITY),
    })
}

fn views(dataset: &Dataset, file: &Path, mut rows: Vec<Row>) -> Result<Vec<View>, CornersError> {
    let place = |r: &Row| (r.pose, r.camera_idx, r.corner.row, r.corner.col);
    rows.sort_by_key(|r| (place(r), r.line));
    let twice = rows
        .windows(2)
        .filter(|pair| place(&pair[0]) == place(&pair[1]))
        .min_by_key(|pair| pair[1].line);
    if let Some([first, second]) = twice {
        return Err(CornersError::Duplicate {
            file: file.to_owned(),
            line: second.line,
            first_line: first.line,
            camera: dataset.cameras[second.camera_idx].name.clone(),
            pose: second.pose,
            row: second.corner.row,
            col: second.corner.col,
        });
    }
    Ok(rows
        .chunk_by(|a, b| (a.pose, a.camera_idx) == (b.pose, b.camera_idx))
        .map(|view| View {
            camera_idx: view[0].camera_idx,
            pose: view[0].pose,
            corners: view.iter().map(|r| r.corner).collect(),
        })
        .collect())
}

/// Writes views as a file of this format, whole or not at all. Every number is written so that
/// reading it returns the same bits; the seventh column appears if any corner needs it.
///
/// # Errors
/// [`WriteError`].
pub fn write_corners(path: &Path, dataset: &Dataset, views: &[View]) -> Result<(), WriteError> {
    atomic_file::write(path, format_corners(dataset, views).as_bytes())
}

/// The text that [`write_corners`] writes. Views of cameras that the dataset does not have are
/// left out.
pub fn format_corners(dataset: &Dataset, views: &[View]) -> String {
    let corners = || views.iter().flat_map(|view| &view.corners);
    let with_sigma = corners().any(|corner| corner.sigma_px.is_some());
    let mut text = String::with_capacity(64 + 56 * corners().count());
    text.push_str(if with_sigma {
        HEADER_WITH_SIGMA
    } else {
        HEADER
    });
    text.push('\n');
    for view in views {
        let Some(camera) = dataset.cameras.get(view.camera_idx) else {
            continue;
        };
        for corner in &view.corners {
            // Writing to a String cannot fail.
            let _ = write!(
                text,
                "{},{},{},{},{},{}",
                camera.name, view.pose, corner.row, corner.col, corner.pixel.u, corner.pixel.v
            );
            if with_sigma {
                text.push(',');
                if let Some(sigma_px) = corner.sigma_px {
                    let _ = write!(text, "{sigma_px}");
                }
            }
            text.push('\n');
        }
    }
    text
}

/// A field without the blanks around it, and without the quotes that some programs put around
/// every text.
fn unquoted(field: &str) -> &str {
    let field = field.trim();
    field
        .strip_prefix('"')
        .and_then(|rest| rest.strip_suffix('"'))
        .map_or(field, str::trim)
}

/// The first characters of something that may be long or unprintable.
fn shortened(text: &str) -> String {
    let mut short: String = text.chars().take(60).flat_map(char::escape_debug).collect();
    if text.chars().nth(60).is_some() {
        short.push_str("...");
    }
    short
}

#[cfg(test)]
mod tests;
