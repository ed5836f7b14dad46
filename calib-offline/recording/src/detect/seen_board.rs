//! A target that an image shows instead of the one described.

/// A target that an image shows.
#[derive(Debug, Clone, PartialEq)]
pub struct SeenBoard {
    /// What it is.
    pub kind: SeenKind,
    /// Rows in view: of inner corners, tags, circles or rings.
    pub rows: usize,
    /// Columns of the same.
    pub cols: usize,
    /// Whether the image shows on all sides that there are no more.
    pub is_whole: bool,
}

/// What a target is that an image shows; places are [row, column] from 0.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum SeenKind {
    /// A chessboard without markers.
    Chessboard {
        /// Squares with a dot.
        marked: Vec<(usize, usize)>,
    },
    /// A `ChArUco` board.
    Charuco {
        /// `OpenCV`'s name of its markers.
        dictionary: &'static str,
        /// Whether it is of the old pattern.
        legacy: bool,
        /// Its first marker.
        first_id: usize,
    },
    /// A grid of tags.
    AprilGrid {
        /// Family of the tags.
        family: &'static str,
        /// Its first tag; `None` where the numbers do not say.
        first_id: Option<usize>,
        /// Space between tags as a share of their side, if it was measured.
        spacing: Option<f64>,
    },
    /// A grid of circles.
    Circles {
        /// Whether every other row is shifted.
        asymmetric: bool,
        /// The marked ones.
        direction: Vec<(usize, usize)>,
        /// Their diameter as a share of `pitch_mm`, where it is not the one stated.
        diameter: Option<f64>,
    },
    /// A grid of rings.
    Rings {
        /// The larger ones.
        direction: Vec<(usize, usize)>,
    },
    /// Coded markers, on what is unclear.
    Markers {
        /// `OpenCV`'s name of their dictionary.
        dictionary: &'static str,
        /// How many.
        count: usize,
    },
}

impl std::fmt::Display for SeenBoard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { rows, cols, .. } = self;
        let part = if self.is_whole { "" } else { "a part of " };
        match &self.kind {
            SeenKind::Chessboard { marked } => {
                let dots = match marked.len() {
                    0 => String::new(),
                    count => format!(", {count} squares with a dot"),
                };
                write!(
                    f,
                    "{part}a chessboard with {rows} x {cols} inner corners{dots}"
                )
            }
            SeenKind::Charuco {
                dictionary, legacy, ..
            } => {
                let pattern = if *legacy { ", of the old pattern" } else { "" };
                write!(
                    f,
                    "{part}a ChArUco board of {rows} x {cols} inner corners with {dictionary}{pattern}"
                )
            }
            SeenKind::AprilGrid {
                family, spacing, ..
            } => {
                let apart = spacing.map_or_else(String::new, |share| {
                    format!(", {share:.2} of their side apart")
                });
                write!(f, "{part}a grid of {rows} x {cols} tags of {family}{apart}")
            }
            SeenKind::Circles {
                asymmetric,
                direction,
                diameter,
            } => {
                let kind = if *asymmetric {
                    "asymmetric"
                } else {
                    "symmetric"
                };
                let wide = diameter.map_or_else(String::new, |share| {
                    format!(", their diameter {share:.2} of the pitch")
                });
                write!(
                    f,
                    "{part}a grid of {rows} x {cols} circles, {kind}, {} of them marked{wide}",
                    direction.len()
                )
            }
            SeenKind::Rings { direction } => write!(
                f,
                "{part}a grid of {rows} x {cols} rings, {} of them larger",
                direction.len()
            ),
            SeenKind::Markers { dictionary, count } => {
                write!(
                    f,
                    "{count} markers of {dictionary}, not where they should be"
                )
            }
        }
    }
}

/// Spacings differ beyond this share of a tag's side.
const OTHER_SPACING: f64 = 0.02;

impl SeenBoard {
    /// Whether an image of the one stated can look like this, as far as it is seen.
    pub(super) fn may_be(&self, stated: &Self) -> bool {
        let (seen, size) = ((self.rows, self.cols), (stated.rows, stated.cols));
        let turned = (self.cols, self.rows);
        let size_fits = if self.is_whole {
            seen == size || turned == size
        } else {
            let within = |(rows, cols): (usize, usize)| rows <= size.0 && cols <= size.1;
            within(seen) || within(turned)
        };
        // A dictionary begins with the markers of the smaller ones of its kind.
        let kind_of = |name: &str| name.rsplit_once('_').map(|parts| parts.0.to_owned());
        let kind_fits = match (&self.kind, &stated.kind) {
            (SeenKind::Chessboard { marked }, SeenKind::Chessboard { marked: stated }) => {
                let half_turned: Vec<(usize, usize)> = marked
                    .iter()
                    .filter_map(|(row, col)| {
                        Some((self.rows.checked_sub(*row)?, self.cols.checked_sub(*col)?))
                    })
                    .collect();
                !self.is_whole || are_same(marked, stated) || are_same(&half_turned, stated)
            }
            (
                SeenKind::Charuco {
                    dictionary,
                    legacy,
                    first_id,
                },
                SeenKind::Charuco {
                    dictionary: other,
                    legacy: stated_legacy,
                    first_id: stated_id,
                },
            ) => {
                kind_of(dictionary) == kind_of(other)
                    && (legacy == stated_legacy || !(self.rows + 1).is_multiple_of(2))
                    && first_id == stated_id
            }
            (
                SeenKind::AprilGrid {
                    family,
                    first_id,
                    spacing,
                },
                SeenKind::AprilGrid {
                    family: other,
                    first_id: stated_id,
                    spacing: stated_spacing,
                },
            ) => {
                let apart = spacing
                    .zip(*stated_spacing)
                    .is_none_or(|(seen, stated)| (seen - stated).abs() <= OTHER_SPACING);
                family == other
                    && apart
                    && first_id.is_none_or(|first_id| Some(first_id) == *stated_id)
            }
            (
                SeenKind::Circles {
                    asymmetric,
                    direction,
                    diameter,
                },
                SeenKind::Circles {
                    asymmetric: stated,
                    direction: stated_direction,
                    ..
                },
            ) => {
                let marks = !self.is_whole || are_same(direction, stated_direction);
                asymmetric == stated && diameter.is_none() && marks
            }
            (SeenKind::Rings { direction }, SeenKind::Rings { direction: stated }) => {
                !self.is_whole || are_same(direction, stated)
            }
            (
                SeenKind::Markers { dictionary, .. },
                SeenKind::Charuco {
                    dictionary: other, ..
                },
            ) => {
                return kind_of(dictionary) == kind_of(other);
            }
            _ => false,
        };
        kind_fits && size_fits
    }

    /// The line for the manifest, if this is what was meant.
    pub(super) fn what_to_write(&self) -> String {
        let Self { rows, cols, .. } = self;
        let size = if self.is_whole {
            format!("rows = {rows}, cols = {cols}")
        } else {
            format!("rows and cols of the whole board ({rows} x {cols} are in view)")
        };
        let line = match &self.kind {
            SeenKind::Chessboard { marked } => {
                let marked = places(marked, ", marked = ");
                format!("kind = \"chessboard\", {size}{marked}")
            }
            SeenKind::Charuco {
                dictionary,
                legacy,
                first_id,
            } => {
                let first = match first_id {
                    0 => String::new(),
                    id => format!(", first_id = {id}"),
                };
                format!(
                    "kind = \"charuco\", {size}, dictionary = \"{dictionary}\", legacy = {legacy}{first}"
                )
            }
            SeenKind::AprilGrid {
                family,
                first_id,
                spacing,
            } => {
                let first = first_id.map_or_else(String::new, |id| format!(", first_id = {id}"));
                let spacing =
                    spacing.map_or_else(String::new, |share| format!(", spacing = {share:.2}"));
                format!("kind = \"aprilgrid\", {size}, family = \"{family}\"{first}{spacing}")
            }
            SeenKind::Circles {
                asymmetric,
                direction,
                diameter,
            } => {
                let direction = if self.is_whole {
                    places(direction, ", direction = ")
                } else if direction.is_empty() {
                    String::new()
                } else {
                    ", and the marked ones in direction".to_owned()
                };
                let diameter = diameter.map_or_else(String::new, |share| {
                    format!(", diameter_mm = {share:.2} times pitch_mm")
                });
                format!(
                    "kind = \"circles\", {size}, asymmetric = {asymmetric}{direction}{diameter}"
                )
            }
            SeenKind::Rings { direction } => {
                let direction = if self.is_whole {
                    places(direction, ", direction = ")
                } else {
                    ", and the larger ones in direction".to_owned()
                };
                format!("kind = \"rings\", {size}{direction}")
            }
            SeenKind::Markers { dictionary, .. } => {
                return format!(
                    "if dictionary = \"{dictionary}\" is right, check rows, cols (inner corners, not squares), legacy and first_id"
                );
            }
        };
        format!("if this is the right board, write {line}")
    }
}

/// Whether two lists hold the same places.
fn are_same(first: &[(usize, usize)], second: &[(usize, usize)]) -> bool {
    first.len() == second.len() && first.iter().all(|place| second.contains(place))
}

/// The key with its places; nothing if there are none.
fn places(of: &[(usize, usize)], key: &str) -> String {
    if of.is_empty() {
        return String::new();
    }
    let places: Vec<String> = of
        .iter()
        .map(|(row, col)| format!("[{row}, {col}]"))
        .collect();
    format!("{key}[{}]", places.join(", "))
}
