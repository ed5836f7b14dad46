//! What is counted: which blobs, and on which pixels of them.

use std::path::{Path, PathBuf};

use ray_runtime::format::Form;
use ray_runtime::integer::Rig;
use ray_runtime::{Camera, PixelPoint, Ray, RayBlob};
use split_mix::SplitMix;

use crate::counting::{Job, PixelPair, job_start};
use crate::error::CostError;
use crate::report::CameraCost;
use crate::yardstick::{BilinearTable, Brown};

/// The blobs that are counted if none are given, from the workspace's folder: one a line for every
/// encoding.
const BUILT_IN: &[&str] = &[
    "data/golden/central-v3-fast.rays",
    "data/golden/non-central-v3-fast.rays",
    "data/golden/central-v3-small.rays",
    "data/golden/non-central-v3-small.rays",
    "data/golden/non-central-v3-cubic.rays",
    "data/golden/stereo-v2.rays",
];

/// Matches on each blob.
pub const MATCH_COUNT: usize = 64;

/// Pairs of pixels that are tried for one match before giving up.
const TRIES_PER_MATCH: usize = 10_000;

/// Nodes of the bilinear tables: 32 x 24 cells over the sensor.
const TABLE_NODES: [usize; 2] = [33, 25];

/// The built-in list.
pub fn built_in() -> Vec<PathBuf> {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    BUILT_IN.iter().map(|file| root.join(file)).collect()
}

/// A blob with the matches it is asked.
#[derive(Debug)]
pub struct Asked {
    /// Its length, bytes.
    pub length: usize,
    /// The two cameras of its matches, or the only one that there is.
    pub cameras: Vec<CameraCost>,
    /// Whether it carries the uncertainty of the two.
    pub has_uncertainty: bool,
    /// Whether the arithmetic of integers can look it up.
    pub has_integers: bool,
    /// What the flash is to hold: the blob and its job.
    pub flash: Vec<u8>,
}

impl Asked {
    /// Opens a blob and chooses its matches, the same ones every time.
    ///
    /// # Errors
    /// [`CostError`] if it is no blob, or one of two cameras whose rays never meet.
    pub fn read(path: &Path) -> Result<Self, CostError> {
        let contents = std::fs::read(path).map_err(|source| CostError::Io {
            what: path.display().to_string(),
            source,
        })?;
        let mut words = vec![0_u64; contents.len().div_ceil(8)];
        let bytes = bytemuck::cast_slice_mut(&mut words);
        let (bytes, _) = bytes.split_at_mut(contents.len());
        bytes.copy_from_slice(&contents);
        let blob = RayBlob::open(bytes).map_err(|source| CostError::Blob {
            path: path.to_owned(),
            source,
        })?;
        Self::choose(path, &blob, &contents)
    }

    fn choose(path: &Path, blob: &RayBlob<'_>, contents: &[u8]) -> Result<Self, CostError> {
        let uncertain = blob.uncertain_pairs().next();
        let numbers = match uncertain {
            Some(pair) => pair.cameras.map(usize::from),
            // The only camera is asked twice, and not for points.
            None => [0, blob.camera_count().saturating_sub(1).min(1)],
        };
        let [Some(first), Some(second)] = numbers.map(|number| blob.camera(number)) else {
            return Err(CostError::NoCamera {
                path: path.to_owned(),
            });
        };
        let matches = choose_matches(blob, numbers, &[first, second], uncertain.is_some())
            .ok_or_else(|| CostError::NoMatches {
                path: path.to_owned(),
                tries: TRIES_PER_MATCH,
            })?;
        let of_both = [(numbers[0], first), (numbers[1], second)];
        let nodes = of_both.map(|(number, camera)| table_nodes(blob, number, &camera));
        let tables = [(&first, &nodes[0]), (&second, &nodes[1])]
            .map(|(camera, values)| table(camera, values));
        let job = Job {
            cameras: numbers,
            matches: &matches,
            tables,
            browns: of_both.map(|(number, camera)| brown(blob, number, &camera)),
        };
        let mut flash = contents.to_vec();
        flash.resize(job_start(contents.len()), 0);
        flash.extend(job.to_bytes());
        Ok(Self {
            length: contents.len(),
            cameras: of_both
                .iter()
                .take(blob.camera_count())
                .map(|(_, camera)| camera_cost(camera))
                .collect(),
            has_uncertainty: uncertain.is_some(),
            has_integers: Rig::<2>::prepare(blob).is_ok(),
            flash,
        })
    }
}

/// A camera's name and what sets it apart from others, which its rows cost what they do for.
fn camera_cost(camera: &Camera<'_>) -> CameraCost {
    let form = match camera.encoding.form {
        Form::Spline => "f32 spline",
        Form::Patches => "f32 patches",
        Form::Quantized => "polynomial and quantized knots",
    };
    let kind = if camera.encoding.is_central {
        "central"
    } else {
        "not central"
    };
    CameraCost {
        name: camera.name.to_owned(),
        kind: format!("{form}, {kind}"),
    }
}

/// Pixels all over the calibrated areas of two cameras, if they are two, whose rays meet in front of
/// both.
fn choose_matches(
    blob: &RayBlob<'_>,
    [first, second]: [usize; 2],
    [camera_a, camera_b]: &[Camera<'_>; 2],
    has_uncertainty: bool,
) -> Option<Vec<[f32; 4]>> {
    let mut random = SplitMix(0x5eed);
    let meets = |[a, b]: PixelPair| {
        if !(blob.is_calibrated(first, a) && blob.is_calibrated(second, b)) {
            return false;
        }
        if first == second {
            return true;
        }
        let measured = blob.triangulate_with_covariance((first, a), (second, b));
        measured.is_ok_and(|measured| measured.covariance.is_some() == has_uncertainty)
    };
    let mut matches = Vec::with_capacity(MATCH_COUNT);
    for _ in 0..MATCH_COUNT {
        let found = (0..TRIES_PER_MATCH)
            .map(|_| {
                [
                    pixel_of(&mut random, camera_a),
                    pixel_of(&mut random, camera_b),
                ]
            })
            .find(|pair| meets(*pair));
        let [a, b] = found?;
        matches.push([a.u, a.v, b.u, b.v]);
    }
    Some(matches)
}

/// Anywhere in the region.
fn pixel_of(random: &mut SplitMix, camera: &Camera<'_>) -> PixelPoint {
    let region = camera.region;
    let mut along = |first: u32, count: u32| first as f32 - 0.5 + random.unit() * count as f32;
    PixelPoint::new(
        along(region.u, region.width),
        along(region.v, region.height),
    )
}

/// The blob's own rays at the nodes; zero where there are none, which costs as much to read.
fn table_nodes(blob: &RayBlob<'_>, number: usize, camera: &Camera<'_>) -> Vec<[f32; 4]> {
    let [nodes_u, nodes_v] = TABLE_NODES;
    let at = |first: u32, count: u32, k: usize, nodes: usize| {
        first as f32 - 0.5 + count as f32 * k as f32 / (nodes - 1) as f32
    };
    let region = camera.region;
    let [_, _, z_mm] = camera.rig_from_camera.translation_mm;
    let node = |index: usize| {
        let pixel = PixelPoint::new(
            at(region.u, region.width, index % nodes_u, nodes_u),
            at(region.v, region.height, index / nodes_u, nodes_v),
        );
        blob.lookup(number, pixel)
            .map_or([0.0; 4], |ray| in_two_planes(&ray, z_mm))
    };
    (0..nodes_u * nodes_v).map(node).collect()
}

fn in_two_planes(ray: &Ray, z_mm: f32) -> [f32; 4] {
    let ([x, y, z], [dx, dy, dz]) = (ray.origin_mm, ray.direction);
    if !(dz > 0.0) {
        return [0.0; 4];
    }
    let slopes = [dx / dz, dy / dz];
    [
        slopes[0],
        slopes[1],
        x + (z_mm - z) * slopes[0],
        y + (z_mm - z) * slopes[1],
    ]
}

fn table<'a>(camera: &Camera<'_>, values: &'a [[f32; 4]]) -> BilinearTable<'a> {
    let region = camera.region;
    let per_px = |nodes: usize, count: u32| (nodes - 1) as f32 / count as f32;
    BilinearTable {
        nodes: TABLE_NODES,
        first_px: [region.u as f32 - 0.5, region.v as f32 - 0.5],
        nodes_per_px: [
            per_px(TABLE_NODES[0], region.width),
            per_px(TABLE_NODES[1], region.height),
        ],
        z_mm: camera.rig_from_camera.translation_mm[2],
        values,
    }
}

/// A pinhole where the camera stands that looks its way, with the camera's focal length at the
/// middle and some distortion. It answers something near the truth, at the cost of the true one.
fn brown(blob: &RayBlob<'_>, number: usize, camera: &Camera<'_>) -> Brown {
    let region = camera.region;
    let center = PixelPoint::new(
        region.u as f32 + 0.5 * region.width as f32,
        region.v as f32 + 0.5 * region.height as f32,
    );
    let pose = camera.rig_from_camera;
    let slope_at = |u: f32| {
        let ray = blob.lookup(number, PixelPoint::new(u, center.v)).ok()?;
        let [dx, dy, dz] = ray.direction;
        let along = |axis: usize| {
            let [x, y, z] = pose.rotation.map(|row| row[axis]);
            x * dx + y * dy + z * dz
        };
        (along(2) > 0.0).then(|| along(0) / along(2))
    };
    let step_px = 0.125 * region.width as f32;
    let inverse_focal = slope_at(center.u - step_px)
        .zip(slope_at(center.u + step_px))
        .map(|(low, high)| (high - low) / (2.0 * step_px))
        .filter(|inverse| inverse.is_normal())
        .unwrap_or(1.0 / region.width as f32);
    let [[r11, r12, r13], [r21, r22, r23], [r31, r32, r33]] = pose.rotation;
    Brown {
        inverse_focal: [inverse_focal; 2],
        center_px: [center.u, center.v],
        k: [-0.05, 0.004, -0.0003],
        p: [2e-4, -1e-4],
        rotation: [r11, r12, r13, r21, r22, r23, r31, r32, r33],
        center_mm: pose.translation_mm,
    }
}
