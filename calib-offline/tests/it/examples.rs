//! The examples run to their end.

use std::error::Error;
use std::path::Path;

type Example = fn() -> Result<(), Box<dyn Error>>;

#[path = "../../examples/04_n_cameras.rs"]
mod n_cameras;
#[path = "../../examples/05_on_the_device.rs"]
mod on_the_device;
#[allow(
    dead_code,
    reason = "its main reads the arguments, which here are the test runner's"
)]
#[path = "../../examples/01_one_call.rs"]
mod one_call;
#[path = "../../examples/02_own_corners.rs"]
mod own_corners;
#[path = "../../examples/03_own_lens.rs"]
mod own_lens;

#[test]
fn every_example_runs() {
    let examples: [Example; 5] = [
        || one_call::run(Path::new(one_call::SHIPPED)),
        own_corners::main,
        own_lens::main,
        n_cameras::main,
        on_the_device::main,
    ];
    // None is left out.
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/examples");
    assert_eq!(std::fs::read_dir(folder).unwrap().count(), examples.len());
    for (k, example) in examples.into_iter().enumerate() {
        example().unwrap_or_else(|error| panic!("example {}: {error}", k + 1));
    }
}
