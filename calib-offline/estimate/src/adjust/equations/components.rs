//! The components of a camera's field, and where each stands among the columns of the equations.

use crate::adjust::model::CameraModel;

/// The fixed functions behind each component of a camera's field, polynomials only.
#[derive(Debug, Clone, Copy)]
pub struct Components {
    direction_terms: usize,
    offset_terms: usize,
}

impl Components {
    /// Those of a camera.
    pub fn of(camera: &CameraModel) -> Self {
        Self {
            direction_terms: camera.field.direction.polynomial.coefficients.len(),
            offset_terms: camera
                .field
                .offset
                .as_ref()
                .map_or(0, |offset| offset.polynomial.coefficients.len()),
        }
    }

    /// Number of components: 2 for a central camera, else 4.
    pub fn count(&self) -> usize {
        if self.offset_terms > 0 { 4 } else { 2 }
    }

    /// Number of functions of a component: the first so many Legendre products.
    pub fn terms(&self, component: usize) -> usize {
        if component < 2 {
            self.direction_terms
        } else {
            self.offset_terms
        }
    }

    /// First column of a component.
    pub fn start(&self, component: usize) -> usize {
        (0..component).map(|c| self.terms(c)).sum()
    }

    /// Number of columns.
    pub fn len(&self) -> usize {
        self.start(self.count())
    }
}

/// Number of the pair (a, b), a <= b, of `count` components.
pub fn pair(count: usize, a: usize, b: usize) -> usize {
    let (a, b) = (a.min(b), a.max(b));
    a * count - a * (a + 1) / 2 + b
}
