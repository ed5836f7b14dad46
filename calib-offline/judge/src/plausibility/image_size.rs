//! Whether the pixels of some poses were counted on a smaller image: half the size, or binned. From one
//! pose on (or up to it) all corners then lie in the upper left part of the sensor, and no lens explains
//! both kinds; scaled up, one does.

use super::finding::cause;
use super::look::{Look, sigma_px};
use crate::cause::{Cause, Code};
use crate::verdict::Grade;
use calib_estimate::adjust::Observations;
use calib_estimate::init::board_pose::fit_view;
use calib_estimate::init::focal_scan::start_camera;
use calib_rays::board::BoardShape;

/// Scales that resizing and binning give.
const SCALES: [f64; 5] = [0.25, 1.0 / 3.0, 0.5, 2.0 / 3.0, 0.75];
/// Fewer views of a kind show nothing.
const LEAST: usize = 2;
/// So many views that fit into the small image by chance are looked behind.
const CHANCE: usize = 8;
/// Scaled up, corners must fit the lens better by this factor.
const CLEAR: f64 = 3.0;

/// The poses of one camera whose pixels are counted on a smaller image.
struct Small {
    /// Names of the cameras.
    cameras: Vec<String>,
    scale: f64,
    /// First pose from which all are small (or to which, then large).
    since_pose: usize,
    /// Whether the later ones are the small ones.
    is_later: bool,
}

/// Looks for it in every camera.
pub fn image_size(look: &Look<'_>) -> Option<Cause> {
    let mut found: Option<Small> = None;
    for camera_idx in 0..look.dataset.cameras.len() {
        if let Some(mut small) = of_camera(look, camera_idx) {
            match &mut found {
                Some(before) => before.cameras.append(&mut small.cameras),
                None => found = Some(small),
            }
        }
    }
    let mut small = found?;
    // The other cameras changed with it if their pixels since then fit into the small image too.
    small.cameras = (0..look.dataset.cameras.len())
        .filter(|idx| {
            let is_found = small.cameras.iter().any(|name| name == look.name(*idx));
            is_found || changed_too(look, *idx, &small)
        })
        .map(|idx| look.name(idx).to_owned())
        .collect();
    let words = |is_small: bool| if is_small { "smaller" } else { "larger" };
    Some(Cause {
        since_pose: Some(small.since_pose),
        ..cause(
            Code::ImageSize,
            Grade::Fail,
            format!(
                "{:.3} times",
                if small.is_later {
                    small.scale
                } else {
                    1.0 / small.scale
                }
            ),
            0.0,
            format!(
                "from pose {} on the pixels of camera {} are counted on a {} image than before ({:.3} times): \
                 with those of the small one scaled up they fit one lens, as recorded they fit none; record \
                 all poses at one image size, or scale the corners",
                small.since_pose,
                small.cameras.join(" and "),
                words(small.is_later),
                if small.is_later {
                    small.scale
                } else {
                    1.0 / small.scale
                },
            ),
        )
    })
}

fn changed_too(look: &Look<'_>, camera_idx: usize, small: &Small) -> bool {
    let sensor = look.dataset.cameras[camera_idx].sensor;
    let (width, height) = (
        small.scale * f64::from(sensor.width),
        small.scale * f64::from(sensor.height),
    );
    let own = look.observations.views.iter();
    let mut own = own.filter(|view| {
        let is_later = look.pose(view.pose_idx) >= small.since_pose;
        view.camera_idx == camera_idx && is_later == small.is_later
    });
    own.all(|view| {
        let mut corners = view.corners.iter();
        corners.all(|c| c.pixel.u < width && c.pixel.v < height)
    })
}

fn of_camera(look: &Look<'_>, camera_idx: usize) -> Option<Small> {
    let own = look.observations.of_camera(camera_idx);
    let sensor = own.sensors[0];
    let as_recorded = look.cameras[camera_idx]
        .as_ref()
        .map(|camera| camera.sigma_px);
    for scale in SCALES {
        let (width, height) = (
            scale * f64::from(sensor.width),
            scale * f64::from(sensor.height),
        );
        let fits: Vec<bool> = own
            .views
            .iter()
            .map(|view| {
                view.corners
                    .iter()
                    .all(|c| c.pixel.u < width && c.pixel.v < height)
            })
            .collect();
        let count = fits.len();
        let small_before = fits.iter().take_while(|fits| **fits).count();
        let small_after = fits.iter().rev().take_while(|fits| **fits).count();
        for (is_later, small) in [(true, small_after), (false, small_before)] {
            // What fits into the small image by chance may be large: both kinds must be there.
            if small < LEAST || count - small < LEAST {
                continue;
            }
            // Views next to the change may be large ones that fit into the small image by chance.
            let begun = (0..=CHANCE).find_map(|chance| {
                let small = small.checked_sub(chance).filter(|small| *small >= LEAST)?;
                let change = if is_later { count - small } else { small };
                let scaled = rescaled(&own, scale, |k| (k >= change) == is_later);
                let start = start_camera(&scaled, camera_idx).ok()?;
                let sigma = sigma_px(start.median_px);
                as_recorded
                    .is_none_or(|before| CLEAR * sigma < before)
                    .then_some(start)
            });
            let Some(start) = begun else { continue };
            let is_small = |k: usize, change: usize| (k >= change) == is_later;
            // Which views are small, the lens tells.
            let all = rescaled(&own, scale, |_| true);
            let misfits = |views: &Observations| -> Vec<f64> {
                let misfit = |view| {
                    fit_view(&start.field, &own.board, &BoardShape::default(), view)
                        .map_or(f64::INFINITY, |fit| fit.median_px)
                };
                views.views.iter().map(misfit).collect()
            };
            let (large, small) = (misfits(&own), misfits(&all));
            let misread = |change: &usize| {
                let wrong = |k: &usize| is_small(*k, *change) != (small[*k] < large[*k]);
                (0..count).filter(wrong).count()
            };
            let change = (1..count).min_by_key(misread)?;
            let pose_idx = own.views[change].pose_idx;
            return Some(Small {
                cameras: vec![look.name(camera_idx).to_owned()],
                scale,
                since_pose: own.poses[pose_idx],
                is_later,
            });
        }
    }
    None
}

/// The observations with the pixels of some views counted on an image of full size.
fn rescaled(own: &Observations, scale: f64, is_small: impl Fn(usize) -> bool) -> Observations {
    let mut scaled = own.clone();
    for (k, view) in scaled.views.iter_mut().enumerate() {
        for corner in view.corners.iter_mut().filter(|_| is_small(k)) {
            corner.pixel.u = (corner.pixel.u + 0.5) / scale - 0.5;
            corner.pixel.v = (corner.pixel.v + 0.5) / scale - 0.5;
        }
    }
    scaled
}
