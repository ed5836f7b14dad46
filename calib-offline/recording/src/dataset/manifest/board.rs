//! `[board]`: the kind of target, and the keys that this kind takes.

use super::declared;
use super::error::ManifestError;
use super::limits::{MAX_CORNERS_PER_SIDE, MAX_SQUARE_MM, MIN_CORNERS_PER_SIDE, MIN_SQUARE_MM};
use super::printed_board::Reader;
use super::raw::RawBoard;
use super::source::{Source, ranged};
use crate::dataset::description::{BoardKind, Certificate};
use calib_rays::board::BoardSpec;
use toml::Spanned;

/// What `[board]` says.
pub(super) struct Declared {
    pub kind: BoardKind,
    /// As long as it was while it was recorded. The places of points are not in the manifest.
    pub board: BoardSpec,
    pub certificate: Option<Certificate>,
}

pub(super) fn declared(
    source: &Source,
    raw: Option<Spanned<RawBoard>>,
) -> Result<Declared, ManifestError> {
    let raw = raw.ok_or_else(|| ManifestError::Missing {
        file: source.file.clone(),
        line: 1,
        key: "[board]",
    })?;
    let line = source.line_of(&raw);
    let mut raw = raw.into_inner();
    let kind = kind(source, &raw)?;
    check_keys(source, &raw, kind)?;
    let certificate = raw.certificate.take();
    let certificate = certificate
        .map(|raw| declared::certificate(source, raw))
        .transpose()?;
    let expansion_ppm = certificate.as_ref().and_then(Certificate::expansion_ppm);
    let reader = Reader {
        source,
        line,
        raw: &raw,
        kind,
        scale: 1.0 + 1e-6 * expansion_ppm.unwrap_or(0.0),
    };
    let (kind, board) = match kind {
        "charuco" => reader.charuco()?,
        "aprilgrid" => reader.april_grid()?,
        "circles" => reader.circles()?,
        "rings" => reader.rings()?,
        "points" => (BoardKind::Points, BoardSpec::points(Vec::new())),
        _ => {
            let board = chessboard(source, line, &raw, certificate.as_ref())?;
            let board = reader.square_height(board)?;
            (reader.chessboard(&board)?, board)
        }
    };
    Ok(Declared {
        kind,
        board,
        certificate,
    })
}

fn kind(source: &Source, raw: &RawBoard) -> Result<&'static str, ManifestError> {
    let Some(kind) = &raw.kind else {
        return Ok(BoardKind::WORDS[0]);
    };
    let known = BoardKind::WORDS
        .into_iter()
        .find(|word| word == kind.get_ref());
    known.ok_or_else(|| ManifestError::BoardKind {
        file: source.file.clone(),
        line: source.line_of(kind),
        kind: kind.get_ref().clone(),
    })
}

fn chessboard(
    source: &Source,
    line: usize,
    raw: &RawBoard,
    certificate: Option<&Certificate>,
) -> Result<BoardSpec, ManifestError> {
    let count = |value: &Option<Spanned<i64>>, key| {
        let (least, most) = (MIN_CORNERS_PER_SIDE, MAX_CORNERS_PER_SIDE);
        ranged(source, line, value.clone(), key, least, most)
    };
    let rows = count(&raw.rows, "[board] rows")?;
    let cols = count(&raw.cols, "[board] cols")?;
    let square_mm = length_mm(source, line, raw.square_mm.as_ref())?;
    let expansion_ppm = certificate.and_then(Certificate::expansion_ppm);
    // As it was while it was recorded, to a picometer: longer numbers only look exact.
    let square_mm = expansion_ppm.map_or(square_mm, |ppm| {
        (square_mm * (1.0 + 1e-6 * ppm) * 1e9).round() / 1e9
    });
    Ok(BoardSpec::chessboard(
        rows as usize,
        cols as usize,
        square_mm,
    ))
}

fn length_mm(
    source: &Source,
    line: usize,
    value: Option<&Spanned<f64>>,
) -> Result<f64, ManifestError> {
    let file = source.file.clone();
    let Some(spanned) = value else {
        return Err(ManifestError::SquareSizeMissing { file, line });
    };
    let value = *spanned.get_ref();
    let problem = if value.is_nan() {
        "not a number"
    } else if value.is_infinite() {
        "infinite"
    } else if value == 0.0 {
        "zero"
    } else if value < 0.0 {
        "negative"
    } else if value < MIN_SQUARE_MM {
        "less than a micrometer (the unit is mm)"
    } else if value > MAX_SQUARE_MM {
        "more than ten meters (the unit is mm)"
    } else {
        return Ok(value);
    };
    Err(ManifestError::SquareSize {
        file,
        line: source.line_of(spanned),
        value,
        problem,
    })
}

/// The keys that a kind takes.
fn keys_of(kind: &str) -> &'static [&'static str] {
    match kind {
        "charuco" => &[
            "rows",
            "cols",
            "square_mm",
            "marker_mm",
            "dictionary",
            "legacy",
            "first_id",
        ],
        "aprilgrid" => &[
            "rows",
            "cols",
            "tag_mm",
            "spacing",
            "family",
            "first_id",
            "border_bits",
        ],
        "circles" => &[
            "rows",
            "cols",
            "pitch_mm",
            "diameter_mm",
            "asymmetric",
            "direction",
        ],
        "rings" => &[
            "rows",
            "cols",
            "pitch_mm",
            "outer_radius_mm",
            "direction_outer_radius_mm",
            "direction",
        ],
        // Points bring their places along: nothing about a grid can be meant.
        "points" => &[],
        _ => &["rows", "cols", "square_mm", "square_height_mm", "marked"],
    }
}

fn check_keys(source: &Source, raw: &RawBoard, kind: &'static str) -> Result<(), ManifestError> {
    fn line<T>(source: &Source, value: Option<&Spanned<T>>) -> Option<usize> {
        value.map(|value| source.line_of(value))
    }
    let written = [
        ("rows", line(source, raw.rows.as_ref())),
        ("cols", line(source, raw.cols.as_ref())),
        ("square_mm", line(source, raw.square_mm.as_ref())),
        (
            "square_height_mm",
            line(source, raw.square_height_mm.as_ref()),
        ),
        ("marked", line(source, raw.marked.as_ref())),
        ("marker_mm", line(source, raw.marker_mm.as_ref())),
        ("dictionary", line(source, raw.dictionary.as_ref())),
        ("legacy", line(source, raw.legacy.as_ref())),
        ("first_id", line(source, raw.first_id.as_ref())),
        ("tag_mm", line(source, raw.tag_mm.as_ref())),
        ("spacing", line(source, raw.spacing.as_ref())),
        ("family", line(source, raw.family.as_ref())),
        ("border_bits", line(source, raw.border_bits.as_ref())),
        ("pitch_mm", line(source, raw.pitch_mm.as_ref())),
        ("diameter_mm", line(source, raw.diameter_mm.as_ref())),
        ("asymmetric", line(source, raw.asymmetric.as_ref())),
        ("direction", line(source, raw.direction.as_ref())),
        (
            "outer_radius_mm",
            line(source, raw.outer_radius_mm.as_ref()),
        ),
        (
            "direction_outer_radius_mm",
            line(source, raw.direction_outer_radius_mm.as_ref()),
        ),
    ];
    let known = keys_of(kind);
    for (key, line) in written {
        if let (Some(line), false) = (line, known.contains(&key)) {
            return Err(ManifestError::BoardKey {
                file: source.file.clone(),
                line,
                key,
                kind,
            });
        }
    }
    Ok(())
}
