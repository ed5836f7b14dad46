//! Where to look in another camera for the pixels of a row: a table for a matcher.

use crate::{EpipolarCurve, LookupError, PixelPoint, RayBlob, Row};

/// The part of the other camera's image in which a pixel's ray appears between two distances: from `far`
/// to `near`. It is nearly straight, as rays are.
// As C sees it, four numbers.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct EpipolarRun {
    /// Of the furthest point that the other camera sees.
    pub far: PixelPoint,
    /// Of the nearest.
    pub near: PixelPoint,
}

impl EpipolarRun {
    /// What stands for a pixel that is not calibrated, or of whose ray the other camera sees nothing: no
    /// numbers.
    pub const NONE: Self = Self {
        far: PixelPoint::new(f32::NAN, f32::NAN),
        near: PixelPoint::new(f32::NAN, f32::NAN),
    };

    /// Whether it is [`NONE`](Self::NONE).
    pub fn is_none(&self) -> bool {
        self.far.u.is_nan()
    }
}

/// Points of a ray that are looked for if not both of its ends are seen: what is seen is known to so
/// many parts of the whole.
const PARTS: u16 = 64;

impl RayBlob<'_> {
    /// For as many pixels of a row as there is room for, where their rays appear in another camera between
    /// two distances along them, mm: the pixels of [`epipolar_curve`](RayBlob::epipolar_curve)'s ends, to
    /// the same accuracy, or of what of it is seen to a 63rd of it.
    ///
    /// A pixel costs about ten lookups with their derivatives, and several hundred where an end is not
    /// seen: it is a table to be made once.
    ///
    /// # Errors
    /// [`LookupError::NoSuchCamera`]. Distances that are not above zero make all of it
    /// [`EpipolarRun::NONE`].
    pub fn epipolar_row(
        &self,
        camera: usize,
        row: &Row,
        other: usize,
        range_mm: [f32; 2],
        runs: &mut [EpipolarRun],
    ) -> Result<(), LookupError> {
        self.record(camera)?;
        self.record(other)?;
        for (k, run) in runs.iter_mut().enumerate() {
            let sighting = (camera, row.pixel(k));
            let curve = |count| self.epipolar_curve(sighting, other, range_mm, count).ok();
            *run = curve(2)
                .and_then(whole)
                .or_else(|| curve(PARTS).and_then(seen))
                .unwrap_or(EpipolarRun::NONE);
        }
        Ok(())
    }
}

/// Both ends, if both are seen.
fn whole(mut ends: EpipolarCurve<'_>) -> Option<EpipolarRun> {
    let (far, near) = (ends.next()?.pixel, ends.next()?.pixel);
    Some(EpipolarRun { far, near })
}

/// The first and the last point that is seen.
fn seen(mut points: EpipolarCurve<'_>) -> Option<EpipolarRun> {
    let far = points.next()?.pixel;
    let near = points.last().map_or(far, |last| last.pixel);
    Some(EpipolarRun { far, near })
}
