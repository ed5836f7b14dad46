//! Meshes for the chips that undistort images: for nodes of the output image, where the camera's image is to be read.
//!
//! The output image is a [`View`], a pinhole without distortion of the size of the sensor. It shows what lies at a distance from its
//! center; rays that do not meet in a point see other things elsewhere. Each format is one file with its quirks and
//! sources at its head: `ti`, `dw100`, `vpi`, `luxonis`, and `plain` for whatever has none.
//!
//! None of the chips was run. A chip's use of its mesh is emulated with the numbers that the file holds, and the loss is taken at every pixel of
//! the output image that shows something calibrated: its maximum is the maximum.

mod dw100;
mod error;
mod format;
mod grid;
mod lost;
mod luxonis;
mod plain;
mod straight;
#[cfg(test)]
mod tests;
mod ti;
mod view;
mod vpi;

pub use error::MeshError;
pub use view::View;

use crate::NamedFile;
use crate::loss::Loss;
use crate::sight::Sight;
use calib_blob::rays::{RaySource, SourceCamera};
use format::{Camera, Format};
use grid::Grid;
use serde_json::{Value, json};

/// The JSON beside the meshes.
pub const INDEX: &str = "mesh.json";

/// The formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeshFormat {
    /// TI's LDC.
    Ti,
    /// NXP's DW100.
    Dw100,
    /// NVIDIA's VPI.
    Vpi,
    /// Luxonis' `StereoDepth`.
    Luxonis,
    /// An array.
    Plain,
}

impl MeshFormat {
    const fn format(self) -> &'static Format {
        match self {
            Self::Ti => &ti::FORMAT,
            Self::Dw100 => &dw100::FORMAT,
            Self::Vpi => &vpi::FORMAT,
            Self::Luxonis => &luxonis::FORMAT,
            Self::Plain => &plain::FORMAT,
        }
    }
}

/// What meshes are made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeshSettings {
    /// The format.
    pub format: MeshFormat,
    /// Distance of the nodes, px; `None` for the format's own.
    pub step: Option<u32>,
    /// How far from the camera things are, mm; above 0.
    pub distance_mm: f64,
    /// The output image's focal length in those of the nearest pinhole; above 0.
    pub zoom: f64,
    /// The one camera that is meant; `None` for all.
    pub camera_idx: Option<usize>,
}

/// The mesh of a camera.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraMesh {
    /// Its name.
    pub name: String,
    /// The output image.
    pub view: View,
    /// What the chip's use of the file loses.
    pub loss: Loss,
    /// Pixels of the output image for which no calibrated pixel was found that sees what they show: the loss does not speak of them.
    pub outside_pixels: usize,
    /// Nodes that the format's integers could not hold and that were held back at their end.
    pub held_back_nodes: usize,
}

/// The meshes of a rig.
#[derive(Debug, Clone, PartialEq)]
pub struct Meshes {
    /// A file a camera, and [`INDEX`].
    pub files: Vec<NamedFile>,
    /// In the rig's order.
    pub cameras: Vec<CameraMesh>,
    /// Whether the output images are a rectified pair.
    pub is_rectified: bool,
}

impl Meshes {
    /// The loss of all cameras together.
    pub fn loss(&self) -> Loss {
        let losses: Vec<Loss> = self.cameras.iter().map(|camera| camera.loss).collect();
        Loss::together(&losses)
    }
}

/// Makes the meshes of a rig. Cost: some four lookups of a ray for each pixel of the output images.
///
/// # Errors
/// [`MeshError`].
pub fn meshes(source: &dyn RaySource, settings: &MeshSettings) -> Result<Meshes, MeshError> {
    let format = settings.format.format();
    let cameras = source.cameras();
    let chosen: Vec<usize> = match settings.camera_idx {
        Some(camera_idx) => vec![camera_idx],
        None => (0..cameras.len()).collect(),
    };
    // What the format refuses is known before the work is done.
    let step = settings.step.unwrap_or(format.default_step);
    for camera_idx in &chosen {
        (format.layout)(&of(&cameras[*camera_idx]), step)?;
    }
    let is_rectified = settings.format == MeshFormat::Luxonis && chosen.len() == 2;
    let views = if is_rectified {
        view::rectified(source, settings.distance_mm)?.to_vec()
    } else {
        view::own(source, settings.distance_mm)?
    };
    let mut files = Vec::new();
    let mut made = Vec::new();
    let mut index = Vec::new();
    for camera_idx in chosen {
        let camera = &cameras[camera_idx];
        let view = views[camera_idx].zoomed(settings.zoom);
        let (mesh, grid) = mesh(source, camera_idx, camera, view, settings)?;
        let name = (format.file)(&camera.name);
        index.push(entry(&mesh, &grid, &name, &(format.facts)(&grid)));
        files.push((name, (format.bytes)(&grid)));
        made.push(mesh);
    }
    let index = json!({
        "schema": "calib-offline/mesh/1",
        "format": format.name,
        "distance_mm": settings.distance_mm,
        "pixel_origin": "center of the top-left pixel is (0, 0)",
        "is_rectified_pair": is_rectified,
        "cameras": index,
    });
    files.push((INDEX.to_owned(), format!("{index:#}\n").into_bytes()));
    Ok(Meshes {
        files,
        cameras: made,
        is_rectified,
    })
}

fn of(camera: &SourceCamera) -> Camera<'_> {
    Camera {
        name: &camera.name,
        sensor: camera.sensor,
    }
}

fn mesh(
    source: &dyn RaySource,
    camera_idx: usize,
    camera: &SourceCamera,
    view: View,
    settings: &MeshSettings,
) -> Result<(CameraMesh, Grid), MeshError> {
    let format = settings.format.format();
    let nothing_seen = || MeshError::NothingSeen {
        camera: camera.name.clone(),
    };
    let step = settings.step.unwrap_or(format.default_step);
    let layout = (format.layout)(&of(camera), step)?;
    let sight = Sight::new(source, camera_idx, camera.sensor);
    let grid = Grid::new(&sight, &view, layout, settings.distance_mm);
    let mut grid = grid.ok_or_else(nothing_seen)?;
    (format.check)(&of(camera), &grid)?;
    let held_back_nodes = (format.round)(&mut grid);
    let lost = lost::lost(&sight, &view, &grid, settings.distance_mm).ok_or_else(nothing_seen)?;
    let mesh = CameraMesh {
        name: camera.name.clone(),
        view,
        loss: lost.loss,
        outside_pixels: lost.outside,
        held_back_nodes,
    };
    Ok((mesh, grid))
}

/// What the JSON says of a camera.
fn entry(mesh: &CameraMesh, grid: &Grid, file: &str, facts: &Value) -> Value {
    let View {
        size,
        focal_px: [fx, fy],
        center_px: [cx, cy],
        rig_from_view,
    } = &mesh.view;
    let rows: Vec<Vec<f64>> = rig_from_view
        .rotation
        .row_iter()
        .map(|row| row.iter().copied().collect())
        .collect();
    json!({
        "camera": mesh.name,
        "file": file,
        "image_size": [size.width, size.height],
        "step_px": grid.layout.step,
        "nodes": [grid.layout.us.len(), grid.layout.vs.len()],
        "last_node_px": [grid.layout.us.last(), grid.layout.vs.last()],
        "format": facts,
        "output": {
            "camera_matrix": [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]],
            "rig_from_output_rotation": rows,
            "rig_from_output_translation_mm": rig_from_view.translation_mm.as_slice(),
        },
        "outside_pixels": mesh.outside_pixels,
        "held_back_nodes": mesh.held_back_nodes,
        "loss": mesh.loss,
    })
}
