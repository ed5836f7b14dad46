//! What the forms of `export` for other tools take besides the rig: which lens, where on its rays, which part of the sensor.

use super::export_form::FolderForm;
use super::import::parse_distance;
use super::usage_error::UsageError;
use calib_exchange::{Distortion, Region};
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// The arguments.
#[derive(Debug, Args)]
pub struct FolderArgs {
    /// Where lenses and maps come nearest to the rays: how far from the camera [default: the working distance]
    #[arg(long, value_name = "MM", value_parser = parse_distance)]
    pub distance_mm: Option<f64>,
    /// The part of the sensor that a lens is fitted to, px, for opencv, ros, kalibr and both of mrcal's
    #[arg(long, value_name = "U0,V0,U1,V1", value_parser = parse_region, allow_hyphen_values = true)]
    pub region: Option<Region>,
    /// The lens to write.
    #[arg(
        long,
        value_name = "LENS",
        value_enum,
        help = "The lens to write, for opencv, ros, kalibr and mrcal [default: the best pinhole of the form's]"
    )]
    pub model: Option<LensArg>,
    /// The folder of the images to undistort, PNG: each file's name begins with its camera's
    #[arg(long, value_name = "FOLDER")]
    pub images: Option<PathBuf>,
}

/// A lens.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum LensArg {
    /// k1, k2, p1, p2
    Pinhole4,
    /// And k3
    Pinhole5,
    /// And k4, k5, k6
    Rational8,
    /// And a thin prism
    Prism12,
    /// And a tilted sensor
    Tilted14,
    /// A fisheye by the angle off axis: k1 to k4
    Equidistant,
}

impl LensArg {
    const fn form(self) -> Distortion {
        match self {
            Self::Pinhole4 => Distortion::Four,
            Self::Pinhole5 => Distortion::Five,
            Self::Rational8 => Distortion::Eight,
            Self::Prism12 => Distortion::Twelve,
            Self::Tilted14 => Distortion::Fourteen,
            Self::Equidistant => Distortion::Equidistant,
        }
    }
}

impl FolderForm {
    /// The lenses that the form can hold, and of these the ones tried if nothing is said.
    const fn lenses(self) -> [&'static [Distortion]; 2] {
        use Distortion::{Eight, Equidistant, Five, Four, Fourteen, Twelve};
        match self {
            Self::OpenCv | Self::Ros => [
                &[Four, Five, Eight, Twelve, Fourteen, Equidistant],
                &[Five, Eight],
            ],
            Self::Kalibr => [&[Four, Equidistant], &[Four]],
            Self::Mrcal => [&[Four, Five, Eight], &[Five, Eight]],
            _ => [&[], &[]],
        }
    }
}

impl FolderArgs {
    /// The first option that is given and that the form has no place for; none of them has one in a form of one file.
    pub(super) fn needless(&self, form: Option<FolderForm>, is_mesh: bool) -> Option<&'static str> {
        let has_lens = form.is_some_and(|form| !form.lenses()[0].is_empty());
        let is_fitted = has_lens || form == Some(FolderForm::MrcalSplined);
        let is_view = matches!(
            form,
            Some(FolderForm::Remap | FolderForm::Rectify | FolderForm::Undistort)
        );
        let is_of_images = form == Some(FolderForm::Undistort);
        let options = [
            (
                "--distance-mm",
                self.distance_mm.is_some() && !(is_fitted || is_view || is_mesh),
            ),
            ("--region", self.region.is_some() && !is_fitted),
            ("--model", self.model.is_some() && !has_lens),
            ("--images", self.images.is_some() && !is_of_images),
        ];
        options
            .into_iter()
            .find(|(_, is_needless)| *is_needless)
            .map(|(option, _)| option)
    }

    /// The lenses to try for a form.
    ///
    /// # Errors
    /// [`UsageError::ExportLens`] if it cannot hold the one asked for.
    pub(super) fn lenses(&self, form: FolderForm) -> Result<Vec<Distortion>, UsageError> {
        let [held, usual] = form.lenses();
        match self.model.map(LensArg::form) {
            Some(lens) if held.contains(&lens) => Ok(vec![lens]),
            Some(lens) => Err(UsageError::ExportLens {
                lens: lens.name(),
                held: held.iter().map(|lens| lens.name()).collect(),
            }),
            None => Ok(usual.to_vec()),
        }
    }
}

fn parse_region(text: &str) -> Result<Region, String> {
    let numbers: Option<Vec<f64>> = text
        .split(',')
        .map(|part| part.trim().parse().ok())
        .collect();
    let corners = numbers.and_then(|numbers| <[f64; 4]>::try_from(numbers).ok());
    corners.and_then(Region::new).ok_or_else(|| {
        "give the upper left and the lower right corner, px, such as 100,100,1180,924".to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_region_is_four_numbers_that_rise() {
        assert!(parse_region("-0.5, 0,639.5,479.5").is_ok());
        for bad in [
            "",
            "1,2,3",
            "1,2,3,4,5",
            "5,0,5,9",
            "0,9,5,9",
            "a,b,c,d",
            "NaN,0,1,1",
        ] {
            assert!(parse_region(bad).is_err(), "{bad}");
        }
    }
}
