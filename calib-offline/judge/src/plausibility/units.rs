//! Whether `square_mm` can be millimeters: what the rig would then be, in human words.

use super::finding::{cause, digits, length};
use super::look::Look;
use super::measured::extent_mm;
use super::whole_camera::WholeCamera;
use crate::cause::{Cause, Code};
use crate::verdict::Grade;
use calib_rays::field::Rig;
use calib_rays::numerics::median;
use calib_recording::dataset::Dataset;

/// Two lenses of ordinary cameras stand no nearer than their housings allow, mm: board cameras are 25 to
/// 40 mm wide, the smallest modules some 20.
const LEAST_BASELINE_MM: f64 = 20.0;
/// A lens that is no microscope does not focus nearer than this before its front glass, mm.
const LEAST_DISTANCE_MM: f64 = 15.0;
/// A pixel that sees less of the board than this, mm, is a microscope's: it is near the wavelength of light.
const LEAST_FOOTPRINT_MM: f64 = 0.002;
/// No board is set up farther away than this, mm, or is wider than that.
const MOST_DISTANCE_MM: f64 = 300_000.0;
const MOST_WIDTH_MM: f64 = 20_000.0;
/// Units that are written down by mistake, and how many mm each has.
const UNITS: [(&str, f64); 3] = [("centimeters", 10.0), ("inches", 25.4), ("meters", 1000.0)];

/// What the rig would be if squares are as long as the manifest says.
#[allow(clippy::struct_field_names, reason = "the unit is part of the name")]
struct Size {
    width_mm: f64,
    distance_mm: f64,
    baseline_mm: Option<f64>,
    footprint_mm: f64,
}

impl Size {
    fn scaled(&self, factor: f64) -> Self {
        Self {
            width_mm: factor * self.width_mm,
            distance_mm: factor * self.distance_mm,
            baseline_mm: self.baseline_mm.map(|mm| factor * mm),
            footprint_mm: factor * self.footprint_mm,
        }
    }

    /// What speaks against it.
    fn objection(&self) -> Option<String> {
        let near = self.baseline_mm.filter(|mm| *mm < LEAST_BASELINE_MM);
        if let Some(mm) = near {
            return Some(format!(
                "two cameras with lenses cannot stand {} apart (their housings are {LEAST_BASELINE_MM} mm and more)",
                length(mm)
            ));
        }
        if self.distance_mm < LEAST_DISTANCE_MM {
            return Some(format!(
                "hardly a lens sees a board {} before it",
                length(self.distance_mm)
            ));
        }
        if self.footprint_mm < LEAST_FOOTPRINT_MM {
            return Some(format!(
                "a pixel would see {} of the board, as in a microscope",
                length(self.footprint_mm)
            ));
        }
        if self.distance_mm > MOST_DISTANCE_MM {
            return Some(format!(
                "the board would be {} away",
                length(self.distance_mm)
            ));
        }
        (self.width_mm > MOST_WIDTH_MM)
            .then(|| format!("the board would be {} wide", length(self.width_mm)))
    }

    fn words(&self) -> String {
        let baseline = self.baseline_mm.map_or(String::new(), |mm| {
            format!(", the cameras {} apart", length(mm))
        });
        format!(
            "a board {} wide, {} away{baseline}",
            length(self.width_mm),
            length(self.distance_mm)
        )
    }
}

/// The same of points with known places, by the rig that was calibrated with them: `distance_mm` from the cameras,
/// `footprint_mm` a pixel there.
pub fn units_of_places(
    dataset: &Dataset,
    rig: &Rig,
    distance_mm: f64,
    footprint_mm: f64,
) -> Option<Cause> {
    if dataset.certificate.is_some() || dataset.board.layout.is_grid() {
        return None;
    }
    let (width, height) = dataset.board.extent_mm();
    let place = |k: usize| rig.cameras[k].rig_from_camera.translation_mm;
    let pairs = (0..rig.cameras.len()).flat_map(|b| (0..b).map(move |a| (a, b)));
    let size = Size {
        width_mm: width.max(height),
        distance_mm,
        baseline_mm: pairs
            .map(|(a, b)| (place(a) - place(b)).norm())
            .min_by(f64::total_cmp),
        footprint_mm,
    };
    let objection = size.objection()?;
    // Whoever writes another unit for mm writes meters or inches as a rule; centimeters are the mildest.
    let (unit, factor) = UNITS
        .iter()
        .rev()
        .find(|(_, factor)| size.scaled(*factor).objection().is_none())?;
    let text = format!(
        "the places in corners.csv mean {}, and {objection}; in {unit} it is {}; write them in millimeters",
        size.words(),
        size.scaled(*factor).words()
    );
    Some(cause(
        Code::SquareUnit,
        Grade::Doubtful,
        format!("{unit} for mm, {factor} times"),
        (factor - 1.0) * size.width_mm,
        text,
    ))
}

/// Doubts a unit in which the rig is implausible on its face; a board with a certificate is believed.
pub fn units(look: &Look<'_>, cameras: &[WholeCamera]) -> Option<Cause> {
    if look.dataset.certificate.is_some() {
        return None;
    }
    let board = &look.dataset.board;
    let (width, height) = board.extent_mm();
    let middle = board.center_in_board();
    let seen = look.observations.views.iter().zip(&look.fits);
    let seen = seen.filter_map(|(view, fit)| Some((view.camera_idx, fit.as_ref()?)));
    let distances = seen
        .clone()
        .map(|(_, fit)| fit.camera_from_board.point(&middle).norm());
    let distance_mm = median(distances)?;
    let size = Size {
        width_mm: width.max(height) + board.square_mm,
        distance_mm,
        baseline_mm: cameras
            .iter()
            .map(|whole| whole.agreed.second_from_first.translation_mm.norm())
            .min_by(f64::total_cmp),
        footprint_mm: (0..look.cameras.len())
            .filter_map(|idx| look.mm_per_px(idx))
            .min_by(f64::total_cmp)?,
    };
    let objection = size.objection()?;
    // Squares are made in whole or half millimeters.
    let roundness = |factor: f64| {
        let halves = 2.0 * factor * board.square_mm;
        (halves - halves.round()).abs() / halves
    };
    let most_likely = UNITS
        .iter()
        .filter(|(_, factor)| size.scaled(*factor).objection().is_none())
        .min_by(|a, b| roundness(a.1).total_cmp(&roundness(b.1)));
    let cost_mm = most_likely.and_then(|(_, factor)| {
        let extent_mm = extent_mm(look, 0)?;
        Some((factor - 1.0) * extent_mm)
    });
    let text = format!(
        "square_mm = {} means {}, and {objection}{}; check square_mm, which is in millimeters (a board \
         that is known to be so small: [board.certificate] says so)",
        board.square_mm,
        size.words(),
        most_likely.map_or(String::new(), |(unit, factor)| {
            format!("; in {unit} it is {}", size.scaled(*factor).words())
        })
    );
    let size = most_likely.map_or_else(
        || format!("{} mm", digits(board.square_mm)),
        |(unit, factor)| format!("{} {unit} for mm, {factor} times", digits(board.square_mm)),
    );
    Some(cause(
        Code::SquareUnit,
        Grade::Doubtful,
        size,
        cost_mm.unwrap_or(0.0),
        text,
    ))
}
