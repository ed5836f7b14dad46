//! `[board]` of targets whose print tells their points apart.

use super::board_problem::BoardProblem;
use super::error::ManifestError;
use super::limits::{MAX_CORNERS_PER_SIDE, MAX_SQUARE_MM, MIN_CORNERS_PER_SIDE, MIN_SQUARE_MM};
use super::raw::RawBoard;
use super::source::{Source, ranged};
use crate::dataset::description::BoardKind;
use crate::dataset::target::{TargetSpec, TargetSymmetry, turned};
use calib_rays::board::BoardSpec;
use calib_rays::print::{AprilGrid, Charuco, Circles, Codes, TagBorder};
use toml::Spanned;

/// One `[board]` while it is read.
pub(super) struct Reader<'a> {
    pub source: &'a Source,
    /// Line of the table.
    pub line: usize,
    pub raw: &'a RawBoard,
    pub kind: &'static str,
    /// By how much the target was longer while it was recorded.
    pub scale: f64,
}

/// Lengths are kept to a picometer: longer numbers only look exact.
const PER_PICOMETER: f64 = 1e9;

fn flag(value: Option<&Spanned<bool>>) -> bool {
    value.is_some_and(|value| *value.get_ref())
}

impl Reader<'_> {
    fn problem(&self, line: usize, problem: BoardProblem) -> ManifestError {
        ManifestError::Board {
            file: self.source.file.clone(),
            line,
            problem,
        }
    }

    fn missing(&self, key: &'static str) -> ManifestError {
        let kind = self.kind;
        self.problem(self.line, BoardProblem::Missing { key, kind })
    }

    fn count(
        &self,
        value: Option<&Spanned<i64>>,
        key: &'static str,
        least: i64,
    ) -> Result<usize, ManifestError> {
        let most = MAX_CORNERS_PER_SIDE;
        ranged(self.source, self.line, value.cloned(), key, least, most).map(|n| n as usize)
    }

    fn size(&self, least: i64) -> Result<(usize, usize), ManifestError> {
        let rows = self.count(self.raw.rows.as_ref(), "[board] rows", least)?;
        let cols = self.count(self.raw.cols.as_ref(), "[board] cols", least)?;
        Ok((rows, cols))
    }

    /// A length as it was while it was recorded, mm, and its line.
    fn length(
        &self,
        value: Option<&Spanned<f64>>,
        key: &'static str,
    ) -> Result<(f64, usize), ManifestError> {
        let value = value.ok_or_else(|| self.missing(key))?;
        let line = self.source.line_of(value);
        let value = *value.get_ref();
        if (MIN_SQUARE_MM..=MAX_SQUARE_MM).contains(&value) {
            let at_use = if self.scale == 1.0 {
                value
            } else {
                (value * self.scale * PER_PICOMETER).round() / PER_PICOMETER
            };
            Ok((at_use, line))
        } else {
            Err(self.problem(line, BoardProblem::Length { key, value }))
        }
    }

    fn first_id(&self) -> Result<usize, ManifestError> {
        match &self.raw.first_id {
            None => Ok(0),
            value => ranged(
                self.source,
                self.line,
                value.clone(),
                "[board] first_id",
                0,
                100_000,
            )
            .map(|id| id as usize),
        }
    }

    fn border(&self) -> Result<TagBorder, ManifestError> {
        let Some(value) = &self.raw.border_bits else {
            return Ok(TagBorder::One);
        };
        match *value.get_ref() {
            1 => Ok(TagBorder::One),
            2 => Ok(TagBorder::Two),
            value_read => {
                let problem = BoardProblem::Border { value: value_read };
                Err(self.problem(self.source.line_of(value), problem))
            }
        }
    }

    fn codes(
        &self,
        value: Option<&Spanned<String>>,
        key: &'static str,
        name_of: impl Fn(&str) -> String,
    ) -> Result<(Codes, usize), ManifestError> {
        let value = value.ok_or_else(|| self.missing(key))?;
        let line = self.source.line_of(value);
        let codes = Codes::named(&name_of(value.get_ref())).ok_or_else(|| {
            let name = value.get_ref().clone();
            self.problem(line, BoardProblem::Dictionary { key, name })
        })?;
        Ok((codes, line))
    }

    fn check_markers(
        &self,
        line: usize,
        codes: &Codes,
        first: usize,
        count: usize,
    ) -> Result<(), ManifestError> {
        if first + count <= codes.count() {
            return Ok(());
        }
        let problem = BoardProblem::TooManyMarkers {
            first,
            last: first + count - 1,
            dictionary: codes.name(),
            end: codes.count() - 1,
        };
        Err(self.problem(line, problem))
    }

    pub fn charuco(&self) -> Result<(BoardKind, BoardSpec), ManifestError> {
        let (rows, cols) = self.size(MIN_CORNERS_PER_SIDE)?;
        let (square_mm, _) = self.length(self.raw.square_mm.as_ref(), "square_mm")?;
        let (marker_mm, line) = self.length(self.raw.marker_mm.as_ref(), "marker_mm")?;
        if marker_mm >= square_mm {
            let problem = BoardProblem::TooLarge {
                inner: "marker_mm",
                inner_mm: marker_mm,
                outer: "square_mm",
                outer_mm: square_mm,
            };
            return Err(self.problem(line, problem));
        }
        let (codes, line) =
            self.codes(self.raw.dictionary.as_ref(), "dictionary", str::to_owned)?;
        let board = Charuco {
            rows,
            cols,
            square_mm,
            marker_mm,
            codes,
            legacy: flag(self.raw.legacy.as_ref()),
            first_id: self.first_id()?,
        };
        self.check_markers(line, &codes, board.first_id, board.marker_count())?;
        let spec = BoardSpec::chessboard(rows, cols, square_mm);
        Ok((BoardKind::Charuco(board), spec))
    }

    pub fn april_grid(&self) -> Result<(BoardKind, BoardSpec), ManifestError> {
        let (rows, cols) = self.size(1)?;
        let (tag_mm, _) = self.length(self.raw.tag_mm.as_ref(), "tag_mm")?;
        let spacing = self.raw.spacing.as_ref();
        let spacing = spacing.ok_or_else(|| self.missing("spacing"))?;
        let value = *spacing.get_ref();
        if !(0.05..=2.0).contains(&value) {
            let line = self.source.line_of(spacing);
            return Err(self.problem(line, BoardProblem::Spacing { value }));
        }
        let (codes, line) = match &self.raw.family {
            None => {
                let name = AprilGrid::dictionary_of("36h11");
                let known = Codes::named(&name).ok_or_else(|| self.missing("family"))?;
                (known, self.line)
            }
            family => self.codes(family.as_ref(), "family", AprilGrid::dictionary_of)?,
        };
        let grid = AprilGrid {
            rows,
            cols,
            tag_mm,
            spacing: value,
            codes,
            first_id: self.first_id()?,
            border: self.border()?,
        };
        self.check_markers(line, &codes, grid.first_id, grid.tag_count())?;
        let spec = BoardSpec::face(2 * rows, 2 * cols, |row, col| grid.corner_mm(row, col));
        Ok((BoardKind::AprilGrid(grid), spec))
    }

    pub fn circles(&self) -> Result<(BoardKind, BoardSpec), ManifestError> {
        let (rows, cols) = self.size(2)?;
        let (pitch_mm, _) = self.length(self.raw.pitch_mm.as_ref(), "pitch_mm")?;
        let (diameter_mm, line) = self.length(self.raw.diameter_mm.as_ref(), "diameter_mm")?;
        let asymmetric = flag(self.raw.asymmetric.as_ref());
        let nearest_mm = if asymmetric {
            pitch_mm * std::f64::consts::SQRT_2
        } else {
            pitch_mm
        };
        if diameter_mm >= nearest_mm {
            let problem = BoardProblem::TooLarge {
                inner: "diameter_mm",
                inner_mm: diameter_mm,
                outer: "pitch_mm",
                outer_mm: pitch_mm,
            };
            return Err(self.problem(line, problem));
        }
        let direction = self.places((rows, cols))?;
        let circles = Circles {
            rows,
            cols,
            pitch_mm,
            diameter_mm,
            asymmetric,
            direction,
        };
        let of_turns = circles.clone();
        self.check_direction(
            "direction",
            &circles.direction,
            self.raw.direction.as_ref(),
            |at, quarters| of_turns.turned(at, quarters),
        )?;
        let spec = if asymmetric {
            BoardSpec::face(rows, cols, |row, col| circles.center_mm(row, col))
        } else {
            BoardSpec::chessboard(rows, cols, pitch_mm)
        };
        Ok((BoardKind::Circles(circles), spec))
    }

    pub fn rings(&self) -> Result<(BoardKind, BoardSpec), ManifestError> {
        let (rows, cols) = self.size(MIN_CORNERS_PER_SIDE)?;
        let (pitch_mm, _) = self.length(self.raw.pitch_mm.as_ref(), "pitch_mm")?;
        let (outer_radius_mm, _) =
            self.length(self.raw.outer_radius_mm.as_ref(), "outer_radius_mm")?;
        let (direction_outer_radius_mm, line) = self.length(
            self.raw.direction_outer_radius_mm.as_ref(),
            "direction_outer_radius_mm",
        )?;
        let too_large = |inner, inner_mm, outer, outer_mm| BoardProblem::TooLarge {
            inner,
            inner_mm,
            outer,
            outer_mm,
        };
        if 2.0 * direction_outer_radius_mm >= pitch_mm {
            let (inner, inner_mm) = ("direction_outer_radius_mm", direction_outer_radius_mm);
            return Err(self.problem(line, too_large(inner, inner_mm, "pitch_mm", pitch_mm)));
        }
        if direction_outer_radius_mm < super::target_problem::MIN_RADIUS_RATIO * outer_radius_mm {
            let problem = too_large(
                "outer_radius_mm",
                outer_radius_mm,
                "direction_outer_radius_mm",
                direction_outer_radius_mm,
            );
            return Err(self.problem(line, problem));
        }
        let target = TargetSpec {
            rows,
            cols,
            pitch_mm,
            outer_radius_mm,
            direction_outer_radius_mm,
            direction: self.places((rows, cols))?,
            images: Vec::new(),
        };
        if let Some(symmetry) = target.symmetry() {
            return Err(self.problem(
                self.line,
                BoardProblem::Symmetric {
                    key: "direction",
                    symmetry,
                },
            ));
        }
        let spec = BoardSpec::chessboard(rows, cols, pitch_mm);
        Ok((BoardKind::Rings(target), spec))
    }

    /// The board with squares as high as `square_height_mm` says.
    pub fn square_height(&self, board: BoardSpec) -> Result<BoardSpec, ManifestError> {
        if self.raw.square_height_mm.is_none() {
            return Ok(board);
        }
        let (height_mm, line) =
            self.length(self.raw.square_height_mm.as_ref(), "square_height_mm")?;
        if height_mm == board.square_mm {
            return Ok(board);
        }
        if board.rows == board.cols {
            return Err(self.problem(line, BoardProblem::WhichSide));
        }
        let (rows, cols) = (board.rows, board.cols);
        Ok(BoardSpec::rectangles(
            rows,
            cols,
            board.square_mm,
            height_mm,
        ))
    }

    /// Whether some of a chessboard's squares are marked.
    pub fn chessboard(&self, board: &BoardSpec) -> Result<BoardKind, ManifestError> {
        let size = (board.rows + 1, board.cols + 1);
        let marked = self.places_of(self.raw.marked.as_ref(), size)?;
        // Where its colors tell the turn, any mark will do.
        if board.looks_same_after_half_turn() {
            // A quarter turn keeps the colors where both counts are odd numbers of squares.
            let quarters =
                board.rows == board.cols && board.rows.is_multiple_of(2) && board.layout.is_even();
            self.check_direction(
                "marked",
                &marked,
                self.raw.marked.as_ref(),
                |at, quarters_turned| {
                    (quarters || quarters_turned == 2).then(|| turned(at, size, quarters_turned))
                },
            )?;
        }
        Ok(if marked.is_empty() {
            BoardKind::Chessboard
        } else {
            BoardKind::MarkedChessboard(marked)
        })
    }

    /// Refuses marks that a turn maps onto themselves. `turn` says where a place goes by so many quarter turns; `None`
    /// if that is no turn of the whole target onto itself.
    fn check_direction(
        &self,
        key: &'static str,
        marked: &[(usize, usize)],
        raw: Option<&Spanned<Vec<Spanned<Vec<i64>>>>>,
        turn: impl Fn((usize, usize), u8) -> Option<(usize, usize)>,
    ) -> Result<(), ManifestError> {
        if marked.is_empty() {
            return Ok(());
        }
        let line = raw.map_or(self.line, |raw| self.source.line_of(raw));
        let maps_onto_itself = |quarters: &u8| {
            let lands_on = |at: &(usize, usize)| {
                turn(*at, *quarters).is_some_and(|place| marked.contains(&place))
            };
            marked.iter().all(lands_on)
        };
        match (1..4u8).find(maps_onto_itself) {
            None => Ok(()),
            Some(quarters) => {
                let symmetry = TargetSymmetry::Turn(quarters);
                Err(self.problem(line, BoardProblem::Symmetric { key, symmetry }))
            }
        }
    }

    /// The marked places.
    fn places(&self, size: (usize, usize)) -> Result<Vec<(usize, usize)>, ManifestError> {
        self.places_of(self.raw.direction.as_ref(), size)
    }

    fn places_of(
        &self,
        raw: Option<&Spanned<Vec<Spanned<Vec<i64>>>>>,
        (rows, cols): (usize, usize),
    ) -> Result<Vec<(usize, usize)>, ManifestError> {
        let mut places = Vec::new();
        for place in raw.into_iter().flat_map(Spanned::get_ref) {
            let on_grid = match place.get_ref().as_slice() {
                &[row, col] => usize::try_from(row)
                    .ok()
                    .zip(usize::try_from(col).ok())
                    .filter(|&(row, col)| row < rows && col < cols),
                _ => None,
            };
            let Some(on_grid) = on_grid else {
                let problem = BoardProblem::Direction {
                    place: place.get_ref().clone(),
                    rows,
                    cols,
                };
                return Err(self.problem(self.source.line_of(place), problem));
            };
            places.push(on_grid);
        }
        places.sort_unstable();
        places.dedup();
        Ok(places)
    }
}
