//! `corners.csv`: labelled corners in and out. One row per corner, header
//! `camera,pose,row,col,u,v` with an optional seventh column `sigma_px`; of points with known places
//! `camera,pose,u,v,x_mm,y_mm,z_mm` with optional `sigma_px` and `sigma_mm`.

pub(super) mod error;
pub(super) mod fields;
mod header;
mod places;
pub(super) mod row;

pub use error::CornersError;
pub use header::{HEADER, HEADER_WITH_SIGMA};

use super::{BoardKind, Dataset};
use crate::atomic_file::{self, WriteError};
use calib_rays::board::BoardSpec;
use calib_rays::geometry::PixelPoint;
use calib_rays::observed::{Corner, View};
use fields::{shortened, unquoted};
use header::Columns;
use row::{Label, Row};
use std::fmt::Write as _;
use std::path::Path;

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
    parse_corners(dataset, path, &text_of(path)?)
}

/// The target whose known places stand in the file of corners.
///
/// # Errors
/// [`CornersError`], with the line.
pub(super) fn read_places(dataset: &Dataset) -> Result<BoardSpec, CornersError> {
    let path = dataset.corners_path();
    Ok(places::target(&rows(dataset, &path, &text_of(&path)?)?))
}

fn text_of(path: &Path) -> Result<String, CornersError> {
    let bytes = std::fs::read(path).map_err(|source| CornersError::Read {
        file: path.to_owned(),
        source,
    })?;
    String::from_utf8(bytes).map_err(|error| CornersError::NotText {
        file: path.to_owned(),
        line: error.as_bytes()[..error.utf8_error().valid_up_to()]
            .split(|b| *b == b'\n')
            .count(),
    })
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
    let rows = rows(dataset, file, text)?;
    if dataset.kind != BoardKind::Points {
        check_on_board(dataset, file, &rows)?;
    }
    check_on_sensor(dataset, file, &rows)?;
    views(dataset, file, rows)
}

fn rows(dataset: &Dataset, file: &Path, text: &str) -> Result<Vec<Row>, CornersError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = text.lines().enumerate();
    let header = lines.next().map_or("", |(_, line)| line.trim());
    // As in the rows, blanks and quotes around a name mean nothing.
    let names: Vec<&str> = header.split(',').map(unquoted).collect();
    let columns = Columns::of(&names.join(","), &dataset.kind).ok_or_else(|| {
        if text.trim().is_empty() {
            CornersError::Empty {
                file: file.to_owned(),
                line: 1,
            }
        } else {
            CornersError::Header {
                file: file.to_owned(),
                found: shortened(header),
                kind: Box::new(dataset.kind.clone()),
            }
        }
    })?;
    let mut rows = Vec::new();
    let mut last_line = 1;
    for (index, line) in lines {
        last_line = index + 1;
        if !line.trim().is_empty() {
            rows.push(row::parse(dataset, file, index + 1, line, columns)?);
        }
    }
    if rows.is_empty() {
        return Err(CornersError::Empty {
            file: file.to_owned(),
            line: last_line,
        });
    }
    Ok(rows)
}

fn check_on_board(dataset: &Dataset, file: &Path, rows: &[Row]) -> Result<(), CornersError> {
    let board = &dataset.board;
    let labels = || {
        rows.iter().filter_map(|row| match row.label {
            Label::RowCol(r, c) => Some((row.line, r, c)),
            Label::Place(_) => None,
        })
    };
    let off_board = labels().find(|(_, row, col)| *row >= board.rows || *col >= board.cols);
    let Some((line, row, col)) = off_board else {
        return Ok(());
    };
    Err(CornersError::OutOfBoard {
        file: file.to_owned(),
        line,
        row,
        col,
        rows: board.rows,
        cols: board.cols,
        largest_row: labels().map(|(_, row, _)| row).max().unwrap_or(0),
        largest_col: labels().map(|(_, _, col)| col).max().unwrap_or(0),
    })
}

fn check_on_sensor(dataset: &Dataset, file: &Path, rows: &[Row]) -> Result<(), CornersError> {
    let off_sensor = rows
        .iter()
        .find(|r| !dataset.cameras[r.camera_idx].sensor.contains(r.pixel));
    let Some(row) = off_sensor else { return Ok(()) };
    let camera = &dataset.cameras[row.camera_idx];
    let pixels = || {
        rows.iter()
            .filter(|r| r.camera_idx == row.camera_idx)
            .map(|r| r.pixel)
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
        pixel: row.pixel,
        least: fold(f64::min, f64::INFINITY),
        most: fold(f64::max, f64::NEG_INFINITY),
    })
}

fn views(dataset: &Dataset, file: &Path, rows: Vec<Row>) -> Result<Vec<View>, CornersError> {
    let labels = places::Labels::of(&places::target(&rows));
    let mut found = Vec::with_capacity(rows.len());
    for row in rows {
        let (r, c) = match row.label {
            Label::RowCol(r, c) => (r, c),
            Label::Place(place) => match labels.col(&place.at_mm) {
                Some(col) if col < dataset.board.cols => (0, col),
                _ => {
                    return Err(CornersError::OtherPlace {
                        file: file.to_owned(),
                        line: row.line,
                        at_mm: place.at_mm.into(),
                    });
                }
            },
        };
        let corner = Corner {
            row: r,
            col: c,
            pixel: row.pixel,
            sigma_px: row.sigma_px,
        };
        found.push((row.pose, row.camera_idx, corner, row.line));
    }
    found.sort_by_key(|(pose, camera_idx, c, line)| (*pose, *camera_idx, c.row, c.col, *line));
    let place = |(pose, camera_idx, c, _): &(usize, usize, Corner, usize)| {
        (*pose, *camera_idx, c.row, c.col)
    };
    let twice = found
        .windows(2)
        .filter(|pair| place(&pair[0]) == place(&pair[1]))
        .min_by_key(|pair| pair[1].3);
    if let Some([first, (pose, camera_idx, corner, line)]) = twice {
        return Err(CornersError::Duplicate {
            file: file.to_owned(),
            line: *line,
            first_line: first.3,
            camera: dataset.cameras[*camera_idx].name.clone(),
            pose: *pose,
            label: match dataset.kind {
                BoardKind::Points => {
                    let at = dataset.board.corner_in_board(corner.row, corner.col);
                    format!("the point ({}, {}, {}) mm", at.x, at.y, at.z)
                }
                _ => format!("row {}, col {}", corner.row, corner.col),
            },
        });
    }
    Ok(found
        .chunk_by(|a, b| (a.0, a.1) == (b.0, b.1))
        .map(|view| View {
            camera_idx: view[0].1,
            pose: view[0].0,
            corners: view.iter().map(|(_, _, corner, _)| *corner).collect(),
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

/// The text that [`write_corners`] writes: corners of a grid, by row and column. Views of cameras
/// that the dataset does not have are left out.
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

#[cfg(test)]
mod tests;
