//! What the runtime costs on one core beside another: the same blobs, the same pixels, other images.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::blobs::Asked;
use crate::cores::Core;
use crate::count::{COUNTING, COUNTING_FEATURES, cost_of_blob};
use crate::error::CostError;
use crate::image::Image;
use crate::images::Images;
use crate::measure::conditions;
use crate::report::{BlobCost, Conditions, SCHEMA};

/// What it costs on several cores.
#[derive(Debug, Serialize)]
pub struct AcrossCores {
    /// [`SCHEMA`].
    pub schema: u32,
    /// One for each core.
    pub cores: Vec<CoreCost>,
}

/// What it costs on one core.
#[derive(Debug, Serialize)]
pub struct CoreCost {
    /// What its maker calls it.
    pub core: &'static str,
    /// What is given to the compiler besides the target.
    pub flags: &'static str,
    /// What it was measured with.
    pub conditions: Conditions,
    /// Per blob: instructions and stack.
    pub blobs: Vec<BlobCost>,
}

/// The blobs that are counted on every core if none are given: the usual ones.
pub const USUAL: [&str; 3] = [
    "central-v3-fast.rays",
    "non-central-v3-fast.rays",
    "non-central-v3-cubic.rays",
];

/// Counts the given blobs on these cores; images are built first where they are missing or stale.
///
/// # Errors
/// [`CostError`].
pub fn across(
    images: &impl Images,
    cores: &[Core],
    paths: &[PathBuf],
) -> Result<AcrossCores, CostError> {
    let asked = paths.iter().map(|path| Asked::read(path));
    let asked = asked.collect::<Result<Vec<_>, _>>()?;
    let cores = cores.iter();
    let cores = cores.map(|core| cost_of_core(images, core, paths, &asked));
    Ok(AcrossCores {
        schema: SCHEMA,
        cores: cores.collect::<Result<_, _>>()?,
    })
}

fn cost_of_core(
    images: &impl Images,
    core: &Core,
    paths: &[PathBuf],
    asked: &[Asked],
) -> Result<CoreCost, CostError> {
    let qemu = images.qemu_version(core)?;
    images.build(core, &[COUNTING], COUNTING_FEATURES)?;
    let image = Image::read(&images.path(core, COUNTING))?;
    let mut conditions = conditions(core, qemu, &image);
    let mut blobs = Vec::new();
    for (path, asked) in paths.iter().zip(asked) {
        blobs.push(cost_of_blob(
            images,
            core,
            &image,
            path,
            asked,
            &mut conditions,
        )?);
    }
    Ok(CoreCost {
        core: core.name,
        flags: core.flags,
        conditions,
        blobs,
    })
}

/// Of these blobs the usual ones.
pub fn usual(paths: &[PathBuf]) -> Vec<PathBuf> {
    let is_usual = |path: &Path| {
        let name = path.file_name().and_then(|name| name.to_str());
        name.is_some_and(|name| USUAL.contains(&name))
    };
    let paths = paths.iter().filter(|path| is_usual(path));
    paths.cloned().collect()
}

/// A blob's instructions on each core: mean of each work, of both cameras together.
pub(crate) fn means(blob: &BlobCost) -> BTreeMap<&'static str, f64> {
    let mut sums: BTreeMap<&'static str, (f64, f64)> = BTreeMap::new();
    for row in &blob.rows {
        let (sum, count) = sums.entry(row.work).or_default();
        *sum += row.instructions.mean;
        *count += 1.0;
    }
    let means = sums.into_iter();
    means
        .map(|(work, (sum, count))| (work, sum / count))
        .collect()
}
