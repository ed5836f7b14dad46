//! A quick look at a recording: every camera by itself as an estimate starts it, and where each view
//! then sees its board. What all checks before a fit share.

use calib_estimate::adjust::Observations;
use calib_estimate::adjust::observations::ViewBlock;
use calib_estimate::init::board_pose::{ViewFit, fit_view};
use calib_estimate::init::focal_scan::start_camera;
use calib_rays::board::BoardShape;
use calib_rays::field::RayField;
use calib_rays::geometry::PixelPoint;
use calib_rays::numerics::median;
use calib_rays::observed::View;
use calib_recording::dataset::Dataset;
use rayon::prelude::*;

/// A view that fits its own camera this many times worse than the middle view says nothing about
/// labels or pairs: the factor at which screening leaves views out.
const MISFIT_FACTOR: f64 = 4.0;

/// What a quick look shows.
pub struct Look<'a> {
    /// What the manifest says.
    pub dataset: &'a Dataset,
    /// The views, without the poses that the user leaves out.
    pub observations: Observations,
    /// Per camera; `None` where no lens explains its corners.
    pub cameras: Vec<Option<CameraLook>>,
    /// Per view of the observations; `None` where the camera has no start, the view places no board or
    /// fits its own camera far worse than others.
    pub fits: Vec<Option<ViewFit>>,
}

/// One camera.
pub struct CameraLook {
    /// A cubic field.
    pub field: RayField,
    /// Standard deviation of a corner per axis, px: noise, and what the field lacks.
    pub sigma_px: f64,
}

/// Two views of one pose, as indices into the views of the observations.
#[derive(Debug, Clone, Copy)]
pub struct ViewPair {
    /// Index of the pose.
    pub pose_idx: usize,
    /// By the camera of lower number.
    pub first: usize,
    /// By the other.
    pub second: usize,
}

/// Standard deviation per axis, px, of which the middle length of residual vectors comes: their squared
/// length has the median 2 ln 2 times the variance.
pub fn sigma_px(median_px: f64) -> f64 {
    median_px / (2.0 * 2f64.ln()).sqrt()
}

impl<'a> Look<'a> {
    /// Looks. Cost: about that of an estimate's start.
    pub fn at(dataset: &'a Dataset, views: &[View]) -> Self {
        let sensors = dataset.cameras.iter().map(|camera| camera.sensor).collect();
        let observations = Observations::new(dataset.board.clone(), sensors, views);
        let fields: Vec<Option<RayField>> = (0..dataset.cameras.len())
            .into_par_iter()
            .map(|camera_idx| {
                let own = observations.of_camera(camera_idx);
                Some(start_camera(&own, camera_idx).ok()?.field)
            })
            .collect();
        let shape = BoardShape::default();
        let mut fits: Vec<Option<ViewFit>> = observations
            .views
            .par_iter()
            .map(|view| {
                let field = fields[view.camera_idx].as_ref()?;
                fit_view(field, &dataset.board, &shape, view)
            })
            .collect();
        let cameras = fields
            .into_iter()
            .enumerate()
            .map(|(camera_idx, field)| {
                let of_camera = |view: &ViewBlock| view.camera_idx == camera_idx;
                let own = || observations.views.iter().zip(&fits);
                let sigmas = own()
                    .filter(|(view, _)| of_camera(view))
                    .filter_map(|(_, fit)| Some(fit.as_ref()?.variance_px2().sqrt()));
                let sigma_px = median(sigmas)?;
                Some(CameraLook {
                    field: field?,
                    sigma_px,
                })
            })
            .collect::<Vec<Option<CameraLook>>>();
        for (view, fit) in observations.views.iter().zip(&mut fits) {
            let typical_px = cameras[view.camera_idx].as_ref().map(|c| c.sigma_px);
            fit.take_if(|fit| {
                typical_px.is_none_or(|px| fit.variance_px2().sqrt() > MISFIT_FACTOR * px)
            });
        }
        Self {
            dataset,
            observations,
            cameras,
            fits,
        }
    }

    /// Looks at what was seen alone: no camera gets a start.
    pub fn unplaced(dataset: &'a Dataset, views: &[View]) -> Self {
        let sensors = dataset.cameras.iter().map(|camera| camera.sensor).collect();
        let observations = Observations::new(dataset.board.clone(), sensors, views);
        Self {
            dataset,
            cameras: dataset.cameras.iter().map(|_| None).collect(),
            fits: vec![None; observations.views.len()],
            observations,
        }
    }

    /// What a pixel of a camera sees of a board in the middle of all, mm; `None` without a start.
    pub fn mm_per_px(&self, camera_idx: usize) -> Option<f64> {
        let field = &self.cameras[camera_idx].as_ref()?.field;
        let middle = self.dataset.board.center_in_board();
        let views = self.observations.views.iter().zip(&self.fits);
        let distances = views
            .filter(|(view, _)| view.camera_idx == camera_idx)
            .filter_map(|(_, fit)| Some(fit.as_ref()?.camera_from_board.point(&middle).norm()));
        let distance_mm = median(distances)?;
        let center = field.sensor.center();
        let next = PixelPoint::new(center.u + 1.0, center.v);
        let [a, b] = [center, next].map(|pixel| field.ray(pixel).direction.normalize());
        Some(a.cross(&b).norm() * distance_mm)
    }

    /// Number of a pose.
    pub fn pose(&self, pose_idx: usize) -> usize {
        self.observations.poses[pose_idx]
    }

    /// Name of a camera.
    pub fn name(&self, camera_idx: usize) -> &str {
        &self.dataset.cameras[camera_idx].name
    }

    /// The pairs of views of two cameras that place their boards, the second camera's poses being
    /// counted on by `steps`.
    pub fn pairs(&self, first: usize, second: usize, steps: i64) -> Vec<ViewPair> {
        let placed = |camera_idx: usize| {
            let views = self.observations.views.iter().enumerate();
            views.filter(move |(k, view)| view.camera_idx == camera_idx && self.fits[*k].is_some())
        };
        placed(second)
            .filter_map(|(k, view)| {
                let pose = i64::try_from(self.pose(view.pose_idx)).ok()?;
                let pose = usize::try_from(pose.checked_add(steps)?).ok()?;
                let (other, block) = placed(first).find(|(_, v)| self.pose(v.pose_idx) == pose)?;
                Some(ViewPair {
                    pose_idx: block.pose_idx,
                    first: other,
                    second: k,
                })
            })
            .collect()
    }
}
