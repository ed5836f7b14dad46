//! Those forms of `export` that undistort in a chip.

use super::calibrate::{blob_max_error_px, pack_settings};
use super::error::Error;
use super::export_folder::{check_names, put};
use super::rig_file::{RigFile, open};
use super::usage_error::UsageError;
use crate::present::numbers::short;
use calib_blob::rays::RaySource;
use calib_exchange::Loss;
use calib_exchange::mesh::{CameraMesh, MeshFormat, MeshSettings, Meshes, meshes};
use clap::Args;
use serde::Serialize;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// What only meshes take.
#[derive(Debug, Args)]
pub struct MeshArgs {
    /// Pixels from node to node.
    #[arg(
        long,
        value_name = "N",
        help = "Pixels from node to node of a mesh [default: the format's own]"
    )]
    pub step: Option<u32>,
    /// The output image's focal length in those of the nearest pinhole.
    #[arg(
        long,
        value_name = "FACTOR",
        value_parser = above_0,
        help = "The output image's focal length in those of the nearest pinhole, for a mesh [default: 1]"
    )]
    pub zoom: Option<f64>,
    /// The one camera that is meant.
    #[arg(
        long,
        value_name = "NAME",
        help = "The one camera that a mesh is made for [default: all]"
    )]
    pub camera: Option<String>,
}

impl MeshArgs {
    /// The options, and whether each was given.
    pub(super) fn given(&self) -> [(&'static str, bool); 3] {
        [
            ("--step", self.step.is_some()),
            ("--zoom", self.zoom.is_some()),
            ("--camera", self.camera.is_some()),
        ]
    }
}

/// What meshes lose: the file `PATH.loss.json`.
#[derive(Debug, Serialize)]
pub(super) struct MeshLoss {
    #[serde(flatten)]
    all: Loss,
    distance_mm: f64,
    cameras: Vec<CameraLoss>,
    /// Meshes that take the place of a rectification, and are none.
    #[serde(skip)]
    lacks_rectification: bool,
}

#[derive(Debug, Serialize)]
struct CameraLoss {
    name: String,
    #[serde(flatten)]
    loss: Loss,
    output_pixels: usize,
    outside_pixels: usize,
    held_back_nodes: usize,
}

impl MeshLoss {
    fn new(meshes: &Meshes, format: MeshFormat, distance_mm: f64) -> Self {
        let camera = |mesh: &CameraMesh| CameraLoss {
            name: mesh.name.clone(),
            loss: mesh.loss,
            output_pixels: mesh.loss.count + mesh.outside_pixels,
            outside_pixels: mesh.outside_pixels,
            held_back_nodes: mesh.held_back_nodes,
        };
        Self {
            all: meshes.loss(),
            distance_mm,
            cameras: meshes.cameras.iter().map(camera).collect(),
            lacks_rectification: format == MeshFormat::Luxonis && !meshes.is_rectified,
        }
    }

    /// A sentence.
    pub fn in_words(&self) -> String {
        let cameras = self.cameras.iter().map(|camera| {
            let loss = &camera.loss;
            let mut words = format!(
                "{}: {} px RMS, {} px at most ({} mm, {} mm)",
                camera.name,
                short(loss.rms_px),
                short(loss.max_px),
                short(loss.rms_mm),
                short(loss.max_mm)
            );
            if camera.outside_pixels > 0 {
                // Writing to a string does not fail.
                let _ = write!(
                    words,
                    ", {} of {} output pixels show nothing calibrated",
                    camera.outside_pixels, camera.output_pixels
                );
            }
            if camera.held_back_nodes > 0 {
                let _ = write!(
                    words,
                    ", {} nodes held back within the format's integers (--zoom above 1 has fewer)",
                    camera.held_back_nodes
                );
            }
            words
        });
        let rectification = if self.lacks_rectification {
            "; the output images are no rectified pair, which StereoDepth needs"
        } else {
            ""
        };
        format!(
            "lost by the meshes at {} mm, emulated and not tried on the chip: {}{rectification}",
            short(self.distance_mm),
            cameras.collect::<Vec<_>>().join("; ")
        )
    }
}

/// Writes the folder of meshes: its files, their length, and what they lose.
///
/// # Errors
/// [`Error`], with nothing written.
pub(super) fn write(
    rig: &Path,
    (format, distance_mm): (MeshFormat, Option<f64>),
    args: &MeshArgs,
    folder: &Path,
    force: bool,
) -> Result<(Vec<PathBuf>, usize, MeshLoss), Error> {
    let (meshes, distance_mm) = match RigFile::read(rig)? {
        RigFile::Blob(bytes) => {
            let blob = open(&bytes, rig)?;
            let distance_mm = distance_mm.unwrap_or(blob.working_distance_mm().into());
            (made(&blob, format, args, distance_mm)?, distance_mm)
        }
        RigFile::Calibration(calibration) => {
            let packed = pack_settings(&calibration, blob_max_error_px(&calibration));
            let distance_mm = distance_mm.unwrap_or(packed.working_distance_mm);
            (
                made(&calibration.rig, format, args, distance_mm)?,
                distance_mm,
            )
        }
    };
    let loss = MeshLoss::new(&meshes, format, distance_mm);
    let (files, bytes) = put(folder, meshes.files, Some(&loss), force)?;
    Ok((files, bytes, loss))
}

/// The meshes for a distance.
fn made(
    source: &dyn RaySource,
    format: MeshFormat,
    args: &MeshArgs,
    distance_mm: f64,
) -> Result<Meshes, Error> {
    check_names(source)?;
    let known: Vec<String> = source
        .cameras()
        .into_iter()
        .map(|camera| camera.name)
        .collect();
    let camera_idx = match &args.camera {
        None => None,
        Some(name) => {
            let found = known.iter().position(|camera| camera == name);
            let name = name.clone();
            Some(found.ok_or(UsageError::UnknownCamera { name, known })?)
        }
    };
    let settings = MeshSettings {
        format,
        step: args.step,
        distance_mm,
        zoom: args.zoom.unwrap_or(1.0),
        camera_idx,
    };
    Ok(meshes(source, &settings)?)
}

fn above_0(text: &str) -> Result<f64, String> {
    let number = text.parse::<f64>().ok();
    let number = number.filter(|number| *number > 0.0 && number.is_finite());
    number.ok_or_else(|| "give a number above 0".to_owned())
}
