//! What the runtime costs on a Cortex-M4F: instructions and stack from QEMU, code from the images.
//!
//! The image `counting` runs every piece of work between two looks at a counter. QEMU gives each
//! instruction the same time and everything else none, so it counts instructions: exactly,
//! and the same in every run. What the two looks and an empty call take is subtracted; a block of a
//! hundred instructions must then count a hundred, or nothing is reported.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::blobs::Asked;
use crate::cores::{CORTEX_M4F, Core};
use crate::count::{COUNTING, COUNTING_FEATURES, cost_of_blob};
use crate::counting::KNOWN_INSTRUCTIONS;
use crate::error::CostError;
use crate::image::{Image, RESET, STARTUP};
use crate::images::Images;
use crate::report::{Conditions, Cost, FormsCode, ImageCost, SCHEMA};

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
    ("device", "the device application", &[RESET]),
];

/// Features with which the first image is built besides.
const FORMS: [&str; 3] = ["patches", "quantized", "patches,quantized"];

/// Counts the given blobs; the images are built first when they are missing or stale.
///
/// # Errors
/// [`CostError`].
pub fn measure(images: &impl Images, paths: &[PathBuf]) -> Result<Cost, CostError> {
    let core = &CORTEX_M4F;
    let qemu = images.qemu_version(core)?;
    let asked = paths
        .iter()
        .map(|path| Asked::read(path))
        .collect::<Result<Vec<_>, _>>()?;
    // Not in one go: what only counts points in integers must not be in the code of the others.
    images.build(core, &[COUNTING], COUNTING_FEATURES)?;
    images.build(core, &IMAGES.map(|(name, ..)| name), "")?;

    let counting = Image::read(&images.path(core, COUNTING))?;
    let mut conditions = conditions(core, qemu, &counting);
    let mut blobs = Vec::new();
    for (path, asked) in paths.iter().zip(&asked) {
        blobs.push(cost_of_blob(
            images,
            core,
            &counting,
            path,
            asked,
            &mut conditions,
        )?);
    }
    let forms = FORMS
        .into_iter()
        .map(|features| {
            let image = Image::read(&images.build_with(IMAGES[0].0, features)?)?;
            let code_bytes = runtime_code_bytes(&image.code_by_origin());
            Ok(FormsCode {
                features,
                code_bytes,
            })
        })
        .collect::<Result<_, CostError>>()?;
    let costs = IMAGES
        .iter()
        .map(|(name, does, functions)| image_cost(&images.path(core, name), name, does, functions))
        .collect::<Result<_, _>>()?;
    Ok(Cost {
        schema: SCHEMA,
        conditions,
        blobs,
        images: costs,
        forms,
    })
}

/// What an image is counted with, before anything is.
pub(crate) fn conditions(core: &Core, qemu: String, image: &Image) -> Conditions {
    Conditions {
        target: core.target,
        machine: format!("{}, {}", core.machine, core.cpu),
        qemu,
        compiler: image.compiler.clone().unwrap_or_default(),
        profile: "opt-level 3, fat LTO, one codegen unit, panic = abort",
        known_block: KNOWN_INSTRUCTIONS,
        known_block_counted: 0,
        overhead: 0,
    }
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
        .filter(|(origin, _)| *origin != STARTUP);
    of_runtime.map(|(_, bytes)| bytes).sum()
}

fn image_cost(
    path: &Path,
    name: &'static str,
    does: &'static str,
    functions: &[&'static str],
) -> Result<ImageCost, CostError> {
    let image = Image::read(path)?;
    let code_by_origin = image.code_by_origin();
    let calls_runtime_alone = functions != [RESET];
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
