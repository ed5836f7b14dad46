//! Points with known places and known poses that cannot be, given to the real binary.

use crate::bad_input::refused;
use crate::common::{MANIFEST, corners_csv, dataset, run};

/// Two cameras and points with known places.
const POINTS: &str = "\
[board]
kind = \"points\"

[[camera]]
name = \"left\"
width = 640
height = 480

[[camera]]
name = \"right\"
width = 640
height = 480
";

/// A block of points of one pose, or its face at z = 0 alone.
fn points_csv(depths: i32) -> Vec<String> {
    let mut lines = vec!["camera,pose,u,v,x_mm,y_mm,z_mm".to_owned()];
    for (camera, shift) in [("left", 0.0), ("right", 40.0)] {
        for k in 0..25 * depths {
            let [x, y, z] = [k % 5, k / 5 % 5, k / 25].map(f64::from);
            let scale = 2000.0 / (500.0 + 20.0 * z);
            let (u, v) = (120.0 + shift + 15.0 * x * scale, 60.0 + 15.0 * y * scale);
            lines.push(format!(
                "{camera},0,{u},{v},{},{},{}",
                15.0 * x,
                15.0 * y,
                20.0 * z
            ));
        }
    }
    lines
}

#[track_caller]
fn refused_points(manifest: &str, change: impl Fn(&mut Vec<String>), code: i32, parts: &[&str]) {
    let mut lines = points_csv(3);
    change(&mut lines);
    refused(manifest, lines.join("\n").as_bytes(), code, parts);
}

/// Whoever writes places in meters gets cameras a tenth of a millimeter apart.
#[test]
fn places_in_meters_are_doubted() {
    let mut lines = vec!["camera,pose,u,v,x_mm,y_mm,z_mm".to_owned()];
    for (camera, right_mm) in [("left", 0.0), ("right", 100.0)] {
        for k in 0..49 * 4 {
            let [x, y, z] = [k % 7, k / 7 % 7, k / 49].map(f64::from);
            let [x, y, z] = [30.0 * x - 60.0, 30.0 * y - 90.0, 40.0 * z];
            // A hundredth of a pixel of noise, the same every time.
            let noise = 0.01 * f64::from(k * 7919 % 13 - 6) / 6.0;
            let u = 320.0 + 900.0 * (x - right_mm) / (700.0 + z) + noise;
            let v = 240.0 + 900.0 * y / (700.0 + z) - noise;
            lines.push(format!(
                "{camera},0,{u},{v},{},{},{}",
                x / 1e3,
                y / 1e3,
                z / 1e3
            ));
        }
    }
    let folder = dataset(POINTS, lines.join("\n").as_bytes());
    let object = run(folder.path(), &["calibrate", "set", "-o", "out", "--json"]).json();
    assert_eq!(object["causes"][0]["cause"], "square-unit", "{object:#}");
    let size = object["causes"][0]["size"].to_string();
    assert!(size.contains("meters"), "{size}");
}

#[test]
fn points_that_cannot_be() {
    refused_points(
        POINTS,
        |lines| lines.push(lines[7].clone()),
        2,
        &["corners.csv:152:", "(15, 15, 0) mm", "pose 0", "line 8"],
    );
    refused_points(
        POINTS,
        |lines| lines[3] = lines[3].replace("left", "middle"),
        2,
        &["corners.csv:4:", "middle", "left, right"],
    );
    refused_points(
        POINTS,
        |lines| lines[0] = "camera,pose,u,v,x_mm,y_mm".to_owned(),
        2,
        &["corners.csv:1:", "x_mm,y_mm,z_mm"],
    );
    refused_points(
        POINTS,
        |lines| lines[0] = "camera,pose,row,col,u,v".to_owned(),
        2,
        &["corners.csv:1:", "kind = \"chessboard\""],
    );
    refused_points(
        POINTS,
        |lines| lines[4] = "left,0,10,10,0,0,nan".to_owned(),
        2,
        &["corners.csv:5:", "z_mm is NaN"],
    );
    refused_points(
        &POINTS.replace("kind", "rows = 6\nkind"),
        |_| (),
        2,
        &["dataset.toml:2:", "rows", "\"points\""],
    );
    refused_points(
        &POINTS.replace("points", "dots"),
        |_| (),
        2,
        &["dataset.toml:2:", "\"dots\"", "\"points\""],
    );
}

#[test]
fn points_that_determine_nothing() {
    let flat = points_csv(1).join("\n");
    refused(
        POINTS,
        flat.as_bytes(),
        3,
        &["\"left\"", "one plane", "[poses] known"],
    );
    refused_points(
        POINTS,
        |lines| lines.retain(|line| !line.starts_with("left") || line.contains(",0,0,")),
        3,
        &["\"left\"", "on a line"],
    );
}

#[test]
fn known_poses_that_cannot_be() {
    let manifest = format!("[poses]\nknown = \"poses.csv\"\n{MANIFEST}");
    let header = "pose,x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg";
    for (text, parts) in [
        (String::new(), &["poses.csv:1:", header][..]),
        (header.to_owned(), &["poses.csv:1:", "no pose"]),
        (
            format!("{header}\n0,0,0,0,0,0"),
            &["poses.csv:2:", "6 fields"],
        ),
        (
            format!("{header}\n0,0,0,inf,0,0,0"),
            &["poses.csv:2:", "z_mm is \"inf\""],
        ),
        (
            format!("{header}\n1,0,0,0,0,0,0\n\n1,0,0,9,0,0,0"),
            &["poses.csv:4:", "line 2"],
        ),
    ] {
        let folder = dataset(&manifest, corners_csv(6).as_bytes());
        std::fs::write(folder.path().join("set/poses.csv"), text).unwrap();
        run(folder.path(), &["calibrate", "set", "-o", "out"])
            .assert_code(2)
            .assert_says(parts)
            .assert_says(&["try: "]);
    }
    refused(
        &manifest,
        corners_csv(6).as_bytes(),
        2,
        &["poses.csv", "cannot be read"],
    );
}
