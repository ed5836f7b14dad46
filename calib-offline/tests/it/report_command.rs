//! `report`: the page again, from `calibration.json` alone.

use crate::common::{calibration, packed_rig, run};
use calib_offline::report::html;
use std::fs;

#[test]
fn the_page_is_that_of_the_calibration_without_its_blob() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let calibration = calibration();
    fs::write(
        path.join("calibration.json"),
        calibration.to_json().unwrap(),
    )
    .unwrap();
    let said = run(path, &["report", "calibration.json", "--json"]);
    assert_eq!(said.assert_code(0).json()["output"], "report.html");
    let page = fs::read_to_string(path.join("report.html")).unwrap();
    assert_eq!(page, html::page(&calibration, None));
    // An earlier page is replaced, anything else is not.
    run(path, &["report", "calibration.json"]).assert_code(0);
    fs::write(path.join("report.html"), "my notes").unwrap();
    run(path, &["report", "calibration.json"])
        .assert_code(2)
        .assert_says(&["exists", "--force"]);
    let piped = run(path, &["report", "calibration.json", "-o", "-"]);
    assert_eq!(piped.assert_code(0).stdout, page);
}

#[test]
fn a_blob_has_no_page() {
    let folder = packed_rig();
    let path = folder.path();
    run(path, &["report", "rig.rays"])
        .assert_code(2)
        .assert_says(&["rig.rays", "a calibration"]);
    assert!(!path.join("report.html").exists());
    run(path, &["report", "none.json"])
        .assert_code(2)
        .assert_says(&["does not exist"]);
}
