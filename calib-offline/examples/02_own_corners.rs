//! Own corners: views from any detector, in memory, without a file.
//!
//! ```sh
//! cargo run --release -p calib-offline --example 02_own_corners
//! ```

use calib_estimate::adjust::Observations;
use calib_estimate::init::rig::start_rig;
use calib_estimate::joint::estimate_screened;
use calib_rays::geometry::PixelPoint;
use calib_rays::observed::{Corner, View};
use calib_simulate::{OpticsKind, Scene, SceneSettings};
use std::error::Error;

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    // In place of a detector: a simulated stage seen by two cameras, 0.05 px of noise.
    let scene = Scene::new(SceneSettings::standard_noisy(OpticsKind::Brown, 1))?;
    let board = scene.settings.board.clone();
    let sensors = vec![scene.cameras[0].sensor(), scene.cameras[1].sensor()];
    let views: Vec<View> = scene.observe_corners().iter().map(your_view).collect();

    // Where to start, and views that cannot be what they claim; then everything together.
    let observations = Observations::new(board, sensors, &views);
    let start = start_rig(&observations)?;
    let (estimate, findings) = estimate_screened(&observations, start)?;
    let rig = estimate.rig(&["left".to_owned(), "right".to_owned()]);
    println!("{} views found wanting", findings.len());

    // The first corner that both cameras see in one pose, mm; the rig's frame is that of the board at the datum pose.
    let seen_twice = views
        .iter()
        .filter(|view| view.camera_idx == 0)
        .find_map(|left| {
            let right = views
                .iter()
                .find(|view| view.camera_idx == 1 && view.pose == left.pose)?;
            left.corners.iter().find_map(|a| {
                let is_same = |b: &&Corner| (b.row, b.col) == (a.row, a.col);
                let b = right.corners.iter().find(is_same)?;
                Some((left.pose, *a, *b))
            })
        });
    let (pose, left, right) = seen_twice.ok_or("no corner is seen by both cameras")?;
    let found = rig.triangulate(&[(0, left.pixel), (1, right.pixel)])?;
    println!(
        "row {}, column {} of pose {pose}: {:.3?} mm, the rays {:.4} mm apart",
        left.row, left.col, found.point_mm, found.gap_mm
    );
    Ok(())
}

/// Camera and pose count from 0, rows and columns along the board's inner corners; pixel (0, 0) is the center of
/// the top-left one.
fn your_view(seen: &View) -> View {
    let corners = seen.corners.iter().map(|corner| Corner {
        row: corner.row,
        col: corner.col,
        pixel: PixelPoint::new(corner.pixel.u, corner.pixel.v),
        // The detector's own standard deviation, px, where it has one.
        sigma_px: None,
    });
    View {
        camera_idx: seen.camera_idx,
        pose: seen.pose,
        corners: corners.collect(),
    }
}
