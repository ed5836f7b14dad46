//! `rays`, driven as a user drives it: the rays of pixels, from a calibration and from the blob packed from it.

use crate::common::{calibration, contents, rig, run, run_with_input};
use calib_rays::geometry::PixelPoint;
use nalgebra::Vector3;
use std::fs;
use std::path::Path;

const PIXELS: &str = "id,u,v\na,320,240\n\"b, side\",3,4\n00c, 100.25 ,300.5\nd,-7,1e9\n";
const RAYS: [&str; 7] = [
    "rays",
    "calibration.json",
    "pixels.csv",
    "--camera",
    "right",
    "-o",
    "rays.csv",
];

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let json = calibration().to_json().unwrap();
    fs::write(path.join("calibration.json"), json).unwrap();
    let pack = ["pack", "calibration.json", "-o", "rig.rays"];
    run(path, &[&pack[..], &["--max-error-px", "0.002"]].concat()).assert_code(0);
    fs::write(path.join("pixels.csv"), PIXELS).unwrap();
    folder
}

fn rows(folder: &Path) -> Vec<String> {
    let text = fs::read_to_string(folder.join("rays.csv")).unwrap();
    let mut lines = text.lines().map(str::to_owned);
    assert_eq!(lines.next().as_deref(), Some("id,ox,oy,oz,dx,dy,dz,status"));
    lines.collect()
}

#[test]
fn one_row_per_pixel_in_order() {
    let folder = folder();
    let path = folder.path();
    let camera = &rig().cameras[1];
    // Round-off of f64; 0.002 px of 600 px, and f32 at half a meter.
    for (file, angle, place_mm) in [("calibration.json", 1e-15, 1e-12), ("rig.rays", 4e-6, 1e-4)] {
        let arguments = RAYS.map(|word| if word == RAYS[1] { file } else { word });
        let said = run(path, &arguments);
        said.assert_code(0)
            .assert_prints(&["2 of 4 pixels have a ray, 2 outside"]);
        let rows = rows(path);
        assert_eq!(rows.len(), 4);
        assert_eq!(rows[1], "\"b, side\",,,,,,,outside");
        assert_eq!(rows[3], "d,,,,,,,outside");
        for (row, id, pixel) in [(0, "a", [320.0, 240.0]), (2, "00c", [100.25, 300.5])] {
            let fields: Vec<&str> = rows[row].split(',').collect();
            assert_eq!((fields[0], fields[7], fields.len()), (id, "ok", 8));
            let at = |k: usize| fields[k].parse::<f64>().unwrap();
            let truth = camera
                .ray_in_rig(PixelPoint::new(pixel[0], pixel[1]))
                .unwrap();
            let origin = Vector3::new(at(1), at(2), at(3));
            let direction = Vector3::new(at(4), at(5), at(6));
            assert!((origin - truth.origin_mm).norm() < place_mm);
            assert!((direction - truth.direction.normalize()).norm() < angle);
        }
    }
}

#[test]
fn standard_input_gives_the_same_bytes_as_a_file() {
    let folder = folder();
    let path = folder.path();
    run(path, &RAYS).assert_code(0);
    let from_file = fs::read(path.join("rays.csv")).unwrap();
    let arguments = RAYS.map(|word| if word == RAYS[2] { "-" } else { word });
    run_with_input(path, &arguments, Some(PIXELS.as_bytes())).assert_code(0);
    assert_eq!(fs::read(path.join("rays.csv")).unwrap(), from_file);
}

#[test]
fn wrong_lists_are_refused_with_their_line_and_nothing_is_written() {
    let folder = folder();
    let path = folder.path();
    let row = |row: &str| format!("id,u,v\na,1,2\n{row}\n");
    let cases = [
        (String::new(), "pixels.csv:1: is empty"),
        ("id,u\n".to_owned(), "pixels.csv:1: the header is \"id,u\""),
        ("id;u;v\n1;2;3\n".to_owned(), "commas between the fields"),
        ("id,v,u\n".to_owned(), "write the header id,u,v"),
        (row("b,1"), "pixels.csv:3: has 2 fields, the header has 3"),
        (row("b,1,2,3"), "one pixel; decimal points"),
        (row("b,,"), "pixels.csv:3: u and v are empty"),
        (row("b,1,"), "pixels.csv:3: one of u and v is empty"),
        (row("b,x,2"), "\"x\" is not a pixel coordinate"),
        (row("b,nan,2"), "not finite"),
        (row("\"b,1,2"), "quote that does not end"),
    ];
    for (text, words) in cases {
        fs::write(path.join("pixels.csv"), &text).unwrap();
        let before = contents(path);
        run(path, &RAYS)
            .assert_code(2)
            .assert_says(&[words, "try: "]);
        assert_eq!(contents(path), before, "{text:?}");
    }
    fs::write(path.join("pixels.csv"), PIXELS).unwrap();
    let before = contents(path);
    let other = RAYS.map(|word| if word == "right" { "top" } else { word });
    run(path, &other)
        .assert_code(2)
        .assert_says(&["no camera \"top\"", "left, right", "try: "]);
    let onto = RAYS.map(|word| {
        if word == "rays.csv" {
            "pixels.csv"
        } else {
            word
        }
    });
    run(path, &onto)
        .assert_code(2)
        .assert_says(&["is what the command reads"]);
    let missing = RAYS.map(|word| if word == RAYS[2] { "none.csv" } else { word });
    run(path, &missing)
        .assert_code(2)
        .assert_says(&["none.csv: cannot be read", "try: "]);
    assert_eq!(contents(path), before);
}
