//! `[target]` and `target_images`: the measurement target, read as strictly as the rest.

use super::error::ManifestError;
use super::images::pattern_files;
use super::limits::{MAX_CORNERS_PER_SIDE, MAX_SQUARE_MM, MIN_CORNERS_PER_SIDE, MIN_SQUARE_MM};
use super::raw::{RawCamera, RawTarget};
use super::source::{Source, ranged};
use super::target_problem::{MIN_RADIUS_RATIO, TargetProblem};
use crate::dataset::description::Dataset;
use crate::dataset::target::TargetSpec;
use std::path::PathBuf;
use toml::Spanned;

/// The target, if the manifest has one; the dataset has its cameras already.
pub(super) fn target(
    source: &Source,
    dataset: &Dataset,
    raw: Option<Spanned<RawTarget>>,
    cameras: &[Spanned<RawCamera>],
) -> Result<Option<TargetSpec>, ManifestError> {
    let Some(raw) = raw else {
        let stray = dataset
            .cameras
            .iter()
            .zip(cameras)
            .find_map(|(camera, raw)| Some((camera, raw.get_ref().target_images.as_ref()?)));
        return match stray {
            Some((camera, images)) => Err(source.problem(
                source.line_of(images),
                TargetProblem::NotDescribed {
                    camera: camera.name.clone(),
                },
            )),
            None => Ok(None),
        };
    };
    let line = source.line_of(&raw);
    let mut target = described(source, line, raw.into_inner())?;
    target.images = images(source, dataset, line, cameras)?;
    Ok(Some(target))
}

impl Source {
    fn problem(&self, line: usize, problem: TargetProblem) -> ManifestError {
        ManifestError::Target {
            file: self.file.clone(),
            line,
            problem,
        }
    }
}

/// The target without its images.
fn described(source: &Source, line: usize, raw: RawTarget) -> Result<TargetSpec, ManifestError> {
    let missing = |key| ManifestError::Missing {
        file: source.file.clone(),
        line,
        key,
    };
    if let Some(kind) = raw.kind
        && kind.get_ref() != "rings"
    {
        let line = source.line_of(&kind);
        let kind = kind.into_inner();
        return Err(source.problem(line, TargetProblem::Kind { kind }));
    }
    let count = |value, key| {
        let (least, most) = (MIN_CORNERS_PER_SIDE, MAX_CORNERS_PER_SIDE);
        ranged(source, line, value, key, least, most)
    };
    let rows = count(raw.rows, "[target] rows")? as usize;
    let cols = count(raw.cols, "[target] cols")? as usize;
    let length = |value: Option<Spanned<f64>>, key: &'static str, in_table: &'static str| {
        let value = value.ok_or_else(|| missing(in_table))?;
        let line = source.line_of(&value);
        let value = value.into_inner();
        if (MIN_SQUARE_MM..=MAX_SQUARE_MM).contains(&value) {
            Ok((value, line))
        } else {
            Err(source.problem(line, TargetProblem::Length { key, value }))
        }
    };
    let (pitch_mm, _) = length(raw.pitch_mm, "pitch_mm", "[target] pitch_mm")?;
    let (ordinary_mm, _) = length(
        raw.outer_radius_mm,
        "outer_radius_mm",
        "[target] outer_radius_mm",
    )?;
    let (direction_mm, direction_line) = length(
        raw.direction_outer_radius_mm,
        "direction_outer_radius_mm",
        "[target] direction_outer_radius_mm",
    )?;
    if direction_mm < MIN_RADIUS_RATIO * ordinary_mm {
        let problem = TargetProblem::NotLarger {
            direction_mm,
            ordinary_mm,
        };
        return Err(source.problem(direction_line, problem));
    }
    if 2.0 * direction_mm >= pitch_mm {
        let problem = TargetProblem::Touching {
            direction_mm,
            pitch_mm,
        };
        return Err(source.problem(direction_line, problem));
    }
    let direction = raw.direction.ok_or_else(|| missing("[target] direction"))?;
    let target = TargetSpec {
        rows,
        cols,
        pitch_mm,
        outer_radius_mm: ordinary_mm,
        direction_outer_radius_mm: direction_mm,
        direction: direction_markers(source, direction.get_ref(), rows, cols)?,
        images: Vec::new(),
    };
    let line = source.line_of(&direction);
    let (have, markers) = (target.direction.len(), target.marker_count());
    if 2 * have >= markers {
        let problem = TargetProblem::TooManyDirections { have, markers };
        return Err(source.problem(line, problem));
    }
    match target.symmetry() {
        Some(symmetry) => Err(source.problem(line, TargetProblem::Symmetric { symmetry })),
        None => Ok(target),
    }
}

fn direction_markers(
    source: &Source,
    raw: &[Spanned<Vec<i64>>],
    rows: usize,
    cols: usize,
) -> Result<Vec<(usize, usize)>, ManifestError> {
    let mut direction = Vec::with_capacity(raw.len());
    for place in raw {
        let line = source.line_of(place);
        let &[row, col] = place.get_ref().as_slice() else {
            let have = place.get_ref().len();
            return Err(source.problem(line, TargetProblem::NoPlace { have }));
        };
        let on_target = |value: i64, count: usize| {
            let value = usize::try_from(value).ok()?;
            (value < count).then_some(value)
        };
        let (Some(row), Some(col)) = (on_target(row, rows), on_target(col, cols)) else {
            let problem = TargetProblem::OffTarget {
                row,
                col,
                rows,
                cols,
            };
            return Err(source.problem(line, problem));
        };
        if direction.contains(&(row, col)) {
            return Err(source.problem(line, TargetProblem::DirectionTwice { row, col }));
        }
        direction.push((row, col));
    }
    Ok(direction)
}

/// The images of the target by camera.
fn images(
    source: &Source,
    dataset: &Dataset,
    target_line: usize,
    cameras: &[Spanned<RawCamera>],
) -> Result<Vec<Vec<PathBuf>>, ManifestError> {
    let has_markers = dataset.markers_path().exists();
    let mut seen: std::collections::BTreeSet<PathBuf> = dataset
        .cameras
        .iter()
        .flat_map(|camera| camera.images.iter().flatten().cloned())
        .collect();
    let mut images: Vec<Vec<PathBuf>> = Vec::with_capacity(cameras.len());
    // Name and count of the first camera that has any.
    let mut first: Option<(&str, usize)> = None;
    for (camera, raw) in dataset.cameras.iter().zip(cameras) {
        let Some(pattern) = &raw.get_ref().target_images else {
            images.push(Vec::new());
            continue;
        };
        let folder = &dataset.folder;
        let files = pattern_files(source, folder, "target_images", pattern, has_markers)?;
        let line = source.line_of(pattern);
        for image in &files {
            if !seen.insert(image.clone()) {
                let problem = TargetProblem::ImageUsedTwice {
                    camera: camera.name.clone(),
                    image: image.clone(),
                };
                return Err(source.problem(line, problem));
            }
        }
        match first {
            Some((first_camera, first_count)) if first_count != files.len() && !has_markers => {
                let problem = TargetProblem::UnequalImages {
                    first_camera: first_camera.to_owned(),
                    first_count,
                    camera: camera.name.clone(),
                    count: files.len(),
                };
                return Err(source.problem(line, problem));
            }
            Some(_) => {}
            None => first = Some((&camera.name, files.len())),
        }
        images.push(files);
    }
    if first.is_none() && !has_markers {
        return Err(source.problem(target_line, TargetProblem::NothingToRead));
    }
    Ok(images)
}

#[cfg(test)]
mod tests;
