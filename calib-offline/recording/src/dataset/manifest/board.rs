//! `[board]`: the kind of target, and the keys that this kind takes.

use super::declared;
use super::error::ManifestError;
use super::limits::{MAX_CORNERS_PER_SIDE, MAX_SQUARE_MM, MIN_CORNERS_PER_SIDE, MIN_SQUARE_MM};
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
    let certificate = raw.certificate.take();
    let certificate = certificate
        .map(|raw| declared::certificate(source, raw))
        .transpose()?;
    let board = match kind {
        BoardKind::Chessboard => chessboard(source, line, &raw, certificate.as_ref())?,
        BoardKind::Points => {
            check_no_keys(source, &raw, kind)?;
            BoardSpec::points(Vec::new())
        }
    };
    Ok(Declared {
        kind,
        board,
        certificate,
    })
}

fn kind(source: &Source, raw: &RawBoard) -> Result<BoardKind, ManifestError> {
    let Some(kind) = &raw.kind else {
        return Ok(BoardKind::Chessboard);
    };
    BoardKind::from_word(kind.get_ref()).ok_or_else(|| ManifestError::BoardKind {
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

/// Points bring their places along: nothing about a grid can be meant.
fn check_no_keys(source: &Source, raw: &RawBoard, kind: BoardKind) -> Result<(), ManifestError> {
    let counts = [("rows", &raw.rows), ("cols", &raw.cols)];
    let counts = counts
        .into_iter()
        .filter_map(|(key, value)| Some((key, source.line_of(value.as_ref()?))));
    let square = raw.square_mm.iter();
    let square = square.map(|value| ("square_mm", source.line_of(value)));
    match counts.chain(square).next() {
        None => Ok(()),
        Some((key, line)) => Err(ManifestError::BoardKey {
            file: source.file.clone(),
            line,
            key,
            kind: kind.word(),
        }),
    }
}
