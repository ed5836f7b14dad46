//! The calibration target: a flat chessboard, described by its inner corners, or points with known places.

use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A target: `rows` x `cols` labels, and where each lies.
///
/// Frame of a grid: the first inner corner (row 0, col 0) is the origin, x runs along the columns, y
/// along the rows, z = x cross y points away from the printed face, so that a camera looking at
/// the face has the board's z pointing away from it. Lengths in millimeters.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BoardSpec {
    /// Inner corners along y; 1 where places are listed.
    pub rows: usize,
    /// Inner corners along x; places that are listed.
    pub cols: usize,
    /// Pitch of the corners, mm; of listed places the distance to the next one, in the mean.
    pub square_mm: f64,
    /// Where the labels lie.
    #[serde(default, skip_serializing_if = "Layout::is_even")]
    pub layout: Layout,
}

/// Where the labels of a target lie.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Layout {
    /// Inner corners of a chessboard, pitch `square_mm`.
    #[default]
    Grid,
    /// Inner corners of a chessboard whose squares are not square: pitch `square_mm` along x, and this along y, mm.
    Rectangles(f64),
    /// Places on a flat printed face, mm, row by row.
    Face(#[schemars(with = "Vec<[f64; 2]>")] Arc<[[f64; 2]]>),
    /// Known places, by column; one row. They need not lie in a plane.
    Points(#[schemars(with = "Vec<KnownPlace>")] Arc<[KnownPlace]>),
}

/// Where a point of a target lies.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct KnownPlace {
    /// In the target's frame, mm.
    #[schemars(with = "[f64; 3]")]
    pub at_mm: Vector3<f64>,
    /// Standard deviation of each coordinate, mm; 0 for a place that counts as exact.
    #[serde(default)]
    pub sigma_mm: f64,
}

impl KnownPlace {
    /// A place that counts as exact, mm.
    pub fn exact(at_mm: Vector3<f64>) -> Self {
        Self {
            at_mm,
            sigma_mm: 0.0,
        }
    }
}

impl Layout {
    /// Whether the labels are rows and columns of a printed face.
    pub fn is_grid(&self) -> bool {
        matches!(self, Self::Grid | Self::Rectangles(_) | Self::Face(_))
    }

    /// Whether the places follow from rows, columns and pitch.
    pub fn is_even(&self) -> bool {
        matches!(self, Self::Grid)
    }
}

impl BoardSpec {
    /// A chessboard of `rows` x `cols` inner corners.
    pub const fn chessboard(rows: usize, cols: usize, square_mm: f64) -> Self {
        Self {
            rows,
            cols,
            square_mm,
            layout: Layout::Grid,
        }
    }

    /// A chessboard whose squares are `square_mm` wide along a row and `height_mm` high along a column.
    pub const fn rectangles(rows: usize, cols: usize, square_mm: f64, height_mm: f64) -> Self {
        Self {
            rows,
            cols,
            square_mm,
            layout: Layout::Rectangles(height_mm),
        }
    }

    /// Pitch of the corners of a chessboard along x and along y, mm; `None` of another target.
    fn pitches_mm(&self) -> Option<[f64; 2]> {
        match self.layout {
            Layout::Grid => Some([self.square_mm; 2]),
            Layout::Rectangles(height_mm) => Some([self.square_mm, height_mm]),
            _ => None,
        }
    }

    /// Width and height of a chessboard's squares, mm; of another target its pitch.
    pub fn square_sides_mm(&self) -> [f64; 2] {
        self.pitches_mm().unwrap_or([self.square_mm; 2])
    }

    /// A target of known places.
    pub fn points(places: Vec<KnownPlace>) -> Self {
        Self {
            rows: 1,
            cols: places.len(),
            square_mm: mean_spacing_mm(&places),
            layout: Layout::Points(places.into()),
        }
    }

    /// A printed face with `rows` x `cols` points, mm.
    pub fn face(rows: usize, cols: usize, place_mm: impl Fn(usize, usize) -> [f64; 2]) -> Self {
        let labels = (0..rows).flat_map(|row| (0..cols).map(move |col| (row, col)));
        let places: Vec<[f64; 2]> = labels.map(|(row, col)| place_mm(row, col)).collect();
        let known: Vec<KnownPlace> = places
            .iter()
            .map(|[x, y]| KnownPlace::exact(Vector3::new(*x, *y, 0.0)))
            .collect();
        Self {
            rows,
            cols,
            square_mm: mean_spacing_mm(&known),
            layout: Layout::Face(places.into()),
        }
    }

    /// The same target, longer in every direction by a factor.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        match &self.layout {
            Layout::Grid => Self::chessboard(self.rows, self.cols, self.square_mm * factor),
            Layout::Rectangles(height_mm) => Self::rectangles(
                self.rows,
                self.cols,
                self.square_mm * factor,
                height_mm * factor,
            ),
            Layout::Face(places) => Self::face(self.rows, self.cols, |row, col| {
                places[row * self.cols + col].map(|mm| mm * factor)
            }),
            Layout::Points(places) => Self::points(
                places
                    .iter()
                    .map(|place| KnownPlace {
                        at_mm: place.at_mm * factor,
                        ..*place
                    })
                    .collect(),
            ),
        }
    }

    /// The shape that nothing is known of yet: of a printed face, total degree two; none where places are known.
    pub fn unknown_shape(&self) -> BoardShape {
        match &self.layout {
            Layout::Grid | Layout::Rectangles(_) | Layout::Face(_) => {
                BoardShape::flat_of_degree_two()
            }
            Layout::Points(_) => BoardShape::default(),
        }
    }

    /// Standard deviation of each coordinate of a label's place, mm; 0 where it counts as exact.
    pub fn place_sigma_mm(&self, col: usize) -> f64 {
        match &self.layout {
            Layout::Grid | Layout::Rectangles(_) | Layout::Face(_) => 0.0,
            Layout::Points(places) => places.get(col).map_or(0.0, |place| place.sigma_mm),
        }
    }

    /// Labels whose corners lie beside a corner, each pair of neighbors counted once: the next ones along rows
    /// and columns; of listed places the next in the list, if it is near.
    pub fn next_to(&self, row: usize, col: usize) -> impl Iterator<Item = (usize, usize)> {
        let along = match &self.layout {
            Layout::Grid | Layout::Rectangles(_) | Layout::Face(_) => true,
            Layout::Points(places) => {
                let next = places.get(col + 1);
                next.is_some_and(|next| {
                    (next.at_mm - places[col].at_mm).norm() < NEAR_SPACINGS * self.square_mm
                })
            }
        };
        let down = self.layout.is_grid().then_some((row + 1, col));
        down.into_iter().chain(along.then_some((row, col + 1)))
    }

    /// Number of labels.
    pub fn corner_count(&self) -> usize {
        self.rows * self.cols
    }

    /// Nominal position of a corner in the board frame, mm: `(col, row, 0) * square_mm`, or the place that is
    /// listed for it, no number if there is none.
    pub fn corner_in_board(&self, row: usize, col: usize) -> Vector3<f64> {
        match &self.layout {
            Layout::Grid | Layout::Rectangles(_) => {
                let [width_mm, height_mm] = self.square_sides_mm();
                Vector3::new(col as f64 * width_mm, row as f64 * height_mm, 0.0)
            }
            Layout::Face(places) => places
                .get(row * self.cols + col)
                .map_or_else(|| Vector3::repeat(f64::NAN), on_face),
            Layout::Points(places) => places
                .get(col)
                .map_or_else(|| Vector3::repeat(f64::NAN), |place| place.at_mm),
        }
    }

    /// The middle of the corners' extent, board frame, mm.
    pub fn center_in_board(&self) -> Vector3<f64> {
        match &self.layout {
            Layout::Grid | Layout::Rectangles(_) => {
                let (width_mm, height_mm) = self.extent_mm();
                Vector3::new(width_mm / 2.0, height_mm / 2.0, 0.0)
            }
            Layout::Face(places) => {
                let (least, most) = bounds(places.iter().map(on_face));
                (least + most) / 2.0
            }
            Layout::Points(places) => {
                let (least, most) = bounds(places.iter().map(|place| place.at_mm));
                (least + most) / 2.0
            }
        }
    }

    /// Distance from the first to the last corner along x and along y, mm.
    pub fn extent_mm(&self) -> (f64, f64) {
        match &self.layout {
            Layout::Grid | Layout::Rectangles(_) => {
                let [width_mm, height_mm] = self.square_sides_mm();
                (
                    self.cols.saturating_sub(1) as f64 * width_mm,
                    self.rows.saturating_sub(1) as f64 * height_mm,
                )
            }
            Layout::Face(places) => {
                let (least, most) = bounds(places.iter().map(on_face));
                (most.x - least.x, most.y - least.y)
            }
            Layout::Points(places) => {
                let (least, most) = bounds(places.iter().map(|place| place.at_mm));
                (most.x - least.x, most.y - least.y)
            }
        }
    }

    /// Distance between the places of neighboring labels ([`Self::next_to`]), mm.
    pub fn apart_mm(&self, first: (usize, usize), second: (usize, usize)) -> f64 {
        if self.layout.is_even() {
            return self.square_mm;
        }
        (self.corner_in_board(first.0, first.1) - self.corner_in_board(second.0, second.1)).norm()
    }

    /// What it is, in words.
    pub fn words(&self) -> String {
        self.words_of("inner corners")
    }

    /// What it is, in words; `points` is what its labels are, such as inner corners.
    pub fn words_of(&self, points: &str) -> String {
        let (rows, cols) = (self.rows, self.cols);
        match &self.layout {
            Layout::Grid => format!(
                "{rows} rows x {cols} cols of {points}, {} mm",
                self.square_mm
            ),
            Layout::Rectangles(height_mm) => format!(
                "{rows} rows x {cols} cols of {points}, {} x {height_mm} mm",
                self.square_mm
            ),
            Layout::Face(_) => format!(
                "{rows} rows x {cols} cols of {points}, {:.3} mm apart",
                self.square_mm
            ),
            Layout::Points(places) => format!("{} points with known places", places.len()),
        }
    }

    /// Corners of the target's outline in its frame, in turn, mm: through the outermost labels, at the middle depth.
    pub fn outline_in_board(&self) -> [Vector3<f64>; 4] {
        let (width_mm, height_mm) = self.extent_mm();
        let middle = self.center_in_board();
        [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]
            .map(|(x, y)| middle + Vector3::new(x * width_mm, y * height_mm, 0.0))
    }

    /// Whether the board looks the same after a half turn in its plane, squares' colors included.
    ///
    /// So it is when rows and columns are both odd or both even; a board with one of each can be
    /// told apart by the color of its corner square. Listed places are told apart by their labels.
    pub fn looks_same_after_half_turn(&self) -> bool {
        self.pitches_mm().is_some() && self.rows % 2 == self.cols % 2
    }

    /// The label that a corner gets when the board is numbered from the opposite end.
    pub fn half_turned(&self, row: usize, col: usize) -> (usize, usize) {
        (self.rows - 1 - row, self.cols - 1 - col)
    }
}

/// A place on a printed face, mm.
fn on_face([x, y]: &[f64; 2]) -> Vector3<f64> {
    Vector3::new(*x, *y, 0.0)
}

/// Least and most of each coordinate; zero without points.
fn bounds(mut places_mm: impl Iterator<Item = Vector3<f64>>) -> (Vector3<f64>, Vector3<f64>) {
    let first = places_mm.next().unwrap_or_else(Vector3::zeros);
    places_mm.fold((first, first), |(least, most), place| {
        (least.inf(&place), most.sup(&place))
    })
}

/// Mean distance from a place to the nearest other one, mm; of at most [`SPACING_PLACES`] places.
fn mean_spacing_mm(places: &[KnownPlace]) -> f64 {
    let stride = places.len().div_ceil(SPACING_PLACES).max(1);
    let nearest: Vec<f64> = (0..places.len())
        .step_by(stride)
        .map(|k| {
            (0..places.len())
                .filter(|other| *other != k)
                .map(|other| (places[k].at_mm - places[other].at_mm).norm())
                .fold(f64::INFINITY, f64::min)
        })
        .filter(|nearest| nearest.is_finite())
        .collect();
    nearest.iter().sum::<f64>() / nearest.len().max(1) as f64
}

/// Places whose next one is looked for; more would change a mean by nothing.
const SPACING_PLACES: usize = 500;
/// Places farther apart than so many mean spacings are no neighbors.
const NEAR_SPACINGS: f64 = 1.5;

/// Out-of-plane shape `z(X, Y)` of a board: Legendre products over the corners' extent, x and y
/// from -1 at the first to 1 at the last corner. A flat board has no term.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct BoardShape {
    /// Powers (i, j) and coefficient, mm.
    pub terms: Vec<(usize, usize, f64)>,
}

impl BoardShape {
    /// The shape of total degree 2 with all coefficients zero: bow along x, twist, bow along y.
    /// Lower degrees are poses, not shape.
    pub fn flat_of_degree_two() -> Self {
        Self {
            terms: vec![(2, 0, 0.0), (1, 1, 0.0), (0, 2, 0.0)],
        }
    }

    /// Value of each term's product (without its coefficient) at a point of the board.
    pub fn products<'a>(
        &'a self,
        board: &BoardSpec,
        point_in_board: &Vector3<f64>,
    ) -> impl Iterator<Item = f64> + 'a {
        // Of a target without terms nothing is asked, and its extent may be long to find.
        let (width_mm, height_mm) = if self.terms.is_empty() {
            (1.0, 1.0)
        } else {
            board.extent_mm()
        };
        let x = 2.0 * point_in_board.x / width_mm - 1.0;
        let y = 2.0 * point_in_board.y / height_mm - 1.0;
        self.terms
            .iter()
            .map(move |&(i, j, _)| legendre(i, x) * legendre(j, y))
    }

    /// Height of the board's face along its z axis, mm.
    pub fn height_mm(&self, board: &BoardSpec, point_in_board: &Vector3<f64>) -> f64 {
        if self.terms.is_empty() {
            return 0.0;
        }
        self.products(board, point_in_board)
            .zip(&self.terms)
            .map(|(product, (_, _, coefficient))| product * coefficient)
            .sum()
    }
}

/// Legendre polynomial of degree `n`, by recurrence.
fn legendre(n: usize, x: f64) -> f64 {
    let (mut previous, mut current) = (0.0, 1.0);
    for k in 0..n {
        let kf = k as f64;
        let next = ((2.0 * kf + 1.0) * x * current - kf * previous) / (kf + 1.0);
        previous = current;
        current = next;
    }
    current
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOARD: BoardSpec = BoardSpec::chessboard(15, 13, 10.0);

    #[test]
    fn last_corner_is_extent_away_from_first() {
        assert_eq!(
            BOARD.corner_in_board(14, 12),
            Vector3::new(120.0, 140.0, 0.0)
        );
        assert_eq!(BOARD.extent_mm(), (120.0, 140.0));
    }

    #[test]
    fn rectangles_are_as_high_as_stated() {
        let board = BoardSpec::rectangles(15, 13, 10.0, 10.5);
        assert_eq!(
            board.corner_in_board(14, 12),
            Vector3::new(120.0, 147.0, 0.0)
        );
        assert_eq!(board.extent_mm(), (120.0, 147.0));
        assert_eq!(board.apart_mm((0, 0), (1, 0)), 10.5);
        assert_eq!(board.scaled(2.0).square_sides_mm(), [20.0, 21.0]);
        assert!(board.looks_same_after_half_turn());
    }

    #[test]
    fn odd_by_odd_board_is_ambiguous_and_even_by_odd_is_not() {
        assert!(BOARD.looks_same_after_half_turn());
        assert!(!BoardSpec::chessboard(6, 9, 25.0).looks_same_after_half_turn());
        assert_eq!(BOARD.half_turned(0, 12), (14, 0));
    }

    #[test]
    fn bow_is_one_at_the_edges_and_minus_half_in_the_middle() {
        let shape = BoardShape {
            terms: vec![(2, 0, 0.3)],
        };
        assert!((shape.height_mm(&BOARD, &BOARD.corner_in_board(0, 12)) - 0.3).abs() < 1e-15);
        assert!((shape.height_mm(&BOARD, &BOARD.center_in_board()) + 0.15).abs() < 1e-15);
    }
}
