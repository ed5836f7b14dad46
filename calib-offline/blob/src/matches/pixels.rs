//! Single pixels of one camera in, rays out: `PIXELS.csv` and `RAYS.csv`, as strict as matches.

use super::error::{HeaderProblem, MatchesError, RowProblem};
use super::header::Columns;
use super::stream::{Piece, StreamError, Table, each_row, in_blocks, pieces};
use crate::rays::RaySource;
use calib_rays::geometry::{PixelPoint, Ray};
use calib_rays::measure::Status;
use calib_rays::remedy::Remedy;
use rayon::prelude::*;
use serde::Serialize;
use std::io::{Read, Write};
use std::path::Path;

/// The header of `PIXELS.csv`.
const PIXELS_HEADER: &str = "id,u,v";
/// The header of `RAYS.csv`.
pub const RAYS_HEADER: &str = "id,ox,oy,oz,dx,dy,dz,status";

/// What became of the pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct RaysSummary {
    /// Rows read, and written.
    pub pixels: usize,
    /// With a ray.
    pub ok: usize,
    /// Outside the calibrated area.
    pub outside: usize,
}

/// Why `PIXELS.csv` was not accepted.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct PixelsError(#[from] MatchesError);

impl Remedy for PixelsError {
    fn remedy(&self) -> Option<String> {
        let text = match &self.0 {
            MatchesError::Header { found, .. } if found.contains([';', '\t']) => {
                return self.0.remedy();
            }
            MatchesError::Empty { .. } | MatchesError::Header { .. } => {
                "write the header id,u,v and one pixel per line"
            }
            MatchesError::Row { problem, .. } => match problem {
                RowProblem::NotText | RowProblem::OpenQuote => return self.0.remedy(),
                RowProblem::FieldCount { .. } => {
                    "each line has one pixel; decimal points are points, not commas"
                }
                _ => "give u and v as numbers, or take the line away",
            },
            _ => return self.0.remedy(),
        };
        Some(text.to_owned())
    }
}

/// Writes one row for each pixel of `input` to `output`: its ray in the rig's frame, mm, as
/// [`RaySource::ray`] gives it. `file` is for messages only.
///
/// # Errors
/// [`StreamError`]; what was written until then is to be thrown away.
pub fn rays_of_pixels(
    source: &dyn RaySource,
    camera_idx: usize,
    file: &Path,
    mut input: &mut dyn Read,
    mut output: &mut dyn Write,
) -> Result<RaysSummary, StreamError> {
    let table = Table {
        expected: PIXELS_HEADER.to_owned(),
        columns: Box::new(|header| {
            if header
                .split(',')
                .map(str::trim)
                .eq(PIXELS_HEADER.split(','))
            {
                Ok(Columns {
                    camera_idx: vec![camera_idx],
                })
            } else {
                Err(HeaderProblem::NoList)
            }
        }),
        output_header: RAYS_HEADER,
    };
    let total = in_blocks(&table, file, &mut input, &mut output, |columns, block| {
        let pieces = pieces(block).into_par_iter();
        Ok(pieces
            .map(|piece| look_up(source, columns, piece))
            .collect())
    })?;
    Ok(RaysSummary {
        pixels: total.ok + total.outside,
        ok: total.ok,
        outside: total.outside,
    })
}

fn look_up(source: &dyn RaySource, columns: &Columns, bytes: &[u8]) -> Piece {
    let mut piece = Piece {
        out: Vec::with_capacity(6 * bytes.len()),
        ..Piece::default()
    };
    let (lines, problem) = each_row::<f64>(columns, bytes, |id, sightings| {
        for &(camera_idx, [u, v]) in sightings {
            let ray = source.ray(camera_idx, PixelPoint::new(u, v));
            write_row(id, ray, &mut piece.out);
            piece.tally.count(ray.map(|_| 0.0).ok_or(Status::Outside));
        }
        Ok(())
    });
    (piece.lines, piece.problem) = (lines, problem);
    piece
}

fn write_row(id: &str, ray: Option<Ray>, out: &mut Vec<u8>) {
    out.extend_from_slice(id.as_bytes());
    let Some(ray) = ray else {
        out.extend_from_slice(b",,,,,,,outside\n");
        return;
    };
    let mut buffer = zmij::Buffer::new();
    for value in ray.origin_mm.iter().chain(ray.direction.iter()) {
        out.push(b',');
        out.extend_from_slice(buffer.format(*value).as_bytes());
    }
    out.extend_from_slice(b",ok\n");
}
