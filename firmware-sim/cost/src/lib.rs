//! What the runtime costs on a Cortex-M4F: instructions and stack from QEMU, code from the images.
//!
//! The image `counting` runs every piece of work between two looks at a timer. QEMU gives each
//! instruction the same time and everything else none, so the timer counts instructions: exactly,
//! and the same in every run. What the two looks and an empty call take is subtracted; a block of a
//! hundred instructions must then count a hundred, or nothing is reported.

mod blobs;
mod count;
mod image;
mod report;
mod stack;
mod text;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::counting::KNOWN_INSTRUCTIONS;
use crate::qemu::{self, QemuError};
use blobs::Asked;
use count::{COUNTING, cost_of_blob};
use image::Image;

pub use blobs::built_in;
pub use image::{Function, Static};
pub use report::{BlobCost, CameraCost, Conditions, Cost, ImageCost, Row, SCHEMA, Spread};
pub use stack::StackBound;

/// The images whose size is reported, what each does, and the functions of each whose stack is.
const IMAGES: [(&str, &str, &[&str]); 3] = [
    (
        "footprint_measure",
        "open, lookup, triangulate",
        &["open", "lookup", "triangulate"],
    ),
    (
        "footprint_covariance",
        "the same and triangulate_with_covariance",
        &[
            "open",
            "lookup",
            "triangulate",
            "triangulate_with_covariance",
        ],
    ),
    ("device", "the device application", &[image::RESET]),
];

/// Why nothing could be counted.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CostError {
    /// There is no QEMU, or no image.
    #[error(transparent)]
    Qemu(#[from] QemuError),
    /// A file could not be read or written.
    #[error("{what}")]
    Io {
        /// Which.
        what: String,
        /// What the system says.
        source: std::io::Error,
    },
    /// A file is not a blob.
    #[error("{} cannot be opened", path.display())]
    Blob {
        /// The file.
        path: PathBuf,
        /// What the runtime says.
        source: ray_runtime::OpenError,
    },
    /// A blob has no camera.
    #[error("{} has no camera", path.display())]
    NoCamera {
        /// The file.
        path: PathBuf,
    },
    /// No pixels of two cameras were found whose rays meet.
    #[error("{}: of {tries} random pairs of pixels, none gives a point", path.display())]
    NoMatches {
        /// The file.
        path: PathBuf,
        /// Pairs that were tried.
        tries: usize,
    },
    /// An image is no ELF file.
    #[error("{} cannot be read as an image", path.display())]
    Elf {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: object::Error,
    },
    /// The counting image failed.
    #[error("the counting image failed on {} ({status})", path.display())]
    Failed {
        /// The blob that it was given.
        path: PathBuf,
        /// How it ended.
        status: std::process::ExitStatus,
    },
    /// The counting image did not write what it should have written.
    #[error("the counting image wrote {records} records, not {expected}")]
    Records {
        /// How many came.
        records: usize,
        /// How many there should be.
        expected: usize,
    },
    /// The check of the counting failed: this QEMU does not count.
    #[error("a block of {KNOWN_INSTRUCTIONS} instructions was counted as {counted}")]
    Miscounted {
        /// What came out.
        counted: i64,
    },
    /// The runtime gave no result where it gave one on this computer.
    #[error("{}: `{what}` came to no result in {failed} runs", path.display())]
    NoResult {
        /// The blob.
        path: PathBuf,
        /// The work.
        what: &'static str,
        /// Runs without result.
        failed: usize,
    },
}

/// Counts the given blobs; the images are built first when they are missing or stale.
///
/// # Errors
/// [`CostError`].
pub fn measure(paths: &[PathBuf]) -> Result<Cost, CostError> {
    let qemu = qemu::version()?;
    let asked = paths
        .iter()
        .map(|path| Asked::read(path))
        .collect::<Result<Vec<_>, _>>()?;
    let mut names = vec![COUNTING];
    names.extend(IMAGES.map(|(name, ..)| name));
    qemu::build_images(&names)?;

    let counting = Image::read(&qemu::image_path(COUNTING))?;
    let mut conditions = Conditions {
        target: "thumbv7em-none-eabihf",
        machine: "mps2-an386, cortex-m4",
        qemu,
        compiler: counting.compiler.clone().unwrap_or_default(),
        profile: "opt-level 3, fat LTO, one codegen unit, panic = abort",
        known_block: KNOWN_INSTRUCTIONS,
        known_block_counted: 0,
        overhead: 0,
    };
    let mut blobs = Vec::new();
    for (path, asked) in paths.iter().zip(&asked) {
        blobs.push(cost_of_blob(&counting, path, asked, &mut conditions)?);
    }
    let newest_only = Image::read(&qemu::build_newest_only_image(IMAGES[0].0)?)?;
    let images = IMAGES
        .iter()
        .map(|(name, does, functions)| image_cost(name, does, functions))
        .collect::<Result<_, _>>()?;
    Ok(Cost {
        schema: SCHEMA,
        conditions,
        blobs,
        images,
        newest_only_code_bytes: runtime_code_bytes(&newest_only.code_by_origin()),
    })
}

/// The functions of an image that have to do with panics: none, if it links only without.
///
/// # Errors
/// [`CostError::Io`], [`CostError::Elf`].
pub fn panics_in(image: &Path) -> Result<Vec<String>, CostError> {
    Ok(Image::read(image)?.panics())
}

/// Of an image that calls the runtime and does nothing else.
fn runtime_code_bytes(code_by_origin: &BTreeMap<String, u64>) -> u64 {
    let of_runtime = code_by_origin
        .iter()
        .filter(|(origin, _)| *origin != image::STARTUP);
    of_runtime.map(|(_, bytes)| bytes).sum()
}

fn image_cost(
    name: &'static str,
    does: &'static str,
    functions: &[&'static str],
) -> Result<ImageCost, CostError> {
    let image = Image::read(&qemu::image_path(name))?;
    let code_by_origin = image.code_by_origin();
    let calls_runtime_alone = functions != [image::RESET];
    let runtime_code_bytes = runtime_code_bytes(&code_by_origin);
    let bound = |function: &&'static str| (*function, image.stack_bound(name, function));
    Ok(ImageCost {
        image: name,
        does,
        ram_besides_stack: image.ram_besides_stack(),
        runtime_code_bytes: calls_runtime_alone.then_some(runtime_code_bytes),
        panics: image.panics(),
        stack_bounds: functions.iter().map(bound).collect(),
        code_by_origin,
        sections: image.sections,
        functions: image.functions,
        statics: image.statics,
    })
}
