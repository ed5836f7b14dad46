//! Labels or pixels that are mirrored: in every view of every camera, of one camera, or in some views.
//!
//! All of them together agree with each other in every way; then nothing tells which it is, but what is
//! usual: labels that count to the right and, on screen, down. So the slip is that which leaves the
//! labels of most views so.

use super::finding::{cause, pose_list};
use super::handedness::Hands;
use super::look::Look;
use super::measured::error_mm;
use super::reading::Reading;
use super::whole_camera::WholeCamera;
use crate::cause::Cause;
use crate::verdict::Grade;
use calib_rays::geometry::PixelPoint;
use nalgebra::Vector2;

/// Labels of all cameras are mirrored.
pub fn everywhere(look: &Look<'_>, hands: &Hands, cameras: &[WholeCamera]) -> Option<Cause> {
    if hands.any_camera() {
        return None;
    }
    let likely = most_usual(look, cameras);
    let cost_mm = cameras.first().and_then(|whole| {
        error_mm(look, whole, |(camera, pixel)| {
            let idx = [whole.reference, whole.camera_idx][camera];
            let sensor = look.dataset.cameras[idx].sensor;
            let (width, height) = (f64::from(sensor.width), f64::from(sensor.height));
            let meant = match likely {
                Reading::UvExchanged => PixelPoint::new(pixel.v, pixel.u),
                Reading::UMirrored => PixelPoint::new(width - 1.0 - pixel.u, pixel.v),
                Reading::VUpwards => PixelPoint::new(pixel.u, height - 1.0 - pixel.v),
                _ => pixel,
            };
            (camera, meant)
        })
    });
    let words = [
        (Reading::VUpwards, "v is counted upwards"),
        (Reading::UvExchanged, "u and v are exchanged"),
        (
            Reading::ColumnsMirrored,
            "columns or rows are numbered from the other side",
        ),
        (Reading::UMirrored, "the images are mirrored"),
    ];
    let first = words.iter().find(|(reading, _)| *reading == likely);
    let others: Vec<&str> = words
        .iter()
        .filter(|(reading, _)| *reading != likely)
        .map(|(_, text)| *text)
        .collect();
    let text = format!(
        "every view numbers the board as a mirror would show it: most likely {}, or else {}; the corners \
         alone cannot tell. v counts downwards from the top left pixel; seen on its printed face a board's \
         columns count to the right and its rows down; a camera that looks into a mirror has optics = \
         \"mirror\" in its [[camera]]",
        first.map_or("labels are mirrored", |(_, text)| text),
        others.join(", or "),
    );
    Some(cause(
        likely.code(),
        Grade::Doubtful,
        "all views".to_owned(),
        cost_mm.unwrap_or(0.0),
        text,
    ))
}

/// The slip that, taken back, leaves columns to the right and rows down in most views.
fn most_usual(look: &Look<'_>, cameras: &[WholeCamera]) -> Reading {
    let mut along = [Vector2::zeros(); 2];
    for view in &look.observations.views {
        let count = view.corners.len() as f64;
        let mean = |of: fn(&calib_estimate::adjust::observations::ObservedCorner) -> f64| {
            view.corners.iter().map(of).sum::<f64>() / count
        };
        let (row, col) = (mean(|c| c.row as f64), mean(|c| c.col as f64));
        let (u, v) = (mean(|c| c.pixel.u), mean(|c| c.pixel.v));
        let mut of_view = [Vector2::zeros(); 2];
        for c in &view.corners {
            let offset = Vector2::new(c.pixel.u - u, c.pixel.v - v);
            of_view[0] += offset * (c.col as f64 - col);
            of_view[1] += offset * (c.row as f64 - row);
        }
        for (sum, own) in along.iter_mut().zip(of_view) {
            *sum += own.try_normalize(0.0).unwrap_or_default();
        }
    }
    let [cols, rows] = along;
    let upright = [
        (Reading::VUpwards, cols.x - rows.y),
        (Reading::UvExchanged, cols.y + rows.x),
        (Reading::ColumnsMirrored, rows.y - cols.x),
    ];
    let best = upright.iter().max_by(|a, b| a.1.total_cmp(&b.1));
    let likely = best.map_or(Reading::ColumnsMirrored, |(reading, _)| *reading);
    // Cameras that ought to stand side by side and stand above each other: a sign of exchanged axes;
    // the one named left on the right: a sign of mirrored images.
    match likely {
        Reading::ColumnsMirrored if super::sides::sides(look, cameras).is_some() => {
            Reading::UMirrored
        }
        other => other,
    }
}

/// Some views of a camera are mirrored against most of it, and no pair says which way.
pub fn some_views(look: &Look<'_>, hands: &Hands, explained: &[(usize, usize)]) -> Vec<Cause> {
    (0..look.dataset.cameras.len())
        .filter_map(|camera_idx| {
            let views = &look.observations.views;
            let poses: Vec<usize> = hands
                .odd_views(look)
                .map(|k| &views[k])
                .filter(|view| view.camera_idx == camera_idx)
                .map(|view| look.pose(view.pose_idx))
                .filter(|pose| !explained.contains(&(*pose, camera_idx)))
                .collect();
            let first = *poses.first()?;
            Some(Cause {
                since_pose: Some(first),
                ..cause(
                    Reading::ColumnsMirrored.code(),
                    Grade::Doubtful,
                    format!("{} views", poses.len()),
                    0.0,
                    format!(
                        "camera {} sees the board mirrored in {}: rows and columns turn the other way than in \
                         its other views; number rows and columns alike, and use images as they came from \
                         the sensor",
                        look.name(camera_idx),
                        pose_list(&poses)
                    ),
                )
            })
        })
        .collect()
}
