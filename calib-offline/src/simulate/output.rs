//! A simulated dataset as files: what a user would have recorded, and beside it the truth.
//!
//! | file | what it is |
//! | --- | --- |
//! | `dataset.toml` | the manifest |
//! | `corners.csv` | observed corners (left out if images are written, unless both are asked for) |
//! | `NAME/0000.png` | images, one per pose |
//! | `matches.csv`, `matches_truth.csv` | pixels to measure inside the swept volume, and the truth |
//! | `holdout.csv`, `holdout_truth.csv` | the same for board corners at poses never recorded |
//! | `target/` | images of the ring target, `target/matches.csv` and `target/truth.csv` |
//! | `truth.json` | settings, optics, extrinsics, poses and a lattice of true rays per camera |
//!
//! Columns of the truth tables: `x,y,z` the true point in the datum frame (the board at pose 0),
//! `x_left,y_left,z_left` the same point in the left camera's frame, `x_oracle,y_oracle,z_oracle`
//! where the true rays of the noisy pixels meet (datum frame): what a perfect calibration would
//! measure; `board,row,col` which corner it was, for held-out boards. Millimeters; numbers are
//! written so that reading them gives the same bits.

use super::matches::{MatchSet, TrueMatch};
use super::pattern::Pattern;
use super::render::{PlateView, RenderSettings, Rendered};
use super::scene::{Scene, SceneError};
use super::target;
use crate::geometry::PixelPoint;
use rayon::prelude::*;
use serde::Serialize;
use serde_json::json;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// Name and version of `truth.json`.
pub const TRUTH_SCHEMA: &str = "calib-offline/truth/1";
/// Rays of the lattice in `truth.json` along u and along v.
const TRUTH_LATTICE: (u32, u32) = (17, 13);

/// What to write.
#[derive(Debug, Clone, PartialEq)]
pub struct OutputSettings {
    /// Observed corners.
    pub corners: bool,
    /// Images of the board.
    pub images: bool,
    /// Images of the ring target.
    pub ring_target: bool,
    /// How images look.
    pub render: RenderSettings,
    /// 8 or 16 bits per pixel.
    pub image_depth: ImageDepth,
    /// How many matches inside the swept volume.
    pub point_count: usize,
    /// How many held-out corners.
    pub holdout_count: usize,
}

impl Default for OutputSettings {
    fn default() -> Self {
        Self {
            corners: true,
            images: false,
            ring_target: false,
            render: RenderSettings::default(),
            image_depth: ImageDepth::Eight,
            point_count: 500,
            holdout_count: 500,
        }
    }
}

/// Bits per pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageDepth {
    /// 8 bits.
    Eight,
    /// 16 bits.
    Sixteen,
}

/// What was written.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SimulateSummary {
    /// The folder.
    pub folder: PathBuf,
    /// Kind of optics.
    pub optics: super::OpticsKind,
    /// Seed of everything random.
    pub seed: u64,
    /// Cameras.
    pub camera_count: usize,
    /// Poses.
    pub pose_count: usize,
    /// Corners in `corners.csv`.
    pub corner_count: usize,
    /// Images of the board.
    pub image_count: usize,
    /// Rows of `matches.csv`.
    pub point_count: usize,
    /// Rows of `holdout.csv`.
    pub holdout_count: usize,
    /// RMS error of a perfect calibration on `matches.csv`, mm.
    pub points_oracle_rms_mm: f64,
    /// The same on `holdout.csv`, mm.
    pub holdout_oracle_rms_mm: f64,
    /// Share of each camera's image (where it forms one) inside the hull of all corners.
    pub hull_share: Vec<f64>,
    /// Bytes of all files together.
    pub byte_count: u64,
}

/// Why a dataset could not be simulated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// The settings make no scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The output path is a file.
    #[error("{}: the output must be a folder, and this is a file", .path.display())]
    OutputIsFile {
        /// The path given.
        path: PathBuf,
    },
    /// The output folder holds something.
    #[error("{}: the folder is not empty; --force replaces it with everything in it", .path.display())]
    OutputNotEmpty {
        /// The path given.
        path: PathBuf,
    },
    /// An argument cannot be read.
    #[error("{option} {text:?}: expected {expected}")]
    Argument {
        /// The option.
        option: &'static str,
        /// What was given.
        text: String,
        /// What would be right.
        expected: &'static str,
    },
    /// No point of the swept volume is seen by all cameras.
    #[error("only {have} of {need} matches found: the cameras hardly see the board together")]
    TooFewMatches {
        /// How many were asked for.
        need: usize,
        /// How many there are.
        have: usize,
    },
    /// Reading or writing a file.
    #[error("{}: {source}", .path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Encoding an image.
    #[error("{}: {source}", .path.display())]
    Image {
        /// Which.
        path: PathBuf,
        /// Why.
        source: image::ImageError,
    },
}

/// Simulates into `folder`, which appears whole or not at all.
///
/// The files are written into a temporary folder beside it, which is then renamed.
///
/// # Errors
/// [`SimulateError::OutputIsFile`], [`SimulateError::OutputNotEmpty`] (unless `force`),
/// [`SimulateError::TooFewMatches`], [`SimulateError::Io`], [`SimulateError::Image`].
pub fn write_dataset(
    scene: &Scene,
    settings: &OutputSettings,
    folder: &Path,
    force: bool,
) -> Result<SimulateSummary, SimulateError> {
    check_output(folder, force)?;
    let at = |path: &Path| {
        let path = path.to_path_buf();
        move |source| SimulateError::Io { path, source }
    };
    let parent = match folder.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    std::fs::create_dir_all(parent).map_err(at(parent))?;
    let scratch = tempfile::Builder::new()
        .prefix(".simulate-")
        .tempdir_in(parent)
        .map_err(at(parent))?;
    // A folder inside the temporary one: it has the usual permissions.
    let fresh = scratch.path().join("new");
    std::fs::create_dir(&fresh).map_err(at(&fresh))?;
    let mut writer = Writer {
        folder: fresh.clone(),
        byte_count: 0,
    };
    let mut summary = write_files(scene, settings, &mut writer)?;
    summary.folder = folder.to_path_buf();
    summary.byte_count = writer.byte_count;
    if folder.exists() {
        let old = scratch.path().join("old");
        std::fs::rename(folder, &old).map_err(at(folder))?;
        if let Err(source) = std::fs::rename(&fresh, folder) {
            // Put the old one back; if that fails too, the first error is the one to tell.
            let _ = std::fs::rename(&old, folder);
            return Err(at(folder)(source));
        }
    } else {
        std::fs::rename(&fresh, folder).map_err(at(folder))?;
    }
    Ok(summary)
}

/// Refuses an output that is a file or would be overwritten.
fn check_output(folder: &Path, force: bool) -> Result<(), SimulateError> {
    if !folder.exists() {
        return Ok(());
    }
    let path = folder.to_path_buf();
    if !folder.is_dir() {
        return Err(SimulateError::OutputIsFile { path });
    }
    let mut entries = std::fs::read_dir(folder).map_err(|source| SimulateError::Io {
        path: path.clone(),
        source,
    })?;
    if entries.next().is_some() && !force {
        return Err(SimulateError::OutputNotEmpty { path });
    }
    Ok(())
}

fn write_files(
    scene: &Scene,
    settings: &OutputSettings,
    writer: &mut Writer,
) -> Result<SimulateSummary, SimulateError> {
    writer.text("dataset.toml", &manifest(scene, settings.images))?;
    let mut corner_count = 0;
    if settings.corners {
        let views = scene.observe_corners();
        let mut text = String::from("camera,pose,row,col,u,v\n");
        for view in &views {
            corner_count += view.corners.len();
            for corner in &view.corners {
                let _ = writeln!(
                    text,
                    "{},{},{},{},{},{}",
                    scene.names[view.camera_idx],
                    view.pose,
                    corner.row,
                    corner.col,
                    corner.pixel.u,
                    corner.pixel.v
                );
            }
        }
        writer.text("corners.csv", &text)?;
    }
    let mut oracle_rms = [0.0; 2];
    let mut counts = [0; 2];
    for (k, (name, set, need)) in [
        ("matches", MatchSet::Points, settings.point_count),
        ("holdout", MatchSet::Holdout, settings.holdout_count),
    ]
    .into_iter()
    .enumerate()
    {
        let matches = scene.matches(set, need);
        if matches.len() < need {
            return Err(SimulateError::TooFewMatches {
                need,
                have: matches.len(),
            });
        }
        writer.text(
            &format!("{name}.csv"),
            &match_table(
                scene,
                matches.iter().map(|entry| (entry.id, &entry.pixels[..])),
            ),
        )?;
        writer.text(&format!("{name}_truth.csv"), &truth_table(&matches))?;
        counts[k] = matches.len();
        oracle_rms[k] = oracle_rms_mm(&matches);
    }
    let mut image_count = 0;
    if settings.images {
        image_count = write_board_images(scene, &settings.render, settings.image_depth, writer)?;
    }
    if settings.ring_target {
        write_target(scene, &settings.render, settings.image_depth, writer)?;
    }
    let truth =
        serde_json::to_string(&truth(scene, settings)).map_err(|error| SimulateError::Io {
            path: writer.folder.join("truth.json"),
            source: error.into(),
        })?;
    writer.text("truth.json", &(truth + "\n"))?;
    Ok(SimulateSummary {
        folder: PathBuf::new(),
        optics: scene.settings.optics,
        seed: scene.settings.seed,
        camera_count: scene.cameras.len(),
        pose_count: scene.true_poses.len(),
        corner_count,
        image_count,
        point_count: counts[0],
        holdout_count: counts[1],
        points_oracle_rms_mm: oracle_rms[0],
        holdout_oracle_rms_mm: oracle_rms[1],
        hull_share: (0..scene.cameras.len())
            .map(|camera_idx| scene.hull_share(camera_idx))
            .collect(),
        byte_count: 0,
    })
}

/// RMS distance of the oracle's points from the true ones, mm.
pub fn oracle_rms_mm(matches: &[TrueMatch]) -> f64 {
    let sum: f64 = matches
        .iter()
        .map(|entry| (entry.oracle_in_datum - entry.point_in_datum).norm_squared())
        .sum();
    (sum / matches.len().max(1) as f64).sqrt()
}

fn manifest(scene: &Scene, with_images: bool) -> String {
    let settings = &scene.settings;
    let board = &settings.board;
    let mut text = format!(
        "# Simulated: optics {}, seed {}. The truth is in truth.json.\n\n[board]\nkind = \"chessboard\"\nrows = {}\ncols = {}\nsquare_mm = {:?}\n",
        settings.optics.name(),
        settings.seed,
        board.rows,
        board.cols,
        board.square_mm
    );
    for (name, camera) in scene.names.iter().zip(&scene.cameras) {
        let sensor = camera.sensor();
        let _ = write!(
            text,
            "\n[[camera]]\nname = \"{name}\"\nwidth = {}\nheight = {}\n",
            sensor.width, sensor.height
        );
        if with_images {
            let _ = writeln!(text, "images = \"{name}/*.png\"");
        }
    }
    // Debug writes a list of numbers as TOML does: [-40.0, -35.0].
    let _ = write!(
        text,
        "\n[stage]\nangles_deg = {:?}\nplacement = {:?}\n",
        scene.pose_angles_deg, scene.pose_placements
    );
    text
}

/// A table as `measure` reads it.
fn match_table<'a>(scene: &Scene, rows: impl Iterator<Item = (usize, &'a [PixelPoint])>) -> String {
    let mut text = String::from("id");
    for name in &scene.names {
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

fn truth_table(matches: &[TrueMatch]) -> String {
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

fn truth(scene: &Scene, settings: &OutputSettings) -> serde_json::Value {
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
                "left_from_camera": scene.left_from_camera[camera_idx],
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
                "left_from_board": left_from_board,
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

fn write_board_images(
    scene: &Scene,
    render: &RenderSettings,
    depth: ImageDepth,
    writer: &mut Writer,
) -> Result<usize, SimulateError> {
    for name in &scene.names {
        writer.subfolder(name)?;
    }
    let views: Vec<(usize, usize)> = (0..scene.cameras.len())
        .flat_map(|camera_idx| (0..scene.true_poses.len()).map(move |pose| (camera_idx, pose)))
        .collect();
    let folder = &writer.folder;
    let sizes = views
        .par_iter()
        .map(|&(camera_idx, pose)| {
            let image = scene.render_board(camera_idx, pose, render);
            let name = format!("{}/{pose:04}.png", scene.names[camera_idx]);
            write_png(&image, depth, &folder.join(name))
        })
        .collect::<Result<Vec<u64>, _>>()?;
    writer.byte_count += sizes.iter().sum::<u64>();
    Ok(views.len())
}

/// The ring target at several distances: images, the true centers and their pixels.
fn write_target(
    scene: &Scene,
    render: &RenderSettings,
    depth: ImageDepth,
    writer: &mut Writer,
) -> Result<(), SimulateError> {
    writer.subfolder("target")?;
    for name in &scene.names {
        writer.subfolder(&format!("target/{name}"))?;
    }
    let poses = target::target_poses(scene);
    let views: Vec<(usize, usize)> = (0..scene.cameras.len())
        .flat_map(|camera_idx| (0..poses.len()).map(move |pose| (camera_idx, pose)))
        .collect();
    let folder = &writer.folder;
    let sizes = views
        .par_iter()
        .map(|&(camera_idx, pose)| {
            let camera_from_left = scene.left_from_camera[camera_idx].inverse();
            let view = PlateView {
                camera: &scene.cameras[camera_idx],
                camera_from_plate: camera_from_left * poses[pose],
                pattern: Pattern::RingTarget,
                bow_mm: 0.0,
            };
            let mut image = view.render(render);
            // Streams beyond those of the board's poses.
            let stream = scene.true_poses.len() + pose;
            image.add_noise(render.noise_levels, scene.settings.seed, camera_idx, stream);
            let name = format!("target/{}/{pose:04}.png", scene.names[camera_idx]);
            write_png(&image, depth, &folder.join(name))
        })
        .collect::<Result<Vec<u64>, _>>()?;
    writer.byte_count += sizes.iter().sum::<u64>();
    let markers = target::seen_markers(scene, &poses);
    writer.text(
        "target/matches.csv",
        &match_table(
            scene,
            markers
                .iter()
                .map(|marker| (marker.id, &marker.true_pixels[..])),
        ),
    )?;
    let datum_from_left = scene.datum_from_left();
    let mut text = String::from("id,pose,row,col,direction,x,y,z,x_left,y_left,z_left\n");
    for marker in &markers {
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
    writer.text("target/truth.csv", &text)
}

/// Writes a PNG and returns its size.
fn write_png(image: &Rendered, depth: ImageDepth, path: &Path) -> Result<u64, SimulateError> {
    use image::codecs::png::{CompressionType, FilterType, PngEncoder};
    use image::{ExtendedColorType, ImageEncoder};
    let mut bytes = Vec::new();
    let encoder =
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive);
    let (width, height) = (image.sensor.width, image.sensor.height);
    let result = match depth {
        ImageDepth::Eight => {
            encoder.write_image(&image.to_u8(), width, height, ExtendedColorType::L8)
        }
        ImageDepth::Sixteen => {
            // The encoder takes native byte order.
            let samples: Vec<u8> = image
                .to_u16()
                .iter()
                .flat_map(|sample| sample.to_ne_bytes())
                .collect();
            encoder.write_image(&samples, width, height, ExtendedColorType::L16)
        }
    };
    result.map_err(|source| SimulateError::Image {
        path: path.to_path_buf(),
        source,
    })?;
    std::fs::write(path, &bytes).map_err(|source| SimulateError::Io {
        path: path.to_path_buf(),
        source,
    })?;
    Ok(bytes.len() as u64)
}

/// Writes files into one folder and counts their bytes.
struct Writer {
    folder: PathBuf,
    byte_count: u64,
}

impl Writer {
    fn text(&mut self, name: &str, text: &str) -> Result<(), SimulateError> {
        let path = self.folder.join(name);
        std::fs::write(&path, text).map_err(|source| SimulateError::Io { path, source })?;
        self.byte_count += text.len() as u64;
        Ok(())
    }

    fn subfolder(&self, name: &str) -> Result<(), SimulateError> {
        let path = self.folder.join(name);
        std::fs::create_dir_all(&path).map_err(|source| SimulateError::Io { path, source })
    }
}
