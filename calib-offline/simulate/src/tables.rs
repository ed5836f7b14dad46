//! The text files of a simulated dataset: manifest, tables and truth.

use super::matches::TrueMatch;
use super::pattern::{
    DIRECTION_MARKERS, DIRECTION_RADII_MM, RING_COLS, RING_PITCH_MM, RING_RADII_MM, RING_ROWS,
};
use super::scene::Scene;
use super::settings::OutputSettings;
use super::target::SeenMarker;
use calib_rays::board::BoardSpec;
use calib_rays::geometry::{PixelPoint, RigidTransform, SensorSize};
use calib_rays::observed::View;
use serde_json::json;
use std::fmt::Write as _;

/// Name and version of `truth.json`.
pub const TRUTH_SCHEMA: &str = "calib-offline/truth/1";
/// Rays of the lattice in `truth.json` along u and along v.
const TRUTH_LATTICE: (u32, u32) = (17, 13);

/// `corners.csv`.
pub(super) fn corner_table(names: &[&str], views: &[View]) -> String {
    let mut text = String::from("camera,pose,row,col,u,v\n");
    for view in views {
        for corner in &view.corners {
            let _ = writeln!(
                text,
                "{},{},{},{},{},{}",
                names[view.camera_idx],
                view.pose,
                corner.row,
                corner.col,
                corner.pixel.u,
                corner.pixel.v
            );
        }
    }
    text
}

/// The columns of `target/truth.csv`.
pub(super) fn marker_table(scene: &Scene, markers: &[SeenMarker]) -> String {
    let datum_from_left = scene.datum_from_left();
    let mut text = String::from("id,pose,row,col,direction,x,y,z,x_left,y_left,z_left\n");
    for marker in markers {
        let datum = datum_from_left.point(&marker.point_in_left);
        let left = marker.point_in_left;
        let _ = writeln!(
            text,
            "{},{},{},{},{},{},{},{},{},{},{}",
            marker.id,
            marker.pose,
            marker.row,
            marker.col,
            u8::from(marker.is_direction),
            datum.x,
            datum.y,
            datum.z,
            left.x,
            left.y,
            left.z
        );
    }
    text
}

/// `dataset.toml`.
pub(super) fn manifest(scene: &Scene, with_images: bool, with_target: bool) -> String {
    let settings = &scene.settings;
    let mut text = format!(
        "# Simulated: optics {}, seed {}. The truth is in truth.json.\n\n{}",
        settings.optics.name(),
        settings.seed,
        board_section(&settings.board)
    );
    for (name, camera) in scene.names.iter().zip(&scene.cameras) {
        let sensor = camera.sensor();
        text.push_str(&camera_section(name, sensor));
        if with_images {
            let _ = writeln!(text, "images = \"{name}/*.png\"");
        }
        if with_target {
            let _ = writeln!(text, "target_images = \"target/{name}/*.png\"");
        }
    }
    text.push_str(&stage_section(
        &scene.pose_angles_deg,
        &scene.pose_placements,
    ));
    if with_target {
        // A pair in a list is written as in TOML once its brackets are.
        let direction = DIRECTION_MARKERS.map(|(row, col)| [row, col]);
        let _ = write!(
            text,
            "\n[target]\nkind = \"rings\"\nrows = {RING_ROWS}\ncols = {RING_COLS}\npitch_mm = {RING_PITCH_MM:?}\nouter_radius_mm = {:?}\ndirection_outer_radius_mm = {:?}\ndirection = {direction:?}\n",
            RING_RADII_MM.0, DIRECTION_RADII_MM.0
        );
    }
    text
}

/// `[board]`.
pub(super) fn board_section(board: &BoardSpec) -> String {
    format!(
        "[board]\nkind = \"chessboard\"\nrows = {}\ncols = {}\nsquare_mm = {:?}\n",
        board.rows, board.cols, board.square_mm
    )
}

/// A `[[camera]]`.
pub(super) fn camera_section(name: &str, sensor: SensorSize) -> String {
    format!(
        "\n[[camera]]\nname = \"{name}\"\nwidth = {}\nheight = {}\n",
        sensor.width, sensor.height
    )
}

/// `[stage]`.
pub(super) fn stage_section(angles_deg: &[f64], placements: &[usize]) -> String {
    // Debug writes a list of numbers as TOML does: [-40.0, -35.0].
    format!("\n[stage]\nangles_deg = {angles_deg:?}\nplacement = {placements:?}\n")
}

/// A table as `measure` reads it.
pub(super) fn match_table<'a>(
    names: &[&str],
    rows: impl Iterator<Item = (usize, &'a [PixelPoint])>,
) -> String {
    let mut text = String::from("id");
    for name in names {
        let _ = write!(text, ",u_{name},v_{name}");
    }
    text.push('\n');
    for (id, pixels) in rows {
        let _ = write!(text, "{id}");
        for pixel in pixels {
            let _ = write!(text, ",{},{}", pixel.u, pixel.v);
        }
        text.push('\n');
    }
    text
}

/// A truth table; [`super::output`] explains its columns.
pub(super) fn truth_table(matches: &[TrueMatch]) -> String {
    let mut text =
        String::from("id,x,y,z,x_left,y_left,z_left,x_oracle,y_oracle,z_oracle,board,row,col\n");
    for entry in matches {
        let _ = write!(text, "{}", entry.id);
        for point in [
            &entry.point_in_datum,
            &entry.point_in_left,
            &entry.oracle_in_datum,
        ] {
            let _ = write!(text, ",{},{},{}", point.x, point.y, point.z);
        }
        match entry.label {
            Some((board, row, col)) => {
                let _ = writeln!(text, ",{board},{row},{col}");
            }
            None => text.push_str(",,,\n"),
        }
    }
    text
}

/// A pose as this version of `truth.json` has it.
fn column_by_column(pose: &RigidTransform) -> serde_json::Value {
    json!({ "rotation": pose.rotation, "translation_mm": pose.translation_mm })
}

/// `truth.json`.
pub(super) fn truth(scene: &Scene, settings: &OutputSettings) -> serde_json::Value {
    let cameras: Vec<_> = scene
        .cameras
        .iter()
        .enumerate()
        .map(|(camera_idx, camera)| {
            let sensor = camera.sensor();
            let (nu, nv) = TRUTH_LATTICE;
            let along =
                |k: u32, n: u32, size: u32| f64::from(k) * f64::from(size - 1) / f64::from(n - 1);
            let rays: Vec<[f64; 8]> = (0..nu * nv)
                .filter_map(|k| {
                    let pixel = PixelPoint::new(
                        along(k % nu, nu, sensor.width),
                        along(k / nu, nv, sensor.height),
                    );
                    let ray = camera.ray(pixel)?;
                    let (o, d) = (ray.origin_mm, ray.direction);
                    Some([pixel.u, pixel.v, o.x, o.y, o.z, d.x, d.y, d.z])
                })
                .collect();
            json!({
                "name": scene.names[camera_idx],
                "optics": camera,
                "left_from_camera": column_by_column(&scene.left_from_camera[camera_idx]),
                "rays_columns": ["u", "v", "ox", "oy", "oz", "dx", "dy", "dz"],
                "rays": rays,
            })
        })
        .collect();
    let poses: Vec<_> = scene
        .true_poses
        .iter()
        .enumerate()
        .map(|(pose, left_from_board)| {
            json!({
                "pose": pose,
                "placement": scene.pose_placements[pose],
                "angle_deg": scene.pose_angles_deg[pose],
                "left_from_board": column_by_column(left_from_board),
            })
        })
        .collect();
    json!({
        "schema": TRUTH_SCHEMA,
        "tool_version": env!("CARGO_PKG_VERSION"),
        "note": "mm; rays in their camera's frame; matrices column by column; the left camera is the rig; the datum is the board at pose 0",
        "settings": scene.settings,
        "render": (settings.images || settings.ring_target).then_some(settings.render),
        "placements": scene.placements,
        "cameras": cameras,
        "poses": poses,
    })
}
