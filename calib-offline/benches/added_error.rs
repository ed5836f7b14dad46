//! What packing adds to the error of points: the same matches measured with a calibration and with a blob
//! made of it, the RMS of their difference over the RMS of the predicted standard deviation.
//!
//! ```sh
//! cargo bench -p calib-offline --bench added_error -- out/calibration.json rig.rays set/holdout.csv
//! ```

use calib_blob::matches::BlobSource;
use calib_blob::matches::read_matches;
use calib_blob::pack::AlignedBytes;
use calib_offline::report::Calibration;
use calib_rays::measure::{PointSource, RigSource};
use ray_runtime::RayBlob;
use std::error::Error;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = std::env::args_os()
        .skip(1)
        .filter(|argument| argument != "--bench");
    let arguments: Vec<PathBuf> = arguments.map(PathBuf::from).collect();
    let [calibration, blob, matches] = &arguments[..] else {
        return Err(
            "give calibration.json, a blob of it, and matches: see the head of this file".into(),
        );
    };
    let read = |path: &PathBuf| {
        std::fs::read(path).map_err(|error| format!("{}: {error}", path.display()))
    };
    let bytes = AlignedBytes::from(read(blob)?.as_slice());
    let blob = RayBlob::open(&bytes)?;
    let packed = BlobSource::new(&blob, None).ok_or("the blob's own frame")?;
    let calibration = Calibration::load(calibration)?;
    let exact = RigSource::new(&calibration.rig, None).ok_or("the rig's own frame")?;

    let (mut difference_squared, mut sigma_squared, mut count) = (0.0, 0.0, 0_usize);
    for sightings in read_matches::<f64>(matches, &exact.cameras())? {
        let as_f32: Vec<_> = sightings
            .iter()
            .map(|(camera, pixel)| (*camera, pixel.map(|px| px as f32)))
            .collect();
        let (Ok(there), Ok(here)) = (packed.point(&as_f32), exact.point(&sightings)) else {
            continue;
        };
        let Some(sigma_mm) = here.sigma_mm else {
            continue;
        };
        count += 1;
        let differences = there.point_mm.iter().zip(here.point_mm);
        difference_squared += differences
            .map(|(there, here)| (f64::from(*there) - here).powi(2))
            .sum::<f64>();
        sigma_squared += sigma_mm.iter().map(|sigma| sigma.powi(2)).sum::<f64>();
    }
    if count == 0 {
        return Err("no match has a point with a predicted standard deviation in both".into());
    }
    let rms = |sum: f64| (sum / count as f64).sqrt();
    println!(
        "{count} points: {:.6} mm added, {:.6} mm predicted (RMS), {:.3} %",
        rms(difference_squared),
        rms(sigma_squared),
        100.0 * (difference_squared / sigma_squared).sqrt()
    );
    Ok(())
}
