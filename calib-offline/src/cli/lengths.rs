//! `measure --lengths`: known lengths against those measured.

use super::error::Error;
use super::match_noise::in_f32;
use super::rig_file::{RigFile, open};
use super::usage_error::UsageError;
use crate::present::numbers::{or_dash, short};
use calib_blob::matches::{
    BlobSource, KnownLength, LengthProblem, LengthsError, read_chosen, read_lengths,
};
use calib_judge::lengths::{CheckedLengths, End, check};
use calib_rays::measure::{PointSource, RigSource, Sighting};
use nalgebra::Vector3;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::Path;

/// Checks the lengths of a file between matches of another with a rig; `noise_px` is that of the matches, if it
/// is not what the rig says.
///
/// # Errors
/// Any of the three files.
pub(super) fn check_lengths(
    rig: &Path,
    matches: &Path,
    lengths: &Path,
    noise_px: Option<f64>,
) -> Result<CheckedLengths, Error> {
    if matches.as_os_str() == "-" {
        return Err(Error::Usage(UsageError::LengthsOfStream));
    }
    let known = read_lengths(lengths)?;
    let (ends, board_ppm) = match RigFile::read(rig)? {
        RigFile::Blob(bytes) => {
            let blob = open(&bytes, rig)?;
            let source = BlobSource::new(&blob, None);
            let source = match noise_px.and_then(in_f32) {
                Some(noise) => source.map(|source| source.with_noise(noise)),
                None => source,
            };
            (ends(source.as_ref(), matches, lengths, &known)?, 0.0)
        }
        RigFile::Calibration(mut calibration) => {
            let own_px = calibration.rig.match_noise_px;
            calibration.rig.match_noise_px = noise_px.or(own_px);
            let certificate = calibration.certificate;
            let board_ppm = certificate.map_or(0.0, |c| {
                let scale = c.scale_ppm_sd.unwrap_or(0.0);
                scale.hypot(c.expansion_ppm_sd().unwrap_or(0.0))
            });
            let source = RigSource::new(&calibration.rig, None);
            (ends(source.as_ref(), matches, lengths, &known)?, board_ppm)
        }
    };
    Ok(check(&known, &ends, board_ppm))
}

/// Both ends of every length; the lengths' file is for messages.
fn ends<S: PointSource>(
    source: Option<&S>,
    matches: &Path,
    lengths: &Path,
    known: &[KnownLength],
) -> Result<Vec<[Option<End>; 2]>, Error> {
    // Without a frame there is always a source.
    let Some(source) = source else {
        return Ok(vec![[None, None]; known.len()]);
    };
    let ids: BTreeSet<&str> = known
        .iter()
        .flat_map(|length| length.ids.iter().map(String::as_str))
        .collect();
    let chosen = read_chosen(matches, &source.cameras(), &ids)?;
    known
        .iter()
        .map(|length| {
            let [a, b] = &length.ids;
            Ok([
                end(source, &chosen, lengths, length, a)?,
                end(source, &chosen, lengths, length, b)?,
            ])
        })
        .collect()
}

fn end<S: PointSource>(
    source: &S,
    chosen: &BTreeMap<String, Vec<Sighting<S::Number>>>,
    lengths: &Path,
    length: &KnownLength,
    id: &str,
) -> Result<Option<End>, LengthsError> {
    let sightings = chosen.get(id).ok_or_else(|| LengthsError::Row {
        file: lengths.to_owned(),
        line: length.line,
        problem: LengthProblem::UnknownId {
            id: id.chars().take(60).collect(),
        },
    })?;
    Ok(source.point(sightings).ok().map(|found| End {
        point_mm: Vector3::from(found.point_mm.map(Into::into)),
        covariance_mm2: source.covariance_mm2(sightings),
    }))
}

/// A table, and what it comes to.
pub(super) fn in_words(found: &CheckedLengths) -> String {
    let mut text = String::from("\n\nlength measurement errors (measured minus known), mm:\n");
    // Writing to a String cannot fail.
    let mut line = |cells: [String; 7]| {
        let [ends, known, measured, error, sd, limit, inside] = cells;
        let _ = writeln!(
            text,
            "  {ends:<20} {known:>12} {measured:>12} {error:>10} {sd:>10} {limit:>9}  {inside}"
        );
    };
    line(["ends", "known", "measured", "error", "sd", "limit", ""].map(str::to_owned));
    for length in &found.lengths {
        line([
            format!("{} - {}", length.id_a, length.id_b),
            format!("{:.4}", length.length_mm),
            or_dash(length.measured_mm.map(|mm| format!("{mm:.4}"))),
            or_dash(length.error_mm.map(|mm| format!("{mm:+.4}"))),
            or_dash(length.sd_mm.map(short)),
            or_dash(length.limit_mm),
            match (length.inside, length.measured_mm) {
                (_, None) => "not measured",
                (Some(true), _) => "within the limit",
                (Some(false), _) => "beyond the limit",
                (None, Some(_)) => "",
            }
            .to_owned(),
        ]);
    }
    let tested = found.inside + found.outside;
    let _ = match found.verdict {
        None => writeln!(text, "no limit is given: nothing is judged"),
        Some(grade) => writeln!(
            text,
            "verdict {}: {} of {tested} length measurement errors are within their limits{}",
            grade.word(),
            found.inside,
            match found.not_measured {
                0 => String::new(),
                count => format!("; {count} lengths were not measured"),
            }
        ),
    };
    if let (Some(largest), Some(rms)) = (found.largest_error_mm, found.rms_error_mm) {
        let over_sd = found.error_over_sd.map_or_else(
            || "; the rig does not say how uncertain points are".to_owned(),
            |ratio| {
                format!(
                    "; errors are {ratio:.2} of their standard deviations (RMS), for which the two ends count as independent"
                )
            },
        );
        let _ = writeln!(
            text,
            "largest error {} mm, RMS {} mm{over_sd}",
            short(largest),
            short(rms)
        );
    }
    text + "The length measurement error is that of ISO 10360-13 and VDI/VDE 2634. This is no acceptance test by either: those \
            prescribe artifacts, their places and number, and probing errors of form and size, which lengths do not show."
}
