//! What the formats share: camera matrices, rotations, and `OpenCV`'s form of a matrix.

use super::{Document, Matrix, Problem};
use crate::model::ImagePlane;
use calib_rays::geometry::RigidTransform;
use nalgebra::{Matrix3, Vector3};

/// How far a rotation's columns may be from orthonormal: files with six digits pass, those of something else do not.
const ROTATION_ROUNDING: f64 = 1e-4;

impl Document<'_> {
    /// A matrix in `OpenCV`'s form: `rows`, `cols` (or `sizes`), `dt` and `data`. `types` are those that may be.
    pub(crate) fn matrix_of(&self, types: &[&str]) -> Result<Matrix, Problem> {
        if !self.is_group() {
            return Err(self.wrong("a matrix with rows, cols and data"));
        }
        if let Some(dt) = self.get("dt")
            && !types.contains(&dt.text()?)
        {
            return Err(dt.wrong(format!("of type {}", types.join(" or "))));
        }
        let (rows, cols) = match self.get("sizes") {
            Some(sizes) => {
                let sizes = match sizes.items() {
                    Ok(items) => items,
                    Err(_) => vec![sizes.clone()],
                };
                let sides = sizes
                    .iter()
                    .map(Document::side)
                    .collect::<Result<Vec<_>, _>>()?;
                match sides[..] {
                    [count] => (1, count),
                    [rows, cols] => (rows, cols),
                    _ => return Err(self.need("sizes")?.wrong("one or two sizes")),
                }
            }
            None => (self.need("rows")?.side()?, self.need("cols")?.side()?),
        };
        let (rows, cols) = (rows as usize, cols as usize);
        let data = self.need("data")?;
        let numbers = data.numbers()?;
        let channels = if types.iter().all(|dt| dt.starts_with('2')) {
            2
        } else {
            1
        };
        if numbers.len() != rows * cols * channels {
            return Err(data.disagrees(format!("its size, {rows} x {cols}")));
        }
        Ok(Matrix {
            rows,
            cols,
            data: numbers,
        })
    }

    /// A matrix of numbers.
    pub(crate) fn matrix(&self) -> Result<Matrix, Problem> {
        self.matrix_of(&["d", "f"])
    }

    /// A vector, standing or lying.
    pub(crate) fn vector(&self) -> Result<Vec<f64>, Problem> {
        let matrix = self.matrix()?;
        if matrix.rows != 1 && matrix.cols != 1 {
            return Err(self.wrong("one row or one column"));
        }
        Ok(matrix.data)
    }

    /// The plane of a camera matrix, row by row.
    pub(crate) fn camera_matrix(&self, matrix: &Matrix) -> Result<ImagePlane, Problem> {
        let [fx, skew, cx, zero, fy, cy, a, b, one] = matrix.data[..] else {
            return Err(self.wrong("a matrix of 3 x 3"));
        };
        if (matrix.rows, matrix.cols) != (3, 3) {
            return Err(self.wrong("a matrix of 3 x 3"));
        }
        if [zero, a, b, one] != [0.0, 0.0, 0.0, 1.0] {
            return Err(self.wrong("a camera matrix (fx 0 cx; 0 fy cy; 0 0 1)"));
        }
        if skew != 0.0 {
            return Err(self.wrong("a camera matrix without skew"));
        }
        self.plane([fx, fy, cx, cy])
    }

    /// The plane of `fx, fy, cx, cy`.
    pub(crate) fn plane(&self, numbers: [f64; 4]) -> Result<ImagePlane, Problem> {
        if !(numbers[0] > 0.0 && numbers[1] > 0.0) {
            return Err(self.wrong("with focal lengths above zero"));
        }
        Ok(ImagePlane::new(numbers))
    }

    /// A rotation, row by row, made orthonormal from its rounded digits.
    pub(crate) fn rotation(&self, numbers: &[f64]) -> Result<Matrix3<f64>, Problem> {
        if numbers.len() != 9 {
            return Err(self.wrong("a rotation matrix of 3 x 3"));
        }
        let matrix = Matrix3::from_row_slice(numbers);
        let off = (matrix.tr_mul(&matrix) - Matrix3::identity()).amax();
        if !(off < ROTATION_ROUNDING && matrix.determinant() > 0.0) {
            return Err(self.wrong("a rotation matrix"));
        }
        let turn = RigidTransform::new(matrix, Vector3::zeros());
        Ok(turn.orthonormalized().rotation)
    }
}
