//! The ways in which labels or pixels of a view can be meant otherwise than they are written, and
//! where the board then is. No corner is fitted again: a flat board whose labels are mirrored is, to
//! its camera, the board seen from behind, and an image upside down is a scene upside down.

use crate::cause::Code;
use calib_estimate::init::board_pose::ViewFit;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::{RigidTransform, so3};
use nalgebra::{Matrix3, Matrix6, Vector3};
use std::fmt;

/// Labels are tried off by as many rows and columns.
const MOST_SHIFT: i64 = 2;

/// What was written may have been meant so.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reading {
    /// As it is written.
    AsRecorded,
    /// Numbered from the board's other end.
    Turned,
    /// Columns numbered from the other side.
    ColumnsMirrored,
    /// Rows numbered from the other side.
    RowsMirrored,
    /// Rows and columns exchanged.
    Transposed,
    /// Labels too large by so many.
    Shifted {
        /// Rows.
        rows: i64,
        /// Columns.
        cols: i64,
    },
    /// v counted upwards.
    VUpwards,
    /// u counted from the right.
    UMirrored,
    /// u and v exchanged.
    UvExchanged,
}

impl Reading {
    /// All that labels can be: what a single view may have.
    pub fn of_labels() -> Vec<Self> {
        let mut all = vec![Self::Turned, Self::ColumnsMirrored, Self::RowsMirrored];
        all.push(Self::Transposed);
        let steps = -MOST_SHIFT..=MOST_SHIFT;
        let shifts = steps
            .clone()
            .flat_map(|rows| steps.clone().map(move |cols| (rows, cols)))
            .filter(|shift| *shift != (0, 0));
        all.extend(shifts.map(|(rows, cols)| Self::Shifted { rows, cols }));
        all
    }

    /// All that pixels can be.
    pub const OF_PIXELS: [Self; 3] = [Self::VUpwards, Self::UMirrored, Self::UvExchanged];

    /// Whether rows and columns turn the other way if they are meant so.
    pub fn mirrors(self) -> bool {
        !matches!(self, Self::AsRecorded | Self::Turned | Self::Shifted { .. })
    }

    /// What takes it back.
    pub fn inverse(self) -> Self {
        match self {
            Self::Shifted { rows, cols } => Self::Shifted {
                rows: -rows,
                cols: -cols,
            },
            other => other,
        }
    }

    /// Its name as a cause.
    pub fn code(self) -> Code {
        match self {
            Self::AsRecorded | Self::Turned => Code::LabelsTurned,
            Self::ColumnsMirrored | Self::RowsMirrored | Self::UMirrored => Code::LabelsMirrored,
            Self::Transposed => Code::RowsColsSwapped,
            Self::Shifted { .. } => Code::LabelsShifted,
            Self::VUpwards => Code::VUpwards,
            Self::UvExchanged => Code::UvExchanged,
        }
    }

    /// Where the label truly is on the board; `None` if it would be off it.
    pub fn label(self, board: &BoardSpec, row: usize, col: usize) -> Option<(usize, usize)> {
        let (row, col) = match self {
            Self::Turned => board.half_turned(row, col),
            Self::ColumnsMirrored => (row, board.cols.checked_sub(1 + col)?),
            Self::RowsMirrored => (board.rows.checked_sub(1 + row)?, col),
            Self::Transposed => (col, row),
            Self::Shifted { rows, cols } => {
                let back = |label: usize, by: i64| {
                    usize::try_from(i64::try_from(label).ok()?.checked_sub(by)?).ok()
                };
                (back(row, rows)?, back(col, cols)?)
            }
            _ => (row, col),
        };
        (row < board.rows && col < board.cols).then_some((row, col))
    }

    /// The view's board if it is meant so.
    pub fn of(self, board: &BoardSpec, fit: &ViewFit) -> ViewFit {
        match self {
            Self::VUpwards => reflected(fit, Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0))),
            Self::UMirrored => {
                reflected(fit, Matrix3::from_diagonal(&Vector3::new(-1.0, 1.0, 1.0)))
            }
            Self::UvExchanged => reflected(
                fit,
                Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0),
            ),
            _ => relabelled(fit, &self.labels_from_board(board)),
        }
    }

    /// From the board's frame to that of the labels as they are written.
    fn labels_from_board(self, board: &BoardSpec) -> RigidTransform {
        let (width_mm, height_mm) = board.extent_mm();
        let about = |x: f64, y: f64, z: f64| Matrix3::from_diagonal(&Vector3::new(x, y, z));
        let (rotation, [x, y]) = match self {
            Self::Turned => (about(-1.0, -1.0, 1.0), [width_mm, height_mm]),
            Self::ColumnsMirrored => (about(-1.0, 1.0, -1.0), [width_mm, 0.0]),
            Self::RowsMirrored => (about(1.0, -1.0, -1.0), [0.0, height_mm]),
            Self::Transposed => (
                Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0),
                [0.0, 0.0],
            ),
            Self::Shifted { rows, cols } => (
                Matrix3::identity(),
                [cols as f64 * board.square_mm, rows as f64 * board.square_mm],
            ),
            _ => (Matrix3::identity(), [0.0, 0.0]),
        };
        RigidTransform::new(rotation, Vector3::new(x, y, 0.0))
    }
}

/// The information refers to the origin of the labels, and moves along with it.
fn relabelled(fit: &ViewFit, labels_from_board: &RigidTransform) -> ViewFit {
    let camera_from_board = fit.camera_from_board * *labels_from_board;
    let shift = camera_from_board.translation_mm - fit.camera_from_board.translation_mm;
    let mut back = Matrix6::identity();
    back.fixed_view_mut::<3, 3>(3, 0)
        .copy_from(&so3::skew(&shift));
    ViewFit {
        camera_from_board,
        information: back.transpose() * fit.information * back,
        ..*fit
    }
}

/// The scene seen in a mirror of the camera's axes. The board's own axis out of its face turns
/// around, so that the pose stays a rotation; rotation vectors change their sign besides.
fn reflected(fit: &ViewFit, mirror: Matrix3<f64>) -> ViewFit {
    let face = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, -1.0));
    let pose = &fit.camera_from_board;
    let mut of_steps = Matrix6::zeros();
    of_steps.fixed_view_mut::<3, 3>(0, 0).copy_from(&-mirror);
    of_steps.fixed_view_mut::<3, 3>(3, 3).copy_from(&mirror);
    ViewFit {
        camera_from_board: RigidTransform::new(
            mirror * pose.rotation * face,
            mirror * pose.translation_mm,
        ),
        information: of_steps * fit.information * of_steps,
        ..*fit
    }
}

impl fmt::Display for Reading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let plural = |n: i64, one: &str| match n.abs() {
            1 => format!("1 {one}"),
            n => format!("{n} {one}s"),
        };
        match *self {
            Self::AsRecorded => f.write_str("as recorded"),
            Self::Turned => f.write_str("numbered from the board's other end"),
            Self::ColumnsMirrored => f.write_str("with its columns numbered from the other side"),
            Self::RowsMirrored => f.write_str("with its rows numbered from the other side"),
            Self::Transposed => f.write_str("with rows and columns exchanged"),
            Self::Shifted { rows, cols } => {
                let parts: Vec<String> = [(rows, "row"), (cols, "column")]
                    .into_iter()
                    .filter(|(n, _)| *n != 0)
                    .map(|(n, one)| {
                        let sense = if n > 0 { "too large" } else { "too small" };
                        format!("{} {sense}", plural(n, one))
                    })
                    .collect();
                write!(f, "with labels {}", parts.join(" and "))
            }
            Self::VUpwards => f.write_str("with v counted upwards"),
            Self::UMirrored => f.write_str("with u counted from the right"),
            Self::UvExchanged => f.write_str("with u and v exchanged"),
        }
    }
}
