//! Every check image `cortex-m/src/bin/NAME.rs` with a `NAME.out` beside it, run in QEMU and
//! compared with that file. Their flash holds the golden blob. With `OVERWRITE=1` in the
//! environment, what was printed is accepted.

use std::path::Path;

use firmware_sim::simulated::qemu;

#[test]
fn check_images_print_what_they_should() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("cortex-m/src/bin");
    let overwrite = std::env::var_os("OVERWRITE").is_some_and(|value| value == "1");
    let flash = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/golden/stereo-v2.rays");

    let mut compared = 0;
    for entry in std::fs::read_dir(&folder).unwrap() {
        let expected_file = entry.unwrap().path();
        if expected_file
            .extension()
            .is_none_or(|extension| extension != "out")
        {
            continue;
        }
        let name = expected_file.file_stem().unwrap().to_str().unwrap();
        let image = qemu::build_image(name).unwrap();
        let output = qemu::DEVICE.run_to_end(&image, Some(&flash)).unwrap();
        let printed = String::from_utf8(output.stdout).unwrap();
        assert!(
            output.status.success(),
            "{name}: {}\n{printed}",
            output.status
        );
        if overwrite {
            std::fs::write(&expected_file, &printed).unwrap();
        }
        let expected = std::fs::read_to_string(&expected_file).unwrap();
        assert_eq!(
            printed, expected,
            "{name} printed something else (left) than {name}.out"
        );
        compared += 1;
    }
    assert!(compared > 0, "no NAME.out in {}", folder.display());
}
