//! All checks that need no fit, put into one list.

use super::duplicates::{Duplicates, duplicates};
use super::finding::{Explained, cause, pose_list};
use super::handedness::Hands;
use super::image_size::image_size;
use super::look::Look;
use super::placed::Placed;
use super::reading::Reading;
use super::single_views::{Explanation, explain};
use super::stage_angles::{Dial, dial};
use super::whole_camera::{WholeCamera, is_possible, read_camera};
use super::{corner_noise, coverage, geometry, mirrored, numbering, sides, units};
use crate::cause::{Cause, Code, sort};
use crate::verdict::Grade;
use calib_rays::geometry::RigidTransform;
use calib_rays::observed::{View, poses};
use calib_rays::remedy::Remedy;
use calib_recording::dataset::{Dataset, SufficiencyError, check_sufficiency, stage};
use nalgebra::Vector3;
use std::collections::BTreeMap;

/// What can be seen of a recording before a fit.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Sheet {
    /// What was found, most likely first; empty when nothing was.
    pub causes: Vec<Cause>,
    /// Views that are meant otherwise than they are written.
    pub explained: Vec<Explained>,
    /// How the stage's dial counts, where there is one and the boards turned.
    pub dial: Option<Dial>,
}

impl Sheet {
    /// Looks at the views of a dataset, those of excluded poses not among them.
    pub fn of(dataset: &Dataset, views: &[View]) -> Self {
        let mut sheet = Self::default();
        sheet.causes.extend(too_little(dataset, views));
        if views.is_empty() {
            return sheet;
        }
        // Known places have no other reading of their labels, and a known pose no other place.
        if !dataset.board.layout.is_grid() || !dataset.known_poses.is_empty() {
            let look = Look::unplaced(dataset, views);
            sheet.causes.extend(coverage::coverage(&look));
            return sheet;
        }
        let look = Look::at(dataset, views);
        sheet.causes.extend(numbering::from_one(&look));
        let Duplicates {
            mut causes,
            same_as,
        } = duplicates(&look);
        // Where pixels have no one scale, nothing else is to be seen.
        if let Some(size) = image_size(&look) {
            sheet.causes.extend(causes);
            sheet.causes.push(size);
            sort(&mut sheet.causes);
            return sheet;
        }
        let hands = Hands::of(&look);
        let cameras: Vec<WholeCamera> = (1..dataset.cameras.len())
            .filter_map(|camera_idx| {
                let most_pairs = |reference: &usize| look.pairs(*reference, camera_idx, 0).len();
                let reference = (0..camera_idx).rev().max_by_key(most_pairs)?;
                read_camera(&look, &hands, reference, camera_idx)
            })
            .collect();
        let placed = Placed::of(&look, &cameras);
        let geometry = geometry::geometry(&look, &placed, &same_as);
        let error_mm = geometry.as_ref().map_or(0.0, |found| found.error_mm);
        for whole in &cameras {
            let cause = whole_camera_cause(&look, &hands, whole);
            sheet.causes.extend(cause);
            let explanations = explain(&look, &hands, whole);
            sheet.add_single_views(&look, explanations, error_mm);
        }
        let everywhere = mirrored::everywhere(&look, &hands, &cameras);
        sheet.causes.extend(everywhere);
        let explained: Vec<(usize, usize)> = sheet
            .explained
            .iter()
            .map(|view| (view.pose, view.camera_idx))
            .collect();
        let some = mirrored::some_views(&look, &hands, &explained);
        sheet.causes.extend(some);
        if hands.any_camera() {
            sheet.causes.extend(sides::sides(&look, &cameras));
        }
        sheet.causes.extend(units::units(&look, &cameras));
        // What copies leave to be few follows from them.
        for cause in &mut causes {
            cause.cost_mm = error_mm;
        }
        sheet.causes.extend(causes);
        let error_mm_per_px = geometry.as_ref().map(|found| found.error_mm_per_px);
        let noise = corner_noise::noise_and_outliers(&look, error_mm_per_px);
        sheet.causes.extend(noise);
        if let Some(found) = &geometry {
            sheet.causes.extend(geometry::causes(found));
        }
        sheet.causes.extend(coverage::coverage(&look));
        sheet.turn_dial(&look, views, &placed, &same_as);
        sort(&mut sheet.causes);
        sheet
    }

    /// The causes of the sheet with those that a fit shows, most likely first: what both name, as the sheet has
    /// it, and no late exposure of views that another reading explains. What was written down wrongly goes
    /// first: a fit of such data shows anything.
    pub fn with_suspects(&self, mut suspects: Vec<Cause>) -> Vec<Cause> {
        suspects.retain(|suspect| {
            let is_known = self.causes.iter().any(|cause| cause.code == suspect.code);
            let is_explained = suspect.code == Code::NotSimultaneous && !self.explained.is_empty();
            !is_known && !is_explained
        });
        let is_misread = |cause: &Cause| cause.grade > Grade::Pass && cause.code.is_misread();
        let causes = self.causes.iter().cloned();
        let (mut first, others): (Vec<Cause>, Vec<Cause>) = causes.partition(is_misread);
        suspects.extend(others);
        sort(&mut suspects);
        first.extend(suspects);
        first
    }

    /// Holds the dial against boards that are what they claim.
    fn turn_dial(&mut self, look: &Look<'_>, views: &[View], placed: &Placed, same_as: &[usize]) {
        let all = poses(views);
        let is_meant = |pose: usize| self.explained.iter().all(|view| view.pose != pose);
        let boards: Vec<(usize, RigidTransform)> = placed
            .rig_from_board
            .iter()
            .enumerate()
            .filter(|(idx, _)| same_as[*idx] == *idx && is_meant(look.pose(*idx)))
            .filter_map(|(idx, board)| Some((look.pose(idx), (*board)?)))
            .collect();
        let entry = |pose| stage::entry(look.dataset, &all, pose);
        if let Some((dial, cause)) = dial(&boards, &-Vector3::y(), entry) {
            self.dial = Some(dial);
            self.causes.extend(cause);
        }
    }

    /// One cause for views of a camera that are to be read alike.
    fn add_single_views(&mut self, look: &Look<'_>, found: Vec<Explanation>, error_mm: f64) {
        let mut alike: BTreeMap<(usize, Code, String), Vec<Explanation>> = BTreeMap::new();
        for explanation in found {
            let Explained {
                camera_idx,
                code,
                reading,
                ..
            } = &explanation.explained;
            let kind = (*camera_idx, *code, reading.clone());
            alike.entry(kind).or_default().push(explanation);
        }
        for ((camera_idx, code, reading), found) in alike {
            let poses: Vec<usize> = found.iter().map(|one| one.explained.pose).collect();
            let [before, after] = found[found.len() / 2].misfit_px;
            let as_recorded = if before.is_finite() {
                format!("they miss by {before:.2} px")
            } else {
                "not even their own camera".to_owned()
            };
            // Views from the other end are renumbered, and then as good as the others.
            let (grade, text) = match code {
                Code::LabelsTurned => (
                    Grade::Pass,
                    format!("so they fit to {after:.2} px, and so they are used"),
                ),
                _ => (
                    Grade::Doubtful,
                    format!(
                        "so they fit those of the other camera to {after:.2} px, as recorded {as_recorded}; \
                         correct the labels or the order of the images"
                    ),
                ),
            };
            self.causes.push(Cause {
                since_pose: poses.first().copied(),
                ..cause(
                    code,
                    grade,
                    format!("{} of {} poses", poses.len(), look.observations.poses.len()),
                    error_mm,
                    format!(
                        "camera {} in {}: {reading}: {text}",
                        look.name(camera_idx),
                        pose_list(&poses)
                    ),
                )
            });
            self.explained
                .extend(found.into_iter().map(|one| one.explained));
        }
    }
}

/// Too few views for any calibration.
fn too_little(dataset: &Dataset, views: &[View]) -> Option<Cause> {
    let error = check_sufficiency(dataset, views).err()?;
    let (code, size) = match &error {
        SufficiencyError::TooFewPoses { have, .. } | SufficiencyError::Flat { have, .. } => {
            (Code::FewPoses, format!("{have} poses"))
        }
        SufficiencyError::SameView { different, .. } => {
            (Code::Duplicates, format!("{different} different places"))
        }
        _ => return None,
    };
    let remedy = error.remedy().unwrap_or_default();
    let text = format!("{error}; {remedy}");
    Some(cause(code, Grade::Fail, size, 0.0, text))
}

/// A camera all of whose views are meant otherwise.
fn whole_camera_cause(look: &Look<'_>, hands: &Hands, whole: &WholeCamera) -> Option<Cause> {
    let [reference, camera] = [whole.reference, whole.camera_idx].map(|idx| look.name(idx));
    let fits = format!(
        "so they fit to {:.2} px, as recorded they miss by {:.2} px in the middle pose",
        whole.agreed.typical_px, whole.as_recorded_px
    );
    let cost_mm = look
        .mm_per_px(whole.camera_idx)
        .map_or(0.0, |mm_per_px| mm_per_px * whole.as_recorded_px);
    if whole.steps != 0 {
        return Some(cause(
            Code::PoseNumbering,
            Grade::Fail,
            format!("{:+} poses", whole.steps),
            cost_mm,
            format!(
                "pose k of camera {camera} seems to be pose k {:+} of camera {reference}: {fits}; number the \
                 poses alike in both cameras, an image may be missing in one of them",
                whole.steps
            ),
        ));
    }
    if whole.reading == Reading::AsRecorded {
        return None;
    }
    // The same fits if the other camera's views are read the other way round.
    let own = is_possible(look, whole.camera_idx, whole.reading);
    let blame_reference = if whole.reading.mirrors() {
        !hands.camera(whole.reference)
    } else {
        !own && is_possible(look, whole.reference, whole.reading.inverse())
    };
    let (camera, other, reading) = if blame_reference {
        (reference, camera, whole.reading.inverse())
    } else {
        (camera, reference, whole.reading)
    };
    Some(cause(
        reading.code(),
        Grade::Fail,
        "all views".to_owned(),
        cost_mm,
        format!(
            "the views of camera {camera} belong to those of camera {other} {reading}: {fits}; correct \
             corners.csv, or use images as they came from the sensor"
        ),
    ))
}
