//! What files do not say, said by whoever reads them.

use calib_rays::geometry::SensorSize;

/// The unit of a file's lengths.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Millimeters.
    Mm,
    /// Meters.
    M,
}

impl Unit {
    /// Millimeters in it.
    pub const fn mm(self) -> f64 {
        match self {
            Self::Mm => 1.0,
            Self::M => 1000.0,
        }
    }
}

/// Which model four coefficients belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hint {
    /// A pinhole with Brown's distortion.
    Pinhole,
    /// `OpenCV`'s fisheye.
    Fisheye,
}

/// How MATLAB's rotation of the second camera is to be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RotationForm {
    /// Points are rows before the matrix: releases before R2022b.
    Row,
    /// Points are columns behind it.
    Column,
}

/// What files do not say. Nothing is taken unless it is needed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ReadOptions {
    /// The unit of lengths.
    pub unit: Option<Unit>,
    /// The sensor.
    pub sensor: Option<SensorSize>,
    /// The model of four coefficients.
    pub model: Option<Hint>,
    /// MATLAB's rotation.
    pub rotation: Option<RotationForm>,
}
