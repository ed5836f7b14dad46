//! What the screening left out, as causes: harmless now, and a word about how the recording was made.

use super::cause::{Cause, Code};
use super::grade::Grade;
use super::plausibility::Explained;
use calib_estimate::init::screening::{Finding, FindingKind};

/// Pairs that were taken apart because the cameras disagree about the board, and views that no reading
/// fits, where the recording's own sheet (`explained`) knows no other reason. They are left out and move nothing.
pub fn screened(findings: &[Finding], explained: &[Explained]) -> Vec<Cause> {
    let is_open = |finding: &&Finding| explained.iter().all(|view| view.pose != finding.pose);
    let open: Vec<&Finding> = findings.iter().filter(is_open).collect();
    let pairs = open.iter().filter_map(|finding| match &finding.kind {
        FindingKind::Unsynchronized {
            misfit_px,
            typical_px,
            ..
        } => Some((finding.pose, *misfit_px, *typical_px)),
        _ => None,
    });
    let views = open.iter().filter_map(|finding| match &finding.kind {
        FindingKind::Misfit {
            median_px,
            typical_px,
        } => Some((finding.pose, *median_px, *typical_px)),
        _ => None,
    });
    let apart = cause(Code::NotSimultaneous, pairs.collect(), |poses, apart| {
        format!(
            "the cameras did not see the board in the same place in {poses} ({apart}): most likely they did not \
             expose at the same instant; left out as pairs; hold the board still, or trigger the cameras together"
        )
    });
    let misfits = cause(Code::Outliers, views.collect(), |poses, apart| {
        format!(
            "whole views in {poses} miss ({apart}): the board moved, is bent or is another one; left out; look at \
             their images"
        )
    });
    apart.into_iter().chain(misfits).collect()
}

/// The cause of (pose, misfit, misfit of others, px); `None` if there are none.
fn cause(
    code: Code,
    mut found: Vec<(usize, f64, f64)>,
    text: impl Fn(&str, &str) -> String,
) -> Option<Cause> {
    found.sort_by_key(|(pose, ..)| *pose);
    let (first, _, typical_px) = *found.first()?;
    let worst_px = found.iter().map(|(_, px, _)| *px).fold(0.0, f64::max);
    let mut poses: Vec<String> = found.iter().map(|(pose, ..)| pose.to_string()).collect();
    poses.dedup();
    let poses = match poses.as_slice() {
        [one] => format!("pose {one}"),
        all => format!("poses {}", all.join(", ")),
    };
    let apart = format!("{worst_px:.2} px, others {typical_px:.2} px");
    Some(Cause {
        code,
        since_pose: Some(first),
        text: text(&poses, &apart),
        size: format!("{poses}: {apart}"),
        cost_mm: 0.0,
        grade: Grade::Pass,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn finding(pose: usize, kind: FindingKind) -> Finding {
        Finding {
            pose,
            camera_idx: 1,
            corner_count: 54,
            kind,
        }
    }

    fn apart(pose: usize, misfit_px: f64) -> Finding {
        let kind = FindingKind::Unsynchronized {
            other_camera_idx: 0,
            misfit_px,
            typical_px: 0.02,
        };
        finding(pose, kind)
    }

    #[test]
    fn pairs_and_views_left_out_are_named_with_their_poses() {
        let miss = FindingKind::Misfit {
            median_px: 4.0,
            typical_px: 0.1,
        };
        let causes = screened(&[apart(9, 0.3), finding(2, miss), apart(7, 0.18)], &[]);
        let told: Vec<_> = causes.iter().map(|c| (c.code, c.since_pose)).collect();
        let expected = [(Code::NotSimultaneous, Some(7)), (Code::Outliers, Some(2))];
        assert_eq!(told, expected);
        assert_eq!(causes[0].size, "poses 7, 9: 0.30 px, others 0.02 px");
        assert!(causes.iter().all(|cause| cause.grade == Grade::Pass));
    }

    #[test]
    fn what_the_sheet_explains_is_not_said_twice() {
        let explained = [Explained {
            pose: 7,
            camera_idx: 1,
            code: Code::LabelsTurned,
            reading: "turned".to_owned(),
        }];
        assert_eq!(screened(&[apart(7, 0.3)], &explained), []);
        assert_eq!(screened(&[], &[]), []);
    }
}
