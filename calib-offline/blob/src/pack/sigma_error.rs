//! How far the standard deviations that a blob predicts are from those of the calibration.

use calib_rays::field::{CalibratedCamera, Rig};
use calib_rays::geometry::PixelPoint;
use nalgebra::Matrix3;
use ray_runtime::RayBlob;

/// Points along each axis of the sensor that predictions are compared at.
const COMPARED_ALONG_AXIS: u32 = 24;

/// What the uncertainty of a pair costs in the blob, and what its coarse grid does to it.
#[derive(Debug, Clone, PartialEq)]
pub struct PackedPair {
    /// Names of the cameras.
    pub cameras: [String; 2],
    /// Nodes along u and v of the first camera.
    pub nodes: [u16; 2],
    /// Bytes of the section.
    pub bytes: usize,
    /// Of the predicted standard deviation of a point.
    pub sigma_error: Deviation,
    /// Of the part of it that the calibration leaves open: what remains where the noise of many
    /// measurements averages out.
    pub calibration_sigma_error: Deviation,
}

/// Deviations of predicted standard deviations from those of the calibration, relative, over the
/// axes of points at the working distance.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Deviation {
    /// Root mean square, as a share.
    pub rms: f64,
    /// Largest magnitude, as a share.
    pub worst: f64,
}

/// Compares what the blob predicts with what the calibration predicts, for points at the working
/// distance all over the first camera's image.
pub fn compare(rig: &Rig, blob: &RayBlob<'_>, working_distance_mm: f64) -> Vec<PackedPair> {
    blob.uncertain_pairs()
        .filter_map(|header| {
            let [first, second] = header.cameras.map(usize::from);
            let cameras = [rig.cameras.get(first)?, rig.cameras.get(second)?];
            let (mut total, mut calibration) = (Tally::default(), Tally::default());
            for pixel in lattice(cameras[0]) {
                let found = compared(rig, blob, [first, second], pixel, working_distance_mm);
                if let Some([ours, theirs]) = found {
                    total.add(&(ours.0 + ours.1), &(theirs.0 + theirs.1));
                    calibration.add(&ours.0, &theirs.0);
                }
            }
            Some(PackedPair {
                cameras: cameras.map(|camera| camera.name.clone()),
                nodes: header.nodes,
                bytes: ray_runtime::format::aligned(header.section_len()),
                sigma_error: total.deviation(),
                calibration_sigma_error: calibration.deviation(),
            })
        })
        .collect()
}

fn lattice(camera: &CalibratedCamera) -> impl Iterator<Item = PixelPoint> {
    let sensor = camera.field.sensor;
    let at = |k: u32, extent: u32| {
        (f64::from(k) + 0.5) / f64::from(COMPARED_ALONG_AXIS) * f64::from(extent) - 0.5
    };
    (0..COMPARED_ALONG_AXIS * COMPARED_ALONG_AXIS).map(move |k| {
        PixelPoint::new(
            at(k % COMPARED_ALONG_AXIS, sensor.width),
            at(k / COMPARED_ALONG_AXIS, sensor.height),
        )
    })
}

/// Calibration and noise part of one point, mm^2.
type Parts = (Matrix3<f64>, Matrix3<f64>);

/// What the calibration and the blob predict of one point.
fn compared(
    rig: &Rig,
    blob: &RayBlob<'_>,
    [first, second]: [usize; 2],
    pixel: PixelPoint,
    distance_mm: f64,
) -> Option<[Parts; 2]> {
    let (_, other) = rig.cameras[first].seen_by(&rig.cameras[second], pixel, distance_mm)?;
    let ours = rig.pair_covariance([(first, pixel), (second, other)])?;
    let on_device = |p: PixelPoint| ray_runtime::PixelPoint::new(p.u as f32, p.v as f32);
    let theirs = blob
        .triangulate_with_covariance((first, on_device(pixel)), (second, on_device(other)))
        .ok()?
        .covariance?;
    Some([
        (ours.calibration_mm2, ours.noise_mm2),
        (
            symmetric(&theirs.calibration_mm2),
            symmetric(&theirs.noise_mm2),
        ),
    ])
}

/// Rows and columns are the same.
fn symmetric(rows: &[[f32; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from(*rows).map(f64::from)
}

#[derive(Debug, Default)]
struct Tally {
    sum_of_squares: f64,
    worst: f64,
    count: usize,
}

impl Tally {
    /// Adds the standard deviations along the three axes.
    fn add(&mut self, exact_mm2: &Matrix3<f64>, packed_mm2: &Matrix3<f64>) {
        for k in 0..3 {
            let deviation = (packed_mm2[(k, k)] / exact_mm2[(k, k)]).sqrt() - 1.0;
            if deviation.is_finite() {
                self.sum_of_squares += deviation * deviation;
                self.worst = self.worst.max(deviation.abs());
                self.count += 1;
            }
        }
    }

    fn deviation(&self) -> Deviation {
        Deviation {
            rms: (self.sum_of_squares / self.count.max(1) as f64).sqrt(),
            worst: self.worst,
        }
    }
}
