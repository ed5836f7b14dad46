//! Poses that are no poses of their own: corners equal to the last bit are copies of one image, and a
//! board that stood still gives the same place with other noise.

use super::finding::{cause, pose_list};
use super::look::Look;
use crate::cause::{Cause, Code};
use crate::verdict::Grade;
use calib_estimate::adjust::observations::ViewBlock;
use std::collections::BTreeMap;

/// Two views of a board that stands still differ by noise alone: the RMS distance of their corners is
/// twice the standard deviation per axis. Beyond twice that the board has moved.
const STANDING: f64 = 4.0;

/// What is found.
pub struct Duplicates {
    /// What to say.
    pub causes: Vec<Cause>,
    /// Per pose index: the first pose index that shows the same.
    pub same_as: Vec<usize>,
}

/// Looks for both kinds.
pub fn duplicates(look: &Look<'_>) -> Duplicates {
    let views = &look.observations.views;
    let count = look.observations.poses.len();
    let mut same_as: Vec<usize> = (0..count).collect();
    // Copies: views of one camera with the same corners, by their bits.
    let mut first_of: BTreeMap<(usize, Vec<[u64; 4]>), usize> = BTreeMap::new();
    let mut copied: BTreeMap<usize, Vec<(usize, usize)>> = BTreeMap::new();
    for view in views {
        match first_of.entry((view.camera_idx, bits(view))) {
            std::collections::btree_map::Entry::Vacant(slot) => {
                slot.insert(view.pose_idx);
            }
            std::collections::btree_map::Entry::Occupied(slot) => {
                let first = *slot.get();
                copied
                    .entry(view.pose_idx)
                    .or_default()
                    .push((view.camera_idx, first));
            }
        }
    }
    let views_of = |pose_idx: usize| views.iter().filter(move |view| view.pose_idx == pose_idx);
    for (pose_idx, copies) in &copied {
        if copies.len() == views_of(*pose_idx).count() {
            same_as[*pose_idx] = same_as[copies[0].1];
        }
    }
    let mut causes = Vec::new();
    if let Some((first, copies)) = copied.iter().next() {
        let poses: Vec<usize> = copied.keys().map(|idx| look.pose(*idx)).collect();
        let (camera_idx, of) = copies[0];
        let whole = same_as
            .iter()
            .enumerate()
            .filter(|(idx, same)| idx != *same);
        let different = count - whole.count();
        causes.push(Cause {
            since_pose: Some(look.pose(*first)),
            ..cause(
                Code::Duplicates,
                Grade::Doubtful,
                format!("{} of {count} poses", poses.len()),
                0.0,
                format!(
                    "{} repeat corners of an earlier pose to the last bit (the first: camera {} saw in pose {} \
                     what it saw in pose {}): the same image twice; {different} different poses are left, and \
                     no check can hold out a board that it knows already; leave the copies out",
                    pose_list(&poses),
                    look.name(camera_idx),
                    look.pose(*first),
                    look.pose(of)
                ),
            )
        });
    }
    let standing = standing(look, &mut same_as);
    if let Some(first) = standing.first() {
        let different = (0..count).filter(|idx| same_as[*idx] == *idx).count();
        causes.push(Cause {
            since_pose: Some(*first),
            ..cause(
                Code::Duplicates,
                Grade::Pass,
                format!("{} of {count} poses", standing.len()),
                0.0,
                format!(
                    "{}: the board stood where it stood in an earlier pose; noise is averaged, but these are \
                     {different} different poses",
                    pose_list(&standing)
                ),
            )
        });
    }
    Duplicates { causes, same_as }
}

/// Labels and pixels of a view by their bits.
fn bits(view: &ViewBlock) -> Vec<[u64; 4]> {
    let corners = view.corners.iter();
    corners
        .map(|c| {
            [
                c.row as u64,
                c.col as u64,
                c.pixel.u.to_bits(),
                c.pixel.v.to_bits(),
            ]
        })
        .collect()
}

/// Poses whose views all differ from those of an earlier pose by noise alone.
fn standing(look: &Look<'_>, same_as: &mut [usize]) -> Vec<usize> {
    let count = same_as.len();
    let mut of_pose: Vec<Vec<&ViewBlock>> = vec![Vec::new(); count];
    for view in &look.observations.views {
        of_pose[view.pose_idx].push(view);
    }
    let mut standing = Vec::new();
    for later in 0..count {
        if same_as[later] != later {
            continue;
        }
        let earlier = (0..later).find(|earlier| {
            same_as[*earlier] == *earlier
                && of_pose[*earlier].len() == of_pose[later].len()
                && of_pose[*earlier]
                    .iter()
                    .zip(&of_pose[later])
                    .all(|(a, b)| same_place(look, a, b))
        });
        if let Some(earlier) = earlier {
            same_as[later] = earlier;
            standing.push(look.pose(later));
        }
    }
    standing
}

fn same_place(look: &Look<'_>, a: &ViewBlock, b: &ViewBlock) -> bool {
    let Some(camera) = &look.cameras[a.camera_idx] else {
        return false;
    };
    if a.camera_idx != b.camera_idx {
        return false;
    }
    let (mut common, mut sum_px2) = (0usize, 0.0);
    for corner in &a.corners {
        let label = (corner.row, corner.col);
        if let Ok(at) = b.corners.binary_search_by_key(&label, |c| (c.row, c.col)) {
            common += 1;
            sum_px2 += corner.pixel.distance_px(b.corners[at].pixel).powi(2);
        }
    }
    2 * common > a.corners.len() && sum_px2 <= (STANDING * camera.sigma_px).powi(2) * common as f64
}
