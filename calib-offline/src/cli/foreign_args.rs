//! What files of other tools do not say, as arguments of whoever reads them.

use calib_exchange::{Hint, ReadOptions, RotationForm, Unit};
use calib_rays::geometry::SensorSize;
use clap::{Args, ValueEnum};

/// The arguments.
#[derive(Debug, Args)]
pub struct ForeignArgs {
    /// The unit of the files' lengths.
    #[arg(
        long,
        value_name = "UNIT",
        value_enum,
        help = "The unit of the files' lengths, where they do not say it (OpenCV, DICe, MATLAB); if no file needs it, instead of meters"
    )]
    pub unit: Option<UnitArg>,
    /// The size of the images, where the files do not say it
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = parse_size)]
    pub size: Option<SensorSize>,
    /// What four coefficients of `OpenCV` are of.
    #[arg(
        long,
        value_name = "MODEL",
        value_enum,
        help = "What four coefficients in a file of OpenCV are of"
    )]
    pub model: Option<ModelArg>,
    /// How MATLAB's rotation of the second camera is meant: x2 = x1 R + t, or x2 = R x1 + t
    #[arg(long, value_name = "FORM", value_enum)]
    pub rotation: Option<RotationArg>,
    /// Names for the cameras, in the order of the files
    #[arg(long, value_name = "A,B", value_delimiter = ',')]
    pub names: Vec<String>,
}

/// A unit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum UnitArg {
    /// Millimeters
    Mm,
    /// Meters
    M,
}

/// A model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ModelArg {
    /// Brown's distortion
    Pinhole,
    /// Kannala and Brandt's
    Fisheye,
}

/// A form.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum RotationArg {
    /// Points are rows: releases before R2022b
    Row,
    /// Points are columns
    Column,
}

impl ForeignArgs {
    /// For the readers.
    pub fn options(&self) -> ReadOptions {
        ReadOptions {
            unit: self.unit.map(|unit| match unit {
                UnitArg::Mm => Unit::Mm,
                UnitArg::M => Unit::M,
            }),
            sensor: self.size,
            model: self.model.map(|model| match model {
                ModelArg::Pinhole => Hint::Pinhole,
                ModelArg::Fisheye => Hint::Fisheye,
            }),
            rotation: self.rotation.map(|form| match form {
                RotationArg::Row => RotationForm::Row,
                RotationArg::Column => RotationForm::Column,
            }),
        }
    }

    /// The names, if any are given.
    pub fn names(&self) -> Option<Vec<String>> {
        (!self.names.is_empty()).then(|| self.names.clone())
    }
}

fn parse_size(text: &str) -> Result<SensorSize, String> {
    let sides = text.split_once('x').and_then(|(width, height)| {
        let side = |text: &str| {
            text.parse::<u32>()
                .ok()
                .filter(|side| (1..=65535).contains(side))
        };
        Some(SensorSize::new(side(width)?, side(height)?))
    });
    sides.ok_or_else(|| "give width and height, such as 1280x1024".to_owned())
}
